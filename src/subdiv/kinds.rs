//! Which faces have equal rings, and so share a plan: found on all threads, before any plan is made.
//!
//! The rings of most irregular faces are told apart by the [fans](super::fans) at their corners, others by their keys.

use super::draft::Draft;
use super::edits::EditSites;
use super::fans::{Fan, Fans, REGULAR_FAN, is_spread_out, sizes};
use super::local::{LocalMesh, RingWalker, turn_of_fans};
use super::numbering::Numbering;
use super::plan::{NodeId, PlanLibrary};
use super::rules::RuleSet;
use super::surface::{EDITED, REGULAR};
use crate::error::{Error, Result};
use crate::ids::FaceId;
use crate::parallel::{for_each, on_threads};
use crate::topology::{HalfEdges, Topology};
use parking_lot::Mutex;
use rustc_hash::FxHashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Faces that a thread sorts before it asks for more.
const FACES_PER_TASK: usize = 512;

/// Kinds that are drafted before their nodes are made: drafts take more memory than nodes.
const KINDS_PER_BATCH: usize = 1024;

/// The same, by the squares of how many corners their faces have.
const CORNERS_PER_BATCH: usize = 1 << 20;

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

/// Faces that follow each other. Of those that have one, the kind is in the place of the plan, as a node's number would
/// be.
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
    planned: &dyn Fn(f64) -> Result<()>,
) -> Result<(PlanLibrary, Vec<NodeId>)> {
    let mut library = PlanLibrary::new(rules);
    let mut plans = vec![REGULAR; topology.n_faces()];
    let chunks = plans.chunks_mut(FACES_PER_TASK).enumerate();
    let tasks: Vec<_> =
        chunks.map(|(i, plans)| Mutex::new(Task { first: i * FACES_PER_TASK, plans, thread: 0 })).collect();
    let sorter = Sorter { topology, rules, sites, fans: Fans::new(topology) };
    let of_threads = sort_faces(&sorter, n_threads, &tasks);
    let nodes = plan_kinds(topology, &mut library, of_threads, n_threads, planned)?;
    for_each(&tasks, n_threads, |_, task| {
        let Task { plans, thread, .. } = &mut *task.lock();
        for plan in plans.iter_mut().filter(|plan| ![REGULAR, EDITED].contains(plan)) {
            *plan = nodes[*thread][(plan.0 >> 2) as usize].turned(plan.turn());
        }
    });
    drop(tasks);
    Ok((library, plans))
}

/// What faces are sorted by.
struct Sorter<'a> {
    topology: &'a Topology,
    rules: RuleSet,
    sites: &'a EditSites,
    fans: Fans<'a>,
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
    of_threads: Vec<Kinds>,
    n_threads: usize,
    planned: &dyn Fn(f64) -> Result<()>,
) -> Result<Vec<Vec<NodeId>>> {
    let (kinds, examples) = joined(&of_threads);
    // Keys of irregular meshes are many, and the library has its own.
    drop(of_threads);
    let mut nodes: Vec<NodeId> = Vec::with_capacity(examples.len());
    while nodes.len() < examples.len() {
        let rest = &examples[nodes.len()..];
        nodes.extend(plan_batch(topology, library, &rest[..batch_len(topology, rest)], n_threads));
        if library.is_nearly_full() {
            return Err(Error::input("the mesh has more neighbourhoods that differ than can be numbered: split it"));
        }
        planned(nodes.len() as f64 / examples.len() as f64)?;
    }
    Ok(kinds.iter().map(|kinds| kinds.iter().map(|&kind| nodes[kind]).collect()).collect())
}

