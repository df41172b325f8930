//! Microfacet normals: Beckmann and GGX, anisotropic, with Smith shadowing
//! and sampling of visible normals.
//!
//! D(m) is per solid angle and ∫ D(m)·m.z dm = 1 (Walter et al. 2007).
//! Visible normals have density D(m)·G₁(w)·⟨w, m⟩/w.z (Heitz 2014). GGX draws
//! them by spherical caps (Dupuy and Benyoub 2023), Beckmann by inverting the
//! distribution of slopes (`slopes.rs`).
//!
//! Beckmann has two G₁: the exact one, which the density of visible normals
//! needs to integrate to 1, and the rational fit of Walter et al. (equation
//! 27, up to 0.35 % off), which is what the model is in Mitsuba; so a weight
//! holds their ratio.
//!
//! Breaks down below α = 1e-4 ([`ALPHA_MIN`]), where single precision no
//! longer resolves the lobe: see [`Microfacet::is_delta`].

use super::slopes::{erfcx, normal_slope, visible_slope};
use crate::math::{Vec2, Vec3};
use std::f32::consts::PI;

/// Least roughness whose lobe is evaluated; see [`Microfacet::is_delta`].
pub const ALPHA_MIN: f32 = 1e-4;

/// Largest roughness: far beyond any visible change.
const ALPHA_MAX: f32 = 1e3;

/// 1/√π.
const FRAC_1_SQRT_PI: f32 = 0.564_189_6;

/// Shape of the distribution of normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Gaussian slopes; α is √2 times their standard deviation.
    Beckmann,
    /// Trowbridge-Reitz: long tails.
    Ggx,
}

/// A distribution of microfacet normals in the local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfacet {
    kind: Distribution,
    alpha: Vec2,
}

impl Microfacet {
    /// Roughness `alpha_u` along x and `alpha_v` along y, from 0 on. Negative
    /// values and NaN count as 0; values above 1000 as 1000. When only one is
    /// below [`ALPHA_MIN`] it is raised to it.
    #[must_use]
    pub fn new(kind: Distribution, alpha_u: f32, alpha_v: f32) -> Microfacet {
        let valid = |alpha: f32| if alpha > 0.0 { alpha.min(ALPHA_MAX) } else { 0.0 };
        let alpha = Vec2::new(valid(alpha_u), valid(alpha_v));
        let smooth = alpha.max_element() < ALPHA_MIN;
        Microfacet { kind, alpha: if smooth { alpha } else { alpha.max(Vec2::splat(ALPHA_MIN)) } }
    }

    /// Roughness along x and y.
    #[must_use]
    pub fn alpha(&self) -> Vec2 {
        self.alpha
    }

    /// Shape of the distribution.
    #[must_use]
    pub fn kind(&self) -> Distribution {
        self.kind
    }

    /// True when the lobe is narrower than directions in f32 resolve. It is
    /// then sampled as it is, with its own α, but flagged as a delta and not
    /// evaluated: the mean stays continuous in α down to the mirror at 0.
    #[must_use]
    pub fn is_delta(&self) -> bool {
        self.alpha.max_element() < ALPHA_MIN
    }

    /// D is above zero for every normal, in floats too.
    #[must_use]
    pub fn has_long_tails(&self) -> bool {
        self.kind == Distribution::Ggx
    }

    /// D(m) per solid angle for the unit normal `m`; 0 for m.z ≤ 0. Not for
    /// [`Microfacet::is_delta`].
    #[must_use]
    pub fn d(&self, m: Vec3) -> f32 {
        if !(m.z > 0.0) {
            return 0.0;
        }
        let scaled = m.truncate() / self.alpha;
        let area = PI * self.alpha.x * self.alpha.y;
        let z2 = m.z * m.z;
        match self.kind {
            Distribution::Ggx => {
                let e = scaled.length_squared() + z2;
                1.0 / (area * e * e)
            }
            Distribution::Beckmann => {
                let tan2 = scaled.length_squared() / z2;
                if tan2 < 80.0 { (-tan2).exp() / (area * z2 * z2) } else { 0.0 }
            }
        }
    }

    /// G₁(w)/|w.z| of the model, finite at grazing.
    #[must_use]
    pub fn g1_over_cos(&self, w: Vec3) -> f32 {
        let z = w.z.abs();
        let s = (self.alpha * w.truncate()).length();
        match self.kind {
            Distribution::Ggx => 2.0 / (z + (z * z + s * s).sqrt()),
            Distribution::Beckmann => {
                let a = z / s;
                if a >= 1.6 || !(s > 0.0) {
                    1.0 / z
                } else {
                    (3.535 + 2.181 * a) / (s * (1.0 + (2.276 + 2.577 * a) * a))
                }
            }
        }
    }

    /// G₁(w) of the model, in [0, 1].
    #[must_use]
    pub fn g1(&self, w: Vec3) -> f32 {
        (self.g1_over_cos(w) * w.z.abs()).min(1.0)
    }

    /// The exact G₁(w)/|w.z|: what normalises the density of visible normals.
    #[must_use]
    pub fn visible_over_cos(&self, w: Vec3) -> f32 {
        match self.kind {
            Distribution::Ggx => self.g1_over_cos(w),
            Distribution::Beckmann => {
                // 1/(1 + Λ) with 1 + Λ = ½(1 + erf a) + exp(−a²)/(2a√π).
                let z = w.z.abs();
                let s = (self.alpha * w.truncate()).length();
                let a = z / s;
                if a >= 4.0 || !(s > 0.0) {
                    return 1.0 / z;
                }
                let gauss = (-a * a).exp();
                2.0 / (z * (2.0 - gauss * erfcx(a)) + s * gauss * FRAC_1_SQRT_PI)
            }
        }
    }

