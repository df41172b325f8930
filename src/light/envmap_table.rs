//! Directions in proportion to a bilinear picture on the sphere.
//!
//! Between its texels a picture l is bilinear in (φ, θ), and the density
//! wanted per solid angle is p(ω) = l(ω) / ∫ l dω exactly, so that radiance over
//! density is constant for a grey map and p is positive wherever l is, poles
//! and black neighbours of bright texels included. A cell between four texels
//! with means A, B of its upper and lower pair has, up to a factor,
//!
//!   mass = ∫₀¹ (A (1−t) + B t) sin(θ₀ + tΔ) dt,
//!
//! in closed form. Sampling picks a row by its mass, a cell in the row by its
//! mass, t by Newton's iteration on the closed form, and then s, in which the
//! density is linear. Inverse distribution functions, not alias tables: they
//! keep the stratification of the samples, and the one f32 that picks a row
//! still has its bits left over for t when the map is large.

use std::f64::consts::{PI, TAU};

use crate::math::Vec2;
use crate::sampling::invert_linear;

/// The weights of a picture's texels, row 0 at θ = 0 and the last row at π (or less);
/// column i is at φ = 2π (i + ½) / width and the columns go round.
pub(super) trait Weights {
    /// Columns and rows, each at least 1.
    fn size(&self) -> [u32; 2];
    /// Weight of a texel, finite, ≥ 0.
    fn weight(&self, x: u32, y: u32) -> f64;
    /// θ of the last row, radians: less than π for a picture of a cap.
    fn polar_range(&self) -> f64 {
        PI
    }
}

/// A point of the picture: φ and θ in radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angles {
    pub phi: f64,
    pub theta: f64,
}

/// Distribution functions of rows and of cells in each row.
#[derive(Clone, Debug)]
pub(super) struct EnvTable {
    width: usize,
    /// Share of all mass above each row; one more than rows, from 0 to 1.
    rows: Vec<f64>,
    /// For each row, share of its mass left of cells 1, 2, … in units of 2⁻³².
    cells: Vec<u32>,
    /// Sine and cosine of θ above each row and below the last.
    edges: Vec<(f64, f64)>,
    /// ∫ l dω.
    integral: f64,
    /// θ of the last row.
    range: f64,
}

const FIXED_POINT: f64 = 4_294_967_296.0;

impl EnvTable {
    /// `None` when all weights are zero.
    pub(super) fn new(picture: &impl Weights) -> Option<EnvTable> {
        let [width, height] = picture.size();
        let row_count = height.max(2) - 1;
        let range = picture.polar_range();
        let delta = range / f64::from(row_count);
        let mut rows = vec![0.0];
        let mut cells = Vec::with_capacity((width as usize - 1) * row_count as usize);
        // Sums of neighbours: twice the means A and B of each cell.
        let pairs = |j: u32| -> Vec<f64> {
            let row: Vec<f64> = (0..width).map(|i| picture.weight(i, j)).collect();
            (0..row.len()).map(|i| row[i] + row[(i + 1) % row.len()]).collect()
        };
        let mut total = 0.0;
        let mut above = pairs(0);
        for j in 0..row_count {
            let below = pairs((j + 1).min(height - 1));
            let parts = Strip::new(j, delta).at(1.0).parts;
            let masses = above.iter().zip(&below).map(|(a, b)| 0.5 * parts.mass(*a, *b));
            let row_mass: f64 = masses.clone().sum();
            total += row_mass;
            rows.push(total);
            let mut left = 0.0;
            for mass in masses.take(width as usize - 1) {
                left += mass;
                let share = if row_mass > 0.0 { left / row_mass } else { 0.0 };
                cells.push((share * FIXED_POINT).round() as u32);
            }
            above = below;
        }
        if !(total > 0.0) {
            return None;
        }
        rows.iter_mut().for_each(|r| *r /= total);
        let integral = total * (TAU / f64::from(width)) * delta;
        let edges = (0..=row_count).map(|j| edge(j, delta)).collect();
        Some(EnvTable { width: width as usize, rows, cells, edges, integral, range })
    }

    /// ∫ l dω over the sphere.
    pub(super) fn integral(&self) -> f64 {
        self.integral
    }

    pub(super) fn memory_bytes(&self) -> usize {
        8 * self.rows.len() + 4 * self.cells.len() + 16 * self.edges.len()
    }

    /// A point with density l / ∫ l dω per solid angle, by `u` in \[0, 1)².
    pub(super) fn sample(&self, picture: &impl Weights, u: Vec2) -> Angles {
        // Row.
        let y = f64::from(u.y);
        let row_count = self.rows.len() - 1;
        let j = (self.rows.partition_point(|r| *r <= y) - 1).min(row_count - 1);
        let v = (y - self.rows[j]) / (self.rows[j + 1] - self.rows[j]);

        // Cell of the row.
        let x = f64::from(u.x) * FIXED_POINT;
        let bounds = &self.cells[j * (self.width - 1)..(j + 1) * (self.width - 1)];
        let i = bounds.partition_point(|c| f64::from(*c) <= x);
        let left = if i == 0 { 0.0 } else { f64::from(bounds[i - 1]) };
        let right = bounds.get(i).map_or(FIXED_POINT, |c| f64::from(*c));
        let w = (x - left) / (right - left);

        // Point of the cell.
        let cell = Cell::new(picture, i as u32, j as u32);
        let delta = self.range / row_count as f64;
        let strip = Strip::between(j as u32, delta, [self.edges[j], self.edges[j + 1]]);
        let t = strip.invert(&cell, v.clamp(0.0, 1.0));
        let s = invert_linear(mix(cell.l00, cell.l01, t), mix(cell.l10, cell.l11, t), w);
        Angles { phi: TAU * (i as f64 + 0.5 + s) / self.width as f64, theta: strip.theta(t) }
    }
}

