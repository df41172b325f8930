//! Do two noisy pictures have the same mean?
//!
//! The test looks at three scales, because each sees what the others miss:
//!
//! - *pixels*: z = (a − b) / √(var a + var b + tolerance²) for every pixel and
//!   channel, against the two-sided normal threshold with Šidák's correction
//!   for their number. A part of them may lie outside (0.25 % by default),
//!   since fireflies make tails heavier than normal. Finds local errors: a
//!   shifted texture, a leak. A uniform bias of 10 % can pass it.
//! - *blocks* of 8 × 8 pixels: the same on their means, all of which must be
//!   inside unless the difference is under 0.2 % of the block or of the
//!   picture's mean, whichever is larger.
//! - *the whole picture*: its relative difference must be within three
//!   standard errors (or under 1e-4, below which the reference itself is not
//!   to be trusted) and under 0.2 %. Finds biases of 0.1 %.
//!
//! The tolerance makes differences below 1e-4 of the reference (and below
//! 1e-6 of its mean) pass where both variances are zero: it is that difference
//! divided by the threshold. A reference filter wider than the box correlates
//! neighbours, so that the variances of the pixels add up to too little:
//! [`ZOptions::overlap`], 1 / ∫w² in pixels⁻², makes up for it. The three
//! channels are taken as fully correlated in the whole picture's error. Both
//! choices err towards a larger error.

use std::fmt;

use super::metrics::{Pair, RgbView};
use super::statistics::{normal_deviate, sidak_threshold};
use crate::desc::{Error, Result};

/// How strict [`z_test`] is. The default is the rule of `tests/reference.rs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZOptions {
    /// Probability of a single value outside the threshold under the
    /// hypothesis that the means are equal, for all pixels (or all blocks)
    /// together.
    pub alpha: f64,
    /// Part of the pixel-channels that must be inside.
    pub required_fraction: f64,
    /// Largest relative difference of the whole picture.
    pub mean_limit: f64,
    /// Largest relative difference of a block whose z is outside.
    pub block_limit: f64,
    /// Correlation of neighbours: 1 / ∫w² of the reconstruction filter. Box 1,
    /// tent 2.25, Mitsuba's default Gaussian 3.14.
    pub overlap: f64,
    /// Relative standard error of the reference's whole mean, where it is
    /// known better than from its pixels.
    pub reference_mean_error: Option<f64>,
    /// The same for the picture.
    pub image_mean_error: Option<f64>,
    /// Degrees of freedom of the picture's variances (renders they come from,
    /// less one); infinite where they are exact.
    pub image_freedom: f64,
    /// The same for the reference.
    pub reference_freedom: f64,
}

impl ZOptions {
    /// Degrees of freedom of the sum of two variances (Welch 1947).
    fn freedom(&self, image: f64, reference: f64) -> f64 {
        let spread = image * image / self.image_freedom + reference * reference / self.reference_freedom;
        if spread > 0.0 { (image + reference).powi(2) / spread } else { f64::INFINITY }
    }
}

impl Default for ZOptions {
    fn default() -> ZOptions {
        ZOptions {
            alpha: 0.01,
            required_fraction: 0.9975,
            mean_limit: 2e-3,
            block_limit: 2e-3,
            overlap: 1.0,
            reference_mean_error: None,
            image_mean_error: None,
            image_freedom: f64::INFINITY,
            reference_freedom: f64::INFINITY,
        }
    }
}

/// Width and height of the blocks.
const BLOCK: usize = 8;
/// Relative difference that always passes.
const TOLERANCE: f64 = 1e-4;
/// The same in units of the reference's mean, for black pixels.
const BLACK_TOLERANCE: f64 = 1e-6;
/// Standard errors that the whole mean may be off.
const MEAN_SIGMAS: f64 = 3.0;
/// Relative standard error of the whole mean above which nothing is shown.
const INCONCLUSIVE: f64 = 1e-3;

