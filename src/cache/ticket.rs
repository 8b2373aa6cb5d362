//! From a miss to a block: claim, build, publish.
#![allow(unsafe_code)]

use super::block::{Block, BlockLayout};
use super::pin::Visit;
use super::segment::NoPlace;
use super::slot::Slot;
use super::stats::{Counters, Stopwatch, add, count};
use super::sync::{AtomicU64, Ordering};
use super::word::{BUILDING, EMPTY, EVICTED, PRIVATE, REBUILDING, without_builder};

/// What to do about a slot whose block was missing.
pub enum Claim<'v> {
    /// Another thread has just published it, or this one has built it for itself before.
    Ready(Block<'v>),
    /// Build it.
    Build(Ticket<'v>),
}

/// The task to build a block. Dropping it unpublished gives the slot back.
pub struct Ticket<'v> {
    visit: &'v Visit<'v>,
    word: &'v AtomicU64,
    /// The slot's.
    key: usize,
    role: Role,
    watch: Option<Stopwatch>,
}

/// For whom a block is built.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Role {
    /// For all: the slot says [`BUILDING`] or [`REBUILDING`], this value, because of this ticket.
    First(u64),
    /// For all if this thread is faster than the one that claimed the slot, whose state was this.
    Second(u64),
    /// For this thread.
    Private,
}

impl<'p> Visit<'p> {
    /// The right, or the task, to build the block of a slot that [`Visit::get`] found missing. Never waits: if another
    /// thread is building the block, this thread builds it, too.
    ///
    /// # Panics
    /// If the slot belongs to another cache.
    #[cold]
    pub fn claim<'v>(&'v self, slot: Slot<'v>) -> Claim<'v> {
        let word = slot.word_in(self.tag());
        if let Some(block) = self.private_block_of_slot(slot) {
            count(&self.pin.counters.private_hits);
            return Claim::Ready(block);
        }
        let mut seen = word.load(Ordering::Acquire);
        if is_free(seen) && !self.can_read(seen) && !self.is_outsider() {
            let claimed = if seen == EMPTY { BUILDING } else { REBUILDING };
            match word.compare_exchange(seen, claimed, Ordering::Relaxed, Ordering::Acquire) {
                Ok(_) => {
                    count(self.miss_counter(seen));
                    return Claim::Build(self.ticket(slot, Role::First(claimed)));
                }
                Err(now) => seen = now,
            }
        }
        if self.can_read(seen) {
            count(&self.pin.counters.hits);
            // SAFETY: seen with `Acquire` and readable.
            return Claim::Ready(unsafe { self.block(seen) });
        }
        count(self.miss_counter(seen));
        let private = seen == PRIVATE || self.is_outsider();
        Claim::Build(self.ticket(slot, if private { Role::Private } else { Role::Second(seen) }))
    }

    fn ticket<'v>(&'v self, slot: Slot<'v>, role: Role) -> Ticket<'v> {
        let watch = self.pin.counters.start_build(matches!(role, Role::Second(_)));
        Ticket { visit: self, word: slot.word_in(self.tag()), key: slot.key(), role, watch: Some(watch) }
    }

    /// The cause of a miss that saw this word.
    fn miss_counter(&self, seen: u64) -> &std::cell::Cell<u64> {
        let counters = &self.pin.counters;
        match seen {
            EMPTY => &counters.compulsory_misses,
            BUILDING | REBUILDING => &counters.concurrent_misses,
            PRIVATE => &counters.bypassed_parent_misses,
            _ => &counters.capacity_misses,
        }
    }

    /// A block in the pin's own memory. Its children will be private, too.
    fn private_block<'v>(&'v self, key: usize, layout: BlockLayout, encode: impl FnOnce(&mut [u8])) -> Block<'v> {
        let bytes = self.pin.scratch.bytes(layout.bytes);
        let (content, padding) = bytes.split_at_mut(layout.bytes);
        encode(content);
        padding.fill(0);
        // A child slot in the ring gives its key to another slot when its segment is recycled.
        if !self.ring().holds(key) {
            self.pin.scratch.remember(key, bytes, layout.word_lines());
        }
        self.private_block_of(bytes, layout.word_lines())
    }

    /// The block that this thread has built for itself, if it still remembers.
    pub(super) fn private_block_of_slot<'v>(&'v self, slot: Slot<'v>) -> Option<Block<'v>> {
        if !self.pin.knows_all_tables() {
            return None;
        }
        let (bytes, word_lines) = self.pin.scratch.recall(slot.key())?;
        Some(self.private_block_of(bytes, word_lines))
    }

    fn private_block_of<'v>(&'v self, bytes: &'v [u8], word_lines: usize) -> Block<'v> {
        let words = &self.pin.cache.private_words[..word_lines * super::word::WORDS_PER_LINE];
        Block {
            bytes,
            words,
            tag: self.tag(),
            #[cfg(loom)]
            shared: None,
        }
    }
}

