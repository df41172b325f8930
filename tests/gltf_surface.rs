//! What the surfaces of glTF files look like where a ray meets them: tangent
//! frames, fronts, emission, alpha.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

#[path = "common/gltf_file.rs"]
mod gltf_file;

use etendue::desc::{Category, SceneDesc, Value};
use etendue::load::LoadOptions;
use etendue::material::Scatter;
use etendue::math::{DVec3, Vec2, Vec3};
use etendue::scene::{BuildOptions, Scene};
use gltf_file::{Gltf, all, float, only, param, rgb, texture, to_world};
use serde_json::{Value as Json, json};

/// True if a warning contains all of these words.
fn warns(scene: &SceneDesc, words: &[&str]) -> bool {
    scene.warnings.iter().any(|w| words.iter().all(|word| w.contains(word)))
}

/// A camera straight above the middle of the square.
fn watch(file: &mut Gltf) {
    let camera =
        file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.1, "znear": 0.01}}));
    file.node(json!({"camera": camera, "translation": [0.5, 0.5, 4]}));
}

/// What a ray through the middle of the picture meets, if it meets anything:
/// the geometric normal, and the normal and x axis of the first lobe.
fn met(desc: &SceneDesc, time: f32) -> Option<[Vec3; 3]> {
    let scene = Scene::build(desc, &BuildOptions::default()).unwrap();
    let film = Vec2::new(scene.film.size[0] as f32, scene.film.size[1] as f32) * 0.5;
    let ray = scene.camera_ray(film, Vec2::splat(0.5), time);
    let surface = scene.surface(&ray, &scene.closest(&ray)?);
    let mut room = Scatter::default();
    let met = scene.interact(&surface, -ray.dir, &etendue::scene::Carried::NOTHING, &mut room);
    Some([surface.ng, met.scatter.normal()?, met.scatter.lobes()[0].frame.s])
}

/// A square whose vertices have these tangents, or none.
fn with_tangents(tangent: Option<[f32; 4]>, uvs: [f32; 8], material: impl Fn(&mut Gltf) -> Json) -> Gltf {
    let mut file = Gltf::default();
    let mut square = file.square();
    square["attributes"]["TEXCOORD_0"] = json!(file.floats(&uvs, "VEC2"));
    if let Some(tangent) = tangent {
        square["attributes"]["TANGENT"] = json!(file.floats(&tangent.repeat(4), "VEC4"));
    }
    let material = material(&mut file);
    square["material"] = json!(file.push("materials", material));
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh}));
    watch(&mut file);
    file
}

const DOWN: [f32; 8] = [0., 1., 1., 1., 1., 0., 0., 0.];
const UP: [f32; 8] = [0., 0., 1., 0., 1., 1., 0., 1.];

/// n = x·T + y·B + z·N with B = w·(N × T).
#[test]
fn green_of_a_normal_map_is_along_the_bitangent() {
    // (0, 0.6, 0.8) and (0.6, 0, 0.8), to 8 bits.
    let texels =
        [([128, 204, 230, 255], Vec2::new(0.004, 0.6)), ([204, 128, 230, 255], Vec2::new(0.6, 0.004))];
    for (texel, xy) in texels {
        for w in [1.0f32, -1.0] {
            for tangent in [Vec3::X, Vec3::Y, Vec3::new(-0.6, 0.8, 0.0)] {
                let file = with_tangents(Some([tangent.x, tangent.y, tangent.z, w]), DOWN, |f| {
                    let map = f.texture(1, &[texel]);
                    json!({"normalTexture": {"index": map}, "pbrMetallicRoughness": {"metallicFactor": 0}})
                });
                let bitangent = Vec3::Z.cross(tangent) * w;
                let expected = (tangent * xy.x + bitangent * xy.y + Vec3::Z * 0.804).normalize();
                let [_, found, _] = met(&file.load().unwrap(), 0.0).unwrap();
                assert!(found.distance(expected) < 2e-3, "{tangent} {w}: {found}, not {expected}");
            }
        }
        // Generated: green is up in the image.
        for (uvs, up) in [(DOWN, 1.0), (UP, -1.0)] {
            let file = with_tangents(None, uvs, |f| {
                let map = f.texture(1, &[texel]);
                json!({"normalTexture": {"index": map}, "pbrMetallicRoughness": {"metallicFactor": 0}})
            });
            let expected = Vec3::new(xy.x, xy.y * up, 0.804).normalize();
            let [_, found, _] = met(&file.load().unwrap(), 0.0).unwrap();
            assert!(found.distance(expected) < 2e-3, "generated, {up}: {found}, not {expected}");
        }
    }
}

