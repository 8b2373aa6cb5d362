//! The head that pieces and nodes share: sixteen 8-bit boxes relative to one corner, and the test of a ray against
//! them.

use super::{LatticeRay, Plane};
use crate::math::simd::Kernel;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// Bytes of the head at the start of every block.
pub const HEAD_BYTES: usize = 128;

/// The cells i0 <= i < i1, j0 <= j < j1 of a patch's grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CellRect {
    /// First cell along u.
    pub i0: u16,
    /// First cell along v.
    pub j0: u16,
    /// One past the last cell along u.
    pub i1: u16,
    /// One past the last cell along v.
    pub j1: u16,
}

impl CellRect {
    /// Cells along u and v.
    pub fn size(self) -> [usize; 2] {
        [usize::from(self.i1 - self.i0), usize::from(self.j1 - self.j0)]
    }
}

/// Boxes of up to 4x4 things. Thing (a, b) is **lane** 4 b + a.
///
/// Plane q of axis k is at `base[k] + q * 2^exponent[k]`: an integer, so a box is exact but for being rounded outwards
/// to whole steps.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Head {
    pub base: [i32; 3],
    pub exponent: [u8; 3],
    /// Bytes of a vertex coordinate; 0 in a node.
    pub format: u8,
    /// Things along u and v, 1 to 4 each.
    pub lanes: [u8; 2],
    /// The lanes that are used, as bits: `lane_mask(lanes)`.
    pub mask: u16,
    pub cells: CellRect,
    /// Cells of the whole patch along u and v.
    pub grid: [u16; 2],
    /// Low planes of x, y, z, then high planes.
    planes: [[u8; 16]; 6],
}

const _: () = assert!(size_of::<Head>() == HEAD_BYTES);

/// The lanes of a 4x4 arrangement that `lanes` = [along u, along v] of them use, as bits.
#[inline(always)]
pub fn lane_mask(lanes: [u8; 2]) -> u32 {
    let row = (1u32 << lanes[0].min(4)) - 1;
    (row * 0x1111) & ((1u32 << (4 * u32::from(lanes[1].min(4)))) - 1)
}

/// Boxes of sixteen lanes, one list for each axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneBoxes {
    pub low: [[i32; 16]; 3],
    pub high: [[i32; 16]; 3],
}

impl LaneBoxes {
    /// To be overwritten.
    pub const UNSET: Self = Self { low: [[0; 16]; 3], high: [[0; 16]; 3] };

    /// Replaces a lane's box.
    pub fn set(&mut self, lane: usize, b: IntegerBox) {
        for (k, (low, high)) in b[0].into_iter().zip(b[1]).enumerate() {
            (self.low[k][lane], self.high[k][lane]) = (low, high);
        }
    }
}

/// A box of lattice points: low and high corner, both inside.
pub(super) type IntegerBox = [[i32; 3]; 2];

/// The smallest box around both.
#[inline(always)]
pub(super) fn union(a: IntegerBox, b: IntegerBox) -> IntegerBox {
    [std::array::from_fn(|k| a[0][k].min(b[0][k])), std::array::from_fn(|k| a[1][k].max(b[1][k]))]
}

/// The exponent of the smallest power-of-two step of which 255 reach `extent`.
#[inline(always)]
fn step_exponent(extent: u32) -> u32 {
    let shift = (u32::BITS - extent.leading_zeros()).saturating_sub(8);
    shift + u32::from(extent.div_ceil(1 << shift) > 255)
}

impl Head {
    /// Makes a head whose lane k, for every bit k of `lane_mask(lanes)`, has the box k of `boxes`; the others are not
    /// looked at. `whole` is the box around them all, with coordinates up to 2^24. Each field is written where it
    /// stays.
    #[inline(always)]
    pub fn set(
        &mut self,
        whole: IntegerBox,
        boxes: &LaneBoxes,
        lanes: [u8; 2],
        cells: CellRect,
        grid: [u16; 2],
        format: u8,
    ) {
        let [lowest, highest] = whole;
        for (k, (base, end)) in lowest.into_iter().zip(highest).enumerate() {
            let exponent = step_exponent((end - base) as u32);
            let up = (1u32 << exponent) - 1;
            // Lanes that are not used may wrap around: they are masked after every test.
            self.planes[k] = boxes.low[k].map(|low| ((low.wrapping_sub(base) as u32) >> exponent) as u8);
            self.planes[k + 3] =
                boxes.high[k].map(|high| ((high.wrapping_sub(base) as u32).wrapping_add(up) >> exponent) as u8);
            self.exponent[k] = exponent as u8;
        }
        (self.base, self.format, self.lanes) = (lowest, format, lanes);
        (self.mask, self.cells, self.grid) = (lane_mask(lanes) as u16, cells, grid);
    }

