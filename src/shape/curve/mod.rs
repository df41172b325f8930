//! Curves. `linearcurve` joins spheres by cones; `bsplinecurve` sweeps a circle
//! along a uniform cubic B-spline, across its tangent, with open ends. Both are
//! what Mitsuba 3.9 makes of them with Embree's round curves, and as there only
//! the outside is met: a ray that starts within a curve leaves it unseen.
//!
//! Parameters: `filename`, a line `x y z radius` for each control point and an
//! empty line between two curves; `to_world` (identity), which moves the control
//! points and leaves the radii as they are.
//!
//! u = φ/2π around the axis, from where `cross(z, axis)` leads, z being that of
//! the shape's space; v goes from 0 to 1 along all segments of all curves of a
//! shape, each of which takes the same share.
//!
//! A primitive is a segment between two control points (a cubic piece of a
//! spline), or a half, quarter or eighth of one where that makes the boxes much
//! smaller, as it does where a strand crosses the axes. It takes 12 bytes, and a
//! control point 16. Tests are in f64, about the point of the ray that is nearest
//! to the segment, so that thin and far away go together; a hit is computed again
//! when its surface is asked for, from the same numbers, since the rounded
//! parameter can be further off than the radius.

mod cone;
mod tube;

use cone::RoundCone;
use tube::Tube;

use super::linear::{check_affine, rounding_error};
use super::{AnalyticPoint, Geometry, GeometryBuilder, Hit, PrimId, RayProbe, ShapeId, ShapeInfo};
use super::{SurfacePoint, triangle};
use crate::desc::{Curves, Error, Result};
use crate::math::{Bounds, DVec3, Ray, Transform, Vec2, Vec4};

/// The two kinds of curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveKind {
    /// Spheres at the control points, joined by cones.
    Linear,
    /// A circle swept along a uniform cubic B-spline.
    BSpline,
}

impl CurveKind {
    /// Its name in scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            CurveKind::Linear => "linearcurve",
            CurveKind::BSpline => "bsplinecurve",
        }
    }

    /// Control points of one segment.
    #[must_use]
    pub fn points(self) -> u32 {
        match self {
            CurveKind::Linear => 2,
            CurveKind::BSpline => 4,
        }
    }
}

/// One segment of a curve, or an equal part of one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvePiece {
    /// First control point.
    point: u32,
    /// Which segment of the shape.
    segment: u32,
    kind: CurveKind,
    /// Which of 2^`level` parts.
    part: u8,
    level: u8,
    /// The segment is the first, the last of its curve.
    ends: [bool; 2],
}

/// A hit before it is rounded: the parameter, and where along the segment.
#[derive(Clone, Copy, Debug)]
struct Met {
    t: f64,
    v: f64,
}

/// A point of a segment's surface.
#[derive(Clone, Copy, Debug)]
struct Spot {
    p: DVec3,
    n: DVec3,
    /// Unit direction of the axis.
    axis: DVec3,
    /// Unit direction from the axis to `p`.
    out: DVec3,
    /// Around the axis, ∂p/∂φ; and along the segment, in a frame that does not
    /// spin.
    around: DVec3,
    along: DVec3,
    /// How the direction of the axis changes along the segment, with something
    /// along the axis.
    turn: DVec3,
}

/// Parts of a segment at most, as a power of two; fewer where there are many
/// segments.
const MAX_LEVEL: u8 = 3;
const MANY: usize = 1 << 20;
/// A segment is cut in two when that leaves less than this share of the area of
/// its box.
const WORTH: f32 = 0.75;

impl CurvePiece {
    /// The whole segment that it is a part of.
    fn whole(kind: CurveKind, point: u32, segment: u32, ends: [bool; 2]) -> CurvePiece {
        CurvePiece { point, segment, kind, part: 0, level: 0, ends }
    }

    fn halves(self) -> [CurvePiece; 2] {
        [0, 1].map(|half| CurvePiece { part: 2 * self.part + half, level: self.level + 1, ..self })
    }

    /// Which stretch of the segment it is.
    fn range(&self) -> [f64; 2] {
        let step = 1.0 / f64::from(1u32 << self.level);
        [f64::from(self.part) * step, f64::from(self.part + 1) * step]
    }

