//! A point that shines into a cone.

use glam::{DMat3, Mat3};

use super::{LightSample, Target, direction, fall_off, grey};
use crate::math::{Rgb, Transform, Vec2, Vec3};
use crate::texture::Texture;

/// A spot light along its local +z. Its intensity is constant up to
/// `beam_width` b from the axis and falls to zero at `cutoff_angle` c: linearly
/// in the angle θ from it, (c − θ) / (c − b), as Mitsuba's does; or as glTF's
/// (KHR_lights_punctual), ((cos θ − cos c) / (cos b − cos c))².
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `intensity` | 1 | power per solid angle on the axis; colour, no texture |
/// | `cutoff_angle` | 20 | degrees from the axis where it ends, 0 < angle ≤ 180 |
/// | `beam_width` | ¾ of `cutoff_angle` | degrees from the axis where it starts to fall |
/// | `falloff` | `linear` | between the two angles: `linear` in the angle, or `squared`: the square of what is linear in its cosine |
/// | `texture` | none | projected: \[0, 1\]² is the square around the cone; `cutoff_angle` < 90 |
/// | `to_world` | identity | light to world; may be an `<animation>` |
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
    /// How it falls between the two.
    pub falloff: Falloff,
}

/// How a cone falls off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Falloff {
    /// Linearly in the angle.
    Linear,
    /// By the square of what is linear in the cosine of the angle.
    Squared,
}

/// cos a − cos b, without cancellation.
fn cos_difference(a: f64, b: f64) -> f64 {
    2.0 * (0.5 * (b + a)).sin() * (0.5 * (b - a)).sin()
}

impl Cone {
    /// Share of the intensity at an angle from the axis.
    fn share(self, angle: f64) -> f64 {
        let Cone { cutoff, beam, falloff } = self;
        if angle <= beam {
            return 1.0;
        }
        if angle >= cutoff {
            return 0.0;
        }
        match falloff {
            Falloff::Linear => (cutoff - angle) / (cutoff - beam),
            Falloff::Squared => (cos_difference(angle, cutoff) / cos_difference(beam, cutoff)).powi(2),
        }
    }

    /// Integral of the share over all directions, in sr.
    fn integral(self) -> f64 {
        let Cone { cutoff, beam, falloff } = self;
        // Of a cap of half angle θ it is 2π·(1 − cos θ).
        let cap = match falloff {
            Falloff::Linear => {
                // (sin c − sin b) / (c − b) without cancellation.
                let half = 0.5 * (cutoff - beam);
                let sinc = if half > 0.0 { half.sin() / half } else { 1.0 };
                1.0 - (0.5 * (cutoff + beam)).cos() * sinc
            }
            Falloff::Squared => cos_difference(0.0, beam) + cos_difference(beam, cutoff) / 3.0,
        };
        2.0 * std::f64::consts::PI * cap
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
        self.sample_from((self.position, self.to_local), ref_p)
    }

    /// The same of one that stands elsewhere.
    pub(super) fn sample_from(&self, (position, to_local): (Vec3, Mat3), ref_p: Vec3) -> Option<LightSample> {
        let (wi, distance) = direction(ref_p, position)?;
        let d = (to_local * -wi).as_dvec3();
        let share = self.cone.share(d.x.hypot(d.y).atan2(d.z));
        let radiance = fall_off(self.intensity, share, distance) * self.projected(d.as_vec3(), share);
        Some(LightSample { wi, radiance, pdf: 1.0, delta: true, target: Target::Point(position) })
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
        self.cone_of(self.to_local)
    }

    /// The same of one that is turned otherwise.
    pub(super) fn cone_of(&self, to_local: Mat3) -> Option<(Vec3, f32, f32)> {
        let square = to_local * to_local.transpose();
        let round = (square * (1.0 / square.x_axis.x) - Mat3::IDENTITY).to_cols_array();
        let axis = (to_local.transpose() * Vec3::Z).try_normalize()?;
        let similar = round.iter().all(|x| x.abs() < 1e-5);
        similar.then_some((axis, self.cone.beam as f32, self.cone.cutoff as f32))
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.texture.as_ref().map_or(0, Texture::memory_bytes)
    }
}
