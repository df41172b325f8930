//! Time in scene files: key frames of glTF, shutters, skins and morph targets,
//! and the frames of Mitsuba files.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/gltf_file.rs"]
mod gltf_file;

use std::path::Path;

use etendue::desc::{Category, SceneDesc, Value};
use etendue::load::LoadOptions;
use etendue::math::{DVec3, Motion, Transform, Vec3};
use gltf_file::{Gltf, all, float, mesh_of, only, param, to_world};
use serde_json::json;

fn motion(object: &etendue::desc::Object) -> &Motion {
    match param(object, "to_world") {
        Some(Value::Motion(m)) => m,
        other => panic!("`to_world` is {other:?}"),
    }
}

fn near(a: DVec3, b: [f64; 3]) -> bool {
    a.distance(DVec3::from(b)) < 1e-6
}

/// A node that an animation moves: key frames at 0 s, 1 s and 2 s.
fn animated(path: &str, interpolation: &str, values: &[f32], kind: &str) -> Gltf {
    let mut file = Gltf::default();
    let square = file.square();
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh}));
    let input = file.floats(&[0.0, 1.0, 2.0], "SCALAR");
    let output = file.floats(values, kind);
    file.push(
        "animations",
        json!({"name": "move",
        "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
        "samplers": [{"input": input, "output": output, "interpolation": interpolation}]}),
    );
    file
}

fn at(file: &Gltf, seconds: f64) -> Transform {
    let options = LoadOptions { frame: Some(seconds * 24.0), ..LoadOptions::default() };
    to_world(only(&file.load_with(&options).unwrap(), Category::Shape, "mesh"))
}

#[test]
fn poses_between_key_frames() {
    let steps = [0., 0., 0., 1., 0., 0., 1., 4., 0.];
    let linear = animated("translation", "LINEAR", &steps, "VEC3");
    for (seconds, x, y) in
        [(-1.0, 0.0, 0.0), (0.25, 0.25, 0.0), (1.0, 1.0, 0.0), (1.5, 1.0, 2.0), (9.0, 1.0, 4.0)]
    {
        assert!(near(at(&linear, seconds).point(DVec3::ZERO), [x, y, 0.0]), "{seconds}");
    }
    let step = animated("translation", "STEP", &steps, "VEC3");
    assert!(
        near(at(&step, 0.99).point(DVec3::ZERO), [0.0; 3])
            && near(at(&step, 1.0).point(DVec3::ZERO), [1.0, 0.0, 0.0])
    );
    // In-tangent, value, out-tangent of each key: from 0 to 1 with slope 2 at
    // the start and 0 at the end.
    let mut spline = vec![0.0; 27];
    spline[6] = 2.0; // out-tangent of key 0, x
    spline[12] = 1.0; // value of key 1, x
    spline[21] = 1.0; // value of key 2, x
    let cubic = animated("translation", "CUBICSPLINE", &spline, "VEC3");
    let hermite = |t: f64| (t * t * t - 2.0 * t * t + t) * 2.0 + (-2.0 * t * t * t + 3.0 * t * t);
    for t in [0.0, 0.3, 0.5, 0.8] {
        assert!(near(at(&cubic, t).point(DVec3::ZERO), [hermite(t), 0.0, 0.0]), "{t}");
    }
    // A quarter turn around z, then back the short way to its negative.
    let half = 0.5f32.sqrt();
    let turn =
        animated("rotation", "LINEAR", &[0., 0., 0., 1., 0., 0., half, half, 0., 0., -half, -half], "VEC4");
    let angle = std::f64::consts::FRAC_PI_8;
    assert!(at(&turn, 0.25).point(DVec3::X).distance(DVec3::new(angle.cos(), angle.sin(), 0.0)) < 1e-6);
    assert!(at(&turn, 1.5).point(DVec3::X).distance(DVec3::Y) < 1e-6);
    let scale = animated("scale", "LINEAR", &[1., 1., 1., 3., 1., 1., 3., 1., 1.], "VEC3");
    assert!(near(at(&scale, 0.5).point(DVec3::X), [2.0, 0.0, 0.0]));
    // Without a time asked for the file is shown as stored.
    assert!(param(only(&scale.load().unwrap(), Category::Shape, "mesh"), "to_world").is_none());
    let named = |name: &str| {
        scale.load_with(&LoadOptions {
            animation: Some(name.into()),
            frame: Some(12.0),
            ..LoadOptions::default()
        })
    };
    assert!(near(
        to_world(only(&named("move").unwrap(), Category::Shape, "mesh")).point(DVec3::X),
        [2.0, 0.0, 0.0]
    ));
    assert!(near(
        to_world(only(&named("none").unwrap(), Category::Shape, "mesh")).point(DVec3::X),
        [1.0, 0.0, 0.0]
    ));
    assert!(named("mvoe").unwrap_err().to_string().contains("did you mean `move`?"));
}

