//! Next-event estimation: which light a shadow ray is traced to.
//!
//! The candidates of a vertex are weighed against bsdf sampling each by itself
//! (multi-sample multiple importance sampling, Veach 1997, section 9.2). One of
//! them gets the shadow ray, with a probability q proportional to what it would
//! contribute, and then stands for all: its contribution is divided by q. The
//! mean does not change, and where nothing is in the way the choice adds no
//! noise at all (Talbot, Cline, Egbert 2005, "Importance Resampling for Global
//! Illumination", with the densities of the candidates in the MIS weights). What
//! is in the way is not known beforehand: candidates that the others outshine by
//! far are kept apart, see [`FAINT`].

use super::{Event, Record, arriving};
use crate::math::{Rgb, Vec2};
use crate::sampling::power_heuristic;
use crate::scene::{ChosenLight, Interaction, Scene};

/// How many samples each strategy takes at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// Of lights.
    pub light: f32,
    /// Of the bsdf; 0 when only lights are sampled.
    pub bsdf: f32,
}

/// A light sample for which a shadow ray is to be traced.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    /// Where the light is.
    pub light: ChosenLight,
    /// f·|cos θ| of the surface.
    pub f: Rgb,
    /// Weight against bsdf sampling.
    pub mis: f32,
    /// Radiance that it adds if nothing is in the way; not zero.
    pub contribution: Rgb,
}

impl Connection {
    /// What of it arrives at the camera through `beta`, by a shadow ray, which
    /// goes through surfaces that are not there if it may `see_through` them.
    #[inline(always)]
    pub fn trace<'s, R: Record<'s>>(
        self,
        scene: &Scene,
        hit: &Interaction,
        (beta, see_through): (Rgb, bool),
        record: &mut R,
    ) -> Rgb {
        let Connection { light, f, mis, contribution } = self;
        let contribution = beta * contribution;
        if contribution == Rgb::ZERO {
            return Rgb::ZERO;
        }
        record.counters().shadow_rays += 1;
        let left = arriving(scene, hit, &light.sample, see_through);
        let occluded = left == Rgb::ZERO;
        let contribution = if occluded { Rgb::ZERO } else { contribution * left };
        record.event(|| Event::Light {
            wi: light.sample.wi,
            pdf: light.pdf,
            f,
            mis,
            radiance: light.sample.radiance * left,
            delta: light.sample.delta,
            contribution,
            occluded,
        });
        contribution
    }
}

/// The light samples of a vertex for which shadow rays are to be traced: what
/// counts, and now and then what that outshines.
#[derive(Clone, Copy, Debug)]
pub struct Connections {
    /// Stands for all that contributes to speak of.
    pub main: Connection,
    /// Stands for what is left, in a part [`FAINT_RATE`] of the cases where
    /// there is anything.
    pub faint: Option<Connection>,
}

/// A candidate below this part of the others is faint: it does not compete with
/// them for the one shadow ray, but gets its own at times. If it competed, a
/// candle beside a sun behind a wall would get one ray in as many as the sun is
/// brighter; so it gets [`FAINT_RATE`] of one whatever there is. Where nothing
/// is hidden the noise of that is at most this part of the sum, times √3.
const FAINT: f64 = 1.0 / 64.0;

/// Part of the faint candidates that get a shadow ray.
const FAINT_RATE: f64 = 0.25;

/// The light samples of a vertex by the numbers `u_choice` and `u`; `None` when
/// no light can contribute.
pub fn connect(
    scene: &Scene,
    hit: &Interaction,
    u_choice: f32,
    u: Vec2,
    counts: Counts,
) -> Option<Connections> {
    if let Some(only) = scene.selection.only() {
        let sample = scene.sample_one_light(only, hit, u)?;
        let main = weigh(hit, ChosenLight { pdf: sample.pdf, sample }, counts)?;
        return Some(Connections { main, faint: None });
    }
    let mut main = Reservoir::default();
    let mut faint = Reservoir::default();
    // What the choices so far have left of a number.
    let mut rest = None;
    for light in scene.sample_lights(hit, u_choice, u) {
        let Some(connection) = weigh(hit, light, counts) else { continue };
        let weight = f64::from(connection.contribution.element_sum());
        if main.chosen.is_none() {
            main = Reservoir::of(connection, weight);
            continue;
        }
        let u = rest.get_or_insert_with(|| f64::from(scene.selection.left_over(u_choice, u)));
        if weight < FAINT * main.sum {
            faint.join(&Reservoir::of(connection, weight), u);
        } else if main.sum < FAINT * weight {
            faint.join(&main, u);
            main = Reservoir::of(connection, weight);
        } else {
            main.join(&Reservoir::of(connection, weight), u);
        }
    }
    let traced = |u: f64| (u < FAINT_RATE).then(|| faint.stands_for(1.0 / FAINT_RATE)).flatten();
    Some(Connections { main: main.stands_for(1.0)?, faint: rest.and_then(traced) })
}

/// One of several connections, chosen on the way with a probability in
/// proportion to its weight.
#[derive(Clone, Copy, Default)]
struct Reservoir {
    chosen: Option<Connection>,
    /// The chosen one's weight.
    share: f64,
    /// The weight of all.
    sum: f64,
}

impl Reservoir {
    fn of(connection: Connection, weight: f64) -> Reservoir {
        Reservoir { chosen: Some(connection), share: weight, sum: weight }
    }

    /// Takes in what another stands for, by the uniform number `u`, of which
    /// another is left.
    fn join(&mut self, other: &Reservoir, u: &mut f64) {
        let sum = self.sum + other.sum;
        let chance = other.sum / sum;
        if self.chosen.is_none() {
            *self = *other;
        } else if *u < chance {
            *self = Reservoir { sum, ..*other };
            *u /= chance;
        } else {
            self.sum = sum;
            *u = (*u - chance) / (1.0 - chance);
        }
    }

    /// The chosen one in place of all, times `factor`.
    fn stands_for(&self, factor: f64) -> Option<Connection> {
        let mut chosen = self.chosen?;
        // Of one alone nothing is divided: it may be infinite.
        let others = if self.sum == self.share { 1.0 } else { self.sum / self.share };
        let factor = (others * factor) as f32;
        chosen.contribution *= factor;
        chosen.light.sample.radiance *= factor;
        Some(chosen)
    }
}

/// What one light sample contributes.
#[inline(always)]
fn weigh(hit: &Interaction, light: ChosenLight, counts: Counts) -> Option<Connection> {
    let (f, pdf) = hit.scatter.eval_pdf(hit.wo, light.sample.wi);
    if f == Rgb::ZERO {
        return None;
    }
    let density = light.pdf * counts.light;
    let mis = if light.sample.delta { 1.0 } else { power_heuristic(density, pdf * counts.bsdf) };
    let mut contribution = f * light.sample.radiance * (mis / density);
    if let Some(colour) = hit.split(light.sample.wi) {
        contribution *= colour;
    }
    (contribution != Rgb::ZERO).then_some(Connection { light, f, mis, contribution })
}
