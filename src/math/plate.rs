//! The space between two parallel planes.

use super::Bounds;
use glam::DVec3;

/// Lattice steps, times the sum of a normal's components.
const MARGIN: f64 = 120.0;

/// All points p with `low <= normal . p <= high`. The default one is all of space.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Plate {
    /// Across the planes, in whole numbers, of which the greatest in magnitude is 127; or zero.
    pub normal: [i8; 3],
    /// The least height above the origin, in lengths of the normal.
    pub low: f32,
    /// The greatest height.
    pub high: f32,
}

/// What holds a patch or a part of one: a box and a plate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Envelope {
    /// The box.
    pub bounds: Bounds,
    /// The plate.
    pub plate: Plate,
}

impl Envelope {
    /// That of nothing.
    pub const EMPTY: Self = Self { bounds: Bounds::EMPTY, plate: Plate { normal: [0; 3], low: 0.0, high: 0.0 } };
}

impl Plate {
    /// The normal for plates along this direction, of any length; zero if it has none.
    #[inline(always)]
    pub fn normal_along(direction: DVec3) -> [i8; 3] {
        let scaled = direction * (127.0 / direction.abs().max_element());
        if !scaled.is_finite() {
            return [0; 3];
        }
        let [x, y, z] = scaled.to_array();
        [x.round_ties_even() as i8, y.round_ties_even() as i8, z.round_ties_even() as i8]
    }

    /// The plate with this normal that holds heights from `low` to `high`, finite ones.
    #[inline(always)]
    pub fn around(normal: [i8; 3], low: f64, high: f64) -> Self {
        Self { normal, low: (low as f32).next_down(), high: (high as f32).next_up() }
    }

    /// By how much more than it is a plate has to reach on either side, in lengths of the normal, so that no ray which
    /// hits something in it is said to pass it by. The argument is in `scene/accel/plates.rs`.
    #[inline(always)]
    pub fn margin(&self) -> f64 {
        let [x, y, z] = self.normal;
        1.0 + MARGIN * f64::from(i32::from(x).abs() + i32::from(y).abs() + i32::from(z).abs())
    }

    /// Height of a point above the origin, in lengths of the normal.
    #[inline(always)]
    pub fn height(normal: [i8; 3], p: DVec3) -> f64 {
        let [x, y, z] = normal;
        DVec3::new(f64::from(x), f64::from(y), f64::from(z)).dot(p)
    }
}
