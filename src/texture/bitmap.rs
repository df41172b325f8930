//! An image as a texture: nearest or bilinear lookup, three ways to wrap.
//!
//! Conventions of Mitsuba 3.9: texel (x, y) covers \[x/w, (x+1)/w\] ×
//! \[y/h, (y+1)/h\] of (u, v) and has its value at the centre; row 0 is v = 0.
//! (What a mesh file calls v is turned over by its reader where Mitsuba does.)
//! Mitsuba stores images of 16 bits and fewer in half precision unless told
//! otherwise; texels here keep the precision of the file, 2⁻¹¹ nearer to it.

use std::sync::{Arc, OnceLock};

use super::pyramid::{Probes, Pyramids};
use super::texels::Texels;
use super::{Coords, UvMap, example_image, scalar};
use crate::desc::{Image, Result};
use crate::math::{Mat2, Rgb, Transform, Vec2};
use crate::sampling::Raster;

/// How a bitmap is looked up between texel centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterType {
    /// The nearest texel.
    Nearest,
    /// Linear between the four nearest texels.
    Bilinear,
}

/// What a bitmap shows outside \[0, 1\]².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrapMode {
    /// Itself, over and over.
    Repeat,
    /// Itself, every other time mirrored.
    Mirror,
    /// Its border texels.
    Clamp,
}

/// An image over (u, v).
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `filename` | required | the image |
/// | `filter_type` | `bilinear` | `bilinear` or `nearest` |
/// | `wrap_mode` | `repeat` | `repeat`, `mirror` or `clamp` |
/// | `wrap_mode_u`, `wrap_mode_v` | `wrap_mode` | the same for one axis |
/// | `channel` | `rgb` | `r`, `g`, `b` or `a` alone, as a number |
/// | `scale` | 1 | a factor on it, a number or a colour |
/// | `uv_attribute` | none | an attribute of the mesh in place of its (u, v) |
/// | `raw` | `false` | take integer samples as they are, not as sRGB; `true` for normal maps |
/// | `to_uv` | identity | affine map applied to (u, v) first |
/// | `format` | `auto` | storage in Mitsuba: `auto`, `variant`, `fp16`; no effect here |
/// | `accel` | `true` | texture units in Mitsuba's CUDA mode; no effect here |
#[derive(Clone, Debug)]
pub struct Bitmap {
    texels: Texels,
    filter_type: FilterType,
    wrap: [WrapMode; 2],
    scale: Rgb,
    uv_slot: Option<u8>,
    to_uv: UvMap,
    mean: Rgb,
    max: f32,
    uniform: Option<Rgb>,
    /// Means over ever more texels, where they are asked for.
    coarser: OnceLock<Coarser>,
}

/// The upper levels of a pyramid.
#[derive(Clone, Debug)]
struct Coarser {
    levels: Vec<Texels>,
    /// The sides of a texel of the lowest level in (u, v).
    texel: [Vec2; 2],
}

/// How to read an image: everything of a bitmap but the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lookup {
    pub filter_type: FilterType,
    pub wrap: [WrapMode; 2],
    pub to_uv: Transform,
    pub raw: bool,
    /// 0 to 3 for red to alpha alone.
    pub channel: Option<u8>,
    pub scale: Rgb,
    /// The attribute that stands for (u, v).
    pub uv_slot: Option<u8>,
}

/// The four texels around a point and where it lies among them.
struct Corners {
    /// Values at (0,0), (1,0), (0,1), (1,1) of the cell.
    values: [Rgb; 4],
    /// Position in the cell, each in \[0, 1\].
    w: Vec2,
}