/// The coat's map is scaled by itself: z stays what it is.
#[test]
fn the_scale_of_a_coats_normal_map() {
    for scale in [0.0, 0.5, 1.0, 2.0] {
        let file = with_tangents(Some([1.0, 0.0, 0.0, 1.0]), DOWN, |f| {
            let map = f.texture(1, &[[160, 128, 250, 255]]);
            json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
                "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.1,
                "clearcoatNormalTexture": {"index": map, "scale": scale}}}})
        });
        let desc = file.load().unwrap();
        let bsdf = only(&desc, Category::Bsdf, "gltf");
        assert_eq!(float(bsdf, "clearcoat_normal_scale"), scale);
        // The coat mirrors what comes straight down by twice the slope of its normal.
        let scene = Scene::build(&desc, &BuildOptions::default()).unwrap();
        let film = Vec2::new(scene.film.size[0] as f32, scene.film.size[1] as f32) * 0.5;
        let ray = scene.camera_ray(film, Vec2::splat(0.5), 0.0);
        let surface = scene.surface(&ray, &scene.closest(&ray).unwrap());
        let mut room = Scatter::default();
        let met = scene.interact(&surface, Vec3::Z, &etendue::scene::Carried::NOTHING, &mut room);
        let value = |wi: Vec3| met.scatter.eval_pdf(Vec3::Z, wi).0.x;
        let angle = |degrees: f32| Vec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        let best =
            (-800..=800).map(|k| k as f32 * 0.1).max_by(|a, b| value(angle(*a)).total_cmp(&value(angle(*b))));
        let expected = 2.0 * (scale as f32 * 65.0).atan2(245.0).to_degrees();
        assert!((best.unwrap() - expected).abs() < 0.6, "{scale}: {best:?}, not {expected}");
    }
}

/// An angle from T towards B.
#[test]
fn anisotropy_turns_towards_the_bitangent() {
    for (w, tangent) in [(1.0f32, Vec3::X), (-1.0, Vec3::X), (-1.0, Vec3::new(0.6, 0.8, 0.0))] {
        let file = with_tangents(Some([tangent.x, tangent.y, tangent.z, w]), DOWN, |_| {
            json!({"extensions": {"KHR_materials_anisotropy":
                {"anisotropyStrength": 0.5, "anisotropyRotation": 0.5}}})
        });
        let (sin, cos) = 0.5f32.sin_cos();
        let expected = tangent * cos + Vec3::Z.cross(tangent) * (w * sin);
        let [_, _, s] = met(&file.load().unwrap(), 0.0).unwrap();
        assert!(s.distance(expected) < 1e-5, "{w} {tangent}: {s}, not {expected}");
    }
}

