//! Pictures as text inside of a page.
//!
//! Values are half floats (11 bits of precision, which is more than a screen
//! shows), or 32-bit floats where a value is beyond the range of a half. They
//! are stored plane by plane, R then G then B, and in each plane first the
//! high bytes of all pixels, then the lower ones: neighbours have similar high
//! bytes, which a deflate stream shrinks to about two thirds. Then zlib, which
//! browsers decode as `deflate`, and base64.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use half::f16;
use serde::Serialize;

use crate::desc::{Error, Result};
use crate::study::model::Exhibit;

/// A picture ready to be put into a page.
#[derive(Serialize)]
pub(super) struct Picture {
    pub(super) scene: String,
    pub(super) label: String,
    width: usize,
    height: usize,
    /// `half` or `float`.
    format: &'static str,
    data: String,
}

/// Fails when a picture has no pixels or not three values for each.
pub(super) fn encode(exhibits: &[Exhibit]) -> Result<Vec<Picture>> {
    exhibits.iter().map(encode_one).collect()
}

fn encode_one(exhibit: &Exhibit) -> Result<Picture> {
    let [width, height] = exhibit.size;
    let expected = width.checked_mul(height).and_then(|n| n.checked_mul(3));
    if expected != Some(exhibit.rgb.len()) || exhibit.rgb.is_empty() {
        return Err(Error::new(format!(
            "picture `{}` of `{}`: {width}x{height} pixels need three values each, got {}",
            exhibit.label,
            exhibit.scene,
            exhibit.rgb.len()
        )));
    }
    let fits = |v: &f32| !v.is_finite() || f16::from_f32(*v).is_finite();
    let (format, bytes) = if exhibit.rgb.iter().all(fits) {
        ("half", planes(&exhibit.rgb, |v| f16::from_f32(v).to_be_bytes()))
    } else {
        ("float", planes(&exhibit.rgb, f32::to_be_bytes))
    };
    let wrong = |e: std::io::Error| Error::new(format!("cannot compress picture `{}`: {e}", exhibit.label));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(&bytes).map_err(wrong)?;
    let data = STANDARD.encode(encoder.finish().map_err(wrong)?);
    let (scene, label) = (exhibit.scene.clone(), exhibit.label.clone());
    Ok(Picture { scene, label, width, height, format, data })
}

/// Bytes by channel, then by place within the value, then by pixel.
fn planes<const N: usize>(rgb: &[f32], bytes: impl Fn(f32) -> [u8; N]) -> Vec<u8> {
    let mut out = Vec::with_capacity(rgb.len() * N);
    for channel in 0..3 {
        for place in 0..N {
            out.extend(rgb.chunks_exact(3).map(|pixel| bytes(pixel[channel])[place]));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    fn exhibit(size: [usize; 2], rgb: Vec<f32>) -> Exhibit {
        Exhibit { scene: "s".into(), label: "l".into(), size, rgb }
    }

    #[test]
    fn halves_come_back() {
        let rgb = vec![0.5, 1.0, f32::NAN, 65504.0, -2.0, f32::INFINITY];
        let picture = encode_one(&exhibit([2, 1], rgb.clone())).unwrap();
        assert_eq!(picture.format, "half");
        let mut bytes = Vec::new();
        let packed = STANDARD.decode(&picture.data).unwrap();
        flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes.len(), 12);
        for (i, v) in rgb.iter().enumerate() {
            let (pixel, channel) = (i / 3, i % 3);
            let at = 4 * channel + pixel;
            let read = f16::from_be_bytes([bytes[at], bytes[at + 2]]).to_f32();
            assert!(read.to_bits() == v.to_bits() || v.is_nan() && read.is_nan(), "{v} {read}");
        }
    }

    /// 24 pictures of 256 × 256 stay under 15 MB however noisy they are.
    #[test]
    fn noise_takes_no_more_than_its_halves() {
        let noise = |i: u32| f32::from_bits(0x3f80_0000 | (i.wrapping_mul(0x9E37_79B9) >> 9));
        let rgb = (0..3 * 256 * 256).map(noise).collect();
        let size = encode_one(&exhibit([256, 256], rgb)).unwrap().data.len();
        assert!(24 * size < 15_000_000, "{size} bytes");
    }

    #[test]
    fn large_values_take_floats_and_wrong_sizes_are_errors() {
        assert_eq!(encode_one(&exhibit([1, 1], vec![1e6, 0.0, 0.0])).unwrap().format, "float");
        assert!(encode_one(&exhibit([2, 1], vec![1.0; 3])).is_err());
        assert!(encode_one(&exhibit([0, 0], Vec::new())).is_err());
        assert!(encode_one(&exhibit([usize::MAX, 2], vec![1.0; 3])).is_err());
    }
}
