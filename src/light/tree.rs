//! A tree over many lights, to choose one by what it may bring to a point.
//!
//! Conty Estevez & Kulla 2018, "Importance Sampling of Many Lights with
//! Adaptive Tree Splitting"; pbrt-v4 section 12.6.3. A child of power Φ in a
//! sphere of radius r at distance d is worth
//!
//!   I = Φ · cos θ' · cos θᵢ' / max(d², r²),
//!
//! θ' and θᵢ' being the least angles that any of its points can have with a
//! normal of the light and with that of the receiver; I = 0 where the emission
//! or the receiver ends before. A child is chosen with a probability
//! proportional to I + ε·Ī with Ī the mean of the children that have any: what
//! the bounds do not know (something in between, a texture, a glossy bsdf) can
//! then cost at most a factor of about 8/ε per level.
//!
//! A node has eight children in columns of four, which glam's SIMD vectors
//! evaluate at once. [`LightTree::sample`] and [`LightTree::pmf`] go down the
//! same path with the same arithmetic: their probabilities are equal bit for
//! bit. Lengths are in units of the tree (a power of two of the scene's), so no
//! square over- or underflows.

use glam::Vec4;
use smallvec::SmallVec;

use super::tree_build::Builder;
use super::{Emitter, Receiver};
use crate::math::Vec3;
use crate::shape::PrimId;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Instead of the cosine of a right angle, which is where emission ends then.
pub(super) const BOTH_SIDES: f32 = -1.0;
/// A child that is a leaf.
pub(super) const LEAF: u32 = 1 << 31;

/// Eight children. Empty ones have no power.
#[derive(Clone, Debug, Default)]
pub(super) struct Node {
    pub halves: [Half; 2],
    /// A node, or [`LEAF`] and a leaf.
    pub child: [u32; WIDTH],
    /// How many children there are.
    pub count: u32,
}

/// Four children in columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Half {
    pub x: Vec4,
    pub y: Vec4,
    pub z: Vec4,
    /// Square of the radius.
    pub radius2: Vec4,
    pub axis_x: Vec4,
    pub axis_y: Vec4,
    pub axis_z: Vec4,
    /// Of the spread of normals.
    pub cos_spread: Vec4,
    pub sin_spread: Vec4,
    /// Of the angle to a normal at which emission ends; [`BOTH_SIDES`] where
    /// there is something that shines around the opposite of its normals as well.
    pub cos_falloff: Vec4,
    pub power: Vec4,
}

/// One emitter in the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    /// The way to it: three bits a level, the root's lowest, and a 1 above.
    pub trail: u64,
    pub light: u32,
    pub prim: PrimId,
}

/// A receiver in units of the tree.
#[derive(Clone, Copy, Debug)]
struct Query {
    p: Vec3,
    n: Vec3,
    two_sided: bool,
    /// Of the tree.
    both_sides: bool,
}

/// A light tree. Immutable.
#[derive(Clone, Debug)]
pub struct LightTree {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
    /// For each light its first primitive, `PrimId::MAX` when it is not in the
    /// tree, and where its leaves begin in `leaf_of`.
    pub(super) lights: Vec<(PrimId, u32)>,
    /// Leaf of each primitive; `u32::MAX` for those without power.
    pub(super) leaf_of: Vec<u32>,
    /// What is subtracted from positions, and what they are then scaled by.
    pub(super) origin: Vec3,
    pub(super) unit: f32,
    /// Something in it shines on both sides.
    pub(super) both_sides: bool,
}

/// What [`LightTree::sample`] chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeSample {
    /// Index of the light.
    pub light: u32,
    /// The primitive of it, where it has any.
    pub prim: PrimId,
    /// Its probability, above 0.
    pub pmf: f32,
}

impl LightTree {
    /// A tree of emitters; those of weight or power 0 are never chosen. `weight`
    /// is each light's `sampling_weight`. `None` when nothing is left.
    #[must_use]
    pub fn new(emitters: &[Emitter], weight: &[f64]) -> Option<LightTree> {
        Builder::build(emitters, weight)
    }

