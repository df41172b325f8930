//! Errors of input: where, what, and what might have been meant.

use std::fmt;

/// A position in one of the files of a scene. Lines and columns count from 1;
/// line 0 means "the file as a whole".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pos {
    /// Index into `SceneDesc::files`.
    pub file: u32,
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
}

/// An error of input. Prints as `file:line:column: message; hint`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// File, line and column, where known.
    pub location: Option<(String, Pos)>,
    /// What is wrong and what was expected.
    pub message: String,
    /// What might help, e.g. "did you mean `diffuse`?".
    pub hint: Option<String>,
}

/// The result of everything that reads input.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error without a place.
    pub fn new(message: impl Into<String>) -> Error {
        Error { location: None, message: message.into(), hint: None }
    }

    /// Gives the error its place, unless it has one already.
    #[must_use]
    pub fn at(mut self, file: impl Into<String>, pos: Pos) -> Error {
        if self.location.is_none() {
            self.location = Some((file.into(), pos));
        }
        self
    }

    /// Adds a hint, unless there is one already.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Error {
        if self.hint.is_none() {
            self.hint = Some(hint.into());
        }
        self
    }

    /// Adds "did you mean …?" when one of the known names is near, else lists
    /// them.
    #[must_use]
    pub fn suggest<'a>(self, name: &str, known: impl IntoIterator<Item = &'a str>) -> Error {
        let known: Vec<&str> = known.into_iter().collect();
        match nearest(name, known.iter().copied()) {
            Some(near) => self.hint(format!("did you mean `{near}`?")),
            None if known.is_empty() => self,
            None => self.hint(format!("known: {}", known.join(", "))),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.location {
            Some((file, pos)) if pos.line > 0 => write!(f, "{file}:{}:{}: ", pos.line, pos.column)?,
            Some((file, _)) => write!(f, "{file}: ")?,
            None => {}
        }
        f.write_str(&self.message)?;
        match &self.hint {
            Some(hint) => write!(f, "; {hint}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Error {}

/// The known name nearest to `name`, when one is near enough to be a slip of
/// the keyboard.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let limit = 1.max(name.chars().count() / 3);
    known
        .into_iter()
        .map(|k| (strsim::damerau_levenshtein(&name.to_lowercase(), &k.to_lowercase()), k))
        .filter(|(d, _)| *d <= limit)
        .min_by_key(|(d, _)| *d)
        .map(|(_, k)| k)
}
