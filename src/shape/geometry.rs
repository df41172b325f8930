//! All primitives of a scene in flat arrays.

use std::ops::Range;

use super::attributes::Stored;
use super::curve::CurvePiece;
use super::deform::{Between, Deformation};
use super::triangle;
use super::{Analytic, Hit, Instance, PrimId, RayProbe, ShapeId, SurfacePoint};
use crate::math::{Bounds, DVec3, Frame, Ray, Vec2, Vec3, Vec4};

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
    /// Tangents of its own, likewise.
    pub(crate) own_tangents: Option<i64>,
    /// It deforms: index of its times.
    pub(crate) deformation: Option<u32>,
    /// Segments of all its curves; 0 for what is none.
    pub(crate) segments: u32,
}

impl ShapeInfo {
    /// That of primitives which know their own normals and coordinates.
    pub(crate) fn of(kind: &'static str, first_prim: u32, prim_count: u32) -> ShapeInfo {
        ShapeInfo {
            first_prim,
            prim_count,
            kind,
            flip: false,
            tangents: true,
            normals: None,
            uvs: None,
            own_tangents: None,
            deformation: None,
            segments: 0,
        }
    }

    /// True when it is made of curves.
    #[must_use]
    pub fn is_curve(&self) -> bool {
        self.segments > 0
    }
}

/// The primitives of the top of a scene, or of a group.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    pub triangles: Range<u32>,
    /// Indices among the analytic primitives.
    pub analytic: Range<u32>,
    /// Indices among the deforming triangles.
    pub moving: Range<u32>,
    /// Indices among the pieces of curves.
    pub curves: Range<u32>,
    /// The box of all of them; for the top of instances too.
    pub bounds: Option<Bounds>,
}

/// All primitives of a scene, immutable. Made by
/// [`super::GeometryBuilder::finish`].
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uvs: Vec<Vec2>,
    /// Direction, and ±1 for the side of the bitangent.
    pub(crate) tangents: Vec<Vec4>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) triangle_shapes: Vec<ShapeId>,
    pub(crate) analytic: Vec<Analytic>,
    /// Their boxes, as [`Geometry::prim_bounds`] gives them.
    pub(crate) analytic_bounds: Vec<Bounds>,
    pub(crate) analytic_shapes: Vec<ShapeId>,
    pub(crate) shapes: Vec<ShapeInfo>,
    pub(crate) moving: Vec<[u32; 3]>,
    pub(crate) moving_shapes: Vec<ShapeId>,
    pub(crate) deformations: Vec<Deformation>,
    /// Control points: position and radius.
    pub(crate) curve_points: Vec<Vec4>,
    pub(crate) curves: Vec<CurvePiece>,
    /// Their boxes, as [`Geometry::prim_bounds`] gives them.
    pub(crate) curve_bounds: Vec<Bounds>,
    pub(crate) curve_shapes: Vec<ShapeId>,
    pub(crate) instances: Vec<Instance>,
    /// By shape, in order.
    pub(crate) attributes: Vec<Stored>,
    pub(crate) attribute_values: Vec<f32>,
    /// The top, then the groups.
    pub(crate) parts: Vec<Part>,
}

impl Geometry {
    /// Number of primitives, those of groups and instances included.
    /// Triangles come first.
    #[must_use]
    pub fn prim_count(&self) -> u32 {
        self.first_instance() + self.instances.len() as u32
    }

    /// The id of the first instance.
    #[must_use]
    #[inline(always)]
    pub fn first_instance(&self) -> PrimId {
        (self.triangles.len() + self.analytic.len() + self.moving.len() + self.curves.len()) as u32
    }

    /// Number of analytic primitives.
    #[must_use]
    pub fn analytic_count(&self) -> u32 {
        self.analytic.len() as u32
    }

    /// All instances; the id of the first is [`Geometry::first_instance`].
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The instance of an id.
    #[must_use]
    #[inline]
    pub fn instance(&self, prim: PrimId) -> Option<&Instance> {
        self.instances.get((prim as usize).checked_sub(self.first_instance() as usize)?)
    }

    /// Number of parts: 1 for the top of the scene, which is part 0 and has the
    /// instances, and one for each group.
    #[must_use]
    pub fn parts(&self) -> u32 {
        self.parts.len().max(1) as u32
    }

