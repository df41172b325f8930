//! Lights from scene files.

use glam::DMat3;

use super::envmap::EnvOptions;
use super::spot::{Cone, Falloff};
use super::{AreaEmission, Constant, Directional, EnvMap, Light, Moving, Point, Projector, Spot, sky_parse};
use crate::desc::{Error, ObjectId, Params, Result, SceneDesc};
use crate::math::{DVec3, Motion, Rgb, Transform};
use crate::texture::{Texture, Usage, attribute_texture, texture_param, texture_param_opt};

/// Reads the `<emitter>` object `id`, any kind but `area`. World positions
/// have `recentre` subtracted in f64; `shutter` is when it opens and closes in
/// the time of the file. Fails with the place in the file on anything that is
/// wrong or unknown.
pub fn emitter_from_desc(
    scene: &SceneDesc,
    id: ObjectId,
    recentre: DVec3,
    shutter: [f64; 2],
) -> Result<Light> {
    let params = scene.params(id);
    let weight = weight(&params)?;
    let light = match params.object().plugin.as_str() {
        "point" => point(&params, (recentre, shutter), weight)?,
        "spot" => spot(&params, (recentre, shutter), weight)?,
        "projector" => projector(&params, recentre, weight)?.into(),
        "directional" => directional(&params, shutter, weight)?,
        "constant" => {
            params.transform("to_world")?;
            Constant { radiance: colour(&params, "radiance")?, weight }.into()
        }
        "envmap" => envmap(&params, weight)?.into(),
        "sunsky" => sky_parse::sun_sky(&params, weight)?.into(),
        name @ ("area" | "directionalarea") => {
            return Err(params
                .error(format!("emitter `{name}` must stand inside a shape"))
                .hint("move it into the `<shape>` that is to glow"));
        }
        other => {
            return Err(params
                .error(format!("there is no emitter `{other}`"))
                .suggest(other, Light::NAMES.iter().copied()));
        }
    };
    params.finish()?;
    Ok(light)
}

/// Reads the `<emitter type="area">` object `id` of a shape.
pub fn area_emission_from_desc(scene: &SceneDesc, id: ObjectId) -> Result<AreaEmission> {
    let params = scene.params(id);
    let plugin = params.object().plugin.as_str();
    if plugin != "area" && plugin != "directionalarea" {
        return Err(params
            .error(format!("a shape cannot hold an emitter `{plugin}`"))
            .hint("a shape glows by `<emitter type=\"area\">`"));
    }
    let weight = weight(&params)?;
    let radiance = texture_param(&params, "radiance", Rgb::ONE, Usage::Radiance)?;
    if radiance.reads_attributes() {
        return Err(params
            .error_at("radiance", "`radiance` cannot be read from attributes of the mesh")
            .hint("a `bitmap` over the mesh's own texture coordinates can"));
    }
    let both_sides = plugin == "area" && params.bool("two_sided", false)?;
    let mut tints = Vec::new();
    for name in ["vertex_color", "vertex_alpha"] {
        if plugin == "area" && params.bool(name, false)? {
            tints.push(attribute_texture(&params, name)?);
        }
    }
    params.finish()?;
    Ok(AreaEmission { radiance, both_sides, tints, weight })
}

fn weight(params: &Params) -> Result<f32> {
    let weight = params.float("sampling_weight", 1.0)?;
    if !(weight >= 0.0) || !(weight as f32).is_finite() {
        return Err(params.error_at(
            "sampling_weight",
            format!("`sampling_weight` must be finite and not negative, found {weight}"),
        ));
    }
    Ok(weight as f32)
}

/// A colour that does not vary, default 1.
fn colour(params: &Params, name: &'static str) -> Result<Rgb> {
    colour_of(params, name, Rgb::ONE, Usage::Radiance)
}

pub(super) fn colour_of(params: &Params, name: &'static str, default: Rgb, usage: Usage) -> Result<Rgb> {
    match texture_param(params, name, default, usage)? {
        Texture::Constant(c) => Ok(c),
        _ => {
            let plugin = &params.object().plugin;
            Err(params
                .error_at(name, format!("`{name}` of emitter `{plugin}` must be a colour, not a texture")))
        }
    }
}

fn only_one(params: &Params, a: &'static str, b: &'static str) -> Result<()> {
    if params.has(a) && params.has(b) {
        return Err(params.error_at(b, format!("give either `{a}` or `{b}`, not both")));
    }
    Ok(())
}

/// `to_world` while the shutter is open: standing still, or in motion.
fn way(params: &Params, [open, close]: [f64; 2]) -> Result<(Transform, Option<Motion>)> {
    let motion = params.motion("to_world")?.during(open, close);
    Ok(match motion.as_still() {
        Some(still) => (still, None),
        None => (motion.at(0.0), Some(motion)),
    })
}

/// As [`way`], to the recentred world.
fn way_from(params: &Params, (recentre, shutter): Space) -> Result<(Transform, Option<Motion>)> {
    let to_scene = Transform::translate(-recentre);
    let (first, motion) = way(params, shutter)?;
    Ok((to_scene.after(&first), motion.map(|m| m.map(|t| to_scene.after(t)))))
}

/// What is subtracted from positions, and when the shutter opens and closes.
type Space = (DVec3, [f64; 2]);

