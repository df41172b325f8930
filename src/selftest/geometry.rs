//! D1 to D10: geometry that is hard for intersection. What should never happen
//! is counted, over every accelerator that there is.

use super::rays::{
    Cases, Random, all, gap_leaks, geometry_of, hit_near, leaks, mesh_of, met_again, share, sphere,
};
use super::sheet::Sheet;
use super::{Row, exact};
use crate::accel::Accel;
use crate::desc::Mesh;
use crate::desc::Result;
use crate::math::{DMat3, DMat4, DQuat, DVec3, Motion, Ray, Transform, Vec3};
use crate::shape::{Geometry, GeometryBuilder, Hit, MeshOptions, RayProbe, ShapeSampler};

pub(super) const ROWS: &[Row] = &[
    Row {
        id: "D1",
        what: "closed meshes are watertight, and needles",
        run: |s| count(s, &[watertight, rooms, needles]),
    },
    Row { id: "D2", what: "nothing is met again", run: |s| count(s, &[reintersection]) },
    Row {
        id: "D3",
        what: "convex bodies are left behind, at 1e7 sizes away too",
        run: |s| count(s, &[convex, translated]),
    },
    Row { id: "D4", what: "gaps do not leak", run: |s| count(s, &[gaps]) },
    Row { id: "D5", what: "degenerate triangles change nothing", run: |s| count(s, &[degenerate]) },
    Row { id: "D6", what: "no false hits", run: |s| count(s, &[false_hits]) },
    Row { id: "D7", what: "cameras in awkward places", run: |s| count(s, &[cameras]) },
    Row { id: "D8", what: "of coincident surfaces the lowest id wins", run: |s| count(s, &[coincident]) },
    Row { id: "D9", what: "instances of any transform", run: |s| count(s, &[instances]) },
    Row { id: "D10", what: "rays that are none", run: |s| count(s, &[no_rays]) },
];

/// Of rays that leave a body of needles outward.
const NEEDLES: &str = "the corners are as far apart as the aspect says, and the test moves each by up to one unit in \
                       the last place of its distance: next to an edge it meets the neighbour just behind it";

/// What such cases are called.
const NOT_THERE: &str = "hits that are not there";

fn count(sheet: &mut Sheet, rows: &[fn(bool) -> Cases]) -> Result<()> {
    for row in rows {
        for (what, wrong, tried) in row(sheet.full()) {
            let known = what.contains(NOT_THERE);
            sheet.none(what, wrong as u64, tried);
            if known {
                sheet.known(NEEDLES);
            }
        }
    }
    Ok(())
}

const FAR: Vec3 = Vec3::new(148_376.0, 1234.0, -223_423.0);

/// D1: a sphere of 159,200 triangles (28,320 when not full), at the origin and far away.
fn watertight(full: bool) -> Cases {
    let mut rows = Cases::new();
    let (rings, segments) = if full { (200, 400) } else { (60, 240) };
    for (place, centre) in [("at the origin", Vec3::ZERO), ("far away", FAR)] {
        let geometry = geometry_of(&[sphere(rings, segments, 2.0, centre)]);
        let from = |random: &mut Random| centre + random.vector() * 0.5;
        leaks(place, &geometry, if full { 10_000_000 } else { 120_000 }, from, &mut rows);
    }
    rows
}

/// Half the size of a room.
const ROOM: Vec3 = Vec3::new(1.0, 0.7, 1.3);

