//! Contracts of all lights, closed forms, and values of Mitsuba 3.9.1.
//!
//! The reference numbers were printed by the Python module of Mitsuba 3.9.1,
//! variant `scalar_rgb`: `mi.load_dict({"type": "envmap", …})`, then `eval` at a
//! `SurfaceInteraction3f` of zeros with `wi` set to minus the direction; for
//! the other lights `sample_direction` at the point given.

#![allow(clippy::excessive_precision, reason = "reference numbers stand as they were printed")]
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail like tests")]

#[path = "common/describe.rs"]
mod describe;

use std::f64::consts::{PI, TAU};

use describe::{Describe, float, look_at, string, transform, vector};
use etendue::desc::{Category, Error, Mesh, Pixels, Value};
use etendue::light::{AreaLight, Light, Receiver, Target, area_emission_from_desc, emitter_from_desc};
use etendue::math::{DMat4, DVec3, Ray, Rgb, Transform, Vec2, Vec3};
use etendue::shape::{Geometry, GeometryBuilder, MeshOptions, ShapeSampler, SurfacePoint};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

type Params = Vec<(&'static str, Value)>;

fn read(plugin: &str, params: Params) -> Result<Light, Error> {
    let mut d = Describe::new();
    let id = d.object(Category::Emitter, plugin, params);
    emitter_from_desc(&d.scene, id, DVec3::ZERO, [0.0; 2])
}

fn empty() -> Geometry {
    GeometryBuilder::new().finish()
}

fn draw(rng: &mut Pcg64Mcg) -> Vec2 {
    Vec2::new(rng.random(), rng.random())
}

/// Directions on a grid of θ × φ cells with their solid angles: the middles of
/// `fine` × `fine` parts of each of `rows` × `columns` cells.
struct Grid {
    rows: usize,
    columns: usize,
    fine: usize,
}

impl Grid {
    fn direction(theta: f64, phi: f64) -> Vec3 {
        let (sin, cos) = theta.sin_cos();
        DVec3::new(sin * phi.cos(), sin * phi.sin(), cos).as_vec3()
    }

    fn cell(&self, d: Vec3) -> usize {
        let theta = d.truncate().length().atan2(d.z) / std::f32::consts::PI;
        let phi = (d.y.atan2(d.x) / std::f32::consts::TAU).rem_euclid(1.0);
        let row = ((theta * self.rows as f32) as usize).min(self.rows - 1);
        let column = ((phi * self.columns as f32) as usize).min(self.columns - 1);
        row * self.columns + column
    }

    /// ∫ f dω over each cell.
    fn integrate(&self, f: impl Fn(Vec3) -> DVec3) -> Vec<DVec3> {
        let (rows, columns) = (self.rows * self.fine, self.columns * self.fine);
        let mut out = vec![DVec3::ZERO; self.rows * self.columns];
        for j in 0..rows {
            // The solid angle of a thin ring, exactly.
            let (above, below) = (PI * j as f64 / rows as f64, PI * (j + 1) as f64 / rows as f64);
            let solid_angle = (above.cos() - below.cos()) * TAU / columns as f64;
            for i in 0..columns {
                let d = Grid::direction(0.5 * (above + below), TAU * (i as f64 + 0.5) / columns as f64);
                out[j / self.fine * self.columns + i / self.fine] += f(d) * solid_angle;
            }
        }
        out
    }
}

/// χ² of counts against expected counts, cells below 5 pooled: (χ², degrees of
/// freedom, value exceeded with probability 1e-5 by Wilson and Hilferty).
fn chi2(counts: &[u32], expected: &[f64]) -> (f64, f64, f64) {
    let mut cells: Vec<(f64, f64)> = Vec::new();
    let mut pool = (0.0, 0.0);
    for (count, expected) in counts.iter().zip(expected) {
        let cell = (f64::from(*count), *expected);
        if cell.1 < 5.0 {
            pool = (pool.0 + cell.0, pool.1 + cell.1);
        } else {
            cells.push(cell);
        }
    }
    if pool.1 >= 5.0 || pool.0 > 5.0 {
        cells.push((pool.0, pool.1.max(1e-3)));
    }
    let sum = cells.iter().map(|(count, expected)| (count - expected).powi(2) / expected).sum();
    let k = (cells.len() as f64 - 1.0).max(1.0);
    let spread = 2.0 / (9.0 * k);
    (sum, k, k * (1.0 - spread + 4.265 * spread.sqrt()).powi(3))
}

/// Sampled directions follow the density, the density integrates to one, and
/// radiance over density averages to the integral of radiance.
#[test]
fn environments_sample_what_they_say() {
    let geometry = empty();
    let grid = Grid { rows: 12, columns: 24, fine: 40 };
    let environments: Vec<_> =
        Light::examples().into_iter().filter(|(_, light)| light.is_environment()).collect();
    assert_eq!(environments.len(), 17);
    for (name, light) in &environments {
        let density = grid.integrate(|d| DVec3::splat(f64::from(light.pdf_environment(d))));
        let total: f64 = density.iter().map(|d| d.x).sum();
        assert!((total - 1.0).abs() < 1e-3, "{name}: density integrates to {total}");

        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let n = 60_000;
        let mut counts = vec![0u32; grid.rows * grid.columns];
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for _ in 0..n {
            let s = light.sample(&geometry, &Receiver::free(Vec3::ZERO), draw(&mut rng)).expect(name);
            assert!((s.wi.length() - 1.0).abs() < 1e-6 && !s.delta && matches!(s.target, Target::Infinite));
            assert_eq!(s.pdf, light.pdf_environment(s.wi), "{name}: one density");
            assert_eq!(s.radiance, light.environment(s.wi), "{name}: one radiance");
            counts[grid.cell(s.wi)] += 1;
            let weight = s.radiance.as_dvec3() / f64::from(s.pdf);
            sum += weight;
            squares += weight * weight;
        }
        let expected: Vec<f64> = density.iter().map(|d| d.x / total * f64::from(n)).collect();
        let (chi2, freedom, limit) = chi2(&counts, &expected);
        assert!(chi2 < limit, "{name}: χ² = {chi2} with {freedom} degrees of freedom");

        let integral: DVec3 = grid.integrate(|d| light.environment(d).as_dvec3()).into_iter().sum();
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean).max(DVec3::ZERO) / f64::from(n)).powf(0.5);
        let off = (mean - integral).abs() - error * 4.5 - integral * 1e-3;
        assert!(off.max_element() < 0.0, "{name}: mean weight {mean} ± {error}, quadrature {integral}");
        let power = light.power(1.0 / PI.sqrt());
        assert!((power / (integral.element_sum() / 3.0) - 1.0).abs() < 1e-3, "{name}: power {power}");
    }
}

