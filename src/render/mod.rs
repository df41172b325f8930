//! Runs an integrator over the film: passes, tiles, threads, stopping rules
//! and statistics.
//!
//! Samples come in passes over the whole picture, of 1, 1, 2, 4 and then 8
//! samples per pixel: a picture exists after the first, and Ctrl-C, time and
//! error limits act between them. A pass is cut into tiles that rayon hands
//! out from the middle of the picture outwards. A tile sums its samples in
//! f64 in a fixed order, and is then added to the film exactly; so the picture
//! depends neither on the number of threads nor on the order of tiles.

mod bad;
mod block;
mod memory;
mod pass;
mod pilot;
mod replay;
mod stats;

pub use bad::{BadSample, BadSamples, Cause};
pub use block::Draw;
pub use pilot::Pilot;
pub use replay::{Replay, replay};
pub use stats::{RenderStats, peak_memory_bytes};

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;

use self::block::Block;
use crate::desc::{Error, Result};
use crate::film::{Film, Groups, LayerSet, MAX_REPLICAS, PixelSample, Rect, RelativeError, TILE_SIZE, Tile};
use crate::integrator::{AUTO_REUSE, CameraSample, Counters, Integrator, NoRecord, Path};
use crate::math::Vec2;
use crate::sampling::{Sampler, Sequence, replica_of};
use crate::scene::Scene;

/// What to render and when to stop; it stops at the first limit reached.
#[derive(Clone, Debug)]
pub struct RenderOptions {
    /// Samples per pixel.
    pub samples_per_pixel: u64,
    /// Wall-clock limit for rendering alone.
    pub time: Option<Duration>,
    /// Stop when the picture's relative error is known to be at most this: its
    /// upper bound is, see [`STOP_MARGIN`].
    pub error: Option<f64>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Independent replicas that share the samples of each pixel; 0 for none
    /// (the error is found from halves), at most [`crate::film::MAX_REPLICAS`].
    pub replicas: u32,
    /// How the samples of a pixel are spread.
    pub sequence: Sequence,
    /// Threads; 0 is one per core.
    pub threads: usize,
    /// Layers beside colour.
    pub layers: LayerSet,
    /// The order in which tiles are begun.
    pub order: TileOrder,
}

/// A render stops for its error when the estimate lies this many of its own
/// standard errors below the limit (of the logarithm; see
/// [`RelativeError::at`]). The looks are many, up to eight per doubling of the
/// samples, but the error falls by 29 % in the same time: only the last few
/// could stop too early, and they share most of their samples. So the chance of
/// all is not much more than that of one, 5 %, of an estimate that is a few
/// percent too large on average (halves, see [`Groups`]).
pub const STOP_MARGIN: f64 = 1.645;

/// No margin is larger than this. Where it would be, a few fireflies rule the
/// error and the interval is that of what other seeds would give; but this
/// picture's own error is the better known the more a firefly rules it: with a
/// and b the errors of both halves, ((a − b)/2)² and the squared error of their
/// mean, ((a + b)/2)², differ by a·b, and b is small.
pub const MOST_MARGIN: f64 = 1.1;

/// No error limit stops a render before this many samples per pixel: light that
/// few paths find has to have had its chance.
pub const MIN_SAMPLES_TO_STOP: u64 = 32;

/// The order in which tiles are begun; it does not change the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TileOrder {
    /// From the middle outwards: what matters shows early.
    CentreOut,
    /// Shuffled by a seed, for tests.
    Shuffled(u64),
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// All samples were taken.
    Samples,
    /// The time was up.
    Time,
    /// The error was reached.
    Error,
    /// The user asked.
    Interrupted,
}

impl Stopped {
    /// For messages and the header.
    #[must_use]
    pub fn reason(self) -> &'static str {
        match self {
            Stopped::Samples => "all samples taken",
            Stopped::Time => "time limit reached",
            Stopped::Error => "error limit reached",
            Stopped::Interrupted => "interrupted",
        }
    }
}

/// Watches a render, and may stop it.
pub trait Monitor: Sync {
    /// Samples done of all that there will be at most, and the latest estimate
    /// of the relative error. Called from worker threads.
    fn progress(&self, done: u64, total: u64, error: Option<f64>);

    /// True when the render should end after this pass.
    fn stop(&self) -> bool;
}

/// Watches nothing.
#[derive(Debug)]
pub struct Quiet;

impl Monitor for Quiet {
    fn progress(&self, _done: u64, _total: u64, _error: Option<f64>) {}

    fn stop(&self) -> bool {
        false
    }
}

/// A finished render.
pub struct Rendered {
    /// The film with all its sums.
    pub film: Film,
    /// What it took.
    pub stats: RenderStats,
}