/// A closed room of axis-parallel walls, each of `n` × `n` fields of unequal size.
fn room(n: u16, centre: Vec3) -> Mesh {
    let line = |axis: usize, i: u16| {
        let x = 2.0 * f32::from(i) / f32::from(n) - 1.0;
        centre[axis] + ROOM[axis] * x * (0.6 + 0.4 * x * x)
    };
    let mut triangles = Vec::new();
    for (axis, wall) in [(0, 0), (0, n), (1, 0), (1, n), (2, 0), (2, n)] {
        let corner = |i: u16, j: u16| {
            let mut at = Vec3::ZERO;
            for (k, line_of) in [(axis, wall), ((axis + 1) % 3, i), ((axis + 2) % 3, j)] {
                at[k] = line(k, line_of);
            }
            at
        };
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh_of(&triangles)
}

/// Walls, whose boxes are flat: leaks from anywhere inside, from close beside a
/// wall, and of rays that leave a wall inward and begin inside. In a corner of a
/// room far away a point is rounded onto the other wall as well, and what begins
/// on that does not meet it.
fn rooms(full: bool) -> Cases {
    let mut rows = Cases::new();
    let rays = if full { 3_000_000 } else { 60_000 };
    for (place, centre) in [("a room at the origin", Vec3::ZERO), ("a room far away", FAR)] {
        let geometry = geometry_of(&[room(24, centre)]);
        let inside = |r: &mut Random| centre + r.vector() * ROOM * 0.9;
        leaks(place, &geometry, rays, inside, &mut rows);
        // At the least a unit in the last place inward of the wall.
        let beside = |r: &mut Random| {
            let (mut at, axis) = (inside(r), r.below(3) as usize);
            let wall = centre[axis] + ROOM[axis];
            at[axis] = (wall - r.log_uniform(8.0).abs().min(1.0)).min(wall.next_down());
            at
        };
        leaks(&format!("{place}, beside a wall"), &geometry, rays, beside, &mut rows);
        for accel in all(&geometry) {
            let (mut random, mut misses, mut tried) = (Random(19), 0, 0);
            for i in 0..share(&accel, &geometry, rays) {
                let origin = inside(&mut random);
                let Some((_, wall)) = hit_near(&geometry, &accel, i, origin, &mut random) else { continue };
                let dir = random.direction();
                let dir = if dir.dot(wall.ng) * (origin - wall.p).dot(wall.ng) < 0.0 { -dir } else { dir };
                let ray = wall.spawn(dir);
                let within = ray.origin.cmplt(centre + ROOM) & ray.origin.cmpgt(centre - ROOM);
                if within.all() {
                    misses += u64::from(accel.closest(&geometry, &ray).is_none());
                    tried += 1;
                }
            }
            rows.push((format!("{place}, from its walls, {}", accel.name()), misses as f64, tried));
        }
    }
    rows
}

/// A closed prism of `sides` faces, `length` long and 1 in radius, along x.
fn prism(sides: u32, length: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..sides {
        let (s, c) = (std::f32::consts::TAU * i as f32 / sides as f32).sin_cos();
        mesh.positions.extend([Vec3::new(-0.5 * length, c, s), Vec3::new(0.5 * length, c, s)]);
    }
    for i in 0..sides {
        let [a, b] = [2 * i, 2 * ((i + 1) % sides)];
        mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        if i > 1 {
            mesh.triangles.extend([[0, a, a - 2], [1, a - 1, a + 1]]);
        }
    }
    mesh
}

/// Prisms whose faces are needles of aspect up to 10⁷: leaks from inside, and
/// rays that leave outward and meet something that they do not cross.
///
/// Corners of a face have the same y and z at both ends, so that the prism is
/// convex to the last bit, and nothing that leaves it crosses it again.
fn needles(full: bool) -> Cases {
    let mut rows = Cases::new();
    for aspect in [1e3, 1e5, 1e7] {
        // The sides of the polygon are 0.39 wide.
        let geometry = geometry_of(&[prism(16, 0.39 * aspect)]);
        let reach = 0.19 * aspect;
        let from = |r: &mut Random| r.vector() * Vec3::new(reach, 0.4, 0.4);
        let rays = if full { 3_000_000 } else { 30_000 };
        leaks(&format!("aspect {aspect:.0e}"), &geometry, rays, from, &mut rows);
        for accel in all(&geometry) {
            rows.extend(left_outward(aspect, &geometry, &accel, share(&accel, &geometry, rays)));
        }
    }
    rows
}

/// Rays that leave a prism outward: what begins or ends wrongly, to the last
/// bit; hits that are not there; and such hits farther from their triangle than
/// rounding explains.
fn left_outward(aspect: f32, geometry: &Geometry, accel: &Accel, rays: u64) -> Cases {
    let (mut random, mut tried) = (Random(7), 0);
    let (mut inside, mut missed, mut not_there, mut far) = (0, 0, 0, 0);
    let reach = 0.19 * aspect;
    for i in 0..rays {
        let turned = random.direction();
        let from = Vec3::new(turned.x * reach, turned.y * 3.0, turned.z * 3.0);
        let Some((own, surface)) = hit_near(geometry, accel, i, from, &mut random) else { continue };
        let dir = random.direction();
        let dir = if dir.dot(surface.ng) < 0.0 { -dir } else { dir };
        let ray = surface.spawn(dir);
        tried += 1;
        let origin = exact::point(ray.origin);
        // Directions in the plane of the face, as f32 has it, may lead inward.
        if exact::leads(dir, own) < 0 {
            continue;
        }
        inside += u64::from(exact::side(&origin, own) <= 0);
        let Some(hit) = accel.closest(geometry, &ray) else { continue };
        let Some(other) = geometry.triangle(hit.prim) else { continue };
        missed += u64::from(hit.prim == surface.prim);
        if !exact::crosses(&origin, dir, other) {
            not_there += 1;
            far += u64::from(off_triangle(&ray, hit.t, other));
        }
    }
    let name = |what: &str| format!("aspect {aspect:.0e}, outward: {what}, {}", accel.name());
    [("origins inside", inside), ("their own face met", missed), (NOT_THERE, not_there), ("farther off", far)]
        .map(|(what, wrong)| (name(what), wrong as f64, tried))
        .to_vec()
}

/// D2: triangles, spheres, cylinders, disks, rectangles and an instanced sphere
/// with coordinates of 10^±8, hit, and left.
fn reintersection(full: bool) -> Cases {
    const ANYWHERE: &str = "triangle seen from 10^±8";
    const KINDS: [&str; 7] = ["triangle", ANYWHERE, "sphere", "cylinder", "disk", "rectangle", "instance"];
    let objects = if full { 20_000 } else { 1000 };
    let row = |kind: &&str| {
        let mut random = Random(11);
        let (mut again, mut rays) = (0, 0);
        for _ in 0..objects {
            let (geometry, target, size) = object(kind, &mut random);
            let Ok(accel) = Accel::build_named(None, &geometry) else { continue };
            let origin = if *kind == ANYWHERE {
                Vec3::from_array([(); 3].map(|()| random.log_uniform(8.0)))
            } else {
                target + random.direction() * size * 4.0
            };
            let ray = Ray::new(origin, target - origin);
            let Some(hit) = accel.closest(&geometry, &ray) else { continue };
            let surface = geometry.surface(&ray, &hit);
            for _ in 0..50 {
                // A curved side may be met again from inside.
                let dir = random.direction();
                let dir = if !surface.planar && dir.dot(surface.ng) < 0.0 { -dir } else { dir };
                again += u64::from(accel.closest(&geometry, &surface.spawn(dir)).is_some());
                rays += 1;
            }
        }
        ((*kind).to_owned(), again as f64, rays)
    };
    KINDS.iter().map(row).collect()
}

/// One object, a point to aim at and how large it is.
fn object(kind: &str, random: &mut Random) -> (Geometry, Vec3, f32) {
    let mut builder = GeometryBuilder::new();
    let at = Vec3::from_array([(); 3].map(|()| random.log_uniform(8.0)));
    let size = random.log_uniform(8.0).abs();
    if kind.starts_with("triangle") {
        let corners = [(); 3].map(|()| Vec3::from_array([(); 3].map(|()| random.log_uniform(8.0))));
        let _ = builder.add_mesh(&mesh_of(&[corners]), &Transform::IDENTITY, MeshOptions::default());
        let target = corners[0] * 0.3 + corners[1] * 0.3 + corners[2] * 0.4;
        return (builder.finish(), target, target.abs().max_element());
    }
    let turn = DQuat::from_axis_angle(random.direction().as_dvec3(), f64::from(random.unit()) * 6.0);
    let m = DMat4::from_scale_rotation_translation(DVec3::splat(size.into()), turn, at.as_dvec3());
    let Some(place) = Transform::from_matrix(m) else { return (builder.finish(), at, size) };
    let _ = match kind {
        "sphere" => builder.add_sphere(DVec3::ZERO, 1.0, &place, false),
        "cylinder" => builder.add_cylinder([-DVec3::Z, DVec3::Z], 1.0, &place, false),
        "disk" => builder.add_disk(&place, false),
        "rectangle" => builder.add_rectangle(&place, false),
        _ => {
            let part = builder.begin_group();
            builder.add_instance(part, Motion::still(place));
            builder.add_sphere(DVec3::ZERO, 1.0, &Transform::IDENTITY, false)
        }
    };
    (builder.finish(), at + random.vector() * 0.3 * size, size)
}

/// D3: seven scales and places; the far ones are a thousand sizes away.
fn convex(full: bool) -> Cases {
    let mut rows = Cases::new();
    let places = [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 10.0), (1.0, 1e3), (1e-6, 1e3), (1e6, 1e3)];
    for (scale, offset) in places {
        let centre = Vec3::new(0.6, -0.3, 0.8) * offset * scale;
        let geometry = geometry_of(&[sphere(12, 24, scale, centre)]);
        let outside = |random: &mut Random| centre + random.direction() * 3.0 * scale;
        let what = format!("scale {scale:.0e}, {offset} sizes away");
        met_again(&what, &geometry, if full { 1_000_000 } else { 4000 }, outside, &mut rows);
    }
    rows
}

