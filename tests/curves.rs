//! Curves: surfaces are those of Mitsuba, hits lie on what a dense mesh of the
//! same curve has, within their error and their boxes; nothing is met twice and
//! nothing passes between two segments; what cannot be is an error.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common_shape;

use std::f64::consts::TAU;
use std::path::Path;

use common_shape::Random;
use etendue::accel::Accel;
use etendue::desc::{Curves, Mesh};
use etendue::load::{LoadOptions, load_str};
use etendue::math::{DMat4, DVec3, DVec4, Ray, Transform, Vec2, Vec3};
use etendue::scene::{BuildOptions, Scene};
use etendue::shape::{CurveKind, Geometry, GeometryBuilder, Hit, MeshOptions};

const KINDS: [CurveKind; 2] = [CurveKind::Linear, CurveKind::BSpline];

/// Curves of lists of points.
fn curves_of(lists: &[&[[f32; 4]]]) -> Curves {
    let mut curves = Curves::default();
    for list in lists {
        curves.points.extend_from_slice(list);
        curves.ends.push(curves.points.len() as u32);
    }
    curves
}

fn built(kind: CurveKind, curves: &Curves, to_world: &Transform) -> Geometry {
    let mut builder = GeometryBuilder::new();
    builder.add_curves(kind, curves, to_world).unwrap();
    builder.finish()
}

/// A bent curve with a changing radius, well wider bent than it is thick.
fn strand(random: &mut Random, count: usize, radius: f32) -> Vec<[f32; 4]> {
    let (mut at, mut ahead) = (random.vector() * 0.3, random.direction());
    (0..count)
        .map(|_| {
            let r = radius * (0.3 + random.unit());
            let point = [at.x, at.y, at.z, r];
            ahead = (ahead + random.vector() * 0.35).normalize();
            at += ahead * (0.25 + 0.2 * random.unit());
            point
        })
        .collect()
}

// ---- Mitsuba ----------------------------------------------------------------

fn table_curves(kind: CurveKind) -> Curves {
    match kind {
        CurveKind::Linear => curves_of(&[
            &[[0.0, 0.0, 0.0, 0.2], [1.0, 0.0, 0.0, 0.4], [1.5, 1.0, 0.2, 0.1]],
            &[[-1.0, -1.0, 0.5, 0.3], [-0.6, 0.2, 1.0, 0.05], [-0.5, 0.2, 0.9, 0.2]],
        ]),
        CurveKind::BSpline => curves_of(&[
            &[
                [-1.0, 0.0, 0.0, 0.2],
                [0.0, 0.1, 0.0, 0.2],
                [1.0, 0.0, 0.2, 0.3],
                [2.0, 0.5, 0.0, 0.4],
                [2.6, 2.0, 0.0, 0.1],
                [3.0, 2.0, 1.0, 0.1],
            ],
            &[[-1.0, -2.0, 0.0, 0.1], [-1.0, -1.0, 0.5, 0.3], [-1.5, 0.0, 0.0, 0.1], [-1.0, 1.0, 0.3, 0.2]],
        ]),
    }
}

/// Position, normal, uv and tangents under plain, mirrored, scaled and turned
/// transforms. Mitsuba finds them in f32, so that it is known to some 1e-4.
#[test]
fn surfaces_are_those_of_mitsuba() {
    let mut cases = 0;
    let mut worst = [0.0f32; 5];
    for line in include_str!("data/curve_interactions.txt").lines().filter(|l| !l.starts_with('#')) {
        let (name, rest) = line.split_once(' ').unwrap();
        let kind = KINDS.into_iter().find(|k| k.name() == name).unwrap();
        let n: Vec<f64> = rest.split(' ').map(|x| x.parse().unwrap()).collect();
        let row = |i: usize| DVec4::new(n[4 * i], n[4 * i + 1], n[4 * i + 2], n[4 * i + 3]);
        let matrix = DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose();
        let geometry = built(kind, &table_curves(kind), &Transform::from_matrix(matrix).unwrap());
        let v = |i: usize| DVec3::new(n[i], n[i + 1], n[i + 2]).as_vec3();
        let ray = Ray::new(v(12), v(15));
        let accel = Accel::build_named(None, &geometry).unwrap();
        let hit = accel.closest(&geometry, &ray).unwrap_or_else(|| panic!("miss: {line}"));
        let s = geometry.surface(&ray, &hit);
        // The rays of the table are not along the silhouette by more than this.
        let slant = s.ng.dot(ray.dir).abs();
        let mut near = |i: usize, a: Vec3, b: Vec3, size: f32| {
            let error = (a - b).length() / size;
            worst[i] = worst[i].max(error * slant);
            assert!(error * slant <= 2e-4, "{i}: {a} is not {b}: {line}");
        };
        near(0, Vec3::splat(hit.t), Vec3::splat(n[18] as f32), 1.0);
        near(1, s.p, v(19), 1.0);
        near(2, s.ng, v(22), 1.0);
        assert_eq!(s.ng, s.ns);
        let uv = Vec2::new(n[25] as f32, n[26] as f32) - s.uv;
        // u is a turn: 0 and 1 are one.
        let turn = (uv.x - uv.x.round()).abs();
        near(3, Vec3::new(turn, uv.y, 0.0), Vec3::ZERO, 1.0);
        if kind == CurveKind::BSpline {
            near(4, s.dpdu, v(27), s.dpdu.length());
            // Mitsuba's has something around the axis that is not the derivative.
            let around = s.dpdu.normalize();
            let across = |a: Vec3| a - around * a.dot(around);
            near(4, across(s.dpdv), across(v(30)), s.dpdv.length());
        }
        cases += 1;
    }
    println!("largest differences: {worst:?}");
    assert_eq!(cases, 150);
}

