//! Contracts of the light tree: sampling and probability agree, nothing that
//! shines is lost, and pictures have the mean that any other choice gives.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail like tests")]

#[path = "common/chi2.rs"]
mod chi2;
#[path = "common/render.rs"]
mod render;

use std::fmt::Write;
use std::time::Instant;

use etendue::light::{Emitter, Extent, Light, LightTree, Receiver};
use etendue::math::{Bounds, Ray, Vec2, Vec3};
use etendue::sampling::uniform_sphere;
use etendue::scene::{LightSelection, Scene};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use render::{Ready, rgb};

fn direction(rng: &mut Pcg64Mcg) -> Vec3 {
    uniform_sphere(Vec2::new(rng.random(), rng.random())).normalize()
}

fn place(rng: &mut Pcg64Mcg) -> Vec3 {
    Vec3::new(rng.random(), rng.random(), rng.random()) * 2.0 - 1.0
}

/// A flat light of a size.
fn patch(light: u32, p: Vec3, size: f32, axis: Vec3, power: f64) -> Emitter {
    let half = Vec3::splat(size);
    let bounds = Bounds { min: p - half, max: p + half };
    let radius = bounds.bounding_sphere().1;
    let falloff = std::f32::consts::FRAC_PI_2;
    Emitter {
        light,
        prim: 0,
        prims: 1,
        extent: Extent { bounds, radius, axis, spread: 1e-4, falloff, both_sides: false, power },
    }
}

/// Sets of emitters, ordinary and extreme.
fn sets() -> Vec<(&'static str, Vec<Emitter>)> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut many = |n: u32, place: &mut dyn FnMut(&mut Pcg64Mcg, u32) -> (Vec3, f32, f64)| {
        (0..n)
            .map(|i| {
                let (p, size, power) = place(&mut rng, i);
                patch(i, p, size, direction(&mut rng), power)
            })
            .collect::<Vec<Emitter>>()
    };
    let mut some_both: Vec<Emitter> = many(200, &mut |r, _| (place(r), 0.05, 1.0));
    some_both.iter_mut().step_by(3).for_each(|e| e.extent.both_sides = true);
    let mut all_both: Vec<Emitter> = many(60, &mut |r, _| (place(r), 0.01, r.random::<f64>()));
    all_both.iter_mut().for_each(|e| e.extent.both_sides = true);
    vec![
        ("some on both sides", some_both),
        ("all on both sides", all_both),
        ("three", many(3, &mut |r, _| (place(r), 0.1, 1.0))),
        ("nine", many(9, &mut |r, _| (place(r), 0.1, 1.0))),
        ("small", many(300, &mut |r, _| (place(r), 0.01, r.random::<f64>()))),
        ("points", many(100, &mut |r, _| (place(r), 0.0, 1.0))),
        ("powers over 1e12", many(100, &mut |r, i| (place(r), 0.02, 1e12f64.powf(f64::from(i) / 99.0)))),
        ("one of 1e12", many(50, &mut |r, i| (place(r), 0.02, if i == 7 { 1e12 } else { 1.0 }))),
        ("coincident", many(100, &mut |_, _| (Vec3::splat(0.25), 0.05, 1.0))),
        ("coincident points", many(100, &mut |_, _| (Vec3::splat(0.25), 0.0, 1.0))),
        ("on a line", many(64, &mut |_, i| (Vec3::X * (i as f32 / 32.0 - 1.0), 0.0, 1.0))),
        ("huge", many(40, &mut |r, _| (place(r) * 1e15, 1e14, 1.0))),
        ("tiny", many(40, &mut |r, _| (place(r) * 1e-15, 1e-16, 1.0))),
        ("one huge among small", many(60, &mut |r, i| (place(r), if i == 0 { 10.0 } else { 1e-3 }, 1.0))),
        ("without power", many(30, &mut |r, i| (place(r), 0.1, if i % 3 == 0 { 0.0 } else { 1.0 }))),
    ]
}

/// Points around a set: inside, near, far, on an emitter; one- and two-sided.
fn receivers(set: &[Emitter]) -> Vec<Receiver> {
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let bounds = set.iter().fold(Bounds::EMPTY, |b, e| b.union(e.extent.bounds));
    let (centre, radius) = bounds.bounding_sphere();
    let radius = radius.max(1e-3);
    let mut out = Vec::new();
    for i in 0..24 {
        let reach = [0.3, 1.0, 3.0, 1e4][i % 4];
        let p =
            if i < 20 { centre + place(&mut rng) * radius * reach } else { set[i].extent.bounds.centre() };
        out.push(Receiver { p, n: direction(&mut rng), two_sided: i % 3 == 0, time: 0.0 });
    }
    out
}

