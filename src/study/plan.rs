//! What a study runs: the plan file (TOML).
//!
//! ```toml
//! title = "Samplers on two scenes"
//! spp = "1..256"            # a ladder: 1, 2, 4, …; or a list [1, 16, 256]; or
//! # budget = "32s"          # seconds of the largest rung; seven rungs, halving down
//! repeats = 8               # independent runs of every rung
//! baseline = "path, padded" # what others are compared with; the first by default
//! layers = ["albedo"]       # layers to measure beside colour: albedo, N, P
//! threads = 0               # one per core
//! seed = 0
//!
//! [vary]                    # every combination is a configuration
//! integrator = ["path", "direct"]
//! sampler = ["sobol", "padded", "independent"]
//!
//! [[scene]]
//! file = "scenes/cornell-box/scene.xml"
//! reference = "refs/cornell-box.exr"
//! reference-variance = "refs/cornell-box.var.exr"   # of its pixel means
//! size = [64, 64]
//! define = { resx = "64" }  # parameters of the scene file
//! regions = { lamp = [20, 0, 24, 8], glass = "glass-mask.png" }
//!
//! [[scene]]                 # what is shown, when, and in which light: as `render` has it
//! file = "scenes/gltf-table/table.glb"
//! camera = "close"          # a name or an index, as `animation` and `variant`
//! frame = 12                # with `fps`, 24 by default
//! shutter = [0, 0.5]
//! env = "sky.hdr"
//! sun = [45, 30]            # degrees above the horizon, and round
//! size = [320, 180]
//!
//! [[series]]                # pictures of another renderer
//! scene = "cornell-box"
//! name = "mitsuba"
//! folder = "runs/mitsuba"
//! ```
//!
//! Paths are relative to the plan file. Keys that can be varied are those of
//! [`KEYS`]; any other key is a parameter of the scene files (`$name`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::desc::{Error, Pos, Result, nearest};
use crate::integrator::{MOST_REUSE, reuse_named};
use crate::load::LoadOptions;
use crate::sampling::Sequence;
use crate::texture::TextureFilter;

/// What `vary` knows beside parameters of scene files.
pub const KEYS: [&str; 7] = ["integrator", "sampler", "accel", "bvh", "max-depth", "reuse", "texture-filter"];

/// Rungs below the largest of a ladder of seconds.
const TIME_RUNGS: u32 = 6;
/// Most runs of one study: more is a slip of the pen.
const MOST_RUNS: usize = 1_000_000;

/// What a study runs.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Plan {
    /// Title of the report.
    #[serde(default)]
    pub title: String,
    /// Samples per pixel of the rungs.
    pub spp: Option<Ladder>,
    /// Seconds of the rungs.
    pub budget: Option<Seconds>,
    /// Independent runs of every rung.
    #[serde(default = "default_repeats")]
    pub repeats: u32,
    /// Name of the configuration that others are compared with.
    pub baseline: Option<String>,
    /// Layers to measure beside colour.
    #[serde(default)]
    pub layers: Vec<String>,
    /// Threads; 0 is one per core.
    #[serde(default)]
    pub threads: usize,
    /// Seed of the seeds.
    #[serde(default)]
    pub seed: u64,
    /// Values by key; every combination is a configuration.
    #[serde(default)]
    pub vary: Vary,
    /// The scenes.
    #[serde(default, rename = "scene")]
    pub scenes: Vec<ScenePlan>,
    /// Pictures of other renderers.
    #[serde(default, rename = "series")]
    pub series: Vec<SeriesPlan>,
}

/// What is varied, in the order of the file.
pub type Vary = toml::map::Map<String, toml::Value>;

fn default_repeats() -> u32 {
    8
}

impl Default for Plan {
    /// Nothing to run yet, eight times.
    fn default() -> Plan {
        Plan {
            title: String::new(),
            spp: None,
            budget: None,
            repeats: default_repeats(),
            baseline: None,
            layers: Vec::new(),
            threads: 0,
            seed: 0,
            vary: Vary::new(),
            scenes: Vec::new(),
            series: Vec::new(),
        }
    }
}

