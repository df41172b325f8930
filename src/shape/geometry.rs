//! All primitives of a scene in flat arrays.

use super::triangle;
use super::{Analytic, Hit, PrimId, RayProbe, ShapeId, SurfacePoint};
use crate::math::{Bounds, DVec3, Frame, Ray, Vec2, Vec3, gamma};

/// One shape of the scene file.
#[derive(Clone, Debug)]
pub struct ShapeInfo {
    /// Its first primitive.
    pub first_prim: PrimId,
    /// How many primitives it has; they follow each other.
    pub prim_count: u32,
    /// Its kind: `mesh`, or the name of an analytic shape.
    pub kind: &'static str,
    /// The normals of a mesh are turned round.
    pub(crate) flip: bool,
    /// Somebody wants ∂p/∂u and ∂p/∂v of a mesh.
    pub(crate) tangents: bool,
    /// Normals and texture coordinates of a mesh: index into the arrays for
    /// its vertex 0, minus the index of that vertex.
    pub(crate) normals: Option<i64>,
    pub(crate) uvs: Option<i64>,
}

/// All primitives of a scene, immutable. Made by
/// [`super::GeometryBuilder::finish`].
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uvs: Vec<Vec2>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) triangle_shapes: Vec<ShapeId>,
    pub(crate) analytic: Vec<Analytic>,
    /// Their boxes, as [`Geometry::prim_bounds`] gives them.
    pub(crate) analytic_bounds: Vec<Bounds>,
    pub(crate) analytic_shapes: Vec<ShapeId>,
    pub(crate) shapes: Vec<ShapeInfo>,
    pub(crate) bounds: Option<Bounds>,
}

impl Geometry {
    /// Number of primitives. Triangles come first.
    #[must_use]
    pub fn prim_count(&self) -> u32 {
        (self.triangles.len() + self.analytic.len()) as u32
    }

