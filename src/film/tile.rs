//! The sums of one pass over one tile.

use super::filter::{Filter, MAX_TAPS, Taps};
use super::groups::PER_GROUP;
use super::layers::{LayerSet, Layout, MAX_EXTRAS, PixelSample};
use super::rect::Rect;
use crate::math::Vec2;

/// Sums of weighted samples, in f64, over the pixels of a tile and those
/// around it that its samples reach. Made by [`super::Film::tile`], reused by
/// [`Tile::reset`], one per thread.
#[derive(Clone, Debug)]
pub struct Tile {
    rect: Rect,
    pub(super) area: Rect,
    crop: Rect,
    filter: Filter,
    pub(super) layout: Layout,
    layers: LayerSet,
    limits: Limits,
    pub(super) sums: Vec<f64>,
    pub(super) depth: Vec<f32>,
    pub(super) bad: Vec<u32>,
    /// Room for the weights of one sample along x and y.
    scratch: [[f64; MAX_TAPS]; 2],
    /// Room for what a sample adds beyond the groups.
    extras: [f64; MAX_EXTRAS],
}

/// Largest values a sample may have, so that sums stay in range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// A sample of more is left out.
    pub radiance: f32,
    /// Positions and motion are held to it.
    pub position: f32,
}

impl Tile {
    pub(super) fn new(
        rect: Rect,
        crop: Rect,
        filter: Filter,
        layout: Layout,
        layers: LayerSet,
        limits: Limits,
    ) -> Tile {
        let mut tile = Tile {
            rect,
            area: Rect::default(),
            crop,
            filter,
            layout,
            layers,
            limits,
            sums: Vec::new(),
            depth: Vec::new(),
            bad: Vec::new(),
            scratch: [[0.0; MAX_TAPS]; 2],
            extras: [0.0; MAX_EXTRAS],
        };
        tile.reset(rect);
        tile
    }

    /// Empties the tile and moves it to other pixels.
    pub fn reset(&mut self, rect: Rect) {
        self.rect = rect;
        self.area = rect.grow(self.filter.reach()).intersect(&self.crop);
        self.sums.clear();
        self.sums.resize(self.area.area() * self.layout.stride, 0.0);
        self.depth.clear();
        if self.layers.depth {
            self.depth.resize(self.area.area(), f32::INFINITY);
        }
        self.bad.clear();
        if self.layers.bad {
            self.bad.resize(self.area.area(), 0);
        }
    }

    /// The pixels to sample.
    #[must_use]
    pub fn rect(&self) -> Rect {
        self.rect
    }

    /// Marks in the layer `bad` that a sample of `pixel` was left out.
    pub fn leave_out(&mut self, pixel: (i32, i32)) {
        if self.layers.bad && self.area.contains(pixel) {
            let count = &mut self.bad[self.area.index(pixel)];
            *count = count.saturating_add(1);
        }
    }

    /// Adds sample `index` of `pixel`, taken at `offset` in [0, 1)² from the
    /// pixel's upper left corner, to all pixels that the filter reaches. False,
    /// and nothing is added, when its radiance is beyond what the film can sum
    /// ([`Film::largest_radiance`](super::Film::largest_radiance)): the caller
    /// counts it.
    ///
    /// The order of calls is the order of the sums: the caller keeps it fixed.
    pub fn add(&mut self, pixel: (i32, i32), offset: Vec2, index: u64, sample: &PixelSample) -> bool {
        debug_assert!(sample.is_valid(), "{sample:?} at pixel {pixel:?}, sample {index}");
        debug_assert!(self.rect.contains(pixel), "pixel {pixel:?} outside {:?}", self.rect);
        // So written that NaN fails.
        if !(sample.rgb.abs().cmple(crate::math::Vec3::splat(self.limits.radiance)).all()) {
            return false;
        }
        if self.layers.depth && self.area.contains(pixel) {
            let depth = &mut self.depth[self.area.index(pixel)];
            *depth = depth.min(sample.depth);
        }

        let [scratch_x, scratch_y] = &mut self.scratch;
        let (columns, rows) = (self.filter.taps(offset.x, scratch_x), self.filter.taps(offset.y, scratch_y));
        let Some((x0, wx)) = clip(&columns, pixel.0, self.area.min.0, self.area.max.0) else { return true };
        let Some((y0, wy)) = clip(&rows, pixel.1, self.area.min.1, self.area.max.1) else { return true };
        let group = self.layout.groups.of(index) * PER_GROUP;
        let [r, g, b] = sample.rgb.as_dvec3().to_array();
        let count = self.layout.write_extras(sample, &self.limits, &mut self.extras);
        let (values, extras) = ([1.0, r, g, b], &self.extras[..count]);
        let (stride, first_extra) = (self.layout.stride, self.layout.extras);
        for (row, wy) in wy.iter().enumerate() {
            let first = self.area.index((x0, y0 + row as i32)) * stride;
            let cells = self.sums[first..first + wx.len() * stride].chunks_exact_mut(stride);
            for (cell, wx) in cells.zip(wx) {
                let (groups, others) = cell.split_at_mut(first_extra);
                splat(&mut groups[group..group + PER_GROUP], others, wx * wy, (&values, extras));
            }
        }
        true
    }
}

/// Adds weighted values to the sums of one pixel.
#[inline(always)]
fn splat(group: &mut [f64], others: &mut [f64], weight: f64, (values, extras): (&[f64; PER_GROUP], &[f64])) {
    for (sum, value) in group.iter_mut().zip(values) {
        *sum += weight * value;
    }
    for (sum, value) in others.iter_mut().zip(extras) {
        *sum += weight * value;
    }
}

/// The part of the taps around pixel `own` that falls into `min..max`: its
/// first pixel and the weights.
fn clip<'a>(taps: &Taps<'a>, own: i32, min: i32, max: i32) -> Option<(i32, &'a [f64])> {
    let start = own + taps.first;
    let end = start + taps.weights.len() as i32;
    let (from, to) = (start.max(min), end.min(max));
    (from < to).then(|| (from, &taps.weights[(from - start) as usize..(to - start) as usize]))
}
