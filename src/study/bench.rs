//! Runs a plan: every configuration, budget and repeat once, in random order,
//! so that a machine that drifts hurts all alike; each on an untouched clock.
//!
//! What is timed is rendering alone: scenes are loaded and built before, and
//! pictures written and measured after, all of which is listed apart. Before
//! the clock of a scene starts for the first time, it is rendered once with one
//! sample per pixel, so that no run pays for cold memory.

use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::figures::measure;
use super::ledger::{Ledger, Measured, Run};
use super::plan::KEYS;
use super::truth::{RegionMask, Truth, regions};
use super::{Budget, Configuration, Image, Plan, ScenePlan};
use crate::desc::{Error, Fnv, Result};
use crate::film::LayerSet;
use crate::integrator::{Integrator, IntegratorOptions, reuse_named};
use crate::load::load;
use crate::render::{Monitor, Quiet, RenderOptions, RenderStats, Stopped, TileOrder, render};
use crate::sampling::Sequence;
use crate::save::{Header, Options, write_exr};
use crate::scene::{BuildOptions, Scene};
use crate::texture::TextureFilter;

/// Samples per pixel when time is the limit: as good as none.
const MOST_SAMPLES: u64 = 1 << 40;

/// Told how far a study is; may stop it.
pub trait Watch: Sync {
    /// Run `done` of `total` begins; `share` of all work is done.
    fn run(&self, done: usize, total: usize, share: f64, what: &str);

    /// True when the study should end; the run in progress is thrown away.
    fn stop(&self) -> bool;

    /// Something worth telling at once.
    fn warn(&self, text: &str);
}

/// A scene with what it is measured against.
pub struct Subject {
    /// What the plan says.
    pub plan: ScenePlan,
    /// Its reference.
    pub truth: Option<Truth>,
    /// Regions measured apart.
    pub regions: Vec<RegionMask>,
    /// Width and height of its pictures.
    pub size: [u32; 2],
    /// Hash of reference and regions.
    pub measured_against: String,
    /// Its configurations, in the order of the plan.
    pub candidates: Vec<Candidate>,
}

/// A configuration of a scene, ready to render.
pub struct Candidate {
    /// What is varied.
    pub configuration: Configuration,
    /// Its name.
    pub name: String,
    scene: Rc<Built>,
    /// How it estimates radiance.
    pub integrator: Integrator,
    sequence: Sequence,
}

impl Candidate {
    /// What it leaves out of the rendering equation that the scene's own
    /// integrator computes, if it does.
    #[must_use]
    pub fn biased_by_design(&self) -> Option<String> {
        let own = self.integrator.bias_ledger(&self.scene.scene);
        (own != self.scene.own_bias).then_some(own)
    }
}

/// A scene as built for some parameters and accelerator.
struct Built {
    scene: Scene,
    desc: crate::desc::SceneDesc,
    hash: u64,
    /// The bias ledger of the file's own integrator.
    own_bias: String,
    seconds: f64,
}

/// Everything that is decided before the first run.
pub struct Bench {
    /// The plan.
    pub plan: Plan,
    /// The rungs.
    pub budgets: Vec<Budget>,
    /// The scenes.
    pub subjects: Vec<Subject>,
    folder: PathBuf,
    /// Hash of the program: another build may make other pictures, in another time.
    program: u64,
}

/// One run to do: indices of subject, candidate and budget, and the repeat.
#[derive(Clone, Copy, Debug)]
struct Task {
    subject: usize,
    candidate: usize,
    budget: usize,
    repeat: u32,
}

impl Bench {
    /// Loads and builds all that the plan needs.
    ///
    /// # Errors
    /// Whatever is wrong with the plan, a scene or a reference.
    pub fn prepare(mut plan: Plan, folder: &Path, watch: &dyn Watch) -> Result<Bench> {
        plan.check()?;
        let budgets = plan.budgets()?;
        let configurations = plan.configurations()?;
        let subjects = plan
            .scenes
            .iter()
            .map(|scene| Subject::new(scene, &plan.layers, &configurations, watch))
            .collect::<Result<_>>()?;
        Ok(Bench { plan, budgets, subjects, folder: folder.to_owned(), program: program() })
    }

