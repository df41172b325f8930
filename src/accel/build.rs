//! Builds a binary tree of boxes by the binned surface area heuristic (Wald
//! 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies").
//!
//! The tree depends on nothing but the boxes: a split between items m - 1 and
//! m puts its two nodes into slots 2m and 2m + 1, so that threads write to
//! parts of one array that are fixed beforehand; bins are summed in parallel
//! by operations that are exact and associative. Areas are taken relative to
//! a power of two close to the size of the node, so a scene scaled by a power
//! of two gives the same tree.

use glam::Vec4;
use rayon::prelude::*;

use crate::math::{Bounds, Vec3};
use crate::shape::Geometry;

/// Below this depth halves are split in the middle, which bounds the depth of
/// any tree by [`MAX_DEPTH`].
const MEDIAN_DEPTH: usize = 48;
/// No tree is deeper: 2³² primitives halve 32 times.
pub const MAX_DEPTH: usize = MEDIAN_DEPTH + 33;
/// The most bins of an axis.
const BINS: usize = 16;
/// Sizes from which work is shared between threads.
const PARALLEL_BUILD: usize = 4096;
const PARALLEL_BINS: usize = 1 << 16;

/// Four-component boxes: the fourth component of the lower corner of an item
/// carries its primitive and is otherwise of no meaning.
#[derive(Clone, Copy, Debug)]
pub struct Box4 {
    pub min: Vec4,
    pub max: Vec4,
}

