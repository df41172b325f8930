//! Files that mean harm, and what fuzzing has found: a clear message for each,
//! soon, and no more memory than the file stands for. For glTF see
//! `gltf_hostile.rs`; limits and reasons are in `docs/hostile.md`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "common/readers.rs"]
mod readers;
#[path = "common/tensor.rs"]
mod tensor;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use cpu_time::ThreadTime;
use etendue::desc::SceneDesc;
use etendue::integrator::{Integrator, IntegratorOptions};
use etendue::load::{LoadOptions, load, load_str, read_image, read_measured, read_mesh, read_picture};
use etendue::scene::{BuildOptions, Scene};
use etendue::study::Plan;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};

/// Most CPU time of any one case. Tests are compiled with checks on.
const SOON: Duration = Duration::from_secs(1);

/// Runs a case, and fails when it takes longer than it may.
fn soon<T>(what: &str, case: impl FnOnce() -> T) -> T {
    let start = ThreadTime::now();
    let result = case();
    let taken = start.elapsed();
    assert!(taken < SOON, "{what} takes {taken:?}");
    result
}

fn scene(body: &str) -> String {
    format!("<scene version=\"3.0.0\">{body}</scene>")
}

fn read(xml: &str) -> Result<SceneDesc, String> {
    load_str(xml, Path::new(""), &LoadOptions::default()).map_err(|e| e.to_string())
}

fn error(xml: &str) -> String {
    soon(&xml[..xml.len().min(80)], || read(xml)).unwrap_err()
}

/// The message when a scene is built, which it may not be.
fn build_error(body: &str) -> String {
    let xml = scene(&format!("<sensor type=\"perspective\"/>{body}"));
    soon(&body[..body.len().min(80)], || {
        let desc = read(&xml)?;
        Scene::build(&desc, &BuildOptions::default()).map(|_| ()).map_err(|e| e.to_string())
    })
    .unwrap_err()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    /// A message without the folder's name.
    fn plain(&self, message: &str) -> String {
        message.replace(&format!("{}/", self.0.path().display()), "DIR/")
    }

    /// The message about a scene file of this folder.
    fn error(&self, name: &str) -> String {
        let path = self.0.path().join(name);
        let error = soon(name, || load(&path, &LoadOptions::default())).unwrap_err();
        self.plain(&error.to_string())
    }

    fn mesh(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<etendue::desc::Mesh, String> {
        let path = self.put(name, bytes);
        soon(name, || read_mesh(&path)).map_err(|e| self.plain(&e.to_string()))
    }

    fn image(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.put(name, bytes);
        let (image, picture) =
            soon(name, || (read_image(&path, &LoadOptions::default()), read_picture(&path)));
        assert_eq!(image.as_ref().err(), picture.as_ref().err(), "{name}");
        self.plain(&image.unwrap_err().to_string())
    }
}

// ---------------------------------------------------------------- fuzzing

/// What fuzzing has found, and what it starts from: neither panics nor takes
/// long any more.
#[test]
fn regressions_of_fuzzing() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz");
    let mut count = 0;
    for (target, reader) in readers::ALL {
        reader(&[]); // what is made at first use
        for folder in ["seeds", "regressions"] {
            let Ok(files) = fs::read_dir(fuzz.join(folder).join(target)) else { continue };
            for file in files {
                let path = file.unwrap().path();
                let data = fs::read(&path).unwrap();
                soon(&path.display().to_string(), || reader(&data));
                count += 1;
            }
        }
        assert!(fuzz.join("seeds").join(target).is_dir(), "no seeds for {target}");
    }
    assert!(count > 100, "{count} inputs");
}

/// Every target is one of the fuzz package too, and the other way round.
#[test]
fn fuzz_targets_are_complete() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz");
    let manifest = fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
    let mut named: Vec<&str> =
        manifest.split("[[bin]]").skip(1).map(|b| b.split('"').nth(1).unwrap()).collect();
    let mut known: Vec<&str> = readers::ALL.iter().map(|(name, _)| *name).collect();
    named.sort_unstable();
    known.sort_unstable();
    assert_eq!(named, known);
}

