//! Colours and numbers that vary over a surface: a function of (u, v).
//!
//! Semantics are those of Mitsuba 3.9 in its RGB variants, so that a scene
//! file means the same in both. Texels are read straight from the decoded
//! image, in the depth its file had; nothing is converted ahead of time.
//!
//! | `type` | parameters |
//! |-|-|
//! | `bitmap` | see [`Bitmap`] |
//! | `checkerboard` | see [`Checkerboard`] |
//! | `mesh_attribute` | see [`Attribute`] |
//! | `srgb`, `rgb` | `color` (or `value`): linear RGB |
//! | `uniform`, `rawconstant` | `value`: a number (`rawconstant`: or three) |
//! | `d65` | `scale` (default 1): white in an RGB renderer |

mod attribute;
mod bitmap;
mod checkerboard;
mod parse;
mod pyramid;
mod texels;

pub use attribute::{Attribute, Attributes, MAX_ATTRIBUTES, NO_ATTRIBUTES};
pub use bitmap::{Bitmap, FilterType, WrapMode};
pub use checkerboard::Checkerboard;
pub use parse::{Usage, attribute_texture, texture_from_desc, texture_param, texture_param_opt};
pub use pyramid::{Footprint, NO_FOOTPRINTS, Pyramids};
pub use texels::Texels;

use std::sync::Arc;

use crate::color::luminance;
use crate::desc::{Image, Pixels, kinds};
use crate::math::{Rgb, Transform, Vec2, Vec4};
use crate::sampling::Raster;

kinds! {
    /// A colour or number over (u, v).
    #[derive(Clone, Debug)]
    pub enum Texture {
        /// The same everywhere.
        Constant(Rgb) = ["srgb", "rgb", "uniform", "rawconstant", "d65"],
        /// An image.
        Bitmap(Bitmap) = ["bitmap"],
        /// Two textures in a checkerboard.
        Checkerboard(Checkerboard) = ["checkerboard"],
        /// Data of the mesh.
        Attribute(Attribute) = ["mesh_attribute"],
    }
}

/// How textures are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureFilter {
    /// At a point.
    #[default]
    Point,
    /// Averaged over the part of a pixel that a sample stands for.
    Footprint,
}

impl TextureFilter {
    const ALL: [TextureFilter; 2] = [TextureFilter::Point, TextureFilter::Footprint];

    /// The one of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<TextureFilter> {
        Self::ALL.into_iter().find(|filter| filter.name() == name)
    }

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            TextureFilter::Point => "point",
            TextureFilter::Footprint => "footprint",
        }
    }

    /// All names, for messages.
    #[must_use]
    pub fn names() -> String {
        Self::ALL.map(TextureFilter::name).join(", ")
    }
}

/// Where a texture is looked up.
#[derive(Clone, Copy, Debug)]
pub struct Coords<'a> {
    /// Texture coordinates.
    pub uv: Vec2,
    /// What more is known of the point.
    pub more: Option<&'a More>,
}

/// What only some textures read of a point.
#[derive(Clone, Copy, Debug)]
pub struct More {
    /// Attributes of the mesh, zero if nobody has filled them in.
    pub attributes: Attributes,
    /// The footprint of the sample in (u, v).
    pub footprint: Footprint,
    /// That in the coordinates which an attribute holds, by slot: a point where it holds none.
    pub footprints: [Footprint; MAX_ATTRIBUTES],
}

impl From<Vec2> for Coords<'_> {
    fn from(uv: Vec2) -> Self {
        Coords { uv, more: None }
    }
}

impl Coords<'_> {
    fn attribute(&self, slot: u8) -> Vec4 {
        self.more.and_then(|m| m.attributes.get(usize::from(slot))).copied().unwrap_or(Vec4::ZERO)
    }
}

