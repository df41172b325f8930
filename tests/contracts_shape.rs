//! Contracts of shapes: surfaces are those of Mitsuba; samplers agree with
//! their densities (χ², ∫pdf = 1) and with closed forms of irradiance; no
//! shadow ray is stopped by its own light.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common_shape;

use std::f64::consts::PI;

use common_shape::{Random, mesh_of, single_mesh, sphere_mesh};
use etendue::accel::Accel;
use etendue::desc::Mesh;
use etendue::math::{DMat4, DQuat, DVec3, DVec4, Frame, Ray, Transform, Vec2, Vec3};
use etendue::shape::{Analytic, Geometry, GeometryBuilder, MeshOptions, ShapeSampler, SurfacePoint};

// ---- Surfaces --------------------------------------------------------------

/// The two meshes of the table: two triangles without anything, and with
/// normals and texture coordinates. v is 1 - v of the OBJ file.
fn table_mesh(full: bool) -> Mesh {
    let v = |x, y, z| Vec3::new(x, y, z);
    let mut mesh = Mesh {
        positions: vec![v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.5), v(0.0, 1.0, 0.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    if full {
        mesh.normals = vec![v(0.0, 0.0, 1.0), v(0.3, 0.0, 1.0), v(0.0, -1.0, 1.0), v(0.0, -1.0, 1.0)];
        mesh.uvs = vec![Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.8, 0.1), Vec2::new(0.1, 0.0)];
    }
    mesh
}

fn table_geometry(kind: &str, to_world: &Transform, flip: bool, face_normals: bool) -> Geometry {
    let mut b = GeometryBuilder::new();
    let options = MeshOptions { flip_normals: flip, face_normals, ..MeshOptions::default() };
    let (p0, p1) = (DVec3::new(0.1, 0.2, 0.1), DVec3::new(0.3, 0.1, 0.9));
    match kind {
        "sphere" => b.add_sphere(DVec3::ZERO, 1.0, to_world, flip),
        "sphere_cr" => b.add_sphere(DVec3::new(1.0, 2.0, 3.0), 2.0, to_world, flip),
        "disk" => b.add_disk(to_world, flip),
        "cylinder" => b.add_cylinder([DVec3::ZERO, DVec3::Z], 1.0, to_world, flip),
        "cylinder_pp" => b.add_cylinder([p0, p1], 0.7, to_world, flip),
        "rectangle" => b.add_rectangle(to_world, flip),
        "cube" => b.add_cube(to_world, options).map(|r| r.0),
        "bare" | "full" => b.add_mesh(&table_mesh(kind == "full"), to_world, options).map(|r| r.0),
        _ => panic!("{kind}"),
    }
    .unwrap();
    b.finish()
}

/// Position, both normals, uv and both tangents of every shape under plain,
/// scaled, mirrored and sheared transforms, flipped and not.
#[test]
fn surfaces_are_those_of_mitsuba() {
    let mut cases = 0;
    for line in include_str!("data/shape_interactions.txt").lines().filter(|l| !l.starts_with('#')) {
        let (kind, rest) = line.split_once(' ').unwrap();
        let n: Vec<f64> = rest.split(' ').map(|x| x.parse().unwrap()).collect();
        let row = |i: usize| DVec4::new(n[4 * i], n[4 * i + 1], n[4 * i + 2], n[4 * i + 3]);
        let matrix = DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose();
        let to_world = Transform::from_matrix(matrix).unwrap();
        let geometry = table_geometry(kind, &to_world, n[12] == 1.0, n[13] == 1.0);
        let v = |i: usize| DVec3::new(n[i], n[i + 1], n[i + 2]).as_vec3();

        let ray = Ray::new(v(14), v(17));
        let accel = Accel::build_named(None, &geometry).unwrap();
        let hit = accel.closest(&geometry, &ray).unwrap_or_else(|| panic!("miss: {line}"));
        let s = geometry.surface(&ray, &hit);
        let near = |what: &str, a: Vec3, b: Vec3, scale: f32| {
            assert!((a - b).length() <= 3e-5 * scale.max(b.length()), "{what} {a} is not {b}: {line}");
        };
        assert!((f64::from(hit.t) - n[20]).abs() < 1e-5, "{line}");
        near("p", s.p, v(21), 1.0);
        near("ng", s.ng, v(24), 1.0);
        near("ns", s.ns, v(27), 1.0);
        let uv = Vec2::new(n[30] as f32, n[31] as f32);
        assert!((s.uv - uv).abs().max_element() < 3e-5, "uv {} is not {uv}: {line}", s.uv);
        near("dpdu", s.dpdu, v(32), 1.0);
        near("dpdv", s.dpdv, v(35), 1.0);
        cases += 1;
    }
    assert_eq!(cases, EXPECTED_CASES);
}
const EXPECTED_CASES: usize = 168;

#[test]
fn shapes_that_cannot_be_are_errors() {
    let mut b = GeometryBuilder::new();
    let id = Transform::IDENTITY;
    let flat = Transform { matrix: DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)), inverse: DMat4::IDENTITY };
    let stretched = Transform::from_matrix(DMat4::from_scale(DVec3::new(1.0, 2.0, 1.0))).unwrap();
    let mut failures = 0;
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(b.add_sphere(DVec3::ZERO, radius, &id, false).is_err());
        assert!(b.add_cylinder([DVec3::ZERO, DVec3::Z], radius, &id, false).is_err());
        failures += 2;
    }
    assert!(b.add_cylinder([DVec3::Z, DVec3::Z], 1.0, &id, false).is_err());
    assert!(b.add_disk(&flat, false).is_err() && b.add_rectangle(&flat, false).is_err());
    assert!(b.add_sphere(DVec3::ZERO, 1.0, &flat, false).is_err());
    let error = b.add_sphere(DVec3::ZERO, 1.0, &stretched, false).unwrap_err();
    assert!(error.to_string().contains("scale its radius uniformly"), "{error}");
    assert!(b.add_cylinder([DVec3::ZERO, DVec3::Z], 1.0, &stretched, false).is_err());
    assert_eq!((failures, b.finish().prim_count()), (8, 0));
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let a = Vec3::new(1.0, 2.0, 3.0);
    let (x, y) = (Vec3::X, Vec3::Y);
    let tiny = 1e-20;
    let mesh = mesh_of(&[
        [a, a + x, a + y],
        [a, a, a + y],
        [a, a + x, a + x * 2.0],
        [x * f32::NAN, x, y],
        [x * f32::INFINITY, x, y],
        [x * 0.0, x * tiny, y * tiny],
        [x * 0.0, x * 1e6, x * 1e6 + y * 1e-6],
    ]);
    let mut b = GeometryBuilder::new();
    let (shape, report) = b.add_mesh(&mesh, &Transform::IDENTITY, MeshOptions::default()).unwrap();
    let geometry = b.finish();
    assert_eq!((report.dropped, geometry.prim_count()), (4, 3));
    assert!(geometry.bounds().extent().is_finite());
    let sampler = ShapeSampler::new(&geometry, shape).unwrap();
    assert!((sampler.area() - 1.0).abs() < 1e-6);

    // Nothing left: no light.
    let mut b = GeometryBuilder::new();
    let (shape, report) =
        b.add_mesh(&mesh_of(&[[a, a, a]]), &Transform::IDENTITY, MeshOptions::default()).unwrap();
    assert_eq!(report.dropped, 1);
    assert!(ShapeSampler::new(&b.finish(), shape).is_none());
}

