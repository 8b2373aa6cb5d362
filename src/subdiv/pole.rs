//! One Catmull-Clark step around a lone extraordinary vertex, written out: what most splits of irregular patches are.
//!
//! A **pole** is a quad with smooth corners in a ring of quads, one corner of which, the **apex**, has n != 4 edges.
//! Its quarter at the apex is a pole of the same n, the other three are regular. As rows the step is about 150 terms,
//! each with a column and a weight to be read; written out it is 130 sums of registers.
//!
//! The points of a pole, for n = 5, with the face between A, e0, f0 and e1:
//!
//! ```text
//!    p7 -- p6 -- p5 -- p4        ring: A, e0, f0, e1, f1, .. e(n-1), f(n-1), then p1 to p7
//!     |     |     |     |        step: the ring of the quarter at A in the same order, then the nine refined points
//!    f1 -- e1 -- f0 -- p3              beyond it: those on the sides from (3, -1) to (3, 3) and on to (-1, 3), in half
//!   e2 |    |     |     |              edges from A
//!     \ -- A -- e0 -- p2
//!    f2 / \     |     |
//!      e3  e4 - f4 -- p1
//! ```

use super::eval::Point;
use super::local::LocalMesh;
use super::regular::{bezier_points, bezier_points_of_two};
use super::rows::Index;
use super::rules::RefinedView;
use crate::math::simd::{Kernel, Task};
use crate::topology::{HalfEdges, VertexTags};

/// Points of a ring beside the apex and its fan.
pub(super) const N_OUTER: usize = 7;

/// Refined points that the quarter at the apex does not have.
pub(super) const N_BEYOND: usize = 9;

/// Refined points outside the quarter's fan.
const N_OUTSIDE: usize = N_OUTER + N_BEYOND;

/// The half-edges of a pole from which all its points can be told.
pub(super) struct Pole<'a> {
    ring: &'a LocalMesh,
    /// Half-edges from the apex, counter-clockwise from the face's.
    spokes: Vec<u32>,
    /// Half-edges of the face, from the apex on.
    sides: [u32; 4],
    /// Half-edges of the five faces beyond, each from the face's corner that it touches: below right, right, above
    /// right, above, above left.
    beyond: [u32; 5],
}

impl<'a> Pole<'a> {
    /// The pole that a ring is, if it is one.
    pub fn new(ring: &'a LocalMesh) -> Option<Self> {
        let is_smooth =
            ring.all_quads() && ring.fins.is_empty() && ring.tags.iter().all(|t| *t == VertexTags::default());
        if !is_smooth || ring.n_corners() != 4 {
            return None;
        }
        let sizes = [0, 1, 2, 3].map(|k| ring.fan_size(k));
        let apex = (0..4u32).find(|&k| sizes[k as usize].0 != 4)?;
        let is_pole =
            (0..4).all(|k| sizes[k].1 && (k == apex as usize) == (sizes[k].0 != 4)) && sizes[apex as usize].0 > 2;
        is_pole.then(|| Self::at(ring, apex))
    }

    fn at(ring: &'a LocalMesh, apex: u32) -> Self {
        let next = |h: u32, n: usize| (0..n).fold(h, |h, _| ring.next(h));
        let sides = [0, 1, 2, 3].map(|k| next(apex, k));
        let right = ring.next(ring.twin(sides[1]));
        let above = ring.twin(sides[2]);
        let beyond = [ring.next(ring.twin(right)), right, ring.twin(next(right, 2)), above, ring.twin(next(above, 3))];
        Self { ring, spokes: ring.fan(apex).spokes, sides, beyond }
    }

    /// The vertices of the ring, in a pole's order.
    pub fn ring(&self) -> Vec<u32> {
        let ring = self.ring;
        let at = |h: u32, n: usize| ring.vertex((0..n).fold(h, |h, _| ring.next(h)));
        let [below, right, corner, above, left] = self.beyond;
        let fan = self.spokes.iter().flat_map(|&spoke| [at(spoke, 1), at(spoke, 2)]);
        let outer = [at(below, 2), at(right, 1), at(right, 2), at(corner, 2), at(corner, 3), at(above, 3), at(left, 2)];
        std::iter::once(at(self.sides[0], 0)).chain(fan).chain(outer).collect()
    }

