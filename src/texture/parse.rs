//! Textures from scene files: a parameter that is a number, a colour, a
//! spectrum, or a nested `<texture>`.

use super::bitmap::Lookup;
use super::{Attribute, Bitmap, Checkerboard, FilterType, MAX_ATTRIBUTES, Texture, WrapMode};
use crate::color::{reflectance_spectrum_to_rgb, spectrum_to_rgb};
use crate::desc::{Category, Error, ObjectId, Params, Pos, Result, SceneDesc, Value};
use crate::math::{DVec3, Rgb};

/// What a texture is read for: decides which values make sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usage {
    /// A share of light: numbers and colours must lie in \[0, 1\], texels must
    /// not be negative. (Texels above 1 are kept, as in Mitsuba, which warns;
    /// [`Texture::max`] tells.)
    Reflectance,
    /// Emission: finite and not negative, no upper end.
    Radiance,
    /// Any finite number: roughness, opacity, height.
    Scalar,
    /// A normal map: finite; a bitmap is `raw` unless the file says otherwise.
    Vector,
}

impl Usage {
    /// The least value that makes sense.
    fn least(self) -> f32 {
        match self {
            Usage::Reflectance | Usage::Radiance => 0.0,
            Usage::Scalar | Usage::Vector => f32::NEG_INFINITY,
        }
    }
}

/// Reads the parameter `name`, or gives the constant `default`. Fails with
/// the place in the file on a wrong type, a value that makes no sense for
/// `usage`, a bad texel, or a parameter that the nested texture does not know.
pub fn texture_param(params: &Params, name: &'static str, default: Rgb, usage: Usage) -> Result<Texture> {
    Ok(texture_param_opt(params, name, usage)?.unwrap_or(Texture::Constant(default)))
}

/// Reads the parameter `name` if it is given; otherwise as [`texture_param`].
pub fn texture_param_opt(params: &Params, name: &'static str, usage: Usage) -> Result<Option<Texture>> {
    let Some(param) = params.get(name) else { return Ok(None) };
    let scene = params.scene();
    let constant = |c: Rgb| constant(scene, param.pos, name, c, usage).map(Some);
    match &param.value {
        Value::Float(v) => constant(Rgb::splat(*v as f32)),
        Value::Int(v) => constant(Rgb::splat(*v as f32)),
        Value::Rgb(c) => constant(DVec3::from(*c).as_vec3()),
        Value::Spectrum(pairs) => constant(spectrum(pairs, usage)),
        Value::Vector(v) => constant(v.as_vec3()),
        Value::Object(id) if scene.object(*id).category == Category::Texture => {
            texture_from_desc(scene, *id, usage).map(Some)
        }
        other => Err(scene.error(
            param.pos,
            format!("`{name}` must be a number, a colour or a texture, found {}", other.type_name()),
        )),
    }
}

/// RGB of a spectrum: an emission as it is, anything else as seen under D65. A
/// reflectance out of gamut is clamped to \[0, 1\], as Mitsuba does.
fn spectrum(pairs: &[(f64, f64)], usage: Usage) -> Rgb {
    match usage {
        Usage::Radiance => spectrum_to_rgb(pairs),
        Usage::Reflectance => reflectance_spectrum_to_rgb(pairs).clamp(Rgb::ZERO, Rgb::ONE),
        Usage::Scalar | Usage::Vector => reflectance_spectrum_to_rgb(pairs),
    }
}

fn constant(scene: &SceneDesc, pos: Pos, name: &str, c: Rgb, usage: Usage) -> Result<Texture> {
    let range = match usage {
        _ if !c.is_finite() => "be finite",
        Usage::Reflectance if c.min_element() < 0.0 || c.max_element() > 1.0 => "lie in [0, 1]",
        Usage::Radiance if c.min_element() < 0.0 => "not be negative",
        _ => return Ok(Texture::Constant(c)),
    };
    let value = if c.x == c.y && c.y == c.z { c.x.to_string() } else { format!("{}, {}, {}", c.x, c.y, c.z) };
    Err(scene.error(pos, format!("`{name}` must {range}, found {value}")))
}

