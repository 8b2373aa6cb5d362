//! Readers for the reference data in `../shared`, for tests that run only where it is.
#![allow(dead_code)]

pub mod brute_force;
pub mod embree;
pub mod limit_table;
pub mod random;
pub mod traced;

use std::path::PathBuf;

/// The folder `relative` of the shared data, or a visible note that the test is skipped.
pub fn shared(relative: &str) -> Option<PathBuf> {
    let root = std::env::var_os("LAZYTESS_SHARED").map(PathBuf::from);
    let root = root.unwrap_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared")));
    let folder = root.join(relative);
    if folder.exists() {
        return Some(folder);
    }
    println!("skipped: {} is not there", folder.display());
    None
}