/// A mirroring node keeps the front in front, moving, bending or still.
#[test]
fn mirrored_nodes_that_move_keep_their_front() {
    let load = |moves: bool, bends: bool| {
        let mut file = Gltf::default();
        let mut square = file.square();
        if bends {
            let offsets = file.floats(&[0., 0., 0., 0., 0., 0., 0., 0., 0.5, 0., 0., 0.5], "VEC3");
            square["targets"] = json!([{"POSITION": offsets}]);
        }
        let mesh = file.mesh(square);
        file.node(json!({"mesh": mesh, "scale": [-1, 1, 1], "translation": [1, 0, 0]}));
        watch(&mut file);
        let input = file.floats(&[0.0, 1.0], "SCALAR");
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        let mut animate = |path: &str, output: usize| {
            channels.push(json!({"sampler": samplers.len(), "target": {"node": 0, "path": path}}));
            samplers.push(json!({"input": input, "output": output}));
        };
        if moves {
            animate("translation", file.floats(&[1., 0., 0., 1., 0., 1.], "VEC3"));
        }
        if bends {
            animate("weights", file.floats(&[0., 1.], "SCALAR"));
        }
        if moves || bends {
            file.push("animations", json!({"channels": channels, "samplers": samplers}));
        }
        let options = LoadOptions { frame: Some(0.0), shutter: Some([0.0, 12.0]), ..LoadOptions::default() };
        file.load_with(&options).unwrap()
    };
    for (moves, bends) in [(false, false), (true, false), (false, true), (true, true)] {
        let desc = load(moves, bends);
        for time in [0.0, 0.7] {
            let [ng, ns, _] = met(&desc, time).unwrap();
            assert!(ng.z > 0.8 && ns.z > 0.8, "moves {moves}, bends {bends}, {time}: {ng} {ns}");
        }
    }
}

/// Lights shine along the −z of their node as its whole transform leaves it.
#[test]
fn a_stretched_parent_bends_the_direction_of_a_light() {
    let mut file = Gltf::with_material(json!({}));
    file.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "directional"}, {"type": "spot"}]}});
    let half = std::f64::consts::FRAC_PI_8;
    for light in 0..2 {
        let child = file.push(
            "nodes",
            json!({"rotation": [half.sin(), 0, 0, half.cos()],
                "extensions": {"KHR_lights_punctual": {"light": light}}}),
        );
        file.node(json!({"children": [child], "scale": [1, 1, 10]}));
    }
    let scene = file.load().unwrap();
    let expected = DVec3::new(0.0, 1.0, -10.0).normalize();
    let Some(Value::Vector(found)) = param(only(&scene, Category::Emitter, "directional"), "direction")
    else {
        panic!("no direction")
    };
    assert!(found.distance(expected) < 1e-9, "{found}");
    let place = to_world(only(&scene, Category::Emitter, "spot"));
    assert!(place.vector(DVec3::Z).distance(expected) < 1e-9);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| place.vector(axis));
    assert!(axes.iter().all(|a| (a.length() - 1.0).abs() < 1e-9));
    assert!(axes[0].dot(axes[1]).abs() < 1e-9 && axes[1].dot(axes[2]).abs() < 1e-9);
    assert!((place.determinant() - 1.0).abs() < 1e-9);
}

fn emitters(scene: &SceneDesc) -> Vec<&etendue::desc::Object> {
    all(scene, Category::Emitter, "area")
}

/// The texels of the radiance, times its scale.
fn radiance(scene: &SceneDesc) -> Vec<f32> {
    use etendue::desc::Pixels;
    let emitter = only(scene, Category::Emitter, "area");
    let map = texture(scene, emitter, "radiance");
    let Some(Value::Image(image)) = param(map, "image") else { panic!("no image") };
    match &scene.images[*image as usize].pixels {
        Pixels::F16(p) => p.iter().map(|v| v.to_f32()).collect(),
        Pixels::F32(p) => p.clone(),
        Pixels::U8(p) => p.iter().map(|v| f32::from(*v) / 255.0).collect(),
        Pixels::U16(p) => p.iter().map(|v| f32::from(*v) / 65535.0).collect(),
    }
}

