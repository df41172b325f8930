//! Loading: the scene language, exact messages of errors, mesh and image
//! formats, and real scenes where they are at hand.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use etendue::desc::{Category, Object, Pixels, SceneDesc, Value};
use etendue::load::{LoadOptions, load, load_str, read_mesh, read_picture};
use etendue::math::{DVec3, Vec2, Vec3};

fn options(defines: &[(&str, &str)]) -> LoadOptions {
    let defines = defines.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    LoadOptions { defines, ..LoadOptions::default() }
}

fn read(xml: &str) -> SceneDesc {
    load_str(xml, Path::new(""), &options(&[])).unwrap_or_else(|e| panic!("{e}\n{xml}"))
}

fn error(xml: &str) -> String {
    load_str(xml, Path::new(""), &options(&[])).unwrap_err().to_string()
}

fn scene(body: &str) -> String {
    format!("<scene version=\"3.0.0\">{body}</scene>")
}

fn find<'a>(scene: &'a SceneDesc, plugin: &str) -> &'a Object {
    scene.objects.iter().find(|o| o.plugin == plugin).unwrap_or_else(|| panic!("no {plugin}"))
}

fn value<'a>(object: &'a Object, name: &str) -> &'a Value {
    &object.params.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("no {name}")).value
}

/// A value of one parameter tag.
fn single(tag: &str) -> Value {
    value(find(&read(&scene(&format!("<bsdf type=\"t\">{tag}</bsdf>"))), "t"), "a").clone()
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

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn load(&self, name: &str, defines: &[(&str, &str)]) -> Result<SceneDesc, String> {
        load(&self.0.path().join(name), &options(defines)).map_err(|e| e.to_string())
    }

    /// The message of an error, without the folder's name.
    fn error(&self, name: &str, defines: &[(&str, &str)]) -> String {
        self.load(name, defines).unwrap_err().replace(&self.path(""), "DIR/")
    }
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.25\nf 1/1 2/1 3/1\n";

// ---------------------------------------------------------------- messages

#[test]
fn missing_scene_file() {
    let folder = Folder::new();
    assert_eq!(folder.error("none.xml", &[]), "DIR/none.xml: cannot find the file `DIR/none.xml`");
}

#[test]
fn missing_file() {
    let folder = Folder::new();
    let text = "<scene version=\"3.0.0\">\n  <shape type=\"obj\">\n    \
                <string name=\"filename\" value=\"models/tea.obj\"/>\n  </shape>\n</scene>";
    folder.put("s.xml", text);
    let expected = "DIR/s.xml:3:5: cannot find the file `models/tea.obj`; looked for `DIR/models/tea.obj`";
    assert_eq!(folder.error("s.xml", &[]), expected);
    folder.put("models/tee.obj", TRIANGLE);
    let expected = "DIR/s.xml:3:5: cannot find the file `models/tea.obj`; did you mean `models/tee.obj`?";
    assert_eq!(folder.error("s.xml", &[]), expected);
}

#[test]
fn malformed_numbers() {
    for (tag, message) in [
        ("<float name='fov' value='4o'/>", "1:64: `fov` must be a finite number, found `4o`"),
        ("<float name='fov' value=''/>", "1:64: `fov` must be a finite number, found ``"),
        ("<float name='fov' value='nan'/>", "1:64: `fov` must be a finite number, found `nan`"),
        ("<float name='fov' value='1e999'/>", "1:64: `fov` must be a finite number, found `1e999`"),
        ("<integer name='n' value='1.5'/>", "1:64: `n` must be an integer, found `1.5`"),
        ("<boolean name='b' value='1'/>", "1:64: `b` must be `true` or `false`, found `1`"),
        ("<rgb name='r' value='1 2'/>", "1:60: a colour has 1 or 3 numbers, found 2"),
        ("<rgb name='r' value='1 2 x'/>", "1:60: `r` must be finite numbers, found `x`"),
        (
            "<rgb name='r' value='#ff0000'/>",
            "1:60: `r` must be 1 or 3 numbers, found `#ff0000`; colours are linear; `#rrggbb` is not read",
        ),
        ("<point name='p' x='0' y='q' z='1'/>", "1:64: `y` must be a finite number, found `q`"),
        ("<point name='p' x='0' y='1'/>", "1:39: `<point>` needs the attribute `z`"),
        ("<vector name='p' value='1 2'/>", "1:63: expected 1 or 3 numbers, found 2"),
        ("<vector name='p' value='1' x='3'/>", "1:66: `x` and `value` cannot be given together"),
        (
            "<spectrum name='s' value='16 16 16'/>",
            "1:65: `s` must be one number or `wavelength:value` pairs, found `16`; use `<rgb>` for three values",
        ),
        ("<spectrum name='s' value='400:1'/>", "1:65: a spectrum has at least 2 wavelengths, found 1"),
        ("<spectrum name='s' value='500:1, 400:2'/>", "1:65: wavelengths must increase, found 400 after 500"),
        ("<spectrum name='s'/>", "1:39: `<spectrum>` needs the attribute `value` or `filename`"),
    ] {
        let tag = tag.replace('\'', "\"");
        let xml = scene(&format!("<bsdf type=\"x\">{tag}</bsdf>"));
        let column = 39;
        assert_eq!(xml[..column - 1].chars().last(), Some('>'), "the tag starts at column {column}");
        assert_eq!(error(&xml), format!("<string>:{message}"));
    }
}

#[test]
fn missing_closing_tags() {
    let open =
        "<scene version=\"3.0.0\">\n  <!-- <bsdf> -->\n  <bsdf type=\"a>b\">\n    <float/>\n</scene>\n";
    assert_eq!(
        error(open),
        "<string>:3:3: `<bsdf>` is not closed before `</scene>` on line 5; \
         add `</bsdf>` or end the tag with `/>`"
    );
    assert_eq!(
        error("<scene version=\"3.0.0\">\n<bsdf/>\n"),
        "<string>:1:1: `<scene>` is not closed before the end of the file; \
         add `</scene>` or end the tag with `/>`"
    );
    assert_eq!(
        error("<scene version=\"3.0.0\">\n<bsdf>\n</bsfd></scene>"),
        "<string>:3:1: expected `</bsdf>` for the tag of line 2, found `</bsfd>`"
    );
    assert_eq!(
        error("<!DOCTYPE x><scene/>"),
        "<string>:1:1: a document type definition (DTD) is not allowed here"
    );
    assert!(error("<scene version=3/>").starts_with("<string>:1:16: malformed XML: "));
    assert!(error("").starts_with("<string>:1:1: "));
}

#[test]
fn unknown_tags_and_attributes() {
    assert_eq!(
        error(&scene("\n <bdsf type=\"diffuse\"/>")),
        "<string>:2:2: unknown tag `<bdsf>`; did you mean `bsdf`?"
    );
    assert_eq!(
        error(&scene("<transform name=\"a\"><lookAt/></transform>")),
        "<string>:1:44: unknown tag `<lookAt>` inside `<transform>`; did you mean `lookat`?"
    );
    assert_eq!(
        error(&scene("<rotate angle=\"3\"/>")),
        "<string>:1:24: `<rotate>` can only stand inside `<transform>`"
    );
    assert_eq!(
        error(&scene("<float name=\"x\" valeu=\"3\"/>")),
        "<string>:1:40: `<float>` has no attribute `valeu`; did you mean `value`?"
    );
    assert_eq!(
        error(&scene("<float name=\"x\" value=\"3\"><float/></float>")),
        "<string>:1:50: `<float>` cannot stand inside `<float>`"
    );
    assert_eq!(error(&scene("<bsdf/>")), "<string>:1:24: `<bsdf>` needs the attribute `type`");
    assert_eq!(error(&scene("<float value=\"1\"/>")), "<string>:1:24: `<float>` needs the attribute `name`");
    assert_eq!(
        error("<scen/>"),
        "<string>:1:1: the root tag `<scen>` needs a version; for example `<scene version=\"3.0.0\">`"
    );
    assert_eq!(
        error("<scene version=\"x.1\"/>"),
        "<string>:1:17: `x.1` is not a version; for example `3.0.0`"
    );
    assert_eq!(
        error("<bsdf version=\"3.0.0\"/>"),
        "<string>:1:1: the file must start with `<scene>`, found `<bsdf>`; known: scene"
    );
}

#[test]
fn references() {
    assert_eq!(
        error(&scene("<bsdf type=\"a\" id=\"wood\"/>\n<shape type=\"s\"><ref id=\"woood\"/></shape>")),
        "<string>:2:17: no object has the id `woood`; did you mean `wood`?"
    );
    assert_eq!(error(&scene("<ref id=\"x\"/>")), "<string>:1:24: no object has the id `x`");
    assert_eq!(
        error(&scene("\n<bsdf type=\"a\" id=\"m\"/>\n<bsdf type=\"b\" id=\"m\"/>")),
        "<string>:3:20: the id `m` is taken already, by `<bsdf>` at <string>:2:1"
    );
    assert_eq!(
        error(&scene(
            "<bsdf type=\"a\" id=\"m\"><ref id=\"n\"/></bsdf><bsdf type=\"a\" id=\"n\"><ref id=\"m\"/></bsdf>"
        )),
        "<string>:1:24: the object refers to itself: m → n → m"
    );
    assert_eq!(
        error(&scene(
            "<bsdf type=\"a\"><float name=\"x\" value=\"1\"/>\n<rgb name=\"x\" value=\"1\"/></bsdf>"
        )),
        "<string>:2:1: `x` is given twice, first on line 1"
    );
    assert_eq!(
        error(&scene("<alias id=\"a\" as=\"b\"/>")),
        "<string>:1:35: no object before this has the id `a`"
    );
    let shared = read(&scene(
        "<shape type=\"s\"><ref name=\"skin\" id=\"n\"/></shape><bsdf type=\"a\" id=\"m\"/>\
         <alias id=\"m\" as=\"n\"/><shape type=\"t\"><ref id=\"m\"/></shape>",
    ));
    let bsdf = shared.objects.iter().position(|o| o.plugin == "a").unwrap() as u32;
    assert!(matches!(value(find(&shared, "s"), "skin"), Value::Object(id) if *id == bsdf));
    assert!(matches!(value(find(&shared, "t"), ""), Value::Object(id) if *id == bsdf));
}

/// Twenty-eight levels of two references each would unfold to 2²⁸ objects.
#[test]
fn unfolding_without_end() {
    let mut body = "<texture type=\"t\" id=\"t0\"/>".to_string();
    for i in 1..28 {
        let below = i - 1;
        body += &format!(
            "<texture type=\"t\" id=\"t{i}\"><ref name=\"a\" id=\"t{below}\"/><ref name=\"b\" id=\"t{below}\"/></texture>"
        );
    }
    assert!(error(&scene(&body)).ends_with("references unfold to too many objects here"));
    let deep = "<bsdf type=\"a\">".repeat(200) + &"</bsdf>".repeat(200);
    assert!(error(&scene(&deep)).ends_with("tags are nested more than 100 deep"));
}

#[test]
fn parameters() {
    let xml = scene(
        "<default name=\"a\" value=\"1\"/><default name=\"ab\" value=\"2\"/>\
                     <bsdf type=\"t\"><float name=\"x\" value=\"$ab$a\"/><string name=\"s\" value=\"\\$a-$a\"/></bsdf>",
    );
    let desc = read(&xml);
    assert!(matches!(value(find(&desc, "t"), "x"), Value::Float(v) if *v == 21.0));
    assert!(matches!(value(find(&desc, "t"), "s"), Value::String(v) if v == "$a-1"));
    let desc = load_str(&xml, Path::new(""), &options(&[("a", "7")])).unwrap();
    assert!(matches!(value(find(&desc, "t"), "x"), Value::Float(v) if *v == 27.0));

    let fails = |defines| load_str(&xml, Path::new(""), &options(defines)).unwrap_err().to_string();
    assert_eq!(
        fails(&[("abc", "7")]),
        "<string>: the define `abc` is not used by the scene; did you mean `ab`?"
    );
    assert_eq!(fails(&[("a", "7"), ("a", "8")]), "`a` is defined twice");
    assert_eq!(
        error(&scene("<default name=\"spp\" value=\"1\"/>\n<integer name=\"x\" value=\"$sp\"/>")),
        "<string>:2:26: the parameter `$sp` is not defined; did you mean `$spp`?"
    );
}

#[test]
fn addresses_are_refused() {
    assert_eq!(
        error(&scene("<shape type=\"ply\"><string name=\"filename\" value=\"https://a.b/c.ply\"/></shape>")),
        "<string>:1:42: `https://a.b/c.ply` is no file name; \
         only files on this machine are read, not `https:` addresses"
    );
    assert_eq!(
        error(&scene("<texture type=\"bitmap\"/>")),
        "<string>:1:24: texture `bitmap` needs a `filename`"
    );
    let folder = Folder::new();
    folder.put("sub/x", "");
    folder.put("s.xml", scene("<shape type=\"ply\"><string name=\"filename\" value=\"sub\"/></shape>"));
    assert_eq!(folder.error("s.xml", &[]), "DIR/s.xml:1:42: `DIR/sub` is not a regular file");
}

// ---------------------------------------------------------------- language

#[test]
fn values() {
    assert!(matches!(single("<float name=\"a\" value=\" 1e-3 \"/>"), Value::Float(v) if v == 1e-3));
    assert!(matches!(single("<integer name=\"a\" value=\"-3\"/>"), Value::Int(-3)));
    assert!(matches!(single("<boolean name=\"a\" value=\"True\"/>"), Value::Bool(true)));
    assert!(matches!(single("<string name=\"a\" value=\" x \"/>"), Value::String(s) if s == " x "));
    assert!(matches!(single("<rgb name=\"a\" value=\"0.5\"/>"), Value::Rgb([0.5, 0.5, 0.5])));
    assert!(matches!(single("<rgb name=\"a\" value=\"1, 2 ,3\"/>"), Value::Rgb([1.0, 2.0, 3.0])));
    assert!(matches!(single("<spectrum name=\"a\" value=\"0.25\"/>"), Value::Float(0.25)));
    let pairs = single("<spectrum name=\"a\" value=\"400:1, 500:2\"/>");
    assert!(matches!(pairs, Value::Spectrum(v) if v == [(400.0, 1.0), (500.0, 2.0)]));
    let v = DVec3::new(1.0, 2.0, 3.0);
    assert!(matches!(single("<point name=\"a\" x=\"1\" y=\"2\" z=\"3\"/>"), Value::Vector(p) if p == v));
    assert!(matches!(single("<vector name=\"a\" value=\"1 2 3\"/>"), Value::Vector(p) if p == v));
    assert!(matches!(single("<vector name=\"a\" value=\"2\"/>"), Value::Vector(p) if p == DVec3::splat(2.0)));
    let desc = read(&scene(
        "<bsdf type=\"t\"><spectrum type=\"uniform\" name=\"a\"><float name=\"value\" value=\"2\"/></spectrum></bsdf>",
    ));
    assert_eq!(find(&desc, "uniform").category, Category::Texture);
}

fn transform(body: &str) -> etendue::math::Transform {
    match single(&format!("<transform name=\"a\">{body}</transform>")) {
        Value::Transform(t) => t,
        other => panic!("{other:?}"),
    }
}

#[test]
fn transforms() {
    let close = |t: &etendue::math::Transform, p: [f64; 3], expected: [f64; 3]| {
        let mapped = t.point(DVec3::from(p));
        assert!(mapped.abs_diff_eq(DVec3::from(expected), 1e-5), "{mapped}");
        assert!(t.inverted().point(mapped).abs_diff_eq(DVec3::from(p), 1e-9));
    };
    close(&transform(""), [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]);
    let t = transform("<rotate z=\"1\" angle=\"90\"/><translate x=\"1\"/>");
    close(&t, [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]);
    let t = transform("<translate x=\"1\"/><rotate z=\"1\" angle=\"90\"/><scale value=\"2\"/>");
    close(&t, [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
    close(&transform("<scale y=\"3\"/>"), [1.0, 1.0, 1.0], [1.0, 3.0, 1.0]);
    let t = transform("<matrix value=\"1 2 3 4, 0 1 0 5, 0 0 1 6, 0 0 0 1\"/>");
    close(&t, [1.0, 1.0, 1.0], [10.0, 6.0, 7.0]);
    close(&transform("<matrix value=\"1 2 3 4 5 6 7 8 10\"/>"), [1.0, 0.0, 0.0], [1.0, 4.0, 7.0]);
    // Values of Mitsuba 3.9.1.
    let t = transform("<lookat origin=\"0,0,5\" target=\"1 2 3\" up=\"0 1 0\"/>");
    close(&t, [1.0, 0.0, 0.0], [-0.894427, 0.0, 5.0 - 0.447214]);
    close(&t, [0.0, 1.0, 0.0], [-0.298142, 0.745356, 5.596285]);
    let t = transform("<lookat origin=\"0,0,5\" target=\"1 2 3\"/>");
    close(&t, [1.0, 0.0, 0.0], [-0.133333, 0.733333, 5.666667]);
    close(&t, [0.0, 0.0, 1.0], [0.333333, 0.666667, 5.0 - 0.666667]);
}

#[test]
fn transform_errors_and_warnings() {
    for (body, message) in [
        ("<scale x=\"0\"/>", "a scale of 0 flattens the object: it cannot be undone"),
        ("<rotate angle=\"3\"/>", "a rotation needs an axis; for example `<rotate y=\"1\" angle=\"90\"/>`"),
        ("<rotate x=\"1\"/>", "`<rotate>` needs the attribute `angle`"),
        (
            "<lookat origin=\"0 0 0\" target=\"0 0 0\"/>",
            "`origin` and `target` of `<lookat>` are the same point",
        ),
        (
            "<lookat origin=\"0 0 0\" target=\"0 2 0\" up=\"0 1 0\"/>",
            "`up` of `<lookat>` points along the line of sight",
        ),
        ("<lookat origin=\"0 0\" target=\"0 2 0\"/>", "`origin` must be 3 numbers, found 2"),
        ("<matrix value=\"1 2 3\"/>", "a matrix has 16 or 9 numbers, row by row, found 3"),
        ("<matrix value=\"1 2 3 2 4 6 0 0 1\"/>", "the matrix is singular: it cannot be undone"),
    ] {
        let text = error(&scene(&format!("<transform name=\"a\">{body}</transform>")));
        let (_, found) = text.split_once(": ").unwrap();
        assert_eq!(found, message);
    }
    let desc = read(&scene("<transform name=\"a\"><rotate x=\"2\" angle=\"3\"/></transform>stray"));
    assert_eq!(
        desc.warnings,
        [
            "<string>:1:44: the rotation axis has length 2.000000: made 1 (Mitsuba 3 would distort the object)",
            "<string>:1:81: text between tags has no meaning",
        ]
    );
}

#[test]
fn includes() {
    let folder = Folder::new();
    folder.put("s.xml", scene("<default name=\"m\" value=\"red\"/>\n<include filename=\"parts/all.xml\"/>\n<bsdf type=\"two\"><include name=\"inner\" filename=\"parts/one.xml\"/></bsdf><shape type=\"s\"><ref id=\"red\"/></shape>"));
    folder.put("parts/all.xml", scene("<path value=\"../stock\"/><bsdf type=\"a\" id=\"$m\"/><shape type=\"obj\"><string name=\"filename\" value=\"t.obj\"/></shape>"));
    folder.put("parts/one.xml", "<bsdf version=\"3.0.0\" type=\"b\"/>");
    folder.put("stock/t.obj", TRIANGLE);
    let desc = folder.load("s.xml", &[]).unwrap();
    assert_eq!(desc.files.len(), 3);
    let root = desc.object(desc.root);
    assert_eq!(root.params.len(), 4);
    assert!(matches!(value(find(&desc, "two"), "inner"), Value::Object(_)));
    assert_eq!(desc.meshes.len(), 1);
    let pos = find(&desc, "a").pos;
    assert!(desc.files[pos.file as usize].ends_with("all.xml"));

    folder.put("loop.xml", scene("<include filename=\"loop2.xml\"/>"));
    folder.put("loop2.xml", scene("\n<include filename=\"loop.xml\"/>"));
    assert_eq!(folder.error("loop.xml", &[]), "DIR/loop2.xml:2:20: `DIR/loop.xml` includes itself");
    for i in 0..20 {
        folder.put(&format!("d{i}.xml"), scene(&format!("<include filename=\"d{}.xml\"/>", i + 1)));
    }
    assert_eq!(folder.error("d0.xml", &[]), "DIR/d14.xml:1:43: includes are nested more than 15 deep");
    folder.put("bad.xml", scene("<include filename=\"parts/twice.xml\"/>"));
    folder.put("parts/twice.xml", scene("<fload/>"));
    assert_eq!(
        folder.error("bad.xml", &[]),
        "DIR/parts/twice.xml:1:24: unknown tag `<fload>`; did you mean `float`?"
    );
    assert_eq!(
        folder.error("s.xml", &[("mm", "x")]),
        "DIR/s.xml: the define `mm` is not used by the scene; did you mean `m`?"
    );
}

#[test]
fn old_versions_are_spelled_anew() {
    let body = "<bsdf type=\"diffuse\"><rgb name=\"diffuseReflectance\" value=\"1\"/></bsdf>\
                <bsdf type=\"plastic\"><float name=\"intIOR\" value=\"2\"/></bsdf>\
                <texture type=\"checkerboard\"><float name=\"uscale\" value=\"3\"/><float name=\"voffset\" value=\"1\"/></texture>";
    let old = read(&format!("<scene version=\"0.5.0\">{body}</scene>"));
    value(find(&old, "diffuse"), "reflectance");
    value(find(&old, "plastic"), "int_ior");
    let Value::Transform(t) = value(find(&old, "checkerboard"), "to_uv") else { panic!() };
    assert_eq!(t.point(DVec3::new(1.0, 1.0, 0.0)), DVec3::new(3.0, 2.0, 0.0));
    assert_eq!(find(&old, "checkerboard").params.len(), 1);
    let new = read(&format!("<scene version=\"2.1\">{body}</scene>"));
    value(find(&new, "diffuse"), "diffuseReflectance");
}

#[test]
fn spectrum_files() {
    let folder = Folder::new();
    folder.put("s.xml", scene("<bsdf type=\"t\"><spectrum name=\"a\" filename=\"a.spd\"/></bsdf>"));
    folder.put("a.spd", "# c\n400 1\n\n500.5 2 # d\n");
    let desc = folder.load("s.xml", &[]).unwrap();
    assert!(matches!(value(find(&desc, "t"), "a"), Value::Spectrum(v) if v == &[(400.0, 1.0), (500.5, 2.0)]));
    folder.put("a.spd", "400 1\n500\n");
    assert_eq!(
        folder.error("s.xml", &[]),
        "DIR/s.xml:1:68: spectrum `DIR/a.spd`: line 2: expected a wavelength and a value"
    );
}

// ---------------------------------------------------------------- meshes

#[test]
fn meshes_are_attached_and_shared() {
    let folder = Folder::new();
    folder.put("m/t.obj", TRIANGLE);
    let shape = |name: &str, more: &str| {
        format!("<shape type=\"obj\"><string name=\"filename\" value=\"{name}\"/>{more}</shape>")
    };
    let flip =
        "<boolean name=\"flip_tex_coords\" value=\"false\"/><boolean name=\"face_normals\" value=\"true\"/>";
    let body = [shape("m/t.obj", ""), shape("m/../m/t.obj", ""), shape("m/t.obj", flip)].concat();
    folder.put("s.xml", scene(&body));
    let desc = folder.load("s.xml", &[]).unwrap();
    assert_eq!(desc.meshes.len(), 2);
    assert_eq!(desc.meshes[0].uvs[0], Vec2::new(0.0, 0.75));
    assert_eq!(desc.meshes[1].uvs[0], Vec2::new(0.0, 0.25));
    let mut meshes = Vec::new();
    for object in desc.objects.iter().filter(|o| o.plugin == "obj") {
        assert!(object.params.iter().all(|p| ["mesh", "face_normals"].contains(&p.name.as_str())));
        let Value::Mesh(i) = value(object, "mesh") else { panic!() };
        meshes.push(*i);
    }
    assert_eq!(meshes, [0, 0, 1]);

    folder.put("m/t.obj", "v 0 0 0\nf 1 1 2\n");
    assert_eq!(
        folder.error("s.xml", &[]),
        "DIR/s.xml:1:42: mesh `DIR/m/t.obj`, line 2: face 1: vertex 2 is out of range, there are 1"
    );
}

#[test]
fn ply() {
    let folder = Folder::new();
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                  property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
                  property float u\nproperty float v\nelement face 1\n\
                  property list uchar int vertex_index\nend_header\n";
    let good = "0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n3 0 1 2\n";
    let path = folder.put("a.ply", format!("{header}{good}"));
    let mesh = read_mesh(&path).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    assert_eq!(mesh.uvs[2], Vec2::new(0.0, 1.0));
    let path =
        folder.put("a.ply", format!("{header}{}", good.replace("1 0 0 0 0 1 1 0", "1 inf 0 0 0 1 1 0")));
    let message = read_mesh(&path).unwrap_err().to_string().replace(&folder.path(""), "DIR/");
    assert_eq!(message, "DIR/a.ply: mesh `DIR/a.ply`: vertex 1: `y` is not finite");
}

/// A lying header costs neither time nor memory.
#[test]
fn lying_ply_header() {
    let folder = Folder::new();
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n\
                  property float y\nproperty float z\nelement face 1\n\
                  property list uchar int vertex_indices\nend_header\n";
    let path = folder.put("a.ply", header);
    let message = read_mesh(&path).unwrap_err().message.replace(&folder.path(""), "DIR/");
    assert_eq!(
        message,
        "mesh `DIR/a.ply`: the header promises 4000000000 of `vertex`, but only 0 bytes follow"
    );
}

/// One shape of a serialized file: version 4 with a name, or version 3.
fn serialized_shape(version: u16, flags: u32, last_index: u32) -> Vec<u8> {
    let mut data = flags.to_le_bytes().to_vec();
    if version == 4 {
        data.extend(b"name\0");
    }
    data.extend(3u64.to_le_bytes());
    data.extend(1u64.to_le_bytes());
    let mut floats = |values: &[f64]| {
        for v in values {
            if flags & 0x2000 != 0 {
                data.extend(v.to_le_bytes());
            } else {
                data.extend((*v as f32).to_le_bytes());
            }
        }
    };
    floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5]);
    if flags & 1 != 0 {
        floats(&[0.0, 0.0, 1.0].repeat(3));
    }
    if flags & 2 != 0 {
        floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.75]);
    }
    if flags & 8 != 0 {
        floats(&[0.5; 9]);
    }
    for index in [0, 1, last_index] {
        data.extend(index.to_le_bytes());
    }
    let mut out = 0x041cu16.to_le_bytes().to_vec();
    out.extend(version.to_le_bytes());
    let mut encoder = flate2::write::ZlibEncoder::new(out, flate2::Compression::default());
    encoder.write_all(&data).unwrap();
    encoder.finish().unwrap()
}

