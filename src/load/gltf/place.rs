//! Where things stand in the world, and how they move.

use super::motion::{Stage, TOLERANCE};
use crate::desc::Value;
use crate::math::{DMat4, DVec3, Motion, Transform};

/// Where something stands, at one or several times.
#[derive(Clone, Debug)]
pub enum Placement {
    /// It stands still.
    Still(Transform),
    /// It moves while the shutter is open.
    Moving(Motion),
}

impl Placement {
    /// As a parameter.
    pub fn value(&self) -> Value {
        match self {
            Placement::Still(transform) => Value::Transform(*transform),
            Placement::Moving(motion) => Value::Motion(motion.clone()),
        }
    }

    /// Where it stands when the shutter opens.
    pub fn first(&self) -> Transform {
        match self {
            Placement::Still(transform) => *transform,
            Placement::Moving(motion) => motion.times().next().map_or(Transform::IDENTITY, |t| motion.at(t)),
        }
    }
}

/// A node's place in the world, times a matrix of its own; `points` (in the
/// coordinates of that matrix) tell how far off a motion between keys is.
/// `None` if nothing is left of it: a scale of zero.
pub fn of(stage: &Stage, node: usize, local: &DMat4, points: &[DVec3]) -> Option<Placement> {
    follow(stage, node, points, |world| world * *local)
}

/// As [`of`], with any function of the node's matrix.
pub fn follow(
    stage: &Stage,
    node: usize,
    points: &[DVec3],
    place: impl Fn(DMat4) -> DMat4,
) -> Option<Placement> {
    let still = Transform::from_matrix(place(stage.still()[node]));
    if !stage.moving[node] {
        return still.filter(solid).map(Placement::Still);
    }
    let at = |time: f64| place(stage.pose(time)[node]);
    let size = |m: &DMat4| {
        let placed = points.iter().map(|p| m.transform_point3(*p));
        let low = placed.clone().reduce(DVec3::min).unwrap_or(DVec3::ZERO);
        let high = placed.reduce(DVec3::max).unwrap_or(DVec3::ZERO);
        (high - low).length()
    };
    let allowed = TOLERANCE * size(&place(stage.still()[node]));
    let off = |a: &DMat4, b: &DMat4, s: f64, truth: &DMat4| {
        let (Some(a), Some(b)) = (Transform::from_matrix(*a), Transform::from_matrix(*b)) else {
            return true;
        };
        let Some(motion) = Motion::new(&[(0.0, a), (1.0, b)]) else { return true };
        let between = motion.at(s).matrix;
        points.iter().any(|p| between.transform_point3(*p).distance(truth.transform_point3(*p)) > allowed)
    };
    let keys: Vec<(f64, Transform)> = stage
        .sampled(at, off)
        .into_iter()
        .filter_map(|(time, m)| Some((time, Transform::from_matrix(m).filter(solid)?)))
        .collect();
    let motion = Motion::new(&keys)?;
    Some(motion.as_still().map_or(Placement::Moving(motion), Placement::Still))
}

/// Not squeezed to nothing along some axis.
fn solid(transform: &Transform) -> bool {
    let m = transform.matrix;
    let volume = transform.determinant().abs();
    let sides = m.x_axis.truncate().length() * m.y_axis.truncate().length() * m.z_axis.truncate().length();
    volume.is_finite() && volume > 0.0 && sides > 0.0
}

/// The eight corners of a box.
pub fn corners(low: DVec3, high: DVec3) -> Vec<DVec3> {
    let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
    (0..8).map(|i| DVec3::new(pick(i, 0), pick(i, 1), pick(i, 2))).collect()
}

/// The rotation of a matrix without its scale, and its translation: where a
/// light or a camera of a node is.
pub fn rigid(m: DMat4) -> DMat4 {
    let x = m.x_axis.truncate().normalize_or(DVec3::X);
    let y = m.y_axis.truncate();
    let y = (y - x * x.dot(y)).normalize_or(x.any_orthonormal_vector());
    // glTF looks along −z; a mirrored node mirrors what its camera sees.
    let z = x.cross(y) * if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), m.w_axis)
}
