//! A thread's own memory, for blocks that find no place in the cache. They last at least as long as the visit that
//! built them, and are **remembered** by the key of their slot as long as there is room: the next ray often needs the
//! same. Where there is no more, the oldest chunk of them is forgotten.
#![allow(unsafe_code)]

use super::memory::{LINE, Memory};
use rustc_hash::FxHashMap;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::ptr::NonNull;

/// Lines of an ordinary chunk: 64 KiB.
const CHUNK_LINES: usize = 1024;
/// Chunks kept from one visit to the next: four that are full or being filled, and one to go on with.
const CHUNKS_KEPT: usize = 5;
/// Bytes that a pin keeps between visits, at most.
pub(super) const BYTES_KEPT: usize = CHUNKS_KEPT * CHUNK_LINES * LINE;

struct Chunk {
    memory: Memory,
    lines: usize,
}

/// Chunks that are filled one after the other.
#[derive(Default)]
pub(super) struct Scratch {
    /// In the order in which they were filled, then those without blocks.
    chunks: RefCell<VecDeque<Chunk>>,
    current: Cell<usize>,
    /// Lines used of the current chunk. Zero if and only if the whole scratch is empty.
    used: Cell<usize>,
    remembered: RefCell<FxHashMap<usize, Remembered>>,
}

/// A block in a chunk.
#[derive(Clone, Copy)]
struct Remembered {
    bytes: NonNull<[u8]>,
    word_lines: usize,
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
            chunks.push_back(Chunk::of(lines.max(CHUNK_LINES)));
        }
        let first = self.used.replace(self.used.get() + lines);
        // SAFETY: these lines lie inside the chunk and were not given out since `clear` or `forget_oldest` emptied it,
        // which need `&mut self`, so that no slice given out before is alive. Chunks own their lines by raw pointer and
        // may move in the queue.
        unsafe { std::slice::from_raw_parts_mut(chunks[self.current.get()].memory.line(first), lines * LINE) }
    }

    /// Notes a block of this scratch, complete, as that of the slot with this key.
    pub(super) fn remember(&self, key: usize, bytes: &[u8], word_lines: usize) {
        self.remembered.borrow_mut().insert(key, Remembered { bytes: NonNull::from(bytes), word_lines });
    }

    /// The block noted for a key since the scratch was last empty, and its lines of child words.
    pub(super) fn recall(&self, key: usize) -> Option<(&[u8], usize)> {
        let Remembered { bytes, word_lines } = *self.remembered.borrow().get(&key)?;
        // SAFETY: the bytes lie in a chunk, were complete when they were noted, and nobody has them to write; `clear`
        // and `forget_oldest`, after which alone the lines are given out anew, forget them and need `&mut self`.
        Some((unsafe { bytes.as_ref() }, word_lines))
    }

    /// Makes room, if there is more than may be kept from visit to visit: forgets the oldest blocks, and those whose
    /// slots are in them.
    pub(super) fn forget_oldest(&mut self) {
        while self.current.get() + 1 >= CHUNKS_KEPT {
            let chunks = self.chunks.get_mut();
            let oldest = chunks.pop_front().expect("the current chunk and those before");
            // A key below a block is an address in it.
            let is_gone = |address: usize| oldest.memory.holds(address);
            self.remembered.get_mut().retain(|&key, block| !is_gone(key) && !is_gone(block.bytes.addr().get()));
            self.current.set(self.current.get() - 1);
            if oldest.lines == CHUNK_LINES && chunks.len() + 1 < CHUNKS_KEPT {
                chunks.push_back(oldest);
            }
        }
    }

    /// Whether there are blocks.
    #[inline(always)]
    pub(super) fn is_used(&self) -> bool {
        self.used.get() != 0
    }

    /// Forgets all blocks. Keeps a little memory for the next visit.
    pub(super) fn clear(&mut self) {
        self.remembered.get_mut().clear();
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
    fn a_block_is_remembered_until_the_scratch_is_cleared() {
        let mut scratch = Scratch::default();
        for key in 0..100 {
            let bytes = scratch.bytes(64);
            bytes.fill(key as u8);
            scratch.remember(key, bytes, key % 3);
        }
        for key in 0..100 {
            assert_eq!(scratch.recall(key), Some((&[key as u8; 64][..], key % 3)));
        }
        assert!(scratch.recall(100).is_none());
        scratch.clear();
        assert!(scratch.recall(7).is_none());
    }

    #[test]
    fn the_oldest_blocks_are_forgotten_with_those_below_them() {
        let mut scratch = Scratch::default();
        let parent = {
            let bytes = scratch.bytes(64);
            scratch.remember(0, bytes, 1);
            bytes.as_ptr().addr()
        };
        for key in 1..2000 {
            let bytes = scratch.bytes(640);
            bytes.fill(key as u8);
            scratch.remember(key, bytes, 0);
            if key == 150 {
                scratch.remember(parent + 3, bytes, 0);
            }
            scratch.forget_oldest();
            let is_known = |key: usize| scratch.recall(key).is_some();
            let oldest = (1..=key).find(|&key| is_known(key)).expect("the last one");
            assert!((oldest..=key).all(|key| scratch.recall(key).is_some_and(|(bytes, _)| bytes == [key as u8; 640])));
            // A chunk holds 102 of them; the parent is in the first one, its child in the second.
            assert!(oldest == 1 || (3 * 102..=4 * 102).contains(&(key - oldest)), "{oldest} to {key}");
            assert_eq!(is_known(parent + 3), key >= 150 && is_known(0));
        }
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
