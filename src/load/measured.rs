//! Measured materials of the RGL database (`.bsdf`): little endian, a header
//! (`tensor_file` and a zero, two bytes of version, the count of fields), then
//! for each field its name, dimensions, element type and place in the file.
//!
//! Of the fields, `theta_i`, `phi_i`, `ndf`, `sigma`, `vndf`, `luminance` and
//! `jacobian` are read, and of the colours `rgb` or else `spectra` over
//! `wavelengths`, slice by slice, which is taken to linear sRGB as it looks under
//! D65, like any spectrum of a reflectance. (Mitsuba 3.9.1 refuses files with
//! `wavelengths` in its RGB variants.) Colours outside of sRGB have negative
//! components, which count as zero. What else is in a file is passed over.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::files;
use crate::color::reflectance_weights;
use crate::desc::{Error, MeasuredData, Nodes, Result};

type Step<T> = std::result::Result<T, String>;

const MAGIC: &[u8; 12] = b"tensor_file\0";
/// Most fields of a file; eleven are known.
const FIELDS: u32 = 1000;
/// Most dimensions of a field.
const DIMENSIONS: u16 = 16;
/// Most wavelengths: more would not be resolved by what they are weighed by.
const WAVELENGTHS: u64 = 4096;
/// Element types by their numbers in the file, from 1 on.
const TYPES: [&str; 11] = [
    "uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64",
];

/// Reads a file; gives warnings too.
pub fn read(path: &Path) -> Result<(MeasuredData, Vec<String>)> {
    let (file, length) = files::open(path, files::MEASURED_CAP)?;
    let whole = |message: String| Error::new(format!("measured material `{}`: {message}", path.display()));
    let mut tensors = Tensors::open(file, length).map_err(whole)?;
    let (data, negative) = tensors.material().map_err(whole)?;
    let warning = (negative > 0).then(|| {
        let all = 3 * data.rgb.len();
        format!(
            "{}: {negative} of the {all} values of its colours are negative, outside of sRGB, and count as 0",
            path.display()
        )
    });
    Ok((data, warning.into_iter().collect()))
}

/// Where a field is.
struct Field {
    kind: u8,
    shape: Vec<u64>,
    offset: u64,
}

/// An open file and its fields.
struct Tensors {
    file: BufReader<File>,
    length: u64,
    fields: HashMap<String, Field>,
}

impl Tensors {
    fn open(file: File, length: u64) -> Step<Tensors> {
        let mut tensors = Tensors { file: BufReader::new(file), length, fields: HashMap::new() };
        if &tensors.exact::<12>()? != MAGIC {
            return Err("it does not begin with `tensor_file`".into());
        }
        let [major, minor] = tensors.exact()?;
        if major != 1 {
            return Err(format!("unknown version {major}.{minor}, expected 1.0"));
        }
        let count = u32::from_le_bytes(tensors.exact()?);
        if count > FIELDS {
            return Err(format!("it has {count} fields, more than {FIELDS}"));
        }
        for _ in 0..count {
            tensors.field_header()?;
        }
        Ok(tensors)
    }

    fn exact<const N: usize>(&mut self) -> Step<[u8; N]> {
        let mut bytes = [0; N];
        self.file
            .read_exact(&mut bytes)
            .map_err(|_| "the file ends within its table of fields".to_string())?;
        Ok(bytes)
    }

    fn field_header(&mut self) -> Step<()> {
        let mut name = vec![0; usize::from(u16::from_le_bytes(self.exact()?))];
        self.file
            .read_exact(&mut name)
            .map_err(|_| "the file ends within the name of a field".to_string())?;
        let name = String::from_utf8_lossy(&name).into_owned();
        let shown: String = name.chars().take(40).collect();
        let dimensions = u16::from_le_bytes(self.exact()?);
        if dimensions > DIMENSIONS {
            return Err(format!("`{shown}` has {dimensions} dimensions, more than {DIMENSIONS}"));
        }
        let [kind] = self.exact()?;
        let offset = u64::from_le_bytes(self.exact()?);
        let shape = (0..dimensions).map(|_| Ok(u64::from_le_bytes(self.exact()?))).collect::<Step<_>>()?;
        if self.fields.insert(name, Field { kind, shape, offset }).is_some() {
            return Err(format!("there are two fields `{shown}`"));
        }
        Ok(())
    }

    /// The shape of a field of `N` dimensions, whose data are all in the file.
    fn shape<const N: usize>(&self, name: &str, kind: &str) -> Step<([u64; N], u64)> {
        let field = self.fields.get(name).ok_or_else(|| format!("there is no field `{name}`"))?;
        let found = TYPES.get(usize::from(field.kind).wrapping_sub(1));
        if found != Some(&kind) {
            let found = found.map_or(format!("unknown type {}", field.kind), |t| format!("type {t}"));
            return Err(format!("`{name}` is of {found}, expected {kind}"));
        }
        let shape: [u64; N] = field
            .shape
            .as_slice()
            .try_into()
            .map_err(|_| format!("`{name}` has {} dimensions, expected {N}", field.shape.len()))?;
        let size = if kind == "uint8" { 1 } else { 4 };
        let bytes = shape.iter().try_fold(size, |product: u64, n| product.checked_mul(*n));
        let end = bytes.and_then(|bytes| bytes.checked_add(field.offset));
        match end {
            Some(end) if end <= self.length => Ok((shape, field.offset)),
            _ => Err(format!(
                "`{name}` of {shape:?} at byte {} does not fit into the {} bytes of the file",
                field.offset, self.length
            )),
        }
    }

    fn seek(&mut self, offset: u64) -> Step<()> {
        self.file.seek(SeekFrom::Start(offset)).map(|_| ()).map_err(|e| format!("cannot read it: {e}"))
    }

