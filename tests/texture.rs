//! Textures against Mitsuba 3.9.1, and what they refuse.
//!
//! The reference numbers were printed by the Python module of Mitsuba 3.9.1,
//! variant `scalar_rgb`: `mi.load_dict({"type": "bitmap", "bitmap": …,
//! "format": "variant", …})`, then `eval`, `eval_1` and `eval_1_grad` at a
//! `SurfaceInteraction3f` of zeros with `uv` set.

#![allow(clippy::excessive_precision, reason = "reference numbers stand as they were printed")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/describe.rs"]
mod describe;
#[path = "common/render.rs"]
mod render;

use describe::{Describe, float, string, transform};
use etendue::desc::{Category, Error, Pixels, Value};
use etendue::math::{DMat4, DVec3, Rgb, Vec2, Vec3, Vec4};
use etendue::texture::{
    Coords, Footprint, MAX_ATTRIBUTES, More, NO_ATTRIBUTES, NO_FOOTPRINTS, Pyramids, Texture, TextureFilter,
    Usage, texture_from_desc, texture_param,
};

const FLOATS: [f32; 18] =
    [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.9, 0.1, 0.5, 0.2, 0.3, 0.1, 0.6, 0.6, 0.2];
const BYTES: [u8; 24] =
    [10, 20, 30, 255, 100, 120, 140, 0, 250, 240, 230, 128, 0, 255, 128, 64, 5, 6, 7, 255, 77, 88, 99, 200];
const UVS: [[f32; 2]; 7] =
    [[0.1, 0.2], [0.5, 0.5], [0.9, 0.95], [-0.3, 1.7], [2.35, -1.1], [0.0, 0.0], [1.0, 1.0]];

/// A texture read as the `reflectance` of an object.
fn read(d: &mut Describe, plugin: &str, params: Vec<(&str, Value)>, usage: Usage) -> Result<Texture, Error> {
    let id = d.object(Category::Texture, plugin, params);
    let owner = d.object(Category::Bsdf, "diffuse", vec![("reflectance", Value::Object(id))]);
    texture_param(&d.scene.params(owner), "reflectance", Rgb::ZERO, usage)
}

fn bitmap(size: [u32; 2], channels: u32, pixels: Pixels, more: Vec<(&str, Value)>) -> Result<Texture, Error> {
    let mut d = Describe::new();
    let image = d.image(size, channels, pixels);
    let mut params = vec![("filename", string("map.exr")), ("image", image)];
    params.extend(more);
    read(&mut d, "bitmap", params, Usage::Reflectance)
}

fn check(name: &str, texture: &Texture, uv: [f32; 2], expected: [f32; 3], grad: Option<[f32; 2]>) {
    let uv = Vec2::from(uv);
    let found = texture.eval(uv);
    assert!(
        (found - Rgb::from(expected)).abs().max_element() < 2e-6,
        "{name} {uv}: {found} not {expected:?}"
    );
    if let Some(grad) = grad {
        let found = Vec2::from(texture.gradient(uv));
        assert!((found - Vec2::from(grad)).abs().max_element() < 3e-5, "{name} {uv}: {found} not {grad:?}");
    }
}

