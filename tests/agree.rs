//! Every accelerator against brute force, bit for bit: closest hits and
//! occlusion, over soups, needles, duplicates, analytic shapes and rays chosen
//! to be awkward; scenes scaled by powers of two; trees built by any number of
//! threads.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common_shape;

use common_shape::{Random, displaced, mesh_of, single_mesh, soup};
use etendue::accel::{Accel, Bvh2, Bvh8, Quality};
use etendue::desc::{Curves, Mesh};
use etendue::math::{DMat4, DQuat, DVec3, Ray, Transform, Vec3};
use etendue::shape::{CurveKind, Geometry, GeometryBuilder, Hit, MeshOptions};

fn bits(hit: Option<Hit>) -> Option<(u32, u32, u32, u32)> {
    hit.map(|h| (h.t.to_bits(), h.prim, h.u.to_bits(), h.v.to_bits()))
}

/// Compares all kinds on one ray and says whether it hit.
fn compare(kinds: &[Accel], geometry: &Geometry, ray: &Ray) -> bool {
    let expected = kinds[0].closest(geometry, ray);
    let shadow = kinds[0].occluded(geometry, ray);
    assert_eq!(shadow, expected.is_some(), "{ray:?}");
    for accel in &kinds[1..] {
        let found = accel.closest(geometry, ray);
        assert_eq!(bits(found), bits(expected), "{} {ray:?}\n{found:?}\n{expected:?}", accel.name());
        assert_eq!(accel.occluded(geometry, ray), shadow, "{} {ray:?}", accel.name());
    }
    shadow
}

fn kinds(geometry: &Geometry) -> Vec<Accel> {
    let mut kinds: Vec<Accel> =
        Accel::NAMES.iter().map(|n| Accel::build_named(Some(n), geometry).unwrap()).collect();
    kinds.push(Bvh2::new(geometry).unwrap().portable().into());
    kinds.push(Bvh8::new(geometry, Quality::High).unwrap().portable().into());
    kinds.push(Bvh8::new(geometry, Quality::Fast).unwrap().into());
    assert_eq!(kinds[0].name(), "brute");
    kinds
}

/// Rays of all sorts around a scene of a given size.
fn rays(random: &mut Random, geometry: &Geometry, count: usize) -> Vec<Ray> {
    let bounds = geometry.bounds();
    let (centre, radius) = bounds.bounding_sphere();
    let mut rays = Vec::new();
    for i in 0..count {
        let origin = centre + random.vector() * radius * 1.5;
        let prim = random.below(geometry.prim_count());
        let target = match geometry.triangle(prim) {
            Some(v) => match i % 4 {
                0 => v[0],
                1 => v[0] * 0.5 + v[1] * 0.5,
                2 => v[0] * 0.2 + v[1] * 0.3 + v[2] * 0.5,
                _ => centre + random.vector() * radius,
            },
            None => centre + random.vector() * radius,
        };
        let mut dir = target - origin;
        let mut ray = Ray::new(origin, dir);
        match i % 8 {
            // Along an axis, with zeros of both signs.
            1 => {
                dir = Vec3::ZERO;
                dir[i / 8 % 3] = if i % 16 < 8 { 1.0 } else { -1.0 };
                dir[(i / 8 + 1) % 3] = -0.0;
                ray = Ray::new(target - dir * radius, dir);
            }
            // In a coordinate plane.
            2 => {
                dir[i / 8 % 3] = 0.0;
                ray = Ray::new(origin, dir);
            }
            // From a vertex.
            3 => ray.origin = target,
            // Shadow rays that end at or near the target.
            4 => ray.t_max = 1.0,
            5 => ray.t_max = 1.0 + f32::EPSILON * 4.0,
            6 => {
                ray.skip = prim;
                ray.skip_end = random.below(geometry.prim_count());
            }
            _ => ray.dir = dir.normalize_or(Vec3::X),
        }
        rays.push(ray);
    }
    rays
}

