//! Cameras: a point of the film to a ray.
//!
//! Semantics are those of Mitsuba 3.9. Camera space looks along +z with +y up
//! and +x to the *left* of the picture; `to_world` maps it to the world. Film
//! positions are pixels of the whole film, (0, 0) its upper left corner, x to
//! the right, y down. Rays are worked out in f64 and rounded once; positions
//! are relative to the point the scene was recentred on.
//!
//! Near and far clip planes are part of what a camera sees, as in Mitsuba:
//! rays start on the near plane and end on the far one.
//!
//! | parameter of all | default | meaning |
//! |-|-|-|
//! | `to_world` | identity | camera to world |
//! | `near_clip`, `far_clip` | 0.01, 10000 | distances of the clip planes along the view |
//! | `focus_distance` | `far_clip` | distance of the plane in focus; only a lens reads it |
//! | `shutter_open`, `shutter_close` | 0, 0 | times, in the unit of the scene's animations |
//!
//! A `<film>` and a `<sampler>` inside are read elsewhere.

mod aperture;
mod motion;
mod orthographic;
mod panorama;
mod parse;
mod perspective;
mod thinlens;

pub use motion::CameraMotion;
pub use orthographic::Orthographic;
pub use panorama::{Fisheye, Spherical};
pub use parse::{camera_position, shutter};
pub use perspective::Perspective;
pub use thinlens::ThinLens;

use aperture::Aperture;
use glam::DVec2;

use crate::desc::{ObjectId, Result, SceneDesc, kinds};
use crate::math::{DMat4, DVec3, Ray, Transform, Vec2};

kinds! {
    /// A camera.
    #[derive(Clone, Debug)]
    pub enum Camera {
        /// Pinhole.
        Perspective(Perspective) = ["perspective"],
        /// Pinhole widened to a disk that focuses on one plane.
        ThinLens(ThinLens) = ["thinlens"],
        /// Parallel rays.
        Orthographic(Orthographic) = ["orthographic"],
        /// The whole sphere.
        Spherical(Spherical) = ["spherical"],
        /// Up to the whole sphere, round.
        Fisheye(Fisheye) = ["fisheye"],
    }
}

/// Pixels of the whole film; a crop window changes nothing for a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmSize {
    /// Pixels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
}

impl FilmSize {
    /// Width over height.
    #[must_use]
    pub fn aspect(self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }

    /// `film` as a share of the whole: (0, 0) to (1, 1).
    fn share(self, film: Vec2) -> DVec2 {
        film.as_dvec2() / DVec2::new(f64::from(self.width), f64::from(self.height))
    }
}

/// Distances of the clip planes along the view direction, 0 < near < far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    /// Nearest visible distance.
    pub near: f64,
    /// Farthest visible distance.
    pub far: f64,
}

impl Camera {
    /// Reads the `<sensor>` object `id`. World positions have `recentre`
    /// subtracted in f64. Fails with the place in the file on anything that is
    /// wrong or unknown.
    pub fn from_desc(scene: &SceneDesc, id: ObjectId, film: FilmSize, recentre: DVec3) -> Result<Camera> {
        parse::camera(scene, id, film, recentre)
    }

    /// The ray through `film` (pixels of the whole film) and the point of the
    /// lens that `lens` in \[0, 1)² picks. `dir` has unit length, the origin is
    /// on the near plane and `t_max` at the far one; a `t_max` of 0 says that
    /// the camera sees nothing there. Beyond the film's borders the film plane
    /// simply goes on.
    #[must_use]
    pub fn ray(&self, film: Vec2, lens: Vec2, time: f32) -> Ray {
        let mut ray = match self {
            Camera::Perspective(c) => c.ray(film),
            Camera::ThinLens(c) => c.ray(film, lens),
            Camera::Orthographic(c) => c.ray(film),
            Camera::Spherical(c) => c.ray(film),
            Camera::Fisheye(c) => c.ray(film),
        };
        ray.time = time;
        ray
    }

    /// True if [`Camera::ray`] depends on `lens`.
    #[must_use]
    pub fn needs_lens(&self) -> bool {
        matches!(self, Camera::ThinLens(c) if c.is_open())
    }

    /// World to RenderMan's camera space (left-handed: +x right, +y up, +z
    /// along the view), for the EXR attribute `worldToCamera`; rigid, in the
    /// scene's own world coordinates.
    ///
    /// Column vectors: p' = M·p. EXR stores the transpose (row vectors, the
    /// translation in the last row) row by row, which are the 16 numbers of
    /// `to_cols_array()` in their order.
    #[must_use]
    pub fn world_to_camera(&self) -> DMat4 {
        let axes = self.pose().rigid();
        DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * axes.inverse()
    }

    /// World to normalised device coordinates, for the EXR attribute
    /// `worldToNDC`: after division by w, (0, 0) is the upper left and (1, 1)
    /// the lower right corner of the display window (the whole film), and z
    /// goes from 0 on the near plane to 1 on the far one. Layout as in
    /// [`Camera::world_to_camera`]. `None` for cameras that no matrix describes.
    #[must_use]
    pub fn world_to_ndc(&self) -> Option<DMat4> {
        let to_film = match self {
            Camera::Perspective(c) => c.camera_to_ndc(),
            Camera::ThinLens(c) => c.camera_to_ndc(),
            Camera::Orthographic(c) => c.camera_to_ndc(),
            Camera::Spherical(_) | Camera::Fisheye(_) => return None,
        };
        Some(to_film * self.pose().original().inverse())
    }

