//! Contracts of lamps that glow by a texture, that move, or stand in instances: the density of sampling is the one
//! that hits are weighed by, it is positive where there is light, and what it
//! finds is what looking everywhere finds.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail like tests")]

#[path = "common/chi2.rs"]
mod chi2;
#[path = "common/describe.rs"]
mod describe;

use std::f64::consts::PI;

use chi2::chi2;
use describe::{Describe, string, transform};
use etendue::accel::Accel;
use etendue::desc::{Category, Mesh, Pixels, Value};
use etendue::light::{AreaLight, Light, Receiver, Target, area_emission_from_desc};
use etendue::math::{DMat4, DQuat, DVec3, Frame, Motion, Ray, Transform, Vec2, Vec3};
use etendue::shape::{Geometry, GeometryBuilder, Hit, MeshOptions, ShapeSampler, SurfacePoint};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A picture and how it is looked up.
struct Look {
    name: &'static str,
    size: [u32; 2],
    value: fn(u32, u32) -> f32,
    params: Vec<(&'static str, Value)>,
}

fn noise(x: u32, y: u32) -> f32 {
    (((x + 13 * y + 7).wrapping_mul(2_654_435_761) >> 8) & 0xffff) as f32 / 65_536.0
}

fn looks() -> Vec<Look> {
    let to_uv = |m: DMat4| ("to_uv", transform(m));
    let wide = DMat4::from_scale(DVec3::new(2.3, -1.6, 1.0));
    let turned = DMat4::from_rotation_z(0.5) * DMat4::from_scale(DVec3::splat(1.4));
    vec![
        Look {
            name: "a spot in the dark",
            size: [8, 6],
            value: |x, y| if (x, y) == (5, 1) { 100.0 } else { 0.0 },
            params: vec![],
        },
        Look {
            name: "a spot in dim light, nearest",
            size: [8, 6],
            value: |x, y| if (x, y) == (2, 4) { 100.0 } else { 0.5 },
            params: vec![("filter_type", string("nearest"))],
        },
        Look {
            name: "noise, scaled and mirrored",
            size: [5, 7],
            value: |x, y| noise(x, y).powi(4),
            params: vec![to_uv(wide), ("wrap_mode", string("mirror"))],
        },
        Look {
            name: "half black, clamped",
            size: [4, 3],
            value: |x, y| if x < 2 { 0.0 } else { 1.0 + y as f32 },
            params: vec![to_uv(wide), ("wrap_mode", string("clamp"))],
        },
        Look {
            name: "noise, turned",
            size: [6, 6],
            value: |x, y| noise(x, y).powi(6),
            params: vec![to_uv(turned)],
        },
        Look { name: "nearly constant", size: [3, 3], value: |x, y| 1.0 + 0.1 * noise(x, y), params: vec![] },
    ]
}

/// The first shape of a geometry as a light with that picture, in two colours.
fn lamp(geometry: &Geometry, look: &Look, both_sides: bool) -> AreaLight {
    let mut d = Describe::new();
    let [width, height] = look.size;
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let pixels = texels.flat_map(|(x, y)| {
        [1.0, if (x + y) % 2 == 0 { 0.2 } else { 0.9 }, 0.5].map(|t| t * (look.value)(x, y))
    });
    let image = d.image(look.size, 3, Pixels::F32(pixels.collect()));
    let mut params = vec![("filename", string("lamp.exr")), ("image", image)];
    params.extend(look.params.iter().cloned());
    let texture = d.object(Category::Texture, "bitmap", params);
    let params = vec![("radiance", Value::Object(texture)), ("two_sided", Value::Bool(both_sides))];
    let id = d.object(Category::Emitter, "area", params);
    let emission = area_emission_from_desc(&d.scene, id).expect("an emitter");
    AreaLight::new(geometry, ShapeSampler::new(geometry, 0).expect("a shape with area"), emission)
}

/// Flat shapes and an open mesh, each with points that see all of it.
fn shapes() -> Vec<(&'static str, Geometry, Vec<Vec3>)> {
    let down = DMat4::from_translation(DVec3::Z) * DMat4::from_rotation_x(PI);
    let at = |m: DMat4| Transform::from_matrix(m).unwrap();
    let build = |add: &dyn Fn(&mut GeometryBuilder)| {
        let mut b = GeometryBuilder::new();
        add(&mut b);
        b.finish()
    };
    let mesh = |uvs: [[f32; 2]; 4], bend: f32| Mesh {
        positions: [[-1.0, -1.0, bend], [1.0, -1.0, 0.0], [1.0, 1.0, bend], [-1.0, 1.0, 0.0]]
            .map(Vec3::from)
            .to_vec(),
        uvs: uvs.map(Vec2::from).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let flat = MeshOptions { face_normals: true, ..MeshOptions::default() };
    let add_mesh = |m: Mesh| {
        build(&|b| {
            b.add_mesh(&m, &at(down), flat).unwrap();
        })
    };
    let shear = DMat4::from_cols_array(&[
        1.0, 0.0, 0.0, 0.0, 0.4, 0.8, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ]);
    let (near, far) = (Vec3::new(0.2, -0.1, 0.0), Vec3::new(0.5, 1.0, -4.0));
    let both = vec![near, far];
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    vec![
        (
            "rectangle",
            build(&|b| {
                b.add_rectangle(&at(down), false).unwrap();
            }),
            both.clone(),
        ),
        (
            "parallelogram",
            build(&|b| {
                b.add_rectangle(&at(down * shear), false).unwrap();
            }),
            both.clone(),
        ),
        (
            "disk",
            build(&|b| {
                b.add_disk(&at(down), false).unwrap();
            }),
            both.clone(),
        ),
        ("quad", add_mesh(mesh(unit, 0.0)), both.clone()),
        (
            "quad, u and v exchanged",
            add_mesh(mesh([[0.9, 0.1], [0.9, 1.3], [-0.4, 1.3], [-0.4, 0.1]], 0.0)),
            both.clone(),
        ),
        (
            "quad, texture turned",
            add_mesh(mesh([[0.0, 0.5], [0.5, 0.0], [1.0, 0.5], [0.5, 1.0]], 0.0)),
            both.clone(),
        ),
        (
            "quad, texture bent",
            add_mesh(mesh([[0.0, 0.0], [1.0, 0.1], [0.7, 1.0], [0.0, 0.6]], 0.0)),
            both.clone(),
        ),
        ("two triangles", add_mesh(mesh(unit, 0.4)), both),
    ]
}

/// Cells of the directions around an axis: squares of the plane at distance 1.
struct Window {
    frame: Frame,
    reach: f64,
    cells: usize,
}

impl Window {
    /// Around what lies between these points.
    fn of(corners: &[Vec3], p: Vec3) -> Window {
        let centre = corners.iter().sum::<Vec3>() / corners.len() as f32;
        let frame = Frame::from_normal((centre - p).normalize());
        let reach = |corner: &Vec3| {
            let local = frame.to_local(*corner - p);
            assert!(local.z > 0.0, "not in view: {corner} from {p}");
            f64::from(local.x.abs().max(local.y.abs()) / local.z)
        };
        let reach = corners.iter().map(reach).fold(0.0, f64::max) * 1.01;
        Window { frame, reach, cells: 24 }
    }

    fn cell(&self, wi: Vec3) -> Option<usize> {
        let local = self.frame.to_local(wi).as_dvec3();
        let index = |c: f64| {
            let c = (c / local.z / self.reach + 1.0) * 0.5 * self.cells as f64;
            (c >= 0.0 && c < self.cells as f64).then_some(c as usize)
        };
        Some(index(local.y)? * self.cells + index(local.x)?)
    }

    /// Calls `f` with the cell, the direction and its solid angle of `fine`²
    /// points a cell, one anywhere in each part: edges of texels are no pattern to them.
    fn each(&self, fine: usize, mut f: impl FnMut(usize, Vec3, f64)) {
        let side = self.cells * fine;
        let step = 2.0 * self.reach / side as f64;
        let mut rng = Pcg64Mcg::seed_from_u64(29);
        for j in 0..side {
            for i in 0..side {
                let mut at = |k: usize| (k as f64 + rng.random::<f64>()) * step - self.reach;
                let (x, y) = (at(i), at(j));
                let length2 = 1.0 + x * x + y * y;
                let wi = self.frame.to_world((DVec3::new(x, y, 1.0) / length2.sqrt()).as_vec3());
                f(j / fine * self.cells + i / fine, wi.normalize(), step * step / length2.powf(1.5));
            }
        }
    }
}

/// What comes of one light at one point.
struct Seen {
    /// ∫ pdf dω, by cells and in all; ∫ L dω.
    expected: Vec<f64>,
    total: f64,
    radiance: DVec3,
}

/// One light as one receiver sees it.
struct Case<'a> {
    name: String,
    geometry: &'a Geometry,
    accel: &'a Accel,
    area: &'a AreaLight,
    receiver: Receiver,
    /// What contains it at that time.
    corners: Vec<Vec3>,
}

impl Case<'_> {
    fn closest(&self, wi: Vec3) -> Option<SurfacePoint> {
        let ray = Ray { time: self.receiver.time, ..Ray::new(self.receiver.p, wi) };
        let hit = self.accel.closest(self.geometry, &ray)?;
        Some(self.geometry.surface(&ray, &hit))
    }

