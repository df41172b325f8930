//! Rough metal: f = F·D·G₁(o)·G₁(i) / (4 cos θo cos θi), Walter et al. 2007
//! equation 20, with separable Smith shadowing.

use super::BsdfSample;
use super::fresnel::{fresnel_conductor, reflect};
use super::microfacet::{Microfacet, unit};
use crate::math::{Rgb, Vec2, Vec3};

/// Metal of many small mirrors, one-sided. Single scattering: what is
/// scattered twice is lost, more with more roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughConductor {
    /// Distribution of the normals of the small mirrors.
    pub distribution: Microfacet,
    /// Real part of the index of refraction. 0 with k = 1 reflects everything.
    pub eta: Rgb,
    /// Imaginary part of the index of refraction (extinction).
    pub k: Rgb,
    /// Factor on reflection; 1 is physical.
    pub specular_reflectance: Rgb,
}

impl RoughConductor {
    fn fresnel(&self, cos: f32) -> Rgb {
        self.specular_reflectance * fresnel_conductor(cos.clamp(0.0, 1.0), self.eta, self.k)
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if !(wo.z > 0.0 && wi.z > 0.0) || self.distribution.is_delta() {
            return (Rgb::ZERO, 0.0);
        }
        let m = unit(wo + wi);
        let (value, pdf) = reflection_terms(&self.distribution, wo, wi, m);
        (self.fresnel(wo.dot(m)) * value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if !(wo.z > 0.0) {
            return None;
        }
        let m = self.distribution.sample(wo, u);
        let wi = reflect(wo, m);
        if !(wi.z > 0.0) {
            return None;
        }
        let shadowing = self.distribution.g1(wi) * self.distribution.g1_correction(wo);
        let weight = self.fresnel(wo.dot(m)) * shadowing;
        if self.distribution.is_delta() {
            return BsdfSample::delta(wi, weight, 1.0);
        }
        BsdfSample::smooth(wi, weight, reflection_terms(&self.distribution, wo, wi, unit(wo + wi)).1)
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        if wo.z > 0.0 { self.fresnel(wo.z) } else { Rgb::ZERO }
    }
}

/// f·cos θi without Fresnel factor, and the density of `wi`, for reflection
/// about the unit half vector `m`, with everything on the side of +z.
pub(super) fn reflection_terms(distribution: &Microfacet, wo: Vec3, wi: Vec3, m: Vec3) -> (f32, f32) {
    let quarter = 0.25 * distribution.d(m);
    let value = quarter * distribution.g1_over_cos(wo) * distribution.g1(wi);
    (value, quarter * distribution.visible_over_cos(wo))
}
