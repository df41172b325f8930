//! Sums, sizes and floats at their ends: 2^30 samples, a range of 10^76,
//! filters with negative lobes, films of one pixel and of 2^30, numbers below
//! the smallest normal one, and an error that falls without a floor.

#[path = "common/render.rs"]
mod common_render;

use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU64, Ordering};

use common_render::{Ready, options};
use etendue::film::{Film, FilmSpec, Filter, LayerSet, PixelSample, Rect, Scale};
use etendue::load::read_picture;
use etendue::math::{Rgb, Vec2};
use etendue::render::{Monitor, RenderOptions, render};
use etendue::sampling::{Sampler, Sequence};

fn grey(value: f32) -> PixelSample {
    PixelSample { rgb: Rgb::splat(value), alpha: 1.0, ..PixelSample::default() }
}

/// One pixel and a box: what is summed is the plain mean.
fn one_pixel(layers: LayerSet, scale: f64) -> Film {
    Film::new(FilmSpec::new(1, 1, Filter::Box), layers, scale)
}

fn pixel(film: &Film, channel: &str) -> f64 {
    f64::from(film.resolve().channel(channel).expect("a channel")[0])
}

const CONSTANTS: [f32; 5] = [0.1, 0.3, 1.0, 3.0, 1e5];

/// Each sample added by itself, as a render does it: 8 per pass.
#[test]
fn constants_keep_their_value_over_2_to_the_24_samples() {
    for value in CONSTANTS {
        let film = one_pixel(LayerSet::default(), 1.0);
        let mut tile = film.tile(film.tiles()[0]);
        let mut naive = 0.0_f32;
        for pass in 0..1u64 << 21 {
            tile.reset(film.tiles()[0]);
            for index in pass * 8..pass * 8 + 8 {
                assert!(tile.add((0, 0), Vec2::splat(0.5), index, &grey(value)));
                naive += value;
            }
            film.advance(pass * 8);
            film.merge(&tile);
        }
        let n = f64::from(1u32 << 24);
        let error = pixel(&film, "R") / f64::from(value) - 1.0;
        assert!(error.abs() < 1e-6, "{value}: {error:e}");
        // What a float would have made of it: the test can fail.
        let naive = f64::from(naive) / n / f64::from(value) - 1.0;
        assert!(value == 1.0 || naive.abs() > 1e-3, "{value} in f32: {naive:e}");
        assert!(film.relative_error() < 1e-6);
    }
}

/// 2^30 samples: passes of 2^10 that hold the same, merged 2^20 times. A merge
/// does not know what a tile was merged before, so that each of its additions
/// is one of those that a render of 2^30 samples makes.
#[test]
fn constants_keep_their_value_over_2_to_the_30_samples() {
    let layers = LayerSet { moment: true, alpha: true, ..LayerSet::default() };
    for value in CONSTANTS {
        let film = one_pixel(layers, 1.0);
        let mut tile = film.tile(film.tiles()[0]);
        for index in 0..1u64 << 10 {
            tile.add((0, 0), Vec2::splat(0.5), index, &grey(value));
        }
        for pass in 0..1u64 << 20 {
            film.advance(pass << 10);
            film.merge(&tile);
        }
        for (name, expected) in
            [("R", f64::from(value)), ("A", 1.0), ("m2.G", f64::from(value) * f64::from(value))]
        {
            let error = pixel(&film, name) / expected - 1.0;
            assert!(error.abs() < 1e-6, "{value}, {name}: {error:e}");
        }
    }
}

