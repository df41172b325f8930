//! Disk. Parameters: `flip_normals` (false). The unit disk of the local xy
//! plane; a `to_world` that is not uniform makes an ellipse.
//!
//! u = r, v = φ/2π. The normal is the local z by the inverse transpose, also
//! where `to_world` mirrors.

use std::f64::consts::{PI, TAU};

use super::linear::{check_affine, flip_sign};
use super::rectangle::Plane;
use super::{AnalyticHit, AnalyticPoint, Hit};
use crate::desc::Result;
use crate::math::{Bounds, DVec3, Transform, Vec2};

/// A flat disk, or an ellipse.
#[derive(Clone, Debug)]
pub struct Disk {
    plane: Plane,
    normal: DVec3,
}

impl Disk {
    /// The unit disk placed by `to_world`. Fails when that cannot be inverted.
    pub fn new(to_world: &Transform, flip: bool) -> Result<Disk> {
        check_affine(to_world)?;
        let normal = to_world.normal(DVec3::Z).normalize() * flip_sign(flip);
        Ok(Disk { plane: Plane::new(to_world)?, normal })
    }

    pub(crate) fn intersect(&self, origin: DVec3, dir: DVec3) -> Option<AnalyticHit> {
        let (t, x, y) = self.plane.intersect(origin, dir)?;
        (x * x + y * y <= 1.0).then_some(AnalyticHit { t, u: x as f32, v: y as f32 })
    }

    pub(crate) fn surface(&self, _origin: DVec3, _dir: DVec3, hit: &Hit) -> AnalyticPoint {
        self.at(f64::from(hit.u), f64::from(hit.v))
    }

    fn at(&self, x: f64, y: f64) -> AnalyticPoint {
        let r = x.hypot(y);
        let mut phi = y.atan2(x);
        if phi < 0.0 {
            phi += TAU;
        }
        let (cos, sin) = if r > 0.0 { (x / r, y / r) } else { (0.0, 0.0) };
        let (p, p_error) = self.plane.point(x, y);
        AnalyticPoint {
            p,
            p_error,
            ng: self.normal,
            ns: self.normal,
            uv: Vec2::new(r as f32, (phi / TAU) as f32),
            dpdu: self.plane.x * cos + self.plane.y * sin,
            dpdv: (self.plane.y * x - self.plane.x * y) * TAU,
        }
    }

    pub(crate) fn sample_area(&self, u: Vec2) -> AnalyticPoint {
        let d = crate::sampling::concentric_disk(u);
        self.at(f64::from(d.x), f64::from(d.y))
    }

    pub(crate) fn bounds(&self) -> Bounds {
        let (x, y) = (self.plane.x, self.plane.y);
        let half = DVec3::new(x.x.hypot(y.x), x.y.hypot(y.y), x.z.hypot(y.z));
        let centre = self.plane.centre;
        Bounds { min: (centre - half).as_vec3(), max: (centre + half).as_vec3() }
    }

    pub(crate) fn area(&self) -> f64 {
        PI * self.plane.x.cross(self.plane.y).length()
    }
}
