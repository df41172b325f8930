//! Where a light is, which way it shines, and how much: what a choice among
//! many lights goes by.

use std::f32::consts::{FRAC_PI_2, PI};

use super::{AreaLight, Light};
use crate::math::{Bounds, Vec2, Vec3, angle_between};
use crate::shape::{Analytic, Geometry, Hit, PrimId, SurfacePoint};

/// Bounds of one emitter: a whole light, or one triangle of it.
///
/// It shines from within the sphere, only in directions closer than `falloff`
/// to some normal, and all normals are closer than `spread` to `axis` (Conty
/// Estevez & Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
/// Splitting", section 4.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// The box around it.
    pub bounds: Bounds,
    /// Radius of a sphere around the middle of the box that contains it.
    pub radius: f32,
    /// Unit.
    pub axis: Vec3,
    /// Radians in [0, π].
    pub spread: f32,
    /// Radians in [0, π/2].
    pub falloff: f32,
    /// Emitted power, grey; finite, not negative.
    pub power: f64,
}

/// An emitter of a scene: a light, or one primitive of a light that is a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitter {
    /// Index of the light.
    pub light: u32,
    /// The first primitive; not looked at where the light has none.
    pub prim: PrimId,
    /// How many primitives it is.
    pub prims: u32,
    /// What bounds it.
    pub extent: Extent,
}

/// Added to the spread of normals: rounding never hides a light.
const SLACK: f32 = 1e-4;

impl Light {
    /// The emitters it consists of; none for lights at infinity.
    #[must_use]
    pub fn emitters(&self, geometry: &Geometry, light: u32) -> Vec<Emitter> {
        let one = |extent| vec![Emitter { light, prim: 0, prims: 1, extent }];
        match self {
            Light::Area(area) => area
                .parts(geometry)
                .filter_map(|(prim, prims)| {
                    Some(Emitter { light, prim, prims, extent: area.extent(geometry, prim, prims)? })
                })
                .collect(),
            Light::Point(point) => one(Extent::everywhere(Bounds::point(point.position), 0.0, point.power())),
            Light::Spot(spot) => {
                let all = Extent::everywhere(Bounds::point(spot.position), 0.0, spot.power());
                let Some((axis, beam, cutoff)) = spot.cone() else { return one(all) };
                let spread = beam.max(cutoff - FRAC_PI_2);
                one(Extent { axis, spread: (spread + SLACK).min(PI), falloff: cutoff - spread, ..all })
            }
            Light::Projector(p) => {
                let all = Extent::everywhere(Bounds::point(p.position), 0.0, p.power());
                let Some((axis, angle)) = p.cone() else { return one(all) };
                one(Extent { axis, spread: SLACK, falloff: angle, ..all })
            }
            Light::Beam(beam) => {
                let all = Extent::everywhere(geometry.prim_bounds(beam.prim), 0.0, beam.power());
                let radius = all.bounds.bounding_sphere().1;
                // Not falling off with distance as others do: bounded by nothing.
                one(Extent { radius, ..all })
            }
            Light::Directional(_) | Light::Constant(_) | Light::EnvMap(_) | Light::SunSky(_) => Vec::new(),
        }
    }
}

impl Extent {
    /// Shines from the box in all directions.
    fn everywhere(bounds: Bounds, radius: f32, power: f64) -> Extent {
        Extent { bounds, radius, axis: Vec3::Z, spread: PI, falloff: FRAC_PI_2, power }
    }
}

impl AreaLight {
    /// What of it is sampled by itself: first primitive and how many.
    fn parts(&self, geometry: &Geometry) -> impl Iterator<Item = (PrimId, u32)> + use<> {
        let first = self.sampler.first_prim();
        let count = geometry.shapes()[self.sampler.shape() as usize].prim_count;
        let step = if self.sampler.is_whole() { count } else { 1 };
        (first..first + count).step_by(step as usize).map(move |prim| (prim, step))
    }

    /// Bounds of a part; `None` without area or power.
    fn extent(&self, geometry: &Geometry, prim: PrimId, prims: u32) -> Option<Extent> {
        let prims = prim..prim + prims;
        let area: f64 = prims.clone().map(|prim| geometry.area(prim)).sum();
        let bounds = prims.clone().map(|prim| geometry.prim_bounds(prim)).fold(Bounds::EMPTY, Bounds::union);
        let power = std::f64::consts::PI * area * self.radiance_of(prims.start);
        if !(power > 0.0) || !power.is_finite() {
            return None;
        }
        let round = Extent::everywhere(bounds, bounds.bounding_sphere().1, power);
        Some(match geometry.analytic(prim) {
            // The box of a sphere is widened by rounding; so is the sphere.
            Some(Analytic::Sphere(_)) => Extent { radius: bounds.extent().max_element() * 0.5, ..round },
            Some(Analytic::Cylinder(_)) => round,
            Some(flat) => {
                let axis = flat.sample_area(Vec2::splat(0.5)).ns.as_vec3();
                Extent { axis, spread: SLACK, ..round }
            }
            None => {
                let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
                let normals: Vec<Vec3> = prims
                    .flat_map(|prim| corners.map(|(u, v)| (prim, u, v)))
                    .map(|(prim, u, v)| self.triangle_point(geometry, prim, u, v).ns)
                    .collect();
                let axis = normals.iter().sum::<Vec3>().normalize_or(Vec3::Z);
                let spread = normals.iter().map(|n| angle_between(*n, axis)).fold(0.0, f32::max) + SLACK;
                // Normals between vertices lie between their normals only within half a sphere.
                if spread < 0.99 * FRAC_PI_2 { Extent { axis, spread, ..round } } else { round }
            }
        })
    }

    fn triangle_point(&self, geometry: &Geometry, prim: PrimId, u: f32, v: f32) -> SurfacePoint {
        geometry.triangle_surface(
            self.sampler.shape(),
            &Hit { t: 1.0, prim, u, v, instance: Hit::NO_INSTANCE },
            0.0,
        )
    }
}
