//! Small mathematics that the rest shares: boxes, rays and lanes of eight floats. Vectors are glam's.

mod bounds;
mod ray;
pub mod simd;

pub use bounds::{Bounds, DBounds};
pub use ray::{Hit, Intersect, OnTriangle, PrimitiveRef, Ray};