/// Values from e^-20 to e^20 and beyond, against a compensated sum in f64.
#[test]
fn log_normal_values_are_summed_as_by_an_exact_sum() {
    let film = one_pixel(LayerSet::default(), 1.0);
    let mut tile = film.tile(film.tiles()[0]);
    let (mut sum, mut lost, mut naive) = (0.0_f64, 0.0_f64, 0.0_f32);
    let count = 1u64 << 22;
    for pass in 0..count / 64 {
        tile.reset(film.tiles()[0]);
        for index in pass * 64..pass * 64 + 64 {
            let u = Sampler::new(3, (0, 0), index).with_sequence(Sequence::Independent).get_2d(0);
            let normal =
                (-2.0 * f64::from(1.0 - u.x).ln()).sqrt() * (std::f64::consts::TAU * f64::from(u.y)).cos();
            let value = (4.0 * normal).exp() as f32;
            tile.add((0, 0), Vec2::splat(0.5), index, &grey(value));
            naive += value;
            // Neumaier 1974.
            let (v, total) = (f64::from(value), sum + f64::from(value));
            lost += if sum >= v { (sum - total) + v } else { (v - total) + sum };
            sum = total;
        }
        film.advance(pass * 64);
        film.merge(&tile);
    }
    let exact = (sum + lost) / count as f64;
    let error = pixel(&film, "R") / exact - 1.0;
    assert!(error.abs() < 1e-7, "{error:e}");
    let naive = f64::from(naive) / count as f64 / exact - 1.0;
    assert!(naive.abs() > 1e-6, "in f32: {naive:e}");
}

/// Sums beyond 128 bits: the largest samples that a film takes, over and over,
/// beside small ones; in any order of merges.
#[test]
fn the_largest_samples_never_overflow() {
    let layers = LayerSet { moment: true, ..LayerSet::default() };
    let largest = Film::largest_radiance(1e-3);
    assert!(largest > 1e11 && largest < 1e12);
    let film = || one_pixel(layers, 1e-3);
    let (first, second) = (film(), film());
    let tile_of = |value: f32, count: u64| {
        let mut tile = first.tile(first.tiles()[0]);
        (0..count).for_each(|i| assert!(tile.add((0, 0), Vec2::splat(0.5), i, &grey(value))));
        tile
    };
    let (large, small) = (tile_of(largest, 1 << 12), tile_of(0.25e-3, 1 << 12));
    let turns = 1 << 10;
    (0..turns).for_each(|_| first.merge(&large));
    (0..turns).for_each(|_| first.merge(&small));
    for _ in 0..turns {
        second.merge(&small);
        second.merge(&large);
    }
    let value = f64::from(largest);
    for film in [&first, &second] {
        assert!((pixel(film, "R") / (value / 2.0) - 1.0).abs() < 1e-6);
        assert!((pixel(film, "m2.B") / (value * value / 2.0) - 1.0).abs() < 1e-6);
    }
    assert!(first.resolve() == second.resolve());
    // Levels that are joined keep what is beyond 128 bits.
    for next in [2, 4, 8, 16] {
        first.advance(next);
    }
    assert!((pixel(&first, "R") / (value / 2.0) - 1.0).abs() < 1e-6);
    // Brighter is left out, and said to be.
    let mut tile = first.tile(first.tiles()[0]);
    assert!(!tile.add((0, 0), Vec2::splat(0.5), 0, &grey(largest * 1.0001)));
}

/// A sun 10^30 times as bright as a candle, on the dark side of the floor: the
/// candle is summed as exactly as without it, and a film that sees both too.
#[test]
fn a_candle_is_not_lost_beside_the_sun() {
    let xml = |sun: &str| {
        format!(
            r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="orthographic"><transform name="to_world"><lookat origin="0,0.5,0" target="0,0,0" up="0,0,1"/><scale value="1e-6"/></transform>
<film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
<emitter type="point"><rgb name="intensity" value="1"/><point name="position" x="0" y="1" z="0"/></emitter>{sun}</scene>"#
        )
    };
    let truth = 0.5 / std::f64::consts::PI;
    for power in [0, 6, 12, 20, 30] {
        let sun = format!(
            r#"<emitter type="directional"><vector name="direction" value="0,1,0"/><rgb name="irradiance" value="1e{power}"/></emitter>"#
        );
        let ready = Ready::from_xml(&xml(&sun), None, None);
        let picture = ready.picture(64, 0);
        for value in picture.channel("G").expect("green") {
            assert!((f64::from(*value) / truth - 1.0).abs() < 2e-5, "sun 1e{power}: {value}");
        }
    }
    // One pixel lit by the sun, one by the candle.
    let scale = Scale { largest: 1e30, smallest: 1.0 };
    let film = Film::new(FilmSpec::new(2, 1, Filter::Box), LayerSet::default(), scale);
    let mut tile = film.tile(film.tiles()[0]);
    for index in 0..64u64 {
        tile.add((0, 0), Vec2::splat(0.5), index, &grey(3e30));
        tile.add((1, 0), Vec2::splat(0.5), index, &grey(0.1));
    }
    for pass in 0..1u64 << 12 {
        film.advance(pass * 64);
        film.merge(&tile);
    }
    let picture = film.resolve();
    let [sun, candle] = picture.channel("R").expect("red")[..] else { panic!("two pixels") };
    assert!((f64::from(sun) / 3e30 - 1.0).abs() < 1e-6, "{sun}");
    assert!((f64::from(candle) / 0.1 - 1.0).abs() < 1e-6, "{candle}");
}

