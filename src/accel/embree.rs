//! Embree 3 (Wald et al. 2014, "Embree: A Kernel Framework for Efficient CPU
//! Ray Tracing") behind the cargo feature `embree`.
//!
//! Two ways to use it:
//!
//! - [`Embree`], the accelerator: Embree builds the tree and walks it, and our
//!   own test decides every hit. All primitives are user geometry whose
//!   callback calls `Ground::intersect`, so hits, ties, skipped
//!   primitives and the end of the ray are those of brute force, bit for bit.
//!   Embree's own triangle test cannot be made to: even in robust mode it
//!   misses rays aimed exactly at vertices (some 2 %), and what it does not
//!   report no filter can bring back.
//! - [`EmbreeNative`], for measurements alone: triangles as Embree wants them,
//!   with its own test. It is some two times as fast (one test of four or
//!   eight triangles instead of as many calls). It cannot leave out
//!   the primitive that a ray starts on, and so begins a little later, which
//!   loses what is very near; it gives t, u and v with other last bits, another
//!   primitive where several are met within those, and misses some rays at
//!   vertices. `tests/embree.rs` holds how many.
//!
//! # Nothing is missed
//!
//! Embree has to visit every primitive whose box the ray meets by our
//! arithmetic ([`RayProbe::interval`]), but its box test for user geometry is
//! not the robust one, whatever the flag: it subtracts origin·(1/d) from
//! plane·(1/d). So it sees the scene about its centre and scaled by a power of
//! two to ±2, directions with a largest component in [1, 2), and boxes widened
//! by [`MARGIN`]. That covers, as lengths along an axis, for an origin within
//! ±[`LIMIT`] of which a plane is D ≤ 18 away: 16·2⁻²⁵ for rounding the
//! origin, 16·2⁻²⁴ for its product, D·2⁻²⁴ for the difference, D·2⁻²² for 1/d,
//! and D·9·2⁻²⁴ for the slack and the rounding of our own test: 1.7e-5 in all.
//! It also covers that Embree takes components of a direction below 1e-18 for
//! +1e-18, and the scaling keeps boxes from beyond 1.8e18, where Embree drops
//! them. The end of the ray lies [`SLACK`] beyond the nearest hit, so that
//! ties are looked at.
//!
//! Rays that start farther out than [`LIMIT`] are tested against every
//! primitive if they meet the box of all. Since scenes are centred on their
//! camera, those of a render do so when the point (0, 0, 0) does; a [`Bvh2`] is
//! then built for them.
//!
//! # The bindings
//!
//! Of the published crates, `embree` 0.3.8 (embree-rs, last changed in
//! 2023) wraps neither scene flags nor build quality nor user geometry, so that
//! all of this would be raw calls; `embree4-sys` is raw altogether and needs
//! libclang to build; `embree3` 0.4.1 is embree-rs carried on: the same authors
//! and more, no dependencies, all that is used here in safe Rust except for
//! the data that goes with a ray. It links libembree3 3.13, which Debian 12
//! has. One thing must be kept away from: making a device sets flush-to-zero in
//! the calling thread, which is undefined behaviour for Rust code and would
//! change pictures. Devices are therefore made in a thread that ends at once.

#![allow(unsafe_code, reason = "callbacks find the data of their ray by a cast; each says why it is sound")]

use std::fmt;
use std::sync::atomic::{AtomicIsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};

use embree3::{
    BufferUsage, BuildQuality, Config, Device, Format, GeometryBuilder, GeometryKind, IntersectContext,
    IntersectContextExt, IntersectFunctionNArgs, OccludedFunctionNArgs, RayHit, Scene, SceneFlags,
};

use super::build::Item;
use super::ground::{Ground, Slice};
use super::{Bvh2, Nearest};
use crate::desc::{Error, Result};
use crate::math::{Bounds, DVec3, Ray, Vec3};
use crate::shape::{Geometry, Hit, PrimId, RayProbe};

/// How far the end of the ray that Embree sees lies beyond the nearest hit,
/// relative: more than all rounding of its box test.
const SLACK: f64 = 1.0 + 1e-5;
/// What boxes are widened by when the scene spans ±2.
const MARGIN: f32 = 2.5e-5;
/// How far from its start [`EmbreeNative`] looks for hits of a ray that leaves
/// a surface, relative to its coordinates.
const NATIVE_EPSILON: f32 = 1e-5;
/// How far out, in those units, Embree is trusted with a ray's origin.
const LIMIT: f32 = 16.0;

