//! What was found out about things that have numbers, remembered for all threads as long as there is room.
//!
//! An entry is a **label**, which says whose the entry is and whether it is known, and some words of what is known.
//! Another number may take the entry over at any time. Until something is known, the label counts how often it was
//! asked for.
//!
//! # The protocol
//! A label is the number and one more, on top, and below it either how many questions are still to come, or [`KNOWN`]
//! and the **edition**, which no other entry has. Who writes makes the label [`BUSY`] by compare-and-swap, so that
//! there is one writer, writes the words, and stores the new label with `Release`. Who reads loads the label with
//! `Acquire`, the words, and the label again. If it is the same known one, nobody has written meanwhile, since no
//! edition comes twice (in 2^31 writes): a sequence lock (Boehm, "Can seqlocks get along with programming language
//! memory models?", MSPC 2012) whose sequence is the label. Nobody waits: who finds an entry busy goes without.

#![allow(unsafe_code)]

#[cfg(not(loom))]
use super::memory::{Memory, lines_for};
use super::sync::{AtomicU64, Ordering, fence};

/// Set in the labels of known entries.
const KNOWN: u64 = 1 << 31;

/// Marks in a word.
const MARKS: usize = u64::BITS as usize;

/// Somebody writes. No number has this label.
const BUSY: u64 = u64::MAX;

/// A table of so many words for each of some numbers.
pub struct MemoTable<const WORDS: usize> {
    /// A power of two of them, or none.
    entries: Entries<WORDS>,
    /// A bit for each of them, set when something is known there for the first time: these lie closer together than
    /// labels.
    marks: Box<[AtomicU64]>,
    n_editions: AtomicU64,
}

/// Half a cache line, or some.
#[repr(align(32))]
struct Entry<const WORDS: usize> {
    label: AtomicU64,
    words: [AtomicU64; WORDS],
}

/// What is known of a number, about to be read.
pub struct Known<'t, const WORDS: usize> {
    entry: &'t Entry<WORDS>,
    label: u64,
}

impl<const WORDS: usize> Known<'_, WORDS> {
    /// One of the words, or of another entry's if it [was replaced](Self::was_there) meanwhile.
    #[inline(always)]
    pub fn word(&self, k: usize) -> u64 {
        self.entry.words[k].load(Ordering::Relaxed)
    }

    /// Whether all words that were read are of that number.
    #[inline(always)]
    pub fn was_there(&self) -> bool {
        // Pairs with the writer's: whoever saw one of its words sees its label.
        fence(Ordering::Acquire);
        self.entry.label.load(Ordering::Relaxed) == self.label
    }
}

impl<const WORDS: usize> MemoTable<WORDS> {
    /// A table of so many entries, rounded up to a power of two. They take memory when something is asked about them.
    pub fn new(n_entries: usize) -> Self {
        let zero = || AtomicU64::new(0);
        let entries = Entries::new(rounded_up(n_entries));
        let marks = (0..entries.len().div_ceil(MARKS)).map(|_| zero()).collect();
        Self { entries, marks, n_editions: zero() }
    }

    /// Bytes of a table of so many entries.
    pub fn bytes_for(n_entries: usize) -> usize {
        let n = rounded_up(n_entries);
        n * size_of::<Entry<WORDS>>() + n.div_ceil(MARKS) * size_of::<u64>()
    }

    #[inline(always)]
    fn place(&self, number: u32) -> usize {
        number as usize & self.entries.len().wrapping_sub(1)
    }

    #[inline(always)]
    fn entry(&self, number: u32) -> Option<&Entry<WORDS>> {
        self.entries.get(self.place(number))
    }

