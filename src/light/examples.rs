//! Typical and extreme lights for the contract tests.

use std::sync::Arc;

use glam::DMat3;

use super::envmap::EnvOptions;
use super::sky::SkyOptions;
use super::spot::{Cone, Falloff};
use super::{Constant, Directional, EnvMap, Light, Point, Projector, Spot, SunSky};
use crate::desc::{Image, Pixels};
use crate::math::{DVec3, Rgb, Transform, Vec3};

impl Light {
    /// Typical and extreme lights other than `area`, each with a name for
    /// messages. (An area light needs a shape: see [`super::AreaLight`].)
    #[must_use]
    pub fn examples() -> Vec<(String, Light)> {
        let intensity = Rgb::new(3.0, 2.0, 1.0);
        let pose = Transform::translate(DVec3::new(1.0, 2.0, 3.0));
        let spot = |cutoff: f64, beam: f64, falloff| {
            let cone = Cone { cutoff: cutoff.to_radians(), beam: beam.to_radians(), falloff };
            Spot::new(intensity, &pose, cone, None)
        };
        let towards = Vec3::new(0.6, 0.0, -0.8);
        let mut out: Vec<(String, Light)> = vec![
            ("point".into(), Point { intensity, position: Vec3::new(1.0, 2.0, 3.0), weight: 1.0 }.into()),
            ("spot".into(), spot(40.0, 30.0, Falloff::Linear).into()),
            ("spot, hard edge".into(), spot(25.0, 25.0, Falloff::Linear).into()),
            ("spot, whole sphere".into(), spot(180.0, 0.0, Falloff::Linear).into()),
            ("spot, squared".into(), spot(50.0, 20.0, Falloff::Squared).into()),
            ("spot, squared, hard edge".into(), spot(25.0, 25.0, Falloff::Squared).into()),
            ("spot, squared, whole sphere".into(), spot(180.0, 0.0, Falloff::Squared).into()),
            ("projector".into(), Projector::example(&pose).into()),
            ("directional".into(), Directional { irradiance: intensity, towards, weight: 1.0 }.into()),
            ("constant".into(), Constant { radiance: intensity, weight: 1.0 }.into()),
        ];
        out.extend(env_maps().into_iter().map(|(name, map)| (format!("envmap, {name}"), map.into())));
        out.extend(skies().into_iter().map(|(name, sky)| (format!("sunsky, {name}"), sky.into())));
        out
    }
}

/// Skies clear and hazy, without a sun or with a huge one: a disc as small as
/// the sun's is lost on any grid over the sphere.
fn skies() -> Vec<(&'static str, SunSky)> {
    let sky = |turbidity, sun: [f64; 3], sun_scale, complex_sun| {
        SunSky::new(&SkyOptions {
            turbidity,
            albedo: Rgb::new(0.1, 0.5, 0.9),
            sun_scale,
            sky_scale: 2.0,
            aperture: 1.8,
            complex_sun,
            sun: DVec3::from(sun).normalize(),
            to_world: DMat3::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 1.1),
            weight: 1.0,
        })
    };
    vec![
        ("no sun", sky(1.0, [0.9, 0.1, 0.3], 0.0, false)),
        ("low", sky(2.5, [-0.5, 0.8, 0.01], 0.0, false)),
        ("hazy, huge sun", sky(10.0, [-0.1, -0.4, 0.9], 1.0, false)),
        ("huge sun with a limb", sky(5.5, [0.1, 0.1, 0.9], 0.01, true)),
    ]
}

/// Maps that are stiff in one way each, and plain ones.
fn env_maps() -> Vec<(&'static str, EnvMap)> {
    let noise = |i: u32| ((i.wrapping_mul(2_654_435_761) >> 8) & 0xffff) as f32 / 65536.0;
    let one_texel = |x: u32, y: u32| move |i: u32, j: u32| if (i, j) == (x, y) { 1e12 } else { 0.0 };
    let sun = |i: u32, j: u32| if (i, j) == (9, 3) { 1e6 } else { 1.0 };
    let row = |_: u32, j: u32| if j == 2 { 5.0 } else { 0.0 };
    vec![
        ("noise", env_map([16, 9], false, |i, j| noise(i + 16 * j).powi(4))),
        ("noise, compensated", env_map([16, 9], true, |i, j| noise(i + 16 * j).powi(4))),
        ("uniform", env_map([8, 4], false, |_, _| 0.7)),
        ("sun", env_map([24, 13], false, sun)),
        ("one texel", env_map([12, 7], false, one_texel(11, 3))),
        ("north pole", env_map([12, 7], false, |_, j| if j == 0 { 1.0 } else { 0.0 })),
        ("one texel at the south pole", env_map([12, 7], false, one_texel(0, 6))),
        ("one bright row", env_map([10, 6], false, row)),
        ("1 x 1", env_map([1, 1], false, |_, _| 2.0)),
        ("2 x 1", env_map([2, 1], false, |i, _| 1.0 + 2.0 * i as f32)),
        ("1 x 2", env_map([1, 2], false, |_, j| j as f32)),
        ("one row", env_map([7, 1], false, |i, _| noise(i))),
    ]
}

/// A coloured map from a function of its texels, turned out of the axes.
fn env_map(size: [u32; 2], mis_compensation: bool, value: impl Fn(u32, u32) -> f32) -> EnvMap {
    let [width, height] = size;
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let tint = |x: u32, y: u32| [1.0, if (x + y).is_multiple_of(3) { 0.2 } else { 0.9 }, 0.5];
    let pixels = texels.flat_map(|(x, y)| tint(x, y).map(|t| t * value(x, y))).collect();
    let image = Image { width, height, channels: 3, pixels: Pixels::F32(pixels), name: "example".into() };
    let to_world = DMat3::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 1.1);
    let options = EnvOptions { scale: 1.5, to_world, mis_compensation, weight: 1.0 };
    EnvMap::new(Arc::new(image), &options).expect("the example is an image")
}
