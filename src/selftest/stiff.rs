//! E1 to E8: light of very different strengths, sharp lobes, long paths.

use std::f64::consts::PI;

use super::Row;
use super::rays::Random;
use super::sheet::{Same, Sheet, mean_and_error};
use super::stage::{FLOOR, Still, diffuse, glow, ortho, path, path_unended, twosided};
use crate::bsdf::Bsdf;
use crate::desc::{Mesh, Result};
use crate::math::{Vec2, Vec3};

pub(super) const ROWS: &[Row] = &[
    Row { id: "E1", what: "a candle beside a hidden sun", run: hidden_sun },
    Row { id: "E2", what: "many lights of which one matters", run: many_lights },
    Row { id: "E3", what: "surroundings of few texels, rows or light", run: surroundings },
    Row { id: "E4", what: "a rough mirror that becomes smooth", run: mirror },
    Row { id: "E5", what: "grazing directions and any random numbers", run: grazing },
    Row { id: "E6", what: "thousands of bounces at albedo 0.999", run: long_paths },
    Row { id: "E8", what: "lights on and by a surface, and behind a hole", run: close },
];

fn candle(height: f64) -> String {
    format!(
        r#"<emitter type="point"><point name="position" x="0" y="{height:e}" z="0"/>
        <rgb name="intensity" value="{:e}"/></emitter>"#,
        height * height
    )
}

fn seen(body: String) -> Still {
    Still::new(body, [0.3, 0.5, 0.0], [0.0; 3]).integrator(path(2))
}

fn hidden_sun(sheet: &mut Sheet) -> Result<()> {
    // The sun shines straight down on a black board over floor and candle.
    let board = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
        <scale value="100"/><translate y="3"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>"#;
    for strength in [1e3, 1e12, 1e30] {
        let sun = format!(
            r#"<emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/>
            <rgb name="irradiance" value="{strength:e}"/></emitter>"#
        );
        let still = seen(format!("{FLOOR}{board}{sun}{}", candle(1.0))).samples(1024);
        sheet.radiance_to(format!("sun of {strength:e}"), 0.5 / PI, 0.02, &still)?;
    }
    // The same among many: lamps below the floor that nobody sees.
    let mut crowd = String::new();
    for i in 0..20 {
        let x = f64::from(i) / 10.0 - 1.0;
        crowd += &format!(
            r#"<emitter type="point"><point name="position" x="{x}" y="-1" z="0"/>
            <rgb name="intensity" value="1"/></emitter>"#
        );
    }
    let sun = r#"<emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/>
        <rgb name="irradiance" value="1e6"/></emitter>"#;
    let still = seen(format!("{FLOOR}{board}{sun}{crowd}{}", candle(1.0))).samples(1024);
    sheet.radiance_to("sun of 1e6 and 20 lamps more", 0.5 / PI, 0.06, &still)
}

