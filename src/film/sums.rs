//! The film: exact sums of all passes, and the picture made of them.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::groups::{Groups, PER_GROUP, Sums, old_slot};
use super::layers::{Layout, MAX_EXTRAS};
use super::tile::{Limits, Tile};
use super::wide::Wide;
use super::{FilmSpec, LayerSet, Rect, Scale};

/// Edge length of a tile in pixels. The grid starts at the full film's corner,
/// whatever the crop, so that a pixel always falls into the same tile.
pub const TILE_SIZE: i32 = 16;

/// Fixed point digits after the point, in units of the scale.
const FRACTION_BITS: i32 = 63;

/// Largest radiance of a sample in units of the scale, as a power of two.
const LIMIT_BITS: i32 = 48;

/// Largest coordinate, as a power of two.
const POSITION_BITS: i32 = 100;

/// A picture in the making. Tiles are merged from any thread, in any order.
///
/// Each pixel holds for each group of its samples ([`Groups`]) Σw and Σw·R, Σw·G, Σw·B, and Σw·v for every
/// filtered layer, as i128 with a quantum of 2^-63 times the scale of the
/// value. What a sum beyond 2^64 scales needs more is kept beside the row, and
/// takes no room where there is none: no sum can overflow.
pub struct Film {
    spec: FilmSpec,
    layers: LayerSet,
    pub(super) layout: Layout,
    /// Quanta per unit, for each value of a pixel; powers of two.
    units: Vec<f64>,
    limits: Limits,
    /// Pixels that share their noise, beside what the filter makes of it.
    pub(super) sharing: f64,
    rows: Vec<Mutex<Row>>,
}

/// The sums of one row of the pixels stored.
pub(super) struct Row {
    /// Modulo 2^128, as signed numbers.
    sums: Vec<i128>,
    /// What is missing, in units of 2^128, by the index of the sum: next to
    /// always empty.
    carries: BTreeMap<usize, i128>,
    depth: Vec<f32>,
    bad: Vec<u32>,
}

impl Row {
    /// An empty row.
    fn new(width: usize, stride: usize, layers: LayerSet) -> Row {
        Row {
            sums: vec![0; width * stride],
            carries: BTreeMap::new(),
            depth: vec![f32::INFINITY; if layers.depth { width } else { 0 }],
            bad: vec![0; if layers.bad { width } else { 0 }],
        }
    }

    /// The sum of an index.
    fn get(&self, at: usize) -> Wide {
        let carry = if self.carries.is_empty() { None } else { self.carries.get(&at) };
        Wide { low: self.sums[at], carry: carry.copied().unwrap_or(0) }
    }

    /// Adds values, in quanta of 1/`units`, to the sums from `first` on.
    fn add(&mut self, first: usize, values: &[f64], units: &[f64]) {
        let Row { sums, carries, .. } = self;
        let cell = sums[first..first + values.len()].iter_mut().enumerate();
        for (((k, sum), value), unit) in cell.zip(values).zip(units) {
            // Most groups have no sample in a pass.
            if *value == 0.0 {
                continue;
            }
            let added = Wide::rounded(value * unit);
            match sum.checked_add(added.low) {
                Some(total) if added.carry == 0 => *sum = total,
                _ => add_wide(sum, carries, first + k, added),
            }
        }
    }

    fn set(&mut self, at: usize, value: Wide) {
        self.sums[at] = value.low;
        if value.carry == 0 {
            self.carries.remove(&at);
        } else {
            self.carries.insert(at, value.carry);
        }
    }

    /// Adds a sum to another and empties it.
    fn empty_into(&mut self, from: usize, to: usize) {
        match self.sums[to].checked_add(self.sums[from]) {
            Some(total) if self.carries.is_empty() => self.sums[to] = total,
            _ => {
                let total = self.get(to).plus(self.get(from));
                self.set(to, total);
                self.carries.remove(&from);
            }
        }
        self.sums[from] = 0;
    }
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
    /// An empty film. `scale` is the order of magnitude of the radiance; it is
    /// rounded to a power of two. Radiance is summed with a quantum of 2^-63
    /// times it (less where lights differ by more than 2^20), and samples above
    /// 2^48 times it are not taken.
    #[must_use]
    pub fn new(spec: FilmSpec, layers: LayerSet, scale: impl Into<Scale>) -> Film {
        Film::grouped(spec, layers, scale, Groups::Halves)
    }

