//! What the noise looks like: its spectrum, its tails, its correlation.
//!
//! The noise of a run is its difference from the mean of all runs, scaled by
//! √(n/(n − 1)), relative to that mean as in relMSE, averaged over R, G and B:
//! a bias that all runs share is no noise.
//!
//! - *Spectrum*: |DFT|² averaged over directions and runs; frequencies in
//!   cycles per pixel up to ½ (the corners beyond are left out), in units of its
//!   mean over all frequencies but zero, so that white noise is 1. It is called
//!   blue (red) if the power below ⅛ is under 0.8 (over 1.25) times that above
//!   ⅜ and the interval over the runs does not contain 1. A reconstruction
//!   filter wider than a box makes noise red: neighbours share samples.
//! - *Tail index*: Hill's estimate from the largest 0.5 % of |error| (Hill 1975;
//!   asymptotic interval ±1.96/√k relative). Moments of order up to the index
//!   exist: under 2 there is no variance, and no squared error converges.
//! - *Correlation* of the errors of pixels some columns or rows apart.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::Image;
use super::figures::mean_of;
use super::interval::{Group, Scale, exp, interval_of};
use super::model::{Interval, Noise};

/// Rings of the spectrum.
const RINGS: usize = 16;
/// Lags of the correlation.
const LAGS: usize = 8;
/// Part of the values that the tail index is found from.
const TAIL: f64 = 0.005;
/// Least number of values for it.
const TAIL_LEAST: usize = 20;
/// Part of the values called the worst.
const WORST: f64 = 1e-3;
/// Edges of the histogram: 2^-6 to 2^6 root mean squares.
const EDGES: std::ops::RangeInclusive<i32> = -6..=6;

