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
//! one. `Embree` (cargo feature `embree`) keeps its own scene and has hits
//! decided by our tests.
//!
//! An instance is a primitive whose test takes the ray into the space of its
//! group and asks the group's own tree (`ground`); one that moves has the box
//! of its whole way. A group that deforms has a tree for each slice of the
//! shutter: `bvh8` from key to key, with boxes that move along (linear bounds, as
//! in Woop et al. 2017, "STBVH: A Spatial-Temporal BVH for Efficient Multi-Segment
//! Motion Blur", section 3) and triangles interpolated four at a time; the others as many as keep boxes
//! tight. The kernel for what moves is compiled apart, and costs nothing where
//! nothing moves.

mod brute;
mod build;
mod bvh2;
mod bvh8;
mod bvh8_plain;
mod collapse;
#[cfg(feature = "embree")]
mod embree;
mod ground;
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
pub use bvh8_plain::Bvh8Plain;
#[cfg(feature = "embree")]
pub use embree::{Embree, EmbreeMode, EmbreeNative};
pub use stats::Stats;

use ground::{Ground, Group, Slice};

use crate::desc::{Error, Result, kinds};
use crate::math::{Bounds, Ray};
use crate::shape::{Geometry, Hit, RayProbe};

kinds! {
    /// A tree over the primitives of one part of a [`Geometry`].
    #[derive(Clone, Debug)]
    pub enum Tree {
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

/// Calls the method of whichever kind it is.
macro_rules! dispatch {
    ($self:expr, $kind:ident => $call:expr) => {
        match $self {
            Tree::Brute($kind) => $call,
            Tree::Bvh2($kind) => $call,
            Tree::Bvh8($kind) => $call,
            #[cfg(feature = "embree")]
            Tree::Embree($kind) => $call,
        }
    };
}

impl Tree {
    fn build(name: &str, quality: Quality, geometry: &Geometry, slice: Slice) -> Result<Tree> {
        match name {
            "brute" => Ok(Brute::of(geometry, slice).into()),
            "bvh2" => Ok(Bvh2::of(geometry, slice)?.into()),
            "bvh8" => Ok(Bvh8::of(geometry, slice, quality)?.into()),
            #[cfg(feature = "embree")]
            "embree" => Ok(Embree::of(geometry, slice)?.into()),
            #[cfg(not(feature = "embree"))]
            "embree" => Err(Error::new("this program was built without Embree")
                .hint("build it with `cargo build --release --features embree`")),
            other => Err(Error::new(format!("unknown accelerator `{other}`"))
                .suggest(other, Accel::NAMES.iter().copied())),
        }
    }

    #[inline]
    fn closest(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        dispatch!(self, tree => tree.closest(ground, ray))
    }

    #[inline]
    fn occluded(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        dispatch!(self, tree => tree.occluded(ground, ray))
    }

    /// As [`Tree::closest`], of the tree of a group.
    #[inline]
    fn closest_inside(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        match self {
            Tree::Bvh8(bvh) => bvh.closest_inside(ground, ray),
            other => other.closest(ground, ray),
        }
    }

    /// As [`Tree::occluded`], of the tree of a group.
    #[inline]
    fn occluded_inside(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        match self {
            Tree::Bvh8(bvh) => bvh.occluded_inside(ground, ray),
            other => other.occluded(ground, ray),
        }
    }

    fn memory_bytes(&self) -> usize {
        dispatch!(self, tree => tree.memory_bytes())
    }
}

/// An accelerator over a whole [`Geometry`]: a tree for its top and trees for
/// its groups, all of one kind.
#[derive(Clone, Debug)]
pub struct Accel {
    top: Tree,
    groups: Vec<Group>,
    bounds: Bounds,
}

/// For a geometry without groups.
macro_rules! from_tree {
    ($($kind:ty),*) => {
        $(impl From<$kind> for Accel {
            fn from(tree: $kind) -> Accel {
                Accel { bounds: tree.bounds(), top: tree.into(), groups: Vec::new() }
            }
        })*
    };
}
from_tree!(Brute, Bvh2, Bvh8);

impl Accel {
    /// Names of the kinds in options.
    pub const NAMES: &'static [&'static str] = Tree::NAMES;

    /// Builds the kind of a name, the best one when there is none, at the
    /// default quality: see [`Accel::build`].
    pub fn build_named(name: Option<&str>, geometry: &Geometry) -> Result<Accel> {
        Accel::build(name, Quality::default(), geometry)
    }

    /// Builds the kind of a name; the best one when there is none. `quality`
    /// is for those that know degrees. Fails on an unknown name, or when the
    /// geometry is too large for the kind. The same geometry gives the same
    /// trees whatever the number of threads.
    pub fn build(name: Option<&str>, quality: Quality, geometry: &Geometry) -> Result<Accel> {
        let name = name.unwrap_or("bvh8");
        let tree = |slice| Tree::build(name, quality, geometry, slice);
        let group = |part| {
            let slices = match name {
                "bvh8" => Slice::from_key_to_key(geometry, part),
                _ => Slice::of_part(geometry, part),
            };
            let starts = slices.iter().skip(1).map(|slice| slice.times[0]).collect();
            let slices: Result<Vec<Tree>> = slices.into_iter().map(tree).collect();
            Ok(Group { slices: slices?, starts })
        };
        let groups: Result<Vec<Group>> = (1..geometry.parts()).map(group).collect();
        Ok(Accel { top: tree(Slice::TOP)?, groups: groups?, bounds: geometry.bounds() })
    }

    fn ground<'a>(&'a self, geometry: &'a Geometry) -> Ground<'a> {
        Ground { geometry, groups: &self.groups }
    }

    /// The nearest hit with 0 < t < `ray.t_max`. `None` also for rays that are
    /// not finite or have no direction.
    #[must_use]
    #[inline]
    pub fn closest(&self, geometry: &Geometry, ray: &Ray) -> Option<Hit> {
        self.top.closest(&self.ground(geometry), ray)
    }

    /// True when anything is hit with 0 < t < `ray.t_max`. False for rays that
    /// are not finite or have no direction.
    #[must_use]
    #[inline]
    pub fn occluded(&self, geometry: &Geometry, ray: &Ray) -> bool {
        self.top.occluded(&self.ground(geometry), ray)
    }

    /// The box of everything; empty for an empty geometry.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Memory beyond that of the geometry, in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let groups = self.groups.iter().flat_map(|g| &g.slices).map(Tree::memory_bytes).sum::<usize>();
        self.top.memory_bytes() + groups
    }

    /// Its name in options.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match &self.top {
            Tree::Brute(_) => "brute",
            Tree::Bvh2(_) => "bvh2",
            Tree::Bvh8(_) => "bvh8",
            #[cfg(feature = "embree")]
            Tree::Embree(_) => "embree",
        }
    }

    /// Trees of groups: of how many, and how many slices of the shutter they
    /// have together.
    #[must_use]
    pub fn group_trees(&self) -> (usize, usize) {
        (self.groups.len(), self.groups.iter().map(|g| g.slices.len()).sum())
    }

    /// Numbers about the tree of the top; all zero for kinds without one, and
    /// for Embree, which does not tell.
    #[must_use]
    pub fn stats(&self) -> Stats {
        match &self.top {
            Tree::Brute(_) => Stats::default(),
            Tree::Bvh2(bvh) => bvh.stats(),
            Tree::Bvh8(bvh) => bvh.stats(),
            #[cfg(feature = "embree")]
            Tree::Embree(_) => Stats::default(),
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
        if self.hit.is_some_and(|best| hit.t == best.t && hit.rank() > best.rank()) {
            return;
        }
        self.limit = hit.t.next_up();
        self.hit = Some(hit);
    }
}
