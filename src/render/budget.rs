//! One budget for the whole process: what is resident before tracing, what tracing needs besides the cache, and the
//! cache, which gets the rest.
//!
//! ```text
//!   budget ┌──────────────────────────┬───────┬──────┬─────────┬───────────────────────────────┐
//!          │ resident: program, meshes│ slots │ film │ workers │ cache                         │
//!          └──────────────────────────┴───────┴──────┴─────────┴───────────────────────────────┘
//!            measured                   exact   exact  allowed    at least what writing the picture needs,
//!                                                                 because the cache is gone by then
//! ```

use super::adaptive::canvas_window;
use super::canvas::Canvas;
use super::cells::Tile;
use super::film::Film;
use super::footprint::Footprints;
use super::settings::{Groups, RenderSettings};
use crate::cache::SegmentCache;
use crate::error::{Error, ErrorKind, Result};
use std::fmt;

/// Bytes that a worker may touch besides the cache: its stack, the scratch for blocks that are used once, evaluators,
/// the pieces of a patch that is left, a tile of pixels, and what the allocator keeps for it.
pub const WORKER_BYTES: usize = SegmentCache::SCRATCH_BYTES + (768 << 10);

/// Bytes that a worker may touch for each point of the largest ring of a face, beyond those of [`ORDINARY_RING`]: of 16
/// patches, for building and for shading, the points of all levels are remembered. (With a polygon of 1000 sides, whose
/// ring has some 2000 points, a second thread took 41 MiB more: 21 KiB for each. Two further ones took 15 each.)
const BYTES_PER_RING_POINT: usize = 24 << 10;

/// Points of a ring that a worker has room for anyway.
const ORDINARY_RING: usize = 64;

/// Side of the tiles of which the encoder of EXR files takes one at a time. That of PNG files takes a row.
const WRITTEN_SIDE: u32 = 256;

/// Forms of its pixels that are there at the same time: 4 times their bytes were allocated with all AOVs, 3 without.
const FORMS_OF_WRITTEN: u64 = 4;

/// Bytes for everything too small to be counted: progress bar, statistics, code that was not run yet.
const ODDS_AND_ENDS: u64 = 2 << 20;

/// What a render holds, in bytes. The sum of all but `writing` stays from the first to the last ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderNeeds {
    /// What is resident before tracing begins.
    pub resident: u64,
    /// Slots of the cache.
    pub tables: u64,
    /// The film.
    pub film: u64,
    /// All workers.
    pub workers: u64,
    /// What groups of pixels need to know before the first ray.
    pub groups: u64,
    /// What writing the picture takes once the cache is gone.
    pub writing: u64,
}

impl RenderNeeds {
    /// The needs of a render on `threads` threads, of a world that needs `tables` bytes of slots and whose largest ring
    /// has so many points, when `resident` bytes are resident.
    pub fn new(resident: u64, tables: usize, largest_ring: usize, settings: &RenderSettings, threads: usize) -> Self {
        let film = Film::n_bytes(settings.window, &settings.aovs) as u64;
        let of_rings = BYTES_PER_RING_POINT * largest_ring.saturating_sub(ORDINARY_RING);
        let workers = ((WORKER_BYTES + of_rings) * threads) as u64;
        let groups = group_bytes(settings, threads) as u64;
        let window = settings.window;
        let tile = [window.width(), window.height()].map(|side| u64::from(side.min(WRITTEN_SIDE)));
        let writing = FORMS_OF_WRITTEN * film.div_ceil((window.n_pixels() as u64).max(1)) * tile[0] * tile[1];
        Self { resident, tables: tables as u64, film, workers, groups, writing }
    }

    fn without_cache(&self) -> u64 {
        self.resident + self.tables + self.film + self.workers + self.groups + ODDS_AND_ENDS
    }

    /// The smallest budget that will do.
    pub fn smallest_budget(&self) -> u64 {
        self.without_cache() + self.writing
    }

    /// Bytes that `budget` leaves for the cache.
    ///
    /// # Errors
    /// If the budget is too small; the message names the smallest that would do.
    pub fn cache_bytes(&self, budget: u64) -> Result<u64> {
        if budget < self.smallest_budget() {
            return Err(too_small(budget, self.smallest_budget(), self));
        }
        Ok(budget - self.without_cache())
    }
}

impl fmt::Display for RenderNeeds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [resident, tables, film, workers] = [self.resident, self.tables, self.film, self.workers].map(mebibytes);
        write!(f, "program and meshes {resident}M, slots {tables}M, film {film}M, workers {workers}M")?;
        if self.groups > 0 { write!(f, ", groups {}M", mebibytes(self.groups)) } else { Ok(()) }
    }
}

/// Bytes that the settings' way of grouping takes at most.
fn group_bytes(settings: &RenderSettings, threads: usize) -> usize {
    match settings.groups {
        Groups::Off => 0,
        Groups::Thesis => super::thesis::max_bytes(settings),
        Groups::Adaptive => threads * (Footprints::BYTES + Tile::BYTES) + canvas_bytes(settings),
    }
}

/// Bytes of the canvas of adaptive groups, besides those of the film. Where it is larger than the film, this is cut out
/// of it while both are there.
fn canvas_bytes(settings: &RenderSettings) -> usize {
    let canvas = Canvas::n_bytes(canvas_window(settings), &settings.aovs);
    if canvas_window(settings) == settings.window {
        return canvas - Film::n_bytes(settings.window, &settings.aovs);
    }
    canvas
}

/// The error of a budget below `smallest`, which is needed for `what`. Names a little more, because what is resident
/// differs from run to run.
fn too_small(budget: u64, smallest: u64, what: impl fmt::Display) -> Error {
    let (given, smallest) = (mebibytes(budget), mebibytes(with_margin(smallest)));
    let message = format!("--memory {given}M is too little; {smallest}M would do ({what}, cache as much as is left)");
    Error::new(ErrorKind::Budget, message)
}

/// The refusal of a budget before all is known that will be needed: `least` bytes for `what`.
pub fn too_small_for(what: &str, budget: u64, least: u64) -> Error {
    let (given, least) = (mebibytes(budget), mebibytes(with_margin(least)));
    Error::new(ErrorKind::Budget, format!("--memory {given}M is too little; {least}M or so are needed to {what}"))
}

fn with_margin(bytes: u64) -> u64 {
    bytes + bytes / 32 + (1 << 20)
}

/// Rounded up.
fn mebibytes(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_budget_named_is_accepted_and_one_less_refused() {
        let needs = RenderNeeds::new(50 << 20, 1 << 20, 30, &RenderSettings::of_size([100, 100]), 2);
        let refusal = needs.cache_bytes(10 << 20).unwrap_err();
        assert!(refusal.to_string().contains("M would do (program and meshes 50M, slots 1M"), "{refusal}");
        let smallest = needs.smallest_budget();
        assert!(needs.cache_bytes(smallest).unwrap() >= needs.writing);
        assert!(needs.cache_bytes(smallest - 1).is_err());
    }
}
