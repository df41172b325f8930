//! Which lights to sample.
//!
//! A vertex takes one or more candidates, each light or part of a light with a
//! known rate: how many times it is a candidate on average. The estimator of
//! next-event estimation is the sum over candidates of f·L / (rate · pdf), so
//! any rates that are positive where there is light give the same mean; which
//! of them get a shadow ray is for the integrator.
//!
//! * One light is the only candidate.
//! * Of a few lights each is a candidate once: what the bsdf makes of each is
//!   then known before a shadow ray is spent.
//! * Of many emitters (the triangles of a glowing mesh count one by one) a
//!   [`LightTree`] draws by what they may bring to the receiver. It counts as
//!   one light beside those at infinity, which shine everywhere.
//! * What is left, a few emitters with unequal `sampling_weight`: one candidate
//!   by ½·power/Σpower + ½/n, times the weight. Power alone would leave a candle
//!   black beside an occluded sun, the uniform half bounds that loss to a
//!   factor of two in variance.

use smallvec::SmallVec;

use crate::light::{Emitter, Light, LightTree, Receiver, TreeWalk};
use crate::math::Vec2;
use crate::sampling::AliasTable;
use crate::shape::{Geometry, PrimId};

/// Each of so many lights is a candidate.
const FEW_LIGHTS: usize = 4;
/// A tree is built for more emitters than this.
const FEW_EMITTERS: usize = 2;
/// Candidates that a tree draws for a vertex.
const DRAWS: u32 = 2;

/// A discrete distribution over the lights, as seen from a point.
#[derive(Debug, Default)]
pub struct LightSelection {
    /// Over the lights; with a tree over those at infinity, and the tree last.
    table: Option<AliasTable>,
    /// Candidates at every vertex, where the table would have no choice.
    all: SmallVec<[u32; FEW_LIGHTS]>,
    /// Rate of each light; with a tree, of those at infinity.
    rates: Vec<f32>,
    tree: Option<LightTree>,
    /// Rate of the tree.
    tree_rate: f32,
}

/// A light, or a part of one, that [`LightSelection::candidates`] chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Index of the light.
    pub light: usize,
    /// The primitive of it, when the choice was that fine.
    pub prim: Option<PrimId>,
    /// How many times it is a candidate on average, above 0.
    pub rate: f32,
}

/// The candidates of a vertex.
pub type Candidates = SmallVec<[Choice; FEW_LIGHTS]>;

impl LightSelection {
    /// For the lights of a scene of that radius.
    #[must_use]
    pub fn new(lights: &[Light], geometry: &Geometry, scene_radius: f64) -> LightSelection {
        let power: Vec<f64> = lights.iter().map(|l| l.power(scene_radius)).collect();
        let weight: Vec<f64> = lights.iter().map(|l| f64::from(l.weight())).collect();
        let eligible: SmallVec<[u32; FEW_LIGHTS]> =
            (0..lights.len() as u32).filter(|i| weight[*i as usize] > 0.0).collect();
        let emitters: Vec<Emitter> =
            eligible.iter().flat_map(|i| lights[*i as usize].emitters(geometry, *i)).collect();
        let same = eligible.windows(2).all(|w| weight[w[0] as usize] == weight[w[1] as usize]);
        let whole = emitters.len() <= FEW_LIGHTS.max(FEW_EMITTERS);
        if eligible.len() <= FEW_LIGHTS && whole && same {
            let mut rates = vec![0.0; lights.len()];
            eligible.iter().for_each(|i| rates[*i as usize] = 1.0);
            return LightSelection { all: eligible, rates, ..LightSelection::default() };
        }
        if emitters.len() <= FEW_EMITTERS {
            return LightSelection::by_power(&power, &weight);
        }
        LightSelection::by_tree(lights, &power, &weight, &emitters)
    }

