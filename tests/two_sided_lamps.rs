//! Lamps that shine from both sides: closed forms on either side, and the same
//! picture by sampling the lamp, by sampling the bsdf and by both.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/render.rs"]
mod render;

use std::f64::consts::PI;

use etendue::scene::LightSelection;
use render::{Ready, mean};

const SEEDS: u64 = 8;

/// Mean and standard error over independent seeds.
fn measured(ready: &Ready, samples: u64) -> (f64, f64) {
    let means: Vec<f64> = (0..SEEDS).map(|seed| mean(&ready.picture(samples, seed))).collect();
    let n = means.len() as f64;
    let m = means.iter().sum::<f64>() / n;
    (m, (means.iter().map(|x| (x - m).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt())
}

/// A narrow camera.
fn sensor(from: &str, to: &str) -> String {
    format!(
        r#"<sensor type="perspective"><float name="fov" value="0.01"/><float name="near_clip" value="1e-7"/>
        <float name="shutter_close" value="1"/><transform name="to_world"><lookat origin="{from}" target="{to}" up="0,0,1"/></transform>
        <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
        <rfilter type="box"/></film></sensor>"#
    )
}

fn direct(light: u32, bsdf: u32) -> String {
    format!(
        r#"<integrator type="direct"><integer name="emitter_samples" value="{light}"/>
        <integer name="bsdf_samples" value="{bsdf}"/></integrator>"#
    )
}

/// Floor and ceiling of reflectance ½ one unit away from y = 0.
const RECEIVERS: &str = r#"
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"#;
const BLACK: &str = r#"<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>"#;
const BOTH: &str = r#"<emitter type="area"><boolean name="two_sided" value="true"/></emitter>"#;

/// A lamp of radiance 1 in the plane y = 0, and the irradiance that it gives the
/// origins of both receivers: 2 × 2, or a disk of radius 1.
fn lamps() -> Vec<(&'static str, String, f64)> {
    let flat = r#"<transform name="to_world"><rotate x="1" angle="90"/></transform>"#;
    let square = 1.740_839_503;
    // Four tiles of 2 and 0, of which each gives the middle a quarter.
    let tiles = r#"<emitter type="area"><boolean name="two_sided" value="true"/>
        <texture type="checkerboard" name="radiance"><rgb name="color0" value="2"/><rgb name="color1" value="0"/>
        </texture></emitter>"#;
    let obj = r#"<string name="filename" value="light.obj"/>
        <transform name="to_world"><translate y="-1"/></transform>"#;
    vec![
        ("rectangle", format!(r#"<shape type="rectangle">{flat}{BLACK}{BOTH}</shape>"#), square),
        ("rectangle, textured", format!(r#"<shape type="rectangle">{flat}{BLACK}{tiles}</shape>"#), square),
        ("disk", format!(r#"<shape type="disk">{flat}{BLACK}{BOTH}</shape>"#), PI / 2.0),
        ("two triangles", format!(r#"<shape type="obj">{obj}{BLACK}{BOTH}</shape>"#), square),
        (
            "in an instance",
            format!(
                r#"<shape type="shapegroup" id="g"><shape type="rectangle">{BLACK}{BOTH}</shape></shape>
                <shape type="instance"><ref id="g"/>{flat}</shape>"#
            ),
            square,
        ),
        (
            "turning in its own plane, textured",
            format!(
                r#"<shape type="rectangle"><animation name="to_world">
                <transform time="0"><rotate x="1" angle="90"/></transform>
                <transform time="1"><rotate x="1" angle="90"/><rotate y="1" angle="50"/></transform>
                </animation>{BLACK}{tiles}</shape>"#
            ),
            square,
        ),
    ]
}

/// Both receivers have L = ρ·E/π, whichever way light is looked for.
#[test]
fn both_receivers_of_a_two_sided_lamp() {
    let mut checked = 0;
    for (name, lamp, expected) in lamps() {
        for (side, y) in [("floor", -1.0), ("ceiling", 1.0)] {
            for (way, light, bsdf) in [("lamp", 1, 0), ("bsdf", 0, 1), ("both", 1, 1)] {
                let eye = sensor(&format!("0.9,{},0", 0.3 * y), &format!("0,{y},0"));
                let xml = format!(
                    r#"<scene version="3.0.0">{}{eye}{RECEIVERS}{lamp}</scene>"#,
                    direct(light, bsdf)
                );
                let (m, se) = measured(&Ready::from_xml(&xml, None, None), 4096);
                let expected = 0.5 * expected / PI;
                let what = format!("{name}, {side}, by {way}: {m} ± {se}, expected {expected}");
                assert!(se < 3e-3 * expected, "inconclusive: {what}");
                assert!((m - expected).abs() < 4.0 * se + 1e-5 * expected, "{what}");
                checked += 1;
            }
        }
    }
    assert_eq!(checked, 6 * 2 * 3);
}

/// A glowing sphere that lets half of the light through, all of which leaves
/// twice: once at the front and, seen through that, at the back. Seen from the
/// floor below, at distance 2 with radius 1, E = 1.5·π·sin²30°.
#[test]
fn the_far_side_of_a_clear_sphere() {
    let floor = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"#;
    let mask = r#"<bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="diffuse">
        <rgb name="reflectance" value="0"/></bsdf></bsdf>"#;
    for weight in [0.0, 1.0] {
        let lamp = format!(
            r#"<shape type="sphere"><point name="center" value="0,2,0"/>{mask}<emitter type="area">
            <boolean name="two_sided" value="true"/><float name="sampling_weight" value="{weight}"/></emitter></shape>"#
        );
        let integrator = r#"<integrator type="volpath"/>"#;
        let eye = sensor("0.9,0.3,0", "0,0,0");
        let xml = format!(r#"<scene version="3.0.0">{integrator}{eye}{floor}{lamp}</scene>"#);
        let (m, se) = measured(&Ready::from_xml(&xml, None, None), 4096);
        let expected = 0.5 * 1.5 * 0.25;
        let what = format!("sampling weight {weight}: {m} ± {se}, expected {expected}");
        assert!(se < 3e-3 * expected, "inconclusive: {what}");
        assert!((m - expected).abs() < 4.0 * se + 1e-5 * expected, "{what}");
    }
}

/// Many lamps of all shapes, some on both sides, before and behind a diffuse
/// ball: by the light tree, by power and by scattered rays alone.
#[test]
fn many_lamps_by_any_choice() {
    let room = |weight: f64| {
        let mut body = String::from(
            r#"<shape type="sphere"><float name="radius" value="0.5"/><bsdf type="diffuse"/></shape>"#,
        );
        for k in 0..12 {
            let (sin, cos) = (f64::from(k) * PI / 6.0).sin_cos();
            let at = format!("{},{},{}", 2.0 * cos, f64::from(k % 3) - 1.0, 2.0 * sin);
            let target = format!("{},{},{}", 0.9 * sin, 2.0 * cos, 0.4 * f64::from(k % 4) - 0.5);
            let shape = ["rectangle", "disk", "sphere", "obj"][k as usize % 4];
            let file = if shape == "obj" { r#"<string name="filename" value="lamp.obj"/>"# } else { "" };
            let both = k % 5 != 0;
            body += &format!(
                r#"<shape type="{shape}">{file}<transform name="to_world"><scale value="0.5"/>
                <lookat origin="{at}" target="{target}" up="0.3,1,0.2"/></transform>{BLACK}<emitter type="area">
                <boolean name="two_sided" value="{both}"/><float name="sampling_weight" value="{weight}"/>
                </emitter></shape>"#
            );
        }
        let eye = r#"<sensor type="perspective"><float name="fov" value="12"/><transform name="to_world">
            <lookat origin="0.1,0.5,-5" target="0,0,0" up="0,1,0"/></transform><film type="hdrfilm">
            <integer name="width" value="8"/><integer name="height" value="8"/><rfilter type="box"/></film></sensor>"#;
        let integrator = r#"<integrator type="path"><integer name="max_depth" value="2"/></integrator>"#;
        Ready::from_xml(&format!(r#"<scene version="3.0.0">{integrator}{eye}{body}</scene>"#), None, None)
    };
    let tree = room(1.0);
    assert!(tree.scene.selection.is_fine());
    let mut power = room(1.0);
    let powers: Vec<f64> = power.scene.lights.iter().map(|l| l.power(5.0)).collect();
    power.scene.selection = LightSelection::by_power(&powers, &vec![1.0; powers.len()]);
    let (by_tree, by_power, by_rays) =
        (measured(&tree, 1024), measured(&power, 4096), measured(&room(0.0), 16384));
    for other in [by_power, by_rays] {
        let z = (by_tree.0 - other.0) / by_tree.1.hypot(other.1);
        assert!(other.1 < 3e-3 * other.0 && z.abs() < 4.0, "{by_tree:?} {other:?}");
    }
}

/// π·A·L on each side.
#[test]
fn power_is_that_of_both_sides() {
    for (name, lamp, _) in lamps() {
        let scene = |lamp: &str| {
            Ready::from_xml(
                &format!(r#"<scene version="3.0.0">{}{lamp}</scene>"#, sensor("0,5,0", "0,0,0")),
                None,
                None,
            )
            .scene
        };
        let power = |lamp: &str| scene(lamp).lights.iter().map(|l| l.power(1.0)).sum::<f64>();
        let front = lamp.replace(r#"<boolean name="two_sided" value="true"/>"#, "");
        let area = if name == "disk" { PI } else { 4.0 };
        assert!((power(&lamp) / (2.0 * PI * area) - 1.0).abs() < 1e-3, "{name}: {}", power(&lamp));
        assert!((power(&front) / (PI * area) - 1.0).abs() < 1e-3, "{name}: {}", power(&front));
    }
    let beam = r#"<shape type="rectangle"><emitter type="directionalarea">
        <boolean name="two_sided" value="true"/></emitter></shape>"#;
    let xml = format!(r#"<scene version="3.0.0">{}{beam}</scene>"#, sensor("0,5,0", "0,0,0"));
    let desc =
        etendue::load::load_str(&xml, std::path::Path::new("."), &etendue::load::LoadOptions::default());
    let error = etendue::scene::Scene::build(&desc.unwrap(), &etendue::scene::BuildOptions::default());
    let error = error.unwrap_err().to_string();
    assert!(error.contains("emitter `directionalarea` takes no parameter `two_sided`"), "{error}");
}
