//! Curves, as Mitsuba reads them: a line `x y z radius` for each control point,
//! an empty line between two curves.
//!
//! What Mitsuba 3.9.1 takes and this does not: negative radii, which mean
//! nothing, and lines of more than four words, the rest of which it passes over.

use std::path::Path;

use super::files;
use crate::desc::{Curves, Error, Result};

/// Reads a file of curves of at least `least` points each.
pub fn read(path: &Path, least: usize) -> Result<Curves> {
    let bytes = files::read_bytes(path, files::MESH_CAP)?;
    parse(&bytes, least).map_err(|(line, message)| {
        let place = line.map(|line| format!(", line {line}")).unwrap_or_default();
        Error::new(format!("curves `{}`{place}: {message}", path.display()))
    })
}

type Parsed<T> = std::result::Result<T, (Option<usize>, String)>;

fn parse(bytes: &[u8], least: usize) -> Parsed<Curves> {
    let mut curves = Curves::default();
    // Where the curve that is being read begins: index and line.
    let mut start: Option<(usize, usize)> = None;
    let finish = |curves: &mut Curves, start: Option<(usize, usize)>| {
        let Some((first, line)) = start else { return Ok(()) };
        let count = curves.points.len() - first;
        if count < least {
            let message = format!("a curve of {count} control points, expected {least} or more");
            return Err((Some(line), message));
        }
        curves.ends.push(curves.points.len() as u32);
        Ok(())
    };
    for (index, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let mut words = line.split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty()).peekable();
        if words.peek().is_none() {
            finish(&mut curves, start.take())?;
            continue;
        }
        let point = point(words).map_err(|message| (Some(index + 1), message))?;
        if curves.points.len() >= i32::MAX as usize {
            return Err((Some(index + 1), "more than 2^31 control points".into()));
        }
        start.get_or_insert((curves.points.len(), index + 1));
        curves.points.push(point);
    }
    finish(&mut curves, start)?;
    if curves.ends.is_empty() {
        return Err((None, "no control points; expected lines `x y z radius`".into()));
    }
    Ok(curves)
}

/// Position and radius of a line.
fn point<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> std::result::Result<[f32; 4], String> {
    let mut point = [0.0f32; 4];
    for (i, slot) in point.iter_mut().enumerate() {
        let Some(word) = words.next() else {
            return Err(format!("expected 4 numbers `x y z radius`, found {i}"));
        };
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f32>().ok());
        let shown = || String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
        *slot = number.ok_or_else(|| format!("expected a number, found `{}`", shown()))?;
        if !slot.is_finite() {
            return Err(format!("expected a finite number, found `{}`", shown()));
        }
    }
    let more = words.count();
    if more > 0 {
        return Err(format!("expected 4 numbers `x y z radius`, found {}", 4 + more));
    }
    if point[3] < 0.0 {
        return Err(format!("a radius must not be negative, found {}", point[3]));
    }
    Ok(point)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str, least: usize) -> (Option<usize>, String) {
        parse(text.as_bytes(), least).unwrap_err()
    }

    #[test]
    fn empty_lines_part_curves() {
        let text = "\n \t\r\n0 0 0 1\r\n1 2 3 0.5\n\n\n  -1e1\t+2 .5 0 \n4 5 6 7";
        let curves = parse(text.as_bytes(), 2).unwrap();
        assert_eq!(curves.ends, [2, 4]);
        assert_eq!(curves.points[1], [1.0, 2.0, 3.0, 0.5]);
        assert_eq!(curves.points[2], [-10.0, 2.0, 0.5, 0.0]);
        assert_eq!(curves.ranges().collect::<Vec<_>>(), [0..2, 2..4]);
    }

    #[test]
    fn errors_name_line_and_what_was_expected() {
        let none = "no control points; expected lines `x y z radius`";
        assert_eq!(error("", 2), (None, none.into()));
        assert_eq!(error("\n\n", 4), (None, none.into()));
        assert_eq!(error("0 0 0\n", 2), (Some(1), "expected 4 numbers `x y z radius`, found 3".into()));
        assert_eq!(
            error("\n0 0 0 1 2 3\n", 2),
            (Some(2), "expected 4 numbers `x y z radius`, found 6".into())
        );
        assert_eq!(error("# hair\n", 2), (Some(1), "expected a number, found `#`".into()));
        assert_eq!(error("0,0,0,1\n", 2), (Some(1), "expected a number, found `0,0,0,1`".into()));
        assert_eq!(error("0 nan 0 1\n", 2), (Some(1), "expected a finite number, found `nan`".into()));
        assert_eq!(error("0 1e39 0 1\n", 2), (Some(1), "expected a finite number, found `1e39`".into()));
        assert_eq!(error("0 0 0 -1\n", 2), (Some(1), "a radius must not be negative, found -1".into()));
        let short = "a curve of 1 control points, expected 2 or more";
        assert_eq!(error("0 0 0 1\n1 0 0 1\n\n0 0 0 1\n\n", 2), (Some(4), short.into()));
        let short = "a curve of 3 control points, expected 4 or more";
        assert_eq!(error("0 0 0 1\n1 0 0 1\n2 0 0 1", 4), (Some(1), short.into()));
    }
}
