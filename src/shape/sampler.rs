//! Samples a shape as a light.
//!
//! Spheres by the cone they fill (from inside by area and direction), near
//! rectangles and triangles by solid angle, all else uniformly in area: meshes
//! choose a triangle by area and a point in it.
//! Densities are per solid angle at the reference point; the area measure is
//! converted by the *geometric* normal, dist² / (|cos θ|·A). Which side emits
//! is for the light to decide.

use super::quad::Quad;
use super::view::RectFrame;
use super::{
    Analytic, AnalyticPoint, Geometry, Hit, PrimId, RectView, ShapeId, ShapeSample, SphereView, SurfacePoint,
    TriangleView,
};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::{AliasTable, uniform_triangle};

/// A shape made ready to be sampled.
#[derive(Clone, Debug)]
pub struct ShapeSampler {
    first_prim: PrimId,
    shape: ShapeId,
    area: f64,
    method: Method,
    /// Somebody reads the texture coordinates of samples.
    needs_uv: bool,
}

/// What makes sampling faster than the geometry alone.
#[derive(Clone, Debug)]
enum Method {
    /// A sphere, disk or cylinder.
    Plain,
    Rectangle(RectFrame),
    Quad(Quad),
    Mesh(TriangleTable),
}

/// An analytic shape as seen from a point.
enum View {
    Sphere(SphereView),
    Rectangle(RectView),
    Area,
}

impl ShapeSampler {
    /// Prepares a shape. `None` when it has no area, such as a mesh whose
    /// triangles were all dropped, or one that overflows.
    #[must_use]
    pub fn new(geometry: &Geometry, shape: ShapeId) -> Option<ShapeSampler> {
        let info = geometry.shapes().get(shape as usize)?;
        let first_prim = info.first_prim;
        if let Some(analytic) = geometry.analytic(first_prim) {
            let area = analytic.area();
            let method = match analytic {
                Analytic::Rectangle(r) => Method::Rectangle(RectFrame::new(r)),
                Analytic::Sphere(_) | Analytic::Disk(_) | Analytic::Cylinder(_) => Method::Plain,
            };
            let valid = area > 0.0 && area.is_finite();
            return valid.then_some(ShapeSampler { first_prim, shape, area, method, needs_uv: true });
        }
        let areas: Vec<f64> =
            (first_prim..first_prim + info.prim_count).map(|prim| geometry.area(prim)).collect();
        let table = TriangleTable::new(&areas)?;
        if let Some(quad) = Quad::new(geometry, shape) {
            let (area, method) = (table.total(), Method::Quad(quad));
            return Some(ShapeSampler { first_prim, shape, area, method, needs_uv: true });
        }
        let (area, method) = (table.total(), Method::Mesh(table));
        Some(ShapeSampler { first_prim, shape, area, method, needs_uv: true })
    }

    /// The same without texture coordinates in its samples.
    #[must_use]
    pub fn without_uv(self) -> ShapeSampler {
        ShapeSampler { needs_uv: false, ..self }
    }

    /// The shape.
    #[must_use]
    pub fn shape(&self) -> ShapeId {
        self.shape
    }

    /// Its first primitive.
    #[must_use]
    pub fn first_prim(&self) -> PrimId {
        self.first_prim
    }

