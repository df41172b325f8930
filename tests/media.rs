//! Media that absorb, and surfaces that light passes straight through: closed
//! forms, integrators against each other, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/gltf_file.rs"]
mod gltf_file;
#[path = "common/render.rs"]
mod render;

use std::path::Path;

use etendue::desc::{Category, Value};
use etendue::load::{LoadOptions, load_str};
use etendue::scene::{BuildOptions, Scene};
use gltf_file::{Gltf, all, param, rgb as rgb_of};
use render::{Ready, rgb};
use serde_json::json;

/// A keyhole of 2 × 2 pixels from z = 4 along −z; `inside` stands in the sensor.
fn xml(integrator: &str, inside: &str, body: &str) -> String {
    format!(
        r#"<scene version="3.0.0"><integrator type="{integrator}"/>
        <sensor type="perspective"><float name="fov" value="0.0002"/><float name="near_clip" value="1e-6"/>{inside}
        <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/>
        <rfilter type="box"/></film></sensor>{body}</scene>"#
    )
}

fn absorbing(name: &str, sigma: [f64; 3]) -> String {
    let [r, g, b] = sigma;
    format!(
        r#"<medium name="{name}" type="homogeneous"><rgb name="sigma_t" value="{r:e},{g:e},{b:e}"/>
        <float name="albedo" value="0"/></medium>"#
    )
}

const LAMP: &str = r#"<shape type="rectangle"><transform name="to_world"><translate z="-2"/></transform>
    <emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>"#;

/// Every pixel of a picture is `expected` to a part in 10⁵, whatever the seed:
/// there is no noise in it.
fn is_exactly(scene: &str, expected: [f64; 3]) {
    let ready = Ready::from_xml(scene, None, None);
    for seed in 0..3 {
        let values = rgb(&ready.picture(4, seed));
        for (value, expected) in values.iter().zip(expected.iter().cycle()) {
            let value = f64::from(*value);
            assert!((value - expected).abs() <= 1e-5 * expected, "{value} for {expected} in\n{scene}");
        }
    }
}

