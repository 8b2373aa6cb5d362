//! What integrators ask of the scene.

use crate::math::{Hit, Intersect, PrimitiveRef, Ray};
use glam::DVec3;

/// The surface at a hit, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where the ray met the triangle; off its edges by more than `clearance`, where the triangle is large enough.
    pub position: DVec3,
    /// Unit normal of the triangle, along du × dv: outwards on a mesh with counter-clockwise faces.
    pub geometric_normal: DVec3,
    /// Unit normal of the limit surface, on the same side.
    pub shading_normal: DVec3,
    /// How far from `position`, in world units along the normal, rays that leave the surface start, so that they do not
    /// meet it again.
    pub clearance: f64,
}

/// One thread's access to the scene: ray queries, and answers about what was hit.
pub trait Tracer: Intersect {
    /// The surface where `ray` hit; `hit` is what [`Intersect::closest`] returned for it.
    fn surface_point(&mut self, ray: &Ray, hit: &Hit) -> SurfacePoint;

    /// Largest rate of the four edges of the patch that `primitive` is part of.
    fn patch_rate(&self, primitive: &PrimitiveRef) -> u32;

    /// What this tracer has had to build so far.
    fn misses(&self) -> Built;
}

/// Blocks (grid pieces and tree nodes) that were missing and had to be built.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Built {
    /// How many.
    pub blocks: u64,
    /// Bytes of them.
    pub bytes: u64,
}

impl std::ops::Add for Built {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { blocks: self.blocks + other.blocks, bytes: self.bytes + other.bytes }
    }
}

impl std::ops::Sub for Built {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { blocks: self.blocks - other.blocks, bytes: self.bytes - other.bytes }
    }
}
