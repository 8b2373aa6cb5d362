//! Packets of rays on their way from the front of their bundle to leaves.
//!
//! What a packet meets is looked at twice, as in `grid/packet/`: eight boxes for all rays, then those that some ray may
//! meet for each, and of leaves the plates as well. Groups of the front come in its order, lanes of nodes below it in
//! the order in which the packet enters them.

use super::front::Group;
use super::traverse::{NodeLists, OpenNode, TraversalStack};
use super::{Front, LANES, LEAF, LeafRef, NodeBoxes, TopLevel};
use crate::grid::RayPacket;
use crate::ids::PatchId;
use crate::math::simd::Kernel;

impl TopLevel {
    /// A walk along a packet of rays of the bundle whose front this is, at its start.
    #[inline(always)]
    pub fn walk_packet<'t, K: Kernel>(
        &'t self,
        kernel: K,
        front: &'t Front,
        packet: &RayPacket,
        stack: &'t mut TraversalStack,
    ) -> PacketWalk<'t, K> {
        let (group, rest) = front.groups.split_first().expect("a front that is not empty");
        let (enter, leave) = group.boxes.seen_by(kernel, packet);
        let (lanes, order) = (kernel.le(enter, leave), kernel.load_order(&[K::LAST; LANES]));
        let stack = stack.open_of_size(self.stack_need);
        PacketWalk { kernel, group, rest, lanes, nodes: self.nodes(), node: 0, order, stack, n: 0 }
    }
}

/// The way of a packet of rays along a front, from leaf to leaf.
pub struct PacketWalk<'t, K: Kernel> {
    kernel: K,
    group: &'t Group,
    rest: &'t [Group],
    /// Lanes of the group still to be visited.
    lanes: u32,
    nodes: NodeLists<'t>,
    /// Below a node of the front: the present node, and its lanes still to be visited.
    node: u32,
    order: K::O,
    /// Nodes above the present one that have lanes left.
    stack: &'t mut [OpenNode],
    /// How many.
    n: usize,
}

/// A lane that rays of the packet meet.
struct Met {
    reference: u32,
    /// That of a leaf.
    slot: u32,
    /// The rays, as bits.
    rays: u32,
}

impl<K: Kernel> PacketWalk<'_, K> {
    /// The next patch whose box rays of the packet meet, and which ones, as bits.
    #[inline(always)]
    pub fn next(&mut self, packet: &RayPacket) -> Option<(LeafRef, u32)> {
        loop {
            let Met { reference, slot, rays } = match self.next_below(packet) {
                Some(met) => met,
                None => self.next_of_front(packet)?,
            };
            if reference & LEAF != 0 {
                return Some((LeafRef { slot, patch: PatchId(reference & !LEAF) }, rays));
            }
            self.go_down(packet, reference);
        }
    }

    /// The next lane below a node of the front.
    #[inline(always)]
    fn next_below(&mut self, packet: &RayPacket) -> Option<Met> {
        let k = self.kernel;
        loop {
            if !k.has_any(self.order) {
                self.n = self.n.checked_sub(1)?;
                let above = &self.stack[self.n];
                (self.node, self.order) = (above.node, k.load_order(&above.order));
            }
            let lane = k.first(self.order).0;
            self.order = k.without(self.order, lane);
            let slot = self.node * LANES as u32 + lane as u32;
            let reference = self.nodes.refs[self.node as usize][lane % LANES];
            let rays = self.meeting(packet, &self.nodes.boxes[self.node as usize], lane, reference, slot);
            if rays != 0 {
                return Some(Met { reference, slot, rays });
            }
        }
    }

    /// The next lane of the front's groups.
    #[inline(always)]
    fn next_of_front(&mut self, packet: &RayPacket) -> Option<Met> {
        loop {
            while self.lanes == 0 {
                let (group, rest) = self.rest.split_first()?;
                if group.enter > packet.farthest() {
                    return None;
                }
                let (enter, leave) = group.boxes.seen_by(self.kernel, packet);
                (self.group, self.rest, self.lanes) = (group, rest, self.kernel.le(enter, leave));
            }
            let lane = self.lanes.trailing_zeros() as usize % LANES;
            self.lanes &= self.lanes - 1;
            let (reference, slot) = (self.group.refs[lane], self.group.slots[lane]);
            let rays = self.meeting(packet, &self.group.boxes, lane, reference, slot);
            if rays != 0 {
                return Some(Met { reference, slot, rays });
            }
        }
    }

    /// The rays that meet one of these boxes, and a leaf's plate within, as bits.
    #[inline(always)]
    fn meeting(&self, packet: &RayPacket, boxes: &NodeBoxes, lane: usize, reference: u32, slot: u32) -> u32 {
        let [distance, to_far] = boxes.seen_from(packet, lane);
        if reference & LEAF == 0 {
            return packet.meeting(self.kernel, distance, to_far);
        }
        let plates = &self.nodes.plates[slot as usize / LANES];
        packet.meeting_plate(self.kernel, [distance, to_far], plates, slot as usize % LANES)
    }

    /// Goes on at a node below the present one, or below the front.
    #[inline(always)]
    fn go_down(&mut self, packet: &RayPacket, node: u32) {
        let k = self.kernel;
        if k.has_any(self.order) {
            self.stack[self.n] = OpenNode { order: k.store_order(self.order), node: self.node };
            self.n += 1;
        }
        let (enter, leave) = self.nodes.boxes[node as usize].seen_by(k, packet);
        (self.node, self.order) = (node, k.in_order(enter, leave));
    }
}

impl NodeBoxes {
    /// Where rays of a packet enter the boxes at least, and where they leave them at most.
    #[inline(always)]
    fn seen_by<K: Kernel>(&self, k: K, packet: &RayPacket) -> (K::F, K::F) {
        let [(near, from_near), (far, from_far)] = packet.sides();
        let distance = [
            self.distance(k, near[0], from_near[0]),
            self.distance(k, near[1], from_near[1]),
            self.distance(k, near[2], from_near[2]),
        ];
        let to_far = [
            self.distance(k, far[0], from_far[0]),
            self.distance(k, far[1], from_far[1]),
            self.distance(k, far[2], from_far[2]),
        ];
        packet.range_within(k, distance, to_far)
    }

    /// How far the planes of a box are from a packet's origin: those where rays enter, and those where they leave.
    #[inline(always)]
    fn seen_from(&self, packet: &RayPacket, lane: usize) -> [[f32; 3]; 2] {
        let [(near, from_near), (far, from_far)] = packet.sides();
        let [mut distance, mut to_far] = [[0.0; 3]; 2];
        for axis in 0..3 {
            distance[axis] = self.coordinate(near[axis], lane) - from_near[axis];
            to_far[axis] = self.coordinate(far[axis], lane) - from_far[axis];
        }
        [distance, to_far]
    }
}
