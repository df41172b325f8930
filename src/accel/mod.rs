//! Finds what a ray hits.
//!
//! All kinds give the same answer bit for bit: the hit with the smallest
//! parameter, and among equal parameters the lowest [`PrimId`](crate::shape::PrimId).
//! [`Brute`] tests every primitive and is what the others are tested against.
//! This works because a hit's parameter is confined to the interval of its
//! primitive's own box (see [`crate::shape`]): box intervals computed by the
//! same monotone arithmetic can then never cull the winner.
//!
//! Interface. A kind is built from a [`Geometry`] and asked with the geometry
//! at hand, so that it may keep as little or as much of it as it likes. Builder,
//! optimiser and layout are apart: both trees are made from a finished binary
//! one. What is to come fits in: an instance is a primitive whose
//! test transforms the ray and asks a nested accelerator; motion doubles the
//! boxes of a node and blends them by `Ray::time`. `Embree` (cargo feature
//! `embree`) keeps its own scene and has hits decided by
//! `Geometry::intersect_probe`.

mod brute;
mod build;
mod bvh2;
mod bvh8;
mod collapse;
#[cfg(feature = "embree")]
mod embree;
mod reinsert;
mod simd;
mod simd8;
mod simd8_arena;
#[cfg(target_arch = "x86_64")]
mod simd8_avx2;
mod stats;
mod wide;

pub use brute::Brute;
pub use bvh2::Bvh2;
pub use bvh8::{Bvh8, Quality};
#[cfg(feature = "embree")]
pub use embree::{Embree, EmbreeMode, EmbreeNative};
pub use stats::Stats;

use crate::desc::{Error, Result, kinds};
use crate::math::{Bounds, Ray};
use crate::shape::{Geometry, Hit, RayProbe};

kinds! {
    /// An accelerator over the primitives of one [`Geometry`].
    #[derive(Clone, Debug)]
    pub enum Accel {
        /// Every primitive in turn: the oracle.
        Brute(Brute) = ["brute"],
        /// A binary tree of boxes by the surface area heuristic.
        Bvh2(Bvh2) = ["bvh2"],
        /// A tree of eight boxes per node: the fastest.
        Bvh8(Bvh8) = ["bvh8"],
        /// Embree's tree and our tests.
        #[cfg(feature = "embree")]
        Embree(Embree) = ["embree"],
    }
}

impl Accel {
    /// Builds the kind of a name, the best one when there is none, at the
    /// default quality: see [`Accel::build`].
    pub fn build_named(name: Option<&str>, geometry: &Geometry) -> Result<Accel> {
        Accel::build(name, Quality::default(), geometry)
    }

    /// Builds the kind of a name; the best one when there is none. `quality`
    /// is for those that know degrees. Fails on an unknown name, or when the
    /// geometry is too large for the kind. The same geometry gives the same
    /// tree whatever the number of threads.
    pub fn build(name: Option<&str>, quality: Quality, geometry: &Geometry) -> Result<Accel> {
        match name.unwrap_or("bvh8") {
            "brute" => Ok(Brute::new(geometry).into()),
            "bvh2" => Ok(Bvh2::new(geometry)?.into()),
            "bvh8" => Ok(Bvh8::new(geometry, quality)?.into()),
            #[cfg(feature = "embree")]
            "embree" => Ok(Embree::new(geometry)?.into()),
            #[cfg(not(feature = "embree"))]
            "embree" => Err(Error::new("this program was built without Embree")
                .hint("build it with `cargo build --release --features embree`")),
            other => Err(Error::new(format!("unknown accelerator `{other}`"))
                .suggest(other, Accel::NAMES.iter().copied())),
        }
    }

    /// The nearest hit with 0 < t < `ray.t_max`. `None` also for rays that are
    /// not finite or have no direction.
    #[must_use]
    #[inline]
    pub fn closest(&self, geometry: &Geometry, ray: &Ray) -> Option<Hit> {
        let probe = RayProbe::new(ray)?;
        match self {
            Accel::Brute(brute) => brute.closest(geometry, &probe),
            Accel::Bvh2(bvh) => bvh.closest(geometry, &probe),
            Accel::Bvh8(bvh) => bvh.closest(geometry, &probe),
            #[cfg(feature = "embree")]
            Accel::Embree(embree) => embree.closest(geometry, &probe),
        }
    }

    /// True when anything is hit with 0 < t < `ray.t_max`. False for rays that
    /// are not finite or have no direction.
    #[must_use]
    #[inline]
    pub fn occluded(&self, geometry: &Geometry, ray: &Ray) -> bool {
        let Some(probe) = RayProbe::new(ray) else { return false };
        match self {
            Accel::Brute(brute) => brute.occluded(geometry, &probe),
            Accel::Bvh2(bvh) => bvh.occluded(geometry, &probe),
            Accel::Bvh8(bvh) => bvh.occluded(geometry, &probe),
            #[cfg(feature = "embree")]
            Accel::Embree(embree) => embree.occluded(geometry, &probe),
        }
    }

    /// The box of everything; empty for an empty geometry.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        match self {
            Accel::Brute(brute) => brute.bounds(),
            Accel::Bvh2(bvh) => bvh.bounds(),
            Accel::Bvh8(bvh) => bvh.bounds(),
            #[cfg(feature = "embree")]
            Accel::Embree(embree) => embree.bounds(),
        }
    }

    /// Memory beyond that of the geometry, in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        match self {
            Accel::Brute(_) => 0,
            Accel::Bvh2(bvh) => bvh.memory_bytes(),
            Accel::Bvh8(bvh) => bvh.memory_bytes(),
            #[cfg(feature = "embree")]
            Accel::Embree(embree) => embree.memory_bytes(),
        }
    }

    /// Its name in options.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Accel::Brute(_) => "brute",
            Accel::Bvh2(_) => "bvh2",
            Accel::Bvh8(_) => "bvh8",
            #[cfg(feature = "embree")]
            Accel::Embree(_) => "embree",
        }
    }

    /// Numbers about a tree; all zero for kinds without one, and for Embree,
    /// which does not tell.
    #[must_use]
    pub fn stats(&self) -> Stats {
        match self {
            Accel::Brute(_) => Stats::default(),
            Accel::Bvh2(bvh) => bvh.stats(),
            Accel::Bvh8(bvh) => bvh.stats(),
            #[cfg(feature = "embree")]
            Accel::Embree(_) => Stats::default(),
        }
    }
}

/// The nearest hit so far, with the rule for ties.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    hit: Option<Hit>,
    /// Hits must have t below this: the end of the ray at first, then the next
    /// number above the nearest hit, so that equals are still looked at.
    limit: f32,
}

impl Nearest {
    #[inline(always)]
    fn new(probe: &RayProbe) -> Nearest {
        Nearest { hit: None, limit: probe.t_max }
    }

    /// Takes a hit below `limit`, unless it ties with one of a lower id.
    #[inline(always)]
    fn take(&mut self, hit: Hit) {
        if self.hit.is_some_and(|best| hit.t == best.t && hit.prim > best.prim) {
            return;
        }
        self.limit = hit.t.next_up();
        self.hit = Some(hit);
    }
}
