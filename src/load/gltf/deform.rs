//! Skins and morph targets: the vertices of a primitive at a time.

use rayon::prelude::*;

use super::fail;
use super::geometry::Geometry;
use super::motion::{Stage, TOLERANCE};
use super::source::Source;
use crate::desc::{Mesh, MeshKey, Result};
use crate::math::{DMat3, DMat4, Vec3, Vec4};

/// Vertices that one task of a pool poses.
const CHUNK: usize = 4096;

/// The joints of a skin.
#[derive(Debug)]
pub struct Skin {
    joints: Vec<usize>,
    inverse_bind: Vec<DMat4>,
}

impl Skin {
    /// Skin `index` of the file.
    pub fn read(source: &Source, index: usize, place: &str) -> Result<Skin> {
        let Some(skin) = source.root.skins.get(index) else {
            return Err(fail(place, format!("there is no skins[{index}]")));
        };
        let place = format!("skins[{index}]");
        if let Some(bad) = skin.joints.iter().find(|j| **j >= source.root.nodes.len()) {
            return Err(fail(&format!("{place}.joints"), format!("there is no nodes[{bad}]")));
        }
        let inverse_bind = match skin.inverse_bind_matrices {
            None => vec![DMat4::IDENTITY; skin.joints.len()],
            Some(accessor) => {
                let place = format!("{place}.inverseBindMatrices");
                let matrices = source.vectors::<16>(accessor, &place)?;
                if matrices.len() < skin.joints.len() {
                    let message = format!("has {} matrices for {} joints", matrices.len(), skin.joints.len());
                    return Err(fail(&place, message));
                }
                matrices.iter().map(|m| DMat4::from_cols_array(&m.map(f64::from))).collect()
            }
        };
        Ok(Skin { joints: skin.joints.clone(), inverse_bind })
    }

    /// True if any joint moves while the shutter is open.
    fn moves(&self, stage: &Stage) -> bool {
        self.joints.iter().any(|j| stage.moving[*j])
    }
}

/// A primitive that changes its shape.
pub struct Deformer<'a> {
    /// At rest.
    pub geometry: &'a Geometry,
    /// Its skin, if it has one.
    pub skin: Option<&'a Skin>,
    /// The node that holds it.
    pub node: usize,
    /// Weights of the morph targets that nothing animates.
    pub weights: Vec<f64>,
}

/// Vertices at a time.
struct Pose {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    tangents: Vec<Vec4>,
}

