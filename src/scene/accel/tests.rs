//! The wide tree against a list of boxes.

use super::*;
use crate::grid::{LatticeRay, PACKET, RayPacket, TriangleId};
use crate::math::simd::{Kernel, Portable, Task, run};
use crate::math::{Bounds, DBounds, Ray, RayBounds};
use glam::{DVec3, Vec3};

/// Numbers in [0, 1) that are the same in every run.
pub(super) fn random(n: u64) -> f64 {
    let z = (n + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 32)) >> 11) as f64 / (1u64 << 53) as f64
}

pub(super) fn random_point(n: u64, r: f64) -> DVec3 {
    DVec3::from_array([3 * n, 3 * n + 1, 3 * n + 2].map(|n| r * (2.0 * random(n) - 1.0)))
}

/// Boxes of sizes from a point up to `size` within the cube of half-width 8 million.
fn scattered(n: u64, size: f64) -> Vec<Bounds> {
    let corners = |i: u64| {
        let p = random_point(2 * i, 8e6 - size);
        [p, p + if i.is_multiple_of(5) { DVec3::ZERO } else { random_point(2 * i + 1, size) }]
    };
    (0..n).map(|i| corners(i).into_iter().map(|p| p.as_vec3()).collect()).collect()
}

fn ray(origin: DVec3, direction: DVec3) -> LatticeRay {
    LatticeRay::new(origin, direction, f32::INFINITY, TriangleId::NONE)
}

/// Every patch that a traversal without hits visits, in order; `occluded` must visit the same.
struct Visits<'a>(&'a TopLevel, &'a LatticeRay);

impl Task for Visits<'_> {
    type Output = Vec<LeafRef>;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Vec<LeafRef> {
        let mut stack = TraversalStack::default();
        let (mut nearest_first, mut unordered) = (vec![], vec![]);
        self.0.closest(kernel, self.1, &mut stack, |leaf, _| nearest_first.push(leaf));
        let collect = |leaf| {
            unordered.push(leaf);
            false
        };
        assert!(!self.0.occluded(kernel, self.1, &mut stack, collect));
        unordered.sort_unstable_by_key(|l| l.slot);
        let mut sorted = nearest_first.clone();
        sorted.sort_unstable_by_key(|l| l.slot);
        assert_eq!(sorted, unordered);
        nearest_first
    }
}

/// Where the ray enters the box in f64; `None` if it does not meet it.
fn entry(b: &Bounds, origin: DVec3, direction: DVec3) -> Option<f64> {
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for k in 0..3 {
        let (low, high) = (f64::from(b.min[k]) - origin[k], f64::from(b.max[k]) - origin[k]);
        if direction[k] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
        } else {
            enter = enter.max((low / direction[k]).min(high / direction[k]));
            leave = leave.min((low / direction[k]).max(high / direction[k]));
        }
    }
    (enter <= leave).then_some(enter)
}

/// Numbers of patches whose trees are built either way.
const THOROUGH: usize = 16_000;
const HASTY: usize = 70_000;

#[test]
fn a_tree_over_nothing_visits_nothing() {
    let tree = TopLevel::build(&[], 1);
    assert_eq!(run(Visits(&tree, &ray(DVec3::ZERO, DVec3::X))), []);
}

#[test]
fn every_patch_is_one_leaf() {
    for n in [1, 2, 3, 8, 9, 100, 5000] {
        let tree = TopLevel::build(&scattered(n, 1e5), 2);
        let mut patches: Vec<usize> = tree.leaves().map(|l| l.patch.idx()).collect();
        patches.sort_unstable();
        assert_eq!(patches, (0..n as usize).collect::<Vec<_>>());
        assert!(tree.leaves().all(|l| (l.slot as usize) < tree.n_slots()));
    }
}

