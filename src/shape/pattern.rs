//! Where on a shape a pattern is strong: what a textured light is sampled by.
//!
//! Every shape here is an area-preserving image of the unit square: the
//! rectangle and the cylinder by an affine map, the disk by Shirley and Chiu's,
//! a triangle by Heitz's. A density over the square is then one over its area,
//! up to the factor 1/A, and the square is cut so that the density follows the
//! pattern:
//!
//! * Texels whose edges run along the sides of the square (rectangles,
//!   cylinders) are met exactly: the density is bilinear or constant where the
//!   picture is, and radiance over density does not vary. Of pictures of more
//!   than 2048 texels in a row several make one cell, by their exact integral.
//! * All else is cut into regular cells about as large as a texel, up to 256 a
//!   side, each with the mean of 16 points. One part in sixteen is the mean of
//!   the pattern: what the points miss is found.
//!
//! A triangle over which the picture hardly changes has no density of its own:
//! the triangle is chosen by its mean, and the point in it uniformly.

use crate::math::Vec2;
use crate::sampling::{Raster, SquareTable};

/// A number that varies over a shape.
pub struct Pattern<'a> {
    /// Its value at texture coordinates, not negative.
    pub value: &'a dyn Fn(Vec2) -> f64,
    /// Its mean, above 0.
    pub mean: f64,
    /// The texels it is made of, if it is a picture.
    pub raster: Option<Raster>,
}

/// How the unit square lies on texture coordinates.
pub(crate) struct Layout<'a> {
    pub uv: &'a dyn Fn([f64; 2]) -> Vec2,
    /// The same as rows of an affine map, if it is one.
    pub affine: Option<[[f64; 3]; 2]>,
}

/// What is known of a pattern on one primitive.
#[derive(Clone, Debug)]
pub(crate) struct OnPrim {
    /// Its mean.
    pub mean: f64,
    /// Where it is strong; `None` where it hardly varies.
    pub table: Option<SquareTable>,
}

/// From this contrast on ([`SquareTable::contrast`]) a pattern is worth a table:
/// far away nothing else varies to speak of.
const MIN_CONTRAST: f64 = 1.005;
/// From this one on it counts nearby, where the distance varies as well.
pub(crate) const NEAR_CONTRAST: f64 = 1.25;
/// Cells in a row of a table of texels; beyond, several texels share one.
const MAX_COLUMNS: usize = 2048;
/// Texels in a row that are looked at one by one.
const MAX_TEXELS: f64 = 65_536.0;
/// Points on a side of a cell of a regular grid.
const POINTS: usize = 4;
/// Points on a side of a whole regular grid, and of all grids of a shape.
const MAX_SIDE: usize = 1024;
const ALL_POINTS: f64 = 16_777_216.0;
/// The same where there are no texels.
const PLAIN_SIDE: usize = 256;
/// Part of the mean in what a regular grid knows.
const FLOOR: f64 = 1.0 / 16.0;

impl OnPrim {
    /// Of one of so many primitives.
    pub fn new(pattern: &Pattern, layout: &Layout, prims: usize) -> OnPrim {
        let table = exact(pattern, layout).or_else(|| {
            let most = ((ALL_POINTS / prims as f64).sqrt() as usize).clamp(POINTS, MAX_SIDE);
            regular(pattern, layout, most)
        });
        let mean = table.as_ref().map_or(pattern.mean, SquareTable::mean);
        OnPrim { mean, table: table.filter(|t| t.contrast() >= MIN_CONTRAST) }
    }
}

/// The map from the square to texels.
fn to_texels(raster: &Raster, affine: &[[f64; 3]; 2]) -> [[f64; 3]; 2] {
    let [u, v] = affine;
    raster.map.map(|[a, b, c]| [a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2] + c])
}

/// A table that is the picture itself; `None` where texels do not lie along the
/// square.
fn exact(pattern: &Pattern, layout: &Layout) -> Option<SquareTable> {
    // Of a texel: less than what rounding of (u, v) moves a lookup.
    const STRAIGHT: f64 = 1e-5;
    let raster = pattern.raster?;
    let [x, y] = to_texels(&raster, &layout.affine?);
    let along = |row: [f64; 3], axis: usize| row[1 - axis].abs() <= STRAIGHT;
    let axes = if along(x, 0) && along(y, 1) {
        [[x[0], x[2]], [y[1], y[2]]]
    } else if along(x, 1) && along(y, 0) {
        [[y[0], y[2]], [x[1], x[2]]]
    } else {
        return None;
    };
    let shift = if raster.bilinear { 0.5 } else { 0.0 };
    let [xs, ys] = axes.map(|[slope, start]| breaks(slope, start - shift));
    let (xs, ys) = (xs?, ys?);
    let value = |x: f64, y: f64| (pattern.value)((layout.uv)([x, y]));
    let [step_x, step_y] = [&xs, &ys].map(|edges| (edges.len() - 1).div_ceil(MAX_COLUMNS));
    if step_x == 1 && step_y == 1 {
        let middles = |edges: &[f64]| -> Vec<f64> {
            if raster.bilinear {
                edges.to_vec()
            } else {
                edges.windows(2).map(|e| 0.5 * (e[0] + e[1])).collect()
            }
        };
        let (across, down) = (middles(&xs), middles(&ys));
        let values = down.iter().flat_map(|y| across.iter().map(move |x| (*x, *y)));
        let values = values.map(|(x, y)| value(x, y) as f32).collect();
        return SquareTable::new(xs, ys, values, raster.bilinear);
    }
    merged(&xs, &ys, [step_x, step_y], &value, raster.bilinear)
}

