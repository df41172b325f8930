//! glTF files to scene descriptions: each feature with what is expected of it.
//! Files are made in code; the sample models of `shared/scenes/gltf` are read
//! where they are.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/gltf_file.rs"]
mod gltf_file;

use std::path::Path;

use etendue::desc::{Category, Pixels, SceneDesc, Value};
use etendue::load::{LoadOptions, load, load_gltf_bytes};
use etendue::math::{DVec3, Vec2, Vec3, Vec4};
use gltf_file::{Gltf, all, float, mesh_of, only, param, rgb, texture, to_world, word};
use serde_json::json;

fn near(a: DVec3, b: [f64; 3]) -> bool {
    a.distance(DVec3::from(b)) < 1e-6
}

/// True if a warning contains all of these words.
fn warns(scene: &SceneDesc, words: &[&str]) -> bool {
    scene.warnings.iter().any(|w| words.iter().all(|word| w.contains(word)))
}

#[test]
fn a_square() {
    let mut file = Gltf::default();
    let square = file.square();
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh, "name": "floor", "translation": [1, 2, 3]}));
    let scene = file.load().unwrap();
    let shape = only(&scene, Category::Shape, "mesh");
    assert_eq!(shape.id, "floor");
    assert!(near(to_world(shape).point(DVec3::ZERO), [1.0, 2.0, 3.0]));
    let mesh = mesh_of(&scene, shape);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert!(mesh.uvs.is_empty(), "nothing reads them");
    assert!(param(shape, "face_normals").is_none());
    // The default material of the specification.
    let bsdf = only(&scene, Category::Bsdf, "gltf");
    assert_eq!(
        (rgb(bsdf, "base_color"), float(bsdf, "metallic"), float(bsdf, "roughness")),
        ([1.0; 3], 1.0, 1.0)
    );
    // What a file without camera and light gets.
    assert!(warns(&scene, &["shows no camera"]) && warns(&scene, &["no light", "white"]));
    assert_eq!(rgb(only(&scene, Category::Emitter, "constant"), "radiance"), [1.0; 3]);
    assert!(matches!(
        param(only(&scene, Category::Integrator, "volpath"), "max_depth"),
        Some(Value::Int(-1))
    ));
}

#[test]
fn one_file_in_three_ways() {
    let mut file = Gltf::with_material(json!({}));
    let name = |bytes: Vec<u8>, name: &str, dir: &Path| {
        load_gltf_bytes(bytes, name, dir, &LoadOptions::default()).unwrap().content_hash()
    };
    let binary = name(file.glb(), "a.glb", Path::new("."));
    assert_eq!(binary, name(file.gltf(), "a.gltf", Path::new(".")));
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("my data")).unwrap();
    std::fs::write(dir.path().join("my data/a.bin"), &file.bin).unwrap();
    file.json["buffers"] = json!([{"byteLength": file.bin.len(), "uri": "./my%20data/a.bin"}]);
    let path = dir.path().join("a.gltf");
    std::fs::write(&path, serde_json::to_vec(&file.json).unwrap()).unwrap();
    assert_eq!(binary, load(&path, &LoadOptions::default()).unwrap().content_hash());
}