#[test]
fn every_box_that_a_ray_meets_is_visited_and_few_others() {
    for (size, n) in [(10.0, 1), (1e6, 2), (2e5, 3000)] {
        let boxes = scattered(n, size);
        let tree = TopLevel::build(&boxes, 2);
        for i in 0..600 {
            // Through a corner of a box, along an axis or any way, from near or far.
            let target = boxes[(random(i) * n as f64) as usize].min.as_dvec3();
            let direction =
                if i % 3 == 0 { [DVec3::X, DVec3::NEG_Y, -DVec3::Z][i as usize % 7 % 3] } else { random_point(i, 1.0) };
            let origin = (target - direction * 10f64.powi(i as i32 % 8)).as_vec3().as_dvec3();
            let ray = ray(origin, direction);
            let direction = DVec3::from_array(std::array::from_fn(|k| {
                if direction[k] == 0.0 { 0.0 } else { 1.0 / f64::from(ray.inv[k]) }
            }));
            // Kernels may differ in boxes that the ray barely meets.
            for visits in [run(Visits(&tree, &ray)), Visits(&tree, &ray).run(Portable)] {
                for (patch, b) in boxes.iter().enumerate() {
                    let is_visited = visits.iter().any(|v| v.patch.idx() == patch);
                    let meets = |b: &Bounds| entry(b, origin, direction).is_some();
                    assert!(is_visited || !meets(b), "ray {i}: patch {patch} is not visited");
                    assert!(!is_visited || meets(&b.expanded(64.0)), "ray {i}: patch {patch} is far");
                }
            }
        }
    }
}

#[test]
fn leaves_beyond_a_hit_are_not_visited() {
    let boxes = scattered(3000, 2e6);
    let tree = TopLevel::build(&boxes, 2);
    let mut stack = TraversalStack::default();
    let mut n_visits = [0; 2];
    for i in 0..200 {
        let ray = ray(random_point(i, 8e6), random_point(i + 1000, 1.0));
        let direction = DVec3::from_array(std::array::from_fn(|k| 1.0 / f64::from(ray.inv[k])));
        let origin = ray.origin();
        tree.closest(Portable, &ray, &mut stack, |leaf, t_max| {
            let t = entry(&boxes[leaf.patch.idx()].expanded(64.0), origin, direction).expect("the box is met");
            // An entry's place in the order is known to two steps of 1024.
            assert!(t <= f64::from(*t_max) + 2048.0, "{t} beyond {t_max}");
            n_visits[0] += 1;
            if leaf.patch.0.is_multiple_of(3) {
                *t_max = t_max.min(t as f32 + 1e5);
            }
        });
        n_visits[1] += run(Visits(&tree, &ray)).len();
    }
    assert!(2 * n_visits[0] < n_visits[1], "hits hide little: {n_visits:?}");
}

#[test]
fn occlusion_stops_at_the_first_hit() {
    let tree = TopLevel::build(&scattered(3000, 4e6), 1);
    let mut n_visits = 0;
    let first = |_| {
        n_visits += 1;
        true
    };
    assert!(tree.occluded(Portable, &ray(DVec3::ZERO, DVec3::ONE), &mut TraversalStack::default(), first));
    assert_eq!(n_visits, 1);
}

/// The leaves that a ray visits from the root, and those that it visits from a bundle's front, each by their slots;
/// `None` if there is no front.
struct FromFront<'a>(&'a TopLevel, &'a RayBounds, &'a LatticeRay);

impl Task for FromFront<'_> {
    type Output = Option<[Vec<u32>; 2]>;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Self::Output {
        let Self(tree, bundle, ray) = self;
        let mut front = Front::default();
        if !tree.find_front(kernel, bundle, &mut front) {
            return None;
        }
        let mut stacks = [TraversalStack::default(), TraversalStack::default()];
        let [first, second] = &mut stacks;
        let from_root = slots(tree.walk(kernel, ray, first));
        let is_empty = front.is_empty();
        let from_front = if is_empty { vec![] } else { slots(tree.walk_front(kernel, &front, ray, second)) };
        Some([from_root, from_front])
    }
}

fn slots(mut walk: impl LeafWalk) -> Vec<u32> {
    let mut slots: Vec<_> = std::iter::from_fn(|| walk.nearest(f32::INFINITY, |_| ())).map(|leaf| leaf.slot).collect();
    slots.sort_unstable();
    slots
}

