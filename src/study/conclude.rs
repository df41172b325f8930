//! What follows from error and time of all rungs: slopes, efficiency, time to
//! an error, and speed-ups over a baseline.
//!
//! Between two rungs error against time is a straight line in logarithms.
//! Comparisons stay inside the range that both configurations cover; only the
//! time to an error may be extrapolated, along the fitted slope, and then says
//! so. Rungs whose error is within the noise of the reference take no part.
//! Intervals: [`super::interval`]; the runs of different rungs are independent.

use super::interval::{Group, Scale, exp, interval_of};
use super::model::{
    AtLevel, Comparison, ConfigurationStudy, Cost, Fit, Interval, Metric, Preference, Rung, TimeTo,
};

/// Levels of a comparison, from one end of the common range to the other.
const LEVELS: usize = 5;
/// A slope above this over the last three rungs is no convergence to speak of.
const STALLED: f64 = -0.25;
/// Flattest slope that is extrapolated along.
const EXTRAPOLATED: f64 = -0.3;

/// Error and CPU seconds of the runs of one rung.
struct Point {
    group: Group,
    samples: f64,
}

/// What the figures see of a point: logarithms of error and of CPU seconds.
#[derive(Clone, Copy)]
struct At {
    error: f64,
    time: f64,
}

/// The rungs of a configuration that a metric of colour can be read from.
struct Curve {
    points: Vec<Point>,
}

impl Curve {
    fn of(rungs: &[Rung], metric: Metric) -> Curve {
        let points = rungs.iter().filter_map(|rung| {
            let figure = rung.figures.iter().find(|f| f.target == "colour" && f.metric == metric)?;
            let usable = !figure.limited
                && figure.runs.len() == rung.cpu_seconds.len()
                && figure.mean.value > 0.0
                && rung.cpu_seconds.iter().all(|c| *c > 0.0)
                && figure.runs.iter().all(|e| e.is_finite());
            let runs = figure.runs.iter().zip(&rung.cpu_seconds).map(|(e, c)| vec![*e, *c]).collect();
            usable.then_some(Point { group: Group { runs }, samples: rung.samples_per_pixel })
        });
        Curve { points: points.collect() }
    }

    fn groups(&self) -> Vec<Group> {
        self.points.iter().map(|p| p.group.clone()).collect()
    }

    /// Logarithms of the means, as the figures will see them.
    fn at(&self) -> Vec<At> {
        let mean = |p: &Point, k: usize| {
            (p.group.runs.iter().map(|r| r[k]).sum::<f64>() / p.group.runs.len() as f64).ln()
        };
        self.points.iter().map(|p| At { error: mean(p, 0), time: mean(p, 1) }).collect()
    }
}

/// The flat list of logarithms as points.
fn points(flat: &[f64]) -> Vec<At> {
    flat.chunks_exact(2).map(|p| At { error: p[0], time: p[1] }).collect()
}

/// Least squares slope of y over x.
fn slope(xy: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let n = xy.clone().count() as f64;
    let (x, y) = xy.clone().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (above, below) = xy.fold((0.0, 0.0), |(a, b), (u, v)| (a + (u - x) * (v - y), b + (u - x) * (u - x)));
    above / below
}

/// Slopes of MSE, relMSE and its trimmed form against time and samples.
/// Nothing for fewer than three usable rungs.
#[must_use]
pub fn fits(rungs: &[Rung]) -> Vec<Fit> {
    let mut all = Vec::new();
    for metric in [Metric::Mse, Metric::RelMse, Metric::RelMseTrimmed] {
        let curve = Curve::of(rungs, metric);
        if curve.points.len() < 3 {
            continue;
        }
        let samples: Vec<f64> = curve.points.iter().map(|p| p.samples.ln()).collect();
        for against in [Cost::Cpu, Cost::Samples] {
            let over = |from: usize| {
                interval_of(&curve.groups()[from..], Scale::Log, &|flat| {
                    let at = points(flat);
                    let x = at.iter().zip(&samples[from..]).map(|(p, s)| match against {
                        Cost::Cpu => p.time,
                        Cost::Samples => *s,
                    });
                    slope(x.zip(at.iter().map(|p| p.error)))
                })
            };
            let (whole, last) = (over(0), over(curve.points.len() - 3));
            all.push(Fit { metric, against, slope: whole, last, verdict: rate(&whole, &last) });
        }
    }
    all
}

