//! Numbers about a tree.

use super::build::{Tree, TreeNode};
use crate::math::Bounds;

/// Numbers about a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Inner nodes.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: usize,
    /// Expected number of node visits plus primitive tests (of a binary tree)
    /// or leaf visits (of a wide one) of a ray that crosses the scene's box.
    pub cost: f64,
}

impl Stats {
    /// Numbers about a binary tree.
    pub(super) fn of_binary(tree: &Tree) -> Stats {
        let mut stats = Stats::default();
        if let Some(root) = tree.nodes.first() {
            stats.visit(tree, root, Share::new(&root.bounds()), 0);
        }
        stats
    }

    fn visit(&mut self, tree: &Tree, node: &TreeNode, share: Share, depth: usize) {
        let p = share.of(&node.bounds());
        if node.is_leaf() {
            self.leaves += 1;
            self.cost += p * f64::from(node.count);
            self.depth = self.depth.max(depth);
            return;
        }
        self.nodes += 1;
        self.cost += p;
        for i in 0..2 {
            self.visit(tree, &tree.nodes[node.first as usize + i], share, depth + 1);
        }
    }
}

/// Chance that a ray that crosses the whole also crosses a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share {
    whole: f64,
}

impl Share {
    pub(super) fn new(whole: &Bounds) -> Share {
        Share { whole: half_area(whole) }
    }

    pub(super) fn of(self, part: &Bounds) -> f64 {
        if self.whole > 0.0 { half_area(part) / self.whole } else { 0.0 }
    }
}

/// In f64: areas of extreme scenes leave the range of f32.
fn half_area(bounds: &Bounds) -> f64 {
    let d = bounds.extent().as_dvec3();
    d.x * d.y + d.y * d.z + d.z * d.x
}
