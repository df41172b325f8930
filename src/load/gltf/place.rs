//! Where things stand in the world, and how they move.

use super::motion::{Stage, TOLERANCE};
use crate::desc::Value;
use crate::math::{DMat4, DVec3, Motion, Transform};

/// The size that is left of what a motion scales to nothing.
const VANISHED: f64 = 1e-6;

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
    let poses = stage.sampled(at, off);
    let keys: Vec<Option<Transform>> =
        poses.iter().map(|(_, m)| Transform::from_matrix(*m).filter(solid)).collect();
    // A key where nothing is left is next to nothing of its neighbour: a motion
    // without it would stay at the size it had.
    let vanished = |i: usize| {
        let before = keys[..i].iter().rev().find_map(|k| *k);
        let near = before.or_else(|| keys[i..].iter().find_map(|k| *k))?;
        let mut matrix = near.matrix * DMat4::from_scale(DVec3::splat(VANISHED));
        matrix.w_axis = poses[i].1.w_axis;
        Transform::from_matrix(matrix).filter(solid)
    };
    let keys: Vec<(f64, Transform)> = poses
        .iter()
        .enumerate()
        .filter_map(|(i, (time, _))| Some((*time, keys[i].or_else(|| vanished(i))?)))
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

/// Where a light or a camera of a node is: the translation of a matrix and its
/// orientation without scale. What is seen along −z stays exactly there, as a
/// scale counts only in where the axes of a child point.
pub fn rigid(m: DMat4) -> DMat4 {
    let z = m.z_axis.truncate().normalize_or(DVec3::Z);
    let y = m.y_axis.truncate();
    let y = (y - z * z.dot(y)).normalize_or(z.any_orthonormal_vector());
    // A mirrored node mirrors what its camera sees.
    let x = y.cross(z) * if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), m.w_axis)
}
