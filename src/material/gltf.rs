//! The glTF surface as a material: `<bsdf type="gltf">`.
//!
//! | parameter | default | meaning |
//! |-|-|-|
//! | `base_color` | 1 | colour of the metal, albedo of the dielectric's base |
//! | `vertex_color` | `false` | multiply it with the mesh's attribute `vertex_color` |
//! | `metallic` | 1 | 0 dielectric, 1 metal |
//! | `roughness` | 1 | α is its square |
//! | `ior` | 1.5 | index of refraction (a number; 0 reflects everything) |
//! | `specular` | 1 | strength of the dielectric's reflection |
//! | `specular_color` | 1 | its colour at the normal |
//! | `transmission` | 0 | share of the dielectric that is clear |
//! | `thickness` | 0 | 0 is a thin wall, more (a number or texture) the surface of a solid that refracts by `ior` |
//! | `clearcoat`, `clearcoat_roughness` | 0 | a coat of index 1.5, and its roughness |
//! | `clearcoat_normal` | none | normal map of the coat; without it the coat is smooth even over a `normal` map |
//! | `clearcoat_normal_scale` | 1 | factor on its x and y (a number) |
//! | `sheen_color`, `sheen_roughness` | 0 | sheen of cloth |
//! | `anisotropy` | 0 | stretch of the highlight along the tangent |
//! | `anisotropy_rotation` | 0 | turn of the tangent towards the bitangent (up in the image), radians |
//! | `iridescence` | 0 | strength of a thin film |
//! | `iridescence_ior` | 1.3 | its index (a number) |
//! | `iridescence_thickness` | 400 | its thickness in nanometres |
//! | `diffuse_transmission` | 0 | share of the base that lets diffuse light through |
//! | `diffuse_transmission_color` | 1 | its colour |
//! | `dispersion` | 0 | 20 over the Abbe number of a solid (a number): how far colours are refracted apart |
//! | `normal` | none | tangent-space normal map as glTF has it |
//! | `normal_scale` | 1 | factor on its x and y (a number) |
//! | `two_sided` | false | an opaque surface looks the same from behind; else it is black there |
//!
//! What absorbs inside of a solid is the `interior` medium of the shape.
//!
//! All but the ones marked "a number" may be textures. Numbers outside of
//! their range are errors; texels outside are clamped.
//!
//! ```xml
//! <bsdf type="gltf">
//!     <rgb name="base_color" value="1, 0.77, 0.34"/>
//!     <float name="roughness" value="0.3"/>
//! </bsdf>
//! ```

use std::sync::Arc;

use super::perturb::{Map, Perturbation};
use super::scatter::Stored;
use super::{Lobe, Point, Scatter, WHITE};
use crate::bsdf::{Film, GlassTable, Layered, Layers, MetalRough, Substance};
use crate::desc::{Params, Result};
use crate::math::{Frame, Rgb, Vec3};
use crate::texture::{Coords, Texture, Usage, attribute_texture, texture_param, texture_param_opt};

/// A glTF surface with textured parameters.
#[derive(Debug)]
pub struct Gltf {
    base_color: Texture,
    /// Colours of the vertices, which multiply it.
    tint: Option<Texture>,
    metallic: Texture,
    roughness: Texture,
    /// Reflectance of the dielectric at the normal, from its index.
    f0: f32,
    specular: Texture,
    specular_color: Texture,
    normal: Option<Perturbation>,
    two_sided: bool,
    layers: Option<Box<LayerTextures>>,
}

/// What only some glTF surfaces have.
#[derive(Debug)]
struct LayerTextures {
    transmission: Texture,
    solid: Option<Arc<GlassTable>>,
    /// How the index of the solid depends on the wavelength, if it does.
    cauchy: Option<Cauchy>,
    clearcoat: Texture,
    clearcoat_roughness: Texture,
    clearcoat_normal: Option<Perturbation>,
    sheen_color: Texture,
    sheen_roughness: Texture,
    anisotropy: Texture,
    anisotropy_rotation: Texture,
    iridescence: Texture,
    iridescence_ior: f32,
    iridescence_thickness: Texture,
    diffuse_transmission: Texture,
    diffuse_transmission_color: Texture,
}

