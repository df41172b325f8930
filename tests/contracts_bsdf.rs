//! What every bsdf promises, checked on every example of every kind: `sample`
//! follows `pdf`, which integrates to 1; weight = eval/pdf; reciprocity;
//! no more light out than in; finite for any input; and the values of
//! Mitsuba 3.9.1.

mod common;

use std::sync::Arc;

use common::chi2::{Grid, chi2, sidak};
use etendue::bsdf::{
    Bsdf, BsdfSample, Coat, Conductor, Dielectric, Diffuse, Distribution, Film, Layered, Layers, Measured,
    Microfacet, Null, Plastic, Principled, PrincipledBase, PrincipledThin, RoughConductor, RoughDielectric,
    RoughPlastic, RoughPlasticTable, Substance, ThinDielectric,
};
use etendue::color::conductor;
use etendue::load::read_measured;
use etendue::math::{ONE_MINUS_EPSILON, Rgb, Vec2, Vec3};
use etendue::sampling::Sampler;
use proptest::prelude::*;
use rand::RngExt;
use rand::SeedableRng;
use rand_pcg::Pcg64;

#[path = "data/bsdf_reference.rs"]
mod reference;

/// Every example of every kind; fails when a kind has none.
fn examples() -> Vec<(String, Bsdf<'static>)> {
    let list = Bsdf::examples();
    for name in Bsdf::NAMES {
        assert!(list.iter().any(|e| e.0.split(' ').next() == Some(name)), "no example of {name}");
    }
    assert!(list.len() >= 90, "{} examples", list.len());
    list
}

/// Unit vector from angles in degrees.
fn direction(theta: f32, phi: f32) -> Vec3 {
    let (theta, phi) = (f64::from(theta).to_radians(), f64::from(phi).to_radians());
    let (x, y) = (theta.sin() * phi.cos(), theta.sin() * phi.sin());
    Vec3::new(x as f32, y as f32, theta.cos() as f32)
}

/// Evenly spread points (for the lobe, for the direction): three dimensions of
/// the sampler's joint set. `n` should be a power of 2.
fn points(n: u32) -> impl Iterator<Item = (f32, Vec2)> {
    (0..n).map(|i| {
        let (direction, lobe) = Sampler::new(5, (0, 0), u64::from(i)).pixel_and_light();
        (lobe.x, direction)
    })
}

/// A lobe so elongated that no grid of cells can integrate it.
fn is_a_line(bsdf: &Bsdf) -> bool {
    let distribution = match bsdf {
        Bsdf::RoughConductor(b) => b.distribution,
        Bsdf::RoughDielectric(b) => b.distribution,
        _ => return false,
    };
    let alpha = distribution.alpha();
    alpha.min_element() < 1e-3 && alpha.max_element() > 10.0 * alpha.min_element()
}

/// Directions to look from: all kinds of slant, and from below for those that
/// have two sides.
fn views(bsdf: &Bsdf) -> Vec<Vec3> {
    let above = [(30.0, 30.0), (80.0, 200.0)];
    let below = [(125.0, 300.0)];
    let all = above.iter().chain(if bsdf.is_one_sided() { &[] } else { &below[..] });
    all.map(|&(theta, phi)| direction(theta, phi)).collect()
}

/// The grid that resolves the samples on one side of the surface: cells of
/// equal angle, or around the peak when that is narrow.
fn grid_for(side: f32, wo: Vec3, samples: &[Vec3]) -> Grid {
    let on_side: Vec<Vec3> = samples.iter().copied().filter(|w| w.z * side > 0.0).collect();
    let uniform = Grid::uniform(Vec3::Z, 16, 24);
    if on_side.len() < 100 {
        return uniform;
    }
    let peak = if wo.z * side > 0.0 {
        Vec3::new(-wo.x, -wo.y, wo.z)
    } else {
        (on_side.iter().sum::<Vec3>() / on_side.len() as f32).normalize()
    };
    let mut distances: Vec<f32> = on_side.iter().map(|w| (*w - peak).length()).collect();
    distances.sort_by(f32::total_cmp);
    let width = f64::from(distances[distances.len() / 10]);
    if width > 0.04 { uniform } else { Grid::around(peak, 0.5 * width, 24, 16) }
}

