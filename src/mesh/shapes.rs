//! Procedural control meshes: for tests, for the scenes that ship, and for `lazytess generate`.
//!
//! A **shape** is a small mesh made by a function without files. [`all`] is the **corpus**: a table of named shapes
//! that tests iterate, [`all_closed`] the part of it whose limit surface has no boundary, so that no ray may pass
//! through it. A generator writes a mesh of any size into a [`MeshSink`](super::MeshSink).
//!
//! # Invariants
//! Faces run counter-clockwise seen from outside; y points up; scene shapes stand on the plane y = 0. The same
//! arguments give the same mesh on every machine: random choices come from hashes, and coordinates are rounded after
//! using a sine.

mod basic;
pub mod chess;
mod city;
mod crowd;
mod ground;
mod hello;
mod model;
pub(crate) mod noise;
mod odd;
mod scan;
mod sweep;
mod tagged;

pub use basic::{
    cube, cube_sphere, globe, n_gon, octahedron, plane, pole, prism, quad_pole, strip, tetrahedron, torus,
};
pub use crowd::Crowd;
pub use ground::Ground;
pub use odd::{bow_tie, fin, moebius, pinched, repeated_vertex, valence_two, valence_two_closed};
pub use scan::Scan;
pub use tagged::{
    boundary_sheet, chaikin_cube, corner_cube, crease_cube, crease_loop_cube, hole_cube, smooth_octahedron,
};

use super::{BoundaryRule, ControlMesh};
use glam::DVec3;

