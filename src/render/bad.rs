//! The ledger of bad samples: what was left out of a picture, why and where.
//!
//! A sample is bad when what its path found is no radiance: not a number,
//! infinite or negative; when a layer of it is not finite; or when it is larger
//! than the film can sum. Then all of it is left out, so that a pixel stays a
//! mean of good samples, and counted by its cause. A path whose throughput
//! stops being finite ends there and is bad as a whole: nobody knows what it
//! would have found. A path that ends because nothing is left of it (absorbed,
//! a density or a weight of zero, light from an edge-on surface) is none of
//! this: what it did not find is zero.

use serde_json::{Value, json};

use crate::film::PixelSample;
use crate::math::Rgb;

/// Why a sample was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// Not a number in one of its channels.
    Nan,
    /// Infinite.
    Infinite,
    /// Negative.
    Negative,
    /// A good colour with a layer that is not finite.
    Layer,
    /// Too large for the film's sums.
    Overflow,
}

impl Cause {
    /// All of them; the order of [`BadSamples::counts`].
    pub const ALL: [Cause; 5] = [Cause::Nan, Cause::Infinite, Cause::Negative, Cause::Layer, Cause::Overflow];

    /// For messages, headers and statistics.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Cause::Nan => "NaN",
            Cause::Infinite => "infinite",
            Cause::Negative => "negative",
            Cause::Layer => "layer",
            Cause::Overflow => "overflow",
        }
    }

    /// What is wrong with a sample that a film is to sum which takes radiance
    /// up to `largest` and has `layers` that the first hit decides; `None` when
    /// it is good.
    #[inline]
    #[must_use]
    pub fn of(sample: &PixelSample, largest: f32, layers: bool) -> Option<Cause> {
        let rgb = sample.rgb;
        // What is not a number fails both.
        let in_range = rgb.cmpge(Rgb::ZERO) & rgb.cmple(Rgb::splat(largest));
        if in_range.all() && (!layers || sample.is_valid()) {
            return None;
        }
        Some(Cause::of_bad(sample, largest))
    }

    #[cold]
    fn of_bad(sample: &PixelSample, largest: f32) -> Cause {
        let rgb = sample.rgb;
        if rgb.is_nan() {
            Cause::Nan
        } else if !rgb.is_finite() {
            Cause::Infinite
        } else if rgb.min_element() < 0.0 {
            Cause::Negative
        } else if rgb.max_element() > largest {
            Cause::Overflow
        } else {
            Cause::Layer
        }
    }
}

/// A sample that was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadSample {
    /// Its pixel.
    pub pixel: (i32, i32),
    /// Its index within the pixel.
    pub index: u64,
    /// Why.
    pub cause: Cause,
}

/// Samples left out, counted by cause; the first ten are located.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadSamples {
    /// How many, in the order of [`Cause::ALL`].
    pub counts: [u64; Cause::ALL.len()],
    /// The first ten in the order of sample, row and column.
    pub first: Vec<BadSample>,
}

impl BadSamples {
    const KEPT: usize = 10;

    /// Counts one.
    #[cold]
    pub fn count(&mut self, bad: BadSample) {
        self.counts[bad.cause as usize] += 1;
        self.first.push(bad);
        self.keep_first();
    }

    /// Adds another tile's.
    pub fn add(&mut self, other: &BadSamples) {
        for (count, more) in self.counts.iter_mut().zip(other.counts) {
            *count += more;
        }
        if !other.first.is_empty() {
            self.first.extend(&other.first);
            self.keep_first();
        }
    }

    fn keep_first(&mut self) {
        self.first.sort_unstable_by_key(|bad| (bad.index, bad.pixel.1, bad.pixel.0));
        self.first.truncate(Self::KEPT);
    }

    /// How many of a cause.
    #[must_use]
    pub fn of(&self, cause: Cause) -> u64 {
        self.counts[cause as usize]
    }

