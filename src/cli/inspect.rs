//! `etendue explain` and `etendue replay`.

use std::process::ExitCode;

use super::args::{ExplainArgs, ReplayArgs};
use super::{build_scene, build_to_render, load_scene};
use crate::desc::{Error, Result};
use crate::film::{Film, FilmSpec, Groups, LayerSet, PixelSample};
use crate::integrator::{AUTO_REUSE, Event, Integrator};
use crate::math::{Rgb, Vec3};
use crate::render::{Cause, Draw, replay as replay_path};
use crate::sampling::replica_of;
use crate::scene::Scene;

/// Prints the plan of a scene.
pub fn explain(args: &ExplainArgs) -> Result<ExitCode> {
    let desc = load_scene(&args.scene)?;
    let (scene, integrator) = build_to_render(&args.scene, &desc)?;
    let shared = shared_paths(&scene, &integrator);
    if args.json {
        let mut plan = scene.plan.to_json();
        plan["shared_paths"] = shared.into();
        plan["film_bytes"] = Film::bytes_for(&scene.film, FILM_LAYERS, Groups::Halves).into();
        outln!("{plan:#}");
    } else {
        let [width, height] = scene.film.size;
        outln!("{}", args.scene.scene.display());
        outln!("{width} × {height}, {} spp, integrator {}", scene.samples_per_pixel, integrator.name());
        out!("{}", scene.plan);
        outln!("film: {}", film_memory(&scene));
        outln!("shared paths: {shared}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Which pixels will use a path.
fn shared_paths(scene: &Scene, integrator: &Integrator) -> String {
    match (integrator.reuse(), integrator.reuse_obstacle(scene)) {
        (1, None) => "none; a pixel keeps to its own".to_owned(),
        (AUTO_REUSE, None) => {
            "16, 32 or 64 pixels use each other's, or none: what a trial of `render` finds most efficient"
                .to_owned()
        }
        (pixels, None) => format!("{pixels} pixels use each other's"),
        (0 | 1, Some(what)) => format!("none; {what}"),
        (_, Some(what)) => format!("not possible; {what}"),
    }
}

/// The layers of a render without `--aov` that the film sums.
const FILM_LAYERS: LayerSet = LayerSet {
    alpha: true,
    error: true,
    albedo: false,
    normal: false,
    position: false,
    depth: false,
    moment: false,
    motion: false,
    bad: false,
};

/// What the sums of the film take, without and with replicas.
fn film_memory(scene: &Scene) -> String {
    let mega = |replicas| {
        let bytes = Film::bytes_for(&scene.film, FILM_LAYERS, Groups::of_replicas(replicas));
        format!("{:.1} MB", bytes as f64 * 1e-6)
    };
    format!("{} (with --replicas 16: {}, 64: {})", mega(0), mega(16), mega(64))
}

/// Prints one path.
pub fn replay(args: &ReplayArgs) -> Result<ExitCode> {
    let desc = load_scene(&args.scene)?;
    let (scene, integrator) = build_scene(&args.scene, &desc)?;
    let [width, height] = scene.film.size;
    let (x, y) = args.pixel;
    let whole = FilmSpec { crop: [0, 0, width, height], ..scene.film.clone() };
    if !whole.sample_bounds().contains(args.pixel) {
        return Err(Error::new(format!("pixel {x},{y} is outside the film of {width} × {height}")));
    }
    let (seed, within) = replica_of(args.seed, args.replicas.unwrap_or(0), args.sample);
    if integrator.reuse() == AUTO_REUSE {
        return Err(Error::new("whether pixels use each other's paths was decided by the render")
            .hint("--reuse with the number that it told, or 1"));
    }
    integrator.check_reuse(&scene)?;
    let draw = Draw { seed, index: within, sequence: args.sampler, layers: true };
    let path = replay_path(&scene, &integrator, args.pixel, &draw);
    let world = |p: Vec3| (p.as_dvec3() + scene.recentre).as_vec3();
    outln!(
        "pixel {x},{y} sample {} seed {}: film position {:.6}, {:.6}",
        args.sample,
        args.seed,
        x as f32 + path.offset.x,
        y as f32 + path.offset.y
    );
    outln!("camera ray from {} along {}", show(world(path.ray.origin)), show(path.ray.dir));
    for event in &path.events {
        match event {
            Event::Vertex(v) => outln!(
                "vertex {}: p {} shape {} ng {} ns {} beta {}",
                v.bounce,
                show(world(v.p)),
                v.shape,
                show(v.ng),
                show(v.ns),
                show(v.beta)
            ),
            Event::Left { direction } => outln!("left the scene along {}", show(*direction)),
            Event::Hit { le, mis } => outln!("  hit light: Le {} mis {mis:.6}", show(*le)),
            Event::Light { wi, pdf, f, mis, contribution, occluded, .. } => outln!(
                "  sampled light: wi {} pdf {pdf:.6e} f·cos {} mis {mis:.6} {} adds {}",
                show(*wi),
                show(*f),
                if *occluded { "occluded" } else { "visible" },
                show(*contribution)
            ),
            Event::Scatter { wi, weight, pdf, delta } => outln!(
                "  sampled {}: wi {} pdf {pdf:.6e} weight {}",
                if *delta { "delta lobe" } else { "bsdf" },
                show(*wi),
                show(*weight)
            ),
            Event::Absorbed => outln!("  absorbed"),
            Event::Roulette { survival, survived } => {
                outln!(
                    "  roulette: survives with {survival:.6}, {}",
                    if *survived { "did" } else { "did not" }
                );
            }
        }
    }
    if let Some(shared) = path.shared {
        outln!(
            "what is found after the second vertex is shared; by all who share, the pixel gets {}",
            show_rgb(shared)
        );
    }
    show_layers(&path.sample);
    outln!("radiance {}", show_rgb(path.sample.rgb));
    if let Some(cause) = path.bad {
        outln!("left out of the picture: {}", why(cause, path.largest));
    }
    Ok(ExitCode::SUCCESS)
}

fn show_layers(sample: &PixelSample) {
    let PixelSample { rgb: _, alpha, albedo, normal, position, depth, motion } = sample;
    outln!(
        "layers: A {alpha} albedo {} N {} P {} Z {depth} forward ({}, {})",
        show(*albedo),
        show(*normal),
        show(*position),
        motion.x,
        motion.y
    );
}

/// What is wrong with a sample, in words.
fn why(cause: Cause, largest: f32) -> String {
    match cause {
        Cause::Nan => "not a number (NaN)".to_owned(),
        Cause::Infinite => "infinite".to_owned(),
        Cause::Negative => "negative".to_owned(),
        Cause::Layer => "a layer is not finite (where that layer is rendered)".to_owned(),
        Cause::Overflow => {
            format!("overflow, over {largest:.6e}: 2^48 times the brightest light, all that the film takes")
        }
    }
}

fn show(v: Vec3) -> String {
    format!("({:.6}, {:.6}, {:.6})", v.x, v.y, v.z)
}

fn show_rgb(c: Rgb) -> String {
    format!("{:.6e} {:.6e} {:.6e}", c.x, c.y, c.z)
}
