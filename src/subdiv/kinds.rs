//! Which faces have equal rings, and so share a plan: found on all threads, before any plan is made.
//!
//! Most irregular faces are quads without any tag at their corners. The sizes of the faces around each corner, the corner's
//! **fan**, tell all about their rings. Others are told apart by the keys of their rings.

use super::draft::Draft;
use super::edits::EditSites;
use super::local::{LocalMesh, RingWalker, turn_of_fans};
use super::numbering::Numbering;
use super::plan::{NodeId, PlanLibrary};
use super::rules::RuleSet;
use super::surface::{EDITED, REGULAR};
use crate::ids::FaceId;
use crate::parallel::{for_each, on_threads};
use crate::topology::{HalfEdges, NONE, Topology};
use parking_lot::Mutex;
use rustc_hash::FxHashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Faces that a thread sorts before it asks for more.
const FACES_PER_TASK: usize = 512;

/// The sizes of the faces around a corner but the corner's own, counter-clockwise: 3 less in two bits each, below a bit that
/// is set.
type Fan = u64;

/// The fan of four quads.
const REGULAR_FAN: Fan = 0b1_01_01_01;

/// The largest face that is told of in a fan, and the number of faces at most.
const MOST_CORNERS: u32 = 6;
const MOST_FACES: u32 = 31;

/// Kinds that are drafted before their nodes are made: drafts take more memory than nodes.
const KINDS_PER_BATCH: usize = 1024;

/// Kinds for which another thread is worth its start.
const LEAST_KINDS: usize = 16;

/// The kinds of face that a thread has met.
#[derive(Default)]
struct Kinds {
    by_fans: FxHashMap<[Fan; 4], u32>,
    /// By the key of the ring, and by how many steps the ring is sharper.
    by_key: FxHashMap<Vec<u32>, u32>,
    /// Where the ring of the first face of each kind starts.
    examples: Vec<u32>,
    walker: RingWalker,
    numbering: Numbering,
    key: Vec<u32>,
}

/// What tells a ring from others.
#[derive(PartialEq, Eq, Hash)]
enum Ring<'a> {
    Fans(&'a [Fan; 4]),
    Key(&'a [u32]),
}

/// Faces that follow each other. Of those that have one, the kind is in the place of the plan, as a node's number would be.
struct Task<'a> {
    first: usize,
    plans: &'a mut [NodeId],
    /// Whose [`Kinds`] they are.
    thread: usize,
}

/// The plan of every visible face.
pub(super) fn plan_faces(
    topology: &Topology,
    rules: RuleSet,
    n_threads: usize,
    sites: &EditSites,
) -> (PlanLibrary, Vec<NodeId>) {
    let mut library = PlanLibrary::new(rules);
    let mut plans = vec![REGULAR; topology.n_faces()];
    let chunks = plans.chunks_mut(FACES_PER_TASK).enumerate();
    let tasks: Vec<_> =
        chunks.map(|(i, plans)| Mutex::new(Task { first: i * FACES_PER_TASK, plans, thread: 0 })).collect();
    let sorter = Sorter { topology, rules, sites, valences: &valences(topology) };
    let of_threads = sort_faces(&sorter, n_threads, &tasks);
    let nodes = plan_kinds(topology, &mut library, &of_threads, n_threads);
    for_each(&tasks, n_threads, |_, task| {
        let Task { plans, thread, .. } = &mut *task.lock();
        for plan in plans.iter_mut().filter(|plan| ![REGULAR, EDITED].contains(plan)) {
            *plan = nodes[*thread][(plan.0 >> 2) as usize].turned(plan.turn());
        }
    });
    drop(tasks);
    (library, plans)
}

/// What faces are sorted by.
struct Sorter<'a> {
    topology: &'a Topology,
    rules: RuleSet,
    sites: &'a EditSites,
    /// See [`valences`].
    valences: &'a [u8],
}

/// Finds the kind of each face; returns the kinds of each thread.
fn sort_faces(sorter: &Sorter<'_>, n_threads: usize, tasks: &[Mutex<Task<'_>>]) -> Vec<Kinds> {
    let next = AtomicUsize::new(0);
    let of_threads = Mutex::new(Vec::new());
    on_threads(n_threads.min(tasks.len()), || {
        let mut kinds = Kinds::default();
        let thread = {
            let mut of_threads = of_threads.lock();
            of_threads.push(Kinds::default());
            of_threads.len() - 1
        };
        while let Some(task) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
            let task = &mut *task.lock();
            task.thread = thread;
            for (face, plan) in (task.first..).map(FaceId::from).zip(task.plans.iter_mut()) {
                *plan = if sorter.sites.contains(face) { EDITED } else { kinds.find(sorter, face) };
            }
        }
        of_threads.lock()[thread] = kinds;
    });
    of_threads.into_inner()
}

