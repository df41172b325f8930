//! The catalogue of stiff and extreme cases, run by the program itself.
//!
//! A [`Row`] is a promise with its construction in code: scenes whose radiance
//! is known in closed form, furnaces, invariants that hold bit for bit, rays
//! that must not slip through. Running it gives [`Case`]s, each with what was
//! expected, what was measured, how far off that is and how far it may be.
//! `etendue selftest` prints the table and `tests/robust.rs` asserts it.
//!
//! Two kinds of cases: *exact* ones have a tolerance and no noise; *means* are
//! Student's t-tests over independent renders. All means of one run together
//! raise a false alarm with a probability of [`ALPHA`] at most (Šidák over
//! [`MOST_MEANS`] of them); and a mean that is not known well enough fails as
//! undecided, so that noise passes nothing.

mod exact;
mod geometry;
mod invariants;
mod lights;
mod materials;
mod meshes;
mod numerics;
mod optics;
mod peers;
mod rays;
mod report;
mod sheet;
mod stage;
mod stiff;

pub use peers::Peer;
pub use report::{Report, RowReport};
pub use sheet::{Case, Effort, Sheet};

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use crate::accel::Accel;
use crate::desc::{Error, Result};
use crate::shape::GeometryBuilder;

/// Probability that a run in which all is right raises any alarm.
pub const ALPHA: f64 = 1e-3;

/// At least as many means as a whole run tests.
pub const MOST_MEANS: usize = 400;

/// A promise and how it is checked.
pub struct Row {
    /// Its number in the catalogue, such as `A2`.
    pub id: &'static str,
    /// What is promised.
    pub what: &'static str,
    run: fn(&mut Sheet) -> Result<()>,
}

impl std::fmt::Debug for Row {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.id, self.what)
    }
}

/// All rows in the order of the catalogue.
#[must_use]
pub fn rows() -> Vec<&'static Row> {
    let rooms = [
        lights::ROWS,
        optics::ROWS,
        materials::ROWS,
        invariants::ROWS,
        geometry::ROWS,
        stiff::ROWS,
        numerics::ROWS,
    ];
    let mut rows: Vec<&Row> = rooms.into_iter().flatten().collect();
    rows.sort_by_key(|row| place(row.id));
    rows
}

/// The order of ids: a letter, then a number.
fn place(id: &str) -> (Option<char>, u32) {
    (id.chars().next(), id.get(1..).and_then(|n| n.parse().ok()).unwrap_or(0))
}

/// Rows of the catalogue that cannot be run yet, with what is missing.
pub const ABSENT: &[(&str, &str)] = &[
    ("B4", "media that scatter are not there yet"),
    ("B6", "hair is not there yet"),
    ("E7", "media that scatter are not there yet"),
];

/// What to run, and how.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Rows by their ids; all when empty.
    pub only: Vec<String>,
    /// How much of it.
    pub effort: Effort,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Threads, each with a row of its own; 0 is one per core.
    pub threads: usize,
    /// Accelerator instead of the default.
    pub accel: Option<String>,
    /// Write the scenes here with what is expected of them, for other renderers.
    pub export: Option<std::path::PathBuf>,
}

/// Runs the rows that `options` name, as many at a time as there are threads.
/// `done` hears of each with the number of rows finished so far.
///
/// # Errors
/// An unknown row or accelerator, or a folder that cannot be written.
pub fn run(options: &Options, done: &(dyn Fn(&RowReport, usize, usize) + Sync)) -> Result<Report> {
    let chosen = choose(&options.only)?;
    // An accelerator of this name must be there.
    Accel::build_named(options.accel.as_deref(), &GeometryBuilder::new().finish())?;
    let threads = match options.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        n => n,
    };
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || {
        let mut reports = Vec::new();
        while let Some(row) = chosen.get(next.fetch_add(1, Ordering::Relaxed)) {
            let report = run_row(row, options)?;
            done(&report, finished.fetch_add(1, Ordering::Relaxed) + 1, chosen.len());
            reports.push(report);
        }
        Ok(reports)
    };
    // Not on rayon's threads: one that waits for a render would begin another row.
    let mut reports = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let joined = workers.into_iter().map(|w| w.join().unwrap_or_else(|p| std::panic::resume_unwind(p)));
        joined.collect::<Result<Vec<Vec<RowReport>>>>()
    })?
    .concat();
    reports.sort_by_key(|report| place(report.id));
    Ok(Report { rows: reports, effort: options.effort, seed: options.seed })
}

fn run_row(row: &Row, options: &Options) -> Result<RowReport> {
    let mut sheet = Sheet::new(row.id, options);
    let clock = Instant::now();
    let outcome = (row.run)(&mut sheet);
    Ok(RowReport {
        id: row.id,
        what: row.what,
        seconds: clock.elapsed().as_secs_f64(),
        error: outcome.err().map(|e| e.to_string()),
        cases: sheet.finish()?,
    })
}

fn choose(only: &[String]) -> Result<Vec<&'static Row>> {
    let all = rows();
    if only.is_empty() {
        return Ok(all);
    }
    let find = |id: &String| {
        all.iter().find(|row| row.id.eq_ignore_ascii_case(id)).copied().ok_or_else(|| unknown(id))
    };
    only.iter().map(find).collect()
}

fn unknown(id: &str) -> Error {
    let error = Error::new(format!("there is no row `{id}`"));
    match ABSENT.iter().find(|(absent, _)| absent.eq_ignore_ascii_case(id)) {
        Some((_, why)) => error.hint((*why).to_owned()),
        None => error.hint("see them with `etendue selftest --list`"),
    }
}
