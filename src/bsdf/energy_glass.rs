//! How much light a rough solid dielectric loses at the first bounce, from
//! both sides, and how the lost light is given back.
//!
//! With reflectance F = f₀(1 − s) + f₉₀·s of a facet (1 under total
//! reflection) the loss is K + f₀·Dₐ + f₉₀·D_b: K what is lost when nothing is
//! reflected that can be refracted. Lost light comes back on both sides as a
//! wide lobe (Kulla and Conty 2017), divided so that it may go either way:
//! the transmitted part is T̄·min(⟨lossₒ⟩, ⟨lossᵢ⟩)/⟨loss⟩ on the rarer side
//! and over η² on the denser.

use super::energy::{
    SLACK, bilinear, cell, diffuse_mean, direction, schlick, square, stretched, unstretched,
};
use super::fresnel::reflect;
use super::microfacet::{Distribution, Microfacet};
use crate::math::{Vec2, Vec3};

/// Points per axis: x, √α.
const N: usize = 36;
/// Points of the tables of means.
const MEANS: usize = 97;

/// Tables of one index of refraction; made once per index, in a third of
/// a second.
#[derive(Clone, Debug)]
pub struct GlassTable {
    eta: f32,
    outside: Side,
    inside: Side,
}

/// Losses on one side of the interface: K, Dₐ, D_b.
#[derive(Clone, Debug)]
struct Side {
    loss: [Vec<f32>; 3],
    means: [Vec<f32>; 3],
}

/// What lost light does on one side.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GlassMeans {
    /// Mean losses outside and inside.
    pub loss: [f32; 2],
    /// Shares of the lost light that are transmitted, from outside and inside.
    pub transmitted: [f32; 2],
}

impl GlassTable {
    /// For `eta` = η inside over outside, positive.
    #[must_use]
    pub fn new(eta: f32) -> GlassTable {
        GlassTable { eta, outside: Side::new(eta), inside: Side::new(1.0 / eta) }
    }

    /// η inside over outside.
    #[must_use]
    pub fn eta(&self) -> f32 {
        self.eta
    }

    fn side(&self, outside: bool) -> &Side {
        if outside { &self.outside } else { &self.inside }
    }

    /// Loss at a cosine in [0, 1] for roughness √α and reflectances f₀, f₉₀.
    pub(super) fn loss(&self, outside: bool, cos: f32, roughness: f32, (f0, f90): (f32, f32)) -> f32 {
        let [k, a, b] = self.side(outside).at(cos, roughness);
        (k + f0 * a + f90 * b).max(0.0)
    }

    /// Means of the loss and how it divides.
    pub(super) fn means(&self, roughness: f32, (f0, f90): (f32, f32)) -> GlassMeans {
        let mean = |outside: bool| {
            let [k, a, b] = self.side(outside).means(roughness);
            (k + f0 * a + f90 * b).max(1e-9)
        };
        let loss = [mean(true), mean(false)];
        // Mean of what the rarer side transmits.
        let open = 1.0 - (f0 + (f90 - f0) / 21.0);
        let shared = open * loss[0].min(loss[1]);
        let (rare, dense) = if self.eta >= 1.0 { (0, 1) } else { (1, 0) };
        let n = self.eta.max(1.0 / self.eta);
        let mut transmitted = [0.0; 2];
        transmitted[rare] = shared / loss[rare];
        transmitted[dense] = shared / (n * n * loss[dense]);
        GlassMeans { loss, transmitted }
    }
}

impl Side {
    /// `eta` is that of the far side over the near one.
    fn new(eta: f32) -> Side {
        let points = square(96, 24, true);
        let mut loss: [Vec<f32>; 3] = Default::default();
        for row in 0..N {
            let roughness = row as f32 / (N - 1) as f32;
            let alpha = (roughness * roughness).max(1e-4);
            let distribution = Microfacet::new(Distribution::Ggx, alpha, alpha);
            for column in 0..N {
                let w = direction(unstretched(column as f32 / (N - 1) as f32, alpha), 0.0);
                let found = lost(&distribution, w, eta, &points);
                for (table, value) in loss.iter_mut().zip(found) {
                    table.push(value as f32);
                }
            }
        }
        let mut side = Side { loss, means: Default::default() };
        let roughness = |i: usize| i as f32 / (MEANS - 1) as f32;
        side.means = std::array::from_fn(|channel| {
            (0..MEANS).map(|i| diffuse_mean(|mu| side.at(mu, roughness(i))[channel])).collect()
        });
        side
    }

    fn at(&self, cos: f32, roughness: f32) -> [f32; 3] {
        let (row, column) = (cell(roughness, N), cell(stretched(cos, roughness * roughness), N));
        [0, 1, 2].map(|channel: usize| bilinear(&self.loss[channel], N, row, column))
    }

    fn means(&self, roughness: f32) -> [f32; 3] {
        let (i, u) = cell(roughness, MEANS);
        [0, 1, 2].map(|channel: usize| {
            let table = &self.means[channel];
            table[i] + u * (table[i + 1] - table[i])
        })
    }
}

/// K, Dₐ and D_b for light towards `w`.
fn lost(distribution: &Microfacet, w: Vec3, eta: f32, points: &[(Vec2, f64)]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for &(u, weight) in points {
        let m = distribution.sample(w, u);
        let cos = w.dot(m);
        let wi = reflect(w, m);
        let reflected = if wi.z > 0.0 { distribution.g1(wi) } else { 0.0 };
        let cos2 = 1.0 - (1.0 - cos * cos) / (eta * eta);
        if cos2 <= 0.0 {
            sums[0] += weight * f64::from(1.0 - reflected);
            continue;
        }
        let cos_t = cos2.sqrt();
        let wi = m * (cos / eta - cos_t) - w / eta;
        // Without a bend there is nothing rough to be shadowed by.
        let transmitted = match wi.z < 0.0 {
            _ if eta == 1.0 => 1.0,
            true => distribution.g1(wi),
            false => 0.0,
        };
        let s = schlick(if eta >= 1.0 { cos } else { cos_t });
        let difference = weight * f64::from(transmitted - reflected);
        sums[0] += weight * f64::from(1.0 - transmitted);
        sums[1] += difference * f64::from(1.0 - s);
        sums[2] += difference * f64::from(s);
    }
    sums[0] -= SLACK.min(0.4 * sums[0]);
    sums
}