/// The texture of a `<texture>` object; fails as [`texture_param`] does.
pub fn texture_from_desc(scene: &SceneDesc, id: ObjectId, usage: Usage) -> Result<Texture> {
    let params = scene.params(id);
    let texture = match params.object().plugin.as_str() {
        "bitmap" => bitmap(&params, usage)?,
        "checkerboard" => Checkerboard::new(
            texture_param(&params, "color0", Rgb::splat(0.4), usage)?,
            texture_param(&params, "color1", Rgb::splat(0.2), usage)?,
            &params.transform("to_uv")?,
        )
        .into(),
        "mesh_attribute" => {
            let name = params
                .string_opt("name")?
                .ok_or_else(|| params.error("texture `mesh_attribute` needs a `name`"))?;
            let slot = attribute_slot(&params, "name", name)?;
            Texture::Attribute(Attribute { slot, scale: params.rgb("scale", Rgb::ONE)? })
        }
        "srgb" | "rgb" => {
            let name = if params.has("value") { "value" } else { "color" };
            required(&params, name, usage)?
        }
        "uniform" | "rawconstant" => required(&params, "value", usage)?,
        "d65" => texture_param(&params, "scale", Rgb::ONE, usage)?,
        other => {
            return Err(params
                .error(format!("unknown texture `{other}`"))
                .suggest(other, Texture::NAMES.iter().copied()));
        }
    };
    params.finish()?;
    Ok(texture)
}

fn required(params: &Params, name: &'static str, usage: Usage) -> Result<Texture> {
    texture_param_opt(params, name, usage)?
        .filter(|t| matches!(t, Texture::Constant(_)))
        .ok_or_else(|| params.error(format!("texture `{}` needs a colour `{name}`", params.object().plugin)))
}

/// The slot of a mesh attribute.
fn attribute_slot(params: &Params, parameter: &str, name: &str) -> Result<u8> {
    let names = params.scene().attribute_names();
    match names.iter().position(|n| n == name) {
        Some(slot) if slot < MAX_ATTRIBUTES => Ok(slot as u8),
        _ => Err(params
            .error_at(parameter, format!("textures read more than {MAX_ATTRIBUTES} attributes of meshes"))
            .hint("put several numbers into one attribute")),
    }
}

/// A mesh attribute by name, as a texture.
pub fn attribute_texture(params: &Params, name: &str) -> Result<Texture> {
    Ok(Texture::Attribute(Attribute { slot: attribute_slot(params, name, name)?, scale: Rgb::ONE }))
}

fn bitmap(params: &Params, usage: Usage) -> Result<Texture> {
    params.string_opt("filename")?;
    // Both change only how Mitsuba stores the image: read to check them.
    params.choice("format", &["auto", "variant", "fp16"], "auto")?;
    params.bool("accel", true)?;
    let filter_type = match params.choice("filter_type", &["bilinear", "nearest"], "bilinear")? {
        "nearest" => FilterType::Nearest,
        _ => FilterType::Bilinear,
    };
    const MODES: &[&str] = &["repeat", "mirror", "clamp"];
    let both = params.choice("wrap_mode", MODES, "repeat")?;
    let wrap = |name| -> Result<WrapMode> {
        Ok(match params.choice(name, MODES, both)? {
            "mirror" => WrapMode::Mirror,
            "clamp" => WrapMode::Clamp,
            _ => WrapMode::Repeat,
        })
    };
    let channel = match params.choice("channel", &["rgb", "r", "g", "b", "a"], "rgb")? {
        "r" => Some(0),
        "g" => Some(1),
        "b" => Some(2),
        "a" => Some(3),
        _ => None,
    };
    let uv_slot = match params.string_opt("uv_attribute")? {
        Some(name) => Some(attribute_slot(params, "uv_attribute", name)?),
        None => None,
    };
    let lookup = Lookup {
        filter_type,
        wrap: [wrap("wrap_mode_u")?, wrap("wrap_mode_v")?],
        to_uv: params.transform("to_uv")?,
        raw: params.bool("raw", usage == Usage::Vector)?,
        channel,
        scale: params.rgb("scale", Rgb::ONE)?,
        uv_slot,
    };
    let image = params.image().ok_or_else(|| params.error("texture `bitmap` needs an image `filename`"))?;
    let place = |e: Error| {
        let Error { message, hint, .. } = e;
        let error = params.error_at("filename", message);
        match hint {
            Some(hint) => error.hint(hint),
            None => error,
        }
    };
    Ok(Bitmap::new(image.clone(), &lookup, usage.least()).map_err(place)?.into())
}
