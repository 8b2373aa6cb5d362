//! Rows of a piece's vertices in registers.

#![allow(unsafe_code)]

use super::{MAX_CELLS, PieceView};
use crate::math::simd::Kernel;

/// Vertices in a row of the widest piece.
const MOST_COLUMNS: usize = MAX_CELLS + 1;

/// Nine vertices of a row, from the piece's corner: x, y and z. Where it has fewer, it is filled up with the last one.
pub(super) struct VertexRow<K: Kernel> {
    /// Of all but the last.
    pub low: [K::F; 3],
    /// Of all but the first.
    pub high: [K::F; 3],
}

impl<K: Kernel> VertexRow<K> {
    /// Row `j` of a piece whose coordinates have two or three bytes.
    #[inline(always)]
    pub fn of(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        match (piece.head.format, piece.columns()) {
            (2, MOST_COLUMNS) => Self::load::<2>(k, piece, j),
            (3, MOST_COLUMNS) => Self::load::<3>(k, piece, j),
            (2, _) => Self::of_few::<2>(k, piece, j),
            _ => Self::of_few::<3>(k, piece, j),
        }
    }

    #[inline(always)]
    fn load<const BYTES: usize>(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        assert!(piece.columns() == MOST_COLUMNS && j < piece.rows(), "a row of nine");
        let at = |axis: usize, first: usize| [0, 4].map(|more| piece.row_start(j, axis) + BYTES * (first + more));
        // No closure for the loads: it would be compiled without the kernel's instructions.
        let ([x, y, z], [next_x, next_y, next_z]) = ([at(0, 0), at(1, 0), at(2, 0)], [at(0, 1), at(1, 1), at(2, 1)]);
        // SAFETY: `PieceView::new` checked that the bytes hold every vertex and the tail after them. There is such a
        // row, and it has nine vertices, so that each place, vertex 0, 1, 4 or 5, is at least four coordinates before
        // the row's end. The load reads four coordinates, and for BYTES = 3 four bytes more, fewer than the tail has.
        let [low, high] = unsafe {
            [
                [
                    k.integers::<BYTES>(piece.bytes, x, 0),
                    k.integers::<BYTES>(piece.bytes, y, 0),
                    k.integers::<BYTES>(piece.bytes, z, 0),
                ],
                [
                    k.integers::<BYTES>(piece.bytes, next_x, 0),
                    k.integers::<BYTES>(piece.bytes, next_y, 0),
                    k.integers::<BYTES>(piece.bytes, next_z, 0),
                ],
            ]
        };
        Self { low, high }
    }

    /// The same, number by number, of a row with fewer vertices.
    #[inline(always)]
    fn of_few<const BYTES: usize>(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        let [x, y, z] = [0, 1, 2].map(|axis| few::<BYTES>(piece, j, axis));
        Self {
            low: [k.load(eight(&x, 0)), k.load(eight(&y, 0)), k.load(eight(&z, 0))],
            high: [k.load(eight(&x, 1)), k.load(eight(&y, 1)), k.load(eight(&z, 1))],
        }
    }
}

/// One coordinate of a row's vertices, and of the last one where it has fewer than nine.
#[inline(always)]
fn few<const BYTES: usize>(piece: &PieceView<'_>, j: usize, axis: usize) -> [f32; MOST_COLUMNS] {
    let bytes = &piece.bytes[piece.row_start(j, axis)..][..BYTES * piece.columns()];
    let (mut row, mut last) = ([0.0; MOST_COLUMNS], 0.0);
    let mut numbers = bytes.chunks_exact(BYTES);
    for x in &mut row {
        if let Some(number) = numbers.next() {
            let third = if BYTES == 3 { number[2] } else { 0 };
            last = u32::from_le_bytes([number[0], number[1], third, 0]) as f32;
        }
        *x = last;
    }
    row
}

#[inline(always)]
fn eight(row: &[f32; MOST_COLUMNS], from: usize) -> &[f32; 8] {
    row[from..].first_chunk().expect("nine, from 0 or 1 on")
}