/// n(λ) = a + b / λ² (Cauchy 1836), λ in nanometres.
#[derive(Clone, Copy, Debug)]
struct Cauchy {
    a: f64,
    b: f64,
}

impl Cauchy {
    /// The Fraunhofer lines d, F and C.
    const LINES: [f64; 3] = [587.56, 486.13, 656.27];

    /// From the index at the line d and the Abbe number (n_d − 1) / (n_F − n_C).
    fn new(index: f64, abbe: f64) -> Cauchy {
        let [d, f, c] = Cauchy::LINES.map(|line| 1.0 / (line * line));
        let b = (index - 1.0) / abbe / (f - c);
        Cauchy { a: index - b * d, b }
    }

    /// At least 1: an Abbe number of less than 2 would ask for less.
    fn index(&self, wavelength: f32) -> f32 {
        let wavelength = f64::from(wavelength);
        (self.a + self.b / (wavelength * wavelength)).max(1.0) as f32
    }
}

/// The table of an index of refraction; one for all materials that share it.
pub type Glasses<'a> = &'a mut dyn FnMut(f32) -> Arc<GlassTable>;

impl Gltf {
    /// Reads the parameters of the table above.
    pub fn new(params: &Params, glasses: Glasses) -> Result<Gltf> {
        let ior = params.float("ior", 1.5)?;
        if !(ior == 0.0 || ior >= 1.0) {
            return Err(params.error_at("ior", format!("`ior` must be 0 or at least 1, found {ior}")));
        }
        let surface = Gltf {
            base_color: texture_param(params, "base_color", WHITE, Usage::Reflectance)?,
            tint: match params.bool("vertex_color", false)? {
                true => Some(attribute_texture(params, "vertex_color")?),
                false => None,
            },
            metallic: share(params, "metallic", 1.0)?,
            roughness: share(params, "roughness", 1.0)?,
            f0: ((1.0 - ior) / (1.0 + ior)).powi(2) as f32,
            specular: share(params, "specular", 1.0)?,
            specular_color: texture_param(params, "specular_color", WHITE, Usage::Radiance)?,
            normal: normal_map(params, "normal", params.float("normal_scale", 1.0)? as f32)?,
            two_sided: params.bool("two_sided", false)?,
            layers: LayerTextures::new(params, ior, glasses)?.map(Box::new),
        };
        Ok(surface)
    }

