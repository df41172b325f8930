//! A density over the unit square that follows a picture: constant in each of
//! many cells, or bilinear between their corners.
//!
//! A row of cells is chosen by its mass, a cell in it by its own, and the point
//! in the cell by inverting two densities that are linear. Distribution
//! functions, not alias tables: they keep the stratification of the samples,
//! and numbers of 24 bits have bits left for the place in the cell.

use crate::math::Vec2;

/// How a picture lies on texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Rows of the affine map from (u, v, 1) to texel coordinates: texel (x, y)
    /// covers \[x, x + 1\] × \[y, y + 1\].
    pub map: [[f64; 3]; 2],
    /// Bilinear between the middles of texels; constant in each if not.
    pub bilinear: bool,
}

/// A density over \[0, 1\]².
#[derive(Clone, Debug)]
pub struct SquareTable {
    /// Where cells begin and end, from 0 to 1.
    xs: Vec<f64>,
    ys: Vec<f64>,
    /// Row by row: values of the cells, or of their corners.
    values: Vec<f32>,
    bilinear: bool,
    /// Share of all mass below each row of cells; one more than rows.
    rows: Vec<f64>,
    /// For each row, share of its mass left of cells 1, 2, … in units of 2⁻³².
    cells: Vec<u32>,
    mean: f64,
    /// ∫ f² over (∫ f)².
    contrast: f64,
}

const FIXED_POINT: f64 = 4_294_967_296.0;

impl SquareTable {
    /// A table of cells between the coordinates `xs` and `ys`, which rise from 0
    /// to 1. `values` are those of the cells, or when `bilinear` of their
    /// corners, row by row. `None` when a value is negative or not finite, when
    /// all are zero, or when their number is wrong.
    #[must_use]
    pub fn new(xs: Vec<f64>, ys: Vec<f64>, values: Vec<f32>, bilinear: bool) -> Option<SquareTable> {
        let more = usize::from(bilinear);
        let (columns, row_count) = (xs.len().checked_sub(1)?, ys.len().checked_sub(1)?);
        let valid = values.iter().all(|v| *v >= 0.0 && v.is_finite());
        if !valid || columns == 0 || row_count == 0 || values.len() != (columns + more) * (row_count + more) {
            return None;
        }
        let mut table = SquareTable {
            xs,
            ys,
            values,
            bilinear,
            rows: vec![0.0],
            cells: Vec::with_capacity((columns - 1) * row_count),
            mean: 0.0,
            contrast: 1.0,
        };
        let (mut total, mut squares) = (0.0, 0.0);
        for j in 0..row_count {
            let height = table.ys[j + 1] - table.ys[j];
            let width = |i: usize| table.xs[i + 1] - table.xs[i];
            let row_mass: f64 = (0..columns).map(|i| table.cell(i, j).mean() * width(i)).sum();
            squares += height * (0..columns).map(|i| table.cell(i, j).mean_square() * width(i)).sum::<f64>();
            let mut left = 0.0;
            for i in 0..columns - 1 {
                left += table.cell(i, j).mean() * width(i);
                let share = if row_mass > 0.0 { left / row_mass } else { 0.0 };
                table.cells.push((share * FIXED_POINT).round() as u32);
            }
            total += row_mass * height;
            table.rows.push(total);
        }
        if !(total > 0.0) || !total.is_finite() {
            return None;
        }
        table.rows.iter_mut().for_each(|r| *r /= total);
        table.mean = total;
        table.contrast = squares / total / total;
        Some(table)
    }

    /// Mean of the values over the square.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Mean of the square of the values over the square of their mean, at least
    /// 1: how many times the variance of uniform sampling is that of knowing
    /// the place, plus one.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        self.contrast
    }

    /// A point of the square, by `u` in \[0, 1)².
    #[must_use]
    pub fn sample(&self, u: Vec2) -> [f64; 2] {
        let y = f64::from(u.y);
        let last = self.rows.len() - 2;
        let j = (self.rows.partition_point(|r| *r <= y).max(1) - 1).min(last);
        let v = ((y - self.rows[j]) / (self.rows[j + 1] - self.rows[j])).clamp(0.0, 1.0);

        let x = f64::from(u.x) * FIXED_POINT;
        let inner = self.xs.len() - 2;
        let bounds = &self.cells[j * inner..(j + 1) * inner];
        let i = bounds.partition_point(|c| f64::from(*c) <= x);
        let left = if i == 0 { 0.0 } else { f64::from(bounds[i - 1]) };
        let right = bounds.get(i).map_or(FIXED_POINT, |c| f64::from(*c));
        let w = (x - left) / (right - left);

        let cell = self.cell(i, j);
        let t = invert_linear(0.5 * (cell.l00 + cell.l10), 0.5 * (cell.l01 + cell.l11), v);
        let s = invert_linear(mix(cell.l00, cell.l01, t), mix(cell.l10, cell.l11, t), w);
        [mix(self.xs[i], self.xs[i + 1], s), mix(self.ys[j], self.ys[j + 1], t)]
    }

    /// The density of [`SquareTable::sample`] at a point of the square; its
    /// mean is 1.
    #[must_use]
    pub fn density(&self, [x, y]: [f64; 2]) -> f64 {
        let place = |edges: &[f64], x: f64| {
            let i = (edges.partition_point(|e| *e <= x).max(1) - 1).min(edges.len() - 2);
            (i, ((x - edges[i]) / (edges[i + 1] - edges[i])).clamp(0.0, 1.0))
        };
        let ((i, s), (j, t)) = (place(&self.xs, x), place(&self.ys, y));
        let cell = self.cell(i, j);
        mix(mix(cell.l00, cell.l10, s), mix(cell.l01, cell.l11, s), t) / self.mean
    }

    /// Heap memory in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        8 * (self.xs.len() + self.ys.len() + self.rows.len()) + 4 * (self.values.len() + self.cells.len())
    }

    fn cell(&self, i: usize, j: usize) -> Cell {
        let columns = self.xs.len() - 1;
        if !self.bilinear {
            let value = f64::from(self.values[j * columns + i]);
            return Cell { l00: value, l10: value, l01: value, l11: value };
        }
        let at = |i: usize, j: usize| f64::from(self.values[j * (columns + 1) + i]);
        Cell { l00: at(i, j), l10: at(i + 1, j), l01: at(i, j + 1), l11: at(i + 1, j + 1) }
    }
}

