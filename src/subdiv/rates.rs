//! How finely edges and patches are cut.
//!
//! The **rate** of an edge is the number of segments it is cut into; it belongs to the edge, so both faces agree. A
//! patch has `n_u x n_v` cells, the larger of opposite rates; where a side is coarser than that, its border vertices
//! snap to the nearest of the edge's points, and the border becomes the edge's own polyline.

use super::surface::Surface;
use crate::ids::{FaceId, PatchId};
use crate::topology::HalfEdges;
use glam::DVec3;

/// Largest rate of an edge.
pub const MAX_RATE: u32 = 4096;

/// How finely a patch is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PatchRates {
    /// Segments of the sides v = 0, u = 1, v = 1, u = 0.
    pub sides: [u32; 4],
    /// Cells along u.
    pub n_u: u32,
    /// Cells along v.
    pub n_v: u32,
}

/// The next multiple of a power of two.
fn round_up(n: u32, unit: u32) -> u32 {
    (n + (unit - 1)) & !(unit - 1)
}

impl PatchRates {
    /// The power of two `unit` divides the numbers of cells.
    pub(super) fn new(sides: [u32; 4], unit: u32) -> Self {
        let [n_u, n_v] = [0, 1].map(|k| round_up(sides[k].max(sides[k + 2]), unit));
        Self { sides, n_u, n_v }
    }

    /// Triangles of the patch's grid.
    pub fn n_triangles(&self) -> u64 {
        2 * u64::from(self.n_u) * u64::from(self.n_v)
    }
}

impl Surface {
    /// The rates of a patch, from `rate(a, b)`: the segments for an edge between two points of object space, symmetric
    /// in them. Edges beside a polygon that is no quad are cut evenly, since the polygon's patches meet in their
    /// middle.
    pub fn patch_rates(&self, patch: PatchId, rate: &impl Fn(DVec3, DVec3) -> u32) -> PatchRates {
        let end = |h: u32| self.object_point(self.topology().vertex(h));
        self.rates_by(patch, &|h| rate(end(h), end(self.topology().next(h))), &|face, k| {
            let [a, b] = self.inner_edge(face, k);
            rate(a, b)
        })
    }

    /// [`patch_rates`](Self::patch_rates) for the same rate everywhere.
    pub fn uniform_rates(&self, patch: PatchId, n: u32) -> PatchRates {
        if !self.edited().has_holes() && self.topology().is_among_quads(self.face_of(patch).0) {
            return PatchRates::new([n.clamp(1, MAX_RATE); 4], 1);
        }
        self.rates_by(patch, &|_| n, &|_, _| n)
    }

    /// The rates of a patch from those of half-edges, and of twice the way from the middle of edge k of a polygon to
    /// its centre.
    fn rates_by(&self, patch: PatchId, edge: &impl Fn(u32) -> u32, inner: &impl Fn(FaceId, u32) -> u32) -> PatchRates {
        let (face, sub) = self.face_of(patch);
        let (first, n) = self.topology().face_corners(face.0);
        let unit = self.edited().cell_unit(patch);
        let edge = |k: u32| self.edge_rate(first + k, edge(first + k));
        if n == 4 {
            return PatchRates::new([edge(0), edge(1), edge(2), edge(3)], unit);
        }
        let inner = |k: u32| {
            let whole = inner(face, k).clamp(1, MAX_RATE);
            round_up(whole.div_ceil(2), self.edited().inner_unit(face))
        };
        let before = (sub + n - 1) % n;
        PatchRates::new([edge(sub) / 2, inner(sub), inner(before), edge(before) / 2], unit)
    }

    fn edge_rate(&self, h: u32, rate: u32) -> u32 {
        let halves = if self.topology().touches_polygon(h) { 2 } else { 1 };
        round_up(rate.clamp(1, MAX_RATE), halves.max(self.edited().edge_unit(self.topology(), h)))
    }

    /// From the middle of edge `k` of a polygon through its centre, as far again.
    fn inner_edge(&self, face: FaceId, k: u32) -> [DVec3; 2] {
        let (first, n) = self.topology().face_corners(face.0);
        let corner = |k: u32| self.object_point(self.topology().vertex(first + k % n));
        let center = (0..n).map(corner).sum::<DVec3>() / f64::from(n);
        let middle = 0.5 * (corner(k) + corner(k + 1));
        [middle, middle + 2.0 * (center - middle)]
    }
}

/// The edge point that border vertex `i` of `n` snaps to where the side has only `rate` segments.
pub fn snapped(i: u32, n: u32, rate: u32) -> u32 {
    ((2 * u64::from(i) * u64::from(rate) + u64::from(n)) / (2 * u64::from(n))) as u32
}
