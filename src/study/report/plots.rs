//! Which plots a study has, and what each of them shows.

use std::collections::BTreeSet;

use super::axis::Axis;
use super::draw::{Chart, Guide, Point, Series, svg};
use super::format::number;
use crate::desc::Result;
use crate::study::model::{Cost, Figure, Metric, Rung, SceneStudy, Study};
use crate::study::statistics::two_sided_p;

/// A finished plot.
pub(super) struct Plot {
    /// Index of the scene.
    pub(super) scene: usize,
    /// Name of the files, without a suffix: letters, digits and hyphens.
    pub(super) name: String,
    pub(super) title: String,
    pub(super) svg: String,
}

/// The metrics that get plots of their own.
const PLOTTED: [(Metric, &str); 4] = [
    (Metric::RelMse, "relmse"),
    (Metric::Mse, "mse"),
    (Metric::FlipLdr, "flip-ldr"),
    (Metric::FlipHdr, "flip-hdr"),
];

/// All plots for which there is anything to show.
pub(super) fn all(study: &Study) -> Result<Vec<Plot>> {
    let mut plots = Vec::new();
    let mut taken = BTreeSet::new();
    for (index, scene) in study.scenes.iter().enumerate() {
        let stem = file_stem(&scene.name, index, &mut taken);
        let mut charts = Vec::new();
        for (metric, name) in PLOTTED {
            for (cost, end) in [(Cost::Cpu, "time"), (Cost::Samples, "samples")] {
                charts.push((format!("{name}-{end}"), convergence(scene, metric, cost)));
            }
        }
        charts.push(("efficiency".into(), efficiency(scene)));
        charts.push(("spectrum".into(), spectrum(scene)));
        charts.push(("histogram".into(), histogram(scene)));
        charts.push(("calibration".into(), calibration(scene)));
        for (name, chart) in charts {
            let Some(chart) = chart else { continue };
            let name = format!("{stem}-{name}");
            plots.push(Plot { scene: index, name, title: chart.title.clone(), svg: svg(&chart)? });
        }
    }
    Ok(plots)
}

/// A file name that any system takes, different for each scene.
fn file_stem(name: &str, index: usize, taken: &mut BTreeSet<String>) -> String {
    let safe: String =
        name.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let words: Vec<&str> = safe.split('-').filter(|word| !word.is_empty()).collect();
    let mut stem: String = words.join("-").chars().take(60).collect();
    if stem.is_empty() || taken.contains(&stem) {
        stem = format!("{stem}{}scene-{}", if stem.is_empty() { "" } else { "-" }, index + 1);
    }
    taken.insert(stem.clone());
    stem
}

fn figure<'a>(rung: &'a Rung, target: &str, metric: Metric) -> Option<&'a Figure> {
    rung.figures.iter().find(|f| f.metric == metric && f.target == target)
}

fn heading(scene: &SceneStudy, what: &str) -> String {
    format!("{}: {what}", super::draw::shorten(&scene.name, 40))
}