// ---- Samplers against their densities ----------------------------------------

/// All hits of a line through a shape of few primitives; of a sphere, the
/// first.
fn all_hits(geometry: &Geometry, ray: &Ray) -> Vec<SurfacePoint> {
    let mut hits = Vec::new();
    for prim in 0..geometry.prim_count() {
        let mut ray = *ray;
        while let Some(hit) = geometry.intersect(prim, &ray, f32::INFINITY) {
            let surface = geometry.surface(&ray, &hit);
            ray = surface.spawn(ray.dir);
            hits.push(surface);
            if matches!(geometry.analytic(prim), Some(Analytic::Sphere(_))) {
                break;
            }
        }
    }
    hits
}

/// Density of a direction: the sum over all hits, since points of the far side
/// are sampled too. A sphere sampled by its cone gives one point a direction.
fn pdf_of_direction(geometry: &Geometry, sampler: &ShapeSampler, from: Vec3, wi: Vec3, cut: f32) -> f64 {
    let hits = all_hits(geometry, &Ray::new(from, wi));
    let pdf = |s: &SurfacePoint| f64::from(sampler.pdf(geometry, from, s, wi, (s.p - from).length_squared()));
    hits.iter().filter(|s| s.ng.dot(wi).abs() >= cut).map(pdf).sum()
}

