//! OBJ files with subdivision tags, read into a [`ControlMesh`].
//!
//! Polygons (`v`, `f`) of up to 4096 sides and OpenSubdiv's `t` **tags**. Objects and groups (`o`, `g`, `usemtl`) do not
//! split the mesh: faces and vertices keep their order in the file as their ids, and a vertex that two groups share is
//! one vertex. Texture coordinates, normals, materials, points and lines are passed over; free-form geometry is passed
//! over with a warning.
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
//! The file is read once, in blocks of a megabyte that threads parse side by side (`blocks.rs`): besides the mesh only
//! a few of them are in memory. Why this is not a library: those that read f64 renumber vertices by first use and split
//! them at groups, so the numbers in tags no longer mean anything (`notes/dependencies.md`). The tests compare with one
//! of them where that does not matter.

mod blocks;
mod edits;
mod elements;
mod lines;
mod tags;

use crate::error::{Error, ErrorKind, Result};
use crate::io::process::resident_bytes;
use crate::mesh::ControlMesh;
use elements::MeshBuilder;
use lines::{LogicalLines, words};
use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// A mesh and what its reader had to pass over.
#[derive(Debug)]
pub struct ObjMesh {
    /// The validated mesh.
    pub mesh: ControlMesh,
    /// Sentences with file and line for stderr; at most a handful.
    pub warnings: Vec<String>,
}

/// How a file is read.
#[derive(Clone, Copy)]
pub struct ReadOptions<'a> {
    /// Bytes that the process may have resident meanwhile.
    pub limit: u64,
    /// Threads that parse.
    pub n_threads: usize,
    /// Called now and then with the bytes read so far.
    pub progress: &'a dyn Fn(u64),
}

/// Reads an OBJ file on the calling thread.
pub fn read_obj(path: &Path) -> Result<ObjMesh> {
    read_obj_with(path, &ReadOptions { limit: u64::MAX, n_threads: 1, progress: &|_| () })
}

/// Reads an OBJ file.
///
/// # Errors
/// Of kind [`ErrorKind::Budget`] as soon as the process has more than `limit` bytes resident, with what the file would
/// take if it goes on as it began.
pub fn read_obj_with(path: &Path, options: &ReadOptions<'_>) -> Result<ObjMesh> {
    let file = File::open(path).map_err(|e| Error::io("read", path, e))?;
    let length = file.metadata().map_or(0, |m| m.len());
    let (exceeded, at_start) = (Cell::new(None), resident_bytes().unwrap_or(0));
    let watched = Watched { file, options, n_read: 0, next_look: LOOK_EVERY, exceeded: &exceeded };
    let most_parsers = (length / blocks::BLOCK_BYTES as u64) as usize;
    let mesh = if options.n_threads < 2 || length < 2 * blocks::BLOCK_BYTES as u64 {
        parse_obj(BufReader::with_capacity(1 << 16, watched), path)
    } else {
        blocks::parse_blocks(watched, path, options.n_threads.min(most_parsers), blocks::BLOCK_BYTES)
    };
    mesh.map_err(|error| match exceeded.get() {
        None => error,
        Some((n_read, resident)) => {
            let so_far = resident.saturating_sub(at_start) as f64;
            let whole = at_start + (so_far * length.max(n_read) as f64 / n_read as f64) as u64;
            let part = 100 * n_read / length.max(n_read);
            let [given, whole] = [options.limit >> 20, whole.div_ceil(1 << 20)];
            let message =
                format!("--memory {given}M is too little: {part} % of the file fill it; all of it takes {whole}M");
            Error::new(ErrorKind::Budget, message).at(path, None)
        }
    })
}

/// Bytes of file between two looks at the memory.
const LOOK_EVERY: u64 = 1 << 20;

/// A file that refuses to be read on when too much memory is resident.
struct Watched<'a> {
    file: File,
    options: &'a ReadOptions<'a>,
    n_read: u64,
    next_look: u64,
    /// Bytes read and bytes resident when it was too much.
    exceeded: &'a Cell<Option<(u64, u64)>>,
}

impl Read for Watched<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.n_read >= self.next_look {
            self.next_look += LOOK_EVERY;
            (self.options.progress)(self.n_read);
            if let Some(resident) = resident_bytes().filter(|&n| n > self.options.limit) {
                self.exceeded.set(Some((self.n_read, resident)));
                return Err(io::ErrorKind::OutOfMemory.into());
            }
        }
        let n = self.file.read(out)?;
        self.n_read += n as u64;
        Ok(n)
    }
}

/// Reads OBJ text from anywhere; `path` is for messages.
pub fn parse_obj(reader: impl BufRead, path: &Path) -> Result<ObjMesh> {
    let mut mesh = MeshBuilder::default();
    read_lines(&mut mesh, LogicalLines::new(reader), path)?;
    mesh.finish(path)
}

fn read_lines(mesh: &mut MeshBuilder, mut lines: LogicalLines<impl BufRead>, path: &Path) -> Result<()> {
    while let Some(line) = lines.next_line().map_err(|e| Error::io("read", path, e))? {
        mesh.set_line(line.number);
        read_line(mesh, line.text).map_err(|m| Error::input(m).at(path, Some(line.number)))?;
    }
    Ok(())
}

/// Statements of the format that carry no polygon of ours.
const PASSED_OVER: [&[u8]; 18] = [
    b"vt",
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
