//! The bytes behind a glTF file: the chunks of a `.glb`, data URIs and files
//! beside it; buffers, and the views into them.
//!
//! A URI is relative to the file's folder and stays inside of it unless
//! [`LoadOptions::allow_outside`] says otherwise; nothing is fetched.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::super::{LoadOptions, files};
use super::json::{BufferView, Root};
use super::{fail, json, meshopt};
use crate::desc::{Error, Result};

/// Largest `.gltf` or `.glb` file, and largest buffer file, in bytes.
const FILE_CAP: u64 = 8 << 30;
/// Largest JSON text in bytes.
const JSON_CAP: usize = 512 << 20;

/// What may still be decoded: bytes, counted down by all that decode.
#[derive(Debug)]
pub struct Budget {
    left: AtomicU64,
    whole: u64,
}

impl Budget {
    /// A budget of so many bytes.
    pub fn new(bytes: u64) -> Budget {
        Budget { left: AtomicU64::new(bytes), whole: bytes }
    }

    /// Bytes that may still be decoded.
    pub fn left(&self) -> u64 {
        self.left.load(Ordering::Relaxed)
    }

    /// Takes from it; an error when there is not enough left.
    pub fn take(&self, bytes: u64, place: &str) -> Result<()> {
        let taken =
            self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes));
        taken.map(|_| ()).map_err(|_| {
            fail(place, format!("the file decodes to more than the {} bytes allowed", self.whole))
                .hint("`max_mesh_bytes` sets the limit")
        })
    }
}

/// A parsed file with its buffers.
#[derive(Debug)]
pub struct Source {
    /// The JSON.
    pub root: Root,
    /// What may still be decoded.
    pub budget: Budget,
    /// How the user names the file.
    pub name: String,
    folder: PathBuf,
    allow_outside: bool,
    /// One per buffer; `None` for a buffer that only stands in for compressed data.
    buffers: Vec<Option<Vec<u8>>>,
    /// Bytes of the views that were compressed.
    unpacked: Vec<Option<Vec<u8>>>,
}

impl Source {
    /// Reads a file and all its buffers.
    pub fn read(path: &Path, options: &LoadOptions) -> Result<Source> {
        let bytes = files::read_bytes(path, FILE_CAP)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Source::from_bytes(bytes, path.display().to_string(), folder, options)
    }

    /// From the bytes of a `.gltf` or `.glb` file.
    pub fn from_bytes(
        bytes: Vec<u8>,
        name: String,
        folder: PathBuf,
        options: &LoadOptions,
    ) -> Result<Source> {
        let (text, chunk) = if bytes.starts_with(b"glTF") {
            let (text, chunk) = glb(&bytes)?;
            (text, chunk.map(<[u8]>::to_vec))
        } else {
            (&bytes[..], None)
        };
        if text.len() > JSON_CAP {
            return Err(Error::new(format!(
                "the JSON has {} bytes, more than the {JSON_CAP} read",
                text.len()
            )));
        }
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let root = json::parse(text).map_err(Error::new)?;
        let mut source = Source {
            root,
            budget: Budget::new(options.max_mesh_bytes),
            name,
            folder,
            allow_outside: options.allow_outside,
            buffers: Vec::new(),
            unpacked: Vec::new(),
        };
        source.check_version()?;
        source.read_buffers(chunk)?;
        source.unpack_views()?;
        Ok(source)
    }

    fn check_version(&self) -> Result<()> {
        let asset = &self.root.asset;
        for (name, version) in [("version", Some(&asset.version)), ("minVersion", asset.min_version.as_ref())]
        {
            let Some(version) = version else { continue };
            if version.split('.').next() != Some("2") {
                let message = format!("is `{version}`; glTF 2.0 is read");
                return Err(fail(&format!("asset.{name}"), message)
                    .hint("convert older files with gltf-pipeline or Blender"));
            }
        }
        Ok(())
    }

