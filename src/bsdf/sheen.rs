//! Sheen of cloth: the Charlie distribution, D = (2 + 1/α)·sinᐟᵅθ/2π, with the
//! shadowing fit of Estevez and Kulla 2017, "Production Friendly Microfacet
//! Sheen BRDF", as `KHR_materials_sheen` states it; α is roughness².
//!
//! At grazing the fit returns more than it receives; there it is scaled down.
//! Below roughness 0.05 the lobe lies within a degree of grazing and what is
//! left of it is nothing to be seen; it is held there.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use super::energy::{bilinear, cell};
use super::quadrature::gauss_legendre;
use crate::math::{Vec2, Vec3};
use crate::sampling::concentric_disk;

/// Points per axis of the table of albedos: cosine, roughness.
const N: usize = 24;
/// Least roughness.
const LEAST: f32 = 0.05;

static ALBEDO: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let nodes = gauss_legendre(96);
    let around = 48;
    let mut table = Vec::with_capacity(N * N);
    for row in 0..N {
        let roughness = row as f32 / (N - 1) as f32;
        for column in 0..N {
            let z = (column as f32 / (N - 1) as f32).powi(2).max(1e-4);
            let wo = super::energy::direction(z, 0.0);
            let mut sum = 0.0;
            for &(t, weight) in &nodes {
                for j in 0..around {
                    let phi = PI * (j as f32 + 0.5) / around as f32;
                    // Most of it is at grazing, and forward.
                    let cos = (t * t) as f32;
                    let wi = super::energy::direction(cos, PI - phi * phi / PI);
                    let jacobian = 2.0 * t * f64::from(2.0 * phi / PI);
                    sum += weight * jacobian * f64::from(charlie(wo, wi, roughness));
                }
            }
            table.push((sum * f64::from(TAU) / f64::from(around)) as f32);
        }
    }
    table
});

/// f·cos θi of white sheen as the extension has it, both directions above.
fn charlie(wo: Vec3, wi: Vec3, roughness: f32) -> f32 {
    let alpha = roughness.clamp(LEAST, 1.0).powi(2);
    let h = wo + wi;
    let sin2 = (h.x * h.x + h.y * h.y) / h.length_squared().max(f32::MIN_POSITIVE);
    let d = (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) / TAU;
    let shadow = 1.0 + lambda(wo.z, alpha) + lambda(wi.z, alpha);
    d / (4.0 * shadow * wo.z.max(1e-6))
}

/// Λ of the fit.
fn lambda(cos: f32, alpha: f32) -> f32 {
    let t = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f32, smooth: f32| rough + (smooth - rough) * t;
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    let l = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    // Directions are unit to rounding, so that a cosine may be above 1.
    if cos < 0.5 { l(cos.max(0.0)).exp() } else { (2.0 * l(0.5) - l((1.0 - cos).max(0.0))).exp() }
}

/// Share of light that white sheen would scatter at a cosine in [0, 1]: up to
/// 2.5 at grazing. A percent more than it is, against the steps of the table.
pub(super) fn sheen_albedo(cos: f32, roughness: f32) -> f32 {
    1.01 * bilinear(&ALBEDO, N, cell(roughness.max(LEAST), N), cell(cos.sqrt(), N))
}

/// f·cos θi of white sheen, given [`sheen_albedo`] of both directions: where
/// one is above 1 the sheen is divided by it.
pub(super) fn sheen(wo: Vec3, wi: Vec3, roughness: f32, albedos: (f32, f32)) -> f32 {
    charlie(wo, wi, roughness) / (albedos.0.max(1.0) * albedos.1.max(1.0))
}

/// A direction above, uniform: density 1/2π.
pub(super) fn uniform_hemisphere(u: Vec2) -> Vec3 {
    let disk = concentric_disk(u);
    let r2 = disk.length_squared();
    let scale = (2.0 - r2).max(0.0).sqrt();
    Vec3::new(disk.x * scale, disk.y * scale, 1.0 - r2)
}
