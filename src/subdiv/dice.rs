//! From patches to lattice vertices: rates, shared borders, and boxes of parts that are not tessellated yet.
//!
//! The **rate** of an edge is the number of segments it is cut into; it belongs to the edge, so both faces agree. A
//! patch has `n_u x n_v` cells, the larger of opposite rates; where a side is coarser than that, its border vertices
//! snap to the nearest of the edge's points, and the border becomes the edge's own polyline.
//!
//! Neighbours evaluate a shared point from different rings, and their f64 results differ in the last bits. Both round
//! to the lattice. Only where a coordinate is within [`GUARD`] of a rounding boundary could they disagree, and there
//! both ask the same **owner** (of the edge or vertex) and take its rounded value. If one side sees the point inside
//! the guard and the other just outside, they still agree: the owner's value lies within the evaluation error, far less
//! than the guard, of one that is a whole guard away from the boundary.

use super::bounds::{AskedGrid, GridExtents};
use super::eval::{Evaluator, SurfaceSample};
use super::extent::{AskedPart, Extent, PartExtent};
use super::regular::MOST_PARTS;
use super::surface::{PatchPoints, Surface};
use crate::ids::{FaceId, PatchId};
use crate::math::lattice_grid::MOST_NEAR;
use crate::math::simd::{self, Kernel, Task};
use crate::math::{Bounds, Envelope, LatticeGrid, Plate, PointGrid, Rounding};
use crate::topology::HalfEdges;
use glam::{DVec3, Vec3};

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

/// Largest rate of an edge.
pub const MAX_RATE: u32 = 4096;

/// How finely a patch is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PatchRates {
    /// Segments of the sides v = 0, u = 1, v = 1, u = 0.
    pub sides: [u32; 4],
    /// Cells along u.
    pub n_u: u32,
    /// Cells along v.
    pub n_v: u32,
}

/// The next multiple of a power of two.
fn round_up(n: u32, unit: u32) -> u32 {
    (n + (unit - 1)) & !(unit - 1)
}

impl PatchRates {
    /// The power of two `unit` divides the numbers of cells.
    fn new(sides: [u32; 4], unit: u32) -> Self {
        let [n_u, n_v] = [0, 1].map(|k| round_up(sides[k].max(sides[k + 2]), unit));
        Self { sides, n_u, n_v }
    }

    /// Triangles of the patch's grid.
    pub fn n_triangles(&self) -> u64 {
        2 * u64::from(self.n_u) * u64::from(self.n_v)
    }
}

impl Surface {
    /// The rates of a patch, from `rate(a, b)`: the segments for an edge between two points of object space, symmetric
    /// in them. Edges beside a polygon that is no quad are cut evenly, since the polygon's patches meet in their
    /// middle.
    pub fn patch_rates(&self, patch: PatchId, rate: &impl Fn(DVec3, DVec3) -> u32) -> PatchRates {
        let end = |h: u32| self.object_point(self.topology().vertex(h));
        self.rates_by(patch, &|h| rate(end(h), end(self.topology().next(h))), &|face, k| {
            let [a, b] = self.inner_edge(face, k);
            rate(a, b)
        })
    }

    /// [`patch_rates`](Self::patch_rates) for the same rate everywhere.
    pub fn uniform_rates(&self, patch: PatchId, n: u32) -> PatchRates {
        if !self.edited().has_holes() && self.topology().is_among_quads(self.face_of(patch).0) {
            return PatchRates::new([n.clamp(1, MAX_RATE); 4], 1);
        }
        self.rates_by(patch, &|_| n, &|_, _| n)
    }

    /// The rates of a patch from those of half-edges, and of twice the way from the middle of edge k of a polygon to
    /// its centre.
    fn rates_by(&self, patch: PatchId, edge: &impl Fn(u32) -> u32, inner: &impl Fn(FaceId, u32) -> u32) -> PatchRates {
        let (face, sub) = self.face_of(patch);
        let (first, n) = self.topology().face_corners(face.0);
        let unit = self.edited().cell_unit(patch);
        let edge = |k: u32| self.edge_rate(first + k, edge(first + k));
        if n == 4 {
            return PatchRates::new([edge(0), edge(1), edge(2), edge(3)], unit);
        }
        let inner = |k: u32| {
            let whole = inner(face, k).clamp(1, MAX_RATE);
            round_up(whole.div_ceil(2), self.edited().inner_unit(face))
        };
        let before = (sub + n - 1) % n;
        PatchRates::new([edge(sub) / 2, inner(sub), inner(before), edge(before) / 2], unit)
    }

    fn edge_rate(&self, h: u32, rate: u32) -> u32 {
        let halves = if self.topology().touches_polygon(h) { 2 } else { 1 };
        round_up(rate.clamp(1, MAX_RATE), halves.max(self.edited().edge_unit(self.topology(), h)))
    }

