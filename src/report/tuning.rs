//! How large the cache should be: hit rate and time against size, replayed from the trace of one render.

use super::quantity::{Bytes, Count};
use crate::cache::{CacheStatistics, Policy, Reinsert, Replay, TraceLog};
use crate::parallel::on_threads;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};
use std::sync::atomic::{AtomicUsize, Ordering};

/// How much slower than an unbounded cache the recommended one may be.
const TOLERATED_SLOWNESS: f64 = 1.05;

/// Sizes on the curve, two for each factor of two, from a little more than the working set downwards.
const N_SIZES: i32 = 18;

/// Segment counts that are compared.
const SEGMENT_COUNTS: [usize; 7] = [4, 8, 16, 32, 64, 128, 256];

/// A render that was recorded.
#[derive(Clone, Copy, Debug)]
pub struct RecordedRender<'a> {
    /// Its trace.
    pub trace: &'a TraceLog,
    /// Its counters.
    pub counters: CacheStatistics,
    /// Bytes of its cache.
    pub capacity: u64,
    /// Wall seconds of tracing.
    pub seconds: f64,
    /// Threads that traced.
    pub threads: usize,
}

/// One cache size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Bytes of the cache.
    pub cache_bytes: u64,
    /// Hits per lookup.
    pub hit_rate: f64,
    /// Wall seconds of tracing.
    pub seconds: f64,
    /// Blocks built again.
    pub rebuilds: u64,
    /// Blocks that would be built again if nothing were copied before it is recycled.
    pub rebuilds_without_reinsertion: u64,
    /// Blocks that would be built again if all blocks in use were copied before they are recycled, not only parents.
    pub rebuilds_reinserting_all: u64,
    /// Blocks that a cache that drops what was unused longest would build again.
    pub rebuilds_least_recently_used: u64,
    /// Blocks that a cache that knows the future would build again.
    pub rebuilds_belady: u64,
}

/// What `lazytess tune` tells.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuning {
    /// The path as the user gave it.
    pub input: String,
    /// Blocks that were asked for.
    pub lookups: u64,
    /// Accesses that the replays are made from.
    pub accesses_replayed: usize,
    /// The share of patches that they belong to.
    pub share_sampled: f64,
    /// Bytes of the cache that was recorded with.
    pub recorded_cache_bytes: u64,
    /// Its hit rate.
    pub recorded_hit_rate: f64,
    /// Wall seconds of tracing with it.
    pub recorded_seconds: f64,
    /// Mean seconds to build a block.
    pub build_seconds: f64,
    /// Bytes of all blocks that were asked for.
    pub working_set_bytes: u64,
    /// Predicted wall seconds with an unbounded cache.
    pub unbounded_seconds: f64,
    /// From small to large.
    pub curve: Vec<CurvePoint>,
    /// The size beyond which more memory buys less than on average.
    pub knee_bytes: u64,
    /// The smallest size with at most 5 % more time than an unbounded cache.
    pub recommended_bytes: u64,
    /// Segments that hit most at that size, and their hit rate.
    pub best_segments: (usize, f64),
}

/// Sizes that are replayed, at least: with less, what rays hold at the moment is a good part of the cache, and what
/// several threads have of it, which a replay by one thread does not know.
const LEAST_SIZE: usize = 64 << 10;

/// From hit rates to seconds.
#[derive(Clone, Copy)]
struct TimeModel {
    recorded_seconds: f64,
    /// The share of lookups for which nothing was built, what a thread remembered of its own blocks included.
    recorded_without_building: f64,
    /// Wall seconds if every lookup missed.
    all_misses_seconds: f64,
}

impl TimeModel {
    fn seconds(&self, hit_rate: f64) -> f64 {
        self.recorded_seconds + (self.recorded_without_building - hit_rate) * self.all_misses_seconds
    }
}

/// The cache as [`CacheConfig::with_bytes`](crate::cache::CacheConfig::with_bytes) makes it.
const AS_BUILT: Policy = Policy::Segments { segments: None, reinsert: Reinsert::Parents };

impl Tuning {
    /// Replays the render for many sizes, on as many threads as it had.
    pub fn new(input: String, render: &RecordedRender<'_>) -> Self {
        let replay = Replay::new(render.trace);
        let counters = &render.counters;
        let build_seconds = counters.build_time.as_secs_f64() / counters.misses().max(1) as f64;
        let time = TimeModel {
            recorded_seconds: render.seconds,
            recorded_without_building: 1.0 - counters.misses() as f64 / counters.lookups.max(1) as f64,
            all_misses_seconds: build_seconds * counters.lookups as f64 / render.threads as f64,
        };
        let working_set = replay.working_set_bytes();
        let unbounded = time.seconds(replay.run(AS_BUILT, enough_for(working_set)).hit_rate());
        let mut sizes: Vec<usize> = (0..N_SIZES).rev().map(|k| size_below(working_set, k)).collect();
        sizes.retain(|&bytes| bytes >= LEAST_SIZE);
        sizes.dedup();
        if sizes.is_empty() {
            sizes.push(LEAST_SIZE);
        }
        let curve = points(&replay, &sizes, counters.lookups, &time, render.threads);
        let recommended = smallest_within(&replay, &time, TOLERATED_SLOWNESS * unbounded, &curve).max(LEAST_SIZE);
        Self {
            input,
            lookups: counters.lookups,
            accesses_replayed: render.trace.len(),
            share_sampled: render.trace.share(),
            recorded_cache_bytes: render.capacity,
            recorded_hit_rate: counters.hit_rate(),
            recorded_seconds: render.seconds,
            build_seconds,
            working_set_bytes: working_set as u64,
            unbounded_seconds: unbounded,
            knee_bytes: knee(&curve),
            best_segments: best_segments(&replay, recommended),
            recommended_bytes: recommended as u64,
            curve,
        }
    }
}

