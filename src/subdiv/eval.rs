//! Walking down plans: grids of points, and single samples with tangents.

use super::bounds::{HullWeights, PolePoints};
use super::parts::Parts;
use super::plan::{Child, Children, Limit, Limits, NodeId, Plan, PlanLibrary, Step};
use super::products::{child_points, control_points, one_product, refined_points};
use super::regular::{self, BasisCache, ControlPoints};
use super::rows::{SparseRows, Width};
use super::stencils::{self, StencilGrid};
use crate::math::PointGrid;
use crate::math::simd;
use glam::DVec3;
use std::ops::{Add, Mul, Sub};

/// A point in lattice space, in four lanes so that sums compile to vector instructions. The fourth one is the point's
/// **height** along a [normal](crate::math::Plate::normal), where it has been measured: sums of points keep it as they
/// keep coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Point(pub [f64; 4]);

impl Point {
    /// The origin.
    pub const ZERO: Self = Point([0.0; 4]);

    /// From coordinates.
    #[inline(always)]
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Point([x, y, z, 0.0])
    }

    /// Largest absolute coordinate.
    pub fn max_abs(self) -> f64 {
        self.0.iter().fold(0.0, |m, x| m.max(x.abs()))
    }

    /// As a glam vector.
    #[inline(always)]
    pub fn to_vec(self) -> DVec3 {
        DVec3::new(self.0[0], self.0[1], self.0[2])
    }
}

impl AsRef<[f64; 4]> for Point {
    #[inline(always)]
    fn as_ref(&self) -> &[f64; 4] {
        &self.0
    }
}

impl Add for Point {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Point([a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]])
    }
}

impl Sub for Point {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Point([a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]])
    }
}

impl Mul<f64> for Point {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f64) -> Self {
        let a = self.0;
        Point([a[0] * s, a[1] * s, a[2] * s, a[3] * s])
    }
}

/// What the derivatives of a sample are.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SampleKind {
    /// Derivatives with respect to u and v.
    Regular,
    /// Unit tangents at a smooth extraordinary vertex, where derivatives do not exist.
    Extraordinary,
    /// None are defined.
    PositionOnly,
}

/// A point of the limit surface in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Position.
    pub position: DVec3,
    /// Derivative or unit tangent along u; zero if not defined.
    pub du: DVec3,
    /// Derivative or unit tangent along v.
    pub dv: DVec3,
    /// Which of these they are.
    pub kind: SampleKind,
}

/// A sub-square is taken for its corner beyond this many splits: f64 parameters end there.
const MAX_DEPTH: u32 = 52;

/// Evaluates one patch at a time. Holds scratch memory, so keep one per thread.
#[derive(Debug, Default)]
pub struct Evaluator {
    /// Ring points of all levels of the current walk, a stack.
    pub(super) points: Vec<Point>,
    /// Basis function values of the last lists of parameters along u and along v.
    basis: [BasisCache; 2],
    /// Parameters of all levels, a stack.
    params: Vec<f64>,
    pub(super) hulls: HullWeights,
    pub(super) pole_points: PolePoints,
    /// How many splits below the patch its parts have the cells that stencils are for, if the grid has such parts.
    stencil_depth: Option<u32>,
}

/// A rectangle of a tensor grid of parameters, and where its points go.
#[derive(Clone, Copy)]
pub(super) struct Target {
    /// Ranges in `Evaluator::params`.
    us: (usize, usize),
    vs: (usize, usize),
    /// The first point in the output.
    first: [usize; 2],
}

impl Target {
    /// Whether there is one point only.
    fn is_single(&self) -> bool {
        self.us.1 - self.us.0 == 1 && self.vs.1 - self.vs.0 == 1
    }
}

/// Where a polygon's child or a quad's quarter lies: its corner in units of its size.
pub(super) fn quarter(k: usize) -> (f64, f64) {
    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)][k]
}

/// The quarters of a quad in an order in which the left one of two neighbours comes first: writing a row's points, four
/// at a time, may spoil what is to the right of them.
pub(super) const LEFT_FIRST: [usize; 4] = [0, 1, 3, 2];

/// How many halvings of a patch with so many cells lead to parts that stencils are for.
fn stencil_depth([n_u, n_v]: [u32; 2]) -> Option<u32> {
    let is_square = n_u == n_v && n_u.is_power_of_two() && n_u >= stencils::CELLS;
    is_square.then(|| (n_u / stencils::CELLS).ilog2())
}