    /// Its area in the square of the scene's unit, above 0.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// True when its primitives are sampled together, as one.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        !matches!(self.method, Method::Mesh(_))
    }

    /// Memory of its tables in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        match &self.method {
            Method::Mesh(table) => table.memory_bytes(),
            Method::Plain | Method::Rectangle(_) | Method::Quad(_) => 0,
        }
    }

    /// A point of the shape as seen from `from`. `None` when its density is
    /// zero or not finite: edge-on, or at `from` itself.
    #[must_use]
    pub fn sample(&self, geometry: &Geometry, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        match &self.method {
            Method::Mesh(table) => {
                let (index, u) = table.sample(u);
                let prim = self.first_prim + index as u32;
                self.sample_triangle(geometry, prim, from, u, geometry.area(prim) / self.area)
            }
            Method::Quad(quad) => self.sample_quad(geometry, quad, from, u),
            Method::Plain | Method::Rectangle(_) => self.sample_analytic(geometry, from, u),
        }
    }

    /// A point of one triangle of a mesh, or of all of a shape that
    /// [`ShapeSampler::is_whole`]; the density is that of the point once the primitive is chosen.
    #[must_use]
    pub fn sample_prim(&self, geometry: &Geometry, prim: PrimId, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        match &self.method {
            Method::Mesh(_) => self.sample_triangle(geometry, prim, from, u, 1.0),
            _ => self.sample(geometry, from, u),
        }
    }

    fn sample_triangle(
        &self,
        geometry: &Geometry,
        prim: PrimId,
        from: Vec3,
        u: Vec2,
        pmf: f64,
    ) -> Option<ShapeSample> {
        let view = TriangleView::new(&geometry.triangle(prim)?, from);
        let (b1, b2) = view.sample(u).unwrap_or_else(|| uniform_triangle(u));
        let hit = Hit { t: 1.0, prim, u: b1, v: b2, instance: Hit::NO_INSTANCE };
        self.finish_hit(geometry, &hit, from, |point, wi, distance_squared| {
            pmf * view.pdf().unwrap_or_else(|| by_area(distance_squared, wi, point, geometry.area(prim)))
        })
    }

    fn sample_quad(&self, geometry: &Geometry, quad: &Quad, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let view = RectView::of(&quad.frame, from);
        let hit = quad.hit(view.sample(u).unwrap_or_else(|| Quad::uniform(u)));
        self.finish_hit(geometry, &hit, from, |point, wi, distance_squared| {
            view.pdf().unwrap_or_else(|| by_area(distance_squared, wi, point, self.area))
        })
    }

    /// The sample that a point of a triangle is, with its density by the point,
    /// the direction and the square of the distance.
    fn finish_hit(
        &self,
        geometry: &Geometry,
        hit: &Hit,
        from: Vec3,
        pdf: impl Fn(&SurfacePoint, DVec3, f64) -> f64,
    ) -> Option<ShapeSample> {
        let point = geometry.triangle_surface(self.shape, hit, 0.0);
        let offset = point.p.as_dvec3() - from.as_dvec3();
        let wi = offset.try_normalize()?;
        finish(&point, wi, pdf(&point, wi, offset.length_squared()))
    }

    fn sample_analytic(&self, geometry: &Geometry, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let analytic = geometry.analytic(self.first_prim)?;
        let origin = from.as_dvec3();
        let towards = |point: AnalyticPoint| Some((point, (point.p - origin).try_normalize()?));
        let view = self.view(analytic, from);
        let (point, wi) = match (&view, analytic) {
            (View::Sphere(view), Analytic::Sphere(sphere)) => view.sample(sphere, u)?,
            (View::Rectangle(view), Analytic::Rectangle(rectangle)) => {
                let local = view.sample(u);
                towards(local.map_or_else(|| rectangle.sample_area(u), |[x, y]| rectangle.at(x, y)))?
            }
            _ => towards(analytic.sample_area(u))?,
        };
        let distance_squared = (point.p - origin).length_squared();
        let point = match analytic {
            Analytic::Sphere(sphere) if self.needs_uv => sphere.parametrised(point),
            _ => point,
        };
        let point = self.round(analytic, &point);
        finish(&point, wi, view.pdf(by_area(distance_squared, wi, &point, self.area)))
    }

    /// True when no point of a flat shape is seen on the side of its shading
    /// normal from `from`, or all of it is below the horizon of `normal` there.
    /// False for shapes that are not flat: they are not looked at.
    #[must_use]
    pub fn is_hidden(&self, from: Vec3, normal: Option<Vec3>) -> bool {
        match &self.method {
            Method::Rectangle(frame) => frame.is_hidden(from, normal),
            Method::Quad(quad) => quad.frame.is_hidden(from, normal),
            Method::Plain | Method::Mesh(_) => false,
        }
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
        let pmf = match &self.method {
            Method::Mesh(_) => geometry.area(point.prim) / self.area,
            Method::Plain | Method::Rectangle(_) | Method::Quad(_) => 1.0,
        };
        in_f32(pmf * self.pdf_of_prim(geometry, from, point, wi, distance_squared))
    }

    /// The same for [`ShapeSampler::sample_prim`] of the primitive of `point`.
    #[must_use]
    pub fn pdf_prim(
        &self,
        geometry: &Geometry,
        from: Vec3,
        point: &SurfacePoint,
        wi: Vec3,
        distance_squared: f32,
    ) -> f32 {
        in_f32(self.pdf_of_prim(geometry, from, point, wi, distance_squared))
    }

    fn pdf_of_prim(
        &self,
        geometry: &Geometry,
        from: Vec3,
        point: &SurfacePoint,
        wi: Vec3,
        distance_squared: f32,
    ) -> f64 {
        let uniform = |area| by_area(f64::from(distance_squared), wi.as_dvec3(), point, area);
        if let Method::Quad(quad) = &self.method {
            return RectView::of(&quad.frame, from).pdf().unwrap_or_else(|| uniform(self.area));
        }
        match (geometry.analytic(self.first_prim), geometry.triangle(point.prim)) {
            (Some(analytic), _) => self.view(analytic, from).pdf(uniform(self.area)),
            (None, Some(vertices)) => {
                let view = TriangleView::new(&vertices, from);
                view.pdf().unwrap_or_else(|| uniform(geometry.area(point.prim)))
            }
            (None, None) => 0.0,
        }
    }

    fn view(&self, analytic: &Analytic, from: Vec3) -> View {
        match (&self.method, analytic) {
            (Method::Rectangle(frame), _) => View::Rectangle(RectView::of(frame, from)),
            (_, Analytic::Sphere(sphere)) => View::Sphere(SphereView::new(sphere, from)),
            _ => View::Area,
        }
    }

    fn round(&self, analytic: &Analytic, point: &AnalyticPoint) -> SurfacePoint {
        SurfacePoint {
            p: point.p.as_vec3(),
            p_error: point.p_error,
            ng: point.ng.as_vec3(),
            ns: point.ns.as_vec3(),
            uv: point.uv,
            barycentric: Vec2::ZERO,
            dpdu: point.dpdu.as_vec3(),
            dpdv: point.dpdv.as_vec3(),
            prim: self.first_prim,
            shape: self.shape,
            instance: Hit::NO_INSTANCE,
            time: 0.0,
            planar: analytic.is_planar(),
        }
    }
}

impl View {
    /// Density per solid angle of a point whose density is `by_area` when it
    /// is chosen uniformly in area.
    fn pdf(&self, by_area: f64) -> f64 {
        match self {
            View::Sphere(view) => view.pdf(by_area),
            View::Rectangle(view) => view.pdf().unwrap_or(by_area),
            View::Area => by_area,
        }
    }
}

/// 1/A per area, per solid angle. Infinite edge-on.
fn by_area(distance_squared: f64, wi: DVec3, point: &SurfacePoint, area: f64) -> f64 {
    distance_squared / (wi.dot(point.ng.as_dvec3()).abs() * area)
}

fn in_f32(pdf: f64) -> f32 {
    let pdf = pdf as f32;
    if pdf.is_finite() { pdf } else { 0.0 }
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
