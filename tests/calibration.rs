//! How often the truth lies within the reported standard errors.
//!
//! For each scene, kind of error and sample count: the part of all pixels and
//! channels whose value lies within 1, 1.96 and 3 reported standard errors of
//! the truth. The truth of one seed is the mean of the other seeds at the
//! largest count; its variance is added to the reported one. What must hold:
//! 90 to 99.5 % within 1.96 for the halves (too cautious is allowed, too bold is
//! not), 93 to 97 % for 16 replicas.
//!
//! `ETENDUE_LONG=1 cargo test --release --test calibration -- --nocapture` does
//! the same with more seeds, pixels and counts, and prints the table of
//! `record/calibration.md`; with the name of a scene instead of 1, for that scene
//! alone.

#![allow(clippy::print_stdout, reason = "the table is a result")]

#[path = "common/render.rs"]
mod render;
#[path = "common/snapshots.rs"]
mod snapshots;

use rayon::prelude::*;
use render::Ready;
use snapshots::{Shot, snapshots};

/// A scene, and the least count from which on its coverage is promised: where
/// most samples of a pixel see nothing of a caustic or of the light behind a
/// door, their scatter cannot tell either.
struct Case {
    scene: &'static str,
    size: [u32; 2],
    halves_from: u64,
    replicas_from: u64,
}

const CASES: [Case; 6] = [
    Case { scene: "cornell-box", size: [64, 64], halves_from: 16, replicas_from: 16 },
    Case { scene: "veach-mis", size: [80, 45], halves_from: 16, replicas_from: 16 },
    Case { scene: "teapot-env", size: [80, 45], halves_from: 16, replicas_from: 16 },
    Case { scene: "glass-of-water", size: [64, 36], halves_from: 32, replicas_from: 64 },
    Case { scene: "veach-ajar", size: [64, 36], halves_from: 16, replicas_from: 32 },
    Case { scene: "teapot-dof", size: [80, 45], halves_from: 16, replicas_from: 16 },
];

fn long() -> bool {
    std::env::var_os("ETENDUE_LONG").is_some()
}

/// Part of the values within `k` reported standard errors, and the root mean
/// square of the true error over that of the reported one.
fn coverage(runs: &[Vec<Shot>], at: usize, k: f64) -> (f64, f64) {
    let (seeds, values) = (runs.len() as f64, runs[0][0].rgb.len());
    let last = runs[0].len() - 1;
    let (mut inside, mut actual, mut stated) = (0_u64, 0.0, 0.0);
    for v in 0..values {
        let sum: f64 = runs.iter().map(|r| r[last].rgb[v]).sum();
        let mean = sum / seeds;
        let variance =
            runs.iter().map(|r| (r[last].rgb[v] - mean).powi(2)).sum::<f64>() / (seeds - 1.0) / (seeds - 1.0);
        for run in runs {
            let truth = (sum - run[last].rgb[v]) / (seeds - 1.0);
            let error = (run[at].rgb[v] - truth).powi(2);
            let reported = run[at].error[v].powi(2);
            inside += u64::from(error <= k * k * (reported + variance));
            actual += error - variance;
            stated += reported;
        }
    }
    (inside as f64 / (values as f64 * seeds), (actual / stated).max(0.0).sqrt())
}

/// Measures a case; prints rows of a table and returns (count, coverage).
fn measure(case: &Case, replicas: u32, seeds: u64, counts: &[u64]) -> Vec<(u64, f64)> {
    let scale = if long() { 1 } else { 2 };
    let [width, height] = case.size.map(|n| (n / scale).to_string());
    let file = format!("scenes/{}/scene.xml", case.scene);
    let ready = Ready::from_file(&file, &[("resx", width.as_str()), ("resy", height.as_str())]);
    let runs: Vec<_> =
        (0..seeds).into_par_iter().map(|seed| snapshots(&ready, 100 + seed, replicas, counts)).collect();
    let kind = if replicas > 0 { format!("{replicas} replicas") } else { "halves".to_owned() };
    let rows = counts.len() - 1;
    (0..rows)
        .map(|at| {
            let [one, two, three] = [1.0, 1.96, 3.0].map(|k| coverage(&runs, at, k));
            println!(
                "| {} | {kind} | {} | {:.1} | {:.2} | {:.2} | {:.2} |",
                case.scene,
                counts[at],
                100.0 * one.0,
                100.0 * two.0,
                100.0 * three.0,
                two.1
            );
            (counts[at], two.0)
        })
        .collect()
}

fn check(replicas: u32, bounds: std::ops::RangeInclusive<f64>) {
    let long_counts = [16, 24, 32, 64, 72, 128, 256, 512, 768, 1024, 1536];
    let (seeds, counts): (u64, &[u64]) =
        if long() { (8, &long_counts) } else { (6, &[16, 40, 64, 256, 512]) };
    println!("| scene | error from | samples | within 1 | within 1.96 | within 3 | true ÷ reported |");
    println!("|-|-|-|-|-|-|-|");
    let mut checked = 0;
    let mut failures = Vec::new();
    let only = std::env::var("ETENDUE_LONG").ok().filter(|name| name != "1");
    for case in CASES.iter().filter(|case| only.as_ref().is_none_or(|name| name == case.scene)) {
        let from = if replicas > 0 { case.replicas_from } else { case.halves_from };
        for (count, within) in measure(case, replicas, seeds, counts) {
            if count >= from {
                checked += 1;
                if !bounds.contains(&within) {
                    failures.push(format!("{} at {count}: {:.2} %", case.scene, 100.0 * within));
                }
            }
        }
    }
    assert!(failures.is_empty(), "outside {bounds:?}: {failures:#?}");
    assert!(checked >= if only.is_some() { 1 } else { 14 }, "{checked} cases");
}

#[test]
fn halves_cover_the_truth() {
    check(0, 0.90..=0.995);
}

#[test]
fn replicas_cover_the_truth() {
    check(16, 0.93..=0.97);
}