    /// From the middle of edge `k` of a polygon through its centre, as far again.
    fn inner_edge(&self, face: FaceId, k: u32) -> [DVec3; 2] {
        let (first, n) = self.topology().face_corners(face.0);
        let corner = |k: u32| self.object_point(self.topology().vertex(first + k % n));
        let center = (0..n).map(corner).sum::<DVec3>() / f64::from(n);
        let middle = 0.5 * (corner(k) + corner(k + 1));
        [middle, middle + 2.0 * (center - middle)]
    }

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

/// Equal parts of a patch's cells, side by side.
#[derive(Clone, Copy, Debug)]
pub struct EqualParts {
    /// The first cell along u and v.
    pub from: [u32; 2],
    /// Parts along u and v.
    pub n: [u32; 2],
    /// Cells along a side of each.
    pub side: u32,
}

/// Turns parts of patches into lattice vertices. Holds scratch memory and the last patches: keep one per thread.
#[derive(Debug, Default)]
pub struct Dicer {
    points: [PatchPoints; N_REMEMBERED],
    evaluator: Evaluator,
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

/// The edge point that border vertex `i` of `n` snaps to where the side has only `rate` segments.
pub fn snapped(i: u32, n: u32, rate: u32) -> u32 {
    ((2 * u64::from(i) * u64::from(rate) + u64::from(n)) / (2 * u64::from(n))) as u32
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
    fn load(&mut self, surface: &Surface, patch: PatchId) -> usize {
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

    /// What holds every lattice vertex [`dice`](Self::dice) would give for these cells, without dicing; `depth` more
    /// splits towards irregular corners make it tighter. The plate is across the normal in the middle of the cells.
    pub fn envelope(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        i: [u32; 2],
        j: [u32; 2],
        depth: u32,
    ) -> Envelope {
        let lane = self.load(surface, patch);
        let [u, v] = [range(i, rates.n_u), range(j, rates.n_v)];
        let normal = surface.normal_of_part(&mut self.points[lane], &mut self.evaluator, u, v);
        in_lattice(normal, &self.extent(surface, patch, rates, normal, [i, j], depth))
    }

    /// The box of [`envelope`](Self::envelope) alone.
    pub fn bounds(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        i: [u32; 2],
        j: [u32; 2],
        depth: u32,
    ) -> Bounds {
        to_lattice_box(&self.extent(surface, patch, rates, [0; 3], [i, j], depth))
    }

    /// How far cells reach, and how high along a normal, where sides move their vertices to, too.
    fn extent(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        normal: [i8; 3],
        [i, j]: [[u32; 2]; 2],
        depth: u32,
    ) -> Extent {
        let lane = self.load(surface, patch);
        let points = &mut self.points[lane];
        let (u, v) = (range(i, rates.n_u), range(j, rates.n_v));
        let mut extent = surface.extent(points, &mut self.evaluator, AskedPart { range: [u, v], normal, depth });
        let snap = |[a, b]: [u32; 2], n: u32, r: u32| range([snapped(a, n, r), snapped(b, n, r)], r);
        for side in 0..4 {
            let (touches, n, along) = match side {
                0 => (j[0] == 0, rates.n_u, i),
                1 => (i[1] == rates.n_u, rates.n_v, j),
                2 => (j[1] == rates.n_v, rates.n_u, i),
                _ => (i[0] == 0, rates.n_v, j),
            };
            let rate = rates.sides[side];
            let (own, t) = (range(along, n), snap(along, n, rate));
            // What of the side lies within the cells' own parameters is in their box already.
            if touches && (t[0] < own[0] || t[1] > own[1]) {
                let t = [if t[0] < own[0] { t[0] } else { own[1] }, if t[1] > own[1] { t[1] } else { own[0] }];
                let range = match side {
                    0 => [t, [0.0; 2]],
                    1 => [[1.0; 2], t],
                    2 => [t, [1.0; 2]],
                    _ => [[0.0; 2], t],
                };
                let asked = AskedPart { range, normal, depth };
                extent = extent.union(surface.extent(points, &mut self.evaluator, asked));
            }
        }
        extent
    }

    /// Appends the [envelopes](Self::envelope) of equal parts, if they can be found together: where a square of two or
    /// four parts a side has no side that is coarser than its cells. Returns whether that is so.
    pub fn envelopes_of_parts(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        parts: EqualParts,
        depth: u32,
        out: &mut Vec<Envelope>,
    ) -> bool {
        let EqualParts { from, n, side } = parts;
        let cells = [rates.n_u, rates.n_v];
        let is_plain = (0..4).all(|k| rates.sides[k] == cells[k % 2]);
        let is_whole = (0..2).all(|k| from[k] + n[k] * side <= cells[k]);
        if !is_plain || !is_whole || n[0] != n[1] || ![2, 4].contains(&n[0]) {
            return false;
        }
        let lane = self.load(surface, patch);
        let rectangle = [0, 1].map(|k| range([from[k], from[k] + n[k] * side], cells[k]));
        let asked = AskedGrid { range: rectangle, side: n[0] as usize, depth };
        let mut extents = [PartExtent::EMPTY; MOST_PARTS * MOST_PARTS];
        if !surface.grid_of_parts(&mut self.points[lane], &mut self.evaluator, asked, &mut extents) {
            return false;
        }
        simd::run(LatticeEnvelopes { extents: &extents, n: asked.side, out });
        true
    }

    /// As [`envelope`](Self::envelope) for a whole patch at any rates.
    pub fn patch_envelope(&mut self, surface: &Surface, patch: PatchId, depth: u32) -> Envelope {
        let lane = self.load(surface, patch);
        let (points, evaluator, whole) = (&mut self.points[lane], &mut self.evaluator, [0.0, 1.0]);
        let normal = surface.normal_of_part(points, evaluator, whole, whole);
        in_lattice(normal, &surface.extent(points, evaluator, AskedPart::whole(normal, depth)))
    }
}

/// The parameters of cells.
fn range([a, b]: [u32; 2], n: u32) -> [f64; 2] {
    [f64::from(a) / f64::from(n), f64::from(b) / f64::from(n)]
}

/// What vertices of a surface that reaches so far lie in.
fn in_lattice(normal: [i8; 3], extent: &Extent) -> Envelope {
    Envelope { bounds: to_lattice_box(extent), plate: to_lattice_plate(normal, extent) }
}

/// Appends what vertices of `n` x `n` parts lie in.
struct LatticeEnvelopes<'a> {
    extents: &'a GridExtents,
    n: usize,
    out: &'a mut Vec<Envelope>,
}

impl Task for LatticeEnvelopes<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let Self { extents, n, out } = self;
        for row in extents.chunks_exact(MOST_PARTS).take(n) {
            for PartExtent { extent, normal } in &row[..n] {
                let bounds = LatticeBox { extent }.run(k);
                out.push(Envelope { bounds, plate: to_lattice_plate(*normal, extent) });
            }
        }
    }
}

