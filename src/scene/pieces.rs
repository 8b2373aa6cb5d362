//! All pieces of a patch, those that are not in the cache diced and forgotten: for what is found out once and
//! remembered.

use super::builder::{Builder, PatchContext, children_of, is_piece};
use crate::cache::{Block, Visit};
use crate::grid::{CellRect, MAX_CELLS, PieceView, cells_of};

/// Pieces over so many cells.
pub(super) fn n_pieces(cells: CellRect) -> usize {
    cells.size().map(|n| n.div_ceil(MAX_CELLS)).iter().product()
}

/// Hands over all pieces of a patch. `block` is its first one, if that is in the cache.
pub(super) fn with_pieces<T>(
    of: PatchContext<'_>,
    block: Option<Block<'_>>,
    visit: &Visit<'_>,
    builder: &mut Builder<'_>,
    take: impl FnOnce(&[PieceView<'_>]) -> T,
) -> T {
    let cells = match block {
        Some(block) => cells_of(block.bytes()),
        None => builder.cells_of(of),
    };
    let n = n_pieces(cells);
    let mut room = std::mem::take(&mut builder.pieces);
    let mut pieces = Pieces { of, visit, found: Vec::with_capacity(n) };
    pieces.collect(block, cells, builder, &mut room.places(n));
    let taken = take(&pieces.found);
    builder.pieces = room;
    taken
}

struct Pieces<'r, 'a, 'p> {
    of: PatchContext<'a>,
    visit: &'r Visit<'p>,
    found: Vec<PieceView<'r>>,
}

impl<'r> Pieces<'r, '_, '_> {
    /// Collects the pieces over these cells; `block` is what is in the cache over them. Those that are not there are
    /// made in the places.
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
        for (lane, cells) in children_of(cells) {
            let child = block.and_then(|block| self.visit.peek(block.child(lane)));
            self.collect(child, cells, builder, places);
        }
    }
}
