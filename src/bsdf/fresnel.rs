//! Reflection at a plane interface: Fresnel's equations for dielectrics and
//! conductors, unpolarised, and their mean over diffuse light.
//!
//! For dielectrics r = ½(aₛ² + aₚ²) with aₛ = (cᵢ − η·cₜ)/(cᵢ + η·cₜ) and
//! aₚ = (cₜ − η·cᵢ)/(cₜ + η·cᵢ), evaluated in f64: the differences cancel for
//! η ≈ 1 and the transmitted cosine does near the critical angle. For
//! conductors K. D. Möller, Optics, 1988, in the form that does not cancel
//! for small η·k.

use super::quadrature::gauss_legendre;
use crate::math::{Rgb, Vec3};

/// What happens at a plane dielectric interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fresnel {
    /// Unpolarised reflectance in [0, 1]; 1 under total internal reflection.
    pub r: f32,
    /// Cosine of the transmitted direction with the normal: its sign is
    /// opposite to that of the incident one; 0 under total internal reflection.
    pub cos_t: f32,
    /// η of the transmitted side over that of the incident one.
    pub eta_it: f32,
    /// η of the incident side over that of the transmitted one: the factor on
    /// the tangential part of a refracted direction.
    pub eta_ti: f32,
}

impl Fresnel {
    /// Nothing is reflected and nothing bends.
    pub(super) const NONE: Fresnel = Fresnel { r: 0.0, cos_t: -1.0, eta_it: 1.0, eta_ti: 1.0 };
}

/// Fresnel reflectance of a dielectric for `cos_i` in [−1, 1], the cosine with
/// a normal that points to the outside; `eta` = η_inside/η_outside.
#[must_use]
pub fn fresnel_dielectric(cos_i: f32, eta: f32) -> Fresnel {
    let c = f64::from(cos_i);
    interface(c, ((1.0 - c) * (1.0 + c)).max(0.0), f64::from(eta))
}

/// As [`fresnel_dielectric`] for the unit direction `w` and unit normal `n`.
/// Exact where the cosine alone is not enough: near the normal with a large
/// ratio of indices.
#[must_use]
pub fn fresnel_between(w: Vec3, n: Vec3, eta: f32) -> Fresnel {
    let (w, n) = (w.as_dvec3(), n.as_dvec3());
    unnormalised(w.dot(n), w.cross(n).length_squared(), eta)
}

/// As [`fresnel_dielectric`] for the local unit direction `w` and the normal z.
#[must_use]
pub fn fresnel_local(w: Vec3, eta: f32) -> Fresnel {
    let (x, y) = (f64::from(w.x), f64::from(w.y));
    unnormalised(f64::from(w.z), x * x + y * y, eta)
}

/// From a cosine and a squared sine that both carry the rounded lengths of
/// their vectors: for η within 1e-6 of 1 that rounding would be all of r.
fn unnormalised(cos_i: f64, sin2_i: f64, eta: f32) -> Fresnel {
    let length2 = cos_i * cos_i + sin2_i;
    interface(cos_i / length2.sqrt(), sin2_i / length2, f64::from(eta))
}

fn interface(cos_i: f64, sin2_i: f64, eta: f64) -> Fresnel {
    let (it, ti) = if cos_i >= 0.0 { (eta, 1.0 / eta) } else { (1.0 / eta, eta) };
    let ci = cos_i.abs();
    let ct = (1.0 - sin2_i * ti * ti).max(0.0).sqrt();
    let r = if eta == 1.0 {
        0.0
    } else if ci == 0.0 || ct == 0.0 {
        1.0
    } else {
        let s = (ci - it * ct) / (ci + it * ct);
        let p = (ct - it * ci) / (ct + it * ci);
        0.5 * (s * s + p * p)
    };
    let cos_t = if cos_i >= 0.0 { -ct } else { ct };
    Fresnel { r: r as f32, cos_t: cos_t as f32, eta_it: it as f32, eta_ti: ti as f32 }
}