/// Renders a scene.
///
/// # Errors
/// Zero samples, too many replicas, lights that the integrator cannot find, a
/// film that does not fit into memory, or threads that cannot be started.
pub fn render(
    scene: &Scene,
    integrator: &Integrator,
    options: &RenderOptions,
    monitor: &dyn Monitor,
) -> Result<Rendered> {
    if options.samples_per_pixel == 0 {
        return Err(Error::new("at least one sample per pixel is needed"));
    }
    if options.replicas > MAX_REPLICAS {
        return Err(Error::new(format!("at most {MAX_REPLICAS} replicas, found {}", options.replicas)));
    }
    if scene.plan.unsampled_lights > 0 && integrator.samples_lights_alone() {
        let message = format!(
            "integrator `{}` cannot find lights that are curves, deform or are too many instances: it does not scatter rays for them",
            integrator.name()
        );
        return Err(Error::new(message).hint("`path` can, and `direct` with bsdf samples"));
    }
    integrator.check_reuse(scene)?;
    memory::check_room(&scene.film, options.layers, Groups::of_replicas(options.replicas))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|e| Error::new(format!("cannot start {} threads: {e}", options.threads)))?;
    pool.install(|| {
        let clock = (Instant::now(), ProcessTime::now());
        let (integrator, pilot) = decide(scene, integrator, options);
        let spent = pilot.map(|_| (clock.0.elapsed().as_secs_f64(), clock.1.elapsed().as_secs_f64()));
        let mut options = options.clone();
        options.time = options.time.map(|limit| limit.saturating_sub(clock.0.elapsed()));
        let mut rendered = Job::new(scene, &integrator, &options, monitor).run()?;
        rendered.stats.pilot = pilot;
        if let Some((wall, cpu)) = spent {
            rendered.stats.wall_seconds += wall;
            rendered.stats.cpu_seconds += cpu;
        }
        Ok(rendered)
    })
}

/// The integrator, with the number of pixels that use each other's paths decided.
fn decide(scene: &Scene, integrator: &Integrator, options: &RenderOptions) -> (Integrator, Option<Pilot>) {
    let Integrator::Path(path @ Path { reuse: AUTO_REUSE, .. }) = integrator else {
        return (integrator.clone(), None);
    };
    let alone = Path { reuse: 1, ..*path };
    if integrator.reuse_obstacle(scene).is_some() {
        return (Integrator::Path(alone), None);
    }
    let film = Film::new(scene.film.clone(), LayerSet::default(), 1.0);
    let pilot = Pilot::run(scene, &alone, &film, options.samples_per_pixel, (options.seed, options.sequence));
    let reuse = pilot.map_or(1, |pilot| pilot.pixels);
    (Integrator::Path(Path { reuse, ..alone }), pilot)
}

struct Job<'a> {
    scene: &'a Scene,
    integrator: &'a Integrator,
    options: &'a RenderOptions,
    monitor: &'a dyn Monitor,
    film: Film,
    /// The largest radiance that the film takes.
    largest: f32,
    tiles: Vec<Rect>,
    totals: Mutex<(Counters, BadSamples)>,
    cpu_nanoseconds: AtomicU64,
    done: AtomicU64,
    total: u64,
}

