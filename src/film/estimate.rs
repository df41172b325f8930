//! How wrong each pixel is.
//!
//! The samples of a pixel are kept apart in groups whose means scatter; from
//! that follows c, the variance of a mean of weight 1 ([`super::Groups`]), and the
//! error of the pixel is √(c/W) with W the sum of its weights.
//!
//! Halves give c one degree of freedom only. So it is pooled: averaged over the
//! 5 × 5 neighbours with the binomial weights (1, 4, 6, 4, 1)/16, which makes
//! about 13 of it. Replicas have 15 for R = 16, of which a normal interval still
//! covers 93 % where it says 95 % (Student's t), and much less around caustics,
//! where most pixels have not seen a bright path yet but a neighbour has; so
//! they are pooled in the same way. Pooling is biased where the noise changes
//! within two pixels.
//!
//! Where no pixel of the neighbourhood has samples in two groups (one sample
//! per pixel), the variance of the pixel means over the 3 × 3 neighbours stands
//! in. It takes the structure of the picture for noise, and filters that
//! overlap hide some of the noise: a rough figure. Without any neighbour, and
//! for a pixel without weight, the error is infinite.
//!
//! How often the truth lies within what is stated: `tests/calibration.rs`.

use std::collections::VecDeque;

use super::spec::POOL_REACH as REACH;
use super::sums::{Film, PixelSums};

/// Weights of the pool along an axis.
const BINOMIAL: [f64; 2 * REACH + 1] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// One pixel: its mean, and the estimate of c from its groups if there is one.
struct Noise {
    weight: f64,
    mean: [f64; 3],
    c: Option<[f64; 3]>,
}

/// What is known of the error of a pixel.
pub(super) struct Estimate {
    /// Variance of the mean, per channel, pooled.
    pub variance: [f64; 3],
    /// The same from this pixel alone, where that is possible.
    pub own: [f64; 3],
    /// Mean of the 3 × 3 neighbours, itself left out; its own mean without any.
    pub around: [f64; 3],
}

impl Noise {
    fn of(pixel: &PixelSums) -> Noise {
        Noise { weight: pixel.weight, mean: pixel.mean, c: pixel.noise }
    }
}

impl Film {
    /// Visits the rows of the window in order with the mean of each pixel and
    /// what is known of its error.
    pub(super) fn scan(&self, mut visit: impl FnMut(&[[f64; 3]], &[Estimate])) {
        let (window, stored) = (self.spec().window(), self.spec().stored());
        let height = stored.height();
        let (top, left) = ((window.min.1 - stored.min.1) as usize, (window.min.0 - stored.min.0) as usize);
        let mut rows: VecDeque<Row> = VecDeque::new();
        let (mut first, mut next) = (0, 0);
        for y in 0..height {
            while next < height.min(y + REACH + 1) {
                rows.push_back(Row::new(self.pixels_of_row(next).iter().map(Noise::of).collect()));
                next += 1;
            }
            if first + REACH < y {
                rows.pop_front();
                first += 1;
            }
            if !(top..top + window.height()).contains(&y) {
                continue;
            }
            let own = &rows[y - first];
            let columns = left..left + window.width();
            let means: Vec<_> = own.pixels[columns.clone()].iter().map(|p| p.mean).collect();
            let estimates: Vec<_> = columns
                .map(|x| {
                    let at = (x, y - first);
                    let pool = weighted(rows.len(), at.1, |j| &rows[j].pools[x]);
                    let Noise { weight, c, .. } = own.pixels[x];
                    if weight <= 0.0 {
                        return Estimate {
                            variance: [f64::INFINITY; 3],
                            own: [f64::INFINITY; 3],
                            around: [0.0; 3],
                        };
                    }
                    let over = |c: Option<[f64; 3]>| c.map(|c| c.map(|c| c / weight));
                    let pooled = over(pool.c()).or_else(|| spread(&rows, at));
                    let variance = pooled.unwrap_or([f64::INFINITY; 3]);
                    let around = around(&rows, at);
                    Estimate { variance, own: over(c).unwrap_or(variance), around }
                })
                .collect();
            visit(&means, &estimates);
        }
    }
}

/// A row of pixels, and what each has pooled along the row.
struct Row {
    pixels: Vec<Noise>,
    pools: Vec<Pool>,
}

/// Sums over neighbours with binomial weights.
#[derive(Clone, Copy, Default)]
struct Pool {
    /// Of c, where there is one, and of its weights.
    c: [f64; 3],
    known: f64,
}

impl Pool {
    fn of(pixel: &Noise) -> Pool {
        Pool { c: pixel.c.unwrap_or_default(), known: f64::from(u8::from(pixel.c.is_some())) }
    }

    fn add(&mut self, weight: f64, other: &Pool) {
        for (sum, c) in self.c.iter_mut().zip(other.c) {
            *sum += weight * c;
        }
        self.known += weight * other.known;
    }

    /// c averaged over the neighbours that have it.
    fn c(&self) -> Option<[f64; 3]> {
        (self.known > 0.0).then(|| self.c.map(|c| c / self.known))
    }
}

impl Row {
    fn new(pixels: Vec<Noise>) -> Row {
        let own: Vec<Pool> = pixels.iter().map(Pool::of).collect();
        let pools = (0..own.len()).map(|x| weighted(own.len(), x, |i| &own[i])).collect();
        Row { pixels, pools }
    }
}

/// The weighted sum of the pools at most [`REACH`] from `at`, of `count`.
fn weighted<'a>(count: usize, at: usize, pool: impl Fn(usize) -> &'a Pool) -> Pool {
    let mut sum = Pool::default();
    for i in at.saturating_sub(REACH)..count.min(at + REACH + 1) {
        sum.add(BINOMIAL[i + REACH - at], pool(i));
    }
    sum
}

/// The mean of the nearest neighbours, weighted by 2 along the axes and 1
/// across.
fn around(rows: &VecDeque<Row>, (x, y): (usize, usize)) -> [f64; 3] {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (j, row) in rows.iter().enumerate().take(y + 2).skip(y.saturating_sub(1)) {
        for (i, pixel) in row.pixels.iter().enumerate().take(x + 2).skip(x.saturating_sub(1)) {
            if (i, j) != (x, y) && pixel.weight > 0.0 {
                let weight = if i == x || j == y { 2.0 } else { 1.0 };
                sum.iter_mut().zip(pixel.mean).for_each(|(s, m)| *s += weight * m);
                total += weight;
            }
        }
    }
    if total > 0.0 { sum.map(|s| s / total) } else { rows[y].pixels[x].mean }
}

/// The sample variance of the means of the nearest neighbours.
fn spread(rows: &VecDeque<Row>, (x, y): (usize, usize)) -> Option<[f64; 3]> {
    let near = || {
        let rows = rows.range(y.saturating_sub(1)..rows.len().min(y + 2));
        let columns = x.saturating_sub(1)..;
        let pixels = rows.flat_map(move |r| &r.pixels[columns.start..r.pixels.len().min(x + 2)]);
        pixels.filter(|p| p.weight > 0.0)
    };
    let count = near().count();
    if count < 2 {
        return None;
    }
    Some([0, 1, 2].map(|k| {
        let mean = near().map(|p| p.mean[k]).sum::<f64>() / count as f64;
        near().map(|p| (p.mean[k] - mean).powi(2)).sum::<f64>() / (count - 1) as f64
    }))
}