    /// Model G₁ over exact G₁ of `w`: 1 but for Beckmann's fit.
    #[must_use]
    pub fn g1_correction(&self, w: Vec3) -> f32 {
        match self.kind {
            Distribution::Ggx => 1.0,
            Distribution::Beckmann => {
                let s = (self.alpha * w.truncate()).length();
                if w.z.abs() < 4.0 * s { self.g1_over_cos(w) / self.visible_over_cos(w) } else { 1.0 }
            }
        }
    }

    /// Density per solid angle of the visible normal `m` from `w` with
    /// w.z > 0; `w_dot_m` = ⟨w, m⟩. Zero from behind.
    #[must_use]
    pub fn pdf(&self, w: Vec3, m: Vec3, w_dot_m: f32) -> f32 {
        self.d(m) * self.visible_over_cos(w) * w_dot_m.max(0.0)
    }

    /// A visible unit normal from `w`, which must have w.z > 0; `u` in [0, 1)².
    #[must_use]
    pub fn sample(&self, w: Vec3, u: Vec2) -> Vec3 {
        // Stretch to the distribution of roughness 1.
        let stretched = Vec3::new(self.alpha.x * w.x, self.alpha.y * w.y, w.z);
        let stretched = unit(stretched);
        let m = match self.kind {
            Distribution::Ggx => visible_cap(stretched, u),
            Distribution::Beckmann => visible_beckmann(stretched, u),
        };
        unit(Vec3::new(self.alpha.x * m.x, self.alpha.y * m.y, m.z))
    }
}

/// `v` at unit length, also when its square underflows.
#[must_use]
pub fn unit(v: Vec3) -> Vec3 {
    (v / v.abs().max_element()).normalize()
}

/// Visible normal of the hemisphere (GGX of roughness 1), not normalised:
/// Dupuy and Benyoub 2023, listing 3. The height of the normal is kept in the
/// form that does not cancel at grazing.
fn visible_cap(w: Vec3, u: Vec2) -> Vec3 {
    let height = (1.0 - u.y) * (1.0 + w.z);
    let z = height - w.z;
    let radius = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.x).sin_cos();
    Vec3::new(radius * cos + w.x, radius * sin + w.y, height)
}

/// Visible normal of the Beckmann distribution of roughness 1, as −slope with
/// z = 1.
fn visible_beckmann(w: Vec3, u: Vec2) -> Vec3 {
    let sin = w.truncate().length();
    let (cos_phi, sin_phi) = if sin > 0.0 { (w.x / sin, w.y / sin) } else { (1.0, 0.0) };
    let along = visible_slope(w.z, sin, u.x);
    let across = normal_slope(u.y);
    Vec3::new(across * sin_phi - along * cos_phi, -along * sin_phi - across * cos_phi, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(theta_deg: f32, phi: f32) -> Vec3 {
        let (s, c) = theta_deg.to_radians().sin_cos();
        Vec3::new(s * phi.cos(), s * phi.sin(), c)
    }

    #[test]
    fn projected_area_is_one() {
        for kind in [Distribution::Beckmann, Distribution::Ggx] {
            for (au, av) in [(0.05, 0.05), (0.3, 0.3), (1.0, 1.0), (0.1, 0.6)] {
                let d = Microfacet::new(kind, au, av);
                let (n_z, n_phi) = (4000, 64);
                let mut sum = 0.0f64;
                for i in 0..n_z {
                    // tan θ = t/(1 − t) reaches the tails of both.
                    let t = (f64::from(i) + 0.5) / f64::from(n_z);
                    let tan = t / (1.0 - t);
                    let cos = 1.0 / (1.0 + tan * tan).sqrt();
                    let jacobian = cos.powi(3) * tan / (1.0 - t).powi(2);
                    for j in 0..n_phi {
                        let phi = 2.0 * std::f64::consts::PI * (f64::from(j) + 0.5) / f64::from(n_phi);
                        let sin = tan * cos;
                        let m = Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32);
                        sum += f64::from(d.d(m)) * cos * jacobian;
                    }
                }
                let integral = sum * 2.0 * std::f64::consts::PI / f64::from(n_z * n_phi);
                assert!((integral - 1.0).abs() < 1e-3, "{d:?}: {integral}");
            }
        }
    }

    #[test]
    fn fit_stays_near_exact_shadowing() {
        let d = Microfacet::new(Distribution::Beckmann, 0.4, 0.4);
        for i in 0..=900 {
            let w = direction(i as f32 * 0.1, 0.3);
            assert!((d.g1_correction(w) - 1.0).abs() < 4e-3, "{i}: {}", d.g1_correction(w));
            assert!(d.g1(w) <= 1.0);
        }
    }

    #[test]
    fn grazing_and_tiny_roughness_are_finite() {
        for kind in [Distribution::Beckmann, Distribution::Ggx] {
            for alpha in [0.0, 1e-8, 1e-4, 1.0, 1e3, f32::NAN, f32::INFINITY] {
                let d = Microfacet::new(kind, alpha, alpha);
                for z in [1e-30f32, 1e-10, 1e-4, 0.5, 1.0] {
                    let w = Vec3::new(((1.0 - z) * (1.0 + z)).sqrt(), 0.0, z);
                    assert!(d.g1(w).is_finite() && d.g1_correction(w).is_finite(), "{d:?} {z}");
                    for u in [0.0, 1e-10, 0.5, crate::math::ONE_MINUS_EPSILON] {
                        for v in [0.0, 0.5, crate::math::ONE_MINUS_EPSILON] {
                            let m = d.sample(w, Vec2::new(u, v));
                            assert!(m.is_normalized() && m.z >= 0.0, "{d:?} {z} {u} {v}: {m}");
                        }
                    }
                }
            }
        }
    }
}