/// A fragment that is cut out gives no light, and blending weighs it.
#[test]
fn alpha_weighs_emission() {
    let glowing = |mode: &str, alpha: f64, unlit: bool| {
        let pbr = json!({"baseColorFactor": [1, 1, 1, alpha]});
        let mut material =
            json!({"alphaMode": mode, "emissiveFactor": [1, 0.5, 0], "pbrMetallicRoughness": pbr});
        if unlit {
            material["extensions"] = json!({"KHR_materials_unlit": {}});
        }
        Gltf::with_material(material).load().unwrap()
    };
    assert_eq!(rgb(emitters(&glowing("OPAQUE", 0.25, false))[0], "radiance"), [1.0, 0.5, 0.0]);
    assert_eq!(rgb(emitters(&glowing("BLEND", 0.25, false))[0], "radiance"), [0.25, 0.125, 0.0]);
    assert_eq!(rgb(emitters(&glowing("MASK", 0.75, false))[0], "radiance"), [1.0, 0.5, 0.0]);
    assert!(emitters(&glowing("MASK", 0.25, false)).is_empty());
    assert_eq!(rgb(emitters(&glowing("BLEND", 0.25, true))[0], "radiance"), [0.25; 3]);
    assert!(emitters(&glowing("MASK", 0.25, true)).is_empty());

    let textured = |mode: &str, unlit: bool, other: bool| {
        let mut file = Gltf::with_material(json!({}));
        let texels = [[255, 255, 255, 0], [255, 0, 255, 51], [255, 255, 0, 204]];
        let map = file.texture(3, &texels);
        let glow = if other { file.texture(1, &[[255; 4]]) } else { map };
        let pbr = json!({"baseColorTexture": {"index": map}});
        let mut material = json!({"alphaMode": mode, "pbrMetallicRoughness": pbr});
        if unlit {
            material["extensions"] = json!({"KHR_materials_unlit": {}});
        } else {
            material["emissiveFactor"] = json!([1, 1, 1]);
            material["emissiveTexture"] = json!({"index": glow});
        }
        file.json["materials"][0] = material;
        file.load().unwrap()
    };
    for unlit in [false, true] {
        let cut = textured("MASK", unlit, false);
        assert_eq!(radiance(&cut), [0., 0., 0., 0., 0., 0., 1., 1., 0.], "{unlit}");
        let blend = radiance(&textured("BLEND", unlit, false));
        let expected = [0., 0., 0., 0.2, 0., 0.2, 0.8, 0.8, 0.];
        assert!(blend.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{blend:?}");
    }
    // Another image says where it is cut out, and that cannot be followed.
    let other = textured("MASK", false, true);
    assert!(warns(&other, &["materials[0]", "glows where its alpha"]), "{:?}", other.warnings);
}

/// Five sets of coordinates beyond the first, each read by a texture.
#[test]
fn many_sets_of_coordinates() {
    let mut file = Gltf::default();
    let mut square = file.square();
    for set in 0..6 {
        let at = (set as f32 + 0.5) / 6.0;
        square["attributes"][format!("TEXCOORD_{set}")] = json!(file.floats(&[at, 0.5].repeat(4), "VEC2"));
    }
    square["attributes"]["COLOR_0"] = json!(file.floats(&[0.5f32, 1.0, 1.0].repeat(4), "VEC3"));
    let shade = |k: u8| [40 * k, 255, 255, 255];
    let map = file.texture(6, &[0, 1, 2, 3, 4, 5].map(shade));
    let info = |set: u32| json!({"index": map, "texCoord": set});
    square["material"] = json!(file.push(
        "materials",
        json!({
        "pbrMetallicRoughness": {"baseColorTexture": info(5), "metallicRoughnessTexture": info(1)},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatTexture": info(2)},
            "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenColorTexture": info(3)},
            "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": info(4)}}})
    ));
    let mesh = file.mesh(square);
    file.node(json!({"mesh": mesh}));
    let desc = file.load().unwrap();
    assert_eq!(desc.attribute_names().len(), 6);
    Scene::build(&desc, &BuildOptions::default()).unwrap();
}

/// An image without alpha has the alpha 1.
#[test]
fn alpha_that_is_not_there_is_one() {
    let mut file = Gltf::with_material(json!({}));
    let mut png = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_raw(1, 1, vec![10, 20, 30]).unwrap();
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let view = file.view(png.get_ref());
    let image = file.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    let map = json!({"index": file.push("textures", json!({"source": image}))});
    file.json["materials"][0] = json!({"extensions": {
        "KHR_materials_specular": {"specularFactor": 0.5, "specularTexture": map},
        "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.25, "sheenRoughnessTexture": map},
        "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.75, "diffuseTransmissionTexture": map},
    }});
    let scene = file.load().unwrap();
    Scene::build(&scene, &BuildOptions::default()).unwrap();
    let bsdf = only(&scene, Category::Bsdf, "gltf");
    for (name, value) in [("specular", 0.5), ("sheen_roughness", 0.25), ("diffuse_transmission", 0.75)] {
        assert_eq!(float(bsdf, name), value, "{name}");
    }
}

