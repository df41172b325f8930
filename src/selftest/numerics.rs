//! F1 to F8: sums, numbers, files.

use super::Row;
use super::rays::Random;
use super::sheet::{Effort, SEEDS, Sheet};
use super::stage::{Still, diffuse, glow, mean, options, path, rgb, sky, twosided};
use crate::desc::Result;
use crate::film::{Film, FilmSpec, Filter, LayerSet, PixelSample};
use crate::load::read_picture;
use crate::math::{ONE_MINUS_EPSILON, Rgb, Vec2, Vec3};
use crate::render::RenderOptions;
use crate::sampling::{
    Sampler, Sequence, concentric_disk, cosine_hemisphere, uniform_cone, uniform_sphere, uniform_triangle,
};
use crate::save::{Header, Options, write_exr};

pub(super) const ROWS: &[Row] = &[
    Row { id: "F1", what: "sums of a constant to 2^30 samples", run: sums },
    Row { id: "F2", what: "values beyond half floats, written and read", run: half },
    Row { id: "F3", what: "films of one pixel and of one column; no samples", run: sizes },
    Row { id: "F4", what: "samplers past 2^32 samples and 10,000 dimensions", run: samplers },
    Row { id: "F5", what: "warps at the ends of their range", run: warps },
    Row { id: "F6", what: "samples that are no radiance are counted and left out", run: dropped },
    Row { id: "F7", what: "filters with negative lobes beside 1e12", run: lobes },
    Row { id: "F8", what: "error falls with the samples, without a floor", run: slope },
];

fn sums(sheet: &mut Sheet) -> Result<()> {
    let values = [0.1f32, 0.3, 1e5];
    let sample = PixelSample { rgb: Rgb::from_array(values), alpha: 1.0, ..PixelSample::default() };
    let film = Film::new(FilmSpec::new(1, 1, Filter::Box), LayerSet::default(), 1e5);
    let mut tile = film.tile(film.tiles()[0]);
    // Passes of 2^16 of which each is added many times: exact sums cannot tell.
    let passes = sheet.count(16).min(16);
    for pass in 0..passes {
        tile.reset(film.tiles()[0]);
        for index in pass << 16..(pass + 1) << 16 {
            tile.add((0, 0), Vec2::splat(0.5), index, &sample);
        }
        film.advance(pass << 16);
        film.merge(&tile);
    }
    let mut check = |film: &Film, count: &str| {
        let found = rgb(&film.resolve());
        for (value, found) in values.iter().zip(found) {
            sheet.within(format!("{value:e}, {count} samples"), f64::from(*value), f64::from(found), 1e-6);
        }
    };
    check(&film, "2^20");
    for _ in 0..1 << 14 {
        film.merge(&tile);
    }
    check(&film, "2^30");
    Ok(())
}

fn half(sheet: &mut Sheet) -> Result<()> {
    let body = format!(
        r#"<shape type="rectangle"><transform name="to_world"><scale value="9"/></transform>
        <emitter type="area"><rgb name="radiance" value="1e5,1e-3,1e30"/></emitter></shape>{}"#,
        sky(1.0)
    );
    let picture = sheet.shop.picture(&Still::new(body, [0.0, 0.0, 4.0], [0.0; 3]).samples(1), 1)?;
    let folder = sheet.shop.scratch()?;
    for (half, limit) in [(false, f64::from(f32::MAX)), (true, 65504.0)] {
        let file = folder.join(format!("half-{half}.exr"));
        let saturated = write_exr(&file, &picture, &Header::default(), Options { half })?;
        let read = read_picture(&file)?;
        let kind = if half { "half" } else { "float" };
        for (name, value) in [("R", 1e5f64), ("B", 1e30)] {
            let found = f64::from(read.channel(name).unwrap_or_default()[0]);
            sheet.within(format!("{kind} {value:e}"), value.min(limit), found, 1e-6);
        }
        let small = f64::from(read.channel("G").unwrap_or_default()[0]);
        sheet.within(format!("{kind} 1e-3"), 1e-3, small, 1e-3);
        sheet.exact(
            format!("{kind} values saturated, and told"),
            if half { 32.0 } else { 0.0 },
            saturated.iter().map(|s| s.count).sum::<u64>() as f64,
        );
    }
    Ok(())
}

