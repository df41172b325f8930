//! Primitives to meshes: vertices, topology, normals and tangents where the
//! file has none, and what skins and morph targets need.

use std::collections::{BTreeMap, BTreeSet};

use super::draco::Packed;
use super::json::Primitive;
use super::source::Source;
use super::{fail, tangent};
use crate::desc::{Mesh, MeshAttribute, Result};
use crate::math::{Vec2, Vec3, Vec4};

/// What a material reads of its meshes.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Needs {
    /// The set of texture coordinates that tangents follow.
    pub tangents: Option<u32>,
    /// Sets of texture coordinates that are looked up.
    pub uv_sets: BTreeSet<u32>,
    /// Opacity, so that the alpha of vertex colours counts.
    pub alpha: bool,
}

/// A primitive at rest.
#[derive(Debug, Default)]
pub struct Geometry {
    /// The mesh.
    pub mesh: Mesh,
    /// True if it has colours per vertex.
    pub vertex_color: bool,
    /// True if those have an alpha that counts.
    pub vertex_alpha: bool,
    /// Joints and weights of each vertex, `per_vertex` of them, or empty.
    pub joints: Vec<(u32, f32)>,
    /// Joints per vertex.
    pub per_vertex: usize,
    /// Morph targets.
    pub targets: Vec<Target>,
}

/// What a morph target adds at weight 1; empty lists add nothing.
#[derive(Debug, Default)]
pub struct Target {
    /// To positions.
    pub positions: Vec<Vec3>,
    /// To normals.
    pub normals: Vec<Vec3>,
    /// To tangents.
    pub tangents: Vec<Vec3>,
}

/// Name of the mesh attribute that holds a set of texture coordinates.
pub fn uv_attribute(set: u32) -> String {
    format!("vertex_texcoord{set}")
}

/// Reads a primitive. `None`, with a warning, for one that has no surface.
pub fn read(
    source: &Source,
    primitive: &Primitive,
    needs: &Needs,
    place: &str,
) -> Result<(Option<Geometry>, Vec<String>)> {
    let mut warnings = Vec::new();
    let mut warn = |what: &str| warnings.push(format!("{}: {place}: {what}", source.name));
    let mode = primitive.mode.unwrap_or(4);
    match mode {
        4..=6 => {}
        0 => warn("points have no surface and are left out"),
        1..=3 => warn("lines have no surface and are left out"),
        _ => return Err(fail(place, format!("`mode` {mode} is unknown"))),
    }
    let has_positions = primitive.attributes.contains_key("POSITION");
    if !has_positions {
        warn("has no POSITION and is left out");
    }
    if mode < 4 || !has_positions {
        return Ok((None, warnings));
    }
    let reader = Reader { source, primitive, place, packed: Packed::decode(source, primitive, place)? };
    let mut geometry = reader.vertices(needs)?;
    let indices = reader.indices(geometry.mesh.positions.len())?;
    geometry.mesh.triangles = triangles(&indices, if reader.packed.is_some() { 4 } else { mode });
    if mode == 4 && indices.len() % 3 != 0 {
        warn("its last triangle is not complete and is left out");
    }
    if geometry.mesh.triangles.is_empty() {
        return Ok((None, warnings));
    }
    if let Some(set) = needs.tangents
        && geometry.mesh.tangents.is_empty()
    {
        source.budget.take(geometry.mesh.triangles.len() as u64 * 3 * 64, place)?;
        tangent::generate(&mut geometry, set);
    }
    Ok((Some(geometry), warnings))
}

/// Triangles of a list (4), a strip (5) or a fan (6), without those that
/// repeat a vertex.
fn triangles(indices: &[u32], mode: u32) -> Vec<[u32; 3]> {
    let strip = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
    let all: Vec<[u32; 3]> = match mode {
        5 => indices.windows(3).enumerate().map(strip).collect(),
        6 => indices.get(1..).unwrap_or_default().windows(2).map(|w| [w[0], w[1], indices[0]]).collect(),
        _ => indices.chunks_exact(3).map(|w| [w[0], w[1], w[2]]).collect(),
    };
    if mode == 4 {
        return all;
    }
    all.into_iter().filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

struct Reader<'a> {
    source: &'a Source,
    primitive: &'a Primitive,
    place: &'a str,
    packed: Option<Packed>,
}

