//! Improves a binary tree by taking nodes out and putting them back where they
//! cost least (Bittner, Hapala, Havran 2013, "Fast Insertion-Based Optimization
//! of Bounding Volume Hierarchies"), many at a time (Meister, Bittner 2018,
//! "Parallel Reinsertion for Bounding Volume Hierarchy Optimization").
//!
//! In each round the widest nodes look for their best places in parallel, in
//! the tree as it was; then the moves are made one after the other, the best
//! first, leaving out those that touch what an earlier one has changed. So the
//! result does not depend on the number of threads.

use rayon::prelude::*;

use super::build::{Tree, TreeNode};
use crate::math::Bounds;

/// How much work to do.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    pub rounds: usize,
    /// The share of all nodes that is tried in a round.
    pub share: f64,
}

/// A node and the place where it costs less: as the sibling of `to`.
#[derive(Clone, Copy, Debug)]
struct Move {
    from: u32,
    to: u32,
    gain: f32,
}

/// Improves a tree whose nodes follow each other without gaps, each pair of
/// children after its parent. Afterwards the order of nodes is any.
pub fn improve(tree: &mut Tree, effort: Effort) {
    if tree.nodes.len() < 8 {
        return;
    }
    let mut work = Work::new(tree);
    for _ in 0..effort.rounds {
        let moves = work.moves(effort.share);
        work.make(&moves);
    }
}

struct Work<'a> {
    nodes: &'a mut [TreeNode],
    parents: Vec<u32>,
    touched: Vec<bool>,
    /// What areas are multiplied by, per length.
    scale: f32,
}

/// The other child of the same parent: pairs begin at even slots.
fn sibling(node: u32) -> u32 {
    node ^ 1
}

impl Work<'_> {
    fn new(tree: &mut Tree) -> Work<'_> {
        let mut parents = vec![0; tree.nodes.len()];
        // Slot 1 is unused and says that its children begin at 0.
        let inner = |(_, node): &(usize, &TreeNode)| !node.is_leaf() && node.first != 0;
        for (i, node) in tree.nodes.iter().enumerate().filter(inner) {
            parents[node.first as usize] = i as u32;
            parents[node.first as usize + 1] = i as u32;
        }
        let size = tree.nodes[0].bounds().extent().max_element();
        let scale = f32::from_bits((1.0 / size).to_bits() & 0x7f80_0000);
        Work { touched: vec![false; tree.nodes.len()], nodes: &mut tree.nodes, parents, scale }
    }

    fn area(&self, bounds: &Bounds) -> f32 {
        let d = bounds.extent() * self.scale;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// The best moves of the widest nodes, the best first.
    fn moves(&self, share: f64) -> Vec<Move> {
        let mut candidates: Vec<(f32, u32)> =
            (2..self.nodes.len() as u32).map(|i| (self.area(&self.nodes[i as usize].bounds()), i)).collect();
        let count = ((candidates.len() as f64 * share) as usize).clamp(1, candidates.len());
        let order = |a: &(f32, u32), b: &(f32, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if count < candidates.len() {
            candidates.select_nth_unstable_by(count, order);
            candidates.truncate(count);
        }
        let mut moves: Vec<Move> =
            candidates.par_iter().with_min_len(64).filter_map(|(_, node)| self.best_move(*node)).collect();
        moves.par_sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));
        moves
    }

    /// Searches outwards: up from the node, and down from every sibling on the
    /// way, as long as the area saved so far can pay for the node itself.
    fn best_move(&self, from: u32) -> Option<Move> {
        let node = self.nodes[from as usize].bounds();
        let node_area = self.area(&node);
        let mut best = Move { from, to: 0, gain: 0.0 };
        let parent = self.parents[from as usize];
        // Saved by taking the node out: its parent, and what shrinks above.
        let mut saved = self.area(&self.nodes[parent as usize].bounds());
        let (mut pivot, mut side) = (parent, sibling(from));
        let mut shrunk = self.nodes[side as usize].bounds();
        let mut stack: Vec<(f32, u32)> = Vec::with_capacity(64);
        loop {
            stack.push((saved, side));
            while let Some((budget, at)) = stack.pop() {
                if budget - node_area <= best.gain {
                    continue;
                }
                let target = &self.nodes[at as usize];
                let gain = budget - self.area(&target.bounds().union(node));
                if gain > best.gain {
                    (best.to, best.gain) = (at, gain);
                }
                if !target.is_leaf() {
                    let budget = gain + self.area(&target.bounds());
                    stack.push((budget, target.first));
                    stack.push((budget, target.first + 1));
                }
            }
            if pivot == 0 {
                break;
            }
            if pivot != parent {
                shrunk = shrunk.union(self.nodes[side as usize].bounds());
                saved += self.area(&self.nodes[pivot as usize].bounds()) - self.area(&shrunk);
            }
            side = sibling(pivot);
            pivot = self.parents[pivot as usize];
        }
        // Next to its own sibling or parent it is already.
        let useless = best.to == sibling(from) || best.to == parent;
        (best.to != 0 && !useless && best.gain > 0.0).then_some(best)
    }

    fn make(&mut self, moves: &[Move]) {
        self.touched.fill(false);
        for m in moves {
            let around =
                [m.to, m.from, sibling(m.from), self.parents[m.to as usize], self.parents[m.from as usize]];
            if around.iter().any(|i| self.touched[*i as usize]) || self.is_below(m.to, m.from) {
                continue;
            }
            around.iter().for_each(|i| self.touched[*i as usize] = true);
            self.reinsert(m.from, m.to);
        }
    }

    /// An earlier move may have put the target below what is to be moved.
    fn is_below(&self, mut node: u32, ancestor: u32) -> bool {
        while node != 0 && node != ancestor {
            node = self.parents[node as usize];
        }
        node == ancestor
    }

    /// The pair of `from` gets a new parent in the slot of `to`, which becomes
    /// the sibling of `from`; the former sibling takes its parent's slot.
    fn reinsert(&mut self, from: u32, to: u32) {
        let (brother, parent) = (sibling(from), self.parents[from as usize]);
        let moved = self.nodes[to as usize];
        self.nodes[parent as usize] = self.nodes[brother as usize];
        self.nodes[brother as usize] = moved;
        let pair = from.min(brother);
        self.nodes[to as usize] = TreeNode { first: pair, count: 0, ..moved };
        self.adopt(parent);
        self.adopt(brother);
        self.parents[from as usize] = to;
        self.parents[brother as usize] = to;
        self.refit(to);
        self.refit(self.parents[parent as usize]);
    }

    fn adopt(&mut self, node: u32) {
        let TreeNode { first, count: 0, .. } = self.nodes[node as usize] else { return };
        self.parents[first as usize] = node;
        self.parents[first as usize + 1] = node;
    }

    /// Boxes from a node up to the root.
    fn refit(&mut self, mut node: u32) {
        loop {
            let first = self.nodes[node as usize].first as usize;
            let Bounds { min, max } = self.nodes[first].bounds().union(self.nodes[first + 1].bounds());
            let at = &mut self.nodes[node as usize];
            (at.min, at.max) = (min, max);
            if node == 0 {
                return;
            }
            node = self.parents[node as usize];
        }
    }
}
