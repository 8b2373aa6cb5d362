//! Dividing boxes into **parts** of neighbours, each small enough for a processor's cache: a part's tree is built by
//! one thread, beside those of the other parts.
//!
//! Boxes are divided in two at the cheapest boundary between [`N_BINS`] slabs (`slabs.rs`), and the halves again. A
//! boundary that would leave less than an eighth on one side is passed over, for the median if need be, so that no
//! arrangement of boxes takes more than a few passes.

use super::slabs::{Slab, aabb, cheapest_boundary};
use crate::math::Bounds;
use crate::parallel::for_each;
use glam::Vec3;
use parking_lot::Mutex;

/// Boxes of a part, at most. One part more costs a node that is not chosen for least cost.
pub(super) const MOST_IN_PART: usize = 1 << 12;

/// Slabs of centres that are compared.
const N_BINS: usize = 32;

/// Neither side of a division gets less than this share.
const LEAST_SHARE: usize = 8;

/// Boxes that two threads divide faster than one.
const WORTH_A_THREAD: usize = 1 << 16;

/// Boxes that lie together.
pub(super) struct Part<'a> {
    /// Which, by their number.
    pub members: &'a [u32],
    /// Around all of them.
    pub bounds: Bounds,
}

/// Divides `members` in place; neighbouring parts follow each other. The result does not depend on `n_threads`.
pub(super) fn divide<'a>(boxes: &[Bounds], members: &'a mut [u32], n_threads: usize) -> Vec<Part<'a>> {
    if members.len() <= MOST_IN_PART {
        let bounds = members.iter().map(|&i| boxes[i as usize]).fold(Bounds::EMPTY, Bounds::union);
        return vec![Part { members, bounds }];
    }
    let middle = split(boxes, members);
    let (low, high) = members.split_at_mut(middle);
    if n_threads < 2 || low.len() + high.len() < WORTH_A_THREAD {
        let mut parts = divide(boxes, low, 1);
        parts.append(&mut divide(boxes, high, 1));
        return parts;
    }
    let halves = [(low, n_threads - n_threads / 2), (high, n_threads / 2)];
    let halves = halves.map(|(members, n_threads)| Mutex::new((members, n_threads, Vec::new())));
    for_each(&halves, 2, |_, half| {
        let (members, n_threads, parts) = &mut *half.lock();
        *parts = divide(boxes, std::mem::take(members), *n_threads);
    });
    let [mut parts, mut high] = halves.map(|half| half.into_inner().2);
    parts.append(&mut high);
    parts
}

/// Twice the centre, which is as good for comparisons.
fn center(b: &Bounds) -> Vec3 {
    b.min + b.max
}

/// Puts those of one side first; returns how many they are.
fn split(boxes: &[Bounds], members: &mut [u32]) -> usize {
    let of = |i: u32| center(&boxes[i as usize]);
    let (low, high) = members.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &i| {
        let c = of(i);
        (low.min(c), high.max(c))
    });
    let extent = high - low;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).expect("three axes");
    let scale = N_BINS as f32 / extent[axis].max(f32::MIN_POSITIVE);
    let bin = |i: u32| (((of(i)[axis] - low[axis]) * scale) as usize).min(N_BINS - 1);
    let mut slabs = [Slab::EMPTY; N_BINS];
    members.iter().for_each(|&i| slabs[bin(i)].add(&aabb(&boxes[i as usize])));
    match cheapest_boundary(&slabs, members.len() / LEAST_SHARE) {
        Some(boundary) => partition(members, |i| bin(i) < boundary.above),
        None => {
            let middle = members.len() / 2;
            members.select_nth_unstable_by(middle, |&a, &b| of(a)[axis].total_cmp(&of(b)[axis]).then(a.cmp(&b)));
            middle
        }
    }
}

/// Puts those for which `is_first` holds first.
fn partition(members: &mut [u32], is_first: impl Fn(u32) -> bool) -> usize {
    let mut n_first = 0;
    for k in 0..members.len() {
        if is_first(members[k]) {
            members.swap(n_first, k);
            n_first += 1;
        }
    }
    n_first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts_of(boxes: &[Bounds], n_threads: usize) -> Vec<Vec<u32>> {
        let mut members: Vec<u32> = (0..boxes.len() as u32).collect();
        divide(boxes, &mut members, n_threads).into_iter().map(|p| p.members.to_vec()).collect()
    }

    #[test]
    fn every_box_is_in_one_part_whatever_the_threads() {
        let at = |i: u64| Vec3::new((i * 7919 % 1000) as f32, (i * 104_729 % 777) as f32, (i % 13) as f32);
        let boxes: Vec<Bounds> = (0..150_000).map(|i| Bounds { min: at(i), max: at(i) + 1.0 }).collect();
        let parts = parts_of(&boxes, 1);
        assert_eq!(parts, parts_of(&boxes, 5));
        assert!(parts.iter().all(|p| (MOST_IN_PART / LEAST_SHARE / 2..=MOST_IN_PART).contains(&p.len())));
        let mut all = parts.concat();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..150_000));
    }

    #[test]
    fn equal_boxes_and_sizes_without_end_are_divided_evenly() {
        let point = |r: f32| Bounds { min: Vec3::splat(r), max: Vec3::splat(1.01 * r) };
        let equal = vec![point(5.0); 100_000];
        let growing: Vec<Bounds> = (0..100_000).map(|i| point(2f32.powf(24.0 * i as f32 / 1e5))).collect();
        for boxes in [equal, growing] {
            assert!(parts_of(&boxes, 2).len() < 8 * boxes.len() / MOST_IN_PART);
        }
    }
}
