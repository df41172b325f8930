//! Images for textures and environment maps: OpenEXR, Radiance HDR, PNG, JPEG,
//! WebP, TGA and BMP, known by their first bytes (TGA by its ending).
//!
//! Of an OpenEXR file this takes the channels R G B (A), or X Y Z, or Y (A), of
//! the one layer that has them, or the only channel there is. Colours of other
//! primaries or white than Rec. 709 are converted through CIE XYZ without
//! chromatic adaptation, as Mitsuba 3 does.

use std::io::{Cursor, ErrorKind};
use std::path::Path;

use glam::DMat3;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, ImageResult};

use super::exr_file::{self, ExrFile};
use super::files;
use super::foreign::{check_promise, guarded};
use crate::desc::{Error, Image, Pixels, Result};
use crate::math::DVec3;

/// What a hint names.
const KNOWN: &str = "known: EXR, HDR, PNG, JPEG, WebP, TGA, BMP";

/// Reads an image whose pixels take at most `max_bytes`.
pub fn read(path: &Path, name: &str, max_bytes: u64) -> Result<Image> {
    if is_exr(path)? {
        let file = exr_file::read(path, max_bytes)?;
        return from_exr(file, name)
            .map_err(|message| Error::new(format!("image `{}`: {message}", path.display())));
    }
    let (image, _) = decode(path, max_bytes)?;
    Ok(from_dynamic(image, name))
}

/// True if a file starts as OpenEXR files do.
pub fn is_exr(path: &Path) -> Result<bool> {
    use std::io::Read;
    let (file, _) = files::open(path, files::IMAGE_CAP)?;
    let mut start = Vec::new();
    file.take(4)
        .read_to_end(&mut start)
        .map_err(|e| Error::new(format!("cannot read `{}`: {e}", path.display())))?;
    Ok(start == exr_file::MAGIC)
}

/// What an image may be.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Bytes that its pixels may take.
    pub bytes: u64,
    /// What no other format knows is TGA, which has no mark of its own.
    pub tga: bool,
}

/// Decodes any format but OpenEXR.
pub fn decode(path: &Path, max_bytes: u64) -> Result<(DynamicImage, ImageFormat)> {
    let bytes = files::read_bytes(path, files::IMAGE_CAP)?;
    let tga = matches!(ImageFormat::from_path(path), Ok(ImageFormat::Tga));
    decode_dynamic(&bytes, &path.display().to_string(), Limits { bytes: max_bytes, tga })
}

/// Decodes any format but OpenEXR from the bytes of its file.
pub fn decode_bytes(bytes: &[u8], name: &str, limits: Limits) -> Result<Image> {
    decode_dynamic(bytes, name, limits).map(|(image, _)| from_dynamic(image, name))
}

/// Width and height as the start of a file promises them.
pub fn dimensions(bytes: &[u8]) -> Option<(u32, u32)> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok()?;
    guarded(|| reader.into_dimensions().map_err(|e| e.to_string())).ok()
}

fn decode_dynamic(bytes: &[u8], name: &str, limits: Limits) -> Result<(DynamicImage, ImageFormat)> {
    let fail = |message: String| Error::new(format!("image `{name}`: {message}"));
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| fail(format!("cannot read it: {e}")))?;
    if reader.format().is_none() && limits.tga {
        reader.set_format(ImageFormat::Tga);
    }
    let Some(format) = reader.format() else {
        return Err(fail("no image format that is known".into()).hint(KNOWN));
    };
    let mut is_unsupported = false;
    let decoded = guarded(|| {
        within(reader, bytes.len(), limits.bytes).map_err(|e| {
            is_unsupported = matches!(e, ImageError::Unsupported(_));
            match e {
                ImageError::Limits(_) => {
                    format!("it takes more than the {} bytes allowed by `max_image_bytes`", limits.bytes)
                }
                ImageError::IoError(e) if e.kind() == ErrorKind::Other => e.to_string(),
                e => format!("cannot decode it: {e}"),
            }
        })
    });
    match decoded {
        Ok(image) => Ok((image, format)),
        Err(message) if is_unsupported => Err(fail(message).hint(KNOWN)),
        Err(message) => Err(fail(message)),
    }
}

