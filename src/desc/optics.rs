//! The field of view, as Mitsuba's cameras and projectors say it.

use super::{Params, Result};

/// See [`Params::x_fov_deg`].
pub(super) fn x_fov_deg(params: &Params, aspect: f64) -> Result<f64> {
    let Some(fov) = params.float_opt("fov")? else {
        return Ok(from_diagonal(36.0f64.hypot(24.0) / (2.0 * focal_length(params)?), aspect));
    };
    if params.has("focal_length") {
        return Err(params.error_at("focal_length", "give either `fov` or `focal_length`, not both"));
    }
    if !(fov > 0.0 && fov < 180.0) {
        return Err(params.error_at("fov", format!("`fov` must lie between 0 and 180 degrees, found {fov}")));
    }
    let word = params.string_opt("fov_axis")?.unwrap_or("x").to_lowercase();
    let tangent = (0.5 * fov).to_radians().tan();
    let from_y = || 2.0 * (tangent * aspect).atan().to_degrees();
    match (word.as_str(), aspect > 1.0) {
        ("x", _) | ("smaller", false) | ("larger", true) => Ok(fov),
        ("y", _) | ("smaller", true) | ("larger", false) => Ok(from_y()),
        ("diagonal", _) => Ok(from_diagonal(tangent, aspect)),
        _ => Err(params
            .error_at("fov_axis", format!("`fov_axis` has no value `{word}`"))
            .suggest(&word, ["x", "y", "diagonal", "smaller", "larger"])),
    }
}

/// From the tangent of half the diagonal field of view.
fn from_diagonal(tangent: f64, aspect: f64) -> f64 {
    2.0 * (tangent / (1.0 + 1.0 / (aspect * aspect)).sqrt()).atan().to_degrees()
}

/// In millimetres: `50mm`, or just `50`.
fn focal_length(params: &Params) -> Result<f64> {
    let Some(word) = params.string_opt("focal_length")? else { return Ok(50.0) };
    let digits = word.trim().trim_end_matches("mm").trim_end();
    match digits.parse::<f64>() {
        Ok(v) if v > 0.0 && v.is_finite() => Ok(v),
        _ => Err(params.error_at(
            "focal_length",
            format!("`focal_length` must be a length in millimetres like `50mm`, found `{word}`"),
        )),
    }
}
