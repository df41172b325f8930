//! Views compressed by `EXT_meshopt_compression`: vertex attributes with their
//! filters, triangle lists and index sequences, after the extension's
//! appendices A and B.

use super::json::Meshopt;

type Result<T> = std::result::Result<T, String>;

/// Elements that are coded together.
const GROUP: usize = 16;

/// Unpacks a view: `count` · `byteStride` bytes.
pub fn decode(packed: &Meshopt, bytes: &[u8]) -> Result<Vec<u8>> {
    let count = usize::try_from(packed.count).map_err(|_| "`count` is absurd")?;
    let stride = usize::try_from(packed.byte_stride).map_err(|_| "`byteStride` is absurd")?;
    let filter = packed.filter.as_deref().unwrap_or("NONE");
    let index_stride = stride == 2 || stride == 4;
    match packed.mode.as_str() {
        "ATTRIBUTES" if stride == 0 || stride % 4 != 0 || stride > 256 => {
            Err(format!("`byteStride` of attributes must be a multiple of 4 up to 256, found {stride}"))
        }
        "TRIANGLES" | "INDICES" if !index_stride || filter != "NONE" => {
            Err("indices have a `byteStride` of 2 or 4 and no `filter`".into())
        }
        "TRIANGLES" if count % 3 != 0 => Err(format!("`count` {count} of triangles is no multiple of 3")),
        "ATTRIBUTES" => {
            let mut out = attributes(bytes, count, stride)?;
            unfilter(&mut out, filter, stride)?;
            Ok(out)
        }
        "TRIANGLES" => Ok(narrow(&triangles(bytes, count)?, stride)),
        "INDICES" => Ok(narrow(&indices(bytes, count)?, stride)),
        other => Err(format!("`mode` `{other}` is unknown")),
    }
}

fn narrow(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes().into_iter().take(stride)).collect()
}

/// Reads on through a slice.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or("the compressed data is cut off")?;
        self.bytes = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8> {
        Ok(self.take(1)?[0])
    }

    /// Seven bits per byte, the lowest first.
    fn varint(&mut self) -> Result<u32> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("a compressed number is too long".into())
    }
}

/// A signed difference from its zigzag code.
fn unzigzag(v: u32) -> u32 {
    if v & 1 != 0 { !(v >> 1) } else { v >> 1 }
}

fn header(bytes: &[u8], expected: u8) -> Result<()> {
    match bytes.first() {
        Some(first) if *first == expected => Ok(()),
        Some(first) => {
            Err(format!("the compressed data starts with {first:#04x} instead of {expected:#04x}"))
        }
        None => Err("the compressed data is empty".into()),
    }
}

/// Mode 0. Each byte of an element is coded by its difference to the element
/// before, block by block, so that 16 differences are at least two bits.
fn attributes(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>> {
    header(bytes, 0xa0)?;
    let tail = stride.max(32);
    let body = bytes.len().checked_sub(1 + tail).ok_or("the compressed data is cut off")?;
    if stride * count.div_ceil(GROUP).div_ceil(4) > body {
        return Err(format!("{count} elements cannot be in {} bytes", bytes.len()));
    }
    let mut last = bytes[bytes.len() - stride..].to_vec();
    let mut reader = Reader { bytes: &bytes[1..1 + body] };
    let mut out = vec![0; count * stride];
    let block = ((8192 / stride) & !(GROUP - 1)).min(256);
    for block in out.chunks_mut(block * stride) {
        let groups = (block.len() / stride).div_ceil(GROUP);
        for byte in 0..stride {
            let modes = reader.take(groups.div_ceil(4))?;
            for group in 0..groups {
                let mode = (modes[group / 4] >> (2 * (group % 4))) & 3;
                let deltas = deltas(&mut reader, mode)?;
                let elements = block.chunks_mut(stride).skip(group * GROUP);
                for (element, delta) in elements.zip(deltas) {
                    last[byte] = last[byte].wrapping_add(delta);
                    element[byte] = last[byte];
                }
            }
        }
    }
    Ok(out)
}

/// Sixteen differences of 0, 2, 4 or 8 bits; the largest code of 2 or 4 bits
/// says that a whole byte follows.
fn deltas(reader: &mut Reader, mode: u8) -> Result<[u8; GROUP]> {
    let decode = |v: u8| if v & 1 != 0 { !(v >> 1) } else { v >> 1 };
    let mut out = [0; GROUP];
    let bits = match mode {
        0 => return Ok(out),
        3 => {
            let codes = reader.take(GROUP)?;
            out.iter_mut().zip(codes).for_each(|(o, code)| *o = decode(*code));
            return Ok(out);
        }
        mode => usize::from(mode) * 2,
    };
    let packed = reader.take(GROUP * bits / 8)?;
    let escape = (1 << bits) - 1;
    for (i, delta) in out.iter_mut().enumerate() {
        let at = i * bits;
        let code = (packed[at / 8] >> (8 - bits - at % 8)) & escape;
        *delta = decode(if code == escape { reader.byte()? } else { code });
    }
    Ok(out)
}

/// The last sixteen of something, the newest at 0.
struct Recent<T> {
    ring: [T; 16],
    next: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Recent<T> {
        Recent { ring: [T::default(); 16], next: 0 }
    }

    fn push(&mut self, value: T) {
        self.ring[self.next] = value;
        self.next = (self.next + 1) % 16;
    }

    fn get(&self, age: u8) -> T {
        self.ring[(self.next + 15 - usize::from(age)) % 16]
    }
}

/// What the decoder of triangles remembers.
struct Triangles<'a> {
    edges: Recent<(u32, u32)>,
    vertices: Recent<u32>,
    next: u32,
    last: u32,
    data: Reader<'a>,
}

