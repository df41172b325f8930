//! A tree of eight boxes per node and blocks of four primitives, after Wald et
//! al. 2008, "Getting Rid of Packets", and Embree's single-ray traversal.
//!
//! A ray meets the eight boxes of a node at once, goes into the nearest and
//! leaves the others on a stack, nearest on top, each with the distance at
//! which it begins; when a hit is found, what begins behind it is dropped. A
//! block is four triangles at once. Both kernels are in `simd8`, in plain Rust
//! and in AVX2, and give the same bits.

use super::Nearest;
use super::build::{Costs, Singles, build};
use super::collapse::{Wide, collapse};
use super::ground::{Ground, Slice};
use super::reinsert::{Effort, improve};
use super::simd8::{Met, Portable, Slots, Stack, WideTask, WideTest};
use super::stats::{Share, Stats};
use super::wide::{Block, LANES, Link, Node8, WIDTH};
use crate::desc::{Error, Result};
use crate::math::{Bounds, Ray};
use crate::shape::{Geometry, Hit};

/// An 8-wide bounding volume hierarchy.
#[derive(Clone, Debug)]
pub struct Bvh8 {
    wide: Wide,
    /// When its boxes begin and end to move, if they do.
    times: Option<[f32; 2]>,
    bounds: Bounds,
    /// The largest absolute value of a coordinate.
    size: f32,
    stats: Stats,
    #[cfg(target_arch = "x86_64")]
    avx2: Option<super::simd::Avx2>,
}

/// How much work goes into a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Binned surface area heuristic.
    Fast,
    /// The same, then improved by reinsertion.
    #[default]
    High,
}

impl Quality {
    /// Names in options.
    pub const NAMES: &'static [&'static str] = &["fast", "high"];

    /// The quality of a name; the best one when there is none.
    pub fn named(name: Option<&str>) -> Result<Quality> {
        match name {
            None => Ok(Quality::default()),
            Some("fast") => Ok(Quality::Fast),
            Some("high") => Ok(Quality::High),
            Some(other) => Err(Error::new(format!("unknown quality `{other}` of a BVH"))
                .suggest(other, Quality::NAMES.iter().copied())),
        }
    }
}

impl Quality {
    /// Leaves of two at high quality, so that the optimiser has something to
    /// move; the collapse joins them. Opening a binary node costs one box test
    /// in eight.
    fn costs(self, geometry: &Geometry) -> Costs {
        let leaf = match self {
            Quality::Fast => LANES,
            Quality::High => LANES / 2,
        };
        let singles = Singles::of(geometry);
        Costs { node: 0.3, block_log: LANES.ilog2(), leaf, small: leaf, singles }
    }
}

/// Cost of visiting a wide node, in leaf blocks.
const PRICE: f32 = 1.0;
/// More rounds or a larger share gain one per cent for half as much work again.
const EFFORT: Effort = Effort { rounds: 6, share: 0.1 };

impl Bvh8 {
    /// Builds the tree. Fails when it takes more than 8 GiB.
    pub fn new(geometry: &Geometry, quality: Quality) -> Result<Bvh8> {
        Bvh8::of(geometry, Slice::TOP, quality)
    }

    pub(super) fn of(geometry: &Geometry, slice: Slice, quality: Quality) -> Result<Bvh8> {
        // What deforms stands in a group; if it should not, its boxes hold all of its way.
        let moving = slice.deforms(geometry);
        let mut items = if moving { slice.middle() } else { slice }.items(geometry);
        let tree = build(&mut items, quality.costs(geometry)).compact();
        let plain = || collapse(geometry, (&items, slice), &tree, PRICE);
        let wide = match quality {
            Quality::Fast => plain(),
            Quality::High => {
                let mut better = tree.clone();
                improve(&mut better, EFFORT);
                // Reinsertion does not bound the depth; the builder does.
                let wide = collapse(geometry, (&items, slice), &better.compact(), PRICE);
                if wide.fits(Stack::SIZE) { wide } else { plain() }
            }
        };
        if wide.arena.len() > Link::MAX {
            return Err(Error::new("a tree of more than 8 GiB").hint("use instances"));
        }
        let bounds = geometry.part_bounds(slice.part);
        Ok(Bvh8 {
            stats: stats(&wide, &bounds),
            wide,
            times: moving.then_some(slice.times),
            bounds,
            size: bounds.min.abs().max(bounds.max.abs()).max_element(),
            #[cfg(target_arch = "x86_64")]
            avx2: super::simd::Avx2::detect(),
        })
    }

