//! The pinhole camera with a lens: depth of field.

use super::aperture::Aperture;
use super::{Perspective, Pose};
use crate::math::{DMat4, DVec3, Ray, Vec2};

/// A camera whose pinhole is widened to an opening, and whose rays through one
/// point of the film meet again in the plane in focus. A point at distance d
/// is seen as the shape of the opening, of radius
/// `aperture_radius` · |1/d − 1/`focus_distance`| at unit distance.
///
/// | parameter | default | meaning |
/// |-|-|-|
/// | `aperture_radius` | required | radius of the lens; 0 is a pinhole |
/// | `focus_distance` | `far_clip` | distance of the plane in focus |
/// | `focus_point` | none | instead: a point of the world that the plane in focus goes through |
/// | `focus_tilt_x`, `focus_tilt_y` | 0 | degrees by which the plane in focus is turned about the picture's horizontal and vertical axis, −90 < tilt < 90 |
/// | `blades` | 0 | corners of the opening; 0 is a disk, else 3 or more |
/// | `blade_rotation` | 0 | degrees by which the corners are turned |
/// | `aperture_ratio` | 1 | height over width of the opening |
///
/// and those of [`Perspective`]. Mitsuba has the first two.
#[derive(Clone, Debug)]
pub struct ThinLens {
    pinhole: Perspective,
    aperture: Aperture,
    /// The plane in focus is where f · p is 1, in camera space.
    focus: DVec3,
}

impl ThinLens {
    /// The plane in focus crosses the axis at `focus_distance`; `tilt` in
    /// radians.
    pub(super) fn new(
        pinhole: Perspective,
        aperture: Aperture,
        focus_distance: f64,
        tilt: [f64; 2],
    ) -> ThinLens {
        // The plane z = distance turned about the axes x and y of the picture.
        let [x, y] = tilt.map(f64::tan);
        ThinLens { pinhole, aperture, focus: DVec3::new(y, x, 1.0) / focus_distance }
    }

    pub(super) fn is_open(&self) -> bool {
        self.aperture.radius > 0.0
    }

    pub(super) fn pose(&self) -> &Pose {
        self.pinhole.pose()
    }

    pub(super) fn ray(&self, film: Vec2, lens: Vec2) -> Ray {
        let origin = self.aperture.sample(lens).extend(0.0);
        // The point in focus is at d / (f · d).
        let d = self.pinhole.at_unit_distance(film);
        let target = d - origin * self.focus.dot(d);
        self.pose().clipped_ray(origin, target, self.pinhole.clip())
    }

    pub(super) fn camera_to_ndc(&self) -> DMat4 {
        self.pinhole.camera_to_ndc()
    }
}