/// The limit of f32: at a distance of T from the origin points are 2⁻²³·T or
/// half of that apart (an ulp). Bodies of exact coordinates neither leak nor are
/// met again down to a size of 2 ulp (10⁷ sizes away), and gaps of 16 ulp hold.
fn translated(full: bool) -> Cases {
    let mut rows = Cases::new();
    let rays = if full { 1_000_000 } else { 3000 };
    for power in [10, 17, 20, 23] {
        // A cube of edge 2 about (T, -T, T), whose ulp is 2^(power - 23).
        let t = 2f32.powi(power);
        let centre = Vec3::new(t, -t, t) * 1.25;
        let place = Transform::translate(centre.as_dvec3());
        let mut builder = GeometryBuilder::new();
        let _ = builder.add_cube(&place, MeshOptions::default());
        let geometry = builder.finish();
        let what = format!("cube, {:.0e} sizes away", 1.25 * t / 2.0);
        leaks(&what, &geometry, rays, |_| centre, &mut rows);
        let outside = |random: &mut Random| centre + random.direction() * 8.0;
        met_again(&what, &geometry, rays, outside, &mut rows);
        for ulps in [16.0, 64.0] {
            let gap = ulps * 2f32.powi(power - 23);
            gap_leaks(&format!("gap of {ulps} ulp at 2^{power}"), centre, [gap, 4.0 * gap], rays, &mut rows);
        }
    }
    rows
}

