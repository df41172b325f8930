//! Writes a file as a whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File, Metadata, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::desc::{Error, Result};

/// Longest chain of symbolic links that is followed.
const MAX_LINKS: usize = 40;

/// Where the bytes of a file really go.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    /// A file that is there or will be: the end of a chain of links.
    File(PathBuf),
    /// A device or a pipe (`/dev/null`): nothing can take its name.
    Device(PathBuf),
}

/// Lets `fill` write `path`.part (open for reading and writing), flushes it to
/// the disk and renames it; then the folder is flushed too. On an error the
/// unfinished file is removed and `path` is as it was.
///
/// A symbolic link is followed: the file it names is replaced. Permissions of
/// the file that was there stay.
pub(super) fn write_whole<T>(path: &Path, fill: impl FnOnce(&File) -> io::Result<T>) -> Result<T> {
    let target = target(path).map_err(|e| failure(path, &e))?;
    write_target(&target, fill).map_err(|e| failure(path, &e))
}

/// Fails now where [`write_file`] and its kin would fail at the end: no folder,
/// no permission, a folder of that name, a file that is write-protected or
/// being written by somebody else. Leaves nothing behind.
///
/// # Errors
/// What stands in the way, and what to do.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || -> io::Result<()> {
        match target(path)? {
            // To open and close a pipe would end its reader.
            Target::Device(_) => Ok(()),
            Target::File(file) => {
                let part = part_name(&file);
                drop(open_part(&part)?);
                match fs::remove_file(&part) {
                    // Somebody else tried at the same time.
                    Err(e) if e.kind() != ErrorKind::NotFound => Err(e),
                    _ => Ok(()),
                }
            }
        }
    };
    check().map_err(|e| failure(path, &e))
}

/// Fails when one of the last `outputs` paths is the same file as another of
/// them, or as one of those before, however they are spelled.
///
/// # Errors
/// Names the two.
pub fn check_distinct(paths: &[&Path], outputs: usize) -> Result<()> {
    let place = |path: &Path| -> Option<PathBuf> {
        let Ok(Target::File(file)) = target(path) else { return None };
        let folder = fs::canonicalize(folder_of(&file)).ok()?;
        Some(folder.join(file.file_name()?))
    };
    for (i, path) in paths.iter().enumerate().skip(paths.len().saturating_sub(outputs)) {
        let Some(own) = place(path) else { continue };
        if let Some(other) = paths[..i].iter().find(|other| place(other).as_ref() == Some(&own)) {
            let message =
                format!("cannot write `{}`: it is the same file as `{}`", path.display(), other.display());
            return Err(Error::new(message).hint("give each a name of its own"));
        }
    }
    Ok(())
}

/// Follows links, and finds out what is there.
fn target(path: &Path) -> io::Result<Target> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        if path.file_name().is_none() {
            return Err(io::Error::new(ErrorKind::IsADirectory, "not the name of a file"));
        }
        let Ok(found) = fs::symlink_metadata(&path) else { return Ok(Target::File(path)) };
        if found.is_symlink() {
            let next = fs::read_link(&path)?;
            path = folder_of(&path).join(next);
            continue;
        }
        if found.is_dir() {
            return Err(io::Error::new(ErrorKind::IsADirectory, "there is a folder of that name"));
        }
        if !found.is_file() {
            return Ok(Target::Device(path));
        }
        // Taking its name would work: it is the folder that is written. But
        // somebody has protected the file.
        if found.permissions().readonly() {
            return Err(io::Error::new(ErrorKind::PermissionDenied, "the file is write-protected"));
        }
        return Ok(Target::File(path));
    }
    Err(io::Error::other("too many symbolic links"))
}

fn write_target<T>(target: &Target, fill: impl FnOnce(&File) -> io::Result<T>) -> io::Result<T> {
    let path = match target {
        Target::File(path) => path,
        Target::Device(device) => return write_device(device, fill),
    };
    let part = part_name(path);
    let file = open_part(&part)?;
    let written = fill(&file).and_then(|value| {
        if let Ok(before) = fs::metadata(path) {
            file.set_permissions(before.permissions())?;
        }
        file.sync_all()?;
        // Before the lock goes with the file.
        fs::rename(&part, path)?;
        Ok(value)
    });
    drop(file);
    match written {
        Ok(value) => {
            flush_folder(path);
            Ok(value)
        }
        Err(error) => {
            // What is left of it helps nobody; if it cannot go either, it stays.
            let _ = fs::remove_file(&part);
            Err(error)
        }
    }
}

/// Writes to a temporary file first, since writers seek, and copies it.
fn write_device<T>(device: &Path, fill: impl FnOnce(&File) -> io::Result<T>) -> io::Result<T> {
    let mut to = OpenOptions::new().write(true).open(device)?;
    let name = format!("etendue-{}.part", std::process::id());
    let part = std::env::temp_dir().join(name);
    let file = open_part(&part)?;
    let copied = fill(&file).and_then(|value| {
        io::copy(&mut File::open(&part)?, &mut to)?;
        Ok(value)
    });
    let _ = fs::remove_file(&part);
    copied
}

/// An empty file of that name, locked: what a killed program left is written
/// over, what another is writing is not.
fn open_part(part: &Path) -> io::Result<File> {
    if fs::symlink_metadata(part).is_ok_and(|found: Metadata| found.is_symlink()) {
        fs::remove_file(part)?;
    }
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(part)?;
    // Where the file system knows no locks, there is none.
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Err(io::Error::new(ErrorKind::ResourceBusy, "another program is writing it"));
    }
    file.set_len(0)?;
    Ok(file)
}

/// The name while it is being written.
fn part_name(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    PathBuf::from(name)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Makes the new name last. Where folders cannot be flushed the file is whole
/// all the same; it may be the one before after a power cut.
fn flush_folder(path: &Path) {
    if let Ok(folder) = File::open(folder_of(path)) {
        let _ = folder.sync_all();
    }
}

fn failure(path: &Path, error: &io::Error) -> Error {
    let folder = folder_of(path).display();
    let hint = match error.kind() {
        ErrorKind::NotFound => format!("make the folder `{folder}` first"),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            format!("make room on the disk of `{folder}`, or write to another")
        }
        ErrorKind::FileTooLarge => {
            "files may not be that large here (`ulimit -f`, or the file system)".to_owned()
        }
        ErrorKind::IsADirectory => "give the name of a file".to_owned(),
        ErrorKind::ResourceBusy => "give each program a file of its own".to_owned(),
        ErrorKind::PermissionDenied if error.get_ref().is_some() => {
            "allow writing (`chmod u+w`), or give another name".to_owned()
        }
        _ => format!("the folder `{folder}` must be there and writable"),
    };
    Error::new(format!("cannot write `{}`: {error}", path.display())).hint(hint)
}

/// Writes `bytes` to `path`, whole or not at all.
///
/// # Errors
/// What went wrong and what to do; a file that was there is as it was.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, |mut file| io::Write::write_all(&mut file, bytes))
}
