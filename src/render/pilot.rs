//! Whether pixels are to use each other's paths: tried out on a few tiles.
//!
//! A few tiles are rendered both ways, with numbers that the picture does not use, so that the
//! decision is independent of all samples of it. Noise is the scatter of four short independent
//! sets of each pixel, relative as in [`crate::film::RelativeError`], without the hundredth of the pixels
//! where it is largest: a firefly must not decide. Work is counted, not timed: the same
//! render decides the same on any machine.

use rayon::prelude::*;

use super::block::{Block, Draw};
use crate::film::{Film, Rect};
use crate::integrator::{Counters, NoRecord, Path};
use crate::math::DVec3;
use crate::sampling::Sequence;
use crate::scene::Scene;

/// Independent sets of each pixel, and samples in each.
const SETS: u64 = 4;
const SAMPLES: u64 = 8;
/// Most tiles to try.
const TILES: usize = 16;
/// The pilot takes at most one in this many of all samples.
const SHARE: u64 = 16;
/// What a connection costs, in rays of a path: its shadow ray is short, and no bsdf or light is
/// sampled. Between 0.35 and 0.95 in the scenes of this repository.
const CONNECTION: f64 = 0.6;
/// What the efficiency must gain before pixels share their noise.
const WORTH: f64 = 1.1;
/// Makes seeds that no render has.
const ASIDE: u64 = 0x7069_6c6f_7400_0000;

/// What the pilot found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pilot {
    /// Variance without over variance with shared paths.
    pub gain: f64,
    /// Work with over work without.
    pub work: f64,
}

impl Pilot {
    /// Pixels of a group, if there are any.
    pub const GROUP: u32 = 16;

    /// Tries both; nothing where the render is too small for that.
    pub fn run(
        scene: &Scene,
        path: &Path,
        film: &Film,
        samples: u64,
        (seed, sequence): (u64, Sequence),
    ) -> Option<Pilot> {
        let all = film.tiles();
        let each = all.iter().map(|t| t.area() as u64).max()? * SETS * SAMPLES * 2;
        let total = all.iter().map(|t| t.area() as u64).sum::<u64>().saturating_mul(samples);
        let count = ((total / SHARE / each) as usize).min(TILES).min(all.len());
        if count == 0 {
            return None;
        }
        let tiles: Vec<Rect> = (0..count).map(|k| all[(2 * k + 1) * all.len() / (2 * count)]).collect();
        let [alone, shared] = [1, Pilot::GROUP].map(|reuse| {
            let path = Path { reuse, ..*path };
            tiles
                .par_iter()
                .map_init(|| Block::new(scene, &path), |block, tile| Trial::run(block, tile, seed, sequence))
                .reduce(Trial::default, Trial::join)
        });
        let rays = |trial: &Trial| trial.counters.rays() as f64;
        Some(Pilot {
            // Both relative to the better known of the two means.
            gain: alone.noise(&shared) / shared.noise(&shared),
            work: 1.0 + CONNECTION * (rays(&shared) - rays(&alone)) / rays(&alone),
        })
    }

    /// Pixels in a group: what is more efficient.
    pub fn pixels(&self) -> u32 {
        // So written that no number at all is no reason to share.
        if self.gain > WORTH * self.work { Pilot::GROUP } else { 1 }
    }
}

/// Mean and variance of each pixel of some tiles.
#[derive(Default)]
struct Trial {
    pixels: Vec<(DVec3, DVec3)>,
    counters: Counters,
}

impl Trial {
    fn run<'s>(block: &mut Block<'s>, tile: &Rect, seed: u64, sequence: Sequence) -> Trial {
        let mut record = NoRecord::default();
        let mut sums = vec![(DVec3::ZERO, DVec3::ZERO); tile.area()];
        block.move_to(tile.min);
        for set in 0..SETS {
            let mut means = vec![DVec3::ZERO; tile.area()];
            for index in 0..SAMPLES {
                let draw = Draw { seed: seed ^ (ASIDE + set), index, sequence, layers: false };
                block.sample(&draw, &mut record);
                for (mean, pixel) in means.iter_mut().zip(tile.pixels()) {
                    *mean += block.of(pixel).0.rgb.as_dvec3() / SAMPLES as f64;
                }
            }
            for (sum, mean) in sums.iter_mut().zip(means) {
                *sum = (sum.0 + mean, sum.1 + mean * mean);
            }
        }
        let n = SETS as f64;
        let moments = |(sum, squares): &(DVec3, DVec3)| {
            let mean = *sum / n;
            (mean, (*squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0))
        };
        Trial { pixels: sums.iter().map(moments).collect(), counters: record.0 }
    }

    fn join(mut self, other: Trial) -> Trial {
        self.pixels.extend(other.pixels);
        self.counters.add(&other.counters);
        self
    }

    /// Mean relative variance, with the means of `known`.
    fn noise(&self, known: &Trial) -> f64 {
        let count = self.pixels.len() as f64;
        let mean = known.pixels.iter().map(|(mean, _)| mean.element_sum() / 3.0).sum::<f64>() / count;
        let floor = DVec3::splat(0.01 * mean * mean);
        let mut terms: Vec<f64> = self
            .pixels
            .iter()
            .zip(&known.pixels)
            .map(|((_, variance), (mean, _))| (*variance / (*mean * *mean + floor)).element_sum())
            .filter(|term| term.is_finite())
            .collect();
        terms.sort_unstable_by(f64::total_cmp);
        terms.truncate(terms.len() - terms.len() / 100);
        terms.iter().sum::<f64>() / terms.len() as f64
    }
}
