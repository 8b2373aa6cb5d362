//! Polygons, positions and subdivision tags.

use super::edit::Edit;
use crate::error::{Error, Result};
use crate::ids::{FaceId, VertexId};
use crate::math::DBounds;
use glam::DVec3;

/// What happens at the mesh's boundary (`t interpolateboundary 1/0/0 k`).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum BoundaryRule {
    /// 0: faces at an untagged boundary have no surface.
    None,
    /// 1: the surface ends in the boundary curve; vertices of one face are sharp corners.
    EdgeAndCorner,
    /// 2, and the rule without a tag: the curve runs smoothly through such vertices.
    #[default]
    EdgeOnly,
}

/// How sharpness decays from level to level (`t creasemethod 0/0/1 NAME`).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum CreaseMethod {
    /// `normal`: one less each level.
    #[default]
    Uniform,
    /// `chaikin`: averaged along the crease first.
    Chaikin,
}

/// Edge weights beside triangles (`t smoothtriangles 0/0/1 NAME`).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum TriangleRule {
    /// `catmark`: the plain rule.
    #[default]
    Catmark,
    /// `smooth`: weights that hide triangles.
    Smooth,
}

/// A sharp edge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Crease {
    /// The edge's end vertices, in either order.
    pub edge: [VertexId; 2],
    /// Sharpness in single precision; 10 and more is infinite, 0 and less smooth.
    pub sharpness: f32,
}

/// A sharp vertex.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Corner {
    /// Which vertex.
    pub vertex: VertexId,
    /// As in [`Crease`].
    pub sharpness: f32,
}

/// A validated control mesh.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ControlMesh {
    /// Vertex positions in object space.
    pub positions: Vec<DVec3>,
    /// Number of corners per face.
    pub face_sizes: Vec<u32>,
    /// Vertices of all faces, one face after the other.
    pub face_vertices: Vec<VertexId>,
    /// Sharp edges; a tag on a pair that is no edge has no effect.
    pub creases: Vec<Crease>,
    /// Sharp vertices.
    pub corners: Vec<Corner>,
    /// Faces without surface.
    pub holes: Vec<FaceId>,
    /// Boundary rule.
    pub boundary: BoundaryRule,
    /// Sharpness decay.
    pub crease_method: CreaseMethod,
    /// Triangle weights.
    pub triangles: TriangleRule,
    /// Hierarchical edits, in file order.
    pub edits: Vec<Edit>,
}

impl ControlMesh {
    /// Corners that a face can have: what is known of a polygon takes 4 bytes for each pair of its corners, and several
    /// times as much while it is found out.
    pub const MOST_CORNERS: u32 = 4096;

    /// A mesh of polygons without tags.
    pub fn from_polygons(positions: Vec<DVec3>, faces: &[Vec<u32>]) -> Result<Self> {
        let mesh = ControlMesh {
            positions,
            face_sizes: faces.iter().map(|f| f.len() as u32).collect(),
            face_vertices: faces.iter().flatten().map(|&v| VertexId(v)).collect(),
            ..Default::default()
        };
        mesh.validate()?;
        Ok(mesh)
    }

    /// Checks the invariants of [`crate::mesh`]; the error names the face, vertex or tag.
    pub fn validate(&self) -> Result<()> {
        let n_vertices = self.positions.len();
        if n_vertices > u32::MAX as usize / 2 || self.face_vertices.len() > u32::MAX as usize / 2 {
            return Err(Error::input("the mesh has more than 2^31 vertices or face corners: split it"));
        }
        if let Some(v) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(Error::input(format!("vertex {} has a coordinate that is not a finite number", v + 1)));
        }
        if let Some(v) = self.positions.iter().position(|p| p.abs().max_element() > 1e30) {
            return Err(Error::input(format!("vertex {} lies beyond 1e30: scale the mesh down", v + 1)));
        }
        if let Some(f) = self.face_sizes.iter().position(|&n| n < 3) {
            let n = self.face_sizes[f];
            return Err(Error::input(format!("face {f} (from 0) has {n} corners; a face needs at least 3")));
        }
        if let Some(f) = self.face_sizes.iter().position(|&n| n > Self::MOST_CORNERS) {
            let (n, most) = (self.face_sizes[f], Self::MOST_CORNERS);
            return Err(Error::input(format!("face {f} (from 0) has {n} corners, more than {most}: divide it")));
        }
        if self.face_sizes.iter().map(|&n| n as usize).sum::<usize>() != self.face_vertices.len() {
            return Err(Error::input("the face sizes do not add up to the number of face corners"));
        }
        if let Some(v) = self.face_vertices.iter().find(|v| v.idx() >= n_vertices) {
            return Err(Error::input(format!("a face names vertex {} of {n_vertices}", v.idx() + 1)));
        }
        self.validate_tags(n_vertices)
    }

    fn validate_tags(&self, n_vertices: usize) -> Result<()> {
        let bad_vertex = |v: VertexId| v.idx() >= n_vertices;
        if let Some(c) = self.creases.iter().find(|c| c.edge.iter().any(|&v| bad_vertex(v))) {
            let [a, b] = c.edge;
            return Err(Error::input(format!("a crease names vertices {a} and {b} (from 0) of {n_vertices}")));
        }
        if let Some(c) = self.corners.iter().find(|c| bad_vertex(c.vertex)) {
            return Err(Error::input(format!("a corner names vertex {} (from 0) of {n_vertices}", c.vertex)));
        }
        if let Some(f) = self.holes.iter().find(|f| f.idx() >= self.face_sizes.len()) {
            return Err(Error::input(format!("a hole names face {f} (from 0) of {}", self.face_sizes.len())));
        }
        let mut sharpness = self.creases.iter().map(|c| c.sharpness).chain(self.corners.iter().map(|c| c.sharpness));
        if sharpness.any(f32::is_nan) {
            return Err(Error::input("a crease or corner has a sharpness that is not a number"));
        }
        self.edits.iter().try_for_each(|edit| edit.validate(&self.face_sizes))
    }

    /// Bytes held by positions and polygons.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.positions) + size_of_val(&*self.face_sizes) + size_of_val(&*self.face_vertices)
    }

    /// Number of faces.
    pub fn n_faces(&self) -> usize {
        self.face_sizes.len()
    }

    /// Bounds of the vertices that faces use: what the default camera frames.
    pub fn bounds(&self) -> DBounds {
        self.face_vertices.iter().map(|v| self.positions[v.idx()]).collect()
    }

    /// The faces, each as its vertices in order.
    pub fn faces(&self) -> impl Iterator<Item = &[VertexId]> {
        let mut rest = self.face_vertices.as_slice();
        self.face_sizes.iter().map(move |&n| {
            let (face, tail) = rest.split_at(n as usize);
            rest = tail;
            face
        })
    }
}
