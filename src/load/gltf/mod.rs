//! glTF 2.0 (`.gltf`, `.glb`) to [`SceneDesc`]: the same objects that the
//! reader of Mitsuba files makes. What is read and what is not is listed in
//! `docs/gltf.md`.
//!
//! Errors name the file and the place in its JSON. A file is checked as it is
//! read: indices, sizes, types and numbers before they are used, the nodes for
//! being a forest, and what is allocated against the bytes that are there and
//! two budgets ([`LoadOptions::max_mesh_bytes`], [`LoadOptions::max_image_bytes`]).
//!
//! Units are glTF's: metres, seconds, y up; a candela counts as 1 W/sr and a
//! lux as 1 W/m² of the renderer.

mod accessor;
mod camera;
mod deform;
mod draco;
mod emission;
mod extra;
mod geometry;
mod json;
mod light;
mod material;
mod meshopt;
mod motion;
mod nodes;
mod objects;
mod place;
mod scene;
mod source;
mod tangent;
mod texture;

use std::path::Path;

use super::LoadOptions;
use crate::desc::{Error, Leniency, Pos, Result, SceneDesc, nearest};
use objects::Objects;
use source::Source;

/// Extensions that are read, wholly or with a warning that says what is not.
const KNOWN: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Extensions that say nothing about the picture.
const SILENT: &[&str] = &[
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
];

/// What is lost with some others.
const LOST: &[(&str, &str)] = &[
    ("EXT_lights_ies", "measured light distributions"),
    ("EXT_lights_image_based", "the environment (--env gives one)"),
    ("KHR_animation_pointer", "animations of anything but nodes"),
    ("KHR_gaussian_splatting", "splats"),
    ("KHR_materials_subsurface", "light within materials"),
    ("KHR_materials_volume_scatter", "light scattered within materials"),
    ("KHR_mesh_primitive_restart", "strips and fans in several pieces"),
    ("KHR_node_visibility", "what hides nodes"),
    ("KHR_techniques_webgl", "its shaders"),
    ("KHR_meshopt_compression", "compressed meshes, where there is no fallback"),
    ("MSFT_lod", "coarser versions of nodes"),
    ("MSFT_texture_dds", "DDS images, where there is another"),
];

/// True if a file is one of these, by its ending.
pub fn is_gltf(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    ending == "gltf" || ending == "glb"
}

/// Loads a scene file with everything it names.
pub fn load(path: &Path, options: &LoadOptions) -> Result<SceneDesc> {
    let name = path.display().to_string();
    let at = |e: Error| e.at(name.clone(), Pos::default());
    let source = Source::read(path, options).map_err(at)?;
    build(&source, options).map_err(at)
}

/// Loads a scene from the bytes of a `.gltf` or `.glb` file; files it names are
/// looked for in `folder`.
pub fn load_bytes(bytes: Vec<u8>, name: &str, folder: &Path, options: &LoadOptions) -> Result<SceneDesc> {
    let at = |e: Error| e.at(name, Pos::default());
    let source = Source::from_bytes(bytes, name.to_string(), folder.to_path_buf(), options).map_err(at)?;
    build(&source, options).map_err(at)
}

fn build(source: &Source, options: &LoadOptions) -> Result<SceneDesc> {
    let mut objects = Objects::new(&source.name);
    if options.lenient {
        objects.desc.leniency = Leniency::lenient();
    }
    extensions(source, &mut objects.desc)?;
    scene::build(source, options, objects)
}

/// Refuses what a file requires and nobody knows; says what else is lost.
fn extensions(source: &Source, scene: &mut SceneDesc) -> Result<()> {
    let known = |name: &&String| KNOWN.contains(&name.as_str());
    let required = &source.root.extensions_required;
    for name in required.iter().filter(|n| !known(n) && !SILENT.contains(&n.as_str())) {
        let error = fail("extensionsRequired", format!("`{name}` is not supported"));
        let error = match name.as_str() {
            "KHR_meshopt_compression" => {
                error.hint("`gltf-transform meshopt` or `gltfpack -cc` write EXT_meshopt_compression")
            }
            "MSFT_texture_dds" => error.hint("convert the images to PNG or JPEG"),
            _ => match nearest(name, KNOWN.iter().copied()) {
                Some(near) => error.hint(format!("did you mean `{near}`?")),
                None => error.hint("the file says that it cannot be shown without it; --lenient tries"),
            },
        };
        scene.replace(error.at(source.name.clone(), Pos::default()), "shown without it")?;
    }
    let lost: Vec<String> = source
        .root
        .extensions_used
        .iter()
        .filter(|name| !known(name) && !SILENT.contains(&name.as_str()))
        .map(|name| match LOST.iter().find(|(n, _)| n == name) {
            Some((_, what)) => format!("{name} ({what})"),
            None => name.clone(),
        })
        .collect();
    if !lost.is_empty() {
        scene.warnings.push(format!(
            "{}: extensions that are not read, with what they add: {}",
            source.name,
            lost.join(", ")
        ));
    }
    Ok(())
}

/// An error at a place in the JSON.
fn fail(place: &str, message: impl std::fmt::Display) -> Error {
    Error::new(format!("{place}: {message}"))
}

/// The one of several named things that an option chooses, by name or index.
fn choose<'a>(what: &str, wanted: &str, names: impl Iterator<Item = &'a str>) -> Result<usize> {
    let names: Vec<&str> = names.collect();
    if let Some(index) = names.iter().position(|n| *n == wanted) {
        return Ok(index);
    }
    match wanted.parse::<usize>() {
        Ok(index) if index < names.len() => Ok(index),
        _ if names.is_empty() => Err(Error::new(format!("the file has no {what}, so not `{wanted}`"))),
        Ok(_) => {
            Err(Error::new(format!("there is no {what} {wanted}; they count from 0 to {}", names.len() - 1)))
        }
        Err(_) => Err(Error::new(format!("there is no {what} `{wanted}`")).suggest(wanted, names)),
    }
}
