//! Axis-aligned boxes in f32 (for trees) and f64 (for world and object space).

use glam::{DVec3, Vec3};

macro_rules! bounds {
    ($(#[$doc:meta])* $name:ident, $vec:ty, $scalar:ty) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Debug)]
        pub struct $name {
            /// Smallest corner.
            pub min: $vec,
            /// Largest corner.
            pub max: $vec,
        }

        impl $name {
            /// The box that holds nothing; growing it gives the grown point.
            pub const EMPTY: Self =
                Self { min: <$vec>::splat(<$scalar>::INFINITY), max: <$vec>::splat(<$scalar>::NEG_INFINITY) };

            /// Enlarges the box to hold `p`.
            #[inline]
            pub fn grow(&mut self, p: $vec) {
                self.min = self.min.min(p);
                self.max = self.max.max(p);
            }

            /// The smallest box that holds both.
            #[inline]
            pub fn union(self, other: Self) -> Self {
                Self { min: self.min.min(other.min), max: self.max.max(other.max) }
            }

            /// Whether nothing was put in.
            pub fn is_empty(&self) -> bool {
                self.min.x > self.max.x
            }

            /// Midpoint.
            pub fn center(&self) -> $vec {
                0.5 * (self.min + self.max)
            }

            /// Length of the diagonal; 0 when empty.
            pub fn diagonal(&self) -> $scalar {
                if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
            }

            /// The box moved outwards by `d` on every side.
            pub fn expanded(self, d: $scalar) -> Self {
                Self { min: self.min - <$vec>::splat(d), max: self.max + <$vec>::splat(d) }
            }
        }

        impl FromIterator<$vec> for $name {
            fn from_iter<I: IntoIterator<Item = $vec>>(points: I) -> Self {
                let mut b = Self::EMPTY;
                points.into_iter().for_each(|p| b.grow(p));
                b
            }
        }
    };
}

bounds!(
    /// A box in single precision.
    Bounds, Vec3, f32
);
bounds!(
    /// A box in double precision.
    DBounds, DVec3, f64
);

impl DBounds {
    /// Whether a point is inside or on the border.
    #[inline]
    pub fn contains(&self, p: DVec3) -> bool {
        (self.min.cmple(p) & p.cmple(self.max)).all()
    }

    /// The eight corners; none of a box that holds nothing.
    pub fn corners(self) -> impl Iterator<Item = DVec3> {
        let Self { min, max } = self;
        let pick = move |k: u32, axis: usize| if k >> axis & 1 == 0 { min[axis] } else { max[axis] };
        let n = if self.is_empty() { 0 } else { 8 };
        (0..n).map(move |k| DVec3::new(pick(k, 0), pick(k, 1), pick(k, 2)))
    }
}