    /// Adds its lobe at a point.
    pub fn put<'a>(&'a self, point: &Point, outer: Lobe<'a>, out: &mut Scatter<'a>) {
        let uv = point.coords();
        let unit = |texture: &Texture| texture.eval_scalar(uv).clamp(0.0, 1.0);
        let f90 = unit(&self.specular);
        let tint = self.tint.as_ref().map_or(Rgb::ONE, |t| t.eval(uv));
        let substance = Substance {
            base_color: (self.base_color.eval(uv) * tint).clamp(Rgb::ZERO, Rgb::ONE),
            metallic: unit(&self.metallic),
            roughness: unit(&self.roughness),
            f0: (self.specular_color.eval(uv) * self.f0).clamp(Rgb::ZERO, Rgb::ONE) * f90,
            f90,
        };
        let smooth = outer.frame;
        let mut lobe = match &self.normal {
            Some(map) => map.apply(point, outer),
            None => outer,
        };
        let Some(layers) = &self.layers else {
            out.push_stored(lobe, Stored::MetalRough(MetalRough::new(&substance, self.two_sided)));
            return;
        };
        let rotation = layers.anisotropy_rotation.eval_scalar(uv);
        if rotation != 0.0 {
            // From the tangent towards the bitangent.
            let (sin, cos) = (rotation * point.bitangent_sign()).sin_cos();
            let Frame { s, t, n } = lobe.frame;
            lobe.frame = Frame { s: s * cos + t * sin, t: t * cos - s * sin, n };
        }
        let coat = match &layers.clearcoat_normal {
            Some(map) => map.apply(point, Lobe { frame: smooth, ..lobe }).frame.n,
            None => smooth.n,
        };
        let values = layers.at(uv, lobe.frame.to_local(coat));
        let mut surface = Layered::new(&substance, &values, layers.solid.as_deref(), self.two_sided);
        if let Some(cauchy) = layers.cauchy.filter(|_| point.wavelength > 0.0) {
            surface = surface.refracting(cauchy.index(point.wavelength));
        }
        out.push_stored(lobe, Stored::Layered(surface));
    }

    /// All its textures.
    pub fn textures(&self) -> Vec<&Texture> {
        let mut all =
            vec![&self.base_color, &self.metallic, &self.roughness, &self.specular, &self.specular_color];
        all.extend(&self.tint);
        all.extend(self.normal.iter().map(Perturbation::texture));
        if let Some(layers) = &self.layers {
            all.extend(layers.textures());
        }
        all
    }

    /// True when it depends on the direction of the tangent.
    pub fn is_anisotropic(&self) -> bool {
        self.is_perturbed()
            || self.layers.as_ref().is_some_and(|l| {
                l.clearcoat_normal.is_some() || l.anisotropy.is_constant() != Some(Rgb::ZERO)
            })
    }

    /// True when it refracts colours apart.
    pub fn disperses(&self) -> bool {
        self.layers.as_ref().is_some_and(|l| l.cauchy.is_some())
    }

    /// True when a map perturbs the normal.
    pub fn is_perturbed(&self) -> bool {
        self.normal.is_some()
    }

    /// True when light can pass through.
    pub fn transmits(&self) -> bool {
        self.layers.as_ref().is_some_and(|l| {
            [&l.transmission, &l.diffuse_transmission].iter().any(|t| t.is_constant() != Some(Rgb::ZERO))
        })
    }

    /// True when all of it is mirrors or panes, wherever it is evaluated.
    pub fn is_delta_only(&self) -> bool {
        let smooth = self.roughness.is_constant().is_some_and(|c| c.x < 0.01);
        let metal = self.metallic.is_constant() == Some(Rgb::ONE);
        smooth && metal && self.layers.is_none()
    }
}

impl LayerTextures {
    fn new(params: &Params, ior: f64, glasses: Glasses) -> Result<Option<LayerTextures>> {
        let transmission = share(params, "transmission", 0.0)?;
        let thickness = texture_param(params, "thickness", Rgb::ZERO, Usage::Radiance)?;
        let clear = transmission.is_constant() != Some(Rgb::ZERO);
        let solid = clear && thickness.max() > 0.0;
        let dispersion = at_least(params, "dispersion", 0.0, 0.0)?;
        let layers = LayerTextures {
            transmission,
            cauchy: (solid && ior > 0.0 && dispersion > 0.0)
                .then(|| Cauchy::new(ior, 20.0 / f64::from(dispersion))),
            // An index of 0 reflects everything: nothing is refracted.
            solid: if solid && ior > 0.0 { Some(glasses(ior as f32)) } else { None },
            clearcoat: share(params, "clearcoat", 0.0)?,
            clearcoat_roughness: share(params, "clearcoat_roughness", 0.0)?,
            clearcoat_normal: normal_map(
                params,
                "clearcoat_normal",
                params.float("clearcoat_normal_scale", 1.0)? as f32,
            )?,
            sheen_color: texture_param(params, "sheen_color", Rgb::ZERO, Usage::Reflectance)?,
            sheen_roughness: share(params, "sheen_roughness", 0.0)?,
            anisotropy: share(params, "anisotropy", 0.0)?,
            anisotropy_rotation: texture_param(params, "anisotropy_rotation", Rgb::ZERO, Usage::Scalar)?,
            iridescence: share(params, "iridescence", 0.0)?,
            iridescence_ior: at_least(params, "iridescence_ior", 1.3, 1.0)?,
            iridescence_thickness: texture_param(
                params,
                "iridescence_thickness",
                Rgb::splat(400.0),
                Usage::Radiance,
            )?,
            diffuse_transmission: share(params, "diffuse_transmission", 0.0)?,
            diffuse_transmission_color: texture_param(
                params,
                "diffuse_transmission_color",
                WHITE,
                Usage::Reflectance,
            )?,
        };
        let strengths = [
            &layers.transmission,
            &layers.clearcoat,
            &layers.sheen_color,
            &layers.anisotropy,
            &layers.iridescence,
            &layers.diffuse_transmission,
        ];
        let any = strengths.iter().any(|t| t.is_constant() != Some(Rgb::ZERO));
        Ok(any.then_some(layers))
    }