/// A slope in words.
fn rate(slope: &Interval, last: &Interval) -> String {
    let text = if last.value > STALLED && last.high > STALLED {
        "has stalled: over the last three rungs more samples hardly help"
    } else if slope.high < -1.0 {
        "falls faster than with independent samples (rate −1)"
    } else if slope.low > -1.0 {
        "falls more slowly than with independent samples (rate −1)"
    } else {
        "falls at the rate of independent samples (−1), as far as the interval tells"
    };
    text.to_owned()
}

/// 1 ÷ (relMSE of colour × CPU seconds) of a rung; NaN where it is not known.
#[must_use]
pub fn efficiency(rung: &Rung) -> Interval {
    let curve = Curve::of(std::slice::from_ref(rung), Metric::RelMse);
    if curve.points.is_empty() {
        return Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    }
    exp(interval_of(&curve.groups(), Scale::Log, &|at| -at[0] - at[1]))
}

/// CPU seconds until the root of relMSE is at most 1 % and 0.5 %.
#[must_use]
pub fn time_to(rungs: &[Rung]) -> Vec<TimeTo> {
    let curve = Curve::of(rungs, Metric::RelMse);
    let at = curve.at();
    let unknown = Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    [0.01_f64, 0.005]
        .into_iter()
        .map(|error| {
            let level = 2.0 * error.ln();
            if let Some(k) = bracket(&at, level) {
                let cpu = interval_of(&curve.groups(), Scale::Log, &|flat| time_at(&points(flat), k, level));
                return TimeTo { error, cpu: exp(cpu), extrapolated: false };
            }
            let fitted = |at: &[At]| slope(at.iter().map(|p| (p.time, p.error)));
            if at.len() < 3 || fitted(&at) > EXTRAPOLATED {
                return TimeTo { error, cpu: unknown, extrapolated: false };
            }
            // From the nearer end along the fitted slope.
            let from = if at[0].error < level { 0 } else { at.len() - 1 };
            let cpu = interval_of(&curve.groups(), Scale::Log, &|flat| {
                let at = points(flat);
                at[from].time + (level - at[from].error) / fitted(&at)
            });
            TimeTo { error, cpu: exp(cpu), extrapolated: true }
        })
        .collect()
}

/// The first rung after which the error falls through `level`.
fn bracket(at: &[At], level: f64) -> Option<usize> {
    (1..at.len()).find(|k| at[k - 1].error >= level && level >= at[*k].error).map(|k| k - 1)
}

/// Log time at an error between rungs `k` and `k + 1`.
fn time_at(at: &[At], k: usize, level: f64) -> f64 {
    let (a, b) = (at[k], at[k + 1]);
    on_line([a.error, a.time], [b.error, b.time], level)
}

/// y at `x` on the line through two points; that of the first where x does not tell.
fn on_line(a: [f64; 2], b: [f64; 2], x: f64) -> f64 {
    if a[0] == b[0] { a[1] } else { a[1] + (x - a[0]) / (b[0] - a[0]) * (b[1] - a[1]) }
}

/// The rung before a time; the last but one for the last rung's own.
fn before(at: &[At], time: f64) -> usize {
    (1..at.len()).find(|k| time <= at[*k].time).unwrap_or(at.len() - 1) - 1
}

/// Log error at a time between rungs `k` and `k + 1`.
fn error_at(at: &[At], k: usize, time: f64) -> f64 {
    let (a, b) = (at[k], at[k + 1]);
    on_line([a.time, a.error], [b.time, b.error], time)
}

/// Two curves side by side.
struct Two<'a> {
    base: &'a Curve,
    other: &'a Curve,
    groups: Vec<Group>,
    at: [Vec<At>; 2],
}

