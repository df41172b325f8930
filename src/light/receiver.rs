//! Who asks a light for a sample.

use crate::math::Vec3;

/// A point as lights see it: sampling a light and the density of that sample
/// both take it, so that both know the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Position in the recentred world.
    pub p: Vec3,
    /// Unit normal on the side that reflects; not looked at when `two_sided`.
    pub n: Vec3,
    /// Light from below `n` counts too: the surface transmits, or its normal
    /// is perturbed, or there is no surface.
    pub two_sided: bool,
    /// When it asks, in [0, 1] of the shutter: lamps may move.
    pub time: f32,
}

impl Receiver {
    /// A point that takes light from everywhere, at time 0.
    #[must_use]
    pub fn free(p: Vec3) -> Receiver {
        Receiver { p, n: Vec3::Z, two_sided: true, time: 0.0 }
    }
}
