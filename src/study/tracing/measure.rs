//! Builds, traces and compares.

use std::time::Instant;

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;

use super::{Contender, RaySet, Rays, Subject, Tracer, ray_sets};
use crate::accel::{Accel, Stats};
use crate::desc::{Error, Result};
use crate::math::Ray;
use crate::shape::{Geometry, Hit};

/// How to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Rays of each set.
    pub rays: usize,
    /// Which sets; none measures builds alone.
    pub sets: Vec<RaySet>,
    /// How often every set is traced by every contender.
    pub repeats: usize,
    /// How often every contender is built; at least 1.
    pub builds: usize,
    /// Threads of a build; 0 is one per core. Rays are traced on one.
    pub threads: usize,
    /// Rays of each set that are compared with brute force.
    pub verify: usize,
    /// Seed of the rays.
    pub seed: u64,
}

/// Times of each build, in seconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildTimes {
    /// Of the clock on the wall.
    pub wall: Vec<f64>,
    /// Of all threads of the process.
    pub cpu: Vec<f64>,
}

/// Rays whose answer is not that of the default accelerator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// No hit where there is one.
    pub missed: usize,
    /// A hit where there is none.
    pub extra: usize,
    /// A hit of another primitive.
    pub other_prim: usize,
    /// The same primitive, but another bit of t, u or v.
    pub other_bits: usize,
}

impl Differences {
    /// All of them.
    #[must_use]
    pub fn total(&self) -> usize {
        self.missed + self.extra + self.other_prim + self.other_bits
    }

    fn count(&mut self, expected: Option<Hit>, found: Option<Hit>) {
        let bits = |h: Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits()];
        match (expected, found) {
            (None, None) => {}
            (Some(_), None) => self.missed += 1,
            (None, Some(_)) => self.extra += 1,
            (Some(a), Some(b)) if a.prim != b.prim => self.other_prim += 1,
            (Some(a), Some(b)) => self.other_bits += usize::from(bits(a) != bits(b)),
        }
    }
}

/// One contender on one set.
#[derive(Clone, Debug, PartialEq)]
pub struct SetResult {
    /// Which rays.
    pub set: RaySet,
    /// How many.
    pub rays: usize,
    /// How many of them hit something.
    pub hits: usize,
    /// CPU seconds of each repeat.
    pub seconds: Vec<f64>,
    /// From the default accelerator.
    pub differences: Differences,
    /// Of the rays compared with brute force, those whose answer is another.
    pub wrong: usize,
}

/// One contender on one subject.
#[derive(Clone, Debug, PartialEq)]
pub struct KindResult {
    /// Its name.
    pub name: String,
    /// It must give the same bits as the default accelerator.
    pub exact: bool,
    /// How long building took.
    pub build: BuildTimes,
    /// Bytes beyond the geometry's.
    pub memory_bytes: usize,
    /// Its tree.
    pub stats: Stats,
    /// What it did on each set.
    pub sets: Vec<SetResult>,
}

/// All contenders on one subject.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseResult {
    /// Its name.
    pub name: String,
    /// Triangles.
    pub triangles: u32,
    /// Primitives that are none.
    pub analytic: u32,
    /// Bytes of the geometry.
    pub geometry_bytes: usize,
    /// Rays of each set compared with brute force.
    pub verified: usize,
    /// Each contender, in order.
    pub kinds: Vec<KindResult>,
}

/// Measures all contenders on a subject. `say` is told what is going on.
pub fn measure(
    name: &str,
    subject: &Subject,
    contenders: &[Contender],
    options: &Options,
    say: &mut dyn FnMut(&str),
) -> Result<CaseResult> {
    let geometry = subject.geometry();
    if geometry.prim_count() == 0 {
        return Err(Error::new(format!("`{name}` has no shapes")));
    }
    let (mut kinds, tracers) = build(contenders, geometry, options, say)?;
    let mut verified = 0;
    if !options.sets.is_empty() {
        say("making rays");
        let reference = Accel::build_named(None, geometry)?;
        let sets = ray_sets(subject, &reference, &options.sets, options.rays, options.seed);
        verified = options.verify.min(options.rays);
        for rays in &sets {
            compare(geometry, rays, &reference, &tracers, options, &mut kinds);
        }
        drop(reference);
        say(&format!("tracing {} times {} rays of {} sets", options.repeats, options.rays, sets.len()));
        for repeat in 0..options.repeats {
            for (index, rays) in sets.iter().enumerate() {
                for k in rotated(tracers.len(), repeat) {
                    kinds[k].sets[index].seconds.push(time(geometry, rays, &*tracers[k]));
                }
            }
        }
    }
    Ok(CaseResult {
        name: name.to_owned(),
        triangles: geometry.triangle_count(),
        analytic: geometry.prim_count() - geometry.triangle_count(),
        geometry_bytes: geometry.memory_bytes(),
        verified,
        kinds,
    })
}

/// 0..n, beginning at another place each time.
fn rotated(n: usize, by: usize) -> impl Iterator<Item = usize> {
    (0..n).map(move |i| (i + by) % n)
}

type Built = (Vec<KindResult>, Vec<Box<dyn Tracer>>);

