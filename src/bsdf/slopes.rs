//! Slopes of a Gaussian surface as seen from a direction: error functions in
//! single precision and the inversion that samples visible slopes.
//!
//! Along the direction of view, with roughness 1, the visible slope x has the
//! density (cos θ − x·sin θ)₊·exp(−x²) up to a factor, and so the distribution
//! function H(x)/H(cot θ) with
//!
//! H(x) = cos θ·(1 + erf x) + sin θ·exp(−x²)/√π
//!
//! (Heitz and d'Eon 2014; Jakob 2014 in another form). H is inverted by
//! Newton's method on ln H, which is nearly a parabola in the tail, kept inside
//! a bracket. It is homogeneous in (cos, sin): nothing blows up at grazing.

/// 1/√π.
const FRAC_1_SQRT_PI: f32 = 0.564_189_6;

/// exp(x²)·erfc(x) for x ≥ 0, relative error 3e-7: a polynomial in
/// 1/(1 + 0.4·x), fitted to minimise the largest relative error.
pub(super) fn erfcx(x: f32) -> f32 {
    const C: [f32; 9] = [
        0.225_675_87,
        0.225_669_33,
        0.207_846_66,
        0.168_515_95,
        0.141_522_12,
        -0.005_786_35,
        0.169_285_65,
        -0.183_020_06,
        0.050_290_96,
    ];
    let t = 1.0 / (1.0 + 0.4 * x);
    t * C.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

/// 1 + erf x, with small relative error also for x → −∞; `gauss` = exp(−x²).
fn one_plus_erf(x: f32, gauss: f32) -> f32 {
    let tail = gauss * erfcx(x.abs());
    if x < 0.0 { tail } else { 2.0 - tail }
}

/// A slope of density exp(−x²)/√π: erf⁻¹(2u − 1) for `u` in [0, 1).
/// Polynomials in −ln(1 − x²) (the form of Giles 2010), relative error 6e-7.
pub(super) fn normal_slope(u: f32) -> f32 {
    const CENTRE: [f32; 8] = [
        1.501_409_2,
        0.246_641_42,
        -0.004_176_259_6,
        -0.001_254_630_6,
        2.173_365e-4,
        -4.094_397e-6,
        -3.185_948e-6,
        3.156_428_4e-7,
    ];
    const TAIL: [f32; 8] = [
        2.832_977_4,
        1.001_685_8,
        0.009_428_636,
        -0.007_744_477,
        0.005_810_177_4,
        -0.003_345_247_7,
        0.001_136_195_5,
        -1.629_557_7e-4,
    ];
    let x = 2.0 * u - 1.0;
    // 1 − x² = 4u(1 − u); u = 0 counts as half the least step of a sequence.
    let u = u.max(1e-10);
    let w = -(4.0 * u * (1.0 - u)).min(1.0).ln();
    let (coefficients, v) = if w < 5.0 { (CENTRE, w - 2.5) } else { (TAIL, w.sqrt() - 3.0) };
    x * coefficients.iter().rev().fold(0.0, |sum, c| sum * v + c)
}

/// A visible slope along the direction of view with the given cosine ≥ 0 and
/// sine ≥ 0, for roughness 1; rises with `u` in [0, 1), up to cot θ.
pub(super) fn visible_slope(cos: f32, sin: f32, u: f32) -> f32 {
    let h = |x: f32, gauss: f32| cos * one_plus_erf(x, gauss) + sin * gauss * FRAC_1_SQRT_PI;
    let cot = (cos / sin).min(5.0);
    let top = h(cot, (-cot * cot).exp());
    let middle = cos + sin * FRAC_1_SQRT_PI;
    let target = u.max(1e-10) * top;

    // Below 0 the Gaussian bounds H; above, its mirror image or the parabola
    // at cot θ is a guess.
    let (mut low, mut high, mut x);
    if target < middle {
        (low, high) = (-5.0f32, 0.0f32);
        x = -(-(target / middle).ln()).max(0.0).sqrt();
    } else {
        (low, high) = (0.0, cot);
        let rest = (top - target).max(0.0);
        let mirrored = (-(rest / (top - middle).max(1e-30)).max(1e-12).ln()).max(0.0).sqrt();
        let parabola = cot - (rest / (sin * FRAC_1_SQRT_PI).max(1e-30)).sqrt() * (0.5 * cot * cot).exp();
        x = if cot < 1.0 { parabola } else { mirrored };
    }
    x = x.clamp(low, high);

    for _ in 0..10 {
        let gauss = (-x * x).exp();
        let value = h(x, gauss);
        if value > target {
            high = x;
        } else {
            low = x;
        }
        let slope = 2.0 * FRAC_1_SQRT_PI * gauss * (cos - x * sin);
        // Newton on ln H − ln target; halve the bracket when it leaves it.
        let mut next = x - value * (value / target).ln() / slope;
        if !(next >= low && next <= high) {
            next = 0.5 * (low + high);
        }
        let step = (next - x).abs();
        x = next;
        // Newton squares the error: what is left is far below rounding.
        if step < 2e-4 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// erf by its series in f64, 1 beyond 4.
    fn erf(x: f64) -> f64 {
        if x > 4.0 {
            return 1.0;
        }
        let (mut term, mut sum) = (x, x);
        for n in 1..200 {
            term *= -x * x / f64::from(n);
            sum += term / f64::from(2 * n + 1);
        }
        sum * 2.0 / std::f64::consts::PI.sqrt()
    }

    #[test]
    fn error_functions_meet_the_series() {
        for i in -300..=300 {
            let x = i as f32 / 100.0;
            let ours = f64::from(one_plus_erf(x, (-x * x).exp()));
            let exact = 1.0 + erf(f64::from(x));
            assert!((ours - exact).abs() < 1e-6 * exact + 3e-9, "{x}: {ours} {exact}");
        }
        for i in 1..1000 {
            let u = i as f32 / 1000.0;
            let back = 0.5 * (1.0 + erf(f64::from(normal_slope(u))));
            assert!((back - f64::from(u)).abs() < 1e-6, "{u}: {back}");
        }
        assert!(normal_slope(0.0) > -6.0 && normal_slope(0.0) < -4.0);
    }

    #[test]
    fn inversion_inverts() {
        let h = |cos: f64, sin: f64, x: f64| {
            cos * (1.0 + erf(x)) + sin * (-x * x).exp() / std::f64::consts::PI.sqrt()
        };
        for degrees in [0.0f64, 1.0, 20.0, 45.0, 70.0, 85.0, 89.0, 89.99, 90.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let top = h(cos, sin, (cos / sin).min(5.0));
            for i in 1..2000 {
                let u = i as f32 / 2000.0;
                let x = f64::from(visible_slope(cos as f32, sin as f32, u));
                let back = h(cos, sin, x) / top;
                assert!((back - f64::from(u)).abs() < 3e-6, "{degrees}° {u}: {x} {back}");
            }
        }
    }
}
