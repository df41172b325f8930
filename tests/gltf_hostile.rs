//! glTF files that are broken or mean harm: a clear message for each, no panic
//! whatever the bytes, and no more memory than the file stands for.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]
#![allow(clippy::print_stdout, reason = "says what it skipped and compared")]

#[path = "common/gltf_file.rs"]
mod gltf_file;

use std::path::Path;
use std::time::{Duration, Instant};

use etendue::desc::Category;
use etendue::load::{LoadOptions, load, load_gltf_bytes};
use etendue::math::Vec3;
use gltf_file::{Gltf, mesh_of, only};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value as Json, json};

/// A square with one thing changed.
fn square(change: impl Fn(&mut Gltf)) -> Gltf {
    let mut file = Gltf::with_material(json!({}));
    change(&mut file);
    file
}

/// Files with one mistake each, and what must be said of them.
#[test]
fn mistakes_are_named() {
    type Change = fn(&mut Gltf);
    let cases: &[(Change, &str)] = &[
        (
            |f| f.json["accessors"][0]["count"] = json!(100),
            "accessors[0]: 100 elements of 12 bytes from byte 0 on reach over the 48 bytes of bufferViews[0]",
        ),
        (
            |f| f.json["accessors"][0]["count"] = json!(1_u64 << 32),
            "accessors[0]: `count` 4294967296 is absurd",
        ),
        (
            |f| f.json["accessors"][0]["count"] = json!(1e18 as u64),
            "accessors[0]: `count` 1000000000000000000 is absurd",
        ),
        (|f| f.json["accessors"][0]["count"] = json!(0), "accessors[0]: `count` is 0"),
        (|f| f.json["accessors"][0]["count"] = json!(-1), "accessors[0].count: invalid value: integer `-1`"),
        (
            |f| f.json["accessors"][0]["byteOffset"] = json!(u64::MAX),
            "accessors[0]: 4 elements of 12 bytes from byte 18446744073709551615 on",
        ),
        (|f| f.json["accessors"][0]["type"] = json!("MAT4"), "accessors[0]: 4 elements of 64 bytes"),
        (
            |f| f.json["accessors"][0]["type"] = json!("VEC2"),
            "meshes[0].primitives[0].attributes.POSITION: must be of type VEC3, but accessors[0] is VEC2",
        ),
        (|f| f.json["accessors"][0]["type"] = json!("VEC9"), "accessors[0]: `type` `VEC9` is of no use here"),
        (
            |f| f.json["accessors"][0]["componentType"] = json!(5127),
            "accessors[0]: `componentType` 5127 is unknown",
        ),
        (|f| f.json["accessors"][0]["bufferView"] = json!(77), "accessors[0]: there is no bufferViews[77]"),
        (
            |f| f.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99),
            "meshes[0].primitives[0].attributes.POSITION: there is no accessors[99]",
        ),
        (|f| f.json["meshes"][0]["primitives"][0]["indices"] = json!(0), "accessors[0]"),
        (
            |f| f.json["meshes"][0]["primitives"][0]["indices"] = json!(9),
            "meshes[0].primitives[0].indices: there is no accessors[9]",
        ),
        (
            |f| f.json["meshes"][0]["primitives"][0]["mode"] = json!(7),
            "meshes[0].primitives[0]: `mode` 7 is unknown",
        ),
        (
            |f| f.json["meshes"][0]["primitives"][0]["material"] = json!(3),
            "meshes[0].primitives[0].material: there is no materials[3]",
        ),
        (
            |f| f.json["accessors"][1]["count"] = json!(3),
            "meshes[0].primitives[0].attributes.NORMAL: has 3 elements, but POSITION 4",
        ),
        (
            |f| f.json["bufferViews"][0]["byteLength"] = json!(1_000_000),
            "bufferViews[0]: 1000000 bytes from 0 on reach over the",
        ),
        (
            |f| f.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX),
            "bufferViews[0]: 48 bytes from 18446744073709551615 on",
        ),
        (|f| f.json["bufferViews"][0]["buffer"] = json!(4), "bufferViews[0]: there is no buffers[4]"),
        (
            |f| f.json["bufferViews"][0]["byteStride"] = json!(4),
            "bufferViews[0].byteStride 4 does not suit elements of 12 bytes",
        ),
        (|f| f.json["nodes"][0]["mesh"] = json!(5), "nodes[0].mesh: there is no meshes[5]"),
        (
            |f| f.json["nodes"][0]["children"] = json!([0]),
            "nodes[0].children[0]: nodes[0] is its own ancestor",
        ),
        (|f| f.json["nodes"][0]["children"] = json!([8]), "nodes[0].children[0]: there is no nodes[8]"),
        (|f| f.json["nodes"][0]["skin"] = json!(0), "nodes[0].skin: there is no skins[0]"),
        (|f| f.json["nodes"][0]["camera"] = json!(0), "nodes[0].camera: there is no cameras[0]"),
        (|f| f.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0]), "nodes[0].rotation: is no rotation"),
        (
            |f| f.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}}),
            "nodes[0].extensions.KHR_lights_punctual: there is no light 0",
        ),
        (|f| f.json["scene"] = json!(2), "scene: there is no scenes[2]"),
        (|f| f.json["scenes"][0]["nodes"] = json!([0, 4]), "scenes[0].nodes[1]: there is no nodes[4]"),
        (|f| f.json["asset"]["version"] = json!("1.0"), "asset.version: is `1.0`; glTF 2.0 is read"),
        (
            |f| f.json["materials"][0]["alphaMode"] = json!("GLASS"),
            "materials[0]: `alphaMode` `GLASS` is unknown",
        ),
        (
            |f| f.json["materials"][0]["normalTexture"] = json!({"index": 0}),
            "materials[0]: there is no textures[0]",
        ),
        (
            |f| f.json["materials"][0]["normalTexture"] = json!({}),
            "materials[0].normalTexture: missing field `index`",
        ),
        (
            |f| {
                f.json["textures"] = json!([{"source": 3}]);
                f.json["materials"][0]["normalTexture"] = json!({"index": 0})
            },
            "textures[0]: there is no images[3]",
        ),
        (
            |f| {
                f.json["textures"] = json!([{"source": 0}]);
                f.json["images"] = json!([{}]);
                f.json["materials"][0]["normalTexture"] = json!({"index": 0})
            },
            "images[0]: needs a `uri` or a `bufferView`",
        ),
        (
            |f| {
                f.json["textures"] = json!([{"source": 0}]);
                f.json["images"] = json!([{"bufferView": 0}]);
                f.json["materials"][0]["normalTexture"] = json!({"index": 0})
            },
            "images[0]: image `images[0]`: no image format that is known",
        ),
        (
            |f| {
                f.json["textures"] = json!([{"source": 0}]);
                f.json["images"] = json!([{"uri": "lost.png"}]);
                f.json["materials"][0]["normalTexture"] = json!({"index": 0})
            },
            "images[0].uri: cannot find the file `lost.png`",
        ),
        (
            |f| {
                f.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 4, "znear": 1}}]);
                f.json["nodes"][0]["camera"] = json!(0)
            },
            "cameras[0].perspective.yfov: must lie between 0 and π",
        ),
        (
            |f| {
                f.json["cameras"] = json!([{"type": "perspective"}]);
                f.json["nodes"][0]["camera"] = json!(0)
            },
            "cameras[0]: needs `perspective`",
        ),
        (
            |f| f.json["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 0, "componentType": 5126}, "values": {"bufferView": 0}}),
            "accessors[0].sparse: `indices.componentType` must be",
        ),
        (
            |f| f.json["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 1, "componentType": 5123, "byteOffset": 10}, "values": {"bufferView": 0}}),
            "accessors[0].sparse: index 16256 is over the 4 elements",
        ),
        (
            |f| f.json["accessors"][0]["sparse"] = json!({"count": 1_u64 << 62, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 0}}),
            "accessors[0].sparse: 4611686018427387904 indices reach over the 48 bytes",
        ),
    ];
    for (change, expected) in cases {
        let error = square(change).error();
        assert!(error.starts_with("test.glb: ") && error.contains(expected), "{expected}\n{error}");
    }
}

