//! Meshes made in code, and their files.

use crate::desc::Mesh;
use crate::math::Vec3;

/// A mesh as a PLY file (binary, little-endian) that any renderer reads.
pub(super) fn ply(mesh: &Mesh) -> Vec<u8> {
    let normals = !mesh.normals.is_empty();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\n",
        mesh.positions.len()
    );
    if normals {
        out += "property float nx\nproperty float ny\nproperty float nz\n";
    }
    out += &format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.triangles.len()
    );
    let mut bytes = out.into_bytes();
    let mut put = |v: Vec3| v.to_array().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    for (i, p) in mesh.positions.iter().enumerate() {
        put(*p);
        if normals {
            put(mesh.normals[i]);
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        triangle.iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    }
    bytes
}

/// A sphere of `rings` × `segments` quads cut in two, with its own normals if
/// `smooth`, facing outward.
pub(super) fn sphere(rings: u32, segments: u32, radius: f32, centre: Vec3, smooth: bool) -> Mesh {
    let direction = |ring: u32, segment: u32| {
        let theta = f64::from(ring) / f64::from(rings) * std::f64::consts::PI;
        // The last column is the first, bit for bit.
        let phi = f64::from(segment % segments) / f64::from(segments) * std::f64::consts::TAU;
        let s = if ring == 0 || ring == rings { 0.0 } else { theta.sin() };
        Vec3::new((s * phi.cos()) as f32, (s * phi.sin()) as f32, theta.cos() as f32)
    };
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        for segment in 0..segments {
            let d = direction(ring, segment);
            mesh.positions.push(centre + d * radius);
            if smooth {
                mesh.normals.push(d);
            }
        }
    }
    for ring in 0..rings {
        for segment in 0..segments {
            let at = |r: u32, s: u32| r * segments + s % segments;
            let [a, b, c, d] =
                [at(ring, segment), at(ring + 1, segment), at(ring + 1, segment + 1), at(ring, segment + 1)];
            if ring + 1 < rings {
                mesh.triangles.push([a, b, c]);
            }
            if ring > 0 {
                mesh.triangles.push([a, c, d]);
            }
        }
    }
    mesh
}
