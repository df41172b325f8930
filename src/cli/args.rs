//! The arguments of every command.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::desc::Error;
use crate::film::LayerSet;
use crate::integrator::{IntegratorOptions, MOST_REUSE, reuse_named};
use crate::load::LoadOptions;
use crate::sampling::Sequence;
use crate::scene::BuildOptions;
use crate::study::Region;
use crate::texture::TextureFilter;

/// A path tracer that knows how wrong its picture is.
#[derive(Debug, Parser)]
#[command(name = "etendue", version, arg_required_else_help = true)]
pub struct Etendue {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an EXR file with its error, and a PNG to look at.
    Render(RenderArgs),
    /// Say what a scene needs and what is left out of it.
    Explain(ExplainArgs),
    /// Measure the difference of two images, and whether it is noise.
    Compare(CompareArgs),
    /// Report error against run time: configurations, budgets and independent runs, with intervals.
    Study(StudyArgs),
    /// Build accelerators and, with --bench, race them on the same rays.
    Accel(AccelArgs),
    /// Print one path of a render, vertex by vertex.
    Replay(ReplayArgs),
    /// Check this installation: stiff and extreme cases with known answers, beside other renderers'.
    Selftest(SelftestArgs),
}

/// A scene and what goes over it.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// Scene file: Mitsuba 3 XML, or glTF 2.0 (.gltf, .glb).
    pub scene: PathBuf,
    #[command(flatten)]
    pub stage: StageArgs,
    /// Give a scene parameter (`$name` in the file) another value.
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub defines: Vec<(String, String)>,
    /// Film size instead of the file's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Render only this part of the film; in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_crop)]
    pub crop: Option<[u32; 4]>,
    /// Integrator instead of the file's: path, volpath, direct, whitted, ao or depth.
    #[arg(long, value_name = "NAME")]
    pub integrator: Option<String>,
    /// Longest path instead of the file's: 1 sees lights only, 2 adds direct light, -1 has no limit.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub max_depth: Option<i64>,
    /// Pixels that use each other's paths (2 to 256; 1 for none): less noise of indirect light for a shadow
    /// ray per pixel more. With auto, what render does unless told, a few tiles are tried first, and 16,
    /// 32 or 64 pixels do if that is more efficient. For path and volpath, where nothing moves and nothing is seen
    /// through.
    #[arg(long, value_name = "N|auto", value_parser = parse_reuse)]
    pub reuse: Option<u32>,
    /// Accelerator: bvh8, bvh2, brute, or embree where the program was built with that feature.
    #[arg(long, value_name = "NAME")]
    pub accel: Option<String>,
    /// How textures are read: footprint, averaged over the part of a pixel that a sample stands for, or
    /// point.
    #[arg(long, value_name = "HOW", default_value = "point", value_parser = parse_filter)]
    pub texture_filter: TextureFilter,
    /// Quality of the tree of bvh8: fast to build, or high (the default) to trace.
    #[arg(long, value_name = "QUALITY")]
    pub bvh: Option<String>,
    /// Go on where something is not known or not there: it is replaced or left out, and each replacement
    /// is named.
    #[arg(long)]
    pub lenient: bool,
}

impl SceneArgs {
    pub fn build_options(&self) -> BuildOptions {
        BuildOptions {
            size: self.size,
            crop: self.crop,
            accel: self.accel.clone(),
            bvh: self.bvh.clone(),
            texture_filter: self.texture_filter,
        }
    }

    pub fn integrator_options(&self) -> IntegratorOptions {
        IntegratorOptions {
            name: self.integrator.clone(),
            max_depth: self.max_depth,
            reuse: self.reuse,
            reuse_unsaid: None,
        }
    }
}

/// Frames per second where nothing is said.
pub const FPS: f64 = 24.0;

