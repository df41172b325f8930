//! A shape that glows.

use std::sync::Arc;

use super::{LightSample, Receiver, Target, grey};
use crate::math::{Rgb, Vec2, Vec3};
use crate::shape::{Geometry, Hit, Pattern, PrimId, ShapeSample, ShapeSampler, SurfacePoint};
use crate::texture::{Coords, Footprint, More, NO_FOOTPRINTS, Texture};

/// What an `area` emitter says about itself.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `radiance` | 1 | emitted radiance; may be a texture |
/// | `two_sided` | false | the back emits as the front does (Mitsuba has front only) |
/// | `vertex_color`, `vertex_alpha` | false | multiply it with the mesh's attribute of that name: 0 where there is none |
#[derive(Clone, Debug)]
pub struct AreaEmission {
    /// Emitted radiance, the same in all directions on a side that emits.
    pub radiance: Texture,
    /// `two_sided`: not the front alone emits.
    pub both_sides: bool,
    /// Attributes of the mesh that multiply it. Choosing lights and points of
    /// them goes by `radiance` alone.
    pub tints: Vec<Texture>,
    /// `sampling_weight`.
    pub weight: f32,
}

impl AreaEmission {
    /// Radiance that leaves `point` of the shape towards unit `wo` (world).
    /// Zero along the surface, and behind one that emits on its front only.
    #[must_use]
    #[inline]
    pub fn emitted(&self, geometry: &Geometry, point: &SurfacePoint, wo: Vec3) -> Rgb {
        let radiance = self.towards(point.ns, wo, point.uv);
        if self.tints.is_empty() { radiance } else { radiance * self.tint(geometry, point) }
    }

    /// What attributes of the mesh multiply at a point. Texels and colours below
    /// 0 take no light away.
    #[cold]
    fn tint(&self, geometry: &Geometry, point: &SurfacePoint) -> Rgb {
        let (attributes, footprint) = (geometry.attributes(point), Footprint::POINT);
        let more = More { attributes, footprint, footprints: NO_FOOTPRINTS };
        let at = Coords { uv: point.uv, more: Some(&more) };
        self.tints.iter().map(|t| t.eval(at).max(Rgb::ZERO)).product()
    }

    fn towards(&self, n: Vec3, wo: Vec3, uv: Vec2) -> Rgb {
        let cos = n.dot(wo);
        if cos > 0.0 || (self.both_sides && cos < 0.0) { self.radiance.eval(uv) } else { Rgb::ZERO }
    }

    /// How many sides of the shape emit.
    fn sides(&self) -> f64 {
        if self.both_sides { 2.0 } else { 1.0 }
    }

    /// A sampler that goes by what is emitted: on which sides, and by texels
    /// where they differ.
    #[must_use]
    pub fn sampler(&self, geometry: &Geometry, sampler: ShapeSampler) -> ShapeSampler {
        let mean = grey(self.radiance.mean());
        let sampler = if self.both_sides { sampler.of_both_sides() } else { sampler };
        if self.radiance.is_constant().is_some() {
            return sampler.without_uv();
        }
        if !(mean > 0.0) || !mean.is_finite() {
            return sampler;
        }
        let value = |uv: Vec2| grey(self.radiance.eval(uv));
        sampler.with_pattern(geometry, &Pattern { value: &value, mean, raster: self.radiance.raster() })
    }

    /// The size of what is emitted, for the unit of exact sums.
    #[must_use]
    pub fn magnitude(&self) -> f64 {
        grey(self.radiance.mean())
    }
}