/// What one scale of the test saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZLevel {
    /// Values tested.
    pub count: usize,
    /// Part of them inside the threshold.
    pub fraction_inside: f64,
    /// Two-sided threshold for |z|, corrected for `count`.
    pub threshold: f64,
    /// z of the worst value (infinite where a value is not finite).
    pub worst: f64,
    /// Column, row and channel of the worst value; of a block, its first pixel.
    pub worst_at: [usize; 3],
}

/// The outcome of [`z_test`]. Prints as a short report.
#[derive(Clone, Debug, PartialEq)]
pub struct ZReport {
    /// Every pixel and channel.
    pub pixels: ZLevel,
    /// Means of 8 × 8 pixels, per channel.
    pub blocks: ZLevel,
    /// (mean a − mean b) / mean b over all pixels and channels.
    pub mean_rel_diff: f64,
    /// Standard error of `mean_rel_diff`.
    pub mean_rel_diff_se: f64,
    /// The conclusion.
    pub verdict: Verdict,
}

/// The conclusion of a [`z_test`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No difference that the noise does not explain.
    Pass,
    /// Too noisy to tell: the mean's standard error is over 0.1 %, or the mean
    /// is beyond `mean_limit` but not beyond three standard errors.
    Inconclusive,
    /// Different, for these reasons.
    Fail(Vec<Failure>),
}

/// Which rule of [`z_test`] was broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Too many pixels outside.
    Pixels,
    /// A block of pixels outside.
    Blocks,
    /// The whole mean is off by more than its error allows.
    MeanBeyondError,
    /// The same, and by more than `mean_limit`.
    MeanBeyondLimit,
}

impl ZReport {
    /// Part of the pixel-channels inside the threshold.
    #[must_use]
    pub fn fraction_inside(&self) -> f64 {
        self.pixels.fraction_inside
    }

    /// True for [`Verdict::Pass`] alone.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.verdict == Verdict::Pass
    }
}

/// Tests whether the picture and the reference have the same mean.
///
/// The variances are those of the pictures' own values (of the mean of all
/// samples, not of one sample), per pixel and channel; a missing one counts
/// as 0. Non-finite values count as outside.
///
/// # Errors
/// When the sizes differ.
pub fn z_test(
    pair: &Pair<'_>,
    image_variance: Option<RgbView<'_>>,
    reference_variance: Option<RgbView<'_>>,
    options: &ZOptions,
) -> Result<ZReport> {
    let (width, height) = (pair.reference().width, pair.reference().height);
    for view in [image_variance, reference_variance].into_iter().flatten() {
        if (view.width, view.height) != (width, height) {
            return Err(Error::new(format!(
                "a variance of {}x{} pixels for pictures of {width}x{height}",
                view.width, view.height
            )));
        }
    }
    let data = Data::new(pair, image_variance, reference_variance);
    let pixels = data.pixel_level(options);
    let blocks = data.block_level(options);
    let (difference, error) = data.whole(options);
    let mut failures = Vec::new();
    if !(pixels.fraction_inside >= options.required_fraction) {
        failures.push(Failure::Pixels);
    }
    if blocks.fraction_inside < 1.0 {
        failures.push(Failure::Blocks);
    }
    if !(difference.abs() <= (MEAN_SIGMAS * error).max(TOLERANCE)) {
        failures.push(Failure::MeanBeyondError);
    }
    let beyond_limit = !(difference.abs() <= options.mean_limit);
    if beyond_limit && failures.contains(&Failure::MeanBeyondError) {
        failures.push(Failure::MeanBeyondLimit);
    }
    let verdict = match failures.is_empty() {
        false => Verdict::Fail(failures),
        true if beyond_limit || error > INCONCLUSIVE => Verdict::Inconclusive,
        true => Verdict::Pass,
    };
    Ok(ZReport { pixels, blocks, mean_rel_diff: difference, mean_rel_diff_se: error, verdict })
}

