//! Colour values: the sRGB curve, luminance, spectra, and named constants.
//!
//! Everything inside the renderer is scene-linear with Rec. 709 primaries and
//! D65 white ([`crate::math::Rgb`]).

mod cie_tables;
mod conductors;
mod hues;
mod spectrum;

pub use hues::Hue;
pub use spectrum::{matching_rgb, reflectance_spectrum_to_rgb, reflectance_weights, spectrum_to_rgb};

use crate::math::Rgb;
use conductors::CONDUCTORS;

/// sRGB-encoded value to linear (IEC 61966-2-1). Defined on all reals; values
/// below the toe are divided by 12.92, also negative ones.
#[must_use]
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Linear value to sRGB-encoded, the inverse of [`srgb_to_linear`]. Not
/// clamped: what exceeds 1 stays above 1.
#[must_use]
pub fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Luminance of a linear Rec. 709 colour: its CIE Y where white is 1.
#[must_use]
pub fn luminance(rgb: Rgb) -> f32 {
    rgb.dot(Rgb::new(0.212_671, 0.715_16, 0.072_169))
}

/// Names that [`conductor`] knows, sorted; without `none`.
pub static CONDUCTOR_NAMES: [&str; CONDUCTORS.len()] = {
    let mut names = [""; CONDUCTORS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = CONDUCTORS[i].0;
        i += 1;
    }
    names
};

/// Complex index of refraction (η, k) of a named conductor in linear sRGB,
/// relative to vacuum; `None` when the name is unknown. The name `none` is the
/// mirror that reflects everything (η = 0, k = 1). Names are case-sensitive:
/// they are chemical formulas.
#[must_use]
pub fn conductor(name: &str) -> Option<(Rgb, Rgb)> {
    if name == "none" {
        return Some((Rgb::ZERO, Rgb::ONE));
    }
    let row = CONDUCTORS.iter().find(|row| row.0 == name)?;
    Some((Rgb::from_array(row.1), Rgb::from_array(row.2)))
}

/// Names that [`ior`] knows, by rising density of the matter: gases, liquids,
/// solids.
pub static IOR_NAMES: [&str; IORS.len()] = {
    let mut names = [""; IORS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = IORS[i].0;
        i += 1;
    }
    names
};

/// Index of refraction of a named dielectric at about 589 nm, 0…20 °C (values
/// of Mitsuba's table, after Hecht, Optics, 4th edition). Case does not
/// matter; `None` when the name is unknown.
#[must_use]
pub fn ior(name: &str) -> Option<f64> {
    IORS.iter().find(|row| row.0.eq_ignore_ascii_case(name)).map(|row| row.1)
}

const IORS: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000036),
    ("hydrogen", 1.000132),
    ("air", 1.000277),
    ("carbon dioxide", 1.00045),
    ("water", 1.3330),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.52045),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.470),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.5750),
    ("diamond", 2.419),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_curve_inverts_and_meets_its_known_points() {
        for i in -20..=1200 {
            let x = i as f32 / 1000.0;
            assert!((linear_to_srgb(srgb_to_linear(x)) - x).abs() < 2e-6, "{x}");
        }
        assert!((srgb_to_linear(0.5) - 0.214_041_14).abs() < 1e-7);
        assert_eq!((srgb_to_linear(0.0), linear_to_srgb(0.0)), (0.0, 0.0));
        assert!((srgb_to_linear(1.0) - 1.0).abs() < 1e-7 && (luminance(Rgb::ONE) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn names_are_found() {
        assert!(CONDUCTOR_NAMES.is_sorted() && CONDUCTOR_NAMES.len() == 71);
        for name in CONDUCTOR_NAMES {
            let (eta, k) = conductor(name).unwrap();
            assert!(eta.is_finite() && k.is_finite() && eta.min_element() >= 0.0, "{name}");
        }
        assert!((conductor("Au").unwrap().1.x - 3.982_997).abs() < 1e-6);
        assert_eq!(conductor("none"), Some((Rgb::ZERO, Rgb::ONE)));
        assert_eq!(conductor("Unobtainium"), None);
        for name in IOR_NAMES {
            assert!(ior(name).unwrap() >= 1.0);
        }
        assert_eq!(ior("BK7"), Some(1.5046));
        assert_eq!(ior("mud"), None);
    }
}
