//! Materials: `<bsdf type="gltf">`, within `<bsdf type="mask">` where it is
//! cut out or blended, and what it emits.

use std::collections::HashMap;

use super::geometry::Needs;
use super::json::{Material, SpecularGlossiness, TextureInfo};
use super::objects::Objects;
use super::source::Source;
use super::texture::{Images, Recipe, Scale, Use, has_alpha, textures_of, uv_set};
use super::{extra, fail};
use crate::desc::{Category, ObjectId, Pos, Result, Value};

/// What a primitive looks like.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Its bsdf.
    pub bsdf: ObjectId,
    /// Its emitter, if it glows.
    pub emitter: Option<ObjectId>,
    /// What is inside of it, if that absorbs.
    pub interior: Option<ObjectId>,
}

/// Vertex colours that a primitive has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct VertexColor {
    /// `vertex_color`.
    pub rgb: bool,
    /// `vertex_alpha`.
    pub alpha: bool,
}

/// Turns materials into objects, each once for each kind of vertex colours.
pub struct Materials<'a> {
    pub(super) source: &'a Source,
    pub(super) images: Images,
    known: HashMap<(Option<usize>, VertexColor), Look>,
}

/// What a material reads of meshes.
pub fn needs(material: Option<&Material>) -> Needs {
    let Some(material) = material else { return Needs::default() };
    let (normal, ext) = (material.normal_texture.as_ref(), &material.extensions);
    let coat = ext.clearcoat.as_ref().and_then(|c| c.clearcoat_normal_texture.as_ref());
    let direction = ext.anisotropy.as_ref().filter(|a| a.anisotropy_strength != 0.0);
    // An anisotropy without any texture follows the first set.
    let along = direction.map(|a| a.anisotropy_texture.as_ref().map_or(0, uv_set));
    let tangents = normal.or(coat).map(uv_set).or(along);
    let mut uv_sets: std::collections::BTreeSet<u32> =
        textures_of(material).into_iter().map(uv_set).collect();
    uv_sets.extend(tangents);
    Needs { tangents, uv_sets, alpha: mode(material) != "OPAQUE" }
}

/// `alphaMode`.
pub(super) fn mode(material: &Material) -> &str {
    material.alpha_mode.as_deref().unwrap_or("OPAQUE")
}

/// A bsdf while its parameters are collected.
pub struct Bsdf<'m> {
    pub objects: &'m mut Objects,
    pub source: &'m Source,
    pub images: &'m mut Images,
    /// The material, as in `materials[3]`.
    pub place: String,
    pub params: Vec<(&'static str, Value)>,
}

impl Bsdf<'_> {
    /// A number, times one channel of a texture if there is one. An alpha that
    /// an image does not have is 1.
    pub fn number(
        &mut self,
        name: &'static str,
        factor: f64,
        texture: Option<&TextureInfo>,
        channel: &'static str,
    ) {
        let texture = texture.filter(|info| {
            factor != 0.0
                && (channel != "a" || self.images.image(self.source, info).is_some_and(|i| has_alpha(i)))
        });
        let textured = texture.and_then(|info| {
            self.images.texture(self.objects, self.source, info, Use::channel(channel, factor))
        });
        self.params.push((name, textured.unwrap_or(Value::Float(factor))));
    }

    /// A colour, times that of a texture if there is one.
    pub fn color(&mut self, name: &'static str, factor: [f64; 3], texture: Option<&TextureInfo>) {
        let textured = texture
            .filter(|_| factor != [0.0; 3])
            .and_then(|info| self.images.texture(self.objects, self.source, info, Use::color(factor)));
        self.params.push((name, textured.unwrap_or(Value::Rgb(factor))));
    }

    /// A normal map.
    pub fn normal(&mut self, name: &'static str, texture: Option<&TextureInfo>) {
        let map = Use { raw: true, channel: "rgb", scale: Scale::Grey(1.0) };
        if let Some(info) = texture
            && let Some(value) = self.images.texture(self.objects, self.source, info, map)
        {
            self.params.push((name, value));
        }
    }

    /// A number that must be from 0 to 1, clamped with a warning.
    pub fn unit(&mut self, what: &str, value: f64) -> f64 {
        if !(0.0..=1.0).contains(&value) {
            self.objects.warn(&self.place, &format!("{what} {value} is clamped to [0, 1]"));
        }
        value.clamp(0.0, 1.0)
    }

    /// A colour whose parts must be from 0 to 1.
    pub fn unit_color(&mut self, what: &str, value: [f64; 3]) -> [f64; 3] {
        value.map(|c| self.unit(what, c))
    }
}