    fn pdf(&self, hit: &SurfacePoint, wi: Vec3) -> f32 {
        let distance_squared = (hit.p - self.receiver.p).length_squared();
        self.area.pdf(self.geometry, &self.receiver, (hit, false), wi, distance_squared)
    }

    fn look_everywhere(&self, window: &Window) -> Seen {
        let name = &self.name;
        let mut seen =
            Seen { expected: vec![0.0; window.cells * window.cells], total: 0.0, radiance: DVec3::ZERO };
        let mut dark = 0.0;
        window.each(32, |cell, wi, solid_angle| {
            let Some(hit) = self.closest(wi) else { return };
            let pdf = f64::from(self.pdf(&hit, wi));
            let le = self.area.emitted(self.geometry, &hit, -wi).as_dvec3();
            assert!(pdf >= 0.0 && pdf.is_finite(), "{name}: {pdf}");
            if pdf == 0.0 {
                dark += le.element_sum() * solid_angle;
            }
            seen.expected[cell] += pdf * solid_angle;
            seen.total += pdf * solid_angle;
            seen.radiance += le * solid_angle;
        });
        // At the border of a black texel rounding decides.
        assert!(dark <= 1e-5 * seen.radiance.element_sum(), "{name}: {dark} cannot be found");
        seen
    }

