//! Does a configuration converge to the reference?
//!
//! The runs of one rung are independent, so the spread of their means tells
//! the error of the mean of all. Two things are tested, each at half of the
//! stated rate of false alarms: the relative difference of the whole picture's
//! mean, and the difference of every block of 8 × 8 pixels (Šidák's correction
//! for their number). Deviations are judged by Student's distribution with
//! Welch's degrees of freedom. Blocks are judged from eight runs on: the errors
//! of few pixels are skewed, and with four runs that makes Student's tails too
//! thin (2 false alarms in 12 tests of renders of a Cornell box). The variance of the reference adds to that of the runs;
//! neighbours under a wide filter share samples, so that its blocks are taken
//! as `overlap` times as uncertain as independent pixels.
//!
//! A reference whose own noise is not known (neither its variance nor the error
//! of its mean) could be off itself: then blocks are not judged, a bias counts
//! from 0.5 % on, and nothing is said to converge.
//!
//! Seeing no difference is not convergence: that is said only when the whole
//! interval of the mean lies within ±0.5 %, so that a larger bias is ruled out.
//! Else the verdict is `Undecided`.

use super::Image;
use super::model::{BiasTest, BiasVerdict, Interval};
use super::statistics::{sidak_level, student_p, student_quantile};
use super::truth::Truth;

/// Width and height of a block.
const BLOCK: usize = 8;
/// Rate of false alarms of the whole test.
const FALSE_POSITIVE_RATE: f64 = 0.01;
/// Runs from which on blocks are judged.
const BLOCK_RUNS: usize = 8;
/// Relative error of the mean that the test must be able to see.
const DECIDES: f64 = 0.005;

/// A mean over runs against what it should be.
struct Deviation {
    /// Difference and its standard error.
    difference: f64,
    error: f64,
    freedom: f64,
}

impl Deviation {
    /// Of values of independent runs from a truth of known variance.
    fn of(values: &[f64], truth: f64, variance: f64, truth_freedom: f64) -> Deviation {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let own = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
        let total = own + variance;
        // Welch 1947.
        let spread = own * own / (n - 1.0) + variance * variance / truth_freedom;
        let freedom = if spread > 0.0 { total * total / spread } else { f64::INFINITY };
        Deviation { difference: mean - truth, error: total.sqrt(), freedom }
    }

    fn t(&self) -> f64 {
        if self.difference == 0.0 { 0.0 } else { self.difference / self.error }
    }

    fn p(&self) -> f64 {
        student_p(self.t(), self.freedom)
    }
}

/// Sums over all finite pixels of a block (or of everything), per run, of the
/// reference and of its variance.
struct Sums {
    runs: Vec<f64>,
    truth: f64,
    variance: f64,
}

fn sums(images: &[Image], truth: &Truth, [x0, y0]: [usize; 2], [w, h]: [usize; 2]) -> Sums {
    let target = truth.colour();
    let (width, height) = (target.mean.width, target.mean.height);
    let mut sums = Sums { runs: vec![0.0; images.len()], truth: 0.0, variance: 0.0 };
    for y in y0..(y0 + h).min(height) {
        for x in x0..(x0 + w).min(width) {
            let at = 3 * (y * width + x)..3 * (y * width + x) + 3;
            let finite = |image: &Image| image.rgb[at.clone()].iter().all(|v| v.is_finite());
            if !finite(&target.mean) || !images.iter().all(finite) {
                continue;
            }
            let sum = |image: &Image| image.rgb[at.clone()].iter().map(|v| f64::from(*v)).sum::<f64>();
            sums.truth += sum(&target.mean);
            sums.runs.iter_mut().zip(images).for_each(|(s, image)| *s += sum(image));
            if let Some(variance) = &target.variance {
                // The channels of a pixel come from the same paths: their
                // standard deviations add up.
                let deviation: f64 = variance.rgb[at].iter().map(|v| f64::from(*v).max(0.0).sqrt()).sum();
                sums.variance += deviation * deviation;
            }
        }
    }
    sums
}

/// Tests the mean of independent runs of one rung against the reference.
/// `None` for fewer than two runs.
#[must_use]
pub fn bias_test(images: &[Image], truth: &Truth, budget: &str) -> Option<BiasTest> {
    if images.len() < 2 {
        return None;
    }
    let (width, height) = (images[0].width, images[0].height);
    let all = sums(images, truth, [0, 0], [width, height]);
    let variance = match truth.mean_error {
        Some(relative) => (relative * all.truth).powi(2),
        None => all.variance * truth.overlap,
    };
    let whole = Deviation::of(&all.runs, all.truth, variance, truth.freedom);
    let corners = (0..height).step_by(BLOCK).flat_map(|y| (0..width).step_by(BLOCK).map(move |x| [x, y]));
    let blocks: Vec<([usize; 2], Deviation)> = corners
        .map(|corner| {
            let s = sums(images, truth, corner, [BLOCK, BLOCK]);
            (corner, Deviation::of(&s.runs, s.truth, s.variance * truth.overlap, truth.freedom))
        })
        .collect();
    let level = sidak_level(0.5 * FALSE_POSITIVE_RATE, blocks.len());
    let (worst_at, worst) = blocks.iter().min_by(|a, b| a.1.p().total_cmp(&b.1.p()))?;
    let half = student_quantile(0.975, whole.freedom) * whole.error;
    let relative = |v: f64| v / all.truth;
    let mean = Interval {
        value: relative(whole.difference),
        low: relative(whole.difference - half),
        high: relative(whole.difference + half),
    };
    // Not only must no bias be seen: one that matters must be ruled out.
    let ruled_out = -DECIDES <= mean.low.min(mean.high) && mean.low.max(mean.high) <= DECIDES;
    let known = truth.colour().variance.is_some();
    let block_off = known && images.len() >= BLOCK_RUNS && worst.p() < level;
    let known = known || truth.mean_error.is_some();
    let counts = known || mean.low > DECIDES || mean.high < -DECIDES;
    let verdict = if whole.p() < 0.5 * FALSE_POSITIVE_RATE && counts || block_off {
        BiasVerdict::Biased
    } else if ruled_out && known {
        BiasVerdict::Converges
    } else {
        BiasVerdict::Undecided
    };
    let percent = |v: f64| format!("{:+.3} %", 100.0 * v);
    let figures = format!("mean {} [{}, {}]", percent(mean.value), percent(mean.low), percent(mean.high));
    let text = match verdict {
        BiasVerdict::Converges => format!("no bias seen at {budget}: {figures}"),
        BiasVerdict::Undecided if !known => {
            format!("undecided at {budget}: {figures}; the reference's own noise is not known")
        }
        BiasVerdict::Undecided => format!(
            "undecided at {budget}: {figures}; an interval within ±{} % is needed to rule out a bias",
            100.0 * DECIDES
        ),
        BiasVerdict::Biased if block_off => format!(
            "differs from the reference at {budget}: {figures}; the block at {}, {} is off by {:.1} standard errors",
            worst_at[0],
            worst_at[1],
            worst.t()
        ),
        BiasVerdict::Biased => format!("differs from the reference at {budget}: {figures}"),
    };
    Some(BiasTest {
        budget: budget.to_owned(),
        mean,
        worst_z: worst.t().abs(),
        worst_at: *worst_at,
        threshold: student_quantile(1.0 - 0.5 * level, worst.freedom),
        false_positive_rate: FALSE_POSITIVE_RATE,
        verdict,
        text,
    })
}