/// Positions as integers, scaled or not, with strides and holes, sparse, and
/// without a view.
#[test]
fn accessors() {
    let positions = |make: &dyn Fn(&mut Gltf) -> usize| {
        let mut file = Gltf::default();
        let positions = make(&mut file);
        let mesh = file.mesh(json!({"attributes": {"POSITION": positions}}));
        file.node(json!({"mesh": mesh}));
        file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let scene = file.load().unwrap();
        mesh_of(&scene, only(&scene, Category::Shape, "mesh")).positions.clone()
    };
    let corners = [Vec3::ZERO, Vec3::X, Vec3::NEG_Y];
    let scaled = |component: u32, bytes: &[u8]| {
        positions(&|file| {
            let accessor = file.accessor(bytes, component, "VEC3", 3);
            file.json["accessors"][accessor]["normalized"] = json!(true);
            accessor
        })
    };
    assert_eq!(scaled(5120, &[0, 0, 0, 127, 0, 0, 0, 0x81, 0]), corners);
    // −128 means −1 too.
    assert_eq!(scaled(5120, &[0, 0, 0, 127, 0, 0, 0, 0x80, 0]), corners);
    let shorts: Vec<u8> =
        [0i16, 0, 0, 32767, 0, 0, 0, -32767, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(scaled(5122, &shorts), corners);
    assert_eq!(scaled(5121, &[0, 0, 0, 255, 0, 0, 0, 51, 0])[2], Vec3::new(0.0, 51.0 / 255.0, 0.0));
    let shorts: Vec<u8> =
        [0u16, 0, 0, 65535, 0, 0, 0, 13107, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(scaled(5123, &shorts)[2], Vec3::new(0.0, 0.2, 0.0));
    // Not normalised: as they are.
    assert_eq!(positions(&|f| f.accessor(&[0, 0, 0, 5, 0, 0, 0, 7, 0], 5121, "VEC3", 3))[1], Vec3::X * 5.0);
    // Four bytes apart, from the second byte on.
    let strided = positions(&|file| {
        let accessor = file.accessor(&[9, 0, 0, 0, 9, 1, 0, 0, 9, 0, 255, 0, 9], 5120, "VEC3", 3);
        file.json["bufferViews"][0]["byteStride"] = json!(4);
        file.json["accessors"][accessor]["byteOffset"] = json!(1);
        accessor
    });
    assert_eq!(strided, corners);
    let sparse = |base: bool| {
        positions(&|file| {
            let indices = file.view(&[1, 2]);
            let values: Vec<u8> = [1f32, 0., 0., 0., -1., 0.].iter().flat_map(|v| v.to_le_bytes()).collect();
            let values = file.view(&values);
            let accessor = if base {
                file.floats(&[0.0; 9], "VEC3")
            } else {
                file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 3}))
            };
            file.json["accessors"][accessor]["sparse"] = json!({"count": 2,
                "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}});
            accessor
        })
    };
    assert_eq!((sparse(true), sparse(false)), (corners.to_vec(), corners.to_vec()));
}

#[test]
fn topology_and_flat_normals() {
    let load = |mode: u32, count: usize| {
        let mut file = Gltf::default();
        let points: Vec<f32> = (0..count).flat_map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
        let positions = file.floats(&points, "VEC3");
        let mesh = file.mesh(json!({"attributes": {"POSITION": positions}, "mode": mode}));
        file.node(json!({"mesh": mesh}));
        file.load().unwrap()
    };
    let triangles = |mode, count| {
        let scene = load(mode, count);
        let shape = only(&scene, Category::Shape, "mesh");
        assert!(matches!(param(shape, "face_normals"), Some(Value::Bool(true))), "no normals: flat");
        mesh_of(&scene, shape).triangles.clone()
    };
    assert_eq!(triangles(4, 6), [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(triangles(5, 5), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
    assert_eq!(triangles(6, 5), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
    for (mode, what) in [(0, "points"), (1, "lines"), (2, "lines"), (3, "lines")] {
        let scene = load(mode, 4);
        assert!(warns(&scene, &["meshes[0].primitives[0]", what]), "{:?}", scene.warnings);
        assert!(all(&scene, Category::Shape, "mesh").is_empty());
    }
    let scene = load(4, 5);
    assert!(warns(&scene, &["last triangle"]));
}

/// Tangents by MikkTSpace: along u, with the sign for green upwards.
#[test]
fn tangents_are_made_when_a_normal_map_asks() {
    let made = |uvs: [f32; 8], set: u32, flat: bool| {
        let mut file = Gltf::default();
        let mut square = file.square();
        let uvs = file.floats(&uvs, "VEC2");
        square["attributes"][format!("TEXCOORD_{set}")] = json!(uvs);
        if flat {
            square["attributes"].as_object_mut().unwrap().remove("NORMAL");
        }
        let map = file.texture(1, &[[128, 128, 255, 255]]);
        square["material"] = json!(
            file.push("materials", json!({"normalTexture": {"index": map, "texCoord": set, "scale": 0.5}}))
        );
        let mesh = file.mesh(square);
        file.node(json!({"mesh": mesh}));
        file.load().unwrap()
    };
    let down = [0., 1., 1., 1., 1., 0., 0., 0.];
    let up = [0., 0., 1., 0., 1., 1., 0., 1.];
    for (uvs, set, flat, expected) in [
        (down, 0, false, Vec4::new(1.0, 0.0, 0.0, 1.0)),
        (up, 0, false, Vec4::new(1.0, 0.0, 0.0, -1.0)),
        (up, 1, false, Vec4::new(1.0, 0.0, 0.0, -1.0)),
        (down, 0, true, Vec4::new(1.0, 0.0, 0.0, 1.0)),
    ] {
        let scene = made(uvs, set, flat);
        let shape = only(&scene, Category::Shape, "mesh");
        let mesh = mesh_of(&scene, shape);
        assert_eq!((mesh.positions.len(), &mesh.normals[..]), (4, &[Vec3::Z; 4][..]));
        assert!(mesh.tangents.iter().all(|t| t.distance(expected) < 1e-6), "{:?}", mesh.tangents);
        assert!(param(shape, "face_normals").is_none());
        let bsdf = only(&scene, Category::Bsdf, "gltf");
        assert_eq!(float(bsdf, "normal_scale"), 0.5);
        let map = texture(&scene, bsdf, "normal");
        assert!(matches!(param(map, "raw"), Some(Value::Bool(true))));
        if set == 1 {
            assert_eq!(word(map, "uv_attribute"), "vertex_texcoord1");
            let attribute = mesh.attributes.iter().find(|a| a.name == "vertex_texcoord1").unwrap();
            assert_eq!((attribute.channels, attribute.values.len()), (2, 8));
        } else {
            assert_eq!(mesh.uvs.len(), 4);
            assert!(param(map, "uv_attribute").is_none());
        }
    }
}

#[test]
fn given_tangents_are_kept() {
    let mut file = Gltf::default();
    let mut square = file.square();
    let tangents = file.floats(&[0., 1., 0., -1.].repeat(4), "VEC4");
    square["attributes"]["TANGENT"] = json!(tangents);
    let map = file.texture(1, &[[128, 128, 255, 255]]);
    square["material"] = json!(file.push("materials", json!({"normalTexture": {"index": map}})));
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh}));
    let scene = file.load().unwrap();
    let mesh = mesh_of(&scene, only(&scene, Category::Shape, "mesh"));
    assert_eq!(mesh.tangents, [Vec4::new(0.0, 1.0, 0.0, -1.0); 4]);
}

#[test]
fn hierarchy_and_instances() {
    let mut file = Gltf::default();
    let square = file.square();
    let mesh = file.mesh(square);
    // A matrix (column by column) above a rotation, scale and translation.
    let child = file.push(
        "nodes",
        json!({"mesh": mesh, "translation": [0, 1, 0], "rotation": [0, 0, 0.5_f64.sqrt(), 0.5_f64.sqrt()], "scale": [2, 1, 1]}),
    );
    file.node(json!({"children": [child], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1]}));
    let scene = file.load().unwrap();
    // x is doubled, turned to y, moved up by 1 and right by 10.
    assert!(near(to_world(only(&scene, Category::Shape, "mesh")).point(DVec3::X), [10.0, 3.0, 0.0]));

    file.node(json!({"mesh": mesh, "translation": [5, 0, 0], "name": "twin"}));
    let scene = file.load().unwrap();
    let group = only(&scene, Category::Shape, "shapegroup");
    assert!(param(group, "to_world").is_none() && !group.id.is_empty());
    let inside = only(&scene, Category::Shape, "mesh");
    assert!(param(inside, "to_world").is_none());
    assert!(
        group
            .params
            .iter()
            .any(|p| matches!(p.value, Value::Object(id) if std::ptr::eq(scene.object(id), inside)))
    );
    let instances = all(&scene, Category::Shape, "instance");
    assert_eq!((instances.len(), scene.meshes.len()), (2, 1));
    assert!(instances.iter().all(|i| {
        i.params.iter().any(|p| matches!(p.value, Value::Object(id) if std::ptr::eq(scene.object(id), group)))
    }));
    let twin = instances.iter().find(|i| i.id == "twin").unwrap();
    assert!(near(to_world(twin).point(DVec3::X), [6.0, 0.0, 0.0]));
    // The group and its instances are in the scene, the shape in the group only.
    let root = scene.object(scene.root);
    let in_scene = |o: &etendue::desc::Object| {
        root.params.iter().any(|p| matches!(p.value, Value::Object(id) if std::ptr::eq(scene.object(id), o)))
    };
    assert!(in_scene(group) && in_scene(twin) && !in_scene(inside));
}

#[test]
fn what_glows_is_never_in_a_group() {
    let mut file = Gltf::with_material(json!({"emissiveFactor": [1, 0.5, 0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}}));
    file.node(json!({"mesh": 0, "translation": [2, 0, 0]}));
    let scene = file.load().unwrap();
    assert_eq!(
        (all(&scene, Category::Shape, "mesh").len(), all(&scene, Category::Shape, "instance").len()),
        (2, 0)
    );
    assert_eq!(rgb(only(&scene, Category::Emitter, "area"), "radiance"), [4.0, 2.0, 0.0]);
    assert!(all(&scene, Category::Emitter, "constant").is_empty(), "it lights itself");
}

#[test]
fn gpu_instancing() {
    let mut file = Gltf::default();
    let square = file.square();
    let mesh = file.mesh(square);
    let translations = file.floats(&[0., 0., 0., 1., 2., 3.], "VEC3");
    let scales = file.floats(&[1., 1., 1., 2., 2., 2.], "VEC3");
    // A quarter turn around z in normalised bytes would do too; here as floats.
    let half = 0.5f32.sqrt();
    let rotations = file.floats(&[0., 0., 0., 1., 0., 0., half, half], "VEC4");
    file.node(json!({"mesh": mesh, "translation": [10, 0, 0], "extensions": {"EXT_mesh_gpu_instancing":
        {"attributes": {"TRANSLATION": translations, "SCALE": scales, "ROTATION": rotations}}}}));
    let scene = file.load().unwrap();
    let instances = all(&scene, Category::Shape, "instance");
    assert_eq!(instances.len(), 2);
    assert!(near(to_world(instances[1]).point(DVec3::X), [11.0, 4.0, 3.0]));
}

#[test]
fn mirrored_and_squeezed_nodes() {
    let mut file = Gltf::default();
    let square = file.square();
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh, "scale": [-1, 1, 1]}));
    let scene = file.load().unwrap();
    let shape = only(&scene, Category::Shape, "mesh");
    // The front stays in front: +z, as the normals say.
    let [a, b, c] = mesh_of(&scene, shape).triangles[0]
        .map(|i| to_world(shape).point(mesh_of(&scene, shape).positions[i as usize].as_dvec3()));
    assert!((b - a).cross(c - a).z > 0.0);
    file.json["nodes"][0]["scale"] = json!([0, 0, 0]);
    let scene = file.load().unwrap();
    assert!(
        warns(&scene, &["nodes[0]", "scaled to nothing"]) && all(&scene, Category::Shape, "mesh").is_empty()
    );
}

