//! The statistics of studies on pictures whose errors are known: intervals
//! cover the truth as often as they say, equal configurations are called equal,
//! planted biases are found, and nothing else is.
//!
//! Where 1,000 trials are asked to cover 95 ± 2 %, chance alone puts a perfect
//! method outside once in 270 (standard deviation 0.69 %). Seeds are fixed.

use std::f64::consts::TAU;

use etendue::study::Image;
use etendue::study::bias::bias_test;
use etendue::study::conclude::{compare, efficiency, fits, time_to};
use etendue::study::coverage::{WithError, calibration, coverage};
use etendue::study::figures::{figure, measure, spread};
use etendue::study::interval::mean_interval;
use etendue::study::model::{BiasVerdict, ConfigurationStudy, Cost, Interval, Metric, Preference, Rung};
use etendue::study::noise::noise;
use etendue::study::truth::{RegionMask, Truth, TruthTarget};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

const TRIALS: u64 = 1000;
/// Percent of trials that must cover.
const RANGE: std::ops::RangeInclusive<f64> = 93.0..=97.0;

/// What the errors of a picture look like; all have variance 1 and mean 0.
#[derive(Clone, Copy, Debug)]
enum Errors {
    /// Normal.
    Normal,
    /// exp of a normal variable: skewed, with a kurtosis of 37.
    HeavyTailed,
    /// Normal, blurred over 3 × 3 pixels.
    Correlated,
}

const KINDS: [Errors; 3] = [Errors::Normal, Errors::HeavyTailed, Errors::Correlated];

fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
}

impl Errors {
    /// One error for each value of a picture of `width` × `height`.
    fn draw(self, rng: &mut Pcg64Mcg, width: usize, height: usize) -> Vec<f64> {
        let independent: Vec<f64> = (0..3 * width * height)
            .map(|_| match self {
                Errors::HeavyTailed => {
                    const SIGMA: f64 = 0.8;
                    let variance = (SIGMA * SIGMA).exp() * ((SIGMA * SIGMA).exp() - 1.0);
                    ((SIGMA * normal(rng)).exp() - (0.5 * SIGMA * SIGMA).exp()) / variance.sqrt()
                }
                _ => normal(rng),
            })
            .collect();
        if !matches!(self, Errors::Correlated) {
            return independent;
        }
        let at = |x: usize, y: usize, c: usize| independent[3 * ((y % height) * width + x % width) + c];
        (0..independent.len())
            .map(|i| {
                let (x, y, c) = (i / 3 % width, i / 3 / width, i % 3);
                (0..9).map(|k| at(x + k % 3, y + k / 3, c)).sum::<f64>() / 3.0
            })
            .collect()
    }
}

const SIZE: usize = 16;

/// A picture of values from 0.3 to 2, dark to the left.
fn scene() -> Image {
    let rgb = (0..3 * SIZE * SIZE)
        .map(|i| 0.3 + 1.7 * ((i / 3 % SIZE) as f32 / (SIZE - 1) as f32) * (1.0 - 0.2 * (i % 3) as f32))
        .collect();
    Image { width: SIZE, height: SIZE, rgb }
}

/// The scene with noise of standard deviation `deviation` × value, all of it
/// `factor` times as bright.
fn render(kind: Errors, deviation: f64, factor: f64, rng: &mut Pcg64Mcg) -> Image {
    let mut image = scene();
    let errors = kind.draw(rng, SIZE, SIZE);
    for (v, e) in image.rgb.iter_mut().zip(errors) {
        *v = (factor * f64::from(*v) * (1.0 + deviation * e)) as f32;
    }
    image
}

fn truth(variance: Option<Image>) -> Truth {
    // Not called colour: FLIP takes its time and is tested elsewhere.
    let target = TruthTarget { name: "synthetic".to_owned(), mean: scene(), variance };
    Truth {
        file: "synthetic".to_owned(),
        targets: vec![target],
        variance_from: None,
        provenance: Vec::new(),
        freedom: f64::INFINITY,
        overlap: 1.0,
        mean_error: None,
    }
}

/// The variance of a reference that is exact.
fn exact() -> Option<Image> {
    Some(Image { rgb: vec![0.0; 3 * SIZE * SIZE], ..scene() })
}

