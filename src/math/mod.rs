//! Small mathematics that the rest shares: boxes, rays and lanes of eight floats. Vectors are glam's.

mod bounds;
pub mod lattice_grid;
mod plate;
pub mod point_grid;
mod ray;
pub mod simd;

pub use bounds::{Bounds, DBounds};
pub use lattice_grid::{LatticeGrid, Rounding, WINDOW};
pub use plate::{Envelope, Plate};
pub use point_grid::PointGrid;
pub use ray::{Hit, Intersect, OnTriangle, PrimitiveRef, Ray, RayBounds};
