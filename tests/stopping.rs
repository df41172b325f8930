//! `--error`: is the error reached when a render stops for it, and soon enough?
//!
//! Each scene is rendered with many seeds until it stops by itself. The truth
//! is measured against the mean of all other seeds' pictures, whose noise
//! (known from their scatter) is taken off. The run was not too long when the
//! same seed with two thirds of its samples was not good enough.
//!
//! `ETENDUE_LONG=1 cargo test --release --test stopping -- --nocapture` does it
//! for 1 % and 20 seeds, and prints the table of `record/calibration.md`; with the
//! name of a scene instead of 1, for that scene alone.

#[path = "common/render.rs"]
mod render;

use etendue::film::Picture;
use etendue::render::{RenderStats, Stopped};
use rayon::prelude::*;
use render::{Ready, options, rgb};

struct Case {
    scene: &'static str,
    size: [&'static str; 2],
    /// The limit when only a short test is asked for.
    short: Option<f64>,
}

const CASES: [Case; 6] = [
    Case { scene: "cornell-box", size: ["48", "48"], short: Some(0.05) },
    Case { scene: "teapot-env", size: ["64", "36"], short: Some(0.04) },
    Case { scene: "veach-mis", size: ["48", "27"], short: None },
    Case { scene: "glass-of-water", size: ["32", "18"], short: Some(0.2) },
    Case { scene: "teapot-dof", size: ["64", "36"], short: None },
    Case { scene: "cornell-original", size: ["48", "48"], short: None },
];

/// A run that stopped by itself, and the same seed with fewer samples.
struct Run {
    stats: RenderStats,
    picture: Vec<f32>,
    shorter: Vec<f32>,
}

fn run(ready: &Ready, seed: u64, limit: f64) -> Run {
    let mut o = options(1 << 20, seed);
    (o.error, o.threads) = (Some(limit), 1);
    let rendered = ready.render(&o);
    assert_eq!(rendered.stats.stopped, Stopped::Error);
    let colour = |p: Picture| rgb(&p);
    let picture = colour(rendered.film.resolve());
    let mut o = options(rendered.stats.samples_per_pixel * 2 / 3, seed);
    o.threads = 1;
    let shorter = colour(ready.render(&o).film.resolve());
    Run { stats: rendered.stats, picture, shorter }
}

/// The root of relMSE of two pictures of a run against the mean of the others.
fn errors(runs: &[Run], own: usize) -> [f64; 2] {
    let values = runs[0].picture.len();
    let others = || runs.iter().enumerate().filter(|(i, _)| *i != own).map(|(_, r)| r);
    let count = (runs.len() - 1) as f64;
    let mean = |v: usize| others().map(|r| f64::from(r.picture[v])).sum::<f64>() / count;
    let reference: Vec<f64> = (0..values).map(mean).collect();
    let floor = 0.01 * (reference.iter().sum::<f64>() / values as f64).powi(2);
    let mut sums = [0.0; 2];
    for (v, truth) in reference.iter().enumerate() {
        let scatter = others().map(|r| (f64::from(r.picture[v]) - truth).powi(2)).sum::<f64>();
        let noise = scatter / (count - 1.0) / count;
        for (sum, picture) in sums.iter_mut().zip([&runs[own].picture, &runs[own].shorter]) {
            *sum += ((f64::from(picture[v]) - truth).powi(2) - noise) / (truth * truth + floor);
        }
    }
    sums.map(|s| (s / values as f64).max(0.0).sqrt())
}

#[test]
fn the_error_asked_for_is_reached_and_not_much_more() {
    let only = std::env::var("ETENDUE_LONG").ok();
    let long = only.is_some();
    println!(
        "| scene | limit | samples | true error: least, median, largest | within 1.1 × | not 1.5 × too long | in its interval |"
    );
    println!("|-|-|-|-|-|-|-|");
    for case in &CASES {
        if only.as_ref().is_some_and(|name| name != "1" && name != case.scene) {
            continue;
        }
        let seeds = if long { 20 } else { 8 };
        let Some(limit) = (if long { Some(0.01) } else { case.short }) else { continue };
        let file = format!("scenes/{}/scene.xml", case.scene);
        let ready = Ready::from_file(&file, &[("resx", case.size[0]), ("resy", case.size[1])]);
        let runs: Vec<Run> = (0..seeds).into_par_iter().map(|seed| run(&ready, 500 + seed, limit)).collect();
        let errors: Vec<[f64; 2]> = (0..runs.len()).map(|i| errors(&runs, i)).collect();
        let mut reached: Vec<f64> = errors.iter().map(|e| e[0]).collect();
        let good = reached.iter().filter(|e| **e <= 1.1 * limit).count();
        let tight = errors.iter().filter(|e| e[1] > limit).count();
        let stated = |r: &Run| r.stats.relative_error_interval;
        let honest =
            runs.iter().zip(&reached).filter(|(r, e)| (stated(r)[0]..=stated(r)[1]).contains(e)).count();
        reached.sort_by(f64::total_cmp);
        let mut samples: Vec<u64> = runs.iter().map(|r| r.stats.samples_per_pixel).collect();
        samples.sort_unstable();
        println!(
            "| {} {} × {} | {} % | {} to {} | {:.2}, {:.2}, {:.2} % | {good} of {seeds} | {tight} of {seeds} | {honest} of {seeds} |",
            case.scene,
            case.size[0],
            case.size[1],
            100.0 * limit,
            samples[0],
            samples[samples.len() - 1],
            100.0 * reached[0],
            100.0 * reached[reached.len() / 2],
            100.0 * reached[reached.len() - 1],
        );
        assert!(good * 10 >= runs.len() * 9, "{}: {reached:?}", case.scene);
        assert!(tight * 4 >= runs.len() * 3, "{}: {errors:?}", case.scene);
    }
}
