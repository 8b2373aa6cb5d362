//! Rays that leave a patch so steeply that they do not meet it again: most secondary rays, whose own patch would
//! otherwise be what they are tested against most, since they start in the midst of its boxes.
//!
//! How steep the surface of a block is, its [`ChordCone`], is found from its pieces when enough rays have left it. Those that are
//! not in the cache are diced for it and forgotten, so that what is tested does not depend on what the cache holds: a trace of look-ups can be replayed for
//! any size. The cone is remembered as long as no other block takes its place. It decides only what is tested, never what is hit.

use super::builder::{Builder, NODE_SIDE, PatchContext, child_cells, child_side, is_piece};
use super::world::WorldMesh;
use crate::cache::{Block, Slot, Visit};
use crate::grid::{CellRect, ChordCone, LatticeRay, MAX_CELLS, NodeView, PieceView};
use crate::ids::MeshId;
use crate::math::Ray;
use std::sync::atomic::{AtomicU64, Ordering};

/// Blocks that are remembered at most: 128 KiB. With half of them, where more blocks are left than that (trex at 32), cones were found again and again:
/// shuffled diffuse rays at 0.78 of the speed without any.
const MOST_ENTRIES: usize = 1 << 14;

/// Entries for each leaf slot, while there are not too many: for the patch and for some of its parts.
const ENTRIES_PER_SLOT: usize = 4;

/// Children of a node.
const MOST_CHILDREN: usize = (NODE_SIDE * NODE_SIDE) as usize;

/// These bits are set in what is in place of a cone that is not known yet: the number of rays that still have to leave the block. In no cone they are.
const COUNT: u32 = 0xff << 24;

/// Rays that leave a block, for each of its pieces, before its cone is found. Renders by pixel groups send few: with the second ray of a block
/// they took 2.9 to 6.4 % more instructions than without cones. With 32, rays at a rate of 32, 16 pieces a patch, gained less.
const RAYS_PER_PIECE: u32 = 16;

/// The cones of blocks that rays have left, for all threads.
///
/// An entry is one word: the number of the block among those of all meshes and one more, on top; the cone below.
/// So whoever reads it knows whose cone it is, and there is nothing to wait for. Until the cone is known, rays that leave the block count down in its place.
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
        match self.cone(ray, patch, left, None) {
            Some(cone) if cone.is_left_by(ray) => None,
            Some(_) => Some(self.left_child(ray, patch, left)),
            None => Some(0),
        }
    }

    /// The child of the patch's first block that the ray leaves for good, as a bit.
    #[inline(always)]
    fn left_child(&self, ray: &LatticeRay, patch: Number, left: &mut Left<'_, '_, '_, '_>) -> u32 {
        let cells = left.cells();
        if is_piece(cells) {
            return 0;
        }
        let child = child_of_start(cells, ray);
        let is_left = self.cone(ray, patch.child(child), left, Some(child)).is_some_and(|cone| cone.is_left_by(ray));
        u32::from(is_left) << child
    }

    /// The cone of a patch, or of a child of its first block, if it is known by now.
    #[inline(always)]
    fn cone(
        &self,
        ray: &LatticeRay,
        number: Number,
        left: &mut Left<'_, '_, '_, '_>,
        child: Option<u32>,
    ) -> Option<ChordCone> {
        let entry = self.entries.get(number.0 as usize & self.entries.len().wrapping_sub(1))?;
        // `Relaxed`: the word is all there is to know.
        let word = entry.load(Ordering::Relaxed);
        if !number.is_of(word) {
            begin(number, entry, ray, left, child);
            return None;
        }
        match word as u32 & !COUNT {
            _ if word as u32 & COUNT != COUNT => Some(ChordCone::from_bits(word as u32)),
            0 => Some(find(number, entry, left, child)),
            _ => {
                entry.store(word - 1, Ordering::Relaxed);
                None
            }
        }
    }
}

fn entries_for(n_slots: usize) -> usize {
    n_slots.saturating_mul(ENTRIES_PER_SLOT).min(MOST_ENTRIES).next_power_of_two()
}

/// The child of a patch's first node, which is over these cells, in which the ray's triangle lies.
#[inline(always)]
fn child_of_start(cells: CellRect, ray: &LatticeRay) -> u32 {
    // Whoever names a triangle that is not there leaves somewhere else, but does not stop the program.
    let [i, j] = ray.start_cell();
    let (i, j) = (i.min(u32::from(cells.i1) - 1), j.min(u32::from(cells.j1) - 1));
    let shift = child_side(cells).trailing_zeros();
    (j >> shift) * NODE_SIDE + (i >> shift)
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

    /// Whether a word is this block's.
    #[inline(always)]
    fn is_of(self, word: u64) -> bool {
        word >> 32 == u64::from(self.0) + 1
    }
}

/// Begins to count the rays that leave a block. It takes the entry of
/// another one in an eighth of cases only: where there are more blocks than entries, none would keep its own.
#[cold]
#[inline(never)]
fn begin(number: Number, entry: &AtomicU64, ray: &LatticeRay, left: &mut Left<'_, '_, '_, '_>, child: Option<u32>) {
    if entry.load(Ordering::Relaxed) != 0 && !ray.is_one_in_eight() {
        return;
    }
    let n_pieces = left.n_pieces(child);
    let has_too_many = n_pieces > MOST_CHILDREN as u32;
    let low = if has_too_many { ChordCone::NONE.to_bits() } else { COUNT | (RAYS_PER_PIECE * n_pieces) };
    entry.store(number.word(low), Ordering::Relaxed);
}

/// Finds the cone of a block that enough rays have left.
#[cold]
#[inline(never)]
fn find(number: Number, entry: &AtomicU64, left: &mut Left<'_, '_, '_, '_>, child: Option<u32>) -> ChordCone {
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
            // In the head, which nodes and pieces have in common.
            Some(block) => NodeView::new(block.bytes()).cells(),
            None => self.builder.cells_of(self.of),
        }
    }

    /// The cells of the patch or of a child of its first block.
    fn cells_over(&mut self, child: Option<u32>) -> CellRect {
        let cells = self.cells();
        child.map_or(cells, |child| child_cells(cells, child_side(cells), child % NODE_SIDE, child / NODE_SIDE))
    }

    /// Pieces over them.
    fn n_pieces(&mut self, child: Option<u32>) -> u32 {
        self.cells_over(child).size().map(|n| n.div_ceil(MAX_CELLS) as u32).iter().product()
    }

    /// The cone over them; none if there are nodes below a node.
    fn cone(&mut self, child: Option<u32>) -> ChordCone {
        let cells = self.cells_over(child);
        let mut block = self.visit.peek(self.root);
        if let Some(child) = child {
            block = block.and_then(|block| self.visit.peek(block.child(child as usize)));
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
