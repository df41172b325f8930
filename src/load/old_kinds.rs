//! Integrators, films, samplers, textures and shapes of Mitsuba 0.x as those
//! of today.

use super::old::{Old, colour};
use crate::desc::{Category, Result, Value};
use crate::integrator;

/// Integrators that differ only in media that scatter.
const PATHS: &[&str] = &["volpath", "volpath_simple", "volpathmis"];

/// Integrators whose picture, once it has converged, is that of `volpath`: what
/// they are told beside its limits is how to get there.
const SAME_PICTURE: &[&str] =
    &["bdpt", "erpt", "guided_path", "guidedpath", "mlt", "photonmapper", "ppm", "pssmlt", "ptracer", "sppm"];

/// A `<integrator>`.
pub fn integrator(old: &mut Old) -> Result<()> {
    if old.take_bool("strict_normals") == Some(true) {
        old.warn(
            "`strictNormals` has no counterpart: light stays that the geometric and the shading normal \
             do not agree on",
        );
    }
    match old.plugin().as_str() {
        name if PATHS.contains(&name) => old.become_plugin("volpath"),
        "ao" => {
            old.forget(&["shading_samples"]);
            match old.get("ray_length").and_then(|p| super::old::number(&p.value)) {
                Some(length) if length < 0.0 => {
                    old.replace("integrator `ao` needs a `ray_length`", "replaced by no limit")?;
                    old.take("ray_length");
                }
                _ => old.rename("ray_length", "distance"),
            }
        }
        name if SAME_PICTURE.contains(&name) => {
            let text = format!("integrator `{name}` makes way for `volpath`, which makes the same picture");
            plain_path(old);
            old.become_plugin("volpath");
            old.warn(&text);
        }
        name if !integrator::NAMES.contains(&name) => {
            let message = format!("integrator `{name}` is not known; `path` makes the picture its own way");
            old.replace(message, "replaced by `path`")?;
            plain_path(old);
        }
        _ => {}
    }
    Ok(())
}

/// Makes an integrator a path tracer with the limits that it has itself, or
/// that one within has.
pub fn plain_path(old: &mut Old) {
    const LIMITS: [&str; 3] = ["max_depth", "rr_depth", "hide_emitters"];
    if let [inner] = old.children(Category::Integrator)[..] {
        let inner = old.scene.object(inner).params.clone();
        for param in inner.into_iter().filter(|p| LIMITS.contains(&p.name.as_str())) {
            old.set(&param.name, param.value);
        }
    }
    old.keep(&LIMITS);
    old.become_plugin("path");
}

/// A `<medium>`: scattering and absorption are extinction and a share of it.
pub fn medium(old: &mut Old) -> Result<()> {
    if old.plugin() != "homogeneous" || !(old.has("sigma_s") && old.has("sigma_a")) {
        return Ok(());
    }
    let mut take = |name: &str| old.take(name).and_then(|param| colour(&param.value));
    let (Some(scattered), Some(absorbed)) = (take("sigma_s"), take("sigma_a")) else {
        return old.replace("`sigma_s` and `sigma_a` must be colours", "left out");
    };
    let both: [f64; 3] = std::array::from_fn(|i| scattered[i] + absorbed[i]);
    let share = |i: usize| if both[i] > 0.0 { scattered[i] / both[i] } else { 0.0 };
    old.set("albedo", Value::Rgb(std::array::from_fn(share)));
    old.set("sigma_t", Value::Rgb(both));
    Ok(())
}

/// A `<sampler>`: ours have the dimensions they need.
pub fn sampler(old: &mut Old) {
    old.forget(&["dimension", "scramble"]);
}

/// A `<film>`: what is written where and how is the command line's.
pub fn film(old: &mut Old) -> Result<()> {
    const TONE: [&str; 6] = ["tonemap_method", "tone_mapping_method", "gamma", "exposure", "key", "burn"];
    let name = old.plugin();
    if ["ldrfilm", "pngfilm"].contains(&name.as_str()) {
        old.warn(&format!("film `{name}` becomes `hdrfilm`: tone mapping is left to --exposure and --tone"));
        old.forget(&TONE);
    }
    if ["ldrfilm", "pngfilm", "tiledhdrfilm", "exrfilm", "mfilm"].contains(&old.plugin().as_str()) {
        old.become_plugin("hdrfilm");
    }
    old.forget(&["attach_log", "banner", "file_format", "digits", "variable", "channel_names"]);
    let params = &mut old.scene.objects[old.id as usize].params;
    params.retain(|p| !p.name.starts_with("label[") && !p.name.starts_with("metadata["));
    old.rename("high_quality_edges", "sample_border");
    if let Some(alpha) = old.take_bool("alpha") {
        old.set("pixel_format", Value::String(if alpha { "rgba" } else { "rgb" }.into()));
    }
    if let Some(format) = old.word("pixel_format").map(str::to_lowercase) {
        if format.contains("luminance") {
            old.warn("a film of luminance becomes one of colours");
        }
        let alpha = format.contains("alpha") || format.contains("rgba") || format.contains("xyza");
        old.set("pixel_format", Value::String(if alpha { "rgba" } else { "rgb" }.into()));
    }
    let format = old.word("component_format").map(str::to_lowercase);
    if format.is_some_and(|f| f != "float16" && f != "float32") {
        old.replace("a film holds floats here", "replaced by `float32`")?;
        old.take("component_format");
    }
    Ok(())
}

