//! Makes a wide tree of a binary one.
//!
//! Optimally (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal
//! on GPUs Through Compressed Wide BVHs", section 3.1): with C(n, i) the least
//! cost of the subtree n as a forest of at most i wide nodes and leaves, and
//! A(n) its area,
//!
//! D(n, i) = min over k of C(left, k) + C(right, i - k),
//! C(n, 1) = min(A(n) · node + D(n, 8), A(n) · leaf(n) if it fits into one),
//! C(n, i) = min(C(n, i - 1), D(n, i)).

use super::build::{Item, Singles, Tree, TreeNode};
use super::ground::Slice;
use super::simd8::WideTest;
use super::simd8_arena::Arena;
use super::wide::{Block, LANES, Link, Node8, WIDTH};
use crate::math::{Bounds, Vec3, gamma};
use crate::shape::Geometry;

/// A wide tree. Inner children of a node follow each other, and their blocks
/// follow them.
#[derive(Clone, Debug, Default)]
pub struct Wide {
    pub arena: Arena,
    pub root: Option<Link>,
    /// Blocks of deforming triangles have those of the key before the slice in them, and
    /// behind them a block of those of the key after it.
    keyed: bool,
}

/// Bytes per primitive that are more than enough for most trees.
const ROOM: usize = 96;

/// Collapses a binary tree whose leaves are sorted items, and whose children
/// come after their parents. `price` is the cost of a node in leaves. The boxes of
/// what deforms move along during the `slice`.
pub fn collapse(geometry: &Geometry, (items, slice): (&[Item], Slice), tree: &Tree, price: f32) -> Wide {
    let ends = slice.deforms(geometry).then(|| ends(geometry, items, slice, tree));
    let plan = Plan::new(tree, items, Singles::of(geometry), price);
    let keyed = ends.is_some() && geometry.goes_straight(slice.part, slice.times);
    let room = ROOM * items.len() * if ends.is_some() { 2 } else { 1 };
    let mut wide = Wide { arena: Arena::with_room(room, ends.is_some()), root: None, keyed };
    let source = Source { geometry, items, slice, tree, plan, ends };
    wide.root = (!tree.nodes.is_empty()).then(|| {
        if source.plan.is_leaf(0) {
            return wide.add_leaf(&source, 0);
        }
        let root = wide.arena.add_nodes(1);
        wide.fill(&source, 0, root);
        Link::node(root)
    });
    wide.arena.settle();
    wide
}

/// What is collapsed.
struct Source<'a> {
    geometry: &'a Geometry,
    items: &'a [Item],
    slice: Slice,
    tree: &'a Tree,
    plan: Plan,
    /// The boxes of the nodes when the slice begins and ends, if they move.
    ends: Option<Vec<[Bounds; 2]>>,
}

/// The boxes of all nodes at both ends of a slice of the shutter, such that what lies on
/// the straight way between them holds the boxes of the primitives below at all times:
/// their vertices go straight from key to key, and both ends are moved outward by what is
/// missing at the keys between.
fn ends(geometry: &Geometry, items: &[Item], slice: Slice, tree: &Tree) -> Vec<[Bounds; 2]> {
    let at = |time: f32| {
        let mut boxes = vec![Bounds::EMPTY; tree.nodes.len()];
        for (i, node) in tree.nodes.iter().enumerate().rev() {
            boxes[i] = if node.is_leaf() {
                let items = &items[node.first as usize..][..node.count as usize];
                let boxed = |item: &Item| geometry.prim_bounds_during(item.prim(), [time; 2]);
                items.iter().map(boxed).fold(Bounds::EMPTY, Bounds::union)
            } else if node.first == 0 {
                continue; // Slot 1 is unused.
            } else {
                boxes[node.first as usize].union(boxes[node.first as usize + 1])
            };
        }
        boxes
    };
    let [start, end] = slice.times;
    let mut ends: Vec<[Bounds; 2]> = at(start).into_iter().zip(at(end)).map(|(a, b)| [a, b]).collect();
    for key in geometry.key_times(slice.part).into_iter().filter(|key| start < *key && *key < end) {
        let share = (key - start) / (end - start);
        for ([a, b], needed) in ends.iter_mut().zip(at(key)) {
            let low = (a.min.lerp(b.min, share) - needed.min).max(Vec3::ZERO);
            let high = (needed.max - a.max.lerp(b.max, share)).max(Vec3::ZERO);
            for bounds in [a, b] {
                *bounds = Bounds { min: bounds.min - low, max: bounds.max + high };
            }
        }
    }
    // Roundings of the vertices on their way, and of the planes on theirs; and a wall may
    // be flat at the ends only.
    let size = |bounds: &Bounds| bounds.min.abs().max(bounds.max.abs()).max_element();
    for [a, b] in &mut ends {
        let e = Vec3::splat(size(a).max(size(b)) * gamma(32));
        for bounds in [a, b] {
            *bounds = Bounds { min: bounds.min - e, max: bounds.max + e };
        }
    }
    ends
}

