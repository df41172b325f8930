//! The sky and the sun of Hošek and Wilkie.
//!
//! * Sky: L. Hošek, A. Wilkie 2012, "An Analytic Model for Full Spectral
//!   Sky-Dome Radiance", ACM TOG 31(4), equations 8 and 9, with the published
//!   coefficients for linear RGB.
//! * Sun: the same 2013, "Adding a Solar-Radiance Function to the
//!   Hošek–Wilkie Skylight Model", IEEE CG&A 33(3): cubic splines over elevation
//!   for 11 wavelengths, times a polynomial of the cosine at the sun's surface
//!   for the darkening of its limb.
//!
//! Radiance is in W·m⁻²·sr⁻¹·nm⁻¹ weighed by the CIE curves, as in Mitsuba 3.9 in RGB.
//! Its sun becomes RGB by a sum over the 11 wavelengths with a step of
//! 467.07/11 nm. The integral of the spectrum (40 nm apart, linear between) is
//! 5 to 8 % less; the sum is kept, so that the same file gives the same light.
//!
//! The data (`sky_data.bin`, written by `tools/sky_data.py`) are under the
//! licence in `sky_data.LICENSE.txt`.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::color;
use crate::math::{DVec3, Rgb};

static DATA: &[u8] = include_bytes!("sky_data.bin");

const TURBIDITIES: usize = 10;
const CONTROL_POINTS: usize = 6;
const COEFFICIENTS: usize = 9;
const SEGMENTS: usize = 45;
const WAVELENGTHS: usize = 11;
/// Powers of elevation in a segment; powers of the cosine for the limb.
const POWERS: usize = 4;
const LIMB: usize = 6;

/// Where each table starts, in floats.
const SKY_RADIANCE: usize = 0;
const SKY_COEFFICIENTS: usize = SKY_RADIANCE + TURBIDITIES * 2 * CONTROL_POINTS * 3;
const SOLAR: usize = SKY_COEFFICIENTS + TURBIDITIES * 2 * CONTROL_POINTS * 3 * COEFFICIENTS;
const DARKENING: usize = SOLAR + TURBIDITIES * SEGMENTS * WAVELENGTHS * POWERS;

/// 1 / ∫ ȳ dλ in 1/nm.
const CIE_Y: f64 = 1.0 / 106.750_259_399_414_06;
/// Nanometres that the 11 wavelengths stand for, as Mitsuba has it.
const SOLAR_RANGE: f64 = 467.069_280_386;

fn data(index: usize) -> f64 {
    let bytes = DATA.get(4 * index..4 * index + 4).and_then(|b| b.try_into().ok());
    f64::from(f32::from_le_bytes(bytes.unwrap_or_default()))
}

/// Turbidity as the two levels around it and the share of the upper one.
fn levels(turbidity: f64) -> [(usize, f64); 2] {
    let lower = ((turbidity - 1.0).floor().max(0.0) as usize).min(TURBIDITIES - 2);
    let share = turbidity - 1.0 - lower as f64;
    [(lower, 1.0 - share), (lower + 1, share)]
}

/// The light of the sky without the sun's disc, for one place of the sun.
#[derive(Clone, Debug)]
pub(super) struct Dome {
    /// A to I of equation 8, per channel.
    coefficients: [[f32; COEFFICIENTS]; 3],
    /// The factor of equation 9, per channel.
    radiance: [f32; 3],
}

impl Dome {
    /// Turbidity in \[1, 10\], albedo of the ground in \[0, 1\], the sun's
    /// elevation in \[0, π/2\]; times `scale`.
    pub(super) fn new(turbidity: f64, albedo: Rgb, elevation: f64, scale: f64) -> Dome {
        let x = (elevation / FRAC_PI_2).cbrt();
        let bernstein: [f64; CONTROL_POINTS] = std::array::from_fn(|k| {
            let k32 = k as i32;
            [1.0, 5.0, 10.0, 10.0, 5.0, 1.0][k] * x.powi(k32) * (1.0 - x).powi(5 - k32)
        });
        // `start` of a table whose last index has `count` entries.
        let value = |start: usize, count: usize, channel: usize, i: usize| {
            let albedo = f64::from(albedo[channel]);
            let mut sum = 0.0;
            for (level, share) in levels(turbidity) {
                for (ground, weight) in [(0, 1.0 - albedo), (1, albedo)] {
                    for (k, b) in bernstein.iter().enumerate() {
                        let row = (level * 2 + ground) * CONTROL_POINTS + k;
                        sum += share * weight * b * data(start + (row * 3 + channel) * count + i);
                    }
                }
            }
            sum
        };
        Dome {
            coefficients: std::array::from_fn(|c| {
                std::array::from_fn(|i| value(SKY_COEFFICIENTS, COEFFICIENTS, c, i) as f32)
            }),
            radiance: std::array::from_fn(|c| (value(SKY_RADIANCE, 1, c, 0) * CIE_Y * scale) as f32),
        }
    }

