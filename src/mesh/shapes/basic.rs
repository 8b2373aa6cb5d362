//! Shapes without tags.

use super::{on_circle, polygons};
use crate::mesh::ControlMesh;
use crate::mesh::sink::round;
use glam::{DVec3, IVec3};
use std::collections::HashMap;

/// The cube [-1, 1]³; bit k of a vertex id says whether coordinate k is +1.
pub fn cube() -> ControlMesh {
    let sign = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
    let positions = (0..8).map(|i| DVec3::new(sign(i & 1), sign(i & 2), sign(i & 4))).collect();
    polygons(positions, [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
}

/// The regular tetrahedron in every other vertex of the cube [-1, 1]³.
pub fn tetrahedron() -> ControlMesh {
    let corners = [[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];
    polygons(corners.map(DVec3::from_array).to_vec(), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

/// The octahedron with vertices at distance 1 on the axes: +x, +y, +z, -x, -y, -z.
pub fn octahedron() -> ControlMesh {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    polygons(axes.to_vec(), faces)
}

/// A torus about the y axis: `n_major` times `n_minor` quads, both at least 3.
pub fn torus(n_major: u32, n_minor: u32, major: f64, minor: f64) -> ControlMesh {
    let point = |k: u32| {
        let side = on_circle(k % n_minor, n_minor, minor, 0.0);
        on_circle(k / n_minor, n_major, major + side.x, side.z)
    };
    let vertex = |i: u32, j: u32| (i % n_major) * n_minor + j % n_minor;
    let faces = (0..n_major * n_minor).map(|k| {
        let (i, j) = (k / n_minor, k % n_minor);
        [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j)]
    });
    polygons((0..n_major * n_minor).map(point).collect(), faces)
}

/// A flat grid of `n_x` times `n_z` unit quads about the origin, facing +y.
pub fn plane(n_x: u32, n_z: u32) -> ControlMesh {
    let point = |k: u32| {
        let (i, j) = (k % (n_x + 1), k / (n_x + 1));
        DVec3::new(f64::from(i) - 0.5 * f64::from(n_x), 0.0, f64::from(j) - 0.5 * f64::from(n_z))
    };
    let faces = (0..n_x * n_z).map(|k| {
        let v = k % n_x + (k / n_x) * (n_x + 1);
        [v, v + n_x + 1, v + n_x + 2, v + 1]
    });
    polygons((0..(n_x + 1) * (n_z + 1)).map(point).collect(), faces)
}

/// A cube with `n` times `n` quads a side, its vertices on the unit sphere.
pub fn cube_sphere(n: u32) -> ControlMesh {
    let n = n as i32;
    block(IVec3::splat(n), |p| round((2 * p - IVec3::splat(n)).as_dvec3().normalize()))
}

/// The surface of a block of `n.x * n.y * n.z` cubes: unit quads between the lattice points 0 and `n`, each put at
/// `place`.
pub(super) fn block(n: IVec3, place: impl Fn(IVec3) -> DVec3) -> ControlMesh {
    let mut ids = HashMap::new();
    let mut positions = Vec::new();
    let mut vertex = |p: IVec3| {
        *ids.entry(p).or_insert_with(|| {
            positions.push(place(p));
            positions.len() as u32 - 1
        })
    };
    let mut faces = Vec::new();
    for axis in 0..3 {
        let (iu, iv) = ((axis + 1) % 3, (axis + 2) % 3);
        let (u, v) = (IVec3::AXES[iu], IVec3::AXES[iv]);
        for k in 0..n[iu] * n[iv] {
            let low = u * (k % n[iu]) + v * (k / n[iu]);
            let high = low + IVec3::AXES[axis] * n[axis];
            faces.push([low, low + v, low + u + v, low + u].map(&mut vertex));
            faces.push([high, high + u, high + u + v, high + v].map(&mut vertex));
        }
    }
    polygons(positions, faces)
}

/// A sphere of `n` meridians and `n_rings` parallels: a fan of `n` triangles at each pole, quads between.
pub fn globe(n: u32, n_rings: u32) -> ControlMesh {
    let ring = |k: u32| {
        let (sin, cos) = (std::f64::consts::PI * f64::from(k + 1) / f64::from(n_rings + 1)).sin_cos();
        (0..n).map(move |i| on_circle(i, n, sin, cos))
    };
    let mut positions: Vec<_> = (0..n_rings).flat_map(ring).map(round).collect();
    let (north, south) = (n * n_rings, n * n_rings + 1);
    positions.extend([DVec3::Y, DVec3::NEG_Y]);
    let mut faces = Vec::new();
    for i in 0..n {
        let (a, b) = (i, (i + 1) % n);
        faces.push(vec![north, a, b]);
        faces.extend((1..n_rings).map(|k| vec![a + (k - 1) * n, a + k * n, b + k * n, b + (k - 1) * n]));
        faces.push(vec![south, b + (n_rings - 1) * n, a + (n_rings - 1) * n]);
    }
    polygons(positions, faces)
}

/// A disc: `n` triangles about a pole of valence `n`, then a ring of `n` quads.
pub fn pole(n: u32) -> ControlMesh {
    let rings = (0..2 * n).map(|k| on_circle(k % n, n, f64::from(1 + k / n), -0.3 * f64::from(k / n)));
    let positions = std::iter::once(DVec3::Y * 0.3).chain(rings).collect();
    let faces = (0..n).flat_map(|i| {
        let (a, b) = (1 + i, 1 + (i + 1) % n);
        [vec![0, a, b], vec![a, a + n, b + n, b]]
    });
    polygons(positions, faces)
}

/// A disc of `n` quads about a vertex of valence `n`.
pub fn quad_pole(n: u32) -> ControlMesh {
    let rim = (0..2 * n).map(|k| on_circle(k, 2 * n, if k % 2 == 0 { 1.0 } else { 1.3 }, 0.0));
    let positions = std::iter::once(DVec3::Y * 0.4).chain(rim).collect();
    polygons(positions, (0..n).map(|i| [0, 1 + 2 * i, 2 + 2 * i, 1 + (2 * i + 2) % (2 * n)]))
}

/// A prism of radius 1 and height 2: two `n`-gons and `n` quads.
pub fn prism(n: u32) -> ControlMesh {
    let positions = (0..2 * n).map(|k| on_circle(k % n, n, 1.0, if k < n { 1.0 } else { -1.0 })).collect();
    let sides = (0..n).map(|i| {
        let j = (i + 1) % n;
        vec![i, n + i, n + j, j]
    });
    let top = (0..n).collect();
    let bottom = (n..2 * n).rev().collect();
    polygons(positions, sides.chain([top, bottom]))
}

/// A single regular polygon of radius 1, facing +y.
pub fn n_gon(n: u32) -> ControlMesh {
    polygons((0..n).map(|i| on_circle(i, n, 1.0, 0.0)).collect(), [(0..n).collect::<Vec<_>>()])
}

/// A wavy ribbon of `n` quads, each vertex on the boundary.
pub fn strip(n: u32) -> ControlMesh {
    let point = |k: u32| {
        let wave = [0.0, 0.3, 0.1, -0.2][(k / 2) as usize % 4];
        DVec3::new(f64::from(k / 2), wave, 1.0 - 2.0 * f64::from(k % 2))
    };
    polygons((0..2 * n + 2).map(point).collect(), (0..n).map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1]))
}