/// Builds every contender as often as asked; the last ones stay.
fn build(
    contenders: &[Contender],
    geometry: &Geometry,
    options: &Options,
    say: &mut dyn FnMut(&str),
) -> Result<Built> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|e| Error::new(format!("cannot start threads: {e}")))?;
    let mut times = vec![BuildTimes::default(); contenders.len()];
    let mut tracers: Vec<Option<Box<dyn Tracer>>> = contenders.iter().map(|_| None).collect();
    for round in 0..options.builds.max(1) {
        for k in rotated(contenders.len(), round) {
            say(&format!("building {}", contenders[k].name));
            tracers[k] = None;
            let (wall, cpu) = (Instant::now(), ProcessTime::now());
            let tracer = pool.install(|| contenders[k].build(geometry))?;
            times[k].cpu.push(cpu.elapsed().as_secs_f64());
            times[k].wall.push(wall.elapsed().as_secs_f64());
            tracers[k] = Some(tracer);
        }
    }
    let tracers: Vec<Box<dyn Tracer>> = tracers.into_iter().flatten().collect();
    let kinds = contenders.iter().zip(times).zip(&tracers).map(|((contender, build), tracer)| KindResult {
        name: contender.name.clone(),
        exact: tracer.is_exact(),
        build,
        memory_bytes: tracer.memory_bytes(),
        stats: tracer.stats(),
        sets: Vec::new(),
    });
    Ok((kinds.collect(), tracers))
}

/// CPU seconds of tracing a set once.
fn time(geometry: &Geometry, rays: &Rays, tracer: &dyn Tracer) -> f64 {
    let (mut nearest, mut occluded, mut spawned) = (Vec::new(), Vec::new(), Vec::new());
    match rays.set {
        RaySet::Spawn => spawned.reserve(rays.spawns.len()),
        set if set.is_shadow() => occluded.reserve(rays.rays.len()),
        _ => nearest.reserve(rays.rays.len()),
    }
    let clock = ThreadTime::now();
    match rays.set {
        RaySet::Spawn => tracer.spawn(geometry, &rays.spawns, &mut spawned),
        set if set.is_shadow() => tracer.occluded(geometry, rays.of(tracer), &mut occluded),
        _ => tracer.closest(geometry, rays.of(tracer), &mut nearest),
    }
    let seconds = clock.elapsed().as_secs_f64();
    std::hint::black_box(&spawned);
    seconds
}

impl Rays {
    /// Those that a tracer is given.
    fn of(&self, tracer: &dyn Tracer) -> &[Ray] {
        if tracer.needs_epsilon() { &self.pushed } else { &self.rays }
    }
}

/// What a tracer answers; of shadow rays only whether there is a hit, which
/// stands as a hit of nothing.
fn answers(geometry: &Geometry, rays: &Rays, tracer: &dyn Tracer) -> Vec<Option<Hit>> {
    let mut hits = Vec::with_capacity(rays.rays.len());
    if rays.set.is_shadow() {
        let mut occluded = Vec::with_capacity(rays.rays.len());
        tracer.occluded(geometry, rays.of(tracer), &mut occluded);
        hits.extend(occluded.iter().map(|o| {
            o.then_some(Hit { t: 1.0, prim: u32::MAX, u: 0.0, v: 0.0, instance: Hit::NO_INSTANCE })
        }));
    } else {
        tracer.closest(geometry, rays.of(tracer), &mut hits);
    }
    hits
}

/// Counts differences from the default accelerator and from brute force.
fn compare(
    geometry: &Geometry,
    rays: &Rays,
    reference: &Accel,
    tracers: &[Box<dyn Tracer>],
    options: &Options,
    kinds: &mut [KindResult],
) {
    let expected = answers(geometry, rays, reference);
    // Spread over the set, so that every part of the picture is tried.
    let step = (rays.rays.len() / options.verify.max(1)).max(1);
    let tried: Vec<usize> = (0..rays.rays.len()).step_by(step).take(options.verify).collect();
    let some = tried.iter().map(|i| rays.rays[*i]).collect();
    let some = Rays { set: rays.set, rays: some, pushed: Vec::new(), spawns: Vec::new() };
    let truth = brute_force(geometry, &some);
    for (kind, tracer) in kinds.iter_mut().zip(tracers) {
        let found = answers(geometry, rays, &**tracer);
        let mut differences = Differences::default();
        expected.iter().zip(&found).for_each(|(a, b)| differences.count(*a, *b));
        let mut wrong = Differences::default();
        truth.iter().zip(&tried).for_each(|(a, i)| wrong.count(*a, found[*i]));
        kind.sets.push(SetResult {
            set: rays.set,
            rays: rays.rays.len(),
            hits: found.iter().flatten().count(),
            seconds: Vec::new(),
            differences,
            wrong: wrong.total(),
        });
    }
}

/// The answers of brute force, on all cores.
fn brute_force(geometry: &Geometry, rays: &Rays) -> Vec<Option<Hit>> {
    let Ok(brute) = Accel::build_named(Some("brute"), geometry) else { return Vec::new() };
    let one = |ray: &Ray| {
        let rays = Rays { set: rays.set, rays: vec![*ray], pushed: Vec::new(), spawns: Vec::new() };
        answers(geometry, &rays, &brute)
    };
    rays.rays.par_iter().flat_map_iter(one).collect()
}
