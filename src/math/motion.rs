//! Transforms that change over time.

use super::{DMat3, DMat4, DQuat, DVec3, Transform};

/// A transform at several times; between two of them translation goes
/// linearly, rotation along the shortest arc at constant speed (slerp), and
/// what is left (scale and shear) linearly, after Shoemake and Duff 1992,
/// "Matrix Animation and Polar Decomposition". Before the first time and after
/// the last it stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    keys: Vec<MotionKey>,
}

/// A transform at a time, taken apart: M = T·R·S.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MotionKey {
    time: f64,
    transform: Transform,
    translation: DVec3,
    rotation: DQuat,
    /// Scale and shear; symmetric up to rounding.
    stretch: DMat3,
    /// Half the angle of the turn to the next key, and 1 over its sine.
    half_turn: [f64; 2],
}

/// An affine transform and its inverse, without their last rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// The linear part.
    pub matrix: DMat3,
    /// What is added.
    pub translation: DVec3,
    /// The inverse of the linear part.
    pub inverse: DMat3,
    /// What the inverse adds.
    pub back: DVec3,
}

impl Affine {
    /// The affine part of a transform.
    #[must_use]
    pub fn of(t: &Transform) -> Affine {
        Affine {
            matrix: DMat3::from_mat4(t.matrix),
            translation: t.matrix.w_axis.truncate(),
            inverse: DMat3::from_mat4(t.inverse),
            back: t.inverse.w_axis.truncate(),
        }
    }
}

impl Motion {
    /// From transforms at times, which must rise. `None` when there are none,
    /// or the times do not rise, or are not finite.
    #[must_use]
    pub fn new(keys: &[(f64, Transform)]) -> Option<Motion> {
        let rising = keys.windows(2).all(|k| k[0].0 < k[1].0);
        if keys.is_empty() || !rising || keys.iter().any(|(time, _)| !time.is_finite()) {
            return None;
        }
        let mut keys: Vec<MotionKey> = keys.iter().map(|(time, t)| MotionKey::new(*time, t)).collect();
        for i in 1..keys.len() {
            // Both signs are the same rotation; take the nearer one.
            if keys[i - 1].rotation.dot(keys[i].rotation) < 0.0 {
                keys[i].rotation = -keys[i].rotation;
            }
            let angle = 0.5 * keys[i - 1].rotation.angle_between(keys[i].rotation);
            keys[i - 1].half_turn = [angle, 1.0 / angle.sin()];
        }
        Some(Motion { keys })
    }

    /// Something that does not move.
    #[must_use]
    pub fn still(transform: Transform) -> Motion {
        Motion { keys: vec![MotionKey::new(0.0, &transform)] }
    }

