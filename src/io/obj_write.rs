//! Control meshes as OBJ with tags, written as they come: nothing but one line is held.
//!
//! Numbers are written in the shortest form that reads back as the same `f64`, so a mesh survives the way through a
//! file bit for bit (an infinite sharpness is written as 10, which means the same).

use super::write::{Output, write_whole};
use crate::error::Result;
use crate::ids::VertexId;
use crate::mesh::{
    BoundaryRule, ControlMesh, Corner, Crease, CreaseMethod, Edit, EditKind, EditValue, MeshSink, TriangleRule,
};
use glam::DVec3;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

/// A sink that writes OBJ text.
pub struct ObjWriter<W> {
    out: W,
    /// The line being put together.
    line: String,
}

/// Creates or replaces the file `path` with what `fill` writes.
pub fn write_obj(path: &Path, fill: impl FnOnce(&mut ObjWriter<&mut Output>) -> io::Result<()>) -> Result<()> {
    write_whole(path, |out| fill(&mut ObjWriter::new(out)))
}

impl<W: Write> ObjWriter<W> {
    /// A writer at the start of its file.
    pub fn new(out: W) -> Self {
        Self { out, line: String::new() }
    }

    /// Writes a comment line.
    pub fn comment(&mut self, text: &str) -> io::Result<()> {
        self.write(format_args!("# {text}"))
    }

    /// Writes a whole mesh with all its tags.
    pub fn mesh(&mut self, mesh: &ControlMesh) -> io::Result<()> {
        mesh.positions.iter().try_for_each(|&p| self.vertex(p))?;
        mesh.faces().try_for_each(|face| self.face(face))?;
        self.rules(mesh)?;
        mesh.creases.iter().try_for_each(|&crease| self.crease(crease))?;
        mesh.corners.iter().try_for_each(|&corner| self.corner(corner))?;
        mesh.holes.iter().try_for_each(|face| self.write(format_args!("t hole 1/0/0 {face}")))?;
        mesh.edits.iter().try_for_each(|edit| self.edit(edit))
    }

    fn rules(&mut self, mesh: &ControlMesh) -> io::Result<()> {
        match mesh.boundary {
            BoundaryRule::None => self.write(format_args!("t interpolateboundary 1/0/0 0"))?,
            BoundaryRule::EdgeAndCorner => self.write(format_args!("t interpolateboundary 1/0/0 1"))?,
            BoundaryRule::EdgeOnly => {}
        }
        if mesh.crease_method == CreaseMethod::Chaikin {
            self.write(format_args!("t creasemethod 0/0/1 chaikin"))?;
        }
        if mesh.triangles == TriangleRule::Smooth {
            self.write(format_args!("t smoothtriangles 0/0/1 smooth"))?;
        }
        Ok(())
    }

    fn edit(&mut self, edit: &Edit) -> io::Result<()> {
        let tag = match edit.kind {
            EditKind::Vertex => "vertexedit",
            EditKind::Edge => "edgeedit",
            EditKind::Face => "faceedit",
        };
        let path: String = edit.path.iter().map(|child| format!(" {child}")).collect();
        let (floats, strings) = match edit.value {
            EditValue::AddPosition(p) => (p.to_array().to_vec(), "add P value"),
            EditValue::SetPosition(p) => (p.to_array().to_vec(), "set P value"),
            EditValue::AddSharpness(s) => (vec![f64::from(s)], "add P sharpness"),
            EditValue::SetSharpness(s) => (vec![f64::from(s)], "set P sharpness"),
            EditValue::Hole => (vec![], "hole"),
        };
        let values: String = floats.iter().map(|x| format!(" {x}")).collect();
        let (n_ints, n_floats, n_strings) = (edit.path.len() + 1, floats.len(), strings.split(' ').count());
        let n = edit.path.len();
        self.write(format_args!("t {tag} {n_ints}/{n_floats}/{n_strings} {n}{path}{values} {strings}"))
    }

    fn write(&mut self, text: std::fmt::Arguments) -> io::Result<()> {
        // Writing to a string cannot fail.
        let _ = self.line.write_fmt(text);
        self.end_line()
    }

    fn end_line(&mut self) -> io::Result<()> {
        self.line.push('\n');
        self.out.write_all(self.line.as_bytes())?;
        self.line.clear();
        Ok(())
    }
}

impl<W: Write> MeshSink for ObjWriter<W> {
    fn vertex(&mut self, p: DVec3) -> io::Result<()> {
        self.write(format_args!("v {} {} {}", p.x, p.y, p.z))
    }

    fn face(&mut self, corners: &[VertexId]) -> io::Result<()> {
        self.line.push('f');
        for v in corners {
            let _ = write!(self.line, " {}", v.0 + 1);
        }
        self.end_line()
    }

    fn crease(&mut self, crease: Crease) -> io::Result<()> {
        let [a, b] = crease.edge;
        self.write(format_args!("t crease 2/1/0 {a} {b} {}", crease.sharpness.min(10.0)))
    }

    fn corner(&mut self, corner: Corner) -> io::Result<()> {
        self.write(format_args!("t corner 1/1/0 {} {}", corner.vertex, corner.sharpness.min(10.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::FaceId;
    use crate::io::obj::parse_obj;
    use crate::mesh::shapes;

    fn through_text(mesh: &ControlMesh) -> ControlMesh {
        let mut text = Vec::new();
        ObjWriter::new(&mut text).mesh(mesh).unwrap();
        let read = parse_obj(text.as_slice(), Path::new("test.obj")).unwrap();
        assert_eq!(read.warnings, Vec::<String>::new());
        read.mesh
    }

    fn with_finite_sharpness(mut mesh: ControlMesh) -> ControlMesh {
        mesh.creases.iter_mut().for_each(|c| c.sharpness = c.sharpness.min(10.0));
        mesh.corners.iter_mut().for_each(|c| c.sharpness = c.sharpness.min(10.0));
        mesh
    }

    #[test]
    fn corpus_survives_the_way_through_a_file() {
        for (name, mesh) in shapes::all() {
            assert_eq!(through_text(&mesh), with_finite_sharpness(mesh), "{name}");
        }
    }

    #[test]
    fn coordinates_keep_their_bits() {
        let mut mesh = shapes::cube();
        mesh.positions[3] = DVec3::new(0.1 + 0.2, -1e-30, 1.0 / 3.0);
        mesh.positions[5] = DVec3::new(1e29, f64::MIN_POSITIVE, -0.0);
        assert_eq!(through_text(&mesh), mesh);
    }

    #[test]
    fn holes_and_edits_survive() {
        let cube = shapes::hole_cube();
        let edit = |kind, path: &[u32], value| Edit { kind, path: path.to_vec(), value };
        let mesh = ControlMesh {
            edits: vec![
                edit(EditKind::Vertex, &[0, 1, 2, 3], EditValue::AddPosition(DVec3::new(0.1, 2.0, -3.0))),
                edit(EditKind::Vertex, &[0, 1], EditValue::SetPosition(DVec3::ONE)),
                edit(EditKind::Edge, &[1, 1], EditValue::SetSharpness(2.5)),
                edit(EditKind::Edge, &[1, 1, 0], EditValue::AddSharpness(-0.5)),
                edit(EditKind::Face, &[2, 1], EditValue::Hole),
            ],
            holes: vec![FaceId(1), FaceId(4)],
            ..cube
        };
        mesh.validate().unwrap();
        assert_eq!(through_text(&mesh), mesh);
    }
}
