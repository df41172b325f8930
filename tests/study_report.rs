//! The report of a study: complete, self-contained, and not confused by odd
//! names, missing runs or values that are not numbers.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop there")]

use std::fs;
use std::path::{Path, PathBuf};

use etendue::load::read_picture;
use etendue::study::model::*;
use etendue::study::report::write_report;

const ODD: &str = "a <b>&\"'</script><!-- {{ x }} é→😀";
const SAMPLES: [f64; 6] = [1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];

fn about(value: f64, part: f64) -> Interval {
    let width = part * value.abs();
    Interval { value, low: value - width, high: value + width }
}

fn nothing() -> Interval {
    Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN }
}

/// Deterministic and uneven, in [-1, 1).
fn jitter(seed: usize) -> f64 {
    let mixed = (seed as u64).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((mixed >> 40) as f64) / f64::from(1 << 23) - 1.0
}

fn figures(targets: &[String], rel_mse: f64, runs: usize, seed: usize) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (t, target) in targets.iter().enumerate() {
        for metric in Metric::ALL {
            let value = match metric {
                Metric::Mse => 0.2 * rel_mse,
                Metric::RelMse => rel_mse,
                Metric::RelMseTrimmed => 0.8 * rel_mse,
                Metric::Mape | Metric::Smape => rel_mse.sqrt() * 0.7,
                Metric::Psnr => -10.0 * (0.2 * rel_mse).log10(),
                Metric::FlipLdr => (0.4 * rel_mse.sqrt()).min(1.0),
                Metric::FlipHdr => (0.6 * rel_mse.sqrt()).min(1.0),
                Metric::Bias => 1e-3 * jitter(seed + t),
            } / (1.0 + t as f64);
            let floor = match metric {
                Metric::Mse => 2e-6,
                Metric::RelMse | Metric::RelMseTrimmed => 5e-5,
                _ => 0.0,
            };
            let mean = if runs > 1 { about(value, 0.2) } else { Interval { value, ..nothing() } };
            let runs = (0..runs).map(|r| value * (1.0 + 0.1 * jitter(seed + r))).collect();
            figures.push(Figure {
                target: target.clone(),
                metric,
                mean,
                runs,
                floor,
                limited: floor > 0.0 && value < 3.0 * floor,
            });
        }
    }
    figures
}

fn configuration(name: &str, index: usize, targets: &[String], one_run: bool) -> ConfigurationStudy {
    let mut rungs = Vec::new();
    for (i, samples) in SAMPLES.iter().enumerate() {
        let runs = if one_run { 1 } else { 4 };
        let cpu = 0.02 * samples * (1.0 + 0.35 * index as f64);
        let rel_mse =
            0.6 / samples.powf([1.0, 1.25, 0.93, 0.55][index % 4]) * (1.0 + 0.08 * jitter(7 * i + index));
        rungs.push(Rung {
            budget: format!("{samples} spp"),
            samples_per_pixel: *samples,
            cpu_seconds: vec![cpu; runs],
            wall_seconds: vec![cpu / 2.0; runs],
            cpu: if one_run { Interval { value: cpu, ..nothing() } } else { about(cpu, 0.03) },
            wall: about(cpu / 2.0, 0.05),
            reported_error: if one_run { f64::NAN } else { rel_mse.sqrt() },
            figures: figures(targets, rel_mse, runs, 100 * index + i),
            efficiency: about(1.0 / (rel_mse * cpu), 0.22),
        });
    }
    let fit = |against| Fit {
        metric: Metric::RelMse,
        against,
        slope: about([-1.0, -1.25, -0.93, -0.55][index % 4], 0.04),
        last: about([-1.01, -1.2, -0.9, -0.3][index % 4], 0.1),
        verdict: ["at the Monte Carlo rate", "faster than independent samples", "slower", "stalled"]
            [index % 4]
            .into(),
    };
    let budget = "1024 spp".to_string();
    let verdict = [BiasVerdict::Converges, BiasVerdict::Undecided, BiasVerdict::Biased][index % 3];
    ConfigurationStudy {
        name: name.into(),
        settings: vec![("sampler".into(), name.into())],
        external: index == 2,
        biased_by_design: (index == 3).then(|| "direct light only".into()),
        rungs,
        fits: vec![fit(Cost::Cpu), fit(Cost::Samples)],
        time_to: vec![
            TimeTo { error: 0.01, cpu: about(31.0 + index as f64, 0.1), extrapolated: index > 0 },
            TimeTo { error: 0.005, cpu: nothing(), extrapolated: true },
        ],
        bias: (index != 3).then(|| BiasTest {
            budget: budget.clone(),
            mean: Interval { value: 2e-4, low: -4e-4, high: 8e-4 },
            worst_z: 3.1,
            worst_at: [24, 16],
            threshold: 4.4,
            false_positive_rate: 0.01,
            verdict,
            text: "No block of 8 × 8 pixels differs.".into(),
        }),
        noise: (!one_run).then(|| noise(index, &budget)),
        calibration: index.is_multiple_of(2).then(|| calibration(index)),
    }
}