/// What of a scene is shown, when, and in which light.
#[derive(Clone, Debug, Args)]
pub struct StageArgs {
    /// Camera instead of the first: the name of a glTF camera or its node, the id of a sensor, or an index
    /// from 0.
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Frame to show, at the time N / fps. A glTF file is shown as stored unless this, --shutter or
    /// --animation is given; in a Mitsuba file it moves the shutter by that time.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub frame: Option<f64>,
    /// Frames per second.
    #[arg(long, value_name = "F", default_value_t = FPS, value_parser = parse_positive)]
    pub fps: f64,
    /// When the shutter opens and closes, in frames after the frame: what moves in between is blurred.
    /// 0,0.5 is like film. [default: 0,0 for glTF, the file's for Mitsuba]
    #[arg(long, value_name = "OPEN,CLOSE", value_parser = parse_pair, allow_hyphen_values = true)]
    pub shutter: Option<[f64; 2]>,
    /// Animation of a glTF file: its name or index, all, or none. [default: all]
    #[arg(long, value_name = "NAME|INDEX")]
    pub animation: Option<String>,
    /// Material variant of a glTF file (KHR_materials_variants): its name or index.
    #[arg(long, value_name = "NAME|INDEX")]
    pub variant: Option<String>,
    /// Light a glTF file by an image of the surroundings in latitude and longitude.
    #[arg(long = "env", value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Light a glTF file by a sun: degrees above the horizon, and round from +z towards +x. A blue sky
    /// comes with it unless --env is given.
    #[arg(long, value_name = "UP,ROUND", num_args = 0..=1, default_missing_value = "45,30",
        require_equals = true, value_parser = parse_pair)]
    pub sun: Option<[f64; 2]>,
    /// Read files that a glTF file names outside of its own folder.
    #[arg(long)]
    pub allow_outside: bool,
}

impl StageArgs {
    /// The time asked for in words, for the header of a picture.
    pub fn time(&self) -> Option<String> {
        if self.frame.is_none() && self.shutter.is_none() {
            return None;
        }
        let shutter =
            self.shutter.map_or(String::new(), |[open, close]| format!(", shutter {open} to {close}"));
        Some(format!("frame {} at {} per second{shutter}", self.frame.unwrap_or(0.0), self.fps))
    }

    /// The options that are given.
    fn given(&self) -> impl Iterator<Item = &'static str> + use<> {
        [
            ("--camera", self.camera.is_some()),
            ("--frame", self.frame.is_some()),
            ("--fps", self.fps != FPS),
            ("--shutter", self.shutter.is_some()),
            ("--animation", self.animation.is_some()),
            ("--variant", self.variant.is_some()),
            ("--env", self.environment.is_some()),
            ("--sun", self.sun.is_some()),
            ("--allow-outside", self.allow_outside),
        ]
        .into_iter()
        .filter_map(|(name, given)| given.then_some(name))
    }
}

impl SceneArgs {
    /// How to load the scene.
    pub fn load_options(&self) -> LoadOptions {
        let stage = self.stage.clone();
        LoadOptions {
            defines: self.defines.clone(),
            lenient: self.lenient,
            camera: stage.camera,
            environment: stage.environment,
            sun: stage.sun,
            variant: stage.variant,
            animation: stage.animation,
            frame: stage.frame,
            fps: stage.fps,
            shutter: stage.shutter,
            allow_outside: stage.allow_outside,
            ..LoadOptions::default()
        }
    }
}