impl Bitmap {
    /// Fails on an image that is no texture, or has a texel that is not finite
    /// or below `least`.
    pub(super) fn new(image: Arc<Image>, lookup: &Lookup, least: f32) -> Result<Bitmap> {
        let texels = Texels::new(image, lookup.raw)?.channel(lookup.channel)?;
        texels.check(least)?;
        let summary = texels.summary();
        Ok(Bitmap {
            texels,
            filter_type: lookup.filter_type,
            wrap: lookup.wrap,
            scale: lookup.scale,
            uv_slot: lookup.uv_slot,
            to_uv: UvMap::new(&lookup.to_uv),
            mean: summary.mean * lookup.scale,
            max: summary.max * lookup.scale.max_element(),
            uniform: summary.uniform.map(|c| c * lookup.scale),
            coarser: OnceLock::new(),
        })
    }

    pub(super) fn example(width: u32, height: u32, channels: u32) -> Bitmap {
        let lookup = Lookup {
            filter_type: FilterType::Bilinear,
            wrap: [WrapMode::Repeat; 2],
            to_uv: Transform::IDENTITY,
            raw: false,
            channel: None,
            scale: Rgb::ONE,
            uv_slot: None,
        };
        Bitmap::new(example_image(width, height, channels), &lookup, 0.0).expect("the example is an image")
    }

    /// The (u, v) that it is looked up at, before `to_uv`.
    #[inline]
    fn uv(&self, at: &Coords) -> Vec2 {
        match self.uv_slot {
            None => at.uv,
            Some(slot) => at.attribute(slot).truncate().truncate(),
        }
    }

    pub(super) fn reads_attributes(&self) -> bool {
        self.uv_slot.is_some()
    }

    pub(super) fn eval(&self, at: &Coords) -> Rgb {
        let uv = self.to_uv.map(self.uv(at));
        self.scale
            * match self.filter_type {
                FilterType::Nearest => {
                    let p = (uv * resolution(&self.texels)).floor();
                    self.texels.rgb(
                        wrap(self.wrap[0], p.x as i64, self.texels.width()),
                        wrap(self.wrap[1], p.y as i64, self.texels.height()),
                    )
                }
                FilterType::Bilinear => match self.probes(at) {
                    None => self.bilinear(&self.texels, uv),
                    Some((texels, probes)) => {
                        let step = probes.step / resolution(&self.texels);
                        let from = uv - step * (0.5 * (probes.count - 1) as f32);
                        let sum: Rgb =
                            (0..probes.count).map(|i| self.bilinear(texels, from + step * i as f32)).sum();
                        sum / probes.count as f32
                    }
                },
            }
    }

    fn bilinear(&self, texels: &Texels, uv: Vec2) -> Rgb {
        let Corners { values: [v00, v10, v01, v11], w } = self.corners(texels, uv);
        (v00 * (1.0 - w.x) + v10 * w.x) * (1.0 - w.y) + (v01 * (1.0 - w.x) + v11 * w.x) * w.y
    }

    pub(super) fn eval_scalar(&self, at: &Coords) -> f32 {
        scalar(self.eval(at))
    }

    pub(super) fn gradient(&self, at: &Coords) -> (f32, f32) {
        if self.filter_type == FilterType::Nearest {
            return (0.0, 0.0);
        }
        let level = self.probes(at).map_or(&self.texels, |(texels, _)| texels);
        let Corners { values, w } = self.corners(level, self.to_uv.map(self.uv(at)));
        let [f00, f10, f01, f11] = values.map(|v| scalar(v * self.scale));
        let per_texel = Vec2::new(
            (1.0 - w.y) * (f10 - f00) + w.y * (f11 - f01),
            (1.0 - w.x) * (f01 - f00) + w.x * (f11 - f10),
        );
        self.to_uv.pull_back(per_texel * resolution(level))
    }

    pub(super) fn mean(&self) -> Rgb {
        self.mean
    }

    pub(super) fn max(&self) -> f32 {
        self.max
    }

    pub(super) fn is_constant(&self) -> Option<Rgb> {
        self.uniform
    }

