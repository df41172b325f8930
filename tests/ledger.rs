//! The ledger of bad samples, through the program: scenes whose numbers really
//! overflow, what is said of them, and that the command it prints shows the
//! very path.

use std::path::Path;
use std::process::{Command, Output};

use etendue::film::{Channel, Rect};
use etendue::load::{Picture, read_picture};
use etendue::save::{Header, Options, write_exr};

/// Runs a command line of a shell in a folder, with the program on its path.
fn shell(folder: &Path, line: &str) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_etendue")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    Command::new("bash").args(["-c", line]).current_dir(folder).env("PATH", path).output().expect("a shell")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A fresh folder with a scene of that body.
fn scene(name: &str, camera: &str, body: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let xml = format!(
        r#"<scene version="3.0.0"><default name="glow" value="3e38"/><default name="depth" value="-1"/>
<integrator type="path"><integer name="max_depth" value="$depth"/></integrator>
{camera}
<film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/><rfilter type="box"/></film></sensor>
{body}</scene>"#
    );
    std::fs::write(folder.path().join(name), xml).expect("a scene file");
    folder
}

const CAMERA: &str = r#"<sensor type="perspective"><transform name="to_world"><lookat origin="0,2,4" target="0,0,0" up="0,1,0"/></transform>"#;

/// A white floor under a sky so bright that the sum of a path's two estimates
/// of it is beyond f32 now and then: infinite by addition.
const BRIGHT: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.9"/></bsdf></shape>
<shape type="sphere"><point name="center" x="0" y="0.5" z="0"/><float name="radius" value="0.5"/>
<bsdf type="diffuse"><rgb name="reflectance" value="0.99"/></bsdf></shape>
<emitter type="constant"><rgb name="radiance" value="$glow"/></emitter>"#;

/// A lamp whose light is beyond f32 within its last metre, over a floor
/// without green: infinity times zero.
const LAMP: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5,0,0.5"/></bsdf></shape>
<emitter type="point"><rgb name="intensity" value="$glow"/><point name="position" x="0" y="0.4" z="0"/></emitter>"#;

/// Mirrors that make light of nothing, face to face: infinite by products.
const MIRRORS: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="9"/><translate z="-1"/></transform><ref id="mirror"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate y="1" angle="180"/><translate z="6"/></transform><ref id="mirror"/></shape>
<bsdf type="conductor" id="mirror"><texture type="bitmap" name="specular_reflectance"><string name="filename" value="loud.exr"/>
<boolean name="raw" value="true"/></texture></bsdf>
<emitter type="constant"/>"#;

/// The texture of [`MIRRORS`].
fn loud(folder: &Path) {
    let channel = |name: &str| Channel { name: name.to_owned(), data: vec![1e20; 4] };
    let picture = etendue::film::Picture {
        size: [2, 2],
        window: Rect::new(0, 0, 2, 2),
        channels: ["R", "G", "B"].map(channel).to_vec(),
    };
    let path = folder.join("loud.exr");
    write_exr(&path, &picture, &Header::default(), Options::default()).expect("written");
}

/// A lamp so near to a floor so wide that its light there is beyond what sums
/// in units of the scene hold, and yet an f32.
const NEAR: &str = r#"<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="1e4"/></transform></shape>
<emitter type="point"><rgb name="intensity" value="1"/><point name="position" x="0" y="1e-5" z="0"/></emitter>"#;
const NEAR_CAMERA: &str = r#"<sensor type="orthographic"><transform name="to_world"><lookat origin="0,5e-6,0" target="0,0,0" up="0,0,1"/><scale value="2e-5"/></transform><float name="near_clip" value="1e-8"/>"#;

/// Replay lines of a render's messages.
fn replays(stderr: &str) -> Vec<String> {
    let lines = stderr.lines().filter(|l| l.contains(": etendue replay "));
    lines.filter_map(|l| Some(l[l.find("etendue replay ")?..].to_owned())).collect()
}

fn stats(folder: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(folder.join("s.json")).expect("statistics");
    serde_json::from_str(&text).expect("JSON")
}

