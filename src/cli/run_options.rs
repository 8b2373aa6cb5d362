//! Flags that only change speed and memory: shared by every command that traces rays.

use super::SPEED;
use super::values::{ByteSize, CacheSize, threads};
use crate::io::process::available_bytes;
use clap::Args;

/// What was typed about how to run.
#[derive(Args, Clone, Debug)]
pub struct RunArgs {
    /// Memory for tessellated patches; any size works, 0 included [default: 256M, less if the machine has less than
    /// twice that available]
    #[arg(long, value_name = "SIZE|unbounded", help_heading = SPEED)]
    pub cache: Option<CacheSize>,
    /// Worker threads [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = threads, help_heading = SPEED)]
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

/// Half of what the machine has available is left to meshes and to other programs.
fn default_cache(available: Option<u64>) -> CacheSize {
    CacheSize::Bytes(available.map_or(RunArgs::DEFAULT_CACHE_BYTES, |n| (n / 2).min(RunArgs::DEFAULT_CACHE_BYTES)))
}

impl RunArgs {
    /// Bytes of the cache when neither `--cache` nor `--memory` is given and the machine has enough.
    pub const DEFAULT_CACHE_BYTES: u64 = 256 << 20;

    /// The cache's size.
    pub fn cache(&self) -> CacheSize {
        self.cache.unwrap_or_else(|| default_cache(available_bytes()))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_cache_shrinks_with_the_machine() {
        assert_eq!(default_cache(None), CacheSize::Bytes(256 << 20));
        assert_eq!(default_cache(Some(8 << 30)), CacheSize::Bytes(256 << 20));
        assert_eq!(default_cache(Some(100 << 20)), CacheSize::Bytes(50 << 20));
    }
}
