//! From patches to lattice vertices, with borders that neighbours share to the bit.
//!
//! Neighbours evaluate a shared point from different rings, and their f64 results differ in the last bits. Both round
//! to the lattice. Only where a coordinate is within [`GUARD`] of a rounding boundary could they disagree, and there
//! both ask the same **owner** (of the edge or vertex) and take its rounded value. If one side sees the point inside
//! the guard and the other just outside, they still agree: the owner's value lies within the evaluation error, far less
//! than the guard, of one that is a whole guard away from the boundary.

use super::eval::{Evaluator, SurfaceSample};
use super::rates::{PatchRates, snapped};
use super::surface::{PatchPoints, Surface};
use crate::ids::{FaceId, PatchId};
use crate::math::lattice_grid::MOST_NEAR;
use crate::math::{LatticeGrid, PointGrid, Rounding};
use crate::topology::HalfEdges;
use glam::DVec3;

/// Distance from a rounding boundary, in lattice steps, within which border points are computed by their owner.
///
/// Evaluation errors stay below 2^-21: coordinates are below 2^23, so that one f64 operation errs by at most 2^-30, and
/// a walk of 30 levels sums about 20 terms each. The fuzz tests measure less than 2^-24. Larger guards cost owner
/// evaluations (6 GUARD of all border points), smaller ones lose the margin.
pub const GUARD: f64 = 1.0 / 65536.0;

/// Added before rounding: mesh coordinates are often dyadic fractions, whose halves would lie on rounding boundaries
/// all the time; a third is far from all of them.
pub const LATTICE_SHIFT: f64 = 1.0 / 3.0;

const ROUNDING: Rounding = Rounding { shift: LATTICE_SHIFT, guard: GUARD };

impl Surface {
    /// A control point in object space.
    pub fn object_point(&self, vertex: u32) -> DVec3 {
        self.lattice().to_object(self.control_point(vertex).to_vec())
    }

    /// The object-space position of a lattice vertex.
    pub fn object_from_lattice(&self, vertex: DVec3) -> DVec3 {
        self.lattice().to_object(vertex - LATTICE_SHIFT)
    }
}

/// Patches whose ring points a dicer remembers, one for each remainder of patch numbers: rays come back to the few
/// patches around them.
const N_REMEMBERED: usize = 16;

/// Turns parts of patches into lattice vertices. Holds scratch memory and the last patches: keep one per thread.
#[derive(Debug, Default)]
pub struct Dicer {
    pub(super) points: [PatchPoints; N_REMEMBERED],
    pub(super) evaluator: Evaluator,
    /// The points of the part that is diced.
    out: PointGrid,
    /// Points of a side that has fewer of them than the grid, and the vertices they become.
    row: PointGrid,
    side: Vec<[i32; 3]>,
    owner: OwnerScratch,
}

#[derive(Debug, Default)]
struct OwnerScratch {
    points: PatchPoints,
    evaluator: Evaluator,
    single: PointGrid,
}

/// A lattice coordinate, and whether it was within the guard of the next one.
#[inline(always)]
fn round(x: f64) -> (i32, bool) {
    let shifted = x + (LATTICE_SHIFT + 0.5);
    let floor = shifted.floor();
    let fraction = shifted - floor;
    (floor as i32, !(GUARD..=1.0 - GUARD).contains(&fraction))
}

#[inline(always)]
fn round_point(p: [f64; 3]) -> ([i32; 3], bool) {
    let (x, y, z) = (round(p[0]), round(p[1]), round(p[2]));
    ([x.0, y.0, z.0], x.1 | y.1 | z.1)
}

/// A side of a patch: which, and the index of a point on it out of `rate`, counted along increasing u or v.
#[derive(Clone, Copy)]
struct SidePoint {
    side: usize,
    index: u32,
    rate: u32,
}

impl SidePoint {
    fn uv(&self) -> (f64, f64) {
        let t = f64::from(self.index) / f64::from(self.rate);
        match self.side {
            0 => (t, 0.0),
            1 => (1.0, t),
            2 => (t, 1.0),
            _ => (0.0, t),
        }
    }
}

/// The points of some cells' grid that lie on a side of the patch.
#[derive(Clone, Copy)]
struct TouchedSide {
    side: usize,
    /// The first of them, counted along the side.
    first: u32,
    n_points: usize,
    /// Cells of the patch along the side.
    n: u32,
    /// How far across they lie in the grid.
    across: usize,
}