fn exact_corner(u: f64, v: f64) -> Option<usize> {
    match (u, v) {
        (0.0, 0.0) => Some(0),
        (1.0, 0.0) => Some(1),
        (1.0, 1.0) => Some(2),
        (0.0, 1.0) => Some(3),
        _ => None,
    }
}

impl Evaluator {
    /// Positions at all pairs of `us` and `vs` (each ascending, in 0..=1) of an irregular patch; point (i, j) of `out`
    /// is at `(us[i], vs[j])`. They may be any, or some of those of a grid with `cells` along u and v.
    pub(super) fn grid(
        &mut self,
        library: &PlanLibrary,
        parts: &mut Parts,
        cells: Option<[u32; 2]>,
        us: impl IntoIterator<Item = f64>,
        vs: impl IntoIterator<Item = f64>,
        out: &mut PointGrid,
    ) {
        let target = self.start_grid(us, vs, out);
        self.stencil_depth = cells.and_then(stencil_depth);
        self.walk_parts(library, parts, 0, 0, target, out);
        self.stencil_depth = None;
    }

    /// As [`walk`](Self::walk) for a part of a patch, whose parts are kept.
    fn walk_parts(
        &mut self,
        library: &PlanLibrary,
        parts: &mut Parts,
        part: usize,
        depth: u32,
        target: Target,
        out: &mut PointGrid,
    ) {
        if let Some(control) = parts.control(part) {
            return self.regular(control, target, out);
        }
        let node = parts.node(part);
        if self.by_stencils(library, node, parts.points(part), depth, target, out) {
            return;
        }
        let quarters = if target.is_single() { None } else { parts.quarters(library, part) };
        let Some(first) = quarters else {
            let ring = self.start_ring(parts.points(part));
            return self.walk(library, node, ring, depth, target, out);
        };
        let middle = self.middle(&target);
        let wanted = quarters_of(&target, middle);
        let mark = self.params.len();
        for k in LEFT_FIRST.into_iter().filter(|k| wanted >> k & 1 == 1) {
            let target = self.quarter_target(&target, middle, k);
            self.walk_parts(library, parts, first + k, depth + 1, target, out);
            self.params.truncate(mark);
        }
        if let Plan::Split { limits, .. } = library.plan(node) {
            self.set_corners(library, limits, parts.points(part), &target, out);
        }
    }

    /// Forgets other points; returns where the ring starts.
    pub(super) fn start_ring(&mut self, ring: &[Point]) -> usize {
        self.points.clear();
        self.points.extend_from_slice(ring);
        0
    }

    /// Forgets other parameters and makes room for their points; returns the whole grid.
    pub(super) fn start_grid(
        &mut self,
        us: impl IntoIterator<Item = f64>,
        vs: impl IntoIterator<Item = f64>,
        out: &mut PointGrid,
    ) -> Target {
        self.params.clear();
        self.params.extend(us);
        let n_u = self.params.len();
        self.params.extend(vs);
        let n = self.params.len();
        out.reset(n_u, n - n_u);
        Target { us: (0, n_u), vs: (n_u, n), first: [0, 0] }
    }

    /// Positions at all pairs of parameters, for 16 B-spline control points.
    pub fn regular_grid(
        &mut self,
        control: &ControlPoints,
        us: impl IntoIterator<Item = f64>,
        vs: impl IntoIterator<Item = f64>,
        out: &mut PointGrid,
    ) {
        let target = self.start_grid(us, vs, out);
        self.regular(control, target, out);
    }

