//! How much light a rough GGX surface scatters back at the first bounce, by
//! direction: what energy compensation is made of.
//!
//! With Schlick's F = f₀(1 − s) + f₉₀·s, s = (1 − ⟨w, m⟩)⁵, the share that is
//! reflected once is f₀·A + f₉₀·B, where A + B = 1 − loss. What is lost comes
//! back as a wide lobe (Kulla and Conty 2017):
//! f = F̂·loss(wo)·loss(wi)/(π·⟨loss⟩), F̂ = F̄²(1 − ⟨loss⟩)/(1 − F̄⟨loss⟩).
//!
//! The tables are filled by quadrature over visible normals on first use,
//! about 0.1 s. Near grazing everything depends on cos/α, so they are kept
//! over x = ½·cos + ½·cos(1 + α)/(cos + α) and √α. Beside the loss that is
//! δ = ((B/(A + B))^⅕ − (1 − cos))/α, 0 for a mirror before the division; and of the mean
//! loss, which falls as α², its fourth root.

use std::ops::{Add, Mul, Sub};
use std::sync::LazyLock;

use super::fresnel::reflect;
use super::microfacet::{Distribution, Microfacet};
use super::quadrature::gauss_legendre;
use crate::math::{ONE_MINUS_EPSILON, Rgb, Vec2, Vec3};

/// Points per axis.
const N: usize = 48;
/// Points of the tables of means.
const MEANS: usize = 257;
/// Points per axis of the anisotropic table: the stretched cosine, α seen from
/// there between its two extremes, √α along x, α along y over that along x.
const ANISOTROPIC: [usize; 4] = [16, 6, 24, 10];
/// Points per axis of the table of its means.
const FINE: usize = 33;
/// Taken off every tabulated loss, which linear interpolation overestimates:
/// what is given back must not be too much.
pub(super) const SLACK: f64 = 8e-4;
/// Least roughness α of the tables: below it nothing changes in x.
const LEAST: f32 = 1e-4;

/// A share of scattered light, split as Schlick's reflectance is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Split {
    /// What is lost without compensation, F being 1.
    pub loss: f32,
    /// The part that goes with f₉₀.
    pub b: f32,
}

impl Split {
    /// The part that goes with f₀.
    pub(super) fn a(self) -> f32 {
        (1.0 - self.loss - self.b).max(0.0)
    }
}

/// GGX with Smith shadowing, over direction and roughness.
pub(super) struct GgxEnergy {
    loss: Vec<f32>,
    delta: Vec<f32>,
    means: Vec<Split>,
}

/// The same surface, isotropic: for every material.
pub(super) static GGX: LazyLock<GgxEnergy> = LazyLock::new(GgxEnergy::new);
/// An anisotropic one; filled only where a scene has one.
pub(super) static ANISOTROPIC_GGX: LazyLock<AnisotropicEnergy> = LazyLock::new(AnisotropicEnergy::new);

/// A roughness √α in [0, 1] as a place in the tables.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row {
    alpha: f32,
    index: u16,
    /// Place between two rows, by α: the loss grows as its square.
    place: f32,
}

impl Row {
    pub(super) fn new(roughness: f32) -> Row {
        let (index, _) = cell(roughness, N);
        let alpha = roughness * roughness;
        let node = |i: usize| (i as f32 / (N - 1) as f32).powi(2);
        let place = (alpha - node(index)) / (node(index + 1) - node(index));
        Row { alpha, index: index as u16, place: place.clamp(0.0, 1.0) }
    }

    #[inline]
    fn cell(self) -> (usize, f32) {
        (usize::from(self.index), self.place)
    }
}

/// (1 − c)⁵ for a cosine in [0, 1].
#[inline]
pub(super) fn schlick(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

/// The cell of `x` in [0, 1] among `n` points, and the place in it.
#[inline]
pub(super) fn cell(x: f32, n: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as usize).min(n - 2);
    (i, x - i as f32)
}

/// Bilinear value at a point of a table of rows of `n`.
#[inline]
pub(super) fn bilinear<T>(table: &[T], n: usize, (row, v): (usize, f32), (column, u): (usize, f32)) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let at = |r: usize| {
        let i = r * n + column;
        table[i] + (table[i + 1] - table[i]) * u
    };
    let (low, high) = (at(row), at(row + 1));
    low + (high - low) * v
}

/// The coordinate over which the loss is smooth for any roughness.
#[inline]
pub(super) fn stretched(cos: f32, alpha: f32) -> f32 {
    0.5 * if alpha < LEAST { 1.0 + cos } else { cos + cos * (1.0 + alpha) / (cos + alpha) }
}

