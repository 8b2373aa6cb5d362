//! What a render has cost, in words for people and as JSON for programs.
//!
//! [`RenderStatistics`] is plain data, filled by whoever ran the render. Its JSON keys are an interface: they are
//! listed in `notes/statistics.md`, and a test compares the list with what is written.

pub mod statistics;
pub mod summary;

pub use statistics::{
    CacheReport, GeometryReport, MemoryReport, PhaseSeconds, PictureReport, RayReport, RenderStatistics, Seconds,
};