#[test]
fn from_its_front_a_ray_of_a_bundle_visits_what_it_visits_from_the_root() {
    let mut n_leaves = 0;
    for (size, n) in [(10.0, 1), (1e6, 2), (2e5, 3000), (3e6, 400)] {
        let tree = TopLevel::build(&scattered(n, size), 2);
        for i in 0..600 {
            // From a point or a box, in one direction or within an angle, some of which have no sign along an axis.
            let axis = [DVec3::X, DVec3::NEG_Y, DVec3::new(0.0, 1.0, -1.0), random_point(i, 1.0)][i as usize % 4];
            let [around, spread] = [[0.0, 1e2, 1e6], [0.0, 1e-3, 0.3]].map(|of| of[(random(i) * 3.0) as usize]);
            let eye = random_point(i + 600, 10f64.powi(2 + i as i32 % 6));
            let [o, d] = [0, 1].map(|end| random_point(2 * i + end, 1.0));
            let corners = [(eye, axis), (eye + around * o, axis + spread * d)].map(|(o, d)| Ray::new(o, d));
            let bundle: RayBounds = corners.into_iter().collect();
            for k in 0..4 {
                let blend = |b: DBounds| {
                    b.min + DVec3::from_array([0, 1, 2].map(|a| random(9 * i + 3 * k + a))) * (b.max - b.min)
                };
                let ray = ray(blend(bundle.origin), blend(bundle.direction));
                for visits in [run(FromFront(&tree, &bundle, &ray)), FromFront(&tree, &bundle, &ray).run(Portable)] {
                    let [from_root, from_front] = visits.expect("the eye is near");
                    assert_eq!(from_root, from_front, "{n} boxes, bundle {i}, ray {k}");
                    n_leaves += from_root.len();
                }
            }
        }
    }
    assert!(n_leaves > 10_000, "only {n_leaves} leaves were visited");
}

/// The nearest of the made-up hits of a ray, and how many leaves it visits until it is found.
struct NearestFromFront<'a>(&'a TopLevel, &'a RayBounds, &'a LatticeRay, &'a dyn Fn(PatchId) -> Option<f32>);

impl Task for NearestFromFront<'_> {
    type Output = (f32, usize);
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Self::Output {
        let Self(tree, bundle, ray, hit_of) = self;
        let (mut front, mut stack) = (Front::default(), TraversalStack::default());
        assert!(tree.find_front(kernel, bundle, &mut front));
        if front.is_empty() {
            return (f32::INFINITY, 0);
        }
        let mut walk = tree.walk_front(kernel, &front, ray, &mut stack);
        let (mut nearest, mut n_visits) = (f32::INFINITY, 0);
        while let Some(leaf) = walk.nearest(nearest, |_| ()) {
            nearest = hit_of(leaf.patch).map_or(nearest, |t| nearest.min(t));
            n_visits += 1;
        }
        (nearest, n_visits)
    }
}

#[test]
fn what_lies_beyond_a_hit_is_left_out_of_a_front_and_nothing_before_it() {
    const N: u32 = 2000;
    let boxes = scattered(u64::from(N), 3e6);
    let tree = TopLevel::build(&boxes, 2);
    let (mut n_visits, mut n_met) = (0, 0);
    for i in 0..200 {
        // Directions of any length: they count t in their own units.
        let (eye, forward) = (random_point(i, 8e6), random_point(i + 300, 10f64.powi(i as i32 % 5 - 2)));
        let corners = [forward, forward + 1e-2 * forward.length() * random_point(i + 600, 1.0)];
        let bundle: RayBounds = corners.into_iter().map(|direction| Ray::new(eye, direction)).collect();
        let ray = ray(eye, 0.5 * (corners[0] + corners[1]));
        let direction = DVec3::from_array(std::array::from_fn(|k| 1.0 / f64::from(ray.inv[k])));
        let hit_of = |patch: PatchId| {
            // Somewhere behind the front of every third box.
            let t = entry(&boxes[patch.idx()], ray.origin(), direction).filter(|_| patch.0.is_multiple_of(3));
            t.map(|t| (t + 2e6 * random(u64::from(patch.0))) as f32)
        };
        let wanted = (0..N).filter_map(|patch| hit_of(PatchId(patch))).fold(f32::INFINITY, f32::min);
        for (nearest, n) in [
            run(NearestFromFront(&tree, &bundle, &ray, &hit_of)),
            NearestFromFront(&tree, &bundle, &ray, &hit_of).run(Portable),
        ] {
            assert_eq!(nearest, wanted, "bundle {i}");
            n_visits += n;
        }
        n_met += 2 * run(Visits(&tree, &ray)).len();
    }
    assert!(2 * n_visits < n_met, "hits hide little: {n_visits} of {n_met}");
}

#[test]
fn bundles_from_very_far_away_or_of_no_numbers_have_no_front() {
    let tree = TopLevel::build(&scattered(100, 1e6), 1);
    for eye in [DVec3::splat(1e9), DVec3::splat(f64::NAN), DVec3::new(f64::NEG_INFINITY, 0.0, 0.0)] {
        let bundle: RayBounds = [Ray::new(eye, -eye)].into_iter().collect();
        assert!(!tree.find_front(Portable, &bundle, &mut Front::default()), "{eye}");
    }
}

