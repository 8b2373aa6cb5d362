//! How steep triangles are whose vertices have moved along a side.

use super::edges::{HIDDEN, Measure, Steepest};
use super::{Borders, Slopes};
use crate::grid::{CellRect, PieceView};
use crate::math::simd::Kernel;
use glam::{DVec2, DVec3, IVec3};

/// Triangles at a moved side of a piece, by their derivatives along u and v.
#[derive(Default)]
pub(super) struct Strip {
    /// x, y and z along u, and along v.
    derivatives: [[[f32; 8]; 3]; 2],
    cells: [[usize; 2]; 8],
    n: usize,
}

/// A vertex: where it lies in u and v, in cells, and in the lattice.
type Corner = (DVec2, DVec3);

impl Strip {
    /// Those of all pieces of a patch. `None` if a triangle lies the wrong way round.
    pub fn of_pieces<'a>(pieces: impl Iterator<Item = PieceView<'a>>, borders: &Borders) -> Option<Vec<Self>> {
        let mut strips = Vec::new();
        for piece in pieces {
            let sides = borders.moved_sides(piece.cells());
            for side in (0..4).filter(|&side| sides[side]) {
                strips.extend(Self::at_side(&piece, side, borders)?);
            }
        }
        Some(strips)
    }

    /// The two triangles of each cell.
    fn at_side(piece: &PieceView<'_>, side: usize, borders: &Borders) -> Option<[Self; 2]> {
        let (CellRect { i0, j0, .. }, [n_u, n_v]) = (piece.cells(), piece.cells().size());
        let corner = |[i, j]: [usize; 2]| {
            let place = borders.place([usize::from(i0) + i, usize::from(j0) + j]);
            (place, IVec3::from_array(piece.vertex(i, j)).as_dvec3())
        };
        let (is_along_u, n) = (side == 0 || side == 2, [n_u, n_v][side % 2]);
        let cell = |along: usize| match side {
            0 => [along, 0],
            1 => [n_u - 1, along],
            2 => [along, n_v - 1],
            _ => [0, along],
        };
        let ends = |along: usize| {
            let [i, j] = cell(along);
            [corner([i, j]), corner(if is_along_u { [i, j + 1] } else { [i + 1, j] })]
        };
        let mut strips = [Self::default(), Self::default()];
        let mut last = ends(0);
        for along in 0..n {
            let next = ends(along + 1);
            let ([a, d], c) = if is_along_u { (last, next[1]) } else { ([last[0], next[0]], next[1]) };
            let b = if is_along_u { next[0] } else { last[1] };
            let [i, j] = cell(along);
            let cell = [usize::from(i0) + i, usize::from(j0) + j];
            strips[0].add(cell, [a, b, d])?;
            strips[1].add(cell, [c, d, b])?;
            last = next;
        }
        Some(strips)
    }

    /// Adds a triangle of a cell, unless it has no area in u and v, as where vertices have moved to one place.
    fn add(&mut self, cell: [usize; 2], [(at_a, a), (at_b, b), (at_c, c)]: [Corner; 3]) -> Option<()> {
        if at_a == at_b || at_a == at_c || at_b == at_c {
            return Some(());
        }
        let (to_b, to_c, b, c) = (at_b - at_a, at_c - at_a, b - a, c - a);
        // A tenth of a cell's: what is flatter than that, rounding may have turned.
        if to_b.perp_dot(to_c) < 0.1 {
            return None;
        }
        let derivatives = [b * to_c.y - c * to_b.y, c * to_b.x - b * to_c.x];
        for (lanes, derivative) in self.derivatives.iter_mut().zip(derivatives) {
            let [x, y, z] = derivative.as_vec3().to_array();
            (lanes[0][self.n], lanes[1][self.n], lanes[2][self.n]) = (x, y, z);
        }
        self.cells[self.n] = cell;
        self.n += 1;
        Some(())
    }

    #[inline(always)]
    pub fn measure<K: Kernel>(&self, k: K, by: [Measure; 2], slopes: &mut Slopes) {
        let hide = k.load(&std::array::from_fn(|lane| if lane < self.n { 0.0 } else { HIDDEN }));
        for axis in [0, 1] {
            let [x, y, z] = &self.derivatives[axis];
            let steepest = by[axis].steeper(k, [k.load(x), k.load(y), k.load(z)], hide, Steepest::none(k));
            for (seen, cell) in steepest.lanes(k).into_iter().zip(&self.cells[..self.n]) {
                slopes.add(axis, cell[axis], seen);
            }
        }
    }
}