#[test]
fn numbers_that_are_none() {
    for (value, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let file = square(|f| f.bin[12..16].copy_from_slice(&value.to_le_bytes()));
        let expected = format!("accessors[0]: element 1 holds a number that is not finite ({shown})");
        assert!(file.error().contains(&expected), "{}", file.error());
    }
    // 1e300 is a number in JSON; a node that large cannot be placed.
    let file = square(|f| f.json["nodes"][0]["scale"] = json!([1e300, 1e300, 1e300]));
    assert!(file.load().unwrap().warnings.iter().any(|w| w.contains("nodes[0]: is scaled to nothing")));
    let text = String::from_utf8(square(|_| ()).gltf()).unwrap().replacen(
        "\"mesh\":0",
        "\"mesh\":0,\"translation\":[1e999,0,0]",
        1,
    );
    let error =
        load_gltf_bytes(text.into_bytes(), "a.gltf", Path::new("."), &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("number out of range"), "{error}");
}

#[test]
fn cycles_bombs_and_chains() {
    let nodes = |children: &[Json]| {
        let mut file = Gltf::default();
        for node in children {
            file.push("nodes", json!({"children": node}));
        }
        file.json["scenes"] = json!([{"nodes": [0]}]);
        file
    };
    assert!(
        nodes(&[json!([1]), json!([2]), json!([1])])
            .error()
            .contains("nodes[1] is a child of nodes[0] already")
    );
    assert!(nodes(&[json!([]), json!([2]), json!([3]), json!([1])]).error().contains("is its own ancestor"));
    // Twenty-eight levels of two ways each would be 2^28 nodes.
    let levels: Vec<Json> = (0..28).map(|i| json!([i + 1, i + 1])).chain([json!([])]).collect();
    assert!(
        nodes(&levels).error().contains("nodes[1] is a child of nodes[0] already; a node has one parent")
    );
    let chain: Vec<Json> = (0..200_000).map(|i| json!([i + 1])).chain([json!([])]).collect();
    assert!(nodes(&chain).error().contains("nodes are nested more than 10000 deep"));
    let deep: Vec<Json> = (0..9_000).map(|i| json!([i + 1])).chain([json!([])]).collect();
    assert!(nodes(&deep).load().is_ok());
    // The same DAG by scenes that list a node twice shows it once.
    let mut twice = square(|f| f.json["scenes"][0]["nodes"] = json!([0, 0, 0]));
    only(&twice.load().unwrap(), Category::Shape, "mesh");
    twice.json["scenes"][0]["nodes"] = json!([]);
    assert!(twice.error().contains("the file shows nothing"));
}