#[test]
fn wrap_modes_and_filters_are_mitsubas() {
    let table: [(&str, &str, [[f32; 3]; 7]); 6] = [
        (
            "repeat",
            "bilinear",
            [
                [0.282, 0.308, 0.422],
                [0.3, 0.4, 0.35],
                [0.628, 0.572, 0.468],
                [0.454, 0.5, 0.222],
                [0.44, 0.2565, 0.3355],
                [0.575, 0.425, 0.475],
                [0.575, 0.425, 0.475],
            ],
        ),
        (
            "repeat",
            "nearest",
            [
                [0.1, 0.2, 0.3],
                [0.2, 0.3, 0.1],
                [0.6, 0.6, 0.2],
                [0.6, 0.6, 0.2],
                [0.2, 0.3, 0.1],
                [0.1, 0.2, 0.3],
                [0.1, 0.2, 0.3],
            ],
        ),
        (
            "mirror",
            "bilinear",
            [
                [0.1, 0.2, 0.3],
                [0.3, 0.4, 0.35],
                [0.6, 0.6, 0.2],
                [0.26, 0.306, 0.412],
                [0.515, 0.21, 0.28],
                [0.1, 0.2, 0.3],
                [0.6, 0.6, 0.2],
            ],
        ),
        (
            "mirror",
            "nearest",
            [
                [0.1, 0.2, 0.3],
                [0.2, 0.3, 0.1],
                [0.6, 0.6, 0.2],
                [0.1, 0.2, 0.3],
                [0.2, 0.3, 0.1],
                [0.1, 0.2, 0.3],
                [0.6, 0.6, 0.2],
            ],
        ),
        (
            "clamp",
            "bilinear",
            [
                [0.1, 0.2, 0.3],
                [0.3, 0.4, 0.35],
                [0.6, 0.6, 0.2],
                [0.9, 0.1, 0.5],
                [0.7, 0.8, 0.9],
                [0.1, 0.2, 0.3],
                [0.6, 0.6, 0.2],
            ],
        ),
        (
            "clamp",
            "nearest",
            [
                [0.1, 0.2, 0.3],
                [0.2, 0.3, 0.1],
                [0.6, 0.6, 0.2],
                [0.9, 0.1, 0.5],
                [0.7, 0.8, 0.9],
                [0.1, 0.2, 0.3],
                [0.6, 0.6, 0.2],
            ],
        ),
    ];
    for (wrap, filter, expected) in table {
        let more = vec![("wrap_mode", string(wrap)), ("filter_type", string(filter))];
        let t = bitmap([3, 2], 3, Pixels::F32(FLOATS.to_vec()), more).unwrap();
        for (uv, expected) in UVS.into_iter().zip(expected) {
            check(&format!("{wrap} {filter}"), &t, uv, expected, None);
        }
    }
}

#[test]
fn to_uv_and_the_gradient_through_it_are_mitsubas() {
    // T().scale([2, 3, 1]) @ T().rotate([0, 0, 1], 30) @ T().translate([.1, .2, 0])
    let m = DMat4::from_scale(DVec3::new(2.0, 3.0, 1.0))
        * DMat4::from_rotation_z(30.0f64.to_radians())
        * DMat4::from_translation(DVec3::new(0.1, 0.2, 0.0));
    let t = bitmap([3, 2], 3, Pixels::F32(FLOATS.to_vec()), vec![("to_uv", transform(m))]).unwrap();
    let expected = [
        [0.53310108, 0.56682354, 0.6260246],
        [0.51991707, 0.21305324, 0.30310386],
        [0.39043716, 0.47873077, 0.4126457],
        [0.53247654, 0.57369268, 0.32431805],
        [0.26958749, 0.22310598, 0.36551017],
        [0.68124628, 0.41560018, 0.37770802],
        [0.45120493, 0.49180698, 0.18362595],
    ];
    for (uv, rgb) in UVS.into_iter().zip(expected) {
        check("to_uv", &t, uv, rgb, None);
        // The derivative is that of eval, also where the image is not square.
        let (h, uv) = (1e-3, Vec2::from(uv) + 0.01);
        let slope = |d: Vec2| (t.eval_scalar(uv + d * h) - t.eval_scalar(uv - d * h)) / (2.0 * h);
        let found = Vec2::from(t.gradient(uv));
        let expected = Vec2::new(slope(Vec2::X), slope(Vec2::Y));
        assert!((found - expected).abs().max_element() < 2e-2, "{uv}: {found} not {expected}");
    }
    assert!((t.eval_scalar(Vec2::new(0.1, 0.2)) - 0.56392419).abs() < 1e-4);

    let grey = Pixels::F32(vec![0.1, 0.7, 0.4, 0.9]);
    let t = bitmap([2, 2], 1, grey, vec![("to_uv", transform(m))]).unwrap();
    let expected = [
        (0.50701028, [-1.298794, 2.4076536]),
        (0.47154126, [2.6002302, 0.453576]),
        (0.60955024, [2.6144865, 0.1088835]),
        (0.85078514, [-1.2086396, 2.0884228]),
        (0.27611575, [-1.1822573, 2.6135004]),
        (0.63746405, [-1.0538199, 2.3033457]),
        (0.84786254, [1.1174614, -2.0928063]),
    ];
    for (uv, (value, grad)) in UVS.into_iter().zip(expected) {
        check("square", &t, uv, [value; 3], Some(grad));
    }
}

