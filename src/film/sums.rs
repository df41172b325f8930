//! The film: exact sums of all passes, and the picture made of them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::groups::{Groups, PER_GROUP, Sums, old_slot};
use super::layers::{Layout, MAX_EXTRAS};
use super::tile::{Limits, Tile};
use super::{FilmSpec, LayerSet, Rect};

/// Edge length of a tile in pixels. The grid starts at the full film's corner,
/// whatever the crop, so that a pixel always falls into the same tile.
pub const TILE_SIZE: i32 = 16;

/// Fixed point digits after the point, in units of the scale.
const FRACTION_BITS: i32 = 63;

/// Largest radiance (and coordinate) of a sample in units of the scale, as a
/// power of two: 2^16 of these still fit the 2^64 that a sum can hold.
const LIMIT_BITS: i32 = 48;

/// A picture in the making. Tiles are merged from any thread, in any order.
///
/// Each pixel holds for each group of its samples ([`Groups`]) Σw and Σw·R, Σw·G, Σw·B, and Σw·v for every
/// filtered layer, as i128 with a quantum of 2^-63 times the scale of the
/// value: sums up to 2^64 scales are exact.
pub struct Film {
    spec: FilmSpec,
    layers: LayerSet,
    pub(super) layout: Layout,
    /// Quanta per unit, for each value of a pixel; powers of two.
    units: Vec<f64>,
    limits: Limits,
    rows: Vec<Mutex<Row>>,
    overflow: AtomicU64,
}

/// The sums of one row of the pixels stored.
pub(super) struct Row {
    sums: Vec<i128>,
    depth: Vec<f32>,
}

/// A finished picture: named channels over a window of the full film.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height of the full film: the display window.
    pub size: [u32; 2],
    /// The pixels that there are data for: the data window.
    pub window: Rect,
    /// The channels, each `window.area()` values row by row.
    pub channels: Vec<Channel>,
}

/// One named channel of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name in the file, as `R` or `albedo.G`.
    pub name: String,
    /// Its values, row by row from the top.
    pub data: Vec<f32>,
}

impl Picture {
    /// The values of a channel.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.data.as_slice())
    }
}

impl Film {
    /// An empty film. `radiance_scale` is the order of magnitude of the
    /// radiance; it is rounded to a power of two. Radiance is summed with a
    /// quantum of 2^-63 times it, and samples above 2^48 times it count as
    /// overflow. Anything but a finite number above 0 stands for 1.
    #[must_use]
    pub fn new(spec: FilmSpec, layers: LayerSet, radiance_scale: f64) -> Film {
        Film::grouped(spec, layers, radiance_scale, Groups::Halves)
    }

    /// As [`Film::new`], with the samples kept apart as `groups` says.
    #[must_use]
    pub fn grouped(spec: FilmSpec, layers: LayerSet, radiance_scale: f64, groups: Groups) -> Film {
        let layout = Layout::new(layers, groups);
        let radiance = power_of_two(radiance_scale);
        let one = 2f64.powi(FRACTION_BITS);
        let mut units = vec![one; layout.stride];
        for group in units[..layout.extras].chunks_exact_mut(PER_GROUP) {
            group[1..].fill(one / radiance);
        }
        let limit = 2f64.powi(LIMIT_BITS);
        if let Some(at) = layout.moment {
            units[at..at + 3].fill(one / radiance / radiance);
        }
        let limits = Limits {
            radiance: (limit * radiance).min(f64::from(f32::MAX)) as f32,
            position: limit as f32,
            moment: limit * radiance * radiance,
        };
        let window = spec.stored();
        let depth = if layers.depth { window.width() } else { 0 };
        let rows = (0..window.height())
            .map(|_| {
                Mutex::new(Row {
                    sums: vec![0; window.width() * layout.stride],
                    depth: vec![f32::INFINITY; depth],
                })
            })
            .collect();
        Film { spec, layers, layout, units, limits, rows, overflow: AtomicU64::new(0) }
    }

    /// What it was made of.
    #[must_use]
    pub fn spec(&self) -> &FilmSpec {
        &self.spec
    }

    /// The layers it keeps.
    #[must_use]
    pub fn layers(&self) -> LayerSet {
        self.layers
    }

    /// The pixels to sample; see [`FilmSpec::sample_bounds`].
    #[must_use]
    pub fn sample_bounds(&self) -> Rect {
        self.spec.sample_bounds()
    }

    /// The tiles of a pass, row by row: together they are the sample bounds.
    #[must_use]
    pub fn tiles(&self) -> Vec<Rect> {
        let bounds = self.sample_bounds();
        let starts = |min: i32, max: i32| {
            (min.div_euclid(TILE_SIZE)..).map(|k| k * TILE_SIZE).take_while(move |start| *start < max)
        };
        let mut tiles = Vec::new();
        for y in starts(bounds.min.1, bounds.max.1) {
            for x in starts(bounds.min.0, bounds.max.0) {
                tiles.push(Rect::new(x, y, TILE_SIZE as u32, TILE_SIZE as u32).intersect(&bounds));
            }
        }
        tiles
    }

