//! `etendue accel`: its tables and files, and what it says when used wrongly.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn package(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn accel(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_etendue")).arg("accel").args(args).output().expect("the program runs")
}

fn error_of(args: &[&str]) -> String {
    let output = accel(args);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    String::from_utf8(output.stderr).expect("text").trim_end().to_owned()
}

#[test]
fn a_race_on_a_scene_and_a_generated_surface() {
    let folder = tempfile::tempdir().expect("a folder");
    let (csv, json) = (folder.path().join("a.csv"), folder.path().join("a.json"));
    let scene = package("scenes/cornell-box/scene.xml");
    let output = accel(&[
        "--bench",
        scene.to_str().expect("text"),
        "--generate",
        "displaced:2^10",
        "--accel",
        "bvh2,brute",
        "--baseline",
        "brute",
        "--rays",
        "300",
        "--repeats",
        "3",
        "--builds",
        "2",
        "--verify",
        "50",
        "--csv",
        csv.to_str().expect("text"),
        "--json",
        json.to_str().expect("text"),
    ]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(text.contains("cornell-box: 24 triangles, 6 analytic"), "{text}");
    assert!(text.contains("displaced 2^10: 1024 triangles, 0 analytic"), "{text}");
    assert!(text.contains("bvh2 over brute, bounces and shadow rays: "), "{text}");

    let csv = std::fs::read_to_string(csv).expect("the table");
    let lines: Vec<&str> = csv.lines().collect();
    let columns = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == columns), "{csv}");
    // Two cases, two kinds; two build times, memory and seven ray sets.
    assert_eq!(lines.len(), 1 + 2 * 2 * 10, "{csv}");
    let rays: Vec<&&str> = lines.iter().filter(|line| line.contains(",Mray/s,")).collect();
    assert_eq!(rays.len(), 2 * 2 * 7);
    assert!(rays.iter().all(|line| line.ends_with(",0,0,0,0,0")), "differences: {csv}");

    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(json).expect("the file")).expect("JSON");
    assert_eq!(json["baseline"], "brute");
    let set = &json["cases"][1]["kinds"][0]["sets"][1];
    assert_eq!(
        (set["set"].as_str(), set["rays"].as_u64(), set["hits"].as_u64()),
        (Some("b1"), Some(300), Some(300))
    );
    assert_eq!(set["cpu_seconds"].as_array().map(Vec::len), Some(3));
    assert!(json["scattered_rays_over_baseline"][0]["ratio"].as_f64() > Some(0.0));
}

#[test]
fn without_bench_it_only_builds() {
    let output = accel(&["--growth", "4..6", "--accel", "bvh2"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    for power in 4..=6 {
        assert!(text.contains(&format!("displaced 2^{power}: {} triangles", 1 << power)), "{text}");
    }
    assert!(text.contains("build_cpu") && text.contains("expected cost"), "{text}");
    assert!(!text.contains("Mray/s"), "{text}");
}

#[test]
fn wrong_use_is_told() {
    assert_eq!(
        error_of(&["--bench"]),
        "error: nothing to build accelerators for; name a scene or a mesh, or use --generate or --growth"
    );
    assert_eq!(
        error_of(&["--growth", "4..4", "--accel", "bvh22"]),
        "error: unknown accelerator `bvh22`; did you mean `bvh2`?"
    );
    assert_eq!(
        error_of(&["--growth", "4..4", "--accel", "bvh2,brute", "--baseline", "bvh"]),
        "error: the baseline `bvh` is not among the accelerators; measured are bvh2, brute"
    );
    assert_eq!(
        error_of(&["--bench", "--growth", "4..4", "--sets", "b1,b2"]),
        "error: unknown ray set `b2`; did you mean `b1`?"
    );
    assert_eq!(
        error_of(&["--generate", "displaced:many"]),
        "error: cannot generate `displaced:many`; expected displaced:TRIANGLES (as in displaced:2^20) or stadium:MESH"
    );
    assert_eq!(
        error_of(&["--generate", "displaced:7"]),
        "error: cannot make a displaced surface of 7 triangles; from 16 to 2^30"
    );
    assert!(error_of(&["nothing.ply"]).contains("cannot find the file `nothing.ply`"));
}
