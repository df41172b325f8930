//! Spectra of a scene file to linear sRGB, the way an RGB renderer must.
//!
//! A spectrum is a list of (wavelength in nm, value), linear in between and
//! zero outside. It is integrated against the CIE 1931 2° curves and taken to
//! linear sRGB: rgb = M · Σ xyz(λ)·s(λ)·Δλ / Y₀. The sum has Mitsuba 3's 1000
//! points over 360…830 nm, ends included, so that the two agree to rounding.

use super::cie_tables::CIE;
use crate::math::Rgb;

/// Range of the CIE tables in nm.
const WAVELENGTHS: (f64, f64) = (360.0, 830.0);
/// Points of the sum.
const STEPS: usize = 1000;
/// Integral of ȳ in nm: makes the luminance of a spectrum of ones 1.
const Y_INTEGRAL: f64 = 106.750_259_399_414_06;
/// Makes the luminance of D65 1.
const D65_SCALE: f64 = 1.0 / 98.997_417_518_762_55;
/// XYZ to linear sRGB (Rec. 709 primaries, D65), row by row.
const XYZ_TO_RGB: [[f64; 3]; 3] =
    [[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]];

/// Linear sRGB of an emission spectrum (or of indices of refraction):
/// equal-energy weighting, so a constant spectrum is slightly purple, not grey.
///
/// `pairs` are (nm, value) in rising order of wavelength. Components that come
/// out negative (colours outside sRGB) are clamped to zero, as in Mitsuba.
/// An empty list is black.
#[must_use]
pub fn spectrum_to_rgb(pairs: &[(f64, f64)]) -> Rgb {
    integrate(pairs, false)
}

/// Linear sRGB of a reflectance spectrum as seen under D65: a constant
/// spectrum is grey (to 1 %). Negative components are clamped to zero; values
/// above 1 are kept, and Mitsuba clamps them to 1 for reflectances.
#[must_use]
pub fn reflectance_spectrum_to_rgb(pairs: &[(f64, f64)]) -> Rgb {
    integrate(pairs, true)
}

/// What a value at each of the wavelengths, in nm and rising, adds to the linear
/// sRGB of a reflectance spectrum: [`reflectance_spectrum_to_rgb`] before it
/// clamps.
#[must_use]
pub fn reflectance_weights(wavelengths: &[f64]) -> Vec<[f64; 3]> {
    let mut weights = vec![[0.0; 3]; wavelengths.len()];
    let last = wavelengths.len().saturating_sub(1);
    for_each_point(true, |wavelength, rgb| {
        let Some(place) = wavelengths.partition_point(|w| *w <= wavelength).checked_sub(1) else { return };
        let (a, b) = (wavelengths[place], wavelengths[(place + 1).min(last)]);
        if place == last && wavelength > a {
            return;
        }
        let share = if b > a { (wavelength - a) / (b - a) } else { 0.0 };
        for c in 0..3 {
            weights[place][c] += rgb[c] * (1.0 - share);
            weights[(place + 1).min(last)][c] += rgb[c] * share;
        }
    });
    weights
}

/// Calls for each point of the sum, with what a value of 1 there adds.
fn for_each_point(under_d65: bool, mut f: impl FnMut(f64, [f64; 3])) {
    let step = (WAVELENGTHS.1 - WAVELENGTHS.0) / STEPS as f64 / Y_INTEGRAL;
    for i in 0..STEPS {
        let wavelength = WAVELENGTHS.0 + (i as f64 / (STEPS - 1) as f64) * (WAVELENGTHS.1 - WAVELENGTHS.0);
        let [x, y, z, d65] = cie(wavelength);
        let light = step * if under_d65 { d65 * D65_SCALE } else { 1.0 };
        f(wavelength, XYZ_TO_RGB.map(|m| light * (m[0] * x + m[1] * y + m[2] * z)));
    }
}

