//! Every primitive in turn: the oracle of all other kinds.

use super::Nearest;
use crate::math::Bounds;
use crate::shape::{Geometry, Hit, RayProbe};

/// Tests every primitive.
#[derive(Clone, Debug)]
pub struct Brute {
    bounds: Bounds,
}

impl Brute {
    /// Takes note of the box; there is nothing to build.
    #[must_use]
    pub fn new(geometry: &Geometry) -> Brute {
        Brute { bounds: geometry.bounds() }
    }

    pub(super) fn closest(&self, geometry: &Geometry, probe: &RayProbe) -> Option<Hit> {
        let mut nearest = Nearest::new(probe);
        for prim in 0..geometry.prim_count() {
            if let Some(hit) = geometry.intersect_probe(prim, probe, nearest.limit) {
                nearest.take(hit);
            }
        }
        nearest.hit
    }

    pub(super) fn occluded(&self, geometry: &Geometry, probe: &RayProbe) -> bool {
        (0..geometry.prim_count()).any(|prim| geometry.intersect_probe(prim, probe, probe.t_max).is_some())
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.bounds
    }
}
