//! Rays from one point against boxes and triangles: eight at a time.
//!
//! A **packet** is up to eight rays that start at one point and go about the same way: camera rays of pixels side by
//! side. What depends on the origin alone is worked out once for all: where planes of boxes and vertices lie seen from
//! it. Boxes are tested twice. First eight boxes against all rays, by the least and the greatest inverse of their
//! directions; most boxes are missed by that. What is met is tested against each ray, eight rays at a time, and only
//! then come triangles. So work is shared, and what remains for a single ray does not wait for what was done for
//! another.
//!
//! Rays of a packet enter boxes by the same planes and see triangles along the same axis ([`Sides`]); others are traced
//! one by one.
//!
//! # Why the answers are those of single rays
//! *Triangles* are tested by the same operations as for [`LatticeRay`], on the same numbers, and of two hits at equal t
//! the smaller triangle wins.
//!
//! *Boxes* are conservative for every ray, with the slack that origins are moved by there. A plane is tested as
//! fl(fl(plane - o) * inv); its errors, as distances along the axis, are at most 3 u |plane - o|. An 8-bit plane is
//! tested as fl(fl(q * step + fl(base - o)) * inv), with an exact product of q and step, by u |base - o| more. A plane
//! lies within twice `reach`: all is below 8 u `reach`, as [`LatticeRay`] allows for.
//! For any `inv` between the least and the greatest one, of one sign, fl(d * inv) lies between their products, because
//! rounding keeps the order: so if one ray meets a box, all together may.
//!
//! *But for* triangles that have no area: where a ray meets one is not known well, and the boxes beyond are left out.
//! Which of several is hit depends on the order of visits, alone as in a packet.
//!
//! Wald, Slusallek, Benthin, Wagner, "Interactive Rendering with Coherent Ray Tracing", 2001; Boulos, Wald, Shirley,
//! "Geometric and arithmetic culling methods for entire ray packets", 2006.

mod boxes;
mod triangles;

use super::plates::{Plates, SeenPlate};
use super::ray::{
    Axis, LatticeRay, Plane, Sides, caller_t, is_ordinary_direction, is_ordinary_origin, power_of_two_of,
    reciprocal_of_power,
};
use super::{LatticeHit, TriangleId};
use crate::math::simd::Kernel;
use glam::DVec3;

pub use boxes::SeenBoxes;

/// Rays in a packet, at most.
pub const PACKET: usize = 8;

/// A number for each ray.
type OfRays<T> = [T; PACKET];

/// Rays from one origin, in lattice space, and the nearest hit of each so far.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct RayPacket {
    /// 1 / direction, by axis.
    inv: [OfRays<f32>; 3],
    /// Directions.
    towards: [OfRays<f32>; 3],
    /// Hits beyond are ignored; negative for places without a ray.
    t_max: OfRays<f32>,
    /// The least and the greatest inverse, by axis.
    inv_range: [[f32; 2]; 3],
    /// Woop's shear of each ray.
    shear: OfRays<[f32; 3]>,
    /// The first ray, of which origin and sides are those of all.
    first: LatticeRay,
    t_unit: OfRays<f64>,
    hits: OfRays<LatticeHit>,
}

impl Default for RayPacket {
    /// Without rays.
    fn default() -> Self {
        Self {
            inv: [[1.0; PACKET]; 3],
            towards: [[1.0; PACKET]; 3],
            t_max: [-1.0; PACKET],
            inv_range: [[1.0; 2]; 3],
            shear: [[0.0; 3]; PACKET],
            first: LatticeRay::new(DVec3::ZERO, DVec3::ONE, -1.0, TriangleId::NONE),
            t_unit: [1.0; PACKET],
            hits: [LatticeHit::none(-1.0); PACKET],
        }
    }
}

impl RayPacket {
    /// Replaces the packet by the rays from an origin (lanes 0 to 2) along `directions` (x, y and z of each), which end
    /// at `t_max`; a negative one marks a place without a ray, whose direction must be that of another ray. No triangle
    /// is left out. Returns `false` if these are no packet, because they go too different ways or are too special: then
    /// it means nothing.
    #[inline(always)]
    pub fn set<K: Kernel>(&mut self, k: K, origin: K::D, directions: &[OfRays<f64>; 3], t_max: &OfRays<f32>) -> bool {
        let Some(Scaled { direction, t_max, t_unit }) = Scaled::new(directions, t_max) else { return false };
        let [x, y, z] = directions;
        self.first = LatticeRay::of_lanes(k, origin, k.load4(&[x[0], y[0], z[0], 0.0]), 0.0, TriangleId::NONE);
        let Sides { axes, .. } = self.first.sides;
        let along = [k.load(&direction[0]), k.load(&direction[1]), k.load(&direction[2])];
        if !(is_ordinary_origin(k, origin) && have_sides(k, along, &self.first.sides)) {
            return false;
        }
        let one = k.splat(1.0);
        self.inv = [k.store(k.div(one, along[0])), k.store(k.div(one, along[1])), k.store(k.div(one, along[2]))];
        self.towards = direction;
        self.inv_range = [range(&self.inv[0]), range(&self.inv[1]), range(&self.inv[2])];
        let [a, b, c] = axes.map(|axis| axis as usize % 3);
        let [shear_x, shear_y] = [k.store(k.div(along[a], along[c])), k.store(k.div(along[b], along[c]))];
        for i in 0..PACKET {
            self.shear[i] = [shear_x[i], shear_y[i], self.inv[c][i]];
            (self.hits[i].t, self.hits[i].triangle) = (t_max[i], TriangleId::NONE);
        }
        (self.t_max, self.t_unit) = (t_max, t_unit);
        true
    }

