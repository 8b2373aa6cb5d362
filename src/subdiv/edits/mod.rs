//! Hierarchical edits: patches that are refined until their edits have taken effect.
//!
//! An edit of level l changes the mesh after l steps, so that up to there no plan holds: plans are shared, edits are
//! not. A patch **under edits** (one of its face's neighbours has an edit inside) keeps an [`EditTree`] instead: a
//! quadtree that splits while an edit is **pending** in the ring, with ring points computed once. Where it ends, an
//! ordinary node of the [`PlanLibrary`] goes on, and nothing is left to know about edits. A **hole** is a quadtree cell
//! without surface.
//!
//! ```text
//!   patch ─▶ EditTree::Split ─▶ 4 quarters ─▶ ... ─▶ EditTree::Rest { ring points, node } ─▶ plan
//! ```
//!
//! # Invariants
//! 1. The value at (u, v) depends on (u, v) alone: on inner borders, the quarter with the larger u and v decides.
//! 2. Edits of level 0 are no business of this module: they are part of the control points and of the topology.
//! 3. A hole's border runs along borders of grid pieces.
//!
//! Meaning of edits: RISpec 3.2, [`crate::mesh::Edit`]; [`super::refine`] is the slow reference, measured against hbr.

mod evaluate;
mod holes;
mod ring;
mod sites;
mod trie;

use super::eval::Point;
use super::plan::{NodeId, PlanLibrary};
use super::rates::PatchRates;
use super::surface::Lattice;
use crate::error::Result;
use crate::ids::{FaceId, PatchId};
use crate::math::DBounds;
use crate::mesh::{ControlMesh, EditValue};
use crate::topology::Topology;
use glam::DVec3;
use holes::Holes;
use rustc_hash::FxHashMap;
pub(super) use sites::EditSites;
use std::borrow::Cow;

#[cfg(test)]
mod tests;

/// A patch under edits, or a quarter of a quarter of one.
#[derive(Debug)]
pub enum EditTree {
    /// An edit is pending.
    Split(Box<[EditTree; 4]>),
    /// No more edits: the ring's points, and the node that they belong to.
    Rest {
        /// Where the plan starts.
        node: NodeId,
        /// Its ring points, in lattice units.
        ring: Box<[Point]>,
    },
}

/// What edits make of a mesh, its level 0 left out.
#[derive(Debug, Default)]
pub struct EditedPatches {
    trees: FxHashMap<PatchId, EditTree>,
    holes: Holes,
}

/// Control points with edits of level 0.
pub(super) fn control_positions(mesh: &ControlMesh) -> Cow<'_, [DVec3]> {
    let mut positions = Cow::Borrowed(mesh.positions.as_slice());
    let mut first_corner = None;
    for edit in mesh.edits.iter().filter(|e| e.children().is_empty()) {
        let (EditValue::AddPosition(p) | EditValue::SetPosition(p)) = edit.value else { continue };
        let first = first_corner.get_or_insert_with(|| first_corners(mesh))[edit.face().idx()];
        let v = mesh.face_vertices[(first + edit.element().unwrap_or(0)) as usize].idx();
        let is_sum = matches!(edit.value, EditValue::AddPosition(_));
        let before = if is_sum { positions[v] } else { DVec3::ZERO };
        positions.to_mut()[v] = before + p;
    }
    positions
}

fn first_corners(mesh: &ControlMesh) -> Vec<u32> {
    let mut total = 0;
    let start = |&n: &u32| {
        total += n;
        total - n
    };
    mesh.face_sizes.iter().map(start).collect()
}

impl EditTree {
    fn for_each_rest(&self, visit: &mut impl FnMut(&[Point])) {
        match self {
            EditTree::Split(quarters) => quarters.iter().for_each(|q| q.for_each_rest(visit)),
            EditTree::Rest { ring, .. } => visit(ring),
        }
    }
}

