//! Boxes to wide tree.

use super::collapse::Collapse;
use super::{EMPTY, LANES, LEAF, TopLevel, WideNode};
use crate::math::Bounds;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use std::time::Duration;

/// Memory that [`TopLevel::build`] takes while it runs, at most, for each patch; what stays is [`TopLevel::bytes`].
pub const BUILD_BYTES_PER_PATCH: usize = 512;

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
        let boxes: Vec<Aabb> = patches.iter().map(|b| Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))).collect();
        if boxes.is_empty() {
            return Self { nodes: vec![WideNode::NOTHING], stack_need: LANES };
        }
        let parameters = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::very_fast_build() };
        let binary = build_bvh2(&boxes, parameters, &mut Duration::default());
        drop(boxes);
        emit(&binary, &Collapse::new(&binary))
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
