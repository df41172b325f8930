//! Error metrics against hand-computed values, FLIP against the values that
//! its authors' program gives, the z-test against known distributions.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

use etendue::study::metrics::{
    Failure, Pair, RgbView, Verdict, ZOptions, flip_hdr, flip_ldr, metrics, z_test,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn view(width: usize, data: &[f32]) -> RgbView<'_> {
    RgbView::new(width, data.len() / 3 / width, data).unwrap()
}

fn pair<'a>(width: usize, image: &'a [f32], reference: &'a [f32]) -> Pair<'a> {
    Pair::new(view(width, image), view(width, reference)).unwrap()
}

fn close(value: f64, expected: f64) {
    assert!((value - expected).abs() <= 1e-6 * expected.abs(), "{value} instead of {expected}");
}

#[test]
fn metrics_by_hand() {
    // One pixel: mean of the reference 2, its largest value 4.
    let m = metrics(&pair(1, &[1.0, 2.0, 3.0], &[0.0, 2.0, 4.0]));
    close(m.mse, 2.0 / 3.0);
    close(m.rel_mse, (1.0 / 0.04 + 1.0 / 16.04) / 3.0);
    close(m.mape, (1.0 / 0.02 + 1.0 / 4.02) / 3.0);
    close(m.smape, (2.0 / 1.02 + 2.0 / 7.02) / 3.0);
    close(m.psnr, 10.0 * (16.0_f64 / (2.0 / 3.0)).log10());
    assert_eq!(m.skipped, 0);
}

#[test]
fn equal_pictures_have_no_error() {
    for picture in [vec![0.0; 3 * 20 * 20], scene(20, 20).0] {
        let m = metrics(&pair(20, &picture, &picture));
        assert_eq!(
            (m.mse, m.rel_mse, m.rel_mse_trimmed, m.mape, m.smape, m.flip),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        );
        assert!(m.psnr.is_infinite() || m.psnr.is_nan());
    }
}

#[test]
fn trimmed_metric_leaves_the_firefly_out() {
    let (reference, _) = scene(64, 64);
    let mut image: Vec<f32> = reference.iter().map(|v| v * 1.01).collect();
    let before = metrics(&pair(64, &image, &reference));
    image[3 * 1000] += 1e4;
    let after = metrics(&pair(64, &image, &reference));
    assert!(after.rel_mse > 1e3 * before.rel_mse);
    assert!((after.rel_mse_trimmed / before.rel_mse_trimmed - 1.0).abs() < 0.01);
}

#[test]
fn values_that_are_not_finite_are_counted() {
    let m = metrics(&pair(1, &[f32::NAN, 2.0, f32::INFINITY], &[1.0, 2.0, 3.0]));
    assert_eq!((m.skipped, m.mse), (2, 0.0));
    assert!(m.to_string().contains("2 values are not finite"), "{m}");
}

#[test]
fn sizes_are_checked() {
    assert!(RgbView::new(2, 2, &[0.0; 9]).is_err());
    assert!(RgbView::new(0, 0, &[]).is_err());
    let (a, b) = ([0.0; 12], [0.0; 6]);
    let error = Pair::new(view(2, &a), view(2, &b)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "pictures of different size: 2x2 and 2x1; only pictures of the same size can be compared"
    );
}

/// A smooth picture with edges, points and a bright lamp, and a disturbed
/// copy of it. The same formulas as in `tools/flip_expected.py`.
fn scene(width: usize, height: usize) -> (Vec<f32>, Vec<f32>) {
    let (mut reference, mut test) = (Vec::new(), Vec::new());
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
            let checker = if (x / 8 + y / 8) % 2 == 0 { 0.25 } else { 0.6 };
            let lamp = if (u - 0.7).hypot(v - 0.3) < 0.1 { 12.0 } else { 0.0 };
            let base = [
                checker * (0.3 + 0.7 * u) + lamp,
                checker * (1.0 - 0.5 * v) + lamp,
                0.2 + 0.4 * u * v + lamp,
            ];
            let ripple = 1.0 + 0.15 * (40.0 * u).sin() * (31.0 * v).cos();
            let dot = if (x * 7 + y * 13) % 97 == 0 { 1.5 } else { 0.0 };
            for (value, part) in base.iter().zip([1.0 / 3.0, 2.0 / 3.0, 1.0]) {
                reference.push(*value as f32);
                test.push((value * ripple + dot * part) as f32);
            }
        }
    }
    (reference, test)
}

