//! Plates of leaves ([`Plates`] has the idea): each node has those of its leaves, as seen from the middles of their
//! boxes.

use super::{EMPTY, LEAF, NodeBoxes, Nodes, Refs, TopLevel};
use crate::grid::{ExactPlates, LatticeRay, Plates};
use crate::math::Plate;
use crate::math::simd::{Kernel, spread};
use crate::parallel::for_each;
use glam::DVec3;
use parking_lot::Mutex;

/// Nodes that a thread gives their plates before it asks for more.
const NODES_PER_TASK: usize = 4096;

/// What plates need of a ray: origin and direction, each coordinate in all lanes.
pub(super) struct SpreadRay<K: Kernel> {
    origin: [K::F; 3],
    direction: [K::F; 3],
}

impl<K: Kernel> SpreadRay<K> {
    #[inline(always)]
    pub fn new(k: K, ray: &LatticeRay) -> Self {
        Self { origin: spread(k, k.floats_twice(&ray.cell)), direction: spread(k, k.load(&ray.towards)) }
    }
}

/// The plates of the leaves among a node's lanes.
fn plates_of(boxes: &NodeBoxes, refs: &Refs, plates: &[Plate]) -> Plates {
    let mut exact = ExactPlates::NONE;
    for (lane, r) in refs.iter().enumerate().filter(|(_, r)| **r != EMPTY && **r & LEAF != 0) {
        let sums = [0, 1, 2].map(|axis| f64::from(boxes.planes[axis][lane]) + f64::from(boxes.planes[axis + 3][lane]));
        exact.set(lane, &plates[(r & !LEAF) as usize], 0.5 * DVec3::from_array(sums));
    }
    exact.rounded()
}

impl NodeBoxes {
    /// How far beyond its plate a ray stays that enters and leaves the boxes there: see [`Plates::distance`].
    #[inline(always)]
    pub(super) fn distance_of_plates<K: Kernel>(
        &self,
        k: K,
        plates: &Plates,
        ray: &SpreadRay<K>,
        enter: K::F,
        leave: K::F,
    ) -> K::F {
        let mut from_middle = ray.origin;
        for (axis, from) in from_middle.iter_mut().enumerate() {
            let twice_middle = k.add(k.load(&self.planes[axis]), k.load(&self.planes[axis + 3]));
            *from = k.mul_add(twice_middle, k.splat(-0.5), *from);
        }
        plates.distance(k, from_middle, &ray.direction, enter, leave)
    }
}

impl TopLevel {
    /// Gives the leaves their plates, in lattice units: that of each patch holds every lattice vertex of it.
    pub fn with_plates(mut self, plates: &[Plate], n_threads: usize) -> Self {
        let Nodes { boxes, refs, plates: of_nodes } = &mut self.nodes;
        let nodes = of_nodes.chunks_mut(NODES_PER_TASK).enumerate().map(|(i, of_nodes)| (i * NODES_PER_TASK, of_nodes));
        let tasks: Vec<_> = nodes.map(Mutex::new).collect();
        for_each(&tasks, n_threads, |_, task| {
            let (first, of_nodes) = &mut *task.lock();
            for (node, of_node) in (*first..).zip(of_nodes.iter_mut()) {
                *of_node = plates_of(&boxes[node], &refs[node], plates);
            }
        });
        drop(tasks);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::LANES;
    use super::super::tests::{random, random_point};
    use super::*;
    use crate::grid::TriangleId;
    use crate::grid::{PACKET, RayPacket};
    use crate::ids::PatchId;
    use crate::math::Bounds;
    use crate::math::simd::{Portable, Task, run};
    use crate::math::{Ray, RayBounds};
    use crate::scene::accel::{Front, LeafRef, LeafWalk, TraversalStack};

    /// A quad that is somewhat bent: its corners, its box and its plate.
    fn sheet(n: u64, size: f64) -> ([DVec3; 4], Bounds, Plate) {
        let (p, u, v) = (random_point(4 * n, 6e6), random_point(4 * n + 1, size), random_point(4 * n + 2, size));
        let corners = [p, p + u, p + u + v + random_point(4 * n + 3, 0.05 * size), p + v].map(DVec3::round);
        let normal = Plate::normal_along(u.cross(v));
        let heights = corners.map(|p| Plate::height(normal, p));
        let [low, high] = [heights.into_iter().fold(f64::MAX, f64::min), heights.into_iter().fold(f64::MIN, f64::max)];
        (corners, corners.iter().map(|p| p.as_vec3()).collect(), Plate::around(normal, low, high))
    }

    /// As they are kept, plates hold the given ones with their margin, and little more.
    #[test]
    fn plates_are_rounded_outwards() {
        for (round, size) in (0..200).zip([30.0, 3e3, 4e6].into_iter().cycle()) {
            let sheets: Vec<_> = (0..8).map(|k| sheet(8 * round + k, size)).collect();
            let (boxes, plates): (Vec<_>, Vec<_>) = sheets.iter().map(|s| (s.1, s.2)).unzip();
            let tree = TopLevel::build(&boxes, 1).with_plates(&plates, 1);
            for leaf in tree.leaves() {
                let (node, lane) = (leaf.slot as usize / LANES, leaf.slot as usize % LANES);
                let (kept, plate) = (&tree.nodes.plates[node], &plates[leaf.patch.idx()]);
                let b = &boxes[leaf.patch.idx()];
                let above = Plate::height(plate.normal, 0.5 * (b.min.as_dvec3() + b.max.as_dvec3()));
                let [middle, half, unit] = kept.kept(lane);
                let below = f64::from(plate.low) - plate.margin() - (above + middle - half);
                let beyond = above + middle + half - (f64::from(plate.high) + plate.margin());
                // But for the rounding of f64.
                assert!(below > -1e-3 && beyond > -1e-3, "{below} {beyond}, {unit}");
                assert!(below + beyond < 3.1 * unit, "{below} {beyond}, {unit}");
            }
        }
    }

    /// Patches that a ray visits on its way to the nearest hit, and to any.
    struct Visits<'a>(&'a TopLevel, &'a LatticeRay);

    impl Task for Visits<'_> {
        type Output = [Vec<PatchId>; 2];
        #[inline(always)]
        fn run<K: Kernel>(self, k: K) -> Self::Output {
            let mut stacks = [TraversalStack::default(), TraversalStack::default()];
            let [of_closest, of_any] = &mut stacks;
            let mut closest = self.0.walk(k, self.1, of_closest);
            let mut any = self.0.walk_any(k, self.1, of_any);
            let patch = |leaf: LeafRef| leaf.patch;
            [
                std::iter::from_fn(|| closest.nearest(self.1.t_max, |_| ())).map(patch).collect(),
                std::iter::from_fn(|| any.next(|_| ())).map(patch).collect(),
            ]
        }
    }

