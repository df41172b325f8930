//! The compiled scene: immutable arrays, `u32` ids, and the plan of what is
//! needed.
//!
//! [`Scene::build`] checks a [`SceneDesc`], recentres it on the camera in f64
//! (so that f32 has its digits where the picture is), bakes shapes, materials
//! and lights, and builds the accelerator. After that nothing changes.

mod build;
mod lamps;
mod media;
mod plan;
mod select;
mod shapes;

pub use plan::Plan;
pub use select::{Candidates, Choice, LightSelection};
pub use shapes::SHAPES;

use std::sync::Arc;

use glam::DVec2;

use crate::accel::Accel;
use crate::camera::{Camera, CameraMotion};
use crate::color::Hue;
use crate::film::FilmSpec;
use crate::light::{AreaEmission, Light, LightSample, Receiver, Target};
use crate::material::{Material, Point, Scatter};
use crate::math::{Bounds, DVec3, Frame, Ray, Rgb, Vec2, Vec3};
use crate::medium::Medium;
use crate::shape::{Geometry, Hit, SurfacePoint};
use crate::texture::{Footprint, MAX_ATTRIBUTES, More, NO_ATTRIBUTES, NO_FOOTPRINTS, TextureFilter};

/// Choices of the command line that go over the scene file.
#[derive(Clone, Debug, Default)]
pub struct BuildOptions {
    /// Film size in pixels, instead of the file's.
    pub size: Option<[u32; 2]>,
    /// Crop window x, y, width, height in pixels, instead of the file's.
    pub crop: Option<[u32; 4]>,
    /// How textures are read.
    pub texture_filter: TextureFilter,
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
    /// How the camera moves while the shutter is open, if it does.
    camera_motion: Option<CameraMotion>,
    /// Size, crop and filter of the film.
    pub film: FilmSpec,
    /// Samples per pixel that the file asks for.
    pub samples_per_pixel: u64,
    /// Lights that can be sampled.
    pub lights: Vec<Light>,
    /// Shapes of groups and curves that glow, and which lights their instances are. The
    /// indices of these shapes go on from those of the lights.
    lamps: lamps::Lamps,
    /// What fills space.
    media: media::Media,
    /// How one of them is chosen.
    pub selection: LightSelection,
    /// Index of the environment among the lights.
    pub environment: Option<u32>,
    /// What is needed and what was left out.
    pub plan: Plan,
    /// What was subtracted from all world positions.
    pub recentre: DVec3,
    /// Width of a pixel where a camera ray begins, and more of it per unit of distance.
    pixel: [f32; 2],
    materials: Vec<Arc<Material>>,
    /// What to know of each of them beforehand.
    traits: Vec<Traits>,
    material_of_shape: Vec<u32>,
    light_of_shape: Vec<u32>,
}

/// What a hit needs to know of its material before that is evaluated.
#[derive(Clone, Copy, Debug)]
struct Traits {
    /// It looks at the direction of the tangent.
    tangents: bool,
    /// Light from below the shading normal may count.
    two_sided: bool,
    /// It reads attributes of the mesh.
    attributes: bool,
    /// It averages over footprints.
    filtered: bool,
    /// It does so in coordinates that an attribute of the mesh holds.
    filtered_by_attribute: bool,
    /// Some light passes straight through.
    null: bool,
    /// It refracts colours apart.
    disperses: bool,
}

/// What a path brings to a surface beside its ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// The medium that it came through, [`Medium::NONE`] for none.
    pub medium: u32,
    /// The one wavelength that is left of it in nanometres, if it has been
    /// refracted apart; else 0.
    pub wavelength: f32,
    /// It has just been drawn: its colour has not been taken into account.
    pub fresh: bool,
    /// Width of what the sample covers there; 0 for a point.
    pub footprint: f32,
}

impl Carried {
    /// White light through empty space.
    pub const NOTHING: Carried =
        Carried { medium: Medium::NONE, wavelength: 0.0, fresh: false, footprint: 0.0 };
}

