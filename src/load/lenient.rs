//! What a lenient load puts in the place of what is not known: kinds by their
//! names, and files that are not there. Parameters that nobody reads are left
//! to [`crate::desc::Params::finish`].

use super::old::Old;
use super::old_kinds::plain_path;
use crate::desc::{Category, Error, ObjectId, Result, SceneDesc, Value};
use crate::film::Filter;
use crate::light::Light;
use crate::medium::Medium;
use crate::texture::Texture;
use crate::{integrator, material, scene};

/// Replaces every object of an unknown kind, in a lenient scene.
pub fn replace_unknown(scene: &mut SceneDesc) -> Result<()> {
    if !scene.leniency.is_lenient() {
        return Ok(());
    }
    for id in 0..scene.objects.len() as ObjectId {
        if id != scene.root {
            replace_kind(&mut Old { scene, id })?;
        }
    }
    Ok(())
}

fn replace_kind(old: &mut Old) -> Result<()> {
    let (category, plugin) = (old.category(), old.plugin());
    let known = match category {
        Category::Bsdf => material::NAMES,
        Category::Texture => Texture::NAMES,
        Category::Emitter => Light::NAMES,
        Category::Shape => scene::SHAPES,
        Category::Integrator => integrator::NAMES,
        Category::Rfilter => Filter::NAMES,
        Category::Film => &["hdrfilm"],
        Category::Medium => &[],
        _ => return Ok(()),
    };
    let unknown = match category {
        // It depends on what it does: some only absorb.
        Category::Medium => Medium::from_desc(old.scene, old.id).err().map(|error| error.message),
        _ if known.contains(&plugin.as_str()) => None,
        _ => Some(format!("unknown {} `{plugin}`", category.tag())),
    };
    let Some(unknown) = unknown else { return Ok(()) };
    let outcome = match category {
        Category::Bsdf => "replaced by a grey `diffuse`",
        Category::Texture => "replaced by mid grey",
        Category::Integrator => "replaced by `path`",
        Category::Rfilter => "replaced by the default filter",
        Category::Film => "replaced by `hdrfilm`",
        _ => "left out",
    };
    old.replace(unknown, outcome)?;
    match category {
        Category::Bsdf => {
            old.keep(&[]);
            old.become_plugin("diffuse");
        }
        Category::Texture => grey_texture(old.scene, old.id),
        Category::Integrator => plain_path(old),
        Category::Film => old.become_plugin("hdrfilm"),
        _ => leave_out(old.scene, old.id),
    }
    Ok(())
}

/// Takes an object out of everything that holds it.
fn leave_out(scene: &mut SceneDesc, id: ObjectId) {
    for object in &mut scene.objects {
        object.params.retain(|p| !matches!(p.value, Value::Object(child) if child == id));
    }
}

/// Mid grey; as a normal map, flat.
fn grey_texture(scene: &mut SceneDesc, id: ObjectId) {
    let flat = scene.objects.iter().flat_map(|o| &o.params);
    let mut flat = flat.filter(|p| matches!(p.value, Value::Object(child) if child == id));
    let colour = if flat.any(|p| p.name == "normalmap") { [0.5, 0.5, 1.0] } else { [0.5; 3] };
    let mut old = Old { scene, id };
    old.keep(&[]);
    old.become_plugin("rgb");
    old.set("value", Value::Rgb(colour));
}

/// Goes on without the file that an object needs, in a lenient scene.
///
/// # Errors
/// What is wrong with the file, in a strict one.
pub fn without_file(scene: &mut SceneDesc, id: ObjectId, error: Error) -> Result<()> {
    let category = scene.object(id).category;
    let outcome = match category {
        Category::Texture => "replaced by mid grey",
        Category::Emitter => "replaced by a grey surrounding",
        Category::Bsdf => "replaced by a grey `diffuse`",
        _ => "left out",
    };
    scene.replace(error, outcome)?;
    match category {
        Category::Texture => grey_texture(scene, id),
        Category::Bsdf => {
            let mut old = Old { scene, id };
            old.keep(&[]);
            old.become_plugin("diffuse");
        }
        Category::Emitter => {
            let mut old = Old { scene, id };
            old.keep(&["sampling_weight"]);
            old.become_plugin("constant");
            old.set("radiance", Value::Float(0.5));
        }
        _ => leave_out(scene, id),
    }
    Ok(())
}
