//! The leaves of a material: one bsdf, its parameters read from textures.

use std::sync::Arc;

use super::gltf::Gltf;
use super::principled::PrincipledSurface;
use super::{Lobe, Point, Scatter};
use crate::bsdf::{
    Bsdf, Coat, Conductor, Dielectric, Diffuse, Distribution, Measured, Microfacet, Null, Plastic,
    RoughConductor, RoughDielectric, RoughPlastic, RoughPlasticTable, ThinDielectric,
};
use crate::texture::{Coords, Texture};

/// A bsdf with textured parameters.
#[derive(Debug)]
pub enum Surface {
    /// `diffuse`.
    Diffuse {
        /// Share of light that is reflected.
        reflectance: Texture,
    },
    /// `dielectric` and `thindielectric`.
    Dielectric {
        /// Interior over exterior index of refraction.
        eta: f32,
        /// Factor on reflection, 1 in nature.
        reflectance: Texture,
        /// Factor on transmission, 1 in nature.
        transmittance: Texture,
        /// A thin sheet instead of a solid.
        thin: bool,
    },
    /// `roughdielectric`.
    RoughDielectric {
        /// Interior over exterior index of refraction.
        eta: f32,
        /// Factor on reflection, 1 in nature.
        reflectance: Texture,
        /// Factor on transmission, 1 in nature.
        transmittance: Texture,
        /// Roughness.
        roughness: Roughness,
    },
    /// `conductor` (no roughness) and `roughconductor`.
    Conductor {
        /// Real part of the index of refraction.
        eta: Texture,
        /// Imaginary part.
        k: Texture,
        /// Factor on reflection, 1 in nature.
        reflectance: Texture,
        /// Roughness, if any.
        roughness: Option<Roughness>,
    },
    /// `plastic` and `roughplastic`.
    Plastic {
        /// The coat.
        coat: Coating,
        /// Albedo of the base.
        diffuse: Texture,
        /// Factor on the specular reflection, 1 in nature.
        specular: Texture,
        /// Colour shifts from internal reflection are taken into account.
        nonlinear: bool,
    },
    /// `gltf`.
    Gltf(Box<Gltf>),
    /// `principled` and `principledthin`.
    Principled(Box<PrincipledSurface>),
    /// `measured`; one for all that name the same file.
    Measured(Arc<Measured>),
    /// `null`: nothing there.
    Null,
}

/// The coat of a plastic.
#[derive(Debug)]
pub enum Coating {
    /// A mirror.
    Smooth(Coat),
    /// Rough, with its tables.
    Rough(Box<RoughPlasticTable>),
}

/// Microfacet roughness.
#[derive(Debug)]
pub struct Roughness {
    /// Beckmann or GGX.
    pub distribution: Distribution,
    /// Roughness along ∂p/∂u.
    pub alpha_u: Texture,
    /// Roughness along ∂p/∂v; `None` when isotropic.
    pub alpha_v: Option<Texture>,
}

impl Roughness {
    fn at(&self, uv: Coords) -> Microfacet {
        let u = self.alpha_u.eval_scalar(uv);
        let v = self.alpha_v.as_ref().map_or(u, |t| t.eval_scalar(uv));
        Microfacet::new(self.distribution, u, v)
    }
}

