//! Emitters of Mitsuba 0.x as those of today: `sky`, `sun` and `sunsky`.
//!
//! Their frame had y up, x to the east and −z to the north; today's has z up.
//! A sky depends on the zenith and on the sun alone, so the sun's direction in
//! the world and one turn of the frame say it all. The sky was the same model
//! then; the sun was that of Preetham et al. 1999, and is named in a warning.

use glam::DMat3;

use super::old::Old;
use crate::desc::{Category, ObjectId, Result, SceneDesc, Value};
use crate::light::{DATE_PARTS, LEAST_APERTURE_DEG, Observer, SUN_APERTURE_DEG};
use crate::math::{DMat4, DVec3, Transform};

/// Turns an `<emitter>` of an old file into one of today's.
pub fn upgrade(old: &mut Old) -> Result<()> {
    match old.plugin().as_str() {
        "sunsky" | "sky" | "sun" => sun_and_sky(old),
        "envmap" => {
            old.forget(&["cache"]);
            let gamma = old.take_number("gamma").unwrap_or(-1.0);
            // Files of floats are linear as they stand.
            let name = old.word("filename").unwrap_or_default().to_lowercase();
            let linear = [".exr", ".hdr", ".rgbe"].iter().any(|ending| name.ends_with(ending));
            if gamma > 0.0 && !(gamma == 1.0 && linear) {
                let message = format!("an environment is read as its file says, not with gamma {gamma}");
                old.replace(message, "replaced by what the file says")?;
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

fn sun_and_sky(old: &mut Old) -> Result<()> {
    let name = old.plugin();
    let to_world = match old.take("to_world").map(|p| p.value) {
        Some(Value::Transform(t)) => t,
        None => Transform::IDENTITY,
        Some(_) => return Err(old.scene.error(old.pos(), format!("emitter `{name}` cannot move"))),
    };
    let direction = match old.take("sun_direction").map(|p| p.value) {
        Some(Value::Vector(direction)) => direction,
        None => to_world.vector(sun_direction(old)?),
        Some(other) => {
            let message = format!("`sun_direction` must be a vector, found {}", other.type_name());
            return Err(old.scene.error(old.pos(), message));
        }
    };
    old.set("sun_direction", Value::Vector(direction));
    // z up becomes y up.
    let upright = DMat4::from_mat3(DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y));
    let upright = Transform { matrix: upright, inverse: upright.transpose() };
    old.set("to_world", Value::Transform(to_world.after(&upright)));

    let scale = old.take_number("scale").unwrap_or(1.0);
    let sun_scale = old.take_number("sun_scale").unwrap_or(scale);
    let sky_scale = old.take_number("sky_scale").unwrap_or(scale);
    old.set("sun_scale", Value::Float(if name == "sky" { 0.0 } else { sun_scale }));
    old.set("sky_scale", Value::Float(if name == "sun" { 0.0 } else { sky_scale }));
    if name != "sky" {
        old.warn("the sun of Mitsuba 0.x was Preetham's: today's, by Hošek and Wilkie, differs in strength");
    }
    let mut size = old.take_number("sun_radius_scale").unwrap_or(1.0);
    if !(SUN_APERTURE_DEG * size >= LEAST_APERTURE_DEG) {
        old.replace("a sun of no size to speak of is not supported", "given a hundredth of its size")?;
        size = 0.01;
    }
    old.set("sun_aperture", Value::Float(SUN_APERTURE_DEG * size));
    if !old.has("albedo") {
        old.set("albedo", Value::Float(0.2));
    }
    if old.take_number("stretch").is_some_and(|s| s != 1.0) {
        old.replace("a sky cannot be stretched below the horizon", "left to end at the horizon")?;
    }
    if old.take_bool("extend") == Some(true) {
        old.replace("a sky cannot go on below the horizon", "left to end at the horizon")?;
    }
    old.forget(&["resolution"]);
    old.become_plugin("sunsky");
    Ok(())
}

/// Makes one emitter of a `sun` and a `sky` that stand side by side under the
/// same sky: today a scene has one surrounding.
pub fn unite(scene: &mut SceneDesc) {
    let root = scene.root;
    let skies: Vec<ObjectId> = Old { scene: &mut *scene, id: root }
        .children(Category::Emitter)
        .into_iter()
        .filter(|id| scene.object(*id).plugin == "sunsky")
        .collect();
    let [first, second] = skies[..] else { return };
    let mut number = |id, name: &str, default: f64| {
        let old = Old { scene: &mut *scene, id };
        old.get(name).and_then(|p| super::old::number(&p.value)).unwrap_or(default)
    };
    let (sun, sky) = if number(first, "sky_scale", 1.0) == 0.0 { (first, second) } else { (second, first) };
    let apart = number(sun, "sky_scale", 1.0) == 0.0 && number(sky, "sun_scale", 1.0) == 0.0;
    let alike = number(sun, "turbidity", 3.0) == number(sky, "turbidity", 3.0)
        && number(sun, "sampling_weight", 1.0) == number(sky, "sampling_weight", 1.0);
    let direction = |id: ObjectId| {
        let found = scene.object(id).params.iter().find(|p| p.name == "sun_direction");
        found.and_then(|p| if let Value::Vector(v) = p.value { v.try_normalize() } else { None })
    };
    let same_sun = match (direction(sun), direction(sky)) {
        (Some(a), Some(b)) => (a - b).length() < 1e-6,
        _ => false,
    };
    if !(apart && alike && same_sun) {
        return;
    }
    for name in ["sun_scale", "sun_aperture"] {
        let Some(param) = (Old { scene: &mut *scene, id: sun }).take(name) else { continue };
        Old { scene: &mut *scene, id: sky }.set(name, param.value);
    }
    scene.objects[root as usize].params.retain(|p| !matches!(p.value, Value::Object(id) if id == sun));
}

/// The direction of the sun in the emitter's own, old frame.
fn sun_direction(old: &mut Old) -> Result<DVec3> {
    let mut observer = Observer::default();
    let [hour, minute, second] = &mut observer.clock;
    let floats = [
        ("latitude", &mut observer.latitude),
        ("longitude", &mut observer.longitude),
        ("timezone", &mut observer.timezone),
        ("hour", hour),
        ("minute", minute),
        ("second", second),
    ];
    for (name, slot) in floats {
        *slot = old.take_number(name).unwrap_or(*slot);
    }
    let whole = [("year", &mut observer.year), ("month", &mut observer.month), ("day", &mut observer.day)];
    for (name, slot) in whole {
        let Some(value) = old.take_number(name) else { continue };
        if value.fract() != 0.0 || !DATE_PARTS.contains(&(value as i64)) {
            return Err(old.scene.error(old.pos(), format!("`{name}` is no part of a date: {value}")));
        }
        *slot = value as i64;
    }
    let sun = observer.sun();
    let ((sin_z, cos_z), (sin_a, cos_a)) = (sun.zenith.sin_cos(), sun.azimuth.sin_cos());
    Ok(DVec3::new(sin_a * sin_z, cos_z, -cos_a * sin_z))
}
