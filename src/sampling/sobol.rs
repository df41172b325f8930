//! The first four dimensions of the Sobol' sequence, and Owen scrambling.
//!
//! Direction numbers follow from a primitive polynomial and a few initial
//! values per dimension (Joe and Kuo 2008, "Constructing Sobol sequences with
//! better two-dimensional projections", table `new-joe-kuo-6`). Dimensions 0
//! and 1 form a (0, 2)-sequence; all four have t ≤ 0 + 0 + 1 + 2 = 3.
//!
//! All values here are *bit reversed*: bit 0 is the first binary digit after
//! the point. In that order nested uniform (Owen) scrambling is a function in
//! which each bit is changed by lower bits only, which ordinary additions and
//! multiplications are (Laine and Karras 2011, "Stratified sampling for
//! stochastic transparency", section 3.1; Burley 2020, "Practical Hash-based
//! Owen Scrambling").

/// One dimension: degree and inner coefficients of the primitive polynomial,
/// and the initial values m₁ … m_s.
struct Polynomial {
    degree: usize,
    coefficients: u32,
    initial: [u32; 3],
}

const DIMENSION_2: Polynomial = Polynomial { degree: 2, coefficients: 1, initial: [1, 3, 0] };
const DIMENSION_3: Polynomial = Polynomial { degree: 3, coefficients: 1, initial: [1, 3, 1] };

/// Direction numbers with the first digit in the highest bit (Joe and Kuo,
/// equation 2).
const fn directions(polynomial: &Polynomial) -> [u32; 32] {
    let s = polynomial.degree;
    let mut v = [0u32; 32];
    let mut k = 0;
    while k < 32 {
        if k < s {
            v[k] = polynomial.initial[k] << (31 - k);
        } else {
            v[k] = v[k - s] ^ (v[k - s] >> s);
            let mut j = 1;
            while j < s {
                if (polynomial.coefficients >> (s - 1 - j)) & 1 == 1 {
                    v[k] ^= v[k - j];
                }
                j += 1;
            }
        }
        k += 1;
    }
    v
}

/// For each byte of the index and each value of it, the xor of its direction
/// numbers, bit reversed, in dimensions 2 and 3.
static BYTES: [[[u32; 2]; 256]; 4] = byte_table();

const fn byte_table() -> [[[u32; 2]; 256]; 4] {
    let (v2, v3) = (directions(&DIMENSION_2), directions(&DIMENSION_3));
    let mut table = [[[0u32; 2]; 256]; 4];
    let mut byte = 0;
    while byte < 4 {
        let mut value = 0;
        while value < 256 {
            let mut bit = 0;
            while bit < 8 {
                if (value >> bit) & 1 == 1 {
                    table[byte][value][0] ^= v2[8 * byte + bit].reverse_bits();
                    table[byte][value][1] ^= v3[8 * byte + bit].reverse_bits();
                }
                bit += 1;
            }
            value += 1;
        }
        byte += 1;
    }
    table
}

/// Dimensions 0 and 1, bit reversed. Dimension 0 is the index itself; the
/// matrix of dimension 1 is Pascal's triangle mod 2, by Lucas' theorem a
/// Kronecker power of ((1, 1), (0, 1)): one shift and xor per factor.
#[must_use]
pub(super) fn sobol_01(index: u32) -> [u32; 2] {
    let mut y = index;
    y ^= (y >> 1) & 0x5555_5555;
    y ^= (y >> 2) & 0x3333_3333;
    y ^= (y >> 4) & 0x0f0f_0f0f;
    y ^= (y >> 8) & 0x00ff_00ff;
    y ^= y >> 16;
    [index, y]
}

/// Dimensions 2 and 3, bit reversed: one look-up per non-zero byte of the index.
#[must_use]
pub(super) fn sobol_23(mut index: u32) -> [u32; 2] {
    let [mut z, mut w] = [0, 0];
    for table in &BYTES {
        if index == 0 {
            break;
        }
        let entry = table[(index & 255) as usize];
        z ^= entry[0];
        w ^= entry[1];
        index >>= 8;
    }
    [z, w]
}

/// Nested uniform scrambling of a bit-reversed value: Laine and Karras' hash
/// with the constants and the order of operations of N. Vegdahl 2021,
/// "Building a Better LK Hash". A bijection in which each bit is a function
/// of `seed` and of the bits not above it.
#[must_use]
pub(super) fn owen_reversed(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// A bit-reversed value as an f32 in [0, 1): its first 24 digits, exactly.
#[must_use]
pub(super) fn unit_float_reversed(x: u32) -> f32 {
    unit_float(x.reverse_bits())
}

/// Two of them at once: reversing 64 bits costs what reversing 32 does.
#[must_use]
pub(super) fn unit_floats_reversed(x: u32, y: u32) -> [f32; 2] {
    let both = ((u64::from(y) << 32) | u64::from(x)).reverse_bits();
    [unit_float((both >> 32) as u32), unit_float(both as u32)]
}

/// x / 2³² rounded down to 24 binary digits: in [0, 1), exact.
#[must_use]
pub(super) fn unit_float(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortcuts_equal_the_direction_numbers() {
        let one = directions(&Polynomial { degree: 1, coefficients: 0, initial: [1, 0, 0] });
        let matrices = [one, directions(&DIMENSION_2), directions(&DIMENSION_3)];
        for i in (0..5000u32).chain((0..5000).map(|k| k * 858_993 + 17)).chain([u32::MAX]) {
            let slow = matrices.map(|v| (0..32).filter(|b| i >> b & 1 == 1).fold(0, |x, b: usize| x ^ v[b]));
            let (a, b) = (sobol_01(i), sobol_23(i));
            assert_eq!(a[0], i);
            assert_eq!([a[1], b[0], b[1]].map(u32::reverse_bits), slow, "index {i}");
        }
    }

    #[test]
    fn first_points_are_the_published_ones() {
        // Fourth and sixth points of the sequence in natural (not Gray code) order.
        let point = |i: u32| {
            let (a, b) = (sobol_01(i), sobol_23(i));
            [a[0], a[1], b[0], b[1]].map(unit_float_reversed)
        };
        assert_eq!(point(1), [0.5, 0.5, 0.5, 0.5]);
        assert_eq!(point(2), [0.25, 0.75, 0.75, 0.75]);
        assert_eq!(point(3), [0.75, 0.25, 0.25, 0.25]);
        assert_eq!(point(4), [0.125, 0.625, 0.375, 0.125]);
    }

    #[test]
    fn scrambling_is_nested() {
        for seed in [0, 1, 0xdead_beef, 0xffff_ffff] {
            for x in (0..1000u32).map(|k| k.wrapping_mul(0x9e37_79b9)) {
                for bit in 0..32 {
                    let d = owen_reversed(x, seed) ^ owen_reversed(x ^ (1 << bit), seed);
                    assert_eq!(d & ((1 << bit) - 1), 0, "lower bits stay");
                    assert_eq!(d >> bit & 1, 1, "the bit itself is kept or flipped");
                }
            }
        }
    }

    #[test]
    fn floats_stay_below_one() {
        assert_eq!(unit_float(u32::MAX), crate::math::ONE_MINUS_EPSILON);
        assert_eq!(unit_float(0), 0.0);
    }
}
