//! Mitsuba's principled surfaces as materials.
//!
//! | parameter | default | `principled` | `principledthin` |
//! |-|-|-|-|
//! | `base_color` | 0.5 | colour or texture | same |
//! | `roughness` | 0.5 | number or texture; √α, α at least 0.001 | same |
//! | `anisotropic`, `spec_trans`, `spec_tint`, `sheen`, `sheen_tint`, `flatness` | 0 | number or texture | same |
//! | `eta` | 1.5 | number; 1 becomes 1.001 | number or texture |
//! | `specular` | 0.5 | number, instead of `eta`: (η − 1)²/(η + 1)² is 0.08 of it | – |
//! | `metallic`, `clearcoat`, `clearcoat_gloss` | 0 | number or texture | – |
//! | `diff_trans` | 0 | – | number or texture from 0 to 2 |
//! | `…_sampling_rate` | 1 | of `diffuse_reflectance`, `main_specular`, `clearcoat`: numbers | of `specular_reflectance`, `specular_transmittance`, `diffuse_reflectance`, `diffuse_transmittance` |
//!
//! ```xml
//! <bsdf type="principled">
//!     <rgb name="base_color" value="0.9, 0.3, 0.1"/>
//!     <float name="metallic" value="0.7"/>
//!     <float name="roughness" value="0.2"/>
//! </bsdf>
//! ```

use super::scatter::Stored;
use crate::bsdf::{Principled, PrincipledBase, PrincipledThin};
use crate::desc::{Params, Result};
use crate::math::Rgb;
use crate::texture::{Coords, Texture, Usage, texture_param};

/// A principled surface with textured parameters.
#[derive(Debug)]
pub struct PrincipledSurface {
    base_color: Texture,
    roughness: Texture,
    anisotropic: Texture,
    spec_trans: Texture,
    eta: Texture,
    spec_tint: Texture,
    sheen: Texture,
    sheen_tint: Texture,
    flatness: Texture,
    rest: Rest,
}

/// What the solid and the sheet have of their own.
#[derive(Debug)]
enum Rest {
    Solid { metallic: Texture, clearcoat: Texture, clearcoat_gloss: Texture, rates: [f32; 3] },
    Thin { diff_trans: Texture, rates: [f32; 4] },
}

