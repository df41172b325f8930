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

/// What the colour of a thin film is compared with: Airy's sum over all orders,
/// wavelength by wavelength, seen by the observer of the CIE.
mod airy {
    use etendue::color::matching_rgb;
    use std::f64::consts::{PI, TAU};

    /// ∫ȳ dλ in nm.
    const Y_INTEGRAL: f64 = 106.856_895;
    const STEPS: usize = 2350;

    /// ∫ f(λ)·(the curves as linear RGB) dλ over ∫ȳ dλ.
    fn observed(f: impl Fn(f64) -> f64) -> [f64; 3] {
        let width = 470.0 / STEPS as f64;
        let mut sum = [0.0; 3];
        for k in 0..STEPS {
            let wavelength = 360.0 + (k as f64 + 0.5) * width;
            let value = f(wavelength) * width / Y_INTEGRAL;
            matching_rgb(wavelength).iter().zip(&mut sum).for_each(|(m, s)| *s += m * value);
        }
        sum
    }

    /// A film between vacuum and a base: (index, nanometres, index of the base).
    pub type Stack = (f64, f64, f64);

    /// How the two interfaces reflect.
    #[derive(Clone, Copy)]
    pub enum Interfaces {
        /// By Schlick's approximation, as the extension prescribes.
        Schlick,
        /// By Fresnel's equations, for light polarised across the plane and in it.
        Fresnel,
    }

