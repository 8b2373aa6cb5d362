//! Random numbers, blocks of bytes and wavy grids.

use crate::grid::{CellRect, PieceLayout, PieceView};
use crate::math::LatticeGrid;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// Random numbers that are the same in every run (splitmix64); the seed is the first state.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in the cube of half-width `r`.
    pub fn point(&mut self, r: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| r * (2.0 * self.unit() - 1.0)))
    }
}

/// A cache line, so that blocks are aligned as in the cache.
#[repr(C, align(64))]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Line([u8; 64]);

/// An encoded piece.
pub struct Piece(Vec<Line>);

impl Piece {
    pub fn new(vertices: &[[i32; 3]], cells: CellRect) -> Self {
        let vertices = LatticeGrid::from_points(vertices, cells.size()[0] + 1);
        let layout = PieceLayout::new(&vertices, cells, [cells.i1, cells.j1]);
        let mut lines = vec![Line([0xa5; 64]); layout.bytes() / 64];
        layout.encode(&vertices, bytemuck::cast_slice_mut(&mut lines));
        Self(lines)
    }

    pub fn view(&self) -> PieceView<'_> {
        PieceView::new(bytemuck::cast_slice(&self.0))
    }
}

/// The cells 0 <= i < n_u, 0 <= j < n_v.
pub fn whole(n_u: u16, n_v: u16) -> CellRect {
    CellRect { i0: 0, j0: 0, i1: n_u, j1: n_v }
}

/// A bumpy sheet of n_u x n_v cells of about `width` / 8 steps, in random orientation, around a random place.
pub fn sheet(random: &mut Random, n_u: usize, n_v: usize, width: f64) -> Vec<[i32; 3]> {
    let centre = random.point(8e6 - 0.7 * width);
    let (u, v, w) = (random.point(1.0).normalize(), random.point(1.0).normalize(), random.point(1.0).normalize());
    let point =
        |i: usize, j: usize, bump: f64| centre + width / 8.0 * ((i as f64 - 4.0) * u + (j as f64 - 4.0) * v + bump * w);
    let places = (0..=n_v).flat_map(|j| (0..=n_u).map(move |i| (i, j)));
    places.map(|(i, j)| point(i, j, random.unit()).round().as_ivec3().to_array()).collect()
}