    /// The primitives of a part, by id.
    pub fn part_prims(&self, part: u32) -> impl Iterator<Item = PrimId> + '_ {
        let none = Part::default();
        let p = self.parts.get(part as usize).unwrap_or(&none);
        let first_analytic = self.triangles.len() as u32;
        let first_moving = first_analytic + self.analytic.len() as u32;
        let shift = |r: &Range<u32>, by: u32| r.start + by..r.end + by;
        let instances = if part == 0 { self.first_instance()..self.prim_count() } else { 0..0 };
        let (analytic, moving) = (shift(&p.analytic, first_analytic), shift(&p.moving, first_moving));
        let curves = shift(&p.curves, self.first_curve());
        p.triangles.clone().chain(analytic).chain(moving).chain(curves).chain(instances)
    }

    /// True when some triangle of a part deforms.
    #[must_use]
    pub fn part_deforms(&self, part: u32) -> bool {
        self.parts.get(part as usize).is_some_and(|p| !p.moving.is_empty())
    }

    /// The box of a part, in its own space.
    #[must_use]
    pub fn part_bounds(&self, part: u32) -> Bounds {
        self.parts.get(part as usize).and_then(|p| p.bounds).unwrap_or(Bounds::EMPTY)
    }

    /// True when anything moves while the shutter is open.
    #[must_use]
    pub fn moves(&self) -> bool {
        !self.moving.is_empty() || self.instances.iter().any(Instance::moves)
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
            Some(index) => match index.checked_sub(self.analytic.len()) {
                None => self.analytic_shapes[index],
                Some(index) => match index.checked_sub(self.moving.len()) {
                    None => self.moving_shapes[index],
                    Some(index) => self.curve_shapes[index],
                },
            },
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

    /// Index and shape of an analytic primitive; `None` for others.
    #[inline(always)]
    pub(crate) fn shape_at(&self, prim: PrimId) -> Option<(usize, &Analytic)> {
        let index = (prim as usize).wrapping_sub(self.triangles.len());
        Some((index, self.analytic.get(index)?))
    }

    /// The box of a primitive at all times of the shutter, widened by the
    /// rounding of its intersection test: every hit lies in it.
    #[must_use]
    pub fn prim_bounds(&self, prim: PrimId) -> Bounds {
        self.prim_bounds_during(prim, [0.0, 1.0])
    }

    /// The same between two times of the shutter; for an instance at all times.
    #[must_use]
    pub fn prim_bounds_during(&self, prim: PrimId, times: [f32; 2]) -> Bounds {
        if let Some(vertices) = self.triangle(prim) {
            return triangle::bounds(&vertices);
        }
        let index = (prim as usize).wrapping_sub(self.triangles.len());
        match (self.analytic_bounds.get(index), self.moving_index(prim)) {
            (Some(bounds), _) => *bounds,
            (None, Some(index)) => self.moving_bounds(index, times),
            (None, None) => match self.curve_index(prim) {
                Some(index) => self.curve_bounds[index],
                None => self.instance(prim).map_or(Bounds::EMPTY, |instance| *instance.bounds()),
            },
        }
    }

    /// The box of everything.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.part_bounds(0)
    }

    /// Area of a primitive in the square of the scene's unit; of what is neither
    /// a still triangle nor analytic, zero.
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
            + size_of_val(&*self.tangents)
            + size_of_val(&*self.triangles)
            + size_of_val(&*self.triangle_shapes)
            + size_of_val(&*self.analytic)
            + size_of_val(&*self.analytic_bounds)
            + size_of_val(&*self.analytic_shapes)
            + size_of_val(&*self.moving)
            + size_of_val(&*self.moving_shapes)
            + size_of_val(&*self.curve_points)
            + size_of_val(&*self.curves)
            + size_of_val(&*self.curve_bounds)
            + size_of_val(&*self.curve_shapes)
            + size_of_val(&*self.instances)
            + size_of_val(&*self.attribute_values)
            + self.instances.iter().map(Instance::extra_bytes).sum::<usize>()
    }

    /// Where a ray meets one primitive with 0 < t < `t_max`. Leaves out the
    /// primitives that the ray names in `skip` and `skip_end`; the ray's own
    /// `t_max` is not looked at. `None` for instances, which only an
    /// accelerator can look into.
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
        Some(Hit { t, prim, u, v, instance: Hit::NO_INSTANCE })
    }

    /// The same for a primitive that is neither a still triangle nor an
    /// instance; `None` for those.
    #[must_use]
    #[inline(always)]
    pub fn intersect_analytic(&self, prim: PrimId, probe: &RayProbe, t_max: f32) -> Option<Hit> {
        let index = (prim as usize).checked_sub(self.triangles.len())?;
        match self.analytic.get(index) {
            Some(analytic) => self.intersect_shape(index, analytic, probe, t_max),
            None => self.intersect_moving(prim, probe, t_max),
        }
    }

    /// The same for an analytic primitive of that index.
    pub(crate) fn intersect_shape(
        &self,
        index: usize,
        analytic: &Analytic,
        probe: &RayProbe,
        t_max: f32,
    ) -> Option<Hit> {
        let prim = (self.triangles.len() + index) as PrimId;
        if probe.skips(prim) {
            return None;
        }
        let hit = analytic.intersect(probe.origin().as_dvec3(), probe.dir().as_dvec3())?;
        let t = probe.confine(hit.t, &self.analytic_bounds[index], t_max)?;
        Some(Hit { t, prim, u: hit.u, v: hit.v, instance: Hit::NO_INSTANCE })
    }

    /// The surface at a hit that the same ray gave.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        if hit.instance != Hit::NO_INSTANCE {
            return self.surface_inside(ray, hit);
        }
        let Some(index) = (hit.prim as usize).checked_sub(self.triangles.len()) else {
            return self.triangle_surface(self.triangle_shapes[hit.prim as usize], hit, ray.time);
        };
        let Some(analytic) = self.analytic.get(index) else {
            let index = index - self.analytic.len();
            return match index.checked_sub(self.moving.len()) {
                None => self.moving_surface(index, hit, ray.time),
                Some(index) => self.curve_surface(index, ray, hit),
            };
        };
        let s = analytic.surface(ray.origin.as_dvec3(), ray.dir.as_dvec3(), hit);
        s.rounded((hit.prim, self.analytic_shapes[index]), ray.time, analytic.is_planar())
    }

    /// The surface at a hit in an instance.
    #[cold]
    fn surface_inside(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let inside = Hit { instance: Hit::NO_INSTANCE, ..*hit };
        let Some(instance) = self.instance(hit.instance) else { return self.surface(ray, &inside) };
        let placed = instance.at(ray.time);
        let local = placed.local_ray(ray.origin, ray.dir, ray.time);
        placed.to_world(&self.surface(&local, &inside), hit.instance)
    }

    /// Where a surface point is at another time of the shutter.
    #[must_use]
    pub fn moved(&self, surface: &SurfacePoint, time: f32) -> Vec3 {
        let instance = self.instance(surface.instance);
        let mut local = surface.p;
        if let Some(index) = self.moving_index(surface.prim) {
            let [a, b, c] = self.moving_triangle(index, time);
            let [u, v] = surface.barycentric.to_array();
            local = a * (1.0 - u - v) + b * u + c * v;
        } else if let Some(instance) = instance {
            local = instance.at(surface.time).point_to_local(surface.p);
        }
        instance.map_or(local, |instance| instance.at(time).point_to_world(local))
    }

    /// The point of a triangle at the barycentrics of a hit.
    pub(crate) fn triangle_surface(&self, shape: ShapeId, hit: &Hit, time: f32) -> SurfacePoint {
        let indices = self.triangles[hit.prim as usize];
        let vertices = indices.map(|i| self.positions[i as usize]);
        self.face_surface::<true>(shape, hit, (vertices, indices), time, None)
    }

    /// The same for given vertices, at a time that `between` says. Only when
    /// `BOUNDED` is the error known.
    #[inline(always)]
    pub(crate) fn face_surface<const BOUNDED: bool>(
        &self,
        shape: ShapeId,
        hit: &Hit,
        (vertices, indices): ([Vec3; 3], [u32; 3]),
        time: f32,
        between: Option<Between>,
    ) -> SurfacePoint {
        let info = &self.shapes[shape as usize];
        let [a, b, c] = vertices.map(|v| v.as_dvec3());
        let (b1, b2) = (f64::from(hit.u), f64::from(hit.v));
        let b0 = 1.0 - b1 - b2;
        let (e1, e2) = (b - a, c - a);
        let winding = e1.cross(e2).normalize().as_vec3();

        let weights = [b0 as f32, hit.u, hit.v];
        let (p, p_error) = if BOUNDED {
            triangle::point(&[a, b, c], [b0, b1, b2])
        } else {
            (triangle::loose_point(&vertices, weights), Vec3::ZERO)
        };

        // Texture coordinates, and tangents that follow them.
        let mut uv = Vec2::new(hit.u, hit.v);
        let corners = info.uvs.map(|base| indices.map(|i| self.uvs[(i64::from(i) + base) as usize]));
        if let Some([u0, u1, u2]) = corners {
            uv = u0 * weights[0] + u1 * weights[1] + u2 * weights[2];
        }
        let [mut dpdu, mut dpdv] =
            if info.tangents { tangents([e1, e2], corners, winding) } else { [Vec3::ZERO; 2] };

        let ns = self.vertex_normal(info, indices, weights, between).unwrap_or(winding);
        if let Some(base) = info.own_tangents {
            [dpdu, dpdv] = self.own_tangents(base, indices, weights, [ns, dpdu, dpdv]);
        }
        let sign = if info.flip { -1.0 } else { 1.0 };
        SurfacePoint {
            p,
            p_error,
            ng: winding * sign,
            ns: ns * sign,
            uv,
            barycentric: Vec2::new(hit.u, hit.v),
            dpdu,
            dpdv,
            prim: hit.prim,
            shape,
            instance: Hit::NO_INSTANCE,
            time,
            planar: true,
        }
    }

    /// The interpolated tangent of the mesh and the reverse of its bitangent
    /// (glTF's v runs down the image, and a bitangent points up), as long as
    /// ∂p/∂u and ∂p/∂v are; those where the tangents cancel.
    #[cold]
    fn own_tangents(
        &self,
        base: i64,
        indices: [u32; 3],
        weights: [f32; 3],
        [ns, dpdu, dpdv]: [Vec3; 3],
    ) -> [Vec3; 2] {
        let [a, b, c] = indices.map(|i| self.tangents[(i64::from(i) + base) as usize]);
        let sum = a * weights[0] + b * weights[1] + c * weights[2];
        match direction(sum.truncate()) {
            Some(t) => {
                let side = if sum.w < 0.0 { 1.0 } else { -1.0 };
                [t * dpdu.length(), ns.cross(t) * (side * dpdv.length())]
            }
            None => [dpdu, dpdv],
        }
    }

    /// Unit interpolated normal; `None` when the mesh has none or they cancel.
    #[inline(always)]
    fn vertex_normal(
        &self,
        info: &ShapeInfo,
        indices: [u32; 3],
        weights: [f32; 3],
        between: Option<Between>,
    ) -> Option<Vec3> {
        let base = info.normals?;
        let [a, b, c] = indices.map(|i| {
            let index = (i64::from(i) + base) as usize;
            match &between {
                None => self.normals[index],
                Some(between) => between.of(&self.normals, index),
            }
        });
        direction(a * weights[0] + b * weights[1] + c * weights[2])
    }
}

