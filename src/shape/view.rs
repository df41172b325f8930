//! A light-shaped shape as seen from a point. `sample` and `pdf` of
//! [`super::ShapeSampler`] both go through these structs, so that the choice
//! between strategies cannot differ between the two.

use std::f64::consts::TAU;

use glam::DVec2;

use super::linear::signed;
use super::{AnalyticPoint, Rectangle, Sphere};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::uniform_sphere;

/// A sphere as seen from a point. From outside it is the cone of directions
/// that meet it. From inside it is half a uniform point of its area and half a
/// uniform direction: the first is perfect for a diffuse point of the sphere
/// itself, the second bounds the weight of points close to the surface. From
/// the surface, where rounding alone decides on which side the viewer is, it is
/// its area: a point of it has the same density from either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereView {
    side: Side,
    /// The viewer relative to the centre.
    from: DVec3,
}

/// Where the viewer of a sphere is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Outside(Cone),
    /// As near to the surface as the error of a hit, give or take.
    On,
    Inside,
}

/// Distance from its surface up to which a viewer is on a sphere, in units of
/// the largest of its coordinates and the radius: four times the error of a hit
/// of 4 ulp.
const ON_SURFACE: f64 = 16.0 / (1u32 << 24) as f64;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Cone {
    /// Unit direction to the centre.
    axis: DVec3,
    /// sin of the half angle, in (0, 1).
    sin_max: f64,
    /// 1 - cos of the half angle, from the sine: no cancellation.
    one_minus_cos_max: f64,
}

impl SphereView {
    /// The view of a sphere from a point.
    #[must_use]
    pub fn new(sphere: &Sphere, from: Vec3) -> SphereView {
        let near = ON_SURFACE * f64::from(from.abs().max_element()).max(sphere.radius);
        let from = from.as_dvec3() - sphere.centre;
        let distance = from.length();
        let gap = distance - sphere.radius;
        if gap.abs() <= near {
            return SphereView { side: Side::On, from };
        }
        if !(gap > 0.0) || !distance.is_finite() {
            return SphereView { side: Side::Inside, from };
        }
        let sin_max = sphere.radius / distance;
        let cos_max = (gap * (distance + sphere.radius)).sqrt() / distance;
        let one_minus_cos_max = sin_max * sin_max / (1.0 + cos_max);
        let cone = Cone { axis: -from / distance, sin_max, one_minus_cos_max };
        SphereView { side: Side::Outside(cone), from }
    }

    /// Density per solid angle of the direction of a point whose density is
    /// `by_area` when it is chosen uniformly in area.
    #[must_use]
    pub fn pdf(&self, by_area: f64) -> f64 {
        match self.side {
            Side::Outside(cone) => 1.0 / (TAU * cone.one_minus_cos_max),
            Side::On => by_area,
            Side::Inside => 0.5 * by_area + 0.5 / (2.0 * TAU),
        }
    }

    /// True for a point of the far side as seen from outside, which is never
    /// sampled: `cos` is that between the direction to it and the normal there
    /// that points outwards.
    pub(crate) fn is_far_side(&self, cos: f32) -> bool {
        cos > 0.0 && matches!(self.side, Side::Outside(_))
    }

    /// A bare point of the sphere and its direction; `None` where the two points
    /// are one.
    pub(crate) fn sample(&self, sphere: &Sphere, u: Vec2) -> Option<(AnalyticPoint, DVec3)> {
        match self.side {
            Side::Outside(cone) => Some(cone.sample(sphere, u)),
            Side::On => self.sample_area(sphere, u),
            Side::Inside => self.sample_inside(sphere, u),
        }
    }

    fn sample_area(&self, sphere: &Sphere, u: Vec2) -> Option<(AnalyticPoint, DVec3)> {
        let point = sphere.sample_area(u);
        let wi = (point.p - sphere.centre - self.from).try_normalize()?;
        Some((point, wi))
    }

    fn sample_inside(&self, sphere: &Sphere, u: Vec2) -> Option<(AnalyticPoint, DVec3)> {
        if u.x < 0.5 {
            return self.sample_area(sphere, Vec2::new(u.x * 2.0, u.y));
        }
        let wi = uniform_sphere(Vec2::new(u.x * 2.0 - 1.0, u.y)).as_dvec3().normalize();
        let b = self.from.dot(wi);
        let c = (self.from.length() - sphere.radius) * (self.from.length() + sphere.radius);
        let root = (b * b - c).max(0.0).sqrt();
        let t = if b <= 0.0 { root - b } else { -c / (root + b) };
        let point = sphere.bare((self.from + wi * t).try_normalize()?);
        (t > 0.0).then_some((point, wi))
    }
}

