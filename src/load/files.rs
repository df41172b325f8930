//! Finding and reading files: search path, regular files only, byte caps.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::desc::{Error, Result, nearest};

/// Largest scene file in bytes.
pub const XML_CAP: u64 = 256 << 20;
/// Largest mesh file in bytes.
pub const MESH_CAP: u64 = 8 << 30;
/// Largest image file in bytes.
pub const IMAGE_CAP: u64 = 2 << 30;
/// Largest file of a measured material in bytes.
pub const MEASURED_CAP: u64 = 2 << 30;
/// Largest spectrum file in bytes.
pub const SPECTRUM_CAP: u64 = 16 << 20;

/// Names tried as "did you mean" of a missing file: directories larger than
/// this are not looked through further.
const NEIGHBOURS: usize = 10_000;

/// Finds `name` in the first of `dirs` that has it. Absolute names are taken
/// as they are; names with a scheme, such as `https://…`, and those of other
/// machines, such as `//server/share/x`, are refused.
pub fn find(name: &str, dirs: &[PathBuf]) -> Result<PathBuf> {
    if name.is_empty() {
        return Err(Error::new("the file name is empty"));
    }
    if let Some(scheme) = scheme(name) {
        return Err(Error::new(format!("`{name}` is no file name"))
            .hint(format!("only files on this machine are read, not `{scheme}:` addresses")));
    }
    if [r"\\", "//"].iter().any(|start| name.starts_with(start)) {
        return Err(Error::new(format!("`{name}` names another machine"))
            .hint("only files on this machine are read; copy it, or mount its folder"));
    }
    let path = Path::new(name);
    let mut candidates: Vec<PathBuf> = if path.is_absolute() {
        vec![path.to_path_buf()]
    } else {
        dirs.iter().map(|d| d.join(path)).collect()
    };
    candidates.dedup();
    if let Some(found) = candidates.iter().find(|p| p.exists()) {
        return Ok(found.clone());
    }
    let error = Error::new(format!("cannot find the file `{name}`"));
    for candidate in &candidates {
        if let Some(near) = neighbour(candidate) {
            let near = path.with_file_name(near);
            return Err(error.hint(format!("did you mean `{}`?", near.display())));
        }
    }
    let looked: Vec<String> = candidates.iter().map(|p| format!("`{}`", p.display())).collect();
    Err(error.hint(format!("looked for {}", looked.join(", "))))
}

/// The scheme of `https://…`, `file://…` or `data:…`.
fn scheme(name: &str) -> Option<&str> {
    let (scheme, rest) = name.split_once(':')?;
    let is_word =
        scheme.len() > 1 && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b));
    (is_word && (rest.starts_with("//") || scheme.eq_ignore_ascii_case("data"))).then_some(scheme)
}

/// The file beside a missing one whose name is nearest.
fn neighbour(missing: &Path) -> Option<String> {
    let wanted = missing.file_name()?.to_str()?;
    let dir = missing.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .ok()?
        .take(NEIGHBOURS)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    names.sort_unstable();
    nearest(wanted, names.iter().map(String::as_str)).map(str::to_owned)
}

/// Opens a regular file of at most `cap` bytes; gives its length too.
pub fn open(path: &Path, cap: u64) -> Result<(File, u64)> {
    let cannot = |e: std::io::Error| Error::new(format!("cannot read `{}`: {e}", path.display()));
    let meta = std::fs::metadata(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Error::new(format!("cannot find the file `{}`", path.display())),
        _ => cannot(e),
    })?;
    if !meta.is_file() {
        return Err(Error::new(format!("`{}` is not a regular file", path.display())));
    }
    if meta.len() > cap {
        return Err(Error::new(format!(
            "`{}` has {} bytes, more than the {cap} that are read",
            path.display(),
            meta.len()
        )));
    }
    Ok((File::open(path).map_err(cannot)?, meta.len()))
}

/// Reads a regular file of at most `cap` bytes.
pub fn read_bytes(path: &Path, cap: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path, cap)?;
    let mut bytes = Vec::new();
    let wanted = usize::try_from(length).unwrap_or(usize::MAX);
    bytes
        .try_reserve_exact(wanted)
        .map_err(|_| Error::new(format!("no memory for the {length} bytes of `{}`", path.display())))?;
    // What says that it is empty and is not, as files of /proc do, is empty.
    file.take(length)
        .read_to_end(&mut bytes)
        .map_err(|e| Error::new(format!("cannot read `{}`: {e}", path.display())))?;
    Ok(bytes)
}

/// Bytes that a compressed mesh may unpack to, for each of its own; real ones
/// come to 2 to 20, and only what wants to fill the memory to a thousand.
pub const EXPANSION: u64 = 200;
/// What it may unpack to however small it is.
pub const UNPACKED: u64 = 16 << 20;

/// Unpacks what gzip has compressed, to at most `cap` bytes and [`EXPANSION`]
/// times its own; gives anything else back as it is.
pub fn unpack(bytes: Vec<u8>, cap: u64) -> std::result::Result<Vec<u8>, String> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let cap = cap.min(UNPACKED.max(EXPANSION * bytes.len() as u64));
    let mut unpacked = Vec::new();
    flate2::read::MultiGzDecoder::new(&*bytes)
        .take(cap + 1)
        .read_to_end(&mut unpacked)
        .map_err(|e| format!("cannot unpack it: {e}"))?;
    if unpacked.len() as u64 > cap {
        return Err(format!("its {} bytes unpack to more than the {cap} that are read", bytes.len()));
    }
    Ok(unpacked)
}

/// Reads a UTF-8 text file of at most `cap` bytes.
pub fn read_text(path: &Path, cap: u64) -> Result<String> {
    String::from_utf8(read_bytes(path, cap)?).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let line = 1 + e.as_bytes()[..at].iter().filter(|b| **b == b'\n').count();
        Error::new(format!("the text is not UTF-8 (line {line})")).hint("save it as UTF-8")
    })
}

/// The same path for every name of a file, to recognise it again.
pub fn canonical(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemes() {
        for name in ["https://a/b", "file:///etc/passwd", "data:,x", "FTP://x"] {
            assert!(scheme(name).is_some(), "{name}");
        }
        for name in ["a/b.obj", "C:/a.obj", "C:\\a.obj", "../a:b.obj", "a.obj"] {
            assert!(scheme(name).is_none(), "{name}");
        }
    }

    #[test]
    fn gzip_is_unpacked_up_to_the_cap() {
        use std::io::Write as _;
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        packer.write_all(&[7; 1000]).unwrap();
        let packed = packer.finish().unwrap();
        assert_eq!(unpack(packed.clone(), 1000).unwrap(), [7; 1000]);
        assert!(
            unpack(packed.clone(), 999).unwrap_err().contains("unpack to more than the 999 that are read")
        );
        assert!(unpack(packed[..packed.len() / 2].to_vec(), 1000).unwrap_err().starts_with("cannot unpack"));
        assert_eq!(unpack(b"ply".to_vec(), 1).unwrap(), b"ply");
    }

    #[test]
    fn only_regular_files() {
        let dir = tempfile::tempdir().unwrap();
        assert!(open(dir.path(), 10).unwrap_err().message.ends_with("is not a regular file"));
        let file = dir.path().join("x");
        std::fs::write(&file, [0; 11]).unwrap();
        assert!(
            open(&file, 10).unwrap_err().message.ends_with("has 11 bytes, more than the 10 that are read")
        );
        assert_eq!(read_bytes(&file, 11).unwrap().len(), 11);
    }
}
