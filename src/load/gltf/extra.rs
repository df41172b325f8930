//! The `KHR_materials_…` extensions as parameters of `<bsdf type="gltf">`.

use super::json::{Anisotropy, Iridescence, MaterialExtensions, Volume};
use super::material::Bsdf;
use super::texture::{Recipe, Use};
use crate::desc::Value;

/// Adds what the extensions of a material ask for. The older
/// `KHR_materials_pbrSpecularGlossiness` has a specular colour of its own: where
/// it is there, index and specular extension do not count.
pub fn extensions(bsdf: &mut Bsdf, ext: &MaterialExtensions) {
    let old = ext.specular_glossiness.is_some();
    if let Some(ior) = ext.ior.as_ref().filter(|_| !old).and_then(|e| e.ior) {
        index(bsdf, ior);
    }
    if let Some(e) = ext.specular.as_ref().filter(|_| !old) {
        let factor = bsdf.unit("specularFactor", e.specular_factor.unwrap_or(1.0));
        bsdf.number("specular", factor, e.specular_texture.as_ref(), "a");
        let color = e.specular_color_factor.unwrap_or([1.0; 3]).map(|c| c.max(0.0));
        bsdf.color("specular_color", color, e.specular_color_texture.as_ref());
    }
    if let Some(e) = &ext.transmission {
        let factor = bsdf.unit("transmissionFactor", e.transmission_factor);
        bsdf.number("transmission", factor, e.transmission_texture.as_ref(), "r");
    }
    if let Some(e) = &ext.volume {
        volume(bsdf, e);
    }
    if let Some(e) = ext.dispersion.as_ref().filter(|e| e.dispersion > 0.0) {
        bsdf.params.push(("dispersion", Value::Float(e.dispersion)));
    }
    if let Some(e) = ext.clearcoat.as_ref().filter(|e| e.clearcoat_factor > 0.0) {
        let factor = bsdf.unit("clearcoatFactor", e.clearcoat_factor);
        bsdf.number("clearcoat", factor, e.clearcoat_texture.as_ref(), "r");
        let factor = bsdf.unit("clearcoatRoughnessFactor", e.clearcoat_roughness_factor);
        bsdf.number("clearcoat_roughness", factor, e.clearcoat_roughness_texture.as_ref(), "g");
        let normal = e.clearcoat_normal_texture.as_ref();
        bsdf.normal("clearcoat_normal", normal);
        if let Some(scale) = normal.and_then(|info| info.scale) {
            bsdf.params.push(("clearcoat_normal_scale", Value::Float(scale)));
        }
    }
    if let Some(e) = ext.sheen.as_ref().filter(|e| e.sheen_color_factor.iter().any(|c| *c > 0.0)) {
        let color = bsdf.unit_color("sheenColorFactor", e.sheen_color_factor);
        bsdf.color("sheen_color", color, e.sheen_color_texture.as_ref());
        let factor = bsdf.unit("sheenRoughnessFactor", e.sheen_roughness_factor);
        bsdf.number("sheen_roughness", factor, e.sheen_roughness_texture.as_ref(), "a");
    }
    if let Some(e) = ext.anisotropy.as_ref().filter(|e| e.anisotropy_strength != 0.0) {
        anisotropy(bsdf, e);
    }
    if let Some(e) = ext.iridescence.as_ref().filter(|e| e.iridescence_factor > 0.0) {
        iridescence(bsdf, e);
    }
    if let Some(e) = ext.diffuse_transmission.as_ref().filter(|e| e.diffuse_transmission_factor > 0.0) {
        let factor = bsdf.unit("diffuseTransmissionFactor", e.diffuse_transmission_factor);
        bsdf.number("diffuse_transmission", factor, e.diffuse_transmission_texture.as_ref(), "a");
        let color = e.diffuse_transmission_color_factor.unwrap_or([1.0; 3]);
        let color = bsdf.unit_color("diffuseTransmissionColorFactor", color);
        bsdf.color("diffuse_transmission_color", color, e.diffuse_transmission_color_texture.as_ref());
    }
}

