//! glTF files made in code: JSON with accessors that are appended to one buffer.

#![allow(dead_code, reason = "each test file uses a part")]

use std::path::Path;

use etendue::desc::{Category, Mesh, Object, Result, SceneDesc, Value};
use etendue::load::{LoadOptions, load_gltf_bytes};
use etendue::math::Transform;
use serde_json::json;

/// A glTF file under construction.
#[derive(Clone)]
pub struct Gltf {
    pub json: serde_json::Value,
    pub bin: Vec<u8>,
}

impl Default for Gltf {
    fn default() -> Self {
        Gltf { json: json!({"asset": {"version": "2.0"}}), bin: Vec::new() }
    }
}

impl Gltf {
    /// Appends to an array of the root, and gives the index.
    pub fn push(&mut self, array: &str, value: serde_json::Value) -> usize {
        let root = self.json.as_object_mut().unwrap();
        let items = root.entry(array).or_insert(json!([])).as_array_mut().unwrap();
        items.push(value);
        items.len() - 1
    }

    /// A view of these bytes.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// An accessor of these bytes.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": component, "type": kind, "count": count}),
        )
    }

    /// An accessor of floats.
    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, values.len() / width)
    }

    /// An accessor of 16-bit indices.
    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", values.len())
    }

    /// A mesh of one primitive.
    pub fn mesh(&mut self, primitive: serde_json::Value) -> usize {
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// A node that is in the scene.
    pub fn node(&mut self, node: serde_json::Value) -> usize {
        let index = self.push("nodes", node);
        let root = self.json.as_object_mut().unwrap();
        let scenes = root.entry("scenes").or_insert(json!([{"nodes": []}]));
        scenes[0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// A square of two triangles from (0, 0, 0) to (1, 1, 0) with normals +z and
    /// texture coordinates whose v goes down.
    pub fn square(&mut self) -> serde_json::Value {
        let positions = self.floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.], "VEC3");
        let normals = self.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3");
        let uvs = self.floats(&[0., 1., 1., 1., 1., 0., 0., 0.], "VEC2");
        let indices = self.indices(&[0, 1, 2, 0, 2, 3]);
        json!({"attributes": {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs}, "indices": indices})
    }

    /// A square in the scene with a material.
    pub fn with_material(material: serde_json::Value) -> Gltf {
        let mut file = Gltf::default();
        let mut square = file.square();
        square["material"] = json!(file.push("materials", material));
        let mesh = file.mesh(square);
        file.node(json!({"mesh": mesh}));
        file
    }

    /// A texture of a picture of RGBA texels, row by row.
    pub fn texture(&mut self, width: u32, texels: &[[u8; 4]]) -> usize {
        let image = image::RgbaImage::from_raw(width, texels.len() as u32 / width, texels.concat()).unwrap();
        let mut png = std::io::Cursor::new(Vec::new());
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let view = self.view(png.get_ref());
        let image = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        self.push("textures", json!({"source": image}))
    }

    /// The file with its buffer as a data URI.
    pub fn gltf(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.bin.is_empty() {
            let mut uri = String::from("data:application/octet-stream;base64,");
            base64::Engine::encode_string(&base64::engine::general_purpose::STANDARD, &self.bin, &mut uri);
            json["buffers"] = json!([{"byteLength": self.bin.len(), "uri": uri}]);
        }
        serde_json::to_vec(&json).unwrap()
    }

    /// The file as binary glTF.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if let Some(root) = json.as_object_mut().filter(|_| !self.bin.is_empty()) {
            root.insert("buffers".into(), json!([{"byteLength": self.bin.len()}]));
        }
        let mut text = serde_json::to_vec(&json).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(((28 + text.len() + bin.len()) as u32).to_le_bytes());
        for (kind, data) in [(b"JSON", &text), (b"BIN\0", &bin)] {
            out.extend((data.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(data);
        }
        out
    }

    pub fn load(&self) -> Result<SceneDesc> {
        self.load_with(&LoadOptions::default())
    }

    pub fn load_with(&self, options: &LoadOptions) -> Result<SceneDesc> {
        load_gltf_bytes(self.glb(), "test.glb", Path::new("."), options)
    }

    /// What the file's error says.
    pub fn error(&self) -> String {
        match self.load() {
            Ok(_) => panic!("it loads:\n{:#}", self.json),
            Err(error) => error.to_string(),
        }
    }
}

/// All objects of a category and plugin.
pub fn all<'a>(scene: &'a SceneDesc, category: Category, plugin: &str) -> Vec<&'a Object> {
    scene.objects.iter().filter(|o| o.category == category && o.plugin == plugin).collect()
}

/// The only object of a category and plugin.
pub fn only<'a>(scene: &'a SceneDesc, category: Category, plugin: &str) -> &'a Object {
    let found = all(scene, category, plugin);
    assert_eq!(found.len(), 1, "{} `{plugin}`", category.tag());
    found[0]
}

/// The parameter of a name.
pub fn param<'a>(object: &'a Object, name: &str) -> Option<&'a Value> {
    object.params.iter().find(|p| p.name == name).map(|p| &p.value)
}

/// The placement of an object.
#[allow(dead_code, reason = "not every test binary uses it")]
pub fn to_world(object: &Object) -> Transform {
    match param(object, "to_world") {
        None => Transform::IDENTITY,
        Some(Value::Transform(t)) => *t,
        other => panic!("`to_world` is {other:?}"),
    }
}

/// A float parameter.
pub fn float(object: &Object, name: &str) -> f64 {
    match param(object, name) {
        Some(Value::Float(v)) => *v,
        other => panic!("`{name}` of `{}` is {other:?}", object.plugin),
    }
}

/// A colour parameter.
pub fn rgb(object: &Object, name: &str) -> [f64; 3] {
    match param(object, name) {
        Some(Value::Rgb(v)) => *v,
        other => panic!("`{name}` of `{}` is {other:?}", object.plugin),
    }
}

/// A word parameter.
pub fn word<'a>(object: &'a Object, name: &str) -> &'a str {
    match param(object, name) {
        Some(Value::String(v)) => v,
        other => panic!("`{name}` of `{}` is {other:?}", object.plugin),
    }
}

/// The texture under a name.
pub fn texture<'a>(scene: &'a SceneDesc, object: &Object, name: &str) -> &'a Object {
    match param(object, name) {
        Some(Value::Object(id)) => scene.object(*id),
        other => panic!("`{name}` of `{}` is {other:?}", object.plugin),
    }
}

/// The mesh of a shape.
pub fn mesh_of<'a>(scene: &'a SceneDesc, shape: &Object) -> &'a Mesh {
    match param(shape, "mesh") {
        Some(Value::Mesh(id)) => &scene.meshes[*id as usize],
        other => panic!("`mesh` is {other:?}"),
    }
}
