//! Building a missing block: a patch's rates, then the vertices of a piece or the boxes of a node's children.

use super::costs::BuildCosts;
use super::departure::DepartureCounts;
use super::world::{GridCache, WorldMesh};
use crate::cache::{Block, BlockLayout, Claim, Recorder, Slot, SlotId, Visit};
use crate::grid::{
    Borders, CellRect, MAX_CELLS, MOST_PIECE_BYTES, PieceLayout, PieceView, cells_of, encode_node, is_node, node_bytes,
};
use crate::ids::{MeshId, PatchId};
use crate::math::{Envelope, LatticeGrid};
use crate::subdiv::{AskedCells, Dicer, EqualParts, PatchRates, snapped};

/// Children of a node along u and v.
pub(super) const NODE_SIDE: u32 = 4;

/// Quarters towards an irregular corner that a node's child boxes look into, below the child's own size.
const CHILD_BOX_DEPTH: u32 = 3;

/// Patches whose rates a builder remembers.
const N_RATES: usize = 16;

/// Room for the pieces of a patch.
#[derive(Default)]
pub(super) struct PieceRoom(Vec<u64>);

impl PieceRoom {
    /// Places for so many pieces at least.
    pub fn places(&mut self, n: usize) -> impl Iterator<Item = &mut [u8]> {
        let words = n * MOST_PIECE_BYTES / size_of::<u64>();
        if self.0.len() < words {
            self.0.resize(words, 0);
        }
        bytemuck::cast_slice_mut(&mut self.0).chunks_exact_mut(MOST_PIECE_BYTES)
    }
}

/// What building a block needs.
#[derive(Default)]
pub(super) struct Builder<'w> {
    dicer: Dicer,
    vertices: LatticeGrid,
    /// Room for pieces that are looked at once.
    pub pieces: PieceRoom,
    envelopes: Vec<Envelope>,
    pub n_built: u64,
    pub n_pieces: u64,
    pub n_triangles: u64,
    pub costs: BuildCosts,
    pub departures: DepartureCounts,
    /// Rates of the last patches, one for each remainder of patch numbers.
    rates: [Option<(MeshId, PatchId, PatchRates)>; N_RATES],
    /// Notes every block that is asked for, if the cache wants to know.
    recorder: Option<Recorder<'w>>,
}

/// A patch about to be traversed.
#[derive(Clone, Copy)]
pub(super) struct PatchContext<'a> {
    pub id: MeshId,
    pub mesh: &'a WorldMesh,
    pub patch: PatchId,
}

/// The side of a node's children in cells: 8, or as many times 4 that as leave at most 4 children a side.
pub(super) fn child_side(cells: CellRect) -> u32 {
    let longest = cells.size().into_iter().max().expect("two sides") as u32;
    let mut side = MAX_CELLS as u32;
    while longest > NODE_SIDE * side {
        side *= NODE_SIDE;
    }
    side
}

/// Whether so many cells are one piece; else there is a node over them.
pub(super) fn is_piece(cells: CellRect) -> bool {
    cells.size().iter().all(|&n| n <= MAX_CELLS)
}

fn all_cells(rates: &PatchRates) -> CellRect {
    CellRect { i0: 0, j0: 0, i1: rates.n_u as u16, j1: rates.n_v as u16 }
}

/// Cells of child (a, b) of a node.
pub(super) fn child_cells(parent: CellRect, side: u32, a: u32, b: u32) -> CellRect {
    let (i0, j0) = (u32::from(parent.i0) + a * side, u32::from(parent.j0) + b * side);
    CellRect {
        i0: i0 as u16,
        j0: j0 as u16,
        i1: (i0 + side).min(u32::from(parent.i1)) as u16,
        j1: (j0 + side).min(u32::from(parent.j1)) as u16,
    }
}

/// The children of a node over these cells, row by row: their lanes and cells.
pub(super) fn children_of(cells: CellRect) -> impl Iterator<Item = (usize, CellRect)> {
    let side = child_side(cells);
    let [n_u, n_v] = cells.size().map(|n| (n as u32).div_ceil(side));
    let all = (0..n_v).flat_map(move |b| (0..n_u).map(move |a| (a, b)));
    all.map(move |(a, b)| ((NODE_SIDE * b + a) as usize, child_cells(cells, side, a, b)))
}

/// The ends of cells along u and along v.
fn ranges(cells: CellRect) -> [[u32; 2]; 2] {
    let CellRect { i0, j0, i1, j1 } = cells;
    [[i0, i1], [j0, j1]].map(|range| range.map(u32::from))
}

impl<'w> Builder<'w> {
    /// A builder that notes accesses with `recorder`, if there is one.
    pub fn noting(recorder: Option<Recorder<'w>>) -> Self {
        Self { recorder, ..Self::default() }
    }

