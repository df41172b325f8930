//! Rectangle. Parameters: `flip_normals` (false). The square [-1, 1]² of the
//! local xy plane; any affine `to_world` makes a parallelogram.
//!
//! uv = ((x + 1)/2, (y + 1)/2). As in Mitsuba, where a rectangle is a mesh of
//! two triangles: the geometric normal follows the winding ∂p/∂u × ∂p/∂v, the
//! shading normal is the local z by the inverse transpose. The two differ in
//! sign where `to_world` mirrors.

use super::linear::{check_affine, flip_sign, signed};
use super::{AnalyticHit, AnalyticPoint, Hit};
use crate::desc::{Error, Result};
use crate::math::{Bounds, DVec3, Transform, Vec2, Vec3, gamma};

/// A plane with two axes, which need not be perpendicular: what disk and
/// rectangle share.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub centre: DVec3,
    pub x: DVec3,
    pub y: DVec3,
    /// x × y, not normalised.
    normal: DVec3,
    /// Dual axes: local coordinates are dot products with them.
    dual_x: DVec3,
    dual_y: DVec3,
}

impl Plane {
    pub fn new(to_world: &Transform) -> Result<Plane> {
        let m = to_world.matrix;
        let (x, y) = (m.x_axis.truncate(), m.y_axis.truncate());
        let normal = x.cross(y);
        let n2 = normal.length_squared();
        let (dual_x, dual_y) = (y.cross(normal) / n2, normal.cross(x) / n2);
        if !(n2 > 0.0) || !dual_x.is_finite() || !dual_y.is_finite() {
            return Err(Error::new("the shape is too thin, too large or too small to be represented"));
        }
        Ok(Plane { centre: m.w_axis.truncate(), x, y, normal, dual_x, dual_y })
    }

    /// Ray parameter and local coordinates where the ray meets the plane.
    #[inline]
    pub fn intersect(&self, origin: DVec3, dir: DVec3) -> Option<(f32, f64, f64)> {
        let o = origin - self.centre;
        let (height, fall) = (-o.dot(self.normal), dir.dot(self.normal));
        // Half of all rays lead away from the plane: no division for those.
        if (height > 0.0) != (fall > 0.0) {
            return None;
        }
        let t = height / fall;
        let rounded = t as f32;
        if !(rounded > 0.0) || !rounded.is_finite() {
            return None;
        }
        let p = o + dir * t;
        Some((rounded, p.dot(self.dual_x), p.dot(self.dual_y)))
    }

    /// The point at local coordinates and its error: that of triangles,
    /// γ(7)·Σ|terms|, so that neighbours of either kind are left behind.
    pub fn point(&self, x: f64, y: f64) -> (DVec3, Vec3) {
        let (px, py) = (self.x * x, self.y * y);
        let size = self.centre.abs() + px.abs() + py.abs();
        (self.centre + px + py, size.as_vec3() * gamma(7))
    }
}

/// A flat parallelogram.
#[derive(Clone, Debug)]
pub struct Rectangle {
    pub(crate) plane: Plane,
    ng: DVec3,
    pub(crate) ns: DVec3,
}

impl Rectangle {
    /// The square [-1, 1]² placed by `to_world`. Fails when that cannot be
    /// inverted.
    pub fn new(to_world: &Transform, flip: bool) -> Result<Rectangle> {
        check_affine(to_world)?;
        let plane = Plane::new(to_world)?;
        let ng = plane.normal.normalize() * flip_sign(flip);
        let ns = ng * 1.0f64.copysign(to_world.determinant());
        Ok(Rectangle { plane, ng, ns })
    }

    pub(crate) fn intersect(&self, origin: DVec3, dir: DVec3) -> Option<AnalyticHit> {
        let (t, x, y) = self.plane.intersect(origin, dir)?;
        (x.abs() <= 1.0 && y.abs() <= 1.0).then_some(AnalyticHit { t, u: x as f32, v: y as f32 })
    }

    pub(crate) fn surface(&self, _origin: DVec3, _dir: DVec3, hit: &Hit) -> AnalyticPoint {
        self.at(f64::from(hit.u), f64::from(hit.v))
    }

    pub(crate) fn at(&self, x: f64, y: f64) -> AnalyticPoint {
        let (p, p_error) = self.plane.point(x, y);
        AnalyticPoint {
            p,
            p_error,
            ng: self.ng,
            ns: self.ns,
            uv: Vec2::new((0.5 * (x + 1.0)) as f32, (0.5 * (y + 1.0)) as f32),
            dpdu: self.plane.x * 2.0,
            dpdv: self.plane.y * 2.0,
        }
    }

    pub(crate) fn sample_area(&self, u: Vec2) -> AnalyticPoint {
        self.at(signed(u.x), signed(u.y))
    }

    pub(crate) fn bounds(&self) -> Bounds {
        let half = self.plane.x.abs() + self.plane.y.abs();
        let centre = self.plane.centre;
        Bounds { min: (centre - half).as_vec3(), max: (centre + half).as_vec3() }
    }

    pub(crate) fn area(&self) -> f64 {
        4.0 * self.plane.normal.length()
    }
}
