//! The size, crop and filter of a film: the plugin `hdrfilm`.

use super::{Filter, Rect};
use crate::desc::{Category, Error, ObjectId, Params, Result, SceneDesc};

/// Most pixels along an axis.
const MAX_SIZE: i64 = 1 << 20;

/// Rows and columns on each side of a pixel that its error is pooled over.
pub(super) const POOL_REACH: usize = 2;

/// Most pixels in a crop window.
const MAX_PIXELS: u64 = 1 << 30;

/// What a film is. The plugin is `hdrfilm`, with Mitsuba's parameters:
///
/// | parameter | default | |
/// |-|-|-|
/// | `width`, `height` | 768, 576 | pixels of the full film |
/// | `crop_offset_x`, `crop_offset_y`, `crop_width`, `crop_height` | all of it | the window that is rendered |
/// | `sample_border` | false | also sample outside the full film, as far as the filter reaches |
/// | `pixel_format` | `rgb` | `rgb` or `rgba` |
/// | `component_format` | | `float32` or `float16` |
/// | `file_format` | `openexr` | `openexr` or `exr` |
/// | `compensate`, `banner` | | accepted; sums are exact anyway, and there is no banner |
/// | nested `rfilter` | `gaussian` | see [`Filter`] |
///
/// ```xml
/// <film type="hdrfilm"><integer name="width" value="640"/><integer name="height" value="480"/></film>
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FilmSpec {
    /// Width and height of the full film.
    pub size: [u32; 2],
    /// The window that is rendered: x, y, width, height. Inside the film.
    pub crop: [u32; 4],
    /// The reconstruction filter.
    pub filter: Filter,
    /// True when the scene asks for alpha (`pixel_format` `rgba`).
    pub alpha: bool,
    /// True when the scene asks for half floats in the file
    /// (`component_format` `float16` given).
    pub half: bool,
    /// Sample outside the full film too.
    pub sample_border: bool,
}

impl Default for FilmSpec {
    /// Mitsuba's film when the sensor has none: 768 × 576, Gaussian.
    fn default() -> Self {
        FilmSpec::new(768, 576, Filter::default())
    }
}

impl FilmSpec {
    /// A film without a crop.
    #[must_use]
    pub fn new(width: u32, height: u32, filter: Filter) -> FilmSpec {
        FilmSpec {
            size: [width, height],
            crop: [0, 0, width, height],
            filter,
            alpha: false,
            half: false,
            sample_border: false,
        }
    }

    /// Reads a `film` object.
    pub fn from_desc(scene: &SceneDesc, id: ObjectId) -> Result<FilmSpec> {
        let params = scene.params(id);
        let plugin = params.object().plugin.as_str();
        if plugin != "hdrfilm" {
            return Err(params.error(format!("unknown film `{plugin}`")).suggest(plugin, ["hdrfilm"]));
        }
        let width = size(&params, "width", 768)?;
        let height = size(&params, "height", 576)?;
        let mut spec = FilmSpec::new(width, height, Filter::default());
        spec.crop = crop(&params, [width, height])?;
        spec.sample_border = params.bool("sample_border", false)?;
        params.bool("compensate", false)?;
        params.bool("banner", false)?;
        formats(&params, &mut spec)?;
        match params.children(Category::Rfilter)[..] {
            [] => {}
            [(_, child)] => spec.filter = Filter::from_desc(scene, child)?,
            _ => return Err(params.error("a film can have one `rfilter` only")),
        }
        params.finish()?;
        Ok(spec)
    }

