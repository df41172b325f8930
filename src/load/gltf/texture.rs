//! Images and textures. An image is decoded once, however many textures show
//! it and whichever of its channels they read.
//!
//! Texture coordinates need no turning: v of glTF grows from the top row of an
//! image down, and so does that of a bitmap here, whose row 0 is at v = 0.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use half::f16;
use rayon::prelude::*;

use super::super::{LoadOptions, files, image_file};
use super::fail;
use super::geometry::uv_attribute;
use super::json::{Material, TextureInfo};
use super::objects::Objects;
use super::source::{Budget, Source, wrap};
use crate::color::srgb_to_linear;
use crate::desc::{Category, Error, Image, Pixels, Pos, Result, SceneDesc, Value};
use crate::math::{DMat4, DVec4, Transform};

/// All images of a file together may take this many times what one may.
const ALL_IMAGES: u64 = 8;

/// What a texture is read for.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// Numbers as they are; else colours in sRGB.
    pub raw: bool,
    /// `r`, `g`, `b`, `a` or `rgb`.
    pub channel: &'static str,
    /// Factor on what is read.
    pub scale: Scale,
}

/// A factor on a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// The same for all channels.
    Grey(f64),
    /// One for each.
    Rgb([f64; 3]),
}

impl Use {
    /// A colour times a factor.
    pub fn color(factor: [f64; 3]) -> Use {
        Use { raw: false, channel: "rgb", scale: Scale::Rgb(factor) }
    }

    /// One channel times a factor.
    pub fn channel(channel: &'static str, factor: f64) -> Use {
        Use { raw: true, channel, scale: Scale::Grey(factor) }
    }
}

/// The images that the materials in use read.
#[derive(Debug)]
pub struct Images {
    decoded: HashMap<usize, Arc<Image>>,
    /// Where each is in the scene description, once something shows it.
    attached: HashMap<usize, u32>,
    /// Those made of others: of whose colours, of whose alpha, by which recipe.
    made: HashMap<(Option<usize>, usize, String), u32>,
    budget: Budget,
    failed: Option<Error>,
}

/// All textures of a material that a path tracer reads. (Occlusion is what it
/// works out itself.)
pub fn textures_of(material: &Material) -> Vec<&TextureInfo> {
    let (pbr, ext) = (&material.pbr_metallic_roughness, &material.extensions);
    let mut all = vec![
        pbr.base_color_texture.as_ref(),
        pbr.metallic_roughness_texture.as_ref(),
        material.normal_texture.as_ref(),
        material.emissive_texture.as_ref(),
    ];
    if let Some(e) = &ext.anisotropy {
        all.push(e.anisotropy_texture.as_ref());
    }
    if let Some(e) = &ext.clearcoat {
        let textures = [&e.clearcoat_texture, &e.clearcoat_roughness_texture, &e.clearcoat_normal_texture];
        all.extend(textures.map(Option::as_ref));
    }
    if let Some(e) = &ext.diffuse_transmission {
        let textures = [&e.diffuse_transmission_texture, &e.diffuse_transmission_color_texture];
        all.extend(textures.map(Option::as_ref));
    }
    if let Some(e) = &ext.iridescence {
        all.extend([&e.iridescence_texture, &e.iridescence_thickness_texture].map(Option::as_ref));
    }
    if let Some(e) = &ext.sheen {
        all.extend([&e.sheen_color_texture, &e.sheen_roughness_texture].map(Option::as_ref));
    }
    if let Some(e) = &ext.specular {
        all.extend([&e.specular_texture, &e.specular_color_texture].map(Option::as_ref));
    }
    if let Some(e) = &ext.specular_glossiness {
        all.extend([&e.diffuse_texture, &e.specular_glossiness_texture].map(Option::as_ref));
    }
    if let Some(e) = &ext.transmission {
        all.push(e.transmission_texture.as_ref());
    }
    all.into_iter().flatten().collect()
}

/// The set of texture coordinates that a texture is looked up with.
pub fn uv_set(info: &TextureInfo) -> u32 {
    info.extensions.transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(info.tex_coord)
}

