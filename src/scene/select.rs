//! Which light to sample.
//!
//! Few lights: one of n is chosen with probability ½·power/Σpower + ½/n, times
//! its `sampling_weight`: power alone would leave a candle black beside an
//! occluded sun, the uniform half bounds that loss to a factor of two in
//! variance.
//!
//! Many emitters (the triangles of a glowing mesh count one by one): a
//! [`LightTree`] chooses among them by what they may bring to the receiver, and
//! counts as one light beside those at infinity, which shine everywhere.

use crate::light::{Emitter, Light, LightTree, Receiver};
use crate::sampling::AliasTable;
use crate::shape::{Geometry, PrimId};

/// A tree is built for more emitters than this.
const FEW: usize = 2;

/// A discrete distribution over the lights, as seen from a point.
#[derive(Debug, Default)]
pub struct LightSelection {
    /// Over the lights; with a tree over those at infinity, and the tree last.
    table: Option<AliasTable>,
    /// The only light, where the table would have no choice.
    single: Option<usize>,
    /// Probability of each light; with a tree, of those at infinity.
    pmf: Vec<f32>,
    tree: Option<LightTree>,
    /// Probability of the tree.
    tree_pmf: f32,
}

/// What [`LightSelection::sample`] chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Index of the light.
    pub light: usize,
    /// The primitive of it, when the choice was that fine.
    pub prim: Option<PrimId>,
    /// Its probability, above 0.
    pub pmf: f32,
}

impl LightSelection {
    /// For the lights of a scene of that radius.
    #[must_use]
    pub fn new(lights: &[Light], geometry: &Geometry, scene_radius: f64) -> LightSelection {
        let power: Vec<f64> = lights.iter().map(|l| l.power(scene_radius)).collect();
        let weight: Vec<f64> = lights.iter().map(|l| f64::from(l.weight())).collect();
        let chosen = |light: &usize| weight[*light] > 0.0;
        let emitters: Vec<Emitter> =
            (0..lights.len()).filter(chosen).flat_map(|i| lights[i].emitters(geometry, i as u32)).collect();
        if emitters.len() <= FEW {
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
            let mut pmf = vec![0.0; share.len()];
            pmf[*only] = 1.0;
            return LightSelection { single: Some(*only), pmf, ..LightSelection::default() };
        }
        match AliasTable::new(&share) {
            Some(table) => LightSelection {
                table: Some(table),
                pmf: share.iter().map(|s| (s / sum) as f32).collect(),
                ..LightSelection::default()
            },
            None => LightSelection { pmf: vec![0.0; share.len()], ..LightSelection::default() },
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
        let LightSelection { table, single, mut pmf, .. } = LightSelection::by_power(&powers, &weights);
        let tree_pmf = pmf.pop().unwrap_or(0.0);
        LightSelection { table, single, pmf, tree: Some(tree), tree_pmf }
    }

    /// A light, or a part of one, for a receiver; `None` when there is none or
    /// none shines on it. `u` is uniform in [0, 1) and `more` anything that
    /// differs from sample to sample: digits after the 24 that `u` has.
    #[must_use]
    pub fn sample(&self, receiver: &Receiver, u: f32, more: u32) -> Option<Choice> {
        let (light, pmf, u) = match self.single {
            Some(only) => (only, 1.0, u),
            None => {
                let chosen = self.table.as_ref()?.sample(u);
                (chosen.index, chosen.pmf, chosen.u)
            }
        };
        match &self.tree {
            Some(tree) if light == self.pmf.len() => {
                let chosen = tree.sample(receiver, finer(u, more))?;
                let pmf = chosen.pmf * self.tree_pmf;
                (pmf > 0.0).then_some(Choice { light: chosen.light as usize, prim: Some(chosen.prim), pmf })
            }
            _ => Some(Choice { light, prim: None, pmf }),
        }
    }

    /// Probability of the part of an area light that `prim` is a primitive of:
    /// all of it, unless [`LightSelection::is_fine`].
    #[must_use]
    pub fn pmf(&self, receiver: &Receiver, light: usize, prim: PrimId) -> f32 {
        match &self.tree {
            Some(tree) => tree.pmf(receiver, light as u32, prim) * self.tree_pmf,
            None => self.pmf[light],
        }
    }

    /// Probability of a light at infinity.
    #[must_use]
    pub fn pmf_infinite(&self, light: usize) -> f32 {
        self.pmf[light]
    }

    /// True when single primitives of area lights are chosen.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        self.tree.is_some()
    }

    /// True when no random number is needed.
    #[must_use]
    pub fn is_trivial(&self) -> bool {
        self.table.is_none() && self.tree.is_none()
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
    let mut h = u.to_bits() ^ more;
    // The finaliser of MurmurHash3.
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^= h >> 16;
    f64::from(u) + f64::from(h) * 2f64.powi(-56)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn probabilities_sum_to_one_and_match_sampling() {
        let s = LightSelection::by_power(&[1.0, 3.0, 0.0, f64::INFINITY], &[1.0, 1.0, 1.0, 0.0]);
        let receiver = Receiver::free(Vec3::ZERO);
        let pmf = |i| s.pmf(&receiver, i, 0);
        let sum: f32 = (0..4).map(pmf).sum();
        assert!((sum - 1.0).abs() < 1e-6);
        assert_eq!(pmf(3), 0.0);
        let mut counts = [0u32; 4];
        let n = 100_000;
        for i in 0..n {
            let chosen = s.sample(&receiver, (i as f32 + 0.5) / n as f32, 0).unwrap();
            assert_eq!(chosen.pmf, pmf(chosen.light));
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
        assert_eq!(s.sample(&receiver, 0.3, 0), Some(Choice { light: 0, prim: None, pmf: 1.0 }));
        assert_eq!(LightSelection::by_power(&[], &[]).sample(&receiver, 0.5, 0), None);
    }
}