#[test]
fn a_shutter_gives_keys() {
    let blurred = |file: &Gltf, shutter: [f64; 2]| {
        file.load_with(&LoadOptions { frame: Some(0.0), shutter: Some(shutter), ..LoadOptions::default() })
            .unwrap()
    };
    // The camera that is made up knows the shutter too.
    let line = animated("translation", "LINEAR", &[0., 0., 0., 1., 0., 0., 1., 4., 0.], "VEC3");
    let scene = blurred(&line, [12.0, 48.0]);
    let sensor = only(&scene, Category::Sensor, "perspective");
    assert_eq!((float(sensor, "shutter_open"), float(sensor, "shutter_close")), (0.5, 2.0));
    // Straight motion needs no more than its ends and the key frame between.
    let scene = blurred(&line, [0.0, 48.0]);
    assert_eq!(motion(only(&scene, Category::Shape, "mesh")).times().collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
    assert_eq!(motion(only(&blurred(&line, [0.0, 12.0]), Category::Shape, "mesh")).times().count(), 2);
    // Nothing moves after the last key.
    assert!(near(
        to_world(only(&blurred(&line, [72.0, 96.0]), Category::Shape, "mesh")).point(DVec3::ZERO),
        [1.0, 4.0, 0.0]
    ));
    // An arm of length 3 on a turning node, whose path is an arc: near the truth
    // at all times.
    let half = 0.5f32.sqrt();
    let mut arm =
        animated("rotation", "LINEAR", &[0., 0., 0., 1., 0., 0., half, half, 0., 0., 1., 0.], "VEC4");
    arm.json["nodes"][0] = json!({"children": [1]});
    arm.push("nodes", json!({"mesh": 0, "translation": [3, 0, 0]}));
    let scene = blurred(&arm, [0.0, 24.0]);
    let motion = motion(only(&scene, Category::Shape, "mesh"));
    assert!((4..=65).contains(&motion.times().count()), "{}", motion.times().count());
    for i in 0..=100 {
        let t = f64::from(i) / 100.0;
        let angle = t * std::f64::consts::FRAC_PI_2;
        let truth = DVec3::new(angle.cos(), angle.sin(), 0.0) * 3.0;
        let off = motion.at(t).point(DVec3::ZERO).distance(truth);
        assert!(off < 3e-4, "{t}: {off}");
    }
    // The camera moves as well, and knows the shutter.
    arm.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}));
    arm.push("nodes", json!({"camera": 0, "translation": [0, 0, 9]}));
    arm.json["nodes"][0]["children"] = json!([1, 2]);
    let scene = blurred(&arm, [6.0, 12.0]);
    let sensor = only(&scene, Category::Sensor, "perspective");
    assert_eq!((float(sensor, "shutter_open"), float(sensor, "shutter_close")), (0.25, 0.5));
    assert!(matches!(param(sensor, "to_world"), Some(Value::Motion(_))));
}