/// ∂p/∂u and ∂p/∂v are the derivatives of the point that (u, v) names.
#[test]
fn tangents_are_derivatives() {
    let mut random = Random::new(30);
    let mut hits = 0;
    for _ in 0..40 {
        let points = strand(&mut random, 6, 0.1);
        let geometry = built(CurveKind::BSpline, &curves_of(&[&points]), &Transform::IDENTITY);
        let accel = Accel::build_named(None, &geometry).unwrap();
        let (centre, size) = geometry.bounds().bounding_sphere();
        let point = |u: f64, v: f64| {
            let [c, d] = spline(&points, v * 3.0);
            let axis = d.truncate().normalize();
            let up = (DVec3::Z - axis * axis.z).normalize();
            let (sin, cos) = (TAU * u).sin_cos();
            c.truncate() + (up.cross(axis) * cos + up * sin) * c.w
        };
        for _ in 0..100 {
            let origin = centre + random.direction() * size * 1.5;
            let ray = Ray::new(origin, centre + random.vector() * 0.3 - origin);
            let Some(hit) = accel.closest(&geometry, &ray) else { continue };
            let s = geometry.surface(&ray, &hit);
            let [u, v] = s.uv.to_array().map(f64::from);
            if ((v * 3.0).round() - v * 3.0).abs() < 1e-3 {
                continue;
            }
            let h = 1e-5;
            let du = (point(u + h, v) - point(u - h, v)) / (2.0 * h);
            let dv = (point(u, v + h) - point(u, v - h)) / (2.0 * h);
            assert!((point(u, v) - s.p.as_dvec3()).length() < 1e-6, "{s:?}");
            assert!((du - s.dpdu.as_dvec3()).length() < 1e-4 * du.length(), "{du} {s:?}");
            assert!((dv - s.dpdv.as_dvec3()).length() < 1e-4 * dv.length(), "{dv} {s:?}");
            assert!(du.cross(dv).normalize().dot(s.ng.as_dvec3()).abs() > 1.0 - 1e-6, "{s:?}");
            hits += 1;
        }
    }
    assert!(hits > 500, "{hits}");
}

// ---- A dense mesh -------------------------------------------------------------

fn spline(points: &[[f32; 4]], v: f64) -> [DVec4; 2] {
    let segment = (v as usize).min(points.len() - 4);
    let u = v - segment as f64;
    let p: Vec<DVec4> = points[segment..segment + 4]
        .iter()
        .map(|p| DVec4::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]), f64::from(p[3])))
        .collect();
    let w = 1.0 - u;
    let value =
        [w * w * w, 3.0 * u.powi(3) - 6.0 * u * u + 4.0, 3.0 * w.powi(3) - 6.0 * w * w + 4.0, u.powi(3)];
    let slope = [-w * w, 3.0 * u * u - 4.0 * u, -3.0 * w * w + 4.0 * w, u * u];
    let sum = |weights: [f64; 4], by: f64| {
        p.iter().zip(weights).map(|(p, w)| *p * (w / by)).fold(DVec4::ZERO, |a, b| a + b)
    };
    [sum(value, 6.0), sum(slope, 2.0)]
}