fn noise(index: usize, budget: &str) -> Noise {
    let blue = index == 1;
    let power = |f: f64| if blue { 0.2 + 3.2 * f } else { 1.0 + 0.1 * jitter((1e3 * f) as usize + index) };
    let exponents = -8..=5 + i32::try_from(index).unwrap();
    Noise {
        budget: budget.into(),
        spectrum: (1..=64).map(|i| f64::from(i) / 128.0).map(|f| [f, power(f)]).collect(),
        colour: if blue { "blue: less power at low frequencies" } else { "white" }.into(),
        histogram: exponents
            .map(|e| 2f64.powi(e))
            .map(|x| [x, x * 0.4 / (1.0 + x.powi(4 - i32::try_from(index).unwrap().min(2)))])
            .collect(),
        tail_index: about(4.2 - index as f64, 0.2),
        worst_share: 0.05 + 0.2 * index as f64,
        correlation: vec![0.02, -0.01, f64::EPSILON, 0.0],
    }
}

fn calibration(index: usize) -> Calibration {
    let width = if index == 0 { 1.1 } else { 0.8 };
    let within = |k: f64| (1.0 - (-0.8 * (k * width).powf(1.35)).exp()).min(1.0);
    let coverage = |samples: &f64| Coverage {
        budget: format!("{samples} spp"),
        samples_per_pixel: *samples,
        within: [1.0, 2.0, 3.0].map(|k| about(within(k), 0.004)),
        within_95: about(within(1.96), 0.004),
        ratio: 1.0 / width,
        curve: (0..=40).map(|i| f64::from(i) / 10.0).map(|k| [k, within(k)]).collect(),
    };
    Calibration { rungs: SAMPLES[2..].iter().map(coverage).collect(), verdict: "A little cautious.".into() }
}

fn scene(name: &str, configurations: Vec<ConfigurationStudy>, targets: &[String]) -> SceneStudy {
    let baseline = configurations[0].name.clone();
    let verdicts = [Preference::Better, Preference::NoDifference, Preference::Worse];
    let comparisons = configurations[1..].iter().enumerate().map(|(i, c)| Comparison {
        configuration: c.name.clone(),
        equal_time: [0.1, 1.0, 10.0]
            .map(|level| AtLevel { level, speedup: about([2.1, 1.02, 0.4][i % 3], 0.12) })
            .into(),
        equal_error: [0.1, 0.01].map(|level| AtLevel { level, speedup: about(1.4, 0.2) }).into(),
        overall: about([2.1, 1.02, 0.4][i % 3], 0.12),
        verdict: verdicts[i % 3],
        text: "At equal time the error is smaller.".into(),
    });
    SceneStudy {
        name: name.into(),
        file: format!("scenes/{name}/scene.xml"),
        size: [64, 48],
        reference: Reference::Picture {
            file: "refs/cornell-box.exr".into(),
            provenance: vec![("renderer".into(), "another one".into()), ("samples".into(), "65536".into())],
            variance: Some("refs/cornell-box.var.exr".into()),
            noise_mse: 2e-6,
            noise_rel_mse: 5e-5,
        },
        targets: targets.to_vec(),
        baseline,
        comparisons: comparisons.collect(),
        configurations,
    }
}

