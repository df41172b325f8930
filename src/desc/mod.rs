//! What a scene file says: plain data with file positions, the parameter
//! reader and the error type of all input.
//!
//! Every reader (Mitsuba XML, glTF, …) produces a [`SceneDesc`]: a tree of
//! [`Object`]s with named parameters, and the meshes, curves, images
//! and measured materials they name, already decoded. [`Params`] reads an object's parameters, and reports the
//! ones nobody asked for.

mod curves;
mod error;
mod kinds;
mod lenient;
mod measured;
mod optics;
mod params;

pub use curves::Curves;
pub use error::{Error, Pos, Result, nearest};
pub use lenient::Leniency;
pub use measured::{MeasuredData, Nodes};
pub use params::Params;

use std::sync::{Arc, OnceLock};

use half::f16;

use crate::math::{DVec3, Motion, Transform, Vec2, Vec3, Vec4};

/// Index of an object in [`SceneDesc::objects`].
pub type ObjectId = u32;

/// A whole scene as its files describe it.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Files read, as the user would name them; [`Pos::file`] indexes here.
    pub files: Vec<String>,
    /// All objects; the references among them are ids into this array.
    pub objects: Vec<Object>,
    /// The `<scene>` object.
    pub root: ObjectId,
    /// Decoded meshes.
    pub meshes: Vec<Arc<Mesh>>,
    /// Decoded images.
    pub images: Vec<Arc<Image>>,
    /// Images among them that nothing shows: a grey texel stands for each.
    pub unread_images: usize,
    /// Decoded curves.
    pub curves: Vec<Arc<Curves>>,
    /// Decoded measurements of materials.
    pub measured: Vec<Arc<MeasuredData>>,
    /// Things worth telling the user that do not change the picture's meaning.
    pub warnings: Vec<String>,
    /// Names of the mesh attributes that textures read; see [`SceneDesc::attribute_names`].
    pub attribute_names: OnceLock<Vec<String>>,
    /// Whether what is not known may be replaced.
    pub leniency: Leniency,
}

/// What an object is for: the tag it stands under.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the names are those of the scene file")]
pub enum Category {
    Scene,
    Shape,
    Bsdf,
    Texture,
    Emitter,
    Sensor,
    Film,
    Rfilter,
    Sampler,
    Integrator,
    Medium,
    Phase,
    Volume,
}

impl Category {
    /// The tag as written in the scene file.
    #[must_use]
    pub fn tag(self) -> &'static str {
        match self {
            Category::Scene => "scene",
            Category::Shape => "shape",
            Category::Bsdf => "bsdf",
            Category::Texture => "texture",
            Category::Emitter => "emitter",
            Category::Sensor => "sensor",
            Category::Film => "film",
            Category::Rfilter => "rfilter",
            Category::Sampler => "sampler",
            Category::Integrator => "integrator",
            Category::Medium => "medium",
            Category::Phase => "phase",
            Category::Volume => "volume",
        }
    }
}

/// One plugin instance: `<bsdf type="diffuse" id="wall"> … </bsdf>`.
#[derive(Clone, Debug)]
pub struct Object {
    /// What it is for.
    pub category: Category,
    /// The plugin name, `diffuse`.
    pub plugin: String,
    /// Its id, or an empty string.
    pub id: String,
    /// Where its tag opens.
    pub pos: Pos,
    /// Its parameters and children in file order.
    pub params: Vec<Param>,
}

/// One named value.
#[derive(Clone, Debug)]
pub struct Param {
    /// Its name; empty for an unnamed child object.
    pub name: String,
    /// Its value.
    pub value: Value,
    /// Where it stands.
    pub pos: Pos,
}

/// The value of a parameter.
#[derive(Clone, Debug)]
pub enum Value {
    /// `<boolean>`.
    Bool(bool),
    /// `<integer>`.
    Int(i64),
    /// `<float>`.
    Float(f64),
    /// `<string>`.
    String(String),
    /// `<rgb>`: linear RGB, three values (a single value is repeated).
    Rgb([f64; 3]),
    /// `<spectrum>` given as wavelength:value pairs in nanometres, sorted.
    Spectrum(Vec<(f64, f64)>),
    /// `<point>` or `<vector>`.
    Vector(DVec3),
    /// `<transform>`.
    Transform(Transform),
    /// `<animation>`: transforms at times.
    Motion(Motion),
    /// A nested object or a reference to one.
    Object(ObjectId),
    /// A decoded mesh: index into [`SceneDesc::meshes`].
    Mesh(u32),
    /// A decoded image: index into [`SceneDesc::images`].
    Image(u32),
    /// Decoded curves: index into [`SceneDesc::curves`].
    Curves(u32),
    /// A decoded measurement: index into [`SceneDesc::measured`].
    Measured(u32),
}

