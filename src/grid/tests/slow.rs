//! The slow tracer: every triangle, in f64, knowing how unsure it is.

use crate::grid::{CellRect, LatticeRay, TriangleId};
use crate::ids::PatchId;
use glam::{DVec3, IVec3};

/// A triangle with its number.
pub type Triangle = (TriangleId, [DVec3; 3]);

/// All triangles of a sheet of vertices over `cells`, in the order of their numbers.
pub fn triangles(vertices: &[[i32; 3]], cells: CellRect, patch: PatchId) -> Vec<Triangle> {
    let [n_u, n_v] = cells.size();
    let vertex = |i: usize, j: usize| IVec3::from_array(vertices[j * (n_u + 1) + i]).as_dvec3();
    let places = (0..n_v).flat_map(|j| (0..n_u).flat_map(move |i| [(i, j, 0), (i, j, 1)]));
    let triangle = |(i, j, half): (usize, usize, u32)| {
        let corners = if half == 0 {
            [vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]
        } else {
            [vertex(i + 1, j + 1), vertex(i, j + 1), vertex(i + 1, j)]
        };
        let (i, j) = (i as u32 + u32::from(cells.i0), j as u32 + u32::from(cells.j0));
        (TriangleId::new(patch, i, j, half), corners)
    };
    places.map(triangle).collect()
}

/// Where a ray meets the plane of a triangle.
pub struct Meeting {
    /// In the units of the ray's own direction.
    pub t: f64,
    /// Distance of the place from the nearest edge, in lattice units; negative outside.
    pub inside: f64,
    /// What an error of one lattice unit across the ray does to `t`.
    pub t_per_unit: f64,
}

/// The ray as the kernels know it: rounded origin and direction.
pub fn rounded(ray: &LatticeRay) -> (DVec3, DVec3) {
    let [kx, ky, kz] = ray.sides.axes.map(|axis| axis as usize);
    let mut d = [0.0; 3];
    d[kz] = 1.0 / f64::from(ray.inv[kz]);
    d[kx] = f64::from(ray.shear[0]) * d[kz];
    d[ky] = f64::from(ray.shear[1]) * d[kz];
    (ray.origin(), DVec3::from_array(d))
}

/// `None` if the ray is parallel to the plane or the triangle has no area.
pub fn meet(ray: &LatticeRay, [a, b, c]: [DVec3; 3]) -> Option<Meeting> {
    let (o, d) = rounded(ray);
    let n = (b - a).cross(c - a);
    let slope = d.dot(n);
    if slope == 0.0 {
        return None;
    }
    let t = (a - o).dot(n) / slope;
    let p = o + t * d;
    let side = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(n) / (n.length() * (to - from).length());
    let inside = side(a, b).min(side(b, c)).min(side(c, a));
    Some(Meeting { t, inside, t_per_unit: n.length() / slope.abs() })
}
