//! A point that projects a picture.

use glam::{DMat3, DVec2};

use super::{LightSample, Target, direction, grey};
use crate::math::{DVec3, Rgb, Transform, Vec3};
use crate::texture::Texture;

/// A projector along its local +z: an inverted pinhole camera. The picture is
/// upright for who looks along +z with +y up.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `irradiance` | 1 | irradiance over π on the plane at distance 1; may be a texture |
/// | `scale` | 1 | a factor on it |
/// | `fov` | from `focal_length` | as a perspective camera's, with the texture for the film |
/// | `fov_axis` | `x` | what `fov` spans |
/// | `to_world` | identity | light to world |
#[derive(Clone, Debug)]
pub struct Projector {
    /// Position in the recentred world.
    pub position: Vec3,
    /// `sampling_weight`.
    pub weight: f32,
    irradiance: Texture,
    scale: f64,
    to_local: DMat3,
    /// +z in the world.
    axis: Vec3,
    /// Half the width and height of the picture at distance 1.
    half: DVec2,
}

impl Projector {
    /// From a transform already recentred and the horizontal field of view.
    pub(super) fn new(
        irradiance: Texture,
        scale: f64,
        to_world: &Transform,
        x_fov_deg: f64,
        weight: f32,
    ) -> Projector {
        let half_width = (0.5 * x_fov_deg).to_radians().tan();
        Projector {
            position: to_world.matrix.w_axis.truncate().as_vec3(),
            weight,
            half: DVec2::new(half_width, half_width / irradiance.aspect()),
            irradiance,
            scale,
            to_local: DMat3::from_mat4(to_world.inverse),
            axis: to_world.vector(DVec3::Z).normalize_or(DVec3::Z).as_vec3(),
        }
    }

    /// Irradiance on a plane facing the light: E · π / (z² cos θ), where z is
    /// the distance along the axis and θ the angle from it.
    pub(super) fn sample(&self, ref_p: Vec3) -> Option<LightSample> {
        let (wi, _) = direction(ref_p, self.position)?;
        let local = self.to_local * (ref_p.as_dvec3() - self.position.as_dvec3());
        let cos = f64::from(-wi.dot(self.axis));
        if !(local.z > 0.0 && cos > 0.0) {
            return None;
        }
        let share = (DVec2::ONE - local.truncate() / local.z / self.half) * 0.5;
        if share.min_element() < 0.0 || share.max_element() > 1.0 {
            return None;
        }
        let value = self.irradiance.eval(share.as_vec2()).as_dvec3();
        let radiance = value * (self.scale * std::f64::consts::PI / (local.z * local.z * cos));
        Some(LightSample {
            wi,
            radiance: radiance.as_vec3(),
            pdf: 1.0,
            delta: true,
            target: Target::Point(self.position),
        })
    }

    /// π E over the picture at distance 1, in the world's units.
    pub(super) fn power(&self) -> f64 {
        let area = 4.0 * self.half.x * self.half.y / self.to_local.determinant().abs().powf(2.0 / 3.0);
        std::f64::consts::PI * self.scale * area * grey(self.irradiance.mean())
    }

    /// Its axis in the world and the angle from it to a corner of the picture;
    /// `None` when the transform is no similarity.
    pub(super) fn cone(&self) -> Option<(Vec3, f32)> {
        let square = self.to_local * self.to_local.transpose();
        let round = (square * (1.0 / square.x_axis.x) - DMat3::IDENTITY).to_cols_array();
        round.iter().all(|x| x.abs() < 1e-5).then(|| (self.axis, self.half.length().atan() as f32))
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.irradiance.memory_bytes()
    }

    /// A picture of one colour.
    pub(super) fn example(to_world: &Transform) -> Projector {
        Projector::new(Texture::Constant(Rgb::new(3.0, 2.0, 1.0)), 2.0, to_world, 60.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of Mitsuba 3.9.1.
    #[test]
    fn irradiance_is_mitsubas() {
        let light = Projector::new(Texture::Constant(Rgb::ONE), 1.0, &Transform::IDENTITY, 60.0, 1.0);
        for (x, y, expected) in [
            (0.0, 0.0, std::f32::consts::PI),
            (0.3, 0.0, 3.279_919_1),
            (0.57, 0.0, 3.616_108_7),
            (0.58, 0.0, 0.0),
            (0.0, 0.6, 0.0),
        ] {
            let found = light.sample(Vec3::new(x, y, 1.0)).map_or(0.0, |s| s.radiance.x);
            assert!((found - expected).abs() < 2e-6, "{x} {y}");
        }
        let far = light.sample(Vec3::new(0.3, 0.2, 2.0)).map(|s| s.radiance.x);
        assert!((far.unwrap_or(0.0) - 0.798_058_87).abs() < 1e-6);
        // Its power is the integral of intensity over directions.
        assert!((light.power() - std::f64::consts::PI * 4.0 / 3.0).abs() < 1e-9);
    }
}
