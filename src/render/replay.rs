//! One path again, vertex by vertex.

use crate::film::PixelSample;
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
    /// What the film got.
    pub sample: PixelSample,
}

/// The path of the sample of a pixel with these random numbers, exactly as it
/// was rendered.
#[must_use]
pub fn replay(scene: &Scene, integrator: &Integrator, pixel: (i32, i32), sampler: Sampler) -> Replay {
    let (camera, offset) = CameraSample::new(scene, pixel, sampler);
    let mut record = (Counters::default(), Vec::new());
    let sample = integrator.sample(scene, &camera, &mut record);
    Replay { ray: camera.ray, offset, events: record.1, sample }
}