impl Source<'_> {
    fn node(&self, node: u32) -> &TreeNode {
        &self.tree.nodes[node as usize]
    }

    /// The wide children of a node that is no leaf.
    fn children(&self, node: u32) -> Children {
        let mut children = Children { nodes: [0; WIDTH], count: 0 };
        self.plan.split(self.tree, node, WIDTH, &mut children);
        children
    }

    /// The primitives below a node that becomes a leaf, by id, which also puts
    /// triangles before analytic primitives; and how many there are.
    fn primitives(&self, node: u32) -> ([u32; LANES], usize) {
        let (mut prims, mut count) = ([Block::NONE; LANES], 0);
        let mut stack = vec![node];
        while let Some(node) = stack.pop() {
            let node = self.node(node);
            if !node.is_leaf() {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for item in &self.items[node.first as usize..][..node.count as usize] {
                prims[count] = item.prim();
                count += 1;
            }
        }
        prims.sort_unstable();
        (prims, count)
    }
}

/// Children of a wide node.
struct Children {
    nodes: [u32; WIDTH],
    count: usize,
}

impl Children {
    fn push(&mut self, node: u32) {
        self.nodes[self.count] = node;
        self.count += 1;
    }
}

impl Wide {
    /// Visits all nodes, parents before children, with what `visit` has given
    /// for the parent.
    pub fn for_each_node<T: Copy>(&self, first: T, mut visit: impl FnMut(&Node8, T) -> T) {
        let mut stack: Vec<(Link, T)> =
            self.root.into_iter().filter(|root| !root.is_leaf()).map(|root| (root, first)).collect();
        while let Some((link, above)) = stack.pop() {
            let node = self.arena.node(link);
            let value = visit(node, above);
            let inner = node.lanes().map(|lane| node.children[lane]).filter(|child| !child.is_leaf());
            stack.extend(inner.map(|child| (child, value)));
        }
    }

    /// Whether a stack of this size is enough: a visit leaves all children but
    /// one on it, and writes eight entries at once.
    pub fn fits(&self, stack: usize) -> bool {
        let mut most = 0;
        self.for_each_node(0, |node, waiting: usize| {
            let waiting = waiting + node.lanes().count().saturating_sub(1);
            most = most.max(waiting);
            waiting
        });
        most + WIDTH <= stack
    }

    fn add_leaf(&mut self, source: &Source<'_>, node: u32) -> Link {
        let (prims, count) = source.primitives(node);
        let triangles = prims.iter().filter(|prim| **prim < source.geometry.triangle_count()).count();
        let mut block = Block::new(source.geometry, &prims[..count]);
        let mut after = Block::EMPTY;
        if self.keyed {
            let start = source.slice.times[0];
            source.geometry.keys_around(&prims[..count], start, |lane, deformation, [a, b]| {
                block.put(lane, &a);
                after.put(lane, &b);
                after.prims[lane] = deformation;
            });
        }
        let at = self.arena.add_block(&block);
        if self.keyed {
            self.arena.add_block(&after);
        }
        Link::block(at, triangles, triangles < count)
    }

    /// A leaf of a tree whose boxes move: its triangles, still and deforming, as they are
    /// at a time of the slice, and one bit for each.
    #[inline(always)]
    pub fn block_at<T: WideTest>(&self, test: T, geometry: &Geometry, link: Link, time: f32) -> (Block, u32) {
        let block = self.arena.block(link);
        let still = link.triangle_mask();
        if !link.has_analytic() {
            return (*block, still);
        }
        let mut mask = still;
        if !self.keyed {
            let mut now = *block;
            geometry.deformed(&block.prims, time, |lane, vertices| {
                now.put(lane, &vertices);
                mask |= 1 << lane;
            });
            return (now, mask);
        }
        let after = self.arena.block_after(link);
        let mut weights = [0.0; LANES];
        let (mut last, mut weight) = (Block::NONE, 0.0);
        for (lane, (share, deformation)) in weights.iter_mut().zip(after.prims).enumerate() {
            if deformation != Block::NONE {
                if deformation != last {
                    (last, weight) = (deformation, geometry.key_weight(deformation, time));
                }
                *share = weight;
                mask |= 1 << lane;
            }
        }
        let mut now = test.between(block, after, &weights);
        // Not even the sign of a zero changes of what stands still.
        for lane in (0..LANES).filter(|lane| still >> lane & 1 != 0) {
            now.put(lane, &block.triangle(lane));
        }
        (now, mask)
    }

