//! Values as Mitsuba 0.x wrote them: `srgb`, `blackbody`, `#rrggbb`, spectra
//! as a list of three, `intent`.
//!
//! What they mean is that of its manual, chapter "Scene file format", for
//! rendering in RGB: a list of three is linear Rec. 709; a black body is
//! Planck's law (W·m⁻²·sr⁻¹·nm⁻¹) times `scale`, which becomes a colour by the
//! CIE curves like any spectrum.

use super::values::{expected, scalar, three, words};
use super::xml::{Attribute, Tag};
use crate::color::srgb_to_linear;
use crate::desc::{Result, Value};

/// Value tags that today's files do not have.
pub const TAGS: &[&str] = &["srgb", "blackbody"];

/// Wavelengths at which a black body is tabulated, in nm: those of the CIE
/// curves, so close that straight lines between them are exact to 1e-6.
const WAVELENGTHS: std::ops::RangeInclusive<u32> = 360..=830;

/// The value of a tag that only old files have, or have in this form; `None`
/// for what is read as today.
pub fn value(tag: &Tag) -> Result<Option<Value>> {
    match (tag.name, tag.get("value")) {
        ("srgb", _) => {
            tag.only(&["name", "value", "intent"])?;
            let attribute = tag.need("value")?;
            match hexadecimal(tag, attribute)? {
                Some(colour) => Ok(Some(colour)),
                None => Ok(Some(Value::Rgb(three(tag, attribute)?.map(linear)))),
            }
        }
        ("rgb", Some(attribute)) => {
            tag.only(&["name", "value", "intent"])?;
            match hexadecimal(tag, attribute)? {
                Some(colour) => Ok(Some(colour)),
                None => Ok(Some(Value::Rgb(three(tag, attribute)?))),
            }
        }
        ("spectrum", Some(attribute)) if tag.get("filename").is_none() => {
            tag.only(&["name", "value", "intent"])?;
            if words(attribute).count() == 1 && attribute.value.trim_start().starts_with('#') {
                return hexadecimal(tag, attribute);
            }
            let list = words(attribute).count() == 3 && !attribute.value.contains(':');
            Ok(if list { Some(Value::Rgb(three(tag, attribute)?)) } else { None })
        }
        ("blackbody", _) => black_body(tag).map(Some),
        _ => Ok(None),
    }
}

fn linear(encoded: f64) -> f64 {
    f64::from(srgb_to_linear(encoded as f32))
}

/// `#rrggbb`, sRGB-encoded as in HTML.
fn hexadecimal(tag: &Tag, attribute: &Attribute) -> Result<Option<Value>> {
    let Some(digits) = attribute.value.trim().strip_prefix('#') else { return Ok(None) };
    let valid = digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let Some(bits) = u32::from_str_radix(digits, 16).ok().filter(|_| valid) else {
        return Err(expected(tag, attribute, "a colour like `#f9aa34`", attribute.value.trim()));
    };
    let channel = |shift: u32| linear(f64::from((bits >> shift) & 0xff) / 255.0);
    Ok(Some(Value::Rgb([channel(16), channel(8), channel(0)])))
}

fn black_body(tag: &Tag) -> Result<Value> {
    tag.only(&["name", "temperature", "scale", "multiplier"])?;
    let attribute = tag.need("temperature")?;
    let text = attribute.value.trim();
    let text = text.strip_suffix(['K', 'k']).unwrap_or(text).trim_end();
    let temperature: f64 = match text.parse() {
        Ok(t) if t > 0.0 && f64::is_finite(t) => t,
        _ => return Err(expected(tag, attribute, "a temperature like `5000K`", attribute.value.trim())),
    };
    let scale = match tag.get("scale").or(tag.get("multiplier")) {
        Some(scale) => scalar(tag, scale)?,
        None => 1.0,
    };
    let planck = |nm: u32| (f64::from(nm), scale * planck(f64::from(nm) * 1e-9, temperature));
    Ok(Value::Spectrum(WAVELENGTHS.map(planck).collect()))
}

/// Planck's law: radiance in W·m⁻²·sr⁻¹·nm⁻¹ at a wavelength in metres and a
/// temperature in kelvin, by the constants of the SI.
fn planck(wavelength: f64, temperature: f64) -> f64 {
    const H: f64 = 6.626_070_15e-34;
    const C: f64 = 299_792_458.0;
    const K: f64 = 1.380_649e-23;
    let numerator = 2.0 * H * C * C / wavelength.powi(5);
    1e-9 * numerator / (H * C / (wavelength * K * temperature)).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::planck;

    /// The peak lies where Wien's law puts it, and all of it is what the law
    /// of Stefan and Boltzmann gives over π.
    #[test]
    fn laws_of_black_bodies() {
        for temperature in [1500.0, 5778.0, 12_000.0] {
            let nm = |i: u32| f64::from(i) * 0.5;
            let peak = (1..40_000).max_by(|a, b| {
                planck(nm(*a) * 1e-9, temperature).total_cmp(&planck(nm(*b) * 1e-9, temperature))
            });
            let wien = 2.897_771_955e6 / temperature;
            assert!((nm(peak.unwrap()) - wien).abs() <= 0.5, "{temperature}");
            let all: f64 = (1..400_000).map(|i| 0.5 * planck(nm(i) * 1e-9, temperature)).sum();
            let stefan = 5.670_374_419e-8 * temperature.powi(4) / std::f64::consts::PI;
            assert!((all / stefan - 1.0).abs() < 1e-4, "{temperature}: {all} {stefan}");
        }
    }
}