/// Both pictures and their variances in f64, interleaved.
struct Data {
    width: usize,
    height: usize,
    image: Vec<f64>,
    reference: Vec<f64>,
    image_variance: Vec<f64>,
    reference_variance: Vec<f64>,
    /// Mean of the reference's finite values, not negative.
    mean: f64,
}

impl Data {
    fn new(
        pair: &Pair<'_>,
        image_variance: Option<RgbView<'_>>,
        reference_variance: Option<RgbView<'_>>,
    ) -> Data {
        let wide = |view: RgbView<'_>| -> Vec<f64> { view.data.iter().map(|v| f64::from(*v)).collect() };
        let reference = wide(pair.reference());
        let zero = || vec![0.0; reference.len()];
        let finite = reference.iter().filter(|v| v.is_finite());
        let mean = (finite.clone().sum::<f64>() / finite.count().max(1) as f64).abs();
        Data {
            width: pair.reference().width,
            height: pair.reference().height,
            image: wide(pair.image()),
            image_variance: image_variance.map_or_else(zero, wide),
            reference_variance: reference_variance.map_or_else(zero, wide),
            reference,
            mean,
        }
    }

    fn pixel_level(&self, options: &ZOptions) -> ZLevel {
        let mut level = LevelBuilder::new(options.alpha, self.image.len());
        for index in 0..self.image.len() {
            let (a, b) = (self.image[index], self.reference[index]);
            let variance = self.image_variance[index] + self.reference_variance[index];
            let tolerance = TOLERANCE * b.abs() + BLACK_TOLERANCE * self.mean;
            let freedom = options.freedom(self.image_variance[index], self.reference_variance[index]);
            let z = z_score(a - b, variance, tolerance / level.threshold, freedom);
            let pixel = index / 3;
            level.add(z, [pixel % self.width, pixel / self.width, index % 3], false);
        }
        level.finish()
    }

    fn block_level(&self, options: &ZOptions) -> ZLevel {
        let count = 3 * self.width.div_ceil(BLOCK) * self.height.div_ceil(BLOCK);
        let mut level = LevelBuilder::new(options.alpha, count);
        for y in (0..self.height).step_by(BLOCK) {
            for x in (0..self.width).step_by(BLOCK) {
                for channel in 0..3 {
                    let block = self.block(x, y, channel);
                    let n = block.pixels as f64;
                    let difference = (block.image - block.reference) / n;
                    let variance = options.overlap * block.variance / (n * n);
                    let scale = (block.reference / n).abs();
                    let tolerance = (TOLERANCE * scale + BLACK_TOLERANCE * self.mean) / level.threshold;
                    let small = difference.abs() < options.block_limit * scale.max(self.mean);
                    // Neighbours share samples: their variances are counted as one.
                    let freedom =
                        options.freedom(block.image_variance, block.variance - block.image_variance);
                    level.add(z_score(difference, variance, tolerance, freedom), [x, y, channel], small);
                }
            }
        }
        level.finish()
    }

    /// Sums over the block that begins at (x, y).
    fn block(&self, x: usize, y: usize, channel: usize) -> BlockSums {
        let mut sums = BlockSums::default();
        for row in y..(y + BLOCK).min(self.height) {
            for column in x..(x + BLOCK).min(self.width) {
                let index = 3 * (row * self.width + column) + channel;
                sums.pixels += 1;
                sums.image += self.image[index];
                sums.reference += self.reference[index];
                sums.image_variance += self.image_variance[index];
                sums.variance += self.image_variance[index] + self.reference_variance[index];
            }
        }
        sums
    }

