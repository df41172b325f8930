//! A study as CSV and as the lines that the command prints.

use std::fmt::Write;

use super::model::{BiasVerdict, Figure, Interval, Metric, Reference, SceneStudy, Study};

/// One line for each scene, configuration, rung, target and metric. Intervals
/// are those of the study; empty cells are values that are not known.
#[must_use]
pub fn to_csv(study: &Study) -> String {
    let mut out = String::from(
        "scene,configuration,budget,samples_per_pixel,runs,cpu_seconds,wall_seconds,target,metric,value,low,high,floor,within_reference_noise\n",
    );
    for scene in &study.scenes {
        for configuration in &scene.configurations {
            for rung in &configuration.rungs {
                for figure in &rung.figures {
                    let start = [
                        quoted(&scene.name),
                        quoted(&configuration.name),
                        quoted(&rung.budget),
                        number(rung.samples_per_pixel),
                        rung.cpu_seconds.len().to_string(),
                        number(rung.cpu.value),
                        number(rung.wall.value),
                        quoted(&figure.target),
                        metric_name(figure.metric),
                    ];
                    let Interval { value, low, high } = figure.mean;
                    let end = [number(value), number(low), number(high), number(figure.floor)];
                    let _ = writeln!(out, "{},{},{}", start.join(","), end.join(","), figure.limited);
                }
            }
        }
    }
    out
}

/// As JSON writes it.
fn metric_name(metric: Metric) -> String {
    serde_json::to_value(metric).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}

fn number(v: f64) -> String {
    if v.is_finite() { format!("{v}") } else { String::new() }
}

/// A cell that may hold commas.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// What the command prints: per scene a table of the largest rung, and what
/// is concluded.
#[must_use]
pub fn summary(study: &Study) -> String {
    let mut out = String::new();
    for scene in &study.scenes {
        let [width, height] = scene.size;
        let against = match &scene.reference {
            Reference::Picture { file, .. } => format!("against {file}"),
            Reference::Replicates => "spread over independent runs, which sees no bias".to_owned(),
        };
        let _ = writeln!(out, "{}, {width} × {height}, {against}", scene.name);
        scene_lines(&mut out, scene);
        out.push('\n');
    }
    for note in &study.notes {
        let _ = writeln!(out, "note: {note}");
    }
    out
}

fn scene_lines(out: &mut String, scene: &SceneStudy) {
    let width = scene.configurations.iter().map(|c| c.name.chars().count()).max().unwrap_or(0);
    for configuration in &scene.configurations {
        let name = format!("{:width$}", configuration.name);
        let Some(rung) = configuration.rungs.last() else {
            let _ = writeln!(out, "  {name}  no finished runs");
            continue;
        };
        let figure = rung.figures.iter().find(|f| f.metric == Metric::RelMse && f.target == "colour");
        let error = figure.map_or_else(|| "relMSE unknown".to_owned(), error_text);
        let _ = write!(out, "  {name}  {}: {error} in {:.3} CPU s", rung.budget, rung.cpu.value);
        if let Some(fit) = configuration.fits.iter().find(|f| f.metric == Metric::RelMse) {
            let _ = write!(out, ", slope {}", with_interval(&fit.slope));
        }
        if let Some(comparison) = scene.comparisons.iter().find(|c| c.configuration == configuration.name) {
            let _ = write!(out, "; {}", comparison.text);
        }
        out.push('\n');
        if let Some(bias) = configuration.bias.as_ref().filter(|b| b.verdict != BiasVerdict::Converges) {
            let _ = writeln!(out, "  {:width$}    {}", "", bias.text);
        }
    }
}

fn error_text(figure: &Figure) -> String {
    if figure.limited {
        return format!("relMSE within the reference's noise ({:.1e})", figure.floor);
    }
    let Interval { value, low, high } = figure.mean;
    format!("relMSE {value:.3e} [{low:.2e}, {high:.2e}]")
}

fn with_interval(interval: &Interval) -> String {
    format!("{:.2} [{:.2}, {:.2}]", interval.value, interval.low, interval.high)
}
