//! How steep the edges of a piece are.

#![allow(unsafe_code)]

use super::{NO_EDGE, Slopes};
use crate::grid::{CellRect, MAX_CELLS, PieceView};
use crate::math::simd::Kernel;
use glam::Vec3;

/// Vertices in a row of the widest piece.
const MOST_COLUMNS: usize = MAX_CELLS + 1;

/// The least way, in steps times the greatest component of a packed vector: heights over it, of 2^40 at most, are less than [`HIDDEN`].
const TINY: f32 = 1e-12;

/// This is taken from the slopes of edges that do not count.
pub(super) const HIDDEN: f32 = 1e30;

/// What edges along one of u and v are measured by, and how far off scalar products with it can be, for each unit of an edge's size.
///
/// A scalar product errs by 2^-22 of the sum of the edge's components, times the greatest of the vector's, at most: heights are taken so much
/// larger, ways along so much shorter.
#[derive(Clone, Copy)]
pub(super) struct Measure {
    pub along: Vec3,
    pub across: Vec3,
    pub up: Vec3,
    pub errors: [f32; 2],
}

/// How steep edges along one of u and v are at most.
#[derive(Clone, Copy)]
pub(super) struct Steepest<F> {
    /// Height won on the way to where u or v grows, for each unit of the way.
    pub rise: F,
    /// The same to where it shrinks.
    pub fall: F,
    /// Way along the other one.
    pub astray: F,
}

impl<F: Copy> Steepest<F> {
    #[inline(always)]
    pub fn none<K: Kernel<F = F>>(k: K) -> Self {
        Self { rise: k.splat(NO_EDGE), fall: k.splat(NO_EDGE), astray: k.splat(0.0) }
    }

    /// One lane after the other.
    #[inline(always)]
    pub fn lanes<K: Kernel<F = F>>(self, k: K) -> [Steepest<f32>; 8] {
        let [rise, fall, astray] = [k.store(self.rise), k.store(self.fall), k.store(self.astray)];
        std::array::from_fn(|lane| Steepest { rise: rise[lane], fall: fall[lane], astray: astray[lane] })
    }
}

impl Steepest<f32> {
    pub const NONE: Self = Self { rise: NO_EDGE, fall: NO_EDGE, astray: 0.0 };

    #[inline(always)]
    pub fn take_in(&mut self, other: Self) {
        self.rise = self.rise.max(other.rise);
        self.fall = self.fall.max(other.fall);
        self.astray = self.astray.max(other.astray);
    }

    /// Slopes of planes, to where u or v grows and to where it shrinks, if those across are at most `most`.
    pub fn with(self, most: f32) -> [f32; 2] {
        [self.rise + most * self.astray, self.fall + most * self.astray]
    }
}

impl Measure {
    /// The steepest of what was seen and of eight edges, but for those that are [`HIDDEN`]. An edge without length has slopes of zero.
    #[inline(always)]
    pub fn steeper<K: Kernel>(self, k: K, edges: [K::F; 3], hide: K::F, seen: Steepest<K::F>) -> Steepest<K::F> {
        let [x, y, z] = edges;
        let size = k.add(k.add(k.abs(x), k.abs(y)), k.abs(z));
        let [error, error_up] = [k.mul(size, k.splat(self.errors[0])), k.mul(size, k.splat(self.errors[1]))];
        let height = dot(k, edges, self.up);
        let way = k.max(k.sub(dot(k, edges, self.along), error), k.splat(TINY));
        let astray = k.add(k.abs(dot(k, edges, self.across)), error);
        let per_way = k.div(k.splat(1.0), way);
        let (slope, error) = (k.mul(height, per_way), k.sub(k.mul(error_up, per_way), hide));
        Steepest {
            rise: k.max(k.add(error, slope), seen.rise),
            fall: k.max(k.sub(error, slope), seen.fall),
            astray: k.max(k.sub(k.mul(astray, per_way), hide), seen.astray),
        }
    }
}

