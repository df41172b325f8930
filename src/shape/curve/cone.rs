//! A segment of a linear curve: the hull of the spheres at its two ends, in
//! closed form.
//!
//! Along the axis let y be the way from the first centre and k = (r₁ − r₀)/L the
//! slope of the radius. The sphere about the axis at yc touches the hull where
//! y = yc − k·r and the distance from the axis is ρ = c·r, c = √(1 − k²); so the
//! hull's side is the cone c·ρ = r₀ + k·y, a point of it belongs to yc = y + k·ρ/c,
//! and its normal is (−k, c). With the ray written from its point nearest to the
//! axis, with perpendicular part q and unit direction (s across, z along),
//! c²·|q + e·τ|² = (R + k·z·τ)², R = r₀ + k·y, is a quadratic all of whose
//! coefficients are of the size of the radius, and its discriminant is a product
//! and terms that vanish with the slope: thin cones lose no digits (the usual
//! form takes the difference of squares of lengths). Of its roots
//! (−B ∓ √D)/A the first is always where the ray goes in.
//!
//! Only what is on the outside of the hull counts: the cone between its two
//! circles and the spheres beyond them, each to within 1e-9 so that nothing is
//! between. Where one sphere holds the other, it is all there is.

use super::{Met, Spot};
use crate::math::{Bounds, DVec3, DVec4};

/// The hull of two spheres.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoundCone {
    base: DVec3,
    end: DVec3,
    radii: [f64; 2],
    /// Unit; zero where the centres coincide.
    axis: DVec3,
    length: f64,
    /// Slope of the radius, and √(1 − slope²); not looked at where one sphere
    /// holds the other.
    slope: f64,
    cos: f64,
    /// Which sphere is all there is.
    only: Option<usize>,
}

/// Relative tolerance at the seams.
const SEAM: f64 = 1e-9;
/// How deep in a neighbour a point is hidden by it, relative to the radius. More
/// than rounding, or rays could pass between two segments.
const DEEP: f64 = 1e-7;

impl RoundCone {
    /// From two centres and their radii.
    pub fn new([a, b]: [DVec4; 2]) -> RoundCone {
        let (base, end) = (a.truncate(), b.truncate());
        let radii = [a.w, b.w];
        let length = (end - base).length();
        let rise = radii[1] - radii[0];
        let only = (!(rise.abs() < length)).then(|| usize::from(rise > 0.0));
        let slope = if only.is_some() { 0.0 } else { rise / length };
        RoundCone {
            base,
            end,
            radii,
            axis: if length > 0.0 { (end - base) / length } else { DVec3::ZERO },
            length,
            slope,
            cos: ((1.0 - slope) * (1.0 + slope)).sqrt(),
            only,
        }
    }

    /// The box of the spheres between two places.
    pub fn bounds(&self, range: [f64; 2]) -> Bounds {
        let [(a, ra), (b, rb)] = range.map(|v| (self.base.lerp(self.end, v), self.radius(v)));
        let (ra, rb) = (DVec3::splat(ra), DVec3::splat(rb));
        let (mut min, mut max) = ((a - ra).min(b - rb), (a + ra).max(b + rb));
        if let Some(only) = self.only {
            // The part that has the sphere needs its box, and no other has anything.
            let (centre, r) = ([self.base, self.end][only], DVec3::splat(self.radii[only]));
            (min, max) = (centre - r, centre + r);
        }
        Bounds { min: min.as_vec3(), max: max.as_vec3() }
    }

    fn radius(&self, v: f64) -> f64 {
        self.radii[0] + (self.radii[1] - self.radii[0]) * v
    }

    /// Where along the segment the sphere is that touches the hull below a point.
    fn place(&self, p: DVec3) -> f64 {
        match self.only {
            Some(only) => only as f64,
            None => {
                let offset = p - self.base;
                let y = offset.dot(self.axis);
                let rho = (offset - self.axis * y).length();
                ((y + self.slope * rho / self.cos) / self.length).clamp(0.0, 1.0)
            }
        }
    }

    /// True when a point is well inside.
    pub fn hides(&self, p: DVec3) -> bool {
        let v = self.place(p);
        (p - self.base.lerp(self.end, v)).length() < self.radius(v) * (1.0 - DEEP)
    }

