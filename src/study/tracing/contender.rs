//! What takes part in a measurement.

use crate::accel::{Accel, Quality, Stats};
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

impl Contender {
    /// The contender of a name: an accelerator, `bvh8-fast` for the tree of
    /// `--bvh fast`, or with the feature `embree` Embree as it comes,
    /// `embree-native` (robust) and `embree-loose`.
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
        let more: &[&str] =
            if cfg!(feature = "embree") { &[FAST, "embree-native", "embree-loose"] } else { &[FAST] };
        Accel::NAMES.iter().chain(more).map(|name| (*name).to_owned()).collect()
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
