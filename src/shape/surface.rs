//! Points on surfaces, and the rays that leave them.

use super::{PrimId, ShapeId};
use crate::math::{Ray, Vec2, Vec3, gamma, offset_origin};

/// A point on a surface, found by a ray. World space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where.
    pub p: Vec3,
    /// Bound on the absolute error of each coordinate of `p`.
    pub p_error: Vec3,
    /// Unit geometric normal: by the winding of triangles, outward on closed
    /// shapes; after `flip_normals`.
    pub ng: Vec3,
    /// Unit shading normal, after `flip_normals`. Not forced into the
    /// hemisphere of `ng`, as in Mitsuba.
    pub ns: Vec3,
    /// Texture coordinates; barycentrics of the second and third vertex on
    /// meshes that have none.
    pub uv: Vec2,
    /// Barycentrics of the second and third vertex of a triangle; zero
    /// elsewhere.
    pub barycentric: Vec2,
    /// ∂p/∂u, not normalised; zero where the parametrisation is singular.
    pub dpdu: Vec3,
    /// ∂p/∂v, not normalised; zero where the parametrisation is singular.
    pub dpdv: Vec3,
    /// The primitive.
    pub prim: PrimId,
    /// Its shape.
    pub shape: ShapeId,
    /// The instance that the primitive was hit in; [`super::Hit::NO_INSTANCE`] when in none.
    pub instance: PrimId,
    /// Time of the ray that found it, in [0, 1] of the shutter.
    pub time: f32,
    /// The primitive is flat: a ray that leaves it cannot meet it again.
    pub planar: bool,
}

impl SurfacePoint {
    /// A ray from here in a unit direction, starting outside the error box on
    /// the side of `ng` that `dir` points to, at the same time. It leaves out
    /// this primitive if that is flat.
    #[must_use]
    pub fn spawn(&self, dir: Vec3) -> Ray {
        Ray {
            origin: offset_origin(self.p, self.p_error, self.ng, dir),
            dir,
            t_max: f32::INFINITY,
            time: self.time,
            skip: self.skip(),
            skip_end: Ray::NO_SKIP,
            skip_instance: self.instance,
        }
    }

    /// A shadow ray to a sampled point of a light: `dir` is the vector between
    /// the two, not normalised, `t_max` is 1, and both ends are outside their
    /// error boxes. The far box includes the rounding of the vector itself.
    #[must_use]
    pub fn spawn_to(&self, target: &ShapeSample) -> Ray {
        let towards = target.p - self.p;
        let origin = offset_origin(self.p, self.p_error, self.ng, towards);
        let error = target.p_error + towards.abs() * gamma(3);
        let end = offset_origin(target.p, error, target.ng, -towards);
        Ray {
            origin,
            dir: end - origin,
            t_max: 1.0,
            time: self.time,
            skip: self.skip(),
            // In an instance it is met by nobody out here: there its error box is enough.
            skip_end: if target.planar { target.prim } else { Ray::NO_SKIP },
            skip_instance: self.instance,
        }
    }

    /// A shadow ray to a point that is on no surface, such as a point light.
    #[must_use]
    pub fn spawn_to_point(&self, target: Vec3) -> Ray {
        let ray = self.spawn(target - self.p);
        Ray { dir: target - ray.origin, t_max: 1.0, ..ray }
    }

    fn skip(&self) -> u32 {
        if self.planar { self.prim } else { Ray::NO_SKIP }
    }
}

/// A sampled point of a shape, as seen from a reference point. World space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSample {
    /// Where.
    pub p: Vec3,
    /// Bound on the absolute error of each coordinate of `p`.
    pub p_error: Vec3,
    /// Unit shading normal, after `flip_normals`: an area light emits towards
    /// the side it points to, as in Mitsuba.
    pub n: Vec3,
    /// Unit geometric normal, after `flip_normals`.
    pub ng: Vec3,
    /// Texture coordinates there.
    pub uv: Vec2,
    /// Unit direction from the reference point to `p`, more precise than the
    /// difference of the rounded points.
    pub wi: Vec3,
    /// The primitive.
    pub prim: PrimId,
    /// The instance that it is in; [`super::Hit::NO_INSTANCE`] when in none.
    pub instance: PrimId,
    /// Probability density per solid angle at the reference point; finite and
    /// above 0. Both sides of the shape count as visible.
    pub pdf: f32,
    /// The primitive is flat.
    pub planar: bool,
}
