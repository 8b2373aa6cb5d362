//! What is known of an irregular patch: the parts its plan has split it into so far, with their points.
//!
//! The boxes of a patch's node and each of its pieces walk down the same plan towards the same corner. So what one of
//! them has found stays as long as the patch is remembered, and the next one starts from there.

use super::eval::Point;
use super::plan::{Child, NodeId, Plan, PlanLibrary};
use super::products::{control_points, push_listed_control, refined_points};
use super::regular::ControlPoints;
use glam::DVec3;

/// Across a quad, of any length: on the side from which it is counter-clockwise.
#[inline(always)]
pub fn across([a, b, c, d]: [DVec3; 4]) -> DVec3 {
    (c - a).cross(d - b)
}

/// Parts that are kept. A corner needs four a level, a crease four times as many on each level; what is beyond is found
/// again each time.
const MOST_PARTS: usize = 64;

/// The quadtree of a patch, as far as it has been asked for. Part 0 is the patch.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// The ring of the patch, then points of parts.
    points: Vec<Point>,
    parts: Vec<Part>,
    /// Refined points of the part that is split.
    scratch: Vec<Point>,
}

#[derive(Clone, Copy, Debug)]
struct Part {
    node: NodeId,
    /// Its points: control points if it is regular, else its ring.
    first: u32,
    n_points: u32,
    is_regular: bool,
    /// The first of its four quarters, or 0.
    quarters: u32,
}

impl Parts {
    /// Forgets everything; what is put here is the ring of the patch that [`begin`](Self::begin) tells of.
    pub fn new_ring(&mut self) -> &mut Vec<Point> {
        self.parts.clear();
        self.points.clear();
        &mut self.points
    }

    /// The patch of the ring starts at `node`.
    pub fn begin(&mut self, library: &PlanLibrary, node: NodeId) {
        let part = Part { node, first: 0, n_points: self.points.len() as u32, is_regular: false, quarters: 0 };
        self.parts.push(match library.plan(node) {
            Plan::Regular(rows, turn) => {
                let control = control_points(library.rows(), rows, turn, &self.points);
                self.points.extend(control);
                Part { first: part.n_points, n_points: 16, is_regular: true, ..part }
            }
            Plan::Split { .. } => part,
        });
    }

    /// The node of a part.
    pub fn node(&self, part: usize) -> NodeId {
        self.parts[part].node
    }

    /// The control points of a part, if it is regular.
    pub fn control(&self, part: usize) -> Option<&ControlPoints> {
        self.parts[part].is_regular.then(|| self.points(part).as_array().expect("16 points"))
    }

    /// The ring of a part, or its control points.
    pub fn points(&self, part: usize) -> &[Point] {
        let Part { first, n_points, .. } = self.parts[part];
        &self.points[first as usize..][..n_points as usize]
    }

    /// Across the quad of an irregular part's corners, which are the first points of its ring, of any length. (A face
    /// that meets itself may have fewer points.)
    pub fn normal(&self, part: usize) -> DVec3 {
        self.points(part).first_chunk().map_or(DVec3::ZERO, |corners| across(corners.map(Point::to_vec)))
    }

    /// The first of an irregular part's four quarters, which follow each other; `None` if there are too many parts.
    pub fn quarters(&mut self, library: &PlanLibrary, part: usize) -> Option<usize> {
        let known = self.parts[part].quarters as usize;
        if known == 0 && self.parts.len() + 4 <= MOST_PARTS {
            Some(self.split(library, part))
        } else {
            (known != 0).then_some(known)
        }
    }

    fn split(&mut self, library: &PlanLibrary, part: usize) -> usize {
        let Plan::Split { step, children, .. } = library.plan(self.parts[part].node) else {
            unreachable!("a regular part is not split")
        };
        self.scratch.resize(step.rows.len(), Point::ZERO);
        let Part { first, n_points, .. } = self.parts[part];
        refined_points(library.rows(), step, &self.points[first as usize..][..n_points as usize], &mut self.scratch);
        let quarters = self.parts.len();
        self.parts[part].quarters = quarters as u32;
        for child in (0..4).map(|k| children.get(k)) {
            let part = self.push_quarter(library, &child);
            self.parts.push(part);
        }
        quarters
    }

    /// Pushes the points of a quarter; those of the whole are in `scratch`.
    fn push_quarter(&mut self, library: &PlanLibrary, child: &Child) -> Part {
        let first = self.points.len();
        let (store, plan) = (library.rows(), library.plan(child.node));
        match plan {
            Plan::Regular(rows, turn) if rows.is_empty() => {
                push_listed_control(store, child.points, turn, &self.scratch, &mut self.points);
            }
            Plan::Regular(rows, turn) => {
                store.gather_to(child.points, &self.scratch, &mut self.points);
                let control = control_points(store, rows, turn, &self.points[first..]);
                self.points.truncate(first);
                self.points.extend_from_slice(&control);
            }
            Plan::Split { .. } => store.gather_to(child.points, &self.scratch, &mut self.points),
        }
        let n_points = (self.points.len() - first) as u32;
        let is_regular = matches!(plan, Plan::Regular(..));
        Part { node: child.node, first: first as u32, n_points, is_regular, quarters: 0 }
    }
}
