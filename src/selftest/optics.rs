//! A15 to A24: glass, lenses and moving things.

use super::Row;
use super::sheet::{SEEDS, Sheet};
use super::stage::{Still, glow, mean, options, ortho, path, rgb, sky};
use crate::bsdf::fresnel::{fresnel_dielectric, fresnel_diffuse_reflectance};
use crate::desc::Result;

pub(super) const ROWS: &[Row] = &[
    Row { id: "A15", what: "transmittance of a pane of glass", run: pane },
    Row { id: "A16", what: "Fresnel reflectance from 0 to 89.9 degrees", run: fresnel },
    Row { id: "A17", what: "total reflection begins where it must", run: total_reflection },
    Row { id: "A18", what: "the half that Brewster's angle leaves", run: brewster },
    Row { id: "A19", what: "Fresnel reflectance of diffuse light", run: diffuse_fresnel },
    Row { id: "A20", what: "radiance inside glass is n squared", run: inside_glass },
    Row { id: "A21", what: "what an absorbing slab leaves, without noise", run: slab },
    Row { id: "A22", what: "circle of confusion of a lens", run: confusion },
    Row { id: "A23", what: "coverage of a moving plate", run: motion },
    Row { id: "A24", what: "what no path can find is black", run: unreachable },
];

fn glass(eta: f64) -> String {
    format!(
        r#"<bsdf type="dielectric"><float name="int_ior" value="{eta}"/><float name="ext_ior" value="1"/></bsdf>"#
    )
}

fn pane(sheet: &mut Sheet) -> Result<()> {
    let light = format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>{}</shape>"#,
        glow(1.0)
    );
    let thin = r#"<shape type="rectangle"><bsdf type="thindielectric"><float name="int_ior" value="1.5"/>
        <float name="ext_ior" value="1"/></bsdf></shape>"#;
    let slab = format!(
        r#"<shape type="cube"><transform name="to_world"><scale x="4" y="4" z="0.1"/></transform>{}</shape>"#,
        glass(1.5)
    );
    for (name, body) in [("thin", format!("{light}{thin}")), ("slab", format!("{light}{slab}"))] {
        let still = Still::new(body, [0.0, 0.0, 2.0], [0.0; 3]).samples(4096);
        sheet.radiance(name, 0.96 / 1.04, &still)?;
    }
    Ok(())
}

/// Fresnel's formulas in f64, both polarisations.
fn exact(angle_deg: f64, eta: f64) -> (f64, f64) {
    let cos_i = angle_deg.to_radians().cos();
    let sin_t = angle_deg.to_radians().sin() / eta;
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    (s * s, p * p)
}

fn reflectance(angle_deg: f64, eta: f64) -> f64 {
    f64::from(fresnel_dielectric(angle_deg.to_radians().cos() as f32, eta as f32).r)
}

fn fresnel(sheet: &mut Sheet) -> Result<()> {
    // cos rounded to f32 moves R at grazing; the expected value is of that cos.
    for (angle, published) in [
        (0.0f64, 0.04),
        (45.0, 0.050_239_911),
        (60.0, 0.089_186_713),
        (80.0, 0.387_704_355),
        (89.0, 0.904_184_950),
        (89.9, 0.989_911_877),
    ] {
        sheet.within(format!("{angle} degrees"), published, reflectance(angle, 1.5), 1e-6);
    }
    for (angle, eta) in [(30.0f64, 1.0001), (89.0, 1.0001), (60.0, 1e3), (60.0, 1.0 + 1e-6)] {
        let eta = f64::from(eta as f32);
        let cos = angle.to_radians().cos() as f32;
        let (s, p) = exact(f64::from(cos).acos().to_degrees(), eta);
        sheet.within(
            format!("{angle} degrees, n = {eta:.7}"),
            0.5 * (s + p),
            reflectance(angle, eta),
            if eta < 1.001 { 1e-4 } else { 1e-6 },
        );
    }
    Ok(())
}