/// The node of each kind of each thread. Nodes are made in the order of faces, whichever thread met them.
fn plan_kinds(
    topology: &Topology,
    library: &mut PlanLibrary,
    of_threads: &[Kinds],
    n_threads: usize,
) -> Vec<Vec<NodeId>> {
    let (kinds, examples) = joined(of_threads);
    let nodes: Vec<NodeId> =
        examples.chunks(KINDS_PER_BATCH).flat_map(|starts| plan_batch(topology, library, starts, n_threads)).collect();
    kinds.iter().map(|kinds| kinds.iter().map(|&kind| nodes[kind]).collect()).collect()
}

/// Numbers for the kinds of all threads, and where the ring of the first face of each starts.
fn joined(of_threads: &[Kinds]) -> (Vec<Vec<usize>>, Vec<u32>) {
    let mut numbers: Vec<Vec<usize>> = of_threads.iter().map(|kinds| vec![0; kinds.examples.len()]).collect();
    let mut all: Vec<(usize, u32, Ring<'_>)> = Vec::new();
    for (thread, kinds) in of_threads.iter().enumerate() {
        all.extend(kinds.by_fans.iter().map(|(fans, &kind)| (thread, kind, Ring::Fans(fans))));
        all.extend(kinds.by_key.iter().map(|(key, &kind)| (thread, kind, Ring::Key(key))));
    }
    all.sort_unstable_by_key(|&(thread, kind, _)| of_threads[thread].examples[kind as usize]);
    let (mut known, mut examples) = (FxHashMap::default(), Vec::new());
    for (thread, kind, ring) in all {
        numbers[thread][kind as usize] = *known.entry(ring).or_insert_with(|| {
            examples.push(of_threads[thread].examples[kind as usize]);
            examples.len() - 1
        });
    }
    (numbers, examples)
}

/// The nodes of the rings that start at these half-edges. All threads make drafts, one after the other becomes a node.
fn plan_batch(topology: &Topology, library: &mut PlanLibrary, starts: &[u32], n_threads: usize) -> Vec<NodeId> {
    let (rules, next) = (library.rules(), AtomicUsize::new(0));
    let drafts: Vec<Mutex<Option<(LocalMesh, Draft)>>> = starts.iter().map(|_| Mutex::default()).collect();
    on_threads(n_threads.min(starts.len().div_ceil(LEAST_KINDS)), || {
        let (mut walker, mut of_quarters) = (RingWalker::default(), RingWalker::default());
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(&start) = starts.get(i) else { break };
            let ring = walker.extract(topology, start, rules.keeps_outer_tags()).mesh.clone();
            let draft = Draft::new(rules, &ring, false, &mut of_quarters);
            *drafts[i].lock() = Some((ring, draft));
        }
    });
    let drafts = drafts.into_iter().map(|draft| draft.into_inner().expect("every kind was drafted"));
    drafts.map(|(ring, draft)| library.drafted_node(ring, Some(draft))).collect()
}

impl Kinds {
    /// The kind and the turn of a face, as of a node.
    fn find(&mut self, sorter: &Sorter<'_>, face: FaceId) -> NodeId {
        let topology = sorter.topology;
        if topology.is_hidden(face) {
            return REGULAR;
        }
        let (first, n) = topology.face_corners(face.0);
        let fans = if n == 4 { sorter.fans(first) } else { None };
        match fans {
            Some([REGULAR_FAN, REGULAR_FAN, REGULAR_FAN, REGULAR_FAN]) => REGULAR,
            Some(fans) if is_spread_out(topology, first, &mut self.numbering) => self.by_fans(first, fans),
            _ => self.by_key(topology, sorter.rules, first),
        }
    }

    fn by_fans(&mut self, first: u32, mut fans: [Fan; 4]) -> NodeId {
        let turn = turn_of_fans(fans.map(sizes));
        fans.rotate_left(turn as usize);
        let examples = &mut self.examples;
        let kind = *self.by_fans.entry(fans).or_insert_with(|| {
            examples.push(first + turn);
            examples.len() as u32 - 1
        });
        NodeId(kind << 2 | turn)
    }

    fn by_key(&mut self, topology: &Topology, rules: RuleSet, first: u32) -> NodeId {
        let look = self.walker.look(topology, first);
        if look.is_regular {
            return REGULAR;
        }
        let (start, outer_tags) = (first + look.turn, rules.keeps_outer_tags());
        let (steps, _) = self.walker.key(topology, start, look, outer_tags, rules.lowers(), &mut self.key);
        self.key.push(steps);
        let known = self.by_key.get(&self.key).copied();
        let kind = known.unwrap_or_else(|| {
            let kind = self.examples.len() as u32;
            self.by_key.insert(self.key.clone(), kind);
            self.examples.push(start);
            kind
        });
        NodeId(kind << 2 | look.turn)
    }
}

/// The numbers of edges at vertices that have quads only around them and no tag, from 3 to [`MOST_FACES`]; 0 for others.
fn valences(topology: &Topology) -> Vec<u8> {
    let mut valences = vec![0u8; topology.n_vertices()];
    for face in 0..topology.n_faces() as u32 {
        let (first, n) = topology.face_corners(face);
        for h in first..first + n {
            let v = topology.vertex(h) as usize;
            let is_other = n != 4 || topology.twin(h) == NONE || topology.is_tagged(v as u32);
            valences[v] = if is_other { u8::MAX } else { valences[v].saturating_add(1) };
        }
    }
    let in_range = 3..=MOST_FACES as u8;
    valences.iter_mut().filter(|n| !in_range.contains(n)).for_each(|n| *n = 0);
    valences
}

