//! Reconstruction filters: the `rfilter` plugins of Mitsuba 3, with its
//! parameters, defaults and formulas.
//!
//! All are separable, w(x, y) = f(x)·f(y), and not normalised: the film
//! divides by the sum of weights.
//!
//! | plugin | parameters (default) | f(x) | radius |
//! |-|-|-|-|
//! | `box` | | 1 | 1/2 |
//! | `tent` | `radius` (1) | 1 − \|x\|/radius | `radius` |
//! | `gaussian` | `stddev` σ (0.5) | exp(−x²/2σ²) − exp(−8) | 4σ |
//! | `mitchell` | `B` (1/3), `C` (1/3) | the cubic of Mitchell and Netravali 1988, equation 8 | 2 |
//! | `catmullrom` | | the same with B = 0, C = 1/2 | 2 |
//! | `lanczos` | `lobes` n (3) | sinc(x)·sinc(x/n) | n |
//!
//! Mitsuba 3's CPU variants replace the Gaussian by a polynomial that is off
//! by up to 7.4e-4 of its peak; ours is the formula itself.
//!
//! ```xml
//! <rfilter type="gaussian"><float name="stddev" value="0.5"/></rfilter>
//! ```

use crate::desc::{ObjectId, Result, SceneDesc};

/// The largest radius accepted, in pixels.
const MAX_RADIUS: f64 = 16.0;

/// Most pixels that a filter covers along an axis.
pub(super) const MAX_TAPS: usize = 2 * MAX_RADIUS as usize + 1;

/// A reconstruction filter. Distances are in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// 1 within the pixel.
    Box,
    /// A triangle.
    Tent {
        /// Half its base.
        radius: f64,
    },
    /// A Gaussian cut off at 4 standard deviations.
    Gaussian {
        /// Standard deviation.
        stddev: f64,
    },
    /// The cubic family of Mitchell and Netravali; has negative lobes.
    Mitchell {
        /// Blur.
        b: f64,
        /// Ringing.
        c: f64,
    },
    /// The interpolating member of that family.
    CatmullRom,
    /// A windowed sinc; has negative lobes.
    Lanczos {
        /// Lobes on each side.
        lobes: u32,
    },
}

impl Default for Filter {
    /// What Mitsuba takes for a film without an `rfilter`.
    fn default() -> Self {
        Filter::Gaussian { stddev: 0.5 }
    }
}