#[test]
fn integer_images_decode_as_in_mitsuba_and_alpha_is_dropped() {
    let t = bitmap([3, 2], 4, Pixels::U8(BYTES.to_vec()), vec![]).unwrap();
    let expected = [
        [0.1757448, 0.24383448, 0.1715457],
        [0.064477704, 0.094820961, 0.13218763],
        [0.34177682, 0.44623896, 0.34004781],
        [0.10307752, 0.1131476, 0.12610956],
        [0.022021269, 0.34763616, 0.11383812],
    ];
    for (uv, rgb) in UVS.into_iter().zip(expected) {
        check("u8 srgb", &t, uv, rgb, None);
    }
    let t = bitmap([3, 2], 4, Pixels::U8(BYTES.to_vec()), vec![("raw", Value::Bool(true))]).unwrap();
    check("u8 raw", &t, UVS[0], [0.21074508, 0.31278431, 0.29498041], None);
    check("u8 raw", &t, UVS[2], [0.46180406, 0.59309804, 0.54462755], None);

    // A 16 bit grey PNG, decoded and raw; here the gradient is exact.
    let grey = Pixels::U16(vec![1000, 40000, 65535, 20000]);
    let t = bitmap([2, 2], 1, grey.clone(), vec![]).unwrap();
    check("u16", &t, UVS[0], [0.16232798; 3], Some([-0.4084334, -1.2453803]));
    check("u16", &t, UVS[2], [0.30460712; 3], Some([0.8453293, -0.24237]));
    let t = bitmap([2, 2], 1, grey, vec![("raw", Value::Bool(true))]).unwrap();
    check("u16 raw", &t, UVS[0], [0.25356606; 3], Some([-0.9322194, -1.1955291]));

    // An 8 bit PNG of grey and alpha.
    let t = bitmap([2, 2], 2, Pixels::U8(vec![10, 128, 200, 255, 30, 0, 255, 7]), vec![]).unwrap();
    check("ya", &t, UVS[0], [0.18876785; 3], Some([-1.2315853, -0.2673785]));
    assert!((t.mean().x - 0.39839977).abs() < 1e-6);
}

#[test]
fn narrow_images_look_as_mitsubas_upsampled_ones() {
    let ramp = |n: usize| (0..n).map(|i| i as f32 / (n - 1) as f32).collect::<Vec<f32>>();
    let t = bitmap([3, 1], 3, Pixels::F32(ramp(9)), vec![]).unwrap();
    check("3x1", &t, [0.1, 0.2], [0.15, 0.275, 0.4], None);
    check("3x1", &t, [0.6, 0.7], [0.4875, 0.6125, 0.7375], None);
    let t = bitmap([1, 4], 3, Pixels::F32(ramp(12)), vec![]).unwrap();
    check("1x4", &t, [0.1, 0.2], [0.0818181, 0.1727272, 0.2636363], Some([0.0, 1.0909092]));
    let t = bitmap([1, 1], 3, Pixels::F32(vec![0.0, 0.5, 1.0]), vec![]).unwrap();
    check("1x1", &t, [-7.3, 0.7], [0.0, 0.5, 1.0], Some([0.0, 0.0]));
    assert_eq!(t.is_constant(), Some(Rgb::new(0.0, 0.5, 1.0)));
}