impl Reader<'_> {
    /// All attributes that something reads.
    fn vertices(&self, needs: &Needs) -> Result<Geometry> {
        let positions = self.need::<3>("POSITION")?;
        let count = positions.len();
        let mut geometry = Geometry::default();
        let mesh = &mut geometry.mesh;
        mesh.positions = positions.into_iter().map(Vec3::from).collect();
        mesh.normals = self.maybe::<3>("NORMAL", count)?.into_iter().map(Vec3::from).collect();
        // Tangents without normals must be ignored, says the specification.
        if needs.tangents.is_some() && !mesh.normals.is_empty() {
            mesh.tangents = self.maybe::<4>("TANGENT", count)?.into_iter().map(Vec4::from).collect();
        }
        for &set in &needs.uv_sets {
            // Lookups in a set that is not there get (0, 0).
            let mut uvs = self.maybe::<2>(&format!("TEXCOORD_{set}"), count)?;
            uvs.resize(count, [0.0; 2]);
            if set == 0 {
                mesh.uvs = uvs.into_iter().map(Vec2::from).collect();
            } else {
                let values = uvs.into_flattened();
                mesh.attributes.push(MeshAttribute {
                    name: uv_attribute(set),
                    channels: 2,
                    per_face: false,
                    values,
                });
            }
        }
        self.colors(&mut geometry, count, needs)?;
        self.skin(&mut geometry, count)?;
        geometry.targets = self.targets(count)?;
        Ok(geometry)
    }

    fn colors(&self, geometry: &mut Geometry, count: usize, needs: &Needs) -> Result<()> {
        let Some((values, width)) = self.attribute("COLOR_0", None)? else { return Ok(()) };
        self.same_count("COLOR_0", values.len() / width, count)?;
        if !(width == 3 || width == 4) {
            return Err(fail(&self.at("COLOR_0"), "must be of type VEC3 or VEC4"));
        }
        let mut push = |name: &str, channels: u32, values: Vec<f32>| {
            let name = name.to_string();
            geometry.mesh.attributes.push(MeshAttribute { name, channels, per_face: false, values });
        };
        if values.chunks_exact(width).any(|c| c[..3] != [1.0; 3]) {
            let rgb = values.chunks_exact(width).flat_map(|c| [c[0], c[1], c[2]].map(|x| x.clamp(0.0, 1.0)));
            push("vertex_color", 3, rgb.collect());
            geometry.vertex_color = true;
        }
        if needs.alpha && width == 4 && values.chunks_exact(4).any(|c| c[3] != 1.0) {
            push("vertex_alpha", 1, values.chunks_exact(4).map(|c| c[3].clamp(0.0, 1.0)).collect());
            geometry.vertex_alpha = true;
        }
        Ok(())
    }

    fn skin(&self, geometry: &mut Geometry, count: usize) -> Result<()> {
        let mut sets = Vec::new();
        while let Some(&index) = self.primitive.attributes.get(&format!("JOINTS_{}", sets.len())) {
            let (joints, weights) = (format!("JOINTS_{}", sets.len()), format!("WEIGHTS_{}", sets.len()));
            let indices = match &self.packed {
                Some(_) => {
                    self.maybe::<4>(&joints, count)?.into_flattened().iter().map(|j| *j as u32).collect()
                }
                None => self.source.integers(index, 4, &self.at(&joints))?,
            };
            self.same_count(&joints, indices.len() / 4, count)?;
            let shares = self.maybe::<4>(&weights, count)?.into_flattened();
            if shares.is_empty() {
                return Err(fail(&self.at(&joints), format!("needs {weights}")));
            }
            sets.push((indices, shares));
        }
        geometry.per_vertex = sets.len() * 4;
        geometry.joints.reserve(count * geometry.per_vertex);
        for vertex in 0..count {
            let start = geometry.joints.len();
            for (indices, shares) in &sets {
                let of = vertex * 4..vertex * 4 + 4;
                geometry
                    .joints
                    .extend(indices[of.clone()].iter().copied().zip(shares[of].iter().map(|w| w.max(0.0))));
            }
            normalise(&mut geometry.joints[start..]);
        }
        Ok(())
    }

    fn targets(&self, count: usize) -> Result<Vec<Target>> {
        let read = |target: &BTreeMap<String, usize>, name: &str, at: usize| -> Result<Vec<Vec3>> {
            let Some(&index) = target.get(name) else { return Ok(Vec::new()) };
            let place = format!("{}.targets[{at}].{name}", self.place);
            let values = self.source.vectors::<3>(index, &place)?;
            if values.len() != count {
                let message = format!("has {} elements, but the primitive {count} vertices", values.len());
                return Err(fail(&place, message));
            }
            Ok(values.into_iter().map(Vec3::from).collect())
        };
        let targets = self.primitive.targets.iter().enumerate();
        targets
            .map(|(at, target)| {
                Ok(Target {
                    positions: read(target, "POSITION", at)?,
                    normals: read(target, "NORMAL", at)?,
                    tangents: read(target, "TANGENT", at)?,
                })
            })
            .collect()
    }

    /// The vertices in the order that makes triangles.
    fn indices(&self, count: usize) -> Result<Vec<u32>> {
        let place = format!("{}.indices", self.place);
        let indices = match (&self.packed, self.primitive.indices) {
            (Some(packed), _) => packed.indices(),
            (None, Some(index)) => self.source.integers(index, 1, &place)?,
            (None, None) => {
                self.source.budget.take(count as u64 * 4, self.place)?;
                (0..count as u32).collect()
            }
        };
        match indices.iter().position(|i| *i as usize >= count) {
            Some(at) => Err(fail(
                &place,
                format!("element {at} is vertex {}, but there are only {count} vertices", indices[at]),
            )),
            None => Ok(indices),
        }
    }

    fn at(&self, name: &str) -> String {
        format!("{}.attributes.{name}", self.place)
    }

    fn same_count(&self, name: &str, found: usize, count: usize) -> Result<()> {
        if found == count {
            return Ok(());
        }
        Err(fail(&self.at(name), format!("has {found} elements, but POSITION {count}")))
    }

    /// Numbers and their count per vertex; of `width` if one is given.
    fn attribute(&self, name: &str, width: Option<usize>) -> Result<Option<(Vec<f32>, usize)>> {
        let Some(&index) = self.primitive.attributes.get(name) else { return Ok(None) };
        let place = self.at(name);
        if let (Some(packed), Some(draco)) = (&self.packed, &self.primitive.extensions.draco)
            && let Some(&id) = draco.attributes.get(name)
        {
            let Some(accessor) = self.source.root.accessors.get(index) else {
                return Err(fail(&place, format!("there is no accessors[{index}]")));
            };
            let found = match accessor.kind.as_str() {
                "VEC2" => 2,
                "VEC3" => 3,
                "VEC4" => 4,
                _ => 1,
            };
            let width = width.unwrap_or(found);
            self.source.budget.take(packed.points() as u64 * width as u64 * 4, &place)?;
            let values = packed.attribute(id, width, accessor.normalized);
            let values =
                values.ok_or_else(|| fail(&place, format!("the compressed data has no attribute {id}")))?;
            if values.iter().any(|v| !v.is_finite()) {
                return Err(fail(&place, "holds a number that is not finite"));
            }
            return Ok(Some((values, width)));
        }
        match width {
            Some(2) => Ok(Some((self.source.vectors::<2>(index, &place)?.into_flattened(), 2))),
            Some(3) => Ok(Some((self.source.vectors::<3>(index, &place)?.into_flattened(), 3))),
            Some(4) => Ok(Some((self.source.vectors::<4>(index, &place)?.into_flattened(), 4))),
            _ => self.source.flat(index, &place).map(Some),
        }
    }

    fn need<const N: usize>(&self, name: &str) -> Result<Vec<[f32; N]>> {
        let (flat, _) = self.attribute(name, Some(N))?.unwrap_or_default();
        Ok(flat.chunks_exact(N).map(|c| std::array::from_fn(|i| c[i])).collect())
    }

    /// As many as there are vertices, or none.
    fn maybe<const N: usize>(&self, name: &str, count: usize) -> Result<Vec<[f32; N]>> {
        let found = self.need::<N>(name)?;
        if !found.is_empty() {
            self.same_count(name, found.len(), count)?;
        }
        Ok(found)
    }
}

