//! How large a cache is and how it is cut.

use super::memory::{LINE, lines_for};
use super::word::MAX_SEGMENT_LINES;

/// Segments that a cache is cut into unless it is small or huge. Each costs a share of the memory that is not yet
/// filled or about to be recycled, fewer lose more at once.
const DEFAULT_SEGMENTS: usize = 64;
/// Segments smaller than this waste too much at their end when blocks are about a kilobyte.
const SMALLEST_DEFAULT_SEGMENT: usize = 64 << 10;

/// How many bytes of blocks a cache may hold.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Capacity {
    /// So many bytes, down to none at all: then every block is built for each use.
    Bytes(usize),
    /// As many as will be wanted, which is at most `at_most`. Memory becomes resident as it is filled. Where the system
    /// does not even lend the addresses, the bound is halved until it does, and blocks are recycled after all.
    Unbounded {
        /// Bytes of all blocks that could ever be built, generously.
        at_most: usize,
    },
}

/// What a [`SegmentCache`](super::SegmentCache) is made of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CacheConfig {
    /// Bytes of blocks.
    pub capacity: Capacity,
    /// Segments of the ring, rounded up to a power of two, from 2 to 2^20, but as many at least as a huge capacity
    /// needs, whose segments have at most 16 MiB. `None`: chosen from the capacity.
    pub segments: Option<usize>,
    /// Pins that can use the cache at the same time. Pins beyond build every block for themselves.
    pub max_threads: usize,
    /// Which blocks that are hit shortly before they would be recycled are copied to the current segment.
    pub reinsert: Reinsert,
}

/// Blocks that stay as long as they are used, like the second chance of a page.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reinsert {
    /// None: the ring is a plain queue.
    Never,
    /// Blocks with child slots. Where they lie among the oldest, all that was built below them is lost with them,
    /// though it is younger.
    Parents,
    /// All.
    All,
}

impl CacheConfig {
    /// A cache of `bytes` with everything else as it should be for most.
    pub fn with_bytes(bytes: usize) -> Self {
        Self { capacity: Capacity::Bytes(bytes), segments: None, max_threads: 256, reinsert: Reinsert::Parents }
    }

    /// A cache that grows up to `at_most` bytes.
    pub fn unbounded(at_most: usize) -> Self {
        Self { capacity: Capacity::Unbounded { at_most }, ..Self::with_bytes(0) }
    }
}

/// The ring that a configuration asks for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct RingShape {
    pub segments: usize,
    pub segment_lines: usize,
    pub grace: usize,
}

impl RingShape {
    /// Never more than `bytes` in all.
    pub(super) fn new(bytes: usize, segments: Option<usize>) -> Self {
        let at_least = lines_for(bytes).div_ceil(MAX_SEGMENT_LINES).next_power_of_two();
        let wanted = segments.map_or_else(|| default_segments(bytes), |n| n.clamp(2, 1 << 20).next_power_of_two());
        let segments = wanted.max(at_least);
        // A sixteenth of the memory: what others may fill while the system keeps a thread asleep inside its visit.
        let grace = (segments / 16).max(1);
        Self { segments, segment_lines: (bytes / LINE / segments).min(MAX_SEGMENT_LINES), grace }
    }
}

fn default_segments(bytes: usize) -> usize {
    let most = (bytes / SMALLEST_DEFAULT_SEGMENT).max(1);
    (1 << most.ilog2()).clamp(4, DEFAULT_SEGMENTS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_never_exceeds_the_capacity_and_uses_nearly_all_of_it() {
        for bytes in [0, 1, 63, 64, 1000, 65_536, 1 << 20, 100_000_000, 3 << 30, 1 << 40] {
            for segments in [None, Some(1), Some(3), Some(16), Some(1000)] {
                let shape = RingShape::new(bytes, segments);
                let total = shape.segments * shape.segment_lines * LINE;
                assert!(total <= bytes && shape.segments.is_power_of_two() && shape.segments > shape.grace);
                assert!(bytes < 1 << 20 || segments == Some(1000) || total as f64 > 0.99 * bytes as f64, "{bytes}");
            }
        }
    }

    #[test]
    fn small_caches_have_few_segments() {
        assert_eq!(RingShape::new(100_000, None).segments, 4);
        assert_eq!(RingShape::new(1 << 20, None).segments, 16);
        assert_eq!(RingShape::new(1 << 30, None).segments, 64);
    }
}
