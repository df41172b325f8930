//! Uniform numbers as a pure function of (seed, pixel, sample index, dimension).
//!
//! One randomised Sobol' set per pixel, in the order of the sample index:
//!
//! - the place in the pixel (x, y) and the first light sample (u, v) share the
//!   joint 4D set of Sobol' dimensions 0 … 3, each Owen scrambled with a seed
//!   of its own. The index is not shuffled, so every prefix of 2^k samples is
//!   a (t, k, 4)-net with t ≤ 3;
//! - everything else is padded: each dimension number has its own 2D set,
//!   Sobol' dimensions 0 and 1 with the index shuffled and the values Owen
//!   scrambled (Burley 2020, "Practical Hash-based Owen Scrambling", section
//!   3). The shuffle is itself an Owen scramble of the bit-reversed index, so
//!   aligned blocks of 2^k samples stay such blocks and are (0, k, 2)-nets.
//!
//! Indices are 64 bits wide, the sequence 32: the upper half of the index goes
//! into the seed, so that each block of 2^32 samples is randomised anew. The
//! mean stays right; the convergence beyond 2^32 samples of one pixel falls
//! back to that of independent sets, at an error far below that of f32.
//!
//! That is [`Sequence::Sobol`]; the other sequences are there to be compared
//! with it. They share its interface, its dimensions and its randomisation by
//! (seed, pixel).

use super::sobol::{owen_reversed, sobol_01, sobol_23, unit_float_reversed, unit_floats_reversed};
use crate::math::Vec2;

/// How the samples of a pixel are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sequence {
    /// Owen-scrambled Sobol' points; pixel and first light sample jointly in 4D.
    #[default]
    Sobol,
    /// The same, but pixel and first light sample padded in 2D like all else:
    /// what Cycles and pbrt do.
    Padded,
    /// Additive recurrences (in 1D by the golden ratio, in 2D by the powers of
    /// the plastic number: Roberts 2018, "The unreasonable effectiveness of
    /// quasirandom sequences"), shuffled per dimension and shifted modulo 1
    /// (Cranley and Patterson 1976).
    Lattice,
    /// Independent random numbers: no stratification at all.
    Independent,
}

impl Sequence {
    /// All, the default first.
    pub const ALL: [Sequence; 4] =
        [Sequence::Sobol, Sequence::Padded, Sequence::Lattice, Sequence::Independent];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Sequence::Sobol => "sobol",
            Sequence::Padded => "padded",
            Sequence::Lattice => "lattice",
            Sequence::Independent => "independent",
        }
    }

    /// What it is, for messages.
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            Sequence::Sobol => "Owen-scrambled Sobol",
            Sequence::Padded => "Owen-scrambled Sobol, all of it padded in 2D",
            Sequence::Lattice => "shuffled and shifted lattices",
            Sequence::Independent => "independent random numbers",
        }
    }

    /// The sequence of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Sequence> {
        Sequence::ALL.into_iter().find(|s| s.name() == name)
    }
}

/// The uniform numbers of one sample of one pixel. Copy, without state: asking
/// twice gives the same number twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    key: u64,
    index: u32,
    /// The index with its bits in reverse order: what is shuffled.
    reversed: u32,
    sequence: Sequence,
}

/// Steps of the lattices as fractions of 2^32: 1/φ; 1/p and 1/p² with p³ = p + 1.
const GOLDEN: u32 = 0x9e37_79b9;
const PLASTIC: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da6];

/// Which kind of number a hash is for, so that `get_1d(d)`, `get_2d(d)` and
/// the joint set never share their randomisation.
#[derive(Clone, Copy)]
enum Use {
    Joint = 0,
    OneD = 1,
    TwoD = 2,
    Rank = 3,
}

impl Sampler {
    /// The numbers of sample `index` of `pixel` in the randomisation `seed`.
    #[must_use]
    pub fn new(seed: u64, pixel: (i32, i32), index: u64) -> Sampler {
        let place = (u64::from(pixel.0.cast_unsigned()) << 32) | u64::from(pixel.1.cast_unsigned());
        let key = mix(mix(mix(seed ^ 0x6a09_e667_f3bc_c908) ^ place).wrapping_add(index >> 32));
        let index = index as u32;
        Sampler { key, index, reversed: index.reverse_bits(), sequence: Sequence::Sobol }
    }

    /// The number of the sample in its pixel, modulo 2^32.
    #[must_use]
    #[inline]
    pub fn index(&self) -> u32 {
        self.index
    }