/// Lights of nodes that move get keys; others stand where they are.
#[test]
fn lights_that_move() {
    let half = 0.5f32.sqrt();
    let mut file =
        animated("rotation", "LINEAR", &[0., 0., 0., 1., half, 0., 0., half, half, 0., 0., half], "VEC4");
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights":
        [{"type": "point"}, {"type": "spot"}, {"type": "directional"}]}});
    let light = |k: u32| json!({"KHR_lights_punctual": {"light": k}});
    for k in 0..3 {
        file.push("nodes", json!({"translation": [0, 0, 3], "extensions": light(k)}));
    }
    file.json["nodes"][0] = json!({"mesh": 0, "children": [1, 2, 3]});
    file.node(json!({"extensions": light(0), "translation": [7, 0, 0]}));
    let options = LoadOptions { frame: Some(0.0), shutter: Some([0.0, 24.0]), ..LoadOptions::default() };
    let scene = file.load_with(&options).unwrap();
    assert!(!scene.warnings.iter().any(|w| w.contains("light")), "{:?}", scene.warnings);
    for plugin in ["point", "spot", "directional"] {
        // The still one, of a root, comes first.
        let moving = *all(&scene, Category::Emitter, plugin).last().unwrap();
        let way = motion(moving);
        // A quarter turn around x takes z to −y, and −z, where they shine, to y.
        for time in [0.0, 0.37, 0.5, 1.0f64] {
            let (sin, cos) = (time * std::f64::consts::FRAC_PI_2).sin_cos();
            let off = way.at(time).point(DVec3::ZERO).distance(DVec3::new(0.0, -3.0 * sin, 3.0 * cos));
            assert!(off < 1e-3, "{plugin} {time}: {off}");
            let turned = way.at(time).vector(DVec3::Z).distance(DVec3::new(0.0, sin, -cos));
            assert!(turned < 2e-4, "{plugin} {time}: {turned}");
        }
    }
    let still = all(&scene, Category::Emitter, "point")[0];
    assert!(matches!(param(still, "position"), Some(Value::Vector(p)) if near(*p, [7.0, 0.0, 0.0])));
    let built = etendue::scene::Scene::build(&scene, &etendue::scene::BuildOptions::default()).unwrap();
    assert_eq!(built.plan.moving_lights, 3);
    assert_eq!(built.lights.iter().filter(|l| l.moves()).count(), 3);
}

/// Two targets: the first lifts by 1, the second moves right by 2.
fn morphing() -> Gltf {
    let mut file = Gltf::default();
    let mut square = file.square();
    let lift = file.floats(&[0., 0., 1.].repeat(4), "VEC3");
    let right = file.floats(&[2., 0., 0.].repeat(4), "VEC3");
    let tilt = file.floats(&[1., 0., 0.].repeat(4), "VEC3");
    square["targets"] = json!([{"POSITION": lift, "NORMAL": tilt}, {"POSITION": right}]);
    let mesh = file.mesh(square);
    file.json["meshes"][mesh]["weights"] = json!([1, 0]);
    file.node(json!({"mesh": mesh}));
    file
}

#[test]
fn morph_targets() {
    let mut file = morphing();
    let first = |scene: &SceneDesc| mesh_of(scene, only(scene, Category::Shape, "mesh")).positions[0];
    let scene = file.load().unwrap();
    assert_eq!(first(&scene), Vec3::Z);
    let slant = Vec3::new(1.0, 0.0, 1.0).normalize();
    assert!(mesh_of(&scene, only(&scene, Category::Shape, "mesh")).normals[0].distance(slant) < 1e-6);
    // Weights of the node win over those of the mesh, and an animation over both.
    file.json["nodes"][0]["weights"] = json!([0, 0.5]);
    assert_eq!(first(&file.load().unwrap()), Vec3::X);
    let input = file.floats(&[0.0, 1.0], "SCALAR");
    let output = file.floats(&[0., 0., 0., 1.], "SCALAR");
    file.push(
        "animations",
        json!({"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        "samplers": [{"input": input, "output": output}]}),
    );
    let load = |shutter| {
        file.load_with(&LoadOptions { frame: Some(12.0), shutter, ..LoadOptions::default() }).unwrap()
    };
    assert_eq!(first(&load(None)), Vec3::X);
    let scene = load(Some([0.0, 6.0]));
    let mesh = mesh_of(&scene, only(&scene, Category::Shape, "mesh"));
    let keys: Vec<(f64, f32)> = mesh.deformation.iter().map(|k| (k.time, k.positions[0].x)).collect();
    assert_eq!(keys, [(0.5, 1.0), (0.75, 1.5)]);
    assert_eq!(mesh.positions[0].x, 1.0);
}

/// Four vertices on two joints: the right ones on the second joint, which turns.
#[test]
fn skins() {
    let mut file = Gltf::default();
    let mut square = file.square();
    let joints = file.accessor(&[0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], 5121, "VEC4", 4);
    let weights = file.floats(&[1., 0., 0., 0., 0., 2., 0., 0., 0.5, 0.5, 0., 0., 1., 0., 0., 0.], "VEC4");
    square["attributes"]["JOINTS_0"] = json!(joints);
    square["attributes"]["WEIGHTS_0"] = json!(weights);
    let mesh = file.mesh(square);
    let tip = file.push("nodes", json!({}));
    let root = file.node(json!({"children": [tip]}));
    let inverse =
        file.floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.].repeat(2), "MAT4");
    let skin = file.push("skins", json!({"joints": [root, tip], "inverseBindMatrices": inverse}));
    // The node's own transform does not count.
    file.node(json!({"mesh": mesh, "skin": skin, "translation": [100, 0, 0]}));
    let input = file.floats(&[0.0, 1.0], "SCALAR");
    let half = 0.5f32.sqrt();
    let output = file.floats(&[0., 0., 0., 1., 0., half, 0., half], "VEC4");
    file.push(
        "animations",
        json!({"channels": [{"sampler": 0, "target": {"node": tip, "path": "rotation"}}],
        "samplers": [{"input": input, "output": output}]}),
    );
    let load = |frame: f64, shutter| {
        file.load_with(&LoadOptions { frame: Some(frame), shutter, ..LoadOptions::default() }).unwrap()
    };
    let scene = load(24.0, None);
    let shape = only(&scene, Category::Shape, "mesh");
    let mesh = mesh_of(&scene, shape);
    assert!(param(shape, "to_world").is_none());
    // A quarter turn around y takes x to −z; the third vertex is half way.
    let expected = [Vec3::ZERO, Vec3::NEG_Z, Vec3::new(0.5, 1.0, -0.5), Vec3::Y];
    assert!(mesh.positions.iter().zip(expected).all(|(p, e)| p.distance(e) < 1e-6), "{:?}", mesh.positions);
    assert!(mesh.normals[1].distance(Vec3::X) < 1e-6 && mesh.normals[0].distance(Vec3::Z) < 1e-6);
    assert!(mesh.deformation.is_empty());
    let scene = load(0.0, Some([0.0, 24.0]));
    let mesh = mesh_of(&scene, only(&scene, Category::Shape, "mesh"));
    assert!((9..=65).contains(&mesh.deformation.len()), "{}", mesh.deformation.len());
    for pair in mesh.deformation.windows(2) {
        let middle = 0.5 * (pair[0].time + pair[1].time);
        let angle = middle * std::f64::consts::FRAC_PI_2;
        let truth = Vec3::new(angle.cos() as f32, 0.0, -angle.sin() as f32);
        assert!(pair[0].positions[1].midpoint(pair[1].positions[1]).distance(truth) < 2e-4);
    }
}

