//! Sizes of passes and orders of tiles.

use super::TileOrder;
use crate::film::Rect;

/// Samples per pixel of the pass that begins at sample `next`. A function of
/// the index alone: how often somebody looked at the clock must not change a
/// picture's last bit. A pass with more than eight replicas has a sample for
/// each, since the sums of all of them are added to the film after it.
pub fn size(next: u64, replicas: u32) -> u64 {
    let step = u64::from(replicas).next_multiple_of(8).max(8);
    match next {
        0 => 1,
        1..8 => next,
        _ => step - next % step,
    }
}

/// Fewer samples say nothing about the error.
pub const MIN_SAMPLES_FOR_ERROR: u64 = 8;

/// The error is estimated when a pass goes `from` so many samples to `next`.
/// For a limit to be met, at steps of at most an eighth; to be shown, at powers
/// of two.
pub fn checks_error(from: u64, next: u64, limited: bool) -> bool {
    if next < MIN_SAMPLES_FOR_ERROR {
        return false;
    }
    let octave = next.ilog2();
    let step = 1 << if limited && octave > 4 { octave - 3 } else { octave };
    from / step < next / step
}

/// Sorts tiles into the order in which they are begun.
pub fn order(tiles: &mut [Rect], order: TileOrder) {
    match order {
        TileOrder::CentreOut => {
            let bounds = tiles.iter().fold((i32::MAX, i32::MAX, i32::MIN, i32::MIN), |b, t| {
                (b.0.min(t.min.0), b.1.min(t.min.1), b.2.max(t.max.0), b.3.max(t.max.1))
            });
            let centre =
                (i64::from(bounds.0) + i64::from(bounds.2), i64::from(bounds.1) + i64::from(bounds.3));
            tiles.sort_by_key(|t| {
                let dx = i64::from(t.min.0) + i64::from(t.max.0) - centre.0;
                let dy = i64::from(t.min.1) + i64::from(t.max.1) - centre.1;
                (dx * dx + dy * dy, t.min.1, t.min.0)
            });
        }
        TileOrder::Shuffled(seed) => {
            // splitmix64 as a key: any order will do.
            let key = |x: u64| {
                let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                x ^ (x >> 31)
            };
            tiles.sort_by_key(|t| key(seed ^ key(((t.min.0 as u64) << 32) ^ t.min.1 as u64)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_end_on_powers_of_two_and_multiples_of_eight() {
        let mut ends = Vec::new();
        let mut next = 0;
        while next < 40 {
            next += size(next, 0);
            ends.push(next);
        }
        assert_eq!(ends, [1, 2, 4, 8, 16, 24, 32, 40]);
        assert_eq!((size(13, 0), size(13, 8), size(16, 16), size(24, 17)), (3, 3, 16, 24));
    }

    #[test]
    fn the_error_is_estimated_ever_more_rarely() {
        let at = |limited| (1..=512).filter(|n| checks_error(n - 1, *n, limited)).collect::<Vec<_>>();
        assert_eq!(at(false), [8, 16, 32, 64, 128, 256, 512]);
        let steps = at(true);
        assert_eq!(steps[..4], [8, 16, 32, 36]);
        assert!(steps[2..].windows(2).all(|w| (w[1] - w[0]) * 8 <= w[0]), "{steps:?}");
        // Whatever the passes are, no look is lost for long.
        assert!(checks_error(120, 144, true) && checks_error(126, 129, false));
    }
}