fn attribute(picture: &Picture, name: &str) -> String {
    let found = picture.attributes.iter().find(|(key, _)| key == name);
    found.unwrap_or_else(|| panic!("no {name}")).1.clone()
}

/// Renders with bad samples of that cause, and checks everything said of them.
fn check(folder: &Path, cause: &str) {
    let mut before: Option<(serde_json::Value, Vec<u8>)> = None;
    for threads in [1, 2, 5] {
        let line = format!(
            "etendue render scene.xml -o a.exr --spp 16 --aov bad --stats s.json --threads {threads} --strict"
        );
        let output = shell(folder, &line);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        let bad = stats(folder)["bad_samples"].clone();
        let total = bad["total"].as_u64().expect("a count");
        assert!(total > 10 && bad[cause.to_lowercase()] == total, "{bad}");
        assert!(said.contains(&format!("warning: samples left out: {total} (")), "{said}");
        assert!(said.contains("the first 10 of them"), "{said}");

        // The file: counts, places, and the pixels marked.
        let picture = read_picture(&folder.join("a.exr")).expect("a picture");
        assert!(attribute(&picture, "etendue/badSamples").contains(&format!("{cause} {total}")));
        let places = attribute(&picture, "etendue/badSamplesFirst");
        assert_eq!(places.lines().count(), 10);
        let marks = picture.channel("bad").expect("a layer");
        assert_eq!(marks.iter().map(|v| f64::from(*v)).sum::<f64>(), total as f64);
        for (line, first) in places.lines().zip(bad["first"].as_array().expect("a list")) {
            let (x, y) = (first["x"].as_u64().expect("x"), first["y"].as_u64().expect("y"));
            assert_eq!(line, format!("{x},{y} sample {}: {cause}", first["sample"]));
            assert_eq!(first["cause"], cause.to_lowercase());
            assert!(marks[(y * u64::from(picture.width) + x) as usize] > 0.0);
        }
        for (name, data) in &picture.channels {
            let finite = name.starts_with("error") || data.iter().all(|v| v.is_finite());
            assert!(finite && data.iter().all(|v| !v.is_nan()), "{name}");
        }

        // The same for any number of threads.
        let file = std::fs::read(folder.join("a.exr")).expect("bytes");
        let (first, bytes) = before.get_or_insert_with(|| (bad.clone(), file.clone()));
        assert!(*first == bad && *bytes == file, "{threads} threads");

        // Every line printed shows a path with that end.
        let lines = replays(&said);
        assert_eq!(lines.len(), 10, "{said}");
        for line in if threads == 1 { &lines[..] } else { &lines[..1] } {
            let shown = shell(folder, line);
            let shown = text(&shown.stdout);
            let wanted = if cause == "NaN" { "not a number" } else { cause };
            assert!(shown.contains(&format!("left out of the picture: {wanted}")), "{line}\n{shown}");
        }
    }
    // Without --strict it is a warning, however quiet.
    let output = shell(folder, "etendue render scene.xml -o a.exr --spp 16 -q");
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stderr).starts_with("warning: samples left out: "));
}

#[test]
fn infinite_by_addition() {
    check(scene("scene.xml", CAMERA, BRIGHT).path(), "infinite");
}

#[test]
fn infinite_by_products() {
    let folder = scene("scene.xml", CAMERA, MIRRORS);
    loud(folder.path());
    check(folder.path(), "infinite");
}

#[test]
fn not_a_number() {
    check(scene("scene.xml", CAMERA, LAMP).path(), "NaN");
}

#[test]
fn beyond_the_sums() {
    check(scene("scene.xml", NEAR_CAMERA, NEAR).path(), "overflow");
}