/// D4: the gaps that hold, relative to the size, at three places and scales.
fn gaps(full: bool) -> Cases {
    let mut rows = Cases::new();
    for (offset, gaps) in [(0.0, [1e-2, 1e-4, 5e-6]), (1.0, [1e-2, 1e-4, 5e-6]), (100.0, [1e-2, 1e-3, 2e-4])]
    {
        for gap in gaps {
            for scale in [1.0, 1e-3, 1e5] {
                let at = Vec3::new(0.3, 0.5, -0.4) * offset * scale;
                let what = format!("gap {gap:.0e}, {offset} sizes away, scale {scale:.0e}");
                let rays = if full { 100_000 } else { 200 };
                gap_leaks(&what, at, [gap * scale, scale], rays, &mut rows);
            }
        }
    }
    rows
}

/// D5: triangles without area or that are not finite are dropped and counted,
/// and change no hit; tiny and thin ones give finite points; nothing without
/// area is a light.
fn degenerate(full: bool) -> Cases {
    let mut random = Random(3);
    let good: Vec<[Vec3; 3]> = (0..60).map(|_| [(); 3].map(|()| random.vector())).collect();
    let (x, nan) = (Vec3::X, Vec3::new(f32::NAN, 0.0, 0.0));
    let infinite = Vec3::new(0.0, f32::INFINITY, 0.0);
    let bad = [[Vec3::ZERO, x, x * 2.0], [x, x, Vec3::Y], [x; 3], [nan, x, Vec3::Y], [infinite, x, Vec3::Z]];
    let mut mixed = good.clone();
    for (i, corners) in bad.iter().enumerate() {
        mixed.insert(7 * i, *corners);
    }
    let mut builder = GeometryBuilder::new();
    let added = builder.add_mesh(&mesh_of(&mixed), &Transform::IDENTITY, MeshOptions::default());
    let dropped = added.map_or(0, |(_, report)| report.dropped);
    let (dirty, clean) = (builder.finish(), geometry_of(&[mesh_of(&good)]));
    let mut rows = vec![("dropped and counted".to_owned(), bad.len().abs_diff(dropped) as f64, 5)];

    let rays = if full { 1_000_000 } else { 5000 };
    for (a, b) in all(&dirty).into_iter().zip(all(&clean)) {
        let count = share(&a, &dirty, rays);
        let different = (0..count).filter(|_| {
            let ray = Ray::new(random.vector() * 3.0, random.direction());
            a.closest(&dirty, &ray) != b.closest(&clean, &ray)
        });
        rows.push((format!("hits that change, {}", a.name()), different.count() as f64, count));
    }

    // Repeated indices, and a light of nothing.
    let none = Mesh { positions: vec![x, Vec3::Y], triangles: vec![[0, 1, 1], [0, 0, 0]], ..Mesh::default() };
    let empty = geometry_of(&[none]);
    let lights = ShapeSampler::new(&empty, 0).is_some();
    rows.push(("lights without area".into(), f64::from(u8::from(lights)), 1));
    rows.extend([1e-20, 1e-12, 1e-6].map(|size| finite_points("size", size, size, &mut random)));
    rows.extend([1e6, 1e9, 1e12].map(|aspect| finite_points("aspect", 1.0, 1.0 / aspect, &mut random)));
    rows
}

