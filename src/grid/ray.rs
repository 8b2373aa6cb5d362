//! A ray made ready for boxes and triangles of the lattice.

use super::TriangleId;
use crate::math::simd::{Kernel, Portable};
use glam::DVec3;

/// Greatest magnitude of a lattice coordinate of a grid vertex.
pub const LATTICE_LIMIT: f32 = 16_777_216.0;

/// By how much boxes grow, as a share of `reach` (see [`LatticeRay`]).
const SLACK: f32 = 20.0 / 16_777_216.0;

/// Rays that start outside the cube of this half-width are first moved up to it, in f64.
const START_LIMIT: f64 = 33_554_432.0;

/// Components of a scaled direction below this, 2^-64, count as zero.
const DUST: f64 = 5.421_010_862_427_522e-20;

/// Direction components between this and its reciprocal, 2^400, are made ready without looking at special cases.
const GREATEST_ORDINARY: f64 = f64::from_bits((1023 + 400) << 52);

/// A plane of a box: low x, y, z, then high x, y, z. (A type of its own, so that indexing six planes needs no check.)
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Plane {
    /// Least x.
    LowX = 0,
    /// Least y.
    LowY = 4,
    /// Least z.
    LowZ = 8,
    /// Greatest x.
    HighX = 12,
    /// Greatest y.
    HighY = 16,
    /// Greatest z.
    HighZ = 20,
}

impl Plane {
    const LOW: [Self; 3] = [Self::LowX, Self::LowY, Self::LowZ];
    const HIGH: [Self; 3] = [Self::HighX, Self::HighY, Self::HighZ];

    /// Where the plane starts in a list of six planes of four units each: so much the processor multiplies by itself.
    #[inline(always)]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Whether it is one of the greatest coordinates.
    #[inline(always)]
    pub(super) fn is_high(self) -> bool {
        self as u8 >= Self::HighX as u8
    }
}

/// An axis of lattice space.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

/// What follows from the signs of a direction's components and from their order by magnitude. (Aligned, so that it is
/// copied at once.)
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub(crate) struct Sides {
    /// The planes of a box where the ray enters, for x, y and z: low ones where the direction is positive.
    pub near: [Plane; 3],
    /// The planes where it leaves.
    pub far: [Plane; 3],
    /// Axes (x, y, z of the sheared space): z is that of the largest component; x and y are swapped if that is
    /// negative, which keeps the winding.
    pub axes: [Axis; 3],
}

impl Sides {
    /// By signs, times eight, and order. Bit k of the signs is set where the direction is negative along axis k; bits
    /// of the order by magnitude are x >= y, x >= z and y >= z.
    const TABLE: [Self; 64] = {
        let mut table = [Self::of(0, 0); 64];
        let mut i = 0;
        while i < 64 {
            table[i] = Self::of(i / 8, i % 8);
            i += 1;
        }
        table
    };

    const fn of(signs: usize, order: usize) -> Self {
        const LARGEST: [usize; 8] = [2, 2, 2, 0, 1, 1, 1, 0];
        let [mut near, mut far] = [Plane::LOW, Plane::HIGH];
        let mut k = 0;
        while k < 3 {
            if signs >> k & 1 == 1 {
                (near[k], far[k]) = (Plane::HIGH[k], Plane::LOW[k]);
            }
            k += 1;
        }
        let (axis, all) = (LARGEST[order], [Axis::X, Axis::Y, Axis::Z]);
        let (x, y) = (all[(axis + 1) % 3], all[(axis + 2) % 3]);
        let axes = if signs >> axis & 1 == 1 { [y, x, all[axis]] } else { [x, y, all[axis]] };
        Self { near, far, axes }
    }

    /// Of a direction: x, y, z and one to spare, twice.
    #[inline(always)]
    fn of_direction<K: Kernel>(k: K, direction: K::F) -> Self {
        /// For [`Kernel::shuffle`].
        const XXY: i32 = 0b11_01_00_00;
        const YZZ: i32 = 0b11_10_10_01;
        let magnitude = k.abs(direction);
        let order = k.le(k.shuffle::<YZZ>(magnitude), k.shuffle::<XXY>(magnitude)) as usize % 8;
        let signs = k.negative(direction) as usize % 8;
        Self::TABLE[order | signs << 3]
    }
}

/// x, y, z and anything, twice: so that what comes from boxes in the same order meets it in one operation.
pub(crate) type Twice = [f32; 8];

