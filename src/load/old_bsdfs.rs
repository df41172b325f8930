//! Materials of Mitsuba 0.x as materials of today.
//!
//! Exact: `mixturebsdf`, `roughdiffuse` without roughness, the default copper
//! of conductors, `extEta`, a `scale` texture in a `bumpmap`, an unnamed
//! texture in a `normalmap`. What has no equal (`phong`, `ward`, coatings,
//! …) is an error that names the nearest, and becomes that with `--lenient`.

use super::old::{Old, colour, number};
use crate::color;
use crate::desc::{Category, ObjectId, Result, Value};

/// Turns a `<bsdf>` of an old file into one of today's.
pub fn upgrade(old: &mut Old) -> Result<()> {
    match old.plugin().as_str() {
        "conductor" | "roughconductor" => conductor(old)?,
        "mixturebsdf" => return mixture(old),
        "phong" | "ward" => return glossy(old),
        "roughdiffuse" => rough_diffuse(old)?,
        "difftrans" => {
            old.replace(
                "bsdf `difftrans` is not known: no diffuse transmission",
                "replaced by a `diffuse` that reflects what went through",
            )?;
            old.rename("transmittance", "reflectance");
            old.become_plugin("diffuse");
        }
        "coating" | "roughcoating" => coating(old)?,
        name @ ("hk" | "irawan" | "dipolebrdf" | "rmbrdf") => {
            old.replace(format!("bsdf `{name}` is not known"), "replaced by a grey `diffuse`")?;
            old.keep(&[]);
            old.become_plugin("diffuse");
        }
        "bump" => {
            old.become_plugin("bumpmap");
            bump(old)?;
        }
        "bumpmap" => bump(old)?,
        "normalmap" if !old.has("normalmap") => {
            if let [texture] = old.take_children(Category::Texture)[..] {
                old.set("normalmap", Value::Object(texture));
            }
        }
        "blendbsdf" if !old.has("weight") => old.set("weight", Value::Float(0.5)),
        _ => {}
    }
    distribution(old)
}

/// Microfacets of other shapes than today's.
fn distribution(old: &mut Old) -> Result<()> {
    let Some(word) = old.word("distribution") else { return Ok(()) };
    let lower = word.to_lowercase();
    if matches!(lower.as_str(), "phong" | "as") {
        let pos = old.get("distribution").map_or(old.pos(), |p| p.pos);
        let message = format!("`distribution` has no value `{word}`");
        old.replace_at(pos, message, "replaced by `beckmann` of the same roughness")?;
        old.set("distribution", Value::String("beckmann".into()));
    } else {
        old.set("distribution", Value::String(lower));
    }
    Ok(())
}

/// Copper by default, and an outside that is no vacuum.
fn conductor(old: &mut Old) -> Result<()> {
    if !["material", "eta", "k"].iter().any(|name| old.has(name)) {
        old.set("material", Value::String("Cu".into()));
    }
    let Some(outside) = old.take("ext_eta") else { return Ok(()) };
    let outside = match &outside.value {
        Value::String(word) => color::ior(word),
        other => number(other),
    };
    let Some(outside) = outside.filter(|eta| *eta > 0.0) else {
        return Err(old.scene.error(old.pos(), "`ext_eta` must be a positive number or a material's name"));
    };
    if outside == 1.0 {
        return Ok(());
    }
    if let Some((eta, k)) = old.word("material").filter(|m| *m != "none").and_then(color::conductor) {
        old.take("material");
        for (name, value) in [("eta", eta), ("k", k)] {
            old.set(name, Value::Rgb(value.as_dvec3().to_array()));
        }
    }
    for name in ["eta", "k"] {
        let Some(param) = old.get(name) else { continue };
        let scaled = match &param.value {
            Value::Spectrum(pairs) => Value::Spectrum(pairs.iter().map(|(l, v)| (*l, v / outside)).collect()),
            other => match colour(other) {
                Some(c) => Value::Rgb(c.map(|v| v / outside)),
                None => {
                    let message =
                        format!("a textured `{name}` cannot be seen from another outside than a vacuum");
                    old.replace(message, "left as it is")?;
                    continue;
                }
            },
        };
        old.set(name, scaled);
    }
    Ok(())
}

