//! Scene-linear radiance to display values, for previews.
//!
//! - `srgb`: the sRGB curve (IEC 61966-2-1), cut off at 1.
//! - `agx`: a film-like curve after the idea of T. Sobotka's AgX: colours are
//!   drawn towards grey, each channel goes through a sigmoid over the
//!   logarithm of exposure, and the pull towards grey is undone. Highlights
//!   roll off and lose saturation instead of being cut off.
//!
//! The numbers of `agx` are ours. Exposure x runs from 0 to 1 over −10 to +6.5
//! stops around middle grey 0.18; with y0 the sRGB value of 0.18 at x0 = 10 /
//! 16.5, and t the distance from y0 to the end (0 or 1) of that side,
//!
//!   f(x) = y0 ± s·d / (1 + (s·d / L)^p)^(1/p),   d = |x − x0|,
//!   L = s·D / ((s·D / t)^p − 1)^(1/p),           D = d at the end,
//!
//! which passes through (0, 0), (x0, y0), (1, 1) with slope s at x0. s = 2.4
//! is 0.145 per stop, the slope of the sRGB curve there.

use crate::math::Rgb;

/// How a preview is toned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tone {
    /// Stops: radiance is multiplied by 2^exposure.
    pub exposure: f32,
    /// The curve.
    pub curve: Curve,
}

/// A tone curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curve {
    /// The sRGB curve, cut off at 1.
    #[default]
    Srgb,
    /// A film-like curve with soft highlights.
    Agx,
}

impl Curve {
    /// Names of the curves.
    pub const NAMES: &'static [&'static str] = &["srgb", "agx"];

    /// The curve of a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Curve> {
        match name {
            "srgb" => Some(Curve::Srgb),
            "agx" => Some(Curve::Agx),
            _ => None,
        }
    }
}

impl Tone {
    /// Display values in [0, 1], sRGB encoded; NaN becomes 0.
    #[must_use]
    pub fn apply(&self, radiance: Rgb) -> Rgb {
        let scaled = (radiance * self.exposure.exp2()).to_array();
        let linear = scaled.map(|v| if v > 0.0 { v.min(f32::MAX) } else { 0.0 });
        match self.curve {
            Curve::Srgb => Rgb::from(linear.map(encode_srgb)),
            Curve::Agx => Rgb::from(agx(linear)),
        }
    }
}

/// The sRGB curve: linear in [0, ∞) to encoded in [0, 1].
fn encode_srgb(v: f32) -> f32 {
    let encoded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    encoded.min(1.0)
}

const GREY: f32 = 0.18;
const STOPS_BELOW: f32 = 10.0;
const STOPS_ABOVE: f32 = 6.5;
const SLOPE: f32 = 2.4;
const TOE_POWER: f32 = 1.5;
const SHOULDER_POWER: f32 = 1.5;
/// Share of each other channel mixed into a channel.
const INSET: f32 = 0.07;

fn agx(linear: [f32; 3]) -> [f32; 3] {
    // Thirds first, so that the sum of the largest floats is finite.
    let third = linear.iter().map(|v| v / 3.0).sum::<f32>();
    let inset = linear.map(|v| v * (1.0 - 3.0 * INSET) + 3.0 * INSET * third);
    let curved = inset.map(sigmoid);
    let sum: f32 = curved.iter().sum();
    curved.map(|v| ((v - INSET * sum) / (1.0 - 3.0 * INSET)).clamp(0.0, 1.0))
}

fn sigmoid(v: f32) -> f32 {
    let span = STOPS_BELOW + STOPS_ABOVE;
    let x = (((v / GREY).log2() + STOPS_BELOW) / span).clamp(0.0, 1.0);
    let (x0, y0) = (STOPS_BELOW / span, encode_srgb(GREY));
    if x < x0 {
        y0 - one_side(x0 - x, x0, y0, TOE_POWER)
    } else {
        y0 + one_side(x - x0, 1.0 - x0, 1.0 - y0, SHOULDER_POWER)
    }
}

/// s·d / (1 + (s·d / L)^p)^(1/p), with L such that it is `target` at d = `end`.
fn one_side(d: f32, end: f32, target: f32, power: f32) -> f32 {
    let limit_power = ((SLOPE * end / target).powf(power) - 1.0) / (SLOPE * end).powf(power);
    SLOPE * d / (1.0 + (SLOPE * d).powf(power) * limit_power).powf(1.0 / power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_the_standard_curve() {
        let tone = Tone::default();
        let near = |v: f32, e: f32| assert!((tone.apply(Rgb::splat(v)).x - e).abs() < 1e-6, "{v}");
        near(0.0, 0.0);
        near(0.002, 0.025_84);
        near(0.18, 0.461_356);
        near(1.0, 1.0);
        near(50.0, 1.0);
        near(-1.0, 0.0);
        near(f32::NAN, 0.0);
        let brighter = Tone { exposure: 1.0, ..tone };
        assert_eq!(brighter.apply(Rgb::splat(0.25)), tone.apply(Rgb::splat(0.5)));
    }

    #[test]
    fn agx_rises_from_black_to_white_through_middle_grey() {
        let tone = Tone { exposure: 0.0, curve: Curve::Agx };
        let value = |v: f32| tone.apply(Rgb::splat(v));
        assert!((value(0.18).x - 0.461_356).abs() < 1e-5);
        assert_eq!(value(0.0), Rgb::ZERO);
        assert!((value(f32::INFINITY) - Rgb::ONE).abs().max_element() < 1e-5);
        let mut last = 0.0;
        for i in 0..200 {
            let v = value(0.18 * 2f32.powf(-10.0 + 16.5 * i as f32 / 199.0));
            assert!(v.x >= last && v.x <= 1.0 && (v.x - v.z).abs() < 1e-5);
            last = v.x;
        }
        assert!(last > 0.999);
        // The same slope as the sRGB curve at middle grey.
        let slope = |t: Tone| (t.apply(Rgb::splat(0.182)).x - t.apply(Rgb::splat(0.178)).x) / 0.004;
        assert!((slope(tone) / slope(Tone::default()) - 1.0).abs() < 0.05);
    }

    #[test]
    fn agx_keeps_hues_and_turns_bright_colours_white() {
        let tone = Tone { exposure: 0.0, curve: Curve::Agx };
        let dim = tone.apply(Rgb::new(0.2, 0.02, 0.02));
        assert!(dim.x > 1.5 * dim.y);
        let bright = tone.apply(Rgb::new(1000.0, 0.0, 0.0));
        assert!(bright.y > 0.9, "{bright}");
    }
}