    /// Builds the block over these cells, or over the whole patch.
    #[cold]
    #[inline(never)]
    pub fn build<'v>(
        &mut self,
        visit: &'v Visit<'_>,
        slot: Slot<'v>,
        of: PatchContext<'_>,
        cells: Option<CellRect>,
    ) -> Block<'v> {
        let ticket = match visit.claim(slot) {
            Claim::Ready(block) => return block,
            Claim::Build(ticket) => ticket,
        };
        self.n_built += 1;
        self.costs.add(of.id, of.patch, 1);
        let rates = self.rates(of);
        let cells = cells.unwrap_or_else(|| all_cells(&rates));
        if is_piece(cells) {
            let layout = self.lay_out(of, &rates, cells);
            self.n_pieces += 1;
            self.n_triangles += 2 * cells.size().iter().product::<usize>() as u64;
            let vertices = &self.vertices;
            return ticket
                .publish(BlockLayout { bytes: layout.bytes(), children: 0 }, |out| layout.encode(vertices, out));
        }
        let children = self.child_envelopes(of, &rates, cells);
        let n_slots = (NODE_SIDE * u32::from(children[1] - 1)) as usize + usize::from(children[0]);
        let envelopes = &self.envelopes;
        ticket.publish(BlockLayout { bytes: node_bytes(children), children: n_slots }, |out| {
            encode_node(cells, children, envelopes, out);
        })
    }

    /// Puts the vertices of a piece into `self.vertices`.
    fn lay_out(&mut self, of: PatchContext<'_>, rates: &PatchRates, cells: CellRect) -> PieceLayout {
        let [i, j] = ranges(cells);
        self.dicer.dice(of.mesh.surface(), of.patch, rates, i, j, &mut self.vertices);
        PieceLayout::new(&self.vertices, cells, [rates.n_u as u16, rates.n_v as u16])
    }

    /// Makes a piece without the cache, in `room`: as long as the largest piece, and aligned to 4 bytes.
    pub fn make_piece<'r>(&mut self, of: PatchContext<'_>, cells: CellRect, room: &'r mut [u8]) -> PieceView<'r> {
        let rates = self.rates(of);
        let layout = self.lay_out(of, &rates, cells);
        let room = &mut room[..layout.bytes()];
        layout.encode(&self.vertices, room);
        PieceView::new(room)
    }

    /// The cells of a patch.
    pub fn cells_of(&mut self, of: PatchContext<'_>) -> CellRect {
        all_cells(&self.rates(of))
    }

    /// Where the vertices of a patch lie.
    pub fn borders_of(&mut self, of: PatchContext<'_>) -> Borders {
        let rates = self.rates(of);
        let moved = [0, 1, 2, 3].map(|side| {
            let (n, rate) = ([rates.n_u, rates.n_v][side % 2], rates.sides[side]);
            let place = |i: u32| f64::from(snapped(i, n, rate) * n) / f64::from(rate);
            if rate == n { Vec::new() } else { (0..=n).map(place).collect() }
        });
        Borders { cells: all_cells(&rates), moved }
    }

    /// How finely a patch is diced: the same for its node and all its pieces.
    fn rates(&mut self, of: PatchContext<'_>) -> PatchRates {
        let remembered = &mut self.rates[of.patch.idx() % N_RATES];
        match remembered {
            Some((mesh, patch, rates)) if (*mesh, *patch) == (of.id, of.patch) => *rates,
            _ => remembered.insert((of.id, of.patch, of.mesh.patch_rates(of.patch))).2,
        }
    }

    /// Puts what holds a node's children into `self.envelopes`; returns their number along u and v.
    fn child_envelopes(&mut self, of: PatchContext<'_>, rates: &PatchRates, cells: CellRect) -> [u8; 2] {
        let side = child_side(cells);
        let [n_u, n_v] = cells.size().map(|n| (n as u32).div_ceil(side));
        // A child's cells are a part of the patch: as many splits lead to a quarter of its size.
        let depth = (rates.n_u.max(rates.n_v) / side).max(1).ilog2() + CHILD_BOX_DEPTH;
        self.envelopes.clear();
        let surface = of.mesh.surface();
        let parts = EqualParts { from: [u32::from(cells.i0), u32::from(cells.j0)], n: [n_u, n_v], side };
        let no_holes = !surface.edited().has_holes();
        let out = &mut self.envelopes;
        if no_holes && self.dicer.envelopes_of_parts(surface, of.patch, rates, parts, depth, out) {
            return [n_u as u8, n_v as u8];
        }
        for (_, child) in children_of(cells) {
            let [i, j] = ranges(child);
            self.envelopes.push(match surface.edited().hide_cells(of.patch, rates, i, j) {
                true => Envelope::EMPTY,
                false => self.dicer.envelope(surface, of.patch, AskedCells { rates, i, j, depth }),
            });
        }
        [n_u as u8, n_v as u8]
    }

    /// Builds the block over these cells, or over the whole patch, and those below it, as far as they are missing.
    pub fn complete<'v>(
        &mut self,
        visit: &'v Visit<'_>,
        slot: Slot<'v>,
        of: PatchContext<'_>,
        cells: Option<CellRect>,
    ) {
        let block = visit.get(slot).unwrap_or_else(|| self.build(visit, slot, of, cells));
        if !is_node(block.bytes()) {
            return;
        }
        let (rates, edited) = (self.rates(of), of.mesh.surface().edited());
        for (lane, child) in children_of(cells_of(block.bytes())) {
            let [i, j] = ranges(child);
            if !edited.hide_cells(of.patch, &rates, i, j) {
                self.complete(visit, block.child(lane), of, Some(child));
            }
        }
    }

    /// Builds the first block of a patch.
    #[cold]
    #[inline(never)]
    pub fn build_root<'v>(
        &mut self,
        visit: &'v Visit<'_>,
        of: PatchContext<'_>,
        cache: &'v GridCache,
        leaf_slot: u32,
    ) -> Block<'v> {
        cache.touch(of.id, leaf_slot);
        self.build(visit, visit.root(cache.table(of.id), SlotId(leaf_slot)), of, None)
    }

    #[inline(always)]
    pub fn note_root(&mut self, of: PatchContext<'_>, leaf_slot: u32, block: Block<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.root(name_of(of.id, leaf_slot), block);
        }
    }

    #[inline(always)]
    pub fn note_child(&mut self, level: usize, lane: usize, block: Block<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.child(level, lane, block);
        }
    }
}
/// One number for a slot of any mesh.
fn name_of(mesh: MeshId, slot: u32) -> u64 {
    u64::from(mesh.0) << 32 | u64::from(slot)
}
