//! The operations inside `<transform>`: each maps the result of those before
//! it. Composed in f64.

use super::values::{numbers, scalar, triple};
use super::xml::Tag;
use crate::desc::{Error, Result};
use crate::math::{DMat4, DVec3, Transform};

/// Tags allowed inside `<transform>`.
pub const OPERATIONS: &[&str] = &["translate", "rotate", "scale", "lookat", "matrix"];

/// One operation as a transform; warnings go to `warnings`. `old` spellings
/// are those of Mitsuba 0.x.
pub fn operation(tag: &Tag, old: bool, warnings: &mut Vec<String>) -> Result<Transform> {
    match tag.name {
        "translate" => {
            tag.only(&["x", "y", "z", "value"])?;
            Ok(Transform::translate(triple(tag, Some(0.0))?))
        }
        "scale" => {
            tag.only(&["x", "y", "z", "value"])?;
            let s = triple(tag, Some(1.0))?;
            if s.to_array().contains(&0.0) {
                return Err(tag.error("a scale of 0 flattens the object: it cannot be undone"));
            }
            invertible(tag, DMat4::from_scale(s), DMat4::from_scale(1.0 / s))
        }
        "rotate" => rotate(tag, warnings),
        "lookat" => look_at(tag),
        "lookAt" if old => look_at(tag),
        "matrix" => matrix(tag, warnings),
        _ => Err(tag
            .error(format!("unknown tag `<{}>` inside `<transform>`", tag.name))
            .suggest(tag.name, OPERATIONS.iter().copied())),
    }
}

fn invertible(tag: &Tag, matrix: DMat4, inverse: DMat4) -> Result<Transform> {
    if matrix.is_finite() && inverse.is_finite() {
        return Ok(Transform { matrix, inverse });
    }
    Err(tag.error(format!("`<{}>` is too extreme to be undone", tag.name)))
}

fn rotate(tag: &Tag, warnings: &mut Vec<String>) -> Result<Transform> {
    tag.only(&["angle", "x", "y", "z", "value"])?;
    let angle = scalar(tag, tag.need("angle")?)?.to_radians();
    let axis = triple(tag, Some(0.0))?;
    let length = axis.length();
    if !(length > 0.0 && length.is_finite()) {
        return Err(tag
            .error("a rotation needs an axis")
            .hint("for example `<rotate y=\"1\" angle=\"90\"/>`"));
    }
    if (length - 1.0).abs() > 1e-3 {
        let pos = tag.pos();
        warnings.push(format!(
            "{}:{}:{}: the rotation axis has length {length:.6}: made 1 (Mitsuba 3 would distort the object)",
            tag.source.name, pos.line, pos.column
        ));
    }
    let axis = axis / length;
    invertible(tag, DMat4::from_axis_angle(axis, angle), DMat4::from_axis_angle(axis, -angle))
}

fn look_at(tag: &Tag) -> Result<Transform> {
    tag.only(&["origin", "target", "up"])?;
    let vector = |name: &str| -> Result<DVec3> {
        let attribute = tag.need(name)?;
        let v = numbers(tag, attribute)?;
        if v.len() != 3 {
            return Err(tag.error_in(attribute, format!("`{name}` must be 3 numbers, found {}", v.len())));
        }
        Ok(DVec3::new(v[0], v[1], v[2]))
    };
    let (origin, target) = (vector("origin")?, vector("target")?);
    let direction = (target - origin)
        .try_normalize()
        .ok_or_else(|| tag.error("`origin` and `target` of `<lookat>` are the same point"))?;
    let up = match tag.get("up") {
        Some(a) if !a.value.trim().is_empty() => vector("up")?,
        _ => DVec3::ZERO,
    };
    let up = if up == DVec3::ZERO { any_perpendicular(direction) } else { up };
    let left = up
        .cross(direction)
        .try_normalize()
        .ok_or_else(|| tag.error("`up` of `<lookat>` points along the line of sight"))?;
    let up = direction.cross(left).normalize();
    let matrix =
        DMat4::from_cols(left.extend(0.0), up.extend(0.0), direction.extend(0.0), origin.extend(1.0));
    let back =
        DMat4::from_cols(left.extend(0.0), up.extend(0.0), direction.extend(0.0), DVec3::ZERO.extend(1.0));
    invertible(tag, matrix, back.transpose() * DMat4::from_translation(-origin))
}

/// A unit vector perpendicular to `n` (Duff et al., "Building an Orthonormal
/// Basis, Revisited", JCGT 2017, listing 3: the first axis).
fn any_perpendicular(n: DVec3) -> DVec3 {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    DVec3::new(1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x)
}

fn matrix(tag: &Tag, warnings: &mut Vec<String>) -> Result<Transform> {
    tag.only(&["value"])?;
    let attribute = tag.need("value")?;
    let v = numbers(tag, attribute)?;
    let rows = match v.len() {
        16 => v,
        9 => vec![v[0], v[1], v[2], 0.0, v[3], v[4], v[5], 0.0, v[6], v[7], v[8], 0.0, 0.0, 0.0, 0.0, 1.0],
        n => {
            return Err(
                tag.error_in(attribute, format!("a matrix has 16 or 9 numbers, row by row, found {n}"))
            );
        }
    };
    let mut columns = [0.0; 16];
    columns.copy_from_slice(&rows);
    let mut matrix = DMat4::from_cols_array(&columns).transpose();
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        let pos = tag.pos();
        warnings.push(format!(
            "{}:{}:{}: the last row of the matrix is taken as 0 0 0 1, as Mitsuba 3 does",
            tag.source.name, pos.line, pos.column
        ));
        for column in [&mut matrix.x_axis, &mut matrix.y_axis, &mut matrix.z_axis] {
            column.w = 0.0;
        }
        matrix.w_axis.w = 1.0;
    }
    let singular = || -> Error { tag.error_in(attribute, "the matrix is singular: it cannot be undone") };
    Transform::from_matrix(matrix).ok_or_else(singular)
}
