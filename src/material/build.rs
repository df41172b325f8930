//! Reads `<bsdf>` objects into materials: names, parameters and defaults as in
//! Mitsuba 3.9, which has no `gltf`.

use std::collections::HashMap;
use std::sync::Arc;

use super::gltf::Gltf;
use super::perturb::{Map, Perturbation};
use super::principled::PrincipledSurface;
use super::surface::{Coating, Roughness, Surface};
use super::{Material, WHITE};
use crate::bsdf::{Coat, Distribution, GlassTable, Measured, RoughPlasticTable};
use crate::color;
use crate::desc::{Category, MeasuredData, ObjectId, Params, Result, SceneDesc, Value};
use crate::math::Rgb;
use crate::texture::{Texture, Usage, texture_from_desc, texture_param};

/// Scene-file names of all materials.
pub const NAMES: &[&str] = &[
    "diffuse",
    "dielectric",
    "thindielectric",
    "roughdielectric",
    "conductor",
    "roughconductor",
    "plastic",
    "roughplastic",
    "principled",
    "principledthin",
    "measured",
    "gltf",
    "twosided",
    "mask",
    "blendbsdf",
    "bumpmap",
    "normalmap",
    "null",
];

/// Most lobes a material may have at one hit.
const MAX_LOBES: usize = 16;
/// Deepest nesting of materials.
const MAX_DEPTH: usize = 32;

/// Builds materials, each object once.
#[derive(Debug, Default)]
pub struct MaterialBuilder {
    built: HashMap<ObjectId, Arc<Material>>,
    /// Tables of solids by the bits of their index of refraction.
    glasses: HashMap<u32, Arc<GlassTable>>,
    /// Tables of measured materials by the address of what they are made of.
    measured: HashMap<*const MeasuredData, Arc<Measured>>,
}

impl MaterialBuilder {
    /// The material of a `<bsdf>` object.
    pub fn build(&mut self, scene: &SceneDesc, id: ObjectId) -> Result<Arc<Material>> {
        if let Some(material) = self.built.get(&id) {
            return Ok(material.clone());
        }
        let material = self.nested(scene, id, 0)?;
        if material.lobe_count() > MAX_LOBES {
            let message = format!("this material has more than {MAX_LOBES} lobes; blend fewer");
            return Err(scene.error(scene.object(id).pos, message));
        }
        let material = Arc::new(material);
        self.built.insert(id, material.clone());
        Ok(material)
    }

    fn nested(&mut self, scene: &SceneDesc, id: ObjectId, depth: usize) -> Result<Material> {
        let params = scene.params(id);
        if depth > MAX_DEPTH {
            return Err(params.error(format!("materials are nested deeper than {MAX_DEPTH}")));
        }
        let mut nested = |ids: &[(&str, ObjectId)]| -> Result<Vec<Material>> {
            ids.iter().map(|(_, id)| self.nested(scene, *id, depth + 1)).collect()
        };
        let material = match scene.object(id).plugin.as_str() {
            "twosided" => two_sided(&params, nested(&params.children(Category::Bsdf))?)?,
            "mask" => {
                let opacity = texture_param(&params, "opacity", Rgb::splat(0.5), Usage::Scalar)?;
                let [inner] = exactly(&params, nested(&params.children(Category::Bsdf))?)?;
                Material::Mask(opacity, Box::new(inner))
            }
            "blendbsdf" => {
                if !params.has("weight") {
                    return Err(params.error("bsdf `blendbsdf` needs a `weight` (float or texture)"));
                }
                let weight = texture_param(&params, "weight", Rgb::splat(0.5), Usage::Scalar)?;
                let inner: [Material; 2] = exactly(&params, nested(&params.children(Category::Bsdf))?)?;
                Material::Blend(weight, Box::new(inner))
            }
            name @ ("bumpmap" | "normalmap") => {
                let [inner] = exactly(&params, nested(&params.children(Category::Bsdf))?)?;
                let perturbed = |m: &Material| match m {
                    Material::Perturbed(..) => true,
                    Material::Surface(surface) => surface.is_perturbed(),
                    _ => false,
                };
                if inner.any(perturbed) {
                    let message = format!(
                        "bsdf `{name}` cannot hold another bump or normal map; combine the two textures"
                    );
                    return Err(params.error(message));
                }
                Material::Perturbed(perturbation(&params, name)?, Box::new(inner))
            }
            "gltf" => {
                let mut glasses = |eta: f32| {
                    let table = self.glasses.entry(eta.to_bits());
                    table.or_insert_with(|| Arc::new(GlassTable::new(eta))).clone()
                };
                Material::Surface(Surface::Gltf(Box::new(Gltf::new(&params, &mut glasses)?)))
            }
            "measured" => Material::Surface(Surface::Measured(self.measured(&params)?)),
            name => match surface(&params, name)? {
                Some(surface) => Material::Surface(surface),
                None => {
                    return Err(params
                        .error(format!("unknown bsdf `{name}`"))
                        .suggest(name, NAMES.iter().copied()));
                }
            },
        };
        params.finish()?;
        Ok(material)
    }
}

