//! Lights without a surface that move while the shutter is open.
//!
//! A `point`, `spot` or `directional` whose `to_world` is an `<animation>` is
//! where that puts it at the time of the receiver. (Mitsuba's emitters of these
//! kinds stand still.) What bounds it in the light tree holds over the whole
//! shutter: the box of its way, and for a spot the cone that contains all those
//! it has on the way. In a kind of its own, so that still lights pay nothing.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::DMat3;

use super::extent::SLACK;
use super::{Directional, Extent, LightSample, Point, Receiver, Spot};
use crate::math::{DVec3, Motion, Transform, Vec3};
use crate::shape::Sweep;

/// A light that moves. See the module.
#[derive(Clone, Debug)]
pub struct Moving {
    /// It in its own space: what does not depend on where it is.
    kind: Kind,
    /// To the recentred world over the shutter, [0, 1].
    motion: Box<Motion>,
}

#[derive(Clone, Debug)]
enum Kind {
    Point(Point),
    Spot(Box<Spot>),
    Directional(Directional),
}

impl Moving {
    pub(super) fn point(point: Point, motion: Motion) -> Moving {
        Moving { kind: Kind::Point(point), motion: Box::new(motion) }
    }

    pub(super) fn spot(spot: Spot, motion: Motion) -> Moving {
        Moving { kind: Kind::Spot(Box::new(spot)), motion: Box::new(motion) }
    }

    pub(super) fn directional(light: Directional, motion: Motion) -> Moving {
        Moving { kind: Kind::Directional(light), motion: Box::new(motion) }
    }

    pub(super) fn sample(&self, receiver: &Receiver) -> Option<LightSample> {
        let place = self.motion.affine_at(f64::from(receiver.time));
        let position = place.translation.as_vec3();
        match &self.kind {
            Kind::Point(light) => Point { position, ..*light }.sample(receiver.p),
            Kind::Spot(light) => light.sample_from((position, place.inverse.as_mat3()), receiver.p),
            Kind::Directional(light) => {
                let towards = -(place.matrix * DVec3::Z).try_normalize()?.as_vec3();
                Directional { towards, ..*light }.sample()
            }
        }
    }

    /// Bounds at all times of the shutter; `None` for one at infinity.
    pub(super) fn extent(&self) -> Option<Extent> {
        let sweep = Sweep::of(&self.motion);
        let bounds = sweep.bounds(&[DVec3::ZERO]);
        let all = Extent::everywhere(bounds, bounds.bounding_sphere().1, self.power());
        match &self.kind {
            Kind::Point(_) => Some(all),
            Kind::Spot(light) => {
                let first = DMat3::from_mat4(self.motion.at(0.0).inverse).as_mat3();
                let cone = light.cone_of(first).zip(sweep.normal(Vec3::Z));
                let Some(((axis, beam, cutoff), (_, turn))) = cone else { return Some(all) };
                let spread = beam.max(cutoff - FRAC_PI_2);
                let falloff = cutoff - spread;
                Some(Extent { axis, spread: (spread + turn + SLACK).min(PI), falloff, ..all })
            }
            Kind::Directional(_) => None,
        }
    }

    /// As of one that stands still; of a `directional` its normal irradiance.
    pub(super) fn power(&self) -> f64 {
        match &self.kind {
            Kind::Point(light) => light.power(),
            Kind::Spot(light) => light.power(),
            Kind::Directional(light) => light.normal_irradiance(),
        }
    }

    pub(super) fn is_infinite(&self) -> bool {
        matches!(self.kind, Kind::Directional(_))
    }

    pub(super) fn weight(&self) -> f32 {
        match &self.kind {
            Kind::Point(light) => light.weight,
            Kind::Spot(light) => light.weight,
            Kind::Directional(light) => light.weight,
        }
    }

    pub(super) fn name(&self) -> &'static str {
        match &self.kind {
            Kind::Point(_) => "point",
            Kind::Spot(_) => "spot",
            Kind::Directional(_) => "directional",
        }
    }

    pub(super) fn memory_bytes(&self) -> usize {
        let textures = if let Kind::Spot(light) = &self.kind { light.memory_bytes() } else { 0 };
        textures + self.motion.times().count() * size_of::<Transform>()
    }
}
