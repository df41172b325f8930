//! One function for each thing that reads what others wrote, and one each for
//! numbers in scattering and in intersection: whatever the bytes, it must give
//! an error or a result, without a panic, soon and in little memory. The fuzz
//! targets in `tests/fuzz` and the test of their regressions call these.

use std::cell::{LazyCell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use etendue::bsdf::{Bsdf, Measured};
use etendue::desc::{Category, Error, Image, Mesh, Param, SceneDesc};
use etendue::integrator::{Integrator, IntegratorOptions};
use etendue::load::{
    LoadOptions, Picture, load_gltf_bytes, load_str, read_image, read_measured, read_mesh,
    read_picture_within,
};
use etendue::scene::{BuildOptions, Scene};
use etendue::study::{Ledger, Plan};
use tempfile::TempDir;

#[path = "readers_numbers.rs"]
mod numbers;
use numbers::scatter;
pub use numbers::{bsdf, shape};

/// What takes the bytes of an input.
pub type Reader = fn(&[u8]);

/// All targets by name.
#[allow(dead_code, reason = "the fuzz targets name one each")]
pub const ALL: &[(&str, Reader)] = &[
    ("xml", xml),
    ("ply", ply),
    ("obj", obj),
    ("serialized", serialized),
    ("curves", curves),
    ("measured", measured),
    ("gltf", gltf),
    ("exr", exr),
    ("picture", picture),
    ("values", values),
    ("plan", plan),
    ("ledger", ledger),
    ("bsdf", bsdf),
    ("shape", shape),
];

/// What a scene may have that is built as well: building takes longer than
/// reading, and is looked at for what small scenes can do to it.
const OBJECTS: usize = 60;
/// Of triangles, and of control points of curves.
const TRIANGLES: usize = 2000;
const TEXELS: u64 = 4096;

/// A folder of the thread's own, in memory where there is such a place.
fn folder() -> PathBuf {
    thread_local! {
        static FOLDER: LazyCell<TempDir> = const { LazyCell::new(|| {
            let memory = Path::new("/dev/shm");
            let place = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
            let folder = tempfile::tempdir_in(place).expect("a folder for the inputs");
            copy(&features().join("data"), &folder.path().join("data"));
            folder
        }) };
    }
    FOLDER.with(|folder| folder.path().to_path_buf())
}

/// The scenes of all plugins, whose meshes and textures the inputs may name.
fn features() -> PathBuf {
    let mut root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    while !root.join("scenes/features").is_dir() {
        assert!(root.pop(), "no scenes/features above the package");
    }
    root.join("scenes/features")
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("the data of the scenes") {
        let path = entry.expect("a file").path();
        std::fs::copy(&path, to.join(path.file_name().expect("it has a name"))).expect("a copy");
    }
}

/// Writes the input to a file of that name.
fn file(name: &str, data: &[u8]) -> PathBuf {
    let path = folder().join(name);
    std::fs::write(&path, data).expect("the input is written");
    path
}

fn options() -> LoadOptions {
    LoadOptions { max_image_bytes: 16 << 20, max_mesh_bytes: 64 << 20, ..LoadOptions::default() }
}

/// An error says something.
fn told(error: &Error) {
    assert!(!error.message.is_empty());
    assert!(error.to_string().len() < 1 << 20, "a message of {} bytes", error.to_string().len());
}

/// Builds what was read, if it is small.
fn build(desc: &SceneDesc) {
    let triangles: usize = desc.meshes.iter().map(|m| m.triangles.len()).sum();
    let texels: u64 = desc.images.iter().map(|i| u64::from(i.width) * u64::from(i.height)).sum();
    let points: usize = desc.curves.iter().map(|c| c.points.len()).sum();
    if desc.objects.len() > OBJECTS || triangles.max(points) > TRIANGLES || texels > TEXELS {
        return;
    }
    match Scene::build(desc, &BuildOptions::default()) {
        Ok(scene) => {
            let integrator = Integrator::from_desc(desc, &IntegratorOptions::default());
            integrator.err().iter().for_each(told);
            assert!(!scene.plan.to_string().is_empty());
        }
        Err(error) => told(&error),
    }
}

/// Mitsuba's XML, strictly; what is refused but well formed also leniently.
pub fn xml(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let folder = folder();
    match load_str(text, &folder, &options()) {
        Ok(desc) => build(&desc),
        Err(error) => {
            told(&error);
            if !error.message.starts_with("malformed XML") {
                lenient(text, &folder);
            }
        }
    }
}

fn lenient(text: &str, folder: &Path) {
    match load_str(text, folder, &LoadOptions { lenient: true, ..options() }) {
        Ok(desc) => build(&desc),
        Err(error) => told(&error),
    }
}

/// One value tag in a scene: spectra, colours, transforms, substitution. A
/// shape's parameters, so that there is little around what is looked at.
pub fn values(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let version = if data.len().is_multiple_of(2) { "3.0.0" } else { "0.6.0" };
    let xml = format!("<scene version=\"{version}\"><shape type=\"sphere\">{text}</shape></scene>");
    match load_str(&xml, Path::new("/nowhere"), &options()) {
        Ok(desc) => assert!(desc.object(desc.root).category == Category::Scene),
        Err(error) => told(&error),
    }
    // The same bytes as a file of wavelengths.
    let named = file("a.spd", data);
    let xml = format!(
        "<scene version=\"3.0.0\"><spectrum type=\"irregular\"><spectrum name=\"value\" filename=\"{}\"/>\
         </spectrum></scene>",
        named.display()
    );
    load_str(&xml, Path::new("/nowhere"), &options()).err().iter().for_each(told);
}

/// A scene around one mesh or image.
fn scene_of(shape: &str, emitter: &str, path: &Path) {
    let xml = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\
         <shape type=\"{shape}\"><string name=\"filename\" value=\"{0}\"/>\
         <bsdf type=\"diffuse\"/></shape>{emitter}</scene>",
        path.display()
    );
    match load_str(&xml, &folder(), &options()) {
        Ok(desc) => build(&desc),
        Err(error) => told(&error),
    }
}