    /// Empty sums for the samples of some pixels.
    #[must_use]
    pub fn tile(&self, rect: Rect) -> Tile {
        Tile::new(rect, self.spec.stored(), self.spec.filter, self.layout, self.layers.depth, self.limits)
    }

    /// To be called before sample `next` of each pixel is merged, and after all
    /// before it: at powers of two the older of the two newest levels of samples
    /// joins the old ones. Exact. A film that is not told compares other parts
    /// of its samples, which are not as well spread.
    pub fn advance(&self, next: u64) {
        let Some(slot) = old_slot(next).filter(|_| self.layout.groups == Groups::Halves) else { return };
        for y in 0..self.rows.len() {
            for cell in self.row(y).sums.chunks_exact_mut(self.layout.stride) {
                let (old, levels) = cell.split_at_mut(PER_GROUP);
                for (sum, level) in old.iter_mut().zip(&mut levels[(slot - 1) * PER_GROUP..]) {
                    *sum = sum.saturating_add(std::mem::take(level));
                }
            }
        }
    }

    /// Adds the sums of a tile of this film: each is rounded to fixed point
    /// once, then the order of merges does not matter.
    pub fn merge(&self, tile: &Tile) {
        debug_assert!(tile.layout == self.layout, "a tile of another film");
        let (area, window, stride) = (tile.area, self.spec.stored(), self.layout.stride);
        let mut overflow = tile.overflow;
        for (y, sums) in (area.min.1..area.max.1).zip(tile.sums.chunks_exact((area.width() * stride).max(1)))
        {
            let mut row = self.row((y - window.min.1) as usize);
            let first = (area.min.0 - window.min.0) as usize;
            let cells = row.sums[first * stride..][..sums.len()].chunks_exact_mut(stride);
            for (cell, added) in cells.zip(sums.chunks_exact(stride)) {
                for ((sum, added), unit) in cell.iter_mut().zip(added).zip(&self.units) {
                    // Most groups have no sample in a pass.
                    if *added == 0.0 {
                        continue;
                    }
                    match sum.checked_add(to_fixed(*added, *unit)) {
                        Some(total) => *sum = total,
                        None => overflow += 1,
                    }
                }
            }
            if self.layers.depth {
                let depth = &tile.depth[area.index((area.min.0, y))..][..area.width()];
                for (closest, z) in row.depth[first..].iter_mut().zip(depth) {
                    *closest = closest.min(*z);
                }
            }
        }
        if overflow > 0 {
            self.overflow.fetch_add(overflow, Ordering::Relaxed);
        }
    }

    /// Samples (or sums) left out because they were beyond the range of the
    /// sums. Not zero means that the picture is too dark somewhere.
    #[must_use]
    pub fn overflow(&self) -> u64 {
        self.overflow.load(Ordering::Relaxed)
    }

