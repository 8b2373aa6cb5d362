//! The ring of segments: where blocks are reserved, and when the oldest segment may be reused.
#![allow(unsafe_code)]

use super::memory::{LINE, Memory};
use super::pin::Pins;
use super::sync::{AtomicU64, Ordering};
use super::word::{MAX_AGE, MAX_BLOCK_LINES, Place, WORDS_PER_LINE};
use crossbeam::utils::CachePadded;

/// Bits of a cursor that count used lines; the age of the segment is above them. A segment has at most 2¹⁸ lines, and
/// each thread overshoots its end at most once by at most 2¹⁰, so that the count never runs into the age.
const USED_BITS: u32 = 30;
const USED_MASK: u64 = (1 << USED_BITS) - 1;

/// Lines that a hint asks for: all of a small block with its child words, the beginning of a large one.
#[cfg(all(not(loom), target_arch = "x86_64"))]
const PREFETCHED_LINES: usize = 3;

/// Why a block found no place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum NoPlace {
    /// It is larger than a segment, or than what a slot word can describe.
    TooLarge,
    /// A pin can still read the segment that would have to be recycled.
    Pinned,
}

/// All memory of the cache, cut into a power of two of equal segments.
pub(super) struct Ring {
    /// Age of the current segment. Only ever grows.
    head: CachePadded<AtomicU64>,
    /// Per segment: age and lines used.
    cursors: Box<[AtomicU64]>,
    arena: Arena,
    segment_lines: usize,
    /// One less than there are segments: bits of an age that say which is its.
    segment_mask: usize,
    /// Segments that may be recycled while a pin lags behind the head.
    grace: u64,
    first_age: u64,
}

impl Ring {
    /// A ring of `segments` (a power of two) of `segment_lines` each, whose first segment has age `first_age` or the
    /// smallest legal one. `None` if the system refuses the memory.
    pub(super) fn new(segments: usize, segment_lines: usize, grace: usize, first_age: u64) -> Option<Self> {
        debug_assert!(segments.is_power_of_two() && grace >= 1 && segments > grace);
        // Ages start at the number of segments so that `age - segments` never underflows, and stay in step with the
        // place in the ring.
        let first_age = first_age.max(segments as u64);
        // First, so that what is refused has cost nothing: of a huge ring the cursors alone would fill the memory.
        let arena = Arena::new(segments * segment_lines)?;
        let mut cursors = Vec::new();
        cursors.try_reserve_exact(segments).ok()?;
        let initial = |i: u64| AtomicU64::new(initial_cursor(i, segments as u64, first_age));
        cursors.extend((0..segments as u64).map(initial));
        Some(Self {
            head: CachePadded::new(AtomicU64::new(first_age)),
            cursors: cursors.into_boxed_slice(),
            arena,
            segment_lines,
            segment_mask: segments - 1,
            grace: grace as u64,
            first_age,
        })
    }

    #[inline(always)]
    pub(super) fn head(&self) -> u64 {
        self.head.load(Ordering::Acquire)
    }

    /// Whether an address lies in the ring's memory, which is used for one block after the other.
    pub(super) fn holds(&self, address: usize) -> bool {
        self.arena.memory.holds(address)
    }

    fn n_segments(&self) -> u64 {
        self.cursors.len() as u64
    }

    /// The oldest age that a pin at `age` may read: no recycling that such a pin allows reaches it (invariant 3).
    pub(super) fn oldest_readable(&self, age: u64) -> u64 {
        age + self.grace + 1 - self.n_segments()
    }

    /// Ages below this are so old that a hit may copy the block to the head.
    pub(super) fn oldest_kept(&self, age: u64) -> u64 {
        let quarter = (self.n_segments() - self.grace) / 4;
        self.oldest_readable(age) + quarter.max(u64::from(self.n_segments() > 2))
    }

    #[inline(always)]
    fn segment_of(&self, age: u64) -> usize {
        age as usize & self.segment_mask
    }