impl Value {
    /// How the value's type is called in messages.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self {
            Value::Bool(_) => "boolean",
            Value::Int(_) => "integer",
            Value::Float(_) => "float",
            Value::String(_) => "string",
            Value::Rgb(_) => "rgb",
            Value::Spectrum(_) => "spectrum",
            Value::Vector(_) => "point or vector",
            Value::Transform(_) => "transform",
            Value::Motion(_) => "animation",
            Value::Object(_) => "object",
            Value::Mesh(_) => "mesh",
            Value::Image(_) => "image",
            Value::Curves(_) => "curves",
            Value::Measured(_) => "measured material",
        }
    }
}

/// A triangle mesh as decoded from a file, in the file's own coordinates.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, all finite.
    pub positions: Vec<Vec3>,
    /// Vertex normals, one per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
    /// Tangents that normal maps are relative to, one per vertex, or empty:
    /// direction in `xyz`, ±1 in `w` (bitangent = w · normal × tangent).
    pub tangents: Vec<Vec4>,
    /// Further data by name, for textures to look up.
    pub attributes: Vec<MeshAttribute>,
    /// The shape at several times, rising, for a mesh that deforms; else
    /// empty. `positions` and `normals` are then those of the first.
    pub deformation: Vec<MeshKey>,
}

/// Named data of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshAttribute {
    /// Its name, such as `vertex_color`.
    pub name: String,
    /// Numbers per vertex or face: 1 to 4.
    pub channels: u32,
    /// One entry per triangle instead of per vertex.
    pub per_face: bool,
    /// `channels` numbers for each, finite.
    pub values: Vec<f32>,
}

/// A deforming mesh at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshKey {
    /// When, in the unit of the shutter's times.
    pub time: f64,
    /// One per vertex, finite.
    pub positions: Vec<Vec3>,
    /// One per vertex, or empty.
    pub normals: Vec<Vec3>,
}

/// A decoded image; row 0 is the top row.
#[derive(Clone, Debug)]
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Interleaved channels per pixel: 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA).
    pub channels: u32,
    /// Row-major samples, `width · height · channels` of them.
    pub pixels: Pixels,
    /// The file as the user would name it.
    pub name: String,
}

/// Samples of an image, kept as compact as the file had them.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// 8 bits, 255 is one; sRGB encoded unless the user of the image says raw.
    U8(Vec<u8>),
    /// 16 bits, 65535 is one; sRGB encoded unless the user of the image says raw.
    U16(Vec<u16>),
    /// Linear floats of 16 bits, all finite.
    F16(Vec<f16>),
    /// Linear floats.
    F32(Vec<f32>),
}

impl Pixels {
    /// Bytes of the samples.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Pixels::U8(p) => p.len(),
            Pixels::U16(p) => 2 * p.len(),
            Pixels::F16(p) => 2 * p.len(),
            Pixels::F32(p) => 4 * p.len(),
        }
    }

    /// Floats in 16 bits each where all of them are such numbers, else in 32.
    #[must_use]
    pub fn from_floats(samples: Vec<f32>) -> Pixels {
        let exact = |x: &f32| x.is_finite() && f16::from_f32(*x).to_f32().to_bits() == x.to_bits();
        if samples.iter().all(exact) {
            Pixels::F16(samples.into_iter().map(f16::from_f32).collect())
        } else {
            Pixels::F32(samples)
        }
    }
}

impl SceneDesc {
    /// The object of an id.
    #[must_use]
    pub fn object(&self, id: ObjectId) -> &Object {
        &self.objects[id as usize]
    }