/// The direction of a mean of unit vectors; `None` where they cancel, up to
/// what rounding leaves of them.
#[inline(always)]
fn direction(mean: Vec3) -> Option<Vec3> {
    if mean.length_squared() > 1e-30 { mean.try_normalize() } else { None }
}

/// ∂p/∂u and ∂p/∂v of a triangle with these edges: along the texture
/// coordinates of its corners, if there are any; across the normal where those
/// coincide.
fn tangents([e1, e2]: [DVec3; 2], corners: Option<[Vec2; 3]>, normal: Vec3) -> [Vec3; 2] {
    let Some(corners) = corners else { return [e1.as_vec3(), e2.as_vec3()] };
    along([e1, e2], corners).unwrap_or_else(|| {
        let frame = Frame::from_normal(normal);
        [frame.s, frame.t]
    })
}

/// The derivatives of the position by coordinates that a triangle with these edges
/// has at its corners; `None` where the corners coincide in them.
#[inline(always)]
pub(super) fn along([e1, e2]: [DVec3; 2], corners: [Vec2; 3]) -> Option<[Vec3; 2]> {
    let [u0, u1, u2] = corners.map(|c| c.as_dvec2());
    let (d1, d2) = (u1 - u0, u2 - u0);
    let det = d1.perp_dot(d2);
    let along = || [(e1 * d2.y - e2 * d1.y) / det, (e2 * d1.x - e1 * d2.x) / det].map(|d| d.as_vec3());
    (det != 0.0).then(along)
}
