//! The node: boxes around up to 4x4 children of a patch's tree of pieces, and plates.

use super::boxes::{CellRect, Head, IntegerBox, LaneBoxes, LaneHits, Slabs, lane_mask, union};
use super::{ExactPlates, HEAD_BYTES, LATTICE_LIMIT, LatticeRay, Plates};
use crate::math::simd::{self, Kernel, Task, spread};
use crate::math::{Bounds, Envelope};
use glam::Vec3;

/// The plates of lanes 0 to 7, and of 8 to 15 if there are any.
type ChildPlates = [Plates];

/// Exact size of a node with so many children along u and v, without the words that the cache puts before it.
pub fn node_bytes(children: [u8; 2]) -> usize {
    HEAD_BYTES + usize::from(children[1].div_ceil(2)) * size_of::<Plates>()
}

/// In place of a vertex format: a node has no vertices.
const NO_FORMAT: u8 = 0;

/// Writes a node over `cells` with a grid of `children` = [along u, along v] children, 1 to 4 each. `envelopes` has one
/// in lattice units for each, u fastest; it must hold every lattice vertex of the child. A child with an empty box is
/// never met; one at least is not empty. `out` is as long as [`node_bytes`] says.
#[inline]
pub fn encode_node(cells: CellRect, children: [u8; 2], envelopes: &[Envelope], out: &mut [u8]) {
    simd::run(EncodeNode { cells, children, envelopes, out });
}

struct EncodeNode<'a> {
    cells: CellRect,
    children: [u8; 2],
    envelopes: &'a [Envelope],
    out: &'a mut [u8],
}

impl Task for EncodeNode<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, _: K) {
        let Self { cells, children, envelopes, out } = self;
        encode(cells, children, envelopes, out);
    }
}

#[inline(always)]
fn encode(cells: CellRect, children: [u8; 2], envelopes: &[Envelope], out: &mut [u8]) {
    debug_assert!(children.iter().all(|n| (1..=4).contains(n)));
    let [n_u, n_v] = children.map(usize::from);
    assert_eq!(envelopes.len(), n_u * n_v, "one for each child");
    let children_and_lanes = || {
        envelopes
            .chunks_exact(n_u)
            .enumerate()
            .flat_map(|(b, row)| row.iter().enumerate().map(move |(a, of)| (of, 4 * b + a)))
    };
    let (mut whole, mut boxes) = ([[i32::MAX; 3], [i32::MIN; 3]], LaneBoxes::UNSET);
    for (of, lane) in children_and_lanes().filter(|(of, _)| !of.bounds.is_empty()) {
        let child = integer_box(&of.bounds);
        boxes.set(lane, child);
        whole = union(whole, child);
    }
    assert!(whole[0][0] <= whole[1][0], "a node has children");
    let (head, plates) = out.split_at_mut(HEAD_BYTES);
    let head: &mut Head = bytemuck::from_bytes_mut(head);
    head.set(whole, &boxes, children, cells, [0; 2], NO_FORMAT);
    children_and_lanes().filter(|(of, _)| of.bounds.is_empty()).for_each(|(_, lane)| head.turn_inside_out(lane));
    let mut exact = [ExactPlates::NONE; 2];
    for (of, lane) in children_and_lanes().filter(|(of, _)| !of.bounds.is_empty()) {
        exact[lane / 8 % 2].set(lane % 8, &of.plate, head.middle_of(lane));
    }
    let plates: &mut ChildPlates = bytemuck::cast_slice_mut(plates);
    for (plates, exact) in plates.iter_mut().zip(&exact) {
        *plates = exact.rounded();
    }
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
    head_of(block).format == NO_FORMAT
}

/// The cells that a block is over, whether it is a node or a piece.
pub fn cells_of(block: &[u8]) -> CellRect {
    head_of(block).cells
}

#[inline(always)]
fn head_of(block: &[u8]) -> &Head {
    bytemuck::from_bytes(&block[..HEAD_BYTES])
}

