//! Rays that try geometry: from inside closed bodies, away from convex ones,
//! through gaps. Each gives cases: what, how many times it went wrong, of how
//! many tries. Zero is right everywhere.

use crate::accel::Accel;
use crate::desc::Mesh;
use crate::math::{DQuat, DVec3, Ray, Transform, Vec3};
use crate::shape::{Geometry, GeometryBuilder, MeshOptions, SurfacePoint};

/// A case, how often it went wrong, and of how many tries.
pub(super) type Cases = Vec<(String, f64, u64)>;

/// SplitMix64 (Steele, Lea, Flood 2014), fixed seeds.
pub(super) struct Random(pub u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(super) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 * 2f32.powi(-24)
    }

    pub(super) fn below(&mut self, n: u32) -> u32 {
        (((self.next() >> 32) * u64::from(n)) >> 32) as u32
    }

    /// Each coordinate uniform in [-1, 1).
    pub(super) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub(super) fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector();
            if (1e-4..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    /// 10 to a uniform power in ±`range`, of either sign.
    pub(super) fn log_uniform(&mut self, range: f32) -> f32 {
        let x = 10f32.powf((self.unit() * 2.0 - 1.0) * range);
        if self.next() & 1 == 0 { x } else { -x }
    }
}

/// Every accelerator that the program has.
pub(super) fn all(geometry: &Geometry) -> Vec<Accel> {
    Accel::NAMES.iter().filter_map(|name| Accel::build_named(Some(name), geometry).ok()).collect()
}

/// How many rays an accelerator is given: brute force takes its time.
pub(super) fn share(accel: &Accel, geometry: &Geometry, rays: u64) -> u64 {
    let slow = accel.name() == "brute" && geometry.prim_count() > 64;
    if slow { (rays / u64::from(geometry.prim_count())).clamp(30, 100_000) } else { rays }
}

pub(super) fn mesh_of(corners: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: corners.iter().flatten().copied().collect(),
        triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    }
}

/// Meshes in one geometry, those that cannot be added left out.
pub(super) fn geometry_of(meshes: &[Mesh]) -> Geometry {
    let mut builder = GeometryBuilder::new();
    for mesh in meshes {
        let _ = builder.add_mesh(mesh, &Transform::IDENTITY, MeshOptions::default());
    }
    builder.finish()
}

