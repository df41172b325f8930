//! The layout of an 8-wide tree: nodes of eight boxes, and blocks of four
//! primitives in the order of lanes.

use crate::math::{Bounds, Vec3};
use crate::shape::Geometry;

/// Children of a node.
pub const WIDTH: usize = 8;
/// Primitives of a block.
pub const LANES: usize = 4;

/// Eight boxes and what is in them: 224 bytes. `planes[2 · axis]` holds the
/// lower planes and `planes[2 · axis + 1]` the upper ones. Lanes without a child
/// are inside out, so that no ray meets them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Node8 {
    pub planes: [[f32; WIDTH]; 6],
    pub children: [Link; WIDTH],
}

impl Node8 {
    /// Without children.
    pub const EMPTY: Node8 = {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Node8 { planes: [low, high, low, high, low, high], children: [Link(0); WIDTH] }
    };

    /// Puts a child into a lane.
    pub fn set(&mut self, lane: usize, bounds: &Bounds, child: Link) {
        for axis in 0..3 {
            self.planes[2 * axis][lane] = bounds.min[axis];
            self.planes[2 * axis + 1][lane] = bounds.max[axis];
        }
        self.children[lane] = child;
    }

    /// Lanes that have a child.
    pub fn lanes(&self) -> impl Iterator<Item = usize> {
        (0..WIDTH).filter(|lane| self.planes[0][*lane] <= self.planes[1][*lane])
    }

    /// The box of a lane.
    pub fn bounds(&self, lane: usize) -> Bounds {
        let corner = |side: usize| Vec3::from_array([0, 2, 4].map(|i| self.planes[i + side][lane]));
        Bounds { min: corner(0), max: corner(1) }
    }
}

/// A child in 32 bits: bit 31 for a leaf, three bits of what is in it, and an
/// index into the arena. Leaves have one to four triangles (0 to 3), or up to
/// three and analytic primitives after them (4 to 7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Link(pub u32);

impl Link {
    const LEAF: u32 = 1 << 31;
    const ANALYTIC: u32 = 1 << 30;
    const KIND_SHIFT: u32 = 28;
    /// For each kind of leaf one bit for each of its triangles.
    const MASKS: u32 = 0x7310_f731;
    /// Indices are below this.
    pub const MAX: usize = 1 << 28;

    /// A node.
    pub fn node(index: usize) -> Link {
        debug_assert!(index < Link::MAX, "{index}");
        Link(index as u32)
    }

    /// A block.
    pub fn block(index: usize, triangles: usize, analytic: bool) -> Link {
        debug_assert!(index < Link::MAX && triangles <= LANES, "{index} {triangles}");
        let kind = if analytic { triangles + LANES } else { triangles.saturating_sub(1) };
        Link(Link::LEAF | (kind as u32) << Link::KIND_SHIFT | index as u32)
    }

    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Link::LEAF != 0
    }

    /// Of a node or block.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & (Link::MAX as u32 - 1)) as usize
    }

    /// One bit for each triangle of a leaf.
    #[inline(always)]
    pub fn triangle_mask(self) -> u32 {
        Link::MASKS >> ((self.0 >> (Link::KIND_SHIFT - 2)) & 28) & 15
    }

    /// A leaf that has analytic primitives.
    #[inline(always)]
    pub fn has_analytic(self) -> bool {
        self.0 & Link::ANALYTIC != 0
    }
}

/// Four primitives: 160 bytes. Triangles come first; analytic primitives and
/// empty lanes leave the vertices unused.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Block {
    /// By vertex, axis, lane.
    pub vertices: [[[f32; LANES]; 3]; 3],
    pub prims: [u32; LANES],
}

impl Block {
    /// The prim of an empty lane.
    pub const NONE: u32 = u32::MAX;
    pub const EMPTY: Block = Block { vertices: [[[0.0; LANES]; 3]; 3], prims: [Block::NONE; LANES] };

    /// Of at most four primitives, triangles first.
    pub fn new(geometry: &Geometry, prims: &[u32]) -> Block {
        let mut block = Block::EMPTY;
        for (lane, prim) in prims.iter().enumerate() {
            block.prims[lane] = *prim;
            if let Some(vertices) = geometry.triangle(*prim) {
                block.put(lane, &vertices);
            }
        }
        block
    }

    pub fn put(&mut self, lane: usize, vertices: &[Vec3; 3]) {
        for (corner, vertex) in vertices.iter().enumerate() {
            for axis in 0..3 {
                self.vertices[corner][axis][lane] = vertex[axis];
            }
        }
    }

    /// The vertices of a lane.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> [Vec3; 3] {
        self.vertices.map(|v| Vec3::new(v[0][lane], v[1][lane], v[2][lane]))
    }
    /// The same with the edges from the first vertex in place of the other two:
    /// what `bvh8_plain` tests.
    pub fn into_edges(mut self) -> Block {
        let [first, rest @ ..] = &mut self.vertices;
        for corner in rest {
            for (row, from) in corner.iter_mut().zip(&*first) {
                row.iter_mut().zip(from).for_each(|(to, from)| *to -= from);
            }
        }
        self
    }
}
