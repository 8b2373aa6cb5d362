//! OBJ files with subdivision tags, read into a [`ControlMesh`].
//!
//! Polygons (`v`, `vt`, `f`) of any size and OpenSubdiv's `t` **tags**. Objects and groups (`o`, `g`, `usemtl`) do not
//! split the mesh: faces and vertices keep their order in the file as their ids, and a vertex that two groups share is
//! one vertex. Normals, materials, points and lines are passed over; free-form geometry is passed over with a warning.
//!
//! A tag is `t NAME ints/floats/strings ARGUMENTS...`, its vertex and face numbers count from 0:
//!
//! ```text
//! t crease 2/1/0 a b s                  the edge between vertices a and b has sharpness s; more integers make a chain
//! t corner 1/1/0 a s                    vertex a has sharpness s
//! t hole n/0/0 f1 .. fn                 these faces have no surface
//! t interpolateboundary 1/0/0 k         boundary rule 0, 1 or 2
//! t creasemethod 0/0/1 NAME             normal or chaikin
//! t smoothtriangles 0/0/1 NAME          catmark or smooth
//! t vertexedit | edgeedit | faceedit    hierarchical edits (RISpec 3.2), see `edits.rs`
//! ```
//!
//! The file is read once, line by line: besides the mesh only one line is in memory. Why this is not a library: those
//! that read f64 renumber vertices by first use and split them at groups, so the numbers in tags no longer mean anything
//! (`notes/dependencies.md`). The tests compare with one of them where that does not matter.

mod edits;
mod elements;
mod lines;
mod tags;

use crate::error::{Error, Result};
use crate::mesh::ControlMesh;
use elements::MeshBuilder;
use lines::{LogicalLines, words};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// A mesh and what its reader had to pass over.
#[derive(Debug)]
pub struct ObjMesh {
    /// The validated mesh.
    pub mesh: ControlMesh,
    /// Sentences with file and line for stderr; at most a handful.
    pub warnings: Vec<String>,
}

/// Reads an OBJ file.
pub fn read_obj(path: &Path) -> Result<ObjMesh> {
    let file = File::open(path).map_err(|e| Error::io("read", path, e))?;
    parse_obj(BufReader::with_capacity(1 << 16, file), path)
}

/// Reads OBJ text from anywhere; `path` is for messages.
pub fn parse_obj(reader: impl BufRead, path: &Path) -> Result<ObjMesh> {
    let mut lines = LogicalLines::new(reader);
    let mut mesh = MeshBuilder::default();
    while let Some(line) = lines.next_line().map_err(|e| Error::io("read", path, e))? {
        mesh.set_line(line.number);
        read_line(&mut mesh, line.text).map_err(|m| Error::input(m).at(path, Some(line.number)))?;
    }
    mesh.finish(path)
}

/// Statements of the format that carry no polygon of ours.
const PASSED_OVER: [&[u8]; 17] = [
    b"vn",
    b"o",
    b"g",
    b"s",
    b"mg",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"l",
    b"p",
    b"lod",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"shadow_obj",
    b"trace_obj",
];

fn read_line(mesh: &mut MeshBuilder, line: &[u8]) -> Result<(), String> {
    let mut words = words(line);
    let Some(keyword) = words.next() else { return Ok(()) };
    match keyword {
        b"v" => mesh.vertex(words),
        b"vt" => mesh.tex_coord(words),
        b"f" => mesh.face(words),
        b"t" => tags::read_tag(mesh, words),
        comment if comment[0] == b'#' => Ok(()),
        known if PASSED_OVER.contains(&known) => Ok(()),
        other => {
            let name = String::from_utf8_lossy(&other[..other.len().min(40)]).escape_debug().to_string();
            mesh.warn_once(&name, format!("'{name}' is no statement this program reads: passed over"));
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests;
