//! The compiled scene: immutable arrays, `u32` ids, and the plan of what is
//! needed.
//!
//! [`Scene::build`] checks a [`SceneDesc`], recentres it on the camera in f64
//! (so that f32 has its digits where the picture is), bakes shapes, materials
//! and lights, and builds the accelerator. After that nothing changes.

mod build;
mod plan;
mod select;

pub use plan::Plan;
pub use select::LightSelection;

use std::sync::Arc;

use crate::accel::Accel;
use crate::camera::Camera;
use crate::film::FilmSpec;
use crate::light::{Light, LightSample, Target};
use crate::material::{Material, Point, Scatter};
use crate::math::{Bounds, DVec3, Frame, Ray, Rgb, Vec2, Vec3};
use crate::shape::{Geometry, Hit, SurfacePoint};

/// Choices of the command line that go over the scene file.
#[derive(Clone, Debug, Default)]
pub struct BuildOptions {
    /// Film size in pixels, instead of the file's.
    pub size: Option<[u32; 2]>,
    /// Crop window x, y, width, height in pixels, instead of the file's.
    pub crop: Option<[u32; 4]>,
    /// Name of the accelerator; `None` is the default one.
    pub accel: Option<String>,
    /// Name of the quality of its tree; `None` is the default one.
    pub bvh: Option<String>,
}

/// Marks "no light" in [`Scene::light_of_shape`].
const NO_LIGHT: u32 = u32::MAX;

/// A scene ready to render.
#[derive(Debug)]
pub struct Scene {
    /// All primitives, recentred.
    pub geometry: Geometry,
    /// Finds hits among them.
    pub accel: Accel,
    /// The camera.
    pub camera: Camera,
    /// Size, crop and filter of the film.
    pub film: FilmSpec,
    /// Samples per pixel that the file asks for.
    pub samples_per_pixel: u64,
    /// Lights that can be sampled.
    pub lights: Vec<Light>,
    /// How one of them is chosen.
    pub selection: LightSelection,
    /// Index of the environment among the lights.
    pub environment: Option<u32>,
    /// What is needed and what was left out.
    pub plan: Plan,
    /// What was subtracted from all world positions.
    pub recentre: DVec3,
    materials: Vec<Arc<Material>>,
    material_of_shape: Vec<u32>,
    light_of_shape: Vec<u32>,
}

/// A hit with everything that shading needs.
#[derive(Clone, Debug)]
pub struct Interaction<'a> {
    /// The surface point.
    pub surface: SurfacePoint,
    /// Unit direction towards where the path came from.
    pub wo: Vec3,
    /// The material's lobes.
    pub scatter: Scatter<'a>,
}

/// A light sample with the probability of having chosen the light in it.
#[derive(Clone, Copy, Debug)]
pub struct ChosenLight {
    /// The sample; its pdf does not include the choice.
    pub sample: LightSample,
    /// Per solid angle, including the choice (discrete for delta lights).
    pub pdf: f32,
}

impl Scene {
    /// The nearest hit along a ray.
    #[must_use]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.accel.closest(&self.geometry, ray)
    }

    /// True when something lies between the ends of the ray.
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.accel.occluded(&self.geometry, ray)
    }

    /// The surface point of a hit.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        self.geometry.surface(ray, hit)
    }

    /// The material's lobes at a surface point.
    #[must_use]
    pub fn interact(&self, surface: SurfacePoint, wo: Vec3) -> Interaction<'_> {
        let material = &self.materials[self.material_of_shape[surface.shape as usize] as usize];
        let point = Point {
            uv: surface.uv,
            wo,
            ng: surface.ng,
            frame: Frame::from_normal_tangent(surface.ns, surface.dpdu),
            dpdu: surface.dpdu,
            dpdv: surface.dpdv,
        };
        Interaction { scatter: material.at(&point), surface, wo }
    }

    /// The light that a shape is, if it is one.
    #[must_use]
    pub fn light_of_shape(&self, shape: u32) -> Option<u32> {
        let light = self.light_of_shape[shape as usize];
        (light != NO_LIGHT).then_some(light)
    }

    /// Radiance that the surface point emits towards `wo`; zero if it is no light.
    #[must_use]
    pub fn emitted(&self, surface: &SurfacePoint, wo: Vec3) -> Rgb {
        match self.light_of_shape(surface.shape).map(|i| &self.lights[i as usize]) {
            Some(Light::Area(area)) => area.emitted(surface, wo),
            _ => Rgb::ZERO,
        }
    }

    /// Radiance of the environment from direction `wi`; zero without one.
    #[must_use]
    pub fn environment(&self, wi: Vec3) -> Rgb {
        self.environment.map_or(Rgb::ZERO, |i| self.lights[i as usize].environment(wi))
    }

    /// Chooses a light and a direction towards it, as seen from a surface point.
    #[must_use]
    pub fn sample_light(&self, from: &SurfacePoint, u_choice: f32, u: Vec2) -> Option<ChosenLight> {
        let (index, pmf) = self.selection.sample(u_choice)?;
        let sample = self.sample_one_light(index, from, u)?;
        Some(ChosenLight { sample, pdf: sample.pdf * pmf })
    }

    /// A direction towards one light, by its index.
    #[must_use]
    pub fn sample_one_light(&self, index: usize, from: &SurfacePoint, u: Vec2) -> Option<LightSample> {
        let sample = self.lights[index].sample(&self.geometry, from.p, u)?;
        // A flat light does not see itself. From a point on it, rounding alone
        // decides on which side the point lies, and so whether the light fills
        // half the sky or nothing.
        let own = matches!(&sample.target, Target::Surface(t) if from.planar && t.prim == from.prim);
        (!own).then_some(sample)
    }

    /// Pdf per solid angle with which [`Scene::sample_light`] from `p` would
    /// have found the emitting `surface` in direction `wi`.
    #[must_use]
    pub fn light_pdf(&self, p: Vec3, surface: &SurfacePoint, wi: Vec3, distance_squared: f32) -> f32 {
        let Some(index) = self.light_of_shape(surface.shape) else { return 0.0 };
        let Light::Area(area) = &self.lights[index as usize] else { return 0.0 };
        self.selection.pmf(index as usize) * area.pdf(&self.geometry, p, surface, wi, distance_squared)
    }

    /// The same for the environment.
    #[must_use]
    pub fn environment_pdf(&self, wi: Vec3) -> f32 {
        self.environment
            .map_or(0.0, |i| self.selection.pmf(i as usize) * self.lights[i as usize].pdf_environment(wi))
    }

    /// Bounds of all primitives, recentred.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.accel.bounds()
    }

    /// The distinct materials.
    #[must_use]
    pub fn materials(&self) -> &[Arc<Material>] {
        &self.materials
    }
}
