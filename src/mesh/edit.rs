//! Hierarchical edits: changes to the refined mesh (RISpec 3.2, `t vertexedit`, `t edgeedit`, `t faceedit`).
//!
//! An edit names one **element** (vertex, edge or face) of the mesh after as many Catmull-Clark steps as its path has
//! children, and changes it there. Later steps start from the changed mesh.
//!
//! ```text
//!     quad, vertices 0 1 2 3        its children                child 1: vertex 1 is the quad's own,
//!     3───────────2                 3─────┬─────2               0 lies on edge 0, 2 on edge 1, 3 in the middle
//!     │           │                 │  3  │  2  │
//!     │           │                 ├─────┼─────┤               child i of a quad: vertex i is the parent's vertex i
//!     │           │                 │  0  │  1  │               child i of an n-gon: vertex 0 is the parent's vertex i
//!     0───────────1                 0─────┴─────1
//! ```
//!
//! Vertices of a child run as its parent's do: for child i of a quad, vertex i is the parent's vertex i, i+1 the point
//! of edge i, i+2 the face point, i+3 the point of edge i-1 (modulo 4). Children of faces that are no quads have the
//! same four points as vertices 0, 1, 2, 3. Edge e of a face goes from its vertex e to vertex e+1.

use crate::error::{Error, Result};
use crate::ids::FaceId;
use glam::DVec3;

/// What kind of element a hierarchical edit changes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum EditKind {
    /// `t vertexedit`: position or sharpness of a vertex.
    Vertex,
    /// `t edgeedit`: sharpness of an edge.
    Edge,
    /// `t faceedit`: a hole.
    Face,
}

/// The change.
///
/// `subtract` is an addition of the negated value. Sharpness is stored as a number from 0 to 10, 10 being infinite, and
/// is clamped to that range after the change: an infinitely sharp edge with -3 added has sharpness 7.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum EditValue {
    /// Add to the position (`add P value`); vertices only.
    AddPosition(DVec3),
    /// Replace the position (`set P value`); vertices only.
    SetPosition(DVec3),
    /// Add to the sharpness (`add P sharpness`); vertices and edges.
    AddSharpness(f32),
    /// Replace the sharpness (`set P sharpness`); vertices and edges.
    SetSharpness(f32),
    /// The face has no surface (`hole`); faces only. It and its children still take part as neighbours.
    Hole,
}

/// A hierarchical edit: an element of the refined mesh and a change to it.
///
/// The edits of one level are applied in file order, when that level has been computed and before the next step (those
/// of level 0 after the boundary rule). So several additions add up, and of several replacements the last one holds. An
/// element that several faces share may be named through any of them.
///
/// Boundary edges, non-manifold edges and vertices that are infinitely sharp for being non-manifold stay infinitely
/// sharp.
#[derive(Clone, PartialEq, Debug)]
pub struct Edit {
    /// Kind of element.
    pub kind: EditKind,
    /// Base face (from 0), then a child for each step, and last, for vertices and edges only, the number of the vertex
    /// or edge in the face reached. This is the tag's path without the leading length.
    pub path: Vec<u32>,
    /// The change.
    pub value: EditValue,
}

impl Edit {
    /// Most steps a path may have. At 20 a cell is 1e-6 of its patch, the limit of single precision.
    pub const MAX_LEVEL: usize = 20;

    /// The base face that the path starts at.
    pub fn face(&self) -> FaceId {
        FaceId(self.path[0])
    }

    /// Whether it changes points or sharpness after the control mesh, so that faces around it are refined one by one.
    pub fn is_refined(&self) -> bool {
        self.kind != EditKind::Face && !self.children().is_empty()
    }

    /// The child chosen in each step; its length is the level at which the edit applies.
    pub fn children(&self) -> &[u32] {
        match self.kind {
            EditKind::Face => &self.path[1..],
            EditKind::Vertex | EditKind::Edge => &self.path[1..self.path.len() - 1],
        }
    }

    /// The vertex or edge in the face reached; none for face edits.
    pub fn element(&self) -> Option<u32> {
        match self.kind {
            EditKind::Face => None,
            EditKind::Vertex | EditKind::Edge => self.path.last().copied(),
        }
    }