/// Decodes into at most so many bytes, and no more than the file can hold.
fn within(
    mut reader: ImageReader<Cursor<&[u8]>>,
    length: usize,
    max_bytes: u64,
) -> ImageResult<DynamicImage> {
    let mut allowed = image::Limits::no_limits();
    allowed.max_alloc = Some(max_bytes);
    reader.limits(allowed.clone());
    let ratio = match reader.format() {
        // Deflate packs 1032 to one, and a bit may stand for three bytes.
        Some(ImageFormat::Png) => 1032 * 24,
        // Two bits for a block of 64, whose colours may be halved both ways.
        Some(ImageFormat::Jpeg) => 4000,
        // A few bytes may stand for any number of pixels.
        _ => u64::MAX,
    };
    let mut decoder = reader.into_decoder()?;
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(broken("it has no pixels".into()));
    }
    allowed.reserve(decoder.total_bytes())?;
    check_promise(decoder.total_bytes(), length, ratio).map_err(broken)?;
    decoder.set_limits(allowed)?;
    DynamicImage::from_decoder(decoder)
}

fn broken(message: String) -> ImageError {
    ImageError::IoError(std::io::Error::other(message))
}

fn from_dynamic(image: DynamicImage, name: &str) -> Image {
    let (width, height) = (image.width(), image.height());
    let channels = u32::from(image.color().channel_count());
    let pixels = match image {
        DynamicImage::ImageLuma8(i) => Pixels::U8(i.into_raw()),
        DynamicImage::ImageLumaA8(i) => Pixels::U8(i.into_raw()),
        DynamicImage::ImageRgb8(i) => Pixels::U8(i.into_raw()),
        DynamicImage::ImageRgba8(i) => Pixels::U8(i.into_raw()),
        DynamicImage::ImageLuma16(i) => Pixels::U16(i.into_raw()),
        DynamicImage::ImageLumaA16(i) => Pixels::U16(i.into_raw()),
        DynamicImage::ImageRgb16(i) => Pixels::U16(i.into_raw()),
        DynamicImage::ImageRgba16(i) => Pixels::U16(i.into_raw()),
        DynamicImage::ImageRgb32F(i) => Pixels::from_floats(i.into_raw()),
        other => return from_dynamic(DynamicImage::ImageRgb32F(other.into_rgb32f()), name),
    };
    Image { width, height, channels, pixels, name: name.to_string() }
}

/// Rec. 709 primaries and D65, which scene-linear RGB means here.
const REC709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
/// Primaries of CIE XYZ itself.
const XYZ: [f32; 8] = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0];

/// RGB of these primaries to CIE XYZ; white has Y = 1.
fn to_xyz(primaries: &[f32; 8]) -> DMat3 {
    let p = primaries.map(f64::from);
    let xyz = |i: usize| DVec3::new(p[i], p[i + 1], 1.0 - p[i] - p[i + 1]);
    let unscaled = DMat3::from_cols(xyz(0), xyz(2), xyz(4));
    let scale = unscaled.inverse() * (xyz(6) / p[7]);
    unscaled * DMat3::from_diagonal(scale)
}

/// Converts the first three of `channels` per pixel to Rec. 709, if need be.
fn to_rec709(
    data: &mut [f32],
    channels: usize,
    primaries: Option<[f32; 8]>,
) -> std::result::Result<(), String> {
    let Some(primaries) = primaries else { return Ok(()) };
    if primaries.iter().zip(REC709).all(|(a, b)| (a - b).abs() < 1e-4) {
        return Ok(());
    }
    let matrix = to_xyz(&REC709).inverse() * to_xyz(&primaries);
    if !matrix.is_finite() {
        return Err("its chromaticities span no colours".into());
    }
    for pixel in data.chunks_exact_mut(channels) {
        let rgb = matrix * DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into());
        pixel[..3].copy_from_slice(&rgb.as_vec3().to_array());
    }
    Ok(())
}

