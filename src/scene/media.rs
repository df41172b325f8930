//! Which medium is on which side of what, and what passes through them.

use super::{Carried, Scene};
use crate::material::Scatter;
use crate::math::{Ray, Rgb, Vec3};
use crate::medium::Medium;
use crate::shape::SurfacePoint;

/// The media of a scene. A path is in one at a time: which one, the last
/// surface says that bounds any. There is no memory of what was outside of
/// that, as in Mitsuba.
#[derive(Clone, Debug)]
pub(super) struct Media {
    /// Each once.
    pub all: Vec<Medium>,
    /// Inside and outside of each shape that bounds a medium; empty without any.
    pub of_shape: Vec<Option<[u32; 2]>>,
    /// Where the camera is.
    pub camera: u32,
}

impl Default for Media {
    fn default() -> Media {
        Media { all: Vec::new(), of_shape: Vec::new(), camera: Medium::NONE }
    }
}

impl Scene {
    /// True when there are any.
    #[must_use]
    #[inline]
    pub fn has_media(&self) -> bool {
        !self.media.all.is_empty()
    }

    /// The medium that the camera is in.
    #[must_use]
    #[inline]
    pub fn camera_medium(&self) -> u32 {
        self.media.camera
    }

    /// The medium of a ray that leaves a surface point towards `wi`, when the
    /// one that arrived there came through `medium`.
    #[must_use]
    #[inline]
    pub fn medium_towards(&self, medium: u32, surface: &SurfacePoint, wi: Vec3) -> u32 {
        match self.media.of_shape.get(surface.shape as usize) {
            Some(Some([inside, outside])) => {
                if surface.ng.dot(wi) > 0.0 {
                    *outside
                } else {
                    *inside
                }
            }
            _ => medium,
        }
    }

    /// What is left after a way of that length through the darkest medium, but
    /// no less than normal numbers of f32 can tell; 1 without media.
    #[must_use]
    pub fn least_transmittance(&self, distance: f64) -> f64 {
        let darkest = self.media.all.iter().map(Medium::most).fold(0.0, f64::max);
        (-darkest * distance).exp().max(1e-36)
    }

    /// The share of light that comes along a ray to its end: through media, and
    /// through surfaces as far as they are not there (`null`, `mask`). The ray
    /// comes from a point in `medium`.
    #[must_use]
    #[inline(never)]
    pub fn passed(&self, mut ray: Ray, mut from: Vec3, mut medium: u32) -> Rgb {
        let end = ray.t_max.is_finite().then(|| ray.at(ray.t_max));
        let (mut left, mut room) = (Rgb::ONE, Scatter::default());
        loop {
            let found = self.closest(&ray).map(|hit| self.surface(&ray, &hit));
            let to = found.as_ref().map(|surface| surface.p).or(end);
            left *= self.transmittance(medium, to.map_or(f32::INFINITY, |p| p.distance(from)));
            let Some(surface) = found else { return left };
            if !self.lets_through(surface.shape) {
                return Rgb::ZERO;
            }
            let towards = ray.dir;
            left *= self
                .interact(&surface, -towards.normalize(), &Carried::NOTHING, &mut room)
                .scatter
                .null_share();
            if left == Rgb::ZERO {
                return left;
            }
            medium = self.medium_towards(medium, &surface, towards);
            let mut next = surface.spawn(towards);
            if let Some(end) = end {
                next = Ray { dir: end - next.origin, t_max: 1.0, skip_end: ray.skip_end, ..next };
                if !(next.dir.dot(towards) > 0.0) {
                    return left;
                }
            }
            (ray, from) = (next, surface.p);
        }
    }

    /// What is left of light after a way through a medium.
    #[must_use]
    #[inline]
    pub fn transmittance(&self, medium: u32, distance: f32) -> Rgb {
        self.media.all.get(medium as usize).map_or(Rgb::ONE, |medium| medium.transmittance(distance))
    }
}