impl Surface {
    /// Adds its lobe at a point, with weight, frame and perturbation of
    /// `outer`.
    pub fn put<'a>(&'a self, point: &Point, outer: Lobe<'a>, out: &mut Scatter<'a>) {
        match self {
            Surface::Gltf(surface) => surface.put(point, outer, out),
            Surface::Principled(surface) => out.push_stored(outer, surface.at(point.coords())),
            plain => out.push(outer, plain.at(point.coords())),
        }
    }

    /// The bsdf at texture coordinates `uv`; nothing for those that make more
    /// of it than a plain bsdf.
    #[inline]
    pub(super) fn at(&self, uv: Coords) -> Bsdf<'_> {
        match self {
            Surface::Diffuse { reflectance } => Diffuse { reflectance: reflectance.eval(uv) }.into(),
            Surface::Dielectric { eta, reflectance, transmittance, thin } => {
                let (r, t) = (reflectance.eval(uv), transmittance.eval(uv));
                if *thin {
                    ThinDielectric { eta: *eta, specular_reflectance: r, specular_transmittance: t }.into()
                } else {
                    Dielectric { eta: *eta, specular_reflectance: r, specular_transmittance: t }.into()
                }
            }
            Surface::RoughDielectric { eta, reflectance, transmittance, roughness } => RoughDielectric {
                distribution: roughness.at(uv),
                eta: *eta,
                specular_reflectance: reflectance.eval(uv),
                specular_transmittance: transmittance.eval(uv),
            }
            .into(),
            Surface::Conductor { eta, k, reflectance, roughness } => {
                let (eta, k, specular_reflectance) = (eta.eval(uv), k.eval(uv), reflectance.eval(uv));
                match roughness {
                    None => Conductor { eta, k, specular_reflectance }.into(),
                    Some(roughness) => {
                        RoughConductor { distribution: roughness.at(uv), eta, k, specular_reflectance }.into()
                    }
                }
            }
            Surface::Plastic { coat, diffuse, specular, nonlinear } => {
                let (diffuse_reflectance, specular_reflectance) = (diffuse.eval(uv), specular.eval(uv));
                let nonlinear = *nonlinear;
                match coat {
                    Coating::Smooth(coat) => {
                        Plastic { coat: *coat, diffuse_reflectance, specular_reflectance, nonlinear }.into()
                    }
                    Coating::Rough(table) => {
                        RoughPlastic { table, diffuse_reflectance, specular_reflectance, nonlinear }.into()
                    }
                }
            }
            Surface::Measured(tables) => (&**tables).into(),
            Surface::Gltf(_) | Surface::Principled(_) | Surface::Null => Null.into(),
        }
    }

    /// True when its bsdf is too large for a lobe: [`Surface::put`] it.
    #[inline]
    pub fn is_stored(&self) -> bool {
        matches!(self, Surface::Gltf(_) | Surface::Principled(_))
    }

    /// Scene-file name.
    pub fn name(&self) -> &'static str {
        match self {
            Surface::Diffuse { .. } => "diffuse",
            Surface::Dielectric { thin: false, .. } => "dielectric",
            Surface::Dielectric { thin: true, .. } => "thindielectric",
            Surface::RoughDielectric { .. } => "roughdielectric",
            Surface::Conductor { roughness: None, .. } => "conductor",
            Surface::Conductor { .. } => "roughconductor",
            Surface::Plastic { coat: Coating::Smooth(_), .. } => "plastic",
            Surface::Plastic { .. } => "roughplastic",
            Surface::Gltf(_) => "gltf",
            Surface::Principled(surface) => surface.name(),
            Surface::Measured(_) => "measured",
            Surface::Null => "null",
        }
    }

    /// All its textures.
    pub fn textures(&self) -> Vec<&Texture> {
        match self {
            Surface::Diffuse { reflectance } => vec![reflectance],
            Surface::Dielectric { reflectance, transmittance, .. } => vec![reflectance, transmittance],
            Surface::RoughDielectric { reflectance, transmittance, roughness, .. } => {
                let mut all = vec![reflectance, transmittance, &roughness.alpha_u];
                all.extend(&roughness.alpha_v);
                all
            }
            Surface::Conductor { eta, k, reflectance, roughness } => {
                let mut all = vec![eta, k, reflectance];
                if let Some(roughness) = roughness {
                    all.push(&roughness.alpha_u);
                    all.extend(&roughness.alpha_v);
                }
                all
            }
            Surface::Plastic { diffuse, specular, .. } => vec![diffuse, specular],
            Surface::Gltf(surface) => surface.textures(),
            Surface::Principled(surface) => surface.textures(),
            Surface::Measured(_) | Surface::Null => Vec::new(),
        }
    }

    /// True when it depends on the direction of the tangent.
    pub fn is_anisotropic(&self) -> bool {
        match self {
            Surface::RoughDielectric { roughness, .. }
            | Surface::Conductor { roughness: Some(roughness), .. } => roughness.alpha_v.is_some(),
            Surface::Gltf(surface) => surface.is_anisotropic(),
            Surface::Principled(surface) => surface.is_anisotropic(),
            Surface::Measured(tables) => tables.is_anisotropic(),
            _ => false,
        }
    }

    /// True when it has delta lobes only, wherever it is evaluated.
    pub fn is_delta_only(&self) -> bool {
        match self {
            Surface::Dielectric { .. } | Surface::Conductor { roughness: None, .. } | Surface::Null => true,
            Surface::Gltf(surface) => surface.is_delta_only(),
            _ => false,
        }
    }

    /// True when its bsdf chooses between lobes: see [`Bsdf::chooses`].
    pub fn chooses(&self) -> bool {
        match self {
            Surface::Dielectric { .. }
            | Surface::RoughDielectric { .. }
            | Surface::Plastic { .. }
            | Surface::Gltf(_)
            | Surface::Principled(_) => true,
            Surface::Diffuse { .. } | Surface::Conductor { .. } | Surface::Measured(_) | Surface::Null => {
                false
            }
        }
    }

    /// True for `null`.
    pub fn is_null(&self) -> bool {
        matches!(self, Surface::Null)
    }

    /// True when light can pass through.
    pub fn transmits(&self) -> bool {
        match self {
            Surface::Dielectric { .. } | Surface::RoughDielectric { .. } | Surface::Null => true,
            Surface::Gltf(surface) => surface.transmits(),
            Surface::Principled(surface) => surface.transmits(),
            _ => false,
        }
    }

    /// True when it perturbs the normal by itself.
    pub fn is_perturbed(&self) -> bool {
        matches!(self, Surface::Gltf(surface) if surface.is_perturbed())
    }
}