/// By how much rounding moves a coordinate at most, and a little for evaluation errors.
const ROUNDED: f64 = 0.51;

/// Rounds outwards to lattice points, by what rounding a vertex can move it and a little for evaluation errors. The
/// result is exact in f32, since lattice coordinates stay below 2^24.
fn to_lattice_box(extent: &Extent) -> Bounds {
    simd::run(LatticeBox { extent })
}

struct LatticeBox<'a> {
    extent: &'a Extent,
}

impl Task for LatticeBox<'_> {
    type Output = Bounds;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Bounds {
        let Extent { low, high } = self.extent;
        let low = k.add4(k.load4(&low.0), k.splat4(LATTICE_SHIFT - ROUNDED));
        // What is to be rounded up is rounded down beyond zero.
        let high = k.sub4(k.sub4(k.splat4(-0.0), k.load4(&high.0)), k.splat4(LATTICE_SHIFT + ROUNDED));
        let (low, high) = (k.store4(k.floor4(low)), k.store4(k.floor4(high)));
        Bounds {
            min: Vec3::new(low[0] as f32, low[1] as f32, low[2] as f32),
            max: Vec3::new(-high[0] as f32, -high[1] as f32, -high[2] as f32),
        }
    }
}

/// The plate of what reaches so far, for vertices.
#[inline(always)]
fn to_lattice_plate(normal: [i8; 3], extent: &Extent) -> Plate {
    let [x, y, z] = [i32::from(normal[0]), i32::from(normal[1]), i32::from(normal[2])];
    let (shift, moved) = (LATTICE_SHIFT * f64::from(x + y + z), ROUNDED * f64::from(x.abs() + y.abs() + z.abs()));
    Plate::around(normal, extent.low.0[3] + shift - moved, extent.high.0[3] + shift + moved)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::{ControlMesh, shapes};
    use crate::subdiv::refine::tests::edits::{edited_cube, edited_tetrahedron};

    fn meshes() -> impl Iterator<Item = ControlMesh> {
        let shapes = shapes::all().into_iter().map(|(_, mesh)| mesh);
        shapes.chain([edited_cube(), edited_tetrahedron()]).chain((0..60).map(random_mesh))
    }

    /// Boxes and plates of whole patches hold what is diced at any rate, and parts' boxes what of it is theirs.
    #[test]
    fn what_is_diced_lies_in_boxes_and_plates() {
        let (mut dicer, mut n) = (Dicer::default(), 0);
        for mesh in meshes() {
            let surface = Surface::new(&mesh, 1).unwrap();
            for patch in surface.visible_patches() {
                let whole = dicer.patch_envelope(&surface, patch, 3);
                let rates = surface.uniform_rates(patch, 1 + patch.0 % 9);
                let cells = [[0, rates.n_u], [0, rates.n_v]];
                n += check(&mut dicer, &surface, patch, &rates, cells, whole);
                assert_eq!(whole, dicer.patch_envelope(&surface, patch, 3));
                let part = dicer.envelope(&surface, patch, &rates, cells[0], cells[1], 0);
                check(&mut dicer, &surface, patch, &rates, cells, part);
            }
        }
        assert!(n > 30_000, "{n} vertices");
    }

    /// Checks that the vertices of these cells lie in the envelope; returns how many there are.
    fn check(
        dicer: &mut Dicer,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        cells: [[u32; 2]; 2],
        e: Envelope,
    ) -> usize {
        let mut grid = LatticeGrid::default();
        dicer.dice(surface, patch, rates, cells[0], cells[1], &mut grid);
        for p in grid.points().map(|p| DVec3::from_array(p.map(f64::from))) {
            let (height, b) = (Plate::height(e.plate.normal, p), e.bounds);
            assert!((f64::from(e.plate.low)..=f64::from(e.plate.high)).contains(&height), "{patch:?} {cells:?} {e:?}");
            assert!((b.min.as_dvec3().cmple(p) & p.cmple(b.max.as_dvec3())).all(), "{patch:?} {cells:?} {e:?} {p}");
        }
        grid.points().count()
    }

    /// Parts alone, at sides that move their vertices, and parts that are found together, each by its own normal.
    #[test]
    fn what_is_diced_of_parts_lies_in_their_envelopes() {
        let (mut dicer, mut together, mut n, mut n_without) = (Dicer::default(), Vec::new(), [0; 2], 0);
        for mesh in meshes() {
            let surface = Surface::new(&mesh, 1).unwrap();
            for patch in surface.visible_patches() {
                let rates = PatchRates::new([0, 1, 2, 3].map(|side| [8, 3, 1, 5][(patch.idx() / (side + 1)) % 4]), 1);
                let cut = |n: u32| [[0, n.div_ceil(2)], [n / 2, n]];
                for (i, j) in cut(rates.n_u).into_iter().flat_map(|i| cut(rates.n_v).map(|j| (i, j))) {
                    let alone = dicer.envelope(&surface, patch, &rates, i, j, 2);
                    check(&mut dicer, &surface, patch, &rates, [i, j], alone);
                    n[0] += 1;
                }
                let rates = PatchRates::new([8; 4], 1);
                for side in [4, 2] {
                    together.clear();
                    let children = 8 / side;
                    let parts = EqualParts { from: [0, 0], n: [children; 2], side };
                    if !dicer.envelopes_of_parts(&surface, patch, &rates, parts, 2, &mut together) {
                        continue;
                    }
                    for (part, e) in (0..).zip(&together) {
                        let cells = [part % children, part / children].map(|k| [side * k, side * (k + 1)]);
                        check(&mut dicer, &surface, patch, &rates, cells, *e);
                        n_without += usize::from(e.plate.normal == [0; 3]);
                        n[1] += 1;
                    }
                }
            }
        }
        assert!(n[0] > 5_000 && n[1] > 20_000 && 20 * n_without < n[1], "{n:?} parts, {n_without} without a normal");
    }

    /// A plane that is no axis's: its patches are as thick as rounding makes them, and their boxes are cubes.
    #[test]
    fn plates_of_a_plane_are_thin() {
        let at = |k: usize| DVec3::new((k % 6) as f64, (k / 6) as f64, 0.0);
        let turned = |p: DVec3| glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.8) * p;
        let faces: Vec<Vec<u32>> = (0..25).map(|k| k / 5 * 6 + k % 5).map(|a| vec![a, a + 1, a + 7, a + 6]).collect();
        let mesh = ControlMesh::from_polygons((0..36).map(at).map(turned).collect(), &faces).unwrap();
        let surface = Surface::new(&mesh, 1).unwrap();
        for patch in surface.visible_patches() {
            let Envelope { bounds, plate } = Dicer::default().patch_envelope(&surface, patch, 3);
            // Normals are rounded to a hundredth.
            let width = Plate::height(plate.normal.map(i8::abs), (bounds.max - bounds.min).as_dvec3());
            let thickness = f64::from(plate.high - plate.low);
            assert!(0.0 < thickness && thickness < 0.02 * width, "{patch:?}: {thickness} of {width}");
        }
    }
}