    /// The times given, rising.
    pub fn times(&self) -> impl Iterator<Item = f64> + '_ {
        self.keys.iter().map(|k| k.time)
    }

    /// The transform, when it is the same at all times.
    #[must_use]
    pub fn as_still(&self) -> Option<Transform> {
        let first = self.keys[0].transform;
        self.keys.iter().all(|k| k.transform == first).then_some(first)
    }

    /// The transform at a time. At a time given it is the one given, exactly.
    #[must_use]
    pub fn at(&self, time: f64) -> Transform {
        let next = self.keys.partition_point(|k| k.time <= time);
        let (Some(b), Some(a)) = (self.keys.get(next), next.checked_sub(1).map(|i| &self.keys[i])) else {
            return if next == 0 { self.keys[0].transform } else { self.keys[next - 1].transform };
        };
        if a.time == time || a.transform == b.transform {
            return a.transform;
        }
        let (linear, translation) = MotionKey::between(a, b, (time - a.time) / (b.time - a.time));
        let mut matrix = DMat4::from_mat3(linear);
        matrix.w_axis = translation.extend(1.0);
        // A stretch that passes through zero has no inverse.
        Transform::from_matrix(matrix).unwrap_or(a.transform)
    }

    /// The same, quicker: for every ray.
    #[must_use]
    pub fn affine_at(&self, time: f64) -> Affine {
        let next = self.keys.partition_point(|k| k.time <= time);
        let (Some(b), Some(a)) = (self.keys.get(next), next.checked_sub(1).map(|i| &self.keys[i])) else {
            return Affine::of(&self.keys[next.max(1) - 1].transform);
        };
        if a.time == time {
            return Affine::of(&a.transform);
        }
        let (matrix, translation) = MotionKey::between(a, b, (time - a.time) / (b.time - a.time));
        let inverse = matrix.inverse();
        if !inverse.is_finite() {
            return Affine::of(&a.transform);
        }
        Affine { matrix, translation, inverse, back: -(inverse * translation) }
    }

    /// The motion with every key changed by `f`.
    #[must_use]
    pub fn map(&self, f: impl Fn(&Transform) -> Transform) -> Motion {
        let keys: Vec<_> = self.keys.iter().map(|k| (k.time, f(&k.transform))).collect();
        Motion::new(&keys).unwrap_or_else(|| self.clone())
    }

    /// `self` after `inner`. Exact at the keys of both; where both move, a turn
    /// about a point that moves is no single turn, so keys are added between.
    #[must_use]
    pub fn after(&self, inner: &Motion) -> Motion {
        if let Some(outer) = self.as_still() {
            return inner.map(|m| outer.after(m));
        }
        if let Some(inner) = inner.as_still() {
            return self.map(|m| m.after(&inner));
        }
        const BETWEEN: u32 = 8;
        let mut times: Vec<f64> = self.times().chain(inner.times()).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let step = |pair: &[f64], i: u32| pair[0] + (pair[1] - pair[0]) * f64::from(i) / f64::from(BETWEEN);
        let between = times.windows(2).flat_map(|pair| (1..BETWEEN).map(move |i| step(pair, i)));
        let mut all: Vec<f64> = times.iter().copied().chain(between).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let keys: Vec<_> = all.iter().map(|t| (*t, self.at(*t).after(&inner.at(*t)))).collect();
        Motion::new(&keys).unwrap_or_else(|| self.clone())
    }

    /// The motion during [`open`, `close`] with time stretched to [0, 1]; a
    /// single key when the two are equal or nothing moves between them.
    #[must_use]
    pub fn during(&self, open: f64, close: f64) -> Motion {
        if !(close > open) {
            return Motion::still(self.at(open));
        }
        let inside = self.times().filter(|t| *t > open && *t < close);
        let times: Vec<f64> = std::iter::once(open).chain(inside).chain(std::iter::once(close)).collect();
        let keys: Vec<_> = times.iter().map(|t| ((t - open) / (close - open), self.at(*t))).collect();
        let motion = Motion::new(&keys).unwrap_or_else(|| Motion::still(self.at(open)));
        match motion.as_still() {
            Some(transform) => Motion::still(transform),
            None => motion,
        }
    }

    /// An upper bound of the angle in radians that any normal turns by, away from
    /// where it is at the first time; `None` when the stretch changes, so that
    /// normals turn by themselves.
    #[must_use]
    pub fn turn(&self) -> Option<f64> {
        let size = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let same = |k: &MotionKey| size(&(k.stretch - self.keys[0].stretch)) <= 1e-9 * size(&k.stretch);
        let angle = |pair: &[MotionKey]| pair[0].rotation.angle_between(pair[1].rotation);
        self.keys.iter().all(same).then(|| self.keys.windows(2).map(angle).sum())
    }

    /// Calls `f` with (start, end, bound on the second derivative of a point's
    /// path, per unit of the point's largest distance from the origin) of each
    /// stretch between two times.
    ///
    /// Between two keys a point p goes along T(s) + R(s)·S(s)·p with T and S
    /// linear and R turning by an angle θ in all, 0 ≤ s ≤ 1; twice derived that
    /// is R(s)·(ω×(ω×S·p) + 2·ω×S'·p), at most θ²·|S|·|p| + 2·θ·|S'|·|p|.
    pub fn stretches(&self, mut f: impl FnMut(f64, f64, f64)) {
        for pair in self.keys.windows(2) {
            let [a, b] = pair else { continue };
            let angle = a.rotation.angle_between(b.rotation);
            let size = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
            let largest = size(&a.stretch).max(size(&b.stretch));
            let change = size(&(b.stretch - a.stretch));
            f(a.time, b.time, angle * angle * largest + 2.0 * angle * change);
        }
    }
}

impl MotionKey {
    fn new(time: f64, transform: &Transform) -> MotionKey {
        let m = DMat3::from_mat4(transform.matrix);
        let (rotation, stretch) = polar(m);
        MotionKey {
            time,
            transform: *transform,
            translation: transform.matrix.w_axis.truncate(),
            rotation,
            stretch,
            half_turn: [0.0; 2],
        }
    }