/// One scene of a plan.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ScenePlan {
    /// Its name; that of its file or folder by default.
    #[serde(default)]
    pub name: String,
    /// The scene file.
    pub file: PathBuf,
    /// What error is measured against; without it, the spread over the runs.
    pub reference: Option<PathBuf>,
    /// Variance of the reference's pixel means; its own error layer by default.
    pub reference_variance: Option<PathBuf>,
    /// Film size instead of the file's.
    pub size: Option<[u32; 2]>,
    /// Part of the film to render: x, y, width, height.
    pub crop: Option<[u32; 4]>,
    /// Parameters of the scene file.
    #[serde(default)]
    pub define: BTreeMap<String, toml::Value>,
    /// Regions that are measured apart.
    #[serde(default)]
    pub regions: BTreeMap<String, Region>,
    /// Go on where something is not known or not there.
    #[serde(default)]
    pub lenient: bool,
    /// Camera instead of the first.
    pub camera: Option<Name>,
    /// Frame to show, at the time frame / fps.
    pub frame: Option<f64>,
    /// Frames per second; 24 by default.
    pub fps: Option<f64>,
    /// When the shutter opens and closes, in frames after the frame.
    pub shutter: Option<[f64; 2]>,
    /// Animation of a glTF file.
    pub animation: Option<Name>,
    /// Material variant of a glTF file.
    pub variant: Option<Name>,
    /// Image of the surroundings of a glTF file.
    pub env: Option<PathBuf>,
    /// Sun of a glTF file: degrees above the horizon, and round.
    pub sun: Option<[f64; 2]>,
    /// Read files that a glTF file names outside of its own folder.
    #[serde(default)]
    pub allow_outside: bool,
}

/// Which of several things of a scene file.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Name {
    /// By its place in the file, from 0.
    Index(u32),
    /// By its name; digits are an index.
    Text(String),
}

impl ScenePlan {
    /// How the scene is loaded for a configuration.
    ///
    /// # Errors
    /// A parameter that is neither text nor a number.
    pub fn load_options(&self, configuration: &Configuration) -> Result<LoadOptions> {
        let mut defines = Vec::new();
        for (name, value) in &self.define {
            let value = text(value)
                .ok_or_else(|| Error::new(format!("define `{name}`: expected a string or a number")))?;
            defines.push((name.clone(), value));
        }
        defines.extend(configuration.defines());
        let name = |name: &Option<Name>| match name.as_ref()? {
            Name::Index(index) => Some(index.to_string()),
            Name::Text(text) => Some(text.clone()),
        };
        let usual = LoadOptions::default();
        Ok(LoadOptions {
            defines,
            lenient: self.lenient,
            camera: name(&self.camera),
            environment: self.env.clone(),
            sun: self.sun,
            variant: name(&self.variant),
            animation: name(&self.animation),
            frame: self.frame,
            fps: self.fps.unwrap_or(usual.fps),
            shutter: self.shutter,
            allow_outside: self.allow_outside,
            ..usual
        })
    }
}

/// Part of a picture.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Region {
    /// x, y, width, height in pixels of the picture.
    Rectangle([u32; 4]),
    /// Where a picture of the same size is brighter than one half.
    Mask(PathBuf),
}

/// Pictures of another renderer: a folder with one CSV file that names them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SeriesPlan {
    /// Name of the scene they show; may be left out where there is one only.
    #[serde(default)]
    pub scene: String,
    /// Name of the series.
    pub name: String,
    /// The folder.
    pub folder: PathBuf,
}

/// A ladder of sample counts.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Ladder {
    /// These.
    List(Vec<u64>),
    /// `A..B`: A and its doubles up to B.
    Range(String),
    /// One rung.
    One(u64),
}

/// A ladder of seconds: these, or `60s` and its halves.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Seconds {
    /// These.
    List(Vec<f64>),
    /// The largest, as `60s`, `1.5m` or a number of seconds.
    Largest(String),
    /// The largest in seconds.
    Number(f64),
}

/// What one run is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Samples per pixel.
    Samples(u64),
    /// Wall-clock seconds of rendering.
    Seconds(f64),
}

