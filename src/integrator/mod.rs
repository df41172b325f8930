//! Integrators: light arriving along a camera ray.
//!
//! Each gives an estimate of the radiance for one (pixel, sample) pair, and is
//! a pure function of it: all random numbers come from the [`Sampler`].

mod ambient;
mod build;
mod connect;
mod direct;
mod path;
mod record;
mod reuse;
mod whitted;

pub use ambient::{AmbientOcclusion, Depth};
pub use build::{AUTO_REUSE, IntegratorOptions, MOST_REUSE, NAMES, reuse_named};
pub use direct::Direct;
pub use path::Path;
pub use record::{Counters, Event, NoRecord, Record, Vertex};
pub use reuse::{Lender, Links, exchange};
pub use whitted::Whitted;

use crate::color::Hue;
use crate::desc::{Error, Result};
use crate::film::{PixelSample, Scale};
use crate::light::LightSample;
use crate::material::Scatter;
use crate::math::{Ray, Rgb, Vec2};
use crate::sampling::Sampler;
use crate::scene::{Carried, Interaction, Scene};
use crate::shape::{Hit, SurfacePoint};

/// How radiance is estimated.
#[derive(Clone, Debug)]
pub enum Integrator {
    /// Path tracing.
    Path(Path),
    /// Direct light only.
    Direct(Direct),
    /// Whitted's ray tracing.
    Whitted(Whitted),
    /// Ambient occlusion.
    AmbientOcclusion(AmbientOcclusion),
    /// Distance to the first hit.
    Depth(Depth),
}

impl Integrator {
    /// Its scene-file name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Integrator::Path(Path { see_through: true, .. }) => "volpath",
            Integrator::Path(_) => "path",
            Integrator::Direct(_) => "direct",
            Integrator::Whitted(_) => "whitted",
            Integrator::AmbientOcclusion(_) => "ao",
            Integrator::Depth(_) => "depth",
        }
    }

    /// True when light arrives by light samples alone: what is not sampled is
    /// not seen on diffuse surfaces.
    #[must_use]
    pub fn samples_lights_alone(&self) -> bool {
        match self {
            Integrator::Direct(direct) => direct.bsdf_samples == 0,
            Integrator::Whitted(_) => true,
            Integrator::Path(_) | Integrator::AmbientOcclusion(_) | Integrator::Depth(_) => false,
        }
    }

    /// Pixels in a group that uses each other's paths; 1 for none, [`AUTO_REUSE`] to be decided.
    #[must_use]
    pub fn reuse(&self) -> u32 {
        match self {
            Integrator::Path(path) => path.reuse,
            _ => 1,
        }
    }

    /// Why pixels cannot use each other's paths in this scene.
    #[must_use]
    pub fn reuse_obstacle(&self, scene: &Scene) -> Option<&'static str> {
        let Integrator::Path(path) = self else { return Some("no path is traced") };
        if scene.plan.motion {
            // They are at different times.
            return Some("something moves while the shutter is open");
        }
        if scene.plan.dispersion {
            // They have different wavelengths.
            return Some("a material refracts colours apart");
        }
        // What is seen through stands in the densities of scattered rays.
        (path.see_through && (scene.plan.alpha || scene.has_media()))
            .then_some("`volpath` sees through surfaces or media")
    }

    /// # Errors
    /// Pixels are to use each other's paths where they cannot.
    pub fn check_reuse(&self, scene: &Scene) -> Result<()> {
        match self.reuse_obstacle(scene) {
            Some(what) if self.reuse() > 1 => {
                let message = format!("paths cannot be used by several pixels where {what}");
                Err(Error::new(message).hint("leave out `reuse`"))
            }
            _ => Ok(()),
        }
    }

    /// What is left out of the rendering equation, for the file header.
    #[must_use]
    pub fn bias_ledger(&self, scene: &Scene) -> String {
        let mut parts = match self {
            Integrator::Path(p) => {
                let cut = (p.max_depth < u32::MAX)
                    .then(|| format!("paths longer than depth {} are cut", p.max_depth));
                cut.into_iter().chain(self.leaves_out(scene).map(str::to_owned)).collect()
            }
            Integrator::Direct(_) => vec!["direct light only".to_owned()],
            Integrator::Whitted(_) => vec!["ray tracing without indirect light".to_owned()],
            Integrator::AmbientOcclusion(_) | Integrator::Depth(_) => {
                return "no light transport".to_owned();
            }
        };
        if scene.plan.pyramid_bytes > 0 {
            parts.push("textures are averaged over what a sample stands for".to_owned());
        }
        if parts.is_empty() { "none".to_owned() } else { parts.join("; ") }
    }

    /// What it leaves out of this scene though it shows light, in words.
    #[must_use]
    pub fn leaves_out(&self, scene: &Scene) -> Option<&'static str> {
        let (media, dispersion) = match self {
            Integrator::Path(path) => (!path.see_through, false),
            Integrator::Direct(_) => (true, true),
            Integrator::Whitted(_) => (false, true),
            Integrator::AmbientOcclusion(_) | Integrator::Depth(_) => (false, false),
        };
        match (media && scene.has_media(), dispersion && scene.plan.dispersion) {
            (true, true) => Some("media and dispersion are left out"),
            (true, false) => Some("media are left out"),
            (false, true) => Some("dispersion is left out"),
            (false, false) => None,
        }
    }

    /// The sizes of what it measures, powers of two: from them comes the unit
    /// of the film's exact sums. They follow the scene, so that brighter lights
    /// or a larger scene shift no bit of the picture.
    #[must_use]
    pub fn radiance_scale(&self, scene: &Scene) -> Scale {
        let radius = f64::from(scene.bounds().bounding_sphere().1);
        let usable = |size: &f64| *size > 0.0 && size.is_finite();
        let [largest, smallest] = match self {
            Integrator::AmbientOcclusion(_) => [1.0; 2],
            Integrator::Depth(_) => [radius; 2],
            _ => [
                scene.magnitudes(radius).fold(0.0, f64::max),
                scene
                    .magnitudes(radius)
                    .chain(scene.dimmest(radius))
                    .filter(usable)
                    .fold(f64::INFINITY, f64::min)
                    * scene.least_transmittance(2.0 * radius),
            ],
        };
        let power = |size: f64| if usable(&size) { size.log2().ceil().exp2() } else { 1.0 };
        Scale {
            largest: power(largest),
            smallest: if usable(&smallest) { power(smallest) } else { power(largest) },
        }
    }

    /// Estimates what one sample of one pixel sees. `record` is told of every
    /// vertex; pass [`NoRecord`] to render.
    pub fn sample<'s, R: Record<'s>>(
        &self,
        scene: &'s Scene,
        camera: &CameraSample,
        record: &mut R,
    ) -> PixelSample {
        if camera.ray.t_max <= 0.0 {
            return PixelSample::default();
        }
        match self {
            Integrator::Path(i) => i.sample(scene, camera, record),
            Integrator::Direct(i) => i.sample(scene, camera, record),
            Integrator::Whitted(i) => i.sample(scene, camera, record),
            Integrator::AmbientOcclusion(i) => i.sample(scene, camera, record),
            Integrator::Depth(i) => i.sample(scene, camera, record),
        }
    }
}

