//! Examples of glTF surfaces: each layer alone and all together.

use std::sync::LazyLock;

use super::examples::Named;
use super::{Film, GlassTable, Layered, Layers, MetalRough, Substance};
use crate::math::{Rgb, Vec3};

/// White dielectric of the index 1.5.
const WHITE: Substance =
    Substance { base_color: Rgb::ONE, metallic: 0.0, roughness: 0.5, f0: Rgb::splat(0.04), f90: 1.0 };

/// Indices of the solids.
const SOLIDS: [f32; 3] = [1.5, 1.0, 2.4];

pub(super) fn push(list: &mut Named) {
    static CORES: LazyLock<Vec<(String, MetalRough)>> = LazyLock::new(cores);
    static LAYERED: LazyLock<Vec<(String, Layered<'static>)>> = LazyLock::new(|| {
        let mut list = opaque();
        list.extend(thin());
        list.extend(solid());
        list
    });
    list.extend(CORES.iter().map(|(name, core)| (name.clone(), core.into())));
    list.extend(LAYERED.iter().map(|(name, surface)| (name.clone(), surface.into())));
}

fn cores() -> Vec<(String, MetalRough)> {
    let mut list = Vec::new();
    for roughness in [0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.85, 1.0] {
        for metallic in [0.0, 0.5, 1.0] {
            let substance = Substance { metallic, roughness, ..WHITE };
            let core = MetalRough::new(&substance, false);
            list.push((format!("gltf white roughness {roughness} metallic {metallic}"), core));
        }
    }
    let gold = Substance { base_color: Rgb::new(1.0, 0.77, 0.34), metallic: 1.0, ..WHITE };
    let tinted = Substance { base_color: Rgb::new(0.2, 0.5, 0.1), f0: Rgb::new(0.08, 0.02, 0.0), ..WHITE };
    let black = Substance { base_color: Rgb::ZERO, f0: Rgb::ZERO, f90: 0.0, ..WHITE };
    let mirror = Substance { f0: Rgb::ONE, ..WHITE };
    for (name, substance) in [("gold", gold), ("tinted", tinted), ("black", black), ("mirror", mirror)] {
        for two_sided in [false, true] {
            let core = MetalRough::new(&substance, two_sided);
            list.push((format!("gltf {name} two-sided {two_sided}"), core));
        }
    }
    list
}

fn named(name: &str, substance: Substance, layers: Layers) -> (String, Layered<'static>) {
    (format!("gltf {name}"), Layered::new(&substance, &layers, None, false))
}

fn opaque() -> Vec<(String, Layered<'static>)> {
    let none = Layers::default();
    let mut list = Vec::new();
    for (base, coat) in [(0.0, 0.0), (0.0, 0.5), (0.3, 0.0), (0.6, 0.2), (1.0, 0.6), (0.15, 1.0)] {
        for metallic in [0.0, 1.0] {
            let substance = Substance { roughness: base, metallic, ..WHITE };
            let layers = Layers { clearcoat: 1.0, clearcoat_roughness: coat, ..none };
            list.push(named(
                &format!("lossless coat {coat} on {base} metallic {metallic}"),
                substance,
                layers,
            ));
        }
    }
    let bent = Vec3::new(0.2, -0.1, 0.9).normalize();
    let bumpy = Layers { clearcoat: 0.7, clearcoat_roughness: 0.2, clearcoat_normal: bent, ..none };
    list.push(named("coat with its own normal", WHITE, bumpy));
    for roughness in [0.0, 0.2, 0.5, 1.0] {
        let sheen = Layers { sheen_color: Rgb::new(1.0, 0.5, 0.2), sheen_roughness: roughness, ..none };
        list.push(named(&format!("sheen {roughness}"), WHITE, sheen));
    }
    for (anisotropy, roughness) in [(0.3, 0.3), (0.7, 0.4), (1.0, 0.4), (0.9, 0.8), (1.0, 0.1)] {
        for metallic in [0.0, 1.0] {
            let substance = Substance { roughness, metallic, ..WHITE };
            let stretched = Layers { anisotropy, ..none };
            let name = format!("lossless anisotropy {anisotropy} roughness {roughness} metallic {metallic}");
            list.push(named(&name, substance, stretched));
        }
    }
    for (ior, thickness, roughness) in [
        (1.0, 360.0, 0.0),
        (1.0, 2000.0, 0.0),
        (1.0, 2000.0, 0.2),
        (1.1, 800.0, 0.0),
        (1.3, 400.0, 0.1),
        (1.2, 1200.0, 0.4),
        (1.3, 2000.0, 0.7),
    ] {
        let layers = Layers { iridescence: 1.0, film: Film { ior, thickness }, ..none };
        let name = format!("film {ior} of {thickness} roughness {roughness}");
        list.push(named(&name, Substance { roughness, ..WHITE }, layers));
    }
    for (thickness, metallic) in [(100.0, 0.0), (400.0, 0.0), (550.0, 1.0)] {
        let substance = Substance { metallic, base_color: Rgb::new(0.9, 0.8, 0.7), ..WHITE };
        let layers = Layers { iridescence: 1.0, film: Film { ior: 1.3, thickness }, ..none };
        list.push(named(&format!("film {thickness} metallic {metallic}"), substance, layers));
    }
    list
}