#[test]
fn containers_that_are_cut_off() {
    let whole = square(|_| ()).glb();
    let say = |bytes: &[u8]| {
        load_gltf_bytes(bytes.to_vec(), "a.glb", Path::new("."), &LoadOptions::default())
            .unwrap_err()
            .to_string()
    };
    assert!(say(&whole[..10]).contains("its header has fewer than 12 bytes"));
    assert!(say(&whole[..whole.len() - 1]).contains("the binary glTF is cut off: it should have"));
    let mut lying = whole.clone();
    lying[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(say(&lying).contains("a chunk at byte 12 should have 4294967295 bytes"));
    lying = whole.clone();
    lying[4] = 1;
    assert!(say(&lying).contains("binary glTF of version 1; version 2 is read"));
    lying = whole.clone();
    lying[16] = b'X';
    assert!(say(&lying).contains("the first chunk of the binary glTF is not JSON"));
    assert!(say(b"").contains("EOF while parsing"));
    assert!(
        say(b"{\"asset\":{\"version\":\"2.0\"}").contains("EOF while parsing an object at line 1 column 26")
    );
    assert!(say("[".repeat(200_000).as_bytes()).contains("line 1"));
    assert!(
        say(format!("{{\"asset\":{}", "{\"x\":".repeat(200_000)).as_bytes()).contains("EOF while parsing")
    );
    // Every beginning of the file.
    for length in 0..whole.len() {
        assert!(
            load_gltf_bytes(whole[..length].to_vec(), "a.glb", Path::new("."), &LoadOptions::default())
                .is_err()
        );
    }
    let mut short = square(|_| ());
    short.json["buffers"] = json!([{"byteLength": 1000, "uri": "data:;base64,AAAA"}]);
    let error = load_gltf_bytes(
        serde_json::to_vec(&short.json).unwrap(),
        "a.gltf",
        Path::new("."),
        &LoadOptions::default(),
    );
    assert!(
        error.unwrap_err().to_string().contains("buffers[0]: has 3 bytes, fewer than its `byteLength` 1000")
    );
}

#[test]
fn files_outside_of_the_folder() {
    let dir = tempfile::tempdir().unwrap();
    let inside = dir.path().join("scene");
    std::fs::create_dir(&inside).unwrap();
    std::fs::write(dir.path().join("secret.bin"), [0; 100]).unwrap();
    let say = |uri: &str, allow_outside: bool| {
        let file =
            json!({"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 4}], "nodes": [{}]});
        let path = inside.join("a.gltf");
        std::fs::write(&path, serde_json::to_vec(&file).unwrap()).unwrap();
        let options = LoadOptions { allow_outside, ..LoadOptions::default() };
        load(&path, &options).map_or_else(|e| e.to_string(), |_| "loads".into())
    };
    for uri in ["../secret.bin", "x/../../secret.bin", "/etc/passwd", "%2e%2e/secret.bin", "..\\secret.bin"] {
        assert!(
            say(uri, false).contains("lies outside of the folder of the scene; --allow-outside"),
            "{}",
            say(uri, false)
        );
    }
    for uri in ["file:///etc/passwd", "https://example.org/a.bin", "FILE:/etc/passwd"] {
        for allow_outside in [false, true] {
            assert!(
                say(uri, allow_outside).contains("is no file name; only files on this machine"),
                "{}",
                say(uri, allow_outside)
            );
        }
    }
    assert_eq!(say("../secret.bin", true), "loads");
    assert!(say("sub/../lost.bin", false).contains("cannot find the file"));
    std::fs::create_dir(inside.join("folder.bin")).unwrap();
    assert!(say("folder.bin", false).contains("is not a regular file"));
    #[cfg(target_os = "linux")]
    assert!(say("/dev/zero", true).contains("is not a regular file"));
}

/// Counts that no bytes stand behind cost nothing, or hit the limit.
#[test]
fn memory_is_bounded() {
    let limited = LoadOptions { max_mesh_bytes: 64 << 20, ..LoadOptions::default() };
    let clock = Instant::now();
    let mut file = square(|f| {
        let positions =
            f.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 3_000_000_000_u32}));
        f.json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": positions});
    });
    let error = file.load_with(&limited).unwrap_err().to_string();
    assert!(
        error.contains("the file decodes to more than the 67108864 bytes allowed; `max_mesh_bytes`"),
        "{error}"
    );
    // One accessor by many primitives.
    let primitive = square(|_| ()).json["meshes"][0]["primitives"][0].clone();
    file = square(|f| f.json["meshes"][0]["primitives"] = json!(vec![primitive.clone(); 10]));
    assert_eq!(file.load_with(&limited).unwrap().meshes.len(), 10);
    assert!(file.load_with(&LoadOptions { max_mesh_bytes: 1000, ..LoadOptions::default() }).is_err());
    // A million instances of nothing but zeros.
    file = square(|f| {
        let zeros = f.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 1_000_000}));
        f.json["nodes"][0]["extensions"] =
            json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": zeros}}});
    });
    assert!(file.load_with(&limited).unwrap_err().to_string().contains("decodes to more than"));
    // A picture of 30000 × 30000 texels in its header alone.
    file = square(|f| {
        let map = f.texture(1, &[[0; 4]]);
        let offset = f.json["bufferViews"].as_array().unwrap().last().unwrap()["byteOffset"].as_u64().unwrap()
            as usize;
        f.bin[offset + 16..offset + 24].copy_from_slice(&[0, 0, 0x75, 0x30, 0, 0, 0x75, 0x30]);
        f.json["materials"][0]["normalTexture"] = json!({"index": map});
    });
    let small = LoadOptions { max_image_bytes: 1 << 20, ..LoadOptions::default() };
    assert!(file.load_with(&small).is_err());
    // Two bytes that say "many indices".
    file = square(|f| {
        let view = f.view(&[0xd1, 0, 0, 0, 0, 0]);
        let at = f.json["bufferViews"][view]["byteOffset"].clone();
        f.json["bufferViews"][view] = json!({"buffer": 1, "byteLength": 4_000_000_000_u64, "extensions": {"EXT_meshopt_compression":
            {"buffer": 0, "byteOffset": at, "byteLength": 6, "byteStride": 4, "count": 1_000_000_000, "mode": "INDICES"}}});
    });
    let unlimited = LoadOptions { max_mesh_bytes: u64::MAX, ..LoadOptions::default() };
    assert!(
        file.load_with(&unlimited)
            .unwrap_err()
            .to_string()
            .contains("1000000000 indices cannot be in 6 bytes")
    );
    assert!(clock.elapsed() < Duration::from_secs(10), "{:?}", clock.elapsed());
}

