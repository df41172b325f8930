//! Every reference of `refs/` against Mitsuba, pixel by pixel. Where the scene
//! stands as glTF too (`gltf` in the JSON), that file is what is rendered.
//!
//! Both sides have variances: Mitsuba's from its passes, ours from at least 16
//! independent seeds. |z| of every pixel and channel is compared with a
//! threshold corrected for their number (Šidák, 1 % for the picture): 99.75 %
//! must be inside; 8 × 8 blocks must all be; and the signed difference of the
//! whole mean must be within three standard errors and under 0.2 %. A picture
//! too noisy to tell fails. How many samples it takes follows from the error
//! that the reference itself has (`Reference::batches`).
//! `tests/mutations.rs` shows that bugs are found.
//!
//! A failure leaves both pictures in `target/reference-failures`.

#![allow(clippy::print_stdout, reason = "the report of a test is what it prints")]

#[path = "common/reference.rs"]
mod reference;
#[path = "common/render.rs"]
mod render;

use std::time::Instant;

use cpu_time::ProcessTime;
use reference::Reference;

/// `ETENDUE_REFERENCE=veach-mis` runs the references whose name contains it.
fn chosen(name: &str) -> bool {
    std::env::var("ETENDUE_REFERENCE").map_or(true, |part| name.contains(&part))
}

fn check(names: &[String]) {
    let mut failures = Vec::new();
    for name in names.iter().filter(|n| chosen(n)) {
        let clock = (Instant::now(), ProcessTime::now());
        let reference = Reference::read(name);
        let ready = reference.scene(|_| {});
        let ours = reference.ours(&ready);
        let report = reference.test(&ours, reference::overlap(&ready.scene.film.filter));
        println!(
            "{name} ({:.1} s, {:.1} CPU s; {} × {} spp, ±{:.4} % by ours, ±{:.4} % by the reference): {report}",
            clock.0.elapsed().as_secs_f64(),
            clock.1.elapsed().as_secs_f64(),
            ours.batches,
            ours.samples,
            100.0 * ours.mean_error,
            100.0 * reference.mean_error(),
        );
        if !report.passed() {
            let folder = reference.dump(&ours);
            failures.push(format!("{name}: {report}\n  pictures in {}", folder.display()));
        }
    }
    assert!(failures.is_empty(), "{} of {} differ:\n{}", failures.len(), names.len(), failures.join("\n"));
}

fn split(feature: bool) -> Vec<String> {
    let is_feature = |n: &String| n.starts_with("features-") || n.starts_with("filters-");
    reference::names().into_iter().filter(|n| is_feature(n) == feature).collect()
}

#[test]
fn real_scenes_match_mitsuba() {
    let names = split(false);
    assert!(names.len() >= 7, "{names:?}");
    check(&names);
}

#[test]
fn feature_scenes_match_mitsuba() {
    let names = split(true);
    assert!(names.len() >= 20, "{names:?}");
    check(&names);
}