fn serialized_file(version: u16, shapes: &[Vec<u8>]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut table = Vec::new();
    for shape in shapes {
        if version == 4 {
            table.extend((out.len() as u64).to_le_bytes());
        } else {
            table.extend((out.len() as u32).to_le_bytes());
        }
        out.extend(shape);
    }
    out.extend(table);
    out.extend((shapes.len() as u32).to_le_bytes());
    out
}

#[test]
fn serialized() {
    let folder = Folder::new();
    let shape = |index: i32| {
        scene(&format!(
            "<shape type=\"serialized\"><string name=\"filename\" value=\"a.serialized\"/>\
             <integer name=\"shape_index\" value=\"{index}\"/></shape>"
        ))
    };
    for version in [3, 4] {
        let shapes = [
            serialized_shape(version, 0x1000, 2),
            serialized_shape(version, 0x200b, 2),
            serialized_shape(version, 0x1012, 2),
            serialized_shape(version, 0x1000, 3),
        ];
        folder.put("a.serialized", serialized_file(version, &shapes));
        for index in 0..3 {
            folder.put("s.xml", shape(index));
            let desc = folder.load("s.xml", &[]).unwrap();
            let mesh = &desc.meshes[0];
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
            assert_eq!(mesh.positions[2], Vec3::new(0.0, 1.0, 0.5));
            assert_eq!(mesh.normals.len(), if index == 1 { 3 } else { 0 });
            assert_eq!(mesh.uvs.len(), if index == 0 { 0 } else { 3 });
            assert_eq!(desc.warnings.len(), usize::from(index == 2));
        }
        folder.put("s.xml", shape(3));
        assert_eq!(
            folder.error("s.xml", &[]),
            "DIR/s.xml:1:49: mesh `DIR/a.serialized`, shape 3: face 0: vertex 3 is out of range, there are 3"
        );
        folder.put("s.xml", shape(4));
        assert_eq!(
            folder.error("s.xml", &[]),
            "DIR/s.xml:1:49: mesh `DIR/a.serialized`, shape 4: `shape_index` is out of range, there are 4"
        );
        folder.put("s.xml", shape(-1));
        assert_eq!(
            folder.error("s.xml", &[]),
            "DIR/s.xml:1:95: `shape_index` must not be negative, found -1"
        );
    }
}