impl TouchedSide {
    /// `None` if the cells (along u and v) do not touch the side.
    #[inline(always)]
    fn new(side: usize, rates: &PatchRates, cells: [[u32; 2]; 2]) -> Option<Self> {
        let (axis, is_far) = (side % 2, side == 1 || side == 2);
        let n = [rates.n_u, rates.n_v];
        let ([first, last], [near, far]) = (cells[axis], cells[1 - axis]);
        let is_touched = if is_far { far == n[1 - axis] } else { near == 0 };
        let across = if is_far { (far - near) as usize } else { 0 };
        is_touched.then_some(Self { side, first, n_points: (last - first + 1) as usize, n: n[axis], across })
    }

    /// The one along the side: 0 for u, 1 for v.
    #[inline(always)]
    fn axis(&self) -> usize {
        self.side % 2
    }

    /// Where in the grid its points lie.
    #[inline(always)]
    fn place(&self, along: usize) -> [usize; 2] {
        if self.axis() == 0 { [along, self.across] } else { [self.across, along] }
    }
}

/// `i / n` for all i from the first to the last. Dividing by a power of two is multiplying, which takes a quarter of
/// the time.
fn parameters([first, last]: [u32; 2], n: u32) -> impl Iterator<Item = f64> {
    let is_exact = n.is_power_of_two();
    let (n, step) = (f64::from(n), 1.0 / f64::from(n));
    (first..=last).map(move |i| if is_exact { f64::from(i) * step } else { f64::from(i) / n })
}

impl Dicer {
    /// The lattice vertices `i0..=i1` by `j0..=j1` of a patch's grid.
    pub fn dice(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        [i0, i1]: [u32; 2],
        [j0, j1]: [u32; 2],
        out: &mut LatticeGrid,
    ) {
        let lane = self.load(surface, patch);
        let us = parameters([i0, i1], rates.n_u);
        let vs = parameters([j0, j1], rates.n_v);
        let cells = Some([rates.n_u, rates.n_v]);
        surface.grid(&mut self.points[lane], &mut self.evaluator, cells, us, vs, &mut self.out);
        let has_near = out.round(&self.out, ROUNDING);
        for side in [0, 2, 3, 1] {
            let Some(points) = TouchedSide::new(side, rates, [[i0, i1], [j0, j1]]) else { continue };
            if rates.sides[side] != points.n {
                self.move_to_edge(surface, patch, rates, points, out);
            } else if has_near {
                self.ask_owners(surface, patch, rates, points, out);
            }
        }
    }

    /// Moves vertices on a side to the points of its edge, which has fewer segments than the grid.
    fn move_to_edge(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        at: TouchedSide,
        out: &mut LatticeGrid,
    ) {
        let index = |along: usize| snapped(at.first + along as u32, at.n, rates.sides[at.side]);
        self.find_side(surface, patch, rates, at.side, [index(0), index(at.n_points - 1)]);
        for along in 0..at.n_points {
            let [i, j] = at.place(along);
            out.set(i, j, self.side[(index(along) - index(0)) as usize]);
        }
    }

    /// Gives those vertices on a side that are within the guard of a rounding boundary what their owners say.
    fn ask_owners(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        at: TouchedSide,
        out: &mut LatticeGrid,
    ) {
        let TouchedSide { side, first, n, n_points, .. } = at;
        for start in (0..n_points).step_by(MOST_NEAR) {
            let mut near = ROUNDING.near(&self.out, at.place(start), at.axis(), (n_points - start).min(MOST_NEAR));
            while near != 0 {
                let along = start + near.trailing_zeros() as usize;
                let [i, j] = at.place(along);
                let point = SidePoint { side, index: first + along as u32, rate: n };
                out.set(i, j, self.owner.side_point(surface, patch, rates, point));
                near &= near - 1;
            }
        }
    }

    /// Puts the vertices at the points `first` to `last` of a side, counted in its own segments, into `self.side`.
    fn find_side(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        side: usize,
        [first, last]: [u32; 2],
    ) {
        let (axis, rate) = (side % 2, rates.sides[side]);
        let lane = self.load(surface, patch);
        let (points, evaluator, row) = (&mut self.points[lane], &mut self.evaluator, &mut self.row);
        let along = parameters([first, last], rate);
        let across = std::iter::once(if side == 1 || side == 2 { 1.0 } else { 0.0 });
        if axis == 0 {
            surface.grid(points, evaluator, None, along, across, row);
        } else {
            surface.grid(points, evaluator, None, across, along, row);
        }
        self.side.clear();
        for index in first..=last {
            let k = (index - first) as usize;
            let [i, j] = if axis == 0 { [k, 0] } else { [0, k] };
            self.side.push(match round_point(self.row.point(i, j)) {
                (vertex, false) => vertex,
                _ => self.owner.side_point(surface, patch, rates, SidePoint { side, index, rate }),
            });
        }
    }

