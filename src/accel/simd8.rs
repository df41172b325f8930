//! Kernels of the 8-wide tree, in plain Rust and (in `simd8_avx2`) with AVX2:
//! a ray against the eight boxes of a node, the order in which to go on, and a
//! ray against a block of four triangles.
//!
//! Both do the same operations in the same order on every lane, so they agree
//! bit for bit. The box test is that of [`RayProbe::interval`]: `max` keeps its
//! second operand when the first is NaN, as the instruction does.

#![allow(unsafe_code, reason = "the stack is not cleared for every ray; each block says why it is sound")]

use std::mem::MaybeUninit;

use super::build::MAX_DEPTH;
use super::simd::three;
use super::simd8_arena::{Arena, Swing};
use super::wide::{Block, LANES, Link, Node8, WIDTH};
use crate::math::{Ray, Vec3};
use crate::shape::{Geometry, RayProbe};

/// A way to test nodes and blocks.
pub trait WideTest: Copy {
    /// The ray as this way wants it.
    type Ray;
    /// Where the ray enters each box.
    type Near: Copy;

    /// Makes a ray ready; `None` for one that hits nothing. Here and not
    /// before, so that what it gives is still in registers.
    #[inline(always)]
    fn probe(self, ray: &Ray) -> Option<RayProbe> {
        RayProbe::new(ray)
    }

    /// Prepares a ray for a tree whose coordinates are at most `size`.
    fn prepare(self, probe: &RayProbe, size: f32) -> Self::Ray;

    /// One bit for each box that the ray meets before `limit`, and where
    /// it enters them.
    fn boxes(self, ray: &Self::Ray, node: &Node8, limit: f32) -> (u32, Self::Near);

    /// A node whose planes have moved by a share of their way.
    fn moved(self, node: &Node8, swing: &Swing, share: f32) -> Node8;

    /// Vertices on their straight way from one block's to the other's, by the share of each
    /// lane.
    fn between(self, from: &Block, to: &Block, shares: &[f32; LANES]) -> Block;

    /// Puts the children in `mask`, which is not empty, onto the stack with the
    /// nearest on top, and takes that off again.
    fn descend(self, mask: u32, near: Self::Near, node: &Node8, stack: &mut Stack<'_>) -> Link;

    /// The same without order or distances: by lane, the last on top.
    fn descend_any(self, mask: u32, node: &Node8, stack: &mut Stack<'_>) -> Link;

    /// Asks for the children in `mask` ahead of their visits.
    fn fetch(self, mask: u32, node: &Node8, arena: &Arena);

    /// Which triangles of the lanes in `mask` are hit with 0 < t < `limit`, of
    /// those that the ray does not leave out.
    fn triangles(self, ray: &Self::Ray, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met;

    /// The same by a test that is not robust, on a block of edges
    /// ([`Block::into_edges`]): see `bvh8_plain`.
    fn loose(self, ray: &Self::Ray, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met;
}

/// Work that is compiled once for each way to test. `run` should be
/// `#[inline(always)]`.
pub trait WideTask {
    /// What it gives.
    type Output;

    /// Does it.
    fn run<T: WideTest>(self, test: T) -> Self::Output;
}

/// Hits of a block, by lane; meaningless outside the mask.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    pub mask: u32,
    pub t: [f32; LANES],
    pub u: [f32; LANES],
    pub v: [f32; LANES],
}

impl Met {
    /// Nothing is hit.
    pub const NOTHING: Met = Met { mask: 0, t: [0.0; LANES], u: [0.0; LANES], v: [0.0; LANES] };
}

/// Children still to be visited, each with its key: the bits of the distance
/// at which it begins, the lowest three of which are its lane instead. Keys of
/// distances (never negative) are ordered as the distances are.
pub struct Stack<'a> {
    slots: &'a mut Slots,
    /// What is below is initialised.
    len: usize,
}

/// Memory of a [`Stack`], not initialised: apart from it, since a struct that
/// is initialised in part would be copied from a constant in whole.
pub struct Slots {
    keys: MaybeUninit<[u32; Stack::SIZE]>,
    links: MaybeUninit<[Link; Stack::SIZE]>,
}

impl Slots {
    #[inline(always)]
    pub fn new() -> Slots {
        Slots { keys: MaybeUninit::uninit(), links: MaybeUninit::uninit() }
    }
}

impl Stack<'_> {
    /// What the deepest tree needs: a visit leaves at most seven; and room to
    /// write eight at once.
    pub const SIZE: usize = (WIDTH - 1) * MAX_DEPTH + WIDTH;
    /// Bits of a key that are the lane.
    pub const LANE: u32 = WIDTH as u32 - 1;

    #[inline(always)]
    pub fn new(slots: &mut Slots) -> Stack<'_> {
        Stack { slots, len: 0 }
    }