/// MSE and relMSE of noise of unit deviation × value.
fn unit_errors() -> [f64; 2] {
    let image = scene();
    let values: Vec<f64> = image.rgb.iter().map(|v| f64::from(*v)).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let mse = values.iter().map(|v| v * v).sum::<f64>() / n;
    let relative = values.iter().map(|v| v * v / (v * v + 1e-2 * mean * mean)).sum::<f64>() / n;
    [mse, relative]
}

fn value(measured: &[(String, Metric, Option<f64>)], metric: Metric) -> f64 {
    measured.iter().find(|m| m.1 == metric).and_then(|m| m.2).expect("a value")
}

/// Percent of the trials in which each of some things holds.
fn percents<const N: usize>(trial: impl Fn(&mut Pcg64Mcg) -> [bool; N] + Sync) -> [f64; N] {
    let held = (0..TRIALS).into_par_iter().map(|seed| trial(&mut Pcg64Mcg::seed_from_u64(77 + seed)));
    let held = held.map(|held| held.map(usize::from));
    let counts = held.reduce(|| [0; N], |a, b| std::array::from_fn(|k| a[k] + b[k]));
    counts.map(|n| 100.0 * n as f64 / TRIALS as f64)
}

fn holds(interval: &Interval, truth: f64) -> bool {
    interval.low <= truth && truth <= interval.high
}

#[test]
fn intervals_of_errors_cover_the_truth() {
    let truth = truth(None);
    let unit = unit_errors();
    for kind in KINDS {
        for runs in [8, 16] {
            let metrics = [Metric::Mse, Metric::RelMse];
            let covered = percents(|rng| {
                let pictures: Vec<_> = (0..runs)
                    .map(|_| measure(&render(kind, 0.1, 1.0, rng), truth.colour(), &[]).expect("measured"))
                    .collect();
                [0, 1].map(|k| {
                    let values = pictures.iter().map(|m| value(m, metrics[k])).collect();
                    holds(&figure("synthetic", metrics[k], values, 0.0).mean, 0.01 * unit[k])
                })
            });
            println!("{kind:?} errors, {runs} runs: {covered:?} % of the intervals of MSE, relMSE cover");
            assert!(covered.iter().all(|c| RANGE.contains(c)), "{kind:?} {runs}: {covered:?} %");
        }
    }
}

/// With few runs the interval leans to the safe side, never to the other.
#[test]
fn four_runs_are_enough_for_an_honest_interval() {
    for kind in KINDS {
        let [covered] = percents(|rng| {
            let values: Vec<f64> = (0..4)
                .map(|_| {
                    let errors = kind.draw(rng, SIZE, SIZE);
                    errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64
                })
                .collect();
            [holds(&mean_interval(&values), 1.0)]
        });
        println!("{kind:?} errors, 4 runs: {covered:.1} % of intervals cover");
        assert!(covered >= 93.0, "{kind:?}: {covered} %");
    }
}

#[test]
fn the_noise_of_a_reference_is_subtracted() {
    // A reference with a ninth of the pictures' squared error.
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let unit = unit_errors()[1];
    let mut means = Vec::new();
    for _ in 0..200 {
        let mut truth = truth(None);
        let clean = scene();
        truth.targets[0].mean = render(Errors::Normal, 0.03, 1.0, &mut rng);
        let variance = clean.rgb.iter().map(|v| (0.03 * v).powi(2)).collect();
        truth.targets[0].variance = Some(Image { rgb: variance, ..clean });
        let image = render(Errors::Normal, 0.09, 1.0, &mut rng);
        means.push(value(&measure(&image, truth.colour(), &[]).expect("measured"), Metric::RelMse));
        let noise = etendue::study::figures::ReferenceNoise::of(truth.colour(), None).rel_mse;
        assert!((noise / (9e-4 * unit) - 1.0).abs() < 0.02, "{noise}");
        assert!(!figure("synthetic", Metric::RelMse, means.clone(), noise).limited);
        // A tenth of that error would be within the noise of this reference.
        let small = means.iter().map(|v| 0.1 * v).collect();
        assert!(figure("synthetic", Metric::RelMse, small, noise).limited);
    }
    let mean = means.iter().sum::<f64>() / 200.0;
    // Noise in the weights is of second order: some 0.8 % here.
    assert!((mean / (8.1e-3 * unit) - 1.0).abs() < 0.02, "{mean} for {}", 8.1e-3 * unit);
}

