//! The outcome of a run as a table and as JSON.

use std::fmt;

use serde_json::{Value, json};

use super::{ABSENT, ALPHA, Case, Effort, Peer, peers};

/// What a row gave.
#[derive(Clone, Debug)]
pub struct RowReport {
    /// Its number.
    pub id: &'static str,
    /// What is promised.
    pub what: &'static str,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Why it ended early.
    pub error: Option<String>,
    /// Its comparisons.
    pub cases: Vec<Case>,
}

impl RowReport {
    /// True when all is as promised but for what is known, and something was
    /// compared.
    #[must_use]
    pub fn passed(&self) -> bool {
        let fine = |case: &Case| case.passed() || case.known.is_some();
        self.error.is_none() && !self.cases.is_empty() && self.cases.iter().all(fine)
    }

    /// Cases in which a renderer is closer to the truth.
    fn beaten(&self, renderer: &str) -> Vec<&Case> {
        let better = |case: &&Case| {
            peers::of(self.id, &case.name).iter().any(|p| p.renderer == renderer && p.beats(case))
        };
        self.cases.iter().filter(better).collect()
    }
}

/// What a run gave. Prints as a table.
#[derive(Clone, Debug)]
pub struct Report {
    /// In the order of the catalogue.
    pub rows: Vec<RowReport>,
    /// How much was run.
    pub effort: Effort,
    /// Seed of it.
    pub seed: u64,
}

/// Renderers whose figures are known.
const RENDERERS: [&str; 3] = ["mitsuba", "cycles", "luxcore"];

impl Report {
    /// True when every row passed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.rows.iter().all(RowReport::passed)
    }

    /// Row and case of which a renderer is closer to the truth, by more than
    /// noise and rounding.
    #[must_use]
    pub fn beaten(&self, renderer: &str) -> Vec<String> {
        let name = |row: &RowReport, case: &Case| format!("{} {}", row.id, case.name);
        self.rows.iter().flat_map(|row| row.beaten(renderer).into_iter().map(|c| name(row, c))).collect()
    }

    /// Everything, for machines: an object with the list `rows`, one entry per
    /// case.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let rows: Vec<Value> = self.rows.iter().flat_map(row_json).collect();
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "effort": match self.effort { Effort::Fast => "fast", Effort::Full => "full" },
            "seed": self.seed,
            "false_positive_rate": ALPHA,
            "pass": self.passed(),
            "rows": rows,
            "absent": ABSENT.iter().map(|(id, why)| json!({"id": id, "why": why})).collect::<Vec<_>>(),
        })
    }
}

fn row_json(row: &RowReport) -> Vec<Value> {
    let mut out: Vec<Value> = row
        .cases
        .iter()
        .map(|case| {
            json!({
                "id": row.id,
                "what": row.what,
                "case": case.name,
                "expected": case.expected,
                "measured": case.measured,
                "error": case.error(),
                "standard_error": case.noise(),
                "tolerance": case.tolerance,
                "pass": case.passed(),
                "failure": case.failure,
                "known": case.known,
                "peers": peers::of(row.id, &case.name).iter().map(|p| json!({
                    "renderer": p.renderer, "error": p.error, "standard_error": p.noise, "remark": p.remark,
                })).collect::<Vec<_>>(),
            })
        })
        .collect();
    if row.error.is_some() || row.cases.is_empty() {
        out.push(json!({
            "id": row.id, "what": row.what, "case": "", "pass": false,
            "failure": row.error.clone().unwrap_or_else(|| "nothing was compared".into()),
        }));
    }
    out
}

impl fmt::Display for RowReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<4}{} ({:.1} s)", self.id, self.what, self.seconds)?;
        for case in &self.cases {
            let verdict = match (case.passed(), case.known) {
                (true, _) => "ok",
                (false, Some(_)) => "known",
                (false, None) => "FAIL",
            };
            write!(
                f,
                "    {verdict:<6}{:<44}{:>14}{:>14}{:>11}{:>11}",
                case.name,
                number(case.expected),
                number(case.measured),
                error(case.error()),
                plain(case.tolerance)
            )?;
            for renderer in RENDERERS {
                write!(f, "{:>11}", peer(self.id, &case.name, renderer))?;
            }
            match &case.failure {
                Some(why) => writeln!(f, "  {why}")?,
                None => writeln!(f)?,
            }
        }
        if let Some(error) = &self.error {
            writeln!(f, "    FAIL {error}")?;
        } else if self.cases.is_empty() {
            writeln!(f, "    FAIL nothing was compared")?;
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "          {:<44}{:>14}{:>14}{:>11}{:>11}{:>11}{:>11}{:>11}",
            "case", "expected", "measured", "error", "within", "mitsuba", "cycles", "luxcore"
        )?;
        for row in &self.rows {
            write!(f, "{row}")?;
        }
        let cases: usize = self.rows.iter().map(|r| r.cases.len()).sum();
        let failed = self.rows.iter().filter(|r| !r.passed()).count();
        writeln!(
            f,
            "{} rows, {cases} cases, {failed} rows failed; false alarms of all means together: at most {ALPHA}",
            self.rows.len()
        )?;
        for row in &self.rows {
            for case in row.cases.iter().filter(|case| !case.passed()) {
                if let Some(why) = case.known {
                    writeln!(f, "not kept, and known: {} {}: {why}", row.id, case.name)?;
                }
            }
        }
        for renderer in RENDERERS {
            let beaten = self.beaten(renderer);
            if !beaten.is_empty() {
                writeln!(f, "closer to the truth in {renderer}: {}", beaten.join("; "))?;
            }
        }
        for (id, why) in ABSENT {
            writeln!(f, "{id} was not run: {why}")?;
        }
        Ok(())
    }
}

fn peer(id: &str, case: &str, renderer: &str) -> String {
    match peers::of(id, case).into_iter().find(|p| p.renderer == renderer) {
        None => "-".into(),
        Some(Peer { error: Some(e), .. }) => error(*e),
        Some(p) if p.remark.is_empty() => "none".into(),
        Some(p) => p.remark.clone(),
    }
}

/// Nine digits, or an exponent where those would not tell.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { format!("{x:.9}") } else { format!("{x:.6e}") }
}

/// With its sign; percent where that reads well.
fn error(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (1e-4..100.0).contains(&x.abs()) {
        format!("{:+.3} %", x * 100.0)
    } else {
        format!("{x:+.1e}")
    }
}

fn plain(x: f64) -> String {
    if x == 0.0 { "exact".into() } else { error(x).trim_start_matches('+').to_owned() }
}