    #[inline(always)]
    fn first_line(&self, place: Place) -> usize {
        self.segment_of(place.age) * self.segment_lines + place.line
    }

    /// Reserves `lines` lines for the calling thread, which must be pinned: recycles the oldest segment if need be and
    /// possible. As many rounds as there are segments at most, because then the caller's own pin stops the head.
    pub(super) fn reserve(&self, lines: usize, word_lines: usize, pins: &Pins) -> Result<Place, NoPlace> {
        if lines > self.segment_lines.min(MAX_BLOCK_LINES) {
            return Err(NoPlace::TooLarge);
        }
        loop {
            let age = self.head();
            if let Some(line) = self.take_lines(age, lines) {
                return Ok(Place { age, line, lines, word_lines });
            }
            if !self.advance(age, pins) {
                return Err(NoPlace::Pinned);
            }
        }
    }

    /// `lines` lines of the segment of this age, if it has so many left.
    fn take_lines(&self, age: u64, lines: usize) -> Option<usize> {
        let cursor = &self.cursors[self.segment_of(age)];
        let fits = |cursor: u64| (cursor & USED_MASK) as usize + lines <= self.segment_lines;
        // Looking first keeps threads that fail from adding to the cursor of a full segment again and again. `Relaxed`
        // is enough: whoever saw the head at `age` also sees the cursor that was opened before.
        if !fits(cursor.load(Ordering::Relaxed)) {
            return None;
        }
        let before = cursor.fetch_add(lines as u64, Ordering::Relaxed);
        debug_assert_eq!(before >> USED_BITS, age, "a pinned thread's segment is not recycled");
        fits(before).then_some((before & USED_MASK) as usize)
    }

    /// The least age of a pin that lets the segment of age `next` become the current one.
    pub(super) fn oldest_allowing(&self, next: u64) -> u64 {
        next.saturating_sub(self.grace)
    }

    /// Makes the segment after `age` the current one, unless a pin can still read what is in it. Several threads may do
    /// this at once; each step is one that the others may have taken already.
    fn advance(&self, age: u64, pins: &Pins) -> bool {
        let next = age + 1;
        if next > MAX_AGE {
            return false;
        }
        // Invariant 4: the caller's own pin stands where it may if this passes, so that its fence is one for this scan,
        // too. A segment that was never used holds nothing that anybody could read.
        let is_recycled = next >= self.first_age + self.n_segments();
        if is_recycled && pins.any_before(self.oldest_allowing(next)) {
            return false;
        }
        // `Relaxed`: a cursor guards no memory but its own, and who sees the new head finds it reset by this thread or
        // by one whose reset this thread has seen.
        let cursor = &self.cursors[self.segment_of(next)];
        let old = cursor.load(Ordering::Relaxed);
        if old >> USED_BITS < next {
            let _ = cursor.compare_exchange(old, next << USED_BITS, Ordering::Relaxed, Ordering::Relaxed);
        }
        let _ = self.head.compare_exchange(age, next, Ordering::Release, Ordering::Relaxed);
        true
    }

    /// Writes the bytes of a block that this thread has reserved, and zeros behind them up to the end of the line; sets
    /// all child words to `child`.
    ///
    /// # Safety
    /// `place` comes from `reserve`, in the pin's present visit, was not written yet and is in no slot.
    pub(super) unsafe fn write(&self, place: Place, n_bytes: usize, child: u64, encode: impl FnOnce(&mut [u8])) {
        let (first, byte_lines) = (self.first_line(place), place.lines - place.word_lines);
        // SAFETY: reserved lines are this thread's alone until the word is published (invariant 1).
        let bytes = unsafe { self.arena.bytes_mut(first, byte_lines) };
        let (content, padding) = bytes.split_at_mut(n_bytes);
        encode(content);
        padding.fill(0);
        // SAFETY: as above, and the words are not bytes of the block.
        unsafe { self.arena.init_words(first + byte_lines, place.word_lines, child) };
    }