    /// Draws of one receiver, which share what they find on the way down.
    #[must_use]
    pub fn walk(&self, receiver: &Receiver) -> TreeWalk<'_> {
        TreeWalk { tree: self, query: self.query(receiver), path: SmallVec::new() }
    }

    /// Chooses an emitter by a uniform `u` in [0, 1). `None` where nothing that
    /// shines on the receiver is found.
    #[must_use]
    pub fn sample(&self, receiver: &Receiver, u: f64) -> Option<TreeSample> {
        self.walk(receiver).sample(u)
    }

    /// The probability with which [`LightTree::sample`] chooses a primitive of
    /// a light; `prim` is 0 for lights that have none.
    #[must_use]
    pub fn pmf(&self, receiver: &Receiver, light: u32, prim: PrimId) -> f32 {
        let (first_prim, first) = self.lights[light as usize];
        if first_prim == PrimId::MAX {
            return 0.0;
        }
        let leaf = self.leaf_of.get((first + (prim - first_prim)) as usize).copied().unwrap_or(u32::MAX);
        let Some(leaf) = self.leaves.get(leaf as usize) else { return 0.0 };
        let query = self.query(receiver);
        let (mut node, mut pmf, mut trail) = (0, 1.0, leaf.trail);
        while trail > 1 {
            let slot = (trail % WIDTH as u64) as usize;
            let Some(chances) = self.nodes[node].chances(&query) else { return 0.0 };
            pmf *= f64::from(chances[slot]);
            node = self.nodes[node].child[slot] as usize;
            trail /= WIDTH as u64;
        }
        pmf as f32
    }

    /// Number of leaves.
    #[must_use]
    pub fn leaf_count(&self) -> usize {
        self.leaves.len()
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Memory in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes)
            + size_of_val(&*self.leaves)
            + size_of_val(&*self.lights)
            + size_of_val(&*self.leaf_of)
    }

    fn query(&self, receiver: &Receiver) -> Query {
        let Receiver { p, n, two_sided, .. } = *receiver;
        Query { p: (p - self.origin) * self.unit, n, two_sided, both_sides: self.both_sides }
    }
}

/// See [`LightTree::walk`].
#[derive(Debug)]
pub struct TreeWalk<'a> {
    tree: &'a LightTree,
    query: Query,
    /// The nodes that the last draw went through, with the chances of their children.
    path: SmallVec<[(u32, [f32; WIDTH]); 6]>,
}

impl TreeWalk<'_> {
    /// See [`LightTree::sample`].
    #[must_use]
    pub fn sample(&mut self, u: f64) -> Option<TreeSample> {
        let (mut node, mut pmf, mut u) = (0, 1.0, u);
        for level in 0.. {
            if self.path.get(level).is_none_or(|(known, _)| *known != node) {
                self.path.truncate(level);
                self.path.push((node, self.tree.nodes[node as usize].chances(&self.query)?));
            }
            let chances = &self.path[level].1;
            let (slot, below) = choose(chances, u);
            let chance = f64::from(chances[slot]);
            pmf *= chance;
            u = ((u - below) / chance).clamp(0.0, 1.0 - f64::EPSILON);
            let child = self.tree.nodes[node as usize].child[slot];
            if child & LEAF != 0 {
                let Leaf { light, prim, .. } = self.tree.leaves[(child & !LEAF) as usize];
                let pmf = pmf as f32;
                return (pmf > 0.0).then_some(TreeSample { light, prim, pmf });
            }
            node = child;
        }
        None
    }
}

/// The child that `u` falls on, and the sum of the chances before it. Never
/// one without a chance.
fn choose(chances: &[f32; WIDTH], u: f64) -> (usize, f64) {
    let [a, b, c, d, e, f, g, h] = chances.map(f64::from);
    // Sums by halves: shorter than one after the other.
    let (ab, cd, ef, gh) = (a + b, c + d, e + f, g + h);
    let (abcd, efgh) = (ab + cd, ef + gh);
    let ends = [a, ab, ab + c, abcd, abcd + e, abcd + ef, abcd + (ef + g), abcd + efgh];
    let mut slot = ends.iter().filter(|end| **end <= u).count();
    if slot >= WIDTH {
        // Rounding left a gap at the end.
        slot = chances.iter().rposition(|c| *c > 0.0).unwrap_or(0);
    }
    (slot, if slot == 0 { 0.0 } else { ends[slot - 1] })
}

impl Node {
    /// Share of the chances that all children with importance have equally.
    const FLOOR: f32 = 1.0 / 64.0;

