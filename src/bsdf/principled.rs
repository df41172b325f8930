//! Mitsuba's principled surface: Burley 2012 and 2015 ("Physically Based
//! Shading at Disney", "Extending the Disney BRDF to a BSDF") with the choices
//! of Mitsuba 3.9, value for value, so that a scene looks the same in both.
//!
//! Lobes: a GGX interface of dielectric and metal, refracting where
//! `spec_trans` says so; a diffuse base with retro-reflection and a fake
//! subsurface term; sheen; a clear coat with the GTR1 distribution. Not made
//! to conserve energy: near-white bases return more than they receive at
//! grazing. Lobes are chosen by estimates of their albedos, not by Mitsuba's
//! weights, times the sampling rates of the file; that changes noise only.
//!
//! The thin variant is a sheet: its specular transmission is the mirror image
//! of a reflection, by roughness scaled with the index. It is not the same both
//! ways, as in Mitsuba: facets are left out by the direction of the light.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use super::energy::schlick;
use super::fresnel::{Fresnel, fresnel_between, reflect, refract};
use super::microfacet::{Distribution, Microfacet, unit};
use super::rough_conductor::reflection_terms;
use super::rough_dielectric::{Refraction, refraction};
use super::{BsdfSample, mean};
use crate::color::luminance;
use crate::math::{ONE_MINUS_EPSILON, Rgb, Vec2, Vec3};
use crate::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};

/// What both principled surfaces share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipledBase {
    /// Colour of everything but sheen and coat.
    pub base_color: Rgb,
    /// √α before anisotropy.
    pub roughness: f32,
    /// Stretch of the highlight along x, [0, 1].
    pub anisotropic: f32,
    /// How clear it is, [0, 1].
    pub spec_trans: f32,
    /// Index of the inside over the outside.
    pub eta: f32,
    /// How much the dielectric's reflection takes on the base colour.
    pub spec_tint: f32,
    /// Strength of the sheen.
    pub sheen: f32,
    /// How much the sheen takes on the base colour.
    pub sheen_tint: f32,
    /// Weight of the fake subsurface term.
    pub flatness: f32,
}

impl PrincipledBase {
    /// Mitsuba's defaults.
    pub const DEFAULT: PrincipledBase = PrincipledBase {
        base_color: Rgb::splat(0.5),
        roughness: 0.5,
        anisotropic: 0.0,
        spec_trans: 0.0,
        eta: 1.5,
        spec_tint: 0.0,
        sheen: 0.0,
        sheen_tint: 0.0,
        flatness: 0.0,
    };

    /// The distribution for a given roughness.
    fn distribution(&self, roughness: f32) -> Microfacet {
        let alpha = roughness * roughness;
        let aspect = (1.0 - 0.9 * self.anisotropic).max(0.0).sqrt();
        let part = |a: f32| if a > 0.001 { a } else { 0.001 };
        Microfacet::new(Distribution::Ggx, part(alpha / aspect), part(alpha * aspect))
    }

    /// The base colour at luminance 1.
    fn tint(&self) -> Rgb {
        let luminance = luminance(self.base_color);
        if luminance > 0.0 { self.base_color / luminance } else { Rgb::ONE }
    }

    /// Schlick's tinted reflectance of the dielectric.
    fn tinted(&self, s: f32, eta: f32) -> Rgb {
        let f0 = self.tint() * ((eta - 1.0) / (eta + 1.0)).powi(2);
        f0 + (Rgb::ONE - f0) * s
    }

    /// Diffuse base and sheen over cos θi, for reflection.
    fn diffuse(&self, wo: Vec3, wi: Vec3) -> (Rgb, Rgb) {
        let (so, si) = (schlick(wo.z), schlick(wi.z));
        let cos = unit(wo + wi).dot(wi);
        let lambert = (1.0 - 0.5 * so) * (1.0 - 0.5 * si);
        let rough = 2.0 * self.roughness * cos * cos;
        let retro = rough * (so + si + so * si * (rough - 1.0));
        let mut shape = lambert + retro;
        if self.flatness > 0.0 {
            let toward = |s: f32| 1.0 + (0.5 * rough - 1.0) * s;
            // It grows without end towards the horizon, where `wi.z` takes it back.
            let steep = (wo.z + wi.z).recip().min(1e37);
            let flat = 1.25 * (toward(so) * toward(si) * (steep - 0.5) + 0.5);
            shape += (flat - shape) * self.flatness;
        }
        let sheen = if self.sheen > 0.0 {
            let colour = Rgb::ONE + (self.tint() - Rgb::ONE) * self.sheen_tint;
            colour * (self.sheen * schlick(cos.abs()))
        } else {
            Rgb::ZERO
        };
        (self.base_color * (FRAC_1_PI * shape).max(0.0), sheen)
    }
}