/// Damaged files are errors or other meshes, never a panic.
#[test]
fn damaged_files() {
    let folder = Folder::new();
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
               property float z\nproperty list uchar short w\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n";
    let mut ply = ply.as_bytes().to_vec();
    for value in [0f32, 1.0, 2.0] {
        (0..3).for_each(|_| ply.extend(value.to_le_bytes()));
        ply.extend([1, 7, 0]);
    }
    ply.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    let serialized = serialized_file(4, &[serialized_shape(4, 0x1003, 2), serialized_shape(4, 0x2000, 2)]);
    let xml =
        scene("<bsdf type=\"a\" id=\"$m\"><rgb name=\"x\" value=\"1 2 3\"/><!-- c --></bsdf><ref id=\"b\"/>");
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut read = 0;
    for (name, bytes) in [
        ("a.obj", TRIANGLE.as_bytes()),
        ("a.ply", &ply),
        ("a.serialized", &serialized),
        ("a.xml", xml.as_bytes()),
    ] {
        for _ in 0..120 {
            let mut damaged = bytes.to_vec();
            for _ in 0..=random(3) {
                let at = random(damaged.len());
                damaged[at] = random(256) as u8;
            }
            damaged.truncate(bytes.len() - random(8) * random(4));
            let path = folder.put(name, &damaged);
            let is_read = match name {
                "a.xml" => load(&path, &options(&[("m", "1")])).is_ok(),
                _ => read_mesh(&path).is_ok_and(|m| {
                    m.positions.iter().all(|p| p.is_finite())
                        && m.triangles.iter().flatten().all(|i| (*i as usize) < m.positions.len())
                }),
            };
            read += usize::from(is_read);
        }
    }
    assert!(read > 10 && read < 400, "{read}");
}