/// A ray in lattice space.
///
/// The direction is scaled by a power of two, so that its largest component is in [1, 2]: `t` inside lattice space
/// counts in units of the scaled direction, and [`Self::caller_t`] gives it in the caller's. Components below 2^-64 of
/// the largest count as zero.
/// *The ray* below is the one with the rounded direction, from `cell + fraction`.
///
/// # Why no box hides a triangle that would be hit
/// Write u = 2^-24 and D for the largest distance, along any axis, from the origin to a point of the lattice cube;
/// |origin| <= 2^25, and `reach` = |origin| + 2^24 >= D.
///
/// *Triangles.* Corners are taken relative to `cell` as integers, without error, so that distances from the origin keep
/// their relative precision: (v - o) is fl(fl(v - cell) - fraction), off by 2 u |v - o| at most. A vertex v is sheared
/// to v'_x = fl((v - o)_x - fl(S_x (v - o)_z)), |S_x| <= 1 (z stands for the axis of the largest component). Summing
/// the roundings, |v'_x - exact| <= u (3 |v_x - o_x| + 5 |v_z - o_z|) <= 8 u D. The signs of the edge functions are
/// exact for these v'. If they report a hit, some point P of the exact triangle has, at its own depth, a distance of at
/// most 8 u D along x and y from the ray. So the ray passes through every box around the triangle that is widened by 8
/// u D. (Nearer triangles err less: one that lies within L of the origin, by 8 u L.)
///
/// *Boxes.* A plane is tested as fl(plane * inv - fl(o * inv)), or for 8-bit boxes as
/// fl(q * step_inv + fl(fl(base - o) * inv)) with an exact `step_inv` but for the rounding of `inv` itself, and o
/// rounded to f32, by u |o|; the product may or may not be rounded before the sum. The errors, as distances along the
/// axis, are at most u |plane| + u |o| + 2 u D in the first case, and |plane| + |o| <= `reach`; in the second at most 2
/// u q step + 3 u |base - o| + u |sum| <= 8 u D, for no box is wider than 2 D. Both are at most 8 u `reach`.
///
/// All are covered by moving the near planes towards the origin and the far planes away from it by `slack` = 20 u
/// `reach`; this is done once per ray, in `near_origin` and `far_origin`, whose rounding takes 2 u `reach` of it at
/// most: 18 u `reach` >= 17 u `reach`. In a coordinate system of 2^24 steps, slack is 60 steps at most.
///
/// *Zero components* have `inv` = +-2^96, by sign. Where the origin is inside a widened slab, the distance to its
/// planes is at least 2 u `reach`, times 2^96: beyond any t; where it is outside, the entry is beyond any t likewise.
/// No operation on finite boxes gives infinity or NaN.
#[derive(Clone, Copy, Debug)]
pub struct LatticeRay {
    /// Origin moved along the direction's sign by the slack: near planes are measured from it.
    pub(crate) near_origin: Twice,
    /// Origin moved against the direction's sign: far planes are measured from it.
    pub(crate) far_origin: Twice,
    /// 1 / direction, finite.
    pub(crate) inv: Twice,
    /// The direction, components that count as zero too.
    pub(crate) towards: Twice,
    /// The origin relative to `cell`, within half a step: so rays that start on the surface start where they should.
    pub(crate) fraction: Twice,
    /// The lattice point nearest to the origin, and one number to spare; |coordinate| <= 2^25.
    pub(crate) cell: [i32; 4],
    pub(crate) sides: Sides,
    /// Woop's shear: d_x/d_z, d_y/d_z, 1/d_z.
    pub(crate) shear: [f32; 3],
    /// Hits beyond are ignored. Negative for a ray that hits nothing.
    pub(crate) t_max: f32,
    /// This triangle is not hit.
    pub(crate) skip: TriangleId,
    t_start: f64,
    t_unit: f64,
}

impl LatticeRay {
    /// The ray from `origin` along `direction`, both in lattice space; `t_max` in units of `direction`. The triangle
    /// `skip` is not hit ([`TriangleId::NONE`]: every triangle can be).
    ///
    /// The direction may have any length. If it is zero, or anything is not finite (but for `t_max`), the ray hits
    /// nothing.
    pub fn new(origin: DVec3, direction: DVec3, t_max: f32, skip: TriangleId) -> Self {
        let four = |v: DVec3| [v.x, v.y, v.z, 0.0];
        Self::of_lanes(Portable, four(origin), four(direction), t_max, skip)
    }

    /// [`Self::new`] of vectors in lanes 0 to 2; what is in the fourth does not matter.
    #[inline(always)]
    pub fn of_lanes<K: Kernel>(k: K, origin: K::D, direction: K::D, t_max: f32, skip: TriangleId) -> Self {
        let magnitude = k.abs4(direction);
        let largest = k.greatest_of_three(magnitude);
        let is_ordinary = k.lt4(k.splat4(least_ordinary(largest)), magnitude)
            & k.lt4(k.abs4(origin), k.splat4(START_LIMIT))
            & k.lt4(k.splat4(largest), k.splat4(GREATEST_ORDINARY))
            & 7
            == 7
            && t_max >= 0.0;
        // The start is chosen, not the ray: so the ray is written where it stays, once.
        let start = if is_ordinary {
            let unit = power_of_two_below(largest);
            let t_unit = reciprocal_of_power(unit);
            let direction = k.floats_of(k.mul4(direction, k.splat4(t_unit)));
            let inv = k.div(k.splat(1.0), direction);
            Start { origin, direction, inv, t_max: (f64::from(t_max) * unit) as f32, t_start: 0.0, t_unit }
        } else {
            Start::of_numbers(k, Start::at_the_extremes(k.store4(origin), k.store4(direction), t_max))
        };
        Self::from_start(k, start, skip)
    }

