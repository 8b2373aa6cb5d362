//! Evaluating patches under edits: down the quadtree, then as any plan.

use super::EditTree;
use crate::math::PointGrid;
use crate::subdiv::eval::{Evaluator, LEFT_FIRST, SurfaceSample, Target, quarter, quarters_of};
use crate::subdiv::extent::{AskedPart, Extent};
use crate::subdiv::plan::PlanLibrary;

impl Evaluator {
    /// As `grid` for a patch under edits.
    pub fn edited_grid(
        &mut self,
        library: &PlanLibrary,
        tree: &EditTree,
        us: impl IntoIterator<Item = f64>,
        vs: impl IntoIterator<Item = f64>,
        out: &mut PointGrid,
    ) {
        let target = self.start_grid(us, vs, out);
        self.walk_tree(library, tree, 0, target, out);
    }

    fn walk_tree(&mut self, library: &PlanLibrary, tree: &EditTree, depth: u32, target: Target, out: &mut PointGrid) {
        match tree {
            EditTree::Rest { node, ring } => {
                let ring = self.start_ring(ring);
                self.walk(library, *node, ring, depth, target, out);
            }
            EditTree::Split(quarters) => {
                let middle = self.middle(&target);
                let wanted = quarters_of(&target, middle);
                for (k, tree) in LEFT_FIRST.map(|k| (k, &quarters[k])).into_iter().filter(|(k, _)| wanted >> k & 1 == 1)
                {
                    let mark = self.n_params();
                    let part = self.quarter_target(&target, middle, k);
                    self.walk_tree(library, tree, depth + 1, part, out);
                    self.truncate_params(mark);
                }
            }
        }
    }

    /// Position and tangents at one point of a patch under edits.
    pub fn edited_sample(&mut self, library: &PlanLibrary, tree: &EditTree, u: f64, v: f64) -> SurfaceSample {
        let (mut tree, mut u, mut v, mut depth) = (tree, u, v, 0);
        loop {
            match tree {
                EditTree::Rest { node, ring } => return self.sample_part(library, *node, ring, [u, v], depth),
                EditTree::Split(quarters) => {
                    let k = usize::from(u >= 0.5) ^ if v >= 0.5 { 3 } else { 0 };
                    let (x, y) = quarter(k);
                    (tree, u, v) = (&quarters[k], 2.0 * u - x, 2.0 * v - y);
                    depth += 1;
                }
            }
        }
    }

    /// As `bounds` for a patch under edits.
    pub fn edited_bounds(&mut self, library: &PlanLibrary, tree: &EditTree, asked: AskedPart) -> Extent {
        match tree {
            EditTree::Rest { node, ring } => self.bounds(library, *node, ring, asked),
            EditTree::Split(quarters) => asked.in_quarters().fold(Extent::EMPTY, |bounds, (k, asked)| {
                bounds.union(self.edited_bounds(library, &quarters[k], asked))
            }),
        }
    }
}
