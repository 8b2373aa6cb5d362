//! Hierarchical edits: found by place, applied when their level has been computed.

use super::{INFINITE, Place, RefinedMesh};
use crate::mesh::{ControlMesh, Edit, EditKind, EditValue};

/// An edit with its path turned into a place.
#[derive(Clone, Debug)]
pub(super) struct PlacedEdit {
    n_steps: u32,
    pub(super) place: Place,
    kind: EditKind,
    /// Vertex or edge of the face; 0 for face edits.
    element: usize,
    value: EditValue,
}

impl PlacedEdit {
    pub(super) fn new(edit: &Edit, control: &ControlMesh) -> Self {
        let mut place = Place { face: edit.face(), sub: 0, level: 0, i: 0, j: 0 };
        let mut children = edit.children();
        if control.face_sizes[edit.face().idx()] != 4
            && let [sub, rest @ ..] = children
        {
            (place.sub, children) = (*sub, rest);
        }
        PlacedEdit {
            n_steps: edit.children().len() as u32,
            place: children.iter().fold(place, |place, &k| place.child(k)),
            kind: edit.kind,
            element: edit.element().unwrap_or(0) as usize,
            value: edit.value,
        }
    }
}

impl Place {
    /// Whether `other` is this cell or lies in it.
    fn contains(&self, other: &Place) -> bool {
        let Some(deeper) = other.level.checked_sub(self.level) else { return false };
        self.face == other.face && self.sub == other.sub && self.i == other.i >> deeper && self.j == other.j >> deeper
    }
}

impl RefinedMesh<'_> {
    /// Applies the edits of this step.
    pub(super) fn apply_edits(&mut self) {
        let edits = self.edits.clone();
        let n_steps = self.n_steps;
        for edit in edits.iter().filter(|e| e.n_steps == n_steps) {
            if let Some(face) = self.faces.iter().position(|f| f.place == edit.place) {
                self.apply_edit(face, edit);
            }
        }
    }

    fn apply_edit(&mut self, face: usize, edit: &PlacedEdit) {
        if edit.kind == EditKind::Face {
            self.faces[face].hole = true;
            return;
        }
        let corner = self.corners(face)[edit.element];
        let vertex = &mut self.vertices[corner.vertex as usize];
        let edge = &mut self.edges[corner.edge as usize];
        let (sharpness, pinned) = match edit.kind {
            EditKind::Edge => (&mut edge.sharpness, edge.pinned),
            _ => (&mut vertex.sharpness, vertex.pinned),
        };
        match edit.value {
            EditValue::AddPosition(p) => vertex.position += p,
            EditValue::SetPosition(p) => vertex.position = p,
            EditValue::AddSharpness(s) if !pinned => *sharpness = (*sharpness + s).clamp(0.0, INFINITE),
            EditValue::SetSharpness(s) if !pinned => *sharpness = s.clamp(0.0, INFINITE),
            EditValue::AddSharpness(_) | EditValue::SetSharpness(_) | EditValue::Hole => {}
        }
    }

    /// Whether a later step's edit lies in this face.
    pub(super) fn awaits_edit(&self, face: usize) -> bool {
        let place = self.faces[face].place;
        self.edits.iter().any(|e| e.n_steps > self.n_steps && place.contains(&e.place))
    }
}
