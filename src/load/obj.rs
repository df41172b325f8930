//! Wavefront OBJ, as Mitsuba reads it: all groups and materials of the file
//! become one mesh; each distinct position/texture/normal triple becomes a
//! vertex, in the order of first use; polygons become fans; `v` is flipped
//! unless told otherwise. Indices may be negative (counted from the end).
//! Anything but `v`, `vt`, `vn` and `f` is passed over.
//!
//! Where only some corners name a texture coordinate or normal, the others get
//! (0, 0) and the area-weighted mean of their faces' normals.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::files;
use crate::desc::{Error, Mesh, Result};
use crate::math::{Vec2, Vec3};

const NONE: u32 = u32::MAX;
/// In `last`: the position's corners are in the map.
const CROWDED: u32 = u32::MAX - 1;
/// Corners of one position that are looked through one by one.
const CHAIN: usize = 64;

/// Reads an OBJ file.
pub fn read(path: &Path, flip_tex_coords: bool) -> Result<Mesh> {
    let bytes = files::read_bytes(path, files::MESH_CAP)?;
    parse(&bytes, flip_tex_coords)
        .map_err(|(line, message)| Error::new(format!("mesh `{}`, line {line}: {message}", path.display())))
}

/// A vertex of the mesh: indices into the file's lists.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Corner {
    position: u32,
    uv: u32,
    normal: u32,
}

#[derive(Default)]
struct Reader {
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    corners: Vec<Corner>,
    /// Per position the last corner that uses it, and per corner the one before.
    last: Vec<u32>,
    before: Vec<u32>,
    /// The vertices of positions with many corners.
    crowded: HashMap<Corner, u32>,
    triangles: Vec<[u32; 3]>,
    faces: usize,
}

type Line<T> = std::result::Result<T, String>;

fn parse(bytes: &[u8], flip: bool) -> std::result::Result<Mesh, (usize, String)> {
    let mut reader = Reader::default();
    let mut rest = bytes;
    let mut line_number = 0;
    while !rest.is_empty() {
        let start = line_number + 1;
        let line = logical_line(&mut rest, &mut line_number);
        reader.line(&line, flip).map_err(|message| (start, message))?;
    }
    Ok(reader.finish())
}

/// The next line; a backslash at its end joins the following one.
fn logical_line<'a>(rest: &mut &'a [u8], line_number: &mut usize) -> Cow<'a, [u8]> {
    let mut joined: Option<Vec<u8>> = None;
    loop {
        *line_number += 1;
        let end = rest.iter().position(|b| *b == b'\n');
        let (line, after) = rest.split_at(end.unwrap_or(rest.len()));
        *rest = if end.is_some() { &after[1..] } else { after };
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        match (line.strip_suffix(b"\\"), &mut joined) {
            (Some(part), _) if !rest.is_empty() => {
                let joined = joined.get_or_insert_with(Vec::new);
                joined.extend_from_slice(part);
                joined.push(b' ');
            }
            (_, None) => return Cow::Borrowed(line),
            (_, Some(joined)) => {
                joined.extend_from_slice(line);
                return Cow::Owned(std::mem::take(joined));
            }
        }
    }
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty())
}

fn show(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned()
}

/// The next `N` finite numbers.
fn floats<'a, const N: usize>(mut words: impl Iterator<Item = &'a [u8]>) -> Line<[f32; N]> {
    let mut out = [0.0; N];
    for (i, slot) in out.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| format!("expected {N} numbers, found {i}"))?;
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f32>().ok());
        *slot = number.ok_or_else(|| format!("expected a number, found `{}`", show(word)))?;
    }
    Ok(out)
}

impl Reader {
    fn line(&mut self, line: &[u8], flip: bool) -> Line<()> {
        let mut words = words(line);
        match words.next() {
            Some(b"v") => {
                let v = Vec3::from(floats::<3>(words)?);
                if !v.is_finite() {
                    return Err(format!("vertex {} is not finite", self.positions.len() + 1));
                }
                self.positions.push(v);
                self.last.push(NONE);
            }
            Some(b"vn") => {
                let n = Vec3::from(floats::<3>(words)?);
                if !n.is_finite() {
                    return Err(format!("normal {} is not finite", self.normals.len() + 1));
                }
                self.normals.push(n);
            }
            Some(b"vt") => self.texture_coordinate(words, flip)?,
            Some(b"f") => self.face(words)?,
            _ => {}
        }
        Ok(())
    }