/// Embree's tree over our primitives and our tests.
#[derive(Clone)]
pub struct Embree {
    /// None for an empty geometry.
    built: Option<Arc<Built>>,
    bounds: Bounds,
    unit: Unit,
}

/// A committed scene. Read-only from then on.
struct Built {
    scene: Scene<'static>,
    /// Bytes that Embree holds.
    bytes: usize,
    /// For rays from beyond [`LIMIT`], where a render makes them.
    far: Option<Bvh2>,
    /// Our ids of Embree's primitives.
    prims: Vec<PrimId>,
}

impl fmt::Debug for Embree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Embree").field("bounds", &self.bounds).field("bytes", &self.memory_bytes()).finish()
    }
}

impl Embree {
    /// Builds the tree. Fails when Embree does, for want of memory.
    pub fn new(geometry: &Geometry) -> Result<Embree> {
        Embree::of(geometry, Slice::TOP)
    }

    pub(super) fn of(geometry: &Geometry, slice: Slice) -> Result<Embree> {
        let bounds = geometry.part_bounds(slice.part);
        let unit = Unit::new(&bounds);
        let mut embree = Embree { built: None, bounds, unit };
        let items = slice.items(geometry);
        if !items.is_empty() {
            let boxes = items.iter().map(|item| unit.widened(&item.bounds()));
            let mut maker = Maker::new(EmbreeMode::Robust)?;
            maker.add_user(boxes.collect(), intersect, occluded)?;
            let mut built = maker.finish()?;
            if slice.part > 0 || unit.origin(DVec3::ZERO).is_none() {
                built.far = Some(Bvh2::of(geometry, slice)?);
            }
            built.prims = items.iter().map(Item::prim).collect();
            embree.built = Some(Arc::new(built));
        }
        Ok(embree)
    }

    pub(super) fn closest(&self, ground: &Ground<'_>, ray: &Ray) -> Option<Hit> {
        let probe = &RayProbe::new(ray)?;
        let built = self.built.as_deref()?;
        let query = Query { ground, built, probe, nearest: Nearest::new(probe), t_scale: 0.0 };
        let Some((theirs, t_scale)) = self.unit.ray(probe) else {
            return match &built.far {
                Some(bvh) => bvh.closest(ground, ray),
                None => everything(query, &self.bounds).hit,
            };
        };
        let mut context = IntersectContextExt::incoherent(Query { t_scale, ..query });
        built.scene.intersect(&mut context, &mut RayHit::from_ray(theirs));
        context.ext.nearest.hit
    }

    pub(super) fn occluded(&self, ground: &Ground<'_>, ray: &Ray) -> bool {
        let Some(probe) = &RayProbe::new(ray) else { return false };
        let Some(built) = self.built.as_deref() else { return false };
        let query = Query { ground, built, probe, nearest: Nearest::new(probe), t_scale: 0.0 };
        let Some((mut theirs, t_scale)) = self.unit.ray(probe) else {
            return match &built.far {
                Some(bvh) => bvh.occluded(ground, ray),
                None => everything(query, &self.bounds).hit.is_some(),
            };
        };
        let mut context = IntersectContextExt::incoherent(Query { t_scale, ..query });
        built.scene.occluded(&mut context, &mut theirs)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        let far = |built: &Built| built.far.as_ref().map_or(0, Bvh2::memory_bytes);
        self.built.as_ref().map_or(0, |built| built.bytes + far(built) + size_of_val(&*built.prims))
    }
}

/// One ray on its way through the tree.
struct Query<'a> {
    ground: &'a Ground<'a>,
    built: &'a Built,
    probe: &'a RayProbe,
    nearest: Nearest,
    t_scale: f64,
}

/// Tests every primitive, if the ray meets the box of all.
fn everything(query: Query<'_>, bounds: &Bounds) -> Nearest {
    let mut nearest = query.nearest;
    let (near, far) = query.probe.interval(bounds);
    if !(near < far) {
        return nearest;
    }
    for prim in &query.built.prims {
        if let Some(hit) = query.ground.intersect(*prim, query.probe, nearest.limit) {
            nearest.take(hit);
        }
    }
    nearest
}

