//! Rough dielectric coat over a diffuse base: the microfacet reflection of
//! the coat, and diffuse light weighed by the coat's transmittance of both
//! directions from a table.
//!
//! The table is Mitsuba's: transmittance at 64 cosines, linear in between, by
//! Gauss-Legendre quadrature over visible normals.

use super::BsdfSample;
use super::coat::Coat;
use super::fresnel::{fresnel_between, reflect, refract};
use super::microfacet::{Distribution, Microfacet, unit};
use super::plastic::specular_probability;
use super::quadrature::gauss_legendre;
use super::rough_conductor::reflection_terms;
use super::slopes::{normal_slope, visible_slope};
use crate::math::{Rgb, Vec2, Vec3};
use crate::sampling::{concentric_disk, cosine_hemisphere, cosine_hemisphere_pdf};

/// Cosines in the table: 0, 1/63, …, 1.
const RESOLUTION: usize = 64;

/// Microfacet reflection off the coat and diffuse light from below it,
/// one-sided and isotropic.
#[derive(Clone, Copy, Debug)]
pub struct RoughPlastic<'a> {
    /// Roughness and index of the coat.
    pub table: &'a RoughPlasticTable,
    /// Reflectance of the base, [0, 1] per channel.
    pub diffuse_reflectance: Rgb,
    /// Factor on the reflection off the coat; 1 is physical.
    pub specular_reflectance: Rgb,
    /// True for the shift of colour by internal reflections.
    pub nonlinear: bool,
}

/// What a rough coat transmits; made once per material.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughPlasticTable {
    distribution: Microfacet,
    coat: Coat,
    /// Transmittance from outside at cosine i/63.
    transmittance: [f32; RESOLUTION],
}

