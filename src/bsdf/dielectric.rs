//! Smooth interface of two dielectrics: Fresnel reflection and refraction.

use super::BsdfSample;
use super::fresnel::fresnel_local;
use crate::math::{Rgb, Vec2, Vec3};

/// Ideally smooth interface, both sides. Matched indices (η = 1) let the path
/// pass straight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// η inside (below the normal) over outside.
    pub eta: f32,
    /// Factor on reflection; 1 is physical.
    pub specular_reflectance: Rgb,
    /// Factor on transmission; 1 is physical.
    pub specular_transmittance: Rgb,
}

impl Dielectric {
    pub(super) fn eval_pdf(&self, _wo: Vec3, _wi: Vec3) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let fresnel = fresnel_local(wo, self.eta);
        if u_lobe < fresnel.r {
            return BsdfSample::delta(mirror(wo), self.specular_reflectance, fresnel.r);
        }
        let ti = fresnel.eta_ti;
        // Without a border it goes on as it came, to the bit.
        let wi = match self.eta {
            1.0 => -wo,
            _ => Vec3::new(-ti * wo.x, -ti * wo.y, fresnel.cos_t).normalize(),
        };
        let weight = self.specular_transmittance * (ti * ti);
        let sample = BsdfSample::delta(wi, weight, 1.0 - fresnel.r)?;
        Some(BsdfSample { eta: fresnel.eta_it, ..sample })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let r = fresnel_local(wo, self.eta).r;
        self.specular_reflectance * r + self.specular_transmittance * (1.0 - r)
    }
}

/// The mirror direction about z.
pub(super) fn mirror(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}