    /// Lets `write` put eight entries on top, of which `count` stay.
    #[inline(always)]
    pub fn push_some(&mut self, count: usize, write: impl FnOnce(&mut [u32; WIDTH], &mut [Link; WIDTH])) {
        assert!(count <= WIDTH && self.len + WIDTH <= Stack::SIZE, "the tree is too deep");
        // SAFETY: eight entries from `len` are inside of both arrays, and any
        // bits are an entry once `write` has put them there; it does not read.
        unsafe {
            let keys = self.slots.keys.as_mut_ptr().cast::<u32>().add(self.len);
            let links = self.slots.links.as_mut_ptr().cast::<Link>().add(self.len);
            write(&mut *keys.cast(), &mut *links.cast());
        }
        self.len += count;
    }

    /// The latest child that begins before `limit`.
    #[inline(always)]
    pub fn pop(&mut self, limit: f32) -> Option<Link> {
        let limit = limit.to_bits() | Stack::LANE;
        while self.len > 0 {
            self.len -= 1;
            // SAFETY: entries below the former `len` have been written.
            let (key, link) = unsafe {
                let keys = self.slots.keys.as_ptr().cast::<u32>();
                let links = self.slots.links.as_ptr().cast::<Link>();
                (*keys.add(self.len), *links.add(self.len))
            };
            if key <= limit {
                return Some(link);
            }
        }
        None
    }

    /// The latest child, of those that were pushed without keys.
    #[inline(always)]
    pub fn pop_any(&mut self) -> Option<Link> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: entries below the former `len` have been written.
        Some(unsafe { *self.slots.links.as_ptr().cast::<Link>().add(self.len) })
    }
}

/// Plain Rust: every target.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

/// A ray for [`Portable`].
#[derive(Clone, Copy, Debug)]
pub struct PortableRay {
    origin: [f32; 3],
    inv_dir: [f32; 3],
    inv_far: [f32; 3],
    /// Which planes are near and which far.
    planes: [[usize; 2]; 3],
}

impl WideTest for Portable {
    type Ray = PortableRay;
    type Near = [f32; WIDTH];

    #[inline(always)]
    fn prepare(self, probe: &RayProbe, _: f32) -> PortableRay {
        let planes = |axis: usize| {
            let near = 2 * axis + usize::from(probe.inv_dir[axis].is_sign_negative());
            [near, near ^ 1]
        };
        PortableRay {
            origin: three(&probe.origin),
            inv_dir: three(&probe.inv_dir),
            inv_far: three(&probe.inv_far),
            planes: [planes(0), planes(1), planes(2)],
        }
    }

    #[inline(always)]
    fn boxes(self, ray: &PortableRay, node: &Node8, limit: f32) -> (u32, [f32; WIDTH]) {
        let (mut near, mut far) = ([0.0; WIDTH], [limit; WIDTH]);
        for axis in 0..3 {
            let [enter, leave] = ray.planes[axis].map(|i| &node.planes[i]);
            for lane in 0..WIDTH {
                let t = (enter[lane] - ray.origin[axis]) * ray.inv_dir[axis];
                near[lane] = if t > near[lane] { t } else { near[lane] };
                let t = (leave[lane] - ray.origin[axis]) * ray.inv_far[axis];
                far[lane] = if t < far[lane] { t } else { far[lane] };
            }
        }
        let mut mask = 0;
        for lane in 0..WIDTH {
            mask |= u32::from(near[lane] < far[lane]) << lane;
        }
        (mask, near)
    }