    /// Fetches a patch's points; returns where they are.
    #[inline]
    pub(super) fn load(&mut self, surface: &Surface, patch: PatchId) -> usize {
        let lane = patch.idx() % N_REMEMBERED;
        surface.load(patch, &mut self.points[lane]);
        lane
    }

    /// Position and tangents at a point of a patch, in lattice units without [`LATTICE_SHIFT`].
    pub fn sample(&mut self, surface: &Surface, patch: PatchId, u: f64, v: f64) -> SurfaceSample {
        let lane = self.load(surface, patch);
        surface.sample(&mut self.points[lane], &mut self.evaluator, u, v)
    }

    /// The limit normal in object space, not normalised; zero where there is none.
    pub fn normal(&mut self, surface: &Surface, patch: PatchId, u: f64, v: f64) -> DVec3 {
        let lane = self.load(surface, patch);
        surface.normal(&mut self.points[lane], &mut self.evaluator, u, v)
    }
}

impl OwnerScratch {
    fn side_point(&mut self, surface: &Surface, patch: PatchId, rates: &PatchRates, at: SidePoint) -> [i32; 3] {
        let (face, sub) = surface.face_of(patch);
        let (first, n) = surface.topology().face_corners(face.0);
        let SidePoint { side, index, rate } = at;
        if n == 4 {
            let along = if side < 2 { index } else { rate - index };
            return self.edge_point(surface, first + side as u32, along, rate);
        }
        let before = (sub + n - 1) % n;
        match side {
            0 => self.edge_point(surface, first + sub, index, 2 * rate),
            3 => self.edge_point(surface, first + before, 2 * rate - index, 2 * rate),
            1 => self.inner_point(surface, face, sub, index, rate, rates.sides[0]),
            _ => self.inner_point(surface, face, before, index, rate, rates.sides[3]),
        }
    }

    /// Point `index` of `rate` along half-edge `h`, in the name of the edge's owner.
    fn edge_point(&mut self, surface: &Surface, h: u32, index: u32, rate: u32) -> [i32; 3] {
        let topology = surface.topology();
        if index == 0 || index == rate {
            return self.vertex(surface, if index == 0 { h } else { topology.next(h) });
        }
        let owner = topology.edge_owner(h);
        let index = if topology.vertex(owner) == topology.vertex(h) { index } else { rate - index };
        let face = FaceId(topology.face(owner));
        let (first, n) = topology.face_corners(face.0);
        let k = owner - first;
        if n == 4 {
            let index = if k < 2 { index } else { rate - index };
            let (u, v) = SidePoint { side: k as usize, index, rate }.uv();
            return self.point(surface, surface.patch_of(face, 0), u, v);
        }
        let half = rate / 2;
        if index <= half {
            self.point(surface, surface.patch_of(face, k), f64::from(index) / f64::from(half), 0.0)
        } else {
            let t = f64::from(rate - index) / f64::from(half);
            self.point(surface, surface.patch_of(face, (k + 1) % n), 0.0, t)
        }
    }

    /// Point `index` of `rate` from the middle of a polygon's edge `k`, itself cut into `2 half` segments, to its
    /// centre.
    fn inner_point(&mut self, surface: &Surface, face: FaceId, k: u32, index: u32, rate: u32, half: u32) -> [i32; 3] {
        let (first, _) = surface.topology().face_corners(face.0);
        if index == 0 {
            self.edge_point(surface, first + k, half, 2 * half)
        } else if index == rate {
            self.point(surface, surface.patch_of(face, 0), 1.0, 1.0)
        } else {
            self.point(surface, surface.patch_of(face, k), 1.0, f64::from(index) / f64::from(rate))
        }
    }

    fn vertex(&mut self, surface: &Surface, h: u32) -> [i32; 3] {
        let topology = surface.topology();
        let owner = topology.vertex_owner(h);
        let face = FaceId(topology.face(owner));
        let (first, n) = topology.face_corners(face.0);
        let k = owner - first;
        let (sub, corner) = if n == 4 { (0, k) } else { (k, 0) };
        let (u, v) = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)][corner as usize];
        self.point(surface, surface.patch_of(face, sub), u, v)
    }

    fn point(&mut self, surface: &Surface, patch: PatchId, u: f64, v: f64) -> [i32; 3] {
        surface.load(patch, &mut self.points);
        surface.grid(&mut self.points, &mut self.evaluator, None, [u], [v], &mut self.single);
        round_point(self.single.point(0, 0)).0
    }
}
