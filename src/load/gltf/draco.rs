//! Primitives compressed by `KHR_draco_mesh_compression`, decoded by the crate
//! `draco-core`.

use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

use super::fail;
use super::json::Primitive;
use super::source::Source;
use crate::desc::Result;
use crate::load::foreign::guarded;

/// A decoded primitive.
pub struct Packed {
    mesh: Mesh,
}

/// Largest output of one primitive in bytes.
const CAP: u64 = 2 << 30;

impl Packed {
    /// Decodes a primitive, if it is compressed.
    pub fn decode(source: &Source, primitive: &Primitive, place: &str) -> Result<Option<Packed>> {
        let Some(draco) = &primitive.extensions.draco else { return Ok(None) };
        let place = format!("{place}.extensions.KHR_draco_mesh_compression");
        let (bytes, _) = source.view(draco.buffer_view, &place)?;
        let limits = DecodeLimits::default().with_max_decoded_bytes(source.budget.left().min(CAP));
        let mesh = guarded(|| {
            let mut mesh = Mesh::new();
            MeshDecoder::new()
                .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
                .map_err(|e| e.to_string())?;
            Ok(mesh)
        })
        .map_err(|e| fail(&place, format!("cannot be decoded: {e}")))?;
        source.budget.take((mesh.num_faces() * 12 + mesh.num_points() * 12) as u64, &place)?;
        Ok(Some(Packed { mesh }))
    }

    /// Vertices, after decoding.
    pub fn points(&self) -> usize {
        self.mesh.num_points()
    }

    /// The vertex indices of all triangles.
    pub fn indices(&self) -> Vec<u32> {
        self.mesh.faces().iter().flatten().map(|point| point.0).collect()
    }

    /// An attribute by the id that the extension gives it, `width` numbers per
    /// vertex, integers scaled to at most 1 if the accessor says `normalized`.
    pub fn attribute(&self, id: u32, width: usize, normalized: bool) -> Option<Vec<f32>> {
        let attribute = self.mesh.attribute_by_unique_id(id)?;
        let largest = match attribute.data_type() {
            _ if !normalized => 1.0,
            DataType::Int8 => 127.0,
            DataType::Uint8 => 255.0,
            DataType::Int16 => 32767.0,
            DataType::Uint16 => 65535.0,
            _ => 1.0,
        };
        let mut values = attribute.read_f32s(self.mesh.num_points(), width);
        if largest != 1.0 {
            values.iter_mut().for_each(|v| *v = (*v / largest).max(-1.0));
        }
        Some(values)
    }
}
