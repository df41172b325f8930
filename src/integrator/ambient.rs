//! Ambient occlusion and distance: pictures of the geometry alone.

use super::{CameraSample, Record, first_hit, first_hit_layers};
use crate::film::PixelSample;
use crate::math::{Frame, Rgb};
use crate::sampling::cosine_hemisphere;
use crate::scene::Scene;

/// Share of the cosine-weighted hemisphere that is free of geometry within a
/// distance: 1/π ∫ V(ω) cos θ dω.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbientOcclusion {
    /// Length of the occlusion rays in scene units; infinite by default.
    pub distance: f32,
}

impl AmbientOcclusion {
    /// Estimates what one sample of one pixel sees.
    pub fn sample<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        camera: &CameraSample,
        record: &mut R,
    ) -> PixelSample {
        let mut out = PixelSample::default();
        record.counters().paths += 1;
        let mut ray = camera.ray;
        let Some(hit) = first_hit(scene, &mut ray, false, record) else { return out };
        let surface = scene.surface(&ray, &hit);
        out.alpha = 1.0;
        first_hit_layers(&mut out, scene, camera, &surface);
        let normal = if surface.ns.dot(ray.dir) > 0.0 { -surface.ns } else { surface.ns };
        let wi = Frame::from_normal(normal).to_world(cosine_hemisphere(camera.first_light));
        // Below the true surface nothing is free.
        if surface.ng.dot(wi) * surface.ng.dot(-ray.dir) <= 0.0 {
            return out;
        }
        let mut probe = surface.spawn(wi);
        probe.t_max = self.distance;
        record.counters().shadow_rays += 1;
        if !scene.occluded(&probe) {
            out.rgb = Rgb::ONE;
        }
        out
    }
}

/// Distance from the camera ray's origin to the first hit, in all channels; 0
/// where nothing is hit, as Mitsuba's `depth`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depth;

impl Depth {
    /// What one sample of one pixel sees.
    pub fn sample<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        camera: &CameraSample,
        record: &mut R,
    ) -> PixelSample {
        let mut out = PixelSample::default();
        record.counters().paths += 1;
        record.counters().camera_rays += 1;
        let Some(hit) = scene.closest(&camera.ray) else { return out };
        out.alpha = 1.0;
        out.rgb = Rgb::splat(hit.t);
        first_hit_layers(&mut out, scene, camera, &scene.surface(&camera.ray, &hit));
        out
    }
}