/// Of rings that start there, how many are drafted at once: at least one.
fn batch_len(topology: &Topology, starts: &[u32]) -> usize {
    // A draft has as many quarters as its face has corners, and each the points of all of them.
    let size = |&start: &u32| topology.corners_at(start).1.pow(2) as usize;
    let sums = starts.iter().map(size).scan(0, |sum, size| {
        *sum += size;
        Some(*sum)
    });
    sums.take(KINDS_PER_BATCH).take_while(|&sum| sum <= CORNERS_PER_BATCH).count().max(1)
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

/// The nodes of the rings that start at these half-edges. One thread puts drafts into the library, in their order; the
/// others make them, and it helps while the next one is not there.
fn plan_batch(topology: &Topology, library: &mut PlanLibrary, starts: &[u32], n_threads: usize) -> Vec<NodeId> {
    let drafts = Drafts::new(topology, library.rules(), starts);
    let n_helpers = n_threads.min(starts.len().div_ceil(LEAST_KINDS)).saturating_sub(1);
    std::thread::scope(|scope| {
        let help = || {
            let mut walkers = Default::default();
            while drafts.make_next(&mut walkers) {}
        };
        let spawn = |_| std::thread::Builder::new().spawn_scoped(scope, help).ok();
        let helpers: Vec<_> = (0..n_helpers).map_while(spawn).collect();
        let mut walkers = Default::default();
        let made = drafts.made.iter().map(|draft| {
            loop {
                let has_help = helpers.iter().any(|helper| !helper.is_finished());
                if let Some((ring, draft)) = draft.lock().take() {
                    return library.drafted_node(ring, Some(draft));
                }
                if !drafts.make_next(&mut walkers) {
                    assert!(has_help, "a thread failed that was making a draft");
                    std::thread::yield_now();
                }
            }
        });
        made.collect()
    })
}

/// Rings and drafts of kinds, as far as they are made and not taken.
struct Drafts<'a> {
    topology: &'a Topology,
    rules: RuleSet,
    starts: &'a [u32],
    made: Vec<Mutex<Option<(LocalMesh, Draft)>>>,
    next: AtomicUsize,
}

impl<'a> Drafts<'a> {
    fn new(topology: &'a Topology, rules: RuleSet, starts: &'a [u32]) -> Self {
        let made = starts.iter().map(|_| Mutex::default()).collect();
        Self { topology, rules, starts, made, next: AtomicUsize::new(0) }
    }

    /// Makes the next draft; returns whether there was one to make. The walkers are scratch, for the ring and its
    /// quarters.
    fn make_next(&self, [walker, of_quarters]: &mut [RingWalker; 2]) -> bool {
        let i = self.next.fetch_add(1, Ordering::Relaxed);
        let Some(&start) = self.starts.get(i) else { return false };
        let ring = walker.extract(self.topology, start, self.rules.keeps_outer_tags()).mesh.clone();
        let draft = Draft::new(self.rules, &ring, false, of_quarters);
        *self.made[i].lock() = Some((ring, draft));
        true
    }
}

impl Kinds {
    /// The kind and the turn of a face, as of a node.
    fn find(&mut self, sorter: &Sorter<'_>, face: FaceId) -> NodeId {
        let topology = sorter.topology;
        if topology.is_hidden(face) {
            return REGULAR;
        }
        let (first, n) = topology.face_corners(face.0);
        let fans = if n == 4 { sorter.fans.at(first) } else { None };
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
            let (_, plans) = plan_faces(&topology, rules, 3, &sites, &|_| Ok(())).unwrap();
            let fans = Fans::new(&topology);
            let (mut library, mut walker) = (PlanLibrary::new(rules), RingWalker::default());
            let (mut of_node, mut of_plan) = (FxHashMap::default(), FxHashMap::default());
            for (face, plan) in plans.iter().enumerate() {
                let first = topology.face_corners(face as u32).0;
                let look = walker.look(&topology, first);
                assert_eq!(*plan == REGULAR, look.is_regular || topology.is_hidden(FaceId::from(face)));
                if *plan == REGULAR {
                    continue;
                }
                assert_eq!(plan.turn(), look.turn);
                let node = library.node(&walker.extract(&topology, first + look.turn, rules.keeps_outer_tags()).mesh);
                let plan = plan.turned(4 - look.turn);
                assert_eq!(*of_node.entry(node).or_insert(plan), plan);
                assert_eq!(*of_plan.entry(plan).or_insert(node), node);
                n_by_fans += u32::from(topology.corners_at(first).1 == 4 && fans.at(first).is_some());
            }
        }
        assert!(n_by_fans > 100, "{n_by_fans} faces have fans");
    }
}
