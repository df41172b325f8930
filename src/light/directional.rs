//! Parallel light from infinity.

use super::{LightSample, Target, grey};
use crate::math::{Rgb, Vec3};

/// Light that travels in one direction everywhere.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `irradiance` | 1 | power per area on a plane facing the light; colour, no texture |
/// | `direction` | +z | where the light travels to; length does not matter |
/// | `to_world` | identity | instead of `direction`: light travels along its +z; may be an `<animation>` |
#[derive(Clone, Debug)]
pub struct Directional {
    /// Irradiance on a plane facing the light.
    pub irradiance: Rgb,
    /// Unit direction towards the light.
    pub towards: Vec3,
    /// `sampling_weight`.
    pub weight: f32,
}

impl Directional {
    pub(super) fn sample(&self) -> Option<LightSample> {
        Some(LightSample {
            wi: self.towards,
            radiance: self.irradiance,
            pdf: 1.0,
            delta: true,
            target: Target::Infinite,
        })
    }

    pub(super) fn normal_irradiance(&self) -> f64 {
        grey(self.irradiance)
    }
}
