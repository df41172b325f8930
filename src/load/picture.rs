//! Whole pictures with all their channels by name, for comparing.

use std::path::Path;

use image::{DynamicImage, ImageFormat};

use super::{LoadOptions, exr_file, image_file};
use crate::desc::{Pos, Result};

/// A picture with named channels; row 0 is the top row.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Place of the top left pixel, not (0, 0) where an EXR file holds a crop.
    pub origin: [i32; 2],
    /// Channels as the file names them, each `width · height` linear values,
    /// row by row. Files without names have `R`, `G`, `B`, or `Y`, and `A`.
    pub channels: Vec<(String, Vec<f32>)>,
    /// Attributes of an EXR file that can be written as text, sorted by name.
    pub attributes: Vec<(String, String)>,
}

impl Picture {
    /// The values of a channel.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, data)| data.as_slice())
    }
}

/// Reads a picture: every channel of an EXR file (all parts), or the channels
/// of an HDR, PNG, JPEG, TGA or BMP file. Integer formats are decoded from sRGB
/// to linear; alpha is linear already.
pub fn read_picture(path: &Path) -> Result<Picture> {
    read_picture_within(path, LoadOptions::default().max_image_bytes)
}

/// The same for a picture that takes at most so many bytes.
pub fn read_picture_within(path: &Path, max_bytes: u64) -> Result<Picture> {
    read(path, max_bytes).map_err(|e| e.at(path.display().to_string(), Pos::default()))
}

fn read(path: &Path, max_bytes: u64) -> Result<Picture> {
    if image_file::is_exr(path)? {
        let file = exr_file::read(path, max_bytes)?;
        let [width, height] = file.size;
        let (origin, channels, attributes) = (file.origin, file.channels, file.attributes);
        return Ok(Picture { width, height, origin, channels, attributes });
    }
    let (image, format) = image_file::decode(path, max_bytes)?;
    Ok(from_dynamic(&image, format))
}

fn from_dynamic(image: &DynamicImage, format: ImageFormat) -> Picture {
    let (width, height) = (image.width(), image.height());
    let color = image.color();
    let mut names = if color.has_color() { vec!["R", "G", "B"] } else { vec!["Y"] };
    if color.has_alpha() {
        names.push("A");
    }
    let is_encoded = format != ImageFormat::Hdr;
    let rgba = image.to_rgba32f().into_raw();
    let channel = |name: &&str| {
        let slot = match *name {
            "G" => 1,
            "B" => 2,
            "A" => 3,
            _ => 0,
        };
        let decode = |v: f32| if is_encoded && slot < 3 { srgb_to_linear(v) } else { v };
        (name.to_string(), rgba.iter().skip(slot).step_by(4).map(|v| decode(*v)).collect())
    };
    Picture { width, height, channels: names.iter().map(channel).collect(), ..Picture::default() }
}

/// IEC 61966-2-1.
fn srgb_to_linear(v: f32) -> f32 {
    let v = f64::from(v);
    let linear = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    linear as f32
}
