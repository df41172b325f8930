//! Instances: a group of primitives placed by a transform, still or moving.
//!
//! A ray is taken into the group's own space and keeps its parameter: the
//! direction is not normalised there. The transform is applied in f64 and the
//! ray rounded to f32 once; what that moves is part of the error bounds of the
//! points that come back ([`Instance::to_world`]).

use super::{PrimId, SurfacePoint, triangle};
use crate::math::{Affine, Bounds, DMat3, DVec3, Motion, Ray, Transform, Vec3, gamma};

/// A placed group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Which part of the geometry: see [`super::Geometry::parts`].
    part: u32,
    /// The box in the world at all times of the shutter, widened by rounding.
    bounds: Bounds,
    placement: Placement,
}

#[derive(Clone, Debug)]
enum Placement {
    Still(Affine),
    Moving(Box<Motion>),
}

/// A group as it is placed at one time.
#[derive(Clone, Copy, Debug)]
pub struct Placed(Affine);

/// Parts of the shutter for the box of a moving instance.
const STEPS: u32 = 64;

impl Instance {
    /// A group with this box, placed by a motion over the shutter, [0, 1].
    pub(crate) fn new(part: u32, local: &Bounds, motion: &Motion) -> Instance {
        let placement = match motion.as_still() {
            Some(transform) => Placement::Still(Affine::of(&transform)),
            None => Placement::Moving(Box::new(motion.clone())),
        };
        let bounds = if local.is_empty() { Bounds::EMPTY } else { swept(local, motion) };
        Instance { part, bounds, placement }
    }

    /// Where the group is at a time of the shutter, [0, 1].
    #[must_use]
    #[inline]
    pub fn at(&self, time: f32) -> Placed {
        match &self.placement {
            Placement::Still(affine) => Placed(*affine),
            Placement::Moving(motion) => Placed(motion.affine_at(f64::from(time))),
        }
    }

    /// Which part of the geometry it places.
    #[must_use]
    pub fn part(&self) -> u32 {
        self.part
    }

    /// The box in the world at all times of the shutter.
    #[must_use]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// True when it moves while the shutter is open.
    #[must_use]
    pub fn moves(&self) -> bool {
        matches!(self.placement, Placement::Moving(_))
    }

    /// Memory beyond the struct itself, in bytes.
    pub(crate) fn extra_bytes(&self) -> usize {
        match &self.placement {
            Placement::Still(_) => 0,
            Placement::Moving(motion) => motion.times().count() * 400,
        }
    }
}

impl Placed {
    /// The ray in the group's space, without skips and with the same end.
    #[must_use]
    #[inline]
    pub fn local_ray(&self, origin: Vec3, dir: Vec3, time: f32) -> Ray {
        let Placed(a) = self;
        let mut ray = Ray::new(
            (a.inverse * origin.as_dvec3() + a.back).as_vec3(),
            (a.inverse * dir.as_dvec3()).as_vec3(),
        );
        ray.time = time;
        ray
    }

    /// A point of the world in the group's space.
    #[must_use]
    pub fn point_to_local(&self, p: Vec3) -> Vec3 {
        (self.0.inverse * p.as_dvec3() + self.0.back).as_vec3()
    }

    /// A point of the group in the world.
    #[must_use]
    pub fn point_to_world(&self, p: Vec3) -> Vec3 {
        (self.0.matrix * p.as_dvec3() + self.0.translation).as_vec3()
    }

    /// A surface point of the group in the world.
    #[must_use]
    pub fn to_world(&self, local: &SurfacePoint, instance: PrimId) -> SurfacePoint {
        let Placed(a) = self;
        let p = (a.matrix * local.p.as_dvec3() + a.translation).as_vec3();
        let size = local.p.abs();
        // The point's own error, the rounding of points in the group's space on
        // the way there and back, and that of the point in the world.
        let own = a.matrix.abs_columns() * (local.p_error + size * gamma(2)).as_dvec3();
        let normal = |n: Vec3| {
            let turned = a.inverse.transpose() * n.as_dvec3();
            turned.try_normalize().map_or(n, |n| n.as_vec3())
        };
        SurfacePoint {
            p,
            p_error: own.as_vec3() * (1.0 + gamma(2)) + p.abs() * gamma(3),
            ng: normal(local.ng),
            ns: normal(local.ns),
            dpdu: (a.matrix * local.dpdu.as_dvec3()).as_vec3(),
            dpdv: (a.matrix * local.dpdv.as_dvec3()).as_vec3(),
            instance,
            ..*local
        }
    }
}

/// The absolute values of a matrix.
trait AbsColumns {
    fn abs_columns(&self) -> DMat3;
}

impl AbsColumns for DMat3 {
    #[inline]
    fn abs_columns(&self) -> DMat3 {
        DMat3::from_cols(self.x_axis.abs(), self.y_axis.abs(), self.z_axis.abs())
    }
}

/// The box of a box on its way: that of its corners at regular times, widened
/// by the most that a path can leave its chord, h²/8 of its second derivative.
fn swept(local: &Bounds, motion: &Motion) -> Bounds {
    let (min, max) = (local.min.as_dvec3(), local.max.as_dvec3());
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|i: usize| {
        let pick = |bit: usize, axis: usize| if i >> bit & 1 == 0 { min[axis] } else { max[axis] };
        DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    });
    let reach = corners.iter().map(|c| c.length()).fold(0.0, f64::max);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut take = |transform: &Transform, slack: f64| {
        for corner in &corners {
            let p = transform.point(*corner);
            (low, high) = (low.min(p - slack), high.max(p + slack));
        }
    };
    if let Some(still) = motion.as_still() {
        take(&still, 0.0);
    } else {
        motion.stretches(|start, end, second| {
            let steps = f64::from(STEPS);
            let slack = second * reach / (8.0 * steps * steps);
            for i in 0..=STEPS {
                take(&motion.at(start + (end - start) * f64::from(i) / steps), slack);
            }
        });
    }
    let rounded = Bounds { min: low.as_vec3(), max: high.as_vec3() };
    triangle::widen(triangle::widen(rounded))
}