// ---------------------------------------------------------------- images

fn bitmap(folder: &Folder, name: &str) -> Result<std::sync::Arc<etendue::desc::Image>, String> {
    let xml = format!("<texture type=\"bitmap\"><string name=\"filename\" value=\"{name}\"/></texture>");
    folder.put("s.xml", scene(&xml));
    let desc = folder.load("s.xml", &[]).map_err(|e| e.replace(&folder.path(""), "DIR/"))?;
    let texture = find(&desc, "bitmap");
    assert!(matches!(value(texture, "filename"), Value::String(s) if s == name));
    let Value::Image(i) = value(texture, "image") else { panic!() };
    Ok(desc.images[*i as usize].clone())
}

#[test]
fn eight_and_sixteen_bits() {
    let folder = Folder::new();
    let path = |name: &str| PathBuf::from(folder.path(name));
    let rgb = image::RgbImage::from_fn(2, 2, |x, y| image::Rgb([x as u8, 10 + y as u8, 255]));
    for name in ["a.png", "a.bmp", "a.tga"] {
        rgb.save(path(name)).unwrap();
        let read = bitmap(&folder, name).unwrap();
        assert_eq!((read.width, read.height, read.channels), (2, 2, 3), "{name}");
        assert!(
            matches!(&read.pixels, Pixels::U8(v) if v[..] == [0, 10, 255, 1, 10, 255, 0, 11, 255, 1, 11, 255])
        );
    }
    image::ImageBuffer::from_fn(1, 1, |_, _| image::LumaA([40_000u16, 7])).save(path("b.png")).unwrap();
    let read = bitmap(&folder, "b.png").unwrap();
    assert!(matches!(&read.pixels, Pixels::U16(v) if v[..] == [40_000, 7]) && read.channels == 2);
    image::GrayImage::from_pixel(8, 8, image::Luma([100])).save(path("c.jpg")).unwrap();
    let read = bitmap(&folder, "c.jpg").unwrap();
    assert!(matches!(&read.pixels, Pixels::U8(v) if v.iter().all(|p| *p == 100)) && read.channels == 1);
    folder.put("d.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x81\xff\x01\x00\x88");
    let read = bitmap(&folder, "d.hdr").unwrap();
    let halves = |v: &[half::f16]| v.iter().map(|x| x.to_f32()).collect::<Vec<_>>();
    assert!(matches!(&read.pixels, Pixels::F16(v) if halves(v) == [1.0, 0.5, 0.25, 255.0, 1.0, 0.0]));
    folder.put("e.png", "no image");
    assert_eq!(
        bitmap(&folder, "e.png").unwrap_err(),
        "DIR/s.xml:1:47: image `DIR/e.png`: no image format that is known; known: EXR, HDR, PNG, JPEG, WebP, TGA, BMP"
    );
}

