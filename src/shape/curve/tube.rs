//! A segment of a B-spline curve: a circle swept along a cubic, across its
//! tangent, as `RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE` of Embree.
//!
//! The point R(τ) of the ray lies in the plane of the circle at u where
//! (R − c)·c′ = 0, and on the circle where f = |R − c|² − r² = 0. On a piece of
//! the cubic that turns little, u is a smooth function of τ, and f(τ), with
//! f′ = 2·(R − c)·d − 2·r·r′·u′, is close to a parabola: exactly one for a
//! straight cone. The ray goes in at its first zero, which is found by Newton's
//! method within a bracket; an f that stays above zero is told by two tangents that
//! meet above it. So neither rays along the silhouette nor rays across the axis
//! (for which solving for u first is ill-conditioned: both hits have the same) are
//! special. (The iteration of Reshetov and Luebke 2018, "Phantom Ray-Hair
//! Intersector", PACMCGIT 1(2), is quicker and finds the nearest cone's hit; it
//! promises nothing at silhouettes and bends.)
//!
//! The cubic is halved, as in pbrt-v4 (section 6.7), as long as a piece whose
//! hull comes within its radius of the ray turns by more than a fifth of a
//! radian, or f may have both a convex and a concave stretch: it is convex where
//! the ray is more slanted against the curve than that bends and widens. For rays
//! nearly along the curve halving ends with slices of a quarter of the radius, in
//! which what is left of the other stretch could hide a grazing hit alone.
//!
//! Bounds: where a circle is wider than the curve's own radius of curvature the
//! surface runs through itself within the tube. Rays do not go in there, and
//! what is inside out is left out.

use super::{Met, Spot};
use crate::math::{Bounds, DVec3, DVec4};
use crate::shape::linear::basis;

/// A cubic with a radius in Bézier form.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube([DVec4; 4]);

/// Largest turn of a piece, as the square of the sine.
const TURN: f64 = 0.04;
/// Length of a slice, in radii.
const SLICE: f64 = 0.25;
/// Halvings at most.
const DEPTH: u32 = 14;
/// By how much of a piece its neighbours overlap it, so that nothing is between.
const SEAM: f64 = 1e-9;

impl Tube {
    /// From four control points of the uniform B-spline.
    pub fn new([a, b, c, d]: [DVec4; 4]) -> Tube {
        Tube([(a + 4.0 * b + c) / 6.0, (2.0 * b + c) / 3.0, (b + 2.0 * c) / 3.0, (b + 4.0 * c + d) / 6.0])
    }

    /// The stretch between two places.
    fn part(&self, [v0, v1]: [f64; 2]) -> Tube {
        let mut part = *self;
        if v1 < 1.0 {
            part = part.split(v1)[0];
        }
        if v0 > 0.0 {
            part = part.split(v0 / v1)[1];
        }
        part
    }

    /// De Casteljau.
    fn split(&self, v: f64) -> [Tube; 2] {
        let [a, b, c, d] = self.0;
        let (ab, bc, cd) = (a.lerp(b, v), b.lerp(c, v), c.lerp(d, v));
        let (abc, bcd) = (ab.lerp(bc, v), bc.lerp(cd, v));
        let middle = abc.lerp(bcd, v);
        [Tube([a, ab, abc, middle]), Tube([middle, bcd, cd, d])]
    }

    /// Centre and radius, and their first and second derivatives.
    fn eval(&self, v: f64) -> [DVec4; 3] {
        let [a, b, c, d] = self.0;
        let w = 1.0 - v;
        let (e0, e1, e2) = (b - a, c - b, d - c);
        let point = a * (w * w * w) + b * (3.0 * w * w * v) + c * (3.0 * w * v * v) + d * (v * v * v);
        let first = (e0 * (w * w) + e1 * (2.0 * w * v) + e2 * (v * v)) * 3.0;
        let second = ((e1 - e0) * w + (e2 - e1) * v) * 6.0;
        [point, first, second]
    }

    fn max_radius(&self) -> f64 {
        self.0.iter().map(|b| b.w).fold(0.0, f64::max)
    }