/// Nothing that shines is left out by sampling: poles, seams and the black
/// neighbours of bright texels included.
#[test]
fn density_is_positive_where_there_is_light() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut bright = 0;
    for (name, light) in Light::examples().into_iter().filter(|(_, light)| light.is_environment()) {
        let axis = DVec3::new(0.48, 0.6, 0.64);
        let turn = |d: DVec3| (glam::DQuat::from_axis_angle(axis, 1.1) * d).as_vec3();
        let mut directions: Vec<Vec3> =
            [DVec3::Y, -DVec3::Y, DVec3::X, DVec3::Z, -DVec3::X, -DVec3::Z].map(turn).to_vec();
        directions.extend((0..2000).map(|_| etendue::sampling::uniform_sphere(draw(&mut rng))));
        for d in directions {
            let (l, pdf) = (light.environment(d), light.pdf_environment(d));
            assert!(l.is_finite() && l.min_element() >= 0.0 && pdf.is_finite() && pdf >= 0.0, "{name} {d}");
            assert_eq!(l.max_element() > 0.0, pdf > 0.0, "{name} {d}: radiance {l}, density {pdf}");
            bright += usize::from(pdf > 0.0);
        }
        for u in [[0.0, 0.0], [0.0, 0.999_999_94], [0.999_999_94, 0.0], [0.999_999_94, 0.999_999_94]] {
            if let Some(s) = light.sample(&empty(), &Receiver::free(Vec3::ZERO), Vec2::from(u)) {
                assert!(s.wi.is_finite() && s.pdf > 0.0 && s.pdf.is_finite(), "{name} {u:?}");
            }
        }
    }
    assert!(bright > 10_000, "{bright}");
}

fn env_map(size: [u32; 2], pixels: Vec<f32>, more: Params) -> Result<Light, Error> {
    let mut d = Describe::new();
    let channels = pixels.len() as u32 / size[0] / size[1];
    let image = d.image(size, channels, Pixels::F32(pixels));
    let mut params = vec![("filename", string("map.exr")), ("image", image)];
    params.extend(more);
    let id = d.object(Category::Emitter, "envmap", params);
    emitter_from_desc(&d.scene, id, DVec3::ZERO, [0.0; 2])
}

#[test]
fn a_grey_map_has_no_variance() {
    // Radiance over density is the integral itself, whichever the direction.
    let noise = |i: u32| ((i.wrapping_mul(2_654_435_761) >> 8) & 0xffff) as f32;
    let light = env_map([33, 17], (0..33 * 17).map(noise).collect(), vec![]).unwrap();
    let integral = light.power(1.0 / PI.sqrt());
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for _ in 0..1000 {
        let s = light.sample(&empty(), &Receiver::free(Vec3::ZERO), draw(&mut rng)).unwrap();
        let weight = f64::from(s.radiance.x) / f64::from(s.pdf);
        assert!((weight / integral - 1.0).abs() < 1e-5, "{weight} not {integral}");
    }
}

