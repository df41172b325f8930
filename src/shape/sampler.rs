//! Samples a shape as a light.
//!
//! Spheres by the cone they fill (from inside by area and direction), near
//! rectangles and triangles by solid angle, all else uniformly in area: meshes
//! choose a triangle by area and a point in it.
//! What glows by a texture is sampled by that ([`ShapeSampler::with_pattern`]):
//! far away by its texels alone; nearby by solid angle, or if they differ much
//! half by texels and half by solid angle, since both vary there.
//! Densities are per solid angle at the reference point; the area measure is
//! converted by the *geometric* normal, dist² / (|cos θ|·A). Which side emits
//! is for the light to decide.

use super::pattern::{Layout, NEAR_CONTRAST, OnPrim, Pattern};
use super::quad::Quad;
use super::view::RectFrame;
use super::{
    Analytic, AnalyticPoint, Geometry, Hit, PrimId, RectView, ShapeId, ShapeSample, SphereView, SurfacePoint,
    TriangleView,
};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::{AliasTable, SquareTable, disk_to_square, triangle_to_square, uniform_triangle};

/// A shape made ready to be sampled.
#[derive(Clone, Debug)]
pub struct ShapeSampler {
    first_prim: PrimId,
    shape: ShapeId,
    area: f64,
    method: Method,
    /// Somebody reads the texture coordinates of samples.
    needs_uv: bool,
    /// What is known of a pattern on it: of the whole, or of each triangle.
    patterns: Option<Box<[OnPrim]>>,
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
            return valid.then_some(ShapeSampler {
                first_prim,
                shape,
                area,
                method,
                needs_uv: true,
                patterns: None,
            });
        }
        let areas: Vec<f64> =
            (first_prim..first_prim + info.prim_count).map(|prim| geometry.area(prim)).collect();
        let table = TriangleTable::new(&areas)?;
        if let Some(quad) = Quad::new(geometry, shape) {
            let (area, method) = (table.total(), Method::Quad(quad));
            return Some(ShapeSampler { first_prim, shape, area, method, needs_uv: true, patterns: None });
        }
        let (area, method) = (table.total(), Method::Mesh(table));
        Some(ShapeSampler { first_prim, shape, area, method, needs_uv: true, patterns: None })
    }

    /// The same without texture coordinates in its samples.
    #[must_use]
    pub fn without_uv(self) -> ShapeSampler {
        ShapeSampler { needs_uv: false, ..self }
    }

    /// The same for what is looked at from both sides: from neither is it hidden.
    #[must_use]
    pub fn of_both_sides(self) -> ShapeSampler {
        let method = match self.method {
            Method::Rectangle(frame) => Method::Rectangle(frame.without_normal()),
            Method::Quad(mut quad) => {
                quad.frame = quad.frame.without_normal();
                Method::Quad(quad)
            }
            other => other,
        };
        ShapeSampler { method, ..self }
    }

    /// The same by the strength of a pattern: triangles are chosen by their mean
    /// of it times their area. Spheres stay with the cone of what is seen of
    /// them: most of a picture is on the far side.
    #[must_use]
    pub fn with_pattern(self, geometry: &Geometry, pattern: &Pattern) -> ShapeSampler {
        let whole = |uv: &dyn Fn([f64; 2]) -> Vec2, affine| {
            let layout = Layout { uv, affine };
            Some(vec![OnPrim::new(pattern, &layout, 1)])
        };
        let patterns = match (&self.method, geometry.analytic(self.first_prim)) {
            (Method::Rectangle(_), _) => {
                let uv = |[x, y]: [f64; 2]| Vec2::new(x as f32, y as f32);
                whole(&uv, Some([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
            }
            (Method::Quad(quad), _) => {
                let uv = |place| self.triangle_uv(geometry, &quad.hit(signed(place)));
                whole(&uv, quad.uv_map(geometry, self.shape))
            }
            (Method::Plain, Some(Analytic::Disk(disk))) => {
                let uv = |[x, y]: [f64; 2]| disk.sample_area(Vec2::new(x as f32, y as f32)).uv;
                whole(&uv, None)
            }
            (Method::Plain, Some(Analytic::Cylinder(_))) => {
                let uv = |[x, y]: [f64; 2]| Vec2::new(y as f32, x as f32);
                whole(&uv, Some([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
            }
            (Method::Plain, _) => None,
            (Method::Mesh(_), _) => {
                let count = geometry.shapes()[self.shape as usize].prim_count;
                let on_prim = |prim| {
                    let uv = |[x, y]: [f64; 2]| {
                        let (u, v) = uniform_triangle(Vec2::new(x as f32, y as f32));
                        self.triangle_uv(geometry, &Hit { t: 1.0, prim, u, v, instance: Hit::NO_INSTANCE })
                    };
                    OnPrim::new(pattern, &Layout { uv: &uv, affine: None }, count as usize)
                };
                Some((self.first_prim..self.first_prim + count).map(on_prim).collect())
            }
        };
        let Some(patterns) = patterns else { return self };
        let method = match self.method {
            Method::Mesh(table) => {
                let weight = |(i, p): (usize, &OnPrim)| geometry.area(self.first_prim + i as u32) * p.mean;
                let weights: Vec<f64> = patterns.iter().enumerate().map(weight).collect();
                match TriangleTable::new(&weights) {
                    Some(table) => Method::Mesh(table),
                    None => return ShapeSampler { method: Method::Mesh(table), ..self },
                }
            }
            other => other,
        };
        ShapeSampler { method, patterns: Some(patterns.into()), ..self }
    }

    /// Mean over one primitive of the pattern that it is sampled by, if it is;
    /// over the whole of what [`ShapeSampler::is_whole`].
    #[must_use]
    pub fn mean_pattern(&self, prim: PrimId) -> Option<f64> {
        Some(self.on_prim(prim)?.mean)
    }

    /// Mean over the whole shape of the pattern that it is sampled by, if it is.
    #[must_use]
    pub fn mean_of_all(&self) -> Option<f64> {
        let patterns = self.patterns.as_ref()?;
        match &self.method {
            Method::Mesh(table) => Some(table.total() / self.area),
            _ => Some(patterns.first()?.mean),
        }
    }

    fn on_prim(&self, prim: PrimId) -> Option<&OnPrim> {
        let patterns = self.patterns.as_ref()?;
        let index = if self.is_whole() { 0 } else { prim.checked_sub(self.first_prim)? };
        patterns.get(index as usize)
    }

    /// The density over the unit square by which points of a primitive are chosen.
    #[inline]
    fn table(&self, prim: PrimId) -> Option<&SquareTable> {
        if self.patterns.is_none() { None } else { self.on_prim(prim)?.table.as_ref() }
    }

    fn triangle_uv(&self, geometry: &Geometry, hit: &Hit) -> Vec2 {
        geometry.triangle_surface(self.shape, hit, 0.0).uv
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
        let tables = match &self.method {
            Method::Mesh(table) => table.memory_bytes(),
            Method::Plain | Method::Rectangle(_) | Method::Quad(_) => 0,
        };
        let of = |p: &OnPrim| size_of::<OnPrim>() + p.table.as_ref().map_or(0, SquareTable::memory_bytes);
        tables + self.patterns.iter().flatten().map(of).sum::<usize>()
    }

    /// A point of the shape as seen from `from`. `None` when its density is
    /// zero or not finite: edge-on, or at `from` itself.
    #[must_use]
    pub fn sample(&self, geometry: &Geometry, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        match &self.method {
            Method::Mesh(table) => {
                let (index, u) = table.sample(u);
                let prim = self.first_prim + index as u32;
                self.sample_triangle(geometry, prim, from, u, self.pmf(geometry, prim, table))
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

    /// The probability of a triangle of a mesh.
    fn pmf(&self, geometry: &Geometry, prim: PrimId, table: &TriangleTable) -> f64 {
        match self.on_prim(prim) {
            None => geometry.area(prim) / self.area,
            Some(on_prim) => geometry.area(prim) * on_prim.mean / table.total(),
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
        let table = self.table(prim);
        let (b1, b2) = match by_table(table, view.pdf().is_some(), u) {
            Ok([x, y]) => uniform_triangle(Vec2::new(x as f32, y as f32)),
            Err(u) => view.sample(u).unwrap_or_else(|| uniform_triangle(u)),
        };
        let hit = Hit { t: 1.0, prim, u: b1, v: b2, instance: Hit::NO_INSTANCE };
        self.finish_hit(geometry, &hit, from, |point, wi, distance_squared| {
            let by_area = || by_area(distance_squared, wi, point, geometry.area(prim));
            pmf * density(table, view.pdf(), || triangle_place(point), by_area)
        })
    }

    fn sample_quad(&self, geometry: &Geometry, quad: &Quad, from: Vec3, u: Vec2) -> Option<ShapeSample> {
        let view = RectView::of(&quad.frame, from);
        let table = self.table(self.first_prim);
        let hit = quad.hit(match by_table(table, view.pdf().is_some(), u) {
            Ok(place) => signed(place),
            Err(u) => view.sample(u).unwrap_or_else(|| Quad::uniform(u)),
        });
        self.finish_hit(geometry, &hit, from, |point, wi, distance_squared| {
            let by_area = || by_area(distance_squared, wi, point, self.area);
            density(table, view.pdf(), || quad.place(point), by_area)
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
        if let Some(table) = self.table(self.first_prim) {
            return self.sample_by_table(analytic, (table, &view), origin, u);
        }
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

    /// A point of a rectangle, disk or cylinder with a pattern.
    #[cold]
    fn sample_by_table(
        &self,
        analytic: &Analytic,
        (table, view): (&SquareTable, &View),
        origin: DVec3,
        u: Vec2,
    ) -> Option<ShapeSample> {
        let near = view.solid_angle_pdf();
        let point = match (by_table(Some(table), near.is_some(), u), view, analytic) {
            (Ok(place), _, Analytic::Rectangle(rectangle)) => {
                let [x, y] = signed(place);
                rectangle.at(x, y)
            }
            (Ok([x, y]), ..) => analytic.sample_area(Vec2::new(x as f32, y as f32)),
            (Err(u), View::Rectangle(view), Analytic::Rectangle(rectangle)) => {
                let [x, y] = view.sample(u)?;
                rectangle.at(x, y)
            }
            (Err(u), ..) => analytic.sample_area(u),
        };
        let offset = point.p - origin;
        let (wi, point) = (offset.try_normalize()?, self.round(analytic, &point));
        let by_area = || by_area(offset.length_squared(), wi, &point, self.area);
        finish(&point, wi, density(Some(table), near, || analytic_place(analytic, &point), by_area))
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
            Method::Mesh(table) => self.pmf(geometry, point.prim, table),
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
        let table = self.table(point.prim);
        if let Method::Quad(quad) = &self.method {
            let near = RectView::of(&quad.frame, from).pdf();
            return density(table, near, || quad.place(point), || uniform(self.area));
        }
        match (geometry.analytic(self.first_prim), geometry.triangle(point.prim)) {
            (Some(analytic), _) => {
                let view = self.view(analytic, from);
                if let (View::Sphere(view), Analytic::Sphere(sphere)) = (&view, analytic)
                    && view.is_far_side(wi.dot(sphere.outwards(point.ng)))
                {
                    return 0.0;
                }
                if table.is_none() {
                    return view.pdf(uniform(self.area));
                }
                let place = || analytic_place(analytic, point);
                density(table, view.solid_angle_pdf(), place, || uniform(self.area))
            }
            (None, Some(vertices)) => {
                let view = TriangleView::new(&vertices, from);
                density(table, view.pdf(), || triangle_place(point), || uniform(geometry.area(point.prim)))
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
        point.rounded((self.first_prim, self.shape), 0.0, analytic.is_planar())
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

    /// Density per solid angle of a rectangle nearby; `None` for what is
    /// sampled by area.
    fn solid_angle_pdf(&self) -> Option<f64> {
        match self {
            View::Rectangle(view) => view.pdf(),
            View::Sphere(_) | View::Area => None,
        }
    }
}

/// A place of the unit square by a table, or the numbers to sample without
/// one. What is near is sampled half by its table, if that varies more than
/// the distance does.
#[inline]
fn by_table(table: Option<&SquareTable>, near: bool, u: Vec2) -> Result<[f64; 2], Vec2> {
    match table {
        None => Err(u),
        Some(table) if !near => Ok(table.sample(u)),
        Some(table) if table.contrast() < NEAR_CONTRAST => Err(u),
        Some(table) if u.x < 0.5 => Ok(table.sample(Vec2::new(2.0 * u.x, u.y))),
        Some(_) => Err(Vec2::new(2.0 * u.x - 1.0, u.y)),
    }
}

/// The density per solid angle of what [`by_table`] decides: `near` is that of
/// sampling by solid angle if there is one, `place` the point in the square,
/// `by_area` the density of points uniform in area.
#[inline]
fn density(
    table: Option<&SquareTable>,
    near: Option<f64>,
    place: impl FnOnce() -> [f64; 2],
    by_area: impl FnOnce() -> f64,
) -> f64 {
    match (table, near) {
        (None, Some(near)) => near,
        (None, None) => by_area(),
        (Some(table), None) => table.density(place()) * by_area(),
        (Some(table), Some(near)) if table.contrast() < NEAR_CONTRAST => near,
        (Some(table), Some(near)) => 0.5 * near + 0.5 * table.density(place()) * by_area(),
    }
}

/// Coordinates in \[-1, 1\]² of a place of the unit square.
fn signed(place: [f64; 2]) -> [f64; 2] {
    place.map(|c| 2.0 * c - 1.0)
}

/// Where in the unit square a point of a triangle is.
fn triangle_place(point: &SurfacePoint) -> [f64; 2] {
    triangle_to_square(point.barycentric.x, point.barycentric.y)
}

/// The same for a rectangle, disk or cylinder, by its (u, v).
fn analytic_place(analytic: &Analytic, point: &SurfacePoint) -> [f64; 2] {
    let [u, v] = [f64::from(point.uv.x), f64::from(point.uv.y)];
    match analytic {
        Analytic::Disk(_) => disk_to_square(u, v * std::f64::consts::TAU),
        Analytic::Cylinder(_) => [v, u],
        Analytic::Rectangle(_) | Analytic::Sphere(_) => [u, v],
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
        instance: point.instance,
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