fn check(name: &str, geometry: &Geometry, count: usize, seed: u64) {
    let kinds = kinds(geometry);
    let mut random = Random::new(seed);
    let rays = rays(&mut random, geometry, count);
    let hits = rays.iter().filter(|ray| compare(&kinds, geometry, ray)).count();
    assert!(hits * 20 > count, "{name}: only {hits} of {count} rays hit");
    assert!(hits < count, "{name}: all rays hit");
}

#[test]
fn triangle_soups_of_all_sizes_agree() {
    for (seed, count) in [1u32, 2, 3, 4, 5, 7, 16, 100, 1000].into_iter().enumerate() {
        let mesh = soup(&mut Random::new(seed as u64), count, 0.3);
        check("soup", &single_mesh(&mesh), 2000, 10 + seed as u64);
    }
}

#[test]
fn needles_and_flat_grids_agree() {
    let mut random = Random::new(3);
    let mut needles = soup(&mut random, 300, 1.0);
    for t in &needles.triangles {
        let [a, b, c] = t.map(|i| i as usize);
        let along = needles.positions[b] - needles.positions[a];
        needles.positions[c] = needles.positions[a] + along * 0.5 + random.vector() * 1e-6;
    }
    check("needles", &single_mesh(&needles), 4000, 4);

    // An axis-aligned grid: boxes without thickness, coplanar neighbours.
    let mut grid = Mesh::default();
    for y in 0..=12 {
        for x in 0..=12 {
            grid.positions.push(Vec3::new(x as f32, y as f32, 5.0));
        }
    }
    for y in 0..12 {
        for x in 0..12 {
            let i = y * 13 + x;
            grid.triangles.extend([[i, i + 1, i + 14], [i, i + 14, i + 13]]);
        }
    }
    check("grid", &single_mesh(&grid), 4000, 5);
}

#[test]
fn coincident_surfaces_give_the_lowest_id() {
    let mut random = Random::new(6);
    let mesh = soup(&mut random, 60, 0.5);
    let mut builder = GeometryBuilder::new();
    for _ in 0..5 {
        builder.add_mesh(&mesh, &Transform::IDENTITY, MeshOptions::default()).unwrap();
    }
    for _ in 0..3 {
        builder.add_sphere(DVec3::splat(0.3), 0.4, &Transform::IDENTITY, false).unwrap();
        builder.add_rectangle(&Transform::IDENTITY, false).unwrap();
    }
    let geometry = builder.finish();
    check("duplicates", &geometry, 4000, 7);
    let bvh = Bvh2::new(&geometry).unwrap();
    let accel: Accel = bvh.into();
    for ray in rays(&mut random, &geometry, 2000).iter().filter(|r| r.skip == Ray::NO_SKIP) {
        if let Some(hit) = accel.closest(&geometry, ray) {
            let first_copy =
                if hit.prim < geometry.triangle_count() { hit.prim < 60 } else { hit.prim < 302 };
            assert!(first_copy, "{hit:?}");
        }
    }
}

fn mixed(scale: f64, at: DVec3) -> Geometry {
    let mut random = Random::new(8);
    let mut builder = GeometryBuilder::new();
    let place = |s: DVec3, r: f64, p: DVec3| {
        let rotation = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), r);
        let local = DMat4::from_scale_rotation_translation(s, rotation, p);
        Transform::from_matrix(DMat4::from_scale(DVec3::splat(scale)) * DMat4::from_translation(at) * local)
            .unwrap()
    };
    for _ in 0..12 {
        let p = random.vector().as_dvec3();
        let angle = f64::from(random.unit()) * 6.0;
        builder.add_sphere(p, 0.2, &place(DVec3::ONE, 0.0, p), false).unwrap();
        builder.add_disk(&place(DVec3::new(0.3, 0.2, 1.0), angle, p), false).unwrap();
        builder.add_rectangle(&place(DVec3::new(0.1, 0.4, 1.0), angle, -p), true).unwrap();
        builder.add_cylinder([p, -p * 0.5], 0.1, &place(DVec3::ONE, angle, p), false).unwrap();
        builder.add_cube(&place(DVec3::splat(0.1), angle, p), MeshOptions::default()).unwrap();
    }
    // Radii of curves are not scaled by what places them.
    let points: Vec<[f32; 4]> =
        (0..24).map(|_| random.vector().extend(0.12 * random.unit() * scale as f32).to_array()).collect();
    let curves = Curves { points, ends: vec![5, 13, 24] };
    for kind in [CurveKind::Linear, CurveKind::BSpline] {
        builder.add_curves(kind, &curves, &place(DVec3::ONE, 0.4, DVec3::ZERO)).unwrap();
    }
    builder.finish()
}

