//! Files older than 2.0: what Mitsuba 3 itself renames in them.

use super::parse::Parsed;
use crate::desc::{Param, Result, Value};
use crate::math::{DVec3, Transform};

/// Spells the parameters of old files anew: `toWorld` → `to_world`,
/// `diffuse_reflectance` of `diffuse` → `reflectance`, `uoffset`, `voffset`,
/// `uscale`, `vscale` → `to_uv`.
pub fn upgrade(parsed: &mut Parsed) -> Result<()> {
    for index in 0..parsed.scene.objects.len() {
        let object = &mut parsed.scene.objects[index];
        if parsed.versions[object.pos.file as usize] >= [2, 0, 0] {
            continue;
        }
        for param in &mut object.params {
            param.name = snake_case(&param.name);
            if object.plugin == "diffuse" && param.name == "diffuse_reflectance" {
                param.name = "reflectance".into();
            }
        }
        texture_transform(&mut object.params);
        check_twice(parsed, index)?;
    }
    Ok(())
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

/// Replaces offsets and scales of texture coordinates by one transform.
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