impl Box4 {
    pub const EMPTY: Box4 = Box4 { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub fn union(self, other: Box4) -> Box4 {
        Box4 { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline(always)]
    fn grow(self, p: Vec4) -> Box4 {
        Box4 { min: self.min.min(p), max: self.max.max(p) }
    }

    /// Half the area after scaling.
    #[inline(always)]
    pub fn half_area(self, scale: f32) -> f32 {
        let d = ((self.max - self.min) * scale).to_array();
        d[0] * d[1] + d[1] * d[2] + d[2] * d[0]
    }

    /// As a plain box.
    pub fn bounds(self) -> Bounds {
        Bounds { min: self.min.truncate(), max: self.max.truncate() }
    }
}

/// A primitive to be put into the tree.
#[derive(Clone, Copy, Debug)]
pub struct Item(Box4);

impl Item {
    /// Makes a float that is no subnormal, which would be slow to add, of every
    /// id below 2^29.
    const NORMAL: u32 = 0x4000_0000;

    /// A primitive, whose id is below 2^29, and its box.
    #[inline]
    pub fn new(bounds: Bounds, prim: u32) -> Item {
        Item(Box4 {
            min: bounds.min.extend(f32::from_bits(prim | Item::NORMAL)),
            max: bounds.max.extend(0.0),
        })
    }

    /// The primitive.
    #[inline(always)]
    pub fn prim(&self) -> u32 {
        self.0.min.w.to_bits() ^ Item::NORMAL
    }

    /// Its box.
    #[cfg_attr(not(feature = "embree"), allow(dead_code, reason = "Embree wants to know"))]
    pub fn bounds(&self) -> Bounds {
        self.0.bounds()
    }

    /// Twice its centre.
    #[inline(always)]
    fn centre(&self) -> Vec4 {
        self.0.min + self.0.max
    }
}

/// A node of the tree, whatever the layout it will be stored in. A leaf holds
/// the items `first .. first + count`; an inner node has the count 0 and its
/// children in the slots `first` and `first + 1`.
#[derive(Clone, Copy, Debug)]
pub struct TreeNode {
    pub min: Vec3,
    pub first: u32,
    pub max: Vec3,
    pub count: u32,
}

impl TreeNode {
    const UNUSED: TreeNode = TreeNode { min: Vec3::INFINITY, first: 0, max: Vec3::NEG_INFINITY, count: 0 };

    #[inline(always)]
    pub fn bounds(&self) -> Bounds {
        Bounds { min: self.min, max: self.max }
    }

    #[inline(always)]
    pub fn is_leaf(&self) -> bool {
        self.count != 0
    }
}

/// A binary tree over items that have been sorted into the order of its leaves.
#[derive(Clone, Debug)]
pub struct Tree {
    /// The root is in slot 0; slot 1 and others may be unused. Empty when there
    /// are no items.
    pub nodes: Vec<TreeNode>,
}

impl Tree {
    /// The same tree without unused slots, each pair of children after its
    /// parent, depth first. Slot 1 stays unused, so that pairs begin at even
    /// slots.
    pub fn compact(&self) -> Tree {
        let Some(root) = self.nodes.first() else { return self.clone() };
        let mut nodes = Vec::with_capacity(self.nodes.len());
        nodes.extend([*root, TreeNode::UNUSED]);
        let mut stack = vec![0usize];
        while let Some(at) = stack.pop() {
            if nodes[at].is_leaf() {
                continue;
            }
            let first = nodes[at].first as usize;
            let pair = nodes.len();
            nodes[at].first = pair as u32;
            nodes.extend_from_slice(&self.nodes[first..first + 2]);
            stack.extend([pair + 1, pair]);
        }
        Tree { nodes }
    }
}

/// What a builder weighs.
#[derive(Clone, Copy, Debug)]
pub struct Costs {
    /// Cost of visiting a node, in leaf blocks.
    pub node: f32,
    /// Binary logarithm of the number of primitives that are tested at once.
    pub block_log: u32,
    /// The most primitives of a leaf.
    pub leaf: usize,
    /// A leaf of at most this many is made without asking for its cost.
    pub small: usize,
    /// Primitives that are tested one by one: no leaf is made of several when one
    /// is among them.
    pub singles: Singles,
}

/// Primitives that are tested one by one.
#[derive(Clone, Copy, Debug)]
pub struct Singles {
    first: u32,
    /// Those from `first` on that are not: the ends of their ids.
    but: [u32; 2],
}

impl Singles {
    /// No primitive.
    pub const NONE: Singles = Singles { first: u32::MAX, but: [u32::MAX; 2] };

    /// All but triangles, still or deforming.
    pub fn of(geometry: &Geometry) -> Singles {
        let deforming = geometry.deforming();
        Singles { first: geometry.triangle_count(), but: [deforming.start, deforming.end] }
    }

    #[inline(always)]
    pub fn has(self, prim: u32) -> bool {
        prim >= self.first && !(self.but[0] <= prim && prim < self.but[1])
    }
}

impl Costs {
    /// Blocks of so many primitives.
    #[inline(always)]
    fn blocks(&self, count: u32) -> f32 {
        ((count + (1 << self.block_log) - 1) >> self.block_log) as f32
    }

    /// Whether these items may be a leaf.
    #[inline(always)]
    fn fit(&self, items: &[Item]) -> bool {
        items.len() <= self.leaf
            && (items.len() == 1 || !items.iter().any(|item| self.singles.has(item.prim())))
    }
}

/// Sorts the items into the order of the leaves and gives the tree.
pub fn build(items: &mut [Item], costs: Costs) -> Tree {
    if items.is_empty() {
        return Tree { nodes: Vec::new() };
    }
    let mut nodes = vec![TreeNode::UNUSED; 2 * items.len()];
    let (geometry, centres) = all_bounds(items);
    let part = Part { geometry, centres, first: 0, depth: 0 };
    let (root, rest) = nodes.split_at_mut(2);
    let mut bins = NO_BINS;
    root[0] = subtree(&part, items, rest, costs, &mut bins);
    Tree { nodes }
}

/// A range of items with the box of them and of twice their centres.
#[derive(Clone, Copy, Debug)]
struct Part {
    geometry: Box4,
    centres: Box4,
    first: u32,
    depth: usize,
}

fn subtree(
    part: &Part,
    items: &mut [Item],
    slots: &mut [TreeNode],
    costs: Costs,
    bins: &mut Bins,
) -> TreeNode {
    let Bounds { min, max } = part.geometry.bounds();
    let count = items.len();
    let Some((middle, parts)) = split(part, items, costs, bins) else {
        return TreeNode { min, max, first: part.first, count: count as u32 };
    };
    let (left, right) = items.split_at_mut(middle);
    let (left_slots, rest) = slots.split_at_mut(2 * middle - 2);
    let (own, right_slots) = rest.split_at_mut(2);
    let children = if count >= PARALLEL_BUILD {
        let mut own_bins = NO_BINS;
        rayon::join(
            || subtree(&parts[0], left, left_slots, costs, bins),
            || subtree(&parts[1], right, right_slots, costs, &mut own_bins),
        )
    } else {
        let left = subtree(&parts[0], left, left_slots, costs, bins);
        (left, subtree(&parts[1], right, right_slots, costs, bins))
    };
    own.copy_from_slice(&[children.0, children.1]);
    TreeNode { min, max, first: 2 * (part.first + middle as u32), count: 0 }
}

/// Boxes of all items and of twice their centres.
fn all_bounds(items: &[Item]) -> (Box4, Box4) {
    let one = |items: &[Item]| {
        items.iter().fold((Box4::EMPTY, Box4::EMPTY), |(geometry, centres), item| {
            (geometry.union(item.0), centres.grow(item.centre()))
        })
    };
    items
        .par_chunks(PARALLEL_BINS / 4)
        .map(one)
        .reduce(|| (Box4::EMPTY, Box4::EMPTY), |a, b| (a.0.union(b.0), a.1.union(b.1)))
}

/// Puts the items into two parts and gives the size of the first and both;
/// `None` when they are better off as a leaf.
fn split(part: &Part, items: &mut [Item], costs: Costs, bins: &mut Bins) -> Option<(usize, [Part; 2])> {
    let count = items.len();
    let fit = costs.fit(items);
    if fit && count <= costs.small {
        return None;
    }
    if part.depth < MEDIAN_DEPTH
        && let Some(binning) = Binning::new(part, count)
        && let Some(plane) = binning.best_plane(items, costs, bins)
    {
        if fit && plane.saving <= 0.0 {
            return None;
        }
        return Some(partition(part, items, &binning, &plane));
    }
    if fit { None } else { Some(halve(part, items)) }
}

/// All centres coincide, or the tree is too deep: halves along the longest
/// axis of the centres.
fn halve(part: &Part, items: &mut [Item]) -> (usize, [Part; 2]) {
    let extent = part.centres.bounds().extent();
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.centre()[axis].total_cmp(&b.centre()[axis]).then(a.prim().cmp(&b.prim()))
    });
    let (left, right) = items.split_at(middle);
    let make = |items: &[Item], first: u32| {
        let (geometry, centres) = all_bounds(items);
        Part { geometry, centres, first, depth: part.depth + 1 }
    };
    (middle, [make(left, part.first), make(right, part.first + middle as u32)])
}

