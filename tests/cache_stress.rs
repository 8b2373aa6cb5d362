//! Many threads on few cores and a cache of a few blocks: what a slot leads to is what was built for that slot.
//!
//! Embree's way: every block is filled with its own id, whoever reads checks. Runs for about two seconds; for
//! `LAZYTESS_STRESS_SECONDS` if that is set. `LAZYTESS_STRESS_THREADS=64` leaves out the lines with other numbers of
//! threads; the lines share the time.

use lazytess::cache::{
    Block, BlockLayout, CacheConfig, CacheStatistics, Claim, Reinsert, SegmentCache, Slot, SlotId, SlotTable, Visit,
};
use std::time::{Duration, Instant};

const N_SLOTS: u32 = 200;
const N_CHILDREN: u32 = 16;

struct Stress {
    cache: SegmentCache,
    table: SlotTable,
    until: Instant,
}

impl Stress {
    fn new(bytes: usize, reinsert: Reinsert) -> Self {
        let cache = SegmentCache::new(CacheConfig { reinsert, ..CacheConfig::with_bytes(bytes) }).unwrap();
        let table = cache.table(N_SLOTS as usize);
        Self { cache, table, until: Instant::now() + time_for_one() }
    }

    /// Random visits until the time is over; returns how many there were.
    fn work(&self, seed: u32) -> u64 {
        let mut pin = self.cache.pin();
        let (mut state, mut n_visits) = (seed.wrapping_mul(0x9E37_79B9) | 1, 0);
        while n_visits == 0 || n_visits % 64 != 0 || Instant::now() < self.until {
            self.one_visit(&pin.visit(), &mut state);
            n_visits += 1;
            if n_visits % 1024 == 0 {
                pin = self.cache.pin();
            }
        }
        n_visits
    }

    /// A few parents with a few children each, all looked at again at the end.
    fn one_visit(&self, visit: &Visit<'_>, state: &mut u32) {
        let mut seen = Vec::new();
        for _ in 0..1 + random(state, 3) {
            // Low ids are wanted more often, as in a picture.
            let root = random(state, N_SLOTS).min(random(state, N_SLOTS));
            let parent = fetch(visit, visit.root(&self.table, SlotId(root)), root, N_CHILDREN);
            seen.push((parent, root));
            for _ in 0..random(state, 3) {
                let child = random(state, N_CHILDREN);
                let id = N_SLOTS + root * N_CHILDREN + child;
                seen.push((fetch(visit, parent.child(child as usize), id, 0), id));
            }
        }
        seen.iter().for_each(|(block, id)| check(block, *id));
    }
}

/// Threads, bytes, and what is copied before it is recycled.
const LINES: [(u32, usize, Reinsert); 4] = [
    (2, 4 << 10, Reinsert::Never),
    (16, 20 << 10, Reinsert::All),
    (64, 20 << 10, Reinsert::Never),
    (64, 600 << 10, Reinsert::Parents),
];

fn number_in<T: std::str::FromStr>(variable: &str) -> Option<T> {
    std::env::var(variable).ok().and_then(|text| text.parse().ok())
}

/// The lines to run.
fn lines() -> Vec<(u32, usize, Reinsert)> {
    let only = number_in::<u32>("LAZYTESS_STRESS_THREADS");
    LINES.into_iter().filter(|(n_threads, ..)| only.is_none_or(|only| only == *n_threads)).collect()
}

fn time_for_one() -> Duration {
    let seconds = number_in("LAZYTESS_STRESS_SECONDS").unwrap_or(2.0);
    Duration::from_secs_f64(seconds / lines().len().max(1) as f64)
}

fn random(state: &mut u32, below: u32) -> u32 {
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    *state % below
}

fn words_of(id: u32) -> usize {
    16 + (id as usize * 7) % 200
}

fn fetch<'v>(visit: &'v Visit<'_>, slot: Slot<'v>, id: u32, children: u32) -> Block<'v> {
    visit.get(slot).unwrap_or_else(|| match visit.claim(slot) {
        Claim::Ready(block) => block,
        Claim::Build(ticket) => {
            let layout = BlockLayout { bytes: 4 * words_of(id), children: children as usize };
            ticket
                .publish(layout, |out| out.chunks_exact_mut(4).for_each(|word| word.copy_from_slice(&id.to_le_bytes())))
        }
    })
}

fn check(block: &Block<'_>, id: u32) {
    let words = block.bytes().chunks_exact(4).take(words_of(id));
    assert!(words.clone().count() == words_of(id) && words.clone().all(|word| word == id.to_le_bytes()), "block {id}");
}

/// Runs the threads and returns visits of the slowest thread and all counters.
fn stress(n_threads: u32, bytes: usize, reinsert: Reinsert) -> (u64, CacheStatistics) {
    let stress = Stress::new(bytes, reinsert);
    let slowest = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..n_threads)
            .map(|seed| {
                scope.spawn({
                    let stress = &stress;
                    move || stress.work(seed + 1)
                })
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().expect("every block held its own id")).min()
    });
    let statistics = stress.cache.statistics();
    println!("{n_threads} threads, {bytes} bytes, reinsert {reinsert:?}: slowest {slowest:?} visits, {statistics:#?}");
    (slowest.unwrap_or(0), statistics)
}

#[test]
fn every_block_holds_its_own_id_and_no_thread_is_stuck() {
    for (n_threads, bytes, reinsert) in lines() {
        let (slowest, statistics) = stress(n_threads, bytes, reinsert);
        assert!(slowest > 0 && statistics.hits > 0 && statistics.peak_bytes <= bytes as u64);
        assert_eq!(statistics.lookups, statistics.hits + statistics.private_hits + statistics.misses());
        assert_eq!(statistics.misses(), statistics.builds_kept + statistics.builds_discarded + statistics.bypasses());
    }
}
