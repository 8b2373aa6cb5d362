//! Pieces and nodes against slow, obvious code.

mod boxes;
mod child_plates;
mod encoding;
mod horizon;
mod packet;
mod rays;
mod skyline;
mod slow;
pub(in crate::grid) mod support;
mod tracing;
mod watertight;
