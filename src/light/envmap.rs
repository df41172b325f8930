//! A surrounding with a picture: an image in latitude and longitude.
//!
//! Conventions of Mitsuba 3.9: with local unit direction d, u = atan2(d.x, −d.z)
//! / 2π and v = acos(d.y) / π; texel columns have their centres at
//! u = (i + ½) / width and go round, while the first row is the pole +y itself
//! and the last row the pole −y: v = j / (height − 1).

use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

use glam::{DMat3, Mat3};

use super::envmap_table::{EnvTable, Weights};
use super::{LightSample, Target, grey};
use crate::desc::{Error, Image, Result};
use crate::math::{DVec3, Rgb, Vec2, Vec3};
use crate::texture::Texels;

/// Light from infinitely far away with the colours of an image.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `filename` | required | image in latitude–longitude layout, any size |
/// | `scale` | 1 | factor on its values, ≥ 0 |
/// | `to_world` | identity | rotation, mirroring; a translation changes nothing |
/// | `mis_compensation` | `false` | sample what is brighter than the mean more, and the rest less |
///
/// Directions are chosen in proportion to the mean of the channels, exactly.
/// With `mis_compensation` the mean texel is subtracted first (Karlík et al.
/// 2019), but a texel keeps at least 1/16 of its weight: Mitsuba lets it go to
/// zero, which is wrong unless another strategy is combined with this one.
#[derive(Clone, Debug)]
pub struct EnvMap {
    /// `sampling_weight`.
    pub weight: f32,
    picture: Picture,
    scale: f32,
    to_local: Mat3,
    to_world: DMat3,
    /// `None` for an image that is black all over.
    table: Option<EnvTable>,
    /// ∫ L dω, mean of channels.
    radiance_integral: f64,
}

/// What the caller decides about an environment map besides its image.
#[derive(Clone, Copy, Debug)]
pub(super) struct EnvOptions {
    pub scale: f32,
    /// Orthonormal.
    pub to_world: DMat3,
    pub mis_compensation: bool,
    pub weight: f32,
}

/// The image, and how much each texel weighs in sampling.
#[derive(Clone, Debug)]
struct Picture {
    texels: Texels,
    /// Subtracted from every texel's weight; 0 without MIS compensation.
    offset: f64,
}

/// Least share of its weight that MIS compensation leaves to a texel.
const COMPENSATION_FLOOR: f64 = 1.0 / 16.0;

impl Weights for Picture {
    fn size(&self) -> [u32; 2] {
        [self.texels.width(), self.texels.height()]
    }

    fn weight(&self, x: u32, y: u32) -> f64 {
        self.weight_of(self.texels.rgb(x, y))
    }
}

/// The four texels around a direction and where it lies among them.
struct Corners {
    xs: [u32; 2],
    ys: [u32; 2],
    w: Vec2,
}

impl Picture {
    fn corners(&self, d: Vec3) -> Corners {
        let [width, height] = self.size();
        let u = d.x.atan2(-d.z) / TAU;
        let v = d.x.hypot(d.z).atan2(d.y) * FRAC_1_PI;
        let x = u * width as f32 - 0.5;
        let y = (v * (height - 1) as f32).max(0.0);
        let j = (y as u32).min(height.max(2) - 2);
        // From −width/2 − ½: the columns go round.
        let left = x.floor();
        let i = left as i32;
        let i = if i < 0 { i.wrapping_add_unsigned(width) } else { i } as u32;
        let i = if i < width { i } else { 0 };
        let (above, right) = (j as f32, i + 1);
        Corners {
            xs: [i, if right < width { right } else { 0 }],
            ys: [j, (j + 1).min(height - 1)],
            w: Vec2::new(x - left, (y - above).min(1.0)),
        }
    }

    fn weight_of(&self, texel: Rgb) -> f64 {
        let l = grey(texel);
        (l - self.offset).max(l * COMPENSATION_FLOOR).min(l)
    }

    /// The texels of four corners: `[above, below]` of `[left, right]`.
    #[inline]
    fn texels(&self, corners: &Corners) -> [[Rgb; 2]; 2] {
        corners.ys.map(|y| corners.xs.map(|x| self.texels.rgb(x, y)))
    }

    /// Their interpolation.
    #[inline]
    fn eval(texels: &[[Rgb; 2]; 2], w: Vec2) -> Rgb {
        let row = |[left, right]: [Rgb; 2]| left * (1.0 - w.x) + right * w.x;
        row(texels[0]) * (1.0 - w.y) + row(texels[1]) * w.y
    }

