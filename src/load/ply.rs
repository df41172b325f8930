//! Stanford PLY, text or binary of either byte order: positions `x y z`,
//! normals `nx ny nz`, texture coordinates `u v`, `s t` or
//! `texture_u texture_v`, faces `vertex_index` or `vertex_indices`. Polygons
//! become fans. Other elements and properties are passed over. A file that is
//! compressed by gzip is unpacked first.
//!
//! A header that promises more than the file holds is an error before anything
//! is allocated.

use std::path::Path;

use super::files;
use crate::desc::{Error, Mesh, MeshAttribute, Result};
use crate::math::{Vec2, Vec3};

type Step<T> = std::result::Result<T, String>;

/// Reads a PLY file.
pub fn read(path: &Path, flip_tex_coords: bool) -> Result<Mesh> {
    let bytes = files::unpack(files::read_bytes(path, files::MESH_CAP)?, files::MESH_CAP)
        .map_err(|message| Error::new(format!("mesh `{}`: {message}", path.display())))?;
    let mut mesh =
        parse(&bytes).map_err(|message| Error::new(format!("mesh `{}`: {message}", path.display())))?;
    if flip_tex_coords {
        mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(mesh)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn parse(word: &str) -> Step<Number> {
        Ok(match word {
            "char" | "int8" => Number::I8,
            "uchar" | "uint8" => Number::U8,
            "short" | "int16" => Number::I16,
            "ushort" | "uint16" => Number::U16,
            "int" | "int32" => Number::I32,
            "uint" | "uint32" => Number::U32,
            "float" | "float32" => Number::F32,
            "double" | "float64" => Number::F64,
            _ => return Err(format!("unknown number type `{word}` in the header")),
        })
    }

    fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::F64 => 8,
        }
    }
}

#[derive(Debug)]
struct Property {
    name: String,
    number: Number,
    /// For lists: the type of the length.
    length: Option<Number>,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Text,
    Little,
    Big,
}

/// Elements, and properties of one, that a file may have.
const MANY: usize = 1000;
/// Numbers of attributes for each byte of the file: a polygon's stand once in
/// the file and at each of its triangles in memory.
const NUMBERS: usize = 16;
/// Those that a mesh may have however short its file.
const FEW_NUMBERS: usize = 1 << 20;

/// The first lines of a PLY file.
struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

/// Cuts the next line off, without its end.
fn next_line<'a>(rest: &mut &'a [u8]) -> Step<&'a str> {
    let end = rest.iter().take(1 << 16).position(|b| *b == b'\n').ok_or("the header has no `end_header`")?;
    let line = &rest[..end];
    *rest = &rest[end + 1..];
    std::str::from_utf8(line).map(str::trim_end).map_err(|_| "the header is not text".into())
}

fn header(rest: &mut &[u8]) -> Step<Header> {
    if next_line(rest).ok() != Some("ply") {
        return Err("not a PLY file: it does not start with `ply`".into());
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let line = next_line(rest)?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["end_header"] => break,
            ["format", name, "1.0"] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Text,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(format!("unknown format `{name}` in the header")),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| format!("`{count}` is no count of `{name}`"))?;
                if elements.len() >= MANY {
                    return Err(format!("the header has more than {MANY} elements"));
                }
                elements.push(Element { name: name.into(), count, properties: Vec::new() });
            }
            ["property", ref about @ .., name] => {
                let (length, number) = match *about {
                    [number] => (None, Number::parse(number)?),
                    ["list", length, number] => (Some(Number::parse(length)?), Number::parse(number)?),
                    _ => return Err(format!("cannot read the header line `{line}`")),
                };
                if length.is_some_and(|l| matches!(l, Number::F32 | Number::F64)) {
                    return Err(format!("the length of list `{name}` is not an integer"));
                }
                let element = elements.last_mut().ok_or("a property stands before the first element")?;
                if element.properties.len() >= MANY {
                    return Err(format!("element `{}` has more than {MANY} properties", element.name));
                }
                element.properties.push(Property { name: name.into(), number, length });
            }
            _ => return Err(format!("cannot read the header line `{line}`")),
        }
    }
    let encoding = encoding.ok_or("the header names no format")?;
    Ok(Header { encoding, elements })
}

