//! Every reference of `refs/` against Mitsuba, pixel by pixel.
//!
//! Both sides have variances: Mitsuba's from its passes, ours from 16
//! independent seeds. |z| of every pixel and channel is compared with a
//! threshold corrected for their number (Šidák, 1 % for the picture): 99.75 %
//! must be inside; 8 × 8 blocks must all be; and the signed difference of the
//! whole mean must be within three standard errors and under 0.2 %. A picture
//! too noisy to tell fails, but for at most two that would need more samples
//! than the default budget: `ETENDUE_REFERENCE_LONG=1 cargo test --test
//! reference` decides those too. `tests/mutations.rs` shows that bugs are found.
//!
//! A failure leaves both pictures in `target/reference-failures`.

#![allow(clippy::print_stdout, reason = "the report of a test is what it prints")]

#[path = "common/reference.rs"]
mod reference;
#[path = "common/render.rs"]
mod render;

use etendue::study::Verdict;
use reference::Reference;

/// `ETENDUE_REFERENCE=veach-mis` runs the references whose name contains it.
fn chosen(name: &str) -> bool {
    std::env::var("ETENDUE_REFERENCE").map_or(true, |part| name.contains(&part))
}

fn check(names: &[String]) {
    let (mut failures, mut open) = (Vec::new(), Vec::new());
    for name in names.iter().filter(|n| chosen(n)) {
        let clock = std::time::Instant::now();
        let reference = Reference::read(name);
        let ready = reference.scene(|_| {});
        let ours = reference.ours(&ready);
        let report = reference.test(&ours, reference::overlap(&ready.scene.film.filter));
        println!("{name} ({:.1} s): {report}", clock.elapsed().as_secs_f64());
        // What the default budget of samples cannot decide, the long run does.
        let undecided = report.verdict == Verdict::Inconclusive && !reference::long_run();
        if undecided {
            open.push(name.clone());
        }
        if !report.passed() && !undecided {
            let folder = reference.dump(&ours);
            failures.push(format!("{name}: {report}\n  pictures in {}", folder.display()));
        }
    }
    println!("undecided within the default budget: {open:?}");
    assert!(open.len() <= 2, "too many undecided: {open:?}");
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
