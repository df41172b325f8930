//! Writes a file as a whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use crate::desc::{Error, Result};

/// Lets `fill` write `path`.part (open for reading and writing), flushes it to
/// the disk and renames it. On an error the unfinished file is removed and
/// `path` is as it was.
pub(super) fn write_whole<T>(
    path: &Path,
    fill: impl FnOnce(&File) -> std::result::Result<T, Box<dyn std::error::Error>>,
) -> Result<T> {
    if path.file_name().is_none() {
        return Err(Error::new(format!("cannot write `{}`: not the name of a file", path.display())));
    }
    let part = part_name(path);
    let open = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(&part);
    let file = open.map_err(|e| failure(path, &e).hint(hint(path, &e)))?;
    let filled = fill(&file).and_then(|value| {
        file.sync_all()?;
        Ok(value)
    });
    drop(file);
    let renamed = filled.and_then(|value| {
        fs::rename(&part, path)?;
        Ok(value)
    });
    renamed.map_err(|e| {
        // What is left of it helps nobody; if it cannot go either, it stays.
        let _ = fs::remove_file(&part);
        failure(path, e.as_ref())
    })
}

/// The name while it is being written.
fn part_name(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    PathBuf::from(name)
}

fn failure(path: &Path, error: &dyn std::error::Error) -> Error {
    Error::new(format!("cannot write `{}`: {error}", path.display()))
}

fn hint(path: &Path, error: &io::Error) -> String {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match error.kind() {
        io::ErrorKind::NotFound => format!("make the folder `{}` first", folder.display()),
        _ => format!("the folder `{}` must be writable", folder.display()),
    }
}

/// Writes `bytes` to `path`, whole or not at all.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, |mut file| Ok(io::Write::write_all(&mut file, bytes)?))
}
