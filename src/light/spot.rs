//! A point that shines into a cone.

use glam::{DMat3, Mat3};

use super::{LightSample, Target, direction, fall_off, grey};
use crate::math::{Rgb, Transform, Vec2, Vec3};
use crate::texture::Texture;

/// A spot light along its local +z. Its intensity is constant up to
/// `beam_width` from the axis and falls to zero at `cutoff_angle`, linearly in
/// the angle.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `intensity` | 1 | power per solid angle on the axis; colour, no texture |
/// | `cutoff_angle` | 20 | degrees from the axis where it ends, 0 < angle ≤ 180 |
/// | `beam_width` | ¾ of `cutoff_angle` | degrees from the axis where it starts to fall |
/// | `texture` | none | projected: \[0, 1\]² is the square around the cone; `cutoff_angle` < 90 |
/// | `to_world` | identity | light to world |
#[derive(Clone, Debug)]
pub struct Spot {
    /// Intensity on the axis, without the texture.
    pub intensity: Rgb,
    /// Position in the recentred world.
    pub position: Vec3,
    /// `sampling_weight`.
    pub weight: f32,
    to_local: Mat3,
    cone: Cone,
    texture: Option<Texture>,
}

/// Angles from the axis in radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// Where it ends.
    pub cutoff: f64,
    /// Where it starts to fall; at most `cutoff`.
    pub beam: f64,
}

impl Cone {
    /// Share of the intensity at an angle from the axis.
    fn share(self, angle: f64) -> f64 {
        if angle <= self.beam {
            1.0
        } else if angle < self.cutoff {
            (self.cutoff - angle) / (self.cutoff - self.beam)
        } else {
            0.0
        }
    }

    /// Integral of the share over all directions, in sr.
    fn integral(self) -> f64 {
        let Cone { cutoff, beam } = self;
        // (sin c − sin b) / (c − b) without cancellation.
        let half = 0.5 * (cutoff - beam);
        let sinc = if half > 0.0 { half.sin() / half } else { 1.0 };
        let slope = (0.5 * (cutoff + beam)).cos() * sinc;
        2.0 * std::f64::consts::PI * (1.0 - slope)
    }
}

impl Spot {
    /// From a transform already recentred.
    pub(super) fn new(intensity: Rgb, to_world: &Transform, cone: Cone, texture: Option<Texture>) -> Spot {
        Spot {
            intensity,
            position: to_world.matrix.w_axis.truncate().as_vec3(),
            weight: 1.0,
            to_local: DMat3::from_mat4(to_world.inverse).as_mat3(),
            cone,
            texture,
        }
    }

    pub(super) fn sample(&self, ref_p: Vec3) -> Option<LightSample> {
        let (wi, distance) = direction(ref_p, self.position)?;
        let d = (self.to_local * -wi).as_dvec3();
        let share = self.cone.share(d.x.hypot(d.y).atan2(d.z));
        let radiance = fall_off(self.intensity, share, distance) * self.projected(d.as_vec3(), share);
        Some(LightSample { wi, radiance, pdf: 1.0, delta: true, target: Target::Point(self.position) })
    }

    /// The texture's colour in a local direction.
    fn projected(&self, d: Vec3, share: f64) -> Rgb {
        match &self.texture {
            Some(texture) if share > 0.0 => {
                let half = (d.z * self.cone.cutoff.tan() as f32) * 2.0;
                texture.eval(Vec2::new(0.5 + d.x / half, 0.5 + d.y / half))
            }
            _ => Rgb::ONE,
        }
    }

    pub(super) fn power(&self) -> f64 {
        let mean = self.texture.as_ref().map_or(Rgb::ONE, Texture::mean);
        grey(self.intensity * mean) * self.cone.integral()
    }

    /// Its axis in the world and the angles (radians) at which it starts to
    /// fall and ends; `None` when the transform is no similarity, so that its
    /// cone is not round.
    pub(super) fn cone(&self) -> Option<(Vec3, f32, f32)> {
        let square = self.to_local * self.to_local.transpose();
        let round = (square * (1.0 / square.x_axis.x) - Mat3::IDENTITY).to_cols_array();
        let axis = (self.to_local.transpose() * Vec3::Z).try_normalize()?;
        let similar = round.iter().all(|x| x.abs() < 1e-5);
        similar.then_some((axis, self.cone.beam as f32, self.cone.cutoff as f32))
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.texture.as_ref().map_or(0, Texture::memory_bytes)
    }
}
