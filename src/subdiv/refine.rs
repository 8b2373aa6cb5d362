//! The slow and obvious reference: Catmull-Clark refinement as the rules are written, in double precision.
//!
//! A [`RefinedMesh`] holds the control mesh after some number of **steps**. [`RefinedMesh::refine`] makes one step of
//! every face. When the **star** of a vertex (its edges and faces) has come to rest, no semi-sharp edge, no pending
//! edit, only quads, a mask gives the vertex's point of the limit surface. [`RefinedMesh::limit_at`] gets there while
//! refining only two rings of faces about the point, so that ten levels cost little.
//!
//! Tests and tools compare the fast evaluation against this module. It shares no code with it, and prefers a loop over
//! all edges to any cleverness.
//!
//! ```
//! use lazytess::{ids::FaceId, mesh::ControlMesh, subdiv::refine::RefinedMesh};
//! use glam::DVec3;
//!
//! let corner = |i: u32| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
//! let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
//! let cube = ControlMesh::from_polygons((0..8).map(corner).collect(), &sides.map(|f| f.to_vec()))?;
//!
//! let middle_of_bottom = RefinedMesh::from_control(&cube).limit_at(FaceId(0), 0, 0.5, 0.5).unwrap();
//! assert!(middle_of_bottom.position.distance(DVec3::new(0.5, 0.5, 13.0 / 162.0)) < 1e-15);
//! # Ok::<(), lazytess::Error>(())
//! ```
//!
//! # Invariants
//! 1. Every number that stands for sharpness is single precision and lies in `0..=INFINITE`; every position is double.
//! 2. Decisions about boundaries and non-manifold places are made once, on the control mesh, and inherited.
//! 3. Corners of refined faces run with the parameters: corner 0 at (i, j) of [`Place`], 1 at (i+1, j), and so on.
//!
//! Rules: OpenSubdiv's, with the corrections for darts, valence 2 and chaikin creases that `notes/accuracy.md`
//! explains. Hierarchical edits: [`crate::mesh::Edit`].

mod base;
mod edits;
mod limit;
mod local;
mod star;
mod step;

use crate::ids::FaceId;
use crate::mesh::ControlMesh;
use glam::DVec3;
use std::sync::Arc;

pub use limit::{Sample, Tangents};

/// The sharpness that never decays; larger ones are clamped to it.
pub const INFINITE: f32 = 10.0;

/// Where a refined face lies in the parameter domain: cell (i, j) of the 2^level by 2^level cells of a patch.
///
/// A face of the control mesh that is no quad has no patch of its own; it carries `sub` 0 and level 0, and its children
/// after one step are the patches `sub` = 0, 1, ... at level 0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Place {
    /// Face of the control mesh.
    pub face: FaceId,
    /// Which quad of it: 0 for quads, the corner's number for other faces.
    pub sub: u32,
    /// Halvings of the patch so far.
    pub level: u32,
    /// Cell in u, below 2^level.
    pub i: u64,
    /// Cell in v, below 2^level.
    pub j: u64,
}

#[derive(Clone, Copy)]
struct Vertex {
    position: DVec3,
    sharpness: f32,
    /// Infinitely sharp for being non-manifold: no edit changes that.
    pinned: bool,
}

#[derive(Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    sharpness: f32,
    /// A boundary or non-manifold edge: no edit makes it smooth.
    pinned: bool,
}

#[derive(Clone, Copy)]
struct Face {
    first_corner: u32,
    n_corners: u32,
    place: Place,
    hole: bool,
}

/// A corner of a face and the edge that leaves it in the face's direction.
#[derive(Clone, Copy)]
struct Corner {
    vertex: u32,
    edge: u32,
}

/// The control mesh after some Catmull-Clark steps, or a part of it.
#[derive(Clone)]
pub struct RefinedMesh<'a> {
    control: &'a ControlMesh,
    edits: Arc<[edits::PlacedEdit]>,
    n_steps: u32,
    vertices: Vec<Vertex>,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    corners: Vec<Corner>,
}

impl RefinedMesh<'_> {
    /// Steps made since the control mesh.
    pub fn n_steps(&self) -> u32 {
        self.n_steps
    }

    /// Number of faces, those without surface included.
    pub fn n_faces(&self) -> usize {
        self.faces.len()
    }

    /// Number of vertices. A step keeps the numbers of vertices, then adds edge points, then face points.
    pub fn n_vertices(&self) -> usize {
        self.vertices.len()
    }

    /// Position of a vertex, in object space; not yet on the limit surface.
    pub fn position(&self, vertex: usize) -> DVec3 {
        self.vertices[vertex].position
    }

    /// The vertices of a face in order.
    pub fn face_vertices(&self, face: usize) -> impl Iterator<Item = usize> {
        self.corners(face).iter().map(|c| c.vertex as usize)
    }

    /// Where a face lies.
    pub fn place(&self, face: usize) -> Place {
        self.faces[face].place
    }

    /// Whether a face has no surface: a hole, or at a boundary under rule `None`.
    pub fn is_hole(&self, face: usize) -> bool {
        self.faces[face].hole
    }

    fn corners(&self, face: usize) -> &[Corner] {
        let Face { first_corner, n_corners, .. } = self.faces[face];
        &self.corners[first_corner as usize..][..n_corners as usize]
    }
}

#[cfg(test)]
pub(crate) mod tests;
