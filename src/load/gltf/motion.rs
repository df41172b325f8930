//! Animations: tracks of key frames, poses at times, and how many of them a
//! shutter needs.
//!
//! Interpolation as in the glTF specification, appendix C: step, linear (slerp
//! for rotations), cubic Hermite splines.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use super::super::LoadOptions;
use super::json::{Animation, AnimationSampler, Channel};
use super::nodes::Hierarchy;
use super::source::Source;
use super::{choose, fail};
use crate::desc::Result;
use crate::math::{DMat4, DQuat};

/// Most keys of one moving thing: 64 stretches.
const MAX_KEYS: usize = 65;
/// How far off the middle of a stretch may be, as a share of the thing's size.
pub const TOLERANCE: f64 = 1e-4;
/// Bytes of poses that are kept.
const POSE_BYTES: usize = 256 << 20;

/// What a channel animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Path {
    /// Where a node is.
    Translation,
    /// How it is turned.
    Rotation,
    /// How large it is.
    Scale,
    /// Of the morph targets of its mesh.
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    Cubic,
}

/// One animated property.
#[derive(Debug)]
struct Track {
    node: usize,
    path: Path,
    times: Vec<f64>,
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

/// All animated properties.
#[derive(Debug, Default)]
pub struct Tracks {
    tracks: Vec<Track>,
}

impl Tracks {
    /// The tracks of the animations that the options choose: none as long as
    /// no time is asked for.
    pub fn read(source: &Source, options: &LoadOptions, warnings: &mut Vec<String>) -> Result<Tracks> {
        let animations = &source.root.animations;
        let chosen: Vec<usize> = match options.animation.as_deref() {
            None if !options.asks_for_time() => Vec::new(),
            None | Some("all") => (0..animations.len()).collect(),
            Some("none") => Vec::new(),
            Some(name) => {
                vec![choose("animation", name, animations.iter().map(|a| a.name.as_str()))?]
            }
        };
        let mut tracks: Vec<Track> = Vec::new();
        let mut known: HashMap<(usize, Path), usize> = HashMap::new();
        let mut twice = 0;
        for index in chosen {
            let animation = &animations[index];
            for (k, channel) in animation.channels.iter().enumerate() {
                let place = format!("animations[{index}].channels[{k}]");
                let Some(track) = Track::read(source, animation, (index, channel), &place, warnings)? else {
                    continue;
                };
                match known.entry((track.node, track.path)) {
                    std::collections::hash_map::Entry::Occupied(at) => {
                        twice += 1;
                        tracks[*at.get()] = track;
                    }
                    std::collections::hash_map::Entry::Vacant(at) => {
                        at.insert(tracks.len());
                        tracks.push(track);
                    }
                }
            }
        }
        if twice > 0 {
            warnings.push(format!(
                "{}: {twice} properties are animated by several animations; the last one holds (--animation chooses one)",
                source.name
            ));
        }
        Ok(Tracks { tracks })
    }

    /// Calls `f` with (node, path, value) of all animated transforms.
    pub fn transforms(&self, time: f64, mut f: impl FnMut(usize, Path, &[f64])) {
        for track in self.tracks.iter().filter(|t| t.path != Path::Weights) {
            f(track.node, track.path, &track.at(time));
        }
    }

    /// Animated weights of a node's morph targets.
    pub fn weights(&self, node: usize, time: f64) -> Option<Vec<f64>> {
        let track = self.tracks.iter().find(|t| t.node == node && t.path == Path::Weights)?;
        Some(track.at(time))
    }

    /// For each node, whether its own transform is animated.
    pub fn moving(&self, nodes: usize) -> Vec<bool> {
        let mut moving = vec![false; nodes];
        for track in self.tracks.iter().filter(|t| t.path != Path::Weights && t.times.len() > 1) {
            moving[track.node] = true;
        }
        moving
    }

