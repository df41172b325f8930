//! The sequences: stratification, convergence, independence.

use etendue::math::Vec2;
use etendue::sampling::{Sampler, Sequence};

/// Every elementary interval of 2^-(m-t) holds exactly 2^t of the points.
fn assert_net<const D: usize>(points: &[[f32; D]], t: u32, what: &str) {
    let m = points.len().ilog2();
    let mut shapes = 0;
    let mut split = [0u32; D];
    loop {
        if split.iter().sum::<u32>() == m - t {
            shapes += 1;
            let mut count = vec![0u32; 1 << (m - t)];
            for p in points {
                let cell = (0..D).fold(0, |cell, d| {
                    (cell << split[d]) + (f64::from(p[d]) * f64::from(1u32 << split[d])) as usize
                });
                count[cell] += 1;
            }
            assert!(count.iter().all(|c| *c == 1 << t), "{what}: {} points, split {split:?}", points.len());
        }
        let Some(d) = (0..D).find(|d| split[*d] < m - t) else { break };
        split[d] += 1;
        split[..d].fill(0);
    }
    assert!(shapes > 0);
}

#[test]
fn padded_sets_are_nets_in_every_aligned_block() {
    for dimension in [0, 1, 7, 10_001, u32::MAX] {
        for m in [1, 4, 8, 10] {
            for block in [0, 3, (1 << 33) + 1] {
                let first = block << m;
                let points: Vec<[f32; 2]> = (first..first + (1 << m))
                    .map(|i| Sampler::new(3, (5, -2), i).get_2d(dimension).to_array())
                    .collect();
                assert_net(&points, 0, "padded 2D");
                let points: Vec<[f32; 1]> = (first..first + (1 << m))
                    .map(|i| [Sampler::new(3, (5, -2), i).get_1d(dimension)])
                    .collect();
                assert_net(&points, 0, "padded 1D");
            }
        }
    }
}

#[test]
fn joint_set_is_a_net() {
    for m in [3, 4, 6, 8, 10] {
        let points: Vec<[f32; 4]> = (0..1 << m)
            .map(|i| {
                let (p, l) = Sampler::new(9, (17, 4), i).pixel_and_light();
                [p.x, p.y, l.x, l.y]
            })
            .collect();
        assert_net(&points, 3, "joint 4D");
        assert_net(&points.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>(), 0, "pixel");
        for d in 0..4 {
            assert_net(&points.iter().map(|p| [p[d]]).collect::<Vec<_>>(), 0, "each dimension");
        }
    }
}

/// Root mean square error over many pixels of the mean of `n` values.
fn rms_error(n: u64, expected: f64, f: &dyn Fn(&Sampler) -> f64) -> f64 {
    let pixels = 256;
    let square: f64 = (0..pixels)
        .map(|x| {
            let sum: f64 = (0..n).map(|i| f(&Sampler::new(1, (x, 3), i))).sum();
            (sum / n as f64 - expected).powi(2)
        })
        .sum();
    (square / f64::from(pixels)).sqrt()
}

fn bump(u: Vec2) -> f64 {
    (f64::from(u.x) * 2.0).exp() * (f64::from(u.y) * 1.5).cos()
}

#[test]
fn smooth_integrands_converge_faster_than_independent_samples() {
    let mean = (2f64.exp().powi(1) - 1.0) / 2.0 * (1.5f64.sin() / 1.5);
    for get in
        [(&|s: &Sampler| bump(s.get_2d(4))) as &dyn Fn(&Sampler) -> f64, &|s| bump(s.pixel_and_light().0)]
    {
        let (few, many) = (rms_error(64, mean, get), rms_error(1024, mean, get));
        let order = (few / many).log2() / 4.0;
        assert!(order > 1.3, "error falls as N^-{order}");
        assert!(many < 2e-4, "{many}");
    }
    // The joint set on a 4D integrand: a net with t = 3, still beyond 1/√N.
    let joint = |s: &Sampler| {
        let (p, l) = s.pixel_and_light();
        bump(p) * bump(l)
    };
    let (few, many) = (rms_error(64, mean * mean, &joint), rms_error(1024, mean * mean, &joint));
    let order = (few / many).log2() / 4.0;
    assert!(order > 0.9, "4D error falls as N^-{order}");
}

