//! The wide tree against a list.

use super::*;
use crate::grid::{LatticeRay, TriangleId};
use crate::math::Bounds;
use crate::math::simd::Portable;
use glam::{DVec3, Vec3};

#[test]
fn a_tree_over_nothing_visits_nothing() {
    let tree = TopLevel::build(&[]);
    let ray = LatticeRay::new(DVec3::ZERO, DVec3::X, f32::INFINITY, TriangleId::NONE);
    tree.closest(Portable, &ray, &mut TraversalStack::default(), |_| {}, |leaf, _| panic!("visited {leaf:?}"));
    assert!(!tree.occluded(Portable, &ray, &mut TraversalStack::default(), |_| {}, |_| true));
}

#[test]
fn every_patch_is_one_leaf() {
    for n in [1, 2, 3, 8, 9, 100, 5000] {
        let boxes: Vec<Bounds> =
            (0..n).map(|i| [Vec3::splat(i as f32), Vec3::new(0.0, 1.0, i as f32)].into_iter().collect()).collect();
        let tree = TopLevel::build(&boxes);
        let mut patches: Vec<usize> = tree.leaves().map(|l| l.patch.idx()).collect();
        patches.sort_unstable();
        assert_eq!(patches, (0..n).collect::<Vec<_>>());
        assert!(tree.leaves().all(|l| (l.slot as usize) < tree.n_slots()));
    }
}
