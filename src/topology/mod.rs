//! Who is beside whom: **half-edges** over a control mesh, and which edges and vertices are sharp.
//!
//! A half-edge is the side of an edge that belongs to one face. It starts at a vertex, runs along the face's boundary
//! counter-clockwise, and its **twin** runs the other way in the face beside it. Half-edges are numbered face by face
//! in file order, so "next" and "previous" need no storage.
//!
//! ```text
//!          v3 ◀──h2── v2        next(h0) = h1, prev(h0) = h3
//!           │          ▲        twin(h0) belongs to the face below and runs v1 → v0
//!          h3   face   h1       rotating about v0, counter-clockwise: h → twin(prev(h))
//!           ▼          │
//!          v0 ──h0──▶ v1
//! ```
//!
//! The decisions that Catmull-Clark subdivision makes once, on the control mesh, are made here: boundary and
//! **non-manifold** edges (more than two faces, two faces in the same direction, an edge from a vertex to itself or one
//! that a face passes twice) have no twin and are infinitely sharp; non-manifold vertices become corners.
//!
//! # Invariants
//! 1. `twin(twin(h)) == h` wherever a twin exists; twins belong to different faces and run in opposite directions.
//! 2. Sharpness is finite and positive (semi-sharp), infinite, or 0.
//! 3. A vertex whose `is_tagged` bit is off is smooth, and all its edges with a twin are smooth.
//!
//! Rules: Pixar's OpenSubdiv, "Subdivision Surfaces"; half-edge refinement: Dupuy & Vanhoey 2021.

mod build;
mod edits;
mod face_index;
mod half_edges;
mod pairs;

pub use build::{MeshCounts, Topology};
pub use face_index::FaceIndex;
pub use half_edges::{Fan, HalfEdges, NONE, VertexTags, fan, fan_size};
