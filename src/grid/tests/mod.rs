//! Pieces and nodes against slow, obvious code.

mod boxes;
mod encoding;
mod support;