#[test]
fn the_next_leaf_of_a_node_is_announced_before_its_visit() {
    let tree = TopLevel::build(&scattered(500, 6e6), 1);
    let announced = std::cell::Cell::new(None);
    let ray = ray(DVec3::X, DVec3::new(1.0, 0.2, 0.1));
    let mut stack = TraversalStack::default();
    let mut walk = tree.walk(Portable, &ray, &mut stack);
    let mut n_announced = 0;
    let mut expected = None;
    while let Some(leaf) = walk.nearest(f32::INFINITY, |slot| announced.set(Some(slot))) {
        assert!(expected.is_none_or(|slot| slot == leaf.slot));
        expected = announced.take();
        n_announced += usize::from(expected.is_some());
    }
    assert!(n_announced > 0);
}

#[test]
fn the_lanes_of_a_node_come_in_the_order_of_their_entries() {
    let walls = [3, 7, 0, 5, 1, 6, 2, 4].map(|i| Vec3::new(1e6 * i as f32, -1e6, -1e6));
    let boxes = walls.map(|p| Bounds { min: p, max: p + 2e6 });
    let tree = TopLevel::build(&boxes, 1);
    for (from, sign) in [(-2e7, 1.0), (2e7, -1.0)] {
        let ray = ray(DVec3::X * from, DVec3::X * sign);
        let order: Vec<usize> = run(Visits(&tree, &ray)).iter().map(|leaf| leaf.patch.idx()).collect();
        let place = |patch: &usize| sign as f32 * walls[*patch].x;
        assert!(order.len() == 8 && order.is_sorted_by_key(place), "{order:?}");
    }
}

#[test]
fn boxes_without_number_in_one_place_are_a_tree_too() {
    for b in [
        Bounds { min: Vec3::splat(3.0), max: Vec3::splat(3.0) },
        Bounds { min: Vec3::splat(-8e6), max: Vec3::splat(8e6) },
    ] {
        for n in [THOROUGH, HASTY] {
            let tree = TopLevel::build(&vec![b; n], 2);
            let visits = run(Visits(&tree, &ray(DVec3::new(3.0, 3.0, -9e6), DVec3::Z)));
            assert_eq!(visits.len(), n);
            assert!(tree.stack_need < 300, "{}", tree.stack_need);
        }
    }
}

#[test]
fn a_ribbon_of_equal_boxes_makes_a_shallow_tree() {
    for n in [THOROUGH, 100_000] {
        let corners = (0..n).map(|i| Vec3::X * (64 * i) as f32);
        let boxes = corners.map(|p| Bounds { min: p, max: p + Vec3::new(64.0, 64.0, 0.0) });
        assert!(TopLevel::build(&boxes.collect::<Vec<_>>(), 2).stack_need < 200);
    }
}

#[test]
fn boxes_of_growing_size_make_a_tree_of_bounded_depth() {
    for n in [THOROUGH, HASTY] {
        let sizes = (0..n).map(|i| f32::powf(2.0, 24.0 * i as f32 / n as f32));
        let boxes = sizes.map(|r| Bounds { min: Vec3::splat(r), max: Vec3::splat(1.01 * r) });
        assert!(TopLevel::build(&boxes.collect::<Vec<_>>(), 2).stack_need < 400);
    }
}

#[test]
fn a_tree_takes_less_than_78_bytes_a_patch() {
    let tree = TopLevel::build(&scattered(20_000, 1e5), 2);
    let per_patch = tree.bytes() as f64 / 20_000.0;
    assert!(per_patch < 78.0, "{per_patch}");
}

#[test]
fn a_visit_finds_every_patch_but_for_those_in_boxes_that_are_not_entered() {
    let boxes = scattered(3000, 4e6);
    let tree = TopLevel::build(&boxes, 1);
    let is_left = |b: &Bounds| b.min.x < 0.0;
    let mut found = vec![];
    tree.visit(is_left, |patch, b| {
        assert_eq!(*b, boxes[patch.idx()]);
        found.push(patch.idx());
    });
    found.sort_unstable();
    assert!(found.windows(2).all(|w| w[0] < w[1]) && found.len() < 3000);
    assert!((0..3000).all(|k| !is_left(&boxes[k]) || found.binary_search(&k).is_ok()));
}

