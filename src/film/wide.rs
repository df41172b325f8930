//! Integers of 256 bits: sums that cannot overflow.

/// `low` + `carry`·2^128. Addition is associative and exact up to 2^254.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Wide {
    pub low: i128,
    pub carry: i128,
}

/// 2^128.
const CARRY: f64 = (1u128 << 127) as f64 * 2.0;

/// Below this a float is an i128 for sure.
const SMALL: f64 = (1u128 << 126) as f64;

impl Wide {
    /// The nearest integer, exactly; for |x| < 2^254 (more is held there, and
    /// what is not a number is 0).
    #[inline]
    pub fn rounded(x: f64) -> Wide {
        if x.abs() < SMALL {
            return Wide { low: x.round_ties_even() as i128, carry: 0 };
        }
        // A float of that size is an integer, and so is what the multiple of
        // 2^128 leaves of it.
        let carry = (x / CARRY).round();
        Wide { low: (x - carry * CARRY) as i128, carry: carry as i128 }
    }

    /// The sum.
    pub fn plus(self, other: Wide) -> Wide {
        let (low, over) = self.low.overflowing_add(other.low);
        let more = i128::from(over) * if other.low < 0 { -1 } else { 1 };
        Wide { low, carry: self.carry.saturating_add(other.carry).saturating_add(more) }
    }

    /// The nearest float, or its neighbour.
    pub fn to_f64(self) -> f64 {
        if self.carry == 0 {
            return self.low as f64;
        }
        self.carry as f64 * CARRY + self.low as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_become_integers_and_come_back() {
        let two = |n: i32| 2f64.powi(n);
        for x in [
            0.0,
            1.0,
            -3.0,
            1e30,
            two(125),
            -two(126),
            two(127),
            1.5 * two(128),
            -1.75 * two(130),
            two(180),
            -1.25 * two(250),
        ] {
            assert_eq!(Wide::rounded(x).to_f64(), x, "{x}");
        }
        assert_eq!(Wide::rounded(2.5), Wide { low: 2, carry: 0 });
        assert_eq!(Wide::rounded(f64::NAN), Wide::default());
    }

    #[test]
    fn sums_go_beyond_128_bits_and_back() {
        let step = Wide::rounded(2f64.powi(126) + 2f64.powi(80));
        let back = Wide::rounded(-(2f64.powi(126) + 2f64.powi(80)));
        let mut sum = Wide { low: 7, carry: 0 };
        for _ in 0..1000 {
            sum = sum.plus(step);
        }
        assert_eq!(sum.carry, 250);
        assert!((sum.to_f64() / (1000.0 * 2f64.powi(126)) - 1.0).abs() < 1e-12);
        for _ in 0..2000 {
            sum = sum.plus(back);
        }
        assert!(sum.carry < 0 && sum.to_f64() < 0.0);
        for _ in 0..1000 {
            sum = sum.plus(step);
        }
        assert_eq!(sum, Wide { low: 7, carry: 0 });
    }
}