/// Whether nobody is building the block and somebody may.
fn is_free(word: u64) -> bool {
    !matches!(word, BUILDING | REBUILDING | PRIVATE)
}

impl<'v> Ticket<'v> {
    /// Builds the block and makes it known. `encode` gets exactly `layout.bytes` bytes, starting at a multiple of 64,
    /// with old contents: it has to write all of them, and the same ones whenever it builds this slot.
    ///
    /// # Panics
    /// If the layout has too many children.
    pub fn publish(mut self, layout: BlockLayout, encode: impl FnOnce(&mut [u8])) -> Block<'v> {
        add(&self.counters().bytes_built, layout.bytes as u64);
        let block = match self.role {
            Role::First(state) | Role::Second(state) => self.publish_for_all(state, layout, encode),
            Role::Private => {
                count(&self.counters().bypassed_parent);
                self.end_build(false);
                self.visit.private_block(self.key, layout, encode)
            }
        };
        self.role = Role::Private;
        block
    }

    fn publish_for_all(&mut self, state: u64, layout: BlockLayout, encode: impl FnOnce(&mut [u8])) -> Block<'v> {
        if let Some(theirs) = self.published_by_another() {
            return theirs;
        }
        let (lines, word_lines) = (layout.lines(), layout.word_lines());
        let place = match self.visit.ring().reserve(lines, word_lines, &self.visit.pin.cache.pins) {
            Ok(place) => place,
            Err(why) => return self.bypass(why, layout, encode),
        };
        let child = if state == BUILDING || state == EMPTY { EMPTY } else { EVICTED };
        // SAFETY: just reserved in this visit.
        unsafe { self.visit.ring().write(place, layout.bytes, child, encode) };
        self.link(place.encode())
    }

    /// Puts a finished block into the slot, whatever useless word is there, unless another thread was faster.
    fn link(&mut self, mine: u64) -> Block<'v> {
        let seen = self.word.load(Ordering::Relaxed);
        // `Release`: whoever sees the word sees the block. A word that this visit cannot read is of no use to later
        // ones, so that replacing it loses nothing.
        if !self.visit.can_read(seen) {
            let _ = self.word.compare_exchange(seen, mine, Ordering::Release, Ordering::Relaxed);
        }
        if let Some(theirs) = self.published_by_another_than(mine) {
            return theirs;
        }
        count(&self.counters().builds_kept);
        self.end_build(false);
        // SAFETY: written by this thread in this visit.
        unsafe { self.visit.block(mine) }
    }

    fn published_by_another(&mut self) -> Option<Block<'v>> {
        self.published_by_another_than(EMPTY)
    }

    /// The block of a thread that was faster, in which case this thread's work was for nothing.
    fn published_by_another_than(&mut self, mine: u64) -> Option<Block<'v>> {
        let seen = self.word.load(Ordering::Acquire);
        if seen == mine || !self.visit.can_read(seen) {
            return None;
        }
        count(&self.counters().builds_discarded);
        self.end_build(true);
        // SAFETY: seen with `Acquire` and readable.
        Some(unsafe { self.visit.block(seen) })
    }

    /// Builds a block that finds no place in the cache for this thread alone.
    fn bypass(&mut self, why: NoPlace, layout: BlockLayout, encode: impl FnOnce(&mut [u8])) -> Block<'v> {
        match why {
            NoPlace::TooLarge => count(&self.counters().bypassed_too_large),
            NoPlace::Pinned => {
                count(&self.counters().bypassed_pinned);
                self.visit.note_pinned();
            }
        }
        let block = self.visit.private_block(self.key, layout, encode);
        self.end_build(false);
        self.give_back(|_| EVICTED);
        block
    }

    fn end_build(&mut self, lost: bool) {
        if let Some(watch) = self.watch.take() {
            self.counters().end_build(watch, lost);
        }
    }

    /// Lets others build the block, if this ticket kept them from it.
    fn give_back(&mut self, state: impl Fn(u64) -> u64) {
        if let Role::First(claimed) = self.role {
            // Fails if another thread was faster: its block stays.
            let _ = self.word.compare_exchange(claimed, state(claimed), Ordering::Relaxed, Ordering::Relaxed);
        }
        self.role = Role::Private;
    }

    fn counters(&self) -> &'v Counters {
        &self.visit.pin.counters
    }
}

impl Drop for Ticket<'_> {
    fn drop(&mut self) {
        self.give_back(without_builder);
    }
}
