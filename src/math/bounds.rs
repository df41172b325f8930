//! Axis-aligned boxes.

use super::{DVec3, Vec3};

/// An axis-aligned box, `min` ≤ `max` in each axis unless it is empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Bounds {
    /// The box that contains nothing: the neutral element of [`Bounds::union`].
    pub const EMPTY: Bounds = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box of one point.
    #[must_use]
    pub fn point(p: Vec3) -> Bounds {
        Bounds { min: p, max: p }
    }

    /// The smallest box that contains all `points`.
    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Bounds {
        points.into_iter().fold(Bounds::EMPTY, Bounds::grow)
    }

    /// The smallest box that contains this one and `p`.
    #[must_use]
    pub fn grow(self, p: Vec3) -> Bounds {
        Bounds { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box that contains both.
    #[must_use]
    pub fn union(self, other: Bounds) -> Bounds {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True when the box contains no point.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Edge lengths; negative for an empty box.
    #[must_use]
    pub fn extent(self) -> Vec3 {
        self.max - self.min
    }

    /// The middle of the box.
    #[must_use]
    pub fn centre(self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// The eight corners.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i: usize| {
            let pick = |bit: usize, axis: usize| if i >> bit & 1 == 0 { min[axis] } else { max[axis] };
            DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
        })
    }

    /// Half the surface area: what the surface area heuristic needs. Zero for
    /// an empty box.
    #[must_use]
    pub fn half_area(self) -> f32 {
        let d = self.extent().max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Centre and radius of the sphere around the box; radius 0 when empty.
    #[must_use]
    pub fn bounding_sphere(self) -> (Vec3, f32) {
        if self.is_empty() {
            return (Vec3::ZERO, 0.0);
        }
        (self.centre(), (self.extent() * 0.5).length())
    }
}