    /// One or two numbers count; a third is passed over.
    fn texture_coordinate<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>, flip: bool) -> Line<()> {
        let words: Vec<&[u8]> = words.take(2).collect();
        let [u, v] = if words.len() == 1 {
            [floats::<1>(words.into_iter())?[0], 0.0]
        } else {
            floats::<2>(words.into_iter())?
        };
        let uv = Vec2::new(u, if flip { 1.0 - v } else { v });
        if !uv.is_finite() {
            return Err(format!("texture coordinate {} is not finite", self.uvs.len() + 1));
        }
        self.uvs.push(uv);
        Ok(())
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>) -> Line<()> {
        self.faces += 1;
        let (mut first, mut previous, mut count) = (0, 0, 0);
        for word in words.take_while(|w| !w.starts_with(b"#")) {
            let corner = self.corner(word)?;
            let vertex = self.vertex(corner)?;
            match count {
                0 => first = vertex,
                1 => {}
                _ => self.triangles.push([first, previous, vertex]),
            }
            previous = vertex;
            count += 1;
        }
        if count < 3 {
            return Err(format!("face {} has {count} vertices, expected 3 or more", self.faces));
        }
        Ok(())
    }

    /// `v`, `v/t`, `v//n` or `v/t/n`.
    fn corner(&self, word: &[u8]) -> Line<Corner> {
        let mut parts = word.split(|b| *b == b'/');
        let mut index = |length: usize, what: &str| -> Line<u32> {
            match parts.next() {
                None | Some(b"") => Ok(NONE),
                Some(part) => self.index(part, length, what),
            }
        };
        let position = index(self.positions.len(), "vertex")?;
        let uv = index(self.uvs.len(), "texture coordinate")?;
        let normal = index(self.normals.len(), "normal")?;
        if position == NONE || parts.next().is_some() {
            return Err(format!("face {}: expected `v/t/n`, found `{}`", self.faces, show(word)));
        }
        Ok(Corner { position, uv, normal })
    }

    fn index(&self, part: &[u8], length: usize, what: &str) -> Line<u32> {
        let number = std::str::from_utf8(part).ok().and_then(|p| p.parse::<i64>().ok());
        let Some(number) = number else {
            return Err(format!("face {}: expected an index, found `{}`", self.faces, show(part)));
        };
        let index = if number < 0 { length as i64 + number } else { number - 1 };
        match u32::try_from(index) {
            Ok(i) if (i as usize) < length => Ok(i),
            _ => Err(format!("face {}: {what} {number} is out of range, there are {length}", self.faces)),
        }
    }

    /// The vertex of a corner, made at its first use.
    fn vertex(&mut self, corner: Corner) -> Line<u32> {
        let head = corner.position as usize;
        if let Some(known) = self.known(corner) {
            return Ok(known);
        }
        let vertex = self.corners.len() as u32;
        if vertex == CROWDED {
            return Err("the mesh has too many vertices".into());
        }
        self.corners.push(corner);
        self.before.push(self.last[head]);
        if self.last[head] == CROWDED {
            self.crowded.insert(corner, vertex);
        } else {
            self.last[head] = vertex;
        }
        Ok(vertex)
    }

    /// The vertex of a corner that was used before. A position of which there
    /// are many moves to the map, or the search would take the square of them.
    fn known(&mut self, corner: Corner) -> Option<u32> {
        let head = corner.position as usize;
        if self.last[head] == CROWDED {
            return self.crowded.get(&corner).copied();
        }
        let (mut candidate, mut steps) = (self.last[head], 0);
        while candidate != NONE {
            if self.corners[candidate as usize] == corner {
                return Some(candidate);
            }
            candidate = self.before[candidate as usize];
            steps += 1;
        }
        if steps >= CHAIN {
            let mut each = std::mem::replace(&mut self.last[head], CROWDED);
            while each != NONE {
                self.crowded.insert(self.corners[each as usize], each);
                each = self.before[each as usize];
            }
        }
        None
    }

    fn finish(self) -> Mesh {
        let has_uvs = self.corners.iter().any(|c| c.uv != NONE);
        let has_normals = self.corners.iter().any(|c| c.normal != NONE);
        let mut mesh = Mesh {
            positions: self.corners.iter().map(|c| self.positions[c.position as usize]).collect(),
            triangles: self.triangles,
            ..Mesh::default()
        };
        if has_uvs {
            let uv = |c: &Corner| self.uvs.get(c.uv as usize).copied().unwrap_or(Vec2::ZERO);
            mesh.uvs = self.corners.iter().map(uv).collect();
        }
        if has_normals {
            let normal = |c: &Corner| self.normals.get(c.normal as usize).copied().unwrap_or(Vec3::ZERO);
            mesh.normals = self.corners.iter().map(normal).collect();
            if self.corners.iter().any(|c| c.normal == NONE) {
                fill_normals(&mut mesh, |vertex| self.corners[vertex as usize].normal == NONE);
            }
        }
        mesh
    }
}