#[test]
fn material_parameters() {
    let scene = Gltf::with_material(json!({
        "name": "car paint", "doubleSided": true,
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0.25, "roughnessFactor": 0.75},
        "extensions": {
            "KHR_materials_ior": {"ior": 1.7},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [2, 1, 0]},
            "KHR_materials_transmission": {"transmissionFactor": 0.6},
            "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 0.5, "attenuationColor": [1, 0, 0]},
            "KHR_materials_dispersion": {"dispersion": 0.1},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.9, "clearcoatRoughnessFactor": 0.05},
            "KHR_materials_sheen": {"sheenColorFactor": [0.3, 0.2, 0.1], "sheenRoughnessFactor": 0.4},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.8, "anisotropyRotation": 1.25},
            "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": 1.4, "iridescenceThicknessMaximum": 550},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.2, "diffuseTransmissionColorFactor": [0, 1, 0]},
        }
    }))
    .load()
    .unwrap();
    let bsdf = only(&scene, Category::Bsdf, "gltf");
    assert_eq!(bsdf.id, "car paint");
    for (name, value) in [
        ("metallic", 0.25),
        ("roughness", 0.75),
        ("ior", 1.7),
        ("specular", 0.5),
        ("transmission", 0.6),
        ("thickness", 2.0),
        ("dispersion", 0.1),
        ("clearcoat", 0.9),
        ("clearcoat_roughness", 0.05),
        ("sheen_roughness", 0.4),
        ("anisotropy", 0.8),
        ("anisotropy_rotation", 1.25),
        ("iridescence", 1.0),
        ("iridescence_ior", 1.4),
        ("iridescence_thickness", 550.0),
        ("diffuse_transmission", 0.2),
    ] {
        assert_eq!(float(bsdf, name), value, "{name}");
    }
    for (name, value) in [
        ("base_color", [0.1, 0.2, 0.3]),
        ("specular_color", [2.0, 1.0, 0.0]),
        ("sheen_color", [0.3, 0.2, 0.1]),
        ("diffuse_transmission_color", [0.0, 1.0, 0.0]),
    ] {
        assert_eq!(rgb(bsdf, name), value, "{name}");
    }
    assert!(matches!(param(bsdf, "two_sided"), Some(Value::Bool(true))));
    // After half a metre red alone is left.
    let medium = only(&scene, Category::Medium, "homogeneous");
    let [red, green, blue] = rgb(medium, "sigma_t");
    assert!(red == 0.0 && green > 100.0 && green == blue, "{red} {green} {blue}");
    // An anisotropy has a direction to follow.
    assert_eq!(mesh_of(&scene, only(&scene, Category::Shape, "mesh")).tangents.len(), 4);
}

