//! The value tags: numbers, words, colours, spectra, points.

use super::files;
use super::old_values;
use super::xml::{Attribute, Tag};
use crate::desc::{Error, Result, Value};
use crate::math::DVec3;

/// Tags that hold one value.
pub const VALUE_TAGS: &[&str] =
    &["boolean", "integer", "float", "string", "rgb", "spectrum", "point", "vector"];

/// How to read value tags.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// Where files are looked for.
    pub dirs: &'a [std::path::PathBuf],
    /// The spellings of Mitsuba 0.x are read too.
    pub old: bool,
}

/// True for a tag that holds one value.
pub fn is_value(name: &str, old: bool) -> bool {
    VALUE_TAGS.contains(&name) || old && old_values::TAGS.contains(&name)
}

/// Reads the value of a value tag.
pub fn value(tag: &Tag, reading: Reading) -> Result<Value> {
    if reading.old
        && let Some(value) = old_values::value(tag)?
    {
        return Ok(value);
    }
    match tag.name {
        "point" | "vector" => {
            tag.only(&["name", "x", "y", "z", "value"])?;
            return Ok(Value::Vector(triple(tag, None)?));
        }
        "spectrum" => return spectrum(tag, reading.dirs),
        _ => tag.only(&["name", "value"])?,
    }
    let attribute = tag.need("value")?;
    let text = attribute.value.trim();
    match tag.name {
        "string" => Ok(Value::String(attribute.value.clone())),
        "float" => Ok(Value::Float(scalar(tag, attribute)?)),
        "rgb" => rgb(tag, attribute),
        "integer" => match text.parse() {
            Ok(v) => Ok(Value::Int(v)),
            Err(_) => Err(expected(tag, attribute, "an integer", text)),
        },
        _ if text.eq_ignore_ascii_case("true") => Ok(Value::Bool(true)),
        _ if text.eq_ignore_ascii_case("false") => Ok(Value::Bool(false)),
        _ => Err(expected(tag, attribute, "`true` or `false`", text)),
    }
}

/// "`fov` must be a number, found `4o`", at the value.
pub fn expected(tag: &Tag, attribute: &Attribute, what: &str, found: &str) -> Error {
    let name = match tag.get("name") {
        Some(name) if attribute.name == "value" => &name.value,
        _ => attribute.name,
    };
    tag.error_in(attribute, format!("`{name}` must be {what}, found `{found}`"))
}

/// A finite number.
fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|v: &f64| v.is_finite())
}

/// One finite number.
pub fn scalar(tag: &Tag, attribute: &Attribute) -> Result<f64> {
    let text = attribute.value.trim();
    number(text).ok_or_else(|| expected(tag, attribute, "a finite number", text))
}

/// Finite numbers between commas and white space.
pub fn numbers(tag: &Tag, attribute: &Attribute) -> Result<Vec<f64>> {
    let number = |w| number(w).ok_or_else(|| expected(tag, attribute, "finite numbers", w));
    words(attribute).map(number).collect()
}

/// What stands between commas and white space.
pub fn words<'a>(attribute: &'a Attribute) -> impl Iterator<Item = &'a str> {
    attribute.value.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty())
}

/// `x`, `y`, `z`, or all three as `value` (1 or 3 numbers). Without a default
/// all of them must be given.
pub fn triple(tag: &Tag, default: Option<f64>) -> Result<DVec3> {
    let mut v = DVec3::ZERO;
    if let Some(attribute) = tag.get("value") {
        if let Some(other) = ["x", "y", "z"].iter().find_map(|n| tag.get(n)) {
            return Err(tag
                .source
                .error(other.name_at, format!("`{}` and `value` cannot be given together", other.name)));
        }
        let given = numbers(tag, attribute)?;
        return match given[..] {
            [s] => Ok(DVec3::splat(s)),
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            _ => Err(tag.error_in(attribute, format!("expected 1 or 3 numbers, found {}", given.len()))),
        };
    }
    for (i, name) in ["x", "y", "z"].into_iter().enumerate() {
        v[i] = match (tag.get(name), default) {
            (Some(attribute), _) => scalar(tag, attribute)?,
            (None, Some(default)) => default,
            (None, None) => scalar(tag, tag.need(name)?)?,
        };
    }
    Ok(v)
}

