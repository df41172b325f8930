//! Accessors: typed arrays in views, with strides, normalised integers, sparse
//! substitution, and no view at all (zeros). Everything is checked before it is
//! read, and nothing is allocated that the file's bytes do not stand behind, up
//! to the budget.

use super::fail;
use super::json::{Accessor, Sparse};
use super::source::Source;
use crate::desc::Result;

/// The type of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    /// 5120.
    I8,
    /// 5121.
    U8,
    /// 5122.
    I16,
    /// 5123.
    U16,
    /// 5125.
    U32,
    /// 5126.
    F32,
}

impl Component {
    fn of(code: u32) -> Option<Component> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// A number from its little-endian bytes; integers are not scaled.
    fn read(self, b: &[u8]) -> f32 {
        match self {
            Component::I8 => f32::from(b[0] as i8),
            Component::U8 => f32::from(b[0]),
            Component::I16 => f32::from(i16::from_le_bytes([b[0], b[1]])),
            Component::U16 => f32::from(u16::from_le_bytes([b[0], b[1]])),
            Component::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            Component::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    /// An unsigned integer from its bytes.
    fn read_index(self, b: &[u8]) -> u32 {
        match self {
            Component::U8 => u32::from(b[0]),
            Component::U16 => u32::from(u16::from_le_bytes([b[0], b[1]])),
            _ => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    /// What a normalised integer is divided by.
    fn largest(self) -> f32 {
        match self {
            Component::I8 => 127.0,
            Component::U8 => 255.0,
            Component::I16 => 32767.0,
            Component::U16 => 65535.0,
            Component::U32 | Component::F32 => 1.0,
        }
    }
}

/// Numbers per element of an accessor type, for the types that are read.
fn components(kind: &str) -> Option<usize> {
    Some(match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        "MAT4" => 16,
        _ => return None,
    })
}

fn kind_of(components: usize) -> &'static str {
    match components {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        4 => "VEC4",
        _ => "MAT4",
    }
}

/// An accessor whose bytes have been found and checked.
struct Checked<'a> {
    component: Component,
    width: usize,
    count: usize,
    normalized: bool,
    /// The bytes and the distance between elements; `None` is all zeros.
    data: Option<(&'a [u8], usize)>,
    sparse: Option<Substitution<'a>>,
    place: String,
}

/// Elements that a sparse accessor puts in other places.
struct Substitution<'a> {
    indices: Vec<u32>,
    values: &'a [u8],
}

impl Source {
    /// An accessor of `N` numbers per element, normalised integers scaled; an
    /// error if it is of another type or has a number that is not finite.
    pub fn vectors<const N: usize>(&self, index: usize, place: &str) -> Result<Vec<[f32; N]>> {
        let checked = self.checked(index, place)?;
        checked.of_width(N, place)?;
        let flat = self.numbers(&checked)?;
        Ok(flat.chunks_exact(N).map(|c| std::array::from_fn(|i| c[i])).collect())
    }

    /// As [`Source::vectors`] for whatever number per element it has, which is
    /// given too.
    pub fn flat(&self, index: usize, place: &str) -> Result<(Vec<f32>, usize)> {
        let checked = self.checked(index, place)?;
        Ok((self.numbers(&checked)?, checked.width))
    }

    /// An accessor of unsigned integers, `width` per element, in one row.
    pub fn integers(&self, index: usize, width: usize, place: &str) -> Result<Vec<u32>> {
        let checked = self.checked(index, place)?;
        checked.of_width(width, place)?;
        if !matches!(checked.component, Component::U8 | Component::U16 | Component::U32) {
            return Err(fail(
                &checked.place,
                "must hold unsigned integers (`componentType` 5121, 5123 or 5125)",
            ));
        }
        self.budget.take((checked.count * width * 4) as u64, &checked.place)?;
        let mut out = vec![0; checked.count * width];
        checked.visit(|element, at, bytes| out[element * width + at] = checked.component.read_index(bytes));
        Ok(out)
    }

    fn numbers(&self, checked: &Checked) -> Result<Vec<f32>> {
        let (width, component) = (checked.width, checked.component);
        self.budget.take((checked.count * width * 4) as u64, &checked.place)?;
        let mut out = vec![0.0_f32; checked.count * width];
        let scale = if checked.normalized { component.largest() } else { 1.0 };
        checked.visit(|element, at, bytes| {
            let value = component.read(bytes);
            // Only the most negative integer is below −1, and means −1.
            out[element * width + at] = if scale == 1.0 { value } else { (value / scale).max(-1.0) };
        });
        match out.iter().position(|x| !x.is_finite()) {
            Some(bad) => Err(fail(
                &checked.place,
                format!("element {} holds a number that is not finite ({})", bad / width, out[bad]),
            )),
            None => Ok(out),
        }
    }

