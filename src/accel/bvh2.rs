//! A binary tree of boxes: both children's boxes in one 64-byte node, at most
//! four primitives in a leaf, their vertices copied into the order of the
//! leaves.

use super::Nearest;
use super::build::{Costs, MAX_DEPTH, Singles, Tree, TreeNode, build};
use super::ground::{Ground, Slice};
use super::simd::{BoxTest, Portable, Task};
use super::stats::Stats;
use crate::desc::{Error, Result};
use crate::math::{Bounds, Ray, Vec3};
use crate::shape::{Geometry, Hit, RayProbe};

/// A binary bounding volume hierarchy.
#[derive(Clone, Debug)]
pub struct Bvh2 {
    nodes: Vec<Node>,
    entries: Vec<Entry>,
    root: Option<Reference>,
    bounds: Bounds,
    stats: Stats,
    #[cfg(target_arch = "x86_64")]
    avx2: Option<super::simd::Avx2>,
}

/// Two boxes and what is in them. `planes[axis]` holds the lower planes of both
/// and the upper planes of both.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Node {
    pub(super) planes: [[f32; 4]; 3],
    children: [u32; 2],
}

impl Node {
    pub(super) fn new(b: [Bounds; 2], children: [u32; 2]) -> Node {
        let axis = |i: usize| [b[0].min[i], b[1].min[i], b[0].max[i], b[1].max[i]];
        Node { planes: [axis(0), axis(1), axis(2)], children }
    }
}

/// A child of a node in 32 bits: the index of a node, or bit 31, the count
/// minus one in two bits and the index of the first entry.
type Reference = u32;

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 29;
const INDEX_MASK: u32 = (1 << COUNT_SHIFT) - 1;

/// A node against one primitive test.
const COSTS: Costs = Costs { node: 1.0, block_log: 0, leaf: 4, small: 1, singles: Singles::NONE };

/// A primitive in a leaf. Analytic ones leave the vertices unused.
#[derive(Clone, Copy, Debug)]
struct Entry {
    vertices: [Vec3; 3],
    prim: u32,
}

impl Bvh2 {
    /// Builds the tree. Fails when there are 2²⁹ primitives or more.
    pub fn new(geometry: &Geometry) -> Result<Bvh2> {
        Bvh2::of(geometry, Slice::TOP)
    }

    pub(super) fn of(geometry: &Geometry, slice: Slice) -> Result<Bvh2> {
        if geometry.prim_count() > INDEX_MASK {
            return Err(Error::new("more than 2^29 primitives").hint("use instances"));
        }
        let mut items = slice.items(geometry);
        let tree = build(&mut items, COSTS);
        let entries: Vec<Entry> = items
            .iter()
            .map(|item| Entry {
                vertices: geometry.triangle(item.prim()).unwrap_or([Vec3::ZERO; 3]),
                prim: item.prim(),
            })
            .collect();
        let mut nodes = Vec::new();
        let root = tree.nodes.first().map(|root| store(&tree, root, &mut nodes));
        Ok(Bvh2 {
            nodes,
            root,
            entries,
            bounds: geometry.part_bounds(slice.part),
            stats: Stats::of_binary(&tree),
            #[cfg(target_arch = "x86_64")]
            avx2: super::simd::Avx2::detect(),
        })
    }

    pub(super) fn closest(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        self.run(Closest { bvh: self, ground, probe: &RayProbe::new(ray)? })
    }

    pub(super) fn occluded(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        let Some(probe) = &RayProbe::new(ray) else { return false };
        self.run(Occluded { bvh: self, ground, probe })
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.bounds
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.entries)
    }

    pub(super) fn stats(&self) -> Stats {
        self.stats
    }

    /// A number that changes with any bit of the tree: two builds of the same
    /// geometry have the same (FNV-1a, 64 bits).
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let planes = self.nodes.iter().flat_map(|n| n.planes.as_flattened().iter().map(|x| x.to_bits()));
        let links = self.nodes.iter().flat_map(|n| n.children).chain(self.entries.iter().map(|e| e.prim));
        planes.chain(links).fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    /// The same tree without vector instructions: to test that they change
    /// nothing.
    #[must_use]
    pub fn portable(self) -> Bvh2 {
        #[cfg(target_arch = "x86_64")]
        return Bvh2 { avx2: None, ..self };
        #[cfg(not(target_arch = "x86_64"))]
        return self;
    }

    #[inline]
    fn run<T: Task>(&self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = self.avx2 {
            return avx2.run(task);
        }
        task.run(Portable)
    }

    /// The entries of a leaf.
    #[inline(always)]
    fn leaf(&self, reference: Reference) -> &[Entry] {
        let first = (reference & INDEX_MASK) as usize;
        let count = ((reference & !LEAF) >> COUNT_SHIFT) as usize + 1;
        &self.entries[first..first + count]
    }
}

