//! Tests a ray against the two boxes of a node, in plain Rust and with AVX2.
//!
//! Both do the same operations in the same order on four lanes (near end of
//! both boxes, far end of both boxes), so they agree bit for bit. Far ends are
//! carried negated, so that one maximum serves both. `max` keeps its second
//! operand when the first is NaN, as the instruction does.
//!
//! [`Avx2`] is a token that only detection makes; [`Avx2::run`] is the door: it
//! compiles a whole traversal for the instruction set, since a function for it
//! does not inline into plain callers.

#![allow(
    unsafe_code,
    reason = "the one place where CPU features are entered; each block says why it is sound"
)]

use super::bvh2::Node;
use crate::shape::RayProbe;

/// A way to test the two boxes of a node.
pub trait BoxTest: Copy {
    /// The ray as this way wants it.
    type Ray: Copy;

    /// Prepares a ray.
    fn prepare(self, probe: &RayProbe) -> Self::Ray;

    /// For each box: whether the ray meets it before `limit`, and where
    /// it enters.
    fn test(self, ray: &Self::Ray, node: &Node, limit: f32) -> ([bool; 2], [f32; 2]);
}

/// Work that is compiled once for each way to test boxes. `run` should be
/// `#[inline(always)]`.
pub trait Task {
    /// What it gives.
    type Output;

    /// Does it.
    fn run<T: BoxTest>(self, boxes: T) -> Self::Output;
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
    negative: [bool; 3],
}

/// Without what has no meaning.
#[inline(always)]
pub fn three(&[x, y, z, _]: &[f32; 4]) -> [f32; 3] {
    [x, y, z]
}

impl BoxTest for Portable {
    type Ray = PortableRay;

    #[inline(always)]
    fn prepare(self, probe: &RayProbe) -> PortableRay {
        PortableRay {
            origin: three(&probe.origin),
            inv_dir: three(&probe.inv_dir),
            inv_far: three(&probe.inv_far),
            negative: three(&probe.inv_dir).map(f32::is_sign_negative),
        }
    }

    #[inline(always)]
    fn test(self, ray: &PortableRay, node: &Node, limit: f32) -> ([bool; 2], [f32; 2]) {
        let mut m = [0.0, 0.0, -limit, -limit];
        for axis in 0..3 {
            let d = node.planes[axis].map(|x| x - ray.origin[axis]);
            let d = if ray.negative[axis] { [d[2], d[3], d[0], d[1]] } else { d };
            let (near, far) = (ray.inv_dir[axis], -ray.inv_far[axis]);
            let t = [d[0] * near, d[1] * near, d[2] * far, d[3] * far];
            for lane in 0..4 {
                m[lane] = if t[lane] > m[lane] { t[lane] } else { m[lane] };
            }
        }
        ([m[0] < -m[2], m[1] < -m[3]], [m[0], m[1]])
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::Avx2;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{BoxTest, Node, RayProbe, Task};

    /// Proof that the CPU has AVX2 and the bit counts that came with it: BMI1,
    /// LZCNT and POPCNT.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(());

    /// A ray for [`Avx2`]: the origin in all four lanes.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2Ray {
        origin: [__m128; 3],
        /// Reciprocal directions of near ends, and negated ones of far ends.
        inv_dir: [__m128; 3],
        /// Lane indices that put near ends first.
        order: [__m128i; 3],
    }

    impl Avx2 {
        /// The token, when the CPU has AVX2.
        pub fn detect() -> Option<Avx2> {
            let all = std::arch::is_x86_feature_detected!("avx2")
                && std::arch::is_x86_feature_detected!("bmi1")
                && std::arch::is_x86_feature_detected!("lzcnt")
                && std::arch::is_x86_feature_detected!("popcnt");
            all.then_some(Avx2(()))
        }

        /// Does a task compiled for AVX2.
        #[inline]
        pub fn run<T: Task>(self, task: T) -> T::Output {
            // SAFETY: the token exists only where AVX2 has been detected.
            unsafe { run_avx2(self, task) }
        }
    }

