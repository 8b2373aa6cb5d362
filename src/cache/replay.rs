//! Replays a trace: what caches of other sizes and kinds would have done.
//!
//! The segmented first-in-first-out cache is replayed as it is implemented: segments, grace, blocks that do not fit,
//! children that are lost with their parent's words. FIFO is no stack algorithm, so every size is a replay of its own.
//! Two caches that nobody can build so cheaply show what there is to gain: least recently used, and Belady's, which
//! knows the future. Both keep single blocks without gaps and never lose a child with its parent.

use super::config::{Reinsert, RingShape};
use super::memory::LINE;
use super::trace::TraceLog;
use rustc_hash::FxHashMap;
use std::collections::BinaryHeap;

/// What decides which blocks stay.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Policy {
    /// This crate's ring of segments.
    Segments {
        /// As in [`CacheConfig::segments`](super::CacheConfig::segments).
        segments: Option<usize>,
        /// As in [`CacheConfig::reinsert`](super::CacheConfig::reinsert).
        reinsert: Reinsert,
    },
    /// The block that was not asked for the longest goes first.
    LeastRecentlyUsed,
    /// The block that will not be asked for the longest goes first.
    Belady,
}

/// What a replay counted, of the sample.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Replayed {
    /// Blocks asked for.
    pub lookups: u64,
    /// Blocks that were there.
    pub hits: u64,
    /// Blocks asked for the first time.
    pub compulsory_misses: u64,
}

impl Replayed {
    /// Hits per lookup, 1 if nothing was looked up.
    pub fn hit_rate(&self) -> f64 {
        if self.lookups == 0 { 1.0 } else { self.hits as f64 / self.lookups as f64 }
    }

    /// Blocks built again, per lookup.
    pub fn rebuild_rate(&self) -> f64 {
        (self.lookups - self.hits - self.compulsory_misses) as f64 / self.lookups.max(1) as f64
    }
}

/// No block.
const NONE: u32 = u32::MAX;

/// An access with blocks numbered.
#[derive(Clone, Copy)]
struct Step {
    block: u32,
    /// The block with its slot, or [`NONE`].
    parent: u32,
}

/// A trace prepared for replays.
pub struct Replay {
    steps: Vec<Step>,
    /// Lines of each block.
    lines: Vec<u16>,
    /// Whether blocks below it were asked for.
    is_parent: Vec<bool>,
    share: f64,
}

impl Replay {
    /// Numbers the blocks of a trace.
    pub fn new(trace: &TraceLog) -> Self {
        let mut replay = Self {
            steps: Vec::with_capacity(trace.len()),
            lines: Vec::new(),
            is_parent: Vec::new(),
            share: trace.share(),
        };
        let mut numbers: FxHashMap<u64, u32> = FxHashMap::default();
        let mut path = [NONE; 8];
        trace.with_accesses(|accesses| {
            for access in accesses {
                let next = numbers.len() as u32;
                let block = *numbers.entry(access.key()).or_insert(next);
                if block == next {
                    replay.lines.push(access.lines() as u16);
                    replay.is_parent.push(false);
                }
                let parent = if access.level() == 0 { NONE } else { path[access.level() - 1] };
                if let Some(is_parent) = replay.is_parent.get_mut(parent as usize) {
                    *is_parent = true;
                }
                path[access.level()] = block;
                replay.steps.push(Step { block, parent });
            }
        });
        replay
    }

    /// Bytes of all blocks that were asked for, estimated from the sample.
    pub fn working_set_bytes(&self) -> f64 {
        let lines: u64 = self.lines.iter().map(|&n| u64::from(n)).sum();
        (lines * LINE as u64) as f64 / self.share
    }

    /// What a cache of `bytes` bytes would have done; a sample meets its share of them.
    pub fn run(&self, policy: Policy, bytes: usize) -> Replayed {
        match policy {
            Policy::Segments { segments, reinsert } => self.segments(RingShape::new(bytes, segments), reinsert),
            Policy::LeastRecentlyUsed => self.least_recently_used(self.share_of(bytes)),
            Policy::Belady => self.belady(self.share_of(bytes)),
        }
    }

    /// Lines for the sample in a cache of `bytes` bytes.
    fn share_of(&self, bytes: usize) -> u64 {
        (bytes as f64 * self.share / LINE as f64) as u64
    }

    fn replay(&self, mut is_hit: impl FnMut(usize, Step) -> bool) -> Replayed {
        let mut counts = Replayed { lookups: self.steps.len() as u64, ..Default::default() };
        let mut n_seen = 0;
        for (i, &step) in self.steps.iter().enumerate() {
            let is_first = step.block == n_seen;
            n_seen += u32::from(is_first);
            counts.compulsory_misses += u64::from(is_first);
            counts.hits += u64::from(is_hit(i, step));
        }
        counts
    }

    fn segments(&self, shape: RingShape, reinsert: Reinsert) -> Replayed {
        let mut ring = Ring::new(shape, self.share);
        let mut states = vec![State::default(); self.lines.len()];
        self.replay(|_, Step { block, parent }| {
            let (parent_build, is_private) = match states.get(parent as usize) {
                Some(parent) => (parent.build, parent.is_private),
                None => (0, false),
            };
            let (state, lines) = (&mut states[block as usize], self.lines[block as usize]);
            if state.age >= ring.oldest_readable() && state.parent_build == parent_build && !is_private {
                let is_kept = match reinsert {
                    Reinsert::Never => false,
                    Reinsert::Parents => self.is_parent[block as usize],
                    Reinsert::All => true,
                };
                if is_kept && state.age < ring.oldest_kept() {
                    state.age = ring.reserve(lines).unwrap_or(state.age);
                }
                return true;
            }
            let age = if is_private { None } else { ring.reserve(lines) };
            *state = State { age: age.unwrap_or(0), build: state.build + 1, parent_build, is_private: age.is_none() };
            false
        })
    }

