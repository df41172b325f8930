//! What other renderers give in the same cases: `peers.json`.
//!
//! Mitsuba's figures are of the very scenes of these rows, as
//! `tools/selftest_mitsuba.py` renders them from `etendue selftest --export`.
//! Those of others were measured on scenes of the same construction.

use std::sync::LazyLock;

use serde::Deserialize;

/// Another renderer's figure in a case.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Peer {
    /// Row.
    pub id: String,
    /// Case.
    pub case: String,
    /// `mitsuba`, `cycles` or `luxcore`.
    pub renderer: String,
    /// Its error, in the unit of [`super::Case::error`]; none where it gave
    /// nothing, or values that are not finite.
    pub error: Option<f64>,
    /// Standard error of that.
    #[serde(default)]
    pub noise: f64,
    /// What it did instead of a number.
    #[serde(default)]
    pub remark: String,
}

/// All figures there are.
static PEERS: LazyLock<Vec<Peer>> =
    LazyLock::new(|| serde_json::from_str(include_str!("peers.json")).unwrap_or_default());

/// Figures of a case.
pub(super) fn of(id: &str, case: &str) -> Vec<&'static Peer> {
    PEERS.iter().filter(|p| p.id == id && p.case == case).collect()
}

/// Differences below this are rounding.
const ROUNDING: f64 = 1e-6;

impl Peer {
    /// True when this renderer is closer to the truth than `case`, by more
    /// than the noise of either explains.
    #[must_use]
    pub fn beats(&self, case: &super::Case) -> bool {
        let ours = case.error().abs() - 3.0 * case.noise();
        self.error.is_some_and(|error| ours > error.abs() + 3.0 * self.noise + ROUNDING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_read() {
        let read: Result<Vec<Peer>, _> = serde_json::from_str(include_str!("peers.json"));
        assert!(read.is_ok(), "{read:?}");
        assert!(!PEERS.is_empty());
    }
}