#[test]
fn textures_share_an_image() {
    let mut file = Gltf::with_material(json!({}));
    let map = file.texture(1, &[[255, 128, 64, 255], [0, 0, 0, 255]]);
    file.push("samplers", json!({"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}));
    file.json["textures"][map]["sampler"] = json!(0);
    file.json["materials"][0] = json!({"pbrMetallicRoughness": {
        "baseColorTexture": {"index": map}, "baseColorFactor": [1, 0.5, 0.25, 1],
        "metallicRoughnessTexture": {"index": map, "extensions": {"KHR_texture_transform":
            {"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5]}}}, "roughnessFactor": 0.5}});
    let scene = file.load().unwrap();
    assert_eq!(scene.images.len(), 1);
    let bsdf = only(&scene, Category::Bsdf, "gltf");
    let color = texture(&scene, bsdf, "base_color");
    assert!(matches!(param(color, "raw"), Some(Value::Bool(false))));
    assert_eq!((rgb(color, "scale"), param(color, "channel").is_none()), ([1.0, 0.5, 0.25], true));
    assert_eq!(
        (word(color, "filter_type"), word(color, "wrap_mode_u"), word(color, "wrap_mode_v")),
        ("nearest", "clamp", "mirror")
    );
    let (metallic, roughness) = (texture(&scene, bsdf, "metallic"), texture(&scene, bsdf, "roughness"));
    assert_eq!((word(metallic, "channel"), word(roughness, "channel")), ("b", "g"));
    assert_eq!((param(metallic, "scale").is_none(), float(roughness, "scale")), (true, 0.5));
    assert!(matches!(param(roughness, "raw"), Some(Value::Bool(true))));
    // The extension's example: the lower left quarter of the image, turned.
    let Some(Value::Transform(to_uv)) = param(roughness, "to_uv") else { panic!("no `to_uv`") };
    for (uv, expected) in [([0.0, 0.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 0.5]), ([0.0, 1.0], [0.5, 1.0])] {
        assert!(near(to_uv.point(DVec3::new(uv[0], uv[1], 0.0)), [expected[0], expected[1], 0.0]), "{uv:?}");
    }
    // v goes down in both, so coordinates are passed on as they are.
    assert_eq!(mesh_of(&scene, only(&scene, Category::Shape, "mesh")).uvs[0], Vec2::new(0.0, 1.0));
    let image = &scene.images[0];
    assert!(matches!(&image.pixels, Pixels::U8(p) if p[0] == 255 && p[4] == 0) && image.height == 2);
}

#[test]
fn alpha_modes() {
    let file = |mode: &str, alpha: f64, with_texture: bool| {
        let mut file = Gltf::with_material(json!({}));
        let map = file.texture(2, &[[255, 255, 255, 100], [255, 255, 255, 200]]);
        let mut pbr = json!({"baseColorFactor": [1, 1, 1, alpha]});
        if with_texture {
            pbr["baseColorTexture"] = json!({"index": map});
        }
        file.json["materials"][0] = json!({"alphaMode": mode, "pbrMetallicRoughness": pbr});
        file.load().unwrap()
    };
    assert!(all(&file("OPAQUE", 0.2, true), Category::Bsdf, "mask").is_empty());
    assert!(all(&file("BLEND", 1.0, false), Category::Bsdf, "mask").is_empty());
    assert_eq!(float(only(&file("BLEND", 0.2, false), Category::Bsdf, "mask"), "opacity"), 0.2);
    assert_eq!(float(only(&file("MASK", 0.2, false), Category::Bsdf, "mask"), "opacity"), 0.0);
    assert!(all(&file("MASK", 0.6, false), Category::Bsdf, "mask").is_empty());
    let blend = file("BLEND", 0.5, true);
    let opacity = texture(&blend, only(&blend, Category::Bsdf, "mask"), "opacity");
    assert_eq!((word(opacity, "channel"), float(opacity, "scale")), ("a", 0.5));
    // The cut: 100/255 is under a half, 200/255 over it.
    let mask = file("MASK", 1.0, true);
    let mask_bsdf = only(&mask, Category::Bsdf, "mask");
    let opacity = texture(&mask, mask_bsdf, "opacity");
    let Some(Value::Image(image)) = param(opacity, "image") else { panic!("no image") };
    assert!(matches!(&mask.images[*image as usize].pixels, Pixels::U8(p) if *p == [0, 255]));
    assert!(
        mask_bsdf
            .params
            .iter()
            .any(|p| matches!(p.value, Value::Object(id) if mask.object(id).plugin == "gltf"))
    );
}

#[test]
fn unlit_variants_and_old_materials() {
    let scene = Gltf::with_material(json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1]},
        "extensions": {"KHR_materials_unlit": {}}}))
    .load()
    .unwrap();
    assert_eq!(rgb(only(&scene, Category::Emitter, "area"), "radiance"), [0.5, 0.25, 1.0]);
    assert_eq!(rgb(only(&scene, Category::Bsdf, "diffuse"), "reflectance"), [0.0; 3]);

    let scene = Gltf::with_material(json!({"extensions": {"KHR_materials_pbrSpecularGlossiness":
        {"diffuseFactor": [1, 0.5, 0, 1], "specularFactor": [0.2, 0.2, 0.1], "glossinessFactor": 0.75}}}))
    .load()
    .unwrap();
    let bsdf = only(&scene, Category::Bsdf, "gltf");
    assert_eq!((float(bsdf, "metallic"), float(bsdf, "roughness")), (0.0, 0.25));
    assert_eq!((rgb(bsdf, "base_color"), rgb(bsdf, "specular_color")), ([0.8, 0.4, 0.0], [5.0, 5.0, 2.5]));
    assert!(warns(&scene, &["pbrSpecularGlossiness"]));

    let mut file = Gltf::with_material(json!({"name": "plain"}));
    file.push("materials", json!({"name": "red"}));
    file.json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "a"}, {"name": "b"}]}});
    file.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}});
    let name = |variant: Option<&str>| {
        let options = LoadOptions { variant: variant.map(str::to_owned), ..LoadOptions::default() };
        file.load_with(&options).map(|scene| only(&scene, Category::Bsdf, "gltf").id.clone())
    };
    assert_eq!(
        [name(None).unwrap(), name(Some("a")).unwrap(), name(Some("b")).unwrap(), name(Some("1")).unwrap()],
        ["plain", "plain", "red", "red"]
    );
    assert_eq!(
        name(Some("c")).unwrap_err().to_string(),
        "test.glb: there is no variant `c`; did you mean `a`?"
    );
}

