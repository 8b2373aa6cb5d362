//! Plates of leaves: what a box alone cannot tell.
//!
//! The box of a patch that is neither small nor parallel to its sides is mostly empty, and most rays that meet it pass
//! the patch by. A patch is a sheet, though: it lies in a **plate**, the space between two parallel planes, across its
//! middle normal. A ray whose way through the box is all above the plate, or all below, does not meet the patch;
//! nothing is looked up or built for it then.
//!
//! A node keeps the plates of its leaves in 44 bytes, as **heights** along the normals above the middles of their
//! boxes. Heights of the ray where it enters and leaves a box are compared with those: what lies between is between.
//!
//! # Why no plate hides a triangle that would be hit
//! Write u = 2^-24, and N for the sum of a normal's components, at most 381. [`LatticeRay`] has the rest of the words,
//! and shows that a hit of a triangle has a point P of it, in its plate, which is within 8 u `reach` along each axis of
//! the point of the ray at P's depth t; and that t lies between where the ray is said to enter the box and to leave it.
//! So the height of the ray at t is within 8 N u `reach` of the plate. Between two ends heights lie between those of
//! the ends, and these are computed with errors of
//!
//! * 5 N u `reach` for that of the origin above the middle of the box: half a step and rounding to f32 of the origin,
//!   one step of the middle, the rounding of their difference, of products and of sums,
//! * 3 N u `reach` for the slope times t,
//! * 2 N u `reach` for their sum,
//!
//! 18 N u `reach` in all. Plates are thickened by 40 N u `reach` on either side when they are put into nodes, with the
//! longest `reach` there is, 3 times 2^24: 120 N, some 120 to 210 lattice steps. All other rounding is outwards.
//!
//! Where the ray ends does not matter: of a triangle that is nearly a line the distance is not known well, and t may
//! lie behind a hit of another one that is said to be farther.

use super::traverse::spread;
use super::{EMPTY, LANES, LEAF, NodeBoxes, Nodes, Refs, TopLevel};
use crate::grid::{LatticeRay, SeenPlate};
use crate::math::Plate;
use crate::math::simd::Kernel;
use crate::parallel::for_each;
use glam::DVec3;
use parking_lot::Mutex;

/// Nodes that a thread gives their plates before it asks for more.
const NODES_PER_TASK: usize = 4096;

/// The plates of a node's leaves, as they are seen from the middles of their boxes. Other lanes have one that is all of
/// space.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Plates {
    /// x, y and z of normals.
    normals: [[i8; LANES]; 3],
    /// The heights of their middles, in units.
    middles: [i8; LANES],
    /// Half of their thickness.
    halves: [u8; LANES],
    unit: f32,
}

const _: () = assert!(size_of::<Plates>() == 44);

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

/// A plate as seen from the middle of its leaf's box.
struct Seen {
    lane: usize,
    normal: [i8; 3],
    middle: f64,
    half: f64,
}

impl Seen {
    fn new(lane: usize, plate: &Plate, boxes: &NodeBoxes) -> Self {
        let sums = [0, 1, 2].map(|axis| f64::from(boxes.planes[axis][lane]) + f64::from(boxes.planes[axis + 3][lane]));
        let from = Plate::height(plate.normal, 0.5 * DVec3::from_array(sums));
        let [low, high] = [plate.low, plate.high].map(|height| f64::from(height) - from);
        Self { lane, normal: plate.normal, middle: 0.5 * (low + high), half: 0.5 * (high - low) + plate.margin() }
    }
}

impl Plates {
    /// Those of the leaves among a node's lanes.
    fn of(boxes: &NodeBoxes, refs: &Refs, plates: &[Plate]) -> Self {
        let leaves = refs.iter().enumerate().filter(|(_, r)| **r != EMPTY && **r & LEAF != 0);
        let seen = leaves.map(|(lane, r)| Seen::new(lane, &plates[(r & !LEAF) as usize], boxes));
        let units = seen.clone().map(|of| (of.middle.abs() / 127.0).max(of.half / 254.0));
        let unit = (units.fold(0.0, f64::max) as f32).next_up();
        let mut out = Self { unit, ..Self::default() };
        for Seen { lane, normal, middle, half } in seen {
            let middle = middle / f64::from(unit);
            out.middles[lane] = middle.round() as i8;
            out.halves[lane] = (half / f64::from(unit) + (middle - middle.round()).abs()).ceil() as u8;
            (0..3).for_each(|axis| out.normals[axis][lane] = normal[axis]);
        }
        out
    }

    /// The plate of one lane as seen from a point. `boxes` has the leaf's box in lane `of_box`.
    #[inline(always)]
    pub fn seen_from(&self, origin: [i32; 3], boxes: &NodeBoxes, of_box: usize, lane: usize) -> SeenPlate {
        let (mut normal, mut start) = ([0.0; 3], 0.0);
        for axis in 0..3 {
            let planes = [boxes.planes[axis][of_box % LANES], boxes.planes[axis + 3][of_box % LANES]];
            normal[axis] = f32::from(self.normals[axis][lane % LANES]);
            start += normal[axis] * (origin[axis] as f32 - 0.5 * (planes[0] + planes[1]));
        }
        let middle = f32::from(self.middles[lane % LANES]) * self.unit;
        let half = f32::from(self.halves[lane % LANES]) * self.unit;
        SeenPlate { normal, start: start - middle, low: -half, high: half }
    }

    /// How far beyond its plate a ray stays that enters and leaves the node's boxes there, lane by lane: zero or less
    /// if it meets the plate.
    #[inline(always)]
    pub fn distance<K: Kernel>(&self, k: K, boxes: &NodeBoxes, ray: &SpreadRay<K>, enter: K::F, leave: K::F) -> K::F {
        let unit = k.splat(self.unit);
        let mut start = k.mul(k.widen_signed(&self.middles), k.sub(k.splat(-0.0), unit));
        let mut slope = k.splat(0.0);
        for axis in 0..3 {
            let normal = k.widen_signed(&self.normals[axis]);
            let twice_middle = k.add(k.load(&boxes.planes[axis]), k.load(&boxes.planes[axis + 3]));
            let from_middle = k.mul_add(twice_middle, k.splat(-0.5), ray.origin[axis]);
            start = k.mul_add(normal, from_middle, start);
            slope = k.mul_add(normal, ray.direction[axis], slope);
        }
        let (first, last) = (k.mul_add(enter, slope, start), k.mul_add(leave, slope, start));
        let (above, below) = (k.min(first, last), k.sub(k.splat(-0.0), k.max(first, last)));
        k.sub(k.max(above, below), k.mul(k.widen(&self.halves), unit))
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
                *of_node = Plates::of(&boxes[node], &refs[node], plates);
            }
        });
        drop(tasks);
        self
    }
}

#[cfg(test)]
mod tests {
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
                let unit = f64::from(kept.unit);
                let (middle, half) = (unit * f64::from(kept.middles[lane]), unit * f64::from(kept.halves[lane]));
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