/// How centres become bins.
#[derive(Clone, Copy, Debug)]
struct Binning {
    low: Vec4,
    scale: Vec4,
    bins: usize,
    /// What areas are multiplied by, per length.
    area_scale: f32,
    area: f32,
}

/// A plane between bins: those up to `last` are on its left.
#[derive(Clone, Copy, Debug)]
struct Plane {
    axis: usize,
    last: u32,
    /// What is saved compared with a leaf.
    saving: f32,
    boxes: [Box4; 2],
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    bounds: Box4,
    count: u32,
}

const NO_BIN: Bin = Bin { bounds: Box4::EMPTY, count: 0 };

impl Bin {
    #[inline(always)]
    fn join(self, other: Bin) -> Bin {
        Bin { bounds: self.bounds.union(other.bounds), count: self.count + other.count }
    }
}

/// Bins of all three axes.
type Bins = [[Bin; 3]; BINS];

const NO_BINS: Bins = [[NO_BIN; 3]; BINS];

impl Binning {
    /// `None` when centres coincide or are beyond the range of f32.
    fn new(part: &Part, count: usize) -> Option<Binning> {
        // Just below the number of bins, so that rounding cannot reach the next.
        let bins = (4 + count / 8).min(BINS);
        let width = bins as f32 * (1.0 - 1e-6);
        let extent = part.centres.bounds().extent();
        let scale = |x: f32| if x > 0.0 && (width / x).is_finite() { width / x } else { 0.0 };
        let scales = Vec4::new(scale(extent.x), scale(extent.y), scale(extent.z), 0.0);
        let size = part.geometry.bounds().extent().max_element();
        if scales == Vec4::ZERO || !extent.is_finite() || !size.is_finite() {
            return None;
        }
        // 1 / size, rounded to a power of two by dropping the mantissa.
        let area_scale = f32::from_bits((1.0 / size).to_bits() & 0x7f80_0000);
        let area = part.geometry.half_area(area_scale);
        (area > 0.0 && area.is_finite()).then_some(Binning {
            low: part.centres.min,
            scale: scales,
            bins,
            area_scale,
            area,
        })
    }

