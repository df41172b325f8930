//! A mesh of two triangles that is a rectangle: what modelling programs write
//! for a rectangular lamp. Sampled as one: the square of random numbers stays
//! whole, and the solid angle is that of the rectangle.

use super::view::RectFrame;
use super::{Geometry, Hit, ShapeId, SurfacePoint};
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

    /// Where in the unit square a point of one of the triangles is.
    pub fn place(&self, point: &SurfacePoint) -> [f64; 2] {
        let corners = self.corners[usize::from(point.prim != self.first_prim)];
        let [u, v] = [f64::from(point.barycentric.x), f64::from(point.barycentric.y)];
        let mut place = [0.0; 2];
        for (corner, weight) in corners.iter().zip([1.0 - u - v, u, v]) {
            place[0] += weight * f64::from(u8::from(matches!(corner, 1 | 3)));
            place[1] += weight * f64::from(u8::from(matches!(corner, 2 | 3)));
        }
        place.map(|c| c.clamp(0.0, 1.0))
    }

    /// Texture coordinates as an affine map of the unit square, if both
    /// triangles have the same one.
    pub fn uv_map(&self, geometry: &Geometry, shape: ShapeId) -> Option<[[f64; 3]; 2]> {
        // Of the corners of each triangle, by number.
        let mut uv = [[None; 4]; 2];
        for (k, corners) in self.corners.iter().enumerate() {
            for (i, corner) in corners.iter().enumerate() {
                let (u, v) = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)][i];
                let hit = Hit { t: 1.0, prim: self.first_prim + k as u32, u, v, instance: Hit::NO_INSTANCE };
                uv[k][*corner] = Some(geometry.triangle_surface(shape, &hit, 0.0).uv.as_dvec2());
            }
        }
        let [first, second] = uv;
        let (origin, x, y) = (first[0]?, first[1]?, first[2]?);
        let (x, y) = (x - origin, y - origin);
        let exact = second[1] == first[1]
            && second[2] == first[2]
            && (second[3]? - (origin + x + y)).abs().max_element()
                <= 1e-6 * (x.abs() + y.abs()).max_element();
        exact.then_some([[x.x, y.x, origin.x], [x.y, y.y, origin.y]])
    }

    /// Local coordinates uniform in area.
    pub fn uniform(u: Vec2) -> [f64; 2] {
        [super::linear::signed(u.x), super::linear::signed(u.y)]
    }
}
