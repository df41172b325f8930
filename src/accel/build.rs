//! Builds a binary tree of boxes by the binned surface area heuristic (Wald
//! 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies").
//!
//! The tree depends on nothing but the boxes: halves are built in parallel but
//! joined in order, and bins are summed in parallel by operations that are
//! exact and associative. Costs are ratios of areas in f64, so a scene scaled
//! by a power of two gives the same tree.

use rayon::prelude::*;

use crate::math::Bounds;

/// The most primitives of a leaf.
pub const MAX_LEAF: usize = 4;
/// Below this depth halves are split in the middle, which bounds the depth of
/// any tree by [`MAX_DEPTH`].
const MEDIAN_DEPTH: usize = 48;
/// No tree is deeper: 2³² primitives halve 32 times.
pub const MAX_DEPTH: usize = MEDIAN_DEPTH + 33;
const BINS: usize = 16;
/// Cost of visiting a node, in triangle tests.
const NODE_COST: f64 = 1.0;
/// Sizes from which work is shared between threads.
const PARALLEL_BUILD: usize = 4096;
const PARALLEL_BINS: usize = 1 << 16;

/// A primitive to be put into the tree.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    pub bounds: Bounds,
    pub prim: u32,
}

impl Item {
    fn centre(&self, axis: usize) -> f32 {
        self.bounds.min[axis] * 0.5 + self.bounds.max[axis] * 0.5
    }
}

/// A node of the tree, whatever the layout it will be stored in.
#[derive(Clone, Copy, Debug)]
pub struct BuildNode {
    pub bounds: [Bounds; 2],
    pub children: [Child; 2],
}

/// What a child of a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Index of a node.
    Node(u32),
    /// A range of the items.
    Leaf { first: u32, count: u32 },
}

/// Sorts the items into the order of the leaves and gives the nodes, depth
/// first. The root is a leaf when no node is worth it.
pub fn build(items: &mut [Item]) -> (Vec<BuildNode>, Child) {
    let mut nodes = Vec::new();
    let root = subtree(items, 0, 0, &mut nodes);
    (nodes, root)
}

fn subtree(items: &mut [Item], first: u32, depth: usize, nodes: &mut Vec<BuildNode>) -> Child {
    let Some(middle) = split(items, depth) else {
        return Child::Leaf { first, count: items.len() as u32 };
    };
    let index = nodes.len();
    let parallel = items.len() >= PARALLEL_BUILD;
    let (left, right) = items.split_at_mut(middle);
    let bounds = [bounds_of(left), bounds_of(right)];
    nodes.push(BuildNode { bounds, children: [Child::Node(0); 2] });
    let right_first = first + middle as u32;
    let children = if parallel {
        let mut right_nodes = Vec::new();
        let (a, b) = rayon::join(
            || subtree(left, first, depth + 1, nodes),
            || subtree(right, right_first, depth + 1, &mut right_nodes),
        );
        let base = nodes.len() as u32;
        let moved = |child| match child {
            Child::Node(i) => Child::Node(i + base),
            leaf @ Child::Leaf { .. } => leaf,
        };
        nodes.extend(right_nodes.iter().map(|n| BuildNode { children: n.children.map(moved), ..*n }));
        [a, moved(b)]
    } else {
        let a = subtree(left, first, depth + 1, nodes);
        [a, subtree(right, right_first, depth + 1, nodes)]
    };
    nodes[index].children = children;
    Child::Node(index as u32)
}

fn bounds_of(items: &[Item]) -> Bounds {
    items.iter().fold(Bounds::EMPTY, |b, item| b.union(item.bounds))
}

/// Puts the items into two parts and gives the size of the first; `None` when
/// they are better off as a leaf.
fn split(items: &mut [Item], depth: usize) -> Option<usize> {
    let count = items.len();
    if count <= 1 {
        return None;
    }
    let centres = centre_bounds(items);
    if depth < MEDIAN_DEPTH
        && let Some(plane) = best_plane(items, &centres)
    {
        let leaf_cost = count as f64;
        if count <= MAX_LEAF && leaf_cost <= plane.cost {
            return None;
        }
        return Some(partition(items, |item| plane.bin(item) <= plane.last));
    }
    if count <= MAX_LEAF {
        return None;
    }
    // All centres coincide, or the tree is too deep: halve.
    let extent = centres.extent();
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    items.select_nth_unstable_by(count / 2, |a, b| {
        a.centre(axis).total_cmp(&b.centre(axis)).then(a.prim.cmp(&b.prim))
    });
    Some(count / 2)
}

