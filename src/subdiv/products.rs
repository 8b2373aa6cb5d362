//! Sparse rows times points: how ring points become refined points, control points and limits.

use super::eval::Point;
use super::plan::{Child, Step, TURNED_CONTROL};
use super::pole::PoleStep;
use super::regular::ControlPoints;
use super::rows::{Index, RowStore, RowsView, Span, SparseRows, Width, with_rows};
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

/// The refined points of a ring: `out` has one for each row of the step.
pub(super) fn refined_points(store: &RowStore, step: Step, points: &[Point], out: &mut [Point]) {
    let Some(pole) = step.pole else { return products(store, step.rows, points, out) };
    match store.widths() {
        Width::Narrow(indices) => simd::run(PoleStep { points, ring: store.list(pole, indices), out }),
        Width::Wide(indices) => simd::run(PoleStep { points, ring: store.list(pole, indices), out }),
    }
}

/// The ring points of one child alone: `out` is as long as its ring. `step` is none of a pole.
pub(super) fn child_points(store: &RowStore, step: Step, child: &Child, points: &[Point], out: &mut [Point]) {
    debug_assert!(step.pole.is_none(), "a pole's points are found together");
    with_rows!(store, step.rows, |view, indices| {
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
    let places = &TURNED_CONTROL[turn as usize];
    if rows.is_empty() {
        return turned(places, points.first_chunk().expect("16 control points"));
    }
    let mut control = [Point::ZERO; 16];
    products(store, rows, points, &mut control);
    if turn == 0 { control } else { turned(places, &control) }
}

#[inline(always)]
fn turned(places: &[u8; 16], control: &ControlPoints) -> ControlPoints {
    let mut out = [Point::ZERO; 16];
    for (out, &i) in out.iter_mut().zip(places) {
        *out = control[usize::from(i)];
    }
    out
}

/// As [`control_points`] of a child without rows; `refined` are its parent's, and the points are appended.
pub(super) fn push_listed_control(store: &RowStore, list: Span, turn: u32, refined: &[Point], out: &mut Vec<Point>) {
    let places = &TURNED_CONTROL[turn as usize];
    match store.widths() {
        Width::Narrow(indices) => push_turned(places, store.list(list, indices), refined, out),
        Width::Wide(indices) => push_turned(places, store.list(list, indices), refined, out),
    }
}

#[inline(always)]
fn push_turned<I: Index>(places: &[u8; 16], list: &[I], refined: &[Point], out: &mut Vec<Point>) {
    let list: &[I; 16] = list.first_chunk().expect("16 control points");
    out.extend(places.iter().map(|&i| refined[list[usize::from(i)].idx()]));
}