impl<'a> Materials<'a> {
    /// With the images that they read.
    pub fn new(source: &'a Source, images: Images) -> Materials<'a> {
        Materials { source, images, known: HashMap::new() }
    }

    /// The look of a material, or of the default one.
    pub fn look(&mut self, objects: &mut Objects, index: Option<usize>, vertex: VertexColor) -> Result<Look> {
        if let Some(look) = self.known.get(&(index, vertex)) {
            return Ok(*look);
        }
        let default = Material::default();
        let material = index.map_or(&default, |i| &self.source.root.materials[i]);
        let place = index.map_or("the default material".to_string(), |i| format!("materials[{i}]"));
        let pos = objects.pos(&place);
        if !["OPAQUE", "MASK", "BLEND"].contains(&mode(material)) {
            return Err(fail(&place, format!("`alphaMode` `{}` is unknown", mode(material))));
        }
        let look = if material.extensions.unlit.is_some() {
            let (bsdf, emitter) = self.unlit(objects, (material, &place, pos), vertex);
            Look { bsdf, emitter, interior: None }
        } else {
            Look {
                bsdf: self.surface(objects, (material, &place, pos), vertex),
                emitter: self.emission(objects, (material, &place, pos), vertex),
                interior: interior(objects, material, pos),
            }
        };
        let bsdf = self.cut_out(objects, (material, &place, pos), vertex, look.bsdf);
        if let Some(name) = Some(&material.name).filter(|n| !n.is_empty()) {
            objects.name(bsdf, name.clone());
        }
        if let Some(error) = self.images.failed() {
            return Err(error);
        }
        let look = Look { bsdf, ..look };
        self.known.insert((index, vertex), look);
        Ok(look)
    }

    fn surface(
        &mut self,
        objects: &mut Objects,
        (material, place, pos): (&Material, &str, Pos),
        vertex: VertexColor,
    ) -> ObjectId {
        let mut bsdf = Bsdf {
            objects,
            source: self.source,
            images: &mut self.images,
            place: place.to_string(),
            params: vec![("two_sided", Value::Bool(material.double_sided))],
        };
        if vertex.rgb {
            bsdf.params.push(("vertex_color", Value::Bool(true)));
        }
        match &material.extensions.specular_glossiness {
            Some(old) => specular_glossiness(&mut bsdf, old),
            None => metallic_roughness(&mut bsdf, material),
        }
        if let Some(info) = &material.normal_texture {
            bsdf.normal("normal", Some(info));
            bsdf.params.push(("normal_scale", Value::Float(info.scale.unwrap_or(1.0))));
        }
        extra::extensions(&mut bsdf, &material.extensions);
        let params = bsdf.params;
        objects.add(Category::Bsdf, "gltf", pos, params)
    }

    /// The bsdf within what its alpha lets through.
    fn cut_out(
        &mut self,
        objects: &mut Objects,
        (material, place, pos): (&Material, &str, Pos),
        vertex: VertexColor,
        inner: ObjectId,
    ) -> ObjectId {
        if mode(material) == "OPAQUE" {
            return inner;
        }
        let opacity = self.opacity(material);
        let mut bsdf = inner;
        let mut within = |objects: &mut Objects, opacity: Value| {
            let params = vec![("opacity", opacity), ("", Value::Object(bsdf))];
            bsdf = objects.add(Category::Bsdf, "mask", pos, params);
        };
        if vertex.alpha {
            if mode(material) == "MASK" {
                objects.warn(place, "the alpha of its vertices blends instead of cutting it out");
            }
            // Two masks within each other multiply.
            let params = vec![("name", Value::String("vertex_alpha".into()))];
            let opacity = objects.add(Category::Texture, "mesh_attribute", pos, params);
            within(objects, Value::Object(opacity));
        }
        let textured = opacity.texture.and_then(|info| match opacity.recipe {
            Recipe::Blend { factor } => {
                self.images.texture(objects, self.source, info, Use::channel("a", factor))
            }
            // The cut is made in the texels, so that the mask is 0 or 1 at
            // their centres.
            cut => self.images.baked(objects, self.source, info, cut),
        });
        let opacity = textured.unwrap_or(Value::Float(opacity.constant()));
        if !matches!(opacity, Value::Float(1.0)) {
            within(objects, opacity);
        }
        bsdf
    }
}

fn interior(objects: &mut Objects, material: &Material, pos: Pos) -> Option<ObjectId> {
    let sigma = extra::interior(&material.extensions)?;
    let params = vec![("sigma_t", Value::Rgb(sigma)), ("albedo", Value::Float(0.0))];
    Some(objects.add(Category::Medium, "homogeneous", pos, params))
}

fn metallic_roughness(bsdf: &mut Bsdf, material: &Material) {
    let pbr = &material.pbr_metallic_roughness;
    let [r, g, b, _] = pbr.base_color_factor.unwrap_or([1.0; 4]);
    let factor = bsdf.unit_color("baseColorFactor", [r, g, b]);
    bsdf.color("base_color", factor, pbr.base_color_texture.as_ref());
    let texture = pbr.metallic_roughness_texture.as_ref();
    let metallic = bsdf.unit("metallicFactor", pbr.metallic_factor.unwrap_or(1.0));
    bsdf.number("metallic", metallic, texture, "b");
    let roughness = bsdf.unit("roughnessFactor", pbr.roughness_factor.unwrap_or(1.0));
    bsdf.number("roughness", roughness, texture, "g");
}

/// `KHR_materials_pbrSpecularGlossiness`, given up by Khronos: a diffuse base
/// whose reflectance at normal incidence is the specular colour, that is 0.04
/// (index 1.5) times `specular_color`; roughness is one less the glossiness.
fn specular_glossiness(bsdf: &mut Bsdf, old: &SpecularGlossiness) {
    let place = bsdf.place.clone();
    bsdf.objects.warn(
        &place,
        "KHR_materials_pbrSpecularGlossiness is out of use: converted to metallic-roughness, which comes near",
    );
    let [r, g, b, _] = old.diffuse_factor.unwrap_or([1.0; 4]);
    let specular = bsdf.unit_color("specularFactor", old.specular_factor.unwrap_or([1.0; 3]));
    let glossiness = bsdf.unit("glossinessFactor", old.glossiness_factor.unwrap_or(1.0));
    let texture = old.specular_glossiness_texture.as_ref();
    // What is reflected does not reach the base. A texture is taken to reflect
    // little, as those of insulators do.
    let through = if texture.is_some() { 1.0 } else { 1.0 - specular.into_iter().fold(0.0, f64::max) };
    let diffuse = bsdf.unit_color("diffuseFactor", [r, g, b]);
    bsdf.color("base_color", diffuse.map(|c| c * through), old.diffuse_texture.as_ref());
    bsdf.params.push(("metallic", Value::Float(0.0)));
    let rough = Recipe::Rough { glossiness };
    let roughness = texture.and_then(|info| bsdf.images.baked(bsdf.objects, bsdf.source, info, rough));
    bsdf.params.push(("roughness", roughness.unwrap_or(Value::Float(1.0 - glossiness))));
    bsdf.color("specular_color", specular.map(|c| c * 25.0), texture);
}