    /// Bytes of its image.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.texels.memory_bytes()
    }

    pub(super) fn aspect(&self) -> f64 {
        f64::from(self.texels.width()) / f64::from(self.texels.height())
    }

    pub(super) fn raster(&self) -> Option<Raster> {
        if self.reads_attributes() {
            return None;
        }
        let scaled = |row: [f32; 3], size: u32| row.map(|c| f64::from(c) * f64::from(size));
        let UvMap { u, v } = self.to_uv;
        let map = [scaled(u, self.texels.width()), scaled(v, self.texels.height())];
        Some(Raster { map, bilinear: self.filter_type == FilterType::Bilinear })
    }

    /// Keeps means over ever more texels from now on, unless there is nothing to
    /// average. An image looked up at the nearest texel has steps by intention and
    /// keeps them.
    pub fn filter(&self, pyramids: &mut Pyramids) {
        let smooth = self.filter_type == FilterType::Bilinear;
        let rows = [Vec2::X, Vec2::Y].map(|axis| Vec2::from(self.to_uv.pull_back(axis)));
        let map = Mat2::from_cols(rows[0], rows[1]).transpose();
        let texel = map.inverse() * Mat2::from_diagonal(resolution(&self.texels).recip());
        if !smooth || self.uniform.is_some() || !texel.is_finite() {
            return;
        }
        let levels = pyramids.of(&self.texels).iter().map(|level| self.texels.of_level(level)).collect();
        self.coarser.get_or_init(|| Coarser { levels, texel: [texel.x_axis, texel.y_axis] });
    }

    /// True when it averages over footprints.
    #[must_use]
    pub fn is_filtered(&self) -> bool {
        self.coarser.get().is_some()
    }

    /// True when it averages over footprints in coordinates that an attribute holds.
    #[must_use]
    pub fn is_filtered_by_attribute(&self) -> bool {
        self.reads_attributes() && self.is_filtered()
    }

    /// Its image, while that is alive.
    pub(crate) fn image(&self) -> *const Image {
        self.texels.key().0
    }

    /// Which texels to average for a footprint, if any.
    #[inline]
    fn probes(&self, at: &Coords) -> Option<(&Texels, Probes)> {
        let (more, coarser) = (at.more?, self.coarser.get()?);
        let footprint = match self.uv_slot {
            None => &more.footprint,
            Some(slot) => more.footprints.get(usize::from(slot))?,
        };
        let probes = footprint.probes(&coarser.texel)?;
        let texels = match probes.level {
            0 => &self.texels,
            level => coarser.levels.get(level - 1).or(coarser.levels.last()).unwrap_or(&self.texels),
        };
        Some((texels, probes))
    }

    fn corners(&self, texels: &Texels, uv: Vec2) -> Corners {
        let p = uv * resolution(texels) - Vec2::splat(0.5);
        let cell = p.floor();
        let (x, y) = (cell.x as i64, cell.y as i64);
        let xs = [x, x.saturating_add(1)].map(|x| wrap(self.wrap[0], x, texels.width()));
        let ys = [y, y.saturating_add(1)].map(|y| wrap(self.wrap[1], y, texels.height()));
        let at = |i: usize, j: usize| texels.rgb(xs[i], ys[j]);
        Corners { values: [at(0, 0), at(1, 0), at(0, 1), at(1, 1)], w: p - cell }
    }
}

fn resolution(texels: &Texels) -> Vec2 {
    Vec2::new(texels.width() as f32, texels.height() as f32)
}

/// The texel that stands for texel `i` of an axis.
fn wrap(mode: WrapMode, i: i64, size: u32) -> u32 {
    let n = i64::from(size);
    let wrapped = match mode {
        WrapMode::Repeat => i.rem_euclid(n),
        WrapMode::Clamp => i.clamp(0, n - 1),
        WrapMode::Mirror => {
            let m = i.rem_euclid(2 * n);
            m.min(2 * n - 1 - m)
        }
    };
    wrapped as u32
}
