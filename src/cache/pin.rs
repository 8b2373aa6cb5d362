//! Pins: who may read what. A visit is the time during which a pin stands still.
#![allow(unsafe_code)]

use super::SegmentCache;
use super::block::Block;
use super::config::Reinsert;
use super::scratch::Scratch;
use super::segment::Ring;
use super::slot::{Slot, SlotId, SlotTable};
use super::stats::{CacheStatistics, Counters, count};
use super::sync::{AtomicU64, AtomicUsize, Ordering, fence, yield_now};
use super::word::{Place, WORD_LINES_MASK, first_word_of, without_builder};
use crossbeam::utils::CachePadded;
use std::cell::Cell;
use std::marker::PhantomData;

/// The value of a pin word that belongs to no thread.
const FREE: u64 = 0;
/// The value of a pin word whose thread reads nothing. Ages start at 2.
const UNPINNED: u64 = 1;

/// The pin words of all threads, where recyclers look.
pub(super) struct Pins {
    words: Box<[CachePadded<AtomicU64>]>,
    /// Pin words that were ever used: the first so many.
    n_used: AtomicUsize,
}

impl Pins {
    pub(super) fn new(max_threads: usize) -> Self {
        let words = (0..max_threads).map(|_| CachePadded::new(AtomicU64::new(FREE))).collect();
        Self { words, n_used: AtomicUsize::new(0) }
    }

    /// A pin word for one thread. `Acquire` and the `Release` of `give_back` order what its last owner read before what
    /// recyclers do that see the new owner's age in it.
    fn take(&self) -> Option<usize> {
        let taken = |word: &AtomicU64| {
            word.load(Ordering::Relaxed) == FREE
                && word.compare_exchange(FREE, UNPINNED, Ordering::Acquire, Ordering::Relaxed).is_ok()
        };
        let idx = self.words.iter().position(|word| taken(word))?;
        // `Relaxed`: the fence of the first announcement makes recyclers see it, as it does with the announcement.
        self.n_used.fetch_max(idx + 1, Ordering::Relaxed);
        Some(idx)
    }

    fn give_back(&self, idx: usize) {
        self.words[idx].store(FREE, Ordering::Release);
    }

    /// Whether a pin stands at an age before `age`. `Acquire` orders what that pin's thread read before it moved on
    /// before everything that follows here: the head's advance and all writes to the recycled segment.
    pub(super) fn any_before(&self, age: u64) -> bool {
        let used = &self.words[..self.n_used.load(Ordering::Relaxed)];
        used.iter().map(|word| word.load(Ordering::Acquire)).any(|pin| pin > UNPINNED && pin < age)
    }

    /// Whether a pin other than the `idx`-th stands at an age before `age`; it may have moved on meanwhile.
    fn another_before(&self, idx: usize, age: u64) -> bool {
        let used = self.words[..self.n_used.load(Ordering::Relaxed)].iter().enumerate().filter(|(i, _)| *i != idx);
        used.map(|(_, word)| word.load(Ordering::Relaxed)).any(|pin| pin > UNPINNED && pin < age)
    }
}

/// A thread's right to read the cache. Neither `Send` nor `Sync`.
///
/// A pin that is idle for long should be dropped: while it stands still it keeps the cache from recycling what it could
/// read, and others build blocks for themselves only.
pub struct Pin<'c> {
    pub(super) cache: &'c SegmentCache,
    /// The pin word, `None` if there were more pins than expected: such a pin sees an empty cache and leaves it alone.
    idx: Option<usize>,
    /// The age at which the pin stands, or [`UNPINNED`].
    age: u64,
    /// Slot words from here on are blocks that this pin can read.
    first_readable: u64,
    /// Slot words below are blocks that a hit copies to the current segment, if `kept_bits` says so.
    first_kept: u64,
    /// Bits of a slot word of which one is set in those blocks.
    kept_bits: u64,
    /// Whether a block of the last visit found no place because of another pin.
    met_a_pin: Cell<bool>,
    pub(super) scratch: Scratch,
    /// Tables that were gone when the scratch was last empty.
    n_tables_gone: usize,
    pub(super) counters: Counters,
    not_send: PhantomData<*const ()>,
}

impl<'c> Pin<'c> {
    pub(super) fn new(cache: &'c SegmentCache) -> Self {
        Self {
            cache,
            idx: cache.pins.take(),
            age: UNPINNED,
            first_readable: u64::MAX,
            first_kept: 0,
            kept_bits: match cache.reinsert {
                Reinsert::Never => 0,
                Reinsert::Parents => WORD_LINES_MASK,
                Reinsert::All => u64::MAX,
            },
            met_a_pin: Cell::new(false),
            scratch: Scratch::default(),
            n_tables_gone: cache.tag.n_tables_gone(),
            counters: Counters::default(),
            not_send: PhantomData,
        }
    }