    #[inline(always)]
    fn from_start<K: Kernel>(k: K, start: Start<K::D, K::F>, skip: TriangleId) -> Self {
        let Start { origin: start, direction, inv, t_max, t_start, t_unit } = start;
        let whole = nearest_whole(k, start);
        let slack = (k.greatest_of_three(k.abs4(start)) as f32 + LATTICE_LIMIT) * SLACK;
        let forward = k.with_sign(k.splat(slack), direction);
        let origin = k.floats_of(start);
        let sides = Sides::of_direction(k, direction);
        let [d, inverses] = [k.store(direction), k.store(inv)];
        let of = |lanes: &[f32; 8], axis: usize| lanes[axis % 8];
        let [x, y, z] = sides.axes.map(|axis| axis as usize);
        Self {
            near_origin: k.store(k.add(origin, forward)),
            far_origin: k.store(k.sub(origin, forward)),
            inv: inverses,
            towards: d,
            fraction: k.store(k.floats_of(k.sub4(start, whole))),
            cell: k.nearest4(whole),
            sides,
            shear: [of(&d, x) / of(&d, z), of(&d, y) / of(&d, z), of(&inverses, z)],
            t_max,
            skip,
            t_start,
            t_unit,
        }
    }

    /// The origin as triangles see it.
    #[cfg(test)]
    pub(crate) fn origin(&self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|k| f64::from(self.cell[k]) + f64::from(self.fraction[k])))
    }

    /// A ray parameter of lattice space in units of the direction that [`Self::new`] was given. Monotone, finite for
    /// finite `t`.
    #[inline]
    pub fn caller_t(&self, t: f32) -> f32 {
        caller_t(t, self.t_start, self.t_unit)
    }

    /// The inverse of [`Self::caller_t`], rounded up so that nothing at `t` or before lies beyond it.
    pub fn not_below(&self, t: f32) -> f32 {
        let inner = f64::from(t) / self.t_unit - self.t_start;
        (inner + inner.abs() * 1e-6 + self.t_start.abs() * 1e-12) as f32
    }

    /// True for one of so many rays, a power of two, without further meaning: of those from one point as of those along
    /// one direction.
    #[inline(always)]
    pub fn is_one_in(&self, n: u32) -> bool {
        let [x, y, z, ..] = self.cell;
        ((x ^ y ^ z).cast_unsigned() ^ self.shear[0].to_bits()).is_multiple_of(n)
    }

    /// The direction as boxes see it: scaled, and rounded twice more than that of the ray.
    pub fn direction(&self) -> DVec3 {
        let [x, y, z, ..] = self.inv;
        1.0 / DVec3::new(f64::from(x), f64::from(y), f64::from(z))
    }

    /// The cell of the triangle that is not hit.
    #[inline(always)]
    pub fn start_cell(&self) -> [u32; 2] {
        [self.skip.i(), self.skip.j()]
    }

    /// Where the ray ends, in lattice space's units of t; negative for a ray that hits nothing.
    #[inline(always)]
    pub fn t_max(&self) -> f32 {
        self.t_max
    }
}

/// [`LatticeRay::caller_t`] of a ray that starts and counts so.
#[inline(always)]
pub(super) fn caller_t(t: f32, t_start: f64, t_unit: f64) -> f32 {
    let t = (f64::from(t) + t_start) * t_unit;
    if t.is_finite() { t.min(f64::from(f32::MAX)) as f32 } else { f32::INFINITY }
}

/// Magnitudes of an ordinary direction whose greatest is `largest` are above.
#[inline(always)]
fn least_ordinary(largest: f64) -> f64 {
    (largest * (2.0 * DUST)).max(1.0 / GREATEST_ORDINARY)
}

/// Whether a direction with these least and greatest magnitudes is made ready without looking at special cases.
#[inline(always)]
pub(super) fn is_ordinary_direction(least: f64, largest: f64) -> bool {
    (least_ordinary(largest) < least) & (largest < GREATEST_ORDINARY)
}

/// Whether rays start at this point (in lanes 0 to 2), as it is.
#[inline(always)]
pub(super) fn is_ordinary_origin<K: Kernel>(k: K, origin: K::D) -> bool {
    k.lt4(k.abs4(origin), k.splat4(START_LIMIT)) & 7 == 7
}

