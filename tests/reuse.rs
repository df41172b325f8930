//! Paths that several pixels use: the same picture with less noise, and nothing else.
//!
//! Pictures with and without are compared in blocks, with the scatter over independent
//! seeds on both sides, and with Mitsuba's references. A false alarm of the blocks of one scene has a
//! chance of 1 % at most (Student's t, Bonferroni); seeds are fixed.

#![allow(clippy::print_stdout, reason = "the report of a test is what it prints")]

#[path = "common/reference.rs"]
mod reference;
#[path = "common/render.rs"]
mod render;

use etendue::film::{Film, LayerSet, Picture};
use etendue::integrator::Integrator;
use etendue::load::{LoadOptions, load};
use etendue::render::{Draw, Pilot, Quiet, TileOrder, replay};
use etendue::scene::{BuildOptions, Scene};
use etendue::study::{Failure, Verdict};
use reference::Reference;
use render::{Ready, options, package, rgb};

/// Independent renders of each side.
const SEEDS: u64 = 12;
/// |t| with 22 degrees of freedom beyond which lies 2e-5 of it.
const MOST: f64 = 5.3;
const BLOCK: usize = 8;

fn reusing(mut ready: Ready, pixels: u32, max_depth: Option<u32>) -> Ready {
    let Integrator::Path(path) = &mut ready.integrator else { panic!("not a path tracer") };
    path.reuse = pixels;
    path.max_depth = max_depth.unwrap_or(path.max_depth);
    ready
}

fn file(scene: &str, size: usize) -> Ready {
    let size = size.to_string();
    Ready::from_file(scene, &[("resx", &size), ("resy", &size)])
}

/// Means of blocks, three channels each.
fn blocks(picture: &Picture) -> Vec<f64> {
    block_means(&rgb(picture), picture.window.width(), picture.window.height())
}