    /// Linear part and translation between two keys, `s` in (0, 1).
    fn between(a: &MotionKey, b: &MotionKey, s: f64) -> (DMat3, DVec3) {
        let [angle, over_sine] = a.half_turn;
        // Below this the arc is its chord to the last bit. The turn is at most a half.
        let weights = if angle > 1e-8 {
            [sine((1.0 - s) * angle) * over_sine, sine(s * angle) * over_sine]
        } else {
            [1.0 - s, s]
        };
        let rotation = a.rotation * weights[0] + b.rotation * weights[1];
        let linear = DMat3::from_quat(rotation) * (a.stretch * (1.0 - s) + b.stretch * s);
        (linear, a.translation.lerp(b.translation, s))
    }
}

/// The sine of 0 ≤ x ≤ π/2 by Taylor's series, to 1e-11: what a ray asks for.
fn sine(x: f64) -> f64 {
    // 1/((k − 1)·k) of the odd k from 15 down.
    const TERMS: [f64; 7] =
        [1.0 / 210.0, 1.0 / 156.0, 1.0 / 110.0, 1.0 / 72.0, 1.0 / 42.0, 1.0 / 20.0, 1.0 / 6.0];
    let y = -x * x;
    let sum = TERMS.iter().fold(0.0, |sum, term| (1.0 + sum) * (y * term));
    x * (1.0 + sum)
}

/// Rotation and stretch of a matrix: M = R·S with S symmetric and R a proper
/// rotation (S takes a mirror's minus sign). Higham 1986: R is the limit of
/// averaging with the inverse transpose.
fn polar(m: DMat3) -> (DQuat, DMat3) {
    let mut r = m;
    for _ in 0..100 {
        let next = (r + r.inverse().transpose()) * 0.5;
        let change = (next - r).to_cols_array().iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        r = next;
        if change < 1e-15 {
            break;
        }
    }
    if r.determinant() < 0.0 {
        r *= -1.0;
    }
    let rotation = DQuat::from_mat3(&r).normalize();
    (rotation, DMat3::from_quat(rotation).transpose() * m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(angle: f64, at: DVec3, scale: DVec3) -> Transform {
        let m = DMat4::from_scale_rotation_translation(scale, DQuat::from_rotation_z(angle), at);
        Transform::from_matrix(m).unwrap_or_default()
    }

    #[test]
    fn keys_are_exact_and_between_them_arcs() {
        let (a, b) =
            (turn(0.0, DVec3::ZERO, DVec3::ONE), turn(1.0, DVec3::X * 4.0, DVec3::new(2.0, 2.0, -2.0)));
        let motion = Motion::new(&[(1.0, a), (3.0, b)]).expect("rising times");
        assert_eq!((motion.at(0.0), motion.at(1.0), motion.at(3.0), motion.at(9.0)), (a, a, b, b));
        let c = turn(0.4, DVec3::ZERO, DVec3::ONE);
        let d = turn(1.4, DVec3::X * 4.0, DVec3::ONE);
        let motion = Motion::new(&[(0.0, c), (2.0, d)]).expect("rising times");
        let middle = motion.at(1.0);
        assert!(
            (middle.matrix - turn(0.9, DVec3::X * 2.0, DVec3::ONE).matrix).abs_diff_eq(DMat4::ZERO, 1e-14)
        );
        let half = motion.during(1.0, 3.0);
        assert!((half.at(0.25).matrix - motion.at(1.5).matrix).abs_diff_eq(DMat4::ZERO, 1e-12));
        assert!(motion.during(2.0, 3.0).as_still().is_some());
    }

    /// The path of a point stays as near to its chord as the second derivative says.
    #[test]
    fn the_bound_on_the_second_derivative_holds() {
        let a = turn(0.2, DVec3::ZERO, DVec3::new(1.0, 3.0, 0.5));
        let b = turn(2.2, DVec3::new(1.0, 2.0, 3.0), DVec3::new(-2.0, 1.0, 1.0));
        let motion = Motion::new(&[(0.0, a), (1.0, b)]).expect("rising times");
        let mut bound = 0.0;
        motion.stretches(|_, _, second| bound = second);
        let p = DVec3::new(0.3, -0.8, 0.52).normalize();
        let at = |t: f64| motion.at(t).point(p);
        for i in 0..1000 {
            let t = (f64::from(i) + 0.5) / 1000.0;
            let h = 1e-4;
            let second = (at(t + h) - at(t) * 2.0 + at(t - h)) / (h * h);
            assert!(second.length() <= bound * 1.001 + 1e-3, "{t}: {} > {bound}", second.length());
        }
    }
}