/// A closed sphere of latitude rings: 2 · segments · (rings - 1) triangles.
pub(super) fn sphere(rings: u32, segments: u32, radius: f32, centre: Vec3) -> Mesh {
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

/// Rays from inside a closed mesh, anywhere, at vertices and at edges: those
/// that meet nothing, for each accelerator.
pub(super) fn leaks(
    what: &str,
    geometry: &Geometry,
    rays: u64,
    origin: impl Fn(&mut Random) -> Vec3,
    rows: &mut Cases,
) {
    for accel in all(geometry) {
        let count = share(&accel, geometry, rays / 3);
        for (k, aim) in ["anywhere", "at vertices", "at edges"].into_iter().enumerate() {
            let mut random = Random(k as u64);
            let mut misses = 0;
            for i in 0..count {
                let origin = origin(&mut random);
                let Some(corners) = geometry.triangle(random.below(geometry.triangle_count())) else {
                    continue;
                };
                let w = random.unit();
                let dir = match k {
                    0 => random.direction(),
                    1 => corners[i as usize % 3] - origin,
                    // Relative to the origin first: far away the sum would round to it.
                    _ => {
                        let [a, b] = [i, i + 1].map(|k| corners[k as usize % 3] - origin);
                        a * w + b * (1.0 - w)
                    }
                };
                misses += u64::from(accel.closest(geometry, &Ray::new(origin, dir)).is_none());
            }
            rows.push((format!("{what}, {aim}, {}", accel.name()), misses as f64, count));
        }
    }
}

/// What a ray from a point meets when it is sent near a vertex, near an edge or
/// to the middle of a triangle, by turns: its corners and the surface there.
pub(super) fn hit_near(
    geometry: &Geometry,
    accel: &Accel,
    turn: u64,
    origin: Vec3,
    random: &mut Random,
) -> Option<([Vec3; 3], SurfacePoint)> {
    let [a, b, c] = geometry.triangle(random.below(geometry.triangle_count()))?;
    let w = random.unit();
    let near = match turn % 3 {
        0 => a + (b - a) * 1e-5 + (c - a) * 1e-5,
        1 => a * w + b * (1.0 - w) + (c - a) * 1e-5,
        _ => (a + b + c) / 3.0,
    };
    let ray = Ray::new(origin, near - origin);
    let hit = accel.closest(geometry, &ray)?;
    Some((geometry.triangle(hit.prim)?, geometry.surface(&ray, &hit)))
}

/// Hits a convex body from outside, near vertices, near edges and in the middle
/// of faces, and leaves it outward: what meets anything again.
pub(super) fn met_again(
    what: &str,
    geometry: &Geometry,
    rays: u64,
    from: impl Fn(&mut Random) -> Vec3,
    rows: &mut Cases,
) {
    for accel in all(geometry) {
        let count = share(&accel, geometry, rays);
        let mut random = Random(7);
        let (mut again, mut tried) = (0, 0);
        for i in 0..count {
            let origin = from(&mut random);
            let Some((_, surface)) = hit_near(geometry, &accel, i, origin, &mut random) else { continue };
            let dir = random.direction();
            let dir = if dir.dot(surface.ng) < 0.0 { -dir } else { dir };
            again += u64::from(accel.closest(geometry, &surface.spawn(dir)).is_some());
            tried += 1;
        }
        rows.push((format!("{what}, {}", accel.name()), again as f64, tried));
    }
}

/// A square of half-size `size` whose normal is `turn`ed z, at `at`.
pub(super) fn square(at: Vec3, turn: DQuat, size: f32) -> Mesh {
    let corner = |x: f64, y: f64| (turn * DVec3::new(x, y, 0.0) * f64::from(size)).as_vec3() + at;
    Mesh {
        positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Two tilted squares a gap apart: rays that leave the lower one upward and do
/// not meet the upper one, and shadow rays through it.
pub(super) fn gap_leaks(what: &str, at: Vec3, [gap, size]: [f32; 2], rays: u64, rows: &mut Cases) {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.6);
    let up = (turn * DVec3::Z).as_vec3();
    let geometry = geometry_of(&[square(at, turn, size), square(at + up * gap, turn, size)]);
    for accel in all(&geometry) {
        let mut random = Random(5);
        let (mut leaks, mut tried) = (0, 0);
        for _ in 0..rays {
            let local = DVec3::new(f64::from(random.unit()) - 0.5, f64::from(random.unit()) - 0.5, 0.0);
            let target = at + (turn * local * f64::from(size)).as_vec3();
            let below = Ray::new(target - up * size, up);
            let Some(hit) = accel.closest(&geometry, &below) else { continue };
            if hit.prim > 1 {
                continue;
            }
            let surface = geometry.surface(&below, &hit);
            let lean = Vec3::new(random.unit() - 0.5, random.unit() - 0.5, 1.0).as_dvec3();
            let dir = (turn * lean).normalize().as_vec3();
            // What is near enough to be left through a gap as wide as the squares is no leak.
            let lower = local.abs().max_element() * f64::from(size) + f64::from(gap);
            if lower >= f64::from(size) {
                continue;
            }
            leaks += u64::from(accel.closest(&geometry, &surface.spawn(dir)).is_none());
            let shadow = surface.spawn_to_point(surface.p + dir * (size.max(gap) * 4.0));
            leaks += u64::from(!accel.occluded(&geometry, &shadow));
            tried += 2;
        }
        rows.push((format!("{what}, {}", accel.name()), leaks as f64, tried));
    }
}
