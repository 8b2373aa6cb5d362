//! A shared, bounded cache of byte blocks, filled on demand and emptied in the order it was filled. It knows bytes, not
//! geometry.
//!
//! A **block** is a run of bytes, with room for the words of child blocks. A **slot** names a block: it is an atomic
//! word in a **table** or in the parent block. A **segment** is one S-th of the memory; blocks are appended to the
//! current segment until one does not fit. Then the oldest segment becomes current and everything in it is gone. The
//! **age** of a segment counts the segments before it, from the beginning of time; the current age is the **head**.
//! A **pin** is a thread's right to read, and stands at an age. A **visit** is the time during which a pin stands
//! still: the time of a ray. A **claim** is the task to build a missing block.
//!
//! ```text
//!   S = 8, grace G = 1                                    head
//!   age:   12       13       14       15      ...   18      19
//!       ┌────────┬────────┬────────┬────────┐    ┌────────┬────────┐
//!       │░░░░░░░░│████████│████████│████████│ .. │████████│███     │   slot word = (age, line, size)
//!       └────────┴────────┴────────┴────────┘    └────────┴────────┘   a pin at p reads ages > p + G - S
//!        next to   └────── what a pin at 19 may read ──────┘    ▲
//!        be recycled, so that no pin at 19 may read it          └ blocks are reserved here by an atomic addition
//! ```
//!
//! # How it is used
//!
//! ```
//! use lazytess::cache::{BlockLayout, CacheConfig, Claim, SegmentCache, SlotId};
//!
//! let cache = SegmentCache::new(CacheConfig::with_bytes(1 << 20))?;
//! let table = cache.table(100);
//! let mut pin = cache.pin();                                     // one per thread
//! let visit = pin.visit();                                       // one per ray
//! let slot = visit.root(&table, SlotId(42));
//! let block = visit.get(slot).unwrap_or_else(|| match visit.claim(slot) {
//!     Claim::Ready(block) => block,
//!     Claim::Build(ticket) => ticket.publish(BlockLayout { bytes: 3, children: 16 }, |out| out.copy_from_slice(b"abc")),
//! });
//! assert_eq!(&block.bytes()[..3], b"abc");
//! assert!(visit.get(block.child(15)).is_none());
//! # Ok::<(), lazytess::Error>(())
//! ```
//!
//! # The protocol
//!
//! **Reading.** A visit loads a slot word. If its age is above `p + G - S`, where `p` is the pin's age, the block is
//! there. Nothing shared is written. At the begin of a visit the pin compares its age with the head; only if they
//! differ it announces the new age in its pin word and checks that the head has not moved meanwhile.
//!
//! **Building.** A miss claims the slot by changing its word from "empty" or "evicted" to "building", takes as long as
//! it likes without holding anything, reserves room in the current segment once the size is known, writes, and
//! publishes by putting the place into the slot word. Who finds "building" builds as well, and whoever is ready first
//! publishes. So a builder that the system puts to sleep delays nobody, and since equal slots have equal bytes it does
//! not matter whose block it is.
//!
//! **Recycling.** Who finds the current segment full makes the next one current: without more ado as long as there are
//! segments that were never used, later if every pin stands at `head + 1 - G` or later. Any number of threads may try
//! at once. If a pin lags behind, or if the block is larger than a segment, the block is built in memory of the
//! thread's own and seen by no other: a **bypass**. Blocks below it are bypassed, too. A thread remembers the last
//! [`SegmentCache::SCRATCH_BYTES`] of such blocks: without any cache, the next ray often needs what the last ones have
//! built.
//!
//! A thread that the system puts to sleep in the middle of a visit pins a segment until it runs again, which with more
//! threads than processors is soon the state of them all. So a thread that was bypassed because of a pin gives up its
//! processor at the end of its visit, with its own pin released: the sleepers end their visits one after the other, and
//! from then on threads mostly sleep between visits.
//!
//! Nobody ever waits. There is no lock on any of these ways, each loop is left after a bounded number of rounds, and
//! the cost of bad luck is a block built twice, which is counted.
//!
//! # Invariants
//!
//! 1. *A block is written by one thread, before its word is published with `Release`; words are read with `Acquire`.*
//!    Lines are reserved by an atomic addition to the cursor of the segment, so no two threads write the same line.
//! 2. *While a pin stands at `p`, nothing is recycled to open an age beyond `p + G`.* Follows from 4: for `p + G + 1`
//!    somebody must have seen every pin at `p + 1` or later. (Segments that were never used are opened beyond it.)
//! 3. *While a pin stands at `p`, no segment of an age above `p + G - S` is recycled.* Recycling age `a` means opening
//!    age `a + S`, and `a + S <= p + G` by 2. It holds for what the pin's thread reads, however far the head is, and,
//!    since it reserves at an age of at least `p` and `G < S`, for what it writes.
//! 4. *No announcement is missed.* A pin's thread sees the head at `p`, stores `p`, fences (`SeqCst`), and sees the
//!    head still at `p`. A recycler opens `h + 1` only if all pins stand at `h + 1 - G` or later, its own among them,
//!    which stands at some `c`. If `h >= p + G`, then `c > p`: the recycler saw the head at `c` before it fenced, the
//!    other thread saw it at `p` after it fenced, so the other's fence was first, and the scan, which comes after the
//!    recycler's fence, sees the other's pin word. If `h < p + G`, the recycler opens at most `p + G`, which the pin
//!    allows anyway. (With `G = 0` the recycler's own pin would stop it. Who opens a segment that was never used
//!    recycles nothing.)
//! 5. *What was read is read before it is overwritten.* A pin word is stored with `Release` and scanned with `Acquire`,
//!    the head is advanced with `Release` after the scan, and who writes in a segment has loaded the head with
//!    `Acquire`. Every thread that may advance the head to a recycled segment has made its own scan, so it does not
//!    matter whose advance succeeds.
//! 6. *A cursor belongs to one age.* It carries the age of its segment and is moved on by compare-and-swap before the
//!    head is, so that of several recyclers one resets it. By 3 no thread adds to a cursor of an age that is past.
//! 7. *A slot is used with its own cache only*, which is checked when it is used. A child slot lives in its parent's
//!    block, and the borrow checker ends it with the visit.
//!
//! A child word may outlive its block and the other way round: a word of a recycled block is too old for every pin, and
//! a block whose parent is gone cannot be reached and is recycled in its turn.
//!
//! loom explores the protocol (`tests/loom.rs`), a mutex version passes the same tests (`reference.rs`, tests only).
//! Idea: Benthin et al., "Efficient Ray Tracing of Subdivision Surfaces using Tessellation Caching", HPG 2015, whose
//! cache makes all threads stop to recycle a segment; the pins are Fraser's epochs (2004) with a grace period.
//!
//! What is found out about things with numbers is remembered in a table beside the blocks (`memo.rs`). What other sizes
//! would do is replayed from a **trace** of accesses (`trace.rs`, `replay.rs`).
//!
//! Read `pin.rs` first, then `segment.rs`, then `ticket.rs`.