#[test]
fn without_a_reference_the_spread_is_the_error() {
    let mut rng = Pcg64Mcg::seed_from_u64(6);
    let unit = unit_errors();
    let left =
        RegionMask { name: "left".to_owned(), inside: (0..SIZE * SIZE).map(|i| i % SIZE < 4).collect() };
    let mut sums = [0.0; 3];
    for _ in 0..100 {
        let images: Vec<Image> = (0..3).map(|_| render(Errors::Normal, 0.1, 1.3, &mut rng)).collect();
        for run in spread(&images, "colour", std::slice::from_ref(&left)) {
            assert_eq!(run.len(), 6);
            sums[0] += value(&run, Metric::Mse) / 300.0;
            sums[1] += value(&run, Metric::RelMse) / 300.0;
            let inside = run.iter().find(|m| m.0 == "colour in left" && m.1 == Metric::Mse);
            sums[2] += inside.and_then(|m| m.2).expect("a region") / 300.0;
        }
    }
    assert!((sums[0] / (0.0169 * unit[0]) - 1.0).abs() < 0.02, "{}", sums[0]);
    assert!((sums[1] / (0.01 * unit[1]) - 1.0).abs() < 0.02, "{}", sums[1]);
    assert!(sums[2] < 0.5 * sums[0], "the left is darker");
    assert!(spread(&[scene(), scene()], "colour", &[])[0].is_empty());
    for (kind, runs) in [
        (Errors::Normal, 4),
        (Errors::Normal, 6),
        (Errors::Normal, 8),
        (Errors::Normal, 16),
        (Errors::HeavyTailed, 4),
        (Errors::HeavyTailed, 6),
        (Errors::HeavyTailed, 8),
        (Errors::HeavyTailed, 16),
    ] {
        let [covered] = percents(|rng| {
            let images: Vec<Image> = (0..runs).map(|_| render(kind, 0.1, 1.0, rng)).collect();
            let values = spread(&images, "colour", &[]).iter().map(|m| value(m, Metric::Mse)).collect();
            [holds(&figure("colour", Metric::Mse, values, 0.0).mean, 0.01 * unit[0])]
        });
        println!("{kind:?} errors, {runs} runs, no reference: {covered:.1} % of intervals cover");
        assert!(RANGE.contains(&covered), "{kind:?} {runs}: {covered} %");
    }
}

#[test]
fn a_reference_of_unknown_noise_decides_little() {
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let mut verdict = |factor: f64| {
        let images: Vec<Image> = (0..8).map(|_| render(Errors::Normal, 0.02, factor, &mut rng)).collect();
        bias_test(&images, &truth(None), "8 spp").expect("a test").verdict
    };
    assert_eq!(verdict(1.0), BiasVerdict::Undecided);
    assert_eq!(verdict(1.003), BiasVerdict::Undecided);
    assert_eq!(verdict(1.02), BiasVerdict::Biased);
}

/// A rung of `runs` runs at `samples`: relMSE `error` ÷ samples with the
/// scatter of real pictures, CPU seconds with 3 % of jitter.
fn rung(kind: Errors, samples: f64, error: f64, runs: usize, rng: &mut Pcg64Mcg) -> Rung {
    let errors = (0..runs).map(|_| {
        let drawn = kind.draw(rng, SIZE, SIZE);
        error / samples * drawn.iter().map(|e| e * e).sum::<f64>() / drawn.len() as f64
    });
    let errors: Vec<f64> = errors.collect();
    let seconds: Vec<f64> = (0..runs).map(|_| 0.01 * samples * (1.0 + 0.03 * normal(rng))).collect();
    let figures = vec![figure("colour", Metric::RelMse, errors, 0.0)];
    let unknown = Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    Rung {
        budget: format!("{samples} spp"),
        samples_per_pixel: samples,
        cpu: mean_interval(&seconds),
        wall: mean_interval(&seconds),
        wall_seconds: seconds.clone(),
        cpu_seconds: seconds,
        reported_error: f64::NAN,
        figures,
        efficiency: unknown,
    }
}

