//! Samples a shape as a light.
//!
//! Spheres by the cone they fill (from inside by area and direction), near rectangles by solid angle, all else
//! uniformly in area: meshes choose a triangle by area and a point in it.
//! Densities are per solid angle at the reference point; the area measure is
//! converted by the *geometric* normal, dist² / (|cos θ|·A). Which side emits
//! is for the light to decide.

use super::{
    Analytic, AnalyticPoint, Geometry, Hit, PrimId, RectView, ShapeId, ShapeSample, SphereView, SurfacePoint,
};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::{AliasTable, uniform_triangle};

/// A shape made ready to be sampled.
#[derive(Clone, Debug)]
pub struct ShapeSampler {
    first_prim: PrimId,
    shape: ShapeId,
    area: f64,
    /// For meshes.
    triangles: Option<TriangleTable>,
}

impl ShapeSampler {
    /// Prepares a shape. `None` when it has no area, such as a mesh whose
    /// triangles were all dropped, or one that overflows.
    #[must_use]
    pub fn new(geometry: &Geometry, shape: ShapeId) -> Option<ShapeSampler> {
        let info = geometry.shapes().get(shape as usize)?;
        if geometry.analytic(info.first_prim).is_some() && info.kind != "mesh" {
            let area = geometry.area(info.first_prim);
            return (area > 0.0 && area.is_finite()).then_some(ShapeSampler {
                first_prim: info.first_prim,
                shape,
                area,
                triangles: None,
            });
        }
        let areas: Vec<f64> =
            (info.first_prim..info.first_prim + info.prim_count).map(|prim| geometry.area(prim)).collect();
        let triangles = TriangleTable::new(&areas)?;
        Some(ShapeSampler {
            first_prim: info.first_prim,
            shape,
            area: triangles.total(),
            triangles: Some(triangles),
        })
    }

    /// The shape.
    #[must_use]
    pub fn shape(&self) -> ShapeId {
        self.shape
    }

    /// Its area in the square of the scene's unit, above 0.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Memory of its tables in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.triangles.as_ref().map_or(0, TriangleTable::memory_bytes)
    }

    /// A point of the shape as seen from `from`. `None` when its density is
    /// zero or not finite: edge-on, or at `from` itself.
    #[must_use]
    pub fn sample(&self, geometry: &Geometry, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let Some(table) = &self.triangles else {
            return self.sample_analytic(geometry, from, u);
        };
        let (index, u) = table.sample(u);
        let (b1, b2) = uniform_triangle(u);
        let hit = Hit { t: 1.0, prim: self.first_prim + index as u32, u: b1, v: b2 };
        let point = geometry.triangle_surface(self.shape, &hit);
        let offset = point.p.as_dvec3() - from.as_dvec3();
        let (wi, distance_squared) = (offset.try_normalize()?, offset.length_squared());
        finish(&point, wi, self.pdf_by_area(distance_squared, wi, &point))
    }

    fn sample_analytic(&self, geometry: &Geometry, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let analytic = geometry.analytic(self.first_prim)?;
        let origin = from.as_dvec3();
        let chosen = match analytic {
            Analytic::Sphere(sphere) => Some(SphereView::new(sphere, from).sample(sphere, u)?),
            Analytic::Rectangle(rectangle) => match RectView::new(rectangle, from).sample(rectangle, u) {
                Some(point) => Some((point, (point.p - origin).try_normalize()?)),
                None => None,
            },
            Analytic::Disk(_) | Analytic::Cylinder(_) => None,
        };
        let (point, wi) = match chosen {
            Some(chosen) => chosen,
            None => {
                let point = analytic.sample_area(u);
                (point, (point.p - origin).try_normalize()?)
            }
        };
        let distance_squared = (point.p - origin).length_squared();
        let point = self.round(analytic, &point);
        finish(&point, wi, self.pdf_f64(analytic, from, &point, wi, distance_squared))
    }

    /// The density per solid angle at `from` with which [`ShapeSampler::sample`]
    /// gives the unit direction `wi`, which meets this shape at `point`, at a
    /// distance of which `distance_squared` is the square. Zero edge-on.
    #[must_use]
    pub fn pdf(
        &self,
        geometry: &Geometry,
        from: Vec3,
        point: &SurfacePoint,
        wi: Vec3,
        distance_squared: f32,
    ) -> f32 {
        let (wi, distance_squared) = (wi.as_dvec3(), f64::from(distance_squared));
        let pdf = match geometry.analytic(self.first_prim) {
            Some(analytic) => self.pdf_f64(analytic, from, point, wi, distance_squared),
            None => self.pdf_by_area(distance_squared, wi, point),
        } as f32;
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// The density for analytic shapes: the only place that knows it.
    fn pdf_f64(
        &self,
        analytic: &Analytic,
        from: Vec3,
        point: &SurfacePoint,
        wi: DVec3,
        distance_squared: f64,
    ) -> f64 {
        let by_area = self.pdf_by_area(distance_squared, wi, point);
        match analytic {
            Analytic::Sphere(sphere) => SphereView::new(sphere, from).pdf(by_area),
            Analytic::Rectangle(rectangle) => RectView::new(rectangle, from).pdf().unwrap_or(by_area),
            Analytic::Disk(_) | Analytic::Cylinder(_) => by_area,
        }
    }

    /// 1/A per area, per solid angle. Infinite edge-on.
    fn pdf_by_area(&self, distance_squared: f64, wi: DVec3, point: &SurfacePoint) -> f64 {
        distance_squared / (wi.dot(point.ng.as_dvec3()).abs() * self.area)
    }

    fn round(&self, analytic: &Analytic, point: &AnalyticPoint) -> SurfacePoint {
        SurfacePoint {
            p: point.p.as_vec3(),
            p_error: point.p_error,
            ng: point.ng.as_vec3(),
            ns: point.ns.as_vec3(),
            uv: point.uv,
            dpdu: point.dpdu.as_vec3(),
            dpdv: point.dpdv.as_vec3(),
            prim: self.first_prim,
            shape: self.shape,
            planar: analytic.is_planar(),
        }
    }
}