impl Budget {
    /// As `64 spp` or `0.5 s`.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Budget::Samples(n) => format!("{n} spp"),
            Budget::Seconds(s) => format!("{s} s"),
        }
    }
}

/// One combination of what is varied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// Key and value, in the order of the plan.
    pub settings: Vec<(String, String)>,
}

impl Configuration {
    /// As `path, sobol`; `as the file says` when nothing is varied.
    #[must_use]
    pub fn name(&self) -> String {
        if self.settings.is_empty() {
            return "as the file says".to_owned();
        }
        // `bvh` and numbers mean nothing without their key.
        let word = |(key, value): &(String, String)| match key.as_str() {
            "integrator" | "sampler" | "accel" => value.clone(),
            _ => format!("{key} {value}"),
        };
        self.settings.iter().map(word).collect::<Vec<_>>().join(", ")
    }

    /// The value of a key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&str> {
        self.settings.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }

    /// Parameters of the scene file among the settings.
    pub fn defines(&self) -> impl Iterator<Item = (String, String)> + '_ {
        self.settings.iter().filter(|(k, _)| !KEYS.contains(&k.as_str())).cloned()
    }
}

/// Whether a key of [`KEYS`] has that value.
fn check_value(key: &str, value: &str) -> Result<()> {
    let (known, what, hint) = match key {
        "sampler" => {
            let names = Sequence::ALL.map(Sequence::name).join(", ");
            (Sequence::named(value).is_some(), "sampler", format!("there are {names}"))
        }
        "texture-filter" => {
            let hint = format!("there are {}", TextureFilter::names());
            (TextureFilter::named(value).is_some(), "texture filter", hint)
        }
        "reuse" => {
            let hint = format!("a number of pixels from 1 to {MOST_REUSE}, or auto");
            (reuse_named(value).is_some(), "reuse", hint)
        }
        "max-depth" if value.parse::<i64>().is_err() => {
            return Err(Error::new(format!("vary `max-depth`: `{value}` is no whole number")));
        }
        _ => return Ok(()),
    };
    if known { Ok(()) } else { Err(Error::new(format!("there is no {what} `{value}`")).hint(hint)) }
}

