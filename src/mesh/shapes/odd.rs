//! Shapes that are no manifolds, and other topologies that modelling programs should not but do write.

use super::{basic, on_circle, polygons};
use crate::mesh::ControlMesh;
use crate::mesh::sink::round;
use glam::DVec3;

/// Two tetrahedra that share one vertex.
pub fn bow_tie() -> ControlMesh {
    let one = basic::tetrahedron();
    let mirrored = one.positions[1..].iter().map(|p| 2.0 * one.positions[0] - p);
    let positions = one.positions.iter().copied().chain(mirrored).collect();
    let other = |v: u32| if v == 0 { 0 } else { v + 3 };
    let faces: Vec<[u32; 3]> = one.faces().map(|f| [f[0].0, f[1].0, f[2].0]).collect();
    // A point reflection turns faces inside out, so theirs run the other way.
    let reflected: Vec<_> = faces.iter().map(|f| [other(f[0]), other(f[2]), other(f[1])]).collect();
    polygons(positions, faces.into_iter().chain(reflected))
}

/// Three quads on one edge.
pub fn fin() -> ControlMesh {
    let edge = [DVec3::ZERO, DVec3::Y];
    let wings = (0..3).flat_map(|i| [0.0, 1.0].map(|y| on_circle(i, 3, 1.0, y)));
    polygons(edge.into_iter().chain(wings).collect(), [[0, 2, 3, 1], [0, 4, 5, 1], [1, 0, 6, 7]])
}

/// A grid of 3 x 3 quads in which two opposite inner vertices are one.
pub fn pinched() -> ControlMesh {
    let grid = basic::plane(3, 3);
    let merged = |v: u32| if v == 10 { 5 } else { v };
    let faces: Vec<Vec<u32>> = grid.faces().map(|f| f.iter().map(|v| merged(v.0)).collect()).collect();
    // The middle quad names that vertex twice now; without it two fans meet there.
    polygons(grid.positions, faces.into_iter().enumerate().filter(|&(i, _)| i != 4).map(|(_, face)| face))
}

/// A band of `n` quads with half a twist.
pub fn moebius(n: u32) -> ControlMesh {
    let point = |k: u32| {
        let (sin, cos) = (std::f64::consts::PI * f64::from(k / 2) / f64::from(n)).sin_cos();
        let side = if k.is_multiple_of(2) { 0.4 } else { -0.4 };
        round(on_circle(k / 2, n, 1.0 + side * cos, side * sin))
    };
    let vertex = |i: u32, side: u32| if i == n { 1 - side } else { 2 * i + side };
    let faces = (0..n).map(|i| [vertex(i, 0), vertex(i, 1), vertex(i + 1, 1), vertex(i + 1, 0)]);
    polygons((0..2 * n).map(point).collect(), faces)
}

/// Quads beside a quad that names one vertex twice in a row.
pub fn repeated_vertex() -> ControlMesh {
    let mut grid = basic::plane(2, 2);
    grid.face_vertices[1] = grid.face_vertices[0];
    grid
}

/// Two quads that share two edges, so that the vertex between has valence 2.
pub fn valence_two() -> ControlMesh {
    let corners = [[-1.0, 0.0, 0.0], [0.0, 0.4, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    polygons(corners.map(DVec3::from_array).to_vec(), [[0, 1, 2, 3], [2, 1, 0, 4]])
}

/// Two quads back to back: a closed surface without volume whose vertices have valence 2.
pub fn valence_two_closed() -> ControlMesh {
    let quad = basic::n_gon(4);
    polygons(quad.positions, [[0, 1, 2, 3], [3, 2, 1, 0]])
}