fn many_lights(sheet: &mut Sheet) -> Result<()> {
    // Glowing triangles below and above the floor that all face away from it.
    let count = if sheet.full() { 1_000_000 } else { 50_000 };
    let mut random = Random(2);
    let mut mesh = Mesh::default();
    for i in 0..count {
        let at = random.vector() * Vec3::new(0.9, 0.2, 0.9) + Vec3::new(0.0, 1.5, 0.0);
        mesh.positions.extend([at, at + Vec3::X * 1e-3, at - Vec3::Z * 1e-3]);
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let file = sheet.shop.mesh("crowd", &mesh)?;
    let crowd = format!(r#"<shape type="ply"><string name="filename" value="{file}"/>{}</shape>"#, glow(1e3));
    // Straight below the candle nothing of the crowd is in the way: it is above.
    let still = seen(format!("{FLOOR}{crowd}{}", candle(1.0))).samples(256);
    sheet.radiance(format!("one of {}", count + 1), 0.5 / PI, &still)
}

fn surroundings(sheet: &mut Sheet) -> Result<()> {
    let floor = |file: &str| {
        seen(format!(r#"{FLOOR}<emitter type="envmap"><string name="filename" value="{file}"/></emitter>"#))
            .samples(256)
    };
    for (name, size) in [("1 x 1", [1, 1]), ("2 x 1", [2, 1]), ("1 x 2", [1, 2]), ("64 x 1", [64, 1])] {
        let file = sheet.shop.image(&name.replace(' ', ""), size, &|_| [2.0; 3])?;
        sheet.radiance(format!("grey, {name}"), 1.0, &floor(&file))?;
    }
    let black = sheet.shop.image("black", [16, 8], &|_| [0.0; 3])?;
    let still = floor(&black);
    let mean = sheet.shop.means(&still)?.values[0];
    sheet.exact("black", 0.0, mean);
    // The upper half: rows that are all black below.
    let half = sheet.shop.image("half", [16, 9], &|i| [f32::from(u8::from(i / 16 < 4)); 3])?;
    let means = sheet.shop.means(&floor(&half))?;
    sheet.holds("zero rows: finite, and some light", means.values[0] > 0.3 && means.values[0] < 0.5, || {
        format!("{}", means.values[0])
    });
    for (name, bad) in [("NaN", f32::NAN), ("infinite", f32::INFINITY), ("negative", -1.0)] {
        let file = sheet.shop.image(name, [16, 8], &|i| [if i == 37 { bad } else { 1.0 }; 3])?;
        let message = match sheet.shop.build(&floor(&file).xml()) {
            Ok(_) => "it was accepted".to_owned(),
            Err(error) => error.to_string(),
        };
        // Texel 37 of rows of 16 is at column 5, row 2.
        let named = message.contains("(5, 2)") || message.contains("5, 2");
        sheet.holds(format!("a {name} texel is refused, and named"), named, || message);
    }
    Ok(())
}

fn mirror(sheet: &mut Sheet) -> Result<()> {
    // The camera looks at a mirror in which it sees the middle of a lamp.
    let scene = |alpha: Option<f64>, half: f64, integrator: &str| {
        let bsdf = match alpha {
            None => r#"<bsdf type="conductor"><string name="material" value="none"/></bsdf>"#.to_owned(),
            Some(alpha) => format!(
                r#"<bsdf type="roughconductor"><string name="material" value="none"/>
                <string name="distribution" value="ggx"/><float name="alpha" value="{alpha:e}"/></bsdf>"#
            ),
        };
        let body = format!(
            r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>{bsdf}</shape>
            <shape type="rectangle"><transform name="to_world"><scale value="{half:e}"/><rotate y="1" angle="90"/>
            <translate x="-1" y="1"/></transform>{}</shape>"#,
            glow(1.0)
        );
        Still::new(body, [1.0, 1.0, 0.0], [0.0; 3]).integrator(integrator).samples(1024)
    };
    for (half, alphas) in [(0.5, [1e-4, 1e-8, 1e-12]), (0.01, [1e-5, 1e-8, 1e-12])] {
        for alpha in alphas {
            let still = scene(Some(alpha), half, &path(2));
            sheet.radiance(format!("lamp of {half}, alpha {alpha:e}: as a mirror"), 1.0, &still)?;
        }
        for alpha in [1e-1, 1e-2] {
            let direct = |light: u32, bsdf: u32| {
                format!(
                    r#"<integrator type="direct"><integer name="emitter_samples" value="{light}"/>
                    <integer name="bsdf_samples" value="{bsdf}"/></integrator>"#
                )
            };
            let both = mean_and_error(&sheet.shop.means(&scene(Some(alpha), half, &direct(1, 1)))?.values);
            let lights = scene(Some(alpha), half, &direct(1, 0)).samples(4096);
            let lights = mean_and_error(&sheet.shop.means(&lights)?.values);
            sheet.against(
                format!("lamp of {half}, alpha {alpha:e}: lights alone, to both"),
                both,
                lights,
                Same::to(0.03),
            );
        }
    }
    let smooth = scene(None, 0.5, &path(2));
    sheet.radiance("smooth mirror", 1.0, &smooth)
}

fn grazing(sheet: &mut Sheet) -> Result<()> {
    let ends = [0.0, f32::MIN_POSITIVE, 1e-7, 0.5, 1.0 - f32::EPSILON / 2.0];
    let mut random = Random(5);
    let (mut bad, mut tried, mut first) = (0, 0, String::new());
    for (name, bsdf) in Bsdf::examples() {
        for angle in [0.0f64, 60.0, 89.9, 89.999, 90.0 - 5.7e-6, 90.0, 90.0 + 5.7e-6, 90.001, 120.0] {
            let (sin, cos) = angle.to_radians().sin_cos();
            let cos = if angle == 90.0 { 0.0 } else { cos };
            let turn = random.unit() * std::f32::consts::TAU;
            let wo = Vec3::new(sin as f32 * turn.cos(), sin as f32 * turn.sin(), cos as f32);
            for lobe in ends {
                for (u, v) in ends.iter().flat_map(|u| ends.map(|v| (*u, v))) {
                    let sample = bsdf.sample(wo, lobe, Vec2::new(u, v));
                    let fine = sample.is_none_or(|s| {
                        let (f, pdf) = bsdf.eval_pdf(wo, s.wi);
                        let numbers = s.weight.is_finite() && s.weight.min_element() >= 0.0;
                        let pdfs = s.pdf.is_finite() && s.pdf > 0.0 && pdf.is_finite() && pdf >= 0.0;
                        numbers && pdfs && f.is_finite() && f.min_element() >= 0.0 && s.wi.is_normalized()
                    });
                    tried += 1;
                    if !fine {
                        bad += 1;
                        if first.is_empty() {
                            first = format!("{name}, wo {wo}, u {lobe} {u} {v}: {sample:?}");
                        }
                    }
                }
            }
        }
    }
    sheet.holds(format!("all bsdfs are finite ({tried})"), bad == 0, || format!("{bad} are not: {first}"));
    Ok(())
}

fn long_paths(sheet: &mut Sheet) -> Result<()> {
    let body = format!(
        r#"<shape type="cube"><boolean name="flip_normals" value="true"/>{}{}</shape>"#,
        twosided(0.999),
        glow(1.0)
    );
    let still = |samples| Still::new(&*body, [0.1, 0.2, 0.3], [1.0, 0.4, -0.2]).samples(samples);
    // The lengths of paths are spread as widely as their mean is long.
    let roulette = still(64).view(0.01, 2);
    sheet.shop.offer("roulette", &roulette, 1000.0)?;
    let means = sheet.shop.means(&roulette)?.values;
    sheet.mean("roulette", 1000.0, &means, if sheet.full() { 0.05 } else { 0.2 });
    let depth = 10_000;
    let sum = (1.0 - 0.999f64.powi(depth)) / 0.001;
    let deep = still(1).view(0.01, 1).integrator(path_unended(i64::from(depth)));
    let name = format!("{depth} bounces without roulette");
    sheet.shop.offer(&name, &deep, sum)?;
    let means = sheet.shop.means(&deep)?.values;
    sheet.mean(name, sum, &means, 0.02);
    Ok(())
}

/// Irradiance over the whole floor from a point at height h is I times the solid
/// angle of the floor: 4 atan(a² / (h √(2a² + h²))) for half-size a.
fn floor_flux(h: f64) -> f64 {
    4.0 * (1.0 / (h * (2.0 + h * h).sqrt())).atan()
}

fn close(sheet: &mut Sheet) -> Result<()> {
    let above = ortho([0.0, 1.0, 0.0], [0.0; 3], 1.0);
    let light = |height: f64| {
        let point = format!(
            r#"<emitter type="point"><point name="position" x="0.013" y="{height:e}" z="0.007"/>
            <rgb name="intensity" value="1"/></emitter>"#
        );
        Still::new(format!("{FLOOR}{point}"), [0.0; 3], [0.0; 3]).integrator(path(2)).seen_by(&above)
    };
    // Off the centre by less than shows.
    let expected = 0.5 / PI * floor_flux(0.3) / 4.0;
    let centred = light(0.3);
    let centred = Still {
        body: centred.body.replace("x=\"0.013\"", "x=\"0\"").replace("z=\"0.007\"", "z=\"0\""),
        ..centred
    };
    sheet.radiance("a point at 0.3 over a whole floor", expected, &centred.samples(1024))?;
    for height in [1e-6, 1e-20, 0.0] {
        let still = light(height);
        let means = sheet.shop.means(&still)?;
        let worst = means.values.iter().copied().fold(0.0, f64::max);
        let fine = means.dropped.is_none() && worst.is_finite();
        sheet
            .holds(format!("a point at {height:e}: finite"), fine, || format!("{worst} {:?}", means.dropped));
    }
    hole(sheet)
}

/// A lamp that fills the sky behind a board with a square hole: what arrives is
/// the form factor of the hole.
fn hole(sheet: &mut Sheet) -> Result<()> {
    for (half, enough) in [(0.25f64, 0.01), (0.05, 0.05)] {
        let mut body = String::from(FLOOR);
        for (x, z, sx, sz) in
            [(1.0, 0.0, 1.0, 4.0), (-1.0, 0.0, 1.0, 4.0), (0.0, 1.0, 4.0, 1.0), (0.0, -1.0, 4.0, 1.0)]
        {
            let (reach_x, reach_z): (f64, f64) = (sx * 20.0, sz * 20.0);
            let at = |side: f64, reach: f64| side * (half + reach);
            body += &format!(
                r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>
                <scale x="{reach_x}" z="{reach_z}"/><translate x="{:e}" y="1" z="{:e}"/></transform>{}</shape>"#,
                at(x, reach_x),
                at(z, reach_z),
                diffuse(0.0)
            );
        }
        body += &format!(
            r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="3"/>
            <translate y="2"/></transform>{}</shape>"#,
            glow(1.0)
        );
        let (p, r) = (half.hypot(1.0), (half / half.hypot(1.0)).atan());
        let factor = 4.0 / PI * half / p * r;
        let still = seen(body).samples(4096);
        sheet.radiance_to(format!("a lamp behind a hole of {half}"), 0.5 * factor, enough, &still)?;
    }
    Ok(())
}
