//! From a description of a scene to a world that can be traced.
//!
//! A [`description::SceneDescription`] is what the user wrote, checked but with no mesh read.

pub mod accel;
mod aim;
mod batch;
mod builder;
pub mod camera;
pub mod compile;
pub mod costs;
pub mod departure;
pub mod description;
mod entrance;
pub mod intersect;
pub mod light;
pub mod material;
mod packet;
mod patch_walk;
mod pieces;
pub mod rate;
mod skyline;
pub mod tessellate;
pub mod world;
