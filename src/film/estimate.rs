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
//! within two pixels. A crop sums the neighbours of its edge too.
//!
//! Where no pixel of the neighbourhood has samples in both halves (one or two
//! samples per pixel), the variance of the pixel means over the 3 × 3
//! neighbours stands in. It takes the structure of the picture for noise, and
//! filters that overlap hide some of the noise: a rough figure. Without any
//! neighbour, and for a pixel without weight, the error is infinite.

use std::collections::VecDeque;

use super::spec::POOL_REACH as REACH;
use super::sums::{Film, PixelSums};

/// Binomial weights of the pool along an axis.
const BINOMIAL: [f64; 2 * REACH + 1] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// One pixel: its mean, and the estimate of c from its halves if both exist.
struct Noise {
    weight: f64,
    mean: [f64; 3],
    c: Option<[f64; 3]>,
}

/// What is known of the error of a pixel.
pub(super) struct Estimate {
    /// Variance of the mean, per channel.
    pub variance: [f64; 3],
    /// Square of the brightness around it.
    pub square: f64,
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
    /// pixels of e²/(m² + m̄²/100), where e² is the mean of the estimated
    /// variances of R, G and B, m² the square of their mean, pooled over the
    /// same neighbours as e² (so that the edge of a lamp is compared with the
    /// lamp), and m̄ the mean over the picture. The second term keeps dark
    /// pixels from ruling the figure.
    ///
    /// 0 for a black picture; infinite while there are pixels without samples.
    /// Reads the whole film: call it once per pass, not per tile.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        let (mut pixels, mut total) = (Vec::with_capacity(self.spec().window().area()), 0.0);
        self.scan(|means, estimates| {
            total += means.iter().map(|m| m.iter().sum::<f64>() / 3.0).sum::<f64>();
            pixels.extend(estimates.iter().map(|e| (e.variance.iter().sum::<f64>() / 3.0, e.square)));
        });
        let count = pixels.len() as f64;
        let floor = 0.01 * (total / count).powi(2);
        let term = |(variance, square): &(f64, f64)| {
            if *variance > 0.0 { variance / (square + floor) } else { 0.0 }
        };
        (pixels.iter().map(term).sum::<f64>() / count).sqrt()
    }

    /// Visits the rows of the window in order with the mean and the estimated
    /// variance of the mean of each pixel.
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
                    let pool = pooled(&rows, at);
                    let weight = own.pixels[x].weight;
                    let known = || pool.c().map(|c| c.map(|c| c / weight)).or_else(|| spread(&rows, at));
                    let variance = if weight > 0.0 { known() } else { None };
                    Estimate {
                        variance: variance.unwrap_or([f64::INFINITY; 3]),
                        square: pool.square / pool.all,
                    }
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
    /// Of the square of the mean of R, G and B, and of its weights.
    square: f64,
    all: f64,
}

impl Pool {
    fn of(pixel: &Noise) -> Pool {
        let square = (pixel.mean.iter().sum::<f64>() / 3.0).powi(2);
        Pool {
            c: pixel.c.unwrap_or_default(),
            known: f64::from(u8::from(pixel.c.is_some())),
            square,
            all: 1.0,
        }
    }

    fn add(&mut self, weight: f64, other: &Pool) {
        for (sum, c) in self.c.iter_mut().zip(other.c) {
            *sum += weight * c;
        }
        self.known += weight * other.known;
        self.square += weight * other.square;
        self.all += weight * other.all;
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

/// What a pixel and its neighbours in both directions have pooled.
fn pooled(rows: &VecDeque<Row>, (x, y): (usize, usize)) -> Pool {
    weighted(rows.len(), y, |j| &rows[j].pools[x])
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
