//! Shapes for each tag.

use super::basic::{cube, octahedron, plane};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{BoundaryRule, ControlMesh, Corner, Crease, CreaseMethod, TriangleRule};

/// The edges of [`cube`], four along each axis.
const CUBE_EDGES: [[u32; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The four edges of the side y = 1 of [`cube`], one after the other.
const TOP_LOOP: [[u32; 2]; 4] = [[2, 6], [6, 7], [7, 3], [3, 2]];

fn crease(edge: [u32; 2], sharpness: f32) -> Crease {
    Crease { edge: edge.map(VertexId), sharpness }
}

/// A cube whose edges all have this sharpness.
pub fn crease_cube(sharpness: f32) -> ControlMesh {
    ControlMesh { creases: CUBE_EDGES.map(|e| crease(e, sharpness)).to_vec(), ..cube() }
}

/// A cube with one sharp loop about its top.
pub fn crease_loop_cube(sharpness: f32) -> ControlMesh {
    ControlMesh { creases: TOP_LOOP.map(|e| crease(e, sharpness)).to_vec(), ..cube() }
}

/// A cube of which every other vertex is sharp: the four of a tetrahedron.
pub fn corner_cube(sharpness: f32) -> ControlMesh {
    let corners = [0, 3, 5, 6].map(|v| Corner { vertex: VertexId(v), sharpness });
    ControlMesh { corners: corners.to_vec(), ..cube() }
}

/// A cube with a top loop whose sharpness varies, decaying by Chaikin's rule.
pub fn chaikin_cube() -> ControlMesh {
    let creases = TOP_LOOP.iter().zip([3.5, 1.0, 2.0, 0.5]).map(|(&e, s)| crease(e, s)).collect();
    ControlMesh { creases, crease_method: CreaseMethod::Chaikin, ..cube() }
}

/// An octahedron with the triangle weights.
pub fn smooth_octahedron() -> ControlMesh {
    ControlMesh { triangles: TriangleRule::Smooth, ..octahedron() }
}

/// A cube without its side y = 1.
pub fn hole_cube() -> ControlMesh {
    ControlMesh { holes: vec![FaceId(3)], ..cube() }
}

/// A sheet of 4 x 4 quads, bent into a saddle, under one of the boundary rules.
pub fn boundary_sheet(boundary: BoundaryRule) -> ControlMesh {
    let mut sheet = plane(4, 4);
    sheet.positions.iter_mut().for_each(|p| p.y = 0.2 * (p.x * p.x - p.z * p.z));
    ControlMesh { boundary, ..sheet }
}
