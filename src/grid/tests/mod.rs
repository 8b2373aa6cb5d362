//! Pieces and nodes against slow, obvious code.

mod boxes;
mod chords;
mod encoding;
mod rays;
mod slow;
mod support;
mod tracing;
mod watertight;