/// Rings of points, joined by triangles that face outward.
fn rings(mesh: &mut Mesh, rings: &[(DVec3, DVec3, f64)], sides: u32) {
    let first = mesh.positions.len() as u32;
    for (centre, axis, radius) in rings {
        let (s, t) = axis.any_orthonormal_pair();
        // One that does not spin: along a fixed direction.
        let fixed = DVec3::new(0.61, 0.35, 0.71);
        let s = (fixed - *axis * axis.dot(fixed)).try_normalize().unwrap_or(s);
        let t = if s == t { t } else { axis.cross(s) };
        for i in 0..sides {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(sides)).sin_cos();
            mesh.positions.push((*centre + (s * cos + t * sin) * *radius).as_vec3());
        }
    }
    for ring in 0..rings.len() as u32 - 1 {
        for i in 0..sides {
            let at = |r: u32, i: u32| first + (ring + r) * sides + i % sides;
            mesh.triangles.push([at(0, i), at(0, i + 1), at(1, i + 1)]);
            mesh.triangles.push([at(0, i), at(1, i + 1), at(1, i)]);
        }
    }
}

fn tessellated(kind: CurveKind, points: &[[f32; 4]]) -> Geometry {
    let mut mesh = Mesh::default();
    if kind == CurveKind::BSpline {
        let steps = 96 * (points.len() - 3);
        let list: Vec<_> = (0..=steps)
            .map(|i| {
                let [c, d] = spline(points, i as f64 / 96.0);
                (c.truncate(), d.truncate().normalize(), c.w)
            })
            .collect();
        rings(&mut mesh, &list, 256);
    } else {
        for pair in points.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|p| DVec4::from_array(p.map(f64::from)));
            let axis = (b - a).truncate();
            let slope = (b.w - a.w) / axis.length();
            let axis = axis.normalize();
            // A sphere's rings from pole to the circle where the cone begins.
            let mut list = Vec::new();
            let start = (-slope).acos();
            let mut ring = |c: DVec4, angle: f64| {
                list.push((c.truncate() + axis * (c.w * angle.cos()), axis, (c.w * angle.sin()).max(1e-9)));
            };
            (0..=64).rev().for_each(|i| ring(a, start + (TAU * 0.5 - start) * f64::from(i) / 64.0));
            (0..=64).rev().for_each(|i| ring(b, start * f64::from(i) / 64.0));
            rings(&mut mesh, &list, 256);
        }
    }
    let mut builder = GeometryBuilder::new();
    let options = MeshOptions { face_normals: true, ..MeshOptions::default() };
    builder.add_mesh(&mesh, &Transform::IDENTITY, options).unwrap();
    builder.finish()
}

/// The first triangle met from outside.
fn first_front(accel: &Accel, mesh: &Geometry, ray: &Ray) -> Option<(f32, Vec3)> {
    let mut ray = *ray;
    let origin = ray.origin;
    loop {
        let hit = accel.closest(mesh, &ray)?;
        let s = mesh.surface(&ray, &hit);
        if s.ng.dot(ray.dir) < 0.0 {
            return Some(((s.p - origin).length(), s.ng));
        }
        ray = s.spawn(ray.dir);
    }
}