    /// Without a tree, from each light's power (any unit; negative or
    /// non-finite counts as 0) and sampling weight. A light of weight 0 is
    /// never chosen.
    #[must_use]
    pub fn by_power(power: &[f64], weight: &[f64]) -> LightSelection {
        let share = shares(power, weight);
        let sum: f64 = share.iter().sum();
        let chosen: Vec<usize> = (0..share.len()).filter(|i| share[*i] > 0.0).collect();
        if let [only] = chosen.as_slice() {
            let mut rates = vec![0.0; share.len()];
            rates[*only] = 1.0;
            let all = SmallVec::from_slice(&[*only as u32]);
            return LightSelection { all, rates, ..LightSelection::default() };
        }
        match AliasTable::new(&share) {
            Some(table) => LightSelection {
                table: Some(table),
                rates: share.iter().map(|s| (s / sum) as f32).collect(),
                ..LightSelection::default()
            },
            None => LightSelection { rates: vec![0.0; share.len()], ..LightSelection::default() },
        }
    }

    fn by_tree(lights: &[Light], power: &[f64], weight: &[f64], emitters: &[Emitter]) -> LightSelection {
        let Some(tree) = LightTree::new(emitters, weight) else {
            return LightSelection::by_power(power, weight);
        };
        // The tree is the last entry, with the mean weight of its lights.
        let infinite = |i: usize| lights[i].is_infinite();
        let (mut powers, mut weights) = (power.to_vec(), weight.to_vec());
        let (mut all, mut weighed) = (0.0, 0.0);
        for i in (0..lights.len()).filter(|i| !infinite(*i)) {
            all += power[i];
            weighed += power[i] * weight[i];
            weights[i] = 0.0;
        }
        powers.push(all);
        weights.push(weighed / all);
        let LightSelection { table, mut rates, .. } = LightSelection::by_power(&powers, &weights);
        rates.iter_mut().for_each(|rate| *rate *= DRAWS as f32);
        let tree_rate = rates.pop().unwrap_or(0.0);
        LightSelection { table, all: SmallVec::new(), rates, tree: Some(tree), tree_rate }
    }

    /// The lights, or parts of lights, to sample for a receiver. `u` is uniform
    /// in [0, 1) and `more` anything that differs from sample to sample: digits
    /// after the 24 that `u` has.
    #[must_use]
    pub fn candidates(&self, receiver: &Receiver, u: f32, more: u32) -> Candidates {
        if let Some(tree) = &self.tree {
            let u = finer(u, more);
            let mut walk = tree.walk(receiver);
            let draws = (0..DRAWS).map(|draw| (f64::from(draw) + u) / f64::from(DRAWS));
            return draws.filter_map(|u| self.draw(&mut walk, u)).collect();
        }
        if let Some(table) = &self.table {
            let chosen = table.sample(u);
            return Candidates::from_slice(&[Choice { light: chosen.index, prim: None, rate: chosen.pmf }]);
        }
        let choice = |i: &u32| Choice { light: *i as usize, prim: None, rate: 1.0 };
        self.all.iter().map(choice).collect()
    }

    /// One draw from the tree and the lights at infinity.
    fn draw(&self, walk: &mut TreeWalk, u: f64) -> Option<Choice> {
        let (mut light, mut u) = (self.rates.len(), u);
        if let Some(table) = &self.table {
            let chosen = table.sample_f64(u);
            (light, u) = (chosen.0, chosen.1);
        }
        if light < self.rates.len() {
            return Some(Choice { light, prim: None, rate: self.rates[light] });
        }
        let chosen = walk.sample(u)?;
        let rate = chosen.pmf * self.tree_rate;
        (rate > 0.0).then_some(Choice { light: chosen.light as usize, prim: Some(chosen.prim), rate })
    }

    /// Rate of the part of an area light that `prim` is a primitive of: all of
    /// it, unless [`LightSelection::is_fine`].
    #[must_use]
    pub fn rate(&self, receiver: &Receiver, light: usize, prim: PrimId) -> f32 {
        match &self.tree {
            Some(tree) => tree.pmf(receiver, light as u32, prim) * self.tree_rate,
            None => self.rates[light],
        }
    }

    /// Rate of a light at infinity.
    #[must_use]
    pub fn rate_infinite(&self, light: usize) -> f32 {
        self.rates[light]
    }