/// The numbers after the header, one by one.
struct Body<'a> {
    rest: &'a [u8],
    encoding: Encoding,
}

impl Body<'_> {
    fn number(&mut self, number: Number) -> Option<f64> {
        if self.encoding == Encoding::Text {
            return self.word()?.parse().ok();
        }
        let (bytes, rest) = self.rest.split_at_checked(number.size())?;
        self.rest = rest;
        let mut raw = [0; 8];
        raw[..bytes.len()].copy_from_slice(bytes);
        if self.encoding == Encoding::Big {
            raw[..bytes.len()].reverse();
        }
        let bits = u64::from_le_bytes(raw);
        Some(match number {
            Number::I8 => f64::from(bits as u8 as i8),
            Number::U8 => f64::from(bits as u8),
            Number::I16 => f64::from(bits as u16 as i16),
            Number::U16 => f64::from(bits as u16),
            Number::I32 => f64::from(bits as u32 as i32),
            Number::U32 => f64::from(bits as u32),
            Number::F32 => f64::from(f32::from_bits(bits as u32)),
            Number::F64 => f64::from_bits(bits),
        })
    }

    fn word(&mut self) -> Option<&str> {
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &self.rest[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.rest = &rest[end..];
        std::str::from_utf8(&rest[..end]).ok()
    }

    /// Fails when so many records cannot fit into what is left.
    fn check_count(&self, element: &Element) -> Step<usize> {
        let (smallest, slack) = match self.encoding {
            Encoding::Text => (element.properties.len() * 2, 1), // a digit and a space, but for the last
            _ => (element.properties.iter().map(|p| p.length.unwrap_or(p.number).size()).sum(), 0),
        };
        let room = self.rest.len() as u64 + slack;
        match element.count.checked_mul(smallest as u64) {
            Some(bytes) if bytes <= room => Ok(element.count as usize),
            _ => Err(format!(
                "the header promises {} of `{}`, but only {} bytes follow",
                element.count,
                element.name,
                self.rest.len()
            )),
        }
    }

    fn need(&mut self, number: Number, element: &Element, index: usize) -> Step<f64> {
        let error = |word: &str| format!("`{}` {index}: {word}", element.name);
        if let Some(value) = self.number(number) {
            return Ok(value);
        }
        let ended = self.rest.iter().all(u8::is_ascii_whitespace) || self.encoding != Encoding::Text;
        Err(error(if ended { "the file ends here" } else { "malformed number" }))
    }

    fn list_length(&mut self, number: Number, element: &Element, index: usize) -> Step<usize> {
        let length = self.need(number, element, index)?;
        if !(length >= 0.0 && length.fract() == 0.0 && length <= self.rest.len() as f64) {
            return Err(format!("`{}` {index}: a list cannot have {length} entries", element.name));
        }
        Ok(length as usize)
    }

    /// Passes over one property of a record.
    fn skip(&mut self, property: &Property, element: &Element, index: usize) -> Step<()> {
        let times = match property.length {
            None => 1,
            Some(length) => self.list_length(length, element, index)?,
        };
        for _ in 0..times {
            self.need(property.number, element, index)?;
        }
        Ok(())
    }
}