/// A `<texture>`, any but `scale`.
pub fn texture(old: &mut Old) -> Result<()> {
    match old.plugin().as_str() {
        "bitmap" => bitmap(old)?,
        "ldrtexture" | "exrtexture" => {
            old.become_plugin("bitmap");
            bitmap(old)?;
        }
        "vertexcolors" => {
            old.become_plugin("mesh_attribute");
            old.set("name", Value::String("vertex_color".into()));
        }
        "gridtexture" => {
            old.replace("texture `gridtexture` is not known", "replaced by its colour between the lines")?;
            let between = old.take("color0").and_then(|p| colour(&p.value)).unwrap_or([0.2; 3]);
            old.keep(&[]);
            old.become_plugin("rgb");
            old.set("value", Value::Rgb(between));
        }
        _ => {}
    }
    Ok(())
}

fn bitmap(old: &mut Old) -> Result<()> {
    old.forget(&["max_anisotropy", "cache"]);
    // How fine detail is smoothed, which many samples do too.
    if matches!(old.word("filter_type"), Some("ewa" | "trilinear")) {
        old.warn("`filter_type` of a texture becomes `bilinear`");
        old.take("filter_type");
    }
    for name in ["wrap_mode", "wrap_mode_u", "wrap_mode_v"] {
        let Some(word) = old.word(name).map(str::to_owned) else { continue };
        if ["zero", "one", "black", "white"].contains(&word.as_str()) {
            old.replace(format!("`{name}` has no value `{word}`"), "replaced by `clamp`")?;
            old.set(name, Value::String("clamp".into()));
        }
    }
    match old.take_number("gamma") {
        Some(1.0) => old.set("raw", Value::Bool(true)),
        Some(gamma) if gamma > 0.0 => {
            let message = format!("a texture is linear or sRGB here, not of gamma {gamma}");
            old.replace(message, "replaced by sRGB")?;
        }
        _ => {}
    }
    if let Some(word) = old.word("channel").map(str::to_owned)
        && !["r", "g", "b", "a"].contains(&word.as_str())
    {
        old.replace(format!("a texture has no channel `{word}`"), "replaced by all of them")?;
        old.take("channel");
    }
    Ok(())
}

/// The texture `scale`: the product, where it is one of colours.
pub fn scaled_texture(old: &mut Old) -> Result<()> {
    let factor = old.take("scale").map_or(Some([1.0; 3]), |p| colour(&p.value));
    let inner = old.children(Category::Texture).first().copied();
    let plain = old.get("value").and_then(|p| colour(&p.value));
    if let (Some(factor), Some(value)) = (factor, plain) {
        old.keep(&[]);
        old.become_plugin("rgb");
        old.set("value", Value::Rgb([0, 1, 2].map(|i| factor[i] * value[i])));
        return Ok(());
    }
    let Some(inner) = inner else {
        return Err(old.scene.error(old.pos(), "texture `scale` needs something to scale"));
    };
    let inner = old.scene.object(inner).clone();
    let object = &mut old.scene.objects[old.id as usize];
    (object.plugin, object.params) = (inner.plugin, inner.params);
    let own = old.get("scale").map_or(Some([1.0; 3]), |p| colour(&p.value));
    match (old.plugin().as_str(), factor, own) {
        (_, Some([1.0, 1.0, 1.0]), _) => {}
        ("bitmap" | "mesh_attribute", Some(factor), Some(own)) => {
            old.set("scale", Value::Rgb([0, 1, 2].map(|i| factor[i] * own[i])));
        }
        (name, ..) => {
            let message = format!("a texture `{name}` cannot be scaled");
            old.replace(message, "replaced by the texture as it is")?;
        }
    }
    Ok(())
}

/// A `<shape>`.
pub fn shape(old: &mut Old) -> Result<()> {
    match old.plugin().as_str() {
        "obj" | "ply" | "serialized" => {
            old.forget(&["collapse"]);
            if let Some(angle) = old.take_number("max_smooth_angle") {
                if angle != 0.0 {
                    old.replace("normals cannot be split by an angle", "left with the normals of the file")?;
                } else {
                    old.set("face_normals", Value::Bool(true));
                }
            }
        }
        // Leniency leaves it out with all that is unknown.
        name @ ("hair" | "heightfield" | "deformable" | "animatedinstance")
            if !old.scene.leniency.is_lenient() =>
        {
            old.replace(format!("shape `{name}` is not supported"), "left out")?;
        }
        _ => {}
    }
    if let [_, more @ ..] = &old.children(Category::Bsdf)[..]
        && !more.is_empty()
    {
        old.replace("a shape has one bsdf only: `usemtl` does not part it", "left with the first of them")?;
        let first = old.take_children(Category::Bsdf)[0];
        old.nest(first);
    }
    // What only bounds a medium was invisible.
    let bounds_medium = !old.children(Category::Medium).is_empty();
    if bounds_medium && old.children(Category::Bsdf).is_empty() {
        let null = old.add(Category::Bsdf, "null", Vec::new());
        old.nest(null);
    }
    Ok(())
}
