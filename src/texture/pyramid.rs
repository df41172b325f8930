//! Images averaged ahead of time, for what a pixel sees of many texels at once.
//!
//! A pixel in the distance covers many texels. Single samples of them are right
//! in the mean and noisy; the mean over the texels that a sample stands for is
//! hardly noisy. A pyramid of images, each half as wide and high as the one
//! before (Williams 1983, "Pyramidal Parametrics"), has such means ready.
//!
//! - The footprint of a pixel is as wide as the pixel would be at the distance
//!   of the camera, wherever the path has been since (Pharr, Jakob & Humphreys
//!   2023, section 10.1.3): nothing travels with the ray.
//! - Sample i of a pixel, from 0, stands for 1/(i + 1) of its area. So the
//!   picture goes to that without a filter as samples grow: over N of them the
//!   blur has a mean area of ln N / N pixels.
//! - On the surface it is an ellipse. The level is chosen by its shorter axis;
//!   along the longer one, several texels of that level are averaged, up to
//!   [`MOST_PROBES`] (McCormack et al. 1999, "Feline").
//! - Between levels there is no interpolation: footprints differ from sample to
//!   sample, which blends levels anyway.
//!
//! Means are of linear values and stored as halves, within 2⁻¹¹.

use std::collections::HashMap;
use std::sync::Arc;

use half::f16;
use rayon::prelude::*;

use super::attribute::MAX_ATTRIBUTES;
use super::texels::Texels;
use crate::desc::{Image, Pixels};
use crate::math::{Vec2, Vec3};

/// Most lookups along the longer axis of a footprint.
const MOST_PROBES: f32 = 8.0;

/// What a sample covers of a surface, in texture coordinates: an ellipse.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// E, F and G of the quadratic form of (u, v) that is 1/4 on its border.
    form: [f32; 3],
}

/// A point in the coordinates of every attribute.
pub const NO_FOOTPRINTS: [Footprint; MAX_ATTRIBUTES] = [Footprint::POINT; MAX_ATTRIBUTES];

/// How to average over a footprint: `count` lookups, `step` apart, around the middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probes {
    /// The level of the pyramid; 0 is the image itself.
    pub level: usize,
    /// From one to the next, in texels of the image.
    pub step: Vec2,
    /// At least one.
    pub count: u32,
}

impl Footprint {
    /// A point: nothing is averaged.
    pub const POINT: Footprint = Footprint { form: [0.0; 3] };

    /// That of a round beam of so much width along the unit vector `wo`, on a surface
    /// with these ∂p/∂u and ∂p/∂v.
    #[must_use]
    #[inline]
    pub fn new(width: f32, wo: Vec3, dpdu: Vec3, dpdv: Vec3) -> Footprint {
        if !(width > 0.0) {
            return Footprint::POINT;
        }
        // As the beam sees them.
        let across = |d: Vec3| (d - wo * wo.dot(d)) / width;
        let (u, v) = (across(dpdu), across(dpdv));
        Footprint { form: [u.dot(u), u.dot(v), v.dot(v)] }
    }

    /// How to average; `None` where it is no wider than two texels, or (u, v) stands
    /// still. `texel` holds the sides of a texel in (u, v).
    #[inline]
    pub(super) fn probes(&self, texel: &[Vec2; 2]) -> Option<Probes> {
        let [e, f, g] = self.form;
        let product = |a: Vec2, b: Vec2| a.x * (e * b.x + f * b.y) + a.y * (f * b.x + g * b.y);
        let (x, y) = (product(texel[0], texel[0]), product(texel[1], texel[1]));
        let both = product(texel[0], texel[1]);
        // Squared sides of a texel over squared width, along the axes of the ellipse.
        let (middle, apart) = (0.5 * (x + y), (0.25 * (x - y) * (x - y) + both * both).sqrt());
        let (largest, smallest) = (middle + apart, middle - apart);
        // In squared texels.
        let long = 1.0 / smallest.max(largest * 1e-6);
        if !(long >= 4.0 && long.is_finite()) {
            return None;
        }
        let short = (1.0 / largest).max(long / (MOST_PROBES * MOST_PROBES)).max(1.0);
        let level = ((short.to_bits() >> 23) as usize - 127) / 2;
        // A lookup is two texels of its level wide.
        let (long, texel) = (long.sqrt(), (1_u64 << level.min(63)) as f32);
        let count = (0.5 * long / texel).ceil();
        let axis = if x > y { Vec2::new(both, smallest - x) } else { Vec2::new(smallest - y, both) };
        let axis = axis.try_normalize().unwrap_or(Vec2::X);
        Some(Probes { level, step: axis * (long / count), count: count as u32 })
    }
}