const ROWS: usize = 24;
const COLUMNS: usize = 48;

/// The directions from a viewer that can meet a shape: a cone around its
/// bounding sphere, or all of them from inside that.
struct Cone {
    frame: Frame,
    one_minus_cos_max: f32,
}

impl Cone {
    fn new(geometry: &Geometry, from: Vec3) -> Cone {
        let (centre, radius) = geometry.bounds().bounding_sphere();
        let distance = (centre - from).length();
        let sin = radius / distance;
        let one_minus_cos_max = if sin < 0.99 { 1.001 * (1.0 - (1.0 - sin * sin).sqrt()) } else { 2.0 };
        Cone { frame: Frame::from_normal((centre - from) / distance), one_minus_cos_max }
    }

    fn solid_angle(&self) -> f64 {
        2.0 * PI * f64::from(self.one_minus_cos_max)
    }

    fn direction(&self, u: Vec2) -> Vec3 {
        let one_minus_cos = u.x * self.one_minus_cos_max;
        let r = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
        let (sin, cos) = (std::f32::consts::TAU * (u.y - 0.5)).sin_cos();
        self.frame.to_world(Vec3::new(r * cos, r * sin, 1.0 - one_minus_cos)).normalize()
    }

    fn bin(&self, w: Vec3) -> usize {
        let w = self.frame.to_local(w);
        let row = ((1.0 - w.z) / self.one_minus_cos_max * ROWS as f32) as usize;
        let angle = w.y.atan2(w.x) / std::f32::consts::TAU + 0.5;
        row.min(ROWS - 1) * COLUMNS + ((angle * COLUMNS as f32) as usize).min(COLUMNS - 1)
    }
}

/// p-value of χ² by Wilson and Hilferty's cube root.
fn chi2_p_value(chi2: f64, degrees: f64) -> f64 {
    let k = 2.0 / (9.0 * degrees);
    let z = ((chi2 / degrees).cbrt() - (1.0 - k)) / k.sqrt();
    0.5 * erfc(z / std::f64::consts::SQRT_2)
}

/// Complementary error function to 1e-7 (Numerical Recipes 6.2).
fn erfc(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.5 * x.abs());
    let c = [
        -1.26551223,
        1.00002368,
        0.37409196,
        0.09678418,
        -0.18628806,
        0.27886807,
        -1.13520398,
        1.48851587,
        -0.82215223,
        0.17087277,
    ];
    let y = t * (-x * x + c.iter().rev().fold(0.0, |s, c| s * t + c)).exp();
    if x >= 0.0 { y } else { 2.0 - y }
}

