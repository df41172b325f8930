//! Meshes: vertices to world space, vertex normals, the cube.

use super::triangle;
use crate::desc::Mesh;
use crate::math::{DVec3, Transform, Vec2, Vec3};

/// Normals of a file in world space: by the inverse transpose, normalised.
/// Those that are zero or not finite become zero, which means "none".
pub fn transform_normals(normals: &[Vec3], to_world: &Transform) -> Vec<Vec3> {
    normals
        .iter()
        .map(|n| to_world.normal(n.as_dvec3()).try_normalize().unwrap_or(DVec3::ZERO).as_vec3())
        .collect()
}

/// Vertex normals of a mesh that has none: the mean of the normals of the
/// faces around, weighted by their angle there (Thürmer and Wüthrich 1998), as
/// Mitsuba's mesh readers do. Zero for vertices without a face.
pub fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for indices in triangles {
        let vertices = indices.map(|i| positions[i as usize]);
        let Some(normal) = triangle::cross(&vertices).try_normalize() else { continue };
        for corner in 0..3 {
            let at = |k: usize| vertices[(corner + k) % 3].as_dvec3();
            let (a, b) = (at(1) - at(0), at(2) - at(0));
            let angle = a.cross(b).length().atan2(a.dot(b));
            sums[indices[corner] as usize] += normal * angle;
        }
    }
    sums.iter().map(|n| n.try_normalize().unwrap_or(DVec3::ZERO).as_vec3()).collect()
}

/// The cube [-1, 1]³: 24 vertices, so that every face has its own normal and
/// its own uv square, laid out as in Mitsuba.
pub fn cube() -> Mesh {
    // Per face: normal, and the vectors along which u and v grow.
    const FACES: [[Vec3; 3]; 6] = [
        [Vec3::NEG_Y, Vec3::Z, Vec3::X],
        [Vec3::Y, Vec3::NEG_X, Vec3::NEG_Z],
        [Vec3::X, Vec3::Y, Vec3::NEG_Z],
        [Vec3::Z, Vec3::Y, Vec3::X],
        [Vec3::NEG_X, Vec3::Y, Vec3::Z],
        [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X],
    ];
    let mut mesh = Mesh::default();
    for [normal, u, v] in FACES {
        let first = mesh.positions.len() as u32;
        for (x, y) in [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)] {
            mesh.positions.push(normal + u * (2.0 * x - 1.0) + v * (2.0 * y - 1.0));
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::new(x, y));
        }
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.triangles.push([first + 3, first, first + 2]);
    }
    mesh
}
