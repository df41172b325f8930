//! Meshes that deform while the shutter is open: vertices at several times,
//! linear between them.

use std::ops::Range;

use super::{Geometry, Hit, PrimId, RayProbe, ShapeId, SurfacePoint, triangle};
use crate::desc::MeshKey;
use crate::math::{Bounds, Vec3};

/// The times of one deforming mesh. Its vertices stand in the geometry's
/// arrays once for each of them, one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Deformation {
    /// Rising, from 0 to 1.
    pub times: Vec<f32>,
    /// Vertices at each time.
    pub stride: u32,
}

/// Between which two sets of vertices a time is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Between {
    /// What is added to the index of a vertex in each set.
    offset: [u32; 2],
    weight: f32,
}

impl Deformation {
    pub fn at(&self, time: f32) -> Between {
        let last = self.times.len() - 1;
        let next = self.times.partition_point(|t| *t <= time).clamp(1, last);
        let (a, b) = (self.times[next - 1], self.times[next]);
        let offset = [next as u32 - 1, next as u32].map(|k| k * self.stride);
        Between { offset, weight: ((time - a) / (b - a)).clamp(0.0, 1.0) }
    }
}

impl Between {
    /// A vertex's value.
    #[inline]
    pub fn of(&self, values: &[Vec3], index: usize) -> Vec3 {
        let [a, b] = self.offset.map(|o| values[index + o as usize]);
        a + (b - a) * self.weight
    }
}

impl Geometry {
    /// Triangles that deform.
    #[must_use]
    pub fn moving_count(&self) -> u32 {
        self.moving.len() as u32
    }

    /// Index of a primitive among the deforming triangles.
    pub(crate) fn moving_index(&self, prim: PrimId) -> Option<usize> {
        let index = (prim as usize).checked_sub(self.triangles.len() + self.analytic.len())?;
        (index < self.moving.len()).then_some(index)
    }

    pub(crate) fn between(&self, shape: ShapeId, time: f32) -> Option<Between> {
        let index = self.shapes[shape as usize].deformation?;
        Some(self.deformations[index as usize].at(time))
    }

    /// The vertices of a deforming triangle at a time of the shutter.
    pub(crate) fn moving_triangle(&self, index: usize, time: f32) -> [Vec3; 3] {
        self.moving_vertices(index, self.between(self.moving_shapes[index], time))
    }

    /// The times, from 0 to 1 and rising, at which what deforms in a part may turn.
    pub(crate) fn key_times(&self, part: u32) -> Vec<f32> {
        let mut times = vec![0.0, 1.0];
        let mut last = None;
        for index in self.parts[part as usize].moving.clone() {
            let deformation = self.shapes[self.moving_shapes[index as usize] as usize].deformation;
            if deformation != last {
                times.extend(deformation.iter().flat_map(|d| &self.deformations[*d as usize].times));
            }
            last = deformation;
        }
        times.sort_unstable_by(f32::total_cmp);
        times.dedup();
        times
    }

    /// Whether nothing of a part turns between two times.
    pub(crate) fn goes_straight(&self, part: u32, [start, end]: [f32; 2]) -> bool {
        !self.key_times(part).iter().any(|key| start < *key && *key < end)
    }

    /// Calls `put` with the place, the index of the deformation and the vertices at the
    /// keys before and after a time of each primitive that is a deforming triangle.
    pub(crate) fn keys_around(
        &self,
        prims: &[PrimId],
        time: f32,
        mut put: impl FnMut(usize, u32, [[Vec3; 3]; 2]),
    ) {
        for (place, prim) in prims.iter().enumerate() {
            let Some(index) = self.moving_index(*prim) else { continue };
            let shape = &self.shapes[self.moving_shapes[index] as usize];
            let Some(deformation) = shape.deformation else { continue };
            let [a, b] = self.deformations[deformation as usize].at(time).offset;
            let vertices = |offset: u32| self.moving[index].map(|i| self.positions[(i + offset) as usize]);
            put(place, deformation, [vertices(a), vertices(b)]);
        }
    }

    /// How far from the key before a time to the next it is.
    pub(crate) fn key_weight(&self, deformation: u32, time: f32) -> f32 {
        self.deformations[deformation as usize].at(time).weight
    }

