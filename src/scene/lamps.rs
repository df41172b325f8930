//! Lamps in groups: every instance of one is a light of its own, sampled where
//! its instance is at the time of the ray.
//!
//! Curves and deforming meshes are left to scattered rays, and so is what would be more
//! lights than a scene can hold: lamps with the fewest instances come first, so
//! that a swarm does not take a moving key light along.

use std::sync::Arc;

use super::NO_LIGHT;
use crate::light::{AreaEmission, AreaLight, Light};
use crate::shape::{Geometry, Hit, ShapeId, ShapeSampler, SurfacePoint};

/// Most lights that instances amount to, and most emitters that these consist
/// of: the triangles of a glowing mesh count one by one. A million of them take
/// some 200 MB.
const MAX_LAMPS: usize = 1 << 16;
const MAX_EMITTERS: usize = 1 << 20;

/// A shape of a group that glows, or a curve of the top.
#[derive(Debug)]
pub(super) struct Glow {
    pub shape: ShapeId,
    /// The group's part of the geometry.
    pub part: u32,
    pub emission: AreaEmission,
}

/// Which light each instance of a glowing shape is.
#[derive(Debug, Default)]
pub(super) struct Lamps {
    /// Of every glowing shape of a group, and of curves.
    emissions: Vec<Arc<AreaEmission>>,
    /// Where it is among those of its group that are sampled, if it is one.
    places: Vec<Option<u32>>,
    /// Where the lights of each instance begin in `lights`.
    firsts: Vec<u32>,
    /// By instance, then place; [`NO_LIGHT`] for what is not sampled.
    lights: Vec<u32>,
    /// How many became lights, and how many did not; curves at the top of the
    /// scene among them.
    pub placed: usize,
    pub left: usize,
    /// Shapes of curves that glow, instances apart.
    pub curves: usize,
    /// Bytes of the tables and images that instances share.
    pub bytes: usize,
}

impl Lamps {
    /// Adds the lights that instances of glowing shapes amount to.
    pub fn new(geometry: &Geometry, glows: &[Glow], lights: &mut Vec<Light>) -> Lamps {
        let mut lamps = Lamps::default();
        if glows.is_empty() {
            return lamps;
        }
        let mut instances_of: Vec<Vec<u32>> = vec![Vec::new(); geometry.parts() as usize];
        for (i, instance) in geometry.instances().iter().enumerate() {
            instances_of[instance.part() as usize].push(i as u32);
        }
        let instances = |glow: &Glow| instances_of[glow.part as usize].as_slice();
        let chosen = choose(geometry, glows, instances);

        // Places among the chosen shapes of each group.
        let mut chosen_in: Vec<u32> = vec![0; geometry.parts() as usize];
        for (glow, light) in glows.iter().zip(&chosen) {
            let count = &mut chosen_in[glow.part as usize];
            lamps.places.push(light.as_ref().map(|_| *count));
            *count += u32::from(light.is_some());
            lamps.emissions.push(match light {
                Some(light) => light.emission.clone(),
                None => Arc::new(glow.emission.clone()),
            });
            lamps.bytes += light.as_ref().map_or(0, AreaLight::memory_bytes);
            let count = if glow.part == 0 { 1 } else { instances(glow).len() };
            lamps.left += if light.is_some() { 0 } else { count };
            lamps.curves += if geometry.shapes()[glow.shape as usize].is_curve() { count } else { 0 };
        }
        if chosen.iter().all(Option::is_none) {
            return lamps;
        }
        let mut next = 0;
        for instance in geometry.instances() {
            lamps.firsts.push(next);
            next += chosen_in[instance.part() as usize];
        }
        lamps.lights = vec![NO_LIGHT; next as usize];
        for ((glow, light), place) in glows.iter().zip(chosen).zip(&lamps.places) {
            let (Some(light), Some(place)) = (light, place) else { continue };
            for instance in instances(glow) {
                let placed = light.placed(geometry, geometry.first_instance() + instance);
                if !(placed.power() > 0.0) {
                    continue; // black, or edge-on at all times
                }
                lamps.lights[(lamps.firsts[*instance as usize] + place) as usize] = lights.len() as u32;
                lights.push(placed.into());
                lamps.placed += 1;
            }
        }
        lamps
    }

    /// What a glowing shape emits, by its index.
    pub fn emission(&self, index: usize) -> &AreaEmission {
        &self.emissions[index]
    }

    /// All emissions.
    pub fn emissions(&self) -> impl Iterator<Item = &AreaEmission> {
        self.emissions.iter().map(|e| &**e)
    }

    /// The light that a point of a glowing shape belongs to, by the shape's index.
    #[cold]
    pub fn light(&self, geometry: &Geometry, index: usize, surface: &SurfacePoint) -> Option<u32> {
        if surface.instance == Hit::NO_INSTANCE {
            return None;
        }
        let instance = surface.instance.checked_sub(geometry.first_instance())?;
        let slot = self.firsts.get(instance as usize)? + self.places[index]?;
        self.lights.get(slot as usize).copied().filter(|light| *light != NO_LIGHT)
    }
}

/// The lights of those shapes, in their own space, whose instances find room.
fn choose<'a>(
    geometry: &Geometry,
    glows: &[Glow],
    instances: impl Fn(&Glow) -> &'a [u32],
) -> Vec<Option<AreaLight>> {
    let mut order: Vec<usize> = (0..glows.len()).collect();
    order.sort_by_key(|i| instances(&glows[*i]).len());
    let mut chosen = vec![None; glows.len()];
    let (mut room, mut emitters) = (MAX_LAMPS, MAX_EMITTERS);
    for index in order {
        let glow = &glows[index];
        let count = instances(glow).len();
        if count > room {
            break;
        }
        let Some(sampler) = ShapeSampler::new(geometry, glow.shape) else { continue };
        let light = AreaLight::new(geometry, sampler, glow.emission.clone());
        let parts = light.part_count(geometry).saturating_mul(count);
        if parts <= emitters {
            (room, emitters) = (room - count, emitters - parts);
            chosen[index] = Some(light);
        }
    }
    chosen
}
