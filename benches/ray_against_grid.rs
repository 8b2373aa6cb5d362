//! What does a ray cost against one piece of 8x8 cells, and what does writing the piece cost? `cargo bench --bench
//! ray_against_grid`

use bytemuck::{Pod, Zeroable};
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::DVec3;
use lazytess::grid::{CellRect, LatticeHit, LatticeRay, PACKET, PieceLayout, PieceView, RayPacket, TriangleId};
use lazytess::ids::PatchId;
use lazytess::math::LatticeGrid;
use lazytess::math::simd::{Kernel, Portable, Task, run};

fn main() {
    divan::main();
}

const CELLS: CellRect = CellRect { i0: 0, j0: 0, i1: 8, j1: 8 };

/// A cache line.
#[repr(C, align(64))]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Line([u8; 64]);

/// A bump of 9x9 vertices, `width` steps wide.
fn vertices(width: f64) -> LatticeGrid {
    let point = |i: f64, j: f64| DVec3::new(i, j, 1.5 - 0.1 * ((i - 4.0).powi(2) + (j - 3.0).powi(2))) * width / 8.0;
    let lattice = |v: u32| point(f64::from(v % 9), f64::from(v / 9)).round().as_ivec3().to_array();
    LatticeGrid::from_points(&(0..81).map(lattice).collect::<Vec<_>>(), 9)
}

fn piece(vertices: &LatticeGrid) -> Vec<Line> {
    let layout = PieceLayout::new(vertices, CELLS, [8; 2]);
    let mut block = vec![Line([0; 64]); layout.bytes() / 64];
    layout.encode(vertices, bytemuck::cast_slice_mut(&mut block));
    block
}

/// Rays from above towards the piece; most hit it.
fn rays(width: f64) -> Vec<LatticeRay> {
    let ray = |r: usize| {
        let [a, b, c] = [0.618_033_988_7, 0.754_877_666_2, 0.569_840_290_9].map(|x| (r as f64 * x).fract());
        let target = DVec3::new(0.9 * a + 0.05, 0.9 * b + 0.05, 0.1) * width;
        let origin = DVec3::new(c - 0.5, 0.5 - a * c, 1.5) * width;
        LatticeRay::new(origin, target - origin, f32::INFINITY, TriangleId::NONE)
    };
    (0..4096).map(ray).collect()
}

/// Traces all rays and counts the hits.
struct Closest<'a>(PieceView<'a>, &'a [LatticeRay]);

impl Task for Closest<'_> {
    type Output = usize;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> usize {
        let mut n_hits = 0;
        for ray in self.1 {
            let mut hit = LatticeHit::none(ray.t_max());
            n_hits += usize::from(self.0.closest(kernel, ray, PatchId(0), &mut hit));
        }
        n_hits
    }
}

/// Traces packets of rays from one point and counts the hits.
struct ClosestOfPackets<'a>(PieceView<'a>, DVec3, &'a [[[f64; PACKET]; 3]]);

impl Task for ClosestOfPackets<'_> {
    type Output = usize;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> usize {
        let Self(piece, eye, packets) = self;
        let (mut packet, mut n_hits) = (RayPacket::default(), 0);
        for directions in packets {
            let is_packet =
                packet.set(kernel, kernel.load4(&[eye.x, eye.y, eye.z, 0.0]), directions, &[f32::MAX; PACKET]);
            assert!(is_packet, "rays that go about the same way");
            piece.closest_of_packet(kernel, &mut packet, 0xff, PatchId(0));
            n_hits += (0..PACKET).filter(|&ray| packet.hit(ray).is_some()).count();
        }
        n_hits
    }
}

/// Counts the occluded rays.
struct Occluded<'a>(PieceView<'a>, &'a [LatticeRay]);

impl Task for Occluded<'_> {
    type Output = usize;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> usize {
        let mut n_occluded = 0;
        for ray in self.1 {
            n_occluded += usize::from(self.0.occluded(kernel, ray, PatchId(0)));
        }
        n_occluded
    }
}

/// Widths that need 16 and 24 bits.
const WIDTHS: [f64; 2] = [40_000.0, 4e6];

#[divan::bench(args = WIDTHS)]
fn closest(bencher: Bencher, width: f64) {
    let (block, rays) = (piece(&vertices(width)), rays(width));
    let view = PieceView::new(bytemuck::cast_slice(&block));
    bencher.counter(ItemsCount::new(rays.len())).bench(|| run(Closest(view, black_box(&rays))));
}

/// Rays from one point to 32 x 32 places of a quarter of the piece, those of 4 x 2 places together; making them ready counts.
#[divan::bench(args = WIDTHS)]
fn closest_of_packets(bencher: Bencher, width: f64) {
    let block = piece(&vertices(width));
    let view = PieceView::new(bytemuck::cast_slice(&block));
    let eye = DVec3::new(0.4, 0.3, 1.5) * width;
    let direction = |x: usize, y: usize| DVec3::new(x as f64 / 64.0, y as f64 / 64.0, 0.1) * width - eye;
    let directions = |p: usize| {
        let places = std::array::from_fn(|k| direction(32 + p % 8 * 4 + k % 4, 32 + p / 8 * 2 + k / 4));
        [0, 1, 2].map(|axis| places.map(|d: DVec3| d[axis]))
    };
    let packets: Vec<[[f64; PACKET]; 3]> = (0..128).map(directions).collect();
    let rays = ItemsCount::new(packets.len() * PACKET);
    bencher.counter(rays).bench(|| run(ClosestOfPackets(view, eye, black_box(&packets))));
}

#[divan::bench(args = WIDTHS)]
fn occluded(bencher: Bencher, width: f64) {
    let (block, rays) = (piece(&vertices(width)), rays(width));
    let view = PieceView::new(bytemuck::cast_slice(&block));
    bencher.counter(ItemsCount::new(rays.len())).bench(|| run(Occluded(view, black_box(&rays))));
}

#[divan::bench(args = WIDTHS)]
fn closest_portable(bencher: Bencher, width: f64) {
    let (block, rays) = (piece(&vertices(width)), rays(width));
    let view = PieceView::new(bytemuck::cast_slice(&block));
    bencher.counter(ItemsCount::new(rays.len())).bench(|| Closest(view, black_box(&rays)).run(Portable));
}

#[divan::bench]
fn make_ray(bencher: Bencher) {
    let (origin, direction) = (DVec3::new(1e6, 2e6, 3e6), DVec3::new(0.3, -0.2, 0.9));
    bencher.bench(|| LatticeRay::new(black_box(origin), black_box(direction), f32::INFINITY, TriangleId::NONE));
}

#[divan::bench(args = WIDTHS)]
fn encode(bencher: Bencher, width: f64) {
    let vertices = vertices(width);
    let mut block = [Line([0; 64]); 18];
    bencher.bench_local(|| {
        let layout = PieceLayout::new(black_box(&vertices), CELLS, [8; 2]);
        layout.encode(&vertices, &mut bytemuck::cast_slice_mut(&mut block)[..layout.bytes()]);
    });
}
