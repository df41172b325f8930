//! Images for textures and environment maps: OpenEXR, Radiance HDR, PNG, JPEG,
//! TGA and BMP, known by their first bytes (TGA by its ending).
//!
//! Of an OpenEXR file this takes the channels R G B (A), or X Y Z (converted to
//! linear sRGB), or Y (A), of the one layer that has them, or the only channel
//! there is.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageError, ImageFormat, ImageReader, Limits};

use super::exr_file::{self, ExrFile};
use super::files;
use crate::desc::{Error, Image, Pixels, Result};

/// Reads an image whose pixels take at most `max_bytes`; gives warnings too.
pub fn read(path: &Path, name: &str, max_bytes: u64) -> Result<(Image, Vec<String>)> {
    if is_exr(path)? {
        let file = exr_file::read(path, max_bytes)?;
        let warnings = primaries_warning(&file, name).into_iter().collect();
        let image = from_exr(file, name)
            .map_err(|message| Error::new(format!("image `{}`: {message}", path.display())))?;
        return Ok((image, warnings));
    }
    let (image, _) = decode(path, max_bytes)?;
    Ok((from_dynamic(image, name), Vec::new()))
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

/// Decodes any format but OpenEXR.
pub fn decode(path: &Path, max_bytes: u64) -> Result<(DynamicImage, ImageFormat)> {
    let fail = |message: String| Error::new(format!("image `{}`: {message}", path.display()));
    let bytes = files::read_bytes(path, files::IMAGE_CAP)?;
    let mut reader = ImageReader::new(Cursor::new(&bytes))
        .with_guessed_format()
        .map_err(|e| fail(format!("cannot read it: {e}")))?;
    if reader.format().is_none()
        && let Ok(format @ ImageFormat::Tga) = ImageFormat::from_path(path)
    {
        reader.set_format(format);
    }
    let known = "known: EXR, HDR, PNG, JPEG, TGA, BMP";
    let Some(format) = reader.format() else {
        return Err(fail("no image format that is known".into()).hint(known));
    };
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(max_bytes);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| match e {
        ImageError::Limits(_) => {
            fail(format!("it takes more than the {max_bytes} bytes allowed by `max_image_bytes`"))
        }
        ImageError::Unsupported(e) => fail(format!("cannot decode it: {e}")).hint(known),
        e => fail(format!("cannot decode it: {e}")),
    })?;
    Ok((image, format))
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
        DynamicImage::ImageRgb32F(i) => Pixels::F32(i.into_raw()),
        other => return from_dynamic(DynamicImage::ImageRgb32F(other.into_rgb32f()), name),
    };
    Image { width, height, channels, pixels, name: name.to_string() }
}

/// Rec. 709 primaries and D65, which scene-linear RGB means here.
const REC709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];

fn primaries_warning(file: &ExrFile, name: &str) -> Option<String> {
    let given = file.chromaticities?;
    let differs = given.iter().zip(REC709).any(|(a, b)| (a - b).abs() > 2e-3);
    differs
        .then(|| format!("{name}: its primaries are not those of Rec. 709; they are taken as if they were"))
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

/// CIE XYZ to linear Rec. 709 (IEC 61966-2-1).
fn xyz_to_rgb([x, y, z]: [f32; 3]) -> [f32; 3] {
    [
        3.240_479 * x - 1.537_15 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ]
}

fn from_exr(file: ExrFile, name: &str) -> std::result::Result<Image, String> {
    let [width, height] = file.size;
    let image = |channels: u32, data: Vec<f32>| Image {
        width,
        height,
        channels,
        pixels: Pixels::F32(data),
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
            return Ok(image(names.len() as u32, interleave(&channels)));
        }
    }
    if let Some(channels) = pick(&file, layer, &["X", "Y", "Z"]) {
        let mut data = interleave(&channels);
        for pixel in data.chunks_exact_mut(3) {
            pixel.copy_from_slice(&xyz_to_rgb([pixel[0], pixel[1], pixel[2]]));
        }
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