impl RoughPlasticTable {
    /// For a coat of roughness `alpha` and `eta` = η of the coat over that of
    /// the outside, > 0. Half a million points of quadrature: tens of milliseconds.
    #[must_use]
    pub fn new(kind: Distribution, alpha: f32, eta: f32) -> RoughPlasticTable {
        let distribution = Microfacet::new(kind, alpha, alpha);
        let directions: [Vec3; RESOLUTION] = std::array::from_fn(|i| {
            let mu = (i as f32 / (RESOLUTION - 1) as f32).max(1e-6);
            Vec3::new(((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt(), 0.0, mu)
        });

        let outside = Quadrature::new(kind, if eta > 1.0 { 32 } else { 128 });
        let transmittance =
            directions.map(|w| outside.mean(&distribution, w, |m| transmitted(&distribution, w, m, eta)));

        // The mean over diffuse light is the plain sum over the grid.
        let inside = Quadrature::new(kind, if 1.0 / eta > 1.0 { 32 } else { 128 });
        let reflected_inside: f64 = directions
            .iter()
            .map(|&w| {
                f64::from(w.z) * inside.mean(&distribution, w, |m| reflected(&distribution, w, m, 1.0 / eta))
            })
            .sum::<f64>()
            * 2.0
            / RESOLUTION as f64;

        let coat = Coat::new(eta, 1.0 - reflected_inside, diffuse_mean(&transmittance));
        RoughPlasticTable { distribution, coat, transmittance: transmittance.map(|t| t as f32) }
    }

    /// Transmittance of the coat from outside for a cosine in [0, 1].
    fn transmittance(&self, cos: f32) -> f32 {
        let x = cos * (RESOLUTION - 1) as f32;
        let i = (x as usize).min(RESOLUTION - 2);
        let w = x - i as f32;
        (1.0 - w) * self.transmittance[i] + w * self.transmittance[i + 1]
    }
}

impl RoughPlastic<'_> {
    /// Probability of the lobe of the coat where that transmits `t`.
    fn specular_probability(&self, t: f32) -> Option<f32> {
        specular_probability(self.specular_reflectance * (1.0 - t), self.diffuse_reflectance * t)
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return (Rgb::ZERO, 0.0);
        }
        let t = self.table.transmittance(wo.z);
        let Some(specular) = self.specular_probability(t) else {
            return (Rgb::ZERO, 0.0);
        };
        let cosine = cosine_hemisphere_pdf(wi.z);
        let base = self.table.coat.base(self.diffuse_reflectance, self.nonlinear);
        let mut value = base * (t * self.table.transmittance(wi.z) * cosine);
        let mut pdf = (1.0 - specular) * cosine;
        if !self.table.distribution.is_delta() {
            let m = unit(wo + wi);
            let r = fresnel_between(wo, m, self.table.coat.eta()).r;
            let (reflection, density) = reflection_terms(&self.table.distribution, wo, wi, m);
            value += self.specular_reflectance * (r * reflection);
            pdf += specular * density;
        }
        (value, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if !(wo.z > 0.0) {
            return None;
        }
        let specular = self.specular_probability(self.table.transmittance(wo.z))?;
        let wi = if u_lobe < specular {
            let m = self.table.distribution.sample(wo, u);
            let wi = reflect(wo, m);
            if !(wi.z > 0.0) {
                return None;
            }
            if self.table.distribution.is_delta() {
                let r = fresnel_between(wo, m, self.table.coat.eta()).r;
                let shadowing = self.table.distribution.g1(wi) * self.table.distribution.g1_correction(wo);
                let weight = self.specular_reflectance * (r * shadowing / specular);
                return BsdfSample::delta(wi, weight, specular);
            }
            wi
        } else {
            cosine_hemisphere(u)
        };
        let (value, pdf) = self.eval_pdf(wo, wi);
        BsdfSample::smooth(wi, value / pdf, pdf)
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Rgb {
        if !(wo.z > 0.0) {
            return Rgb::ZERO;
        }
        let t = self.table.transmittance(wo.z);
        let base = self.table.coat.base(self.diffuse_reflectance, self.nonlinear) * self.table.coat.enter();
        self.specular_reflectance * (1.0 - t) + base * t
    }
}

/// What the facet `m` transmits of light from `w` (up), over the density of
/// visible normals.
fn transmitted(distribution: &Microfacet, w: Vec3, m: Vec3, eta: f32) -> f32 {
    let fresnel = fresnel_between(w, m, eta);
    let wi = refract(w, m, &fresnel);
    if wi.z < 0.0 && fresnel.r < 1.0 { (1.0 - fresnel.r) * distribution.g1(wi) } else { 0.0 }
}

/// What the facet `m` reflects of light from `w` (up), over the density of
/// visible normals.
fn reflected(distribution: &Microfacet, w: Vec3, m: Vec3, eta: f32) -> f32 {
    let wi = reflect(w, m);
    if wi.z > 0.0 { fresnel_between(w, m, eta).r * distribution.g1(wi) } else { 0.0 }
}

/// 2∫ t(μ) μ dμ of the piecewise linear table, exactly.
fn diffuse_mean(table: &[f64; RESOLUTION]) -> f64 {
    let h = 1.0 / (RESOLUTION - 1) as f64;
    table
        .windows(2)
        .enumerate()
        .map(|(i, t)| {
            let a = i as f64 * h;
            // ∫₀ʰ (t₀ + (t₁ − t₀)x/h)(a + x) dx
            h * (0.5 * a * (t[0] + t[1]) + h * (t[0] / 6.0 + t[1] / 3.0))
        })
        .sum::<f64>()
        * 2.0
}

/// Gauss-Legendre points of the unit square, folded along the axis in which
/// visible normals from the xz plane are mirror images.
struct Quadrature {
    kind: Distribution,
    /// Points and weights along the plane.
    along: Vec<(f32, f64)>,
    /// Points (for Beckmann: slopes) and weights across it, one half.
    across: Vec<(f32, f64)>,
}

impl Quadrature {
    fn new(kind: Distribution, n: usize) -> Quadrature {
        let nodes: Vec<(f32, f64)> = gauss_legendre(n).iter().map(|&(x, w)| (x as f32, w)).collect();
        let half = nodes[..n / 2].iter();
        let across = half.map(|&(y, weight)| match kind {
            Distribution::Beckmann => (normal_slope(y), 2.0 * weight),
            Distribution::Ggx => (y, 2.0 * weight),
        });
        Quadrature { kind, across: across.collect(), along: nodes }
    }

    /// Mean of `f` over the visible normals from `w` in the xz plane.
    fn mean(&self, distribution: &Microfacet, w: Vec3, f: impl Fn(Vec3) -> f32) -> f64 {
        let alpha = distribution.alpha().x;
        let stretched = unit(Vec3::new(alpha * w.x, 0.0, w.z));
        let mut sum = 0.0;
        for &(x, weight_x) in &self.along {
            let slope = match self.kind {
                Distribution::Beckmann => visible_slope(stretched.z, stretched.x, x),
                Distribution::Ggx => 0.0,
            };
            for &(y, weight_y) in &self.across {
                let m = match self.kind {
                    Distribution::Beckmann => unit(Vec3::new(-alpha * slope, -alpha * y, 1.0)),
                    Distribution::Ggx => normal_by_disk(alpha, stretched, Vec2::new(y, x)),
                };
                sum += weight_x * weight_y * f64::from(f(m));
            }
        }
        sum
    }
}

/// Visible GGX normal from the stretched `w` in the xz plane by the projected disk (Heitz
/// 2018), which is how Mitsuba lays out the square: with few points its
/// quadrature is 4e-4 off, and only the same layout is off in the same way.
fn normal_by_disk(alpha: f32, w: Vec3, u: Vec2) -> Vec3 {
    let disk = concentric_disk(u);
    let (s, rim) = (0.5 * (1.0 + w.z), (1.0 - disk.x * disk.x).max(0.0).sqrt());
    let y = (1.0 - s) * rim + s * disk.y;
    let z = (1.0 - disk.x * disk.x - y * y).max(0.0).sqrt();
    unit(Vec3::new(alpha * (w.x * z - w.z * y), -alpha * disk.x, w.x * y + w.z * z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_mean_is_exact() {
        assert!((diffuse_mean(&[1.0; RESOLUTION]) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn smooth_limit_is_the_fresnel_transmittance() {
        let table = RoughPlasticTable::new(Distribution::Ggx, 0.0, 1.5);
        for cos in [1.0f32, 30.0 / 63.0, 5.0 / 63.0] {
            let exact = 1.0 - super::super::fresnel::fresnel_dielectric(cos, 1.5).r;
            assert!((table.transmittance(cos) - exact).abs() < 1e-5, "{cos}");
        }
        assert!((table.coat.enter() - (1.0 - 0.091_778)).abs() < 1e-3);
    }
}