/// What stands in the file and is not seen is not decoded; but it has to be there.
#[test]
fn images_that_nothing_shows_are_not_read() {
    let folder = Folder::new();
    image::GrayImage::from_pixel(8, 8, image::Luma([100])).save(folder.path("a.png")).unwrap();
    folder.put("b.png", "no image");
    let material = |id: &str, file: &str| {
        format!(
            r#"<bsdf type="mask" id="{id}"><texture name="opacity" type="bitmap"><string name="channel" value="a"/>
            <string name="filename" value="{file}"/></texture><bsdf type="diffuse"><texture name="reflectance"
            type="bitmap"><string name="filename" value="{file}"/></texture></bsdf></bsdf>"#
        )
    };
    let seen = r#"<bsdf type="diffuse" id="seen"><texture name="reflectance" type="bitmap">
        <string name="filename" value="a.png"/></texture></bsdf>
        <shape type="sphere"><ref id="seen"/></shape><sensor type="perspective"/>"#;
    folder.put("s.xml", scene(&(material("unseen", "b.png") + seen)));
    let desc = folder.load("s.xml", &[]).unwrap();
    assert_eq!((desc.images.len(), desc.unread_images), (2, 1));
    let built = etendue::scene::Scene::build(&desc, &etendue::scene::BuildOptions::default()).unwrap();
    assert_eq!(built.plan.texture_bytes, 64);
    assert!(built.plan.to_string().contains("images: 1 that nothing shows; not read"), "{}", built.plan);
    folder.put("s.xml", scene(&(material("unseen", "c.png") + seen)));
    assert!(folder.load("s.xml", &[]).unwrap_err().contains("cannot find the file `c.png`"));
    let used = seen.replace("seen\"/></shape>", "unseen\"/></shape>");
    folder.put("s.xml", scene(&(material("unseen", "b.png") + &used)));
    assert!(folder.load("s.xml", &[]).unwrap_err().contains("no image format that is known"));
}