    /// The vertices of all triangles.
    #[must_use]
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Each triangle's vertices, as indices of positions.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> u32 {
        self.triangles.len() as u32
    }

    /// All shapes, by [`ShapeId`].
    #[must_use]
    pub fn shapes(&self) -> &[ShapeInfo] {
        &self.shapes
    }

    /// Number of shapes.
    #[must_use]
    pub fn shape_count(&self) -> usize {
        self.shapes.len()
    }

    /// The shape a primitive belongs to.
    #[must_use]
    pub fn shape_of(&self, prim: PrimId) -> ShapeId {
        match (prim as usize).checked_sub(self.triangles.len()) {
            None => self.triangle_shapes[prim as usize],
            Some(index) => self.analytic_shapes[index],
        }
    }

    /// The vertices of a triangle; `None` for other primitives.
    #[must_use]
    #[inline]
    pub fn triangle(&self, prim: PrimId) -> Option<[Vec3; 3]> {
        let indices = self.triangles.get(prim as usize)?;
        Some(indices.map(|i| self.positions[i as usize]))
    }

    /// The analytic shape of a primitive; `None` for triangles.
    #[must_use]
    #[inline]
    pub fn analytic(&self, prim: PrimId) -> Option<&Analytic> {
        self.analytic.get((prim as usize).checked_sub(self.triangles.len())?)
    }

    /// The box of a primitive, widened by the rounding of its intersection
    /// test: every hit lies in it.
    #[must_use]
    pub fn prim_bounds(&self, prim: PrimId) -> Bounds {
        match self.triangle(prim) {
            Some(vertices) => triangle::bounds(&vertices),
            None => {
                let index = (prim as usize).wrapping_sub(self.triangles.len());
                self.analytic_bounds.get(index).copied().unwrap_or(Bounds::EMPTY)
            }
        }
    }

    /// The box of everything.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds.unwrap_or(Bounds::EMPTY)
    }

    /// Area of a primitive in the square of the scene's unit.
    #[must_use]
    pub fn area(&self, prim: PrimId) -> f64 {
        match (self.triangle(prim), self.analytic(prim)) {
            (Some(vertices), _) => 0.5 * triangle::cross(&vertices).length(),
            (None, Some(analytic)) => analytic.area(),
            (None, None) => 0.0,
        }
    }

    /// Memory of the arrays in bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.positions)
            + size_of_val(&*self.normals)
            + size_of_val(&*self.uvs)
            + size_of_val(&*self.triangles)
            + size_of_val(&*self.triangle_shapes)
            + size_of_val(&*self.analytic)
            + size_of_val(&*self.analytic_bounds)
            + size_of_val(&*self.analytic_shapes)
    }

    /// Where a ray meets one primitive with 0 < t < `t_max`. Leaves out the
    /// primitives that the ray names in `skip` and `skip_end`; the ray's own
    /// `t_max` is not looked at.
    #[must_use]
    pub fn intersect(&self, prim: PrimId, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.intersect_probe(prim, &RayProbe::new(ray)?, t_max)
    }

    /// The same for a ray that has been prepared: what accelerators call.
    #[must_use]
    #[inline]
    pub fn intersect_probe(&self, prim: PrimId, probe: &RayProbe, t_max: f32) -> Option<Hit> {
        match self.triangle(prim) {
            Some(vertices) => Geometry::intersect_triangle(prim, &vertices, probe, t_max),
            None => self.intersect_analytic(prim, probe, t_max),
        }
    }

    /// The same for a triangle whose vertices are at hand.
    #[must_use]
    #[inline(always)]
    pub fn intersect_triangle(
        prim: PrimId,
        vertices: &[Vec3; 3],
        probe: &RayProbe,
        t_max: f32,
    ) -> Option<Hit> {
        let (t, u, v) = triangle::intersect(probe, vertices)?;
        if probe.skips(prim) {
            return None;
        }
        let t = probe.confine(t, &triangle::bounds(vertices), t_max)?;
        Some(Hit { t, prim, u, v })
    }

    /// The same for an analytic primitive; `None` for triangles.
    #[must_use]
    pub fn intersect_analytic(&self, prim: PrimId, probe: &RayProbe, t_max: f32) -> Option<Hit> {
        if probe.skips(prim) {
            return None;
        }
        let index = (prim as usize).checked_sub(self.triangles.len())?;
        let hit = self.analytic.get(index)?.intersect(probe.origin.as_dvec3(), probe.dir.as_dvec3())?;
        let t = probe.confine(hit.t, &self.analytic_bounds[index], t_max)?;
        Some(Hit { t, prim, u: hit.u, v: hit.v })
    }

    /// The surface at a hit that the same ray gave.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let shape = self.shape_of(hit.prim);
        match self.analytic(hit.prim) {
            None => self.triangle_surface(shape, hit),
            Some(analytic) => {
                let s = analytic.surface(ray.origin.as_dvec3(), ray.dir.as_dvec3(), hit);
                SurfacePoint {
                    p: s.p.as_vec3(),
                    p_error: s.p_error,
                    ng: s.ng.as_vec3(),
                    ns: s.ns.as_vec3(),
                    uv: s.uv,
                    barycentric: Vec2::ZERO,
                    dpdu: s.dpdu.as_vec3(),
                    dpdv: s.dpdv.as_vec3(),
                    prim: hit.prim,
                    shape,
                    planar: analytic.is_planar(),
                }
            }
        }
    }

    /// The point of a triangle at the barycentrics of a hit.
    pub(crate) fn triangle_surface(&self, shape: ShapeId, hit: &Hit) -> SurfacePoint {
        let info = &self.shapes[shape as usize];
        let indices = self.triangles[hit.prim as usize];
        let [a, b, c] = indices.map(|i| self.positions[i as usize].as_dvec3());
        let (b1, b2) = (f64::from(hit.u), f64::from(hit.v));
        let b0 = 1.0 - b1 - b2;
        let (e1, e2) = (b - a, c - a);
        let winding = e1.cross(e2).normalize().as_vec3();

        // Position and its error, pbrt-v4 equation 6.21.
        let terms = [a * b0, b * b1, c * b2];
        let p = terms[0] + terms[1] + terms[2];
        let size = terms[0].abs() + terms[1].abs() + terms[2].abs();

        // Texture coordinates, and tangents that follow them.
        let weights = [b0 as f32, hit.u, hit.v];
        let mut uv = Vec2::new(hit.u, hit.v);
        let corners = info.uvs.map(|base| indices.map(|i| self.uvs[(i64::from(i) + base) as usize]));
        if let Some([u0, u1, u2]) = corners {
            uv = u0 * weights[0] + u1 * weights[1] + u2 * weights[2];
        }
        let [dpdu, dpdv] = if info.tangents { tangents([e1, e2], corners, winding) } else { [Vec3::ZERO; 2] };

        let ns = self.vertex_normal(info, indices, weights).unwrap_or(winding);
        let sign = if info.flip { -1.0 } else { 1.0 };
        SurfacePoint {
            p: p.as_vec3(),
            p_error: size.as_vec3() * gamma(7),
            ng: winding * sign,
            ns: ns * sign,
            uv,
            barycentric: Vec2::new(hit.u, hit.v),
            dpdu,
            dpdv,
            prim: hit.prim,
            shape,
            planar: true,
        }
    }

    /// Unit interpolated normal; `None` when the mesh has none or they cancel.
    fn vertex_normal(&self, info: &ShapeInfo, indices: [u32; 3], weights: [f32; 3]) -> Option<Vec3> {
        let base = info.normals?;
        let [a, b, c] = indices.map(|i| self.normals[(i64::from(i) + base) as usize]);
        (a * weights[0] + b * weights[1] + c * weights[2]).try_normalize()
    }
}

/// ∂p/∂u and ∂p/∂v of a triangle with these edges: along the texture
/// coordinates of its corners, if there are any; across the normal where those
/// coincide.
fn tangents([e1, e2]: [DVec3; 2], corners: Option<[Vec2; 3]>, normal: Vec3) -> [Vec3; 2] {
    let Some(corners) = corners else { return [e1.as_vec3(), e2.as_vec3()] };
    let [u0, u1, u2] = corners.map(|c| c.as_dvec2());
    let (d1, d2) = (u1 - u0, u2 - u0);
    let det = d1.perp_dot(d2);
    if det == 0.0 {
        let frame = Frame::from_normal(normal);
        return [frame.s, frame.t];
    }
    [(e1 * d2.y - e2 * d1.y) / det, (e2 * d1.x - e1 * d2.x) / det].map(|d| d.as_vec3())
}
