//! Attributes of meshes: kept for those shapes whose material reads them.

use super::geometry::along;
use super::{Geometry, ShapeId, SurfacePoint};
use crate::desc::MeshAttribute;
use crate::math::{DVec3, Vec2, Vec3, Vec4};

/// One attribute of one mesh, in the geometry's array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stored {
    pub shape: ShapeId,
    /// Which of a point's attributes it is.
    pub slot: u8,
    channels: u32,
    /// One entry for each triangle kept, in order.
    per_face: bool,
    /// Where its numbers begin.
    first: usize,
    /// The mesh's vertex 0.
    first_vertex: u32,
}

impl Geometry {
    /// Keeps an attribute of the shape that was added last, for `slot`.
    /// `kept` are the indices of the triangles that were kept.
    pub(crate) fn keep_attribute(
        &mut self,
        (shape, first_vertex): (ShapeId, u32),
        slot: u8,
        attribute: &MeshAttribute,
        kept: &[u32],
    ) {
        let first = self.attribute_values.len();
        let channels = attribute.channels;
        if attribute.per_face {
            let width = channels as usize;
            for face in kept {
                let at = *face as usize * width;
                self.attribute_values.extend(&attribute.values[at..at + width]);
            }
        } else {
            self.attribute_values.extend(&attribute.values);
        }
        let stored = Stored { shape, slot, channels, per_face: attribute.per_face, first, first_vertex };
        self.attributes.push(stored);
    }

    /// Attributes kept, over all shapes.
    #[must_use]
    pub fn attribute_count(&self) -> usize {
        self.attributes.len()
    }

    /// The attributes of a surface point, by slot: interpolated linearly over
    /// the triangle, or that of its face. One number is repeated; three get a
    /// fourth of 1. Zero where the shape has none.
    #[must_use]
    pub fn attributes<const N: usize>(&self, surface: &SurfacePoint) -> [Vec4; N] {
        let mut out = [Vec4::ZERO; N];
        // By shape, in order.
        let from = self.attributes.partition_point(|a| a.shape < surface.shape);
        for stored in self.attributes[from..].iter().take_while(|a| a.shape == surface.shape) {
            let entry = |index: u32| self.attribute_entry(stored, index);
            let value = if stored.per_face {
                entry(surface.prim - self.shapes[surface.shape as usize].first_prim)
            } else {
                let [a, b, c] = self.corners_of(surface).map(|i| entry(i - stored.first_vertex));
                let [u, v] = surface.barycentric.to_array();
                a * (1.0 - u - v) + b * u + c * v
            };
            if let Some(slot) = out.get_mut(usize::from(stored.slot)) {
                *slot = value;
            }
        }
        out
    }

    /// ∂p/∂s and ∂p/∂t at a point of a triangle for each attribute of which the first
    /// two numbers are taken for coordinates (s, t), by slot: zero where it is one
    /// number for each face, or none, or the coordinates of the corners coincide.
    #[must_use]
    pub fn attribute_derivatives<const N: usize>(&self, surface: &SurfacePoint) -> [[Vec3; 2]; N] {
        let mut out = [[Vec3::ZERO; 2]; N];
        let Some(edges) = self.edges(surface) else { return out };
        let from = self.attributes.partition_point(|a| a.shape < surface.shape);
        let own = self.attributes[from..].iter().take_while(|a| a.shape == surface.shape);
        for stored in own.filter(|a| !a.per_face) {
            let corners = self.corners_of(surface).map(|i| {
                let value = self.attribute_entry(stored, i - stored.first_vertex);
                value.truncate().truncate()
            });
            if let (Some(slot), Some(found)) = (out.get_mut(usize::from(stored.slot)), along(edges, corners))
            {
                *slot = found;
            }
        }
        out
    }

    /// ∂p/∂u and ∂p/∂v of the texture coordinates themselves, also where the tangents
    /// of the surface point are left out or are those of the mesh: zero where the
    /// coordinates of a triangle's corners coincide.
    #[must_use]
    pub fn uv_derivatives(&self, surface: &SurfacePoint) -> [Vec3; 2] {
        let Some(edges) = self.edges(surface) else { return [surface.dpdu, surface.dpdv] };
        let corners = match self.shapes[surface.shape as usize].uvs {
            Some(base) => self.corners_of(surface).map(|i| self.uvs[(i64::from(i) + base) as usize]),
            None => [Vec2::ZERO, Vec2::X, Vec2::Y],
        };
        along(edges, corners).unwrap_or([Vec3::ZERO; 2])
    }

    /// The two edges from the first corner of the triangle that a point is on, in the
    /// world and at the point's time.
    fn edges(&self, surface: &SurfacePoint) -> Option<[DVec3; 2]> {
        let [a, b, c] = match self.moving_index(surface.prim) {
            Some(index) => self.moving_triangle(index, surface.time),
            None => self.triangle(surface.prim)?,
        }
        .map(|p| p.as_dvec3());
        let edges = [b - a, c - a];
        Some(match self.instance(surface.instance) {
            Some(instance) => edges.map(|e| instance.at(surface.time).edge_to_world(e)),
            None => edges,
        })
    }

    fn corners_of(&self, surface: &SurfacePoint) -> [u32; 3] {
        match self.triangles.get(surface.prim as usize) {
            Some(triangle) => *triangle,
            None => self.moving_index(surface.prim).map_or([0; 3], |index| self.moving[index]),
        }
    }

    fn attribute_entry(&self, stored: &Stored, index: u32) -> Vec4 {
        let at = stored.first + index as usize * stored.channels as usize;
        let v = &self.attribute_values[at..at + stored.channels as usize];
        match *v {
            [x] => Vec4::splat(x),
            [x, y] => Vec4::new(x, y, 0.0, 1.0),
            [x, y, z] => Vec4::new(x, y, z, 1.0),
            [x, y, z, w] => Vec4::new(x, y, z, w),
            _ => Vec4::ZERO,
        }
    }
}
