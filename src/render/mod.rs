//! From rays to a picture: integrators, the film they expose, and the threads that do the work.
//!
//! A **tracer** answers rays and describes what they hit; each worker thread has its own. An **integrator** turns a
//! camera ray into a colour. The **film** holds, for each pixel of a window, the colour and the asked-for **AOVs**
//! (arbitrary output variables: depth, normal, ids), and knows which pixels are done. **Settings** come in two kinds:
//! [`RenderSettings`] say what the picture is, [`RunSettings`] only how it is made.
//!
//! ```text
//!     TileOrder ──tile──▶ worker { Tracer, Shader, records } ──records──▶ Film
//!                            │  for each pixel, for each sample: Camera::ray ─▶ Shader::sample
//!                            └─ counts rays by kind, asks `cancel`, tells `progress`
//! ```
//!
//! # Invariants
//! 1. A pixel is a function of the scene, the camera and the render settings: every random number is a function of
//!    (seed, pixel, sample, purpose). Threads, tile size and crop window change nothing.
//! 2. Nothing is allocated per ray or traced pixel. (Adaptive groups keep short lists of a tile's cells and edges.)
//! 3. Colours are linear RGB radiance; the film never tone maps.
//!
//! With **pixel groups** most pixels are not traced: an [`item_buffer`] of proxies, [`groups`] of equal pixels and
//! their interpolation are Ke's published algorithm ([`thesis`]); `footprint` and [`adaptive`] are ours, with a bounded
//! error.
//!
//! Read [`tracer`] first, then [`integrators`], [`film`] and [`workers`]; then [`adaptive`].

pub mod adaptive;
#[cfg(test)]
mod analytic;
mod between_probes;
pub mod budget;
mod canvas;
mod cells;
pub mod film;
mod follow;
mod footprint;
#[cfg(test)]
mod group_tests;
pub mod groups;
pub mod integrators;
pub mod interpolate;
pub mod item_buffer;
mod lazy;
mod patches;
mod projection;
pub mod rays;
pub mod reason;
pub mod sampler;
mod samples;
pub mod settings;
pub mod thesis;
pub mod tiles;
pub mod tracer;
pub mod workers;

pub use film::{Aov, Film, FirstHit, PixelRecord, PlaneData};
pub use rays::{RayCounts, RayKind};
pub use reason::{PixelCounts, Reason};
pub use settings::{Appearance, Groups, Progress, RenderSettings, RunSettings};
pub use tiles::{PixelRect, TileOrder};
pub use tracer::{Built, SurfacePoint, Tracer};
pub use workers::{Rendered, render};