fn weights(set: &[Emitter]) -> Vec<f64> {
    // Every tenth light is not to be sampled, every other counts double.
    (0..set.len()).map(|i| if i % 10 == 9 { 0.0 } else { 1.0 + (i % 2) as f64 }).collect()
}

#[test]
fn probabilities_are_those_of_sampling_and_sum_to_one() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let mut cases = 0;
    for (name, set) in sets() {
        let weight = weights(&set);
        let tree = LightTree::new(&set, &weight).unwrap();
        let set = if set.len() < 24 { set.repeat(8) } else { set };
        for receiver in receivers(&set) {
            let pmf: Vec<f64> =
                (0..weight.len()).map(|i| f64::from(tree.pmf(&receiver, i as u32, 0))).collect();
            let sum: f64 = pmf.iter().sum();
            assert!(sum < 1.0 + 1e-5, "{name}: {sum}");
            for (i, p) in pmf.iter().enumerate() {
                assert!(*p >= 0.0, "{name}: {p}");
                let dead = weight[i] == 0.0 || set[i].extent.power == 0.0;
                assert!(!(dead && *p > 0.0), "{name}: light {i} is never to be chosen");
            }
            let n = 4000;
            let mut counts = vec![0u32; weight.len() + 1];
            for k in 0..n {
                let u = (f64::from(k) + rng.random::<f64>()) / f64::from(n);
                match tree.sample(&receiver, u) {
                    Some(s) => {
                        assert_eq!(s.pmf, tree.pmf(&receiver, s.light, s.prim), "{name}: one probability");
                        counts[s.light as usize] += 1;
                    }
                    None => counts[weight.len()] += 1,
                }
            }
            // Stratified numbers: counts are off by the ends of intervals only; those of nothing have many.
            for (i, count) in counts.iter().enumerate() {
                let expected = pmf.get(i).copied().unwrap_or(1.0 - sum) * f64::from(n);
                let slack =
                    if i < pmf.len() { 3.0 + 1e-4 * expected } else { 3.0 + 4.0 * expected.max(0.0).sqrt() };
                let off = (f64::from(*count) - expected).abs();
                assert!(off < slack, "{name} {i}: {count} {expected}");
            }
            cases += 1;
        }
    }
    assert_eq!(cases, 15 * 24);
}

/// Where some point of an emitter shines on the receiver, it can be chosen.
#[test]
fn nothing_that_shines_is_left_out() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut seen = 0;
    for (name, set) in sets() {
        let weight = vec![1.0; set.len()];
        let tree = LightTree::new(&set, &weight).unwrap();
        let padded = if set.len() < 24 { set.repeat(8) } else { set.clone() };
        for receiver in receivers(&padded) {
            for e in set.iter().filter(|e| e.extent.power > 0.0) {
                let half = e.extent.bounds.extent() * 0.5;
                let p = e.extent.bounds.centre() + place(&mut rng) * half;
                let wi = (p - receiver.p).as_dvec3().normalize_or_zero().as_vec3();
                let cos = e.extent.axis.dot(-wi);
                let emits = cos > 1e-5 || (e.extent.both_sides && cos < -1e-5);
                let shines = emits && (receiver.two_sided || receiver.n.dot(wi) > 1e-5);
                if shines {
                    assert!(tree.pmf(&receiver, e.light, 0) > 0.0, "{name}: light {}", e.light);
                    seen += 1;
                }
            }
        }
    }
    assert!(seen > 5000, "{seen}");
}

/// A nearer light, a light that faces the receiver, a stronger light is likelier.
#[test]
fn what_brings_more_is_likelier() {
    let up = Vec3::Y;
    let set: Vec<Emitter> = (0..100)
        .map(|i| patch(i, Vec3::new(i as f32, 3.0, 0.0), 0.05, if i % 2 == 0 { -up } else { up }, 1.0))
        .collect();
    let tree = LightTree::new(&set, &vec![1.0; set.len()]).unwrap();
    let receiver = Receiver { p: Vec3::new(50.0, 0.0, 0.0), n: up, two_sided: false, time: 0.0 };
    let pmf = |i| tree.pmf(&receiver, i, 0);
    assert!(pmf(50) > 10.0 * pmf(60) && pmf(60) > pmf(80), "{} {} {}", pmf(50), pmf(60), pmf(80));
    assert!(pmf(50) > 0.15 && pmf(51) == 0.0, "{} {}", pmf(50), pmf(51));
    let below = Receiver { n: -up, ..receiver };
    assert_eq!(tree.sample(&below, 0.5), None);
    assert_eq!(tree.pmf(&below, 50, 0), 0.0);
}

