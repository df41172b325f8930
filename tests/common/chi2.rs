//! Pearson's χ² test of sampled directions against a density on the sphere.
//!
//! A [`Grid`] cuts the sphere into cells around an axis; densities are
//! integrated over its cells by adaptive quadrature and compared with counts
//! of samples. Cells with fewer than 5 expected samples are pooled.

#![allow(dead_code, reason = "each test file uses its part")]

use etendue::math::{Frame, Vec3};
use std::f64::consts::PI;

/// Cells of the sphere: rows of constant angle to an axis, columns of azimuth.
pub struct Grid {
    frame: Frame,
    /// Edges of the rows in 1 − cos θ, rising from 0 to 2.
    rows: Vec<f64>,
    columns: usize,
}

impl Grid {
    /// Rows of equal angle around `axis`; an even number puts an edge on the
    /// equator.
    pub fn uniform(axis: Vec3, rows: usize, columns: usize) -> Grid {
        let edge = |i: usize| 1.0 - (PI * i as f64 / rows as f64).cos();
        Grid { frame: Frame::from_normal(axis), rows: (0..=rows).map(edge).collect(), columns }
    }

    /// Rows whose distance from `axis` grows by a constant ratio from `width`
    /// (radians) on: resolves a narrow lobe and its surroundings.
    pub fn around(axis: Vec3, width: f64, rows: usize, columns: usize) -> Grid {
        let first = 0.5 * width * width;
        let ratio = (2.0 / first).powf(1.0 / (rows - 1) as f64);
        let mut edges = vec![0.0];
        edges.extend((0..rows).map(|i| if i == rows - 1 { 2.0 } else { first * ratio.powi(i as i32) }));
        Grid { frame: Frame::from_normal(axis), rows: edges, columns }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        (self.rows.len() - 1) * self.columns
    }

    /// The cell of the unit direction `w`.
    pub fn cell(&self, w: Vec3) -> usize {
        // 1 − cos θ = |w − axis|²/2 keeps its digits near the axis.
        let c = 0.5 * f64::from((w - self.frame.n).length_squared());
        let row = (self.rows.partition_point(|&edge| edge <= c).max(1) - 1).min(self.rows.len() - 2);
        let local = self.frame.to_local(w);
        let phi = f64::from(local.y).atan2(f64::from(local.x)).rem_euclid(2.0 * PI);
        let column = ((phi / (2.0 * PI) * self.columns as f64) as usize).min(self.columns - 1);
        row * self.columns + column
    }

    /// The integral of `density` over every cell, each to about `tolerance`.
    pub fn integrate(&self, density: &impl Fn(Vec3) -> f64, tolerance: f64) -> Vec<f64> {
        let mut integrals = Vec::with_capacity(self.len());
        for row in self.rows.windows(2) {
            for column in 0..self.columns {
                let step = 2.0 * PI / self.columns as f64;
                let phi = [column as f64 * step, (column + 1) as f64 * step];
                let unknown = (f64::INFINITY, tolerance, 8);
                integrals.push(self.refine(density, [row[0], row[1]], phi, unknown));
            }
        }
        integrals
    }

    /// Splits a rectangle of (1 − cos θ, φ) in four until the parts agree with
    /// the whole; `state` is the estimate so far, the tolerance and the depth
    /// left. The whole starts as unknown: a lobe that only enters a corner would
    /// be missed by both estimates.
    fn refine(&self, f: &impl Fn(Vec3) -> f64, c: [f64; 2], phi: [f64; 2], state: (f64, f64, u32)) -> f64 {
        let (coarse, tolerance, depth) = state;
        let (c_mid, phi_mid) = (0.5 * (c[0] + c[1]), 0.5 * (phi[0] + phi[1]));
        let mut parts = [([0.0; 2], [0.0; 2], 0.0); 4];
        for (i, part) in parts.iter_mut().enumerate() {
            let pc = if i & 1 == 0 { [c[0], c_mid] } else { [c_mid, c[1]] };
            let pp = if i & 2 == 0 { [phi[0], phi_mid] } else { [phi_mid, phi[1]] };
            *part = (pc, pp, self.quadrature(f, pc, pp));
        }
        let fine: f64 = parts.iter().map(|p| p.2).sum();
        if depth == 0 || (fine - coarse).abs() <= tolerance {
            return fine;
        }
        parts.iter().map(|p| self.refine(f, p.0, p.1, (p.2, 0.5 * tolerance, depth - 1))).sum()
    }

