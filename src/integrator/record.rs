//! What an integrator tells of its work: counters always, vertices when
//! somebody (`etendue replay`) wants to see the path.

use crate::math::{Rgb, Vec3};
use crate::scene::Interaction;

/// Rays and paths, counted per tile and summed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Camera rays (one more for each hidden emitter passed).
    pub camera_rays: u64,
    /// Rays in a direction sampled from a bsdf.
    pub scatter_rays: u64,
    /// Rays towards a light.
    pub shadow_rays: u64,
    /// Paths begun.
    pub paths: u64,
}

impl Counters {
    /// Adds another tile's.
    pub fn add(&mut self, other: &Counters) {
        self.camera_rays += other.camera_rays;
        self.scatter_rays += other.scatter_rays;
        self.shadow_rays += other.shadow_rays;
        self.paths += other.paths;
    }

    /// All rays.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.camera_rays + self.scatter_rays + self.shadow_rays
    }
}

/// A vertex of a path, recentred coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Vertex {
    /// Scatterings before it.
    pub bounce: u32,
    /// Where.
    pub p: Vec3,
    /// Geometric normal.
    pub ng: Vec3,
    /// Shading normal.
    pub ns: Vec3,
    /// Shape id.
    pub shape: u32,
    /// Throughput with which it was reached.
    pub beta: Rgb,
}

/// What happens along a path.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A surface was hit.
    Vertex(Vertex),
    /// The ray left the scene.
    Left {
        /// Its direction.
        direction: Vec3,
    },
    /// Light was found by hitting it.
    Hit {
        /// Radiance there.
        le: Rgb,
        /// MIS weight.
        mis: f32,
    },
    /// A light was sampled.
    Light {
        /// Direction towards it.
        wi: Vec3,
        /// Pdf per solid angle, choice included.
        pdf: f32,
        /// f·cos of the surface.
        f: Rgb,
        /// MIS weight.
        mis: f32,
        /// What of its radiance arrives, for all lights that it stands for.
        radiance: Rgb,
        /// A light without a size.
        delta: bool,
        /// What it contributed; zero when occluded.
        contribution: Rgb,
        /// Something stood in between.
        occluded: bool,
    },
    /// A direction was sampled.
    Scatter {
        /// The direction.
        wi: Vec3,
        /// f·cos / pdf.
        weight: Rgb,
        /// Its pdf.
        pdf: f32,
        /// A delta lobe.
        delta: bool,
    },
    /// The material absorbed the path.
    Absorbed,
    /// Russian roulette: survival probability and outcome.
    Roulette {
        /// Probability to go on.
        survival: f32,
        /// It went on.
        survived: bool,
    },
}

/// Listens to an integrator.
pub trait Record<'s> {
    /// Paths are lent to others: [`Record::meet`] and [`Record::keeps`] are asked.
    const LENDS: bool = false;

    /// The counters to add to.
    fn counters(&mut self) -> &mut Counters;

    /// An event; the closure is not called when nobody listens.
    fn event(&mut self, event: impl FnOnce() -> Event);

    /// A vertex before light is connected to it, after `bounce` scatterings, the last of them
    /// by a delta lobe or not. What the path carries and what it has found may be set apart.
    fn meet(
        &mut self,
        _hit: &Interaction<'_, 's>,
        _bounce: u32,
        _after_delta: bool,
        _of: (&mut Rgb, &mut Rgb),
    ) {
    }

    /// True when roulette is not to be played after that many scatterings.
    fn keeps(&self, _bounce: u32) -> bool {
        false
    }
}

/// Counts and does not listen.
#[derive(Debug, Default)]
pub struct NoRecord(pub Counters);

impl Record<'_> for NoRecord {
    fn counters(&mut self) -> &mut Counters {
        &mut self.0
    }

    #[inline(always)]
    fn event(&mut self, _event: impl FnOnce() -> Event) {}
}

/// Keeps every event.
impl Record<'_> for (Counters, Vec<Event>) {
    fn counters(&mut self) -> &mut Counters {
        &mut self.0
    }

    fn event(&mut self, event: impl FnOnce() -> Event) {
        self.1.push(event());
    }
}