/// Catalogue A25: irradiance of a plane facing one texel of 1e6 among ones.
#[test]
fn irradiance_of_a_sun_in_a_uniform_sky() {
    let (width, height) = (64, 33);
    let value = |i: u32| if i == 20 * width + 17 { 1e6 } else { 1.0 };
    let light = env_map([width, height], (0..width * height).map(value).collect(), vec![]).unwrap();
    // The tent around texel (17, 20), integrated where its cells are.
    let (d_phi, d_theta) = (TAU / f64::from(width), PI / f64::from(height - 1));
    let (phi0, theta0) = (d_phi * 17.5, d_theta * 20.0);
    let local =
        |theta: f64, phi: f64| DVec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin());
    let n = local(theta0, phi0);
    let steps = 400;
    let mut expected = PI;
    for j in 0..steps {
        for i in 0..steps {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0;
            let (s, t) = (at(i), at(j));
            let (phi, theta) = (phi0 + s * d_phi, theta0 + t * d_theta);
            let tent = (1.0 - s.abs()) * (1.0 - t.abs()) * (1e6 - 1.0);
            let area = d_phi * d_theta * 4.0 / f64::from(steps * steps) * theta.sin();
            expected += tent * n.dot(local(theta, phi)).max(0.0) * area;
        }
    }
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let (count, mut sum, mut squares) = (100_000, 0.0, 0.0);
    for _ in 0..count {
        let s = light.sample(&empty(), &Receiver::free(Vec3::ZERO), draw(&mut rng)).unwrap();
        let cos = s.wi.as_dvec3().dot(n).max(0.0);
        let e = f64::from(s.radiance.x) * cos / f64::from(s.pdf);
        sum += e;
        squares += e * e;
    }
    let mean = sum / f64::from(count);
    let error = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
    assert!(error < 3e-4 * expected, "{error}");
    assert!((mean - expected).abs() < 4.0 * error + 1e-5 * expected, "{mean} ± {error}, not {expected}");
}

/// Direction and radiance.
type EnvRow = ([f32; 3], [f32; 3]);

#[test]
fn environment_maps_are_mitsubas() {
    let texel = |k: u32| {
        let (c, x, y) = (k % 3, k / 3 % 5, k / 15);
        ((x * 7 + y * 13 + c * 5) % 17) as f32 / 16.0 + 0.05 * x as f32
    };
    let map = |to_world: DMat4| {
        let more = vec![("scale", float(2.5)), ("to_world", transform(to_world))];
        env_map([5, 4], (0..60).map(texel).collect(), more).unwrap()
    };
    let check = |name: &str, light: &Light, rows: &[EnvRow]| {
        for (d, expected) in rows {
            let found = light.environment(Vec3::from(*d).normalize());
            let off = (found - Rgb::from(*expected)).abs().max_element();
            assert!(off < 2e-5, "{name} {d:?}: {found} not {expected:?}");
        }
    };
    let rows = [
        ([0.0, 0.0, 1.0], [1.5, 2.28125, 1.734375]),
        ([0.0, 0.0, -1.0], [1.5, 1.617187, 1.070312]),
        ([1.0, 0.0, 0.0], [1.636719, 1.089844, 1.539062]),
        ([-1.0, 0.0, 0.0], [1.363281, 1.148438, 1.597656]),
        ([0.3030458, 0.808122, -0.5050763], [1.265148, 0.5605383, 1.15599]),
        ([-0.1727737, -0.6047079, 0.7774816], [1.324495, 1.699053, 2.424777]),
        ([0.1004784, 0.9947363, 0.02009568], [1.068436, 1.825493, 0.4334834]),
        ([0.009997501, -0.9997501, 0.019995], [1.106222, 0.907425, 1.688675]),
        ([-0.6350006, 0.1270001, -0.7620008], [1.345961, 2.074086, 1.29147]),
        ([0.6811543, 0.2919233, 0.6714235], [1.271853, 1.689357, 1.702686]),
        ([-0.0009805802, 0.196116, 0.9805802], [1.617326, 2.397918, 1.351798]),
        ([0.0009805802, 0.196116, 0.9805802], [1.6175, 2.398092, 1.351973]),
    ];
    check("plain", &map(DMat4::IDENTITY), &rows);
    // T().rotate(axis, 70); Mitsuba takes the axis as it comes, so it must have unit length.
    let axis = DVec3::new(0.3, 0.5, 0.8).normalize();
    let rows = [
        ([0.0, 0.0, 1.0], [1.40858, 2.079513, 1.13042]),
        ([1.0, 0.0, 0.0], [1.716417, 1.304762, 2.086012]),
        ([0.3030458, 0.808122, -0.5050763], [1.714043, 1.139572, 1.293141]),
        ([0.1004784, 0.9947363, 0.02009568], [0.9508114, 1.133391, 1.887913]),
        ([0.6811543, 0.2919233, 0.6714235], [1.524269, 2.01273, 1.669616]),
    ];
    check("turned", &map(DMat4::from_axis_angle(axis, 70.0f64.to_radians())), &rows);
    // T().scale([-1, 1, 1]) @ T().rotate([0, 1, 0], 25)
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let rows = [
        ([0.0, 0.0, 1.0], [1.462023, 1.782118, 1.696398]),
        ([-1.0, 0.0, 0.0], [1.598741, 1.18099, 1.833116]),
        ([0.3030458, 0.808122, -0.5050763], [1.58372, 1.698496, 0.931604]),
        ([0.6811543, 0.2919233, 0.6714235], [0.8349966, 1.052254, 1.787645]),
    ];
    check("mirrored", &map(mirror * DMat4::from_rotation_y(25.0f64.to_radians())), &rows);
}