/// A cube by `KHR_draco_mesh_compression`.
fn draco() -> Gltf {
    let mut file = Gltf::default();
    let view = file.view(include_bytes!("data/cube.drc"));
    let positions = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 8}));
    let indices = file.push("accessors", json!({"componentType": 5125, "type": "SCALAR", "count": 36}));
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices, "extensions":
        {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}}}));
    file.node(json!({"mesh": mesh}));
    file.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    file
}

#[test]
fn a_compressed_cube() {
    let scene = draco().load().unwrap();
    let mesh = mesh_of(&scene, only(&scene, Category::Shape, "mesh"));
    assert_eq!((mesh.triangles.len(), mesh.positions.len()), (12, 8));
    assert!(mesh.positions.iter().all(|p| p.abs().distance(Vec3::ONE) < 2e-3), "{:?}", mesh.positions);
    let mut cut = draco();
    cut.json["bufferViews"][0]["byteLength"] = json!(20);
    assert!(
        cut.error()
            .contains("meshes[0].primitives[0].extensions.KHR_draco_mesh_compression: cannot be decoded: "),
        "{}",
        cut.error()
    );
    let mut other = draco();
    other.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] =
        json!(9);
    assert!(
        other.error().contains("attributes.POSITION: the compressed data has no attribute 9"),
        "{}",
        other.error()
    );
}

