//! OpenEXR files: all channels of all parts as floats, with attributes. Sizes
//! are checked before anything is decoded.

use std::io::Cursor;
use std::path::Path;

use exr::compression::Compression;
use exr::image::{FlatImage, FlatSamples};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities};
use exr::prelude::{ReadChannels as _, ReadLayers as _};

use super::files;
use super::foreign::{check_promise, guarded};
use crate::desc::{Error, Result};

/// The first bytes of every OpenEXR file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Files from this size on are decoded by several threads, whose start takes
/// longer than a small one.
const PARALLEL: usize = 1 << 20;

/// Bytes in memory that a byte in the file stands for at most: deflate packs
/// 1032 to one, of which halves become floats here; PIZ, RLE and B44 pack less,
/// while DWA and what is newer leave whole blocks out before that.
const DEFLATE: u64 = 2200;
const DWA: u64 = 200_000;

/// A decoded file. All parts have the same data window.
#[derive(Clone, Debug)]
pub struct ExrFile {
    /// Pixels per row and rows of the data window.
    pub size: [u32; 2],
    /// Top left pixel of the data window.
    pub origin: [i32; 2],
    /// Channels by full name: `part.layer.channel`, the part only when there
    /// is more than one.
    pub channels: Vec<(String, Vec<f32>)>,
    /// Attributes that can be written as text, sorted by name.
    pub attributes: Vec<(String, String)>,
    /// Primaries and white, where given: red, green, blue, white as x, y.
    pub chromaticities: Option<[f32; 8]>,
}

/// Reads a file whose decoded channels take at most `max_bytes`.
pub fn read(path: &Path, max_bytes: u64) -> Result<ExrFile> {
    let bytes = files::read_bytes(path, files::IMAGE_CAP)?;
    decode(&bytes, max_bytes).map_err(|message| Error::new(format!("image `{}`: {message}", path.display())))
}

fn decode(bytes: &[u8], max_bytes: u64) -> std::result::Result<ExrFile, String> {
    guarded(|| decode_unguarded(bytes, max_bytes))
}

fn decode_unguarded(bytes: &[u8], max_bytes: u64) -> std::result::Result<ExrFile, String> {
    let cannot = |e: exr::error::Error| format!("cannot decode it: {e}");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(cannot)?;
    check_size(&meta, max_bytes, bytes.len())?;
    let mut reader = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes();
    if bytes.len() < PARALLEL {
        reader = reader.non_parallel();
    }
    let image: FlatImage = reader.from_buffered(Cursor::new(bytes)).map_err(cannot)?;
    convert(image)
}

fn check_size(meta: &MetaData, max_bytes: u64, length: usize) -> std::result::Result<(), String> {
    let (mut total, mut ratio) = (0u64, DEFLATE);
    for header in &meta.headers {
        if header.deep {
            return Err("deep images are not read".into());
        }
        if header.channels.list.iter().any(|c| c.sampling.x() != 1 || c.sampling.y() != 1) {
            return Err("channels of reduced resolution (luminance and chroma) are not read".into());
        }
        use Compression as C;
        if !matches!(
            header.compression,
            C::Uncompressed | C::RLE | C::ZIP1 | C::ZIP16 | C::PIZ | C::PXR24 | C::B44 | C::B44A
        ) {
            ratio = DWA;
        }
        let [w, h] = [header.layer_size.x() as u64, header.layer_size.y() as u64];
        let samples = w.saturating_mul(h).saturating_mul(header.channels.list.len() as u64);
        total = total.saturating_add(samples.saturating_mul(4));
        if w > u64::from(u32::MAX) || h > u64::from(u32::MAX) || total > max_bytes {
            return Err(format!(
                "{w} × {h} pixels with {} channels take more than the {max_bytes} bytes allowed by \
                 `max_image_bytes`",
                header.channels.list.len()
            ));
        }
    }
    check_promise(total, length, ratio)
}

fn convert(image: FlatImage) -> std::result::Result<ExrFile, String> {
    let parts = image.layer_data.len();
    let mut out: Option<ExrFile> = None;
    let chromaticities = image.attributes.chromaticities.map(numbers);
    for (index, layer) in image.layer_data.into_iter().enumerate() {
        let size = [layer.size.x() as u32, layer.size.y() as u32];
        let origin = [layer.attributes.layer_position.x(), layer.attributes.layer_position.y()];
        let file = out.get_or_insert_with(|| ExrFile {
            size,
            origin,
            channels: Vec::new(),
            attributes: Vec::new(),
            chromaticities,
        });
        if file.size != size || file.origin != origin {
            return Err("its parts have different data windows".into());
        }
        let part = layer.attributes.layer_name.as_ref().map_or(format!("part{index}"), ToString::to_string);
        for channel in layer.channel_data.list {
            let name = channel.name.to_string();
            let is_prefixed = name.strip_prefix(&part).is_some_and(|rest| rest.starts_with('.'));
            let name = if parts == 1 || is_prefixed { name } else { format!("{part}.{name}") };
            file.channels.push((name, floats(channel.sample_data)));
        }
        for (name, value) in &layer.attributes.other {
            add_attribute(&mut file.attributes, &name.to_string(), value);
        }
    }
    let mut file = out.ok_or("it holds no image")?;
    for (name, value) in &image.attributes.other {
        add_attribute(&mut file.attributes, &name.to_string(), value);
    }
    file.attributes.sort();
    file.attributes.dedup_by(|a, b| a.0 == b.0);
    Ok(file)
}

fn floats(samples: FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F16(v) => v.into_iter().map(f32::from).collect(),
        FlatSamples::F32(v) => v,
        FlatSamples::U32(v) => v.into_iter().map(|v| v as f32).collect(),
    }
}

fn numbers(c: Chromaticities) -> [f32; 8] {
    let (r, g, b, w) = (c.red, c.green, c.blue, c.white);
    [r.x(), r.y(), g.x(), g.y(), b.x(), b.y(), w.x(), w.y()]
}

fn join<T: ToString>(values: &[T]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

fn add_attribute(list: &mut Vec<(String, String)>, name: &str, value: &AttributeValue) {
    let text = match value {
        AttributeValue::Text(v) => v.to_string(),
        AttributeValue::TextVector(v) => join(v),
        AttributeValue::F64(v) => v.to_string(),
        AttributeValue::F32(v) => v.to_string(),
        AttributeValue::I32(v) => v.to_string(),
        AttributeValue::IntVec2(v) => join(&[v.x(), v.y()]),
        AttributeValue::FloatVec2(v) => join(&[v.x(), v.y()]),
        AttributeValue::IntVec3((x, y, z)) => join(&[x, y, z]),
        AttributeValue::FloatVec3((x, y, z)) => join(&[x, y, z]),
        AttributeValue::Matrix3x3(v) => join(v),
        AttributeValue::Matrix4x4(v) => join(v),
        AttributeValue::Rational((n, d)) => format!("{n}/{d}"),
        _ => return, // structure of the file, previews and unknown bytes
    };
    list.push((name.to_string(), text));
}