fn configuration(name: &str, rungs: Vec<Rung>) -> ConfigurationStudy {
    ConfigurationStudy {
        name: name.to_owned(),
        settings: Vec::new(),
        external: false,
        biased_by_design: None,
        fits: Vec::new(),
        time_to: Vec::new(),
        rungs,
        bias: None,
        noise: None,
        calibration: None,
    }
}

fn curve(kind: Errors, error: f64, runs: usize, rng: &mut Pcg64Mcg) -> Vec<Rung> {
    [16.0, 64.0, 256.0].map(|samples| rung(kind, samples, error, runs, rng)).into()
}

#[test]
fn slopes_efficiencies_and_times_cover_the_truth() {
    for kind in KINDS {
        let [slopes, efficiencies, times] = percents(|rng| {
            let rungs = curve(kind, 0.1, 8, rng);
            let fits = fits(&rungs);
            let fit = fits.iter().find(|f| f.against == Cost::Cpu).expect("a fit");
            // relMSE 1e-4 is reached after 1000 samples, beyond the last rung: 10 s.
            let times = time_to(&rungs);
            assert!(times[0].extrapolated && times[0].error == 0.01);
            [holds(&fit.slope, -1.0), holds(&efficiency(&rungs[1]), 1000.0), holds(&times[0].cpu, 10.0)]
        });
        println!("{kind:?}: slope {slopes:.1} %, efficiency {efficiencies:.1} %, time to 1 % {times:.1} %");
        for covered in [slopes, efficiencies, times] {
            assert!(RANGE.contains(&covered), "{kind:?}: {covered} %");
        }
    }
}

#[test]
fn equal_configurations_are_called_equal_and_others_are_not() {
    for kind in KINDS {
        // Equal ones, and a factor of 1.5.
        let [equal, covered] = percents(|rng| {
            let [a, b, c] = [0.1, 0.1, 0.15].map(|error| configuration("c", curve(kind, error, 8, rng)));
            let equal = compare(&a, &b).verdict == Preference::NoDifference;
            let comparison = compare(&c, &a);
            assert!(comparison.equal_time.len() > 3 && !comparison.equal_error.is_empty());
            [equal, holds(&comparison.overall, 1.5)]
        });
        println!("{kind:?}: {equal:.1} % of equal configurations are called equal");
        assert!(equal >= *RANGE.start(), "{kind:?}: {equal} %");
        println!("{kind:?}: {covered:.1} % of intervals hold a speed-up of 1.5");
        assert!(RANGE.contains(&covered), "{kind:?}: {covered} %");
    }
    let rng = &mut Pcg64Mcg::seed_from_u64(1);
    let [a, b] = [0.15, 0.1].map(|error| configuration("c", curve(Errors::Normal, error, 8, rng)));
    let there = compare(&a, &b);
    assert_eq!((there.verdict, compare(&b, &a).verdict), (Preference::Better, Preference::Worse));
    for level in there.equal_time.iter().chain(&there.equal_error) {
        assert!((1.2..1.9).contains(&level.speedup.value), "{level:?}");
    }
    let mut other = configuration("direct", curve(Errors::Normal, 0.1, 8, rng));
    other.biased_by_design = Some("direct light only".to_owned());
    assert_eq!(compare(&a, &other).verdict, Preference::NotComparable);
    // One run says nothing of its scatter.
    let single = [0, 1].map(|_| configuration("c", curve(Errors::Normal, 0.1, 1, rng)));
    assert_eq!(compare(&single[0], &single[1]).verdict, Preference::NoDifference);
    assert_eq!(compare(&single[0], &single[1]).overall.high, f64::INFINITY);
}

