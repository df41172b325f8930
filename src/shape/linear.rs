//! f64 helpers of the analytic shapes: checked transforms and frames.

use crate::desc::{Error, Result};
use crate::math::{DMat4, DVec3, Transform, Vec3};

/// The largest relative difference between the axes of a transform that is
/// meant to have equal ones: matrices in scene files are often printed with
/// few digits.
const UNIFORM_TOLERANCE: f64 = 1e-3;

/// Fails unless a transform is affine, finite and invertible.
pub fn check_affine(to_world: &Transform) -> Result<()> {
    let m = to_world.matrix;
    let affine = DVec3::new(m.x_axis.w, m.y_axis.w, m.z_axis.w) == DVec3::ZERO && m.w_axis.w == 1.0;
    if !affine {
        return Err(Error::new("`to_world` of a shape must be affine: its last row must be 0 0 0 1"));
    }
    if !m.is_finite() || !to_world.inverse.is_finite() || !(to_world.determinant() != 0.0) {
        return Err(Error::new("`to_world` of a shape cannot be inverted")
            .hint("a scale of 0 along an axis makes a shape vanish"));
    }
    Ok(())
}

/// Fails unless two axes of a transform have equal length and are
/// perpendicular, within rounding of the file.
pub fn check_circular(a: DVec3, b: DVec3, shape: &str) -> Result<()> {
    let (la, lb) = (a.length(), b.length());
    if (la - lb).abs() > UNIFORM_TOLERANCE * la || a.dot(b).abs() > UNIFORM_TOLERANCE * la * lb {
        return Err(Error::new(format!(
            "`to_world` of a {shape} must scale its radius uniformly, without shear"
        ))
        .hint("use a mesh for other shapes"));
    }
    Ok(())
}

/// `to_world` after a local matrix, checked.
pub fn compose(to_world: &Transform, local: DMat4, shape: &str) -> Result<Transform> {
    check_affine(to_world)?;
    let combined = Transform::from_matrix(to_world.matrix * local)
        .ok_or_else(|| Error::new(format!("the {shape} is too large or too small to be represented")))?;
    check_affine(&combined)?;
    Ok(combined)
}

/// Two unit vectors that make a right-handed orthonormal frame with the unit
/// vector `n`: Duff et al. 2017, listing 3, as Mitsuba does.
pub fn basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// The bounds of a point rounded from f64 to f32, whose f64 value comes from
/// numbers as large as `magnitude`.
pub fn rounding_error(p: Vec3, magnitude: f64) -> Vec3 {
    p.abs() * crate::math::gamma(2) + Vec3::splat((magnitude * 2f64.powi(-48)) as f32)
}

/// The sign of a flipped normal.
pub fn flip_sign(flip: bool) -> f64 {
    if flip { -1.0 } else { 1.0 }
}

/// A number of [0, 1) as a signed one of [-1, 1).
pub fn signed(u: f32) -> f64 {
    2.0 * f64::from(u) - 1.0
}