    fn checked(&self, index: usize, place: &str) -> Result<Checked<'_>> {
        let Some(accessor) = self.root.accessors.get(index) else {
            return Err(fail(place, format!("there is no accessors[{index}]")));
        };
        let place = format!("accessors[{index}]");
        let component = Component::of(accessor.component_type)
            .ok_or_else(|| fail(&place, format!("`componentType` {} is unknown", accessor.component_type)))?;
        let width = components(&accessor.kind)
            .ok_or_else(|| fail(&place, format!("`type` `{}` is of no use here", accessor.kind)))?;
        let count = usize::try_from(accessor.count).ok().filter(|c| *c <= u32::MAX as usize);
        let count = count.ok_or_else(|| fail(&place, format!("`count` {} is absurd", accessor.count)))?;
        if count == 0 {
            return Err(fail(&place, "`count` is 0; an accessor has at least one element"));
        }
        let data = match accessor.buffer_view {
            Some(_) => Some(self.elements(accessor, (component, width, count), &place)?),
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => Some(self.substitution(sparse, (component.size() * width, count), &place)?),
            None => None,
        };
        Ok(Checked { component, width, count, normalized: accessor.normalized, data, sparse, place })
    }

    /// The bytes from the first element on, and the stride.
    fn elements(
        &self,
        accessor: &Accessor,
        layout: (Component, usize, usize),
        place: &str,
    ) -> Result<(&[u8], usize)> {
        let (component, width, count) = layout;
        let size = (component.size() * width) as u64;
        let view_index = accessor.buffer_view.unwrap_or_default();
        let (bytes, view) = self.view(view_index, place)?;
        let stride = match view.byte_stride.filter(|s| *s > 0) {
            Some(stride) if stride < size || stride > 1 << 16 => {
                let message = format!(
                    "bufferViews[{view_index}].byteStride {stride} does not suit elements of {size} bytes"
                );
                return Err(fail(place, message));
            }
            Some(stride) => stride,
            None => size,
        };
        let end = (count as u64 - 1)
            .checked_mul(stride)
            .and_then(|n| n.checked_add(size)?.checked_add(accessor.byte_offset));
        match end {
            Some(end) if end <= bytes.len() as u64 => {
                Ok((&bytes[accessor.byte_offset as usize..], stride as usize))
            }
            _ => Err(fail(
                place,
                format!(
                    "{count} elements of {size} bytes from byte {} on reach over the {} bytes of bufferViews[{view_index}]",
                    accessor.byte_offset,
                    bytes.len()
                ),
            )),
        }
    }

    fn substitution(&self, sparse: &Sparse, layout: (usize, usize), place: &str) -> Result<Substitution<'_>> {
        let (size, count) = layout;
        let place = format!("{place}.sparse");
        let kind = Component::of(sparse.indices.component_type)
            .filter(|c| matches!(c, Component::U8 | Component::U16 | Component::U32))
            .ok_or_else(|| fail(&place, "`indices.componentType` must be 5121, 5123 or 5125"))?;
        let part = |view: usize, offset: u64, size: usize, what: &str| -> Result<&[u8]> {
            let (bytes, _) = self.view(view, &place)?;
            let end = sparse.count.checked_mul(size as u64).and_then(|n| n.checked_add(offset));
            match end.filter(|end| *end <= bytes.len() as u64) {
                Some(end) => Ok(&bytes[offset as usize..end as usize]),
                None => Err(fail(
                    &place,
                    format!(
                        "{} {what} reach over the {} bytes of bufferViews[{view}]",
                        sparse.count,
                        bytes.len()
                    ),
                )),
            }
        };
        let indices = part(sparse.indices.buffer_view, sparse.indices.byte_offset, kind.size(), "indices")?;
        let values = part(sparse.values.buffer_view, sparse.values.byte_offset, size, "values")?;
        let indices: Vec<u32> = indices.chunks_exact(kind.size()).map(|b| kind.read_index(b)).collect();
        if let Some(bad) = indices.iter().find(|i| **i as usize >= count) {
            return Err(fail(&place, format!("index {bad} is over the {count} elements")));
        }
        Ok(Substitution { indices, values })
    }
}

impl Checked<'_> {
    fn of_width(&self, width: usize, place: &str) -> Result<()> {
        if self.width == width {
            return Ok(());
        }
        let (found, wanted) = (kind_of(self.width), kind_of(width));
        Err(fail(place, format!("must be of type {wanted}, but {} is {found}", self.place)))
    }

    /// Calls `f` with (element, number of it, bytes) of all numbers that are in
    /// the file, the sparse ones last.
    fn visit(&self, mut f: impl FnMut(usize, usize, &[u8])) {
        let size = self.component.size();
        if let Some((bytes, stride)) = self.data {
            for element in 0..self.count {
                let bytes = &bytes[element * stride..][..size * self.width];
                bytes.chunks_exact(size).enumerate().for_each(|(at, b)| f(element, at, b));
            }
        }
        if let Some(sparse) = &self.sparse {
            for (index, bytes) in sparse.indices.iter().zip(sparse.values.chunks_exact(size * self.width)) {
                bytes.chunks_exact(size).enumerate().for_each(|(at, b)| f(*index as usize, at, b));
            }
        }
    }
}