    /// As [`Film::new`], with the samples kept apart as `groups` says.
    #[must_use]
    pub fn grouped(spec: FilmSpec, layers: LayerSet, scale: impl Into<Scale>, groups: Groups) -> Film {
        let layout = Layout::new(layers, groups);
        let scale = scale.into();
        let radiance = scale.radiance();
        let one = 2f64.powi(FRACTION_BITS);
        let mut units = vec![one; layout.stride];
        for group in units[..layout.extras].chunks_exact_mut(PER_GROUP) {
            group[1..].fill(one / scale.unit());
        }
        if let Some(at) = layout.moment {
            units[at..at + 3].fill(one / radiance / radiance);
        }
        let limits =
            Limits { radiance: Film::largest_radiance(scale), position: 2f64.powi(POSITION_BITS) as f32 };
        let window = spec.stored();
        let rows = (0..window.height())
            .map(|_| Mutex::new(Row::new(window.width(), layout.stride, layers)))
            .collect();
        Film { spec, layers, layout, units, limits, sharing: 1.0, rows }
    }

    /// As if groups of that many pixels had all of their noise in common: what is known of
    /// the error of the picture rests on fewer pixels.
    #[must_use]
    pub fn with_shared_noise(self, pixels: u32) -> Film {
        Film { sharing: f64::from(pixels.max(1)), ..self }
    }

    /// The largest radiance of a sample that a film of this scale takes; a
    /// sample with more is left out.
    #[must_use]
    pub fn largest_radiance(scale: impl Into<Scale>) -> f32 {
        (2f64.powi(LIMIT_BITS) * scale.into().radiance()).min(f64::from(f32::MAX)) as f32
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
        self.tiles_of(TILE_SIZE)
    }

    /// The same, with tiles of another size.
    #[must_use]
    pub fn tiles_of(&self, side: i32) -> Vec<Rect> {
        let bounds = self.sample_bounds();
        let starts = |min: i32, max: i32| {
            (min.div_euclid(side)..).map(move |k| k * side).take_while(move |start| *start < max)
        };
        let mut tiles = Vec::new();
        for y in starts(bounds.min.1, bounds.max.1) {
            for x in starts(bounds.min.0, bounds.max.0) {
                tiles.push(Rect::new(x, y, side as u32, side as u32).intersect(&bounds));
            }
        }
        tiles
    }

    /// Empty sums for the samples of some pixels.
    #[must_use]
    pub fn tile(&self, rect: Rect) -> Tile {
        Tile::new(rect, self.spec.stored(), self.spec.filter, self.layout, self.layers, self.limits)
    }

    /// To be called before sample `next` of each pixel is merged, and after all
    /// before it: at powers of two the older of the two newest levels of samples
    /// joins the old ones. Exact. A film that is not told compares other parts
    /// of its samples, which are not as well spread.
    pub fn advance(&self, next: u64) {
        let Some(slot) = old_slot(next).filter(|_| self.layout.groups == Groups::Halves) else { return };
        for y in 0..self.rows.len() {
            let mut row = self.row(y);
            for cell in (0..row.sums.len()).step_by(self.layout.stride) {
                for k in cell..cell + PER_GROUP {
                    row.empty_into(k + slot * PER_GROUP, k);
                }
            }
        }
    }

