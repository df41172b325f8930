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
//! A node has eight children in columns, so that one loop over eight lanes
//! evaluates them all. [`LightTree::sample`] and [`LightTree::pmf`] go down the
//! same path with the same arithmetic: their probabilities are equal bit for
//! bit. Lengths are in units of the tree (a power of two of the scene's), so no
//! square over- or underflows.

use super::tree_build::Builder;
use super::{Emitter, Receiver};
use crate::math::Vec3;
use crate::shape::PrimId;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// A child that is a leaf.
pub(super) const LEAF: u32 = 1 << 31;

/// Eight children in columns. Empty ones have no power.
#[derive(Clone, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct Node {
    pub x: [f32; WIDTH],
    pub y: [f32; WIDTH],
    pub z: [f32; WIDTH],
    /// Square of the radius.
    pub radius2: [f32; WIDTH],
    pub axis_x: [f32; WIDTH],
    pub axis_y: [f32; WIDTH],
    pub axis_z: [f32; WIDTH],
    /// Of the spread of normals.
    pub cos_spread: [f32; WIDTH],
    pub sin_spread: [f32; WIDTH],
    /// Of the angle to a normal at which emission ends.
    pub cos_falloff: [f32; WIDTH],
    pub power: [f32; WIDTH],
    /// A node, or [`LEAF`] and a leaf.
    pub child: [u32; WIDTH],
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
struct Query {
    p: Vec3,
    n: Vec3,
    two_sided: bool,
}

/// A light tree. Immutable.
#[derive(Clone, Debug)]
pub struct LightTree {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
    /// For each light its first primitive and where its leaves begin in `leaf_of`.
    pub(super) lights: Vec<(PrimId, u32)>,
    /// Leaf of each primitive; `u32::MAX` for those without power.
    pub(super) leaf_of: Vec<u32>,
    /// What is subtracted from positions, and what they are then scaled by.
    pub(super) origin: Vec3,
    pub(super) unit: f32,
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

    /// Chooses an emitter by a uniform `u` in [0, 1). `None` where nothing that
    /// shines on the receiver is found.
    #[must_use]
    pub fn sample(&self, receiver: &Receiver, u: f64) -> Option<TreeSample> {
        let query = self.query(receiver);
        let (mut node, mut pmf, mut u) = (0, 1.0, u);
        loop {
            let chances = self.nodes[node].chances(&query)?;
            let mut below = 0.0;
            let mut chosen = None;
            for (slot, chance) in chances.iter().enumerate().filter(|(_, c)| **c > 0.0) {
                let chance = f64::from(*chance);
                chosen = Some((slot, below, chance));
                if u < below + chance {
                    break;
                }
                below += chance;
            }
            let (slot, below, chance) = chosen?;
            pmf *= chance;
            u = ((u - below) / chance).clamp(0.0, 1.0 - f64::EPSILON);
            let child = self.nodes[node].child[slot];
            if child & LEAF != 0 {
                let Leaf { light, prim, .. } = self.leaves[(child & !LEAF) as usize];
                let pmf = pmf as f32;
                return (pmf > 0.0).then_some(TreeSample { light, prim, pmf });
            }
            node = child as usize;
        }
    }

    /// The probability with which [`LightTree::sample`] chooses a primitive of
    /// a light; `prim` does not matter for lights that have none.
    #[must_use]
    pub fn pmf(&self, receiver: &Receiver, light: u32, prim: PrimId) -> f32 {
        let (first_prim, first) = self.lights[light as usize];
        let offset = if first_prim == PrimId::MAX { 0 } else { prim - first_prim };
        let leaf = self.leaf_of.get((first + offset) as usize).copied().unwrap_or(u32::MAX);
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
        let Receiver { p, n, two_sided } = *receiver;
        Query { p: (p - self.origin) * self.unit, n, two_sided }
    }
}

impl Node {
    /// Share of the chances that all children with importance have equally.
    const FLOOR: f32 = 1.0 / 16.0;

    /// Probability of each child; `None` when none has importance.
    fn chances(&self, query: &Query) -> Option<[f32; WIDTH]> {
        let mut chances = self.importance(query);
        let (mut sum, mut count) = (0.0, 0.0);
        for i in chances {
            sum += i;
            count += if i > 0.0 { 1.0 } else { 0.0 };
        }
        if !(sum > 0.0) {
            return None;
        }
        let scale = (1.0 - Node::FLOOR) / sum;
        let floor = Node::FLOOR / count;
        for i in &mut chances {
            *i = if *i > 0.0 { *i * scale + floor } else { 0.0 };
        }
        Some(chances)
    }

    /// Importance of each child: eight lanes of plain arithmetic without a
    /// branch, which compiles to vector instructions.
    fn importance(&self, query: &Query) -> [f32; WIDTH] {
        // Nothing is nearer than this: no division by zero at a point light.
        const NEAREST2: f32 = 1e-24;
        let least = |a: f32, b: f32| if a < b { a } else { b };
        let most = |a: f32, b: f32| if a > b { a } else { b };
        let sine = |cos: f32| most(1.0 - cos * cos, 0.0).sqrt();
        // cos max(0, a − b).
        let cos_difference = |cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32| {
            if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
        };
        let sin_difference = |cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32| {
            if cos_a > cos_b { 0.0 } else { sin_a * cos_b - cos_a * sin_b }
        };
        let (p, n) = (query.p, query.n);
        let always = if query.two_sided { 1.0 } else { 0.0 };
        let mut out = [0.0; WIDTH];
        for i in 0..WIDTH {
            // From the light to the receiver.
            let (x, y, z) = (p.x - self.x[i], p.y - self.y[i], p.z - self.z[i]);
            let d2 = x * x + y * y + z * z;
            let inverse2 = 1.0 / most(d2, NEAREST2);
            let inverse = inverse2.sqrt();

            // The angle that the sphere fills, all of it from inside.
            let inside = d2 <= self.radius2[i];
            let sin2 = self.radius2[i] * inverse2;
            let sin_b = least(sin2, 1.0).sqrt();
            let cos_b = if inside { -1.0 } else { most(1.0 - sin2, 0.0).sqrt() };

            // Emission: from the axis to the receiver, less spread and size.
            let cos_w = (self.axis_x[i] * x + self.axis_y[i] * y + self.axis_z[i] * z) * inverse;
            let sin_w = sine(cos_w);
            let (cos_o, sin_o) = (self.cos_spread[i], self.sin_spread[i]);
            let cos_x = cos_difference(cos_w, sin_w, cos_o, sin_o);
            let sin_x = sin_difference(cos_w, sin_w, cos_o, sin_o);
            let cos_e = cos_difference(cos_x, sin_x, cos_b, sin_b);
            let emitted = if cos_e > self.cos_falloff[i] { cos_e } else { 0.0 };

            // Reception: from the receiver's normal to the light, less size.
            let cos_i = -(n.x * x + n.y * y + n.z * z) * inverse;
            let cos_r = cos_difference(cos_i, sine(cos_i), cos_b, sin_b);
            let received = most(most(cos_r, 0.0), always);

            out[i] = self.power[i] * emitted * received / most(most(d2, self.radius2[i]), NEAREST2);
        }
        out
    }
}