#[test]
fn unlit_says_what_it_goes_without() {
    let mut file = Gltf::with_material(json!({}));
    let map = file.texture(1, &[[255; 4]]);
    file.json["materials"][0] = json!({"doubleSided": true, "extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": map, "texCoord": 1}}});
    let scene = file.load().unwrap();
    assert!(warns(&scene, &["materials[0]", "glows without its texture"]), "{:?}", scene.warnings);
    let emitter = only(&scene, Category::Emitter, "area");
    assert!(matches!(param(emitter, "two_sided"), Some(Value::Bool(true))));
}

/// Base colour × colour of the vertices (× their alpha), the same whether a ray
/// finds the place or the lamp is sampled; still, in a moving node, and lit.
#[test]
fn unlit_vertex_colours() {
    for (moves, blends) in [(false, false), (true, false), (false, true)] {
        let mut file = Gltf::default();
        let mut square = file.square();
        let colors = [1., 0., 0., 1., 0., 1., 0., 0.5, 0., 0., 1., 0.25, 1., 1., 1., 0.];
        square["attributes"]["COLOR_0"] = json!(file.floats(&colors, "VEC4"));
        square["material"] = json!(file.push(
            "materials",
            json!({
            "alphaMode": if blends { "BLEND" } else { "OPAQUE" },
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]},
            "extensions": {"KHR_materials_unlit": {}}})
        ));
        let mesh = file.mesh(square);
        file.node(json!({"mesh": mesh}));
        if moves {
            let input = file.floats(&[0.0, 1.0], "SCALAR");
            let output = file.floats(&[0., 0., 0., 0.2, 0., 0.], "VEC3");
            file.push(
                "animations",
                json!({"channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                    "samplers": [{"input": input, "output": output}]}),
            );
        }
        let options = LoadOptions { frame: Some(0.0), shutter: Some([0.0, 24.0]), ..LoadOptions::default() };
        let desc = file.load_with(&options).unwrap();
        assert!(!warns(&desc, &["materials[0]"]), "{:?}", desc.warnings);
        let scene = Scene::build(&desc, &BuildOptions::default()).unwrap();
        let time = 0.5;
        let shift = Vec3::new(if moves { 0.1 } else { 0.0 }, 0.0, 0.0) - scene.recentre.as_vec3();
        // Of the square the triangles 0 1 2 and 0 2 3.
        let expected = |x: f32, y: f32| {
            let corner = |k: usize| [0, 1, 2, 3].map(|c| colors[4 * k + c]);
            let weights =
                if y < x { [(0, 1.0 - x), (1, x - y), (2, y)] } else { [(0, 1.0 - y), (2, x), (3, y - x)] };
            let mut c = [0.0; 4];
            weights.iter().for_each(|(k, w)| (0..4).for_each(|i| c[i] += w * corner(*k)[i]));
            Vec3::new(0.5 * c[0], c[1], c[2]) * if blends { c[3] } else { 1.0 }
        };
        let light = scene.lights.iter().find(|l| l.name() == "area").unwrap();
        let receiver =
            etendue::light::Receiver { time, ..etendue::light::Receiver::free(Vec3::Z * 2.0 + shift) };
        for k in 0..200 {
            let u = Vec2::new((k as f32 * 0.618).fract(), (k as f32 * 0.414).fract());
            let Some(s) = light.sample(&scene.geometry, &receiver, u) else { continue };
            let ray = etendue::math::Ray { time, ..etendue::math::Ray::new(receiver.p, s.wi) };
            let surface = scene.surface(&ray, &scene.closest(&ray).unwrap());
            let place = surface.p - shift;
            let found = scene.emitted(&surface, -s.wi);
            assert!(found.distance(expected(place.x, place.y)) < 1e-4, "{place}: {found}");
            assert!(found.distance(s.radiance) < 1e-4, "{place}: {found}, sampled {}", s.radiance);
        }
    }
}

