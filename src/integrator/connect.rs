//! Next-event estimation: which light a shadow ray is traced to.
//!
//! The candidates of a vertex are weighed against bsdf sampling each by itself
//! (multi-sample multiple importance sampling, Veach 1997, section 9.2). One of
//! them gets the shadow ray, with a probability q proportional to what it would
//! contribute, and then stands for all: its contribution is divided by q. The
//! mean does not change, and where nothing is in the way the choice adds no
//! noise at all (Talbot, Cline, Egbert 2005, "Importance Resampling for Global
//! Illumination", with the densities of the candidates in the MIS weights).

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

/// The light sample of a vertex by the numbers `u_choice` and `u`; `None` when
/// no light can contribute.
pub fn connect(
    scene: &Scene,
    hit: &Interaction,
    u_choice: f32,
    u: Vec2,
    counts: Counts,
) -> Option<Connection> {
    if let Some(only) = scene.selection.only() {
        let sample = scene.sample_one_light(only, hit, u)?;
        return weigh(hit, ChosenLight { pdf: sample.pdf, sample }, counts);
    }
    // One stands for all, drawn on the way; `rest` is what its choices leave of a number.
    let mut chosen: Option<Connection> = None;
    let (mut sum, mut share, mut rest) = (0.0, 0.0, None);
    for light in scene.sample_lights(hit, u_choice, u) {
        let Some(connection) = weigh(hit, light, counts) else { continue };
        let weight = f64::from(connection.contribution.element_sum());
        sum += weight;
        if chosen.is_none() {
            (chosen, share) = (Some(connection), weight);
            continue;
        }
        let u = rest.unwrap_or_else(|| f64::from(scene.selection.left_over(u_choice, u)));
        let chance = weight / sum;
        rest = if u < chance {
            (chosen, share) = (Some(connection), weight);
            Some(u / chance)
        } else {
            Some((u - chance) / (1.0 - chance))
        };
    }
    let mut chosen = chosen?;
    if rest.is_some() {
        chosen.contribution *= (sum / share) as f32;
    }
    Some(chosen)
}

/// What one light sample contributes.
#[inline]
fn weigh(hit: &Interaction, light: ChosenLight, counts: Counts) -> Option<Connection> {
    let (f, pdf) = hit.scatter.eval_pdf(hit.wo, light.sample.wi);
    if f == Rgb::ZERO {
        return None;
    }
    let density = light.pdf * counts.light;
    let mis = if light.sample.delta { 1.0 } else { power_heuristic(density, pdf * counts.bsdf) };
    let contribution = f * light.sample.radiance * (mis / density);
    (contribution != Rgb::ZERO).then_some(Connection { light, f, mis, contribution })
}
