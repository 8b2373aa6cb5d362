//! Rays that leave a patch so high that they do not meet it again: most secondary rays, whose own patch would
//! otherwise be what they are tested against most, since they start in the midst of its boxes.
//!
//! How high a patch rises above each part of itself, its [`Horizon`], is found from its pieces when enough rays have left it. Those that are
//! not in the cache are diced for it and forgotten, so that what is tested does not depend on what the cache holds: a trace of look-ups can be replayed for
//! any size. The horizon is remembered as long as no other patch takes its place. It decides only what is tested, never what is hit.

use super::builder::{Builder, NODE_SIDE, PatchContext, child_cells, child_side, is_piece};
use super::world::WorldMesh;
use crate::cache::{Block, MemoTable, Slot, Visit};
use crate::grid::{CellRect, Horizon, LatticeRay, MAX_CELLS, NodeView, PieceView};
use crate::ids::{MeshId, PatchId};
use crate::math::Ray;
use crate::math::simd::{self, Kernel};

/// Patches that are remembered at most: 512 KiB. With half of them, secondary rays on trex (11,070 faces) were 2 to 6 % slower.
const MOST_PATCHES: usize = 1 << 14;

/// Pieces of a patch whose horizon is found at most. With 64 instead, ambient occlusion of bigguy and monsterfrog at 1920x1080 and one cell a pixel
/// took 1.14 and 1.09 times as long.
const MOST_PIECES: usize = 256;

/// Rays that leave a patch, for each of its pieces, before its horizon is found. Renders by pixel groups send few: trex at 960x540 took 0.2 % more
/// instructions with 16 than with 8, and as many at 1920x1080 with 4 as with 8.
const RAYS_PER_PIECE: u32 = 8;

/// The horizons of patches that rays have left, for all threads.
pub(super) struct Departures {
    /// By the numbers of patches among those of all meshes. No entries if there are too many for numbers of 32 bits.
    horizons: MemoTable,
    /// How many patches there are before those of each mesh.
    first: Box<[u32]>,
}

/// What is known of the patch that a ray leaves.
#[derive(Clone, Copy)]
pub(super) struct Leaving<'c> {
    /// The patch that it starts on, unless it is known that it has to be tested against it.
    patch: PatchId,
    /// Who is to be asked whether it has left that patch; `None` if it has.
    unknown: Option<&'c Departures>,
}

impl<'c> Leaving<'c> {
    /// A ray that may meet whatever is there.
    pub const NOTHING: Self = Self { patch: PatchId(u32::MAX), unknown: None };

    /// Of a ray at the mesh. `in_lattice` is the same ray there.
    #[inline(always)]
    pub fn of<K: Kernel>(
        k: K,
        ray: &Ray,
        (id, mesh): (MeshId, &WorldMesh),
        in_lattice: &LatticeRay,
        departures: &'c Departures,
    ) -> Self {
        let Some(from) = ray.from else { return Self::NOTHING };
        if !ray.is_above || from.mesh != id || !mesh.keeps_angles() {
            return Self::NOTHING;
        }
        match departures.horizons.get(departures.number(id, from.patch)) {
            None => Self { patch: from.patch, unknown: Some(departures) },
            Some(words) if Horizon::from_words(words).is_cleared_by(k, in_lattice) => {
                Self { patch: from.patch, unknown: None }
            }
            Some(_) => Self::NOTHING,
        }
    }

    /// Whether the ray need not be tested against this patch. `root` is the slot of its first block.
    #[inline(always)]
    pub fn has_left(
        self,
        ray: &LatticeRay,
        of: PatchContext<'_>,
        builder: &mut Builder<'_>,
        visit: &Visit<'_>,
        root: Slot<'_>,
    ) -> bool {
        of.patch == self.patch
            && self.unknown.is_none_or(|departures| departures.ask(ray, &mut Left { of, builder, visit, root }))
    }
}