    #[target_feature(enable = "avx2")]
    fn run_avx2<T: Task>(token: Avx2, task: T) -> T::Output {
        task.run(token)
    }

    impl BoxTest for Avx2 {
        type Ray = Avx2Ray;

        #[inline(always)]
        fn prepare(self, probe: &RayProbe) -> Avx2Ray {
            // SAFETY: the token exists only where AVX2 has been detected.
            unsafe { prepare(probe) }
        }

        #[inline(always)]
        fn test(self, ray: &Avx2Ray, node: &Node, limit: f32) -> ([bool; 2], [f32; 2]) {
            // SAFETY: the token exists only where AVX2 has been detected.
            unsafe { test(ray, node, limit) }
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn prepare(probe: &RayProbe) -> Avx2Ray {
        let straight = _mm_setr_epi32(0, 1, 2, 3);
        let crossed = _mm_setr_epi32(2, 3, 0, 1);
        let order = |axis: usize| if probe.inv_dir[axis].is_sign_negative() { crossed } else { straight };
        let [x, y, z, _] = probe.origin;
        let inv = |near: f32, far: f32| _mm_setr_ps(near, near, -far, -far);
        let (n, f) = (&probe.inv_dir, &probe.inv_far);
        Avx2Ray {
            origin: [_mm_set1_ps(x), _mm_set1_ps(y), _mm_set1_ps(z)],
            inv_dir: [inv(n[0], f[0]), inv(n[1], f[1]), inv(n[2], f[2])],
            order: [order(0), order(1), order(2)],
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn test(ray: &Avx2Ray, node: &Node, limit: f32) -> ([bool; 2], [f32; 2]) {
        let mut m = _mm_setr_ps(0.0, 0.0, -limit, -limit);
        for axis in 0..3 {
            // SAFETY: `planes[axis]` is four f32 in a row.
            let planes = unsafe { _mm_loadu_ps(node.planes[axis].as_ptr()) };
            let d = _mm_permutevar_ps(_mm_sub_ps(planes, ray.origin[axis]), ray.order[axis]);
            m = _mm_max_ps(_mm_mul_ps(d, ray.inv_dir[axis]), m);
        }
        let far = _mm_xor_ps(_mm_movehl_ps(m, m), _mm_set1_ps(-0.0));
        let mask = _mm_movemask_ps(_mm_cmplt_ps(m, far));
        let near = [_mm_cvtss_f32(m), _mm_cvtss_f32(_mm_movehdup_ps(m))];
        ([mask & 1 != 0, mask & 2 != 0], near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Bounds, Ray, Vec3};

    /// Plain and AVX2 box tests agree on 200,000 pairs, special values included.
    #[test]
    #[cfg(target_arch = "x86_64")]
    fn avx2_agrees_with_plain_rust() {
        let Some(avx2) = Avx2::detect() else { return };
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            match (state >> 59) & 15 {
                0 => 0.0,
                1 => -0.0,
                2 => 1.0,
                3 => 1e-38,
                _ => ((state >> 33) as u32 as f32) * 2.0f32.powi(-30) - 1.0,
            }
        };
        let mut hits = 0;
        for _ in 0..200_000 {
            let mut v = || Vec3::new(random(), random(), random());
            let boxes = [Bounds::of_points([v(), v()]), Bounds::of_points([v(), v()])];
            let node = Node::new(boxes, [0, 0]);
            let Some(probe) = RayProbe::new(&Ray::new(v() * 2.0, v())) else { continue };
            let a = Portable.test(&Portable.prepare(&probe), &node, 3.0);
            let b = avx2.test(&avx2.prepare(&probe), &node, 3.0);
            assert_eq!(a.0, b.0, "{probe:?} {node:?}");
            assert_eq!(a.1.map(f32::to_bits), b.1.map(f32::to_bits));
            hits += usize::from(a.0[0]);
            // The interval of one box is that of the node's lane.
            let (near, far) = probe.interval(&boxes[0]);
            assert_eq!(near < far.min(3.0), a.0[0]);
            assert_eq!(near, a.1[0]);
        }
        assert!(hits > 5_000, "{hits} hits");
    }
}
