//! What is computed once per ray: reciprocal direction for boxes, shear for
//! triangles.

use crate::math::{Bounds, Ray, Vec3, gamma};

/// A ray made ready to be tested against boxes and triangles.
///
/// Box tests stretch the distance at which the ray leaves by
/// [`RayProbe::FAR_SLACK`] so that rounding never loses a box (Ize 2013,
/// "Robust BVH Ray Traversal"; pbrt-v4 section 6.1.2). The factor is put on
/// the reciprocal direction once for each ray: as many roundings as when it is
/// put on each distance, and as monotone. All comparisons drop
/// NaN, which arises only where the origin lies on a face parallel to the ray:
/// such a face does not bound.
#[derive(Clone, Copy, Debug)]
pub struct RayProbe {
    /// Origin.
    pub origin: Vec3,
    /// Direction.
    pub dir: Vec3,
    /// 1 / direction, per axis; ±∞ where the direction is ±0. Its sign says
    /// which faces of a box the ray meets first.
    pub inv_dir: Vec3,
    /// `inv_dir` times [`RayProbe::FAR_SLACK`].
    pub inv_far: Vec3,
    /// End of the ray.
    pub t_max: f32,
    /// First primitive to leave out.
    pub skip: u32,
    /// Second primitive to leave out.
    pub skip_end: u32,
    /// Time in [0, 1] of the shutter.
    pub time: f32,
    /// A primitive to leave out in one instance, and that instance.
    pub(crate) skip_inside: [u32; 2],
    /// The axes, turned so that the one along which the direction is longest
    /// is the third. Each is below 3.
    pub(crate) axes: [u8; 3],
    /// Origin and reciprocal directions, so turned.
    pub(crate) turned_origin: [f32; 3],
    pub(crate) turned_inv_dir: [f32; 3],
    pub(crate) turned_inv_far: [f32; 3],
    /// (dir.x / dir.z, dir.y / dir.z, 1 / dir.z), so turned.
    pub(crate) shear: [f32; 3],
}

impl RayProbe {
    /// 1 + 2γ(3), the factor on the far end of every box interval.
    pub const FAR_SLACK: f32 = 1.0 + 2.0 * gamma(3);

    /// Prepares a ray. `None` when its origin or direction is not finite, its
    /// direction is zero, or its interval is empty or NaN: such a ray hits
    /// nothing.
    #[must_use]
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<RayProbe> {
        // Without branches: for rays at random they cannot be foreseen.
        let (d, a, o) = (ray.dir, ray.dir.abs(), ray.origin.abs());
        const END: f32 = f32::INFINITY;
        let finite = (a.x < END) & (a.y < END) & (a.z < END) & (o.x < END) & (o.y < END) & (o.z < END);
        let x = (a.x > a.y) & (a.x > a.z);
        let y = !x & (a.y > a.z);
        let axes = AXES[usize::from(x) + 2 * usize::from(y)];
        let turn = |v: Vec3| {
            let v = [v.x, v.y, v.z, 0.0];
            axes.map(|axis| v[usize::from(axis & 3)])
        };
        let inv_dir = d.recip();
        let inv_far = inv_dir * RayProbe::FAR_SLACK;
        let ([x, y, z], turned_inv_dir) = (turn(d), turn(inv_dir));
        if !(finite & (z != 0.0) & (ray.t_max > 0.0)) {
            return None;
        }
        Some(RayProbe {
            origin: ray.origin,
            dir: d,
            inv_dir,
            inv_far,
            t_max: ray.t_max,
            skip: if ray.skip_instance == Ray::NO_SKIP { ray.skip } else { Ray::NO_SKIP },
            skip_end: ray.skip_end,
            time: ray.time,
            skip_inside: [ray.skip, ray.skip_instance],
            axes,
            turned_origin: turn(ray.origin),
            turned_inv_dir,
            turned_inv_far: turn(inv_far),
            shear: [x / z, y / z, turned_inv_dir[2]],
        })
    }

    /// A ray that is known to be finite, for `accel::Bvh8Plain`: without slack,
    /// shear and primitives to leave out.
    #[inline(always)]
    pub(crate) fn plain(ray: &Ray) -> RayProbe {
        let inv_dir = ray.dir.recip();
        let inverse = inv_dir.to_array();
        RayProbe {
            origin: ray.origin,
            dir: ray.dir,
            inv_dir,
            inv_far: inv_dir,
            t_max: ray.t_max,
            skip: Ray::NO_SKIP,
            skip_end: Ray::NO_SKIP,
            time: ray.time,
            skip_inside: [Ray::NO_SKIP; 2],
            axes: AXES[0],
            turned_origin: ray.origin.to_array(),
            turned_inv_dir: inverse,
            turned_inv_far: inverse,
            shear: [0.0; 3],
        }
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
        let (lower, upper) = (bounds.min - self.origin, bounds.max - self.origin);
        let (mut near, mut far) = (0.0f32, f32::INFINITY);
        for axis in 0..3 {
            let behind = self.inv_dir[axis].is_sign_negative();
            let (enter, leave) = if behind { (upper[axis], lower[axis]) } else { (lower[axis], upper[axis]) };
            let (enter, leave) = (enter * self.inv_dir[axis], leave * self.inv_far[axis]);
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

    /// A vertex relative to the origin, with the axes turned.
    #[inline(always)]
    pub(crate) fn relative(&self, vertex: Vec3) -> Vec3 {
        let v = vertex - self.origin;
        let v = [v.x, v.y, v.z, 0.0];
        Vec3::from_array(self.axes.map(|axis| v[usize::from(axis & 3)]))
    }
}

/// By whether x is the longest, and whether y is.
const AXES: [[u8; 3]; 4] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 1, 2]];
