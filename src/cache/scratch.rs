//! A thread's own memory for blocks that are used once: it lasts as long as a visit.
#![allow(unsafe_code)]

use super::memory::{LINE, Memory};
use std::cell::{Cell, RefCell};

/// Lines of an ordinary chunk: 64 KiB.
const CHUNK_LINES: usize = 1024;
/// Chunks kept from one visit to the next.
const CHUNKS_KEPT: usize = 4;
/// Bytes that a pin keeps between visits, at most.
pub(super) const BYTES_KEPT: usize = CHUNKS_KEPT * CHUNK_LINES * LINE;

struct Chunk {
    memory: Memory,
    lines: usize,
}

/// Chunks that are filled one after the other and emptied together.
#[derive(Default)]
pub(super) struct Scratch {
    chunks: RefCell<Vec<Chunk>>,
    current: Cell<usize>,
    /// Lines used of the current chunk. Zero if and only if the whole scratch is empty.
    used: Cell<usize>,
}

impl Scratch {
    /// `n_bytes` zeroed or stale bytes, rounded up to whole lines.
    ///
    /// # Panics
    /// If the system refuses the memory.
    #[allow(clippy::mut_from_ref)]
    pub(super) fn bytes(&self, n_bytes: usize) -> &mut [u8] {
        let lines = super::memory::lines_for(n_bytes).max(1);
        let mut chunks = self.chunks.borrow_mut();
        while chunks.get(self.current.get()).is_some_and(|chunk| self.used.get() + lines > chunk.lines) {
            self.current.set(self.current.get() + 1);
            self.used.set(0);
        }
        if self.current.get() == chunks.len() {
            chunks.push(Chunk::of(lines.max(CHUNK_LINES)));
        }
        let first = self.used.replace(self.used.get() + lines);
        // SAFETY: these lines lie inside the chunk and were not given out since `clear`, which needs `&mut self`, so that
        // no slice given out before is alive. Chunks own their lines by raw pointer and may move in the vector.
        unsafe { std::slice::from_raw_parts_mut(chunks[self.current.get()].memory.line(first), lines * LINE) }
    }

    /// Whether there are blocks.
    #[inline(always)]
    pub(super) fn is_used(&self) -> bool {
        self.used.get() != 0
    }

    /// Forgets all blocks. Keeps a little memory for the next visit.
    pub(super) fn clear(&mut self) {
        let mut kept = 0;
        self.chunks.get_mut().retain(|chunk| {
            kept += usize::from(chunk.lines == CHUNK_LINES);
            chunk.lines == CHUNK_LINES && kept <= CHUNKS_KEPT
        });
        self.current.set(0);
        self.used.set(0);
    }
}

impl Chunk {
    fn of(lines: usize) -> Self {
        let memory =
            Memory::zeroed(lines).expect("memory for one block, which its builder holds in another form already");
        Self { memory, lines }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_do_not_overlap_and_stay_where_they_are() {
        let scratch = Scratch::default();
        let slices: Vec<_> = (0..200usize).map(|i| (i as u8, scratch.bytes(1 + i * 40))).collect();
        let filled: Vec<_> = slices
            .into_iter()
            .map(|(i, slice)| {
                (i, {
                    slice.fill(i);
                    slice
                })
            })
            .collect();
        assert!(filled.iter().all(|(i, slice)| slice.len() % LINE == 0 && slice.iter().all(|b| b == i)));
    }

    #[test]
    fn clearing_keeps_little() {
        let mut scratch = Scratch::default();
        (0..20).for_each(|_| scratch.bytes(40_000).fill(1));
        scratch.bytes(10_000_000);
        scratch.clear();
        let kept: usize = scratch.chunks.get_mut().iter().map(|chunk| chunk.lines * LINE).sum();
        assert!(kept > 0 && kept <= BYTES_KEPT);
    }
}
