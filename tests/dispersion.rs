//! Glass that refracts colours apart (`dispersion` of `gltf`) against Snell's
//! law, and white light that comes out white in the mean.

#[path = "common/render.rs"]
mod render;

use etendue::color::Hue;
use render::{Ready, rgb};

/// Index of refraction by Cauchy's formula from n_d and the Abbe number, with
/// the lines d, F and C.
fn index(wavelength: f64, n: f64, abbe: f64) -> f64 {
    let [d, f, c, x] = [587.56, 486.13, 656.27, wavelength].map(|l: f64| l.powi(-2));
    n + (n - 1.0) / abbe * (x - d) / (f - c)
}

fn glass(roughness: f64, abbe: f64) -> String {
    format!(
        r#"<bsdf type="gltf"><float name="metallic" value="0"/><float name="roughness" value="{roughness}"/>
        <float name="specular" value="0"/><float name="transmission" value="1"/><float name="thickness" value="1"/>
        <float name="ior" value="1.5"/><float name="dispersion" value="{:e}"/></bsdf>"#,
        20.0 / abbe
    )
}

fn xml(integrator: &str, fov: f64, body: &str) -> String {
    format!(
        r#"<scene version="3.0.0"><integrator type="{integrator}"/>
        <sensor type="perspective"><float name="fov" value="{fov}"/>
        <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/>
        <rfilter type="box"/></film></sensor>{body}</scene>"#
    )
}

/// Mean of each channel over pixels and seeds.
fn means(scene: &str, samples: u64, seeds: u64) -> [f64; 3] {
    let ready = Ready::from_xml(scene, None, None);
    let mut sums = [0.0; 3];
    for seed in 0..seeds {
        let values = rgb(&ready.picture(samples, seed));
        for (i, value) in values.iter().enumerate() {
            sums[i % 3] += f64::from(*value) / (seeds * values.len() as u64 / 3) as f64;
        }
    }
    sums
}

/// A prism of 25° before a lamp that ends where one wavelength arrives: all
/// shorter ones, which are bent more, find it.
#[test]
fn a_prism_bends_by_snell() {
    let apex = 25f64.to_radians();
    for (abbe, edge) in [(10.0, 450.0), (10.0, 530.0), (10.0, 600.0), (40.0, 560.0)] {
        let bent =
            |wavelength: f64| 100.0 * ((index(wavelength, 1.5, abbe) * apex.sin()).asin() - apex).tan();
        let middle = -bent(edge) - 50.0;
        let body = format!(
            r#"<shape type="rectangle"><transform name="to_world"><translate z="0.5"/></transform>{glass}</shape>
            <shape type="rectangle"><transform name="to_world"><rotate y="1" angle="155"/><translate z="-0.5"/>
            </transform>{glass}</shape>
            <shape type="rectangle"><transform name="to_world"><scale value="50"/>
            <translate x="{middle:.9}" z="-100.5"/></transform>
            <emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>"#,
            glass = glass(0.0, abbe)
        );
        let mut expected = [0.0; 3];
        let n = 1 << 18;
        for i in 0..n {
            let hue = Hue::sample((i as f32 + 0.5) / n as f32);
            if f64::from(hue.wavelength) < edge {
                for (sum, c) in expected.iter_mut().zip(hue.colour.to_array()) {
                    *sum += 2.0 * f64::from(c) / f64::from(n);
                }
            }
        }
        for integrator in ["path", "volpath"] {
            let found = means(&xml(integrator, 0.0002, &body), 4096, 4);
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 5e-3, "{found} for {expected}: Abbe {abbe}, {edge} nm");
            }
        }
        // Whitted's rays are those of the middle of the spectrum, and it says so.
        let ready = Ready::from_xml(&xml("whitted", 0.0002, &body), None, None);
        assert_eq!(ready.integrator.leaves_out(&ready.scene), Some("dispersion is left out"));
        let white = rgb(&ready.picture(1, 0))[0];
        let expected = if edge > 587.56 { 2.0 } else { 0.0 };
        assert!((white - expected).abs() < 1e-5, "{white} for {expected}: Abbe {abbe}, {edge} nm");
    }
}

/// A white ball in white light is not seen, smooth or rough. Rough ones miss
/// what their table of energy, which is that of one index, does not know: 0.2 %
/// at roughness 0.7 without dispersion, 0.7 % of blue with it.
#[test]
fn white_stays_white() {
    for (roughness, allowed) in [(0.0, 2e-3), (0.3, 3e-3), (0.7, 8e-3)] {
        let body =
            format!(r#"<shape type="sphere">{}</shape><emitter type="constant"/>"#, glass(roughness, 20.0));
        for c in means(&xml("path", 15.0, &body), 4096, 8) {
            assert!((c - 1.0).abs() < allowed, "{c} at roughness {roughness}");
        }
    }
}