    /// Runs what the ledger does not have yet. False when it was stopped.
    ///
    /// # Errors
    /// Files that cannot be written, threads that cannot be started.
    pub fn run(&self, ledger: &mut Ledger, watch: &dyn Watch) -> Result<bool> {
        let mut tasks = self.tasks();
        let total = tasks.len();
        tasks.retain(|(key, _)| ledger.get(key).is_none());
        // A hash of the key orders them: at random, but the same after a restart.
        tasks.sort_by_key(|(key, _)| hash_of(&format!("order {key}")));
        let work = |task: &Task| match self.budgets[task.budget] {
            Budget::Samples(n) => n as f64 * f64::from(self.subjects[task.subject].area()),
            Budget::Seconds(s) => s,
        };
        let all: f64 = tasks.iter().map(|(_, t)| work(t)).sum();
        let (mut behind, mut warm) = (0.0, vec![false; self.subjects.len()]);
        let before = total - tasks.len();
        for (index, (key, task)) in tasks.iter().enumerate() {
            if watch.stop() {
                return Ok(false);
            }
            let subject = &self.subjects[task.subject];
            watch.run(before + index, total, behind / all, &self.describe(task));
            if !std::mem::replace(&mut warm[task.subject], true) {
                self.warm_up(subject)?;
            }
            let Some(run) = self.run_one(key, task, watch)? else { return Ok(false) };
            ledger.add(run)?;
            behind += work(task);
        }
        watch.run(total, total, 1.0, "");
        Ok(true)
    }

    /// The folder of the report.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The keys of the runs of a configuration and rung, in the order of repeats.
    #[must_use]
    pub fn keys(&self, subject: usize, candidate: usize, budget: usize) -> Vec<String> {
        (0..self.plan.repeats).map(|repeat| self.key(&Task { subject, candidate, budget, repeat })).collect()
    }

    fn tasks(&self) -> Vec<(String, Task)> {
        let mut tasks = Vec::new();
        for (subject, s) in self.subjects.iter().enumerate() {
            for candidate in 0..s.candidates.len() {
                for budget in 0..self.budgets.len() {
                    for repeat in 0..self.plan.repeats {
                        let task = Task { subject, candidate, budget, repeat };
                        tasks.push((self.key(&task), task));
                    }
                }
            }
        }
        tasks
    }

    /// All that decides the picture of a run. The seed comes from it, so that
    /// no two runs share their random numbers.
    fn key(&self, task: &Task) -> String {
        let subject = &self.subjects[task.subject];
        let candidate = &subject.candidates[task.candidate];
        let text = format!(
            "{:016x} {:016x} {:?} {:?} {:?} {} {} {:?} {} {}",
            self.program,
            candidate.scene.hash,
            subject.plan.size,
            subject.plan.crop,
            candidate.configuration.settings,
            self.budgets[task.budget].label(),
            task.repeat,
            self.plan.layers,
            self.plan.seed,
            self.plan.threads,
        );
        format!("{:016x}", hash_of(&text))
    }

    fn describe(&self, task: &Task) -> String {
        let subject = &self.subjects[task.subject];
        format!(
            "{}: {}, {}",
            subject.plan.name,
            subject.candidates[task.candidate].name,
            self.budgets[task.budget].label()
        )
    }

    fn options(&self, budget: Budget, candidate: &Candidate, seed: u64) -> RenderOptions {
        let has = |name: &str| self.plan.layers.iter().any(|l| l == name);
        let layers = LayerSet {
            error: true,
            albedo: has("albedo"),
            normal: has("N"),
            position: has("P"),
            ..LayerSet::default()
        };
        let (samples_per_pixel, time) = match budget {
            Budget::Samples(n) => (n, None),
            Budget::Seconds(s) => (MOST_SAMPLES, Some(Duration::from_secs_f64(s))),
        };
        RenderOptions {
            samples_per_pixel,
            time,
            error: None,
            replicas: 0,
            seed,
            sequence: candidate.sequence,
            threads: self.plan.threads,
            layers,
            order: TileOrder::CentreOut,
        }
    }

    /// Renders once for each scene and tree, for the caches.
    fn warm_up(&self, subject: &Subject) -> Result<()> {
        let mut seen: Vec<*const Built> = Vec::new();
        for candidate in &subject.candidates {
            let built = Rc::as_ptr(&candidate.scene);
            if !seen.contains(&built) {
                seen.push(built);
                let options = self.options(Budget::Samples(1), candidate, 0);
                render(&candidate.scene.scene, &candidate.integrator, &options, &Quiet)?;
            }
        }
        Ok(())
    }

