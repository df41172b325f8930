//! Contracts of lamps that glow by a texture: the density of sampling is the one
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
use etendue::desc::{Category, Mesh, Pixels, Value};
use etendue::light::{AreaLight, Light, Receiver, Target, area_emission_from_desc};
use etendue::math::{DMat4, DVec3, Frame, Ray, Transform, Vec2, Vec3};
use etendue::shape::{Geometry, GeometryBuilder, MeshOptions, ShapeSampler, SurfacePoint};
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
fn lamp(geometry: &Geometry, look: &Look) -> AreaLight {
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
    let id = d.object(Category::Emitter, "area", vec![("radiance", Value::Object(texture))]);
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

fn closest(geometry: &Geometry, ray: &Ray) -> Option<SurfacePoint> {
    let hits = (0..geometry.prim_count()).filter_map(|prim| geometry.intersect(prim, ray, f32::INFINITY));
    let hit = hits.min_by(|a, b| a.t.total_cmp(&b.t))?;
    Some(geometry.surface(ray, &hit))
}

/// Cells of the directions around an axis: squares of the plane at distance 1.
struct Window {
    frame: Frame,
    reach: f64,
    cells: usize,
}

impl Window {
    /// Around the middle of what is seen of a geometry.
    fn of(geometry: &Geometry, p: Vec3) -> Window {
        let bounds = geometry.bounds();
        let frame = Frame::from_normal((bounds.centre() - p).normalize());
        let corner = |i: usize| {
            let pick = |bit: usize| if i >> bit & 1 == 0 { bounds.min } else { bounds.max };
            let local = frame.to_local(Vec3::new(pick(0).x, pick(1).y, pick(2).z) - p);
            f64::from(local.x.abs().max(local.y.abs()) / local.z)
        };
        let reach = (0..8).map(corner).fold(0.0, f64::max) * 1.01;
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

fn look_everywhere(area: &AreaLight, geometry: &Geometry, p: Vec3, window: &Window, name: &str) -> Seen {
    let mut seen =
        Seen { expected: vec![0.0; window.cells * window.cells], total: 0.0, radiance: DVec3::ZERO };
    let mut dark = 0.0;
    window.each(32, |cell, wi, solid_angle| {
        let Some(hit) = closest(geometry, &Ray::new(p, wi)) else { return };
        let pdf = f64::from(area.pdf(geometry, p, &hit, wi, (hit.p - p).length_squared()));
        let le = area.emitted(&hit, -wi).as_dvec3();
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
#[test]
fn textured_lamps_sample_what_they_say() {
    let mut cases = 0;
    for (shape, geometry, points) in shapes() {
        for look in looks() {
            let area = lamp(&geometry, &look);
            let light = Light::from(area.clone());
            for p in &points {
                let name = format!("{shape}, {} from {p}", look.name);
                let window = Window::of(&geometry, *p);
                let seen = look_everywhere(&area, &geometry, *p, &window, &name);
                assert!((seen.total - 1.0).abs() < 6e-3, "{name}: the density integrates to {}", seen.total);
                let mut rng = Pcg64Mcg::seed_from_u64(17);
                let n = 20_000;
                let mut counts = vec![0u64; seen.expected.len()];
                let (mut sum, mut squares, mut odd) = (DVec3::ZERO, DVec3::ZERO, 0);
                for _ in 0..n {
                    let u = Vec2::new(rng.random(), rng.random());
                    // A light leaves out what is black: its shape does not.
                    let point = area.sampler.sample(&geometry, *p, u).unwrap();
                    counts[window.cell(point.wi).unwrap_or(0)] += 1;
                    let Some(s) = light.sample(&geometry, &Receiver::free(*p), u) else { continue };
                    let Target::Surface(target) = s.target else { panic!("{name}") };
                    assert_eq!((target, s.pdf), (point, point.pdf), "{name}");
                    let weight = s.radiance.as_dvec3() / f64::from(s.pdf);
                    sum += weight;
                    squares += weight * weight;
                    let Some(hit) = closest(&geometry, &Ray::new(*p, s.wi)) else { continue };
                    let pdf = area.pdf(&geometry, *p, &hit, s.wi, (hit.p - *p).length_squared());
                    // At the edge of a texel or of a triangle rounding finds the other side.
                    odd += u32::from((pdf / s.pdf - 1.0).abs() > 2e-3 && (hit.p - target.p).length() < 1e-4);
                }
                assert!(odd < 40, "{name}: {odd} of {n} densities differ");
                let expected: Vec<f64> =
                    seen.expected.iter().map(|e| e / seen.total * f64::from(n)).collect();
                let result = chi2(&expected, &counts);
                assert!(result.p_value > 1e-5, "{name}: {result:?}");
                let mean = sum / f64::from(n);
                let error =
                    ((squares / f64::from(n) - mean * mean).max(DVec3::ZERO) / f64::from(n)).powf(0.5);
                let off = (mean - seen.radiance).abs() - error * 4.5 - seen.radiance * 6e-3;
                assert!(off.max_element() < 0.0, "{name}: sampled {mean} ± {error}, seen {}", seen.radiance);
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 8 * 6 * 2);
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
        let id = d.object(Category::Emitter, "area", vec![("radiance", Value::Object(texture))]);
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
    let area = lamp(&geometry, &look);
    let means = [0, 1].map(|prim| area.sampler.mean_pattern(prim).unwrap());
    let mean = area.sampler.mean_of_all().unwrap();
    assert!(means[0] > 6.0 * means[1] && means[1] > 0.0, "{means:?}");
    assert!((mean - 0.5 * (means[0] + means[1])).abs() < 1e-3 * mean, "{means:?} {mean}");
}