    /// Begins a visit: moves the pin to the current age. Costs one load and two comparisons unless a segment was
    /// recycled since the last visit.
    #[inline]
    pub fn visit(&mut self) -> Visit<'_> {
        if self.scratch.is_used() {
            self.look_after_private_blocks();
        }
        if self.cache.ring.head() != self.age {
            self.move_to_head();
        }
        Visit { pin: self }
    }

    fn unpin(&mut self) {
        self.age = UNPINNED;
        self.first_readable = u64::MAX;
        if let Some(idx) = self.idx {
            // `Release`: what was read is read before a recycler sees the pin gone.
            self.cache.pins.words[idx].store(UNPINNED, Ordering::Release);
        }
    }

    /// Bytes of the blocks that this pin's thread has built.
    pub fn bytes_built(&self) -> u64 {
        self.counters.bytes_built.get()
    }

    /// What this pin has counted so far.
    pub fn statistics(&self) -> CacheStatistics {
        self.counters.statistics()
    }

    /// Forgets the oldest of the blocks that this thread has built for itself, if there are too many of them, and all
    /// of them if their slots may be gone. If some of the last visit's found no place because of another pin, that
    /// pin's thread is probably asleep within its visit, and what it needs is a processor. So this thread steps aside,
    /// and does so between two visits, with its own pin released: then a thread that does not run holds nothing. It
    /// does not wait for anything.
    #[cold]
    fn look_after_private_blocks(&mut self) {
        let n_tables_gone = self.cache.tag.n_tables_gone();
        if n_tables_gone != self.n_tables_gone {
            self.scratch.clear();
            self.n_tables_gone = n_tables_gone;
        }
        self.scratch.forget_oldest();
        if self.met_a_pin.take() {
            self.unpin();
            yield_now();
        }
    }

    /// Whether no table is gone whose slots this thread has built blocks of its own for: another may have its address.
    pub(super) fn knows_all_tables(&self) -> bool {
        self.cache.tag.n_tables_gone() == self.n_tables_gone
    }

    /// Announces the head's age and makes sure that the announcement was in time (invariant 4). Each further round
    /// means that the head has moved, which it does for as long as there are segments that were never used, and once a
    /// recycler has seen the pin only a few segments more.
    #[cold]
    fn move_to_head(&mut self) {
        let ring = &self.cache.ring;
        let mut age = ring.head();
        let Some(idx) = self.idx else {
            self.age = age;
            return;
        };
        loop {
            self.cache.pins.words[idx].store(age, Ordering::Release);
            fence(Ordering::SeqCst);
            match ring.head() {
                head if head == age => break,
                head => age = head,
            }
        }
        self.age = age;
        self.first_readable = first_word_of(ring.oldest_readable(age));
        self.first_kept = first_word_of(ring.oldest_kept(age));
    }
}

impl Drop for Pin<'_> {
    fn drop(&mut self) {
        if let Some(idx) = self.idx {
            self.cache.pins.give_back(idx);
        }
        *self.cache.totals.lock() += self.counters.statistics();
    }
}

/// The time between two moves of a pin. Every block handed out stays as it is until the visit ends.
///
/// A visit should be short, the time of one ray: what it builds beyond the free part of the cache is kept in private
/// memory until it ends.
pub struct Visit<'p> {
    pub(super) pin: &'p Pin<'p>,
}

impl<'p> Visit<'p> {
    /// The slot `id` of a table.
    ///
    /// # Panics
    /// If there is no such slot.
    #[inline(always)]
    pub fn root<'v>(&'v self, table: &'v SlotTable, id: SlotId) -> Slot<'v> {
        table.slot(id)
    }

    /// The block of a slot if it is there. Otherwise [`Visit::claim`] the slot.
    ///
    /// # Panics
    /// If the slot belongs to another cache.
    #[inline]
    pub fn get<'v>(&'v self, slot: Slot<'v>) -> Option<Block<'v>> {
        let word = slot.word_in(self.tag());
        // `Acquire` pairs with the `Release` of the publication: the block's bytes are seen.
        let seen = word.load(Ordering::Acquire);
        if !self.can_read(seen) {
            return None;
        }
        count(&self.pin.counters.hits);
        let is_old = seen < self.pin.first_kept && seen & self.pin.kept_bits != 0;
        // SAFETY: just seen with `Acquire` and readable.
        Some(if is_old { self.reinsert(word, seen) } else { unsafe { self.block(seen) } })
    }

    /// The block of a slot if it is there or this thread has built it for itself, for who can do without: it does not
    /// count as looked up.
    ///
    /// # Panics
    /// If the slot belongs to another cache.
    pub fn peek<'v>(&'v self, slot: Slot<'v>) -> Option<Block<'v>> {
        let seen = slot.word_in(self.tag()).load(Ordering::Acquire);
        if self.can_read(seen) {
            // SAFETY: just seen with `Acquire` and readable.
            return Some(unsafe { self.block(seen) });
        }
        self.private_block_of_slot(slot)
    }

