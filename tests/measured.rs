//! Measured materials: that their tables give back what they were made of, and
//! what a scene says of their files.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "common/tensor.rs"]
mod tensor;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use etendue::bsdf::{Bsdf, Distribution, Measured, Microfacet, RoughConductor};
use etendue::color::reflectance_spectrum_to_rgb;
use etendue::desc::{MeasuredData, Value};
use etendue::load::{LoadOptions, load_str, read_measured};
use etendue::math::{Rgb, Vec2, Vec3};
use etendue::sampling::Sampler;
use etendue::scene::{BuildOptions, Scene};
use tensor::{Field, file, floats, small};

fn data_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/features/data")
}

fn committed(name: &str) -> Measured {
    Measured::new(Arc::new(read_measured(&data_folder().join(name)).unwrap())).unwrap()
}

fn direction(theta: f32, phi: f32) -> Vec3 {
    let ((st, ct), (sp, cp)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
    Vec3::new(st * cp, st * sp, ct)
}

fn points(n: u32) -> impl Iterator<Item = Vec2> {
    (0..n).map(|i| Sampler::new(3, (0, 0), u64::from(i)).pixel_and_light().0)
}

/// How far two bsdfs are apart as seen from `wo`: the root of the mean square
/// of the difference over that of the second, and the two albedos.
fn apart(a: &Bsdf, b: &Bsdf, wo: Vec3) -> (f64, Rgb, Rgb) {
    let (mut difference, mut square) = (0.0, 0.0);
    for u in points(1 << 14) {
        // Half by the lobe, half by solid angle.
        let wi = match b.sample(wo, 0.5, Vec2::new(2.0 * u.x % 1.0, u.y)) {
            Some(sample) if u.x < 0.5 => sample.wi,
            _ => {
                let (z, (s, c)) = (u.y.max(1e-4), (2.0 * u.x % 1.0 * std::f32::consts::TAU).sin_cos());
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * c, r * s, z)
            }
        };
        let (value, expected) = (a.eval(wo, wi), b.eval(wo, wi));
        difference += f64::from((value - expected).length_squared());
        square += f64::from(expected.length_squared());
    }
    let albedo = |bsdf: &Bsdf| {
        let weights = points(1 << 14).filter_map(|u| bsdf.sample(wo, 0.5, u)).map(|s| s.weight.as_dvec3());
        (weights.sum::<glam::DVec3>() / f64::from(1 << 14)).as_vec3()
    };
    ((difference / square).sqrt(), albedo(a), albedo(b))
}

