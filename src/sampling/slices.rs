//! Densities over the unit square that change with two parameters: bilinear
//! between the nodes of a grid, and linear between the slices of a table, one
//! for each pair of parameters.
//!
//! Between slices the density is the mixture of those around, so that its
//! distribution functions are the mixtures of theirs: they are inverted as one,
//! and the map from uniform numbers to points stays continuous in the
//! parameters. First y by the masses of rows, then x within what is linear
//! between two rows (Dupuy and Jakob 2018, section 4).

use super::invert_linear;

/// A place between slices: up to four of them, with weights that add up to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    slices: [u32; 4],
    weights: [f32; 4],
    count: usize,
}

impl Blend {
    /// Where the parameters `at` lie among knots that rise; slice
    /// `i · inner.len() + j` is that of `outer[i]` and `inner[j]`. Beyond the
    /// ends they are taken to be at the end.
    #[must_use]
    pub fn new(outer: &[f32], inner: &[f32], at: [f32; 2]) -> Blend {
        let mut blend = Blend { slices: [0; 4], weights: [0.0; 4], count: 0 };
        let ((i, s), (j, t)) = (between(outer, at[0]), between(inner, at[1]));
        for (di, wi) in [(0, 1.0 - s), (1, s)] {
            for (dj, wj) in [(0, 1.0 - t), (1, t)] {
                if wi * wj > 0.0 {
                    blend.slices[blend.count] = ((i + di) * inner.len() + j + dj) as u32;
                    blend.weights[blend.count] = wi * wj;
                    blend.count += 1;
                }
            }
        }
        blend
    }

    /// The slices and their weights, all positive.
    pub fn parts(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        let slices = self.slices[..self.count].iter().map(|s| *s as usize);
        slices.zip(self.weights[..self.count].iter().copied())
    }
}

/// The last knot at or before `x`, and how far it is to the next.
fn between(knots: &[f32], x: f32) -> (usize, f32) {
    let i = knots.partition_point(|k| *k <= x).clamp(1, knots.len().max(2) - 1) - 1;
    match knots.get(i + 1) {
        Some(next) => (i, ((x - knots[i]) / (next - knots[i])).clamp(0.0, 1.0)),
        None => (0, 0.0),
    }
}

/// The cell of a grid of nodes that a point of the square lies in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Index of the node of lowest x and y.
    pub corner: usize,
    /// Place within the cell, \[0, 1\]².
    pub at: [f32; 2],
    /// Index of the next node along y.
    stride: usize,
}

impl Cell {
    /// The cell of `point` in \[0, 1\]², of a grid of `columns` × `rows` nodes,
    /// 2 or more each way.
    #[must_use]
    pub fn new(columns: usize, rows: usize, point: [f32; 2]) -> Cell {
        let along = |nodes: usize, x: f32| {
            let x = x.clamp(0.0, 1.0) * (nodes - 1) as f32;
            let i = (x as usize).min(nodes - 2);
            (i, x - i as f32)
        };
        let ((i, s), (j, t)) = (along(columns, point[0]), along(rows, point[1]));
        Cell { corner: j * columns + i, at: [s, t], stride: columns }
    }

    /// The four nodes and their weights, which add up to 1.
    #[must_use]
    pub fn nodes(&self) -> [(usize, f32); 4] {
        let [s, t] = self.at;
        let above = self.corner + self.stride;
        [
            (self.corner, (1.0 - s) * (1.0 - t)),
            (self.corner + 1, s * (1.0 - t)),
            (above, (1.0 - s) * t),
            (above + 1, s * t),
        ]
    }
}

/// A density over \[0, 1\]² for each slice. One that is zero everywhere counts
/// as uniform.
#[derive(Clone, Debug)]
pub struct SlicedSquare {
    columns: usize,
    rows: usize,
    /// Slice by slice, row by row: the density at each node, of mean 1.
    density: Vec<f32>,
    /// The integral of the density along the row, from x = 0 to each node.
    left: Vec<f32>,
    /// For each slice the mass below each row, 0 to 1.
    below: Vec<f32>,
}