    /// The box of a stretch: the hull, wider by the largest radius.
    pub fn bounds(&self, range: [f64; 2]) -> Bounds {
        let part = self.part(range);
        let [a, b, c, d] = part.0.map(DVec4::truncate);
        let r = DVec3::splat(part.max_radius());
        Bounds { min: (a.min(b).min(c).min(d) - r).as_vec3(), max: (a.max(b).max(c).max(d) + r).as_vec3() }
    }

    /// Where a ray goes in, within a stretch.
    pub fn intersect(&self, (origin, dir): (DVec3, DVec3), range: [f64; 2]) -> Option<Met> {
        let speed = dir.length();
        let d = dir / speed;
        // The ray becomes the z axis, 0 where it is nearest to the middle.
        let middle = (self.0[0] + self.0[3]).truncate() * 0.5;
        let o = origin - middle;
        let from = -o.dot(d);
        let shift = middle + (o + d * from);
        let (s, t) = basis(d);
        let turned = |b: DVec4| {
            let p = b.truncate() - shift;
            DVec4::new(p.dot(s), p.dot(t), p.dot(d), b.w)
        };
        let whole = Tube(self.0.map(turned)).part(range);

        let mut search = Search { near: -from, speed, best: None };
        search.within(&whole, 0, 0.0);
        let (tau, v) = search.best?;
        let v = range[0] + (range[1] - range[0]) * v.clamp(0.0, 1.0);
        Some(Met { t: (tau + from) / speed, v })
    }

    /// The hull of the piece does not come within its radius of the z axis from
    /// `near` to `far`.
    fn is_aside(&self, near: f64, far: f64) -> bool {
        let b = &self.0;
        let r = self.max_radius();
        let beside = |f: &dyn Fn(&DVec4) -> f64, reach: f64| {
            let values = [f(&b[0]), f(&b[1]), f(&b[2]), f(&b[3])];
            values.iter().all(|x| *x > reach) || values.iter().all(|x| *x < -reach)
        };
        // Across the chord as the ray sees it, which a slender piece hugs.
        let (dx, dy) = (b[3].x - b[0].x, b[3].y - b[0].y);
        !(r > 0.0)
            || b.iter().all(|b| b.z + r < near)
            || b.iter().all(|b| b.z - r > far)
            || beside(&|b| b.x, r)
            || beside(&|b| b.y, r)
            || beside(&|b| b.x * dy - b.y * dx, r * dx.hypot(dy))
    }

    /// f is convex or concave all along the piece, so that it need not be halved.
    ///
    /// f″/2 = 1 − z·u′ − (r′² + r·r″)·u′² − r·r′·u″ with z = c′·d: the square of
    /// the sine between ray and curve, less that of the radius' slope, up to what
    /// bends, for which twice |c″|·r and |r″|·r over |c′|² are room enough.
    fn is_simple(&self) -> bool {
        let [a, b, c, d] = self.0;
        let edges = [b - a, c - b, d - c];
        let chord = (d - a).truncate();
        let chord2 = chord.length_squared();
        let r_max = self.max_radius();
        let r_min = self.0.iter().map(|b| b.w).fold(f64::INFINITY, f64::min);
        let length: f64 = edges.iter().map(|e| e.truncate().length()).sum();
        if length <= SLICE * r_min {
            return true;
        }
        // The largest angle of the hodograph with the chord, and its least length.
        let (mut turn2, mut slowest, mut fastest) = (0.0f64, f64::INFINITY, 0.0f64);
        for e in edges.map(DVec4::truncate) {
            let along = e.dot(chord);
            if !(along > 0.0) {
                return false;
            }
            let length2 = e.length_squared();
            turn2 = turn2.max(e.cross(chord).length_squared() / (length2 * chord2));
            slowest = slowest.min(along);
            fastest = fastest.max(length2);
        }
        let slowest2 = slowest * slowest / chord2;
        let bend = [edges[1] - edges[0], edges[2] - edges[1]];
        let largest = |f: &dyn Fn(&DVec4) -> f64| bend.iter().map(f).fold(0.0, f64::max);
        let bend = largest(&|b| b.truncate().length()) + largest(&|b| b.w.abs());
        // c′ is three times an edge and c″ six times a difference of two.
        let rest = 2.0 * r_max * bend * 6.0 / (9.0 * slowest2);
        if turn2 > TURN || rest > 1.0 {
            return false;
        }
        let slant = ((chord.x * chord.x + chord.y * chord.y) / chord2).sqrt();
        let turn = turn2.sqrt();
        let (least, most) = ((slant - turn).max(0.0), slant + turn);
        let rises = edges.map(|e| e.w);
        let steepest = rises.iter().fold(0.0f64, |a, r| a.max(r * r)) / slowest2;
        let one_way = rises.iter().all(|r| *r > 0.0) || rises.iter().all(|r| *r < 0.0);
        let gentlest = rises.iter().fold(f64::INFINITY, |a, r| a.min(r * r)) / fastest;
        least * least >= steepest + rest || (one_way && most * most + rest <= gentlest)
    }