impl Departures {
    /// For meshes with so many patches each.
    pub fn new(n_patches: impl Iterator<Item = usize> + Clone) -> Self {
        let first = n_patches.clone().scan(0u32, |next, n| Some(std::mem::replace(next, next.wrapping_add(n as u32))));
        Self { first: first.collect(), horizons: MemoTable::new(entries_for(n_patches.sum())) }
    }

    /// Bytes of the table for meshes with so many patches in all: 512 KiB at most.
    pub fn bytes_for(n_patches: usize) -> usize {
        MemoTable::bytes_for(entries_for(n_patches))
    }

    /// A patch's number among those of all meshes.
    #[inline(always)]
    fn number(&self, mesh: MeshId, patch: PatchId) -> u32 {
        self.first[mesh.idx()].wrapping_add(patch.0)
    }

    /// Whether a ray has left the patch it starts on, once enough rays have that its horizon is found.
    ///
    /// It takes the entry of another patch in an eighth of cases only: where there are more of them than entries, none would keep its own.
    #[cold]
    #[inline(never)]
    fn ask(&self, ray: &LatticeRay, left: &mut Left<'_, '_, '_, '_>) -> bool {
        let number = self.number(left.of.id, left.of.patch);
        if !self.horizons.is_due(number, ray.is_one_in_eight(), || RAYS_PER_PIECE * left.n_pieces() as u32) {
            return false;
        }
        let horizon = left.horizon(ray);
        self.horizons.put(number, horizon.to_words());
        horizon.is_cleared_by(simd::Portable, ray)
    }
}

fn entries_for(n_patches: usize) -> usize {
    if n_patches < u32::MAX as usize - 1 { n_patches.min(MOST_PATCHES) } else { 0 }
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

    /// Pieces of the patch.
    fn n_pieces(&mut self) -> usize {
        self.cells().size().map(|n| n.div_ceil(MAX_CELLS)).iter().product()
    }

    /// The patch's horizon on the side to which the ray leaves it; none if it has too many pieces.
    fn horizon(&mut self, ray: &LatticeRay) -> Horizon {
        let n_pieces = self.n_pieces();
        if n_pieces > MOST_PIECES || self.of.mesh.surface().edited().has_holes() {
            return Horizon::NONE;
        }
        let (cells, borders) = (self.cells(), self.builder.borders_of(self.of));
        let mut room = std::mem::take(&mut self.builder.pieces);
        let mut pieces = Pieces { of: self.of, visit: self.visit, found: Vec::with_capacity(n_pieces) };
        pieces.collect(self.visit.peek(self.root), cells, self.builder, &mut room.places(n_pieces));
        let horizon = Horizon::of_pieces(pieces.found.into_iter(), &borders, ray);
        self.builder.pieces = room;
        horizon
    }
}

/// All pieces of a patch, from the cache or not.
struct Pieces<'r, 'a, 'p> {
    of: PatchContext<'a>,
    visit: &'r Visit<'p>,
    found: Vec<PieceView<'r>>,
}

impl<'r> Pieces<'r, '_, '_> {
    /// Collects the pieces over these cells; `block` is what is in the cache over them. Those that are not there are made in the places.
    fn collect(
        &mut self,
        block: Option<Block<'r>>,
        cells: CellRect,
        builder: &mut Builder<'_>,
        places: &mut impl Iterator<Item = &'r mut [u8]>,
    ) {
        if is_piece(cells) {
            let piece = match block {
                Some(block) => PieceView::new(block.bytes()),
                None => builder.make_piece(self.of, cells, places.next().expect("a place for each piece")),
            };
            self.found.push(piece);
            return;
        }
        let side = child_side(cells);
        let [n_u, n_v] = cells.size().map(|n| (n as u32).div_ceil(side));
        for (b, a) in (0..n_v).flat_map(|b| (0..n_u).map(move |a| (b, a))) {
            let child = block.and_then(|block| self.visit.peek(block.child((NODE_SIDE * b + a) as usize)));
            self.collect(child, child_cells(cells, side, a, b), builder, places);
        }
    }
}