/// One χ² test and the integral of the density, for one view of one bsdf.
fn check_density(name: &str, bsdf: &Bsdf, wo: Vec3, significance: f64) -> Vec<String> {
    const N: usize = 100_000;
    let mut rng = Pcg64::seed_from_u64(7);
    let mut smooth = Vec::with_capacity(N);
    for _ in 0..N {
        let u = Vec2::new(rng.random(), rng.random());
        match bsdf.sample(wo, rng.random(), u) {
            Some(s) if !s.delta => smooth.push(s.wi),
            _ => {}
        }
    }
    let rest = points(32_768).filter(|&(l, u)| bsdf.sample(wo, l, u).is_none_or(|s| s.delta)).count();

    let mut failures = Vec::new();
    let mut integral = rest as f64 / 32_768.0;
    for side in [1.0f32, -1.0] {
        let grid = grid_for(side, wo, &smooth[..smooth.len().min(2000)]);
        let density = |wi: Vec3| if wi.z * side > 0.0 { f64::from(bsdf.pdf(wo, wi)) } else { 0.0 };
        let cells = grid.integrate(&density, 1e-6);
        integral += cells.iter().sum::<f64>();
        let expected: Vec<f64> = cells.iter().map(|c| c * N as f64).collect();
        let mut observed = vec![0u64; grid.len()];
        for wi in smooth.iter().filter(|w| w.z * side > 0.0) {
            observed[grid.cell(*wi)] += 1;
        }
        let result = chi2(&expected, &observed);
        if result.p_value < significance {
            failures.push(format!("{name}, wo {wo}, side {side}: {result:?} < {significance:e}"));
        }
    }
    if (integral - 1.0).abs() > 1e-3 {
        failures.push(format!("{name}, wo {wo}: density, deltas and None add up to {integral}"));
    }
    failures
}

#[test]
fn samples_follow_a_density_that_integrates_to_one() {
    let cases: Vec<_> = examples()
        .into_iter()
        .filter(|(_, bsdf)| !bsdf.is_delta_only() && !is_a_line(bsdf))
        .flat_map(|(name, bsdf)| views(&bsdf).into_iter().map(move |wo| (name.clone(), bsdf, wo)))
        .collect();
    assert!(cases.len() > 120, "{} cases", cases.len());
    let significance = sidak(0.01, 2 * cases.len());
    let failures: Vec<String> =
        cases.iter().flat_map(|(name, bsdf, wo)| check_density(name, bsdf, *wo, significance)).collect();
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), cases.len(), failures.join("\n"));
}

#[test]
fn weight_is_eval_over_pdf() {
    let mut checked = 0;
    for (name, bsdf) in examples() {
        for wo in views(&bsdf).into_iter().chain([direction(89.9, 77.0)]) {
            for (l, u) in points(2048) {
                let Some(s) = bsdf.sample(wo, l, u) else { continue };
                assert!(s.wi.is_normalized() && s.pdf > 0.0, "{name} {wo}: {s:?}");
                let (value, pdf) = bsdf.eval_pdf(wo, s.wi);
                assert_eq!((value, pdf), (bsdf.eval(wo, s.wi), bsdf.pdf(wo, s.wi)));
                if s.delta {
                    continue;
                }
                let error = (s.weight * s.pdf - value).abs().max_element();
                assert!(error <= 1e-3 * value.max_element(), "{name} {wo}: {s:?} {value} {pdf}");
                assert!((s.pdf - pdf).abs() <= 1e-3 * pdf, "{name} {wo}: {s:?} {pdf}");
                checked += 1;
            }
        }
    }
    assert!(checked > 100_000, "{checked}");
}

