//! How good our own error layer is: how often the true error of a pixel lies
//! within 1, 2, 3 and 1.96 of the standard errors that the picture reports.
//!
//! The truth is the reference with its variance, or without one (and for a
//! configuration that does not compute what the reference shows) the mean of
//! the other runs, which is taken to have 1/(n − 1) of a run's reported
//! variance. The variance of the truth is added to the reported one, so that a
//! perfect layer covers 68.3, 95.4, 99.7 and 95 %.

use super::Image;
use super::figures::mean_of;
use super::interval::signed_interval;
use super::model::{Calibration, Coverage, Interval};
use super::truth::Truth;

/// Coverage of ±1.96 under which a layer is called optimistic.
const LEAST: f64 = 0.90;
/// … and over which it is called conservative.
const MOST: f64 = 0.995;
/// Rungs with fewer samples are shown but not judged: two halves of a handful
/// of samples say little.
const JUDGED: f64 = 16.0;
/// Points of the curve, a quarter of a standard error apart.
const CURVE: usize = 17;

/// A picture with its error layer.
pub struct WithError {
    /// The picture.
    pub image: Image,
    /// Its reported standard errors.
    pub error: Image,
}

/// Standardised errors of one run, and sums for the ratio.
struct Standardised {
    z: Vec<f64>,
    /// Σ d², Σ of the truth's variance, Σ of the reported variance.
    difference_square: f64,
    truth_square: f64,
    reported_square: f64,
}

fn standardised(run: &WithError, truth: &Image, variance: impl Fn(usize, f64) -> f64) -> Standardised {
    let mut all = Standardised {
        z: Vec::with_capacity(truth.rgb.len()),
        difference_square: 0.0,
        truth_square: 0.0,
        reported_square: 0.0,
    };
    let values = run.image.rgb.iter().zip(&run.error.rgb).zip(&truth.rgb).enumerate();
    for (i, ((value, error), truth)) in values {
        let (difference, reported) = (f64::from(*value) - f64::from(*truth), f64::from(*error).powi(2));
        if !difference.is_finite() || !reported.is_finite() {
            continue;
        }
        let more = variance(i, reported);
        all.difference_square += difference * difference;
        all.truth_square += more;
        all.reported_square += reported;
        // A pixel without noise that is right is covered.
        let z = if difference == 0.0 { 0.0 } else { difference.abs() / (reported + more).sqrt() };
        all.z.push(z);
    }
    all
}

/// Coverage at one rung; `None` without a truth or without pictures.
#[must_use]
pub fn coverage(
    runs: &[WithError],
    truth: Option<&Truth>,
    budget: &str,
    samples_per_pixel: f64,
) -> Option<Coverage> {
    let n = runs.len();
    let all: Vec<Standardised> = match truth {
        Some(truth) => {
            let target = truth.colour();
            let of = |i: usize, _: f64| target.variance.as_ref().map_or(0.0, |v| f64::from(v.rgb[i]));
            runs.iter().map(|run| standardised(run, &target.mean, of)).collect()
        }
        None if n >= 2 => (0..n)
            .map(|i| {
                let others: Vec<Image> =
                    runs.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, r)| r.image.clone()).collect();
                let share = 1.0 / (n - 1) as f64;
                standardised(&runs[i], &mean_of(&others), |_, reported| share * reported)
            })
            .collect(),
        None => return None,
    };
    if all.is_empty() || all.iter().any(|s| s.z.is_empty()) {
        return None;
    }
    let within = |k: f64| -> Interval {
        let parts: Vec<f64> =
            all.iter().map(|s| s.z.iter().filter(|z| **z <= k).count() as f64 / s.z.len() as f64).collect();
        signed_interval(&parts)
    };
    let sum = |f: fn(&Standardised) -> f64| all.iter().map(f).sum::<f64>();
    // The variance of a reference is known by itself. That of the other runs' mean
    // is as wrong as what they report: it belongs to what is judged.
    let [d, v, e] = [sum(|s| s.difference_square), sum(|s| s.truth_square), sum(|s| s.reported_square)];
    let ratio = if truth.is_some() { (d - v).max(0.0) / e } else { d / (e + v) };
    Some(Coverage {
        budget: budget.to_owned(),
        samples_per_pixel,
        within: [within(1.0), within(2.0), within(3.0)],
        within_95: within(1.96),
        ratio: ratio.sqrt(),
        curve: (0..CURVE).map(|i| 0.25 * i as f64).map(|k| [k, within(k).value]).collect(),
    })
}

/// All rungs and a sentence; `None` without rungs.
#[must_use]
pub fn calibration(rungs: Vec<Coverage>) -> Option<Calibration> {
    if rungs.is_empty() {
        return None;
    }
    let judged: Vec<&Coverage> = rungs.iter().filter(|r| r.samples_per_pixel >= JUDGED).collect();
    let percent = |r: &Coverage| format!("{:.1} % at {}", 100.0 * r.within_95.value, r.budget);
    let low = judged.iter().min_by(|a, b| a.within_95.value.total_cmp(&b.within_95.value));
    let high = judged.iter().max_by(|a, b| a.within_95.value.total_cmp(&b.within_95.value));
    let verdict = match (low, high) {
        (Some(low), _) if low.within_95.value < LEAST => format!(
            "optimistic: ±1.96 reported standard errors hold the truth in {} (95 % expected); fireflies that few \
             runs have seen are the usual cause",
            percent(low)
        ),
        (_, Some(high)) if high.within_95.value > MOST => format!(
            "conservative: ±1.96 reported standard errors hold the truth in {} (95 % expected)",
            percent(high)
        ),
        (Some(low), Some(high)) => format!(
            "good: ±1.96 reported standard errors hold the truth in {} to {} (95 % expected)",
            percent(low),
            percent(high)
        ),
        _ => format!("not judged: no rung has {JUDGED} samples per pixel"),
    };
    Some(Calibration { rungs, verdict })
}
