//! Local scattering: how a surface point scatters light, in its shading frame.
//!
//! A bsdf is plain data, made per hit by `material` from textures; it knows
//! neither texture nor scene. `wo` points to where the path came from, `wi` to
//! where it goes on, both unit, away from the surface, z along the shading
//! normal. `eval` is f·|cos θi|, `pdf` is per solid angle, `sample` returns
//! f·|cos θi| over pdf. Transmission carries radiance, so it is scaled by
//! (η_i/η_t)² (Veach 1997, equation 5.2).
//!
//! The means agree with Mitsuba 3.9 (rgb); `wi` there is `wo` here. What
//! differs on purpose: no floor under the roughness, matched indices (η = 1)
//! are allowed everywhere, and plastics never return more than they receive
//! (see [`Coat`]).

mod coat;
mod conductor;
mod dielectric;
mod diffuse;
mod energy;
mod energy_coat;
mod energy_glass;
mod examples;
mod examples_gltf;
mod examples_measured;
mod examples_principled;
mod film;
pub mod fresnel;
mod layered;
mod measured;
mod metal_rough;
pub mod microfacet;
mod null;
mod plastic;
mod principled;
mod quadrature;
mod rough_conductor;
mod rough_dielectric;
mod rough_plastic;
mod sheen;
mod slopes;
mod thin_dielectric;

pub use coat::Coat;
pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use energy_glass::GlassTable;
pub use film::Film;
pub use layered::{Layered, Layers};
pub use measured::Measured;
pub use metal_rough::{MetalRough, Substance};
pub use microfacet::{Distribution, Microfacet};
pub use null::Null;
pub use plastic::Plastic;
pub use principled::{Principled, PrincipledBase, PrincipledThin};
pub use rough_conductor::RoughConductor;
pub use rough_dielectric::RoughDielectric;
pub use rough_plastic::{RoughPlastic, RoughPlasticTable};
pub use thin_dielectric::ThinDielectric;

use crate::desc::kinds;
use crate::math::{Rgb, Vec2, Vec3};

