//! A shape that glows.

use super::{LightSample, Receiver, Target, grey};
use crate::math::{Rgb, Vec2, Vec3};
use crate::shape::{Geometry, Pattern, PrimId, ShapeSampler, SurfacePoint};
use crate::texture::Texture;

/// What an `area` emitter says about itself.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `radiance` | 1 | emitted radiance; may be a texture |
#[derive(Clone, Debug)]
pub struct AreaEmission {
    /// Emitted radiance, the same in all directions on the front.
    pub radiance: Texture,
    /// `sampling_weight`.
    pub weight: f32,
}

impl AreaEmission {
    /// Radiance that leaves `point` of the shape towards unit `wo` (world).
    /// Zero behind the surface and along it.
    #[must_use]
    pub fn emitted(&self, point: &SurfacePoint, wo: Vec3) -> Rgb {
        self.front(point.ns, wo, point.uv)
    }

    fn front(&self, n: Vec3, wo: Vec3, uv: Vec2) -> Rgb {
        if n.dot(wo) > 0.0 { self.radiance.eval(uv) } else { Rgb::ZERO }
    }

    /// A sampler that goes by what is emitted: by texels where they differ.
    #[must_use]
    pub fn sampler(&self, geometry: &Geometry, sampler: ShapeSampler) -> ShapeSampler {
        let mean = grey(self.radiance.mean());
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

/// A shape that emits from its front: the side its shading normal points to,
/// as a ray that hits a light finds it in Mitsuba.
///
/// Mitsuba asks another normal when it samples the light, so that on a mesh
/// with vertex normals its strategies disagree by up to 4 % (mitsuba3 issue
/// 1952). Here both ask the same one.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Chooses points of the shape.
    pub sampler: ShapeSampler,
    /// What is emitted.
    pub emission: AreaEmission,
}

impl AreaLight {
    /// Radiance that leaves `point` of this light towards unit `wo` (world).
    /// Zero behind the surface and along it.
    #[must_use]
    pub fn emitted(&self, point: &SurfacePoint, wo: Vec3) -> Rgb {
        self.emission.emitted(point, wo)
    }

    /// Density per solid angle at `ref_p` with which [`super::Light::sample`]
    /// chooses the direction `wi` to `point`, at squared distance `dist2`.
    #[must_use]
    pub fn pdf(&self, geometry: &Geometry, ref_p: Vec3, point: &SurfacePoint, wi: Vec3, dist2: f32) -> f32 {
        self.sampler.pdf(geometry, ref_p, point, wi, dist2)
    }

    /// A point of the light, or of one primitive of it. Nothing where all of it
    /// lies below the receiver's horizon, or the receiver behind it.
    pub(super) fn sample(
        &self,
        geometry: &Geometry,
        receiver: &Receiver,
        prim: Option<PrimId>,
        u: Vec2,
    ) -> Option<LightSample> {
        let normal = (!receiver.two_sided).then_some(receiver.n);
        if self.sampler.is_hidden(receiver.p, normal) {
            return None;
        }
        let chosen = match prim {
            None => self.sampler.sample(geometry, receiver.p, u),
            Some(prim) => self.sampler.sample_prim(geometry, prim, receiver.p, u),
        }?;
        let radiance = self.emission.front(chosen.n, -chosen.wi, chosen.uv);
        Some(LightSample {
            wi: chosen.wi,
            radiance,
            pdf: chosen.pdf,
            delta: false,
            target: Target::Surface(chosen),
        })
    }

    /// An area light: a shape and what it emits.
    #[must_use]
    pub fn new(geometry: &Geometry, sampler: ShapeSampler, emission: AreaEmission) -> AreaLight {
        AreaLight { sampler: emission.sampler(geometry, sampler), emission }
    }

    /// Emitted power, grey.
    pub(super) fn power(&self) -> f64 {
        std::f64::consts::PI * self.sampler.area() * self.mean_radiance()
    }

    fn mean_radiance(&self) -> f64 {
        self.sampler.mean_of_all().unwrap_or_else(|| grey(self.emission.radiance.mean()))
    }

    /// Mean radiance of one part, grey.
    pub(super) fn radiance_of(&self, prim: PrimId) -> f64 {
        self.sampler.mean_pattern(prim).unwrap_or_else(|| grey(self.emission.radiance.mean()))
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.sampler.memory_bytes() + self.emission.radiance.memory_bytes()
    }
}
