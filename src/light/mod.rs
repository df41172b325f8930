//! What emits light, and how to choose a direction towards it.
//!
//! Semantics are those of Mitsuba 3.9. A light answers two questions: which
//! way to send a shadow ray from a point ([`Light::sample`]), and, for what is
//! hit or escapes, what arrives from there and with which density `sample`
//! would have chosen it. Both sides of each pair share their arithmetic, so
//! that multiple importance sampling stays unbiased.
//!
//! All take `sampling_weight` (default 1): a factor on how often the light is
//! chosen, which changes the noise and never the mean.

mod area;
mod beam;
mod constant;
mod directional;
mod envmap;
mod envmap_table;
mod examples;
mod extent;
mod moving;
mod parse;
mod point;
mod projector;
mod receiver;
mod sky;
mod sky_model;
mod sky_parse;
mod sky_position;
mod spot;
mod tree;
mod tree_build;

pub use area::{AreaEmission, AreaLight};
pub use beam::Beam;
pub use constant::Constant;
pub use directional::Directional;
pub use envmap::EnvMap;
pub use extent::{Emitter, Extent};
pub use moving::Moving;
pub use parse::{area_emission_from_desc, emitter_from_desc};
pub use point::Point;
pub use projector::Projector;
pub use receiver::Receiver;
pub use sky::SunSky;
pub use sky_position::{DATE_PARTS, Observer, SunPosition};
pub use spot::Spot;
pub use tree::{LightTree, TreeSample, TreeWalk};

use crate::desc::kinds;
use crate::math::{Rgb, Vec2, Vec3};
use crate::shape::{Geometry, Hit, PrimId, ShapeSample};

kinds! {
    /// A light.
    #[derive(Clone, Debug)]
    pub enum Light {
        /// A shape that glows.
        Area(AreaLight) = ["area"],
        /// A point, the same in all directions.
        Point(Point) = ["point"],
        /// A point with a cone.
        Spot(Spot) = ["spot"],
        /// A point that projects a picture.
        Projector(Projector) = ["projector"],
        /// A flat shape that shines along its normal.
        Beam(Beam) = ["directionalarea"],
        /// Parallel light from infinity.
        Directional(Directional) = ["directional"],
        /// A surrounding of one colour.
        Constant(Constant) = ["constant"],
        /// A surrounding with a picture.
        EnvMap(EnvMap) = ["envmap"],
        /// The sun and a clear sky.
        SunSky(SunSky) = ["sunsky"];
        /// A `point`, `spot` or `directional` that moves.
        Moving(Moving),
    }
}

/// Angle across the disc of the sun, in degrees, as Mitsuba has it.
pub const SUN_APERTURE_DEG: f64 = 0.5358;
/// The least diameter of a sun in degrees: below, f32 directions are too coarse
/// to tell its disc.
pub const LEAST_APERTURE_DEG: f64 = 1e-3;

/// A direction towards a light. What it adds to the reflected radiance is
/// f·|cos θ| · `radiance` / `pdf`, if nothing is in the way.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the reference point towards the light.
    pub wi: Vec3,
    /// Radiance that arrives from there; for a delta light the irradiance on a
    /// plane facing it (intensity over squared distance). Not zero in all
    /// channels.
    pub radiance: Rgb,
    /// Density of `wi` per solid angle, positive and finite; 1 for a delta
    /// light.
    pub pdf: f32,
    /// True if no other strategy can find this direction: MIS weight 1.
    pub delta: bool,
    /// What the shadow ray must reach.
    pub target: Target,
}

/// The end of a shadow ray.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// A point of an emitting surface.
    Surface(ShapeSample),
    /// A point in space.
    Point(Vec3),
    /// Everything along the ray must be free.
    Infinite,
}

impl Light {
    /// A direction from the receiver towards the light, chosen by `u` in
    /// \[0, 1)²; `None` where the light sends nothing to it. What is
    /// infinitely bright or not a number is passed on: the film counts it.
    #[must_use]
    pub fn sample(&self, geometry: &Geometry, receiver: &Receiver, u: Vec2) -> Option<LightSample> {
        self.sample_part(geometry, receiver, None, u)
    }