impl<'a> Job<'a> {
    fn new(
        scene: &'a Scene,
        integrator: &'a Integrator,
        options: &'a RenderOptions,
        monitor: &'a dyn Monitor,
    ) -> Job<'a> {
        let groups = Groups::of_replicas(options.replicas);
        let scale = integrator.radiance_scale(scene);
        let film = Film::grouped(scene.film.clone(), options.layers, scale, groups)
            .with_shared_noise(integrator.reuse());
        let side = if integrator.reuse() > 1 { Block::side(&scene.film) } else { TILE_SIZE };
        let mut tiles = film.tiles_of(side);
        pass::order(&mut tiles, options.order);
        let pixels: u64 = tiles.iter().map(|t| t.area() as u64).sum();
        Job {
            scene,
            integrator,
            options,
            monitor,
            film,
            largest: Film::largest_radiance(scale),
            tiles,
            totals: Mutex::default(),
            cpu_nanoseconds: AtomicU64::new(0),
            done: AtomicU64::new(0),
            total: pixels.saturating_mul(options.samples_per_pixel),
        }
    }

    fn run(self) -> Result<Rendered> {
        let start = Instant::now();
        let mut next = 0;
        let mut error = None;
        let mut estimated_at = 0;
        let stopped = loop {
            let mut count =
                pass::size(next, self.options.replicas).min(self.options.samples_per_pixel - next);
            if let Some(limit) = self.options.time
                && next > 0
            {
                let each = start.elapsed().as_secs_f64() / next as f64;
                let left = limit.as_secs_f64() - start.elapsed().as_secs_f64();
                count = count.min((left / each) as u64);
                if count == 0 {
                    break Stopped::Time;
                }
            }
            self.film.advance(next);
            self.pass(next..next + count, error.map(|e: RelativeError| e.value));
            let looks = pass::checks_error(next, next + count, self.options.error.is_some());
            next += count;
            if looks {
                error = Some(self.film.relative());
                estimated_at = next;
            }
            if next >= self.options.samples_per_pixel {
                break Stopped::Samples;
            }
            if self.monitor.stop() {
                break Stopped::Interrupted;
            }
            if let (true, Some(limit), Some(reached)) = (looks, self.options.error, error)
                && next >= MIN_SAMPLES_TO_STOP
                && reached.at(STOP_MARGIN).min(MOST_MARGIN * reached.value) <= limit
            {
                break Stopped::Error;
            }
        };
        let wall = start.elapsed().as_secs_f64();
        let (counters, bad) = self.totals.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        let relative = error.filter(|_| estimated_at == next).unwrap_or_else(|| self.film.relative());
        let stats = RenderStats {
            wall_seconds: wall,
            cpu_seconds: self.cpu_nanoseconds.into_inner() as f64 * 1e-9,
            threads: rayon::current_num_threads(),
            samples_per_pixel: next,
            samples: self.done.into_inner(),
            counters,
            bad,
            relative_error: relative.value,
            relative_error_interval: relative.interval(),
            effective_pixels: relative.effective_pixels,
            film_bytes: self.film.memory_bytes(),
            stopped,
            reuse: self.integrator.reuse(),
            pilot: None,
        };
        Ok(Rendered { film: self.film, stats })
    }

    /// Renders some samples of every pixel.
    fn pass(&self, samples: std::ops::Range<u64>, error: Option<f64>) {
        self.tiles.par_iter().with_max_len(1).for_each_init(
            || (None, self.shared().map(|path| Block::new(self.scene, path))),
            |(buffer, block): &mut (Option<Tile>, Option<Block>), rect| {
                let clock = ThreadTime::now();
                let tile = match buffer {
                    Some(tile) => {
                        tile.reset(*rect);
                        tile
                    }
                    None => buffer.insert(self.film.tile(*rect)),
                };
                let (counters, bad) = match block {
                    None => self.tile(tile, rect, samples.clone()),
                    Some(block) => self.shared_tile(block, tile, rect, samples.clone()),
                };
                self.film.merge(tile);
                if let Ok(mut totals) = self.totals.lock() {
                    totals.0.add(&counters);
                    totals.1.add(&bad);
                }
                let n = rect.area() as u64 * (samples.end - samples.start);
                let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
                self.cpu_nanoseconds.fetch_add(clock.elapsed().as_nanos() as u64, Ordering::Relaxed);
                self.monitor.progress(done, self.total, error);
            },
        );
    }

    /// The path tracer, if pixels use each other's paths.
    fn shared(&self) -> Option<&'a Path> {
        match self.integrator {
            Integrator::Path(path) if path.reuse > 1 => Some(path),
            _ => None,
        }
    }

    /// As [`Job::tile`], for pixels that use each other's paths.
    fn shared_tile(
        &self,
        block: &mut Block<'a>,
        tile: &mut Tile,
        rect: &Rect,
        samples: std::ops::Range<u64>,
    ) -> (Counters, BadSamples) {
        let mut record = NoRecord::default();
        let mut bad = BadSamples::default();
        let layers = self.options.layers.needs_first_hit();
        block.move_to(rect.min);
        for index in samples {
            let (seed, within) = replica_of(self.options.seed, self.options.replicas, index);
            let draw = Draw { seed, index: within, sequence: self.options.sequence, layers };
            block.sample(&draw, &mut record);
            for pixel in rect.pixels() {
                let (sample, offset) = block.of(pixel);
                self.keep(tile, (pixel, offset, index), sample, &mut bad);
            }
        }
        (record.0, bad)
    }

    /// Adds a sample to a tile, or counts it as bad.
    #[inline]
    fn keep(
        &self,
        tile: &mut Tile,
        (pixel, offset, index): ((i32, i32), Vec2, u64),
        sample: &PixelSample,
        bad: &mut BadSamples,
    ) {
        match Cause::of(sample, self.largest, self.options.layers.needs_first_hit()) {
            None => {
                tile.add(pixel, offset, index, sample);
            }
            Some(cause) => {
                tile.leave_out(pixel);
                bad.count(BadSample { pixel, index, cause });
            }
        }
    }

    fn tile(&self, tile: &mut Tile, rect: &Rect, samples: std::ops::Range<u64>) -> (Counters, BadSamples) {
        let mut record = NoRecord::default();
        let mut bad = BadSamples::default();
        let layers = self.options.layers.needs_first_hit();
        for pixel in rect.pixels() {
            for index in samples.clone() {
                let (seed, within) = replica_of(self.options.seed, self.options.replicas, index);
                let sampler = Sampler::new(seed, pixel, within).with_sequence(self.options.sequence);
                let (mut camera, offset) = CameraSample::new(self.scene, pixel, sampler);
                camera.layers = layers;
                let sample = self.integrator.sample(self.scene, &camera, &mut record);
                self.keep(tile, (pixel, offset, index), &sample, &mut bad);
            }
        }
        (record.0, bad)
    }
}
