//! A ray made ready for boxes and triangles of the lattice.

use super::TriangleId;
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

/// A plane of a box, as an index: low x, y, z, then high x, y, z. (A type of its own, so that indexing six planes needs no check.)
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(usize)]
pub enum Plane {
    /// Least x.
    LowX,
    /// Least y.
    LowY,
    /// Least z.
    LowZ,
    /// Greatest x.
    HighX,
    /// Greatest y.
    HighY,
    /// Greatest z.
    HighZ,
}

impl Plane {
    /// Planes where a ray enters, by the signs of its direction: bit k is set where it is negative along axis k.
    const NEAR: [[Self; 3]; 8] = Self::sides_by_signs([Self::LowX, Self::LowY, Self::LowZ], Self::HIGH);
    /// Planes where it leaves.
    const FAR: [[Self; 3]; 8] = Self::sides_by_signs(Self::HIGH, [Self::LowX, Self::LowY, Self::LowZ]);
    const HIGH: [Self; 3] = [Self::HighX, Self::HighY, Self::HighZ];

    const fn sides_by_signs(positive: [Self; 3], negative: [Self; 3]) -> [[Self; 3]; 8] {
        let mut table = [positive; 8];
        let mut i = 0;
        while i < 24 {
            if (i / 3) >> (i % 3) & 1 == 1 {
                table[i / 3][i % 3] = negative[i % 3];
            }
            i += 1;
        }
        table
    }
}

/// A ray in lattice space.
///
/// The direction is scaled by a power of two, so that its largest component is in [1, 2]: `t` inside lattice space counts in units of
/// the scaled direction, and [`Self::caller_t`] gives it in the caller's. Components below 2^-64 of the largest count as zero.
/// *The ray* below is the one with the rounded direction, from `cell + fraction`.
///
/// # Why no box hides a triangle that would be hit
/// Write u = 2^-24 and D for the largest distance, along any axis, from the origin to a point of the lattice cube; |origin| <= 2^25, and
/// `reach` = |origin| + 2^24 >= D.
///
/// *Triangles.* Corners are taken relative to `cell` as integers, without error, so that distances from the origin keep their relative precision:
/// (v - o) is fl(fl(v - cell) - fraction), off by 2 u |v - o| at most. A vertex v is sheared to
/// v'_x = fl((v - o)_x - fl(S_x (v - o)_z)), |S_x| <= 1 (z stands for the axis of the largest component). Summing the roundings,
/// |v'_x - exact| <= u (3 |v_x - o_x| + 5 |v_z - o_z|) <= 8 u D. The signs of the edge functions are exact for these v'.
/// If they report a hit, some point P of the exact triangle has, at its own depth, a distance of at most 8 u D along x and y from the ray.
/// So the ray passes through every box around the triangle that is widened by 8 u D. (Nearer triangles err less: one that lies within L of the
/// origin, by 8 u L.)
///
/// *Boxes.* A plane is tested as fl(fl(plane - o) * inv), or for 8-bit boxes as fl(fl(q * step_inv) + fl(fl(base - o) * inv)) with an exact
/// `step_inv` but for the rounding of `inv` itself, and o rounded to f32, by u |o|. The errors, as distances along the axis, are at most 3 u D in the
/// first case; in the second at most 2 u q step + 3 u |base - o| + u |sum| <= 8 u D, for no box is wider than 2 D.
///
/// All are covered by moving the near planes towards the origin and the far planes away from it by `slack` = 20 u `reach`; this
/// is done once per ray, in `near_origin` and `far_origin`, whose rounding takes 2 u `reach` of it at most: 18 u `reach` >= 17 u `reach`. In a coordinate system of 2^24 steps, slack is 60 steps at most.
///
/// *Zero components* have `inv` = +-2^96, by sign. Where the origin is inside a widened slab, the distance to its planes is at least 2 u `reach`, times 2^96: beyond
/// any t; where it is outside, the entry is beyond any t likewise. No operation on finite boxes gives infinity or NaN.
#[derive(Clone, Copy, Debug)]
pub struct LatticeRay {
    /// The lattice point nearest to the origin; |coordinate| <= 2^25.
    pub(crate) cell: [i32; 3],
    /// The origin relative to `cell`, within half a step: so rays that start on the surface start where they should.
    pub(crate) fraction: [f32; 3],
    /// Origin moved along the direction's sign by the slack: near planes are measured from it.
    pub(crate) near_origin: [f32; 3],
    /// Origin moved against the direction's sign: far planes are measured from it.
    pub(crate) far_origin: [f32; 3],
    /// 1 / direction, finite.
    pub(crate) inv: [f32; 3],
    /// The planes of a box where the ray enters, for x, y and z: low ones where the direction is positive.
    pub(crate) near_planes: [Plane; 3],
    /// The planes where it leaves.
    pub(crate) far_planes: [Plane; 3],
    /// Axes (x, y, z of the sheared space): z is that of the largest component; x and y are swapped if that is negative, which keeps the winding.
    pub(crate) axes: [usize; 3],
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
    /// The ray from `origin` along `direction`, both in lattice space; `t_max` in units of `direction`. The triangle `skip` is not hit
    /// ([`TriangleId::NONE`]: every triangle can be).
    ///
    /// The direction may have any length. If it is zero, or anything is not finite (but for `t_max`), the ray hits nothing.
    #[inline(always)]
    pub fn new(origin: DVec3, direction: DVec3, t_max: f32, skip: TriangleId) -> Self {
        let magnitude = direction.abs();
        let largest = magnitude.max_element();
        let is_ordinary = magnitude.cmpge(DVec3::splat((largest * (2.0 * DUST)).max(1.0 / GREATEST_ORDINARY))).all()
            && largest <= GREATEST_ORDINARY
            && origin.abs().cmple(DVec3::splat(START_LIMIT)).all()
            && t_max >= 0.0;
        // The start is chosen, not the ray: so the ray is written where it stays, once.
        let start = if is_ordinary {
            let unit = power_of_two_below(largest);
            let t_unit = reciprocal_of_power(unit);
            let direction = (direction * t_unit).as_vec3().to_array();
            let inv = [1.0 / direction[0], 1.0 / direction[1], 1.0 / direction[2]];
            Start { origin, direction, inv, t_max: (f64::from(t_max) * unit) as f32, t_start: 0.0, t_unit }
        } else {
            Start::at_the_extremes(origin, direction, t_max)
        };
        Self::from_start(start, skip)
    }