    /// The refined vertices, in the order of [`PoleStep`]; `None` if some of them are the same.
    pub fn refined(&self, view: &RefinedView<'_>) -> Option<Vec<u32>> {
        let (vertex, edge, face) =
            (|h: u32| view.vertex(4 * h), |h: u32| view.vertex(4 * h + 1), |h: u32| view.vertex(4 * h + 2));
        let before = |h: u32| self.ring.prev(h);
        let [_, side, top, last] = self.sides;
        let [below, right, corner, above, left] = self.beyond;
        let mut out = vec![vertex(self.sides[0])];
        out.extend(self.spokes.iter().flat_map(|&spoke| [edge(spoke), face(spoke)]));
        out.extend([edge(below), vertex(side), edge(side), vertex(top), edge(top), vertex(last), edge(before(left))]);
        out.extend([face(below), edge(right), face(right), edge(corner), face(corner), edge(before(corner))]);
        out.extend([face(above), edge(before(above)), face(left)]);
        let mut sorted = out.clone();
        sorted.sort_unstable();
        sorted.dedup();
        (sorted.len() == out.len()).then_some(out)
    }
}

/// The refined points of a pole: `out` has nine more than the ring.
pub(super) struct PoleStep<'a, I> {
    pub points: &'a [Point],
    /// Which of them is which of the ring, in a pole's order.
    pub ring: &'a [I],
    pub out: &'a mut [Point],
}

/// A quarter of a sum: a face point, or an edge point if two are face points.
#[inline(always)]
fn mean<K: Kernel>(k: K, a: K::D, b: K::D, c: K::D, d: K::D) -> K::D {
    k.mul4(k.add4(k.add4(a, b), k.add4(c, d)), k.splat4(0.25))
}

/// The vertex point of a vertex of four edges.
#[inline(always)]
fn vertex_point<K: Kernel>(k: K, p: K::D, edges: [K::D; 4], faces: [K::D; 4]) -> K::D {
    let edges = k.add4(k.add4(edges[0], edges[1]), k.add4(edges[2], edges[3]));
    let faces = k.add4(k.add4(faces[0], faces[1]), k.add4(faces[2], faces[3]));
    k.add4(k.mul4(p, k.splat4(0.5)), k.mul4(k.add4(edges, faces), k.splat4(1.0 / 16.0)))
}