impl PrincipledSurface {
    /// Reads the parameters of the table above.
    pub fn new(params: &Params, thin: bool) -> Result<PrincipledSurface> {
        let number = |name: &'static str, default: f32| {
            texture_param(params, name, Rgb::splat(default), Usage::Scalar)
        };
        let share = |name: &'static str| texture_param(params, name, Rgb::ZERO, Usage::Reflectance);
        let rest = if thin {
            Rest::Thin {
                diff_trans: number("diff_trans", 0.0)?,
                rates: [
                    rate(params, "specular_reflectance_sampling_rate")?,
                    rate(params, "specular_transmittance_sampling_rate")?,
                    rate(params, "diffuse_reflectance_sampling_rate")?,
                    rate(params, "diffuse_transmittance_sampling_rate")?,
                ],
            }
        } else {
            Rest::Solid {
                metallic: share("metallic")?,
                clearcoat: share("clearcoat")?,
                clearcoat_gloss: share("clearcoat_gloss")?,
                rates: [
                    rate(params, "diffuse_reflectance_sampling_rate")?,
                    rate(params, "main_specular_sampling_rate")?,
                    rate(params, "clearcoat_sampling_rate")?,
                ],
            }
        };
        let eta = if thin { number("eta", 1.5)? } else { Texture::Constant(Rgb::splat(solid_eta(params)?)) };
        Ok(PrincipledSurface {
            base_color: texture_param(params, "base_color", Rgb::splat(0.5), Usage::Reflectance)?,
            roughness: number("roughness", 0.5)?,
            anisotropic: share("anisotropic")?,
            spec_trans: share("spec_trans")?,
            eta,
            spec_tint: share("spec_tint")?,
            sheen: number("sheen", 0.0)?,
            sheen_tint: share("sheen_tint")?,
            flatness: share("flatness")?,
            rest,
        })
    }

    /// The bsdf at texture coordinates.
    pub fn at<'a>(&self, uv: Coords) -> Stored<'a> {
        let unit = |texture: &Texture| texture.eval_scalar(uv).clamp(0.0, 1.0);
        let base = PrincipledBase {
            base_color: self.base_color.eval(uv).max(Rgb::ZERO),
            roughness: self.roughness.eval_scalar(uv).max(0.0),
            anisotropic: unit(&self.anisotropic),
            spec_trans: unit(&self.spec_trans),
            eta: self.eta.eval_scalar(uv).max(1e-3),
            spec_tint: unit(&self.spec_tint),
            sheen: self.sheen.eval_scalar(uv).max(0.0),
            sheen_tint: unit(&self.sheen_tint),
            flatness: unit(&self.flatness),
        };
        match &self.rest {
            Rest::Solid { metallic, clearcoat, clearcoat_gloss, rates } => Stored::Principled(Principled {
                base,
                metallic: unit(metallic),
                clearcoat: unit(clearcoat),
                clearcoat_gloss: unit(clearcoat_gloss),
                rates: *rates,
            }),
            Rest::Thin { diff_trans, rates } => Stored::PrincipledThin(PrincipledThin {
                base,
                diff_trans: diff_trans.eval_scalar(uv).clamp(0.0, 2.0),
                rates: *rates,
            }),
        }
    }

    /// Scene-file name.
    pub fn name(&self) -> &'static str {
        if self.is_thin() { "principledthin" } else { "principled" }
    }

    fn is_thin(&self) -> bool {
        matches!(self.rest, Rest::Thin { .. })
    }

    /// All its textures.
    pub fn textures(&self) -> Vec<&Texture> {
        let mut all = vec![
            &self.base_color,
            &self.roughness,
            &self.anisotropic,
            &self.spec_trans,
            &self.eta,
            &self.spec_tint,
            &self.sheen,
            &self.sheen_tint,
            &self.flatness,
        ];
        match &self.rest {
            Rest::Solid { metallic, clearcoat, clearcoat_gloss, .. } => {
                all.extend([metallic, clearcoat, clearcoat_gloss]);
            }
            Rest::Thin { diff_trans, .. } => all.push(diff_trans),
        }
        all
    }

    /// True when it depends on the direction of the tangent.
    pub fn is_anisotropic(&self) -> bool {
        self.anisotropic.is_constant() != Some(Rgb::ZERO)
    }

    /// True when light can pass through. As Mitsuba, every sheet may.
    pub fn transmits(&self) -> bool {
        self.is_thin() || self.spec_trans.is_constant() != Some(Rgb::ZERO)
    }
}

/// A sampling rate: a factor on a probability.
fn rate(params: &Params, name: &'static str) -> Result<f32> {
    let value = params.float(name, 1.0)?;
    if value < 0.0 {
        return Err(params.error_at(name, format!("`{name}` must be at least 0, found {value}")));
    }
    Ok(value as f32)
}

/// The index of a solid by `eta` or `specular`.
fn solid_eta(params: &Params) -> Result<f32> {
    if params.has("eta") && params.has("specular") {
        return Err(params.error_at("specular", "give either `eta` or `specular`, not both"));
    }
    if let Some(eta) = params.float_opt("eta")? {
        if !(eta > 0.0) {
            return Err(params.error_at("eta", format!("`eta` must be positive, found {eta}")));
        }
        // As Mitsuba: matched indices are no interface.
        return Ok(if eta == 1.0 { 1.001 } else { eta as f32 });
    }
    let specular = params.float("specular", 0.5)?;
    if !(0.0..12.5).contains(&specular) {
        let message = format!("`specular` must lie in [0, 12.5), found {specular}");
        return Err(params.error_at("specular", message));
    }
    let specular = if specular == 0.0 { 1e-3 } else { specular };
    Ok((2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0) as f32)
}
