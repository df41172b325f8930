//! A mesh of two triangles that is a rectangle: what modelling programs write
//! for a rectangular lamp. Sampled as one: the square of random numbers stays
//! whole, and the solid angle is that of the rectangle.

use super::view::RectFrame;
use super::{Geometry, Hit, ShapeId};
use crate::math::{DVec3, Vec2, Vec3};

/// Two triangles that make a rectangle.
#[derive(Clone, Debug)]
pub(crate) struct Quad {
    pub frame: RectFrame,
    first_prim: u32,
    /// Which corner each vertex of both triangles is: 0 the origin of the axes,
    /// 1 at the end of x, 2 at the end of y, 3 across.
    corners: [[usize; 3]; 2],
}

impl Quad {
    /// How far the corners may be off, in parts of the diagonal: what rounding
    /// of vertices does. Densities are off by as much.
    const TOLERANCE: f64 = 1e-5;

    /// The quad that a mesh is, if it is one.
    pub fn new(geometry: &Geometry, shape: ShapeId) -> Option<Quad> {
        let info = &geometry.shapes()[shape as usize];
        if info.prim_count != 2 {
            return None;
        }
        let first_prim = info.first_prim;
        let [a, b] = [geometry.triangle(first_prim)?, geometry.triangle(first_prim + 1)?];
        let place = |v: Vec3| v.as_dvec3();
        // The vertex of each triangle that the other has not.
        let apart = |t: &[Vec3; 3], other: &[Vec3; 3]| {
            let mut alone = (0..3).filter(|i| !other.contains(&t[*i]));
            alone.next().filter(|_| alone.next().is_none())
        };
        let (i, j) = (apart(&a, &b)?, apart(&b, &a)?);
        let [origin, end_x, end_y] = [0, 1, 2].map(|k| place(a[(i + k) % 3]));
        let across = place(b[j]);
        let (x, y) = (end_x - origin, end_y - origin);
        let diagonal = (end_x - end_y).length();
        let limit = Quad::TOLERANCE * diagonal;
        let parallelogram = (origin + x + y - across).length() <= limit;
        let square = x.dot(y).abs() <= Quad::TOLERANCE * x.length() * y.length();
        // Both wind the same way round.
        let winding = |t: &[Vec3; 3]| place(t[1] - t[0]).cross(place(t[2] - t[0]));
        let normal: DVec3 = winding(&a);
        if !parallelogram || !square || !(normal.dot(winding(&b)) > 0.0) {
            return None;
        }
        let corner = |v: Vec3| {
            let p = place(v);
            [origin, end_x, end_y].iter().position(|c| *c == p).unwrap_or(3)
        };
        let sign = if info.flip { -1.0 } else { 1.0 };
        let ns = info.normals.is_none().then(|| normal.normalize() * sign);
        let frame = RectFrame::from_edges(origin + 0.5 * (x + y), x, y, ns);
        Some(Quad { frame, first_prim, corners: [a.map(corner), b.map(corner)] })
    }

    /// The point at local coordinates in \[-1, 1\]², as a hit of a triangle.
    pub fn hit(&self, local: [f64; 2]) -> Hit {
        let [a, b] = local.map(|c| 0.5 * (c + 1.0));
        let second = a + b > 1.0;
        let weights = if second { [0.0, 1.0 - b, 1.0 - a, a + b - 1.0] } else { [1.0 - a - b, a, b, 0.0] };
        let [_, u, v] = self.corners[usize::from(second)].map(|corner| weights[corner] as f32);
        Hit { t: 1.0, prim: self.first_prim + u32::from(second), u, v, instance: Hit::NO_INSTANCE }
    }

    /// Local coordinates uniform in area.
    pub fn uniform(u: Vec2) -> [f64; 2] {
        [super::linear::signed(u.x), super::linear::signed(u.y)]
    }
}