    /// A run and its line for the ledger; `None` when it was interrupted.
    fn run_one(&self, key: &str, task: &Task, watch: &dyn Watch) -> Result<Option<Run>> {
        let subject = &self.subjects[task.subject];
        let candidate = &subject.candidates[task.candidate];
        let budget = self.budgets[task.budget];
        let seed = hash_of(&format!("seed {key}"));
        let options = self.options(budget, candidate, seed);
        let rendered = render(&candidate.scene.scene, &candidate.integrator, &options, &Stopper(watch))?;
        let stats = rendered.stats;
        if stats.stopped == Stopped::Interrupted {
            return Ok(None);
        }
        let clock = Instant::now();
        let picture = rendered.film.resolve();
        let image = PathBuf::from("runs").join(file_name(&self.describe(task), task.repeat, key));
        let header = header(&stats, &options, candidate);
        write_exr(&self.folder.join(&image), &picture, &header, Options { half: false })?;
        let save_seconds = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let figures = subject.figures(&crate::load::read_picture(&self.folder.join(&image))?)?;
        if stats.bad.total() > 0 {
            watch.warn(&format!("{}: samples left out: {}", self.describe(task), stats.bad.summary()));
        }
        Ok(Some(Run {
            key: key.to_owned(),
            scene: subject.plan.name.clone(),
            configuration: candidate.name.clone(),
            budget: budget.label(),
            repeat: task.repeat,
            image,
            seed,
            samples_per_pixel: stats.samples_per_pixel,
            wall_seconds: stats.wall_seconds,
            cpu_seconds: stats.cpu_seconds,
            prepare_seconds: candidate.scene.seconds,
            save_seconds,
            measure_seconds: clock.elapsed().as_secs_f64(),
            threads: stats.threads,
            rays: stats.counters.rays(),
            bad_samples: stats.bad.total(),
            bad_causes: stats.bad.counts.to_vec(),
            reported_error: stats.relative_error,
            measured_against: subject.measured_against.clone(),
            figures,
            external: false,
        }))
    }
}

/// Keys and values of a configuration.
type Settings = Vec<(String, String)>;

impl Subject {
    fn new(
        plan: &ScenePlan,
        layers: &[String],
        configurations: &[Configuration],
        watch: &dyn Watch,
    ) -> Result<Subject> {
        let truth = Truth::read(plan, layers)?;
        // What decides how a scene is built, with the scene.
        let mut built: Vec<(Settings, Rc<Built>)> = Vec::new();
        let mut candidates = Vec::new();
        for configuration in configurations {
            let decides =
                |key: &str| matches!(key, "accel" | "bvh" | "texture-filter") || !KEYS.contains(&key);
            let settings: Settings =
                configuration.settings.iter().filter(|(key, _)| decides(key)).cloned().collect();
            let scene = match built.iter().find(|(other, _)| *other == settings) {
                Some((_, scene)) => Rc::clone(scene),
                None => {
                    let scene = Rc::new(Built::new(plan, configuration, watch)?);
                    built.push((settings, Rc::clone(&scene)));
                    scene
                }
            };
            candidates.push(Candidate::new(configuration, scene)?);
        }
        let window = candidates[0].scene.scene.film.window();
        let size = [window.width(), window.height()];
        let regions = regions(plan, size)?;
        let mut subject = Subject {
            plan: plan.clone(),
            truth,
            regions,
            size: size.map(|n| n as u32),
            measured_against: String::new(),
            candidates,
        };
        subject.check_sizes()?;
        subject.measured_against = subject.hash();
        Ok(subject)
    }

    /// Pixels.
    #[must_use]
    pub fn area(&self) -> u32 {
        self.size[0] * self.size[1]
    }

    fn check_sizes(&self) -> Result<()> {
        for candidate in &self.candidates {
            let window = candidate.scene.scene.film.window();
            let size = [window.width() as u32, window.height() as u32];
            if size != self.size {
                return Err(Error::new(format!(
                    "scene `{}`: configurations of different size, {}x{} and {}x{}",
                    self.plan.name, self.size[0], self.size[1], size[0], size[1]
                ))
                .hint("give `size`: only pictures of the same size can be compared"));
            }
        }
        let Some(truth) = &self.truth else { return Ok(()) };
        let mean = &truth.colour().mean;
        if [mean.width as u32, mean.height as u32] == self.size {
            return Ok(());
        }
        Err(Error::new(format!(
            "scene `{}`: the reference `{}` has {}x{} pixels, the picture {}x{}",
            self.plan.name, truth.file, mean.width, mean.height, self.size[0], self.size[1]
        ))
        .hint("give the size of the reference: `size` in the plan, or --size"))
    }

