//! Mitsuba's `.serialized` meshes, versions 3 and 4: little endian, a header
//! of two 16-bit words, then one zlib stream per shape (flags, name, counts,
//! positions, normals, texture coordinates, colours, triangles), and at the
//! end of the file the offsets of all shapes.
//!
//! Vertex colours are passed over. The flag "face normals" is not obeyed: nor
//! does Mitsuba 3, whatever its manual says; a warning says so.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Take};
use std::path::Path;

use flate2::bufread::ZlibDecoder;

use super::files;
use crate::desc::{Error, Mesh, Result};
use crate::math::{Vec2, Vec3};

type Step<T> = std::result::Result<T, String>;

const MAGIC: u16 = 0x041c;
const NORMALS: u32 = 0x1;
const UVS: u32 = 0x2;
const COLORS: u32 = 0x8;
const FACE_NORMALS: u32 = 0x10;
const DOUBLE: u32 = 0x2000;
/// Longest name of a shape in bytes.
const NAME: usize = 1 << 16;

/// Reads one shape of a file; gives warnings too.
pub fn read(path: &Path, shape_index: u32) -> Result<(Mesh, Vec<String>)> {
    let (file, length) = files::open(path, files::MESH_CAP)?;
    let shape =
        |message: String| Error::new(format!("mesh `{}`, shape {shape_index}: {message}", path.display()));
    let (mesh, flags) = read_shape(file, length, shape_index).map_err(shape)?;
    let mut warnings = Vec::new();
    if flags & FACE_NORMALS != 0 {
        warnings.push(format!(
            "{}: shape {shape_index} asks for face normals, which Mitsuba 3 does not obey either; \
             set `face_normals` on the shape",
            path.display()
        ));
    }
    Ok((mesh, warnings))
}

/// Reads `N` bytes from a place in the file.
fn read_at<const N: usize>(file: &mut File, at: u64) -> Step<[u8; N]> {
    let mut bytes = [0; N];
    file.seek(SeekFrom::Start(at))
        .and_then(|_| file.read_exact(&mut bytes))
        .map_err(|_| "the file ends too early".to_string())?;
    Ok(bytes)
}

fn read_shape(mut file: File, length: u64, shape_index: u32) -> Step<(Mesh, u32)> {
    let word = |b: [u8; 4], i: usize| u16::from_le_bytes([b[i], b[i + 1]]);
    let start = read_at::<4>(&mut file, 0)?;
    if word(start, 0) != MAGIC {
        return Err("not a Mitsuba serialized file".into());
    }
    let version = word(start, 2);
    if !(3..=4).contains(&version) {
        return Err(format!("unknown version {version}, expected 3 or 4"));
    }
    let offset = if shape_index == 0 { 0 } else { shape_offset(&mut file, length, shape_index, version)? };
    let header = read_at::<4>(&mut file, offset)?;
    if word(header, 0) != MAGIC {
        return Err("there is no shape at its offset".into());
    }
    let compressed = length.saturating_sub(offset);
    let stream = ZlibDecoder::new(BufReader::new(file));
    let stream = stream.take(compressed.saturating_mul(files::EXPANSION).max(files::UNPACKED));
    Shape { stream }.read(version)
}

/// The offset of a shape, from the table at the end of the file.
fn shape_offset(file: &mut File, length: u64, shape_index: u32, version: u16) -> Step<u64> {
    let count = u32::from_le_bytes(read_at(file, length.saturating_sub(4))?);
    if shape_index >= count {
        return Err(format!("`shape_index` is out of range, there are {count}"));
    }
    let from_end = u64::from(count - shape_index);
    let size = if version == 4 { 8 } else { 4 };
    let at = length.checked_sub(4 + from_end * size).ok_or("the file ends too early")?;
    if version == 4 {
        Ok(u64::from_le_bytes(read_at(file, at)?))
    } else {
        Ok(u64::from(u32::from_le_bytes(read_at(file, at)?)))
    }
}

struct Shape<R: Read> {
    stream: Take<R>,
}

