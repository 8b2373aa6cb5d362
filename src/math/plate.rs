//! The space between two parallel planes.

use glam::DVec3;

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

impl Plate {
    /// The normal for plates along this direction, of any length; zero if it has none.
    pub fn normal_along(direction: DVec3) -> [i8; 3] {
        let scaled = direction * (127.0 / direction.abs().max_element());
        // Casts of NaN give zero.
        scaled.round().to_array().map(|x| if scaled.is_finite() { x as i8 } else { 0 })
    }

    /// The plate with this normal that holds heights from `low` to `high`, finite ones.
    pub fn around(normal: [i8; 3], low: f64, high: f64) -> Self {
        Self { normal, low: (low as f32).next_down(), high: (high as f32).next_up() }
    }

    /// Height of a point above the origin, in lengths of the normal.
    pub fn height(normal: [i8; 3], p: DVec3) -> f64 {
        DVec3::from_array(normal.map(f64::from)).dot(p)
    }
}