/// Arguments of `render`. It stops at the first of samples, time or error
/// reached; Ctrl-C ends it after the current pass and writes what there is.
#[derive(Clone, Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output: OUT.exr, or OUT.png for the preview alone.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Render a sequence, both ends included, to OUT.0001.exr and so on; a row of # in the name of the
    /// output says where the number goes and how many digits it has.
    #[arg(long, value_name = "A..B", value_parser = parse_frames, conflicts_with = "frame",
        allow_hyphen_values = true)]
    pub frames: Option<(i64, i64)>,
    /// Samples per pixel instead of the file's; with --time or --error and
    /// without --spp there is no limit.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub spp: Option<u64>,
    /// Stop after this many seconds of rendering.
    #[arg(long, value_name = "SECONDS", value_parser = parse_positive)]
    pub time: Option<f64>,
    /// Stop when the relative error is at most this, e.g. 0.01: the root of the mean relMSE, with a margin
    /// for what is uncertain about it.
    #[arg(long, value_name = "REL", value_parser = parse_positive)]
    pub error: Option<f64>,
    /// Seed of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// How the samples of a pixel are spread: sobol, padded (without the joint 4D set), lattice or
    /// independent.
    #[arg(long, value_name = "NAME", default_value = "sobol", value_parser = parse_sequence)]
    pub sampler: Sequence,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "T", default_value_t = 0)]
    pub threads: usize,
    /// Share the samples of each pixel among this many independent replicas (2 to 64), whose scatter is an
    /// unbiased error; smooth light gets noisier and the film larger. Without it: two halves of one set.
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u32).range(2..=64))]
    pub replicas: Option<u32>,
    /// Layers beside R, G, B, A and error: any of albedo, N, P, Z, m2, forward, bad; or none, which also
    /// drops error.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub aov: Vec<Aov>,
    /// Write R, G, B, A as 16-bit floats, as a film with `component_format` `float16` does;
    /// too large values saturate, with a warning.
    #[arg(long)]
    pub half: bool,
    /// Statistics as JSON.
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Tone-mapped preview. Written beside an EXR by its own name if no file is given.
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = false)]
    pub png: Option<Option<PathBuf>>,
    /// Exposure of the preview, in stops.
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// Tone curve of the preview.
    #[arg(long, value_enum, default_value_t = Curve::Agx)]
    pub tone: Curve,
    /// Exit with 1 when any sample had to be left out (NaN, infinite, negative, beyond the film's sums, or
    /// with such a layer); the files are written all the same.
    #[arg(long)]
    pub strict: bool,
    /// Say nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Tone curves of the preview.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Curve {
    /// Soft highlights that keep their hue.
    Agx,
    /// Plain sRGB: what is over one is white.
    Srgb,
}

/// Layers beside colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Aov {
    /// Share of light that the first surface scatters.
    Albedo,
    /// Shading normal, world space.
    #[value(name = "N")]
    Normal,
    /// Position, world space.
    #[value(name = "P")]
    Position,
    /// Mean square of single samples' radiance.
    #[value(name = "m2")]
    Moment,
    /// Pixels that the surface moves while the shutter is open.
    #[value(name = "forward")]
    Motion,
    /// Distance to the nearest surface in the pixel; not filtered.
    #[value(name = "Z")]
    Depth,
    /// How many samples of the pixel were left out because they were no radiance; not filtered.
    Bad,
    /// Colour alone.
    None,
}

impl RenderArgs {
    pub fn layers(&self) -> LayerSet {
        let has = |aov| self.aov.contains(&aov);
        LayerSet {
            alpha: true,
            error: !has(Aov::None),
            albedo: has(Aov::Albedo),
            normal: has(Aov::Normal),
            position: has(Aov::Position),
            depth: has(Aov::Depth),
            moment: has(Aov::Moment),
            motion: has(Aov::Motion),
            bad: has(Aov::Bad),
        }
    }
}