    pub(super) fn walk(
        &mut self,
        library: &PlanLibrary,
        node: NodeId,
        ring: usize,
        depth: u32,
        target: Target,
        out: &mut PointGrid,
    ) {
        let (step, children, limits) = match library.plan(node) {
            Plan::Regular(rows, turn) => {
                let control = control_points(library.rows(), rows, turn, &self.points[ring..]);
                return self.regular(&control, target, out);
            }
            Plan::Split { step, children, limits, .. } => (step, children, limits),
        };
        if self.by_stencils(library, node, &self.points[ring..], depth, target, out) {
            return;
        }
        if target.is_single() || depth >= MAX_DEPTH {
            let (u, v) = (self.params[target.us.0], self.params[target.vs.0]);
            let corner = if depth >= MAX_DEPTH { exact_corner(u.round(), v.round()) } else { exact_corner(u, v) };
            if let Some(row) = corner.and_then(|k| limits.get(k)?.position()) {
                let p = one_product(library.rows(), row, 0, &self.points[ring..]);
                self.fill(target, p, out);
                return;
            }
        }
        let middle = self.middle(&target);
        let quarters = quarters_of(&target, middle);
        let start = self.points.len();
        let refined = if quarters.count_ones() > 1 { Some(self.refine(library, step, ring)) } else { None };
        let marks = (self.points.len(), self.params.len());
        for k in LEFT_FIRST.into_iter().filter(|k| quarters >> k & 1 == 1) {
            let child = &children.get(k);
            let part = self.quarter_target(&target, middle, k);
            let child_ring = match refined {
                Some(refined) => self.push_child(library, child, refined),
                None => self.refine_child(library, step, child, ring),
            };
            self.walk(library, child.node, child_ring, depth + 1, part, out);
            self.points.truncate(marks.0);
            self.params.truncate(marks.1);
        }
        self.points.truncate(start);
        self.set_corners(library, limits, &self.points[ring..], &target, out);
    }

    /// Finds a part's points by stencils, if it is a pole of the cells that they are for. Returns whether it is.
    #[inline(always)]
    fn by_stencils(
        &self,
        library: &PlanLibrary,
        node: NodeId,
        points: &[Point],
        depth: u32,
        target: Target,
        out: &mut PointGrid,
    ) -> bool {
        if self.stencil_depth != Some(depth) {
            return false;
        }
        let Plan::Split { step: Step { pole: Some(order), .. }, .. } = library.plan(node) else { return false };
        let store = library.rows();
        // The corners of a face come first among the points of its ring.
        let apex = (store.index(order, 0) + node.turn() as usize) % 4;
        let Some(weights) = stencils::weights(order.len(), apex) else { return false };
        let number = |place: usize| (f64::from(stencils::CELLS) * self.params[place]) as usize;
        let [i, j] = [target.us, target.vs].map(|(start, end)| [number(start), number(end - 1)]);
        let first = target.first;
        match store.widths() {
            Width::Narrow(indices) => {
                let ring = store.list(order, indices);
                simd::run(StencilGrid { points, ring, weights, i, j, out, first });
            }
            Width::Wide(indices) => {
                let ring = store.list(order, indices);
                simd::run(StencilGrid { points, ring, weights, i, j, out, first });
            }
        }
        true
    }

    /// Corners whose limit is known here, in place of what deeper parts made of them: a point alone comes no further
    /// than this, and must not depend on its company.
    fn set_corners(
        &self,
        library: &PlanLibrary,
        limits: Limits<'_>,
        ring: &[Point],
        target: &Target,
        out: &mut PointGrid,
    ) {
        let (n_u, n_v) = (target.us.1 - target.us.0, target.vs.1 - target.vs.0);
        for k in 0..4 {
            let (x, y) = quarter(k);
            let (i, j) = (if x == 0.0 { 0 } else { n_u - 1 }, if y == 0.0 { 0 } else { n_v - 1 });
            if self.params[target.us.0 + i] != x || self.params[target.vs.0 + j] != y {
                continue;
            }
            if let Some(row) = limits.get(k).and_then(|limit| limit.position()) {
                let p = one_product(library.rows(), row, 0, ring);
                out.set(target.first[0] + i, target.first[1] + j, p.to_vec().to_array());
            }
        }
    }

    /// Where the upper halves of the target's parameters begin.
    #[inline(always)]
    pub(super) fn middle(&self, target: &Target) -> (usize, usize) {
        let split = |(a, b): (usize, usize)| a + self.params[a..b].partition_point(|&t| t < 0.5);
        (split(target.us), split(target.vs))
    }

    /// The part of a target in quarter `k`, one of [`quarters_of`] it, its parameters pushed as the quarter sees them.
    #[inline(always)]
    pub(super) fn quarter_target(&mut self, target: &Target, middle: (usize, usize), k: usize) -> Target {
        let (x, y) = quarter(k);
        let us = if x == 0.0 { (target.us.0, middle.0) } else { (middle.0, target.us.1) };
        let vs = if y == 0.0 { (target.vs.0, middle.1) } else { (middle.1, target.vs.1) };
        let first = [target.first[0] + us.0 - target.us.0, target.first[1] + vs.0 - target.vs.0];
        let us = self.push_params(us, x);
        let vs = self.push_params(vs, y);
        Target { us, vs, first }
    }

    pub(super) fn n_params(&self) -> usize {
        self.params.len()
    }

