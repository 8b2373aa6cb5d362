//! Claims about the whole cache; the properties hold for the mutex reference, too.

use super::reference::{BlockCache, MutexCache};
use super::*;
use std::panic::{AssertUnwindSafe, catch_unwind};

fn config(bytes: usize, segments: usize) -> CacheConfig {
    CacheConfig { segments: Some(segments), max_threads: 8, ..CacheConfig::with_bytes(bytes) }
}

fn cache(bytes: usize, segments: usize) -> SegmentCache {
    SegmentCache::new(config(bytes, segments)).unwrap()
}

/// Gets or builds the block `id` whose bytes are all `id`.
fn fetch<'v>(visit: &'v Visit<'_>, slot: Slot<'v>, id: u8, layout: BlockLayout) -> Block<'v> {
    visit.get(slot).unwrap_or_else(|| match visit.claim(slot) {
        Claim::Ready(block) => block,
        Claim::Build(ticket) => ticket.publish(layout, |out| out.fill(id)),
    })
}

fn bytes(bytes: usize) -> BlockLayout {
    BlockLayout { bytes, children: 0 }
}

#[test]
fn a_published_block_is_found_by_other_pins() {
    let cache = cache(4096, 4);
    let table = cache.table(2);
    let (mut one, mut two) = (cache.pin(), cache.pin());
    let visit = one.visit();
    fetch(&visit, visit.root(&table, SlotId(1)), 7, bytes(100));
    let visit = two.visit();
    let block = visit.get(visit.root(&table, SlotId(1))).unwrap();
    assert_eq!(&block.bytes()[..100], [7; 100]);
    assert_eq!(&block.bytes()[100..], [0; 28]);
    assert_eq!(block.bytes().as_ptr().align_offset(64), 0);
    assert!(visit.get(visit.root(&table, SlotId(0))).is_none());
}

#[test]
fn the_oldest_blocks_go_first() {
    let cache = cache(8 * 64, 8);
    let table = cache.table(10);
    let mut pin = cache.pin();
    for i in 0..10 {
        let visit = pin.visit();
        fetch(&visit, visit.root(&table, SlotId(i)), i as u8, bytes(64));
    }
    let visit = pin.visit();
    let present: Vec<u32> = (0..10).filter(|&i| visit.get(visit.root(&table, SlotId(i))).is_some()).collect();
    // Eight segments of one block each, the oldest of which may be recycled any time.
    assert_eq!(present, [3, 4, 5, 6, 7, 8, 9]);
}

#[test]
fn blocks_of_a_visit_last_until_it_ends() {
    let cache = cache(4 * 128, 4);
    let table = cache.table(100);
    let mut pin = cache.pin();
    let visit = pin.visit();
    let blocks: Vec<_> = (0..100).map(|i| fetch(&visit, visit.root(&table, SlotId(i)), i as u8, bytes(128))).collect();
    assert!(blocks.iter().enumerate().all(|(i, block)| block.bytes().iter().all(|&b| b == i as u8)));
    drop(pin);
    let statistics = cache.statistics();
    assert_eq!((statistics.compulsory_misses, statistics.builds_kept + statistics.bypassed_pinned), (100, 100));
    assert!(statistics.bypassed_pinned > 90, "a visit keeps the segments it may read");
}

#[test]
fn a_cache_of_nothing_leaves_each_thread_what_it_has_just_built() {
    for capacity in [0, 1, 64, 127] {
        let cache = cache(capacity, 4);
        let table = cache.table(1);
        let mut pin = cache.pin();
        for _ in 0..3 {
            let visit = pin.visit();
            let parent = fetch(&visit, visit.root(&table, SlotId(0)), 5, BlockLayout { bytes: 10, children: 9 });
            let child = fetch(&visit, parent.child(8), 6, bytes(70));
            assert_eq!((parent.bytes()[9], child.bytes()[69], child.bytes().len()), (5, 6, 128));
        }
        let seen = pin.statistics();
        assert_eq!((seen.hits, seen.private_hits, seen.compulsory_misses, seen.capacity_misses), (0, 4, 1, 0));
        assert_eq!((seen.bypassed_too_large, seen.bypassed_parent, seen.lookups), (1, 1, 6));
    }
}

