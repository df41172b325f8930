//! Pixel-wise error metrics between a picture and its reference.
//!
//! With a the picture, b the reference, m the mean of b over all pixels and
//! channels, and means taken over all pixels and channels:
//!
//! | name | formula |
//! |-|-|
//! | MSE | mean (a − b)² |
//! | relMSE | mean (a − b)² / (b² + 1e-2 m²) |
//! | MAPE | mean \|a − b\| / (\|b\| + 1e-2 m) |
//! | SMAPE | mean 2 \|a − b\| / (\|a\| + \|b\| + 1e-2 m) |
//! | PSNR | 10 log₁₀(max b² / MSE), in dB |
//!
//! The floors scale with the reference's mean, so that all but MSE are the
//! same for a scene under twice the light, and depend on the reference alone,
//! so that they are the same for every picture compared with it. relMSE of a
//! Monte Carlo picture is ruled by its few brightest outliers:
//! [`Metrics::rel_mse_trimmed`] leaves out the worst 0.1 % of the values.

use std::fmt;

pub use super::flip::{FlipHdr, flip_hdr, flip_ldr};
pub use super::ztest::{Failure, Verdict, ZLevel, ZOptions, ZReport, z_test};
use crate::desc::{Error, Result};

/// Floor of relMSE's denominator, in units of the squared mean of the reference.
const RELATIVE_FLOOR: f64 = 1e-2;

/// Part of the values that the trimmed relMSE leaves out.
const TRIMMED: f64 = 1e-3;

/// A picture: interleaved scene-linear RGB, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct RgbView<'a> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `3 * width * height` values: r, g, b of the first pixel, and so on.
    pub data: &'a [f32],
}

impl<'a> RgbView<'a> {
    /// A view of `data`.
    ///
    /// # Errors
    /// When `data` does not hold exactly three values per pixel, or is empty.
    pub fn new(width: usize, height: usize, data: &'a [f32]) -> Result<RgbView<'a>> {
        let expected = width.checked_mul(height).and_then(|n| n.checked_mul(3));
        if expected != Some(data.len()) || data.is_empty() {
            return Err(Error::new(format!(
                "a picture of {width}x{height} pixels has three values each and at least one pixel; got {} values",
                data.len()
            )));
        }
        Ok(RgbView { width, height, data })
    }

    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }
}

/// A picture and the reference that it is measured against, of one size.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    image: RgbView<'a>,
    reference: RgbView<'a>,
}

impl<'a> Pair<'a> {
    /// Pairs a picture with its reference.
    ///
    /// # Errors
    /// When the sizes differ.
    pub fn new(image: RgbView<'a>, reference: RgbView<'a>) -> Result<Pair<'a>> {
        if (image.width, image.height) != (reference.width, reference.height) {
            return Err(Error::new(format!(
                "pictures of different size: {}x{} and {}x{}",
                image.width, image.height, reference.width, reference.height
            ))
            .hint("only pictures of the same size can be compared"));
        }
        Ok(Pair { image, reference })
    }

    /// The picture that is measured.
    #[must_use]
    pub fn image(&self) -> RgbView<'a> {
        self.image
    }

    /// What it is measured against.
    #[must_use]
    pub fn reference(&self) -> RgbView<'a> {
        self.reference
    }

    /// The values of both, in f64, where both are finite.
    fn finite(&self) -> impl Iterator<Item = (f64, f64)> + Clone + 'a {
        let (image, reference) = (self.image.data, self.reference.data);
        image
            .iter()
            .zip(reference)
            .map(|(a, b)| (f64::from(*a), f64::from(*b)))
            .filter(|(a, b)| a.is_finite() && b.is_finite())
    }
}

