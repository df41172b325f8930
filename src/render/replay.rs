//! One path again, vertex by vertex.

use super::Cause;
use super::block::{Block, Draw};
use crate::film::{Film, PixelSample};
use crate::integrator::{CameraSample, Counters, Event, Integrator, Lender, NoRecord};
use crate::math::{Ray, Rgb, Vec2};
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
    /// Indirect light by the paths of this pixel and of others, where pixels use each
    /// other's: part of the sample, not of the events.
    pub shared: Option<Rgb>,
    /// What the film got, with all layers.
    pub sample: PixelSample,
    /// Why the film left it out; a bad layer counts only where it is rendered.
    pub bad: Option<Cause>,
    /// The largest radiance that the film takes.
    pub largest: f32,
}

/// The path of a sample of a pixel, exactly as it was rendered.
#[must_use]
pub fn replay(scene: &Scene, integrator: &Integrator, pixel: (i32, i32), draw: &Draw) -> Replay {
    let (mut camera, offset) = CameraSample::new(scene, pixel, draw.sampler(pixel));
    camera.layers = true;
    let mut record = (Counters::default(), Vec::new());
    let (sample, shared) = match integrator {
        Integrator::Path(path) if path.reuse > 1 => {
            let mut lender = Lender::default();
            lender.trace(path, scene, &camera, &mut record);
            let mut block = Block::new(scene, path);
            block.move_to(pixel);
            block.sample(&Draw { layers: true, ..*draw }, &mut NoRecord::default());
            let sample = *block.of(pixel).0;
            (sample, Some(sample.rgb - lender.sample.rgb))
        }
        _ => (integrator.sample(scene, &camera, &mut record), None),
    };
    let largest = Film::largest_radiance(integrator.radiance_scale(scene));
    let bad = Cause::of(&sample, largest, true);
    Replay { ray: camera.ray, offset, events: record.1, shared, sample, bad, largest }
}
