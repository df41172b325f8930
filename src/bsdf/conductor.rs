//! Smooth metal: Fresnel reflection with a complex index.

use super::BsdfSample;
use super::dielectric::mirror;
use super::fresnel::fresnel_conductor;
use crate::math::{Rgb, Vec2, Vec3};

/// Ideally smooth metal, one-sided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// Real part of the index of refraction. 0 with k = 1 reflects everything.
    pub eta: Rgb,
    /// Imaginary part of the index of refraction (extinction).
    pub k: Rgb,
    /// Factor on reflection; 1 is physical.
    pub specular_reflectance: Rgb,
}

impl Conductor {
    pub(super) fn eval_pdf(&self, _wo: Vec3, _wi: Vec3) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    pub(super) fn sample(&self, wo: Vec3, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        if !(wo.z > 0.0) {
            return None;
        }
        BsdfSample::delta(mirror(wo), self.albedo(wo), 1.0)
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        if !(wo.z > 0.0) {
            return Rgb::ZERO;
        }
        self.specular_reflectance * fresnel_conductor(wo.z.min(1.0), self.eta, self.k)
    }
}
