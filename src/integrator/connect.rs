//! Next-event estimation: which light a shadow ray is traced to.
//!
//! The candidates of a vertex are weighed against bsdf sampling each by itself
//! (multi-sample multiple importance sampling, Veach 1997, section 9.2). One of
//! them gets the shadow ray, with a probability q proportional to what it would
//! contribute, and then stands for all: its contribution is divided by q. The
//! mean does not change, and where nothing is in the way the choice adds no
//! noise at all (Talbot, Cline, Egbert 2005, "Importance Resampling for Global
//! Illumination", with the densities of the candidates in the MIS weights).

use smallvec::SmallVec;

use crate::math::{Rgb, Vec2};
use crate::sampling::power_heuristic;
use crate::scene::{ChosenLight, FEW_LIGHTS, Interaction, Scene};

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

/// The light sample of a vertex by the numbers `u_choice` and `u`; `None` when
/// no light can contribute.
pub fn connect(
    scene: &Scene,
    hit: &Interaction,
    u_choice: f32,
    u: Vec2,
    counts: Counts,
) -> Option<Connection> {
    let lights = scene.sample_lights(hit, u_choice, u);
    if let [light] = lights.as_slice() {
        return weigh(hit, light, counts);
    }
    let all: SmallVec<[Connection; FEW_LIGHTS]> =
        lights.iter().filter_map(|light| weigh(hit, light, counts)).collect();
    let sum: f32 = all.iter().map(|c| c.contribution.element_sum()).sum();
    // One stands for all: the number is what the choice of candidates left over.
    let mut rest = scene.selection.left_over(u_choice, u) * sum;
    let (last, others) = all.split_last()?;
    let chosen = others.iter().find(|c| {
        rest -= c.contribution.element_sum();
        rest < 0.0
    });
    let chosen = chosen.unwrap_or(last);
    let share = chosen.contribution.element_sum() / sum;
    let contribution = chosen.contribution / share;
    contribution.is_finite().then_some(Connection { contribution, ..*chosen })
}

/// What one light sample contributes.
fn weigh(hit: &Interaction, light: &ChosenLight, counts: Counts) -> Option<Connection> {
    let (f, pdf) = hit.scatter.eval_pdf(hit.wo, light.sample.wi);
    if f == Rgb::ZERO {
        return None;
    }
    let density = light.pdf * counts.light;
    let mis = if light.sample.delta { 1.0 } else { power_heuristic(density, pdf * counts.bsdf) };
    let contribution = f * light.sample.radiance * (mis / density);
    (contribution != Rgb::ZERO).then_some(Connection { light: *light, f, mis, contribution })
}