#[test]
fn all_shapes_together_agree_near_and_far() {
    check("mixed", &mixed(1.0, DVec3::ZERO), 6000, 9);
    check("mixed far", &mixed(1.0, DVec3::new(148_376.0, 1234.0, -223_423.0)), 3000, 10);
    check("mixed tiny", &mixed(1e-9, DVec3::ZERO), 3000, 11);
    check("mixed huge", &mixed(1e9, DVec3::ZERO), 3000, 12);
}

/// Scene and rays times 2^k: the same primitives and barycentrics, distances
/// times 2^k, and the same surface points times 2^k, all bit for bit.
#[test]
fn scenes_scaled_by_powers_of_two_are_the_same() {
    let unit = mixed(1.0, DVec3::new(0.1, 0.2, 0.3));
    let accel = Accel::build_named(None, &unit).unwrap();
    let rays = rays(&mut Random::new(13), &unit, 2000);
    for k in [-40, -17, 9, 40] {
        let factor = 2f32.powi(k);
        let scaled = mixed(2f64.powi(k), DVec3::new(0.1, 0.2, 0.3));
        let scaled_accel = Accel::build_named(None, &scaled).unwrap();
        let mut hits = 0;
        for ray in &rays {
            // Unit directions keep their length, vectors between points scale.
            let vector = ray.t_max.is_finite() || (ray.dir.length() - 1.0).abs() > 1e-3;
            let dir = if vector { ray.dir * factor } else { ray.dir };
            let t_factor = if vector { 1.0 } else { factor };
            let big = Ray { origin: ray.origin * factor, dir, ..*ray };
            let (a, b) = (accel.closest(&unit, ray), scaled_accel.closest(&scaled, &big));
            assert_eq!(bits(a.map(|h| Hit { t: h.t * t_factor, ..h })), bits(b), "2^{k} {ray:?}");
            let (Some(a), Some(b)) = (a, b) else { continue };
            let (p, q) = (unit.surface(ray, &a), scaled.surface(&big, &b));
            assert_eq!((p.p * factor, p.p_error * factor), (q.p, q.p_error));
            assert_eq!((p.ng, p.ns, p.uv), (q.ng, q.ns, q.uv));
            hits += 1;
        }
        assert!(hits > 500, "{hits} hits");
    }
}

#[test]
fn empty_scenes_and_rays_that_are_none_hit_nothing() {
    let empty = GeometryBuilder::new().finish();
    for accel in kinds(&empty) {
        assert!(accel.bounds().is_empty());
        assert_eq!(accel.closest(&empty, &Ray::new(Vec3::ZERO, Vec3::X)), None);
    }
    let geometry = single_mesh(&soup(&mut Random::new(14), 50, 1.0));
    let good = Ray::new(Vec3::new(0.0, 0.0, -4.0), Vec3::Z);
    let mut count = 0;
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let mut ray = good;
            ray.origin[axis] = bad;
            let mut turned = good;
            turned.dir[axis] = bad;
            for accel in kinds(&geometry) {
                for ray in [ray, turned] {
                    assert_eq!(accel.closest(&geometry, &ray), None);
                    assert!(!accel.occluded(&geometry, &ray));
                    count += 1;
                }
            }
        }
    }
    let kinds = kinds(&geometry);
    for accel in &kinds {
        for ray in [
            Ray { dir: Vec3::ZERO, ..good },
            Ray { t_max: f32::NAN, ..good },
            Ray { t_max: 0.0, ..good },
            Ray { t_max: -1.0, ..good },
        ] {
            assert_eq!(accel.closest(&geometry, &ray), None);
            count += 1;
        }
    }
    assert_eq!(count, (3 * 3 * 2 + 4) * kinds.len());
}

