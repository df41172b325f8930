//! From the ledger of runs to the study: which run belongs to which rung, and
//! what is asked of the statistics.

use std::path::{Path, PathBuf};

use super::bench::{Bench, Subject};
use super::bias::bias_test;
use super::coverage::{WithError, calibration, coverage};
use super::figures::{ReferenceNoise, figure, spread, target_in};
use super::interval::mean_interval;
use super::ledger::{Ledger, Measured, Run};
use super::model::{
    ConfigurationStudy, Exhibit, Interval, Machine, Metric, Reference, Rung, SceneStudy, Study,
};
use super::series::read_series;
use super::truth::Truth;
use super::{Image, conclude};
use crate::desc::{Error, Result};
use crate::load::read_picture;
use crate::render::Cause;

/// Level of all intervals.
const CONFIDENCE: f64 = 0.95;
/// CPU seconds ÷ (wall seconds × threads) under which something else ran too.
const LOADED: f64 = 0.9;

/// A study, and the pictures that its report shows.
pub struct Concluded {
    /// What was measured and what follows.
    pub study: Study,
    /// For each scene the reference and one picture of each configuration.
    pub exhibits: Vec<Exhibit>,
}

/// The runs of one configuration by rung.
struct Runs {
    name: String,
    settings: Vec<(String, String)>,
    external: bool,
    biased_by_design: Option<String>,
    rungs: Vec<Vec<Run>>,
}

/// Measures and concludes all that the ledger has of a plan.
///
/// # Errors
/// Pictures or series that cannot be read; an empty ledger.
pub fn gather(bench: &Bench, ledger: &Ledger) -> Result<Concluded> {
    let mut scenes = Vec::new();
    let mut exhibits = Vec::new();
    let mut own: Vec<Run> = Vec::new();
    for (index, subject) in bench.subjects.iter().enumerate() {
        let mut all = own_runs(bench, ledger, index);
        own.extend(all.iter().flat_map(|r| r.rungs.iter().flatten()).cloned());
        for series in bench.plan.series.iter().filter(|s| s.scene == subject.plan.name) {
            all.push(Runs::of_series(&series.name, read_series(series, subject)?));
        }
        let folder = bench.folder();
        scenes.push(scene_study(bench, subject, &all, folder)?);
        exhibits.extend(pictures(subject, &all, folder)?);
    }
    if own.is_empty() {
        return Err(Error::new("no run is finished yet: there is nothing to report"));
    }
    let machine = machine(&own);
    let configurations = scenes.iter().flat_map(|s: &SceneStudy| &s.configurations);
    let notes = notes(&own, &machine, bench, configurations);
    let study = Study {
        title: bench.plan.title.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        machine,
        confidence: CONFIDENCE,
        repeats: bench.plan.repeats as usize,
        scenes,
        notes,
    };
    Ok(Concluded { study, exhibits })
}

impl Runs {
    fn of_series(name: &str, runs: Vec<Run>) -> Runs {
        let mut rungs: Vec<Vec<Run>> = Vec::new();
        for run in runs {
            match rungs.last_mut() {
                Some(rung) if rung[0].samples_per_pixel == run.samples_per_pixel => rung.push(run),
                _ => rungs.push(vec![run]),
            }
        }
        let settings = vec![("renderer".to_owned(), name.to_owned())];
        Runs { name: name.to_owned(), settings, external: true, biased_by_design: None, rungs }
    }
}

/// The finished runs of a scene's configurations; rungs without any are left out.
fn own_runs(bench: &Bench, ledger: &Ledger, subject: usize) -> Vec<Runs> {
    let candidates = bench.subjects[subject].candidates.iter().enumerate();
    candidates
        .map(|(index, candidate)| {
            let rungs = (0..bench.budgets.len())
                .map(|budget| bench.keys(subject, index, budget))
                .map(|keys| keys.iter().filter_map(|key| ledger.get(key)).cloned().collect())
                .filter(|runs: &Vec<Run>| !runs.is_empty())
                .collect();
            Runs {
                name: candidate.name.clone(),
                settings: candidate.configuration.settings.clone(),
                external: false,
                biased_by_design: candidate.biased_by_design(),
                rungs,
            }
        })
        .collect()
}

/// Figures and conclusions of one scene.
fn scene_study(bench: &Bench, subject: &Subject, all: &[Runs], folder: &Path) -> Result<SceneStudy> {
    let mut configurations = Vec::new();
    for runs in all {
        configurations.push(configuration_study(subject, runs, &bench.plan.layers, folder)?);
    }
    let baseline = bench.plan.baseline.clone().unwrap_or_else(|| all[0].name.clone());
    let base = configurations.iter().find(|c| c.name == baseline);
    let comparisons = base.map_or_else(Vec::new, |base| {
        configurations.iter().filter(|c| c.name != baseline).map(|c| conclude::compare(base, c)).collect()
    });
    let mut targets: Vec<String> = Vec::new();
    for figure in configurations.iter().flat_map(|c| &c.rungs).flat_map(|r| &r.figures) {
        if !targets.contains(&figure.target) {
            targets.push(figure.target.clone());
        }
    }
    Ok(SceneStudy {
        name: subject.plan.name.clone(),
        file: subject.plan.file.display().to_string(),
        size: subject.size,
        reference: reference(subject.truth.as_ref()),
        targets,
        baseline,
        configurations,
        comparisons,
    })
}

