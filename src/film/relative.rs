//! The relative error of the whole picture, and how well it is known.
//!
//! With m the picture's mean, b a pixel's value in a channel without noise and
//! v its variance, the relative error is the root of
//!
//!   T = mean over pixels and channels of v / (b² + m²/100):
//!
//! what relMSE against the true picture is on average
//! (`study::metrics` has the same formula). The second term keeps dark
//! pixels from ruling the figure.
//!
//! v is each pixel's own estimate ([`Groups`](super::Groups)), not pooled, so
//! that no edge of a lamp leaks into the dark beside it; thousands of pixels
//! make up for the single degree of freedom of each. b must not be taken from
//! the noise that it is compared with: a pixel that one firefly has lit is dark
//! and wrong, not bright. So b is the mean of the neighbours, held between the
//! pixel's mean M and M − √v̂ (its lesser half). Measured against the truth:
//! `record/calibration.md`. It is right to a few percent but where fireflies in
//! dark pixels rule the error: there up to a factor of two too small.
//!
//! The terms of pixels are independent but for the filter's overlap, which makes
//! w = Σ ρ² of them share their noise (ρ the correlation of neighbours); where pixels use
//! each other's paths w is as many times larger as a group has pixels, the most it can be. With d
//! degrees of freedom, var v̂ = 2v²/d; so with t the terms and t' the same from
//! pooled variances,
//!
//!   var T̂ / T̂² ≈ 2w/(d·n_eff), n_eff = (Σ t)² / Σ t'·min(t, t')/e
//!
//! with e = 1 − 1/(2√d), which is about the mean of min(t, t')/t' for normal
//! noise (0.52 for d = 1). Squares of t alone would be three times too large for
//! d = 1, those of t' too large beside the edges of lamps; and the minimum keeps
//! down a pixel with a single firefly, whose error is no guess: it is the very
//! difference that was seen.
//!
//! n_eff is the effective number of pixels: where fireflies rule it is their
//! number, and the interval becomes as wide as it must be. The interval is
//! normal in log T: of the error that other seeds would have on average. What no
//! sample has seen yet is not in it.

use super::sums::Film;
use super::{FilmSpec, Filter};

/// The relative error of a picture; see [`Film::relative`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeError {
    /// The estimate.
    pub value: f64,
    /// Standard error of its logarithm.
    pub log_error: f64,
    /// Effective number of pixels that it rests on.
    pub effective_pixels: f64,
}

impl RelativeError {
    /// The value at `z` standard errors: `at(2.0)` is an upper bound.
    #[must_use]
    pub fn at(&self, z: f64) -> f64 {
        if self.value > 0.0 && self.value.is_finite() {
            self.value * (z * self.log_error).exp()
        } else {
            self.value
        }
    }

    /// The interval that holds the truth with a probability of 95 %.
    #[must_use]
    pub fn interval(&self) -> [f64; 2] {
        [self.at(-1.96), self.at(1.96)]
    }
}

/// A channel of a pixel.
struct Value {
    /// Variance from the pixel alone.
    own: f64,
    /// Variance pooled with the neighbours.
    pooled: f64,
    /// Square of what it would be without noise.
    square: f64,
}

impl Film {
    /// The relative error of the whole picture: the root of the mean over
    /// pixels and channels of variance / (value² + mean²/100), with mean that
    /// of the picture.
    ///
    /// 0 for a black picture; infinite while there are pixels without samples.
    /// Reads the whole film: call it once per pass, not per tile.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        self.relative().value
    }

    /// [`Film::relative_error`] with its own uncertainty.
    #[must_use]
    pub fn relative(&self) -> RelativeError {
        let count = self.spec().window().area() as f64;
        let mut total = 0.0;
        let mut pixels = Vec::with_capacity(self.spec().window().area());
        self.scan(|means, estimates| {
            for (mean, e) in means.iter().zip(estimates) {
                total += mean.iter().sum::<f64>() / 3.0;
                pixels.push([0, 1, 2].map(|k| Value {
                    own: e.own[k],
                    pooled: e.variance[k],
                    square: e.around[k].min(mean[k]).max(mean[k] - e.own[k].sqrt()).powi(2),
                }));
            }
        });
        let floor = 0.01 * (total / count).powi(2);
        let ratio = |v: f64, value: &Value| if v > 0.0 { v / (value.square + floor) } else { 0.0 };
        let (mut sum, mut squares) = (0.0, 0.0);
        for pixel in &pixels {
            let own = pixel.iter().map(|v| ratio(v.own, v)).sum::<f64>() / 3.0;
            let pooled = pixel.iter().map(|v| ratio(v.pooled, v)).sum::<f64>() / 3.0;
            sum += own;
            squares += pooled * own.min(pooled);
        }
        let degrees = self.layout.groups.degrees();
        squares /= 1.0 - 0.5 / degrees.sqrt();
        let effective = if squares > 0.0 { sum * sum / squares } else { count };
        let spread = (2.0 * self.sharing * overlap(self.spec()) / (degrees * effective)).sqrt();
        RelativeError {
            value: (sum / count).sqrt(),
            // Half of that of T, whose root the value is.
            log_error: 0.5 * spread,
            effective_pixels: effective,
        }
    }
}

/// The number of pixels that share their noise: Σ ρ² over all neighbours, with
/// ρ(k) = ∫ f(x) f(x + k) dx / ∫ f² along each axis.
fn overlap(spec: &FilmSpec) -> f64 {
    if spec.filter == Filter::Box {
        return 1.0;
    }
    const STEPS: i32 = 64;
    let reach = spec.filter.reach() + 1;
    let product = |k: i32| -> f64 {
        (-reach * STEPS..reach * STEPS)
            .map(|i| {
                let x = (f64::from(i) + 0.5) / f64::from(STEPS);
                spec.filter.eval(x) * spec.filter.eval(x + f64::from(k))
            })
            .sum()
    };
    let own = product(0);
    let axis: f64 = (-2 * reach..=2 * reach).map(|k| (product(k) / own).powi(2)).sum();
    axis * axis
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_of_known_filters() {
        let of = |filter| overlap(&FilmSpec::new(1, 1, filter));
        assert_eq!(of(Filter::Box), 1.0);
        // ρ(±1) = 1/4.
        assert!((of(Filter::Tent { radius: 1.0 }) - 1.125_f64.powi(2)).abs() < 1e-3);
        assert!((1.5..1.8).contains(&of(Filter::Gaussian { stddev: 0.5 })));
    }

    #[test]
    fn an_interval_widens_with_few_pixels() {
        let of = |log_error| RelativeError { value: 0.01, log_error, effective_pixels: 1.0 };
        assert!((of(0.1).at(2.0) - 0.01 * 0.2_f64.exp()).abs() < 1e-12);
        assert!(of(0.5).interval()[1] > 0.02);
        assert_eq!(RelativeError { value: f64::INFINITY, ..of(0.1) }.interval(), [f64::INFINITY; 2]);
        assert_eq!(RelativeError { value: 0.0, ..of(0.1) }.interval(), [0.0; 2]);
    }
}
