//! Flags that only change speed and memory: shared by every command that traces rays.

use super::SPEED;
use super::values::{ByteSize, CacheSize, count};
use clap::Args;

/// What was typed about how to run.
#[derive(Args, Clone, Debug)]
pub struct RunArgs {
    /// Memory for tessellated patches; any size works, 0 included [default: 256M]
    #[arg(long, value_name = "SIZE|unbounded", help_heading = SPEED)]
    pub cache: Option<CacheSize>,
    /// Worker threads [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = count, help_heading = SPEED)]
    pub threads: Option<u32>,
    /// No progress bar and no summary; errors and warnings are still told
    #[arg(long, short, help_heading = SPEED)]
    pub quiet: bool,
}

/// The whole memory of the program, and how the cache is sized from it.
#[derive(Args, Clone, Copy, Debug)]
pub struct MemoryArgs {
    /// Memory for everything; the cache gets what the rest leaves. Too little is refused before rendering
    #[arg(long, value_name = "SIZE", conflicts_with = "cache", help_heading = SPEED)]
    pub memory: Option<ByteSize>,
}

impl RunArgs {
    /// Cache size when neither `--cache` nor `--memory` is given.
    pub const DEFAULT_CACHE: CacheSize = CacheSize::Bytes(256 << 20);

    /// The cache's size.
    pub fn cache(&self) -> CacheSize {
        self.cache.unwrap_or(Self::DEFAULT_CACHE)
    }

    /// Number of worker threads, at least 1.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(Self::available_threads, |n| n as usize)
    }

    /// One thread for each processor that this process may use.
    pub fn available_threads() -> usize {
        std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
    }
}
