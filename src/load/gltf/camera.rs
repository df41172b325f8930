//! Cameras, and one that sees everything where the file has none.

use super::super::LoadOptions;
use super::json::{Camera, Orthographic, Perspective};
use super::light::turned;
use super::motion::Stage;
use super::objects::Objects;
use super::source::Source;
use super::{choose, fail, place};
use crate::desc::{Category, Error, Pos, Result, Value};
use crate::math::{DMat4, DVec3, Transform};

/// Width of the film in pixels, and its height without a camera that says.
const WIDTH: f64 = 1280.0;
const HEIGHT: f64 = 720.0;
/// Samples per pixel.
const SAMPLES: i64 = 64;
/// Vertical field of view of the camera that is made up, in degrees.
const FOV: f64 = 35.0;
/// Where it looks from: over the right shoulder of what looks at us.
const FROM: DVec3 = DVec3::new(0.45, 0.35, 1.0);
/// A far plane that cuts nothing.
const FAR: f64 = 1e30;

/// Adds the sensor. `low` and `high` are the box around all shapes.
pub fn add(
    objects: &mut Objects,
    source: &Source,
    stage: &Stage,
    visible: &[usize],
    options: &LoadOptions,
    (low, high): (DVec3, DVec3),
) -> Result<()> {
    let Some((node, index)) = chosen(source, visible, options)? else {
        if let Some(wanted) = &options.camera {
            return Err(Error::new(format!("the scene shows no camera, so not `{wanted}`")));
        }
        framing(objects, stage, low, high);
        return Ok(());
    };
    let at = format!("cameras[{index}]");
    let camera = &source.root.cameras[index];
    let size = (high - low).length().max(1e-6);
    let (plugin, mut params, scale) = match (camera.kind.as_str(), &camera.perspective, &camera.orthographic)
    {
        ("perspective", Some(p), _) => ("perspective", perspective(p, &at)?, DVec3::ONE),
        ("orthographic", _, Some(o)) => {
            check_orthographic(o, &at)?;
            ("orthographic", clip(o.znear, Some(o.zfar), &at)?, DVec3::new(o.xmag.abs(), o.xmag.abs(), 1.0))
        }
        ("perspective" | "orthographic", ..) => {
            return Err(fail(&at, format!("needs `{}`", camera.kind)));
        }
        (other, ..) => {
            return Err(fail(&at, format!("`type` `{other}` is unknown"))
                .suggest(other, ["orthographic", "perspective"]));
        }
    };
    let points = [DVec3::ZERO, DVec3::X * size, DVec3::Y * size, DVec3::Z * size];
    let placed = place::follow(stage, node, &points, |m| turned(place::rigid(m)) * DMat4::from_scale(scale));
    let placed =
        placed.ok_or_else(|| fail(&format!("nodes[{node}]"), "the camera's transform is not finite"))?;
    params.push(("to_world", placed.value()));
    params.extend(shutter(stage));
    let pos = objects.pos(&at);
    sensor(objects, plugin, pos, params, aspect(camera));
    Ok(())
}

/// The node and the camera that are looked through.
fn chosen(source: &Source, visible: &[usize], options: &LoadOptions) -> Result<Option<(usize, usize)>> {
    let mut shown = Vec::new();
    for &node in visible {
        let Some(camera) = source.root.nodes[node].camera else { continue };
        if camera >= source.root.cameras.len() {
            return Err(fail(&format!("nodes[{node}].camera"), format!("there is no cameras[{camera}]")));
        }
        shown.push((node, camera));
    }
    let Some(wanted) = options.camera.as_deref() else {
        // The first by the order of the nodes in the file.
        return Ok(shown.into_iter().min());
    };
    // By the name of its node, or its own, or its index.
    if let Some(found) = shown.iter().find(|(node, _)| source.root.nodes[*node].name == wanted) {
        return Ok(Some(*found));
    }
    if shown.is_empty() {
        return Ok(None);
    }
    let index = choose("camera", wanted, source.root.cameras.iter().map(|c| c.name.as_str()))?;
    match shown.iter().find(|(_, camera)| *camera == index) {
        Some(found) => Ok(Some(*found)),
        None => Err(fail(&format!("cameras[{index}]"), "is not in the scene that is shown")),
    }
}

/// When the shutter opens and closes, if it does not do so at once.
fn shutter(stage: &Stage) -> Vec<(&'static str, Value)> {
    let Some(open) = stage.shutter.open.filter(|open| *open < stage.shutter.close) else { return Vec::new() };
    vec![("shutter_open", Value::Float(open)), ("shutter_close", Value::Float(stage.shutter.close))]
}