    /// Whether every lane that a test can find is one of [`Self::lanes`].
    #[inline(always)]
    pub fn tests_its_lanes_only(&self) -> bool {
        u32::from(self.mask) == lane_mask(self.lanes)
    }

    /// Makes the lane's box one that no ray meets: along the ray's longest axis it is left 255 planes before it is
    /// entered, and the test's slack is 60 at most on either side.
    pub fn turn_inside_out(&mut self, lane: usize) {
        for k in 0..3 {
            (self.planes[k][lane], self.planes[k + 3][lane]) = (255, 0);
        }
    }

    /// The middle of a lane's box as it is tested, without the ray's slack.
    #[inline(always)]
    pub fn middle_of(&self, lane: usize) -> DVec3 {
        let mut out = [0.0; 3];
        for (k, middle) in out.iter_mut().enumerate() {
            let sum = u32::from(self.planes[k][lane]) + u32::from(self.planes[k + 3][lane]);
            *middle = f64::from(self.base[k]) + 0.5 * f64::from((sum << self.exponent[k]) as i32);
        }
        DVec3::from_array(out)
    }

    /// The box of a lane as it is tested, without the ray's slack.
    #[cfg(test)]
    pub fn decoded_box(&self, lane: usize) -> IntegerBox {
        let plane = |k: usize, q: u8| self.base[k] + (i32::from(q) << self.exponent[k]);
        [
            std::array::from_fn(|k| plane(k, self.planes[k][lane])),
            std::array::from_fn(|k| plane(k, self.planes[k + 3][lane])),
        ]
    }

    /// The lanes whose box the ray meets between 0 and `t_max`.
    #[inline(always)]
    pub fn test<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> LaneHits {
        let mut t_near = [0.0; 16];
        let slabs = Slabs::new(kernel, self, ray);
        let (low, low_t) = slabs.test(kernel, self.half_of_planes(0), t_max);
        t_near[..8].copy_from_slice(&kernel.store(low_t));
        let mut mask = low;
        if self.has_high_lanes() {
            let (high, high_t) = slabs.test(kernel, self.half_of_planes(1), t_max);
            t_near[8..].copy_from_slice(&kernel.store(high_t));
            mask |= high << 8;
        }
        LaneHits { mask: mask & u32::from(self.mask), t_near }
    }

    /// [`Self::test`], without asking where the boxes are entered: bits of lanes.
    #[inline(always)]
    pub fn lanes_met<K: Kernel>(&self, kernel: K, ray: &LatticeRay, t_max: f32) -> u32 {
        let slabs = Slabs::new(kernel, self, ray);
        let mut mask = slabs.test(kernel, self.half_of_planes(0), t_max).0;
        if self.has_high_lanes() {
            mask |= slabs.test(kernel, self.half_of_planes(1), t_max).0 << 8;
        }
        mask & u32::from(self.mask)
    }

    /// Whether there are lanes from 8 on: a third or fourth row.
    #[inline(always)]
    pub fn has_high_lanes(&self) -> bool {
        self.mask > 0xff
    }

    /// The planes in units of four lanes, from lane 0 or 8 on: plane p of four lanes at index `p as usize`.
    #[inline(always)]
    pub fn half_of_planes(&self, half: usize) -> &[[u8; 4]; 22] {
        let fours: &[[u8; 4]; 24] = bytemuck::cast_ref(&self.planes);
        fours[2 * half..2 * half + 22].try_into().expect("two units of the last plane")
    }

    /// Base and, in the fourth place, exponents.
    #[inline(always)]
    pub fn frame(&self) -> &[i32; 4] {
        bytemuck::from_bytes(&bytemuck::bytes_of(self)[..16])
    }
}