/// Two scenes with odd names, four configurations, six budgets, values that
/// are not numbers, single runs, nothing to compare.
fn synthetic() -> Study {
    let targets = ["colour".to_string(), format!("colour in {ODD}")];
    let names = ["path, sobol", "path, independent", ODD, "direct, sobol"];
    let all = names.iter().enumerate().map(|(i, name)| configuration(name, i, &targets, i == 3));
    let mut second = scene(
        ODD,
        names.iter().enumerate().map(|(i, name)| configuration(name, i, &targets, true)).collect(),
        &targets,
    );
    second.comparisons.clear();
    second.reference = Reference::Replicates;
    for configuration in &mut second.configurations {
        configuration.rungs[1].figures[1].mean = nothing();
        configuration.rungs[2].figures.clear();
        configuration.noise = None;
        configuration.bias = None;
    }
    second.configurations[1].rungs.clear();
    Study {
        title: format!("Samplers {ODD}"),
        version: "0.1.0".into(),
        machine: Machine { cpu: "Some processor".into(), cores: 8, threads: 2, load: 0.97 },
        confidence: 0.95,
        repeats: 4,
        scenes: vec![scene("Cornell box", all.collect(), &targets), second],
        notes: vec![format!("Something else ran too: {ODD}.")],
    }
}

/// The pictures of a test: a reference of the repository and a noisier copy for
/// each configuration.
fn pictures(study: &Study) -> Vec<Exhibit> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("refs/cornell-box.exr");
    let picture = read_picture(&path).unwrap();
    let channels = ["R", "G", "B"].map(|name| picture.channel(name).unwrap());
    let size = [picture.width as usize, picture.height as usize];
    let rgb: Vec<f32> = (0..size[0] * size[1]).flat_map(|i| channels.map(|c| c[i])).collect();
    let scene = study.scenes[0].name.clone();
    let mut exhibits =
        vec![Exhibit { scene: scene.clone(), label: "reference".into(), size, rgb: rgb.clone() }];
    for (i, configuration) in study.scenes[0].configurations.iter().enumerate() {
        let noisy = |(k, v): (usize, &f32)| v * (1.0 + 0.25 * (jitter(k + 1000 * i) + 0.2 * i as f64) as f32);
        exhibits.push(Exhibit {
            scene: scene.clone(),
            label: format!("{}, 1024 spp", configuration.name),
            size,
            rgb: rgb.iter().enumerate().map(noisy).collect(),
        });
    }
    let rgb = vec![1.0, 2.0, 3.0, f32::NAN, 1e6, f32::INFINITY, -1.0, 0.0, 0.5];
    exhibits.push(Exhibit { scene: study.scenes[1].name.clone(), label: ODD.into(), size: [3, 1], rgb });
    exhibits
}

/// Where to write: a folder of one's own choice to look at, else a passing one.
fn folder(name: &str) -> (Option<tempfile::TempDir>, PathBuf) {
    if let Some(chosen) = std::env::var_os("ETENDUE_REPORT_DIR") {
        return (None, PathBuf::from(chosen).join(name));
    }
    let passing = tempfile::tempdir().unwrap();
    let path = passing.path().join(name);
    (Some(passing), path)
}

/// What the element with `id` holds.
fn embedded<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.find(&format!("id=\"{id}\">")).unwrap() + id.len() + 6;
    let end = page[start..].find("</script>").unwrap();
    &page[start..start + end]
}