#[test]
fn a_hundred_thousand_lights_are_built_in_linear_memory() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let set: Vec<Emitter> = (0..100_000)
        .map(|i| patch(i, place(&mut rng), 1e-3, direction(&mut rng), rng.random::<f64>().powi(4)))
        .collect();
    let start = Instant::now();
    let tree = LightTree::new(&set, &vec![1.0; set.len()]).unwrap();
    // Some 0.3 s on a quiet machine.
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    assert_eq!(tree.leaf_count(), 100_000);
    assert!(tree.memory_bytes() < 200 * 100_000, "{}", tree.memory_bytes());
    let receiver = Receiver::free(Vec3::ZERO);
    let sum: f64 = (0..100_000).map(|i| f64::from(tree.pmf(&receiver, i, 0))).sum();
    // What is missing is the chance of finding that a whole node faces away.
    assert!(sum > 0.8 && sum < 1.0 + 1e-5, "{sum}");
}

/// Lights of every kind on the inside of a ball around the origin, none in the
/// way of another.
fn around() -> Scene {
    let mut xml = head(16);
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    for k in 0..14 {
        // A spiral of directions.
        let z = 1.0 - (2.0 * k as f32 + 1.0) / 14.0;
        let phi = 2.4 * k as f32;
        let side = (1.0 - z * z).sqrt();
        let p = Vec3::new(side * phi.cos(), side * phi.sin(), z) * (2.0 + rng.random::<f32>());
        let size = 0.15 + 0.3 * rng.random::<f32>();
        let Vec3 { x, y, z } = p;
        let look = format!(
            "<transform name=\"to_world\"><scale value=\"{size}\"/><lookat origin=\"{x},{y},{z}\" target=\"0.1,0.2,0\" up=\"0.3,1,0.2\"/></transform>"
        );
        let shape = ["rectangle", "disk", "sphere", "obj"][k % 4];
        let file = if shape == "obj" { "<string name=\"filename\" value=\"lamp.obj\"/>" } else { "" };
        let power = 1.0 + rng.random::<f32>();
        write!(
            xml,
            "<shape type=\"{shape}\">{file}{look}<emitter type=\"area\"><rgb name=\"radiance\" value=\"{power}\"/></emitter></shape>"
        )
        .unwrap();
    }
    xml.push_str("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.01\"/></emitter></scene>");
    Ready::from_xml(&xml, None, None).scene
}

fn head(size: u32) -> String {
    format!(
        "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"3\"/></integrator>\
         <sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/><transform name=\"to_world\">\
         <lookat origin=\"0,0,0\" target=\"0,0.2,1\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\">\
         <integer name=\"width\" value=\"{size}\"/><integer name=\"height\" value=\"{size}\"/>\
         <rfilter type=\"box\"/></film></sensor>"
    )
}

/// χ² of the directions that lights are sampled in, tree and environment
/// together, against the density that is used for MIS.
#[test]
fn directions_follow_the_density_of_the_scene() {
    let scene = around();
    assert!(scene.selection.is_fine());
    let grid = chi2::Grid::uniform(Vec3::new(0.48, 0.6, 0.64), 24, 48);
    let receiver = Receiver::free(Vec3::new(0.1, 0.2, 0.0));
    let density = |wi: Vec3| {
        let ray = Ray::new(receiver.p, wi);
        let light = scene.closest(&ray).map_or(0.0, |hit| {
            let surface = scene.surface(&ray, &hit);
            scene.light_pdf(&receiver, &surface, wi, (surface.p - receiver.p).length_squared())
        });
        f64::from(light + scene.environment_pdf(wi))
    };
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    // Densities jump at the edges of lights: many random points of each cell.
    let (mut expected, points) = (vec![0.0; grid.len()], 2_000_000);
    for _ in 0..points {
        let wi = direction(&mut rng);
        expected[grid.cell(wi)] += density(wi) * 4.0 * std::f64::consts::PI / f64::from(points);
    }
    let total: f64 = expected.iter().sum();
    let draws = scene.selection.most_candidates() as f64;
    assert!((total - draws).abs() < 5e-3 * draws, "the density integrates to {total}");
    let (mut counts, n) = (vec![0u32; grid.len()], 40_000u32);
    let draws = scene.selection.most_candidates();
    for _ in 0..n as usize / draws {
        let choices = scene.selection.candidates(&receiver, rng.random(), rng.random());
        assert_eq!(choices.len(), draws);
        for choice in choices {
            let u = Vec2::new(rng.random(), rng.random());
            let light = &scene.lights[choice.light];
            let s = light.sample_part(&scene.geometry, &receiver, choice.prim, u).unwrap();
            counts[grid.cell(s.wi)] += 1;
            let pdf = density(s.wi);
            let own = f64::from(s.pdf * choice.rate);
            let own = if light.is_environment() { pdf } else { own + f64::from(scene.environment_pdf(s.wi)) };
            // At an edge rounding finds another surface.
            if (pdf / own - 1.0).abs() > 2e-3 {
                counts[grid.cell(s.wi)] += 1 << 20;
            }
        }
    }
    let odd = counts.iter().map(|c| c >> 20).sum::<u32>();
    assert!(odd < 40, "{odd} of {n} densities differ");
    let (mut chi2, mut freedom): (f64, f64) = (0.0, -1.0);
    let mut pool = (0.0, 0.0);
    for (count, share) in counts.iter().zip(&expected) {
        let (count, e) = (f64::from(count & 0xf_ffff), share / total * f64::from(n));
        if e < 20.0 {
            pool = (pool.0 + count, pool.1 + e);
        } else {
            chi2 += (count - e).powi(2) / e;
            freedom += 1.0;
        }
    }
    chi2 += (pool.0 - pool.1).powi(2) / pool.1;
    let limit = freedom + 5.0 * (2.0 * freedom).sqrt();
    assert!(freedom > 20.0 && chi2 < limit, "χ² = {chi2} with {freedom} degrees of freedom");
}