impl<R: Read> Shape<R> {
    fn exact<const N: usize>(&mut self) -> Step<[u8; N]> {
        let mut bytes = [0; N];
        self.stream.read_exact(&mut bytes).map_err(|e| format!("the compressed data is broken: {e}"))?;
        Ok(bytes)
    }

    /// Passes over the shape's name, which a zero ends.
    fn name(&mut self) -> Step<()> {
        for _ in 0..NAME {
            if self.exact::<1>()? == [0] {
                return Ok(());
            }
        }
        Err(format!("its name has more than {NAME} bytes"))
    }

    /// `count` records of `size` bytes; memory grows only as data comes.
    fn bytes(&mut self, count: u64, size: u64, what: &str) -> Step<Vec<u8>> {
        let wanted = count.checked_mul(size).filter(|w| *w <= self.stream.limit());
        let wanted = wanted.ok_or_else(|| format!("{count} {what} cannot fit into this file"))?;
        let mut bytes = Vec::new();
        (&mut self.stream)
            .take(wanted)
            .read_to_end(&mut bytes)
            .map_err(|e| format!("the compressed data is broken: {e}"))?;
        if bytes.len() as u64 != wanted {
            return Err(format!("the data ends before all {count} {what}"));
        }
        Ok(bytes)
    }

    /// `count` records of `N` floats, single or double.
    fn floats<const N: usize>(&mut self, count: u64, double: bool, what: &str) -> Step<Vec<[f32; N]>> {
        let size = if double { 8 } else { 4 };
        let bytes = self.bytes(count, N as u64 * size, what)?;
        let mut out = Vec::with_capacity(count as usize);
        for (index, record) in bytes.chunks_exact(N * size as usize).enumerate() {
            let mut values = [0.0; N];
            for (value, raw) in values.iter_mut().zip(record.chunks_exact(size as usize)) {
                let mut wide = [0; 8];
                wide[..raw.len()].copy_from_slice(raw);
                let bits = u64::from_le_bytes(wide);
                *value = if double { f64::from_bits(bits) as f32 } else { f32::from_bits(bits as u32) };
            }
            if !values.iter().all(|v| v.is_finite()) {
                return Err(format!("vertex {index}: its {what} is not finite"));
            }
            out.push(values);
        }
        Ok(out)
    }

    fn read(mut self, version: u16) -> Step<(Mesh, u32)> {
        let flags = u32::from_le_bytes(self.exact()?);
        if version == 4 {
            self.name()?;
        }
        let vertices = u64::from_le_bytes(self.exact()?);
        let triangles = u64::from_le_bytes(self.exact()?);
        if vertices >= u64::from(u32::MAX) {
            return Err(format!("{vertices} vertices are too many"));
        }
        let double = flags & DOUBLE != 0;
        let positions = self.floats::<3>(vertices, double, "position")?;
        let mut mesh = Mesh { positions: positions.into_iter().map(Vec3::from).collect(), ..Mesh::default() };
        if flags & NORMALS != 0 {
            let normals = self.floats::<3>(vertices, double, "normal")?;
            mesh.normals = normals.into_iter().map(Vec3::from).collect();
        }
        if flags & UVS != 0 {
            let uvs = self.floats::<2>(vertices, double, "texture coordinate")?;
            mesh.uvs = uvs.into_iter().map(Vec2::from).collect();
        }
        if flags & COLORS != 0 {
            self.bytes(vertices, if double { 24 } else { 12 }, "colours")?;
        }
        let bytes = self.bytes(triangles, 12, "triangles")?;
        mesh.triangles.reserve_exact(triangles as usize);
        for (face, record) in bytes.chunks_exact(12).enumerate() {
            let index =
                |i: usize| u32::from_le_bytes([record[i], record[i + 1], record[i + 2], record[i + 3]]);
            let triangle = [index(0), index(4), index(8)];
            if let Some(out) = triangle.iter().find(|i| u64::from(**i) >= vertices) {
                return Err(format!("face {face}: vertex {out} is out of range, there are {vertices}"));
            }
            mesh.triangles.push(triangle);
        }
        Ok((mesh, flags))
    }
}
