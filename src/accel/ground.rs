//! The primitives that are not still triangles, and the groups behind
//! instances.

use super::Tree;
use super::build::Item;
use crate::math::Ray;
use crate::shape::{Geometry, Hit, PrimId, RayProbe};

/// A geometry with the trees of its groups: what a traversal asks when it has
/// reached something that is no still triangle.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    pub geometry: &'a Geometry,
    pub groups: &'a [Group],
}

/// The trees of a group: one for each slice of the shutter, so that what deforms
/// has tight boxes; a single one when nothing does.
#[derive(Clone, Debug)]
pub struct Group {
    pub slices: Vec<Tree>,
    /// When each slice but the first begins.
    pub starts: Vec<f32>,
}

/// Most slices of the shutter.
const MAX_SLICES: u32 = 16;

impl Group {
    /// The tree for a time of the shutter.
    #[inline]
    fn at(&self, time: f32) -> Option<&Tree> {
        self.slices.get(self.starts.partition_point(|start| *start <= time))
    }
}

/// What a tree is built over: a part of a geometry during a slice of the
/// shutter.
#[derive(Clone, Copy, Debug)]
pub struct Slice {
    pub part: u32,
    pub times: [f32; 2],
}

impl Slice {
    /// The top of the scene.
    pub const TOP: Slice = Slice { part: 0, times: [0.0, 1.0] };

    /// The slices of a part for trees whose boxes move along: from key to key, or over
    /// several keys where there are too many.
    pub fn from_key_to_key(geometry: &Geometry, part: u32) -> Vec<Slice> {
        let keys = geometry.key_times(part);
        let several = (keys.len() - 1).div_ceil(MAX_SLICES as usize);
        let mut ends: Vec<f32> = keys.iter().copied().step_by(several.max(1)).collect();
        if ends.last() != keys.last() {
            ends.extend(keys.last());
        }
        ends.windows(2).map(|ends| Slice { part, times: [ends[0], ends[1]] }).collect()
    }

    /// The slices of a part for trees whose boxes stand still: so many that no
    /// triangle moves by much more than its own size during one.
    pub fn of_part(geometry: &Geometry, part: u32) -> Vec<Slice> {
        let mut count = 1;
        if geometry.part_deforms(part) {
            // Sizes of boxes at the start and over the whole shutter.
            let (mut still, mut swept) = (0.0, 0.0);
            for prim in geometry.part_prims(part) {
                let size = |times| f64::from(geometry.prim_bounds_during(prim, times).half_area()).sqrt();
                still += size([0.0, 0.0]);
                swept += size([0.0, 1.0]);
            }
            let growth = if still > 0.0 { swept / still } else { 1.0 };
            count = (growth.min(f64::from(MAX_SLICES)).ceil() as u32).clamp(1, MAX_SLICES);
        }
        let at = |i: u32| i as f32 / count as f32;
        (0..count).map(|i| Slice { part, times: [at(i), at(i + 1)] }).collect()
    }

    /// Whether boxes may move during it.
    pub fn deforms(self, geometry: &Geometry) -> bool {
        self.part != Slice::TOP.part && geometry.part_deforms(self.part)
    }

    /// The moment in its middle.
    pub fn middle(self) -> Slice {
        Slice { times: [0.5 * (self.times[0] + self.times[1]); 2], ..self }
    }

    /// The primitives with their boxes.
    pub fn items(self, geometry: &Geometry) -> Vec<Item> {
        let boxed = |prim| Item::new(geometry.prim_bounds_during(prim, self.times), prim);
        geometry.part_prims(self.part).map(boxed).collect()
    }
}

impl Ground<'_> {
    /// Where a ray meets one primitive of any kind with 0 < t < `limit`.
    #[inline]
    pub fn intersect(&self, prim: PrimId, probe: &RayProbe, limit: f32) -> Option<Hit> {
        match self.geometry.triangle(prim) {
            Some(vertices) => Geometry::intersect_triangle(prim, &vertices, probe, limit),
            None => self.intersect_other(prim, probe, limit),
        }
    }

    /// The same for what is no still triangle.
    #[inline(always)]
    pub fn intersect_other(&self, prim: PrimId, probe: &RayProbe, limit: f32) -> Option<Hit> {
        match self.geometry.shape_at(prim) {
            Some((index, shape)) => self.geometry.intersect_shape(index, shape, probe, limit),
            None => self.intersect_rest(prim, probe, limit),
        }
    }

    #[cold]
    fn intersect_rest(&self, prim: PrimId, probe: &RayProbe, limit: f32) -> Option<Hit> {
        if prim < self.geometry.first_instance() {
            self.geometry.intersect_analytic(prim, probe, limit)
        } else {
            self.look_into(prim, probe, limit, |tree, inside| tree.closest_inside(self, inside))
        }
    }

    /// Whether a ray meets one primitive that is no still triangle with
    /// 0 < t < `limit`.
    #[inline(always)]
    pub fn occluded_other(&self, prim: PrimId, probe: &RayProbe, limit: f32) -> bool {
        match self.geometry.shape_at(prim) {
            Some((index, shape)) => self.geometry.intersect_shape(index, shape, probe, limit).is_some(),
            None => self.occluded_rest(prim, probe, limit),
        }
    }

    #[cold]
    fn occluded_rest(&self, prim: PrimId, probe: &RayProbe, limit: f32) -> bool {
        if prim < self.geometry.first_instance() {
            return self.geometry.intersect_analytic(prim, probe, limit).is_some();
        }
        let any = Hit { t: f32::MIN_POSITIVE, prim, u: 0.0, v: 0.0, instance: prim };
        self.look_into(prim, probe, limit, |tree, inside| tree.occluded_inside(self, inside).then_some(any))
            .is_some()
    }

    /// Asks the tree of an instance.
    ///
    /// As for every primitive, the parameter of a hit is confined to the
    /// instance's own box. It is cut short at the far side only where that is
    /// nearer than `limit`, so the nearest hit inside below `limit`, or of all
    /// when the box ends before, is all that can matter.
    #[inline(never)]
    fn look_into(
        &self,
        prim: PrimId,
        probe: &RayProbe,
        limit: f32,
        ask: impl FnOnce(&Tree, &Ray) -> Option<Hit>,
    ) -> Option<Hit> {
        let instance = self.geometry.instance(prim)?;
        let (near, far) = probe.interval(instance.bounds());
        if !(near < far && near < limit) {
            return None;
        }
        let mut ray = instance.at(probe.time).local_ray(probe.origin(), probe.dir(), probe.time);
        ray.t_max = if far < limit { f32::INFINITY } else { limit };
        if probe.skip_inside[1] == prim {
            ray.skip = probe.skip_inside[0];
        }
        let tree = self.groups.get(instance.part() as usize - 1)?.at(probe.time)?;
        let hit = ask(tree, &ray)?;
        let t = hit.t.clamp(near, far);
        (t > 0.0 && t < limit).then_some(Hit { t, instance: prim, ..hit })
    }
}
