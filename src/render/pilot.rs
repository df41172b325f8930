//! How many pixels are to use each other's paths, if any: tried out on a few tiles.
//!
//! Their paths are traced with numbers that the picture does not use, so that the decision is
//! independent of all samples of it, and are then used by one pixel each, in small groups and in
//! large ones; what lies between follows from these. Noise is the scatter of four short
//! independent sets of each pixel, relative as in [`crate::film::RelativeError`], without the
//! hundredth of the pixels where it is largest: a firefly must not decide. Work is counted, not
//! timed: the same render decides the same on any machine.

use rayon::prelude::*;

use super::block::{Block, Draw};
use crate::film::{Film, Rect, TILE_SIZE};
use crate::integrator::{Counters, NoRecord, Path};
use crate::math::DVec3;
use crate::sampling::Sequence;
use crate::scene::Scene;

/// Independent sets of each pixel, and samples in each.
const SETS: u64 = 4;
const SAMPLES: u64 = 4;
/// Most tiles to try.
const TILES: usize = 64;
/// The pilot takes at most one in this many of all samples.
const SHARE: u64 = 16;
/// What sharing costs, in rays of a path with all that belongs to them: for each path, for each
/// shadow ray, and for each bsdf that is evaluated. From counts of instructions on six scenes of this
/// repository; what follows from them is within a sixth of what these took.
const EACH_PATH: f64 = 0.5;
const EACH_RAY: f64 = 0.27;
const EACH_EVALUATION: f64 = 0.17;
/// What the efficiency must gain before pixels share their noise. The trial sees few samples, no
/// filter and not the worst pixels, and overstates a small gain by up to two (glass-of-water: 2.7
/// for 1.35).
const CLEAR: f64 = 2.0;
/// What it must gain by twice as many.
const WORTH: f64 = 1.1;
/// Pixels of the groups that are tried: powers of two.
const GROUPS: [u32; 2] = [16, 64];
/// What a traced path costs with all connections that are tried, in paths: 1.5 to 4.
const COST: u64 = 2;
/// Makes seeds that no render has.
const ASIDE: u64 = 0x7069_6c6f_7400_0000;

/// What the pilot found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pilot {
    /// Pixels of a group; 1 if none is worth it.
    pub pixels: u32,
    /// Variance without over variance with shared paths, for these groups or for the smallest.
    pub gain: f64,
    /// Work with over work without.
    pub work: f64,
}

impl Pilot {
    /// Tries; nothing where the render is too small for that.
    pub fn run(
        scene: &Scene,
        path: &Path,
        film: &Film,
        samples: u64,
        (seed, sequence): (u64, Sequence),
    ) -> Option<Pilot> {
        let all = film.tiles();
        let each = all.iter().map(|t| t.area() as u64).max()? * SETS * SAMPLES * COST;
        let total = all.iter().map(|t| t.area() as u64).sum::<u64>().saturating_mul(samples);
        let count = ((total / SHARE / each) as usize).min(TILES).min(all.len());
        if count == 0 {
            return None;
        }
        let tiles: Vec<Rect> = (0..count).map(|k| all[(2 * k + 1) * all.len() / (2 * count)]).collect();
        let path = Path { reuse: GROUPS[0], ..*path };
        let trial = tiles
            .par_iter()
            .map_init(
                || Block::of_side(scene, &path, TILE_SIZE),
                |block, rect| Trial::run(block, rect, seed, sequence),
            )
            .reduce(Trial::default, Trial::join);
        Some(trial.decide())
    }

    fn efficiency(&self) -> f64 {
        self.gain / self.work
    }
}

/// What some tiles showed: without shared paths, and with those of [`GROUPS`].
#[derive(Default)]
struct Trial {
    /// Mean and variance of each pixel.
    pixels: [Vec<(DVec3, DVec3)>; WAYS],
    paths: u64,
    /// Rays of all paths, and those that each way adds.
    rays: [u64; WAYS],
    /// Bsdfs that each way evaluates.
    evaluations: [u64; WAYS],
}

const WAYS: usize = 1 + GROUPS.len();