impl MaterialBuilder {
    /// The tables of a `measured`, once for each file.
    ///
    /// `filename` is its one parameter: a file of the RGL material database,
    /// either kind. Those of spectra, which Mitsuba's RGB variants refuse, are
    /// taken to RGB like any spectrum of a reflectance: who has the file wants to
    /// see the material, and after one bounce of white light the colour is exact.
    ///
    /// ```xml
    /// <bsdf type="measured">
    ///     <string name="filename" value="data/isotropic.bsdf"/>
    /// </bsdf>
    /// ```
    fn measured(&mut self, params: &Params) -> Result<Arc<Measured>> {
        params.string_opt("filename")?;
        let data = params.measured().ok_or_else(|| params.error("bsdf `measured` needs a `filename`"))?;
        if let Some(tables) = self.measured.get(&Arc::as_ptr(data)) {
            return Ok(tables.clone());
        }
        let tables = Arc::new(Measured::new(data.clone()).map_err(|message| params.error(message))?);
        self.measured.insert(Arc::as_ptr(data), tables.clone());
        Ok(tables)
    }
}

/// The nested materials as an array of the length that the kind needs.
fn exactly<const N: usize>(params: &Params, nested: Vec<Material>) -> Result<[Material; N]> {
    let found = nested.len();
    nested.try_into().map_err(|_| {
        let plugin = &params.object().plugin;
        params.error(format!(
            "bsdf `{plugin}` needs {N} nested bsdf{}, found {found}",
            if N == 1 { "" } else { "s" }
        ))
    })
}

fn two_sided(params: &Params, nested: Vec<Material>) -> Result<Material> {
    if nested.iter().any(Material::transmits) {
        return Err(params.error("bsdf `twosided` can only hold bsdfs that do not transmit"));
    }
    let found = nested.len();
    let mut nested = nested.into_iter();
    match (nested.next(), nested.next(), nested.next()) {
        (Some(front), back, None) => Ok(Material::TwoSided(Box::new([front]), back.map(Box::new))),
        _ => Err(params.error(format!("bsdf `twosided` needs one or two nested bsdfs, found {found}"))),
    }
}

fn perturbation(params: &Params, name: &str) -> Result<Perturbation> {
    let map = if name == "normalmap" {
        if !params.has("normalmap") {
            return Err(params.error("bsdf `normalmap` needs a texture named `normalmap`"));
        }
        Map::Normal(texture_param(params, "normalmap", Rgb::new(0.5, 0.5, 1.0), Usage::Vector)?)
    } else {
        let textures = params.children(Category::Texture);
        let [(_, id)] = textures.as_slice() else {
            return Err(
                params.error(format!("bsdf `bumpmap` needs one nested texture, found {}", textures.len()))
            );
        };
        let height = texture_from_desc(params.scene(), *id, Usage::Scalar)?;
        if height.reads_attributes() {
            let message = "the height of a bump map cannot be a mesh attribute, or be looked up by one";
            return Err(params.error(message));
        }
        Map::Bump(height, params.float("scale", 1.0)? as f32)
    };
    Ok(Perturbation {
        map,
        flip_invalid: params.bool("flip_invalid_normals", true)?,
        shadowing: params.bool("use_shadowing_function", true)?,
    })
}

fn surface(params: &Params, name: &str) -> Result<Option<Surface>> {
    Ok(Some(match name {
        "diffuse" => Surface::Diffuse {
            reflectance: texture_param(params, "reflectance", Rgb::splat(0.5), Usage::Reflectance)?,
        },
        "dielectric" | "thindielectric" => Surface::Dielectric {
            eta: relative_ior(params, "bk7")?,
            reflectance: texture_param(params, "specular_reflectance", WHITE, Usage::Reflectance)?,
            transmittance: texture_param(params, "specular_transmittance", WHITE, Usage::Reflectance)?,
            thin: name == "thindielectric",
        },
        "roughdielectric" => Surface::RoughDielectric {
            eta: relative_ior(params, "bk7")?,
            reflectance: texture_param(params, "specular_reflectance", WHITE, Usage::Reflectance)?,
            transmittance: texture_param(params, "specular_transmittance", WHITE, Usage::Reflectance)?,
            roughness: roughness(params)?,
        },
        "conductor" | "roughconductor" => conductor(params, name == "roughconductor")?,
        "plastic" | "roughplastic" => plastic(params, name == "roughplastic")?,
        "principled" | "principledthin" => {
            Surface::Principled(Box::new(PrincipledSurface::new(params, name == "principledthin")?))
        }
        "null" => Surface::Null,
        _ => return Ok(None),
    }))
}

