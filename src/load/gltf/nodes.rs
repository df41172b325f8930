//! The node hierarchy: a forest, walked without recursion.

use super::fail;
use super::json::{Node, Root};
use super::motion::{Path, Tracks};
use crate::desc::Result;
use crate::math::{DMat4, DQuat, DVec3};

/// Deepest chain of nodes.
const MAX_DEPTH: u32 = 10_000;

/// The nodes with their parents.
#[derive(Debug)]
pub struct Hierarchy {
    parents: Vec<Option<usize>>,
    /// All nodes, parents before children.
    order: Vec<usize>,
    locals: Vec<Local>,
}

/// The transform of a node relative to its parent.
#[derive(Clone, Copy, Debug)]
enum Local {
    Matrix(DMat4),
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Local {
    fn of(node: &Node, place: &str) -> Result<Local> {
        if let Some(m) = node.matrix {
            return Ok(Local::Matrix(DMat4::from_cols_array(&m)));
        }
        let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let length = rotation.length();
        if !(length > 1e-9 && length.is_finite()) {
            return Err(fail(&format!("{place}.rotation"), "is no rotation: a quaternion has length 1"));
        }
        Ok(Local::Parts {
            translation: DVec3::from(node.translation.unwrap_or([0.0; 3])),
            rotation: rotation / length,
            scale: DVec3::from(node.scale.unwrap_or([1.0; 3])),
        })
    }

    fn matrix(self) -> DMat4 {
        match self {
            Local::Matrix(m) => m,
            Local::Parts { translation, rotation, scale } => {
                DMat4::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }

    /// With one part replaced by an animated value.
    fn with(self, path: Path, value: &[f64]) -> Local {
        let (mut translation, mut rotation, mut scale) = match self {
            Local::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Local::Matrix(m) => {
                let (scale, rotation, translation) = m.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
        };
        match (path, value) {
            (Path::Translation, &[x, y, z]) => translation = DVec3::new(x, y, z),
            (Path::Scale, &[x, y, z]) => scale = DVec3::new(x, y, z),
            (Path::Rotation, &[x, y, z, w]) => rotation = DQuat::from_xyzw(x, y, z, w),
            _ => {}
        }
        Local::Parts { translation, rotation, scale }
    }
}

impl Hierarchy {
    /// Fails on a node with two parents, on one that is its own ancestor, and
    /// on numbers that are no transform.
    pub fn new(root: &Root) -> Result<Hierarchy> {
        let count = root.nodes.len();
        let mut parents: Vec<Option<usize>> = vec![None; count];
        for (i, node) in root.nodes.iter().enumerate() {
            for (k, &child) in node.children.iter().enumerate() {
                let place = format!("nodes[{i}].children[{k}]");
                match parents.get(child) {
                    None => return Err(fail(&place, format!("there is no nodes[{child}]"))),
                    Some(_) if child == i => {
                        return Err(fail(&place, format!("nodes[{i}] is its own ancestor")));
                    }
                    Some(Some(other)) => {
                        let message = format!(
                            "nodes[{child}] is a child of nodes[{other}] already; a node has one parent"
                        );
                        return Err(fail(&place, message));
                    }
                    Some(None) => parents[child] = Some(i),
                }
            }
        }
        let order = Hierarchy::order(root, &parents)?;
        let mut locals = Vec::with_capacity(count);
        for (i, node) in root.nodes.iter().enumerate() {
            let place = format!("nodes[{i}]");
            let local = Local::of(node, &place)?;
            if !local.matrix().is_finite() {
                return Err(fail(&place, "its transform is not finite"));
            }
            locals.push(local);
        }
        Ok(Hierarchy { parents, order, locals })
    }

    fn order(root: &Root, parents: &[Option<usize>]) -> Result<Vec<usize>> {
        let mut order: Vec<usize> = (0..parents.len()).filter(|i| parents[*i].is_none()).collect();
        let mut depth = vec![0_u32; parents.len()];
        let mut next = 0;
        while next < order.len() {
            let i = order[next];
            next += 1;
            for &child in &root.nodes[i].children {
                depth[child] = depth[i] + 1;
                if depth[child] > MAX_DEPTH {
                    let message = format!("nodes are nested more than {MAX_DEPTH} deep");
                    return Err(fail(&format!("nodes[{child}]"), message));
                }
                order.push(child);
            }
        }
        if order.len() < parents.len() {
            // With one parent each, what no root reaches hangs on a cycle; go
            // up far enough to stand on it.
            let reached: std::collections::HashSet<usize> = order.into_iter().collect();
            let mut at = (0..parents.len()).find(|i| !reached.contains(i)).unwrap_or(0);
            for _ in 0..parents.len() {
                at = parents[at].unwrap_or(at);
            }
            return Err(fail(&format!("nodes[{at}]"), "is its own ancestor"));
        }
        Ok(order)
    }

    /// The nodes that a scene shows, parents first.
    pub fn visible(&self, root: &Root) -> Result<Vec<usize>> {
        let mut shown = vec![false; root.nodes.len()];
        match root.scene.or((!root.scenes.is_empty()).then_some(0)) {
            // Without any scene there is nothing that says what to leave out.
            None => (0..shown.len()).filter(|i| self.parents[*i].is_none()).for_each(|i| shown[i] = true),
            Some(index) => {
                let Some(scene) = root.scenes.get(index) else {
                    return Err(fail("scene", format!("there is no scenes[{index}]")));
                };
                for (k, &node) in scene.nodes.iter().enumerate() {
                    let place = format!("scenes[{index}].nodes[{k}]");
                    match self.parents.get(node) {
                        None => return Err(fail(&place, format!("there is no nodes[{node}]"))),
                        // It should be a root; one that is not is shown where
                        // its parents put it.
                        Some(_) => shown[node] = true,
                    }
                }
            }
        }
        for &node in &self.order {
            shown[node] |= self.parents[node].is_some_and(|p| shown[p]);
        }
        Ok(self.order.iter().copied().filter(|i| shown[*i]).collect())
    }

    /// Every node to the world, at a time, or as stored.
    pub fn worlds(&self, tracks: &Tracks, time: Option<f64>) -> Vec<DMat4> {
        let mut locals = self.locals.clone();
        if let Some(time) = time {
            tracks.transforms(time, |node, path, value| locals[node] = locals[node].with(path, value));
        }
        let mut worlds = vec![DMat4::IDENTITY; locals.len()];
        for &node in &self.order {
            let local = locals[node].matrix();
            worlds[node] = self.parents[node].map_or(local, |p| worlds[p] * local);
        }
        worlds
    }

    /// For each node, whether it or an ancestor is in the set.
    pub fn below(&self, mut set: Vec<bool>) -> Vec<bool> {
        for &node in &self.order {
            set[node] |= self.parents[node].is_some_and(|p| set[p]);
        }
        set
    }
}
