//! Lights without a surface that move while the shutter is open: closed forms,
//! the mean of still pictures, and the bounds by which they are chosen.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/render.rs"]
mod render;

use std::f64::consts::PI;
use std::fmt::Write;

use etendue::light::{LightTree, Receiver};
use etendue::math::Vec2;
use etendue::sampling::uniform_sphere;
use etendue::scene::LightSelection;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use render::{Ready, mean, rgb};

const FLOOR: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
    <scale value="4"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"#;

/// The mean of four by four pixels at the origin of the floor, by seeds.
fn measured(light: &str) -> (f64, f64) {
    let xml = format!(
        r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
        <sensor type="perspective"><float name="fov" value="0.01"/><float name="shutter_close" value="1"/>
        <transform name="to_world"><lookat origin="0.3,0.5,0" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
        <rfilter type="box"/></film></sensor>{FLOOR}{light}</scene>"#
    );
    let ready = Ready::from_xml(&xml, None, None);
    let means: Vec<f64> = (0..8).map(|seed| mean(&ready.picture(4096, seed))).collect();
    let m = means.iter().sum::<f64>() / 8.0;
    (m, (means.iter().map(|x| (x - m).powi(2)).sum::<f64>() / 56.0).sqrt())
}

/// L = E / 2π of the mean irradiance over the shutter.
#[test]
fn closed_forms() {
    let keys = |a: &str, b: &str| {
        format!(
            r#"<animation name="to_world"><transform time="0">{a}</transform>
            <transform time="1">{b}</transform></animation>"#
        )
    };
    // Turning about x at constant speed, from −60° to 60° away from straight down.
    let turn = |height: f64| {
        let pose = |angle: f64| format!(r#"<rotate x="1" angle="{angle}"/><translate y="{height}"/>"#);
        keys(&pose(30.0), &pose(150.0))
    };
    let sin = 60.0f64.to_radians().sin();
    let cases = [
        (
            // ∫ 1 / (x² + 1)^1.5 dx / 2 over [−1, 1].
            "a point that passes by",
            format!(
                r#"<emitter type="point">{}</emitter>"#,
                keys(r#"<translate x="-1" y="1"/>"#, r#"<translate x="1" y="1"/>"#)
            ),
            0.5f64.sqrt(),
        ),
        (
            "a spot of half angle 24 degrees that sweeps over",
            format!(
                r#"<emitter type="spot">{}<float name="cutoff_angle" value="24"/>
                <float name="beam_width" value="24"/></emitter>"#,
                turn(2.0)
            ),
            0.25 * 24.0 / 60.0,
        ),
        (
            "parallel light that turns",
            format!(r#"<emitter type="directional">{}</emitter>"#, turn(0.0)),
            sin / 60.0f64.to_radians(),
        ),
        (
            // Nothing moves after the shutter closes or before it opens.
            "a point that has stopped",
            r#"<emitter type="point"><animation name="to_world">
            <transform time="-1"><translate x="5" y="1"/></transform>
            <transform time="0"><translate y="1"/></transform></animation></emitter>"#
                .to_owned(),
            1.0,
        ),
    ];
    for (name, light, irradiance) in cases {
        let (m, se) = measured(&light);
        let expected = irradiance / (2.0 * PI);
        let what = format!("{name}: {m} ± {se}, expected {expected}");
        assert!(se < 1e-3 * expected, "inconclusive: {what}");
        assert!((m - expected).abs() < 4.0 * se + 2e-5 * expected, "{what}");
    }
}

/// Points and spots on their way, parallel light, and lamps that stand still,
/// with the shutter open for [a, b].
fn busy(shutter: [f64; 2]) -> String {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut place = move || {
        let [x, y, z] = [(); 3].map(|()| rng.random::<f32>());
        format!(
            r#"<rotate x="1" angle="{}"/><rotate z="1" angle="{}"/><translate x="{}" y="{}" z="{}"/>"#,
            60.0 + 60.0 * x,
            60.0 * y - 30.0,
            3.0 * y - 1.5,
            1.4 + x,
            3.0 * z - 1.5
        )
    };
    let mut lights = String::new();
    for k in 0..8 {
        let kind = ["point", "spot"][k % 2];
        let cone = if k % 2 == 0 { "" } else { r#"<float name="cutoff_angle" value="50"/>"# };
        let more = if k % 3 == 0 {
            format!(r#"<transform time="0.4">{}</transform>"#, place())
        } else {
            String::new()
        };
        write!(
            lights,
            r#"<emitter type="{kind}">{cone}<animation name="to_world"><transform time="0">{}</transform>{more}
            <transform time="1">{}</transform></animation></emitter>"#,
            place(),
            place()
        )
        .unwrap();
    }
    lights += r#"<emitter type="directional"><rgb name="irradiance" value="0.3"/><animation name="to_world">
        <transform time="0"><rotate x="1" angle="70"/></transform>
        <transform time="1"><rotate x="1" angle="120"/></transform></animation></emitter>
        <emitter type="point"><point name="position" x="0" y="1" z="0.5"/></emitter>"#;
    format!(
        r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
        <sensor type="perspective"><float name="fov" value="40"/><float name="shutter_open" value="{}"/>
        <float name="shutter_close" value="{}"/>
        <transform name="to_world"><lookat origin="0,4,-4" target="0,0.3,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/>
        <rfilter type="box"/></film></sensor>{FLOOR}
        <shape type="sphere"><point name="center" x="0" y="0.4" z="0"/><float name="radius" value="0.4"/>
        <bsdf type="roughconductor"><float name="alpha" value="0.4"/></bsdf></shape>{lights}</scene>"#,
        shutter[0], shutter[1]
    )
}

/// One blurred picture is the mean of 256 still ones, with the light tree and
/// with lights chosen by power.
#[test]
fn the_mean_of_still_pictures() {
    let tree = Ready::from_xml(&busy([0.0, 1.0]), None, None);
    assert!(tree.scene.selection.is_fine() && tree.scene.plan.moving_lights == 9);
    let mut power = Ready::from_xml(&busy([0.0, 1.0]), None, None);
    let powers: Vec<f64> = power.scene.lights.iter().map(|l| l.power(5.0)).collect();
    power.scene.selection = LightSelection::by_power(&powers, &vec![1.0; powers.len()]);
    let add = |sum: &mut Vec<f64>, picture: Vec<f32>, share: f64| {
        sum.iter_mut().zip(picture).for_each(|(sum, value)| *sum += share * f64::from(value));
    };
    // Every eighth makes up one of eight estimates.
    let mut stills = vec![vec![0.0; 12 * 8 * 3]; 8];
    for k in 0..256 {
        let time = (k as f64 + 0.5) / 256.0;
        let ready = Ready::from_xml(&busy([time, time]), None, None);
        assert_eq!(ready.scene.plan.moving_lights, 0);
        add(&mut stills[k % 8], rgb(&ready.picture(128, k as u64)), 1.0 / 32.0);
    }
    let moments = |set: &[Vec<f64>], i: usize| {
        let n = set.len() as f64;
        let mean = set.iter().map(|p| p[i]).sum::<f64>() / n;
        (mean, set.iter().map(|p| (p[i] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    for (name, ready) in [("tree", tree), ("power", power)] {
        let blurred: Vec<Vec<f64>> = (0..8)
            .map(|seed| {
                let mut picture = vec![0.0; 12 * 8 * 3];
                add(&mut picture, rgb(&ready.picture(8192, seed)), 1.0);
                picture
            })
            .collect();
        let z = |blurred: &[Vec<f64>], stills: &[Vec<f64>], i: usize| {
            let ((a, va), (b, vb)) = (moments(blurred, i), moments(stills, i));
            if a == b { 0.0 } else { (a - b) / (va + vb).sqrt() }
        };
        let each: Vec<f64> = (0..12 * 8 * 3).map(|i| z(&blurred, &stills, i)).collect();
        let [a, b] = [&blurred, &stills]
            .map(|set| set.iter().map(|p| vec![p.iter().sum()]).collect::<Vec<Vec<f64>>>());
        let whole = z(&a, &b, 0);
        let square = each.iter().map(|z| z * z).sum::<f64>() / each.len() as f64;
        let [a, b] = [&a, &b].map(|set| moments(set, 0).0);
        println!("{name}: {a} against {b}, z {whole:.2}; pixels have mean z² {square:.2}");
        assert!((a / b - 1.0).abs() < 5e-3 && whole.abs() < 5.0, "{name}: {a} {b}, z {whole}");
        // t-like with some 8 degrees of freedom: z² has mean 1.3.
        assert!(square < 2.0 && each.iter().all(|z| z.abs() < 8.0), "{name}: {square} {each:?}");
    }
}

/// At any time each light lies within its bounds, and where it shines on a
/// receiver it can be chosen.
#[test]
fn bounds_hold_over_the_shutter() {
    let scene = Ready::from_xml(&busy([0.0, 1.0]), None, None).scene;
    let tree: &LightTree = scene.selection.tree().unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut seen = 0;
    for (index, light) in scene.lights.iter().enumerate().filter(|(_, l)| l.moves() && !l.is_infinite()) {
        let extent = light.emitters(&scene.geometry, index as u32)[0].extent;
        for _ in 0..4000 {
            let mut draw = || Vec2::new(rng.random(), rng.random());
            let p = uniform_sphere(draw()) * 3.0 * draw().x - scene.recentre.as_vec3();
            let n = uniform_sphere(draw());
            let receiver = Receiver { p, n, two_sided: draw().x < 0.5, time: draw().x };
            let Some(s) = light.sample(&scene.geometry, &receiver, draw()) else { continue };
            let etendue::light::Target::Point(at) = s.target else { panic!() };
            assert!(at.cmpge(extent.bounds.min).all() && at.cmple(extent.bounds.max).all());
            assert!(at.distance(extent.bounds.centre()) <= extent.radius);
            let angle = etendue::math::angle_between(-s.wi, extent.axis);
            assert!(angle <= extent.spread + extent.falloff + 1e-4, "{angle} {extent:?}");
            if receiver.two_sided || n.dot(s.wi) > 1e-5 {
                assert!(tree.pmf(&receiver, index as u32, 0) > 0.0, "light {index} {receiver:?}");
                seen += 1;
            }
        }
    }
    assert!(seen > 8000, "{seen}");
    // A directional light counts as everything at infinity does.
    assert!(scene.lights.iter().any(|l| l.moves() && l.is_infinite()));
}
