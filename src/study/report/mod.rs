//! A study as a folder to read: `index.html` and `plots/`.
//!
//! The page is one file that asks for nothing else: style, script, the study
//! itself as JSON and the pictures of the viewer are inside, and a content
//! security policy forbids it to fetch anything. Tables are there without
//! script; plots and viewer are drawn from the embedded data. The same plots
//! lie beside it as SVG and PNG, for papers and slides.

mod axis;
mod draw;
mod exhibits;
mod format;
mod page;
mod plots;

use std::fs;
use std::path::Path;

use super::model::{Exhibit, Study};
use crate::desc::{Error, Result};
use crate::save::write_file;

/// Writes `index.html`, `plots/*.svg` and `plots/*.png` into `folder`, which is
/// made if it is missing; files there of the same names are replaced, each as a
/// whole or not at all. Scenes, configurations and figures may be missing or
/// not finite: then the page says so and the plot is left out.
///
/// # Errors
/// When a picture has not three values per pixel, or a file cannot be written.
pub fn write_report(folder: &Path, study: &Study, exhibits: &[Exhibit]) -> Result<()> {
    let pictures = exhibits::encode(exhibits)?;
    let plots_folder = folder.join("plots");
    fs::create_dir_all(&plots_folder)
        .map_err(|e| Error::new(format!("cannot make the folder `{}`: {e}", plots_folder.display())))?;
    let plots = plots::all(study)?;
    let painter = draw::Painter::new();
    for plot in &plots {
        write_file(&plots_folder.join(format!("{}.svg", plot.name)), plot.svg.as_bytes())?;
        write_file(&plots_folder.join(format!("{}.png", plot.name)), &painter.png(&plot.svg)?)?;
    }
    let page = page::render(study, &pictures, &plots)?;
    write_file(&folder.join("index.html"), page.as_bytes())
}