fn check_sampler(name: &str, geometry: &Geometry, from: Vec3, seed: u64) -> f64 {
    let sampler = ShapeSampler::new(geometry, 0).unwrap();
    let mut random = Random::new(seed);
    // Densities per area are singular edge-on, which quadrature cannot see:
    // leave such directions out on both sides.
    let cut = if name.starts_with("sphere") { 0.0 } else { 0.1 };

    // Expected counts by stratified quadrature.
    let cone = Cone::new(geometry, from);
    let side = 500;
    let mut expected = vec![0.0f64; ROWS * COLUMNS];
    for y in 0..side {
        for x in 0..2 * side {
            let u = Vec2::new(
                (y as f32 + random.unit()) / side as f32,
                (x as f32 + random.unit()) / (2 * side) as f32,
            );
            let wi = cone.direction(u);
            expected[cone.bin(wi)] += pdf_of_direction(geometry, &sampler, from, wi, cut);
        }
    }
    let cell = cone.solid_angle() / (2 * side * side) as f64;
    let integral: f64 = expected.iter().sum::<f64>() * cell;
    // Observed counts, and the density of each sample against pdf().
    let samples = 60_000;
    let (mut observed, mut valid) = (vec![0.0f64; ROWS * COLUMNS], 0);
    for _ in 0..samples {
        let Some(s) = sampler.sample(geometry, from, random.pair()) else { continue };
        assert!((s.wi.length() - 1.0).abs() < 1e-5 && (s.n.length() - 1.0).abs() < 1e-5, "{name}");
        let point = SurfacePoint { p: s.p, ng: s.ng, prim: s.prim, ..some_point(geometry) };
        let d2 = (s.p - from).length_squared();
        let pdf = sampler.pdf(geometry, from, &point, s.wi, d2);
        assert!((pdf - s.pdf).abs() <= 2e-3 * s.pdf, "{name}: pdf {pdf}, sample {}", s.pdf);
        valid += 1;
        if s.ng.dot(s.wi).abs() >= cut {
            observed[cone.bin(s.wi)] += 1.0;
        }
    }
    let total = f64::from(valid);
    assert!(total > 0.999 * f64::from(samples), "{name}: {total} samples");
    let kept = observed.iter().sum::<f64>() / total;
    assert!(kept > 0.1, "{name}: {kept} of the samples looked at");
    let tolerance = 2e-3 + 4.0 * (kept * (1.0 - kept) / total).sqrt();
    assert!((integral - kept).abs() < tolerance, "{name}: pdf integrates to {integral}, not {kept}");

    // χ², pooling cells below 5.
    let (mut chi2, mut degrees, mut rest) = (0.0, -1.0f64, (0.0, 0.0));
    for (o, e) in observed.iter().zip(&expected) {
        let e = e * cell * total;
        if e < 5.0 {
            rest = (rest.0 + o, rest.1 + e);
        } else {
            chi2 += (o - e) * (o - e) / e;
            degrees += 1.0;
        }
    }
    if rest.1 > 5.0 {
        chi2 += (rest.0 - rest.1) * (rest.0 - rest.1) / rest.1;
        degrees += 1.0;
    } else {
        assert!(rest.0 < 25.0, "{name}: {} samples where {} are expected", rest.0, rest.1);
    }
    if degrees < 1.0 { 1.0 } else { chi2_p_value(chi2, degrees) }
}

fn some_point(geometry: &Geometry) -> SurfacePoint {
    let (centre, radius) = geometry.bounds().bounding_sphere();
    let (mut random, mut found) = (Random::new(0), None);
    while found.is_none() {
        let ray = Ray::new(centre + random.vector() * radius, random.direction());
        found = all_hits(geometry, &ray).pop();
    }
    found.unwrap()
}

