//! Putting boxes into **groups** of eight neighbours: the lanes of one node each.
//!
//! A tree made wide from a binary one has four or five children a node, since most subtrees of a binary tree have no
//! eight leaves. So boxes are divided from the top, every time at a multiple of eight of them, by the least
//! surface-area cost: all groups but the last are full then, and what is above them has an eighth of the boxes.

use super::LANES;
use super::build::Care;
use super::slabs::{Slab, aabb, cheapest_boundary, half_area};
use crate::math::Bounds;
use glam::Vec3A;
use obvhs::aabb::Aabb;

/// Boxes of which all three orders are compared; of more, slabs along one axis or all are.
const MOST_SORTED: usize = 32;

/// Slabs of centres that are compared.
const N_BINS: usize = 16;

/// Neither side of a division in slabs gets less than this share.
const LEAST_SHARE: usize = 8;

/// A box to be grouped, and its number.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    number: u32,
}

impl Item {
    /// Twice the centre, which is as good for comparisons.
    fn center(&self) -> Vec3A {
        self.bounds.min + self.bounds.max
    }
}

/// Up to eight boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub bounds: Aabb,
    /// Numbers of the boxes, the first `len` of these.
    numbers: [u32; LANES],
    len: usize,
}

impl Group {
    pub fn numbers(&self) -> &[u32] {
        &self.numbers[..self.len]
    }
}

/// The groups of some of `boxes`.
pub(super) fn groups(boxes: &[Bounds], members: &[u32], care: Care) -> Vec<Group> {
    let mut items: Vec<Item> =
        members.iter().map(|&number| Item { bounds: aabb(&boxes[number as usize]), number }).collect();
    let mut groups = Vec::with_capacity(items.len().div_ceil(LANES));
    divide(&mut items, care, &mut groups);
    groups
}

fn divide(items: &mut [Item], care: Care, groups: &mut Vec<Group>) {
    if items.len() <= LANES {
        let mut numbers = [0; LANES];
        numbers.iter_mut().zip(&*items).for_each(|(number, item)| *number = item.number);
        groups.push(Group { bounds: union(items), numbers, len: items.len() });
        return;
    }
    let middle = if items.len() <= MOST_SORTED { split_sorted(items) } else { split_slabs(items, care) };
    let (low, high) = items.split_at_mut(middle);
    divide(low, care, groups);
    divide(high, care, groups);
}

fn union(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::INVALID, |all, item| all.union(&item.bounds))
}

/// Sorts along the axis of the cheapest division; returns where it is.
fn split_sorted(items: &mut [Item]) -> usize {
    let orders = [0, 1, 2].map(|axis| Order::new(items, axis));
    let costs = orders.each_ref().map(|order| cheapest(items, order));
    let axis = (1..3).fold(0, |best, axis| if costs[axis].0 < costs[best].0 { axis } else { best });
    orders[axis].apply(items);
    costs[axis].1
}

/// The order of up to [`MOST_SORTED`] items along an axis.
struct Order {
    /// The centre, as a number that is in the same order, and the item's place.
    keys: [u64; MOST_SORTED],
    len: usize,
}

impl Order {
    fn new(items: &[Item], axis: usize) -> Self {
        let mut keys = [0; MOST_SORTED];
        for (place, (key, item)) in keys.iter_mut().zip(items).enumerate() {
            let bits = item.center()[axis].to_bits();
            let ascending = if bits >> 31 == 0 { bits ^ 1 << 31 } else { !bits };
            *key = u64::from(ascending) << 32 | place as u64;
        }
        keys[..items.len()].sort_unstable();
        Self { keys, len: items.len() }
    }

    /// The places of the items.
    fn places(&self) -> impl DoubleEndedIterator<Item = usize> + ExactSizeIterator {
        self.keys[..self.len].iter().map(|key| (key & 0xffff_ffff) as usize)
    }

    fn apply(&self, items: &mut [Item]) {
        let before: [Item; MOST_SORTED] = std::array::from_fn(|i| items[i.min(self.len - 1)]);
        items.iter_mut().zip(self.places()).for_each(|(item, place)| *item = before[place]);
    }
}