    /// The layers at texture coordinates, given the coat's local normal.
    fn at(&self, uv: Coords, clearcoat_normal: Vec3) -> Layers {
        let unit = |texture: &Texture| texture.eval_scalar(uv).clamp(0.0, 1.0);
        let colour = |texture: &Texture| texture.eval(uv).clamp(Rgb::ZERO, Rgb::ONE);
        let mut layers = Layers {
            anisotropy: unit(&self.anisotropy),
            iridescence: unit(&self.iridescence),
            clearcoat: unit(&self.clearcoat),
            sheen_color: colour(&self.sheen_color),
            transmission: unit(&self.transmission),
            diffuse_transmission: unit(&self.diffuse_transmission),
            clearcoat_normal,
            ..Layers::default()
        };
        if layers.iridescence > 0.0 {
            let thickness = self.iridescence_thickness.eval_scalar(uv);
            layers.film = Film { ior: self.iridescence_ior, thickness };
        }
        if layers.clearcoat > 0.0 {
            layers.clearcoat_roughness = unit(&self.clearcoat_roughness);
        }
        if layers.sheen_color != Rgb::ZERO {
            layers.sheen_roughness = unit(&self.sheen_roughness);
        }
        if layers.diffuse_transmission > 0.0 {
            layers.diffuse_transmission_color = colour(&self.diffuse_transmission_color);
        }
        layers
    }

    fn textures(&self) -> Vec<&Texture> {
        let mut all = vec![
            &self.transmission,
            &self.clearcoat,
            &self.clearcoat_roughness,
            &self.sheen_color,
            &self.sheen_roughness,
            &self.anisotropy,
            &self.anisotropy_rotation,
            &self.iridescence,
            &self.iridescence_thickness,
            &self.diffuse_transmission,
            &self.diffuse_transmission_color,
        ];
        all.extend(self.clearcoat_normal.iter().map(Perturbation::texture));
        all
    }
}

/// A number in [0, 1], or a texture of them.
fn share(params: &Params, name: &'static str, default: f32) -> Result<Texture> {
    texture_param(params, name, Rgb::splat(default), Usage::Reflectance)
}

fn at_least(params: &Params, name: &'static str, default: f64, least: f64) -> Result<f32> {
    let value = params.float(name, default)?;
    if value < least {
        return Err(params.error_at(name, format!("`{name}` must be at least {least}, found {value}")));
    }
    Ok(value as f32)
}

fn normal_map(params: &Params, name: &'static str, scale: f32) -> Result<Option<Perturbation>> {
    let map = texture_param_opt(params, name, Usage::Vector)?;
    Ok(map.map(|texture| Perturbation {
        map: Map::Tangent(texture, scale),
        flip_invalid: true,
        shadowing: true,
    }))
}
