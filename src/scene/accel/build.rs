//! Boxes to wide tree: obvhs clusters them into a binary tree, `collapse.rs` makes it wide.
//!
//! obvhs merges pairs of boxes that are each other's nearest. Among equal boxes, or along a row of equally spaced ones, one
//! pair a round is all there is, and the time becomes quadratic. So it is given boxes that are moved a little, each by
//! its own amount, which leaves no ties; the tree then gets the true boxes back.

use super::collapse::{Collapse, parents_first};
use super::{EMPTY, LANES, LEAF, TopLevel, WideNode};
use crate::math::Bounds;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use std::time::Duration;

/// Memory that [`TopLevel::build`] takes while it runs, at most, for each patch; what stays is [`TopLevel::bytes`].
pub const BUILD_BYTES_PER_PATCH: usize = 256;

/// How far a box is moved at most to either side, as twice the share of its size: enough to break ties, too little to change clusters.
const JITTER: f32 = 0.02;

/// The same in lattice steps, for boxes without extent.
const JITTER_STEPS: f32 = 1.0;

impl WideNode {
    const NOTHING: Self = Self {
        planes: [
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
        ],
        refs: [EMPTY; LANES],
    };

    fn set(&mut self, lane: usize, aabb: &Aabb, reference: u32) {
        for k in 0..3 {
            self.planes[k][lane] = aabb.min[k];
            self.planes[k + 3][lane] = aabb.max[k];
        }
        self.refs[lane] = reference;
    }
}

impl TopLevel {
    /// The tree over `patches`: boxes in lattice units, finite, that hold every lattice vertex of the patch. At most 2^28 of them.
    pub fn build(patches: &[Bounds]) -> Self {
        if patches.is_empty() {
            return Self { nodes: vec![WideNode::NOTHING], stack_need: LANES };
        }
        let boxes: Vec<Aabb> = patches.iter().enumerate().map(|(i, b)| jittered(i as u32, b)).collect();
        let parameters = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::very_fast_build() };
        let mut binary = build_bvh2(&boxes, parameters, &mut Duration::default());
        drop(boxes);
        let order = parents_first(&binary);
        restore_boxes(&mut binary, &order, patches);
        emit(&binary, &Collapse::new(&binary, &order))
    }
}

fn aabb(b: &Bounds) -> Aabb {
    Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))
}

/// The box, moved by an amount that depends on its number.
fn jittered(i: u32, b: &Bounds) -> Aabb {
    let random = |salt: u32| {
        let mixed = (i ^ salt).wrapping_mul(0x9e37_79b9).rotate_left(15).wrapping_mul(0x85eb_ca6b);
        (mixed >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let by = (b.max - b.min) * JITTER + JITTER_STEPS;
    let by = by * Vec3::new(random(1), random(0x5bd1_e995), random(0x27d4_eb2f));
    Aabb::new(Vec3A::from(b.min + by), Vec3A::from(b.max + by))
}

/// Gives every node the box of what is below it.
fn restore_boxes(binary: &mut Bvh2, order: &[u32], patches: &[Bounds]) {
    for &n in order.iter().rev() {
        let node = &binary.nodes[n as usize];
        let first = node.first_index as usize;
        let of = |i: usize| *binary.nodes[i].aabb();
        let below = if node.is_leaf() {
            aabb(&patches[binary.primitive_indices[first] as usize])
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
fn emit(binary: &Bvh2, collapse: &Collapse) -> TopLevel {
    let mut nodes = vec![WideNode::NOTHING];
    let mut pending = vec![Pending { node: 0, binary: 0, depth: 1 }];
    let mut deepest = 1;
    while let Some(Pending { node, binary: below, depth }) = pending.pop() {
        deepest = deepest.max(depth);
        for (lane, child) in collapse.lanes(binary, below).into_iter().enumerate() {
            let source = &binary.nodes[child];
            let reference = if source.is_leaf() {
                LEAF | binary.primitive_indices[source.first_index as usize]
            } else {
                nodes.push(WideNode::NOTHING);
                pending.push(Pending { node: nodes.len() - 1, binary: child, depth: depth + 1 });
                (nodes.len() - 1) as u32
            };
            nodes[node].set(lane, source.aabb(), reference);
        }
    }
    nodes.shrink_to_fit();
    TopLevel { nodes, stack_need: (LANES - 1) * deepest + 1 }
}