    #[inline(always)]
    fn moved(self, node: &Node8, swing: &Swing, share: f32) -> Node8 {
        let mut moved = *node;
        for (planes, by) in moved.planes.iter_mut().zip(swing) {
            for (plane, by) in planes.iter_mut().zip(by) {
                *plane += by * share;
            }
        }
        moved
    }

    #[inline(always)]
    fn between(self, from: &Block, to: &Block, shares: &[f32; LANES]) -> Block {
        let mut between = *from;
        let rows = between.vertices.as_flattened_mut().iter_mut().zip(to.vertices.as_flattened());
        for (row, to) in rows {
            for ((a, b), share) in row.iter_mut().zip(to).zip(shares) {
                *a += (b - *a) * share;
            }
        }
        between
    }

    #[inline(always)]
    fn descend(self, mut mask: u32, near: [f32; WIDTH], node: &Node8, stack: &mut Stack<'_>) -> Link {
        // Sorts by insertion, farthest first.
        let mut keys = [0u32; WIDTH];
        let mut count = 0;
        while mask != 0 {
            let lane = mask.trailing_zeros();
            mask &= mask - 1;
            let key = near[lane as usize].to_bits() & !Stack::LANE | lane;
            let mut i = count;
            while i > 0 && keys[i - 1] < key {
                keys[i] = keys[i - 1];
                i -= 1;
            }
            keys[i] = key;
            count += 1;
        }
        let child = |key: u32| node.children[(key & Stack::LANE) as usize];
        stack.push_some(count - 1, |to_keys, to_links| {
            for (i, key) in keys.iter().enumerate() {
                (to_keys[i], to_links[i]) = (*key, child(*key));
            }
        });
        child(keys[count - 1])
    }

    #[inline(always)]
    fn descend_any(self, mut mask: u32, node: &Node8, stack: &mut Stack<'_>) -> Link {
        let last = 31 - mask.leading_zeros();
        mask ^= 1 << last;
        stack.push_some(mask.count_ones() as usize, |_, to_links| {
            for to in to_links {
                *to = node.children[mask.trailing_zeros() as usize % WIDTH];
                mask &= mask.wrapping_sub(1);
            }
        });
        node.children[last as usize]
    }

    #[inline(always)]
    fn fetch(self, _: u32, _: &Node8, _: &Arena) {}

    #[inline(always)]
    fn triangles(self, _: &PortableRay, probe: &RayProbe, block: &Block, mut mask: u32, limit: f32) -> Met {
        let mut met = Met::NOTHING;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let prim = block.prims[lane];
            if probe.skips(prim) {
                continue;
            }
            if let Some(hit) = Geometry::intersect_triangle(prim, &block.triangle(lane), probe, limit) {
                met.mask |= 1 << lane;
                (met.t[lane], met.u[lane], met.v[lane]) = (hit.t, hit.u, hit.v);
            }
        }
        met
    }

    #[inline(always)]
    fn loose(self, _: &PortableRay, probe: &RayProbe, block: &Block, mut mask: u32, limit: f32) -> Met {
        let mut met = Met::NOTHING;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let [a, e1, e2] = block.triangle(lane);
            let p = cross(probe.dir(), e2);
            let inv = 1.0 / dot(e1, p);
            let s = probe.origin() - a;
            let u = dot(s, p) * inv;
            let q = cross(s, e1);
            let v = dot(probe.dir(), q) * inv;
            let t = dot(e2, q) * inv;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < limit {
                met.mask |= 1 << lane;
                (met.t[lane], met.u[lane], met.v[lane]) = (t, u, v);
            }
        }
        met
    }
}

