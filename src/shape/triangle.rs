//! One ray against one triangle: Woop, Benthin, Wald 2013, "Watertight
//! Ray/Triangle Intersection", JCGT 2(1).
//!
//! The vertices are translated and sheared in f32 so that the ray becomes the
//! z axis; the three edge functions are 2×2 determinants whose signs say on
//! which side of each edge the ray passes. Two triangles that share an edge
//! compute the same determinant up to sign from the same f32 numbers, so a ray
//! cannot pass between them as long as the sign is exact. In f32 a determinant
//! that comes out non-zero has the right sign (rounding is monotone), which is
//! enough to reject most triangles; what is left is evaluated in f64, where
//! products of f32 are exact.

use super::RayProbe;
use crate::math::{Bounds, DVec3, Vec3, gamma};

/// Parameter and barycentrics of the second and third vertex, before the hit
/// is confined to the box.
#[inline(always)]
pub fn intersect(probe: &RayProbe, vertices: &[Vec3; 3]) -> Option<(f32, f32, f32)> {
    let s = Vec3::from_array(probe.shear);
    let (a, b, c) = (probe.relative(vertices[0]), probe.relative(vertices[1]), probe.relative(vertices[2]));
    let (ax, ay) = (a.x - s.x * a.z, a.y - s.y * a.z);
    let (bx, by) = (b.x - s.x * b.z, b.y - s.y * b.z);
    let (cx, cy) = (c.x - s.x * c.z, c.y - s.y * c.z);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    exact(s.z, [(ax, ay, a.z), (bx, by, b.z), (cx, cy, c.z)])
}

/// The same from the sheared vertices in f64: exact signs, and no underflow at
/// any scale.
#[inline]
fn exact(scale_z: f32, sheared: [(f32, f32, f32); 3]) -> Option<(f32, f32, f32)> {
    let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] =
        sheared.map(|(x, y, z)| (f64::from(x), f64::from(y), f64::from(z)));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    if !(det.abs() > 0.0) {
        return None;
    }
    let inv = 1.0 / det;
    let t = ((u * az + v * bz + w * cz) * inv * f64::from(scale_z)) as f32;
    (t > 0.0 && t.is_finite()).then_some((t, (v * inv) as f32, (w * inv) as f32))
}

/// The box of a triangle, widened by the rounding of the intersection test: see
/// [`bounds_of`].
#[inline]
pub fn bounds(vertices: &[Vec3; 3]) -> Bounds {
    let [a, b, c] = *vertices;
    bounds_of(Bounds { min: a.min(b).min(c), max: a.max(b).max(c) })
}

/// Relative to the largest coordinate of a box, how far beside it a ray may pass
/// that the intersection test lets hit what is inside.
///
/// The test moves vertices by up to 5 units of rounding (2⁻²⁴) of their distance
/// from the origin, which is at most twice the largest coordinate and the way to
/// the hit; for the way there is [`RayProbe::FAR_SLACK`].
pub const WIDENING: f32 = gamma(8);

/// Widens a box by [`WIDENING`], but not across an axis along which what is
/// inside is flat.
///
/// The parameter at which a ray crosses a plane x = c has a small relative
/// error, all others move the point within the plane: all roundings but that of
/// c - x of the origin can be taken for errors of the other two coordinates. So
/// the box of a wall stays flat, and a ray that leaves it does not meet it.
#[inline]
pub fn bounds_of(bounds: Bounds) -> Bounds {
    let e = bounds.min.abs().max(bounds.max.abs()).max_element() * WIDENING;
    let e = Vec3::select(bounds.min.cmplt(bounds.max), Vec3::splat(e), Vec3::ZERO);
    Bounds { min: bounds.min - e, max: bounds.max + e }
}

/// Widens a box by γ(4) of its largest coordinate, on all sides.
#[inline]
pub fn widen(bounds: Bounds) -> Bounds {
    let e = Vec3::splat(bounds.min.abs().max(bounds.max.abs()).max_element() * gamma(4));
    Bounds { min: bounds.min - e, max: bounds.max + e }
}

/// Twice the area times the unit normal by the winding, in f64.
#[inline]
pub fn cross(vertices: &[Vec3; 3]) -> DVec3 {
    let [a, b, c] = vertices.map(|v| v.as_dvec3());
    (b - a).cross(c - a)
}

/// The point at barycentrics and the bound of its error (pbrt-v4 equation
/// 6.21).
#[inline(always)]
pub fn point([a, b, c]: &[DVec3; 3], [b0, b1, b2]: [f64; 3]) -> (Vec3, Vec3) {
    let terms = [*a * b0, *b * b1, *c * b2];
    let p = terms[0] + terms[1] + terms[2];
    let size = terms[0].abs() + terms[1].abs() + terms[2].abs();
    (p.as_vec3(), size.as_vec3() * gamma(7))
}

/// The same in f32 without a bound: for [`super::Geometry::loose_surface`].
#[inline(always)]
pub fn loose_point([a, b, c]: &[Vec3; 3], [b0, b1, b2]: [f32; 3]) -> Vec3 {
    *a * b0 + *b * b1 + *c * b2
}