/// A hit with everything that shading needs.
#[derive(Clone, Debug)]
pub struct Interaction<'a, 's> {
    /// The surface point.
    pub surface: &'a SurfacePoint,
    /// Unit direction towards where the path came from.
    pub wo: Vec3,
    /// What the path brought along.
    pub carried: &'a Carried,
    /// The material's lobes.
    pub scatter: &'a Scatter<'s>,
    /// Light from below the shading normal may count.
    pub two_sided: bool,
}

impl Interaction<'_, '_> {
    /// The colour that light towards or from `wi` takes on here, where white
    /// is refracted apart. What a solid reflects from outside stays white.
    #[must_use]
    #[inline]
    pub fn split(&self, wi: Vec3) -> Option<Rgb> {
        if !self.carried.fresh {
            return None;
        }
        let SurfacePoint { ng, .. } = *self.surface;
        let reflected = ng.dot(self.wo) > 0.0 && ng.dot(wi) > 0.0;
        (!reflected).then(|| Hue::of(self.carried.wavelength).colour)
    }

    /// The point as lights see it.
    #[must_use]
    pub fn receiver(&self) -> Receiver {
        let SurfacePoint { p, ns, time, .. } = *self.surface;
        Receiver { p, n: if ns.dot(self.wo) < 0.0 { -ns } else { ns }, two_sided: self.two_sided, time }
    }
}

/// A light sample of [`Scene::sample_lights`].
#[derive(Clone, Copy, Debug)]
pub struct ChosenLight {
    /// The sample; its pdf does not include the choice.
    pub sample: LightSample,
    /// Samples per solid angle, the rate of the choice included (for delta
    /// lights the rate alone).
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

    /// A surface point with its material's lobes, which are put into `room`;
    /// seen by a path that brings `carried` along.
    #[inline]
    pub fn interact<'a, 's>(
        &'s self,
        surface: &'a SurfacePoint,
        wo: Vec3,
        carried: &'a Carried,
        room: &'a mut Scatter<'s>,
    ) -> Interaction<'a, 's> {
        let index = self.material_of_shape[surface.shape as usize] as usize;
        let Traits { tangents, two_sided, attributes, filtered, .. } = self.traits[index];
        let frame = if tangents {
            Frame::from_normal_tangent(surface.ns, surface.dpdu)
        } else {
            Frame::from_normal(surface.ns)
        };
        let SurfacePoint { uv, ng, dpdu, dpdv, .. } = *surface;
        let filled;
        let more = if attributes | filtered {
            filled = More {
                attributes: if attributes { self.geometry.attributes(surface) } else { NO_ATTRIBUTES },
                footprint: if filtered {
                    self.own_footprint(surface, wo, carried.footprint)
                } else {
                    Footprint::POINT
                },
                footprints: if self.traits[index].filtered_by_attribute {
                    self.footprints(surface, wo, carried.footprint)
                } else {
                    NO_FOOTPRINTS
                },
            };
            Some(&filled)
        } else {
            None
        };
        let wavelength = carried.wavelength;
        let point = Point { uv, more, wo, ng, frame, dpdu, dpdv, wavelength };
        self.materials[index].at(&point, room);
        Interaction { surface, wo, carried, scatter: room, two_sided }
    }

    /// The footprint of a beam of so much width along `wo` in (u, v).
    #[cold]
    fn own_footprint(&self, surface: &SurfacePoint, wo: Vec3, width: f32) -> Footprint {
        let [dpdu, dpdv] = self.geometry.uv_derivatives(surface);
        Footprint::new(width, wo, dpdu, dpdv)
    }

    /// The footprints of a beam of so much width along `wo` in the coordinates that
    /// attributes hold.
    #[cold]
    fn footprints(&self, surface: &SurfacePoint, wo: Vec3, width: f32) -> [Footprint; MAX_ATTRIBUTES] {
        self.geometry
            .attribute_derivatives::<MAX_ATTRIBUTES>(surface)
            .map(|[dpds, dpdt]| Footprint::new(width, wo, dpds, dpdt))
    }

