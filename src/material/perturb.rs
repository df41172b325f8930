//! Bump and normal maps: the shading frame of the nested bsdf is turned.
//!
//! As Mitsuba 3.9: a perturbed normal that turns away from `wo` is flipped
//! about the unperturbed one (Schüssler et al. 2017), and the shadow terminator
//! is softened by the microfacet shadowing of Estevez et al. 2019. Both can be
//! switched off.

use super::{Lobe, Point};
use crate::math::{Frame, Vec2, Vec3};
use crate::texture::Texture;

/// How the frame is perturbed.
#[derive(Debug)]
pub struct Perturbation {
    /// Where the normal comes from.
    pub map: Map,
    /// Flip normals that turn away from `wo`.
    pub flip_invalid: bool,
    /// Soften the terminator.
    pub shadowing: bool,
}

/// The source of a perturbed normal.
#[derive(Debug)]
pub enum Map {
    /// A height field: its gradient with respect to uv, times a scale, in units of length.
    Bump(Texture, f32),
    /// A texture of local normals n, encoded as (n + 1) / 2.
    Normal(Texture),
    /// The same in glTF's tangent space, whose y is up in the image, with a
    /// factor on x and y.
    Tangent(Texture, f32),
}

impl Perturbation {
    /// Scene-file name.
    pub fn name(&self) -> &'static str {
        match self.map {
            Map::Bump(..) => "bumpmap",
            Map::Normal(_) | Map::Tangent(..) => "normalmap",
        }
    }

    /// The texture it reads.
    pub fn texture(&self) -> &Texture {
        match &self.map {
            Map::Bump(t, _) | Map::Normal(t) | Map::Tangent(t, _) => t,
        }
    }

    /// The perturbed normal in the coordinates of the unperturbed frame, not
    /// normalised.
    fn normal(&self, point: &Point) -> Vec3 {
        match &self.map {
            Map::Normal(texture) => texture.eval(point.coords()) * 2.0 - Vec3::ONE,
            Map::Tangent(texture, scale) => {
                let n = texture.eval(point.coords()) * 2.0 - Vec3::ONE;
                Vec3::new(n.x * scale, n.y * scale * point.bitangent_sign(), n.z)
            }
            Map::Bump(texture, scale) => {
                let gradient = Vec2::from(texture.gradient(point.coords())) * *scale;
                let n = point.frame.n;
                let dpdu = point.dpdu + n * (gradient.x - n.dot(point.dpdu));
                let dpdv = point.dpdv + n * (gradient.y - n.dot(point.dpdv));
                let normal = dpdu.cross(dpdv);
                let normal = if point.ng.dot(normal) < 0.0 { -normal } else { normal };
                point.frame.to_local(normal)
            }
        }
    }

    /// The lobe in the perturbed frame.
    pub fn apply<'a>(&self, point: &Point, outer: Lobe<'a>) -> Lobe<'a> {
        let wo = outer.frame.to_local(point.wo);
        let mut normal = self.normal(point);
        if self.flip_invalid && wo.z * wo.dot(normal) <= 0.0 {
            normal = Vec3::new(-normal.x, -normal.y, normal.z);
        }
        let normal = normal.try_normalize().unwrap_or(Vec3::Z);
        let local = Frame::from_normal_tangent(normal, Vec3::X);
        let frame = Frame {
            s: outer.frame.to_world(local.s),
            t: outer.frame.to_world(local.t),
            n: outer.frame.to_world(local.n),
        };
        let tan2 = (normal.x * normal.x + normal.y * normal.y) / (normal.z * normal.z);
        let alpha2 = if self.shadowing { (0.125 * tan2).min(1.0) } else { 0.0 };
        Lobe { frame, perturbed: Some((outer.frame.n, alpha2)), ..outer }
    }
}
