//! The node: boxes around up to 4x4 children of a patch's tree of pieces.

use super::boxes::{CellRect, HEAD_BYTES, Head, IntegerBox, LaneBoxes, LaneHits, lane_mask, union};
use super::{LATTICE_LIMIT, LatticeRay};
use crate::math::Bounds;
use crate::math::simd::{self, Kernel, Task};
use glam::Vec3;

/// Exact size of a node, without the words that the cache puts before it.
pub const NODE_BYTES: usize = HEAD_BYTES;

/// In place of a vertex format: a node has no vertices.
const NO_FORMAT: u8 = 0;

/// Writes a node over `cells` with a grid of `children` = [along u, along v] children, 1 to 4 each. `bounds` has one
/// box in lattice units for each, u fastest; it must hold every lattice vertex of the child. A child with an empty box
/// is never met; one at least is not empty. `out` is [`NODE_BYTES`] long.
#[inline]
pub fn encode_node(cells: CellRect, children: [u8; 2], bounds: &[Bounds], out: &mut [u8]) {
    simd::run(EncodeNode { cells, children, bounds, out });
}

struct EncodeNode<'a> {
    cells: CellRect,
    children: [u8; 2],
    bounds: &'a [Bounds],
    out: &'a mut [u8],
}

impl Task for EncodeNode<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, _: K) {
        let Self { cells, children, bounds, out } = self;
        encode(cells, children, bounds, out);
    }
}

#[inline(always)]
fn encode(cells: CellRect, children: [u8; 2], bounds: &[Bounds], out: &mut [u8]) {
    debug_assert!(children.iter().all(|n| (1..=4).contains(n)));
    let [n_u, n_v] = children.map(usize::from);
    assert_eq!(bounds.len(), n_u * n_v, "one box for each child");
    let children_and_lanes = || {
        bounds
            .chunks_exact(n_u)
            .enumerate()
            .flat_map(|(b, row)| row.iter().enumerate().map(move |(a, of)| (of, 4 * b + a)))
    };
    let (mut whole, mut boxes) = ([[i32::MAX; 3], [i32::MIN; 3]], LaneBoxes::UNSET);
    for (of, lane) in children_and_lanes().filter(|(of, _)| !of.is_empty()) {
        let child = integer_box(of);
        boxes.set(lane, child);
        whole = union(whole, child);
    }
    assert!(whole[0][0] <= whole[1][0], "a node has children");
    let head: &mut Head = bytemuck::from_bytes_mut(out);
    head.set(whole, &boxes, children, cells, [0; 2], NO_FORMAT);
    children_and_lanes().filter(|(of, _)| of.is_empty()).for_each(|(_, lane)| head.turn_inside_out(lane));
}

/// The box rounded outwards to lattice points, and cut to the cube that vertices lie in.
#[inline(always)]
fn integer_box(b: &Bounds) -> IntegerBox {
    let inside = |p: Vec3| p.clamp(Vec3::splat(-LATTICE_LIMIT), Vec3::splat(LATTICE_LIMIT)).as_ivec3().to_array();
    [inside(b.min.floor()), inside(b.max.ceil())]
}

/// Whether a block is a node; else it is a piece. The block is as for [`NodeView::new`].
#[inline(always)]
pub fn is_node(block: &[u8]) -> bool {
    NodeView::new(block).head.format == NO_FORMAT
}

/// A node to be read.
#[derive(Clone, Copy, Debug)]
pub struct NodeView<'b> {
    pub(super) head: &'b Head,
}

impl<'b> NodeView<'b> {
    /// The node at the start of `bytes`, which must be aligned to 4 bytes at least (64 is best).
    #[inline(always)]
    pub fn new(bytes: &'b [u8]) -> Self {
        Self { head: bytemuck::from_bytes(&bytes[..NODE_BYTES]) }
    }

    /// The cells that the node covers.
    #[inline(always)]
    pub fn cells(&self) -> CellRect {
        self.head.cells
    }

    /// Children along u and v.
    #[inline(always)]
    pub fn children(&self) -> [u8; 2] {
        self.head.lanes
    }

    /// Lanes of the children, as bits.
    #[inline(always)]
    pub fn lanes(&self) -> u32 {
        lane_mask(self.head.lanes)
    }

    /// The children whose boxes the ray meets before `t_max`. Child (a, b) is lane 4 b + a.
    #[inline(always)]
    pub fn test<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> LaneHits {
        self.head.test(kernel, ray, t_max)
    }

    /// The same, as bits, where the order does not matter.
    #[inline(always)]
    pub fn lanes_met<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> u32 {
        self.head.lanes_met(kernel, ray, t_max)
    }
}
