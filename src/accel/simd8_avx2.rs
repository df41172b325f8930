//! The kernels of `simd8` with AVX2.

#![allow(
    unsafe_code,
    reason = "vector loads and stores, and the door into AVX2; each block says why it is sound"
)]

use std::arch::x86_64::*;

use super::simd::Avx2;
use super::simd8::{Met, Stack, WideTask, WideTest};
use super::simd8_arena::{Arena, Swing};
use super::wide::{Block, LANES, Link, Node8, WIDTH};
use crate::math::gamma;
use crate::shape::{RayProbe, WIDENING};

/// A ray for [`Avx2`]: every number in all lanes, and what the test of triangles
/// takes when it comes to one.
#[derive(Clone, Copy, Debug)]
pub struct WideRay {
    /// The origin negated: a plane is then added to it from memory.
    back: [__m256; 3],
    inv_dir: [__m256; 3],
    inv_far: [__m256; 3],
    /// Where the near planes of a node are, and the far ones, in bytes from
    /// its beginning: multiples of 32 below 192.
    near: [usize; 3],
    far: [usize; 3],
    /// Where the coordinates of a block are along the axes of the probe, in
    /// bytes from the beginning of a vertex: multiples of 16 below 48.
    rows: [usize; 3],
    /// 1 / direction, along the last of them.
    scale: f32,
    /// How far before its parameter a triangle's box may begin, along the last
    /// of them.
    slack: f32,
}

/// Where a ray enters eight boxes, and all bits of those that it meets.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    near: __m256,
    met: __m256,
}

impl Avx2 {
    /// Does a task compiled for AVX2.
    #[inline]
    pub fn run_wide<T: WideTask>(self, task: T) -> T::Output {
        // SAFETY: the token exists only where AVX2 has been detected.
        unsafe { run_avx2(self, task) }
    }
}

/// `[f(0), f(1), f(2)]` written out: what takes a closure is not compiled for
/// AVX2, may not be inlined, and then passes every vector through memory.
macro_rules! three {
    ($i:ident => $value:expr) => {
        [
            {
                let $i: usize = 0;
                $value
            },
            {
                let $i: usize = 1;
                $value
            },
            {
                let $i: usize = 2;
                $value
            },
        ]
    };
}

#[target_feature(enable = "avx2,bmi1,lzcnt,popcnt")]
fn run_avx2<T: WideTask>(token: Avx2, task: T) -> T::Output {
    task.run(token)
}

impl WideTest for Avx2 {
    type Ray = WideRay;
    type Near = Near;

    #[inline(always)]
    fn prepare(self, probe: &RayProbe, size: f32) -> WideRay {
        // SAFETY: the token exists only where AVX2 has been detected.
        unsafe { prepare(probe, size) }
    }

    #[inline(always)]
    fn boxes(self, ray: &WideRay, node: &Node8, limit: f32) -> (u32, Near) {
        // SAFETY: as above.
        unsafe { boxes(ray, node, limit) }
    }

    #[inline(always)]
    fn moved(self, node: &Node8, swing: &Swing, share: f32) -> Node8 {
        // SAFETY: as above.
        unsafe { moved(node, swing, share) }
    }

    #[inline(always)]
    fn between(self, from: &Block, to: &Block, shares: &[f32; LANES]) -> Block {
        // SAFETY: as above.
        unsafe { between(from, to, shares) }
    }

    #[inline(always)]
    fn descend(self, mask: u32, near: Near, node: &Node8, stack: &mut Stack<'_>) -> Link {
        // SAFETY: as above.
        unsafe { descend(mask, near, node, stack) }
    }

    #[inline(always)]
    fn descend_any(self, mask: u32, node: &Node8, stack: &mut Stack<'_>) -> Link {
        // SAFETY: as above.
        unsafe { descend_any(mask, node, stack) }
    }

