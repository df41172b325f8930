//! Iridescence of a thin film on a dielectric or metal: Belcour and Barla
//! 2017, "A Practical Extension to Microfacet Theory for the Modeling of
//! Varying Iridescence", in the form of `KHR_materials_iridescence`: Schlick's
//! reflectance at both interfaces, two orders of interference, the spectral
//! integrals by Gaussian fits of the CIE observer.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use super::energy::schlick;
use super::quadrature::gauss_legendre;
use crate::math::Rgb;

/// Directions from which a film is looked at, enough for the colours of one of
/// 2000 nm, and their weights in a mean over diffuse light (2μ dμ).
static LOOKS: LazyLock<Vec<(f32, f32)>> = LazyLock::new(|| {
    let look = |(x, weight): (f64, f64)| (x.powf(1.2) as f32, (2.4 * weight * x.powf(1.4)) as f32);
    gauss_legendre(24).into_iter().map(look).collect()
});

/// A film's reflectance as f₀ of Schlick's (f₉₀ = 1), over all directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Survey {
    /// The least f₀ above every channel everywhere.
    pub most: f32,
    /// The mean over diffuse light of the largest channel's.
    pub mean: f32,
    /// The mean of each channel.
    pub colour: Rgb,
}

/// A thin film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Index of refraction.
    pub ior: f32,
    /// Thickness in nanometres.
    pub thickness: f32,
}

impl Film {
    /// Reflectance at a cosine in [0, 1] with the normal, over a base of
    /// reflectance `f0`; within [0, 1].
    #[must_use]
    pub fn reflectance(&self, cos: f32, f0: Rgb) -> Rgb {
        if !(self.thickness > 0.0) {
            return f0 + (Rgb::ONE - f0) * schlick(cos);
        }
        // A vanishing film is none.
        let x = (self.thickness / 0.03).clamp(0.0, 1.0);
        let ior = 1.0 + (self.ior - 1.0) * (x * x * (3.0 - 2.0 * x));
        let cos2 = 1.0 - (1.0 - cos * cos) / (ior * ior);
        if cos2 < 0.0 {
            return Rgb::ONE;
        }
        let cos_film = cos2.sqrt();
        // The first interface, and the second.
        let top0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let top = top0 + (1.0 - top0) * schlick(cos);
        let through = 1.0 - top;
        let root = f0.clamp(Rgb::ZERO, Rgb::splat(0.9999)).to_array().map(f32::sqrt);
        let base_ior = Rgb::from_array(root.map(|r| (1.0 + r) / (1.0 - r)));
        let ratio = (base_ior - ior) / (base_ior + ior);
        let bottom0 = ratio * ratio;
        let bottom = bottom0 + (Rgb::ONE - bottom0) * schlick(cos_film);
        // Half a wave is lost at a denser medium.
        let first = if ior < 1.0 { 0.0 } else { PI };
        let shift = Rgb::from_array(base_ior.to_array().map(|n| first + if n < ior { PI } else { 0.0 }));

        let path = 2.0 * ior * self.thickness * cos_film;
        let both = (bottom * top).clamp(Rgb::ZERO, Rgb::splat(0.9999));
        let amplitude = Rgb::from_array(both.to_array().map(f32::sqrt));
        let inside = bottom * (through * through) / (Rgb::ONE - both);
        let mut sum = inside + top;
        let mut order = inside - through;
        for m in [1.0, 2.0] {
            order *= amplitude;
            sum += order * 2.0 * interference(m * path, shift * m);
        }
        sum.clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// The f₀ with which Schlick's reflectance (f₉₀ = 1) is that of the largest
    /// channel at a cosine; below 1, so that what passes has no holes, in which a
    /// density would find no sample.
    pub(super) fn schlick_f0(&self, cos: f32, f0: Rgb) -> f32 {
        let s = schlick(cos);
        ((self.reflectance(cos, f0).max_element() - s) / (1.0 - s).max(1e-3)).clamp(0.0, 0.9996)
    }

    /// The film from all directions.
    pub(super) fn survey(&self, f0: Rgb) -> Survey {
        let (mut most, mut mean, mut all) = (0.0f32, 0.0, 0.0);
        let mut colour = Rgb::ZERO;
        for &(cos, weight) in LOOKS.iter() {
            let s = schlick(cos);
            let f = (self.reflectance(cos, f0) - s) / (1.0 - s).max(1e-3);
            let f = f.clamp(Rgb::ZERO, Rgb::ONE);
            let weight = weight * (1.0 - s);
            most = most.max(f.max_element());
            mean += weight * f.max_element();
            colour += f * weight;
            all += weight;
        }
        // Between two looks it may rise a little more.
        Survey { most: (most + 0.02).min(1.0), mean: mean / all, colour: colour / all }
    }
}

/// cos of the phase of a path difference in nanometres, seen through the
/// matching functions and turned to linear RGB; 1 for none.
fn interference(path: f32, shift: Rgb) -> Rgb {
    let phase = TAU * path * 1e-9;
    let line = |value: f32, position: f32, variance: f32, shift: f32| {
        let norm = value * (TAU * variance).sqrt() / 1.0685e-7;
        norm * (position * phase + shift).cos() * (-phase * phase * variance).exp()
    };
    let x = line(5.4856e-13, 1.6810e6, 4.3278e9, shift.x) + line(9.7470e-14, 2.2399e6, 4.5282e9, shift.x);
    let y = line(4.4201e-13, 1.7953e6, 9.3046e9, shift.y);
    let z = line(5.2481e-13, 2.2084e6, 6.6121e9, shift.z);
    // CIE XYZ to linear Rec. 709.
    Rgb::new(
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_film_is_the_base() {
        for (thickness, angles) in [(0.0, &[1.0f32, 0.7, 0.3][..]), (1e-4, &[1.0])] {
            let film = Film { ior: 1.3, thickness };
            for &cos in angles {
                let f0 = Rgb::new(0.04, 0.5, 0.9);
                let expected = f0 + (Rgb::ONE - f0) * schlick(cos);
                let found = film.reflectance(cos, f0);
                assert!(
                    (found - expected).abs().max_element() < 0.04,
                    "{thickness} {cos}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_film_of_the_base_is_not_seen() {
        for (ior, thickness) in [(1.5f32, 100.0), (2.4, 25.0), (2.4, 300.0)] {
            let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
            let found = Film { ior, thickness }.reflectance(1.0, Rgb::splat(f0));
            assert!((found - f0).abs().max_element() < 1e-5, "{ior} {thickness}: {found}, not {f0}");
        }
    }

    #[test]
    fn colours_change_with_angle_and_stay_bounded() {
        for thickness in [100.0, 400.0, 800.0] {
            let film = Film { ior: 1.3, thickness };
            let f0 = Rgb::splat(0.04);
            let bound = film.survey(f0).most;
            for i in 0..=200 {
                let cos = 0.03 + 0.97 * i as f32 / 200.0;
                let f = film.reflectance(cos, f0);
                let s = schlick(cos);
                assert!(f.min_element() >= 0.0 && f.max_element() <= 1.0);
                assert!(
                    f.max_element() <= bound + (1.0 - bound) * s + 1e-3,
                    "{thickness} {cos}: {f} {bound}"
                );
            }
            assert!((film.reflectance(1.0, f0) - film.reflectance(0.3, f0)).length() > 0.02);
        }
    }
}