#[test]
fn checkerboard_is_mitsubas_also_where_it_swaps_numbers() {
    let mut d = Describe::new();
    let m = DMat4::from_scale(DVec3::new(2.0, 3.0, 1.0));
    let t = read(&mut d, "checkerboard", vec![("to_uv", transform(m))], Usage::Reflectance).unwrap();
    for (uv, rgb, number) in UVS
        .into_iter()
        .zip([0.2, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4])
        .zip([0.4, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2])
        .map(|((uv, rgb), number)| (uv, rgb, number))
    {
        check("checkerboard", &t, uv, [rgb; 3], Some([0.0, 0.0]));
        assert_eq!(t.eval_scalar(Vec2::from(uv)), number, "{uv:?}");
    }
    let params = vec![("color0", Value::Rgb([0.1, 0.2, 0.3])), ("color1", float(0.7))];
    let t = read(&mut d, "checkerboard", params, Usage::Reflectance).unwrap();
    check("checkerboard", &t, [0.25, 0.75], [0.7; 3], None);
    check("checkerboard", &t, [0.5, 0.25], [0.1, 0.2, 0.3], None);
    assert!((t.mean() - Rgb::new(0.4, 0.45, 0.5)).abs().max_element() < 1e-6);
}

#[test]
fn spectra_are_mitsubas() {
    // Printed by `mi.traverse` of `<spectrum name="radiance" value="400:1,500:2,700:.5"/>` in an
    // emitter and `<spectrum name="reflectance" value="400:.1,500:.2,700:.5"/>` in a bsdf.
    let mut d = Describe::new();
    let mut constant = |pairs: &[(f64, f64)], usage| {
        let owner =
            d.object(Category::Bsdf, "diffuse", vec![("reflectance", Value::Spectrum(pairs.to_vec()))]);
        texture_param(&d.scene.params(owner), "reflectance", Rgb::ZERO, usage).unwrap()
    };
    let t = constant(&[(400.0, 1.0), (500.0, 2.0), (700.0, 0.5)], Usage::Radiance);
    check("radiance", &t, [0.0, 0.0], [1.1294829, 1.6563047, 1.3742533], None);
    let t = constant(&[(400.0, 0.1), (500.0, 0.2), (700.0, 0.5)], Usage::Reflectance);
    check("reflectance", &t, [0.0, 0.0], [0.41305548, 0.26246575, 0.13673052], None);
}

#[test]
fn refusals_name_the_place_and_the_texel() {
    let message = |r: Result<Texture, Error>| r.unwrap_err().to_string();
    let mut bad = FLOATS.to_vec();
    bad[10] = f32::NAN;
    assert_eq!(
        message(bitmap([3, 2], 3, Pixels::F32(bad.clone()), vec![])),
        "scene.xml:1:2: texel (0, 1) of image `map.exr` is 0.9, NaN, 0.5, which is not finite"
    );
    bad[10] = -0.25;
    assert_eq!(
        message(bitmap([3, 2], 3, Pixels::F32(bad), vec![])),
        "scene.xml:1:2: texel (0, 1) of image `map.exr` is 0.9, -0.25, 0.5, which is negative"
    );
    assert_eq!(
        message(bitmap([3, 2], 3, Pixels::F32(FLOATS.to_vec()), vec![("wrap_mode", string("miror"))])),
        "scene.xml:1:4: `wrap_mode` has no value `miror`; did you mean `mirror`?"
    );
    assert_eq!(
        message(bitmap([3, 2], 3, Pixels::F32(FLOATS.to_vec()), vec![("filter", string("nearest"))])),
        "scene.xml:1:4: texture `bitmap` takes no parameter `filter`; known: filename, format, accel, \
         filter_type, wrap_mode, channel, uv_attribute, wrap_mode_u, wrap_mode_v, to_uv, raw, scale, image"
    );
    let mut d = Describe::new();
    assert_eq!(
        message(read(&mut d, "bitmp", vec![], Usage::Scalar)),
        "scene.xml:1:1: unknown texture `bitmp`; did you mean `bitmap`?"
    );
    let mut constant = |value: Value, usage| {
        let owner = d.object(Category::Bsdf, "diffuse", vec![("reflectance", value)]);
        texture_param(&d.scene.params(owner), "reflectance", Rgb::ZERO, usage)
    };
    assert_eq!(
        message(constant(Value::Rgb([1.5, 0.0, 0.0]), Usage::Reflectance)),
        "scene.xml:3:2: `reflectance` must lie in [0, 1], found 1.5, 0, 0"
    );
    assert_eq!(
        message(constant(float(-2.0), Usage::Radiance)),
        "scene.xml:4:2: `reflectance` must not be negative, found -2"
    );
    assert_eq!(
        message(constant(float(1e300), Usage::Radiance)),
        "scene.xml:5:2: `reflectance` must be finite, found inf"
    );
    assert!(constant(Value::Rgb([100.0, 0.0, 0.0]), Usage::Radiance).is_ok());
    assert!(constant(float(-2.0), Usage::Scalar).is_ok());
}