    /// What is known of a number, for reading some of it.
    #[inline(always)]
    pub fn known(&self, number: u32) -> Option<Known<'_, WORDS>> {
        let place = self.place(number);
        if self.marks.get(place / MARKS)?.load(Ordering::Relaxed) >> (place % MARKS) & 1 == 0 {
            return None;
        }
        let entry = self.entries.get(place)?;
        let label = entry.label.load(Ordering::Acquire);
        is_known(label, number).then_some(Known { entry, label })
    }

    /// What is known of a number.
    #[inline(always)]
    pub fn get(&self, number: u32) -> Option<[u64; WORDS]> {
        let known = self.known(number)?;
        let words = std::array::from_fn(|k| known.word(k));
        known.was_there().then_some(words)
    }

    /// Counts a question about a number that is not known. True if it has been asked for often enough: `patience()`
    /// times before.
    ///
    /// The entry of another number is taken over only if `may_replace`.
    pub fn is_due(&self, number: u32, may_replace: bool, patience: impl FnOnce() -> u32) -> bool {
        let Some(entry) = self.entry(number) else { return false };
        let label = entry.label.load(Ordering::Relaxed);
        let next = if is_of(label, number) {
            match label & (2 * KNOWN - 1) {
                0 => return true,
                left if left < KNOWN => label - 1,
                _ => return false,
            }
        } else if label != BUSY && (label == 0 || may_replace) {
            label_of(number, u64::from(patience()).min(KNOWN - 1))
        } else {
            return false;
        };
        // If another one was faster, this question is not counted.
        let _ = entry.label.compare_exchange(label, next, Ordering::Relaxed, Ordering::Relaxed);
        false
    }

    /// Lets nobody be told for long that it is [due](Self::is_due) to find out about a number of which there is nothing
    /// to know.
    pub fn put_off(&self, number: u32) {
        let Some(entry) = self.entry(number) else { return };
        let label = entry.label.load(Ordering::Relaxed);
        if is_of(label, number) && !is_known(label, number) {
            let _ =
                entry.label.compare_exchange(label, label_of(number, KNOWN - 1), Ordering::Relaxed, Ordering::Relaxed);
        }
    }

    /// Remembers what is known of a number, unless somebody is writing there.
    pub fn put(&self, number: u32, words: [u64; WORDS]) {
        let Some(entry) = self.entry(number) else { return };
        let label = entry.label.load(Ordering::Relaxed);
        let is_mine =
            label != BUSY && entry.label.compare_exchange(label, BUSY, Ordering::Acquire, Ordering::Relaxed).is_ok();
        if !is_mine {
            return;
        }
        fence(Ordering::Release);
        for (place, word) in entry.words.iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        let edition = self.n_editions.fetch_add(1, Ordering::Relaxed) & (KNOWN - 1);
        entry.label.store(label_of(number, KNOWN | edition), Ordering::Release);
        let place = self.place(number);
        self.marks[place / MARKS].fetch_or(1 << (place % MARKS), Ordering::Relaxed);
    }
}

/// Entries of zeroes. Of most tables few are ever used, and what is not is never resident: written in advance, those
/// that a mesh of 12,000 patches gets would be 5 MiB, 1,250 page faults.
#[cfg(not(loom))]
struct Entries<const WORDS: usize> {
    memory: Memory,
    len: usize,
}

#[cfg(not(loom))]
impl<const WORDS: usize> Entries<WORDS> {
    /// So many, or none if the system refuses: nothing is remembered then.
    fn new(len: usize) -> Self {
        let bytes = len.checked_mul(size_of::<Entry<WORDS>>());
        match bytes.and_then(|bytes| Memory::zeroed(lines_for(bytes))) {
            Some(memory) => Self { memory, len },
            None => Self { memory: Memory::nothing(), len: 0 },
        }
    }
}

#[cfg(not(loom))]
impl<const WORDS: usize> std::ops::Deref for Entries<WORDS> {
    type Target = [Entry<WORDS>];