/// A camera ray and the random numbers of its sample.
#[derive(Clone, Copy, Debug)]
pub struct CameraSample {
    /// The ray into the scene.
    pub ray: Ray,
    /// Random numbers by dimension.
    pub sampler: Sampler,
    /// The (u, v) of the first light sample: part of the 4D set of the pixel position.
    pub first_light: Vec2,
    /// Somebody wants the layers that the first hit decides.
    pub layers: bool,
}

/// Random dimensions: labels of the sets that [`Sampler`] draws from.
mod dimension {
    /// Position on the lens.
    pub const LENS: u32 = 1;
    /// Time of the shutter.
    pub const TIME: u32 = 2;
    /// Wavelength of the path, if it needs one.
    pub const WAVELENGTH: u32 = 3;
    /// First of a vertex's dimensions.
    const VERTEX: u32 = 8;
    const PER_VERTEX: u32 = 8;
    /// Which light.
    pub const LIGHT_CHOICE: u32 = 0;
    /// Where on the light.
    pub const LIGHT: u32 = 1;
    /// Which lobe.
    pub const LOBE: u32 = 2;
    /// Which direction.
    pub const DIRECTION: u32 = 3;
    /// Russian roulette.
    pub const ROULETTE: u32 = 4;

    /// The label of a purpose at the vertex after `bounce` scatterings.
    pub fn at(bounce: u32, purpose: u32) -> u32 {
        VERTEX.wrapping_add(bounce.wrapping_mul(PER_VERTEX)).wrapping_add(purpose)
    }
}

impl CameraSample {
    /// The camera ray of a sample of `pixel` whose random numbers are
    /// `sampler`'s, and its place in the pixel, [0,1)².
    #[must_use]
    pub fn new(scene: &Scene, pixel: (i32, i32), sampler: Sampler) -> (CameraSample, Vec2) {
        let (offset, first_light) = sampler.pixel_and_light();
        let lens = if scene.plan.lens { sampler.get_2d(dimension::LENS) } else { Vec2::splat(0.5) };
        let time = if scene.plan.motion { sampler.get_1d(dimension::TIME) } else { 0.0 };
        let film = Vec2::new(pixel.0 as f32 + offset.x, pixel.1 as f32 + offset.y);
        let ray = scene.camera_ray(film, lens, time);
        (CameraSample { ray, sampler, first_light, layers: false }, offset)
    }