fn rgb(tag: &Tag, attribute: &Attribute) -> Result<Value> {
    if attribute.value.trim_start().starts_with('#') {
        return Err(expected(tag, attribute, "1 or 3 numbers", attribute.value.trim())
            .hint("colours are linear; `#rrggbb` is not read"));
    }
    three(tag, attribute).map(Value::Rgb)
}

/// One number for all channels, or three.
pub fn three(tag: &Tag, attribute: &Attribute) -> Result<[f64; 3]> {
    match numbers(tag, attribute)?[..] {
        [s] => Ok([s; 3]),
        [r, g, b] => Ok([r, g, b]),
        ref other => {
            Err(tag.error_in(attribute, format!("a colour has 1 or 3 numbers, found {}", other.len())))
        }
    }
}

fn spectrum(tag: &Tag, dirs: &[std::path::PathBuf]) -> Result<Value> {
    tag.only(&["name", "value", "filename"])?;
    match (tag.get("value"), tag.get("filename")) {
        (Some(attribute), None) => spectrum_value(tag, attribute),
        (None, Some(attribute)) => {
            let at = |e: Error| e.at(tag.source.name.clone(), tag.source.pos(attribute.value_at));
            let path = files::find(attribute.value.trim(), dirs).map_err(at)?;
            let text = files::read_text(&path, files::SPECTRUM_CAP).map_err(at)?;
            spectrum_file(&text)
                .map_err(|e| at(Error::new(format!("spectrum `{}`: {}", path.display(), e.message))))
        }
        (None, None) => Err(tag.error("`<spectrum>` needs the attribute `value` or `filename`")),
        (Some(_), Some(attribute)) => {
            Err(tag.source.error(attribute.name_at, "`value` and `filename` cannot be given together"))
        }
    }
}

/// A single number, or `wavelength:value` pairs.
fn spectrum_value(tag: &Tag, attribute: &Attribute) -> Result<Value> {
    let words: Vec<&str> = words(attribute).collect();
    if words.len() == 1 && !words[0].contains(':') {
        return Ok(Value::Float(scalar(tag, attribute)?));
    }
    let mut pairs = Vec::with_capacity(words.len());
    for word in &words {
        let pair = word.split_once(':').and_then(|(l, v)| Some((number(l)?, number(v)?)));
        let Some(pair) = pair else {
            let error = expected(tag, attribute, "one number or `wavelength:value` pairs", word);
            let is_rgb = words.len() == 3 && words.iter().all(|w| number(w).is_some());
            return Err(if is_rgb { error.hint("use `<rgb>` for three values") } else { error });
        };
        pairs.push(pair);
    }
    check_spectrum(pairs).map_err(|e| tag.error_in(attribute, e.message))
}

/// Lines of wavelength and value; `#` starts a comment.
fn spectrum_file(text: &str) -> Result<Value> {
    let mut pairs = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
        let Some(first) = words.next() else { continue };
        match (number(first), words.next().and_then(number), words.next()) {
            (Some(wavelength), Some(value), None) => pairs.push((wavelength, value)),
            _ => return Err(Error::new(format!("line {}: expected a wavelength and a value", i + 1))),
        }
    }
    check_spectrum(pairs)
}

fn check_spectrum(pairs: Vec<(f64, f64)>) -> Result<Value> {
    if pairs.len() < 2 {
        return Err(Error::new(format!("a spectrum has at least 2 wavelengths, found {}", pairs.len())));
    }
    match pairs.windows(2).find(|w| w[0].0 >= w[1].0) {
        Some(w) => Err(Error::new(format!("wavelengths must increase, found {} after {}", w[1].0, w[0].0))),
        None => Ok(Value::Spectrum(pairs)),
    }
}