    pub(super) fn truncate_params(&mut self, n: usize) {
        self.params.truncate(n);
    }

    fn fill(&self, target: Target, p: Point, out: &mut PointGrid) {
        for j in 0..target.vs.1 - target.vs.0 {
            for i in 0..target.us.1 - target.us.0 {
                out.set(target.first[0] + i, target.first[1] + j, p.to_vec().to_array());
            }
        }
    }

    /// Pushes the refined points; returns where they start.
    pub(super) fn refine(&mut self, library: &PlanLibrary, step: Step, ring: usize) -> usize {
        let start = self.points.len();
        self.points.resize(start + step.rows.len(), Point::ZERO);
        let (points, out) = self.points.split_at_mut(start);
        refined_points(library.rows(), step, &points[ring..], out);
        start
    }

    /// Pushes the ring of a child out of all refined points; returns where it starts.
    pub(super) fn push_child(&mut self, library: &PlanLibrary, child: &Child, refined: usize) -> usize {
        let start = self.points.len();
        self.points.resize(start + child.points.len(), Point::ZERO);
        let (points, out) = self.points.split_at_mut(start);
        library.rows().gather(child.points, &points[refined..], out);
        start
    }

    /// Pushes the ring of the only child that is wanted; returns where it starts.
    pub(super) fn refine_child(&mut self, library: &PlanLibrary, step: Step, child: &Child, ring: usize) -> usize {
        if step.pole.is_some() {
            let refined = self.refine(library, step, ring);
            return self.push_child(library, child, refined);
        }
        let start = self.points.len();
        self.points.resize(start + child.points.len(), Point::ZERO);
        let (points, out) = self.points.split_at_mut(start);
        child_points(library.rows(), step, child, &points[ring..], out);
        start
    }

    /// Pushes parameters as a quarter sees them; exact in floating point.
    fn push_params(&mut self, (a, b): (usize, usize), offset: f64) -> (usize, usize) {
        let start = self.params.len();
        for i in a..b {
            let t = 2.0 * self.params[i] - offset;
            self.params.push(t);
        }
        (start, self.params.len())
    }

    fn regular(&mut self, control: &ControlPoints, target: Target, out: &mut PointGrid) {
        let (u, v) = (&self.params[target.us.0..target.us.1], &self.params[target.vs.0..target.vs.1]);
        let [of_u, of_v] = &mut self.basis;
        let (u, v) = (of_u.get(u), of_v.get(v));
        simd::run(regular::Positions { control, u, v, out, first: target.first });
    }

    /// Position and tangents at one point of a patch whose parts are kept: the same, to the bit, as if they were found
    /// anew.
    pub(super) fn sample_parts(
        &mut self,
        library: &PlanLibrary,
        parts: &mut Parts,
        [mut u, mut v]: [f64; 2],
    ) -> SurfaceSample {
        let (mut part, mut depth) = (0, 0);
        loop {
            if let Some(control) = parts.control(part) {
                return regular_sample(control, u, v, f64::from(depth).exp2());
            }
            // A corner may have a limit of its own.
            let quarters = if exact_corner(u, v).is_some() { None } else { parts.quarters(library, part) };
            let Some(first) = quarters else {
                return self.sample_part(library, parts.node(part), parts.points(part), [u, v], depth);
            };
            let (k, place) = quarter_at(u, v);
            (part, depth, [u, v]) = (first + k, depth + 1, place);
        }
    }

    /// Position and tangents at one point of a node that is `depth` splits below the patch.
    pub(super) fn sample_part(
        &mut self,
        library: &PlanLibrary,
        node: NodeId,
        ring: &[Point],
        [mut u, mut v]: [f64; 2],
        depth: u32,
    ) -> SurfaceSample {
        let (mut node, mut ring) = (node, self.start_ring(ring));
        let mut scale = f64::from(depth).exp2();
        // What dicing takes, which comes no further than to the first limit.
        let mut position = None;
        let found_at = |sample: SurfaceSample, position: Option<DVec3>| SurfaceSample {
            position: position.unwrap_or(sample.position),
            ..sample
        };
        for depth in depth.. {
            match library.plan(node) {
                Plan::Regular(rows, turn) => {
                    let control = control_points(library.rows(), rows, turn, &self.points[ring..]);
                    return found_at(regular_sample(&control, u, v, scale), position);
                }
                Plan::Split { step, children, limits, .. } => {
                    let corner =
                        if depth < MAX_DEPTH { exact_corner(u, v) } else { exact_corner(u.round(), v.round()) };
                    let limit = corner.and_then(|k| limits.get(k));
                    if let Some(sample) =
                        limit.and_then(|limit| limit_sample(library, limit, limits.turn, &self.points[ring..]))
                    {
                        return found_at(sample, position);
                    }
                    if let (None, Some(Limit::Below(row))) = (position, limit) {
                        position = Some(one_product(library.rows(), row, 0, &self.points[ring..]).to_vec());
                    }
                    let (k, place) = quarter_at(u, v);
                    let child = children.get(k);
                    ring = self.refine_child(library, step, &child, ring);
                    node = child.node;
                    [u, v] = place;
                    scale *= 2.0;
                }
            }
        }
        unreachable!("every walk ends in a regular part or a corner")
    }