    /// The bin of an item along each axis; the fourth is of no meaning.
    #[inline(always)]
    fn bins_of(&self, item: &Item) -> [u32; 4] {
        // Adding 1.5·2^23 leaves the rounded integer in the low bits.
        let place = (item.centre() - self.low) * self.scale + Vec4::splat(-0.5) + Vec4::splat(12_582_912.0);
        place.to_array().map(|x| x.to_bits() & (BINS as u32 - 1))
    }

    fn fill(&self, items: &[Item], bins: &mut Bins) {
        for bin in bins[..self.bins].as_flattened_mut() {
            *bin = NO_BIN;
        }
        for item in items {
            let index = self.bins_of(item);
            for axis in 0..3 {
                let bin = &mut bins[index[axis] as usize][axis];
                bin.bounds = bin.bounds.union(item.0);
                bin.count += 1;
            }
        }
    }

    fn fill_all(&self, items: &[Item], bins: &mut Bins) {
        if items.len() < PARALLEL_BINS {
            return self.fill(items, bins);
        }
        let one = |chunk| {
            let mut bins = NO_BINS;
            self.fill(chunk, &mut bins);
            bins
        };
        let join = |mut a: Bins, b: Bins| {
            a.as_flattened_mut().iter_mut().zip(b.as_flattened()).for_each(|(a, b)| *a = a.join(*b));
            a
        };
        *bins = items.par_chunks(PARALLEL_BINS / 4).map(one).reduce(|| NO_BINS, join);
    }

    /// The cheapest plane over all axes, the first one among equals.
    fn best_plane(&self, items: &[Item], costs: Costs, bins: &mut Bins) -> Option<Plane> {
        self.fill_all(items, bins);
        let count = items.len() as u32;
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in (0..3).filter(|axis| self.scale[*axis] > 0.0) {
            // Weights of everything right of each plane, then sweep from the left.
            let mut right = [0.0; BINS];
            let mut sum = NO_BIN;
            for i in (1..self.bins).rev() {
                sum = sum.join(bins[i][axis]);
                right[i - 1] = self.weight(&sum, costs);
            }
            let mut left = NO_BIN;
            for last in 0..self.bins - 1 {
                left = left.join(bins[last][axis]);
                if left.count == 0 || left.count == count {
                    continue;
                }
                let weight = self.weight(&left, costs) + right[last];
                if best.is_none_or(|b| weight < b.0) {
                    best = Some((weight, axis, last));
                }
            }
        }
        let (weight, axis, last) = best?;
        let over = |range: std::ops::Range<usize>| {
            bins[range].iter().fold(NO_BIN, |sum, bin| sum.join(bin[axis])).bounds
        };
        let boxes = [over(0..last + 1), over(last + 1..self.bins)];
        let saving = (costs.blocks(count) - costs.node) * self.area - weight;
        Some(Plane { axis, last: last as u32, saving, boxes })
    }

    /// Area times blocks: what the heuristic sums. Zero when empty.
    #[inline(always)]
    fn weight(&self, bin: &Bin, costs: Costs) -> f32 {
        if bin.count == 0 {
            return 0.0;
        }
        bin.bounds.half_area(self.area_scale) * costs.blocks(bin.count)
    }
}

/// Moves the items that are on the left to the front.
fn partition(part: &Part, items: &mut [Item], binning: &Binning, plane: &Plane) -> (usize, [Part; 2]) {
    let mut centres = [Box4::EMPTY; 2];
    let mut middle = 0;
    for i in 0..items.len() {
        let item = items[i];
        let is_right = binning.bins_of(&item)[plane.axis] > plane.last;
        let side = &mut centres[usize::from(is_right)];
        *side = side.grow(item.centre());
        items[i] = items[middle];
        items[middle] = item;
        middle += usize::from(!is_right);
    }
    let make = |side: usize, first: u32| Part {
        geometry: plane.boxes[side],
        centres: centres[side],
        first,
        depth: part.depth + 1,
    };
    (middle, [make(0, part.first), make(1, part.first + middle as u32)])
}