    /// Where a ray goes in, within a stretch of the segment; `caps` says which
    /// spheres count.
    pub fn intersect(&self, (origin, dir): (DVec3, DVec3), range: [f64; 2], caps: [bool; 2]) -> Option<Met> {
        let speed = dir.length();
        let d = dir / speed;
        let mut best: Option<Met> = None;
        let mut take = |tau: f64, v: f64| {
            let t = tau / speed;
            let rounded = t as f32;
            if rounded > 0.0 && rounded.is_finite() && best.is_none_or(|b| t < b.t) {
                best = Some(Met { t, v: v.clamp(0.0, 1.0) });
            }
        };
        if let Some((tau, v)) = self.side(origin - self.base, d, range) {
            take(tau, v);
        }
        for (i, centre) in [self.base, self.end].into_iter().enumerate() {
            if !caps[i] || self.only.is_some_and(|only| only != i) {
                continue;
            }
            let Some((tau, n)) = ball(origin - centre, d, self.radii[i]) else { continue };
            // How far the sphere's point lies towards the other end.
            let along = n.dot(self.axis) + self.slope;
            let inward = if i == 0 { along } else { -along };
            if self.only.is_some() || inward <= SEAM {
                take(tau, i as f64);
            }
        }
        best
    }

    /// The cone: where the ray, of unit direction, goes in, and how far along.
    fn side(&self, o: DVec3, d: DVec3, range: [f64; 2]) -> Option<(f64, f64)> {
        if self.only.is_some() {
            return None;
        }
        let (k, c, r0) = (self.slope, self.cos, self.radii[0]);
        let z = d.dot(self.axis);
        let e = d - self.axis * z;
        let s2 = e.length_squared();
        let o_along = o.dot(self.axis);

        // The point nearest to the axis, but beside the segment.
        let reach = self.length + self.radii[0].max(self.radii[1]);
        let mut from = -(o - self.axis * o_along).dot(e) / s2;
        if z != 0.0 {
            let [a, b] = [(-reach - o_along) / z, (self.length + reach - o_along) / z];
            from = if from.is_finite() { from.clamp(a.min(b), a.max(b)) } else { a.min(b) };
        }
        let p = o + d * from;
        let y = p.dot(self.axis);
        let q = p - self.axis * y;

        let r = r0 + k * y;
        let g = q.dot(e);
        let q2 = q.length_squared();
        let moment = q.cross(e).dot(self.axis).abs();
        let s = s2.sqrt();
        let a = (s - k.abs()) * (s + k.abs());
        let b = c * c * g - k * z * r;
        let distance = q2.sqrt();
        let constant = (c * distance - r) * (c * distance + r);
        let slanted = k * z * (k * z * q2 - 2.0 * g * r);
        let d4 = (s * r - c * moment) * (s * r + c * moment) + slanted;
        if !(d4 > 0.0) {
            return None;
        }
        let root = c * d4.sqrt();
        let tau = if b > 0.0 { -(b + root) / a } else { constant / (root - b) };
        // On the right one of the two cones, and between the circles.
        let rise = y + z * tau;
        let rho = (q + e * tau).length();
        let v = (rise + k * rho / c) / self.length;
        let valid = r0 + k * rise > 0.0 && v >= range[0] - SEAM && v <= range[1] + SEAM;
        (valid && tau.is_finite()).then_some((from + tau, v))
    }

    /// The surface nearest to a point.
    pub fn at(&self, p: DVec3) -> Spot {
        let v = self.place(p);
        let centre = self.base.lerp(self.end, v);
        let radius = self.radius(v);
        let axis = if self.axis == DVec3::ZERO { DVec3::X } else { self.axis };
        let n = (p - centre).try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector());
        Spot {
            p: centre + n * radius,
            n,
            axis,
            out: n,
            turn: DVec3::ZERO,
            around: axis.cross(n) * radius,
            along: (self.end - self.base) + n * (self.radii[1] - self.radii[0]),
        }
    }
}

/// Where a ray goes into a sphere about the origin, and its normal there. The
/// root is taken from the point nearest to the centre, where nothing cancels.
fn ball(o: DVec3, d: DVec3, radius: f64) -> Option<(f64, DVec3)> {
    let middle = -o.dot(d);
    let across = o + d * middle;
    let distance = across.length();
    if !(distance < radius) {
        return None;
    }
    let half = ((radius - distance) * (radius + distance)).sqrt();
    Some((middle - half, (across - d * half) / radius))
}
