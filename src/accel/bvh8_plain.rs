//! The 8-wide tree without what makes its hits robust: to measure what that
//! costs, never to render with.
//!
//! The same nodes, traversal and blocks of four, and in place of our tests
//! those of a renderer that lives with an epsilon: triangles by Möller and
//! Trumbore 1997 in f32 (edges stored, no fallback, parameters not confined to
//! the box), nothing left out, rays not checked. So rays pass between
//! triangles, and those that leave a surface have to start a fixed distance off
//! it. What is no still triangle is tested as elsewhere; there are no
//! instances. `record/robust-cost.md` has the figures.

use super::bvh8::{Bvh8, Closest, Occluded, Quality};
use super::ground::Ground;
use super::simd8::{Met, Stack, WideTask, WideTest};
use super::simd8_arena::{Arena, Swing};
use super::stats::Stats;
use super::wide::{Block, LANES, Link, Node8};
use crate::desc::Result;
use crate::math::Ray;
use crate::shape::{Geometry, Hit, RayProbe};

/// An 8-wide tree whose tests are not robust.
#[derive(Clone, Debug)]
pub struct Bvh8Plain {
    bvh: Bvh8,
}

impl Bvh8Plain {
    /// Builds the tree of [`Bvh8::new`]. Fails when that does.
    pub fn new(geometry: &Geometry, quality: Quality) -> Result<Bvh8Plain> {
        let mut bvh = Bvh8::new(geometry, quality)?;
        let wide = bvh.wide_mut();
        let mut leaves: Vec<Link> = wide.root.into_iter().filter(|root| root.is_leaf()).collect();
        wide.for_each_node((), |node, ()| {
            leaves.extend(node.lanes().map(|lane| node.children[lane]).filter(|child| child.is_leaf()));
        });
        for leaf in leaves {
            wide.arena.change_block(leaf, Block::into_edges);
        }
        Ok(Bvh8Plain { bvh })
    }

    /// The nearest hit, if it is found. The ray must be finite.
    #[must_use]
    #[inline]
    pub fn closest(&self, geometry: &Geometry, ray: &Ray) -> Option<Hit> {
        let ground = Ground { geometry, groups: &[] };
        self.bvh.run(Plainly(Closest::<false> { bvh: &self.bvh, ground: &ground, ray, share: 0.0 }))
    }

    /// Whether any hit is found. The ray must be finite.
    #[must_use]
    #[inline]
    pub fn occluded(&self, geometry: &Geometry, ray: &Ray) -> bool {
        let ground = Ground { geometry, groups: &[] };
        self.bvh.run(Plainly(Occluded::<false> { bvh: &self.bvh, ground: &ground, ray, share: 0.0 }))
    }

    /// Memory beyond that of the geometry, in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.bvh.memory_bytes()
    }

    /// Numbers about the tree.
    #[must_use]
    pub fn stats(&self) -> Stats {
        self.bvh.stats()
    }
}

/// A task with the plain test of triangles.
struct Plainly<T>(T);

impl<K: WideTask> WideTask for Plainly<K> {
    type Output = K::Output;

    #[inline(always)]
    fn run<T: WideTest>(self, test: T) -> K::Output {
        self.0.run(Plain(test))
    }
}

/// A way to test with the plain test of triangles.
#[derive(Clone, Copy)]
struct Plain<T>(T);

impl<T: WideTest> WideTest for Plain<T> {
    type Ray = T::Ray;
    type Near = T::Near;

    #[inline(always)]
    fn probe(self, ray: &Ray) -> Option<RayProbe> {
        Some(RayProbe::plain(ray))
    }

    #[inline(always)]
    fn prepare(self, probe: &RayProbe, size: f32) -> T::Ray {
        self.0.prepare(probe, size)
    }

    #[inline(always)]
    fn boxes(self, ray: &T::Ray, node: &Node8, limit: f32) -> (u32, T::Near) {
        self.0.boxes(ray, node, limit)
    }

    #[inline(always)]
    fn moved(self, node: &Node8, swing: &Swing, share: f32) -> Node8 {
        self.0.moved(node, swing, share)
    }

    #[inline(always)]
    fn between(self, from: &Block, to: &Block, shares: &[f32; LANES]) -> Block {
        self.0.between(from, to, shares)
    }

    #[inline(always)]
    fn descend(self, mask: u32, near: T::Near, node: &Node8, stack: &mut Stack<'_>) -> Link {
        self.0.descend(mask, near, node, stack)
    }

    #[inline(always)]
    fn descend_any(self, mask: u32, node: &Node8, stack: &mut Stack<'_>) -> Link {
        self.0.descend_any(mask, node, stack)
    }

    #[inline(always)]
    fn fetch(self, mask: u32, node: &Node8, arena: &Arena) {
        self.0.fetch(mask, node, arena);
    }

    #[inline(always)]
    fn triangles(self, ray: &T::Ray, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met {
        self.0.loose(ray, probe, block, mask, limit)
    }

    #[inline(always)]
    fn loose(self, ray: &T::Ray, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met {
        self.0.loose(ray, probe, block, mask, limit)
    }
}
