//! Tangents as the specification asks for where the file has none: MikkTSpace
//! (Mikkelsen 2008), by the crate `bevy_mikktspace`.
//!
//! The texture coordinates of glTF grow downwards in the image while the green
//! of a normal map points up, so the sign that MikkTSpace gives is turned.

use bevy_mikktspace::{Geometry as Faces, TangentSpace, generate_tangents};

use super::geometry::{Geometry, uv_attribute};
use crate::math::{Vec2, Vec3, Vec4};

/// What MikkTSpace reads and writes, corner by corner.
struct Corners<'a> {
    geometry: &'a Geometry,
    uvs: &'a [Vec2],
    /// Three per triangle.
    normals: Vec<Vec3>,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.geometry.mesh.triangles[face][corner] as usize
    }
}

impl Faces for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.geometry.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.geometry.mesh.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normals[face * 3 + corner].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, corner)].to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let [x, y, z, sign] = space.unwrap_or_default().tangent_encoded();
        self.tangents[face * 3 + corner] = Vec4::new(x, y, z, -sign);
    }
}

/// Gives a primitive tangents along texture coordinates of a set, and flat
/// normals if it has none. Vertices are split where corners differ.
pub fn generate(geometry: &mut Geometry, set: u32) {
    let mesh = &geometry.mesh;
    let uvs: Vec<Vec2> = match set {
        0 => mesh.uvs.clone(),
        set => {
            let name = uv_attribute(set);
            let found = mesh.attributes.iter().find(|a| a.name == name);
            found.map_or(&[][..], |a| &a.values).chunks_exact(2).map(|c| Vec2::new(c[0], c[1])).collect()
        }
    };
    if uvs.len() != mesh.positions.len() {
        return;
    }
    let normals = mesh.triangles.iter().flat_map(|t| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let flat = (b - a).cross(c - a).normalize_or_zero();
        t.map(|i| mesh.normals.get(i as usize).copied().unwrap_or(flat))
    });
    let tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); mesh.triangles.len() * 3];
    let mut corners = Corners { geometry, uvs: &uvs, normals: normals.collect(), tangents };
    // Its error has no case.
    let _ = generate_tangents(&mut corners);
    let Corners { normals, tangents, .. } = corners;
    weld(geometry, &normals, &tangents);
}

/// One vertex for all corners at an old one that have the same normal and
/// tangent.
fn weld(geometry: &mut Geometry, normals: &[Vec3], tangents: &[Vec4]) {
    // For each old vertex the last new one; new ones lead to the one before.
    let mut last: Vec<u32> = vec![u32::MAX; geometry.mesh.positions.len()];
    let (mut of, mut before, mut from) = (Vec::new(), Vec::new(), Vec::new());
    for (face, triangle) in geometry.mesh.triangles.iter_mut().enumerate() {
        for (k, index) in triangle.iter_mut().enumerate() {
            let (old, corner) = (*index as usize, face * 3 + k);
            let mut at = last[old];
            while at != u32::MAX {
                let other: usize = from[at as usize];
                if normals[other] == normals[corner] && tangents[other] == tangents[corner] {
                    break;
                }
                at = before[at as usize];
            }
            if at == u32::MAX {
                at = of.len() as u32;
                of.push(*index);
                from.push(corner);
                before.push(last[old]);
                last[old] = at;
            }
            *index = at;
        }
    }
    geometry.remap(&of);
    geometry.mesh.normals = from.iter().map(|corner| normals[*corner]).collect();
    geometry.mesh.tangents = from.iter().map(|corner| tangents[*corner]).collect();
}