/// The weights at the corners of a cell: lxy, x to the right, y down.
struct Cell {
    l00: f64,
    l10: f64,
    l01: f64,
    l11: f64,
}

impl Cell {
    fn new(picture: &impl Weights, i: u32, j: u32) -> Cell {
        let [width, height] = picture.size();
        let (right, below) = ((i + 1) % width, (j + 1).min(height - 1));
        Cell {
            l00: picture.weight(i, j),
            l10: picture.weight(right, j),
            l01: picture.weight(i, below),
            l11: picture.weight(right, below),
        }
    }
}

/// ∫₀ᵗ (1−τ) sin θ(τ) dτ and ∫₀ᵗ τ sin θ(τ) dτ.
struct Parts {
    upper: f64,
    lower: f64,
}

impl Parts {
    fn mass(&self, a: f64, b: f64) -> f64 {
        a * self.upper + b * self.lower
    }
}

/// A row of cells: θ from θ₀ to θ₀ + Δ.
struct Strip {
    theta0: f64,
    delta: f64,
    /// Sine and cosine of θ₀.
    start: (f64, f64),
    /// sin(θ₀ + Δ).
    sin_end: f64,
}

/// A place t in a strip: the masses above it as factors of A and B, and sin θ.
struct Place {
    parts: Parts,
    sin: f64,
}

/// Sine and cosine of the θ above row `j`.
fn edge(j: u32, delta: f64) -> (f64, f64) {
    (f64::from(j) * delta).sin_cos()
}

impl Strip {
    fn new(j: u32, delta: f64) -> Strip {
        Strip::between(j, delta, [j, j + 1].map(|j| edge(j, delta)))
    }

    /// The same with its two edges at hand.
    fn between(j: u32, delta: f64, edges: [(f64, f64); 2]) -> Strip {
        Strip { theta0: f64::from(j) * delta, delta, start: edges[0], sin_end: edges[1].0 }
    }

    fn theta(&self, t: f64) -> f64 {
        self.theta0 + t * self.delta
    }

    /// By the sine and cosine of half the way alone; angles add up.
    fn at(&self, t: f64) -> Place {
        let (sin0, cos0) = self.start;
        let (sin_half, cos_half) = (0.5 * t * self.delta).sin_cos();
        let (sin_way, cos_way) = (2.0 * sin_half * cos_half, 1.0 - 2.0 * sin_half * sin_half);
        // Differences of sines and cosines as products: no cancellation in thin rows.
        let chord = 2.0 * sin_half / self.delta;
        let plain = (sin0 * cos_half + cos0 * sin_half) * chord;
        let cos_middle = cos0 * cos_half - sin0 * sin_half;
        let cos = cos0 * cos_way - sin0 * sin_way;
        let ramp = (cos_middle * chord - t * cos) / self.delta;
        let parts = Parts { upper: (plain - ramp).max(0.0), lower: ramp.max(0.0) };
        Place { parts, sin: sin0 * cos_way + cos0 * sin_way }
    }

    /// The t with the share `v` of the cell's mass above it.
    fn invert(&self, cell: &Cell, v: f64) -> f64 {
        let (a, b) = (0.5 * (cell.l00 + cell.l10), 0.5 * (cell.l01 + cell.l11));
        let goal = v * self.at(1.0).parts.mass(a, b);
        // The density is nearly linear in a thin row; Newton then ends in two
        // steps. The bracket keeps it safe at the poles, where it is flat.
        let mut t = invert_linear((a * self.start.0).max(0.0), (b * self.sin_end).max(0.0), v);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let Place { parts, sin } = self.at(t);
            let excess = parts.mass(a, b) - goal;
            if excess > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let newton = t - excess / (mix(a, b, t) * sin);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let step = (next - t).abs();
            t = next;
            if step < 1e-9 {
                break;
            }
        }
        t
    }
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a * (1.0 - t) + b * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inversions_undo_the_closed_forms() {
        for (j, rows) in [(0, 1), (0, 2), (1, 2), (0, 4096), (4095, 4096), (1000, 4096)] {
            let strip = Strip::new(j, PI / f64::from(rows));
            for (a, b) in [(1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (1e-12, 1e12), (3.0, 2.0)] {
                let cell = Cell { l00: a, l10: a, l01: b, l11: b };
                let mass = strip.at(1.0).parts.mass(a, b);
                assert!(mass > 0.0, "row {j} of {rows}, {a}, {b}");
                for k in 0..=16 {
                    let v = f64::from(k) / 16.0;
                    let t = strip.invert(&cell, v);
                    let back = strip.at(t).parts.mass(a, b) / mass;
                    assert!((back - v).abs() < 1e-7, "row {j} of {rows}, {a}, {b}: {back} not {v}");
                }
            }
        }
    }
}
