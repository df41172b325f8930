//! Picks one of many with given probabilities in constant time: the alias
//! method (Walker 1977), built in linear time (Vose 1991, "A Linear Algorithm
//! for Generating Random Numbers with a Given Distribution").

use crate::math::ONE_MINUS_EPSILON;

/// A discrete distribution over `0 .. len()`.
///
/// One uniform f32 has 24 bits, and they are all there is for the choice and
/// for the remapped number: realised probabilities are off by up to
/// `len() / 2^24` of the average one. Split tables beyond some 2^14 entries in
/// two levels (rows, then columns) that draw a number each.
#[derive(Clone, Debug)]
pub struct AliasTable {
    columns: Vec<Column>,
    total: f64,
}

#[derive(Clone, Copy, Debug)]
struct Column {
    /// Probability of staying in this column once it is chosen.
    keep: f32,
    /// Where to go otherwise.
    alias: u32,
    /// Probability of this index over the whole table.
    pmf: f32,
}

/// What [`AliasTable::sample`] chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AliasSample {
    /// The index chosen.
    pub index: usize,
    /// Its probability, always above 0.
    pub pmf: f32,
    /// A uniform number in [0, 1) made of what the choice left of `u`.
    pub u: f32,
}

impl AliasTable {
    /// A table of probabilities proportional to `weights`. `None` when there
    /// are none, when one is negative or not finite, when all are zero or when
    /// their sum overflows. A weight below 2^-126 of the sum counts as zero.
    #[must_use]
    pub fn new(weights: &[f64]) -> Option<AliasTable> {
        let total: f64 = weights.iter().sum();
        let valid = weights.iter().all(|w| w.is_finite() && *w >= 0.0);
        if !valid || !(total > 0.0) || !total.is_finite() || u32::try_from(weights.len()).is_err() {
            return None;
        }
        let probability =
            |w: f64| Some(w / total).filter(|p| *p >= f64::from(f32::MIN_POSITIVE)).unwrap_or(0.0);
        let n = weights.len() as f64;
        let mut scaled: Vec<f64> = weights.iter().map(|w| probability(*w) * n).collect();
        let mut columns: Vec<Column> =
            weights.iter().map(|w| Column { keep: 1.0, alias: 0, pmf: probability(*w) as f32 }).collect();

        // Fill each column below average from one above.
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..weights.len()).partition(|i| scaled[*i] < 1.0);
        while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
            columns[s].keep = scaled[s] as f32;
            columns[s].alias = l as u32;
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }

        // What rounding left over is full, but an impossible index stays impossible.
        let largest = (0..weights.len()).max_by(|a, b| weights[*a].total_cmp(&weights[*b]))?;
        for column in columns.iter_mut().filter(|c| c.pmf == 0.0 && c.keep > 0.0) {
            (column.keep, column.alias) = (0.0, largest as u32);
        }
        Some(AliasTable { columns, total })
    }

    /// Chooses by a uniform `u` in [0, 1). Never an index of probability 0.
    #[must_use]
    pub fn sample(&self, u: f32) -> AliasSample {
        let (index, u) = self.sample_f64(f64::from(u));
        AliasSample { index, pmf: self.columns[index].pmf, u: (u as f32).clamp(0.0, ONE_MINUS_EPSILON) }
    }

    /// The same with a number of more digits: the index, and what is left of
    /// `u`, in [0, 1).
    #[must_use]
    pub fn sample_f64(&self, u: f64) -> (usize, f64) {
        let n = self.columns.len();
        let scaled = u * n as f64;
        let first = (scaled as usize).min(n - 1);
        let rest = scaled - first as f64;
        let column = self.columns[first];
        let keep = f64::from(column.keep);
        let (index, u) = if rest < keep {
            (first, rest / keep)
        } else {
            (column.alias as usize, (rest - keep) / (1.0 - keep))
        };
        (index, u.clamp(0.0, 1.0 - f64::EPSILON))
    }

    /// The probability of an index.
    #[must_use]
    pub fn pmf(&self, index: usize) -> f32 {
        self.columns[index].pmf
    }

    /// The sum of the weights.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.total
    }

    /// The number of weights, at least 1.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Heap memory in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.columns.capacity() * size_of::<Column>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_realised_and_remapped_numbers_uniform() {
        for weights in [
            vec![1.0],
            vec![0.0, 3.0, 0.0],
            vec![1.0, 2.0, 3.0, 4.0],
            vec![1.0, 1e20, 1e30, 0.0, 5e29],
            (0..37).map(|i| f64::from(i % 7)).collect(),
        ] {
            let table = AliasTable::new(&weights).unwrap();
            let sum: f64 = weights.iter().sum();
            let count = 1 << 18;
            let (mut hits, mut mean) = (vec![0u32; weights.len()], vec![0.0; weights.len()]);
            for i in 0..count {
                let s = table.sample(i as f32 / count as f32);
                assert!((0.0..1.0).contains(&s.u) && s.pmf > 0.0);
                assert_eq!(s.pmf, table.pmf(s.index));
                hits[s.index] += 1;
                mean[s.index] += f64::from(s.u);
            }
            for (i, w) in weights.iter().enumerate() {
                let p = w / sum;
                assert!((f64::from(table.pmf(i)) - p).abs() <= 1e-7 * p);
                assert!((f64::from(hits[i]) / f64::from(count) - p).abs() < 4e-4, "{weights:?} {i}");
                assert!(p < 0.01 || (mean[i] / f64::from(hits[i]) - 0.5).abs() < 0.01);
            }
        }
    }

    #[test]
    fn bad_weights_make_no_table() {
        for w in [&[][..], &[0.0, 0.0], &[1.0, -1.0], &[f64::NAN], &[f64::INFINITY], &[1e308, 1e308]] {
            assert!(AliasTable::new(w).is_none(), "{w:?}");
        }
    }

    #[test]
    fn zero_weights_are_never_chosen() {
        let weights: Vec<f64> =
            (0..999).map(|i| if i % 3 == 0 { 0.1 + f64::from(i).sin().abs() } else { 0.0 }).collect();
        let table = AliasTable::new(&weights).unwrap();
        for i in 0..100_000 {
            assert_eq!(table.sample(i as f32 / 100_000.0).index % 3, 0);
        }
        assert_eq!(table.sample(ONE_MINUS_EPSILON).index % 3, 0);
    }
}
