//! What takes part in a measurement.

use super::Spawn;
use crate::accel::{Accel, Bvh8Plain, Quality, Stats};
#[cfg(feature = "embree")]
use crate::accel::{EmbreeMode, EmbreeNative};
use crate::desc::{Error, Result};
use crate::math::Ray;
use crate::shape::{Geometry, Hit};

/// Something built that finds hits, many rays at a time so that the call costs
/// nothing beside the work.
pub trait Tracer: Send + Sync {
    /// Appends the nearest hit of every ray.
    fn closest(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<Option<Hit>>);

    /// Appends for every ray whether it hits anything.
    fn occluded(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<bool>);

    /// Appends the rays that leave hits: the points of the surface, and what
    /// keeps the rays from meeting it again.
    fn spawn(&self, geometry: &Geometry, spawns: &[Spawn], rays: &mut Vec<Ray>) {
        rays.extend(spawns.iter().map(|s| geometry.surface(&s.ray, &s.hit).spawn(s.dir)));
    }

    /// Its rays have to start a fixed distance off the surface they leave.
    fn needs_epsilon(&self) -> bool {
        false
    }

    /// Memory beyond that of the geometry, in bytes.
    fn memory_bytes(&self) -> usize;

    /// Numbers about its tree; zero where it tells none.
    fn stats(&self) -> Stats;

    /// It must give the same bits as every other accelerator.
    fn is_exact(&self) -> bool {
        true
    }
}

impl Tracer for Accel {
    fn closest(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        hits.extend(rays.iter().map(|ray| Accel::closest(self, geometry, ray)));
    }

    fn occluded(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<bool>) {
        hits.extend(rays.iter().map(|ray| Accel::occluded(self, geometry, ray)));
    }

    fn memory_bytes(&self) -> usize {
        Accel::memory_bytes(self)
    }

    fn stats(&self) -> Stats {
        Accel::stats(self)
    }
}

/// The 8-wide tree without robust tests, and the distance off a surface at
/// which rays start.
struct Plain {
    bvh: Bvh8Plain,
    epsilon: f32,
}

impl Tracer for Plain {
    fn closest(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        hits.extend(rays.iter().map(|ray| self.bvh.closest(geometry, ray)));
    }

    fn occluded(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<bool>) {
        hits.extend(rays.iter().map(|ray| self.bvh.occluded(geometry, ray)));
    }

    fn spawn(&self, geometry: &Geometry, spawns: &[Spawn], rays: &mut Vec<Ray>) {
        let leave = |s: &Spawn| geometry.loose_surface(&s.ray, &s.hit).spawn_off(s.dir, self.epsilon);
        rays.extend(spawns.iter().map(leave));
    }

    fn needs_epsilon(&self) -> bool {
        true
    }

    fn memory_bytes(&self) -> usize {
        self.bvh.memory_bytes()
    }

    fn stats(&self) -> Stats {
        self.bvh.stats()
    }

    fn is_exact(&self) -> bool {
        false
    }
}

type Build = dyn Fn(&Geometry) -> Result<Box<dyn Tracer>> + Send + Sync;

/// A way to build a [`Tracer`], by its name.
pub struct Contender {
    /// As it was asked for.
    pub name: String,
    build: Box<Build>,
}

#[cfg(feature = "embree")]
impl Tracer for EmbreeNative {
    fn closest(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        hits.extend(rays.iter().map(|ray| EmbreeNative::closest(self, geometry, ray)));
    }

    fn occluded(&self, geometry: &Geometry, rays: &[Ray], hits: &mut Vec<bool>) {
        hits.extend(rays.iter().map(|ray| EmbreeNative::occluded(self, geometry, ray)));
    }

    fn memory_bytes(&self) -> usize {
        EmbreeNative::memory_bytes(self)
    }

    fn stats(&self) -> Stats {
        Stats::default()
    }

    fn is_exact(&self) -> bool {
        false
    }
}

/// The 8-wide tree of `--bvh fast`.
const FAST: &str = "bvh8-fast";
/// The 8-wide tree without robust tests.
const PLAIN: &str = "bvh8-plain";

/// How far off a surface rays start that need it, as scenes are usually given
/// it: a ten-thousandth of the radius of everything.
pub(super) fn epsilon(geometry: &Geometry) -> f32 {
    geometry.bounds().bounding_sphere().1 * 1e-4
}

impl Contender {
    /// The contender of a name: an accelerator, `bvh8-fast` for the tree of
    /// `--bvh fast`, `bvh8-plain` for the default without robust tests, or with
    /// the feature `embree` Embree as it comes, `embree-native` (robust) and
    /// `embree-loose`.
    pub fn named(name: &str) -> Result<Contender> {
        #[cfg(feature = "embree")]
        if let Some(contender) = Contender::embree(name) {
            return Ok(contender);
        }
        if name == FAST {
            let build = |geometry: &Geometry| -> Result<Box<dyn Tracer>> {
                Ok(Box::new(Accel::build(Some("bvh8"), Quality::Fast, geometry)?))
            };
            return Ok(Contender { name: name.to_owned(), build: Box::new(build) });
        }
        if name == PLAIN {
            let build = |geometry: &Geometry| -> Result<Box<dyn Tracer>> {
                let bvh = Bvh8Plain::new(geometry, Quality::default())?;
                Ok(Box::new(Plain { bvh, epsilon: epsilon(geometry) }))
            };
            return Ok(Contender { name: name.to_owned(), build: Box::new(build) });
        }
        let Some(kind) = Accel::NAMES.iter().find(|kind| **kind == name) else {
            // Says so when it is a kind that was left out of the program.
            if name.starts_with("embree") && !cfg!(feature = "embree") {
                Accel::build_named(Some("embree"), &Geometry::default())?;
            }
            return Err(Error::new(format!("unknown accelerator `{name}`"))
                .suggest(name, Contender::names().iter().map(String::as_str)));
        };
        Ok(Contender {
            name: name.to_owned(),
            build: Box::new(|geometry| Ok(Box::new(Accel::build_named(Some(kind), geometry)?))),
        })
    }

    /// All names.
    #[must_use]
    pub fn names() -> Vec<String> {
        let own = [FAST, PLAIN];
        let embree: &[&str] = if cfg!(feature = "embree") { &["embree-native", "embree-loose"] } else { &[] };
        Accel::NAMES.iter().chain(&own).chain(embree).map(|name| (*name).to_owned()).collect()
    }

    #[cfg(feature = "embree")]
    fn embree(name: &str) -> Option<Contender> {
        let mode = match name {
            "embree-native" => EmbreeMode::Robust,
            "embree-loose" => EmbreeMode::Loose,
            _ => return None,
        };
        let build: Box<Build> = Box::new(move |geometry| Ok(Box::new(EmbreeNative::new(geometry, mode)?)));
        Some(Contender { name: name.to_owned(), build })
    }

    /// Builds it.
    pub fn build(&self, geometry: &Geometry) -> Result<Box<dyn Tracer>> {
        (self.build)(geometry)
    }
}