impl Plan {
    /// Reads a plan file.
    ///
    /// # Errors
    /// What cannot be read or means nothing, with line and column.
    pub fn read(path: &Path) -> Result<Plan> {
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::new(format!("cannot read the plan `{}`: {e}", path.display())))?;
        let mut plan = Plan::parse(&text, &path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new("."));
        plan.paths_relative_to(folder);
        Ok(plan)
    }

    /// Reads a plan from text; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn parse(text: &str, file: &str) -> Result<Plan> {
        toml::from_str(text).map_err(|e| {
            let at = e.span().map_or(0, |span| span.start).min(text.len());
            let before = text.get(..at).unwrap_or_default();
            let line = before.matches('\n').count() + 1;
            let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
            let pos = Pos { line: line as u32, column: column as u32, ..Pos::default() };
            Error::new(e.message().trim().to_owned()).at(file.to_owned(), pos)
        })
    }

    fn paths_relative_to(&mut self, folder: &Path) {
        let join = |path: &mut PathBuf| *path = folder.join(&*path);
        for scene in &mut self.scenes {
            join(&mut scene.file);
            let files = scene.reference.iter_mut().chain(&mut scene.reference_variance).chain(&mut scene.env);
            files.for_each(join);
            for region in scene.regions.values_mut() {
                if let Region::Mask(path) = region {
                    join(path);
                }
            }
        }
        self.series.iter_mut().for_each(|s| join(&mut s.folder));
    }

    /// Fills in names, and checks what can be checked without reading scenes.
    ///
    /// # Errors
    /// A plan that runs nothing, or names what does not exist.
    pub fn check(&mut self) -> Result<()> {
        if self.scenes.is_empty() {
            return Err(Error::new("the study has no scene").hint("add a [[scene]] with `file`"));
        }
        if self.repeats == 0 {
            return Err(Error::new("`repeats` must be at least 1"));
        }
        for scene in &mut self.scenes {
            if scene.name.is_empty() {
                scene.name = scene_name(&scene.file);
            }
        }
        if self.repeats < 3
            && let Some(scene) = self.scenes.iter().find(|s| s.reference.is_none())
        {
            let message =
                format!("scene `{}` has no reference: its error is the spread of the runs", scene.name);
            return Err(Error::new(message).hint("three `repeats` at least, or a `reference`"));
        }
        let names: Vec<&str> = self.scenes.iter().map(|s| s.name.as_str()).collect();
        if let Some(twice) = names.iter().enumerate().find(|(i, n)| names[..*i].contains(n)) {
            return Err(Error::new(format!("two scenes are called `{}`", twice.1))
                .hint("give one of them another `name`"));
        }
        let only = if let [only] = names.as_slice() { Some((*only).to_owned()) } else { None };
        let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        for series in &mut self.series {
            if let (true, Some(only)) = (series.scene.is_empty(), &only) {
                series.scene.clone_from(only);
            }
            if !names.contains(&series.scene) {
                let message = format!("series `{}`: there is no scene `{}`", series.name, series.scene);
                return Err(Error::new(message).hint(format!("there are {}", names.join(", "))));
            }
        }
        let configurations = self.configurations()?;
        let mut taken: Vec<(String, String)> = Vec::new();
        for series in &self.series {
            let name = (series.scene.clone(), series.name.clone());
            if taken.contains(&name) || configurations.iter().any(|c| c.name() == series.name) {
                return Err(Error::new(format!("the name of the series `{}` is taken", series.name)));
            }
            taken.push(name);
        }
        for layer in &self.layers {
            if !["albedo", "N", "P"].contains(&layer.as_str()) {
                return Err(Error::new(format!("there is no layer `{layer}` to measure"))
                    .hint("there are albedo, N, P; colour is always measured"));
            }
        }
        let factors = [configurations.len(), self.budgets()?.len(), self.repeats as usize];
        let runs = factors.into_iter().fold(self.scenes.len(), usize::saturating_mul);
        if runs > MOST_RUNS {
            return Err(Error::new(format!("the plan asks for {runs} runs; at most {MOST_RUNS} make sense")));
        }
        if self.title.is_empty() {
            self.title = format!("Study of {}", names.join(", "));
        }
        self.check_baseline(&configurations)
    }

    fn check_baseline(&self, configurations: &[Configuration]) -> Result<()> {
        let Some(baseline) = &self.baseline else { return Ok(()) };
        let mut names: Vec<String> = configurations.iter().map(Configuration::name).collect();
        names.extend(self.series.iter().map(|s| s.name.clone()));
        if names.contains(baseline) {
            return Ok(());
        }
        let error = Error::new(format!("the baseline `{baseline}` is not among the configurations"));
        Err(match nearest(baseline, names.iter().map(String::as_str)) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint(format!("there are {}", names.join("; "))),
        })
    }

    /// Every combination of what is varied.
    ///
    /// # Errors
    /// Values that are no list, or empty, or unknown samplers.
    pub fn configurations(&self) -> Result<Vec<Configuration>> {
        let mut count: usize = 1;
        let mut varied = Vec::new();
        for (key, values) in &self.vary {
            let values = texts(values)
                .ok_or_else(|| Error::new(format!("vary `{key}`: expected a list of strings or numbers")))?;
            if values.is_empty() {
                return Err(Error::new(format!("vary `{key}`: the list is empty")));
            }
            values.iter().try_for_each(|value| check_value(key, value))?;
            count = count.saturating_mul(values.len());
            varied.push((key, values));
        }
        if count > MOST_RUNS {
            let message = format!("what is varied combines to more than {MOST_RUNS} configurations");
            return Err(Error::new(message));
        }
        let mut all = vec![Configuration { settings: Vec::new() }];
        for (key, values) in varied {
            let with = |c: &Configuration, value: &String| {
                let settings = c.settings.iter().cloned().chain([(key.clone(), value.clone())]).collect();
                Configuration { settings }
            };
            all = all.iter().flat_map(|c| values.iter().map(|value| with(c, value))).collect();
        }
        Ok(all)
    }

    /// The rungs, smallest first.
    ///
    /// # Errors
    /// None, both kinds, or one that is not above 0.
    pub fn budgets(&self) -> Result<Vec<Budget>> {
        let mut budgets = match (&self.spp, &self.budget) {
            (Some(_), Some(_)) => return Err(Error::new("`spp` and `budget` exclude each other")),
            (None, None) => {
                return Err(Error::new("the study has no budget").hint("say `spp` or `budget`"));
            }
            (Some(ladder), None) => ladder.samples()?.into_iter().map(Budget::Samples).collect::<Vec<_>>(),
            (None, Some(seconds)) => seconds.seconds()?.into_iter().map(Budget::Seconds).collect::<Vec<_>>(),
        };
        let size = |b: &Budget| match *b {
            Budget::Samples(n) => n as f64,
            Budget::Seconds(s) => s,
        };
        budgets.sort_by(|a, b| size(a).total_cmp(&size(b)));
        budgets.dedup();
        if budgets.is_empty() || budgets.iter().any(|b| !(size(b) > 0.0 && size(b).is_finite())) {
            return Err(Error::new("every budget must be above 0"));
        }
        Ok(budgets)
    }
}

