//! Curves as decoded from a file.

use super::Fnv;

/// Several curves, in the file's own coordinates: control points with a radius
/// each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Control points: x, y, z and the radius. All finite, radii not negative.
    pub points: Vec<[f32; 4]>,
    /// Where each curve ends: the index after its last point, rising.
    pub ends: Vec<u32>,
}

impl Curves {
    /// The points of each curve, as ranges of indices.
    pub fn ranges(&self) -> impl Iterator<Item = std::ops::Range<u32>> + '_ {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| start..*end)
    }

    pub(super) fn hash(&self, hash: &mut Fnv) {
        self.points.iter().flatten().for_each(|x| hash.bytes(&x.to_bits().to_le_bytes()));
        self.ends.iter().for_each(|end| hash.bytes(&end.to_le_bytes()));
    }
}
