//! Rough interface of two dielectrics: Walter et al. 2007, equations 20 and
//! 21, with separable Smith shadowing; sampled by a visible normal and then by
//! its Fresnel reflectance.
//!
//! Everything is turned to the side of `wo`, so that wo.z > 0 and η is that of
//! the far side over the near one. With h = wo + η·wi the half vector of
//! refraction is ±h/|h| and (wo·m + η·wi·m)² = |h|², which is computed in f64:
//! it cancels for η ≈ 1.
//!
//! Where α·|η − 1| falls below [`ALPHA_MIN`] the refracted lobe is narrower
//! than directions in f32 resolve; it is then sampled as it is but flagged as
//! a delta. Matched indices (η = 1) pass straight.

use super::BsdfSample;
use super::fresnel::{fresnel_between, reflect, refract};
use super::microfacet::{ALPHA_MIN, Microfacet, unit};
use super::rough_conductor::reflection_terms;
use crate::math::{Rgb, Vec2, Vec3};

/// Interface of many small panes, both sides. Single scattering: what is
/// scattered twice is lost, more with more roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughDielectric {
    /// Distribution of the normals of the small panes.
    pub distribution: Microfacet,
    /// η inside (below the normal) over outside.
    pub eta: f32,
    /// Factor on reflection; 1 is physical.
    pub specular_reflectance: Rgb,
    /// Factor on transmission; 1 is physical.
    pub specular_transmittance: Rgb,
}

/// Geometry of a refraction.
pub(super) struct Refraction {
    /// Unit normal of the small pane, on the side of `wo`.
    pub m: Vec3,
    /// ⟨wo, m⟩ > 0.
    pub wo_m: f32,
    /// |⟨wi, m⟩| / |wo + η·wi|².
    pub wi_m_over_h2: f32,
}

impl RoughDielectric {
    /// True when both lobes are too narrow to evaluate.
    pub(super) fn is_delta_only(&self) -> bool {
        self.distribution.is_delta() || self.eta == 1.0
    }

    fn transmits_delta(&self) -> bool {
        let width = self.distribution.alpha().max_element() * (self.eta - 1.0).abs() / self.eta.max(1.0);
        self.distribution.is_delta() || width < ALPHA_MIN
    }

    /// η of the far side over the near one, and the sign that turns `wo` up.
    fn oriented(&self, wo: Vec3) -> (f32, Vec3) {
        if wo.z > 0.0 { (self.eta, Vec3::ONE) } else { (1.0 / self.eta, Vec3::new(1.0, 1.0, -1.0)) }
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let (eta, flip) = self.oriented(wo);
        let (wo, wi) = (wo * flip, wi * flip);
        let nothing = (Rgb::ZERO, 0.0);
        if !(wo.z > 0.0) || wi.z == 0.0 {
            return nothing;
        }
        if wi.z > 0.0 {
            if self.distribution.is_delta() {
                return nothing;
            }
            let m = unit(wo + wi);
            let r = fresnel_between(wo, m, eta).r;
            let (value, pdf) = reflection_terms(&self.distribution, wo, wi, m);
            return (self.specular_reflectance * (r * value), r * pdf);
        }
        if self.transmits_delta() {
            return nothing;
        }
        let Some(Refraction { m, wo_m, wi_m_over_h2 }) = refraction(wo, wi, eta) else {
            return nothing;
        };
        let t = 1.0 - fresnel_between(wo, m, eta).r;
        let common = t * self.distribution.d(m) * wo_m * wi_m_over_h2;
        // The η² of the Jacobian is undone by the scaling of radiance.
        let value = common * self.distribution.g1_over_cos(wo) * self.distribution.g1(wi);
        let pdf = common * self.distribution.visible_over_cos(wo) * eta * eta;
        (self.specular_transmittance * value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (eta, flip) = self.oriented(wo);
        let up = wo * flip;
        if !(up.z > 0.0) {
            return None;
        }
        let m = self.distribution.sample(up, u);
        let fresnel = fresnel_between(up, m, eta);
        let correction = self.distribution.g1_correction(up);

        if u_lobe < fresnel.r {
            let wi = reflect(up, m);
            if !(wi.z > 0.0) {
                return None;
            }
            let weight = self.specular_reflectance * (correction * self.distribution.g1(wi));
            if self.distribution.is_delta() {
                return BsdfSample::delta(wi * flip, weight, fresnel.r);
            }
            return BsdfSample::smooth(wi * flip, weight, self.eval_pdf(up * flip, wi * flip).1);
        }

        let wi = if self.eta == 1.0 { -up } else { unit(refract(up, m, &fresnel)) };
        if !(wi.z < 0.0) {
            return None;
        }
        let scale = fresnel.eta_ti * fresnel.eta_ti;
        // Without a bend there is nothing rough to be shadowed by.
        let shadowing = if self.eta == 1.0 { 1.0 } else { correction * self.distribution.g1(wi) };
        let weight = self.specular_transmittance * (scale * shadowing);
        let sample = if self.transmits_delta() {
            BsdfSample::delta(wi * flip, weight, 1.0 - fresnel.r)
        } else {
            BsdfSample::smooth(wi * flip, weight, self.eval_pdf(wo, wi * flip).1)
        };
        sample.map(|s| BsdfSample { eta: fresnel.eta_it, ..s })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let r = super::fresnel::fresnel_local(wo, self.eta).r;
        self.specular_reflectance * r + self.specular_transmittance * (1.0 - r)
    }
}

/// The small pane that refracts `wo` (up) into `wi` (down); `None` when it
/// would have to be seen from behind.
pub(super) fn refraction(wo: Vec3, wi: Vec3, eta: f32) -> Option<Refraction> {
    let (wo, wi) = (wo.as_dvec3(), wi.as_dvec3());
    let h = wo + wi * f64::from(eta);
    let h2 = h.length_squared();
    let m = h / h2.sqrt().copysign(h.z);
    let (wo_m, wi_m) = (wo.dot(m), wi.dot(m));
    (wo_m > 0.0 && wi_m < 0.0).then(|| Refraction {
        m: m.as_vec3(),
        wo_m: wo_m as f32,
        wi_m_over_h2: (-wi_m / h2) as f32,
    })
}
