//! Typical and extreme examples of every kind, which the contract tests run
//! over.

use super::{
    Bsdf, Coat, Conductor, Dielectric, Diffuse, Distribution, Microfacet, Null, Plastic, RoughConductor,
    RoughDielectric, RoughPlastic, RoughPlasticTable, ThinDielectric,
};
use crate::color::conductor;
use crate::math::Rgb;
use std::sync::LazyLock;

use Distribution::{Beckmann, Ggx};

pub(super) type Named = Vec<(String, Bsdf<'static>)>;

pub(super) fn examples() -> Named {
    let mut list = vec![("null".to_string(), Null.into())];
    for (name, rho) in [("white", Rgb::ONE), ("red", Rgb::new(0.8, 0.1, 0.05)), ("black", Rgb::ZERO)] {
        list.push((format!("diffuse {name}"), Diffuse { reflectance: rho }.into()));
    }
    smooth_dielectrics(&mut list);
    rough_dielectrics(&mut list);
    conductors(&mut list);
    plastics(&mut list);
    rough_plastics(&mut list);
    super::examples_gltf::push(&mut list);
    super::examples_principled::push(&mut list);
    super::examples_measured::push(&mut list);
    list
}

fn smooth_dielectrics(list: &mut Named) {
    let white = Rgb::ONE;
    for eta in [1.0, 1.000_000_1, 1.0001, 1.333, 1.5046, 1.0 / 1.5, 10.0, 1e3] {
        let glass = Dielectric { eta, specular_reflectance: white, specular_transmittance: white };
        list.push((format!("dielectric eta {eta}"), glass.into()));
        let pane = ThinDielectric { eta, specular_reflectance: white, specular_transmittance: white };
        list.push((format!("thindielectric eta {eta}"), pane.into()));
    }
    let tinted = Dielectric {
        eta: 1.5,
        specular_reflectance: Rgb::new(1.0, 0.5, 0.0),
        specular_transmittance: Rgb::new(0.0, 0.5, 0.9),
    };
    list.push(("dielectric tinted".to_string(), tinted.into()));
}

fn rough_dielectrics(list: &mut Named) {
    let mut push = |kind, alpha_u, alpha_v, eta| {
        let glass = RoughDielectric {
            distribution: Microfacet::new(kind, alpha_u, alpha_v),
            eta,
            specular_reflectance: Rgb::ONE,
            specular_transmittance: Rgb::ONE,
        };
        list.push((format!("roughdielectric {kind:?} {alpha_u} {alpha_v} eta {eta}"), glass.into()));
    };
    for kind in [Beckmann, Ggx] {
        for alpha in [1e-8, 1e-4, 1e-2, 0.1, 0.5, 1.0] {
            push(kind, alpha, alpha, 1.5);
        }
        for eta in [1.0, 1.000_000_1, 1.0001, 1.01, 1.0 / 1.5, 10.0, 100.0] {
            push(kind, 0.3, 0.3, eta);
        }
        push(kind, 0.1, 0.6, 1.33);
    }
}

fn conductors(list: &mut Named) {
    let (gold_eta, gold_k) = conductor("Au").unwrap_or((Rgb::ZERO, Rgb::ONE));
    let mut push = |name: String, eta, k, distribution: Option<Microfacet>| {
        let specular_reflectance = Rgb::ONE;
        list.push(match distribution {
            None => (format!("conductor {name}"), Conductor { eta, k, specular_reflectance }.into()),
            Some(distribution) => (
                format!("roughconductor {name}"),
                RoughConductor { distribution, eta, k, specular_reflectance }.into(),
            ),
        });
    };
    push("gold".to_string(), gold_eta, gold_k, None);
    push("mirror".to_string(), Rgb::ZERO, Rgb::ONE, None);
    push("matched".to_string(), Rgb::ONE, Rgb::ZERO, None);
    for kind in [Beckmann, Ggx] {
        for alpha in [1e-8, 1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.5, 1.0] {
            let distribution = Microfacet::new(kind, alpha, alpha);
            push(format!("mirror {kind:?} {alpha}"), Rgb::ZERO, Rgb::ONE, Some(distribution));
        }
        for (u, v) in [(0.05, 0.3), (1e-8, 0.5), (0.8, 0.02)] {
            push(format!("gold {kind:?} {u} {v}"), gold_eta, gold_k, Some(Microfacet::new(kind, u, v)));
        }
    }
}

fn plastics(list: &mut Named) {
    let bases = [("white", Rgb::ONE), ("blue", Rgb::new(0.1, 0.27, 0.36)), ("black", Rgb::ZERO)];
    for (eta, nonlinear) in [(1.49 / 1.000277, false), (1.9, true), (1.0, false), (5.0, false), (100.0, true)]
    {
        for (name, diffuse_reflectance) in bases {
            let plastic = Plastic {
                coat: Coat::smooth(eta),
                diffuse_reflectance,
                specular_reflectance: Rgb::ONE,
                nonlinear,
            };
            list.push((format!("plastic {name} eta {eta} nonlinear {nonlinear}"), plastic.into()));
        }
    }
}

fn rough_plastics(list: &mut Named) {
    /// Kind, roughness, η of the tables below.
    const COATS: [(Distribution, f32, f32); 8] = [
        (Beckmann, 0.1, 1.49 / 1.000277),
        (Ggx, 0.1, 1.49 / 1.000277),
        (Beckmann, 0.5, 1.9),
        (Ggx, 0.5, 1.9),
        (Beckmann, 1e-8, 1.5),
        (Ggx, 1.0, 1.0),
        (Ggx, 1e-4, 10.0),
        (Beckmann, 1.0, 100.0),
    ];
    static TABLES: LazyLock<Vec<RoughPlasticTable>> = LazyLock::new(|| {
        COATS.iter().map(|&(kind, alpha, eta)| RoughPlasticTable::new(kind, alpha, eta)).collect()
    });
    let bases = [("white", Rgb::ONE, false), ("blue", Rgb::new(0.1, 0.27, 0.36), true)];
    for (&(kind, alpha, eta), table) in COATS.iter().zip(TABLES.iter()) {
        for (name, diffuse_reflectance, nonlinear) in bases {
            let specular_reflectance = Rgb::ONE;
            let plastic = RoughPlastic { table, diffuse_reflectance, specular_reflectance, nonlinear };
            let name = format!("roughplastic {name} {kind:?} {alpha} eta {eta} nonlinear {nonlinear}");
            list.push((name, plastic.into()));
        }
    }
}
