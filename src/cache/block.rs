//! Blocks: what a slot leads to.

use super::memory::lines_for;
use super::slot::{Slot, Tag};
use super::sync::AtomicU64;
use super::word::{MAX_WORD_LINES, WORDS_PER_LINE};
#[cfg(loom)]
use super::{segment::Ring, word::Place};

/// How much room a block needs.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct BlockLayout {
    /// Bytes of content, rounded up to 64 by the cache.
    pub bytes: usize,
    /// Slots for child blocks, at most [`BlockLayout::MAX_CHILDREN`]; rounded up to 8 by the cache.
    pub children: usize,
}

impl BlockLayout {
    /// The most children that a block can have.
    pub const MAX_CHILDREN: usize = MAX_WORD_LINES * WORDS_PER_LINE;

    /// # Panics
    /// If there are too many children.
    pub(super) fn word_lines(self) -> usize {
        assert!(self.children <= Self::MAX_CHILDREN, "a block has at most {} children", Self::MAX_CHILDREN);
        self.children.div_ceil(WORDS_PER_LINE)
    }

    pub(super) fn lines(self) -> usize {
        lines_for(self.bytes).saturating_add(self.word_lines())
    }
}

/// A block that can be read until the visit ends.
#[derive(Clone, Copy)]
pub struct Block<'v> {
    pub(super) bytes: &'v [u8],
    pub(super) words: &'v [AtomicU64],
    pub(super) tag: Tag<'v>,
    #[cfg(loom)]
    pub(super) shared: Option<(&'v Ring, Place)>,
}

impl<'v> Block<'v> {
    /// The content as it was encoded; starts at a multiple of 64 bytes and is filled up with zeros to a multiple of 64.
    #[inline(always)]
    pub fn bytes(&self) -> &'v [u8] {
        #[cfg(loom)]
        if let Some((ring, place)) = self.shared {
            // SAFETY: the visit that the block was made in has not ended.
            #[allow(unsafe_code)]
            return unsafe { ring.bytes(place) };
        }
        self.bytes
    }

    /// How many child slots there are: as many as the block was built with, rounded up to 8.
    #[inline(always)]
    pub fn n_children(&self) -> usize {
        self.words.len()
    }

    /// The slot of child `i`.
    ///
    /// # Panics
    /// If there is no such child.
    #[inline(always)]
    pub fn child(&self, i: usize) -> Slot<'v> {
        Slot::child(&self.words[i], self.tag, self.bytes, i)
    }
}