    /// Width of what the sample covers of a surface, where textures look at that.
    #[inline]
    fn footprint(&self, scene: &Scene, surface: &SurfacePoint) -> f32 {
        if scene.plan.pyramid_bytes == 0 {
            return 0.0;
        }
        scene.footprint(self.sampler.index(), surface.p.distance(self.ray.origin))
    }

    /// What a path without wavelength brings to a surface through empty space.
    fn carried(&self, scene: &Scene, surface: &SurfacePoint) -> Carried {
        Carried { footprint: self.footprint(scene, surface), ..Carried::NOTHING }
    }

    /// Which light, and where on it, at the vertex after `bounce` scatterings.
    fn light(&self, scene: &Scene, bounce: u32) -> (f32, Vec2) {
        let choice = if scene.selection.is_trivial() {
            0.0
        } else {
            self.sampler.get_1d(dimension::at(bounce, dimension::LIGHT_CHOICE))
        };
        let u = if bounce == 0 {
            self.first_light
        } else {
            self.sampler.get_2d(dimension::at(bounce, dimension::LIGHT))
        };
        (choice, u)
    }

    /// The wavelength of the path.
    fn hue(&self) -> Hue {
        Hue::sample(self.sampler.get_1d(dimension::WAVELENGTH))
    }

    /// Which lobe and which direction, as far as the bsdf asks for them.
    fn scatter(&self, scatter: &Scatter, bounce: u32) -> (f32, Vec2) {
        let lobe =
            if scatter.chooses() { self.sampler.get_1d(dimension::at(bounce, dimension::LOBE)) } else { 0.0 };
        let direction = if scatter.spreads() {
            self.sampler.get_2d(dimension::at(bounce, dimension::DIRECTION))
        } else {
            Vec2::ZERO
        };
        (lobe, direction)
    }

    /// Russian roulette.
    fn roulette(&self, bounce: u32) -> f32 {
        self.sampler.get_1d(dimension::at(bounce, dimension::ROULETTE))
    }
}

/// What of a light sample's radiance arrives at a hit, per channel in [0, 1].
/// With `see_through`, surfaces that let light straight on do not end it, and
/// media count.
#[inline(always)]
fn arriving(scene: &Scene, hit: &Interaction, light: &LightSample, see_through: bool) -> Rgb {
    let ray = shadow_ray(hit.surface, light);
    if see_through && (scene.plan.alpha || scene.has_media()) {
        let medium = scene.medium_towards(hit.carried.medium, hit.surface, light.wi);
        return scene.passed(ray, hit.surface.p, medium);
    }
    if scene.occluded(&ray) { Rgb::ZERO } else { Rgb::ONE }
}

/// The shadow ray from a surface point to a light sample.
#[must_use]
pub fn shadow_ray(surface: &SurfacePoint, light: &LightSample) -> Ray {
    use crate::light::Target;
    match &light.target {
        Target::Surface(target) => surface.spawn_to(target),
        Target::Point(p) => surface.spawn_to_point(*p),
        Target::Infinite => surface.spawn(light.wi),
    }
}

/// Fills the layers that the first hit decides, if anybody wants them.
fn first_hit_layers(out: &mut PixelSample, scene: &Scene, camera: &CameraSample, surface: &SurfacePoint) {
    if !camera.layers {
        return;
    }
    let mut room = Scatter::default();
    let carried = camera.carried(scene, surface);
    let hit = scene.interact(surface, -camera.ray.dir, &carried, &mut room);
    out.depth = (surface.p - camera.ray.origin).length();
    out.position = (surface.p.as_dvec3() + scene.recentre).as_vec3();
    let normal = hit.scatter.normal().unwrap_or(surface.ns);
    out.normal = if normal.dot(hit.wo) < 0.0 { -normal } else { normal };
    out.albedo = hit.scatter.albedo(hit.wo);
    if scene.plan.motion {
        out.motion = scene.screen_motion(surface);
    }
}

/// The first hit of a camera ray; with `skip_lights` it goes through shapes
/// that emit, as `hide_emitters` asks, and `ray` starts behind the last of them.
fn first_hit<'s, R: Record<'s>>(
    scene: &Scene,
    ray: &mut Ray,
    skip_lights: bool,
    record: &mut R,
) -> Option<Hit> {
    loop {
        record.counters().camera_rays += 1;
        let hit = scene.closest(ray)?;
        if !(skip_lights && scene.light_of_shape(scene.geometry.shape_of(hit.prim)).is_some()) {
            return Some(hit);
        }
        let surface = scene.surface(ray, &hit);
        let far = ray.at(ray.t_max);
        let mut next = surface.spawn(ray.dir);
        if ray.t_max.is_finite() {
            next.t_max = (far - next.origin).length();
        }
        *ray = next;
    }
}