    /// Times of key frames strictly between two times, rising, without the
    /// ones that are closer together than any shutter could tell.
    fn keys_between(&self, open: f64, close: f64) -> Vec<f64> {
        let mut times: Vec<f64> = self
            .tracks
            .iter()
            .flat_map(|t| t.times.iter().copied())
            .filter(|t| *t > open && *t < close)
            .collect();
        times.sort_by(f64::total_cmp);
        let least = (close - open) * 1e-6;
        times.dedup_by(|b, a| *b - *a < least);
        times.retain(|t| t - open >= least && close - t >= least);
        times
    }
}

impl Track {
    fn read(
        source: &Source,
        animation: &Animation,
        (index, channel): (usize, &Channel),
        place: &str,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Track>> {
        let path = match channel.target.path.as_str() {
            "translation" => Path::Translation,
            "rotation" => Path::Rotation,
            "scale" => Path::Scale,
            "weights" => Path::Weights,
            other => {
                warnings.push(format!("{}: {place}.target.path: `{other}` is not animated", source.name));
                return Ok(None);
            }
        };
        // A channel without a node is for an extension.
        let Some(node) = channel.target.node else { return Ok(None) };
        if node >= source.root.nodes.len() {
            return Err(fail(&format!("{place}.target.node"), format!("there is no nodes[{node}]")));
        }
        let Some(sampler) = animation.samplers.get(channel.sampler) else {
            return Err(fail(place, format!("there is no samplers[{}]", channel.sampler)));
        };
        let place = format!("animations[{index}].samplers[{}]", channel.sampler);
        Track::sampled(source, sampler, (node, path), &place).map(Some)
    }

    fn sampled(
        source: &Source,
        sampler: &AnimationSampler,
        target: (usize, Path),
        place: &str,
    ) -> Result<Track> {
        let (node, path) = target;
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::Cubic,
            Some(other) => return Err(fail(place, format!("`interpolation` `{other}` is unknown"))),
        };
        let times = source.vectors::<1>(sampler.input, &format!("{place}.input"))?;
        let times: Vec<f64> = times.into_iter().map(|[t]| f64::from(t)).collect();
        if times.windows(2).any(|t| t[0] > t[1]) {
            return Err(fail(&format!("{place}.input"), "the times of key frames must rise"));
        }
        let place = format!("{place}.output");
        let values = match path {
            Path::Translation | Path::Scale => source.vectors::<3>(sampler.output, &place)?.into_flattened(),
            Path::Rotation => source.vectors::<4>(sampler.output, &place)?.into_flattened(),
            Path::Weights => source.vectors::<1>(sampler.output, &place)?.into_flattened(),
        };
        let per_key = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        let width = match path {
            Path::Translation | Path::Scale => 3,
            Path::Rotation => 4,
            Path::Weights => values.len() / (times.len() * per_key),
        };
        if width == 0 || values.len() != times.len() * width * per_key {
            let message = format!("{} numbers do not go with {} key frames", values.len(), times.len());
            return Err(fail(&place, message));
        }
        Ok(Track { node, path, times, values, width, interpolation })
    }

    /// Value `part` of a key: with splines 0 is the tangent before, 1 the value
    /// and 2 the tangent after.
    fn key(&self, key: usize, part: usize) -> impl Iterator<Item = f64> + '_ {
        let at = match self.interpolation {
            Interpolation::Cubic => (key * 3 + part) * self.width,
            _ => key * self.width,
        };
        self.values[at..at + self.width].iter().map(|v| f64::from(*v))
    }

    fn at(&self, time: f64) -> Vec<f64> {
        let next = self.times.partition_point(|t| *t <= time);
        let value = |key: usize| self.unit(self.key(key, 1).collect());
        if next == 0 {
            return value(0);
        }
        if next == self.times.len() || self.interpolation == Interpolation::Step {
            return value(next - 1);
        }
        let (a, span) = (next - 1, self.times[next] - self.times[next - 1]);
        let s = (time - self.times[a]) / span;
        if self.interpolation == Interpolation::Cubic {
            let (s2, s3) = (s * s, s * s * s);
            let mix = [
                2.0 * s3 - 3.0 * s2 + 1.0,
                span * (s3 - 2.0 * s2 + s),
                3.0 * s2 - 2.0 * s3,
                span * (s3 - s2),
            ];
            let points = self.key(a, 1).zip(self.key(a, 2)).zip(self.key(next, 1).zip(self.key(next, 0)));
            let spline = points.map(|((p, m), (q, n))| mix[0] * p + mix[1] * m + mix[2] * q + mix[3] * n);
            return self.unit(spline.collect());
        }
        let (from, to) = (value(a), value(next));
        if self.path == Path::Rotation {
            // The shorter way round: glam's slerp takes it.
            return quaternion(&from).slerp(quaternion(&to), s).to_array().to_vec();
        }
        from.iter().zip(to).map(|(p, q)| p + (q - p) * s).collect()
    }

    /// Rotations made unit quaternions.
    fn unit(&self, value: Vec<f64>) -> Vec<f64> {
        if self.path != Path::Rotation {
            return value;
        }
        let q = quaternion(&value);
        let length = q.length();
        if length > 1e-9 { (q / length).to_array().to_vec() } else { DQuat::IDENTITY.to_array().to_vec() }
    }
}

fn quaternion(value: &[f64]) -> DQuat {
    match value {
        &[x, y, z, w] => DQuat::from_xyzw(x, y, z, w),
        _ => DQuat::IDENTITY,
    }
}

