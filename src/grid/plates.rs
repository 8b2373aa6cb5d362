//! Plates: what a box alone cannot tell.
//!
//! The box of a patch, or of a part of one, that is neither small nor parallel to its sides is mostly empty, and most
//! rays that meet it pass the patch by. A patch is a sheet, though: it lies in a **plate**, the space between two
//! parallel planes, across the normal in its middle. A ray whose way through the box is all above the plate, or all
//! below, does not meet the patch; nothing is looked up or built for it then.
//!
//! The nodes of the tree over patches have plates for their leaves, the nodes of a patch for their children: as
//! **heights** along the normals above the middles of their boxes. Heights of the ray where it enters and leaves a box
//! are compared with those: what lies between is between.
//!
//! # Why no plate hides a triangle that would be hit
//! Write u = 2^-24, and N for the sum of a normal's components, at most 381. [`LatticeRay`](super::LatticeRay) has the
//! rest of the words, and shows that a hit of a triangle has a point P of it, in its plate, which is within 8 u `reach`
//! along each axis of the point of the ray at P's depth t; and that t lies between where the ray is said to enter the
//! box and to leave it. So the height of the ray at t is within 8 N u `reach` of the plate. Between two ends heights lie
//! between those of the ends, and these are computed with errors of
//!
//! * 7 N u `reach` for that of the origin above the middle of the box: half a step and rounding to f32 of the origin,
//!   one step of the middle (in a node, where that is exact, one more difference; in a packet, of which the planes of
//!   boxes are seen from origins moved to either side, another rounding of these), the rounding of their difference, of
//!   products and of sums,
//! * 3 N u `reach` for the slope times t,
//! * 2 N u `reach` for their sum,
//!
//! 20 N u `reach` in all. Plates are thickened by 40 N u `reach` on either side when they are put into nodes, with the
//! longest `reach` there is, 3 times 2^24: 120 N, some 120 to 210 lattice steps. All other rounding is outwards.
//!
//! Where the ray ends does not matter: of a triangle that is nearly a line the distance is not known well, and t may
//! lie behind a hit of another one that is said to be farther.

use crate::math::Plate;
use crate::math::simd::Kernel;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// Lanes that have their plates together.
const LANES: usize = 8;

/// The plates of eight lanes, as they are seen from the middles of their boxes. Lanes without one have all of space.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Plates {
    /// x, y and z of normals.
    normals: [[i8; LANES]; 3],
    /// The heights of their middles, in units.
    middles: [i8; LANES],
    /// Half of their thickness.
    halves: [u8; LANES],
    unit: f32,
}

const _: () = assert!(size_of::<Plates>() == 44);

/// A plate as an origin sees it: heights above its middle, in lengths of the normal.
pub struct SeenPlate {
    /// Across the plate.
    pub normal: [f32; 3],
    /// The height of the origin.
    pub start: f32,
    /// Half of the plate's thickness.
    pub half: f32,
}

/// Plates of eight lanes as they are, as seen from the middles of their boxes.
#[derive(Clone, Copy, Debug)]
pub struct ExactPlates {
    normals: [[i8; LANES]; 3],
    middles: [f64; LANES],
    halves: [f64; LANES],
}

impl ExactPlates {
    /// Lanes without a plate.
    pub const NONE: Self = Self { normals: [[0; LANES]; 3], middles: [0.0; LANES], halves: [0.0; LANES] };

    /// Gives a lane its plate.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, plate: &Plate, middle_of_box: DVec3) {
        let from = Plate::height(plate.normal, middle_of_box);
        let (low, high) = (f64::from(plate.low) - from, f64::from(plate.high) - from);
        self.middles[lane] = 0.5 * (low + high);
        self.halves[lane] = 0.5 * (high - low) + plate.margin();
        for (of_axis, x) in self.normals.iter_mut().zip(plate.normal) {
            of_axis[lane] = x;
        }
    }

    /// The plates as they are kept: rounded outwards. (One step for all lanes after the other, so that the compiler
    /// makes vectors of them.)
    #[inline(always)]
    pub fn rounded(&self) -> Plates {
        let mut unit = 0.0;
        for lane in 0..LANES {
            let least = (self.middles[lane].abs() / 127.0).max(self.halves[lane] / 254.0);
            unit = if least > unit { least } else { unit };
        }
        let unit = (unit as f32).next_up();
        let per_unit = 1.0 / f64::from(unit);
        let (mut middles, mut halves) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            let middle = self.middles[lane] * per_unit;
            let whole = middle.round_ties_even();
            middles[lane] = whole as i8;
            halves[lane] = (self.halves[lane] * per_unit + (middle - whole).abs()).ceil() as u8;
        }
        Plates { normals: self.normals, middles, halves, unit }
    }
}

impl Plates {
    /// How far beyond its plate a ray stays that enters and leaves the boxes of the lanes there, lane by lane: zero or
    /// less if it meets the plate. Its origin is seen `from_middle` of each box.
    #[inline(always)]
    pub fn distance<K: Kernel>(
        &self,
        k: K,
        from_middle: [K::F; 3],
        direction: &[K::F; 3],
        enter: K::F,
        leave: K::F,
    ) -> K::F {
        let unit = k.splat(self.unit);
        let mut start = k.mul(k.widen_signed(&self.middles), k.sub(k.splat(-0.0), unit));
        let mut slope = k.splat(0.0);
        for axis in 0..3 {
            let normal = k.widen_signed(&self.normals[axis]);
            start = k.mul_add(normal, from_middle[axis], start);
            slope = k.mul_add(normal, direction[axis], slope);
        }
        let (first, last) = (k.mul_add(enter, slope, start), k.mul_add(leave, slope, start));
        let (above, below) = (k.min(first, last), k.sub(k.splat(-0.0), k.max(first, last)));
        k.sub(k.max(above, below), k.mul(k.widen(&self.halves), unit))
    }

    /// The plate of one lane as an origin sees it that lies `from_middle` of the lane's box.
    #[inline(always)]
    pub fn seen(&self, lane: usize, from_middle: [f32; 3]) -> SeenPlate {
        let (mut normal, mut start) = ([0.0; 3], 0.0);
        for axis in 0..3 {
            normal[axis] = f32::from(self.normals[axis][lane % LANES]);
            start += normal[axis] * from_middle[axis];
        }
        let middle = f32::from(self.middles[lane % LANES]) * self.unit;
        SeenPlate { normal, start: start - middle, half: f32::from(self.halves[lane % LANES]) * self.unit }
    }

    /// What a lane's plate is as it is kept: the heights of its middle above that of the box and of half its thickness,
    /// and their unit.
    #[cfg(test)]
    pub fn kept(&self, lane: usize) -> [f64; 3] {
        let unit = f64::from(self.unit);
        [unit * f64::from(self.middles[lane]), unit * f64::from(self.halves[lane]), unit]
    }
}
