//! Every figure of one picture, and of the noise of what it is measured
//! against.
//!
//! A reference b = μ + η with noise of known variance σ² adds E[η²] to every
//! squared error: mean σ² to MSE and mean σ²/(b² + 1e-2 m²) to relMSE (the
//! weights of [`super::metrics`]; the effect of η on the weights is of second
//! order). That is subtracted from each run, and is the floor of the curve:
//! below it a figure is the difference of two larger ones, and no number is
//! given. Trimming takes its 0.1 % from the run's own outliers, so that the same
//! is subtracted there. Absolute metrics, PSNR and FLIP are left as they are.
//!
//! Without a reference the other runs take its place: the error of run i of n
//! is x_i − x̄, and Σ(x_i − x̄)²/(n − 1) is the variance of a run, without bias.
//! The n values share x̄, so they scatter less than their mean's error asks for,
//! the more so the heavier the tails of the errors are. They are spread about
//! their mean by what makes up for it at the kurtosis of the errors at hand
//! ([`spread`]), and the intervals hold (tested); two runs give the same value
//! twice, and nothing is said of them.

use super::ledger::Measured;
use super::metrics::{pixel_metrics, relative_square};
use super::model::{Figure, Metric};
use super::truth::{RegionMask, TruthTarget};
use super::{Image, Pair, flip_hdr, flip_ldr, interval};
use crate::desc::Result;

/// Squared errors that the noise of a reference adds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceNoise {
    /// To MSE.
    pub mse: f64,
    /// To relMSE.
    pub rel_mse: f64,
}

impl ReferenceNoise {
    /// Of a whole picture, or of a part of it. Zero where the variance is not
    /// known.
    #[must_use]
    pub fn of(truth: &TruthTarget, inside: Option<&[bool]>) -> ReferenceNoise {
        let Some(variance) = &truth.variance else { return ReferenceNoise::default() };
        let mean = whole_mean(&truth.mean);
        let (mut noise, mut count) = (ReferenceNoise::default(), 0.0);
        for (i, (v, b)) in variance.rgb.iter().zip(&truth.mean.rgb).enumerate() {
            if inside.is_none_or(|inside| inside[i / 3]) && v.is_finite() && b.is_finite() {
                noise.mse += f64::from(*v);
                noise.rel_mse += relative_square(f64::from(*v), f64::from(*b), mean);
                count += 1.0;
            }
        }
        ReferenceNoise { mse: noise.mse / count, rel_mse: noise.rel_mse / count }
    }

    /// What it adds to a metric.
    #[must_use]
    pub fn of_metric(&self, metric: Metric) -> f64 {
        match metric {
            Metric::Mse => self.mse,
            Metric::RelMse | Metric::RelMseTrimmed => self.rel_mse,
            _ => 0.0,
        }
    }
}

/// Mean over all finite values.
fn whole_mean(image: &Image) -> f64 {
    let finite = image.rgb.iter().filter(|v| v.is_finite());
    let (sum, count) = finite.fold((0.0, 0.0), |(s, n), v| (s + f64::from(*v), n + 1.0));
    (sum / count).abs()
}

/// A target in a region, as tables name it.
#[must_use]
pub fn target_in(target: &str, region: &str) -> String {
    format!("{target} in {region}")
}