    #[inline]
    pub(super) fn closest(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        self.run(Closest::<false> { bvh: self, ground, ray, share: 0.0 })
    }

    /// The same where things may deform.
    pub(super) fn closest_inside(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        match self.share(ray.time) {
            None => self.closest(ground, ray),
            Some(share) => self.run(Closest::<true> { bvh: self, ground, ray, share }),
        }
    }

    #[inline]
    pub(super) fn occluded(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        self.run(Occluded::<false> { bvh: self, ground, ray, share: 0.0 })
    }

    /// The same where things may deform.
    pub(super) fn occluded_inside(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        match self.share(ray.time) {
            None => self.occluded(ground, ray),
            Some(share) => self.run(Occluded::<true> { bvh: self, ground, ray, share }),
        }
    }

    /// How much of the slice is over at a time, if boxes move during it.
    fn share(&self, time: f32) -> Option<f32> {
        let [start, end] = self.times?;
        Some(((time - start) / (end - start)).clamp(0.0, 1.0))
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.bounds
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.wide.arena.bytes()
    }

    pub(super) fn stats(&self) -> Stats {
        self.stats
    }

    /// A number that changes with any bit of the tree: two builds of the same
    /// geometry have the same (FNV-1a, 64 bits).
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.wide.arena.words().fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    /// The same tree without vector instructions: to test that they change
    /// nothing.
    #[must_use]
    pub fn portable(self) -> Bvh8 {
        #[cfg(target_arch = "x86_64")]
        return Bvh8 { avx2: None, ..self };
        #[cfg(not(target_arch = "x86_64"))]
        return self;
    }

    /// What it holds, to be changed.
    pub(super) fn wide_mut(&mut self) -> &mut Wide {
        &mut self.wide
    }

    #[inline(always)]
    pub(super) fn run<T: WideTask>(&self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = self.avx2 {
            return avx2.run_wide(task);
        }
        task.run(Portable)
    }
}

/// With boxes that have moved by a share of their way if `MOVING`.
pub(super) struct Closest<'a, const MOVING: bool> {
    pub bvh: &'a Bvh8,
    pub ground: &'a Ground<'a>,
    pub ray: &'a Ray,
    pub share: f32,
}

impl<const MOVING: bool> WideTask for Closest<'_, MOVING> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<T: WideTest>(self, test: T) -> Option<Hit> {
        let mut current = self.bvh.wide.root?;
        let probe = &test.probe(self.ray)?;
        let ray = test.prepare(probe, self.bvh.size);
        let mut nearest = Nearest::new(probe);
        let mut slots = Slots::new();
        let mut stack = Stack::new(&mut slots);
        loop {
            if !current.is_leaf() {
                let moved;
                let node = if MOVING {
                    let arena = &self.bvh.wide.arena;
                    moved = test.moved(arena.node(current), arena.swing(current), self.share);
                    &moved
                } else {
                    self.bvh.wide.arena.node(current)
                };
                let (mask, near) = test.boxes(&ray, node, nearest.limit);
                test.fetch(mask, node, &self.bvh.wide.arena);
                if mask != 0 {
                    current = match single(mask, node) {
                        Some(child) => child,
                        None => test.descend(mask, near, node, &mut stack),
                    };
                    continue;
                }
            } else {
                let (moved, mask);
                let block = if MOVING {
                    (moved, mask) = self.bvh.wide.block_at(test, self.ground.geometry, current, probe.time);
                    &moved
                } else {
                    mask = current.triangle_mask();
                    self.bvh.wide.arena.block(current)
                };
                let met = test.triangles(&ray, probe, block, mask, nearest.limit);
                if met.mask != 0 {
                    take_all(&mut nearest, block, &met);
                }
                if current.has_analytic() {
                    for prim in others::<MOVING>(block, self.ground.geometry) {
                        if let Some(hit) = self.ground.intersect_other(prim, probe, nearest.limit) {
                            nearest.take(hit);
                        }
                    }
                }
            }
            match stack.pop(nearest.limit) {
                Some(next) => current = next,
                None => return nearest.hit,
            }
        }
    }
}