    /// Another size or crop window than the file's; a new size drops the
    /// file's crop.
    ///
    /// # Errors
    /// A window outside the film, or too many pixels.
    pub fn override_window(&mut self, size: Option<[u32; 2]>, crop: Option<[u32; 4]>) -> Result<()> {
        if let Some([width, height]) = size {
            self.size = [width, height];
            self.crop = [0, 0, width, height];
        }
        self.crop = crop.unwrap_or(self.crop);
        let [x, y, w, h] = self.crop.map(u64::from);
        let [width, height] = self.size.map(u64::from);
        if x + w > width || y + h > height {
            return Err(Error::new(format!(
                "the crop window {w} × {h} at {x},{y} does not fit the film of {width} × {height} pixels"
            )));
        }
        if self.size.iter().any(|n| i64::from(*n) > MAX_SIZE) || w * h > MAX_PIXELS {
            let message = format!("a film can have at most {MAX_SIZE} pixels a side and {MAX_PIXELS} in all");
            return Err(Error::new(message));
        }
        Ok(())
    }

    /// The crop window.
    #[must_use]
    pub fn window(&self) -> Rect {
        Rect::new(self.crop[0] as i32, self.crop[1] as i32, self.crop[2], self.crop[3])
    }

    /// The pixels that are summed: the crop window and the neighbours with
    /// which the error estimate pools it.
    #[must_use]
    pub fn stored(&self) -> Rect {
        self.window().grow(POOL_REACH as i32).intersect(&Rect::new(0, 0, self.size[0], self.size[1]))
    }

    /// The pixels to sample: those summed and as far around them as the
    /// filter reaches, inside the full film unless `sample_border` is set. So
    /// a crop is the same picture as that region of the whole.
    #[must_use]
    pub fn sample_bounds(&self) -> Rect {
        let reached = self.stored().grow(self.filter.reach());
        if self.sample_border {
            return reached;
        }
        reached.intersect(&Rect::new(0, 0, self.size[0], self.size[1]))
    }
}

fn size(params: &Params, name: &'static str, default: i64) -> Result<u32> {
    let value = params.int(name, default)?;
    if !(1..=MAX_SIZE).contains(&value) {
        return Err(
            params.error_at(name, format!("`{name}` must be from 1 to {MAX_SIZE} pixels, found {value}"))
        );
    }
    Ok(value as u32)
}

fn crop(params: &Params, [width, height]: [u32; 2]) -> Result<[u32; 4]> {
    let offset = |name| -> Result<u32> {
        let value = params.int(name, 0)?;
        u32::try_from(value)
            .map_err(|_| params.error_at(name, format!("`{name}` must not be negative, found {value}")))
    };
    let (x, y) = (offset("crop_offset_x")?, offset("crop_offset_y")?);
    let (w, h) =
        (size(params, "crop_width", i64::from(width))?, size(params, "crop_height", i64::from(height))?);
    for (name, start, length, all) in [("crop_width", x, w, width), ("crop_height", y, h, height)] {
        if u64::from(start) + u64::from(length) > u64::from(all) {
            return Err(params.error_at(
                name,
                format!(
                    "the crop window ends at {}, outside the film of {all} pixels",
                    u64::from(start) + u64::from(length)
                ),
            ));
        }
    }
    if u64::from(w) * u64::from(h) > MAX_PIXELS {
        return Err(params.error(format!("a film can have at most {MAX_PIXELS} pixels, found {w} × {h}")));
    }
    Ok([x, y, w, h])
}

/// The formats of the file: those that an EXR of RGB(A) can be.
fn formats(params: &Params, spec: &mut FilmSpec) -> Result<()> {
    let word = |name: &'static str, known: &[&'static str]| -> Result<Option<&'static str>> {
        let Some(word) = params.string_opt(name)?.map(str::to_lowercase) else { return Ok(None) };
        known.iter().copied().find(|k| **k == word).map(Some).ok_or_else(|| {
            params
                .error_at(name, format!("`{name}` has no value `{word}` here"))
                .suggest(&word, known.iter().copied())
        })
    };
    word("file_format", &["openexr", "exr"])?;
    spec.alpha = word("pixel_format", &["rgb", "rgba"])? == Some("rgba");
    spec.half = word("component_format", &["float32", "float16"])? == Some("float16");
    Ok(())
}