/// Hits of triangles `long` by `wide` whose points are not finite, or whose
/// normals are not of unit length.
fn finite_points(what: &str, long: f32, wide: f32, random: &mut Random) -> (String, f64, u64) {
    let (mut wrong, mut hits) = (0, 0);
    for _ in 0..2000 {
        let (along, across) = (random.direction(), random.direction());
        let corners = [Vec3::ZERO, along * long, along * 0.3 * long + across * wide];
        let geometry = geometry_of(&[mesh_of(&[corners])]);
        let origin = random.direction() * long * 2.0;
        let ray = Ray::new(origin, corners[1] * 0.4 + corners[2] * 0.3 - origin);
        let Some(hit) = geometry.intersect(0, &ray, f32::INFINITY) else { continue };
        let s = geometry.surface(&ray, &hit);
        let unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-4;
        let right = s.p.is_finite() && s.p_error.is_finite() && unit(s.ng) && unit(s.ns) && s.uv.is_finite();
        wrong += u64::from(!right || !s.spawn(across).origin.is_finite());
        hits += 1;
    }
    (format!("points, {what} {:.0e}", if what == "size" { long } else { long / wide }), wrong as f64, hits)
}

/// The distance of a point from a triangle (Ericson 2005, section 5.1.5).
fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (n, inside) =
        ((b - a).cross(c - a), |s: DVec3, e: DVec3, n: DVec3| (e - s).cross(p - s).dot(n) >= 0.0);
    if n != DVec3::ZERO && inside(a, b, n) && inside(b, c, n) && inside(c, a, n) {
        return (p - a).dot(n.normalize()).abs();
    }
    let segment = |s: DVec3, e: DVec3| {
        let along = e - s;
        let t = ((p - s).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p - s - along * t).length()
    };
    segment(a, b).min(segment(b, c)).min(segment(c, a))
}

/// A hit is farther from its triangle than rounding explains, in f64.
fn off_triangle(ray: &Ray, t: f32, corners: [Vec3; 3]) -> bool {
    let p = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t);
    let reach = corners.iter().map(|c| (*c - ray.origin).abs().max_element()).fold(0.0, f32::max);
    let size = corners.iter().map(|c| c.abs().max_element()).fold(reach, f32::max);
    distance(p, corners.map(|c| c.as_dvec3())) > 16.0 * f64::from(size) * 2f64.powi(-24)
}

/// D6: skinny triangles, huge extents, triangles far beyond the ray: hits that
/// are farther from their triangle than rounding explains, in f64.
fn false_hits(full: bool) -> Cases {
    let rays = if full { 3_000_000 } else { 20_000 };
    let row = |(what, extent, width): (&str, f32, f32)| {
        let mut random = Random(13);
        let (mut wrong, mut hits) = (0, 0);
        for i in 0..rays {
            let a = random.vector() * extent;
            let along = random.vector() * extent;
            let corners = [a, a + along, a + along * random.unit() + random.vector() * extent * width];
            let geometry = geometry_of(&[mesh_of(&[corners])]);
            let origin = random.vector() * if i % 2 == 0 { extent } else { 100.0 };
            let w = random.unit();
            let target = corners[i % 3] * w + corners[(i + 1) % 3] * (1.0 - w);
            let ray = Ray::new(origin, (target - origin).normalize_or(Vec3::X));
            let Some(hit) = geometry.intersect(0, &ray, f32::INFINITY) else { continue };
            wrong += u64::from(off_triangle(&ray, hit.t, corners));
            hits += 1;
        }
        (what.to_owned(), wrong as f64, hits)
    };
    [("skinny", 600.0, 1e-7), ("extent 5.9e11", 5.9e11, 1.0), ("skinny, extent 5.9e11", 5.9e11, 1e-6)]
        .map(row)
        .to_vec()
}

