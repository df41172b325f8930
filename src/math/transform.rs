//! Affine transforms in f64, kept with their inverse.

use super::{DMat4, DQuat, DVec3, Vec3};

/// An affine or projective transform and its inverse, in f64: scene files are
/// read and composed in f64, and rounded to f32 once, at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Maps local to world, column vectors: p' = M·p.
    pub matrix: DMat4,
    /// Maps world to local.
    pub inverse: DMat4,
}

/// Translation, rotation and scale of an affine transform without shear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decomposition {
    /// Translation.
    pub translation: DVec3,
    /// Rotation.
    pub rotation: DQuat,
    /// Scale per local axis.
    pub scale: DVec3,
}

impl Default for Transform {
    fn default() -> Self {
        Transform::IDENTITY
    }
}

impl Transform {
    /// Leaves everything where it is.
    pub const IDENTITY: Transform = Transform { matrix: DMat4::IDENTITY, inverse: DMat4::IDENTITY };

    /// From a matrix; `None` when it has no finite inverse.
    #[must_use]
    pub fn from_matrix(matrix: DMat4) -> Option<Transform> {
        let inverse = matrix.inverse();
        (matrix.is_finite() && inverse.is_finite()).then_some(Transform { matrix, inverse })
    }

    /// Moves by `v`.
    #[must_use]
    pub fn translate(v: DVec3) -> Transform {
        Transform { matrix: DMat4::from_translation(v), inverse: DMat4::from_translation(-v) }
    }

    /// `self` after `first`: maps p to self(first(p)).
    #[must_use]
    pub fn after(&self, first: &Transform) -> Transform {
        Transform { matrix: self.matrix * first.matrix, inverse: first.inverse * self.inverse }
    }

    /// The transform that undoes this one.
    #[must_use]
    pub fn inverted(&self) -> Transform {
        Transform { matrix: self.inverse, inverse: self.matrix }
    }

    /// Maps a point (affine transforms only: w is not divided out).
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.matrix.transform_point3(p)
    }

    /// Maps a vector: no translation.
    #[must_use]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.matrix.transform_vector3(v)
    }

    /// Maps a normal by the inverse transpose; not normalised.
    #[must_use]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse.transpose().transform_vector3(n)
    }

    /// Maps an f32 point through f64, rounding once.
    #[must_use]
    pub fn point_f32(&self, p: Vec3) -> Vec3 {
        self.point(p.as_dvec3()).as_vec3()
    }

    /// Determinant of the linear part: negative when it mirrors.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        let m = self.matrix;
        m.x_axis.truncate().cross(m.y_axis.truncate()).dot(m.z_axis.truncate())
    }

    /// Translation, rotation, scale; shear, if any, is lost.
    #[must_use]
    pub fn decompose(&self) -> Decomposition {
        let (scale, rotation, translation) = self.matrix.to_scale_rotation_translation();
        Decomposition { translation, rotation, scale }
    }
}
