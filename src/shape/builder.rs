//! Collects shapes into a [`Geometry`].

use super::deform::{self, Deformation};
use super::geometry::Part;
use super::linear::check_affine;
use super::triangle;
use super::{Analytic, Cylinder, Disk, Geometry, Instance, Rectangle, ShapeId, ShapeInfo, Sphere, mesh};
use crate::desc::{Error, Mesh, Result};
use crate::math::{Bounds, DVec3, Motion, Transform, Vec3};

/// How a mesh is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Turn all normals round. The winding stays.
    pub flip_normals: bool,
    /// Use the face normals for shading and drop vertex normals.
    pub face_normals: bool,
    /// Keep texture coordinates: something reads them.
    pub keep_uvs: bool,
    /// Give ∂p/∂u and ∂p/∂v at hits; without, they are zero.
    pub keep_tangents: bool,
    /// When the shutter opens and closes, in the unit of a deformation's times.
    pub shutter: [f64; 2],
}

impl Default for MeshOptions {
    fn default() -> Self {
        MeshOptions {
            flip_normals: false,
            face_normals: false,
            keep_uvs: true,
            keep_tangents: true,
            shutter: [0.0; 2],
        }
    }
}

/// What happened to a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Triangles left out because they have no area or are not finite in f32.
    pub dropped: usize,
}

/// Collects shapes. Transforms are the caller's, in f64, already relative to
/// whatever point the scene is centred on.
#[derive(Clone, Debug, Default)]
pub struct GeometryBuilder {
    geometry: Geometry,
    /// Groups and how they are placed.
    placed: Vec<(u32, Motion)>,
}

impl GeometryBuilder {
    /// No shapes yet.
    #[must_use]
    pub fn new() -> GeometryBuilder {
        GeometryBuilder::default()
    }

    /// Begins a group: what is added from now on belongs to it, in its own
    /// space, until the next group begins. All that is not in a group comes
    /// before the first one. Gives the number of its part of the geometry.
    pub fn begin_group(&mut self) -> u32 {
        self.end_part();
        self.geometry.parts.len() as u32
    }

    /// What has been collected, for shapes that add to it elsewhere.
    pub(super) fn geometry_mut(&mut self) -> &mut Geometry {
        &mut self.geometry
    }

    /// Closes the part that is being filled.
    fn end_part(&mut self) {
        let g = &mut self.geometry;
        let start = g.parts.last().cloned().unwrap_or_default();
        g.parts.push(Part {
            triangles: start.triangles.end..g.triangles.len() as u32,
            analytic: start.analytic.end..g.analytic.len() as u32,
            moving: start.moving.end..g.moving.len() as u32,
            curves: start.curves.end..g.curves.len() as u32,
            bounds: None,
        });
    }

    /// Places a group in the scene, by a motion over the shutter, [0, 1]. A
    /// group that is empty gives nothing.
    pub fn add_instance(&mut self, part: u32, motion: Motion) {
        self.placed.push((part, motion));
    }

    /// Adds a mesh. Vertices are placed in f64 and rounded to f32 once.
    /// Meshes without vertex normals get smooth ones unless `face_normals`.
    /// Fails when `to_world` cannot be inverted or there are more than 2³¹
    /// vertices or triangles in all.
    pub fn add_mesh(
        &mut self,
        mesh: &Mesh,
        to_world: &Transform,
        options: MeshOptions,
    ) -> Result<(ShapeId, MeshReport)> {
        self.add_mesh_with(mesh, to_world, options, &[])
    }

