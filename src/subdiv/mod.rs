//! The limit surface: from control points to positions and tangents at any (u, v) of any patch.
//!
//! The limit of a quad face depends only on its **ring**: the faces that touch its corners. After one Catmull-Clark
//! step each quarter of the face has a ring of its own, whose points are weighted sums (**rows**) of the ring before.
//! Rings with equal topology and sharpness obey the same rows, whatever mesh and level they come from, so they are
//! stored once, as nodes of a [`PlanLibrary`]:
//!
//! ```text
//!   Split ──rows──▶ 4 children ──▶ Regular (16 bicubic B-spline control points)
//!     ▲                  │
//!     └──────────────────┘ a ring round an extraordinary vertex leads back to itself: the plan has no depth limit
//! ```
//!
//! A **plan** is the node a patch starts at. Evaluating walks down from it, multiplying points by rows, until the patch
//! is regular or only a corner is wanted, whose position is a **limit row**. Sharpness decays on the way, so semi-sharp
//! creases end in regular or self-similar nodes too.
//!
//! # Invariants
//! 1. Rows are computed in f64, sharpness in f32 (as OpenSubdiv does: see the rules' precision).
//! 2. A point's value does not depend on which other points are evaluated with it.
//! 3. Two evaluations of one surface point, from whatever patches, differ by less than [`dice::GUARD`] lattice steps;
//!    rounding to the lattice with that guard makes shared borders equal to the bit.
//!
//! Sources: Catmull & Clark 1978; Stam 1998; Nießner et al. 2012; Brainerd et al. 2016 (plans); OpenSubdiv's rules.
//! Read [`local`] first, then [`rules`], [`plan`], [`eval`], [`surface`], [`rates`], [`dice`], [`edits`]. [`refine`] is
//! the slow reference. What most irregular patches come to is written out: one step and boxes around a lone
//! extraordinary vertex in `pole`, the points beside it in `stencils`.
//!
//! `kinds` finds the faces that share a plan, by the `fans` at their
//! corners if it can, and has their nodes drafted (`draft`); `route` finds the vertices of a ring whose plan is known.

mod bounds;
pub mod dice;
mod draft;
pub mod edits;
mod envelopes;
pub mod eval;
mod extent;
mod fans;
mod kinds;
pub mod local;
mod numbering;
mod parts;
pub mod plan;
mod pole;
mod products;
pub mod rates;
pub mod refine;
pub mod regular;
mod route;
pub mod rows;
pub mod rules;
mod stencils;
pub mod surface;

pub use dice::Dicer;
pub use envelopes::{AskedCells, EqualParts};
pub use eval::{Evaluator, SampleKind, SurfaceSample};
pub use plan::{NodeId, PlanLibrary};
pub use rates::{MAX_RATE, PatchRates, snapped};
pub use surface::{Lattice, Surface};
