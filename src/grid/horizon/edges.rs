//! How steep the edges of a piece are.

use super::{NO_EDGE, Slopes};
use crate::grid::vertex_row::VertexRow;
use crate::grid::{CellRect, MAX_CELLS, PieceView};
use crate::math::simd::Kernel;
use glam::Vec3;

/// The least way, in steps times the greatest component of a packed vector: heights over it, of 2^40 at most, are less
/// than [`HIDDEN`].
const TINY: f32 = 1e-12;

/// This is taken from the slopes of edges that do not count.
pub(super) const HIDDEN: f32 = 1e30;

/// What edges along one of u and v are measured by, and how far off scalar products with it can be, for each unit of an
/// edge's size.
///
/// A scalar product errs by 2^-22 of the sum of the edge's components, times the greatest of the vector's, at most:
/// heights are taken so much larger, ways along so much shorter.
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
    /// The steepest of what was seen and of eight edges, but for those that are [`HIDDEN`]. An edge without length has
    /// slopes of zero.
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
    let mut row = VertexRow::of(k, piece, begin.min(n_v));
    for j in begin..=end {
        of_u = by_u.steeper(k, edges(k, row.low, row.high), hide_u, of_u);
        if j == end {
            break;
        }
        let next = VertexRow::of(k, piece, j + 1);
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