/// The metals of `tools/measured_file.py`.
fn metals() -> [(&'static str, RoughConductor); 2] {
    let metal = |alpha: [f32; 2], eta: [f32; 3], k: [f32; 3]| RoughConductor {
        distribution: Microfacet::new(Distribution::Ggx, alpha[0], alpha[1]),
        eta: Rgb::from_array(eta),
        k: Rgb::from_array(k),
        specular_reflectance: Rgb::ONE,
    };
    [
        ("isotropic.bsdf", metal([0.3, 0.3], [0.143, 0.375, 1.44], [3.98, 2.39, 1.60])),
        ("anisotropic.bsdf", metal([0.2, 0.5], [0.200, 0.924, 1.102], [3.912, 2.452, 2.142])),
    ]
}

/// As far as the files' few elevations, azimuths and nodes allow: seen from 45°
/// or less, to 70°, and at 80°, the mean error of values and that of albedos.
/// The last lies between elevations of 73° and 90°, and 55° and 73° are all that
/// the second file has above 33°.
#[test]
fn tables_give_back_the_metal_they_were_made_of() {
    let bounds = [[(0.01, 0.01), (0.035, 0.01), (0.2, 0.02)], [(0.04, 0.015), (0.15, 0.02), (0.3, 0.04)]];
    let mut failures = Vec::new();
    for ((name, metal), bounds) in metals().into_iter().zip(bounds) {
        let (measured, metal) = (committed(name), Bsdf::from(metal));
        let measured = Bsdf::from(&measured);
        for theta in [1.0, 15.0, 30.0, 45.0, 60.0, 70.0, 80.0] {
            for phi in [3.0, 50.0, 100.0, 200.0, 290.0] {
                let (error, found, expected) = apart(&measured, &metal, direction(theta, phi));
                let albedo = f64::from((found / expected - 1.0).abs().max_element());
                let bound = bounds[usize::from(theta > 45.0) + usize::from(theta > 70.0)];
                println!("{name} {theta} {phi}: {error:.4} {albedo:.4}");
                if error > bound.0 || albedo > bound.1 {
                    failures.push(format!("{name} {theta} {phi}: {error} {found} {expected}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// The albedo layer's estimate is near what is scattered.
#[test]
fn albedos_are_tabulated() {
    for (name, _) in metals() {
        let measured = committed(name);
        let bsdf = Bsdf::from(&measured);
        for theta in [0.0, 20.0, 50.0, 75.0] {
            let wo = direction(theta, 250.0);
            let weights = points(1 << 12).filter_map(|u| bsdf.sample(wo, 0.5, u)).map(|s| s.weight);
            let mean = weights.sum::<Rgb>() / (1 << 12) as f32;
            let error = (bsdf.albedo(wo) / mean - 1.0).abs().max_element();
            assert!(error < 0.03, "{name} {theta}: {} {mean}", bsdf.albedo(wo));
        }
        assert_eq!(bsdf.albedo(-Vec3::Z), Rgb::ZERO);
    }
}

/// Half and quarter of the azimuths stand for all, bit for bit.
#[test]
fn azimuths_that_are_left_out_are_mirrored() {
    let examples = Bsdf::examples();
    let find = |name: &str| examples.iter().find(|(n, _)| n == name).unwrap().1;
    let quarter = find("measured brushed copper, a quarter");
    let half = find("measured brushed copper, half");
    let all = find("measured brushed copper, all");
    let flip = |w: Vec3, x: f32, y: f32| Vec3::new(w.x * x, w.y * y, w.z);
    let mut checked = 0;
    for (wo, wi) in points(200)
        .zip(points(400).skip(200))
        .map(|(a, b)| (direction(80.0 * a.x, 360.0 * a.y), direction(80.0 * b.x, 360.0 * b.y)))
    {
        for (x, y) in [(-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
            assert_eq!(quarter.eval_pdf(wo, wi), quarter.eval_pdf(flip(wo, x, y), flip(wi, x, y)));
        }
        assert_eq!(half.eval_pdf(wo, wi), half.eval_pdf(flip(wo, -1.0, -1.0), flip(wi, -1.0, -1.0)));
        checked += usize::from(half.eval(wo, wi) != half.eval(flip(wo, -1.0, 1.0), flip(wi, -1.0, 1.0)));
    }
    assert!(checked > 100, "{checked}");
    // At an azimuth that all three have, nothing is interpolated between others.
    let wo = Vec3::new(-0.5, -0.0, 0.75f32.sqrt());
    for u in points(64) {
        let wi = direction(70.0 * u.x, 360.0 * u.y);
        let (a, b, c) = (quarter.eval(wo, wi), half.eval(wo, wi), all.eval(wo, wi));
        let error = (a - b).abs().max((a - c).abs()).max_element();
        assert!(error <= 2e-3 * a.max_element() + 1e-4, "{wi}: {a} {b} {c}");
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn with(fields: &[Field]) -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        std::fs::write(folder.0.path().join("a.bsdf"), file(fields)).unwrap();
        folder
    }

    fn read(&self) -> MeasuredData {
        read_measured(&self.0.path().join("a.bsdf")).unwrap()
    }
}

fn replaced(fields: &[Field], field: Field) -> Vec<Field> {
    let mut all: Vec<Field> = fields.iter().filter(|f| f.name != field.name).cloned().collect();
    all.push(field);
    all
}

/// Spectra become what they look like under D65.
#[test]
fn spectra_become_colours() {
    let wavelengths = [380.0, 450.0, 520.0, 600.0, 700.0, 780.0];
    let values: Vec<f32> = (0..48).map(|i| 0.5 + 0.01 * (i as f32 * 0.7).sin()).collect();
    let mut fields: Vec<Field> = small().into_iter().filter(|f| f.name != "rgb").collect();
    fields.push(floats("wavelengths", &[6], &wavelengths));
    fields.push(floats("spectra", &[1, 2, 6, 2, 2], &values));
    let data = Folder::with(&fields).read();
    assert_eq!((data.rgb.len(), data.rgb_size), (8, [2, 2]));
    for (node, colour) in data.rgb.iter().enumerate() {
        let (slice, node) = (node / 4, node % 4);
        let value = |k: usize| f64::from(values[slice * 24 + k * 4 + node]);
        let pairs: Vec<_> = wavelengths.iter().enumerate().map(|(k, w)| (f64::from(*w), value(k))).collect();
        let expected = reflectance_spectrum_to_rgb(&pairs);
        assert!((Rgb::from_array(*colour) - expected).abs().max_element() < 1e-6, "{colour:?} {expected}");
    }
    // A file with colours of its own keeps them.
    let rgb = small().into_iter().find(|f| f.name == "rgb").unwrap();
    let both = Folder::with(&replaced(&fields, rgb)).read();
    assert_eq!(both, Folder::with(&small()).read());
}

fn scene(body: &str) -> String {
    format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"sphere\">\n{body}</shape></scene>"
    )
}

const MEASURED: &str = "<bsdf type=\"measured\"><string name=\"filename\" value=\"a.bsdf\"/></bsdf>";

#[test]
fn scenes_share_a_file_and_build() {
    let mut fields = small();
    fields.push(floats("some other field", &[0, 7], &[]));
    let folder = Folder::with(&fields);
    let two = format!("{MEASURED}</shape><shape type=\"disk\"><bsdf type=\"twosided\">{MEASURED}</bsdf>");
    let desc = load_str(&scene(&two), folder.0.path(), &LoadOptions::default()).unwrap();
    assert_eq!((desc.measured.len(), desc.warnings.len()), (1, 0));
    let built = Scene::build(&desc, &BuildOptions::default()).unwrap();
    assert_eq!(built.plan.bsdfs, ["measured", "twosided"]);
    // Its contents decide the picture.
    let other = Folder::with(&replaced(&small(), floats("phi_i", &[1], &[0.5])));
    let changed = load_str(&scene(&two), other.0.path(), &LoadOptions::default()).unwrap();
    assert_ne!(desc.content_hash(), changed.content_hash());
}

#[test]
fn colours_outside_of_srgb_are_told() {
    let mut values = [0.1; 24];
    (values[3], values[20]) = (-0.01, -0.5);
    let folder = Folder::with(&replaced(&small(), floats("rgb", &[1, 2, 3, 2, 2], &values)));
    assert_eq!((folder.read().rgb[3], folder.read().rgb[4]), ([0.0, 0.1, 0.1], [0.1, 0.1, 0.0]));
    let desc = load_str(&scene(MEASURED), folder.0.path(), &LoadOptions::default()).unwrap();
    let said = "a.bsdf: 2 of the 24 values of its colours are negative, outside of sRGB, and count as 0";
    assert!(desc.warnings.len() == 1 && desc.warnings[0].ends_with(said), "{:?}", desc.warnings);
}

#[test]
fn files_that_are_not_there() {
    let folder = Folder::with(&small());
    let load = |body: &str, lenient: bool| {
        let options = LoadOptions { lenient, ..LoadOptions::default() };
        load_str(&scene(body), folder.0.path(), &options)
    };
    let missing = MEASURED.replace("a.bsdf", "b.bsdf");
    let error = load(&missing, false).unwrap_err().to_string();
    assert_eq!(error, "<string>:2:23: cannot find the file `b.bsdf`; did you mean `a.bsdf`?");
    let error = load("<bsdf type=\"measured\"/>", false).unwrap_err().to_string();
    assert_eq!(error, "<string>:2:1: bsdf `measured` needs a `filename`");
    let unread = MEASURED.replace("</bsdf>", "<float name=\"wavelength\" value=\"500\"/></bsdf>");
    let desc = load(&unread, false).unwrap();
    let error = Scene::build(&desc, &BuildOptions::default()).unwrap_err().to_string();
    assert!(
        error.contains("bsdf `measured` takes no parameter `wavelength`; known: filename, measured"),
        "{error}"
    );

    let desc = load(&missing, true).unwrap();
    assert!(desc.objects.iter().any(|o| o.plugin == "diffuse" && o.params.is_empty()));
    let said: Vec<String> = desc.replacements();
    assert!(said.len() == 1 && said[0].ends_with("replaced by a grey `diffuse`"), "{said:?}");
    assert!(!desc.objects.iter().any(|o| o.params.iter().any(|p| matches!(p.value, Value::Measured(_)))));
}