fn parse(bytes: &[u8]) -> Step<Mesh> {
    let mut rest = bytes;
    let header = header(&mut rest)?;
    let mut body = Body { rest, encoding: header.encoding };
    let mut mesh = Mesh::default();
    // Faces may come before vertices: indices are checked against the header.
    let promised = header.elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);
    let (mut has_vertices, mut has_faces) = (false, false);
    for element in &header.elements {
        if element.properties.is_empty() {
            continue;
        }
        let count = body.check_count(element)?;
        match element.name.as_str() {
            "vertex" if !has_vertices => {
                has_vertices = true;
                vertices(&mut body, element, count, &mut mesh)?;
            }
            "face" if !has_faces => {
                has_faces = true;
                faces(&mut body, element, (count, promised), &mut mesh)?;
            }
            _ if has_vertices && has_faces => break,
            _ => {
                for index in 0..count {
                    element.properties.iter().try_for_each(|p| body.skip(p, element, index))?;
                }
            }
        }
    }
    match (has_vertices, has_faces) {
        (false, _) => return Err("there is no element `vertex`".into()),
        (_, false) => return Err("there is no element `face`".into()),
        _ => {}
    }
    Ok(mesh)
}

const SLOTS: [&str; 8] = ["x", "y", "z", "nx", "ny", "nz", "u", "v"];

fn vertices(body: &mut Body, element: &Element, count: usize, mesh: &mut Mesh) -> Step<()> {
    let find = |name: &str| element.properties.iter().position(|p| p.length.is_none() && p.name == name);
    let mut slot_of = vec![None; element.properties.len()];
    let mut assign = |names: &[&str], first: usize| {
        let found: Option<Vec<usize>> = names.iter().map(|n| find(n)).collect();
        let Some(found) = found else { return false };
        found.iter().enumerate().for_each(|(i, p)| slot_of[*p] = Some(first + i));
        true
    };
    if !assign(&SLOTS[..3], 0) {
        return Err("element `vertex` lacks `x`, `y` or `z`".into());
    }
    let has_normals = assign(&SLOTS[3..6], 3);
    let has_uvs = [["u", "v"], ["texture_u", "texture_v"], ["s", "t"]].iter().any(|names| assign(names, 6));

    u32::try_from(count).map_err(|_| "the mesh has too many vertices".to_string())?;
    mesh.positions.reserve_exact(count);
    mesh.normals.reserve_exact(if has_normals { count } else { 0 });
    mesh.uvs.reserve_exact(if has_uvs { count } else { 0 });
    let mut extra = Extra::new(element, "vertex", body.rest.len(), |i| slot_of[i].is_none());
    for index in 0..count {
        let mut values = [0.0f32; SLOTS.len()];
        for (i, (property, slot)) in element.properties.iter().zip(&slot_of).enumerate() {
            match slot {
                Some(slot) => values[*slot] = body.need(property.number, element, index)? as f32,
                None if extra.wants(i) => extra.put(i, body.need(property.number, element, index)? as f32),
                None => body.skip(property, element, index)?,
            }
        }
        extra.store(1)?;
        if let Some(slot) = values.iter().position(|v| !v.is_finite()) {
            return Err(format!("vertex {index}: `{}` is not finite", SLOTS[slot]));
        }
        let [x, y, z, nx, ny, nz, u, v] = values;
        mesh.positions.push(Vec3::new(x, y, z));
        if has_normals {
            mesh.normals.push(Vec3::new(nx, ny, nz));
        }
        if has_uvs {
            mesh.uvs.push(Vec2::new(u, v));
        }
    }
    extra.finish(false, mesh)
}

fn faces(body: &mut Body, element: &Element, (count, vertices): (usize, u64), mesh: &mut Mesh) -> Step<()> {
    let is_indices =
        |p: &Property| p.length.is_some() && (p.name == "vertex_indices" || p.name == "vertex_index");
    let Some(list) = element.properties.iter().position(is_indices) else {
        return Err("element `face` lacks the list `vertex_indices`".into());
    };
    mesh.triangles.reserve_exact(count);
    let mut extra = Extra::new(element, "face", body.rest.len(), |i| i != list);
    for index in 0..count {
        let before = mesh.triangles.len();
        for (i, property) in element.properties.iter().enumerate() {
            match property.length {
                Some(length) if i == list => {
                    let corners = body.list_length(length, element, index)?;
                    let mut next = || body.need(property.number, element, index);
                    fan(index, corners, vertices, &mut next, &mut mesh.triangles)?;
                }
                None if extra.wants(i) => extra.put(i, body.need(property.number, element, index)? as f32),
                _ => body.skip(property, element, index)?,
            }
        }
        extra.store(mesh.triangles.len() - before)?;
    }
    extra.finish(true, mesh)
}