/// What a ray makes of a head: t of plane q of axis k is `q * step[k] + near[k]` (or `far`), see [`LatticeRay`]. Each
/// for x, y, z and one to spare, twice.
pub(super) struct Slabs<K: Kernel> {
    step: K::F,
    near: K::F,
    far: K::F,
    near_planes: [Plane; 3],
    far_planes: [Plane; 3],
}

/// Picks for [`Kernel::shuffle`]: x, y or z in every lane.
pub(super) const ALL_X: i32 = 0b00_00_00_00;
pub(super) const ALL_Y: i32 = 0b01_01_01_01;
pub(super) const ALL_Z: i32 = 0b10_10_10_10;

impl<K: Kernel> Slabs<K> {
    #[inline(always)]
    pub fn new(k: K, head: &Head, ray: &LatticeRay) -> Self {
        let frame = head.frame();
        let base = k.floats_twice(frame);
        let inv = k.load(&ray.inv);
        Self {
            step: k.scaled_twice(inv, frame[3]),
            near: k.mul(k.sub(base, k.load(&ray.near_origin)), inv),
            far: k.mul(k.sub(base, k.load(&ray.far_origin)), inv),
            near_planes: ray.sides.near,
            far_planes: ray.sides.far,
        }
    }

    /// The test of eight lanes: their bits, and where the ray enters.
    #[inline(always)]
    fn test(&self, k: K, planes: &[[u8; 4]; 22], t_max: f32) -> (u32, K::F) {
        let (enter, leave) = self.through(k, planes);
        (k.le(enter, k.min(leave, k.splat(t_max))), enter)
    }

    /// Where the ray enters eight lanes, at 0 or later, and where it leaves them.
    #[inline(always)]
    pub fn through(&self, k: K, planes: &[[u8; 4]; 22]) -> (K::F, K::F) {
        let ([near_x, near_y, near_z], [far_x, far_y, far_z]) = (self.near_planes, self.far_planes);
        let mut enter = k.max(self.plane_t::<ALL_X>(k, planes, near_x, self.near), k.splat(0.0));
        enter = k.max(self.plane_t::<ALL_Y>(k, planes, near_y, self.near), enter);
        enter = k.max(self.plane_t::<ALL_Z>(k, planes, near_z, self.near), enter);
        let mut leave = self.plane_t::<ALL_X>(k, planes, far_x, self.far);
        leave = k.min(self.plane_t::<ALL_Y>(k, planes, far_y, self.far), leave);
        leave = k.min(self.plane_t::<ALL_Z>(k, planes, far_z, self.far), leave);
        (enter, leave)
    }

    /// t of one plane of eight lanes.
    #[inline(always)]
    fn plane_t<const AXIS: i32>(&self, k: K, planes: &[[u8; 4]; 22], plane: Plane, offset: K::F) -> K::F {
        let two: &[[u8; 4]; 2] = planes[plane.index()..plane.index() + 2].try_into().expect("two units");
        let q = k.widen(bytemuck::cast_ref(two));
        k.mul_add(q, k.shuffle::<AXIS>(self.step), k.shuffle::<AXIS>(offset))
    }
}

/// The lanes of a block that a ray meets, and where it enters each.
#[derive(Clone, Copy, Debug)]
pub struct LaneHits {
    /// Bit k is set if lane k is met.
    pub mask: u32,
    /// Ray parameter at which the box of lane k is entered, at least 0; only for lanes in `mask`.
    pub t_near: [f32; 16],
}

impl LaneHits {
    /// Takes out the lane that is entered first, if it is not beyond `t_max`.
    #[inline(always)]
    pub fn pop_nearest(&mut self, t_max: f32) -> Option<usize> {
        let mut nearest = self.mask.trailing_zeros() as usize;
        if nearest == 32 {
            return None;
        }
        let mut rest = self.mask & (self.mask - 1);
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            nearest = if self.t_near[lane] < self.t_near[nearest] { lane } else { nearest };
            rest &= rest - 1;
        }
        self.mask &= !(1 << nearest);
        (self.t_near[nearest] <= t_max).then_some(nearest)
    }
}