    /// Adds the sums of a tile of this film: each is rounded to fixed point
    /// once, then the order of merges does not matter.
    pub fn merge(&self, tile: &Tile) {
        debug_assert!(tile.layout == self.layout, "a tile of another film");
        let (area, window, stride) = (tile.area, self.spec.stored(), self.layout.stride);
        for (y, sums) in (area.min.1..area.max.1).zip(tile.sums.chunks_exact((area.width() * stride).max(1)))
        {
            let mut row = self.row((y - window.min.1) as usize);
            let first = (area.min.0 - window.min.0) as usize;
            for (x, added) in sums.chunks_exact(stride).enumerate() {
                row.add((first + x) * stride, added, &self.units);
            }
            let columns = || area.index((area.min.0, y))..area.index((area.min.0, y)) + area.width();
            if self.layers.depth {
                for (closest, z) in row.depth[first..].iter_mut().zip(&tile.depth[columns()]) {
                    *closest = closest.min(*z);
                }
            }
            if self.layers.bad {
                for (count, more) in row.bad[first..].iter_mut().zip(&tile.bad[columns()]) {
                    *count = count.saturating_add(*more);
                }
            }
        }
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
        let unfiltered = usize::from(layers.depth) + usize::from(layers.bad);
        let pixel = stride * size_of::<i128>() + unfiltered * size_of::<f32>();
        spec.stored().area() * pixel
    }

    /// The picture as it is now. A pixel whose weights do not sum to more than
    /// zero is 0; what is beyond f32 (a mean square, or a mean where a filter's
    /// negative lobes leave little weight) is the largest f32.
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
            for x in columns.clone() {
                let pixel = self.pixel(&row, x);
                let values = pixel.mean.into_iter().chain(pixel.layers(&self.layout));
                for (channel, value) in channels.iter_mut().zip(values) {
                    channel.data.push(to_f32(value));
                }
                let unfiltered = &mut channels[3 + self.layout.stride - self.layout.extras..];
                if self.layers.depth {
                    unfiltered[0].data.push(row.depth[x]);
                }
                if self.layers.bad {
                    unfiltered[usize::from(self.layers.depth)].data.push(row.bad[x] as f32);
                }
            }
        }
        if self.layers.error {
            let first = channels.len() - 3;
            self.scan(|_, estimates| {
                for pixel in estimates {
                    for (channel, v) in channels[first..].iter_mut().zip(pixel.variance) {
                        channel.data.push(to_f32(v.sqrt()));
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
        add(self.layers.bad, &["bad"]);
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
        let row = self.row(y);
        (0..row.sums.len() / self.layout.stride).map(|x| self.pixel(&row, x)).collect()
    }

    /// The sums of a pixel as floats. All groups are added before rounding.
    fn pixel(&self, row: &Row, x: usize) -> PixelSums {
        let (first, groups) = (x * self.layout.stride, self.layout.extras);
        let total: [f64; PER_GROUP] = std::array::from_fn(|k| {
            let sums = (k..groups).step_by(PER_GROUP).map(|at| row.get(first + at));
            sums.fold(Wide::default(), Wide::plus).to_f64() / self.units[k]
        });
        let weight = total[0];
        let over = |sum: f64| if weight > 0.0 { sum / weight } else { 0.0 };
        let float = |at: usize| row.get(first + at).to_f64() / self.units[at];
        let mut extras = [0.0; MAX_EXTRAS];
        for (out, at) in extras.iter_mut().zip(groups..self.layout.stride) {
            *out = over(float(at));
        }
        let sums =
            (0..groups).step_by(PER_GROUP).map(|at| -> Sums { std::array::from_fn(|k| float(at + k)) });
        PixelSums {
            weight,
            mean: [1, 2, 3].map(|k| over(total[k])),
            noise: self.layout.groups.noise(sums),
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

/// Adds what does not fit to the sum of an index.
#[cold]
fn add_wide(sum: &mut i128, carries: &mut BTreeMap<usize, i128>, at: usize, added: Wide) {
    let carry = carries.remove(&at).unwrap_or(0);
    let total = Wide { low: *sum, carry }.plus(added);
    *sum = total.low;
    if total.carry != 0 {
        carries.insert(at, total.carry);
    }
}

/// Never infinite for what is finite.
fn to_f32(value: f64) -> f32 {
    if value.is_finite() {
        value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
    } else {
        value as f32
    }
}
