//! Conservative boxes of parts of patches, and bounds of their heights, without evaluating them.

use super::eval::{Evaluator, Point, quarter, sample_regular};
use super::extent::{AskedPart, Extent, PartExtent, WHOLE, with_heights};
use super::parts::Parts;
use super::plan::{NodeId, Plan, PlanLibrary, Step};
use super::pole::{self, MOST_REFINED, PoleHull};
use super::products::control_points;
use super::regular::{self, BezierWeights, ControlPoints, GridHulls, MOST_PARTS, bezier_weights};
use super::rows::Width;
use crate::math::{Plate, simd};
use glam::DVec3;

/// Steps that a pole's hull goes deeper than others: they take little there. Below its regular quarters the ring of the
/// last one stands out on all sides, and boxes and plates are as much too thick. Rays look up 0.94 (bigguy, trex) and
/// 0.91 (monsterfrog) of what they look up without, at rate 8, and preparing trex takes no longer.
const MORE_AT_POLES: u32 = 2;

/// Weights of the last ranges along u and along v.
pub(super) type HullWeights = [RangeWeights; 2];

/// Ranges that are remembered, by their ends in quarters: the whole, its halves and its quarters have places of their
/// own, but for one.
const N_RANGES: usize = 8;

/// Weights of the last parameter ranges: the parts of a patch have ranges in common, and most patches the same ones.
#[derive(Debug)]
pub(super) struct RangeWeights {
    ranges: [[f64; 2]; N_RANGES],
    weights: [BezierWeights; N_RANGES],
}

impl Default for RangeWeights {
    fn default() -> Self {
        Self { ranges: [[0.0, 1.0]; N_RANGES], weights: [bezier_weights([0.0, 1.0]); N_RANGES] }
    }
}

impl RangeWeights {
    #[inline(always)]
    fn get(&mut self, range: [f64; 2]) -> &BezierWeights {
        let place = ((4.0 * range[0]) as usize ^ (4.0 * range[1]) as usize) % N_RANGES;
        if self.ranges[place] != range {
            self.ranges[place] = range;
            self.weights[place] = bezier_weights(range);
        }
        &self.weights[place]
    }
}

impl Evaluator {
    /// A box that holds a part of the patch, and heights along a normal: the Bézier hulls of its regular parts, and
    /// hulls of rings as deep as is asked for, or where the surface is known to lie in them.
    pub(super) fn parts_bounds(&mut self, library: &PlanLibrary, parts: &mut Parts, asked: AskedPart) -> Extent {
        let mut bounds = Extent::EMPTY;
        self.bound_parts(library, parts, 0, asked, &mut bounds);
        bounds
    }

    /// As [`parts_bounds`](Self::parts_bounds) for a part of the patch, of which a part is asked for.
    fn bound_parts(
        &mut self,
        library: &PlanLibrary,
        parts: &mut Parts,
        part: usize,
        asked: AskedPart,
        bounds: &mut Extent,
    ) {
        let AskedPart { range, normal, depth } = asked;
        if let Some(control) = parts.control(part) {
            return self.grow_by_hull(bounds, &with_heights(control, normal), range);
        }
        let node = parts.node(part);
        if depth == 0 && matches!(library.plan(node), Plan::Split { in_hull: true, .. }) {
            return parts.points(part).iter().for_each(|p| bounds.grow(p.with_height(normal)));
        }
        if let (true, Some([low, high])) =
            (asked.is_whole(), self.pole_hull(library, node, parts.points(part), normal, depth + MORE_AT_POLES))
        {
            bounds.grow(low);
            bounds.grow(high);
            return;
        }
        let Some(first) = parts.quarters(library, part) else {
            let ring = self.start_measured_ring(parts.points(part), normal);
            return self.bound(library, node, ring, asked, bounds);
        };
        for (k, asked) in asked.in_quarters() {
            self.bound_parts(library, parts, first + k, asked, bounds);
        }
    }

