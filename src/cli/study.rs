//! `etendue study`.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use indicatif::ProgressBar;

use super::args::StudyArgs;
use super::progress;
use crate::desc::{Error, Result};
use crate::study::report::write_report;
use crate::study::{
    Bench, Ladder, Ledger, Name, Plan, ScenePlan, Seconds, SeriesPlan, Vary, Watch, gather, scene_name,
    summary, to_csv,
};

/// Runs a study, or goes on with one, and writes its report.
pub fn run(args: &StudyArgs) -> Result<ExitCode> {
    let plan = plan(args)?;
    let watch = Progress::new(args.quiet);
    let bench = Bench::prepare(plan, &args.output, &watch)?;
    let mut ledger = Ledger::open(&args.output)?;
    let finished = args.report_only || bench.run(&mut ledger, &watch)?;
    watch.finish();
    let concluded = gather(&bench, &ledger)?;
    write_report(&args.output, &concluded.study, &concluded.exhibits)?;
    let json = serde_json::to_string_pretty(&concluded.study)
        .map_err(|e| Error::new(format!("cannot write the study as JSON: {e}")))?;
    crate::save::write_file(&args.output.join("study.json"), json.as_bytes())?;
    crate::save::write_file(&args.output.join("study.csv"), to_csv(&concluded.study).as_bytes())?;
    if args.json {
        outln!("{json}");
    } else {
        out!("{}", summary(&concluded.study));
    }
    if !args.quiet {
        say!("wrote {}", args.output.join("index.html").display());
    }
    if !finished {
        say!("interrupted: the report shows what is done; the same command goes on from here");
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// The plan: a file, or a scene and the options that stand for one.
fn plan(args: &StudyArgs) -> Result<Plan> {
    let is_plan = args.subject.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let mut plan = if is_plan {
        if let Some(option) = args.scene_option() {
            return Err(Error::new(format!(
                "`{option}` goes with a scene; the plan file says it for a plan"
            )));
        }
        Plan::read(&args.subject)?
    } else {
        scene_plan(args)?
    };
    if let Some(repeats) = args.repeats {
        plan.repeats = repeats;
    }
    if let Some(threads) = args.threads {
        plan.threads = threads;
    }
    if let Some(seed) = args.seed {
        plan.seed = seed;
    }
    if let Some(spp) = &args.spp {
        (plan.spp, plan.budget) = (Some(Ladder::Range(spp.clone())), None);
    }
    if let Some(budget) = &args.budget {
        (plan.spp, plan.budget) = (None, Some(Seconds::Largest(budget.clone())));
    }
    if args.baseline.is_some() {
        plan.baseline.clone_from(&args.baseline);
    }
    if let Some(title) = &args.title {
        plan.title.clone_from(title);
    }
    for (name, folder) in &args.series {
        let series =
            SeriesPlan { scene: String::new(), name: name.clone(), folder: Path::new(folder).to_owned() };
        plan.series.push(series);
    }
    Ok(plan)
}

fn scene_plan(args: &StudyArgs) -> Result<Plan> {
    let mut vary = Vary::new();
    for (key, values) in &args.vary {
        let list = values.split(',').map(|v| toml::Value::String(v.trim().to_owned())).collect();
        vary.insert(key.clone(), toml::Value::Array(list));
    }
    let define = args.defines.iter().map(|(k, v)| (k.clone(), toml::Value::String(v.clone()))).collect();
    let stage = args.stage.clone();
    let scene = ScenePlan {
        name: scene_name(&args.subject),
        file: args.subject.clone(),
        reference: args.reference.clone(),
        reference_variance: args.ref_variance.clone(),
        size: args.size,
        crop: args.crop,
        define,
        regions: args.regions()?,
        lenient: args.lenient,
        camera: stage.camera.map(Name::Text),
        frame: stage.frame,
        fps: Some(stage.fps),
        shutter: stage.shutter,
        animation: stage.animation.map(Name::Text),
        variant: stage.variant.map(Name::Text),
        env: stage.environment,
        sun: stage.sun,
        allow_outside: stage.allow_outside,
    };
    let spp = (args.budget.is_none()).then(|| Ladder::Range("1..256".to_owned()));
    Ok(Plan { spp, vary, layers: args.layers.clone(), scenes: vec![scene], ..Plan::default() })
}

/// Tells how far a study is: a bar, or plain lines where stderr is no terminal.
struct Progress {
    bar: Option<ProgressBar>,
    quiet: bool,
    start: Instant,
    next_line: AtomicU64,
    announced: AtomicBool,
}

impl Progress {
    fn new(quiet: bool) -> Progress {
        progress::catch_interrupts();
        Progress {
            bar: progress::new_bar(quiet),
            quiet,
            start: Instant::now(),
            next_line: AtomicU64::new(0),
            announced: AtomicBool::new(false),
        }
    }

    fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Watch for Progress {
    fn run(&self, done: usize, total: usize, share: f64, what: &str) {
        if self.quiet {
            return;
        }
        let elapsed = self.start.elapsed().as_secs_f64();
        let left = if share > 0.01 {
            format!("{:.0} s left", elapsed / share - elapsed)
        } else {
            "time left not known yet".to_owned()
        };
        let line = format!("run {} of {total}, {left}; {what}", (done + 1).min(total));
        if let Some(bar) = &self.bar {
            bar.set_position((share * 1000.0) as u64);
            bar.set_message(line);
        } else if elapsed as u64 >= self.next_line.load(Ordering::Relaxed) {
            // At once, and then every twenty seconds.
            self.next_line.store(elapsed as u64 + 20, Ordering::Relaxed);
            say!("{line}");
        }
    }

    fn stop(&self) -> bool {
        let stop = progress::interrupted();
        if stop && !self.announced.swap(true, Ordering::Relaxed) {
            self.warn("interrupted: writing the report of what is done (Ctrl-C again quits at once)");
        }
        stop
    }

    fn warn(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(format!("warning: {text}")),
            None => say!("warning: {text}"),
        }
    }
}