    /// The same of one primitive of an area light only, if one is given.
    #[must_use]
    pub fn sample_part(
        &self,
        geometry: &Geometry,
        receiver: &Receiver,
        prim: Option<PrimId>,
        u: Vec2,
    ) -> Option<LightSample> {
        let sample = match self {
            Light::Area(l) => l.sample(geometry, receiver, prim, u),
            Light::Point(l) => l.sample(receiver.p),
            Light::Spot(l) => l.sample(receiver.p),
            Light::Projector(l) => l.sample(receiver.p),
            Light::Beam(l) => l.sample(geometry, receiver.p),
            Light::Directional(l) => l.sample(),
            Light::Constant(l) => l.sample(u),
            Light::EnvMap(l) => l.sample(u),
            Light::SunSky(l) => l.sample(u),
            Light::Moving(l) => l.sample(receiver),
        }?;
        // An infinite density is light of which nothing arrives. What is not a
        // number or infinitely bright goes on to the film, which counts it.
        let nothing = sample.pdf <= 0.0
            || sample.pdf == f32::INFINITY
            || sample.radiance.is_finite() && sample.radiance.max_element() <= 0.0;
        (!nothing).then_some(sample)
    }

    /// Radiance that arrives from the unit direction `wi` where nothing is
    /// hit: zero for what is no environment.
    #[must_use]
    pub fn environment(&self, wi: Vec3) -> Rgb {
        match self {
            Light::Constant(l) => l.radiance,
            Light::EnvMap(l) => l.radiance(wi),
            Light::SunSky(l) => l.radiance(wi),
            _ => Rgb::ZERO,
        }
    }

    /// Density per solid angle with which [`Light::sample`] of an environment
    /// chooses the unit direction `wi`: zero for what is no environment.
    #[must_use]
    pub fn pdf_environment(&self, wi: Vec3) -> f32 {
        match self {
            Light::Constant(l) => l.pdf(),
            Light::EnvMap(l) => l.pdf(wi),
            Light::SunSky(l) => l.pdf(wi),
            _ => 0.0,
        }
    }

    /// [`Light::environment`] and [`Light::pdf_environment`] at once.
    #[must_use]
    pub fn environment_and_pdf(&self, wi: Vec3) -> (Rgb, f32) {
        match self {
            Light::EnvMap(l) => l.radiance_and_pdf(wi),
            other => (other.environment(wi), other.pdf_environment(wi)),
        }
    }

    /// True for lights that rays which hit nothing see.
    #[must_use]
    pub fn is_environment(&self) -> bool {
        matches!(self, Light::Constant(_) | Light::EnvMap(_) | Light::SunSky(_))
    }

    /// True for lights that shine everywhere alike, from infinitely far away.
    #[must_use]
    pub fn is_infinite(&self) -> bool {
        match self {
            Light::Directional(_) => true,
            Light::Moving(l) => l.is_infinite(),
            _ => self.is_environment(),
        }
    }

    /// True for lights without a surface that move while the shutter is open.
    #[must_use]
    pub fn moves(&self) -> bool {
        matches!(self, Light::Moving(_))
    }

    /// True for lights that only [`Light::sample`] can find.
    #[must_use]
    pub fn is_delta(&self) -> bool {
        matches!(
            self,
            Light::Point(_)
                | Light::Spot(_)
                | Light::Projector(_)
                | Light::Beam(_)
                | Light::Directional(_)
                | Light::Moving(_)
        )
    }

    /// Emitted power, as the mean of the RGB channels: for infinite lights
    /// what enters a sphere of `scene_radius`. Textured lights count their mean.
    /// Zero means that the light is black and can be left out.
    #[must_use]
    pub fn power(&self, scene_radius: f64) -> f64 {
        let disk = std::f64::consts::PI * scene_radius * scene_radius;
        match self {
            Light::Area(l) => l.power(),
            Light::Point(l) => l.power(),
            Light::Spot(l) => l.power(),
            Light::Projector(l) => l.power(),
            Light::Beam(l) => l.power(),
            Light::Directional(l) => l.normal_irradiance() * disk,
            Light::Constant(l) => l.radiance_integral() * disk,
            Light::EnvMap(l) => l.radiance_integral() * disk,
            Light::SunSky(l) => l.radiance_integral() * disk,
            Light::Moving(l) if l.is_infinite() => l.power() * disk,
            Light::Moving(l) => l.power(),
        }
    }