    fn fill(&mut self, source: &Source<'_>, node: u32, at: usize) {
        let children = source.children(node);
        let children = &children.nodes[..children.count];
        let inner = children.iter().filter(|child| !source.plan.is_leaf(**child));
        let first = self.arena.add_nodes(inner.clone().count());
        let mut next = first;
        for (lane, child) in children.iter().enumerate() {
            let link = if source.plan.is_leaf(*child) {
                self.add_leaf(source, *child)
            } else {
                next += self.arena.step();
                Link::node(next - self.arena.step())
            };
            match &source.ends {
                None => self.arena.node_mut(at).set(lane, &source.node(*child).bounds(), link),
                Some(ends) => {
                    let [start, end] = &ends[*child as usize];
                    self.arena.node_mut(at).set(lane, start, link);
                    self.arena.set_end(at, lane, end);
                }
            }
        }
        for (i, child) in inner.enumerate() {
            self.fill(source, *child, first + i * self.arena.step());
        }
    }
}

/// Primitives below a node.
#[derive(Clone, Copy, Debug, Default)]
struct Contents {
    triangles: u32,
    single: u32,
}

impl Contents {
    fn of(items: &[Item], singles: Singles) -> Contents {
        let single = items.iter().filter(|item| singles.has(item.prim())).count();
        Contents { triangles: (items.len() - single) as u32, single: single as u32 }
    }

    fn join(self, other: Contents) -> Contents {
        Contents {
            triangles: self.triangles.saturating_add(other.triangles),
            single: self.single.saturating_add(other.single),
        }
    }

    fn count(self) -> usize {
        self.triangles as usize + self.single as usize
    }

    /// Of a leaf, in tests of a block of triangles: a single primitive takes
    /// about as long as such a block.
    fn cost(self) -> f32 {
        self.single as f32 + if self.triangles > 0 { 1.0 } else { 0.0 }
    }
}

/// The costs C(n, 1) to C(n, 7) of every node, and which become leaves.
struct Plan {
    costs: Vec<[f32; WIDTH - 1]>,
    leaves: Vec<bool>,
}

impl Plan {
    /// For a tree whose children come after their parents. `price` is the cost
    /// of a node in blocks of triangles; `singles` are tested one by one.
    fn new(tree: &Tree, items: &[Item], singles: Singles, price: f32) -> Plan {
        let count = tree.nodes.len();
        let mut plan = Plan { costs: vec![[0.0; WIDTH - 1]; count], leaves: vec![false; count] };
        let size = tree.nodes.first().map_or(1.0, |root| root.bounds().extent().max_element());
        let scale = f32::from_bits((1.0 / size).to_bits() & 0x7f80_0000);
        let mut contents = vec![Contents::default(); count];
        for (i, node) in tree.nodes.iter().enumerate().rev() {
            let d = (node.max - node.min) * scale;
            // 3 at most, but for rounding; NaN beyond the range of f32.
            let area = d.x * d.y + d.y * d.z + d.z * d.x;
            let area = if area < 4.0 { area } else { 4.0 };
            if node.is_leaf() {
                let items = &items[node.first as usize..][..node.count as usize];
                contents[i] = Contents::of(items, singles);
                (plan.costs[i], plan.leaves[i]) = ([area * contents[i].cost(); WIDTH - 1], true);
                continue;
            }
            let pair = node.first as usize;
            if pair == 0 {
                continue; // Slot 1 is unused.
            }
            contents[i] = contents[pair].join(contents[pair + 1]);
            let as_node = area * price + plan.least(pair, WIDTH).0;
            let as_leaf = area * contents[i].cost();
            plan.leaves[i] = contents[i].count() <= LANES && as_leaf <= as_node;
            let mut costs = [if plan.leaves[i] { as_leaf } else { as_node }; WIDTH - 1];
            for roots in 2..WIDTH {
                costs[roots - 1] = costs[roots - 2].min(plan.least(pair, roots).0);
            }
            plan.costs[i] = costs;
        }
        plan
    }

    fn is_leaf(&self, node: u32) -> bool {
        self.leaves[node as usize]
    }

    /// D of the parent of a pair, and how many roots its first child gets.
    fn least(&self, pair: usize, roots: usize) -> (f32, usize) {
        let (left, right) = (&self.costs[pair], &self.costs[pair + 1]);
        (1..roots).fold((f32::INFINITY, 1), |best, k| {
            let cost = left[k - 1] + right[roots - k - 1];
            if cost < best.0 { (cost, k) } else { best }
        })
    }

    /// Lists the roots of the forest that a node is split into.
    fn split(&self, tree: &Tree, node: u32, roots: usize, children: &mut Children) {
        let pair = tree.nodes[node as usize].first;
        let left = self.least(pair as usize, roots).1;
        for (child, mut roots) in [(pair, left), (pair + 1, roots - left)] {
            let costs = &self.costs[child as usize];
            while roots > 1 && costs[roots - 2] <= costs[roots - 1] {
                roots -= 1;
            }
            if roots == 1 { children.push(child) } else { self.split(tree, child, roots, children) }
        }
    }
}