/// The values at the corners of a cell: lxy.
struct Cell {
    l00: f64,
    l10: f64,
    l01: f64,
    l11: f64,
}

impl Cell {
    fn mean(&self) -> f64 {
        0.25 * ((self.l00 + self.l10) + (self.l01 + self.l11))
    }

    /// Mean of the square of the bilinear function.
    fn mean_square(&self) -> f64 {
        let Cell { l00, l10, l01, l11 } = *self;
        let left = l00 * l00 + l00 * l01 + l01 * l01;
        let right = l10 * l10 + l10 * l11 + l11 * l11;
        let across = l00 * l10 + l01 * l11 + 0.5 * (l00 * l11 + l01 * l10);
        (left + across + right) / 9.0
    }
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a * (1.0 - t) + b * t
}

/// The s in \[0, 1\] with the share `u` of the mass of the density
/// a (1−s) + b s below it, in the form that does not cancel.
#[must_use]
pub fn invert_linear(a: f64, b: f64, u: f64) -> f64 {
    let root = (a * a * (1.0 - u) + b * b * u).sqrt();
    if a + root > 0.0 { (u * (a + b) / (a + root)).min(1.0) } else { u }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tables() -> Vec<SquareTable> {
        let spot = |i: usize| if i == 7 { 1e6 } else { 0.0 };
        let noise = |i: usize| (((i as u32).wrapping_mul(2_654_435_761) >> 20) & 0xff) as f32;
        let edges = |n: usize| -> Vec<f64> { (0..=n).map(|i| (i as f64 / n as f64).powf(1.3)).collect() };
        let table = |n: [usize; 2], bilinear: bool, value: &dyn Fn(usize) -> f32| {
            let more = usize::from(bilinear);
            let count = (n[0] + more) * (n[1] + more);
            SquareTable::new(edges(n[0]), edges(n[1]), (0..count).map(value).collect(), bilinear).unwrap()
        };
        vec![
            table([1, 1], false, &|_| 3.0),
            table([1, 1], true, &|i| i as f32),
            table([5, 3], true, &spot),
            table([5, 3], false, &spot),
            table([7, 1], true, &noise),
            table([1, 6], false, &noise),
            table([9, 8], true, &noise),
        ]
    }

    /// Counts of stratified samples in 12 × 12 boxes against the integral of the density.
    #[test]
    fn samples_follow_the_density() {
        const BOXES: usize = 12;
        for (k, table) in tables().into_iter().enumerate() {
            let side = 600;
            let (mut counts, mut expected) = ([0.0; BOXES * BOXES], [0.0; BOXES * BOXES]);
            let index = |[x, y]: [f64; 2]| {
                let cell = |x: f64| ((x * BOXES as f64) as usize).min(BOXES - 1);
                cell(y) * BOXES + cell(x)
            };
            let (mut mean, mut squares) = (0.0, 0.0);
            for i in 0..side * side {
                let place = [(i % side) as f64 + 0.5, (i / side) as f64 + 0.5].map(|x| x / side as f64);
                let share = 1.0 / (side * side) as f64;
                let density = table.density(place);
                expected[index(place)] += density * share;
                (mean, squares) = (mean + density * share, squares + density * density * share);
                let point = table.sample(Vec2::new(place[0] as f32, place[1] as f32));
                counts[index(point)] += share;
                assert!(table.density(point) > 0.0, "{k}: {point:?}");
            }
            assert!((mean - 1.0).abs() < 1e-2, "{k}: {mean}");
            assert!((squares / table.contrast() - 1.0).abs() < 2e-2, "{k}: {squares} {}", table.contrast());
            for (count, expected) in counts.iter().zip(&expected) {
                assert!((count - expected).abs() < 3e-3 + 0.02 * expected, "{k}: {count} {expected}");
            }
        }
    }

    #[test]
    fn what_is_no_density_is_refused() {
        let table =
            |values: &[f32]| SquareTable::new(vec![0.0, 0.5, 1.0], vec![0.0, 1.0], values.to_vec(), false);
        assert!(table(&[0.0, 1.0]).is_some());
        for bad in [&[0.0, 0.0][..], &[1.0, -1.0], &[f32::INFINITY, 1.0], &[f32::NAN, 1.0], &[1.0]] {
            assert!(table(bad).is_none(), "{bad:?}");
        }
    }

    #[test]
    fn linear_densities_are_inverted() {
        assert_eq!(invert_linear(0.0, 0.0, 0.3), 0.3);
        assert_eq!(invert_linear(0.0, 1.0, 0.25), 0.5);
        assert_eq!(invert_linear(1.0, 0.0, 0.75), 0.5);
    }
}