    /// The bytes of a block, a whole number of lines.
    ///
    /// # Safety
    /// The block was published (seen with `Acquire`) or written by this thread, and its age is readable by a pin that
    /// stays as it is while the slice lives.
    #[inline(always)]
    pub(super) unsafe fn bytes(&self, place: Place) -> &[u8] {
        // SAFETY: the lines are inside the arena because `place` was reserved; they are not written again before the
        // segment is recycled, which the pin forbids (invariants 1 and 3).
        unsafe { self.arena.bytes(self.first_line(place), place.lines - place.word_lines) }
    }

    /// The child words of a block.
    ///
    /// # Safety
    /// As for [`Ring::bytes`].
    #[inline(always)]
    pub(super) unsafe fn words(&self, place: Place) -> &[AtomicU64] {
        let first = self.first_line(place) + place.lines - place.word_lines;
        // SAFETY: as for `bytes`; these lines are only ever accessed as words while the segment has this age.
        unsafe { self.arena.words(first, place.word_lines) }
    }

    /// Hints that the start of a block will be read.
    #[inline(always)]
    pub(super) fn prefetch(&self, place: Place) {
        self.arena.prefetch(self.first_line(place));
    }

    /// Bytes of the arena, touched or not.
    pub(super) fn capacity(&self) -> usize {
        self.cursors.len() * self.segment_lines * LINE
    }

    /// Bytes of one segment.
    pub(super) fn segment_bytes(&self) -> usize {
        self.segment_lines * LINE
    }

    /// Segments that were emptied and filled again so far.
    pub(super) fn n_recycled(&self) -> u64 {
        (self.head() - self.first_age + 1).saturating_sub(self.n_segments())
    }

    /// The most bytes that blocks and the gaps at segment ends ever occupied at once.
    pub(super) fn peak_bytes(&self) -> usize {
        let head = self.head();
        let full = head - self.first_age;
        if full >= self.n_segments() {
            return self.capacity();
        }
        let used = self.cursors[self.segment_of(head)].load(Ordering::Relaxed) & USED_MASK;
        full as usize * self.segment_bytes() + (used as usize).min(self.segment_lines) * LINE
    }
}

/// The cursor of segment `i` before anything was reserved: open at `first_age`, never used otherwise.
fn initial_cursor(i: u64, segments: u64, first_age: u64) -> u64 {
    if first_age % segments == i { first_age << USED_BITS } else { 0 }
}

/// The memory of the ring. The only place where raw memory becomes slices.
struct Arena {
    memory: Memory,
    #[cfg(loom)]
    shadow: shadow::Shadow,
}

#[cfg(not(loom))]
impl Arena {
    fn new(lines: usize) -> Option<Self> {
        Some(Self { memory: Memory::zeroed(lines)? })
    }

    /// # Safety
    /// The lines are inside the arena, and nobody else accesses them while the slice lives.
    #[allow(clippy::mut_from_ref)]
    unsafe fn bytes_mut(&self, first: usize, lines: usize) -> &mut [u8] {
        // SAFETY: zeroed when allocated, and by the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.memory.line(first), lines * LINE) }
    }

    /// # Safety
    /// The lines are inside the arena and nobody writes them while the slice lives.
    #[inline(always)]
    unsafe fn bytes(&self, first: usize, lines: usize) -> &[u8] {
        // SAFETY: by the caller's promise.
        unsafe { std::slice::from_raw_parts(self.memory.line(first), lines * LINE) }
    }

    /// # Safety
    /// As for `bytes_mut`.
    unsafe fn init_words(&self, first: usize, lines: usize, value: u64) {
        // SAFETY: lines are aligned for u64 and by the caller's promise ours alone.
        let words =
            unsafe { std::slice::from_raw_parts_mut(self.memory.line(first).cast::<u64>(), lines * WORDS_PER_LINE) };
        words.fill(value);
    }

