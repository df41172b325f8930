//! The `etendue` command. All of it lives in [`etendue::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    etendue::cli::run(std::env::args_os())
}