impl Ladder {
    fn samples(&self) -> Result<Vec<u64>> {
        match self {
            Ladder::List(list) => Ok(list.clone()),
            Ladder::One(n) => Ok(vec![*n]),
            Ladder::Range(text) => ladder(text)
                .ok_or_else(|| Error::new(format!("`{text}` is no ladder: expected A..B, as 1..1024"))),
        }
    }
}

/// A, 2A, 4A … up to B; B itself always.
fn ladder(text: &str) -> Option<Vec<u64>> {
    let Some((from, to)) = text.split_once("..") else {
        return text.split(',').map(|n| n.trim().parse().ok()).collect();
    };
    let (from, to) = (from.trim().parse::<u64>().ok()?, to.trim().parse::<u64>().ok()?);
    if from == 0 || to < from {
        return None;
    }
    let mut rungs: Vec<u64> =
        std::iter::successors(Some(from), |n| n.checked_mul(2)).take_while(|n| *n < to).collect();
    rungs.push(to);
    Some(rungs)
}

impl Seconds {
    fn seconds(&self) -> Result<Vec<f64>> {
        let halves = |largest: f64| (0..=TIME_RUNGS).map(|k| largest / 2f64.powi(k as i32)).collect();
        match self {
            Seconds::List(list) => Ok(list.clone()),
            Seconds::Number(largest) => Ok(halves(*largest)),
            Seconds::Largest(text) => seconds(text)
                .map(halves)
                .ok_or_else(|| Error::new(format!("`{text}` is no time: expected seconds, as 60s"))),
        }
    }
}

/// `90`, `90s`, `1.5m` or `1h` in seconds.
fn seconds(text: &str) -> Option<f64> {
    let text = text.trim();
    let (number, unit) = match text.chars().last()? {
        's' => (&text[..text.len() - 1], 1.0),
        'm' => (&text[..text.len() - 1], 60.0),
        'h' => (&text[..text.len() - 1], 3600.0),
        _ => (text, 1.0),
    };
    number.trim().parse::<f64>().ok().map(|n| n * unit)
}

/// A list of scalars as text; a single one counts as a list.
fn texts(value: &toml::Value) -> Option<Vec<String>> {
    match value {
        toml::Value::Array(list) => list.iter().map(text).collect(),
        single => Some(vec![text(single)?]),
    }
}

/// A scalar as a scene file would write it.
fn text(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(s) => Some(s.clone()),
        toml::Value::Integer(n) => Some(n.to_string()),
        toml::Value::Float(x) => Some(x.to_string()),
        toml::Value::Boolean(b) => Some(b.to_string()),
        _ => None,
    }
}