/// Reference point, direction towards the light, radiance.
type DeltaRow = ([f32; 3], [f32; 3], [f32; 3]);

fn check_delta(name: &str, light: &Light, rows: &[DeltaRow]) {
    assert!(light.is_delta() && !light.is_environment());
    for (p, wi, radiance) in rows {
        let found = light.sample(&empty(), &Receiver::free(Vec3::from(*p)), Vec2::splat(0.5));
        if *radiance == [0.0; 3] {
            assert!(found.is_none(), "{name} {p:?}");
            continue;
        }
        let s = found.unwrap_or_else(|| panic!("{name} {p:?}"));
        assert!(s.delta && s.pdf == 1.0);
        assert!((s.wi - Vec3::from(*wi)).length() < 2e-6, "{name} {p:?}: {}", s.wi);
        let off = (s.radiance - Rgb::from(*radiance)).abs().max_element();
        assert!(off < 2e-6, "{name} {p:?}: {} not {radiance:?}", s.radiance);
        assert_eq!(light.environment(s.wi), Rgb::ZERO);
        assert_eq!(light.pdf_environment(s.wi), 0.0);
    }
}

const POINTS: [[f32; 3]; 6] = [
    [2.376494, 0.6235056, 2.541169],
    [2.383054, 0.790629, 2.059477],
    [2.016393, 0.3673262, 2.229401],
    [2.597039, 0.6466146, 3.133474],
    [2.86319, 1.132201, 2.475167],
    [0.4285845, 2.866925, 3.043877],
];
const TOWARDS: [[f32; 3]; 6] = [
    [-0.6882472, 0.6882472, 0.2294158],
    [-0.6700919, 0.5859422, 0.4556848],
    [-0.4905761, 0.7880328, 0.3719402],
    [-0.7613583, 0.6452011, -0.06363139],
    [-0.8783161, 0.4090842, 0.2474088],
    [0.5498449, -0.834199, -0.04222078],
];

fn view() -> DMat4 {
    look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, -1.0, 2.0), DVec3::new(0.0, 1.0, 0.2))
}

#[test]
fn spots_are_mitsubas() {
    let rows = |radiance: [[f32; 3]; 6]| -> Vec<DeltaRow> {
        POINTS.into_iter().zip(TOWARDS).zip(radiance).map(|((p, wi), r)| (p, wi, r)).collect()
    };
    let grey = |v: [f32; 6]| v.map(|v| [v; 3]);
    let pose = || ("to_world", transform(view()));
    let light = read("spot", vec![pose(), ("intensity", Value::Rgb([1.0, 2.0, 3.0]))]).unwrap();
    let radiance = [0.25, 0.2347418, 0.2268239, 0.1114369, 0.02350132, 0.0].map(|v| [v, 2.0 * v, 3.0 * v]);
    check_delta("default", &light, &rows(radiance));
    let light =
        read("spot", vec![pose(), ("cutoff_angle", float(40.0)), ("beam_width", float(10.0))]).unwrap();
    let radiance = grey([0.25, 0.2010727, 0.1931136, 0.1700879, 0.1520651, 0.0]);
    check_delta("40, 10", &light, &rows(radiance));
    let scaled = view() * DMat4::from_scale(DVec3::new(2.0, 1.0, 3.0));
    let light = read("spot", vec![("to_world", transform(scaled)), ("cutoff_angle", float(40.0))]).unwrap();
    let radiance = grey([0.25, 0.2347418, 0.1064107, 0.2272727, 0.0, 0.0]);
    check_delta("scaled", &light, &rows(radiance));

    let mut d = Describe::new();
    let pixels =
        vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.9, 0.1, 0.5, 0.2, 0.3, 0.1, 0.6, 0.6, 0.2];
    let image = d.image([3, 2], 3, Pixels::F32(pixels));
    let params = vec![("filename", string("map.exr")), ("image", image), ("wrap_mode", string("clamp"))];
    let texture = d.object(Category::Texture, "bitmap", params);
    let params = vec![pose(), ("cutoff_angle", float(40.0)), ("texture", Value::Object(texture))];
    let id = d.object(Category::Emitter, "spot", params);
    let light = emitter_from_desc(&d.scene, id, DVec3::ZERO, [0.0; 2]).unwrap();
    let radiance = [
        [0.075, 0.1, 0.0875],
        [0.1049679, 0.1225715, 0.09489709],
        [0.1025718, 0.1244199, 0.1286154],
        [0.1016671, 0.05647361, 0.08226487],
        [0.05590867, 0.07630927, 0.03374733],
        [0.0; 3],
    ];
    check_delta("textured", &light, &rows(radiance));
}

