//! A point that shines the same in all directions.

use super::{LightSample, Target, direction, fall_off, grey};
use crate::math::{Rgb, Vec3};

/// A point light.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `intensity` | 1 | power per solid angle; colour, no texture |
/// | `position` | origin | where it is |
/// | `to_world` | identity | instead of `position`: it is where this maps the origin; may be an `<animation>` |
#[derive(Clone, Debug)]
pub struct Point {
    /// Power per solid angle.
    pub intensity: Rgb,
    /// Position in the recentred world.
    pub position: Vec3,
    /// `sampling_weight`.
    pub weight: f32,
}

impl Point {
    pub(super) fn sample(&self, ref_p: Vec3) -> Option<LightSample> {
        let (wi, distance) = direction(ref_p, self.position)?;
        let radiance = fall_off(self.intensity, 1.0, distance);
        Some(LightSample { wi, radiance, pdf: 1.0, delta: true, target: Target::Point(self.position) })
    }

    pub(super) fn power(&self) -> f64 {
        4.0 * std::f64::consts::PI * grey(self.intensity)
    }
}