impl Cone {
    /// The near point of the sphere in a uniform direction of the cone, and
    /// that direction. pbrt-v4 equation 6.11.
    fn sample(&self, sphere: &Sphere, u: Vec2) -> (AnalyticPoint, DVec3) {
        let Cone { axis, sin_max, one_minus_cos_max } = *self;
        let one_minus_cos = f64::from(u.x) * one_minus_cos_max;
        let cos = 1.0 - one_minus_cos;
        let sin2 = one_minus_cos * (2.0 - one_minus_cos);
        let ratio = sin2.sqrt() / sin_max;
        // The angle at the centre between the point and the viewer.
        let cos_alpha = (sin2 / sin_max + cos * ((1.0 - ratio) * (1.0 + ratio)).max(0.0).sqrt()).min(1.0);
        let sin_alpha = ((1.0 - cos_alpha) * (1.0 + cos_alpha)).sqrt();
        let phi = TAU * f64::from(u.y);
        let point = sphere.at_angle(-axis, cos_alpha, sin_alpha, phi);
        let across = (point.p - sphere.centre) / sphere.radius + axis * cos_alpha;
        let across = across.try_normalize().unwrap_or(DVec3::ZERO);
        (point, (axis * cos + across * sin2.sqrt()).normalize())
    }
}

/// What of a rectangle does not depend on the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RectFrame {
    centre: DVec3,
    /// Unit, along the edges.
    x: DVec3,
    y: DVec3,
    /// Edge lengths.
    width: f64,
    height: f64,
    /// Unit shading normal, if it is the same everywhere.
    ns: Option<DVec3>,
    /// Its corners are right angles.
    square: bool,
}

impl RectFrame {
    /// Largest cosine between the edges of what counts as a rectangle.
    const MAX_SHEAR: f64 = 1e-9;

    pub(crate) fn new(rectangle: &Rectangle) -> RectFrame {
        let plane = &rectangle.plane;
        let frame = RectFrame::from_edges(plane.centre, plane.x * 2.0, plane.y * 2.0, Some(rectangle.ns));
        let square = frame.x.dot(frame.y).abs() <= RectFrame::MAX_SHEAR;
        RectFrame { square, ..frame }
    }

    /// From edges at right angles and the normal, if it is the same everywhere.
    pub(crate) fn from_edges(centre: DVec3, x: DVec3, y: DVec3, ns: Option<DVec3>) -> RectFrame {
        let (width, height) = (x.length(), y.length());
        RectFrame { centre, x: x / width, y: y / height, width, height, ns, square: true }
    }

    /// The same for what has no back.
    pub(crate) fn without_normal(self) -> RectFrame {
        RectFrame { ns: None, ..self }
    }

    /// True when `from` is behind the rectangle or all of it lies below the
    /// horizon of `normal` there.
    pub(crate) fn is_hidden(&self, from: Vec3, normal: Option<Vec3>) -> bool {
        let to_centre = self.centre - from.as_dvec3();
        if self.ns.is_some_and(|ns| ns.dot(to_centre) >= 0.0) {
            return true;
        }
        normal.is_some_and(|n| {
            let n = n.as_dvec3();
            let reach = self.width * n.dot(self.x).abs() + self.height * n.dot(self.y).abs();
            n.dot(to_centre) + 0.5 * reach <= 0.0
        })
    }
}

/// A rectangle as seen from a point: nearby it is the spherical rectangle of
/// Ureña, Fajardo, King 2013, "An Area-Preserving Parametrization for
/// Spherical Rectangles"; far away, or when it is not rectangular, its area.
///
/// The inner angle g at the corner (x, y) of a rectangle at distance |z| has
/// cos g : sin g = ±x·y : |z|·r with r the distance to the corner. The solid
/// angle S = Σg − 2π is the argument of the product of the four complex
/// numbers cos g + i sin g: one arc tangent for all four angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectView {
    spherical: Option<Spherical>,
}

/// Names as in listing 1 of the paper, lengths in units of the largest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spherical {
    x0: f64,
    x1: f64,
    y0: f64,
    y1: f64,
    z0: f64,
    /// e^(ik), not normalised.
    k: DVec2,
    solid_angle: f64,
}

