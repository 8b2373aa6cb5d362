//! Packets against the sixteen boxes of a head.

use super::{PACKET, RayPacket};
use crate::grid::boxes::{Head, LaneHits};
use crate::grid::{NodeView, Plane};
use crate::math::simd::{Kernel, spread};

/// The planes of sixteen boxes where the rays of a packet enter and leave, by axis, as distances from the origin.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct SeenBoxes {
    near: [[f32; 16]; 3],
    far: [[f32; 16]; 3],
}

impl SeenBoxes {
    /// To be overwritten.
    pub const UNSET: Self = Self { near: [[0.0; 16]; 3], far: [[0.0; 16]; 3] };

    /// The rays of the packet that meet the box of a lane before their ends, as bits.
    #[inline(always)]
    pub fn meeting<K: Kernel>(&self, k: K, packet: &RayPacket, lane: usize) -> u32 {
        let [near, far] = self.lane(lane);
        packet.meeting(k, near, far)
    }

    /// Those of them that meet the plate of a node's child within the box.
    #[inline(always)]
    pub fn meeting_plate<K: Kernel>(&self, k: K, packet: &RayPacket, lane: usize, node: NodeView<'_>) -> u32 {
        packet.meeting_plate(k, self.lane(lane), &node.plates[lane / 8], lane % 8)
    }

    /// The planes of a lane.
    #[inline(always)]
    fn lane(&self, lane: usize) -> [[f32; 3]; 2] {
        let [near, far] = [&self.near, &self.far];
        [[near[0][lane], near[1][lane], near[2][lane]], [far[0][lane], far[1][lane], far[2][lane]]]
    }
}

impl NodeView<'_> {
    /// The children whose boxes some ray of a packet may meet, and where at least, if no ray had an end; `seen`
    /// receives their boxes.
    #[inline(always)]
    pub fn test_packet<K: Kernel>(&self, kernel: K, packet: &RayPacket, seen: &mut SeenBoxes) -> LaneHits {
        self.head.test_packet(kernel, packet, seen)
    }
}

impl Head {
    /// The lanes whose boxes some ray of a packet may meet, and where at least, if no ray had an end; `seen` receives
    /// all boxes.
    #[inline(always)]
    pub fn test_packet<K: Kernel>(&self, k: K, packet: &RayPacket, seen: &mut SeenBoxes) -> LaneHits {
        let mut t_near = [0.0; 16];
        let sides = SeenSides::new(k, self, packet);
        let (mut mask, enter) = self.test_half(k, packet, &sides, 0, seen);
        t_near[..8].copy_from_slice(&k.store(enter));
        if self.has_high_lanes() {
            let (high, enter) = self.test_half(k, packet, &sides, 1, seen);
            t_near[8..].copy_from_slice(&k.store(enter));
            mask |= high << 8;
        }
        LaneHits { mask: mask & u32::from(self.mask), t_near }
    }

    #[inline(always)]
    fn test_half<K: Kernel>(
        &self,
        k: K,
        packet: &RayPacket,
        sides: &SeenSides<K>,
        half: usize,
        seen: &mut SeenBoxes,
    ) -> (u32, K::F) {
        let (near, far) = sides.distances(k, self.half_of_planes(half));
        for axis in 0..3 {
            seen.near[axis][8 * half..8 * half + 8].copy_from_slice(&k.store(near[axis]));
            seen.far[axis][8 * half..8 * half + 8].copy_from_slice(&k.store(far[axis]));
        }
        let (enter, leave) = packet.range_within(k, near, far);
        (k.le(enter, leave), enter)
    }

    /// For each of some rays of a packet, the lanes whose boxes it meets before its end, as bits.
    #[inline(always)]
    pub fn test_rays<K: Kernel>(&self, k: K, packet: &RayPacket, rays: u32) -> [u32; PACKET] {
        let mut met = [0; PACKET];
        let sides = SeenSides::new(k, self, packet);
        for half in 0..1 + usize::from(self.has_high_lanes()) {
            let (near, far) = sides.distances(k, self.half_of_planes(half));
            let mut rest = rays;
            while rest != 0 {
                let ray = rest.trailing_zeros() as usize % PACKET;
                rest &= rest - 1;
                met[ray] |= packet.met_by(k, ray, near, far) << (8 * half) & u32::from(self.mask);
            }
        }
        met
    }
}

/// What a packet makes of a head: the planes where its rays enter boxes, and those where they leave.
struct SeenSides<K: Kernel> {
    near: SeenPlanes<K>,
    far: SeenPlanes<K>,
}

/// By axis one plane of every box: number q lies at `base + q * step` from the origin.
struct SeenPlanes<K: Kernel> {
    planes: [Plane; 3],
    base: [K::F; 3],
    step: [K::F; 3],
}

impl<K: Kernel> SeenSides<K> {
    #[inline(always)]
    fn new(k: K, head: &Head, packet: &RayPacket) -> Self {
        let [near, far] = packet.sides();
        Self { near: SeenPlanes::new(k, head, near), far: SeenPlanes::new(k, head, far) }
    }

    /// The distances of the planes of eight boxes, near and far ones by axis.
    #[inline(always)]
    fn distances(&self, k: K, planes: &[[u8; 4]; 22]) -> ([K::F; 3], [K::F; 3]) {
        let Self { near, far } = self;
        (
            [near.distance(k, planes, 0), near.distance(k, planes, 1), near.distance(k, planes, 2)],
            [far.distance(k, planes, 0), far.distance(k, planes, 1), far.distance(k, planes, 2)],
        )
    }
}

impl<K: Kernel> SeenPlanes<K> {
    #[inline(always)]
    fn new(k: K, head: &Head, (planes, origin): ([Plane; 3], &[f32; 8])) -> Self {
        let frame = head.frame();
        let base = k.sub(k.floats_twice(frame), k.load(origin));
        let step = k.scaled_twice(k.splat(1.0), frame[3]);
        Self { planes, base: spread(k, base), step: spread(k, step) }
    }

    /// How far from the origin the planes of eight boxes lie.
    #[inline(always)]
    fn distance(&self, k: K, planes: &[[u8; 4]; 22], axis: usize) -> K::F {
        let plane = self.planes[axis].index();
        let two: &[[u8; 4]; 2] = planes[plane..plane + 2].try_into().expect("two units");
        k.mul_add(k.widen(bytemuck::cast_ref(two)), self.step[axis], self.base[axis])
    }
}