    /// Probability of each child; `None` when none has importance.
    fn chances(&self, query: &Query) -> Option<[f32; WIDTH]> {
        let a = self.halves[0].importance(query);
        // Children fill the slots in order: the second half is often empty.
        let b = if self.count > 4 { self.halves[1].importance(query) } else { Vec4::ZERO };
        let (on_a, on_b) = (a.cmpgt(Vec4::ZERO), b.cmpgt(Vec4::ZERO));
        let count = (on_a.bitmask() | on_b.bitmask() << 4).count_ones();
        if count == 0 {
            return None;
        }
        let scale = Vec4::splat((1.0 - Node::FLOOR) / (a + b).element_sum());
        let floor = Vec4::splat(Node::FLOOR / count as f32);
        let mut out = [0.0; WIDTH];
        Vec4::select(on_a, a * scale + floor, Vec4::ZERO).write_to_slice(&mut out[..4]);
        Vec4::select(on_b, b * scale + floor, Vec4::ZERO).write_to_slice(&mut out[4..]);
        Some(out)
    }
}

/// √ of each component.
#[inline(always)]
fn sqrt(a: Vec4) -> Vec4 {
    Vec4::new(a.x.sqrt(), a.y.sqrt(), a.z.sqrt(), a.w.sqrt())
}

/// The sine of an angle in [0, π] of that cosine.
#[inline(always)]
fn sine(cos: Vec4) -> Vec4 {
    sqrt((Vec4::ONE - cos * cos).max(Vec4::ZERO))
}

/// Cosine of max(0, a − b) from the cosines and sines of both.
#[inline(always)]
fn cos_difference((cos_a, sin_a): (Vec4, Vec4), (cos_b, sin_b): (Vec4, Vec4)) -> Vec4 {
    Vec4::select(cos_a.cmpgt(cos_b), Vec4::ONE, cos_a * cos_b + sin_a * sin_b)
}

/// The sine of the same.
#[inline(always)]
fn sin_difference((cos_a, sin_a): (Vec4, Vec4), (cos_b, sin_b): (Vec4, Vec4)) -> Vec4 {
    Vec4::select(cos_a.cmpgt(cos_b), Vec4::ZERO, sin_a * cos_b - cos_a * sin_b)
}

impl Half {
    /// Plain arithmetic without a branch.
    #[inline(always)]
    fn importance(&self, query: &Query) -> Vec4 {
        // Nothing is nearer than this: no division by zero at a point light.
        const NEAREST2: Vec4 = Vec4::splat(1e-24);
        let (p, n) = (query.p, query.n);
        // From the light to the receiver.
        let (x, y, z) = (Vec4::splat(p.x) - self.x, Vec4::splat(p.y) - self.y, Vec4::splat(p.z) - self.z);
        let d2 = x * x + y * y + z * z;
        let inverse2 = Vec4::ONE / d2.max(NEAREST2);
        let inverse = sqrt(inverse2);

        // The angle that the sphere fills, all of it from inside.
        let sin2 = self.radius2 * inverse2;
        let cos_outside = sqrt((Vec4::ONE - sin2).max(Vec4::ZERO));
        let cos_size = Vec4::select(d2.cmple(self.radius2), Vec4::NEG_ONE, cos_outside);
        let size = (cos_size, sqrt(sin2.min(Vec4::ONE)));

        // Emission: from the axis to the receiver, less spread and size.
        let mut cos_axis = (self.axis_x * x + self.axis_y * y + self.axis_z * z) * inverse;
        let mut cos_falloff = self.cos_falloff;
        if query.both_sides {
            // To the axis or its opposite, whichever is nearer.
            cos_axis = Vec4::select(cos_falloff.cmplt(Vec4::ZERO), cos_axis.abs(), cos_axis);
            cos_falloff = cos_falloff.max(Vec4::ZERO);
        }
        let (axis, spread) = ((cos_axis, sine(cos_axis)), (self.cos_spread, self.sin_spread));
        let normal = (cos_difference(axis, spread), sin_difference(axis, spread));
        let cos_emitted = cos_difference(normal, size);
        let emitted = Vec4::select(cos_emitted.cmpgt(cos_falloff), cos_emitted, Vec4::ZERO);
        let distance2 = d2.max(self.radius2).max(NEAREST2);
        let importance = self.power * emitted / distance2;
        if query.two_sided {
            return importance;
        }

        // Reception: from the receiver's normal to the light, less size.
        let cos_normal = (x * -n.x + y * -n.y + z * -n.z) * inverse;
        importance * cos_difference((cos_normal, sine(cos_normal)), size).max(Vec4::ZERO)
    }
}