    /// Amplitudes of both interfaces, for both polarisations, and the cosine in the film.
    fn amplitudes((film, _, base): Stack, cos: f64, by: Interfaces) -> ([[f64; 2]; 2], f64) {
        let inside = |n: f64| (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
        let (in_film, in_base) = (inside(film), inside(base));
        let pairs = match by {
            Interfaces::Schlick => {
                let schlick = |a: f64, b: f64, cos: f64| {
                    let f0 = ((a - b) / (a + b)).powi(2);
                    (a - b).signum() * (f0 + (1.0 - f0) * (1.0 - cos).powi(5)).sqrt()
                };
                [[schlick(1.0, film, cos), schlick(film, base, in_film)]; 2]
            }
            Interfaces::Fresnel => {
                let across = |a: f64, ca: f64, b: f64, cb: f64| (a * ca - b * cb) / (a * ca + b * cb);
                let within = |a: f64, ca: f64, b: f64, cb: f64| (a * cb - b * ca) / (a * cb + b * ca);
                [
                    [across(1.0, cos, film, in_film), across(film, in_film, base, in_base)],
                    [within(1.0, cos, film, in_film), within(film, in_film, base, in_base)],
                ]
            }
        };
        (pairs, in_film)
    }

    /// Linear RGB of the film under white light, seen at a cosine. As in the
    /// extension, white is (1, 1, 1) for what does not depend on the wavelength.
    pub fn colour(stack: Stack, cos: f64, by: Interfaces) -> [f64; 3] {
        let (pairs, in_film) = amplitudes(stack, cos, by);
        let path = 2.0 * stack.0 * stack.1 * in_film;
        let mut all = [0.0; 3];
        for [r1, r2] in pairs {
            let constant = constant(r1, r2);
            // |(r₁ + r₂e^{iφ}) / (1 + r₁r₂e^{iφ})|²
            let at = |wavelength: f64| {
                let c = (TAU * path / wavelength).cos();
                let top = r1 * r1 + r2 * r2 + 2.0 * r1 * r2 * c;
                top / (1.0 + (r1 * r2).powi(2) + 2.0 * r1 * r2 * c)
            };
            let seen = observed(|w| at(w) - constant);
            all.iter_mut().zip(seen).for_each(|(a, s)| *a += 0.5 * (constant + s));
        }
        all.map(|c| c.clamp(0.0, 1.0))
    }

    /// The mean over the phase: R₁ + T²R₂ / (1 − R₁R₂).
    fn constant(r1: f64, r2: f64) -> f64 {
        let (a, b) = (r1 * r1, r2 * r2);
        a + (1.0 - a).powi(2) * b / (1.0 - a * b)
    }

    /// What Belcour and Barla's four Gaussians are off from the observer, at most
    /// over all path differences, and the most that the observer sees of a cosine;
    /// by channel.
    pub fn observer_error() -> ([f64; 3], [f64; 3]) {
        let line = |v: f64, p: f64, variance: f64, phase: f64| {
            let norm = v * (TAU * variance).sqrt() / (Y_INTEGRAL * 1e-9);
            norm * (p * phase).cos() * (-variance * phase * phase).exp()
        };
        let (mut worst, mut most) = ([0.0f64; 3], [0.0f64; 3]);
        for path in (0..1500).map(|k| 10.0 * f64::from(k)) {
            let phase = TAU * path * 1e-9;
            let x = line(5.4856e-13, 1.6810e6, 4.3278e9, phase) + line(9.7470e-14, 2.2399e6, 4.5282e9, phase);
            let y = line(4.4201e-13, 1.7953e6, 9.3046e9, phase);
            let z = line(5.2481e-13, 2.2084e6, 6.6121e9, phase);
            // IEC 61966-2-1.
            let fitted = [
                3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
                -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
                0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
            ];
            let seen = observed(|w| (2.0 * PI * path / w).cos());
            for c in 0..3 {
                worst[c] = worst[c].max((fitted[c] - seen[c]).abs());
                most[c] = most[c].max(seen[c].abs());
            }
        }
        (worst, most)
    }

    /// What the model may be off by: two orders through the Gaussians, each
    /// weighed by its amplitude, and all higher orders, which it leaves out.
    pub fn bound(stack: Stack, cos: f64, (worst, most): &([f64; 3], [f64; 3])) -> [f64; 3] {
        let ([[r1, r2], _], _) = amplitudes(stack, cos, Interfaces::Schlick);
        let r = (r1 * r2).abs();
        let through = 1.0 - r1 * r1;
        let order = 2.0 * (through.powi(2) * r2 * r2 / (1.0 - r * r) - through).abs();
        [0, 1, 2].map(|c| order * ((r + r * r) * worst[c] + r.powi(3) / (1.0 - r) * most[c]))
    }
}

/// Films of few wavelengths: against Airy's sum on the interfaces that the
/// extension prescribes, within what its two orders and its Gaussians cost.
#[test]
fn iridescence_of_thin_films() {
    use airy::{Interfaces, bound, colour, observer_error};
    use etendue::bsdf::Film;
    use etendue::math::Rgb;

    let errors = observer_error();
    println!("Gaussians off by {:.4?} at most, of {:.4?}", errors.0, errors.1);
    let (mut count, mut used, mut off_fresnel) = (0, 0.0f64, [0.0f64; 3]);
    for base in [1.1, 1.5, 2.42, 4.0f64] {
        for film in [1.2, 1.33, 1.8, 2.4f64] {
            let (mut low, mut high, mut widest) = ([1.0f64; 3], [0.0f64; 3], 0.0f64);
            for thickness in (1..=30).map(|k| 25.0 * f64::from(k)) {
                for (place, cos) in [1.0, 0.8, 0.5, 0.25].into_iter().enumerate() {
                    let stack = (film, thickness, base);
                    let f0 = ((base - 1.0) / (base + 1.0)).powi(2);
                    let thin = Film { ior: film as f32, thickness: thickness as f32 };
                    let found = thin.reflectance(cos as f32, Rgb::splat(f0 as f32)).to_array();
                    let expected = colour(stack, cos, Interfaces::Schlick);
                    let allowed = bound(stack, cos, &errors);
                    let fresnel = colour(stack, cos, Interfaces::Fresnel);
                    for c in 0..3 {
                        let off = (f64::from(found[c]) - expected[c]).abs();
                        // f32: phases of a few turns, sums of a few terms.
                        assert!(
                            off <= allowed[c] + 2e-5,
                            "{stack:?} at {cos}: {found:.4?}, not {expected:.4?} within {allowed:.4?}"
                        );
                        used = used.max(off / (allowed[c] + 2e-5));
                        if place == 0 {
                            (low[c], high[c]) = (low[c].min(expected[c]), high[c].max(expected[c]));
                            widest = widest.max(allowed[c]);
                        }
                        if place < 3 {
                            off_fresnel[place] =
                                off_fresnel[place].max((f64::from(found[c]) - fresnel[c]).abs());
                        }
                        count += 1;
                    }
                }
            }
            let range = [0, 1, 2].map(|c| high[c] - low[c]).into_iter().fold(f64::MAX, f64::min);
            println!("film {film} on {base}: range {range:.4}, allowed {widest:.4}");
            assert!(widest < 0.5 * range, "the bound says nothing: {widest} of {range}");
        }
    }
    println!(
        "at most {used:.3} of what is allowed; from Fresnel's interfaces {off_fresnel:.4?} at cosines 1, 0.8, 0.5"
    );
    assert_eq!(count, 4 * 4 * 30 * 4 * 3);
}

/// The same from the file on, head on.
#[test]
fn iridescence_from_the_file() {
    use airy::{Interfaces, bound, colour, observer_error};
    let errors = observer_error();
    for (film, thickness) in [(1.33, 150.0), (1.33, 400.0), (1.8, 250.0), (2.2, 120.0), (2.2, 600.0)] {
        let extensions = json!({"KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": film,
            "iridescenceThicknessMinimum": 0, "iridescenceThicknessMaximum": thickness}});
        let found = seen(black(0.0, extensions));
        let stack = (film, thickness, 1.5);
        let (expected, allowed) = (colour(stack, 1.0, Interfaces::Schlick), bound(stack, 1.0, &errors));
        println!("{thickness} nm of {film}: {found:.4?}, expected {expected:.4?} within {allowed:.4?}");
        for c in 0..3 {
            assert!(
                (found[c] - expected[c]).abs() <= allowed[c] + 1e-4,
                "{stack:?}: {found:?}, {expected:?}"
            );
        }
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