/// Properties `NAME_0`, `NAME_1`, … (at most four), which become the attribute
/// `vertex_NAME` or `face_NAME`, as in Mitsuba.
struct Extra {
    /// By property: which number it is.
    slot_of: Vec<Option<usize>>,
    /// Name and width of each attribute.
    attributes: Vec<(String, u32)>,
    current: Vec<f32>,
    values: Vec<f32>,
    /// Values that there may be.
    room: usize,
}

impl Extra {
    fn new(element: &Element, prefix: &str, left: usize, free: impl Fn(usize) -> bool) -> Extra {
        let mut extra = Extra {
            slot_of: vec![None; element.properties.len()],
            attributes: Vec::new(),
            current: Vec::new(),
            values: Vec::new(),
            room: left.saturating_mul(NUMBERS).max(FEW_NUMBERS),
        };
        let find = |name: String| {
            let mut all = element.properties.iter().enumerate();
            all.find(|(i, p)| free(*i) && p.length.is_none() && p.name == name).map(|(i, _)| i)
        };
        for property in &element.properties {
            let Some(base) = property.name.strip_suffix("_0") else { continue };
            let found: Vec<usize> = (0..4).map_while(|k| find(format!("{base}_{k}"))).collect();
            for i in &found {
                extra.slot_of[*i] = Some(extra.current.len());
                extra.current.push(0.0);
            }
            if !found.is_empty() {
                extra.attributes.push((format!("{prefix}_{base}"), found.len() as u32));
            }
        }
        extra
    }

    fn wants(&self, property: usize) -> bool {
        self.slot_of[property].is_some()
    }

    fn put(&mut self, property: usize, value: f32) {
        if let Some(slot) = self.slot_of[property] {
            self.current[slot] = value;
        }
    }

    /// Keeps the current numbers, so many times.
    fn store(&mut self, times: usize) -> Step<()> {
        if self.current.len().saturating_mul(times) > self.room - self.values.len() {
            return Err("its polygons have too many corners for so many attributes".into());
        }
        for _ in 0..times {
            self.values.extend(&self.current);
        }
        Ok(())
    }

    fn finish(self, per_face: bool, mesh: &mut Mesh) -> Step<()> {
        let stride = self.current.len();
        let mut first = 0;
        for (name, channels) in self.attributes {
            let width = channels as usize;
            let rows = self.values.chunks_exact(stride);
            let values: Vec<f32> = rows.flat_map(|row| row[first..first + width].iter().copied()).collect();
            if values.iter().any(|v| !v.is_finite()) {
                return Err(format!("the attribute `{name}` has a value that is not finite"));
            }
            mesh.attributes.push(MeshAttribute { name, channels, per_face, values });
            first += width;
        }
        Ok(())
    }
}