#[test]
fn vertex_colors() {
    let mut file = Gltf::with_material(json!({"alphaMode": "BLEND"}));
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 51], [255, 255, 255, 255]].concat();
    let accessor = file.accessor(&colors, 5121, "VEC4", 4);
    file.json["accessors"][accessor]["normalized"] = json!(true);
    file.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(accessor);
    let scene = file.load().unwrap();
    let mesh = mesh_of(&scene, only(&scene, Category::Shape, "mesh"));
    let find = |name: &str| mesh.attributes.iter().find(|a| a.name == name).unwrap();
    assert_eq!(
        (find("vertex_color").channels, &find("vertex_color").values[6..9]),
        (3, &[0.0, 0.0, 1.0][..])
    );
    assert_eq!(find("vertex_alpha").values, [1.0, 1.0, 0.2, 1.0]);
    assert!(matches!(param(only(&scene, Category::Bsdf, "gltf"), "vertex_color"), Some(Value::Bool(true))));
    let opacity = texture(&scene, only(&scene, Category::Bsdf, "mask"), "opacity");
    assert_eq!((opacity.plugin.as_str(), word(opacity, "name")), ("mesh_attribute", "vertex_alpha"));
}

#[test]
fn lights() {
    let mut file = Gltf::default();
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0], "intensity": 10, "name": "lamp"},
        {"type": "directional", "intensity": 3},
        {"type": "spot", "intensity": 5, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]}});
    for (light, extra) in [(0, json!([1, 2, 3])), (1, json!([0, 0, 0])), (2, json!([0, 4, 0]))] {
        // Turned down: −z to −y.
        file.node(json!({"translation": extra, "rotation": [-(0.5_f64.sqrt()), 0, 0, 0.5_f64.sqrt()], "scale": [3, 3, 3],
            "extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    let scene = file.load().unwrap();
    let point = only(&scene, Category::Emitter, "point");
    assert_eq!((rgb(point, "intensity"), point.id.as_str()), ([10.0, 5.0, 0.0], "lamp"));
    assert!(matches!(param(point, "position"), Some(Value::Vector(p)) if near(*p, [1.0, 2.0, 3.0])));
    let sun = only(&scene, Category::Emitter, "directional");
    assert!(matches!(param(sun, "direction"), Some(Value::Vector(d)) if near(*d, [0.0, -1.0, 0.0])));
    assert_eq!(rgb(sun, "irradiance"), [3.0; 3]);
    let spot = only(&scene, Category::Emitter, "spot");
    assert!((float(spot, "cutoff_angle") - 0.5_f64.to_degrees()).abs() < 1e-12);
    assert!((float(spot, "beam_width") - 0.1_f64.to_degrees()).abs() < 1e-12);
    assert_eq!(word(spot, "falloff"), "squared");
    let place = to_world(spot);
    assert!(
        near(place.vector(DVec3::Z), [0.0, -1.0, 0.0]) && near(place.point(DVec3::ZERO), [0.0, 4.0, 0.0])
    );
    assert!(all(&scene, Category::Emitter, "constant").is_empty());
    let sunny = file.load_with(&LoadOptions { sun: Some([90.0, 0.0]), ..LoadOptions::default() }).unwrap();
    let suns = all(&sunny, Category::Emitter, "directional");
    assert!(
        suns.iter()
            .any(|s| matches!(param(s, "direction"), Some(Value::Vector(d)) if near(*d, [0.0, -1.0, 0.0])))
    );
    only(&sunny, Category::Emitter, "constant");
}

#[test]
fn cameras() {
    let mut file = Gltf::with_material(json!({}));
    file.push("cameras", json!({"type": "perspective", "name": "wide", "perspective": {"yfov": 0.8, "aspectRatio": 2, "znear": 0.1}}));
    file.push(
        "cameras",
        json!({"type": "orthographic", "orthographic": {"xmag": 4, "ymag": 2, "znear": 0, "zfar": 50}}),
    );
    file.node(json!({"camera": 0, "translation": [0, 0, 5], "scale": [2, 2, 2]}));
    file.node(json!({"camera": 1, "name": "plan"}));
    let look = |camera: Option<&str>| {
        file.load_with(&LoadOptions { camera: camera.map(str::to_owned), ..LoadOptions::default() })
    };
    let scene = look(None).unwrap();
    let sensor = only(&scene, Category::Sensor, "perspective");
    assert!((float(sensor, "fov") - 0.8_f64.to_degrees()).abs() < 1e-12);
    assert_eq!((word(sensor, "fov_axis"), float(sensor, "near_clip")), ("y", 0.1));
    // Looks along −z, and x to the right is x to the left of ours.
    let pose = to_world(sensor);
    assert!(near(pose.vector(DVec3::Z), [0.0, 0.0, -1.0]) && near(pose.vector(DVec3::X), [-1.0, 0.0, 0.0]));
    assert!(near(pose.vector(DVec3::Y), [0.0, 1.0, 0.0]) && near(pose.point(DVec3::ZERO), [0.0, 0.0, 5.0]));
    let film = only(&scene, Category::Film, "hdrfilm");
    assert!(matches!(
        (param(film, "width"), param(film, "height")),
        (Some(Value::Int(1280)), Some(Value::Int(640)))
    ));
    for name in ["plan", "1"] {
        let scene = look(Some(name)).unwrap();
        let pose = to_world(only(&scene, Category::Sensor, "orthographic"));
        assert!(
            near(pose.vector(DVec3::X), [-4.0, 0.0, 0.0]) && near(pose.vector(DVec3::Z), [0.0, 0.0, -1.0])
        );
    }
    only(&look(Some("wide")).unwrap(), Category::Sensor, "perspective");
    assert_eq!(
        look(Some("7")).unwrap_err().to_string(),
        "test.glb: there is no camera 7; they count from 0 to 1"
    );
}

/// The camera that is made up sees every corner, and not from too far.
#[test]
fn framing_shows_everything() {
    let mut file = Gltf::default();
    let square = file.square();
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh, "scale": [100, 3, 1], "translation": [50, -7, 2]}));
    let scene = file.load().unwrap();
    let sensor = only(&scene, Category::Sensor, "perspective");
    let pose = to_world(sensor);
    let tangent = (0.5 * float(sensor, "fov")).to_radians().tan();
    let shape = only(&scene, Category::Shape, "mesh");
    let mut reach: f64 = 0.0;
    for p in &mesh_of(&scene, shape).positions {
        let p = pose.inverted().point(to_world(shape).point(p.as_dvec3()));
        assert!(p.z > 0.0);
        let (x, y) = (p.x / p.z / tangent * 9.0 / 16.0, p.y / p.z / tangent);
        assert!(x.abs() < 1.0 && y.abs() < 1.0, "{x} {y}");
        reach = reach.max(x.abs()).max(y.abs());
    }
    assert!(reach > 0.6, "{reach}");
}

