//! Pieces and nodes against slow, obvious code.

mod boxes;
mod horizon;
mod encoding;
mod rays;
mod slow;
mod support;
mod tracing;
mod watertight;