fn check_mesh(mesh: &Mesh) {
    let count = mesh.positions.len();
    assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < count), "an index out of range");
    assert!(mesh.positions.iter().all(|p| p.is_finite()), "a position that is not finite");
    assert!(mesh.normals.is_empty() || mesh.normals.len() == count);
    assert!(mesh.uvs.is_empty() || mesh.uvs.len() == count);
}

fn mesh(kind: &str, name: &str, data: &[u8]) {
    let path = file(name, data);
    match read_mesh(&path) {
        Ok(mesh) => {
            check_mesh(&mesh);
            if mesh.triangles.len() <= TRIANGLES {
                let glow = "<rgb name=\"radiance\" value=\"1\"/>";
                scene_of(kind, &format!("<emitter type=\"constant\">{glow}</emitter>"), &path);
            }
        }
        Err(error) => told(&error),
    }
}

/// Stanford PLY.
pub fn ply(data: &[u8]) {
    mesh("ply", "a.ply", data);
}

/// Wavefront OBJ.
pub fn obj(data: &[u8]) {
    mesh("obj", "a.obj", data);
}

/// Curves, linear or splines: the first byte says.
pub fn curves(data: &[u8]) {
    let Some((how, rest)) = data.split_first() else { return };
    let kind = if how & 1 == 0 { "linearcurve" } else { "bsplinecurve" };
    scene_of(kind, "", &file("a.txt", rest));
}

/// Measured materials; what is read is evaluated too.
pub fn measured(data: &[u8]) {
    let path = file("a.bsdf", data);
    let data = match read_measured(&path) {
        Ok(data) => data,
        Err(error) => return told(&error),
    };
    let tables = Measured::new(Arc::new(data)).expect("the reader has checked it");
    scatter(&Bsdf::from(&tables));
    let xml = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"sphere\"><bsdf type=\"measured\">\
         <string name=\"filename\" value=\"{}\"/></bsdf></shape></scene>",
        path.display()
    );
    match load_str(&xml, &folder(), &options()) {
        Ok(desc) => build(&desc),
        Err(error) => told(&error),
    }
}

/// Mitsuba's binary meshes: the file itself, or (the first byte says) what is
/// to be compressed in it, since no fuzzer writes zlib.
pub fn serialized(data: &[u8]) {
    use std::io::Write as _;
    let Some((how, rest)) = data.split_first() else { return };
    if how & 1 == 0 {
        return mesh("serialized", "a.serialized", rest);
    }
    let version = 3 + u16::from(how >> 1 & 1);
    let mut whole = 0x041c_u16.to_le_bytes().to_vec();
    whole.extend(version.to_le_bytes());
    let mut packer = flate2::write::ZlibEncoder::new(whole, flate2::Compression::fast());
    packer.write_all(rest).expect("it is written to memory");
    mesh("serialized", "a.serialized", &packer.finish().expect("it is written to memory"));
}

