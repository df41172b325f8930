//! Medians, ratios and their intervals, as tables, CSV and JSON.

use std::fmt;

use serde_json::{Value, json};

use super::{CaseResult, KindResult, SetResult};
use crate::study::statistics::{median_interval, quartiles};

/// A quantity of one contender on one subject.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Lower quartile, median and upper quartile of the repeats.
    pub quartiles: [f64; 3],
    /// Median over the repeats of how many times better than the baseline it
    /// is, and a 95 % bootstrap interval; `None` for the baseline itself.
    pub ratio: Option<[f64; 3]>,
}

/// Everything measured, and against whom.
#[derive(Clone, Debug)]
pub struct Report {
    /// Every subject.
    pub cases: Vec<CaseResult>,
    /// Index of the contender that the ratios are to.
    pub baseline: usize,
}

/// One line of the CSV file.
struct Row<'a> {
    case: &'a CaseResult,
    kind: &'a KindResult,
    what: &'static str,
    unit: &'static str,
    estimate: Estimate,
    set: Option<&'a SetResult>,
}

/// Numbers of which less is better, as they were measured. There is no ratio
/// to or of nothing (brute force takes no memory).
fn less_is_better(own: &[f64], baseline: Option<&[f64]>) -> Estimate {
    let positive = |values: &[f64]| !values.is_empty() && values.iter().all(|v| *v > 0.0);
    let ratio = baseline
        .filter(|base| positive(base) && positive(own))
        .map(|base| median_interval(&[&ratios(own, base)]));
    Estimate { quartiles: quartiles(own), ratio }
}

/// Million rays a second.
fn speed(own: &SetResult, baseline: Option<&SetResult>) -> Estimate {
    let speeds: Vec<f64> = own.seconds.iter().map(|s| own.rays as f64 * 1e-6 / s).collect();
    let ratio = less_is_better(&own.seconds, baseline.map(|b| &*b.seconds)).ratio;
    Estimate { quartiles: quartiles(&speeds), ratio }
}

/// Baseline over own, repeat by repeat.
fn ratios(own: &[f64], baseline: &[f64]) -> Vec<f64> {
    baseline.iter().zip(own).map(|(base, own)| base / own).collect()
}

impl Report {
    fn baseline_of<'a>(&self, case: &'a CaseResult, kind: &KindResult) -> Option<&'a KindResult> {
        let base = &case.kinds[self.baseline];
        (base.name != kind.name).then_some(base)
    }

    fn rows(&self) -> Vec<Row<'_>> {
        let mut rows = Vec::new();
        for case in &self.cases {
            let per_triangle = |bytes: usize| bytes as f64 / f64::from(case.triangles.max(1));
            for kind in &case.kinds {
                let base = self.baseline_of(case, kind);
                let mut add = |what, unit, estimate, set| {
                    rows.push(Row { case, kind, what, unit, estimate, set });
                };
                let cpu = less_is_better(&kind.build.cpu, base.map(|b| &*b.build.cpu));
                add("build_cpu", "s", cpu, None);
                let wall = less_is_better(&kind.build.wall, base.map(|b| &*b.build.wall));
                add("build_wall", "s", wall, None);
                let memory = base.map(|b| [per_triangle(b.memory_bytes)]);
                let memory =
                    less_is_better(&[per_triangle(kind.memory_bytes)], memory.as_ref().map(|m| &m[..]));
                add("memory", "B/triangle", memory, None);
                for (i, set) in kind.sets.iter().enumerate() {
                    let estimate = speed(set, base.map(|b| &b.sets[i]));
                    add(set.set.name(), "Mray/s", estimate, Some(set));
                }
            }
        }
        rows
    }

    /// Geometric mean over all subjects and scattered sets (bounces and
    /// shadow rays) of the speed over the baseline, with its interval, and the
    /// worst case. `None` for the baseline, or where there are none.
    #[must_use]
    pub fn summary(&self, kind: usize) -> Option<([f64; 3], f64)> {
        let mut samples: Vec<Vec<f64>> = Vec::new();
        for case in &self.cases {
            let base = self.baseline_of(case, &case.kinds[kind])?;
            for (own, base) in case.kinds[kind].sets.iter().zip(&base.sets) {
                if own.set.is_incoherent() && !own.seconds.is_empty() && own.rays > 0 {
                    samples.push(ratios(&own.seconds, &base.seconds));
                }
            }
        }
        let slices: Vec<&[f64]> = samples.iter().map(Vec::as_slice).collect();
        let worst = slices.iter().map(|s| quartiles(s)[1]).min_by(f64::total_cmp)?;
        Some((median_interval(&slices), worst))
    }

    /// True when a contender that must be exact was not, or differed from
    /// brute force.
    #[must_use]
    pub fn is_wrong(&self) -> bool {
        let kinds = self.cases.iter().flat_map(|case| &case.kinds).filter(|kind| kind.exact);
        kinds.flat_map(|kind| &kind.sets).any(|set| set.differences.total() + set.wrong > 0)
    }

    /// One line per subject, contender and quantity.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut out = "case,triangles,kind,what,unit,median,low_quartile,high_quartile,\
                       ratio,ratio_low,ratio_high,rays,hits,missed,extra,other_prim,other_bits,wrong\n"
            .to_owned();
        for row in self.rows() {
            let [low, median, high] = row.estimate.quartiles;
            let case = row.case.name.replace(['"', ','], "_");
            out += &format!(
                "{case},{},{},{},{},{median},{low},{high},",
                row.case.triangles, row.kind.name, row.what, row.unit
            );
            out += &row.estimate.ratio.map_or(",,".into(), |[r, low, high]| format!("{r},{low},{high}"));
            out += &row.set.map_or(",,,,,,,".into(), |s| {
                let d = s.differences;
                format!(
                    ",{},{},{},{},{},{},{}",
                    s.rays, s.hits, d.missed, d.extra, d.other_prim, d.other_bits, s.wrong
                )
            });
            out.push('\n');
        }
        out
    }

    /// Everything, with each single time.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let set = |s: &SetResult| {
            let d = s.differences;
            json!({
                "set": s.set.name(), "rays": s.rays, "hits": s.hits, "cpu_seconds": s.seconds,
                "missed": d.missed, "extra": d.extra, "other_prim": d.other_prim,
                "other_bits": d.other_bits, "wrong": s.wrong,
            })
        };
        let kind = |k: &KindResult| {
            json!({
                "name": k.name, "exact": k.exact,
                "build": {"cpu_seconds": k.build.cpu, "wall_seconds": k.build.wall},
                "memory_bytes": k.memory_bytes,
                "tree": {"nodes": k.stats.nodes, "leaves": k.stats.leaves, "depth": k.stats.depth,
                         "cost": k.stats.cost},
                "sets": k.sets.iter().map(set).collect::<Vec<_>>(),
            })
        };
        let case = |c: &CaseResult| {
            json!({
                "name": c.name, "triangles": c.triangles, "analytic": c.analytic,
                "geometry_bytes": c.geometry_bytes, "verified_rays": c.verified,
                "kinds": c.kinds.iter().map(kind).collect::<Vec<_>>(),
            })
        };
        let names: Vec<&str> =
            self.cases.first().into_iter().flat_map(|c| &c.kinds).map(|k| &*k.name).collect();
        let summary = |k: usize| {
            self.summary(k).map(|([mean, low, high], worst)| {
                json!({"kind": names[k], "ratio": mean, "interval": [low, high], "worst": worst})
            })
        };
        json!({
            "baseline": names.get(self.baseline),
            "cases": self.cases.iter().map(case).collect::<Vec<_>>(),
            "scattered_rays_over_baseline": (0..names.len()).filter_map(summary).collect::<Vec<_>>(),
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for case in &self.cases {
            self.show_case(f, case)?;
        }
        let Some(first) = self.cases.first() else { return Ok(()) };
        for (k, kind) in first.kinds.iter().enumerate() {
            if let Some(([mean, low, high], worst)) = self.summary(k) {
                writeln!(
                    f,
                    "{} over {}, bounces and shadow rays: {mean:.3} [{low:.3}, {high:.3}], worst {worst:.3}",
                    kind.name, first.kinds[self.baseline].name
                )?;
            }
        }
        Ok(())
    }
}

