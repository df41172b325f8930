//! Every primitive in turn: the oracle of all other kinds.

use super::Nearest;
use super::ground::{Ground, Slice};
use crate::math::{Bounds, Ray};
use crate::shape::{Geometry, Hit, RayProbe};

/// Tests every primitive.
#[derive(Clone, Debug)]
pub struct Brute {
    part: u32,
    bounds: Bounds,
}

impl Brute {
    /// Takes note of the box; there is nothing to build.
    #[must_use]
    pub fn new(geometry: &Geometry) -> Brute {
        Brute::of(geometry, Slice::TOP)
    }

    pub(super) fn of(geometry: &Geometry, slice: Slice) -> Brute {
        Brute { part: slice.part, bounds: geometry.part_bounds(slice.part) }
    }

    pub(super) fn closest(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        let probe = &RayProbe::new(ray)?;
        let mut nearest = Nearest::new(probe);
        for prim in ground.geometry.part_prims(self.part) {
            if let Some(hit) = ground.intersect(prim, probe, nearest.limit) {
                nearest.take(hit);
            }
        }
        nearest.hit
    }

    pub(super) fn occluded(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        let Some(probe) = &RayProbe::new(ray) else { return false };
        let mut prims = ground.geometry.part_prims(self.part);
        prims.any(|prim| ground.intersect(prim, probe, probe.t_max).is_some())
    }

    pub(super) fn memory_bytes(&self) -> usize {
        0
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.bounds
    }
}