#[test]
fn samples_follow_their_densities() {
    let mut cases: Vec<(String, Geometry)> = Analytic::examples()
        .into_iter()
        // Points of the far ones are rounded by some 2 % of their size.
        .filter(|(name, _)| !name.ends_with("far"))
        .map(|(name, shape)| {
            let mut b = GeometryBuilder::new();
            b.add_analytic(shape);
            (name, b.finish())
        })
        .collect();
    cases.push(("smooth mesh".into(), single_mesh(&sphere_mesh(4, 5, 1.0, Vec3::ZERO))));
    let triangles: [(&str, [[f32; 3]; 3]); 4] = [
        ("triangle", [[1.0, 0.1, 0.0], [-0.7, 0.9, 0.3], [-0.4, -0.8, -0.2]]),
        ("sliver", [[1.0, 0.1, 0.0], [-0.9, 0.3, 0.3], [-0.95, -0.1, 0.4]]),
        ("tiny triangle", [[1e-12, 1e-13, 0.0], [-7e-13, 9e-13, 3e-13], [-4e-13, -8e-13, -2e-13]]),
        ("huge triangle", [[1e12, 1e11, 0.0], [-7e11, 9e11, 3e11], [-4e11, -8e11, -2e11]]),
    ];
    for (name, corners) in triangles {
        cases.push((name.into(), single_mesh(&mesh_of(&[corners.map(Vec3::from)]))));
    }
    let [a, b, c, d] =
        [[-1.0, -0.5, 0.1], [1.0, -0.5, 0.1], [1.0, 0.5, 0.0], [-1.0, 0.5, 0.0]].map(Vec3::from);
    cases.push(("quad of two triangles".into(), single_mesh(&mesh_of(&[[a, b, c], [a, c, d]]))));
    let mut b = GeometryBuilder::new();
    let shear = DMat4::from_cols(
        DVec4::new(1.0, 0.0, 0.0, 0.0),
        DVec4::new(0.7, 1.0, 0.0, 0.0),
        DVec4::Z,
        DVec4::new(0.0, 0.0, 1.0, 1.0),
    );
    b.add_rectangle(&Transform::from_matrix(shear).unwrap(), false).unwrap();
    cases.push(("parallelogram".into(), b.finish()));

    let (mut count, mut worst) = (0, (1.0, String::new()));
    for (name, geometry) in &cases {
        let (centre, radius) = geometry.bounds().bounding_sphere();
        for (k, offset) in [Vec3::new(0.05, 0.12, 0.03), Vec3::new(-0.9, 0.8, 0.7)].into_iter().enumerate() {
            let p = check_sampler(name, geometry, centre + offset * radius, count);
            if p < worst.0 {
                worst = (p, format!("{name}, view {k}"));
            }
            count += 1;
        }
    }
    // Šidák over all cases at 1 %.
    assert!(worst.0 > 0.01 / count as f64, "p = {} for {}", worst.0, worst.1);
    assert_eq!(count, 2 * (20 + 7));
}

/// Large meshes choose in two levels: every triangle by its area.
#[test]
fn large_meshes_are_sampled_uniformly() {
    let mesh = sphere_mesh(40, 60, 1.0, Vec3::ZERO);
    let geometry = single_mesh(&mesh);
    let sampler = ShapeSampler::new(&geometry, 0).unwrap();
    let mut random = Random::new(21);
    let n = 400_000;
    let mut counts = vec![0.0f64; geometry.prim_count() as usize];
    let mut inside = [0u32; 2];
    for _ in 0..n {
        let s = sampler.sample(&geometry, Vec3::new(0.1, 0.0, 3.0), random.pair()).unwrap();
        counts[s.prim as usize] += 1.0;
        let [a, b, c] = geometry.triangle(s.prim).unwrap();
        inside[usize::from((s.p - a).length() < (s.p - (b + c) * 0.5).length())] += 1;
    }
    let chi2: f64 = (0..geometry.prim_count())
        .map(|i| {
            let e = geometry.area(i) / sampler.area() * f64::from(n);
            (counts[i as usize] - e).powi(2) / e
        })
        .sum();
    let p = chi2_p_value(chi2, f64::from(geometry.prim_count() - 1));
    assert!(p > 1e-3, "p = {p}");
    assert!(inside[0] > n / 3 && inside[1] > n / 10);
}

// ---- Rays that leave ----------------------------------------------------------
// What is met again, leaks and gaps: rows D1 to D6 of the catalogue.

const FAR: Vec3 = Vec3::new(148_376.0, 1234.0, -223_423.0);