/// Where a ray starts and how it counts t.
struct Start<D, F> {
    origin: D,
    /// Scaled.
    direction: F,
    inv: F,
    t_max: f32,
    t_start: f64,
    t_unit: f64,
}

impl Start<[f64; 4], [f32; 3]> {
    /// Whatever the numbers are.
    #[cold]
    #[inline(never)]
    fn at_the_extremes(origin: [f64; 4], direction: [f64; 4], t_max: f32) -> Self {
        let [origin, direction] = [origin, direction].map(|v| DVec3::new(v[0], v[1], v[2]));
        let largest = direction.abs().max_element();
        let is_valid = largest > 0.0 && direction.is_finite() && origin.is_finite() && t_max >= 0.0;
        let (origin, direction, largest) =
            if is_valid { (origin, direction, largest) } else { (DVec3::ZERO, DVec3::X, 1.0) };
        let t_unit = power_of_two_below(largest).recip();
        let scaled = direction * t_unit;
        let t_start = if is_valid { start(origin, scaled) } else { None };
        let t_max = t_start.map_or(-1.0, |t_start| (f64::from(t_max) / t_unit - t_start) as f32);
        let t_start = t_start.unwrap_or(0.0);
        let direction = [without_dust(scaled.x), without_dust(scaled.y), without_dust(scaled.z)];
        let start = origin + t_start * scaled;
        let origin = [start.x, start.y, start.z, 0.0];
        Self { origin, direction, inv: direction.map(inverse), t_max, t_start, t_unit }
    }
}

impl<D, F> Start<D, F> {
    /// The same in lanes.
    #[inline(always)]
    fn of_numbers<K: Kernel<D = D, F = F>>(k: K, numbers: Start<[f64; 4], [f32; 3]>) -> Self {
        let twice = |[x, y, z]: [f32; 3]| [x, y, z, 1.0, x, y, z, 1.0];
        let Start { origin, direction, inv, t_max, t_start, t_unit } = numbers;
        let [direction, inv] = [twice(direction), twice(inv)];
        Self { origin: k.load4(&origin), direction: k.load(&direction), inv: k.load(&inv), t_max, t_start, t_unit }
    }
}

/// The power of two p with p <= x < 2p, for a positive normal x; the smallest normal number for a subnormal one.
#[inline(always)]
fn power_of_two_below(x: f64) -> f64 {
    power_of_two_of(x).max(f64::MIN_POSITIVE)
}

/// The same of a normal number.
#[inline(always)]
pub(super) fn power_of_two_of(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000)
}

/// 1 / p for a power of two between 2^-1022 and 2^1021, without dividing.
#[inline(always)]
pub(super) fn reciprocal_of_power(p: f64) -> f64 {
    const TWICE_THE_BIAS: u64 = 2046 << 52;
    f64::from_bits(TWICE_THE_BIAS - p.to_bits())
}

/// The whole numbers nearest to coordinates, the even one of two at ties.
#[inline(always)]
fn nearest_whole<K: Kernel>(k: K, x: K::D) -> K::D {
    // In this range doubles are whole numbers, so that the sum is rounded to one.
    const TO_WHOLE: f64 = 6_755_399_441_055_744.0;
    k.sub4(k.add4(x, k.splat4(TO_WHOLE)), k.splat4(TO_WHOLE))
}

/// 1 / d, finite.
#[inline(always)]
fn inverse(d: f32) -> f32 {
    const GREATEST: f32 = 7.922_816_3e28;
    if d == 0.0 { GREATEST.copysign(d) } else { 1.0 / d }
}

/// Rounded to f32, with the sign of the zero kept, and zero below 2^-64.
#[inline(always)]
fn without_dust(d: f64) -> f32 {
    if d.abs() < DUST { 0.0f32.copysign(d as f32) } else { d as f32 }
}

/// Where along the ray to start: 0 from within the start cube, else where it enters; `None` if it does not.
#[inline(always)]
fn start(origin: DVec3, direction: DVec3) -> Option<f64> {
    if origin.abs().max_element() <= START_LIMIT { Some(0.0) } else { start_at_cube(origin, direction) }
}

/// Where a ray from outside enters the start cube.
#[cold]
fn start_at_cube(origin: DVec3, direction: DVec3) -> Option<f64> {
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for (o, d) in origin.to_array().into_iter().zip(direction.to_array()) {
        if d == 0.0 && o.abs() > START_LIMIT {
            return None;
        } else if d != 0.0 {
            enter = enter.max((-START_LIMIT.copysign(d) - o) / d);
            leave = leave.min((START_LIMIT.copysign(d) - o) / d);
        }
    }
    (enter <= leave).then_some(enter)
}
