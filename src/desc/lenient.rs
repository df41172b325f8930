//! Leniency: what is not known is replaced, and the replacement is named.
//!
//! A scene that was read with it turns the errors that have a sensible
//! replacement into notes. Who finds such an error calls
//! [`SceneDesc::replace`]: it gives the error back in a strict scene, and in a
//! lenient one writes down what was put in its place. Without leniency nothing
//! is stored and nothing is looked up.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Error, Result, SceneDesc};

/// Whether errors with a sensible replacement are notes, and those notes.
/// Copies of a scene share them.
#[derive(Clone, Debug, Default)]
pub struct Leniency {
    notes: Option<Arc<Mutex<Notes>>>,
}

#[derive(Debug, Default)]
struct Notes {
    /// All of them, each once, in the order they came.
    all: Vec<String>,
    /// How many were handed out.
    told: usize,
}

impl Leniency {
    /// The leniency that replaces.
    #[must_use]
    pub fn lenient() -> Leniency {
        Leniency { notes: Some(Arc::default()) }
    }

    /// True where replacing is allowed.
    #[must_use]
    pub fn is_lenient(&self) -> bool {
        self.notes.is_some()
    }

    fn lock(&self) -> Option<MutexGuard<'_, Notes>> {
        // A list of texts is whole whatever happened to who held it.
        self.notes.as_ref().map(|notes| notes.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl SceneDesc {
    /// The error itself, unless the scene is lenient: then it becomes a note
    /// that ends in `outcome`, such as "replaced by a grey diffuse" or "left
    /// out", and the caller goes on with just that.
    ///
    /// # Errors
    /// `error`, in a strict scene.
    pub fn replace(&self, error: Error, outcome: &str) -> Result<()> {
        let Some(mut notes) = self.leniency.lock() else { return Err(error) };
        let note = format!("{}; {outcome}", Error { hint: None, ..error });
        if !notes.all.contains(&note) {
            notes.all.push(note);
        }
        Ok(())
    }

    /// The notes that nobody has asked for yet.
    #[must_use]
    pub fn new_replacements(&self) -> Vec<String> {
        let Some(mut notes) = self.leniency.lock() else { return Vec::new() };
        let new = notes.all[notes.told..].to_vec();
        notes.told = notes.all.len();
        new
    }

    /// All notes so far.
    #[must_use]
    pub fn replacements(&self) -> Vec<String> {
        self.leniency.lock().map_or(Vec::new(), |notes| notes.all.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strict_scenes_fail_and_lenient_ones_take_notes() {
        let strict = SceneDesc::default();
        let error = || Error::new("unknown thing `x`").hint("did you mean `y`?");
        assert_eq!(strict.replace(error(), "left out"), Err(error()));
        assert!(strict.replacements().is_empty() && strict.new_replacements().is_empty());

        let lenient = SceneDesc { leniency: Leniency::lenient(), ..SceneDesc::default() };
        assert_eq!(lenient.replace(error(), "left out"), Ok(()));
        assert_eq!(lenient.clone().replace(error(), "left out"), Ok(()));
        assert_eq!(lenient.new_replacements(), ["unknown thing `x`; left out"]);
        assert!(lenient.new_replacements().is_empty());
        assert_eq!(lenient.replacements().len(), 1);
    }
}