/// Means and mean squares beyond f32 become its largest value, and nothing
/// becomes infinite or not a number.
#[test]
fn what_is_beyond_f32_is_its_largest_value() {
    for filter in Filter::examples() {
        let film = Film::new(FilmSpec::new(5, 4, filter), LayerSet::ALL, 1e38);
        for rect in film.tiles() {
            let mut tile = film.tile(rect);
            for (i, pixel) in rect.pixels().enumerate() {
                for index in 0..4u64 {
                    let offset = Vec2::new((i % 7) as f32 / 7.0, (index as f32 * 0.24 + 0.03) % 1.0);
                    let value = if (i + index as usize).is_multiple_of(3) { f32::MAX } else { 0.0 };
                    assert!(tile.add(pixel, offset, index, &grey(value)));
                }
            }
            film.merge(&tile);
        }
        for channel in film.resolve().channels {
            // The error of a pixel without samples is infinite: nothing is known.
            let may = channel.name == "Z" || channel.name.starts_with("error");
            let fine = |v: &f32| v.is_finite() || may && *v == f32::INFINITY;
            assert!(channel.data.iter().all(fine), "{filter:?} {}: {:?}", channel.name, channel.data);
        }
        assert!(!film.relative_error().is_nan());
    }
}

/// A pixel of 1e12 among ones: what the filter's formula makes of it, negative
/// lobes too, and not a bit of it beyond the filter's reach.
#[test]
fn a_bright_pixel_rings_as_far_as_its_filter_and_no_further() {
    let bright = (9, 8);
    for filter in Filter::examples() {
        let film = Film::new(FilmSpec::new(40, 17, filter), LayerSet::default(), 1.0);
        let value = |pixel: (i32, i32)| if pixel == bright { 1e12 } else { 1.0 };
        let offset = |pixel: (i32, i32)| Sampler::new(1, pixel, 0).pixel_and_light().0;
        for rect in film.tiles() {
            let mut tile = film.tile(rect);
            rect.pixels().for_each(|p| assert!(tile.add(p, offset(p), 0, &grey(value(p)))));
            film.merge(&tile);
        }
        let picture = film.resolve();
        let data = picture.channel("G").expect("a channel");
        let mut negative = 0;
        for (got, (x, y)) in data.iter().zip(picture.window.pixels()) {
            let (mut sum, mut weight, mut size) = (0.0, 0.0, 0.0);
            for q in Rect::new(0, 0, 40, 17).pixels() {
                let o = offset(q);
                let along = |q: i32, o: f32, p: i32| {
                    let distance = f64::from(q) + f64::from(o) - f64::from(p) - 0.5;
                    if filter == Filter::Box { f64::from(u8::from(q == p)) } else { filter.eval(distance) }
                };
                let w = along(q.0, o.x, x) * along(q.1, o.y, y);
                let v = f64::from(value(q));
                (sum, weight, size) = (sum + w * v, weight + w, size + (w * v).abs());
            }
            let expected = if weight > 0.0 { sum / weight } else { 0.0 };
            let error = (f64::from(*got) - expected).abs();
            assert!(error <= 1e-6 * size / weight.abs().max(1e-3), "{filter:?} ({x}, {y}): {got} {expected}");
            negative += u32::from(*got < 0.0);
            let far = (x - bright.0).abs().max((y - bright.1).abs()) > filter.reach() + 1;
            assert!(!far || *got == 1.0 || weight <= 0.0, "{filter:?} ({x}, {y}): {got}");
        }
        let lobes = matches!(filter, Filter::Mitchell { .. } | Filter::CatmullRom | Filter::Lanczos { .. });
        assert!(lobes || negative == 0, "{filter:?}");
    }
}