/// Single samples over many seeds: independent, so the mean is within 5 σ.
fn assert_uniform_over_seeds(sequence: Sequence, index: u64) {
    let n = 20_000;
    let mut sum = [0.0; 5];
    let mut square = [0.0; 5];
    for seed in 0..n {
        let s = Sampler::new(seed, (2, 2), index).with_sequence(sequence);
        let ((p, l), q) = (s.pixel_and_light(), s.get_2d(12));
        for (k, v) in [p.x, p.y, l.x, q.y, s.get_1d(12)].into_iter().enumerate() {
            assert!((0.0..1.0).contains(&v));
            sum[k] += f64::from(v);
            square[k] += f64::from(v * v);
        }
    }
    let sigma = (1.0 / 12.0 / n as f64).sqrt();
    for k in 0..5 {
        assert!((sum[k] / n as f64 - 0.5).abs() < 5.0 * sigma, "{sequence:?}, index {index}, number {k}");
        assert!((square[k] / n as f64 - 1.0 / 3.0).abs() < 5.0 * sigma);
    }
}

#[test]
fn estimates_are_unbiased_over_seeds() {
    for sequence in Sequence::ALL {
        for index in [0, 1, 5, 1000, (1 << 40) + 3] {
            assert_uniform_over_seeds(sequence, index);
        }
    }
}

/// What each sequence is for: its error on a product of smooth functions of
/// two sets falls at its own rate.
#[test]
fn sequences_differ_as_they_should() {
    let mean = (2f64.exp() - 1.0) / 2.0 * (1.5f64.sin() / 1.5);
    let order = |sequence: Sequence, expected: f64, f: &dyn Fn(&Sampler) -> f64| {
        let f = |s: &Sampler| f(&s.with_sequence(sequence));
        (rms_error(64, expected, &f) / rms_error(1024, expected, &f)).log2() / 4.0
    };
    let single = |s: &Sampler| bump(s.get_2d(4));
    let joint = |s: &Sampler| {
        let (p, l) = s.pixel_and_light();
        bump(p) * bump(l)
    };
    for (sequence, alone, together) in [
        (Sequence::Sobol, 1.3..2.0, 0.9..2.0),
        (Sequence::Padded, 1.3..2.0, 0.4..0.7),
        (Sequence::Lattice, 0.7..1.3, 0.4..0.7),
        (Sequence::Independent, 0.4..0.6, 0.4..0.6),
    ] {
        let (a, b) = (order(sequence, mean, &single), order(sequence, mean * mean, &joint));
        assert!(alone.contains(&a), "{sequence:?}: N^-{a} on one set");
        assert!(together.contains(&b), "{sequence:?}: N^-{b} on pixel and light");
        assert_eq!(Sequence::named(sequence.name()), Some(sequence));
    }
}

/// Correlation coefficient of pairs.
fn correlation(pairs: &[(f32, f32)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f32, f32)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| f64::from(p.0)), mean(&|p| f64::from(p.1)));
    let cov = mean(&|p| (f64::from(p.0) - mx) * (f64::from(p.1) - my));
    let var = |m: f64, f: &dyn Fn(&(f32, f32)) -> f64| mean(&|p| (f(p) - m).powi(2));
    cov / (var(mx, &|p| f64::from(p.0)) * var(my, &|p| f64::from(p.1))).sqrt()
}

