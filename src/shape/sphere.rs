//! Sphere. Parameters: `center` (0), `radius` (1), `flip_normals` (false).
//!
//! u = φ/2π, v = θ/π in the local frame of `to_world`. A mirroring `to_world`
//! turns the normal inside, as in Mitsuba.

use std::f64::consts::{PI, TAU};

use super::linear::{basis, check_circular, compose, flip_sign, rounding_error};
use super::{AnalyticHit, AnalyticPoint, Hit};
use crate::desc::{Error, Result};
use crate::math::{Bounds, DMat3, DMat4, DVec3, Transform, Vec2, Vec3};

/// A full sphere.
#[derive(Clone, Debug)]
pub struct Sphere {
    pub(crate) centre: DVec3,
    pub(crate) radius: f64,
    /// Local to world and back, without translation: for uv and tangents.
    linear: DMat3,
    inverse: DMat3,
    flip: bool,
}

impl Sphere {
    /// A geometric normal of it, turned outwards.
    pub(crate) fn outwards(&self, ng: Vec3) -> Vec3 {
        if self.flip { -ng } else { ng }
    }

    /// A sphere given in the local frame of `to_world`, which may rotate,
    /// translate, scale uniformly and mirror. Fails when the radius is not
    /// positive and finite, or when `to_world` does anything else.
    pub fn new(center: DVec3, radius: f64, to_world: &Transform, flip: bool) -> Result<Sphere> {
        if !(radius > 0.0) || !radius.is_finite() {
            return Err(Error::new(format!(
                "`radius` of a sphere must be above 0 and finite, found {radius}"
            )));
        }
        if !center.is_finite() {
            return Err(Error::new("`center` of a sphere must be finite"));
        }
        let local = DMat4::from_translation(center) * DMat4::from_scale(DVec3::splat(radius));
        let placed = compose(to_world, local, "sphere")?;
        let m = placed.matrix;
        let (x, y, z) = (m.x_axis.truncate(), m.y_axis.truncate(), m.z_axis.truncate());
        for (a, b) in [(x, y), (y, z), (z, x)] {
            check_circular(a, b, "sphere")?;
        }
        let linear = DMat3::from_cols(x, y, z);
        Ok(Sphere {
            centre: m.w_axis.truncate(),
            radius: x.length(),
            linear,
            inverse: linear.inverse(),
            flip: flip != (placed.determinant() < 0.0),
        })
    }

    /// Both roots of |o + t·d| = r with o relative to the centre, by the
    /// distance of the line from the centre (pbrt-v4 section 6.2.1): no
    /// cancellation for far origins. Origins inside see the far root only.
    pub(crate) fn intersect(&self, origin: DVec3, dir: DVec3) -> Option<AnalyticHit> {
        let o = origin - self.centre;
        let a = dir.length_squared();
        let b = o.dot(dir);
        let to_line = o - dir * (b / a);
        let discriminant = (self.radius - to_line.length()) * (self.radius + to_line.length());
        if !(discriminant >= 0.0) {
            return None;
        }
        let distance = o.length();
        let c = (distance - self.radius) * (distance + self.radius);
        let q = b.abs() + (a * discriminant).sqrt();
        let t = if c <= 0.0 {
            // Inside: one root on either side.
            if b <= 0.0 { q / a } else { -c / q }
        } else if b < 0.0 {
            c / q
        } else {
            return None;
        };
        let t = t as f32;
        (t > 0.0 && t.is_finite()).then_some(AnalyticHit { t, u: 0.0, v: 0.0 })
    }

    pub(crate) fn surface(&self, origin: DVec3, dir: DVec3, hit: &Hit) -> AnalyticPoint {
        let offset = origin + dir * f64::from(hit.t) - self.centre;
        let n = offset.try_normalize().unwrap_or(DVec3::Z);
        self.at(n)
    }

    /// The surface where the unit vector `n` leaves the sphere.
    pub(crate) fn at(&self, n: DVec3) -> AnalyticPoint {
        self.parametrised(self.bare(n))
    }

    /// The same without texture coordinates and tangents.
    pub(crate) fn bare(&self, n: DVec3) -> AnalyticPoint {
        let p = self.centre + n * self.radius;
        let ng = n * flip_sign(self.flip);
        AnalyticPoint {
            p,
            p_error: rounding_error(p.as_vec3(), self.centre.abs().max_element() + self.radius),
            ng,
            ns: ng,
            uv: Vec2::ZERO,
            dpdu: DVec3::ZERO,
            dpdv: DVec3::ZERO,
        }
    }

    /// A bare point with texture coordinates and tangents.
    pub(crate) fn parametrised(&self, bare: AnalyticPoint) -> AnalyticPoint {
        let n = bare.ng * flip_sign(self.flip);
        let local = self.inverse * (n * self.radius);
        let rd = local.x.hypot(local.y);
        let mut phi = local.y.atan2(local.x);
        if phi < 0.0 {
            phi += TAU;
        }
        let theta = rd.atan2(local.z);
        let dpdv =
            if rd > 0.0 { DVec3::new(local.z * local.x / rd, local.z * local.y / rd, -rd) } else { DVec3::X };
        AnalyticPoint {
            uv: Vec2::new((phi / TAU) as f32, (theta / PI) as f32),
            dpdu: self.linear * DVec3::new(-local.y, local.x, 0.0) * TAU,
            dpdv: self.linear * dpdv * PI,
            ..bare
        }
    }

    /// A bare point.
    pub(crate) fn sample_area(&self, u: Vec2) -> AnalyticPoint {
        let z = 1.0 - 2.0 * f64::from(u.x);
        let r = (f64::from(u.x) * (1.0 - f64::from(u.x))).sqrt() * 2.0;
        let (sin, cos) = (TAU * f64::from(u.y)).sin_cos();
        self.bare(DVec3::new(r * cos, r * sin, z))
    }

    /// The bare point at the angle whose cosine and sine are given, measured at
    /// the centre from the unit vector `axis`; `phi` turns around it.
    pub(crate) fn at_angle(&self, axis: DVec3, cos: f64, sin: f64, phi: f64) -> AnalyticPoint {
        let (s, t) = basis(axis);
        let (sin_phi, cos_phi) = phi.sin_cos();
        self.bare((axis * cos + (s * cos_phi + t * sin_phi) * sin).normalize())
    }

    pub(crate) fn bounds(&self) -> Bounds {
        let r = DVec3::splat(self.radius);
        Bounds { min: (self.centre - r).as_vec3(), max: (self.centre + r).as_vec3() }
    }

    pub(crate) fn area(&self) -> f64 {
        4.0 * PI * self.radius * self.radius
    }
}
