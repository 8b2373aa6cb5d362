//! A ray's way through one patch: from its first block down the nodes to pieces, each block built when it is missing.
//!
//! What is done with a block that was just built is apart from the code for blocks that are there: those stay in registers,
//! and nothing waits for a structure that was put into memory a moment ago.

use super::builder::{Builder, NODE_SIDE, PatchContext, child_cells, child_side};
use crate::cache::{Block, Slot, Visit};
use crate::grid::{CellRect, LaneHits, LatticeHit, LatticeRay, NodeView, PieceView, is_node};
use crate::ids::PatchId;
use crate::math::simd::{Kernel, Task};

/// A node on the way down a patch, and which of its children are still to be seen.
struct Level<'v> {
    block: Block<'v>,
    cells: CellRect,
    side: u32,
    hits: LaneHits,
}

/// Levels of nodes above a piece: 8 * 4^5 cells are more than [`crate::subdiv::dice::MAX_RATE`].
const MAX_LEVELS: usize = 5;

impl<'v> Level<'v> {
    #[inline(always)]
    fn new<K: Kernel>(kernel: K, visit: &Visit<'_>, block: Block<'v>, ray: &LatticeRay, t_max: f32) -> Self {
        let node = NodeView::new(block.bytes());
        let cells = node.cells();
        let hits = node.test(kernel, ray, t_max);
        let mut lanes = hits.mask;
        while lanes != 0 {
            visit.prefetch(block.child(lanes.trailing_zeros() as usize));
            lanes &= lanes - 1;
        }
        Self { block, cells, side: child_side(cells), hits }
    }

    #[inline(always)]
    fn child(&self, lane: usize) -> (Slot<'v>, CellRect) {
        let (a, b) = (lane as u32 % NODE_SIDE, lane as u32 / NODE_SIDE);
        (self.block.child(lane), child_cells(self.cells, self.side, a, b))
    }
}

/// Takes the nearest hit of a patch into `hit` if it is nearer than what is there.
pub(super) struct ClosestInPatch<'a, 'v, 'p, 'w> {
    pub builder: &'a mut Builder<'w>,
    pub visit: &'v Visit<'p>,
    pub root: Block<'v>,
    pub of: PatchContext<'a>,
    pub ray: &'a LatticeRay,
    pub hit: &'a mut LatticeHit,
}

impl Task for ClosestInPatch<'_, '_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        let Self { builder, visit, root, of, ray, hit } = self;
        if !is_node(root.bytes()) {
            PieceView::new(root.bytes()).closest(kernel, ray, of.patch, hit);
            return;
        }
        let mut levels: [Option<Level<'_>>; MAX_LEVELS] = Default::default();
        levels[0] = Some(Level::new(kernel, visit, root, ray, hit.t));
        let mut depth = 0;
        while let Some(level) = &mut levels[depth] {
            let Some(lane) = level.hits.pop_nearest(hit.t) else {
                if depth == 0 {
                    break;
                }
                depth -= 1;
                continue;
            };
            let (slot, cells) = level.child(lane);
            if let Some(block) = visit.get(slot) {
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(Level::new(kernel, visit, block, ray, hit.t));
                } else {
                    PieceView::new(block.bytes()).closest(kernel, ray, of.patch, hit);
                }
            } else {
                let block = builder.build(visit, slot, of, Some(cells));
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(kernel.enter(OpenLevel { visit, block, ray, t_max: hit.t }));
                } else {
                    kernel.enter(ClosestInPiece { block, patch: of.patch, ray, hit });
                }
            }
        }
    }
}

/// Whether the ray hits anything of a patch.
pub(super) struct OccludedInPatch<'a, 'v, 'p, 'w> {
    pub builder: &'a mut Builder<'w>,
    pub visit: &'v Visit<'p>,
    pub root: Block<'v>,
    pub of: PatchContext<'a>,
    pub ray: &'a LatticeRay,
}

impl Task for OccludedInPatch<'_, '_, '_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        let Self { builder, visit, root, of, ray } = self;
        if !is_node(root.bytes()) {
            return PieceView::new(root.bytes()).occluded(kernel, ray, of.patch);
        }
        let mut levels: [Option<Level<'_>>; MAX_LEVELS] = Default::default();
        levels[0] = Some(Level::new(kernel, visit, root, ray, ray.t_max()));
        let mut depth = 0;
        while let Some(level) = &mut levels[depth] {
            let Some(lane) = level.hits.pop() else {
                if depth == 0 {
                    break;
                }
                depth -= 1;
                continue;
            };
            let (slot, cells) = level.child(lane);
            let is_hit = if let Some(block) = visit.get(slot) {
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(Level::new(kernel, visit, block, ray, ray.t_max()));
                    continue;
                }
                PieceView::new(block.bytes()).occluded(kernel, ray, of.patch)
            } else {
                let block = builder.build(visit, slot, of, Some(cells));
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(kernel.enter(OpenLevel { visit, block, ray, t_max: ray.t_max() }));
                    continue;
                }
                kernel.enter(OccludedInPiece { block, patch: of.patch, ray })
            };
            if is_hit {
                return true;
            }
        }
        false
    }
}

// What is done with a block that was just built, apart from the code for blocks that are there.

struct OpenLevel<'a, 'v, 'p> {
    pub visit: &'v Visit<'p>,
    block: Block<'v>,
    pub ray: &'a LatticeRay,
    t_max: f32,
}

impl<'v> Task for OpenLevel<'_, 'v, '_> {
    type Output = Level<'v>;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Level<'v> {
        Level::new(kernel, self.visit, self.block, self.ray, self.t_max)
    }
}

struct ClosestInPiece<'a, 'v> {
    block: Block<'v>,
    patch: PatchId,
    pub ray: &'a LatticeRay,
    pub hit: &'a mut LatticeHit,
}

impl Task for ClosestInPiece<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        PieceView::new(self.block.bytes()).closest(kernel, self.ray, self.patch, self.hit);
    }
}

struct OccludedInPiece<'a, 'v> {
    block: Block<'v>,
    patch: PatchId,
    pub ray: &'a LatticeRay,
}

impl Task for OccludedInPiece<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        PieceView::new(self.block.bytes()).occluded(kernel, self.ray, self.patch)
    }
}
