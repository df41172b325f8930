//! A surrounding of one colour.

use super::{LightSample, Target, grey};
use crate::math::{Rgb, Vec2};
use crate::sampling::{UNIFORM_SPHERE_PDF, uniform_sphere};

/// The same radiance from everywhere.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `radiance` | 1 | colour, no texture |
/// | `to_world` | identity | accepted as in Mitsuba; turning it changes nothing |
#[derive(Clone, Debug)]
pub struct Constant {
    /// Radiance from every direction.
    pub radiance: Rgb,
    /// `sampling_weight`.
    pub weight: f32,
}

impl Constant {
    pub(super) fn sample(&self, u: Vec2) -> Option<LightSample> {
        Some(LightSample {
            wi: uniform_sphere(u),
            radiance: self.radiance,
            pdf: self.pdf(),
            delta: false,
            target: Target::Infinite,
        })
    }

    /// Zero for a black surrounding, which `sample` never chooses.
    pub(super) fn pdf(&self) -> f32 {
        if self.radiance == Rgb::ZERO { 0.0 } else { UNIFORM_SPHERE_PDF }
    }

    /// ∫ L dω over all directions, mean of channels.
    pub(super) fn radiance_integral(&self) -> f64 {
        4.0 * std::f64::consts::PI * grey(self.radiance)
    }
}