    /// True when some light passes straight through a shape.
    #[must_use]
    pub fn lets_through(&self, shape: u32) -> bool {
        self.traits[self.material_of_shape[shape as usize] as usize].null
    }

    /// True when the material of a shape refracts colours apart.
    #[must_use]
    pub fn disperses(&self, shape: u32) -> bool {
        self.traits[self.material_of_shape[shape as usize] as usize].disperses
    }

    /// The light that a shape is, if it is one.
    #[must_use]
    pub fn light_of_shape(&self, shape: u32) -> Option<u32> {
        let light = self.light_of_shape[shape as usize];
        (light != NO_LIGHT).then_some(light)
    }

    /// Radiance that the surface point emits towards `wo`; zero if it is no light.
    #[must_use]
    #[inline]
    pub fn emitted(&self, surface: &SurfacePoint, wo: Vec3) -> Rgb {
        let Some(index) = self.light_of_shape(surface.shape) else { return Rgb::ZERO };
        match self.lights.get(index as usize) {
            Some(Light::Area(area)) => area.emitted(&self.geometry, surface, wo),
            Some(_) => Rgb::ZERO,
            None => self.emitted_by_placed(index, surface, wo),
        }
    }

    /// The same of a lamp in an instance. Apart, since in [`Scene::emitted`] it cost
    /// scenes without such lamps 1 % of their instructions.
    #[cold]
    #[inline(never)]
    fn emitted_by_placed(&self, index: u32, surface: &SurfacePoint, wo: Vec3) -> Rgb {
        let emission = self.lamps.emission(index as usize - self.lights.len());
        emission.emitted(&self.geometry, surface, wo)
    }

    /// The ray through a point of the film and of the lens, at a time of the
    /// shutter in [0, 1]: see [`Camera::ray`].
    #[must_use]
    pub fn camera_ray(&self, film: Vec2, lens: Vec2, time: f32) -> Ray {
        let ray = self.camera.ray(film, lens, time);
        match &self.camera_motion {
            None => ray,
            Some(motion) => motion.carry(&ray),
        }
    }

    /// Width of the footprint of sample `index` of a pixel at a distance from the
    /// camera: see [`crate::texture::Footprint`].
    #[must_use]
    pub fn footprint(&self, index: u32, distance: f32) -> f32 {
        (self.pixel[0] + self.pixel[1] * distance) / (index as f32 + 1.0).sqrt()
    }

    /// True when the camera moves while the shutter is open.
    #[must_use]
    pub fn camera_moves(&self) -> bool {
        self.camera_motion.is_some()
    }

    /// Radiance of the environment from direction `wi`; zero without one.
    #[must_use]
    pub fn environment(&self, wi: Vec3) -> Rgb {
        self.environment.map_or(Rgb::ZERO, |i| self.lights[i as usize].environment(wi))
    }