#[test]
fn unknown_accelerators_are_named() {
    let error = Accel::build_named(Some("bvh22"), &GeometryBuilder::new().finish()).unwrap_err();
    assert_eq!(error.to_string(), "unknown accelerator `bvh22`; did you mean `bvh2`?");
}

/// The same tree whatever the number of threads, on a mesh large enough for
/// parallel bins.
#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    let geometry = single_mesh(&soup(&mut Random::new(15), 80_000, 0.01));
    let trees: Vec<[String; 3]> = [1, 2, 7]
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let bvh2 = pool.install(|| Bvh2::new(&geometry)).unwrap();
            let bvh8 = |quality| {
                let bvh = pool.install(|| Bvh8::new(&geometry, quality)).unwrap();
                format!("{} {:?}", bvh.fingerprint(), Accel::from(bvh).stats())
            };
            let fingerprint = format!("{} {:?}", bvh2.fingerprint(), Accel::from(bvh2).stats());
            [fingerprint, bvh8(Quality::Fast), bvh8(Quality::High)]
        })
        .into();
    assert_ne!(trees[0][1], trees[0][2], "the optimiser did nothing");
    assert_eq!(trees[0], trees[1]);
    assert_eq!(trees[0], trees[2]);
}

/// Meshes too large to try every ray by brute force: the binary tree speaks for
/// it on most of them.
#[test]
fn large_meshes_agree() {
    for (n, seed) in [(60, 18), (300, 19)] {
        let geometry = single_mesh(&displaced(n));
        let mut kinds = kinds(&geometry);
        let mut random = Random::new(seed);
        for ray in rays(&mut random, &geometry, 300) {
            compare(&kinds, &geometry, &ray);
        }
        kinds.remove(0);
        let rays = rays(&mut random, &geometry, 6000);
        let hits = rays.iter().filter(|ray| compare(&kinds, &geometry, ray)).count();
        assert!(hits > 1500, "{hits} hits");
    }
}

/// Memory grows with the number of triangles and no faster.
#[test]
fn memory_per_triangle_is_constant() {
    for (quality, most) in [(Quality::Fast, 64.0), (Quality::High, 70.0)] {
        let bytes = [32, 128, 512].map(|n| {
            let geometry = single_mesh(&displaced(n));
            let accel: Accel = Bvh8::new(&geometry, quality).unwrap().into();
            accel.memory_bytes() as f64 / f64::from(geometry.triangle_count())
        });
        assert!(bytes.iter().all(|b| *b < most && (b / bytes[0] - 1.0).abs() < 0.1), "{quality:?} {bytes:?}");
    }
}

/// Centres that coincide and centres spaced by powers of two: depth is bounded
/// and the answer is right.
#[test]
fn hostile_distributions_agree() {
    let mut random = Random::new(16);
    let mut same = soup(&mut random, 200, 1.0);
    for t in &same.triangles {
        let centre = t.iter().map(|i| same.positions[*i as usize]).sum::<Vec3>() / 3.0;
        t.iter().for_each(|i| same.positions[*i as usize] -= centre);
    }
    check("concentric", &single_mesh(&same), 3000, 17);

    let corners: Vec<[Vec3; 3]> = (0..200)
        .map(|i| {
            let s = 2f32.powf(i as f32 * 0.5 - 50.0);
            [Vec3::new(s, 0.0, 0.0), Vec3::new(s, s, 0.0), Vec3::new(s, 0.0, s)]
        })
        .collect();
    let geometry = single_mesh(&mesh_of(&corners));
    let kinds = kinds(&geometry);
    assert!(kinds[1].stats().depth <= 81);
    let mut hits = 0;
    for _ in 0..3000 {
        let s = 2f32.powf(random.unit() * 100.0 - 50.0);
        let target = Vec3::new(s, s * random.unit(), s * random.unit());
        let ray = Ray::new(Vec3::new(0.0, s * 0.1, s * 0.1), target);
        hits += usize::from(compare(&kinds, &geometry, &ray));
    }
    assert!(hits > 1000);
}
