//! The film: exact sums, order independence, crops, errors.

use etendue::desc::{Category, Object, Param, Pos, SceneDesc, Value};
use etendue::film::{Film, FilmSpec, Filter, Groups, LayerSet, PixelSample, Rect};
use etendue::math::{Rgb, Vec2, Vec3};
use etendue::sampling::Sampler;

/// Samples that are a function of pixel and index, as a renderer's are.
fn sample(pixel: (i32, i32), index: u64) -> (Vec2, PixelSample) {
    let sampler = Sampler::new(5, pixel, index);
    let (offset, light) = sampler.pixel_and_light();
    let sample = PixelSample {
        motion: Vec2::ZERO,
        rgb: Rgb::new(light.x, light.x * light.y * 3.0, 0.2 + offset.x),
        alpha: light.y.round(),
        albedo: Rgb::new(offset.y, 0.5, light.x),
        normal: Vec3::new(light.x - 0.5, 0.0, 1.0),
        position: Vec3::new(pixel.0 as f32 * 100.0, -3.0, light.y),
        depth: if light.x > 0.1 { 1.0 + light.y } else { f32::INFINITY },
    };
    (offset, sample)
}

/// Adds some samples of every pixel of a rectangle; returns its tile.
fn trace(film: &Film, rect: Rect, indices: std::ops::Range<u64>) -> etendue::film::Tile {
    let mut tile = film.tile(rect);
    for pixel in rect.pixels() {
        for index in indices.clone() {
            let (offset, sample) = sample(pixel, index);
            tile.add(pixel, offset, index, &sample);
        }
    }
    tile
}

fn bits(film: &Film) -> Vec<(String, Vec<u32>)> {
    let picture = film.resolve();
    assert!(picture.channels.iter().all(|c| c.data.iter().all(|v| !v.is_nan())));
    picture.channels.into_iter().map(|c| (c.name, c.data.iter().map(|v| v.to_bits()).collect())).collect()
}

#[test]
fn constant_pixel_keeps_its_value() {
    let constant = PixelSample {
        rgb: Rgb::new(0.1, 0.3, 3.0),
        alpha: 1.0,
        albedo: Rgb::new(0.1, 0.3, 1.0),
        ..PixelSample::default()
    };
    let layers = LayerSet { alpha: true, albedo: true, error: true, ..LayerSet::default() };
    let replicated =
        [Groups::Replicas(2), Groups::Replicas(16), Groups::Replicas(64)].map(|g| (Filter::Box, g));
    for (filter, groups) in Filter::examples().into_iter().map(|f| (f, Groups::Halves)).chain(replicated) {
        let film = Film::grouped(FilmSpec::new(1, 1, filter), layers, 1.0, groups);
        let mut tile = film.tile(film.tiles()[0]);
        let check = |film: &Film| {
            let picture = film.resolve();
            let near = |name: &str, v: f32| {
                let got = picture.channel(name).unwrap()[0];
                assert!((got - v).abs() <= 1e-6 * v, "{filter:?} {name}: {got} for {v}");
            };
            near("R", 0.1);
            near("G", 0.3);
            near("B", 3.0);
            near("A", 1.0);
            near("albedo.G", 0.3);
            assert!(film.relative_error() < 1e-6);
        };
        // 2^20 samples in 16 passes …
        for pass in 0..16u64 {
            tile.reset(film.tiles()[0]);
            for index in pass << 16..(pass + 1) << 16 {
                let offset = Vec2::new((index % 251) as f32 / 251.0, (index % 241) as f32 / 241.0);
                tile.add((0, 0), offset, index, &constant);
            }
            film.advance(pass << 16);
            film.merge(&tile);
        }
        check(&film);
        // … and 2^30 of them.
        for _ in 0..1 << 14 {
            film.merge(&tile);
        }
        check(&film);
    }
}

#[test]
fn picture_has_the_same_bits_for_every_order_of_merges() {
    for filter in [Filter::Box, Filter::default(), Filter::Lanczos { lobes: 3 }] {
        let groups = if filter == Filter::Box { Groups::Replicas(5) } else { Groups::Halves };
        let film = || Film::grouped(FilmSpec::new(45, 37, filter), LayerSet::ALL, 1.0, groups);
        let tiles: Vec<_> = {
            let film = film();
            [0..3, 3..8]
                .map(|range| {
                    film.tiles().into_iter().map(|r| trace(&film, r, range.clone())).collect::<Vec<_>>()
                })
                .concat()
        };
        assert_eq!(tiles.len(), 2 * 9);
        let reference = film();
        tiles.iter().for_each(|t| reference.merge(t));
        let reference = bits(&reference);
        for step in [5, 7, 11, 17] {
            let other = film();
            (0..tiles.len()).for_each(|i| other.merge(&tiles[(i * step + 3) % tiles.len()]));
            assert!(bits(&other) == reference, "order {step}");
        }
        let other = film();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let (other, tiles) = (&other, &tiles);
                scope.spawn(move || tiles.iter().skip(thread).step_by(4).for_each(|t| other.merge(t)));
            }
        });
        assert!(bits(&other) == reference, "threads");
    }
}

