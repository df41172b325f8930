//! Data of a mesh as a texture.

use super::Coords;
use crate::math::{Rgb, Vec4};

/// An attribute of the mesh: see [`crate::desc::MeshAttribute`].
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `name` | required | which one: `vertex_…` or `face_…` |
/// | `scale` | 1 | a factor on it, a number or a colour |
#[derive(Clone, Debug)]
pub struct Attribute {
    pub(super) slot: u8,
    pub(super) scale: Rgb,
}

impl Attribute {
    pub(super) fn eval(&self, at: &Coords) -> Rgb {
        at.attribute(self.slot).truncate() * self.scale
    }
}

/// Most attributes that the textures of a scene may name: colours of glTF
/// vertices, their alpha, and each further set of texture coordinates are one.
pub const MAX_ATTRIBUTES: usize = 8;

/// The attributes of a point, by slot.
pub type Attributes = [Vec4; MAX_ATTRIBUTES];

/// What there is where nobody has filled them in.
pub const NO_ATTRIBUTES: Attributes = [Vec4::ZERO; MAX_ATTRIBUTES];