/// Rays from everywhere, along and across. Where they graze the mesh is not the
/// curve; there, and where its edge is another, the nearest that is not must do.
#[test]
fn hits_are_those_of_a_dense_mesh() {
    let mut random = Random::new(31);
    for kind in KINDS {
        let (mut rays, mut hits, mut grazing) = (0, 0, 0);
        for round in 0..12 {
            let radius = [0.12, 0.05, 0.02][round % 3];
            let points = strand(&mut random, 6, radius);
            let curve = built(kind, &curves_of(&[&points]), &Transform::IDENTITY);
            let mesh = tessellated(kind, &points);
            let accels = [&curve, &mesh].map(|g| Accel::build_named(None, g).unwrap());
            let (centre, size) = curve.bounds().bounding_sphere();
            for i in 0..3000 {
                let about = points[1 + random.below(4) as usize];
                let target = Vec3::new(about[0], about[1], about[2]) + random.vector() * (3.0 * radius);
                let origin = if i % 4 == 0 {
                    // Nearly along it.
                    let next = points[random.below(6) as usize];
                    let to = Vec3::new(next[0], next[1], next[2]) - target;
                    target - to.normalize_or(Vec3::X) * (2.5 * size) + random.vector() * radius
                } else {
                    centre + random.direction() * (1.5 * size)
                };
                let ray = Ray::new(origin, (target - origin).normalize());
                let hit = accels[0].closest(&curve, &ray);
                let met = hit.map(|hit| curve.surface(&ray, &hit));
                let met = met.map(|s| ((s.p - origin).length(), s.ng));
                let expected = first_front(&accels[1], &mesh, &ray);
                rays += 1;
                hits += usize::from(met.is_some());
                let slant = |m: Option<(f32, Vec3)>| m.map_or(1.0, |m| m.1.dot(ray.dir).abs());
                let tolerance = 2e-3 * radius;
                match (met, expected) {
                    (None, None) => {}
                    (Some(a), Some(b)) if (a.0 - b.0).abs() * slant(met).min(slant(expected)) < tolerance => {
                    }
                    _ if slant(met).min(slant(expected)) < 0.1 => grazing += 1,
                    _ => {
                        // The mesh is within what it misses of a silhouette in front.
                        let shifted = (0..8).any(|k| {
                            let (s, t) = ray.dir.any_orthonormal_pair();
                            let (sin, cos) = (k as f32 * 0.785).sin_cos();
                            let origin = ray.origin + (s * sin + t * cos) * tolerance;
                            let ray = Ray::new(origin, ray.dir);
                            let again = first_front(&accels[1], &mesh, &ray);
                            match (met, again) {
                                (None, None) => true,
                                (Some(a), Some(b)) => (a.0 - b.0).abs() * slant(met) < 3.0 * tolerance,
                                _ => false,
                            }
                        });
                        assert!(shifted, "{} {points:?} {ray:?}\n{met:?}\n{expected:?}", kind.name());
                        grazing += 1;
                    }
                }
            }
        }
        println!("{}: {rays} rays, {hits} hits, {grazing} grazing", kind.name());
        assert!(hits * 4 > rays && hits * 10 < rays * 9, "{hits} hits of {rays}");
        assert!(grazing * 50 < rays, "{grazing} of {rays} are not looked at");
    }
}

// ---- Contracts ---------------------------------------------------------------

/// How far outside the tube around a curve a point is, in f64: from the nearest
/// sphere of a linear curve, and from the circle in whose plane the point lies.
fn outside(kind: CurveKind, points: &[[f32; 4]], p: DVec3) -> f64 {
    let centre = |v: f64| match kind {
        CurveKind::Linear => {
            let i = (v as usize).min(points.len() - 2);
            let [a, b] = [points[i], points[i + 1]].map(|p| DVec4::from_array(p.map(f64::from)));
            a.lerp(b, v - i as f64)
        }
        CurveKind::BSpline => spline(points, v)[0],
    };
    let distance = |v: f64| {
        let c = centre(v);
        (p - c.truncate()).length() - if kind == CurveKind::Linear { c.w } else { 0.0 }
    };
    let last = points.len() as f64 - f64::from(kind.points()) + 1.0;
    // Each segment of a linear curve has one minimum; those of a spline are beside
    // what is nearer than its neighbours.
    let steps = if kind == CurveKind::Linear { last } else { last * 512.0 } as usize;
    let at = |i: usize| last * i.min(steps) as f64 / steps as f64;
    let values: Vec<f64> = (0..=steps).map(|i| distance(at(i))).collect();
    let lower = |i: usize, j: usize| values.get(j).is_none_or(|v| values[i] <= *v);
    let near = |i: &usize| kind == CurveKind::Linear || (lower(*i, i + 1) && lower(*i, i.wrapping_sub(1)));
    let sides = (0..=steps).filter(near).flat_map(|i| [i.saturating_sub(1), i]).map(|i| {
        let (mut a, mut b) = (at(i), at(i + 1));
        for _ in 0..90 {
            let third = (b - a) * 0.381_966;
            if distance(a + third) < distance(b - third) { b -= third } else { a += third }
        }
        0.5 * (a + b)
    });
    let v = sides.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap();
    match kind {
        CurveKind::Linear => distance(v),
        CurveKind::BSpline => distance(v) - centre(v).w,
    }
}

/// Scaled and moved curves, with the numbers that f32 made of them.
fn placed(points: &[[f32; 4]], scale: f32, at: Vec3) -> Vec<[f32; 4]> {
    points
        .iter()
        .map(|[x, y, z, r]| [x * scale + at.x, y * scale + at.y, z * scale + at.z, r * scale])
        .collect()
}