/// An index of 0 means that everything is reflected, to the bsdf as to the
/// extension.
fn index(bsdf: &mut Bsdf, ior: f64) {
    let place = bsdf.place.clone();
    let value = match ior {
        ior if ior == 0.0 || ior >= 1.0 => ior,
        ior => {
            bsdf.objects.warn(&place, &format!("an index of refraction of {ior} is taken for 1"));
            1.0
        }
    };
    bsdf.params.push(("ior", Value::Float(value)));
}

/// Only whether there is a thickness counts: it says that the mesh is the
/// surface of a body, and how thick that is the mesh itself tells.
fn volume(bsdf: &mut Bsdf, volume: &Volume) {
    if !(volume.thickness_factor > 0.0) {
        return;
    }
    bsdf.params.push(("thickness", Value::Float(volume.thickness_factor)));
}

/// What fills the body that a material is the surface of, if it takes light
/// away: absorption per metre, and that only where light gets in.
///
/// After the distance that the extension gives, the colour that it gives is
/// left. A colour of 0 lets as good as nothing through at any distance.
pub fn interior(ext: &MaterialExtensions) -> Option<[f64; 3]> {
    const BLACK: f64 = 1e-30;
    let volume = ext.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0)?;
    ext.transmission.as_ref().filter(|e| e.transmission_factor > 0.0)?;
    let distance = volume.attenuation_distance.filter(|d| *d > 0.0 && d.is_finite())?;
    let sigma = volume.attenuation_color?.map(|c| -c.clamp(BLACK, 1.0).ln() / distance);
    sigma.iter().any(|s| *s > 0.0).then_some(sigma)
}

/// The texture's red and green are the direction, its blue is the strength.
fn anisotropy(bsdf: &mut Bsdf, e: &Anisotropy) {
    let strength = bsdf.unit("anisotropyStrength", e.anisotropy_strength);
    bsdf.number("anisotropy", strength, e.anisotropy_texture.as_ref(), "b");
    let angle = Recipe::Angle { turned: e.anisotropy_rotation };
    let baked = e
        .anisotropy_texture
        .as_ref()
        .and_then(|info| bsdf.images.baked(bsdf.objects, bsdf.source, info, angle));
    if let Some(Value::Object(texture)) = &baked {
        // Between angles there is no blending: they jump by a whole turn.
        let params = &mut bsdf.objects.desc.objects[*texture as usize].params;
        let filter = params.iter_mut().find(|p| p.name == "filter_type");
        filter.into_iter().for_each(|p| p.value = Value::String("nearest".into()));
    }
    bsdf.params.push(("anisotropy_rotation", baked.unwrap_or(Value::Float(e.anisotropy_rotation))));
}

/// A film between two thicknesses in nanometres, by the green of the texture.
fn iridescence(bsdf: &mut Bsdf, e: &Iridescence) {
    let factor = bsdf.unit("iridescenceFactor", e.iridescence_factor);
    bsdf.number("iridescence", factor, e.iridescence_texture.as_ref(), "r");
    bsdf.params.push(("iridescence_ior", Value::Float(e.iridescence_ior.unwrap_or(1.3).max(1.0))));
    let least = e.iridescence_thickness_minimum.unwrap_or(100.0).max(0.0);
    let most = e.iridescence_thickness_maximum.unwrap_or(400.0).max(0.0);
    let texture = e.iridescence_thickness_texture.as_ref().and_then(|info| {
        if least == 0.0 {
            return bsdf.images.texture(bsdf.objects, bsdf.source, info, Use::channel("g", most));
        }
        bsdf.images.baked(bsdf.objects, bsdf.source, info, Recipe::Between { least, most })
    });
    bsdf.params.push(("iridescence_thickness", texture.unwrap_or(Value::Float(most))));
}
