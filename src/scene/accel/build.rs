//! Boxes to wide tree: `parts.rs` divides them into parts, `groups.rs` puts eight neighbours each into a node, obvhs
//! clusters the groups of a part into a binary tree, `collapse.rs` makes that wide, and the trees of all parts become
//! the lanes of one more tree.
//!
//! ```text
//!   nodes   ┌─────────────┬──────────────────┬──────────────────┬─ ..
//!           │ over parts  │ part 0           │ part 1           │        refs of a part count from its first node
//!           └─────────────┴──────────────────┴──────────────────┴─ ..    until it is put in its place
//! ```
//!
//! obvhs merges pairs of boxes that are each other's nearest. Among equal boxes, or along a row of equally spaced ones,
//! one pair a round is all there is, and the time becomes quadratic. So it is given boxes that are moved a little along
//! the longest axis of the whole, each by its own amount, and widened by a few lattice steps, which leaves no ties; the
//! tree then gets the true boxes back. Across the longest axis centres stay where they are, so that what is flat stays
//! flat: the order along the space-filling curve would be that of noise otherwise.

use super::collapse::{Collapse, Lane, parents_first};
use super::groups::{Group, groups};
use super::parts::divide;
use super::{EMPTY, LANES, LEAF, NodeBoxes, Nodes, Plates, TopLevel};
use crate::math::Bounds;
use crate::parallel::for_each;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::time::Duration;

/// Memory that [`TopLevel::build`] takes while it runs, at most, for each patch; what stays is [`TopLevel::bytes`].
pub const BUILD_BYTES_PER_PATCH: usize = 8;

/// Fewer than there are as a rule: room for the nodes of large trees is set aside by it.
const PATCHES_PER_NODE: usize = 5;

/// How far a box is moved at most to either side, as twice the share of its size: enough to break ties, too little to
/// change clusters.
const JITTER: f32 = 0.02;

/// The same in lattice steps, for boxes without extent.
const JITTER_STEPS: f32 = 1.0;

/// Lattice steps by which a box becomes wider on each side, at most: whole steps, so that centres do not move. Boxes of
/// points on a line have an area then.
const WIDENING_STEPS: f32 = 16.0;

/// Patches up to which a tree is built thoroughly. That takes 8 % of the instructions of preparing trex (11,946
/// patches), and rays visit 1 to 5 % less afterwards. When nodes were put in their places twice, with 38,000 to 47,000
/// patches (a crowd, a ground, a scan of 30,000 faces, rates 8 and 16) it made preparing take 1.04 to 1.5 times as
/// long, and occlusion, diffuse and shuffled rays 1.00 to 1.11 times as fast. Beside the 0.62 s of a ground of two
/// million patches it would have taken 0.29 more.
const MOST_THOROUGH: usize = 1 << 16;

/// The stack that a tree of a part needs if all went well, and more: of trex 50.
const MOST_STACK: usize = 150;

/// How much time a tree is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Care {
    /// Groups are cut along the longest axis, and the binary tree stays as it was clustered.
    Hasty,
    /// Groups are cut along the best axis, and each node of the binary tree is put where it costs least.
    Thorough,
}

impl Care {
    fn for_patches(n: usize) -> Self {
        if n <= MOST_THOROUGH { Self::Thorough } else { Self::Hasty }
    }

    fn parameters(self) -> BvhBuildParams {
        let parameters = match self {
            Self::Hasty => BvhBuildParams::very_fast_build(),
            Self::Thorough => BvhBuildParams::very_slow_build(),
        };
        // Nodes are put in their places once. A second time is meant for trees whose leaves were joined in between, as
        // none are here: it takes 4 % of the instructions of preparing trex and spares rays 0.0 to 0.4 % of what they
        // look up (trex, bigguy, monsterfrog, rates 8 and 16; bishop at 8 looks up 0.2 % more).
        let once = BvhBuildParams { post_collapse_reinsertion_batch_ratio_multiplier: 0.0, ..parameters };
        BvhBuildParams { max_prims_per_leaf: 1, ..once }
    }
}