#[test]
fn examples_stay_finite_and_their_means_are_right() {
    let examples = Texture::examples();
    assert!(examples.len() >= 7);
    for (name, t) in &examples {
        for uv in [[1e30, -1e30], [-3.0e9, 0.1], [f32::MIN_POSITIVE, 1e-30], [1e6 + 0.3, -7.9]] {
            let uv = Vec2::from(uv);
            let (du, dv) = t.gradient(uv);
            assert!(t.eval(uv).is_finite() && du.is_finite() && dv.is_finite(), "{name} {uv}");
            assert!(t.eval(uv).max_element() <= t.max() * (1.0 + 1e-6), "{name} {uv}");
        }
        // Midpoints of a fine grid of the unit square.
        let n = 420;
        let mut sum = DVec3::ZERO;
        for i in 0..n * n {
            let uv = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
            sum += t.eval(uv).as_dvec3();
        }
        let mean = sum.as_vec3() / (n * n) as f32;
        // Of the bitmap under a checkerboard only parts are seen.
        assert!((mean - t.mean()).abs().max_element() < 5e-3, "{name}: {mean} not {}", t.mean());
    }
}

#[test]
fn channels_factors_and_axes() {
    let raw = || vec![("raw", Value::Bool(true)), ("filter_type", string("nearest"))];
    let read = |more: Vec<(&str, Value)>| {
        let params = raw().into_iter().chain(more).collect();
        bitmap([3, 2], 4, Pixels::U8(BYTES.to_vec()), params).unwrap()
    };
    let byte = |i: usize| f32::from(BYTES[i]) / 255.0;
    let middle = Vec2::new(0.5, 0.25); // texel 1 of row 0
    for (channel, offset) in [("r", 4), ("g", 5), ("b", 6), ("a", 7)] {
        let t = read(vec![("channel", string(channel))]);
        assert_eq!(t.eval(middle), Rgb::splat(byte(offset)), "{channel}");
        assert_eq!(t.eval_scalar(middle), byte(offset), "{channel}");
    }
    // Alpha is never sRGB.
    let alpha = vec![("channel", string("a")), ("filter_type", string("nearest"))];
    let t = bitmap([3, 2], 4, Pixels::U8(BYTES.to_vec()), alpha.clone()).unwrap();
    assert_eq!(t.eval(Vec2::new(0.9, 0.25)), Rgb::splat(byte(11)));
    let error = bitmap([4, 2], 3, Pixels::U8(BYTES.to_vec()), alpha).unwrap_err();
    assert!(error.to_string().contains("image `map.exr` has no alpha channel"), "{error}");

    let t = read(vec![("scale", Value::Rgb([0.5, 1.0, 2.0]))]);
    let expected = Rgb::new(byte(4), byte(5), byte(6)) * Rgb::new(0.5, 1.0, 2.0);
    assert_eq!(t.eval(middle), expected);
    assert!(t.max() >= expected.max_element());

    // u runs over the edge, v over another.
    let t = read(vec![("wrap_mode", string("clamp")), ("wrap_mode_v", string("mirror"))]);
    assert_eq!(t.eval(Vec2::new(7.0, 1.25)), t.eval(Vec2::new(0.9, 0.75)));
    let t = read(vec![("wrap_mode_u", string("mirror"))]);
    assert_eq!(t.eval(Vec2::new(1.1, 1.25)), t.eval(Vec2::new(0.9, 0.25)));
}