/// What is fuzzed is what ships: the same versions of everything.
#[test]
fn fuzz_package_locks_the_same_versions() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let versions = |path: &str| -> Vec<(String, String)> {
        let lock: toml::Table = fs::read_to_string(root.join(path)).unwrap().parse().unwrap();
        let field = |package: &toml::Value, name: &str| package[name].as_str().unwrap().to_owned();
        let packages = lock["package"].as_array().unwrap();
        packages.iter().map(|p| (field(p, "name"), field(p, "version"))).collect()
    };
    let ours = versions("Cargo.lock");
    let mut shared = 0;
    for (name, version) in versions("tests/fuzz/Cargo.lock") {
        let known: Vec<&String> = ours.iter().filter(|(n, _)| *n == name).map(|(_, v)| v).collect();
        shared += known.len();
        assert!(
            known.is_empty() || known.contains(&&version),
            "{name} {version}: copy Cargo.lock to tests/fuzz and run `cargo metadata` there"
        );
    }
    assert!(shared > 100, "{shared}");
}

// ---------------------------------------------------------------- XML

#[test]
fn no_entities() {
    let laughs: String =
        (1..10).map(|i| format!("<!ENTITY l{i} \"{}\">", format!("&l{};", i - 1).repeat(10))).collect();
    let refused = "<string>:1:1: a document type definition (DTD) is not allowed here";
    for (what, definitions, body) in [
        ("billion laughs", format!("<!ENTITY l0 \"lol\">{laughs}"), "&l9;".to_string()),
        ("quadratic", format!("<!ENTITY a \"{}\">", "a".repeat(100_000)), "&a;".repeat(10_000)),
        ("from a file", "<!ENTITY x SYSTEM \"file:///etc/passwd\">".into(), "&x;".into()),
        ("from a network", "<!ENTITY x SYSTEM \"http://example.com/x\">".into(), "&x;".into()),
        ("parameters", "<!ENTITY % x SYSTEM \"/etc/passwd\"> %x;".into(), String::new()),
    ] {
        let xml = format!("<!DOCTYPE scene [{definitions}]>{}", scene(&body));
        assert_eq!(error(&xml), refused, "{what}");
    }
    assert!(error(&scene("<string name=\"a\" value=\"&x;\"/>")).contains("unknown entity reference"));
}

#[test]
fn deep_and_crowded_files() {
    let deep = "<shape type=\"a\">".repeat(200_000);
    assert!(error(&format!("<scene version=\"3.0.0\">{deep}")).contains("`<shape>` is not closed"));
    let closed = scene(&(deep + &"</shape>".repeat(200_000)));
    assert_eq!(error(&closed), "<string>:1:1624: tags are nested more than 100 deep");

    let attributes: String = (0..100_000).map(|i| format!(" a{i}=\"\"")).collect();
    let crowded = error(&scene(&format!("<bsdf type=\"diffuse\"{attributes}/>")));
    assert_eq!(crowded, "<string>:1:24: a tag has more than 200 attributes");
    let namespaces: String = (0..60_000).map(|i| format!(" xmlns:a{i}=\"b\"")).collect();
    let crowded = error(&format!("<scene version=\"3.0.0\"{namespaces}/>"));
    assert!(crowded.ends_with("there are more than 100 namespaces in this file"), "{crowded}");
    // What stands in a value or a comment is no attribute.
    let quiet = format!("<!--{attributes}--><string name=\"a\" value='{}'/>", "x=\"\" ".repeat(1000));
    read(&scene(&quiet)).unwrap();
}

/// All tags on one line, and all parameters in one object: linear time.
#[test]
fn long_lines_and_long_lists() {
    let shapes: String = (0..100_000).map(|i| format!("<shape type=\"cube\" name=\"s{i}\"/>")).collect();
    let desc = soon("a line of 3 MB", || read(&scene(&shapes))).unwrap();
    assert_eq!(desc.objects.len(), 100_001);
    assert_eq!(desc.objects[100_000].pos.column, shapes.len() as u32 - 10);
    let twice = error(&scene(&(shapes + "\n<bsdf type=\"diffuse\" name=\"s99999\"/>")));
    assert_eq!(twice, "<string>:2:1: `s99999` is given twice, first on line 1");
}

#[test]
fn parameters_do_not_explode() {
    let mut body = "<default name=\"p0\" value=\"0123456789\"/>".to_string();
    for i in 1..6 {
        body += &format!("<default name=\"p{i}\" value=\"{}\"/>", format!("$p{}", i - 1).repeat(10));
    }
    let one = error(&scene(&format!("{body}<string name=\"a\" value=\"{}\"/>", "$p5".repeat(2))));
    assert!(one.contains("the value grows too long when its parameters are replaced"), "{one}");
    let many: String = (0..300).map(|i| format!("<string name=\"s{i}\" value=\"$p5\"/>")).collect();
    let all = error(&scene(&(body + &many)));
    assert!(all.contains("the values grow to more than 268435456 bytes"), "{all}");
    let names: String = (0..10_001).map(|i| format!("<default name=\"n{i}\" value=\"\"/>")).collect();
    assert!(error(&scene(&names)).contains("there are more than 10000 parameters"));
}