#[test]
fn crop_is_that_region_of_the_whole() {
    let size = [50, 41];
    for filter in Filter::examples() {
        let whole = Film::new(FilmSpec::new(size[0], size[1], filter), LayerSet::ALL, 1.0);
        whole.tiles().into_iter().for_each(|r| whole.merge(&trace(&whole, r, 0..4)));
        let picture = whole.resolve();
        for crop in [[7, 3, 20, 18], [0, 0, 50, 1], [49, 40, 1, 1], [16, 16, 16, 16]] {
            let spec = FilmSpec { crop, ..FilmSpec::new(size[0], size[1], filter) };
            let film = Film::new(spec, LayerSet::ALL, 1.0);
            film.tiles().into_iter().for_each(|r| film.merge(&trace(&film, r, 0..4)));
            let part = film.resolve();
            assert_eq!(part.window.area(), (crop[2] * crop[3]) as usize);
            for (channel, all) in part.channels.iter().zip(&picture.channels) {
                assert_eq!(channel.name, all.name);
                for (i, (x, y)) in part.window.pixels().enumerate() {
                    // The error is pooled over what the crop has.
                    let inner = part.window.grow(-2).contains((x, y));
                    if channel.name.starts_with("error") && !inner {
                        continue;
                    }
                    let other = all.data[(y * size[0] as i32 + x) as usize];
                    assert_eq!(
                        channel.data[i].to_bits(),
                        other.to_bits(),
                        "{filter:?} {} ({x}, {y})",
                        channel.name
                    );
                }
            }
        }
    }
}

#[test]
fn tiles_cover_the_sample_bounds_once_on_a_fixed_grid() {
    let mut spec = FilmSpec::new(70, 50, Filter::default());
    for (crop, border, bounds) in [
        ([0, 0, 70, 50], false, Rect::new(0, 0, 70, 50)),
        ([0, 0, 70, 50], true, Rect::new(-2, -2, 74, 54)),
        ([20, 17, 30, 5], false, Rect::new(16, 13, 38, 13)),
        ([0, 0, 1, 1], false, Rect::new(0, 0, 5, 5)),
    ] {
        (spec.crop, spec.sample_border) = (crop, border);
        assert_eq!(spec.sample_bounds(), bounds);
        let film = Film::new(spec.clone(), LayerSet::default(), 1.0);
        let mut seen = std::collections::HashSet::new();
        for tile in film.tiles() {
            assert!(!tile.is_empty());
            let cell = |p: (i32, i32)| (p.0.div_euclid(16), p.1.div_euclid(16));
            assert!(tile.pixels().all(|p| cell(p) == cell(tile.min) && seen.insert(p)));
        }
        assert_eq!(seen.len(), bounds.area());
        assert!(seen.iter().all(|p| bounds.contains(*p)));
    }
}

/// Splatting against the definition: Σ f(x)·f(y)·v / Σ f(x)·f(y).
#[test]
fn pixels_are_the_weighted_means_of_all_samples_in_reach() {
    for filter in Filter::examples() {
        let spec = FilmSpec { sample_border: true, ..FilmSpec::new(9, 7, filter) };
        let film = Film::new(spec, LayerSet { depth: true, ..LayerSet::default() }, 1.0);
        film.tiles().into_iter().for_each(|r| film.merge(&trace(&film, r, 0..3)));
        let picture = film.resolve();
        for (i, (x, y)) in picture.window.pixels().enumerate() {
            let (mut sum, mut weight, mut depth) = (0.0, 0.0, f32::INFINITY);
            for pixel in film.sample_bounds().pixels() {
                for index in 0..3 {
                    let (offset, s) = sample(pixel, index);
                    let place = |p: i32, o: f32, q: i32| f64::from(p) + f64::from(o) - f64::from(q) - 0.5;
                    let w =
                        filter.eval(place(pixel.0, offset.x, x)) * filter.eval(place(pixel.1, offset.y, y));
                    let w = if filter == Filter::Box { f64::from(u8::from(pixel == (x, y))) } else { w };
                    weight += w;
                    sum += w * f64::from(s.rgb.y);
                    if pixel == (x, y) {
                        depth = depth.min(s.depth);
                    }
                }
            }
            let expected = if weight > 0.0 { sum / weight } else { 0.0 };
            let got = f64::from(picture.channel("G").unwrap()[i]);
            assert!(
                (got - expected).abs() <= 1e-6 * expected.abs().max(1.0),
                "{filter:?} ({x}, {y}): {got} {expected}"
            );
            assert_eq!(picture.channel("Z").unwrap()[i], depth);
        }
    }
}