    /// The primitives that are deforming triangles.
    #[inline]
    pub(crate) fn deforming(&self) -> Range<PrimId> {
        let first = (self.triangles.len() + self.analytic.len()) as PrimId;
        first..first + self.moving.len() as PrimId
    }

    /// Calls `put` with the place and the vertices at a time of the shutter of
    /// each primitive that is a deforming triangle.
    pub(crate) fn deformed(&self, prims: &[PrimId], time: f32, mut put: impl FnMut(usize, [Vec3; 3])) {
        let deforming = self.deforming();
        let mut last: Option<(ShapeId, Option<Between>)> = None;
        for (place, prim) in prims.iter().enumerate().filter(|(_, prim)| deforming.contains(prim)) {
            let index = (prim - deforming.start) as usize;
            let shape = self.moving_shapes[index];
            // Neighbours are mostly of one shape.
            let between = match last {
                Some((same, between)) if same == shape => between,
                _ => self.between(shape, time),
            };
            last = Some((shape, between));
            put(place, self.moving_vertices(index, between));
        }
    }

    fn moving_vertices(&self, index: usize, between: Option<Between>) -> [Vec3; 3] {
        match between {
            Some(between) => self.moving[index].map(|i| between.of(&self.positions, i as usize)),
            None => self.moving[index].map(|i| self.positions[i as usize]),
        }
    }

    /// Where a ray meets a deforming triangle or a curve; `None` for other
    /// primitives.
    #[cold]
    pub(crate) fn intersect_moving(&self, prim: PrimId, probe: &RayProbe, t_max: f32) -> Option<Hit> {
        let Some(index) = self.moving_index(prim) else {
            return self.intersect_curve(prim, probe, t_max);
        };
        let vertices = self.moving_triangle(index, probe.time);
        Geometry::intersect_triangle(prim, &vertices, probe, t_max)
    }

    #[cold]
    pub(crate) fn moving_surface(&self, index: usize, hit: &Hit, time: f32) -> SurfacePoint {
        let vertices = self.moving_triangle(index, time);
        let shape = self.moving_shapes[index];
        self.face_surface::<true>(shape, hit, (vertices, self.moving[index]), time, self.between(shape, time))
    }

    /// The box of a deforming triangle between two times of the shutter: its
    /// vertices go straight from key to key, so their boxes at the ends and at
    /// the keys between are enough; widened once more for the interpolation.
    pub(crate) fn moving_bounds(&self, index: usize, [start, end]: [f32; 2]) -> Bounds {
        let shape = self.moving_shapes[index];
        let at = |time: f32| triangle::bounds(&self.moving_triangle(index, time));
        let deformation = self.shapes[shape as usize].deformation.map(|i| &self.deformations[i as usize]);
        let keys = deformation.iter().flat_map(|d| &d.times).copied().filter(|t| *t > start && *t < end);
        triangle::widen(keys.map(at).fold(at(start).union(at(end)), Bounds::union))
    }
}

/// The keys of a mesh during [`open`, `close`], with time stretched to [0, 1]:
/// what lies between two keys is interpolated. One key when nothing moves.
pub(crate) fn during(keys: &[MeshKey], open: f64, close: f64) -> Vec<MeshKey> {
    if !(close > open) || keys.len() == 1 {
        return vec![MeshKey { time: 0.0, ..at(keys, open) }];
    }
    let inside = keys.iter().filter(|k| k.time > open && k.time < close).cloned();
    let all = std::iter::once(at(keys, open)).chain(inside).chain(std::iter::once(at(keys, close)));
    let all: Vec<_> = all.map(|k| MeshKey { time: (k.time - open) / (close - open), ..k }).collect();
    let same = |k: &MeshKey| k.positions == all[0].positions && k.normals == all[0].normals;
    if all.iter().all(same) { all[..1].to_vec() } else { all }
}

/// The mesh at a time; it stands still before its first and after its last key.
fn at(keys: &[MeshKey], time: f64) -> MeshKey {
    let next = keys.partition_point(|k| k.time <= time);
    if next == 0 || next == keys.len() {
        return MeshKey { time, ..keys[next.min(keys.len() - 1)].clone() };
    }
    let (a, b) = (&keys[next - 1], &keys[next]);
    let weight = ((time - a.time) / (b.time - a.time)) as f32;
    let mix = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| a.lerp(*b, weight)).collect();
    MeshKey { time, positions: mix(&a.positions, &b.positions), normals: mix(&a.normals, &b.normals) }
}