/// Measures a picture against a reference: the whole picture and each region,
/// every metric, noise of the reference subtracted.
///
/// # Errors
/// Pictures of different size.
pub fn measure(image: &Image, truth: &TruthTarget, regions: &[RegionMask]) -> Result<Vec<Measured>> {
    let pair = Pair::new(image.view()?, truth.mean.view()?)?;
    // FLIP is about pictures that are looked at.
    let flip = (truth.name == "colour").then(|| (flip_ldr(&pair), flip_hdr(&pair).map));
    let mean = whole_mean(&truth.mean);
    let mut all = Vec::new();
    let mut add = |name: String, inside: Option<&[bool]>| {
        let pixels = || (0..image.rgb.len()).filter(|i| inside.is_none_or(|inside| inside[i / 3]));
        let values = pixels().filter_map(|i| {
            let (a, b) = (f64::from(image.rgb[i]), f64::from(truth.mean.rgb[i]));
            (a.is_finite() && b.is_finite()).then_some((a, b))
        });
        let m = pixel_metrics(values.clone(), mean);
        let (sum_a, sum_b) = values.fold((0.0, 0.0), |(x, y), (a, b)| (x + a, y + b));
        let noise = ReferenceNoise::of(truth, inside);
        let mut push = |metric: Metric, value: f64| {
            let value = value - noise.of_metric(metric);
            all.push((name.clone(), metric, value.is_finite().then_some(value)));
        };
        push(Metric::Mse, m.mse);
        push(Metric::RelMse, m.rel_mse);
        push(Metric::RelMseTrimmed, m.rel_mse_trimmed);
        push(Metric::Mape, m.mape);
        push(Metric::Smape, m.smape);
        push(Metric::Psnr, m.psnr);
        if let Some((ldr, hdr)) = &flip {
            push(Metric::FlipLdr, mean_inside(ldr, inside));
            push(Metric::FlipHdr, mean_inside(hdr, inside));
        }
        push(Metric::Bias, (sum_a - sum_b) / sum_b);
    };
    add(truth.name.clone(), None);
    for region in regions {
        add(target_in(&truth.name, &region.name), Some(&region.inside));
    }
    Ok(all)
}

fn mean_inside(map: &[f32], inside: Option<&[bool]>) -> f64 {
    let chosen = map.iter().enumerate().filter(|(i, _)| inside.is_none_or(|inside| inside[*i]));
    let (sum, count) = chosen.fold((0.0, 0.0), |(s, n), (_, v)| (s + f64::from(*v), n + 1.0));
    sum / count
}

/// MSE and relMSE of each of several independent pictures against the mean of
/// all, scaled to be free of bias and spread as independent values would be.
/// Nothing for fewer than three.
#[must_use]
pub fn spread(images: &[Image], name: &str, regions: &[RegionMask]) -> Vec<Vec<Measured>> {
    let n = images.len();
    if n < 3 {
        return vec![Vec::new(); n];
    }
    let mean = mean_of(images);
    let whole = whole_mean(&mean);
    let masks: Vec<(String, Option<&[bool]>)> = std::iter::once((name.to_owned(), None))
        .chain(regions.iter().map(|r| (target_in(name, &r.name), Some(r.inside.as_slice()))))
        .collect();
    let unbiased = n as f64 / (n - 1) as f64;
    let mut all: Vec<Vec<Measured>> = images
        .iter()
        .map(|image| {
            masks
                .iter()
                .flat_map(|(name, inside)| {
                    let values = image.rgb.iter().zip(&mean.rgb).enumerate();
                    let values = values
                        .filter(|(i, _)| inside.is_none_or(|inside| inside[i / 3]))
                        .map(|(_, (a, b))| (f64::from(*a), f64::from(*b)))
                        .filter(|(a, b)| a.is_finite() && b.is_finite());
                    let m = pixel_metrics(values, whole);
                    [
                        (name.clone(), Metric::Mse, Some(unbiased * m.mse)),
                        (name.clone(), Metric::RelMse, Some(unbiased * m.rel_mse)),
                        (name.clone(), Metric::RelMseTrimmed, Some(unbiased * m.rel_mse_trimmed)),
                    ]
                })
                .collect()
        })
        .collect();
    // Three figures of each mask; the trimmed one goes by the untrimmed.
    let widen: Vec<f64> = masks
        .iter()
        .flat_map(|(_, inside)| {
            let [plain, relative] = kurtosis(images, &mean, *inside).map(|k| widening(n as f64, k));
            [plain, relative, relative]
        })
        .collect();
    for (k, widen) in widen.into_iter().enumerate() {
        let center = all.iter().filter_map(|run| run[k].2).sum::<f64>() / n as f64;
        for value in all.iter_mut().filter_map(|run| run[k].2.as_mut()) {
            *value = center + widen * (*value - center);
        }
    }
    all
}

