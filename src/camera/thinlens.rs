//! The pinhole camera with a lens: depth of field.

use super::{Perspective, Pose};
use crate::math::{DMat4, DVec3, Ray, Vec2};
use crate::sampling::concentric_disk;

/// A camera whose pinhole is widened to a disk, and whose rays through one
/// point of the film meet again in the plane in focus. A point at distance d
/// is seen as a disk of radius `aperture_radius` · |1/d − 1/`focus_distance`|
/// at unit distance.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `aperture_radius` | required | radius of the lens; 0 is a pinhole |
/// | `focus_distance` | `far_clip` | distance of the plane in focus |
///
/// and those of [`Perspective`] except the principal point.
#[derive(Clone, Debug)]
pub struct ThinLens {
    pinhole: Perspective,
    aperture_radius: f64,
    focus_distance: f64,
}

impl ThinLens {
    pub(super) fn new(pinhole: Perspective, aperture_radius: f64, focus_distance: f64) -> ThinLens {
        ThinLens { pinhole, aperture_radius, focus_distance }
    }

    pub(super) fn aperture_radius(&self) -> f64 {
        self.aperture_radius
    }

    pub(super) fn pose(&self) -> &Pose {
        self.pinhole.pose()
    }

    pub(super) fn ray(&self, film: Vec2, lens: Vec2) -> Ray {
        let lens = concentric_disk(lens).as_dvec2() * self.aperture_radius;
        let origin = DVec3::new(lens.x, lens.y, 0.0);
        let target = self.pinhole.at_unit_distance(film) - origin / self.focus_distance;
        self.pose().clipped_ray(origin, target, self.pinhole.clip())
    }

    pub(super) fn camera_to_ndc(&self) -> DMat4 {
        self.pinhole.camera_to_ndc()
    }
}
