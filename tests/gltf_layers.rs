//! Extensions of glTF materials against closed forms, from the file to the
//! radiance: a square seen head on in white surroundings of radiance 1, which
//! are on both of its sides.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]
#![allow(clippy::print_stdout, reason = "says what it measured")]

#[path = "common/gltf_file.rs"]
mod gltf_file;
#[path = "common/render.rs"]
mod render;

use etendue::scene::{BuildOptions, Scene};
use gltf_file::Gltf;
use render::{Ready, rgb};
use serde_json::{Value as Json, json};

/// Mean radiance of the square under white surroundings.
fn seen(material: Json) -> [f64; 3] {
    let mut file = Gltf::with_material(material);
    let camera =
        file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.01, "znear": 0.01}}));
    file.node(json!({"camera": camera, "translation": [0.5, 0.5, 4]}));
    let desc = file.load().unwrap();
    let build = BuildOptions { size: Some([4, 4]), ..BuildOptions::default() };
    let scene = Scene::build(&desc, &build).unwrap_or_else(|e| panic!("{e}"));
    let integrator = etendue::integrator::Integrator::from_desc(&desc, &Default::default()).unwrap();
    let picture = rgb(&Ready { scene, integrator }.picture(4096, 1));
    [0, 1, 2].map(|c| picture.iter().skip(c).step_by(3).map(|v| f64::from(*v)).sum::<f64>() / 16.0)
}

fn check(name: &str, material: Json, expected: [f64; 3], allowed: f64) {
    let found = seen(material);
    println!("{name}: {found:.5?}, expected {expected:.5?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= allowed * b.max(0.02), "{name}: {found:?}, not {expected:?}");
    }
}

/// A dielectric with nothing below what it reflects.
fn black(roughness: f64, extensions: Json) -> Json {
    json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0,
        "roughnessFactor": roughness}, "doubleSided": true, "extensions": extensions})
}

fn matte(base: [f64; 3], mut extensions: Json) -> Json {
    extensions["KHR_materials_specular"] = json!({"specularFactor": 0});
    let [r, g, b] = base;
    json!({"pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1], "metallicFactor": 0},
        "doubleSided": true, "extensions": extensions})
}

/// ((n − 1) / (n + 1))² at normal incidence, times strength and colour.
#[test]
fn index_and_specular() {
    for ior in [1.0, 1.33, 1.5, 1.8, 2.4f64] {
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
        check(&format!("ior {ior}"), black(0.0, json!({"KHR_materials_ior": {"ior": ior}})), [f0; 3], 0.02);
    }
    let extensions = json!({"KHR_materials_specular":
        {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 0]}});
    check("specular", black(0.0, extensions), [0.02, 0.01, 0.0], 0.03);
    check("no specular", matte([0.8, 0.4, 0.2], json!({})), [0.8, 0.4, 0.2], 0.005);
}

/// A thin wall reflects F and lets (1 − F) times its colour through.
#[test]
fn transmission_of_a_sheet() {
    let sheet = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 1, 1], "metallicFactor": 0,
        "roughnessFactor": 0}, "doubleSided": true,
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}});
    check("sheet", sheet, [0.25, 0.5, 1.0].map(|c| 0.04 + 0.96 * c), 0.01);
}

/// The coat's 0.04 times its strength.
#[test]
fn clearcoat_over_black() {
    for strength in [0.25, 0.5, 1.0] {
        let mut material = matte([0.0; 3], json!({"KHR_materials_clearcoat": {"clearcoatFactor": strength}}));
        material["pbrMetallicRoughness"]["roughnessFactor"] = json!(1);
        check(&format!("coat {strength}"), material, [0.04 * strength; 3], 0.03);
    }
}