/// Hits lie on the surface within their error, in the box of their primitive,
/// and rays that leave do not meet it again, at any scale and place.
#[test]
fn hits_are_on_the_surface_and_rays_leave_it() {
    let mut random = Random::new(32);
    let (mut hits, mut again) = (0, 0);
    for round in 0..48 {
        let kind = KINDS[round % 2];
        let scale = [1.0, 1e-9, 1e9, 1.0, 0.01, 3.0][round / 2 % 6];
        let far = if round / 2 % 6 == 3 { Vec3::new(1483.0, 12.0, -2234.0) } else { Vec3::ZERO };
        let radius = [0.1, 0.01, 0.001][round % 3];
        let points = placed(&strand(&mut random, 7, radius), scale, far);
        let geometry = built(kind, &curves_of(&[&points]), &Transform::IDENTITY);
        let accel = Accel::build_named(None, &geometry).unwrap();
        let (centre, size) = geometry.bounds().bounding_sphere();
        for _ in 0..150 {
            let p = points[1 + random.below(5) as usize];
            let target = Vec3::new(p[0], p[1], p[2]) + random.vector() * p[3];
            let origin = centre + random.direction() * (size * 1.2);
            let ray = Ray::new(origin, target - origin);
            let Some(hit) = accel.closest(&geometry, &ray) else { continue };
            let s = geometry.surface(&ray, &hit);
            hits += 1;
            assert!(s.ng.is_normalized() && s.ng.dot(ray.dir) < 0.0, "{s:?}");
            let error = f64::from(s.ng.abs().dot(s.p_error)) * 1.01;
            let off = outside(kind, &points, s.p.as_dvec3());
            assert!(
                off.abs() <= error,
                "{} off by {off}, allowed {error}: {s:?} {ray:?} {points:?}",
                kind.name()
            );
            let b = geometry.prim_bounds(hit.prim);
            let inside = (s.p + s.p_error).cmpge(b.min).all() && (s.p - s.p_error).cmple(b.max).all();
            assert!(inside, "{s:?} is not in {b:?}");
            for k in 0..24 {
                let mut dir = random.direction();
                if k % 3 == 0 {
                    // Close to the tangent plane.
                    dir = (dir - s.ng * dir.dot(s.ng)).normalize() + s.ng * (0.01 * random.unit());
                }
                let dir = if dir.dot(s.ng) < 0.0 { -dir } else { dir }.normalize();
                let rise = dir.dot(s.ng);
                let spawned = s.spawn(dir);
                let met = geometry.intersect(hit.prim, &spawned, f32::INFINITY);
                if kind == CurveKind::Linear {
                    assert_eq!(met, None, "{s:?} {spawned:?} {points:?}");
                } else if let Some(met) = met {
                    // A bend comes back, but no sooner than a circle of the
                    // smallest radius that these have, which is about a third
                    // of the distance of their points.
                    again += 1;
                    assert!(met.t > rise * 0.02 * scale, "{rise} {met:?} {s:?} {points:?}");
                }
                // Inward, it leaves unseen.
                let inward = s.spawn(-dir);
                let met = geometry.intersect(hit.prim, &inward, f32::INFINITY);
                if kind == CurveKind::Linear {
                    assert_eq!(met, None, "{s:?} {inward:?} {points:?}");
                }
            }
        }
    }
    println!("{hits} hits, {again} met again");
    assert!(hits > 4000, "{hits} hits");
}

/// Rays aimed at the axis, in the middle and exactly where segments and their
/// parts join, find the curve.
#[test]
fn nothing_passes_between_segments() {
    let mut random = Random::new(33);
    let mut count = 0;
    for round in 0..24 {
        let kind = KINDS[round % 2];
        let scale = [1.0, 1e-9, 1e9][round % 3];
        let radius = [0.1, 0.01, 1e-3, 1e-4][round / 2 % 4];
        let points = placed(&strand(&mut random, 8, radius), scale, Vec3::ZERO);
        let geometry = built(kind, &curves_of(&[&points]), &Transform::IDENTITY);
        let accel = Accel::build_named(None, &geometry).unwrap();
        let segments = points.len() as u32 - kind.points() + 1;
        for i in 0..4000 {
            // Eighths of segments, or anywhere; away from the open ends of splines.
            let v = if i % 2 == 0 {
                1.0 + f64::from(random.below(8 * (segments - 2) + 1)) / 8.0
            } else {
                1.0 + f64::from(segments - 2) * f64::from(random.unit())
            };
            let (c, tangent) = match kind {
                CurveKind::Linear => {
                    let k = (v as usize).min(points.len() - 2);
                    let [a, b] = [points[k], points[k + 1]].map(|p| DVec4::from_array(p.map(f64::from)));
                    (a.lerp(b, v - k as f64), (b - a).truncate().normalize())
                }
                CurveKind::BSpline => {
                    let [c, d] = spline(&points, v);
                    (c, d.truncate().normalize())
                }
            };
            let dir = random.direction().as_dvec3();
            if tangent.dot(dir).abs() > 0.8 {
                continue; // it may come through an end
            }
            let distance = f64::from(scale) * 3.0;
            let origin = (c.truncate() - dir * distance).as_vec3();
            let ray = Ray::new(origin, (c.truncate() - origin.as_dvec3()).as_vec3());
            let hit = accel.closest(&geometry, &ray);
            let lets = || format!("{} lets {ray:?} through at {v}: {points:?}", kind.name());
            assert!(hit.is_some_and(|hit| hit.t < 1.0), "{}", lets());
            count += 1;
        }
    }
    assert!(count > 60_000, "{count}");
}

