//! The cache as one would write it without caring for speed: a lock and a queue. Tests run on both.

use std::collections::{HashMap, VecDeque};
use std::sync::Mutex;

/// What every cache of blocks can do. A path leads from a root slot over child numbers to a block.
pub(super) trait BlockCache: Sync {
    /// The bytes of the block at the end of a path, built with `build` if they are missing, and so are all blocks on
    /// the way: one visit. `build` gets the part of the path so far.
    fn fetch(&self, path: &[u32], build: &mut dyn FnMut(&[u32]) -> Vec<u8>) -> Vec<u8>;

    /// Bytes of blocks held at present, or the most that could be.
    fn bytes_bound(&self) -> usize;
}

/// First in, first out, by whole paths.
pub(super) struct MutexCache {
    capacity: usize,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    blocks: HashMap<Vec<u32>, Vec<u8>>,
    order: VecDeque<Vec<u32>>,
    bytes: usize,
}

impl MutexCache {
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, state: Mutex::default() }
    }
}

impl BlockCache for MutexCache {
    fn fetch(&self, path: &[u32], build: &mut dyn FnMut(&[u32]) -> Vec<u8>) -> Vec<u8> {
        let mut state = self.state.lock().unwrap();
        let mut found = Vec::new();
        for end in 1..=path.len() {
            found = state.get_or_build(&path[..end], self.capacity, build);
        }
        found
    }

    fn bytes_bound(&self) -> usize {
        self.state.lock().unwrap().bytes
    }
}

impl State {
    fn get_or_build(&mut self, path: &[u32], capacity: usize, build: &mut dyn FnMut(&[u32]) -> Vec<u8>) -> Vec<u8> {
        if let Some(bytes) = self.blocks.get(path) {
            return bytes.clone();
        }
        let bytes = build(path);
        while self.bytes + bytes.len() > capacity {
            let Some(oldest) = self.order.pop_front() else { return bytes };
            self.bytes -= self.blocks.remove(&oldest).map_or(0, |bytes| bytes.len());
        }
        self.bytes += bytes.len();
        self.blocks.insert(path.to_owned(), bytes.clone());
        self.order.push_back(path.to_owned());
        bytes
    }
}