    /// Where on a film of that many pixels a point of the recentred world is
    /// seen (through the middle of the lens); `None` behind the camera.
    #[must_use]
    pub fn film_of(&self, p: DVec3, size: DVec2) -> Option<DVec2> {
        let local = || self.pose().to_world.inverse().transform_point3(p);
        match self {
            Camera::Spherical(c) => c.film_of(local()),
            Camera::Fisheye(c) => c.film_of(local()),
            Camera::Perspective(_) | Camera::ThinLens(_) | Camera::Orthographic(_) => {
                let ndc = self.world_to_ndc()? * (p + self.pose().recentre).extend(1.0);
                (ndc.w > 0.0).then(|| (ndc.truncate() / ndc.w).truncate() * size)
            }
        }
    }

    /// Typical and extreme cameras, each with a name for messages, for a film
    /// of 60 × 40 pixels.
    #[must_use]
    pub fn examples() -> Vec<(String, Camera)> {
        let film = FilmSize { width: 60, height: 40 };
        let clip = Clip { near: 0.01, far: 1e4 };
        let turned = Transform::from_matrix(
            DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))
                * DMat4::from_axis_angle(DVec3::new(0.48, 0.6, -0.64), 2.0),
        )
        .unwrap_or_default();
        let pose = |to_world| Pose::new(to_world, DVec3::new(1.0, 2.0, 3.0));
        let pinhole = |fov: f64, offset| Perspective::new(pose(turned), film, clip, fov, offset);
        let lens = |aperture, tilt| ThinLens::new(pinhole(45.0, DVec2::ZERO), aperture, 2.0, tilt);
        let blades = Aperture { radius: 0.2, blades: 5, rotation: 0.4, ratio: 1.8 };
        vec![
            ("perspective".to_string(), pinhole(45.0, DVec2::ZERO).into()),
            ("perspective, shifted".to_string(), pinhole(60.0, DVec2::new(0.1, -0.2)).into()),
            ("perspective, 179 degrees".to_string(), pinhole(179.0, DVec2::ZERO).into()),
            ("perspective, 1e-3 degrees".to_string(), pinhole(1e-3, DVec2::ZERO).into()),
            ("thinlens".to_string(), lens(Aperture::disk(0.2), [0.0; 2]).into()),
            ("thinlens, closed".to_string(), lens(Aperture::disk(0.0), [0.0; 2]).into()),
            ("thinlens, blades and tilt".to_string(), lens(blades, [0.3, -1.2]).into()),
            ("orthographic".to_string(), Orthographic::new(pose(turned), film, clip).into()),
            ("spherical".to_string(), Spherical::new(pose(turned), film, clip).into()),
            ("fisheye".to_string(), Fisheye::new(pose(turned), film, clip, 180.0).into()),
            ("fisheye, whole sphere".to_string(), Fisheye::new(pose(turned), film, clip, 360.0).into()),
        ]
    }

    fn pose(&self) -> &Pose {
        match self {
            Camera::Perspective(c) => c.pose(),
            Camera::ThinLens(c) => c.pose(),
            Camera::Orthographic(c) => c.pose(),
            Camera::Spherical(c) => c.pose(),
            Camera::Fisheye(c) => c.pose(),
        }
    }
}

/// Where a camera stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// Camera to the recentred world.
    to_world: DMat4,
    /// What was subtracted from world positions.
    recentre: DVec3,
}

impl Pose {
    /// From the `to_world` of the file; `recentre` is subtracted here.
    pub(crate) fn new(to_world: Transform, recentre: DVec3) -> Pose {
        Pose { to_world: Transform::translate(-recentre).after(&to_world).matrix, recentre }
    }

    fn point(&self, p: DVec3) -> DVec3 {
        self.to_world.transform_point3(p)
    }

    fn vector(&self, v: DVec3) -> DVec3 {
        self.to_world.transform_vector3(v)
    }

    /// Camera to the world of the file.
    fn original(&self) -> DMat4 {
        let mut m = self.to_world;
        m.w_axis += self.recentre.extend(0.0);
        m
    }

    /// Camera to the world of the file, without scale.
    fn rigid(&self) -> DMat4 {
        let m = self.original();
        let unit = |c: glam::DVec4| c.truncate().normalize().extend(0.0);
        DMat4::from_cols(unit(m.x_axis), unit(m.y_axis), unit(m.z_axis), m.w_axis)
    }

    /// The ray from `origin` towards the point `target` at z = 1 further on,
    /// both in camera space, between the clip planes.
    #[inline]
    fn clipped_ray(&self, origin: DVec3, target: DVec3, clip: Clip) -> Ray {
        let towards = self.vector(target);
        // Lengths along the ray for one unit of z.
        let (stretch, length) = (target.length(), towards.length());
        let dir = towards / length;
        let start = self.point(origin) + dir * (clip.near * stretch);
        let mut ray = Ray::new(start.as_vec3(), dir.as_vec3());
        ray.t_max = ((clip.far - clip.near) * stretch) as f32;
        ray
    }
}