    /// Chooses lights, and a direction towards each, as seen from a hit. The
    /// light that is reflected has the mean of Σ f·|cos θ|·L / pdf.
    pub fn sample_lights<'a>(
        &'a self,
        hit: &'a Interaction,
        u_choice: f32,
        u: Vec2,
    ) -> impl Iterator<Item = ChosenLight> + 'a {
        let receiver = hit.receiver();
        let more = u.x.to_bits() ^ u.y.to_bits().rotate_left(16);
        let candidates = self.selection.candidates(&receiver, u_choice, more);
        candidates.into_iter().filter_map(move |Choice { light, prim, rate }| {
            let sample = self.lights[light].sample_part(&self.geometry, &receiver, prim, u)?;
            let sample = not_itself(hit.surface, sample)?;
            Some(ChosenLight { sample, pdf: sample.pdf * rate })
        })
    }

    /// A direction towards one light, by its index.
    #[must_use]
    pub fn sample_one_light(&self, index: usize, hit: &Interaction, u: Vec2) -> Option<LightSample> {
        let sample = self.lights[index].sample(&self.geometry, &hit.receiver(), u)?;
        not_itself(hit.surface, sample)
    }

    /// Pdf per solid angle, rate included, with which [`Scene::sample_lights`]
    /// for the receiver would have found the emitting `surface` in direction `wi`.
    #[must_use]
    pub fn light_pdf(
        &self,
        receiver: &Receiver,
        surface: &SurfacePoint,
        wi: Vec3,
        distance_squared: f32,
    ) -> f32 {
        let Some(mut index) = self.light_of_shape(surface.shape) else { return 0.0 };
        if index as usize >= self.lights.len() {
            let shape = index as usize - self.lights.len();
            let Some(lamp) = self.lamps.light(&self.geometry, shape, surface) else { return 0.0 };
            index = lamp;
        }
        let Some(Light::Area(area)) = self.lights.get(index as usize) else { return 0.0 };
        let rate = self.selection.rate(receiver, index as usize, surface.prim);
        if rate == 0.0 {
            return 0.0;
        }
        let part = self.selection.is_fine();
        rate * area.pdf(&self.geometry, receiver, (surface, part), wi, distance_squared)
    }

    /// The same for the environment, which every receiver sees alike.
    #[must_use]
    pub fn environment_pdf(&self, wi: Vec3) -> f32 {
        self.environment.map_or(0.0, |i| {
            self.selection.rate_infinite(i as usize) * self.lights[i as usize].pdf_environment(wi)
        })
    }

    /// [`Scene::environment`] and [`Scene::environment_pdf`] at once.
    #[must_use]
    pub fn environment_and_pdf(&self, wi: Vec3) -> (Rgb, f32) {
        let Some(i) = self.environment else { return (Rgb::ZERO, 0.0) };
        let (le, pdf) = self.lights[i as usize].environment_and_pdf(wi);
        (le, self.selection.rate_infinite(i as usize) * pdf)
    }

    /// How many pixels a surface point moves to the right and down from the
    /// opening of the shutter to its end; zero when it is behind the camera.
    #[must_use]
    pub fn screen_motion(&self, surface: &SurfacePoint) -> Vec2 {
        let size = DVec2::new(f64::from(self.film.size[0]), f64::from(self.film.size[1]));
        let seen = |time: f32| {
            let p = self.geometry.moved(surface, time).as_dvec3();
            let p = self.camera_motion.as_ref().map_or(p, |m| m.to_opening(p, time));
            self.camera.film_of(p, size)
        };
        match (seen(0.0), seen(1.0)) {
            (Some(a), Some(b)) if (b - a).is_finite() => (b - a).as_vec2(),
            _ => Vec2::ZERO,
        }
    }

    /// The size of what each light gives, in a scene of this radius: see
    /// [`Light::magnitude`].
    pub fn magnitudes(&self, radius: f64) -> impl Iterator<Item = f64> + '_ {
        let glows = self.lamps.emissions().map(AreaEmission::magnitude);
        self.lights.iter().map(move |l| l.magnitude(radius)).chain(glows)
    }

    /// What each light makes of a white surface as far away as the scene is
    /// large: of a small one far less than its own radiance.
    pub fn dimmest(&self, radius: f64) -> impl Iterator<Item = f64> + '_ {
        let far = 4.0 * std::f64::consts::PI.powi(2) * radius * radius;
        self.lights.iter().map(move |l| l.power(radius) / far)
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

/// A flat light does not see itself. From a point on it, rounding alone decides
/// on which side the point lies, and so whether the light fills half the sky or
/// nothing.
fn not_itself(from: &SurfacePoint, sample: LightSample) -> Option<LightSample> {
    let own = matches!(
        &sample.target,
        Target::Surface(t) if from.planar && t.prim == from.prim && t.instance == from.instance
    );
    (!own).then_some(sample)
}
