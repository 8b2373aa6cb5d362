//! Ray tracing of Catmull-Clark subdivision surfaces that tessellates only what rays touch.
//!
//! The full tessellation of a film asset does not fit in memory. lazytess keeps the **control mesh**, turns a **patch**
//! into a **grid** of triangles only when a ray needs it, and keeps grids in a **cache** of fixed size.
//!
//! ```text
//!     OBJ + tags, scene.toml ──io──▶ ControlMesh ──topology──▶ Topology ──subdiv──▶ Surface (patches, plans, lattice)
//!                                                                                      │ scene::accel
//!                                                                                      ▼
//!     camera ──▶ rays ──▶ Intersector { &World, cache pin } ◀── miss: dice, encode ──▶ SegmentCache
//!                               │
//!                               ▼ Hit
//!                          Integrator ──▶ Film ──▶ EXR / PNG, statistics
//! ```
//!
//! Modules in reading order: [`mesh`], [`topology`], [`subdiv`], [`grid`], [`cache`], [`scene`], [`render`], [`image`],
//! [`check`], [`report`], [`io`], [`bench`](mod@bench), [`cli`]; beneath them all [`ids`], [`error`], [`names`],
//! [`parallel`] and [`math`]. `notes/glossary.md` has the words, `notes/architecture.md` the rules.
//!
//! A ray at a cube's limit surface, of which one patch is tessellated on the way:
//!
//! ```
//! use glam::{DAffine3, DVec3};
//! use lazytess::cache::CacheConfig;
//! use lazytess::math::{Intersect, Ray};
//! use lazytess::mesh::shapes;
//! use lazytess::scene::intersect::Intersector;
//! use lazytess::scene::rate::DicingRate;
//! use lazytess::scene::world::{GridCache, World, WorldMesh};
//!
//! let mesh = WorldMesh::new(shapes::cube(), DAffine3::IDENTITY, DicingRate::Fixed(8), 1)?;
//! let world = World::new(vec![mesh]);
//! let cache = GridCache::new(&world, CacheConfig::with_bytes(1 << 20))?;
//! let mut tracer = Intersector::new(&world, &cache);
//! let hit = tracer.closest(&Ray::new(DVec3::new(0.1, 0.2, 10.0), -DVec3::Z)).expect("the cube is below");
//! assert!(hit.t > 9.0 && tracer.n_built() == 1);
//! # Ok::<(), lazytess::Error>(())
//! ```

pub mod bench;
pub mod cache;
pub mod check;
pub mod cli;
pub mod error;
pub mod grid;
pub mod ids;
pub mod image;
pub mod io;
pub mod math;
pub mod mesh;
pub mod names;
pub mod parallel;
pub mod render;
pub mod report;
pub mod scene;
pub mod subdiv;
pub mod topology;

pub use error::{Error, Result};