kinds! {
    /// What scatters light at a surface point, in the local shading frame.
    #[derive(Clone, Copy, Debug)]
    pub enum Bsdf<'a> {
        /// Lambert's law.
        Diffuse(Diffuse) = ["diffuse"],
        /// Smooth interface of two dielectrics.
        Dielectric(Dielectric) = ["dielectric"],
        /// Smooth pane of a dielectric, both sides at once.
        ThinDielectric(ThinDielectric) = ["thindielectric"],
        /// Rough interface of two dielectrics.
        RoughDielectric(RoughDielectric) = ["roughdielectric"],
        /// Smooth metal.
        Conductor(Conductor) = ["conductor"],
        /// Rough metal.
        RoughConductor(RoughConductor) = ["roughconductor"],
        /// Smooth dielectric coat on a diffuse base.
        Plastic(Plastic) = ["plastic"],
        /// Rough dielectric coat on a diffuse base.
        RoughPlastic(RoughPlastic<'a>) = ["roughplastic"],
        /// The core of a glTF surface. Large, so it lies elsewhere.
        MetalRough(&'a MetalRough) = ["gltf"],
        /// A glTF surface with layers.
        Layered(&'a Layered<'a>) = ["gltf"],
        /// Mitsuba's principled surface.
        Principled(&'a Principled) = ["principled"],
        /// Mitsuba's principled sheet.
        PrincipledThin(&'a PrincipledThin) = ["principledthin"],
        /// Tables of a measured material.
        Measured(&'a Measured) = ["measured"],
        /// Nothing at all: light passes.
        Null(Null) = ["null"],
    }
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where to go on; unit, local frame.
    pub wi: Vec3,
    /// f·|cos θi| / pdf.
    pub weight: Rgb,
    /// Density per solid angle, as [`Bsdf::pdf`] gives it; for a delta lobe
    /// the probability of choosing it.
    pub pdf: f32,
    /// True for a delta lobe: `eval` and `pdf` do not contain it.
    pub delta: bool,
    /// True when the path goes straight on as if nothing were there.
    pub null: bool,
    /// η of the side of `wi` over that of `wo`: 1 but for refraction. The
    /// weight has been divided by its square.
    pub eta: f32,
}

impl BsdfSample {
    /// A sample of a delta lobe chosen with the given probability.
    fn delta(wi: Vec3, weight: Rgb, probability: f32) -> Option<BsdfSample> {
        BsdfSample { wi, weight, pdf: probability, delta: true, null: false, eta: 1.0 }.checked()
    }

    /// A sample of a lobe with a density.
    fn smooth(wi: Vec3, weight: Rgb, pdf: f32) -> Option<BsdfSample> {
        BsdfSample { wi, weight, pdf, delta: false, null: false, eta: 1.0 }.checked()
    }

    /// `None` for samples that carry nothing. A density that is not finite
    /// makes the weight not a number: the path is to be found and counted.
    fn checked(mut self) -> Option<BsdfSample> {
        if !self.pdf.is_finite() {
            (self.weight, self.pdf) = (Rgb::NAN, 1.0);
        }
        (self.pdf > 0.0 && self.weight != Rgb::ZERO).then_some(self)
    }
}

/// One arm per kind.
macro_rules! each {
    ($bsdf:expr, $kind:ident => $body:expr) => {
        match $bsdf {
            Bsdf::Diffuse($kind) => $body,
            Bsdf::Dielectric($kind) => $body,
            Bsdf::ThinDielectric($kind) => $body,
            Bsdf::RoughDielectric($kind) => $body,
            Bsdf::Conductor($kind) => $body,
            Bsdf::RoughConductor($kind) => $body,
            Bsdf::Plastic($kind) => $body,
            Bsdf::RoughPlastic($kind) => $body,
            Bsdf::MetalRough($kind) => $body,
            Bsdf::Layered($kind) => $body,
            Bsdf::Principled($kind) => $body,
            Bsdf::PrincipledThin($kind) => $body,
            Bsdf::Measured($kind) => $body,
            Bsdf::Null($kind) => $body,
        }
    };
}

impl Bsdf<'_> {
    /// f·|cos θi| without delta lobes, linear RGB.
    #[must_use]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval_pdf(wo, wi).0
    }

    /// Density per solid angle with which [`Bsdf::sample`] draws `wi` from its
    /// lobes with a density; includes the choice of the lobe. Integrates to 1
    /// less the probabilities of delta lobes and of `None`.
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_pdf(wo, wi).1
    }

    /// [`Bsdf::eval`] and [`Bsdf::pdf`] at once.
    #[must_use]
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        each!(self, kind => kind.eval_pdf(wo, wi))
    }

    /// Draws a direction; `u_lobe` and `u` uniform in [0, 1). `None` when
    /// nothing is scattered there: the path ends.
    #[must_use]
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        each!(self, kind => kind.sample(wo, u_lobe, u))
    }

    /// True when `eval` is zero everywhere: light samples are useless.
    #[must_use]
    #[inline]
    pub fn is_delta_only(&self) -> bool {
        match self {
            Bsdf::Diffuse(_)
            | Bsdf::Plastic(_)
            | Bsdf::RoughPlastic(_)
            | Bsdf::Principled(_)
            | Bsdf::PrincipledThin(_)
            | Bsdf::Measured(_) => false,
            Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Conductor(_) | Bsdf::Null(_) => true,
            Bsdf::RoughConductor(kind) => kind.distribution.is_delta(),
            Bsdf::RoughDielectric(kind) => kind.is_delta_only(),
            Bsdf::MetalRough(kind) => kind.is_delta_only(),
            Bsdf::Layered(kind) => kind.is_delta_only(),
        }
    }

    /// True when [`Bsdf::sample`] reads its `u_lobe`.
    #[must_use]
    #[inline]
    pub fn chooses(&self) -> bool {
        match self {
            Bsdf::Dielectric(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::RoughDielectric(_)
            | Bsdf::Plastic(_)
            | Bsdf::RoughPlastic(_)
            | Bsdf::MetalRough(_)
            | Bsdf::Layered(_)
            | Bsdf::Principled(_)
            | Bsdf::PrincipledThin(_) => true,
            Bsdf::Diffuse(_)
            | Bsdf::Conductor(_)
            | Bsdf::RoughConductor(_)
            | Bsdf::Measured(_)
            | Bsdf::Null(_) => false,
        }
    }

    /// True when [`Bsdf::sample`] reads its `u`.
    #[must_use]
    #[inline]
    pub fn spreads(&self) -> bool {
        !matches!(self, Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Conductor(_) | Bsdf::Null(_))
    }

    /// True when only the side of the shading normal scatters; the other is
    /// black.
    #[must_use]
    pub fn is_one_sided(&self) -> bool {
        match self {
            Bsdf::Diffuse(_)
            | Bsdf::Conductor(_)
            | Bsdf::RoughConductor(_)
            | Bsdf::Plastic(_)
            | Bsdf::RoughPlastic(_)
            | Bsdf::Measured(_) => true,
            Bsdf::MetalRough(kind) => kind.is_one_sided(),
            Bsdf::Layered(kind) => kind.is_one_sided(),
            Bsdf::Principled(kind) => !kind.transmits(),
            Bsdf::Dielectric(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::RoughDielectric(_)
            | Bsdf::PrincipledThin(_)
            | Bsdf::Null(_) => false,
        }
    }

    /// True when its lobes with a density send light from each direction of a side to each other
    /// one of it, and none through.
    #[must_use]
    pub fn reflects_everywhere(&self) -> bool {
        match self {
            Bsdf::Diffuse(_) | Bsdf::Conductor(_) | Bsdf::Plastic(_) | Bsdf::MetalRough(_) => true,
            Bsdf::RoughConductor(kind) => kind.distribution.has_long_tails(),
            Bsdf::RoughPlastic(kind) => kind.diffuse_reflectance.min_element() > 0.0,
            Bsdf::Layered(kind) => !kind.transmits(),
            Bsdf::Principled(kind) => !kind.transmits(),
            // Of the tables of a measured one nobody knows.
            Bsdf::Dielectric(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::RoughDielectric(_)
            | Bsdf::PrincipledThin(_)
            | Bsdf::Measured(_)
            | Bsdf::Null(_) => false,
        }
    }

    /// Fraction of light that is scattered, all directions together and
    /// without radiance scaling: an estimate for the albedo layer, exact for
    /// smooth kinds.
    #[must_use]
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        each!(self, kind => kind.albedo(wo))
    }

    /// Typical and extreme bsdfs of every kind, by name.
    #[must_use]
    pub fn examples() -> Vec<(String, Bsdf<'static>)> {
        examples::examples()
    }
}

/// Mean of the channels: what lobes are chosen by.
fn mean(rgb: Rgb) -> f32 {
    rgb.element_sum() / 3.0
}
