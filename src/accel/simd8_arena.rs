//! The memory of an 8-wide tree: nodes and blocks in one array, each close to
//! what is visited before it.

#![allow(
    unsafe_code,
    reason = "nodes and blocks are views of the same array; each block says why it is sound"
)]

use super::wide::{Block, Link, Node8, WIDTH};
use crate::math::Bounds;

/// What an arena is measured in: 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Unit([u32; 8]);

const NODE: usize = size_of::<Node8>() / size_of::<Unit>();
const BLOCK: usize = size_of::<Block>() / size_of::<Unit>();

const _: () = assert!(size_of::<Node8>() == NODE * 32 && align_of::<Node8>() == 32);
const _: () = assert!(size_of::<Block>() == BLOCK * 32 && align_of::<Block>() == 32);

/// By how much the planes of a node move during a slice of the shutter.
pub type Swing = [[f32; WIDTH]; 6];
const SWING: usize = size_of::<Swing>() / size_of::<Unit>();
const _: () = assert!(size_of::<Swing>() == SWING * 32);

/// Nodes and blocks, found by the index of their first unit. Where things move
/// there is a [`Swing`] behind every node.
#[derive(Clone, Debug, Default)]
pub struct Arena {
    units: Vec<Unit>,
    moving: bool,
}

impl Arena {
    /// Room for nodes without children, one after the other.
    pub fn add_nodes(&mut self, count: usize) -> usize {
        let at = self.units.len();
        let empty = Node8::EMPTY;
        for _ in 0..count {
            // SAFETY: a node is seven units of plain numbers.
            self.units.extend_from_slice(unsafe { &*(&raw const empty).cast::<[Unit; NODE]>() });
            if self.moving {
                self.units.extend([Unit([0; 8]); SWING]);
            }
        }
        at
    }

    /// Adds a block.
    pub fn add_block(&mut self, block: &Block) -> usize {
        let at = self.units.len();
        // SAFETY: a block is five units of plain numbers.
        self.units.extend_from_slice(unsafe { &*(&raw const *block).cast::<[Unit; BLOCK]>() });
        at
    }

    /// Units from one node to the next.
    pub fn step(&self) -> usize {
        if self.moving { NODE + SWING } else { NODE }
    }

    /// The node at an index.
    pub fn node_mut(&mut self, at: usize) -> &mut Node8 {
        let units = &mut self.units[at..at + NODE];
        // SAFETY: seven units are a node's size and alignment, and any numbers
        // are a node.
        unsafe { &mut *units.as_mut_ptr().cast::<Node8>() }
    }

    /// The node of a link.
    #[inline(always)]
    pub fn node(&self, link: Link) -> &Node8 {
        let units = &self.units[link.index()..link.index() + NODE];
        // SAFETY: as in `node_mut`.
        unsafe { &*units.as_ptr().cast::<Node8>() }
    }

    /// Where a node's lane moves to, from where [`Node8::set`] has put it.
    pub fn set_end(&mut self, at: usize, lane: usize, end: &Bounds) {
        let start = self.node_mut(at).bounds(lane);
        for (axis, plane) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 2 * axis), (axis, 2 * axis + 1)]) {
            let side = |bounds: &Bounds| if plane % 2 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            let by = side(end) - side(&start);
            self.units[at + NODE + plane].0[lane] = by.to_bits();
        }
    }

    /// By how much the planes of the node of a link move.
    #[inline(always)]
    pub fn swing(&self, link: Link) -> &Swing {
        let units = &self.units[link.index() + NODE..link.index() + NODE + SWING];
        // SAFETY: six units are its size and more than its alignment, and any numbers are one.
        unsafe { &*units.as_ptr().cast::<Swing>() }
    }

    /// The block of a link.
    #[inline(always)]
    pub fn block(&self, link: Link) -> &Block {
        let units = &self.units[link.index()..link.index() + BLOCK];
        // SAFETY: five units are a block's size and alignment, and any numbers
        // are a block.
        unsafe { &*units.as_ptr().cast::<Block>() }
    }

    /// The block behind that of a link.
    #[inline(always)]
    pub fn block_after(&self, link: Link) -> &Block {
        let units = &self.units[link.index() + BLOCK..link.index() + 2 * BLOCK];
        // SAFETY: as in `block`.
        unsafe { &*units.as_ptr().cast::<Block>() }
    }

    /// Changes the block of a link.
    pub fn change_block(&mut self, link: Link, change: impl FnOnce(Block) -> Block) {
        let block = change(*self.block(link));
        // SAFETY: as in `add_block`.
        let units = unsafe { &*(&raw const block).cast::<[Unit; BLOCK]>() };
        self.units[link.index()..][..BLOCK].copy_from_slice(units);
    }

    /// Where a link leads, as an address to be fetched ahead.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn address(&self, link: Link) -> *const Unit {
        self.units.as_ptr().wrapping_add(link.index())
    }

    /// All numbers in turn.
    pub fn words(&self) -> impl Iterator<Item = u32> {
        self.units.iter().flat_map(|unit| unit.0)
    }

    /// In units.
    pub fn len(&self) -> usize {
        self.units.len()
    }

    /// In bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.units)
    }

    /// An empty one with room for so many bytes, in large pages where the
    /// system has them: rays jump about in it, and a translation missed costs
    /// as much as the data.
    pub fn with_room(bytes: usize, moving: bool) -> Arena {
        let units = Vec::with_capacity(bytes / size_of::<Unit>());
        advise_large_pages(&units);
        Arena { units, moving }
    }

    /// Gives back the room that is left.
    pub fn settle(&mut self) {
        self.units.shrink_to_fit();
    }
}

/// Asks for large pages for memory that has not been touched yet.
fn advise_large_pages(units: &Vec<Unit>) {
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 4096;
        let from = (units.as_ptr() as usize).next_multiple_of(PAGE);
        let to = (units.as_ptr() as usize + units.capacity() * size_of::<Unit>()) / PAGE * PAGE;
        if from < to {
            // SAFETY: the pages are inside of an allocation of ours; the advice
            // does not change what is in them. Refusal changes nothing.
            unsafe { libc::madvise(from as *mut libc::c_void, to - from, libc::MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = units;
}
