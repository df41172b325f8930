//! Two textures in a checkerboard.

use super::{Bitmap, Coords, Texture, UvMap};
use crate::math::{Rgb, Transform, Vec2};

/// Squares of half a unit of (u, v) in turn: `color0` where frac u and frac v
/// are both above ½ or both not, else `color1`.
///
/// Read as a number, the two are swapped: that is what Mitsuba 3.9.1 does in
/// `eval_1`, so that a file with, say, a checkerboard roughness looks alike.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `color0` | 0.4 | colour or texture |
/// | `color1` | 0.2 | colour or texture |
/// | `to_uv` | identity | affine map applied to (u, v) first, for this texture's squares only |
#[derive(Clone, Debug)]
pub struct Checkerboard {
    color0: Box<Texture>,
    color1: Box<Texture>,
    to_uv: UvMap,
}

impl Checkerboard {
    pub(super) fn new(color0: Texture, color1: Texture, to_uv: &Transform) -> Checkerboard {
        Checkerboard { color0: Box::new(color0), color1: Box::new(color1), to_uv: UvMap::new(to_uv) }
    }

    pub(super) fn example() -> Checkerboard {
        let bitmap = Bitmap::example(4, 3, 3);
        Checkerboard {
            color0: Box::new(bitmap.into()),
            color1: Box::new(Texture::Constant(Rgb::new(0.1, 0.6, 0.3))),
            to_uv: UvMap { u: [3.0, 0.0, 0.1], ..UvMap::IDENTITY },
        }
    }

    /// True where `color0` is seen.
    fn even(&self, uv: Vec2) -> bool {
        let p = self.to_uv.map(uv);
        let fraction = p - p.floor();
        (fraction.x > 0.5) == (fraction.y > 0.5)
    }

    fn numeric(&self, uv: Vec2) -> &Texture {
        if self.even(uv) { &self.color1 } else { &self.color0 }
    }

    pub(super) fn eval(&self, at: &Coords) -> Rgb {
        if self.even(at.uv) { self.color0.eval(*at) } else { self.color1.eval(*at) }
    }

    pub(super) fn eval_scalar(&self, at: &Coords) -> f32 {
        self.numeric(at.uv).eval_scalar(*at)
    }

    pub(super) fn gradient(&self, at: Coords) -> (f32, f32) {
        self.numeric(at.uv).gradient(at)
    }

    pub(super) fn reads_attributes(&self) -> bool {
        self.color0.reads_attributes() || self.color1.reads_attributes()
    }

    pub(super) fn mean(&self) -> Rgb {
        self.color0.mean() * 0.5 + self.color1.mean() * 0.5
    }

    pub(super) fn max(&self) -> f32 {
        self.color0.max().max(self.color1.max())
    }

    pub(super) fn is_constant(&self) -> Option<Rgb> {
        self.color0.is_constant().filter(|c| self.color1.is_constant() == Some(*c))
    }

    pub(super) fn visit_bitmaps<'a, F: FnMut(&'a Bitmap)>(&'a self, f: &mut F) {
        self.color0.visit_bitmaps(f);
        self.color1.visit_bitmaps(f);
    }
}