/// The pyramids of a scene: one for each image and way of reading it.
#[derive(Debug, Default)]
pub struct Pyramids {
    made: HashMap<(*const Image, bool), Arc<[Arc<Image>]>>,
}

impl Pyramids {
    /// The levels from the second on, down to one texel; none for a single texel.
    pub(super) fn of(&mut self, texels: &Texels) -> Arc<[Arc<Image>]> {
        self.made.entry(texels.key()).or_insert_with(|| levels(texels).into()).clone()
    }

    /// Bytes of all levels.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.made.values().flat_map(|levels| levels.iter()).map(|level| level.pixels.bytes()).sum()
    }
}

fn levels(texels: &Texels) -> Vec<Arc<Image>> {
    let channels = texels.channels();
    let mut size = [texels.width(), texels.height()];
    let mut out: Vec<Arc<Image>> = Vec::new();
    let mut last: Vec<f32> = Vec::new();
    while size != [1, 1] {
        let next = if out.is_empty() {
            halve(size, channels, |x, y| texels.stored(x, y))
        } else {
            halve(size, channels, |x, y| {
                let at = (y as usize * size[0] as usize + x as usize) * channels;
                std::array::from_fn(|c| last.get(at + c).filter(|_| c < channels).copied().unwrap_or(0.0))
            })
        };
        size = half_of(size);
        let fits = next.iter().all(|x| x.abs() <= f16::MAX.to_f32());
        let pixels = if fits {
            Pixels::F16(next.iter().map(|x| f16::from_f32(*x)).collect())
        } else {
            Pixels::F32(next.clone())
        };
        let name = texels.name().to_owned();
        out.push(Arc::new(Image {
            width: size[0],
            height: size[1],
            channels: channels as u32,
            pixels,
            name,
        }));
        last = next;
    }
    out
}

fn half_of(size: [u32; 2]) -> [u32; 2] {
    size.map(|n| (n / 2).max(1))
}

/// Texels that an output texel covers of an axis of `n`, cut into `m`: the first, and
/// the shares of all of them.
fn covered(i: u32, n: u32, m: u32) -> (u32, Vec<f32>) {
    let [from, to] = [i, i + 1].map(|i| f64::from(i) * f64::from(n) / f64::from(m));
    let (first, end) = (from.floor() as u32, (to.ceil() as u32).min(n));
    let share = |j: u32| (to.min(f64::from(j + 1)) - from.max(f64::from(j))) / (to - from);
    (first, (first..end).map(|j| share(j) as f32).collect())
}

/// The means over the texels of half as many.
fn halve(size: [u32; 2], channels: usize, texel: impl Fn(u32, u32) -> [f32; 4] + Sync) -> Vec<f32> {
    let [width, height] = half_of(size);
    let columns: Vec<_> = (0..width).map(|x| covered(x, size[0], width)).collect();
    let mut out = vec![0.0; width as usize * height as usize * channels];
    out.par_chunks_mut(width as usize * channels).enumerate().for_each(|(y, row)| {
        let (top, rows) = covered(y as u32, size[1], height);
        for (pixel, (left, columns)) in row.chunks_exact_mut(channels).zip(&columns) {
            for (y, down) in (top..).zip(&rows) {
                for (x, across) in (*left..).zip(columns) {
                    let values = texel(x, y);
                    pixel.iter_mut().zip(values).for_each(|(sum, value)| *sum += down * across * value);
                }
            }
        }
    });
    out
}