#[test]
fn attributes_are_numbered_and_read() {
    let mut d = Describe::new();
    let colour = vec![("name", string("vertex_color")), ("scale", float(0.5))];
    let colour = d.object(Category::Texture, "mesh_attribute", colour);
    let image = d.image([3, 2], 3, Pixels::F32(FLOATS.to_vec()));
    let second =
        vec![("filename", string("map.exr")), ("image", image), ("uv_attribute", string("vertex_uv1"))];
    let second = d.object(Category::Texture, "bitmap", second);
    let [colour, second] =
        [colour, second].map(|id| texture_from_desc(&d.scene, id, Usage::Reflectance).unwrap());
    assert_eq!(d.scene.attribute_names(), ["vertex_color", "vertex_uv1"]);
    assert!(colour.reads_attributes() && second.reads_attributes());

    let mut attributes = [Vec4::ZERO; MAX_ATTRIBUTES];
    attributes[..2].copy_from_slice(&[Vec4::new(0.2, 0.4, 0.6, 0.8), Vec4::new(0.1, 0.2, 0.0, 1.0)]);
    let more = More { attributes, footprint: Footprint::POINT, footprints: NO_FOOTPRINTS };
    let at = Coords { uv: Vec2::new(0.9, 0.95), more: Some(&more) };
    assert_eq!(colour.eval(at), Rgb::new(0.1, 0.2, 0.3));
    check("second", &second, [0.0, 0.0], second.eval(Vec2::ZERO).to_array(), None);
    let plain = bitmap([3, 2], 3, Pixels::F32(FLOATS.to_vec()), vec![]).unwrap();
    assert_eq!(second.eval(at), plain.eval(Vec2::new(0.1, 0.2)));
}

/// A texture of random numbers, ready to be averaged.
fn filtered(size: [u32; 2], channels: u32, texel: impl Fn(u32, u32) -> f32) -> Texture {
    let of = |i: u32| texel(i / channels % size[0], i / channels / size[0]);
    let pixels = Pixels::F32((0..size[0] * size[1] * channels).map(of).collect());
    let texture = bitmap(size, channels, pixels, vec![]).unwrap();
    let mut pyramids = Pyramids::default();
    texture.visit_bitmaps(&mut |bitmap| bitmap.filter(&mut pyramids));
    texture
}

fn noise(x: u32, y: u32) -> f32 {
    let hash = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
    ((hash ^ (hash >> 15)).wrapping_mul(0x27d4_eb2f) >> 8) as f32 / (1 << 24) as f32
}

/// Looked at from a direction by a beam of so much width, (u, v) being (x, y).
fn seen(texture: &Texture, uv: Vec2, width: f32, wo: Vec3) -> f32 {
    let footprint = Footprint::new(width, wo, Vec3::X, Vec3::Y);
    let more = More { attributes: NO_ATTRIBUTES, footprint, footprints: NO_FOOTPRINTS };
    texture.eval(Coords { uv, more: Some(&more) }).x
}

