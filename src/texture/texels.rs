//! Reads the texels of a decoded image as linear RGB, without copying it.
//!
//! 8 and 16 bit samples are decoded by table (sRGB, IEC 61966-2-1, or plain
//! division when raw); floats are linear as they stand. Alpha is dropped, not
//! multiplied in, as Mitsuba does.

use std::sync::{Arc, LazyLock};

use half::f16;

use crate::color::srgb_to_linear;
use crate::desc::{Error, Image, Pixels, Result};
use crate::math::{DVec3, Rgb};

static SRGB_8: LazyLock<Vec<f32>> = LazyLock::new(|| table(u8::MAX.into(), srgb_to_linear));
static SRGB_16: LazyLock<Vec<f32>> = LazyLock::new(|| table(u16::MAX.into(), srgb_to_linear));
static RAW_8: LazyLock<Vec<f32>> = LazyLock::new(|| table(u8::MAX.into(), |x| x));
static RAW_16: LazyLock<Vec<f32>> = LazyLock::new(|| table(u16::MAX.into(), |x| x));

fn table(max: u32, decode: impl Fn(f32) -> f32) -> Vec<f32> {
    (0..=max).map(|i| decode(i as f32 / max as f32)).collect()
}

/// A finite half: its bits moved to where those of a float are, and the
/// difference of the exponents' biases multiplied in, which is right for
/// subnormal ones too. (The crate's own asks what the machine can do each time.)
#[inline]
fn decode_half(x: f16) -> f32 {
    const BIASES: f32 = f32::from_bits((127 + 127 - 15) << 23);
    let bits = u32::from(x.to_bits());
    f32::from_bits(((bits & 0x8000) << 16) | ((bits & 0x7fff) << 13)) * BIASES
}

/// An image as linear RGB texels; row 0 is the top row.
#[derive(Clone, Debug)]
pub struct Texels {
    image: Arc<Image>,
    decode: &'static [f32],
    /// Integers are taken as they are.
    raw: bool,
    /// The one channel that is read.
    only: Option<u8>,
}

/// What a pass over all texels finds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Summary {
    /// Mean colour.
    pub mean: Rgb,
    /// Largest channel.
    pub max: f32,
    /// The colour of all texels, when they are all equal.
    pub uniform: Option<Rgb>,
}