/// Error of the first target against cost, log-log.
fn convergence(scene: &SceneStudy, metric: Metric, cost: Cost) -> Option<Chart> {
    let target = scene.targets.first()?;
    let mut floor: f64 = 0.0;
    let mut series = Vec::new();
    for (style, configuration) in scene.configurations.iter().enumerate() {
        let mut points = Vec::new();
        for rung in &configuration.rungs {
            let Some(figure) = figure(rung, target, metric) else { continue };
            let x = if cost == Cost::Cpu { rung.cpu.value } else { rung.samples_per_pixel };
            floor = floor.max(figure.floor);
            if x > 0.0 && figure.mean.value > 0.0 {
                let mean = figure.mean;
                points.push(Point {
                    x,
                    y: mean.value,
                    low: mean.low,
                    high: mean.high,
                    hollow: figure.limited,
                });
            }
        }
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        if !points.is_empty() {
            series.push(Series { name: configuration.name.clone(), style, points, markers: true });
        }
    }
    let all = || series.iter().flat_map(|s| &s.points);
    let xs = || all().map(|p| p.x);
    let x = match cost {
        Cost::Cpu => Axis::log("CPU time of rendering (s)", xs())?,
        Cost::Samples => Axis::log2("samples per pixel", xs())?,
    };
    let lowest = all().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let drawn_floor = Some(floor).filter(|f| *f > lowest / 100.0);
    // An interval may reach far down; it does not rule the axis.
    let bands = || all().flat_map(|p| [p.high.clamp(p.y, 4.0 * p.y), p.low.clamp(p.y / 4.0, p.y)]);
    let y = Axis::log(metric.label(), all().map(|p| p.y).chain(bands()).chain(drawn_floor))?;
    let mut guides = rate_guide(scene, metric, &x, &series);
    if let Some(floor) = drawn_floor {
        guides.push(level(&x, floor, "noise of the reference"));
    }
    let mut subtitle = format!("{target}, mean and 95 % interval; dashed: the rate of independent samples");
    if floor > 0.0 && drawn_floor.is_none() {
        subtitle = format!("{subtitle}; noise of the reference {}, below", number(floor));
    }
    let against = if cost == Cost::Cpu { "time" } else { "samples" };
    let title = heading(scene, &format!("{} against {against}", metric.label()));
    Some(Chart { title, subtitle, x, y, series, guides, bars: false })
}

/// A horizontal line over the whole axis.
fn level(x: &Axis, y: f64, label: &str) -> Guide {
    let at = |t: f64| [10f64.powf(x.low + t * (x.high - x.low)), y];
    let points = (0..=20).map(|i| at(f64::from(i) / 20.0)).collect();
    Guide { points, label: label.into(), at: 0, below: false, before: false }
}

/// Squares fall as 1/N, absolute errors as its root: through the first point of
/// the baseline.
fn rate_guide(scene: &SceneStudy, metric: Metric, x: &Axis, series: &[Series]) -> Vec<Guide> {
    let slope = match metric {
        Metric::Mse | Metric::RelMse | Metric::RelMseTrimmed => -1.0,
        _ => -0.5,
    };
    let baseline = series.iter().find(|s| s.name == scene.baseline).or(series.first());
    let Some(first) = baseline.and_then(|s| s.points.first()) else { return Vec::new() };
    let end = 10f64.powf(x.high);
    let at = |t: f64| {
        let ratio = (end / first.x).powf(t);
        [first.x * ratio, first.y * ratio.powf(slope)]
    };
    let label = if slope == -1.0 { "slope −1" } else { "slope −½" };
    let points = (0..=60).map(|i| at(f64::from(i) / 60.0)).collect();
    vec![Guide { points, label: label.into(), at: 100, below: true, before: true }]
}

/// Efficiency at the largest budget.
fn efficiency(scene: &SceneStudy) -> Option<Chart> {
    let mut series = Vec::new();
    for (style, configuration) in scene.configurations.iter().enumerate() {
        let Some(rung) = configuration.rungs.last() else { continue };
        let e = rung.efficiency;
        // What computes something else has an error, but no efficiency to compare.
        if configuration.biased_by_design.is_some() || !(e.value.is_finite() && e.value > 0.0) {
            continue;
        }
        let x = series.len() as f64;
        let points = vec![Point { x, y: e.value, low: e.low, high: e.high, hollow: false }];
        series.push(Series { name: configuration.name.clone(), style, points, markers: false });
    }
    if series.is_empty() {
        return None;
    }
    let ends = series.iter().flat_map(|s| &s.points).flat_map(|p| [p.y, p.high]);
    let top = ends.filter(|v| v.is_finite()).fold(0.0, f64::max);
    let x = Axis::linear("", -0.6, series.len() as f64 - 0.4);
    let y = Axis::linear("1 ÷ (relMSE · CPU seconds)", 0.0, 1.06 * top);
    let subtitle = "at the largest budget, with 95 % interval; higher is better".into();
    Some(Chart {
        title: heading(scene, "efficiency"),
        subtitle,
        x,
        y,
        series,
        guides: Vec::new(),
        bars: true,
    })
}