    fn read_buffers(&mut self, mut chunk: Option<Vec<u8>>) -> Result<()> {
        for (i, buffer) in self.root.buffers.iter().enumerate() {
            let place = format!("buffers[{i}]");
            let bytes = match &buffer.uri {
                Some(uri) => {
                    let bytes = self.fetch(uri, FILE_CAP, &format!("{place}.uri"))?;
                    self.budget.take(bytes.len() as u64, &place)?;
                    Some(bytes)
                }
                None if i == 0 && chunk.is_some() => chunk.take(),
                None if buffer.extensions.meshopt.fallback => None,
                None if self.stands_in(i) => None,
                None => return Err(fail(&place, "has no `uri`, and the file has no binary chunk for it")),
            };
            if let Some(bytes) = &bytes
                && (bytes.len() as u64) < buffer.byte_length
            {
                let message =
                    format!("has {} bytes, fewer than its `byteLength` {}", bytes.len(), buffer.byte_length);
                return Err(fail(&place, message).hint("the file may be cut off"));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// True if all views into a buffer are compressed elsewhere.
    fn stands_in(&self, buffer: usize) -> bool {
        let mut views = self.root.buffer_views.iter().filter(|v| v.buffer == buffer).peekable();
        views.peek().is_some() && views.all(|v| v.extensions.meshopt.is_some())
    }

    fn unpack_views(&mut self) -> Result<()> {
        for (i, view) in self.root.buffer_views.iter().enumerate() {
            let Some(packed) = &view.extensions.meshopt else {
                self.unpacked.push(None);
                continue;
            };
            let place = format!("bufferViews[{i}].extensions.EXT_meshopt_compression");
            let range = (packed.buffer, packed.byte_offset, packed.byte_length);
            let bytes = self.slice(range, &place)?;
            let size = packed.count.checked_mul(packed.byte_stride);
            if size != Some(view.byte_length) {
                let message = format!(
                    "`count` {} times `byteStride` {} is not the `byteLength` {} of the view",
                    packed.count, packed.byte_stride, view.byte_length
                );
                return Err(fail(&place, message));
            }
            self.budget.take(view.byte_length, &place)?;
            let unpacked = meshopt::decode(packed, bytes).map_err(|message| fail(&place, message))?;
            self.unpacked.push(Some(unpacked));
        }
        Ok(())
    }

    /// Part of a buffer: (buffer, offset, length).
    fn slice(&self, range: (usize, u64, u64), place: &str) -> Result<&[u8]> {
        let (index, offset, length) = range;
        let Some(buffer) = self.buffers.get(index) else {
            return Err(fail(place, format!("there is no buffers[{index}]")));
        };
        let Some(bytes) = buffer else {
            return Err(fail(place, format!("buffers[{index}] holds no data")));
        };
        let size =
            bytes.len().min(usize::try_from(self.root.buffers[index].byte_length).unwrap_or(usize::MAX));
        let end = offset.checked_add(length).filter(|end| *end <= size as u64);
        match end {
            Some(end) => Ok(&bytes[offset as usize..end as usize]),
            None => Err(fail(
                place,
                format!("{length} bytes from {offset} on reach over the {size} bytes of buffers[{index}]"),
            )),
        }
    }

    /// The bytes of a view, and the view.
    pub fn view(&self, index: usize, place: &str) -> Result<(&[u8], &BufferView)> {
        let Some(view) = self.root.buffer_views.get(index) else {
            return Err(fail(place, format!("there is no bufferViews[{index}]")));
        };
        if let Some(bytes) = &self.unpacked[index] {
            return Ok((bytes, view));
        }
        let range = (view.buffer, view.byte_offset, view.byte_length);
        Ok((self.slice(range, &format!("bufferViews[{index}]"))?, view))
    }

    /// The bytes behind a URI, at most `cap` of them.
    pub fn fetch(&self, uri: &str, cap: u64, place: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            return from_data_uri(data).map_err(|message| fail(place, message));
        }
        let path = self.resolve(uri, place)?;
        files::read_bytes(&path, cap).map_err(|e| wrap(place, e))
    }

    /// The file that a URI names.
    fn resolve(&self, uri: &str, place: &str) -> Result<PathBuf> {
        let name = percent_decoded(uri);
        let inside = Path::new(&*name)
            .components()
            .try_fold(0_i32, |depth, part| match part {
                std::path::Component::Normal(_) => Some(depth + 1),
                std::path::Component::CurDir => Some(depth),
                std::path::Component::ParentDir if depth > 0 => Some(depth - 1),
                _ => None,
            })
            .is_some();
        let has_scheme = name.split_once(':').is_some_and(|(s, _)| s.len() > 1 && !s.contains(['/', '.']));
        if !has_scheme && (!inside || name.contains('\\')) && !self.allow_outside {
            return Err(fail(place, format!("`{name}` lies outside of the folder of the scene"))
                .hint("--allow-outside reads it all the same"));
        }
        if has_scheme {
            return Err(
                fail(place, format!("`{name}` is no file name")).hint("only files on this machine are read")
            );
        }
        files::find(&name, std::slice::from_ref(&self.folder)).map_err(|e| wrap(place, e))
    }
}

/// An error of another part of the room, at a place of this file.
pub fn wrap(place: &str, error: Error) -> Error {
    Error { message: format!("{place}: {}", error.message), ..error }
}

/// The JSON and the binary chunk of a `.glb` file.
fn glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let cut = |what: &str| Error::new(format!("the binary glTF is cut off: {what}"));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(cut("its header has fewer than 12 bytes"));
    };
    if version != 2 {
        return Err(Error::new(format!("binary glTF of version {version}; version 2 is read")));
    }
    if u64::from(length) > bytes.len() as u64 {
        return Err(cut(&format!("it should have {length} bytes and has {}", bytes.len())));
    }
    let bytes = &bytes[..length as usize];
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let chunk = |at: usize| -> Result<Option<(u32, &[u8], usize)>> {
        let (Some(length), Some(kind)) = (word(at), word(at + 4)) else { return Ok(None) };
        let end = (at + 8).checked_add(length as usize).filter(|end| *end <= bytes.len());
        match end {
            Some(end) => Ok(Some((kind, &bytes[at + 8..end], end))),
            None => Err(cut(&format!("a chunk at byte {at} should have {length} bytes"))),
        }
    };
    const JSON: u32 = 0x4e4f_534a;
    const BIN: u32 = 0x004e_4942;
    let Some((JSON, text, next)) = chunk(12)? else {
        return Err(Error::new("the first chunk of the binary glTF is not JSON"));
    };
    // Further chunks are of kinds that the reader is to skip.
    match chunk(next)? {
        Some((BIN, data, _)) => Ok((text, Some(data))),
        _ => Ok((text, None)),
    }
}