/// Σ wᵢ·fᵢ as blends within blends; what is missing to a sum of 1 is black.
fn mixture(old: &mut Old) -> Result<()> {
    let text = old.take("weights");
    let weights = match text.as_ref().map(|p| &p.value) {
        Some(Value::String(text)) => {
            let words = text.split(|c: char| c.is_whitespace() || ",;".contains(c)).filter(|w| !w.is_empty());
            words.map(|w| w.parse().ok().filter(|v: &f64| *v >= 0.0 && v.is_finite())).collect()
        }
        Some(other) => number(other).map(|v| vec![v]),
        None => None,
    };
    let pos = text.map_or(old.pos(), |p| p.pos);
    let Some(mut weights): Option<Vec<f64>> = weights else {
        return Err(old.scene.error(pos, "bsdf `mixturebsdf` needs `weights`, numbers between commas"));
    };
    let mut parts = old.take_children(Category::Bsdf);
    let sum: f64 = weights.iter().sum();
    if parts.len() != weights.len() || !(sum > 0.0) {
        let message = format!(
            "bsdf `mixturebsdf` needs as many weights as bsdfs, and one above 0; found {} weights, {} bsdfs",
            weights.len(),
            parts.len()
        );
        return Err(old.scene.error(pos, message));
    }
    if sum > 1.0 {
        if old.take_bool("ensure_energy_conservation") == Some(false) && sum > 1.0 + 1e-6 {
            old.replace_at(
                pos,
                format!("the weights sum to {sum}, more light than comes in"),
                "scaled to 1",
            )?;
        }
        weights.iter_mut().for_each(|w| *w /= sum);
    }
    old.forget(&["ensure_energy_conservation"]);
    let missing = 1.0 - sum;
    if missing > 1e-6 || parts.len() == 1 {
        parts.push(old.add(Category::Bsdf, "diffuse", vec![("reflectance", Value::Float(0.0))]));
        weights.push(missing.max(0.0));
    }
    // From the last one back: each blend has the weight of all behind it.
    let (mut rest, mut behind) = (parts[parts.len() - 1], weights[weights.len() - 1]);
    for i in (0..parts.len() - 1).rev() {
        let all = behind + weights[i];
        let share = if all > 0.0 { behind / all } else { 0.0 };
        if i > 0 {
            rest = blend(old, share, [parts[i], rest]);
        } else {
            old.become_plugin("blendbsdf");
            old.set("weight", Value::Float(share));
            old.nest(parts[0]);
            old.nest(rest);
        }
        behind = all;
    }
    Ok(())
}

fn blend(old: &mut Old, weight: f64, parts: [ObjectId; 2]) -> ObjectId {
    let [first, second] = parts.map(|id| ("", Value::Object(id)));
    old.add(Category::Bsdf, "blendbsdf", vec![("weight", Value::Float(weight)), first, second])
}

