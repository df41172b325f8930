//! Surfaces: what a ray can hit, where, and how a shape is sampled as a light.
//!
//! [`GeometryBuilder`] turns meshes and analytic shapes into one immutable
//! [`Geometry`] of primitives: triangles first ([`PrimId`] 0 ..
//! [`Geometry::triangle_count`]), analytic primitives after them.
//! [`Geometry::intersect`] tests one primitive and gives a [`Hit`];
//! [`Geometry::surface`] turns a hit into a [`SurfacePoint`], from which rays
//! leave outside the point's own error box. [`ShapeSampler`] samples a shape
//! as seen from a point.
//!
//! Numerical rules, all of them homogeneous (a scene scaled by a power of two
//! gives the same barycentrics and distances bit for bit, and there is no
//! epsilon that has a unit):
//! * triangles are watertight (Woop, Benthin, Wald 2013) with exact edge signs;
//! * quadrics and flat analytic shapes are intersected in f64;
//! * points come from barycentrics, or are projected onto the quadric, and
//!   carry bounds of their error (pbrt-v4 section 6.8);
//! * the parameter of every hit lies in the interval in which the ray is inside
//!   the primitive's own box. An accelerator that culls boxes with the same
//!   arithmetic ([`RayProbe`]) therefore finds exactly what brute force finds.
//!
//! Parametrisations (uv, ∂p/∂u, ∂p/∂v, side of the normals, mirrored
//! transforms) are those of Mitsuba 3.9.
//!
//! Vertices and analytic primitives are in one common space, that of the
//! transforms handed in, or in that of their group. Groups ([`Geometry::parts`])
//! are seen through [`Instance`]s, which place them, still or moving; triangles
//! that deform have vertices at several times and are interpolated when a ray
//! meets them. Curves are many small primitives of one shape (`curve`). Order of
//! ids: triangles, analytic primitives, deforming triangles, curves, instances.

mod attributes;
mod builder;
mod curve;
mod cylinder;
mod deform;
mod disk;
mod geometry;
mod instance;
mod linear;
mod loose;
mod mesh;
mod pattern;
mod probe;
mod quad;
mod rectangle;
mod sampler;
mod sphere;
mod surface;
mod triangle;
mod triangle_view;
mod view;

pub use builder::{GeometryBuilder, MeshOptions, MeshReport};
pub use curve::CurveKind;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use geometry::{Geometry, ShapeInfo};
pub use instance::{Instance, Placed, Sweep};
pub use pattern::Pattern;
pub use probe::RayProbe;
pub use rectangle::Rectangle;
pub use sampler::ShapeSampler;
pub use sphere::Sphere;
pub use surface::{ShapeSample, SurfacePoint};
#[cfg(target_arch = "x86_64")]
pub(crate) use triangle::WIDENING;
pub use triangle_view::TriangleView;
pub use view::{RectView, SphereView};

use crate::desc::kinds;
use crate::math::{Bounds, DVec3, Transform, Vec2, Vec3};

/// Index of a primitive (a triangle, an analytic shape or an instance).
pub type PrimId = u32;

/// Index of a shape of the scene file; a mesh is one shape of many primitives.
pub type ShapeId = u32;

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, finite and above 0.
    pub t: f32,
    /// The primitive.
    pub prim: PrimId,
    /// Triangles: barycentric of the second vertex. Rectangle and disk: local
    /// x. Else 0.
    pub u: f32,
    /// Triangles: barycentric of the third vertex. Rectangle and disk: local
    /// y. Else 0.
    pub v: f32,
    /// The instance through which the primitive was hit, in whose space it
    /// is; [`Hit::NO_INSTANCE`] when in none.
    pub instance: PrimId,
}

impl Hit {
    /// The value of `instance` for "none".
    pub const NO_INSTANCE: PrimId = PrimId::MAX;

    /// Hits of the same parameter are decided by this: the lowest wins.
    #[inline(always)]
    pub(crate) fn rank(&self) -> (PrimId, PrimId) {
        if self.instance == Hit::NO_INSTANCE { (self.prim, 0) } else { (self.instance, self.prim) }
    }
}

kinds! {
    /// A primitive that is not a triangle.
    #[derive(Clone, Debug)]
    pub enum Analytic {
        /// A full sphere.
        Sphere(Sphere) = ["sphere"],
        /// A flat disk, or an ellipse.
        Disk(Disk) = ["disk"],
        /// The side of a cylinder, without caps.
        Cylinder(Cylinder) = ["cylinder"],
        /// A flat parallelogram.
        Rectangle(Rectangle) = ["rectangle"],
    }
}

/// Where a ray meets an analytic primitive: the parameter and two numbers of
/// its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnalyticHit {
    pub t: f32,
    pub u: f32,
    pub v: f32,
}

/// The differential geometry of an analytic primitive at a point, in f64 where
/// it is still to be rounded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnalyticPoint {
    pub p: DVec3,
    pub p_error: Vec3,
    pub ng: DVec3,
    pub ns: DVec3,
    pub uv: Vec2,
    pub dpdu: DVec3,
    pub dpdv: DVec3,
}

