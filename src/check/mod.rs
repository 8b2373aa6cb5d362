//! Does a tessellation hold water? Borders compared to the bit, and rays aimed where they could slip through.
//!
//! A **seam** is a line that two patches share: an edge of the control mesh, or the line from the middle of a polygon's
//! edge to its centre. Both patches dice it for themselves; [`compare_seams`] asks for equal bits.
//!
//! The ray test ([`find_leaks`]) aims at a **target**: a grid vertex, or a point of the line between two triangles, on
//! a seam, at a vertex of the control mesh, or inside a patch. It collects the triangles around the target from all
//! patches that meet there, and their **outline**: what is left of their edges when shared ones cancel. Seen along the
//! ray, an outline that winds around the target leaves no way past the triangles:
//!
//! ```text
//!        ┌──────┬──────┐          If the outline winds around P, and no part of it is nearer to P than the
//!        │ A   ╱│╲     │          ray and the triangles can err, then the ray must hit a triangle within,
//!        │   ╱  P  ╲   │          at the latest at the farthest of their depths. If it does not: a leak.
//!        │ ╱    │ B  ╲ │          From behind it winds the other way; seen edge-on it does not, and
//!        └──────┴──────┘          nothing is asked of the ray.
//! ```
//!
//! So the test needs neither a tolerance chosen by taste nor a closed mesh, and takes rays from both sides alike.
//!
//! # Invariants
//! The same mesh, rates, seed and number of rays give the same report on any number of threads.

mod incidence;
mod leaks;
mod outline;
mod seams;
mod targets;
mod window;

pub use incidence::Incidence;
pub use leaks::{Leak, LeakReport, LeakSettings, find_leaks};
pub use seams::{SeamReport, compare_seams};
