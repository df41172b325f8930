//! What is computed once per ray: reciprocal direction for boxes, shear for
//! triangles.

use crate::math::{Bounds, Ray, Vec3, gamma};

/// A ray made ready to be tested against boxes and triangles.
///
/// Box tests stretch the distance at which the ray leaves by
/// [`RayProbe::FAR_SLACK`] so that rounding never loses a box (Ize 2013,
/// "Robust BVH Ray Traversal"; pbrt-v4 section 6.1.2). The factor is put on
/// the reciprocal direction once for each ray: as many roundings as when it is
/// put on each distance, and as monotone. All comparisons drop NaN, which arises
/// only where the origin lies on a face parallel to the ray: such a face does
/// not bound. An interval that is one point is empty: that of a flat box at a
/// distance is longer, by the slack, and at no distance nothing can be hit.
///
/// Vectors have a fourth number without meaning, so that they are loaded whole.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RayProbe {
    pub(crate) origin: [f32; 4],
    pub(crate) dir: [f32; 4],
    /// 1 / direction, per axis; ±∞ where the direction is ±0. Its sign says
    /// which faces of a box the ray meets first.
    pub(crate) inv_dir: [f32; 4],
    /// `inv_dir` times [`RayProbe::FAR_SLACK`].
    pub(crate) inv_far: [f32; 4],
    /// (dir.x / dir.z, dir.y / dir.z, 1 / dir.z), in the order of `axes`.
    pub(crate) shear: [f32; 3],
    /// The axes, turned so that the one along which the direction is longest
    /// is the third. Each is below 3.
    pub(crate) axes: [u8; 4],
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
}

impl RayProbe {
    /// 1 + 2γ(5), the factor on the far end of every box interval: γ(3) for each
    /// end, and γ(4) by which the test of triangles may move what it hits, in
    /// proportion to the way.
    pub const FAR_SLACK: f32 = 1.0 + 2.0 * gamma(5);

    /// Prepares a ray. `None` when its origin or direction is not finite, its
    /// direction is zero, or its interval is empty or NaN: such a ray hits
    /// nothing.
    #[must_use]
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<RayProbe> {
        // Without branches: for rays at random they cannot be foreseen.
        let (origin, dir) = (padded(ray.origin), padded(ray.dir));
        let a = dir.map(f32::abs);
        let x = (a[0] > a[1]) & (a[0] > a[2]);
        let y = a[1] > a[2];
        let axes = AXES[(2 - usize::from(y)) * usize::from(!x)];
        let inv_dir = dir.map(|d| 1.0 / d);
        let [x, y, z] = [0, 1, 2].map(|i| dir[usize::from(axes[i] & 3)]);
        // Zero where all are finite, else NaN.
        let zero = [0, 1, 2].map(|i| origin[i] * 0.0 + dir[i] * 0.0);
        if !((zero[0] + zero[1] + zero[2] == 0.0) & (z != 0.0) & (ray.t_max > 0.0)) {
            return None;
        }
        Some(RayProbe {
            origin,
            dir,
            inv_dir,
            inv_far: inv_dir.map(|i| i * RayProbe::FAR_SLACK),
            shear: [x / z, y / z, 1.0 / z],
            axes,
            t_max: ray.t_max,
            skip: if ray.skip_instance == Ray::NO_SKIP { ray.skip } else { Ray::NO_SKIP },
            skip_end: ray.skip_end,
            time: ray.time,
            skip_inside: [ray.skip, ray.skip_instance],
        })
    }

    /// A ray that is known to be finite, for `accel::Bvh8Plain`: without shear
    /// and primitives to leave out.
    #[inline(always)]
    pub(crate) fn plain(ray: &Ray) -> RayProbe {
        let dir = padded(ray.dir);
        let inv_dir = dir.map(|d| 1.0 / d);
        RayProbe {
            origin: padded(ray.origin),
            dir,
            inv_dir,
            inv_far: inv_dir.map(|i| i * RayProbe::FAR_SLACK),
            shear: [0.0; 3],
            axes: AXES[0],
            t_max: ray.t_max,
            skip: Ray::NO_SKIP,
            skip_end: Ray::NO_SKIP,
            time: ray.time,
            skip_inside: [Ray::NO_SKIP; 2],
        }
    }

    /// Where the ray begins.
    #[must_use]
    #[inline(always)]
    pub fn origin(&self) -> Vec3 {
        let [x, y, z, _] = self.origin;
        Vec3::new(x, y, z)
    }

    /// Where it goes.
    #[must_use]
    #[inline(always)]
    pub fn dir(&self) -> Vec3 {
        let [x, y, z, _] = self.dir;
        Vec3::new(x, y, z)
    }

    /// True when the ray leaves this primitive out.
    #[must_use]
    #[inline(always)]
    pub fn skips(&self, prim: u32) -> bool {
        prim == self.skip || prim == self.skip_end
    }

    /// The interval in which the ray is inside a box, as (near, far); empty
    /// unless near < far. `near` is at least 0; `far` carries the slack.
    #[must_use]
    #[inline(always)]
    pub fn interval(&self, bounds: &Bounds) -> (f32, f32) {
        let (lower, upper) = (bounds.min - self.origin(), bounds.max - self.origin());
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
        if !(near < far) {
            return None;
        }
        let t = if t < near { near } else { t };
        let t = if t > far { far } else { t };
        (t > 0.0 && t < t_max).then_some(t)
    }

    /// A vertex relative to the origin, with the axes turned.
    #[inline(always)]
    pub(crate) fn relative(&self, vertex: Vec3) -> Vec3 {
        let v = vertex - self.origin();
        let v = [v.x, v.y, v.z, 0.0];
        let [x, y, z, _] = self.axes;
        Vec3::from_array([x, y, z].map(|axis| v[usize::from(axis & 3)]))
    }
}

#[inline(always)]
fn padded(v: Vec3) -> [f32; 4] {
    [v.x, v.y, v.z, 0.0]
}

/// By the axis that comes last.
const AXES: [[u8; 4]; 3] = [[1, 2, 0, 0], [2, 0, 1, 0], [0, 1, 2, 0]];