/// `phong` and `ward`, a diffuse part and a lobe, as a blend of `diffuse` and
/// a `roughconductor` that reflects everything. The lobe's share is its
/// reflectance, and an exponent n is as narrow as α = √(2/(n+2)) (Walter et
/// al. 2007, "Microfacet Models for Refraction", section 5.2).
fn glossy(old: &mut Old) -> Result<()> {
    let name = old.plugin();
    old.replace(
        format!("bsdf `{name}` is not known; the nearest is a `blendbsdf` of `diffuse` and `roughconductor`"),
        "replaced by a blend of `diffuse` and `roughconductor`",
    )?;
    let mut lobe = vec![("material", Value::String("none".into()))];
    if name == "phong" {
        let exponent = old.take_number("exponent").unwrap_or(30.0).max(0.0);
        lobe.push(("alpha", Value::Float((2.0 / (exponent + 2.0)).sqrt())));
    } else {
        let mut alpha = |name: &str| old.take(name).map_or(Value::Float(0.1), |p| p.value);
        let [u, v] = ["alpha_u", "alpha_v"].map(&mut alpha);
        lobe.extend([("alpha_u", u), ("alpha_v", v)]);
    }
    let specular = old.take("specular_reflectance").map_or(Value::Float(0.2), |p| p.value);
    let diffuse = old.take("diffuse_reflectance").map_or(Value::Float(0.5), |p| p.value);
    old.keep(&[]);
    let (weight, diffuse) = match colour(&specular) {
        Some(c) => {
            // The strongest channel reflects all of the lobe's share.
            let share = c.iter().copied().fold(0.0, f64::max).clamp(0.0, 1.0);
            if share > 0.0 {
                lobe.push(("specular_reflectance", Value::Rgb(c.map(|v| (v / share).clamp(0.0, 1.0)))));
            }
            let rest = 1.0 - share;
            let spread = |c: [f64; 3]| Value::Rgb(c.map(|v| if v < rest { v / rest } else { 1.0 }));
            (Value::Float(share), colour(&diffuse).map_or(diffuse, spread))
        }
        None => (specular, diffuse),
    };
    let diffuse = old.add(Category::Bsdf, "diffuse", vec![("reflectance", diffuse)]);
    let lobe = old.add(Category::Bsdf, "roughconductor", lobe);
    old.become_plugin("blendbsdf");
    old.set("weight", weight);
    old.nest(diffuse);
    old.nest(lobe);
    Ok(())
}

fn rough_diffuse(old: &mut Old) -> Result<()> {
    if old.take_number("alpha") != Some(0.0) {
        old.replace("bsdf `roughdiffuse` is not known; the nearest is `diffuse`", "replaced by `diffuse`")?;
    }
    old.forget(&["alpha", "use_fast_approx"]);
    old.rename("diffuse_reflectance", "reflectance");
    old.become_plugin("diffuse");
    Ok(())
}

/// A clear coat over something: over `diffuse` nearly a plastic, else left away.
fn coating(old: &mut Old) -> Result<()> {
    let rough = old.plugin() == "roughcoating";
    let plastic = if rough { "roughplastic" } else { "plastic" };
    let inner = old.children(Category::Bsdf).first().map(|id| old.scene.object(*id).clone());
    let message =
        format!("bsdf `{}` is not known; the nearest are `plastic` and `roughplastic`", old.plugin());
    match inner {
        Some(inner) if inner.plugin == "diffuse" => {
            old.replace(message, &format!("replaced by `{plastic}`"))?;
            old.take_children(Category::Bsdf);
            old.forget(&["thickness", "sigma_a"]);
            if let Some(param) = inner.params.into_iter().find(|p| p.name == "reflectance") {
                old.set("diffuse_reflectance", param.value);
            }
            old.set("nonlinear", Value::Bool(true));
            old.become_plugin(plastic);
        }
        Some(inner) => {
            old.replace(message, &format!("replaced by the `{}` within", inner.plugin))?;
            let object = &mut old.scene.objects[old.id as usize];
            (object.plugin, object.params) = (inner.plugin, inner.params);
            // A copy of what is old itself.
            upgrade(old)?;
        }
        None => return Err(old.scene.error(old.pos(), "a coating needs a nested bsdf")),
    }
    Ok(())
}

/// The `scale` of a texture around the height belongs to the bump map.
fn bump(old: &mut Old) -> Result<()> {
    let textures = old.children(Category::Texture);
    let [texture] = textures[..] else { return Ok(()) };
    let outer = Old { scene: &mut *old.scene, id: texture };
    if outer.plugin() != "scale" {
        return Ok(());
    }
    let inner = outer.children(Category::Texture);
    let factor = outer.get("scale").map_or(Some(1.0), |p| number(&p.value));
    let ([inner], Some(factor)) = (&inner[..], factor) else { return Ok(()) };
    let inner = *inner;
    let own = old.take_number("scale").unwrap_or(1.0);
    old.take_children(Category::Texture);
    old.set("scale", Value::Float(own * factor));
    old.nest(inner);
    Ok(())
}