/// A size in which everything stays, gaps and grace included.
fn enough_for(working_set: f64) -> usize {
    (2.0 * working_set) as usize + (1 << 20)
}

/// 1.5 working sets by the square root of 2 to the `k`, in whole pages.
fn size_below(working_set: f64, k: i32) -> usize {
    ((1.5 * working_set * 0.5f64.powf(0.5 * f64::from(k))) as usize).next_multiple_of(4096)
}

fn points(replay: &Replay, sizes: &[usize], lookups: u64, time: &TimeModel, threads: usize) -> Vec<CurvePoint> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some(&bytes) = sizes.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push(point(replay, bytes, lookups, time));
        }
        done
    };
    let mut points = on_threads(threads.min(sizes.len()), work).concat();
    points.sort_by_key(|p| p.cache_bytes);
    points
}

fn point(replay: &Replay, bytes: usize, lookups: u64, time: &TimeModel) -> CurvePoint {
    let rebuilds = |policy| (replay.run(policy, bytes).rebuild_rate() * lookups as f64) as u64;
    let as_built = replay.run(AS_BUILT, bytes);
    CurvePoint {
        cache_bytes: bytes as u64,
        hit_rate: as_built.hit_rate(),
        seconds: time.seconds(as_built.hit_rate()),
        rebuilds: (as_built.rebuild_rate() * lookups as f64) as u64,
        rebuilds_without_reinsertion: rebuilds(Policy::Segments { segments: None, reinsert: Reinsert::Never }),
        rebuilds_reinserting_all: rebuilds(Policy::Segments { segments: None, reinsert: Reinsert::All }),
        rebuilds_least_recently_used: rebuilds(Policy::LeastRecentlyUsed),
        rebuilds_belady: rebuilds(Policy::Belady),
    }
}

/// The smallest size that takes at most `seconds`, between the last point of the curve that takes longer and the next.
fn smallest_within(replay: &Replay, time: &TimeModel, seconds: f64, curve: &[CurvePoint]) -> usize {
    let first = curve.iter().rposition(|p| p.seconds > seconds).map_or(0, |i| i + 1);
    let Some(fits) = curve.get(first) else { return curve.last().map_or(0, |p| p.cache_bytes as usize) };
    let mut fits = fits.cache_bytes as usize;
    let mut too_small = if first == 0 { 0 } else { curve[first - 1].cache_bytes as usize };
    for _ in 0..6 {
        let middle = (too_small.midpoint(fits)).next_multiple_of(4096);
        let enough = time.seconds(replay.run(AS_BUILT, middle).hit_rate()) <= seconds;
        *(if enough { &mut fits } else { &mut too_small }) = middle;
    }
    fits
}

/// Where the curve is farthest above the line from its first to its last point, sizes by their logarithm (Satopaa et
/// al. 2011).
fn knee(curve: &[CurvePoint]) -> u64 {
    let (Some(first), Some(last)) = (curve.first(), curve.last()) else { return 0 };
    let gain = (last.hit_rate - first.hit_rate).max(f64::MIN_POSITIVE);
    let steps = (curve.len() - 1).max(1) as f64;
    let above = |i: usize| (curve[i].hit_rate - first.hit_rate) / gain - i as f64 / steps;
    let knee = (0..curve.len()).max_by(|&a, &b| above(a).total_cmp(&above(b)));
    knee.map_or(0, |i| curve[i].cache_bytes)
}

fn best_segments(replay: &Replay, bytes: usize) -> (usize, f64) {
    let rates = SEGMENT_COUNTS
        .map(|n| (n, replay.run(Policy::Segments { segments: Some(n), reinsert: Reinsert::Parents }, bytes)));
    let rates = rates.map(|(n, replayed)| (n, replayed.hit_rate()));
    rates.into_iter().rev().max_by(|a, b| a.1.total_cmp(&b.1)).expect("several counts are compared")
}

impl Display for Tuning {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let sample = if self.share_sampled < 1.0 {
            format!(" of {:.2} % of the patches", 100.0 * self.share_sampled)
        } else {
            String::new()
        };
        writeln!(
            f,
            "{}: {} lookups; replayed {} accesses{sample}",
            self.input,
            Count(self.lookups),
            Count(self.accesses_replayed as u64)
        )?;
        writeln!(
            f,
            "recorded with a cache of {}: hit rate {:.4}, {:.2} s, {:.2} us a block built\n",
            Bytes(self.recorded_cache_bytes),
            self.recorded_hit_rate,
            self.recorded_seconds,
            1e6 * self.build_seconds
        )?;
        writeln!(f, "     cache  hit rate   seconds      rebuilt   plain FIFO  keeping all          LRU       Belady")?;
        for p in &self.curve {
            let [a, b, c] = [p.rebuilds, p.rebuilds_without_reinsertion, p.rebuilds_reinserting_all];
            let [d, e] = [p.rebuilds_least_recently_used, p.rebuilds_belady];
            let size = Bytes(p.cache_bytes).to_string();
            writeln!(f, "{size:>10}  {:8.4}  {:8.2}  {a:11}  {b:11}  {c:11}  {d:11}  {e:11}", p.hit_rate, p.seconds)?;
        }
        writeln!(f, "\nworking set       {}", Bytes(self.working_set_bytes))?;
        writeln!(f, "knee              {}", Bytes(self.knee_bytes))?;
        writeln!(
            f,
            "within 5 % of     {:.2} s, the unbounded cache's time: --cache {}K",
            self.unbounded_seconds,
            self.recommended_bytes.div_ceil(1 << 10)
        )?;
        writeln!(f, "best segments     {} (hit rate {:.4} at that size)", self.best_segments.0, self.best_segments.1)
    }
}