    /// Checks the path against the base faces' sizes, and the value against the kind.
    pub fn validate(&self, face_sizes: &[u32]) -> Result<()> {
        let tag = self.tag();
        let min_len = if self.kind == EditKind::Face { 1 } else { 2 };
        if self.path.len() < min_len {
            return Err(Error::input(format!(
                "a path of `t {tag}` has {} numbers; it needs at least {min_len}",
                self.path.len()
            )));
        }
        let Some(&face_size) = face_sizes.get(self.face().idx()) else {
            return Err(Error::input(format!("`t {tag}` names face {} (from 0) of {}", self.face(), face_sizes.len())));
        };
        self.validate_path(face_size)?;
        self.validate_value()
    }

    fn validate_path(&self, face_size: u32) -> Result<()> {
        let tag = self.tag();
        let children = self.children();
        if children.len() > Self::MAX_LEVEL {
            let max = Self::MAX_LEVEL;
            return Err(Error::input(format!(
                "a path of `t {tag}` goes {} levels deep; at most {max} work",
                children.len()
            )));
        }
        let mut n = face_size;
        for &number in children.iter().chain(self.element().as_ref()) {
            if number >= n {
                let path = &self.path;
                return Err(Error::input(format!(
                    "`t {tag}` has the number {number} in path {path:?}, of 0 to {}",
                    n - 1
                )));
            }
            n = 4;
        }
        Ok(())
    }

    fn validate_value(&self) -> Result<()> {
        let (fits, finite) = match self.value {
            EditValue::AddPosition(p) | EditValue::SetPosition(p) => {
                (self.kind == EditKind::Vertex, p.is_finite() && p.abs().max_element() <= 1e30)
            }
            EditValue::AddSharpness(s) | EditValue::SetSharpness(s) => (self.kind != EditKind::Face, !s.is_nan()),
            EditValue::Hole => (self.kind == EditKind::Face, true),
        };
        let tag = self.tag();
        match (fits, finite) {
            (false, _) => Err(Error::input(format!("`t {tag}` cannot make this change: {:?}", self.value))),
            (_, false) => Err(Error::input(format!("`t {tag}` has a value that is not finite or beyond 1e30"))),
            _ => Ok(()),
        }
    }

    fn tag(&self) -> &'static str {
        match self.kind {
            EditKind::Vertex => "vertexedit",
            EditKind::Edge => "edgeedit",
            EditKind::Face => "faceedit",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error_of(kind: EditKind, path: &[u32], value: EditValue) -> String {
        let edit = Edit { kind, path: path.to_vec(), value };
        edit.validate(&[4, 5]).map_or_else(|e| e.to_string(), |()| "ok".into())
    }

    #[test]
    fn paths_follow_the_size_of_the_base_face() {
        let up = EditValue::AddPosition(DVec3::Z);
        assert_eq!(error_of(EditKind::Vertex, &[1, 4, 3, 3], up), "ok");
        assert_eq!(error_of(EditKind::Vertex, &[1, 4], up), "ok");
        assert!(error_of(EditKind::Vertex, &[0, 4, 3, 3], up).contains("the number 4"));
        assert!(error_of(EditKind::Vertex, &[1, 4, 4, 3], up).contains("of 0 to 3"));
        assert!(error_of(EditKind::Vertex, &[2, 0], up).contains("names face 2 (from 0) of 2"));
        assert!(error_of(EditKind::Vertex, &[0], up).contains("at least 2"));
        assert!(error_of(EditKind::Vertex, &[0; 30], up).contains("28 levels deep"));
    }

    #[test]
    fn values_must_suit_the_kind() {
        assert!(
            error_of(EditKind::Edge, &[0, 1], EditValue::SetPosition(DVec3::ZERO)).contains("cannot make this change")
        );
        assert!(error_of(EditKind::Face, &[0, 1], EditValue::SetSharpness(1.0)).contains("cannot make this change"));
        assert!(error_of(EditKind::Vertex, &[0, 1], EditValue::Hole).contains("cannot make this change"));
        assert!(error_of(EditKind::Edge, &[0, 1], EditValue::SetSharpness(f32::NAN)).contains("not finite"));
        assert_eq!(error_of(EditKind::Face, &[0], EditValue::Hole), "ok");
    }
}