fn total_reflection(sheet: &mut Sheet) -> Result<()> {
    let inside = |angle: f64| reflectance(angle, 1.0 / 1.5);
    sheet.holds("n = 1.5, 41.80 degrees: some light leaves", inside(41.80) < 1.0, || {
        inside(41.80).to_string()
    });
    sheet.exact("n = 1.5, 41.82 degrees", 1.0, inside(41.82));
    sheet.exact("n = 1.5, 89.999 degrees", 1.0, inside(89.999));
    Ok(())
}

fn brewster(sheet: &mut Sheet) -> Result<()> {
    let angle = 1.5f64.atan().to_degrees();
    let (s, p) = exact(angle, 1.5);
    debug_assert!(p < 1e-15, "{p}");
    sheet.within("n = 1.5", 0.5 * s, reflectance(angle, 1.5), 1e-6);
    Ok(())
}

fn diffuse_fresnel(sheet: &mut Sheet) -> Result<()> {
    sheet.within("outside, n = 1.5", 0.091_777_955, fresnel_diffuse_reflectance(1.5), 1e-6);
    sheet.within("inside, n = 1.5", 0.596_345_751, fresnel_diffuse_reflectance(1.0 / 1.5), 1e-6);
    Ok(())
}

fn inside_glass(sheet: &mut Sheet) -> Result<()> {
    for eta in [1.0001, 1.5, 10.0] {
        let body = format!(r#"<shape type="sphere">{}</shape>{}"#, glass(eta), sky(1.0));
        let still = Still::new(body, [0.1, 0.05, 0.0], [1.0, 0.3, 0.2]);
        sheet.radiance(format!("n = {eta}"), eta * eta, &still)?;
    }
    Ok(())
}

fn slab(sheet: &mut Sheet) -> Result<()> {
    let lamp = format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate z="-2"/></transform>{}</shape>"#,
        glow(1.0)
    );
    for thickness in [1e-6, 0.1, 1.0, 5.0, 20.0, 80.0f64] {
        // A cube has sides of 2.
        let cube = format!(
            r#"<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous">
            <float name="sigma_t" value="0.5"/><float name="scale" value="{thickness:e}"/>
            <float name="albedo" value="0"/></medium></shape>"#
        );
        let still = Still::new(format!("{lamp}{cube}"), [0.0, 0.0, 2.0], [0.0; 3])
            .integrator(r#"<integrator type="volpath"/>"#)
            .samples(16);
        let (name, expected) = (format!("thickness {thickness}"), (-thickness).exp());
        sheet.shop.offer(&name, &still, expected)?;
        let values = sheet.shop.means(&still)?.values;
        let off = values.iter().map(|v| (v / expected - 1.0).abs()).fold(0.0, f64::max);
        sheet.within(name, expected, values[0], 1e-5);
        sheet.within(format!("thickness {thickness}, farthest of all seeds"), 0.0, off, 1e-5);
    }
    Ok(())
}

fn confusion(sheet: &mut Sheet) -> Result<()> {
    // A lens of radius 0.2 in focus at 2, a bright disk at 4: blurred to a disk
    // of radius 0.2 |1/2 - 1/4| = 0.05 at unit distance. Second moments of the
    // blur and of the disk itself (0.02 / 4) add up.
    let half = 0.08f64;
    let camera = |lens: &str| {
        format!(
            r#"<sensor type="{lens}<float name="fov" value="{}"/><float name="near_clip" value="0.01"/>
            <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>"#,
            2.0 * half.atan().to_degrees()
        )
    };
    let body = format!(
        r#"<shape type="disk"><transform name="to_world"><scale value="0.02"/></transform>{}</shape>"#,
        glow(1000.0)
    );
    let still = |lens: &str| Still::new(&*body, [0.0; 3], [0.0; 3]).view(0.0, 64).seen_by(&camera(lens));
    let lens =
        r#"thinlens"><float name="aperture_radius" value="0.2"/><float name="focus_distance" value="2"/>"#;
    let samples = sheet.count(1024);
    let blurred = sheet.shop.picture(&still(lens), samples)?;
    let sharp = sheet.shop.picture(&still(r#"perspective">"#), samples)?;
    let red = blurred.channel("R").unwrap_or_default();
    let pixel = 2.0 * half / 64.0;
    let (mut sum, mut moment) = (0.0, 0.0);
    for (i, value) in red.iter().enumerate() {
        let at = |k: usize| (k as f64 + 0.5) * pixel - half;
        sum += f64::from(*value);
        moment += f64::from(*value) * (at(i % 64).powi(2) + at(i / 64).powi(2) + pixel * pixel / 6.0);
    }
    let radius = (2.0 * moment / sum - (0.02f64 / 4.0).powi(2)).sqrt();
    sheet.within("radius", 0.05, radius, 1e-2);
    sheet.within("flux as through a pinhole", mean(&sharp), mean(&blurred), 1e-2);
    Ok(())
}

/// What a box filter sees of a plate as wide as `width` pixels that goes from
/// pixel `from` to pixel `to` (its left edge) while the shutter is open.
fn coverage(pixel: f64, from: f64, to: f64, width: f64) -> f64 {
    let steps = 200_000;
    let overlap = |left: f64| ((left + width).min(pixel + 1.0) - left.max(pixel)).max(0.0);
    (0..steps).map(|i| overlap(from + (to - from) * (f64::from(i) + 0.5) / f64::from(steps))).sum::<f64>()
        / f64::from(steps)
}

fn motion(sheet: &mut Sheet) -> Result<()> {
    for speed in [0.0, 0.1, 10.0, 1e4] {
        // A film of 8 pixels from x = -1 to 1, mirrored; the plate is 4 wide.
        let key = |time: f64, pixels: f64| {
            format!(
                r#"<transform time="{time}"><rotate y="1" angle="180"/><scale x="0.5" y="3"/>
                <translate x="{:e}"/></transform>"#,
                1.0 - (1.5 + 2.0 + pixels) * 0.25
            )
        };
        let body = format!(
            r#"<shape type="rectangle"><animation name="to_world">{}{}</animation>{}</shape>"#,
            key(0.0, 0.0),
            key(1.0, speed),
            glow(1.0)
        );
        let shutter = r#"<float name="shutter_open" value="0"/><float name="shutter_close" value="1"/>"#;
        let camera = ortho([0.0, 0.0, -5.0], [0.0; 3], 1.0) + shutter;
        let still = Still::new(body, [0.0; 3], [0.0; 3]).view(0.0, 8).seen_by(&camera);
        let ready = sheet.shop.build(&still.xml())?;
        let samples = sheet.count(if speed > 1.0 { 2048 } else { 256 });
        let mut pixels = vec![Vec::new(); 8];
        for seed in 0..SEEDS {
            let picture = ready.render(&options(samples, sheet.shop.seed + seed))?.film.resolve();
            let red = &rgb(&picture)[..64];
            for (x, values) in pixels.iter_mut().enumerate() {
                values.push((0..8).map(|y| f64::from(red[8 * y + x])).sum::<f64>() / 8.0);
            }
        }
        if speed > 100.0 {
            // It is gone in no time: the whole film.
            let all: Vec<f64> = (0..pixels[0].len()).map(|k| pixels.iter().map(|p| p[k]).sum()).collect();
            let expected = (0..8).map(|x| coverage(f64::from(x), 1.5, 1.5 + speed, 4.0)).sum();
            sheet.mean(format!("{speed:e} pixels, all pixels"), expected, &all, 0.3);
            continue;
        }
        for x in [1, 3, 5] {
            let expected = coverage(x as f64, 1.5, 1.5 + speed, 4.0);
            let enough = if expected < 0.1 { 0.2 } else { 0.02 };
            sheet.mean(format!("{speed:e} pixels, pixel {x}"), expected, &pixels[x], enough);
        }
    }
    Ok(())
}

fn unreachable(sheet: &mut Sheet) -> Result<()> {
    // A point light over a mirror: no path has any chance.
    let body = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>
        <bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>
        <emitter type="point"><point name="position" x="0" y="1" z="0"/></emitter>"#;
    let still = Still::new(body, [0.3, 0.5, 0.0], [0.0; 3]).integrator(path(8));
    sheet.shop.offer("point light and mirror", &still, 0.0)?;
    let mean = sheet.shop.means(&still)?.values[0];
    sheet.exact("point light and mirror", 0.0, mean);
    Ok(())
}
