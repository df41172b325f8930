//! One sample set per seed, looked at while it grows.

use etendue::film::{Film, Groups, LayerSet};
use etendue::integrator::{CameraSample, NoRecord};
use etendue::sampling::{Sampler, replica_of};

use super::render::{Ready, rgb};

/// A picture at some count: R, G, B interleaved, and its error layer likewise.
pub struct Shot {
    /// Colour.
    pub rgb: Vec<f64>,
    /// Standard errors.
    pub error: Vec<f64>,
}

/// The pictures of a seed at the growing `counts`, as `render` makes them.
pub fn snapshots(ready: &Ready, seed: u64, replicas: u32, counts: &[u64]) -> Vec<Shot> {
    let layers = LayerSet { error: true, ..LayerSet::default() };
    let scale = ready.integrator.radiance_scale(&ready.scene);
    let film = Film::grouped(ready.scene.film.clone(), layers, scale, Groups::of_replicas(replicas));
    let mut next = 0;
    let mut shots = Vec::new();
    for &count in counts {
        while next < count {
            let end = count.min((next + 1).next_power_of_two());
            film.advance(next);
            for rect in film.tiles() {
                let mut tile = film.tile(rect);
                let mut record = NoRecord::default();
                for pixel in rect.pixels() {
                    for index in next..end {
                        let (seed, within) = replica_of(seed, replicas, index);
                        let sampler = Sampler::new(seed, pixel, within);
                        let (camera, offset) = CameraSample::new(&ready.scene, pixel, sampler);
                        let sample = ready.integrator.sample(&ready.scene, &camera, &mut record);
                        assert!(sample.is_valid());
                        tile.add(pixel, offset, index, &sample);
                    }
                }
                film.merge(&tile);
            }
            next = end;
        }
        let picture = film.resolve();
        let colour = rgb(&picture).into_iter().map(f64::from).collect();
        let [r, g, b] =
            ["R", "G", "B"].map(|c| picture.channel(&format!("error.{c}")).expect("an error layer"));
        let error = r.iter().zip(g).zip(b).flat_map(|((r, g), b)| [*r, *g, *b]).map(f64::from).collect();
        shots.push(Shot { rgb: colour, error });
    }
    shots
}
