//! How wrong the picture is.
//!
//! Let A and B be the means of a pixel's two halves, with weights W_A and W_B
//! and W = W_A + W_B. If both halves are independent with variance c/W_A and
//! c/W_B, the pixel's mean M = (W_A·A + W_B·B)/W has variance c/W, and
//!
//!   (A − B)² · W_A·W_B/W²    (that is, ((A − B)/2)² for equal halves)
//!
//! has that as its expectation: it is an unbiased estimate from one degree of
//! freedom. So it is pooled: c is averaged over the 5 × 5 neighbours with the
//! binomial weights (1, 4, 6, 4, 1)/16 (about 13 degrees of freedom), and the
//! error is √(c/W). The halves of an Owen-scrambled set are stratified against
//! each other: their difference then says more than the error of the mean, so
//! that the estimate is conservative. It is biased where the noise changes
//! within two pixels, and at the edge of a crop fewer neighbours are pooled.
//!
//! Where no pixel of the neighbourhood has samples in both halves (one or two
//! samples per pixel), the variance of the pixel means over the 3 × 3
//! neighbours stands in. It takes the structure of the picture for noise, and
//! filters that overlap hide some of the noise: a rough figure. Without any
//! neighbour, and for a pixel without weight, the error is infinite.

use std::collections::VecDeque;

use super::sums::{Film, PixelSums};

/// Rows and columns on each side that are pooled.
const REACH: usize = 2;

/// Binomial weights of the pool along an axis.
const BINOMIAL: [f64; 2 * REACH + 1] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// One pixel: its mean, and the estimate of c from its halves if both exist.
struct Noise {
    weight: f64,
    mean: [f64; 3],
    c: Option<[f64; 3]>,
}

impl Noise {
    fn of(pixel: &PixelSums) -> Noise {
        let [a, b] = pixel.halves;
        let c = (a[0] > 0.0 && b[0] > 0.0).then(|| {
            [1, 2, 3].map(|k| {
                let difference = a[k] / a[0] - b[k] / b[0];
                difference * difference * (a[0] / pixel.weight) * b[0]
            })
        });
        Noise { weight: pixel.weight, mean: pixel.mean, c }
    }
}

impl Film {
    /// The relative error of the whole picture: the root of the mean over all
    /// pixels of e²/(m² + m̄²/100), where m is the mean of a pixel's R, G, B,
    /// e² the mean of their estimated variances, and m̄ the mean over the
    /// picture. The second term keeps dark pixels from ruling the figure.
    ///
    /// 0 for a black picture; infinite while there are pixels without samples.
    /// Reads the whole film: call it once per pass, not per tile.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        let mut pixels: Vec<[f64; 2]> = Vec::with_capacity(self.spec().window().area());
        self.scan(|row, variance| {
            let third = |v: &[f64; 3]| v.iter().sum::<f64>() / 3.0;
            pixels.extend(row.iter().zip(variance).map(|(mean, v)| [third(mean), third(v)]));
        });
        let count = pixels.len() as f64;
        let picture = pixels.iter().map(|p| p[0]).sum::<f64>() / count;
        let square = |[mean, variance]: &[f64; 2]| {
            if *variance > 0.0 { variance / (mean * mean + 0.01 * picture * picture) } else { 0.0 }
        };
        (pixels.iter().map(square).sum::<f64>() / count).sqrt()
    }

    /// Visits the rows of the window in order with the mean and the estimated
    /// variance of the mean of each pixel.
    pub(super) fn scan(&self, mut visit: impl FnMut(&[[f64; 3]], &[[f64; 3]])) {
        let height = self.spec().window().height();
        let mut rows: VecDeque<Vec<Noise>> = VecDeque::new();
        let (mut first, mut next) = (0, 0);
        for y in 0..height {
            while next < height.min(y + REACH + 1) {
                rows.push_back(self.pixels_of_row(next).iter().map(Noise::of).collect());
                next += 1;
            }
            if first + REACH < y {
                rows.pop_front();
                first += 1;
            }
            let own = &rows[y - first];
            let means: Vec<_> = own.iter().map(|p| p.mean).collect();
            let variance: Vec<_> = (0..own.len())
                .map(|x| {
                    let weight = own[x].weight;
                    if !(weight > 0.0) {
                        return [f64::INFINITY; 3];
                    }
                    pooled(&rows, x, y - first)
                        .map(|c| c.map(|c| c / weight))
                        .or_else(|| spread(&rows, x, y - first))
                        .unwrap_or([f64::INFINITY; 3])
                })
                .collect();
            visit(&means, &variance);
        }
    }
}

/// The pixels at most `reach` columns and rows away, with their distances
/// shifted to start at 0.
fn neighbours(
    rows: &VecDeque<Vec<Noise>>,
    (x, y): (usize, usize),
    reach: usize,
) -> impl Iterator<Item = (usize, usize, &Noise)> {
    let last = (y + reach).min(rows.len() - 1);
    (y.saturating_sub(reach)..=last).flat_map(move |j| {
        let row = &rows[j];
        let last = (x + reach).min(row.len() - 1);
        (x.saturating_sub(reach)..=last).map(move |i| (i + reach - x, j + reach - y, &row[i]))
    })
}

/// c averaged over the neighbours that have it.
fn pooled(rows: &VecDeque<Vec<Noise>>, x: usize, y: usize) -> Option<[f64; 3]> {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (i, j, pixel) in neighbours(rows, (x, y), REACH) {
        if let Some(c) = pixel.c {
            let g = BINOMIAL[i] * BINOMIAL[j];
            total += g;
            for (sum, c) in sum.iter_mut().zip(c) {
                *sum += g * c;
            }
        }
    }
    (total > 0.0).then(|| sum.map(|s| s / total))
}

/// The sample variance of the means of the nearest neighbours.
fn spread(rows: &VecDeque<Vec<Noise>>, x: usize, y: usize) -> Option<[f64; 3]> {
    let near = || neighbours(rows, (x, y), 1).map(|(_, _, p)| p).filter(|p| p.weight > 0.0);
    let count = near().count();
    if count < 2 {
        return None;
    }
    Some([0, 1, 2].map(|k| {
        let mean = near().map(|p| p.mean[k]).sum::<f64>() / count as f64;
        near().map(|p| (p.mean[k] - mean).powi(2)).sum::<f64>() / (count - 1) as f64
    }))
}
