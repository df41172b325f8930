//! What a row writes down: cases, and when one has passed.

use super::stage::{Still, Workshop};
use super::{ALPHA, MOST_MEANS, Options};
use crate::desc::Result;
use crate::study::{sidak_level, student_quantile};

/// How much of the catalogue is run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// In minutes: few samples, the telling cases.
    #[default]
    Fast,
    /// Sixteen times the samples and rays, and every case.
    Full,
}

impl Effort {
    /// `fast` or sixteen times as many.
    #[must_use]
    pub fn count(self, fast: u64) -> u64 {
        match self {
            Effort::Fast => fast,
            Effort::Full => 16 * fast,
        }
    }
}

/// One comparison of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What is special about it, such as `r/h = 5e-4`.
    pub name: String,
    /// The right value.
    pub expected: f64,
    /// What came out.
    pub measured: f64,
    /// Standard error of `measured`; 0 where there is no noise.
    pub standard_error: f64,
    /// How far `measured` may be off: relative to `expected`, absolute where
    /// that is 0. For a mean it includes what its noise explains.
    pub tolerance: f64,
    /// Why it failed whatever was measured: noise, dropped samples, a message
    /// that was not the right one.
    pub failure: Option<String>,
    /// Why it is known to fail. It does not fail its row, but is not passed either.
    pub known: Option<&'static str>,
}

impl Case {
    /// (measured − expected) / expected, or measured where 0 is expected.
    #[must_use]
    pub fn error(&self) -> f64 {
        let off = self.measured - self.expected;
        if self.expected == 0.0 || off == 0.0 { off } else { off / self.expected }
    }

    /// Standard error in the unit of [`Case::error`].
    #[must_use]
    pub fn noise(&self) -> f64 {
        if self.expected == 0.0 { self.standard_error } else { self.standard_error / self.expected.abs() }
    }

    /// True when it is as promised.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.failure.is_none() && self.error().abs() <= self.tolerance
    }
}

/// Independent renders behind each mean.
pub(super) const SEEDS: u64 = 16;

/// A mean whose interval is wider than this part of it shows nothing, where
/// nothing else is said.
const UNDECIDED: f64 = 0.01;

/// When two means are the same.
#[derive(Clone, Copy, Debug)]
pub(super) struct Same {
    /// Relative difference that is none.
    pub margin: f64,
    /// How well they must be known, relative.
    pub enough: f64,
    /// Degrees of freedom of their errors: renders less one.
    pub freedom: usize,
}

impl Same {
    /// What is asked of two means of all the renders there are.
    pub(super) fn to(enough: f64) -> Same {
        Same { margin: 1e-4, enough, freedom: SEEDS as usize - 1 }
    }
}

/// Where a row puts its cases, and gets its scenes rendered.
#[derive(Debug)]
pub struct Sheet {
    pub(super) shop: Workshop,
    cases: Vec<Case>,
}

impl Sheet {
    pub(super) fn new(id: &'static str, options: &Options) -> Sheet {
        Sheet { shop: Workshop::new(id, options), cases: Vec::new() }
    }

    pub(super) fn finish(self) -> Result<Vec<Case>> {
        self.shop.finish()?;
        Ok(self.cases)
    }

    /// `fast` or sixteen times as many.
    pub(super) fn count(&self, fast: u64) -> u64 {
        self.shop.effort.count(fast)
    }

    /// True when every case is wanted.
    pub(super) fn full(&self) -> bool {
        self.shop.effort == Effort::Full
    }

    /// A value without noise, within a relative (of 0: absolute) tolerance.
    pub(super) fn within(&mut self, name: impl Into<String>, expected: f64, measured: f64, tolerance: f64) {
        let name = name.into();
        self.cases.push(Case {
            name,
            expected,
            measured,
            standard_error: 0.0,
            tolerance,
            failure: None,
            known: None,
        });
    }

    /// The same number, or bit for bit the same.
    pub(super) fn exact(&mut self, name: impl Into<String>, expected: f64, measured: f64) {
        self.within(name, expected, measured, 0.0);
    }

