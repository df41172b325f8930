//! Lights of `KHR_lights_punctual`, and those of the command line.

use std::path::Path;
use std::sync::Arc;

use super::super::{LoadOptions, files, image_file};
use super::fail;
use super::json::Spot;
use super::motion::Stage;
use super::objects::Objects;
use super::place::{self, Placement};
use super::source::Source;
use crate::desc::{Category, Pos, Result, Value};
use crate::math::{DMat4, DVec3};

/// Turns what looks along −z with +x to the right into what looks along +z with
/// +x to the left.
pub fn turned(m: DMat4) -> DMat4 {
    m * DMat4::from_scale(DVec3::new(-1.0, 1.0, -1.0))
}

/// The light of a node in a scene of that size. `range` only tells rasterisers
/// where to stop.
pub fn add(objects: &mut Objects, source: &Source, stage: &Stage, (node, size): (usize, f64)) -> Result<()> {
    let Some(reference) = &source.root.nodes[node].extensions.light else { return Ok(()) };
    let node_place = format!("nodes[{node}].extensions.KHR_lights_punctual");
    let lights = &source.root.extensions.lights.lights;
    let Some(light) = lights.get(reference.light) else {
        return Err(fail(&node_place, format!("there is no light {}", reference.light)));
    };
    let at = format!("extensions.KHR_lights_punctual.lights[{}]", reference.light);
    let pos = objects.pos(&at);
    let intensity = light.intensity.unwrap_or(1.0);
    let color = light.color.unwrap_or([1.0; 3]);
    if !(intensity >= 0.0) || color.iter().any(|c| !(*c >= 0.0)) {
        return Err(fail(&at, "a light cannot take light away (`intensity`, `color`)"));
    }
    let power = Value::Rgb(color.map(|c| c * intensity));
    // A lamp is as far off its way as the scene is large, times a tolerance.
    let points = [DVec3::ZERO, DVec3::X * size, DVec3::Y * size, DVec3::Z * size];
    let placement = place::follow(stage, node, &points, |m| turned(place::rigid(m)))
        .ok_or_else(|| fail(&node_place, "its transform is not finite"))?;
    let rigid = placement.first().matrix;
    let still = matches!(placement, Placement::Still(_));
    let moving = || ("to_world", placement.value());
    let emitter = match light.kind.as_str() {
        "point" => {
            let position = || ("position", Value::Vector(rigid.w_axis.truncate()));
            let place = if still { position() } else { moving() };
            objects.add(Category::Emitter, "point", pos, vec![("intensity", power), place])
        }
        "directional" => {
            let direction = || ("direction", Value::Vector(rigid.z_axis.truncate()));
            let params = vec![("irradiance", power), if still { direction() } else { moving() }];
            objects.add(Category::Emitter, "directional", pos, params)
        }
        "spot" => {
            let [outer, inner] = cone(&light.spot, &at)?;
            let params = vec![
                ("intensity", power),
                ("cutoff_angle", Value::Float(outer)),
                ("beam_width", Value::Float(inner)),
                ("falloff", Value::String("squared".into())),
                moving(),
            ];
            objects.add(Category::Emitter, "spot", pos, params)
        }
        other => {
            return Err(fail(&at, format!("`type` `{other}` is unknown"))
                .suggest(other, ["directional", "point", "spot"]));
        }
    };
    if !light.name.is_empty() {
        objects.name(emitter, light.name.clone());
    }
    objects.show(emitter);
    Ok(())
}

/// Outer and inner angle of a spot's cone, in degrees.
fn cone(spot: &Spot, at: &str) -> Result<[f64; 2]> {
    let outer = spot.outer_cone_angle.unwrap_or(std::f64::consts::FRAC_PI_4);
    let inner = spot.inner_cone_angle.unwrap_or(0.0);
    if !(inner >= 0.0 && inner < outer && outer <= std::f64::consts::FRAC_PI_2 + 1e-6) {
        let message = format!("cone angles must be 0 ≤ inner < outer ≤ π/2, found {inner} and {outer}");
        return Err(fail(&format!("{at}.spot"), message));
    }
    Ok([outer.to_degrees(), inner.to_degrees()])
}

/// Lights that the options ask for, and a white surrounding where there would
/// be no light at all.
pub fn surroundings(objects: &mut Objects, options: &LoadOptions, lit: bool) -> Result<()> {
    if let Some([elevation, azimuth]) = options.sun {
        let (up, round) = (elevation.to_radians(), azimuth.to_radians());
        // Azimuth 0 is +z, where the front of a model looks, and 90 is +x.
        let towards = DVec3::new(up.cos() * round.sin(), up.sin(), up.cos() * round.cos());
        let params = vec![("irradiance", Value::Rgb(SUN)), ("direction", Value::Vector(-towards))];
        let sun = objects.add(Category::Emitter, "directional", Pos::default(), params);
        objects.show(sun);
    }
    let surrounding = match (&options.environment, options.sun) {
        (Some(path), _) => environment(objects, path, options)?,
        (None, Some(_)) => constant(objects, SKY),
        (None, None) if !lit => {
            let message = "has no light: a white surrounding is added (--env or --sun give others)";
            let warning = format!("{} {message}", objects.desc.files[0]);
            objects.desc.warnings.push(warning);
            constant(objects, [1.0; 3])
        }
        (None, None) => return Ok(()),
    };
    objects.show(surrounding);
    Ok(())
}

/// Irradiance of `--sun`: what faces it straight and reflects all has radiance 1.
const SUN: [f64; 3] = [std::f64::consts::PI; 3];
/// Radiance of the sky around it.
const SKY: [f64; 3] = [0.2, 0.3, 0.5];

fn constant(objects: &mut Objects, radiance: [f64; 3]) -> crate::desc::ObjectId {
    objects.add(Category::Emitter, "constant", Pos::default(), vec![("radiance", Value::Rgb(radiance))])
}

fn environment(objects: &mut Objects, path: &Path, options: &LoadOptions) -> Result<crate::desc::ObjectId> {
    let name = path.display().to_string();
    let found = files::find(&name, &[std::path::PathBuf::new()])?;
    let image = image_file::read(&found, &name, options.max_image_bytes)?;
    let image = objects.image(Arc::new(image));
    let params = vec![("filename", Value::String(name)), ("image", Value::Image(image))];
    Ok(objects.add(Category::Emitter, "envmap", Pos::default(), params))
}
