//! Small mathematics that the rest shares: boxes, rays and lanes of eight floats. Vectors are glam's.

mod bounds;
mod lattice_grid;
mod ray;
pub mod simd;

pub use bounds::{Bounds, DBounds};
pub use lattice_grid::{LatticeGrid, Rounding, WINDOW};
pub use ray::{Hit, Intersect, OnTriangle, PrimitiveRef, Ray};
