//! Media: what fills the space between surfaces. So far what takes light away
//! and does not scatter it.
//!
//! Along a ray of length d a share exp(−σ·d) of the radiance is left (Bouguer
//! 1729, Lambert 1760, Beer 1852). It is evaluated, not sampled: no noise comes
//! of it, at any thickness.

use crate::desc::{ObjectId, Result, SceneDesc};
use crate::math::Rgb;

/// A medium that absorbs alike everywhere.
///
/// `<medium type="homogeneous">`:
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `sigma_t` | 1 | extinction, per unit of length in the world (no texture) |
/// | `scale` | 1 | factor on it |
/// | `albedo` | 0.75 | share of it that scatters: only 0 is supported so far |
///
/// A shape names it as the medium on its inside (`name="interior"`) or outside
/// (`name="exterior"`), the sides by its geometric normal; a sensor may stand in
/// one.
///
/// ```xml
/// <shape type="sphere">
///     <bsdf type="dielectric"/>
///     <medium name="interior" type="homogeneous">
///         <rgb name="sigma_t" value="0.2, 1, 2"/>
///         <float name="albedo" value="0"/>
///     </medium>
/// </shape>
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Absorption per unit of length, at least 0.
    sigma: Rgb,
}

impl Medium {
    /// The index that stands for nothing: no medium of a scene has it.
    pub const NONE: u32 = u32::MAX;

    /// The default of Mitsuba 3.9, which scatters.
    const ALBEDO: Rgb = Rgb::splat(0.75);

    /// Reads a `<medium>`.
    ///
    /// # Errors
    /// Other kinds, media that scatter, negative numbers, unknown parameters.
    pub fn from_desc(desc: &SceneDesc, id: ObjectId) -> Result<Medium> {
        let params = desc.params(id);
        let kind = &params.object().plugin;
        if kind != "homogeneous" {
            return Err(params
                .error(format!("medium `{kind}` is not supported"))
                .hint("`homogeneous` with an `albedo` of 0, which absorbs, is"));
        }
        let sigma = params.rgb("sigma_t", Rgb::ONE)?;
        let scale = params.float("scale", 1.0)? as f32;
        if params.rgb("albedo", Medium::ALBEDO)? != Rgb::ZERO {
            let message = "participating media that scatter are not supported";
            let error =
                if params.has("albedo") { params.error_at("albedo", message) } else { params.error(message) };
            return Err(error.hint("with an `albedo` of 0 (the default is 0.75) a medium absorbs alone"));
        }
        let sigma = sigma * scale;
        if !(sigma.is_finite() && sigma.min_element() >= 0.0) {
            let message = format!("`sigma_t` times `scale` must be finite and not negative, found {sigma}");
            return Err(params.error_at("sigma_t", message));
        }
        params.finish()?;
        Ok(Medium { sigma })
    }

    /// What is left of light after a way of that length in the world, per
    /// channel in [0, 1]; `distance` may be infinite.
    #[must_use]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        // In f64: f32 would lose one digit in ten at a thickness of ten.
        let left = |sigma: f32| match sigma {
            0.0 => 1.0,
            sigma => (-f64::from(sigma) * f64::from(distance)).exp() as f32,
        };
        Rgb::new(left(self.sigma.x), left(self.sigma.y), left(self.sigma.z))
    }

    /// The channel that absorbs most, per unit of length.
    #[must_use]
    pub fn most(&self) -> f64 {
        f64::from(self.sigma.max_element())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_falls_by_the_thickness() {
        let medium = Medium { sigma: Rgb::new(0.0, 0.25, 3.0) };
        for distance in [0.0, 1e-7, 0.5, 8.0, 25.0] {
            let expected = [0.0f64, 0.25, 3.0].map(|s| (-s * f64::from(distance)).exp());
            for (left, expected) in medium.transmittance(distance).to_array().into_iter().zip(expected) {
                assert!((f64::from(left) / expected - 1.0).abs() < 1e-7, "{left} for {expected}");
            }
        }
        assert_eq!(medium.transmittance(f32::INFINITY), Rgb::X);
        assert_eq!(medium.transmittance(1e30), Rgb::X);
    }
}
