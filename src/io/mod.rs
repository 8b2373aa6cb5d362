//! The only module that opens files.
//!
//! Readers turn bytes that nobody vouches for into checked plain data, or into one sentence that names the file, the
//! line, what is wrong and what to do. Writers put a file in place whole or not at all.
//!
//! # Invariants
//! 1. No sequence of bytes makes a reader panic, hang, or allocate more than a small multiple of the file's size.
//! 2. A file under its final name is complete: it was written under a temporary name beside it and then renamed.

pub mod exr;
pub mod obj;
pub mod obj_write;
pub mod picture;
pub mod png;
pub mod process;
pub mod samples;
pub mod scene_file;
pub mod write;