/// The principled surface of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principled {
    /// What the thin one has too.
    pub base: PrincipledBase,
    /// 1 is a metal.
    pub metallic: f32,
    /// Weight of the coat.
    pub clearcoat: f32,
    /// 0 for a satin coat, 1 for a sharp one.
    pub clearcoat_gloss: f32,
    /// Factors on the probabilities of the diffuse, the specular and the coat
    /// lobe.
    pub rates: [f32; 3],
}

impl Principled {
    /// Weights of the opaque and of the clear dielectric.
    fn shares(&self) -> (f32, f32) {
        let dielectric = 1.0 - self.metallic;
        (dielectric * (1.0 - self.base.spec_trans), dielectric * self.base.spec_trans)
    }

    pub(super) fn transmits(&self) -> bool {
        self.shares().1 > 0.0
    }

    /// What a facet reflects, and what it lets through, seen from `wo` which
    /// is up on its side; `eta` is that of the far side over the near one.
    fn facet(&self, fresnel: &Fresnel, cos: f32, outside: bool) -> (Rgb, Rgb) {
        let (_, clear) = self.shares();
        let root = Rgb::from_array(self.base.base_color.to_array().map(f32::sqrt));
        let through = root * (clear * (1.0 - fresnel.r));
        if !outside {
            return (Rgb::splat(clear * fresnel.r), through);
        }
        let eta = self.base.eta;
        let s = schlick(if eta > 1.0 { cos } else { fresnel.cos_t.abs() });
        let base = self.base.base_color;
        let metal = (base + (Rgb::ONE - base) * s) * self.metallic;
        let tint = self.base.spec_tint;
        let plain = (1.0 - self.metallic) * (1.0 - tint) * fresnel.r;
        let mut reflected = metal + plain;
        if tint > 0.0 {
            reflected += self.base.tinted(s, eta) * ((1.0 - self.metallic) * tint);
        }
        (reflected, through)
    }

    fn coat_alpha(&self) -> f32 {
        0.1 + (0.001 - 0.1) * self.clearcoat_gloss
    }

    /// Value and half-vector density of the coat.
    fn coat(&self, wo: Vec3, wi: Vec3, m: Vec3) -> (f32, f32) {
        // wo·m, which cancels at grazing and may come out negative there.
        let cos = 0.5 * (wo + wi).as_dvec3().length();
        let s = if self.base.eta > 1.0 {
            schlick(cos as f32)
        } else {
            schlick(fresnel_between(wo, m, self.base.eta).cos_t.abs())
        };
        let d = gtr1(m.z, self.coat_alpha());
        let shadow = Microfacet::new(Distribution::Ggx, 0.25, 0.25);
        let value = 0.25 * self.clearcoat * (0.04 + 0.96 * s) * d * shadow.g1(wo) * shadow.g1(wi) * wi.z;
        (value, (f64::from(d * m.z) / (4.0 * cos)).min(1e30) as f32)
    }

