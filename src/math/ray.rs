//! Rays in world space and what they hit.

use crate::ids::{FaceId, MeshId, PatchId};
use glam::{DAffine3, DVec3, Vec3};

/// One triangle of the tessellation, named so that a ray that starts on it can leave it out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PrimitiveRef {
    /// Which mesh.
    pub mesh: MeshId,
    /// Which patch of it.
    pub patch: PatchId,
    /// Cell (i, j) of the patch's grid, counted along u and v from corner 0.
    pub cell: [u16; 2],
    /// 0: the triangle at the cell's corner (0,0); 1: the one at (1,1).
    pub half: u8,
}

/// A ray in world space, from t = 0 to `t_max`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin in world space.
    pub origin: DVec3,
    /// Direction in world space; any non-zero length, `t` counts in units of it.
    pub direction: DVec3,
    /// Hits beyond are ignored.
    pub t_max: f32,
    /// The triangle the ray starts on, if any: it is not hit.
    pub from: Option<PrimitiveRef>,
}

impl Ray {
    /// A ray without end.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY, from: None }
    }
}

/// A bundle of rays: those whose origin and direction lie within bounds, ends included. The length of a direction counts as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBounds {
    /// Least and greatest origin, axis by axis.
    pub origin: [DVec3; 2],
    /// Least and greatest direction.
    pub direction: [DVec3; 2],
}

impl RayBounds {
    /// No ray.
    pub const EMPTY: Self = {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        Self { origin: none, direction: none }
    };

    /// Whether the ray is one of them.
    #[inline(always)]
    pub fn holds(&self, ray: &Ray) -> bool {
        let is_between = |v: DVec3, [low, high]: [DVec3; 2]| (low.cmple(v) & v.cmple(high)).all();
        is_between(ray.origin, self.origin) && is_between(ray.direction, self.direction)
    }

    /// Bounds of these rays in another space. Rays that were not among these may be within them.
    pub fn transformed(&self, to: &DAffine3) -> Self {
        let around = |[low, high]: [DVec3; 2], origin: DVec3| {
            let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
            let columns = [to.matrix3.x_axis, to.matrix3.y_axis, to.matrix3.z_axis].map(DVec3::abs);
            let half = half.x * columns[0] + half.y * columns[1] + half.z * columns[2];
            let center = to.matrix3 * center + origin;
            [center - half, center + half]
        };
        Self { origin: around(self.origin, to.translation), direction: around(self.direction, DVec3::ZERO) }
    }
}

impl FromIterator<Ray> for RayBounds {
    fn from_iter<I: IntoIterator<Item = Ray>>(rays: I) -> Self {
        let with = |[low, high]: [DVec3; 2], v: DVec3| [low.min(v), high.max(v)];
        rays.into_iter().fold(Self::EMPTY, |bounds, ray| Self {
            origin: with(bounds.origin, ray.origin),
            direction: with(bounds.direction, ray.direction),
        })
    }
}

/// The nearest hit of a ray, as the tracer returns it. Position and normals are derived from it on demand.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// The triangle.
    pub primitive: PrimitiveRef,
    /// Control face of the patch, in file order.
    pub face: FaceId,
    /// Which sub-quad of an n-gon; 0 for quads.
    pub sub: u32,
    /// Patch parameters in 0..=1.
    pub u: f32,
    /// See `u`.
    pub v: f32,
    /// The triangle's geometric normal in object space (not normalised, along du x dv).
    pub normal_in_object: DVec3,
    /// Where on the triangle.
    pub on_triangle: OnTriangle,
}

/// A point of a triangle, as exact as the triangle itself: where along the ray it lies is known less well.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OnTriangle {
    /// The corners, in lattice space of the mesh.
    pub corners: [Vec3; 3],
    /// Weights of the second and third corner.
    pub weights: [f32; 2],
}

/// Whatever can answer ray queries: the lazy tracer, and the brute-force one that tests compare it with.
pub trait Intersect {
    /// The nearest hit, ties broken by the smaller (mesh, patch, cell, half).
    fn closest(&mut self, ray: &Ray) -> Option<Hit>;
    /// Whether anything is hit.
    fn occluded(&mut self, ray: &Ray) -> bool;
    /// Announces rays: many of the next ones that [`closest`](Self::closest) is asked about are of this bundle. Answers do not depend on it.
    fn aim(&mut self, _bundle: &RayBounds) {}
    /// [`closest`](Self::closest) for each of the rays, in whatever order is fast; `hits` is as long as `rays`.
    fn closest_batch(&mut self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len());
        rays.iter().zip(hits).for_each(|(ray, hit)| *hit = self.closest(ray));
    }
    /// [`occluded`](Self::occluded) for each of the rays, in whatever order is fast; `occluded` is as long as `rays`.
    fn occluded_batch(&mut self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len());
        rays.iter().zip(occluded).for_each(|(ray, is_hit)| *is_hit = self.occluded(ray));
    }
}