/// Fresnel reflectance of a conductor seen from vacuum, per channel, for
/// `cos` in [0, 1] and the complex index η + i·k. η = 0 with k > 0 reflects
/// everything.
#[must_use]
pub fn fresnel_conductor(cos: f32, eta: Rgb, k: Rgb) -> Rgb {
    let channel = |eta, k| conductor_channel(cos, eta, k);
    Rgb::new(channel(eta.x, k.x), channel(eta.y, k.y), channel(eta.z, k.z))
}

fn conductor_channel(cos: f32, eta: f32, k: f32) -> f32 {
    let cos2 = cos * cos;
    let sin2 = (1.0 - cos) * (1.0 + cos);
    // η² − k² − sin², without cancellation for matched indices.
    let difference = (eta - 1.0) * (eta + 1.0) - k * k + cos2;
    let twice = 2.0 * eta * k;
    let norm = (difference * difference + twice * twice).sqrt();
    // a² = ½(norm + difference), which cancels when difference < 0.
    let a2 = if difference > 0.0 {
        0.5 * (norm + difference)
    } else if twice > 0.0 {
        0.5 * twice * (twice / (norm - difference))
    } else {
        0.0
    };
    let s0 = norm + cos2;
    let s1 = 2.0 * cos * a2.sqrt();
    let p0 = norm * cos2 + sin2 * sin2;
    let p1 = s1 * sin2;
    if !(s0 + s1 > 0.0 && p0 + p1 > 0.0) {
        return 1.0; // grazing on matched indices: the limit of cos → 0
    }
    let r_s = ((s0 - s1) / (s0 + s1)).max(0.0);
    let r_p = r_s * ((p0 - p1) / (p0 + p1)).max(0.0);
    0.5 * (r_s + r_p)
}

/// Mean of the Fresnel reflectance over diffuse light, 2∫ r(μ, η) μ dμ, by
/// quadrature to 1e-7. For η < 1 from the reciprocity of transmission:
/// 1 − R(η) = η²·(1 − R(1/η)).
#[must_use]
pub fn fresnel_diffuse_reflectance(eta: f64) -> f64 {
    if eta < 1.0 {
        return 1.0 - eta * eta * (1.0 - fresnel_diffuse_reflectance(1.0 / eta));
    }
    // μ = t⁴ puts the points where r rises, at grazing.
    let sum: f64 = gauss_legendre(96)
        .iter()
        .map(|&(t, weight)| {
            let mu = t.powi(4);
            weight * 4.0 * t.powi(3) * mu * mean_integrand(mu, eta)
        })
        .sum();
    2.0 * sum
}

fn mean_integrand(mu: f64, eta: f64) -> f64 {
    let ct = (1.0 - (1.0 - mu * mu) / (eta * eta)).max(0.0).sqrt();
    if eta == 1.0 {
        return 0.0;
    }
    let s = (mu - eta * ct) / (mu + eta * ct);
    let p = (ct - eta * mu) / (ct + eta * mu);
    0.5 * (s * s + p * p)
}

/// The two published fits of [`fresnel_diffuse_reflectance`] that Mitsuba
/// uses in its smooth plastic: Egan and Hilgeman 1973 for η < 1 (0.1 % off up
/// to 1/η = 1.5, wrong by more than 10 % beyond 1/η = 3), d'Eon and Irving
/// 2011 for η ≥ 1 (0.2 %). Only for agreement with it.
#[must_use]
pub fn fresnel_diffuse_reflectance_fit(eta: f64) -> f64 {
    if eta < 1.0 {
        return ((-1.4399 * eta + 0.7099) * eta + 0.6681) + 0.0636 / eta;
    }
    let i = 1.0 / eta;
    ((((-1.36881 * i + 4.98554) * i - 7.80989) * i + 6.75335) * i - 3.4793) * i + 0.919317
}

/// Mirrors `w` about the unit normal `n`.
#[must_use]
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * w.dot(n)) - w
}

