//! Builds a [`LightTree`]: eight groups a node, made by splitting the worst of
//! them in two until there are eight.
//!
//! The cost of a group is power · size² · M with M the measure of the
//! directions it shines into (Conty Estevez & Kulla 2018, section 4.4): split
//! at the plane of sixteen bins an axis that leaves the least sum. The spread
//! of the normals in a bin is judged by the mean of their vectors: in a cap of
//! half angle θ it is (1 + cos θ)/2 long. Bounds in the tree are exact, the
//! estimate only steers the splits.

use super::tree::{BOTH_SIDES, LEAF, Leaf, LightTree, Node, WIDTH};
use super::{Emitter, Extent};
use crate::math::{Bounds, Vec3};
use crate::shape::PrimId;

const BINS: usize = 16;
/// From this level on groups are halved by count: the trail of a leaf has 63
/// bits, three a level, and 2³⁹ leaves fit into the levels that are left.
const HALVING_LEVEL: u32 = 8;

pub(super) struct Builder<'a> {
    emitters: &'a [Emitter],
    /// Powers with sampling weights, largest 1.
    powers: Vec<f32>,
    origin: Vec3,
    unit: f32,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// The emitter of each leaf.
    leaf_items: Vec<u32>,
}

/// What many emitters sum up to.
#[derive(Clone, Copy)]
struct Sum {
    bounds: Bounds,
    power: f32,
    /// Σ power · axis · (mean length of the normals around it).
    direction: Vec3,
}

impl Sum {
    const NONE: Sum = Sum { bounds: Bounds::EMPTY, power: 0.0, direction: Vec3::ZERO };

    fn with(self, other: &Sum) -> Sum {
        Sum {
            bounds: self.bounds.union(other.bounds),
            power: self.power + other.power,
            direction: self.direction + other.direction,
        }
    }

    fn cost(&self) -> f32 {
        if self.power == 0.0 {
            return 0.0;
        }
        let cos = (2.0 * self.direction.length() / self.power - 1.0).clamp(-1.0, 1.0);
        self.power * directions(cos) * self.bounds.extent().length_squared()
    }
}

/// Measure of the directions within a right angle of a cap of normals of half
/// angle θ, weighed by the cosine beyond the cap.
fn directions(cos: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, PI, TAU};
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let theta = sin.atan2(cos);
    let end = (theta + FRAC_PI_2).min(PI);
    TAU * (1.0 - cos) + FRAC_PI_2 * (2.0 * end * sin - (theta - 2.0 * end).cos() - 2.0 * theta * sin + cos)
}

impl<'a> Builder<'a> {
    pub fn build(emitters: &'a [Emitter], weight: &[f64]) -> Option<LightTree> {
        let power = |e: &Emitter| e.extent.power * weight[e.light as usize];
        let largest = emitters.iter().map(power).fold(0.0, f64::max);
        if !(largest > 0.0) || !largest.is_finite() {
            return None;
        }
        // What f32 cannot hold still counts: a light of weight is never lost.
        let relative = |e: &Emitter| match power(e) {
            p if p > 0.0 => ((p / largest) as f32).max(1e-30),
            _ => 0.0,
        };
        let bounds = emitters.iter().map(|e| e.extent.bounds).fold(Bounds::EMPTY, Bounds::union);
        let (origin, radius) = bounds.bounding_sphere();
        // A power of two near the size of it all.
        let size = if radius > 0.0 { radius } else { origin.length() };
        let unit = if size > 0.0 { size.log2().floor().clamp(-120.0, 120.0).exp2().recip() } else { 1.0 };
        let mut builder = Builder {
            emitters,
            powers: emitters.iter().map(relative).collect(),
            origin,
            unit,
            nodes: Vec::new(),
            leaves: Vec::new(),
            leaf_items: Vec::new(),
        };
        let mut items: Vec<u32> =
            (0..emitters.len() as u32).filter(|i| builder.powers[*i as usize] > 0.0).collect();
        builder.leaves.reserve(items.len());
        builder.node(&mut items, 0, 0);
        Some(builder.finish(weight.len()))
    }

