//! Eight octants of directions around a normal, one a lane.

use crate::math::Bounds;
use crate::math::simd::{self, Kernel, Task};
use glam::Vec3;

/// By how much one goes ahead in each octant for each unit of x, and of y. Lanes are numbered as [`octant`] says.
const AHEAD: [[f32; 8]; 2] = [[1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0]];

/// The same for the way aside, which is positive in the octant, too, and less.
const ASIDE: [[f32; 8]; 2] = [[0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0], [1.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0]];

/// Heights are at least so far from none: a small part of what a lattice step is.
const LEAST_HEIGHT: f32 = 1.0;

/// Ways are at least so long, where something is there: far less than a lattice step.
const LEAST_WAY: f32 = 1e-3;

/// Times a negative way this is lower than all elevations.
const FAR_BELOW: f32 = 1e24;

/// The elevation of octants that nothing is in: or one that is lower.
pub(super) const NOTHING: f32 = -1e12;

/// The octant of a direction with these ways without signs, which of them are negative said by 1 or 0.
#[inline(always)]
pub(super) fn octant([x, y]: [f32; 2], shrinks: [u32; 2]) -> u32 {
    u32::from(x < y) | shrinks[0] << 1 | shrinks[1] << 2
}

/// How far a box reaches ahead and aside in each octant, at least and at most, and up.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    ahead: [[f32; 8]; 2],
    aside: [[f32; 8]; 2],
    top: f32,
}

impl Extent {
    /// Of what is far below.
    pub const NONE: Self = Self { ahead: [[0.0; 8]; 2], aside: [[0.0; 8]; 2], top: NOTHING };

    pub fn around(b: &Bounds) -> Self {
        simd::run(ExtentOf(b))
    }

    #[inline(always)]
    pub fn of<K: Kernel>(k: K, b: &Bounds) -> Self {
        let (middle, half) = (0.5 * (b.min + b.max), 0.5 * (b.max - b.min));
        Self { ahead: Self::range(k, &AHEAD, middle, half), aside: Self::range(k, &ASIDE, middle, half), top: b.max.z }
    }

    #[inline(always)]
    fn range<K: Kernel>(k: K, [x, y]: &[[f32; 8]; 2], middle: Vec3, half: Vec3) -> [[f32; 8]; 2] {
        let (x, y) = (k.load(x), k.load(y));
        let middle = k.add(k.mul(x, k.splat(middle.x)), k.mul(y, k.splat(middle.y)));
        let half = k.add(k.mul(k.abs(x), k.splat(half.x)), k.mul(k.abs(y), k.splat(half.y)));
        [k.store(k.sub(middle, half)), k.store(k.add(middle, half))]
    }
}

struct ExtentOf<'a>(&'a Bounds);

impl Task for ExtentOf<'_> {
    type Output = Extent;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Extent {
        Extent::of(k, self.0)
    }
}

/// How far two boxes are apart, octant by octant: differences of their points.
pub(super) struct Between<K: Kernel> {
    /// What one goes ahead at least, and at most.
    ahead: [K::F; 2],
    /// What one goes aside at least.
    aside: K::F,
    /// Of the one that is seen.
    top: f32,
    /// Nothing in octants that no difference is in; elsewhere zero.
    absence: K::F,
}

impl<K: Kernel> Between<K> {
    #[inline(always)]
    pub fn of(k: K, from: &Extent, to: &Extent) -> Self {
        let least_ahead = k.sub(k.load(&to.ahead[0]), k.load(&from.ahead[1]));
        let most_ahead = k.sub(k.load(&to.ahead[1]), k.load(&from.ahead[0]));
        let least_aside = k.sub(k.load(&to.aside[0]), k.load(&from.aside[1]));
        let most_aside = k.sub(k.load(&to.aside[1]), k.load(&from.aside[0]));
        // Negative where there is none.
        let room = k.min(k.min(most_ahead, most_aside), k.sub(most_ahead, least_aside));
        let absence = k.mul(k.min(room, k.splat(0.0)), k.splat(FAR_BELOW));
        Self { ahead: [least_ahead, most_ahead], aside: least_aside, top: to.top, absence }
    }

    /// These elevations in octants that differences are in.
    #[inline(always)]
    pub fn only(&self, k: K, elevations: K::F) -> K::F {
        k.add(elevations, self.absence)
    }