    /// A control point of the segment.
    fn point(&self, points: &[Vec4], index: u32) -> Vec4 {
        points[(self.point + index) as usize]
    }

    fn tube(&self, points: &[Vec4]) -> Tube {
        Tube::new([0, 1, 2, 3].map(|i| self.point(points, i).as_dvec4()))
    }

    fn cone(&self, points: &[Vec4]) -> RoundCone {
        RoundCone::new([0, 1].map(|i| self.point(points, i).as_dvec4()))
    }

    fn bounds(&self, points: &[Vec4]) -> Bounds {
        match self.kind {
            CurveKind::Linear => self.cone(points).bounds(self.range()),
            CurveKind::BSpline => self.tube(points).bounds(self.range()),
        }
    }

    fn intersect(&self, points: &[Vec4], origin: DVec3, dir: DVec3) -> Option<Met> {
        match self.kind {
            CurveKind::Linear => {
                let cone = self.cone(points);
                let range = self.range();
                let caps = [self.ends[0] && range[0] == 0.0, range[1] == 1.0];
                let met = cone.intersect((origin, dir), range, caps)?;
                // What is within a neighbour is not seen from outside.
                let p = origin + dir * met.t;
                let within = |first: u32| {
                    RoundCone::new([first, first + 1].map(|i| points[i as usize].as_dvec4())).hides(p)
                };
                let hidden =
                    (!self.ends[0] && within(self.point - 1)) || (!self.ends[1] && within(self.point + 1));
                (!hidden).then_some(met)
            }
            CurveKind::BSpline => self.tube(points).intersect((origin, dir), self.range()),
        }
    }

    fn spot(&self, points: &[Vec4], p: DVec3, v: f64) -> Spot {
        match self.kind {
            CurveKind::Linear => self.cone(points).at(p),
            CurveKind::BSpline => self.tube(points).at(p, v),
        }
    }
}

impl Geometry {
    /// Segments of curves, or parts of them.
    #[must_use]
    pub fn curve_count(&self) -> u32 {
        self.curves.len() as u32
    }

    /// The id of the first of them.
    pub(crate) fn first_curve(&self) -> PrimId {
        (self.triangles.len() + self.analytic.len() + self.moving.len()) as u32
    }

    /// Index of a primitive among them.
    pub(crate) fn curve_index(&self, prim: PrimId) -> Option<usize> {
        let index = (prim as usize).checked_sub(self.first_curve() as usize)?;
        (index < self.curves.len()).then_some(index)
    }

    /// Where a ray meets a curve; `None` for other primitives.
    #[cold]
    pub(crate) fn intersect_curve(&self, prim: PrimId, probe: &RayProbe, t_max: f32) -> Option<Hit> {
        let index = self.curve_index(prim)?;
        let bounds = &self.curve_bounds[index];
        let (near, far) = probe.interval(bounds);
        if !(near < far && near < t_max) {
            return None;
        }
        let (origin, dir) = (probe.origin().as_dvec3(), probe.dir().as_dvec3());
        let met = self.curves[index].intersect(&self.curve_points, origin, dir)?;
        let t = probe.confine(met.t as f32, bounds, t_max)?;
        Some(Hit { t, prim, u: 0.0, v: met.v as f32, instance: Hit::NO_INSTANCE })
    }

    /// The surface at a hit of a curve.
    #[cold]
    pub(crate) fn curve_surface(&self, index: usize, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let piece = &self.curves[index];
        let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let met = piece.intersect(&self.curve_points, origin, dir);
        let met = met.unwrap_or(Met { t: f64::from(hit.t), v: f64::from(hit.v) });
        let spot = piece.spot(&self.curve_points, origin + dir * met.t, met.v);
        let shape = self.curve_shapes[index];
        let s = spot.parametrised((piece.segment, met.v), self.shapes[shape as usize].segments);
        s.rounded((hit.prim, shape), ray.time, false)
    }
}