impl Texture {
    /// The colour at `uv`.
    #[must_use]
    #[inline]
    pub fn eval<'a>(&self, at: impl Into<Coords<'a>>) -> Rgb {
        let at = at.into();
        match self {
            Texture::Constant(c) => *c,
            Texture::Bitmap(t) => t.eval(&at),
            Texture::Checkerboard(t) => t.eval(&at),
            Texture::Attribute(t) => t.eval(&at),
        }
    }

    /// The number at `uv`: the value of a grey texture, the luminance of a
    /// coloured one.
    #[must_use]
    #[inline]
    pub fn eval_scalar<'a>(&self, at: impl Into<Coords<'a>>) -> f32 {
        let at = at.into();
        match self {
            Texture::Constant(c) => scalar(*c),
            Texture::Bitmap(t) => t.eval_scalar(&at),
            Texture::Checkerboard(t) => t.eval_scalar(&at),
            Texture::Attribute(t) => scalar(t.eval(&at)),
        }
    }

    /// (∂/∂u, ∂/∂v) of [`Texture::eval_scalar`], in units of the surface's own
    /// (u, v): `to_uv` is differentiated through. Zero for a constant, a
    /// nearest-neighbour bitmap, and at the steps of a checkerboard. Agrees
    /// with Mitsuba's `eval_1_grad` but for a rotating `to_uv` on an image that
    /// is not square, where Mitsuba scales by the resolution in the wrong order.
    #[must_use]
    pub fn gradient<'a>(&self, at: impl Into<Coords<'a>>) -> (f32, f32) {
        let at = at.into();
        match self {
            Texture::Constant(_) | Texture::Attribute(_) => (0.0, 0.0),
            Texture::Bitmap(t) => t.gradient(&at),
            Texture::Checkerboard(t) => t.gradient(at),
        }
    }

    /// True when it reads attributes of the mesh.
    #[must_use]
    pub fn reads_attributes(&self) -> bool {
        match self {
            Texture::Constant(_) => false,
            Texture::Bitmap(t) => t.reads_attributes(),
            Texture::Checkerboard(t) => t.reads_attributes(),
            Texture::Attribute(_) => true,
        }
    }

    /// The mean colour: over all texels of a bitmap, half and half for a
    /// checkerboard.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        match self {
            Texture::Constant(c) => *c,
            Texture::Bitmap(t) => t.mean(),
            Texture::Checkerboard(t) => t.mean(),
            Texture::Attribute(t) => t.scale * 0.5,
        }
    }

    /// An upper bound of every channel anywhere; interpolation stays below it.
    #[must_use]
    pub fn max(&self) -> f32 {
        match self {
            Texture::Constant(c) => c.max_element(),
            Texture::Bitmap(t) => t.max(),
            Texture::Checkerboard(t) => t.max(),
            Texture::Attribute(t) => t.scale.max_element(),
        }
    }

    /// The colour, when it is the same everywhere: a bitmap whose texels are
    /// all equal counts.
    #[must_use]
    pub fn is_constant(&self) -> Option<Rgb> {
        match self {
            Texture::Constant(c) => Some(*c),
            Texture::Bitmap(t) => t.is_constant(),
            Texture::Checkerboard(t) => t.is_constant(),
            Texture::Attribute(_) => None,
        }
    }

    /// Bytes of texels that this texture keeps alive (shared ones counted
    /// here too).
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let mut bytes = 0;
        self.visit_bitmaps(&mut |bitmap| bytes += bitmap.memory_bytes());
        bytes
    }

    /// Calls `f` with each bitmap in it.
    pub fn visit_bitmaps<'a>(&'a self, f: &mut impl FnMut(&'a Bitmap)) {
        match self {
            Texture::Constant(_) | Texture::Attribute(_) => {}
            Texture::Bitmap(t) => f(t),
            Texture::Checkerboard(t) => t.visit_bitmaps(f),
        }
    }

    /// Width over height of its picture; 1 for what has none.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        match self {
            Texture::Bitmap(b) => b.aspect(),
            _ => 1.0,
        }
    }

    /// How its texels lie on (u, v); `None` for what is no picture over them.
    #[must_use]
    pub fn raster(&self) -> Option<Raster> {
        match self {
            Texture::Bitmap(b) => b.raster(),
            Texture::Constant(_) | Texture::Checkerboard(_) | Texture::Attribute(_) => None,
        }
    }

    /// Typical and extreme textures, each with a name for messages.
    #[must_use]
    pub fn examples() -> Vec<(String, Texture)> {
        let mut out = vec![
            ("constant".to_string(), Texture::Constant(Rgb::new(0.2, 0.5, 0.8))),
            ("black".to_string(), Texture::Constant(Rgb::ZERO)),
            ("checkerboard".to_string(), Checkerboard::example().into()),
        ];
        for (width, height, channels) in [(5, 4, 3), (1, 1, 1), (1, 7, 4), (6, 1, 2)] {
            let name = format!("bitmap {width}x{height}, {channels} channels");
            out.push((name, Bitmap::example(width, height, channels).into()));
        }
        out
    }
}

/// The number of a colour: itself when grey, else its luminance.
fn scalar(c: Rgb) -> f32 {
    if c.x == c.y && c.y == c.z { c.x } else { luminance(c) }
}

/// The affine map of `to_uv`: upper left 2×2 of the matrix and its x, y
/// translation; z and the projective row are dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
struct UvMap {
    u: [f32; 3],
    v: [f32; 3],
}

impl UvMap {
    const IDENTITY: UvMap = UvMap { u: [1.0, 0.0, 0.0], v: [0.0, 1.0, 0.0] };

    fn new(to_uv: &Transform) -> UvMap {
        let m = to_uv.matrix;
        UvMap {
            u: [m.x_axis.x as f32, m.y_axis.x as f32, m.w_axis.x as f32],
            v: [m.x_axis.y as f32, m.y_axis.y as f32, m.w_axis.y as f32],
        }
    }

    fn map(&self, uv: Vec2) -> Vec2 {
        let row = |r: &[f32; 3]| r[0] * uv.x + r[1] * uv.y + r[2];
        Vec2::new(row(&self.u), row(&self.v))
    }

    /// Gradient in the surface's (u, v) from that in texture space: the
    /// transposed linear part.
    fn pull_back(&self, d: Vec2) -> (f32, f32) {
        (self.u[0] * d.x + self.v[0] * d.y, self.u[1] * d.x + self.v[1] * d.y)
    }
}

/// A small deterministic image for the examples.
fn example_image(width: u32, height: u32, channels: u32) -> Arc<Image> {
    let count = width * height * channels;
    let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8;
    Arc::new(Image {
        width,
        height,
        channels,
        pixels: Pixels::U8((0..count).map(value).collect()),
        name: "example".to_string(),
    })
}