/// Arguments of `explain`.
#[derive(Clone, Debug, Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `compare`.
#[derive(Clone, Debug, Args)]
pub struct CompareArgs {
    /// The image to judge.
    pub image: PathBuf,
    /// The reference.
    pub reference: PathBuf,
    /// Variance of the reference's pixel means, for the z-test; the image's own
    /// error layer is used too when it has one.
    #[arg(long, value_name = "V.exr")]
    pub variance: Option<PathBuf>,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `study`. The report is OUT/index.html, with study.json,
/// study.csv and plots beside it. A study that was stopped or killed goes on
/// where it was when the same command is given again.
#[derive(Clone, Debug, Args)]
pub struct StudyArgs {
    /// A plan (PLAN.toml), or a scene (Mitsuba 3 XML, glTF) with the options below.
    #[arg(value_name = "PLAN.toml|SCENE")]
    pub subject: PathBuf,
    /// Folder of the report; holds the runs too.
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// What error is measured against; without it, the spread over the runs.
    #[arg(long = "ref", value_name = "REF.exr")]
    pub reference: Option<PathBuf>,
    /// Variance of the reference's pixel means; its own error layer is used when it has one.
    #[arg(long, value_name = "V.exr")]
    pub ref_variance: Option<PathBuf>,
    /// Try these values: KEY=A,B of integrator, sampler, accel, bvh, max-depth, reuse, texture-filter, or a `$name` of the scene
    /// file. Every combination is a configuration. Repeatable.
    #[arg(long, value_name = "KEY=A,B", value_parser = parse_define)]
    pub vary: Vec<(String, String)>,
    /// Ladder of samples per pixel: A..B (doubling) or a list A,B,C. [default: 1..256]
    #[arg(long, value_name = "A..B", conflicts_with = "budget")]
    pub spp: Option<String>,
    /// Ladder of seconds of rendering instead: this and its halves, seven rungs.
    #[arg(long, value_name = "60s")]
    pub budget: Option<String>,
    /// Independent runs of every rung. [default: 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub repeats: Option<u32>,
    /// The configuration that others are compared with, by its name. [default: the first]
    #[arg(long, value_name = "NAME")]
    pub baseline: Option<String>,
    /// Pictures and times of another renderer: a folder with EXR files and a CSV file with the columns
    /// file, seconds, spp. Repeatable.
    #[arg(long, value_name = "NAME=FOLDER", value_parser = parse_define)]
    pub series: Vec<(String, String)>,
    /// Measure a region too: X,Y,W,H or a picture, bright inside. Repeatable.
    #[arg(long = "region", value_name = "NAME=X,Y,W,H|MASK", value_parser = parse_define)]
    pub region: Vec<(String, String)>,
    /// Measure layers too: albedo, N, P; the reference must have them.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub layers: Vec<String>,
    #[command(flatten)]
    pub stage: StageArgs,
    /// Give a scene parameter (`$name` in the file) a value.
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub defines: Vec<(String, String)>,
    /// Film size instead of the file's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Render only this part of the film; in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_crop)]
    pub crop: Option<[u32; 4]>,
    /// Go on where something in the scene is not known or not there, as render does with it.
    #[arg(long)]
    pub lenient: bool,
    /// Title of the report.
    #[arg(long)]
    pub title: Option<String>,
    /// Seed of the seeds. [default: 0]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Threads; 0 is one per core. [default: 0]
    #[arg(long, value_name = "T")]
    pub threads: Option<usize>,
    /// Run nothing: write the report of what is in the folder.
    #[arg(long)]
    pub report_only: bool,
    /// Print the study as JSON instead of the summary.
    #[arg(long)]
    pub json: bool,
    /// Say nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

impl StudyArgs {
    /// An option given that a plan file says for itself.
    pub fn scene_option(&self) -> Option<&'static str> {
        [
            ("--ref", self.reference.is_some()),
            ("--ref-variance", self.ref_variance.is_some()),
            ("--vary", !self.vary.is_empty()),
            ("--region", !self.region.is_empty()),
            ("--layers", !self.layers.is_empty()),
            ("-D", !self.defines.is_empty()),
            ("--size", self.size.is_some()),
            ("--crop", self.crop.is_some()),
            ("--lenient", self.lenient),
        ]
        .into_iter()
        .find_map(|(name, given)| given.then_some(name))
        .or_else(|| self.stage.given().next())
    }