#[test]
fn light_may_go_either_way() {
    let mut rng = Pcg64::seed_from_u64(11);
    let mut checked = 0;
    // A coat in a frame of its own is weighed by its own cosine. Mitsuba's thin
    // transmission leaves out facets by one of the two directions.
    // What is measured is reciprocal as far as its tables are.
    let one_way = ["gltf coat with its own normal", "principledthin pane", "principledthin of everything"];
    let skipped = |name: &str| one_way.contains(&name) || name.starts_with("measured");
    for (name, bsdf) in examples().into_iter().filter(|(name, _)| !skipped(name)) {
        let inside = match bsdf {
            Bsdf::RoughDielectric(b) => b.eta,
            Bsdf::Layered(b) => b.eta(),
            Bsdf::Principled(b) => b.base.eta,
            _ => 1.0,
        };
        for _ in 0..300 {
            let mut random = || {
                let z: f32 = rng.random::<f32>().powi(3) * 0.999 + 1e-4;
                let phi = rng.random::<f32>() * std::f32::consts::TAU;
                let side = if bsdf.is_one_sided() || rng.random::<bool>() { 1.0 } else { -1.0 };
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * phi.cos(), r * phi.sin(), side * z).normalize()
            };
            let (wo, wi) = (random(), random());
            // f(i→o)/η_o² = f(o→i)/η_i²
            let eta2 = match (wo.z > 0.0, wi.z > 0.0) {
                (true, false) => inside * inside,
                (false, true) => 1.0 / (inside * inside),
                _ => 1.0,
            };
            let there = bsdf.eval(wo, wi) / wi.z.abs() * eta2;
            let back = bsdf.eval(wi, wo) / wo.z.abs();
            let error = (there - back).abs().max_element();
            let largest = there.max_element().max(back.max_element());
            // Of a slanted direction, or facet, rounding leaves a few digits.
            let tolerance = 1e-3 + 5e-6 / wo.z.abs().min(wi.z.abs());
            assert!(error <= tolerance * largest + 1e-6, "{name} {wo} {wi}: {there} {back}");
            checked += usize::from(largest > 0.0);
        }
    }
    assert!(checked > 5_000, "{checked}");
}

/// Mean weight without radiance scaling: the fraction of light scattered.
fn albedo(bsdf: &Bsdf, wo: Vec3) -> Rgb {
    if matches!(bsdf, Bsdf::MetalRough(_) | Bsdf::Layered(_)) {
        return grazing_albedo(bsdf, wo);
    }
    // Rare lobes need more.
    let n = if matches!(bsdf, Bsdf::Plastic(_)) { 32_768 } else { 8192 };
    let sum = points(n)
        .filter_map(|(l, u)| bsdf.sample(wo, l, u))
        .map(|s: BsdfSample| (s.weight * (s.eta * s.eta)).as_dvec3())
        .sum::<glam::DVec3>();
    (sum / f64::from(n)).as_vec3()
}