/// The channels of one layer by their last names.
fn pick<'a>(file: &'a ExrFile, layer: &str, names: &[&str]) -> Option<Vec<&'a [f32]>> {
    let find = |wanted: &&str| {
        let is_wanted = |name: &str| {
            let (prefix, last) = name.rsplit_once('.').unwrap_or(("", name));
            prefix == layer && last.eq_ignore_ascii_case(wanted)
        };
        file.channels.iter().find(|(name, _)| is_wanted(name)).map(|(_, data)| data.as_slice())
    };
    names.iter().map(find).collect()
}

fn from_exr(file: ExrFile, name: &str) -> std::result::Result<Image, String> {
    let [width, height] = file.size;
    let image = |channels: u32, data: Vec<f32>| Image {
        width,
        height,
        channels,
        pixels: Pixels::from_floats(data),
        name: name.to_string(),
    };
    let mut layers: Vec<&str> =
        file.channels.iter().map(|(n, _)| n.rsplit_once('.').map_or("", |(layer, _)| layer)).collect();
    layers.sort_unstable();
    layers.dedup();
    let has = |layer: &&&str, names: &[&str]| pick(&file, layer, names).is_some();
    let coloured: Vec<&&str> = layers
        .iter()
        .filter(|l| has(l, &["R", "G", "B"]) || has(l, &["X", "Y", "Z"]) || has(l, &["Y"]))
        .collect();
    let layer = match coloured[..] {
        _ if coloured.contains(&&"") => "",
        [only] => only,
        _ => {
            if let [(_, only)] = &file.channels[..] {
                return Ok(image(1, only.clone()));
            }
            let names: Vec<&str> = file.channels.iter().map(|(n, _)| n.as_str()).collect();
            return Err(format!("no single layer with R, G, B or Y among its channels {}", names.join(", ")));
        }
    };
    for names in [&["R", "G", "B", "A"][..], &["R", "G", "B"]] {
        if let Some(channels) = pick(&file, layer, names) {
            let mut data = interleave(&channels);
            to_rec709(&mut data, names.len(), file.chromaticities)?;
            return Ok(image(names.len() as u32, data));
        }
    }
    if let Some(channels) = pick(&file, layer, &["X", "Y", "Z"]) {
        let mut data = interleave(&channels);
        to_rec709(&mut data, 3, Some(XYZ))?;
        return Ok(image(3, data));
    }
    if pick(&file, layer, &["RY"]).is_some() || pick(&file, layer, &["BY"]).is_some() {
        return Err("luminance and chroma channels are not read".into());
    }
    let names = if pick(&file, layer, &["A"]).is_some() { &["Y", "A"][..] } else { &["Y"] };
    let channels = pick(&file, layer, names).unwrap_or_default();
    Ok(image(channels.len() as u32, interleave(&channels)))
}

fn interleave(channels: &[&[f32]]) -> Vec<f32> {
    let count = channels.first().map_or(0, |c| c.len());
    let mut out = Vec::with_capacity(count * channels.len());
    for i in 0..count {
        out.extend(channels.iter().map(|c| c[i]));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rec. 709 to XYZ as published (IEC 61966-2-1, to its digits).
    #[test]
    fn primaries() {
        let m = to_xyz(&REC709).transpose().to_cols_array();
        let published = [0.4124, 0.3576, 0.1805, 0.2126, 0.7152, 0.0722, 0.0193, 0.1192, 0.9505];
        for (a, b) in m.into_iter().zip(published) {
            assert!((a - b).abs() < 1e-4, "{m:?}");
        }
        assert!(to_xyz(&XYZ).abs_diff_eq(DMat3::IDENTITY, 1e-6));
        let mut pixel = [0.4124, 0.2126, 0.0193, 0.5];
        to_rec709(&mut pixel, 4, Some(XYZ)).unwrap();
        assert!((pixel[0] - 1.0).abs() < 1e-3 && pixel[1].abs() < 1e-3 && pixel[3] == 0.5, "{pixel:?}");
        assert!(to_rec709(&mut pixel, 4, Some([0.3; 8])).is_err());
    }
}