fn finish(point: &SurfacePoint, wi: DVec3, pdf: f64) -> Option<ShapeSample> {
    let pdf = pdf as f32;
    (pdf > 0.0 && pdf.is_finite()).then(|| ShapeSample {
        p: point.p,
        p_error: point.p_error,
        n: point.ns,
        ng: point.ng,
        uv: point.uv,
        wi: wi.as_vec3(),
        prim: point.prim,
        pdf,
        planar: point.planar,
    })
}

/// Chooses triangles by area. Blocks of triangles first, by `u.x`, then one of
/// the block, by `u.y`: each number keeps enough bits to place the point.
#[derive(Clone, Debug)]
struct TriangleTable {
    blocks: AliasTable,
    members: Vec<AliasTable>,
    /// First triangle of each member table.
    firsts: Vec<usize>,
}

impl TriangleTable {
    fn new(areas: &[f64]) -> Option<TriangleTable> {
        let size = if areas.len() <= 1024 { areas.len() } else { (areas.len() as f64).sqrt() as usize };
        let (mut totals, mut members, mut firsts) = (Vec::new(), Vec::new(), Vec::new());
        for (i, block) in areas.chunks(size.max(1)).enumerate() {
            // A block of no area is left out.
            if let Some(table) = AliasTable::new(block) {
                totals.push(table.total());
                members.push(table);
                firsts.push(i * size);
            }
        }
        Some(TriangleTable { blocks: AliasTable::new(&totals)?, members, firsts })
    }

    fn total(&self) -> f64 {
        self.blocks.total()
    }

    fn sample(&self, u: Vec2) -> (usize, Vec2) {
        let block = self.blocks.sample(u.x);
        let member = self.members[block.index].sample(u.y);
        (self.firsts[block.index] + member.index, Vec2::new(block.u, member.u))
    }

    fn memory_bytes(&self) -> usize {
        self.blocks.memory_bytes()
            + self.members.iter().map(AliasTable::memory_bytes).sum::<usize>()
            + size_of_val(&*self.firsts)
    }
}
