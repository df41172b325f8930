//! Cameras that see more than a plane can show.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::{Clip, FilmSize, Pose};
use crate::math::{DVec3, Ray, Vec2};

/// The whole sphere, unrolled: azimuth along x, with the view direction +z in
/// the middle, and height along y from straight up to straight down. Film
/// positions beyond the borders go on around the sphere.
#[derive(Clone, Debug)]
pub struct Spherical {
    pose: Pose,
    film: FilmSize,
    clip: Clip,
}

impl Spherical {
    pub(super) fn new(pose: Pose, film: FilmSize, clip: Clip) -> Spherical {
        Spherical { pose, film, clip }
    }

    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }

    pub(super) fn ray(&self, film: Vec2) -> Ray {
        let share = self.film.share(film);
        let (sin_phi, cos_phi) = ((0.5 - share.x) * TAU).sin_cos();
        let (sin_theta, cos_theta) = (share.y * PI).sin_cos();
        along(&self.pose, self.clip, DVec3::new(sin_theta * sin_phi, cos_theta, sin_theta * cos_phi))
    }

    /// Where on the film, in pixels, a point of camera space is seen.
    pub(super) fn film_of(&self, p: DVec3) -> Option<DVec2> {
        let d = p.try_normalize()?;
        let share = DVec2::new(0.5 - d.x.atan2(d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI);
        Some(share * DVec2::new(f64::from(self.film.width), f64::from(self.film.height)))
    }
}

/// A fisheye: the angle from the view direction grows evenly with the distance
/// from the middle of the picture (equidistant projection). What would lie
/// behind straight back is black.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `fov` | 180 | angle across the shorter side of the film in degrees, 0 < fov ≤ 360 |
#[derive(Clone, Debug)]
pub struct Fisheye {
    pose: Pose,
    film: FilmSize,
    clip: Clip,
    /// Angle per half the shorter side, in radians.
    half_angle: f64,
}

impl Fisheye {
    pub(super) fn new(pose: Pose, film: FilmSize, clip: Clip, fov_deg: f64) -> Fisheye {
        Fisheye { pose, film, clip, half_angle: 0.5 * fov_deg.to_radians() }
    }

    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Half the width and height of the film in half shorter sides.
    fn half(&self) -> DVec2 {
        let (w, h) = (f64::from(self.film.width), f64::from(self.film.height));
        DVec2::new(w, h) / w.min(h)
    }

    /// A ray that ends where it starts is beyond the picture.
    pub(super) fn ray(&self, film: Vec2) -> Ray {
        let at = (DVec2::ONE - 2.0 * self.film.share(film)) * self.half();
        let theta = at.length() * self.half_angle;
        // sin θ / |at|, which has a limit in the middle.
        let sinc = if theta > 0.0 { theta.sin() / theta * self.half_angle } else { self.half_angle };
        let dir = (at * sinc).extend(theta.cos());
        let mut ray = along(&self.pose, self.clip, dir);
        if theta > PI {
            ray.t_max = 0.0;
        }
        ray
    }

    /// Where on the film, in pixels, a point of camera space is seen.
    pub(super) fn film_of(&self, p: DVec3) -> Option<DVec2> {
        let d = p.try_normalize()?;
        let flat = d.truncate().length();
        let radius = flat.atan2(d.z) / self.half_angle;
        let at = d.truncate().try_normalize().unwrap_or(DVec2::ZERO) * radius;
        let share = (DVec2::ONE - at / self.half()) * 0.5;
        Some(share * DVec2::new(f64::from(self.film.width), f64::from(self.film.height)))
    }
}

/// The ray from the camera in a unit direction of camera space; the clip
/// "planes" are spheres.
fn along(pose: &Pose, clip: Clip, dir: DVec3) -> Ray {
    let dir = pose.vector(dir).normalize();
    let start = pose.point(DVec3::ZERO) + dir * clip.near;
    let mut ray = Ray::new(start.as_vec3(), dir.as_vec3());
    ray.t_max = (clip.far - clip.near) as f32;
    ray
}