/// KHR_lights_punctual: clamp((cos θ − cos c) / (cos b − cos c))², which over all
/// directions is 2π·(1 − cos b + (cos b − cos c) / 3).
#[test]
fn squared_spots_are_gltfs() {
    for [beam, cutoff] in [[10.0f64, 40.0], [0.0, 45.0], [0.0, 90.0], [0.01, 0.02], [60.0, 170.0]] {
        let params = vec![
            ("beam_width", float(beam)),
            ("cutoff_angle", float(cutoff)),
            ("falloff", string("squared")),
        ];
        let light = read("spot", params).unwrap();
        let [b, c] = [beam, cutoff].map(|degrees| degrees.to_radians().cos());
        for k in 0..60 {
            let angle = f64::from(k) / 50.0 * cutoff.to_radians();
            let d = Grid::direction(angle, 0.3);
            let found = light.sample(&empty(), &Receiver::free(d), Vec2::ZERO).map_or(0.0, |s| s.radiance.x);
            // The f32 direction is not quite at the angle.
            let cos = f64::from(d.truncate().length()).atan2(f64::from(d.z)).cos();
            let expected = ((cos - c) / (b - c)).clamp(0.0, 1.0).powi(2);
            assert!(
                (f64::from(found) - expected).abs() < 1e-5,
                "{beam} {cutoff} {angle}: {found} {expected}"
            );
        }
        let power = TAU * (1.0 - b + (b - c) / 3.0);
        assert!((light.power(1.0) / power - 1.0).abs() < 1e-8, "{beam} {cutoff}: {}", light.power(1.0));
    }
    let wrong = read("spot", vec![("falloff", string("square"))]).unwrap_err().to_string();
    assert!(wrong.contains("`falloff` has no value `square`; did you mean `squared`?"), "{wrong}");
}

#[test]
fn points_and_directions_are_mitsubas() {
    let colour = Value::Rgb([1.0, 2.0, 3.0]);
    let rows = [
        (POINTS[1], TOWARDS[1], [0.2347418, 0.4694836, 0.7042253]),
        (POINTS[2], TOWARDS[2], [0.2329645, 0.465929, 0.6988935]),
        (POINTS[3], TOWARDS[3], [0.2272727, 0.4545454, 0.6818181]),
    ];
    let light =
        read("point", vec![("position", vector(1.0, 2.0, 3.0)), ("intensity", colour.clone())]).unwrap();
    check_delta("position", &light, &rows);
    let light = read("point", vec![("to_world", transform(view())), ("intensity", colour.clone())]).unwrap();
    check_delta("to_world", &light, &rows);

    let to = [-0.4364358, 0.8728716, -0.2182179];
    let light =
        read("directional", vec![("direction", vector(1.0, -2.0, 0.5)), ("irradiance", colour)]).unwrap();
    check_delta("direction", &light, &[(POINTS[0], to, [1.0, 2.0, 3.0]), (POINTS[5], to, [1.0, 2.0, 3.0])]);
    let light = read("directional", vec![("to_world", transform(view()))]).unwrap();
    check_delta("to_world", &light, &[(POINTS[0], [-0.6882472, 0.6882472, 0.2294157], [1.0; 3])]);
    let light = read("directional", vec![]).unwrap();
    check_delta("default", &light, &[(POINTS[0], [0.0, 0.0, -1.0], [1.0; 3])]);
}

/// Catalogue A1: a point light of I = h² at height h gives irradiance 1.
#[test]
fn point_irradiance_at_every_scale() {
    for h in [1e-18, 1e-3, 1.0, 1e3, 1e6, 1e18] {
        let params = vec![("position", vector(0.0, 0.0, h)), ("intensity", Value::Rgb([h * h; 3]))];
        let light = read("point", params).unwrap();
        let s = light.sample(&empty(), &Receiver::free(Vec3::ZERO), Vec2::ZERO).unwrap();
        assert!((s.radiance.x - 1.0).abs() < 1e-6 && s.wi == Vec3::Z, "height {h}: {}", s.radiance);
        assert!(
            light.sample(&empty(), &Receiver::free(Vec3::new(0.0, 0.0, h as f32)), Vec2::ZERO).is_none(),
            "on the light"
        );
    }
}

/// Catalogue A14: what leaves a light through a sphere around it is its power.
#[test]
fn flux_of_local_lights_is_their_power() {
    let mut tested = 0;
    for (name, light) in Light::examples() {
        if !matches!(light, Light::Point(_) | Light::Spot(_)) {
            continue;
        }
        tested += 1;
        let centre = DVec3::new(1.0, 2.0, 3.0);
        let grid = Grid { rows: 20_000, columns: 8, fine: 1 };
        let flux: DVec3 = grid
            .integrate(|d| {
                let p = (centre + d.as_dvec3()).as_vec3();
                light
                    .sample(&empty(), &Receiver::free(p), Vec2::ZERO)
                    .map_or(DVec3::ZERO, |s| s.radiance.as_dvec3())
            })
            .into_iter()
            .sum();
        let (flux, power) = (flux.element_sum() / 3.0, light.power(1.0));
        assert!((flux / power - 1.0).abs() < 1e-3, "{name}: flux {flux}, power {power}");
    }
    assert_eq!(tested, 7);
}