/// Embree has reached a primitive's box: looks for the nearest hit.
fn intersect(args: &mut IntersectFunctionNArgs<'_, ()>) {
    let prim = args.prim_id();
    // SAFETY: scenes with this callback are private to `Embree`, whose
    // `closest` is the only one to trace nearest hits through them, always
    // with a context that carries a `Query`.
    let query = unsafe { args.context_ext_mut::<Query<'_>>() };
    let prim = query.built.prims[prim as usize];
    let Some(hit) = query.ground.intersect(prim, query.probe, query.nearest.limit) else { return };
    query.nearest.take(hit);
    let far = far_end(query.nearest.limit, query.t_scale);
    // Single rays come alone.
    args.set_tfar(0, far);
}

/// Embree has reached a primitive's box: looks for any hit.
fn occluded(args: &mut OccludedFunctionNArgs<'_, ()>) {
    let prim = args.prim_id();
    // SAFETY: as above, with `occluded` as the only one to trace any hit.
    let query = unsafe { args.context_ext::<Query<'_>>() };
    let prim = query.built.prims[prim as usize];
    if query.ground.intersect(prim, query.probe, query.probe.t_max).is_some() {
        args.set_occluded(0);
    }
}

/// A parameter of ours as one of Embree's, a little farther; above 0.
fn far_end(t: f32, t_scale: f64) -> f32 {
    (f64::from(t) * t_scale * SLACK) as f32 + f32::MIN_POSITIVE
}

/// The binary exponent of a positive number; that of the smallest normal for
/// what is smaller.
fn exponent(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// 2^n for a normal result.
fn power_of_two(n: i32) -> f64 {
    f64::from_bits(((n.clamp(-1022, 1023) + 1023) as u64) << 52)
}

/// Coordinates as Embree is to see them.
#[derive(Clone, Copy, Debug)]
struct Unit {
    centre: DVec3,
    /// A power of two.
    factor: f64,
}

impl Unit {
    /// Takes a box to its own centre and half its largest edge to [1, 2).
    /// Edges that have overflowed count as the largest finite number.
    fn new(bounds: &Bounds) -> Unit {
        if bounds.is_empty() {
            return Unit { centre: DVec3::ZERO, factor: 1.0 };
        }
        let finite = |v: Vec3| v.clamp(Vec3::splat(f32::MIN), Vec3::splat(f32::MAX)).as_dvec3();
        let (min, max) = (finite(bounds.min), finite(bounds.max));
        let half = (max - min).max_element() * 0.5;
        let factor = if half > 0.0 { power_of_two(-exponent(half)) } else { 1.0 };
        Unit { centre: (min + max) * 0.5, factor }
    }

    /// A box. What has overflowed in widening ends where all finite
    /// coordinates do.
    fn widened(&self, bounds: &Bounds) -> Bounds {
        let limit = Vec3::splat(2.5);
        let seen = |v: Vec3| ((v.as_dvec3() - self.centre) * self.factor).as_vec3().clamp(-limit, limit);
        Bounds { min: seen(bounds.min) - MARGIN, max: seen(bounds.max) + MARGIN }
    }

    /// The origin of a ray, if Embree is trusted with it.
    fn origin(&self, origin: DVec3) -> Option<Vec3> {
        let seen = ((origin - self.centre) * self.factor).as_vec3();
        (seen.abs().max_element() <= LIMIT).then_some(seen)
    }

    /// A ray, and what takes our parameters to Embree's. `None` when it comes
    /// from too far.
    #[inline]
    fn ray(&self, probe: &RayProbe) -> Option<(embree3::Ray, f64)> {
        let origin = self.origin(probe.origin().as_dvec3())?;
        let shrink = power_of_two(-exponent(f64::from(probe.dir().abs().max_element())));
        let dir = (probe.dir().as_dvec3() * shrink).as_vec3();
        let t_scale = self.factor / shrink;
        let far = far_end(probe.t_max, t_scale);
        Some((embree3::Ray::segment(origin.to_array(), dir.to_array(), 0.0, far), t_scale))
    }
}

/// Which of Embree's ways with triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmbreeMode {
    /// Watertight along edges. Embree 3.13 then builds by the binned surface
    /// area heuristic, whatever quality it is asked for.
    Robust,
    /// Faster, but rays pass between triangles. High quality: the tree is
    /// built with spatial splits.
    Loose,
}

/// A scene in the making.
struct Maker {
    device: Device,
    scene: Scene<'static>,
    /// Bytes that the device holds.
    bytes: Arc<AtomicIsize>,
    /// Boxes of user geometry, which Embree asks for while it builds.
    boxes: Arc<RwLock<Vec<Bounds>>>,
}

fn failed(what: &str) -> impl Fn(embree3::Error) -> Error + '_ {
    move |error| Error::new(format!("Embree cannot {what}: {error:?}"))
}

impl Maker {
    fn new(mode: EmbreeMode) -> Result<Maker> {
        let threads = rayon::current_num_threads() as u32;
        let config = Config { threads, report_errors: false, ..Config::default() };
        let device = std::thread::scope(|scope| scope.spawn(|| Device::with_config(config)).join())
            .map_err(|_| Error::new("Embree cannot start: its thread has ended"))?
            .map_err(failed("start"))?;
        let bytes = Arc::new(AtomicIsize::new(0));
        let sum = bytes.clone();
        device.set_memory_monitor_function(move |change, _| {
            sum.fetch_add(change, Ordering::Relaxed);
            true
        });
        let mut scene: Scene<'static> = device.create_scene().map_err(failed("make a scene"))?;
        scene.set_flags(match mode {
            EmbreeMode::Robust => SceneFlags::ROBUST,
            EmbreeMode::Loose => SceneFlags::NONE,
        });
        scene.set_build_quality(BuildQuality::HIGH);
        Ok(Maker { device, scene, bytes, boxes: Arc::default() })
    }

    /// Adds primitives whose boxes are given and whose hits are found by
    /// callbacks. At most once.
    fn add_user<I, O>(&mut self, boxes: Vec<Bounds>, intersect: I, occluded: O) -> Result<()>
    where
        I: Fn(&mut IntersectFunctionNArgs<'_, ()>) + Send + Sync + 'static,
        O: Fn(&mut OccludedFunctionNArgs<'_, ()>) + Send + Sync + 'static,
    {
        let mut geometry = self.geometry(GeometryKind::USER)?;
        geometry.set_primitive_count(boxes.len() as u32);
        self.boxes = Arc::new(RwLock::new(boxes));
        let boxes = self.boxes.clone();
        geometry.set_bounds_function::<_, ()>(move |bounds, prim, _, _| {
            let b = boxes.read().unwrap_or_else(PoisonError::into_inner)[prim as usize];
            (bounds.lower_x, bounds.lower_y, bounds.lower_z) = b.min.into();
            (bounds.upper_x, bounds.upper_y, bounds.upper_z) = b.max.into();
        });
        geometry.set_intersect_function::<_, ()>(intersect);
        geometry.set_occluded_function::<_, ()>(occluded);
        self.scene.attach_geometry(&geometry.commit());
        Ok(())
    }

    fn geometry(&self, kind: GeometryKind) -> Result<GeometryBuilder<'static>> {
        self.device.create_geometry(kind).map_err(failed("make a geometry"))
    }

    /// Builds the tree.
    fn finish(mut self) -> Result<Built> {
        // Buffers are there by now; only the tree is counted.
        let before = self.bytes.load(Ordering::Relaxed);
        self.scene.commit();
        match self.device.get_error() {
            embree3::Error::NONE => {}
            error => return Err(failed("build its tree")(error)),
        }
        *self.boxes.write().unwrap_or_else(PoisonError::into_inner) = Vec::new();
        let bytes = (self.bytes.load(Ordering::Relaxed) - before).max(0) as usize;
        Ok(Built { scene: self.scene, bytes, far: None, prims: Vec::new() })
    }
}

/// Embree as it comes, to be measured: triangles with its own robust test.
/// Analytic shapes are user geometry with our test.
pub struct EmbreeNative {
    /// None for an empty geometry.
    built: Option<Built>,
    triangles: u32,
    has_analytic: bool,
}

/// One ray of [`EmbreeNative`], for analytic shapes.
struct NativeQuery<'a> {
    geometry: &'a Geometry,
    ray: &'a Ray,
}

impl EmbreeNative {
    /// Builds the tree. Fails when Embree does, for want of memory.
    pub fn new(geometry: &Geometry, mode: EmbreeMode) -> Result<EmbreeNative> {
        let triangles = geometry.triangle_count();
        let has_analytic = geometry.prim_count() > triangles;
        let mut native = EmbreeNative { built: None, triangles, has_analytic };
        if geometry.prim_count() > 0 {
            let mut maker = Maker::new(mode)?;
            if triangles > 0 {
                maker.add_triangles(geometry)?;
            }
            if has_analytic {
                let boxes = (triangles..geometry.prim_count()).map(|p| geometry.prim_bounds(p));
                maker.add_user(boxes.collect(), native_intersect, native_occluded)?;
            }
            native.built = Some(maker.finish()?);
        }
        Ok(native)
    }

    /// The nearest hit as Embree finds it.
    #[must_use]
    pub fn closest(&self, geometry: &Geometry, ray: &Ray) -> Option<Hit> {
        let scene = &self.built.as_ref()?.scene;
        let mut found = RayHit::from_ray(native_ray(ray));
        if self.has_analytic {
            let mut context = IntersectContextExt::incoherent(NativeQuery { geometry, ray });
            scene.intersect(&mut context, &mut found);
        } else {
            scene.intersect(&mut IntersectContext::incoherent(), &mut found);
        }
        let (hit, t) = (found.hit, found.ray.tfar);
        let first = if hit.geomID == 0 && self.triangles > 0 { 0 } else { self.triangles };
        hit.is_valid().then(|| Hit {
            t,
            prim: first + hit.primID,
            u: hit.u,
            v: hit.v,
            instance: Hit::NO_INSTANCE,
        })
    }

    /// Whether Embree finds any hit.
    #[must_use]
    pub fn occluded(&self, geometry: &Geometry, ray: &Ray) -> bool {
        let Some(built) = &self.built else { return false };
        let mut seen = native_ray(ray);
        if self.has_analytic {
            let mut context = IntersectContextExt::incoherent(NativeQuery { geometry, ray });
            built.scene.occluded(&mut context, &mut seen)
        } else {
            built.scene.occluded(&mut IntersectContext::incoherent(), &mut seen)
        }
    }

    /// Bytes of the tree; not of Embree's copies of vertices and indices,
    /// which a program that gives it its own would not have.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.built.as_ref().map_or(0, |built| built.bytes)
    }
}

