//! Maps from the unit square to directions and points.
//!
//! A `u` in [0, 1) is a multiple of 2^-24 and stands for the cell above it;
//! where the end 0 would give a degenerate result the middle of the cell is
//! taken instead.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, TAU};

use crate::math::{Vec2, Vec3};

/// Density of [`uniform_sphere`] per solid angle: 1 / 4π.
pub const UNIFORM_SPHERE_PDF: f32 = 0.25 * FRAC_1_PI;

/// A point of the open unit disk, uniform by area (density 1/π), by the map of
/// Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square". Its
/// radius stays below 1.
#[must_use]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let (radius, angle) = concentric_polar(u);
    let (sin, cos) = angle.sin_cos();
    Vec2::new(radius * cos, radius * sin)
}

/// The point of the unit square that [`concentric_disk`] takes to a point of
/// the disk, given in polar coordinates: radius ≥ 0, angle in \[0, 2π\].
#[must_use]
pub fn disk_to_square(radius: f64, angle: f64) -> [f64; 2] {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    // Turned by an eighth: the four sectors are those of the map.
    let sector = ((angle / FRAC_PI_2 + 0.5).floor() as i64).rem_euclid(4);
    let (a, b) = match sector {
        0 => (radius, radius * turned(angle, 0.0) / FRAC_PI_4),
        1 => (radius * (FRAC_PI_2 - angle) / FRAC_PI_4, radius),
        2 => (-radius, -radius * (angle - PI) / FRAC_PI_4),
        _ => (radius * (angle - 1.5 * PI) / FRAC_PI_4, -radius),
    };
    [0.5 * (a + 1.0), 0.5 * (b + 1.0)].map(|c| c.clamp(0.0, 1.0))
}

/// An angle less `zero`, in [-π, π).
fn turned(angle: f64, zero: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle - zero + PI).rem_euclid(TAU) - PI
}

/// Polar coordinates of the concentric map: signed radius in (-1, 1), angle.
fn concentric_polar(u: Vec2) -> (f32, f32) {
    // 2u - 1 at the middle of the cell: symmetric, never ±1.
    let half_cell = f32::EPSILON / 2.0;
    let (a, b) = (2.0 * u.x - 1.0 + half_cell, 2.0 * u.y - 1.0 + half_cell);
    if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else {
        (b, FRAC_PI_2 - FRAC_PI_4 * (a / b))
    }
}

/// A unit direction with z > 0, density cos θ / π per solid angle (Malley's
/// method: the disk lifted to the hemisphere).
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let (radius, angle) = concentric_polar(u);
    let (sin, cos) = angle.sin_cos();
    // (1 - r)(1 + r) rather than 1 - r²: no cancellation at the horizon.
    Vec3::new(radius * cos, radius * sin, ((1.0 - radius) * (1.0 + radius)).sqrt())
}

/// Density of [`cosine_hemisphere`] per solid angle; 0 below the horizon.
#[must_use]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// Barycentric coordinates (b0, b1) of a point uniform by area in a triangle,
/// b2 = 1 − b0 − b1 ≥ 0 (Heitz 2019, "A Low-Distortion Map Between Triangle
/// and Square").
#[must_use]
pub fn uniform_triangle(u: Vec2) -> (f32, f32) {
    if u.x < u.y {
        let b0 = 0.5 * u.x;
        (b0, u.y - b0)
    } else {
        let b1 = 0.5 * u.y;
        (u.x - b1, b1)
    }
}

/// The point of the unit square that [`uniform_triangle`] takes to barycentric
/// coordinates.
#[must_use]
pub fn triangle_to_square(b0: f32, b1: f32) -> [f64; 2] {
    let (b0, b1) = (f64::from(b0), f64::from(b1));
    let [x, y] = if b0 < b1 { [2.0 * b0, b0 + b1] } else { [b0 + b1, 2.0 * b1] };
    [x.min(1.0), y.min(1.0)]
}

/// A unit direction, uniform over the sphere: density [`UNIFORM_SPHERE_PDF`].
#[must_use]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let (sin, cos) = (TAU * u.y).sin_cos();
    let r = 2.0 * (u.x * (1.0 - u.x)).sqrt();
    Vec3::new(r * cos, r * sin, 1.0 - 2.0 * u.x)
}