fn reference(truth: Option<&Truth>) -> Reference {
    let Some(truth) = truth else { return Reference::Replicates };
    let noise = ReferenceNoise::of(truth.colour(), None);
    Reference::Picture {
        file: truth.file.clone(),
        provenance: truth.provenance.clone(),
        variance: truth.variance_from.clone(),
        noise_mse: noise.mse,
        noise_rel_mse: noise.rel_mse,
    }
}

/// Pictures of the runs of a rung with their error layers, where they have one.
fn read_rung(folder: &Path, runs: &[Run]) -> Result<(Vec<Image>, Vec<WithError>)> {
    let (mut images, mut with_error) = (Vec::new(), Vec::new());
    for run in runs {
        let file = path(folder, run);
        let (picture, image) = Image::read(&file)?;
        if let Some(error) = Image::of(&picture, Some("error")) {
            with_error.push(WithError { image: image.clone(), error });
        }
        images.push(image);
    }
    Ok((images, with_error))
}

fn configuration_study(
    subject: &Subject,
    runs: &Runs,
    layers: &[String],
    folder: &Path,
) -> Result<ConfigurationStudy> {
    let truth = subject.truth.as_ref();
    let (mut rungs, mut covered, mut bias, mut noise) = (Vec::new(), Vec::new(), None, None);
    for (index, list) in runs.rungs.iter().enumerate() {
        let (images, with_error) = read_rung(folder, list)?;
        let measured = measured(subject, list, layers, folder)?;
        let rung = rung(list, &measured, subject);
        // What the reference does not show has no true error there.
        let shown = truth.filter(|_| runs.biased_by_design.is_none());
        covered.extend(coverage(&with_error, shown, &rung.budget, rung.samples_per_pixel));
        if index + 1 == runs.rungs.len() {
            bias = truth.and_then(|truth| bias_test(&images, truth, &rung.budget));
            noise = super::noise::noise(&images, &rung.budget);
        }
        rungs.push(rung);
    }
    Ok(ConfigurationStudy {
        name: runs.name.clone(),
        settings: runs.settings.clone(),
        external: runs.external,
        biased_by_design: runs.biased_by_design.clone(),
        fits: conclude::fits(&rungs),
        time_to: conclude::time_to(&rungs),
        bias,
        noise,
        calibration: calibration(covered),
        rungs,
    })
}

/// What each run measures: from the ledger where that was against today's
/// reference, else anew; without a reference, from the spread.
fn measured(subject: &Subject, list: &[Run], layers: &[String], folder: &Path) -> Result<Vec<Vec<Measured>>> {
    if subject.truth.is_none() {
        return spread_of(subject, list, layers, folder);
    }
    list.iter()
        .map(|run| {
            if run.measured_against == subject.measured_against {
                return Ok(run.figures.clone());
            }
            subject.figures(&read_picture(&path(folder, run))?)
        })
        .collect()
}

/// The spread of the runs of a rung, in colour and in each layer.
fn spread_of(
    subject: &Subject,
    list: &[Run],
    layers: &[String],
    folder: &Path,
) -> Result<Vec<Vec<Measured>>> {
    let pictures = list.iter().map(|run| read_picture(&path(folder, run))).collect::<Result<Vec<_>>>()?;
    let mut all = vec![Vec::new(); list.len()];
    for layer in std::iter::once(None).chain(layers.iter().map(|l| Some(l.as_str()))) {
        let name = layer.unwrap_or("colour");
        let images: Option<Vec<Image>> = pictures.iter().map(|p| Image::of(p, layer)).collect();
        let images = images.ok_or_else(|| Error::new(format!("a picture has no {name}")))?;
        for (run, more) in all.iter_mut().zip(spread(&images, name, &subject.regions)) {
            run.extend(more);
        }
    }
    Ok(all)
}

/// The means of all runs of one budget.
fn rung(list: &[Run], measured: &[Vec<Measured>], subject: &Subject) -> Rung {
    let values = |of: fn(&Run) -> f64| list.iter().map(of).collect::<Vec<f64>>();
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let (cpu_seconds, wall_seconds) = (values(|r| r.cpu_seconds), values(|r| r.wall_seconds));
    let figures = measured.first().map_or_else(Vec::new, |first| {
        first
            .iter()
            .enumerate()
            .map(|(k, (target, metric, _))| {
                let runs = measured.iter().map(|m| m[k].2.unwrap_or(f64::NAN)).collect();
                figure(target, *metric, runs, floor(subject, target, *metric))
            })
            .collect()
    });
    let mut rung = Rung {
        budget: list[0].budget.clone(),
        samples_per_pixel: mean(values(|r| r.samples_per_pixel as f64)),
        cpu: mean_interval(&cpu_seconds),
        wall: mean_interval(&wall_seconds),
        cpu_seconds,
        wall_seconds,
        reported_error: mean(values(|r| r.reported_error)),
        figures,
        efficiency: Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN },
    };
    rung.efficiency = conclude::efficiency(&rung);
    rung
}