    /// As [`parts_bounds`](Self::parts_bounds) of a ring, of which nothing is kept.
    pub(super) fn bounds(&mut self, library: &PlanLibrary, node: NodeId, ring: &[Point], asked: AskedPart) -> Extent {
        let ring = self.start_measured_ring(ring, asked.normal);
        let mut bounds = Extent::EMPTY;
        self.bound(library, node, ring, asked, &mut bounds);
        bounds
    }

    /// As `start_ring`, with heights.
    fn start_measured_ring(&mut self, ring: &[Point], normal: [i8; 3]) -> usize {
        self.points.clear();
        self.points.extend(ring.iter().map(|p| p.with_height(normal)));
        0
    }

    /// As `bound_parts` of a ring with heights.
    fn bound(&mut self, library: &PlanLibrary, node: NodeId, ring: usize, asked: AskedPart, bounds: &mut Extent) {
        match library.plan(node) {
            Plan::Regular(rows, turn) => {
                let control = control_points(library.rows(), rows, turn, &self.points[ring..]);
                self.grow_by_hull(bounds, &control, asked.range);
            }
            Plan::Split { in_hull: true, .. } if asked.depth == 0 => {
                let n = library.n_points(node);
                self.points[ring..ring + n].iter().for_each(|p| bounds.grow(*p));
            }
            Plan::Split { step, children, .. } => {
                let start = self.points.len();
                let is_in_one = asked.in_quarters().count() == 1;
                let refined = if is_in_one { None } else { Some(self.refine(library, step, ring)) };
                let mark = self.points.len();
                for (k, asked) in asked.in_quarters() {
                    let child = &children.get(k);
                    let child_ring = match refined {
                        Some(refined) => self.push_child(library, child, refined),
                        None => self.refine_child(library, step, child, ring),
                    };
                    self.bound(library, child.node, child_ring, asked, bounds);
                    self.points.truncate(mark);
                }
                self.points.truncate(start);
            }
        }
    }

    /// How far a part of a regular patch reaches: the Bézier hull, of the whole patch those of its four quarters, which
    /// bulge less. (Rays look up 0.95 of what they look up with one hull at rate 8 on bigguy, 0.96 on trex.) `control`
    /// has heights.
    pub fn regular_extent(&mut self, control: &ControlPoints, range: [[f64; 2]; 2]) -> Extent {
        let mut extent = Extent::EMPTY;
        if range == WHOLE {
            let [of_u, of_v] = &mut self.hulls;
            let quarters = simd::run(regular::QuarterHulls { control, u: of_u.get(range[0]), v: of_v.get(range[1]) });
            quarters.iter().for_each(|p| extent.grow(*p));
        } else {
            self.grow_by_hull(&mut extent, control, range);
        }
        extent
    }

    /// Enlarges `bounds` by the Bézier hull of a part of a regular patch. `control` has heights.
    pub fn grow_by_hull(&mut self, bounds: &mut Extent, control: &ControlPoints, range: [[f64; 2]; 2]) {
        let [of_u, of_v] = &mut self.hulls;
        let hull = match range {
            WHOLE => simd::run(regular::WholeHull { control }),
            [u, v] => simd::run(regular::Hull { control, u: of_u.get(u), v: of_v.get(v) }),
        };
        hull.iter().for_each(|p| bounds.grow(*p));
    }
}

/// How far equal parts reach: part (a, b) at `MOST_PARTS * b + a`.
pub(super) type GridExtents = [PartExtent; MOST_PARTS * MOST_PARTS];

/// Equal parts of a rectangle of a patch, asked for together, with heights along normals of their own.
#[derive(Clone, Copy)]
pub(super) struct AskedGrid {
    /// Parameters of the rectangle.
    pub range: [[f64; 2]; 2],
    /// Parts a side: 1, 2 or 4.
    pub side: usize,
    /// As for each part alone.
    pub depth: u32,
}

impl Evaluator {
    /// How far equal parts of an irregular patch reach, of the patch or of a quarter of a quarter and so on. Returns
    /// whether it could be done.
    pub(super) fn grid_of_parts(
        &mut self,
        library: &PlanLibrary,
        parts: &mut Parts,
        asked: AskedGrid,
        out: &mut GridExtents,
    ) -> bool {
        self.bound_grid(library, parts, 0, asked, out)
    }