impl Report {
    fn show_case(&self, f: &mut fmt::Formatter<'_>, case: &CaseResult) -> fmt::Result {
        writeln!(
            f,
            "{}: {} triangles, {} analytic; geometry {:.1} B a triangle",
            case.name,
            case.triangles,
            case.analytic,
            case.geometry_bytes as f64 / f64::from(case.triangles.max(1))
        )?;
        let base = &case.kinds[self.baseline].name;
        writeln!(
            f,
            "  {:<16} {:<18} {:>9} {:>19}  {:<24} differences from brute force and the default",
            "kind",
            "what",
            "median",
            "quartiles",
            format!("better than {base}")
        )?;
        for row in self.rows().iter().filter(|row| std::ptr::eq(row.case, case)) {
            let [low, median, high] = row.estimate.quartiles;
            let ratio = row
                .estimate
                .ratio
                .map_or(String::new(), |[r, low, high]| format!("{r:.3} [{low:.3}, {high:.3}]"));
            let differences = row.set.map_or(String::new(), |s| show_differences(s, case.verified));
            let (what, spread) = (format!("{}, {}", row.what, row.unit), format!("{low:.3} … {high:.3}"));
            let line = format!(
                "  {:<16} {what:<18} {median:>9.3} {spread:>19}  {ratio:<24} {differences}",
                row.kind.name
            );
            writeln!(f, "{}", line.trim_end())?;
        }
        for kind in &case.kinds {
            let s = kind.stats;
            if s.leaves > 0 {
                writeln!(
                    f,
                    "  {:<16} {} nodes, {} leaves, depth {}, expected cost {:.2}",
                    kind.name, s.nodes, s.leaves, s.depth, s.cost
                )?;
            }
        }
        writeln!(f)
    }
}

fn show_differences(set: &SetResult, verified: usize) -> String {
    let d = set.differences;
    let verified = verified.min(set.rays);
    let mut text = format!("{} of {verified}, {} of {}", set.wrong, d.total(), set.rays);
    for (count, name) in
        [(d.missed, "missed"), (d.extra, "extra"), (d.other_prim, "other prim"), (d.other_bits, "other bits")]
    {
        if count > 0 {
            text += &format!(", {count} {name}");
        }
    }
    text
}
