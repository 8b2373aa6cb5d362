//! How far points reach.

use super::eval::Point;
use crate::math::DBounds;

/// The least and the greatest coordinates of some points, and heights.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Least ones.
    pub low: Point,
    /// Greatest ones.
    pub high: Point,
}

impl Extent {
    /// That of no point.
    pub const EMPTY: Self = Self { low: Point([f64::INFINITY; 4]), high: Point([f64::NEG_INFINITY; 4]) };

    /// Takes in a point.
    #[inline(always)]
    pub fn grow(&mut self, p: Point) {
        for (k, x) in p.0.into_iter().enumerate() {
            self.low.0[k] = self.low.0[k].min(x);
            self.high.0[k] = self.high.0[k].max(x);
        }
    }

    /// That of both.
    #[inline]
    pub fn union(mut self, other: Self) -> Self {
        self.grow(other.low);
        self.grow(other.high);
        self
    }

    /// The box of the points.
    pub fn bounds(&self) -> DBounds {
        DBounds { min: self.low.to_vec(), max: self.high.to_vec() }
    }
}