/// Mode 1: a byte per triangle says how it hangs on to recent edges and
/// vertices.
fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>> {
    header(bytes, 0xe1)?;
    let body = bytes.len().checked_sub(17).ok_or("the compressed data is cut off")?;
    let table = &bytes[bytes.len() - 16..];
    let mut reader = Reader { bytes: &bytes[1..1 + body] };
    let codes = reader.take(count / 3)?;
    let mut state =
        Triangles { edges: Recent::new(), vertices: Recent::new(), next: 0, last: 0, data: reader };
    let mut out = Vec::with_capacity(count);
    for code in codes {
        let (high, low) = (code >> 4, code & 15);
        out.extend(if high < 15 { state.on_edge(high, low)? } else { state.apart(low, table)? });
    }
    Ok(out)
}

impl Triangles<'_> {
    fn fresh(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    fn explicit(&mut self) -> Result<u32> {
        self.last = self.last.wrapping_add(unzigzag(self.data.varint()?));
        Ok(self.last)
    }

    /// A triangle at a recent edge.
    fn on_edge(&mut self, edge: u8, third: u8) -> Result<[u32; 3]> {
        let (a, b) = self.edges.get(edge);
        let c = match third {
            0 => self.fresh(),
            1..=12 => self.vertices.get(third),
            13 | 14 => {
                self.last = self.last.wrapping_add(if third == 13 { u32::MAX } else { 1 });
                self.last
            }
            _ => self.explicit()?,
        };
        self.edges.push((c, b));
        self.edges.push((a, c));
        if third == 0 || third > 12 {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle that shares no recent edge.
    fn apart(&mut self, low: u8, table: &[u8]) -> Result<[u32; 3]> {
        let aux = if low < 14 { table[usize::from(low)] } else { self.data.byte()? };
        if low >= 14 && aux == 0 {
            self.next = 0;
        }
        let a = if low == 15 { self.explicit()? } else { self.fresh() };
        let mut corner = |code: u8| match code {
            0 => Ok(self.fresh()),
            15 if low >= 14 => self.explicit(),
            recent => Ok(self.vertices.get(recent - 1)),
        };
        let (b, c) = (corner(aux >> 4)?, corner(aux & 15)?);
        for edge in [(b, a), (c, b), (a, c)] {
            self.edges.push(edge);
        }
        self.vertices.push(a);
        let is_new = |code: u8| code == 0 || (code == 15 && low >= 14);
        if is_new(aux >> 4) {
            self.vertices.push(b);
        }
        if is_new(aux & 15) {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }
}

/// Mode 2: differences to the last index of either of two runs.
fn indices(bytes: &[u8], count: usize) -> Result<Vec<u32>> {
    header(bytes, 0xd1)?;
    let body = bytes.len().checked_sub(5).ok_or("the compressed data is cut off")?;
    let mut reader = Reader { bytes: &bytes[1..1 + body] };
    if count > body {
        return Err(format!("{count} indices cannot be in {} bytes", bytes.len()));
    }
    let mut last = [0_u32; 2];
    (0..count)
        .map(|_| {
            let code = reader.varint()?;
            let run = &mut last[(code & 1) as usize];
            *run = run.wrapping_add(unzigzag(code >> 1));
            Ok(*run)
        })
        .collect()
}

/// Undoes a filter in place.
fn unfilter(out: &mut [u8], filter: &str, stride: usize) -> Result<()> {
    let wrong = |expected: &str| {
        format!("`filter` `{filter}` goes with a `byteStride` of {expected}, found {stride}")
    };
    match filter {
        "NONE" => {}
        "OCTAHEDRAL" if stride == 4 => {
            for e in out.chunks_exact_mut(4) {
                let v = octahedral([0, 1, 2].map(|i| f32::from(e[i] as i8)), 127.0);
                (0..3).for_each(|i| e[i] = v[i] as i8 as u8);
            }
        }
        "OCTAHEDRAL" if stride == 8 => {
            for e in out.chunks_exact_mut(8) {
                let v = octahedral([0, 1, 2].map(|i| f32::from(word(e, i))), 32767.0);
                (0..3).for_each(|i| put(e, i, v[i] as i16));
            }
        }
        "QUATERNION" if stride == 8 => out.chunks_exact_mut(8).for_each(quaternion),
        "EXPONENTIAL" => {
            for e in out.chunks_exact_mut(4) {
                let value = i32::from_le_bytes([e[0], e[1], e[2], e[3]]);
                let (exponent, mantissa) = (value >> 24, (value << 8) >> 8);
                let number = (f64::from(mantissa) * f64::from(exponent).exp2()) as f32;
                e.copy_from_slice(&number.to_le_bytes());
            }
        }
        "OCTAHEDRAL" => return Err(wrong("4 or 8")),
        "QUATERNION" => return Err(wrong("8")),
        other => return Err(format!("`filter` `{other}` is unknown")),
    }
    Ok(())
}

fn word(e: &[u8], i: usize) -> i16 {
    i16::from_le_bytes([e[2 * i], e[2 * i + 1]])
}

fn put(e: &mut [u8], i: usize, value: i16) {
    e[2 * i..2 * i + 2].copy_from_slice(&value.to_le_bytes());
}

/// A unit vector folded onto an octahedron; `v[2]` is what one is.
fn octahedral(v: [f32; 3], scale: f32) -> [f32; 3] {
    let (mut x, mut y) = (v[0] / v[2], v[1] / v[2]);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    x -= fold.copysign(x);
    y -= fold.copysign(y);
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| (c / length * scale).round())
}

/// The three smaller numbers of a unit quaternion; the largest follows.
fn quaternion(e: &mut [u8]) {
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(word(e, 3) | 3);
    let largest = (word(e, 3) & 3) as usize;
    let [x, y, z] = [0, 1, 2].map(|i| f32::from(word(e, i)) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    for (i, c) in [w, x, y, z].into_iter().enumerate() {
        put(e, (largest + i) % 4, (c * 32767.0).round() as i16);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(value: &serde_json::Value) -> Vec<u8> {
        let text = value.as_str().unwrap();
        (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
    }

    /// The numbers of filtered data, which may be off in the last place.
    fn numbers(bytes: &[u8], stride: usize, filter: &str) -> Vec<i64> {
        match (filter, stride) {
            ("OCTAHEDRAL" | "QUATERNION", 8) => {
                bytes.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]]).into()).collect()
            }
            ("OCTAHEDRAL", _) => bytes.iter().map(|b| i64::from(*b as i8)).collect(),
            _ => bytes.iter().map(|b| i64::from(*b)).collect(),
        }
    }

    /// Streams that meshoptimizer made, and every beginning of them.
    #[test]
    fn streams_of_meshoptimizer() {
        let file: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/data/meshopt.json")).unwrap();
        let cases = file["cases"].as_array().unwrap();
        assert_eq!(cases.len(), 13);
        for case in cases {
            let (packed, expected) = (bytes(&case["packed"]), bytes(&case["expected"]));
            let request: Meshopt = Meshopt {
                byte_stride: case["stride"].as_u64().unwrap(),
                count: case["count"].as_u64().unwrap(),
                mode: case["mode"].as_str().unwrap().into(),
                filter: case["filter"].as_str().map(str::to_owned),
                ..Meshopt::default()
            };
            let (name, filter) = (&case["name"], case["filter"].as_str().unwrap());
            let found = decode(&request, &packed).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(found.len(), expected.len(), "{name}");
            let of = |bytes: &[u8]| numbers(bytes, request.byte_stride as usize, filter);
            let most = of(&found).iter().zip(of(&expected)).map(|(a, b)| (a - b).abs()).max().unwrap();
            assert!(most <= case["tolerance"].as_i64().unwrap(), "{name}: off by {most}");
            for length in 0..packed.len() {
                // Short data may decode to something else, but not crash.
                let _ = decode(&request, &packed[..length]);
            }
            assert!(decode(&request, &packed[..packed.len() / 4]).is_err(), "{name}");
        }
    }
}