/// When the picture is taken, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    /// Where it opens; `None` shows the scene as stored, without animation.
    pub open: Option<f64>,
    /// Where it closes.
    pub close: f64,
}

impl Shutter {
    /// From the options: frames over frames per second.
    pub fn of(options: &LoadOptions) -> Shutter {
        let [open, close] = options.shutter.unwrap_or([0.0; 2]);
        let frame = options.frame.unwrap_or(0.0);
        let open_seconds = (frame + open) / options.fps;
        let asked = options.asks_for_time() || options.animation.is_some();
        Shutter { open: asked.then_some(open_seconds), close: (frame + close) / options.fps }
    }

    /// Both times, when there is time between them.
    fn span(self) -> Option<(f64, f64)> {
        self.open.filter(|open| *open < self.close).map(|open| (open, self.close))
    }
}

/// The nodes over time.
pub struct Stage {
    /// The nodes.
    pub hierarchy: Hierarchy,
    /// What is animated.
    pub tracks: Tracks,
    /// When.
    pub shutter: Shutter,
    /// For each node, whether its place in the world changes.
    pub moving: Vec<bool>,
    breaks: Vec<f64>,
    poses: RefCell<HashMap<u64, Rc<Vec<DMat4>>>>,
    still: Rc<Vec<DMat4>>,
}

impl Stage {
    /// Ready to be asked for poses.
    pub fn new(hierarchy: Hierarchy, tracks: Tracks, shutter: Shutter) -> Stage {
        let still = Rc::new(hierarchy.worlds(&tracks, shutter.open));
        let nodes = still.len();
        let (breaks, moving) = match shutter.span() {
            Some((open, close)) => (tracks.keys_between(open, close), hierarchy.below(tracks.moving(nodes))),
            None => (Vec::new(), vec![false; nodes]),
        };
        Stage { hierarchy, tracks, shutter, moving, breaks, poses: RefCell::default(), still }
    }

    /// Every node to the world when the shutter opens.
    pub fn still(&self) -> Rc<Vec<DMat4>> {
        self.still.clone()
    }

    /// Every node to the world at a time.
    pub fn pose(&self, time: f64) -> Rc<Vec<DMat4>> {
        if self.shutter.open.is_none() {
            return self.still();
        }
        let mut poses = self.poses.borrow_mut();
        if poses.len() * self.still.len() * size_of::<DMat4>() > POSE_BYTES {
            poses.clear();
        }
        let pose = poses.entry(time.to_bits());
        pose.or_insert_with(|| Rc::new(self.hierarchy.worlds(&self.tracks, Some(time)))).clone()
    }

    /// Something at as many times of the shutter as it takes: at the key
    /// frames, and halved as long as `off` says that between two neighbours, at
    /// a share of the way, the truth (its last argument) is too far off.
    pub fn sampled<T>(
        &self,
        mut at: impl FnMut(f64) -> T,
        off: impl Fn(&T, &T, f64, &T) -> bool,
    ) -> Vec<(f64, T)> {
        let Some((open, close)) = self.shutter.span() else {
            let time = self.shutter.open.unwrap_or(0.0);
            return vec![(time, at(time))];
        };
        let times = std::iter::once(open).chain(self.breaks.iter().copied()).chain(std::iter::once(close));
        let most = self.breaks.len() + 2;
        // Too many key frames: as many as there may be, evenly.
        let stride = most.div_ceil(MAX_KEYS);
        let last = most - 1;
        let mut keys: Vec<(f64, T)> = times
            .enumerate()
            .filter(|(i, _)| i % stride == 0 || *i == last)
            .map(|(_, time)| (time, at(time)))
            .collect();
        let mut open_stretches: Vec<bool> = vec![true; keys.len() - 1];
        while open_stretches.contains(&true) && keys.len() < MAX_KEYS {
            let mut i = 0;
            while i < open_stretches.len() && keys.len() < MAX_KEYS {
                if !std::mem::take(&mut open_stretches[i]) {
                    i += 1;
                    continue;
                }
                let (from, to) = (keys[i].0, keys[i + 1].0);
                // Not evenly spaced, so that no whole number of turns hides.
                let is_off = [0.5, 0.13, 0.71, 0.37, 0.89].iter().any(|s| {
                    let truth = at(from + (to - from) * s);
                    off(&keys[i].1, &keys[i + 1].1, *s, &truth)
                });
                if is_off {
                    let middle = from + (to - from) * 0.5;
                    keys.insert(i + 1, (middle, at(middle)));
                    open_stretches[i] = true;
                    open_stretches.insert(i + 1, true);
                    i += 1;
                }
                i += 1;
            }
        }
        keys
    }
}
