//! The normal distribution's tails and Šidák's correction; quartiles and
//! bootstrap intervals.

use std::f64::consts::{PI, SQRT_2};

/// Probability that a standard normal value lies outside ±z. Accurate to
/// about 1e-14 relative, down to the smallest f64.
pub(super) fn two_sided_p(z: f64) -> f64 {
    erfc(z.abs() / SQRT_2)
}

/// The probability that each of `count` independent tests may have for all
/// together to have `alpha`: 1 − (1 − alpha)^(1/n), without cancellation.
pub fn sidak_level(alpha: f64, count: usize) -> f64 {
    -((-alpha).ln_1p() / count.max(1) as f64).exp_m1()
}

/// The z that `count` independent standard normal values stay within with
/// probability 1 − alpha (Šidák 1967): two-sided, for alpha in (0, 1).
pub(super) fn sidak_threshold(alpha: f64, count: usize) -> f64 {
    let single = sidak_level(alpha, count);
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if two_sided_p(middle) > single {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The normal deviate with the tail probability of Student's t with `freedom`
/// degrees of freedom: Wallace 1959, equation 3.4, within 0.5 % from 8 degrees
/// on at all t that matter. `freedom` may be infinite.
pub(super) fn normal_deviate(t: f64, freedom: f64) -> f64 {
    if !freedom.is_finite() || !t.is_finite() {
        return t;
    }
    let shrink = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    (shrink * (freedom * (t * t / freedom).ln_1p()).sqrt()).copysign(t)
}

/// Probability that |t| is exceeded under Student's distribution with
/// `freedom` degrees of freedom: I_x(ν/2, 1/2) at x = ν/(ν + t²) (Abramowitz and
/// Stegun 26.5.27, 26.7.1). Normal for infinite `freedom`.
pub(super) fn student_p(t: f64, freedom: f64) -> f64 {
    if t.is_nan() || freedom.is_nan() {
        return f64::NAN;
    }
    if t.is_infinite() {
        return 0.0;
    }
    // Beyond a million the two differ by less than 1e-6.
    if freedom > 1e6 {
        return two_sided_p(t);
    }
    incomplete_beta(freedom / (freedom + t * t), 0.5 * freedom, 0.5)
}

/// The t below which Student's distribution has probability `p` in (½, 1).
pub fn student_quantile(p: f64, freedom: f64) -> f64 {
    let outside = 2.0 * (1.0 - p);
    let mut high = 1.0;
    while student_p(high, freedom) > outside && high < 1e12 {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if student_p(middle, freedom) > outside {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Regularised incomplete beta function I_x(a, b): continued fraction of
/// Abramowitz and Stegun 26.5.8 by Lentz's method.
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    // It converges fast below the mean, and the complement is as good.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (a * x.ln() + b * (-x).ln_1p() - ln_beta(a, b)).exp() / a;
    let tiny = 1e-300;
    let (mut c, mut d, mut f) = (1.0, 0.0, 1.0);
    for i in 0..500 {
        let m = f64::from(i / 2);
        let term = if i == 0 {
            1.0
        } else if i % 2 == 0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        d = 1.0 / nonzero(1.0 + term * d, tiny);
        c = nonzero(1.0 + term / c, tiny);
        f *= c * d;
        if (c * d - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * (f - 1.0)
}

fn nonzero(x: f64, tiny: f64) -> f64 {
    if x.abs() < tiny { tiny } else { x }
}

fn ln_beta(a: f64, b: f64) -> f64 {
    ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b)
}

/// Logarithm of the gamma function for x > 0: Stirling's series (Abramowitz
/// and Stegun 6.1.41) above 12, recurrence below; about 1e-12 relative.
fn ln_gamma(x: f64) -> f64 {
    if x < 12.0 {
        return ln_gamma(x + 1.0) - x.ln();
    }
    let series =
        (1.0 / 12.0 - (1.0 / 360.0 - (1.0 / 1260.0 - 1.0 / (1680.0 * x * x)) / (x * x)) / (x * x)) / x;
    (x - 0.5) * x.ln() - x + 0.5 * (2.0 * PI).ln() + series
}

/// The quantile `q` in [0, 1] of sorted values, linear between them (type 7 of
/// Hyndman and Fan 1996); NaN for none.
pub(super) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = q * last as f64;
    let low = (at as usize).min(last);
    let high = (low + 1).min(last);
    sorted[low] + (sorted[high] - sorted[low]) * (at - low as f64)
}

/// Lower quartile, median and upper quartile.
pub(super) fn quartiles(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|q| quantile(&sorted, q))
}

/// Geometric mean of the medians of several samples, and the interval that
/// holds it with probability 95 %: percentile bootstrap, every sample drawn
/// anew from itself (Efron and Tibshirani 1993, chapter 13). A function of the
/// values alone.
pub(super) fn median_interval(samples: &[&[f64]]) -> [f64; 3] {
    const DRAWS: usize = 2000;
    let mut state = 0x853c_49e6_748f_ea9b_u64;
    let mut below = |n: usize| {
        // Knuth's MMIX generator; its upper bits.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (((state >> 32) * n as u64) >> 32) as usize
    };
    let mean = |medians: &mut dyn Iterator<Item = f64>| {
        (medians.map(f64::ln).sum::<f64>() / samples.len() as f64).exp()
    };
    let value = mean(&mut samples.iter().map(|s| quartiles(s)[1]));
    let mut draws: Vec<f64> = (0..DRAWS)
        .map(|_| {
            mean(&mut samples.iter().map(|s| {
                let drawn: Vec<f64> = s.iter().map(|_| s[below(s.len())]).collect();
                quartiles(&drawn)[1]
            }))
        })
        .collect();
    draws.sort_unstable_by(f64::total_cmp);
    [value, quantile(&draws, 0.025), quantile(&draws, 0.975)]
}

/// Complementary error function for x ≥ 0: a Taylor series near 0, Laplace's
/// continued fraction (Abramowitz and Stegun 7.1.5, 7.1.14) beyond.
fn erfc(x: f64) -> f64 {
    if x < 2.5 {
        let (mut term, mut sum) = (x, x);
        for n in 1..100 {
            term *= -x * x / f64::from(n);
            sum += term / f64::from(2 * n + 1);
        }
        return 1.0 - 2.0 / PI.sqrt() * sum;
    }
    let mut fraction = x;
    for k in (1..=120).rev() {
        fraction = x + 0.5 * f64::from(k) / fraction;
    }
    (-x * x).exp() / (PI.sqrt() * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_tails_match_published_values() {
        // Two-sided 0.1 % points of Student's t, from standard tables: z = 3.2905.
        for (t, freedom) in [(4.0728, 15.0), (3.6460, 30.0), (3.4602, 60.0), (5.0413, 8.0)] {
            let z = normal_deviate(t, freedom);
            assert!((z - 3.2905).abs() < 0.02, "{t} at {freedom}: {z}");
            assert_eq!(normal_deviate(-t, freedom), -z);
        }
        assert_eq!(normal_deviate(2.5, f64::INFINITY), 2.5);
    }

    #[test]
    fn student_quantiles_match_published_values() {
        // 97.5 % points, from standard tables.
        let points = [
            (1.0, 12.706_204_736),
            (2.0, 4.302_652_730),
            (3.0, 3.182_446_305),
            (7.0, 2.364_624_252),
            (30.0, 2.042_272_456),
            (1000.0, 1.962_339_081),
            (f64::INFINITY, 1.959_963_985),
        ];
        for (freedom, t) in points {
            assert!((student_quantile(0.975, freedom) / t - 1.0).abs() < 1e-8, "{freedom}");
            assert!((student_p(t, freedom) - 0.05).abs() < 1e-9, "{freedom}");
            assert!((student_p(0.0, freedom) - 1.0).abs() < 1e-12);
        }
        assert!((student_p(-50.0, 3.0) - 1.762e-5).abs() < 1e-7);
    }

    #[test]
    fn tails_match_published_values() {
        // Two-sided p of the normal distribution, from standard tables.
        let cases = [
            (0.0, 1.0),
            (1.0, 0.317_310_507_862_914),
            (1.959_963_984_540_054, 0.05),
            (3.0, 2.699_796_063_260_19e-3),
            (5.0, 5.733_031_437_583_88e-7),
            (8.0, 1.244_192_114_854_36e-15),
        ];
        for (z, p) in cases {
            assert!(
                (two_sided_p(z) / p - 1.0).abs() < 1e-11,
                "p({z}) = {:e}, expected {p:e}",
                two_sided_p(z)
            );
        }
    }

    #[test]
    fn quartiles_are_linear_between_values() {
        assert_eq!(quartiles(&[4.0, 1.0, 3.0, 2.0]), [1.75, 2.5, 3.25]);
        assert_eq!(quartiles(&[7.0]), [7.0; 3]);
        assert!(quartiles(&[])[1].is_nan());
    }

    /// The interval holds the true median about as often as it says.
    #[test]
    fn bootstrap_intervals_cover() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let (mut covered, trials) = (0, 200);
        for _ in 0..trials {
            let sample: Vec<f64> = (0..21).map(|_| 1.0 + uniform()).collect();
            let [_, low, high] = median_interval(&[&sample]);
            covered += i32::from(low <= 1.5 && 1.5 <= high);
        }
        assert!((180..=200).contains(&covered), "{covered} of {trials}");
        let [mean, low, high] = median_interval(&[&[2.0; 5], &[8.0; 9]]);
        assert!((mean - 4.0).abs() < 1e-12 && (low - 4.0).abs() < 1e-12 && (high - 4.0).abs() < 1e-12);
    }

    #[test]
    fn threshold_inverts_the_tail() {
        assert!((sidak_threshold(0.05, 1) - 1.959_963_984_540_054).abs() < 1e-9);
        for count in [1, 10, 12_288, 6_220_800] {
            let z = sidak_threshold(0.01, count);
            let all = (-two_sided_p(z)).ln_1p() * count as f64;
            assert!((all.exp() - 0.99).abs() < 1e-9, "{count} values, z {z}");
        }
    }
}
