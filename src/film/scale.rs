//! In which units radiance is summed.

/// Orders of magnitude of the radiance that lights give: the brightest and the
/// dimmest of them. Anything but a finite number above 0 stands for 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Of the brightest light: what is far beyond it is left out.
    pub largest: f64,
    /// Of the dimmest light: what it lights alone is still summed exactly.
    pub smallest: f64,
}

/// Largest scale, as a power of two; the smallest is its inverse. Wider than
/// what f32 holds, and its square is an f64.
const SCALE_BITS: f64 = 400.0;

/// By so many bits the dimmest light may be weaker than the brightest before
/// the unit follows it.
const FREE_BITS: f64 = 20.0;

/// By so many bits at most the unit lies below that of the brightest light
/// alone: sums of 2^30 of its largest samples still fit.
const MOST_BITS: f64 = 90.0;

impl From<f64> for Scale {
    /// All lights are as bright.
    fn from(scale: f64) -> Scale {
        Scale { largest: scale, smallest: scale }
    }
}

impl Scale {
    /// `largest` as a power of two.
    pub(super) fn radiance(&self) -> f64 {
        power_of_two(self.largest)
    }

    /// The unit of sums of radiance, a power of two.
    pub(super) fn unit(&self) -> f64 {
        let ratio = self.radiance() / power_of_two(self.smallest);
        self.radiance() * 2f64.powi(-(ratio.log2() - FREE_BITS).clamp(0.0, MOST_BITS) as i32)
    }
}

/// The nearest power of two (geometrically); 1 for what has none.
fn power_of_two(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() {
        2f64.powi(x.log2().round().clamp(-SCALE_BITS, SCALE_BITS) as i32)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_powers_of_two() {
        assert_eq!(power_of_two(1.0), 1.0);
        assert_eq!(power_of_two(1000.0), 1024.0);
        assert_eq!(power_of_two(3e-5), 2f64.powi(-15));
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(power_of_two(bad), 1.0);
        }
    }

    #[test]
    fn the_unit_follows_the_dimmest_light_far_below_the_brightest() {
        let two = |n: i32| 2f64.powi(n);
        let unit =
            |largest: i32, smallest: i32| Scale { largest: two(largest), smallest: two(smallest) }.unit();
        assert_eq!(unit(5, 5), two(5));
        assert_eq!(unit(5, -15), two(5));
        assert_eq!(unit(40, 0), two(20));
        assert_eq!(unit(100, 0), two(20));
        assert_eq!(unit(120, -20), two(30));
        // Scaling all lights by a power of two scales the unit.
        assert_eq!(unit(47, 7), two(27));
        assert_eq!(unit(0, 3), 1.0);
    }
}
