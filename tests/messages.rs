//! What a user reads when a scene is wrong: exact messages, and the exit code
//! of the program.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs the program in a fresh folder that holds `scene.xml`.
fn etendue(xml: &str, args: &[&str]) -> (Output, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scene.xml"), xml).expect("a scene file");
    let output = Command::new(env!("CARGO_BIN_EXE_etendue"))
        .args(args)
        .current_dir(folder.path())
        .output()
        .expect("the program runs");
    (output, folder)
}

fn error_of(body: &str) -> String {
    let xml = format!(
        "<scene version=\"3.0.0\">\n<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/>\
         <integer name=\"height\" value=\"8\"/></film></sensor>\n{body}\n</scene>\n"
    );
    let (output, folder) = etendue(&xml, &["render", "scene.xml", "-o", "out.exr", "--spp", "1"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(output.stdout.is_empty());
    assert!(!folder.path().join("out.exr").exists());
    String::from_utf8(output.stderr).expect("text").trim_end().to_owned()
}

#[test]
fn an_unknown_plugin() {
    assert_eq!(
        error_of("<shape type=\"sphere\">\n  <bsdf type=\"difuse\"/>\n</shape>"),
        "error: scene.xml:4:3: unknown bsdf `difuse`; did you mean `diffuse`?"
    );
    assert_eq!(
        error_of("<shape type=\"spere\"/>"),
        "error: scene.xml:3:1: unknown shape `spere`; did you mean `sphere`?"
    );
}

#[test]
fn an_unknown_parameter() {
    assert_eq!(
        error_of("<shape type=\"sphere\">\n  <float name=\"radus\" value=\"2\"/>\n</shape>"),
        "error: scene.xml:4:3: shape `sphere` takes no parameter `radus`; did you mean `radius`?"
    );
}

#[test]
fn a_missing_file() {
    assert_eq!(
        error_of("<shape type=\"obj\">\n  <string name=\"filename\" value=\"nothing.obj\"/>\n</shape>"),
        "error: scene.xml:4:3: cannot find the file `nothing.obj`; looked for `nothing.obj`"
    );
}

#[test]
fn a_malformed_number() {
    assert_eq!(
        error_of("<shape type=\"sphere\">\n  <float name=\"radius\" value=\"1.x\"/>\n</shape>"),
        "error: scene.xml:4:31: `radius` must be a finite number, found `1.x`"
    );
}

#[test]
fn a_missing_closing_tag() {
    assert_eq!(
        error_of("<shape type=\"sphere\">\n"),
        "error: scene.xml:3:1: `<shape>` is not closed before `</scene>` on line 5; add `</shape>` or end the tag with `/>`"
    );
}

#[test]
fn wrong_use_exits_with_2_and_help_with_0() {
    let (output, _folder) = etendue("", &["render", "scene.xml", "--nonsense"]);
    assert_eq!(output.status.code(), Some(2));
    for command in ["render", "explain", "compare", "replay"] {
        let (output, _folder) = etendue("", &[command, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        assert!(String::from_utf8_lossy(&output.stdout).contains("Usage: etendue"));
    }
}

/// A lit floor, for the commands that need a scene that works.
const FLOOR: &str = r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="3"/></integrator>
<sensor type="perspective"><transform name="to_world"><lookat origin="0,2,4" target="0,0,0" up="0,1,0"/></transform>
<sampler type="independent"><integer name="sample_count" value="4"/></sampler>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform></shape>
<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter></scene>"#;

fn run_in(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_etendue"))
        .args(args)
        .current_dir(folder)
        .output()
        .expect("the program runs")
}

#[test]
fn accelerators_and_qualities_that_do_not_go_together() {
    for (args, expected) in [
        (["--accel", "bvh2", "--bvh", "fast"], "the accelerator `bvh2` has no choice of quality"),
        (["--accel", "bvh8", "--bvh", "hihg"], "unknown quality `hihg` of a BVH; did you mean `high`?"),
    ] {
        let (output, _folder) =
            etendue(FLOOR, &[&["render", "scene.xml", "-o", "a.exr"], &args[..]].concat());
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn render_writes_what_was_asked_for() {
    let (output, folder) = etendue(
        FLOOR,
        &[
            "render",
            "scene.xml",
            "-o",
            "a.exr",
            "--png",
            "--stats",
            "s.json",
            "--threads",
            "1",
            "--aov",
            "N,Z",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let at = |name: &str| -> PathBuf { folder.path().join(name) };
    assert!(at("a.exr").exists() && at("a.png").exists() && !at("a.exr.part").exists());
    let stats: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(at("s.json")).expect("statistics")).expect("JSON");
    for key in
        ["render_wall_seconds", "render_cpu_seconds", "load_seconds", "build_seconds", "peak_memory_bytes"]
    {
        assert!(stats[key].as_f64().is_some_and(|v| v >= 0.0), "{key}: {stats}");
    }
    assert_eq!(stats["samples"], 24 * 16 * 4);
    assert_eq!(stats["paths"], 24 * 16 * 4);
    assert_eq!(stats["bad_samples"]["total"], 0);
    assert!(stats["rays"]["shadow"].as_u64().is_some_and(|n| n > 0));
    assert_eq!(stats["plan"]["accel"], "bvh8");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        text.contains("Owen-scrambled Sobol (the file says `independent`; its sample count is used)"),
        "{text}"
    );

    // The same again, by another thread count, is the same file; and no difference.
    let again = run_in(
        folder.path(),
        &["render", "scene.xml", "-o", "b.exr", "--threads", "2", "--aov", "N,Z", "-q"],
    );
    assert_eq!(again.status.code(), Some(0));
    assert!(again.stderr.is_empty(), "{again:?}");
    assert_eq!(std::fs::read(at("a.exr")).expect("a"), std::fs::read(at("b.exr")).expect("b"));
    let same = run_in(folder.path(), &["compare", "a.exr", "b.exr", "--json"]);
    let same: serde_json::Value = serde_json::from_slice(&same.stdout).expect("JSON");
    assert_eq!(same["mse"], 0.0);
}

#[test]
fn time_and_error_stop_a_render() {
    let (output, folder) =
        etendue(FLOOR, &["render", "scene.xml", "-o", "a.exr", "--time", "0.2", "--stats", "s.json"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let stats = std::fs::read_to_string(folder.path().join("s.json")).expect("statistics");
    let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
    assert_eq!(stats["stopped"], "time limit reached");
    let output = run_in(
        folder.path(),
        &["render", "scene.xml", "-o", "b.exr", "--error", "0.02", "--stats", "t.json"],
    );
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let stats = std::fs::read_to_string(folder.path().join("t.json")).expect("statistics");
    let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
    assert_eq!(stats["stopped"], "error limit reached");
    assert!(stats["relative_error"].as_f64().is_some_and(|e| e <= 0.02));
}

#[test]
fn explain_and_replay_answer_on_stdout() {
    let (output, folder) = etendue(FLOOR, &["explain", "scene.xml"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("24 × 16, 4 spp, integrator path") && text.contains("Left out"), "{text}");
    assert!(text.contains("shared paths: 16, 32 or 64 pixels use each other's, or none"), "{text}");
    // Each effect that `tools/left_out.py` measures the absence of.
    for effect in [
        "media",
        "alpha",
        "dispersion",
        "motion",
        "instances",
        "lens",
        "texture filter",
        "mesh attributes",
        "placed lamps",
    ] {
        assert!(text.contains(&format!("\n  {effect}: ")), "{effect}: {text}");
    }
    let output = run_in(folder.path(), &["replay", "scene.xml", "12,12", "--sample", "1"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.starts_with("pixel 12,12 sample 1 seed 0") && text.contains("vertex 0:"), "{text}");
    let output = run_in(folder.path(), &["replay", "scene.xml", "99,12"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        String::from_utf8_lossy(&output.stderr).trim_end(),
        "error: pixel 99,12 is outside the film of 24 × 16"
    );
}

/// An old scene with a material that nothing here knows, and one that has a
/// nearest.
const OLD: &str = "<scene version=\"0.5.0\">
<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"height\" value=\"8\"/></film>
<transform name=\"toWorld\"><lookAt origin=\"0,0,4\" target=\"0,0,0\" up=\"0,1,0\"/></transform></sensor>
<emitter type=\"constant\"/>
<shape type=\"sphere\"><bsdf type=\"phong\"/></shape>
<shape type=\"rectangle\"><bsdf type=\"velvet\"/><float name=\"fuzz\" value=\"1\"/></shape>
</scene>
";

#[test]
fn leniency_is_told_by_every_command() {
    let (output, folder) = etendue(OLD, &["render", "scene.xml", "-o", "a.exr", "--spp", "1", "-q"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        String::from_utf8_lossy(&output.stderr).trim_end(),
        "error: scene.xml:5:22: bsdf `phong` is not known; the nearest is a `blendbsdf` of `diffuse` and \
         `roughconductor`; with --lenient it is replaced by a blend of `diffuse` and `roughconductor`"
    );
    let warnings = "\
warning: scene.xml:5:22: bsdf `phong` is not known; the nearest is a `blendbsdf` of `diffuse` and \
`roughconductor`; replaced by a blend of `diffuse` and `roughconductor`
warning: scene.xml:6:25: unknown bsdf `velvet`; replaced by a grey `diffuse`
warning: scene.xml:6:46: shape `rectangle` takes no parameter `fuzz`; ignored
";
    for command in [
        &["render", "scene.xml", "-o", "a.exr", "--spp", "1", "-q", "--lenient"][..],
        &["explain", "scene.xml", "--lenient"],
        &["replay", "scene.xml", "4,4", "--lenient"],
        &["study", "scene.xml", "-o", "study", "--spp", "1..2", "--repeats", "3", "--lenient", "-q"],
    ] {
        let output = run_in(folder.path(), command);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{command:?}: {text}");
        assert!(text.starts_with(warnings), "{command:?}: {text}");
        assert_eq!(text.matches("velvet").count(), 1, "{command:?}: {text}");
    }
    // The file says it too.
    let bytes = std::fs::read(folder.path().join("a.exr")).expect("a picture");
    let holds = |text: &str| bytes.windows(text.len()).any(|w| w == text.as_bytes());
    assert!(holds("etendue/replaced") && holds("unknown bsdf `velvet`"));
}
