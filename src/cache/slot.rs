//! Slots: the places where the cache remembers which block is whose.

use super::sync::AtomicU64;
use super::word::EMPTY;
use std::sync::Arc;
use std::sync::atomic;

/// The index of a slot in its table.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(transparent)]
pub struct SlotId(pub u32);

/// Tells caches apart: a slot word means nothing in another cache. It has an address of its own while anyone holds it.
/// What it counts are tables that are gone, whose addresses may name other slots by now.
#[derive(Clone, Default)]
pub(super) struct CacheTag(Arc<atomic::AtomicUsize>);

impl CacheTag {
    #[inline(always)]
    pub(super) fn tag(&self) -> Tag<'_> {
        Tag(&self.0)
    }

    /// Tables of this cache that were dropped.
    pub(super) fn n_tables_gone(&self) -> usize {
        self.0.load(atomic::Ordering::Acquire)
    }
}

/// A [`CacheTag`] that somebody holds: compared by address.
#[derive(Clone, Copy)]
pub(super) struct Tag<'v>(&'v atomic::AtomicUsize);

/// Root slots: one word for each block that does not hang below another. Made by [`SegmentCache::table`].
///
/// [`SegmentCache::table`]: super::SegmentCache::table
pub struct SlotTable {
    words: Box<[AtomicU64]>,
    tag: CacheTag,
}

impl SlotTable {
    pub(super) fn new(n_slots: usize, tag: CacheTag) -> Self {
        Self { words: (0..n_slots).map(|_| AtomicU64::new(EMPTY)).collect(), tag }
    }

    /// How many slots there are.
    pub fn len(&self) -> usize {
        self.words.len()
    }

    /// Whether there are no slots.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Resident bytes: 8 for each slot.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.words)
    }

    /// # Panics
    /// If there is no such slot.
    #[inline(always)]
    pub(super) fn slot(&self, id: SlotId) -> Slot<'_> {
        let word = &self.words[id.0 as usize];
        Slot { word, tag: self.tag.tag(), key: std::ptr::from_ref(word).addr() }
    }
}

impl Drop for SlotTable {
    fn drop(&mut self) {
        self.tag.0.fetch_add(1, atomic::Ordering::Release);
    }
}

/// A place for a block, of a table or of a block's child. It lasts as long as the visit it was made in.
#[derive(Clone, Copy)]
pub struct Slot<'v> {
    word: &'v AtomicU64,
    tag: Tag<'v>,
    key: usize,
}

impl<'v> Slot<'v> {
    /// Child `i` of the block with these bytes.
    #[inline(always)]
    pub(super) fn child(word: &'v AtomicU64, tag: Tag<'v>, parent: &'v [u8], i: usize) -> Self {
        Self { word, tag, key: parent.as_ptr().addr() + i }
    }

    /// An address that no other slot has while the table, or the parent's block, is where it is: that of a table's
    /// word, or one in the first line of the parent.
    pub(super) fn key(self) -> usize {
        self.key
    }

    /// The word, if the slot belongs to the cache of this tag.
    ///
    /// # Panics
    /// If it does not: it would point anywhere in the other cache's memory.
    #[inline(always)]
    pub(super) fn word_in(self, cache: Tag<'_>) -> &'v AtomicU64 {
        assert!(std::ptr::eq(self.tag.0, cache.0), "a slot can only be used with the cache that made it");
        self.word
    }
}