/// A room of lights of every kind over glossy, diffuse, glass and bumpy things.
fn room(lights: usize) -> Ready {
    let mut xml = head(12);
    let mut rng = Pcg64Mcg::seed_from_u64(13);
    xml.push_str(
        "<bsdf type=\"twosided\" id=\"wall\"><bsdf type=\"diffuse\"/></bsdf>\
         <shape type=\"cube\"><transform name=\"to_world\"><scale value=\"4,0.1,4\"/><translate x=\"0\" y=\"-1.2\" z=\"3\"/></transform><ref id=\"wall\"/></shape>\
         <shape type=\"sphere\"><point name=\"center\" x=\"0.6\" y=\"-0.5\" z=\"3\"/><float name=\"radius\" value=\"0.6\"/>\
         <bsdf type=\"roughdielectric\"><float name=\"alpha\" value=\"0.4\"/></bsdf></shape>\
         <shape type=\"sphere\"><point name=\"center\" x=\"-0.7\" y=\"-0.4\" z=\"3\"/><float name=\"radius\" value=\"0.6\"/>\
         <bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"0.3\"/></bsdf></shape>",
    );
    for k in 0..lights {
        let p = place(&mut rng) * Vec3::new(2.5, 1.5, 2.0) + Vec3::new(0.0, 1.0, 3.5);
        let t = p + direction(&mut rng);
        let look = format!(
            "<lookat origin=\"{},{},{}\" target=\"{},{},{}\" up=\"0.3,1,0.2\"/>",
            p.x, p.y, p.z, t.x, t.y, t.z
        );
        let watts = (3.0 * rng.random::<f32>()).exp();
        let shape = ["rectangle", "disk", "sphere", "obj", "point", "spot"][k % 6];
        let size = format!("<scale value=\"{}\"/>", 0.05 + 0.2 * rng.random::<f32>().powi(3));
        let file = if shape == "obj" { "<string name=\"filename\" value=\"lamp.obj\"/>" } else { "" };
        let _ = if shape == "point" || shape == "spot" {
            let power = 0.05 * watts;
            write!(
                xml,
                "<emitter type=\"{shape}\"><rgb name=\"intensity\" value=\"{power}\"/><transform name=\"to_world\">{look}</transform></emitter>"
            )
        } else {
            write!(
                xml,
                "<shape type=\"{shape}\">{file}<transform name=\"to_world\">{size}{look}</transform><emitter type=\"area\"><rgb name=\"radiance\" value=\"{watts}\"/></emitter></shape>"
            )
        };
    }
    xml.push_str("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.02\"/></emitter></scene>");
    Ready::from_xml(&xml, None, None)
}

/// The means of pictures, pixel by pixel and over all, agree with those of
/// choosing lights by power whatever the receiver.
#[test]
fn pictures_have_the_mean_of_any_choice() {
    // By the tree, and with every light a candidate.
    for (lights, candidates) in [(60, 2), (3, 4)] {
        compare_with_power(lights, candidates);
    }
}

