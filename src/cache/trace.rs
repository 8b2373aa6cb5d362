//! Which blocks were asked for, in which order: what a cache of another size or kind would have done is replayed from
//! it.
//!
//! A **trace** is a list of accesses; an access names a block by a hash and tells its size. Blocks below other blocks
//! follow these, so that the list also tells who is whose parent. Where the list would become too long, only a
//! **sample** is kept: all accesses to a share of the root slots and to what is below them, chosen by hash (SHARDS:
//! Waldspurger et al., FAST 2015). A cache with the same share of the bytes treats the sample nearly as the whole cache
//! treats all. Of so few roots that a share of them tells nothing, the first accesses are kept instead.

use super::block::Block;
use super::word::{MAX_BLOCK_LINES, WORDS_PER_LINE};
use parking_lot::Mutex;
use rustc_hash::FxHashSet;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Bits of a block's hash.
const KEY_BITS: u32 = 51;
/// Levels of blocks below a root: three bits.
const MAX_LEVELS: usize = 8;
/// Roots that a sample has at least.
const LEAST_ROOTS: usize = 64;
/// Accesses that a thread collects before it adds them to the trace.
const BATCH: usize = 4096;

/// An access in eight bytes: hash, level below the root, lines.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Access(u64);

impl Access {
    fn new(key: u64, level: usize, lines: usize) -> Self {
        let lines = if lines > MAX_BLOCK_LINES { 0 } else { lines };
        Self(key << 13 | (level as u64) << 10 | lines as u64)
    }

    /// Names the block.
    pub(super) fn key(self) -> u64 {
        self.0 >> 13
    }

    /// 0 for a root.
    pub(super) fn level(self) -> usize {
        (self.0 >> 10) as usize & (MAX_LEVELS - 1)
    }

    /// Lines of the block; 0 if it is larger than any cache keeps.
    pub(super) fn lines(self) -> usize {
        self.0 as usize & MAX_BLOCK_LINES
    }
}

/// A trace in the making, shared by all threads.
#[derive(Debug)]
pub struct TraceLog {
    limit: usize,
    accesses: Mutex<Vec<Access>>,
    /// Roots whose hash is below this are in the sample.
    first_left_out: AtomicU64,
    /// Whether no more is recorded.
    is_full: AtomicBool,
}

impl std::fmt::Debug for Recorder<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("batch", &self.batch.len()).finish_non_exhaustive()
    }
}

impl TraceLog {
    /// An empty trace that keeps at most about `limit` accesses, 8 bytes each.
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            accesses: Mutex::default(),
            first_left_out: AtomicU64::new(1 << KEY_BITS),
            is_full: AtomicBool::new(false),
        }
    }

    /// A thread's way to add to the trace.
    pub fn recorder(&self) -> Recorder<'_> {
        Recorder {
            log: self,
            first_left_out: self.bound_of_recorders(),
            is_kept: false,
            keys: [0; MAX_LEVELS],
            batch: Vec::new(),
        }
    }

    /// The share of all roots that is in the sample.
    pub fn share(&self) -> f64 {
        self.bound() as f64 / (1u64 << KEY_BITS) as f64
    }

    /// Accesses in the sample.
    pub fn len(&self) -> usize {
        self.accesses.lock().len()
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(super) fn with_accesses<R>(&self, read: impl FnOnce(&[Access]) -> R) -> R {
        read(&self.accesses.lock())
    }

    fn bound(&self) -> u64 {
        self.first_left_out.load(Ordering::Relaxed)
    }

    /// Adds accesses that begin with one to a root. Where they become too many, the sample is halved for as long as it
    /// has roots enough, then nothing more is recorded: the beginning of a render stands for all of it better than a
    /// root or two for all roots.
    fn add(&self, batch: &mut Vec<Access>) {
        let mut accesses = self.accesses.lock();
        if self.is_full.load(Ordering::Relaxed) {
            batch.clear();
            return;
        }
        keep_roots_below(batch, self.bound());
        accesses.append(batch);
        while accesses.len() > self.limit {
            if n_roots(&accesses) < 2 * LEAST_ROOTS {
                self.is_full.store(true, Ordering::Relaxed);
                accesses.truncate(self.limit);
                return;
            }
            self.first_left_out.store(self.bound() / 2, Ordering::Relaxed);
            keep_roots_below(&mut accesses, self.bound());
        }
    }

    /// What recorders leave out from: all, once the trace is full.
    fn bound_of_recorders(&self) -> u64 {
        if self.is_full.load(Ordering::Relaxed) { 0 } else { self.bound() }
    }
}

