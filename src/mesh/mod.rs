//! The control mesh: what the user gives, validated once.
//!
//! A [`ControlMesh`] is plain data: positions, polygons and the tags that shape the limit surface. It knows no
//! half-edges; [`crate::topology`] derives those. [`shapes`] makes meshes without files; a [`MeshSink`] takes one in
//! pieces.
//!
//! # Invariants
//! Every index is in range, every coordinate and sharpness is finite or (sharpness only) infinite, every face has at
//! least three corners.

mod control_mesh;
mod edit;
pub mod random;
pub mod shapes;
pub mod shrink;
mod sink;

pub use control_mesh::{BoundaryRule, ControlMesh, Corner, Crease, CreaseMethod, TriangleRule};
pub use edit::{Edit, EditKind, EditValue};
pub use sink::{Assembly, MeshSink};
