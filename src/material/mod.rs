//! Materials: textures to bsdfs by value.
//!
//! A [`Material`] is what a scene file calls a bsdf: leaves that read textures
//! ([`surface`]), and combinators (`twosided`, `mask`, `blendbsdf`, `bumpmap`,
//! `normalmap`). At a hit it is flattened into a [`Scatter`]: a short list of
//! weighted local-frame bsdfs, each with its own frame, which the integrator
//! evaluates and samples without knowing where they came from. Textures are
//! read once per hit.

mod build;
mod gltf;
mod perturb;
mod principled;
mod scatter;
mod surface;

pub use build::{MaterialBuilder, NAMES};
pub use scatter::{Carrier, Lobe, Scatter, ScatterSample, Stored};

use crate::bsdf::{Bsdf, Null};
use crate::math::{Frame, Rgb, Vec2, Vec3};
use crate::texture::{Coords, More, Texture};
use perturb::Perturbation;
use surface::Surface;

/// A material: a tree of combinators with surfaces at its leaves.
#[derive(Debug)]
pub enum Material {
    /// One bsdf whose parameters come from textures.
    Surface(Surface),
    /// Reflects on both sides: `[front, back]`; back `None` is the same as front.
    TwoSided(Box<[Material; 1]>, Option<Box<Material>>),
    /// Lets a fraction 1 − opacity pass straight through.
    Mask(Texture, Box<Material>),
    /// `(1 − weight)` of the first and `weight` of the second.
    Blend(Texture, Box<[Material; 2]>),
    /// Scattering in a frame perturbed by a texture.
    Perturbed(Perturbation, Box<Material>),
}

/// The side of a two-sided material that the path came from, and the frame
/// turned to that side.
#[inline]
fn sided<'a>(
    front: &'a [Material; 1],
    back: Option<&'a Material>,
    point: &Point,
    frame: Frame,
) -> (&'a Material, Frame) {
    if frame.n.dot(point.wo) >= 0.0 {
        (&front[0], frame)
    } else {
        (back.unwrap_or(&front[0]), frame.flipped())
    }
}

/// What a material needs to know of the point it is evaluated at.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// Texture coordinates.
    pub uv: Vec2,
    /// What only some textures read, if the material has such.
    pub more: Option<&'a More>,
    /// Unit direction towards where the path came from, world space.
    pub wo: Vec3,
    /// Geometric normal, unit, world space.
    pub ng: Vec3,
    /// Shading frame in world space; its `s` follows ∂p/∂u.
    pub frame: Frame,
    /// ∂p/∂u, world space.
    pub dpdu: Vec3,
    /// ∂p/∂v, world space.
    pub dpdv: Vec3,
    /// The one wavelength that is asked for, in nanometres; 0 for all.
    pub wavelength: f32,
}

impl<'a> Point<'a> {
    /// Where textures are looked up.
    #[must_use]
    #[inline]
    pub fn coords(&self) -> Coords<'a> {
        Coords { uv: self.uv, more: self.more }
    }

    /// 1 where glTF's bitangent lies along the frame's `t`, −1 where it lies
    /// against it: v runs down the image, so it points against ∂p/∂v.
    #[must_use]
    pub fn bitangent_sign(&self) -> f32 {
        if self.frame.t.dot(self.dpdv) > 0.0 { -1.0 } else { 1.0 }
    }
}

