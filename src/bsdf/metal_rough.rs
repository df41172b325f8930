//! The core of a glTF surface: metal or a dielectric on a diffuse base, GGX,
//! without loss of energy.
//!
//! The specular part is glTF's: D·G·F with Schlick's F, f₀ and f₉₀ mixed by
//! the metalness. glTF weighs the diffuse base by 1 − F of the half vector,
//! which loses light at some angles and makes some at others; here the base
//! gets what the specular part leaves, T(w), in both directions:
//! f = ρ·T(wo)·T(wi)/(π·⟨T⟩), T = 1 − f₀·A − f₉₀·B − F̂·loss (`energy.rs`).
//! White stays white at any roughness and angle.

use std::f32::consts::FRAC_1_PI;

use super::BsdfSample;
use super::energy::{GGX, Row, Split, multiple, schlick};
use super::fresnel::reflect;
use super::mean;
use super::microfacet::{Distribution, Microfacet, unit};
use super::rough_conductor::reflection_terms;
use crate::math::{Rgb, Vec2, Vec3};
use crate::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};

/// What a glTF surface is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substance {
    /// Colour of the metal, albedo of the base; [0, 1].
    pub base_color: Rgb,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f32,
    /// √α; [0, 1].
    pub roughness: f32,
    /// Reflectance of the dielectric at the normal; [0, 1].
    pub f0: Rgb,
    /// And at grazing.
    pub f90: f32,
}

impl Substance {
    /// f₀ and f₉₀ of the mixture of metal and dielectric.
    pub(super) fn schlick_terms(&self) -> (Rgb, f32) {
        let m = self.metallic;
        (self.f0 * (1.0 - m) + self.base_color * m, self.f90 * (1.0 - m) + m)
    }
}

/// A [`Substance`] without anything on it or in it, isotropic.
#[derive(Clone, Copy, Debug)]
pub struct MetalRough {
    distribution: Microfacet,
    row: Row,
    /// Of the mixture.
    f0: Rgb,
    f90: f32,
    /// F̂ of the mixture.
    multiple: Rgb,
    /// (1 − metalness)·ρ.
    diffuse: Rgb,
    /// 1/(π⟨loss⟩) and 1/(π⟨T⟩).
    scale: (f32, f32),
    /// Means of the channels of f₀, F̂ and the diffuse albedo: the choice of a
    /// lobe.
    grey: (f32, f32, f32),
    /// Largest channel of the dielectric's f₀, its f₉₀ and its F̂.
    taken: (f32, f32, f32),
    two_sided: bool,
}

impl MetalRough {
    /// The surface; `two_sided` when it looks the same from behind, else that
    /// side is black.
    #[must_use]
    pub fn new(substance: &Substance, two_sided: bool) -> MetalRough {
        let Substance { base_color, metallic, roughness, f0, f90 } = *substance;
        let roughness = if roughness > 0.0 { roughness.min(1.0) } else { 0.0 };
        let alpha = roughness * roughness;
        let (mixed0, mixed90) = substance.schlick_terms();
        let average = GGX.mean(roughness);
        let dielectric = multiple(f0, f90, average.loss);
        let metal = multiple(base_color, 1.0, average.loss);
        let taken = (f0.max_element(), f90, dielectric.max_element());
        let passed = 1.0 - taken.0 * average.a() - taken.1 * average.b - taken.2 * average.loss;
        let hat = dielectric * (1.0 - metallic) + metal * metallic;
        let diffuse = base_color * (1.0 - metallic);
        MetalRough {
            distribution: Microfacet::new(Distribution::Ggx, alpha, alpha),
            row: Row::new(roughness),
            f0: mixed0,
            f90: mixed90,
            multiple: hat,
            diffuse,
            scale: (FRAC_1_PI / average.loss.max(1e-9), FRAC_1_PI / passed.max(1e-9)),
            grey: (mean(mixed0), mean(hat), mean(diffuse)),
            taken,
            two_sided,
        }
    }

    /// True when nothing but a mirror is left.
    pub(super) fn is_delta_only(&self) -> bool {
        self.distribution.is_delta() && self.diffuse == Rgb::ZERO
    }

    pub(super) fn is_one_sided(&self) -> bool {
        !self.two_sided
    }

    /// What the first bounce does towards `cos`.
    fn split(&self, cos: f32) -> Split {
        if self.distribution.is_delta() {
            Split { loss: 0.0, b: schlick(cos) }
        } else {
            GGX.at(cos, self.row)
        }
    }

    /// T: what reaches the base.
    fn passed(&self, split: Split) -> f32 {
        let (f0, f90, multiple) = self.taken;
        (1.0 - f0 * split.a() - f90 * split.b - multiple * split.loss).max(0.0)
    }

    /// Probability of the specular lobe, by what each returns in all.
    fn choice(&self, o: Split, passed: f32) -> Option<f32> {
        let (f0, multiple, diffuse) = self.grey;
        let specular = f0 * o.a() + self.f90 * o.b;
        let all = specular + multiple * o.loss + diffuse * passed;
        (all > 0.0).then(|| specular / all)
    }

    /// Both directions on the upper side; `None` when they are not on one
    /// that scatters.
    fn turned(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        if wo.z > 0.0 && wi.z > 0.0 {
            Some((wo, wi))
        } else if self.two_sided && wo.z < 0.0 && wi.z < 0.0 {
            Some((-wo, -wi))
        } else {
            None
        }
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let Some((wo, wi)) = self.turned(wo, wi) else { return (Rgb::ZERO, 0.0) };
        let (o, i) = (self.split(wo.z), self.split(wi.z));
        let passed = self.passed(o);
        let Some(p) = self.choice(o, passed) else { return (Rgb::ZERO, 0.0) };
        let multiple = self.multiple * (o.loss * i.loss * self.scale.0);
        let diffuse = self.diffuse * (passed * self.passed(i) * self.scale.1);
        let mut value = (multiple + diffuse) * wi.z;
        let mut pdf = (1.0 - p) * cosine_hemisphere_pdf(wi.z);
        if !self.distribution.is_delta() {
            let m = unit(wo + wi);
            let s = schlick(wo.dot(m));
            let (reflection, density) = reflection_terms(&self.distribution, wo, wi, m);
            value += (self.f0 * (1.0 - s) + self.f90 * s) * reflection;
            pdf += p * density;
        }
        (value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let flipped = self.two_sided && wo.z < 0.0;
        let up = if flipped { -wo } else { wo };
        if !(up.z > 0.0) {
            return None;
        }
        let back = |wi: Vec3| if flipped { -wi } else { wi };
        let o = self.split(up.z);
        let p = self.choice(o, self.passed(o))?;
        let wi = if u_lobe < p {
            let m = self.distribution.sample(up, u);
            let wi = reflect(up, m);
            if !(wi.z > 0.0) {
                return None;
            }
            if self.distribution.is_delta() {
                let s = schlick(up.dot(m));
                let weight = (self.f0 * (1.0 - s) + self.f90 * s) * (self.distribution.g1(wi) / p);
                return BsdfSample::delta(back(wi), weight, p);
            }
            wi
        } else {
            cosine_hemisphere(u)
        };
        let (value, pdf) = self.eval_pdf(up, wi);
        BsdfSample::smooth(back(wi), value / pdf, pdf)
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let cos = if self.two_sided { wo.z.abs() } else { wo.z };
        if !(cos > 0.0) {
            return Rgb::ZERO;
        }
        let o = self.split(cos);
        self.f0 * o.a() + Rgb::splat(self.f90 * o.b) + self.multiple * o.loss + self.diffuse * self.passed(o)
    }
}