impl NodeBoxes {
    const NOTHING: Self = Self {
        planes: [
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
        ],
    };
}

impl Nodes {
    /// Without nodes; growing to `n` copies nothing.
    fn with_capacity(n: usize) -> Self {
        Self { boxes: Vec::with_capacity(n), refs: Vec::with_capacity(n), plates: Vec::with_capacity(n) }
    }

    /// Adds a node without children; returns its number.
    fn push(&mut self) -> usize {
        self.boxes.push(NodeBoxes::NOTHING);
        self.refs.push([EMPTY; LANES]);
        self.plates.push(Plates::default());
        self.refs.len() - 1
    }

    fn set(&mut self, node: usize, lane: usize, bounds: &Bounds, reference: u32) {
        for k in 0..3 {
            self.boxes[node].planes[k][lane] = bounds.min[k];
            self.boxes[node].planes[k + 3][lane] = bounds.max[k];
        }
        self.refs[node][lane] = reference;
    }

    /// Adds the nodes of a tree; returns the number of its root.
    fn add_tree(&mut self, tree: &Self) -> u32 {
        let root = self.refs.len() as u32;
        let in_place = |r: u32| if r & LEAF == 0 { r + root } else { r };
        self.boxes.extend_from_slice(&tree.boxes);
        self.plates.extend_from_slice(&tree.plates);
        self.refs.extend(tree.refs.iter().map(|refs| refs.map(in_place)));
        root
    }
}

impl TopLevel {
    /// The tree over `patches`: boxes in lattice units, finite, that hold every lattice vertex of the patch. At most
    /// 2^28 of them. The same tree for any number of threads.
    pub fn build(patches: &[Bounds], n_threads: usize) -> Self {
        if patches.is_empty() {
            let mut nodes = Nodes::default();
            nodes.push();
            return Self { nodes, stack_need: LANES };
        }
        let mut members: Vec<u32> = (0..patches.len() as u32).collect();
        let parts = divide(patches, &mut members, n_threads);
        let care = Care::for_patches(patches.len());
        if let [part] = &parts[..] {
            return Self::of_part(patches, part.members, care);
        }
        let bounds: Vec<Bounds> = parts.iter().map(|p| p.bounds).collect();
        let all: Vec<u32> = (0..parts.len() as u32).collect();
        let assembly = Mutex::new(Assembly::under(Self::of_part(&bounds, &all, care), patches.len()));
        for_each(&parts, n_threads, |i, part| {
            let tree = Self::of_part(patches, part.members, care);
            assembly.lock().add(i, tree);
        });
        assembly.into_inner().finish()
    }

    /// The tree over some of `boxes`, at least one, whose leaves are `members`.
    fn of_part(boxes: &[Bounds], members: &[u32], care: Care) -> Self {
        let groups = groups(boxes, members, care);
        let moved = without_ties(&groups);
        let mut binary = build_bvh2(&moved, care.parameters(), &mut Duration::default());
        let order = parents_first(&binary);
        restore_boxes(&mut binary, &order, &groups);
        let tree = emit(&Collapse::new(&binary, &order, &groups, boxes), boxes);
        // Among boxes in one place every place costs the same, and nodes end up in a row.
        let is_deep = care == Care::Thorough && tree.stack_need > MOST_STACK;
        if is_deep { Self::of_part(boxes, members, Care::Hasty) } else { tree }
    }
}

/// Trees of parts being joined, in the order of the parts, in which they do not become ready.
struct Assembly {
    nodes: Nodes,
    /// Nodes of the tree over parts, which stand first.
    n_above: usize,
    /// The root of each part that is in its place.
    roots: Vec<u32>,
    waiting: BTreeMap<usize, TopLevel>,
    /// The most that a traversal of the tree over parts needs, and of one of theirs.
    stack_above: usize,
    stack_below: usize,
}