const FLOOR: &str = r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><transform name="to_world"><lookat origin="0,2,4" target="0,0,0" up="0,1,0"/></transform>
<sampler type="independent"><integer name="sample_count" value="2"/></sampler>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform></shape>
<emitter type="constant"><rgb name="radiance" value="2,1e6,0.5"/></emitter></scene>"#;

fn etendue(folder: &Path, args: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_etendue"))
        .args(args.split_whitespace())
        .current_dir(folder)
        .output()
        .expect("the program runs")
}

fn with_floor() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scene.xml"), FLOOR).expect("a scene");
    folder
}

/// Sizes from one pixel to 2^30, and sample counts from 0 to 2^64 − 1.
#[test]
fn sizes_and_counts_at_their_ends() {
    let folder = with_floor();
    let run = |args: &str| {
        let output = etendue(folder.path(), &format!("render scene.xml -o a.exr -q {args}"));
        (output.status.code(), String::from_utf8_lossy(&output.stderr).trim_end().to_owned())
    };
    let size = || {
        let picture = read_picture(&folder.path().join("a.exr")).expect("a picture");
        assert!(picture.channel("R").is_some_and(|c| c.iter().all(|v| *v > 0.0)));
        [picture.width, picture.height]
    };
    let fine = (Some(0), String::new());
    for (args, expected) in [
        ("--size 1x1 --spp 4", [1, 1]),
        ("--size 1x100000 --spp 1", [1, 100_000]),
        ("--size 100000x1 --spp 1", [100_000, 1]),
        ("--size 32768x32768 --crop 32760,32752,8,16 --spp 2", [8, 16]),
        ("--size 1048576x1048576 --crop 1048575,1048575,1,1 --spp 2", [1, 1]),
        ("--spp 8589934592 --time 0.2", [8, 6]),
        ("--spp 18446744073709551615 --time 0.2", [8, 6]),
        ("--spp 18446744073709551615 --time 0.2 --replicas 7", [8, 6]),
    ] {
        assert_eq!(run(args), fine, "{args}");
        assert_eq!(size(), expected, "{args}");
    }
    // A film for which there is no room is refused at once, and a crop of it is not.
    let (code, said) = run("--size 32768x32768 --spp 1 --replicas 64");
    assert_eq!(code, Some(1));
    assert!(said.starts_with("error: the film of 32768 × 32768 pixels takes 4415"), "{said}");
    assert!(said.ends_with("; render it in parts with --crop, or with fewer layers or replicas"), "{said}");
    let (code, said) = run("--size 32769x32768 --spp 1");
    assert_eq!(
        (code, said.as_str()),
        (Some(1), "error: a film can have at most 1048576 pixels a side and 1073741824 in all")
    );
    assert_eq!(run("--spp 0").0, Some(2));
    assert_eq!(run("--size 0x5 --spp 1").0, Some(2));
    std::fs::write(
        folder.path().join("scene.xml"),
        FLOOR.replace("value=\"2\"/></sampler>", "value=\"0\"/></sampler>"),
    )
    .expect("a scene");
    let (code, said) = run("");
    assert!(code == Some(1) && said.contains("`sample_count` must be at least 1, found 0"), "{said}");
}

/// Half floats end at 65504: counted by channel, with advice; layers stay
/// floats.
#[test]
fn half_floats_saturate_with_advice() {
    let folder = with_floor();
    let output = etendue(folder.path(), "render scene.xml -o a.exr --spp 2 --half --aov P,Z,bad,m2 -q");
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        said,
        "warning: 48 values over 65504 were saturated to half floats (G 48); 32-bit floats keep them: leave \
         out --half, or set `component_format` to `float32` in the scene\n"
    );
    let picture = read_picture(&folder.path().join("a.exr")).expect("a picture");
    let of = |name: &str| picture.channel(name).expect("a channel");
    assert!(of("G").iter().all(|v| *v == 65504.0));
    assert!(of("R").iter().chain(of("B")).all(|v| *v > 0.0 && *v < 3.0));
    assert!(of("m2.G").iter().all(|v| *v > 1e11 && v.is_finite()));
    let floats = etendue(folder.path(), "render scene.xml -o b.exr --spp 2 -q");
    assert!(floats.stderr.is_empty());
    let picture = read_picture(&folder.path().join("b.exr")).expect("a picture");
    assert!(picture.channel("G").is_some_and(|c| c.iter().all(|v| *v > 65504.0)));
}

