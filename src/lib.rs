//! Ray tracing of Catmull-Clark subdivision surfaces that tessellates only what rays touch.
//!
//! The full tessellation of a film asset does not fit in memory. lazytess keeps the **control mesh**, turns a **patch**
//! into a **grid** of triangles only when a ray needs it, and keeps grids in a **cache** of fixed size.
//!
//! ```text
//!     OBJ + tags, scene.toml ──io──▶ ControlMesh ──topology──▶ Topology ──subdiv──▶ Surface (patches, plans, bounds)
//!                                                                                      │ scene::accel
//!                                                                                      ▼
//!     camera ──▶ rays ──▶ Intersector { &World, cache pin } ◀── miss: grid::build ──▶ SegmentCache
//!                               │
//!                               ▼ Hit
//!                          Integrator ──▶ Film ──▶ EXR / PNG, statistics
//! ```
//!
//! Modules in reading order: [`mesh`], [`topology`], [`subdiv`], [`grid`], [`cache`], [`scene`], [`render`],
//! [`image`], [`check`], [`report`], [`io`], [`cli`].

pub mod bench;
pub mod cache;
pub mod check;
pub mod cli;
pub mod error;
pub mod grid;
pub mod ids;
pub mod image;
pub mod io;
pub mod math;
pub mod mesh;
pub mod parallel;
pub mod render;
pub mod report;
pub mod scene;
pub mod subdiv;
pub mod topology;

pub use error::{Error, Result};