    /// Orders pixels at random, anew for each sample; independent of all numbers that are drawn.
    #[must_use]
    pub fn rank(&self) -> u32 {
        (mix(self.key ^ mix((u64::from(self.index) << 2) | Use::Rank as u64)) >> 32) as u32
    }

    /// The same numbers' place in another sequence.
    #[must_use]
    pub fn with_sequence(self, sequence: Sequence) -> Sampler {
        Sampler { sequence, ..self }
    }

    /// The joint 4D set: place in the pixel and the first light sample, both
    /// in [0, 1)².
    #[must_use]
    pub fn pixel_and_light(&self) -> (Vec2, Vec2) {
        if self.sequence != Sequence::Sobol {
            // Dimensions that nothing else has.
            return (self.get_2d(u32::MAX), self.get_2d(u32::MAX - 1));
        }
        let a = mix(self.key ^ Use::Joint as u64);
        let b = mix(a.wrapping_add(0xd1b5_4a32_d192_ed03));
        (scrambled_2d(sobol_01(self.index), a), scrambled_2d(sobol_23(self.index), b))
    }

    /// A number in [0, 1): stratified over the samples of the pixel,
    /// independent of every other `dimension` and of `get_2d`.
    #[must_use]
    pub fn get_1d(&self, dimension: u32) -> f32 {
        let (a, b) = self.seeds(Use::OneD, dimension);
        if self.sequence == Sequence::Independent {
            return unit_float((self.independent(a) >> 32) as u32);
        }
        let index = owen_reversed(self.reversed, b).reverse_bits();
        if self.sequence == Sequence::Lattice {
            return unit_float(index.wrapping_mul(GOLDEN).wrapping_add(a as u32));
        }
        unit_float_reversed(owen_reversed(index, a as u32))
    }

    /// A point in [0, 1)²: stratified over the samples of the pixel,
    /// independent of every other `dimension` and of `get_1d`.
    #[must_use]
    pub fn get_2d(&self, dimension: u32) -> Vec2 {
        let (a, b) = self.seeds(Use::TwoD, dimension);
        if self.sequence == Sequence::Independent {
            let bits = self.independent(a);
            return Vec2::new(unit_float((bits >> 32) as u32), unit_float(bits as u32));
        }
        let index = owen_reversed(self.reversed, b).reverse_bits();
        if self.sequence == Sequence::Lattice {
            let [x, y] = PLASTIC.map(|step| index.wrapping_mul(step));
            let shifted = [x.wrapping_add(a as u32), y.wrapping_add((a >> 32) as u32)];
            return Vec2::from_array(shifted.map(unit_float));
        }
        scrambled_2d(sobol_01(index), a)
    }

    /// 64 bits that depend on the index in no ordered way.
    fn independent(&self, seed: u64) -> u64 {
        mix(seed ^ mix(u64::from(self.index)))
    }

    /// 96 hashed bits for one use of one dimension: for two values, and for
    /// the shuffle of the index.
    fn seeds(&self, kind: Use, dimension: u32) -> (u64, u32) {
        let name = (u64::from(dimension) << 2) | kind as u64;
        let a = mix(self.key ^ name.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        // The upper half of a product depends on all bits of `a`.
        (a, (a.wrapping_mul(0xd1b5_4a32_d192_ed03) >> 32) as u32)
    }
}

/// Two bit-reversed values, scrambled with the halves of the seed, as floats.
fn scrambled_2d([x, y]: [u32; 2], seed: u64) -> Vec2 {
    let x = owen_reversed(x, seed as u32);
    let y = owen_reversed(y, (seed >> 32) as u32);
    let [x, y] = unit_floats_reversed(x, y);
    Vec2::new(x, y)
}

/// The upper 24 bits as a number in [0, 1).
fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A bijective 64-bit hash: the output function of SplitMix64 (Steele et al.
/// 2014, "Fast Splittable Pseudorandom Number Generators", variant 13 of
/// Stafford's constants).
pub(super) fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_differs_in_half_of_the_bits() {
        let mut sum = 0;
        for i in 0..64 {
            for k in 0..64u64 {
                sum += (mix(k * 0x1234_5677) ^ mix((k * 0x1234_5677) ^ (1 << i))).count_ones();
            }
        }
        let mean = f64::from(sum) / 4096.0;
        assert!((mean - 32.0).abs() < 0.3, "{mean}");
    }
}