/// Area-weighted normals where the file gives none.
fn fill_normals(mesh: &mut Mesh, is_missing: impl Fn(u32) -> bool) {
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
        let normal = (b - a).cross(c - a);
        for vertex in triangle.iter().filter(|v| is_missing(**v)) {
            mesh.normals[*vertex as usize] += normal.as_vec3();
        }
    }
    for (vertex, normal) in mesh.normals.iter_mut().enumerate() {
        if is_missing(vertex as u32) {
            *normal = normal.as_dvec3().try_normalize().map_or(Vec3::Z, |n| n.as_vec3());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> (usize, String) {
        parse(text.as_bytes(), true).unwrap_err()
    }

    #[test]
    fn groups_polygons_and_negative_indices() {
        let text = "# c\r\nmtllib x\no a\nv 0 0 0 1\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0.25\ng b\n\
                    usemtl m\nf 1/1 2/1 3/1 4/1\ns off\nf -4/-1 -3/-1 \\\n-2/-1\n";
        let mesh = parse(text.as_bytes(), true).unwrap();
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(mesh.uvs, [Vec2::new(0.25, 0.75); 4]);
        assert!(mesh.normals.is_empty());
        assert_eq!(parse(text.as_bytes(), false).unwrap().uvs[0], Vec2::new(0.25, 0.25));
    }

    #[test]
    fn corners_are_split_where_attributes_differ() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 0 1\nvn 0 1 0\n\
                    f 1//1 2//1 3//1\nf 2//2 4//2 3//2\nf 1 2 4\n";
        let mesh = parse(text.as_bytes(), true).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
        assert_eq!(mesh.normals[3], Vec3::Y);
        assert_eq!(mesh.normals[6], Vec3::Z);
    }

    #[test]
    fn errors_name_line_and_face() {
        assert_eq!(error("v 0 0\n"), (1, "expected 3 numbers, found 2".into()));
        assert_eq!(error("v 0 0 0\nv 0 x 0\n"), (2, "expected a number, found `x`".into()));
        assert_eq!(error("v 0 0 0\n\nv 0 nan 0\n"), (3, "vertex 2 is not finite".into()));
        assert_eq!(error("v 0 0 0\nf 1 1\n"), (2, "face 1 has 2 vertices, expected 3 or more".into()));
        let out = "face 1: vertex 9 is out of range, there are 1";
        assert_eq!(error("v 0 0 0\nf 1 1 9\n"), (2, out.into()));
        assert_eq!(error("v 0 0 0\nf 1 1 0\n").1, "face 1: vertex 0 is out of range, there are 1");
        assert_eq!(
            error("v 0 0 0\nf 1/1 1 1\n").1,
            "face 1: texture coordinate 1 is out of range, there are 0"
        );
        assert_eq!(
            error("v 0 0 0\nf 1/1/1/1 1 1\n").1,
            "face 1: texture coordinate 1 is out of range, there are 0"
        );
        assert_eq!(error("v 0 0 0\nf a 1 1\n").1, "face 1: expected an index, found `a`");
    }
}