impl SlicedSquare {
    /// The densities in proportion to `values`: slice by slice, row by row, of
    /// `columns` × `rows` nodes each. `None` when a value is negative or not
    /// finite, when there are fewer than 2 × 2 nodes, or when the values do not
    /// make whole slices, one or more.
    #[must_use]
    pub fn new(columns: usize, rows: usize, values: &[f32]) -> Option<SlicedSquare> {
        let size = columns.checked_mul(rows)?;
        let valid = values.iter().all(|v| *v >= 0.0 && v.is_finite());
        if columns < 2 || rows < 2 || !valid || values.is_empty() || !values.len().is_multiple_of(size) {
            return None;
        }
        let mut table = SlicedSquare {
            columns,
            rows,
            density: Vec::with_capacity(values.len()),
            left: Vec::with_capacity(values.len()),
            below: Vec::with_capacity(values.len() / columns),
        };
        let uniform = vec![1.0; size];
        values.chunks_exact(size).for_each(|slice| {
            let flat = slice.iter().all(|v| *v == 0.0);
            table.push(if flat { &uniform } else { slice });
        });
        Some(table)
    }

    fn push(&mut self, slice: &[f32]) {
        let mut along = Vec::with_capacity(slice.len());
        let (width, height) = (1.0 / (self.columns - 1) as f64, 1.0 / (self.rows - 1) as f64);
        for row in slice.chunks_exact(self.columns) {
            let mut sum = 0.0;
            along.push(0.0);
            for pair in row.windows(2) {
                sum += 0.5 * width * (f64::from(pair[0]) + f64::from(pair[1]));
                along.push(sum);
            }
        }
        let masses: Vec<f64> = along.chunks_exact(self.columns).map(|row| row[self.columns - 1]).collect();
        let total: f64 = masses.windows(2).map(|pair| 0.5 * height * (pair[0] + pair[1])).sum();
        self.density.extend(slice.iter().map(|v| (f64::from(*v) / total) as f32));
        self.left.extend(along.iter().map(|v| (v / total) as f32));
        let mut sum = 0.0;
        self.below.push(0.0);
        for pair in masses.windows(2) {
            sum += 0.5 * height * (pair[0] + pair[1]);
            self.below.push((sum / total) as f32);
        }
    }

    /// How many slices there are.
    #[must_use]
    pub fn slices(&self) -> usize {
        self.below.len() / self.rows
    }