#[inline(always)]
fn test_entry(entry: &Entry, ground: &Ground<'_>, probe: &RayProbe, limit: f32) -> Option<Hit> {
    if entry.prim < ground.geometry.triangle_count() {
        Geometry::intersect_triangle(entry.prim, &entry.vertices, probe, limit)
    } else {
        ground.intersect_other(entry.prim, probe, limit)
    }
}

/// Stores what is below a node, depth first, and gives the reference to it.
fn store(tree: &Tree, node: &TreeNode, nodes: &mut Vec<Node>) -> Reference {
    if node.is_leaf() {
        return LEAF | ((node.count - 1) << COUNT_SHIFT) | node.first;
    }
    let index = nodes.len();
    let pair = [0, 1].map(|i| &tree.nodes[node.first as usize + i]);
    nodes.push(Node::new(pair.map(TreeNode::bounds), [0; 2]));
    let children = pair.map(|child| store(tree, child, nodes));
    nodes[index].children = children;
    index as Reference
}

/// Children still to be visited. Deep enough for every tree: a visit adds at
/// most one.
struct Stack {
    entries: [(Reference, f32); MAX_DEPTH],
    len: usize,
}

impl Stack {
    #[inline(always)]
    fn new() -> Stack {
        Stack { entries: [(0, 0.0); MAX_DEPTH], len: 0 }
    }

    #[inline(always)]
    fn push(&mut self, reference: Reference, near: f32) {
        self.entries[self.len] = (reference, near);
        self.len += 1;
    }

    /// The latest child that begins before `limit`.
    #[inline(always)]
    fn pop(&mut self, limit: f32) -> Option<Reference> {
        while self.len > 0 {
            self.len -= 1;
            let (reference, near) = self.entries[self.len];
            if near < limit {
                return Some(reference);
            }
        }
        None
    }
}

struct Closest<'a> {
    bvh: &'a Bvh2,
    ground: &'a Ground<'a>,
    probe: &'a RayProbe,
}

impl Task for Closest<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<T: BoxTest>(self, boxes: T) -> Option<Hit> {
        let ray = boxes.prepare(self.probe);
        let mut nearest = Nearest::new(self.probe);
        let mut stack = Stack::new();
        let mut next = self.bvh.root;
        while let Some(current) = next {
            if current & LEAF != 0 {
                for entry in self.bvh.leaf(current) {
                    if let Some(hit) = test_entry(entry, self.ground, self.probe, nearest.limit) {
                        nearest.take(hit);
                    }
                }
                next = stack.pop(nearest.limit);
                continue;
            }
            // Visit the nearer child first.
            let node = &self.bvh.nodes[current as usize];
            let (met, near) = boxes.test(&ray, node, nearest.limit);
            let [a, b] = node.children;
            next = match met {
                [true, true] if near[1] < near[0] => {
                    stack.push(a, near[0]);
                    Some(b)
                }
                [true, true] => {
                    stack.push(b, near[1]);
                    Some(a)
                }
                [true, false] => Some(a),
                [false, true] => Some(b),
                [false, false] => stack.pop(nearest.limit),
            };
        }
        nearest.hit
    }
}

struct Occluded<'a> {
    bvh: &'a Bvh2,
    ground: &'a Ground<'a>,
    probe: &'a RayProbe,
}

impl Task for Occluded<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<T: BoxTest>(self, boxes: T) -> bool {
        let ray = boxes.prepare(self.probe);
        let limit = self.probe.t_max;
        let mut stack = Stack::new();
        let mut next = self.bvh.root;
        while let Some(current) = next {
            if current & LEAF != 0 {
                let hit = |entry: &Entry| test_entry(entry, self.ground, self.probe, limit).is_some();
                if self.bvh.leaf(current).iter().any(hit) {
                    return true;
                }
                next = stack.pop(f32::INFINITY);
                continue;
            }
            let node = &self.bvh.nodes[current as usize];
            let (met, near) = boxes.test(&ray, node, limit);
            let [a, b] = node.children;
            next = match met {
                [true, true] => {
                    stack.push(b, near[1]);
                    Some(a)
                }
                [true, false] => Some(a),
                [false, true] => Some(b),
                [false, false] => stack.pop(f32::INFINITY),
            };
        }
        false
    }
}
