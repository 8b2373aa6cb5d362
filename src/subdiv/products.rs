//! Sparse rows times points: how ring points become refined points, control points and limits.

use super::eval::Point;
use super::plan::Child;
use super::regular::ControlPoints;
use super::rows::{Index, RowStore, RowsView, SparseRows, with_rows};
use crate::math::simd::{self, Kernel, Task};

/// A row times points. Two sums, of the even and of the odd terms, keep the adder busy.
#[inline(always)]
fn product<K: Kernel, I: Index>(k: K, rows: &RowsView<'_, I>, i: usize, points: &[Point]) -> Point {
    let (columns, weights) = rows.row(i);
    let (mut even, mut odd) = (k.splat4(0.0), k.splat4(0.0));
    let (column_pairs, weight_pairs) = (columns.chunks_exact(2), weights.chunks_exact(2));
    if let ([c], [w]) = (column_pairs.remainder(), weight_pairs.remainder()) {
        even = k.mul4(k.load4(&points[c.idx()].0), k.splat4(*w));
    }
    for (c, w) in column_pairs.zip(weight_pairs) {
        even = k.add4(even, k.mul4(k.load4(&points[c[0].idx()].0), k.splat4(w[0])));
        odd = k.add4(odd, k.mul4(k.load4(&points[c[1].idx()].0), k.splat4(w[1])));
    }
    Point(k.store4(k.add4(even, odd)))
}

/// Some rows times points: `out[i]` is row `which[i]`'s.
struct Products<'a, I> {
    rows: RowsView<'a, I>,
    points: &'a [Point],
    which: Which<'a, I>,
    out: &'a mut [Point],
}

/// Which rows: the first ones, or a list.
enum Which<'a, I> {
    First,
    Listed(&'a [I]),
}

impl<I: Index> Task for Products<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        match self.which {
            Which::First => {
                for (i, out) in self.out.iter_mut().enumerate() {
                    *out = product(k, &self.rows, i, self.points);
                }
            }
            Which::Listed(which) => {
                for (out, i) in self.out.iter_mut().zip(which) {
                    *out = product(k, &self.rows, i.idx(), self.points);
                }
            }
        }
    }
}

/// The first rows times points.
pub(super) fn products(store: &RowStore, rows: SparseRows, points: &[Point], out: &mut [Point]) {
    with_rows!(store, rows, |view, _indices| {
        simd::run(Products { rows: view, points, which: Which::First, out });
    });
}

/// The ring points of a child: `out` is as long as its ring.
pub(super) fn child_points(store: &RowStore, rows: SparseRows, child: &Child, points: &[Point], out: &mut [Point]) {
    with_rows!(store, rows, |view, indices| {
        let which = Which::Listed(store.list(child.points, indices));
        simd::run(Products { rows: view, points, which, out });
    });
}

/// One row times points.
pub(super) fn one_product(store: &RowStore, rows: SparseRows, i: usize, points: &[Point]) -> Point {
    with_rows!(store, rows, |view, _indices| product(simd::Portable, &view, i, points))
}

/// The control points of a regular node, as a face has them that is turned.
pub(super) fn control_points(store: &RowStore, rows: SparseRows, turn: u32, points: &[Point]) -> ControlPoints {
    let mut control = [Point::ZERO; 16];
    products(store, rows, points, &mut control);
    if turn == 0 {
        return control;
    }
    // The node's u runs from the face's corner `turn` to the next one.
    std::array::from_fn(|place| {
        let (i, j) = (place % 4, place / 4);
        let (a, b) = match turn {
            1 => (j, 3 - i),
            2 => (3 - i, 3 - j),
            _ => (3 - j, i),
        };
        control[4 * b + a]
    })
}