/// D7: rays that start exactly on a plane, in a corner, on an edge and inside
/// of a closed cube, along its faces too: answers that are not finite, or not
/// those of brute force.
fn cameras(full: bool) -> Cases {
    let mut builder = GeometryBuilder::new();
    let _ = builder.add_cube(&Transform::IDENTITY, MeshOptions::default());
    let _ = builder.add_sphere(DVec3::new(0.2, 0.0, 0.0), 0.5, &Transform::IDENTITY, false);
    let geometry = builder.finish();
    let accelerators = all(&geometry);
    let places = [
        ("on a plane", Vec3::new(0.3, 1.0, -0.2)),
        ("on an edge", Vec3::new(1.0, 1.0, 0.4)),
        ("in a corner", Vec3::ONE),
        ("in the corner outside of 1 ulp", Vec3::splat(1f32.next_up())),
        ("inside a sphere", Vec3::new(0.2, 0.0, 0.0)),
        ("on a sphere", Vec3::new(0.7, 0.0, 0.0)),
    ];
    let row = |(what, origin): (&str, Vec3)| {
        let mut random = Random(17);
        let (mut wrong, rays) = (0, if full { 300_000 } else { 3000 });
        for i in 0..rays {
            let mut dir = random.direction();
            if i % 3 == 0 {
                dir[i % 9 / 3] = 0.0;
            }
            let ray = Ray::new(origin, dir);
            let Some((first, rest)) = accelerators.split_first() else { continue };
            let hit = first.closest(&geometry, &ray);
            let finite = hit.is_none_or(|hit| {
                let s = geometry.surface(&ray, &hit);
                hit.t > 0.0 && hit.t.is_finite() && s.p.is_finite() && s.ng.is_finite()
            });
            wrong += u64::from(!finite || rest.iter().any(|accel| accel.closest(&geometry, &ray) != hit));
        }
        (what.to_owned(), wrong as f64, rays as u64)
    };
    places.map(row).to_vec()
}

/// D8: copies of a soup, of a sphere and of a rectangle: hits of another copy
/// than the first.
fn coincident(full: bool) -> Cases {
    let mut random = Random(19);
    let soup: Vec<[Vec3; 3]> = (0..40).map(|_| [(); 3].map(|()| random.vector())).collect();
    let mut builder = GeometryBuilder::new();
    for _ in 0..4 {
        let _ = builder.add_mesh(&mesh_of(&soup), &Transform::IDENTITY, MeshOptions::default());
    }
    for _ in 0..3 {
        let _ = builder.add_sphere(DVec3::splat(0.3), 0.4, &Transform::IDENTITY, false);
        let _ = builder.add_rectangle(&Transform::IDENTITY, false);
    }
    let geometry = builder.finish();
    let row = |accel: &Accel| {
        let mut random = Random(23);
        let (mut wrong, mut hits) = (0, 0);
        for _ in 0..if full { 300_000 } else { 3000 } {
            let ray = Ray::new(random.vector() * 3.0, random.vector());
            let Some(hit) = accel.closest(&geometry, &ray) else { continue };
            wrong += u64::from(hit.prim >= 40 && !(160..162).contains(&hit.prim));
            hits += 1;
        }
        (accel.name().to_owned(), wrong as f64, hits)
    };
    all(&geometry).iter().map(row).collect()
}

/// D9: an instanced sphere mesh under scale 10⁻¹², 10⁻⁶, mirror and shear: hits
/// that are not those of the mesh placed for good, or whose normal looks inward;
/// transforms without an inverse are none.
fn instances(full: bool) -> Cases {
    let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let singular = [flat, DMat4::ZERO, DMat4::from_scale(DVec3::splat(f64::NAN))];
    let taken = singular.into_iter().filter(|m| Transform::from_matrix(*m).is_some()).count();
    let mut rows = vec![("without an inverse, taken".to_owned(), taken as f64, 3)];
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(3.0, 1.0, 0.0), DVec3::new(0.5, -2.0, 1.0));
    let placed = |m: DMat3| DMat4::from_mat3(m);
    let cases = [
        ("scale 1e-12", placed(DMat3::from_diagonal(DVec3::splat(1e-12)))),
        ("scale 1e-6", placed(DMat3::from_diagonal(DVec3::splat(1e-6)))),
        ("scale 1e12", placed(DMat3::from_diagonal(DVec3::splat(1e12)))),
        ("mirrored", placed(DMat3::from_diagonal(DVec3::new(-1.0, 2.0, 1.0)))),
        ("turned inside out", placed(DMat3::from_diagonal(DVec3::splat(-1.0)))),
        ("sheared", placed(shear)),
    ];
    for (what, m) in cases {
        let Some(place) = Transform::from_matrix(m) else { continue };
        rows.extend(instance_case(what, &place, if full { 100_000 } else { 1000 }));
    }
    rows
}