    /// A number uniform in [0, 1), independent of which candidates `u_choice`
    /// and `u` gave.
    #[must_use]
    pub fn left_over(&self, u_choice: f32, u: Vec2) -> f32 {
        if self.tree.is_none() {
            return u_choice; // all are candidates, nothing was chosen
        }
        let bits = hash(u.x.to_bits() ^ hash(u.y.to_bits() ^ hash(u_choice.to_bits())));
        (bits >> 8) as f32 * 2f32.powi(-24)
    }

    /// Candidates of a vertex at most.
    #[must_use]
    pub fn most_candidates(&self) -> usize {
        match (&self.tree, &self.table) {
            (Some(_), _) => DRAWS as usize,
            (None, Some(_)) => 1,
            (None, None) => self.all.len(),
        }
    }

    /// True when single primitives of area lights are chosen.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        self.tree.is_some()
    }

    /// The light that is the only candidate everywhere, if there is one.
    #[must_use]
    #[inline]
    pub fn only(&self) -> Option<usize> {
        match (&self.tree, &self.table, self.all.as_slice()) {
            (None, None, [only]) => Some(*only as usize),
            _ => None,
        }
    }

    /// True when no random number is needed.
    #[must_use]
    pub fn is_trivial(&self) -> bool {
        self.table.is_none() && self.tree.is_none() && self.all.len() <= 1
    }

    /// The tree, if there is one.
    #[must_use]
    pub fn tree(&self) -> Option<&LightTree> {
        self.tree.as_ref()
    }
}

/// Weights in proportion to the chances of lights.
fn shares(power: &[f64], weight: &[f64]) -> Vec<f64> {
    let power: Vec<f64> = power.iter().map(|p| if p.is_finite() { p.max(0.0) } else { 0.0 }).collect();
    let total: f64 = power.iter().sum();
    let eligible = weight.iter().filter(|w| **w > 0.0).count().max(1) as f64;
    power
        .iter()
        .zip(weight)
        .map(|(p, w)| w * (if total > 0.0 { 0.5 * p / total } else { 0.0 } + 0.5 / eligible))
        .collect()
}

/// `u` with random digits after its last one, so that lights of a probability
/// below 2⁻²⁴ have their share.
fn finer(u: f32, more: u32) -> f64 {
    f64::from(u) + f64::from(hash(u.to_bits() ^ more)) * 2f64.powi(-56)
}

/// The finaliser of MurmurHash3.
fn hash(mut h: u32) -> u32 {
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn probabilities_sum_to_one_and_match_sampling() {
        let s = LightSelection::by_power(&[1.0, 3.0, 0.0, f64::INFINITY], &[1.0, 1.0, 1.0, 0.0]);
        let receiver = Receiver::free(Vec3::ZERO);
        let pmf = |i| s.rate(&receiver, i, 0);
        let sum: f32 = (0..4).map(pmf).sum();
        assert!((sum - 1.0).abs() < 1e-6);
        assert_eq!(pmf(3), 0.0);
        let mut counts = [0u32; 4];
        let n = 100_000;
        for i in 0..n {
            let chosen = s.candidates(&receiver, (i as f32 + 0.5) / n as f32, 0)[0];
            assert_eq!(chosen.rate, pmf(chosen.light));
            counts[chosen.light] += 1;
        }
        for (i, count) in counts.iter().enumerate() {
            assert!((*count as f32 / n as f32 - pmf(i)).abs() < 1e-4, "light {i}");
        }
    }

    #[test]
    fn one_light_needs_no_random_number() {
        let receiver = Receiver::free(Vec3::ZERO);
        let s = LightSelection::by_power(&[5.0], &[1.0]);
        assert!(s.is_trivial());
        let only = Choice { light: 0, prim: None, rate: 1.0 };
        assert_eq!(s.candidates(&receiver, 0.3, 0).as_slice(), &[only]);
        assert!(LightSelection::by_power(&[], &[]).candidates(&receiver, 0.5, 0).is_empty());
    }
}
