//! How much light a clear coat takes from what lies under it.
//!
//! Under a coat that reflects E(w) of light from w, the base keeps
//! 1 − c·max(E(wo), E(wi)), c the weight of the coat: what a smooth coat on a
//! mirror lets through once light that is thrown to and fro between them is
//! counted, and the same both ways. A rough base then keeps
//! A·(1 − c·E(wo)·Y) of what it would reflect without the coat, and the same
//! for B with another Y; Y − 1 and the means over diffuse light are tabulated over both roughnesses, on first
//! use, so that the rest can be given back.

use std::sync::LazyLock;

use super::energy::{GGX, Row, Split, bilinear, cell, diffuse_mean, direction, multiple, schlick, square};
use super::fresnel::reflect;
use super::microfacet::{Distribution, Microfacet};
use crate::math::{Rgb, Vec2, Vec3};

/// Reflectance of the coat at the normal: its index is 1.5.
pub(super) const COAT_F0: f32 = 0.04;
/// Points over √α of the base and of the coat.
const N: usize = 14;
/// Points over the cosine.
const COSINES: usize = 24;

/// Tables of all coats.
pub(super) struct CoatEnergy {
    /// Y − 1 for A and B of the base: for each coat a table of rows of the
    /// base and columns of the cosine.
    excess: Vec<[Vec<f32>; 2]>,
    /// Means of E, E·Y·A and E·Y·B; rows of the coat, columns of the base.
    means: [Vec<f32>; 3],
}

/// Means over diffuse light: of E, and of E·Y times A and B of the base.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CoatMeans {
    pub coat: f32,
    pub a: f32,
    pub b: f32,
}

/// The tables; filled only where a scene has a coat.
pub(super) static COATS: LazyLock<CoatEnergy> = LazyLock::new(CoatEnergy::new);

/// What a coat reflects more than once, F̂.
pub(super) fn coat_multiple(roughness: f32) -> f32 {
    multiple(Rgb::splat(COAT_F0), 1.0, GGX.mean(roughness).loss).x
}

/// E: what a coat of full weight reflects at a cosine in [0, 1].
pub(super) fn coat_albedo(cos: f32, row: Row, multiple: f32) -> f32 {
    let split = GGX.at(cos, row);
    COAT_F0 * split.a() + split.b + multiple * split.loss
}

impl CoatEnergy {
    fn new() -> CoatEnergy {
        let points = square(40, 12, true);
        let part = |i: usize| i as f32 / (N - 1) as f32;
        let mut energy = CoatEnergy { excess: Vec::with_capacity(N), means: Default::default() };
        for coat in (0..N).map(part) {
            let coat = (Row::new(coat), coat_multiple(coat));
            let mut tables: [Vec<f32>; 2] = Default::default();
            for base in (0..N).map(part) {
                let distribution = Microfacet::new(Distribution::Ggx, base * base, base * base);
                for i in 0..COSINES {
                    let cos = (i as f32 / (COSINES - 1) as f32).max(1e-4);
                    let y = excess(&distribution, direction(cos, 0.0), coat, &points);
                    tables[0].push(y[0]);
                    tables[1].push(y[1]);
                }
            }
            energy.excess.push(tables);
        }
        let mut means: [Vec<f32>; 3] = Default::default();
        for coat in (0..N).map(part) {
            let (row, hat) = (Row::new(coat), coat_multiple(coat));
            for base in (0..N).map(part) {
                let weighted = |f: &dyn Fn(Split, (f32, f32)) -> f32| {
                    diffuse_mean(|mu| {
                        let y = energy.ratio(mu, base, coat);
                        coat_albedo(mu, row, hat) * f(GGX.at(mu, Row::new(base)), y)
                    })
                };
                means[0].push(diffuse_mean(|mu| coat_albedo(mu, row, hat)));
                means[1].push(weighted(&|split, y| split.a() * y.0));
                means[2].push(weighted(&|split, y| split.b * y.1));
            }
        }
        energy.means = means;
        energy
    }

    /// Y ≥ 1 at a cosine for A and B, for the roughnesses √α of base and coat.
    pub(super) fn ratio(&self, cos: f32, base: f32, coat: f32) -> (f32, f32) {
        let (k, f) = cell(coat, N);
        let (row, column) = (cell(base, N), cell(cos, COSINES));
        let at = |channel: usize| {
            let table = |k: usize| bilinear(&self.excess[k][channel], COSINES, row, column);
            let low = table(k);
            1.0 + low + f * (table(k + 1) - low)
        };
        (at(0), at(1))
    }

    /// Means over diffuse light.
    pub(super) fn means(&self, base: f32, coat: f32) -> CoatMeans {
        let at = |i: usize| bilinear(&self.means[i], N, cell(coat, N), cell(base, N));
        CoatMeans { coat: at(0), a: at(1), b: at(2) }
    }
}

/// Y − 1 for A and B of a base seen from `w` under a coat.
fn excess(distribution: &Microfacet, w: Vec3, (coat, hat): (Row, f32), points: &[(Vec2, f64)]) -> [f32; 2] {
    let here = coat_albedo(w.z, coat, hat);
    let (mut all, mut taken) = ([0.0f64; 2], [0.0f64; 2]);
    for &(u, weight) in points {
        let m = distribution.sample(w, u);
        let wi = reflect(w, m);
        if wi.z > 0.0 {
            let g = weight * f64::from(distribution.g1(wi));
            let most = f64::from(here.max(coat_albedo(wi.z, coat, hat)));
            let s = f64::from(schlick(w.dot(m)));
            for (i, share) in [1.0 - s, s].into_iter().enumerate() {
                all[i] += g * share;
                taken[i] += g * share * most;
            }
        }
    }
    [0, 1].map(|i: usize| {
        let y = taken[i] / (all[i] * f64::from(here));
        if y.is_finite() { (y - 1.0).max(0.0) as f32 } else { 0.0 }
    })
}