#[test]
fn recentring_is_done_in_double_precision() {
    let far = DVec3::new(1e9, -1e9, 1e9);
    let mut d = Describe::new();
    let to_world = DMat4::from_translation(far) * view();
    let point =
        d.object(Category::Emitter, "point", vec![("position", vector(1e9 + 1.0, 2.0 - 1e9, 3.0 + 1e9))]);
    let spot = d.object(Category::Emitter, "spot", vec![("to_world", transform(to_world))]);
    for id in [point, spot] {
        let light = emitter_from_desc(&d.scene, id, far, [0.0; 2]).unwrap();
        let s = light.sample(&empty(), &Receiver::free(Vec3::from(POINTS[1])), Vec2::ZERO).unwrap();
        assert!((s.wi - Vec3::from(TOWARDS[1])).length() < 2e-6, "{}", s.wi);
        assert!((s.radiance.x - 0.2347418).abs() < 1e-6);
        assert!(matches!(s.target, Target::Point(p) if (p - Vec3::new(1.0, 2.0, 3.0)).length() < 1e-6));
    }
}

/// The first shape of a geometry as a light, with a checkerboard or a colour.
fn area_light(geometry: &Geometry, textured: bool, both_sides: bool) -> AreaLight {
    let mut d = Describe::new();
    let params = vec![("color0", Value::Rgb([8.0, 4.0, 2.0])), ("color1", float(1.0))];
    let texture = d.object(Category::Texture, "checkerboard", params);
    let radiance = if textured { Value::Object(texture) } else { float(1.0) };
    let params = vec![("radiance", radiance), ("two_sided", Value::Bool(both_sides))];
    let id = d.object(Category::Emitter, "area", params);
    let emission = area_emission_from_desc(&d.scene, id).expect("an emitter");
    AreaLight::new(geometry, ShapeSampler::new(geometry, 0).expect("a shape with area"), emission)
}

