//! Independent randomisations of a pixel's set.

use super::sampler::mix;

/// The seed and the index that sample `index` of a pixel is drawn with when
/// `replicas` of them share its samples: replica r = `index` mod `replicas` is
/// a set of its own, of which the first samples are used. So any number of
/// samples is spread evenly, and each replica is a prefix of an Owen-scrambled
/// set. 0 and 1 replicas leave both as they are.
#[must_use]
pub fn replica_of(seed: u64, replicas: u32, index: u64) -> (u64, u64) {
    if replicas < 2 {
        return (seed, index);
    }
    let count = u64::from(replicas);
    let replica = index % count;
    (mix(mix(seed ^ 0x3c6e_f372_fe94_f82b).wrapping_add(replica)), index / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replicas_take_turns_with_seeds_of_their_own() {
        assert_eq!([0, 1].map(|r| replica_of(7, r, 13)), [(7, 13); 2]);
        let mut seeds = std::collections::HashSet::new();
        for seed in 0..50 {
            for index in 0..48 {
                let (own, within) = replica_of(seed, 16, index);
                assert_eq!(within, index / 16);
                assert_eq!(own, replica_of(seed, 16, index % 16).0);
                seeds.insert(own);
            }
        }
        assert_eq!(seeds.len(), 50 * 16);
    }
}