    fn finish(self, light_count: usize) -> LightTree {
        // Where the leaves of each light are: emitters of a light follow each other.
        let mut lights = vec![(PrimId::MAX, 0); light_count];
        let mut leaf_of: Vec<u32> = Vec::with_capacity(self.emitters.len());
        let mut last = None;
        for emitter in self.emitters {
            let slot = &mut lights[emitter.light as usize];
            if last != Some(emitter.light) {
                *slot = (emitter.prim, leaf_of.len() as u32);
                last = Some(emitter.light);
            }
            leaf_of.resize((slot.1 + (emitter.prim - slot.0) + emitter.prims) as usize, u32::MAX);
        }
        for (leaf, item) in self.leaf_items.iter().enumerate() {
            let Emitter { light, prim, prims, .. } = self.emitters[*item as usize];
            let (first_prim, first) = lights[light as usize];
            let start = (first + (prim - first_prim)) as usize;
            leaf_of[start..start + prims as usize].fill(leaf as u32);
        }
        let both_sides = self.leaf_items.iter().any(|i| self.emitters[*i as usize].extent.both_sides);
        let Builder { nodes, leaves, origin, unit, .. } = self;
        LightTree { nodes, leaves, lights, leaf_of, origin, unit, both_sides }
    }

    /// Makes the node of `items`, which is reached by `trail`.
    fn node(&mut self, items: &mut [u32], level: u32, trail: u64) -> u32 {
        let index = self.nodes.len();
        self.nodes.push(Node::default());
        for (slot, group) in self.groups(items, level).into_iter().enumerate() {
            self.bound(index, slot, group);
            let trail = trail | (slot as u64) << (3 * level);
            let child = if let [item] = group {
                let Emitter { light, prim, .. } = self.emitters[*item as usize];
                self.leaves.push(Leaf { trail: trail | 1 << (3 * (level + 1)), light, prim });
                self.leaf_items.push(*item);
                LEAF | (self.leaves.len() as u32 - 1)
            } else {
                self.node(group, level + 1, trail)
            };
            self.nodes[index].child[slot] = child;
            self.nodes[index].count = slot as u32 + 1;
        }
        index as u32
    }

