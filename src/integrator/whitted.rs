//! Whitted's ray tracing (1980): the core that the path tracer grew from.
//!
//! A tree of rays: at every hit light from each source, tested by one shadow
//! ray (towards the middle of an area light), an ambient term that stands in
//! for all indirect light, and, on mirrors and smooth glass, one reflected and
//! one transmitted ray weighed by Fresnel's formula. A branch ends at
//! `max_depth`, or when its weight falls under `cutoff`. It is not an estimate
//! of the rendering equation: soft shadows, glossy reflections and indirect
//! light are missing on purpose.

use super::{CameraSample, Event, Record, Vertex, arriving, first_hit, first_hit_layers};
use crate::film::PixelSample;
use crate::material::Scatter;
use crate::math::{Ray, Rgb, Vec2};
use crate::scene::{Carried, Interaction, Scene};
use crate::shape::SurfacePoint;

/// The Whitted ray tracer and its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whitted {
    /// Deepest ray tree; 1 sees lights only, 2 adds direct light.
    pub max_depth: u32,
    /// Radiance that arrives from everywhere; `None` is the mean of the
    /// environment (0 without one).
    pub ambient: Option<Rgb>,
    /// Branches of less weight are cut.
    pub cutoff: f32,
    /// Lights are invisible to the camera.
    pub hide_emitters: bool,
}

/// Random numbers that choose the two branches of a smooth dielectric: 0 is
/// the reflected one, the largest number below one the transmitted one.
const BRANCHES: [f32; 2] = [0.0, crate::math::ONE_MINUS_EPSILON];

impl Whitted {
    /// What one sample of one pixel sees.
    pub fn sample<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        camera: &CameraSample,
        record: &mut R,
    ) -> PixelSample {
        let mut out = PixelSample::default();
        record.counters().paths += 1;
        let mut ray = camera.ray;
        let medium = scene.camera_medium();
        match first_hit(scene, &mut ray, self.hide_emitters, record) {
            Some(hit) => {
                let surface = scene.surface(&ray, &hit);
                out.alpha = 1.0;
                first_hit_layers(&mut out, scene, camera, &surface);
                let left = scene.transmittance(medium, surface.p.distance(camera.ray.origin));
                out.rgb = left * self.shade(scene, (&surface, medium), (camera, &ray), (left, 0), record);
            }
            None if !self.hide_emitters => {
                out.rgb = scene.environment(ray.dir) * scene.transmittance(medium, f32::INFINITY);
                out.alpha = if scene.environment.is_some() { 1.0 } else { 0.0 };
            }
            None => {}
        }
        out
    }

    fn ambient(&self, scene: &Scene) -> Rgb {
        self.ambient.unwrap_or_else(|| {
            scene.environment.map_or(Rgb::ZERO, |i| scene.lights[i as usize].mean_radiance())
        })
    }

    /// Radiance that leaves a hit against `ray`, which came through `medium`;
    /// `beta` is the weight of the branch.
    fn shade<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        (surface, medium): (&SurfacePoint, u32),
        (camera, ray): (&CameraSample, &Ray),
        (beta, bounce): (Rgb, u32),
        record: &mut R,
    ) -> Rgb {
        record.event(|| {
            let SurfacePoint { p, ng, ns, shape, .. } = *surface;
            Event::Vertex(Vertex { bounce, p, ng, ns, shape, beta })
        });
        let mut radiance = scene.emitted(surface, -ray.dir);
        if bounce + 1 >= self.max_depth {
            return radiance;
        }
        let mut room = Scatter::default();
        let carried = Carried { medium, ..camera.carried(scene, surface) };
        let hit = scene.interact(surface, -ray.dir, &carried, &mut room);
        if hit.scatter.has_smooth() {
            radiance += hit.scatter.albedo(hit.wo) * self.ambient(scene);
            for index in 0..scene.lights.len() {
                radiance += Self::light(scene, &hit, index, record);
            }
        }
        radiance + self.branches(scene, (camera, &hit), (beta, bounce), record)
    }

    /// Light from one source, as if all of it came from its middle.
    fn light<'s, R: Record<'s>>(scene: &Scene, hit: &Interaction, index: usize, record: &mut R) -> Rgb {
        let light = &scene.lights[index];
        if light.is_environment() {
            return Rgb::ZERO; // the ambient term stands for it
        }
        let Some(sample) = scene.sample_one_light(index, hit, Vec2::splat(0.5)) else {
            return Rgb::ZERO;
        };
        let (f, _) = hit.scatter.eval_pdf(hit.wo, sample.wi);
        let contribution = f * sample.radiance / sample.pdf;
        if contribution == Rgb::ZERO {
            return Rgb::ZERO;
        }
        record.counters().shadow_rays += 1;
        let left = arriving(scene, hit, &sample, true);
        let occluded = left == Rgb::ZERO;
        let contribution = if occluded { Rgb::ZERO } else { contribution * left };
        record.event(|| Event::Light {
            wi: sample.wi,
            pdf: sample.pdf,
            f,
            mis: 1.0,
            radiance: sample.radiance * left,
            delta: sample.delta,
            contribution,
            occluded,
        });
        contribution
    }

    /// Perfect reflection and refraction, both.
    fn branches<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        (camera, hit): (&CameraSample, &Interaction),
        (beta, bounce): (Rgb, u32),
        record: &mut R,
    ) -> Rgb {
        let mut radiance = Rgb::ZERO;
        for lobe in hit.scatter.lobes() {
            let (wo, bsdf) = (lobe.frame.to_local(hit.wo), hit.scatter.bsdf(lobe));
            let mut seen = None;
            for choice in BRANCHES {
                let Some(sample) = bsdf.sample(wo, choice, Vec2::splat(0.5)).filter(|s| s.delta) else {
                    continue;
                };
                if seen == Some(sample.wi) {
                    continue; // one branch only: a mirror, or total internal reflection
                }
                seen = Some(sample.wi);
                // Both branches are followed: the choice's probability is put back.
                let weight = sample.weight * sample.pdf * lobe.weight;
                if (weight * beta).max_element() < self.cutoff {
                    continue;
                }
                let wi = lobe.frame.to_world(sample.wi);
                record.event(|| Event::Scatter { wi, weight, pdf: 1.0, delta: true });
                let ray = hit.surface.spawn(wi);
                record.counters().scatter_rays += 1;
                let medium = scene.medium_towards(hit.carried.medium, hit.surface, wi);
                radiance += weight
                    * match scene.closest(&ray) {
                        Some(next) => {
                            let surface = scene.surface(&ray, &next);
                            let left = scene.transmittance(medium, surface.p.distance(hit.surface.p));
                            let branch = (beta * weight * left, bounce + 1);
                            left * self.shade(scene, (&surface, medium), (camera, &ray), branch, record)
                        }
                        None => scene.environment(wi) * scene.transmittance(medium, f32::INFINITY),
                    };
            }
        }
        radiance
    }
}