/// A ray that starts on a primitive begins a little later, as in programs that
/// use Embree alone: its robust test finds hits on the plane the ray has left,
/// for which no bound of the error is known.
fn native_ray(ray: &Ray) -> embree3::Ray {
    let near = if ray.skip == Ray::NO_SKIP {
        0.0
    } else {
        NATIVE_EPSILON * ray.origin.abs().max_element() / ray.dir.abs().max_element()
    };
    embree3::Ray::segment(ray.origin.to_array(), ray.dir.to_array(), near, ray.t_max)
}

fn native_intersect(args: &mut IntersectFunctionNArgs<'_, ()>) {
    // SAFETY: `EmbreeNative::closest` alone traces nearest hits through scenes
    // with this callback, with a context that carries a `NativeQuery`.
    let query = unsafe { args.context_ext::<NativeQuery<'_>>() };
    let mut ray = args.ray(0);
    let prim = query.geometry.triangle_count() + args.prim_id();
    let Some(found) = query.geometry.intersect(prim, query.ray, ray.tfar) else { return };
    ray.tfar = found.t;
    let (geom_id, prim_id) = (args.geom_id(), args.prim_id());
    let hit = embree3::Hit { u: found.u, v: found.v, primID: prim_id, geomID: geom_id, ..Default::default() };
    args.commit_hit(0, &ray, &hit);
}

fn native_occluded(args: &mut OccludedFunctionNArgs<'_, ()>) {
    // SAFETY: as above, with `occluded`.
    let query = unsafe { args.context_ext::<NativeQuery<'_>>() };
    let prim = query.geometry.triangle_count() + args.prim_id();
    if query.geometry.intersect(prim, query.ray, args.ray(0).tfar).is_some() {
        args.set_occluded(0);
    }
}

impl Maker {
    fn add_triangles(&mut self, geometry: &Geometry) -> Result<()> {
        let mut triangles = self.geometry(GeometryKind::TRIANGLE)?;
        let (positions, indices) = (geometry.positions(), geometry.triangles());
        let no_memory = failed("hold the mesh");
        triangles
            .set_new_buffer::<[f32; 3]>(BufferUsage::VERTEX, 0, Format::FLOAT3, 12, positions.len())
            .map_err(&no_memory)?
            .iter_mut()
            .zip(positions)
            .for_each(|(to, from)| *to = from.to_array());
        triangles
            .set_new_buffer::<[u32; 3]>(BufferUsage::INDEX, 0, Format::UINT3, 12, indices.len())
            .map_err(&no_memory)?
            .copy_from_slice(indices);
        self.scene.attach_geometry(&triangles.commit());
        Ok(())
    }
}