fn point(params: &Params, space: Space, weight: f32) -> Result<Light> {
    only_one(params, "position", "to_world")?;
    let (position, motion) = match params.vector_opt("position")? {
        Some(position) => (position - space.0, None),
        None => {
            let (first, motion) = way_from(params, space)?;
            (first.point(DVec3::ZERO), motion)
        }
    };
    let intensity = colour(params, "intensity")?;
    let point = Point { intensity, position: position.as_vec3(), weight };
    Ok(match motion {
        None => point.into(),
        Some(motion) => Moving::point(point, motion).into(),
    })
}

fn spot(params: &Params, space: Space, weight: f32) -> Result<Light> {
    let intensity = colour(params, "intensity")?;
    let (to_world, motion) = way_from(params, space)?;
    let texture = texture_param_opt(params, "texture", Usage::Radiance)?;
    if matches!(texture, Some(Texture::Constant(_))) {
        return Err(params
            .error_at("texture", "`texture` of emitter `spot` must be a texture, not a colour")
            .hint("put the colour into `intensity`"));
    }
    let cutoff = params.float("cutoff_angle", 20.0)?;
    let widest = if texture.is_some() { 90.0 } else { 180.0 };
    if !(cutoff > 0.0 && cutoff <= widest) || (texture.is_some() && cutoff == widest) {
        let range =
            if texture.is_some() { "between 0 and 90 degrees with a texture" } else { "in (0, 180] degrees" };
        return Err(
            params.error_at("cutoff_angle", format!("`cutoff_angle` must lie {range}, found {cutoff}"))
        );
    }
    let beam = params.float("beam_width", 0.75 * cutoff)?;
    if !(beam >= 0.0 && beam <= cutoff) {
        return Err(params.error_at(
            "beam_width",
            format!("`beam_width` must lie between 0 and `cutoff_angle` ({cutoff}) degrees, found {beam}"),
        ));
    }
    let falloff = match params.choice("falloff", &["linear", "squared"], "linear")? {
        "squared" => Falloff::Squared,
        _ => Falloff::Linear,
    };
    let cone = Cone { cutoff: cutoff.to_radians(), beam: beam.to_radians(), falloff };
    let mut spot = Spot::new(intensity, &to_world, cone, texture);
    spot.weight = weight;
    Ok(match motion {
        None => spot.into(),
        Some(motion) => Moving::spot(spot, motion).into(),
    })
}

fn projector(params: &Params, recentre: DVec3, weight: f32) -> Result<Projector> {
    let irradiance = texture_param(params, "irradiance", Rgb::ONE, Usage::Radiance)?;
    let scale = params.float("scale", 1.0)?;
    if !(scale >= 0.0) || !(scale as f32).is_finite() {
        let message = format!("`scale` must be finite and not negative, found {scale}");
        return Err(params.error_at("scale", message));
    }
    let to_world = Transform::translate(-recentre).after(&params.transform("to_world")?);
    let fov = params.x_fov_deg(irradiance.aspect())?;
    Ok(Projector::new(irradiance, scale, &to_world, fov, weight))
}

fn directional(params: &Params, shutter: [f64; 2], weight: f32) -> Result<Light> {
    only_one(params, "direction", "to_world")?;
    let (name, along, motion) = match params.vector_opt("direction")? {
        Some(direction) => ("direction", direction, None),
        None => {
            let (first, motion) = way(params, shutter)?;
            ("to_world", first.vector(DVec3::Z), motion)
        }
    };
    let along = along
        .try_normalize()
        .ok_or_else(|| params.error_at(name, format!("`{name}` gives no direction: its length is zero")))?;
    let light = Directional { irradiance: colour(params, "irradiance")?, towards: -along.as_vec3(), weight };
    Ok(match motion {
        None => light.into(),
        Some(motion) => Moving::directional(light, motion).into(),
    })
}

fn envmap(params: &Params, weight: f32) -> Result<EnvMap> {
    params.string_opt("filename")?;
    let scale = params.float("scale", 1.0)?;
    if !(scale >= 0.0) || !(scale as f32).is_finite() {
        return Err(
            params.error_at("scale", format!("`scale` must be finite and not negative, found {scale}"))
        );
    }
    let options = EnvOptions {
        scale: scale as f32,
        to_world: rotation(params)?,
        mis_compensation: params.bool("mis_compensation", false)?,
        weight,
    };
    let image = params.image().ok_or_else(|| params.error("emitter `envmap` needs an image `filename`"))?;
    EnvMap::new(image.clone(), &options).map_err(|e| {
        let Error { message, hint, .. } = e;
        let error = params.error_at("filename", message);
        match hint {
            Some(hint) => error.hint(hint),
            None => error,
        }
    })
}

/// The linear part of `to_world`, made exactly orthonormal.
pub(super) fn rotation(params: &Params) -> Result<DMat3> {
    let m = DMat3::from_mat4(params.transform("to_world")?.matrix);
    let off = m.transpose() * m - DMat3::IDENTITY;
    if off.to_cols_array().iter().any(|x| !(x.abs() < 1e-3)) {
        return Err(params
            .error_at(
                "to_world",
                format!("`to_world` of emitter `{}` must not scale", params.object().plugin),
            )
            .hint("it may rotate and mirror"));
    }
    // Gram–Schmidt; the handedness stays.
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    let z = m.z_axis - x * x.dot(m.z_axis);
    let z = (z - y * y.dot(z)).normalize();
    Ok(DMat3::from_cols(x, y, z))
}