impl Filter {
    /// Names of the filters in scene files.
    pub const NAMES: &'static [&'static str] =
        &["box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"];

    /// Reads an `rfilter` object. Fails on unknown plugins and parameters, and
    /// on a radius that is not above 0 or is beyond 16 pixels.
    pub fn from_desc(scene: &SceneDesc, id: ObjectId) -> Result<Filter> {
        let params = scene.params(id);
        let plugin = params.object().plugin.as_str();
        let filter = match plugin {
            "box" => Filter::Box,
            "tent" => Filter::Tent { radius: params.float("radius", 1.0)? },
            "gaussian" => Filter::Gaussian { stddev: params.float("stddev", 0.5)? },
            "mitchell" => {
                Filter::Mitchell { b: params.float("B", 1.0 / 3.0)?, c: params.float("C", 1.0 / 3.0)? }
            }
            "catmullrom" => Filter::CatmullRom,
            "lanczos" => {
                let lobes = params.int("lobes", 3)?;
                let lobes = u32::try_from(lobes).ok().filter(|n| *n > 0).ok_or_else(|| {
                    params.error_at("lobes", format!("`lobes` must be at least 1, found {lobes}"))
                })?;
                Filter::Lanczos { lobes }
            }
            _ => {
                return Err(params
                    .error(format!("no reconstruction filter is called `{plugin}`"))
                    .suggest(plugin, Filter::NAMES.iter().copied()));
            }
        };
        if !(filter.radius() > 0.0 && filter.radius() <= MAX_RADIUS) {
            return Err(params.error(format!(
                "the radius of `{plugin}` must be above 0 and at most {MAX_RADIUS} pixels, found {}",
                filter.radius()
            )));
        }
        params.finish()?;
        Ok(filter)
    }

    /// The name in scene files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Filter::Box => "box",
            Filter::Tent { .. } => "tent",
            Filter::Gaussian { .. } => "gaussian",
            Filter::Mitchell { .. } => "mitchell",
            Filter::CatmullRom => "catmullrom",
            Filter::Lanczos { .. } => "lanczos",
        }
    }

    /// Half the width of the support, in pixels.
    #[must_use]
    pub fn radius(&self) -> f64 {
        match *self {
            Filter::Box => 0.5,
            Filter::Tent { radius } => radius,
            Filter::Gaussian { stddev } => 4.0 * stddev,
            Filter::Mitchell { .. } | Filter::CatmullRom => 2.0,
            Filter::Lanczos { lobes } => f64::from(lobes),
        }
    }

    /// How many pixels beyond its own a sample can reach: ⌈radius − 1/2⌉.
    #[must_use]
    pub fn reach(&self) -> i32 {
        (self.radius() - 0.5).ceil().max(0.0) as i32
    }

    /// f at a distance of `x` pixels; 0 outside the radius.
    #[must_use]
    pub fn eval(&self, x: f64) -> f64 {
        let x = x.abs();
        if x > self.radius() {
            return 0.0;
        }
        match *self {
            Filter::Box => 1.0,
            Filter::Tent { radius } => 1.0 - x / radius,
            Filter::Gaussian { stddev } => {
                let z = x / stddev;
                ((-0.5 * z * z).exp() - GAUSSIAN_END).max(0.0)
            }
            Filter::Mitchell { b, c } => cubic(x, b, c),
            Filter::CatmullRom => cubic(x, 0.0, 0.5),
            Filter::Lanczos { lobes } => sinc(x) * sinc(x / f64::from(lobes)),
        }
    }

    /// Typical and extreme filters.
    #[must_use]
    pub fn examples() -> Vec<Filter> {
        vec![
            Filter::Box,
            Filter::Tent { radius: 1.0 },
            Filter::Tent { radius: 0.4 },
            Filter::Gaussian { stddev: 0.5 },
            Filter::Gaussian { stddev: 4.0 },
            Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 },
            Filter::CatmullRom,
            Filter::Lanczos { lobes: 3 },
            Filter::Lanczos { lobes: 16 },
        ]
    }

    /// Weights along one axis of a sample at `offset` in [0, 1) of its pixel.
    /// The pixels they are for are counted from the sample's own.
    pub(super) fn taps<'a>(&self, offset: f32, scratch: &'a mut [f64; MAX_TAPS]) -> Taps<'a> {
        if *self == Filter::Box {
            return Taps { first: 0, weights: &[1.0] };
        }
        let place = f64::from(offset) - 0.5;
        let (first, last) = (-floor(self.radius() - place), floor(place + self.radius()));
        // None for a filter narrower than a pixel, between two centres.
        let count = ((last - first + 1).max(0) as usize).min(MAX_TAPS);
        let weights = &mut scratch[..count];
        let start = f64::from(first) - place;
        match *self {
            Filter::Gaussian { stddev } => gaussian_row(start, stddev, weights),
            Filter::Tent { radius } => fill(start, weights, |x| 1.0 - x.abs() / radius),
            _ => fill(start, weights, |x| self.eval(x)),
        }
        Taps { first, weights }
    }
}

#[inline]
fn fill(start: f64, weights: &mut [f64], f: impl Fn(f64) -> f64) {
    for (i, weight) in (0i32..).zip(weights) {
        *weight = f(start + f64::from(i));
    }
}

/// ⌊x⌋ for |x| < 64, without the library call of targets older than SSE4.1.
#[inline]
fn floor(x: f64) -> i32 {
    (x + 64.0) as i32 - 64
}

/// A Gaussian at `start`, `start` + 1, …: each is the one before times a ratio
/// that itself falls by exp(−1/σ²).
#[inline]
fn gaussian_row(start: f64, stddev: f64, weights: &mut [f64]) {
    let inverse = 1.0 / (stddev * stddev);
    let mut value = (-0.5 * start * start * inverse).exp();
    let mut ratio = (-(start + 0.5) * inverse).exp();
    let fall = (-inverse).exp();
    for weight in weights {
        *weight = (value - GAUSSIAN_END).max(0.0);
        value *= ratio;
        ratio *= fall;
    }
}

/// exp(−8): what a Gaussian has left at four standard deviations.
const GAUSSIAN_END: f64 = 3.354_626_279_025_118_5e-4;