/// What has no surface gives none, and nothing panics.
#[test]
fn degenerate_curves_are_harmless() {
    let p = |x: f32, y: f32, z: f32, r: f32| [x, y, z, r];
    let cases: Vec<Vec<[f32; 4]>> = vec![
        vec![p(0.0, 0.0, 0.0, 0.0); 5],
        vec![p(0.1, 0.2, 0.3, 0.5); 5],
        vec![p(0.0, 0.0, 0.0, 0.0), p(1.0, 0.0, 0.0, 0.0), p(2.0, 0.0, 0.0, 0.0), p(3.0, 0.0, 0.0, 0.0)],
        // Back and forth, cusps, one sphere in another, a point at the end.
        vec![p(0.0, 0.0, 0.0, 0.1), p(1.0, 0.0, 0.0, 0.1), p(0.0, 0.0, 0.0, 0.1), p(1.0, 0.0, 0.0, 0.1)],
        vec![p(0.0, 0.0, 0.0, 0.1), p(1.0, 0.0, 0.0, 0.1), p(1.0, 0.0, 0.0, 0.1), p(1.0, 0.0, 0.0, 0.1)],
        vec![p(0.0, 0.0, 0.0, 2.0), p(0.1, 0.0, 0.0, 0.5), p(0.2, 0.1, 0.0, 3.0), p(0.3, 0.0, 0.0, 0.0)],
        vec![p(0.0, 0.0, 0.0, 0.0), p(0.5, 0.5, 0.0, 0.5), p(1.0, 0.0, 0.0, 0.0), p(1.5, 0.5, 0.0, 0.5)],
        // Wider than it is bent.
        vec![p(0.0, 0.0, 0.0, 0.5), p(0.5, 0.0, 0.0, 0.5), p(0.5, 0.1, 0.0, 0.5), p(0.0, 0.1, 0.0, 0.5)],
        vec![
            p(0.0, 0.0, 0.0, 1e-30),
            p(1e-30, 0.0, 0.0, 1e-30),
            p(1e30, 0.0, 0.0, 1e30),
            p(0.0, 1e30, 0.0, 1.0),
        ],
        vec![
            p(3e38, 0.0, 0.0, 3e38),
            p(-3e38, 0.0, 0.0, 0.0),
            p(0.0, 3e38, 0.0, 1.0),
            p(0.0, 0.0, -3e38, 3e38),
        ],
        vec![p(1e-45, 0.0, 0.0, 1e-45), p(0.0, 1e-45, 0.0, 1e-45), [0.0; 4], p(1e-44, 0.0, 0.0, 0.0)],
    ];
    let mut random = Random::new(34);
    let mut hits = vec![[0; 2]; cases.len()];
    for (case, points) in cases.iter().enumerate() {
        for (k, kind) in KINDS.into_iter().enumerate() {
            let geometry = built(kind, &curves_of(&[points]), &Transform::IDENTITY);
            let accels = Accel::NAMES.iter().map(|n| Accel::build_named(Some(n), &geometry));
            let accels: Vec<_> = accels.filter_map(Result::ok).collect();
            let size = points.iter().flatten().fold(0.0f32, |a, b| a.max(b.abs())).min(1e37);
            for i in 0..1500 {
                let origin = random.vector() * size * 2.0;
                let on = points[random.below(points.len() as u32) as usize];
                let target = Vec3::new(on[0], on[1], on[2]).clamp(Vec3::splat(-1e37), Vec3::splat(1e37));
                let mut ray = Ray::new(origin, target - origin);
                match i % 5 {
                    0 => ray.dir = Vec3::X,
                    1 => ray.origin = target,
                    2 => ray.dir = random.vector(),
                    _ => {}
                }
                let found: Vec<Option<Hit>> = accels.iter().map(|a| a.closest(&geometry, &ray)).collect();
                assert!(found.iter().all(|f| *f == found[0]), "{found:?} {ray:?}");
                let Some(hit) = found[0] else { continue };
                hits[case][k] += 1;
                let s = geometry.surface(&ray, &hit);
                assert!(hit.t > 0.0 && hit.t.is_finite(), "{hit:?}");
                assert!(s.ng.is_normalized() && s.ns.is_normalized(), "{s:?} {ray:?} {points:?}");
                assert!(s.uv.is_finite() && s.p_error.min_element() >= 0.0, "{s:?}");
            }
        }
    }
    println!("{hits:?}");
    // No radius, no surface; a point with a radius is a sphere of a linear curve
    // and nothing of a spline.
    assert_eq!((hits[0], hits[2], hits[1][1]), ([0; 2], [0; 2], 0));
    assert!(hits[1][0] > 300 && hits[5][0] > 300 && hits[7][1] > 100);
}

