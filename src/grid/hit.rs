//! Triangles by number, and what a ray hit.

use crate::ids::PatchId;
use glam::{DVec3, Vec3};

/// One triangle of a mesh: patch, cell (i, j) and half, in one word whose order is that of (patch, j, i, half).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct TriangleId(u64);

impl TriangleId {
    /// No triangle; greater than every other.
    pub const NONE: Self = Self(u64::MAX);

    /// The triangle `half` (0 or 1) of cell (i, j), counted from corner 0 of the patch; i and j below 32768.
    #[inline(always)]
    pub fn new(patch: PatchId, i: u32, j: u32, half: u32) -> Self {
        debug_assert!(i < 1 << 15 && j < 1 << 15 && half < 2);
        Self(u64::from(patch.0) << 32 | u64::from(j << 16 | i << 1 | half))
    }

    /// The patch.
    #[inline(always)]
    pub fn patch(self) -> PatchId {
        PatchId((self.0 >> 32) as u32)
    }

    /// The cell's place along u.
    #[inline(always)]
    pub fn i(self) -> u32 {
        (self.0 as u32 & 0xffff) >> 1
    }

    /// The cell's place along v.
    #[inline(always)]
    pub fn j(self) -> u32 {
        self.0 as u32 >> 16
    }

    /// 0: the triangle at the cell's corner (0,0); 1: the one at (1,1).
    #[inline(always)]
    pub fn half(self) -> u32 {
        self.0 as u32 & 1
    }
}

/// The nearest hit so far of a ray in lattice space.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LatticeHit {
    /// Ray parameter in units of the ray's own, scaled direction (see
    /// [`LatticeRay::caller_t`](super::LatticeRay::caller_t)).
    pub t: f32,
    /// The triangle; [`TriangleId::NONE`] until something is hit.
    pub triangle: TriangleId,
    /// Weights of the triangle's second and third vertex.
    pub barycentrics: [f32; 2],
    /// Cells of the patch's grid along u and v.
    pub grid: [u16; 2],
    /// The triangle's corners: lattice points, which f32 holds exactly.
    pub corners: [Vec3; 3],
    /// Cross product of the triangle's edges, in lattice units squared, along du x dv: exact, zero for one without
    /// area. Kept with the corners, since reading them back at once would wait for their stores.
    pub normal: DVec3,
}

impl LatticeHit {
    /// No hit yet; hits beyond `t_max` will not be taken.
    #[inline(always)]
    pub fn none(t_max: f32) -> Self {
        Self {
            t: t_max,
            triangle: TriangleId::NONE,
            barycentrics: [0.0; 2],
            grid: [1; 2],
            corners: [Vec3::ZERO; 3],
            normal: DVec3::ZERO,
        }
    }

    /// Whether something was hit.
    #[inline(always)]
    pub fn is_some(&self) -> bool {
        self.triangle != TriangleId::NONE
    }

    /// Cross product of a triangle's edges. Zero for a triangle without area, which can still be hit: it fills the
    /// crack between its neighbours.
    ///
    /// Exact, slivers included: edges are whole numbers below 2^25, products below 2^50, and f64 holds their
    /// differences.
    #[inline(always)]
    pub(super) fn normal_of(corners: [Vec3; 3]) -> DVec3 {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        (b - a).cross(c - a)
    }

    /// Place of the hit in the grid, in cells from corner 0 of the patch: (u n_u, v n_v).
    #[inline]
    pub fn in_cells(&self) -> [f32; 2] {
        let corner = [self.triangle.i() as f32, self.triangle.j() as f32];
        let [s, t] = self.barycentrics;
        if self.triangle.half() == 0 {
            [corner[0] + s, corner[1] + t]
        } else {
            [corner[0] + 1.0 - s, corner[1] + 1.0 - t]
        }
    }

    /// Whether a hit of `triangle` at `t` takes the place of this one.
    #[inline(always)]
    pub(super) fn yields_to(&self, t: f32, triangle: TriangleId) -> bool {
        t < self.t || (t == self.t && triangle < self.triangle)
    }
}