fn block_means(values: &[f32], width: usize, height: usize) -> Vec<f64> {
    let across = width.div_ceil(BLOCK);
    let mut sums = vec![(0.0, 0.0); across * height.div_ceil(BLOCK) * 3];
    for (i, value) in values.iter().enumerate() {
        let (x, y) = (i / 3 % width, i / 3 / width);
        let sum = &mut sums[(y / BLOCK * across + x / BLOCK) * 3 + i % 3];
        *sum = (sum.0 + f64::from(*value), sum.1 + 1.0);
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}

/// Per value its mean and the variance of that over pictures of several seeds.
fn moments(pictures: &[Vec<f64>]) -> Vec<(f64, f64)> {
    let n = pictures.len() as f64;
    (0..pictures[0].len())
        .map(|i| {
            let mean = pictures.iter().map(|p| p[i]).sum::<f64>() / n;
            (mean, pictures.iter().map(|p| (p[i] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
        })
        .collect()
}

/// Compares two ways to render and gives the ratio of their variances, per sample and pixel.
fn agree(name: &str, one: &Ready, other: &Ready, samples: u64) -> f64 {
    let pictures = |ready: &Ready, first: u64| -> Vec<Picture> {
        (first..first + SEEDS).map(|seed| ready.picture(samples, seed)).collect()
    };
    let (one, other) = (pictures(one, 0), pictures(other, 1000));
    let in_blocks = |pictures: &[Picture]| moments(&pictures.iter().map(blocks).collect::<Vec<_>>());
    let mut worst = 0.0_f64;
    for (i, (a, b)) in in_blocks(&one).into_iter().zip(in_blocks(&other)).enumerate() {
        let deviation = (a.1 + b.1).sqrt();
        if deviation > 0.0 {
            let t = (a.0 - b.0) / deviation;
            worst = if t.abs() > worst.abs() { t } else { worst };
            assert!(t.abs() < MOST, "{name}, block {}, channel {}: t {t}, {a:?} {b:?}", i / 3, i % 3);
        } else {
            assert!((a.0 - b.0).abs() <= 1e-6 * a.0.abs(), "{name}, block {}: {a:?} {b:?}", i / 3);
        }
    }
    let noise = |pictures: &[Picture]| -> f64 {
        let pixels: Vec<Vec<f64>> =
            pictures.iter().map(|p| rgb(p).into_iter().map(f64::from).collect()).collect();
        moments(&pixels).iter().map(|(mean, variance)| variance / (mean * mean + 1e-3)).sum()
    };
    let gain = noise(&one) / noise(&other);
    println!("{name}: worst block t {worst:.2}, noise {gain:.2} times less");
    gain
}

/// Indirect light of a diffuse room is the case that it is made for.
#[test]
fn a_room_has_less_noise() {
    for (scene, least) in [("scenes/cornell-box/scene.xml", 3.0), ("scenes/cornell-original/scene.xml", 3.0)]
    {
        for pixels in [2, 16] {
            let gain = agree(scene, &file(scene, 48), &reusing(file(scene, 48), pixels, None), 16);
            assert!(pixels == 2 || gain > least, "{scene}, {pixels}: {gain}");
        }
    }
}

/// A room under a lamp, of other materials: floor, left and right wall, back.
fn room([floor, left, right, back]: [&str; 4]) -> Ready {
    let wall = |turn: &str, bsdf: &str| {
        format!(
            r#"<shape type="rectangle"><transform name="to_world"><translate z="-1"/>{turn}</transform>{bsdf}</shape>"#
        )
    };
    let xml = format!(
        r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="6"/></integrator>
        <sensor type="perspective"><float name="fov" value="50"/>
        <transform name="to_world"><lookat origin="0,0,3.2" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="48"/>
        <rfilter type="box"/></film></sensor>
        <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/>
        <translate y="0.95"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="9"/></emitter></shape>
        {}{}{}{}{}</scene>"#,
        wall(r#"<rotate x="1" angle="-90"/>"#, floor),
        wall(r#"<rotate x="1" angle="90"/>"#, r#"<bsdf type="diffuse"/>"#),
        wall(r#"<rotate y="1" angle="90"/>"#, left),
        wall(r#"<rotate y="1" angle="-90"/>"#, right),
        wall("", back),
    );
    Ready::from_xml(&xml, None, None)
}

/// Who reflects nothing, or none of a colour, finds no vertex that others could use: black and white
/// squares, and walls of one primary colour each.
#[test]
fn what_is_black_lends_nothing() {
    let squares = r#"<bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
        <rgb name="color0" value="0"/><rgb name="color1" value="0.9"/>
        <transform name="to_uv"><scale value="4"/></transform></texture></bsdf>"#;
    let colour =
        |rgb: &str| format!(r#"<bsdf type="diffuse"><rgb name="reflectance" value="{rgb}"/></bsdf>"#);
    let (red, green) = (colour("0.9,0,0"), colour("0,0.9,0"));
    let parts = [squares, &red, &green, squares];
    let gain = agree("squares", &room(parts), &reusing(room(parts), 16, None), 32);
    assert!(gain > 2.0, "{gain}");
}

/// Second vertices that do not reflect the same to all sides.
#[test]
fn glossy_surfaces_lend_too() {
    let floor = r#"<bsdf type="principled"><rgb name="base_color" value="0.7,0.5,0.3"/>
        <float name="roughness" value="0.4"/><float name="metallic" value="0.3"/></bsdf>"#;
    let left = r#"<bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.6,0.2,0.1"/>
        <float name="alpha" value="0.2"/></bsdf>"#;
    let right = r#"<bsdf type="roughconductor"><string name="distribution" value="ggx"/>
        <float name="alpha" value="0.3"/><rgb name="specular_reflectance" value="0.9"/></bsdf>"#;
    let back = r#"<bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.5"/></bsdf>"#;
    let parts = [floor, left, right, back];
    let gain = agree("glossy", &room(parts), &reusing(room(parts), 16, None), 32);
    assert!(gain > 1.5, "{gain}");
}

/// A closed room with a block in it whose surfaces all glow and reflect half: the radiance is the same
/// everywhere, so what a pixel gains by the paths of others they lose by its own, to the last bits, in
/// corners too.
#[test]
fn energy_goes_round() {
    let glowing = |more: &str| {
        format!(
            r#"<shape type="cube">{more}<bsdf type="diffuse"/>
            <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>"#
        )
    };
    let xml = format!(
        r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="12"/></integrator>
        <sensor type="perspective"><float name="fov" value="100"/><transform name="to_world">
        <lookat origin="0.2,0.1,0.9" target="0,-0.2,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="48"/>
        <rfilter type="box"/></film></sensor>{}{}</scene>"#,
        glowing(r#"<boolean name="flip_normals" value="true"/>"#),
        glowing(
            r#"<transform name="to_world"><scale value="0.3"/><rotate y="1" angle="20"/>
            <translate x="-0.3" y="-0.7"/></transform>"#
        ),
    );
    let means =
        [1, 16].map(|n| render::mean(&reusing(Ready::from_xml(&xml, None, None), n, None).picture(8, 3)));
    assert!((means[1] / means[0] - 1.0).abs() < 1e-6, "{means:?}");
}

/// The longest path is as long as before: depth 2 has nothing to lend, depth 3 lends what next-event
/// estimation finds at the second vertex.
#[test]
fn depth_is_limited_as_before() {
    for depth in [2, 3, 4] {
        let name = format!("cornell-box to depth {depth}");
        let scene = || file("scenes/cornell-box/scene.xml", 32);
        let gain = agree(&name, &reusing(scene(), 1, Some(depth)), &reusing(scene(), 16, Some(depth)), 32);
        assert_eq!(depth == 2, (gain - 1.0).abs() < 0.2, "{gain}");
    }
}

/// Mirrors and glass before the first vertex, lobes of both kinds, masks, bumps, many lights.
#[test]
fn other_materials_do_not_suffer() {
    let scenes = ["glass", "plastics", "bumps", "meshes", "shapes", "layers", "hide-emitters"];
    for scene in scenes {
        let path = format!("scenes/features/{scene}.xml");
        agree(scene, &file(&path, 32), &reusing(file(&path, 32), 16, None), 32);
    }
}

/// Pixels and the whole mean by the test that all references have; blocks by the scatter of their own
/// means, since the noise of pixels side by side is not independent here. |t| beyond 6.2 has a chance of
/// 2e-5 with the 15 degrees of freedom that there are at least.
#[test]
fn pictures_are_those_of_mitsuba() {
    let name = "cornell-box";
    let reference = Reference::read(name);
    let ready = reusing(reference.scene(|_| {}), 16, None);
    let mut seen = Vec::new();
    let ours = reference.batches(1 << 14, |samples, seed| {
        let picture = ready.picture(samples, seed);
        seen.push((samples, blocks(&picture)));
        rgb(&picture)
    });
    let overlap = reference::overlap(&ready.scene.film.filter);
    let report = reference.test(&ours, overlap);
    println!("{name}: {} × {} spp, ±{:.4} %: {report}", ours.batches, ours.samples, 100.0 * ours.mean_error);
    let within = match &report.verdict {
        Verdict::Pass => true,
        Verdict::Fail(why) => why.as_slice() == [Failure::Blocks],
        Verdict::Inconclusive => false,
    };
    assert!(within, "{name}: {report}\n  pictures in {}", reference.dump(&ours).display());
    let last: Vec<_> = seen.into_iter().filter(|(n, _)| *n == ours.samples).map(|(_, b)| b).collect();
    assert_eq!(last.len() as u64, ours.batches);
    let in_blocks = |values: &[f32]| block_means(values, reference.width, reference.height);
    // Of a mean of 64 pixels.
    let shared = overlap / (BLOCK * BLOCK) as f64;
    let theirs = in_blocks(&reference.mean).into_iter().zip(in_blocks(&reference.variance));
    for (i, ((mean, variance), (their_mean, their_variance))) in
        moments(&last).into_iter().zip(theirs).enumerate()
    {
        let t = (mean - their_mean) / (variance + shared * their_variance).sqrt();
        assert!(t.abs() < 6.2, "{name}, block {}, channel {}: t {t}", i / 3, i % 3);
    }
}

/// What the film says of its error is true of this noise too.
#[test]
fn the_error_is_known() {
    let ready = reusing(file("scenes/cornell-box/scene.xml", 48), 16, None);
    let runs: Vec<_> = (0..SEEDS).map(|seed| ready.render(&options(32, seed))).collect();
    let pixels: Vec<Vec<f64>> =
        runs.iter().map(|run| rgb(&run.film.resolve()).into_iter().map(f64::from).collect()).collect();
    let all = moments(&pixels);
    let mean = all.iter().map(|(mean, _)| mean).sum::<f64>() / all.len() as f64;
    let terms = all.iter().map(|(m, variance)| SEEDS as f64 * variance / (m * m + 0.01 * mean * mean));
    let truth = (terms.sum::<f64>() / all.len() as f64).sqrt();
    let stated = runs.iter().map(|run| run.stats.relative_error).sum::<f64>() / SEEDS as f64;
    // Halves state a few percent too much.
    assert!((0.95..1.25).contains(&(stated / truth)), "stated {stated}, true {truth}");
    let covered = runs.iter().filter(|run| {
        let [low, high] = run.stats.relative_error_interval;
        (low..high).contains(&truth)
    });
    assert!(covered.count() as u64 >= SEEDS - 2);
}

#[test]
fn threads_crops_and_replicas_change_nothing() {
    nothing_changes(72, 56, 5, &[0, 3]);
}

/// Of a larger picture the blocks are larger.
#[test]
fn nor_do_they_where_blocks_are_large() {
    nothing_changes(264, 200, 1, &[0]);
}

fn nothing_changes(width: usize, height: usize, spp: u64, replicas: &[u32]) {
    let scene = "scenes/teapot-dof/scene.xml";
    let desc = {
        let defines = [("resx", width), ("resy", height)].map(|(k, v)| (k.to_owned(), v.to_string()));
        load(&package(scene), &LoadOptions { defines: defines.to_vec(), ..LoadOptions::default() })
            .expect("a scene")
    };
    let whole = reusing(Ready::build(&desc, None, None), 16, None);
    let [x0, y0] = [width / 5, height / 6];
    let crop = [x0 as u32, y0 as u32, 30, 21];
    let crop = BuildOptions { crop: Some(crop), ..BuildOptions::default() };
    let part =
        Ready { scene: Scene::build(&desc, &crop).expect("a scene"), integrator: whole.integrator.clone() };
    let mut options = options(spp, 3);
    options.layers = LayerSet::ALL;
    for replicas in replicas {
        options.replicas = *replicas;
        (options.threads, options.order) = (1, TileOrder::CentreOut);
        let all = whole.render(&options).film.resolve();
        (options.threads, options.order) = (5, TileOrder::Shuffled(9));
        assert_eq!(all, whole.render(&options).film.resolve());
        for channel in &part.render(&options).film.resolve().channels {
            let all = all.channel(&channel.name).expect("a channel");
            for (i, value) in channel.data.iter().enumerate() {
                let (x, y) = (i % 30, i / 30);
                assert_eq!(
                    value.to_bits(),
                    all[(y + y0) * width + x + x0].to_bits(),
                    "{} at {x},{y}",
                    channel.name
                );
            }
        }
    }
}

/// With a box filter and one sample the picture is the sample.
#[test]
fn a_sample_can_be_shown_again() {
    let defines = [("resx", "24"), ("resy", "20"), ("rfilter", "box")];
    let ready = reusing(Ready::from_file("scenes/features/filters.xml", &defines), 8, None);
    let picture = ready.render(&options(1, 5)).film.resolve();
    let values = rgb(&picture);
    let mut shared = 0;
    for (i, pixel) in values.chunks_exact(3).enumerate() {
        let at = ((i % 24) as i32, (i / 24) as i32);
        let draw = Draw { seed: 5, index: 0, sequence: options(1, 5).sequence, layers: false };
        let again = replay(&ready.scene, &ready.integrator, at, &draw);
        assert_eq!(again.sample.rgb.to_array(), pixel, "{at:?}");
        shared += u32::from(again.shared.is_some_and(|s| s.max_element() > 0.0));
    }
    assert!(shared > 100, "{shared}");
}

/// Indirect light decides for sharing; light of the surroundings, and renders too small to try, against it.
#[test]
fn a_trial_decides() {
    let decide = |scene: &str, samples: u64| -> Option<Pilot> {
        let Ready { scene, integrator } = file(scene, 64);
        let Integrator::Path(path) = integrator else { panic!("not a path tracer") };
        let film = Film::new(scene.film.clone(), LayerSet::default(), 1.0);
        Pilot::run(&scene, &path, &film, samples, (0, options(1, 0).sequence))
    };
    let room = decide("scenes/cornell-box/scene.xml", 1 << 20).expect("a trial");
    println!("{room:?}");
    assert!(room.pixels >= 16 && room.gain > 3.0 && (1.3..2.5).contains(&room.work), "{room:?}");
    let outside = decide("scenes/teapot-env/scene.xml", 1 << 20).expect("a trial");
    println!("{outside:?}");
    assert!(outside.pixels == 1 && outside.gain < 1.4, "{outside:?}");
    assert_eq!(decide("scenes/cornell-box/scene.xml", 16), None);
}

/// A first vertex in the plane of a second one: rounding made its share negative.
#[test]
fn in_one_plane_nothing_is_negative() {
    let defines = [("resx", "64"), ("resy", "36")];
    let ready = reusing(Ready::from_file("scenes/veach-ajar/scene.xml", &defines), 16, None);
    let sequence = options(1, 0).sequence;
    let draw = Draw { seed: 16_090_679_179_711_462_159, index: 27, sequence, layers: false };
    let again = replay(&ready.scene, &ready.integrator, (53, 17), &draw);
    assert!(again.bad.is_none() && again.sample.rgb.min_element() >= 0.0, "{:?}", again.sample.rgb);
}

#[test]
fn what_cannot_share_says_so() {
    let refuses = |scene: &str, name: Option<&str>| -> String {
        let options = LoadOptions::default();
        let desc = load(&package(scene), &options).unwrap();
        let ready = reusing(Ready::build(&desc, name, None), 4, None);
        let render = etendue::render::render(&ready.scene, &ready.integrator, &render::options(1, 0), &Quiet);
        render.err().map(|e| e.to_string()).unwrap_or_default()
    };
    let text = refuses("scenes/features/absorption.xml", Some("volpath"));
    assert!(text.contains("`volpath` sees through surfaces or media"), "{text}");
    assert_eq!(refuses("scenes/features/shapes.xml", Some("volpath")), "");
}
