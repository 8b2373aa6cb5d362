//! Slabs of equal width along an axis, that boxes are put into by their centres: where boxes are divided best is asked
//! of the boundaries between slabs, by surface-area cost (Wald, "On fast construction of SAH-based bounding volume
//! hierarchies", 2007).

use crate::math::Bounds;
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;

/// What lies in a slab.
#[derive(Clone, Copy)]
pub(super) struct Slab {
    bounds: Aabb,
    n_boxes: usize,
}

/// A boundary between slabs.
pub(super) struct Boundary {
    /// Of both sides.
    pub cost: f32,
    /// The first slab above it.
    pub above: usize,
    /// Boxes below it.
    pub n_below: usize,
}

impl Slab {
    pub const EMPTY: Self = Self { bounds: Aabb::INVALID, n_boxes: 0 };

    pub fn add(&mut self, bounds: &Aabb) {
        self.bounds = self.bounds.union(bounds);
        self.n_boxes += 1;
    }

    fn union(&self, other: &Self) -> Self {
        Self { bounds: self.bounds.union(&other.bounds), n_boxes: self.n_boxes + other.n_boxes }
    }

    fn cost(&self) -> f32 {
        half_area(&self.bounds) * self.n_boxes as f32
    }
}

/// The cheapest boundary between slabs, the first of equal ones, that leaves at least so many boxes on either side.
pub(super) fn cheapest_boundary<const N: usize>(slabs: &[Slab; N], least: usize) -> Option<Boundary> {
    let mut from = [Slab::EMPTY; N];
    let mut all = Slab::EMPTY;
    for (from, slab) in from.iter_mut().zip(slabs).rev() {
        all = all.union(slab);
        *from = all;
    }
    let mut best: Option<Boundary> = None;
    let mut below = Slab::EMPTY;
    for (k, slab) in slabs[..N - 1].iter().enumerate() {
        below = below.union(slab);
        let above = &from[k + 1];
        let cost = below.cost() + above.cost();
        let leaves_enough = below.n_boxes >= least && above.n_boxes >= least;
        if leaves_enough && best.as_ref().is_none_or(|best| cost < best.cost) {
            best = Some(Boundary { cost, above: k + 1, n_below: below.n_boxes });
        }
    }
    best
}

/// A box in vectors of four lanes, which it is enlarged faster in.
pub(super) fn aabb(b: &Bounds) -> Aabb {
    Aabb::new(Vec3A::from(b.min), Vec3A::from(b.max))
}

/// Half the surface; 0 of [`Aabb::INVALID`].
pub(super) fn half_area(b: &Aabb) -> f32 {
    let size = Vec3::from((b.max - b.min).max(Vec3A::ZERO));
    size.x * size.y + size.y * size.z + size.z * size.x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slabs(counts: [usize; 4]) -> [Slab; 4] {
        let mut slabs = [Slab::EMPTY; 4];
        for (k, n) in counts.into_iter().enumerate() {
            let low = Vec3A::new(k as f32, 0.0, 0.0);
            (0..n).for_each(|_| slabs[k].add(&Aabb::new(low, low + 1.0)));
        }
        slabs
    }

    #[test]
    fn boxes_are_divided_where_they_are_few() {
        let best = cheapest_boundary(&slabs([5, 0, 0, 5]), 1).unwrap();
        assert_eq!((best.above, best.n_below), (1, 5), "the first boundary of three that cost the same");
        assert_eq!(best.cost, 2.0 * 5.0 * half_area(&Aabb::new(Vec3A::ZERO, Vec3A::ONE)));
        assert_eq!(cheapest_boundary(&slabs([1, 1, 1, 9]), 3).map(|best| best.above), Some(3));
    }

    #[test]
    fn no_boundary_leaves_too_few() {
        assert!(cheapest_boundary(&slabs([0, 7, 0, 0]), 1).is_none());
        assert!(cheapest_boundary(&slabs([2, 2, 2, 0]), 3).is_none());
    }
}
