//! Where generators put a mesh, piece by piece, so that ten million faces never have to be held.

use super::{ControlMesh, Corner, Crease};
use crate::ids::VertexId;
use glam::{DAffine3, DVec3};
use std::io::Result;

/// A receiver of vertices, faces and sharpness.
///
/// A face may name only vertices that were given before it. Ids count from 0 in the order of the calls.
pub trait MeshSink {
    /// Takes the next vertex.
    fn vertex(&mut self, position: DVec3) -> Result<()>;
    /// Takes the next face: at least three corners, counter-clockwise seen from outside.
    fn face(&mut self, corners: &[VertexId]) -> Result<()>;
    /// Takes a sharp edge.
    fn crease(&mut self, crease: Crease) -> Result<()>;
    /// Takes a sharp vertex.
    fn corner(&mut self, corner: Corner) -> Result<()>;
}

impl MeshSink for ControlMesh {
    fn vertex(&mut self, position: DVec3) -> Result<()> {
        self.positions.push(position);
        Ok(())
    }

    fn face(&mut self, corners: &[VertexId]) -> Result<()> {
        self.face_sizes.push(corners.len() as u32);
        self.face_vertices.extend_from_slice(corners);
        Ok(())
    }

    fn crease(&mut self, crease: Crease) -> Result<()> {
        self.creases.push(crease);
        Ok(())
    }

    fn corner(&mut self, corner: Corner) -> Result<()> {
        self.corners.push(corner);
        Ok(())
    }
}

/// Puts many small meshes into one sink, renumbering their vertices.
pub struct Assembly<'a> {
    sink: &'a mut dyn MeshSink,
    n_vertices: u32,
}

impl<'a> Assembly<'a> {
    /// An empty assembly; `sink` must be empty too.
    pub fn new(sink: &'a mut dyn MeshSink) -> Self {
        Self { sink, n_vertices: 0 }
    }

    /// Adds the polygons, creases and corners of `part`, moved by `world_from_part`.
    ///
    /// Rules that hold for a whole mesh (boundary, crease method, triangles) do not pass to the assembly.
    pub fn add(&mut self, part: &ControlMesh, world_from_part: DAffine3) -> Result<()> {
        let moved = |v: VertexId| VertexId(v.0 + self.n_vertices);
        for &p in &part.positions {
            self.sink.vertex(round(world_from_part.transform_point3(p)))?;
        }
        let mut corners = Vec::new();
        for face in part.faces() {
            corners.clear();
            corners.extend(face.iter().map(|&v| moved(v)));
            self.sink.face(&corners)?;
        }
        for c in &part.creases {
            self.sink.crease(Crease { edge: c.edge.map(moved), ..*c })?;
        }
        for c in &part.corners {
            self.sink.corner(Corner { vertex: moved(c.vertex), ..*c })?;
        }
        self.n_vertices += part.positions.len() as u32;
        Ok(())
    }
}

/// The nearest point with four decimals: short in a file, and the same on machines whose sine differs in the last bit.
pub(super) fn round(p: DVec3) -> DVec3 {
    // Adding zero turns -0 into 0, which is shorter too.
    (p * 1e4).round() / 1e4 + DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn assembled_parts_keep_their_shape_and_tags() {
        let mut both = ControlMesh::default();
        let mut assembly = Assembly::new(&mut both);
        let cube = shapes::crease_cube(2.5);
        assembly.add(&cube, DAffine3::IDENTITY).unwrap();
        assembly.add(&cube, DAffine3::from_translation(DVec3::X * 4.0)).unwrap();
        both.validate().unwrap();
        assert_eq!((both.positions.len(), both.n_faces(), both.creases.len()), (16, 12, 24));
        assert_eq!(both.positions[15] - both.positions[7], DVec3::X * 4.0);
        assert_eq!(both.creases[12].edge[0].0, cube.creases[0].edge[0].0 + 8);
    }
}
