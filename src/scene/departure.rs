//! Rays that leave a patch so steeply that they do not meet it again: most secondary rays, whose own patch would
//! otherwise be what they are tested against most, since they start in the midst of its boxes.
//!
//! How steep the surface of a block is, its [`ChordCone`], is found from its pieces when it is left for the second time. Those that are
//! not in the cache are diced for it and forgotten, so that what is tested does not depend on what the cache holds: a trace of look-ups can be replayed for
//! any size. The cone is remembered as long as no other block takes its place. It decides only what is tested, never what is hit.

use super::builder::{Builder, NODE_SIDE, PatchContext, child_cells, child_side, is_piece};
use super::world::WorldMesh;
use crate::cache::{Block, Slot, Visit};
use crate::grid::{CellRect, ChordCone, LatticeRay, MAX_CELLS, NodeView, PieceView, is_node};
use crate::ids::MeshId;
use crate::math::Ray;
use std::sync::atomic::{AtomicU64, Ordering};

/// Blocks that are remembered at most.
const MOST_ENTRIES: usize = 1 << 14;

/// Entries for each leaf slot, while there are not too many: for the patch and for some of its parts.
const ENTRIES_PER_SLOT: usize = 4;

/// Children of a node.
const MOST_CHILDREN: usize = (NODE_SIDE * NODE_SIDE) as usize;

/// In place of a cone: the block was left once.
const LEFT_ONCE: u32 = u32::MAX;

/// The cones of blocks that rays have left, for all threads.
///
/// An entry is one word: the number of the block among those of all meshes and one more, on top; the cone below.
/// So whoever reads it knows whose cone it is, and there is nothing to wait for.
pub(super) struct Departures {
    /// A power of two of them; none if there are too many blocks for numbers of 32 bits.
    entries: Box<[AtomicU64]>,
    /// How many leaf slots there are before those of each mesh.
    first: Box<[u32]>,
}

/// A patch's first block or one of that block's children, among those of all meshes.
#[derive(Clone, Copy)]
struct Number(u32);

/// A ray that leaves a patch of a mesh from above, or another one.
#[derive(Clone, Copy)]
pub(super) struct Leaving<'c>(Option<&'c Departures>);

impl<'c> Leaving<'c> {
    /// A ray that comes from elsewhere.
    pub const NOTHING: Self = Self(None);

    /// Of a ray at the mesh.
    #[inline(always)]
    pub fn of(ray: &Ray, id: MeshId, mesh: &WorldMesh, departures: &'c Departures) -> Self {
        let is_leaving = ray.is_above && mesh.keeps_angles() && ray.from.is_some_and(|from| from.mesh == id);
        Self(is_leaving.then_some(departures))
    }

    /// The children of a patch's first block that the ray need not be tested against, as bits; `None` if that is the whole patch. `root` is
    /// the slot of that block, `leaf_slot` its number. `ray` is the same in the lattice.
    #[inline(always)]
    pub fn left_out(
        self,
        ray: &LatticeRay,
        of: PatchContext<'_>,
        leaf_slot: u32,
        builder: &mut Builder<'_>,
        visit: &Visit<'_>,
        root: Slot<'_>,
    ) -> Option<u32> {
        match self.0 {
            Some(departures) if ray.starts_on(of.patch) => {
                departures.left_out(ray, leaf_slot, &mut Left { of, builder, visit, root })
            }
            _ => Some(0),
        }
    }
}

impl Departures {
    /// For meshes with so many leaf slots each.
    pub fn new(n_slots: impl Iterator<Item = usize> + Clone) -> Self {
        let all = n_slots.clone().sum::<usize>();
        let n_entries = if all < u32::MAX as usize / (MOST_CHILDREN + 1) { entries_for(all) } else { 0 };
        let first = n_slots.scan(0u32, |next, n| Some(std::mem::replace(next, next.wrapping_add(n as u32))));
        Self { first: first.collect(), entries: (0..n_entries).map(|_| AtomicU64::new(0)).collect() }
    }

    /// Bytes of the table for meshes with so many leaf slots in all: 128 KiB at most.
    pub fn bytes_for(n_slots: usize) -> usize {
        entries_for(n_slots) * size_of::<AtomicU64>()
    }

    /// [`Leaving::left_out`] of the patch that the ray leaves.
    #[inline(never)]
    fn left_out(&self, ray: &LatticeRay, leaf_slot: u32, left: &mut Left<'_, '_, '_, '_>) -> Option<u32> {
        let slot = self.first[left.of.id.idx()].wrapping_add(leaf_slot);
        let patch = Number(slot.wrapping_mul(MOST_CHILDREN as u32 + 1));
        if self.is_left(ray, patch, left, None) {
            return None;
        }
        let cells = left.cells();
        if is_piece(cells) {
            return Some(0);
        }
        let child = child_of_start(cells, ray);
        let is_left = self.is_left(ray, patch.child(child), left, Some(child));
        Some(u32::from(is_left) << child)
    }

