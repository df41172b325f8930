//! Weights of multiple importance sampling (Veach 1997, section 9.2) from the
//! *ratio* of the densities: neither is ever squared, so that densities from
//! 1e-38 to infinity give a weight in [0, 1] and the weights of the two
//! estimators sum to one.

/// Weight of a sample drawn with density `pdf_a` where another technique has
/// density `pdf_b`: a² / (a² + b²). In [0, 1]; 0 when `pdf_a` is 0, 1/2 when
/// both are infinite. Both in the same measure, neither negative nor NaN.
#[must_use]
pub fn power_heuristic(pdf_a: f32, pdf_b: f32) -> f32 {
    let ratio = ratio(pdf_a, pdf_b);
    1.0 / (1.0 + ratio * ratio)
}

/// As [`power_heuristic`] with exponent 1: a / (a + b).
#[must_use]
pub fn balance_heuristic(pdf_a: f32, pdf_b: f32) -> f32 {
    1.0 / (1.0 + ratio(pdf_a, pdf_b))
}

/// b / a, infinite when a is 0 and 1 when both are infinite.
fn ratio(a: f32, b: f32) -> f32 {
    debug_assert!(a >= 0.0 && b >= 0.0, "densities {a}, {b}");
    if a == 0.0 {
        f32::INFINITY
    } else if a == b {
        1.0
    } else {
        b / a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_at_every_scale() {
        let values = [1e-40, 1e-38, 1e-30, 1e-20, 1e-3, 1.0, 1.5, 1e3, 1e20, 1e30, 3e38, f32::INFINITY];
        for a in values {
            for b in values {
                for w in [power_heuristic, balance_heuristic] {
                    let (p, q) = (w(a, b), w(b, a));
                    assert!((0.0..=1.0).contains(&p) && (p + q - 1.0).abs() < 1e-6, "{a} {b}: {p} {q}");
                }
            }
            assert_eq!(power_heuristic(a, a), 0.5);
            assert_eq!(power_heuristic(a, 0.0), 1.0);
            assert_eq!(power_heuristic(0.0, a), 0.0);
        }
        assert_eq!(power_heuristic(0.0, 0.0), 0.0);
        assert!((power_heuristic(3e30, 1e30) - 0.9).abs() < 1e-6);
        assert!((balance_heuristic(3e-30, 1e-30) - 0.75).abs() < 1e-6);
    }
}