impl<I: Index> PoleStep<'_, I> {
    /// A point of the ring.
    #[inline(always)]
    fn at<K: Kernel>(&self, k: K, i: I) -> K::D {
        k.load4(&self.points[i.idx()].0)
    }

    /// Writes what comes of the fan, two for each face; returns what comes of the apex.
    #[inline(always)]
    fn refine_fan<K: Kernel>(&self, k: K, apex: K::D, fan: &[I], out: &mut [Point]) -> K::D {
        let n = fan.len() / 2;
        let first = self.at(k, fan[0]);
        let mut before = mean(k, apex, self.at(k, fan[2 * n - 2]), self.at(k, fan[2 * n - 1]), first);
        let (mut edge, mut edges, mut faces) = (first, k.splat4(0.0), k.splat4(0.0));
        for (i, (pair, out)) in fan.chunks_exact(2).zip(out.chunks_exact_mut(2)).enumerate() {
            let next = if i + 1 < n { self.at(k, fan[2 * i + 2]) } else { first };
            let face = mean(k, apex, edge, self.at(k, pair[1]), next);
            out[0].0 = k.store4(mean(k, apex, edge, before, face));
            out[1].0 = k.store4(face);
            (edges, faces) = (k.add4(edges, edge), k.add4(faces, face));
            (edge, before) = (next, face);
        }
        let n = n as f64;
        let sum = k.mul4(k.add4(edges, faces), k.splat4(1.0 / (n * n)));
        k.add4(k.mul4(apex, k.splat4((n - 2.0) / n)), sum)
    }

    /// Writes what comes of the points around, of which `refined_fan` is there already.
    #[inline(always)]
    fn refine_outside<K: Kernel>(
        &self,
        k: K,
        apex: K::D,
        fan: &[I],
        refined_fan: &[Point],
        out: &mut [Point; N_OUTSIDE],
    ) {
        let outer: &[I; N_OUTER] = self.ring.last_chunk().expect("a pole's points");
        let (e0, f0, e1) = (self.at(k, fan[0]), self.at(k, fan[1]), self.at(k, fan[2]));
        let (f1, f_last) = (self.at(k, fan[3]), self.at(k, fan[fan.len() - 1]));
        let (p1, p2, p3, p4) = (self.at(k, outer[0]), self.at(k, outer[1]), self.at(k, outer[2]), self.at(k, outer[3]));
        let (p5, p6, p7) = (self.at(k, outer[4]), self.at(k, outer[5]), self.at(k, outer[6]));
        let (face_0, face_1) = (k.load4(&refined_fan[1].0), k.load4(&refined_fan[3].0));
        let face_last = k.load4(&refined_fan[fan.len() - 1].0);
        let below = mean(k, e0, f_last, p1, p2);
        let right = mean(k, e0, f0, p2, p3);
        let corner = mean(k, f0, p3, p4, p5);
        let above = mean(k, f0, e1, p5, p6);
        let left = mean(k, e1, f1, p6, p7);
        out[0].0 = k.store4(mean(k, e0, f_last, face_last, below));
        out[1].0 = k.store4(vertex_point(k, e0, [apex, p2, f0, f_last], [face_0, face_last, below, right]));
        out[2].0 = k.store4(mean(k, e0, f0, face_0, right));
        out[3].0 = k.store4(vertex_point(k, f0, [e0, e1, p3, p5], [face_0, right, corner, above]));
        out[4].0 = k.store4(mean(k, e1, f0, face_0, above));
        out[5].0 = k.store4(vertex_point(k, e1, [apex, f0, p6, f1], [face_0, above, left, face_1]));
        out[6].0 = k.store4(mean(k, e1, f1, face_1, left));
        out[7].0 = k.store4(below);
        out[8].0 = k.store4(mean(k, e0, p2, below, right));
        out[9].0 = k.store4(right);
        out[10].0 = k.store4(mean(k, f0, p3, right, corner));
        out[11].0 = k.store4(corner);
        out[12].0 = k.store4(mean(k, f0, p5, corner, above));
        out[13].0 = k.store4(above);
        out[14].0 = k.store4(mean(k, e1, p6, above, left));
        out[15].0 = k.store4(left);
    }
}

impl<I: Index> Task for PoleStep<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(mut self, k: K) {
        assert_eq!(self.out.len(), self.ring.len() + N_BEYOND, "a pole's refined points");
        let out = std::mem::take(&mut self.out);
        let (out, out_outside) = out.split_last_chunk_mut().expect("more than are outside");
        let (out_apex, out_fan) = out.split_first_mut().expect("an apex");
        let fan = &self.ring[1..self.ring.len() - N_OUTER];
        let apex = self.at(k, self.ring[0]);
        out_apex.0 = k.store4(self.refine_fan(k, apex, fan, out_fan));
        self.refine_outside(k, apex, fan, out_fan, out_outside);
    }
}

/// Points of a ring that [`PoleHull`] has room for: an apex of 24 edges.
pub(super) const MOST_POINTS: usize = 1 + 2 * 24 + N_OUTER;

/// Refined points of a ring of [`MOST_POINTS`].
pub(super) const MOST_REFINED: usize = MOST_POINTS + N_BEYOND;

/// The numbers of points that are in a pole's order.
pub(super) const IN_ORDER: [u8; MOST_POINTS] = {
    let mut order = [0; MOST_POINTS];
    let mut i = 0;
    while i < MOST_POINTS {
        order[i] = i as u8;
        i += 1;
    }
    order
};