    /// Probabilities of the diffuse, interface and coat lobes.
    fn lobes(&self, wo: Vec3, outside: bool) -> Option<[f32; 3]> {
        if !outside {
            return self.transmits().then_some([0.0, 1.0, 0.0]);
        }
        let fresnel = fresnel_between(wo, Vec3::Z, self.base.eta);
        let (reflected, through) = self.facet(&fresnel, wo.z, true);
        let (opaque, _) = self.shares();
        let sheen = 0.1 * self.base.sheen * (1.0 - self.metallic);
        let diffuse = if opaque > 0.0 { opaque * mean(self.base.base_color) + sheen } else { 0.0 };
        let coat = 0.25 * self.clearcoat * (0.04 + 0.96 * schlick(wo.z));
        let weights = [
            self.rates[0] * diffuse,
            self.rates[1] * (mean(reflected) + mean(through)).max(1e-3),
            self.rates[2] * coat,
        ];
        let all = weights[0] + weights[1] + weights[2];
        (all > 0.0).then(|| weights.map(|w| w / all))
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let nothing = (Rgb::ZERO, 0.0);
        let outside = wo.z > 0.0;
        let flip = if outside { Vec3::ONE } else { Vec3::new(1.0, 1.0, -1.0) };
        let (wo, wi) = (wo * flip, wi * flip);
        if !(wo.z > 0.0) || wi.z == 0.0 {
            return nothing;
        }
        let Some([diffuse, interface, coat]) = self.lobes(wo, outside) else { return nothing };
        let eta = if outside { self.base.eta } else { 1.0 / self.base.eta };
        let distribution = self.base.distribution(self.base.roughness);
        if wi.z < 0.0 {
            if !self.transmits() {
                return nothing;
            }
            let Some(Refraction { m, wo_m, wi_m_over_h2 }) = refraction(wo, wi, eta) else {
                return nothing;
            };
            if !(m.z > 0.0) {
                return nothing;
            }
            let (reflected, through) = self.facet(&fresnel_between(wo, m, eta), wo_m, outside);
            let common = distribution.d(m) * wo_m * wi_m_over_h2 * distribution.g1_over_cos(wo);
            let density = interface * (1.0 - reflecting(reflected, through)) * common * eta * eta;
            return (through * (common * distribution.g1(wi)), density);
        }

        let m = unit(wo + wi);
        let (reflected, through) = self.facet(&fresnel_between(wo, m, eta), wo.dot(m), outside);
        let (shape, density) = reflection_terms(&distribution, wo, wi, m);
        let mut value = reflected * shape;
        let mut pdf = interface * reflecting(reflected, through) * density;
        if outside {
            pdf += diffuse * cosine_hemisphere_pdf(wi.z);
            let (opaque, _) = self.shares();
            if opaque > 0.0 {
                let (base, sheen) = self.base.diffuse(wo, wi);
                value += (base * opaque + sheen * (1.0 - self.metallic)) * wi.z;
            }
            if self.clearcoat > 0.0 {
                let (shine, density) = self.coat(wo, wi, m);
                value += Rgb::splat(shine);
                pdf += coat * density;
            }
        }
        (value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let outside = wo.z > 0.0;
        let flip = if outside { Vec3::ONE } else { Vec3::new(1.0, 1.0, -1.0) };
        let up = wo * flip;
        if !(up.z > 0.0) {
            return None;
        }
        let [diffuse, interface, _] = self.lobes(up, outside)?;
        let mut eta_path = 1.0;
        let wi = if u_lobe < diffuse {
            cosine_hemisphere(u)
        } else if u_lobe < diffuse + interface {
            let u_lobe = ((u_lobe - diffuse) / interface).min(ONE_MINUS_EPSILON);
            let eta = if outside { self.base.eta } else { 1.0 / self.base.eta };
            let m = self.base.distribution(self.base.roughness).sample(up, u);
            let fresnel = fresnel_between(up, m, eta);
            let (reflected, through) = self.facet(&fresnel, up.dot(m), outside);
            if u_lobe < reflecting(reflected, through) {
                above(reflect(up, m))?
            } else {
                eta_path = eta;
                -above(-unit(refract(up, m, &fresnel)))?
            }
        } else {
            let m = sample_gtr1(self.coat_alpha(), u);
            if !(up.dot(m) > 0.0) {
                return None;
            }
            above(reflect(up, m))?
        };
        let (value, pdf) = self.eval_pdf(wo, wi * flip);
        BsdfSample::smooth(wi * flip, value / pdf, pdf).map(|s| BsdfSample { eta: eta_path, ..s })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        let outside = wo.z > 0.0;
        let up = Vec3::new(wo.x, wo.y, wo.z.abs());
        let eta = if outside { self.base.eta } else { 1.0 / self.base.eta };
        let (reflected, through) = self.facet(&fresnel_between(up, Vec3::Z, eta), up.z, outside);
        let diffuse = if outside { self.base.base_color * self.shares().0 } else { Rgb::ZERO };
        (reflected + through + diffuse).min(Rgb::ONE)
    }
}

/// The principled surface of a sheet, the same from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipledThin {
    /// What the solid one has too.
    pub base: PrincipledBase,
    /// Share of diffuse light that is let through: 0 none, 2 all.
    pub diff_trans: f32,
    /// Factors on the probabilities of the specular reflection and
    /// transmission, and the diffuse reflection and transmission.
    pub rates: [f32; 4],
}

impl PrincipledThin {
    /// Probabilities of the lobes, in the order of the rates.
    fn lobes(&self) -> Option<[f32; 4]> {
        let (clear, through) = (self.base.spec_trans, 0.5 * self.diff_trans);
        let colour = mean(self.base.base_color);
        let weights = [
            self.rates[0] * 0.3 * clear,
            self.rates[1] * 0.7 * clear,
            self.rates[2] * (1.0 - clear) * (1.0 - through) * (colour + 0.1 * self.base.sheen),
            self.rates[3] * (1.0 - clear) * through * colour,
        ];
        let all: f32 = weights.iter().sum();
        (all > 0.0).then(|| weights.map(|w| w / all))
    }