/// The cheapest division of items in an order that leaves one group that is not full at most: its cost and place.
fn cheapest(items: &[Item], order: &Order) -> (f32, usize) {
    let n = items.len();
    let mut above = [0.0; MOST_SORTED];
    let mut bounds = Aabb::INVALID;
    for (i, place) in order.places().enumerate().rev() {
        bounds = bounds.union(&items[place].bounds);
        above[i] = half_area(&bounds);
    }
    bounds = Aabb::INVALID;
    let mut best = (f32::INFINITY, LANES);
    for (middle, place) in (1..n).zip(order.places()) {
        bounds = bounds.union(&items[place].bounds);
        if middle.is_multiple_of(LANES) || (n - middle).is_multiple_of(LANES) {
            let n_nodes = |n: usize| n.div_ceil(LANES) as f32;
            let cost = half_area(&bounds) * n_nodes(middle) + above[middle] * n_nodes(n - middle);
            if cost < best.0 {
                best = (cost, middle);
            }
        }
    }
    best
}

/// Puts the items below the cheapest slab boundary first, or rather a multiple of eight.
fn split_slabs(items: &mut [Item], care: Care) -> usize {
    let n = items.len();
    let (low, high) = items.iter().fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(low, high), item| {
        (low.min(item.center()), high.max(item.center()))
    });
    let extent = high - low;
    let longest = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).expect("three axes");
    let axes = if care == Care::Thorough { 0..3 } else { longest..longest + 1 };
    let scale = Vec3A::splat(N_BINS as f32) / extent.max(Vec3A::splat(f32::MIN_POSITIVE));
    let slabs = slabs(items, low, scale, axes.clone());
    let boundary = |axis: usize| cheapest_boundary(&slabs[axis], 1).map(|boundary| (axis, boundary));
    let best = axes.filter_map(boundary).min_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost));
    let (axis, near) = best.map_or((longest, n / 2), |(axis, boundary)| (axis, boundary.n_below));
    let least = n / LEAST_SHARE;
    let near = near.clamp(least, n - least);
    let middle = (near + LANES / 2) / LANES * LANES;
    let order = |a: &Item, b: &Item| a.center()[axis].total_cmp(&b.center()[axis]).then(a.number.cmp(&b.number));
    items.select_nth_unstable_by(middle, order);
    middle
}

/// The slabs along some axes, by the centres of items: all in one pass.
fn slabs(items: &[Item], low: Vec3A, scale: Vec3A, axes: std::ops::Range<usize>) -> [[Slab; N_BINS]; 3] {
    let mut slabs = [[Slab::EMPTY; N_BINS]; 3];
    for item in items {
        let bins = ((item.center() - low) * scale).as_uvec3();
        for axis in axes.clone() {
            slabs[axis][(bins[axis] as usize).min(N_BINS - 1)].add(&item.bounds);
        }
    }
    slabs
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn every_box_is_in_one_group_and_all_groups_but_one_are_full() {
        let at = |i: u64| Vec3::new((i * 7919 % 1000) as f32, (i * 104_729 % 777) as f32, (i % 13) as f32);
        let scattered: Vec<Bounds> = (0..4001).map(|i| Bounds { min: at(i), max: at(i) + 1.0 }).collect();
        let equal = vec![Bounds { min: Vec3::ONE, max: Vec3::ONE }; 1001];
        let some = [&scattered[..], &scattered[..63], &scattered[..9], &scattered[..1], &equal];
        for (boxes, care) in some.into_iter().flat_map(|boxes| [(boxes, Care::Thorough), (boxes, Care::Hasty)]) {
            let members: Vec<u32> = (0..boxes.len() as u32).collect();
            let groups = groups(boxes, &members, care);
            assert_eq!(groups.len(), boxes.len().div_ceil(LANES));
            let mut all: Vec<u32> = groups.iter().flat_map(|g| g.numbers()).copied().collect();
            all.sort_unstable();
            assert_eq!(all, members);
        }
    }
}
