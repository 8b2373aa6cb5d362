//! What does the cache cost a ray? A visit, a hit on a block that is in the processor's caches or in memory, a miss.
//!
//! `cargo bench --bench cache_lookup`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use lazytess::cache::{Block, BlockLayout, CacheConfig, Claim, Pin, SegmentCache, Slot, SlotId, SlotTable, Visit};

/// A piece of 8x8 cells with 16-bit vertices.
const BLOCK: BlockLayout = BlockLayout { bytes: 704, children: 0 };
const N_LOOKUPS: u32 = 1000;

fn main() {
    divan::main();
}

fn fetch<'v>(visit: &'v Visit<'_>, slot: Slot<'v>) -> Block<'v> {
    visit.get(slot).unwrap_or_else(|| match visit.claim(slot) {
        Claim::Ready(block) => block,
        Claim::Build(ticket) => ticket.publish(BLOCK, |out| out.fill(1)),
    })
}

fn filled(n_slots: u32, bytes: usize) -> (SegmentCache, SlotTable) {
    let cache = SegmentCache::new(CacheConfig::with_bytes(bytes)).expect("the memory is there");
    let table = cache.table(n_slots as usize);
    let mut pin = cache.pin();
    (0..n_slots).for_each(|id| drop_block(&mut pin, &table, id));
    drop(pin);
    (cache, table)
}

fn drop_block(pin: &mut Pin<'_>, table: &SlotTable, id: u32) {
    let visit = pin.visit();
    black_box(fetch(&visit, visit.root(table, SlotId(id))).bytes()[0]);
}

/// A visit for each lookup: the worst case, a ray that meets one block.
#[divan::bench]
fn visit_alone(bencher: Bencher) {
    let (cache, _table) = filled(16, 1 << 20);
    let mut pin = cache.pin();
    bencher.counter(ItemsCount::new(N_LOOKUPS)).bench_local(|| {
        (0..N_LOOKUPS).for_each(|_| _ = black_box(pin.visit()));
    });
}

/// Hits on blocks that are scattered over so many; reads the first byte.
#[divan::bench(args = [16, 100_000])]
fn hit(bencher: Bencher, n_slots: u32) {
    let (cache, table) = filled(n_slots, 256 << 20);
    let mut pin = cache.pin();
    let mut id = 1u32;
    bencher.counter(ItemsCount::new(N_LOOKUPS)).bench_local(|| {
        let visit = pin.visit();
        for _ in 0..N_LOOKUPS {
            id = id.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let slot = visit.root(&table, SlotId((id >> 12) % n_slots));
            black_box(visit.get(slot).map(|block| block.bytes()[0]));
        }
    });
}

/// The same reads from a plain vector of blocks: what is not the cache's fault.
#[divan::bench(args = [16, 100_000])]
fn plain_vector(bencher: Bencher, n_slots: u32) {
    let blocks = vec![[1u8; 704]; n_slots as usize];
    let mut id = 1u32;
    bencher.counter(ItemsCount::new(N_LOOKUPS)).bench_local(|| {
        for _ in 0..N_LOOKUPS {
            id = id.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            black_box(blocks.get(((id >> 12) % n_slots) as usize).map(|block| block[0]));
        }
    });
}

/// Misses with recycling: a cache of a megabyte, ten times as many blocks in turn, filled with a `memset`.
#[divan::bench]
fn miss(bencher: Bencher) {
    let (cache, table) = filled(16_000, 1 << 20);
    let mut pin = cache.pin();
    let mut id = 0;
    bencher.counter(ItemsCount::new(N_LOOKUPS)).bench_local(|| {
        for _ in 0..N_LOOKUPS {
            id = (id + 1) % 16_000;
            drop_block(&mut pin, &table, id);
        }
    });
}

/// A cache of nothing: every lookup builds in private memory.
#[divan::bench]
fn bypass(bencher: Bencher) {
    let (cache, table) = filled(16, 0);
    let mut pin = cache.pin();
    bencher.counter(ItemsCount::new(N_LOOKUPS)).bench_local(|| {
        (0..N_LOOKUPS).for_each(|id| drop_block(&mut pin, &table, id % 16));
    });
}