impl Assembly {
    fn under(above: TopLevel, n_patches: usize) -> Self {
        // Growing, or shrinking at the end, would copy and hold everything twice. What is not used is never resident.
        let mut nodes = Nodes::with_capacity(n_patches / PATCHES_PER_NODE);
        nodes.add_tree(&above.nodes);
        Self {
            n_above: above.nodes.refs.len(),
            stack_above: above.stack_need,
            nodes,
            roots: Vec::new(),
            waiting: BTreeMap::new(),
            stack_below: 0,
        }
    }

    fn add(&mut self, part: usize, tree: TopLevel) {
        self.waiting.insert(part, tree);
        while let Some(tree) = self.waiting.remove(&self.roots.len()) {
            self.roots.push(self.nodes.add_tree(&tree.nodes));
            self.stack_below = self.stack_below.max(tree.stack_need);
        }
    }

    fn finish(mut self) -> TopLevel {
        let above = &mut self.nodes.refs[..self.n_above];
        let leaves = above.iter_mut().flatten().filter(|r| **r != EMPTY && **r & LEAF != 0);
        leaves.for_each(|r| *r = self.roots[(*r & !LEAF) as usize]);
        TopLevel { nodes: self.nodes, stack_need: self.stack_above + self.stack_below }
    }
}

/// The boxes of groups, each moved and widened by amounts that depend on its place.
fn without_ties(groups: &[Group]) -> Vec<Aabb> {
    let all = groups.iter().fold(Aabb::INVALID, |all, g| all.union(&g.bounds));
    let size = all.max - all.min;
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).expect("three axes");
    let changed = |(i, group): (usize, &Group)| {
        let b = group.bounds;
        let random = |salt: u32| {
            let mixed = (i as u32 ^ salt).wrapping_mul(0x9e37_79b9).rotate_left(15).wrapping_mul(0x85eb_ca6b);
            (mixed >> 8) as f32 / (1 << 24) as f32
        };
        let mut by = Vec3A::ZERO;
        by[axis] = ((b.max - b.min)[axis] * JITTER + JITTER_STEPS) * (random(1) - 0.5);
        let wider = (WIDENING_STEPS * random(0x5bd1_e995)).ceil();
        Aabb::new(b.min + by - wider, b.max + by + wider)
    };
    groups.iter().enumerate().map(changed).collect()
}

/// Gives every node the box of what is below it.
fn restore_boxes(binary: &mut Bvh2, order: &[u32], groups: &[Group]) {
    for &n in order.iter().rev() {
        let node = &binary.nodes[n as usize];
        let first = node.first_index as usize;
        let of = |i: usize| *binary.nodes[i].aabb();
        let below = if node.is_leaf() {
            groups[binary.primitive_indices[first] as usize].bounds
        } else {
            of(first).union(&of(first + 1))
        };
        binary.nodes[n as usize].set_aabb(below);
    }
}

/// A wide node to be filled with what is below a binary node.
struct Pending {
    node: usize,
    binary: usize,
    depth: usize,
}

/// Writes the wide tree from the root down; children of a node are neighbours.
fn emit(collapse: &Collapse<'_>, boxes: &[Bounds]) -> TopLevel {
    let mut nodes = Nodes::default();
    nodes.push();
    let mut pending = vec![Pending { node: 0, binary: 0, depth: 1 }];
    let mut deepest = 1;
    let mut lanes = Vec::with_capacity(LANES);
    while let Some(Pending { node, binary, depth }) = pending.pop() {
        deepest = deepest.max(depth);
        collapse.lanes(binary, &mut lanes);
        for (lane, child) in lanes.iter().enumerate() {
            let (bounds, reference) = match *child {
                Lane::Box(number) => (boxes[number as usize], LEAF | number),
                Lane::Node(binary) => {
                    let node = nodes.push();
                    pending.push(Pending { node, binary, depth: depth + 1 });
                    (collapse.bounds(binary), node as u32)
                }
            };
            nodes.set(node, lane, &bounds, reference);
        }
    }
    nodes.boxes.shrink_to_fit();
    nodes.refs.shrink_to_fit();
    nodes.plates.shrink_to_fit();
    TopLevel { nodes, stack_need: (LANES - 1) * deepest + 1 }
}
