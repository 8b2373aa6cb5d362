//! Limit stencils of poles: the 5 x 5 points of a pole that is cut into 4 x 4 cells, each as one weighted sum of the
//! ring.
//!
//! Walking down to the apex takes two more steps and six regular parts of one to nine points each, which all have to be
//! started. Here the points are a dense product instead: 18 terms a point for an apex of five edges, four points in a
//! register. The weights depend on the number of edges only, and are found by walking down once.
//!
//! Pieces of a patch meet at points that both must find to the same bit. So whether a part is found by stencils is
//! decided by its cells alone and not by the points that are wanted of it.

use super::eval::Point;
use super::pole::{IN_ORDER, N_BEYOND, N_OUTER, PoleStep, regular_quarters};
use super::regular::{self, ControlPoints};
use super::rows::Index;
use crate::math::PointGrid;
use crate::math::point_grid::LANES;
use crate::math::simd::{Kernel, Portable, Task};
use std::sync::OnceLock;

/// Cells along a side of a part that stencils are for.
pub(super) const CELLS: u32 = 4;

/// Points along a side.
const SIDE: usize = CELLS as usize + 1;

/// Fours of points in a row, the second of which has one.
const FOURS: usize = SIDE.div_ceil(LANES);

/// Edges of an apex that has stencils, at most.
const MOST_EDGES: usize = 16;

/// Weights of a pole's points, in a pole's order, for each four of points: row by row, as a face has them.
type Weights = Vec<[f64; LANES]>;

static WEIGHTS: [OnceLock<[Weights; 4]>; MOST_EDGES + 1] = [const { OnceLock::new() }; MOST_EDGES + 1];

/// The weights for a ring of so many points around a face whose corner `apex` is the apex; none if it has too many
/// edges.
pub(super) fn weights(n_ring: usize, apex: usize) -> Option<&'static [[f64; LANES]]> {
    let n = (n_ring - 1 - N_OUTER) / 2;
    Some(&WEIGHTS.get(n)?.get_or_init(|| find(n))[apex])
}

/// The weights for each corner that may be the apex. Four weights of each point at a time go where the coordinates of
/// points go elsewhere.
fn find(n: usize) -> [Weights; 4] {
    let n_ring = 1 + 2 * n + N_OUTER;
    let mut out: [Weights; 4] = std::array::from_fn(|_| vec![[0.0; LANES]; SIDE * FOURS * n_ring]);
    for first in (0..n_ring).step_by(4) {
        let unit = |i: usize| Point(std::array::from_fn(|lane| f64::from(u8::from(first + lane == i))));
        let ring: Vec<Point> = (0..n_ring).map(unit).collect();
        let points: [[Point; SIDE]; SIDE] =
            std::array::from_fn(|x| std::array::from_fn(|y| canonical_point(n, &ring, [x, y])));
        for (apex, out) in out.iter_mut().enumerate() {
            for (j, i) in (0..SIDE).flat_map(|j| (0..FOURS * LANES).map(move |i| (j, i))) {
                let [x, y] = from_apex(apex, [i.min(SIDE - 1), j]);
                for lane in 0..4.min(n_ring - first) {
                    out[(j * FOURS + i / LANES) * n_ring + first + lane][i % LANES] = points[x][y].0[lane];
                }
            }
        }
    }
    out
}

/// Where point (i, j) of a face lies as seen from its corner `apex`.
fn from_apex(apex: usize, [i, j]: [usize; 2]) -> [usize; 2] {
    let last = SIDE - 1;
    [[i, j], [j, last - i], [last - i, last - j], [last - j, i]][apex]
}

