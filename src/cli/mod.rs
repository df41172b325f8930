//! Arguments, progress bar, messages and exit codes.
//!
//! Human text goes to stderr, results to stdout. Exit code 0 is done, 1 failed,
//! 2 wrong use.

#![allow(clippy::print_stderr, reason = "this room is where the program speaks")]

/// Prints a result. A reader that has gone away (`| head`) is no failure: what
/// is left to say goes nowhere.
macro_rules! out {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = write!(std::io::stdout(), $($text)*);
    }};
}

/// Prints a line of a result.
macro_rules! outln {
    () => { out!("\n") };
    ($($text:tt)*) => {{
        out!("{}\n", format_args!($($text)*));
    }};
}

mod accel;
mod args;
mod compare;
mod inspect;
mod progress;
mod render;
mod selftest;
mod study;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use crate::desc::{Result, SceneDesc};
use crate::integrator::Integrator;
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
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
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
    let scene = Scene::build(desc, &args.build_options());
    let integrator = Integrator::from_desc(desc, &args.integrator_options());
    warn(&desc.new_replacements());
    Ok((scene?, integrator?))
}

fn warn(texts: &[String]) {
    for text in texts {
        eprintln!("warning: {text}");
    }
}
