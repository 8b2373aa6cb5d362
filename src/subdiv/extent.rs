//! How far points reach, and how high.

use super::eval::Point;
use super::regular::ControlPoints;
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

/// How far a part of a patch reaches, with heights along a normal of its own.
#[derive(Clone, Copy, Debug)]
pub struct PartExtent {
    /// How far, and how high.
    pub extent: Extent,
    /// What heights are measured along; zero where there is none.
    pub normal: [i8; 3],
}

impl PartExtent {
    /// That of no point.
    pub const EMPTY: Self = Self { extent: Extent::EMPTY, normal: [0; 3] };
}

impl Point {
    /// The point with its height along a normal.
    #[inline(always)]
    pub fn with_height(self, normal: [i8; 3]) -> Self {
        let ([x, y, z, _], [a, b, c]) = (self.0, normal.map(f64::from));
        Point([x, y, z, a * x + b * y + c * z])
    }
}

/// Control points with their heights along a normal.
#[inline(always)]
pub fn with_heights(control: &ControlPoints, normal: [i8; 3]) -> ControlPoints {
    let mut out = *control;
    for point in &mut out {
        *point = point.with_height(normal);
    }
    out
}