/// The leaves that a packet of rays that end at a place visits from its bundle's front, with the rays for which it
/// does; `None` if the rays are no packet.
struct PacketVisits<'a>(&'a TopLevel, DVec3, &'a [DVec3; PACKET], f32);

impl Task for PacketVisits<'_> {
    type Output = Option<Vec<(LeafRef, u32)>>;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Self::Output {
        let Self(tree, eye, directions, t_max) = self;
        let bundle: RayBounds = directions.iter().map(|&direction| Ray::new(eye, direction)).collect();
        let (mut front, mut packet, mut stack) = (Front::default(), RayPacket::default(), TraversalStack::default());
        assert!(tree.find_front(kernel, &bundle, &mut front));
        let along = [0, 1, 2].map(|axis| directions.map(|d| d[axis]));
        let origin = kernel.load4(&[eye.x, eye.y, eye.z, 0.0]);
        if !packet.set(kernel, origin, &along, &[t_max; PACKET]) {
            return None;
        }
        let is_empty = front.is_empty();
        let mut walk = (!is_empty).then(|| tree.walk_packet(kernel, &front, &packet, &mut stack));
        Some(std::iter::from_fn(|| walk.as_mut()?.next(&packet)).collect())
    }
}

#[test]
fn a_packet_visits_every_box_that_one_of_its_rays_meets() {
    let (mut n_packets, mut n_met, mut n_visits) = (0, 0, 0);
    for (size, n) in [(10.0, 1), (1e6, 2), (2e5, 3000), (3e6, 400)] {
        let boxes = scattered(n, size);
        let tree = TopLevel::build(&boxes, 2);
        for i in 0..200 {
            let (eye, target) = (random_point(i, 1.2e7), boxes[(i % n) as usize].center().as_dvec3());
            let spread = [0.0, 1e5, 1e6][i as usize % 3];
            let directions = std::array::from_fn(|k| target + random_point(8 * i + k as u64, spread) - eye);
            let visits = run(PacketVisits(&tree, eye, &directions, f32::INFINITY));
            let portable = PacketVisits(&tree, eye, &directions, f32::INFINITY).run(Portable);
            assert_eq!(visits, portable, "{n} boxes, packet {i}");
            let Some(visits) = visits else { continue };
            n_packets += 1;
            n_visits += visits.iter().map(|(_, rays)| rays.count_ones()).sum::<u32>();
            for (k, &direction) in directions.iter().enumerate() {
                for patch in (0..n as u32).filter(|&p| entry(&boxes[p as usize], eye, direction).is_some()) {
                    let is_visited = |(leaf, rays): &(LeafRef, u32)| leaf.patch.0 == patch && rays >> k & 1 == 1;
                    assert!(visits.iter().any(is_visited), "{n} boxes, packet {i}, ray {k}, box {patch}");
                    n_met += 1;
                }
            }
        }
    }
    assert!(n_packets > 400 && n_met > 10_000, "{n_packets} packets met {n_met} boxes");
    assert!(f64::from(n_visits) < 1.01 * f64::from(n_met), "{n_visits} visits of {n_met} boxes");
}

#[test]
fn a_packet_visits_no_box_beyond_the_ends_of_its_rays() {
    let boxes = scattered(3000, 1e6);
    let tree = TopLevel::build(&boxes, 2);
    let (mut n_near, mut n_far) = (0, 0);
    for i in 0..200 {
        let (eye, target) = (random_point(i, 1.2e7), boxes[i as usize].center().as_dvec3());
        let directions = std::array::from_fn(|k| target + random_point(8 * i + k as u64, 1e5) - eye);
        let Some(visits) = run(PacketVisits(&tree, eye, &directions, 0.5)) else { continue };
        for (k, &direction) in directions.iter().enumerate() {
            let entries = boxes.iter().enumerate().filter_map(|(p, b)| entry(b, eye, direction).map(|t| (p as u32, t)));
            for (patch, t) in entries {
                let is_visited = visits.iter().any(|(leaf, rays)| leaf.patch.0 == patch && rays >> k & 1 == 1);
                assert_eq!(is_visited, t <= 0.5, "packet {i}, ray {k}, box {patch} at {t}");
                (n_near, n_far) = if t <= 0.5 { (n_near + 1, n_far) } else { (n_near, n_far + 1) };
            }
        }
    }
    assert!(n_near > 1000 && n_far > 1000, "{n_near} boxes before the ends, {n_far} beyond");
}