/// A scene, a folder and values that a shell would take apart, and options
/// each of which moves or changes the path.
#[test]
fn the_line_is_complete() {
    let folder = scene("it's $HOME.xml", CAMERA, BRIGHT);
    let file = folder.path().join("it's $HOME.xml");
    let xml = std::fs::read_to_string(&file).expect("a scene");
    std::fs::write(&file, xml.replace("3e38", "1")).expect("written");
    let all = "-D glow=3.1e38 -D depth=7 --size 20x15 --crop 4,3,9,10 --integrator path --max-depth 5 \
               --accel bvh8 --bvh fast --camera 0 --frame 2 --fps 30 --shutter=-0.25,0.5 --lenient \
               --seed 1234567890123 --sampler lattice --replicas 5 --reuse 4";
    let name = r"'it'\''s $HOME.xml'";
    let output = shell(folder.path(), &format!("etendue render {name} -o a.exr --spp 40 --aov bad {all}"));
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let lines = replays(&said);
    assert_eq!(lines.len(), 10, "{said}");
    for line in &lines {
        let shown = text(&shell(folder.path(), line).stdout);
        assert!(shown.contains("left out of the picture: infinite"), "{line}\n{shown}");
        assert!(shown.contains("radiance inf inf inf"), "{shown}");
    }
    // Each option counts: without it most of these samples are other ones.
    for option in
        ["--seed 1234567890123", "--sampler lattice", "--replicas 5", "--size 20x15", "-D glow=3.1e38"]
    {
        assert!(lines.iter().all(|line| line.contains(option)), "{option}: {}", lines[0]);
        let bad = lines.iter().filter(|line| {
            let other = text(&shell(folder.path(), &line.replace(option, "")).stdout);
            other.contains("left out of the picture")
        });
        assert!(bad.count() < 8, "{option} changes nothing");
    }
}

/// Samples of the border are located outside the film, and can be replayed.
#[test]
fn the_border_is_replayed_too() {
    let folder = scene("scene.xml", CAMERA, MIRRORS);
    loud(folder.path());
    let file = folder.path().join("scene.xml");
    let xml = std::fs::read_to_string(&file).expect("a scene");
    let border = r#"<boolean name="sample_border" value="true"/><rfilter type="gaussian"/>"#;
    std::fs::write(&file, xml.replace(r#"<rfilter type="box"/>"#, border)).expect("written");
    let said = text(&shell(folder.path(), "etendue render scene.xml -o a.exr --spp 16 -q").stderr);
    let lines = replays(&said);
    let outside: Vec<&String> = lines.iter().filter(|l| l.contains(" -- scene.xml -")).collect();
    assert!(!outside.is_empty(), "{said}");
    for line in outside {
        let shown = text(&shell(folder.path(), line).stdout);
        assert!(shown.contains("left out of the picture: infinite"), "{line}\n{shown}");
    }
    let far = shell(folder.path(), "etendue replay -- scene.xml -9,0");
    assert_eq!(text(&far.stderr).trim_end(), "error: pixel -9,0 is outside the film of 12 × 8");
}

#[test]
fn a_study_notes_them() {
    let folder = scene("scene.xml", CAMERA, BRIGHT);
    let output = shell(folder.path(), "etendue study scene.xml -o study --spp 4..8 --repeats 3 --json -q");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("samples left out: "), "{said}");
    let study: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let notes = study["notes"].to_string();
    assert!(notes.contains("samples were no radiance and were left out (infinite "), "{notes}");
    let run = notes.split("see the header of ").nth(1).and_then(|n| n.split(')').next()).expect("a run");
    let picture = read_picture(&folder.path().join("study").join(run)).expect("a picture");
    assert!(attribute(&picture, "etendue/badSamplesFirst").contains(": infinite"));
}

/// A clean render says nothing, and its layer is empty.
#[test]
fn nothing_to_tell() {
    let folder = scene("scene.xml", CAMERA, BRIGHT);
    let line = "etendue render scene.xml -o a.exr --spp 4 --aov bad -D glow=1 --strict -q";
    let output = shell(folder.path(), line);
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let picture = read_picture(&folder.path().join("a.exr")).expect("a picture");
    assert!(picture.channel("bad").is_some_and(|c| c.iter().all(|v| *v == 0.0)));
    assert_eq!(
        attribute(&picture, "etendue/badSamples"),
        "0 (NaN 0, infinite 0, negative 0, layer 0, overflow 0)"
    );
    assert!(picture.attributes.iter().all(|(name, _)| name != "etendue/badSamplesFirst"));
}