/// What loses nothing is not seen in white surroundings.
#[test]
fn white_layers_lose_nothing() {
    let white = |metallic: f64, roughness: f64, extensions: Json| {
        json!({"pbrMetallicRoughness": {"metallicFactor": metallic, "roughnessFactor": roughness},
            "doubleSided": true, "extensions": extensions})
    };
    let coat = json!({"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.3}});
    let anisotropy = json!({"KHR_materials_anisotropy": {"anisotropyStrength": 0.8}});
    for (name, material) in [
        ("coat", white(0.0, 0.5, coat)),
        ("anisotropic metal", white(1.0, 0.5, anisotropy.clone())),
        ("anisotropic dielectric", white(0.0, 0.5, anisotropy)),
    ] {
        check(name, material, [1.0; 3], 0.01);
    }
}

/// What the extension's formula for sheen returns to a viewer straight above:
/// ∫ D·V·cos θ dω, the half angle being θ/2.
fn sheen_albedo(roughness: f64) -> f64 {
    let alpha = roughness * roughness;
    let mix = |a: f64, b: f64| a + (b - a) * (1.0 - alpha).powi(2);
    let [a, b, c] = [mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)];
    let [d, e] = [mix(-1.97760, -1.27393), mix(-4.32054, -4.85967)];
    let l = |x: f64| a / (1.0 + b * x.powf(c)) + d * x + e;
    let lambda = |cos: f64| if cos < 0.5 { l(cos).exp() } else { (2.0 * l(0.5) - l(1.0 - cos)).exp() };
    let steps = 20_000;
    let width = std::f64::consts::FRAC_PI_2 / f64::from(steps);
    let ring = |k: i32| {
        let theta = (f64::from(k) + 0.5) * width;
        let d = (2.0 + 1.0 / alpha) * (0.5 * theta).sin().powf(1.0 / alpha) / std::f64::consts::TAU;
        let v = 1.0 / ((1.0 + lambda(1.0) + lambda(theta.cos())) * 4.0 * theta.cos());
        d * v * theta.cos() * std::f64::consts::TAU * theta.sin() * width
    };
    (0..steps).map(ring).sum()
}

/// Over black it is that; over white the base is less by what the sheen takes on
/// both ways, and no more comes back than there is.
#[test]
fn sheen_over_black_and_white() {
    for roughness in [0.3, 0.5, 1.0] {
        let sheen = json!({"KHR_materials_sheen":
            {"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": roughness}});
        let albedo = sheen_albedo(roughness);
        check(
            &format!("sheen {roughness}"),
            matte([0.0; 3], sheen.clone()),
            [albedo, 0.5 * albedo, 0.0],
            0.02,
        );
        let [over_white, ..] = seen(matte([1.0; 3], sheen));
        println!("over white: {over_white}");
        assert!(over_white > albedo && over_white < 1.0001, "{over_white}");
    }
}

/// A film many wavelengths thick shows no colours: its two boundaries reflect
/// (R₁ + R₂ − 2R₁R₂) / (1 − R₁R₂), Airy's series summed without its phases.
#[test]
fn iridescence_of_a_thick_film() {
    for film in [1.33, 1.8, 2.2f64] {
        let r1 = ((film - 1.0) / (film + 1.0)).powi(2);
        let r2 = ((1.5 - film) / (1.5 + film)).powi(2);
        let expected = (r1 + r2 - 2.0 * r1 * r2) / (1.0 - r1 * r2);
        let extensions = json!({"KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": film,
            "iridescenceThicknessMinimum": 50000, "iridescenceThicknessMaximum": 50000}});
        check(&format!("film of index {film}"), black(0.0, extensions), [expected; 3], 0.02);
    }
}

/// (1 − t)·base + t·colour where both sides are white.
#[test]
fn diffuse_transmission_of_a_sheet() {
    let extensions = json!({"KHR_materials_diffuse_transmission":
        {"diffuseTransmissionFactor": 0.3, "diffuseTransmissionColorFactor": [1, 0.5, 0.25]}});
    let expected = [0.7 * 0.8 + 0.3, 0.7 * 0.4 + 0.15, 0.7 * 0.2 + 0.075];
    check("leaf", matte([0.8, 0.4, 0.2], extensions), expected, 0.005);
}

/// Emission times its strength, and an unlit colour; nothing is added to either.
#[test]
fn light_of_its_own() {
    let mut material = matte([0.0; 3], json!({"KHR_materials_emissive_strength": {"emissiveStrength": 5}}));
    material["emissiveFactor"] = json!([0.1, 0.2, 0.3]);
    check("emissive", material, [0.5, 1.0, 1.5], 1e-5);
    let unlit = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 1]},
        "extensions": {"KHR_materials_unlit": {}}});
    check("unlit", unlit, [0.25, 0.5, 0.75], 1e-5);
}