    /// `bad` of `tried` did what none may do.
    pub(super) fn none(&mut self, name: impl Into<String>, bad: u64, tried: u64) {
        let name = format!("{} ({tried})", name.into());
        self.within(name, 0.0, bad as f64 / tried.max(1) as f64, 0.0);
        if tried == 0
            && let Some(case) = self.cases.last_mut()
        {
            case.failure = Some("nothing was tried".into());
        }
    }

    /// The last case is a promise that is known not to be kept, and why.
    pub(super) fn known(&mut self, why: &'static str) {
        if let Some(case) = self.cases.last_mut() {
            case.known = Some(why);
        }
    }

    /// Something that is so or is not; `detail` says what was found instead.
    pub(super) fn holds(&mut self, name: impl Into<String>, holds: bool, detail: impl FnOnce() -> String) {
        let failure = (!holds).then(detail);
        let measured = f64::from(u8::from(!holds));
        let name = name.into();
        self.cases.push(Case {
            name,
            expected: 0.0,
            measured,
            standard_error: 0.0,
            tolerance: 0.0,
            failure,
            known: None,
        });
    }

    /// The mean of independent `values` is `expected`, known to `enough` of it.
    pub(super) fn mean(&mut self, name: impl Into<String>, expected: f64, values: &[f64], enough: f64) {
        let same = Same { margin: 1e-4, enough, freedom: values.len() - 1 };
        self.against(name, (expected, 0.0), mean_and_error(values), same);
    }

    /// Two means are the same; each is (value, standard error).
    pub(super) fn against(
        &mut self,
        name: impl Into<String>,
        (expected, expected_error): (f64, f64),
        (measured, standard_error): (f64, f64),
        Same { margin, enough, freedom }: Same,
    ) {
        let single = sidak_level(ALPHA, MOST_MEANS);
        let t = student_quantile(1.0 - 0.5 * single, freedom as f64);
        let standard_error = standard_error.hypot(expected_error);
        let unit = if expected == 0.0 { 1.0 } else { expected.abs() };
        let explained = t * standard_error / unit;
        let failure = (explained.is_nan() || explained > enough)
            .then(|| format!("undecided: known to {explained:.1e} only"));
        let tolerance = explained.max(margin);
        let name = name.into();
        self.cases.push(Case { name, expected, measured, standard_error, tolerance, failure, known: None });
    }

    /// Renders a scene of one radiance and compares its mean with it, within
    /// 1e-4 where noise does not explain more.
    ///
    /// # Errors
    /// A scene that does not load.
    pub(super) fn radiance(&mut self, name: impl Into<String>, expected: f64, still: &Still) -> Result<()> {
        self.radiance_to(name, expected, UNDECIDED, still)
    }

    /// The same for a scene whose mean can be known to `enough` of it only.
    ///
    /// # Errors
    /// A scene that does not load.
    pub(super) fn radiance_to(
        &mut self,
        name: impl Into<String>,
        expected: f64,
        enough: f64,
        still: &Still,
    ) -> Result<()> {
        let name = name.into();
        self.shop.offer(&name, still, expected)?;
        let means = self.shop.means(still)?;
        let same = Same { margin: 1e-4, enough, freedom: means.values.len() - 1 };
        self.against(name, (expected, 0.0), mean_and_error(&means.values), same);
        if let (Some(bad), Some(case)) = (means.dropped, self.cases.last_mut()) {
            case.failure = Some(format!("samples were dropped: {bad}"));
        }
        Ok(())
    }

    /// The same where the mean lies between two bounds, the lower and upper of
    /// (least, ideal, most), give or take its noise.
    ///
    /// # Errors
    /// A scene that does not load.
    pub(super) fn radiance_between(
        &mut self,
        name: impl Into<String>,
        (least, ideal, most): (f64, f64, f64),
        still: &Still,
    ) -> Result<()> {
        let (low, high) = ((ideal - least) / ideal, (most - ideal) / ideal);
        self.radiance(name, ideal, still)?;
        if let Some(case) = self.cases.last_mut() {
            let noise = case.tolerance.min(UNDECIDED);
            case.tolerance = noise + if case.error() < 0.0 { low } else { high };
        }
        Ok(())
    }
}

/// Mean and its standard error.
pub(super) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