fn exr_file(path: &Path, layers: &[(&str, &[(&str, f32)])]) {
    use exr::prelude::*;
    let layer = |(name, channels): &(&str, &[(&str, f32)])| {
        let list = channels
            .iter()
            .map(|(n, v)| AnyChannel::new(*n, FlatSamples::F32(vec![*v, v + 100.0])))
            .collect();
        Layer::new((2, 1), LayerAttributes::named(*name), Encoding::FAST_LOSSLESS, AnyChannels::sort(list))
    };
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions((2, 1)));
    attributes.other.insert("etendue/seed".into(), AttributeValue::Text("7".into()));
    let layers: SmallVec<[_; 2]> = layers.iter().map(layer).collect();
    let image = Image { attributes, layer_data: layers };
    image.write().to_file(path).unwrap();
}

#[test]
fn exr_channels() {
    let folder = Folder::new();
    let path = PathBuf::from(folder.path("a.exr"));
    let check = |layers: &[(&str, &[(&str, f32)])], expected: Result<&[f32], &str>| {
        exr_file(&path, layers);
        match (bitmap(&folder, "a.exr"), expected) {
            (Ok(image), Ok(first)) => {
                assert_eq!((image.width, image.height, image.channels as usize), (2, 1, first.len()));
                let v: Vec<f32> = match &image.pixels {
                    Pixels::F16(v) => v.iter().map(|x| x.to_f32()).collect(),
                    Pixels::F32(v) => v.clone(),
                    _ => panic!(),
                };
                assert_eq!(v[..first.len()], *first);
                assert_eq!(v[first.len()], first[0] + 100.0);
            }
            (Err(found), Err(message)) => {
                assert_eq!(found, format!("DIR/s.xml:1:47: image `DIR/a.exr`: {message}"));
            }
            (found, expected) => panic!("{found:?}, expected {expected:?}"),
        }
    };
    let rgb = [("B", 3.0), ("G", 2.0), ("R", 1.0), ("Z", 9.0)];
    check(&[("", &rgb)], Ok(&[1.0, 2.0, 3.0]));
    check(&[("", &[("R", 1.0), ("G", 2.0), ("B", 3.0), ("A", 0.5)])], Ok(&[1.0, 2.0, 3.0, 0.5]));
    check(&[("", &[("Y", 4.0)])], Ok(&[4.0]));
    check(&[("", &[("Y", 4.0), ("A", 1.0)])], Ok(&[4.0, 1.0]));
    check(&[("", &[("depth", 4.0)])], Ok(&[4.0]));
    let beauty = [("beauty.R", 1.0), ("beauty.G", 2.0), ("beauty.B", 3.0), ("Z", 9.0)];
    check(&[("", &beauty)], Ok(&[1.0, 2.0, 3.0]));
    check(&[("a", &rgb), ("b", &[("Z", 1.0)])], Ok(&[1.0, 2.0, 3.0]));
    check(
        &[("", &[("P", 1.0), ("Q", 2.0)])],
        Err("no single layer with R, G, B or Y among its channels P, Q"),
    );
    check(
        &[("", &[("Y", 4.0), ("RY", 1.0), ("BY", 1.0)])],
        Err("luminance and chroma channels are not read"),
    );
}