/// A box around a whole pole of up to [`MOST_POINTS`] points, [low, high]: after each of `depth` steps, one or more,
/// around the Bézier points of the regular quarters, and at last around the points of what is left.
pub(super) struct PoleHull<'a, I> {
    pub points: &'a [Point],
    /// See [`PoleStep`].
    pub ring: &'a [I],
    pub depth: u32,
    /// Room for the refined points of two levels.
    pub scratch: &'a mut [[Point; MOST_REFINED]; 2],
}

/// The points of the regular quarters of a pole's face among its refined points: four of the row below the apex, from
/// its column on, and the four rows from the apex on, of five points each, from the column to its left on.
#[inline(always)]
fn rows_of_quarters<T>(refined: &[T]) -> ([&T; 4], [[&T; 5]; 4]) {
    let (inner, outside) = refined.split_last_chunk::<N_OUTSIDE>().expect("a pole's refined points");
    let (first, last) = (inner.first_chunk::<6>(), inner.last_chunk::<2>());
    let (f, l, o) = (first.expect("three faces"), last.expect("three faces"), outside);
    let rows = [
        [&f[5], &f[0], &f[1], &o[1], &o[8]],
        [&f[4], &f[3], &f[2], &o[2], &o[9]],
        [&o[6], &o[5], &o[4], &o[3], &o[10]],
        [&o[15], &o[14], &o[13], &o[12], &o[11]],
    ];
    ([&l[0], &l[1], &o[0], &o[7]], rows)
}

/// The control points of the regular quarters among the refined points of a pole with `n` faces around its apex.
pub(super) fn regular_quarters(n: usize) -> [[usize; 16]; 3] {
    let all: Vec<usize> = (0..1 + 2 * n + N_OUTSIDE).collect();
    let (below, rows) = rows_of_quarters(&all);
    [
        joined([below, last_four(rows[0]), last_four(rows[1]), last_four(rows[2])]),
        joined(rows.map(last_four)),
        joined(rows.map(first_four)),
    ]
}

fn first_four([a, b, c, d, _]: [&usize; 5]) -> [&usize; 4] {
    [a, b, c, d]
}

fn last_four([_, a, b, c, d]: [&usize; 5]) -> [&usize; 4] {
    [a, b, c, d]
}

fn joined(rows: [[&usize; 4]; 4]) -> [usize; 16] {
    std::array::from_fn(|i| *rows[i / 4][i % 4])
}

/// The box of the Bézier points of a pole's regular quarters. Quarters side by side have those of their border in
/// common, and of the control points of a row or a column all but one.
#[inline(always)]
fn hull_of_quarters<K: Kernel>(k: K, refined: &[Point]) -> (K::D, K::D) {
    let (below, rows) = rows_of_quarters(refined);
    let nothing = k.splat4(0.0);
    // Up one column: three points of the lower right quarter, then four of the upper ones.
    let mut right = [[nothing; 4]; 7];
    for x in 0..4 {
        let c = [below[x], rows[0][x + 1], rows[1][x + 1], rows[2][x + 1], rows[3][x + 1]];
        let c = [k.load4(&c[0].0), k.load4(&c[1].0), k.load4(&c[2].0), k.load4(&c[3].0), k.load4(&c[4].0)];
        for (row, p) in right.iter_mut().zip(bezier_points_of_two(k, c)) {
            row[x] = p;
        }
    }
    let c = [k.load4(&rows[0][0].0), k.load4(&rows[1][0].0), k.load4(&rows[2][0].0), k.load4(&rows[3][0].0)];
    let left = bezier_points(k, c);
    let (mut low, mut high) = (k.splat4(f64::INFINITY), k.splat4(f64::NEG_INFINITY));
    for row in &right[..3] {
        for p in bezier_points(k, *row) {
            (low, high) = (k.min4(low, p), k.max4(high, p));
        }
    }
    for (first, [a, b, c, d]) in left.into_iter().zip(&right[3..]) {
        for p in bezier_points_of_two(k, [first, *a, *b, *c, *d]) {
            (low, high) = (k.min4(low, p), k.max4(high, p));
        }
    }
    let scale = k.splat4(1.0 / 36.0);
    (k.mul4(low, scale), k.mul4(high, scale))
}

