//! The slot word: 64 bits that say where a block is, how big it is, and until when it can be read.
//!
//! ```text
//!   63            31 30          13 12         3 2         0
//!  ┌────────────────┬──────────────┬────────────┬───────────┐
//!  │ age            │ line         │ lines      │ word lines│      age 0: no block, the low bits are a state
//!  └────────────────┴──────────────┴────────────┴───────────┘
//!    of its segment   in segment     of the block  of them child words
//! ```
//!
//! The age is on top, so "is the block still there" is one comparison of whole words.

use super::memory::LINE;

const WORD_LINES_BITS: u32 = 3;
const LINES_BITS: u32 = 10;
const LINE_BITS: u32 = 18;
const AGE_SHIFT: u32 = WORD_LINES_BITS + LINES_BITS + LINE_BITS;

/// The oldest age a word can carry. A ring that reaches it stops recycling: 2³³ segments are half a petabyte of blocks
/// with the smallest segment that is chosen by default.
pub(super) const MAX_AGE: u64 = (1 << (64 - AGE_SHIFT)) - 1;
/// Lines that a segment can have: 16 MiB.
pub(super) const MAX_SEGMENT_LINES: usize = 1 << LINE_BITS;
/// Lines that a block in the cache can have, child words included.
pub(super) const MAX_BLOCK_LINES: usize = (1 << LINES_BITS) - 1;
/// Child words of a line.
pub(super) const WORDS_PER_LINE: usize = LINE / 8;
/// Lines of child words that a block can have.
pub(super) const MAX_WORD_LINES: usize = (1 << WORD_LINES_BITS) - 1;

/// The bits of a slot word that are set only if the block has child slots.
pub(super) const WORD_LINES_MASK: u64 = MAX_WORD_LINES as u64;

/// Nobody has built this block yet.
pub(super) const EMPTY: u64 = 0;
/// This block was built before and is gone, or is one thread's own.
pub(super) const EVICTED: u64 = 1;
/// A thread is building this block for the first time.
pub(super) const BUILDING: u64 = 2;
/// A thread is building this block again.
pub(super) const REBUILDING: u64 = 3;
/// A child of a thread's own block: it is built for that thread and never published.
pub(super) const PRIVATE: u64 = 4;

/// The state of a slot whose builder gave up, or whose block is copied while a thread builds it elsewhere.
pub(super) fn without_builder(word: u64) -> u64 {
    match word {
        BUILDING => EMPTY,
        REBUILDING => EVICTED,
        other => other,
    }
}

/// Where a block lies and what it is made of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Place {
    /// Age of its segment.
    pub age: u64,
    /// First line, counted from the start of the segment.
    pub line: usize,
    /// Lines of the block: bytes first, then child words.
    pub lines: usize,
    /// How many of the lines are child words.
    pub word_lines: usize,
}

impl Place {
    #[inline(always)]
    pub(super) fn encode(self) -> u64 {
        debug_assert!(self.age <= MAX_AGE && self.line < MAX_SEGMENT_LINES);
        debug_assert!(self.lines <= MAX_BLOCK_LINES && self.word_lines <= MAX_WORD_LINES);
        self.age << AGE_SHIFT
            | (self.line as u64) << (WORD_LINES_BITS + LINES_BITS)
            | (self.lines as u64) << WORD_LINES_BITS
            | self.word_lines as u64
    }

    #[inline(always)]
    pub(super) fn decode(word: u64) -> Self {
        Self {
            age: word >> AGE_SHIFT,
            line: (word >> (WORD_LINES_BITS + LINES_BITS)) as usize & (MAX_SEGMENT_LINES - 1),
            lines: (word >> WORD_LINES_BITS) as usize & MAX_BLOCK_LINES,
            word_lines: word as usize & MAX_WORD_LINES,
        }
    }
}

/// The smallest word of a block whose segment has at least this age.
#[inline(always)]
pub(super) fn first_word_of(age: u64) -> u64 {
    age << AGE_SHIFT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_survives_the_round_trip_at_its_extremes() {
        for age in [1, 12345, MAX_AGE] {
            for line in [0, 1, MAX_SEGMENT_LINES - 1] {
                for (lines, word_lines) in [(0, 0), (1, 1), (MAX_BLOCK_LINES, MAX_WORD_LINES)] {
                    let place = Place { age, line, lines, word_lines };
                    assert_eq!(Place::decode(place.encode()), place);
                    assert!(place.encode() >= first_word_of(age) && place.encode() > PRIVATE);
                    assert!(age == MAX_AGE || place.encode() < first_word_of(age + 1));
                }
            }
        }
    }
}