/// In a Mitsuba file the frame moves the shutter, and a sensor is chosen by its
/// id or number.
#[test]
fn time_and_camera_of_mitsuba_files() {
    let xml = r#"<scene version="3.0.0">
        <sensor type="perspective" id="near"><float name="shutter_open" value="0.5"/>
            <float name="shutter_close" value="1"/></sensor>
        <sensor type="orthographic" id="far"/></scene>"#;
    let look = |options: LoadOptions| etendue::load::load_str(xml, Path::new("."), &options);
    let shutter = |options: LoadOptions| {
        let scene = look(options).unwrap();
        let sensor = all(&scene, Category::Sensor, "perspective")[0];
        [float(sensor, "shutter_open"), float(sensor, "shutter_close")]
    };
    let default = LoadOptions::default;
    assert_eq!(shutter(default()), [0.5, 1.0]);
    assert_eq!(shutter(LoadOptions { frame: Some(48.0), ..default() }), [2.5, 3.0]);
    let film = LoadOptions { frame: Some(50.0), fps: 25.0, shutter: Some([0.0, 0.5]), ..default() };
    assert_eq!(shutter(film), [2.0, 2.02]);
    for camera in ["far", "1"] {
        let scene = look(LoadOptions { camera: Some(camera.into()), ..default() }).unwrap();
        let root = scene.object(scene.root);
        assert!(
            matches!(root.params[..], [ref p] if matches!(p.value, Value::Object(id) if scene.object(id).id == "far"))
        );
    }
    let says = |options: LoadOptions| look(options).unwrap_err().to_string();
    assert!(
        says(LoadOptions { camera: Some("fra".into()), ..default() })
            .contains("none is `fra`; did you mean `far`?")
    );
    assert!(says(LoadOptions { sun: Some([45.0, 0.0]), ..default() }).starts_with("--sun is for glTF files"));
    assert!(says(LoadOptions { variant: Some("a".into()), ..default() }).contains("is for glTF files"));
    assert!(
        says(LoadOptions { shutter: Some([1.0, 0.0]), ..default() })
            .contains("must open (1) before it closes (0)")
    );
    assert!(says(LoadOptions { fps: 0.0, ..default() }).contains("frames per second must be positive"));
}
