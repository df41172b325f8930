//! Pictures and times of other renderers: a folder of EXR files and one CSV
//! file that lists them.
//!
//! ```csv
//! file,seconds,spp
//! mitsuba-64-0.exr,12.5,64
//! ```
//!
//! `seconds` are CPU seconds of rendering alone; a column `wall_seconds` may
//! stand beside. Files of the same `spp` are independent runs of one rung.

use std::path::{Path, PathBuf};

use super::ledger::Run;
use super::{SeriesPlan, bench::Subject};
use crate::desc::{Error, Pos, Result};
use crate::load::read_picture;

/// Columns of the CSV file by index.
struct Columns {
    file: usize,
    seconds: usize,
    samples: usize,
    wall: Option<usize>,
}

/// Reads a series and measures its pictures against the subject's reference.
///
/// # Errors
/// Anything missing or unreadable, with the line of the CSV file.
pub fn read_series(plan: &SeriesPlan, subject: &Subject) -> Result<Vec<Run>> {
    let list = list_of(&plan.folder)?;
    let text = std::fs::read_to_string(&list)
        .map_err(|e| Error::new(format!("cannot read `{}`: {e}", list.display())))?;
    let name = list.display().to_string();
    let mut lines = text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty());
    let at = |line: usize| Pos { line: line as u32 + 1, column: 1, ..Pos::default() };
    let (first, titles) = lines.next().ok_or_else(|| Error::new(format!("`{name}` is empty")))?;
    let columns = Columns::of(titles).map_err(|e| e.at(name.clone(), at(first)))?;
    let mut runs: Vec<Run> = Vec::new();
    for (index, line) in lines {
        let run = columns.run(line, plan, subject).map_err(|e| e.at(name.clone(), at(index)))?;
        runs.push(run);
    }
    if runs.is_empty() {
        return Err(Error::new(format!("`{name}` lists no picture")));
    }
    runs.sort_by_key(|run| run.samples_per_pixel);
    for i in 1..runs.len() {
        if runs[i].samples_per_pixel == runs[i - 1].samples_per_pixel {
            runs[i].repeat = runs[i - 1].repeat + 1;
        }
    }
    Ok(runs)
}

/// The one CSV file of a folder.
fn list_of(folder: &Path) -> Result<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .map_err(|e| Error::new(format!("cannot read the folder `{}`: {e}", folder.display())))?;
    let mut lists: Vec<PathBuf> = entries
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")))
        .collect();
    lists.sort();
    match lists.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(Error::new(format!("there is no CSV file in `{}`", folder.display()))
            .hint("write one with the columns file, seconds, spp")),
        _ => Err(Error::new(format!("there are {} CSV files in `{}`", lists.len(), folder.display()))
            .hint("leave the one that lists the pictures")),
    }
}

impl Columns {
    fn of(titles: &str) -> Result<Columns> {
        let titles: Vec<&str> = titles.split(',').map(str::trim).collect();
        let find = |name: &str| titles.iter().position(|t| *t == name);
        let need = |name: &str| {
            find(name).ok_or_else(|| {
                Error::new(format!("there is no column `{name}`")).hint("expected file, seconds, spp")
            })
        };
        Ok(Columns {
            file: need("file")?,
            seconds: need("seconds")?,
            samples: need("spp")?,
            wall: find("wall_seconds"),
        })
    }

    fn run(&self, line: &str, plan: &SeriesPlan, subject: &Subject) -> Result<Run> {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let cell = |k: usize| {
            cells.get(k).copied().ok_or_else(|| Error::new(format!("only {} columns", cells.len())))
        };
        let positive = |k: usize, what: &str| -> Result<f64> {
            match cell(k)?.parse::<f64>() {
                Ok(v) if v > 0.0 && v.is_finite() => Ok(v),
                _ => Err(Error::new(format!("`{}` is no {what} above 0", cell(k)?))),
            }
        };
        let seconds = positive(self.seconds, "time")?;
        let samples = positive(self.samples, "sample count")?.round() as u64;
        let wall = self.wall.map_or(Ok(seconds), |k| positive(k, "time"))?;
        let image = plan.folder.join(cell(self.file)?);
        let picture = read_picture(&image)?;
        let size = [picture.width, picture.height];
        if size != subject.size {
            return Err(Error::new(format!(
                "`{}` has {}x{} pixels, the scene {}x{}",
                image.display(),
                size[0],
                size[1],
                subject.size[0],
                subject.size[1]
            )));
        }
        Ok(Run {
            key: String::new(),
            scene: subject.plan.name.clone(),
            configuration: plan.name.clone(),
            budget: format!("{samples} spp"),
            repeat: 0,
            image: std::path::absolute(&image).unwrap_or(image),
            seed: 0,
            samples_per_pixel: samples,
            wall_seconds: wall,
            cpu_seconds: seconds,
            prepare_seconds: 0.0,
            save_seconds: 0.0,
            measure_seconds: 0.0,
            threads: 0,
            rays: 0,
            bad_samples: 0,
            bad_causes: Vec::new(),
            reported_error: f64::NAN,
            measured_against: subject.measured_against.clone(),
            figures: subject.figures(&picture)?,
            external: true,
        })
    }
}
