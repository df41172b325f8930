//! Points and rays as a renderer with an epsilon has them: to measure what the
//! bounds of errors cost, never to render with.

use super::{Geometry, Hit, SurfacePoint};
use crate::math::{Ray, Vec3};

impl Geometry {
    /// [`Geometry::surface`] without a bound of the error, which is zero; where
    /// the hit is on no still triangle outside of instances, with one.
    #[must_use]
    pub fn loose_surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let still = hit.instance == Hit::NO_INSTANCE && hit.prim < self.triangle_count();
        if !still {
            return self.surface(ray, hit);
        }
        let indices = self.triangles[hit.prim as usize];
        let vertices = indices.map(|i| self.positions[i as usize]);
        let shape = self.triangle_shapes[hit.prim as usize];
        self.face_surface::<false>(shape, hit, (vertices, indices), ray.time, None)
    }
}

impl SurfacePoint {
    /// [`SurfacePoint::spawn`] as a renderer with an epsilon does it: a fixed
    /// distance off the surface, and with nothing to leave out.
    #[must_use]
    #[inline]
    pub fn spawn_off(&self, dir: Vec3, epsilon: f32) -> Ray {
        let offset = self.ng * epsilon.copysign(dir.dot(self.ng));
        Ray { time: self.time, ..Ray::new(self.p + offset, dir) }
    }
}
