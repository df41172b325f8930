//! `etendue render`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use super::args::{Curve, RenderArgs};
use super::progress::{Progress, interrupted};
use super::{build_to_render, load_scene, warn};
use crate::desc::{Error, Result};
use crate::film::{Film, Groups, Picture};
use crate::integrator::Integrator;
use crate::render::{Pilot, RenderOptions, RenderStats, Rendered, Stopped, TileOrder, render};
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
            say!("frame {frame} of {from}..{to}");
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
    let (scene, integrator) = build_to_render(&args.scene, &desc)?;
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
    if let Some(Pilot { pixels, gain, work }) = stats.pilot.filter(|_| !args.quiet) {
        let who = if pixels > 1 { format!("{pixels} pixels use") } else { "pixels do not use".to_owned() };
        say!("{who} each other's paths: {gain:.1} times less noise for {work:.1} times the work, by a trial");
    }
    let mut header = header(&scene, &integrator, &stats, &options, &origin);
    header.attributes.extend(args.scene.stage.time().map(|time| ("etendue/time".to_owned(), time)));
    let picture = film.resolve();
    let written = output.write(args, &picture, &header, args.half || scene.film.half);
    let told = args.stats.as_ref().map_or(Ok(()), |path| {
        let text = format!("{:#}\n", stats.to_json(&scene.plan, load, build));
        save::write_file(path, text.as_bytes())
    });
    let code = summarise(args, &stats);
    written.and(told).map(|()| code)
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
        let paths: Vec<&Path> =
            [&exr, &png, &args.stats].into_iter().flatten().map(PathBuf::as_path).collect();
        for path in &paths {
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            if !folder.is_dir() {
                let message =
                    format!("cannot write `{}`: there is no folder `{}`", path.display(), folder.display());
                return Err(Error::new(message));
            }
        }
        save::check_distinct(&[&[args.scene.scene.as_path()], &paths[..]].concat(), paths.len())?;
        paths.into_iter().try_for_each(save::check_writable)?;
        Ok(Output { exr, png })
    }

    /// Writes the pictures. What cannot be written where it was wanted goes to
    /// the folder for temporary files: a render may have taken hours.
    fn write(&self, args: &RenderArgs, picture: &Picture, header: &Header, half: bool) -> Result<()> {
        let exr = |path: &Path| -> Result<()> {
            warn_saturated(&save::write_exr(path, picture, header, Options { half })?);
            Ok(())
        };
        let curve = match args.tone {
            Curve::Agx => save::Curve::Agx,
            Curve::Srgb => save::Curve::Srgb,
        };
        let png = |path: &Path| save::write_png(path, picture, Tone { exposure: args.exposure, curve });
        // The one is tried even where the other failed.
        let first = self.exr.as_ref().map_or(Ok(()), |path| write_or_rescue(args, path, exr));
        let second = self.png.as_ref().map_or(Ok(()), |path| write_or_rescue(args, path, png));
        first.and(second)
    }
}

/// Writes a file, or saves it elsewhere and fails.
fn write_or_rescue(args: &RenderArgs, path: &Path, write: impl Fn(&Path) -> Result<()>) -> Result<()> {
    let Err(error) = write(path) else {
        announce(args, path);
        return Ok(());
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    // In a folder that others write to as well: a name that nobody has.
    let names = (0..).map(|n| format!("etendue-{}-{n}-{name}", std::process::id()));
    let paths = names.map(|name| std::env::temp_dir().join(name));
    let free = |path: &PathBuf| std::fs::symlink_metadata(path).is_err();
    let elsewhere = paths.take(100).find(free).unwrap_or_default();
    match write(&elsewhere) {
        Ok(()) => Err(Error::new(format!(
            "{error}; the picture is not lost: it is in `{}`, move it from there",
            elsewhere.display()
        ))),
        Err(second) => Err(Error::new(format!("{error}; nor could it be saved elsewhere: {second}"))),
    }
}

fn warn_saturated(channels: &[save::Saturated]) {
    if channels.is_empty() {
        return;
    }
    let total: u64 = channels.iter().map(|s| s.count).sum();
    let list: Vec<String> = channels.iter().map(|s| format!("{} {}", s.channel, s.count)).collect();
    say!(
        "warning: {total} values over 65504 were saturated to half floats ({}); 32-bit floats keep them: \
         leave out --half, or set `component_format` to `float32` in the scene",
        list.join(", ")
    );
}

fn announce(args: &RenderArgs, path: &Path) {
    if !args.quiet {
        say!("wrote {}", path.display());
    }
}

fn describe(scene: &Scene, integrator: &Integrator, options: &RenderOptions, open_ended: bool) {
    let [width, height] = scene.film.size;
    let until = if open_ended { String::new() } else { format!(", {} spp", options.samples_per_pixel) };
    say!("{width} × {height}, {}{until}; {}", integrator.name(), scene.plan.summary());
    if options.replicas > 0 {
        let bytes = Film::bytes_for(&scene.film, options.layers, Groups::of_replicas(options.replicas));
        say!("{} replicas: the film takes {:.1} MB", options.replicas, bytes as f64 * 1e-6);
    }
    say!(
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
            text("bias", integrator.bias_ledger(scene)),
            text("relativeError", format!("{:.3e}", stats.relative_error)),
            text("relativeErrorInterval", format!("{low:.3e} {high:.3e}")),
            text("error", Groups::of_replicas(options.replicas).describe()),
        ],
        world_to_camera: Some(scene.camera.world_to_camera()),
        world_to_ndc: scene.camera.world_to_ndc(),
        ..Header::default()
    };
    header.attributes.extend(super::ledger::attributes(&stats.bad));
    if !origin.replaced.is_empty() {
        header.attributes.push(text("replaced", origin.replaced.join("\n")));
    }
    if stats.reuse > 1 {
        header.attributes.push(text("reuse", format!("{} pixels use each other's paths", stats.reuse)));
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
        say!(
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
        say!(
            "to go on from here, render again with more samples: the first {} are the same",
            stats.samples_per_pixel
        );
    }
    super::ledger::tell(args, stats);
    if args.strict && stats.bad.total() > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS }
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