    /// What a ray has hit.
    #[inline(always)]
    pub fn hit(&self, ray: usize) -> Option<&LatticeHit> {
        Some(&self.hits[ray]).filter(|hit| hit.is_some())
    }

    /// A hit to be completed.
    #[inline(always)]
    pub(super) fn hit_mut(&mut self, ray: usize) -> &mut LatticeHit {
        &mut self.hits[ray % PACKET]
    }

    /// Of eight boxes whose planes lie at these distances from the origin, those that a ray meets, as bits.
    #[inline(always)]
    pub(super) fn met_by<K: Kernel>(&self, k: K, ray: usize, near: [K::F; 3], far: [K::F; 3]) -> u32 {
        let (mut enter, mut leave) = (k.splat(0.0), k.splat(self.t_max[ray % PACKET]));
        for axis in 0..3 {
            let inv = k.splat(self.inv[axis][ray % PACKET]);
            enter = k.max(k.mul(near[axis], inv), enter);
            leave = k.min(k.mul(far[axis], inv), leave);
        }
        k.le(enter, leave)
    }

    /// The first ray, whose origin and axes are those of all.
    #[inline(always)]
    pub(super) fn first(&self) -> &LatticeRay {
        &self.first
    }

    /// Shear of a ray, and where it ends.
    #[inline(always)]
    pub(super) fn ray(&self, ray: usize) -> ([f32; 3], f32) {
        (self.shear[ray % PACKET], self.t_max[ray % PACKET])
    }

    /// Takes a hit if it is nearer than what is there, or as near and of the smaller triangle; says whether it did.
    #[inline(always)]
    pub(super) fn take(&mut self, ray: usize, t: f32, triangle: TriangleId, barycentrics: [f32; 2]) -> bool {
        let hit = &mut self.hits[ray % PACKET];
        let is_nearer = hit.yields_to(t, triangle);
        if is_nearer {
            (hit.t, hit.triangle, hit.barycentrics) = (t, triangle, barycentrics);
            self.t_max[ray % PACKET] = t;
        }
        is_nearer
    }

    /// A ray parameter of lattice space in units of the direction that [`Self::set`] was given.
    #[inline(always)]
    pub fn caller_t(&self, ray: usize, t: f32) -> f32 {
        caller_t(t, 0.0, self.t_unit[ray])
    }

    /// Beyond there is nothing to be hit by any of the rays, in units of the directions that [`Self::set`] was given.
    #[inline(always)]
    pub fn farthest(&self) -> f32 {
        let mut farthest = f32::MIN;
        for ray in 0..PACKET {
            let t = self.caller_t(ray, self.t_max[ray]);
            farthest = if t > farthest { t } else { farthest };
        }
        farthest
    }

    /// The planes of a box where rays enter and where they leave, and origins to measure them from.
    #[inline(always)]
    pub fn sides(&self) -> [([Plane; 3], &[f32; 8]); 2] {
        let Sides { near, far, .. } = self.first.sides;
        [(near, &self.first.near_origin), (far, &self.first.far_origin)]
    }

    /// Where rays enter eight boxes whose planes lie at these distances from the origin at least, and where they leave
    /// them at most: some ray may meet those that are not left before they are entered.
    #[inline(always)]
    pub fn range_within<K: Kernel>(&self, k: K, near: [K::F; 3], far: [K::F; 3]) -> (K::F, K::F) {
        let (mut enter, mut leave) = (k.splat(0.0), k.splat(f32::MAX));
        for axis in 0..3 {
            let [least, greatest] = [k.splat(self.inv_range[axis][0]), k.splat(self.inv_range[axis][1])];
            enter = k.max(k.min(k.mul(near[axis], least), k.mul(near[axis], greatest)), enter);
            leave = k.min(k.max(k.mul(far[axis], least), k.mul(far[axis], greatest)), leave);
        }
        (enter, leave)
    }

    /// The rays that meet a box whose planes lie at these distances from the origin, before their ends, as bits.
    #[inline(always)]
    pub fn meeting<K: Kernel>(&self, k: K, near: [f32; 3], far: [f32; 3]) -> u32 {
        let (enter, leave) = self.through(k, near, far);
        k.le(enter, k.min(leave, k.load(&self.t_max)))
    }

