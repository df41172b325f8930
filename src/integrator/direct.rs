//! Direct light only, with any number of light and bsdf samples.
//!
//! The multi-sample estimator of Veach 1997, section 9.2: nₑ light samples and
//! n_b bsdf samples, combined with the power heuristic over nₑ·pₑ and n_b·p_b.
//! With one of the counts at zero it is the other strategy alone.

use super::connect::{Counts, connect};
use super::{CameraSample, Event, Record, first_hit, first_hit_layers};
use crate::film::PixelSample;
use crate::material::Scatter;
use crate::math::{Rgb, Vec2};
use crate::sampling::power_heuristic;
use crate::scene::{Interaction, Scene};

/// The direct-light integrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direct {
    /// Light samples per hit.
    pub emitter_samples: u32,
    /// Bsdf samples per hit.
    pub bsdf_samples: u32,
    /// Lights are invisible to the camera.
    pub hide_emitters: bool,
}

impl Direct {
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
        let Some(first) = first_hit(scene, &mut ray, self.hide_emitters, record) else {
            if !self.hide_emitters {
                out.rgb = scene.environment(ray.dir);
                out.alpha = if scene.environment.is_some() { 1.0 } else { 0.0 };
            }
            return out;
        };
        let surface = scene.surface(&ray, &first);
        out.alpha = 1.0;
        first_hit_layers(&mut out, scene, camera, &surface);
        out.rgb += scene.emitted(&surface, -ray.dir);
        let mut room = Scatter::default();
        let carried = camera.carried(scene, &surface);
        let hit = scene.interact(&surface, -ray.dir, &carried, &mut room);
        if hit.scatter.has_smooth() {
            for i in 0..self.emitter_samples {
                out.rgb += self.light_sample(scene, camera, &hit, i, record);
            }
        }
        for i in 0..self.bsdf_samples {
            out.rgb += self.bsdf_sample(scene, camera, &hit, i, record);
        }
        out
    }

    fn light_sample<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        camera: &CameraSample,
        hit: &Interaction,
        i: u32,
        record: &mut R,
    ) -> Rgb {
        // Further samples use the sets of later vertices, which have no other use here.
        let (choice, u) = camera.light(scene, i);
        let counts = Counts { light: self.emitter_samples as f32, bsdf: self.bsdf_samples as f32 };
        let Some(found) = connect(scene, hit, choice, u, counts) else { return Rgb::ZERO };
        let main = found.main.trace(scene, hit, (Rgb::ONE, false), record);
        found.faint.map_or(main, |faint| main + faint.trace(scene, hit, (Rgb::ONE, false), record))
    }

    fn bsdf_sample<'s, R: Record<'s>>(
        &self,
        scene: &Scene,
        camera: &CameraSample,
        hit: &Interaction,
        i: u32,
        record: &mut R,
    ) -> Rgb {
        let (lobe, u): (f32, Vec2) = camera.scatter(hit.scatter, i);
        let Some(sample) = hit.scatter.sample(hit.wo, lobe, u) else { return Rgb::ZERO };
        let ray = hit.surface.spawn(sample.wi);
        record.counters().scatter_rays += 1;
        let (le, pdf) = match scene.closest(&ray) {
            None => scene.environment_and_pdf(ray.dir),
            Some(next) => {
                let surface = scene.surface(&ray, &next);
                let distance_squared = (surface.p - hit.surface.p).length_squared();
                let pdf = scene.light_pdf(&hit.receiver(), &surface, ray.dir, distance_squared);
                (scene.emitted(&surface, -ray.dir), pdf)
            }
        };
        if le == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let n = self.bsdf_samples as f32;
        let mis = if sample.delta {
            1.0
        } else {
            power_heuristic(sample.pdf * n, pdf * self.emitter_samples as f32)
        };
        record.event(|| Event::Hit { le, mis });
        sample.weight * le * (mis / n)
    }
}
