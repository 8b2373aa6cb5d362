//! The top level: a tree over the boxes of a mesh's patches, in lattice space.
//!
//! It is a **wide tree**: its **nodes** have up to eight **lanes**. A lane is empty, an inner node or a **leaf**: one
//! patch. A leaf is named by its **leaf slot**, `8 * node + lane`; the cache's table of slots is indexed by it, so its
//! address is known as soon as the node is tested, and can be fetched ahead.
//!
//! ```text
//!   node, 192 + 32 + 44 bytes                       open node, on the stack
//!   ┌───────────────────────┬─────────┬──────────┐  ┌───────────────────────────────────┬──────┐
//!   │ x, y, z low, x, y, z  │ 8 refs  │ 8 plates │  │ for each lane the place of its    │ node │
//!   │ high: 6 x 8 floats    │ 32 bits │ 40 bits  │  │ entry in the order, or LAST, 8x16 │      │
//!   └───────────────────────┴─────────┴──────────┘  └───────────────────────────────────┴──────┘
//! ```
//!
//! # Invariants
//! 1. A lane's box holds every box below it.
//! 2. The test of a box is conservative against the triangle test ([`LatticeRay`](crate::grid::LatticeRay) has the
//!    argument), so a patch that a ray hits is visited; so is the test of a plate ([`Plates`] has it).
//! 3. The lanes of a node are visited in the order of their entry, to within two [places](crate::math::simd::place);
//!    those entered at exactly `t_max` are visited too, so that ties are seen.
//! 4. No arrangement of boxes makes the tree deep or its build quadratic.
//!
//! Ideas: Wald, Benthin, Boulos 2008 (wide trees), Wald 2007 (binned building), Ize 2013 and Woop et al. 2013 (slabs).
//! Read `traverse.rs` first, then `plates.rs`; `front.rs` lets rays that are much alike begin further down,
//! `packet_walk.rs` takes eight of them at once.

mod build;
mod collapse;
mod front;
mod groups;
mod packet_walk;
mod parts;
mod plates;
mod slabs;
mod traverse;
mod visit;

use crate::grid::Plates;
use crate::ids::PatchId;

pub use build::BUILD_BYTES_PER_PATCH;
pub use front::{Front, FrontWalk};
pub use packet_walk::PacketWalk;
pub use traverse::{AnyWalk, TraversalStack, Walk};

/// A leaf of the tree.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LeafRef {
    /// Index into the cache's table of slots, below [`TopLevel::n_slots`].
    pub slot: u32,
    /// The patch, as its index in the boxes that the tree was built over.
    pub patch: PatchId,
}

/// A ray's way from leaf to leaf.
pub trait LeafWalk {
    /// The next patch whose box the ray meets before `t_max`, the nearest of each node first. `prefetch` is called with
    /// a leaf's slot when the leaf before it in the same node is handed out.
    fn nearest(&mut self, t_max: f32, prefetch: impl Fn(u32)) -> Option<LeafRef>;
}

/// Lanes of a node.
const LANES: usize = 8;

/// Marks a leaf in a node's refs.
const LEAF: u32 = 1 << 31;

/// The ref of an empty lane.
const EMPTY: u32 = u32::MAX;

/// The boxes of a node: exactly three cache lines, so that no load of a plane takes two.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct NodeBoxes {
    /// Low planes of x, y, z, then high planes. An empty lane has its low planes above its high ones.
    planes: [[f32; LANES]; 6],
}

const _: () = assert!(size_of::<NodeBoxes>() == 192);

/// What the lanes of a node are: `LEAF | patch`, or an inner node, or `EMPTY`.
type Refs = [u32; LANES];

/// Bytes of a node.
pub const NODE_BYTES: usize = size_of::<NodeBoxes>() + size_of::<Refs>() + size_of::<Plates>();

/// All nodes, in three lists of the same length.
#[derive(Clone, Debug, Default)]
struct Nodes {
    boxes: Vec<NodeBoxes>,
    refs: Vec<Refs>,
    plates: Vec<Plates>,
}

/// The tree over a mesh's patches.
///
/// ```
/// use glam::{DVec3, Vec3};
/// use lazytess::grid::{LatticeRay, TriangleId};
/// use lazytess::math::{Bounds, simd::Portable};
/// use lazytess::scene::accel::{TopLevel, TraversalStack};
///
/// let corners = (0..100).map(|x| 1000.0 * Vec3::X * x as f32);
/// let boxes: Vec<Bounds> = corners.map(|p| Bounds { min: p, max: p + 100.0 }).collect();
/// let tree = TopLevel::build(&boxes, 1);
/// let ray = LatticeRay::new(DVec3::new(-50.0, 50.0, 50.0), DVec3::X, f32::INFINITY, TriangleId::NONE);
/// let mut order = vec![];
/// tree.closest(Portable, &ray, &mut TraversalStack::default(), |leaf, _t_max| order.push(leaf.patch.idx()));
/// order.sort();
/// assert_eq!(order, (0..100).collect::<Vec<_>>());
/// ```
#[derive(Clone, Debug)]
pub struct TopLevel {
    nodes: Nodes,
    /// Entries that a traversal can have on its stack at once.
    stack_need: usize,
}

impl TopLevel {
    /// Size of the table that [`LeafRef::slot`] indexes: eight for every node.
    pub fn n_slots(&self) -> usize {
        LANES * self.nodes.refs.len()
    }

    /// Resident size.
    pub fn bytes(&self) -> usize {
        NODE_BYTES * self.nodes.refs.len()
    }

    /// All leaves, in the order of their slots.
    pub fn leaves(&self) -> impl Iterator<Item = LeafRef> + '_ {
        let refs = self.nodes.refs.iter().flatten().copied();
        refs.enumerate()
            .filter(|(_, r)| *r != EMPTY && r & LEAF != 0)
            .map(|(slot, r)| LeafRef { slot: slot as u32, patch: PatchId(r & !LEAF) })
    }
}

#[cfg(test)]
mod tests;