/// A file's name; a `scene.xml` goes by that of its folder.
#[must_use]
pub fn scene_name(path: &Path) -> String {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = path.parent().and_then(Path::file_name).map(|s| s.to_string_lossy().into_owned());
    match folder {
        Some(folder) if stem == "scene" => folder,
        _ => stem,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ladders() {
        assert_eq!(ladder("1..16"), Some(vec![1, 2, 4, 8, 16]));
        assert_eq!(ladder("3..20"), Some(vec![3, 6, 12, 20]));
        assert_eq!(ladder("1,16,256"), Some(vec![1, 16, 256]));
        assert_eq!([ladder("0..4"), ladder("8..4"), ladder("a..b")], [None, None, None]);
        assert_eq!(
            [seconds("60s"), seconds("1.5m"), seconds("2"), seconds("x")],
            [Some(60.0), Some(90.0), Some(2.0), None]
        );
    }

    #[test]
    fn combinations_keep_the_order_of_the_plan() {
        let text = r#"
            spp = "4..8"
            [vary]
            sampler = ["sobol", "independent"]
            max-depth = [2, 8]
            [[scene]]
            file = "scenes/a/scene.xml"
        "#;
        let mut plan = Plan::parse(text, "plan.toml").expect("a plan");
        plan.check().expect("a good plan");
        let names: Vec<String> =
            plan.configurations().expect("four").iter().map(Configuration::name).collect();
        assert_eq!(
            names,
            [
                "sobol, max-depth 2",
                "sobol, max-depth 8",
                "independent, max-depth 2",
                "independent, max-depth 8"
            ]
        );
        assert_eq!(plan.budgets().expect("two"), [Budget::Samples(4), Budget::Samples(8)]);
        assert_eq!(plan.scenes[0].name, "a");
    }

    #[test]
    fn scenes_are_shown_as_the_plan_says() {
        let text = r#"
            spp = 4
            [vary]
            lamp = [1, 2]
            [[scene]]
            file = "model.glb"
            camera = 2
            animation = "walk"
            variant = "red"
            frame = 12
            fps = 30.0
            shutter = [0, 0.5]
            env = "sky.hdr"
            sun = [45, -30]
            allow-outside = true
            define = { resx = 8 }
            [[scene]]
            file = "other.glb"
        "#;
        let mut plan = Plan::parse(text, "plan.toml").expect("a plan");
        plan.paths_relative_to(Path::new("plans"));
        let configurations = plan.configurations().expect("two");
        let options = plan.scenes[0].load_options(&configurations[1]).expect("options");
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(options.defines, [pair("resx", "8"), pair("lamp", "2")]);
        let named = [&options.camera, &options.animation, &options.variant];
        assert_eq!(named.map(Option::as_deref), [Some("2"), Some("walk"), Some("red")]);
        assert_eq!((options.frame, options.fps, options.shutter), (Some(12.0), 30.0, Some([0.0, 0.5])));
        assert_eq!((options.environment, options.sun), (Some("plans/sky.hdr".into()), Some([45.0, -30.0])));
        assert!(options.allow_outside && !options.lenient);
        let plain = plan.scenes[1].load_options(&configurations[0]).expect("options");
        assert_eq!((plain.camera, plain.frame, plain.fps, plain.allow_outside), (None, None, 24.0, false));
    }

    #[test]
    fn what_means_nothing_is_an_error_with_its_place() {
        let message = |text: &str| match Plan::parse(text, "p.toml").and_then(|mut p| p.check()) {
            Ok(()) => panic!("{text} is accepted"),
            Err(e) => e.to_string(),
        };
        assert!(message("spp = 4\nrepeat = 3\n").starts_with("p.toml:2:1: unknown field `repeat`"));
        assert!(message("spp = 4\n").contains("the study has no scene"));
        let scene = "[[scene]]\nfile = \"a.xml\"\n";
        assert!(message(scene).contains("no budget"));
        assert!(message(&format!("spp = 1\nbudget = 2\n{scene}")).contains("exclude each other"));
        assert!(message(&format!("spp = 0\n{scene}")).contains("above 0"));
        assert!(message(&format!("spp = 1\nlayers = [\"Z\"]\n{scene}")).contains("no layer `Z`"));
        assert!(
            message(&format!("spp = 1\n{scene}[vary]\nsampler = [\"sobl\"]\n")).contains("no sampler `sobl`")
        );
        let baseline = format!("spp = 1\nbaseline = \"sobl\"\n{scene}[vary]\nsampler = [\"sobol\"]\n");
        assert!(message(&baseline).contains("did you mean `sobol`?"));
    }
}