/// The same where a wide lobe is highest at grazing: directions are also drawn
/// from there, and the two weighed by the balance heuristic.
fn grazing_albedo(bsdf: &Bsdf, wo: Vec3) -> Rgb {
    const N: u32 = 65_536;
    let inside = match bsdf {
        Bsdf::Layered(b) => b.eta(),
        _ => 1.0,
    };
    let eta2 = |wi: Vec3| match (wo.z > 0.0, wi.z > 0.0) {
        (true, false) => inside * inside,
        (false, true) => 1.0 / (inside * inside),
        _ => 1.0,
    };
    // cos = t³, on both sides.
    let density = |wi: Vec3| 1.0 / (12.0 * std::f32::consts::PI * wi.z.abs().max(1e-18).powf(2.0 / 3.0));
    let weighed = |wi: Vec3| {
        let (f, pdf) = bsdf.eval_pdf(wo, wi);
        let all = pdf + density(wi);
        if all.is_finite() && all > 0.0 { (f * (eta2(wi) / all)).as_dvec3() } else { glam::DVec3::ZERO }
    };
    let mut sum = glam::DVec3::ZERO;
    for (l, u) in points(N) {
        sum += match bsdf.sample(wo, l, u) {
            None => glam::DVec3::ZERO,
            Some(s) if s.delta => (s.weight * (s.eta * s.eta)).as_dvec3(),
            Some(s) => weighed(s.wi),
        };
        let z = u.x.powi(3) * if l < 0.5 { 1.0 } else { -1.0 };
        let (sin, cos) = (u.y * std::f32::consts::TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        sum += weighed(Vec3::new(r * cos, r * sin, z));
    }
    (sum / f64::from(N)).as_vec3()
}

#[test]
fn no_more_light_leaves_than_comes() {
    let mut failures = Vec::new();
    for (name, bsdf) in examples() {
        let mut angles = vec![0.0, 20.0, 45.0, 60.0, 75.0, 85.0, 89.0, 89.99];
        if !bsdf.is_one_sided() {
            angles.extend([90.01, 91.0, 120.0, 135.0, 150.0, 180.0]);
        }
        for theta in angles {
            let a = albedo(&bsdf, direction(theta, 40.0));
            let exact = match bsdf {
                Bsdf::Null(_) | Bsdf::ThinDielectric(_) => Some(Rgb::ONE),
                Bsdf::Dielectric(b) if b.specular_reflectance == Rgb::ONE => Some(Rgb::ONE),
                Bsdf::Diffuse(b) => Some(b.reflectance),
                Bsdf::RoughDielectric(b) if b.eta == 1.0 => Some(Rgb::ONE),
                Bsdf::Conductor(b) if b.eta == Rgb::ZERO => Some(Rgb::ONE),
                Bsdf::Plastic(_) => Some(bsdf.albedo(direction(theta, 40.0))),
                _ => None,
            };
            // What compensates lost energy is tabulated: coarsely at grazing, and
            // at the critical angle of solids.
            let lossless = name.starts_with("gltf white") || name.starts_with("gltf lossless");
            let coarse = (theta - 90.0f32).abs() < 0.1 || name.contains("solid");
            // What a stretched dielectric takes from its base is a mean over all
            // turns of a table over two roughnesses: 5e-3 at the widest stretch.
            let stretched = name.contains("anisotropy") && name.contains("metallic 0");
            let least = match (stretched, coarse) {
                (true, _) => 1.0 - 6e-3,
                (_, true) => 1.0 - 3e-3,
                _ => 1.0 - 2e-3,
            };
            if lossless && a.min_element() < least {
                failures.push(format!("{name} at {theta}°: {a} is lossy"));
            }
            // As Burley's model is: bright at grazing.
            let most = if name.starts_with("principled") { 1.6 } else { 1.0 + 5e-4 };
            if a.max_element() > most || !(a.min_element() >= 0.0) {
                failures.push(format!("{name} at {theta}°: {a}"));
            }
            if exact.is_some_and(|e| (a - e).abs().max_element() > 5e-4) {
                failures.push(format!("{name} at {theta}°: {a}, not {exact:?}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn roughness_fades_to_the_mirror_without_a_step() {
    let wo = direction(50.0, 20.0);
    for kind in [Distribution::Beckmann, Distribution::Ggx] {
        let glass = |alpha| -> Bsdf {
            RoughDielectric {
                distribution: Microfacet::new(kind, alpha, alpha),
                eta: 1.5,
                specular_reflectance: Rgb::ONE,
                specular_transmittance: Rgb::ONE,
            }
            .into()
        };
        let smooth: Bsdf =
            Dielectric { eta: 1.5, specular_reflectance: Rgb::ONE, specular_transmittance: Rgb::ONE }.into();
        for alpha in [0.0, 1e-8, 0.99e-4, 1.01e-4, 1e-3] {
            let rough = glass(alpha);
            assert_eq!(rough.is_delta_only(), alpha < 1e-4);
            for l in [0.0, 0.5] {
                let (a, b) = (rough.sample(wo, l, Vec2::new(0.4, 0.3)), smooth.sample(wo, l, Vec2::ZERO));
                let (a, b) = (a.unwrap(), b.unwrap());
                assert!((a.wi - b.wi).length() < 4.0 * alpha + 1e-6, "{alpha}: {a:?} {b:?}");
                assert!((a.weight - b.weight).length() < 1e-3 && a.eta == b.eta, "{a:?} {b:?}");
            }
        }
    }
}

/// The bsdfs of `tests/data/bsdf_reference.py`.
#[expect(clippy::unwrap_used, reason = "part of a test")]
fn reference_bsdf<'a>(name: &str, tables: &'a [RoughPlasticTable]) -> Bsdf<'a> {
    use Distribution::{Beckmann, Ggx};
    let (grey, white) = (Rgb::new(0.9, 0.5, 0.1), Rgb::ONE);
    let metal = |material: &str, distribution, specular_reflectance| -> Bsdf<'a> {
        let (eta, k) = conductor(material).unwrap();
        RoughConductor { distribution, eta, k, specular_reflectance }.into()
    };
    let glass = |distribution, eta, specular_transmittance| -> Bsdf<'a> {
        RoughDielectric { distribution, eta, specular_reflectance: white, specular_transmittance }.into()
    };
    let plastic = |eta: f32, specular_reflectance, diffuse_reflectance, nonlinear| -> Bsdf<'a> {
        Plastic { coat: Coat::smooth(eta), diffuse_reflectance, specular_reflectance, nonlinear }.into()
    };
    let rough_plastic = |table: usize, specular, nonlinear| -> Bsdf<'a> {
        let table = &tables[table];
        let specular_reflectance = Rgb::splat(specular);
        RoughPlastic { table, diffuse_reflectance: grey, specular_reflectance, nonlinear }.into()
    };
    let smooth_metal = |material: &str| -> Bsdf<'a> {
        let (eta, k) = conductor(material).unwrap();
        Conductor { eta, k, specular_reflectance: white }.into()
    };
    match name {
        "Diffuse" => Diffuse { reflectance: grey }.into(),
        "ConductorBeckmann" => metal("Au", Microfacet::new(Beckmann, 0.1, 0.1), white),
        "ConductorBeckmannRough" => metal("Cu", Microfacet::new(Beckmann, 0.6, 0.6), white),
        "ConductorGgx" => metal("Al", Microfacet::new(Ggx, 0.1, 0.4), grey),
        "ConductorBeckmannAnisotropic" => metal("none", Microfacet::new(Beckmann, 0.5, 0.15), white),
        "DielectricBeckmann" => glass(Microfacet::new(Beckmann, 0.3, 0.3), 1.5, white),
        "DielectricGgx" => glass(Microfacet::new(Ggx, 0.2, 0.5), 1.33, grey),
        "Plastic" => plastic(1.49 / 1.000277, white, grey, false),
        "PlasticNonlinear" => plastic(1.9, white, grey, true),
        "RoughPlasticBeckmann" => rough_plastic(0, 1.0, false),
        "RoughPlasticGgx" => rough_plastic(1, 1.0, true),
        "RoughPlasticSharp" => rough_plastic(2, 0.0, false),
        "RoughPlasticRough" => rough_plastic(3, 0.0, false),
        "Dielectric" => {
            Dielectric { eta: 1.5, specular_reflectance: Rgb::splat(0.8), specular_transmittance: white }
                .into()
        }
        "ThinDielectric" => {
            ThinDielectric { eta: 1.5, specular_reflectance: white, specular_transmittance: white }.into()
        }
        "Gold" => smooth_metal("Au"),
        "Mirror" => smooth_metal("none"),
        "PlasticMirror" => plastic(1.49 / 1.000277, grey, Rgb::splat(0.5), false),
        "Null" => Null.into(),
        other => panic!("no bsdf {other}"),
    }
}