#[test]
fn extensions_that_nobody_knows() {
    let mut file = Gltf::with_material(json!({}));
    file.json["extensionsUsed"] =
        json!(["KHR_lights_punctual", "EXT_lights_ies", "ACME_fur", "KHR_xmp_json_ld"]);
    let scene = file.load().unwrap();
    assert!(
        warns(&scene, &["EXT_lights_ies (measured light distributions), ACME_fur"]),
        "{:?}",
        scene.warnings
    );
    assert!(!warns(&scene, &["xmp"]) && !warns(&scene, &["KHR_lights_punctual"]));
    file.json["extensionsRequired"] = json!(["KHR_texture_transfrom"]);
    assert_eq!(
        file.error(),
        "test.glb: extensionsRequired: `KHR_texture_transfrom` is not supported; did you mean `KHR_texture_transform`?"
    );
    file.json["extensionsRequired"] = json!(["ACME_fur"]);
    assert!(
        file.error()
            .contains("`ACME_fur` is not supported; the file says that it cannot be shown without it")
    );
}

/// What a lenient scene goes without.
#[test]
fn leniency() {
    let mut file = Gltf::with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
        "baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicRoughnessTexture": {"index": 1}}}));
    file.json["textures"] = json!([{"source": 0}, {"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
    file.json["images"] = json!([{"uri": "lost.png"}]);
    file.json["extensionsRequired"] = json!(["ACME_fur"]);
    let scene = file.load_with(&LoadOptions { lenient: true, ..LoadOptions::default() }).unwrap();
    assert_eq!(rgb(only(&scene, Category::Bsdf, "gltf"), "base_color"), [0.5; 3]);
    let notes = scene.replacements();
    assert_eq!(notes.len(), 3, "{notes:?}");
    assert_eq!(notes[0], "test.glb: extensionsRequired: `ACME_fur` is not supported; shown without it");
    assert!(notes[1].starts_with("test.glb: textures[1]: is a KTX2 image"));
    assert!(
        notes[2]
            .starts_with("test.glb: images[0].uri: cannot find the file `lost.png`; its texture is left out")
    );
}

#[test]
fn images_of_other_formats() {
    let mut file = Gltf::with_material(json!({}));
    let map = file.texture(1, &[[9, 9, 9, 255]]);
    file.json["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": map}}});
    // A KTX2 image with another to fall back on, and without.
    file.json["textures"][map]["extensions"] = json!({"KHR_texture_basisu": {"source": 7}});
    assert_eq!(file.load().unwrap().images.len(), 1);
    file.json["textures"][map].as_object_mut().unwrap().remove("source");
    assert!(
        file.error().starts_with("test.glb: textures[0]: is a KTX2 image by KHR_texture_basisu"),
        "{}",
        file.error()
    );
    // WebP is decoded.
    let mut webp = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_raw(1, 1, vec![1, 2, 3])
        .unwrap()
        .write_to(&mut webp, image::ImageFormat::WebP)
        .unwrap();
    let view = file.view(webp.get_ref());
    let image = file.push("images", json!({"bufferView": view, "mimeType": "image/webp"}));
    file.json["textures"][map] = json!({"extensions": {"EXT_texture_webp": {"source": image}}});
    let scene = file.load().unwrap();
    assert!(matches!(&scene.images[0].pixels, Pixels::U8(p) if *p == [1, 2, 3]));
}

