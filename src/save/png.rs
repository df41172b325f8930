//! Tone-mapped previews: 8-bit sRGB PNG.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

use super::file::write_whole;
use super::tone::Tone;
use crate::desc::{Error, Result};
use crate::film::Picture;
use crate::math::Rgb;

/// Writes the data window of `R`, `G`, `B` through a tone curve, without
/// dither and over black. Fails with the path and the reason when there is no
/// such picture or the file cannot be written, and then leaves a file that was
/// there untouched.
pub fn write_png(path: &Path, picture: &Picture, tone: Tone) -> Result<()> {
    let wrong = |what: &str| Error::new(format!("cannot write `{}`: {what}", path.display()));
    let channel = |name: &str| {
        picture.channel(name).ok_or_else(|| wrong(&format!("the picture has no channel `{name}`")))
    };
    let (r, g, b) = (channel("R")?, channel("G")?, channel("B")?);
    let (width, height) = (picture.window.width(), picture.window.height());
    if width == 0 || height == 0 {
        return Err(wrong("the picture has no pixels"));
    }
    let mut bytes = Vec::with_capacity(3 * width * height);
    for ((r, g), b) in r.iter().zip(g).zip(b) {
        let value = tone.apply(Rgb::new(*r, *g, *b));
        bytes.extend(value.to_array().map(|v| (v * 255.0).round() as u8));
    }
    write_whole(path, |file: &File| {
        let mut writer = BufWriter::new(file);
        let (width, height) = (width as u32, height as u32);
        let encoded =
            PngEncoder::new(&mut writer).write_image(&bytes, width, height, ExtendedColorType::Rgb8);
        encoded.map_err(|error| match error {
            ImageError::IoError(error) => error,
            other => io::Error::other(other.to_string()),
        })?;
        writer.flush()?;
        Ok(())
    })
}
