//! What a render has cost and what a scene needs, in words for people, as JSON for programs, and as plots.
//!
//! [`RenderStatistics`] and [`Inventory`] are plain data, filled by whoever ran the render or read the scene. Their
//! JSON keys are an interface: those of a render are listed in `notes/statistics.md`, and a test compares the list with
//! what is written.

pub mod inventory;
pub mod pareto;
pub mod plot;
mod quantity;
pub mod statistics;
pub mod summary;
pub mod tradeoff;
pub mod tuning;

pub use inventory::{CacheAdvice, Inventory};
pub use statistics::{
    CacheReport, CostReport, DepartureReport, FaceCost, GeometryReport, GroupReport, MemoryReport, MeshCost,
    PhaseSeconds, PictureReport, RayReport, RenderStatistics, Seconds,
};
pub use tradeoff::{Tradeoff, TradeoffRun};
pub use tuning::{CurvePoint, RecordedRender, Tuning};
