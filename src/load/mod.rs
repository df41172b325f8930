//! Files to [`SceneDesc`]: Mitsuba 3 scene files, glTF 2.0, meshes, curves, images
//! and measured materials.
//!
//! [`load`] reads a glTF file by its ending (`gltf`, `glb`), and anything else
//! as XML, in four steps. (1) The XML of the file and of its
//! includes becomes objects and parameters, with `$name` replaced. (2)
//! References become object ids, cycles and unknown ids are errors; and files
//! older than 2.0 are brought to today's kinds and parameters. (3) The files
//! that shapes, textures, emitters and bsdfs name are found, and each is decoded
//! once, in parallel. (4) What was decoded
//! is attached to the objects: a `mesh` to shapes `obj`, `ply` and
//! `serialized` (whose `filename`, `flip_tex_coords` and `shape_index` are
//! thereby used up), an `image` to `bitmap` textures and `envmap` emitters,
//! and `measured` to bsdfs of that name (whose `filename` stays, for messages).
//!
//! Unknown tags, malformed values and bad files are errors of this room; names
//! of plugins and parameters are checked by whoever builds them. Only regular
//! files are read, up to a size; what a header promises is checked against the
//! size of the file before anything is allocated.

mod assets;
mod curves;
mod exr_file;
mod files;
mod foreign;
mod gltf;
mod image_file;
mod lenient;
mod measured;
mod obj;
mod old;
mod old_bsdfs;
mod old_emitters;
mod old_kinds;
mod old_values;
mod parse;
mod picture;
mod ply;
mod references;
mod serialized;
mod stage;
mod substitute;
mod transform;
mod upgrade;
mod values;
mod xml;

pub use picture::{Picture, read_picture, read_picture_within};

use std::path::{Path, PathBuf};

use crate::desc::{Error, Image, MeasuredData, Mesh, Result, SceneDesc};

/// What can be set when a scene is loaded.
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// Values for `$name` in scene files; they win over `<default>`. Not for glTF.
    pub defines: Vec<(String, String)>,
    /// Largest size of one decoded image in bytes.
    pub max_image_bytes: u64,
    /// Largest size of all that a glTF file decodes to, but for images, in bytes.
    pub max_mesh_bytes: u64,
    /// Read files that a glTF file names outside of its folder.
    pub allow_outside: bool,
    /// The camera by name (of its node or its own; the id of a `<sensor>`) or
    /// index, instead of the first.
    pub camera: Option<String>,
    /// An image of the surroundings, in latitude and longitude. glTF only.
    pub environment: Option<PathBuf>,
    /// Elevation and azimuth in degrees of a sun to add, with a sky. glTF only.
    pub sun: Option<[f64; 2]>,
    /// The material variant of this name or index. glTF only.
    pub variant: Option<String>,
    /// The animation of this name or index, `all` or `none`. glTF only.
    pub animation: Option<String>,
    /// The frame to show: time = frame / `fps`. Without, and without
    /// `shutter` and `animation`, a glTF file is shown as stored.
    pub frame: Option<f64>,
    /// Frames per second.
    pub fps: f64,
    /// When the shutter opens and closes, in frames after `frame`.
    pub shutter: Option<[f64; 2]>,
    /// Replaces what is not known or not there, and says so: see
    /// [`SceneDesc::replacements`].
    pub lenient: bool,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions {
            defines: Vec::new(),
            max_image_bytes: 4 << 30,
            max_mesh_bytes: 16 << 30,
            allow_outside: false,
            camera: None,
            environment: None,
            sun: None,
            variant: None,
            animation: None,
            frame: None,
            fps: 24.0,
            shutter: None,
            lenient: false,
        }
    }
}

impl LoadOptions {
    /// True if a time is asked for.
    fn asks_for_time(&self) -> bool {
        self.frame.is_some() || self.shutter.is_some()
    }