/// A file that uses most of what can be read.
fn rich() -> Gltf {
    let mut file = Gltf::with_material(json!({"alphaMode": "MASK", "doubleSided": true}));
    let map = file.texture(2, &[[255, 128, 64, 255], [1, 2, 3, 4], [9, 9, 9, 200], [80, 80, 80, 0]]);
    // As BMP: without checksums a broken byte goes further than the decoder.
    let texels = [255, 128, 64, 255, 1, 2, 3, 4, 9, 9, 9, 200, 80, 80, 80, 0].to_vec();
    let mut bmp = std::io::Cursor::new(Vec::new());
    let picture = image::RgbaImage::from_raw(2, 2, texels).unwrap();
    picture.write_to(&mut bmp, image::ImageFormat::Bmp).unwrap();
    let view = file.view(bmp.get_ref());
    file.json["images"][0] = json!({"bufferView": view});
    let info =
        json!({"index": map, "extensions": {"KHR_texture_transform": {"rotation": 1, "scale": [2, 2]}}});
    file.push("samplers", json!({"wrapS": 33071}));
    file.json["textures"][map]["sampler"] = json!(0);
    file.json["materials"][0]["pbrMetallicRoughness"] =
        json!({"baseColorTexture": info, "metallicRoughnessTexture": info});
    file.json["materials"][0]["normalTexture"] = info.clone();
    file.json["materials"][0]["extensions"] = json!({
        "KHR_materials_anisotropy": {"anisotropyStrength": 1, "anisotropyTexture": info},
        "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceThicknessTexture": info},
        "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatNormalTexture": info}});
    let glow = file.push("materials", json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": info}));
    let old = file.push(
        "materials",
        json!({"alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness":
        {"specularGlossinessTexture": info, "diffuseTexture": info}}}),
    );

    // A skinned, morphed square with vertex colours.
    let mut bent = file.square();
    let joints = file.accessor(&[0, 1, 0, 0].repeat(4), 5121, "VEC4", 4);
    let weights = file.floats(&[0.5, 0.5, 0., 0.].repeat(4), "VEC4");
    let colors = file.floats(&[1., 0.5, 0., 0.5].repeat(4), "VEC4");
    let lift = file.floats(&[0., 0., 1.].repeat(4), "VEC3");
    for (name, accessor) in [("JOINTS_0", joints), ("WEIGHTS_0", weights), ("COLOR_0", colors)] {
        bent["attributes"][name] = json!(accessor);
    }
    bent["targets"] = json!([{"POSITION": lift, "NORMAL": lift}]);
    bent["material"] = json!(old);
    let bent = file.mesh(bent);
    let inverse =
        file.floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.].repeat(2), "MAT4");
    file.push("skins", json!({"joints": [0, 2], "inverseBindMatrices": inverse}));
    file.node(json!({"mesh": bent, "skin": 0, "weights": [0.5]}));
    let tip = file.push("nodes", json!({"mesh": 0, "translation": [1, 2, 3], "scale": [1, -1, 2]}));
    file.json["nodes"][0]["children"] = json!([tip]);

    // Instances, a light, a camera, a strip that glows, and two packed meshes.
    let translations = file.floats(&[0., 0., 0., 1., 2., 3.], "VEC3");
    let mut strip = file.square();
    strip["mode"] = json!(5);
    strip["material"] = json!(glow);
    let strip = file.mesh(strip);
    file.node(json!({"mesh": strip, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translations}}}}));
    file.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 1}}]}});
    file.push(
        "cameras",
        json!({"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1.5}}),
    );
    file.node(json!({"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    let cube = draco();
    let view = file.view(&cube.bin);
    let positions = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 8}));
    let packed = file.mesh(json!({"attributes": {"POSITION": positions}, "extensions":
        {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}}}));
    file.node(json!({"mesh": packed}));

    let input = file.floats(&[0.0, 0.5, 1.0], "SCALAR");
    let half = 0.5f32.sqrt();
    let turn = file.floats(&[0., 0., 0., 1., 0., 0., half, half, 0., 0., 1., 0.], "VEC4");
    let move_by = file.floats(&[0.5; 27], "VEC3");
    let weigh = file.floats(&[0., 1., 0.], "SCALAR");
    file.push(
        "animations",
        json!({
        "channels": [
            {"sampler": 0, "target": {"node": 0, "path": "rotation"}},
            {"sampler": 1, "target": {"node": tip, "path": "translation"}},
            {"sampler": 2, "target": {"node": 1, "path": "weights"}},
        ],
        "samplers": [
            {"input": input, "output": turn},
            {"input": input, "output": move_by, "interpolation": "CUBICSPLINE"},
            {"input": input, "output": weigh, "interpolation": "STEP"},
        ]}),
    );
    file
}