    /// Appends to a polygon's ring points those of its refinement, which all its children share.
    pub fn refine_polygon(library: &PlanLibrary, node: NodeId, points: &mut Vec<Point>) {
        let (rows, _) = polygon(library, node);
        for i in 0..rows.len() {
            // After row 0 the slice ends with the face point, where other rows look for it.
            let refined = one_product(library.rows(), rows, i, points);
            points.push(refined);
        }
    }

    /// The ring points of a child of a polygon, in place of what was in `out`; `points` are those of
    /// [`Self::refine_polygon`].
    pub fn child_ring(library: &PlanLibrary, node: NodeId, points: &[Point], k: usize, out: &mut Vec<Point>) -> NodeId {
        let child = polygon(library, node).1.get(k);
        let refined = &points[library.n_points(node)..];
        out.clear();
        out.resize(child.points.len(), Point::ZERO);
        library.rows().gather(child.points, refined, out);
        child.node
    }
}

fn polygon(library: &PlanLibrary, node: NodeId) -> (SparseRows, Children<'_>) {
    match library.plan(node) {
        Plan::Split { step, children, .. } => (step.rows, children),
        Plan::Regular(..) => unreachable!("a polygon is never regular"),
    }
}

/// The quarters in which a target has points, as bits. `middle` is [`Evaluator::middle`].
pub(super) fn quarters_of(target: &Target, middle: (usize, usize)) -> u32 {
    let (lower_u, upper_u) = (target.us.0 < middle.0, middle.0 < target.us.1);
    let (lower_v, upper_v) = (target.vs.0 < middle.1, middle.1 < target.vs.1);
    let bits = [lower_u && lower_v, upper_u && lower_v, upper_u && upper_v, lower_u && upper_v];
    (0..4).fold(0, |m, k| m | (u32::from(bits[k]) << k))
}

/// The quarter that a place lies in, and where.
fn quarter_at(u: f64, v: f64) -> (usize, [f64; 2]) {
    let (x, y) = (f64::from(u8::from(u >= 0.5)), f64::from(u8::from(v >= 0.5)));
    (exact_corner(x, y).expect("halves are corners"), [2.0 * u - x, 2.0 * v - y])
}

fn regular_sample(control: &ControlPoints, u: f64, v: f64, scale: f64) -> SurfaceSample {
    let [position, du, dv] = simd::run(regular::PointAndTangents { control, u, v }).map(Point::to_vec);
    SurfaceSample { position, du: scale * du, dv: scale * dv, kind: SampleKind::Regular }
}

/// Position and tangents of a regular patch.
pub fn sample_regular(control: &ControlPoints, u: f64, v: f64) -> SurfaceSample {
    regular_sample(control, u, v, 1.0)
}

fn limit_sample(library: &PlanLibrary, limit: Limit, turn: u32, points: &[Point]) -> Option<SurfaceSample> {
    let at = |rows: SparseRows, i| one_product(library.rows(), rows, i, points).to_vec();
    match limit {
        Limit::Regular | Limit::Below(_) => None,
        Limit::Position(rows) => Some(SurfaceSample {
            position: at(rows, 0),
            du: DVec3::ZERO,
            dv: DVec3::ZERO,
            kind: SampleKind::PositionOnly,
        }),
        Limit::Smooth(rows) => {
            let along = [at(rows, 1).normalize_or_zero(), at(rows, 2).normalize_or_zero()];
            // A turn takes u to where v was.
            let [du, dv] = (0..turn).fold(along, |[du, dv], _| [-dv, du]);
            Some(SurfaceSample { position: at(rows, 0), du, dv, kind: SampleKind::Extraordinary })
        }
    }
}