/// The image that a texture shows. `None` for one that shows none.
fn image_of(
    source: &Source,
    texture: usize,
    place: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<usize>> {
    let Some(found) = source.root.textures.get(texture) else {
        return Err(fail(place, format!("there is no textures[{texture}]")));
    };
    let place = format!("textures[{texture}]");
    let webp = found.extensions.webp.as_ref().and_then(|e| e.source);
    let index = match (webp, found.source) {
        (Some(index), _) | (None, Some(index)) => index,
        (None, None) => {
            let unread = [
                ("KHR_texture_basisu", found.extensions.basisu.as_ref(), "KTX2"),
                ("MSFT_texture_dds", found.extensions.dds.as_ref(), "DDS"),
            ];
            if let Some((extension, _, format)) = unread.iter().find(|(_, e, _)| e.is_some()) {
                let message = format!("is a {format} image by {extension}, which is not decoded");
                return Err(fail(&place, message).hint(
                    "convert it to PNG or JPEG, for example with `gltf-transform ktxdecompress` or `toktx`",
                ));
            }
            warnings.push(format!("{}: {place}: has no image", source.name));
            return Ok(None);
        }
    };
    if index >= source.root.images.len() {
        return Err(fail(&place, format!("there is no images[{index}]")));
    }
    Ok(Some(index))
}

impl Images {
    /// Decodes the images of some materials, in parallel. A lenient scene goes
    /// without those that cannot be had.
    pub fn decode<'a>(
        source: &Source,
        materials: impl Iterator<Item = (usize, &'a Material)>,
        options: &LoadOptions,
        scene: &mut SceneDesc,
    ) -> Result<Images> {
        let missing = |scene: &SceneDesc, error: Error| {
            scene.replace(error.at(source.name.clone(), Pos::default()), "its texture is left out")
        };
        let (mut wanted, mut warnings) = (BTreeSet::new(), Vec::new());
        for (index, material) in materials {
            for info in textures_of(material) {
                match image_of(source, info.index, &format!("materials[{index}]"), &mut warnings) {
                    Ok(image) => wanted.extend(image),
                    Err(error) => missing(scene, error)?,
                }
            }
        }
        warnings.dedup();
        scene.warnings.append(&mut warnings);
        let budget = Budget::new(options.max_image_bytes.saturating_mul(ALL_IMAGES));
        let decoded: Vec<(usize, Result<Image>)> =
            wanted.into_par_iter().map(|index| (index, decode(source, index, options, &budget))).collect();
        let mut images = HashMap::new();
        for (index, result) in decoded {
            match result {
                Ok(image) => {
                    images.insert(index, Arc::new(image));
                }
                Err(error) => missing(scene, error)?,
            }
        }
        Ok(Images { decoded: images, attached: HashMap::new(), made: HashMap::new(), budget, failed: None })
    }

    /// The pixels that a texture shows.
    pub fn image(&self, source: &Source, info: &TextureInfo) -> Option<&Arc<Image>> {
        let index = image_of(source, info.index, "", &mut Vec::new()).ok()??;
        self.decoded.get(&index)
    }

    /// A `<texture type="bitmap">`; `None` when the texture has no image.
    pub fn texture(
        &mut self,
        objects: &mut Objects,
        source: &Source,
        info: &TextureInfo,
        usage: Use,
    ) -> Option<Value> {
        let index = image_of(source, info.index, "", &mut Vec::new()).ok()??;
        let image = self.decoded.get(&index)?;
        let attached = self.attached.entry(index).or_insert_with(|| objects.image(image.clone()));
        let image = (*attached, image.name.clone());
        Some(bitmap(objects, source, info, usage, image))
    }

    /// As [`Images::texture`], of an image of one channel that is made for it,
    /// once for each recipe.
    pub fn baked(
        &mut self,
        objects: &mut Objects,
        source: &Source,
        info: &TextureInfo,
        recipe: Recipe,
    ) -> Option<Value> {
        let index = image_of(source, info.index, "", &mut Vec::new()).ok()??;
        let image = self.decoded.get(&index)?.clone();
        let count = image.width as usize * image.height as usize;
        let made =
            self.made((None, index, format!("{recipe:?}")), objects, (&image, 1, recipe.size()), || {
                let texels = (0..count).map(|i| recipe.make(texel(&image, i)));
                match recipe {
                    Recipe::Cut { .. } => Pixels::U8(texels.map(|v| (v * 255.0) as u8).collect()),
                    _ => Pixels::F32(texels.collect()),
                }
            })?;
        Some(bitmap(objects, source, info, Use::channel("r", 1.0), made))
    }

    /// Colours (white without a texture) times what a recipe makes of the alpha
    /// of another texture, times a factor; `None` where the two are not laid out
    /// alike.
    pub fn weighed(
        &mut self,
        objects: &mut Objects,
        source: &Source,
        (color, alpha): (Option<&TextureInfo>, &TextureInfo),
        (recipe, factor): (Recipe, [f64; 3]),
    ) -> Option<Value> {
        let index = |info: &TextureInfo| image_of(source, info.index, "", &mut Vec::new()).ok()?;
        let opaque = self.decoded.get(&index(alpha)?)?.clone();
        let colors = color.and_then(|info| self.decoded.get(&index(info)?)).cloned();
        let layout =
            |info: &TextureInfo| (to_uv(info), source.root.textures[info.index].sampler, uv_set(info));
        let alike = color.is_none_or(|info| layout(info) == layout(alpha))
            && colors.as_ref().is_none_or(|c| (c.width, c.height) == (opaque.width, opaque.height));
        if !alike {
            return None;
        }
        let key = (color.and_then(index), index(alpha)?, format!("{recipe:?}"));
        let count = opaque.width as usize * opaque.height as usize;
        let made = self.made(key, objects, (&opaque, 3, 4), || {
            let of = |i: usize| {
                let share = recipe.make(texel(&opaque, i));
                let c = colors.as_ref().map_or([1.0; 4], |image| linear(image, i));
                [c[0] * share, c[1] * share, c[2] * share]
            };
            Pixels::F32((0..count).flat_map(of).collect())
        })?;
        Some(bitmap(objects, source, color.unwrap_or(alpha), Use::color(factor), made))
    }

    /// An image made of others, as large as `like`, unless it is there already;
    /// `None` where that is more than all images may take.
    fn made(
        &mut self,
        key: (Option<usize>, usize, String),
        objects: &mut Objects,
        (like, channels, size): (&Image, u32, u64),
        pixels: impl FnOnce() -> Pixels,
    ) -> Option<(u32, String)> {
        if let Some(id) = self.made.get(&key) {
            return Some((*id, like.name.clone()));
        }
        let bytes = u64::from(like.width) * u64::from(like.height) * u64::from(channels) * size;
        if let Err(error) = self.budget.take(bytes, &format!("images[{}]", key.1)) {
            self.failed.get_or_insert(error);
            return None;
        }
        let Image { width, height, .. } = *like;
        let image = Image { width, height, channels, pixels: pixels(), name: like.name.clone() };
        let id = objects.image(Arc::new(image));
        self.made.insert(key, id);
        Some((id, like.name.clone()))
    }

    /// What went wrong with an image that was to be made, once.
    pub fn failed(&mut self) -> Option<Error> {
        self.failed.take()
    }
}

/// What is made of a texel.
#[derive(Clone, Copy, Debug)]
pub enum Recipe {
    /// Opacity 0 or 1: whether alpha times a factor reaches the cutoff.
    Cut { factor: f64, cutoff: f64 },
    /// Opacity: alpha times a factor.
    Blend { factor: f64 },
    /// Roughness: one less alpha times the glossiness.
    Rough { glossiness: f64 },
    /// The angle of the direction in red and green, plus another.
    Angle { turned: f64 },
    /// A number between two, by the green.
    Between { least: f64, most: f64 },
}

impl Recipe {
    /// The opacity at an alpha; 1 of what is no opacity.
    pub fn opacity(self, alpha: f64) -> f64 {
        match self {
            Recipe::Cut { factor, cutoff } => f64::from(u8::from(alpha * factor >= cutoff)),
            Recipe::Blend { factor } => alpha * factor,
            _ => 1.0,
        }
    }

    fn make(self, c: [f32; 4]) -> f32 {
        match self {
            Recipe::Cut { .. } | Recipe::Blend { .. } => self.opacity(f64::from(c[3])) as f32,
            Recipe::Rough { glossiness } => 1.0 - c[3] * glossiness as f32,
            Recipe::Angle { turned } => turned as f32 + (c[1] * 2.0 - 1.0).atan2(c[0] * 2.0 - 1.0),
            Recipe::Between { least, most } => (least + (most - least) * f64::from(c[1])) as f32,
        }
    }

    /// Bytes that one takes.
    fn size(self) -> u64 {
        if matches!(self, Recipe::Cut { .. }) { 1 } else { 4 }
    }
}

/// A texel as a colour: integers are stored in sRGB.
fn linear(image: &Image, index: usize) -> [f32; 4] {
    let [r, g, b, a] = texel(image, index);
    match image.pixels {
        Pixels::F16(_) | Pixels::F32(_) => [r, g, b, a],
        _ => [srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b), a],
    }
}