/// Width over height.
fn aspect(camera: &Camera) -> Option<f64> {
    let ratio = match (&camera.perspective, &camera.orthographic) {
        (Some(p), _) => p.aspect_ratio?,
        (None, Some(o)) => (o.xmag / o.ymag).abs(),
        (None, None) => return None,
    };
    (ratio.is_finite() && ratio > 1e-2 && ratio < 1e2).then_some(ratio)
}

fn perspective(p: &Perspective, at: &str) -> Result<Vec<(&'static str, Value)>> {
    let fov = p.yfov.to_degrees();
    if !(fov > 0.0 && fov < 180.0) {
        return Err(fail(
            &format!("{at}.perspective.yfov"),
            format!("must lie between 0 and π, found {}", p.yfov),
        ));
    }
    let mut params = clip(p.znear, p.zfar, at)?;
    params.push(("fov", Value::Float(fov)));
    params.push(("fov_axis", Value::String("y".into())));
    Ok(params)
}

fn check_orthographic(o: &Orthographic, at: &str) -> Result<()> {
    if [o.xmag, o.ymag].iter().all(|m| m.is_finite() && *m != 0.0) {
        return Ok(());
    }
    Err(fail(&format!("{at}.orthographic"), "`xmag` and `ymag` must not be 0"))
}

/// Clip planes. One at 0, as orthographic cameras have it, is moved out a
/// little: rays start in front of it.
fn clip(near: f64, far: Option<f64>, at: &str) -> Result<Vec<(&'static str, Value)>> {
    let far = far.filter(|f| f.is_finite()).unwrap_or(FAR);
    if !(near >= 0.0 && near < far) {
        let message = format!("`znear` and `zfar` must be 0 ≤ znear < zfar, found {near} and {far}");
        return Err(fail(at, message));
    }
    Ok(vec![("near_clip", Value::Float(near.max(1e-9))), ("far_clip", Value::Float(far))])
}

/// A camera that sees the whole box from the front, a little from the right
/// and from above.
fn framing(objects: &mut Objects, stage: &Stage, low: DVec3, high: DVec3) {
    let (centre, size) = ((low + high) * 0.5, (high - low).length().max(1e-6));
    let back = FROM.normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let tangent = (0.5 * FOV).to_radians().tan();
    let aspect = WIDTH / HEIGHT;
    // Far enough for each corner to lie within both fields of view.
    let distance = place::corners(low, high).iter().fold(0.0_f64, |far, corner| {
        let p = *corner - centre;
        let across = (p.dot(right).abs() / aspect).max(p.dot(up).abs()) / tangent;
        far.max(across + p.dot(back))
    });
    let distance = (distance * 1.08).max(size * 0.6);
    let eye = centre + back * distance;
    let m = DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0));
    let to_world = Transform::from_matrix(turned(m)).unwrap_or_default();
    let mut params = vec![
        ("fov", Value::Float(FOV)),
        ("fov_axis", Value::String("y".into())),
        ("near_clip", Value::Float(size * 1e-4)),
        ("far_clip", Value::Float(FAR)),
        ("to_world", Value::Transform(to_world)),
    ];
    params.extend(shutter(stage));
    let show = |v: DVec3| format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z);
    let warning =
        format!("{} shows no camera: one at {} looks at {}", objects.desc.files[0], show(eye), show(centre));
    objects.desc.warnings.push(warning);
    sensor(objects, "perspective", Pos::default(), params, None);
}

fn sensor(
    objects: &mut Objects,
    plugin: &str,
    pos: Pos,
    mut params: Vec<(&'static str, Value)>,
    aspect: Option<f64>,
) {
    let height = aspect.map_or(HEIGHT, |a| (WIDTH / a).round().clamp(1.0, 1e5));
    let size = vec![("width", Value::Int(WIDTH as i64)), ("height", Value::Int(height as i64))];
    let film = objects.add(Category::Film, "hdrfilm", pos, size);
    let count = vec![("sample_count", Value::Int(SAMPLES))];
    let sampler = objects.add(Category::Sampler, "independent", pos, count);
    params.push(("", Value::Object(film)));
    params.push(("", Value::Object(sampler)));
    let sensor = objects.add(Category::Sensor, plugin, pos, params);
    objects.show(sensor);
}