/// The measured ones, from the files that Mitsuba read.
#[expect(clippy::unwrap_used, reason = "part of a test")]
fn reference_measured() -> [(&'static str, Measured); 2] {
    [("MeasuredIsotropic", "isotropic"), ("MeasuredAnisotropic", "anisotropic")].map(|(name, file)| {
        let path = format!("{}/scenes/features/data/{file}.bsdf", env!("CARGO_MANIFEST_DIR"));
        let data = read_measured(path.as_ref()).unwrap();
        (name, Measured::new(Arc::new(data)).unwrap())
    })
}

enum Either {
    Solid(Principled),
    Thin(PrincipledThin),
}

/// The principled ones of them.
fn reference_principled(name: &str) -> Option<Either> {
    let grey = Rgb::new(0.9, 0.5, 0.1);
    let plain = PrincipledBase::DEFAULT;
    let coloured = PrincipledBase { base_color: grey, ..plain };
    let all = PrincipledBase {
        base_color: Rgb::new(0.8, 0.4, 0.2),
        roughness: 0.45,
        anisotropic: 0.5,
        spec_trans: 0.4,
        spec_tint: 0.3,
        sheen: 0.6,
        sheen_tint: 0.5,
        flatness: 0.5,
        ..plain
    };
    let solid = |base, metallic, clearcoat, clearcoat_gloss| {
        Some(Either::Solid(Principled { base, metallic, clearcoat, clearcoat_gloss, rates: [1.0; 3] }))
    };
    let thin = |base, diff_trans| Some(Either::Thin(PrincipledThin { base, diff_trans, rates: [1.0; 4] }));
    // η of `specular` 0.7
    let eta = 2.0 / (1.0 - (0.08f32 * 0.7).sqrt()) - 1.0;
    match name {
        "PrincipledDefault" => solid(plain, 0.0, 0.0, 0.0),
        "PrincipledMetal" => {
            solid(PrincipledBase { roughness: 0.3, anisotropic: 0.8, ..coloured }, 1.0, 0.0, 0.0)
        }
        "PrincipledCloth" => solid(
            PrincipledBase { roughness: 0.9, sheen: 1.0, sheen_tint: 0.7, flatness: 0.6, ..coloured },
            0.0,
            0.0,
            0.0,
        ),
        "PrincipledCoat" => solid(PrincipledBase { eta, spec_tint: 0.8, ..coloured }, 0.0, 1.0, 0.4),
        "PrincipledGlass" => solid(PrincipledBase { spec_trans: 1.0, eta: 1.4, ..coloured }, 0.0, 0.0, 0.0),
        "PrincipledBubble" => solid(PrincipledBase { spec_trans: 0.8, eta: 0.8, ..plain }, 0.3, 0.5, 0.0),
        "PrincipledAll" => solid(all, 0.3, 0.5, 0.5),
        "ThinDefault" => thin(plain, 0.0),
        "ThinPane" => thin(
            PrincipledBase { spec_trans: 1.0, eta: 1.6, roughness: 0.3, spec_tint: 0.5, ..coloured },
            0.0,
        ),
        "ThinAll" => thin(all, 0.7),
        _ => None,
    }
}

fn reference_tables() -> Vec<RoughPlasticTable> {
    use Distribution::{Beckmann, Ggx};
    let table = |(kind, alpha, eta)| RoughPlasticTable::new(kind, alpha, eta);
    [(Beckmann, 0.1, 1.49 / 1.000277), (Ggx, 0.4, 1.7), (Beckmann, 0.02, 1.5), (Beckmann, 0.9, 1.5)]
        .map(table)
        .to_vec()
}

#[test]
fn values_agree_with_mitsuba() {
    let (tables, measured) = (reference_tables(), reference_measured());
    let mut failures = Vec::new();
    assert!(reference::EVAL.len() > 300, "{}", reference::EVAL.len());
    for &(name, wo_theta, wo_phi, wi_theta, wi_phi, expected) in reference::EVAL {
        let (wo, wi) = (direction(wo_theta, wo_phi), direction(wi_theta, wi_phi));
        let value = match reference_principled(name) {
            Some(Either::Solid(surface)) => Bsdf::from(&surface).eval(wo, wi),
            Some(Either::Thin(surface)) => Bsdf::from(&surface).eval(wo, wi),
            None => match measured.iter().find(|(known, _)| *known == name) {
                Some((_, tables)) => Bsdf::from(tables).eval(wo, wi),
                None => reference_bsdf(name, &tables).eval(wo, wi),
            },
        };
        let expected = Rgb::from_array(expected);
        let error = (value / expected - 1.0).abs().max_element();
        if !(error < 1.5e-4) {
            failures.push(format!("{name} {wo_theta} {wi_theta}: {value}, not {expected}: {error:e}"));
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn densities_agree_with_mitsuba() {
    let measured = reference_measured();
    let mut failures = Vec::new();
    assert!(reference::DENSITY.len() > 80, "{}", reference::DENSITY.len());
    for &(name, wo_theta, wo_phi, wi_theta, wi_phi, expected) in reference::DENSITY {
        let (_, tables) = measured.iter().find(|(known, _)| *known == name).unwrap();
        let value = Bsdf::from(tables).pdf(direction(wo_theta, wo_phi), direction(wi_theta, wi_phi));
        let error = (value / expected - 1.0).abs();
        if !(error < 1.5e-4) {
            failures.push(format!("{name} {wo_theta} {wi_theta}: {value}, not {expected}: {error:e}"));
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn deltas_agree_with_mitsuba() {
    assert!(reference::DELTA.len() > 40);
    for &(name, theta, lobe, wi, energy, eta) in reference::DELTA {
        let bsdf = reference_bsdf(name, &[]);
        let s = bsdf.sample(direction(theta, 0.0), lobe, Vec2::new(0.3, 0.6)).unwrap();
        assert!(s.delta, "{name} {theta}: {s:?}");
        assert!((s.wi - Vec3::from_array(wi)).length() < 1e-6, "{name} {theta}: {s:?} {wi:?}");
        assert!((s.eta - eta).abs() < 1e-6, "{name} {theta}: {s:?} {eta}");
        let error = (s.weight * s.pdf / Rgb::from_array(energy) - 1.0).abs().max_element();
        assert!(error < 2e-5, "{name} {theta}: {s:?} {energy:?}");
    }
}

/// Unit vectors of any slant, subnormal components included.
fn any_direction() -> impl Strategy<Value = Vec3> {
    let component = prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        -1.0f32..1.0,
        prop::sample::select(vec![0.0f32, -0.0, 1e-45, -1e-38, 1e-20, 1e-7, 1.0]),
    ];
    [component.clone(), component.clone(), component].prop_filter_map("no direction", |v| {
        let v = v.map(f64::from);
        let largest = v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let v = glam::DVec3::from_array(v) / largest;
        let w = v.normalize().as_vec3();
        w.is_normalized().then_some(w)
    })
}

fn any_unit() -> impl Strategy<Value = f32> {
    prop_oneof![0.0f32..1.0, prop::sample::select(vec![0.0f32, 1e-38, 1e-10, 0.5, ONE_MINUS_EPSILON])]
}

/// Kinds with any parameter whose tables need no build.
fn any_bsdf() -> impl Strategy<Value = Bsdf<'static>> {
    let alpha =
        || prop_oneof![any::<u32>().prop_map(f32::from_bits), (-9.0f32..0.5).prop_map(|x| 10f32.powf(x))];
    let eta = prop_oneof![
        (-3.0f32..3.0).prop_map(|x| 10f32.powf(x)),
        prop::sample::select(vec![1.0f32, 1.000_000_1, 0.999_999_9, 1.0001, 1.5])
    ];
    let color = || [any_unit(), any_unit(), any_unit()].prop_map(Rgb::from_array);
    let kind = prop::bool::ANY.prop_map(|b| if b { Distribution::Beckmann } else { Distribution::Ggx });
    (0..7usize, kind, alpha(), alpha(), eta, color(), color()).prop_map(|(which, kind, u, v, eta, a, b)| {
        let distribution = Microfacet::new(kind, u, v);
        match which {
            0 => Dielectric { eta, specular_reflectance: a, specular_transmittance: b }.into(),
            1 => ThinDielectric { eta, specular_reflectance: a, specular_transmittance: b }.into(),
            2 => RoughDielectric { distribution, eta, specular_reflectance: a, specular_transmittance: b }
                .into(),
            3 => Conductor { eta: a * eta, k: b * 9.0, specular_reflectance: Rgb::ONE }.into(),
            4 => RoughConductor { distribution, eta: a * eta, k: b * 9.0, specular_reflectance: Rgb::ONE }
                .into(),
            5 => Diffuse { reflectance: a }.into(),
            _ => Plastic {
                coat: Coat::smooth(eta),
                diffuse_reflectance: a,
                specular_reflectance: b,
                nonlinear: u > v,
            }
            .into(),
        }
    })
}

fn check_finite(bsdf: &Bsdf, wo: Vec3, wi: Vec3, u: (f32, Vec2)) -> Result<(), TestCaseError> {
    let (value, pdf) = bsdf.eval_pdf(wo, wi);
    prop_assert!(value.is_finite() && value.min_element() >= 0.0, "eval {}", value);
    prop_assert!(pdf.is_finite() && pdf >= 0.0, "pdf {}", pdf);
    let albedo = bsdf.albedo(wo);
    prop_assert!(albedo.is_finite() && albedo.min_element() >= 0.0, "albedo {}", albedo);
    if let Some(s) = bsdf.sample(wo, u.0, u.1) {
        prop_assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{:?}", s);
        prop_assert!(s.pdf.is_finite() && s.pdf > 0.0 && s.eta.is_finite() && s.eta > 0.0, "{:?}", s);
        prop_assert!(s.wi.is_normalized(), "{:?}", s);
        let (value, pdf) = bsdf.eval_pdf(wo, s.wi);
        prop_assert!(value.is_finite() && pdf.is_finite(), "{:?} {} {}", s, value, pdf);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, rng_seed: prop::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

    #[test]
    fn everything_is_finite(
        bsdf in any_bsdf(), wo in any_direction(), wi in any_direction(),
        l in any_unit(), x in any_unit(), y in any_unit(),
    ) {
        check_finite(&bsdf, wo, wi, (l, Vec2::new(x, y)))?;
    }

    #[test]
    fn examples_are_finite(
        which in any::<prop::sample::Index>(), wo in any_direction(), wi in any_direction(),
        l in any_unit(), x in any_unit(), y in any_unit(),
    ) {
        thread_local!(static LIST: Vec<(String, Bsdf<'static>)> = Bsdf::examples());
        LIST.with(|list| check_finite(&list[which.index(list.len())].1, wo, wi, (l, Vec2::new(x, y))))?;
    }
}

/// A film lies on what is left of the reflection, which does not weigh it:
/// without any it reflects as one on a base of its surroundings' index.
#[test]
fn a_film_is_not_weighed_by_the_specular_strength() {
    let film = Film { ior: 1.8, thickness: 300.0 };
    for specular in [0.0, 0.5] {
        let f0 = Rgb::splat(0.04 * specular);
        let substance = Substance { base_color: Rgb::ZERO, metallic: 0.0, roughness: 0.0, f0, f90: specular };
        let layers = Layers { iridescence: 1.0, film, ..Layers::default() };
        let surface = Layered::new(&substance, &layers, None, false);
        let bsdf = Bsdf::from(&surface);
        let s = bsdf.sample(Vec3::Z, 0.5, Vec2::splat(0.5)).unwrap();
        let expected = film.reflectance(1.0, f0);
        assert!(s.delta && (s.weight * s.pdf - expected).abs().max_element() < 1e-5, "{s:?} {expected}");
    }
}

/// What a film does not reflect reaches the base and comes back.
#[test]
fn a_film_on_a_smooth_white_base_takes_little() {
    let white =
        Substance { base_color: Rgb::ONE, metallic: 0.0, roughness: 0.0, f0: Rgb::splat(0.04), f90: 1.0 };
    for (ior, thickness, least) in [(1.3, 400.0, 0.96), (1.1, 800.0, 0.96), (1.0, 2000.0, 0.97)] {
        let layers = Layers { iridescence: 1.0, film: Film { ior, thickness }, ..Layers::default() };
        let surface = Layered::new(&white, &layers, None, false);
        let found = albedo(&Bsdf::from(&surface), Vec3::Z);
        assert!(found.min_element() > least && found.max_element() < 1.0005, "{ior} {thickness}: {found}");
    }
}
