//! Examples of measured materials: rough metals tabulated in closed form, as
//! `tools/measured_file.py` does for files, and tables of odd contents.

use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::{Arc, LazyLock};

use super::examples::Named;
use super::fresnel::{fresnel_conductor, reflect};
use super::{Distribution, Measured, Microfacet};
use crate::color::conductor;
use crate::desc::{MeasuredData, Nodes};
use crate::math::{Rgb, Vec3};
use crate::sampling::{Blend, SlicedSquare};

pub(super) fn push(list: &mut Named) {
    static TABLES: LazyLock<Vec<(&str, Measured)>> = LazyLock::new(|| {
        let tables = materials().into_iter();
        tables.filter_map(|(name, data)| Some((name, Measured::new(Arc::new(data)).ok()?))).collect()
    });
    list.extend(TABLES.iter().map(|(name, table)| (format!("measured {name}"), table.into())));
}

fn materials() -> Vec<(&'static str, MeasuredData)> {
    let slants: Vec<f32> = [0.0, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0].map(|x| x * FRAC_PI_2).to_vec();
    let turns = |end: f32| (0..7).map(|i| -PI + (end + PI) * i as f32 / 6.0).collect::<Vec<f32>>();
    let gold = metal([0.4, 0.4], "Au", &slants, &[0.0]);
    let sharp = metal([0.12, 0.12], "Ag", &slants, &[0.0]);
    let copper = |end| metal([0.3, 0.6], "Cu", &slants, &turns(end));
    // What nothing fits: no light, none of the facets, one spot of them.
    let mut black = gold.clone();
    black.rgb.fill([0.0; 3]);
    black.luminance.values.fill(0.0);
    let mut odd = small();
    odd.vndf.values = vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let edges = MeasuredData { theta: vec![0.3, 0.9], phi: vec![-1.0, 2.0], ..repeated(&small(), 4) };
    vec![
        ("gold", gold),
        ("sharp silver", sharp),
        ("brushed copper, a quarter", copper(-FRAC_PI_2)),
        ("brushed copper, half", copper(0.0)),
        ("brushed copper, all", copper(PI)),
        ("black", black),
        ("of four nodes", small()),
        ("of one spot", odd),
        ("of four slices", edges),
    ]
}

/// One slice, of 3 × 3 nodes at most, without D/(4σ).
fn small() -> MeasuredData {
    let nodes = |side: u32, values: &[f32]| Nodes { size: [side; 2], values: values.to_vec() };
    MeasuredData {
        theta: vec![0.5],
        phi: vec![0.0],
        ndf: nodes(2, &[1.0; 4]),
        sigma: nodes(2, &[1.0; 4]),
        // None at the pole, where the density would grow so fast that part
        // of it lies between the directions of f32.
        vndf: nodes(3, &[0.0, 0.0, 0.0, 0.0, 2.0, 1.0, 0.0, 1.0, 3.0]),
        luminance: nodes(2, &[1.0, 0.5, 0.5, 1.0]),
        rgb_size: [2; 2],
        rgb: vec![[0.05, 0.04, 0.03], [0.02; 3], [0.03; 3], [0.05, 0.0, 0.0]],
        jacobian: false,
    }
}

/// The same for several slices.
fn repeated(data: &MeasuredData, slices: usize) -> MeasuredData {
    let mut all = data.clone();
    all.vndf.values = data.vndf.values.repeat(slices);
    all.luminance.values = data.luminance.values.repeat(slices);
    all.rgb = data.rgb.repeat(slices);
    all
}

/// A rough metal with separable shadowing; isotropic when there is one azimuth.
fn metal(alpha: [f32; 2], name: &str, theta: &[f32], phi: &[f32]) -> MeasuredData {
    const SIDE: u32 = 10;
    let (eta, k) = conductor(name).unwrap_or((Rgb::ZERO, Rgb::ONE));
    let facets = Microfacet::new(Distribution::Ggx, alpha[0], alpha[1]);
    let sigma = |w: Vec3| 1.0 / facets.visible_over_cos(w);
    let grid = |size: [u32; 2], of: &dyn Fn([f32; 2]) -> f32| Nodes { size, values: over(size, of) };
    let wide = [48, 25];
    let mut data = MeasuredData {
        theta: theta.to_vec(),
        phi: phi.to_vec(),
        ndf: grid(wide, &|u| facets.d(normal(u))),
        sigma: grid(wide, &|u| sigma(normal(u))),
        vndf: Nodes { size: wide, values: Vec::new() },
        luminance: Nodes { size: [SIDE; 2], values: Vec::new() },
        rgb_size: [SIDE; 2],
        rgb: Vec::new(),
        jacobian: true,
    };
    for phi in phi {
        for theta in theta {
            let wo = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos().max(0.0));
            let visible = over(wide, &|u: [f32; 2]| {
                let m = normal(u);
                facets.d(m) * wo.dot(m).max(0.0) * u[0] * m.truncate().length()
            });
            let Some(square) = SlicedSquare::new(wide[0] as usize, wide[1] as usize, &visible) else {
                continue;
            };
            let only = Blend::new(&[0.0], &[0.0], [0.0; 2]);
            for u in knots([SIDE; 2]) {
                let m = normal(square.sample(&only, u));
                let cos = wo.dot(m).clamp(0.0, 1.0);
                let wi = reflect(wo, m);
                let shadow = if wi.z > 0.0 { facets.g1(wi) } else { 0.0 };
                let value = fresnel_conductor(cos, eta, k) * shadow;
                data.rgb.push(value.to_array());
                data.luminance.values.push(value.element_sum());
            }
            data.vndf.values.extend(visible);
        }
    }
    data
}

fn normal([u1, u2]: [f32; 2]) -> Vec3 {
    let ((sin, cos), (y, x)) = ((FRAC_PI_2 * u1 * u1).sin_cos(), (PI * (2.0 * u2 - 1.0)).sin_cos());
    Vec3::new(sin * x, sin * y, cos.max(0.0))
}

/// The nodes of a grid, row by row.
fn knots([columns, rows]: [u32; 2]) -> impl Iterator<Item = [f32; 2]> {
    let at = |i: u32, n: u32| i as f32 / (n - 1) as f32;
    (0..rows).flat_map(move |j| (0..columns).map(move |i| [at(i, columns), at(j, rows)]))
}

fn over(size: [u32; 2], of: &dyn Fn([f32; 2]) -> f32) -> Vec<f32> {
    knots(size).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_made() {
        for (name, data) in materials() {
            assert_eq!(data.check(), Ok(()), "{name}");
        }
        let mut list = Vec::new();
        push(&mut list);
        assert_eq!(list.len(), materials().len());
    }
}