    /// Where the z axis goes in, from `near` on: its coordinate, and where along
    /// the piece.
    fn enter(&self, near: f64) -> Option<(f64, f64)> {
        let b = &self.0;
        // For certain outside.
        let r = 2.0 * self.max_radius();
        let mut lo = b.iter().map(|b| b.z).fold(f64::INFINITY, f64::min) - r;
        let mut hi = b.iter().map(|b| b.z).fold(f64::NEG_INFINITY, f64::max) + r;
        lo = lo.max(near);
        // Between the planes of the first and the last circle.
        let [_, start, _] = self.eval(0.0);
        let [_, end, _] = self.eval(1.0);
        for (point, across, side) in [(b[0], start.truncate(), 1.0), (b[3], end.truncate(), -1.0)] {
            let slope = side * across.z;
            let height = side * point.truncate().dot(across) - SEAM * across.length_squared();
            if slope > 0.0 {
                lo = lo.max(height / slope);
            } else if slope < 0.0 {
                hi = hi.min(height / slope);
            } else if height > 0.0 {
                return None;
            }
        }
        if !(lo < hi) {
            return None;
        }
        let (mut a, mut z) = (self.probe(lo), self.probe(hi));
        if !(a.f > 0.0) {
            return None;
        }
        if z.f > 0.0 {
            z = self.dip(&mut a, z)?;
        }
        self.root(a, z)
    }

    /// Between two points outside, one that is inside; moves `a` towards it.
    fn dip(&self, a: &mut Probe, mut z: Probe) -> Option<Probe> {
        for step in 0..60 {
            if !(a.slope < 0.0 && z.slope > 0.0) {
                return None;
            }
            let width = z.tau - a.tau;
            // The tangents meet at or below the lowest point.
            let meet = (z.f - a.f - z.slope * width) / (a.slope - z.slope);
            if a.f + a.slope * meet > 0.0 {
                return None;
            }
            let secant = a.tau - a.slope * width / (z.slope - a.slope);
            let next = if step % 3 == 2 { a.tau + 0.5 * width } else { secant };
            if !(next > a.tau && next < z.tau) {
                return None;
            }
            let middle = self.probe(next);
            if middle.f <= 0.0 {
                return Some(middle);
            }
            *(if middle.slope < 0.0 { &mut *a } else { &mut z }) = middle;
        }
        None
    }

    /// Between a point outside and one inside, where the ray goes in.
    fn root(&self, mut a: Probe, mut z: Probe) -> Option<(f64, f64)> {
        let tolerance = 1e-13 * self.max_radius();
        let mut at = a;
        for _ in 0..100 {
            let newton = at.tau - at.f / at.slope;
            let inside = newton > a.tau && newton < z.tau;
            let next = if inside { newton } else { 0.5 * (a.tau + z.tau) };
            if !(next > a.tau && next < z.tau) {
                break;
            }
            let step = (next - at.tau).abs();
            at = self.probe(next);
            *(if at.f > 0.0 { &mut a } else { &mut z }) = at;
            if step <= tolerance && inside {
                break;
            }
        }
        let v = at.v;
        (at.outward && (-SEAM..=1.0 + SEAM).contains(&v)).then_some((at.tau, v))
    }

    /// The point `tau` of the z axis against the circle in whose plane it lies.
    fn probe(&self, tau: f64) -> Probe {
        let p = DVec3::new(0.0, 0.0, tau);
        let (v, [c, c1, c2]) = self.foot(p);
        let offset = p - c.truncate();
        let fall = c1.truncate().length_squared() - offset.dot(c2.truncate());
        let distance = offset.length();
        // Where the foot is held at an end it does not move.
        let moves = fall > 0.0 && v > -SEAM && v < 1.0 + SEAM;
        let turning = if moves { c1.z / fall } else { 0.0 };
        Probe {
            tau,
            v,
            f: (distance - c.w) * (distance + c.w),
            slope: 2.0 * (offset.z - c.w * c1.w * turning),
            outward: fall > 0.0,
        }
    }

