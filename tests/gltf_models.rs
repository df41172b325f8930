//! The glTF models of `shared/scenes/gltf`: what is valid is built and has the
//! triangles that the `gltf` crate finds in it; what is not is refused with a
//! message that says why.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]
#![allow(clippy::print_stdout, reason = "says what it skipped and compared")]

#[path = "common/gltf_file.rs"]
mod gltf_file;
#[path = "common/shared_models.rs"]
mod shared_models;

use etendue::desc::{Category, SceneDesc};
use etendue::load::{LoadOptions, load};
use etendue::math::Vec3;
use etendue::scene::{BuildOptions, Scene};
use gltf_file::{all, mesh_of};
use shared_models::{buffers, models};

/// Files that are wrong on purpose or lack a part, and what is said of them.
const REFUSED: &[(&str, &str)] = &[
    ("BoxWithInfinites.glb", "accessors[2]: element 0 holds a number that is not finite (-inf)"),
    (
        "IndexOutOfRange.gltf",
        "meshes[0].primitives[0].indices: element 0 is vertex 255, but there are only 24",
    ),
    ("AllIndicesOutOfRange.gltf", "indices: element 0 is vertex 65535, but there are only 24 vertices"),
    ("MissingBin/BoxTextured.gltf", "buffers[0].uri: cannot find the file `BoxTextured0.bin`"),
    ("RecursiveNodes.gltf", "nodes[0]: is its own ancestor"),
    ("sceneWrongType.gltf", "scene: invalid type: string \"hello\", expected usize at line 6 column 20"),
    ("NoScene.gltf", "scene: there is no scenes[0]"),
    ("SceneWithoutNodes.gltf", "scenes: the file shows nothing: no scene of it has nodes"),
    ("badArray.gltf", "meshes[0].primitives: invalid type: map, expected a sequence at line 44"),
    ("badExtension.gltf", "KHR_texture_transform: invalid type: string \"Not an object\""),
    ("badNumber.gltf", "materials[0].normalTexture.scale: invalid type: string \"not a number\""),
    ("badObject.gltf", "materials[0].pbrMetallicRoughness[0]: invalid type: string \"not an object\""),
    ("badUint.gltf", "baseColorTexture.index: invalid value: integer `-1`"),
    ("techniqueWebGL/BoxTextured.gltf", "extensionsRequired: `KHR_technique_webgl` is not supported"),
    ("TestScene.gltf", "buffers[0].uri: cannot find the file `TestScene.bin`"),
];

/// Triangles that are put into the world, and the box around them.
fn placed(scene: &SceneDesc) -> usize {
    all(scene, Category::Shape, "mesh").iter().map(|shape| mesh_of(scene, shape).triangles.len()).sum()
}

#[test]
fn all_models_load_or_say_why_not() {
    let models = models();
    if models.is_empty() {
        return;
    }
    assert!(models.len() > 50, "only {} models", models.len());
    let mut refused = 0;
    for path in &models {
        let name = path.display().to_string();
        let expected = REFUSED.iter().find(|(file, _)| name.ends_with(file));
        match (load(path, &LoadOptions::default()), expected) {
            (Ok(scene), None) => {
                Scene::build(&scene, &BuildOptions::default()).unwrap_or_else(|e| panic!("{e}"));
            }
            (Err(error), Some((_, part))) => {
                assert!(error.to_string().contains(part), "{error}");
                refused += 1;
            }
            (Ok(_), Some((_, part))) => panic!("{name} loads; it should say: {part}"),
            (Err(error), None) => panic!("{error}"),
        }
    }
    assert_eq!(refused, REFUSED.len());
}