/// A node to be read.
#[derive(Clone, Copy, Debug)]
pub struct NodeView<'b> {
    pub(super) head: &'b Head,
    pub(super) plates: &'b ChildPlates,
}

impl<'b> NodeView<'b> {
    /// The node at the start of `bytes`, which must be aligned to 4 bytes at least (64 is best).
    #[inline(always)]
    pub fn new(bytes: &'b [u8]) -> Self {
        let head = head_of(bytes);
        Self { head, plates: bytemuck::cast_slice(&bytes[HEAD_BYTES..node_bytes(head.lanes)]) }
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

    /// The children whose boxes the ray meets before `t_max`, and whose plates it meets within the boxes. Child (a, b) is
    /// lane 4 b + a.
    #[inline(always)]
    pub fn test<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> LaneHits {
        let mut t_near = [0.0; 16];
        let through = Through::new(kernel, self, ray, t_max);
        let (mut mask, enter) = self.test_half(kernel, &through, 0);
        t_near[..8].copy_from_slice(&kernel.store(enter));
        if self.head.has_high_lanes() {
            let (high, enter) = self.test_half(kernel, &through, 1);
            t_near[8..].copy_from_slice(&kernel.store(enter));
            mask |= high << 8;
        }
        LaneHits { mask: mask & u32::from(self.head.mask), t_near }
    }

    /// The same, as bits, where the order does not matter.
    #[inline(always)]
    pub fn lanes_met<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> u32 {
        let through = Through::new(kernel, self, ray, t_max);
        let mut mask = self.test_half(kernel, &through, 0).0;
        if self.head.has_high_lanes() {
            mask |= self.test_half(kernel, &through, 1).0 << 8;
        }
        mask & u32::from(self.head.mask)
    }

    /// The test of lanes 0 to 7 or 8 to 15: their bits, and where the ray enters the boxes.
    #[inline(always)]
    fn test_half<K: Kernel>(&self, k: K, through: &Through<K>, half: usize) -> (u32, K::F) {
        let (enter, leave) = through.slabs.through(k, self.head.half_of_planes(half));
        let mut met = k.le(enter, k.min(leave, k.splat(through.t_max)));
        if met != 0 {
            let from_middle = through.seen_from_middles(k, self.head.half_of_planes(half));
            let distance = self.plates[half].distance(k, from_middle, &through.direction, enter, leave);
            met &= k.le(distance, k.splat(0.0));
        }
        (met, enter)
    }
}

/// What a ray makes of a node.
struct Through<K: Kernel> {
    slabs: Slabs<K>,
    t_max: f32,
    /// Seen from the low corner of all boxes, each coordinate in all lanes.
    origin: [K::F; 3],
    direction: [K::F; 3],
    /// Half the step between planes, towards the origin.
    half_step: [K::F; 3],
}

impl<K: Kernel> Through<K> {
    #[inline(always)]
    fn new(k: K, node: &NodeView<'_>, ray: &LatticeRay, t_max: f32) -> Self {
        let frame = node.head.frame();
        Self {
            slabs: Slabs::new(k, node.head, ray),
            t_max,
            origin: spread(k, k.sub(k.floats_twice(&ray.cell), k.floats_twice(frame))),
            direction: spread(k, k.load(&ray.towards)),
            half_step: spread(k, k.scaled_twice(k.splat(-0.5), frame[3])),
        }
    }

    /// Where the origin lies from the middles of eight boxes.
    #[inline(always)]
    fn seen_from_middles(&self, k: K, planes: &[[u8; 4]; 22]) -> [K::F; 3] {
        let mut seen = self.origin;
        for (axis, from) in seen.iter_mut().enumerate() {
            let low: &[[u8; 4]; 2] = planes[4 * axis..4 * axis + 2].try_into().expect("two units");
            let high: &[[u8; 4]; 2] = planes[4 * axis + 12..4 * axis + 14].try_into().expect("two units");
            let sum = k.add(k.widen(bytemuck::cast_ref(low)), k.widen(bytemuck::cast_ref(high)));
            *from = k.mul_add(sum, self.half_step[axis], *from);
        }
        seen
    }
}