/// The box of some points, grown.
#[inline(always)]
fn grow_by_points<K: Kernel>(k: K, points: &[Point], low: &mut K::D, high: &mut K::D) {
    for p in points {
        let p = k.load4(&p.0);
        (*low, *high) = (k.min4(*low, p), k.max4(*high, p));
    }
}

impl<I: Index> Task for PoleHull<'_, I> {
    type Output = [Point; 2];
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> [Point; 2] {
        let (n_ring, n_refined) = (self.ring.len(), self.ring.len() + N_BEYOND);
        let [mut refined, mut before] = self.scratch.each_mut();
        let (mut low, mut high) = (k.splat4(f64::INFINITY), k.splat4(f64::NEG_INFINITY));
        for level in 0..self.depth {
            match level {
                0 => PoleStep { points: self.points, ring: self.ring, out: &mut refined[..n_refined] }.run(k),
                _ => {
                    PoleStep { points: before, ring: &IN_ORDER[..n_ring], out: &mut refined[..n_refined] }.run(k);
                }
            }
            if level > 0 && level + 1 == self.depth {
                // What these points reach beyond the last quarter lies in the others of the level before.
                grow_by_points(k, &refined[..n_refined], &mut low, &mut high);
            } else {
                let (l, h) = hull_of_quarters(k, &refined[..n_refined]);
                (low, high) = (k.min4(low, l), k.max4(high, h));
                if self.depth == 1 {
                    grow_by_points(k, &refined[..n_ring], &mut low, &mut high);
                }
            }
            (refined, before) = (before, refined);
        }
        [Point(k.store4(low)), Point(k.store4(high))]
    }
}

#[cfg(test)]
mod tests {
    use super::super::extent::Extent;
    use super::super::plan::{NodeId, Plan};
    use super::super::products::{products, refined_points};
    use super::super::regular::WholeHull;
    use super::super::surface::Surface;
    use super::*;
    use crate::math::simd::{self, Portable};
    use crate::mesh::shapes;

    /// A point for each number.
    fn scattered(i: usize) -> Point {
        Point::new((i as f64).sin(), (1.7 * i as f64).cos(), (0.3 * i as f64).sin())
    }

    #[test]
    fn quarters_together_reach_as_far_as_one_by_one() {
        for n in [3, 5, 6, 24] {
            let refined: Vec<Point> = (0..1 + 2 * n + N_OUTSIDE).map(scattered).collect();
            let mut expected = Extent::EMPTY;
            for quarter in regular_quarters(n) {
                let hull = simd::run(WholeHull { control: &quarter.map(|i| refined[i]) });
                hull.iter().for_each(|p| expected.grow(*p));
            }
            let (low, high) = hull_of_quarters(Portable, &refined);
            assert_eq!([Point(low), Point(high)], [expected.low, expected.high], "{n} faces around the apex");
        }
    }

    #[test]
    fn the_step_gives_what_the_rows_give() {
        let mut n_poles = 0;
        for valence in [3, 5, 6, 7, 8, 32, 100] {
            let surface = Surface::new(&shapes::quad_pole(valence), 1).unwrap();
            let plans = surface.plans();
            for node in (0..plans.len() as u32).map(|index| NodeId::unturned(index as usize)) {
                let Plan::Split { step, .. } = plans.plan(node) else { continue };
                if step.pole.is_none() {
                    continue;
                }
                n_poles += 1;
                let ring: Vec<Point> = (0..plans.n_points(node)).map(scattered).collect();
                let mut expected = vec![Point::ZERO; step.rows.len()];
                products(plans.rows(), step.rows, &ring, &mut expected);
                let mut out = vec![Point::ZERO; step.rows.len()];
                refined_points(plans.rows(), step, &ring, &mut out);
                for (a, b) in out.iter().zip(&expected) {
                    assert!((*a - *b).max_abs() < 1e-14, "valence {valence}: {a:?} {b:?}");
                }
            }
        }
        assert!(n_poles >= 7, "every valence has its pole: {n_poles}");
    }
}
