//! Geometry without rounding: whether a ray crosses a triangle, for numbers
//! that are taken as they are.
//!
//! A number is a sum of f64 that do not overlap (Shewchuk 1997, "Adaptive
//! Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates",
//! sections 2.2 to 2.6). Sums and products of such are exact as long as no part
//! of them leaves the range of f64, which products of five f32 never do.

use crate::math::Vec3;

/// An exact number: the sum of its parts, smallest first, none of them zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Exact(Vec<f64>);

impl From<f32> for Exact {
    fn from(x: f32) -> Exact {
        Exact(if x == 0.0 { Vec::new() } else { vec![f64::from(x)] })
    }
}

/// a + b and its rounding error (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let there = sum - a;
    (sum, (a - (sum - there)) + (b - there))
}

impl Exact {
    /// Adds one number (GROW-EXPANSION).
    fn grow(&mut self, x: f64) {
        let (mut carried, mut parts) = (x, Vec::with_capacity(self.0.len() + 1));
        for part in &self.0 {
            let (sum, error) = two_sum(carried, *part);
            if error != 0.0 {
                parts.push(error);
            }
            carried = sum;
        }
        if carried != 0.0 {
            parts.push(carried);
        }
        self.0 = parts;
    }

    pub(super) fn plus(&self, other: &Exact) -> Exact {
        let mut sum = self.clone();
        other.0.iter().for_each(|part| sum.grow(*part));
        sum
    }

    pub(super) fn minus(&self, other: &Exact) -> Exact {
        let mut sum = self.clone();
        other.0.iter().for_each(|part| sum.grow(-*part));
        sum
    }

    pub(super) fn times(&self, other: &Exact) -> Exact {
        let mut sum = Exact(Vec::new());
        for a in &self.0 {
            for b in &other.0 {
                let product = a * b;
                sum.grow(a.mul_add(*b, -product));
                sum.grow(product);
            }
        }
        sum
    }

    /// -1, 0 or 1: the largest part decides.
    pub(super) fn sign(&self) -> i32 {
        self.0.last().map_or(0, |part| if *part < 0.0 { -1 } else { 1 })
    }
}

/// A vector of exact numbers.
pub(super) type Point = [Exact; 3];

/// A vector as it is.
pub(super) fn point(v: Vec3) -> Point {
    v.to_array().map(Exact::from)
}

fn zip(a: &Point, b: &Point, f: fn(&Exact, &Exact) -> Exact) -> Point {
    std::array::from_fn(|k| f(&a[k], &b[k]))
}

fn dot(a: &Point, b: &Point) -> Exact {
    let [x, y, z] = zip(a, b, Exact::times);
    x.plus(&y).plus(&z)
}

fn cross(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i].times(&b[j]).minus(&a[j].times(&b[i]))
    })
}

/// On which side of the plane of a triangle a point is: 1 where its corners go
/// around against the clock, 0 on it.
pub(super) fn side(p: &Point, corners: [Vec3; 3]) -> i32 {
    let [a, b, c] = corners.map(point);
    let normal = cross(&zip(&b, &a, Exact::minus), &zip(&c, &a, Exact::minus));
    dot(&zip(p, &a, Exact::minus), &normal).sign()
}

/// On which side of the plane of a triangle a direction leads.
pub(super) fn leads(dir: Vec3, corners: [Vec3; 3]) -> i32 {
    let [a, b, c] = corners.map(point);
    dot(&point(dir), &cross(&zip(&b, &a, Exact::minus), &zip(&c, &a, Exact::minus))).sign()
}

/// Whether the points `origin` + t · `dir` with t > 0 have one in common with a
/// triangle, its edges included. A direction in its plane crosses nothing.
pub(super) fn crosses(origin: &Point, dir: Vec3, corners: [Vec3; 3]) -> bool {
    let towards = leads(dir, corners);
    // t is the distance from the plane over the speed towards it.
    if towards == 0 || side(origin, corners) != -towards {
        return false;
    }
    let dir = point(dir);
    let [a, b, c] = corners.map(|corner| zip(&point(corner), origin, Exact::minus));
    let edges = [(&a, &b), (&b, &c), (&c, &a)].map(|(p, q)| dot(&dir, &cross(p, q)).sign());
    !(edges.contains(&1) && edges.contains(&-1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_products_lose_nothing() {
        let (large, small) = (Exact::from(1e30), Exact::from(1e-30));
        let sum = large.plus(&small);
        assert_eq!(sum.minus(&large), small);
        let square = sum.times(&sum);
        // (a + b)² − a² − 2ab = b².
        let mixed = large.times(&small);
        let rest = square.minus(&large.times(&large)).minus(&mixed).minus(&mixed);
        assert_eq!(rest.minus(&small.times(&small)).sign(), 0);
        assert_eq!((rest.sign(), large.minus(&large).sign(), small.minus(&large).sign()), (1, 0, -1));
    }

    #[test]
    fn rays_cross_to_the_last_bit() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let from = |x: f32, y: f32| point(Vec3::new(x, y, 1.0));
        let down = Vec3::NEG_Z;
        assert!(crosses(&from(0.25, 0.25), down, corners));
        assert!(crosses(&from(0.0, 0.0), down, corners) && crosses(&from(0.5, 0.5), down, corners));
        assert!(!crosses(&from(-1e-45, 0.5), down, corners));
        assert!(!crosses(&from(0.5, 0.5f32.next_up()), down, corners));
        assert!(!crosses(&from(0.25, 0.25), -down, corners), "behind it");
        assert!(!crosses(&point(Vec3::ZERO), down, corners), "it starts there");
        assert!(!crosses(&from(0.25, 0.25), Vec3::X, corners), "along it");
    }

    #[test]
    fn sides_are_told_where_floats_cannot() {
        let corners = [Vec3::new(0.1, 1e7, 3.0), Vec3::new(-0.7, 2.0, 1e-9), Vec3::new(0.3, -5e6, 1e3)];
        corners.iter().for_each(|corner| assert_eq!(side(&point(*corner), corners), 0));
        let [above, below] = [f32::next_up, f32::next_down]
            .map(|step| side(&point(Vec3::new(-0.7, step(2.0), 1e-9)), corners));
        assert_eq!((above * below, leads(corners[1] - corners[1], corners)), (-1, 0));
    }
}
