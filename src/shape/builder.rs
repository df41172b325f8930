//! Collects shapes into a [`Geometry`].

use super::linear::check_affine;
use super::triangle;
use super::{Analytic, Cylinder, Disk, Geometry, Rectangle, ShapeId, ShapeInfo, Sphere, mesh};
use crate::desc::{Error, Mesh, Result};
use crate::math::{Bounds, DVec3, Transform, Vec3};

/// How a mesh is added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshOptions {
    /// Turn all normals round. The winding stays.
    pub flip_normals: bool,
    /// Use the face normals for shading and drop vertex normals.
    pub face_normals: bool,
    /// Keep texture coordinates: something reads them.
    pub keep_uvs: bool,
    /// Give ∂p/∂u and ∂p/∂v at hits; without, they are zero.
    pub keep_tangents: bool,
}

impl Default for MeshOptions {
    fn default() -> Self {
        MeshOptions { flip_normals: false, face_normals: false, keep_uvs: true, keep_tangents: true }
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
}

impl GeometryBuilder {
    /// No shapes yet.
    #[must_use]
    pub fn new() -> GeometryBuilder {
        GeometryBuilder::default()
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
        check_affine(to_world)?;
        let g = &mut self.geometry;
        let first_vertex = g.positions.len();
        let limit = i32::MAX as usize;
        if first_vertex + mesh.positions.len() > limit || g.triangles.len() + mesh.triangles.len() > limit {
            return Err(Error::new("more than 2^31 vertices or triangles"));
        }
        let vertex_count = mesh.positions.len();
        if mesh.triangles.iter().flatten().any(|i| *i as usize >= vertex_count) {
            return Err(Error::new("a triangle of the mesh names a vertex that does not exist"));
        }
        let positions: Vec<Vec3> = mesh.positions.iter().map(|p| to_world.point_f32(*p)).collect();

        // Normals and texture coordinates live in arrays of their own.
        let base = |array: usize| Some(array as i64 - first_vertex as i64);
        let mut info = ShapeInfo {
            first_prim: g.triangles.len() as u32,
            prim_count: 0,
            kind: "mesh",
            flip: options.flip_normals,
            tangents: options.keep_tangents,
            normals: None,
            uvs: None,
        };
        if !options.face_normals {
            info.normals = base(g.normals.len());
            let given = !mesh.normals.is_empty() && mesh.normals.len() == vertex_count;
            g.normals.extend(if given {
                mesh::transform_normals(&mesh.normals, to_world)
            } else {
                mesh::smooth_normals(&positions, &mesh.triangles)
            });
        }
        if options.keep_uvs && !mesh.uvs.is_empty() && mesh.uvs.len() == vertex_count {
            info.uvs = base(g.uvs.len());
            g.uvs.extend(&mesh.uvs);
        }

        // Triangles, without those that no ray can meet.
        let shape = g.shapes.len() as ShapeId;
        for indices in &mesh.triangles {
            let vertices = indices.map(|i| positions[i as usize]);
            let cross = triangle::cross(&vertices);
            if cross.is_finite() && cross != DVec3::ZERO && cross.try_normalize().is_some() {
                g.triangles.push(indices.map(|i| i + first_vertex as u32));
                g.triangle_shapes.push(shape);
            }
        }
        info.prim_count = g.triangles.len() as u32 - info.first_prim;
        g.positions.extend(positions);
        let dropped = mesh.triangles.len() - info.prim_count as usize;
        g.shapes.push(info);
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
        g.shapes.push(ShapeInfo {
            // Counted from 0 until the number of triangles is known.
            first_prim: g.analytic.len() as u32,
            prim_count: 1,
            kind: analytic.name(),
            flip: false,
            tangents: true,
            normals: None,
            uvs: None,
        });
        g.analytic_bounds.push(triangle::widen(analytic.bounds()));
        g.analytic.push(analytic);
        g.analytic_shapes.push(shape);
        shape
    }

    /// All shapes together.
    #[must_use]
    pub fn finish(mut self) -> Geometry {
        let g = &mut self.geometry;
        let triangles = g.triangles.len() as u32;
        for &shape in &g.analytic_shapes {
            g.shapes[shape as usize].first_prim += triangles;
        }
        g.positions.shrink_to_fit();
        g.normals.shrink_to_fit();
        g.uvs.shrink_to_fit();
        g.triangles.shrink_to_fit();
        g.triangle_shapes.shrink_to_fit();
        let bounds = (0..g.prim_count()).map(|prim| g.prim_bounds(prim)).fold(Bounds::EMPTY, Bounds::union);
        g.bounds = Some(bounds);
        self.geometry
    }
}
