//! What a render took, and the samples it had to leave out.

use serde_json::{Value, json};

use super::Stopped;
use crate::film::PixelSample;
use crate::integrator::Counters;
use crate::scene::Plan;

/// Samples left out because they are no radiance, counted by cause; the first
/// ten are located.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadSamples {
    /// Not a number.
    pub nan: u64,
    /// Infinite.
    pub infinite: u64,
    /// Negative.
    pub negative: u64,
    /// Too large for the film's sums.
    pub overflow: u64,
    /// (x, y, sample) of the first ten in the order of sample, row and column.
    pub located: Vec<(i32, i32, u64)>,
}

impl BadSamples {
    const KEPT: usize = 10;

    /// True when the sample is a radiance; else counts it.
    pub fn check(&mut self, sample: &PixelSample, pixel: (i32, i32), index: u64) -> bool {
        let rgb = sample.rgb;
        if rgb.is_finite() && rgb.min_element() >= 0.0 {
            return true;
        }
        if rgb.is_nan() {
            self.nan += 1;
        } else if !rgb.is_finite() {
            self.infinite += 1;
        } else {
            self.negative += 1;
        }
        self.located.push((pixel.0, pixel.1, index));
        self.keep_first();
        false
    }

    /// Adds another tile's.
    pub fn add(&mut self, other: &BadSamples) {
        self.nan += other.nan;
        self.infinite += other.infinite;
        self.negative += other.negative;
        self.overflow += other.overflow;
        self.located.extend(&other.located);
        self.keep_first();
    }

    fn keep_first(&mut self) {
        self.located.sort_unstable_by_key(|(x, y, index)| (*index, *y, *x));
        self.located.truncate(Self::KEPT);
    }

    /// All of them.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.nan + self.infinite + self.negative + self.overflow
    }

    /// For messages and the header.
    #[must_use]
    pub fn summary(&self) -> String {
        format!(
            "{} (NaN {}, infinite {}, negative {}, overflow {})",
            self.total(),
            self.nan,
            self.infinite,
            self.negative,
            self.overflow
        )
    }
}

/// What a render took.
#[derive(Clone, Debug)]
pub struct RenderStats {
    /// Wall-clock seconds of rendering alone.
    pub wall_seconds: f64,
    /// CPU seconds of all threads of rendering alone.
    pub cpu_seconds: f64,
    /// Threads.
    pub threads: usize,
    /// Samples per pixel taken.
    pub samples_per_pixel: u64,
    /// Samples taken, borders included.
    pub samples: u64,
    /// Rays and paths.
    pub counters: Counters,
    /// Samples left out.
    pub bad: BadSamples,
    /// Relative error of the picture, see `Film::relative`.
    pub relative_error: f64,
    /// The interval that holds it with a probability of 95 %.
    pub relative_error_interval: [f64; 2],
    /// Effective number of pixels that the estimate rests on.
    pub effective_pixels: f64,
    /// Memory of the film's sums.
    pub film_bytes: usize,
    /// Why it ended.
    pub stopped: Stopped,
}

impl RenderStats {
    /// The statistics as JSON; `load` and `build` are seconds.
    #[must_use]
    pub fn to_json(&self, plan: &Plan, load: f64, build: f64) -> Value {
        let c = &self.counters;
        json!({
            "render_wall_seconds": self.wall_seconds,
            "render_cpu_seconds": self.cpu_seconds,
            "load_seconds": load,
            "build_seconds": build,
            "threads": self.threads,
            "samples_per_pixel": self.samples_per_pixel,
            "samples": self.samples,
            "paths": c.paths,
            "rays": {
                "camera": c.camera_rays,
                "scatter": c.scatter_rays,
                "shadow": c.shadow_rays,
                "total": c.rays(),
            },
            "samples_per_cpu_second": self.samples as f64 / self.cpu_seconds.max(1e-9),
            "rays_per_cpu_second": c.rays() as f64 / self.cpu_seconds.max(1e-9),
            "relative_error": self.relative_error,
            "relative_error_interval": self.relative_error_interval,
            "effective_pixels": self.effective_pixels,
            "film_bytes": self.film_bytes,
            "stopped": self.stopped.reason(),
            "peak_memory_bytes": peak_memory_bytes(),
            "bad_samples": {
                "total": self.bad.total(),
                "nan": self.bad.nan,
                "infinite": self.bad.infinite,
                "negative": self.bad.negative,
                "overflow": self.bad.overflow,
                "first": self.bad.located.iter().map(|(x, y, i)| json!({"x": x, "y": y, "sample": i})).collect::<Vec<_>>(),
            },
            "plan": plan.to_json(),
        })
    }
}

/// The most memory the process ever held, where the system tells (Linux).
#[must_use]
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