    /// The place of the piece in whose plane a point lies, held within the piece,
    /// with the curve there.
    fn foot(&self, p: DVec3) -> (f64, [DVec4; 3]) {
        let (a, d) = (self.0[0].truncate(), self.0[3].truncate());
        let chord = d - a;
        let hold = |v: f64| if v >= -SEAM { v.min(1.0 + SEAM) } else { -SEAM };
        let mut v = hold((p - a).dot(chord) / chord.length_squared());
        let mut curve = self.eval(v);
        for _ in 0..8 {
            let [c, c1, c2] = curve;
            let (offset, along) = (p - c.truncate(), c1.truncate());
            let speed2 = along.length_squared();
            // Newton's, but never more than four times the plain projection.
            let fall = (speed2 - offset.dot(c2.truncate())).max(0.25 * speed2);
            let next = hold(v + offset.dot(along) / fall);
            let step = (next - v).abs();
            if !(step > 0.0) {
                break;
            }
            v = next;
            curve = self.eval(v);
            if step < 1e-14 {
                break;
            }
        }
        (v, curve)
    }

    /// The surface nearest to a point, near a place.
    pub fn at(&self, p: DVec3, v: f64) -> Spot {
        let mut v = v;
        for _ in 0..2 {
            let [c, c1, c2] = self.eval(v);
            let (offset, along) = (p - c.truncate(), c1.truncate());
            let fall = along.length_squared() - offset.dot(c2.truncate());
            let next = v + offset.dot(along) / fall;
            if fall > 0.0 && (-SEAM..=1.0 + SEAM).contains(&next) {
                v = next;
            }
        }
        let [c, c1, c2] = self.eval(v);
        let (centre, along, bend) = (c.truncate(), c1.truncate(), c2.truncate());
        let axis = along.try_normalize().unwrap_or(DVec3::X);
        let offset = p - centre;
        let across = offset - axis * offset.dot(axis);
        let out = across.try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector());
        let stretch = 1.0 - c.w * out.dot(bend) / along.length_squared();
        // Across both tangents, out × along the axis and `along` of the surface.
        let n = out * (along.length() * stretch) - axis * c1.w;
        let turn = bend / along.length();
        Spot {
            turn: if turn.is_finite() { turn } else { DVec3::ZERO },
            p: centre + out * c.w,
            n: if stretch > 0.0 { n.try_normalize().unwrap_or(out) } else { out },
            axis,
            out,
            around: axis.cross(out) * c.w,
            along: if stretch.is_finite() { along * stretch + out * c1.w } else { along },
        }
    }
}

/// The nearest hit so far along the z axis.
struct Search {
    /// Where the ray begins, and its parameter for a unit of length.
    near: f64,
    speed: f64,
    best: Option<(f64, f64)>,
}

impl Search {
    /// Looks at a piece that is 2^-`depth` of the whole, from `start` on.
    fn within(&mut self, piece: &Tube, depth: u32, start: f64) {
        if piece.is_aside(self.near, self.best.map_or(f64::INFINITY, |b| b.0)) {
            return;
        }
        let size = 1.0 / f64::from(1u32 << depth);
        if depth < DEPTH && !piece.is_simple() {
            let [a, b] = piece.split(0.5);
            self.within(&a, depth + 1, start);
            self.within(&b, depth + 1, start + 0.5 * size);
            return;
        }
        let Some((tau, v)) = piece.enter(self.near) else { return };
        let rounded = ((tau - self.near) / self.speed) as f32;
        if rounded > 0.0 && rounded.is_finite() && self.best.is_none_or(|b| tau < b.0) {
            self.best = Some((tau, start + size * v));
        }
    }
}

/// A point of the ray.
#[derive(Clone, Copy, Debug)]
struct Probe {
    tau: f64,
    v: f64,
    /// Square of its distance from the curve less that of the radius, and its
    /// derivative along the ray.
    f: f64,
    slope: f64,
    /// The surface is not inside out here.
    outward: bool,
}