#[test]
fn a_thread_forgets_its_own_blocks_before_they_are_many() {
    let cache = cache(0, 4);
    let table = cache.table(1000);
    let mut pin = cache.pin();
    for _ in 0..2 {
        for id in 0..1000 {
            let visit = pin.visit();
            let block = fetch(&visit, visit.root(&table, SlotId(id)), id as u8, bytes(1024));
            assert!(block.bytes().iter().all(|&b| b == id as u8));
        }
    }
    let seen = pin.statistics();
    assert_eq!((seen.private_hits, seen.compulsory_misses, seen.capacity_misses), (0, 1000, 1000));
}

#[test]
fn a_block_of_ones_own_is_not_taken_for_one_of_a_later_table() {
    let cache = cache(4 * 64, 4);
    let mut pin = cache.pin();
    let visit = pin.visit();
    // The next table has the address of the last one, as a rule.
    for id in 1..20 {
        let table = cache.table(1);
        let block = fetch(&visit, visit.root(&table, SlotId(0)), id, bytes(1000));
        assert_eq!(block.bytes()[0], id);
    }
}

#[test]
fn a_block_larger_than_a_segment_is_used_once() {
    let cache = cache(4 * 256, 4);
    let table = cache.table(1);
    let mut pin = cache.pin();
    let visit = pin.visit();
    let block = fetch(&visit, visit.root(&table, SlotId(0)), 9, bytes(1_000_000));
    assert!(block.bytes()[..1_000_000].iter().all(|&b| b == 9));
    assert!(visit.get(visit.root(&table, SlotId(0))).is_none());
}

#[test]
fn children_go_with_their_parent_and_count_as_evicted_after_it() {
    let cache = cache(4 * 256, 4);
    let table = cache.table(20);
    let mut pin = cache.pin();
    let parent_layout = BlockLayout { bytes: 64, children: 2 };
    let mut visit_family = |parent: u32| {
        let visit = pin.visit();
        let block = fetch(&visit, visit.root(&table, SlotId(parent)), parent as u8, parent_layout);
        let child = fetch(&visit, block.child(1), 100, bytes(128));
        assert_eq!(child.bytes(), [100; 128]);
    };
    visit_family(0);
    visit_family(0);
    (1..20).for_each(&mut visit_family);
    visit_family(0);
    let statistics = pin.statistics();
    assert_eq!((statistics.hits, statistics.compulsory_misses, statistics.capacity_misses), (2, 40, 2));
    assert!(cache.statistics().segments_recycled > 10);
}

#[test]
fn a_lagging_pin_makes_others_bypass_and_a_dropped_one_does_not() {
    let cache = cache(4 * 64, 4);
    let table = cache.table(50);
    let (mut idle, mut busy) = (cache.pin(), cache.pin());
    let build_all = |busy: &mut Pin<'_>| {
        for i in 0..50 {
            let visit = busy.visit();
            fetch(&visit, visit.root(&table, SlotId(i)), i as u8, bytes(64));
        }
        busy.statistics().bypassed_pinned
    };
    idle.visit();
    let bypassed = build_all(&mut busy);
    assert!(bypassed > 40);
    drop(idle);
    assert_eq!(build_all(&mut busy), bypassed);
}

#[test]
fn a_builder_that_panics_gives_the_slot_back() {
    let cache = cache(4096, 4);
    let table = cache.table(1);
    let (mut one, mut two) = (cache.pin(), cache.pin());
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        let visit = one.visit();
        let slot = visit.root(&table, SlotId(0));
        let Claim::Build(ticket) = visit.claim(slot) else { return };
        ticket.publish(bytes(64), |_| panic!("on purpose"));
    }));
    assert!(panicked.is_err());
    let visit = two.visit();
    fetch(&visit, visit.root(&table, SlotId(0)), 3, bytes(64));
    assert_eq!((two.statistics().compulsory_misses, two.statistics().concurrent_misses), (1, 0));
}

#[test]
fn who_is_faster_publishes_and_the_other_takes_it() {
    let cache = cache(4096, 4);
    let table = cache.table(1);
    let (mut slow, mut fast) = (cache.pin(), cache.pin());
    let visit = slow.visit();
    let Claim::Build(ticket) = visit.claim(visit.root(&table, SlotId(0))) else { panic!("the slot is empty") };
    {
        let visit = fast.visit();
        assert_eq!(fetch(&visit, visit.root(&table, SlotId(0)), 3, bytes(64)).bytes(), [3; 64]);
        assert!(visit.get(visit.root(&table, SlotId(0))).is_some());
    }
    let block = ticket.publish(bytes(64), |_| panic!("it was published already"));
    assert_eq!(block.bytes(), [3; 64]);
    assert_eq!(fast.statistics().concurrent_misses, 1);
    assert_eq!(slow.statistics().builds_discarded, 1);
}

