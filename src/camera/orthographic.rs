//! Parallel projection.

use glam::{DVec2, DVec4};

use super::{Clip, FilmSize, Pose};
use crate::math::{DMat4, DVec3, Ray, Vec2};

/// A camera of parallel rays along +z. The film is \[-1, 1\] wide in camera
/// space and as high as its pixels make it; a scale in `to_world` sets its
/// size in the world.
///
/// As in Mitsuba a scale along z moves the near plane, while the length of
/// rays is `far_clip` − `near_clip` as given.
#[derive(Clone, Debug)]
pub struct Orthographic {
    pose: Pose,
    film: FilmSize,
    clip: Clip,
}

impl Orthographic {
    pub(super) fn new(pose: Pose, film: FilmSize, clip: Clip) -> Orthographic {
        Orthographic { pose, film, clip }
    }

    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }

    fn half(&self) -> DVec2 {
        DVec2::new(1.0, 1.0 / self.film.aspect())
    }

    pub(super) fn ray(&self, film: Vec2) -> Ray {
        let on_plane = (DVec2::ONE - 2.0 * self.film.share(film)) * self.half();
        let start = self.pose.point(on_plane.extend(self.clip.near));
        let dir = self.pose.vector(DVec3::Z).normalize();
        let mut ray = Ray::new(start.as_vec3(), dir.as_vec3());
        ray.t_max = (self.clip.far - self.clip.near) as f32;
        ray
    }

    pub(super) fn camera_to_ndc(&self) -> DMat4 {
        let Clip { near, far } = self.clip;
        let half = self.half();
        // A z of the film runs from near to near + (far - near) / scale of z.
        let scale = self.pose.vector(DVec3::Z).length();
        let depth = scale / (far - near);
        DMat4::from_cols(
            DVec4::new(-0.5 / half.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, -0.5 / half.y, 0.0, 0.0),
            DVec4::new(0.0, 0.0, depth, 0.0),
            DVec4::new(0.5, 0.5, -near * depth, 1.0),
        )
    }
}