    /// Heap memory in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        4 * (self.density.len() + self.left.len() + self.below.len())
    }

    /// A point of the square with the density that [`SlicedSquare::density`]
    /// tells, by `u` in \[0, 1)².
    #[must_use]
    pub fn sample(&self, blend: &Blend, u: [f32; 2]) -> [f32; 2] {
        let j = last_at_most(self.rows, u[1], |j| self.below(blend, j));
        let (low, high) = (self.below(blend, j), self.below(blend, j + 1));
        let end = self.columns - 1;
        let (r0, r1) = (self.left(blend, j, end), self.left(blend, j + 1, end));
        let t = invert_linear(r0.into(), r1.into(), share(low, high, u[1])) as f32;

        let goal = u[0] * mix(r0, r1, t);
        let left = |i: usize| mix(self.left(blend, j, i), self.left(blend, j + 1, i), t);
        let i = last_at_most(self.columns, goal, left);
        let node = |i: usize| mix(self.node(blend, j, i), self.node(blend, j + 1, i), t);
        let s = invert_linear(node(i).into(), node(i + 1).into(), share(left(i), left(i + 1), goal)) as f32;
        [(i as f32 + s) / end as f32, (j as f32 + t) / (self.rows - 1) as f32]
    }

    /// The inverse of [`SlicedSquare::sample`]: the `u` that leads to `point`,
    /// in \[0, 1\]², and the density there. Where there is no density, some `u`
    /// on the way across.
    #[must_use]
    pub fn invert(&self, blend: &Blend, point: [f32; 2]) -> ([f32; 2], f32) {
        let Cell { corner, at: [s, t], .. } = Cell::new(self.columns, self.rows, point);
        let (j, i) = (corner / self.columns, corner % self.columns);
        let end = self.columns - 1;
        let (r0, r1) = (self.left(blend, j, end), self.left(blend, j + 1, end));
        let y = mix(self.below(blend, j), self.below(blend, j + 1), share_below(r0, r1, t));

        let node = |i: usize| mix(self.node(blend, j, i), self.node(blend, j + 1, i), t);
        let left = |i: usize| mix(self.left(blend, j, i), self.left(blend, j + 1, i), t);
        let (a, b) = (node(i), node(i + 1));
        let mass = mix(r0, r1, t);
        let x = if mass > 0.0 { mix(left(i), left(i + 1), share_below(a, b, s)) / mass } else { point[0] };
        ([x.clamp(0.0, 1.0), y.clamp(0.0, 1.0)], mix(a, b, s))
    }

    /// The density at a point of the square; its mean over the square is 1.
    #[must_use]
    pub fn density(&self, blend: &Blend, point: [f32; 2]) -> f32 {
        let nodes = Cell::new(self.columns, self.rows, point).nodes();
        let size = self.columns * self.rows;
        let of =
            |slice: usize| -> f32 { nodes.iter().map(|(n, w)| w * self.density[slice * size + n]).sum() };
        blend.parts().map(|(slice, weight)| weight * of(slice)).sum()
    }

    fn below(&self, blend: &Blend, j: usize) -> f32 {
        blend.parts().map(|(slice, weight)| weight * self.below[slice * self.rows + j]).sum()
    }

    fn left(&self, blend: &Blend, j: usize, i: usize) -> f32 {
        let at = |slice: usize| (slice * self.rows + j) * self.columns + i;
        blend.parts().map(|(slice, weight)| weight * self.left[at(slice)]).sum()
    }

    fn node(&self, blend: &Blend, j: usize, i: usize) -> f32 {
        let at = |slice: usize| (slice * self.rows + j) * self.columns + i;
        blend.parts().map(|(slice, weight)| weight * self.density[at(slice)]).sum()
    }
}

/// The last of `count` knots but for the very last whose value, which rises,
/// is `goal` at most; 0 if none is.
fn last_at_most(count: usize, goal: f32, value: impl Fn(usize) -> f32) -> usize {
    let (mut low, mut high) = (0, count - 1);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if value(middle) <= goal { low = middle } else { high = middle }
    }
    low
}

