//! Files older than 2.0: parameters as Mitsuba 3 itself renames them, and
//! kinds that are called or made otherwise today.

use super::old::Old;
use super::parse::{MITSUBA_2, Parsed};
use super::{old_bsdfs, old_emitters, old_kinds};
use crate::desc::{Category, Object, ObjectId, Param, Result, Value};
use crate::math::{DVec3, Transform};

/// Brings the objects of old files to today's kinds and parameters: `toWorld`
/// → `to_world`, `diffuse_reflectance` of `diffuse` → `reflectance`,
/// `uoffset`, `voffset`, `uscale`, `vscale` → `to_uv`, `mixturebsdf` →
/// `blendbsdf`, and so on. What has no equal is an error that names the
/// nearest, or with leniency a note.
pub fn upgrade(parsed: &mut Parsed) -> Result<()> {
    let is_old = |parsed: &Parsed, id: ObjectId| {
        parsed.versions[parsed.scene.object(id).pos.file as usize] < MITSUBA_2
    };
    let old: Vec<ObjectId> =
        (0..parsed.scene.objects.len() as ObjectId).filter(|id| is_old(parsed, *id)).collect();
    for id in &old {
        names(parsed, *id as usize)?;
    }
    for id in &old {
        kind(&mut Old { scene: &mut parsed.scene, id: *id })?;
    }
    if !old.is_empty() {
        old_emitters::unite(&mut parsed.scene);
    }
    // Last, and from the innermost out: it may become a copy of the texture
    // within. One that a bump map took apart belongs to nobody.
    for id in old.into_iter().rev() {
        let is_scale = |o: &Object| o.category == Category::Texture && o.plugin == "scale";
        if !is_scale(parsed.scene.object(id)) {
            continue;
        }
        let mut params = parsed.scene.objects.iter().flat_map(|o| &o.params);
        let used = params.any(|p| matches!(p.value, Value::Object(child) if child == id));
        let mut texture = Old { scene: &mut parsed.scene, id };
        if used {
            old_kinds::scaled_texture(&mut texture)?;
        } else {
            texture.keep(&[]);
            texture.become_plugin("rgb");
        }
    }
    Ok(())
}

fn names(parsed: &mut Parsed, index: usize) -> Result<()> {
    let object = &mut parsed.scene.objects[index];
    for param in &mut object.params {
        param.name = snake_case(&param.name);
        if object.plugin == "diffuse" && param.name == "diffuse_reflectance" {
            param.name = "reflectance".into();
        }
    }
    texture_transform(&mut object.params);
    check_twice(parsed, index)
}

fn kind(old: &mut Old) -> Result<()> {
    match old.category() {
        Category::Bsdf => old_bsdfs::upgrade(old),
        Category::Emitter => old_emitters::upgrade(old),
        Category::Integrator => old_kinds::integrator(old),
        Category::Texture => old_kinds::texture(old),
        Category::Shape => old_kinds::shape(old),
        Category::Sampler => {
            old_kinds::sampler(old);
            Ok(())
        }
        Category::Film => old_kinds::film(old),
        Category::Medium => old_kinds::medium(old),
        _ => Ok(()),
    }
}

fn check_twice(parsed: &Parsed, index: usize) -> Result<()> {
    let params = &parsed.scene.objects[index].params;
    for (i, param) in params.iter().enumerate() {
        if !param.name.is_empty()
            && let Some(first) = params[..i].iter().find(|p| p.name == param.name)
        {
            let line = first.pos.line;
            return Err(parsed
                .scene
                .error(param.pos, format!("`{}` is given twice, first on line {line}", param.name)));
        }
    }
    Ok(())
}

/// `intIOR` → `int_ior`: an upper-case letter after a lower-case one starts a
/// word, which is all in lower case up to the next lower-case letter.
fn snake_case(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    let mut in_word = false;
    let mut previous = ' ';
    for c in name.chars() {
        if c.is_ascii_uppercase() && previous.is_ascii_lowercase() {
            out.push('_');
            in_word = true;
        }
        in_word &= c.is_ascii_uppercase();
        out.push(if in_word { c.to_ascii_lowercase() } else { c });
        previous = c;
    }
    out
}

/// Replaces offsets and scales of texture coordinates by one transform, in the
/// order in which Mitsuba 3 upgrades them: moved, then scaled.
fn texture_transform(params: &mut Vec<Param>) {
    const NAMES: [&str; 4] = ["uoffset", "voffset", "uscale", "vscale"];
    let mut given = [0.0, 0.0, 1.0, 1.0];
    let mut pos = None;
    for (slot, name) in given.iter_mut().zip(NAMES) {
        if let Some(param) = params.iter().find(|p| p.name == name) {
            *slot = match param.value {
                Value::Float(v) => v,
                Value::Int(v) => v as f64,
                _ => return, // left for the builder to refuse
            };
            pos.get_or_insert(param.pos);
        }
    }
    let Some(pos) = pos else { return };
    if given[2] == 0.0 || given[3] == 0.0 {
        return; // left for the builder to refuse: it cannot be undone
    }
    let scale = DVec3::new(given[2], given[3], 1.0);
    let scale = Transform {
        matrix: crate::math::DMat4::from_scale(scale),
        inverse: crate::math::DMat4::from_scale(1.0 / scale),
    };
    let to_uv = scale.after(&Transform::translate(DVec3::new(given[0], given[1], 0.0)));
    params.retain(|p| !NAMES.contains(&p.name.as_str()));
    params.push(Param { name: "to_uv".into(), value: Value::Transform(to_uv), pos });
}

#[cfg(test)]
mod tests {
    use super::snake_case;

    /// As Mitsuba 3.9.1 renames them.
    #[test]
    fn snake_case_of_mitsuba() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("RGBName", "RGBName"),
            ("toURLName", "to_urlname"),
            ("maxDepth", "max_depth"),
            ("sigmaT", "sigma_t"),
            ("already_new", "already_new"),
        ] {
            assert_eq!(snake_case(old), new);
        }
    }
}
