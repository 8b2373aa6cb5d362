//! Closed surfaces of several pieces: no ray passes.

use super::support::{Piece, Random};
use crate::grid::{CellRect, LatticeHit, LatticeRay, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::{Kernel, Task, run};
use glam::{DVec3, IVec3};
use std::f64::consts::TAU;

/// Cells around and along the closed surfaces.
const CELLS: usize = 24;

/// A closed surface in lattice space: `CELLS` x `CELLS` cells that wrap around, in pieces of 8x8, 5x8 and 3x8 cells.
struct Closed {
    vertices: Vec<[i32; 3]>,
    pieces: Vec<Piece>,
}

impl Closed {
    fn new(surface: impl Fn(f64, f64) -> DVec3) -> Self {
        // The last row and column are the first ones again, to the bit.
        let at = |k: usize| (k % CELLS) as f64 / CELLS as f64;
        let row = |j: usize| (0..=CELLS).map(move |i| (i, j));
        let places = (0..=CELLS).flat_map(row);
        let vertices: Vec<_> = places.map(|(i, j)| surface(at(i), at(j)).round().as_ivec3().to_array()).collect();
        let columns = [0, 8, 13, 16, 24];
        let cut = |k: usize, j: usize| (columns[k], columns[k + 1], j, j + 8);
        let rects = (0..4).flat_map(|k| [0, 8, 16].map(|j| cut(k, j)));
        let pieces = rects.map(|(i0, i1, j0, j1)| piece(&vertices, i0, i1, j0, j1)).collect();
        Self { vertices, pieces }
    }

    fn torus(centre: DVec3, great: f64, small: f64) -> Self {
        Self::new(|u, v| {
            let ring = great + small * (v * TAU).cos();
            centre + DVec3::new(ring * (u * TAU).cos(), ring * (u * TAU).sin(), small * (v * TAU).sin())
        })
    }

    /// Vertex (i, j), wrapped around.
    fn vertex(&self, i: usize, j: usize) -> DVec3 {
        IVec3::from_array(self.vertices[j % CELLS * (CELLS + 1) + i % CELLS]).as_dvec3()
    }

    /// A vertex, or a place on an edge of the cell (i, j).
    fn on_edge(&self, random: &mut Random) -> DVec3 {
        let [i, j, kind] = [random.bits(), random.bits(), random.bits()].map(|b| (b >> 8) as usize % CELLS);
        let (a, b) = (self.vertex(i, j), [self.vertex(i + 1, j), self.vertex(i, j + 1)][kind % 2]);
        match kind % 4 {
            0 => a,
            1 => self.vertex(i + 1, j).lerp(self.vertex(i, j + 1), random.unit()),
            _ => a.lerp(b, random.unit()),
        }
    }
}

fn piece(vertices: &[[i32; 3]], i0: usize, i1: usize, j0: usize, j1: usize) -> Piece {
    let row = |j: usize| vertices[j * (CELLS + 1)..][i0..=i1].iter().copied();
    let part: Vec<_> = (j0..=j1).flat_map(row).collect();
    let [i0, i1, j0, j1] = [i0, i1, j0, j1].map(|k| k as u16);
    Piece::new(&part, CellRect { i0, j0, i1, j1 })
}

/// How many rays, of those from `make`, hit nothing of the surface.
struct CountPassing<'a, F> {
    surface: &'a Closed,
    n_rays: usize,
    make: F,
}

impl<F: FnMut() -> LatticeRay> Task for CountPassing<'_, F> {
    type Output = usize;
    #[inline(always)]
    fn run<K: Kernel>(mut self, kernel: K) -> usize {
        let views: Vec<_> = self.surface.pieces.iter().map(Piece::view).collect();
        let mut n_passing = 0;
        for _ in 0..self.n_rays {
            let ray = (self.make)();
            let mut hit = LatticeHit::none(ray.t_max());
            for view in &views {
                view.closest(kernel, &ray, PatchId(0), &mut hit);
            }
            let is_occluded = views.iter().any(|v| v.occluded(kernel, &ray, PatchId(0)));
            n_passing += usize::from(!hit.is_some() || !is_occluded);
        }
        n_passing
    }
}

fn ray(origin: DVec3, direction: DVec3) -> LatticeRay {
    LatticeRay::new(origin, direction, f32::INFINITY, TriangleId::NONE)
}

#[test]
fn no_ray_leaves_a_torus_through_its_edges() {
    for (scale, centre) in [(6e6, DVec3::ZERO), (4e4, DVec3::new(8e6, -8.1e6, 7.9e6)), (300.0, DVec3::splat(-8.3e6))] {
        let torus = Closed::torus(centre, scale, 0.4 * scale);
        let mut random = Random(21);
        let make = || {
            let target = torus.on_edge(&mut random);
            let angle = TAU * random.unit();
            let ring = DVec3::new(angle.cos(), angle.sin(), 0.0);
            // Inside: near the ring that runs through the middle of the tube.
            let origin = centre + scale * ring + random.point(0.1 * scale);
            ray(origin, target - origin)
        };
        let n_rays = 170_000;
        assert_eq!(run(CountPassing { surface: &torus, n_rays, make }), 0, "of {n_rays} rays, at scale {scale}");
    }
}

#[test]
fn no_axis_parallel_ray_leaves_a_torus() {
    let torus = Closed::torus(DVec3::ZERO, 6e6, 2.4e6);
    let mut random = Random(22);
    let make = || {
        let (i, j) = ((random.bits() >> 20) as usize % CELLS, (random.bits() >> 20) as usize % CELLS);
        // From a vertex, or from an edge of the same column, towards the inside of the tube along z.
        let origin = torus.vertex(i, j).lerp(torus.vertex(i + 1, j), [0.0, 0.5, random.unit()][j % 3]);
        let zero = if i % 2 == 0 { 0.0 } else { -0.0 };
        ray(DVec3::new(origin.x, origin.y, 0.0), DVec3::new(zero, -zero, if j % 2 == 0 { 1.0 } else { -1.0 }))
    };
    assert_eq!(run(CountPassing { surface: &torus, n_rays: 250_000, make }), 0);
}

#[test]
fn no_ray_from_outside_passes_the_edges_of_a_torus() {
    let torus = Closed::torus(DVec3::ZERO, 6e6, 2.4e6);
    let mut random = Random(23);
    let make = || {
        // Through an edge into the tube, from any distance up to the end of f64's patience.
        let target = torus.on_edge(&mut random);
        let ring = 6e6 * DVec3::new(target.x, target.y, 0.0).normalize();
        let direction = (ring + random.point(1e6) - target) * f64::powf(10.0, 8.0 * random.unit());
        let origin = target - direction * f64::powf(10.0, 3.0 * random.unit() - 8.0);
        ray(origin, direction)
    };
    assert_eq!(run(CountPassing { surface: &torus, n_rays: 250_000, make }), 0);
}
