//! Scenes whose radiance is known in closed form, over integrators; every
//! accelerator gives the same picture bit for bit. Numbers A*, B* are rows of
//! the catalogue that `tests/robust.rs` runs whole, with more cases.
//!
//! Every check is two-sided with its own standard error from independent
//! seeds: |mean − expected| ≤ 4·se + 1e-5·expected (a false alarm in 16,000
//! checks), and fails as inconclusive when se is above 0.3 % of the value, so
//! that noise cannot pass. Seeds are fixed.

#[path = "common/render.rs"]
mod render;

use etendue::accel::Accel;
use etendue::film::Picture;
use render::{Ready, mean};

const SEEDS: u64 = 8;

/// Whose pictures must be those of the default: with Embree only Embree, since
/// without it all others have had their turn.
fn accelerators() -> &'static [&'static str] {
    if cfg!(feature = "embree") { &["embree"] } else { Accel::NAMES }
}

struct Case {
    name: &'static str,
    /// Everything but the sensor.
    body: String,
    /// Camera: origin, target; the film is 4 × 4 pixels of a narrow view.
    camera: ([f64; 3], [f64; 3]),
    expected: f64,
    integrators: &'static [&'static str],
    samples: u64,
}

fn sensor((from, to): ([f64; 3], [f64; 3])) -> String {
    let up = if (from[0] - to[0]).abs() + (from[2] - to[2]).abs() < 1e-9 { "0,0,1" } else { "0,1,0" };
    format!(
        r#"<sensor type="perspective"><float name="fov" value="0.01"/><float name="near_clip" value="1e-7"/>
        <float name="far_clip" value="1e8"/>
        <transform name="to_world"><lookat origin="{},{},{}" target="{},{},{}" up="{up}"/></transform>
        <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
        <rfilter type="box"/></film></sensor>"#,
        from[0], from[1], from[2], to[0], to[1], to[2]
    )
}

/// Mean and standard error of independent values.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let m = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - m).powi(2)).sum::<f64>() / (n - 1.0);
    (m, (variance / n).sqrt())
}

fn bits(picture: &Picture) -> Vec<u32> {
    render::rgb(picture).iter().map(|value| value.to_bits()).collect()
}

