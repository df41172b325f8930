//! Cylinder. Parameters: `p0` (0, 0, 0), `p1` (0, 0, 1), `radius` (1),
//! `flip_normals` (false). Only the side: there are no caps.
//!
//! u = φ/2π, v = z from `p0` to `p1`. The normal points away from the axis,
//! also where `to_world` mirrors, as in Mitsuba 3.9.

use std::f64::consts::TAU;

use super::linear::{basis, check_circular, compose, flip_sign, rounding_error};
use super::{AnalyticHit, AnalyticPoint, Hit};
use crate::desc::{Error, Result};
use crate::math::{Bounds, DMat4, DVec3, DVec4, Transform, Vec2};

/// The side of a cylinder, without caps.
#[derive(Clone, Debug)]
pub struct Cylinder {
    base: DVec3,
    /// Unit axis, from `p0` to `p1`.
    axis: DVec3,
    length: f64,
    radius: f64,
    /// Unit vectors across the axis where φ = 0 and π/2; left-handed with the
    /// axis where `to_world` mirrors.
    s: DVec3,
    t: DVec3,
    flip: bool,
}

impl Cylinder {
    /// A cylinder between two points given in the local frame of `to_world`,
    /// which may rotate, translate, scale along and across the axis, and
    /// mirror. Fails when the radius or the length is not positive and finite,
    /// or when `to_world` does anything else.
    pub fn new(ends: [DVec3; 2], radius: f64, to_world: &Transform, flip: bool) -> Result<Cylinder> {
        if !(radius > 0.0) || !radius.is_finite() {
            return Err(Error::new(format!(
                "`radius` of a cylinder must be above 0 and finite, found {radius}"
            )));
        }
        let along = ends[1] - ends[0];
        let length = along.length();
        if !(length > 0.0) || !length.is_finite() {
            return Err(Error::new("`p0` and `p1` of a cylinder must be finite and differ"));
        }
        let (s, t) = basis(along / length);
        let column = |v: DVec3| v.extend(0.0);
        let local = DMat4::from_cols(
            column(s * radius),
            column(t * radius),
            column(along),
            DVec4::new(ends[0].x, ends[0].y, ends[0].z, 1.0),
        );
        let m = compose(to_world, local, "cylinder")?.matrix;
        let (x, y, z) = (m.x_axis.truncate(), m.y_axis.truncate(), m.z_axis.truncate());
        check_circular(x, y, "cylinder")?;
        check_circular(x.normalize(), z.normalize(), "cylinder")?;
        check_circular(y.normalize(), z.normalize(), "cylinder")?;

        // Take away what rounding in the file left of shear.
        let axis = z.normalize();
        let s = (x - axis * axis.dot(x)).normalize();
        let t = axis.cross(s);
        let t = if t.dot(y) < 0.0 { -t } else { t };
        Ok(Cylinder { base: m.w_axis.truncate(), axis, length: z.length(), radius: x.length(), s, t, flip })
    }

    /// The quadratic in the plane across the axis, by the distance of the line
    /// from the axis as in the sphere.
    pub(crate) fn intersect(&self, origin: DVec3, dir: DVec3) -> Option<AnalyticHit> {
        let o = origin - self.base;
        let (oz, dz) = (o.dot(self.axis), dir.dot(self.axis));
        let (op, dp) = (o - self.axis * oz, dir - self.axis * dz);
        let a = dp.length_squared();
        let b = op.dot(dp);
        let to_line = (op - dp * (b / a)).length();
        let discriminant = (self.radius - to_line) * (self.radius + to_line);
        if !(discriminant >= 0.0) {
            return None;
        }
        let distance = op.length();
        let c = (distance - self.radius) * (distance + self.radius);
        let q = b.abs() + (a * discriminant).sqrt();
        // Roots -(b ± …)/a in the form that does not cancel.
        let (near, far) = if b <= 0.0 { (c / q, q / a) } else { (-q / a, -c / q) };
        // The sign of c says on which side of the surface the ray starts.
        let near = if c <= 0.0 { f64::NEG_INFINITY } else { near };
        let reach = |t: f64| {
            let z = oz + t * dz;
            let rounded = t as f32;
            (rounded > 0.0 && rounded.is_finite() && z >= 0.0 && z <= self.length).then_some(rounded)
        };
        let t = reach(near).or_else(|| reach(far))?;
        Some(AnalyticHit { t, u: 0.0, v: 0.0 })
    }

    pub(crate) fn surface(&self, origin: DVec3, dir: DVec3, hit: &Hit) -> AnalyticPoint {
        let p = origin + dir * f64::from(hit.t) - self.base;
        let (x, y) = (p.dot(self.s), p.dot(self.t));
        let z = p.dot(self.axis).clamp(0.0, self.length);
        let r = x.hypot(y);
        let (cos, sin) = if r > 0.0 { (x / r, y / r) } else { (1.0, 0.0) };
        self.at(cos, sin, z)
    }

    fn at(&self, cos: f64, sin: f64, z: f64) -> AnalyticPoint {
        let mut phi = sin.atan2(cos);
        if phi < 0.0 {
            phi += TAU;
        }
        let n = self.s * cos + self.t * sin;
        let p = self.base + self.axis * z + n * self.radius;
        let ng = n * flip_sign(self.flip);
        let magnitude = self.base.abs().max_element() + self.radius + self.length;
        AnalyticPoint {
            p,
            p_error: rounding_error(p.as_vec3(), magnitude),
            ng,
            ns: ng,
            uv: Vec2::new((phi / TAU) as f32, (z / self.length) as f32),
            dpdu: (self.t * cos - self.s * sin) * (TAU * self.radius),
            dpdv: self.axis * self.length,
        }
    }

    pub(crate) fn sample_area(&self, u: Vec2) -> AnalyticPoint {
        let (sin, cos) = (TAU * f64::from(u.y)).sin_cos();
        self.at(cos, sin, f64::from(u.x) * self.length)
    }

    pub(crate) fn bounds(&self) -> Bounds {
        let cap = DVec3::new(self.s.x.hypot(self.t.x), self.s.y.hypot(self.t.y), self.s.z.hypot(self.t.z))
            * self.radius;
        let end = self.base + self.axis * self.length;
        Bounds { min: (self.base.min(end) - cap).as_vec3(), max: (self.base.max(end) + cap).as_vec3() }
    }

    pub(crate) fn area(&self) -> f64 {
        TAU * self.radius * self.length
    }
}
