//! A file in blocks of whole lines, read by one thread and parsed by others.
//!
//! A **plain** block, of vertices and of faces that count from the first one, is parsed on its own into a part of the
//! mesh. Any other block (tags, relative indices, whatever is wrong) is parsed when its turn comes, as if there were no
//! blocks, so that the mesh, the warnings and the first error are those of reading line by line.

use super::elements::MeshBuilder;
use super::lines::{LogicalLines, MAX_LINE, words};
use super::{ObjMesh, PASSED_OVER, parse_obj, read_lines};
use crate::error::{Error, Result};
use crossbeam::channel::{Receiver, Sender, bounded};
use std::collections::VecDeque;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Bytes of a block, unless a line is longer.
pub(super) const BLOCK_BYTES: usize = 1 << 20;

/// Whole lines of a file.
struct Block {
    /// Number of its first line, from 1.
    first_line: usize,
    text: Vec<u8>,
}

/// A block, and what it is if it is plain.
type Parsed = (Block, Option<MeshBuilder>);

/// Reads OBJ text on `n_threads` threads and the caller's, in blocks of `block_bytes`.
pub(super) fn parse_blocks(reader: impl Read, path: &Path, n_threads: usize, block_bytes: usize) -> Result<ObjMesh> {
    let (jobs, queue) = bounded::<(Block, Sender<Parsed>)>(n_threads);
    std::thread::scope(|scope| {
        let spawn = |_| {
            let queue: Receiver<(Block, Sender<Parsed>)> = queue.clone();
            let work = move || {
                for (block, done) in queue {
                    let part = parse_plain(&block);
                    // Nobody listens any more if an earlier block was wrong.
                    let _ = done.send((block, part));
                }
            };
            std::thread::Builder::new().spawn_scoped(scope, work).is_ok()
        };
        // Where the system refuses a thread there are fewer.
        if (0..n_threads).take_while(|i| spawn(*i)).count() == 0 {
            return parse_obj(BufReader::new(reader), path);
        }
        let blocks = Blocks { reader, rest: Vec::new(), next_line: 1, block_bytes };
        let mesh = join(blocks, path, &jobs, n_threads);
        // Lets the parsers end.
        drop(jobs);
        mesh?.finish(path)
    })
}

/// Hands out blocks and joins them in the order of the file.
fn join<R: Read>(
    mut blocks: Blocks<R>,
    path: &Path,
    jobs: &Sender<(Block, Sender<Parsed>)>,
    n_threads: usize,
) -> Result<MeshBuilder> {
    let mut mesh = MeshBuilder::default();
    let mut pending: VecDeque<Receiver<Parsed>> = VecDeque::new();
    let end = loop {
        if pending.len() > n_threads {
            add_first(&mut mesh, &mut pending, path)?;
        }
        match blocks.next() {
            Ok(Some(block)) => {
                let (done, parsed) = bounded(1);
                jobs.send((block, done)).expect("parsers run until the last job");
                pending.push_back(parsed);
            }
            Ok(None) => break Ok(()),
            Err(e) => break Err(Error::io("read", path, e)),
        }
    };
    while !pending.is_empty() {
        add_first(&mut mesh, &mut pending, path)?;
    }
    end.map(|()| mesh)
}

fn add_first(mesh: &mut MeshBuilder, pending: &mut VecDeque<Receiver<Parsed>>, path: &Path) -> Result<()> {
    let Some(parsed) = pending.pop_front() else { return Ok(()) };
    match parsed.recv().expect("parsers answer every job") {
        (_, Some(part)) => {
            mesh.append(part);
            Ok(())
        }
        (block, None) => read_lines(mesh, LogicalLines::starting_at(block.first_line, block.text.as_slice()), path),
    }
}

/// A block's part of the mesh, unless something in it has to be seen in its place.
fn parse_plain(block: &Block) -> Option<MeshBuilder> {
    let mut lines = LogicalLines::starting_at(block.first_line, block.text.as_slice());
    let mut part = MeshBuilder::default();
    while let Some(line) = lines.next_line().ok()? {
        part.set_line(line.number);
        let mut words = words(line.text);
        match words.next() {
            Some(b"v") => part.vertex(words).ok()?,
            Some(b"f") if !line.text.contains(&b'-') => part.face(words).ok()?,
            Some(comment) if comment[0] == b'#' => {}
            Some(known) if PASSED_OVER.contains(&known) => {}
            None => {}
            _ => return None,
        }
    }
    Some(part)
}

/// Cuts what a reader gives at ends of lines.
struct Blocks<R> {
    reader: R,
    /// The beginning of the next block, read with the last one.
    rest: Vec<u8>,
    next_line: usize,
    block_bytes: usize,
}

impl<R: Read> Blocks<R> {
    /// The next block, or `None` at the end of the file.
    fn next(&mut self) -> io::Result<Option<Block>> {
        let mut text = std::mem::take(&mut self.rest);
        // A line that is too long is a block that `LogicalLines` refuses.
        while text.len() < MAX_LINE {
            let n_seen = text.len();
            text.reserve(self.block_bytes);
            if self.reader.by_ref().take(self.block_bytes as u64).read_to_end(&mut text)? == 0 {
                break;
            }
            if let Some(end) = end_of_last_line(&text, n_seen) {
                self.rest.extend_from_slice(&text[end..]);
                text.truncate(end);
                break;
            }
        }
        let first_line = self.next_line;
        self.next_line += text.iter().filter(|&&b| b == b'\n').count();
        Ok((!text.is_empty()).then_some(Block { first_line, text }))
    }
}

/// Where the last line ends that is not continued, if it ends at `from` or after.
fn end_of_last_line(text: &[u8], from: usize) -> Option<usize> {
    let is_end = |&i: &usize| {
        let line = text[..i].strip_suffix(b"\r").unwrap_or(&text[..i]);
        text[i] == b'\n' && line.last() != Some(&b'\\')
    };
    (from..text.len()).rev().find(is_end).map(|i| i + 1)
}
