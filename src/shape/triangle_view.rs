//! A triangle as seen from a point: nearby the spherical triangle of Arvo
//! 1995, "Stratified Sampling of Spherical Triangles", in the vector form of
//! pbrt-v4 section 6.5.4; far away its area. All in f64: angles come from sines
//! and cosines that share a factor, the solid angle from van Oosterom &
//! Strackee 1983, "The Solid Angle of a Plane Triangle".

use glam::DVec2;

use crate::math::{DVec3, Vec2, Vec3};

/// A triangle as seen from a point: `sample` and `pdf` of
/// [`super::ShapeSampler`] both go through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleView {
    spherical: Option<Spherical>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Spherical {
    /// From the viewer to the vertices, and the same of unit length.
    corners: [DVec3; 3],
    units: [DVec3; 3],
    solid_angle: f64,
}

impl TriangleView {
    /// Solid angles below this (sr), seen from nearby, are edge-on: Arvo's
    /// formulas lose their digits there. Above, up to twice that below half a
    /// sphere, they have at least six.
    const MIN_SOLID_ANGLE: f64 = 1e-6;
    const MAX_SOLID_ANGLE: f64 = std::f64::consts::TAU - 2.0 * TriangleView::MIN_SOLID_ANGLE;
    /// Sampling by solid angle pays when the longest edge is longer than this
    /// fraction of the distance.
    const MIN_RATIO: f64 = 1.0;

    /// The view of a triangle from a point.
    #[must_use]
    pub fn new(vertices: &[Vec3; 3], from: Vec3) -> TriangleView {
        let from = from.as_dvec3();
        TriangleView { spherical: TriangleView::spherical(vertices.map(|v| v.as_dvec3() - from)) }
    }

    fn spherical(corners: [DVec3; 3]) -> Option<Spherical> {
        let [a, b, c] = corners;
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let centre = (a + b + c) * (1.0 / 3.0);
        if longest < TriangleView::MIN_RATIO * TriangleView::MIN_RATIO * centre.length_squared() {
            return None;
        }
        let units = [a.try_normalize()?, b.try_normalize()?, c.try_normalize()?];
        let [a, b, c] = units;
        let volume = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        let usable =
            solid_angle > TriangleView::MIN_SOLID_ANGLE && solid_angle < TriangleView::MAX_SOLID_ANGLE;
        usable.then_some(Spherical { corners, units, solid_angle })
    }

    /// Density per solid angle; `None` when points are uniform in area.
    #[must_use]
    pub fn pdf(&self) -> Option<f64> {
        self.spherical.map(|s| 1.0 / s.solid_angle)
    }

    /// Barycentrics of the second and third vertex of a point uniform in solid
    /// angle; `None` when points are to be uniform in area.
    #[must_use]
    pub fn sample(&self, u: Vec2) -> Option<(f32, f32)> {
        let s = self.spherical?;
        Some(s.barycentrics(s.direction(u)))
    }
}

impl Spherical {
    /// A direction uniform in the solid angle: `u.x` cuts off a triangle with
    /// that share of the area by an arc from b to a point of the arc ac, `u.y`
    /// goes along that arc.
    fn direction(&self, u: Vec2) -> DVec3 {
        let [a, b, c] = self.units;
        // cos and sin of the angle at a, which share a factor.
        let (nab, nca) = (a.cross(b), c.cross(a));
        let alpha = DVec2::new(-nab.dot(nca), a.dot(b.cross(c)).abs()).normalize();
        let cos_c = a.dot(b);

        // The point where the arc from b meets ac. s, t: sine and cosine of Â − α.
        let (sin, cos) = (f64::from(u.x) * self.solid_angle).sin_cos();
        let (s, t) = (sin * alpha.x - cos * alpha.y, cos * alpha.x + sin * alpha.y);
        let (p, q) = (t - alpha.x, s + alpha.y * cos_c);
        let along = ((q * t - p * s) * alpha.x - q) / ((q * s + p * t) * alpha.y);
        let along = along.clamp(a.dot(c), 1.0);
        let stop = a * along + across(c, a) * ((1.0 - along) * (1.0 + along)).sqrt();

        let z = 1.0 - f64::from(u.y) * (1.0 - stop.dot(b));
        b * z + across(stop, b) * ((1.0 - z) * (1.0 + z)).max(0.0).sqrt()
    }

    /// Where a direction meets the triangle (Möller & Trumbore 1997).
    fn barycentrics(&self, direction: DVec3) -> (f32, f32) {
        let [a, b, c] = self.corners;
        let (e1, e2) = (b - a, c - a);
        let s1 = direction.cross(e2);
        let det = s1.dot(e1);
        let s2 = e1.cross(a);
        let (b1, b2) = (-a.dot(s1) / det, direction.dot(s2) / det);
        // NaN counts as 0.
        let (b1, b2) = (b1.max(0.0), b2.max(0.0));
        let excess = (b1 + b2).max(1.0);
        ((b1 / excess) as f32, (b2 / excess) as f32)
    }
}

/// The unit vector across `n` in the plane of `n` and `v`; zero along `n`.
fn across(v: DVec3, n: DVec3) -> DVec3 {
    (v - n * v.dot(n)).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octant_is_an_octant() {
        let view = TriangleView::new(&[Vec3::X, Vec3::Y, Vec3::Z], Vec3::ZERO);
        let solid_angle = 1.0 / view.pdf().unwrap();
        assert!((solid_angle - std::f64::consts::FRAC_PI_2).abs() < 1e-15, "{solid_angle}");
        // The corners of the unit square are corners of the triangle.
        let eps = 1.0 - 2f32.powi(-24);
        for (u, expected) in [((0.0, 1.0), (0.0, 0.0)), ((0.0, 0.0), (1.0, 0.0)), ((eps, eps), (0.0, 1.0))] {
            let (b1, b2) = view.sample(Vec2::from(u)).unwrap();
            assert!((b1 - expected.0).abs() < 1e-3 && (b2 - expected.1).abs() < 1e-3, "{u:?}: {b1} {b2}");
        }
    }

    #[test]
    fn far_and_flat_triangles_are_sampled_by_area() {
        let near = [Vec3::X, Vec3::Y, Vec3::Z];
        assert!(TriangleView::new(&near, Vec3::splat(30.0)).pdf().is_none());
        assert!(TriangleView::new(&near, Vec3::new(2.0, -1.0, 0.0)).pdf().is_none());
        assert!(TriangleView::new(&near, Vec3::X).pdf().is_none());
    }
}
