//! Lambert's law: f = ρ/π on the side of the normal.

use super::BsdfSample;
use crate::math::{Rgb, Vec2, Vec3};
use crate::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};

/// Ideally diffuse reflection, one-sided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse {
    /// Fraction of light reflected, [0, 1] per channel.
    pub reflectance: Rgb,
}

impl Diffuse {
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if !(wo.z > 0.0 && wi.z > 0.0) || self.reflectance == Rgb::ZERO {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = cosine_hemisphere_pdf(wi.z);
        (self.reflectance * pdf, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if !(wo.z > 0.0) {
            return None;
        }
        let wi = cosine_hemisphere(u);
        BsdfSample::smooth(wi, self.reflectance, cosine_hemisphere_pdf(wi.z))
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        if wo.z > 0.0 { self.reflectance } else { Rgb::ZERO }
    }
}
