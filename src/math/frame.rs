//! Orthonormal frames: world space to a local space whose z is a normal.

use super::Vec3;

/// An orthonormal basis. `to_local` maps `n` to (0, 0, 1), so that the cosine
/// of a local direction with the normal is its z.
///
/// The handedness is that of the caller: [`Frame::flipped`] turns a
/// right-handed frame into a left-handed one on purpose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, local x.
    pub s: Vec3,
    /// Second tangent, local y.
    pub t: Vec3,
    /// Normal, local z.
    pub n: Vec3,
}

impl Frame {
    /// A frame around the unit vector `n`. Duff et al. 2017, "Building an
    /// Orthonormal Basis, Revisited", listing 3: continuous but for n.z = 0.
    #[must_use]
    pub fn from_normal(n: Vec3) -> Frame {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// A frame around the unit vector `n` whose `s` lies as near to `dpdu` as
    /// it can; any tangent when `dpdu` is parallel to `n` or zero.
    #[must_use]
    pub fn from_normal_tangent(n: Vec3, dpdu: Vec3) -> Frame {
        let s = dpdu - n * n.dot(dpdu);
        let length_squared = s.length_squared();
        if !(length_squared > 1e-12 * dpdu.length_squared()) || !length_squared.is_finite() {
            return Frame::from_normal(n);
        }
        let s = s / length_squared.sqrt();
        Frame { s, t: n.cross(s), n }
    }

    /// World to local.
    #[must_use]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.s.dot(v), self.t.dot(v), self.n.dot(v))
    }

    /// Local to world.
    #[must_use]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }

    /// The frame seen from the other side: z is negated, x and y stay.
    #[must_use]
    pub fn flipped(&self) -> Frame {
        Frame { s: self.s, t: self.t, n: -self.n }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_everywhere() {
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(0.6, 0.0, -0.8), Vec3::new(1e-8, 1e-8, -1.0)] {
            let n = n.normalize();
            for f in [Frame::from_normal(n), Frame::from_normal_tangent(n, Vec3::new(0.3, 0.2, 0.9))] {
                assert!((f.s.cross(f.t) - n).length() < 1e-6, "{f:?}");
                assert!(f.s.dot(f.t).abs() < 1e-6 && (f.s.length() - 1.0).abs() < 1e-6);
                let v = Vec3::new(0.1, -0.7, 0.4);
                assert!((f.to_world(f.to_local(v)) - v).length() < 1e-6);
            }
        }
    }
}