    /// `sampling_weight`: finite, not negative.
    #[must_use]
    pub fn weight(&self) -> f32 {
        match self {
            Light::Area(l) => l.emission.weight,
            Light::Point(l) => l.weight,
            Light::Spot(l) => l.weight,
            Light::Projector(l) => l.weight,
            Light::Beam(l) => l.emission.weight,
            Light::Directional(l) => l.weight,
            Light::Constant(l) => l.weight,
            Light::EnvMap(l) => l.weight,
            Light::SunSky(l) => l.weight,
            Light::Moving(l) => l.weight(),
        }
    }

    /// Bytes of tables and images behind the light; none for instances of lamps.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        match self {
            Light::Area(l) if l.instance != Hit::NO_INSTANCE => 0, // counted once
            Light::Area(l) => l.memory_bytes(),
            Light::Spot(l) => l.memory_bytes(),
            Light::Projector(l) => l.memory_bytes(),
            Light::Beam(l) => l.emission.radiance.memory_bytes(),
            Light::EnvMap(l) => l.memory_bytes(),
            Light::SunSky(l) => l.memory_bytes(),
            Light::Moving(l) => l.memory_bytes(),
            Light::Point(_) | Light::Directional(_) | Light::Constant(_) => 0,
        }
    }
}

/// The mean of the channels: the measure of power and of sampling densities.
/// Unlike luminance it does not starve the blue of samples.
fn grey(c: Rgb) -> f64 {
    (f64::from(c.x) + f64::from(c.y) + f64::from(c.z)) / 3.0
}

/// The unit vector and distance from `from` to `to`, in f64 so that neither
/// scale nor distance over- or underflows; `None` when they coincide.
fn direction(from: Vec3, to: Vec3) -> Option<(Vec3, f64)> {
    let d = to.as_dvec3() - from.as_dvec3();
    let distance = d.length();
    (distance > 0.0 && distance.is_finite()).then(|| ((d / distance).as_vec3(), distance))
}

/// `c` · `factor` / `distance`², rounded once.
fn fall_off(c: Rgb, factor: f64, distance: f64) -> Rgb {
    (c.as_dvec3() * (factor / distance / distance)).as_vec3()
}

impl Light {
    /// Its scene-file name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Light::Area(_) => "area",
            Light::Point(_) => "point",
            Light::Spot(_) => "spot",
            Light::Projector(_) => "projector",
            Light::Beam(_) => "directionalarea",
            Light::Directional(_) => "directional",
            Light::Constant(_) => "constant",
            Light::EnvMap(_) => "envmap",
            Light::SunSky(_) => "sunsky",
            Light::Moving(l) => l.name(),
        }
    }

    /// Mean radiance over all directions, grey: zero for what is no
    /// environment.
    #[must_use]
    pub fn mean_radiance(&self) -> Rgb {
        let integral = match self {
            Light::Constant(l) => return l.radiance,
            Light::EnvMap(l) => l.radiance_integral(),
            Light::SunSky(l) => l.radiance_integral(),
            _ => 0.0,
        };
        Rgb::splat((integral / (4.0 * std::f64::consts::PI)) as f32)
    }

    /// The order of magnitude of the radiance it causes in a scene of that
    /// radius: what it emits, or what it gives a white surface at that distance.
    #[must_use]
    pub fn magnitude(&self, scene_radius: f64) -> f64 {
        let whole = 4.0 * std::f64::consts::PI;
        match self {
            Light::Area(l) => grey(l.emission.radiance.mean()),
            Light::Beam(l) => grey(l.emission.radiance.mean()),
            Light::Directional(l) => l.normal_irradiance(),
            Light::Constant(l) => l.radiance_integral() / whole,
            Light::EnvMap(l) => l.radiance_integral() / whole,
            Light::SunSky(l) => l.radiance_integral() / whole,
            Light::Moving(l) if l.is_infinite() => l.power(),
            Light::Point(_) | Light::Spot(_) | Light::Projector(_) | Light::Moving(_) => {
                self.power(scene_radius) / (whole * scene_radius * scene_radius)
            }
        }
    }
}
