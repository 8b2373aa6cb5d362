//! What was found out about things that have numbers, remembered for all threads as long as there is room.
//!
//! An entry is four words: a **label**, which says whose the entry is and whether it is known, and three words of what is known. Another
//! number may take the entry over at any time. Until something is known, the label counts how often it was asked for.
//!
//! # The protocol
//! A label is the number and one more, on top, and below it either how many questions are still to come, or [`KNOWN`] and the **edition**, which no other entry has.
//! Who writes makes the label [`BUSY`] by compare-and-swap, so that there is one writer, writes the words, and stores the new label with `Release`. Who
//! reads loads the label with `Acquire`, the words, and the label again. If it is the same known one, nobody has written meanwhile, since no edition
//! comes twice (in 2^31 writes): a sequence lock (Boehm, "Can seqlocks get along with programming language memory models?", MSPC 2012) whose sequence is the
//! label. Nobody waits: who finds an entry busy goes without.

use super::sync::{AtomicU64, Ordering, fence};

/// Set in the labels of known entries.
const KNOWN: u64 = 1 << 31;

/// Somebody writes. No number has this label.
const BUSY: u64 = u64::MAX;

/// A table of three words for each of some numbers.
pub struct MemoTable {
    /// A power of two of them, or none.
    entries: Box<[Entry]>,
    n_editions: AtomicU64,
}

/// Half a cache line.
#[repr(align(32))]
struct Entry {
    label: AtomicU64,
    words: [AtomicU64; 3],
}

impl MemoTable {
    /// A table of so many entries, rounded up to a power of two.
    pub fn new(n_entries: usize) -> Self {
        let zero = || AtomicU64::new(0);
        let entry = |_| Entry { label: zero(), words: [zero(), zero(), zero()] };
        Self { entries: (0..rounded_up(n_entries)).map(entry).collect(), n_editions: zero() }
    }

    /// Bytes of a table of so many entries.
    pub fn bytes_for(n_entries: usize) -> usize {
        rounded_up(n_entries) * size_of::<Entry>()
    }

    #[inline(always)]
    fn entry(&self, number: u32) -> Option<&Entry> {
        self.entries.get(number as usize & self.entries.len().wrapping_sub(1))
    }

    /// What is known of a number.
    #[inline(always)]
    pub fn get(&self, number: u32) -> Option<[u64; 3]> {
        let entry = self.entry(number)?;
        let label = entry.label.load(Ordering::Acquire);
        if !is_known(label, number) {
            return None;
        }
        let [a, b, c] = &entry.words;
        let words = [a.load(Ordering::Relaxed), b.load(Ordering::Relaxed), c.load(Ordering::Relaxed)];
        // Pairs with the writer's: whoever saw one of its words sees its label.
        fence(Ordering::Acquire);
        (entry.label.load(Ordering::Relaxed) == label).then_some(words)
    }

    /// Counts a question about a number that is not known. True if it has been asked for often enough: `patience()` times before.
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

    /// Remembers what is known of a number, unless somebody is writing there.
    pub fn put(&self, number: u32, words: [u64; 3]) {
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
        assert!(table.get(0).is_none() && !table.is_due(0, true, || 0) && MemoTable::bytes_for(0) == 0);
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