/// Every few cells in one, by their exact integral.
fn merged(
    xs: &[f64],
    ys: &[f64],
    [step_x, step_y]: [usize; 2],
    value: &dyn Fn(f64, f64) -> f64,
    bilinear: bool,
) -> Option<SquareTable> {
    let coarse = |edges: &[f64], step: usize| -> Vec<f64> {
        let last = edges.len() - 1;
        (0..last).step_by(step).chain([last]).map(|i| edges[i]).collect()
    };
    let (wide, high) = (coarse(xs, step_x), coarse(ys, step_y));
    let mut sums = vec![0.0; (wide.len() - 1) * (high.len() - 1)];
    for (j, y) in ys.windows(2).enumerate() {
        for (i, x) in xs.windows(2).enumerate() {
            let mean = if bilinear {
                0.25 * (value(x[0], y[0]) + value(x[1], y[0]) + value(x[0], y[1]) + value(x[1], y[1]))
            } else {
                value(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))
            };
            sums[j / step_y * (wide.len() - 1) + i / step_x] += mean * (x[1] - x[0]) * (y[1] - y[0]);
        }
    }
    let area = |k: usize| {
        let (i, j) = (k % (wide.len() - 1), k / (wide.len() - 1));
        (wide[i + 1] - wide[i]) * (high[j + 1] - high[j])
    };
    let values = sums.iter().enumerate().map(|(k, sum)| (sum / area(k)) as f32).collect();
    SquareTable::new(wide, high, values, false)
}

/// Where `start + slope · s` is whole, with 0 and 1; `None` when that is too often.
fn breaks(slope: f64, start: f64) -> Option<Vec<f64>> {
    let end = start + slope;
    if !(slope.abs() < MAX_TEXELS) || !start.is_finite() {
        return None;
    }
    let (low, high) = (start.min(end), start.max(end));
    let mut out = vec![0.0];
    let mut whole = low.floor() + 1.0;
    while whole < high {
        out.push((whole - start) / slope);
        whole += 1.0;
    }
    out.push(1.0);
    out.retain(|s| (0.0..=1.0).contains(s));
    out.sort_by(f64::total_cmp);
    out.dedup();
    Some(out)
}

/// A regular grid of at most so many points on a side.
fn regular(pattern: &Pattern, layout: &Layout, most: usize) -> Option<SquareTable> {
    let side = match pattern.raster {
        None => PLAIN_SIDE.min(most),
        Some(raster) => {
            // The square's corners and middle span what it covers.
            let places = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]];
            let texel = places.map(|place| {
                let uv = (layout.uv)(place).as_dvec2();
                raster.map.map(|row| row[0] * uv.x + row[1] * uv.y + row[2])
            });
            let span = [0, 1].map(|axis| {
                let values = texel.map(|t| t[axis]);
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                    - values.iter().copied().fold(f64::INFINITY, f64::min)
            });
            let texels = span[0].max(span[1]).ceil().clamp(1.0, most as f64) as usize;
            (texels * POINTS).min(most)
        }
    };
    let cells = (side / POINTS).max(1);
    let edges: Vec<f64> = (0..=cells).map(|i| i as f64 / cells as f64).collect();
    let points = cells * POINTS;
    let mean_of = |i: usize, j: usize| {
        let mut sum = 0.0;
        for k in 0..POINTS * POINTS {
            let place = [i * POINTS + k % POINTS, j * POINTS + k / POINTS];
            sum += (pattern.value)((layout.uv)(place.map(|p| (p as f64 + 0.5) / points as f64)));
        }
        let mean = sum / (POINTS * POINTS) as f64;
        (mean * (1.0 - FLOOR) + pattern.mean * FLOOR) as f32
    };
    let values = (0..cells * cells).map(|k| mean_of(k % cells, k / cells)).collect();
    SquareTable::new(edges.clone(), edges, values, false)
}
