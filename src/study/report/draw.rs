//! Draws a chart with plotters as SVG, and an SVG as PNG.
//!
//! Plotters knows where things lie; grid, ticks and the names at the ends of
//! the curves are ours, so that logarithmic axes read well and no legend has
//! to be looked up. The PNG is the SVG itself, painted by resvg with an
//! embedded font: both show the same on a machine without fonts.

use std::sync::Arc;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg;

use super::axis::Axis;
use crate::desc::{Error, Result};

/// Plotters places everything on whole pixels: it draws on a sheet this many
/// times as large as the SVG says it is, so that thin dashes stay straight.
const U: i32 = 8;
/// Size of an SVG as it is shown.
const SIZE: (i32, i32) = (1000, 610);
/// Pixels of the PNG per pixel of the SVG.
const PNG_SCALE: f32 = 2.0;
/// Where the axes lie: left, top, right, bottom.
const FRAME: (i32, i32, i32, i32) = (96 * U, 64 * U, 752 * U, 548 * U);
const INK: RGBColor = RGBColor(34, 40, 49);
const SOFT: RGBColor = RGBColor(98, 107, 120);
const GRID: RGBColor = RGBColor(226, 230, 235);
const GRID_MINOR: RGBColor = RGBColor(242, 244, 247);
/// After M. Okabe and K. Ito, told apart by all kinds of colour vision; black
/// and the pale yellow left out. The page uses the same order.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(184, 92, 148),
    RGBColor(196, 138, 0),
    RGBColor(60, 150, 205),
    RGBColor(110, 84, 60),
];

/// Everything that a plot shows.
pub(super) struct Chart {
    pub(super) title: String,
    pub(super) subtitle: String,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) series: Vec<Series>,
    pub(super) guides: Vec<Guide>,
    /// Bars from the bottom of the axis instead of curves.
    pub(super) bars: bool,
}

/// One configuration.
pub(super) struct Series {
    pub(super) name: String,
    /// Place in the palette and among the markers.
    pub(super) style: usize,
    pub(super) points: Vec<Point>,
    pub(super) markers: bool,
}

/// A value with its interval; not-finite ends are left out.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    /// Too near to the noise of the reference.
    pub(super) hollow: bool,
}