/// One curve per configuration, without intervals.
fn curves(scene: &SceneStudy, take: impl Fn(usize) -> Option<Vec<[f64; 2]>>, markers: bool) -> Vec<Series> {
    let mut series = Vec::new();
    for (style, configuration) in scene.configurations.iter().enumerate() {
        let finite = |p: &[f64; 2]| p[0].is_finite() && p[1].is_finite();
        let pairs: Vec<[f64; 2]> = take(style).unwrap_or_default().into_iter().filter(finite).collect();
        let point = |p: [f64; 2]| Point { x: p[0], y: p[1], low: f64::NAN, high: f64::NAN, hollow: false };
        if !pairs.is_empty() {
            let points = pairs.into_iter().map(point).collect();
            series.push(Series { name: configuration.name.clone(), style, points, markers });
        }
    }
    series
}

fn spectrum(scene: &SceneStudy) -> Option<Chart> {
    let of = |i: usize| scene.configurations[i].noise.as_ref().map(|n| n.spectrum.clone());
    let series = curves(scene, of, false);
    let powers = || series.iter().flat_map(|s| &s.points).map(|p| p.y);
    let x = Axis::linear("frequency (cycles per pixel)", 0.0, 0.5);
    let y = Axis::log("power ÷ that of white noise", powers().chain([0.5, 2.0]))?;
    (!series.is_empty()).then_some(())?;
    let points = (0..=20).map(|i| [f64::from(i) / 40.0, 1.0]).collect();
    let guide = Guide { points, label: String::new(), at: 0, below: false, before: false };
    let subtitle =
        "relative error at the largest budget; dashed: white noise; low on the left is blue".into();
    let title = heading(scene, "power spectrum of the error");
    Some(Chart { title, subtitle, x, y, series, guides: vec![guide], bars: false })
}

fn histogram(scene: &SceneStudy) -> Option<Chart> {
    let positive = |p: &[f64; 2]| p[0] > 0.0 && p[1] > 0.0;
    let of = |i: usize| {
        let noise = scene.configurations[i].noise.as_ref()?;
        Some(noise.histogram.iter().copied().filter(positive).collect())
    };
    let series = curves(scene, of, true);
    let all = || series.iter().flat_map(|s| &s.points);
    let x = Axis::log2("|error| ÷ its root mean square", all().map(|p| p.x))?;
    let y = Axis::log("part of the values", all().map(|p| p.y))?;
    let normal = |x: f64| [x, two_sided_p(x / 2.0) - two_sided_p(x)];
    let steps = 80;
    let at = |i: i32| 10f64.powf(x.low + (x.high - x.low) * f64::from(i) / f64::from(steps));
    let points = (0..=steps).map(|i| normal(at(i))).collect();
    let guide = Guide { points, label: "normal errors".into(), at: 98, below: true, before: true };
    let subtitle =
        "classes between powers of two, at the largest budget; a long right tail is fireflies".into();
    let title = heading(scene, "histogram of pixel errors");
    Some(Chart { title, subtitle, x, y, series, guides: vec![guide], bars: false })
}

fn calibration(scene: &SceneStudy) -> Option<Chart> {
    let of = |i: usize| {
        let rungs = &scene.configurations[i].calibration.as_ref()?.rungs;
        rungs.last().map(|c| c.curve.clone())
    };
    let series = curves(scene, of, false);
    if series.is_empty() {
        return None;
    }
    let ends = series.iter().flat_map(|s| &s.points).map(|p| p.x);
    let end = ends.fold(3.0, f64::max).min(6.0);
    let x = Axis::linear("k, in reported standard errors", 0.0, end);
    let y = Axis::linear("part of the values within k", 0.0, 1.03);
    let perfect = |i: i32| [end * f64::from(i) / 80.0, 1.0 - two_sided_p(end * f64::from(i) / 80.0)];
    let points = (0..=80).map(perfect).collect();
    let guide = Guide { points, label: "perfect".into(), at: 28, below: false, before: true };
    let subtitle =
        "true error against the reported one, at the largest budget; above the dashes is cautious".into();
    let title = heading(scene, "calibration of the error layer");
    Some(Chart { title, subtitle, x, y, series, guides: vec![guide], bars: false })
}