/// Independent noise of mean 1 and known variance in every sample.
fn noise(size: u32, spp: u64, filter: Filter, groups: Groups) -> Film {
    let layers = LayerSet { error: true, ..LayerSet::default() };
    let film = Film::grouped(FilmSpec::new(size, size, filter), layers, 1.0, groups);
    for rect in film.tiles() {
        let mut tile = film.tile(rect);
        for pixel in rect.pixels() {
            for index in 0..spp {
                // A randomisation per sample: not stratified.
                let s = Sampler::new(1000 + index, pixel, 0);
                let rgb = Rgb::new(2.0 * s.get_1d(0), 2.0 * s.get_1d(1), 2.0 * f32::from(s.get_1d(2) < 0.5));
                tile.add(pixel, s.get_2d(3), index, &PixelSample { rgb, ..PixelSample::default() });
            }
        }
        film.merge(&tile);
    }
    film
}

#[test]
fn error_of_independent_noise_is_its_standard_deviation() {
    let mean = |v: &mut dyn Iterator<Item = f64>| {
        let (sum, n) = v.fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        sum / n
    };
    let tent = Filter::Tent { radius: 1.0 };
    for (filter, spp, groups) in [
        (Filter::Box, 16, Groups::Halves),
        (Filter::Box, 64, Groups::Halves),
        (tent, 16, Groups::Halves),
        (Filter::default(), 16, Groups::Halves),
        (Filter::Box, 4, Groups::Replicas(2)),
        (Filter::Box, 16, Groups::Replicas(16)),
        (Filter::Box, 27, Groups::Replicas(5)),
        (tent, 64, Groups::Replicas(16)),
        (Filter::default(), 64, Groups::Replicas(7)),
    ] {
        let film = noise(160, spp, filter, groups);
        let picture = film.resolve();
        let inner = picture.window.grow(-4);
        for (name, variance) in [("R", 1.0 / 3.0), ("G", 1.0 / 3.0), ("B", 1.0)] {
            let values = |name: &str| -> Vec<f64> {
                let data = picture.channel(name).unwrap();
                let pixels = picture.window.pixels().zip(data);
                pixels.filter(|(p, _)| inner.contains(*p)).map(|(_, v)| f64::from(*v)).collect()
            };
            let (color, error) = (values(name), values(&format!("error.{name}")));
            let m = mean(&mut color.iter().copied());
            let actual = mean(&mut color.iter().map(|c| (c - m).powi(2)));
            let stated = mean(&mut error.iter().map(|e| e * e));
            assert!(
                (stated / actual - 1.0).abs() < 0.05,
                "{filter:?} {spp} {groups:?} {name}: {stated} for {actual}"
            );
            if filter == Filter::Box {
                assert!((stated / (variance / spp as f64) - 1.0).abs() < 0.05, "{stated}");
            }
            // Pooled: no pixel is far off.
            assert!(error.iter().all(|e| (0.3..3.0).contains(&(e / actual.sqrt()))));
        }
        // Relative error: mean of the channels' variances over mean² = 1, plus 1 %. What each pixel
        // is without noise can only be estimated: right but for a part of the noise.
        let all = ["R", "G", "B"].map(|c| picture.channel(&format!("error.{c}")).unwrap());
        let stated = mean(&mut all.iter().flat_map(|c| c.iter()).map(|e| f64::from(*e).powi(2)));
        let ratio = film.relative_error() / (stated / 1.01).sqrt();
        assert!((0.97..1.03 + stated.sqrt()).contains(&ratio), "{filter:?} {spp}: {ratio} {stated}");
    }
}