    /// Radiance from a direction whose angle with the zenith has that cosine,
    /// ≥ 0, and that is `gamma` away from the sun. Nothing is negative: at high
    /// turbidity the fit goes below zero in places.
    pub(super) fn radiance(&self, cos_theta: f32, gamma: f32) -> Rgb {
        let cos_gamma = gamma.cos();
        let (horizon, zenith, rayleigh) = (1.0 / (cos_theta + 0.01), cos_theta.sqrt(), cos_gamma * cos_gamma);
        let channel = |c: usize| {
            let [a, b, c_, d, e, f, g, h, i] = self.coefficients[c];
            let base = 1.0 + i * i - 2.0 * i * cos_gamma;
            let mie = (1.0 + rayleigh) / (base * base.sqrt());
            let gradient = 1.0 + a * (b * horizon).exp();
            let around = c_ + d * (e * gamma).exp() + f * rayleigh + g * mie + h * zenith;
            (gradient * around * self.radiance[c]).max(0.0)
        };
        Rgb::new(channel(0), channel(1), channel(2))
    }
}

/// The radiance of the sun's disc at every elevation, for one turbidity.
#[derive(Clone, Debug)]
pub(super) struct SolarDisc {
    /// Per segment of elevation and channel: powers of elevation, powers of
    /// the cosine.
    segments: Vec<[[[f64; LIMB]; POWERS]; 3]>,
}

impl SolarDisc {
    /// Turbidity in \[1, 10\]; times `scale`.
    pub(super) fn new(turbidity: f64, scale: f64) -> SolarDisc {
        let colours: [[f64; 3]; WAVELENGTHS] = std::array::from_fn(|w| {
            let step = SOLAR_RANGE / WAVELENGTHS as f64 * CIE_Y * scale;
            color::matching_rgb(320.0 + 40.0 * w as f64).map(|v| v * step)
        });
        let segment = |s: usize| {
            let mut out = [[[0.0; LIMB]; POWERS]; 3];
            for (w, colour) in colours.iter().enumerate() {
                for (channel, weight) in out.iter_mut().zip(colour) {
                    for (k, row) in channel.iter_mut().enumerate() {
                        let entry = |t: usize| ((t * SEGMENTS + s) * WAVELENGTHS + w) * POWERS + k;
                        let spectral: f64 =
                            levels(turbidity).iter().map(|(t, share)| share * data(SOLAR + entry(*t))).sum();
                        for (j, value) in row.iter_mut().enumerate() {
                            *value += weight * spectral * data(DARKENING + w * LIMB + j);
                        }
                    }
                }
            }
            out
        };
        SolarDisc { segments: (0..SEGMENTS).map(segment).collect() }
    }

    /// Radiance at an elevation in \[0, π/2\], where the sun's surface is seen
    /// under an angle with that cosine in \[0, 1\]. Nothing is negative: a low
    /// sun is redder than linear sRGB can be.
    pub(super) fn radiance(&self, elevation: f64, cosine: f64) -> DVec3 {
        let place = (elevation / FRAC_PI_2).cbrt() * SEGMENTS as f64;
        let segment = (place as usize).min(SEGMENTS - 1);
        let x = elevation - FRAC_PI_2 * (segment as f64 / SEGMENTS as f64).powi(3);
        let limb = |row: &[f64; LIMB]| row.iter().rev().fold(0.0, |sum, v| sum * cosine + v);
        let channel = |c: usize| {
            let rows = &self.segments[segment][c];
            rows.iter().rev().fold(0.0, |sum, row| sum * x + limb(row)).max(0.0)
        };
        DVec3::new(channel(0), channel(1), channel(2))
    }

    /// Mean over the visible part of a disc of that angular radius, and how much
    /// of the disc that is.
    pub(super) fn mean(&self, elevation: f64, radius: f64) -> (DVec3, f64) {
        const RINGS: u32 = 64;
        const TURNS: u32 = 64;
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for ring in 0..RINGS {
            // Rings of equal solid angle.
            let u = (f64::from(ring) + 0.5) / f64::from(RINGS);
            let (gamma, cosine) = (radius * u.sqrt(), (1.0 - u).sqrt());
            for turn in 0..TURNS {
                let up = (TAU * (f64::from(turn) + 0.5) / f64::from(TURNS)).cos();
                let height = elevation.sin() * gamma.cos() + elevation.cos() * gamma.sin() * up;
                if height >= 0.0 {
                    sum += self.radiance(height.min(1.0).asin(), cosine);
                    count += 1.0;
                }
            }
        }
        let visible = count / f64::from(RINGS * TURNS);
        (if count > 0.0 { sum / count } else { DVec3::ZERO }, visible)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.segments.len() * size_of::<[[[f64; LIMB]; POWERS]; 3]>()
    }
}

/// Solid angle of a cone with that half angle.
pub(super) fn cone(half_angle: f64) -> f64 {
    let half = (0.5 * half_angle).sin();
    4.0 * PI * half * half
}