    /// χ² of directions against the density of hits, which integrates to one; the
    /// mean of radiance over density is the integral of radiance.
    fn check(&self) {
        let Case { name, geometry, receiver, .. } = self;
        let light = Light::from(self.area.clone());
        let window = Window::of(&self.corners, receiver.p);
        let seen = self.look_everywhere(&window);
        assert!((seen.total - 1.0).abs() < 6e-3, "{name}: the density integrates to {}", seen.total);
        let mut rng = Pcg64Mcg::seed_from_u64(17);
        let n = 20_000;
        let mut counts = vec![0u64; seen.expected.len()];
        let (mut sum, mut squares, mut odd) = (DVec3::ZERO, DVec3::ZERO, 0);
        for _ in 0..n {
            let u = Vec2::new(rng.random(), rng.random());
            let found = light.sample(geometry, receiver, u);
            if self.area.instance == Hit::NO_INSTANCE {
                // A light leaves out what is black: its shape does not.
                let point = self.area.sampler.sample(geometry, receiver.p, u).unwrap();
                counts[window.cell(point.wi).unwrap_or(0)] += 1;
            } else if let Some(s) = &found {
                counts[window.cell(s.wi).unwrap_or(0)] += 1;
            }
            let Some(s) = found else { continue };
            let Target::Surface(target) = s.target else { panic!("{name}") };
            let weight = s.radiance.as_dvec3() / f64::from(s.pdf);
            sum += weight;
            squares += weight * weight;
            let Some(hit) = self.closest(s.wi) else { continue };
            let pdf = self.pdf(&hit, s.wi);
            // At the edge of a texel or of a triangle rounding finds the other side.
            odd += u32::from((pdf / s.pdf - 1.0).abs() > 2e-3 && (hit.p - target.p).length() < 1e-4);
        }
        assert!(odd < 40, "{name}: {odd} of {n} densities differ");
        let expected: Vec<f64> = seen.expected.iter().map(|e| e / seen.total * f64::from(n)).collect();
        let result = chi2(&expected, &counts);
        assert!(result.p_value > 1e-5, "{name}: {result:?}");
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean).max(DVec3::ZERO) / f64::from(n)).powf(0.5);
        let off = (mean - seen.radiance).abs() - error * 4.5 - seen.radiance * 6e-3;
        assert!(off.max_element() < 0.0, "{name}: sampled {mean} ± {error}, seen {}", seen.radiance);
    }
}