/// The metrics of the module's table. All are 0 (PSNR: infinite) for equal
/// pictures. The mean of no values at all is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metrics {
    /// Mean squared error, in radiance².
    pub mse: f64,
    /// Relative mean squared error.
    pub rel_mse: f64,
    /// The same without the worst 0.1 % of its terms.
    pub rel_mse_trimmed: f64,
    /// Mean absolute relative error (1 = 100 %).
    pub mape: f64,
    /// Symmetric mean absolute relative error (1 = 100 %), at most 2.
    pub smape: f64,
    /// Peak signal-to-noise ratio in dB; the peak is the reference's largest
    /// value.
    pub psnr: f64,
    /// Mean HDR-FLIP, see [`flip_hdr`].
    pub flip: f64,
    /// Mean FLIP of the pictures clamped to [0, 1], see [`flip_ldr`].
    pub flip_ldr: f64,
    /// Values left out because one of the two is NaN or infinite. FLIP reads
    /// them as 0.
    pub skipped: usize,
}

/// Measures a picture against its reference.
#[must_use]
pub fn metrics(pair: &Pair<'_>) -> Metrics {
    let values = pair.finite();
    let (count, sum) = values.clone().fold((0_usize, 0.0), |(n, sum), (_, b)| (n + 1, sum + b));
    let mut all = pixel_metrics(values, (sum / count as f64).abs());
    all.flip = flip_hdr(pair).mean;
    all.flip_ldr = mean_of(&flip_ldr(pair));
    all.skipped = pair.image.data.len() - count;
    all
}

/// All but FLIP of (picture, reference) values, finite both. `mean` is the
/// reference's mean that the floors are in units of.
pub(super) fn pixel_metrics(values: impl Iterator<Item = (f64, f64)>, mean: f64) -> Metrics {
    let floor = 1e-2 * mean;
    let (mut mse, mut mape, mut smape, mut peak) = (0.0, 0.0, 0.0, 0.0_f64);
    let mut relative = Vec::with_capacity(values.size_hint().1.unwrap_or(0));
    for (a, b) in values {
        let difference = (a - b).abs();
        peak = peak.max(b);
        mse += difference * difference;
        mape += ratio(difference, b.abs() + floor);
        smape += ratio(2.0 * difference, a.abs() + b.abs() + floor);
        relative.push(relative_square(difference * difference, b, mean));
    }
    let n = relative.len() as f64;
    mse /= n;
    relative.sort_unstable_by(f64::total_cmp);
    let kept = relative.len() - (n * TRIMMED) as usize;
    Metrics {
        mse,
        rel_mse: relative.iter().sum::<f64>() / n,
        rel_mse_trimmed: relative[..kept].iter().sum::<f64>() / kept as f64,
        mape: mape / n,
        smape: smape / n,
        psnr: 10.0 * (peak * peak / mse).log10(),
        flip: f64::NAN,
        flip_ldr: f64::NAN,
        skipped: 0,
    }
}

/// A squared error as relMSE weighs it, for a reference `b` in a picture of
/// that mean.
pub(super) fn relative_square(square: f64, b: f64, mean: f64) -> f64 {
    ratio(square, b * b + RELATIVE_FLOOR * mean * mean)
}

/// Mean of a map.
fn mean_of(map: &[f32]) -> f64 {
    map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64
}

/// a / b, and 0 where both are 0 (a black pixel in a black picture).
fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}

impl fmt::Display for Metrics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "MSE      {:.6e}", self.mse)?;
        writeln!(f, "relMSE   {:.6e} (without the worst 0.1 %: {:.6e})", self.rel_mse, self.rel_mse_trimmed)?;
        writeln!(f, "MAPE     {:.4} %", 100.0 * self.mape)?;
        writeln!(f, "SMAPE    {:.4} %", 100.0 * self.smape)?;
        writeln!(f, "PSNR     {:.2} dB", self.psnr)?;
        write!(f, "FLIP     {:.6} (HDR, mean; LDR {:.6})", self.flip, self.flip_ldr)?;
        if self.skipped > 0 {
            write!(f, "\n{} values are not finite in one of the two and were left out", self.skipped)?;
        }
        Ok(())
    }
}