/// Products in the order of the vector kernel.
#[inline(always)]
fn cross(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// Sums in the order of the vector kernel.
#[inline(always)]
fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::super::simd::Avx2;
    use super::*;
    use crate::desc::Mesh;
    use crate::math::{Bounds, Ray, Transform};
    use crate::shape::{GeometryBuilder, MeshOptions};

    struct Random(u64);

    impl Random {
        /// In ±1, with special values among them.
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            match self.0 >> 60 {
                0 => 0.0,
                1 => -0.0,
                2 => 1.0,
                3 => 1e-38,
                _ => ((self.0 >> 33) as u32 as f32) * 2f32.powi(-30) - 1.0,
            }
        }

        fn vector(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next())
        }

        fn probe(&mut self) -> Option<RayProbe> {
            RayProbe::new(&Ray::new(self.vector() * 2.0, self.vector()))
        }
    }

    /// What was pushed, latest first.
    fn popped(stack: &mut Stack<'_>, any: bool) -> Vec<u32> {
        let mut pop = || if any { stack.pop_any() } else { stack.pop(f32::INFINITY) };
        std::iter::from_fn(|| pop().map(|link| link.0)).collect()
    }

    /// Boxes and the order in which to go on, on 150,000 nodes.
    #[test]
    fn nodes_agree_with_plain_rust() {
        let Some(avx2) = Avx2::detect() else { return };
        let mut random = Random(1);
        let mut several = 0;
        for case in 0..150_000 {
            let mut node = Node8::EMPTY;
            for lane in 0..case % (WIDTH + 1) {
                let (a, b) = (random.vector(), random.vector());
                let around = Bounds::of_points([a.abs(), -b.abs()]);
                let bounds = if lane % 4 == 0 { Bounds::of_points([a, b]) } else { around };
                node.set(lane, &bounds, Link::node(100 + lane));
            }
            let swing: Swing = std::array::from_fn(|_| std::array::from_fn(|_| random.next()));
            let moved = [
                Portable.moved(&node, &swing, case as f32 / 150_000.0),
                avx2.moved(&node, &swing, case as f32 / 150_000.0),
            ];
            assert_eq!(
                moved[0].planes.map(|p| p.map(f32::to_bits)),
                moved[1].planes.map(|p| p.map(f32::to_bits))
            );
            assert_eq!(moved[0].children, moved[1].children);
            let Some(probe) = random.probe() else { continue };
            let (mask, near) = Portable.boxes(&Portable.prepare(&probe, 8.0), &node, 3.0);
            let (other_mask, other_near) = avx2.boxes(&avx2.prepare(&probe, 8.0), &node, 3.0);
            assert_eq!(mask, other_mask, "{probe:?} {node:?}");
            for (lane, near) in near.iter().enumerate() {
                let (enter, leave) = probe.interval(&node.bounds(lane));
                assert_eq!(enter < leave.min(3.0), mask >> lane & 1 != 0);
                assert_eq!(enter.to_bits(), near.to_bits());
            }
            if mask == 0 {
                continue;
            }
            several += u32::from(mask.count_ones() > 2);
            let (mut slots, mut other_slots) = (Slots::new(), Slots::new());
            let (mut stack, mut other) = (Stack::new(&mut slots), Stack::new(&mut other_slots));
            let first = Portable.descend(mask, near, &node, &mut stack);
            assert_eq!(first, avx2.descend(mask, other_near, &node, &mut other));
            let order = popped(&mut stack, false);
            assert_eq!(order, popped(&mut other, false));
            assert_eq!(order.len() + 1, mask.count_ones() as usize);
            let distance = |link: u32| near[link as usize - 100];
            assert!(order.iter().all(|link| distance(first.0) <= distance(*link) * (1.0 + 1e-6)));
            let first = Portable.descend_any(mask, &node, &mut stack);
            assert_eq!(first, avx2.descend_any(mask, &node, &mut other));
            assert_eq!(popped(&mut stack, true), popped(&mut other, true));
        }
        assert!(several > 3_000, "{several} cases of more than two boxes");
    }

    /// Blocks of triangles on 100,000 rays: edges, corners and needles.
    #[test]
    fn blocks_agree_with_plain_rust() {
        let Some(avx2) = Avx2::detect() else { return };
        let mut random = Random(2);
        let (mut hits, mut loose_hits) = (0, 0);
        for case in 0..100_000u32 {
            let scale = 2f32.powi((case % 120) as i32 - 60);
            let mut mesh = Mesh::default();
            for i in 0..4 {
                let [a, b, c] = [(); 3].map(|()| random.vector());
                let c = if case % 5 == 0 { a + (b - a) * 0.5 + c * 1e-6 } else { c };
                mesh.positions.extend([a, b, c].map(|v| v * scale));
                mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            }
            let mut builder = GeometryBuilder::new();
            let added = builder.add_mesh(&mesh, &Transform::IDENTITY, MeshOptions::default());
            let geometry = builder.finish();
            let count = geometry.triangle_count();
            if added.is_err() || count == 0 {
                continue;
            }
            let prims: Vec<u32> = (0..count).collect();
            let block = Block::new(&geometry, &prims);
            let origin = random.vector() * 2.0 * scale;
            let target = mesh.positions[case as usize % 12];
            let target = if case % 3 == 0 { target } else { random.vector() * 0.3 * scale };
            let mut ray = Ray::new(origin, target - origin);
            ray.skip = if case % 7 == 0 { 0 } else { Ray::NO_SKIP };
            let Some(probe) = RayProbe::new(&ray) else { continue };
            let all = (1 << count) - 1;
            let shares: [f32; LANES] = std::array::from_fn(|_| random.next());
            let other = Block {
                vertices: block.vertices.map(|corner| corner.map(|row| row.map(|x| 1.0 - x))),
                ..block
            };
            let between = [Portable.between(&block, &other, &shares), avx2.between(&block, &other, &shares)];
            let bits = between.map(|b| b.vertices.map(|corner| corner.map(|row| row.map(f32::to_bits))));
            assert_eq!(bits[0], bits[1]);
            let wide = avx2.prepare(&probe, 4.0 * scale);
            let plain = Portable.prepare(&probe, 8.0);
            let expected = Portable.triangles(&plain, &probe, &block, all, 2.0);
            let met = avx2.triangles(&wide, &probe, &block, all, 2.0);
            assert_eq!(expected.mask, met.mask, "{case} {probe:?} {block:?}");
            for lane in (0..LANES).filter(|lane| met.mask >> lane & 1 != 0) {
                let bits = |m: &Met| [m.t[lane], m.u[lane], m.v[lane]].map(f32::to_bits);
                assert_eq!(bits(&expected), bits(&met), "{case} {probe:?} {block:?}");
                hits += 1;
            }
            // A test that is not robust does without numbers below the normal ones.
            if !(1e-6..1e6).contains(&scale) {
                continue;
            }
            let edges = block.into_edges();
            let expected = Portable.loose(&Portable.prepare(&probe, 8.0), &probe, &edges, all, 2.0);
            let met = avx2.loose(&wide, &probe, &edges, all, 2.0);
            assert_eq!(expected.mask, met.mask, "{case} {probe:?} {edges:?}");
            for lane in (0..LANES).filter(|lane| met.mask >> lane & 1 != 0) {
                let bits = |m: &Met| [m.t[lane], m.u[lane], m.v[lane]].map(f32::to_bits);
                assert_eq!(bits(&expected), bits(&met), "{case} {probe:?} {edges:?}");
                loose_hits += 1;
            }
        }
        assert!(hits > 20_000 && loose_hits > 1_000, "{hits} and {loose_hits} hits");
    }
}