/// Weights that sum to one; all on the first joint where they sum to nothing.
fn normalise(joints: &mut [(u32, f32)]) {
    let sum: f32 = joints.iter().map(|(_, w)| w).sum();
    if sum > 0.0 && sum.is_finite() {
        joints.iter_mut().for_each(|(_, w)| *w /= sum);
    } else if let Some((_, w)) = joints.first_mut() {
        *w = 1.0;
    }
}

impl Geometry {
    /// Makes the vertices anew: new vertex i is a copy of old vertex `of[i]`.
    pub fn remap(&mut self, of: &[u32]) {
        fn pick<T: Copy>(values: &mut Vec<T>, of: &[u32], per: usize) {
            if !values.is_empty() {
                *values = of
                    .iter()
                    .flat_map(|i| &values[*i as usize * per..(*i as usize + 1) * per])
                    .copied()
                    .collect();
            }
        }
        let mesh = &mut self.mesh;
        pick(&mut mesh.positions, of, 1);
        pick(&mut mesh.normals, of, 1);
        pick(&mut mesh.uvs, of, 1);
        pick(&mut mesh.tangents, of, 1);
        for attribute in &mut mesh.attributes {
            pick(&mut attribute.values, of, attribute.channels as usize);
        }
        pick(&mut self.joints, of, self.per_vertex);
        for target in &mut self.targets {
            pick(&mut target.positions, of, 1);
            pick(&mut target.normals, of, 1);
            pick(&mut target.tangents, of, 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans() {
        assert_eq!(triangles(&[0, 1, 2, 3, 4], 5), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(&[0, 1, 2, 2, 3], 5), [[0, 1, 2]]);
        assert_eq!(triangles(&[0, 1, 2, 3], 6), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(&[0, 1, 2, 3], 4), [[0, 1, 2]]);
        assert!(triangles(&[0], 6).is_empty() && triangles(&[], 6).is_empty());
    }

    #[test]
    fn weights_sum_to_one() {
        let mut joints = [(0, 1.0), (1, 3.0)];
        normalise(&mut joints);
        assert_eq!(joints, [(0, 0.25), (1, 0.75)]);
        let mut none = [(4, 0.0), (1, 0.0)];
        normalise(&mut none);
        assert_eq!(none, [(4, 1.0), (1, 0.0)]);
    }
}