fn sizes(sheet: &mut Sheet) -> Result<()> {
    for (width, height) in [(1u32, 1u32), (1, 10_000), (10_000, 1)] {
        let still = Still::new(sky(0.5), [0.0, 0.0, 4.0], [0.0; 3]).view(30.0, 4);
        let text = still
            .xml()
            .replace(r#"name="width" value="4""#, &format!(r#"name="width" value="{width}""#))
            .replace(r#"name="height" value="4""#, &format!(r#"name="height" value="{height}""#));
        let rendered = sheet.shop.build(&text)?.render(&options(1, 0))?;
        let picture = rendered.film.resolve();
        sheet.within(format!("{width} x {height}"), 0.5, mean(&picture), 1e-6);
    }
    let still = Still::new(sky(0.5), [0.0, 0.0, 4.0], [0.0; 3]);
    let ready = sheet.shop.build(&still.xml())?;
    let refused = ready.render(&options(0, 0)).err().map(|e| e.to_string());
    sheet.holds("no samples are refused", refused.is_some(), || "they were accepted".into());
    Ok(())
}

fn samplers(sheet: &mut Sheet) -> Result<()> {
    let mut random = Random(4);
    for sequence in Sequence::ALL {
        let (mut outside, mut same, mut tried) = (0u64, 0u64, 0u64);
        for _ in 0..sheet.count(20_000) {
            let index = random.next() >> (24 + random.next() % 40);
            let dimension = random.below(10_000);
            let at = |index| Sampler::new(3, (7, 11), index).with_sequence(sequence).get_2d(dimension);
            let (u, far) = (at(index), at(index + (1 << 40)));
            outside += u64::from(!(u.min_element() >= 0.0 && u.max_element() < 1.0));
            same += u64::from(u == far);
            tried += 1;
        }
        sheet.none(format!("{}: numbers outside of [0, 1)", sequence.name()), outside, tried);
        sheet.none(format!("{}: the same 2^40 samples later", sequence.name()), same, tried);
    }
    // Two hundred bounces use as many dimensions, and must not correlate.
    let body = format!(
        r#"<shape type="cube"><boolean name="flip_normals" value="true"/>{}{}</shape>"#,
        twosided(0.9),
        glow(1.0)
    );
    let still = Still::new(body, [0.1, 0.2, 0.3], [1.0, 0.4, -0.2]).samples(32);
    let still = still.integrator(super::stage::path_unended(200));
    for sequence in Sequence::ALL {
        let means = sheet.shop.means_with(&still, sequence)?;
        let sum = (1.0 - 0.9f64.powi(200)) / 0.1;
        sheet.mean(format!("furnace of 200 bounces, {}", sequence.name()), sum, &means.values, 0.02);
    }
    Ok(())
}

fn warps(sheet: &mut Sheet) -> Result<()> {
    let ends = [0.0, f32::MIN_POSITIVE, 1e-7, 0.25, 0.5, 0.75, ONE_MINUS_EPSILON];
    let (mut bad, mut tried) = (0u64, 0u64);
    let mut count = |fine: bool| {
        bad += u64::from(!fine);
        tried += 1;
    };
    let unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-6;
    for (u, v) in ends.iter().flat_map(|u| ends.map(|v| (*u, v))) {
        let u = Vec2::new(u, v);
        count(concentric_disk(u).length() <= 1.0 + 1e-6);
        let w = cosine_hemisphere(u);
        count(unit(w) && w.z >= 0.0);
        count(unit(uniform_sphere(u)));
        let (a, b) = uniform_triangle(u);
        count(a >= 0.0 && b >= 0.0 && a + b <= 1.0 + 1e-6);
        for cone in [0.0, 1e-30, 1e-12, 1e-3, 1.0, 2.0] {
            let w = uniform_cone(u, cone);
            count(unit(w) && 1.0 - w.z <= cone + 1e-6);
        }
    }
    sheet.none("points outside", bad, tried);
    Ok(())
}

fn dropped(sheet: &mut Sheet) -> Result<()> {
    // Light that overflows when it is reflected twice: inf, and inf · 0.
    let body = format!(
        r#"<shape type="cube"><boolean name="flip_normals" value="true"/>{}{}</shape>"#,
        twosided(0.9),
        glow(3e38)
    );
    let still = Still::new(body, [0.1, 0.2, 0.3], [1.0, 0.4, -0.2]).integrator(path(6));
    let ready = sheet.shop.build(&still.xml())?;
    let rendered = ready.render(&RenderOptions { threads: 2, ..options(4, 0) })?;
    let bad = &rendered.stats.bad;
    sheet.exact("samples counted", rendered.stats.samples as f64, bad.total() as f64);
    sheet.exact("of which the first are located", 10.0, bad.first.len() as f64);
    let finite = rgb(&rendered.film.resolve()).iter().all(|v| v.is_finite());
    sheet.holds("the picture is finite", finite, || "it is not".into());
    Ok(())
}

fn lobes(sheet: &mut Sheet) -> Result<()> {
    // One bright pixel in a black picture: what any pixel gets is the filter's
    // weight there, no less than its most negative value.
    for (k, filter) in Filter::examples().into_iter().enumerate() {
        let spec = FilmSpec::new(33, 33, filter);
        let film = Film::new(spec, LayerSet::default(), 1e12);
        for rect in film.tiles() {
            let mut tile = film.tile(rect);
            for pixel in rect.pixels() {
                for index in 0..16 {
                    let offset = Sampler::new(1, pixel, index).pixel_and_light().0;
                    let value = if pixel == (16, 16) { 1e12 } else { 0.0 };
                    let sample = PixelSample { rgb: Rgb::splat(value), alpha: 1.0, ..PixelSample::default() };
                    tile.add(pixel, offset, index, &sample);
                }
            }
            film.merge(&tile);
        }
        let red = rgb(&film.resolve());
        let sum: f64 = red[..1089].iter().map(|v| f64::from(*v)).sum();
        let least = red[..1089].iter().copied().fold(0.0, f32::min);
        sheet.within(format!("{} {k}: light kept", filter.name()), 1e12, sum, 0.1);
        // Lanczos goes down to -0.22 of its peak in one dimension.
        let floor = -0.3 * f64::from(red[544]);
        sheet.holds(
            format!("{} {k}: no deeper halo than its lobes", filter.name()),
            f64::from(least) >= floor,
            || format!("{least}, beside {}", red[544]),
        );
    }
    Ok(())
}

fn slope(sheet: &mut Sheet) -> Result<()> {
    // Independent samples of a soft shadow: the error of the mean halves with
    // four times the samples, at all counts.
    let body = format!(
        r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>{}</shape>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="1"/></transform>
        {}</shape>"#,
        diffuse(0.5),
        glow(1.0)
    );
    let still = Still::new(body, [0.3, 0.5, 0.0], [0.0; 3]).integrator(path(2)).view(0.01, 8);
    let ready = sheet.shop.build(&still.xml())?;
    let expected = 0.554_126_424 * 0.5;
    let most = if sheet.shop.effort == Effort::Full { 16 } else { 10 };
    let mut points = Vec::new();
    for log in (2..=most).step_by(2) {
        let mut squares = 0.0;
        let mut count = 0.0;
        for seed in 0..SEEDS {
            let options = RenderOptions {
                sequence: Sequence::Independent,
                ..options(1 << log, sheet.shop.seed + seed)
            };
            for value in rgb(&ready.render(&options)?.film.resolve()).iter().take(64) {
                squares += (f64::from(*value) - expected).powi(2);
                count += 1.0;
            }
        }
        points.push((f64::from(log), 0.5 * f64::log2(squares / count)));
    }
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let top: f64 = points.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    let bottom: f64 = points.iter().map(|(x, _)| (x - mx).powi(2)).sum();
    // 1024 squares each: their logarithm is known to 3 %.
    sheet.within(format!("slope, 4 to 2^{most} samples"), -0.5, top / bottom, 0.04);
    Ok(())
}
