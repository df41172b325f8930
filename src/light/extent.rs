//! Where a light is, which way it shines, and how much: what a choice among
//! many lights goes by.

use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::Range;

use super::{AreaLight, Light};
use crate::math::{Bounds, Vec2, Vec3, angle_between};
use crate::shape::{Analytic, Geometry, Hit, Instance, PrimId, SurfacePoint, Sweep};

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
    /// It shines around the opposite of each normal as well; its falloff is π/2 then.
    pub both_sides: bool,
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
pub(super) const SLACK: f32 = 1e-4;

impl Light {
    /// The emitters it consists of; none for lights at infinity.
    #[must_use]
    pub fn emitters(&self, geometry: &Geometry, light: u32) -> Vec<Emitter> {
        let one = |extent| vec![Emitter { light, prim: 0, prims: 1, extent }];
        match self {
            Light::Area(area) => area
                .extents(geometry)
                .map(|(prim, prims, extent)| Emitter { light, prim, prims, extent })
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
            Light::Moving(light) => light.extent().into_iter().flat_map(one).collect(),
            Light::Directional(_) | Light::Constant(_) | Light::EnvMap(_) | Light::SunSky(_) => Vec::new(),
        }
    }
}

impl Extent {
    /// Shines from the box in all directions.
    pub(super) fn everywhere(bounds: Bounds, radius: f32, power: f64) -> Extent {
        Extent { bounds, radius, axis: Vec3::Z, spread: PI, falloff: FRAC_PI_2, both_sides: false, power }
    }

    /// With its normals within a cone. Of one that shines on both sides the
    /// normals may as well be their opposites: all such look to the same side of
    /// one plane, which is unlikely to be that of a wall.
    fn around(self, (axis, spread): (Vec3, f32), both_sides: bool) -> Extent {
        let opposite = both_sides && axis.dot(Vec3::new(1.0, 2.0, 3.0)) < 0.0;
        Extent { axis: if opposite { -axis } else { axis }, spread, both_sides, ..self }
    }
}

impl AreaLight {
    /// Of how many emitters it consists.
    #[must_use]
    pub fn part_count(&self, geometry: &Geometry) -> usize {
        self.parts(geometry).count()
    }

    /// What of it is sampled by itself: first primitive and how many.
    fn parts(&self, geometry: &Geometry) -> impl Iterator<Item = (PrimId, u32)> + use<> {
        let first = self.sampler.first_prim();
        let count = geometry.shapes()[self.sampler.shape() as usize].prim_count;
        let step = if self.sampler.is_whole() { count } else { 1 };
        (first..first + count).step_by(step as usize).map(move |prim| (prim, step))
    }

    /// Its parts, first primitive and how many, with their bounds at all times of
    /// the shutter; without those that have no area or power.
    pub(super) fn extents<'a>(
        &'a self,
        geometry: &'a Geometry,
    ) -> impl Iterator<Item = (PrimId, u32, Extent)> + 'a {
        let sweep = geometry.instance(self.instance).map(Instance::sweep);
        self.parts(geometry).filter_map(move |(prim, count)| {
            let prims = prim..prim + count;
            let local = self.extent(geometry, prims.clone())?;
            let extent = match &sweep {
                None => local,
                Some(sweep) => self.swept(geometry, prims, (&local, sweep))?,
            };
            Some((prim, count, extent))
        })
    }

    /// Bounds of a part in the space of its shape; `None` without area or power.
    fn extent(&self, geometry: &Geometry, prims: Range<PrimId>) -> Option<Extent> {
        let area: f64 = prims.clone().map(|prim| geometry.area(prim)).sum();
        let bounds = prims.clone().map(|prim| geometry.prim_bounds(prim)).fold(Bounds::EMPTY, Bounds::union);
        let power = std::f64::consts::PI * area * self.radiance_of(prims.start);
        if !(power > 0.0) || !power.is_finite() {
            return None;
        }
        let round = Extent::everywhere(bounds, bounds.bounding_sphere().1, power);
        Some(match geometry.analytic(prims.start) {
            // The box of a sphere is widened by rounding; so is the sphere.
            Some(Analytic::Sphere(_)) => Extent { radius: bounds.extent().max_element() * 0.5, ..round },
            _ => match cone(&self.normals(geometry, prims)) {
                Some(cone) => round.around(cone, self.emission.both_sides),
                None => round,
            },
        })
    }

    /// Bounds of a part on the way of its instance, from those in its own space.
    fn swept(
        &self,
        geometry: &Geometry,
        prims: Range<PrimId>,
        (local, sweep): (&Extent, &Sweep),
    ) -> Option<Extent> {
        let points: Vec<_> = prims
            .clone()
            .flat_map(|prim| match geometry.triangle(prim) {
                Some(vertices) => vertices.map(|v| v.as_dvec3()).to_vec(),
                None => geometry.prim_bounds(prim).corners().to_vec(),
            })
            .collect();
        let bounds = sweep.bounds(&points);
        let flat = match (geometry.triangle(prims.start), geometry.analytic(prims.start)) {
            (Some([a, b, c]), _) => {
                (b - a).as_dvec3().cross((c - a).as_dvec3()).try_normalize().map(|n| n.as_vec3())
            }
            (None, Some(analytic)) => analytic.is_planar().then(|| analytic.normal()),
            (None, None) => None,
        };
        let power = local.power * sweep.area_factor(flat);
        if !(power > 0.0) || !power.is_finite() {
            return None;
        }
        let round = Extent::everywhere(bounds, bounds.bounding_sphere().1, power);
        // Of a mean of normals the image is a mean of their images.
        let turned: Option<Vec<(Vec3, f32)>> =
            self.normals(geometry, prims).into_iter().map(|n| sweep.normal(n)).collect();
        let Some(turned) = turned else { return Some(round) };
        let turn = turned.first().map_or(0.0, |t| t.1);
        let normals: Vec<Vec3> = turned.into_iter().map(|t| t.0).collect();
        Some(match cone(&normals) {
            Some((axis, spread)) => round.around((axis, (spread + turn).min(PI)), self.emission.both_sides),
            None => round,
        })
    }

    /// Normals that all others of a part lie between; none for what is round.
    fn normals(&self, geometry: &Geometry, prims: Range<PrimId>) -> Vec<Vec3> {
        match geometry.analytic(prims.start) {
            Some(Analytic::Sphere(_) | Analytic::Cylinder(_)) => Vec::new(),
            Some(flat) => vec![flat.sample_area(Vec2::splat(0.5)).ns.as_vec3()],
            None => {
                let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
                let all = prims.flat_map(|prim| corners.map(|(u, v)| (prim, u, v)));
                all.map(|(prim, u, v)| self.triangle_point(geometry, prim, u, v).ns).collect()
            }
        }
    }

    fn triangle_point(&self, geometry: &Geometry, prim: PrimId, u: f32, v: f32) -> SurfacePoint {
        geometry.triangle_surface(
            self.sampler.shape(),
            &Hit { t: 1.0, prim, u, v, instance: Hit::NO_INSTANCE },
            0.0,
        )
    }
}

/// Axis and half angle of a cone around normals and all between them; `None`
/// where there is none: normals between vertices lie between their normals only
/// within half a sphere.
fn cone(normals: &[Vec3]) -> Option<(Vec3, f32)> {
    let axis = normals.iter().sum::<Vec3>().try_normalize()?;
    let spread = normals.iter().map(|n| angle_between(*n, axis)).fold(0.0, f32::max) + SLACK;
    (spread < 0.99 * FRAC_PI_2).then_some((axis, spread))
}