    /// Whether the ray leaves a patch, or a child of its first block, for good.
    #[inline(always)]
    fn is_left(&self, ray: &LatticeRay, number: Number, left: &mut Left<'_, '_, '_, '_>, child: Option<u32>) -> bool {
        let place = number.0 as usize & self.entries.len().wrapping_sub(1);
        let Some(entry) = self.entries.get(place) else { return false };
        // `Relaxed`: the word is all there is to know.
        match number.cone_in(entry.load(Ordering::Relaxed)) {
            Some(cone) => cone.is_left_by(ray),
            None => find(number, entry, ray, left, child).is_left_by(ray),
        }
    }
}

fn entries_for(n_slots: usize) -> usize {
    n_slots.saturating_mul(ENTRIES_PER_SLOT).min(MOST_ENTRIES).next_power_of_two()
}

/// The child of a node over these cells in which the ray's triangle lies.
#[inline(always)]
fn child_of_start(cells: CellRect, ray: &LatticeRay) -> u32 {
    let ([i, j], side) = (ray.start_cell(), child_side(cells));
    (j - u32::from(cells.j0)) / side * NODE_SIDE + (i - u32::from(cells.i0)) / side
}

impl Number {
    #[inline(always)]
    fn child(self, lane: u32) -> Self {
        Self(self.0 + 1 + lane)
    }

    /// The word of this block with these low bits.
    #[inline(always)]
    fn word(self, low: u32) -> u64 {
        (u64::from(self.0) + 1) << 32 | u64::from(low)
    }

    /// The cone in a word, if it is this block's.
    #[inline(always)]
    fn cone_in(self, word: u64) -> Option<ChordCone> {
        let is_known = word >> 32 == u64::from(self.0) + 1 && word as u32 != LEFT_ONCE;
        is_known.then(|| ChordCone::from_bits(word as u32))
    }
}

/// Looks for the cone of a block that is left a second time. One that is left for the first time takes the entry of another one in an eighth
/// of cases only: where there are more blocks than entries, cones would be found all the time, and forgotten.
#[cold]
#[inline(never)]
fn find(
    number: Number,
    entry: &AtomicU64,
    ray: &LatticeRay,
    left: &mut Left<'_, '_, '_, '_>,
    child: Option<u32>,
) -> ChordCone {
    let (known, left_once) = (entry.load(Ordering::Relaxed), number.word(LEFT_ONCE));
    if known != left_once {
        if known == 0 || ray.is_one_in_eight() {
            entry.store(left_once, Ordering::Relaxed);
        }
        return ChordCone::NONE;
    }
    let cone = left.cone(child);
    entry.store(number.word(cone.to_bits()), Ordering::Relaxed);
    cone
}

/// The patch that is left.
struct Left<'a, 'v, 'p, 'w> {
    of: PatchContext<'a>,
    builder: &'a mut Builder<'w>,
    visit: &'v Visit<'p>,
    /// Of its first block.
    root: Slot<'v>,
}

impl<'v> Left<'_, 'v, '_, '_> {
    /// All of the patch's cells.
    #[inline(always)]
    fn cells(&mut self) -> CellRect {
        match self.visit.peek(self.root) {
            Some(block) => cells_of(block),
            None => self.builder.cells_of(self.of),
        }
    }

    /// The cone of the patch or of a child of its first block; none if there are nodes below that.
    fn cone(&mut self, child: Option<u32>) -> ChordCone {
        let (mut block, mut cells) = (self.visit.peek(self.root), self.cells());
        if let Some(child) = child {
            block = block.and_then(|block| self.visit.peek(block.child(child as usize)));
            cells = child_cells(cells, child_side(cells), child % NODE_SIDE, child / NODE_SIDE);
        }
        let mut room = std::mem::take(&mut self.builder.pieces);
        let cone = self.cone_over(block, cells, room.places());
        self.builder.pieces = room;
        cone
    }

    fn cone_over<'r>(
        &mut self,
        block: Option<Block<'r>>,
        cells: CellRect,
        mut places: impl Iterator<Item = &'r mut [u8]>,
    ) -> ChordCone
    where
        'v: 'r,
    {
        let Self { of, builder, visit, .. } = self;
        let mut piece = |block: Option<Block<'r>>, cells: CellRect| match block {
            Some(block) => PieceView::new(block.bytes()),
            None => builder.make_piece(*of, cells, places.next().expect("a place for each child of a node")),
        };
        if is_piece(cells) {
            return ChordCone::of_pieces(std::iter::once(piece(block, cells)));
        }
        let side = child_side(cells);
        if side as usize > MAX_CELLS || of.mesh.surface().edited().has_holes() {
            return ChordCone::NONE;
        }
        let [n_u, n_v] = cells.size().map(|n| (n as u32).div_ceil(side));
        let mut pieces = [None; MOST_CHILDREN];
        for (b, a) in (0..n_v).flat_map(|b| (0..n_u).map(move |a| (b, a))) {
            let lane = (NODE_SIDE * b + a) as usize;
            let child = block.and_then(|block| visit.peek(block.child(lane)));
            pieces[lane] = Some(piece(child, child_cells(cells, side, a, b)));
        }
        ChordCone::of_pieces(pieces.into_iter().flatten())
    }
}

/// The cells that a block is over.
#[inline(always)]
fn cells_of(block: Block<'_>) -> CellRect {
    if is_node(block.bytes()) { NodeView::new(block.bytes()).cells() } else { PieceView::new(block.bytes()).cells() }
}