    /// Gauss-Legendre with 3 × 3 points; the element of (1 − cos θ, φ) is that
    /// of solid angle.
    fn quadrature(&self, f: &impl Fn(Vec3) -> f64, c: [f64; 2], phi: [f64; 2]) -> f64 {
        const NODES: [(f64, f64); 3] =
            [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
        let mut sum = 0.0;
        for (x, wx) in NODES {
            let c = c[0] + (c[1] - c[0]) * x;
            let sin = (c * (2.0 - c)).max(0.0).sqrt();
            for (y, wy) in NODES {
                let (s, k) = (phi[0] + (phi[1] - phi[0]) * y).sin_cos();
                let local = Vec3::new((sin * k) as f32, (sin * s) as f32, (1.0 - c) as f32);
                sum += wx * wy * f(self.frame.to_world(local).normalize());
            }
        }
        sum * (c[1] - c[0]) * (phi[1] - phi[0])
    }
}

/// Result of [`chi2`].
#[derive(Debug)]
pub struct Chi2 {
    /// Σ (observed − expected)²/expected over the pooled cells.
    pub statistic: f64,
    /// Pooled cells less one.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least as large; 0 when samples fall where
    /// next to none are expected.
    pub p_value: f64,
}

/// Compares counts with expected counts, cell by cell.
pub fn chi2(expected: &[f64], observed: &[u64]) -> Chi2 {
    assert_eq!(expected.len(), observed.len());
    let (mut statistic, mut cells, mut pool) = (0.0, 0, (0.0, 0));
    for (&e, &o) in expected.iter().zip(observed) {
        if e < 5.0 {
            pool.0 += e;
            pool.1 += o;
            continue;
        }
        statistic += (o as f64 - e).powi(2) / e;
        cells += 1;
    }
    if pool.0 >= 5.0 {
        statistic += (pool.1 as f64 - pool.0).powi(2) / pool.0;
        cells += 1;
    } else if pool.1 > 25 {
        return Chi2 { statistic: f64::INFINITY, degrees_of_freedom: cells, p_value: 0.0 };
    }
    let degrees_of_freedom = cells.max(2) - 1;
    Chi2 {
        statistic,
        degrees_of_freedom,
        p_value: upper_gamma(degrees_of_freedom as f64 / 2.0, statistic / 2.0),
    }
}

/// Significance of one test so that `tests` of them fail with probability
/// `alpha` together (Šidák).
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    -((1.0 - alpha).ln() / tests as f64).exp_m1()
}

/// Regularised upper incomplete gamma function Q(a, x): the series below
/// a + 1, Lentz's continued fraction above.
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-15 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - scale * sum;
    }
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    scale * h
}

/// ln Γ(x) for x > 0: Stirling's series after shifting x above 10.
fn ln_gamma(mut x: f64) -> f64 {
    let mut shift = 0.0;
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let i2 = 1.0 / (x * x);
    let series = (1.0 / 12.0 - i2 * (1.0 / 360.0 - i2 * (1.0 / 1260.0 - i2 / 1680.0))) / x;
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * PI).ln() + series
}

#[test]
fn gamma_functions_meet_known_values() {
    assert!((ln_gamma(0.5) - PI.sqrt().ln()).abs() < 1e-11);
    assert!((ln_gamma(6.0) - 120f64.ln()).abs() < 1e-11);
    // χ² with 2 degrees of freedom is exponential; with 10, 18.307 is 5 %.
    assert!((upper_gamma(1.0, 2.5) - (-2.5f64).exp()).abs() < 1e-11);
    assert!((upper_gamma(5.0, 18.307_038 / 2.0) - 0.05).abs() < 1e-7);
}

#[test]
fn a_wrong_density_is_found() {
    let grid = Grid::uniform(Vec3::Z, 10, 10);
    let sphere = grid.integrate(&|_| 0.25 / PI, 1e-9);
    assert!((sphere.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let expected: Vec<f64> = sphere.iter().map(|e| e * 1e4).collect();
    let right: Vec<u64> = expected.iter().map(|e| e.round() as u64).collect();
    assert!(chi2(&expected, &right).p_value > 0.99);
    let wrong: Vec<u64> =
        right.iter().enumerate().map(|(i, o)| if i < 50 { o * 6 / 5 } else { *o }).collect();
    assert!(chi2(&expected, &wrong).p_value < 1e-2);
    assert!((sidak(0.01, 100) - 1.005e-4).abs() < 1e-7);
}
