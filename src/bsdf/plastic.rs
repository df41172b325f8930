//! Smooth dielectric coat over a diffuse base.

use super::coat::Coat;
use super::dielectric::mirror;
use super::fresnel::fresnel_local;
use super::{BsdfSample, mean};
use crate::math::{Rgb, Vec2, Vec3};
use crate::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};

/// Mirror reflection off the coat and diffuse light from below it, one-sided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    /// The coat, from [`Coat::smooth`].
    pub coat: Coat,
    /// Reflectance of the base, [0, 1] per channel.
    pub diffuse_reflectance: Rgb,
    /// Factor on the mirror reflection; 1 is physical.
    pub specular_reflectance: Rgb,
    /// True for the shift of colour by internal reflections.
    pub nonlinear: bool,
}

impl Plastic {
    /// Probability of the mirror lobe where the coat reflects `r`; `None` when
    /// neither lobe carries anything.
    fn specular_probability(&self, r: f32) -> Option<f32> {
        specular_probability(self.specular_reflectance * r, self.diffuse_reflectance * (1.0 - r))
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return (Rgb::ZERO, 0.0);
        }
        let r = fresnel_local(wo, self.coat.eta()).r;
        let Some(specular) = self.specular_probability(r) else {
            return (Rgb::ZERO, 0.0);
        };
        let t = (1.0 - r) * (1.0 - fresnel_local(wi, self.coat.eta()).r);
        let cosine = cosine_hemisphere_pdf(wi.z);
        (self.coat.base(self.diffuse_reflectance, self.nonlinear) * (t * cosine), (1.0 - specular) * cosine)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if !(wo.z > 0.0) {
            return None;
        }
        let r = fresnel_local(wo, self.coat.eta()).r;
        let specular = self.specular_probability(r)?;
        if u_lobe < specular {
            return BsdfSample::delta(mirror(wo), self.specular_reflectance * (r / specular), specular);
        }
        let wi = cosine_hemisphere(u);
        let (value, pdf) = self.eval_pdf(wo, wi);
        BsdfSample::smooth(wi, value / pdf, pdf)
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        if !(wo.z > 0.0) {
            return Rgb::ZERO;
        }
        let r = fresnel_local(wo, self.coat.eta()).r;
        let base = self.coat.base(self.diffuse_reflectance, self.nonlinear) * self.coat.enter();
        self.specular_reflectance * r + base * (1.0 - r)
    }
}

/// Probability of the specular of two lobes by what they about carry; `None`
/// when that is nothing.
pub(super) fn specular_probability(specular: Rgb, diffuse: Rgb) -> Option<f32> {
    let (s, d) = (mean(specular), mean(diffuse));
    (s + d > 0.0).then(|| s / (s + d))
}
