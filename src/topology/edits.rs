//! Hierarchical edits of level 0: sharpness and holes of the control mesh itself, after the boundary rule.

use super::build::Topology;
use super::half_edges::{HalfEdges, NONE, VertexTags};
use crate::mesh::{ControlMesh, Edit, EditKind, EditValue};
use rustc_hash::FxHashSet;

/// Sharpness 10 of the rules' number range stands for "infinite".
const INFINITE_IN_EDITS: f32 = 10.0;

impl EditValue {
    /// Sharpness after the change, given that before; positions and holes change nothing.
    pub fn edited_sharpness(&self, before: f32) -> f32 {
        let after = match self {
            EditValue::AddSharpness(s) => before.min(INFINITE_IN_EDITS) + s,
            EditValue::SetSharpness(s) => *s,
            EditValue::AddPosition(_) | EditValue::SetPosition(_) | EditValue::Hole => return before,
        };
        if after >= INFINITE_IN_EDITS { f32::INFINITY } else { after.max(0.0) }
    }
}

impl VertexTags {
    /// An edge at the vertex changes its sharpness.
    pub fn replace_edge(&mut self, before: f32, after: f32) {
        if before == f32::INFINITY {
            self.n_infinite = self.n_infinite.saturating_sub(1);
        } else if let Some(i) = self.semi_sharp.iter().position(|&s| s == before) {
            self.semi_sharp.remove(i);
        }
        if after == f32::INFINITY {
            self.n_infinite += 1;
        } else if after > 0.0 {
            self.semi_sharp.push(after);
            self.semi_sharp.sort_by(f32::total_cmp);
        }
    }
}

fn level_0(mesh: &ControlMesh, kind: EditKind) -> impl Iterator<Item = (&Edit, u32)> {
    let edits = mesh.edits.iter().filter(move |e| e.kind == kind && e.children().is_empty());
    edits.map(|e| (e, e.element().unwrap_or(0)))
}

impl Topology {
    /// Where a face passes an edge again, and where an edge leads back to its vertex, that is an edge of its own. It
    /// looks the same until an edit moves the one and not the other, so under edits neither speaks for the other.
    pub(super) fn separate_passages(&mut self) {
        let mut half_edges: Vec<u32> = self.nonmanifold_edge_owner.keys().copied().collect();
        half_edges.sort_unstable();
        let mut seen = FxHashSet::default();
        for h in half_edges {
            let is_loop = self.vertex(h) == self.vertex(self.next(h));
            if is_loop || !seen.insert((self.nonmanifold_edge_owner[&h], self.face(h))) {
                self.nonmanifold_edge_owner.insert(h, h);
            }
        }
    }

    /// Sharpness of edges; boundary and non-manifold ones stay as they are.
    pub(super) fn edit_edges(&mut self, mesh: &ControlMesh) {
        for (edit, element) in level_0(mesh, EditKind::Edge) {
            let h = self.face_corners(edit.face().0).0 + element;
            if self.twin(h) != NONE {
                self.set_edge_sharpness(h, edit.value.edited_sharpness(self.edge_sharpness(h)));
            }
        }
    }

    /// Sharpness of vertices; those that are corners for being non-manifold stay as they are.
    pub(super) fn edit_vertices(&mut self, mesh: &ControlMesh) {
        for (edit, element) in level_0(mesh, EditKind::Vertex) {
            let h = self.face_corners(edit.face().0).0 + element;
            let tags = self.vertex_tags(h);
            let after = edit.value.edited_sharpness(tags.sharpness);
            if !tags.is_pinned && after != tags.sharpness {
                self.edit_vertex_sharpness(self.vertex(h), after);
            }
        }
    }
}
