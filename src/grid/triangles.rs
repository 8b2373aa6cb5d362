//! Rays against the triangles of a piece: eight at a time, watertight (Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", 2013).
#![allow(unsafe_code)]

use super::boxes::LaneHits;
use super::{LatticeHit, LatticeRay, PieceView, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::Kernel;
use glam::{IVec3, Vec3};

impl PieceView<'_> {
    /// Takes the nearest hit of the piece into `hit` if it is nearer than what is there, or as near and the smaller triangle.
    /// Says whether it did.
    #[inline(always)]
    pub fn closest<K: Kernel>(&self, kernel: K, ray: &LatticeRay, patch: PatchId, hit: &mut LatticeHit) -> bool {
        let before = hit.triangle;
        let mut blocks = self.head.test(kernel, ray, hit.t);
        while let Some(lane) = blocks.pop_nearest(hit.t) {
            let Some(found) = self.test_block(kernel, ray, lane, hit.t) else { continue };
            for triangle in found.lanes() {
                let (id, t) = (self.triangle_id(patch, lane, triangle), found.t[triangle]);
                if hit.yields_to(t, id) && id != ray.skip {
                    (hit.t, hit.triangle) = (t, id);
                    hit.barycentrics = [found.second[triangle], found.third[triangle]];
                }
            }
        }
        let is_nearer = hit.triangle != before;
        if is_nearer {
            hit.normal = self.normal(hit.triangle);
        }
        is_nearer
    }

    /// Whether the ray hits anything of the piece.
    #[inline(always)]
    pub fn occluded<K: Kernel>(&self, kernel: K, ray: &LatticeRay, patch: PatchId) -> bool {
        let mut blocks = self.head.test(kernel, ray, ray.t_max);
        while let Some(lane) = blocks.pop() {
            let found = self.test_block(kernel, ray, lane, ray.t_max);
            if found.is_some_and(|f| f.lanes().any(|t| self.triangle_id(patch, lane, t) != ray.skip)) {
                return true;
            }
        }
        false
    }

    /// The blocks whose boxes the ray meets before `t_max`.
    #[inline(always)]
    pub fn blocks<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> LaneHits {
        self.head.test(kernel, ray, t_max)
    }

    #[inline(always)]
    fn test_block<K: Kernel>(&self, kernel: K, ray: &LatticeRay, block: usize, t_max: f32) -> Option<Found> {
        let eight = match self.head.format {
            2 => Eight::<K>::load::<2>(self, kernel, ray, block),
            3 => Eight::<K>::load::<3>(self, kernel, ray, block),
            _ => Eight::<K>::load::<4>(self, kernel, ray, block),
        };
        eight.test(kernel, t_max)
    }

    /// The number of triangle `triangle` (0 to 7) of a block.
    #[inline(always)]
    fn triangle_id(&self, patch: PatchId, block: usize, triangle: usize) -> TriangleId {
        let i = usize::from(self.head.cells.i0) + 2 * (block & 3) + (triangle & 1);
        let j = usize::from(self.head.cells.j0) + 2 * (block >> 2) + (triangle >> 2);
        TriangleId::new(patch, i as u32, j as u32, (triangle as u32 >> 1) & 1)
    }

    /// Cross product of the edges of a triangle of this piece.
    #[inline(always)]
    fn normal(&self, triangle: TriangleId) -> Vec3 {
        let i = (triangle.i() - u32::from(self.head.cells.i0)) as usize;
        let j = (triangle.j() - u32::from(self.head.cells.j0)) as usize;
        let half = triangle.half() as usize;
        let corner = |i, j| IVec3::from_array(self.vertex(i, j));
        let (first, second, third) =
            (corner(i + half, j + half), corner(i + 1 - half, j + half), corner(i + half, j + 1 - half));
        (second - first).as_vec3().cross((third - first).as_vec3())
    }
}

/// Corners of eight triangles in the sheared space: `x[0]` has the x of their first vertices.
///
/// Lane = 4 (row of the cell) + 2 half + (column of the cell).
struct Eight<K: Kernel> {
    x: [K::F; 3],
    y: [K::F; 3],
    z: [K::F; 3],
}

/// The triangles of a block that are hit within the ray.
struct Found {
    /// One bit for each triangle.
    mask: u32,
    t: [f32; 8],
    /// Weight of the second vertex.
    second: [f32; 8],
    /// Weight of the third vertex.
    third: [f32; 8],
}

impl Found {
    #[inline(always)]
    fn lanes(&self) -> impl Iterator<Item = usize> + use<> {
        let mut mask = self.mask;
        std::iter::from_fn(move || {
            let lane = (mask != 0).then_some(mask.trailing_zeros() as usize)?;
            mask &= mask - 1;
            Some(lane)
        })
    }
}