#[test]
fn flip_agrees_with_its_authors() {
    // Means and exposures by flip-evaluator 1.7; see tools/flip_expected.py.
    let expected = [
        // width, height, LDR of the clamped pictures, HDR, start, stop
        (96, 64, 0.120131, 0.115338, -2.561437, 2.821058),
        (40, 75, 0.097931, 0.096237, -2.561155, 2.880517),
    ];
    for (width, height, ldr, hdr, start, stop) in expected {
        let (reference, test) = scene(width, height);
        let clamp = |p: &[f32]| -> Vec<f32> { p.iter().map(|v| v.clamp(0.0, 1.0)).collect() };
        let (clamped_test, clamped_reference) = (clamp(&test), clamp(&reference));
        let map = flip_ldr(&pair(width, &clamped_test, &clamped_reference));
        let mean = map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64;
        assert!((mean - ldr).abs() < 1e-4, "LDR {width}x{height}: {mean} instead of {ldr}");
        let result = flip_hdr(&pair(width, &test, &reference));
        assert!((result.mean - hdr).abs() < 1e-4, "HDR {width}x{height}: {} instead of {hdr}", result.mean);
        assert!((result.start_exposure - start).abs() < 1e-4, "start {}", result.start_exposure);
        // They take the upper one of two medians, we their mean.
        assert!((result.stop_exposure - stop).abs() < 5e-3, "stop {}", result.stop_exposure);
        assert_eq!(result.exposures, 6);
    }
}

#[test]
fn flip_stays_in_range_for_anything() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut odd = || f32::from_bits(rng.random::<u32>());
    let (a, b): (Vec<f32>, Vec<f32>) = (0..3 * 17 * 9).map(|_| (odd(), odd())).unzip();
    for result in [flip_hdr(&pair(17, &a, &b)), flip_hdr(&pair(17, &b, &a)), flip_hdr(&pair(1, &a, &b))] {
        assert!(result.map.iter().all(|e| (0.0..=1.0).contains(e)), "{:?}", result.map);
        assert!(result.exposures < 300);
    }
}

/// Standard normal values by Box and Muller.
fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

const SIZE: usize = 64;

struct Noisy {
    image: Vec<f32>,
    reference: Vec<f32>,
    variance: Vec<f32>,
}

/// Two noisy versions of a picture; the first is wrong by `bias(x, y, value)`.
fn noisy(seed: u64, deviation: f64, bias: impl Fn(usize, usize, f64) -> f64) -> Noisy {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut made = Noisy { image: vec![], reference: vec![], variance: vec![] };
    for (index, truth) in scene(SIZE, SIZE).0.iter().enumerate() {
        let truth = f64::from(*truth);
        let sigma = deviation * truth;
        let (x, y) = (index / 3 % SIZE, index / 3 / SIZE);
        made.image.push((bias(x, y, truth) + sigma * normal(&mut rng)) as f32);
        made.reference.push((truth + sigma * normal(&mut rng)) as f32);
        made.variance.push((sigma * sigma) as f32);
    }
    made
}

fn verdict(made: &Noisy) -> Verdict {
    let variance = Some(view(SIZE, &made.variance));
    let report =
        z_test(&pair(SIZE, &made.image, &made.reference), variance, variance, &ZOptions::default()).unwrap();
    report.verdict
}

#[test]
fn z_test_accepts_equal_means() {
    for seed in 0..40 {
        assert_eq!(verdict(&noisy(seed, 0.01, |_, _, v| v)), Verdict::Pass, "seed {seed}");
    }
}

