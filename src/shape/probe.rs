//! What is computed once per ray: reciprocal direction for boxes, shear for
//! triangles.

use crate::math::{Bounds, DVec3, Ray, Vec3, gamma};

/// A ray made ready to be tested against boxes and triangles.
///
/// Box tests multiply the distance at which the ray leaves by
/// [`RayProbe::FAR_SLACK`] so that rounding never loses a box (Ize 2013,
/// "Robust BVH Ray Traversal"; pbrt-v4 section 6.1.2). All comparisons drop
/// NaN, which arises only where the origin lies on a face parallel to the ray:
/// such a face does not bound.
#[derive(Clone, Copy, Debug)]
pub struct RayProbe {
    /// Origin.
    pub origin: Vec3,
    /// 1 / direction, per axis; ±∞ where the direction is ±0.
    pub inv_dir: Vec3,
    /// For each axis, whether the direction points to smaller coordinates
    /// (including -0).
    pub negative: [bool; 3],
    /// End of the ray.
    pub t_max: f32,
    /// First primitive to leave out.
    pub skip: u32,
    /// Second primitive to leave out.
    pub skip_end: u32,
    /// The same in f64.
    pub(crate) origin_f64: DVec3,
    pub(crate) dir_f64: DVec3,
    /// The axis along which the direction is longest becomes z.
    axis: Axis,
    /// (dir.x / dir.z, dir.y / dir.z, 1 / dir.z) after that permutation.
    pub(crate) shear: Vec3,
}

#[derive(Clone, Copy, Debug)]
enum Axis {
    X,
    Y,
    Z,
}

impl RayProbe {
    /// 1 + 2γ(3), the factor on the far end of every box interval.
    pub const FAR_SLACK: f32 = 1.0 + 2.0 * gamma(3);

    /// Prepares a ray. `None` when its origin or direction is not finite, its
    /// direction is zero, or its interval is empty or NaN: such a ray hits
    /// nothing.
    #[must_use]
    #[inline]
    pub fn new(ray: &Ray) -> Option<RayProbe> {
        let d = ray.dir;
        if !(d.is_finite() && ray.origin.is_finite() && d != Vec3::ZERO && ray.t_max > 0.0) {
            return None;
        }
        let a = d.abs();
        let axis = if a.x > a.y && a.x > a.z {
            Axis::X
        } else if a.y > a.z {
            Axis::Y
        } else {
            Axis::Z
        };
        let p = axis.permute(d);
        Some(RayProbe {
            origin: ray.origin,
            inv_dir: d.recip(),
            negative: [d.x.is_sign_negative(), d.y.is_sign_negative(), d.z.is_sign_negative()],
            t_max: ray.t_max,
            skip: ray.skip,
            skip_end: ray.skip_end,
            origin_f64: ray.origin.as_dvec3(),
            dir_f64: d.as_dvec3(),
            axis,
            shear: Vec3::new(p.x / p.z, p.y / p.z, 1.0 / p.z),
        })
    }

    /// True when the ray leaves this primitive out.
    #[must_use]
    #[inline(always)]
    pub fn skips(&self, prim: u32) -> bool {
        prim == self.skip || prim == self.skip_end
    }

    /// The interval in which the ray is inside a box, as (near, far); empty
    /// when near > far. `near` is at least 0; `far` carries the slack.
    #[must_use]
    #[inline(always)]
    pub fn interval(&self, bounds: &Bounds) -> (f32, f32) {
        let lower = (bounds.min - self.origin) * self.inv_dir;
        let upper = (bounds.max - self.origin) * self.inv_dir;
        let (mut near, mut far) = (0.0f32, f32::INFINITY);
        for axis in 0..3 {
            let (enter, leave) =
                if self.negative[axis] { (upper[axis], lower[axis]) } else { (lower[axis], upper[axis]) };
            let leave = leave * RayProbe::FAR_SLACK;
            near = if enter > near { enter } else { near };
            far = if leave < far { leave } else { far };
        }
        (near, far)
    }

    /// Puts a hit at `t` into the interval of its primitive's box: `None` when
    /// the ray misses the box, or when no parameter in (0, `t_max`) is left.
    #[must_use]
    #[inline]
    pub fn confine(&self, t: f32, bounds: &Bounds, t_max: f32) -> Option<f32> {
        let (near, far) = self.interval(bounds);
        if !(near <= far) {
            return None;
        }
        let t = if t < near { near } else { t };
        let t = if t > far { far } else { t };
        (t > 0.0 && t < t_max).then_some(t)
    }

    /// A vertex relative to the origin, with the axes permuted.
    #[inline(always)]
    pub(crate) fn relative(&self, vertex: Vec3) -> Vec3 {
        self.axis.permute(vertex - self.origin)
    }
}

impl Axis {
    #[inline(always)]
    fn permute(self, v: Vec3) -> Vec3 {
        match self {
            Axis::X => Vec3::new(v.y, v.z, v.x),
            Axis::Y => Vec3::new(v.z, v.x, v.y),
            Axis::Z => v,
        }
    }
}
