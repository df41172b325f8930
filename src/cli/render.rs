//! `etendue render`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use super::args::{Curve, RenderArgs};
use super::progress::{Progress, interrupted};
use super::{build_scene, load_scene, warn};
use crate::desc::{Error, Result};
use crate::film::{Film, Groups, Picture};
use crate::integrator::Integrator;
use crate::render::{RenderOptions, RenderStats, Rendered, Stopped, TileOrder, render};
use crate::sampling::Sequence;
use crate::save::{self, Header, Options, Tone};
use crate::scene::Scene;

/// Renders, and writes what was asked for.
pub fn run(args: &RenderArgs) -> Result<ExitCode> {
    let Some((from, to)) = args.frames else { return still(args) };
    // Names are checked before hours of work.
    Output::new(&of_frame(args, from))?;
    let mut worst = ExitCode::SUCCESS;
    for frame in from..=to {
        if !args.quiet {
            eprintln!("frame {frame} of {from}..{to}");
        }
        let code = still(&of_frame(args, frame))?;
        if code != ExitCode::SUCCESS {
            worst = code;
        }
        if interrupted() {
            break;
        }
    }
    Ok(worst)
}

/// The arguments that render one frame of a sequence.
fn of_frame(args: &RenderArgs, frame: i64) -> RenderArgs {
    let mut args = args.clone();
    args.frames = None;
    args.scene.stage.frame = Some(frame as f64);
    args.output = numbered(&args.output, frame);
    args.stats = args.stats.map(|path| numbered(&path, frame));
    args.png = args.png.map(|png| png.map(|path| numbered(&path, frame)));
    args
}

/// A file name with the number of a frame: in place of its last row of `#`, or
/// before its ending with four digits.
fn numbered(path: &Path, frame: i64) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let number = |digits: usize| {
        let sign = if frame < 0 { "-" } else { "" };
        format!("{sign}{:0digits$}", frame.unsigned_abs())
    };
    let named = match name.rfind('#') {
        Some(last) => {
            let first = name[..=last].rfind(|c| c != '#').map_or(0, |at| at + 1);
            // What stands before may be a character of several bytes.
            let first = (first..=last).find(|at| name.is_char_boundary(*at)).unwrap_or(last);
            format!("{}{}{}", &name[..first], number(last + 1 - first), &name[last + 1..])
        }
        None => match name.rsplit_once('.') {
            Some((stem, ending)) => format!("{stem}.{}.{ending}", number(4)),
            None => format!("{name}.{}", number(4)),
        },
    };
    path.with_file_name(named)
}

/// Renders one picture.
fn still(args: &RenderArgs) -> Result<ExitCode> {
    let output = Output::new(args)?;
    let clock = Instant::now();
    let desc = load_scene(&args.scene)?;
    let load = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let (scene, integrator) = build_scene(&args.scene, &desc)?;
    let (file_layers, renamed) = Integrator::layers_from_desc(&desc)?;
    warn(&renamed);
    let build = clock.elapsed().as_secs_f64();
    let origin = Origin { hash: desc.content_hash(), replaced: desc.replacements() };
    drop(desc);
    let open_ended = args.spp.is_none() && (args.time.is_some() || args.error.is_some());
    let options = RenderOptions {
        samples_per_pixel: args.spp.unwrap_or(if open_ended {
            MOST_SAMPLES
        } else {
            scene.samples_per_pixel
        }),
        time: args.time.map(Duration::from_secs_f64),
        error: args.error,
        replicas: args.replicas.unwrap_or(0),
        seed: args.seed,
        sequence: args.sampler,
        threads: args.threads,
        layers: args.layers().or(file_layers),
        order: TileOrder::CentreOut,
    };
    if !args.quiet {
        describe(&scene, &integrator, &options, open_ended);
    }
    let progress = Progress::new(args.quiet, options.time, open_ended);
    let Rendered { film, stats } = render(&scene, &integrator, &options, &progress)?;
    progress.finish();
    let mut header = header(&scene, &integrator, &stats, &options, &origin);
    header.attributes.extend(args.scene.stage.time().map(|time| ("etendue/time".to_owned(), time)));
    let picture = film.resolve();
    output.write(args, &picture, &header, args.half || scene.film.half)?;
    if let Some(path) = &args.stats {
        let text = format!("{:#}\n", stats.to_json(&scene.plan, load, build));
        save::write_file(path, text.as_bytes())?;
    }
    Ok(summarise(args, &stats))
}

/// What a header says of the scene's files.
struct Origin {
    hash: u64,
    /// What leniency replaced in them.
    replaced: Vec<String>,
}

/// As good as no limit.
const MOST_SAMPLES: u64 = 1 << 40;

/// Which files to write.
struct Output {
    exr: Option<PathBuf>,
    png: Option<PathBuf>,
}

impl Output {
    /// Checks the names before hours of work.
    fn new(args: &RenderArgs) -> Result<Output> {
        let extension = |p: &Path| p.extension().map(|e| e.to_string_lossy().to_lowercase());
        let (exr, png) = match extension(&args.output).as_deref() {
            Some("exr") => {
                let beside = args.output.with_extension("png");
                (Some(args.output.clone()), args.png.clone().map(|p| p.unwrap_or(beside)))
            }
            Some("png") => (None, Some(args.output.clone())),
            _ => {
                return Err(Error::new(format!("cannot write `{}`: unknown format", args.output.display()))
                    .hint("name it *.exr or *.png"));
            }
        };
        for path in [&exr, &png, &args.stats].into_iter().flatten() {
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            if !folder.is_dir() {
                let message =
                    format!("cannot write `{}`: there is no folder `{}`", path.display(), folder.display());
                return Err(Error::new(message));
            }
        }
        Ok(Output { exr, png })
    }