#[test]
fn a_beam_wider_than_a_texture_sees_its_mean() {
    for (size, channels) in [([8, 8], 3), ([7, 5], 1), ([1, 9], 4), ([33, 2], 2), ([100, 63], 3)] {
        let texture = filtered(size, channels, noise);
        let (found, mean) = (seen(&texture, Vec2::new(0.3, 0.7), 100.0, Vec3::Z), texture.mean().x);
        assert!((found / mean - 1.0).abs() < 2e-3, "{size:?}: {found}, not {mean}");
        // A narrow one sees what there is, to the last bit.
        let uv = Vec2::new(0.21, 0.43);
        let narrow = 1.9 / size[0].max(size[1]) as f32;
        assert_eq!(seen(&texture, uv, narrow, Vec3::Z).to_bits(), texture.eval(uv).x.to_bits());
        assert_eq!(seen(&texture, uv, 0.0, Vec3::Z).to_bits(), texture.eval(uv).x.to_bits());
    }
}

/// Stripes seen at a grazing angle: along them nothing is blurred, across them
/// much is.
#[test]
fn a_slanted_beam_averages_along_one_axis() {
    let texture = filtered([64, 64], 1, |x, _| noise(x, 0));
    let (sin, cos) = 1.4f32.sin_cos();
    let at: Vec<Vec2> = (0..400).map(|i| Vec2::new(noise(i, 1), noise(i, 2))).collect();
    let spread = |f: &dyn Fn(Vec2) -> f32| {
        let values: Vec<f32> = at.iter().map(|uv| f(*uv)).collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt())
    };
    let width = 1.5 / 64.0;
    for uv in &at {
        let along = seen(&texture, *uv, width, Vec3::new(0.0, sin, cos));
        assert!((along - texture.eval(*uv).x).abs() < 1e-4, "{uv}: {along}");
    }
    let (mean, point) = spread(&|uv| texture.eval(uv).x);
    let (other, blurred) = spread(&|uv| seen(&texture, uv, width, Vec3::new(sin, 0.0, cos)));
    assert!((mean - other).abs() < 0.02 && blurred < 0.5 * point, "{mean} {other}, {point} {blurred}");
}

/// The filter takes noise away where pixels cover many texels, and leaves the mean.
#[test]
fn a_court_of_tiles_gets_less_noisy() {
    use etendue::integrator::{Integrator, IntegratorOptions};
    use etendue::load::{LoadOptions, load};
    use etendue::scene::{BuildOptions, Scene};
    let path = render::package("scenes/tiled-court/scene.xml");
    let desc = load(&path, &LoadOptions::default()).unwrap();
    let built = |texture_filter| {
        let options = BuildOptions { size: Some([96, 54]), texture_filter, ..BuildOptions::default() };
        let integrator = Integrator::from_desc(&desc, &IntegratorOptions::default()).unwrap();
        render::Ready { scene: Scene::build(&desc, &options).unwrap(), integrator }
    };
    let [point, footprint] = [TextureFilter::Point, TextureFilter::Footprint].map(built);
    assert!(point.scene.plan.pyramid_bytes == 0 && footprint.scene.plan.pyramid_bytes > 0);
    let reference = render::rgb(&point.picture(512, 1));
    let error = |picture: &[f32]| {
        let terms = picture.iter().zip(&reference).map(|(a, b)| f64::from((a - b).powi(2) / (b * b + 0.01)));
        terms.sum::<f64>() / reference.len() as f64
    };
    let mean = |picture: &[f32]| picture.iter().map(|v| f64::from(*v)).sum::<f64>();
    let [noisy, smooth] = [&point, &footprint].map(|ready| error(&render::rgb(&ready.picture(4, 2))));
    println!("relMSE at 4 spp: {noisy:.5} of points, {smooth:.5} over footprints");
    assert!(smooth < 0.7 * noisy, "{smooth} against {noisy}");
    let [a, b] = [mean(&reference), mean(&render::rgb(&footprint.picture(64, 3)))];
    assert!((b / a - 1.0).abs() < 1e-3, "the mean is off by {}", b / a - 1.0);
}