/// What follows `data:`.
fn from_data_uri(data: &str) -> std::result::Result<Vec<u8>, String> {
    use base64::Engine;
    use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
    let (head, body) = data.split_once(',').ok_or("a data URI needs a comma before its data")?;
    if !head.ends_with(";base64") {
        return Ok(percent_decoded(body).into_owned().into_bytes());
    }
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    GeneralPurpose::new(&base64::alphabet::STANDARD, config)
        .decode(body.trim())
        .map_err(|e| format!("the data URI is not base64: {e}"))
}

/// The text with `%20` and the like replaced; as it is where that gives no UTF-8.
fn percent_decoded(text: &str) -> Cow<'_, str> {
    if !text.contains('%') {
        return Cow::Borrowed(text);
    }
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let hex = |at: usize| bytes.get(at).and_then(|b| char::from(*b).to_digit(16));
        match (bytes[i], hex(i + 1), hex(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, _, _) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    String::from_utf8(out).map_or(Cow::Borrowed(text), Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris() {
        assert_eq!(percent_decoded("a%20b%C3%A9%zz"), "a bé%zz");
        assert_eq!(percent_decoded("%ff"), "%ff");
        assert_eq!(from_data_uri("application/octet-stream;base64,AAEC").unwrap(), [0, 1, 2]);
        assert_eq!(from_data_uri(";base64,AAE=").unwrap(), [0, 1]);
        assert_eq!(from_data_uri(";base64,AAE").unwrap(), [0, 1]);
        assert!(from_data_uri("base64").unwrap_err().contains("comma"));
        assert!(from_data_uri(";base64,?").unwrap_err().contains("not base64"));
    }

    #[test]
    fn budgets_run_out() {
        let budget = Budget::new(10);
        assert!(budget.take(6, "x").is_ok() && budget.take(4, "x").is_ok());
        assert!(
            budget
                .take(1, "x")
                .unwrap_err()
                .message
                .starts_with("x: the file decodes to more than the 10 bytes")
        );
    }
}