/// The noise of one run, row by row.
struct Field {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

/// Power by ring, of one run: sums and counts.
struct Power {
    rings: [f64; RINGS],
    counts: [f64; RINGS],
    total: f64,
}

/// Studies the runs of one rung; `None` for fewer than two.
#[must_use]
pub fn noise(images: &[Image], budget: &str) -> Option<Noise> {
    let n = images.len();
    if n < 2 {
        return None;
    }
    let fields = fields(images);
    let powers: Vec<Power> = fields.iter().map(power).collect();
    let mut magnitudes: Vec<f64> = fields.iter().flat_map(|f| f.values.iter().map(|v| v.abs())).collect();
    magnitudes.sort_unstable_by(|a, b| b.total_cmp(a));
    let squares: f64 = magnitudes.iter().map(|v| v * v).sum();
    let worst = ((magnitudes.len() as f64 * WORST).ceil() as usize).max(1);
    Some(Noise {
        budget: budget.to_owned(),
        spectrum: spectrum(&powers),
        colour: colour(&powers),
        histogram: histogram(&magnitudes, (squares / magnitudes.len() as f64).sqrt()),
        tail_index: tail_index(&magnitudes),
        worst_share: magnitudes[..worst].iter().map(|v| v * v).sum::<f64>() / squares,
        correlation: (1..=LAGS).map(|lag| correlation(&fields, lag)).collect(),
    })
}

/// Relative differences from the mean of all runs.
fn fields(images: &[Image]) -> Vec<Field> {
    let mean = mean_of(images);
    let finite = mean.rgb.iter().filter(|v| v.is_finite());
    let (sum, count) = finite.fold((0.0, 0.0), |(s, n), v| (s + f64::from(*v), n + 1.0));
    let floor = 1e-2 * (sum / count).powi(2);
    let n = images.len() as f64;
    let scale = (n / (n - 1.0)).sqrt() / 3.0;
    let field = |image: &Image| {
        let pixels = image.rgb.chunks_exact(3).zip(mean.rgb.chunks_exact(3));
        let values = pixels
            .map(|(p, m)| {
                let term = |(a, b): (&f32, &f32)| {
                    let (a, b) = (f64::from(*a), f64::from(*b));
                    let relative = (a - b) / (b * b + floor).sqrt();
                    if relative.is_finite() { relative } else { 0.0 }
                };
                scale * p.iter().zip(m).map(term).sum::<f64>()
            })
            .collect();
        Field { width: image.width, height: image.height, values }
    };
    images.iter().map(field).collect()
}

/// |DFT|² of a field by ring.
fn power(field: &Field) -> Power {
    let (width, height) = (field.width, field.height);
    let mut planner = FftPlanner::<f64>::new();
    let mut rows: Vec<Complex<f64>> = field.values.iter().map(|v| Complex::new(*v, 0.0)).collect();
    planner.plan_fft_forward(width).process(&mut rows);
    let mut columns: Vec<Complex<f64>> =
        (0..width * height).map(|i| rows[(i % height) * width + i / height]).collect();
    planner.plan_fft_forward(height).process(&mut columns);
    let mut power = Power { rings: [0.0; RINGS], counts: [0.0; RINGS], total: 0.0 };
    let cycles = |k: usize, n: usize| k.min(n - k) as f64 / n as f64;
    for (i, value) in columns.iter().enumerate().skip(1) {
        let frequency = cycles(i / height, width).hypot(cycles(i % height, height));
        power.total += value.norm_sqr() / (columns.len() - 1) as f64;
        let ring = (frequency * 2.0 * RINGS as f64) as usize;
        if ring < RINGS {
            power.rings[ring] += value.norm_sqr();
            power.counts[ring] += 1.0;
        }
    }
    power
}

fn spectrum(powers: &[Power]) -> Vec<[f64; 2]> {
    let total: f64 = powers.iter().map(|p| p.total).sum::<f64>() / powers.len() as f64;
    (0..RINGS)
        .filter_map(|ring| {
            let sum: f64 = powers.iter().map(|p| p.rings[ring]).sum();
            let count: f64 = powers.iter().map(|p| p.counts[ring]).sum();
            let frequency = (ring as f64 + 0.5) / (2.0 * RINGS as f64);
            (count > 0.0 && total > 0.0).then(|| [frequency, sum / count / total])
        })
        .collect()
}

/// White, blue or red, with the ratio of low to high frequencies.
fn colour(powers: &[Power]) -> String {
    let band = |p: &Power, rings: std::ops::Range<usize>| {
        p.rings[rings.clone()].iter().sum::<f64>() / p.counts[rings].iter().sum::<f64>()
    };
    let runs = powers.iter().map(|p| vec![band(p, 0..RINGS / 4), band(p, 3 * RINGS / 4..RINGS)]).collect();
    let ratio = exp(interval_of(&[Group { runs }], Scale::Log, &|m| m[0] - m[1]));
    if !ratio.value.is_finite() {
        return "no noise".to_owned();
    }
    let word = if ratio.high < 1.0 && ratio.value < 0.8 {
        "blue"
    } else if ratio.low > 1.0 && ratio.value > 1.25 {
        "red"
    } else {
        "white"
    };
    format!("{word}: {:.2} times as much power at low as at high frequencies", ratio.value)
}

fn histogram(magnitudes: &[f64], rms: f64) -> Vec<[f64; 2]> {
    let mut below = 0.0;
    let mut bins: Vec<[f64; 2]> = EDGES
        .map(|e| {
            let edge = 2f64.powi(e);
            let part =
                magnitudes.iter().filter(|v| **v <= edge * rms).count() as f64 / magnitudes.len() as f64;
            let bin = [edge, part - below];
            below = part;
            bin
        })
        .collect();
    if let Some(last) = bins.last_mut() {
        // What lies beyond the last edge counts there.
        last[1] += 1.0 - below;
    }
    bins
}

/// Hill 1975 from values sorted downwards.
fn tail_index(magnitudes: &[f64]) -> Interval {
    let k = ((magnitudes.len() as f64 * TAIL) as usize).max(TAIL_LEAST);
    let unknown = Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    let Some(limit) = magnitudes.get(k).copied().filter(|v| *v > 0.0) else { return unknown };
    let mean = magnitudes[..k].iter().map(|v| (v / limit).ln()).sum::<f64>() / k as f64;
    if mean <= 0.0 {
        return unknown;
    }
    let half = 1.96 / (k as f64).sqrt();
    Interval { value: 1.0 / mean, low: (1.0 - half) / mean, high: (1.0 + half) / mean }
}

/// Of values `lag` columns or rows apart, over all runs.
fn correlation(fields: &[Field], lag: usize) -> f64 {
    let (mut products, mut count, mut squares, mut all) = (0.0, 0.0, 0.0, 0.0);
    for field in fields {
        let at = |x: usize, y: usize| field.values[y * field.width + x];
        for y in 0..field.height {
            for x in 0..field.width {
                squares += at(x, y).powi(2);
                all += 1.0;
                if x + lag < field.width {
                    products += at(x, y) * at(x + lag, y);
                    count += 1.0;
                }
                if y + lag < field.height {
                    products += at(x, y) * at(x, y + lag);
                    count += 1.0;
                }
            }
        }
    }
    (products / count) / (squares / all)
}