#[test]
fn a_report_is_whole_and_self_contained() {
    let (_keep, folder) = folder("whole");
    let study = synthetic();
    write_report(&folder, &study, &pictures(&study)).unwrap();
    let page = fs::read_to_string(folder.join("index.html")).unwrap();

    let read: Study = serde_json::from_str(embedded(&page, "study-data")).unwrap();
    let same = serde_json::to_string(&read).unwrap() == serde_json::to_string(&study).unwrap();
    assert!(same, "the embedded study is another one");
    assert_eq!(page.matches("class=\"exhibit\"").count(), 6);
    // A figure near to the reference's noise has no number in the tables.
    let limited = "<span class=\"limited\">within the reference’s noise</span>";
    let count = study.scenes.iter().flat_map(|s| &s.configurations).flat_map(|c| &c.rungs);
    let count = count.flat_map(|r| &r.figures).filter(|f| f.limited).count();
    assert!(count > 0 && page.matches(limited).count() >= count);

    // Nothing is fetched: no address but the name of SVG's namespace
    // and references within the page.
    let without_namespace = page.replace("http://www.w3.org/2000/svg", "").replace("url(#", "");
    for address in ["http:", "https:", "src=\"", "url(", "@import", "fetch(", "XMLHttpRequest", "=\"//"] {
        assert!(!without_namespace.contains(address), "the page has `{address}`");
    }
    assert!(page.len() < 3_000_000, "{} bytes", page.len());

    let plots: Vec<PathBuf> =
        fs::read_dir(folder.join("plots")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let stems = |suffix: &str| plots.iter().filter(|p| p.extension().is_some_and(|e| e == suffix)).count();
    assert_eq!(stems("svg"), 12 + 10);
    assert_eq!(stems("png"), stems("svg"));
    for path in &plots {
        assert!(fs::metadata(path).unwrap().len() > 2000, "{} is empty", path.display());
        let name = format!("plots/{}", path.file_name().unwrap().to_string_lossy());
        assert!(page.contains(&name), "no link to {name}");
    }
}

#[test]
fn names_cannot_break_out_of_the_page() {
    let (_keep, folder) = folder("names");
    let study = synthetic();
    write_report(&folder, &study, &pictures(&study)).unwrap();
    let page = fs::read_to_string(folder.join("index.html")).unwrap();
    assert!(!page.contains("a <b>"), "a name is not escaped");
    assert!(page.contains("a &lt;b&gt;&amp;"), "names are missing");
    // Every script element is one of ours.
    let count = 2 + 6 + 7;
    assert_eq!((page.matches("<script").count(), page.matches("</script>").count()), (count, count));
    for entry in fs::read_dir(folder.join("plots")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "svg") {
            let text = fs::read_to_string(&path).unwrap();
            roxmltree::Document::parse(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        }
    }
}

#[test]
fn what_is_missing_is_no_failure() {
    let (_keep, folder) = folder("missing");
    let mut study = synthetic();
    study.scenes[0].targets.clear();
    study.scenes[1].configurations.clear();
    let mut bare = study.scenes[0].clone();
    bare.baseline = "nobody".into();
    for configuration in &mut bare.configurations {
        configuration.rungs.clear();
        configuration.fits.clear();
        configuration.noise = None;
        configuration.calibration = None;
    }
    let mut strange = synthetic().scenes.remove(0);
    for configuration in &mut strange.configurations {
        for rung in &mut configuration.rungs {
            (rung.cpu, rung.efficiency, rung.samples_per_pixel) = (nothing(), nothing(), f64::NAN);
            rung.figures.iter_mut().for_each(|f| (f.mean, f.floor) = (nothing(), f64::NAN));
        }
        if let Some(noise) = &mut configuration.noise {
            noise.spectrum = vec![[f64::NAN; 2], [0.1, 0.0]];
            noise.histogram = vec![[0.0, f64::INFINITY]];
        }
    }
    study.scenes.extend([bare, strange]);
    write_report(&folder, &study, &[]).unwrap();
    study.scenes.clear();
    write_report(&folder.join("empty"), &study, &[]).unwrap();
    let page = fs::read_to_string(folder.join("empty/index.html")).unwrap();
    assert!(page.contains("Nothing was measured"));
    let short = Exhibit { scene: "s".into(), label: "l".into(), size: [2, 2], rgb: vec![0.0; 3] };
    let error = write_report(&folder, &study, &[short]).unwrap_err();
    assert!(error.to_string().contains("need three values each, got 3"), "{error}");
}