    #[inline(always)]
    fn deref(&self) -> &[Entry<WORDS>] {
        const { assert!(align_of::<Entry<WORDS>>() <= super::memory::LINE) };
        // SAFETY: the memory is aligned to lines and has room for so many entries, for as long as `self` lives. It was
        // zero, which is an entry, since entries are atomics and nothing else, and is reached through this slice alone.
        unsafe { std::slice::from_raw_parts(self.memory.start().cast(), self.len) }
    }
}

/// loom's atomics are more than their value.
#[cfg(loom)]
struct Entries<const WORDS: usize>(Box<[Entry<WORDS>]>);

#[cfg(loom)]
impl<const WORDS: usize> Entries<WORDS> {
    fn new(len: usize) -> Self {
        let zero = || AtomicU64::new(0);
        Self((0..len).map(|_| Entry { label: zero(), words: std::array::from_fn(|_| zero()) }).collect())
    }
}

#[cfg(loom)]
impl<const WORDS: usize> std::ops::Deref for Entries<WORDS> {
    type Target = [Entry<WORDS>];

    fn deref(&self) -> &[Entry<WORDS>] {
        &self.0
    }
}

fn rounded_up(n_entries: usize) -> usize {
    if n_entries == 0 { 0 } else { n_entries.next_power_of_two() }
}

/// A number's label with these low bits.
#[inline(always)]
fn label_of(number: u32, low: u64) -> u64 {
    debug_assert!(number < u32::MAX - 1);
    (u64::from(number) + 1) << 32 | low
}

#[inline(always)]
fn is_of(label: u64, number: u32) -> bool {
    label >> 32 == u64::from(number) + 1
}

#[inline(always)]
fn is_known(label: u64, number: u32) -> bool {
    is_of(label, number) && label & KNOWN != 0
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_often_enough_is_remembered() {
        let table = MemoTable::new(3);
        assert!(table.get(1).is_none());
        assert_eq!((0..4).filter(|_| table.is_due(1, false, || 2)).count(), 1, "the fourth question");
        table.put(1, [4, 5, 6]);
        assert_eq!(table.get(1), Some([4, 5, 6]));
        assert!(!table.is_due(1, true, || 0), "known");
        assert!(!table.is_due(2, false, || 0) && table.is_due(2, false, || 0));
        table.put_off(2);
        assert!(!table.is_due(2, true, || 0) && table.get(2).is_none(), "put off");
        // 5 has the same place.
        assert!(table.get(5).is_none() && !table.is_due(5, false, || 0) && !table.is_due(5, false, || 0));
        assert_eq!(table.get(1), Some([4, 5, 6]));
        assert!(!table.is_due(5, true, || 0) && table.is_due(5, false, || 0) && table.get(1).is_none());
        table.put(5, [7, 8, 9]);
        assert_eq!((table.get(1), table.get(5)), (None, Some([7, 8, 9])));
    }

    #[test]
    fn a_table_without_entries_remembers_nothing() {
        let table = MemoTable::new(0);
        table.put(0, [1; 3]);
        assert!(table.get(0).is_none() && !table.is_due(0, true, || 0) && MemoTable::<3>::bytes_for(0) == 0);
    }

    #[test]
    fn threads_see_whole_entries() {
        let table = MemoTable::new(2);
        let of = |number: u32| [1, 2, 3].map(|k| u64::from(number) << 8 | k);
        let worker = |seed: u32| {
            let mut n_seen = 0;
            for k in 0..200_000u32 {
                let number = (k.wrapping_mul(2_654_435_761) >> 16).wrapping_add(seed) % 6;
                match table.get(number) {
                    Some(words) => {
                        assert_eq!(words, of(number));
                        n_seen += 1;
                    }
                    None if table.is_due(number, k % 8 == 0, || 1) => table.put(number, of(number)),
                    None => {}
                }
            }
            n_seen
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..8).map(|seed| scope.spawn(move || worker(seed))).collect();
            assert!(threads.into_iter().map(|thread| thread.join().unwrap()).sum::<u32>() > 10_000);
        });
    }
}
