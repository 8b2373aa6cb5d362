//! What the cache counts. Each pin counts for itself and adds its numbers to the cache's when it is dropped.

use serde::{Serialize, Serializer};
use std::cell::Cell;
use std::iter::Sum;
use std::ops::AddAssign;
use std::time::{Duration, Instant};

/// One build in so many is timed: two clock readings cost a third of a small build. A prime, so that blocks built in a
/// fixed rhythm (a node, then sixteen children) are all sampled.
const TIMED_BUILDS: u64 = 13;

/// Counters summed over all pins that were dropped.
///
/// `lookups = hits + private_hits + misses()`, and every miss is one of compulsory, capacity, concurrent and
/// bypassed-parent.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct CacheStatistics {
    /// Blocks asked for.
    pub lookups: u64,
    /// Blocks that were there.
    pub hits: u64,
    /// Blocks that were not, but that the same thread had built for itself a little before.
    pub private_hits: u64,
    /// Misses because nobody had built the block before.
    pub compulsory_misses: u64,
    /// Misses because the block, or the block its slot was in, had been recycled.
    pub capacity_misses: u64,
    /// Misses because another thread was building the block: this thread built it as well instead of waiting.
    pub concurrent_misses: u64,
    /// Misses below a block of one thread's own, so that there was no place to look.
    pub bypassed_parent_misses: u64,
    /// Blocks built and put into the cache.
    pub builds_kept: u64,
    /// Blocks built, then thrown away because another thread had built them in the meantime.
    pub builds_discarded: u64,
    /// Blocks built for one thread because they are larger than a segment.
    pub bypassed_too_large: u64,
    /// Blocks built for one thread because a pin kept the oldest segment.
    pub bypassed_pinned: u64,
    /// Blocks built for one thread because their parent was.
    pub bypassed_parent: u64,
    /// Bytes of all blocks built, wherever they went.
    pub bytes_built: u64,
    /// Time from claim to publication, estimated from one build in thirteen.
    #[serde(serialize_with = "as_seconds")]
    pub build_time: Duration,
    /// Time of the builds that other threads made superfluous.
    #[serde(serialize_with = "as_seconds")]
    pub time_lost: Duration,
    /// Blocks copied to the current segment because they were still used.
    pub reinsertions: u64,
    /// Segments emptied and filled again. Of the cache, not of pins.
    pub segments_recycled: u64,
    /// The most bytes ever in use at once. Of the cache, not of pins.
    pub peak_bytes: u64,
}

fn as_seconds<S: Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(time.as_secs_f64())
}

impl CacheStatistics {
    /// All lookups that found nothing.
    pub fn misses(&self) -> u64 {
        self.compulsory_misses + self.capacity_misses + self.concurrent_misses + self.bypassed_parent_misses
    }

    /// Hits per lookup, 1 if nothing was looked up.
    pub fn hit_rate(&self) -> f64 {
        if self.lookups == 0 { 1.0 } else { self.hits as f64 / self.lookups as f64 }
    }

    /// Blocks built for one thread for any reason.
    pub fn bypasses(&self) -> u64 {
        self.bypassed_too_large + self.bypassed_pinned + self.bypassed_parent
    }
}

impl AddAssign for CacheStatistics {
    fn add_assign(&mut self, other: Self) {
        self.lookups += other.lookups;
        self.hits += other.hits;
        self.private_hits += other.private_hits;
        self.compulsory_misses += other.compulsory_misses;
        self.capacity_misses += other.capacity_misses;
        self.concurrent_misses += other.concurrent_misses;
        self.bypassed_parent_misses += other.bypassed_parent_misses;
        self.builds_kept += other.builds_kept;
        self.builds_discarded += other.builds_discarded;
        self.bypassed_too_large += other.bypassed_too_large;
        self.bypassed_pinned += other.bypassed_pinned;
        self.bypassed_parent += other.bypassed_parent;
        self.bytes_built += other.bytes_built;
        self.build_time += other.build_time;
        self.time_lost += other.time_lost;
        self.reinsertions += other.reinsertions;
        self.segments_recycled += other.segments_recycled;
        self.peak_bytes = self.peak_bytes.max(other.peak_bytes);
    }
}

impl Sum for CacheStatistics {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, one| {
            sum += one;
            sum
        })
    }
}

