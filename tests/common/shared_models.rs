//! The glTF models of `shared/scenes/gltf`, which are not part of the package.

#![allow(dead_code, reason = "each test file uses a part")]

use std::path::{Path, PathBuf};

use etendue::desc::{Category, SceneDesc, Value};
use etendue::math::{DVec3, Transform};

/// All files, sorted; none (said once) where the folder is not there.
pub fn models() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/gltf");
    let found = [folder, Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes/gltf")];
    let Some(folder) = found.iter().find(|f| f.is_dir()) else {
        println!("no folder shared/scenes/gltf: skipped");
        return Vec::new();
    };
    let (mut files, mut folders) = (Vec::new(), vec![folder.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(|e| e.to_str()) {
                _ if path.is_dir() => folders.push(path),
                Some("gltf" | "glb") => files.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    files
}

/// The one whose path ends with that.
pub fn model(end: &str) -> Option<PathBuf> {
    let models = models();
    let found = models.iter().find(|p| p.display().to_string().ends_with(end));
    assert!(models.is_empty() || found.is_some(), "there is no {end}");
    found.cloned()
}

/// The buffers of a file as the `gltf` crate would find them.
pub fn buffers(path: &Path, file: &gltf::Gltf) -> Option<Vec<Vec<u8>>> {
    use base64::Engine;
    file.buffers()
        .map(|buffer| match buffer.source() {
            gltf::buffer::Source::Bin => file.blob.clone(),
            gltf::buffer::Source::Uri(uri) => match uri.split_once(";base64,") {
                Some((_, data)) => base64::engine::general_purpose::STANDARD.decode(data).ok(),
                None => std::fs::read(path.with_file_name(uri)).ok(),
            },
        })
        .collect()
}

/// The vertices of a shape, in their places.
fn placed(desc: &SceneDesc, id: u32) -> Vec<DVec3> {
    let (mut points, mut children, mut place) = (Vec::new(), Vec::new(), Transform::IDENTITY);
    for param in &desc.object(id).params {
        match &param.value {
            Value::Mesh(index) => {
                let mesh = &desc.meshes[*index as usize];
                let used = mesh.triangles.iter().flatten().map(|i| mesh.positions[*i as usize].as_dvec3());
                points.extend(used);
            }
            Value::Transform(t) if param.name == "to_world" => place = *t,
            Value::Object(child) if desc.object(*child).category == Category::Shape => children.push(*child),
            _ => {}
        }
    }
    points.extend(children.iter().flat_map(|child| placed(desc, *child)));
    points.iter().map(|p| place.point(*p)).collect()
}

fn box_of(points: &[DVec3]) -> (DVec3, DVec3) {
    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)))
}

/// The box around all meshes that stand still, instances of groups included.
pub fn world(desc: &SceneDesc) -> (DVec3, DVec3) {
    let shown = desc.object(desc.root).params.iter().filter_map(|p| match p.value {
        Value::Object(id) => Some(id),
        _ => None,
    });
    let shapes = shown.filter(|id| {
        let object = desc.object(*id);
        object.category == Category::Shape && object.plugin != "shapegroup"
    });
    let points: Vec<DVec3> = shapes.flat_map(|id| placed(desc, id)).collect();
    box_of(&points)
}

/// Names of meshes that stand still, and the middles of their boxes.
pub fn boxes(desc: &SceneDesc) -> Vec<(String, DVec3)> {
    let meshes = (0..desc.objects.len() as u32).filter(|id| desc.object(*id).plugin == "mesh");
    let middle = |id: u32| {
        let (low, high) = box_of(&placed(desc, id));
        0.5 * (low + high)
    };
    meshes.map(|id| (desc.object(id).id.clone(), middle(id))).collect()
}