    /// How high the one stands at most, seen from heights of the floor and above.
    #[inline(always)]
    pub fn elevations(&self, k: K, floor: f32) -> K::F {
        let height = self.top - floor;
        let height = if height.abs() < LEAST_HEIGHT { LEAST_HEIGHT } else { height };
        let [least_ahead, most_ahead] = self.ahead;
        let ahead = if height > 0.0 { k.max(least_ahead, self.aside) } else { most_ahead };
        self.only(k, k.div(k.splat(height), k.max(ahead, k.splat(LEAST_WAY))))
    }
}

/// Raises, octant by octant, how steep triangles are at most in the octant's directions, for triangles that rise by `x`
/// along x and by `y` along y, one a lane; `error` is by what both together may be greater.
#[inline(always)]
pub(super) fn steepest<K: Kernel>(k: K, [x, y]: [K::F; 2], error: K::F, all: &mut [K::F; 8]) {
    let zero = k.splat(0.0);
    let (minus_x, minus_y) = (k.sub(zero, x), k.sub(zero, y));
    let ahead = [x, y, minus_x, y, x, minus_y, minus_x, minus_y];
    let aside = [y, x, y, minus_x, minus_y, x, minus_y, minus_x];
    for octant in 0..8 {
        // Straight ahead, or as far aside as ahead. A triangle without area rises by no number, which is not greater.
        let steepness = k.add(k.add(ahead[octant], k.max(aside[octant], zero)), error);
        all[octant] = k.max(steepness, all[octant]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::tests::support::Random;
    use crate::math::simd::Portable;
    use glam::{DVec2, DVec3};

    /// The octant of a way, and how far it leads ahead.
    fn ahead(way: DVec2) -> (usize, f64) {
        let ways = way.abs().to_array().map(|x| x as f32);
        let octant = octant(ways, way.to_array().map(|x| u32::from(x < 0.0)));
        (octant as usize, way.abs().max_element())
    }

    #[test]
    fn triangles_are_as_steep_as_their_steepest_direction() {
        let mut random = Random(0x0c7a_2700);
        for _ in 0..1000 {
            let rises = DVec2::new(random.point(3.0).x, random.point(3.0).y);
            let mut all = [Portable.splat(NOTHING); 8];
            let of_lanes = [rises.x as f32, rises.y as f32].map(|x| Portable.splat(x));
            steepest(Portable, of_lanes, Portable.splat(0.0), &mut all);
            let most = all.map(|lanes| f64::from(Portable.store(lanes)[3]));
            let mut seen = [f64::MIN; 8];
            for k in 0..80 {
                let way = DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 80.0 + 1e-9);
                let (octant, ahead) = ahead(way);
                let slope = rises.dot(way) / ahead;
                assert!(slope <= most[octant] + 1e-5, "{rises} along {way}");
                seen[octant] = seen[octant].max(slope);
            }
            assert!(most.iter().zip(seen).all(|(most, seen)| most - seen < 0.7), "{rises}: {most:?} {seen:?}");
        }
    }

    #[test]
    fn boxes_stand_as_high_as_their_highest_points() {
        let mut random = Random(0xb0e5);
        let mut n_seen = 0;
        for _ in 0..2000 {
            let mut some_box = |reach: f64| -> Bounds {
                let middle = random.point(reach);
                (0..2).map(|_| (middle + random.point(1.5)).as_vec3()).collect()
            };
            let (from, to) = (some_box(1.0), some_box(6.0));
            let between = Between::of(Portable, &Extent::of(Portable, &from), &Extent::of(Portable, &to));
            let elevations = Portable.store(between.elevations(Portable, from.min.z));
            let mut inside = |b: &Bounds| -> DVec3 {
                let share = (random.point(0.5) + 0.5).as_vec3();
                (b.min + share * (b.max - b.min)).as_dvec3()
            };
            for _ in 0..50 {
                let way = inside(&to) - inside(&from);
                let (octant, ahead) = ahead(way.truncate());
                let elevation = f64::from(elevations[octant]);
                assert!(way.z <= elevation * ahead + 1e-4, "{way} of {from:?} and {to:?}: {elevation}");
                n_seen += usize::from(elevation < 4.0);
            }
        }
        assert!(n_seen > 10_000, "only {n_seen} of these are seen at all");
    }
}