/// Spheres and cylinders at 10^±8 places and sizes: rays that leave outward
/// never come back, rays that go inward first meet the other side of a sphere.
#[test]
fn quadrics_are_met_on_the_other_side_alone() {
    let mut random = Random::new(3);
    let (mut tested, mut chords) = (0, 0);
    for case in 0..2000 {
        let size = 10f64.powf(f64::from(random.unit()) * 16.0 - 8.0);
        let at = DVec3::from_array([(); 3].map(|()| f64::from(random.log_uniform(8.0))));
        let rotation = DQuat::from_axis_angle(random.direction().as_dvec3(), f64::from(random.unit()) * 6.0);
        let m = DMat4::from_scale_rotation_translation(DVec3::splat(size), rotation, at);
        let to_world = Transform::from_matrix(m).unwrap();
        let mut b = GeometryBuilder::new();
        if case % 2 == 0 {
            b.add_sphere(DVec3::ZERO, 1.0, &to_world, false).unwrap();
        } else {
            b.add_cylinder([-DVec3::Z, DVec3::Z], 1.0, &to_world, false).unwrap();
        }
        let geometry = b.finish();
        // Towards a point inside, from a few sizes away.
        let target = (at + random.vector().as_dvec3() * 0.4 * size).as_vec3();
        let origin = (at + random.direction().as_dvec3() * 4.0 * size).as_vec3();
        let ray = Ray::new(origin, target - origin);
        let Some(hit) = geometry.intersect(0, &ray, f32::INFINITY) else { continue };
        let surface = geometry.surface(&ray, &hit);
        tested += 1;
        for _ in 0..50 {
            let dir = random.direction();
            let spawned = surface.spawn(dir);
            let again = geometry.intersect(0, &spawned, f32::INFINITY);
            let cos = dir.dot(surface.ng);
            if cos >= 0.0 {
                assert_eq!(again, None, "{case} size {size} at {at}: {spawned:?}");
            } else if case % 2 == 0 && cos < -0.1 && at.abs().max_element() < 1e4 * size {
                let chord = 2.0 * size * f64::from(-cos);
                let t = f64::from(again.expect("inside").t);
                assert!((t - chord).abs() < 0.05 * chord + 1e-2 * size, "{t} is no chord of {chord}");
                chords += 1;
            }
        }
    }
    assert!(tested > 1000 && chords > 10_000, "{tested} hits, {chords} chords");
}

/// A shadow ray between a floor and a light of any kind reaches it, whatever
/// their sizes, distance and place.
#[test]
fn lights_do_not_shadow_themselves() {
    let mut random = Random::new(6);
    let (mut tested, mut stopped) = (0, Vec::new());
    for place in [DVec3::ZERO, DVec3::new(10.0, -20.0, 5.0), FAR.as_dvec3()] {
        for ratio in [0.9999, 0.5, 0.05, 1e-3, 1e-5] {
            for scale in [1e-4, 1.0, 1e4] {
                // The light near the origin and the floor away from it, or the other way round.
                for near_origin in [true, false] {
                    let light = if near_origin { place } else { place + DVec3::Z * scale };
                    let floor = if near_origin { place - DVec3::Z * scale } else { place };
                    check_light(&mut random, light, floor, [ratio * scale, scale], &mut tested, &mut stopped);
                }
            }
        }
    }
    assert!(stopped.is_empty(), "{} of {tested} shadow rays stopped, e.g. {:?}", stopped.len(), stopped[0]);
    assert!(tested > 50_000, "{tested}");
}

