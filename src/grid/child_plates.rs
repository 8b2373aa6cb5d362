//! The plates of a node's children, which spare rays those that they pass within their boxes: as
//! `scene/accel/plates.rs` has it for patches, which tells why they hide nothing that would be hit. The children are
//! parts of one patch, so that all plates are across one normal.

use super::boxes::{ALL_X, ALL_Y, ALL_Z, Head};
use super::{LatticeRay, SeenPlate};
use crate::math::Plate;
use crate::math::simd::Kernel;
use bytemuck::{Pod, Zeroable};
use glam::IVec3;

/// Heights of sixteen lanes above the lowest one, in units.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ChildPlates {
    low: [u8; 16],
    high: [u8; 16],
    /// x, y, z and zero, twice.
    normal: [i8; 8],
    /// The lowest height, above that of the head's corner.
    lowest: f32,
    unit: f32,
}

const _: () = assert!(size_of::<ChildPlates>() == 48);

/// Where a ray starts above the lowest height, and how it rises: in every lane.
pub(super) struct Rise<K: Kernel> {
    start: K::F,
    slope: K::F,
}

impl ChildPlates {
    /// Sets the plates of some lanes, which have one normal; heights are seen from `corner`.
    #[inline(always)]
    pub fn set<'a>(&mut self, corner: [i32; 3], plates: impl Iterator<Item = (&'a Plate, usize)> + Clone) {
        let normal = plates.clone().next().map_or([0; 3], |(plate, _)| plate.normal);
        debug_assert!(plates.clone().all(|(plate, _)| plate.normal == normal));
        let below = Plate::height(normal, IVec3::from_array(corner).as_dvec3());
        let ends = |plate: &Plate| {
            let margin = plate.margin();
            [f64::from(plate.low) - below - margin, f64::from(plate.high) - below + margin]
        };
        let all = plates.clone().map(|(plate, _)| ends(plate));
        let [lowest, highest] = all.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or_default();
        let lowest = (lowest as f32).next_down();
        let unit = (((highest - f64::from(lowest)) / 255.0) as f32).next_up();
        let [x, y, z] = normal;
        (self.normal, self.lowest, self.unit) = ([x, y, z, 0, x, y, z, 0], lowest, unit);
        for (plate, lane) in plates {
            let [low, high] = ends(plate).map(|height| (height - f64::from(lowest)) / f64::from(unit));
            (self.low[lane], self.high[lane]) = (low.floor() as u8, high.ceil() as u8);
        }
    }

    /// The plates seen from a point, for a head with that corner.
    #[inline(always)]
    pub fn seen_from(&self, corner: [i32; 3], origin: [i32; 3]) -> SeenPlates<'_> {
        let (mut normal, mut start) = ([0.0; 3], -self.lowest);
        for axis in 0..3 {
            normal[axis] = f32::from(self.normal[axis]);
            start += normal[axis] * (origin[axis] as f32 - corner[axis] as f32);
        }
        SeenPlates { plates: self, normal, start }
    }

    /// What a ray makes of the plates.
    #[inline(always)]
    pub fn rise<K: Kernel>(&self, k: K, head: &Head, ray: &LatticeRay) -> Rise<K> {
        let normal = k.widen_signed(&self.normal);
        let from_corner = k.sub(k.floats_twice(&ray.cell), k.floats_twice(head.frame()));
        let start = k.sub(sum_of_three(k, k.mul(normal, from_corner)), k.splat(self.lowest));
        Rise { start, slope: sum_of_three(k, k.mul(normal, k.load(&ray.towards))) }
    }

    /// Lanes 0 to 7 or 8 to 15 whose plates a ray meets on its way through their boxes, which it enters and leaves
    /// there, as bits.
    #[inline(always)]
    pub fn met<K: Kernel>(&self, k: K, half: usize, rise: &Rise<K>, enter: K::F, leave: K::F) -> u32 {
        let unit = k.splat(self.unit);
        let (first, last) = (k.mul_add(enter, rise.slope, rise.start), k.mul_add(leave, rise.slope, rise.start));
        let low = k.mul(k.widen(eight(&self.low, half)), unit);
        let high = k.mul(k.widen(eight(&self.high, half)), unit);
        k.le(k.min(first, last), high) & k.le(low, k.max(first, last))
    }
}

/// Plates as rays of a packet see them.
pub struct SeenPlates<'b> {
    plates: &'b ChildPlates,
    normal: [f32; 3],
    start: f32,
}

impl SeenPlates<'_> {
    /// That of a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> SeenPlate {
        let ChildPlates { low, high, unit, .. } = self.plates;
        let [low, high] = [low[lane % 16], high[lane % 16]];
        SeenPlate { normal: self.normal, start: self.start, low: f32::from(low) * unit, high: f32::from(high) * unit }
    }
}

/// Lanes 0 to 7 or 8 to 15.
#[inline(always)]
fn eight(lanes: &[u8; 16], half: usize) -> &[u8; 8] {
    lanes[8 * half..].first_chunk().expect("eight lanes")
}

/// The sum of lanes 0 to 2 of each half, in every lane.
#[inline(always)]
fn sum_of_three<K: Kernel>(k: K, x: K::F) -> K::F {
    k.add(k.add(k.shuffle::<ALL_X>(x), k.shuffle::<ALL_Y>(x)), k.shuffle::<ALL_Z>(x))
}
