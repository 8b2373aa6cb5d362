//! Plates of a node's children hide none that a ray hits.

use super::support::Random;
use crate::grid::{CellRect, LatticeRay, NodeView, PACKET, RayPacket, SeenBoxes, TriangleId, encode_node, node_bytes};
use crate::math::simd::{Kernel, Portable, Task, run};
use crate::math::{Bounds, Envelope, Plate};
use glam::DVec3;

/// Triangles near a plane through the origin, some steps or up to half of the lattice in size.
fn sheets(random: &mut Random, n: usize, size: f64) -> Vec<[DVec3; 3]> {
    let (middle, u, v) = (random.point(4e6), random.point(1.0), random.point(1.0));
    let mut corner = |p: DVec3| {
        let [x, y] = [0, 1].map(|_| size * (random.unit() - 0.5));
        (p + x * u + y * v + random.point(0.01 * size)).round()
    };
    (0..n).map(|_| corner(middle)).collect::<Vec<_>>().into_iter().map(|p| [(); 3].map(|()| corner(p))).collect()
}

fn envelope(has_normal: bool, corners: &[DVec3; 3]) -> Envelope {
    let [a, b, c] = *corners;
    let normal = if has_normal { Plate::normal_along((b - a).cross(c - a)) } else { [0; 3] };
    let heights = corners.map(|p| Plate::height(normal, p));
    let [low, high] = [heights.into_iter().fold(f64::MAX, f64::min), heights.into_iter().fold(f64::MIN, f64::max)];
    Envelope {
        bounds: corners.iter().map(|p| p.as_vec3()).collect::<Bounds>(),
        plate: Plate::around(normal, low, high),
    }
}

/// Children that a ray visits on its way to the nearest hit, to any, and in a packet of eight rays along directions
/// that are all much like its own; none of a packet that is none.
struct Met<'a>(NodeView<'a>, DVec3, [DVec3; PACKET], f32);

impl Task for Met<'_> {
    type Output = [Option<u32>; 3];
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Self::Output {
        let Self(node, origin, directions, t_max) = self;
        let ray = LatticeRay::new(origin, directions[0], t_max, TriangleId::NONE);
        let (closest, any) = (node.test(k, &ray, ray.t_max).mask, node.lanes_met(k, &ray, ray.t_max));
        let (mut packet, mut seen) = (RayPacket::default(), SeenBoxes::UNSET);
        let along = [0, 1, 2].map(|axis| directions.map(|d| d[axis]));
        let origin = k.load4(&[origin.x, origin.y, origin.z, 0.0]);
        let is_packet = packet.set(k, origin, &along, &[t_max; PACKET]);
        let of_packet = is_packet.then(|| {
            let met = node.test_packet(k, &packet, &mut seen).mask;
            let is_met = |lane: &u32| seen.meeting_plate(k, &packet, *lane as usize, node) & 1 == 1;
            (0..16).filter(|lane| met >> lane & 1 == 1).filter(is_met).map(|lane| 1 << lane).sum()
        });
        [Some(closest), Some(any), of_packet]
    }
}

#[test]
fn no_child_that_a_ray_hits_is_hidden_and_some_that_it_passes_are() {
    let mut random = Random(5);
    let (mut n_packets, mut n_visited, mut n_boxes) = (0, 0, 0);
    for round in 0..2000 {
        let size = [30.0, 3e3, 2e5, 6e6][round % 4];
        let children = [[2, 2], [4, 4], [1, 3]][round % 3];
        let sheets = sheets(&mut random, usize::from(children[0] * children[1]), size);
        let mut envelopes: Vec<_> = sheets.iter().map(|corners| envelope(round % 10 != 0, corners)).collect();
        let first_child = if round % 7 == 0 { 1 } else { 0 };
        envelopes[..first_child].fill(Envelope::EMPTY);
        let mut bytes = vec![0u32; node_bytes(children) / 4];
        let cells = CellRect { i0: 0, j0: 0, i1: 32, j1: 32 };
        encode_node(cells, children, &envelopes, bytemuck::cast_slice_mut(&mut bytes));
        let node = NodeView::new(bytemuck::cast_slice(&bytes));
        for child in first_child..sheets.len() {
            let [a, b, c] = sheets[child];
            let [x, y] = [random.unit(), random.unit()];
            let [x, y] = if x + y < 1.0 { [x, y] } else { [1.0 - x, 1.0 - y] };
            let target = a + x * (b - a) + y * (c - a);
            let direction = if round % 5 == 0 && a != b { b - a } else { random.point(1.0) };
            let back = [0.0, 0.01, 3.0, 300.0][child % 4] * size / direction.length();
            let mut directions = [direction; PACKET];
            directions[1..].iter_mut().for_each(|d| *d += random.point(1e-6));
            let t_max = if child % 3 == 0 { back as f32 } else { f32::INFINITY };
            let [u, v] = [child % usize::from(children[0]), child / usize::from(children[0])];
            let lane = 4 * v + u;
            for met in [
                run(Met(node, target - back * direction, directions, t_max)),
                Met(node, target - back * direction, directions, t_max).run(Portable),
            ] {
                n_packets += usize::from(met[2].is_some());
                n_visited += met[0].map_or(0, |met| met.count_ones() - 1);
                for met in met.into_iter().flatten() {
                    assert!(met >> lane & 1 == 1, "round {round}: {met:016b} without {lane}");
                }
            }
            let ray = LatticeRay::new(target - back * direction, direction, t_max, TriangleId::NONE);
            n_boxes += 2 * (node.head.lanes_met(Portable, &ray, ray.t_max).count_ones() - 1);
        }
    }
    assert!(n_packets > 1000, "{n_packets} packets");
    assert!(10 * n_visited < 9 * n_boxes, "{n_visited} of {n_boxes} are visited");
}