/// Few lines that stand for very many objects.
#[test]
fn references_do_not_explode() {
    let doubled = |kind: &str, make: &dyn Fn(usize) -> String, levels: usize| -> String {
        let leaf = if kind == "bsdf" {
            "<bsdf type=\"diffuse\" id=\"x0\"/>"
        } else {
            "<texture type=\"checkerboard\" id=\"x0\"/>"
        };
        leaf.to_string() + &(1..levels).map(make).collect::<String>()
    };
    let blend = |i: usize| {
        let below = format!("<ref id=\"x{}\"/>", i - 1).repeat(2);
        format!("<bsdf type=\"blendbsdf\" id=\"x{i}\"><float name=\"weight\" value=\"0.5\"/>{below}</bsdf>")
    };
    let checks = |i: usize| {
        let below = i - 1;
        format!(
            "<texture type=\"checkerboard\" id=\"x{i}\"><ref name=\"color0\" id=\"x{below}\"/>\
             <ref name=\"color1\" id=\"x{below}\"/></texture>"
        )
    };
    for (body, place) in [
        (doubled("bsdf", &blend, 24), "references unfold to too many objects here"),
        (doubled("texture", &checks, 24), "references unfold to too many objects here"),
        (doubled("bsdf", &blend, 9), "lobes; blend fewer"),
    ] {
        let message = build_error(&body);
        assert!(message.contains(place), "{message}");
    }
    // Six levels of twelve copies each: three million instances, or none at all.
    let forest = |leaf: &str| {
        let mut body = format!("<shape type=\"shapegroup\" id=\"g0\">{leaf}</shape>");
        for i in 1..7 {
            let copy = format!("<shape type=\"instance\"><ref id=\"g{}\"/></shape>", i - 1);
            body += &format!("<shape type=\"shapegroup\" id=\"g{i}\">{}</shape>", copy.repeat(12));
        }
        body + "<shape type=\"instance\"><ref id=\"g6\"/></shape>"
    };
    let message = build_error(&forest("<shape type=\"sphere\"/>"));
    assert!(message.contains("groups in groups multiply to more than 1048576 instances"), "{message}");
    let empty = scene(&format!("<sensor type=\"perspective\"/>{}", forest("")));
    soon("empty groups", || Scene::build(&read(&empty).unwrap(), &BuildOptions::default())).unwrap();
}

// ---------------------------------------------------------------- names of files

