//! Instances: a group of primitives placed by a transform, still or moving.
//!
//! A ray is taken into the group's own space and keeps its parameter: the
//! direction is not normalised there. The transform is applied in f64 and the
//! ray rounded to f32 once; what that moves is part of the error bounds of the
//! points that come back ([`Instance::to_world`]).

use super::{PrimId, ShapeSample, SurfacePoint, triangle};
use crate::math::{Affine, Bounds, DMat3, DVec3, Motion, Ray, Vec3, gamma};

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

/// The way of an instance over the shutter: poses close enough that what moves
/// is within a known distance of the line between two of them.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// A pose, and how far a point may be off the chord to the next, per unit of
    /// its distance from the group's origin.
    poses: Vec<(Affine, f64)>,
    turn: Option<f64>,
}

/// Parts of the shutter for the box of a moving instance.
const STEPS: u32 = 64;

impl Instance {
    /// A group with this box, placed by a motion over the shutter, [0, 1].
    pub(crate) fn new(part: u32, local: &Bounds, motion: &Motion) -> Instance {
        let placement = match motion.as_still() {
            Some(transform) => Placement::Still(Affine::of(&transform)),
            None => Placement::Moving(Box::new(motion.clone())),
        };
        let bounds =
            if local.is_empty() { Bounds::EMPTY } else { Sweep::of(motion).bounds(&local.corners()) };
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

    /// Where it is while the shutter is open.
    #[must_use]
    pub fn sweep(&self) -> Sweep {
        match &self.placement {
            Placement::Still(affine) => Sweep { poses: vec![(*affine, 0.0)], turn: Some(0.0) },
            Placement::Moving(motion) => Sweep::of(motion),
        }
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

    /// The vector between two points of the group in the world.
    #[must_use]
    pub fn edge_to_world(&self, edge: DVec3) -> DVec3 {
        self.0.matrix * edge
    }

    /// A normal of the world in the group's space, of unit length.
    #[must_use]
    pub fn normal_to_local(&self, n: Vec3) -> Vec3 {
        let turned = self.0.matrix.transpose() * n.as_dvec3();
        turned.try_normalize().map_or(n, |n| n.as_vec3())
    }

    /// A unit direction of the world in the group's space, of unit length, and
    /// the factor from densities per solid angle there to those in the world:
    /// |det B| / |B·w|³ for the linear part B of the way there.
    #[must_use]
    pub fn direction_to_local(&self, w: Vec3) -> (Vec3, f64) {
        let inside = self.0.inverse * w.as_dvec3();
        let length = inside.length();
        ((inside / length).as_vec3(), (self.0.inverse / length).determinant().abs())
    }

    /// What is needed of a surface point of the world to weigh it in the group's
    /// space: place and geometric normal.
    #[must_use]
    pub fn to_local(&self, world: &SurfacePoint) -> SurfacePoint {
        SurfacePoint { p: self.point_to_local(world.p), ng: self.normal_to_local(world.ng), ..*world }
    }

    /// A sample of a shape of the group as seen from a point `from` of its space,
    /// in the world with its density there; `None` where that is not finite. Its
    /// error box is so large that no shadow ray from there that ends outside of it
    /// meets the shape itself.
    #[must_use]
    pub fn sample_to_world(&self, local: &ShapeSample, from: Vec3, instance: PrimId) -> Option<ShapeSample> {
        let Placed(a) = self;
        let wi = (a.matrix * local.wi.as_dvec3()).try_normalize()?.as_vec3();
        let pdf = (f64::from(local.pdf) * self.direction_to_local(wi).1) as f32;
        // A ray from afar is rounded at both ends in the group's space, and its hit
        // by what the intersection loses of its length.
        let reach = (from.abs() + local.p.abs()) * gamma(16);
        let (p, p_error) = self.place(local.p, local.p_error + reach);
        let [n, ng] = [local.n, local.ng].map(|n| self.normal_to_world(n));
        (pdf > 0.0 && pdf.is_finite()).then_some(ShapeSample {
            p,
            p_error,
            n,
            ng,
            wi,
            instance,
            pdf,
            ..*local
        })
    }

    /// A point of the group and its error in the world.
    fn place(&self, local: Vec3, error: Vec3) -> (Vec3, Vec3) {
        let Placed(a) = self;
        let p = (a.matrix * local.as_dvec3() + a.translation).as_vec3();
        // The point's own error, the rounding of points in the group's space on
        // the way there and back, and that of the point in the world.
        let own = a.matrix.abs_columns() * (error + local.abs() * gamma(2)).as_dvec3();
        (p, own.as_vec3() * (1.0 + gamma(2)) + p.abs() * gamma(3))
    }

    fn normal_to_world(&self, n: Vec3) -> Vec3 {
        let turned = self.0.inverse.transpose() * n.as_dvec3();
        turned.try_normalize().map_or(n, |n| n.as_vec3())
    }

    /// A surface point of the group in the world.
    #[must_use]
    pub fn to_world(&self, local: &SurfacePoint, instance: PrimId) -> SurfacePoint {
        let Placed(a) = self;
        let (p, p_error) = self.place(local.p, local.p_error);
        SurfacePoint {
            p,
            p_error,
            ng: self.normal_to_world(local.ng),
            ns: self.normal_to_world(local.ns),
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

impl Sweep {
    /// That of a motion over the shutter.
    #[must_use]
    pub fn of(motion: &Motion) -> Sweep {
        if let Some(still) = motion.as_still() {
            return Sweep { poses: vec![(Affine::of(&still), 0.0)], turn: Some(0.0) };
        }
        let mut poses = Vec::new();
        motion.stretches(|start, end, second| {
            let steps = f64::from(STEPS);
            // The most that a path can leave its chord: h²/8 of its second derivative.
            let slack = second / (8.0 * steps * steps);
            let at = |i: u32| Affine::of(&motion.at(start + (end - start) * f64::from(i) / steps));
            poses.extend((0..=STEPS).map(|i| (at(i), slack)));
        });
        Sweep { poses, turn: motion.turn() }
    }

    /// The box of everything between these points of the group on its way,
    /// widened by rounding.
    #[must_use]
    pub fn bounds(&self, points: &[DVec3]) -> Bounds {
        let reach = points.iter().map(|p| p.length()).fold(0.0, f64::max);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (pose, slack) in &self.poses {
            for point in points {
                let p = pose.matrix * *point + pose.translation;
                (low, high) = (low.min(p - slack * reach), high.max(p + slack * reach));
            }
        }
        let rounded = Bounds { min: low.as_vec3(), max: high.as_vec3() };
        triangle::widen(triangle::widen(rounded))
    }

    /// A normal of the group when the shutter opens, of unit length, and by how
    /// many radians it turns away from there at most; `None` when that is not
    /// known.
    #[must_use]
    pub fn normal(&self, n: Vec3) -> Option<(Vec3, f32)> {
        let turned = self.poses[0].0.inverse.transpose() * n.as_dvec3();
        Some((turned.try_normalize()?.as_vec3(), self.turn? as f32))
    }

    /// The largest factor by which areas grow on the way: of a surface with that
    /// normal, or of something round.
    #[must_use]
    pub fn area_factor(&self, normal: Option<Vec3>) -> f64 {
        let factor = |(pose, _): &(Affine, f64)| {
            let volume = pose.matrix.determinant().abs();
            match normal {
                Some(n) => volume * (pose.inverse.transpose() * n.as_dvec3()).length(),
                None => volume.cbrt().powi(2),
            }
        };
        self.poses.iter().map(factor).fold(0.0, f64::max)
    }
}