    /// The next `count` numbers of the file, all of which are there; `first`
    /// is the index of the first of them in the field.
    fn floats(&mut self, name: &str, first: u64, count: u64) -> Step<Vec<f32>> {
        let mut bytes = Vec::new();
        (&mut self.file)
            .take(4 * count)
            .read_to_end(&mut bytes)
            .map_err(|e| format!("`{name}`: cannot read it: {e}"))?;
        if bytes.len() as u64 != 4 * count {
            return Err(format!("`{name}`: the file has become shorter"));
        }
        let values: Vec<f32> =
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        match values.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(format!("`{name}`: value {} is {}", first + index as u64, values[index])),
            None => Ok(values),
        }
    }

    fn list(&mut self, name: &str) -> Step<Vec<f32>> {
        let ([count], offset) = self.shape(name, "float32")?;
        self.seek(offset)?;
        self.floats(name, 0, count)
    }

    /// A grid of nodes for each slice; `N` dimensions, 2 for one without slices.
    fn nodes<const N: usize>(&mut self, name: &str, slices: [u64; 2]) -> Step<Nodes> {
        let (shape, offset) = self.shape::<N>(name, "float32")?;
        check_slices(name, &shape[..N - 2], &slices)?;
        self.seek(offset)?;
        let values = self.floats(name, 0, shape.iter().product())?;
        Ok(Nodes { size: [side(shape[N - 1]), side(shape[N - 2])], values })
    }

    /// The material, and how many components of its colours are negative.
    fn material(&mut self) -> Step<(MeasuredData, usize)> {
        let (theta, phi) = (self.list("theta_i")?, self.list("phi_i")?);
        for (name, angles) in [("theta_i", &theta), ("phi_i", &phi)] {
            if angles.is_empty() {
                return Err(format!("`{name}` is empty"));
            }
        }
        let slices = [phi.len() as u64, theta.len() as u64];
        let mut data = MeasuredData {
            theta,
            phi,
            ndf: self.nodes::<2>("ndf", slices)?,
            sigma: self.nodes::<2>("sigma", slices)?,
            vndf: self.nodes::<4>("vndf", slices)?,
            luminance: self.nodes::<4>("luminance", slices)?,
            ..MeasuredData::default()
        };
        let ([count], offset) = self.shape("jacobian", "uint8")?;
        self.seek(offset)?;
        data.jacobian = match (count, if count == 1 { self.exact()? } else { [0] }) {
            (1, [0]) => false,
            (1, [1]) => true,
            (1, [other]) => return Err(format!("`jacobian` is {other}, expected 0 or 1")),
            (count, _) => return Err(format!("`jacobian` has {count} values, expected 1")),
        };
        let negative = self.colours(&mut data, slices)?;
        data.check()?;
        Ok((data, negative))
    }

    /// Reads `rgb`, or `spectra` as linear sRGB.
    fn colours(&mut self, data: &mut MeasuredData, slices: [u64; 2]) -> Step<usize> {
        let identity = || vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (name, weights) = if self.fields.contains_key("rgb") {
            ("rgb", identity())
        } else if self.fields.contains_key("spectra") {
            ("spectra", self.wavelengths()?)
        } else {
            return Err("there is neither a field `rgb` nor `spectra`".into());
        };
        let ([phi, theta, channels, height, width], offset) = self.shape(name, "float32")?;
        check_slices(name, &[phi, theta], &slices)?;
        if channels != weights.len() as u64 {
            return Err(format!("`{name}` has {channels} channels, expected {}", weights.len()));
        }
        // All of it fits into the file, so that no product overflows.
        let (planes, area) = (phi * theta, height * width);
        data.rgb_size = [side(width), side(height)];
        self.seek(offset)?;
        let mut negative = 0;
        for slice in 0..planes {
            let mut colours = vec![[0.0f64; 3]; area as usize];
            for (channel, weight) in weights.iter().enumerate() {
                let plane = self.floats(name, (slice * channels + channel as u64) * area, area)?;
                for (colour, value) in colours.iter_mut().zip(plane) {
                    (0..3).for_each(|c| colour[c] += weight[c] * f64::from(value));
                }
            }
            negative += colours.iter().flatten().filter(|v| **v < 0.0).count();
            data.rgb.extend(colours.iter().map(|c| c.map(|v| v.max(0.0) as f32)));
        }
        Ok(negative)
    }

    /// What makes linear sRGB of values at the wavelengths of the file.
    fn wavelengths(&mut self) -> Step<Vec<[f64; 3]>> {
        let ([count], offset) = self.shape("wavelengths", "float32")?;
        if !(1..=WAVELENGTHS).contains(&count) {
            return Err(format!("`wavelengths` has {count} values, expected 1 to {WAVELENGTHS}"));
        }
        self.seek(offset)?;
        let values = self.floats("wavelengths", 0, count)?;
        if let Some(index) = values.windows(2).position(|w| !(w[0] < w[1])) {
            return Err(format!("`wavelengths`: value {} does not rise", index + 1));
        }
        Ok(reflectance_weights(&values.iter().map(|w| f64::from(*w)).collect::<Vec<_>>()))
    }
}

fn check_slices(name: &str, found: &[u64], expected: &[u64]) -> Step<()> {
    if !found.is_empty() && found != expected {
        return Err(format!(
            "`{name}` has {found:?} slices, expected {expected:?} for the azimuths and elevations of the file"
        ));
    }
    Ok(())
}

/// A side of a grid; those that are too long stay so.
fn side(nodes: u64) -> u32 {
    u32::try_from(nodes).unwrap_or(u32::MAX)
}