impl Sorter<'_> {
    /// The fans of a quad, if they are closed, of three faces or more, and without tags.
    fn fans(&self, first: u32) -> Option<[Fan; 4]> {
        let mut fans = [0; 4];
        for (h, fan) in (first..).zip(&mut fans) {
            *fan = match self.valences[self.topology.vertex(h) as usize] {
                0 => fan_at(self.topology, h)?,
                n => fan_of_quads(n),
            };
        }
        Some(fans)
    }
}

fn fan_of_quads(n: u8) -> Fan {
    const MOST: Fan = 0x5555_5555_5555_5555;
    let below = (1 << (2 * (n - 1))) - 1;
    1 << (2 * (n - 1)) | MOST & below
}

/// The fan of a corner, if it is closed, of three faces or more, and without tags.
fn fan_at(topology: &Topology, h: u32) -> Option<Fan> {
    if !topology.is_plain(h) {
        return None;
    }
    let (mut fan, mut n) = (1, 1);
    let mut spoke = turned(topology, h);
    while spoke != h {
        if spoke == NONE || n == MOST_FACES {
            return None;
        }
        let (_, size) = topology.corners_at(spoke);
        if size > MOST_CORNERS {
            return None;
        }
        fan = fan << 2 | Fan::from(size - 3);
        n += 1;
        spoke = turned(topology, spoke);
    }
    (n > 2).then_some(fan)
}

/// The sizes of a fan's faces.
fn sizes(fan: Fan) -> impl Iterator<Item = u32> {
    let n = fan.ilog2() / 2;
    (0..n).rev().map(move |i| 3 + (fan >> (2 * i) & 3) as u32)
}

/// The half-edge that follows `spoke` counter-clockwise around the vertex where it starts.
#[inline(always)]
fn turned(topology: &Topology, spoke: u32) -> u32 {
    topology.twin(topology.prev(spoke))
}

/// Whether all vertices of the ring of a quad with [`fans`] are different ones, but for those that faces side by side share.
fn is_spread_out(topology: &Topology, first: u32, vertices: &mut Numbering) -> bool {
    vertices.clear();
    let mut is_new = |h: u32| vertices.number(topology.vertex(h)).1;
    (first..first + 4).all(|h| {
        let beside = turned(topology, h);
        // The two faces beside the edges of the quad have vertices in common with the fans of the next corners: of each, the
        // end of the edge from the corner is counted where that follows counter-clockwise, and in a triangle there only.
        let mut is_counted = topology.corners_at(beside).1 == 3;
        let mut spoke = turned(topology, beside);
        let mut are_new = is_new(h);
        while are_new && spoke != h {
            let end = topology.next(spoke);
            are_new = is_counted || is_new(end);
            is_counted = false;
            let next = turned(topology, spoke);
            let n_shared = if next == h { 4 } else { 3 };
            let mut inner = end;
            for _ in n_shared..topology.corners_at(spoke).1 {
                inner = topology.next(inner);
                are_new = are_new && is_new(inner);
            }
            spoke = next;
        }
        are_new
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes;

    #[test]
    fn faces_are_of_one_kind_if_their_rings_are_equal() {
        let mut n_by_fans = 0;
        for mesh in shapes::all().into_iter().map(|(_, mesh)| mesh).chain((0..100).map(random_mesh)) {
            let topology = Topology::new(&mesh, 1);
            let rules = RuleSet { crease_method: mesh.crease_method, triangles: mesh.triangles };
            let sites = EditSites::new(&[], &topology);
            let (_, plans) = plan_faces(&topology, rules, 3, &sites);
            let sorter = Sorter { topology: &topology, rules, sites: &sites, valences: &valences(&topology) };
            let (mut library, mut walker) = (PlanLibrary::new(rules), RingWalker::default());
            let mut of_node = FxHashMap::default();
            for (face, plan) in plans.iter().enumerate() {
                let first = topology.face_corners(face as u32).0;
                let look = walker.look(&topology, first);
                assert_eq!(*plan == REGULAR, look.is_regular || topology.is_hidden(FaceId::from(face)));
                if *plan == REGULAR {
                    continue;
                }
                assert_eq!(plan.turn(), look.turn);
                let node = library.node(&walker.extract(&topology, first + look.turn, rules.keeps_outer_tags()).mesh);
                assert_eq!(*of_node.entry(node).or_insert(plan.turned(4 - look.turn)), plan.turned(4 - look.turn));
                if topology.corners_at(first).1 == 4 {
                    let by_walking: Option<Vec<Fan>> = (first..first + 4).map(|h| fan_at(&topology, h)).collect();
                    n_by_fans += u32::from(by_walking.is_some());
                    assert_eq!(sorter.fans(first).map(Vec::from), by_walking);
                }
            }
        }
        assert!(n_by_fans > 100, "{n_by_fans} faces have fans");
    }
}