/// How far `x` is from `low` to `high`, within \[0, 1\].
fn share(low: f32, high: f32, x: f32) -> f64 {
    if high > low { f64::from((x - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
}

/// Share of the mass of the density a (1−s) + b s that lies below `s`: what
/// [`invert_linear`] inverts.
fn share_below(a: f32, b: f32, s: f32) -> f32 {
    if a + b > 0.0 { s * (2.0 * a + s * (b - a)) / (a + b) } else { s }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTER: [f32; 2] = [-1.0, 2.0];
    const INNER: [f32; 3] = [0.0, 0.5, 0.6];

    /// Noise, a spot, a slope, nothing, a flat one and an edge.
    fn table() -> SlicedSquare {
        let noise = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 24) as f32;
        let slices: [&dyn Fn(usize) -> f32; 6] =
            [&noise, &|i| if i == 9 { 1e6 } else { 0.0 }, &|i| i as f32, &|_| 0.0, &|_| 1e-30, &|i| {
                if i % 7 < 3 { 1.0 } else { 0.0 }
            }];
        let values: Vec<f32> = slices.iter().flat_map(|f| (0..35).map(f)).collect();
        SlicedSquare::new(7, 5, &values).unwrap()
    }

    fn places() -> Vec<Blend> {
        let mut all = Vec::new();
        for outer in [-2.0, -1.0, 0.3, 2.0] {
            for inner in [-1.0, 0.0, 0.2, 0.5, 0.57, 9.0] {
                all.push(Blend::new(&OUTER, &INNER, [outer, inner]));
            }
        }
        all
    }

    #[test]
    fn weights_are_those_of_linear_interpolation() {
        let blend = |at| Blend::new(&OUTER, &INNER, at).parts().collect::<Vec<_>>();
        assert_eq!(blend([-5.0, -5.0]), [(0, 1.0)]);
        assert_eq!(blend([5.0, 5.0]), [(5, 1.0)]);
        assert_eq!(blend([-1.0, 0.25]), [(0, 0.5), (1, 0.5)]);
        assert_eq!(blend([0.5, 0.5]), [(1, 0.5), (4, 0.5)]);
        assert_eq!(Blend::new(&[3.0], &[1.0], [0.0, 7.0]).parts().collect::<Vec<_>>(), [(0, 1.0)]);
        for blend in places() {
            assert!((blend.parts().map(|(_, w)| w).sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    /// Counts of stratified samples in 12 × 12 boxes against the integral of the density.
    #[test]
    fn samples_follow_the_density() {
        const BOXES: usize = 12;
        let (table, side) = (table(), 480);
        assert_eq!(table.slices(), 6);
        for (k, blend) in places().into_iter().enumerate() {
            let (mut counts, mut expected) = ([0.0f64; BOXES * BOXES], [0.0f64; BOXES * BOXES]);
            let index = |[x, y]: [f32; 2]| {
                let cell = |x: f32| ((x * BOXES as f32) as usize).min(BOXES - 1);
                cell(y) * BOXES + cell(x)
            };
            let share = 1.0 / (side * side) as f64;
            for i in 0..side * side {
                let place = [(i % side) as f32 + 0.5, (i / side) as f32 + 0.5].map(|x| x / side as f32);
                expected[index(place)] += f64::from(table.density(&blend, place)) * share;
                counts[index(table.sample(&blend, place))] += share;
            }
            assert!((expected.iter().sum::<f64>() - 1.0).abs() < 1e-2, "{k}");
            for (count, expected) in counts.iter().zip(&expected) {
                assert!((count - expected).abs() < 3e-3 + 0.02 * expected, "{k}: {count} {expected}");
            }
        }
    }

    #[test]
    fn sampling_is_inverted() {
        let table = table();
        let mut checked = 0;
        for blend in places() {
            for i in 0..400 {
                let u = [(i % 20) as f32 / 20.0 + 0.013, (i / 20) as f32 / 20.0 + 0.021];
                let point = table.sample(&blend, u);
                let (back, density) = table.invert(&blend, point);
                assert!((density - table.density(&blend, point)).abs() <= 1e-5 * density);
                // What is all but empty has few digits.
                if density > 0.05 {
                    let error = (back[0] - u[0]).abs().max((back[1] - u[1]).abs());
                    assert!(error < 2e-4, "{blend:?} {u:?} {point:?} {back:?}");
                    checked += 1;
                }
            }
        }
        assert!(checked > 6000, "{checked}");
    }

    #[test]
    fn what_is_no_density_is_refused() {
        let table = |columns, rows, values: &[f32]| SlicedSquare::new(columns, rows, values);
        assert!(table(2, 2, &[0.0; 8]).is_some());
        assert!(table(2, 2, &[0.0; 7]).is_none() && table(2, 2, &[]).is_none());
        assert!(table(1, 4, &[1.0; 4]).is_none() && table(4, 1, &[1.0; 4]).is_none());
        for bad in [-1.0, f32::INFINITY, f32::NAN] {
            assert!(table(2, 2, &[1.0, 1.0, 1.0, bad]).is_none(), "{bad}");
        }
    }
}
