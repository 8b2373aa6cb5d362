//! How far points reach, and how high: what is asked of parts of patches, and what is answered.

use super::eval::{Point, quarter};
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

/// A part of a patch of which is asked how far it reaches.
#[derive(Clone, Copy, Debug)]
pub struct AskedPart {
    /// Its parameters, [u0, u1] and [v0, v1].
    pub range: [[f64; 2]; 2],
    /// Heights are measured along it.
    pub normal: [i8; 3],
    /// Splits below the patch after which the hull of the points of a ring will do.
    pub depth: u32,
}

/// The parameters of a whole patch.
pub const WHOLE: [[f64; 2]; 2] = [[0.0, 1.0]; 2];

impl AskedPart {
    /// A whole patch.
    pub fn whole(normal: [i8; 3], depth: u32) -> Self {
        Self { range: WHOLE, normal, depth }
    }

    /// Whether it is the whole patch.
    #[inline(always)]
    pub fn is_whole(&self) -> bool {
        self.range == WHOLE
    }

    /// What lies in the quarters of the patch, by their numbers and as they see it.
    #[inline(always)]
    pub fn in_quarters(self) -> impl Iterator<Item = (usize, Self)> + Clone {
        (0..4).filter_map(move |k| {
            let ((x, y), [u, v]) = (quarter(k), self.range);
            let range = [half_range(u, x)?, half_range(v, y)?];
            Some((k, Self { range, depth: self.depth.saturating_sub(1), ..self }))
        })
    }
}

/// The part of a parameter range that lies in the lower (0) or upper (1) half, as the half sees it. Where a range only
/// touches a half, the other one answers for the border.
#[inline(always)]
fn half_range([a, b]: [f64; 2], offset: f64) -> Option<[f64; 2]> {
    let has_part = if offset == 0.0 { a < 0.5 } else { b > 0.5 || a >= 0.5 };
    has_part.then(|| [(2.0 * a - offset).max(0.0), (2.0 * b - offset).min(1.0)])
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