    /// The names of mesh attributes that textures read, in the order of the
    /// objects: a `mesh_attribute`'s `name` and a `bitmap`'s `uv_attribute`.
    /// (The bsdf `gltf` and the emitter `area` read `vertex_color`, and that also
    /// `vertex_alpha`, when they say so.)
    pub fn attribute_names(&self) -> &[String] {
        self.attribute_names.get_or_init(|| {
            let mut names: Vec<String> = Vec::new();
            for object in &self.objects {
                let wanted = match (object.category, object.plugin.as_str()) {
                    (Category::Texture, "mesh_attribute") => &["name"] as &[&str],
                    (Category::Texture, "bitmap") => &["uv_attribute"],
                    (Category::Bsdf, "gltf") => &["vertex_color"],
                    (Category::Emitter, "area") => &["vertex_color", "vertex_alpha"],
                    _ => continue,
                };
                for param in object.params.iter().filter(|p| wanted.contains(&p.name.as_str())) {
                    let name = match &param.value {
                        Value::String(name) => name.as_str(),
                        Value::Bool(true) => &param.name,
                        _ => continue,
                    };
                    if !names.iter().any(|n| n == name) {
                        names.push(name.to_owned());
                    }
                }
            }
            names
        })
    }

    /// An error at a position of this scene.
    pub fn error(&self, pos: Pos, message: impl Into<String>) -> Error {
        let file = self.files.get(pos.file as usize).cloned().unwrap_or_default();
        Error::new(message).at(file, pos)
    }

    /// A reader for the parameters of an object.
    #[must_use]
    pub fn params(&self, id: ObjectId) -> Params<'_> {
        Params::new(self, id)
    }
}

#[allow(unused_imports, reason = "used by the rooms above")]
pub(crate) use kinds::kinds;

impl SceneDesc {
    /// A hash of all that decides the picture: objects, meshes and images, but
    /// not where they stand in which file. FNV-1a over 64 bits.
    #[must_use]
    pub fn content_hash(&self) -> u64 {
        use std::fmt::Write;
        let mut hash = Fnv::default();
        for object in &self.objects {
            // Writing to the hash cannot fail.
            let _ = write!(hash, "{}/{}/{}", object.category.tag(), object.plugin, object.params.len());
            for param in &object.params {
                let _ = write!(hash, "{}={:?};", param.name, param.value);
            }
        }
        for mesh in &self.meshes {
            for v in mesh.positions.iter().chain(&mesh.normals) {
                v.to_array().iter().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes()));
            }
            for uv in &mesh.uvs {
                uv.to_array().iter().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes()));
            }
            mesh.triangles.iter().flatten().for_each(|i| hash.bytes(&i.to_le_bytes()));
            mesh.hash_rest(&mut hash);
        }
        for image in &self.images {
            let _ = write!(hash, "{}x{}x{}", image.width, image.height, image.channels);
            match &image.pixels {
                Pixels::U8(p) => hash.bytes(p),
                Pixels::U16(p) => p.iter().for_each(|x| hash.bytes(&x.to_le_bytes())),
                Pixels::F16(p) => p.iter().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes())),
                Pixels::F32(p) => p.iter().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes())),
            }
        }
        self.curves.iter().for_each(|curves| curves.hash(&mut hash));
        self.measured.iter().for_each(|data| data.hash(&mut hash));
        hash.value()
    }
}

impl Mesh {
    /// The parts that most meshes do not have.
    fn hash_rest(&self, hash: &mut Fnv) {
        let mut floats = |values: &[f32]| values.iter().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes()));
        self.tangents.iter().for_each(|t| floats(&t.to_array()));
        for key in &self.deformation {
            key.positions.iter().chain(&key.normals).for_each(|v| floats(&v.to_array()));
        }
        self.attributes.iter().for_each(|a| floats(&a.values));
        for a in &self.attributes {
            hash.bytes(a.name.as_bytes());
            hash.bytes(&[a.channels as u8, u8::from(a.per_face)]);
        }
        self.deformation.iter().for_each(|key| hash.bytes(&key.time.to_bits().to_le_bytes()));
    }
}

/// The hash FNV-1a over 64 bits: the same on every machine and for every
/// version of the compiler. Text is written to it.
#[derive(Clone, Copy, Debug)]
pub struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Fnv {
        Fnv(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    /// The hash of what it has seen.
    #[must_use]
    pub fn value(self) -> u64 {
        self.0
    }

    /// Takes in more.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

impl std::fmt::Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}