/// Refracts `w` about the unit normal `n`, given the Fresnel terms of the two.
#[must_use]
pub fn refract(w: Vec3, n: Vec3, fresnel: &Fresnel) -> Vec3 {
    n * (w.dot(n) * fresnel.eta_ti + fresnel.cos_t) - w * fresnel.eta_ti
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cos_deg(degrees: f64) -> f32 {
        degrees.to_radians().cos() as f32
    }

    #[test]
    fn dielectric_meets_the_catalogue() {
        for (angle, expected) in [
            (0.0, 0.04),
            (45.0, 0.050_239_911),
            (60.0, 0.089_186_713),
            (80.0, 0.387_704_355),
            (89.0, 0.904_184_950),
            (89.9, 0.989_911_877),
        ] {
            let r = f64::from(fresnel_dielectric(cos_deg(angle), 1.5).r);
            assert!((r / expected - 1.0).abs() < 1e-6, "{angle}: {r} {expected}");
        }
        let inside = |angle| fresnel_dielectric(-cos_deg(angle), 1.5).r;
        assert!(inside(41.80) < 1.0 && inside(41.82) == 1.0);
        assert_eq!(fresnel_dielectric(0.3, 1.0), Fresnel { r: 0.0, cos_t: -0.3, eta_it: 1.0, eta_ti: 1.0 });
    }

    #[test]
    fn near_matched_indices_do_not_cancel() {
        // r at the normal is ((η − 1)/(η + 1))² for η exactly the f32.
        for eta in [1.0001f32, 1.000_000_1, 1.5, 100.0, 1e3] {
            let e = f64::from(eta);
            let expected = ((e - 1.0) / (e + 1.0)).powi(2);
            let r = f64::from(fresnel_dielectric(1.0, eta).r);
            assert!((r / expected - 1.0).abs() < 1e-6, "{eta}: {r} {expected}");
        }
    }

    #[test]
    fn conductor_meets_complex_arithmetic() {
        for (eta, k) in [(0.05f32, 4.0f32), (1.5, 0.0), (0.2, 3.9), (2.7, 1e-3), (0.0, 1.0), (1.0, 0.0)] {
            for angle in [0.0, 30.0, 60.0, 85.0, 89.9, 89.999] {
                let cos = cos_deg(angle);
                let r = f64::from(fresnel_conductor(cos, Rgb::splat(eta), Rgb::splat(k)).y);
                let expected = complex_reference(f64::from(cos), f64::from(eta), f64::from(k));
                assert!((r - expected).abs() < 2e-6, "{eta} {k} {angle}: {r} {expected}");
            }
        }
    }

    /// Straight from n = η + ik with complex square root: ½(|rₛ|² + |rₚ|²).
    fn complex_reference(c: f64, eta: f64, k: f64) -> f64 {
        let (nr, ni) = (eta * eta - k * k, 2.0 * eta * k);
        let (zr, zi) = (nr - (1.0 - c * c), ni);
        let m = zr.hypot(zi);
        let (qr, qi) = ((0.5 * (m + zr)).max(0.0).sqrt(), (0.5 * (m - zr)).max(0.0).sqrt());
        let s = ((c - qr).powi(2) + qi * qi) / ((c + qr).powi(2) + qi * qi);
        let (ar, ai) = (nr * c, ni * c);
        let p = ((ar - qr).powi(2) + (ai - qi).powi(2)) / ((ar + qr).powi(2) + (ai + qi).powi(2));
        0.5 * (s + p)
    }

    #[test]
    fn diffuse_mean_is_right() {
        assert!((fresnel_diffuse_reflectance(1.5) - 0.091_777_955).abs() < 1e-7);
        assert!((fresnel_diffuse_reflectance(1.0 / 1.5) - 0.596_345_751).abs() < 1e-7);
        assert!((fresnel_diffuse_reflectance_fit(1.5) - 0.091_777_955).abs() < 2e-4);
        assert!((fresnel_diffuse_reflectance_fit(1.0 / 1.5) - 0.596_345_751).abs() < 1e-3);
        assert_eq!(fresnel_diffuse_reflectance(1.0), 0.0);
    }
}
