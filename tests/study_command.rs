//! `etendue study` as a user meets it: a plan, a kill in the middle, going on,
//! series of another renderer, and messages.

#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use etendue::study::Run;
use etendue::study::model::{BiasVerdict, Metric, Reference, Study};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn command(plan: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_etendue"));
    command.arg("study").arg(plan).arg("-o").arg(out);
    command
}

fn finish(mut command: Command) -> Output {
    command.stdin(Stdio::null()).output().expect("the program runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Two scenes, one without a reference; two integrators, two samplers.
fn write_plan(folder: &Path, series: &str) -> std::path::PathBuf {
    let root = root().display();
    let plan = folder.join("plan.toml");
    let toml = format!(
        r#"
title = "Small <study> & more"
spp = "2..16"
repeats = 4
layers = []
baseline = "path, independent"

[vary]
integrator = ["path", "direct"]
sampler = ["sobol", "independent"]

[[scene]]
file = "{root}/scenes/cornell-box/scene.xml"
reference = "{root}/refs/cornell-box.exr"
reference-variance = "{root}/refs/cornell-box.var.exr"
define = {{ resx = 64, resy = "64" }}
regions = {{ lamp = [24, 0, 16, 8] }}

[[scene]]
name = "no reference"
file = "{root}/scenes/veach-mis/scene.xml"
size = [32, 18]
{series}
"#
    );
    fs::write(&plan, toml).expect("written");
    plan
}

fn runs(out: &Path) -> Vec<Run> {
    let text = fs::read_to_string(out.join("runs.jsonl")).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

fn study(out: &Path) -> Study {
    serde_json::from_str(&fs::read_to_string(out.join("study.json")).expect("study.json")).expect("a study")
}

#[test]
fn a_killed_study_goes_on_and_repeats_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("report");
    let plan = write_plan(folder.path(), "");
    let mut child = command(&plan, &out).arg("-q").stdin(Stdio::null()).spawn().expect("the program runs");
    let start = Instant::now();
    while runs(&out).len() < 20 {
        assert!(start.elapsed() < Duration::from_secs(120), "20 runs take over two minutes");
        assert!(child.try_wait().expect("a child").is_none(), "the study ended before it could be killed");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("SIGKILL");
    child.wait().expect("a dead child");
    let before = runs(&out);
    let modified = |run: &Run| -> SystemTime {
        fs::metadata(out.join(&run.image)).and_then(|m| m.modified()).expect("a picture")
    };
    let times: BTreeMap<String, SystemTime> = before.iter().map(|r| (r.key.clone(), modified(r))).collect();
    assert!((20..128).contains(&times.len()), "{} runs before the kill", times.len());

    let done = finish(command(&plan, &out));
    assert!(done.status.success(), "{}", text(&done.stderr));
    let after = runs(&out);
    let keys: BTreeMap<String, SystemTime> = after.iter().map(|r| (r.key.clone(), modified(r))).collect();
    // 2 scenes × 4 configurations × 4 rungs × 4 repeats, each once.
    assert_eq!((after.len(), keys.len()), (128, 128));
    for (key, time) in &times {
        assert_eq!(keys[key], *time, "run {key} was repeated");
    }
    let seeds: std::collections::BTreeSet<u64> = after.iter().map(|r| r.seed).collect();
    assert_eq!(seeds.len(), 128, "every run has a seed of its own");
    check_study(&study(&out));

    // Nothing is left to do: the third time only writes the report again.
    let again = finish(command(&plan, &out));
    assert!(again.status.success());
    assert_eq!(runs(&out), after);
    let csv = fs::read_to_string(out.join("study.csv")).expect("study.csv");
    assert!(csv.lines().count() > 200 && csv.contains("cornell-box,\"path, sobol\",16 spp,16,4,"), "{csv}");
    assert!(fs::read_to_string(out.join("index.html")).expect("a page").contains("&lt;study&gt;"));
}

fn check_study(study: &Study) {
    assert_eq!(study.repeats, 4);
    let [cornell, other] = study.scenes.as_slice() else { panic!("{} scenes", study.scenes.len()) };
    assert!(matches!(&cornell.reference, Reference::Picture { noise_rel_mse, .. } if *noise_rel_mse > 0.0));
    assert!(matches!(&other.reference, Reference::Replicates));
    assert_eq!(cornell.targets, ["colour", "colour in lamp"]);
    assert_eq!(cornell.baseline, "path, independent");
    for scene in &study.scenes {
        let names: Vec<&str> = scene.configurations.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["path, sobol", "path, independent", "direct, sobol", "direct, independent"]);
        for configuration in &scene.configurations {
            let samples: Vec<f64> = configuration.rungs.iter().map(|r| r.samples_per_pixel).collect();
            assert_eq!(samples, [2.0, 4.0, 8.0, 16.0]);
            for rung in &configuration.rungs {
                assert_eq!((rung.cpu_seconds.len(), rung.wall_seconds.len()), (4, 4));
                let figure = rung.figures.iter().find(|f| f.metric == Metric::RelMse).expect("relMSE");
                assert!(figure.mean.value > 0.0 && figure.mean.low <= figure.mean.value);
                assert!(figure.mean.value <= figure.mean.high && rung.cpu.value > 0.0);
            }
        }
        assert_eq!(scene.comparisons.len(), 3);
    }
    // Direct light alone is no estimate of the whole picture, and that shows.
    let bias = |name: &str| {
        let c = cornell.configurations.iter().find(|c| c.name == name).expect("a configuration");
        c.bias.as_ref().expect("there is a reference").verdict
    };
    assert_eq!(bias("direct, sobol"), BiasVerdict::Biased);
    assert_ne!(bias("path, sobol"), BiasVerdict::Biased);
    assert!(other.configurations.iter().all(|c| c.bias.is_none()));
}

#[test]
fn series_of_another_renderer_stand_beside() {
    let folder = tempfile::tempdir().expect("a folder");
    let series = folder.path().join("other");
    fs::create_dir(&series).expect("a folder");
    let mut list = String::from("file,seconds,spp\n");
    for (spp, seed) in [(2, 1), (2, 2), (8, 3), (8, 4)] {
        let file = format!("{spp}-{seed}.exr");
        let made = finish({
            let mut c = Command::new(env!("CARGO_BIN_EXE_etendue"));
            c.arg("render").arg(root().join("scenes/cornell-box/scene.xml"));
            c.args(["-D", "resx=64", "-D", "resy=64", "-q", "--spp", &spp.to_string()]);
            c.args(["--seed", &seed.to_string(), "-o"]).arg(series.join(&file));
            c
        });
        assert!(made.status.success(), "{}", text(&made.stderr));
        list += &format!("{file},{},{spp}\n", 0.01 * f64::from(spp));
    }
    fs::write(series.join("list.csv"), &list).expect("written");
    let out = folder.path().join("report");
    let with_series = |name: &str| {
        let mut c = Command::new(env!("CARGO_BIN_EXE_etendue"));
        c.arg("study").arg(root().join("scenes/cornell-box/scene.xml")).arg("-o").arg(&out);
        c.arg("--ref").arg(root().join("refs/cornell-box.exr"));
        c.arg("--ref-variance").arg(root().join("refs/cornell-box.var.exr"));
        c.args(["--size", "64x64", "--spp", "2,8", "--repeats", "2", "-q"]);
        c.arg("--series").arg(format!("{name}={}", series.display()));
        c
    };
    let done = finish(with_series("other"));
    assert!(done.status.success(), "{}", text(&done.stderr));
    let study = study(&out);
    let external: Vec<_> = study.scenes[0].configurations.iter().filter(|c| c.external).collect();
    assert_eq!(external.len(), 1);
    assert_eq!(external[0].name, "other");
    let rungs: Vec<(f64, &[f64])> =
        external[0].rungs.iter().map(|r| (r.samples_per_pixel, r.cpu_seconds.as_slice())).collect();
    assert_eq!(rungs, [(2.0, [0.02; 2].as_slice()), (8.0, [0.08; 2].as_slice())]);

    fs::write(series.join("list.csv"), "file,spp\nx.exr,2\n").expect("written");
    let message = text(&finish(with_series("other")).stderr);
    assert!(message.contains("list.csv:1:1: there is no column `seconds`"), "{message}");
    fs::write(series.join("list.csv"), "file,seconds,spp\n2-1.exr,soon,2\n").expect("written");
    let message = text(&finish(with_series("other")).stderr);
    assert!(message.contains("list.csv:2:1: `soon` is no time above 0"), "{message}");
}

#[test]
fn messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("report");
    let scene = root().join("scenes/cornell-box/scene.xml");
    let message = |arguments: &[&str]| {
        let mut c = command(&scene, &out);
        c.args(arguments);
        let done = finish(c);
        assert!(!done.status.success(), "{arguments:?} is accepted");
        text(&done.stderr)
    };
    let reference = root().join("refs/teapot-env.exr").display().to_string();
    assert!(message(&["--size", "64x64", "--ref", &reference]).contains("80x45 pixels, the picture 64x64"));
    assert!(message(&["--vary", "sampler=sobl"]).contains("there is no sampler `sobl`"));
    assert!(message(&["--vary", "smapler=sobol,padded"]).contains("smapler"));
    assert!(message(&["--spp", "8..2"]).contains("no ladder"));
    assert!(message(&["--budget", "soon"]).contains("no time"));
    assert!(message(&["--baseline", "path"]).contains("baseline"));
    assert!(message(&["--size", "64x64", "--region", "r=900,900,2,2"]).contains("no pixel in the picture"));
    let plan = write_plan(folder.path(), "[[series]]\nscene = \"x\"\nname = \"m\"\nfolder = \"f\"\n");
    let with_plan = |arguments: &[&str]| {
        let mut c = command(&plan, &out);
        c.args(arguments);
        text(&finish(c).stderr)
    };
    assert!(with_plan(&["--vary", "sampler=sobol"]).contains("`--vary` goes with a scene"));
    assert!(with_plan(&["--camera", "above"]).contains("`--camera` goes with a scene"));
    assert!(with_plan(&["--sun"]).contains("`--sun` goes with a scene"));
    assert!(with_plan(&[]).contains("there is no scene `x`"));
    assert!(message(&["--repeats", "2"]).contains("three `repeats` at least"));
    assert!(message(&["--series", "as the file says=f"]).contains("is taken"));
}

#[test]
fn layers_without_a_reference_are_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("report");
    let mut c = command(&root().join("scenes/cornell-box/scene.xml"), &out);
    c.args(["--size", "16x16", "--spp", "4", "--repeats", "3", "--layers", "albedo", "-q"]);
    let done = finish(c);
    assert!(done.status.success(), "{}", text(&done.stderr));
    assert_eq!(study(&out).scenes[0].targets, ["colour", "albedo"]);
}