#[test]
fn dimensions_pixels_and_seeds_are_not_correlated() {
    let n = 1 << 14;
    let limit = 5.0 / f64::from(n).sqrt();
    let check = |what: &str, f: &dyn Fn(i32) -> (f32, f32)| {
        let pairs: Vec<_> = (0..n).map(f).collect();
        let r = correlation(&pairs);
        assert!(r.abs() < limit, "{what}: r = {r}");
    };
    let at = |x: i32, y: i32, i: i32| Sampler::new(0, (x, y), i as u64);
    for (a, b) in [(0, 1), (1, 2), (0, 10_000), (3, 1 << 20)] {
        check("dimensions, over the samples", &|i| (at(0, 0, i).get_1d(a), at(0, 0, i).get_1d(b)));
        check("2D sets, over the samples", &|i| (at(1, 0, i).get_2d(a).x, at(1, 0, i).get_2d(b).y));
        check("dimensions, over the pixels", &|x| (at(x, 7, 0).get_1d(a), at(x, 7, 0).get_1d(b)));
    }
    check("1D against 2D", &|i| (at(4, 4, i).get_1d(3), at(4, 4, i).get_2d(3).x));
    check("joint against padded", &|i| (at(4, 4, i).pixel_and_light().0.x, at(4, 4, i).get_2d(0).x));
    check("neighbours", &|x| (at(x, 0, 0).get_1d(0), at(x + 1, 0, 0).get_1d(0)));
    check("rows", &|x| (at(x, 0, 0).get_2d(0).y, at(x, 1, 0).get_2d(0).y));
    check("transposed", &|x| (at(x, 1, 5).get_1d(0), at(1, x + 2, 5).get_1d(0)));
    check("pixels, over the samples", &|i| (at(3, 3, i).get_1d(0), at(4, 3, i).get_1d(0)));
    check("seeds", &|i| {
        (Sampler::new(1, (0, 0), i as u64).get_1d(0), Sampler::new(2, (0, 0), i as u64).get_1d(0))
    });
    check("blocks of 2^32", &|i| {
        (at(3, 3, i).get_1d(0), Sampler::new(0, (3, 3), (1 << 32) + i as u64).get_1d(0))
    });
}

#[test]
fn numbers_never_reach_one_and_are_replayed() {
    let mut largest: f32 = 0.0;
    for i in 0..200_000u64 {
        let s = Sampler::new(77, (i as i32 % 13, -5), i.wrapping_mul(0x1_0000_0fab));
        let v = s.get_2d(i as u32);
        largest = largest.max(v.x.max(v.y)).max(s.get_1d(i as u32));
        for sequence in Sequence::ALL {
            let s = s.with_sequence(sequence);
            let (p, l) = s.pixel_and_light();
            assert!(p.max(l).max_element() < 1.0 && s.get_1d(i as u32) < 1.0);
        }
        assert_eq!(v, Sampler::new(77, (i as i32 % 13, -5), i.wrapping_mul(0x1_0000_0fab)).get_2d(i as u32));
    }
    assert!(largest < 1.0 && largest > 0.999);
}

/// Every number that a sampler gives, by a name: the joint set, and the first
/// dimensions, the ten thousandth and those at the end of u32.
fn numbers(sampler: &Sampler) -> Vec<f32> {
    let (p, l) = sampler.pixel_and_light();
    let mut all = vec![p.x, p.y, l.x, l.y];
    for dimension in [0, 1, 63, 1023, 1024, 4096, 9_999, 10_000, 10_001, 1 << 31, u32::MAX - 2] {
        let v = sampler.get_2d(dimension);
        all.extend([v.x, v.y, sampler.get_1d(dimension)]);
    }
    all
}