    /// At most eight groups of the items, none empty.
    fn groups<'i>(&self, items: &'i mut [u32], level: u32) -> Vec<&'i mut [u32]> {
        let mut groups = vec![(self.sum(items).cost(), items)];
        while groups.len() < WIDTH {
            // The worst that can be split; of equals the largest.
            let splittable = groups.iter().enumerate().filter(|(_, (_, g))| g.len() > 1);
            let halving = level >= HALVING_LEVEL;
            let worst = splittable.max_by(|(_, (a, x)), (_, (b, y))| {
                let by_cost = if halving { std::cmp::Ordering::Equal } else { a.total_cmp(b) };
                by_cost.then(x.len().cmp(&y.len()))
            });
            let Some((worst, _)) = worst else { break };
            let (_, group) = groups.swap_remove(worst);
            let middle = if halving { self.halve(group) } else { self.split(group) };
            let (left, right) = group.split_at_mut(middle);
            groups.push((self.sum(left).cost(), left));
            groups.push((self.sum(right).cost(), right));
        }
        groups.into_iter().map(|(_, group)| group).collect()
    }

    fn centre(&self, item: u32) -> Vec3 {
        self.emitters[item as usize].extent.bounds.centre()
    }

    fn sum_of(&self, item: u32) -> Sum {
        let Extent { bounds, axis, spread, .. } = self.emitters[item as usize].extent;
        let power = self.powers[item as usize];
        Sum { bounds, power, direction: axis * (power * 0.5 * (1.0 + spread.cos())) }
    }

    fn sum(&self, items: &[u32]) -> Sum {
        items.iter().fold(Sum::NONE, |sum, i| sum.with(&self.sum_of(*i)))
    }

    /// Parts the items in two at the best plane and says where, in 1 .. len.
    fn split(&self, items: &mut [u32]) -> usize {
        let centres = Bounds::of_points(items.iter().map(|i| self.centre(*i)));
        let extent = centres.extent();
        let bin = |c: Vec3, axis: usize| {
            (((c[axis] - centres.min[axis]) / extent[axis] * BINS as f32) as usize).min(BINS - 1)
        };
        let mut bins = [[Sum::NONE; BINS]; 3];
        for item in &*items {
            let (sum, centre) = (self.sum_of(*item), self.centre(*item));
            for (axis, bins) in bins.iter_mut().enumerate().filter(|(a, _)| extent[*a] > 0.0) {
                let bin = &mut bins[bin(centre, axis)];
                *bin = bin.with(&sum);
            }
        }
        let mut best = (f32::INFINITY, 0, 0);
        for (axis, bins) in bins.iter().enumerate().filter(|(a, _)| extent[*a] > 0.0) {
            // Splitting a thin side makes thinner ones.
            let shape = extent.max_element() / extent[axis];
            let mut above = [Sum::NONE; BINS + 1];
            for k in (0..BINS).rev() {
                above[k] = above[k + 1].with(&bins[k]);
            }
            let mut below = Sum::NONE;
            for k in 1..BINS {
                below = below.with(&bins[k - 1]);
                let cost = shape * (below.cost() + above[k].cost());
                if below.power > 0.0 && above[k].power > 0.0 && cost < best.0 {
                    best = (cost, axis, k);
                }
            }
        }
        let (cost, axis, plane) = best;
        if cost == f32::INFINITY {
            return self.halve(items);
        }
        let middle = partition(items, |i| bin(self.centre(i), axis) < plane);
        if middle == 0 || middle == items.len() { self.halve(items) } else { middle }
    }

    /// Two halves by count along the longest side.
    fn halve(&self, items: &mut [u32]) -> usize {
        let extent = Bounds::of_points(items.iter().map(|i| self.centre(*i))).extent();
        let axis = (0..3).max_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
        let middle = items.len() / 2;
        items.select_nth_unstable_by(middle, |a, b| {
            self.centre(*a)[axis].total_cmp(&self.centre(*b)[axis]).then(a.cmp(b))
        });
        middle
    }

    /// Writes what bounds a group into a slot of a node.
    fn bound(&mut self, node: usize, slot: usize, group: &[u32]) {
        let sum = self.sum(group);
        let centre = sum.bounds.centre();
        let extents = || group.iter().map(|i| &self.emitters[*i as usize].extent);
        let farthest = extents().map(|e| e.bounds.centre().distance(centre) + e.radius).fold(0.0, f32::max);
        // A millionth more than rounding takes away.
        let radius = farthest.min(sum.bounds.bounding_sphere().1.max(0.0)) * (1.0 + 1e-6) * self.unit;
        let axis = if let [one] = group {
            self.emitters[*one as usize].extent.axis
        } else {
            sum.direction.normalize_or(Vec3::Z)
        };
        // Of both sides the one nearer to the axis counts.
        let angle = |e: &Extent| match crate::math::angle_between(e.axis, axis) {
            angle if e.both_sides => angle.min(std::f32::consts::PI - angle),
            angle => angle,
        };
        let spread = extents().map(|e| angle(e) + e.spread).fold(0.0, f32::max).min(std::f32::consts::PI);
        let falloff = extents().map(|e| e.falloff).fold(0.0, f32::max);
        let p = (centre - self.origin) * self.unit;
        let (half, slot) = (&mut self.nodes[node].halves[slot / 4], slot % 4);
        (half.x[slot], half.y[slot], half.z[slot]) = (p.x, p.y, p.z);
        half.radius2[slot] = radius * radius;
        (half.axis_x[slot], half.axis_y[slot], half.axis_z[slot]) = (axis.x, axis.y, axis.z);
        (half.sin_spread[slot], half.cos_spread[slot]) = spread.sin_cos();
        let both_sides = extents().any(|e| e.both_sides);
        half.cos_falloff[slot] = if both_sides { BOTH_SIDES } else { falloff.cos().max(0.0) };
        half.power[slot] = sum.power;
    }
}

/// Moves the items that pass to the front and says how many they are.
fn partition(items: &mut [u32], pass: impl Fn(u32) -> bool) -> usize {
    let mut front = 0;
    for i in 0..items.len() {
        if pass(items[i]) {
            items.swap(front, i);
            front += 1;
        }
    }
    front
}