    /// Those of them that meet a lane's plate within the box.
    #[inline(always)]
    pub fn meeting_plate<K: Kernel>(&self, k: K, [near, far]: [[f32; 3]; 2], plates: &Plates, lane: usize) -> u32 {
        let (enter, leave) = self.through(k, near, far);
        let boxes = k.le(enter, k.min(leave, k.load(&self.t_max)));
        // Origins are moved for near and far planes by as much to either side.
        let from_middle = [0, 1, 2].map(|axis| -0.5 * (near[axis] + far[axis]));
        let SeenPlate { normal, start, half } = plates.seen(lane, from_middle);
        let (mut slope, start, half) = (k.splat(0.0), k.splat(start), k.splat(half));
        for (of_axis, normal) in self.towards.iter().zip(normal) {
            slope = k.mul_add(k.splat(normal), k.load(of_axis), slope);
        }
        let (first, last) = (k.mul_add(enter, slope, start), k.mul_add(leave, slope, start));
        boxes & k.le(k.min(first, last), half) & k.le(k.sub(k.splat(-0.0), half), k.max(first, last))
    }

    /// Where rays enter a box, at 0 or later, and where they leave it.
    #[inline(always)]
    fn through<K: Kernel>(&self, k: K, near: [f32; 3], far: [f32; 3]) -> (K::F, K::F) {
        let (mut enter, mut leave) = (k.splat(0.0), k.splat(f32::MAX));
        for axis in 0..3 {
            let inv = k.load(&self.inv[axis]);
            enter = k.max(k.mul(k.splat(near[axis]), inv), enter);
            leave = k.min(k.mul(k.splat(far[axis]), inv), leave);
        }
        (enter, leave)
    }
}

/// Directions made ready for a lattice, as for [`LatticeRay`].
struct Scaled {
    direction: [OfRays<f32>; 3],
    t_max: OfRays<f32>,
    t_unit: OfRays<f64>,
}

impl Scaled {
    /// `None` if one of them is no ordinary direction. (One step for all rays after the other, so that the compiler
    /// makes vectors of them.)
    #[inline(always)]
    fn new(directions: &[OfRays<f64>; 3], t_max: &OfRays<f32>) -> Option<Self> {
        let largest = largest_of_ordinary(directions)?;
        let (mut t_unit, mut ends, mut direction) = ([0.0; PACKET], [0.0; PACKET], [[0.0; PACKET]; 3]);
        for i in 0..PACKET {
            let unit = power_of_two_of(largest[i]);
            t_unit[i] = reciprocal_of_power(unit);
            ends[i] = (f64::from(t_max[i]) * unit) as f32;
        }
        for axis in 0..3 {
            for i in 0..PACKET {
                direction[axis][i] = (directions[axis][i] * t_unit[i]) as f32;
            }
        }
        Some(Self { direction, t_max: ends, t_unit })
    }
}

/// The largest magnitude of each direction; `None` if one is not ordinary.
#[inline(always)]
fn largest_of_ordinary([x, y, z]: &[OfRays<f64>; 3]) -> Option<OfRays<f64>> {
    let (mut largest, mut least, mut sum) = ([0.0; PACKET], [0.0; PACKET], [0.0; PACKET]);
    for i in 0..PACKET {
        let [a, b, c] = [x[i].abs(), y[i].abs(), z[i].abs()];
        let (ab, ba) = if a > b { (a, b) } else { (b, a) };
        largest[i] = if ab > c { ab } else { c };
        least[i] = if ba < c { ba } else { c };
        sum[i] = a + b + c;
    }
    let mut are_ordinary = true;
    for i in 0..PACKET {
        // The sum tells of a NaN, which comparisons pass over.
        are_ordinary &= is_ordinary_direction(least[i], largest[i]) & (sum[i] <= 3.0 * largest[i]);
    }
    are_ordinary.then_some(largest)
}

/// Whether directions lead into boxes by the planes of `sides` and see triangles along their axis.
#[inline(always)]
fn have_sides<K: Kernel>(k: K, [x, y, z]: [K::F; 3], sides: &Sides) -> bool {
    /// The lanes of all rays.
    const ALL: u32 = (1 << PACKET) - 1;
    let signs = [k.negative(x), k.negative(y), k.negative(z)];
    let is_negative = sides.near.map(|plane| plane.is_high());
    let same_signs = (0..3).all(|axis| signs[axis] == if is_negative[axis] { ALL } else { 0 });
    let [a, b, c] = [k.abs(x), k.abs(y), k.abs(z)];
    let (a_b, a_c, b_c) = (k.le(b, a), k.le(c, a), k.le(c, b));
    let x_leads = a_b & a_c;
    let y_leads = b_c & !a_b & ALL;
    let leading = match sides.axes[2] {
        Axis::X => x_leads,
        Axis::Y => y_leads,
        Axis::Z => ALL & !(x_leads | y_leads),
    };
    same_signs && leading == ALL
}

/// The least and the greatest.
#[inline(always)]
fn range(numbers: &OfRays<f32>) -> [f32; 2] {
    let (mut least, mut greatest) = (numbers[0], numbers[0]);
    for &x in &numbers[1..] {
        least = if x < least { x } else { least };
        greatest = if x > greatest { x } else { greatest };
    }
    [least, greatest]
}