impl<K: Kernel> Eight<K> {
    #[inline(always)]
    fn load<const BYTES: usize>(piece: &PieceView, kernel: K, ray: &LatticeRay, block: usize) -> Self {
        let (column, row) = (2 * (block & 3), 2 * (block >> 2));
        // Vertices 0 to 2 of two rows each, relative to the ray's origin: rows 0 and 1, rows 1 and 2.
        let rows = |axis: usize| {
            let at: [usize; 3] = std::array::from_fn(|j| piece.row_start(row + j, axis) + BYTES * column);
            let origin = kernel.splat(ray.origin[axis]);
            [[at[0], at[1]], [at[1], at[2]]].map(|at| {
                // SAFETY: `PieceView::new` checked that the block holds every vertex of the lanes in its head and the tail after them.
                // `block` is one of those lanes, so `at` is at most four coordinates before the end of the vertices but one; the load
                // reads four coordinates (and, for BYTES = 3, four bytes more): at most one coordinate and four bytes of the tail's eight.
                let v = unsafe { kernel.integers::<BYTES>(piece.bytes, at, piece.head.base[axis]) };
                kernel.sub(v, origin)
            })
        };
        let [kx, ky, kz] = ray.axes;
        let z = rows(kz);
        let sheared = |axis: usize, shear: f32| {
            let (rows, shear) = (rows(axis), kernel.splat(shear));
            [0, 1].map(|r| kernel.sub(rows[r], kernel.mul(shear, z[r])))
        };
        let (x, y) = (sheared(kx, ray.shear[0]), sheared(ky, ray.shear[1]));
        let z = z.map(|z| kernel.mul(z, kernel.splat(ray.shear[2])));
        // First vertices are v00 for half 0 and v11 for half 1, and so on: see the picture in mod.rs.
        let corners = |[a, b]: [K::F; 2]| [kernel.pick_0112(a, b), kernel.pick_1201(a, b), kernel.pick_0112(b, a)];
        Self { x: corners(x), y: corners(y), z: corners(z) }
    }

    /// The triangles hit with 0 <= t <= `t_max`.
    #[inline(always)]
    fn test(&self, k: K, t_max: f32) -> Option<Found> {
        let Self { x, y, z } = self;
        // Twice the area opposite vertex a: of two triangles that share the edge b c, one gets the exact negative of the other's.
        let edge = |b: usize, c: usize| k.sub(k.mul(x[c], y[b]), k.mul(y[c], x[b]));
        let (u, v, w) = (edge(1, 2), edge(2, 0), edge(0, 1));
        let zero = k.splat(0.0);
        let (least, greatest) = (k.min(k.min(u, v), w), k.max(k.max(u, v), w));
        let inside = k.le(zero, least) | k.le(greatest, zero);
        if inside == 0 {
            return None;
        }
        let on_edge = inside & (k.eq(least, zero) | k.eq(greatest, zero));
        let det = k.add(k.add(u, v), w);
        let t = k.div(k.add(k.add(k.mul(u, z[0]), k.mul(v, z[1])), k.mul(w, z[2])), det);
        let mask = inside & !on_edge & k.le(zero, t) & k.le(t, k.splat(t_max));
        if (mask | on_edge) == 0 {
            return None;
        }
        let mut found = Found { mask, t: k.store(t), second: k.store(k.div(v, det)), third: k.store(k.div(w, det)) };
        if on_edge != 0 {
            self.settle(k, on_edge, t_max, &mut found);
        }
        (found.mask != 0).then_some(found)
    }

    /// Where an edge function vanished in single precision its sign is not known: decide in double precision, where products are exact.
    #[cold]
    #[inline(never)]
    fn settle(&self, k: K, lanes: u32, t_max: f32, found: &mut Found) {
        let [x, y, z] = [self.x, self.y, self.z].map(|c| c.map(|c| k.store(c)));
        for lane in (0..8).filter(|lane| lanes >> lane & 1 == 1) {
            let at = |c: [[f32; 8]; 3]| c.map(|c| f64::from(c[lane]));
            if let Some((t, second, third)) = settle_one(at(x), at(y), at(z)).filter(|h| 0.0 <= h.0 && h.0 <= t_max) {
                found.mask |= 1 << lane;
                (found.t[lane], found.second[lane], found.third[lane]) = (t, second, third);
            }
        }
    }
}

/// t and the weights of the second and third vertex, of a triangle in the sheared space; `None` for no hit or no area.
fn settle_one(x: [f64; 3], y: [f64; 3], z: [f64; 3]) -> Option<(f32, f32, f32)> {
    let edge = |b: usize, c: usize| x[c] * y[b] - y[c] * x[b];
    let (u, v, w) = (edge(1, 2), edge(2, 0), edge(0, 1));
    let is_inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let det = u + v + w;
    let t = (u * z[0] + v * z[1] + w * z[2]) / det;
    (is_inside && det != 0.0).then_some((t as f32, (v / det) as f32, (w / det) as f32))
}