/// E[e²] and E[(Σe/n)²] of the squared deviations e of n independent values
/// from their mean, in squared variances, as (constant, factor of the kurtosis).
fn deviation_moments(n: f64) -> [(f64, f64); 2] {
    let own = (n - 1.0) / n;
    let fourth = own.powi(4) + (n - 1.0) / n.powi(4);
    // Of the variance: Var(s²) = (κ − (n − 3)/(n − 1))/n.
    let square = own * own;
    [(3.0 * (own * own - fourth), fourth), (square * (1.0 - (n - 3.0) / (n * (n - 1.0))), square / n)]
}

/// By how much n figures that share the mean of their pictures must be spread
/// for their scatter to say how well their mean is known: the root of Var(s²)
/// over a n-th of what they scatter. From √((n − 1)/(n − 2)) of normal errors
/// to (n − 1)/(n − 2) where rare large ones rule, as the jackknife has it.
fn widening(n: f64, kurtosis: f64) -> f64 {
    let [square, mean] = deviation_moments(n).map(|(constant, factor)| constant + factor * kurtosis);
    let variance = (kurtosis - (n - 3.0) / (n - 1.0)) / n;
    // E[e e′] from E[(Σe)²] = n E[e²] + n (n − 1) E[e e′].
    let product = (n * mean - square) / (n - 1.0);
    let scatter = square - product;
    (variance * n * ((n - 1.0) / n).powi(2) / scatter).sqrt()
}

/// Kurtosis of the errors of single values, pooled over a picture with the
/// weight that each has in the scatter of MSE and of relMSE; at least that of
/// two values ± σ.
fn kurtosis(images: &[Image], mean: &Image, inside: Option<&[bool]>) -> [f64; 2] {
    let n = images.len() as f64;
    let whole = whole_mean(mean);
    // Sums of mean e² and of (mean e)², plain and relative.
    let mut sums = [[0.0_f64; 2]; 2];
    for (i, b) in mean.rgb.iter().enumerate() {
        let squares = images.iter().map(|image| f64::from(image.rgb[i] - b).powi(2));
        let (first, second) = squares.fold((0.0, 0.0), |(f, s), e| (f + e / n, s + e * e / n));
        if !inside.is_none_or(|inside| inside[i / 3]) || !first.is_finite() {
            continue;
        }
        let relative = relative_square(1.0, f64::from(*b), whole).powi(2);
        for (sum, weight) in sums.iter_mut().zip([1.0, relative]) {
            sum[0] += weight * second;
            sum[1] += weight * first * first;
        }
    }
    let [(a, b), (c, d)] = deviation_moments(n);
    sums.map(|[square, mean]| {
        // square / mean = (a + b κ)/(c + d κ).
        let ratio = square / mean;
        let kurtosis = (ratio * c - a) / (b - ratio * d);
        let most = b <= ratio * d;
        if most { f64::MAX.sqrt() } else { kurtosis.max(1.0) }
    })
    .map(|k| if k.is_finite() { k } else { 3.0 })
}

/// The mean of pictures of one size, in f64 sums.
#[must_use]
pub fn mean_of(images: &[Image]) -> Image {
    let mut sums = vec![0.0_f64; images[0].rgb.len()];
    for image in images {
        sums.iter_mut().zip(&image.rgb).for_each(|(s, v)| *s += f64::from(*v));
    }
    let rgb = sums.iter().map(|s| (s / images.len() as f64) as f32).collect();
    Image { width: images[0].width, height: images[0].height, rgb }
}

/// A figure of several runs: its mean with an interval, and whether the noise
/// `floor` of the reference hides it.
#[must_use]
pub fn figure(target: &str, metric: Metric, runs: Vec<f64>, floor: f64) -> Figure {
    let known: Vec<f64> = runs.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = match metric {
        Metric::Bias | Metric::Psnr => interval::signed_interval(&known),
        _ => interval::mean_interval(&known),
    };
    let limited = floor > 0.0 && mean.value < floor;
    Figure { target: target.to_owned(), metric, mean, runs, floor, limited }
}