    /// # Safety
    /// The lines are inside the arena, hold words, and are accessed as words only while the slice lives.
    #[inline(always)]
    unsafe fn words(&self, first: usize, lines: usize) -> &[AtomicU64] {
        // SAFETY: an AtomicU64 has the layout of a u64, lines are aligned for it, and by the caller's promise.
        unsafe { std::slice::from_raw_parts(self.memory.line(first).cast::<AtomicU64>(), lines * WORDS_PER_LINE) }
    }

    #[inline(always)]
    fn prefetch(&self, first: usize) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            // SAFETY: a prefetch accesses nothing; the address is inside the arena because `first` was reserved. The
            // lines after it may be past the end, hence the wrapping add.
            unsafe {
                let start = self.memory.line(first).cast::<i8>();
                for line in 0..PREFETCHED_LINES {
                    _mm_prefetch(start.wrapping_add(line * LINE), _MM_HINT_T0);
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = first;
    }
}

/// Under loom the same memory has a shadow that loom can see: a cell per line, so that loom reports every access that
/// is not ordered against a write, and loom's own atomics for child words.
#[cfg(loom)]
impl Arena {
    fn new(lines: usize) -> Option<Self> {
        Some(Self { memory: Memory::zeroed(lines)?, shadow: shadow::Shadow::new(lines) })
    }

    /// # Safety
    /// As without loom.
    #[allow(clippy::mut_from_ref)]
    unsafe fn bytes_mut(&self, first: usize, lines: usize) -> &mut [u8] {
        self.shadow.note_write(first, lines);
        // SAFETY: as without loom.
        unsafe { std::slice::from_raw_parts_mut(self.memory.line(first), lines * LINE) }
    }

    /// # Safety
    /// As without loom.
    unsafe fn bytes(&self, first: usize, lines: usize) -> &[u8] {
        self.shadow.note_read(first, lines);
        // SAFETY: as without loom.
        unsafe { std::slice::from_raw_parts(self.memory.line(first), lines * LINE) }
    }

    /// # Safety
    /// As without loom.
    unsafe fn init_words(&self, first: usize, lines: usize, value: u64) {
        self.shadow.note_write(first, lines);
        self.shadow.words(first, lines).iter().for_each(|word| word.store(value, Ordering::Relaxed));
    }

    /// # Safety
    /// As without loom.
    unsafe fn words(&self, first: usize, lines: usize) -> &[AtomicU64] {
        self.shadow.note_read(first, lines);
        self.shadow.words(first, lines)
    }

    fn prefetch(&self, _first: usize) {}
}

#[cfg(loom)]
mod shadow {
    use super::{AtomicU64, WORDS_PER_LINE};
    use loom::cell::UnsafeCell;

    /// What loom knows of the arena.
    pub(super) struct Shadow {
        lines: Vec<UnsafeCell<()>>,
        words: Vec<AtomicU64>,
    }

    // SAFETY: the cells hold nothing; loom checks the accesses it is told of.
    unsafe impl Sync for Shadow {}

    impl Shadow {
        pub(super) fn new(lines: usize) -> Self {
            Self {
                lines: (0..lines).map(|_| UnsafeCell::new(())).collect(),
                words: (0..lines * WORDS_PER_LINE).map(|_| AtomicU64::new(0)).collect(),
            }
        }

        pub(super) fn note_write(&self, first: usize, lines: usize) {
            self.lines[first..first + lines].iter().for_each(|line| line.with_mut(|_| ()));
        }

        pub(super) fn note_read(&self, first: usize, lines: usize) {
            self.lines[first..first + lines].iter().for_each(|line| line.with(|_| ()));
        }

        pub(super) fn words(&self, first: usize, lines: usize) -> &[AtomicU64] {
            &self.words[first * WORDS_PER_LINE..(first + lines) * WORDS_PER_LINE]
        }
    }
}
