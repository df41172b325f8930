//! Generated subjects: a displaced surface of any size, and a teapot in a
//! stadium.

use std::f32::consts::TAU;

use super::{Subject, View};
use crate::desc::{Error, Mesh, Result};
use crate::math::{Bounds, DMat4, DVec3, Transform, Vec3};
use crate::shape::{GeometryBuilder, MeshOptions};

/// Vertices alone: shading data would only take memory.
const BARE: MeshOptions = MeshOptions {
    flip_normals: false,
    face_normals: true,
    keep_uvs: false,
    keep_tangents: false,
    shutter: [0.0; 2],
};

/// A closed tunnel: the torus of radii 1 and 0.4, seen from inside, its wall
/// displaced inward by six octaves of noise. The same surface at every
/// resolution. `triangles` is rounded down to a grid of quads; powers of two
/// from 2^4 on are met exactly. Fails below 16 and above 2^30.
pub fn displaced(triangles: usize) -> Result<Subject> {
    if !(16..=1 << 30).contains(&triangles) {
        return Err(Error::new(format!("cannot make a displaced surface of {triangles} triangles"))
            .hint("from 16 to 2^30"));
    }
    let around = 1usize << ((triangles / 4).ilog2() / 2);
    let along = triangles / (2 * around);
    let mut mesh = Mesh::default();
    mesh.positions.reserve_exact(around * along);
    mesh.triangles.reserve_exact(2 * around * along);
    for i in 0..along {
        for j in 0..around {
            mesh.positions.push(tunnel(i as f32 / along as f32, j as f32 / around as f32));
            let at = |i: usize, j: usize| ((i % along) * around + j % around) as u32;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let view = View { origin: Vec3::X, target: Vec3::new(0.8, 0.0, 0.6), half_height: 0.8 };
    subject(&[(&mesh, Transform::IDENTITY)], view)
}

/// The wall of the tunnel at (along, around), both of period 1.
fn tunnel(along: f32, around: f32) -> Vec3 {
    let mut height = 0.0;
    for octave in 0..6 {
        let lattice = [32u32 << octave, 8 << octave];
        height += noise(along * lattice[0] as f32, around * lattice[1] as f32, lattice, octave)
            * 0.5f32.powi(octave as i32);
    }
    let radius = 0.4 * (1.0 - 0.25 * height);
    let (s, c) = (TAU * around).sin_cos();
    let (sa, ca) = (TAU * along).sin_cos();
    let ring = 1.0 + radius * c;
    Vec3::new(ring * ca, radius * s, ring * sa)
}

/// Smooth value noise in [0, 1) that repeats after `period` cells.
fn noise(x: f32, y: f32, period: [u32; 2], seed: u32) -> f32 {
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (ix, iy) = (x.floor(), y.floor());
    let (sx, sy) = (smooth(x - ix), smooth(y - iy));
    let value = |dx: u32, dy: u32| {
        let cell = [(ix as u32 + dx) % period[0], (iy as u32 + dy) % period[1]];
        unit_hash(cell[0], cell[1], seed)
    };
    let row = |dy: u32| value(0, dy) * (1.0 - sx) + value(1, dy) * sx;
    row(0) * (1.0 - sy) + row(1) * sy
}

/// A number in [0, 1) from a lattice point: two rounds of Murmur3's finaliser
/// (Appleby 2011).
fn unit_hash(x: u32, y: u32, seed: u32) -> f32 {
    let mut h = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ seed.wrapping_mul(0xc2b2_ae35);
    for _ in 0..2 {
        h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
        h ^= h >> 16;
    }
    (h >> 8) as f32 * 2f32.powi(-24)
}

/// A mesh, 0.3 m high, in the middle of a stadium of 41,000 large triangles,
/// 140 m long: the case in which a regular grid has all of the mesh in one
/// cell. `mesh` has y up.
pub fn stadium(mesh: &Mesh) -> Result<Subject> {
    let bounds = Bounds::of_points(mesh.positions.iter().copied());
    let height = f64::from(bounds.extent().y);
    if bounds.is_empty() || !(height > 0.0) {
        return Err(Error::new("the mesh for the stadium has no height"));
    }
    let foot = Vec3::new(bounds.centre().x, bounds.min.y, bounds.centre().z).as_dvec3();
    let place = DMat4::from_scale(DVec3::splat(0.3 / height)) * DMat4::from_translation(-foot);
    let place = Transform::from_matrix(place)
        .ok_or_else(|| Error::new("the mesh for the stadium is too large or too small"))?;
    let view =
        View { origin: Vec3::new(0.35, 0.45, 0.9), target: Vec3::new(0.0, 0.17, 0.0), half_height: 0.45 };
    subject(&[(&stands(), Transform::IDENTITY), (mesh, place)], view)
}

/// The floor and forty rows of steps around it.
fn stands() -> Mesh {
    const SEGMENTS: u32 = 256;
    const ROWS: u32 = 40;
    let mut mesh = Mesh::default();
    let ring = |mesh: &mut Mesh, out: f32, height: f32| {
        for i in 0..SEGMENTS {
            let (s, c) = (TAU * i as f32 / SEGMENTS as f32).sin_cos();
            mesh.positions.push(Vec3::new((50.0 + out) * c, height, (35.0 + out) * s));
        }
    };
    ring(&mut mesh, 0.0, 0.0);
    for row in 0..ROWS {
        let (out, height) = (0.8 * row as f32, 0.45 * (row + 1) as f32);
        ring(&mut mesh, out, height);
        ring(&mut mesh, out + 0.8, height);
    }
    for strip in 0..2 * ROWS {
        for i in 0..SEGMENTS {
            let at = |ring: u32, i: u32| ring * SEGMENTS + i % SEGMENTS;
            let [a, b] = [at(strip, i), at(strip, i + 1)];
            let [c, d] = [at(strip + 1, i + 1), at(strip + 1, i)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let first = mesh.positions.len() as u32;
    let corners = [(-50.0, -35.0), (50.0, -35.0), (50.0, 35.0), (-50.0, 35.0)];
    mesh.positions.extend(corners.map(|(x, z)| Vec3::new(x, 0.0, z)));
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh
}

fn subject(meshes: &[(&Mesh, Transform)], view: View) -> Result<Subject> {
    let mut builder = GeometryBuilder::new();
    for (mesh, place) in meshes {
        builder.add_mesh(mesh, place, BARE)?;
    }
    Ok(Subject::Geometry { geometry: builder.finish(), view })
}

impl Subject {
    /// A bare mesh, framed.
    pub fn mesh(mesh: &Mesh) -> Result<Subject> {
        let bounds = Bounds::of_points(mesh.positions.iter().copied());
        subject(&[(mesh, Transform::IDENTITY)], View::framing(bounds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_displaced_surface_is_closed_and_as_large_as_asked() {
        for power in [4, 5, 10, 13] {
            let subject = displaced(1 << power).unwrap();
            assert_eq!(subject.geometry().triangle_count(), 1 << power);
        }
        // Every directed edge has its opposite.
        let subject = displaced(1 << 10).unwrap();
        let geometry = subject.geometry();
        let mut edges = std::collections::BTreeSet::new();
        for prim in 0..geometry.triangle_count() {
            let v = geometry.triangle(prim).unwrap().map(|v| v.to_array().map(f32::to_bits));
            for k in 0..3 {
                assert!(edges.insert((v[k], v[(k + 1) % 3])));
            }
        }
        assert_eq!(edges.len(), 3 << 10);
        assert!(edges.iter().all(|(a, b)| edges.contains(&(*b, *a))));
        assert!(displaced(8).is_err());
    }
}