fn integrate(pairs: &[(f64, f64)], under_d65: bool) -> Rgb {
    let mut xyz = [0.0f64; 3];
    for i in 0..STEPS {
        let wavelength = WAVELENGTHS.0 + (i as f64 / (STEPS - 1) as f64) * (WAVELENGTHS.1 - WAVELENGTHS.0);
        let row = cie(wavelength);
        let light = if under_d65 { row[3] * D65_SCALE } else { 1.0 };
        let value = interpolate(pairs, wavelength) * light;
        for c in 0..3 {
            xyz[c] += row[c] * value;
        }
    }
    let step = (WAVELENGTHS.1 - WAVELENGTHS.0) / STEPS as f64 / Y_INTEGRAL;
    let rgb = XYZ_TO_RGB.map(|m| step * (m[0] * xyz[0] + m[1] * xyz[1] + m[2] * xyz[2]));
    Rgb::new(rgb[0] as f32, rgb[1] as f32, rgb[2] as f32).max(Rgb::ZERO)
}

/// x̄, ȳ, z̄ and D65 at a wavelength within the table.
fn cie(wavelength: f64) -> [f64; 4] {
    let x = (wavelength - WAVELENGTHS.0) / 5.0;
    let i = (x as usize).min(CIE.len() - 2);
    let w = x - i as f64;
    std::array::from_fn(|c| (1.0 - w) * f64::from(CIE[i][c]) + w * f64::from(CIE[i + 1][c]))
}

/// The CIE 1931 curves at a wavelength in nm as linear sRGB, not normalised
/// and negative where the colour is out of gamut; zero outside 360…830 nm.
#[must_use]
pub fn matching_rgb(wavelength: f64) -> [f64; 3] {
    if !(wavelength >= WAVELENGTHS.0 && wavelength <= WAVELENGTHS.1) {
        return [0.0; 3];
    }
    let [x, y, z, _] = cie(wavelength);
    XYZ_TO_RGB.map(|m| m[0] * x + m[1] * y + m[2] * z)
}

fn interpolate(pairs: &[(f64, f64)], wavelength: f64) -> f64 {
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else {
        return 0.0;
    };
    if !(wavelength >= first.0 && wavelength <= last.0) {
        return 0.0;
    }
    let next = pairs.partition_point(|p| p.0 <= wavelength).clamp(1, pairs.len().max(2) - 1);
    let (Some(a), Some(b)) = (pairs.get(next - 1), pairs.get(next)) else {
        return first.1;
    };
    if b.0 > a.0 { a.1 + (b.1 - a.1) * (wavelength - a.0) / (b.0 - a.0) } else { b.1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_mitsuba_391() {
        // mi.spectrum_list_to_srgb([400, 500, 600, 700], [.1, .5, .3, .9], False, d65)
        let pairs = [(400.0, 0.1), (500.0, 0.5), (600.0, 0.3), (700.0, 0.9)];
        let emission = Rgb::new(0.456_375_34, 0.399_963_73, 0.269_124_13);
        let reflectance = Rgb::new(0.364_962_1, 0.424_426_8, 0.303_798_26);
        assert!((spectrum_to_rgb(&pairs) - emission).abs().max_element() < 1e-6);
        assert!((reflectance_spectrum_to_rgb(&pairs) - reflectance).abs().max_element() < 1e-6);
    }

    #[test]
    fn weights_make_the_same_colour() {
        let pairs = [(380.0, 0.2), (400.0, 0.1), (500.0, 0.5), (600.0, 0.3), (700.0, 0.9)];
        let weights = reflectance_weights(&pairs.map(|p| p.0));
        let sum = |c: usize| pairs.iter().zip(&weights).map(|(p, w)| p.1 * w[c]).sum::<f64>() as f32;
        let expected = reflectance_spectrum_to_rgb(&pairs);
        assert!((Rgb::new(sum(0), sum(1), sum(2)) - expected).abs().max_element() < 1e-6);
        assert!(reflectance_weights(&[]).is_empty());
        assert!(reflectance_weights(&[500.0, 500.0]).iter().flatten().all(|w| w.is_finite()));
    }

    #[test]
    fn odd_lists_do_no_harm() {
        assert_eq!(spectrum_to_rgb(&[]), Rgb::ZERO);
        assert!(spectrum_to_rgb(&[(500.0, 1.0)]).is_finite());
        assert!(spectrum_to_rgb(&[(500.0, 1.0), (500.0, 2.0), (510.0, 2.0)]).is_finite());
        let grey = reflectance_spectrum_to_rgb(&[(300.0, 1.0), (900.0, 1.0)]);
        assert!((grey - Rgb::ONE).abs().max_element() < 0.01, "{grey}");
    }
}
