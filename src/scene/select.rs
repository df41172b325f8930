//! Which light to sample.
//!
//! One of n lights is chosen with probability ½·power/Σpower + ½/n, times its
//! `sampling_weight`: power alone would leave a candle black beside an occluded
//! sun, the uniform half bounds that loss to a factor of two in variance.

use crate::sampling::AliasTable;

/// A fixed discrete distribution over the lights.
#[derive(Debug, Default)]
pub struct LightSelection {
    table: Option<AliasTable>,
    single: Option<usize>,
    pmf: Vec<f32>,
}

impl LightSelection {
    /// From each light's power (any unit; negative or non-finite counts as 0)
    /// and sampling weight. A light of weight 0 is never chosen.
    #[must_use]
    pub fn new(power: &[f64], weight: &[f64]) -> LightSelection {
        let power: Vec<f64> = power.iter().map(|p| if p.is_finite() { p.max(0.0) } else { 0.0 }).collect();
        let total: f64 = power.iter().sum();
        let eligible = weight.iter().filter(|w| **w > 0.0).count().max(1) as f64;
        let share: Vec<f64> = power
            .iter()
            .zip(weight)
            .map(|(p, w)| w * (if total > 0.0 { 0.5 * p / total } else { 0.0 } + 0.5 / eligible))
            .collect();
        let sum: f64 = share.iter().sum();
        let chosen: Vec<usize> = (0..share.len()).filter(|i| share[*i] > 0.0).collect();
        if let [only] = chosen.as_slice() {
            let mut pmf = vec![0.0; share.len()];
            pmf[*only] = 1.0;
            return LightSelection { table: None, single: Some(*only), pmf };
        }
        match AliasTable::new(&share) {
            Some(table) => LightSelection {
                table: Some(table),
                single: None,
                pmf: share.iter().map(|s| (s / sum) as f32).collect(),
            },
            None => LightSelection { table: None, single: None, pmf: vec![0.0; share.len()] },
        }
    }

    /// Index of a light and its probability; `None` when there is none.
    #[must_use]
    pub fn sample(&self, u: f32) -> Option<(usize, f32)> {
        if let Some(only) = self.single {
            return Some((only, 1.0));
        }
        let index = self.table.as_ref()?.sample(u).index;
        Some((index, self.pmf[index]))
    }

    /// Probability of a light.
    #[must_use]
    pub fn pmf(&self, index: usize) -> f32 {
        self.pmf[index]
    }

    /// True when no random number is needed.
    #[must_use]
    pub fn is_trivial(&self) -> bool {
        self.table.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_sum_to_one_and_match_sampling() {
        let s = LightSelection::new(&[1.0, 3.0, 0.0, f64::INFINITY], &[1.0, 1.0, 1.0, 0.0]);
        let sum: f32 = (0..4).map(|i| s.pmf(i)).sum();
        assert!((sum - 1.0).abs() < 1e-6);
        assert_eq!(s.pmf(3), 0.0);
        let mut counts = [0u32; 4];
        let n = 100_000;
        for i in 0..n {
            let (index, pmf) = s.sample((i as f32 + 0.5) / n as f32).unwrap();
            assert_eq!(pmf, s.pmf(index));
            counts[index] += 1;
        }
        for (i, count) in counts.iter().enumerate() {
            assert!((*count as f32 / n as f32 - s.pmf(i)).abs() < 1e-4, "light {i}");
        }
    }

    #[test]
    fn one_light_needs_no_random_number() {
        let s = LightSelection::new(&[5.0], &[1.0]);
        assert!(s.is_trivial());
        assert_eq!(s.sample(0.3), Some((0, 1.0)));
        assert_eq!(LightSelection::new(&[], &[]).sample(0.5), None);
    }
}
