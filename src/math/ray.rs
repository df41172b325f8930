//! Rays.

use super::Vec3;

/// A ray: the points `origin + t·dir` with 0 < t < `t_max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes. Unit length except for shadow rays between two points,
    /// whose length is the distance and whose `t_max` is 1.
    pub dir: Vec3,
    /// End of the parameter interval.
    pub t_max: f32,
    /// Shutter time in [0, 1].
    pub time: f32,
    /// The planar primitive (triangle, rectangle, disk) the origin lies on,
    /// which cannot be hit again; [`Ray::NO_SKIP`] when there is none.
    pub skip: u32,
    /// The planar primitive at the far end of a shadow ray: the light, which
    /// must not shadow itself.
    pub skip_end: u32,
    /// The instance that `skip` is in; [`Ray::NO_SKIP`] when it is in none.
    pub skip_instance: u32,
}

impl Ray {
    /// The value of `skip` for "none".
    pub const NO_SKIP: u32 = u32::MAX;

    /// A ray without end and with nothing to skip, at time 0.
    #[must_use]
    pub fn new(origin: Vec3, dir: Vec3) -> Ray {
        Ray {
            origin,
            dir,
            t_max: f32::INFINITY,
            time: 0.0,
            skip: Ray::NO_SKIP,
            skip_end: Ray::NO_SKIP,
            skip_instance: Ray::NO_SKIP,
        }
    }

    /// The point at parameter `t`.
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.dir * t
    }
}
