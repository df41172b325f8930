//! A flat shape that shines along its normal.

use super::{AreaEmission, LightSample, Target, grey};
use crate::math::{Ray, Vec3};
use crate::shape::{Geometry, PrimId, ShapeSample};

/// A flat shape whose light all goes along its normal: a beam with sharp
/// sides. Scattered rays cannot find it; the one direction from which it
/// reaches a point is sampled exactly. (In Mitsuba only its particle tracer
/// can render it.)
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `radiance` | 1 | irradiance on a plane across the beam; may be a texture |
#[derive(Clone, Debug)]
pub struct Beam {
    /// The shape.
    pub prim: PrimId,
    /// Its unit normal, along which it shines.
    pub normal: Vec3,
    /// Its area.
    pub area: f64,
    /// What is emitted.
    pub emission: AreaEmission,
}

impl Beam {
    pub(super) fn sample(&self, geometry: &Geometry, ref_p: Vec3) -> Option<LightSample> {
        let ray = Ray::new(ref_p, -self.normal);
        let hit = geometry.intersect(self.prim, &ray, f32::INFINITY)?;
        let point = geometry.surface(&ray, &hit);
        let target = ShapeSample {
            p: point.p,
            p_error: point.p_error,
            n: point.ns,
            ng: point.ng,
            uv: point.uv,
            wi: ray.dir,
            prim: self.prim,
            instance: point.instance,
            pdf: 1.0,
            planar: true,
        };
        let radiance = self.emission.radiance.eval(point.uv);
        Some(LightSample { wi: ray.dir, radiance, pdf: 1.0, delta: true, target: Target::Surface(target) })
    }

    pub(super) fn power(&self) -> f64 {
        self.area * grey(self.emission.radiance.mean())
    }
}
