//! Which half-edges lie along the same edge: sorted by their smaller vertex, then paired vertex by vertex, on all
//! threads.

use super::Topology;
use super::half_edges::{HalfEdges, NONE};
use crate::parallel::for_ranges;
use parking_lot::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

/// For each vertex, the half-edges whose smaller end it is, in no particular order.
pub(super) struct HalfEdgesByVertex {
    start: Vec<u32>,
    half_edges: Vec<u32>,
}

/// Half-edges between two vertices that do not form one sound edge: `(larger vertex, half-edge)`, ascending.
pub(super) type Tangle = Vec<(u32, u32)>;

impl HalfEdgesByVertex {
    pub(super) fn new(topology: &Topology, n_threads: usize) -> Self {
        let n_half_edges = topology.n_half_edges();
        let start = atomics(topology.n_vertices() + 2, 0);
        for_ranges(n_half_edges, n_threads, |range| {
            for h in range {
                start[ends(topology, h as u32).0 as usize + 2].fetch_add(1, Ordering::Relaxed);
            }
        });
        let mut start = plain(start);
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let cursors: Vec<AtomicU32> = start.into_iter().map(AtomicU32::new).collect();
        let half_edges = atomics(n_half_edges, 0);
        for_ranges(n_half_edges, n_threads, |range| {
            for h in range {
                let place = cursors[ends(topology, h as u32).0 as usize + 1].fetch_add(1, Ordering::Relaxed);
                half_edges[place as usize].store(h as u32, Ordering::Relaxed);
            }
        });
        Self { start: plain(cursors), half_edges: plain(half_edges) }
    }

    pub(super) fn lower(&self, v: u32) -> &[u32] {
        &self.half_edges[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }

    /// The twin of every half-edge that has one, and what cannot be paired, ascending by vertices.
    pub(super) fn pair(&self, topology: &Topology, n_threads: usize) -> (Vec<u32>, Vec<Tangle>) {
        let twin = atomics(topology.n_half_edges(), NONE);
        let tangles = Mutex::new(Vec::new());
        for_ranges(topology.n_vertices(), n_threads, |range| {
            let mut spokes = Vec::new();
            for v in range {
                self.pair_at(topology, v as u32, &mut spokes, &twin, |tangle| {
                    tangles.lock().push((v, tangle.to_vec()))
                });
            }
        });
        let mut tangles = tangles.into_inner();
        tangles.sort_unstable_by_key(|(v, tangle): &(usize, Tangle)| (*v, tangle[0]));
        (plain(twin), tangles.into_iter().map(|(_, tangle)| tangle).collect())
    }

    /// Pairs the half-edges whose smaller end is `v`. `spokes` is scratch.
    fn pair_at(
        &self,
        topology: &Topology,
        v: u32,
        spokes: &mut Vec<(u32, u32)>,
        twin: &[AtomicU32],
        tangle: impl Fn(&[(u32, u32)]),
    ) {
        spokes.clear();
        spokes.extend(self.lower(v).iter().map(|&h| (ends(topology, h).1, h)));
        spokes.sort_unstable();
        for edge in spokes.chunk_by(|a, b| a.0 == b.0) {
            match *edge {
                [(w, _)] if w != v => {}
                [(w, a), (_, b)] if w != v && can_be_twins(topology, a, b) => {
                    twin[a as usize].store(b, Ordering::Relaxed);
                    twin[b as usize].store(a, Ordering::Relaxed);
                }
                _ => tangle(edge),
            }
        }
    }
}

/// The smaller and the larger vertex of a half-edge.
pub(super) fn ends(topology: &Topology, h: u32) -> (u32, u32) {
    let (a, b) = (topology.vertex(h), topology.vertex(topology.next(h)));
    (a.min(b), a.max(b))
}

fn can_be_twins(topology: &Topology, a: u32, b: u32) -> bool {
    topology.vertex(a) != topology.vertex(b) && topology.face(a) != topology.face(b)
}

/// Numbers that several threads may write. The ends of the threads order what they wrote before what comes after.
fn atomics(n: usize, value: u32) -> Vec<AtomicU32> {
    (0..n).map(|_| AtomicU32::new(value)).collect()
}

/// In place: the same memory.
fn plain(numbers: Vec<AtomicU32>) -> Vec<u32> {
    numbers.into_iter().map(AtomicU32::into_inner).collect()
}
