//! What the geometry tests share: random numbers and meshes.
#![allow(dead_code, reason = "every test file uses some of it")]

use etendue::desc::Mesh;
use etendue::math::{Transform, Vec2, Vec3};
use etendue::shape::{Geometry, GeometryBuilder, MeshOptions};

/// PCG-XSH-RR 64/32 (O'Neill 2014), fixed seeds.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0xda3e_39cb_94b9_5bdb);
        random.next();
        random
    }

    pub fn next(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32)
    }

    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.next()) * u64::from(n)) >> 32) as u32
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 8) as f32 * 2f32.powi(-24)
    }

    pub fn pair(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }

    /// Each coordinate uniform in [-1, 1).
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// A uniform unit vector.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector();
            let l = v.length_squared();
            if l > 1e-4 && l < 1.0 {
                return v.normalize();
            }
        }
    }

    /// 10 to a uniform power in ±`range`, of either sign.
    pub fn log_uniform(&mut self, range: f32) -> f32 {
        let sign = if self.next() & 1 == 0 { 1.0 } else { -1.0 };
        sign * 10f32.powf((self.unit() * 2.0 - 1.0) * range)
    }
}

/// A mesh of separate triangles.
pub fn mesh_of(corners: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: corners.iter().flatten().copied().collect(),
        triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    }
}

/// Random triangles around the origin.
pub fn soup(random: &mut Random, count: u32, size: f32) -> Mesh {
    let corners: Vec<[Vec3; 3]> = (0..count)
        .map(|_| {
            let centre = random.vector();
            [(); 3].map(|()| centre + random.vector() * size)
        })
        .collect();
    mesh_of(&corners)
}

pub fn single_mesh(mesh: &Mesh) -> Geometry {
    let mut builder = GeometryBuilder::new();
    builder.add_mesh(mesh, &Transform::IDENTITY, MeshOptions::default()).unwrap();
    builder.finish()
}

/// A closed sphere of latitude rings.
pub fn sphere_mesh(rings: u32, segments: u32, radius: f32, centre: Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.positions.push(centre + Vec3::Z * radius);
    for ring in 1..rings {
        let (s, c) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
        for segment in 0..segments {
            let (sp, cp) = (std::f32::consts::TAU * segment as f32 / segments as f32).sin_cos();
            mesh.positions.push(centre + Vec3::new(s * cp, s * sp, c) * radius);
        }
    }
    mesh.positions.push(centre - Vec3::Z * radius);
    let last = mesh.positions.len() as u32 - 1;
    let at = |ring: u32, segment: u32| 1 + (ring - 1) * segments + segment % segments;
    for s in 0..segments {
        mesh.triangles.push([0, at(1, s), at(1, s + 1)]);
        mesh.triangles.push([last, at(rings - 1, s + 1), at(rings - 1, s)]);
        for ring in 1..rings - 1 {
            mesh.triangles.push([at(ring, s), at(ring + 1, s), at(ring + 1, s + 1)]);
            mesh.triangles.push([at(ring, s), at(ring + 1, s + 1), at(ring, s + 1)]);
        }
    }
    mesh
}

/// A square of 2·n² triangles with bumps at every scale.
pub fn displaced(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..=n {
        for x in 0..=n {
            let (u, v) = (x as f32 / n as f32 * 2.0 - 1.0, y as f32 / n as f32 * 2.0 - 1.0);
            let (mut height, mut size, mut frequency) = (0.0, 0.2, 3.0);
            for octave in 0..8 {
                let shift = octave as f32 * 1.7;
                let across = (v * frequency + shift).cos();
                height += size * (u * frequency + shift + 0.5 * across).sin() * across;
                (size, frequency) = (size * 0.5, frequency * 2.1);
            }
            mesh.positions.push(Vec3::new(u, v, height));
        }
    }
    for y in 0..n {
        for x in 0..n {
            let i = y * (n + 1) + x;
            mesh.triangles.extend([[i, i + 1, i + n + 2], [i, i + n + 2, i + n + 1]]);
        }
    }
    mesh
}