    /// The same, keeping the mesh's attributes of these names; their places in
    /// the list are the slots that [`Geometry::attributes`] fills.
    pub fn add_mesh_with(
        &mut self,
        mesh: &Mesh,
        to_world: &Transform,
        options: MeshOptions,
        attributes: &[String],
    ) -> Result<(ShapeId, MeshReport)> {
        check_affine(to_world)?;
        check_mesh(mesh)?;
        let keys = match mesh.deformation.as_slice() {
            [] => Vec::new(),
            keys => deform::during(keys, options.shutter[0], options.shutter[1]),
        };
        let copies = keys.len().max(1);
        let g = &mut self.geometry;
        let (first_vertex, vertex_count) = (g.positions.len(), mesh.positions.len());
        let limit = i32::MAX as usize;
        let triangle_count = g.triangles.len() + g.moving.len() + mesh.triangles.len();
        if first_vertex + vertex_count * copies > limit || triangle_count > limit {
            return Err(Error::new("more than 2^31 vertices or triangles"));
        }

        // Normals and texture coordinates live in arrays of their own.
        let base = |array: usize| Some(array as i64 - first_vertex as i64);
        let mut info = ShapeInfo {
            first_prim: (if copies > 1 { g.moving.len() } else { g.triangles.len() }) as u32,
            prim_count: 0,
            kind: "mesh",
            flip: options.flip_normals,
            tangents: options.keep_tangents,
            normals: (!options.face_normals).then_some(g.normals.len() as i64 - first_vertex as i64),
            uvs: None,
            own_tangents: None,
            deformation: None,
            segments: 0,
        };
        if options.keep_uvs && !mesh.uvs.is_empty() && mesh.uvs.len() == vertex_count {
            info.uvs = base(g.uvs.len());
            g.uvs.extend(&mesh.uvs);
        }
        if options.keep_tangents && !mesh.tangents.is_empty() && mesh.tangents.len() == vertex_count {
            info.own_tangents = base(g.tangents.len());
            let side = if to_world.determinant() < 0.0 { -1.0 } else { 1.0 };
            g.tangents.extend(mesh.tangents.iter().map(|t| {
                let along = to_world.vector(t.truncate().as_dvec3()).normalize_or_zero().as_vec3();
                along.extend(t.w * side)
            }));
        }
        for copy in 0..copies {
            let (positions, normals) = match keys.get(copy) {
                Some(key) => (&key.positions, &key.normals),
                None => (&mesh.positions, &mesh.normals),
            };
            let positions: Vec<Vec3> = positions.iter().map(|p| to_world.point_f32(*p)).collect();
            if !options.face_normals {
                let given = !normals.is_empty() && normals.len() == vertex_count;
                g.normals.extend(if given {
                    mesh::transform_normals(normals, to_world)
                } else {
                    mesh::smooth_normals(&positions, &mesh.triangles)
                });
            }
            g.positions.extend(positions);
        }
        if copies > 1 {
            info.deformation = Some(g.deformations.len() as u32);
            let times = keys.iter().map(|k| k.time as f32).collect();
            g.deformations.push(Deformation { times, stride: vertex_count as u32 });
        }

        // Triangles, without those that no ray can meet at any time.
        let shape = g.shapes.len() as ShapeId;
        let mut kept = Vec::new();
        for (face, indices) in mesh.triangles.iter().enumerate() {
            let indices = indices.map(|i| i + first_vertex as u32);
            let has_area = |copy: usize| {
                let offset = copy * vertex_count;
                let cross = triangle::cross(&indices.map(|i| g.positions[i as usize + offset]));
                cross.is_finite() && cross != DVec3::ZERO && cross.try_normalize().is_some()
            };
            if copies == 1 && has_area(0) {
                g.triangles.push(indices);
                g.triangle_shapes.push(shape);
                kept.push(face as u32);
                info.prim_count += 1;
            } else if copies > 1 && (0..copies).any(has_area) {
                g.moving.push(indices);
                g.moving_shapes.push(shape);
                kept.push(face as u32);
                info.prim_count += 1;
            }
        }
        let dropped = mesh.triangles.len() - info.prim_count as usize;
        g.shapes.push(info);
        for (slot, name) in attributes.iter().enumerate() {
            if let Some(attribute) = mesh.attributes.iter().find(|a| a.name == *name) {
                g.keep_attribute((shape, first_vertex as u32), slot as u8, attribute, &kept);
            }
        }
        Ok((shape, MeshReport { dropped }))
    }

    /// Adds the cube [-1, 1]³ as a mesh; `face_normals` is of no account, as
    /// in Mitsuba its normals are those of its faces.
    pub fn add_cube(&mut self, to_world: &Transform, options: MeshOptions) -> Result<(ShapeId, MeshReport)> {
        let options = MeshOptions { face_normals: false, ..options };
        self.add_mesh(&mesh::cube(), to_world, options)
    }