/// Makes triangles of a polygon whose vertices `next` gives.
fn fan(
    face: usize,
    corners: usize,
    vertices: u64,
    next: &mut impl FnMut() -> Step<f64>,
    triangles: &mut Vec<[u32; 3]>,
) -> Step<()> {
    if corners < 3 {
        return Err(format!("face {face} has {corners} vertices, expected 3 or more"));
    }
    let (mut first, mut previous) = (0, 0);
    for corner in 0..corners {
        let value = next()?;
        if !(value >= 0.0 && value < vertices as f64 && value.fract() == 0.0) {
            return Err(format!("face {face}: vertex {value} is out of range, there are {vertices}"));
        }
        let vertex = value as u32;
        match corner {
            0 => first = vertex,
            1 => {}
            _ => triangles.push([first, previous, vertex]),
        }
        previous = vertex;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERTEX: &str = "property float x\nproperty float y\nproperty float z\n";
    const FACE: &str = "property list uchar int vertex_indices\n";

    fn text(vertices: u64, faces: u64, body: &str) -> Step<Mesh> {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\n{VERTEX}element face {faces}\n{FACE}end_header\n{body}"
        );
        parse(text.as_bytes())
    }

    #[test]
    fn polygons_become_fans() {
        let mesh = text(4, 1, "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3").unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 0.0));
    }

    #[test]
    fn errors_name_vertex_and_face() {
        let triangle = "0 0 0 1 0 0 0 1 0 ";
        for (vertices, faces, body, message) in [
            (3, 1, "0 0 0 1 nan 0 0 1 0 3 0 1 2", "vertex 1: `y` is not finite"),
            (3, 1, "0 0 0 1 1e39 0 0 1 0 3 0 1 2", "vertex 1: `y` is not finite"),
            (3, 1, &format!("{triangle}3 0 1 3"), "face 0: vertex 3 is out of range, there are 3"),
            (3, 1, &format!("{triangle}3 0 1 -1"), "face 0: vertex -1 is out of range, there are 3"),
            (3, 1, &format!("{triangle}2 0 1"), "face 0 has 2 vertices, expected 3 or more"),
            (3, 1, &format!("{triangle}3 0 1"), "`face` 0: the file ends here"),
            (3, 1, "0 0 0 1 x 0 0 1 0 3 0 1 2", "`vertex` 1: malformed number"),
            (3, 1, &format!("{triangle}9999 0 1"), "`face` 0: a list cannot have 9999 entries"),
            (
                1 << 60,
                1,
                triangle,
                "the header promises 1152921504606846976 of `vertex`, but only 18 bytes follow",
            ),
        ] {
            assert_eq!(text(vertices, faces, body).unwrap_err(), message);
        }
        assert_eq!(parse(b"plx\n").unwrap_err(), "not a PLY file: it does not start with `ply`");
        assert_eq!(parse(b"ply\nformat ascii 1.0\n").unwrap_err(), "the header has no `end_header`");
    }

    /// Faces first, doubles, shorts, other properties and elements, both byte orders.
    #[test]
    fn binary() {
        for big in [false, true] {
            let order = if big { "big" } else { "little" };
            let mut file = format!(
                "ply\r\nformat binary_{order}_endian 1.0\r\ncomment x\r\nelement face 1\r\n\
                 property uchar flags\r\nproperty list ushort ushort vertex_index\r\n\
                 element edge 2\r\nproperty list uchar float w\r\n\
                 element vertex 3\r\nproperty double x\r\nproperty double y\r\nproperty double z\r\n\
                 property uchar red\r\nproperty float s\r\nproperty float t\r\nend_header\r\n"
            )
            .into_bytes();
            let mut put = |bytes: &[u8]| {
                let mut bytes = bytes.to_vec();
                if big {
                    bytes.reverse();
                }
                file.extend(bytes);
            };
            put(&[7]);
            for index in [3u16, 2, 1, 0] {
                put(&index.to_le_bytes());
            }
            put(&[0]);
            put(&[1]);
            put(&1f32.to_le_bytes());
            for vertex in 0..3 {
                for axis in 0..3 {
                    put(&f64::from(vertex * 10 + axis).to_le_bytes());
                }
                put(&[255]);
                put(&0.25f32.to_le_bytes());
                put(&(vertex as f32).to_le_bytes());
            }
            let mesh = parse(&file).unwrap();
            assert_eq!(mesh.triangles, [[2, 1, 0]]);
            assert_eq!(mesh.positions[1], Vec3::new(10.0, 11.0, 12.0));
            assert_eq!(mesh.uvs[2], Vec2::new(0.25, 2.0));
            let cut = parse(&file[..file.len() - 1]).unwrap_err();
            assert!(cut.starts_with("the header promises 3 of `vertex`"), "{cut}");
        }
    }
}