impl Deformer<'_> {
    /// Fails on a joint that the skin does not have.
    pub fn check(&self, place: &str) -> Result<()> {
        let Some(skin) = self.skin else { return Ok(()) };
        match self.geometry.joints.iter().find(|(joint, _)| *joint as usize >= skin.joints.len()) {
            Some((joint, _)) => {
                Err(fail(place, format!("names joint {joint} of a skin of {} joints", skin.joints.len())))
            }
            None => Ok(()),
        }
    }

    /// The mesh when the shutter opens, with its shapes until it closes.
    pub fn mesh(&self, stage: &Stage, source: &Source, place: &str) -> Result<Mesh> {
        let rest = &self.geometry.mesh;
        let moves = self.skin.is_some_and(|skin| skin.moves(stage))
            || stage.shutter.open.is_some_and(|open| stage.tracks.weights(self.node, open).is_some());
        let bytes = rest.positions.len() as u64 * 24;
        source.budget.take(bytes * 2, place)?;
        let mut mesh = rest.clone();
        if !moves {
            let open = stage.shutter.open;
            let pose = self.pose(stage, open);
            (mesh.positions, mesh.normals, mesh.tangents) = (pose.positions, pose.normals, pose.tangents);
            return finite(mesh, place);
        }
        let at = |time| self.pose(stage, Some(time));
        let first = stage.shutter.open.map(at).map_or(0.0, |p| size(&p.positions));
        let off = |a: &Pose, b: &Pose, s: f64, truth: &Pose| {
            let lerped = a.positions.iter().zip(&b.positions).map(|(a, b)| a.lerp(*b, s as f32));
            lerped.zip(&truth.positions).any(|(p, q)| f64::from(p.distance(*q)) > TOLERANCE * first)
        };
        let keys = stage.sampled(at, off);
        source.budget.take(bytes * keys.len() as u64, place)?;
        let still = keys.iter().all(|(_, p)| p.positions == keys[0].1.positions);
        mesh.tangents.clone_from(&keys[0].1.tangents);
        mesh.positions.clone_from(&keys[0].1.positions);
        mesh.normals.clone_from(&keys[0].1.normals);
        if keys.len() > 1 && !still {
            let key = |(time, pose): (f64, Pose)| MeshKey {
                time,
                positions: pose.positions,
                normals: pose.normals,
            };
            mesh.deformation = keys.into_iter().map(key).collect();
        }
        finite(mesh, place)
    }

    fn pose(&self, stage: &Stage, time: Option<f64>) -> Pose {
        let rest = &self.geometry.mesh;
        let mut pose = Pose {
            positions: rest.positions.clone(),
            normals: rest.normals.clone(),
            tangents: rest.tangents.clone(),
        };
        let animated = time.and_then(|time| stage.tracks.weights(self.node, time));
        let weights = animated.as_deref().unwrap_or(&self.weights);
        for (target, weight) in self.geometry.targets.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            let weight = *weight as f32;
            let add =
                |to: &mut [Vec3], what: &[Vec3]| to.iter_mut().zip(what).for_each(|(t, d)| *t += *d * weight);
            add(&mut pose.positions, &target.positions);
            add(&mut pose.normals, &target.normals);
            for (t, d) in pose.tangents.iter_mut().zip(&target.tangents) {
                *t += (*d * weight).extend(0.0);
            }
        }
        if let Some(skin) = self.skin.filter(|_| self.geometry.per_vertex > 0) {
            let worlds = time.map_or_else(|| stage.still(), |time| stage.pose(time));
            let matrices: Vec<DMat4> = skin
                .joints
                .iter()
                .zip(&skin.inverse_bind)
                .map(|(j, inverse)| worlds[*j] * *inverse)
                .collect();
            self.bend(&mut pose, &matrices);
        }
        pose.normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        pose
    }

    /// Linear blend skinning.
    fn bend(&self, pose: &mut Pose, matrices: &[DMat4]) {
        let per = self.geometry.per_vertex;
        let blended: Vec<DMat4> = self
            .geometry
            .joints
            .par_chunks(per)
            .with_min_len(CHUNK)
            .map(|joints| {
                joints.iter().filter(|(_, w)| *w > 0.0).fold(DMat4::ZERO, |sum, (joint, weight)| {
                    sum + matrices[*joint as usize] * f64::from(*weight)
                })
            })
            .collect();
        for (i, m) in blended.iter().enumerate() {
            pose.positions[i] = m.transform_point3(pose.positions[i].as_dvec3()).as_vec3();
            if let Some(normal) = pose.normals.get_mut(i) {
                let n = DMat3::from_mat4(*m).inverse().transpose() * normal.as_dvec3();
                // A blend without inverse leaves no normal but the plain one.
                *normal = if n.is_finite() { n.normalize_or_zero().as_vec3() } else { *normal };
            }
            if let Some(tangent) = pose.tangents.get_mut(i) {
                let t = m.transform_vector3(tangent.truncate().as_dvec3());
                *tangent = t.normalize_or_zero().as_vec3().extend(tangent.w);
            }
        }
    }
}

/// Length of the diagonal of the box around points.
pub fn size(positions: &[Vec3]) -> f64 {
    let low = positions.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
    let high = positions.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ZERO);
    f64::from((high - low).length())
}

fn finite(mesh: Mesh, place: &str) -> Result<Mesh> {
    let keys = mesh.deformation.iter().flat_map(|k| &k.positions);
    match mesh.positions.iter().chain(keys).all(|p| p.is_finite()) {
        true => Ok(mesh),
        false => Err(fail(place, "a skin or a morph target moves vertices beyond all bounds")),
    }
}
