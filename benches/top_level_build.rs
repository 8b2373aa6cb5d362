//! How long does the tree over the patches take to build, and to walk? `cargo bench --bench top_level_build`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::{DVec3, Vec3};
use lazytess::grid::{LatticeRay, TriangleId};
use lazytess::math::Bounds;
use lazytess::math::simd::{Kernel, Task, run};
use lazytess::scene::accel::{TopLevel, TraversalStack};
use std::f64::consts::TAU;

fn main() {
    divan::main();
}

/// The boxes of n x n patches of a bumpy torus that fills the lattice.
fn torus(n: usize) -> Vec<Bounds> {
    let point = |i: usize, j: usize| {
        let (u, v) = (TAU * i as f64 / n as f64, TAU * j as f64 / n as f64);
        let tube = 2.4e6 + 2e5 * (9.0 * u).sin() * (11.0 * v).cos();
        let ring = 5e6 + tube * v.cos();
        DVec3::new(ring * u.cos(), ring * u.sin(), tube * v.sin()).as_vec3()
    };
    let corners = |i: usize, j: usize| [point(i, j), point(i + 1, j), point(i, j + 1), point(i + 1, j + 1)];
    (0..n * n).map(|p| corners(p % n, p / n).into_iter().collect()).collect()
}

#[divan::bench(args = [100, 316, 1000])]
fn build(bencher: Bencher, n: usize) {
    let boxes = torus(n);
    bencher.counter(ItemsCount::new(n * n)).bench(|| TopLevel::build(black_box(&boxes), 1));
}

/// Rays between random places of the mesh's cube; a patch is hit if the ray comes near the middle of its box.
struct Walk<'a> {
    tree: &'a TopLevel,
    boxes: &'a [Bounds],
    n_rays: usize,
}

impl Task for Walk<'_> {
    type Output = usize;
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> usize {
        let mut stack = TraversalStack::default();
        let mut n_leaves = 0;
        for r in 0..self.n_rays {
            let at = |k: usize, x: f64| 14e6 * ((r as f64 * 3.0 + k as f64) * x).fract() - 7e6;
            let [from, to] = [0.618_033_988_7, 0.754_877_666_2].map(|x| DVec3::new(at(0, x), at(1, x), at(2, x)));
            let ray = LatticeRay::new(from, to - from, f32::INFINITY, TriangleId::NONE);
            let (origin, direction) = (from.as_vec3(), (to - from).as_vec3());
            self.tree.closest(kernel, &ray, &mut stack, |leaf, t_max| {
                n_leaves += 1;
                let b = self.boxes[leaf.patch.idx()];
                let nearest = nearest(origin, direction, b.center());
                if nearest.distance(b.center()) < 0.3 * b.diagonal() {
                    *t_max = t_max.min(nearest.distance(origin) / (to - from).as_vec3().abs().max_element());
                }
            });
        }
        n_leaves
    }
}

fn nearest(origin: Vec3, direction: Vec3, p: Vec3) -> Vec3 {
    origin + direction * ((p - origin).dot(direction) / direction.length_squared()).max(0.0)
}

#[divan::bench(args = [100, 316, 1000])]
fn walk(bencher: Bencher, n: usize) {
    let boxes = torus(n);
    let tree = TopLevel::build(&boxes, 1);
    let n_rays = 10_000;
    let walk = || run(Walk { tree: &tree, boxes: &boxes, n_rays });
    println!(
        "{:.1} bytes a patch, {:.2} leaves a ray",
        tree.bytes() as f64 / (n * n) as f64,
        walk() as f64 / n_rays as f64
    );
    bencher.counter(ItemsCount::new(n_rays)).bench(|| black_box(walk()));
}