#[test]
fn a_pin_too_many_works_without_the_cache() {
    let cache = SegmentCache::new(CacheConfig { max_threads: 1, ..config(4096, 4) }).unwrap();
    let table = cache.table(1);
    let (mut member, mut outsider) = (cache.pin(), cache.pin());
    for _ in 0..2 {
        let visit = outsider.visit();
        assert_eq!(fetch(&visit, visit.root(&table, SlotId(0)), 4, bytes(64)).bytes(), [4; 64]);
    }
    assert_eq!(outsider.statistics().hits, 0);
    let visit = member.visit();
    assert!(visit.get(visit.root(&table, SlotId(0))).is_none());
}

#[test]
fn at_the_end_of_time_the_cache_stops_recycling() {
    let cache = SegmentCache::starting_at(config(4 * 64, 4), word::MAX_AGE - 2).unwrap();
    let table = cache.table(1);
    let mut pin = cache.pin();
    for i in 0..10 {
        let tables = cache.table(1);
        let visit = pin.visit();
        fetch(&visit, visit.root(&tables, SlotId(0)), i, bytes(64));
        assert_eq!(fetch(&visit, visit.root(&table, SlotId(0)), 99, bytes(64)).bytes(), [99; 64]);
    }
    assert!(pin.statistics().bypassed_pinned > 0);
}

#[test]
#[should_panic(expected = "only be used with the cache that made it")]
fn a_slot_of_another_cache_is_refused() {
    let (mine, other) = (cache(4096, 4), cache(8192, 4));
    let table = other.table(1);
    let mut pin = mine.pin();
    let visit = pin.visit();
    visit.get(visit.root(&table, SlotId(0)));
}

#[test]
fn unbounded_keeps_everything_and_peaks_at_what_was_filled() {
    let cache = SegmentCache::new(CacheConfig::unbounded(64 << 30)).unwrap();
    let table = cache.table(1000);
    let mut pin = cache.pin();
    for i in 0..2000 {
        let visit = pin.visit();
        fetch(&visit, visit.root(&table, SlotId(i % 1000)), i as u8, bytes(64));
    }
    assert_eq!((pin.statistics().hits, cache.statistics().peak_bytes), (1000, 64_000));
}

#[test]
fn a_pin_that_stands_still_keeps_nobody_from_what_was_never_used() {
    let cache = cache(16 * 256, 16);
    let table = cache.table(1000);
    let (mut sleeper, mut pin) = (cache.pin(), cache.pin());
    let visit = sleeper.visit();
    let read = fetch(&visit, visit.root(&table, SlotId(0)), 1, bytes(64));
    for i in 1..64 {
        let visit = pin.visit();
        fetch(&visit, visit.root(&table, SlotId(i)), i as u8, bytes(64));
    }
    assert_eq!(pin.statistics().bypasses(), 0, "64 lines are all that there are");
    for i in 64..200 {
        let visit = pin.visit();
        fetch(&visit, visit.root(&table, SlotId(i)), i as u8, bytes(64));
    }
    assert_eq!((pin.statistics().bypassed_pinned, read.bytes()), (136, &[1; 64][..]));
    // It sees what others have built since it began, however far the head is by now.
    assert_eq!(visit.get(visit.root(&table, SlotId(63))).map(|block| block.bytes()[0]), Some(63));
    let visit = sleeper.visit();
    fetch(&visit, visit.root(&table, SlotId(200)), 200, bytes(64));
    drop(sleeper);
    let visit = pin.visit();
    fetch(&visit, visit.root(&table, SlotId(201)), 201, bytes(64));
    assert_eq!(pin.statistics().bypassed_pinned, 136);
}