    #[inline(always)]
    fn fetch(self, mut mask: u32, node: &Node8, arena: &Arena) {
        while mask != 0 {
            let child = node.children[mask.trailing_zeros() as usize % WIDTH];
            let address = arena.address(child).cast::<i8>();
            // SAFETY: fetching reads nothing, at any address.
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(address);
                _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(64));
                _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(128));
            }
            mask &= mask - 1;
        }
    }

    #[inline(always)]
    fn triangles(self, ray: &WideRay, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met {
        // SAFETY: as above.
        unsafe { triangles(ray, probe, block, mask, limit) }
    }

    #[inline(always)]
    fn loose(self, _: &WideRay, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met {
        // SAFETY: as above.
        unsafe { loose(probe, block, mask, limit) }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn store4(v: __m128) -> [f32; LANES] {
    let mut to = [0.0; LANES];
    // SAFETY: four f32 in a row.
    unsafe { _mm_storeu_ps(to.as_mut_ptr(), v) };
    to
}

#[inline]
#[target_feature(enable = "avx2")]
fn prepare(probe: &RayProbe, size: f32) -> WideRay {
    let near = three!(i => 64 * i + (probe.inv_dir[i].to_bits() >> 31) as usize * 32);
    WideRay {
        back: three!(i => _mm256_set1_ps(-probe.origin[i])),
        inv_dir: three!(i => _mm256_set1_ps(probe.inv_dir[i])),
        inv_far: three!(i => _mm256_set1_ps(probe.inv_far[i])),
        near,
        far: three!(i => near[i] ^ 32),
        rows: three!(i => 16 * usize::from(probe.axes[i].min(2))),
        scale: probe.shear[2],
        slack: size * probe.shear[2].abs() * 2.0 * WIDENING,
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn boxes(ray: &WideRay, node: &Node8, limit: f32) -> (u32, Near) {
    let base: *const u8 = node.planes.as_ptr().cast();
    let from_origin = |axis: usize, at: usize| {
        // SAFETY: eight f32 of one plane: `prepare` makes the offsets.
        let planes = unsafe { _mm256_load_ps(base.add(at).cast()) };
        _mm256_add_ps(planes, ray.back[axis])
    };
    let mut near = _mm256_setzero_ps();
    let mut far = _mm256_set1_ps(limit);
    for axis in 0..3 {
        let enter = _mm256_mul_ps(from_origin(axis, ray.near[axis]), ray.inv_dir[axis]);
        let leave = _mm256_mul_ps(from_origin(axis, ray.far[axis]), ray.inv_far[axis]);
        near = _mm256_max_ps(enter, near);
        far = _mm256_min_ps(leave, far);
    }
    let met = _mm256_cmp_ps::<_CMP_LT_OQ>(near, far);
    (_mm256_movemask_ps(met) as u32, Near { near, met })
}

#[inline]
#[target_feature(enable = "avx2")]
fn moved(node: &Node8, swing: &Swing, share: f32) -> Node8 {
    let mut to = Node8 { children: node.children, ..Node8::EMPTY };
    let share = _mm256_set1_ps(share);
    for (to, (from, by)) in to.planes.iter_mut().zip(node.planes.iter().zip(swing)) {
        // SAFETY: eight f32 in a row, each time.
        unsafe {
            let by = _mm256_mul_ps(_mm256_loadu_ps(by.as_ptr()), share);
            _mm256_storeu_ps(to.as_mut_ptr(), _mm256_add_ps(_mm256_loadu_ps(from.as_ptr()), by));
        }
    }
    to
}

#[inline]
#[target_feature(enable = "avx2")]
fn between(from: &Block, to: &Block, shares: &[f32; LANES]) -> Block {
    let mut out = Block { prims: from.prims, ..Block::EMPTY };
    // SAFETY: four f32 in a row, each time.
    unsafe {
        let share = _mm_loadu_ps(shares.as_ptr());
        for corner in 0..3 {
            for axis in 0..3 {
                let a = _mm_loadu_ps(from.vertices[corner][axis].as_ptr());
                let b = _mm_loadu_ps(to.vertices[corner][axis].as_ptr());
                let way = _mm_mul_ps(_mm_sub_ps(b, a), share);
                _mm_storeu_ps(out.vertices[corner][axis].as_mut_ptr(), _mm_add_ps(a, way));
            }
        }
    }
    out
}

#[inline]
#[target_feature(enable = "avx2,bmi1,lzcnt,popcnt")]
fn descend(mask: u32, near: Near, node: &Node8, stack: &mut Stack<'_>) -> Link {
    // Keys of what is met, in reverse: the nearest is the greatest, and what is
    // not met is greater than all.
    const TOP: i32 = i32::MAX;
    let top = _mm256_set1_epi32(TOP);
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let bits = _mm256_andnot_si256(_mm256_set1_epi32(Stack::LANE as i32), _mm256_castps_si256(near.near));
    let key = _mm256_and_si256(_mm256_or_si256(bits, lanes), _mm256_castps_si256(near.met));
    let key = _mm256_xor_si256(key, top);

    // The nearest on a short way of its own.
    let nearest = {
        let reversed = _mm256_and_si256(key, _mm256_castps_si256(near.met));
        let m = _mm_max_epi32(_mm256_castsi256_si128(reversed), _mm256_extracti128_si256::<1>(reversed));
        let m = _mm_max_epi32(m, _mm_shuffle_epi32::<0x4e>(m));
        let m = _mm_max_epi32(m, _mm_shuffle_epi32::<0xb1>(m));
        !(_mm_cvtsi128_si32(m) as u32) & Stack::LANE
    };

    let sorted = sort(key);
    let keys = _mm256_xor_si256(sorted, top);
    // SAFETY: eight numbers in a row.
    let children = unsafe { _mm256_loadu_si256(node.children.as_ptr().cast()) };
    let links = _mm256_permutevar8x32_epi32(children, keys);
    stack.push_some(mask.count_ones() as usize - 1, |to_keys, to_links| {
        // SAFETY: both point to eight numbers.
        unsafe {
            _mm256_storeu_si256(to_keys.as_mut_ptr().cast(), keys);
            _mm256_storeu_si256(to_links.as_mut_ptr().cast(), links);
        }
    });
    node.children[nearest as usize]
}

#[inline]
#[target_feature(enable = "avx2,bmi1,lzcnt,popcnt")]
fn descend_any(mask: u32, node: &Node8, stack: &mut Stack<'_>) -> Link {
    let last = 31 - mask.leading_zeros();
    let mask = mask ^ (1 << last);
    // SAFETY: eight bytes, and eight numbers, in a row.
    let (order, children) = unsafe {
        (
            _mm_loadl_epi64(LANES_OF[mask as usize % LANES_OF.len()].as_ptr().cast()),
            _mm256_loadu_si256(node.children.as_ptr().cast()),
        )
    };
    let links = _mm256_permutevar8x32_epi32(children, _mm256_cvtepu8_epi32(order));
    stack.push_some(mask.count_ones() as usize, |_, to_links| {
        // SAFETY: eight numbers in a row.
        unsafe { _mm256_storeu_si256(to_links.as_mut_ptr().cast(), links) }
    });
    node.children[last as usize % WIDTH]
}

/// For every mask of lanes, these lanes in turn.
static LANES_OF: [[u8; WIDTH]; 1 << WIDTH] = {
    let mut table = [[0; WIDTH]; 1 << WIDTH];
    let mut mask = 0;
    while mask < table.len() {
        let (mut lane, mut count) = (0, 0);
        while lane < WIDTH {
            if mask >> lane & 1 != 0 {
                table[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// Sorts eight integers, lowest first, by a bitonic network (Batcher 1968).
#[inline]
#[target_feature(enable = "avx2")]
fn sort(v: __m256i) -> __m256i {
    macro_rules! step {
        ($v:expr, $partner:expr, $upper:literal) => {{
            let (v, partner) = ($v, $partner);
            _mm256_blend_epi32::<$upper>(_mm256_min_epi32(v, partner), _mm256_max_epi32(v, partner))
        }};
    }
    let v = step!(v, _mm256_shuffle_epi32::<0xb1>(v), 0b1010_1010);
    let v = step!(v, _mm256_shuffle_epi32::<0x1b>(v), 0b1100_1100);
    let v = step!(v, _mm256_shuffle_epi32::<0xb1>(v), 0b1010_1010);
    let mirror = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
    let v = step!(v, _mm256_permutevar8x32_epi32(v, mirror), 0b1111_0000);
    let v = step!(v, _mm256_shuffle_epi32::<0x4e>(v), 0b1100_1100);
    step!(v, _mm256_shuffle_epi32::<0xb1>(v), 0b1010_1010)
}

/// Vertices relative to the origin and sheared: x, y, z of each.
type Sheared = [[__m128; 3]; 3];

/// A number of the ray in four lanes.
macro_rules! half {
    ($vector:expr) => {
        _mm256_castps256_ps128($vector)
    };
}

#[inline]
#[target_feature(enable = "avx2")]
fn sheared(ray: &WideRay, probe: &RayProbe, block: &Block) -> Sheared {
    let vertices: *const u8 = block.vertices.as_ptr().cast();
    let backs: *const u8 = ray.back.as_ptr().cast();
    // SAFETY: the half of one of three vectors: `prepare` makes the offsets.
    let back = three!(i => unsafe { _mm_load_ps(backs.add(2 * ray.rows[i]).cast()) });
    let shear = [_mm_set1_ps(probe.shear[0]), _mm_set1_ps(probe.shear[1])];
    three!(corner => {
        // SAFETY: four f32 of one row: `prepare` makes the offsets.
        let [x, y, z] = three!(i =>
            _mm_add_ps(unsafe { _mm_load_ps(vertices.add(48 * corner + ray.rows[i]).cast()) }, back[i]));
        [_mm_sub_ps(x, _mm_mul_ps(shear[0], z)), _mm_sub_ps(y, _mm_mul_ps(shear[1], z)), z]
    })
}

/// The test of `shape::triangle`: rejects by the signs of the edge functions in
/// f32 before it goes on in f64; what NaN hides goes on too.
///
/// Whether it goes on should be easy to foresee, and nearly every line crosses
/// some triangle of a block. So three more kinds are rejected at once that would
/// be later. The primitives that the ray leaves out: it meets the block of the
/// one that it starts on. Triangles behind the origin: t is an average of those
/// of the vertices. And those whose boxes begin behind `limit` already along the
/// longest axis, to which t would be confined: a box begins at most [`WIDENING`]
/// times its largest coordinate and a few roundings before the nearest vertex.
#[inline]
#[target_feature(enable = "avx2")]
fn triangles(ray: &WideRay, probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met {
    let sheared = sheared(ray, probe, block);
    let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = sheared;
    let u = _mm_sub_ps(_mm_mul_ps(cx, by), _mm_mul_ps(cy, bx));
    let v = _mm_sub_ps(_mm_mul_ps(ax, cy), _mm_mul_ps(ay, cx));
    let w = _mm_sub_ps(_mm_mul_ps(bx, ay), _mm_mul_ps(by, ax));
    let low = _mm_min_ps(_mm_min_ps(u, v), w);
    let high = _mm_max_ps(_mm_max_ps(u, v), w);
    let zero = _mm_setzero_ps();
    let crossed = _mm_or_ps(_mm_cmpnlt_ps(low, zero), _mm_cmpngt_ps(high, zero));

    let scale = _mm_set1_ps(ray.scale);
    let [a, b, c] = three!(corner => _mm_mul_ps(sheared[corner][2], scale));
    let first = _mm_min_ps(_mm_min_ps(a, b), c);
    let last = _mm_max_ps(_mm_max_ps(a, b), c);
    let end = _mm_set1_ps((limit + ray.slack) * (1.0 + gamma(16)));
    let ahead = _mm_and_ps(_mm_cmpnlt_ps(last, zero), _mm_cmpnge_ps(first, end));

    let mask =
        mask & _mm_movemask_ps(_mm_andnot_ps(skipped(probe, block), _mm_and_ps(crossed, ahead))) as u32;
    if mask == 0 { Met::NOTHING } else { exact(ray, block, &sheared, mask, limit) }
}

/// All bits of the lanes that the ray leaves out.
#[inline]
#[target_feature(enable = "avx2")]
fn skipped(probe: &RayProbe, block: &Block) -> __m128 {
    // SAFETY: four numbers in a row.
    let prims = unsafe { _mm_loadu_si128(block.prims.as_ptr().cast()) };
    let first = _mm_cmpeq_epi32(prims, _mm_set1_epi32(probe.skip as i32));
    let second = _mm_cmpeq_epi32(prims, _mm_set1_epi32(probe.skip_end as i32));
    _mm_castsi128_ps(_mm_or_si128(first, second))
}

/// The part in f64, on lanes that the ray does not leave out.
#[inline(never)]
#[target_feature(enable = "avx2")]
fn exact(ray: &WideRay, block: &Block, [a, b, c]: &Sheared, mask: u32, limit: f32) -> Met {
    let (ax, ay, az) = (_mm256_cvtps_pd(a[0]), _mm256_cvtps_pd(a[1]), _mm256_cvtps_pd(a[2]));
    let (bx, by, bz) = (_mm256_cvtps_pd(b[0]), _mm256_cvtps_pd(b[1]), _mm256_cvtps_pd(b[2]));
    let (cx, cy, cz) = (_mm256_cvtps_pd(c[0]), _mm256_cvtps_pd(c[1]), _mm256_cvtps_pd(c[2]));
    let u = _mm256_sub_pd(_mm256_mul_pd(cx, by), _mm256_mul_pd(cy, bx));
    let v = _mm256_sub_pd(_mm256_mul_pd(ax, cy), _mm256_mul_pd(ay, cx));
    let w = _mm256_sub_pd(_mm256_mul_pd(bx, ay), _mm256_mul_pd(by, ax));
    let zero = _mm256_setzero_pd();
    let low = _mm256_cmp_pd::<_CMP_LT_OQ>(_mm256_min_pd(_mm256_min_pd(u, v), w), zero);
    let high = _mm256_cmp_pd::<_CMP_GT_OQ>(_mm256_max_pd(_mm256_max_pd(u, v), w), zero);
    let det = _mm256_add_pd(_mm256_add_pd(u, v), w);
    let solid = _mm256_cmp_pd::<_CMP_NEQ_OQ>(det, zero);
    let inside = _mm256_andnot_pd(_mm256_and_pd(low, high), solid);
    let mask = mask & _mm256_movemask_pd(inside) as u32;
    if mask == 0 {
        return Met::NOTHING;
    }
    let inv = _mm256_div_pd(_mm256_set1_pd(1.0), det);
    let sum = _mm256_add_pd(_mm256_mul_pd(u, az), _mm256_mul_pd(v, bz));
    let sum = _mm256_add_pd(sum, _mm256_mul_pd(w, cz));
    let t = _mm256_cvtpd_ps(_mm256_mul_pd(_mm256_mul_pd(sum, inv), _mm256_set1_pd(f64::from(ray.scale))));
    let (t, accepted) = confine(ray, block, t, limit);
    Met {
        mask: mask & _mm_movemask_ps(accepted) as u32,
        t: store4(t),
        u: store4(_mm256_cvtpd_ps(_mm256_mul_pd(v, inv))),
        v: store4(_mm256_cvtpd_ps(_mm256_mul_pd(w, inv))),
    }
}

/// [`RayProbe::confine`] to the boxes of the triangles, and whether anything
/// is left.
#[inline]
#[target_feature(enable = "avx2")]
fn confine(ray: &WideRay, block: &Block, t: __m128, limit: f32) -> (__m128, __m128) {
    let corners = three!(axis => {
        // SAFETY: four f32 in a row.
        let [a, b, c] = three!(corner => unsafe { _mm_load_ps(block.vertices[corner][axis].as_ptr()) });
        [_mm_min_ps(_mm_min_ps(a, b), c), _mm_max_ps(_mm_max_ps(a, b), c)]
    });
    // The largest of the absolute values.
    let [[x0, x1], [y0, y1], [z0, z1]] = corners;
    let lowest = _mm_min_ps(_mm_min_ps(x0, y0), z0);
    let highest = _mm_max_ps(_mm_max_ps(x1, y1), z1);
    let size = _mm_max_ps(highest, _mm_xor_ps(lowest, _mm_set1_ps(-0.0)));
    let widening = _mm_mul_ps(size, _mm_set1_ps(WIDENING));

    let zero = _mm_setzero_ps();
    let (mut near, mut far) = (zero, _mm_set1_ps(f32::INFINITY));
    for (axis, [low, high]) in corners.into_iter().enumerate() {
        let (inv_dir, inv_far) = (half!(ray.inv_dir[axis]), half!(ray.inv_far[axis]));
        let error = _mm_and_ps(widening, _mm_cmplt_ps(low, high));
        let low = _mm_add_ps(_mm_sub_ps(low, error), half!(ray.back[axis]));
        let high = _mm_add_ps(_mm_add_ps(high, error), half!(ray.back[axis]));
        let (enter, leave) = (_mm_blendv_ps(low, high, inv_dir), _mm_blendv_ps(high, low, inv_dir));
        near = _mm_max_ps(_mm_mul_ps(enter, inv_dir), near);
        far = _mm_min_ps(_mm_mul_ps(leave, inv_far), far);
    }
    let finite = _mm_and_ps(_mm_cmpgt_ps(t, zero), _mm_cmplt_ps(t, _mm_set1_ps(f32::INFINITY)));
    let crossed = _mm_cmplt_ps(near, far);
    let t = _mm_min_ps(far, _mm_max_ps(near, t));
    let within = _mm_and_ps(_mm_cmpgt_ps(t, zero), _mm_cmplt_ps(t, _mm_set1_ps(limit)));
    (t, _mm_and_ps(_mm_and_ps(finite, crossed), within))
}

/// Möller and Trumbore 1997, in f32, on a block of edges.
#[inline]
#[target_feature(enable = "avx2")]
fn loose(probe: &RayProbe, block: &Block, mask: u32, limit: f32) -> Met {
    type Lanes = [__m128; 3];
    let cross = |a: &Lanes, b: &Lanes| -> Lanes {
        three!(k => {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            _mm_sub_ps(_mm_mul_ps(a[i], b[j]), _mm_mul_ps(a[j], b[i]))
        })
    };
    let dot = |a: &Lanes, b: &Lanes| {
        let xy = _mm_add_ps(_mm_mul_ps(a[0], b[0]), _mm_mul_ps(a[1], b[1]));
        _mm_add_ps(xy, _mm_mul_ps(a[2], b[2]))
    };
    // SAFETY: four f32 in a row.
    let [a, e1, e2] = three!(corner =>
        three!(axis => unsafe { _mm_load_ps(block.vertices[corner][axis].as_ptr()) }));
    let dir = three!(axis => _mm_set1_ps(probe.dir[axis]));
    let origin = three!(axis => _mm_set1_ps(probe.origin[axis]));
    let s = three!(axis => _mm_sub_ps(origin[axis], a[axis]));
    let p = cross(&dir, &e2);
    let inv = _mm_div_ps(_mm_set1_ps(1.0), dot(&e1, &p));
    let u = _mm_mul_ps(dot(&s, &p), inv);
    let q = cross(&s, &e1);
    let v = _mm_mul_ps(dot(&dir, &q), inv);
    let t = _mm_mul_ps(dot(&e2, &q), inv);
    let zero = _mm_setzero_ps();
    let inside = _mm_and_ps(_mm_cmpge_ps(u, zero), _mm_cmpge_ps(v, zero));
    let inside = _mm_and_ps(inside, _mm_cmple_ps(_mm_add_ps(u, v), _mm_set1_ps(1.0)));
    let within = _mm_and_ps(_mm_cmpgt_ps(t, zero), _mm_cmplt_ps(t, _mm_set1_ps(limit)));
    let mask = mask & _mm_movemask_ps(_mm_and_ps(inside, within)) as u32;
    if mask == 0 {
        return Met::NOTHING;
    }
    Met { mask, t: store4(t), u: store4(u), v: store4(v) }
}