#[test]
fn textured_lamps_sample_what_they_say() {
    let mut cases = 0;
    for (shape, geometry, points) in shapes() {
        let accel = Accel::build_named(Some("brute"), &geometry).unwrap();
        for look in looks() {
            // Those on both sides are seen from behind.
            let front = points.iter().map(|p| (*p, false));
            let back = [(Vec3::new(-0.2, 0.1, 2.0), true), (Vec3::new(0.5, 1.0, 6.0), true)];
            for (p, both_sides) in front.chain(back) {
                let area = lamp(&geometry, &look, both_sides);
                let p = &p;
                let name = format!("{shape}, {} from {p}, both sides: {both_sides}", look.name);
                let receiver = Receiver::free(*p);
                let corners = geometry.bounds().corners().map(|c| c.as_vec3()).to_vec();
                Case { name, geometry: &geometry, accel: &accel, area: &area, receiver, corners }.check();
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 8 * 6 * 4);
}

/// Shapes of a group, that shine upwards in its space.
fn group_shapes() -> Vec<(&'static str, GeometryBuilder)> {
    let build = |add: &dyn Fn(&mut GeometryBuilder)| {
        let mut b = GeometryBuilder::new();
        assert_eq!(b.begin_group(), 1);
        add(&mut b);
        b
    };
    let roof = Mesh {
        positions: [[-1.0, -1.0, 0.2], [1.0, -1.0, 0.0], [1.0, 1.0, 0.2], [-1.0, 1.0, 0.0]]
            .map(Vec3::from)
            .to_vec(),
        uvs: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let id = Transform::IDENTITY;
    vec![
        (
            "rectangle",
            build(&|b| {
                b.add_rectangle(&id, false).unwrap();
            }),
        ),
        (
            "disk",
            build(&|b| {
                b.add_disk(&id, false).unwrap();
            }),
        ),
        (
            "sphere",
            build(&|b| {
                b.add_sphere(DVec3::ZERO, 0.6, &id, false).unwrap();
            }),
        ),
        (
            "mesh",
            build(&|b| {
                b.add_mesh(&roof, &id, MeshOptions::default()).unwrap();
            }),
        ),
    ]
}

/// Ways of an instance, with the times to look at.
fn ways() -> Vec<(&'static str, Motion, Vec<f32>)> {
    let pose = |scale: DVec3, angle: f64, at: DVec3| {
        let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 0.3, 0.2).normalize(), angle);
        Transform::from_matrix(DMat4::from_scale_rotation_translation(scale, rotation, at)).unwrap()
    };
    let (one, far) = (DVec3::ONE, DVec3::new(20.0, -3.0, 5.0));
    let moving = |keys: [Transform; 2]| Motion::new(&[(0.0, keys[0]), (1.0, keys[1])]).unwrap();
    let stretched = DVec3::new(0.7, -1.5, 0.8);
    vec![
        ("still and stretched", Motion::still(pose(stretched, 0.4, far)), vec![0.0]),
        ("still and large", Motion::still(pose(one * 1e4, 0.2, far * 1e4)), vec![0.0]),
        ("turning", moving([pose(one, 0.0, far), pose(one, 0.5, far + DVec3::X)]), vec![0.0, 0.3, 1.0]),
        ("growing", moving([pose(stretched, 0.1, far), pose(stretched * 2.0, 0.3, far)]), vec![0.2, 0.9]),
    ]
}

fn plain_lamp(geometry: &Geometry, textured: bool, both_sides: bool) -> AreaLight {
    let look = Look {
        name: "",
        size: [4, 4],
        value: |x, y| if textured_value(x, y) { 9.0 } else { 1.0 },
        params: vec![("filter_type", string("nearest"))],
    };
    let even = Look { name: "", size: [1, 1], value: |_, _| 2.0, params: vec![] };
    lamp(geometry, if textured { &look } else { &even }, both_sides)
}

fn textured_value(x: u32, y: u32) -> bool {
    (x + 2 * y).is_multiple_of(5)
}

/// The same of lamps in instances, at several times.
#[test]
fn placed_lamps_sample_what_they_say() {
    let mut cases = 0;
    for (shape, builder) in group_shapes() {
        for (way, motion, times) in ways() {
            let mut builder = builder.clone();
            builder.add_instance(1, motion.clone());
            let geometry = builder.finish();
            let accel = Accel::build_named(Some("brute"), &geometry).unwrap();
            for textured in [false, true] {
                for (time, (height, both_sides)) in times
                    .iter()
                    .flat_map(|time| [(1.5, false), (6.0, false), (-2.0, true)].map(|view| (time, view)))
                {
                    let area = plain_lamp(&geometry, textured, both_sides)
                        .placed(&geometry, geometry.first_instance());
                    // Above it in its own space.
                    let pose = motion.at(f64::from(*time));
                    let p = pose.point_f32(Vec3::new(0.2, 0.1, height));
                    let corners = geometry.part_bounds(1).corners().map(|c| pose.point(c).as_vec3()).to_vec();
                    let receiver = Receiver { time: *time, ..Receiver::free(p) };
                    let name = format!(
                        "{shape}, {way} at {time}, textured {textured}, from height {height}, both sides: {both_sides}"
                    );
                    Case { name, geometry: &geometry, accel: &accel, area: &area, receiver, corners }.check();
                    cases += 1;
                }
            }
        }
    }
    assert_eq!(cases, 4 * 7 * 2 * 3);
}

/// Whatever the time, every point of a lamp lies within its bounds, and its
/// normal within the cone of normals.
#[test]
fn bounds_hold_over_the_shutter() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let (mut seen, mut cones) = (0, 0);
    for (shape, builder) in group_shapes() {
        for (way, motion, _) in ways() {
            let mut builder = builder.clone();
            builder.add_instance(1, motion.clone());
            let geometry = builder.finish();
            let light =
                Light::from(plain_lamp(&geometry, false, false).placed(&geometry, geometry.first_instance()));
            let emitters = light.emitters(&geometry, 0);
            assert!(!emitters.is_empty());
            let power: f64 = emitters.iter().map(|e| e.extent.power).sum();
            assert!((light.power(1.0) / power - 1.0).abs() < 1e-9, "{shape}, {way}");
            for _ in 0..2000 {
                let time: f32 = rng.random();
                let u = Vec2::new(rng.random(), rng.random());
                let p = motion.at(f64::from(time)).point_f32(Vec3::new(0.2, 0.1, 2.0));
                let receiver = Receiver { time, ..Receiver::free(p) };
                let Some(s) = light.sample(&geometry, &receiver, u) else { continue };
                let Target::Surface(target) = s.target else { panic!() };
                let own = |e: &&etendue::light::Emitter| (e.prim..e.prim + e.prims).contains(&target.prim);
                let extent = emitters.iter().find(own).unwrap().extent;
                let (min, max) = (extent.bounds.min, extent.bounds.max);
                assert!(target.p.cmpge(min).all() && target.p.cmple(max).all(), "{shape}, {way} at {time}");
                assert!(
                    target.p.distance(extent.bounds.centre()) <= extent.radius,
                    "{shape}, {way} at {time}"
                );
                let angle = etendue::math::angle_between(target.n, extent.axis);
                assert!(angle <= extent.spread, "{shape}, {way} at {time}: {angle} {}", extent.spread);
                seen += 1;
                cones += u32::from(extent.spread < 1.0);
            }
        }
    }
    // All but spheres and what grows have a cone.
    assert!(seen > 25_000 && cones > 15_000, "{seen} {cones}");
}

