//! Diffuse base under a dielectric coat: the light that is reflected back and
//! forth between the two.
//!
//! Of the light that enters, ρ is scattered by the base, the fraction R_i of
//! that is reflected back down by the coat, and so on: the base shines with
//! ρ/(1 − R_i) ("linear", colours are kept) or ρ/(1 − ρ·R_i) ("nonlinear"),
//! over η² for the spread of solid angle at the interface.

use super::fresnel::{fresnel_diffuse_reflectance, fresnel_diffuse_reflectance_fit};
use crate::math::Rgb;

/// Dielectric coat of a plastic; made once per material.
///
/// R_i follows Mitsuba (a published fit for the smooth coat, a quadrature for
/// the rough one). Both can let out more light than came in: a white base
/// under a smooth coat of η = 1.5 returns 0.1 % too much, 20 % at η = 3. So
/// the base is limited to what makes the whole return all it receives, which
/// only near-white bases ever reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    /// η of the coat over that of the outside.
    eta: f32,
    /// 1 − R_i: diffuse light from inside that gets out.
    escape: f32,
    /// 1/η².
    inv_eta2: f32,
    /// 1/T with T the transmittance of diffuse light from outside: where
    /// energy is conserved.
    limit: f32,
}

impl Coat {
    /// A smooth coat; `eta` is η of the coat over that of the outside, > 0.
    #[must_use]
    pub fn smooth(eta: f32) -> Coat {
        let e = f64::from(eta);
        let fit = 1.0 - fresnel_diffuse_reflectance_fit(1.0 / e);
        let exact = 1.0 - fresnel_diffuse_reflectance(1.0 / e);
        Coat::new(eta, if fit > 0.0 { fit } else { exact }, 1.0 - fresnel_diffuse_reflectance(e))
    }

    /// A coat by its diffuse transmittances from inside and outside, in (0, 1].
    pub(super) fn new(eta: f32, escape: f64, enter: f64) -> Coat {
        let e = f64::from(eta);
        Coat { eta, escape: escape as f32, inv_eta2: (1.0 / (e * e)) as f32, limit: (1.0 / enter) as f32 }
    }

    /// η of the coat over that of the outside.
    #[must_use]
    pub fn eta(&self) -> f32 {
        self.eta
    }

    /// Transmittance of diffuse light from outside.
    pub(super) fn enter(&self) -> f32 {
        1.0 / self.limit
    }

    /// How the base shines for unit light past the coat, including 1/η²; to be
    /// multiplied by the transmittances of both directions and cos θi/π.
    pub(super) fn base(&self, reflectance: Rgb, nonlinear: bool) -> Rgb {
        let escape =
            if nonlinear { Rgb::ONE - reflectance * (1.0 - self.escape) } else { Rgb::splat(self.escape) };
        (reflectance * self.inv_eta2 / escape).min(Rgb::splat(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_base_returns_what_it_gets_and_no_more() {
        for eta in [1.0f32, 1.000_000_1, 1.3, 1.49, 2.4, 5.0, 10.0, 1e3, 0.7] {
            let coat = Coat::smooth(eta);
            let white = coat.base(Rgb::ONE, true).x * coat.enter();
            assert!(white <= 1.0 + 1e-6 && white > 0.985, "{eta}: {white}");
            for rho in [0.0, 1e-6, 0.18, 0.5, 0.999] {
                let linear = coat.base(Rgb::splat(rho), false).x;
                let nonlinear = coat.base(Rgb::splat(rho), true).x;
                assert!(nonlinear <= linear && linear >= 0.0 && linear <= coat.limit, "{eta} {rho}");
            }
        }
    }
}