#[test]
fn pictures() {
    let folder = Folder::new();
    let path = PathBuf::from(folder.path("a.exr"));
    exr_file(&path, &[("", &[("R", 1.0), ("N.X", 2.0), ("error.G", 3.0)])]);
    let picture = read_picture(&path).unwrap();
    assert_eq!((picture.width, picture.height, picture.origin), (2, 1, [0, 0]));
    let mut names: Vec<&str> = picture.channels.iter().map(|(n, _)| n.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["N.X", "R", "error.G"]);
    assert_eq!(picture.channel("error.G").unwrap(), [3.0, 103.0]);
    assert!(picture.attributes.contains(&("etendue/seed".into(), "7".into())));
    exr_file(&path, &[("a", &[("R", 1.0)]), ("b", &[("R", 2.0), ("b.G", 3.0)])]);
    let picture = read_picture(&path).unwrap();
    assert_eq!(picture.channel("a.R").unwrap()[0], 1.0);
    assert_eq!(picture.channel("b.R").unwrap()[0], 2.0);
    assert_eq!(picture.channel("b.G").unwrap()[0], 3.0);

    let png = folder.path("a.png");
    image::RgbaImage::from_pixel(1, 1, image::Rgba([0, 128, 255, 51])).save(&png).unwrap();
    let picture = read_picture(Path::new(&png)).unwrap();
    let pixel: Vec<f32> = picture.channels.iter().map(|(_, v)| v[0]).collect();
    assert_eq!(picture.channels[3].0, "A");
    for (found, expected) in pixel.into_iter().zip([0.0, 0.215_860_5, 1.0, 0.2]) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
    assert_eq!(
        read_picture(Path::new("none.png")).unwrap_err().to_string(),
        "none.png: cannot find the file `none.png`"
    );
}