/// What is shown, when, and in which light: by options, by a plan, and by
/// `render` it is the same picture.
#[test]
fn gltf_is_shown_as_render_shows_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = root().join("scenes/gltf-table/table.glb");
    let sky = root().join("scenes/features/data/sky.exr");
    let stage =
        ["--camera", "above", "--frame", "7", "--fps", "12", "--shutter", "0,0.5", "--animation", "sway"];
    let more = ["--variant", "slate", "--sun=50,20", "--env"];
    let asked = |c: &mut Command| {
        c.args(stage).args(more).arg(&sky).args(["--size", "24x16", "--threads", "1", "-q"]);
    };
    let by_options = folder.path().join("options");
    let mut c = command(&table, &by_options);
    asked(&mut c);
    c.args(["--spp", "2", "--repeats", "3"]);
    let done = finish(c);
    assert!(done.status.success(), "{}", text(&done.stderr));

    let plan = folder.path().join("plan.toml");
    let toml = format!(
        r#"
spp = 2
repeats = 3
threads = 1
[[scene]]
file = "{}"
size = [24, 16]
camera = 1
frame = 7
fps = 12
shutter = [0, 0.5]
animation = "sway"
variant = "slate"
sun = [50, 20]
env = "{}"
"#,
        table.display(),
        sky.display()
    );
    fs::write(&plan, toml).expect("written");
    let by_plan = folder.path().join("plan");
    let done = finish(command(&plan, &by_plan));
    assert!(done.status.success(), "{}", text(&done.stderr));

    let (first, second) = (runs(&by_options), runs(&by_plan));
    let keys = |runs: &[Run]| runs.iter().map(|r| r.key.clone()).collect::<Vec<_>>();
    assert_eq!((keys(&first), first.len()), (keys(&second), 3), "the same runs by options and by a plan");

    let pixels = |path: &Path| {
        let picture = etendue::load::read_picture(path).expect("a picture");
        ["R", "G", "B"].map(|c| picture.channel(c).expect("a colour").to_vec())
    };
    let rendered = folder.path().join("render.exr");
    let render = |plain: bool| {
        let mut c = Command::new(env!("CARGO_BIN_EXE_etendue"));
        c.arg("render").arg(&table).arg("-o").arg(&rendered);
        if plain {
            c.args(["--size", "24x16", "--threads", "1", "-q"]);
        } else {
            asked(&mut c);
        }
        c.args(["--spp", "2", "--seed", &first[0].seed.to_string()]);
        let done = finish(c);
        assert!(done.status.success(), "{}", text(&done.stderr));
        pixels(&rendered)
    };
    let studied = pixels(&by_options.join(&first[0].image));
    assert_eq!(studied, render(false));
    assert_ne!(studied, render(true));
}
