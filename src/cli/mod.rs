//! Arguments, progress bar, messages and exit codes.

use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the command line; returns 0 when done, 1 on failure, 2 on wrong use.
pub fn run(_args: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::SUCCESS
}
