//! Puts the attributes of an EXR header in order of their names.
//!
//! The `exr` crate keeps custom attributes in a hash map with a random seed
//! and so writes them in a different order each time. Sorting them in place
//! keeps the length of the header, and with it all offsets in the file.

use std::io::{self, Read, Seek, SeekFrom, Write};

/// Longest header that is read.
const MAX_HEADER: u64 = 1 << 28;

/// Bytes before the first attribute: magic number and version.
const PREFIX: usize = 8;

/// Sorts the attributes of a single-part file.
pub(super) fn sort_attributes(file: &mut (impl Read + Write + Seek)) -> io::Result<()> {
    file.seek(SeekFrom::Start(0))?;
    let mut header = Vec::new();
    let sorted = loop {
        // The header is short; read on until it is all there.
        let wanted = (header.len() as u64 * 2).max(1 << 16);
        let got = Read::by_ref(file).take(wanted).read_to_end(&mut header)?;
        if let Some(sorted) = sorted(&header) {
            break sorted;
        }
        if got == 0 || header.len() as u64 > MAX_HEADER {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "the EXR header has no end"));
        }
    };
    file.seek(SeekFrom::Start(PREFIX as u64))?;
    file.write_all(&sorted)?;
    file.flush()
}

/// The attributes in order, without the end mark; `None` if they are not all
/// there. An attribute is name, 0, type, 0, size (i32), value.
fn sorted(header: &[u8]) -> Option<Vec<u8>> {
    let mut rest = header.get(PREFIX..)?;
    let mut attributes: Vec<(&[u8], &[u8])> = Vec::new();
    while *rest.first()? != 0 {
        let name = rest.iter().position(|b| *b == 0)?;
        let kind = name + 1 + rest.get(name + 1..)?.iter().position(|b| *b == 0)?;
        let size = rest.get(kind + 1..kind + 5)?.try_into().ok().map(i32::from_le_bytes)?;
        let end = (kind + 5).checked_add(usize::try_from(size).ok()?)?;
        attributes.push((&rest[..name], rest.get(..end)?));
        rest = rest.get(end..)?;
    }
    attributes.sort_by_key(|(name, _)| *name);
    Some(attributes.into_iter().flat_map(|(_, bytes)| bytes).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn attribute(name: &str, value: &[u8]) -> Vec<u8> {
        let size = (value.len() as i32).to_le_bytes();
        [name.as_bytes(), &[0], b"string", &[0], &size, value].concat()
    }

    #[test]
    fn attributes_are_sorted_in_place() {
        let long = vec![7; 100_000];
        let [a, b, c] = [attribute("alpha", b"x\0y"), attribute("beta", &long), attribute("gamma", b"")];
        let file = |[x, y, z]: [&[u8]; 3]| [b"magicver", x, y, z, b"\0pixels"].concat();
        let mut bytes = Cursor::new(file([&c, &b, &a]));
        sort_attributes(&mut bytes).unwrap();
        assert!(bytes.into_inner() == file([&a, &b, &c]));
    }

    #[test]
    fn broken_headers_are_errors() {
        let mut bytes = Cursor::new([b"magicver".as_slice(), &attribute("a", b"1")].concat());
        assert!(sort_attributes(&mut bytes).is_err());
        let mut negative = attribute("a", b"1");
        negative[9..13].copy_from_slice(&(-5i32).to_le_bytes());
        assert!(
            sort_attributes(&mut Cursor::new([b"magicver".as_slice(), &negative, b"\0"].concat())).is_err()
        );
    }
}