/// A lamp in an instance does not shadow itself, however far away and however
/// flat the ray arrives.
#[test]
fn placed_lamps_do_not_shadow_themselves() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let (mut traced, mut occluded) = (0, 0u32);
    // Turned one way in its group and back by the instance: what is rounded there
    // goes across what is flat here.
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 0.3, 0.2).normalize(), 0.6);
    let [tilted, back] = [turn, turn.inverse()].map(|q| Transform::from_matrix(DMat4::from_quat(q)).unwrap());
    let mut tilt = GeometryBuilder::new();
    tilt.begin_group();
    tilt.add_rectangle(&tilted, false).unwrap();
    let mut cases = vec![("tilted", tilt, "turned back", Motion::still(back))];
    for (shape, builder) in group_shapes() {
        cases.extend(ways().into_iter().map(|(way, motion, _)| (shape, builder.clone(), way, motion)));
    }
    for (shape, mut builder, way, motion) in cases {
        let upright = if shape == "tilted" { tilted } else { Transform::IDENTITY };
        builder.add_instance(1, motion.clone());
        let geometry = builder.finish();
        let accel = Accel::build_named(None, &geometry).unwrap();
        let light =
            Light::from(plain_lamp(&geometry, false, false).placed(&geometry, geometry.first_instance()));
        for i in 0..4000 {
            let time: f32 = rng.random();
            let far = 10f32.powf(4.0 * rng.random::<f32>());
            let height = if i % 2 == 0 { 0.01 } else { 1.0 };
            let side = Vec3::new(rng.random(), rng.random(), height * rng.random::<f32>())
                - Vec3::new(0.5, 0.5, 0.0);
            // Above all of it, the bent mesh included.
            let pose = motion.at(f64::from(time)).after(&upright);
            let p = pose.point_f32(side * 2.0 * far + Vec3::Z * 0.25);
            let from = SurfacePoint {
                p,
                p_error: p.abs() * 1e-7,
                ng: Vec3::Z,
                ns: Vec3::Z,
                uv: Vec2::ZERO,
                barycentric: Vec2::ZERO,
                dpdu: Vec3::ZERO,
                dpdv: Vec3::ZERO,
                prim: u32::MAX - 1,
                shape: 0,
                instance: Hit::NO_INSTANCE,
                time,
                planar: false,
            };
            let u = Vec2::new(rng.random(), rng.random());
            let receiver = Receiver { time, ..Receiver::free(p) };
            let Some(s) = light.sample(&geometry, &receiver, u) else { continue };
            let Target::Surface(target) = s.target else { panic!() };
            // Folds of the mesh hide each other.
            if shape == "mesh" && s.wi.dot(target.ng).abs() < 0.4 {
                continue;
            }
            traced += 1;
            if accel.occluded(&geometry, &from.spawn_to(&target)) {
                occluded += 1;
                println!("{shape}, {way} at {time} from {far}: {}", s.wi.dot(target.ng));
            }
        }
    }
    assert!(traced > 30_000 && occluded == 0, "{occluded} of {traced}");
}