fn compare_with_power(lights: usize, candidates: usize) {
    let ready = room(lights);
    assert_eq!(ready.scene.selection.is_fine(), lights == 60);
    assert_eq!(ready.scene.selection.most_candidates(), candidates);
    let mut other = room(lights);
    let power: Vec<f64> = other.scene.lights.iter().map(|l| l.power(5.0)).collect();
    other.scene.selection = LightSelection::by_power(&power, &vec![1.0; power.len()]);
    let runs = 24;
    let pictures = |ready: &Ready, first: u64, samples: u64| -> Vec<Vec<f64>> {
        (0..runs)
            .map(|k| {
                rgb(&ready.picture(samples, first + k))
                    .chunks_exact(3)
                    .map(|c| f64::from(c[0] + c[1] + c[2]))
                    .collect()
            })
            .collect()
    };
    let (a, b) = (pictures(&ready, 0, 64), pictures(&other, 100, 256));
    let moments = |set: &[Vec<f64>], pixel: &dyn Fn(&[f64]) -> f64| {
        let values: Vec<f64> = set.iter().map(|p| pixel(p)).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    let z = |pixel: &dyn Fn(&[f64]) -> f64| {
        let ((ma, va), (mb, vb)) = (moments(&a, pixel), moments(&b, pixel));
        // The sky behind everything has no variance.
        if ma == mb { 0.0 } else { (ma - mb) / (va + vb).sqrt() }
    };
    let whole = z(&|p| p.iter().sum());
    assert!(whole.abs() < 4.0, "{lights} lights: z = {whole} for the whole picture");
    let each: Vec<f64> = (0..144).map(|i| z(&|p: &[f64]| p[i])).collect();
    let covered = each.iter().filter(|z| **z != 0.0).count();
    let square = each.iter().map(|z| z * z).sum::<f64>() / covered as f64;
    assert!(covered > 40, "{covered}");
    // Mean of z², each t-like with some 40 degrees of freedom.
    assert!((0.6..1.45).contains(&square), "{lights} lights: z² has mean {square}");
    assert!(each.iter().all(|z| z.abs() < 5.5), "{each:?}");
}

/// A mesh of many triangles is chosen from triangle by triangle; few emitters
/// need no tree.
#[test]
fn trees_are_built_for_many_emitters_only() {
    let light = "<emitter type=\"area\"/>";
    let scene = |body: &str| Ready::from_xml(&format!("{}{body}</scene>", head(4)), None, None).scene;
    let one = scene(&format!("<shape type=\"sphere\">{light}</shape>"));
    assert!(!one.selection.is_fine() && one.selection.is_trivial() && one.plan.light_tree.is_none());
    let cube = scene(&format!("<shape type=\"cube\">{light}</shape>"));
    assert_eq!(cube.selection.tree().map(LightTree::leaf_count), Some(12));
    assert_eq!(cube.plan.light_tree.map(|t| t[0]), Some(12));
    let sky = scene("<emitter type=\"constant\"/><emitter type=\"directional\"/>");
    assert!(!sky.selection.is_fine());
    assert!(sky.lights.iter().all(Light::is_infinite));
}

/// `sampling_weight`: 0 is never a candidate, unequal ones choose in proportion.
#[test]
fn sampling_weights_are_obeyed() {
    let lamp = |x: f32, weight: f32| {
        format!(
            "<shape type=\"sphere\"><point name=\"center\" x=\"{x}\" y=\"0\" z=\"3\"/><float name=\"radius\" value=\"0.1\"/>\
             <emitter type=\"area\"><float name=\"sampling_weight\" value=\"{weight}\"/></emitter></shape>"
        )
    };
    let scene = |weights: &[f32]| {
        let lamps: String = weights.iter().enumerate().map(|(i, w)| lamp(i as f32, *w)).collect();
        Ready::from_xml(&format!("{}{lamps}</scene>", head(4)), None, None).scene
    };
    let receiver = Receiver::free(Vec3::new(1.0, 0.0, -30.0));
    let rates = |weights: &[f32]| -> Vec<f32> {
        let scene = scene(weights);
        (0..weights.len())
            .map(|i| scene.selection.rate(&receiver, i, scene.geometry.shapes()[i].first_prim))
            .collect()
    };
    assert_eq!(rates(&[1.0, 0.0, 1.0]), [1.0, 0.0, 1.0]);
    for weights in [vec![1.0, 3.0], vec![1.0, 3.0, 3.0, 1.0, 0.0, 3.0]] {
        let found = rates(&weights);
        for (rate, weight) in found.iter().zip(&weights) {
            assert!((rate / found[0] - weight).abs() <= 0.1 * weight, "{weights:?}: {found:?}");
        }
    }
}
