//! Gauss-Legendre quadrature, for tables made once per material.

/// Points and weights of Gauss-Legendre quadrature over [0, 1], rising:
/// Newton's method on the Legendre polynomial of degree `n`.
pub(super) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = -((i as f64 + 0.75) / (n as f64 + 0.5) * std::f64::consts::PI).cos();
            let mut derivative = 1.0;
            for _ in 0..8 {
                let (mut previous, mut value) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (previous, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k);
                }
                derivative = n as f64 * (x * value - previous) / (x * x - 1.0);
                x -= value / derivative;
            }
            (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * derivative * derivative))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        for n in [32, 128] {
            let nodes = gauss_legendre(n);
            let integral = |p: i32| nodes.iter().map(|&(x, w)| w * x.powi(p)).sum::<f64>();
            for p in [0, 1, 5, 40] {
                assert!((integral(p) - 1.0 / f64::from(p + 1)).abs() < 1e-13, "{n} {p}");
            }
            assert!(nodes.is_sorted_by(|a, b| a.0 < b.0));
        }
    }
}