fn n_roots(accesses: &[Access]) -> usize {
    let roots = accesses.iter().filter(|access| access.level() == 0);
    roots.map(|access| access.key()).collect::<FxHashSet<_>>().len()
}

/// Leaves out roots from this hash on, and what follows them.
fn keep_roots_below(accesses: &mut Vec<Access>, bound: u64) {
    let mut is_kept = false;
    accesses.retain(|access| {
        if access.level() == 0 {
            is_kept = access.key() < bound;
        }
        is_kept
    });
}

/// One thread's accesses on their way to the trace.
pub struct Recorder<'t> {
    log: &'t TraceLog,
    first_left_out: u64,
    /// Whether the last root is in the sample.
    is_kept: bool,
    /// Hashes of the blocks on the way from the last root to the last block.
    keys: [u64; MAX_LEVELS],
    batch: Vec<Access>,
}

impl Recorder<'_> {
    /// Notes an access to the block of a root slot. `name` is one number for the table and the slot.
    #[inline]
    pub fn root(&mut self, name: u64, block: Block<'_>) {
        let key = hash(name);
        self.is_kept = key < self.first_left_out;
        if self.is_kept {
            if self.batch.len() >= BATCH {
                self.flush();
            }
            self.push(key, 0, block);
        }
    }

    /// Notes an access to child `child` of the last block of the level above `level`, which is 1 below a root.
    ///
    /// # Panics
    /// If `level` is 0 or 8 and more.
    #[inline]
    pub fn child(&mut self, level: usize, child: usize, block: Block<'_>) {
        if self.is_kept {
            self.push(hash(self.keys[level - 1].wrapping_add((child as u64 + 1) << KEY_BITS)), level, block);
        }
    }

    fn push(&mut self, key: u64, level: usize, block: Block<'_>) {
        self.keys[level] = key;
        let lines = super::memory::lines_for(block.bytes().len()) + block.n_children() / WORDS_PER_LINE;
        self.batch.push(Access::new(key, level, lines));
    }

    #[cold]
    fn flush(&mut self) {
        self.log.add(&mut self.batch);
        self.first_left_out = self.log.bound_of_recorders();
    }
}

impl Drop for Recorder<'_> {
    fn drop(&mut self) {
        self.flush();
    }
}

/// Stafford's mix 13, cut to the bits of a key.
fn hash(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 31)) >> (64 - KEY_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log of so many accesses to so many roots, in turns.
    fn log_of(n: usize, n_roots: u64, limit: usize) -> TraceLog {
        let log = TraceLog::new(limit);
        for first in (0..n).step_by(BATCH) {
            let access = |i: usize| Access::new(hash(i as u64 % n_roots), 0, 1);
            log.add(&mut (first..n.min(first + BATCH)).map(access).collect());
        }
        log
    }

    #[test]
    fn many_roots_are_sampled_and_few_are_kept_for_a_while() {
        let many = log_of(200_000, 10_000, 20_000);
        assert!(
            many.len() <= 20_000 && many.len() > 5_000 && many.share() < 0.25,
            "{} of {}",
            many.len(),
            many.share()
        );
        for n_roots in [1, 6, 100] {
            let few = log_of(200_000, n_roots, 20_000);
            assert_eq!((few.len(), few.share()), (20_000, 1.0), "{n_roots} roots");
            assert!(few.recorder().first_left_out == 0, "nothing more is recorded");
        }
    }
}