    /// Relative difference of the whole mean, and its standard error.
    fn whole(&self, options: &ZOptions) -> (f64, f64) {
        let sum = |values: &[f64]| values.iter().sum::<f64>();
        let total = sum(&self.reference);
        let error = |variance: &[f64]| -> f64 {
            // Channels fully correlated: their standard errors add up.
            let pixel = |v: &[f64]| v.iter().map(|v| v.max(0.0).sqrt()).sum::<f64>().powi(2);
            let squares: f64 = variance.chunks_exact(3).map(pixel).sum();
            (options.overlap * squares).sqrt() / total.abs()
        };
        let image = options.image_mean_error.unwrap_or_else(|| error(&self.image_variance));
        let reference = options.reference_mean_error.unwrap_or_else(|| error(&self.reference_variance));
        let difference = sum(&self.image) - total;
        // Two black pictures are equal.
        if difference == 0.0 { (0.0, 0.0) } else { (difference / total, image.hypot(reference)) }
    }
}

/// Sums over a block of pixels, of one channel.
#[derive(Default)]
struct BlockSums {
    pixels: usize,
    image: f64,
    reference: f64,
    image_variance: f64,
    variance: f64,
}

/// Difference over its standard error as a normal deviate; 0 for no
/// difference at all, infinite where something is not finite.
fn z_score(difference: f64, variance: f64, tolerance: f64, freedom: f64) -> f64 {
    let t = if difference == 0.0 { 0.0 } else { difference / (variance + tolerance * tolerance).sqrt() };
    let z = normal_deviate(t, freedom);
    if z.is_finite() && variance.is_finite() { z } else { f64::INFINITY }
}

/// Counts values inside the threshold and keeps the worst.
struct LevelBuilder {
    threshold: f64,
    count: usize,
    inside: usize,
    worst: f64,
    worst_at: [usize; 3],
}

impl LevelBuilder {
    fn new(alpha: f64, count: usize) -> LevelBuilder {
        let threshold = sidak_threshold(alpha, count);
        LevelBuilder { threshold, count: 0, inside: 0, worst: 0.0, worst_at: [0; 3] }
    }

    /// Takes one value; `excused` ones count as inside and are never the worst.
    fn add(&mut self, z: f64, at: [usize; 3], excused: bool) {
        self.count += 1;
        if excused || z.abs() <= self.threshold {
            self.inside += 1;
        }
        if !excused && z.abs() > self.worst.abs() {
            (self.worst, self.worst_at) = (z, at);
        }
    }

    fn finish(self) -> ZLevel {
        ZLevel {
            count: self.count,
            fraction_inside: self.inside as f64 / self.count as f64,
            threshold: self.threshold,
            worst: self.worst,
            worst_at: self.worst_at,
        }
    }
}

impl fmt::Display for ZLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, channel] = self.worst_at;
        write!(
            f,
            "{:.4} % of {} inside ±{:.2}, worst {:+.2} at ({x}, {y}) {}",
            100.0 * self.fraction_inside,
            self.count,
            self.threshold,
            self.worst,
            ["R", "G", "B"][channel]
        )
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Failure::Pixels => "too many pixels outside",
            Failure::Blocks => "a block of pixels outside",
            Failure::MeanBeyondError => "the mean is off by more than three standard errors",
            Failure::MeanBeyondLimit => "the mean is off by more than the limit",
        })
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Verdict::Pass => f.write_str("pass"),
            Verdict::Inconclusive => f.write_str("inconclusive: too noisy to tell"),
            Verdict::Fail(failures) => {
                let reasons: Vec<String> = failures.iter().map(Failure::to_string).collect();
                write!(f, "FAIL: {}", reasons.join("; "))
            }
        }
    }
}

impl fmt::Display for ZReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "pixels   {}", self.pixels)?;
        writeln!(f, "blocks   {}", self.blocks)?;
        let (difference, error) = (100.0 * self.mean_rel_diff, 100.0 * self.mean_rel_diff_se);
        writeln!(f, "mean     {difference:+.4} % ± {error:.4} %")?;
        write!(f, "verdict  {}", self.verdict)
    }
}