/// Glowing shapes and a point that sees them.
fn glowing_shapes() -> Vec<(&'static str, Geometry, Vec3)> {
    let at = |m: DMat4| Transform::from_matrix(m).unwrap();
    let down = DMat4::from_translation(DVec3::Z) * DMat4::from_rotation_x(PI);
    let small = at(DMat4::from_translation(DVec3::new(0.3, 0.2, 1.5)) * DMat4::from_scale(DVec3::splat(0.4)));
    let build = |add: &dyn Fn(&mut GeometryBuilder)| {
        let mut b = GeometryBuilder::new();
        add(&mut b);
        b.finish()
    };
    let flipped = MeshOptions { flip_normals: true, ..MeshOptions::default() };
    let tetrahedron = Mesh {
        positions: [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
            .map(Vec3::from)
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
        ..Mesh::default()
    };
    let (o, id) = (DVec3::ZERO, Transform::IDENTITY);
    vec![
        (
            "rectangle",
            build(&|b| {
                b.add_rectangle(&at(down), false).unwrap();
            }),
            Vec3::ZERO,
        ),
        (
            "rectangle, far",
            build(&|b| {
                b.add_rectangle(&at(down), false).unwrap();
            }),
            Vec3::new(0.5, 3.0, -6.0),
        ),
        (
            "disk",
            build(&|b| {
                b.add_disk(&at(down), false).unwrap();
            }),
            Vec3::new(0.4, 0.0, 0.0),
        ),
        (
            "sphere",
            build(&|b| {
                b.add_sphere(o, 1.0, &small, false).unwrap();
            }),
            Vec3::ZERO,
        ),
        (
            "sphere, inside",
            build(&|b| {
                b.add_sphere(o, 1.0, &id, true).unwrap();
            }),
            Vec3::new(0.5, 0.2, 0.0),
        ),
        (
            "cylinder",
            build(&|b| {
                b.add_cylinder([o, DVec3::Z], 0.5, &small, false).unwrap();
            }),
            Vec3::ZERO,
        ),
        (
            "cube, inside",
            build(&|b| {
                b.add_cube(&id, flipped).unwrap();
            }),
            Vec3::new(0.5, 0.2, 0.0),
        ),
        (
            "tetrahedron with vertex normals",
            build(&|b| {
                b.add_mesh(&tetrahedron, &small, MeshOptions::default()).unwrap();
            }),
            Vec3::ZERO,
        ),
    ]
}

fn closest(geometry: &Geometry, ray: &Ray) -> Option<SurfacePoint> {
    let hits = (0..geometry.prim_count()).filter_map(|prim| geometry.intersect(prim, ray, f32::INFINITY));
    let hit = hits.min_by(|a, b| a.t.total_cmp(&b.t))?;
    Some(geometry.surface(ray, &hit))
}

/// Catalogue C7 for one light: what is found by sampling it equals what is
/// found by looking everywhere; and the two densities are one.
#[test]
fn area_lights_agree_with_rays_that_hit_them() {
    let shapes = glowing_shapes();
    assert_eq!(shapes.len(), 8);
    // On both sides, seen from where it is and from behind.
    let mut views: Vec<_> = shapes.iter().map(|(name, geometry, p)| (*name, geometry, *p, false)).collect();
    for (name, geometry, p) in &shapes {
        views.extend([*p, Vec3::new(-0.1, 0.3, 4.0)].map(|p| (*name, geometry, p, true)));
    }
    for (name, geometry, p, both_sides) in &views {
        let name = &format!("{name}, {p}, both sides: {both_sides}");
        let area = area_light(geometry, true, *both_sides);
        let light = Light::from(area.clone());
        let grid = Grid { rows: 300, columns: 600, fine: 1 };
        let seen: DVec3 = grid
            .integrate(|d| {
                let hit = closest(geometry, &Ray::new(*p, d));
                hit.map_or(DVec3::ZERO, |hit| area.emitted(geometry, &hit, -d).as_dvec3())
            })
            .into_iter()
            .sum();

        let mut rng = Pcg64Mcg::seed_from_u64(17);
        let (n, mut sum, mut squares) = (40_000, DVec3::ZERO, DVec3::ZERO);
        let (mut compared, mut differ) = (0, 0);
        for _ in 0..n {
            let Some(s) = light.sample(geometry, &Receiver::free(*p), draw(&mut rng)) else { continue };
            let Target::Surface(target) = s.target else { panic!("{name}") };
            let Some(hit) = closest(geometry, &Ray::new(*p, s.wi)) else { continue };
            let off = (hit.p - target.p).length();
            if off > 1e-4 {
                continue; // its own shadow
            }
            let weight = s.radiance.as_dvec3() / f64::from(s.pdf);
            sum += weight;
            squares += weight * weight;
            let pdf =
                area.pdf(geometry, &Receiver::free(*p), (&hit, false), s.wi, (hit.p - *p).length_squared());
            // Edge-on, rounding turns the normal; at an edge it changes the face.
            if s.wi.dot(hit.ng).abs() > 2e-3 && hit.prim == target.prim {
                assert!((pdf / s.pdf - 1.0).abs() < 2e-3, "{name}: densities {pdf} and {}", s.pdf);
            }
            compared += 1;
            let same = (area.emitted(geometry, &hit, -s.wi) - s.radiance).length() < 1e-3;
            differ += u32::from(hit.prim == target.prim && !same);
        }
        // Rounding moves a few points over the edge of a square of the texture.
        assert!(compared > n / 8 && differ < 20, "{name}: {differ} of {compared} differ");
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).powf(0.5);
        let off = (mean - seen).abs() - error * 4.5 - seen * 4e-3;
        assert!(off.max_element() < 0.0, "{name}: sampled {mean} ± {error}, seen {seen}");
    }
}

/// Catalogue A6, A7: irradiance under a disk and a square light at height 1.
#[test]
fn irradiance_under_flat_lights() {
    let expected = [("rectangle", Vec3::ZERO, 1.740839503), ("disk", Vec3::ZERO, PI / 2.0)];
    for (name, p, expected) in expected {
        let (_, geometry, _) = glowing_shapes().into_iter().find(|(n, ..)| *n == name).unwrap();
        let area = area_light(&geometry, false, false);
        let shape_area: f64 = if name == "disk" { PI } else { 4.0 };
        let light = Light::from(area);
        assert!((light.power(1.0) / (PI * shape_area) - 1.0).abs() < 1e-6, "{name}");
        let mut rng = Pcg64Mcg::seed_from_u64(23);
        let (n, mut sum, mut squares) = (60_000, 0.0, 0.0);
        for _ in 0..n {
            let e = light
                .sample(&geometry, &Receiver::free(p), draw(&mut rng))
                .map_or(0.0, |s| f64::from(s.radiance.x) * f64::from(s.wi.z) / f64::from(s.pdf));
            sum += e;
            squares += e * e;
        }
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
        assert!((mean - expected).abs() < 4.0 * error, "{name}: {mean} ± {error}, not {expected}");
    }
}