/// A shape of the corpus.
pub type NamedShape = (&'static str, ControlMesh);

/// The whole corpus: every topology and tag that the surface has rules for, each in a mesh of a few faces.
///
/// ```
/// for (name, mesh) in lazytess::mesh::shapes::all() {
///     assert!(mesh.validate().is_ok(), "{name}");
/// }
/// ```
pub fn all() -> Vec<NamedShape> {
    let mut shapes = all_closed();
    shapes.extend(all_open());
    shapes
}

/// Shapes without boundary.
pub fn all_closed() -> Vec<NamedShape> {
    vec![
        ("cube", cube()),
        ("tetrahedron", tetrahedron()),
        ("octahedron", octahedron()),
        ("torus", torus(8, 6, 2.0, 0.75)),
        ("cube-sphere", cube_sphere(3)),
        ("globe-5", globe(5, 4)),
        ("globe-30", globe(30, 3)),
        ("prism-3", prism(3)),
        ("prism-5", prism(5)),
        ("prism-40", prism(40)),
        ("crease-cube-1", crease_cube(1.0)),
        ("crease-cube-2.5", crease_cube(2.5)),
        ("crease-cube-infinite", crease_cube(f32::INFINITY)),
        ("crease-loop-cube-0.5", crease_loop_cube(0.5)),
        ("crease-loop-cube-infinite", crease_loop_cube(f32::INFINITY)),
        ("corner-cube-1.7", corner_cube(1.7)),
        ("corner-cube-infinite", corner_cube(f32::INFINITY)),
        ("chaikin-cube", chaikin_cube()),
        ("smooth-octahedron", smooth_octahedron()),
        ("bow-tie", bow_tie()),
        ("valence-2-closed", valence_two_closed()),
    ]
}

fn all_open() -> Vec<NamedShape> {
    vec![
        ("plane", plane(3, 2)),
        ("strip", strip(5)),
        ("triangle", n_gon(3)),
        ("quad", n_gon(4)),
        ("heptagon", n_gon(7)),
        ("pole-3", pole(3)),
        ("pole-12", pole(12)),
        ("quad-pole-5", quad_pole(5)),
        ("sheet-no-boundary", boundary_sheet(BoundaryRule::None)),
        ("sheet-edge-and-corner", boundary_sheet(BoundaryRule::EdgeAndCorner)),
        ("sheet-edge-only", boundary_sheet(BoundaryRule::EdgeOnly)),
        ("hole-cube", hole_cube()),
        ("fin", fin()),
        ("pinched", pinched()),
        ("moebius", moebius(7)),
        ("repeated-vertex", repeated_vertex()),
        ("valence-2", valence_two()),
    ]
}

/// A mesh of polygons that are right by construction.
fn polygons<F: AsRef<[u32]>>(positions: Vec<DVec3>, faces: impl IntoIterator<Item = F>) -> ControlMesh {
    let mut mesh = ControlMesh { positions, ..Default::default() };
    for face in faces {
        mesh.face_sizes.push(face.as_ref().len() as u32);
        mesh.face_vertices.extend(face.as_ref().iter().map(|&v| crate::ids::VertexId(v)));
    }
    debug_assert!(mesh.validate().is_ok());
    mesh
}

/// Meshes that the scenes of this project are made of, by the stem of their file in `scenes/meshes`.
pub fn scene_meshes() -> Vec<NamedShape> {
    let chess = [
        ("chess-pawn", chess::pawn()),
        ("chess-rook", chess::rook()),
        ("chess-knight", chess::knight()),
        ("chess-bishop", chess::bishop()),
        ("chess-queen", chess::queen()),
        ("chess-king", chess::king()),
        ("chess-board", chess::board()),
        ("chess-frame", chess::frame()),
    ];
    hello::meshes().into_iter().chain(chess).chain(city::meshes()).collect()
}

/// Point `i` of `n` on the circle of the given radius about the y axis, from +x towards -z, so that a loop of points
/// runs counter-clockwise seen from above.
fn on_circle(i: u32, n: u32, radius: f64, y: f64) -> DVec3 {
    let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
    super::sink::round(DVec3::new(radius * cos, y, -radius * sin))
}

#[cfg(test)]
pub(crate) mod measure;

#[cfg(test)]
mod tests {
    use super::measure::{Edges, signed_volume};
    use super::*;

    #[test]
    fn names_are_unique_and_meshes_valid() {
        let shapes = all();
        let names: std::collections::BTreeSet<_> = shapes.iter().map(|(name, _)| name).collect();
        assert_eq!(names.len(), shapes.len());
        shapes.iter().for_each(|(name, mesh)| assert!(mesh.validate().is_ok(), "{name}"));
    }

    #[test]
    fn closed_shapes_have_two_opposite_faces_at_each_edge() {
        for (name, mesh) in all_closed() {
            assert!(Edges::of(&mesh).closed(), "{name}");
        }
        for (name, mesh) in all_open().into_iter().filter(|(name, _)| *name != "hole-cube") {
            assert!(!Edges::of(&mesh).closed(), "{name}");
        }
    }

    #[test]
    fn faces_look_outwards() {
        for (name, mesh) in all_closed() {
            let volume = signed_volume(&mesh);
            assert!(volume > 0.1 || (name == "valence-2-closed" && volume == 0.0), "{name}: {volume}");
        }
    }

    #[test]
    fn euler_characteristic_is_that_of_the_shape() {
        for (name, mesh) in all_closed() {
            let expected = match name {
                "torus" => 0,
                // Two spheres that share a point.
                "bow-tie" => 3,
                _ => 2,
            };
            assert_eq!(Edges::of(&mesh).euler_characteristic(&mesh), expected, "{name}");
        }
        assert_eq!(Edges::of(&moebius(7)).euler_characteristic(&moebius(7)), 0);
    }

    #[test]
    fn open_faces_of_flat_shapes_look_up() {
        for mesh in [plane(3, 2), n_gon(7), pole(12), quad_pole(5), strip(3)] {
            let normals = mesh.faces().map(|face| {
                let p = |i: usize| mesh.positions[face[i].idx()];
                (p(1) - p(0)).cross(p(2) - p(0)).y
            });
            normals.for_each(|y| assert!(y > 0.0));
        }
    }
}