/// The limit at (x/4, y/4) from the apex.
fn canonical_point(n: usize, ring: &[Point], [x, y]: [usize; 2]) -> Point {
    if [x, y] == [0, 0] {
        return limit(n, ring);
    }
    let mut refined = vec![Point::ZERO; ring.len() + N_BEYOND];
    PoleStep { points: ring, ring: &IN_ORDER[..ring.len()], out: &mut refined }.run(Portable);
    let middle = SIDE / 2;
    let [right, above, left] = regular_quarters(n);
    let (quarter, s, t) = match (x >= middle, y >= middle) {
        (false, false) => return canonical_point(n, &refined[..ring.len()], [2 * x, 2 * y]),
        (true, false) => (right, x - middle, y),
        (true, true) => (above, x - middle, y - middle),
        (false, true) => (left, x, y - middle),
    };
    let control: ControlPoints = quarter.map(|i| refined[i]);
    let parameter = |i: usize| i as f64 / middle as f64;
    regular::combine(&regular::basis(parameter(s)), regular::columns(&control, &regular::basis(parameter(t))))
}

/// The limit of the apex (Halstead et al. 1993).
fn limit(n: usize, ring: &[Point]) -> Point {
    let sum = |from: usize| ring[from..=2 * n].iter().step_by(2).fold(Point::ZERO, |sum, p| sum + *p);
    let (edges, faces, n) = (sum(1), sum(2), n as f64);
    (ring[0] * (n * n) + edges * 4.0 + faces) * (1.0 / (n * (n + 5.0)))
}

/// The points (i, j) with i and j from the first to the last of a part of 4 x 4 cells: the first goes to `first` of
/// `out`. Up to three numbers behind each row are overwritten.
pub(super) struct StencilGrid<'a, I> {
    pub points: &'a [Point],
    /// See [`PoleStep`].
    pub ring: &'a [I],
    /// See [`weights`].
    pub weights: &'a [[f64; LANES]],
    pub i: [usize; 2],
    pub j: [usize; 2],
    pub out: &'a mut PointGrid,
    pub first: [usize; 2],
}

impl<I: Index> Task for StencilGrid<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let Self { points, ring, weights, i: [i0, i1], j: [j0, j1], out, first } = self;
        for j in j0..=j1 {
            for four in i0 / LANES..=i1 / LANES {
                let weights = &weights[(j * FOURS + four) * ring.len()..][..ring.len()];
                let mut sums = [k.splat4(0.0); 3];
                for (w, i) in weights.iter().zip(ring) {
                    let (w, p) = (k.load4(w), &points[i.idx()].0);
                    sums[0] = k.add4(sums[0], k.mul4(w, k.splat4(p[0])));
                    sums[1] = k.add4(sums[1], k.mul4(w, k.splat4(p[1])));
                    sums[2] = k.add4(sums[2], k.mul4(w, k.splat4(p[2])));
                }
                let row = first[1] + j - j0;
                let start = four * LANES;
                for (axis, sum) in sums.into_iter().enumerate() {
                    let lanes = k.store4(sum);
                    if start >= i0 {
                        out.run_mut(axis, [first[0] + start - i0, row], LANES).copy_from_slice(&lanes);
                    } else {
                        let lanes = &lanes[i0 - start..];
                        out.run_mut(axis, [first[0], row], lanes.len()).copy_from_slice(lanes);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_turn_with_the_face() {
        for n in [3, 5, 6, 9, 16] {
            let n_ring = 1 + 2 * n + N_OUTER;
            let at = |apex: usize, [i, j]: [usize; 2], k: usize| {
                weights(n_ring, apex).unwrap()[(j * FOURS + i / LANES) * n_ring + k][i % LANES]
            };
            for (i, j) in (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (i, j))) {
                let sum: f64 = (0..n_ring).map(|k| at(0, [i, j], k)).sum();
                assert!((sum - 1.0).abs() < 1e-14, "{n}: {i}, {j}: {sum}");
                for apex in 1..4 {
                    let seen = from_apex(apex, [i, j]);
                    assert!((0..n_ring).all(|k| at(apex, [i, j], k) == at(0, seen, k)));
                }
            }
        }
        assert!(weights(1 + 2 * 17 + N_OUTER, 0).is_none());
    }
}
