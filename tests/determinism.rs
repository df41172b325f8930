//! The picture is a function of scene, seed and sample count alone: not of
//! threads, not of the order of tiles, not of the crop window around it, not of
//! the accelerator.

#[path = "common/render.rs"]
mod render;

use etendue::accel::Accel;
use etendue::film::LayerSet;
use etendue::render::TileOrder;
use etendue::save::{Header, Options, write_exr};
use etendue::scene::{BuildOptions, Scene};
use render::{Ready, options, package};

const SCENES: [&str; 3] =
    ["scenes/cornell-box/scene.xml", "scenes/veach-mis/scene.xml", "scenes/teapot-dof/scene.xml"];
const SIZE: [(&str, &str); 2] = [("resx", "72"), ("resy", "56")];

fn exr_bytes(ready: &Ready, threads: usize, order: TileOrder, samples: u64) -> Vec<u8> {
    replicated_bytes(ready, threads, order, samples, 0)
}

fn replicated_bytes(ready: &Ready, threads: usize, order: TileOrder, samples: u64, replicas: u32) -> Vec<u8> {
    let mut options = options(samples, 7);
    options.replicas = replicas;
    (options.threads, options.order, options.layers) = (threads, order, LayerSet::ALL);
    let rendered = ready.render(&options);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.exr");
    let header = Header { attributes: vec![("etendue/seed".into(), "7".into())], ..Header::default() };
    write_exr(&path, &rendered.film.resolve(), &header, Options::default()).unwrap_or_else(|e| panic!("{e}"));
    std::fs::read(&path).expect("the file written")
}

#[test]
fn threads_and_tile_order_do_not_change_a_byte() {
    for scene in SCENES {
        let ready = Ready::from_file(scene, &SIZE);
        let one = exr_bytes(&ready, 1, TileOrder::CentreOut, 11);
        assert!(one.len() > 10_000);
        assert_eq!(one, exr_bytes(&ready, 2, TileOrder::CentreOut, 11), "{scene}: two threads");
        assert_eq!(
            one,
            exr_bytes(&ready, 7, TileOrder::Shuffled(3), 11),
            "{scene}: seven threads, shuffled tiles"
        );
        assert_ne!(
            one,
            exr_bytes(&ready, 1, TileOrder::CentreOut, 12),
            "{scene}: one more sample is another picture"
        );
    }
}

#[test]
fn threads_and_tile_order_do_not_change_a_byte_of_replicas() {
    let ready = Ready::from_file(SCENES[0], &SIZE);
    for (samples, replicas) in [(3, 4), (37, 16), (70, 64)] {
        let one = replicated_bytes(&ready, 1, TileOrder::CentreOut, samples, replicas);
        for (threads, order) in [(2, TileOrder::CentreOut), (5, TileOrder::Shuffled(9))] {
            let other = replicated_bytes(&ready, threads, order, samples, replicas);
            assert!(one == other, "{samples} samples, {replicas} replicas, {threads} threads");
        }
        assert!(one != exr_bytes(&ready, 1, TileOrder::CentreOut, samples), "other samples");
    }
}

/// Replicas are other samples of the same picture: their mean must agree with
/// that of one set within the noise of both, and each must be as a render of
/// its own.
#[test]
fn replicas_make_the_same_picture() {
    let ready = Ready::from_file(SCENES[0], &[("resx", "32"), ("resy", "32")]);
    let picture = |replicas, seed| {
        let mut options = options(64, seed);
        options.replicas = replicas;
        ready.render(&options).film.resolve()
    };
    let means =
        |replicas| -> Vec<f64> { (0..6).map(|seed| render::mean(&picture(replicas, seed))).collect() };
    let moments = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64)
    };
    let plain = moments(&means(0));
    for replicas in [2, 16] {
        let other = moments(&means(replicas));
        let deviation = ((plain.1 + other.1) / 6.0).sqrt();
        assert!((plain.0 - other.0).abs() < 4.0 * deviation, "{replicas}: {plain:?} {other:?}");
        assert!(deviation < 0.01 * plain.0, "the test says something: {plain:?} {other:?}");
    }
}

#[test]
fn accelerators_do_not_change_a_byte() {
    for scene in SCENES {
        let defines: Vec<(String, String)> =
            [("resx", "36"), ("resy", "28")].iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        let load = etendue::load::LoadOptions { defines, ..Default::default() };
        let desc = etendue::load::load(&package(scene), &load).unwrap();
        let render = |accel| exr_bytes(&Ready::build(&desc, None, Some(accel)), 2, TileOrder::CentreOut, 3);
        let first = render("bvh2");
        for &accel in Accel::NAMES.iter().filter(|name| **name != "brute") {
            assert_eq!(first, render(accel), "{scene}: {accel}");
        }
    }
}

#[test]
fn a_crop_is_the_same_region_of_the_whole() {
    for filter in ["box", "tent", "gaussian", "mitchell", "lanczos"] {
        let defines = [("resx", "72"), ("resy", "56"), ("rfilter", filter)];
        let defines: Vec<(String, String)> =
            defines.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        let load = etendue::load::LoadOptions { defines, ..Default::default() };
        let desc = etendue::load::load(&package("scenes/features/filters.xml"), &load).unwrap();
        let whole = Ready::build(&desc, None, None);
        let crop = BuildOptions { crop: Some([13, 9, 30, 21]), ..BuildOptions::default() };
        let part = Ready { scene: Scene::build(&desc, &crop).unwrap(), integrator: whole.integrator.clone() };
        let mut options = options(5, 3);
        options.layers = LayerSet::ALL;
        let (whole, part) = (whole.render(&options).film.resolve(), part.render(&options).film.resolve());
        let mut compared = 0;
        for channel in &part.channels {
            let all = whole.channel(&channel.name).unwrap();
            for y in 0..21 {
                for x in 0..30 {
                    let (a, b) = (channel.data[y * 30 + x], all[(y + 9) * 72 + x + 13]);
                    assert_eq!(a.to_bits(), b.to_bits(), "{filter} {} at {x},{y}", channel.name);
                    compared += 1;
                }
            }
        }
        assert!(compared > 30 * 21 * 16);
    }
}