#[test]
fn error_is_finite_or_infinite_but_never_nan() {
    // One sample per pixel: a spatial figure, right for flat noise and a box.
    let film = noise(96, 1, Filter::Box, Groups::Halves);
    let picture = film.resolve();
    let error = picture.channel("error.R").unwrap();
    let mean = error.iter().map(|e| f64::from(e * e)).sum::<f64>() / error.len() as f64;
    assert!((mean * 3.0 - 1.0).abs() < 0.1, "{mean}");
    assert!(film.relative_error().is_finite());

    // No samples at all, and one sample in one pixel.
    let film = Film::new(FilmSpec::new(3, 1, Filter::Box), LayerSet::ALL, 1.0);
    assert_eq!(film.relative_error(), f64::INFINITY);
    let mut tile = film.tile(film.tiles()[0]);
    tile.add((1, 0), Vec2::splat(0.5), 0, &PixelSample { rgb: Rgb::ONE, ..PixelSample::default() });
    film.merge(&tile);
    let picture = film.resolve();
    assert_eq!(picture.channel("R").unwrap(), [0.0, 1.0, 0.0]);
    assert_eq!(picture.channel("error.G").unwrap(), [f32::INFINITY; 3]);
    assert_eq!(picture.channel("Z").unwrap(), [f32::INFINITY; 3]);

    // Black is known exactly.
    let film = Film::new(FilmSpec::new(2, 2, Filter::Box), LayerSet::ALL, 1.0);
    let mut tile = film.tile(film.tiles()[0]);
    for pixel in tile.rect().pixels() {
        (0..4).for_each(|i| assert!(tile.add(pixel, Vec2::splat(0.5), i, &PixelSample::default())));
    }
    film.merge(&tile);
    assert_eq!(film.relative_error(), 0.0);
}

#[test]
fn error_of_stratified_samples_is_conservative() {
    let film =
        Film::new(FilmSpec::new(64, 64, Filter::Box), LayerSet { error: true, ..LayerSet::default() }, 1.0);
    for rect in film.tiles() {
        let mut tile = film.tile(rect);
        for pixel in rect.pixels() {
            for index in 0..64 {
                let (offset, light) = Sampler::new(0, pixel, index).pixel_and_light();
                let value = light.x * light.y * (1.0 + offset.x);
                tile.add(
                    pixel,
                    offset,
                    index,
                    &PixelSample { rgb: Rgb::splat(value), ..PixelSample::default() },
                );
            }
        }
        film.merge(&tile);
    }
    let picture = film.resolve();
    let mean_square = |data: &[f32], zero: f64| {
        data.iter().map(|v| (f64::from(*v) - zero).powi(2)).sum::<f64>() / data.len() as f64
    };
    let actual = mean_square(picture.channel("R").unwrap(), 0.375).sqrt();
    let stated = mean_square(picture.channel("error.R").unwrap(), 0.0).sqrt();
    assert!(stated >= 0.95 * actual, "{stated} for {actual}");
}

#[test]
fn values_out_of_range_are_left_out() {
    let film = Film::new(FilmSpec::new(1, 1, Filter::Box), LayerSet::ALL, 1e-3);
    let mut tile = film.tile(film.tiles()[0]);
    let of = |v: f32| PixelSample { rgb: Rgb::splat(v), position: Vec3::splat(v), ..PixelSample::default() };
    for bad in [1e20, 3e38] {
        assert!(bad > Film::largest_radiance(1e-3));
        assert!(!tile.add((0, 0), Vec2::ZERO, 0, &of(bad)));
        tile.leave_out((0, 0));
    }
    for i in 0..8 {
        assert!(tile.add((0, 0), Vec2::ZERO, i, &of(2e-3)));
    }
    film.merge(&tile);
    film.merge(&tile);
    assert_eq!(film.resolve().channel("bad").unwrap(), [4.0]);
    assert!((film.resolve().channel("R").unwrap()[0] - 2e-3).abs() < 1e-9);

    // Scaling radiance by a power of two scales the picture exactly.
    let picture = |scale: f32| {
        let film = Film::new(FilmSpec::new(1, 1, Filter::Box), LayerSet::default(), f64::from(scale));
        let mut tile = film.tile(film.tiles()[0]);
        (0..100).for_each(|i| assert!(tile.add((0, 0), Vec2::ZERO, i, &of(scale * (0.1 + i as f32)))));
        film.merge(&tile);
        film.resolve().channel("R").unwrap()[0]
    };
    for scale in [2f32.powi(-60), 2f32.powi(60)] {
        assert_eq!(picture(scale), picture(1.0) * scale);
    }
}

