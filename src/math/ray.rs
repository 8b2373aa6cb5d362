//! Rays in world space and what they hit.

use super::DBounds;
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
    /// How far above `from` the origin lies, if it does: a point of that triangle moved along its normal by no more
    /// than this, in world space, to the side to which the ray leaves, far enough that rounding does not put it on the
    /// wrong side of a neighbour. Such a ray need not be tested against surface that it cannot meet. `None` if the
    /// triangle has no area, and so no normal.
    pub above: Option<f32>,
}

impl Ray {
    /// A ray without end.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY, from: None, above: None }
    }
}

/// A bundle of rays: those whose origin and direction lie within bounds, ends included. The length of a direction
/// counts as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBounds {
    /// Around the origins.
    pub origin: DBounds,
    /// Around the directions.
    pub direction: DBounds,
}

impl RayBounds {
    /// No ray.
    pub const EMPTY: Self = Self { origin: DBounds::EMPTY, direction: DBounds::EMPTY };

    /// Whether the ray is one of them.
    #[inline]
    pub fn contains(&self, ray: &Ray) -> bool {
        self.origin.contains(ray.origin) && self.direction.contains(ray.direction)
    }

    /// Bounds of these rays in another space. Rays that were not among these may be within them.
    pub fn transformed(&self, to: &DAffine3) -> Self {
        Self {
            origin: self.origin.corners().map(|p| to.transform_point3(p)).collect(),
            direction: self.direction.corners().map(|v| to.transform_vector3(v)).collect(),
        }
    }
}

impl FromIterator<Ray> for RayBounds {
    fn from_iter<I: IntoIterator<Item = Ray>>(rays: I) -> Self {
        rays.into_iter().fold(Self::EMPTY, |mut bounds, ray| {
            bounds.origin.grow(ray.origin);
            bounds.direction.grow(ray.direction);
            bounds
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
    /// Announces rays: many of the next ones that [`closest`](Self::closest) is asked about are of this bundle. Answers
    /// do not depend on it.
    fn aim(&mut self, _bundle: &RayBounds) {}
    /// [`closest`](Self::closest) for each of some rays from one point, without end, that go about the same way: camera
    /// rays of neighbouring pixels, eight at a time or more. `hits` is as long as `directions`.
    fn closest_from(&mut self, origin: DVec3, directions: &[DVec3], hits: &mut [Option<Hit>]) {
        assert_eq!(directions.len(), hits.len());
        let rays = directions.iter().map(|&direction| Ray::new(origin, direction));
        rays.zip(hits).for_each(|(ray, hit)| *hit = self.closest(&ray));
    }
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