    /// The regions by name: four numbers are a rectangle, all else is a file.
    pub fn regions(&self) -> Result<BTreeMap<String, Region>, Error> {
        let mut all = BTreeMap::new();
        for (name, what) in &self.region {
            let region = match numbers::<4>(what, ',') {
                Some(rectangle) => Region::Rectangle(rectangle),
                None => Region::Mask(PathBuf::from(what)),
            };
            if all.insert(name.clone(), region).is_some() {
                return Err(Error::new(format!("two regions are called `{name}`")));
            }
        }
        Ok(all)
    }
}

/// Arguments of `accel`. Without --bench it only builds. Rays are traced on
/// one thread, in interleaved repeats, and timed in CPU seconds; they are a
/// function of the seed and the same for every accelerator.
#[derive(Clone, Debug, Args)]
pub struct AccelArgs {
    /// Scenes (Mitsuba 3 XML, glTF) and meshes (ply, ply.gz, obj, serialized).
    #[arg(value_name = "SCENE|MESH")]
    pub subjects: Vec<PathBuf>,
    /// Give a scene parameter (`$name` in the files) another value.
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub defines: Vec<(String, String)>,
    /// Trace rays too: Mray/s, ratios to a baseline with intervals, and whether all find the same hits.
    #[arg(long)]
    pub bench: bool,
    /// Accelerators to measure instead of all but brute. To be measured and not rendered with are bvh8-plain
    /// (bvh8 without robust tests, from an epsilon off the surface) and, in a program built with Embree, its
    /// own triangle test: embree-native (robust) and embree-loose (faster, rays pass between triangles).
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub accel: Option<Vec<String>>,
    /// The one that ratios are to, instead of the first.
    #[arg(long, value_name = "NAME")]
    pub baseline: Option<String>,
    /// Made subjects: displaced:TRIANGLES (displaced:2^20, a closed tunnel) or stadium:MESH (the mesh,
    /// small, in a stadium).
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub generate: Vec<String>,
    /// Displaced surfaces of 2^A to 2^B triangles.
    #[arg(long, value_name = "A..B", value_parser = parse_growth)]
    pub growth: Option<(u32, u32)>,
    /// Ray sets instead of all: camera; b1, b3 (first, third diffuse bounce); s1, s3 (shadow rays from
    /// the first, third hit); vertex (aimed exactly at vertices); spawn (b1, made and not traced).
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub sets: Option<Vec<String>>,
    /// Rays of each set.
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = parse_count)]
    pub rays: usize,
    /// How often each set is traced by each accelerator.
    #[arg(long, value_name = "R", default_value_t = 15, value_parser = parse_count)]
    pub repeats: usize,
    /// How often each accelerator is built.
    #[arg(long, value_name = "B", default_value_t = 3, value_parser = parse_count)]
    pub builds: usize,
    /// Threads of a build; 0 is one per core.
    #[arg(long, value_name = "T", default_value_t = 1)]
    pub threads: usize,
    /// Rays of each set that are compared with brute force.
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub verify: usize,
    /// Seed of the rays.
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Everything, with each single time.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// A line per subject, accelerator and quantity.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
}

/// Arguments of `replay`.
#[derive(Clone, Debug, Args)]
pub struct ReplayArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The pixel, from the top left. One of the border (`sample_border`) may be negative: write -- before
    /// scene and pixel then.
    #[arg(value_name = "X,Y", value_parser = parse_pixel)]
    pub pixel: (i32, i32),
    /// Which sample of it.
    #[arg(long, value_name = "I", default_value_t = 0)]
    pub sample: u64,
    /// Seed of the render.
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Replicas of the render, if it had any.
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u32).range(2..=64))]
    pub replicas: Option<u32>,
    /// Sampler of the render.
    #[arg(long, value_name = "NAME", default_value = "sobol", value_parser = parse_sequence)]
    pub sampler: Sequence,
}