    /// Hints that the block of a slot will be asked for soon.
    #[inline(always)]
    pub fn prefetch(&self, slot: Slot<'_>) {
        let seen = slot.word_in(self.tag()).load(Ordering::Relaxed);
        if self.can_read(seen) {
            self.ring().prefetch(Place::decode(seen));
        }
    }

    #[inline(always)]
    pub(super) fn ring(&self) -> &Ring {
        &self.pin.cache.ring
    }

    #[inline(always)]
    pub(super) fn tag(&self) -> super::slot::Tag<'_> {
        self.pin.cache.tag.tag()
    }

    /// Whether a slot word is a block that this visit may read.
    #[inline(always)]
    pub(super) fn can_read(&self, word: u64) -> bool {
        word >= self.pin.first_readable
    }

    /// Whether the pin has no pin word, so that it must neither read nor write the cache.
    pub(super) fn is_outsider(&self) -> bool {
        self.pin.idx.is_none()
    }

    /// The block that a slot word stands for.
    ///
    /// # Safety
    /// [`Visit::can_read`] the word, which was seen with `Acquire` in a slot of this cache or written by this thread.
    #[inline(always)]
    pub(super) unsafe fn block(&self, word: u64) -> Block<'_> {
        let place = Place::decode(word);
        let ring = self.ring();
        // SAFETY: the place was reserved in this ring, its block is complete by the caller's promise, and its segment
        // is not recycled while this visit borrows the pin (invariant 3).
        let (bytes, words) = unsafe { (ring.bytes(place), ring.words(place)) };
        Block {
            bytes,
            words,
            tag: self.tag(),
            #[cfg(loom)]
            shared: Some((ring, place)),
        }
    }

    /// Notes that a block found no place because of a pin, if it was not this one's alone.
    pub(super) fn note_pinned(&self) {
        let Pin { cache, idx: Some(idx), met_a_pin, .. } = self.pin else { return };
        if cache.pins.another_before(*idx, cache.ring.oldest_allowing(cache.ring.head() + 1)) {
            met_a_pin.set(true);
        }
    }

    /// Copies a block that will soon be recycled to the current segment, together with what is known of its children.
    /// What another thread publishes in the old copy meanwhile is lost, and built again when wanted.
    #[cold]
    fn reinsert<'v>(&'v self, word: &'v AtomicU64, seen: u64) -> Block<'v> {
        // SAFETY: seen with `Acquire` and readable, says the only caller.
        let old = unsafe { self.block(seen) };
        let Place { lines, word_lines, .. } = Place::decode(seen);
        let Ok(place) = self.ring().reserve(lines, word_lines, &self.pin.cache.pins) else { return old };
        // SAFETY: just reserved.
        unsafe { self.ring().write(place, old.bytes.len(), super::word::EMPTY, |out| out.copy_from_slice(old.bytes)) };
        // SAFETY: just written by this thread.
        let new = unsafe { self.block(place.encode()) };
        for (new, old) in new.words.iter().zip(old.words) {
            // `Acquire`, so that who sees the new parent's publication sees the children's bytes, too.
            new.store(without_builder(old.load(Ordering::Acquire)), Ordering::Relaxed);
        }
        match word.compare_exchange(seen, place.encode(), Ordering::Release, Ordering::Relaxed) {
            Ok(_) => {
                count(&self.pin.counters.reinsertions);
                new
            }
            Err(_) => old,
        }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::super::{BlockLayout, CacheConfig, Claim};
    use super::*;

    /// Builds a kilobyte for each of these slots, in one visit.
    fn build(pin: &mut Pin<'_>, table: &SlotTable, slots: std::ops::Range<u32>) {
        let visit = pin.visit();
        for slot in slots {
            let Claim::Build(ticket) = visit.claim(visit.root(table, SlotId(slot))) else { continue };
            ticket.publish(BlockLayout { bytes: 1024, children: 0 }, |out| out.fill(slot as u8));
        }
    }

    #[test]
    fn a_thread_steps_aside_for_another_pin_and_not_for_its_own() {
        let cache = SegmentCache::new(CacheConfig { segments: Some(4), ..CacheConfig::with_bytes(16 << 10) }).unwrap();
        let table = cache.table(200);
        let mut pin = cache.pin();
        build(&mut pin, &table, 0..50);
        assert!(pin.statistics().bypassed_pinned > 0 && !pin.met_a_pin.get(), "its own pin is in the way");
        (50..100).for_each(|slot| build(&mut pin, &table, slot..slot + 1));
        assert!(!pin.met_a_pin.get(), "nobody is in the way");
        let mut other = cache.pin();
        let _standing = other.visit();
        (100..150).for_each(|slot| build(&mut pin, &table, slot..slot + 1));
        assert!(pin.met_a_pin.get(), "another one is in the way");
    }
}
