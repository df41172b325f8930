//! What rays are traced through: a scene, or bare geometry and a view of it.

use crate::integrator::shadow_ray;
use crate::material::Scatter;
use crate::math::{Bounds, Frame, Ray, Vec2, Vec3};
use crate::scene::{Carried, Scene};
use crate::shape::{Geometry, SurfacePoint};

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it stands.
    pub origin: Vec3,
    /// What it looks at.
    pub target: Vec3,
    /// Half the height of the picture at distance 1.
    pub half_height: f32,
}

impl View {
    /// Frames the sphere around a box: from in front of it, a little to the
    /// side and above (y is up).
    #[must_use]
    pub fn framing(bounds: Bounds) -> View {
        let (centre, radius) = bounds.bounding_sphere();
        View {
            origin: centre + Vec3::new(0.4, 0.3, 1.0).normalize() * (3.0 * radius),
            target: centre,
            half_height: 0.32,
        }
    }

    /// The ray through a point of the picture, (0, 0) upper left to (1, 1)
    /// lower right.
    fn ray(&self, at: Vec2, aspect: f32) -> Ray {
        let forward = (self.target - self.origin).normalize_or(Vec3::NEG_Z);
        let frame = Frame::from_normal_tangent(forward, forward.cross(Vec3::Y));
        let up = frame.s.cross(forward);
        let x = (2.0 * at.x - 1.0) * self.half_height * aspect;
        let y = (1.0 - 2.0 * at.y) * self.half_height;
        Ray::new(self.origin, (forward + frame.s * x + up * y).normalize())
    }
}

/// What rays are traced through.
#[derive(Debug)]
pub enum Subject {
    /// A scene with its camera and lights.
    Scene(Box<Scene>),
    /// Geometry alone.
    Geometry {
        /// Its primitives.
        geometry: Geometry,
        /// Where primary rays come from.
        view: View,
    },
}

impl Subject {
    /// All primitives.
    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        match self {
            Subject::Scene(scene) => &scene.geometry,
            Subject::Geometry { geometry, .. } => geometry,
        }
    }

    /// Width over height of the picture.
    pub(super) fn aspect(&self) -> f32 {
        match self {
            Subject::Scene(scene) => scene.film.size[0] as f32 / scene.film.size[1] as f32,
            Subject::Geometry { .. } => 16.0 / 9.0,
        }
    }

    /// The primary ray through a point of the picture, (0, 0) to (1, 1), and
    /// of the lens.
    pub(super) fn camera_ray(&self, at: Vec2, lens: Vec2) -> Ray {
        match self {
            Subject::Scene(scene) => {
                let [width, height] = scene.film.size;
                scene.camera.ray(at * Vec2::new(width as f32, height as f32), lens, 0.0)
            }
            Subject::Geometry { view, .. } => view.ray(at, self.aspect()),
        }
    }

    /// A shadow ray to a light of the scene; without lights to a point
    /// anywhere in the box around everything, grown by half. `None` when there
    /// is nothing on the side of `normal`: a renderer would trace no ray.
    pub(super) fn shadow_ray(
        &self,
        from: &SurfacePoint,
        normal: Vec3,
        choice: f32,
        u: [Vec2; 2],
    ) -> Option<Ray> {
        let ray = match self {
            Subject::Scene(scene) if !scene.lights.is_empty() => {
                let mut room = Scatter::default();
                let hit = scene.interact(from, normal, &Carried::NOTHING, &mut room);
                let which = (choice * scene.selection.most_candidates() as f32) as usize;
                let candidate = scene.sample_lights(&hit, choice, u[0]).nth(which)?;
                shadow_ray(from, &candidate.sample)
            }
            _ => {
                let bounds = self.geometry().bounds();
                let place = Vec3::new(u[0].x, u[0].y, u[1].x) - 0.5;
                from.spawn_to_point(bounds.centre() + bounds.extent() * place * 1.5)
            }
        };
        (ray.dir.dot(normal) > 0.0).then_some(ray)
    }
}