impl EditedPatches {
    /// The patches of a mesh that edits concern, with control points in the space of `lattice`.
    pub(super) fn new(
        mesh: &ControlMesh,
        topology: &Topology,
        sites: &EditSites,
        library: &mut PlanLibrary,
        lattice: Lattice,
        control_point: &dyn Fn(u32) -> Point,
        patch_of: impl Fn(FaceId, u32) -> PatchId + Copy,
    ) -> Result<Self> {
        let holes = Holes::new(mesh, topology, patch_of)?;
        let trees = sites.trees(&mesh.edits, topology, lattice, library, control_point, patch_of);
        Ok(EditedPatches { trees, holes })
    }

    /// The box of all ring points, which holds the edited surface.
    pub(super) fn bounds(&self) -> DBounds {
        let mut bounds = DBounds::EMPTY;
        self.for_each_rest(|ring| ring.iter().for_each(|p| bounds.grow(p.to_vec())));
        bounds
    }

    fn for_each_rest(&self, mut visit: impl FnMut(&[Point])) {
        self.trees.values().for_each(|tree| tree.for_each_rest(&mut visit));
    }

    /// The tree of a patch under edits.
    pub(super) fn tree(&self, patch: PatchId) -> &EditTree {
        self.trees.get(&patch).expect("every patch of a face under edits has a tree")
    }

    /// Powers of two that divide the rate of an edge, of edges inside a polygon, and the cells of a patch.
    pub(super) fn edge_unit(&self, topology: &Topology, h: u32) -> u32 {
        self.holes.edge_unit(topology, h)
    }

    /// See [`edge_unit`](Self::edge_unit).
    pub(super) fn inner_unit(&self, face: FaceId) -> u32 {
        self.holes.inner_unit(face)
    }

    /// See [`edge_unit`](Self::edge_unit).
    pub(super) fn cell_unit(&self, patch: PatchId) -> u32 {
        self.holes.cell_unit(patch)
    }

    /// Whether there are edits of points or sharpness at level 1 or deeper.
    pub fn moves_points(&self) -> bool {
        !self.trees.is_empty()
    }

    /// Whether there are holes at level 1 or deeper.
    pub fn has_holes(&self) -> bool {
        !self.holes.is_empty()
    }

    /// Whether holes take the whole patch.
    pub fn hide(&self, patch: PatchId) -> bool {
        self.has_holes() && self.holes.hide(patch)
    }

    /// Whether (u, v) lies in a hole; borders belong to the cell with the larger u and v.
    pub fn hide_point(&self, patch: PatchId, u: f64, v: f64) -> bool {
        self.holes.contain(patch, u, v)
    }

    /// Whether all the cells `i[0]..i[1]` by `j[0]..j[1]` of a patch's grid lie in holes.
    pub fn hide_cells(&self, patch: PatchId, rates: &PatchRates, i: [u32; 2], j: [u32; 2]) -> bool {
        self.holes.hide_cells(patch, rates, i, j)
    }

    /// Whether cell `j n_u + i` of a patch's grid lies in a hole.
    pub fn hide_cell(&self, patch: PatchId, rates: &PatchRates, cell: u32) -> bool {
        let (i, j) = (cell % rates.n_u, cell / rates.n_u);
        self.hide_cells(patch, rates, [i, i + 1], [j, j + 1])
    }

    /// Of the cells `i[0]..i[1]` by `j[0]..j[1]` of a patch's grid, those that lie in holes.
    pub fn n_hidden_cells(&self, patch: PatchId, rates: &PatchRates, i: [u32; 2], j: [u32; 2]) -> u64 {
        self.holes.n_hidden_cells(patch, rates, i, j)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let mut bytes = self.holes.bytes() + 40 * self.trees.capacity();
        // Four thirds: a split for every three of its ends.
        self.for_each_rest(|ring| bytes += size_of_val(ring) + size_of::<EditTree>() * 4 / 3);
        bytes
    }
}
