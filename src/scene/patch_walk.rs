//! A ray's way through one patch: from its first block down the nodes to pieces, each block built when it is missing.
//!
//! A node is left for its children in a function of its own only if they are nodes in their turn, which takes a rate
//! above 32, or had to be built just now. So blocks that are there stay in registers, and nothing waits for a structure
//! that was put into memory a moment ago.

use super::builder::{Builder, NODE_SIDE, PatchContext, child_cells, child_side};
use crate::cache::{Block, Visit};
use crate::grid::{CellRect, LatticeHit, LatticeRay, NodeView, PieceView, is_node};
use crate::math::simd::{Kernel, Task};

/// Where in a patch.
#[derive(Clone, Copy)]
pub(super) struct InPatch<'a, 'v, 'p> {
    pub visit: &'v Visit<'p>,
    pub block: Block<'v>,
    /// Nodes above the block.
    pub depth: usize,
    pub of: PatchContext<'a>,
    pub ray: &'a LatticeRay,
}

impl<'v> InPatch<'_, 'v, '_> {
    /// Asks for the blocks of children that are visited after others.
    #[inline(always)]
    fn prefetch_children(self, mut lanes: u32) {
        while lanes != 0 {
            self.visit.prefetch(self.block.child(lanes.trailing_zeros() as usize));
            lanes &= lanes - 1;
        }
    }

    /// Builds a child's block. (The slot is made anew: handed over, it would be written to memory for blocks that are
    /// there, too.)
    #[cold]
    #[inline(never)]
    fn build_child(self, builder: &mut Builder<'_>, lane: usize) -> Self {
        let slot = self.block.child(lane);
        let block = builder.build(self.visit, slot, self.of, Some(child_of(NodeView::new(self.block.bytes()), lane)));
        builder.note_child(self.depth + 1, lane, block);
        self.below(block)
    }

    #[inline(always)]
    fn below(self, block: Block<'v>) -> Self {
        Self { block, depth: self.depth + 1, ..self }
    }
}

/// Cells of a node's child.
pub(super) fn child_of(node: NodeView<'_>, lane: usize) -> CellRect {
    let (a, b) = (lane as u32 % NODE_SIDE, lane as u32 / NODE_SIDE);
    child_cells(node.cells(), child_side(node.cells()), a, b)
}

/// Takes the nearest hit of a block and those below into `hit` if it is nearer than what is there.
pub(super) struct ClosestInPatch<'a, 'v, 'p, 'w> {
    pub builder: &'a mut Builder<'w>,
    pub at: InPatch<'a, 'v, 'p>,
    pub hit: &'a mut LatticeHit,
}

impl Task for ClosestInPatch<'_, '_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        let Self { builder, at, hit } = self;
        let InPatch { visit, block, ray, of, .. } = at;
        if !is_node(block.bytes()) {
            PieceView::new(block.bytes()).closest(kernel, ray, of.patch, hit);
            return;
        }
        let mut children = NodeView::new(block.bytes()).test(kernel, ray, hit.t);
        let Some(mut lane) = children.pop_nearest(hit.t) else { return };
        at.prefetch_children(children.mask);
        loop {
            if let Some(child) = visit.get(block.child(lane)) {
                builder.note_child(at.depth + 1, lane, child);
                if is_node(child.bytes()) {
                    kernel.enter(ClosestInPatch { builder, at: at.below(child), hit });
                } else {
                    PieceView::new(child.bytes()).closest(kernel, ray, of.patch, hit);
                }
            } else {
                let at = at.build_child(builder, lane);
                kernel.enter(ClosestInPatch { builder, at, hit });
            }
            let Some(next) = children.pop_nearest(hit.t) else { return };
            lane = next;
        }
    }
}

/// Whether the ray hits anything of a block and those below.
pub(super) struct OccludedInPatch<'a, 'v, 'p, 'w> {
    pub builder: &'a mut Builder<'w>,
    pub at: InPatch<'a, 'v, 'p>,
}

impl Task for OccludedInPatch<'_, '_, '_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        let Self { builder, at } = self;
        let InPatch { visit, block, ray, of, .. } = at;
        if !is_node(block.bytes()) {
            return PieceView::new(block.bytes()).occluded(kernel, ray, of.patch);
        }
        let mut children = NodeView::new(block.bytes()).lanes_met(kernel, ray, ray.t_max());
        at.prefetch_children(children & children.wrapping_sub(1));
        while children != 0 {
            let lane = children.trailing_zeros() as usize;
            children &= children - 1;
            let is_hit = if let Some(child) = visit.get(block.child(lane)) {
                builder.note_child(at.depth + 1, lane, child);
                if is_node(child.bytes()) {
                    kernel.enter(OccludedInPatch { builder, at: at.below(child) })
                } else {
                    PieceView::new(child.bytes()).occluded(kernel, ray, of.patch)
                }
            } else {
                let at = at.build_child(builder, lane);
                kernel.enter(OccludedInPatch { builder, at })
            };
            if is_hit {
                return true;
            }
        }
        false
    }
}