fn check_light(
    random: &mut Random,
    light: DVec3,
    floor: DVec3,
    [size, scale]: [f64; 2],
    tested: &mut u32,
    stopped: &mut Vec<String>,
) {
    for kind in ["sphere", "rectangle", "disk", "mesh"] {
        let mut b = GeometryBuilder::new();
        let at = Transform::translate(light);
        let flat =
            at.after(&Transform::from_matrix(DMat4::from_scale(DVec3::new(size, size, -size))).unwrap());
        let shape = match kind {
            "sphere" => b.add_sphere(DVec3::ZERO, size, &at, false).unwrap(),
            "rectangle" => b.add_rectangle(&flat, false).unwrap(),
            "disk" => b.add_disk(&flat, false).unwrap(),
            _ => {
                let mesh = sphere_mesh(6, 9, 1.0, Vec3::ZERO);
                let to_world =
                    at.after(&Transform::from_matrix(DMat4::from_scale(DVec3::splat(size))).unwrap());
                b.add_mesh(&mesh, &to_world, MeshOptions::default()).unwrap().0
            }
        };
        let wide = DMat4::from_scale_rotation_translation(DVec3::splat(scale), DQuat::IDENTITY, floor);
        b.add_rectangle(&Transform::from_matrix(wide).unwrap(), false).unwrap();
        let geometry: Geometry = b.finish();
        // Far away the size of the light is lost in f32: nothing to test.
        let Some(sampler) = ShapeSampler::new(&geometry, shape) else { continue };
        let resolution = f64::from(f32::EPSILON) * light.abs().max(floor.abs()).max_element();
        if size.min(scale - size) < 16.0 * resolution {
            continue;
        }
        let floor_prim = geometry.prim_count() - 1;
        let accel = Accel::build_named(None, &geometry).unwrap();
        for _ in 0..400 {
            let above = (floor
                + DVec3::new(f64::from(random.unit()) - 0.5, f64::from(random.unit()) - 0.5, 1.0) * scale)
                .as_vec3();
            let ray = Ray::new(above, Vec3::NEG_Z);
            let Some(hit) = geometry.intersect(floor_prim, &ray, f32::INFINITY) else { continue };
            let surface = geometry.surface(&ray, &hit);
            let Some(s) = sampler.sample(&geometry, surface.p, random.pair()) else { continue };
            // Faces of the mesh that look away are rightly hidden.
            if s.ng.dot(s.wi) > -1e-3 || s.wi.z <= 0.0 {
                continue;
            }
            *tested += 1;
            if accel.occluded(&geometry, &surface.spawn_to(&s)) {
                stopped.push(format!("{kind} size {size} scale {scale} light {light} floor {floor}"));
            }
        }
    }
}

// ---- Closed forms ------------------------------------------------------------

/// Irradiance at the origin from a shape of radiance 1, normal +z, by a
/// stratified mean of cos/pdf.
fn irradiance(geometry: &Geometry, at: Vec3, side: u32) -> f64 {
    let sampler = ShapeSampler::new(geometry, 0).unwrap();
    let mut random = Random::new(31);
    let mut sum = 0.0;
    for i in 0..side * side {
        let u = Vec2::new((i % side) as f32 + random.unit(), (i / side) as f32 + random.unit()) / side as f32;
        if let Some(s) = sampler.sample(geometry, at, u.min(Vec2::splat(1.0 - 2f32.powi(-24)))) {
            sum += f64::from(s.wi.z.max(0.0)) / f64::from(s.pdf);
        }
    }
    sum / f64::from(side * side)
}

fn sphere_at(height: f64, radius: f64) -> Geometry {
    let mut b = GeometryBuilder::new();
    b.add_sphere(DVec3::new(0.0, 0.0, height), radius, &Transform::IDENTITY, false).unwrap();
    b.finish()
}

/// A2, A3, A4 of the catalogue: E = π·(r/h)² for every size and distance.
#[test]
fn sphere_lights_have_the_right_irradiance() {
    let mut cases: Vec<(f64, f64)> =
        [0.25, 0.05, 5e-3, 5e-4, 5e-5, 5e-7, 0.999, 0.9999, 0.99999, 0.999_999_9]
            .map(|ratio| (1.0, ratio))
            .into();
    cases.extend([(1001.0, 1000.0), (100_001.0, 1e5), (1.496e11, 6.96e8), (1.0001, 1.0)]);
    cases.extend([(1e-12, 5e-13), (1e12, 5e11)]);
    for &(height, radius) in &cases {
        let expected = PI * (radius / height) * (radius / height);
        let found = irradiance(&sphere_at(height, radius), Vec3::ZERO, 256);
        assert!((found / expected - 1.0).abs() < 1e-4, "h {height} r {radius}: {}", found / expected);
    }
    assert_eq!(cases.len(), 16);
    // A5: oblique.
    let mut b = GeometryBuilder::new();
    b.add_sphere(DVec3::new(1.5, 0.0, 1.5), 0.5, &Transform::IDENTITY, false).unwrap();
    let radiance = 0.5 / PI * 10.0 * irradiance(&b.finish(), Vec3::ZERO, 256);
    assert!((radiance / 0.196_418_550 - 1.0).abs() < 1e-4, "{radiance}");
}

