//! Loops shared out among threads. Threads live as long as the loop.

use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::ScopedJoinHandle;

/// Items that one thread takes before it asks for more.
pub const ITEMS_PER_TASK: usize = 4096;

/// Calls `work` with ranges that together are `0..n`, each starting at a multiple of [`ITEMS_PER_TASK`], on at most
/// `n_threads` threads, the caller's own among them.
pub fn for_ranges(n: usize, n_threads: usize, work: impl Fn(Range<usize>) + Sync) {
    let next = AtomicUsize::new(0);
    let worker = || loop {
        let start = next.fetch_add(ITEMS_PER_TASK, Ordering::Relaxed);
        if start >= n {
            break;
        }
        work(start..(start + ITEMS_PER_TASK).min(n));
    };
    on_threads(n_threads.min(n.div_ceil(ITEMS_PER_TASK)), worker);
}

/// Calls `work` with every item and its index, in no particular order, on at most `n_threads` threads.
pub fn for_each<T: Sync>(items: &[T], n_threads: usize, work: impl Fn(usize, &T) + Sync) {
    let next = AtomicUsize::new(0);
    let worker = || loop {
        let i = next.fetch_add(1, Ordering::Relaxed);
        let Some(item) = items.get(i) else { break };
        work(i, item);
    };
    on_threads(n_threads.min(items.len()), worker);
}

/// Runs `worker` on `n_threads` threads, the caller's own among them; returns what they return. Where the system
/// refuses a thread there are fewer: a worker takes work until there is none.
pub fn on_threads<R: Send>(n_threads: usize, worker: impl Fn() -> R + Sync) -> Vec<R> {
    std::thread::scope(|scope| {
        let spawn = |_| std::thread::Builder::new().spawn_scoped(scope, &worker).ok();
        let others: Vec<_> = (1..n_threads).map_while(spawn).collect();
        let own = worker();
        let join = |other: ScopedJoinHandle<'_, R>| other.join().unwrap_or_else(|panic| resume_unwind(panic));
        std::iter::once(own).chain(others.into_iter().map(join)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicU32;

    #[test]
    fn every_item_is_met_once() {
        for (n, n_threads) in [(0, 3), (1, 3), (ITEMS_PER_TASK, 1), (3 * ITEMS_PER_TASK + 17, 4)] {
            let met: Vec<AtomicU32> = (0..n).map(|_| AtomicU32::new(0)).collect();
            for_ranges(n, n_threads, |range| {
                assert!(range.start.is_multiple_of(ITEMS_PER_TASK) && !range.is_empty());
                for i in range {
                    met[i].fetch_add(1, Ordering::Relaxed);
                }
            });
            for_each(&met, n_threads, |i, m| {
                assert!(std::ptr::eq(m, &met[i]) && m.fetch_add(1, Ordering::Relaxed) == 1)
            });
            assert!(met.iter().all(|m| m.load(Ordering::Relaxed) == 2));
        }
    }
}