/// The product of two complex numbers.
fn times(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

impl RectView {
    /// Solid angles below this (sr) are lost in the rounding of the angle sum.
    const MIN_SOLID_ANGLE: f64 = 1e-7;
    /// Sampling by solid angle pays when the diagonal is longer than this
    /// fraction of the distance.
    const MIN_RATIO: f64 = 1.0;

    /// The view of a rectangle from a point.
    #[must_use]
    pub fn new(rectangle: &Rectangle, from: Vec3) -> RectView {
        RectView::of(&RectFrame::new(rectangle), from)
    }

    /// The same for a rectangle made ready.
    pub(crate) fn of(frame: &RectFrame, from: Vec3) -> RectView {
        RectView { spherical: RectView::spherical(frame, from.as_dvec3()) }
    }

    fn spherical(frame: &RectFrame, from: DVec3) -> Option<Spherical> {
        let RectFrame { centre, x, y, width, height, square, .. } = *frame;
        let to_centre = centre - from;
        let diagonal2 = width * width + height * height;
        let near = diagonal2 >= RectView::MIN_RATIO * RectView::MIN_RATIO * to_centre.length_squared();
        if !square || !near {
            return None;
        }
        let (x0, y0) = (to_centre.dot(x) - 0.5 * width, to_centre.dot(y) - 0.5 * height);
        let (x1, y1) = (x0 + width, y0 + height);
        let z0 = -to_centre.dot(x.cross(y)).abs();
        let largest = x0.abs().max(x1.abs()).max(y0.abs().max(y1.abs())).max(-z0);
        let unit = 1.0 / largest;
        let (x0, x1, y0, y1, z0) = (x0 * unit, x1 * unit, y0 * unit, y1 * unit, z0 * unit);
        let corner =
            |x: f64, y: f64, sign: f64| DVec2::new(x * y * sign, -z0 * (x * x + y * y + z0 * z0).sqrt());
        let k = times(corner(x0, y1, 1.0), corner(x0, y0, -1.0));
        let all = times(times(corner(x1, y0, 1.0), corner(x1, y1, -1.0)), k);
        let angle = all.y.atan2(all.x);
        // More than half a sphere only close before the middle; else it is the rounding of nothing.
        let close = -z0 < (x1 - x0).min(y1 - y0) && x0 < 0.0 && x1 > 0.0 && y0 < 0.0 && y1 > 0.0;
        let solid_angle = if angle < 0.0 && close { angle + TAU } else { angle };
        let usable = z0 < 0.0 && solid_angle > RectView::MIN_SOLID_ANGLE;
        usable.then_some(Spherical { x0, x1, y0, y1, z0, k: DVec2::new(k.x, -k.y), solid_angle })
    }

    /// Density per solid angle; `None` when points are uniform in area.
    #[must_use]
    pub fn pdf(&self) -> Option<f64> {
        self.spherical.map(|s| 1.0 / s.solid_angle)
    }

    /// A point of the rectangle, uniform in solid angle, in coordinates of
    /// \[-1, 1\]²; `None` when points are to be uniform in area.
    pub(crate) fn sample(&self, u: Vec2) -> Option<[f64; 2]> {
        let s = self.spherical?;
        let (b0, b1) =
            (-s.y0 / (s.y0 * s.y0 + s.z0 * s.z0).sqrt(), s.y1 / (s.y1 * s.y1 + s.z0 * s.z0).sqrt());
        let (sin, cos) = (f64::from(u.x) * s.solid_angle).sin_cos();
        let au = times(DVec2::new(cos, sin), s.k);
        let fu = (au.x * b0 - au.length() * b1) / au.y;
        let cu = (1.0 / (fu * fu + b0 * b0).sqrt()).copysign(fu).clamp(-1.0, 1.0);
        let sin_u = ((1.0 - cu) * (1.0 + cu)).sqrt();
        let xu = (-(cu * s.z0) / sin_u).clamp(s.x0, s.x1);
        let d2 = xu * xu + s.z0 * s.z0;
        let (h0, h1) = (s.y0 / (d2 + s.y0 * s.y0).sqrt(), s.y1 / (d2 + s.y1 * s.y1).sqrt());
        let hv = h0 + f64::from(u.y) * (h1 - h0);
        let rest = (1.0 - hv) * (1.0 + hv);
        let yv = if rest > 0.0 { (hv * (d2 / rest).sqrt()).clamp(s.y0, s.y1) } else { s.y1 };
        let local =
            |value: f64, low: f64, high: f64| (2.0 * (value - low) / (high - low) - 1.0).clamp(-1.0, 1.0);
        if xu.is_nan() || yv.is_nan() {
            return Some([signed(u.x), signed(u.y)]);
        }
        Some([local(xu, s.x0, s.x1), local(yv, s.y0, s.y1)])
    }
}