/// A film object with an optional filter, as a scene file would give them.
fn describe(film: Vec<(&str, Value)>, filter: Option<(&str, Vec<(&str, Value)>)>) -> SceneDesc {
    let params = |list: Vec<(&str, Value)>| -> Vec<Param> {
        let pos = Pos { file: 0, line: 2, column: 3 };
        list.into_iter().map(|(name, value)| Param { name: name.into(), value, pos }).collect()
    };
    let object = |category, plugin: &str, params| Object {
        category,
        plugin: plugin.into(),
        id: String::new(),
        pos: Pos { file: 0, line: 1, column: 1 },
        params,
    };
    let mut film = params(film);
    let mut objects = Vec::new();
    if let Some((plugin, list)) = filter {
        film.push(Param { name: String::new(), value: Value::Object(1), pos: Pos::default() });
        objects.push(object(Category::Rfilter, plugin, params(list)));
    }
    objects.insert(0, object(Category::Film, "hdrfilm", film));
    SceneDesc { files: vec!["scene.xml".into()], objects, ..SceneDesc::default() }
}

#[test]
fn films_are_read_with_mitsubas_defaults() {
    let read = |scene: &SceneDesc| FilmSpec::from_desc(scene, 0);
    assert_eq!(read(&describe(vec![], None)).unwrap(), FilmSpec::default());
    let text = |s: &str| Value::String(s.into());
    let spec = read(&describe(
        vec![
            ("width", Value::Int(64)),
            ("height", Value::Int(32)),
            ("crop_offset_x", Value::Int(10)),
            ("crop_width", Value::Int(54)),
            ("pixel_format", text("rgba")),
            ("component_format", text("Float16")),
            ("file_format", text("openexr")),
            ("sample_border", Value::Bool(true)),
        ],
        Some(("mitchell", vec![("B", Value::Float(0.0))])),
    ))
    .unwrap();
    assert_eq!((spec.size, spec.crop), ([64, 32], [10, 0, 54, 32]));
    assert!(spec.alpha && spec.half && spec.sample_border);
    assert_eq!(spec.filter, Filter::Mitchell { b: 0.0, c: 1.0 / 3.0 });
    for (plugin, filter) in [
        ("box", Filter::Box),
        ("tent", Filter::Tent { radius: 1.0 }),
        ("gaussian", Filter::Gaussian { stddev: 0.5 }),
        ("catmullrom", Filter::CatmullRom),
        ("lanczos", Filter::Lanczos { lobes: 3 }),
    ] {
        assert_eq!(read(&describe(vec![], Some((plugin, vec![])))).unwrap().filter, filter);
        assert_eq!(filter.name(), plugin);
    }
}

#[test]
fn bad_films_are_errors_with_a_place() {
    let text = |s: &str| Value::String(s.into());
    for (film, filter, expected) in [
        (
            vec![("width", Value::Int(0))],
            None,
            "scene.xml:2:3: `width` must be from 1 to 1048576 pixels, found 0",
        ),
        (
            vec![("crop_width", Value::Int(1)), ("crop_offset_x", Value::Int(768))],
            None,
            "scene.xml:2:3: the crop window ends at 769, outside the film of 768 pixels",
        ),
        (
            vec![("crop_offset_y", Value::Int(-1))],
            None,
            "scene.xml:2:3: `crop_offset_y` must not be negative, found -1",
        ),
        (
            vec![("pixel_format", text("xyz"))],
            None,
            "scene.xml:2:3: `pixel_format` has no value `xyz` here; known: rgb, rgba",
        ),
        (
            vec![("widht", Value::Int(1))],
            None,
            "scene.xml:2:3: film `hdrfilm` takes no parameter `widht`; did you mean `width`?",
        ),
        (
            vec![],
            Some(("gausian", vec![])),
            "scene.xml:1:1: no reconstruction filter is called `gausian`; did you mean `gaussian`?",
        ),
        (
            vec![],
            Some(("tent", vec![("radius", Value::Float(0.0))])),
            "scene.xml:1:1: the radius of `tent` must be above 0 and at most 16 pixels, found 0",
        ),
        (
            vec![],
            Some(("lanczos", vec![("lobes", Value::Int(-2))])),
            "scene.xml:2:3: `lobes` must be at least 1, found -2",
        ),
        (
            vec![],
            Some(("box", vec![("radius", Value::Float(1.0))])),
            "scene.xml:2:3: rfilter `box` takes no parameter `radius`",
        ),
    ] {
        assert_eq!(FilmSpec::from_desc(&describe(film, filter), 0).unwrap_err().to_string(), expected);
    }
}