impl Spot {
    fn parametrised(&self, (segment, v): (u32, f64), segments: u32) -> AnalyticPoint {
        // As Mitsuba: φ = 0 along cross(z across the axis, axis).
        let z = DVec3::Z - self.axis * self.axis.z;
        let up = z.try_normalize().unwrap_or(DVec3::Y);
        let side = up.cross(self.axis);
        // By how much that turns about the axis.
        let spin = self.turn.dot(side) * self.axis.z / z.length();
        let spin = if spin.is_finite() { spin } else { 0.0 };
        let mut phi = up.dot(self.out).atan2(side.dot(self.out)) / std::f64::consts::TAU;
        if phi < 0.0 {
            phi += 1.0;
        }
        let along = (f64::from(segment) + v) / f64::from(segments);
        AnalyticPoint {
            p: self.p,
            p_error: rounding_error(self.p.as_vec3(), self.p.abs().max_element() + self.around.length()),
            ng: self.n,
            ns: self.n,
            uv: Vec2::new(phi as f32, along as f32),
            dpdu: self.around * std::f64::consts::TAU,
            dpdv: (self.along + self.around * spin) * f64::from(segments),
        }
    }
}

impl GeometryBuilder {
    /// Adds curves of one kind as one shape. Control points are placed in f64 and
    /// rounded to f32 once; radii stay. Fails when `to_world` cannot be inverted,
    /// when a curve has too few points, a radius is negative or anything is not
    /// finite in f32, or when there are more than 2³¹ points or primitives in all.
    pub fn add_curves(&mut self, kind: CurveKind, curves: &Curves, to_world: &Transform) -> Result<ShapeId> {
        check_affine(to_world)?;
        let g = self.geometry_mut();
        let limit = i32::MAX as usize;
        let first = g.curve_points.len();
        let mut pieces = Vec::new();
        for range in curves.ranges() {
            if range.end as usize > curves.points.len() || range.len() < kind.points() as usize {
                let (name, least, found) = (kind.name(), kind.points(), range.len());
                let message = format!("a `{name}` needs {least} control points or more, found {found}");
                return Err(Error::new(message));
            }
            let last = range.end - kind.points();
            for point in range.start..=last {
                let ends = [point == range.start, point == last];
                pieces.push(CurvePiece::whole(kind, point + first as u32, pieces.len() as u32, ends));
            }
        }
        if first + curves.points.len() > limit {
            return Err(Error::new("more than 2^31 control points of curves"));
        }
        for (i, [x, y, z, radius]) in curves.points.iter().enumerate() {
            let p = to_world.point_f32([*x, *y, *z].into());
            if !p.is_finite() || !radius.is_finite() || !(*radius >= 0.0) {
                g.curve_points.truncate(first);
                let message =
                    format!("control point {} of curves is not finite, or its radius negative", i + 1);
                return Err(Error::new(message));
            }
            g.curve_points.push(p.extend(*radius));
        }
        let shape = g.shapes.len() as ShapeId;
        let first_piece = g.curves.len();
        let segments = pieces.len() as u32;
        // Four times as many segments, one halving less.
        let level = (0..MAX_LEVEL).filter(|l| pieces.len() <= MANY << (2 * l)).count() as u8;
        for piece in pieces {
            let bounds = triangle::bounds_of(piece.bounds(&g.curve_points));
            cut(g, piece, bounds, level);
        }
        let prim_count = g.curves.len() - first_piece;
        if g.triangles.len() + g.moving.len() + g.curves.len() > limit {
            return Err(Error::new("more than 2^31 triangles and segments of curves"));
        }
        g.curve_shapes.resize(g.curves.len(), shape);
        // Counted from 0 until the number of other primitives is known.
        let info = ShapeInfo::of(kind.name(), first_piece as u32, prim_count as u32);
        g.shapes.push(ShapeInfo { segments, ..info });
        Ok(shape)
    }
}

/// Adds a segment, in as many parts as are worth it.
fn cut(g: &mut Geometry, piece: CurvePiece, bounds: Bounds, levels: u8) {
    if levels > 0 {
        let halves = piece.halves();
        let boxes = halves.map(|half| triangle::bounds_of(half.bounds(&g.curve_points)));
        if boxes[0].half_area() + boxes[1].half_area() < WORTH * bounds.half_area() {
            for (half, bounds) in halves.into_iter().zip(boxes) {
                cut(g, half, bounds, levels - 1);
            }
            return;
        }
    }
    g.curves.push(piece);
    g.curve_bounds.push(bounds);
}