#[test]
fn curves_that_cannot_be_are_errors() {
    let mut builder = GeometryBuilder::new();
    let good = [0.0, 0.0, 0.0, 1.0];
    let id = Transform::IDENTITY;
    let mut errors = 0;
    for kind in KINDS {
        for bad in [[0.0, 0.0, 0.0, -1.0], [f32::NAN, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, f32::INFINITY]] {
            let curves = curves_of(&[&[good, good, good, bad]]);
            assert!(builder.add_curves(kind, &curves, &id).is_err());
            errors += 1;
        }
        let short = vec![good; kind.points() as usize - 1];
        let error = builder.add_curves(kind, &curves_of(&[&short]), &id).unwrap_err().to_string();
        assert!(error.contains("control points or more"), "{error}");
        let flat =
            Transform { matrix: DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)), inverse: DMat4::IDENTITY };
        assert!(builder.add_curves(kind, &curves_of(&[&[good; 4]]), &flat).is_err());
        errors += 2;
    }
    assert_eq!((errors, builder.finish().prim_count()), (10, 0));
}

/// Strands across the axes are cut up; those along an axis and short ones are
/// not.
#[test]
fn boxes_are_tight() {
    let p = |k: f32, d: Vec3| [d.x * k, d.y * k, d.z * k, 0.001];
    for kind in KINDS {
        for (d, most) in [(Vec3::X, 1), (Vec3::new(1.0, 1.0, 1.0), 8)] {
            let points: Vec<_> = (0..kind.points()).map(|k| p(k as f32, d)).collect();
            let geometry = built(kind, &curves_of(&[&points]), &Transform::IDENTITY);
            assert_eq!(geometry.curve_count(), most, "{} {d}", kind.name());
            let total: f32 = (0..most).map(|prim| geometry.prim_bounds(prim).half_area()).sum();
            assert!(total < if most == 1 { 0.01 } else { 0.45 }, "{total}");
        }
    }
}

// ---- Scenes --------------------------------------------------------------------

const STRAND: &str = "0 0 0 0.2\n1 0 0 0.2\n2 0 0 0.2\n3 0 0 0.2\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.txt"), STRAND).unwrap();
    std::fs::write(folder.path().join("bad.txt"), "0 0 0 1\n\n0 0 0 1\n0 1 0\n").unwrap();
    std::fs::write(folder.path().join("short.txt"), "0 0 0 1\n1 0 0 1\n2 0 0 1\n").unwrap();
    folder
}

fn scene(folder: &Path, body: &str) -> Result<Scene, String> {
    let text = format!(
        r#"<scene version="3.0.0"><sensor type="perspective">
        <float name="shutter_close" value="1"/></sensor>{body}</scene>"#
    );
    let desc = load_str(&text, folder, &LoadOptions::default()).map_err(|e| e.to_string())?;
    Scene::build(&desc, &BuildOptions::default()).map_err(|e| e.to_string())
}