/// A floor far away, a mesh that needs no tangents, looked up through a second set of
/// coordinates, which are the first ones exchanged and stretched: with that undone by
/// `to_uv`, the picture is that of the first set, of a still floor, of one in an instance
/// of uneven scale, and of one that moves. Without footprints it is another.
#[test]
fn other_coordinates_have_their_own_footprints() {
    use etendue::integrator::{Integrator, IntegratorOptions};
    use etendue::load::{LoadOptions, load_str};
    use etendue::scene::{BuildOptions, Scene};
    let folder = tempfile::tempdir().unwrap();
    let corners: String = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
        .map(|[u, v]: [f32; 2]| format!("{} 0 {} {u} {v} {} {}\n", 24.0 * u - 12.0, -48.0 * v, v, 3.0 * u))
        .concat();
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         property float u\nproperty float v\nproperty float other_0\nproperty float other_1\n\
         element face 2\nproperty list uchar int vertex_indices\nend_header\n{corners}3 0 1 2\n3 0 2 3\n"
    );
    std::fs::write(folder.path().join("floor.ply"), ply).unwrap();
    let mosaic = render::package("scenes/tiled-court/mosaic.png");
    let picture = |place: &str, lookup: &str, texture_filter| {
        let floor = r#"<shape type="ply"><string name="filename" value="floor.ply"/><boolean name="face_normals"
            value="true"/><ref id="tiles"/>"#;
        let floor = match place {
            "still" => format!("{floor}</shape>"),
            "instance" => format!(
                r#"<shape type="shapegroup" id="g">{floor}</shape></shape><shape type="instance"><ref id="g"/>
                <transform name="to_world"><scale x="0.5" y="2" z="1.5"/></transform></shape>"#
            ),
            _ => format!(
                r#"{floor}<animation name="to_world"><transform time="0"><scale x="0.5"/></transform>
                <transform time="1"><scale x="1.5"/><translate z="-2"/></transform></animation></shape>"#
            ),
        };
        let scene = format!(
            r#"<scene version="3.0.0"><integrator type="direct"/><emitter type="constant"/>
            <sensor type="perspective"><float name="fov" value="50"/>
              <float name="shutter_open" value="0"/><float name="shutter_close" value="1"/>
              <transform name="to_world"><lookat origin="0,1.5,2" target="0,0.8,-10" up="0,1,0"/></transform>
              <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/></film>
            </sensor>
            <bsdf type="twosided" id="tiles"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
              <string name="filename" value="{}"/>{lookup}</texture></bsdf></bsdf>
            {floor}</scene>"#,
            mosaic.display()
        );
        let desc = load_str(&scene, folder.path(), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let options = BuildOptions { texture_filter, ..BuildOptions::default() };
        let integrator = Integrator::from_desc(&desc, &IntegratorOptions::default()).unwrap();
        let scene = Scene::build(&desc, &options).unwrap_or_else(|e| panic!("{e}"));
        render::rgb(&render::Ready { scene, integrator }.picture(4, 2))
    };
    let first = r#"<transform name="to_uv"><scale x="10" y="20"/></transform>"#;
    // (s, t) = (v, 3 u), and back.
    let other = r#"<string name="uv_attribute" value="vertex_other"/>
        <transform name="to_uv"><matrix value="0 3.3333333 0 0  20 0 0 0  0 0 1 0  0 0 0 1"/></transform>"#;
    for place in ["still", "instance", "moving"] {
        let [a, b] = [first, other].map(|lookup| picture(place, lookup, TextureFilter::Footprint));
        let points = picture(place, other, TextureFilter::Point);
        let apart = |x: &[f32], y: &[f32]| {
            let sum: f64 = x.iter().zip(y).map(|(x, y)| f64::from((x - y).abs())).sum();
            sum / y.iter().map(|y| f64::from(*y)).sum::<f64>()
        };
        let (same, filter) = (apart(&b, &a), apart(&points, &a));
        println!("{place}: {same:.6} apart, points {filter:.4}");
        assert!(filter > 0.02, "{place}: the filter changes only {filter}");
        assert!(same < 1e-3, "{place}: {same} from the picture of the first set");
    }
}
