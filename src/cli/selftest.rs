//! `etendue selftest`.

use std::process::ExitCode;

use super::args::SelftestArgs;
use crate::desc::{Error, Result};
use crate::selftest::{ABSENT, Effort, Options, Report, RowReport, rows, run as run_rows};

/// Runs the catalogue; fails when a row does.
pub fn run(args: &SelftestArgs) -> Result<ExitCode> {
    if args.list {
        for row in rows() {
            outln!("{:<4} {}", row.id, row.what);
        }
        for (id, why) in ABSENT {
            outln!("{id:<4} not there: {why}");
        }
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(folder) = &args.export {
        std::fs::create_dir_all(folder)
            .map_err(|e| Error::new(format!("cannot make the folder `{}`: {e}", folder.display())))?;
    }
    let options = Options {
        only: args.rows.clone(),
        effort: if args.full { Effort::Full } else { Effort::Fast },
        seed: args.seed,
        threads: args.threads,
        accel: args.accel.clone(),
        export: args.export.clone(),
    };
    let done = |row: &RowReport, finished: usize, count: usize| {
        let verdict = if row.passed() { "ok" } else { "FAILED" };
        say!("[{finished:>2}/{count}] {:<4} {verdict:<6} {:>6.1} s  {}", row.id, row.seconds, row.what);
    };
    let report: Report = run_rows(&options, &done)?;
    if args.json {
        outln!("{:#}", report.to_json());
    } else {
        out!("{report}");
    }
    Ok(if report.passed() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