fn shape(kind: &str, file: &str, more: &str) -> String {
    format!(r#"<shape type="{kind}"><string name="filename" value="{file}"/>{more}</shape>"#)
}

/// `to_world` leaves radii as they are, an instance does not, as in Mitsuba.
#[test]
fn radii_belong_to_the_file() {
    let folder = folder();
    let scale = r#"<transform name="to_world"><scale value="2"/></transform>"#;
    let group = format!(
        r#"<shape type="shapegroup" id="g">{}</shape>
        <shape type="instance"><ref id="g"/>{scale}</shape>"#,
        shape("linearcurve", "a.txt", "")
    );
    for (body, radius) in [(shape("linearcurve", "a.txt", scale), 0.2), (group, 0.4)] {
        let scene = scene(folder.path(), &body).unwrap();
        let ray = Ray::new(Vec3::new(2.5, -5.0, 0.0) - scene.recentre.as_vec3(), Vec3::Y);
        let t = scene.closest(&ray).unwrap().t;
        assert!((t - (5.0 - radius)).abs() < 1e-5, "{t}");
    }
    let moving = |transform: &str| {
        let keys = format!(
            r#"<animation name="to_world"><transform time="0"></transform>
            <transform time="1">{transform}</transform></animation>"#
        );
        scene(folder.path(), &shape("bsplinecurve", "a.txt", &keys))
    };
    let moved = moving(r#"<translate y="1"/>"#).unwrap();
    let from = Vec3::new(1.5, -5.0, 0.0) - moved.recentre.as_vec3();
    for time in [0.0, 0.5, 1.0] {
        let t = moved.closest(&Ray { time, ..Ray::new(from, Vec3::Y) }).unwrap().t;
        assert!((t - (4.8 + time)).abs() < 1e-5, "{t}");
    }
    let error = moving(r#"<scale value="2"/>"#).unwrap_err();
    assert!(error.contains("a curve that moves cannot be scaled by `to_world`"), "{error}");
}

/// A curve that glows is found by scattered rays alone, and said to be.
#[test]
fn curves_that_glow_are_not_sampled() {
    let folder = folder();
    let glow = r#"<emitter type="area"><rgb name="radiance" value="3"/></emitter>"#;
    for kind in KINDS {
        let curve = shape(kind.name(), "a.txt", glow);
        let group = format!(
            r#"{curve}<shape type="shapegroup" id="g">{curve}</shape><shape type="instance"><ref id="g"/>
            <transform name="to_world"><translate z="-3"/></transform></shape>"#
        );
        for (body, count) in [(curve.clone(), 1), (group, 2)] {
            let scene = scene(folder.path(), &body).unwrap();
            assert_eq!((scene.lights.len(), scene.plan.unsampled_lights), (0, count));
            let text = format!("{count} more made of curves: scattered rays alone find them");
            assert!(scene.plan.to_string().contains(&text), "{}", scene.plan);
            let ray = Ray::new(Vec3::new(1.5, -5.0, 0.0) - scene.recentre.as_vec3(), Vec3::Y);
            let s = scene.surface(&ray, &scene.closest(&ray).unwrap());
            assert_eq!(scene.emitted(&s, -ray.dir), Vec3::splat(3.0));
        }
        let beam = glow.replace("\"area\"", "\"directionalarea\"");
        let error = scene(folder.path(), &shape(kind.name(), "a.txt", &beam)).unwrap_err();
        assert!(error.contains("`directionalarea` needs a flat shape"), "{error}");
    }
}

#[test]
fn messages_of_bad_curves() {
    let folder = folder();
    let error = |kind: &str, file: &str, more: &str| {
        let error = scene(folder.path(), &shape(kind, file, more)).unwrap_err();
        error.replace(&*folder.path().to_string_lossy(), "")
    };
    let bad = error("linearcurve", "bad.txt", "");
    assert!(bad.contains("bad.txt`, line 1: a curve of 1 control points, expected 2 or more"), "{bad}");
    let short = error("bsplinecurve", "short.txt", "");
    assert!(short.contains("short.txt`, line 1: a curve of 3 control points, expected 4 or more"), "{short}");
    let missing = error("bsplinecurve", "b.txt", "");
    assert!(missing.contains("cannot find the file `b.txt`") && missing.contains("a.txt"), "{missing}");
    let flip = error("linearcurve", "a.txt", r#"<boolean name="flip_normals" value="true"/>"#);
    assert!(flip.contains("shape `linearcurve` takes no parameter `flip_normals`"), "{flip}");
    let name = error("linearcurves", "a.txt", "");
    assert!(name.contains("did you mean `linearcurve`?"), "{name}");
    let none = scene(folder.path(), r#"<shape type="bsplinecurve"/>"#).unwrap_err();
    assert!(none.contains("shape `bsplinecurve` needs a `filename`"), "{none}");
}
