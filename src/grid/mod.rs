//! Tessellated patches as blocks of bytes, and rays against them.
//!
//! A **grid** is a patch cut into n_u x n_v **cells**, two triangles each; its vertices are points of the mesh's
//! integer
//! **lattice**. A grid is stored as **pieces** of at most 8x8 cells, so that a ray pays for the corner it touches. A
//! piece is one block of bytes: a head, sixteen boxes around **blocks** of 2x2 cells, and the vertices as offsets from
//! the piece's lowest corner. The pieces of a larger patch hang from a tree of **nodes**, blocks with boxes around up
//! to 4x4 children, and plates: pairs of parallel planes that have a child between them.
//!
//! ```text
//!   piece                                             block: 2x2 cells = 8 triangles = one SIMD test
//!   ┌──────────┬───────────────────┬─────────────┐    v02─────v12─────v22
//!   │ head 32 B│ 16 boxes, 6 x 16 B│ vertex rows │     │ ╲  1  │ ╲  1  │      half 0 at the cell's corner (0,0),
//!   └──────────┴───────────────────┴─────────────┘     │ 0 ╲   │ 0 ╲   │      half 1 at (1,1)
//!     corner and    8-bit planes,     x, y, z of      v01─────v11─────v21
//!     step of the   rounded outwards  one row after    │ ╲  1  │ ╲  1  │
//!     boxes                           another          │ 0 ╲   │ 0 ╲   │
//!                                                     v00─────v10─────v20
//! ```
//!
//! # Invariants
//! 1. A vertex is an integer point with |coordinate| <= 2^24, so it is exact in f32, and every piece that holds it
//!    decodes the same bits.
//! 2. Triangles are watertight (Woop, Benthin, Wald 2013): the test's result depends on the signs of edge functions
//!    that are exact for vertices moved by a function of the vertex and the ray alone, so two triangles never disagree
//!    about a shared edge.
//! 3. Boxes are conservative against that very test: a triangle that would be hit is never hidden by its box
//!    ([`LatticeRay`] has the argument).
//! 4. Every kernel gives the same bits.
//! 5. Of two hits at equal t the smaller [`TriangleId`] wins, so the order of tests does not matter.
//!
//! Read [`ray`](LatticeRay), then `boxes.rs`, `piece.rs`, `triangles.rs`; `packet/` takes eight camera rays at once,
//! `horizon/` spares rays the surface that they leave, `skyline/` all the rest.

mod boxes;
mod frame;
mod hit;
mod horizon;
mod node;
mod packet;
mod piece;
mod plates;
mod ray;
mod skyline;
mod triangles;
mod vertex_row;

pub use boxes::{CellRect, HEAD_BYTES, LaneHits, lane_mask};
pub use hit::{LatticeHit, TriangleId};
pub use horizon::{Borders, Horizon};
pub use node::{NodeView, cells_of, encode_node, is_node, node_bytes};
pub use packet::{PACKET, RayPacket, SeenBoxes};
use piece::leaves_below;
pub use piece::{MAX_CELLS, MOST_PIECE_BYTES, PieceLayout, PieceView, VertexFormat};
pub use plates::{ExactPlates, Plates};
pub use ray::{LATTICE_LIMIT, LatticeRay, Plane};
pub use skyline::{PartSkyline, SeenFrom, Skyline, SkylineSheet, SkylineView};

#[cfg(test)]
mod tests;