/// Around the ends of 32 bits and beyond: in [0, 1), uniform (χ²), and no
/// repetition of what stood 2^32 samples before.
#[test]
fn sequences_go_on_past_2_to_the_32_samples() {
    const CELLS: usize = 64;
    let count = 1u64 << 13;
    // Of χ² with 63 degrees of freedom: one in a million, for a thousand tests.
    let limit = 63.0 + 5.5 * (2.0f64 * 63.0).sqrt() + 5.5 * 5.5 * 2.0 / 3.0;
    let mut tests = 0;
    for sequence in Sequence::ALL {
        let at = |index: u64| numbers(&Sampler::new(4, (3, 2), index).with_sequence(sequence));
        for first in [(1 << 32) - 4096, 1 << 32, (1 << 33) + 777, 1 << 40, (1 << 63) - 5, u64::MAX - count] {
            let mut cells = vec![[0u32; CELLS]; numbers(&Sampler::new(0, (0, 0), 0)).len()];
            let mut repeated = 0;
            for index in first..first + count {
                let (now, before) = (at(index), at(index - (1 << 31) * 2 * u64::from(first >= 1 << 32)));
                for (k, v) in now.iter().enumerate() {
                    assert!((0.0..1.0).contains(v), "{sequence:?} {index} {k}: {v}");
                    cells[k][(v * CELLS as f32) as usize] += 1;
                    repeated += u32::from(first >= 1 << 32 && now[k].to_bits() == before[k].to_bits());
                }
            }
            // Two numbers of 24 bits are the same once in 2^24.
            assert!(repeated < 10, "{sequence:?} from {first}: {repeated} numbers come again");
            for (k, cells) in cells.iter().enumerate() {
                let expected = count as f64 / CELLS as f64;
                let chi2: f64 = cells.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
                assert!(chi2 < limit, "{sequence:?} from {first}, number {k}: χ² {chi2} of 63");
                tests += 1;
            }
        }
    }
    assert_eq!(tests, 4 * 6 * 37);
}

/// The 10,000 dimensions of a path of more than a thousand vertices, sample by
/// sample: no two alike, none correlated with the next.
#[test]
fn ten_thousand_dimensions_are_all_different() {
    for sequence in Sequence::ALL {
        for index in [0, 1, 12_345, (1 << 32) + 6] {
            let s = Sampler::new(1, (7, 7), index).with_sequence(sequence);
            let values: Vec<f32> = (0..10_000).map(|d| s.get_1d(d)).collect();
            let mut bits: Vec<u32> = values.iter().map(|v| v.to_bits()).collect();
            bits.sort_unstable();
            bits.dedup();
            // 10^8 / 2 pairs of 24 bits: three coincidences.
            assert!(bits.len() > 9_985, "{sequence:?} {index}: {} different", bits.len());
            let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / 1e4;
            assert!((mean - 0.5).abs() < 5.0 / (12.0f64 * 1e4).sqrt(), "{sequence:?} {index}: {mean}");
            let pairs: Vec<_> = values.windows(2).map(|w| (w[0], w[1])).collect();
            assert!(correlation(&pairs).abs() < 0.05, "{sequence:?} {index}");
        }
    }
}

/// All pixels of a 4K picture, at sample counts whose product with the pixels
/// is far beyond 32 bits: no two are drawn alike.
#[test]
fn pixels_of_a_4k_picture_are_all_different() {
    let at = |x: i32, y: i32, index: u64| -> u128 {
        let s = Sampler::new(0, (x, y), index);
        let (a, b) = (s.get_2d(8), s.get_2d(9));
        [a.x, a.y, b.x, b.y].iter().fold(0, |key, v| (key << 32) | u128::from(v.to_bits()))
    };
    let mut keys: Vec<u128> = Vec::with_capacity(3840 * 2160);
    for index in [0, 70_000, (1 << 34) + 1] {
        keys.clear();
        keys.extend((0..2160).flat_map(|y| (0..3840).map(move |x| at(x, y, index))));
        keys.sort_unstable();
        assert!(keys.windows(2).all(|w| w[0] != w[1]), "two pixels alike at sample {index}");
    }
    // Nor is a pixel another one some samples later.
    keys.clear();
    for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x * 60, y * 34))) {
        keys.extend((0..64).map(|k| at(x, y, k << 31)));
    }
    keys.sort_unstable();
    assert!(keys.windows(2).all(|w| w[0] != w[1]));
}
