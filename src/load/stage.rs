//! The choice of camera and time in a Mitsuba file.

use super::LoadOptions;
use crate::desc::{Category, Error, ObjectId, Param, Result, SceneDesc, Value};

/// Looks through the sensor that the options choose, while the shutter is where
/// they move it.
pub fn apply(scene: &mut SceneDesc, options: &LoadOptions) -> Result<()> {
    let only_gltf = [
        ("a material variant", options.variant.is_some()),
        ("a choice of animation", options.animation.is_some()),
        ("--env", options.environment.is_some()),
        ("--sun", options.sun.is_some()),
    ];
    if let Some((what, _)) = only_gltf.iter().find(|(_, given)| *given) {
        return Err(Error::new(format!("{what} is for glTF files"))
            .hint("a Mitsuba file says for itself what it shows and what lights it"));
    }
    let sensors: Vec<(&str, ObjectId)> = scene.params(scene.root).children(Category::Sensor);
    let ids: Vec<ObjectId> = sensors.into_iter().map(|(_, id)| id).collect();
    let mut looking = ids.first().copied();
    if let Some(wanted) = &options.camera {
        let chosen = choose(scene, &ids, wanted)?;
        looking = Some(chosen);
        let root = scene.root as usize;
        let objects = &scene.objects;
        let other = |p: &Param| matches!(p.value, Value::Object(id) if objects[id as usize].category == Category::Sensor && id != chosen);
        let kept: Vec<Param> = objects[root].params.iter().filter(|p| !other(p)).cloned().collect();
        scene.objects[root].params = kept;
    }
    match looking {
        Some(sensor) if options.asks_for_time() => shutter(scene, sensor, options),
        _ => Ok(()),
    }
}

fn choose(scene: &SceneDesc, sensors: &[ObjectId], wanted: &str) -> Result<ObjectId> {
    if let Some(found) = sensors.iter().find(|id| scene.object(**id).id == wanted) {
        return Ok(*found);
    }
    if let Some(found) = wanted.parse::<usize>().ok().and_then(|index| sensors.get(index)) {
        return Ok(*found);
    }
    let known = sensors.iter().map(|id| scene.object(*id).id.as_str()).filter(|id| !id.is_empty());
    Err(scene
        .params(scene.root)
        .error(format!("the scene has {} sensors, and none is `{wanted}`", sensors.len()))
        .suggest(wanted, known))
}

/// Moves the shutter by the time of the frame; with a shutter of the options,
/// it opens and closes as they say.
fn shutter(scene: &mut SceneDesc, sensor: ObjectId, options: &LoadOptions) -> Result<()> {
    let params = scene.params(sensor);
    let file = [params.float("shutter_open", 0.0)?, params.float("shutter_close", 0.0)?];
    let frame = options.frame.unwrap_or(0.0);
    let times = match options.shutter {
        Some(shutter) => shutter.map(|t| (frame + t) / options.fps),
        None => file.map(|t| t + frame / options.fps),
    };
    let object = &mut scene.objects[sensor as usize];
    let pos = object.pos;
    for (name, time) in ["shutter_open", "shutter_close"].into_iter().zip(times) {
        let value = Value::Float(time);
        match object.params.iter_mut().find(|p| p.name == name) {
            Some(param) => param.value = value,
            None => object.params.push(Param { name: name.into(), value, pos }),
        }
    }
    Ok(())
}