/// A shape that emits from its front, the side its shading normal points to,
/// as a ray that hits a light finds it in Mitsuba; or from both sides.
///
/// Mitsuba asks another normal when it samples the light, so that on a mesh
/// with vertex normals its strategies disagree by up to 4 % (mitsuba3 issue
/// 1952). Here both ask the same one.
///
/// In an instance it is sampled in the space of its group, as seen from where
/// the receiver is there at its own time. A density per solid angle changes with
/// the linear map of directions by its Jacobian, so that both strategies agree
/// in groups that are stretched, mirrored and on the move.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Chooses points of the shape, in the space of its group.
    pub sampler: Arc<ShapeSampler>,
    /// What is emitted.
    pub emission: Arc<AreaEmission>,
    /// The instance that the shape is seen through; [`Hit::NO_INSTANCE`] for none.
    pub instance: PrimId,
    power: f64,
}

impl AreaLight {
    /// An area light: a shape and what it emits.
    #[must_use]
    pub fn new(geometry: &Geometry, sampler: ShapeSampler, emission: AreaEmission) -> AreaLight {
        let sampler = Arc::new(emission.sampler(geometry, sampler));
        let mean = sampler.mean_of_all().unwrap_or_else(|| grey(emission.radiance.mean()));
        let power = std::f64::consts::PI * sampler.area() * mean * emission.sides();
        AreaLight { sampler, emission: Arc::new(emission), instance: Hit::NO_INSTANCE, power }
    }

    /// The same light of a shape in a group, as an instance of the group places it.
    #[must_use]
    pub fn placed(&self, geometry: &Geometry, instance: PrimId) -> AreaLight {
        let light = AreaLight { instance, power: 0.0, ..self.clone() };
        let power = light.extents(geometry).map(|(.., extent)| extent.power).sum();
        AreaLight { power, ..light }
    }

    /// Radiance that leaves `point` of this light towards unit `wo` (world):
    /// see [`AreaEmission::emitted`].
    #[must_use]
    #[inline]
    pub fn emitted(&self, geometry: &Geometry, point: &SurfacePoint, wo: Vec3) -> Rgb {
        self.emission.emitted(geometry, point, wo)
    }

    /// Density per solid angle at the receiver with which [`super::Light::sample`]
    /// chooses the direction `wi` to `point`, at squared distance `dist2`; with
    /// `part`, that of [`super::Light::sample_part`] for the primitive of `point`.
    #[must_use]
    #[inline]
    pub fn pdf(
        &self,
        geometry: &Geometry,
        from: &Receiver,
        (point, part): (&SurfacePoint, bool),
        wi: Vec3,
        dist2: f32,
    ) -> f32 {
        if self.instance != Hit::NO_INSTANCE {
            return self.placed_pdf(geometry, from, (point, part), wi);
        }
        self.pdf_here(geometry, from.p, (point, part), wi, dist2)
    }

    /// In the space of the shape.
    #[inline]
    fn pdf_here(
        &self,
        geometry: &Geometry,
        p: Vec3,
        (point, part): (&SurfacePoint, bool),
        wi: Vec3,
        dist2: f32,
    ) -> f32 {
        if part {
            self.sampler.pdf_prim(geometry, p, point, wi, dist2)
        } else {
            self.sampler.pdf(geometry, p, point, wi, dist2)
        }
    }