/// Takes in all edges of a piece but those of cells at moved sides.
#[inline(always)]
pub(super) fn measure<K: Kernel>(
    k: K,
    [by_u, by_v]: [Measure; 2],
    piece: &PieceView<'_>,
    [low, right, high, left]: [bool; 4],
    slopes: &mut Slopes,
) {
    let (CellRect { i0, j0, .. }, [n_u, n_v]) = (piece.cells(), piece.cells().size());
    // Columns of vertices: those at moved sides, and lanes beyond the last.
    let first = usize::from(left);
    let hide = |end: usize| -> [f32; 8] {
        std::array::from_fn(|lane| if (first..end).contains(&lane) { 0.0 } else { HIDDEN })
    };
    let columns = n_u - usize::from(right);
    let (hide_u, hide_low) = (k.load(&hide(columns)), k.load(&hide(columns + 1)));
    // The ninth column, in the last lane of those that begin at the second.
    let has_ninth = columns == MAX_CELLS;
    let hide_high = k.load(&[HIDDEN, HIDDEN, HIDDEN, HIDDEN, HIDDEN, HIDDEN, HIDDEN, 0.0]);
    let (begin, end) = (usize::from(low), n_v - usize::from(high));
    let mut of_u = Steepest::none(k);
    let mut row = Row::of(k, piece, begin.min(n_v));
    for j in begin..=end {
        of_u = by_u.steeper(k, edges(k, row.low, row.high), hide_u, of_u);
        if j == end {
            break;
        }
        let next = Row::of(k, piece, j + 1);
        let mut of_v = by_v.steeper(k, edges(k, row.low, next.low), hide_low, Steepest::none(k));
        if has_ninth {
            of_v = by_v.steeper(k, edges(k, row.high, next.high), hide_high, of_v);
        }
        let mut of_row = Steepest::NONE;
        of_v.lanes(k).into_iter().for_each(|lane| of_row.take_in(lane));
        slopes.add(1, usize::from(j0) + j, of_row);
        row = next;
    }
    of_u.lanes(k)[..n_u].iter().enumerate().for_each(|(lane, seen)| slopes.add(0, usize::from(i0) + lane, *seen));
}

#[inline(always)]
fn dot<K: Kernel>(k: K, [x, y, z]: [K::F; 3], v: Vec3) -> K::F {
    k.add(k.add(k.mul(x, k.splat(v.x)), k.mul(y, k.splat(v.y))), k.mul(z, k.splat(v.z)))
}

/// Eight edges, from vertices to vertices.
#[inline(always)]
fn edges<K: Kernel>(k: K, from: [K::F; 3], to: [K::F; 3]) -> [K::F; 3] {
    [k.sub(to[0], from[0]), k.sub(to[1], from[1]), k.sub(to[2], from[2])]
}

/// Nine vertices of a row, from the piece's corner: x, y and z. Where it has fewer, it is filled up with the last one.
struct Row<K: Kernel> {
    /// Of all but the last.
    low: [K::F; 3],
    /// Of all but the first.
    high: [K::F; 3],
}

impl<K: Kernel> Row<K> {
    /// Row `j` of a piece whose coordinates have two or three bytes.
    #[inline(always)]
    fn of(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        match (piece.head.format, piece.columns()) {
            (2, MOST_COLUMNS) => Self::load::<2>(k, piece, j),
            (3, MOST_COLUMNS) => Self::load::<3>(k, piece, j),
            (2, _) => Self::of_few::<2>(k, piece, j),
            _ => Self::of_few::<3>(k, piece, j),
        }
    }

    #[inline(always)]
    fn load<const BYTES: usize>(k: K, piece: &PieceView<'_>, j: usize) -> Self {
        debug_assert!(piece.columns() == MOST_COLUMNS && j < piece.rows());
        let at = |axis: usize, first: usize| [0, 4].map(|more| piece.row_start(j, axis) + BYTES * (first + more));
        // No closure for the loads: it would be compiled without the kernel's instructions.
        let ([x, y, z], [next_x, next_y, next_z]) = ([at(0, 0), at(1, 0), at(2, 0)], [at(0, 1), at(1, 1), at(2, 1)]);
        // SAFETY: `PieceView::new` checked that the bytes hold every vertex and the tail after them. The row has nine vertices, so that each place, vertex 0, 1, 4 or 5,
        // is at least four coordinates before the row's end. The load reads four coordinates, and for BYTES = 3 four bytes more, fewer than the tail has.
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