    /// Fails on a number that is no time.
    fn check(&self) -> Result<()> {
        let times = self.frame.iter().chain(self.shutter.iter().flatten());
        if !(self.fps > 0.0 && self.fps.is_finite()) {
            return Err(Error::new(format!("frames per second must be positive, found {}", self.fps)));
        }
        match (times.copied().find(|t| !t.is_finite()), self.shutter) {
            (Some(bad), _) => Err(Error::new(format!("{bad} is no frame"))),
            (None, Some([open, close])) if open > close => {
                Err(Error::new(format!("the shutter must open ({open}) before it closes ({close})")))
            }
            _ => Ok(()),
        }
    }
}

/// Loads a scene file with everything it names. Files are looked for beside
/// the scene file first.
pub fn load(path: &Path, options: &LoadOptions) -> Result<SceneDesc> {
    let name = path.display().to_string();
    options.check()?;
    if gltf::is_gltf(path) {
        return load_gltf(path, options);
    }
    let text = files::read_text(path, files::XML_CAP).map_err(|e| e.at(name.clone(), Default::default()))?;
    let dir = path.parent().unwrap_or(Path::new("")).to_path_buf();
    finish(parse::parse_scene(parse::Root { name, path: Some(path), text: &text, dir }, options)?, options)
}

fn load_gltf(path: &Path, options: &LoadOptions) -> Result<SceneDesc> {
    if let Some((define, _)) = options.defines.first() {
        return Err(Error::new(format!("a glTF file has no parameters, so not `{define}`")));
    }
    gltf::load(path, options)
}

/// Loads a scene from the bytes of a `.gltf` or `.glb` file, which messages
/// call `name`; files are looked for in `folder`.
pub fn load_gltf_bytes(
    bytes: Vec<u8>,
    name: &str,
    folder: &Path,
    options: &LoadOptions,
) -> Result<SceneDesc> {
    options.check()?;
    gltf::load_bytes(bytes, name, folder, options)
}

/// Loads a scene from a string, which messages call `<string>`; files are
/// looked for in `base_dir`.
pub fn load_str(xml: &str, base_dir: &Path, options: &LoadOptions) -> Result<SceneDesc> {
    options.check()?;
    let root = parse::Root { name: "<string>".into(), path: None, text: xml, dir: base_dir.to_path_buf() };
    finish(parse::parse_scene(root, options)?, options)
}

fn finish(mut parsed: parse::Parsed, options: &LoadOptions) -> Result<SceneDesc> {
    references::resolve(&mut parsed)?;
    upgrade::upgrade(&mut parsed)?;
    stage::apply(&mut parsed.scene, options)?;
    lenient::replace_unknown(&mut parsed.scene)?;
    assets::decode(&mut parsed, options)?;
    Ok(parsed.scene)
}

/// Reads one mesh file by its extension (`obj`, `ply`, `ply.gz`,
/// `serialized`), the first shape of it, with the texture coordinates that Mitsuba would give it.
pub fn read_mesh(path: &Path) -> Result<Mesh> {
    let name = path.display().to_string();
    let ending = |p: &Path| p.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let mut kind = ending(path);
    if kind == "gz" {
        kind = ending(&path.with_extension("")) + ".gz";
    }
    let request = match kind.as_str() {
        "obj" => assets::MeshRequest::Obj { flip_tex_coords: true },
        "ply" | "ply.gz" => assets::MeshRequest::Ply { flip_tex_coords: false },
        "serialized" => assets::MeshRequest::Serialized { shape_index: 0 },
        _ => {
            return Err(Error::new(format!("no mesh format is known by the ending `{kind}`"))
                .hint("known: obj, ply, ply.gz, serialized")
                .at(name, Default::default()));
        }
    };
    request.read(path).map(|(mesh, _)| mesh).map_err(|e| e.at(name, Default::default()))
}

/// Reads one image file as a texture would.
pub fn read_image(path: &Path, options: &LoadOptions) -> Result<Image> {
    let name = path.display().to_string();
    image_file::read(path, &name, options.max_image_bytes).map_err(|e| e.at(name, Default::default()))
}

/// Reads one measured material.
pub fn read_measured(path: &Path) -> Result<MeasuredData> {
    let read = measured::read(path).map(|(data, _)| data);
    read.map_err(|e| e.at(path.display().to_string(), Default::default()))
}