#[test]
fn slabs_leave_what_their_thickness_says() {
    let sigma = [0.01, 0.5, 10.0f64];
    let left = sigma.map(|s| 3.0 * (-2.0 * s).exp());
    for (integrator, bsdf) in [
        ("volpath", r#"<bsdf type="null"/>"#),
        ("whitted", r#"<bsdf type="null"/>"#),
        // An index of 1 is a smooth pane that reflects nothing.
        (
            "volpath",
            r#"<bsdf type="dielectric"><float name="int_ior" value="1"/><float name="ext_ior" value="1"/></bsdf>"#,
        ),
        (
            "whitted",
            r#"<bsdf type="dielectric"><float name="int_ior" value="1"/><float name="ext_ior" value="1"/></bsdf>"#,
        ),
    ] {
        let slab = format!(r#"<shape type="cube">{bsdf}{}</shape>"#, absorbing("interior", sigma));
        is_exactly(&xml(integrator, "", &format!("{LAMP}{slab}")), left);
        // The same as an instance.
        let group = format!(
            r#"<shape type="shapegroup" id="g">{slab}</shape><shape type="instance"><ref id="g"/></shape>"#
        );
        is_exactly(&xml(integrator, "", &format!("{LAMP}{group}")), left);
    }
}

#[test]
fn the_sensor_stands_in_a_medium() {
    let sigma = [0.1, 0.2, 0.3f64];
    let inside = absorbing("medium", sigma);
    // The way to the lamp is 6.
    for integrator in ["volpath", "whitted"] {
        is_exactly(&xml(integrator, &inside, LAMP), sigma.map(|s| 3.0 * (-6.0 * s).exp()));
    }
    // As in Mitsuba; the file and a warning say so.
    for integrator in ["path", "direct"] {
        let scene = xml(integrator, &inside, LAMP);
        is_exactly(&scene, [3.0; 3]);
        let ready = Ready::from_xml(&scene, None, None);
        assert_eq!(ready.integrator.leaves_out(&ready.scene), Some("media are left out"));
        let ledger = ready.integrator.bias_ledger(&ready.scene);
        assert!(
            ledger.contains(if integrator == "path" { "media" } else { "direct light only" }),
            "{ledger}"
        );
    }
    let shared = format!(
        r#"<medium id="air" type="homogeneous"><float name="sigma_t" value="0.25"/><float name="scale" value="2"/>
        <float name="albedo" value="0"/></medium>
        <shape type="cube"><bsdf type="null"/><ref name="exterior" id="air"/></shape>{LAMP}"#
    );
    // Nothing absorbs inside of the cube, which is 2 long.
    let expected = [3.0 * (-0.5f64 * 4.0).exp(); 3];
    is_exactly(&xml("volpath", r#"<ref name="medium" id="air"/>"#, &shared), expected);
    // Light from infinity does not arrive.
    let sky = r#"<emitter type="constant"/>"#;
    for integrator in ["volpath", "whitted"] {
        is_exactly(&xml(integrator, &inside, sky), [0.0; 3]);
    }
}

/// A floor seen from above, 4 away, and a lamp of a kind above the camera's
/// line of sight; `between` is in the way to it.
fn floor(integrator: &str, light: &str, between: &str) -> String {
    let floor = r#"<shape type="rectangle"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"#;
    xml(integrator, "", &format!("{floor}{light}{between}"))
}

const SCREEN: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="45"/>
    <translate x="1" z="1"/></transform><bsdf type="mask"><float name="opacity" value="0.25"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></bsdf></shape>"#;
const POINT: &str = r#"<emitter type="point"><point name="position" x="2" y="0" z="2"/></emitter>"#;

#[test]
fn light_comes_through_what_is_not_there() {
    let far = 8.0f64;
    let open = 0.5 / std::f64::consts::PI / far * 0.5f64.sqrt();
    is_exactly(&floor("volpath", POINT, ""), [open; 3]);
    is_exactly(&floor("volpath", POINT, SCREEN), [0.75 * open; 3]);
    // Two of them, and a tinted ball of radius 0.3 about the middle of the way.
    let more = SCREEN.replace(r#"x="1" z="1""#, r#"x="1.2" z="1.2""#);
    let ball = format!(
        r#"<shape type="sphere"><point name="center" x="0.6" y="0" z="0.6"/><float name="radius" value="0.3"/>
        <bsdf type="null"/>{}</shape>"#,
        absorbing("interior", [0.5, 1.0, 2.0])
    );
    let left = [0.5f64, 1.0, 2.0].map(|s| 0.75f64.powi(2) * open * (-0.6 * s).exp());
    is_exactly(&floor("volpath", POINT, &format!("{SCREEN}{more}{ball}")), left);
    // To `path`, as to Mitsuba's, all of these are in the way.
    is_exactly(&floor("path", POINT, SCREEN), [0.0; 3]);
    // What is there is in the way of both.
    let wall = SCREEN.replace("0.25", "1");
    is_exactly(&floor("volpath", POINT, &wall), [0.0; 3]);
}

/// Both ways to deal with what is not there find the same light where there is
/// an area to hit, over many screens and lights, and also where no path is longer
/// than from the floor to the light: 4.5 standard errors of each.
#[test]
fn shadow_rays_and_scattered_rays_agree() {
    let lamp = r#"<shape type="sphere"><point name="center" x="2" y="0" z="2"/><float name="radius" value="0.9"/>
        <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>"#;
    let sky = r#"<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>"#;
    let clear = r#"<shape type="cube"><transform name="to_world"><scale value="0.3"/><translate x="0.4" z="0.5"/>
        </transform><bsdf type="null"/></shape>"#;
    for (light, between) in [
        (lamp, SCREEN.to_owned()),
        (lamp, format!("{SCREEN}{clear}")),
        (sky, SCREEN.to_owned()),
        (sky, format!("{SCREEN}{clear}")),
    ] {
        let estimate = |integrator: &str, depth: i32| -> (f64, f64) {
            let depth = format!(r#"{integrator}"><integer name="max_depth" value="{depth}"/></integrator>"#);
            let scene = floor(integrator, light, &between).replace(&format!(r#"{integrator}"/>"#), &depth);
            let ready = Ready::from_xml(&scene, None, None);
            let means: Vec<f64> = (0..16).map(|seed| render::mean(&ready.picture(8192, seed))).collect();
            let mean = means.iter().sum::<f64>() / 16.0;
            let squares: f64 = means.iter().map(|m| (m - mean).powi(2)).sum();
            (mean, squares / 15.0 / 16.0)
        };
        let blocked = estimate("path", -1);
        for depth in [-1, 2] {
            let through = estimate("volpath", depth);
            let error = (through.1 + blocked.1).sqrt();
            assert!(error < 5e-3 * blocked.0, "too noisy to tell: {error} of {}", blocked.0);
            assert!((through.0 - blocked.0).abs() < 4.5 * error, "{through:?} {blocked:?} {light} {between}");
        }
    }
}

/// What of a glTF body of unit thickness is between the camera and a white sky.
fn body(extensions: &serde_json::Value) -> Gltf {
    let mut file = Gltf::default();
    let material = json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0}, "extensions": extensions});
    let material = file.push("materials", material);
    let mut square = file.square();
    square["material"] = json!(material);
    let mesh = file.mesh(square);
    // Front at z = 0, back at z = -1, both facing outwards.
    file.node(json!({"mesh": mesh, "translation": [-0.5, -0.5, 0]}));
    file.node(json!({"mesh": mesh, "rotation": [0, 1, 0, 0], "translation": [0.5, -0.5, -1]}));
    let camera =
        file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.001, "znear": 0.01}}));
    file.node(json!({"camera": camera, "translation": [0, 0, 4]}));
    file
}

#[test]
fn a_gltf_body_takes_its_colour_by_distance() {
    let extensions = |color: [f64; 3], distance: f64| {
        json!({
            "KHR_materials_ior": {"ior": 1}, "KHR_materials_specular": {"specularFactor": 0},
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume":
                {"thicknessFactor": 0.1, "attenuationDistance": distance, "attenuationColor": color},
        })
    };
    for (color, distance) in [([0.5, 0.9, 0.0], 1.0), ([0.1, 0.2, 0.8], 0.25), ([0.9, 0.5, 1.0], 8.0)] {
        let desc = body(&extensions(color, distance)).load().unwrap();
        let sizes = BuildOptions { size: Some([2, 2]), ..BuildOptions::default() };
        let scene = Scene::build(&desc, &sizes).unwrap();
        let ready = Ready { scene, ..Ready::build(&desc, None, None) };
        let expected = color.map(|c| c.powf(1.0 / distance));
        for (value, expected) in rgb(&ready.picture(8, 1)).iter().zip(expected.iter().cycle()) {
            assert!((f64::from(*value) - expected).abs() < 1e-5, "{value} for {expected}");
        }
    }
    // Without a distance, a thickness or a way in, nothing absorbs.
    let mut thin = extensions([0.5; 3], 1.0);
    thin["KHR_materials_volume"]["thicknessFactor"] = json!(0);
    let mut opaque = extensions([0.5; 3], 1.0);
    opaque["KHR_materials_transmission"] = json!({"transmissionFactor": 0});
    let mut endless = extensions([0.5; 3], 1.0);
    endless["KHR_materials_volume"] = json!({"thicknessFactor": 1, "attenuationColor": [0.5, 0.5, 0.5]});
    for extensions in [thin, opaque, endless, extensions([1.0; 3], 1.0)] {
        assert!(all(&body(&extensions).load().unwrap(), Category::Medium, "homogeneous").is_empty());
    }
    let desc = body(&extensions([0.5; 3], 2.0)).load().unwrap();
    let [medium] = all(&desc, Category::Medium, "homogeneous")[..] else { panic!("one medium") };
    assert_eq!(rgb_of(medium, "sigma_t"), [2f64.ln() / 2.0; 3]);
    let shapes = all(&desc, Category::Shape, "mesh");
    assert!(shapes.iter().all(|shape| matches!(param(shape, "interior"), Some(Value::Object(_)))));
}

#[test]
fn what_is_refused() {
    let fails = |body: &str| {
        let text = format!("<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\n{body}</scene>");
        let desc = load_str(&text, Path::new("."), &LoadOptions::default()).unwrap();
        Scene::build(&desc, &BuildOptions::default()).unwrap_err().to_string()
    };
    let medium = |inside: &str| fails(&format!("<medium type=\"homogeneous\">{inside}</medium>"));
    for (message, expected) in [
        (medium(""), "2:1: participating media that scatter are not supported"),
        (medium("<float name=\"albedo\" value=\"0.5\"/>"), "2:28: participating media that scatter"),
        (
            medium("<float name=\"albedo\" value=\"0\"/><float name=\"sigma_t\" value=\"-1\"/>"),
            "`sigma_t` times `scale` must be finite and not negative",
        ),
        (medium("<float name=\"albedo\" value=\"0\"/><float name=\"sigma_s\" value=\"1\"/>"), "`sigma_s`"),
        (fails("<medium type=\"heterogeneous\"/>"), "2:1: medium `heterogeneous` is not supported"),
        (
            fails(&format!("<shape type=\"sphere\">{}</shape>", absorbing("inside", [1.0; 3]))),
            "`interior` or `exterior`, found `inside`",
        ),
    ] {
        assert!(message.contains(expected), "{message}\nfor {expected}");
        assert!(!expected.contains("scatter") || message.contains("`albedo` of 0"), "{message}");
    }
}
