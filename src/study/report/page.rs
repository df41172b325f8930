//! The page: the template filled with the study.

use minijinja::value::{Serde, Value};
use minijinja::{Environment, context};
use serde::Serialize;

use super::exhibits::Picture;
use super::format;
use super::plots::Plot;
use crate::desc::{Error, Result};
use crate::study::model::{Interval, Metric, Study};

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
/// One script element each, in this order.
const SCRIPTS: [&str; 7] = [
    include_str!("basics.js"),
    include_str!("chart.js"),
    include_str!("figures.js"),
    include_str!("pixels.js"),
    include_str!("viewer.js"),
    include_str!("gestures.js"),
    include_str!("main.js"),
];

/// A link to a plot beside the page.
#[derive(Serialize)]
struct Link<'a> {
    scene: usize,
    name: &'a str,
    title: &'a str,
}

/// A column of the tables.
#[derive(Serialize)]
struct Column {
    metric: Metric,
    label: &'static str,
}

pub(super) fn render(study: &Study, pictures: &[Picture], plots: &[Plot]) -> Result<String> {
    let wrong = |e: minijinja::Error| Error::new(format!("cannot write the report: {e}"));
    let json =
        serde_json::to_string(study).map_err(|e| Error::new(format!("cannot write the study: {e}")))?;
    // No name in it can end the element that holds it.
    let json = json.replace('<', "\\u003c");
    let mut environment = Environment::new();
    add_filters(&mut environment);
    environment.add_template("page.html", TEMPLATE).map_err(wrong)?;
    let links: Vec<Link> =
        plots.iter().map(|p| Link { scene: p.scene, name: &p.name, title: &p.title }).collect();
    let columns: Vec<Column> = Metric::ALL.map(|metric| Column { metric, label: metric.label() }).into();
    let labels = serde_json::to_string(&columns).map_err(|e| Error::new(e.to_string()))?;
    let page = context! {
        json, labels,
        study => Serde(study),
        pictures => Serde(pictures),
        links => Serde(&links),
        columns => Serde(&columns),
        style => STYLE,
        scripts => Serde(SCRIPTS),
        confidence => format!("{:.0} %", 100.0 * study.confidence),
    };
    environment.get_template("page.html").and_then(|t| t.render(page)).map_err(wrong)
}

fn add_filters(environment: &mut Environment) {
    environment.add_filter("number", |v: Value| format::number(float(&v)));
    environment.add_filter("percent", |v: Value| format::percent(float(&v), false));
    environment.add_filter("signed_percent", |v: Value| format::percent(float(&v), true));
    environment.add_filter("seconds", |v: Value| format::seconds(float(&v)));
    environment.add_filter("range", |v: Serde<Interval>| format::range(&v, format::number));
    environment.add_filter("seconds_range", |v: Serde<Interval>| format::range(&v, format::seconds));
    environment.add_filter("percent_range", |v: Serde<Interval>| {
        format::range(&v, |end| format::percent(end, false))
    });
    environment.add_filter("signed_percent_range", |v: Serde<Interval>| {
        format::range(&v, |end| format::percent(end, true))
    });
    environment.add_filter("wordy", |v: String| v.replace('-', " "));
}

/// What is not a number is NaN.
fn float(value: &Value) -> f64 {
    f64::try_from(value.clone()).unwrap_or(f64::NAN)
}
