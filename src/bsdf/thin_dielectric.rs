//! A pane so thin that light leaves it where and as it came, with all its
//! internal reflections: r' = r + t²r + t²r³ + … = 2r/(1 + r).

use super::BsdfSample;
use super::dielectric::mirror;
use super::fresnel::fresnel_dielectric;
use crate::math::{Rgb, Vec2, Vec3};

/// Thin pane, both sides. What passes is not bent: it counts as null.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinDielectric {
    /// η of the pane over that of its surroundings.
    pub eta: f32,
    /// Factor on reflection; 1 is physical.
    pub specular_reflectance: Rgb,
    /// Factor on transmission; 1 is physical.
    pub specular_transmittance: Rgb,
}

impl ThinDielectric {
    fn reflectance(&self, wo: Vec3) -> f32 {
        let r = fresnel_dielectric(wo.z.abs(), self.eta).r;
        2.0 * r / (1.0 + r)
    }

    pub(super) fn eval_pdf(&self, _wo: Vec3, _wi: Vec3) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let r = self.reflectance(wo);
        if u_lobe < r {
            return BsdfSample::delta(mirror(wo), self.specular_reflectance, r);
        }
        let sample = BsdfSample::delta(-wo, self.specular_transmittance, 1.0 - r)?;
        Some(BsdfSample { null: true, ..sample })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let r = self.reflectance(wo);
        self.specular_reflectance * r + self.specular_transmittance * (1.0 - r)
    }
}