#[test]
fn z_test_finds_each_kind_of_error() {
    // A uniform bias of 0.3 %: invisible per pixel, plain in the mean.
    let Verdict::Fail(reasons) = verdict(&noisy(1, 0.01, |_, _, v| 1.003 * v)) else { panic!() };
    assert!(reasons.contains(&Failure::MeanBeyondError) && reasons.contains(&Failure::MeanBeyondLimit));
    assert!(!reasons.contains(&Failure::Pixels));
    // A patch of 8 x 8 pixels 2 % too bright: found by its block alone.
    let patch = |x: usize, y: usize, v: f64| if x / 8 == 2 && y / 8 == 5 { 1.02 * v } else { v };
    assert_eq!(verdict(&noisy(2, 0.01, patch)), Verdict::Fail(vec![Failure::Blocks]));
    // One pixel in a hundred far off, up and down, so that no mean moves.
    let speckle = |x: usize, y: usize, v: f64| match (x + 3 * y) % 64 {
        0 => 1.3 * v,
        1 => 0.7 * v,
        _ => v,
    };
    let Verdict::Fail(reasons) = verdict(&noisy(3, 0.01, speckle)) else { panic!() };
    assert!(reasons.contains(&Failure::Pixels), "{reasons:?}");
    // Noise too high to tell anything.
    assert_eq!(verdict(&noisy(4, 0.5, |_, _, v| v)), Verdict::Inconclusive);
}

#[test]
fn z_test_without_variance_tolerates_rounding_alone() {
    let (reference, _) = scene(SIZE, SIZE);
    let options = ZOptions::default();
    for (factor, passes) in [(1.0, true), (1.0 + 5e-5, true), (1.0 + 3e-4, false)] {
        let image: Vec<f32> = reference.iter().map(|v| (f64::from(*v) * factor) as f32).collect();
        let report = z_test(&pair(SIZE, &image, &reference), None, None, &options).unwrap();
        assert_eq!(report.passed(), passes, "factor {factor}: {report}");
    }
    let black = vec![0.0; 12];
    let report = z_test(&pair(2, &black, &black), None, None, &options).unwrap();
    assert!(report.passed(), "{report}");
}

#[test]
fn z_test_fails_on_nan() {
    let mut made = noisy(5, 0.01, |_, _, v| v);
    made.image[77] = f32::NAN;
    let Verdict::Fail(_) = verdict(&made) else { panic!() };
    let made = noisy(6, 0.01, |_, _, _| f64::NAN);
    let Verdict::Fail(reasons) = verdict(&made) else { panic!() };
    assert!(reasons.contains(&Failure::Pixels));
}

#[test]
fn overlap_and_known_errors_widen_the_mean() {
    let made = noisy(7, 0.01, |_, _, v| v);
    let variance = Some(view(SIZE, &made.variance));
    let both = pair(SIZE, &made.image, &made.reference);
    let with = |options: &ZOptions| z_test(&both, variance, variance, options).unwrap().mean_rel_diff_se;
    let plain = with(&ZOptions::default());
    close(with(&ZOptions { overlap: 2.25, ..ZOptions::default() }), 1.5 * plain);
    let known =
        ZOptions { reference_mean_error: Some(3e-4), image_mean_error: Some(4e-4), ..ZOptions::default() };
    close(with(&known), 5e-4);
}

#[test]
fn report_reads_well() {
    let made = noisy(8, 0.01, |_, _, v| v);
    let variance = Some(view(SIZE, &made.variance));
    let report =
        z_test(&pair(SIZE, &made.image, &made.reference), variance, variance, &ZOptions::default()).unwrap();
    let text = report.to_string();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 4, "{text}");
    assert!(lines[0].starts_with("pixels   ") && lines[0].contains("of 12288 inside"), "{text}");
    assert_eq!(lines[3], "verdict  pass");
}