mod block;
mod config;
mod memo;
mod memory;
mod pin;
#[cfg(all(test, not(loom)))]
mod reference;
mod replay;
mod scratch;
mod segment;
mod slot;
mod stats;
mod sync;
#[cfg(all(test, not(loom)))]
mod tests;
mod ticket;
mod trace;
mod word;

pub use block::{Block, BlockLayout};
pub use config::{CacheConfig, Capacity, Reinsert};
pub use memo::MemoTable;
pub use pin::{Pin, Visit};
pub use replay::{Policy, Replay, Replayed};
pub use slot::{Slot, SlotId, SlotTable};
pub use stats::CacheStatistics;
pub use ticket::{Claim, Ticket};
pub use trace::{Recorder, TraceLog};

use crate::error::{Error, ErrorKind, Result};
use config::RingShape;
use parking_lot::Mutex;
use segment::Ring;
use slot::CacheTag;
use sync::AtomicU64;

/// The cache: memory, pins and counters. Shared by reference among threads.
pub struct SegmentCache {
    ring: Ring,
    pins: pin::Pins,
    tag: CacheTag,
    /// Child words of all blocks of threads' own: nobody ever writes them.
    private_words: Box<[AtomicU64]>,
    reinsert: Reinsert,
    totals: Mutex<CacheStatistics>,
}

impl SegmentCache {
    /// Bytes of private memory that a pin keeps from visit to visit, about. During a visit it may need more: as much as
    /// the blocks that this visit builds and that find no place in the cache.
    pub const SCRATCH_BYTES: usize = scratch::BYTES_KEPT;

    /// An empty cache. Its memory becomes resident as it is filled.
    ///
    /// # Errors
    /// If the system does not lend that much memory.
    pub fn new(config: CacheConfig) -> Result<Self> {
        Self::starting_at(config, 0)
    }

    /// A cache whose first segment has this age.
    fn starting_at(config: CacheConfig, first_age: u64) -> Result<Self> {
        Ok(Self {
            ring: ring_for(config, first_age)?,
            pins: pin::Pins::new(config.max_threads),
            tag: CacheTag::default(),
            private_words: (0..N_PRIVATE_WORDS).map(|_| AtomicU64::new(word::PRIVATE)).collect(),
            reinsert: config.reinsert,
            totals: Mutex::default(),
        })
    }

    /// A table of `n_slots` empty slots.
    pub fn table(&self, n_slots: usize) -> SlotTable {
        SlotTable::new(n_slots, self.tag.clone())
    }

    /// A pin for the calling thread. Never fails: a pin too many sees an empty cache and builds for itself.
    pub fn pin(&self) -> Pin<'_> {
        Pin::new(self)
    }

    /// Bytes for blocks: the capacity asked for, less what does not divide into segments of whole lines.
    pub fn capacity(&self) -> usize {
        self.ring.capacity()
    }

    /// Bytes of one segment. A block that is larger is built for each use.
    pub fn segment_bytes(&self) -> usize {
        self.ring.segment_bytes()
    }

    /// The counters of all pins that were dropped, and of the ring.
    pub fn statistics(&self) -> CacheStatistics {
        CacheStatistics {
            segments_recycled: self.ring.n_recycled(),
            peak_bytes: self.ring.peak_bytes() as u64,
            ..*self.totals.lock()
        }
    }
}

/// As many as a block has children. Under loom, where each atomic makes the model slower, as a toy block has.
const N_PRIVATE_WORDS: usize = if cfg!(loom) { 8 } else { BlockLayout::MAX_CHILDREN };

fn ring_for(config: CacheConfig, first_age: u64) -> Result<Ring> {
    let ring = |bytes| {
        let RingShape { segments, segment_lines, grace } = RingShape::new(bytes, config.segments);
        Ring::new(segments, segment_lines, grace, first_age)
    };
    match config.capacity {
        Capacity::Bytes(bytes) => ring(bytes).ok_or_else(|| {
            Error::new(
                ErrorKind::Budget,
                format!("the system refuses {bytes} bytes for the cache; give it a smaller one"),
            )
        }),
        Capacity::Unbounded { at_most } => {
            let halves = std::iter::successors(Some(at_most), |bytes| (*bytes > 0).then_some(bytes / 2));
            Ok(halves.filter_map(ring).next().expect("an empty cache needs no memory"))
        }
    }
}