/// A dashed line to compare with.
pub(super) struct Guide {
    pub(super) points: Vec<[f64; 2]>,
    pub(super) label: String,
    /// Where along its visible part the label stands, in percent.
    pub(super) at: usize,
    /// Under the line instead of over it.
    pub(super) below: bool,
    /// Left of that place instead of right of it.
    pub(super) before: bool,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// The chart as SVG.
pub(super) fn svg(chart: &Chart) -> Result<String> {
    let mut text = String::new();
    paint(chart, &mut text)
        .map_err(|e| Error::new(format!("cannot draw the plot `{}`: {e}", chart.title)))?;
    let (drawn, shown) = (size_attributes(SIZE.0 * U, SIZE.1 * U), size_attributes(SIZE.0, SIZE.1));
    Ok(text.replacen(&drawn, &shown, 1))
}

/// As plotters writes them.
fn size_attributes(width: i32, height: i32) -> String {
    format!("width=\"{width}\" height=\"{height}\"")
}

type Painted = std::result::Result<(), Box<dyn std::error::Error>>;

fn paint(chart: &Chart, text: &mut String) -> Painted {
    let root = SVGBackend::with_string(text, ((SIZE.0 * U) as u32, (SIZE.1 * U) as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    root.draw_text(&chart.title, &style(20, INK, HPos::Left, VPos::Top), (FRAME.0, 14 * U))?;
    root.draw_text(&chart.subtitle, &style(14, SOFT, HPos::Left, VPos::Top), (FRAME.0, 40 * U))?;
    let plane = Cartesian2d::<RangedCoordf64, RangedCoordf64>::new(
        chart.x.low..chart.x.high,
        chart.y.low..chart.y.high,
        (FRAME.0..FRAME.2, FRAME.3..FRAME.1),
    );
    let area = root.apply_coord_spec(plane);
    axes(chart, &area)?;
    for guide in &chart.guides {
        draw_guide(chart, &area, guide)?;
    }
    for series in &chart.series {
        if chart.bars { draw_bars(chart, &area, series)? } else { draw_curve(chart, &area, series)? }
    }
    if !chart.bars {
        names(chart, &area)?;
    }
    area.present()?;
    Ok(())
}

fn style(size: i32, colour: RGBColor, h: HPos, v: VPos) -> TextStyle<'static> {
    ("sans-serif", size * U).into_font().color(&colour).pos(Pos::new(h, v))
}

fn colour(style: usize) -> RGBColor {
    PALETTE[style % PALETTE.len()]
}

/// Pixels of a place in axis coordinates.
fn pixel(area: &Area, at: (f64, f64)) -> (i32, i32) {
    area.map_coordinate(&at)
}

fn line(area: &Area, points: Vec<(i32, i32)>, stroke: ShapeStyle) -> Painted {
    let bare = area.strip_coord_spec();
    bare.draw(&PathElement::new(points, stroke))?;
    Ok(())
}

/// Grid, ticks, names of the axes.
fn axes(chart: &Chart, area: &Area) -> Painted {
    let bare = area.strip_coord_spec();
    for tick in chart.x.ticks().into_iter().filter(|_| !chart.bars) {
        let x = pixel(area, (tick.at, chart.y.low)).0;
        let grid = if tick.text.is_some() { GRID } else { GRID_MINOR };
        line(area, vec![(x, FRAME.1), (x, FRAME.3)], grid.stroke_width(U as u32))?;
        if let Some(text) = tick.text {
            bare.draw_text(&text, &style(14, INK, HPos::Center, VPos::Top), (x, FRAME.3 + 10 * U))?;
        }
    }
    for tick in chart.y.ticks() {
        let y = pixel(area, (chart.x.low, tick.at)).1;
        let grid = if tick.text.is_some() { GRID } else { GRID_MINOR };
        line(area, vec![(FRAME.0, y), (FRAME.2, y)], grid.stroke_width(U as u32))?;
        if let Some(text) = tick.text {
            bare.draw_text(&text, &style(14, INK, HPos::Right, VPos::Center), (FRAME.0 - 10 * U, y))?;
        }
    }
    line(
        area,
        vec![(FRAME.0, FRAME.1), (FRAME.0, FRAME.3), (FRAME.2, FRAME.3)],
        SOFT.stroke_width(U as u32),
    )?;
    let middle = ((FRAME.0 + FRAME.2) / 2, (FRAME.1 + FRAME.3) / 2);
    bare.draw_text(&chart.x.label, &style(15, INK, HPos::Center, VPos::Top), (middle.0, FRAME.3 + 34 * U))?;
    let turned = style(15, INK, HPos::Center, VPos::Top).transform(FontTransform::Rotate270);
    bare.draw_text(&chart.y.label, &turned, (16 * U, middle.1))?;
    Ok(())
}

/// The part of a guide within the axes, dashed, its label near its middle.
fn draw_guide(chart: &Chart, area: &Area, guide: &Guide) -> Painted {
    let inside = guide.points.iter().filter(|p| chart.x.holds(p[0]) && chart.y.holds(p[1]));
    let points: Vec<(i32, i32)> =
        inside.filter_map(|p| Some(pixel(area, (chart.x.place(p[0])?, chart.y.place(p[1])?)))).collect();
    // Dashes of our own: along the line, 6 pixels drawn and 5 left out.
    let (dash, period) = (f64::from(6 * U), f64::from(11 * U));
    let mut drawn = 0.0;
    for pair in points.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let (dx, dy) = (f64::from(to.0 - from.0), f64::from(to.1 - from.1));
        let length = dx.hypot(dy);
        let mut at = 0.0;
        while at < length {
            let phase = (drawn + at) % period;
            let rest = if phase < dash { dash - phase } else { period - phase };
            let end = (at + rest.max(0.5)).min(length);
            if phase < dash {
                let place = |t: f64| {
                    (from.0 + (dx * t / length).round() as i32, from.1 + (dy * t / length).round() as i32)
                };
                line(area, vec![place(at), place(end)], SOFT.stroke_width(U as u32))?;
            }
            at = end;
        }
        drawn += length;
    }
    if let Some(at) = points.get(points.len().saturating_sub(1) * guide.at / 100) {
        // Near an end of the plot the label stands on the inner side of the line's point.
        let near_end = at.0 > FRAME.2 - 140 * U;
        let before = near_end || guide.before;
        let (h, x) = if before { (HPos::Right, at.0 - 8 * U) } else { (HPos::Left, at.0 + 8 * U) };
        let (v, y) = if guide.below { (VPos::Top, at.1 + 6 * U) } else { (VPos::Bottom, at.1 - 6 * U) };
        area.strip_coord_spec().draw_text(&guide.label, &style(13, SOFT, h, v), (x, y))?;
    }
    Ok(())
}

/// Band, curve and markers.
fn draw_curve(chart: &Chart, area: &Area, series: &Series) -> Painted {
    let bare = area.strip_coord_spec();
    let at = |x: f64, y: f64| Some(pixel(area, (chart.x.place(x)?, chart.y.place(y)?)));
    let colour = colour(series.style);
    let banded = series.points.iter().filter(|p| p.low.is_finite() && p.high.is_finite() && p.y.is_finite());
    // What is not positive has no place on a logarithmic axis: the band goes to its bottom.
    let bottom = |v: f64| if v > 0.0 { v } else { f64::MIN_POSITIVE };
    let (mut band, mut back) = (Vec::new(), Vec::new());
    for p in banded {
        band.extend(at(p.x, bottom(p.high)));
        back.extend(at(p.x, bottom(p.low)));
    }
    if band.len() > 1 {
        band.extend(back.into_iter().rev());
        bare.draw(&Polygon::new(band, colour.mix(0.16).filled()))?;
    }
    let places: Vec<((i32, i32), bool)> = series
        .points
        .iter()
        .filter(|p| chart.y.holds(p.y) && chart.x.holds(p.x))
        .filter_map(|p| Some((at(p.x, p.y)?, p.hollow)))
        .collect();
    line(area, places.iter().map(|p| p.0).collect(), colour.stroke_width(2 * U as u32))?;
    for (place, hollow) in places.iter().filter(|_| series.markers) {
        marker(area, *place, series.style, *hollow)?;
    }
    Ok(())
}

/// A shape of its own for every style, with a white rim so that it stands off
/// the curves.
fn marker(area: &Area, at: (i32, i32), style: usize, hollow: bool) -> Painted {
    let shape: &[(i32, i32)] = match style % 6 {
        0 => &[(-3, -6), (3, -6), (6, -3), (6, 3), (3, 6), (-3, 6), (-6, 3), (-6, -3)],
        1 => &[(-5, -5), (5, -5), (5, 5), (-5, 5)],
        2 => &[(0, -7), (7, 5), (-7, 5)],
        3 => &[(0, -7), (7, 0), (0, 7), (-7, 0)],
        4 => &[(0, 7), (7, -5), (-7, -5)],
        _ => &[
            (-2, -6),
            (2, -6),
            (2, -2),
            (6, -2),
            (6, 2),
            (2, 2),
            (2, 6),
            (-2, 6),
            (-2, 2),
            (-6, 2),
            (-6, -2),
            (-2, -2),
        ],
    };
    let mut points: Vec<(i32, i32)> = shape.iter().map(|(x, y)| (at.0 + x * U, at.1 + y * U)).collect();
    let bare = area.strip_coord_spec();
    let fill = if hollow { WHITE } else { colour(style) };
    bare.draw(&Polygon::new(points.clone(), fill.filled()))?;
    points.push(points[0]);
    let rim = if hollow { colour(style).stroke_width(2 * U as u32) } else { WHITE.stroke_width(U as u32) };
    line(area, points, rim)
}

/// The series' names at the ends of their curves, pushed apart.
fn names(chart: &Chart, area: &Area) -> Painted {
    let mut ends: Vec<(i32, (i32, i32), &Series)> = Vec::new();
    for series in &chart.series {
        let last = series.points.iter().rfind(|p| chart.x.holds(p.x) && chart.y.holds(p.y));
        let place = last.and_then(|p| Some(pixel(area, (chart.x.place(p.x)?, chart.y.place(p.y)?))));
        ends.extend(place.map(|place| (place.1, place, series)));
    }
    ends.sort_by_key(|end| end.0);
    let gap = (FRAME.3 - FRAME.1) / i32::try_from(ends.len()).unwrap_or(i32::MAX).max(1);
    let gap = gap.min(22 * U);
    let mut free = FRAME.1;
    for end in &mut ends {
        end.0 = end.0.max(free);
        free = end.0 + gap;
    }
    let mut limit = FRAME.3;
    for end in ends.iter_mut().rev() {
        end.0 = end.0.min(limit);
        limit = end.0 - gap;
    }
    for (y, place, series) in ends {
        let x = FRAME.2 + 30 * U;
        line(
            area,
            vec![place, (FRAME.2 + 8 * U, y), (x - 10 * U, y)],
            colour(series.style).mix(0.45).stroke_width(U as u32),
        )?;
        marker(area, (x, y), series.style, false)?;
        let text = style(14, colour(series.style), HPos::Left, VPos::Center);
        area.strip_coord_spec().draw_text(&shorten(&series.name, 26), &text, (x + 14 * U, y))?;
    }
    Ok(())
}

/// At most `length` characters.
pub(super) fn shorten(name: &str, length: usize) -> String {
    if name.chars().count() <= length {
        return name.into();
    }
    name.chars().take(length - 1).chain(['…']).collect()
}

/// A bar with its interval and its name below.
fn draw_bars(chart: &Chart, area: &Area, series: &Series) -> Painted {
    let bare = area.strip_coord_spec();
    let width =
        (f64::from(FRAME.2 - FRAME.0) / (chart.x.high - chart.x.low) * 0.32).min(f64::from(46 * U)) as i32;
    for p in series.points.iter().filter(|p| p.y.is_finite()) {
        let at = |y: f64| Some(pixel(area, (chart.x.place(p.x)?, chart.y.place(y)?)));
        let (Some(top), Some(base)) = (at(p.y), at(f64::MIN_POSITIVE)) else { continue };
        let corners = [(base.0 - width, base.1), (base.0 + width, top.1)];
        bare.draw(&Rectangle::new(corners, colour(series.style).mix(0.85).filled()))?;
        if let (Some(low), Some(high)) = (at(p.low), at(p.high)) {
            line(area, vec![low, high], INK.stroke_width(2 * U as u32))?;
            for end in [low, high] {
                line(
                    area,
                    vec![(end.0 - 7 * U, end.1), (end.0 + 7 * U, end.1)],
                    INK.stroke_width(2 * U as u32),
                )?;
            }
        }
    }
    if let Some(p) = series.points.first() {
        let x = pixel(area, (p.x, chart.y.low)).0;
        let y = FRAME.3 + (10 + if chart.series.len() > 3 && p.x as i64 % 2 == 1 { 18 } else { 0 }) * U;
        let text = style(13, colour(series.style), HPos::Center, VPos::Top);
        bare.draw_text(&shorten(&series.name, 24), &text, (x, y))?;
    }
    Ok(())
}

/// Paints SVGs with an embedded font.
pub(super) struct Painter {
    options: usvg::Options<'static>,
}

impl Painter {
    pub(super) fn new() -> Painter {
        let mut fonts = usvg::fontdb::Database::new();
        fonts.load_font_data(ttf_noto_sans::REGULAR.to_vec());
        fonts.set_sans_serif_family("Noto Sans");
        let (font_family, fontdb) = ("Noto Sans".into(), Arc::new(fonts));
        let options = usvg::Options { font_family, fontdb, ..usvg::Options::default() };
        Painter { options }
    }

    /// A PNG of twice the SVG's size.
    pub(super) fn png(&self, svg: &str) -> Result<Vec<u8>> {
        let wrong = |what: String| Error::new(format!("cannot paint a plot: {what}"));
        let tree = usvg::Tree::from_str(svg, &self.options).map_err(|e| wrong(e.to_string()))?;
        let size = tree.size().to_int_size();
        let scaled = |n: u32| (n as f32 * PNG_SCALE) as u32;
        let mut pixels = Pixmap::new(scaled(size.width()), scaled(size.height()))
            .ok_or_else(|| wrong("it has no size".into()))?;
        resvg::render(&tree, Transform::from_scale(PNG_SCALE, PNG_SCALE), &mut pixels.as_mut());
        pixels.encode_png().map_err(|e| wrong(e.to_string()))
    }
}