/// From inside a sphere the irradiance is π whatever the place and the scale.
#[test]
fn spheres_from_inside_have_the_right_irradiance() {
    for scale in [1e-6, 1.0, 1e6] {
        for (x, z) in [(0.0, 0.0), (0.3, 0.4), (0.0, -0.9), (0.99, 0.0), (0.0, 0.999)] {
            let geometry = sphere_at(0.0, scale);
            let at = Vec3::new(x, 0.0, z) * scale as f32;
            let found = irradiance(&geometry, at, 512);
            assert!((found / PI - 1.0).abs() < 2e-3, "{scale} ({x}, {z}): {}", found / PI);
        }
    }
}

fn rectangle(half: (f64, f64), height: f64) -> Geometry {
    let m = DMat4::from_translation(DVec3::new(0.0, 0.0, height))
        * DMat4::from_scale(DVec3::new(half.0, half.1, 1.0));
    let mut b = GeometryBuilder::new();
    b.add_rectangle(&Transform::from_matrix(m).unwrap(), true).unwrap();
    b.finish()
}

/// A7, A8: rectangles by solid angle, from square to aspect 10¹², and far ones
/// by area; against a/√(h²+a²)·atan(b/√(h²+a²)) (four quarters).
#[test]
fn rectangle_lights_have_the_right_irradiance() {
    let e = irradiance(&rectangle((1.0, 1.0), 1.0), Vec3::ZERO, 256);
    assert!((e / 1.740_839_503 - 1.0).abs() < 1e-5, "{e}");
    let cases = [
        ((1.0, 1.0), 1e-3),
        ((1.0, 1.0), 1e-6),
        ((1.0, 1.0), 3.9),
        ((1.0, 1.0), 4.1),
        ((1.0, 1.0), 1e4),
        ((1e-3, 1.0), 1.0),
        ((1e-6, 1e6), 1.0),
        ((1e6, 1e-6), 1.0),
        ((1e3, 1e3), 1.0),
        ((1e-9, 1e-9), 1e-9),
        ((1e9, 1e9), 1e9),
    ];
    for ((a, b), h) in cases {
        let quarter = |a: f64, b: f64| {
            let r = f64::hypot(h, a);
            a / r * (b / r).atan()
        };
        let expected = 2.0 * (quarter(a, b) + quarter(b, a));
        let found = irradiance(&rectangle((a, b), h), Vec3::ZERO, 512);
        assert!((found / expected - 1.0).abs() < 1e-4, "{a} × {b} at {h}: {}", found / expected);
    }
}

/// A6: discs.
#[test]
fn disk_lights_have_the_right_irradiance() {
    for (r, h) in [(1.0, 1.0), (1e-3, 1.0), (1e-6, 1.0), (1.0, 0.2), (1e6, 1e6)] {
        let m = DMat4::from_translation(DVec3::new(0.0, 0.0, h)) * DMat4::from_scale(DVec3::new(r, r, -1.0));
        let mut b = GeometryBuilder::new();
        b.add_disk(&Transform::from_matrix(m).unwrap(), false).unwrap();
        let found = irradiance(&b.finish(), Vec3::ZERO, 512);
        let expected = PI * r * r / (r * r + h * h);
        assert!((found / expected - 1.0).abs() < 1e-3, "{r} at {h}: {}", found / expected);
    }
}

/// A9: random triangles, far to near, against Lambert's polygon formula.
#[test]
fn triangle_lights_have_the_right_irradiance() {
    let mut random = Random::new(41);
    for case in 0..200 {
        let height = [1.6, 1.05, 6.0, 1.6][case % 4];
        let corners = [(); 3].map(|()| random.vector() + Vec3::new(0.0, 0.0, height));
        let [a, b, c] = corners.map(|v| v.as_dvec3().normalize());
        let edge = |p: DVec3, q: DVec3| {
            let n = p.cross(q);
            n.length().atan2(p.dot(q)) * n.z / n.length()
        };
        let expected = 0.5 * (edge(a, b) + edge(b, c) + edge(c, a)).abs();
        let found = irradiance(&single_mesh(&mesh_of(&[corners])), Vec3::ZERO, 256);
        assert!((found / expected - 1.0).abs() < 1e-2, "case {case}: {found} {expected}");
    }
}
