//! What materials emit: `emissiveFactor` and `KHR_materials_unlit` as area
//! lights, weighed by alpha. A fragment that is cut out gives no light, and one
//! that blends gives its share: where the alpha comes from a texture the product
//! is made in the texels.

use super::json::{Material, TextureInfo};
use super::material::{Materials, VertexColor, mode};
use super::objects::Objects;
use super::texture::{Recipe, Use, has_alpha, uv_set};
use crate::desc::{Category, ObjectId, Pos, Value};

/// How opaque a material is.
pub struct Opacity<'m> {
    /// What makes it of an alpha.
    pub recipe: Recipe,
    /// The alpha's texture, if it has an alpha that counts.
    pub texture: Option<&'m TextureInfo>,
}

impl Opacity<'_> {
    /// Where there is no texture.
    pub fn constant(&self) -> f64 {
        self.recipe.opacity(1.0)
    }
}

/// Light of its own, before alpha.
struct Glow<'m> {
    factor: [f64; 3],
    texture: Option<&'m TextureInfo>,
    /// The colours of the vertices multiply it.
    colors: bool,
}

impl Materials<'_> {
    /// What the alpha of a material does.
    pub(super) fn opacity<'m>(&self, material: &'m Material) -> Opacity<'m> {
        let old = material.extensions.specular_glossiness.as_ref();
        let pbr = &material.pbr_metallic_roughness;
        let factor = old.map_or(pbr.base_color_factor, |o| o.diffuse_factor).unwrap_or([1.0; 4])[3];
        let factor = factor.clamp(0.0, 1.0);
        let recipe = match mode(material) {
            "MASK" => Recipe::Cut { factor, cutoff: material.alpha_cutoff.unwrap_or(0.5) },
            "BLEND" => Recipe::Blend { factor },
            _ => return Opacity { recipe: Recipe::Blend { factor: 1.0 }, texture: None },
        };
        let texture = old.map_or(pbr.base_color_texture.as_ref(), |o| o.diffuse_texture.as_ref());
        let texture =
            texture.filter(|info| self.images.image(self.source, info).is_some_and(|i| has_alpha(i)));
        Opacity { recipe, texture }
    }

    /// Light that the surface gives off.
    pub(super) fn emission(
        &mut self,
        objects: &mut Objects,
        (material, place, pos): (&Material, &str, Pos),
        vertex: VertexColor,
    ) -> Option<ObjectId> {
        let strength = material.extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength);
        let factor = material.emissive_factor.map(|c| c.max(0.0) * strength.unwrap_or(1.0).max(0.0));
        if factor == [0.0; 3] {
            return None;
        }
        if material.extensions.clearcoat.as_ref().is_some_and(|c| c.clearcoat_factor > 0.0) {
            objects.warn(place, "glows through its clear coat without being darkened by it");
        }
        let glow = Glow { factor, texture: material.emissive_texture.as_ref(), colors: false };
        self.glow(objects, (material, place, pos), vertex, glow)
    }

    /// `KHR_materials_unlit`: the base colour is what the camera is to see, so it
    /// becomes radiance on a surface that reflects nothing. Unlike in a
    /// rasteriser other surfaces are lit by it.
    pub(super) fn unlit(
        &mut self,
        objects: &mut Objects,
        (material, place, pos): (&Material, &str, Pos),
        vertex: VertexColor,
    ) -> (ObjectId, Option<ObjectId>) {
        let pbr = &material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor.unwrap_or([1.0; 4]).map(|c| c.max(0.0));
        let bsdf = objects.add(Category::Bsdf, "diffuse", pos, vec![("reflectance", Value::Rgb([0.0; 3]))]);
        let glow = Glow { factor: [r, g, b], texture: pbr.base_color_texture.as_ref(), colors: vertex.rgb };
        (bsdf, self.glow(objects, (material, place, pos), vertex, glow))
    }

    /// An area light of a glow weighed by alpha; `None` where nothing is left.
    fn glow(
        &mut self,
        objects: &mut Objects,
        (material, place, pos): (&Material, &str, Pos),
        vertex: VertexColor,
        glow: Glow,
    ) -> Option<ObjectId> {
        let mut first = |info: &&TextureInfo, what: &str| {
            let first = uv_set(info) == 0;
            if !first {
                objects.warn(place, what);
            }
            first
        };
        let texture = glow.texture.filter(|info| {
            first(info, "glows without its texture, which is laid out by a second set of coordinates")
        });
        let opacity = self.opacity(material);
        let constant = opacity.constant();
        let alpha = opacity.texture.filter(|info| {
            first(info, "glows where its alpha hides it, which is laid out by a second set of coordinates")
        });
        let factor = glow.factor.map(|c| c * if opacity.texture.is_some() { 1.0 } else { constant });
        if factor == [0.0; 3] {
            return None;
        }
        let textured = match (texture, alpha) {
            (None, None) => None,
            (Some(info), None) => self.images.texture(objects, self.source, info, Use::color(factor)),
            (color, Some(alpha)) => {
                let weighed =
                    self.images.weighed(objects, self.source, (color, alpha), (opacity.recipe, factor));
                weighed.or_else(|| {
                    objects.warn(place, "glows where its alpha hides it, as that is in another image");
                    self.images.texture(objects, self.source, color?, Use::color(factor))
                })
            }
        };
        let radiance = textured.unwrap_or(Value::Rgb(factor));
        let mut params = vec![("radiance", radiance)];
        if material.double_sided {
            params.push(("two_sided", Value::Bool(true)));
        }
        if glow.colors {
            params.push(("vertex_color", Value::Bool(true)));
        }
        // As the mask around its bsdf.
        if vertex.alpha && mode(material) != "OPAQUE" {
            params.push(("vertex_alpha", Value::Bool(true)));
        }
        Some(objects.add(Category::Emitter, "area", pos, params))
    }
}