fn conductor(params: &Params, rough: bool) -> Result<Surface> {
    let material = params.string_opt("material")?;
    if material.is_some() && (params.has("eta") || params.has("k")) {
        return Err(params.error_at("material", "give either `material` or `eta` and `k`, not both"));
    }
    let (eta, k) = match material {
        None => (Rgb::ZERO, Rgb::ONE),
        Some(name) => color::conductor(name).ok_or_else(|| {
            params
                .error_at("material", format!("unknown conductor `{name}`"))
                .suggest(name, color::CONDUCTOR_NAMES.iter().copied())
        })?,
    };
    Ok(Surface::Conductor {
        eta: texture_param(params, "eta", eta, Usage::Radiance)?,
        k: texture_param(params, "k", k, Usage::Radiance)?,
        reflectance: texture_param(params, "specular_reflectance", WHITE, Usage::Reflectance)?,
        roughness: if rough { Some(roughness(params)?) } else { None },
    })
}

fn plastic(params: &Params, rough: bool) -> Result<Surface> {
    let eta = relative_ior(params, "polypropylene")?;
    let diffuse = texture_param(params, "diffuse_reflectance", Rgb::splat(0.5), Usage::Reflectance)?;
    let specular = texture_param(params, "specular_reflectance", WHITE, Usage::Reflectance)?;
    let coat = if rough {
        let distribution = distribution(params)?;
        params.bool("sample_visible", true)?;
        let alpha = positive_alpha(params, params.float("alpha", 0.1)?)?;
        Coating::Rough(Box::new(RoughPlasticTable::new(distribution, alpha, eta)))
    } else {
        Coating::Smooth(Coat::smooth(eta))
    };
    Ok(Surface::Plastic { coat, diffuse, specular, nonlinear: params.bool("nonlinear", false)? })
}

fn distribution(params: &Params) -> Result<Distribution> {
    Ok(match params.choice("distribution", &["beckmann", "ggx"], "beckmann")? {
        "ggx" => Distribution::Ggx,
        _ => Distribution::Beckmann,
    })
}

fn positive_alpha(params: &Params, alpha: f64) -> Result<f32> {
    if !(alpha >= 0.0 && alpha.is_finite()) {
        return Err(params.error_at("alpha", format!("`alpha` must be at least 0, found {alpha}")));
    }
    Ok(alpha as f32)
}

fn roughness(params: &Params) -> Result<Roughness> {
    let distribution = distribution(params)?;
    // Both ways of sampling have the same mean; ours always samples the visible normals.
    params.bool("sample_visible", true)?;
    let two = params.has("alpha_u") || params.has("alpha_v");
    if two && params.has("alpha") {
        return Err(params.error_at("alpha", "give either `alpha` or `alpha_u` and `alpha_v`, not both"));
    }
    if two && !(params.has("alpha_u") && params.has("alpha_v")) {
        return Err(params.error("`alpha_u` and `alpha_v` must be given together"));
    }
    let alpha = |name| -> Result<Texture> {
        let texture = texture_param(params, name, Rgb::splat(0.1), Usage::Scalar)?;
        if let Some(value) = texture.is_constant() {
            positive_alpha(params, f64::from(value.x))?;
        }
        Ok(texture)
    };
    if two {
        return Ok(Roughness { distribution, alpha_u: alpha("alpha_u")?, alpha_v: Some(alpha("alpha_v")?) });
    }
    Ok(Roughness { distribution, alpha_u: alpha("alpha")?, alpha_v: None })
}

/// Interior over exterior index; each a number or a name.
fn relative_ior(params: &Params, interior: &str) -> Result<f32> {
    let int = ior_param(params, "int_ior", interior)?;
    let ext = ior_param(params, "ext_ior", "air")?;
    Ok((int / ext) as f32)
}

fn ior_param(params: &Params, name: &'static str, default: &str) -> Result<f64> {
    let named = |word: &str| {
        color::ior(word).ok_or_else(|| {
            params
                .error_at(name, format!("unknown index of refraction `{word}`"))
                .suggest(word, color::IOR_NAMES.iter().copied())
        })
    };
    let value = match params.get(name).map(|p| &p.value) {
        None => return named(default),
        Some(Value::String(word)) => return named(word),
        Some(Value::Float(v)) => *v,
        Some(Value::Int(v)) => *v as f64,
        Some(other) => {
            let found = other.type_name();
            return Err(params
                .error_at(name, format!("`{name}` must be a number or a material's name, found {found}")));
        }
    };
    if !(value > 0.0 && value.is_finite()) {
        return Err(params.error_at(name, format!("`{name}` must be positive, found {value}")));
    }
    Ok(value)
}