/// Red, green, blue and alpha of a texel as stored, 1 = white.
pub fn texel(image: &Image, index: usize) -> [f32; 4] {
    let channels = image.channels as usize;
    let at = |c: usize| match &image.pixels {
        Pixels::U8(p) => f32::from(p[index * channels + c]) / 255.0,
        Pixels::U16(p) => f32::from(p[index * channels + c]) / 65535.0,
        Pixels::F16(p) => p[index * channels + c].to_f32(),
        Pixels::F32(p) => p[index * channels + c],
    };
    match channels {
        1 => [at(0), at(0), at(0), 1.0],
        2 => [at(0), at(0), at(0), at(1)],
        3 => [at(0), at(1), at(2), 1.0],
        _ => [at(0), at(1), at(2), at(3)],
    }
}

/// True if anything of an image is not opaque.
pub fn has_alpha(image: &Image) -> bool {
    let channels = image.channels as usize;
    if channels % 2 == 1 {
        return false;
    }
    match &image.pixels {
        Pixels::U8(p) => p.chunks_exact(channels).any(|c| c[channels - 1] != u8::MAX),
        Pixels::U16(p) => p.chunks_exact(channels).any(|c| c[channels - 1] != u16::MAX),
        Pixels::F16(p) => p.chunks_exact(channels).any(|c| c[channels - 1] != f16::ONE),
        Pixels::F32(p) => p.chunks_exact(channels).any(|c| c[channels - 1] != 1.0),
    }
}