    #[inline(always)]
    fn from_start(start: Start, skip: TriangleId) -> Self {
        let Start { origin: start, direction, inv, t_max, t_start, t_unit } = start;
        let [(cell_x, x), (cell_y, y), (cell_z, z)] = [split(start.x), split(start.y), split(start.z)];
        let origin = start.as_vec3();
        let slack = (origin.abs().max_element() + LATTICE_LIMIT) * SLACK;
        let forward = [slack.copysign(direction[0]), slack.copysign(direction[1]), slack.copysign(direction[2])];
        let signs = is_negative(direction[0]) | is_negative(direction[1]) << 1 | is_negative(direction[2]) << 2;
        let axes = shear_axes(direction, signs);
        let [dx, dy, dz] = [direction[axes[0]], direction[axes[1]], direction[axes[2]]];
        Self {
            cell: [cell_x, cell_y, cell_z],
            fraction: [x, y, z],
            near_origin: [origin.x + forward[0], origin.y + forward[1], origin.z + forward[2]],
            far_origin: [origin.x - forward[0], origin.y - forward[1], origin.z - forward[2]],
            inv,
            near_planes: Plane::NEAR[signs],
            far_planes: Plane::FAR[signs],
            axes,
            shear: [dx / dz, dy / dz, 1.0 / dz],
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

    /// A ray parameter of lattice space in units of the direction that [`Self::new`] was given. Monotone, finite for finite `t`.
    #[inline]
    pub fn caller_t(&self, t: f32) -> f32 {
        let t = (f64::from(t) + self.t_start) * self.t_unit;
        if t.is_finite() { t.min(f64::from(f32::MAX)) as f32 } else { f32::INFINITY }
    }

    /// The inverse of [`Self::caller_t`], rounded up so that nothing at `t` or before lies beyond it.
    pub fn not_below(&self, t: f32) -> f32 {
        let inner = f64::from(t) / self.t_unit - self.t_start;
        (inner + inner.abs() * 1e-6 + self.t_start.abs() * 1e-12) as f32
    }

    /// Where the ray ends, in lattice space's units of t; negative for a ray that hits nothing.
    #[inline(always)]
    pub fn t_max(&self) -> f32 {
        self.t_max
    }
}

/// Where a ray starts and how it counts t.
struct Start {
    origin: DVec3,
    /// Scaled.
    direction: [f32; 3],
    inv: [f32; 3],
    t_max: f32,
    t_start: f64,
    t_unit: f64,
}

impl Start {
    /// Whatever the numbers are.
    #[cold]
    #[inline(never)]
    fn at_the_extremes(origin: DVec3, direction: DVec3, t_max: f32) -> Self {
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
        Self { origin: origin + t_start * scaled, direction, inv: direction.map(inverse), t_max, t_start, t_unit }
    }
}

/// The power of two p with p <= x < 2p, for a positive normal x; the smallest normal number for a subnormal one.
#[inline(always)]
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000).max(f64::MIN_POSITIVE)
}

/// 1 / p for a power of two between 2^-1022 and 2^1021, without dividing.
#[inline(always)]
fn reciprocal_of_power(p: f64) -> f64 {
    const TWICE_THE_BIAS: u64 = 2046 << 52;
    f64::from_bits(TWICE_THE_BIAS - p.to_bits())
}

#[inline(always)]
fn is_negative(d: f32) -> usize {
    (d.to_bits() >> 31) as usize
}

/// The whole number nearest to a coordinate (one of two at ties), and what is left, exact in f64 and rounded to f32.
#[inline(always)]
fn split(x: f64) -> (i32, f32) {
    // In this range doubles are whole numbers, so that the sum is rounded to one.
    const TO_WHOLE: f64 = 6_755_399_441_055_744.0;
    let whole = (x + TO_WHOLE) - TO_WHOLE;
    (whole as i32, (x - whole) as f32)
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

/// The axes x, y, z of the sheared space for a direction whose signs are as in [`Plane::NEAR`].
#[inline(always)]
fn shear_axes(direction: [f32; 3], signs: usize) -> [usize; 3] {
    /// By the axis of the largest component, and whether that is negative.
    const AXES: [[[usize; 3]; 2]; 3] = [[[1, 2, 0], [2, 1, 0]], [[2, 0, 1], [0, 2, 1]], [[0, 1, 2], [1, 0, 2]]];
    /// The axis, by x >= y, x >= z and y >= z.
    const LARGEST: [u8; 8] = [2, 2, 2, 0, 1, 1, 1, 0];
    let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
    let order = usize::from(x >= y) | usize::from(x >= z) << 1 | usize::from(y >= z) << 2;
    let axis = usize::from(LARGEST[order]);
    AXES[axis % 3][signs >> axis & 1]
}