#[test]
fn stalled_curves_are_called_stalled() {
    let rng = &mut Pcg64Mcg::seed_from_u64(2);
    let verdict = |error: &dyn Fn(f64) -> f64, rng: &mut Pcg64Mcg| {
        let rungs: Vec<Rung> = [4.0, 16.0, 64.0, 256.0, 1024.0]
            .map(|samples| rung(Errors::Normal, samples, samples * error(samples), 8, rng))
            .into();
        fits(&rungs).into_iter().find(|f| f.against == Cost::Samples).expect("a fit").verdict
    };
    assert!(verdict(&|n| 1.0 / n, rng).contains("at the rate"));
    assert!(verdict(&|n| n.powf(-1.4), rng).contains("faster"));
    assert!(verdict(&|n| n.powf(-0.6), rng).contains("more slowly"));
    assert!(verdict(&|n| 1.0 / n + 0.05, rng).contains("stalled"));
}

#[test]
fn a_planted_bias_is_found_and_no_other() {
    let truth = truth(exact());
    for kind in KINDS {
        // 768 values of 5 % noise, 8 runs: the mean is known to some 0.1 %.
        let verdict = |rng: &mut Pcg64Mcg, factor: f64| {
            let images: Vec<Image> = (0..8).map(|_| render(kind, 0.05, factor, rng)).collect();
            bias_test(&images, &truth, "8 spp").expect("a test").verdict
        };
        let [alarms, undecided] = percents(|rng| {
            let verdict = verdict(rng, 1.0);
            [verdict == BiasVerdict::Biased, verdict == BiasVerdict::Undecided]
        });
        println!("{kind:?}: {alarms:.1} % false alarms (stated: 1 %), {undecided:.1} % undecided");
        // 1 % + 3 standard deviations of 1,000 trials.
        assert!(alarms <= 1.95, "{kind:?}: {alarms} % false alarms");
        // The mean of correlated noise is known three times worse: 0.5 % is not
        // always seen, but then never called convergence.
        let [missed, found] = percents(|rng| {
            let verdict = verdict(rng, 1.005);
            [verdict == BiasVerdict::Converges, verdict == BiasVerdict::Biased]
        });
        println!("{kind:?}: a bias of 0.5 % is found in {found:.1} %, called convergence in {missed:.1} %");
        if !matches!(kind, Errors::Correlated) {
            assert!(found >= 90.0, "{kind:?}: {found} %");
        }
        assert!(missed <= 5.0, "{kind:?}: {missed} %");
    }
}

#[test]
fn a_local_bias_is_found_by_its_block() {
    let truth = truth(exact());
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut images: Vec<Image> = (0..8).map(|_| render(Errors::Normal, 0.02, 1.0, &mut rng)).collect();
    for image in &mut images {
        for y in 8..16 {
            for x in 0..8 {
                for c in 0..3 {
                    image.rgb[3 * (y * SIZE + x) + c] *= 1.02;
                }
            }
        }
    }
    let test = bias_test(&images, &truth, "8 spp").expect("a test");
    assert_eq!((test.verdict, test.worst_at), (BiasVerdict::Biased, [0, 8]));
    assert!(test.worst_z > test.threshold);
    assert!(bias_test(&images[..1], &truth, "8 spp").is_none());
}

#[test]
fn a_perfect_error_layer_covers_what_it_should() {
    let truth = truth(None);
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut runs = |factor: f32| -> Vec<WithError> {
        (0..16)
            .map(|_| {
                let image = render(Errors::Normal, 0.1, 1.0, &mut rng);
                let error = Image { rgb: scene().rgb.iter().map(|v| factor * 0.1 * v).collect(), ..scene() };
                WithError { image, error }
            })
            .collect()
    };
    let perfect = runs(1.0);
    for truth in [Some(&truth), None] {
        let found = coverage(&perfect, truth, "64 spp", 64.0).expect("coverage");
        let expected = [0.6827, 0.9545, 0.9973];
        for (interval, expected) in found.within.iter().zip(expected) {
            assert!((interval.value - expected).abs() < 0.012, "{interval:?} for {expected}");
        }
        assert!((found.within_95.value - 0.95).abs() < 0.01, "{:?}", found.within_95);
        assert!((found.ratio - 1.0).abs() < 0.02, "{}", found.ratio);
        let twice = coverage(&runs(2.0), truth, "64 spp", 64.0).expect("coverage");
        assert!((twice.ratio - 0.5).abs() < 0.01, "{}", twice.ratio);
        assert_eq!(found.curve.len(), 17);
        let verdict = calibration(vec![found]).expect("a calibration").verdict;
        assert!(verdict.starts_with("good"), "{verdict}");
    }
    let says = |factor: f32, runs: &mut dyn FnMut(f32) -> Vec<WithError>| {
        let found = coverage(&runs(factor), Some(&truth), "64 spp", 64.0).expect("coverage");
        calibration(vec![found]).expect("a calibration").verdict
    };
    assert!(says(0.5, &mut runs).starts_with("optimistic"));
    assert!(says(3.0, &mut runs).starts_with("conservative"));
}

