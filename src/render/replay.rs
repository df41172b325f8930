//! One path again, vertex by vertex.

use super::Cause;
use crate::film::{Film, PixelSample};
use crate::integrator::{CameraSample, Counters, Event, Integrator};
use crate::math::{Ray, Vec2};
use crate::sampling::Sampler;
use crate::scene::Scene;

/// A path and what it gave.
#[derive(Debug)]
pub struct Replay {
    /// The camera ray, recentred coordinates.
    pub ray: Ray,
    /// Where in the pixel, [0,1)².
    pub offset: Vec2,
    /// What happened, in order.
    pub events: Vec<Event>,
    /// What the film got, with all layers.
    pub sample: PixelSample,
    /// Why the film left it out; a bad layer counts only where it is rendered.
    pub bad: Option<Cause>,
    /// The largest radiance that the film takes.
    pub largest: f32,
}

/// The path of the sample of a pixel with these random numbers, exactly as it
/// was rendered.
#[must_use]
pub fn replay(scene: &Scene, integrator: &Integrator, pixel: (i32, i32), sampler: Sampler) -> Replay {
    let (mut camera, offset) = CameraSample::new(scene, pixel, sampler);
    camera.layers = true;
    let mut record = (Counters::default(), Vec::new());
    let sample = integrator.sample(scene, &camera, &mut record);
    let largest = Film::largest_radiance(integrator.radiance_scale(scene));
    let bad = Cause::of(&sample, largest, true);
    Replay { ray: camera.ray, offset, events: record.1, sample, bad, largest }
}