    /// All of them.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// For messages and the header: the total, and in brackets every cause.
    #[must_use]
    pub fn summary(&self) -> String {
        let causes = Cause::ALL.map(|cause| format!("{} {}", cause.name(), self.of(cause)));
        format!("{} ({})", self.total(), causes.join(", "))
    }

    /// A line for each that is located.
    #[must_use]
    pub fn places(&self) -> Vec<String> {
        let line = |bad: &BadSample| {
            format!("{},{} sample {}: {}", bad.pixel.0, bad.pixel.1, bad.index, bad.cause.name())
        };
        self.first.iter().map(line).collect()
    }

    /// For the statistics.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let first = |bad: &BadSample| {
            json!({
                "x": bad.pixel.0,
                "y": bad.pixel.1,
                "sample": bad.index,
                "cause": bad.cause.name().to_lowercase(),
            })
        };
        let mut value = json!({
            "total": self.total(),
            "first": self.first.iter().map(first).collect::<Vec<_>>(),
        });
        for cause in Cause::ALL {
            value[cause.name().to_lowercase()] = self.of(cause).into();
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vec2, Vec3};

    #[test]
    fn causes_of_samples() {
        let of = |r: f32, g: f32| {
            Cause::of(&PixelSample { rgb: Rgb::new(r, g, 1.0), ..PixelSample::default() }, 100.0, true)
        };
        assert_eq!(of(0.0, -0.0), None);
        assert_eq!(of(100.0, 1e-45), None);
        assert_eq!(of(f32::NAN, f32::INFINITY), Some(Cause::Nan));
        assert_eq!(of(-1.0, f32::NAN), Some(Cause::Nan));
        assert_eq!(of(-1.0, f32::INFINITY), Some(Cause::Infinite));
        assert_eq!(of(f32::NEG_INFINITY, 0.0), Some(Cause::Infinite));
        assert_eq!(of(-1e-45, 200.0), Some(Cause::Negative));
        assert_eq!(of(0.0, 101.0), Some(Cause::Overflow));
        let good = PixelSample::default();
        for layer in [
            PixelSample { alpha: f32::NAN, ..good },
            PixelSample { albedo: Rgb::INFINITY, ..good },
            PixelSample { normal: Vec3::NAN, ..good },
            PixelSample { position: Vec3::INFINITY, ..good },
            PixelSample { motion: Vec2::NAN, ..good },
            PixelSample { depth: f32::NAN, ..good },
        ] {
            assert_eq!(Cause::of(&layer, 100.0, true), Some(Cause::Layer), "{layer:?}");
            assert_eq!(Cause::of(&layer, 100.0, false), None);
        }
    }

    #[test]
    fn the_first_ten_do_not_depend_on_the_order() {
        let all: Vec<BadSample> = (0..60u64)
            .map(|i| BadSample {
                pixel: ((i * 7 % 13) as i32, (i * 5 % 3) as i32),
                index: i * 11 % 4,
                cause: Cause::ALL[(i % 5) as usize],
            })
            .collect();
        let ledger = |order: &dyn Fn(usize) -> usize, split: usize| {
            let mut parts = vec![BadSamples::default(); split];
            (0..all.len()).for_each(|i| parts[i % split].count(all[order(i)]));
            let mut sum = BadSamples::default();
            parts.iter().for_each(|part| sum.add(part));
            sum
        };
        let straight = ledger(&|i| i, 1);
        assert_eq!((straight.total(), straight.first.len()), (60, 10));
        assert!(straight.first.is_sorted_by_key(|b| (b.index, b.pixel.1, b.pixel.0)));
        for step in [7, 11, 13] {
            for split in [1, 2, 9] {
                assert_eq!(ledger(&|i| i * step % 60, split), straight);
            }
        }
        assert_eq!(straight.summary(), "60 (NaN 12, infinite 12, negative 12, layer 12, overflow 12)");
        assert_eq!(straight.to_json()["nan"], 12);
        assert_eq!(
            straight.places()[0],
            format!(
                "{},{} sample 0: {}",
                straight.first[0].pixel.0,
                straight.first[0].pixel.1,
                straight.first[0].cause.name()
            )
        );
    }
}