fn instance_case(what: &str, place: &Transform, rays: u64) -> Cases {
    let mesh = sphere(12, 24, 1.0, Vec3::ZERO);
    let mut builder = GeometryBuilder::new();
    let part = builder.begin_group();
    let _ = builder.add_mesh(&mesh, &Transform::IDENTITY, MeshOptions::default());
    builder.add_instance(part, Motion::still(*place));
    let instanced = builder.finish();
    let mut builder = GeometryBuilder::new();
    let _ = builder.add_mesh(&mesh, place, MeshOptions::default());
    let baked = builder.finish();
    let row = |accel: Accel| {
        let mut random = Random(29);
        let Ok(truth) = Accel::build_named(None, &baked) else { return (what.to_owned(), f64::NAN, 0) };
        let (mut wrong, count) = (0, share(&accel, &baked, rays));
        for _ in 0..count {
            // Well inside of the outline, where both must hit.
            let world = |p: Vec3| place.point(p.as_dvec3()).as_vec3();
            let origin = world(random.direction() * 4.0);
            let ray = Ray::new(origin, world(random.vector() * 0.4) - origin);
            let (hit, expected) = (accel.closest(&instanced, &ray), truth.closest(&baked, &ray));
            let right = |hit: Hit, expected: Hit| {
                let s = instanced.surface(&ray, &hit);
                let Some(v) = instanced.triangle(hit.prim) else { return false };
                let [a, b, c] = v.map(|v| v.as_dvec3());
                let outward = place.normal((b - a).cross(c - a)).normalize();
                (hit.t - expected.t).abs() < 1e-4 && s.ng.as_dvec3().dot(outward) > 0.999
            };
            wrong += u64::from(!hit.zip(expected).is_some_and(|(a, b)| right(a, b)));
        }
        (format!("{what}, {}", accel.name()), wrong as f64, count)
    };
    all(&instanced).into_iter().map(row).collect()
}

/// D10: rays that are not finite or have no direction meet nothing, and visit
/// nothing: they end before any node. Denormal directions are rays.
fn no_rays(_full: bool) -> Cases {
    let geometry = geometry_of(&[sphere(12, 24, 1.0, Vec3::ZERO)]);
    let good = Ray::new(Vec3::new(0.1, 0.2, -4.0), Vec3::Z);
    let mut bad = vec![Ray { dir: Vec3::ZERO, ..good }, Ray { t_max: f32::NAN, ..good }];
    bad.extend([0.0, -1.0].map(|t_max| Ray { t_max, ..good }));
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut moved, mut turned) = (good, good);
            moved.origin[axis] = value;
            turned.dir[axis] = value;
            bad.extend([moved, turned]);
        }
    }
    let visits = bad.iter().filter(|ray| RayProbe::new(ray).is_some()).count();
    let mut rows = vec![("rays that reach a node".to_owned(), visits as f64, bad.len() as u64)];
    let tiny = Ray { dir: Vec3::new(0.0, 1e-42, 1e-40), ..good };
    for accel in all(&geometry) {
        let hits =
            bad.iter().filter(|r| accel.closest(&geometry, r).is_some() || accel.occluded(&geometry, r));
        rows.push((format!("hits, {}", accel.name()), hits.count() as f64, bad.len() as u64));
        let lost = accel.closest(&geometry, &Ray { dir: Vec3::new(0.0, 1e-30, 1e-28), ..good }).is_none();
        rows.push((format!("direction of 1e-28 lost, {}", accel.name()), f64::from(u8::from(lost)), 1));
        let odd = accel.closest(&geometry, &tiny).is_some_and(|hit| !(hit.t > 0.0 && hit.t.is_finite()));
        rows.push((format!("denormal direction, not finite, {}", accel.name()), f64::from(u8::from(odd)), 1));
    }
    rows
}