    #[cold]
    fn placed_pdf(
        &self,
        geometry: &Geometry,
        from: &Receiver,
        (point, part): (&SurfacePoint, bool),
        wi: Vec3,
    ) -> f32 {
        let Some(instance) = geometry.instance(self.instance) else { return 0.0 };
        let placed = instance.at(from.time);
        let (p, local) = (placed.point_to_local(from.p), placed.to_local(point));
        let (wi, factor) = placed.direction_to_local(wi);
        let dist2 = (local.p - p).length_squared();
        let pdf = self.pdf_here(geometry, p, (&local, part), wi, dist2);
        let pdf = (f64::from(pdf) * factor) as f32;
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// A point of the light, or of one primitive of it. Nothing where all of it
    /// lies below the receiver's horizon, or the receiver on a side that is black.
    pub(super) fn sample(
        &self,
        geometry: &Geometry,
        receiver: &Receiver,
        prim: Option<PrimId>,
        u: Vec2,
    ) -> Option<LightSample> {
        let chosen = if self.instance == Hit::NO_INSTANCE {
            let normal = (!receiver.two_sided).then_some(receiver.n);
            self.choose(geometry, (receiver.p, normal), prim, u)?
        } else {
            self.choose_placed(geometry, receiver, prim, u)?
        };
        let mut radiance = self.emission.towards(chosen.n, -chosen.wi, chosen.uv);
        if !self.emission.tints.is_empty() {
            radiance *= self.tint(geometry, receiver, &chosen)?;
        }
        Some(LightSample {
            wi: chosen.wi,
            radiance,
            pdf: chosen.pdf,
            delta: false,
            target: Target::Surface(chosen),
        })
    }

    /// [`AreaEmission::tint`] at a point that was chosen.
    #[cold]
    fn tint(&self, geometry: &Geometry, receiver: &Receiver, chosen: &ShapeSample) -> Option<Rgb> {
        let p = match geometry.instance(self.instance) {
            None => chosen.p,
            Some(instance) => instance.at(receiver.time).point_to_local(chosen.p),
        };
        // Of what is no triangle nothing has attributes.
        let [u, v] = geometry.triangle(chosen.prim).map_or([0.0; 2], |t| barycentric(p, &t));
        let hit = Hit { t: 1.0, prim: chosen.prim, u, v, instance: Hit::NO_INSTANCE };
        geometry.analytic(chosen.prim).is_none().then(|| {
            self.emission.tint(geometry, &geometry.triangle_surface(self.sampler.shape(), &hit, 0.0))
        })
    }

    /// In the space of the shape.
    #[inline]
    fn choose(
        &self,
        geometry: &Geometry,
        (p, normal): (Vec3, Option<Vec3>),
        prim: Option<PrimId>,
        u: Vec2,
    ) -> Option<ShapeSample> {
        if self.sampler.is_hidden(p, normal) {
            return None;
        }
        match prim {
            None => self.sampler.sample(geometry, p, u),
            Some(prim) => self.sampler.sample_prim(geometry, prim, p, u),
        }
    }

    #[cold]
    fn choose_placed(
        &self,
        geometry: &Geometry,
        receiver: &Receiver,
        prim: Option<PrimId>,
        u: Vec2,
    ) -> Option<ShapeSample> {
        let placed = geometry.instance(self.instance)?.at(receiver.time);
        let normal = (!receiver.two_sided).then(|| placed.normal_to_local(receiver.n));
        let from = placed.point_to_local(receiver.p);
        let local = self.choose(geometry, (from, normal), prim, u)?;
        placed.sample_to_world(&local, from, self.instance)
    }

    /// Emitted power, grey: of what moves, where its area is largest.
    #[must_use]
    pub fn power(&self) -> f64 {
        self.power
    }

    /// Mean radiance of one part, grey, of all sides that emit together.
    pub(super) fn radiance_of(&self, prim: PrimId) -> f64 {
        let mean = self.sampler.mean_pattern(prim).unwrap_or_else(|| grey(self.emission.radiance.mean()));
        mean * self.emission.sides()
    }

    /// Bytes of tables and images; instances share them.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.sampler.memory_bytes() + self.emission.radiance.memory_bytes()
    }
}

/// The weights of the second and third vertex at a point of a triangle, which
/// may be off its plane by rounding.
fn barycentric(p: Vec3, [a, b, c]: &[Vec3; 3]) -> [f32; 2] {
    let [p, x, y] = [p, *b, *c].map(|v| v.as_dvec3() - a.as_dvec3());
    let normal = x.cross(y);
    let scale = 1.0 / normal.length_squared();
    let u = (p.cross(y).dot(normal) * scale).clamp(0.0, 1.0);
    let v = (x.cross(p).dot(normal) * scale).clamp(0.0, 1.0 - u);
    [u as f32, v as f32]
}