impl Material {
    /// Puts the bsdfs of this material at a point into `out`, and nothing else.
    #[inline]
    pub fn at<'a>(&'a self, point: &Point, out: &mut Scatter<'a>) {
        out.clear();
        // Most materials are one surface, perhaps on both sides.
        let (side, frame) = match self {
            Material::TwoSided(front, back) => sided(front, back.as_deref(), point, point.frame),
            other => (other, point.frame),
        };
        if let Material::Surface(surface) = side
            && !surface.is_stored()
        {
            out.push(Lobe::new(1.0, frame, Bsdf::Null(Null)), surface.at(point.coords()));
        } else {
            self.collect(point, Lobe::new(1.0, point.frame, Bsdf::Null(Null)), out);
        }
    }

    /// Adds this material's lobes, each with the weight, frame and
    /// perturbation of `outer`.
    fn collect<'a>(&'a self, point: &Point, outer: Lobe<'a>, out: &mut Scatter<'a>) {
        match self {
            Material::Surface(surface) => surface.put(point, outer, out),
            Material::TwoSided(front, back) => {
                let (side, frame) = sided(front, back.as_deref(), point, outer.frame);
                side.collect(point, Lobe { frame, ..outer }, out);
            }
            Material::Mask(opacity, inner) => {
                let opacity = opacity.eval_scalar(point.coords()).clamp(0.0, 1.0);
                if opacity > 0.0 {
                    inner.collect(point, Lobe { weight: outer.weight * opacity, ..outer }, out);
                }
                if opacity < 1.0 {
                    let weight = outer.weight * (1.0 - opacity);
                    out.push(Lobe { weight, ..outer }, Bsdf::Null(Null));
                }
            }
            Material::Blend(weight, inner) => {
                let w = weight.eval_scalar(point.coords()).clamp(0.0, 1.0);
                if w < 1.0 {
                    inner[0].collect(point, Lobe { weight: outer.weight * (1.0 - w), ..outer }, out);
                }
                if w > 0.0 {
                    inner[1].collect(point, Lobe { weight: outer.weight * w, ..outer }, out);
                }
            }
            Material::Perturbed(perturbation, inner) => {
                inner.collect(point, perturbation.apply(point, outer), out);
            }
        }
    }

    fn visit(&self, f: &mut impl FnMut(&Material)) {
        f(self);
        match self {
            Material::Surface(_) => {}
            Material::TwoSided(front, back) => {
                front[0].visit(f);
                if let Some(back) = back {
                    back.visit(f);
                }
            }
            Material::Mask(_, inner) | Material::Perturbed(_, inner) => inner.visit(f),
            Material::Blend(_, inner) => inner.iter().for_each(|m| m.visit(f)),
        }
    }

    /// Calls `f` with each of its textures.
    pub fn visit_textures(&self, f: &mut impl FnMut(&Texture)) {
        self.visit(&mut |m| match m {
            Material::Surface(s) => s.textures().into_iter().for_each(&mut *f),
            Material::Mask(t, _) | Material::Blend(t, _) => f(t),
            Material::Perturbed(p, _) => f(p.texture()),
            Material::TwoSided(..) => {}
        });
    }

    /// True when some texture of it averages over footprints.
    #[must_use]
    pub fn is_filtered(&self) -> bool {
        let mut found = false;
        self.visit_textures(&mut |t| t.visit_bitmaps(&mut |b| found |= b.is_filtered()));
        found
    }

    /// True when some texture of it averages over footprints in coordinates that an
    /// attribute of the mesh holds.
    #[must_use]
    pub fn is_filtered_by_attribute(&self) -> bool {
        let mut found = false;
        self.visit_textures(&mut |t| t.visit_bitmaps(&mut |b| found |= b.is_filtered_by_attribute()));
        found
    }

    fn any(&self, test: impl Fn(&Material) -> bool) -> bool {
        let mut found = false;
        self.visit(&mut |m| found |= test(m));
        found
    }

    /// True when some texture of it varies over the surface, so that texture
    /// coordinates are needed.
    #[must_use]
    pub fn needs_uv(&self) -> bool {
        let mut found = false;
        self.visit_textures(&mut |t| found |= t.is_constant().is_none());
        found
    }

    /// True when some texture of it reads attributes of the mesh.
    #[must_use]
    pub fn needs_attributes(&self) -> bool {
        let mut found = false;
        self.visit_textures(&mut |t| found |= t.reads_attributes());
        found
    }

    /// True when it depends on the direction of the tangent.
    #[must_use]
    pub fn needs_tangents(&self) -> bool {
        self.any(|m| match m {
            Material::Surface(s) => s.is_anisotropic(),
            Material::Perturbed(..) => true,
            _ => false,
        })
    }

    /// True when a hit may have a choice between lobes.
    #[must_use]
    pub fn chooses(&self) -> bool {
        self.any(|m| match m {
            Material::Surface(s) => s.chooses(),
            Material::Mask(..) | Material::Blend(..) => true,
            Material::TwoSided(..) | Material::Perturbed(..) => false,
        })
    }

    /// True when it refracts colours apart.
    #[must_use]
    pub fn disperses(&self) -> bool {
        self.any(|m| matches!(m, Material::Surface(Surface::Gltf(surface)) if surface.disperses()))
    }

    /// True when every lobe is a delta: nothing to connect to a light.
    #[must_use]
    pub fn is_delta_only(&self) -> bool {
        !self.any(|m| matches!(m, Material::Surface(s) if !s.is_delta_only()))
    }

    /// True when some light passes straight through (mask or null).
    #[must_use]
    pub fn has_null(&self) -> bool {
        self.any(|m| match m {
            Material::Mask(opacity, _) => opacity.is_constant().is_none_or(|c| c.x < 1.0),
            Material::Surface(s) => s.is_null(),
            _ => false,
        })
    }

    /// True when some lobe transmits: such a material cannot be made two-sided.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.any(|m| match m {
            Material::Mask(..) => true,
            Material::Surface(s) => s.transmits(),
            _ => false,
        })
    }

    /// True when light from below the shading normal may count: some lobe
    /// transmits, or a map perturbs the normal.
    #[must_use]
    pub fn needs_both_sides(&self) -> bool {
        self.transmits()
            || self.any(|m| match m {
                Material::Perturbed(..) => true,
                Material::Surface(s) => s.is_perturbed(),
                _ => false,
            })
    }

    /// Most lobes that one hit can have.
    #[must_use]
    pub fn lobe_count(&self) -> usize {
        match self {
            Material::Surface(_) => 1,
            Material::TwoSided(front, back) => {
                front[0].lobe_count().max(back.as_ref().map_or(0, |b| b.lobe_count()))
            }
            Material::Mask(_, inner) => inner.lobe_count() + 1,
            Material::Blend(_, inner) => inner[0].lobe_count() + inner[1].lobe_count(),
            Material::Perturbed(_, inner) => inner.lobe_count(),
        }
    }

    /// Scene-file names of the bsdfs in it, without repetition.
    #[must_use]
    pub fn kinds(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        self.visit(&mut |m| {
            let name = match m {
                Material::Surface(s) => s.name(),
                Material::TwoSided(..) => "twosided",
                Material::Mask(..) => "mask",
                Material::Blend(..) => "blendbsdf",
                Material::Perturbed(p, _) => p.name(),
            };
            if !names.contains(&name) {
                names.push(name);
            }
        });
        names
    }

    /// Bytes of tables that it holds beside textures.
    #[must_use]
    pub fn table_bytes(&self) -> usize {
        let mut bytes = 0;
        self.visit(&mut |m| {
            if let Material::Surface(Surface::Measured(tables)) = m {
                bytes += tables.memory_bytes();
            }
        });
        bytes
    }
}

/// A colour of one.
pub(crate) const WHITE: Rgb = Rgb::ONE;

impl Material {
    /// What a shape without a bsdf is made of: half-grey, or black for a light.
    #[must_use]
    pub fn default_for(emitter: bool) -> Material {
        let reflectance = if emitter { Rgb::ZERO } else { Rgb::splat(0.5) };
        Material::Surface(Surface::Diffuse { reflectance: Texture::Constant(reflectance) })
    }
}