/// What the reference's noise adds to a metric of a target.
fn floor(subject: &Subject, target: &str, metric: Metric) -> f64 {
    let Some(truth) = &subject.truth else { return 0.0 };
    let parts = truth.targets.iter().flat_map(|t| {
        let whole = std::iter::once((t.name.clone(), t, None));
        whole.chain(subject.regions.iter().map(move |r| (target_in(&t.name, &r.name), t, Some(&r.inside))))
    });
    parts
        .filter(|(name, _, _)| name == target)
        .map(|(_, t, inside)| ReferenceNoise::of(t, inside.map(Vec::as_slice)).of_metric(metric))
        .next()
        .unwrap_or(0.0)
}

/// Where it ran, and how busy it was with it.
fn machine(runs: &[Run]) -> Machine {
    let threads = runs.iter().map(|r| r.threads).max().unwrap_or(0);
    let cpu: f64 = runs.iter().map(|r| r.cpu_seconds).sum();
    let wall: f64 = runs.iter().map(|r| r.wall_seconds * r.threads as f64).sum();
    Machine {
        cpu: processor(),
        cores: std::thread::available_parallelism().map_or(0, usize::from),
        threads,
        load: cpu / wall,
    }
}

/// Name of the processor where the system tells (Linux), else its architecture.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

fn notes<'a>(
    runs: &[Run],
    machine: &Machine,
    bench: &Bench,
    configurations: impl Iterator<Item = &'a ConfigurationStudy>,
) -> Vec<String> {
    let mut notes = Vec::new();
    if machine.load < LOADED {
        notes.push(format!(
            "The renders had {:.0} % of their threads' time: something else ran too, or they were too short. \
             CPU seconds are compared, which suffer less than wall-clock seconds.",
            100.0 * machine.load
        ));
    }
    let asked: usize = bench.subjects.iter().map(|s| s.candidates.len()).sum::<usize>()
        * bench.budgets.len()
        * bench.plan.repeats as usize;
    if runs.len() < asked {
        notes.push(format!("{} of {asked} runs are done.", runs.len()));
    }
    if bench.plan.repeats < 5 {
        notes.push(format!(
            "With {} runs of each rung the intervals are wide and lean on the assumption that the logarithms \
             of the errors are normal; 8 or more are better.",
            bench.plan.repeats
        ));
    }
    let few = configurations.flat_map(|c| &c.rungs).filter(|r| r.figures.is_empty()).count();
    if few > 0 {
        notes.push(format!("{few} rungs have no error: without a reference it takes three runs of a rung."));
    }
    let bad: u64 = runs.iter().map(|r| r.bad_samples).sum();
    if bad > 0 {
        notes.push(format!("{bad} samples were no radiance and were left out{}.", causes(runs)));
    }
    notes
}

/// Why samples were left out, in which run the first: its file's header says
/// where in the picture.
fn causes(runs: &[Run]) -> String {
    let of = |k: usize| runs.iter().filter_map(|r| r.bad_causes.get(k)).sum::<u64>();
    let causes: Vec<String> = (0..Cause::ALL.len())
        .filter(|k| of(*k) > 0)
        .map(|k| format!("{} {}", Cause::ALL[k].name(), of(k)))
        .collect();
    let first =
        runs.iter().find(|r| r.bad_samples > 0).map_or(String::new(), |r| r.image.display().to_string());
    if causes.is_empty() {
        String::new()
    } else {
        format!(" ({}; see the header of {first})", causes.join(", "))
    }
}

/// The scene's picture of each configuration for the viewer: the first run of
/// the largest rung.
fn pictures(subject: &Subject, all: &[Runs], folder: &Path) -> Result<Vec<Exhibit>> {
    let mut exhibits = Vec::new();
    let mut add = |label: String, image: Image| {
        exhibits.push(Exhibit {
            scene: subject.plan.name.clone(),
            label,
            size: [image.width, image.height],
            rgb: image.rgb,
        });
    };
    if let Some(truth) = &subject.truth {
        add("reference".to_owned(), truth.colour().mean.clone());
    }
    for runs in all {
        if let Some(run) = runs.rungs.last().map(|rung| &rung[0]) {
            add(format!("{}, {}", runs.name, run.budget), Image::read(&path(folder, run))?.1);
        }
    }
    Ok(exhibits)
}

/// Where a run's picture lies.
fn path(folder: &Path, run: &Run) -> PathBuf {
    // An absolute path stays as it is.
    folder.join(&run.image)
}