/// The input as a file: JSON, a zero and a buffer become a `.glb` whose lengths
/// are right, which a fuzzer would seldom hit; all else stays as it is.
fn glb(data: &[u8]) -> Vec<u8> {
    let Some(cut) = data.iter().position(|b| *b == 0).filter(|_| data[0] == b'{') else {
        return data.to_vec();
    };
    let (json, buffer) = (&data[..cut], &data[cut + 1..]);
    let chunk = |kind: &[u8; 4], bytes: &[u8], pad: u8| {
        let length = bytes.len().next_multiple_of(4);
        let mut chunk = (length as u32).to_le_bytes().to_vec();
        chunk.extend(kind);
        chunk.extend(bytes);
        chunk.resize(8 + length, pad);
        chunk
    };
    let chunks = [chunk(b"JSON", json, b' '), chunk(b"BIN\0", buffer, 0)].concat();
    let total = 12 + chunks.len() as u32;
    [&b"glTF"[..], &2u32.to_le_bytes(), &total.to_le_bytes(), &chunks].concat()
}

/// glTF 2.0, either kind, with a time to show it at.
pub fn gltf(data: &[u8]) {
    let options = LoadOptions {
        shutter: data.len().is_multiple_of(3).then_some([0.0, 12.0]),
        frame: data.len().is_multiple_of(2).then_some(3.0),
        lenient: data.len() % 5 == 1,
        ..options()
    };
    match load_gltf_bytes(glb(data), "a.glb", &folder(), &options) {
        Ok(desc) => {
            desc.meshes.iter().for_each(|mesh| check_mesh(mesh));
            // What transmits has a table made for it, which takes milliseconds.
            let transmits = |p: &Param| p.name.contains("transmission");
            if data.len().is_multiple_of(16) || !desc.objects.iter().any(|o| o.params.iter().any(transmits)) {
                build(&desc);
            }
        }
        Err(error) => told(&error),
    }
}

fn check_image(image: &Image) {
    assert!(image.width > 0 && image.height > 0 && (1..=4).contains(&image.channels));
}

fn check_picture(picture: &Picture) {
    let area = picture.width as usize * picture.height as usize;
    assert!(picture.channels.iter().all(|(_, values)| values.len() == area));
}

/// As a texture and as surroundings, and as `compare` reads it.
fn image(name: &str, data: &[u8]) {
    let path = file(name, data);
    // Larger ones show nothing more and take longer.
    let options = || LoadOptions { max_image_bytes: 1 << 18, ..options() };
    match read_picture_within(&path, options().max_image_bytes) {
        Ok(picture) => check_picture(&picture),
        Err(error) => told(&error),
    }
    let image = match read_image(&path, &options()) {
        Ok(image) => image,
        Err(error) => return told(&error),
    };
    check_image(&image);
    if u64::from(image.width) * u64::from(image.height) > TEXELS / 2 {
        return;
    }
    let name = path.display();
    let xml = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\
         <shape type=\"rectangle\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\">\
         <string name=\"filename\" value=\"{name}\"/></texture></bsdf></shape>\
         <emitter type=\"envmap\"><string name=\"filename\" value=\"{name}\"/></emitter></scene>"
    );
    match load_str(&xml, &folder(), &options()) {
        Ok(desc) => build(&desc),
        Err(error) => told(&error),
    }
}

/// OpenEXR.
pub fn exr(data: &[u8]) {
    let mut whole = vec![0x76, 0x2f, 0x31, 0x01];
    whole.extend(data);
    image("a.exr", &whole);
}

/// HDR, PNG, JPEG, WebP, BMP, and TGA by the file's ending.
pub fn picture(data: &[u8]) {
    image("a.tga", data);
}

/// A study's plan.
pub fn plan(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let checked = Plan::parse(text, "plan.toml").and_then(|mut plan| {
        plan.check()?;
        plan.configurations()?;
        plan.budgets().map(|_| ())
    });
    checked.err().iter().for_each(told);
}

/// The lines of finished runs.
pub fn ledger(data: &[u8]) {
    thread_local!(static RUNS: RefCell<Option<PathBuf>> = const { RefCell::new(None) });
    let place = RUNS.with_borrow_mut(|place| {
        let make = || {
            let place = folder().join("study");
            std::fs::create_dir_all(&place).expect("a folder");
            place
        };
        place.get_or_insert_with(make).clone()
    });
    std::fs::write(place.join("runs.jsonl"), data).expect("the input is written");
    match Ledger::open(&place) {
        Ok(ledger) => assert!(ledger.get("no such key").is_none()),
        Err(error) => told(&error),
    }
}