#[test]
fn reinsertion_keeps_a_block_that_is_used_and_its_children() {
    let misses = [Reinsert::Never, Reinsert::Parents, Reinsert::All].map(|reinsert| {
        let cache = SegmentCache::new(CacheConfig { reinsert, ..config(16 * 256, 16) }).unwrap();
        let table = cache.table(1000);
        let mut pin = cache.pin();
        for i in 1..1000 {
            let visit = pin.visit();
            let parent = fetch(&visit, visit.root(&table, SlotId(0)), 1, BlockLayout { bytes: 64, children: 3 });
            assert_eq!(fetch(&visit, parent.child(2), 2, bytes(64)).bytes(), [2; 64]);
            fetch(&visit, visit.root(&table, SlotId(i)), 3, bytes(64));
        }
        let statistics = pin.statistics();
        assert_eq!(statistics.reinsertions > 0, reinsert != Reinsert::Never);
        statistics.capacity_misses
    });
    // A parent that goes takes its child along; a parent that stays loses its child when that is the oldest.
    assert!(misses[0] > misses[1] && misses[1] > 0 && misses[2] == 0, "{misses:?}");
}

/// A segment cache as the reference's trait.
struct Ours {
    cache: SegmentCache,
    table: SlotTable,
}

impl BlockCache for Ours {
    fn fetch(&self, path: &[u32], build: &mut dyn FnMut(&[u32]) -> Vec<u8>) -> Vec<u8> {
        let mut pin = self.cache.pin();
        let visit = pin.visit();
        let mut slot = visit.root(&self.table, SlotId(path[0]));
        for end in 1..path.len() {
            slot = get_or_build(&visit, slot, &path[..end], build).child(path[end] as usize);
        }
        get_or_build(&visit, slot, path, build).bytes().to_vec()
    }

    fn bytes_bound(&self) -> usize {
        self.cache.statistics().peak_bytes as usize
    }
}

fn get_or_build<'v>(
    visit: &'v Visit<'_>,
    slot: Slot<'v>,
    path: &[u32],
    build: &mut dyn FnMut(&[u32]) -> Vec<u8>,
) -> Block<'v> {
    visit.get(slot).unwrap_or_else(|| match visit.claim(slot) {
        Claim::Ready(block) => block,
        Claim::Build(ticket) => {
            let content = build(path);
            ticket.publish(BlockLayout { bytes: content.len(), children: 8 }, |out| out.copy_from_slice(&content))
        }
    })
}

/// The one content of a block: its length and bytes depend on the path alone.
fn content(path: &[u32]) -> Vec<u8> {
    let hash =
        path.iter().fold(17u32, |hash, &step| hash.wrapping_mul(0x9E37_79B1) ^ (step + 1).wrapping_mul(0x85EB_CA6B));
    let lines = 1 + (hash >> 9) as usize % 4;
    hash.to_le_bytes().repeat(16 * lines)
}

fn pseudo_random(seed: u64) -> impl FnMut(u32) -> u32 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % u64::from(below)) as u32
    }
}

/// Fetches random paths and checks each: what the cache says is what was built, and it holds no more than it may.
fn every_fetch_is_right(cache: &dyn BlockCache, capacity: usize, seed: u64, n: usize) {
    let mut random = pseudo_random(seed);
    for _ in 0..n {
        let path: Vec<u32> = (0..1 + random(3)).map(|_| random(8)).collect();
        assert_eq!(cache.fetch(&path, &mut |path| content(path)), content(&path), "seed {seed}, path {path:?}");
        assert!(cache.bytes_bound() <= capacity);
    }
}

#[test]
fn every_fetch_is_right_whatever_the_capacity() {
    let n = if cfg!(miri) { 30 } else { 2000 };
    for capacity in [0, 64, 200, 1000, 5000, 20_000, 1 << 20] {
        every_fetch_is_right(&MutexCache::new(capacity), capacity, 1, n);
        for (segments, reinsert) in
            [(2, Reinsert::Never), (4, Reinsert::All), (16, Reinsert::Parents), (64, Reinsert::Never)]
        {
            let cache = SegmentCache::new(CacheConfig { reinsert, ..config(capacity, segments) }).unwrap();
            let table = cache.table(8);
            every_fetch_is_right(&Ours { cache, table }, capacity, 1, n);
        }
    }
}

#[test]
fn every_fetch_is_right_with_more_threads_than_cores() {
    let n = if cfg!(miri) { 10 } else { 500 };
    for capacity in [1000, 10_000] {
        let cache = SegmentCache::new(CacheConfig { reinsert: Reinsert::All, ..config(capacity, 4) }).unwrap();
        let table = cache.table(8);
        let both: [&dyn BlockCache; 2] = [&MutexCache::new(capacity), &Ours { cache, table }];
        for cache in both {
            std::thread::scope(|scope| {
                (0..16).for_each(|seed| drop(scope.spawn(move || every_fetch_is_right(cache, capacity, seed, n))));
            });
        }
    }
}