/// Somewhere in a tree of JSON, at random.
fn anywhere<'a>(mut json: &'a mut Json, random: &mut Pcg64Mcg) -> &'a mut Json {
    for depth in 0.. {
        let size = match &*json {
            Json::Array(items) => items.len(),
            Json::Object(members) => members.len(),
            _ => 0,
        };
        if size == 0 || (depth > 1 && random.random_range(0..6) == 0) {
            break;
        }
        let i = random.random_range(0..size);
        json = match json {
            Json::Array(items) => &mut items[i],
            Json::Object(members) => members.values_mut().nth(i).unwrap(),
            _ => unreachable!("it has members"),
        };
    }
    json
}

/// A value that something may stumble over.
fn odd(random: &mut Pcg64Mcg, old: &Json) -> Json {
    let words =
        ["", "SCALAR", "MAT4", "VEC4", "STEP", "CUBICSPLINE", "weights", "scale", "MASK", "../x", "data:,"];
    // More often than not of the same type, to come further.
    match old {
        Json::Number(_) if random.random_range(0..3) > 0 => {
            let end = [2_u64, 8, 40, 6000, 1 << 40][random.random_range(0..5)];
            return json!(random.random_range(0..end));
        }
        Json::Array(items) if random.random_range(0..3) > 0 => {
            let mut items = items.clone();
            let turn = 1.min(items.len());
            items.rotate_left(turn);
            items.truncate(random.random_range(0..=items.len()));
            return Json::Array(items);
        }
        Json::Object(members) if random.random_range(0..3) > 0 => {
            let mut members = members.clone();
            let gone = members.keys().nth(random.random_range(0..members.len().max(1))).cloned();
            gone.map(|key| members.remove(&key));
            return Json::Object(members);
        }
        _ => {}
    }
    match random.random_range(0..16) {
        0 => json!(0),
        1 => json!(-1),
        2 => json!(1_u64 << random.random_range(0..63)),
        3 => json!(4_000_000_000_u32),
        4 => json!(1e300),
        5 => json!(-1e-300),
        6 => Json::Null,
        7 => json!(words[random.random_range(0..words.len())]),
        8 => json!([]),
        9 => json!({}),
        10 => json!([old, old]),
        11 => json!(random.random_range(0..8)),
        12 => json!([5120, 5121, 5122, 5123, 5125, 5126][random.random_range(0..6)]),
        13 => json!(random.random_range(-2.0..2.0)),
        14 => json!([0, 0, 0]),
        _ => json!(true),
    }
}

