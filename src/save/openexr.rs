//! OpenEXR files that compositing programs read as they should.
//!
//! One part without a name (a name would become part of the layer names in
//! some readers), scan lines in increasing order, ZIP over 16 lines. 32-bit
//! float unless [`Options::half`] is set, which makes `R G B A` half floats
//! and nothing else. The display window is the full film, the data window
//! what was rendered. The same picture and header give the same bytes.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatSamples, Image,
    ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, SmallVec, Text, Vec2, WritableImage,
    f16,
};

use exr::meta::attribute::Chromaticities;

use super::exr_order::sort_attributes;
use super::file::write_whole;
use crate::desc::{Error, Result};
use crate::film::{Channel, Picture};
use crate::math::DMat4;

/// The largest finite half.
const HALF_MAX: f32 = 65504.0;

/// Longest name of a channel or attribute.
const MAX_NAME: usize = 255;

/// What the header says beside sizes and channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Text attributes: name (as `etendue/version`) and value.
    pub attributes: Vec<(String, String)>,
    /// World to camera space, left-handed with the view along +z, for column
    /// vectors: p' = M·p. Written as `worldToCamera` for row vectors, the
    /// convention of OpenEXR.
    pub world_to_camera: Option<DMat4>,
    /// World to normalised device coordinates for column vectors: (0, 0) at
    /// the top left of the display window, (1, 1) at its bottom right.
    /// Written as `worldToNDC` for row vectors.
    pub world_to_ndc: Option<DMat4>,
    /// Width over height of a pixel.
    pub pixel_aspect: f32,
}

impl Default for Header {
    /// Square pixels and nothing else.
    fn default() -> Self {
        Header { attributes: Vec::new(), world_to_camera: None, world_to_ndc: None, pixel_aspect: 1.0 }
    }
}

/// How values are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// `R`, `G`, `B`, `A` as 16-bit floats. Values beyond ±65504 become that,
    /// never infinity, and are counted.
    pub half: bool,
}

/// A channel that half floats could not hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Saturated {
    /// Its name.
    pub channel: String,
    /// How many of its values became ±65504.
    pub count: u64,
}

/// Writes a picture; returns the channels of which `half` cut off values.
///
/// Fails with the path and the reason when the file cannot be written, and
/// then leaves a file that was there untouched.
pub fn write_exr(
    path: &Path,
    picture: &Picture,
    header: &Header,
    options: Options,
) -> Result<Vec<Saturated>> {
    check(picture, header)
        .map_err(|what| Error::new(format!("cannot write `{}`: {what}", path.display())))?;
    let (image, saturated) = image(picture, header, options);
    write_whole(path, |mut file: &File| {
        let mut writer = BufWriter::new(file);
        image.write().to_buffered(&mut writer).map_err(io_error)?;
        writer.flush()?;
        drop(writer);
        sort_attributes(&mut file)?;
        Ok(())
    })?;
    Ok(saturated)
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// What the format cannot hold.
fn check(picture: &Picture, header: &Header) -> std::result::Result<(), String> {
    let area = picture.window.area();
    if area == 0 || picture.size.contains(&0) {
        return Err("the picture has no pixels".to_owned());
    }
    if picture.channels.is_empty() {
        return Err("the picture has no channels".to_owned());
    }
    if let Some(bad) = picture.channels.iter().find(|c| c.data.len() != area) {
        return Err(format!("channel `{}` has {} values for {area} pixels", bad.name, bad.data.len()));
    }
    if !(header.pixel_aspect > 0.0 && header.pixel_aspect.is_finite()) {
        return Err(format!("the pixel aspect must be above 0, found {}", header.pixel_aspect));
    }
    let channels = picture.channels.iter().map(|c| c.name.as_str()).collect();
    let attributes = header.attributes.iter().map(|a| a.0.as_str()).collect();
    check_names("channel", channels)?;
    check_names("attribute", attributes)
}

fn check_names(what: &str, mut names: Vec<&str>) -> std::result::Result<(), String> {
    if let Some(bad) = names.iter().find(|n| n.is_empty() || n.len() > MAX_NAME || n.contains('\0')) {
        return Err(format!("`{bad}` is no name for an {what} (1 to {MAX_NAME} bytes)")
            .replace("an channel", "a channel"));
    }
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("there are two {what}s called `{}`", pair[0])),
        None => Ok(()),
    }
}

fn image(
    picture: &Picture,
    header: &Header,
    options: Options,
) -> (Image<Layer<AnyChannels<FlatSamples>>>, Vec<Saturated>) {
    let mut saturated = Vec::new();
    let mut list: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    for channel in &picture.channels {
        let half = options.half && matches!(channel.name.as_str(), "R" | "G" | "B" | "A");
        let samples =
            if half { halves(channel, &mut saturated) } else { FlatSamples::F32(channel.data.clone()) };
        list.push(AnyChannel::new(text(&channel.name), samples));
    }

    let window = picture.window;
    let mut own = LayerAttributes {
        layer_position: Vec2(window.min.0, window.min.1),
        world_to_camera: header.world_to_camera.map(row_vectors),
        world_to_normalized_device: header.world_to_ndc.map(row_vectors),
        ..LayerAttributes::default()
    };
    for (name, value) in &header.attributes {
        own.other.insert(text(name), AttributeValue::Text(text(value)));
    }
    let size = Vec2(picture.size[0] as usize, picture.size[1] as usize);
    let shared = ImageAttributes {
        pixel_aspect: header.pixel_aspect,
        chromaticities: Some(rec709()),
        ..ImageAttributes::new(IntegerBounds::from_dimensions(size))
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new((window.width(), window.height()), own, encoding, AnyChannels::sort(list));
    (Image { attributes: shared, layer_data: layer }, saturated)
}

/// A channel in half precision, with its largest values cut off and counted.
fn halves(channel: &Channel, saturated: &mut Vec<Saturated>) -> FlatSamples {
    let count = channel.data.iter().filter(|v| v.abs() > HALF_MAX).count() as u64;
    if count > 0 {
        saturated.push(Saturated { channel: channel.name.clone(), count });
    }
    FlatSamples::F16(channel.data.iter().map(|v| f16::from_f32(v.clamp(-HALF_MAX, HALF_MAX))).collect())
}

/// UTF-8 as it is: what all readers of today expect.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

/// The rows of the transposed matrix are the columns of the matrix.
fn row_vectors(matrix: DMat4) -> [f32; 16] {
    matrix.to_cols_array().map(|v| v as f32)
}

/// ITU-R BT.709 primaries with a D65 white, the space all our colours are in.
fn rec709() -> Chromaticities {
    Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    }
}