/// The scene that comes with the program, written by a script beside it.
#[test]
fn the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/gltf-table/table.glb");
    let still = load(&path, &LoadOptions::default()).unwrap();
    // Forty pebbles and three balls of the mobile.
    assert_eq!(all(&still, Category::Shape, "instance").len(), 43);
    assert_eq!(all(&still, Category::Shape, "shapegroup").len(), 2);
    assert_eq!(all(&still, Category::Emitter, "area").len(), 2);
    assert_eq!(still.warnings, Vec::<String>::new());
    let bsdf =
        |name: &str| still.objects.iter().find(|o| o.id == name && o.category == Category::Bsdf).unwrap();
    assert_eq!(float(bsdf("glass"), "transmission"), 1.0);
    assert_eq!((bsdf("dots").plugin.as_str(), bsdf("fade").plugin.as_str()), ("mask", "mask"));
    assert_eq!(word(texture(&still, bsdf("oak"), "roughness"), "uv_attribute"), "vertex_texcoord1");

    let options = LoadOptions {
        frame: Some(10.0),
        shutter: Some([0.0, 0.5]),
        camera: Some("above".into()),
        variant: Some("slate".into()),
        ..LoadOptions::default()
    };
    let moving = load(&path, &options).unwrap();
    let in_motion = |o: &&&etendue::desc::Object| matches!(param(o, "to_world"), Some(Value::Motion(_)));
    assert_eq!(all(&moving, Category::Shape, "instance").iter().filter(in_motion).count(), 3);
    // The blade and the lump.
    assert_eq!(moving.meshes.iter().filter(|m| m.deformation.len() > 1).count(), 2);
    only(&moving, Category::Sensor, "orthographic");
    assert!(moving.objects.iter().any(|o| o.id == "slate") && !moving.objects.iter().any(|o| o.id == "oak"));
}