/// The counters of one pin; a hit costs one addition to memory of its own.
#[derive(Default)]
pub(super) struct Counters {
    pub hits: Cell<u64>,
    pub private_hits: Cell<u64>,
    pub compulsory_misses: Cell<u64>,
    pub capacity_misses: Cell<u64>,
    pub concurrent_misses: Cell<u64>,
    pub bypassed_parent_misses: Cell<u64>,
    pub builds_kept: Cell<u64>,
    pub builds_discarded: Cell<u64>,
    pub bypassed_too_large: Cell<u64>,
    pub bypassed_pinned: Cell<u64>,
    pub bypassed_parent: Cell<u64>,
    pub bytes_built: Cell<u64>,
    pub reinsertions: Cell<u64>,
    sampled_nanoseconds: Cell<u64>,
    lost_nanoseconds: Cell<u64>,
    until_timed: Cell<u64>,
}

/// Adds one to a counter.
#[inline(always)]
pub(super) fn count(counter: &Cell<u64>) {
    add(counter, 1);
}

/// Adds to a counter.
#[inline(always)]
pub(super) fn add(counter: &Cell<u64>, n: u64) {
    counter.set(counter.get() + n);
}

impl Counters {
    /// The time now, if the build that begins is to be timed.
    pub(super) fn start_build(&self, always: bool) -> Stopwatch {
        let left = self.until_timed.get();
        self.until_timed.set(if left == 0 { TIMED_BUILDS - 1 } else { left - 1 });
        Stopwatch { started: (always || left == 0).then(Instant::now), sampled: left == 0 }
    }

    /// Ends the timing of a build; `lost` if it turned out superfluous.
    pub(super) fn end_build(&self, watch: Stopwatch, lost: bool) {
        let Some(started) = watch.started else { return };
        let nanoseconds = started.elapsed().as_nanos() as u64;
        if watch.sampled {
            add(&self.sampled_nanoseconds, nanoseconds);
        }
        if lost {
            add(&self.lost_nanoseconds, nanoseconds);
        }
    }

    /// The counters as statistics of one pin.
    pub(super) fn statistics(&self) -> CacheStatistics {
        let mut statistics = CacheStatistics {
            lookups: 0,
            hits: self.hits.get(),
            private_hits: self.private_hits.get(),
            compulsory_misses: self.compulsory_misses.get(),
            capacity_misses: self.capacity_misses.get(),
            concurrent_misses: self.concurrent_misses.get(),
            bypassed_parent_misses: self.bypassed_parent_misses.get(),
            builds_kept: self.builds_kept.get(),
            builds_discarded: self.builds_discarded.get(),
            bypassed_too_large: self.bypassed_too_large.get(),
            bypassed_pinned: self.bypassed_pinned.get(),
            bypassed_parent: self.bypassed_parent.get(),
            bytes_built: self.bytes_built.get(),
            build_time: Duration::from_nanos(self.sampled_nanoseconds.get() * TIMED_BUILDS),
            time_lost: Duration::from_nanos(self.lost_nanoseconds.get()),
            reinsertions: self.reinsertions.get(),
            segments_recycled: 0,
            peak_bytes: 0,
        };
        statistics.lookups = statistics.hits + statistics.private_hits + statistics.misses();
        statistics
    }
}

/// When a build began, if anyone wants to know.
pub(super) struct Stopwatch {
    started: Option<Instant>,
    sampled: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_build_in_thirteen_is_timed() {
        let counters = Counters::default();
        let timed = (0..130).filter(|_| counters.start_build(false).started.is_some()).count();
        assert_eq!(timed, 10);
    }

    #[test]
    fn sums_add_counts_and_keep_the_highest_peak() {
        let one = CacheStatistics { lookups: 3, hits: 1, capacity_misses: 2, peak_bytes: 7, ..Default::default() };
        let two = CacheStatistics { lookups: 1, hits: 1, peak_bytes: 5, ..Default::default() };
        let sum: CacheStatistics = [one, two].into_iter().sum();
        assert_eq!((sum.lookups, sum.hits, sum.misses(), sum.peak_bytes), (4, 2, 2, 7));
        assert_eq!(sum.hit_rate(), 0.5);
    }
}