impl Texels {
    /// Views `image`; integer samples are decoded from sRGB unless `raw`.
    /// Fails on an image without pixels or of an unknown number of channels.
    pub fn new(image: Arc<Image>, raw: bool) -> Result<Texels> {
        let decode: &'static [f32] = match (&image.pixels, raw) {
            (Pixels::U8(_), false) => &SRGB_8,
            (Pixels::U8(_), true) => &RAW_8,
            (Pixels::U16(_), false) => &SRGB_16,
            (Pixels::U16(_), true) => &RAW_16,
            (Pixels::F16(_) | Pixels::F32(_), _) => &[],
        };
        let samples = match &image.pixels {
            Pixels::U8(v) => v.len(),
            Pixels::U16(v) => v.len(),
            Pixels::F16(v) => v.len(),
            Pixels::F32(v) => v.len(),
        };
        let Image { width, height, channels, .. } = *image;
        let expected = u64::from(width) * u64::from(height) * u64::from(channels);
        if expected == 0 || !(1..=4).contains(&channels) || expected != samples as u64 {
            return Err(Error::new(format!(
                "image `{}` of {width} x {height} pixels and {channels} channels with {samples} samples \
                 is no texture",
                image.name
            ))
            .hint("an image needs at least one pixel and 1 to 4 channels"));
        }
        Ok(Texels { image, decode, raw, only: None })
    }

    /// The same with one channel (0 to 3 for red to alpha) in all three
    /// places. Alpha is linear. Fails when the image has no such channel; red,
    /// green and blue of a grey image are its grey.
    pub fn channel(self, only: Option<u8>) -> Result<Texels> {
        let Some(channel) = only else { return Ok(self) };
        let grey = self.is_grey();
        let index = match (channel, self.image.channels) {
            (3, 2) => 1,
            (3, 4) => 3,
            (3, _) => {
                return Err(Error::new(format!("image `{}` has no alpha channel", self.image.name)));
            }
            (_, _) if grey => 0,
            (c, _) => c,
        };
        let decode: &'static [f32] = match &self.image.pixels {
            Pixels::U8(_) if channel == 3 => &RAW_8,
            Pixels::U16(_) if channel == 3 => &RAW_16,
            _ => self.decode,
        };
        Ok(Texels { only: Some(index), decode, ..self })
    }

    /// Pixels per row, at least 1.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.image.width
    }

    /// Rows, at least 1.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.image.height
    }

    /// True when it has a single colour channel.
    #[must_use]
    pub fn is_grey(&self) -> bool {
        self.image.channels <= 2 || self.only.is_some()
    }

    /// Samples per texel in the image.
    pub(super) fn channels(&self) -> usize {
        self.image.channels as usize
    }

    /// What tells the image, and how it is decoded, from others while it is alive.
    pub(super) fn key(&self) -> (*const Image, bool) {
        (Arc::as_ptr(&self.image), self.raw)
    }

    /// The same channels of another image, whose samples are linear.
    pub(super) fn of_level(&self, level: &Arc<Image>) -> Texels {
        Texels { image: level.clone(), decode: &[], ..*self }
    }

    /// All samples of texel (`x`, `y`), linear, whatever channels are read; zero
    /// beyond what the image has.
    pub(super) fn stored(&self, x: u32, y: u32) -> [f32; 4] {
        let channels = self.channels();
        let i = (y as usize * self.image.width as usize + x as usize) * channels;
        let (colors, alpha) = match &self.image.pixels {
            Pixels::U8(_) => (if self.raw { &RAW_8 } else { &SRGB_8 }, &RAW_8),
            Pixels::U16(_) => (if self.raw { &RAW_16 } else { &SRGB_16 }, &RAW_16),
            Pixels::F16(_) | Pixels::F32(_) => (&RAW_8, &RAW_8),
        };
        std::array::from_fn(|c| {
            if c >= channels {
                return 0.0;
            }
            let table = if channels.is_multiple_of(2) && c == channels - 1 { alpha } else { colors };
            match &self.image.pixels {
                Pixels::U8(v) => table[usize::from(v[i + c])],
                Pixels::U16(v) => table[usize::from(v[i + c])],
                Pixels::F16(v) => decode_half(v[i + c]),
                Pixels::F32(v) => v[i + c],
            }
        })
    }

    /// The name of the image, as the user would name it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.image.name
    }

    /// The linear colour of texel (`x`, `y`), which must exist; grey is
    /// repeated in all three channels.
    #[must_use]
    #[inline]
    pub fn rgb(&self, x: u32, y: u32) -> Rgb {
        debug_assert!(x < self.image.width && y < self.image.height, "texel ({x}, {y})");
        let channels = self.image.channels as usize;
        let i = (y as usize * self.image.width as usize + x as usize) * channels;
        if let Some(only) = self.only {
            Rgb::splat(self.read::<1>(i + usize::from(only))[0])
        } else if channels >= 3 {
            Rgb::from_array(self.read(i))
        } else {
            Rgb::splat(self.read::<1>(i)[0])
        }
    }

    /// The samples from the `i`th on, decoded.
    #[inline]
    fn read<const N: usize>(&self, i: usize) -> [f32; N] {
        match &self.image.pixels {
            Pixels::U8(v) => std::array::from_fn(|c| self.decode[usize::from(v[i + c])]),
            Pixels::U16(v) => std::array::from_fn(|c| self.decode[usize::from(v[i + c])]),
            Pixels::F16(v) => std::array::from_fn(|c| decode_half(v[i + c])),
            Pixels::F32(v) => std::array::from_fn(|c| v[i + c]),
        }
    }

    /// Bytes of the image.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.image.pixels.bytes()
    }

    /// Fails on the first texel, in reading order, that is not finite or has a
    /// channel below `least`; the message names its place, (0, 0) being the
    /// upper left.
    pub fn check(&self, least: f32) -> Result<()> {
        for y in 0..self.height() {
            for x in 0..self.width() {
                let c = self.rgb(x, y);
                let what = if !c.is_finite() {
                    "which is not finite"
                } else if c.min_element() < least {
                    "which is negative"
                } else {
                    continue;
                };
                let value =
                    if self.is_grey() { c.x.to_string() } else { format!("{}, {}, {}", c.x, c.y, c.z) };
                return Err(Error::new(format!(
                    "texel ({x}, {y}) of image `{}` is {value}, {what}",
                    self.name()
                )));
            }
        }
        Ok(())
    }

    pub(super) fn summary(&self) -> Summary {
        let first = self.rgb(0, 0);
        let (mut sum, mut max, mut uniform) = (DVec3::ZERO, f32::NEG_INFINITY, true);
        for y in 0..self.height() {
            for x in 0..self.width() {
                let c = self.rgb(x, y);
                sum += c.as_dvec3();
                max = max.max(c.max_element());
                uniform &= c == first;
            }
        }
        let count = f64::from(self.width()) * f64::from(self.height());
        let mean = if uniform { first } else { (sum / count).as_vec3() };
        Summary { mean, max, uniform: uniform.then_some(first) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_decoded_exactly() {
        for bits in 0..=u16::MAX {
            let half = f16::from_bits(bits);
            if half.is_finite() {
                assert_eq!(decode_half(half).to_bits(), half.to_f32().to_bits(), "{bits:#06x}");
            }
        }
    }
}