    fn least_recently_used(&self, capacity: u64) -> Replayed {
        let mut recency = Recency::new(self.lines.len());
        let mut used = 0;
        self.replay(|_, Step { block, .. }| {
            let is_hit = recency.remove(block);
            let lines = u64::from(self.lines[block as usize]);
            used += if is_hit { 0 } else { lines };
            recency.push_newest(block);
            while used > capacity {
                used -= u64::from(self.lines[recency.pop_oldest() as usize]);
            }
            is_hit
        })
    }

    fn belady(&self, capacity: u64) -> Replayed {
        let next = self.next_uses();
        let mut next_use_of = vec![0; self.lines.len()];
        let mut is_there = vec![false; self.lines.len()];
        let mut farthest = BinaryHeap::new();
        let mut used = 0;
        self.replay(|i, Step { block, .. }| {
            let is_hit = std::mem::replace(&mut is_there[block as usize], true);
            used += if is_hit { 0 } else { u64::from(self.lines[block as usize]) };
            next_use_of[block as usize] = next[i];
            farthest.push((next[i], block));
            while used > capacity {
                let (use_at, victim) = farthest.pop().expect("every block that is there has its next use here");
                // Entries of uses that are past, or of blocks that are gone, are stale.
                if is_there[victim as usize] && next_use_of[victim as usize] == use_at {
                    is_there[victim as usize] = false;
                    used -= u64::from(self.lines[victim as usize]);
                }
            }
            is_hit
        })
    }

    /// For each step, when its block is asked for again.
    fn next_uses(&self) -> Vec<u32> {
        let mut last = vec![u32::MAX; self.lines.len()];
        let mut next = vec![u32::MAX; self.steps.len()];
        for (i, step) in self.steps.iter().enumerate().rev() {
            next[i] = std::mem::replace(&mut last[step.block as usize], i as u32);
        }
        next
    }
}

/// What the segmented cache knows of a block.
#[derive(Clone, Copy, Default)]
struct State {
    /// Of its segment; 0 is too old for every reader.
    age: u64,
    /// How often it was built: children of an older build are out of reach.
    build: u32,
    parent_build: u32,
    /// Used once, because it found no place.
    is_private: bool,
}

/// The ring of segments without contents, read by one thread whose pin follows the head.
struct Ring {
    segments: u64,
    grace: u64,
    /// Lines of a segment. In a sample a fraction of those of the real one.
    segment_lines: f64,
    largest_block: usize,
    is_sample: bool,
    head: u64,
    used: f64,
}

impl Ring {
    fn new(shape: RingShape, share: f64) -> Self {
        let RingShape { segments, segment_lines, grace } = shape;
        Self {
            segments: segments as u64,
            grace: grace as u64,
            segment_lines: segment_lines as f64 * share,
            largest_block: segment_lines,
            is_sample: share < 1.0,
            head: segments as u64,
            used: 0.0,
        }
    }

    fn oldest_readable(&self) -> u64 {
        self.head + self.grace + 1 - self.segments
    }

    fn oldest_kept(&self) -> u64 {
        let quarter = (self.segments - self.grace) / 4;
        self.oldest_readable() + quarter.max(u64::from(self.segments > 2))
    }

    /// The age of the segment that the block goes to; `None` if it is too large for any.
    fn reserve(&mut self, lines: u16) -> Option<u64> {
        let lines = usize::from(lines);
        if lines == 0 || lines > self.largest_block {
            return None;
        }
        if self.used + lines as f64 > self.segment_lines {
            self.begin_segment();
        }
        self.used += lines as f64;
        Some(self.head)
    }

    /// A segment of a sample may be smaller than a block: what a block has too much is taken from the next ones, so
    /// that the mean is right. The gap at the end of a real segment is half a block, and as much of the sample's time.
    fn begin_segment(&mut self) {
        if self.is_sample {
            let n_full = (self.used / self.segment_lines).floor();
            self.head += n_full as u64;
            self.used -= n_full * self.segment_lines;
        } else {
            self.head += 1;
            self.used = 0.0;
        }
    }
}

/// Blocks in the order of their last use: a doubly linked list in two arrays.
struct Recency {
    newer: Vec<u32>,
    older: Vec<u32>,
    newest: u32,
    oldest: u32,
    is_there: Vec<bool>,
}

impl Recency {
    fn new(n: usize) -> Self {
        Self { newer: vec![NONE; n], older: vec![NONE; n], newest: NONE, oldest: NONE, is_there: vec![false; n] }
    }

    /// Whether it was there.
    fn remove(&mut self, block: u32) -> bool {
        let i = block as usize;
        if !std::mem::replace(&mut self.is_there[i], false) {
            return false;
        }
        let (newer, older) = (self.newer[i], self.older[i]);
        *(if newer == NONE { &mut self.newest } else { &mut self.older[newer as usize] }) = older;
        *(if older == NONE { &mut self.oldest } else { &mut self.newer[older as usize] }) = newer;
        true
    }

    fn push_newest(&mut self, block: u32) {
        let before = std::mem::replace(&mut self.newest, block);
        self.older[block as usize] = before;
        self.newer[block as usize] = NONE;
        self.is_there[block as usize] = true;
        *(if before == NONE { &mut self.oldest } else { &mut self.newer[before as usize] }) = block;
    }

    fn pop_oldest(&mut self) -> u32 {
        let oldest = self.oldest;
        self.remove(oldest);
        oldest
    }
}