/// The smallest number there is, times one.
fn subnormals_stay() -> bool {
    let smallest = std::hint::black_box(f32::from_bits(1));
    let product = std::hint::black_box(smallest * std::hint::black_box(1.0));
    let half = std::hint::black_box(f64::MIN_POSITIVE) * std::hint::black_box(0.5);
    product.to_bits() == 1 && half > 0.0
}

/// Asks in the threads that render.
#[derive(Default)]
struct Asks {
    asked: AtomicU64,
    flushed: AtomicU64,
}

impl Monitor for Asks {
    fn progress(&self, _done: u64, _total: u64, _error: Option<f64>) {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.flushed.fetch_add(u64::from(!subnormals_stay()), Ordering::Relaxed);
    }

    fn stop(&self) -> bool {
        false
    }
}

/// No accelerator changes how a thread rounds: neither while it renders nor
/// after.
#[test]
fn subnormal_numbers_stay_in_every_thread() {
    assert!(subnormals_stay());
    let mut names = vec!["bvh8", "bvh2", "brute"];
    if cfg!(feature = "embree") {
        names.push("embree");
    }
    for accel in names {
        let ready = Ready::from_xml(FLOOR, None, Some(accel));
        let asks = Asks::default();
        let options = RenderOptions { threads: 3, ..options(16, 0) };
        let rendered = render(&ready.scene, &ready.integrator, &options, &asks).expect("a picture");
        assert_eq!(rendered.stats.bad.total(), 0);
        assert!(asks.asked.into_inner() > 0);
        assert_eq!(asks.flushed.into_inner(), 0, "{accel}");
        assert!(subnormals_stay(), "{accel}");
    }
}

/// A point of a floor under a sphere that glows, seen through a film that is
/// a millionth wide: every pixel has the radiance of A5 of the catalogue.
const SPHERE: &str = r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="orthographic"><transform name="to_world"><lookat origin="0,0.5,0" target="0,0,0" up="0,0,1"/><scale value="1e-6"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
<shape type="sphere"><float name="radius" value="0.5"/><point name="center" x="1.5" y="1" z="1.5"/>
<emitter type="area"><rgb name="radiance" value="10"/></emitter></shape></scene>"#;

/// The error of independent samples falls as the root of their number, with no
/// floor. To 2^14 samples; with `ETENDUE_LONG` set, to 2^20.
#[test]
fn error_falls_as_the_root_of_the_samples() {
    let long = std::env::var_os("ETENDUE_LONG").is_some();
    let truth = {
        // E = π L sin²θ · cos of the centre's direction, with all of the sphere above the floor.
        let d2 = 1.5_f64 * 1.5 + 1.0 + 1.5 * 1.5;
        0.5 * 10.0 * (0.25 / d2) / d2.sqrt()
    };
    let ready = Ready::from_xml(SPHERE, None, None);
    let errors: Vec<(f64, f64)> = (2..=if long { 20 } else { 14 })
        .step_by(2)
        .map(|power| {
            let options = RenderOptions {
                sequence: Sequence::Independent,
                layers: LayerSet::default(),
                ..options(1 << power, 11 + power)
            };
            let rendered = ready.render(&options);
            assert_eq!(rendered.stats.bad.total(), 0);
            let picture = rendered.film.resolve();
            let data = picture.channel("R").expect("red");
            let square = data.iter().map(|v| (f64::from(*v) - truth).powi(2)).sum::<f64>();
            (f64::from(power as u32), (square / data.len() as f64).sqrt().log2())
        })
        .collect();
    let n = errors.len() as f64;
    let mean = errors.iter().fold((0.0, 0.0), |m, e| (m.0 + e.0 / n, m.1 + e.1 / n));
    let (xy, xx) = errors
        .iter()
        .fold((0.0, 0.0), |s, e| (s.0 + (e.0 - mean.0) * (e.1 - mean.1), s.1 + (e.0 - mean.0).powi(2)));
    let slope = xy / xx;
    let list: Vec<String> = errors.iter().map(|(p, e)| format!("2^{p}: {:.3e}", e.exp2() / truth)).collect();
    println!("slope {slope:.4}; relative error {}", list.join(", "));
    assert!((slope + 0.5).abs() < 0.02, "slope {slope}: {}", list.join(", "));
}
