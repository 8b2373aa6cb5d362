//! Collects vertices, faces and tags line by line; checks at the end what needs the whole file.
//!
//! A face or tag may name an element that a later line defines. So each kind of reference remembers how far it
//! **reaches**, and in which line; the end of the file compares that with what there is.

use super::ObjMesh;
use crate::error::{Error, Result};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{ControlMesh, Corner, Crease, Edit};
use glam::DVec3;
use std::path::Path;

/// Coordinates beyond this are refused: squares of differences must stay far from the end of f64 and f32.
const MAX_COORDINATE: f64 = 1e30;
/// Indices up to here fit the mesh's 32-bit ids with a bit to spare.
const MAX_INDEX: i64 = (u32::MAX / 2) as i64;
/// Kinds of warnings reported from one file.
const MAX_WARNINGS: usize = 8;

/// The farthest element that a kind of reference names.
#[derive(Default)]
struct Reach {
    /// One more than the largest index.
    end: usize,
    /// The line that has it.
    line: usize,
}

impl Reach {
    fn note(&mut self, index: u32, line: usize) {
        if index as usize >= self.end {
            *self = Self { end: index as usize + 1, line };
        }
    }

    /// As if what `later` has noted had been noted here.
    fn append(&mut self, later: Self) {
        if later.end > self.end {
            *self = later;
        }
    }

    /// An error if fewer than `end` elements exist; `first` is the number of the first element in this kind of line.
    fn check(&self, what: &str, first: usize, n_there: usize, path: &Path) -> Result<()> {
        if self.end <= n_there {
            return Ok(());
        }
        let named = self.end - 1 + first;
        let message = format!("{what} {named} does not exist: the file has {n_there}, counted from {first}");
        Err(Error::input(message).at(path, Some(self.line)))
    }
}

/// A mesh in the making.
#[derive(Default)]
pub struct MeshBuilder {
    /// Rules are set here directly by tags.
    pub mesh: ControlMesh,
    line: usize,
    reach_of_faces: Reach,
    reach_of_tags_to_vertices: Reach,
    reach_of_tags_to_faces: Reach,
    edit_lines: Vec<usize>,
    warnings: Vec<(String, usize, String)>,
}

impl MeshBuilder {
    /// The line that everything until the next call comes from.
    pub fn set_line(&mut self, line: usize) {
        self.line = line;
    }

    /// Notes a warning about the current line, unless its kind has been noted before.
    pub fn warn_once(&mut self, kind: &str, message: String) {
        if self.warnings.len() < MAX_WARNINGS && self.warnings.iter().all(|(known, ..)| known != kind) {
            self.warnings.push((kind.to_owned(), self.line, message));
        }
    }