/// A header of 2³² pixels is refused before anything is decoded.
#[test]
fn image_size_cap() {
    let folder = Folder::new();
    let path = PathBuf::from(folder.path("a.exr"));
    exr_file(&path, &[("", &[("Y", 1.0)])]);
    let mut bytes = fs::read(&path).unwrap();
    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        bytes[at + 8..at + 12].copy_from_slice(&65_535i32.to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&65_535i32.to_le_bytes());
    }
    fs::write(&path, bytes).unwrap();
    let message = bitmap(&folder, "a.exr").unwrap_err();
    assert_eq!(
        message,
        "DIR/s.xml:1:47: image `DIR/a.exr`: 65536 × 65536 pixels with 1 channels take more than the \
         4294967296 bytes allowed by `max_image_bytes`"
    );
}

// ---------------------------------------------------------------- real scenes

/// Where the scenes of others are, if they are at hand.
fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let dir = std::env::var_os("ETENDUE_SHARED").map_or(beside, PathBuf::from).join("scenes");
    dir.is_dir().then_some(dir)
}

/// Meshes and triangles (shared files once) as Mitsuba 3.9.1 counts them.
#[test]
fn scenes_of_others() {
    let Some(dir) = shared() else { return };
    let mut loaded = 0;
    for (name, meshes, triangles) in [
        ("cornell-box", 0, 0),
        ("veach-mis", 0, 0),
        ("veach-bidir", 12, 11_540),
        ("veach-ajar", 17, 130_592),
        ("teapot-env", 2, 126_048),
        ("teapot-dof", 2, 126_048),
        ("water-caustic", 10, 103_487),
        ("glass-of-water", 16, 150_594),
        ("staircase2", 19, 30_911),
        ("classroom", 79, 103_832),
    ] {
        let path = dir.join(name).join("scene.xml");
        if !path.is_file() {
            continue;
        }
        let desc = load(&path, &options(&[])).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(desc.meshes.len(), meshes, "{name}");
        let found: usize = desc.meshes.iter().map(|m| m.triangles.len()).sum();
        assert_eq!(found, triangles, "{name}");
        assert!(desc.warnings.is_empty(), "{name}: {:?}", desc.warnings);
        loaded += 1;
    }
    assert!(loaded > 0);
}

/// Scenes of Mitsuba's own tests, except the fragments that they include.
#[test]
fn scenes_of_mitsuba() {
    let Some(dir) = shared() else { return };
    let mut loaded = 0;
    let Ok(folders) = fs::read_dir(dir.join("mitsuba-tests/tests/scenes")) else { return };
    for folder in folders.map(|f| f.unwrap().path()).filter(|p| p.is_dir()) {
        for path in fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()) {
            if path.extension().is_some_and(|e| e == "xml") {
                load(&path, &options(&[])).unwrap_or_else(|e| panic!("{e}"));
                loaded += 1;
            }
        }
    }
    assert!(loaded > 0);
}