/// Arguments of `selftest`. It fails when a row does.
#[derive(Clone, Debug, Args)]
pub struct SelftestArgs {
    /// Rows of the catalogue instead of all, such as A2 or c1.
    #[arg(value_name = "ROW")]
    pub rows: Vec<String>,
    /// Sixteen times the samples and rays, and every case; without it only the telling ones.
    #[arg(long)]
    pub full: bool,
    /// Print what there is and run nothing.
    #[arg(long)]
    pub list: bool,
    /// As JSON: a list of cases with expected, measured, error, tolerance, pass, and other renderers'.
    #[arg(long)]
    pub json: bool,
    /// Seed of all random numbers. The means of a run of another seed raise a false alarm once in 1000 runs.
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Threads, each with a row of its own; 0 is one per core.
    #[arg(long, value_name = "T", default_value_t = 0)]
    pub threads: usize,
    /// Accelerator: bvh8, bvh2, brute, or embree where the program was built with that feature.
    #[arg(long, value_name = "NAME")]
    pub accel: Option<String>,
    /// Write the scenes here, with what is expected of them, for other renderers.
    #[arg(long, value_name = "FOLDER")]
    pub export: Option<PathBuf>,
}

fn parse_define(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    Ok((name.to_owned(), value.to_owned()))
}

fn numbers<const N: usize>(text: &str, separator: char) -> Option<[u32; N]> {
    let parts: Option<Vec<u32>> = text.split(separator).map(|s| s.trim().parse().ok()).collect();
    parts?.try_into().ok()
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    match numbers::<2>(text, 'x') {
        Some([w, h]) if w > 0 && h > 0 => Ok([w, h]),
        _ => Err("expected WxH, for example 640x360".to_owned()),
    }
}

fn parse_crop(text: &str) -> Result<[u32; 4], String> {
    match numbers::<4>(text, ',') {
        Some(crop) if crop[2] > 0 && crop[3] > 0 => Ok(crop),
        _ => Err("expected X,Y,W,H, for example 10,20,64,64".to_owned()),
    }
}

fn parse_pixel(text: &str) -> Result<(i32, i32), String> {
    let pixel =
        text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    pixel.ok_or_else(|| "expected X,Y, for example 12,34".to_owned())
}

fn parse_pair(text: &str) -> Result<[f64; 2], String> {
    let parts: Option<Vec<f64>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
    match parts.as_deref() {
        Some(&[a, b]) if a.is_finite() && b.is_finite() => Ok([a, b]),
        _ => Err("expected two numbers, for example 0,0.5".to_owned()),
    }
}

fn parse_frames(text: &str) -> Result<(i64, i64), String> {
    let range = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    match range {
        Some((from, to)) if from <= to => Ok((from, to)),
        _ => Err("expected A..B, for example 1..24".to_owned()),
    }
}

fn parse_growth(text: &str) -> Result<(u32, u32), String> {
    let range = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    match range {
        Some((from, to)) if 4 <= from && from <= to && to <= 30 => Ok((from, to)),
        _ => Err("expected A..B from 4 to 30, for example 10..22".to_owned()),
    }
}

fn parse_sequence(text: &str) -> Result<Sequence, String> {
    let names = || Sequence::ALL.map(Sequence::name).join(", ");
    Sequence::named(text).ok_or_else(|| format!("there are {}", names()))
}

fn parse_reuse(text: &str) -> Result<u32, String> {
    reuse_named(text).ok_or_else(|| format!("a number of pixels from 1 to {MOST_REUSE}, or auto"))
}

fn parse_filter(text: &str) -> Result<TextureFilter, String> {
    TextureFilter::named(text).ok_or_else(|| format!("there are {}", TextureFilter::names()))
}

fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err("expected a count of at least 1".to_owned()),
    }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v > 0.0 && v.is_finite() => Ok(v),
        _ => Err("expected a positive number".to_owned()),
    }
}