/// Far from a grey picture whose texels lie along a rectangle, radiance over
/// density is what the distance and the angle make of the mean.
#[test]
fn a_grey_picture_adds_no_noise() {
    let (_, geometry, points) = shapes().swap_remove(0);
    for filter in ["bilinear", "nearest"] {
        let mut d = Describe::new();
        let image = d.image([9, 5], 1, Pixels::F32((0..45).map(|i| noise(i, 0).powi(8)).collect()));
        let params = vec![("filename", string("l.exr")), ("image", image), ("filter_type", string(filter))];
        let texture = d.object(Category::Texture, "bitmap", params);
        let params = vec![("radiance", Value::Object(texture))];
        let id = d.object(Category::Emitter, "area", params);
        let emission = area_emission_from_desc(&d.scene, id).unwrap();
        let area = AreaLight::new(&geometry, ShapeSampler::new(&geometry, 0).unwrap(), emission);
        let mean = area.sampler.mean_of_all().unwrap();
        let (light, p) = (Light::from(area), points[1]);
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        for _ in 0..4000 {
            let u = Vec2::new(rng.random(), rng.random());
            let Some(s) = light.sample(&geometry, &Receiver::free(p), u) else { continue };
            let Target::Surface(target) = s.target else { panic!() };
            let form = f64::from(s.wi.dot(target.ng).abs()) / f64::from((target.p - p).length_squared());
            let found = f64::from(s.radiance.x) / f64::from(s.pdf) / form;
            // Near the edge of a dark texel the digits of (u, v) show.
            assert!((found / (4.0 * mean) - 1.0).abs() < 2e-3, "{filter}: {found} not {}", 4.0 * mean);
        }
    }
}

/// Whatever a texture shows of a mesh, none of its triangles is out of reach,
/// and those that shine are chosen by what they give.
#[test]
fn triangles_are_chosen_by_their_light() {
    let (_, geometry, _) = shapes().pop().unwrap();
    let look = Look { name: "", size: [16, 16], value: |x, y| if x > y { 1.0 } else { 0.0 }, params: vec![] };
    let area = lamp(&geometry, &look, false);
    let means = [0, 1].map(|prim| area.sampler.mean_pattern(prim).unwrap());
    let mean = area.sampler.mean_of_all().unwrap();
    assert!(means[0] > 6.0 * means[1] && means[1] > 0.0, "{means:?}");
    assert!((mean - 0.5 * (means[0] + means[1])).abs() < 1e-3 * mean, "{means:?} {mean}");
}