fn centre_bounds(items: &[Item]) -> Bounds {
    let grow = |b: Bounds, item: &Item| b.grow(item.bounds.centre());
    if items.len() < PARALLEL_BINS {
        return items.iter().fold(Bounds::EMPTY, grow);
    }
    let chunks = items.par_chunks(PARALLEL_BINS / 4).map(|chunk| chunk.iter().fold(Bounds::EMPTY, grow));
    chunks.reduce(|| Bounds::EMPTY, Bounds::union)
}

/// A plane between bins: those up to `last` are on its left.
#[derive(Clone, Copy, Debug)]
struct Plane {
    axis: usize,
    low: f32,
    scale: f64,
    last: usize,
    cost: f64,
}

impl Plane {
    fn bin(&self, item: &Item) -> usize {
        bin_of(item.centre(self.axis), self.low, self.scale)
    }
}

fn bin_of(centre: f32, low: f32, scale: f64) -> usize {
    (((f64::from(centre) - f64::from(low)) * scale) as usize).min(BINS - 1)
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    bounds: Bounds,
    count: usize,
}

const NO_BIN: Bin = Bin { bounds: Bounds::EMPTY, count: 0 };

impl Bin {
    fn join(self, other: Bin) -> Bin {
        Bin { bounds: self.bounds.union(other.bounds), count: self.count + other.count }
    }

    /// Area times count: what the heuristic sums. Zero when empty.
    fn weight(&self) -> f64 {
        if self.count == 0 { 0.0 } else { half_area(&self.bounds) * self.count as f64 }
    }
}

/// In f64: areas of extreme scenes leave the range of f32.
fn half_area(bounds: &Bounds) -> f64 {
    let d = bounds.extent().as_dvec3();
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// The cheapest plane over all axes, the first one among equals.
fn best_plane(items: &[Item], centres: &Bounds) -> Option<Plane> {
    let extent = centres.extent();
    let mut best: Option<Plane> = None;
    for axis in 0..3 {
        let scale = BINS as f64 / f64::from(extent[axis]);
        if !(extent[axis] > 0.0) || !scale.is_finite() {
            continue;
        }
        let low = centres.min[axis];
        let bins = fill(items, |item| bin_of(item.centre(axis), low, scale));
        let total = bins.iter().fold(NO_BIN, |a, b| a.join(*b));
        let area = half_area(&total.bounds);

        // Weights of everything right of each plane, then sweep from the left.
        let mut right = [0.0; BINS];
        let mut sum = NO_BIN;
        for i in (1..BINS).rev() {
            sum = sum.join(bins[i]);
            right[i - 1] = sum.weight();
        }
        let mut left = NO_BIN;
        for last in 0..BINS - 1 {
            left = left.join(bins[last]);
            if left.count == 0 || left.count == items.len() {
                continue;
            }
            let cost = NODE_COST + (left.weight() + right[last]) / area;
            let cost = if cost.is_finite() { cost } else { f64::MAX };
            if best.is_none_or(|b| cost < b.cost) {
                best = Some(Plane { axis, low, scale, last, cost });
            }
        }
    }
    best
}

fn fill(items: &[Item], bin: impl Fn(&Item) -> usize + Sync) -> [Bin; BINS] {
    let one = |items: &[Item]| {
        let mut bins = [NO_BIN; BINS];
        for item in items {
            let i = bin(item);
            bins[i] = bins[i].join(Bin { bounds: item.bounds, count: 1 });
        }
        bins
    };
    if items.len() < PARALLEL_BINS {
        return one(items);
    }
    items.par_chunks(PARALLEL_BINS / 4).map(one).reduce(
        || [NO_BIN; BINS],
        |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a = a.join(b));
            a
        },
    )
}

/// Moves the items that are on the left to the front and counts them.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let (mut low, mut high) = (0, items.len());
    while low < high {
        if is_left(&items[low]) {
            low += 1;
        } else {
            high -= 1;
            items.swap(low, high);
        }
    }
    low
}