    /// As [`grid_of_parts`](Self::grid_of_parts) for a part of the patch.
    fn bound_grid(
        &mut self,
        library: &PlanLibrary,
        parts: &mut Parts,
        part: usize,
        asked: AskedGrid,
        out: &mut [PartExtent],
    ) -> bool {
        let AskedGrid { range: [u, v], side, depth } = asked;
        if side == 1 {
            let normal = Plate::normal_along(match parts.control(part) {
                Some(control) => normal_in_the_middle(control, u, v),
                None => parts.normal(part),
            });
            out[0] = PartExtent { normal, ..PartExtent::EMPTY };
            let asked = AskedPart { range: [u, v], normal, depth };
            self.bound_parts(library, parts, part, asked, &mut out[0].extent);
            return true;
        }
        if let Some(control) = parts.control(part) {
            self.regular_grid_of_parts(control, asked, out);
            return true;
        }
        let Some(quarters) = parts.quarters(library, part) else { return false };
        let depth = depth.saturating_sub(1);
        if [u, v] == WHOLE {
            let asked = AskedGrid { side: side / 2, depth, ..asked };
            return (0..4).all(|k| {
                let (x, y) = quarter(k);
                let first = asked.side * (x as usize + MOST_PARTS * y as usize);
                self.bound_grid(library, parts, quarters + k, asked, &mut out[first..])
            });
        }
        let k = usize::from(u[0] >= 0.5) ^ if v[0] >= 0.5 { 3 } else { 0 };
        let (x, y) = quarter(k);
        let range = [u.map(|t| 2.0 * t - x), v.map(|t| 2.0 * t - y)];
        let is_inside = range.iter().all(|[_, end]| *end <= 1.0);
        is_inside && self.bound_grid(library, parts, quarters + k, AskedGrid { range, side, depth }, out)
    }

    /// As [`grid_of_parts`](Self::grid_of_parts) for 16 control points, any rectangle, and two or four parts a side.
    pub(super) fn regular_grid_of_parts(&mut self, control: &ControlPoints, asked: AskedGrid, out: &mut [PartExtent]) {
        let [of_u, of_v] = &mut self.hulls;
        let (u, v) = (of_u.get(asked.range[0]), of_v.get(asked.range[1]));
        match asked.side {
            2 => simd::run(GridHulls::<2> { control, u, v, out }),
            _ => simd::run(GridHulls::<4> { control, u, v, out }),
        }
    }
}

impl Evaluator {
    /// The box around a whole pole, if the node is one that has no more points than there is room for.
    fn pole_hull(
        &mut self,
        library: &PlanLibrary,
        node: NodeId,
        points: &[Point],
        normal: [i8; 3],
        depth: u32,
    ) -> Option<[Point; 2]> {
        let Plan::Split { step: Step { pole: Some(order), .. }, in_hull: true, .. } = library.plan(node) else {
            return None;
        };
        if depth == 0 || order.len() > pole::MOST_POINTS {
            return None;
        }
        let ring = self.start_measured_ring(points, normal);
        let (store, scratch, points) = (library.rows(), &mut *self.pole_points.0, &self.points[ring..]);
        Some(match store.widths() {
            Width::Narrow(indices) => simd::run(PoleHull { points, ring: store.list(order, indices), depth, scratch }),
            Width::Wide(indices) => simd::run(PoleHull { points, ring: store.list(order, indices), depth, scratch }),
        })
    }
}

/// Room for the points of a pole: 4 KiB, too many to be cleared for every box.
#[derive(Debug)]
pub(super) struct PolePoints(Box<[[Point; MOST_REFINED]; 2]>);

impl Default for PolePoints {
    fn default() -> Self {
        Self(Box::new([[Point::ZERO; MOST_REFINED]; 2]))
    }
}

/// The limit normal in the middle of a part of a regular patch, of any length.
fn normal_in_the_middle(control: &ControlPoints, u: [f64; 2], v: [f64; 2]) -> DVec3 {
    let sample = sample_regular(control, 0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1]));
    sample.du.cross(sample.dv)
}