/// The cosine of a [`stretched`] coordinate.
pub(super) fn unstretched(x: f32, alpha: f32) -> f32 {
    let (x, alpha) = (2.0 * f64::from(x), f64::from(alpha));
    let half = 0.5 * (1.0 + 2.0 * alpha - x);
    // The positive root, without cancellation.
    let root = (half * half + x * alpha).sqrt();
    let cos = if half > 0.0 { x * alpha / (half + root) } else { root - half };
    (cos as f32).clamp(1e-6, 1.0)
}

/// The direction in the plane of azimuth `phi` with a given cosine.
pub(super) fn direction(cos: f32, phi: f32) -> Vec3 {
    let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
    let (s, c) = phi.sin_cos();
    Vec3::new(sin * c, sin * s, cos)
}

/// Points and weights on the unit square for visible normals: over half the
/// azimuth when that is enough by symmetry.
pub(super) fn square(along: usize, around: usize, half: bool) -> Vec<(Vec2, f64)> {
    let span = if half { 0.5 } else { 1.0 };
    let mut points = Vec::with_capacity(along * around);
    for (t, weight) in gauss_legendre(along) {
        // Slanted normals are near 1: there the points are dense.
        let (y, jacobian) = (1.0 - (1.0 - t) * (1.0 - t), 2.0 * (1.0 - t));
        for j in 0..around {
            let x = span * (j as f64 + 0.5) / around as f64;
            points.push((
                Vec2::new(x as f32, (y as f32).min(ONE_MINUS_EPSILON)),
                jacobian * weight / around as f64,
            ));
        }
    }
    points
}

/// Means over visible normals from `w` of what facets reflect, times 1 and s.
fn reflected(distribution: &Microfacet, w: Vec3, points: &[(Vec2, f64)]) -> (f64, f64) {
    points.iter().fold((0.0, 0.0), |(e, b), &(u, weight)| {
        let m = distribution.sample(w, u);
        let wi = reflect(w, m);
        let g = if wi.z > 0.0 { weight * f64::from(distribution.g1(wi)) } else { 0.0 };
        (e + g, b + g * f64::from(schlick(w.dot(m))))
    })
}

/// 2∫ f(μ) μ dμ: the mean over diffuse light.
pub(super) fn diffuse_mean(f: impl Fn(f32) -> f32) -> f32 {
    static NODES: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(48));
    let sum: f64 = NODES
        .iter()
        .map(|&(t, weight)| {
            // μ = t³ puts points where the loss rises, at grazing.
            let mu = t * t * t;
            weight * 3.0 * t * t * mu * f64::from(f(mu as f32))
        })
        .sum();
    (2.0 * sum) as f32
}

impl GgxEnergy {
    fn new() -> GgxEnergy {
        let points = square(80, 12, true);
        let (mut loss, mut delta) = (Vec::with_capacity(N * N), Vec::with_capacity(N * N));
        for row in 0..N {
            let roughness = row as f32 / (N - 1) as f32;
            let alpha = (roughness * roughness).max(LEAST);
            let distribution = Microfacet::new(Distribution::Ggx, alpha, alpha);
            for column in 0..N {
                let cos = unstretched(column as f32 / (N - 1) as f32, alpha);
                let (e, b) = reflected(&distribution, direction(cos, 0.0), &points);
                loss.push((1.0 - e - SLACK).max(0.0) as f32);
                delta.push(((b / e).max(0.0).powf(0.2) as f32 - (1.0 - cos)) / alpha);
            }
        }
        let mut energy = GgxEnergy { loss, delta, means: Vec::new() };
        energy.means = (0..MEANS)
            .map(|i| {
                let row = Row::new(i as f32 / (MEANS - 1) as f32);
                Split {
                    loss: diffuse_mean(|mu| energy.at(mu, row).loss).sqrt().sqrt(),
                    b: diffuse_mean(|mu| energy.at(mu, row).b),
                }
            })
            .collect();
        energy
    }

    /// At a cosine in [0, 1].
    #[inline]
    pub(super) fn at(&self, cos: f32, row: Row) -> Split {
        let column = cell(stretched(cos, row.alpha), N);
        let loss = bilinear(&self.loss, N, row.cell(), column);
        Split { loss, b: (1.0 - loss) * self.share(cos, row, column) }
    }

    /// B/(A + B).
    #[inline]
    fn share(&self, cos: f32, row: Row, column: (usize, f32)) -> f32 {
        share(cos, row.alpha * bilinear(&self.delta, N, row.cell(), column))
    }