/// What shrinks to nothing is gone at the end.
#[test]
fn a_motion_to_scale_zero_vanishes() {
    let mut file = Gltf::with_material(json!({}));
    let input = file.floats(&[0.0, 1.0, 2.0], "SCALAR");
    let output = file.floats(&[1., 1., 1., 0., 0., 0., 0., 0., 0.], "VEC3");
    file.push(
        "animations",
        json!({"channels": [{"sampler": 0, "target": {"node": 0, "path": "scale"}}],
            "samplers": [{"input": input, "output": output}]}),
    );
    let options = LoadOptions { frame: Some(0.0), shutter: Some([0.0, 48.0]), ..LoadOptions::default() };
    let scene = file.load_with(&options).unwrap();
    let Some(Value::Motion(motion)) = param(only(&scene, Category::Shape, "mesh"), "to_world") else {
        panic!("it does not move")
    };
    let size = |time: f64| motion.at(time).vector(DVec3::X).length();
    let last = motion.times().last().unwrap();
    assert!((size(0.0) - 1.0).abs() < 1e-6 && size(last) < 1e-5, "{} {}", size(0.0), size(last));
    assert!(size(0.5 * last) < 1e-3, "{}", size(0.5 * last));
}

#[test]
fn restarted_strips_are_refused() {
    let mut file = Gltf::with_material(json!({}));
    file.json["extensionsUsed"] = json!(["KHR_mesh_primitive_restart"]);
    assert!(warns(&file.load().unwrap(), &["KHR_mesh_primitive_restart (strips and fans"]));
    file.json["extensionsRequired"] = json!(["KHR_mesh_primitive_restart"]);
    let error = file.error();
    assert!(error.contains("extensionsRequired: `KHR_mesh_primitive_restart` is not supported"), "{error}");
}

#[test]
fn the_older_specular_extension_goes_first() {
    let scene = Gltf::with_material(json!({"extensions": {
        "KHR_materials_pbrSpecularGlossiness": {"specularFactor": [0.2, 0.2, 0.2]},
        "KHR_materials_specular": {"specularColorFactor": [1, 0, 0]}, "KHR_materials_ior": {"ior": 2}}}))
    .load()
    .unwrap();
    Scene::build(&scene, &BuildOptions::default()).unwrap();
    let bsdf = only(&scene, Category::Bsdf, "gltf");
    assert_eq!(rgb(bsdf, "specular_color"), [5.0; 3]);
    assert!(param(bsdf, "ior").is_none());
}

/// Images made of others are shared and counted, as are copies of what glows.
#[test]
fn what_is_made_is_counted() {
    let mut file = Gltf::with_material(json!({}));
    let texels: Vec<[u8; 4]> = (0..64 * 64).map(|i| [255, 255, 255, (i % 256) as u8]).collect();
    let map = file.texture(64, &texels);
    let mask = json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": map}}});
    file.json["materials"][0] = mask.clone();
    let mut square = file.square();
    square["material"] = json!(file.push("materials", mask));
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(square);
    // The image, and one mask for both materials.
    assert_eq!(file.load().unwrap().images.len(), 2);
    let bytes = 64 * 64 * 4;
    let tight = |bytes: u64| {
        file.load_with(&LoadOptions { max_image_bytes: bytes, ..LoadOptions::default() }).map(|_| ())
    };
    tight(bytes).unwrap();

    let mut file = Gltf::with_material(json!({"emissiveFactor": [1, 1, 1]}));
    let translations = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 1000}));
    file.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translations}}});
    let load = |bytes: u64| {
        file.load_with(&LoadOptions { max_mesh_bytes: bytes, ..LoadOptions::default() }).map(|_| ())
    };
    load(2_000_000).unwrap();
    // 512 bytes for each instance, and 152 for each square.
    let error = load(600_000).unwrap_err().to_string();
    assert!(error.contains("meshes[0].primitives[0]: the file decodes to more than"), "{error}");
}
