//! Cameras from scene files.

use glam::DVec2;

use super::aperture::Aperture;
use super::{Camera, Clip, FilmSize, Fisheye, Orthographic, Perspective, Pose, Spherical, ThinLens};
use crate::desc::{Category, ObjectId, Params, Result, SceneDesc};
use crate::math::{DVec3, Motion, Transform};

/// Where the camera of the `<sensor>` object `id` stands in the world: what to
/// recentre the scene on.
pub fn camera_position(scene: &SceneDesc, id: ObjectId) -> Result<DVec3> {
    Ok(pose_at_opening(scene, id)?.point(DVec3::ZERO))
}

/// When the shutter opens and closes, in the unit of the scene's animations.
pub fn shutter(scene: &SceneDesc, id: ObjectId) -> Result<[f64; 2]> {
    shutter_of(&scene.params(id))
}

/// The camera's motion over the shutter, [0, 1], in the scene's own world.
pub(super) fn motion(scene: &SceneDesc, id: ObjectId) -> Result<Motion> {
    let [open, close] = shutter(scene, id)?;
    Ok(scene.params(id).motion("to_world")?.during(open, close))
}

fn pose_at_opening(scene: &SceneDesc, id: ObjectId) -> Result<Transform> {
    Ok(motion(scene, id)?.at(0.0))
}

pub(super) fn camera(scene: &SceneDesc, id: ObjectId, film: FilmSize, recentre: DVec3) -> Result<Camera> {
    let params = scene.params(id);
    params.get("to_world");
    let to_world = pose_at_opening(scene, id)?;
    let pose = Pose::new(to_world, recentre);
    let clip = clip(&params)?;
    let focus_distance = positive(&params, "focus_distance", clip.far)?;
    shutter_of(&params)?;
    // Built by the rooms that own them.
    params.children(Category::Film);
    params.children(Category::Sampler);
    params.children(Category::Medium);

    let camera = match params.object().plugin.as_str() {
        "perspective" => {
            rigid(&params, scene, id)?;
            let offset = principal_point(&params)?;
            Perspective::new(pose, film, clip, params.x_fov_deg(film.aspect())?, offset).into()
        }
        "thinlens" => {
            rigid(&params, scene, id)?;
            let offset = principal_point(&params)?;
            let pinhole = Perspective::new(pose, film, clip, params.x_fov_deg(film.aspect())?, offset);
            let aperture_radius = params
                .float_opt("aperture_radius")?
                .ok_or_else(|| params.error("sensor `thinlens` needs an `aperture_radius`"))?;
            if !(aperture_radius >= 0.0) {
                return Err(params.error_at(
                    "aperture_radius",
                    format!("`aperture_radius` must not be negative, found {aperture_radius}"),
                ));
            }
            let aperture = aperture(&params, aperture_radius)?;
            let focus_distance = focus(&params, &to_world, focus_distance)?;
            let tilt = [tilt(&params, "focus_tilt_x")?, tilt(&params, "focus_tilt_y")?];
            ThinLens::new(pinhole, aperture, focus_distance, tilt).into()
        }
        "orthographic" => Orthographic::new(pose, film, clip).into(),
        "spherical" => {
            rigid(&params, scene, id)?;
            Spherical::new(pose, film, clip).into()
        }
        "fisheye" => {
            rigid(&params, scene, id)?;
            let fov = params.float("fov", 180.0)?;
            if !(fov > 0.0 && fov <= 360.0) {
                let message = format!("`fov` of a fisheye must lie in (0, 360] degrees, found {fov}");
                return Err(params.error_at("fov", message));
            }
            Fisheye::new(pose, film, clip, fov).into()
        }
        other => {
            return Err(params
                .error(format!("there is no sensor `{other}`"))
                .suggest(other, Camera::NAMES.iter().copied()));
        }
    };
    params.finish()?;
    Ok(camera)
}

fn principal_point(params: &Params) -> Result<DVec2> {
    Ok(DVec2::new(
        params.float("principal_point_offset_x", 0.0)?,
        params.float("principal_point_offset_y", 0.0)?,
    ))
}

fn aperture(params: &Params, radius: f64) -> Result<Aperture> {
    let blades = params.int("blades", 0)?;
    let valid = u32::try_from(blades).ok().filter(|n| *n == 0 || (3..=1024).contains(n));
    let Some(blades) = valid else {
        let message = format!("`blades` must be 0 (round) or from 3 to 1024, found {blades}");
        return Err(params.error_at("blades", message));
    };
    let rotation = params.float("blade_rotation", 0.0)?.to_radians();
    Ok(Aperture { radius, blades, rotation, ratio: positive(params, "aperture_ratio", 1.0)? })
}

/// The distance in focus: given, or that of a point.
fn focus(params: &Params, to_world: &Transform, distance: f64) -> Result<f64> {
    let Some(point) = params.vector_opt("focus_point")? else { return Ok(distance) };
    if params.has("focus_distance") {
        let message = "give either `focus_distance` or `focus_point`, not both";
        return Err(params.error_at("focus_point", message));
    }
    let depth = to_world.inverted().point(point).z;
    if depth > 0.0 && depth.is_finite() {
        return Ok(depth);
    }
    Err(params.error_at("focus_point", "`focus_point` must lie in front of the camera"))
}

/// Degrees between −90 and 90, as radians.
fn tilt(params: &Params, name: &'static str) -> Result<f64> {
    let angle = params.float(name, 0.0)?;
    if angle.abs() < 90.0 {
        return Ok(angle.to_radians());
    }
    Err(params.error_at(name, format!("`{name}` must lie between −90 and 90 degrees, found {angle}")))
}

fn positive(params: &Params, name: &'static str, default: f64) -> Result<f64> {
    let value = params.float(name, default)?;
    if !(value > 0.0) {
        return Err(params.error_at(name, format!("`{name}` must be greater than zero, found {value}")));
    }
    Ok(value)
}

fn clip(params: &Params) -> Result<Clip> {
    let near = positive(params, "near_clip", 1e-2)?;
    let far = params.float("far_clip", 1e4)?;
    if !(near < far) {
        let name = if params.has("far_clip") { "far_clip" } else { "near_clip" };
        return Err(
            params.error_at(name, format!("`near_clip` ({near}) must be smaller than `far_clip` ({far})"))
        );
    }
    Ok(Clip { near, far })
}

fn shutter_of(params: &Params) -> Result<[f64; 2]> {
    let open = params.float("shutter_open", 0.0)?;
    let close = params.float("shutter_close", 0.0)?;
    if open > close {
        return Err(params.error_at(
            "shutter_open",
            format!("`shutter_open` ({open}) must not be later than `shutter_close` ({close})"),
        ));
    }
    Ok([open, close])
}

/// A camera of this kind takes rotations, mirrors and translations only, at
/// every key of its motion.
fn rigid(params: &Params, scene: &SceneDesc, id: ObjectId) -> Result<()> {
    let motion = motion(scene, id)?;
    if motion.times().all(|time| is_rigid(&motion.at(time))) {
        return Ok(());
    }
    Err(params
        .error_at("to_world", format!("`to_world` of sensor `{}` must not scale", params.object().plugin))
        .hint("put the scale into the scene, or use `fov`"))
}

fn is_rigid(to_world: &Transform) -> bool {
    let m = to_world.matrix;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.truncate());
    let right = |i: usize, j: usize| {
        let expected = if i == j { 1.0 } else { 0.0 };
        (columns[i].dot(columns[j]) - expected).abs() < 1e-3
    };
    (0..3).all(|i| (0..3).all(|j| right(i, j)))
}