    /// The mean over diffuse light.
    #[inline]
    pub(super) fn mean(&self, roughness: f32) -> Split {
        let (i, u) = cell(roughness, MEANS);
        let (low, high) = (self.means[i], self.means[i + 1]);
        let root = low.loss + u * (high.loss - low.loss);
        let root2 = root * root;
        Split { loss: root2 * root2, b: low.b + u * (high.b - low.b) }
    }
}

/// B/(A + B) for a cosine and α·δ.
#[inline]
fn share(cos: f32, delta: f32) -> f32 {
    let beta = (1.0 - cos + delta).clamp(0.0, 1.0);
    let beta2 = beta * beta;
    beta2 * beta2 * beta
}

/// F̂: the colour of what is scattered more than once, for Schlick's f₀, f₉₀.
pub(super) fn multiple(f0: Rgb, f90: f32, mean_loss: f32) -> Rgb {
    let f = f0 + (Rgb::splat(f90) - f0) / 21.0;
    let denominator = Rgb::ONE - f * mean_loss;
    f * f * (1.0 - mean_loss) / denominator.max(Rgb::splat(1e-6))
}

/// A GGX surface of two roughnesses, over all directions: loss and δ, and the
/// fourth root of the mean loss and the mean B.
pub(super) struct AnisotropicEnergy {
    table: Vec<Vec2>,
    means: Vec<Vec2>,
}

impl AnisotropicEnergy {
    fn new() -> AnisotropicEnergy {
        let [nx, n_phi, nu, nv] = ANISOTROPIC;
        let points = square(40, 24, false);
        let mut table = Vec::with_capacity(nx * n_phi * nu * nv);
        for v in 0..nv {
            for u in 0..nu {
                let alpha = (u as f32 / (nu - 1) as f32).powi(2);
                let alpha = Vec2::new(alpha, alpha * (v as f32 / (nv - 1) as f32)).max(Vec2::splat(LEAST));
                let distribution = Microfacet::new(Distribution::Ggx, alpha.x, alpha.y);
                for j in 0..n_phi {
                    let projected = alpha.y + (alpha.x - alpha.y) * j as f32 / (n_phi - 1) as f32;
                    let difference = (alpha.x - alpha.y) * (alpha.x + alpha.y);
                    let cos2 = (projected - alpha.y) * (projected + alpha.y) / difference.max(1e-12);
                    let phi = (1.0 - cos2).max(0.0).sqrt().atan2(cos2.sqrt());
                    for i in 0..nx {
                        let cos = unstretched(i as f32 / (nx - 1) as f32, projected);
                        let (e, b) = reflected(&distribution, direction(cos, phi), &points);
                        // This table is coarser.
                        let loss = (1.0 - e - 1.5 * SLACK).max(0.0);
                        let delta =
                            ((b / e).max(0.0).powf(0.2) - (1.0 - f64::from(cos))) / f64::from(alpha.x);
                        table.push(Vec2::new(loss as f32, delta as f32));
                    }
                }
            }
        }
        let mut energy = AnisotropicEnergy { table, means: Vec::new() };
        energy.means = (0..FINE * FINE)
            .map(|k| {
                let part = |i: usize| i as f32 / (FINE - 1) as f32;
                let (u, ratio) = (part(k % FINE), part(k / FINE));
                // Where one roughness vanishes a little of it makes a difference.
                let roughness = Vec2::new(u, u * ratio);
                let turns = 24;
                let at_turn = |j: usize| {
                    let phi = (j as f32 + 0.5) / turns as f32 * std::f32::consts::FRAC_PI_2;
                    let at = |mu: f32| energy.at(direction(mu, phi), roughness);
                    Vec2::new(diffuse_mean(|mu| at(mu).loss), diffuse_mean(|mu| at(mu).b))
                };
                let mean = (0..turns).map(at_turn).sum::<Vec2>() / turns as f32;
                Vec2::new(mean.x.sqrt().sqrt(), mean.y)
            })
            .collect();
        energy
    }