impl Trial {
    /// All ways with the same paths.
    fn run<'s>(block: &mut Block<'s>, rect: &Rect, seed: u64, sequence: Sequence) -> Trial {
        let mut trial = Trial::default();
        let mut sums = [(); WAYS].map(|()| vec![(DVec3::ZERO, DVec3::ZERO); rect.area()]);
        let mut traced = Vec::new();
        block.move_to(rect.min);
        for set in 0..SETS {
            let mut means = [(); WAYS].map(|()| vec![DVec3::ZERO; rect.area()]);
            for index in 0..SAMPLES {
                let draw = Draw { seed: seed ^ (ASIDE + set), index, sequence, layers: false };
                let mut record = NoRecord::default();
                block.trace(&draw, &mut record);
                trial.rays[0] += record.0.rays();
                trial.paths += record.0.paths;
                traced.clone_from(block.lenders());
                for (way, means) in means.iter_mut().enumerate() {
                    let mut counters = Counters::default();
                    if way > 0 {
                        block.lenders().clone_from(&traced);
                        let before = block.evaluations();
                        block.share(GROUPS[way - 1], &mut counters);
                        trial.rays[way] += counters.rays();
                        trial.evaluations[way] += block.evaluations() - before;
                    }
                    for (mean, pixel) in means.iter_mut().zip(rect.pixels()) {
                        // What has been shared is the pixel's own by then.
                        *mean += block.path_of(pixel).alone().as_dvec3() / SAMPLES as f64;
                    }
                }
            }
            for (sums, means) in sums.iter_mut().zip(means) {
                for (sum, mean) in sums.iter_mut().zip(means) {
                    *sum = (sum.0 + mean, sum.1 + mean * mean);
                }
            }
        }
        let n = SETS as f64;
        let moments = |(sum, squares): &(DVec3, DVec3)| {
            let mean = *sum / n;
            (mean, (*squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0))
        };
        trial.pixels = sums.map(|sums| sums.iter().map(moments).collect());
        trial
    }

    fn join(mut self, other: Trial) -> Trial {
        for (all, more) in self.pixels.iter_mut().zip(other.pixels) {
            all.extend(more);
        }
        self.paths += other.paths;
        for way in 0..WAYS {
            self.rays[way] += other.rays[way];
            self.evaluations[way] += other.evaluations[way];
        }
        self
    }

    /// Twice as many pixels as long as that is worth it.
    fn decide(&self) -> Pilot {
        let [small, large] = GROUPS.map(f64::from);
        let known = &self.pixels[WAYS - 1];
        let [alone, noisy, quiet] = [0, 1, 2].map(|way| noise(&self.pixels[way], known));
        let [few, many] = [1, 2].map(|way| {
            let [paths, rays, evaluations] =
                [self.paths, self.rays[way], self.evaluations[way]].map(|n| n as f64);
            EACH_PATH * paths + EACH_RAY * rays + EACH_EVALUATION * evaluations
        });
        let tried = |pixels: u32| {
            // With n pixels variance is a + b/n, work c + d·n.
            let n = f64::from(pixels);
            let towards = (large / n - 1.0) / (large / small - 1.0);
            let variance = quiet + (noisy - quiet) * towards;
            let extra = few + (many - few) * (n - small) / (large - small);
            Pilot { pixels, gain: alone / variance, work: 1.0 + extra / self.rays[0] as f64 }
        };
        let mut best = tried(GROUPS[0]);
        // So written that no number at all is no reason to share.
        if !(best.efficiency() > CLEAR) {
            return Pilot { pixels: 1, ..best };
        }
        while best.pixels < GROUPS[1] {
            let next = tried(2 * best.pixels);
            if !(next.efficiency() > WORTH * best.efficiency()) {
                break;
            }
            best = next;
        }
        best
    }
}

/// Mean relative variance of some pixels, with the means of `known`.
fn noise(pixels: &[(DVec3, DVec3)], known: &[(DVec3, DVec3)]) -> f64 {
    let mean = known.iter().map(|(mean, _)| mean.element_sum() / 3.0).sum::<f64>() / known.len() as f64;
    let floor = DVec3::splat(0.01 * mean * mean);
    let mut terms: Vec<f64> = pixels
        .iter()
        .zip(known)
        .map(|((_, variance), (mean, _))| (*variance / (*mean * *mean + floor)).element_sum())
        .filter(|term| term.is_finite())
        .collect();
    terms.sort_unstable_by(f64::total_cmp);
    terms.truncate(terms.len() - terms.len() / 100);
    terms.iter().sum::<f64>() / terms.len() as f64
}