/// The same file read by another program.
#[test]
fn triangles_agree_with_the_gltf_crate() {
    let mut compared = 0;
    for path in models() {
        let (Ok(scene), Ok(file)) = (load(&path, &LoadOptions::default()), gltf::Gltf::open(&path)) else {
            continue;
        };
        // It knows neither skins nor the compression, and takes a scene's nodes
        // as they come.
        let plain =
            file.skins().len() == 0 && file.extensions_used().all(|e| e != "KHR_draco_mesh_compression");
        let Some(buffers) = buffers(&path, &file).filter(|_| plain) else { continue };
        let (mut triangles, mut low, mut high) = (0, Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut used: Vec<usize> = Vec::new();
        let mut nodes: Vec<gltf::Node> =
            file.default_scene().or(file.scenes().next()).unwrap().nodes().collect();
        while let Some(node) = nodes.pop() {
            used.extend(node.mesh().map(|m| m.index()));
            nodes.extend(node.children());
        }
        let uses = |mesh: usize| used.iter().filter(|m| **m == mesh).count();
        for mesh in file.meshes().filter(|m| uses(m.index()) > 0) {
            for primitive in mesh.primitives() {
                let reader = primitive.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
                let Some(positions) = reader.read_positions() else { continue };
                let positions: Vec<Vec3> = positions.map(Vec3::from).collect();
                let count = reader.read_indices().map_or(positions.len(), |i| i.into_u32().count());
                // Morphed meshes are made once for each node.
                let copies = if primitive.morph_targets().len() > 0 { uses(mesh.index()) } else { 1 };
                triangles += copies
                    * match primitive.mode() {
                        gltf::mesh::Mode::Triangles => count / 3,
                        gltf::mesh::Mode::TriangleStrip | gltf::mesh::Mode::TriangleFan => count - 2,
                        _ => continue,
                    };
                low = positions.iter().copied().fold(low, Vec3::min);
                high = positions.iter().copied().fold(high, Vec3::max);
            }
        }
        assert_eq!(placed(&scene), triangles, "{}", path.display());
        let points = scene.meshes.iter().filter(|m| m.deformation.is_empty()).flat_map(|m| &m.positions);
        let (mut our_low, mut our_high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for p in points {
            (our_low, our_high) = (our_low.min(*p), our_high.max(*p));
        }
        // Weights that are not zero at rest move what is morphed.
        if file.meshes().all(|m| m.weights().is_none_or(|w| w.iter().all(|w| *w == 0.0))) {
            assert_eq!((our_low, our_high), (low, high), "{}", path.display());
        }
        compared += 1;
    }
    println!("{compared} files compared");
    assert!(compared == 0 || compared > 30, "{compared}");
}

/// The engine that is stored both ways: as many triangles as the compressed
/// file says (its encoder dropped those without area), in the same places.
#[test]
fn draco_agrees_with_the_plain_file() {
    let find = |part: &str| models().into_iter().find(|p| p.display().to_string().contains(part));
    let (Some(packed), Some(plain)) =
        (find("draco/2CylinderEngine.gltf"), find("2CylinderEngine-glTF-Binary/2CylinderEngine.glb"))
    else {
        return;
    };
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&packed).unwrap()).unwrap();
    let counts: Vec<u64> = (json["meshes"].as_array().unwrap().iter())
        .flat_map(|mesh| mesh["primitives"].as_array().unwrap())
        .map(|p| json["accessors"][p["indices"].as_u64().unwrap() as usize]["count"].as_u64().unwrap() / 3)
        .collect();
    let [packed, plain] = [packed, plain].map(|path| load(&path, &LoadOptions::default()).unwrap());
    assert_eq!(packed.meshes.len(), plain.meshes.len());
    assert!(packed.meshes.len() > 20);
    for ((a, b), count) in packed.meshes.iter().zip(&plain.meshes).zip(counts) {
        assert_eq!(a.triangles.len() as u64, count);
        let extent = |m: &etendue::desc::Mesh| {
            let low = m.positions.iter().copied().reduce(Vec3::min).unwrap();
            let high = m.positions.iter().copied().reduce(Vec3::max).unwrap();
            (low, high)
        };
        let ((low, high), (other_low, other_high)) = (extent(a), extent(b));
        // Quantised to 14 bits or fewer.
        let allowed = (high - low).length() * 1e-3;
        assert!(low.distance(other_low) < allowed && high.distance(other_high) < allowed);
    }
}