fn check(case: &Case) {
    let xml = format!(r#"<scene version="3.0.0">{}{}</scene>"#, sensor(case.camera), case.body);
    for integrator in case.integrators {
        let ready = |accel| Ready::from_xml(&xml, Some(integrator), accel);
        let default = ready(None);
        let first = default.picture(case.samples, 0);
        // Without Embree the mean has had its turn, as others have.
        if !cfg!(feature = "embree") {
            let rest = (1..SEEDS).map(|seed| mean(&default.picture(case.samples, seed)));
            let means: Vec<f64> = std::iter::once(mean(&first)).chain(rest).collect();
            let (m, se) = mean_and_error(&means);
            let what = format!("{} with {integrator}: {m} ± {se}, expected {}", case.name, case.expected);
            assert!(se <= 3e-3 * case.expected.abs().max(1e-9), "inconclusive: {what}");
            assert!((m - case.expected).abs() <= 4.0 * se + 1e-5 * case.expected.abs(), "{what}");
        }
        for &accel in accelerators() {
            let same = bits(&ready(Some(accel)).picture(case.samples, 0)) == bits(&first);
            assert!(same, "{} with {integrator}: {accel} gives another picture", case.name);
        }
    }
}

/// A grey floor of reflectance ½, large, at y = 0, seen from above.
const FLOOR: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
    <scale value="1"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"#;
const ABOVE: ([f64; 3], [f64; 3]) = ([0.3, 0.5, 0.0], [0.0, 0.0, 0.0]);
const ALL_DIRECT: &[&str] = &["path", "direct"];
const PATH: &[&str] = &["path"];

fn grey(radiance: f64) -> String {
    format!(r#"<emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter>"#)
}

#[test]
fn a1_point_light_over_a_floor() {
    for height in [1e-3, 1.0, 1e3] {
        let body = format!(
            r#"{FLOOR}<emitter type="point"><point name="position" value="0,{height},0"/>
            <rgb name="intensity" value="{}"/></emitter>"#,
            height * height
        );
        // The camera looks past the light at the point below it.
        let camera = ([0.3, 0.5, 0.0], [0.0, 0.0, 0.0]);
        let integrators: &[&str] = &["path", "direct", "whitted"];
        // At 1e-3 the footprint of a pixel is no longer a point: widen nothing, look closer.
        let camera = if height < 0.1 { ([2e-4, 3e-4, 0.0], camera.1) } else { camera };
        check(&Case {
            name: "A1",
            body,
            camera,
            expected: 0.5 / std::f64::consts::PI,
            integrators,
            samples: 4,
        });
    }
}

#[test]
fn a2_sphere_light_of_any_angle() {
    for ratio in [0.25, 0.05, 5e-3, 5e-4, 5e-5] {
        let radiance = 1.0 / (ratio * ratio);
        let body = format!(
            r#"{FLOOR}<shape type="sphere"><point name="center" value="0,1,0"/><float name="radius" value="{ratio}"/>{}</shape>"#,
            grey(radiance)
        );
        check(&Case {
            name: "A2",
            body,
            camera: ABOVE,
            expected: 0.5,
            integrators: ALL_DIRECT,
            samples: 1024,
        });
    }
}

#[test]
fn a6_disk_light() {
    for (radius, height) in [(1.0f64, 1.0f64), (1e-3, 1.0), (1.0, 0.25)] {
        let form = radius.powi(2) / (radius.powi(2) + height.powi(2));
        let body = format!(
            r#"{FLOOR}<shape type="disk"><transform name="to_world"><rotate x="1" angle="90"/>
            <scale value="{radius}"/><translate y="{height}"/></transform>{}</shape>"#,
            grey(1.0 / form)
        );
        let camera = ([0.3, 0.1, 0.0], [0.0, 0.0, 0.0]);
        check(&Case { name: "A6", body, camera, expected: 0.5, integrators: ALL_DIRECT, samples: 4096 });
    }
}

#[test]
fn a7_rectangle_light() {
    let body = format!(
        r#"{FLOOR}<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>
        <translate y="1"/></transform>{}</shape>"#,
        grey(1.0)
    );
    let expected = 0.5 * 1.740_839_503 / std::f64::consts::PI;
    check(&Case { name: "A7", body, camera: ABOVE, expected, integrators: ALL_DIRECT, samples: 4096 });
}

#[test]
fn a7_the_same_light_of_two_triangles() {
    let body = format!(
        r#"{FLOOR}<shape type="obj"><string name="filename" value="light.obj"/>{}</shape>"#,
        grey(1.0)
    );
    let expected = 0.5 * 1.740_839_503 / std::f64::consts::PI;
    check(&Case { name: "A7 mesh", body, camera: ABOVE, expected, integrators: ALL_DIRECT, samples: 4096 });
}

#[test]
fn a_flat_light_does_not_light_its_own_back() {
    for shape in ["rectangle", "disk"] {
        let body = format!(
            r#"<shape type="{shape}"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf>{}</shape>"#,
            grey(1.0)
        );
        let camera = ([0.3, 0.2, -2.0], [0.1, 0.1, 0.0]);
        let all: &[&str] = &["path", "direct", "whitted"];
        check(&Case { name: "own back", body, camera, expected: 0.0, integrators: all, samples: 64 });
    }
}

#[test]
fn a11_integrating_sphere() {
    // Direct light everywhere is ρ I / (π r²) = ½; with all bounces 1.
    let body = r#"<shape type="sphere"><float name="radius" value="2"/><boolean name="flip_normals" value="true"/>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></bsdf></shape>
        <emitter type="point"><rgb name="intensity" value="12.566370614359172"/></emitter>"#;
    let camera = ([0.5, 0.0, 0.0], [1.0, 1.0, 1.0]);
    let direct: &[&str] = &["direct", "whitted"];
    check(&Case {
        name: "A11 direct",
        body: body.into(),
        camera,
        expected: 0.5,
        integrators: direct,
        samples: 4,
    });
    check(&Case { name: "A11", body: body.into(), camera, expected: 1.0, integrators: PATH, samples: 2048 });
}

#[test]
fn a15_pane_at_normal_incidence() {
    // T = (1 − R) / (1 + R) with R = 0.04, all internal reflections included.
    let body = format!(
        r#"<shape type="rectangle"><bsdf type="thindielectric"><float name="int_ior" value="1.5"/>
        <float name="ext_ior" value="1"/></bsdf></shape>
        <shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>{}</shape>"#,
        grey(1.0)
    );
    let camera = ([0.0, 0.0, 2.0], [0.0, 0.0, 0.0]);
    let expected = 0.96 / 1.04;
    check(&Case { name: "A15 pane", body, camera, expected, integrators: PATH, samples: 16384 });
    // Whitted follows both branches: no noise at all.
    let body = format!(
        r#"<shape type="cube"><transform name="to_world"><scale x="4" y="4" z="0.1"/></transform><bsdf type="dielectric">
        <float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf></shape>
        <shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>{}</shape>"#,
        grey(1.0)
    );
    check(&Case { name: "A15 slab", body, camera, expected, integrators: &["path"], samples: 16384 });
}

#[test]
fn a20_camera_inside_glass_sees_n_squared() {
    let body = r#"<shape type="sphere"><bsdf type="dielectric"><float name="int_ior" value="1.5"/>
        <float name="ext_ior" value="1"/></bsdf></shape><emitter type="constant"><rgb name="radiance" value="1"/></emitter>"#;
    let camera = ([0.1, 0.05, 0.0], [1.0, 0.3, 0.2]);
    check(&Case { name: "A20", body: body.into(), camera, expected: 2.25, integrators: PATH, samples: 256 });
}

#[test]
fn b1_glass_in_a_white_furnace_is_invisible() {
    for eta in [1.0, 1.0001, 1.5, 10.0] {
        let body = format!(
            r#"<shape type="sphere"><bsdf type="dielectric"><float name="int_ior" value="{eta}"/>
            <float name="ext_ior" value="1"/></bsdf></shape><emitter type="constant"><rgb name="radiance" value="1"/></emitter>"#
        );
        let camera = ([0.0, 0.3, 4.0], [0.4, 0.2, 0.0]);
        check(&Case { name: "B1", body, camera, expected: 1.0, integrators: PATH, samples: 512 });
    }
}

#[test]
fn b8_mask_and_null() {
    let light = format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>{}</shape>"#,
        grey(1.0)
    );
    let camera = ([0.0, 0.0, 2.0], [0.0, 0.0, 0.0]);
    for (opacity, expected) in [(0.5, 0.5), (0.25, 0.75), (0.0, 1.0)] {
        let body = format!(
            r#"<shape type="rectangle"><bsdf type="mask"><float name="opacity" value="{opacity}"/><bsdf type="diffuse">
            <rgb name="reflectance" value="0"/></bsdf></bsdf></shape>{light}"#
        );
        check(&Case { name: "B8 mask", body, camera, expected, integrators: PATH, samples: 16384 });
    }
    let body = format!(r#"<shape type="rectangle"><bsdf type="null"/></shape>{light}"#);
    check(&Case { name: "B8 null", body, camera, expected: 1.0, integrators: PATH, samples: 4 });
}

#[test]
fn directional_light_and_mirror() {
    // E = 1 at 60 degrees from the normal: L = ρ/π · ½.
    let sun = r#"<emitter type="directional"><vector name="direction" value="-1.7320508,-1,0"/>
        <rgb name="irradiance" value="1"/></emitter>"#;
    let all: &[&str] = &["path", "direct", "whitted"];
    let body = format!("{FLOOR}{sun}");
    let expected = 0.25 / std::f64::consts::PI;
    check(&Case { name: "directional", body, camera: ABOVE, expected, integrators: all, samples: 4 });
    // A mirror of eight tenths shows a light of radiance 2.
    let body = format!(
        r#"<shape type="rectangle"><bsdf type="conductor"><string name="material" value="none"/>
        <rgb name="specular_reflectance" value="0.8"/></bsdf></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate y="1" angle="180"/>
        <translate z="5"/></transform>{}</shape>"#,
        grey(2.0)
    );
    let camera = ([0.2, 0.1, 2.0], [0.0, 0.0, 0.0]);
    check(&Case { name: "mirror", body, camera, expected: 1.6, integrators: all, samples: 4 });
}

#[test]
fn constant_environment_over_a_diffuse_floor() {
    let body = format!(r#"{FLOOR}<emitter type="constant"><rgb name="radiance" value="3"/></emitter>"#);
    check(&Case {
        name: "sky",
        body,
        camera: ABOVE,
        expected: 1.5,
        integrators: &["path", "direct", "whitted"],
        samples: 1024,
    });
}

#[test]
fn depth_and_ambient_occlusion() {
    let body = FLOOR.to_owned();
    let camera = ([0.0, 0.5, 0.0], [0.0, 0.0, 0.0]);
    check(&Case {
        name: "depth",
        body: body.clone(),
        camera,
        expected: 0.5 - 1e-7,
        integrators: &["depth"],
        samples: 1,
    });
    check(&Case { name: "open floor", body, camera, expected: 1.0, integrators: &["ao"], samples: 16 });
    // Under a disk of radius r at height r half of the cosine-weighted sky is gone.
    let body = format!(
        r#"{FLOOR}<shape type="disk"><transform name="to_world"><scale value="0.7"/><rotate x="1" angle="90"/><translate y="0.7"/></transform></shape>"#
    );
    let camera = ([0.3, 0.2, 0.0], [0.0, 0.0, 0.0]);
    check(&Case { name: "disk", body, camera, expected: 0.5, integrators: &["ao"], samples: 4096 });
}

/// A light that shines along its normal: a beam with sharp sides, of the same
/// irradiance at any distance.
#[test]
fn a_directional_area_makes_a_beam() {
    let scene = |shift: f64| {
        let body = format!(
            r#"<scene version="3.0.0">
            <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="-90"/>
              </transform></shape>
            <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>
              <translate x="{shift}" y="7"/></transform>
              <emitter type="directionalarea"><rgb name="radiance" value="2"/></emitter></shape>
            {}</scene>"#,
            sensor(([0.0, 3.0, -4.0], [0.0, 0.0, 0.0]))
        );
        mean(&Ready::from_xml(&body, Some("path"), None).picture(16, 1))
    };
    // ρ E / π = 0.5 · 2 / π inside, nothing beside it.
    let inside = scene(0.9);
    assert!((inside - 1.0 / std::f64::consts::PI).abs() < 1e-6, "{inside}");
    assert_eq!(scene(1.1), 0.0);
}

/// Numbers of a mesh's vertices and faces as reflectances under a white sky:
/// what is seen is the number itself, linear over a triangle.
#[test]
fn attributes_of_meshes_are_textures() {
    let folder = tempfile::tempdir().expect("a folder");
    let vertices = "-1 -1 0 0.1 0.2 0.3 0\n1 -1 0 0.5 0.4 0.3 1\n1 1 0 0.9 0.6 0.3 1\n-1 1 0 0.5 0.4 0.3 0\n";
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         property float color_0\nproperty float color_1\nproperty float color_2\nproperty float weight_0\n\
         element face 2\nproperty list uchar int vertex_indices\nproperty float shade_0\nend_header\n\
         {vertices}3 0 1 2 0.25\n3 0 2 3 0.75\n"
    );
    std::fs::write(folder.path().join("plate.ply"), ply).expect("a file");
    let picture = |texture: &str| {
        let scene = format!(
            r#"<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/>
            <sensor type="orthographic">
              <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
              <film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/>
                <rfilter type="box"/></film></sensor>
            <shape type="ply"><string name="filename" value="plate.ply"/>
              <bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">{texture}</texture></bsdf>
            </shape></scene>"#
        );
        let desc = etendue::load::load_str(&scene, folder.path(), &Default::default())
            .unwrap_or_else(|e| panic!("{e}"));
        render::rgb(&Ready::build(&desc, None, None).picture(1024, 1))
    };
    // Upper left, upper right, lower left, lower right pixel.
    let colour = picture(r#"<string name="name" value="vertex_color"/>"#);
    for (pixel, [r, g]) in [[0.5, 0.4], [0.7, 0.5], [0.3, 0.3], [0.5, 0.4]].into_iter().enumerate() {
        let [found_r, found_g, found_b] = [0, 1, 2].map(|k| colour[3 * pixel + k]);
        let off = (found_r - r).abs().max((found_g - g).abs()).max((found_b - 0.3).abs());
        assert!(off < 2e-3, "pixel {pixel}: {found_r} {found_g} {found_b}");
    }
    let weight = picture(r#"<string name="name" value="vertex_weight"/><float name="scale" value="0.5"/>"#);
    assert!((weight[0] - 0.125).abs() < 2e-3 && (weight[3] - 0.375).abs() < 2e-3, "{weight:?}");
    let shade = picture(r#"<string name="name" value="face_shade"/>"#);
    assert!((shade[9] - 0.25).abs() < 1e-3 && (shade[0] - 0.75).abs() < 1e-3, "{shade:?}");
}

/// `moment` and `aov` hold another integrator and ask for more layers.
#[test]
fn moments_and_layers_of_a_file() {
    let xml = r#"<scene version="3.0.0">
        <integrator type="moment"><integrator type="aov"><string name="aovs" value="z:depth, nn:sh_normal"/>
          <integrator type="path"/></integrator></integrator>
        <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="4"/>
          <integer name="height" value="4"/></film></sensor>
        <emitter type="constant"><rgb name="radiance" value="0.7, 0.2, 3"/></emitter></scene>"#;
    let load = || etendue::load::load_str(xml, render::package("").as_path(), &Default::default());
    let desc = load().unwrap_or_else(|e| panic!("{e}"));
    let (layers, renamed) =
        etendue::integrator::Integrator::layers_from_desc(&desc).unwrap_or_else(|e| panic!("{e}"));
    let expected = [
        "the layer `z` of type `depth` is written as `Z`",
        "the layer `nn` of type `sh_normal` is written as `N`",
    ];
    assert_eq!(renamed, expected);
    assert!(layers.moment && layers.depth && layers.normal && !layers.albedo && !layers.position);
    let ready = Ready::build(&desc, None, None);
    assert_eq!(ready.integrator.name(), "path");
    let mut o = render::options(16, 1);
    o.layers = o.layers.or(layers);
    let picture = ready.render(&o).film.resolve();
    for (name, expected) in [("m2.R", 0.49), ("m2.G", 0.04), ("m2.B", 9.0)] {
        let values = picture.channel(name).expect("a layer");
        assert!(values.iter().all(|v| (v / expected - 1.0).abs() < 1e-6), "{name} {values:?}");
    }
}

/// A path between perfect mirrors, with no limit, is let go at last; light that
/// it could find is found all the same.
#[test]
fn paths_that_cannot_end_do() {
    let ball = r#"<shape type="sphere"><float name="radius" value="2"/><boolean name="flip_normals" value="true"/>
        <bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>"#;
    let camera = ([0.0, 0.0, 1.0], [0.1, 0.2, 0.0]);
    let xml = |body: &str| format!(r#"<scene version="3.0.0">{}{body}</scene>"#, sensor(camera));
    for integrator in ["path", "volpath"] {
        let dark = Ready::from_xml(&xml(ball), Some(integrator), None);
        assert_eq!(mean(&dark.picture(16, 1)), 0.0);
        let lamp = r#"<shape type="sphere"><point name="center" x="0" y="0" z="-1"/><float name="radius" value="0.4"/>
            <bsdf type="conductor"><string name="material" value="none"/></bsdf>
            <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>"#;
        let lit = Ready::from_xml(&xml(&format!("{ball}{lamp}")), Some(integrator), None);
        assert!(mean(&lit.picture(16, 1)) > 0.5);
    }
}