/// Twenty thousand broken files: whatever happens, it is an error or a scene,
/// soon.
#[test]
fn mutations_end_in_an_error_or_a_scene() {
    let rich = rich();
    rich.load().unwrap_or_else(|e| panic!("{e}"));
    let whole = rich.glb();
    let (cases, mut loaded, mut slowest) = (20_000, 0, Duration::ZERO);
    let clock = Instant::now();
    for case in 0..cases {
        let mut random = Pcg64Mcg::seed_from_u64(case);
        let bytes = match case % 4 {
            // Members of the JSON replaced.
            0 | 1 => {
                let mut file = rich.clone();
                for _ in 0..random.random_range(1..4) {
                    let place = anywhere(&mut file.json, &mut random);
                    *place = odd(&mut random, &place.clone());
                }
                file.glb()
            }
            // Bytes of the buffer, with the JSON whole.
            2 => {
                let mut file = rich.clone();
                for _ in 0..random.random_range(1..30) {
                    let at = random.random_range(0..file.bin.len());
                    file.bin[at] = random.random();
                }
                file.glb()
            }
            // Bytes anywhere, and ends cut off.
            _ => {
                let mut bytes = whole.clone();
                for _ in 0..random.random_range(1..10) {
                    let at = random.random_range(0..bytes.len());
                    bytes[at] = random.random();
                }
                if random.random_range(0..4) == 0 {
                    bytes.truncate(random.random_range(0..bytes.len()));
                }
                bytes
            }
        };
        let options = LoadOptions {
            max_mesh_bytes: 16 << 20,
            max_image_bytes: 4 << 20,
            shutter: (case % 3 == 0).then_some([0.0, 12.0]),
            frame: (case % 2 == 0).then_some(3.0),
            ..LoadOptions::default()
        };
        let start = Instant::now();
        let result =
            std::panic::catch_unwind(|| load_gltf_bytes(bytes, "a.glb", Path::new("/nowhere"), &options));
        slowest = slowest.max(start.elapsed());
        match result {
            Ok(Ok(_)) => loaded += 1,
            Ok(Err(error)) => assert!(!error.message.is_empty()),
            Err(_) => panic!("case {case} panics"),
        }
    }
    println!("{loaded} of {cases} loaded; slowest {slowest:?}; {:?} in all", clock.elapsed());
    assert!(loaded > 500 && loaded < cases - 5000, "{loaded} of {cases} loaded");
    assert!(slowest < Duration::from_secs(2), "{slowest:?}");
}