/// All layers at once.
fn everything() -> Layers {
    Layers {
        anisotropy: 0.5,
        iridescence: 0.6,
        film: Film { ior: 1.8, thickness: 300.0 },
        clearcoat: 0.8,
        clearcoat_roughness: 0.3,
        clearcoat_normal: Vec3::Z,
        sheen_color: Rgb::new(0.3, 0.6, 0.9),
        sheen_roughness: 0.4,
        transmission: 0.4,
        diffuse_transmission: 0.5,
        diffuse_transmission_color: Rgb::new(1.0, 0.9, 0.4),
    }
}

fn thin() -> Vec<(String, Layered<'static>)> {
    let none = Layers::default();
    let mut list = Vec::new();
    for roughness in [0.0, 0.1, 0.4, 1.0] {
        for transmission in [0.5, 1.0] {
            let name = format!("lossless wall {transmission} roughness {roughness}");
            list.push(named(&name, Substance { roughness, ..WHITE }, Layers { transmission, ..none }));
        }
    }
    let coated = Layers { transmission: 1.0, clearcoat: 1.0, clearcoat_roughness: 0.3, ..none };
    list.push(named("lossless coated wall", WHITE, coated));
    let paper = Layers { diffuse_transmission: 0.6, ..none };
    list.push(named("lossless paper", WHITE, paper));
    let substance = Substance { metallic: 0.3, roughness: 0.4, ..WHITE };
    list.push(named("everything", substance, everything()));
    list.push(named("everything white", Substance { roughness: 0.7, ..WHITE }, everything()));
    list
}

fn solid() -> Vec<(String, Layered<'static>)> {
    static TABLES: LazyLock<Vec<GlassTable>> =
        LazyLock::new(|| SOLIDS.iter().map(|&eta| GlassTable::new(eta)).collect());
    let mut list = Vec::new();
    for table in TABLES.iter() {
        let eta = table.eta();
        let f0 = Rgb::splat(((eta - 1.0) / (eta + 1.0)).powi(2));
        for roughness in [0.0, 0.1, 0.4, 0.8, 1.0] {
            let layers = Layers { transmission: 1.0, ..Layers::default() };
            let surface = Layered::new(&Substance { f0, roughness, ..WHITE }, &layers, Some(table), false);
            list.push((format!("gltf lossless solid {eta} roughness {roughness}"), surface));
        }
    }
    let substance = Substance { base_color: Rgb::new(0.9, 0.6, 0.3), metallic: 0.2, ..WHITE };
    let surface = Layered::new(&substance, &everything(), TABLES.first(), true);
    list.push(("gltf solid with everything".to_string(), surface));
    list
}