/// The child in `mask`, when there is only one.
#[inline(always)]
fn single(mask: u32, node: &Node8) -> Option<Link> {
    (mask & (mask - 1) == 0).then(|| node.children[mask.trailing_zeros() as usize % WIDTH])
}

/// Takes all triangles of a block that have been hit.
#[inline(always)]
fn take_all(nearest: &mut Nearest, block: &Block, met: &Met) {
    let mut mask = met.mask;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize % LANES;
        mask &= mask - 1;
        if met.t[lane] < nearest.limit {
            nearest.take(Hit {
                t: met.t[lane],
                prim: block.prims[lane],
                u: met.u[lane],
                v: met.v[lane],
                instance: Hit::NO_INSTANCE,
            });
        }
    }
}

/// The primitives of a block that are no still triangles; nor deforming ones if these have
/// been tested.
fn others<'a, const MOVING: bool>(block: &'a Block, geometry: &Geometry) -> impl Iterator<Item = u32> + 'a {
    let (first, deforming) = (geometry.triangle_count(), geometry.deforming());
    let other =
        move |prim: &u32| *prim >= first && *prim != Block::NONE && !(MOVING && deforming.contains(prim));
    block.prims.iter().copied().filter(other)
}

/// With boxes that have moved by a share of their way if `MOVING`.
pub(super) struct Occluded<'a, const MOVING: bool> {
    pub bvh: &'a Bvh8,
    pub ground: &'a Ground<'a>,
    pub ray: &'a Ray,
    pub share: f32,
}

impl<const MOVING: bool> WideTask for Occluded<'_, MOVING> {
    type Output = bool;

    #[inline(always)]
    fn run<T: WideTest>(self, test: T) -> bool {
        let Some(mut current) = self.bvh.wide.root else { return false };
        let Some(probe) = &test.probe(self.ray) else { return false };
        let ray = test.prepare(probe, self.bvh.size);
        let limit = probe.t_max;
        let mut slots = Slots::new();
        let mut stack = Stack::new(&mut slots);
        loop {
            if !current.is_leaf() {
                let moved;
                let node = if MOVING {
                    let arena = &self.bvh.wide.arena;
                    moved = test.moved(arena.node(current), arena.swing(current), self.share);
                    &moved
                } else {
                    self.bvh.wide.arena.node(current)
                };
                let (mask, _) = test.boxes(&ray, node, limit);
                test.fetch(mask, node, &self.bvh.wide.arena);
                if mask != 0 {
                    current = match single(mask, node) {
                        Some(child) => child,
                        None => test.descend_any(mask, node, &mut stack),
                    };
                    continue;
                }
            } else {
                let (moved, mask);
                let block = if MOVING {
                    (moved, mask) = self.bvh.wide.block_at(test, self.ground.geometry, current, probe.time);
                    &moved
                } else {
                    mask = current.triangle_mask();
                    self.bvh.wide.arena.block(current)
                };
                if test.triangles(&ray, probe, block, mask, limit).mask != 0 {
                    return true;
                }
                if current.has_analytic() {
                    let hit = |prim| self.ground.occluded_other(prim, probe, limit);
                    if others::<MOVING>(block, self.ground.geometry).any(hit) {
                        return true;
                    }
                }
            }
            match stack.pop_any() {
                Some(next) => current = next,
                None => return false,
            }
        }
    }
}

fn stats(wide: &Wide, bounds: &Bounds) -> Stats {
    let share = Share::new(bounds);
    let mut stats = Stats::default();
    if wide.root.is_some() {
        stats.cost = 1.0;
        stats.leaves = 1;
    }
    wide.for_each_node(0, |node, depth: usize| {
        stats.nodes += 1;
        stats.depth = stats.depth.max(depth + 1);
        stats.cost += node.lanes().map(|lane| share.of(&node.bounds(lane))).sum::<f64>();
        stats.leaves += node.lanes().filter(|lane| node.children[*lane].is_leaf()).count();
        depth + 1
    });
    if stats.nodes > 0 {
        stats.leaves -= 1;
    }
    stats
}
