//! The test of the test: known bugs must make the comparison with Mitsuba fail.
//!
//! A small path tracer written here against the public parts of the library
//! (lights, bsdfs, rays) plays the part of the renderer. Without a bug it
//! passes the very test of `tests/reference.rs`; with any of the bugs below it
//! must not. So the comparison has the power that it claims.

#![allow(clippy::print_stdout, reason = "the report of a test is what it prints")]

#[path = "common/reference.rs"]
mod reference;
#[path = "common/render.rs"]
mod render;

use etendue::desc::{Category, SceneDesc, Value};
use etendue::film::{Film, LayerSet, PixelSample};
use etendue::integrator::{CameraSample, Integrator};
use etendue::light::{Receiver, Target};
use etendue::material::Scatter;
use etendue::math::Rgb;
use etendue::sampling::{Sampler, power_heuristic};
use etendue::scene::Scene;
use etendue::study::Verdict;
use reference::{Ours, Reference};
use render::{Ready, rgb};

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bug {
    None,
    /// The cosine at the surface is forgotten when a light is sampled.
    MissingCosine,
    /// Both strategies count in full.
    NoMis,
    /// Textures are replaced by their mean.
    IgnoredTexture,
    /// Light that arrives is one per cent too bright after the first bounce.
    OnePerCent,
}

impl Bug {
    /// Most samples per pixel: what is grossly wrong shows with few.
    fn samples(self) -> u64 {
        if matches!(self, Bug::None | Bug::OnePerCent) { 8192 } else { 512 }
    }
}

/// Radiance along a camera ray: next-event estimation and bsdf samples.
fn trace(scene: &Scene, camera: &CameraSample, max_depth: u32, bug: Bug) -> PixelSample {
    let mut out = PixelSample::default();
    let (mut beta, mut ray) = (Rgb::ONE, camera.ray);
    // (receiver, pdf) of the last sampled direction; None for the camera and deltas.
    let mut last: Option<(Receiver, f32)> = None;
    for depth in 1..=max_depth {
        let Some(hit) = scene.closest(&ray) else {
            let pdf = scene.environment_pdf(ray.dir);
            let mis = last.map_or(1.0, |(_, p)| power_heuristic(p, pdf));
            out.rgb += beta * scene.environment(ray.dir) * if bug == Bug::NoMis { 1.0 } else { mis };
            break;
        };
        let surface = scene.surface(&ray, &hit);
        let le = scene.emitted(&surface, -ray.dir);
        if le != Rgb::ZERO {
            let mis = last.map_or(1.0, |(p, pdf)| {
                let distance_squared = (surface.p - p.p).length_squared();
                let light = scene.light_pdf(&p, &surface, ray.dir, distance_squared);
                power_heuristic(pdf, light)
            });
            out.rgb += beta * le * if bug == Bug::NoMis { 1.0 } else { mis };
        }
        if depth == max_depth {
            break;
        }
        let mut room = Scatter::default();
        let hit = scene.interact(&surface, -ray.dir, &etendue::scene::Carried::NOTHING, &mut room);
        let dimension = 100 + depth * 8;
        let u = camera.sampler;
        for light in scene.sample_lights(&hit, u.get_1d(dimension), u.get_2d(dimension + 1)) {
            let (mut f, pdf) = hit.scatter.eval_pdf(hit.wo, light.sample.wi);
            if bug == Bug::MissingCosine {
                f /= hit.surface.ns.dot(light.sample.wi).abs().max(1e-4);
            }
            let mis =
                if light.sample.delta || bug == Bug::NoMis { 1.0 } else { power_heuristic(light.pdf, pdf) };
            let shadow = match &light.sample.target {
                Target::Surface(target) => hit.surface.spawn_to(target),
                Target::Point(p) => hit.surface.spawn_to_point(*p),
                Target::Infinite => hit.surface.spawn(light.sample.wi),
            };
            if f != Rgb::ZERO && !scene.occluded(&shadow) {
                out.rgb += beta * f * light.sample.radiance * (mis / light.pdf);
            }
        }
        let Some(sample) = hit.scatter.sample(hit.wo, u.get_1d(dimension + 2), u.get_2d(dimension + 3))
        else {
            break;
        };
        beta *= sample.weight;
        if bug == Bug::OnePerCent && depth == 1 {
            beta *= 1.01;
        }
        last = (!sample.delta).then_some((hit.receiver(), sample.pdf));
        ray = hit.surface.spawn(sample.wi);
    }
    out
}

fn picture(ready: &Ready, samples: u64, seed: u64, bug: Bug) -> Vec<f32> {
    let Integrator::Path(path) = &ready.integrator else { panic!("a path scene") };
    let film = Film::new(
        ready.scene.film.clone(),
        LayerSet::default(),
        ready.integrator.radiance_scale(&ready.scene),
    );
    for rect in film.tiles() {
        let mut tile = film.tile(rect);
        for pixel in rect.pixels() {
            for index in 0..samples {
                let (camera, offset) =
                    CameraSample::new(&ready.scene, pixel, Sampler::new(seed, pixel, index));
                let sample = trace(&ready.scene, &camera, path.max_depth.min(40), bug);
                tile.add(pixel, offset, index, &sample);
            }
        }
        film.merge(&tile);
    }
    rgb(&film.resolve())
}

/// Replaces every bitmap and checkerboard by a grey of its rough mean.
fn forget_textures(desc: &mut SceneDesc) {
    let textures: Vec<bool> = desc.objects.iter().map(|o| o.category == Category::Texture).collect();
    for object in &mut desc.objects {
        for param in &mut object.params {
            if matches!(param.value, Value::Object(id) if textures[id as usize]) {
                param.value = Value::Rgb([0.5; 3]);
            }
        }
    }
}

fn verdict(name: &str, bug: Bug) -> Verdict {
    let reference = Reference::read(name);
    let ready = reference.scene(|desc| {
        if bug == Bug::IgnoredTexture {
            forget_textures(desc);
        }
    });
    let ours: Ours = reference.batches(bug.samples(), |samples, seed| picture(&ready, samples, seed, bug));
    let report = reference.test(&ours, reference::overlap(&ready.scene.film.filter));
    println!("{name} with {bug:?}: {report}");
    report.verdict
}

/// A picture too noisy to tell has shown nothing: it does not count as found.
fn assert_found(name: &str, bug: Bug) {
    let verdict = verdict(name, bug);
    assert!(matches!(verdict, Verdict::Fail(_)), "{name} with {bug:?}: {verdict}");
}

#[test]
fn without_a_bug_the_small_tracer_passes() {
    for name in ["cornell-box", "features-textures"] {
        assert_eq!(verdict(name, Bug::None), Verdict::Pass, "{name}");
    }
}

#[test]
fn a_missing_cosine_is_found() {
    assert_found("cornell-box", Bug::MissingCosine);
}

#[test]
fn wrong_mis_weights_are_found() {
    assert_found("cornell-box", Bug::NoMis);
}

#[test]
fn an_ignored_texture_is_found() {
    assert_found("features-textures", Bug::IgnoredTexture);
}

#[test]
fn one_per_cent_of_the_indirect_light_is_found() {
    assert_found("cornell-box", Bug::OnePerCent);
}