/// A constant picture with a field of noise on it.
fn field(width: usize, height: usize, noise: impl Fn(usize, usize) -> f64) -> Image {
    let rgb =
        (0..width * height).flat_map(|i| [(1.0 + 0.01 * noise(i % width, i / width)) as f32; 3]).collect();
    Image { width, height, rgb }
}

#[test]
fn spectra_show_the_colour_of_noise() {
    let (width, height) = (48, 33);
    let study = |filter: &[(i64, i64, f64)]| {
        let images: Vec<Image> = (0..8)
            .map(|seed| {
                let mut rng = Pcg64Mcg::seed_from_u64(seed);
                let white: Vec<f64> = (0..width * height).map(|_| normal(&mut rng)).collect();
                let wrap = |v: i64, n: usize| v.rem_euclid(n as i64) as usize;
                field(width, height, |x, y| {
                    let at = |dx, dy| white[wrap(y as i64 + dy, height) * width + wrap(x as i64 + dx, width)];
                    filter.iter().map(|(dx, dy, w)| w * at(*dx, *dy)).sum()
                })
            })
            .collect();
        noise(&images, "8 spp").expect("a study of noise")
    };
    let white = study(&[(0, 0, 1.0)]);
    assert!(white.colour.starts_with("white"), "{}", white.colour);
    assert!(white.spectrum.iter().all(|p| (0.7..1.4).contains(&p[1])), "{:?}", white.spectrum);
    assert!(white.correlation.iter().all(|r| r.abs() < 0.03), "{:?}", white.correlation);
    let cross = [(1, 0), (-1, 0), (0, 1), (0, -1)];
    let around = |weight: f64| -> Vec<(i64, i64, f64)> {
        std::iter::once((0, 0, 1.0)).chain(cross.map(|(x, y)| (x, y, weight))).collect()
    };
    let red = study(&around(0.25));
    assert!(red.colour.starts_with("red"), "{}", red.colour);
    // Lag 1: 2 · 0.25 / (1 + 4 · 0.25²).
    assert!((red.correlation[0] - 0.4).abs() < 0.03, "{:?}", red.correlation);
    let blue = study(&around(-0.25));
    assert!(blue.colour.starts_with("blue"), "{}", blue.colour);
    assert!(blue.spectrum[0][1] < 0.1 && blue.correlation[0] < -0.3);
    // Normal errors have thin tails, and the worst 0.1 % little of the energy.
    assert!(white.tail_index.value > 4.0 && white.worst_share < 0.02, "{:?}", white.tail_index);
    let all: f64 = white.histogram.iter().map(|bin| bin[1]).sum();
    assert!((all - 1.0).abs() < 1e-12);
}

#[test]
fn tails_are_recognised() {
    for index in [1.5, 3.0] {
        let images: Vec<Image> = (0..32)
            .map(|seed| {
                let mut rng = Pcg64Mcg::seed_from_u64(seed);
                let pareto: Vec<f64> = (0..4096)
                    .map(|_| {
                        let sign = if rng.random::<f64>() < 0.5 { -1.0 } else { 1.0 };
                        sign * (1.0 - rng.random::<f64>()).powf(-1.0 / index)
                    })
                    .collect();
                field(64, 64, |x, y| pareto[64 * y + x])
            })
            .collect();
        let found = noise(&images, "8 spp").expect("a study of noise").tail_index;
        assert!((found.value / index - 1.0).abs() < 0.2, "{found:?} for {index}");
    }
}
