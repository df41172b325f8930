//! What a render took.

use serde_json::{Value, json};

use super::{BadSamples, Pilot, Stopped};
use crate::integrator::Counters;
use crate::scene::Plan;

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
    /// Pixels in a group that used each other's paths; 1 for none.
    pub reuse: u32,
    /// What made that so, if it was left open.
    pub pilot: Option<Pilot>,
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
            "reuse": self.reuse,
            "reuse_pilot": self.pilot.map(|p| json!({ "pixels": p.pixels, "gain": p.gain, "work": p.work })),
            "peak_memory_bytes": peak_memory_bytes(),
            "bad_samples": self.bad.to_json(),
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