#[test]
fn only_files_of_this_machine() {
    let folder = Folder::new();
    folder.put("textures/a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.put("scenes/a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let obj = |name: &str| {
        scene(&format!("\n<shape type=\"obj\">\n<string name=\"filename\" value=\"{name}\"/></shape>"))
    };
    let absolute = folder.0.path().join("textures/a.obj").display().to_string();
    for good in ["a.obj", "./a.obj", "../textures/a.obj", absolute.as_str()] {
        let path = folder.put("scenes/s.xml", obj(good));
        load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{good}: {e}"));
    }
    let address = |name: &str, scheme: &str| {
        format!("`{name}` is no file name; only files on this machine are read, not `{scheme}:` addresses")
    };
    let machine = |name: &str| {
        format!(
            "`{name}` names another machine; only files on this machine are read; copy it, or mount its folder"
        )
    };
    for (bad, message) in [
        ("http://example.com/a.obj", address("http://example.com/a.obj", "http")),
        ("HTTPS://example.com/a.obj", address("HTTPS://example.com/a.obj", "HTTPS")),
        ("file:///etc/passwd", address("file:///etc/passwd", "file")),
        ("data:,v", address("data:,v", "data")),
        ("//server/share/a.obj", machine("//server/share/a.obj")),
        ("\\\\server\\share\\a.obj", machine("\\\\server\\share\\a.obj")),
        ("../textures", "`DIR/scenes/../textures` is not a regular file".into()),
        ("/dev/zero", "`/dev/zero` is not a regular file".into()),
        ("b.obj", "cannot find the file `b.obj`; did you mean `a.obj`?".into()),
        ("", "the file name is empty".into()),
    ] {
        folder.put("scenes/s.xml", obj(bad));
        assert_eq!(folder.error("scenes/s.xml"), format!("DIR/scenes/s.xml:3:1: {message}"), "{bad}");
    }
}

/// Every reader of files opens regular ones only: none waits, none reads what
/// has no end.
#[cfg(unix)]
#[test]
fn no_devices_and_no_pipes() {
    let folder = Folder::new();
    let pipe = folder.0.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for place in [pipe.as_path(), Path::new("/dev/zero"), folder.0.path()] {
        for ending in ["obj", "ply", "serialized", "bsdf", "exr", "png", "xml", "spd"] {
            let link = folder.0.path().join(format!("link.{ending}"));
            let _ = fs::remove_file(&link);
            std::os::unix::fs::symlink(place, &link).unwrap();
            let message = soon(ending, || match ending {
                "obj" | "ply" | "serialized" => read_mesh(&link).unwrap_err().to_string(),
                "bsdf" => read_measured(&link).unwrap_err().to_string(),
                "exr" | "png" => read_image(&link, &LoadOptions::default()).unwrap_err().to_string(),
                "xml" => load(&link, &LoadOptions::default()).unwrap_err().to_string(),
                _ => {
                    let tag = format!("<spectrum name=\"value\" filename=\"{}\"/>", link.display());
                    error(&scene(&format!("<spectrum type=\"irregular\">{tag}</spectrum>")))
                }
            });
            assert!(message.contains("is not a regular file"), "{ending}: {message}");
        }
        let tag = format!("<include filename=\"{}\"/>", place.display());
        assert!(error(&scene(&tag)).contains("is not a regular file"));
    }
    // Says that it is empty, and would wait for messages of the kernel.
    if Path::new("/proc/kmsg").exists() {
        let message = soon("/proc/kmsg", || load(Path::new("/proc/kmsg"), &LoadOptions::default()));
        assert!(message.is_err());
    }
}

#[test]
fn includes_do_not_explode() {
    let folder = Folder::new();
    for i in 0..14 {
        let tag = format!("<include filename=\"i{}.xml\"/>", i + 1);
        folder.put(&format!("i{i}.xml"), scene(&tag.repeat(10)));
    }
    folder.put("i14.xml", scene(""));
    let message = folder.error("i0.xml");
    assert!(message.contains("the scene includes too many files"), "{message}");
    folder.put("loop.xml", scene("<include filename=\"./loop.xml\"/>"));
    assert!(folder.error("loop.xml").contains("includes itself"));
}

// ---------------------------------------------------------------- meshes

fn ply(elements: &str, body: &[u8]) -> Vec<u8> {
    [format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n").as_bytes(), body].concat()
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";
const LIST: &str = "property list uint uint vertex_index\n";

#[test]
fn lying_ply_files() {
    let folder = Folder::new();
    let error = |elements: &str, body: &[u8]| folder.mesh("a.ply", ply(elements, body)).unwrap_err();
    let said = |message: &str| format!("DIR/a.ply: mesh `DIR/a.ply`: {message}");
    assert_eq!(error("element vertex 1000000000\n", b""), said("there is no element `vertex`"));
    assert_eq!(
        error(&format!("element vertex 1000000000000\n{XYZ}"), &[0; 36]),
        said("the header promises 1000000000000 of `vertex`, but only 36 bytes follow")
    );
    let faces = format!("element vertex 3\n{XYZ}element face 1\n{LIST}");
    let mut body = [0; 44];
    body[36..40].fill(255);
    assert_eq!(error(&faces, &body), said("`face` 0: a list cannot have 4294967295 entries"));
    assert_eq!(error("element vertex -1\n", b""), said("`-1` is no count of `vertex`"));
    let many: String = (0..2000).map(|i| format!("property char p{i}_0\n")).collect();
    assert_eq!(
        error(&format!("element vertex 1\n{many}"), b""),
        said("element `vertex` has more than 1000 properties")
    );
    let many: String = (0..2000).map(|i| format!("element e{i} 0\n")).collect();
    assert_eq!(error(&many, b""), said("the header has more than 1000 elements"));

    // 400 numbers for each corner of a polygon that has 100,000.
    let extra: String = (0..400).map(|i| format!("property char a{i}_0\n")).collect();
    let wide = format!("element vertex 3\n{XYZ}element face 1\n{LIST}{extra}");
    let mut body = vec![0; 36];
    body.extend(100_000u32.to_le_bytes());
    body.resize(body.len() + 400_400, 0);
    assert_eq!(error(&wide, &body), said("its polygons have too many corners for so many attributes"));
}

#[test]
fn packed_meshes_do_not_explode() {
    let folder = Folder::new();
    let zeros = vec![0; 100 << 20];
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    packer.write_all(&ply(&format!("element vertex 8738133\n{XYZ}"), &zeros)).unwrap();
    let bomb = packer.finish().unwrap();
    let message = folder.mesh("a.ply.gz", &bomb).unwrap_err();
    assert!(message.contains("unpack to more than the"), "{message}");

    let serialized = |head: &[u8], tail: &[u8]| {
        let mut packer = ZlibEncoder::new([0x1c, 0x04, 4, 0].to_vec(), Compression::fast());
        packer.write_all(head).unwrap();
        packer.write_all(tail).unwrap();
        packer.finish().unwrap()
    };
    let head = |vertices: u64| [&[0; 5][..], &vertices.to_le_bytes(), &[0; 8]].concat();
    for (name, bytes, said) in [
        ("count", serialized(&head(1 << 31), &[]), "2147483648 position cannot fit into this file"),
        ("zeros", serialized(&head(8_738_133), &zeros), "8738133 position cannot fit into this file"),
        ("name", serialized(&[0; 4], &vec![1; 10 << 20]), "its name has more than 65536 bytes"),
        ("cut", serialized(&head(3), &[0; 30]), "the data ends before all 3 position"),
    ] {
        let message = folder.mesh("a.serialized", bytes).unwrap_err();
        assert!(message.contains(said), "{name}: {message}");
    }
}

#[test]
fn hostile_obj_files() {
    let folder = Folder::new();
    for (text, said) in [
        ("v 0 0 nan\n", "line 1: vertex 1 is not finite"),
        ("v 0 0 1e39\n", "line 1: vertex 1 is not finite"),
        ("v 0 0 0\nvn inf 0 0\n", "line 2: normal 1 is not finite"),
        ("v 0 0 0\nvt 0 -inf\n", "line 2: texture coordinate 1 is not finite"),
        ("v 0 0 0\nf 1 1 4000000000\n", "line 2: face 1: vertex 4000000000 is out of range, there are 1"),
        ("v 0 0 0\nf 1 1 -2\n", "line 2: face 1: vertex -2 is out of range, there are 1"),
        (
            "v 0 0 0\nf 1 1 99999999999999999999\n",
            "line 2: face 1: expected an index, found `99999999999999999999`",
        ),
    ] {
        let message = folder.mesh("a.obj", text).unwrap_err();
        assert_eq!(message, format!("DIR/a.obj: mesh `DIR/a.obj`, {said}"));
    }
    // Other files that it names are none of our business.
    let mesh = folder.mesh("a.obj", "mtllib ../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(mesh.triangles.len(), 1);
    // A hundred thousand corners at one position.
    let mut crowd = "v 0 0 0\n".to_string();
    for i in 1..=100_000 {
        crowd += &format!("vn 0 {i} 1\nf 1//{i} 1//{i} 1//1\n");
    }
    let mesh = folder.mesh("a.obj", crowd).unwrap();
    assert_eq!((mesh.positions.len(), mesh.triangles[99_999]), (100_000, [99_999, 99_999, 0]));
}

#[test]
fn hostile_curves() {
    let folder = Folder::new();
    let curves = |kind: &str, text: &str| {
        folder.put("a.txt", text);
        let body = format!(
            "<sensor type=\"perspective\"/><shape type=\"{kind}\"><string name=\"filename\" value=\"a.txt\"/></shape>"
        );
        soon(kind, || {
            let desc = load_str(&scene(&body), folder.0.path(), &LoadOptions::default())?;
            Scene::build(&desc, &BuildOptions::default()).map(|scene| scene.geometry.curve_count())
        })
        .map_err(|e| e.message)
    };
    // Many points on one spot, in one curve and in as many as there can be.
    let spot = "0 0 0 1\n";
    assert_eq!(curves("bsplinecurve", &spot.repeat(20_000)), Ok(19_997));
    assert_eq!(curves("linearcurve", &format!("{spot}{spot}\n").repeat(10_000)), Ok(10_000));
    // A line without end, and empty lines without end.
    let long = curves("linearcurve", &"0 ".repeat(1 << 20)).unwrap_err();
    assert!(long.ends_with("line 1: expected 4 numbers `x y z radius`, found 1048576"), "{long}");
    let empty = curves("linearcurve", &"\n".repeat(1 << 20)).unwrap_err();
    assert!(empty.ends_with("no control points; expected lines `x y z radius`"), "{empty}");
    let word = curves("linearcurve", &"9".repeat(1 << 20)).unwrap_err();
    assert!(word.len() < 200, "{word}");
}

// ---------------------------------------------------------------- measured materials

#[test]
fn lying_measured_materials() {
    use tensor::{Field, file, floats, small};
    let folder = Folder::new();
    let read = |bytes: Vec<u8>| {
        let path = folder.put("a.bsdf", bytes);
        soon("a.bsdf", || read_measured(&path)).map(|_| ()).map_err(|e| {
            let message = folder.plain(&e.to_string());
            message.strip_prefix("DIR/a.bsdf: measured material `DIR/a.bsdf`: ").unwrap().to_owned()
        })
    };
    let with = |field: Field| {
        let mut fields: Vec<Field> = small().into_iter().filter(|f| f.name != field.name).collect();
        fields.push(field);
        read(file(&fields)).unwrap_err()
    };
    let whole = file(&small());
    assert_eq!(read(whole.clone()), Ok(()));
    // Cut anywhere: in the header, the table, or the data of a field.
    for end in 0..whole.len() {
        let message = read(whole[..end].to_vec()).unwrap_err();
        assert!(message.starts_with("the file ends within ") || message.contains(" does not fit into the "));
    }
    let changed = |at: usize, bytes: &[u8]| {
        let mut file = whole.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        read(file).unwrap_err()
    };
    assert_eq!(changed(0, b"T"), "it does not begin with `tensor_file`");
    assert_eq!(changed(12, &[2]), "unknown version 2.0, expected 1.0");
    assert_eq!(changed(14, &[255; 4]), "it has 4294967295 fields, more than 1000");
    assert_eq!(changed(14, &[200, 0, 0, 0]), "the file ends within the name of a field");
    let short = small().into_iter().take(7).collect::<Vec<_>>();
    assert_eq!(read(file(&short)).unwrap_err(), "there is no field `jacobian`");
    let twice: Vec<Field> = small().into_iter().chain(small()).collect();
    assert_eq!(read(file(&twice)).unwrap_err(), "there are two fields `theta_i`");
    let long = Field { shape: vec![1; 17], ..floats("x", &[], &[]) };
    assert_eq!(with(long), "`x` has 17 dimensions, more than 16");

    let ndf = |shape: &[u64], values: &[f32]| floats("ndf", shape, values);
    let huge = u64::MAX / 2;
    for (field, said) in [
        (Field { kind: 11, ..ndf(&[2, 3], &[0.0; 6]) }, "`ndf` is of type float64, expected float32"),
        (Field { kind: 0, ..ndf(&[2, 3], &[0.0; 6]) }, "`ndf` is of unknown type 0, expected float32"),
        (ndf(&[6], &[0.5; 6]), "`ndf` has 1 dimensions, expected 2"),
        (ndf(&[1, 6], &[0.5; 6]), "`ndf` has 6 × 1 nodes, expected 2 to 8192 each way"),
        (ndf(&[0, 6], &[]), "`ndf` has 6 × 0 nodes, expected 2 to 8192 each way"),
        (ndf(&[2, 3], &[0.0, 1.0, -1.0, 0.0, 0.0, 0.0]), "`ndf`: value 2 is -1"),
        (ndf(&[2, 3], &[0.0, f32::NAN, 0.0, 0.0, 0.0, 0.0]), "`ndf`: value 1 is NaN"),
        (ndf(&[2, 3], &[f32::INFINITY; 6]), "`ndf`: value 0 is inf"),
        (
            ndf(&[2, 3], &[3e38; 6]),
            "`rgb` of up to 2.3e-1 times `ndf`/(4 `sigma`) of up to 3.0e38 is too much",
        ),
        (floats("sigma", &[2, 2], &[1.0, 1.0, 0.0, 1.0]), "`sigma`: value 2 is 0, expected an area"),
        (floats("theta_i", &[0], &[]), "`theta_i` is empty"),
        (floats("theta_i", &[2], &[0.5, 0.5]), "`theta_i`: value 1 does not rise"),
        (floats("theta_i", &[2], &[0.5, 5.0]), "`theta_i`: value 1 is 5, expected an angle in radians"),
        (floats("phi_i", &[2], &[0.0, 1.0]), "`vndf` has [1, 2] slices, expected [2, 2]"),
        (floats("vndf", &[1, 2, 2, 2], &[-1.0; 8]), "`vndf`: value 0 is -1"),
        (floats("luminance", &[1, 3, 2, 2], &[1.0; 12]), "`luminance` has [1, 3] slices, expected [1, 2]"),
        (floats("rgb", &[1, 2, 4, 2, 2], &[1.0; 32]), "`rgb` has 4 channels, expected 3"),
        (floats("rgb", &[1, 2, 3, 2, 2], &[f32::NAN; 24]), "`rgb`: value 0 is NaN"),
        (floats("rgb", &[1, 2, 3, 1, 2], &[0.5; 12]), "`rgb` has 2 × 1 nodes, expected 2 to 8192"),
        (
            Field { kind: 1, bytes: vec![7], ..floats("jacobian", &[1], &[]) },
            "`jacobian` is 7, expected 0 or 1",
        ),
        (Field { kind: 1, ..floats("jacobian", &[0], &[]) }, "`jacobian` has 0 values, expected 1"),
        (Field { shape: vec![2, 3], ..floats("ndf", &[], &[]) }, "does not fit into the"),
        (ndf(&[huge, 3], &[]), "does not fit into the"),
        (ndf(&[1 << 33, 1 << 33], &[]), "does not fit into the"),
        (floats("vndf", &[1, 2, huge, 0], &[]), "does not fit into the"),
        (Field { offset: Some(u64::MAX - 7), ..ndf(&[2, 3], &[0.5; 6]) }, "does not fit into the"),
        (Field { offset: Some(1 << 40), ..ndf(&[2, 3], &[0.5; 6]) }, "at byte 1099511627776 does not fit"),
    ] {
        let message = with(field);
        assert!(message.contains(said), "{said}: {message}");
    }

    let spectral = |wavelengths: &[f32], channels: u64| {
        let mut fields: Vec<Field> = small().into_iter().filter(|f| f.name != "rgb").collect();
        fields.push(floats("wavelengths", &[wavelengths.len() as u64], wavelengths));
        let values = vec![0.5; 8 * channels as usize];
        fields.push(floats("spectra", &[1, 2, channels, 2, 2], &values));
        read(file(&fields)).unwrap_err()
    };
    assert_eq!(spectral(&[], 1), "`wavelengths` has 0 values, expected 1 to 4096");
    assert_eq!(spectral(&[500.0, 400.0], 2), "`wavelengths`: value 1 does not rise");
    assert_eq!(spectral(&[f32::NAN], 1), "`wavelengths`: value 0 is NaN");
    assert_eq!(spectral(&[400.0, 500.0], 3), "`spectra` has 3 channels, expected 2");
    let without: Vec<Field> = small().into_iter().filter(|f| f.name != "rgb").collect();
    assert_eq!(read(file(&without)).unwrap_err(), "there is neither a field `rgb` nor `spectra`");
    // Ever so many elevations, each of which takes time.
    let mut many = small();
    let rising: Vec<f32> = (0..20_000).map(|i| i as f32 * 7e-5).collect();
    many[0] = floats("theta_i", &[20_000], &rising);
    many[4] = floats("vndf", &[1, 20_000, 2, 2], &vec![1.0; 80_000]);
    many[5] = floats("luminance", &[1, 20_000, 2, 2], &vec![1.0; 80_000]);
    many[6] = floats("rgb", &[1, 20_000, 3, 2, 2], &vec![0.1; 240_000]);
    let said = "`theta_i` and `phi_i` make 20000 × 1 slices, more than 16384";
    assert_eq!(read(file(&many)).unwrap_err(), said);
    // Azimuths of a third of the circle.
    let mut third = small();
    third[1] = floats("phi_i", &[3], &[-3.1, -2.0, -1.0]);
    third[4] = floats("vndf", &[3, 2, 2, 2], &[1.0; 24]);
    third[5] = floats("luminance", &[3, 2, 2, 2], &[1.0; 24]);
    third[6] = floats("rgb", &[3, 2, 3, 2, 2], &[0.1; 72]);
    let said = "`phi_i` runs from -3.1 to -1, expected all azimuths, or -π to 0, or -π to -π/2";
    assert_eq!(read(file(&third)).unwrap_err(), said);
}

// ---------------------------------------------------------------- images

/// A header that promises `size` by `size` pixels, and nothing after it.
fn png(size: u32) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        out.extend((data.len() as u32).to_be_bytes());
        let body = [kind, data].concat();
        let mut sum = flate2::Crc::new();
        sum.update(&body);
        out.extend(&body);
        out.extend(sum.sum().to_be_bytes());
    };
    chunk(b"IHDR", &[&size.to_be_bytes()[..], &size.to_be_bytes(), &[8, 6, 0, 0, 0]].concat());
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::fast());
    packer.write_all(&[0; 1000]).unwrap();
    chunk(b"IDAT", &packer.finish().unwrap());
    chunk(b"IEND", &[]);
    out
}

/// An OpenEXR file of one channel of halves, by its data window.
fn exr(window: [i32; 4], compression: u8) -> Vec<u8> {
    let mut out = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, data: &[u8]| {
        out.extend(name.bytes().chain([0]).chain(kind.bytes()).chain([0]));
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(data);
    };
    let window: Vec<u8> = window.iter().flat_map(|v| v.to_le_bytes()).collect();
    let channel =
        [&b"Y\0"[..], &1u32.to_le_bytes(), &[0; 4], &1u32.to_le_bytes(), &1u32.to_le_bytes(), &[0]].concat();
    attribute("channels", "chlist", &channel);
    attribute("compression", "compression", &[compression]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    out.extend([0; 1000]);
    out
}

#[test]
fn pictures_that_promise_too_much() {
    let folder = Folder::new();
    let too_large = "takes more than the 4294967296 bytes allowed by `max_image_bytes`";
    let cannot_hold = "bytes of pixels, which";
    let hdr = |size: u64| format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {size} +X {size}\n\0\0\0\0");
    for (name, bytes, said) in [
        ("a.png", png(30_000), cannot_hold),
        ("a.png", png(100_000), too_large),
        ("a.hdr", hdr(60_000).into_bytes(), too_large),
        ("a.hdr", hdr(1 << 31).into_bytes(), too_large),
        ("a.hdr", hdr(0).into_bytes(), "it has no pixels"),
        (
            "a.exr",
            exr([0, 0, 65_535, 65_535], 3),
            "take more than the 4294967296 bytes allowed by `max_image_bytes`",
        ),
        ("a.exr", exr([0, 0, 29_999, 29_999], 3), cannot_hold),
        ("a.exr", exr([0, 0, 29_999, 29_999], 8), cannot_hold),
        ("a.exr", exr([i32::MIN, i32::MIN, i32::MAX, i32::MAX], 0), "cannot decode it"),
        ("a.exr", exr([9, 9, 0, 0], 0), "cannot decode it"),
        ("a.exr", exr([0, 0, 7, 7], 0), "cannot decode it"),
    ] {
        let message = folder.image(name, bytes);
        assert!(message.contains(said), "{name}: {message}");
        assert!(message.starts_with(&format!("DIR/{name}: image `DIR/{name}`: ")), "{message}");
    }
    // Colours of 12,000² black pixels do fit into a small file.
    let blank = image::GrayImage::new(3000, 3000);
    let path = folder.0.path().join("blank.png");
    blank.save(&path).unwrap();
    assert_eq!(read_image(&path, &LoadOptions::default()).unwrap().width, 3000);
    let small = LoadOptions { max_image_bytes: 1000, ..LoadOptions::default() };
    assert!(read_image(&path, &small).unwrap_err().to_string().contains("the 1000 bytes allowed"));
}

// ---------------------------------------------------------------- studies

#[test]
fn hostile_plans() {
    let parse = |text: &str| {
        soon(&text[..text.len().min(60)], || {
            Plan::parse(text, "plan.toml").and_then(|mut plan| plan.check()).map_err(|e| e.to_string())
        })
    };
    let scene = "spp = 1\nrepeats = 3\n[[scene]]\nfile = \"a.xml\"\n";
    parse(scene).unwrap();
    let values = (0..100).map(|i| i.to_string()).collect::<Vec<_>>().join(", ");
    let vary: String = (0..10).map(|i| format!("k{i} = [{values}]\n")).collect();
    let message = parse(&format!("{scene}[vary]\n{vary}")).unwrap_err();
    assert!(message.contains("combines to more than 1000000 configurations"), "{message}");
    let message = parse(&scene.replace("repeats = 3", "repeats = 4294967295")).unwrap_err();
    assert!(message.contains("the plan asks for 4294967295 runs"), "{message}");
    for open in ["[", "{a="] {
        assert!(parse(&format!("title = {}", open.repeat(100_000))).is_err());
    }
}

/// The integrator of a scene is read apart from the rest.
#[test]
fn integrators_within_integrators() {
    let nested = "<integrator type=\"aov\">".repeat(90) + &"</integrator>".repeat(90);
    let desc = read(&scene(&nested)).unwrap();
    assert!(soon("integrators", || Integrator::from_desc(&desc, &IntegratorOptions::default())).is_err());
}