impl AnalyticPoint {
    /// Rounded, as a point of a primitive and its shape, in no instance.
    #[inline(always)]
    fn rounded(&self, (prim, shape): (PrimId, ShapeId), time: f32, planar: bool) -> SurfacePoint {
        SurfacePoint {
            p: self.p.as_vec3(),
            p_error: self.p_error,
            ng: self.ng.as_vec3(),
            ns: self.ns.as_vec3(),
            uv: self.uv,
            barycentric: Vec2::ZERO,
            dpdu: self.dpdu.as_vec3(),
            dpdv: self.dpdv.as_vec3(),
            prim,
            shape,
            instance: Hit::NO_INSTANCE,
            time,
            planar,
        }
    }
}

/// Calls the method of whichever kind it is.
macro_rules! dispatch {
    ($self:expr, $kind:ident => $call:expr) => {
        match $self {
            Analytic::Sphere($kind) => $call,
            Analytic::Disk($kind) => $call,
            Analytic::Cylinder($kind) => $call,
            Analytic::Rectangle($kind) => $call,
        }
    };
}

impl Analytic {
    /// The first point of the ray in front of its origin.
    #[inline]
    pub(crate) fn intersect(&self, origin: DVec3, dir: DVec3) -> Option<AnalyticHit> {
        dispatch!(self, kind => kind.intersect(origin, dir))
    }

    /// The surface at a hit of the ray.
    pub(crate) fn surface(&self, origin: DVec3, dir: DVec3, hit: &Hit) -> AnalyticPoint {
        dispatch!(self, kind => kind.surface(origin, dir, hit))
    }

    /// The point of uniform numbers `u`, uniform in area, on the surface.
    pub(crate) fn sample_area(&self, u: Vec2) -> AnalyticPoint {
        dispatch!(self, kind => kind.sample_area(u))
    }

    /// The box around it, rounded to the nearest f32.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        dispatch!(self, kind => kind.bounds())
    }

    /// Its area, in the square of the scene's unit.
    #[must_use]
    pub fn area(&self) -> f64 {
        dispatch!(self, kind => kind.area())
    }

    /// True when it is flat, so that a ray that leaves it cannot meet it again.
    #[must_use]
    pub fn is_planar(&self) -> bool {
        matches!(self, Analytic::Disk(_) | Analytic::Rectangle(_))
    }

    /// The unit shading normal in its middle; everywhere, when it is flat.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.sample_area(Vec2::splat(0.5)).ns.as_vec3()
    }

    /// Its name in scene files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Analytic::Sphere(_) => "sphere",
            Analytic::Disk(_) => "disk",
            Analytic::Cylinder(_) => "cylinder",
            Analytic::Rectangle(_) => "rectangle",
        }
    }

    /// Typical and extreme shapes of every kind.
    #[must_use]
    pub fn examples() -> Vec<(String, Analytic)> {
        let mut examples = Vec::new();
        for (placement, to_world) in example_transforms() {
            let mut add = |name: &str, shape: Option<Analytic>| {
                examples.extend(shape.map(|s| (format!("{name}, {placement}"), s)));
            };
            let flip = placement == "mirrored";
            add("sphere", Sphere::new(DVec3::new(0.1, 0.2, 0.3), 0.8, &to_world, flip).ok().map(Into::into));
            add("disk", Disk::new(&to_world, flip).ok().map(Into::into));
            let (p0, p1) = (DVec3::new(0.0, 0.1, -0.5), DVec3::new(0.3, 0.0, 0.7));
            add("cylinder", Cylinder::new([p0, p1], 0.6, &to_world, flip).ok().map(Into::into));
            add("rectangle", Rectangle::new(&to_world, flip).ok().map(Into::into));
        }
        examples
    }
}

/// The placements of the examples: plain, mirrored, tiny, huge, far away.
fn example_transforms() -> Vec<(&'static str, Transform)> {
    use crate::math::{DMat4, DQuat};
    let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let place = |scale: DVec3, at: DVec3| {
        Transform::from_matrix(DMat4::from_scale_rotation_translation(scale, rotation, at))
    };
    [
        ("identity", Some(Transform::IDENTITY)),
        ("placed", place(DVec3::splat(2.0), DVec3::new(1.0, 2.0, 3.0))),
        ("mirrored", place(DVec3::new(-1.0, 1.0, 1.0), DVec3::new(0.0, -1.0, 0.5))),
        ("tiny", place(DVec3::splat(1e-12), DVec3::splat(1e-12))),
        ("huge", place(DVec3::splat(1e12), DVec3::splat(3e11))),
        ("far", place(DVec3::splat(1.0), DVec3::new(148_376.0, 1234.0, -223_423.0))),
    ]
    .into_iter()
    .filter_map(|(name, transform)| Some((name, transform?)))
    .collect()
}