    /// Towards `w` (w.z > 0) for roughnesses √α along x and, not more, along y.
    pub(super) fn at(&self, w: Vec3, roughness: Vec2) -> Split {
        let [nx, n_phi, nu, nv] = ANISOTROPIC;
        let alpha = (roughness * roughness).max(Vec2::splat(LEAST));
        let projected = along(alpha, w);
        let x = cell(stretched(w.z, projected), nx);
        let phi = cell((projected - alpha.y) / (alpha.x - alpha.y).max(1e-9), n_phi);
        let ((u, _), (v, fv)) = (cell(roughness.x, nu), cell(alpha.y / alpha.x, nv));
        // The loss grows as α² rather than as its root.
        let node = |u: usize| (u as f32 / (nu - 1) as f32).powi(2);
        let fu = ((alpha.x - node(u)) / (node(u + 1) - node(u))).clamp(0.0, 1.0);
        let at = |u: usize, v: usize| {
            let start = (v * nu + u) * n_phi * nx;
            bilinear(&self.table[start..start + n_phi * nx], nx, phi, x)
        };
        let row = |v: usize| at(u, v) * (1.0 - fu) + at(u + 1, v) * fu;
        let Vec2 { x: loss, y: delta } = row(v) * (1.0 - fv) + row(v + 1) * fv;
        let b = (1.0 - loss) * share(w.z, alpha.x * delta);
        // Interpolated B may be too small: what the base gets must not be too much.
        Split { loss, b: (b + 0.5 * SLACK as f32).min(1.0 - loss) }
    }

    /// The mean of that over diffuse light.
    pub(super) fn mean(&self, roughness: Vec2) -> Split {
        let alpha = (roughness * roughness).max(Vec2::splat(LEAST));
        let ratio = (alpha.y / alpha.x).sqrt();
        let mean = bilinear(&self.means, FINE, cell(ratio, FINE), cell(roughness.x, FINE));
        Split { loss: mean.x.powi(4), b: mean.y }
    }
}

/// The roughness α seen from the azimuth of `w`.
fn along(alpha: Vec2, w: Vec3) -> f32 {
    let sin2 = w.x * w.x + w.y * w.y;
    if sin2 > 0.0 {
        ((alpha.x * w.x).powi(2) + (alpha.y * w.y).powi(2)).sqrt() / sin2.sqrt()
    } else {
        alpha.x.max(alpha.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_meet_a_finer_quadrature() {
        let points = square(160, 64, true);
        let mut worst = [0.0f64; 2];
        for roughness in [0.02f32, 0.07, 0.11, 0.2, 0.3, 0.45, 0.62, 0.8, 0.93, 1.0] {
            let alpha = roughness * roughness;
            let distribution = Microfacet::new(Distribution::Ggx, alpha, alpha);
            for cos in [1e-4f32, 1e-3, 0.0175, 0.05, 0.087, 0.13, 0.26, 0.4, 0.5, 0.71, 0.85, 0.94, 1.0] {
                let (e, b) = reflected(&distribution, direction(cos, 0.0), &points);
                let found = GGX.at(cos, Row::new(roughness));
                let errors = [1.0 - e - f64::from(found.loss), b - f64::from(found.b)];
                for (worst, error) in worst.iter_mut().zip(errors) {
                    *worst = worst.max(error.abs());
                }
            }
        }
        assert!(worst[0] < 2e-3 && worst[1] < 1.5e-3, "{worst:?}");
    }

    #[test]
    fn the_stretched_coordinate_turns_back() {
        for alpha in [1e-4f32, 1e-2, 0.3, 1.0] {
            for cos in [1e-5f32, 1e-3, 0.1, 0.7, 1.0] {
                let back = unstretched(stretched(cos, alpha), alpha);
                assert!((back - cos).abs() < 1e-4 * cos + 2e-6, "{alpha} {cos} {back}");
            }
        }
    }

    #[test]
    fn anisotropic_table_meets_a_finer_quadrature() {
        let points = square(80, 160, false);
        let mut worst = [0.0f64; 2];
        for (u, v) in
            [(0.5f32, 0.3), (0.8, 0.4), (1.0, 0.4), (0.95, 0.8), (0.6, 0.6), (0.33, 0.05), (1.0, 1.0)]
        {
            let distribution = Microfacet::new(Distribution::Ggx, u * u, v * v);
            for cos in [1e-3f32, 0.05, 0.26, 0.5, 0.71, 0.94, 1.0] {
                for phi in [0.0, 0.4, 0.9, 1.3, 1.57] {
                    let w = direction(cos, phi);
                    let (e, b) = reflected(&distribution, w, &points);
                    let found = ANISOTROPIC_GGX.at(w, Vec2::new(u, v));
                    let errors = [1.0 - e - f64::from(found.loss), b - f64::from(found.b)];
                    for (worst, error) in worst.iter_mut().zip(errors) {
                        *worst = worst.max(error.abs());
                    }
                }
            }
        }
        assert!(worst[0] < 4e-3 && worst[1] < 8e-3, "{worst:?}");
    }
}
