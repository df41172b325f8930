//! What has been run: a line of JSON for each finished run, in `runs.jsonl`.
//!
//! A picture is written (whole or not at all) before its line, and a line is
//! appended at once; so whatever kills the program, every line but perhaps a
//! torn last one names a finished run, which is never repeated. A run's key is
//! a hash of all that decides its picture; a changed plan keeps the runs that
//! it still asks for.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::model::Metric;
use crate::desc::{Error, Result};

/// Target, metric and value; `None` where it is not finite.
pub type Measured = (String, Metric, Option<f64>);

/// One finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Hash of all that decides the picture, 16 hexadecimal digits.
    pub key: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the configuration.
    pub configuration: String,
    /// Label of the budget.
    pub budget: String,
    /// Which of the repeats.
    pub repeat: u32,
    /// The picture, relative to the report's folder.
    pub image: PathBuf,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Samples per pixel taken.
    pub samples_per_pixel: u64,
    /// Wall-clock seconds of rendering alone.
    pub wall_seconds: f64,
    /// CPU seconds of all threads of rendering alone.
    pub cpu_seconds: f64,
    /// Seconds to load and to build the scene (once for all its runs).
    pub prepare_seconds: f64,
    /// Seconds to write the picture.
    pub save_seconds: f64,
    /// Seconds to measure it against the reference.
    pub measure_seconds: f64,
    /// Threads.
    pub threads: usize,
    /// Rays traced.
    pub rays: u64,
    /// Samples left out because they were no radiance.
    pub bad_samples: u64,
    /// The same by cause, in the order of [`crate::render::Cause::ALL`].
    #[serde(default)]
    pub bad_causes: Vec<u64>,
    /// Relative error that the renderer reports; NaN where there is none.
    #[serde(with = "super::model::nullable")]
    pub reported_error: f64,
    /// Hash of the reference and regions that `figures` belong to.
    pub measured_against: String,
    /// What was measured.
    pub figures: Vec<Measured>,
    /// Made by another program.
    #[serde(default)]
    pub external: bool,
}

/// The finished runs of a folder.
pub struct Ledger {
    path: PathBuf,
    file: File,
    runs: HashMap<String, Run>,
}

impl Ledger {
    /// Opens the ledger of a folder, or begins one.
    ///
    /// # Errors
    /// A folder that cannot be written, or a file that is no ledger.
    pub fn open(folder: &Path) -> Result<Ledger> {
        let path = folder.join("runs.jsonl");
        let failed = |e: std::io::Error| Error::new(format!("cannot write `{}`: {e}", path.display()));
        std::fs::create_dir_all(folder.join("runs")).map_err(failed)?;
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(e) => return Err(Error::new(format!("cannot read `{}`: {e}", path.display()))),
        };
        let mut runs = HashMap::new();
        for (index, line) in text.lines().enumerate() {
            match serde_json::from_str::<Run>(line) {
                Ok(run) => {
                    // A picture that somebody removed has to be made again.
                    if folder.join(&run.image).is_file() {
                        runs.insert(run.key.clone(), run);
                    }
                }
                // The line that was being written when the program died.
                Err(_) if index + 1 == text.lines().count() => {}
                Err(e) => {
                    return Err(Error::new(format!("`{}`, line {}: {e}", path.display(), index + 1))
                        .hint("move the file away to begin anew"));
                }
            }
        }
        let mut file = OpenOptions::new().create(true).append(true).open(&path).map_err(failed)?;
        if !text.is_empty() && !text.ends_with('\n') {
            // A complete line without its end is kept, a torn one is fenced off:
            // it stays in the file, so it must not be the start of the next.
            let whole = text.lines().last().is_some_and(|l| serde_json::from_str::<Run>(l).is_ok());
            if whole {
                file.write_all(b"\n").map_err(failed)?;
            } else {
                let kept = text.rfind('\n').map_or(0, |at| at + 1);
                file.set_len(kept as u64).map_err(failed)?;
            }
        }
        Ok(Ledger { path, file, runs })
    }

    /// The finished run of that key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Run> {
        self.runs.get(key)
    }

    /// Adds a finished run.
    ///
    /// # Errors
    /// When the line cannot be written.
    pub fn add(&mut self, run: Run) -> Result<()> {
        let failed = |e: &dyn std::fmt::Display| {
            Error::new(format!("cannot write `{}`: {e}", self.path.display()))
                .hint("with that mended, the same command goes on from here")
        };
        let mut line = serde_json::to_string(&run).map_err(|e| failed(&e))?;
        line.push('\n');
        self.file.write_all(line.as_bytes()).and_then(|()| self.file.sync_data()).map_err(|e| failed(&e))?;
        self.runs.insert(run.key.clone(), run);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(key: &str) -> Run {
        Run {
            key: key.to_owned(),
            scene: "s".to_owned(),
            configuration: "c".to_owned(),
            budget: "4 spp".to_owned(),
            repeat: 0,
            image: PathBuf::from("runs/x.exr"),
            seed: u64::MAX,
            samples_per_pixel: 4,
            wall_seconds: 0.1,
            cpu_seconds: 0.2,
            prepare_seconds: 0.3,
            save_seconds: 0.0,
            measure_seconds: 0.0,
            threads: 2,
            rays: 100,
            bad_samples: 0,
            bad_causes: Vec::new(),
            reported_error: 0.5,
            measured_against: String::new(),
            figures: vec![("colour".to_owned(), Metric::RelMse, None)],
            external: false,
        }
    }

    #[test]
    fn a_torn_line_costs_one_run() {
        let folder = tempfile::tempdir().expect("a folder");
        let open = || Ledger::open(folder.path()).expect("a ledger");
        let mut ledger = open();
        std::fs::write(folder.path().join("runs/x.exr"), b"x").expect("written");
        ledger.add(run("a")).expect("added");
        ledger.add(run("b")).expect("added");
        drop(ledger);
        let file = folder.path().join("runs.jsonl");
        let text = std::fs::read_to_string(&file).expect("read");
        for cut in [1, 10, text.len() / 2 - 3] {
            std::fs::write(&file, &text[..text.len() - cut]).expect("written");
            let mut ledger = open();
            assert_eq!(ledger.get("a"), Some(&run("a")), "cut {cut}");
            // Without its newline alone the line is whole.
            assert_eq!(ledger.get("b").is_some(), cut == 1);
            ledger.add(run("c")).expect("added");
            drop(ledger);
            let again = open();
            assert!(again.get("c").is_some() && again.get("a").is_some());
        }
        std::fs::write(&file, "nonsense\n{}\n").expect("written");
        let error = Ledger::open(folder.path()).err().expect("an error").to_string();
        assert!(error.contains("line 1"), "{error}");
    }
}