    /// Adds a sphere: see [`Sphere::new`].
    pub fn add_sphere(
        &mut self,
        center: DVec3,
        radius: f64,
        to_world: &Transform,
        flip_normals: bool,
    ) -> Result<ShapeId> {
        Ok(self.add_analytic(Sphere::new(center, radius, to_world, flip_normals)?.into()))
    }

    /// Adds a disk: see [`Disk::new`].
    pub fn add_disk(&mut self, to_world: &Transform, flip_normals: bool) -> Result<ShapeId> {
        Ok(self.add_analytic(Disk::new(to_world, flip_normals)?.into()))
    }

    /// Adds a cylinder: see [`Cylinder::new`].
    pub fn add_cylinder(
        &mut self,
        ends: [DVec3; 2],
        radius: f64,
        to_world: &Transform,
        flip_normals: bool,
    ) -> Result<ShapeId> {
        Ok(self.add_analytic(Cylinder::new(ends, radius, to_world, flip_normals)?.into()))
    }

    /// Adds a rectangle: see [`Rectangle::new`].
    pub fn add_rectangle(&mut self, to_world: &Transform, flip_normals: bool) -> Result<ShapeId> {
        Ok(self.add_analytic(Rectangle::new(to_world, flip_normals)?.into()))
    }

    /// Adds any analytic shape.
    pub fn add_analytic(&mut self, analytic: Analytic) -> ShapeId {
        let g = &mut self.geometry;
        let shape = g.shapes.len() as ShapeId;
        // Counted from 0 until the number of triangles is known.
        g.shapes.push(ShapeInfo::of(analytic.name(), g.analytic.len() as u32, 1));
        g.analytic_bounds.push(triangle::bounds_of(analytic.bounds()));
        g.analytic.push(analytic);
        g.analytic_shapes.push(shape);
        shape
    }

    /// All shapes together.
    #[must_use]
    pub fn finish(mut self) -> Geometry {
        self.end_part();
        let g = &mut self.geometry;
        let (triangles, analytic) = (g.triangles.len() as u32, g.analytic.len() as u32);
        for &shape in &g.analytic_shapes {
            g.shapes[shape as usize].first_prim += triangles;
        }
        for info in g.shapes.iter_mut().filter(|info| info.deformation.is_some()) {
            info.first_prim += triangles + analytic;
        }
        let first_curve = g.first_curve();
        for info in g.shapes.iter_mut().filter(|info| info.segments > 0) {
            info.first_prim += first_curve;
        }
        g.curve_points.shrink_to_fit();
        g.curves.shrink_to_fit();
        g.curve_bounds.shrink_to_fit();
        g.curve_shapes.shrink_to_fit();
        g.positions.shrink_to_fit();
        g.normals.shrink_to_fit();
        g.uvs.shrink_to_fit();
        g.triangles.shrink_to_fit();
        g.triangle_shapes.shrink_to_fit();
        for part in (0..g.parts()).rev() {
            if part == 0 {
                // Every group has its box by now.
                let placed = std::mem::take(&mut self.placed).into_iter();
                let filled = placed.filter(|(part, _)| !g.part_bounds(*part).is_empty());
                let instances =
                    filled.map(|(part, m)| Instance::new(part, &g.part_bounds(part), &m)).collect();
                g.instances = instances;
            }
            let boxes = g.part_prims(part).map(|prim| g.prim_bounds(prim));
            g.parts[part as usize].bounds = Some(boxes.fold(Bounds::EMPTY, Bounds::union));
        }
        self.geometry
    }
}

fn check_mesh(mesh: &Mesh) -> Result<()> {
    let vertex_count = mesh.positions.len();
    if mesh.triangles.iter().flatten().any(|i| *i as usize >= vertex_count) {
        return Err(Error::new("a triangle of the mesh names a vertex that does not exist"));
    }
    if mesh.deformation.iter().any(|key| key.positions.len() != vertex_count) {
        return Err(Error::new("a deforming mesh has another number of vertices at another time"));
    }
    for attribute in &mesh.attributes {
        let count = if attribute.per_face { mesh.triangles.len() } else { vertex_count };
        if attribute.values.len() != count * attribute.channels as usize {
            return Err(Error::new(format!(
                "the attribute `{}` of a mesh has a wrong length",
                attribute.name
            )));
        }
    }
    Ok(())
}
