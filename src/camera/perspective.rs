//! The pinhole camera.

use glam::{DVec2, DVec4};

use super::{Clip, FilmSize, Pose};
use crate::math::{DMat4, DVec3, Ray, Vec2};

/// A pinhole camera.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `fov` | from `focal_length` | field of view in degrees, 0 < fov < 180 |
/// | `fov_axis` | `x` | what `fov` spans: `x`, `y`, `diagonal`, `smaller`, `larger` |
/// | `focal_length` | `50mm` | 35 mm equivalent, of the diagonal; not with `fov` |
/// | `principal_point_offset_x`, `_y` | 0 | shift of the picture, in widths and heights of the film |
///
/// and those of all cameras.
#[derive(Clone, Debug)]
pub struct Perspective {
    pose: Pose,
    film: FilmSize,
    clip: Clip,
    /// Half the width and height of the film at distance 1.
    half: DVec2,
    principal_point_offset: DVec2,
}

impl Perspective {
    /// From the horizontal field of view in degrees.
    pub(super) fn new(
        pose: Pose,
        film: FilmSize,
        clip: Clip,
        x_fov_deg: f64,
        principal_point_offset: DVec2,
    ) -> Perspective {
        let half_width = (0.5 * x_fov_deg).to_radians().tan();
        let half = DVec2::new(half_width, half_width / film.aspect());
        Perspective { pose, film, clip, half, principal_point_offset }
    }

    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }

    pub(super) fn clip(&self) -> Clip {
        self.clip
    }

    /// The point at distance 1 along the view that `film` shows, in camera space.
    pub(super) fn at_unit_distance(&self, film: Vec2) -> DVec3 {
        let share = self.film.share(film) + self.principal_point_offset;
        ((DVec2::ONE - 2.0 * share) * self.half).extend(1.0)
    }

    pub(super) fn ray(&self, film: Vec2) -> Ray {
        self.pose.clipped_ray(DVec3::ZERO, self.at_unit_distance(film), self.clip)
    }

    /// The inverse of [`Perspective::at_unit_distance`] as a matrix, with z
    /// from near to far mapped to 0 to 1; w is the distance.
    pub(super) fn camera_to_ndc(&self) -> DMat4 {
        let Clip { near, far } = self.clip;
        let depth = far / (far - near);
        DMat4::from_cols(
            DVec4::new(-0.5 / self.half.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, -0.5 / self.half.y, 0.0, 0.0),
            (DVec2::splat(0.5) - self.principal_point_offset).extend(depth).extend(1.0),
            DVec4::new(0.0, 0.0, -near * depth, 0.0),
        )
    }
}
