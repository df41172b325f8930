//! Into which sums a sample goes, and what their differences say of the noise.
//!
//! **Halves**, the default. The first n samples of a pixel are one randomised
//! net, and for n = 2^k both its first and its second half are nets of the same
//! kind; Owen scrambling makes the two exchangeable. So with A and B their
//! means, M = (A + B)/2 and D = (A − B)/2 are uncorrelated, and with V(n) the
//! variance of a mean of n samples
//!
//!   E D² = V(n/2) − V(n)
//!
//! which is V(n) itself where the error falls like that of independent samples
//! (V ∝ 1/n), and 2^p − 1 times it where V ∝ n^−p: conservative, by as little
//! as two parts of one sample set can be. Any interleaving of the set is worse,
//! since a difference of signs that alternate within the set sees what the set
//! itself integrates exactly: halves of alternating samples reported up to 4
//! times the error of smooth light.
//!
//! Three sums are enough for any n. Samples 2^(k−1) … 2^k − 1 are *level* k
//! (sample 0 is level 0). The two newest levels have a sum of their own and all
//! older ones share the third ([`Film::advance`](super::Film::advance)). While
//! the newest level is short, it counts with the one before it.
//!
//! **Replicas**. Sample i belongs to replica i mod R; the replicas are
//! independent sets ([`crate::sampling::replica_of`]), so that the scatter of
//! their means is an unbiased estimate with R − 1 degrees of freedom; what it
//! costs is that R short sets integrate smooth light less well than one long one.

/// Values summed per group: the weight, then weighted R, G, B.
pub(super) const PER_GROUP: usize = 4;

/// Σw, Σw·R, Σw·G, Σw·B of some samples.
pub(super) type Sums = [f64; PER_GROUP];

/// Most replicas of a film.
pub const MAX_REPLICAS: u32 = 64;

/// How the samples of a pixel are kept apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Groups {
    /// First and second half.
    #[default]
    Halves,
    /// That many replicas, 2 to [`MAX_REPLICAS`].
    Replicas(u32),
}

impl Groups {
    /// `replicas` of them, or halves for 0 and 1.
    #[must_use]
    pub fn of_replicas(replicas: u32) -> Groups {
        if replicas < 2 { Groups::Halves } else { Groups::Replicas(replicas.min(MAX_REPLICAS)) }
    }

    /// Sums per pixel.
    pub(super) fn count(self) -> usize {
        match self {
            Groups::Halves => 3,
            Groups::Replicas(count) => count as usize,
        }
    }

    /// The sum that a sample belongs to.
    #[inline]
    pub(super) fn of(self, index: u64) -> usize {
        match self {
            Groups::Halves => slot(index),
            Groups::Replicas(count) => (index % u64::from(count)) as usize,
        }
    }

    /// The variance of a mean of weight 1, from the sums of one pixel.
    pub(super) fn noise(self, sums: impl Iterator<Item = Sums> + Clone) -> Option<[f64; 3]> {
        match self {
            Groups::Halves => between(halves(sums).into_iter()),
            Groups::Replicas(_) => between(sums),
        }
    }

    /// Degrees of freedom of [`Groups::noise`].
    pub(super) fn degrees(self) -> f64 {
        match self {
            Groups::Halves => 1.0,
            Groups::Replicas(count) => f64::from(count) - 1.0,
        }
    }

    /// How the error is found, for the header.
    #[must_use]
    pub fn describe(self) -> String {
        match self {
            Groups::Halves => {
                "standard error: first against second half of the samples, pooled over 5 x 5 pixels"
                    .to_owned()
            }
            Groups::Replicas(count) => {
                format!("standard error: scatter of {count} independent replicas, pooled over 5 x 5 pixels")
            }
        }
    }
}

/// The sum of the level of a sample: 1 or 2.
#[inline]
fn slot(index: u64) -> usize {
    1 + (u64::BITS - index.leading_zeros()) as usize % 2
}

/// The sum whose level becomes old when sample `next` begins a new one.
pub(super) fn old_slot(next: u64) -> Option<usize> {
    (next >= 2 && next.is_power_of_two()).then(|| slot(next))
}

/// The two parts to compare, from the three sums.
fn halves(sums: impl Iterator<Item = Sums>) -> [Sums; 2] {
    let mut three = [Sums::default(); 3];
    for (to, from) in three.iter_mut().zip(sums) {
        *to = from;
    }
    let [old, a, b] = three;
    let (short, long) = if a[0] < b[0] { (a, b) } else { (b, a) };
    let plus = |a: Sums, b: Sums| std::array::from_fn(|k| a[k] + b[k]);
    // The long one is the newest level when it is longer than all old ones.
    if long[0] > 1.125 * old[0] { [plus(old, short), long] } else { [old, plus(short, long)] }
}

/// c of groups whose means have the variances c/W: Σ W·(m − M)²/(count − 1),
/// unbiased, with M the weighted mean. Nothing with fewer than two of them.
fn between(groups: impl Iterator<Item = Sums> + Clone) -> Option<[f64; 3]> {
    let groups = groups.filter(|g| g[0] > 0.0);
    let (mut total, mut count) = (Sums::default(), 0.0);
    for group in groups.clone() {
        total.iter_mut().zip(group).for_each(|(t, g)| *t += g);
        count += 1.0;
    }
    if count < 2.0 {
        return None;
    }
    let mut c = [0.0; 3];
    for group in groups {
        for k in 0..3 {
            let difference = group[k + 1] / group[0] - total[k + 1] / total[0];
            c[k] += group[0] * difference * difference;
        }
    }
    Some(c.map(|c| c / (count - 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs the sums over the first `n` samples and gives the parts compared.
    fn parts(n: u64) -> [Vec<u64>; 2] {
        let mut sums: [Vec<u64>; 3] = Default::default();
        for i in 0..n {
            if let Some(slot) = old_slot(i) {
                let old = std::mem::take(&mut sums[slot]);
                sums[0].extend(old);
            }
            sums[Groups::Halves.of(i)].push(i);
        }
        // Each sample as a bit of the second value tells who is where.
        let as_sums =
            |list: &Vec<u64>| [list.len() as f64, list.iter().map(|i| (*i as f64).exp2()).sum(), 0.0, 0.0];
        let split = halves(sums.iter().map(as_sums));
        split.map(|s| (0..n).filter(|i| (s[1] as u64) >> i & 1 == 1).collect())
    }

    #[test]
    fn halves_are_the_first_and_the_second() {
        for k in 2..=5 {
            let n = 1 << k;
            assert_eq!(parts(n), [(0..n / 2).collect::<Vec<_>>(), (n / 2..n).collect()]);
        }
        // A short newest level counts with the one before it; a long one is alone.
        assert_eq!(parts(18), [(0..8).collect::<Vec<_>>(), (8..18).collect()]);
        assert_eq!(parts(27), [(0..16).collect::<Vec<_>>(), (16..27).collect()]);
    }

    #[test]
    fn scatter_is_the_textbook_variance() {
        let values = [1.0, 4.0, 2.5, 7.0];
        let mean = values.iter().sum::<f64>() / 4.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 3.0;
        let c = between(values.iter().map(|v| [2.0, 2.0 * v, 0.0, -2.0 * v])).unwrap();
        // Each mean has the weight 2: the variance of one is c/2.
        assert!((c[0] / 2.0 - variance).abs() < 1e-12 && c[1] == 0.0 && (c[2] - c[0]).abs() < 1e-12);
        assert_eq!(between([[1.0, 1.0, 1.0, 1.0], [0.0; 4]].into_iter()), None);
    }
}
