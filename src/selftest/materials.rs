//! B1 to B8: furnaces. What loses no light is as bright as its surroundings,
//! and nothing is brighter.

use super::Row;
use super::meshes::sphere;
use super::rays::Random;
use super::sheet::Sheet;
use super::stage::{Still, glow, ortho, rgb, sky};
use crate::bsdf::Bsdf;
use crate::desc::Result;
use crate::math::Vec3;

pub(super) const ROWS: &[Row] = &[
    Row { id: "B1", what: "lossless surfaces in a white furnace; none gains", run: furnace },
    Row { id: "B2", what: "glass of index 1 is not there, bit for bit", run: matched },
    Row { id: "B3", what: "nested shells of glass, to touching", run: shells },
    Row { id: "B5", what: "a coarse sphere with smooth normals in a furnace", run: coarse },
    Row { id: "B7", what: "light goes both ways alike", run: reciprocity },
    Row { id: "B8", what: "masks, null surfaces, panes and blends", run: see_through },
];

/// A sphere of radius 1 in white surroundings, hit at `angle_deg` from its
/// normal.
fn ball(bsdf: &str, angle_deg: f64) -> Still {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let body = format!(r#"<shape type="sphere">{bsdf}</shape>{}"#, sky(1.0));
    Still::new(body, [sin, 0.0, 4.0], [sin, 0.0, cos])
}

/// Losses that may be, and gains.
const LEAST: f64 = 1.0 - 2e-3;
const MOST: f64 = 1.0 + 5e-4;

fn furnace(sheet: &mut Sheet) -> Result<()> {
    let white = r#"<rgb name="reflectance" value="1"/>"#;
    sheet.radiance("diffuse", 1.0, &ball(&format!(r#"<bsdf type="diffuse">{white}</bsdf>"#), 0.0))?;
    for eta in [1.0, 1.0 + 1e-7, 1.0001, 1.5, 10.0, 1e3] {
        let glass = format!(
            r#"<bsdf type="dielectric"><float name="int_ior" value="{eta}"/><float name="ext_ior" value="1"/></bsdf>"#
        );
        sheet.radiance(format!("dielectric, n = {eta}"), 1.0, &ball(&glass, 30.0))?;
    }
    // Several lobes that give light back to each other: made for it.
    for (kind, rest) in [
        ("metal", ""),
        ("glass", r#"<float name="metallic" value="0"/><float name="transmission" value="1"/>"#),
    ] {
        for alpha in [1e-8f64, 1e-4, 1e-2, 0.1, 0.3, 0.5, 1.0] {
            let bsdf = format!(
                r#"<bsdf type="gltf"><float name="roughness" value="{:e}"/>{rest}</bsdf>"#,
                alpha.sqrt()
            );
            for angle in if sheet.full() { vec![0.0, 45.0, 75.0, 89.0] } else { vec![0.0, 75.0] } {
                let still = ball(&bsdf, angle).samples(4096).unshared();
                let name = format!("gltf {kind}, alpha {alpha:e}, {angle} degrees");
                sheet.radiance_between(name, (LEAST, 1.0, MOST), &still)?;
            }
        }
    }
    losing(sheet)
}

/// Albedo at the normal of a lossless metal with one bounce off GGX facets: the
/// mean of the facets' masking, tan² θ = α² s / (1 − s) with s uniform.
fn one_bounce(alpha: f64) -> f64 {
    let steps = 100_000;
    let lit = |i: i32| {
        let s = (f64::from(i) + 0.5) / f64::from(steps);
        let angle = 2.0 * (alpha * (s / (1.0 - s)).sqrt()).atan();
        if angle < std::f64::consts::FRAC_PI_2 { 2.0 / (1.0 + (alpha * angle.tan()).hypot(1.0)) } else { 0.0 }
    };
    (0..steps).map(lit).sum::<f64>() / f64::from(steps)
}

/// Kinds with one bounce off a rough surface lose what bounces twice, by
/// definition: the metal's albedo is known, and none gains.
fn losing(sheet: &mut Sheet) -> Result<()> {
    for alpha in [0.1, 0.3, 0.5, 1.0] {
        let metal = format!(
            r#"<bsdf type="roughconductor"><string name="material" value="none"/>
            <string name="distribution" value="ggx"/><float name="alpha" value="{alpha}"/></bsdf>"#
        );
        let name = format!("roughconductor, alpha {alpha}: one bounce");
        sheet.radiance(name, one_bounce(alpha), &ball(&metal, 0.0).samples(1024))?;
        let glass = format!(
            r#"<bsdf type="roughdielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>
            <string name="distribution" value="ggx"/><float name="alpha" value="{alpha}"/></bsdf>"#
        );
        let still = ball(&glass, 0.0).samples(1024).unshared();
        sheet.radiance_between(
            format!("roughdielectric, alpha {alpha}: no gain"),
            (0.0, 1.0, MOST),
            &still,
        )?;
    }
    let plastic = r#"<bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="1"/>
        <boolean name="nonlinear" value="true"/><float name="alpha" value="0.1"/></bsdf>"#;
    let still = ball(plastic, 0.0).samples(1024).unshared();
    sheet.radiance_between("roughplastic, alpha 0.1: no gain", (0.0, 1.0, MOST), &still)
}

fn matched(sheet: &mut Sheet) -> Result<()> {
    let file = sheet.shop.image("room", [32, 16], &|i| [1.0 + (i % 7) as f32, (i % 5) as f32, 0.25])?;
    let scene = |shape: &str| {
        let body =
            format!(r#"{shape}<emitter type="envmap"><string name="filename" value="{file}"/></emitter>"#);
        Still::new(body, [0.3, 0.2, 5.0], [0.0; 3]).view(60.0, 16)
    };
    let empty = rgb(&sheet.shop.picture(&scene(""), 16)?);
    for bsdf in [
        r#"<bsdf type="dielectric"><float name="int_ior" value="1.3"/><float name="ext_ior" value="1.3"/></bsdf>"#,
        r#"<bsdf type="thindielectric"><float name="int_ior" value="1.3"/><float name="ext_ior" value="1.3"/></bsdf>"#,
        r#"<bsdf type="roughdielectric"><float name="int_ior" value="1.3"/><float name="ext_ior" value="1.3"/>
        <float name="alpha" value="0.3"/></bsdf>"#,
        r#"<bsdf type="null"/>"#,
    ] {
        let ball = format!(r#"<shape type="sphere">{bsdf}</shape>"#);
        let picture = rgb(&sheet.shop.picture(&scene(&ball), 16)?);
        let different = picture.iter().zip(&empty).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        let kind = bsdf.split('"').nth(1).unwrap_or_default();
        sheet.none(format!("values changed by {kind}"), different as u64, empty.len() as u64);
    }
    Ok(())
}

fn shells(sheet: &mut Sheet) -> Result<()> {
    let shell = |radius: f64, inside: f64, outside: f64| {
        format!(
            r#"<shape type="sphere"><float name="radius" value="{radius:.9}"/><bsdf type="dielectric">
            <float name="int_ior" value="{inside}"/><float name="ext_ior" value="{outside}"/></bsdf></shape>"#
        )
    };
    // Coordinates are up to 5 here, of which an ulp is 4.8e-7 at most.
    for gap in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, -1e-3, 0.0] {
        let body = format!("{}{}{}", shell(1.0, 1.5, 1.0), shell(1.0 - gap, 1.33, 1.5), sky(1.0));
        let still = Still::new(body, [0.0, 0.3, 4.0], [0.2, 0.1, 0.0]).view(20.0, 4);
        let means = sheet.shop.means(&still)?;
        let name = format!("water in glass, gap {gap:e}");
        sheet.shop.offer(&name, &still, 1.0)?;
        if gap == 0.0 {
            // Of two surfaces at the same place one is met (D8), and no order of
            // them is right: only that nothing breaks.
            let mean = means.values[0];
            sheet.holds(name, mean.is_finite() && mean <= MOST, || mean.to_string());
        } else {
            sheet.within(name, 1.0, means.values[0], 1e-5);
            if (0.0..5e-6).contains(&gap) {
                sheet.known(
                    "two units in the last place of the coordinates: rays begin beyond the inner shell",
                );
            }
        }
    }
    Ok(())
}

fn coarse(sheet: &mut Sheet) -> Result<()> {
    for rings in [4u32, 8, 16] {
        let file =
            sheet.shop.mesh(&format!("coarse{rings}"), &sphere(rings, 2 * rings, 1.0, Vec3::ZERO, true))?;
        let body = format!(
            r#"<shape type="ply"><string name="filename" value="{file}"/><bsdf type="diffuse">
            <rgb name="reflectance" value="1"/></bsdf></shape>{}"#,
            sky(1.0)
        );
        let view = ortho([0.0, 0.5, 4.0], [0.0; 3], 0.4);
        let still = Still::new(body, [0.0; 3], [0.0; 3]).view(0.0, 4).seen_by(&view).samples(256);
        sheet.radiance_between(format!("{rings} rings"), (0.99, 1.0, MOST), &still)?;
    }
    Ok(())
}

fn reciprocity(sheet: &mut Sheet) -> Result<()> {
    // Radiance is counted per solid angle, which glass changes by n².
    let mut random = Random(7);
    let count = sheet.count(20_000);
    for (kind, chosen) in [("diffuse", "diffuse white"), ("roughconductor", ""), ("roughdielectric", "")] {
        let examples: Vec<_> = Bsdf::examples()
            .into_iter()
            .filter(|(name, _)| name.starts_with(kind) && name.contains(chosen))
            .collect();
        let (mut worst, mut tried) = (0.0f64, 0u64);
        for i in 0..count {
            let (_, bsdf) = &examples[i as usize % examples.len()];
            let eta = if let Bsdf::RoughDielectric(b) = bsdf { b.eta } else { 1.0 };
            let mut direction = || {
                let z = 1e-6 + random.unit().powi(4) * 0.999;
                let (sin, cos) = (random.unit() * std::f32::consts::TAU).sin_cos();
                let side = if bsdf.is_one_sided() || random.unit() < 0.5 { 1.0 } else { -1.0 };
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * cos, r * sin, side * z).normalize()
            };
            let (wo, wi) = (direction(), direction());
            let scale = match (wo.z > 0.0, wi.z > 0.0) {
                (true, false) => eta * eta,
                (false, true) => 1.0 / (eta * eta),
                _ => 1.0,
            };
            let there = f64::from(bsdf.eval(wo, wi).x / wi.z.abs() * scale);
            let back = f64::from(bsdf.eval(wi, wo).x / wo.z.abs());
            if there > 1e-6 || back > 1e-6 {
                // What a slanted direction leaves of digits, and 1 - F of what is
                // all but reflected.
                let digits = 5e-6 / f64::from(wo.z.abs().min(wi.z.abs()));
                let off = (there - back).abs() / (there.max(back) + 1e-2) / (1.0 + digits / 1e-3);
                worst = worst.max(off);
                tried += 1;
            }
        }
        sheet.within(format!("{kind}, worst of {tried} pairs"), 0.0, worst, 1e-3);
    }
    Ok(())
}

fn see_through(sheet: &mut Sheet) -> Result<()> {
    let light = format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>{}</shape>"#,
        glow(1.0)
    );
    let black = r#"<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>"#;
    let mask = |opacity: f64| {
        format!(r#"<bsdf type="mask"><float name="opacity" value="{opacity}"/>{black}</bsdf>"#)
    };
    let blend = |weight: f64| {
        format!(
            r#"<bsdf type="blendbsdf"><float name="weight" value="{weight}"/><bsdf type="null"/>{black}</bsdf>"#
        )
    };
    let cases = [
        ("mask of 0.5".to_owned(), mask(0.5), 0.5),
        ("mask of 0.25".to_owned(), mask(0.25), 0.75),
        ("mask of 0".to_owned(), mask(0.0), 1.0),
        ("mask of 1".to_owned(), mask(1.0), 0.0),
        ("null".to_owned(), r#"<bsdf type="null"/>"#.to_owned(), 1.0),
        ("blend of 0.25 black and null".to_owned(), blend(0.25), 0.75),
    ];
    for (name, bsdf, expected) in cases {
        let body = format!(r#"{light}<shape type="rectangle">{bsdf}</shape>"#);
        sheet.radiance(name, expected, &Still::new(body, [0.0, 0.0, 2.0], [0.0; 3]).samples(1024))?;
    }
    Ok(())
}