    fn write(&self, args: &RenderArgs, picture: &Picture, header: &Header, half: bool) -> Result<()> {
        if let Some(path) = &self.exr {
            let saturated = save::write_exr(path, picture, header, Options { half })?;
            if saturated > 0 {
                eprintln!(
                    "warning: {saturated} values over 65504 were saturated to half floats; write 32-bit floats to keep them"
                );
            }
            say(args, path);
        }
        if let Some(path) = &self.png {
            let curve = match args.tone {
                Curve::Agx => save::Curve::Agx,
                Curve::Srgb => save::Curve::Srgb,
            };
            save::write_png(path, picture, Tone { exposure: args.exposure, curve })?;
            say(args, path);
        }
        Ok(())
    }
}

fn say(args: &RenderArgs, path: &Path) {
    if !args.quiet {
        eprintln!("wrote {}", path.display());
    }
}

fn describe(scene: &Scene, integrator: &Integrator, options: &RenderOptions, open_ended: bool) {
    let [width, height] = scene.film.size;
    let until = if open_ended { String::new() } else { format!(", {} spp", options.samples_per_pixel) };
    eprintln!("{width} × {height}, {}{until}; {}", integrator.name(), scene.plan.summary());
    if options.replicas > 0 {
        let bytes = Film::bytes_for(&scene.film, options.layers, Groups::of_replicas(options.replicas));
        eprintln!("{} replicas: the film takes {:.1} MB", options.replicas, bytes as f64 * 1e-6);
    }
    eprintln!(
        "sampler: {} (the file says `{}`; its sample count is used)",
        options.sequence.describe(),
        scene.plan.file_sampler
    );
}

fn header(
    scene: &Scene,
    integrator: &Integrator,
    stats: &RenderStats,
    options: &RenderOptions,
    origin: &Origin,
) -> Header {
    let text = |name: &str, value: String| (format!("etendue/{name}"), value);
    let [low, high] = stats.relative_error_interval;
    let mut header = Header {
        attributes: vec![
            text("version", env!("CARGO_PKG_VERSION").to_owned()),
            text("sceneHash", format!("{:016x}", origin.hash)),
            text("seed", options.seed.to_string()),
            text("sampler", options.sequence.name().to_owned()),
            text("samples", stats.samples_per_pixel.to_string()),
            text("stopped", stats.stopped.reason().to_owned()),
            text("integrator", integrator.name().to_owned()),
            text("plan", scene.plan.summary()),
            text("bias", integrator.bias_ledger()),
            text("relativeError", format!("{:.3e}", stats.relative_error)),
            text("relativeErrorInterval", format!("{low:.3e} {high:.3e}")),
            text("error", Groups::of_replicas(options.replicas).describe()),
            text("badSamples", stats.bad.summary()),
        ],
        world_to_camera: Some(scene.camera.world_to_camera()),
        world_to_ndc: scene.camera.world_to_ndc(),
        ..Header::default()
    };
    if !origin.replaced.is_empty() {
        header.attributes.push(text("replaced", origin.replaced.join("\n")));
    }
    if options.replicas > 0 {
        header.attributes.push(text("replicas", options.replicas.to_string()));
    }
    // Only where the clock decided what is in the picture: else the same
    // render gives the same file.
    if options.time.is_some() {
        header.attributes.push(text("renderSeconds", format!("{:.3}", stats.wall_seconds)));
    }
    header
}

fn summarise(args: &RenderArgs, stats: &RenderStats) -> ExitCode {
    if !args.quiet {
        eprintln!(
            "{}: {} spp in {:.1} s, {:.2} M samples and {:.2} M rays per CPU second, relative error {:.2} % (95 %: {:.2} to {:.2} %)",
            stats.stopped.reason(),
            stats.samples_per_pixel,
            stats.wall_seconds,
            stats.samples as f64 / stats.cpu_seconds.max(1e-9) * 1e-6,
            stats.counters.rays() as f64 / stats.cpu_seconds.max(1e-9) * 1e-6,
            stats.relative_error * 100.0,
            stats.relative_error_interval[0] * 100.0,
            stats.relative_error_interval[1] * 100.0,
        );
    }
    if stats.stopped == Stopped::Interrupted {
        eprintln!(
            "to go on from here, render again with more samples: the first {} are the same",
            stats.samples_per_pixel
        );
    }
    if stats.bad.total() == 0 {
        return ExitCode::SUCCESS;
    }
    eprintln!("warning: samples left out: {}", stats.bad.summary());
    let sampler = match args.sampler {
        Sequence::Sobol => String::new(),
        other => format!(" --sampler {}", other.name()),
    };
    let replicas = args.replicas.map_or(String::new(), |r| format!(" --replicas {r}"));
    let frame = args.scene.stage.frame.map_or(String::new(), |f| format!(" --frame {f}"));
    for (x, y, index) in &stats.bad.located {
        eprintln!(
            "  look at one with: etendue replay {} {x},{y} --sample {index} --seed {}{sampler}{replicas}{frame}",
            args.scene.scene.display(),
            args.seed,
        );
    }
    if args.strict { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered() {
        let name = |path: &str, frame| numbered(Path::new(path), frame).display().to_string();
        assert_eq!(name("out/a.exr", 7), "out/a.0007.exr");
        assert_eq!(name("a.b.exr", 12345), "a.b.12345.exr");
        assert_eq!(name("a_##.exr", 7), "a_07.exr");
        assert_eq!(name("é###x.exr", -7), "é-007x.exr");
        assert_eq!(name("a", 1), "a.0001");
    }
}
