//! Arguments, progress bar, messages and exit codes.
//!
//! Human text goes to stderr, results to stdout. Exit code 0 is done, 1 failed,
//! 2 wrong use.

/// Prints a result. A reader that has gone away (`| head`) is no failure: what
/// is left to say goes nowhere. All else is, see [`run`].
macro_rules! out {
    ($($text:tt)*) => {{
        use std::io::Write;
        $crate::cli::note_failure(write!(std::io::stdout(), $($text)*));
    }};
}

/// Prints a line of a result.
macro_rules! outln {
    () => { out!("\n") };
    ($($text:tt)*) => {{
        out!("{}\n", format_args!($($text)*));
    }};
}

/// Tells the user something. Nobody listening is no failure: hours of work must
/// not end because a terminal was closed.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod accel;
mod args;
mod compare;
mod inspect;
mod ledger;
mod progress;
mod render;
mod selftest;
mod study;

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::OnceLock;

use clap::Parser;

use crate::desc::{Error, Result, SceneDesc};
use crate::integrator::{AUTO_REUSE, Integrator, IntegratorOptions};
use crate::scene::Scene;
use args::{Command, Etendue, SceneArgs};

/// Runs the command line; returns 0 when done, 1 on failure, 2 on wrong use.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = match Etendue::try_parse_from(args) {
        Ok(args) => args,
        Err(error) => {
            // Help and version also come this way, with exit code 0.
            let code = if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS };
            let _ = error.print();
            return code;
        }
    };
    let result = match args.command {
        Command::Render(args) => render::run(&args),
        Command::Explain(args) => inspect::explain(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Study(args) => study::run(&args),
        Command::Accel(args) => accel::run(&args),
        Command::Replay(args) => inspect::replay(&args),
        Command::Selftest(args) => selftest::run(&args),
    };
    note_failure(std::io::Write::flush(&mut std::io::stdout()));
    let result = match (result, OUTPUT_FAILURE.get()) {
        (Ok(_), Some(failure)) => Err(Error::new(format!("cannot write the results to stdout: {failure}"))),
        (result, _) => result,
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            say!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Why results could not be printed, the first time.
static OUTPUT_FAILURE: OnceLock<String> = OnceLock::new();

fn note_failure(printed: std::io::Result<()>) {
    if let Err(error) = printed
        && error.kind() != std::io::ErrorKind::BrokenPipe
    {
        let _ = OUTPUT_FAILURE.set(error.to_string());
    }
}

/// Loads the scene that the arguments name, and prints its warnings.
fn load_scene(args: &SceneArgs) -> Result<SceneDesc> {
    let desc = crate::load::load(&args.scene, &args.load_options())?;
    warn(&desc.warnings);
    warn(&desc.new_replacements());
    Ok(desc)
}

/// Builds what was loaded, and prints what was replaced on the way.
fn build_scene(args: &SceneArgs, desc: &SceneDesc) -> Result<(Scene, Integrator)> {
    build_with(args, desc, &args.integrator_options())
}

/// As [`build_scene`], for `render`: what is left open is decided by it.
fn build_to_render(args: &SceneArgs, desc: &SceneDesc) -> Result<(Scene, Integrator)> {
    let options = IntegratorOptions { reuse_unsaid: Some(AUTO_REUSE), ..args.integrator_options() };
    build_with(args, desc, &options)
}

fn build_with(
    args: &SceneArgs,
    desc: &SceneDesc,
    options: &IntegratorOptions,
) -> Result<(Scene, Integrator)> {
    let scene = Scene::build(desc, &args.build_options());
    let integrator = Integrator::from_desc(desc, options);
    warn(&desc.new_replacements());
    let scene = scene?;
    if let Some(text) = scene.plan.unsampled() {
        say!("warning: of the lights {text}");
    }
    let integrator = integrator?;
    if let Some(text) = integrator.leaves_out(&scene) {
        say!("warning: {text} by integrator `{}`: `volpath` knows them", integrator.name());
    }
    Ok((scene, integrator))
}

fn warn(texts: &[String]) {
    for text in texts {
        say!("warning: {text}");
    }
}