    /// `v x y z`, perhaps with a weight or colour after it.
    pub fn vertex<'a>(&mut self, mut words: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
        let mut coordinate = |name| {
            let word = words.next().ok_or_else(|| format!("a vertex needs x, y and z; {name} is missing"))?;
            let value = number(word)?;
            if value.abs() > MAX_COORDINATE {
                return Err(format!("coordinate {} lies beyond {MAX_COORDINATE:e}: scale the mesh down", show(word)));
            }
            Ok(value)
        };
        let position = DVec3::new(coordinate("x")?, coordinate("y")?, coordinate("z")?);
        self.mesh.positions.push(position);
        words.try_for_each(|word| number(word).map(drop))
    }

    /// `f a b c ...` with corners `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    pub fn face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
        let first = self.mesh.face_vertices.len();
        for word in words {
            self.face_corner(word)?;
        }
        let n = self.mesh.face_vertices.len() - first;
        if n < 3 {
            return Err(format!("a face needs at least 3 corners and this one has {n}: delete it or add corners"));
        }
        if n > ControlMesh::MOST_CORNERS as usize {
            return Err(format!(
                "a face has at most {} corners and this one has {n}: divide it",
                ControlMesh::MOST_CORNERS
            ));
        }
        self.mesh.face_sizes.push(n as u32);
        Ok(())
    }

    fn face_corner(&mut self, word: &[u8]) -> Result<(), String> {
        let mut parts = word.split(|&b| b == b'/');
        let vertex = parts.next().unwrap_or_default();
        let vertex = resolve(vertex, self.mesh.positions.len(), "vertex")?;
        self.reach_of_faces.note(vertex, self.line);
        self.mesh.face_vertices.push(VertexId(vertex));
        // Texture coordinates and normals are not used, but a corner that is no corner is reported.
        for unused in parts.by_ref().take(2).filter(|part| !part.is_empty()) {
            integer(unused)?;
        }
        if parts.next().is_some() {
            return Err(format!("corner {} has more than three parts", show(word)));
        }
        Ok(())
    }

    /// A `t crease` link.
    pub fn crease(&mut self, edge: [VertexId; 2], sharpness: f32) {
        edge.iter().for_each(|v| self.reach_of_tags_to_vertices.note(v.0, self.line));
        self.mesh.creases.push(Crease { edge, sharpness });
    }

    /// A `t corner`.
    pub fn corner(&mut self, vertex: VertexId, sharpness: f32) {
        self.reach_of_tags_to_vertices.note(vertex.0, self.line);
        self.mesh.corners.push(Corner { vertex, sharpness });
    }

    /// A `t hole`.
    pub fn hole(&mut self, face: FaceId) {
        self.reach_of_tags_to_faces.note(face.0, self.line);
        self.mesh.holes.push(face);
    }

    /// A hierarchical edit.
    pub fn edit(&mut self, edit: Edit) {
        self.reach_of_tags_to_faces.note(edit.path[0], self.line);
        self.edit_lines.push(self.line);
        self.mesh.edits.push(edit);
    }

    /// Adds vertices and faces of later lines, whose indices are absolute. They have no tags and no warnings.
    pub fn append(&mut self, part: Self) {
        self.mesh.positions.extend_from_slice(&part.mesh.positions);
        self.mesh.face_sizes.extend_from_slice(&part.mesh.face_sizes);
        self.mesh.face_vertices.extend_from_slice(&part.mesh.face_vertices);
        self.reach_of_faces.append(part.reach_of_faces);
    }

    /// The whole mesh, checked.
    pub fn finish(mut self, path: &Path) -> Result<ObjMesh> {
        let (n_vertices, n_faces) = (self.mesh.positions.len(), self.mesh.n_faces());
        if n_faces == 0 {
            return Err(Error::input("the mesh has no faces ('f' lines); is this an OBJ file?").at(path, None));
        }
        self.reach_of_faces.check("vertex", 1, n_vertices, path)?;
        self.reach_of_tags_to_vertices.check("vertex", 0, n_vertices, path)?;
        self.reach_of_tags_to_faces.check("face", 0, n_faces, path)?;
        self.check_edit_paths(path)?;
        shrink(&mut self.mesh);
        self.mesh.validate().map_err(|e| e.at(path, None))?;
        let place = |line: usize, message: &str| format!("{}:{line}: {message}", path.display());
        let warnings = self.warnings.iter().map(|(_, line, message)| place(*line, message)).collect();
        Ok(ObjMesh { mesh: self.mesh, warnings })
    }

    /// Paths depend on face sizes, which later lines may give.
    fn check_edit_paths(&self, path: &Path) -> Result<()> {
        let mut edits = self.mesh.edits.iter().zip(&self.edit_lines);
        edits.try_for_each(|(edit, &line)| edit.validate(&self.mesh.face_sizes).map_err(|e| e.at(path, Some(line))))
    }
}

/// Gives back what doubling vectors have reserved in excess.
fn shrink(mesh: &mut ControlMesh) {
    mesh.positions.shrink_to_fit();
    mesh.face_sizes.shrink_to_fit();
    mesh.face_vertices.shrink_to_fit();
}

/// An index from 1, or negative and relative to the elements so far, as an index from 0.
fn resolve(word: &[u8], n_so_far: usize, what: &str) -> Result<u32, String> {
    let index = match integer(word)? {
        0 => return Err(format!("{what} 0 does not exist: OBJ counts from 1")),
        n if n > 0 => n - 1,
        back => n_so_far as i64 + back,
    };
    match index {
        0..=MAX_INDEX => Ok(index as u32),
        i64::MIN..0 => Err(format!("{what} {} does not exist: {n_so_far} are defined before this line", show(word))),
        _ => Err(format!("{what} {} does not exist: a mesh has at most 2^31", show(word))),
    }
}

/// A decimal integer with an optional sign.
pub fn integer(word: &[u8]) -> Result<i64, String> {
    let (negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return Err(format!("{} is no index: write a whole number", show(word)));
    }
    // Eighteen digits cannot overflow.
    if digits.len() > 18 {
        return Err(format!("{} does not exist: a mesh has at most 2^31 vertices", show(word)));
    }
    let value = digits.iter().fold(0i64, |value, digit| value * 10 + i64::from(digit - b'0'));
    Ok(if negative { -value } else { value })
}

/// A finite decimal number.
pub fn number(word: &[u8]) -> Result<f64, String> {
    let value = std::str::from_utf8(word).ok().and_then(|text| text.parse::<f64>().ok());
    match value {
        Some(value) if value.is_finite() => Ok(value),
        Some(_) => Err(format!("{} is not a finite number", show(word))),
        None => Err(format!("{} is no number", show(word))),
    }
}

/// A word of the file for a message: quoted, control characters escaped, not too long.
pub fn show(word: &[u8]) -> String {
    let (head, more) = if word.len() > 40 { (&word[..40], "...") } else { (word, "") };
    format!("'{}{more}'", String::from_utf8_lossy(head).escape_debug())
}