/// Weights of consecutive pixels along one axis.
pub(super) struct Taps<'a> {
    /// The first pixel, relative to the sample's own.
    pub first: i32,
    /// The weights.
    pub weights: &'a [f64],
}

/// Mitchell and Netravali 1988, "Reconstruction Filters in Computer Graphics",
/// equation 8; 0 ≤ x ≤ 2.
fn cubic(x: f64, b: f64, c: f64) -> f64 {
    let sum = if x < 1.0 {
        ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + (6.0 - 2.0 * b)
    } else {
        (((-b - 6.0 * c) * x + (6.0 * b + 30.0 * c)) * x - (12.0 * b + 48.0 * c)) * x + (8.0 * b + 24.0 * c)
    };
    sum / 6.0
}

/// sin(πx) / πx.
fn sinc(x: f64) -> f64 {
    let y = std::f64::consts::PI * x;
    // Below this the next term of the series is under half an ulp of 1.
    if y.abs() < 1e-8 { 1.0 } else { y.sin() / y }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of weights is the filter at the pixels' distances, and all of it.
    #[test]
    fn rows_are_the_filter() {
        assert_eq!(GAUSSIAN_END, (-8.0f64).exp());
        for filter in Filter::examples() {
            for offset in [0.0f32, 0.1, 0.25, 0.5, 0.75, 0.999_999] {
                let mut scratch = [0.0; MAX_TAPS];
                let taps = filter.taps(offset, &mut scratch);
                let place = f64::from(offset) - 0.5;
                for k in -20..=20i32 {
                    let found = usize::try_from(k - taps.first).ok().and_then(|i| taps.weights.get(i));
                    let expected = if filter == Filter::Box {
                        f64::from(u8::from(k == 0))
                    } else {
                        filter.eval(f64::from(k) - place)
                    };
                    let difference = found.copied().unwrap_or(0.0) - expected;
                    assert!(difference.abs() < 1e-14, "{filter:?} at {offset}, pixel {k}: {difference}");
                }
            }
        }
    }

    #[test]
    fn known_values() {
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        let gaussian = Filter::default();
        near(gaussian.eval(0.0), 1.0 - (-8f64).exp());
        near(gaussian.eval(-0.5), (-0.5f64).exp() - (-8f64).exp());
        near(gaussian.eval(2.0), 0.0);
        near(Filter::Tent { radius: 1.0 }.eval(0.25), 0.75);
        let mitchell = Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 };
        near(mitchell.eval(0.0), 8.0 / 9.0);
        near(mitchell.eval(1.0), 1.0 / 18.0);
        near(mitchell.eval(2.0), 0.0);
        near(Filter::CatmullRom.eval(0.0), 1.0);
        near(Filter::CatmullRom.eval(1.0), 0.0);
        near(Filter::CatmullRom.eval(1.5), -0.0625);
        near(Filter::Lanczos { lobes: 3 }.eval(0.0), 1.0);
        near(Filter::Lanczos { lobes: 3 }.eval(1.5), -4.0 / (3.0 * std::f64::consts::PI.powi(2)));
    }

    #[test]
    fn taps_cover_the_support() {
        for filter in Filter::examples() {
            for offset in [0.0, 0.1, 0.5, 0.75, crate::math::ONE_MINUS_EPSILON] {
                let mut scratch = [0.0; MAX_TAPS];
                let taps = filter.taps(offset, &mut scratch);
                let reach = filter.reach();
                assert!(
                    taps.first >= -reach && taps.first + taps.weights.len() as i32 - 1 <= reach,
                    "{filter:?}"
                );
                let all: f64 = (-20..=20).map(|k| filter.eval(f64::from(k) + 0.5 - f64::from(offset))).sum();
                let sum: f64 = taps.weights.iter().sum();
                let sum_all = if filter == Filter::Box { 1.0 } else { all };
                assert!((sum - sum_all).abs() < 1e-12, "{filter:?} at {offset}: {sum} {sum_all}");
            }
        }
    }

    #[test]
    fn reach_is_that_of_the_radius() {
        let reach: Vec<i32> = Filter::examples().iter().map(Filter::reach).collect();
        assert_eq!(reach, [0, 1, 0, 2, 16, 2, 2, 3, 16]);
    }
}