    /// The interpolated weight.
    #[inline]
    fn density(&self, texels: &[[Rgb; 2]; 2], w: Vec2) -> f64 {
        let (wx, wy) = (f64::from(w.x), f64::from(w.y));
        let row = |[left, right]: [Rgb; 2]| self.weight_of(left) * (1.0 - wx) + self.weight_of(right) * wx;
        row(texels[0]) * (1.0 - wy) + row(texels[1]) * wy
    }

    /// Mean weight of all texels; 0 where it is so near the least one that
    /// compensating for it makes no sense (as Mitsuba decides it).
    fn compensation(&self) -> f64 {
        let [width, height] = self.size();
        let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let (mut sum, mut least) = (0.0, f64::INFINITY);
        for (x, y) in all {
            let l = grey(self.texels.rgb(x, y));
            sum += l;
            least = least.min(l);
        }
        let mean = sum / (f64::from(width) * f64::from(height));
        if mean - least <= 0.01 * mean { 0.0 } else { mean }
    }
}

impl EnvMap {
    /// Fails on an image that is no texture, has a texel that is negative or
    /// not finite, or becomes infinite by `scale`.
    pub(super) fn new(image: Arc<Image>, options: &EnvOptions) -> Result<EnvMap> {
        let texels = Texels::new(image, false)?;
        texels.check(0.0)?;
        let mut picture = Picture { texels, offset: 0.0 };
        check_scaled(&picture, options.scale)?;
        let plain = EnvTable::new(&picture);
        let radiance_integral = plain.as_ref().map_or(0.0, EnvTable::integral) * f64::from(options.scale);
        let mut table = plain.filter(|_| options.scale > 0.0);
        if options.mis_compensation && table.is_some() {
            picture.offset = picture.compensation();
            table = EnvTable::new(&picture);
        }
        Ok(EnvMap {
            weight: options.weight,
            picture,
            scale: options.scale,
            to_local: options.to_world.transpose().as_mat3(),
            to_world: options.to_world,
            table,
            radiance_integral,
        })
    }

    pub(super) fn radiance(&self, wi: Vec3) -> Rgb {
        let corners = self.corners(wi);
        Picture::eval(&self.picture.texels(&corners), corners.w) * self.scale
    }

    pub(super) fn pdf(&self, wi: Vec3) -> f32 {
        self.radiance_and_pdf(wi).1
    }

    /// Both from one look at the picture.
    pub(super) fn radiance_and_pdf(&self, wi: Vec3) -> (Rgb, f32) {
        let corners = self.corners(wi);
        let texels = self.picture.texels(&corners);
        let density = |t: &EnvTable| (self.picture.density(&texels, corners.w) / t.integral()) as f32;
        (Picture::eval(&texels, corners.w) * self.scale, self.table.as_ref().map_or(0.0, density))
    }

    pub(super) fn sample(&self, u: Vec2) -> Option<LightSample> {
        let angles = self.table.as_ref()?.sample(&self.picture, u);
        let ((sin_phi, cos_phi), (sin_theta, cos_theta)) = (angles.phi.sin_cos(), angles.theta.sin_cos());
        let d = DVec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta);
        let wi = (self.to_world * d).as_vec3();
        // Both from the rounded direction: what a ray that escapes will see.
        let (radiance, pdf) = self.radiance_and_pdf(wi);
        Some(LightSample { wi, radiance, pdf, delta: false, target: Target::Infinite })
    }

    fn corners(&self, wi: Vec3) -> Corners {
        self.picture.corners(self.to_local * wi)
    }

    pub(super) fn radiance_integral(&self) -> f64 {
        self.radiance_integral
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.picture.texels.memory_bytes() + self.table.as_ref().map_or(0, EnvTable::memory_bytes)
    }
}

fn check_scaled(picture: &Picture, scale: f32) -> Result<()> {
    let [width, height] = picture.size();
    for y in 0..height {
        for x in 0..width {
            let c = picture.texels.rgb(x, y);
            if !(c * scale).is_finite() {
                let name = picture.texels.name();
                let value = c.max_element();
                return Err(Error::new(format!(
                    "texel ({x}, {y}) of image `{name}` is {value:?}, infinite once scaled by {scale:?}"
                )));
            }
        }
    }
    Ok(())
}