#[test]
fn black_lights_say_so() {
    let zero = || Value::Rgb([0.0; 3]);
    let black = [
        env_map([3, 2], vec![0.0; 18], vec![]).unwrap(),
        env_map([3, 2], vec![1.0; 18], vec![("scale", float(0.0))]).unwrap(),
        read("point", vec![("intensity", zero())]).unwrap(),
        read("constant", vec![("radiance", zero())]).unwrap(),
        read("directional", vec![("irradiance", zero())]).unwrap(),
    ];
    for light in &black {
        assert_eq!(light.power(1.0), 0.0, "{light:?}");
        assert!(light.sample(&empty(), &Receiver::free(Vec3::ONE), Vec2::splat(0.3)).is_none(), "{light:?}");
        assert_eq!((light.pdf_environment(Vec3::X), light.environment(Vec3::X)), (0.0, Rgb::ZERO));
    }
    let light = read("point", vec![("sampling_weight", float(2.5))]).unwrap();
    assert_eq!(light.weight(), 2.5);
}

#[test]
fn refusals_say_what_and_where() {
    let message = |r: Result<Light, Error>| r.unwrap_err().to_string();
    let mut pixels = vec![1.0; 18];
    pixels[10] = f32::INFINITY;
    assert_eq!(
        message(env_map([3, 2], pixels.clone(), vec![])),
        "scene.xml:1:2: texel (0, 1) of image `map.exr` is 1, inf, 1, which is not finite"
    );
    pixels[10] = -1.0;
    assert_eq!(
        message(env_map([3, 2], pixels.clone(), vec![])),
        "scene.xml:1:2: texel (0, 1) of image `map.exr` is 1, -1, 1, which is negative"
    );
    pixels[10] = 1e30;
    assert_eq!(
        message(env_map([3, 2], pixels.clone(), vec![("scale", float(1e20))])),
        "scene.xml:1:2: texel (0, 1) of image `map.exr` is 1e30, infinite once scaled by 1e20"
    );
    let scale = transform(DMat4::from_scale(DVec3::splat(2.0)));
    let cases: Vec<(Result<Light, Error>, &str)> = vec![
        (
            env_map([3, 2], vec![1.0; 18], vec![("to_world", scale)]),
            "scene.xml:1:4: `to_world` of emitter `envmap` must not scale; it may rotate and mirror",
        ),
        (
            read("sunsky", vec![("hour", float(23.0))]),
            "scene.xml:1:2: the sun is 31.1 degrees below the horizon: the sky has no night",
        ),
        (
            read("sunsky", vec![("turbidity", float(11.0))]),
            "scene.xml:1:2: `turbidity` must lie between 1 and 10, found 11",
        ),
        (
            read("sunsky", vec![("sun_direction", vector(0.0, 0.0, 1.0)), ("hour", float(9.0))]),
            "scene.xml:1:3: give either `sun_direction` or `hour`, not both",
        ),
        (
            read("sunsky", vec![("sun_aperture", float(180.0))]),
            "scene.xml:1:2: `sun_aperture` must lie between 0.001 and 180 degrees, found 180",
        ),
        (read("pointt", vec![]), "scene.xml:1:1: there is no emitter `pointt`; did you mean `point`?"),
        (
            read("area", vec![]),
            "scene.xml:1:1: emitter `area` must stand inside a shape; move it into the `<shape>` that is to glow",
        ),
        (
            read("point", vec![("intensity", Value::Rgb([1.0, -1.0, 0.0]))]),
            "scene.xml:1:2: `intensity` must not be negative, found 1, -1, 0",
        ),
        (
            read("point", vec![("intensity", float(f64::INFINITY))]),
            "scene.xml:1:2: `intensity` must be finite, found inf",
        ),
        (
            read(
                "point",
                vec![("position", vector(0.0, 0.0, 0.0)), ("to_world", transform(DMat4::IDENTITY))],
            ),
            "scene.xml:1:3: give either `position` or `to_world`, not both",
        ),
        (
            read("spot", vec![("cutoff_angle", float(30.0)), ("beam_width", float(40.0))]),
            "scene.xml:1:3: `beam_width` must lie between 0 and `cutoff_angle` (30) degrees, found 40",
        ),
        (
            read("spot", vec![("cutoff_angle", float(0.0))]),
            "scene.xml:1:2: `cutoff_angle` must lie in (0, 180] degrees, found 0",
        ),
        (
            read("directional", vec![("direction", vector(0.0, 0.0, 0.0))]),
            "scene.xml:1:2: `direction` gives no direction: its length is zero",
        ),
        (
            read("constant", vec![("sampling_weight", float(-1.0))]),
            "scene.xml:1:2: `sampling_weight` must be finite and not negative, found -1",
        ),
        (
            read("point", vec![("power", float(1.0))]),
            "scene.xml:1:2: emitter `point` takes no parameter `power`; known: sampling_weight, position, \
             to_world, intensity",
        ),
    ];
    for (result, expected) in cases {
        let found = message(result);
        assert!(found.starts_with(expected.split(", position").next().unwrap()), "{found}\nnot {expected}");
    }
    let mut d = Describe::new();
    let id = d.object(Category::Emitter, "area", vec![("to_world", transform(DMat4::IDENTITY))]);
    let error = area_emission_from_desc(&d.scene, id).unwrap_err().to_string();
    assert!(error.contains("emitter `area` takes no parameter `to_world`"), "{error}");
}
