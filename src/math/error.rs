//! Arithmetic that knows its error, after pbrt-v4 section 6.8.

use super::Vec3;

/// Half the distance from 1 to the next f32: the relative rounding error of
/// one operation.
pub const MACHINE_EPSILON: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` roundings: n·ε / (1 − n·ε).
#[must_use]
pub const fn gamma(n: u32) -> f32 {
    let e = n as f32 * MACHINE_EPSILON;
    e / (1.0 - e)
}

/// The next f32 towards +∞.
#[must_use]
pub fn next_up(x: f32) -> f32 {
    x.next_up()
}

/// The next f32 towards −∞.
#[must_use]
pub fn next_down(x: f32) -> f32 {
    x.next_down()
}

/// a·b − c·d with one rounding at the end: the products of f32 are exact in f64.
#[must_use]
pub fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    (f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d)) as f32
}

/// Moves `p` out of its error box along the geometric normal `ng`, to the side
/// that `dir` points to, and rounds outward (pbrt-v4 equation 6.30). `p_error`
/// bounds the absolute error of each coordinate. Homogeneous in scale.
///
/// A sum q that was rounded is moved on by |q|·2⁻²³, between one and two of its
/// units in the last place. Sums so small that this vanishes are exact.
#[must_use]
#[inline]
pub fn offset_origin(p: Vec3, p_error: Vec3, ng: Vec3, dir: Vec3) -> Vec3 {
    let distance = ng.abs().dot(p_error);
    let offset = ng * if dir.dot(ng) < 0.0 { -distance } else { distance };
    let round = |x: f32, o: f32| {
        let q = x + o;
        let outward = q + (q.abs() * f32::EPSILON).copysign(o);
        if o == 0.0 { x } else { outward }
    };
    Vec3::new(round(p.x, offset.x), round(p.y, offset.y), round(p.z, offset.z))
}

/// Real roots t0 ≤ t1 of a·t² + b·t + c in the form that does not cancel
/// (pbrt-v4 section 6.2.1); `None` when there are none or a = b = 0.
#[must_use]
pub fn solve_quadratic(a: f64, b: f64, c: f64) -> Option<(f64, f64)> {
    if a == 0.0 {
        return (b != 0.0).then(|| (-c / b, -c / b));
    }
    let discriminant = b * b - 4.0 * a * c;
    if !(discriminant >= 0.0) {
        return None;
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (q / a, c / q) };
    Some((t0.min(t1), t0.max(t1)))
}

/// Angle between two unit vectors in radians, exact near 0 and π (Kahan).
#[must_use]
pub fn angle_between(a: Vec3, b: Vec3) -> f32 {
    2.0 * (a - b).length().atan2((a + b).length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_leaves_the_error_box_at_every_scale() {
        for k in [-40, -10, 0, 10, 40] {
            let s = 2.0f32.powi(k);
            let p = Vec3::new(0.3, -0.7, 0.2) * s;
            let e = p.abs() * gamma(7);
            let n = Vec3::new(0.6, 0.0, 0.8);
            let q = offset_origin(p, e, n, n);
            assert!((q - p).dot(n) >= n.abs().dot(e), "scale {s}");
            let unit = offset_origin(p / s, e / s, n, n);
            assert_eq!(unit * s, q, "homogeneous in powers of two");
        }
    }

    #[test]
    fn quadratic_roots_do_not_cancel() {
        let (t0, t1) = solve_quadratic(1.0, -1e8, 1.0).unwrap();
        assert!((t0 - 1e-8).abs() < 1e-16 && (t1 - 1e8).abs() < 1e-4);
        assert!(solve_quadratic(1.0, 0.0, 1.0).is_none());
        assert_eq!(solve_quadratic(0.0, 0.0, 1.0), None);
        assert!(solve_quadratic(f64::NAN, 1.0, 1.0).is_none());
    }
}