    /// Heap memory in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        Film::bytes_for(&self.spec, self.layers, self.layout.groups)
    }

    /// Heap memory in bytes of a film that is yet to be made.
    #[must_use]
    pub fn bytes_for(spec: &FilmSpec, layers: LayerSet, groups: Groups) -> usize {
        let stride = Layout::new(layers, groups).stride;
        let pixel = stride * size_of::<i128>() + usize::from(layers.depth) * size_of::<f32>();
        spec.stored().area() * pixel
    }

    /// The picture as it is now. A pixel whose weights do not sum to more than
    /// zero is 0.
    #[must_use]
    pub fn resolve(&self) -> Picture {
        let (window, stored) = (self.spec.window(), self.spec.stored());
        let left = (window.min.0 - stored.min.0) as usize;
        let columns = left..left + window.width();
        let mut channels: Vec<Channel> = self
            .channel_names()
            .into_iter()
            .map(|name| Channel { name: name.to_owned(), data: Vec::with_capacity(window.area()) })
            .collect();
        for y in 0..window.height() {
            let row = self.row(y + (window.min.1 - stored.min.1) as usize);
            let cells = row.sums.chunks_exact(self.layout.stride).enumerate();
            for (x, cell) in cells.skip(columns.start).take(columns.len()) {
                let pixel = self.pixel(cell);
                let values = pixel.mean.into_iter().chain(pixel.layers(&self.layout));
                for (channel, value) in channels.iter_mut().zip(values) {
                    channel.data.push(value as f32);
                }
                if self.layers.depth {
                    let at = 3 + self.layout.stride - self.layout.extras;
                    channels[at].data.push(row.depth[x]);
                }
            }
        }
        if self.layers.error {
            let first = channels.len() - 3;
            self.scan(|_, estimates| {
                for pixel in estimates {
                    for (channel, v) in channels[first..].iter_mut().zip(pixel.variance) {
                        channel.data.push(v.sqrt() as f32);
                    }
                }
            });
        }
        Picture { size: self.spec.size, window, channels }
    }

    /// Names in the order in which [`Film::resolve`] fills them.
    fn channel_names(&self) -> Vec<&'static str> {
        let mut names = vec!["R", "G", "B"];
        let mut add = |on: bool, more: &[&'static str]| {
            if on {
                names.extend_from_slice(more);
            }
        };
        add(self.layers.alpha, &["A"]);
        add(self.layers.albedo, &["albedo.R", "albedo.G", "albedo.B"]);
        add(self.layers.normal, &["N.X", "N.Y", "N.Z"]);
        add(self.layers.position, &["P.X", "P.Y", "P.Z"]);
        add(self.layers.moment, &["m2.R", "m2.G", "m2.B"]);
        add(self.layers.motion, &["forward.u", "forward.v"]);
        add(self.layers.depth, &["Z"]);
        add(self.layers.error, &["error.R", "error.G", "error.B"]);
        names
    }

    /// A row of the crop window, counted from its top. A panic elsewhere while
    /// the row was locked leaves sums that are whole values: still usable.
    fn row(&self, y: usize) -> MutexGuard<'_, Row> {
        self.rows[y].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The sums of a row in units of the values.
    pub(super) fn pixels_of_row(&self, y: usize) -> Vec<PixelSums> {
        self.row(y).sums.chunks_exact(self.layout.stride).map(|cell| self.pixel(cell)).collect()
    }

    /// The sums of a pixel as floats. All groups are added before rounding.
    fn pixel(&self, cell: &[i128]) -> PixelSums {
        let (groups, others) = cell.split_at(self.layout.extras);
        let (units, other_units) = self.units.split_at(self.layout.extras);
        let total: [f64; PER_GROUP] = std::array::from_fn(|k| {
            let sums = groups.iter().skip(k).step_by(PER_GROUP);
            sums.fold(0_i128, |a, b| a.saturating_add(*b)) as f64 / units[k]
        });
        let weight = total[0];
        let over = |sum: f64| if weight > 0.0 { sum / weight } else { 0.0 };
        let mut extras = [0.0; MAX_EXTRAS];
        for ((out, sum), unit) in extras.iter_mut().zip(others).zip(other_units) {
            *out = over(*sum as f64 / unit);
        }
        let float = |sums: &[i128]| -> Sums { std::array::from_fn(|k| sums[k] as f64 / units[k]) };
        PixelSums {
            weight,
            mean: [1, 2, 3].map(|k| over(total[k])),
            noise: self.layout.groups.noise(groups.chunks_exact(PER_GROUP).map(float)),
            extras,
        }
    }
}

/// What is known of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelSums {
    /// Sum of weights over all samples.
    pub weight: f64,
    /// Weighted mean of R, G, B; 0 without weight.
    pub mean: [f64; 3],
    /// Variance of a mean of weight 1, from its groups alone; nothing when
    /// fewer than two of them have samples.
    pub noise: Option<[f64; 3]>,
    extras: [f64; MAX_EXTRAS],
}

impl PixelSums {
    fn layers(self, layout: &Layout) -> impl Iterator<Item = f64> {
        self.extras.into_iter().take(layout.stride - layout.extras)
    }
}

/// `value` in quanta, rounded to nearest. Scaling by a power of two is exact,
/// and so is the conversion of anything above 2^53.
fn to_fixed(value: f64, unit: f64) -> i128 {
    (value * unit).round_ties_even() as i128
}

/// The nearest power of two (geometrically); 1 for what has none.
fn power_of_two(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { 2f64.powi(x.log2().round().clamp(-900.0, 900.0) as i32) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_point_is_exact_where_f64_is() {
        let one = 2f64.powi(FRACTION_BITS);
        for v in [0.0, 1.0, -1.0, 0.1, 1e-15, 123_456.789, 2f64.powi(62), -2f64.powi(63)] {
            let back = to_fixed(v, one) as f64 / one;
            assert!((back - v).abs() <= 0.5 / one, "{v} {back}");
        }
        assert_eq!(to_fixed(f64::NAN, one), 0);
    }

    #[test]
    fn scales_are_powers_of_two() {
        assert_eq!(power_of_two(1.0), 1.0);
        assert_eq!(power_of_two(1000.0), 1024.0);
        assert_eq!(power_of_two(3e-5), 2f64.powi(-15));
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(power_of_two(bad), 1.0);
        }
    }
}