    fn hash(&self) -> String {
        let mut hash = Fnv::default();
        if let Some(truth) = &self.truth {
            truth.add_to(&mut hash);
        }
        for region in &self.regions {
            hash.bytes(region.name.as_bytes());
            region.inside.iter().for_each(|i| hash.bytes(&[u8::from(*i)]));
        }
        format!("{:016x}", hash.value())
    }

    /// What a picture measures against the reference; nothing without one.
    ///
    /// # Errors
    /// A picture of another size, or without a layer.
    pub fn figures(&self, picture: &crate::load::Picture) -> Result<Vec<Measured>> {
        let Some(truth) = &self.truth else { return Ok(Vec::new()) };
        let mut all = Vec::new();
        for target in &truth.targets {
            let layer = (target.name != "colour").then_some(target.name.as_str());
            let image = Image::of(picture, layer)
                .ok_or_else(|| Error::new(format!("a picture has no {}", target.name)))?;
            all.extend(measure(&image, target, &self.regions)?);
        }
        Ok(all)
    }
}

impl Built {
    fn new(plan: &ScenePlan, configuration: &Configuration, watch: &dyn Watch) -> Result<Built> {
        let clock = Instant::now();
        let desc = load(&plan.file, &plan.load_options(configuration)?)?;
        desc.warnings.iter().for_each(|w| watch.warn(w));
        let options = BuildOptions {
            size: plan.size,
            crop: plan.crop,
            accel: configuration.get("accel").map(str::to_owned),
            bvh: configuration.get("bvh").map(str::to_owned),
            texture_filter: configuration
                .get("texture-filter")
                .and_then(TextureFilter::named)
                .unwrap_or_default(),
        };
        let scene = Scene::build(&desc, &options)?;
        let own = Integrator::from_desc(&desc, &IntegratorOptions::default())?;
        desc.new_replacements().iter().for_each(|r| watch.warn(r));
        Ok(Built {
            own_bias: own.bias_ledger(&scene),
            scene,
            hash: desc.content_hash(),
            desc,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}

impl Candidate {
    fn new(configuration: &Configuration, scene: Rc<Built>) -> Result<Candidate> {
        let options = IntegratorOptions {
            name: configuration.get("integrator").map(str::to_owned),
            max_depth: configuration.get("max-depth").and_then(|d| d.parse().ok()),
            reuse: configuration.get("reuse").and_then(reuse_named),
            reuse_unsaid: None,
        };
        let integrator = Integrator::from_desc(&scene.desc, &options)?;
        let sequence = configuration.get("sampler").and_then(Sequence::named).unwrap_or(Sequence::Sobol);
        let name = configuration.name();
        Ok(Candidate { configuration: configuration.clone(), name, scene, integrator, sequence })
    }
}

/// Stops a render when the study is to stop.
struct Stopper<'a>(&'a dyn Watch);

impl Monitor for Stopper<'_> {
    fn progress(&self, _done: u64, _total: u64, _error: Option<f64>) {}

    fn stop(&self) -> bool {
        self.0.stop()
    }
}

/// Hash of the running program; of its version where it cannot be read.
fn program() -> u64 {
    let bytes = std::env::current_exe().and_then(std::fs::read);
    let mut hash = Fnv::default();
    hash.bytes(&bytes.unwrap_or_else(|_| env!("CARGO_PKG_VERSION").into()));
    hash.value()
}

fn hash_of(text: &str) -> u64 {
    let mut hash = Fnv::default();
    hash.bytes(text.as_bytes());
    // FNV leaves its upper bits alike for short, similar texts.
    let mut x = hash.value();
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A readable file name that the key makes unique.
fn file_name(what: &str, repeat: u32, key: &str) -> String {
    let mut name = String::new();
    for c in what.chars().take(80) {
        match c {
            c if c.is_ascii_alphanumeric() || c == '.' => name.push(c),
            _ if name.ends_with('-') => {}
            _ => name.push('-'),
        }
    }
    format!("{name}-{repeat}-{}.exr", &key[..8])
}

fn header(stats: &RenderStats, options: &RenderOptions, candidate: &Candidate) -> Header {
    let text = |name: &str, value: String| (format!("etendue/{name}"), value);
    Header {
        attributes: vec![
            text("version", env!("CARGO_PKG_VERSION").to_owned()),
            text("seed", options.seed.to_string()),
            text("sampler", options.sequence.name().to_owned()),
            text("integrator", candidate.integrator.name().to_owned()),
            text("samples", stats.samples_per_pixel.to_string()),
            text("configuration", candidate.name.clone()),
            text("badSamples", stats.bad.summary()),
            text("badSamplesFirst", stats.bad.places().join("\n")),
        ],
        ..Header::default()
    }
}