impl Two<'_> {
    /// The interval of a figure of both.
    fn interval(&self, figure: &dyn Fn(&[At], &[At]) -> f64) -> Interval {
        let cut = 2 * self.base.points.len();
        exp(interval_of(&self.groups, Scale::Log, &|flat| {
            figure(&points(&flat[..cut]), &points(&flat[cut..]))
        }))
    }

    /// Levels within the range that both cover, by what `of` reads.
    fn levels(&self, of: impl Fn(&At) -> f64) -> Vec<f64> {
        let range = |at: &[At]| {
            at.iter().map(&of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ((a, b), (c, d)) = (range(&self.at[0]), range(&self.at[1]));
        let (low, high) = (a.max(c), b.min(d));
        if !(low < high) {
            return Vec::new();
        }
        (0..LEVELS).map(|k| low + (high - low) * k as f64 / (LEVELS - 1) as f64).collect()
    }

    fn equal_time(&self) -> Vec<(f64, AtLevel)> {
        let level = |time: f64| {
            let [k, j] = [before(&self.at[0], time), before(&self.at[1], time)];
            let speedup = self.interval(&|base, other| error_at(base, k, time) - error_at(other, j, time));
            (time, AtLevel { level: time.exp(), speedup })
        };
        self.levels(|p| p.time).into_iter().map(level).collect()
    }

    fn equal_error(&self) -> Vec<AtLevel> {
        let level = |error: f64| {
            let (k, j) = (bracket(&self.at[0], error)?, bracket(&self.at[1], error)?);
            let speedup = self.interval(&|base, other| time_at(base, k, error) - time_at(other, j, error));
            Some(AtLevel { level: error.exp(), speedup })
        };
        self.levels(|p| p.error).into_iter().filter_map(level).collect()
    }

    /// Geometric mean of the speed-ups at equal time.
    fn overall(&self, times: &[f64]) -> Interval {
        let brackets: Vec<[usize; 2]> =
            times.iter().map(|t| [before(&self.at[0], *t), before(&self.at[1], *t)]).collect();
        self.interval(&|base, other| {
            let terms = times.iter().zip(&brackets);
            terms.map(|(t, [k, j])| error_at(base, *k, *t) - error_at(other, *j, *t)).sum::<f64>()
                / times.len() as f64
        })
    }

    /// Ratio of the efficiencies of the largest rungs, where the times have no
    /// common range.
    fn at_the_end(&self) -> Interval {
        self.interval(&|base, other| match (base.last(), other.last()) {
            (Some(b), Some(o)) => b.error + b.time - o.error - o.time,
            _ => f64::NAN,
        })
    }
}

/// A configuration against the baseline, by relMSE of colour.
#[must_use]
pub fn compare(base: &ConfigurationStudy, other: &ConfigurationStudy) -> Comparison {
    let curves = [base, other].map(|c| Curve::of(&c.rungs, Metric::RelMse));
    let [a, b] = &curves;
    let not_comparable = |why: String| Comparison {
        configuration: other.name.clone(),
        equal_time: Vec::new(),
        equal_error: Vec::new(),
        overall: Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN },
        verdict: Preference::NotComparable,
        text: why,
    };
    if base.biased_by_design != other.biased_by_design {
        let what = other.biased_by_design.as_deref().unwrap_or("all light");
        return not_comparable(format!(
            "not compared with {}: it computes something else ({what})",
            base.name
        ));
    }
    if a.points.is_empty() || b.points.is_empty() {
        return not_comparable(format!(
            "not compared with {}: no rung is above the reference's noise",
            base.name
        ));
    }
    let groups = a.groups().into_iter().chain(b.groups()).collect();
    let two = Two { base: a, other: b, groups, at: [a.at(), b.at()] };
    debug_assert_eq!(two.other.points.len(), two.at[1].len());
    let timed = if a.points.len() > 1 && b.points.len() > 1 { two.equal_time() } else { Vec::new() };
    let times: Vec<f64> = timed.iter().map(|(time, _)| *time).collect();
    let (overall, how) = if times.is_empty() {
        (two.at_the_end(), "efficiency of the largest rungs")
    } else {
        (two.overall(&times), "error at equal time")
    };
    let verdict = preference(&overall);
    Comparison {
        configuration: other.name.clone(),
        equal_time: timed.into_iter().map(|(_, level)| level).collect(),
        equal_error: two.equal_error(),
        overall,
        verdict,
        text: sentence(&overall, verdict, &base.name, how),
    }
}

fn preference(overall: &Interval) -> Preference {
    if overall.low > 1.0 {
        Preference::Better
    } else if overall.high < 1.0 {
        Preference::Worse
    } else if overall.low.is_nan() {
        Preference::NotComparable
    } else {
        Preference::NoDifference
    }
}

fn sentence(overall: &Interval, verdict: Preference, base: &str, how: &str) -> String {
    let Interval { value, low, high } = overall;
    let ratio = format!("{value:.2}× [{low:.2}, {high:.2}], {how}");
    match verdict {
        Preference::Better => format!("better than {base}: {ratio}"),
        Preference::Worse => format!("worse than {base}: {ratio}"),
        Preference::NoDifference => format!("no significant difference from {base}: {ratio}"),
        Preference::NotComparable => format!("not comparable with {base}"),
    }
}