    /// Patches that the first of a packet of rays visits; `None` if they are no packet.
    struct PacketVisits<'a>(&'a TopLevel, DVec3, [DVec3; PACKET], f32);

    impl Task for PacketVisits<'_> {
        type Output = Option<Vec<PatchId>>;
        #[inline(always)]
        fn run<K: Kernel>(self, k: K) -> Self::Output {
            let Self(tree, eye, directions, t_max) = self;
            let bundle: RayBounds = directions.iter().map(|&direction| Ray::new(eye, direction)).collect();
            let (mut front, mut packet, mut stack) = <(Front, RayPacket, TraversalStack)>::default();
            let along = [0, 1, 2].map(|axis| directions.map(|d| d[axis]));
            if !tree.find_front(k, &bundle, &mut front)
                || !packet.set(k, k.load4(&[eye.x, eye.y, eye.z, 0.0]), &along, &[t_max; PACKET])
            {
                return None;
            }
            let mut walk = tree.walk_packet(k, &front, &packet, &mut stack);
            let visits = std::iter::from_fn(|| walk.next(&packet));
            Some(visits.filter(|(_, rays)| rays & 1 == 1).map(|(leaf, _)| leaf.patch).collect())
        }
    }

    /// Rays that hit a sheet visit it, from wherever they come; of those that only meet its box few do.
    #[test]
    fn plates_hide_no_sheet_that_a_ray_hits_and_most_of_those_that_it_passes() {
        // Besides the sheet that is hit.
        let (mut n_visited, mut n_without, mut n_packets) = (0, 0, 0);
        for (i, size) in [40.0, 3e3, 1e5, 1.5e6].into_iter().enumerate() {
            let n = 500;
            let sheets: Vec<_> = (0..n).map(|k| sheet(k + 1000 * i as u64, size)).collect();
            let boxes: Vec<Bounds> = sheets.iter().map(|s| s.1).collect();
            let plates: Vec<Plate> = sheets.iter().map(|s| s.2).collect();
            let (without, tree) = (TopLevel::build(&boxes, 1), TopLevel::build(&boxes, 2).with_plates(&plates, 2));
            for k in 0..3000 {
                let (corners, ..) = sheets[k as usize % sheets.len()];
                let [u, v] = [random(7 * k), random(7 * k + 1)];
                // On one of the triangles; seen from its border, from near, from far or from within its plane.
                let [a, b, c] = if u > v { [0, 1, 2] } else { [0, 2, 3] }.map(|c| corners[c]);
                let (x, y) = if u > v { (u - v, v) } else { (u, v - u) };
                let target = a + x * (b - a) + y * (c - a);
                let direction = match k % 4 {
                    0 => b - a + random_point(k, 1e-3 * size),
                    1 => [DVec3::X, -DVec3::Y, DVec3::Z][k as usize % 3],
                    _ => random_point(k, 1.0),
                };
                let back = [0.0, 1e-2, 3.0, 300.0][k as usize / 4 % 4] * size / direction.length();
                let mut ray = LatticeRay::new(target - back * direction, direction, f32::INFINITY, TriangleId::NONE);
                if k % 3 == 0 {
                    // It ends where it hits.
                    ray = LatticeRay::new(target - back * direction, direction, back as f32, TriangleId::NONE);
                }
                for visits in [run(Visits(&tree, &ray)), Visits(&tree, &ray).run(Portable)] {
                    for visited in visits {
                        let patch = PatchId(k as u32 % sheets.len() as u32);
                        assert!(visited.contains(&patch), "ray {k} at {size}: {visited:?} without {patch:?}");
                        n_visited += visited.len() - 1;
                    }
                }
                let mut directions = [direction; PACKET];
                directions[1..].iter_mut().zip(0..).for_each(|(d, n)| *d += random_point(8 * k + n, 1e-6));
                let t_max = if k % 3 == 0 { back as f32 } else { f32::INFINITY };
                if let Some(visited) = run(PacketVisits(&tree, target - back * direction, directions, t_max)) {
                    let patch = PatchId(k as u32 % sheets.len() as u32);
                    assert!(visited.contains(&patch), "packet {k} at {size}: {visited:?} without {patch:?}");
                    n_packets += 1;
                }
                n_without += 2 * run(Visits(&without, &ray)).iter().map(|visited| visited.len() - 1).sum::<usize>();
            }
        }
        assert!(n_packets > 1000, "{n_packets} packets");
        assert!(10 * n_visited < 6 * n_without, "{n_visited} of {n_without} are visited");
    }
}