    /// The distribution of the transmission.
    fn spread(&self) -> Microfacet {
        self.base.distribution((0.65 * self.base.eta - 0.35) * self.base.roughness)
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let flip = if wo.z > 0.0 { 1.0 } else { -1.0 };
        let (wo, wi) = (wo * flip, wi * flip);
        let Some([shine, pass, diffuse, translucent]) = self.lobes().filter(|_| wo.z > 0.0 && wi.z != 0.0)
        else {
            return (Rgb::ZERO, 0.0);
        };
        let base = &self.base;
        let mirrored = Vec3::new(wi.x, wi.y, wi.z.abs());
        let m = unit(wo + mirrored);
        let clear = base.spec_trans;
        let through = 0.5 * self.diff_trans;
        let fresnel = if clear > 0.0 { fresnel_between(wo, m, base.eta) } else { Fresnel::NONE };
        if wi.z > 0.0 {
            let (colour, sheen) = base.diffuse(wo, wi);
            let mut value = (colour + sheen) * ((1.0 - clear) * (1.0 - through) * wi.z);
            let mut pdf = diffuse * cosine_hemisphere_pdf(wi.z);
            if clear > 0.0 {
                let s = schlick(if base.eta > 1.0 { wo.dot(m) } else { fresnel.cos_t.abs() });
                let plain = Rgb::splat(fresnel.r);
                let tinted = if base.spec_tint > 0.0 { base.tinted(s, base.eta) } else { plain };
                let reflected = plain + (tinted - plain) * base.spec_tint;
                let distribution = base.distribution(base.roughness);
                let (shape, density) = reflection_terms(&distribution, wo, wi, m);
                value += reflected * (clear * shape);
                pdf += shine * density;
            }
            return (value, pdf);
        }
        let mut value = base.base_color * ((1.0 - clear) * through * FRAC_1_PI * mirrored.z);
        let mut pdf = translucent * cosine_hemisphere_pdf(mirrored.z);
        // As Mitsuba: facets that the light would have to leave upwards are none.
        if clear > 0.0 && wi.dot(m) < 0.0 {
            let (shape, density) = reflection_terms(&self.spread(), wo, mirrored, m);
            value += base.base_color * (clear * (1.0 - fresnel.r) * shape);
            pdf += pass * density;
        }
        (value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let flip = if wo.z > 0.0 { 1.0 } else { -1.0 };
        let up = wo * flip;
        let [shine, pass, diffuse, _] = self.lobes().filter(|_| up.z > 0.0)?;
        let wi = if u_lobe < shine {
            above(reflect(up, self.base.distribution(self.base.roughness).sample(up, u)))?
        } else if u_lobe < shine + pass {
            let m = self.spread().sample(up, u);
            let r = above(reflect(up, m))?;
            let wi = Vec3::new(r.x, r.y, -r.z);
            if !(wi.dot(m) < 0.0) {
                return None;
            }
            wi
        } else if u_lobe < shine + pass + diffuse {
            cosine_hemisphere(u)
        } else {
            -cosine_hemisphere(u)
        };
        let (value, pdf) = self.eval_pdf(up, wi);
        BsdfSample::smooth(wi * flip, value / pdf, pdf)
    }

    pub(super) fn albedo(&self, _wo: Vec3) -> Rgb {
        self.base.base_color.min(Rgb::ONE)
    }
}

/// The direction, if it is above the surface.
fn above(w: Vec3) -> Option<Vec3> {
    (w.z > 0.0).then_some(w)
}

/// Probability of reflection at a facet.
fn reflecting(reflected: Rgb, through: Rgb) -> f32 {
    let (r, t) = (mean(reflected), mean(through));
    if r + t > 0.0 { r / (r + t) } else { 1.0 }
}

/// The distribution GTR1 of Burley 2012 at a cosine.
fn gtr1(cos: f32, alpha: f32) -> f32 {
    let a = alpha * alpha;
    // 1 + (α² − 1)·cos², without cancellation.
    let e = a * cos * cos + (1.0 - cos) * (1.0 + cos);
    (a - 1.0) / (PI * a.ln() * e)
}

/// A normal of density `gtr1`·cos.
fn sample_gtr1(alpha: f32, u: Vec2) -> Vec3 {
    let a = alpha * alpha;
    let cos2 = ((1.0 - a.powf(1.0 - u.y)) / (1.0 - a)).clamp(0.0, 1.0);
    let (sin_phi, cos_phi) = (TAU * u.x).sin_cos();
    let sin = (1.0 - cos2).sqrt();
    Vec3::new(cos_phi * sin, sin_phi * sin, cos2.sqrt())
}