/// A unit direction uniform in the cone around +z whose half angle α is given
/// as 1 − cos α in (0, 2]: this, not the cosine, keeps its digits when the
/// cone is narrow.
#[must_use]
pub fn uniform_cone(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let one_minus_cos = u.x * one_minus_cos_max;
    let (sin, cos) = (TAU * u.y).sin_cos();
    let r = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, 1.0 - one_minus_cos)
}

/// Density of [`uniform_cone`] per solid angle, inside the cone: 1 / (2π (1 −
/// cos α)); infinite for a cone without width.
#[must_use]
pub fn uniform_cone_pdf(one_minus_cos_max: f32) -> f32 {
    1.0 / (TAU * one_minus_cos_max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::ONE_MINUS_EPSILON;

    /// Midpoints of an n × n grid of the unit square, and its corners.
    fn grid(n: u32) -> impl Iterator<Item = Vec2> {
        (0..n * n).map(move |i| Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32)
    }

    const ENDS: [f32; 4] = [0.0, f32::EPSILON / 2.0, 0.5, ONE_MINUS_EPSILON];

    #[test]
    fn corners_give_valid_points() {
        for x in ENDS {
            for y in ENDS {
                let u = Vec2::new(x, y);
                let d = concentric_disk(u);
                assert!(d.length() <= 1.0 + 1e-6);
                let w = cosine_hemisphere(u);
                assert!(w.z > 0.0 && (w.length() - 1.0).abs() < 1e-6, "{u} {w}");
                assert!((uniform_sphere(u).length() - 1.0).abs() < 1e-6);
                for cone in [1e-12, 1e-3, 1.0, 2.0] {
                    assert!((uniform_cone(u, cone).length() - 1.0).abs() < 1e-6);
                }
                let (b0, b1) = uniform_triangle(u);
                assert!(b0 >= 0.0 && b1 >= 0.0 && b0 + b1 <= 1.0);
            }
        }
    }

    #[test]
    fn inverses_lead_back() {
        for u in grid(31).chain(grid(64)) {
            let d = concentric_disk(u).as_dvec2();
            let mut angle = d.y.atan2(d.x);
            if angle < 0.0 {
                angle += std::f64::consts::TAU;
            }
            let back = disk_to_square(d.length(), angle);
            assert!(
                (back[0] - f64::from(u.x)).abs() < 1e-6 && (back[1] - f64::from(u.y)).abs() < 1e-6,
                "{u} {back:?}"
            );
            let (b0, b1) = uniform_triangle(u);
            let back = triangle_to_square(b0, b1);
            assert!(
                (back[0] - f64::from(u.x)).abs() < 1e-6 && (back[1] - f64::from(u.y)).abs() < 1e-6,
                "{u} {back:?}"
            );
        }
    }

    #[test]
    fn moments_are_those_of_the_densities() {
        let n = 256;
        let mean = |f: &dyn Fn(Vec2) -> f64| grid(n).map(f).sum::<f64>() / f64::from(n * n);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 3e-4, "{a} {b}");
        near(mean(&|u| f64::from(concentric_disk(u).x)), 0.0);
        near(mean(&|u| f64::from(concentric_disk(u).length_squared())), 0.5);
        near(mean(&|u| f64::from(cosine_hemisphere(u).z)), 2.0 / 3.0);
        near(mean(&|u| f64::from(cosine_hemisphere(u).z.powi(2))), 0.5);
        near(mean(&|u| f64::from(uniform_sphere(u).z.powi(2))), 1.0 / 3.0);
        near(mean(&|u| f64::from(uniform_sphere(u).x.powi(2))), 1.0 / 3.0);
        near(mean(&|u| f64::from(uniform_cone(u, 0.25).z)), 0.875);
        near(mean(&|u| f64::from(uniform_triangle(u).0)), 1.0 / 3.0);
        near(mean(&|u| f64::from(uniform_triangle(u).1).powi(2)), 1.0 / 6.0);
        near(mean(&|u| f64::from(uniform_triangle(u).1 * uniform_triangle(u).0)), 1.0 / 12.0);
    }

    #[test]
    fn narrow_cones_keep_their_width() {
        let tiny = 1e-12f32;
        let mut widest: f32 = 0.0;
        for u in grid(64) {
            widest = widest.max(uniform_cone(u, tiny).truncate().length());
        }
        let expected = (2.0 * tiny).sqrt();
        assert!((widest / expected - 1.0).abs() < 0.01, "{widest} {expected}");
        assert!((uniform_cone_pdf(tiny) * TAU * tiny - 1.0).abs() < 1e-6);
    }
}
