//! A surface that is not there: it separates media and holds shapes.

use super::BsdfSample;
use crate::math::{Rgb, Vec2, Vec3};

/// Light passes unchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Null;

impl Null {
    pub(super) fn eval_pdf(&self, _wo: Vec3, _wi: Vec3) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    pub(super) fn sample(&self, wo: Vec3, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        Some(BsdfSample { wi: -wo, weight: Rgb::ONE, pdf: 1.0, delta: true, null: true, eta: 1.0 })
    }

    pub(super) fn albedo(&self, _wo: Vec3) -> Rgb {
        Rgb::ONE
    }
}