fn bitmap(
    objects: &mut Objects,
    source: &Source,
    info: &TextureInfo,
    usage: Use,
    image: (u32, String),
) -> Value {
    let texture = &source.root.textures[info.index];
    let sampler = texture.sampler.and_then(|s| source.root.samplers.get(s)).cloned().unwrap_or_default();
    let wrap = |mode: Option<u32>| {
        let word = match mode {
            Some(33071) => "clamp",
            Some(33648) => "mirror",
            _ => "repeat",
        };
        Value::String(word.into())
    };
    let filter = if sampler.mag_filter == Some(9728) { "nearest" } else { "bilinear" };
    let mut params = vec![
        ("filename", Value::String(image.1)),
        ("image", Value::Image(image.0)),
        ("raw", Value::Bool(usage.raw)),
        ("filter_type", Value::String(filter.into())),
        ("wrap_mode_u", wrap(sampler.wrap_s)),
        ("wrap_mode_v", wrap(sampler.wrap_t)),
    ];
    if usage.channel != "rgb" {
        params.push(("channel", Value::String(usage.channel.into())));
    }
    match usage.scale {
        Scale::Grey(1.0) | Scale::Rgb([1.0, 1.0, 1.0]) => {}
        Scale::Grey(factor) => params.push(("scale", Value::Float(factor))),
        Scale::Rgb(factor) => params.push(("scale", Value::Rgb(factor))),
    }
    if let Some(to_uv) = to_uv(info) {
        params.push(("to_uv", Value::Transform(to_uv)));
    }
    if uv_set(info) > 0 {
        params.push(("uv_attribute", Value::String(uv_attribute(uv_set(info)))));
    }
    let pos = objects.pos(&format!("textures[{}]", info.index));
    Value::Object(objects.add(Category::Texture, "bitmap", pos, params))
}

/// `KHR_texture_transform`: scaled, turned counter-clockwise as seen with v
/// downwards, moved.
fn to_uv(info: &TextureInfo) -> Option<Transform> {
    let transform = info.extensions.transform.as_ref()?;
    let (sin, cos) = transform.rotation.sin_cos();
    // A texture may be stretched to one colour, but a transform has an inverse.
    let [x, y] = transform.scale.unwrap_or([1.0; 2]).map(|s| if s.abs() < 1e-9 { 1e-9 } else { s });
    let [u, v] = transform.offset;
    let matrix = DMat4::from_cols(
        DVec4::new(cos * x, -sin * x, 0.0, 0.0),
        DVec4::new(sin * y, cos * y, 0.0, 0.0),
        DVec4::Z,
        DVec4::new(u, v, 0.0, 1.0),
    );
    Transform::from_matrix(matrix).filter(|t| *t != Transform::IDENTITY)
}

fn decode(source: &Source, index: usize, options: &LoadOptions, budget: &Budget) -> Result<Image> {
    let image = &source.root.images[index];
    let place = format!("images[{index}]");
    let (bytes, name) = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => {
            let bytes = source.fetch(uri, files::IMAGE_CAP, &format!("{place}.uri"))?;
            (bytes, if uri.starts_with("data:") { String::new() } else { uri.clone() })
        }
        (None, Some(view)) => (source.view(view, &place)?.0.to_vec(), String::new()),
        (None, None) => return Err(fail(&place, "needs a `uri` or a `bufferView`")),
    };
    let name = match (name.is_empty(), image.name.is_empty()) {
        (false, _) => name,
        (true, false) => format!("{place} `{}`", image.name),
        (true, true) => place.clone(),
    };
    let hint = image.mime_type.as_deref().unwrap_or_default();
    if bytes.starts_with(b"\xabKTX") {
        return Err(fail(&place, "is a KTX image, which is not decoded").hint("convert it to PNG or JPEG"));
    }
    let limits = image_file::Limits { bytes: options.max_image_bytes, tga: hint == "image/x-tga" };
    // Four channels of a byte each is the least that most decoders need.
    let least = image_file::dimensions(&bytes)
        .map_or(0, |(width, height)| u64::from(width).saturating_mul(u64::from(height)).saturating_mul(4));
    budget.take(least, &place)?;
    let image = image_file::decode_bytes(&bytes, &name, limits).map_err(|e| wrap(&place, e))?;
    budget.take((image.pixels.bytes() as u64).saturating_sub(least), &place)?;
    Ok(image)
}
