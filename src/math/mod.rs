//! Small mathematics that the rest shares: boxes and rays. Vectors are glam's.

mod bounds;
mod ray;

pub use bounds::{Bounds, DBounds};
pub use ray::{Hit, Intersect, PrimitiveRef, Ray};
