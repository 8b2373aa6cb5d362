//! Sides of a patch that its neighbours share, and that are cut as they ask.

use crate::grid::CellRect;
use glam::DVec2;

/// Where the vertices of a patch's grid lie: those of a side with fewer segments than the grid has cells have moved to
/// the segments' ends.
pub struct Borders {
    /// All cells of the patch.
    pub cells: CellRect,
    /// Of the sides v = 0, u = 1, v = 1 and u = 0: where each of the vertices lies along u or v, in cells. Empty where
    /// none has moved.
    pub moved: [Vec<f64>; 4],
}

impl Borders {
    /// Which of the moved sides a part of the grid has cells at.
    pub(super) fn moved_sides(&self, part: CellRect) -> [bool; 4] {
        let CellRect { i0, i1, j0, j1 } = self.cells;
        let [low, right, high, left] = &self.moved;
        [
            !low.is_empty() && part.j0 == j0,
            !right.is_empty() && part.i1 == i1,
            !high.is_empty() && part.j1 == j1,
            !left.is_empty() && part.i0 == i0,
        ]
    }

    /// Where a vertex lies, in cells.
    pub(super) fn place(&self, [i, j]: [usize; 2]) -> DVec2 {
        let [n_u, n_v] = self.cells.size();
        let [low, right, high, left] = &self.moved;
        let along = |is_there: bool, side: &[f64], k: usize| side.get(k).copied().filter(|_| is_there);
        let u = along(j == 0, low, i).or(along(j == n_v, high, i)).unwrap_or(i as f64);
        let v = along(i == 0, left, j).or(along(i == n_u, right, j)).unwrap_or(j as f64);
        DVec2::new(u, v)
    }

    /// How far vertices have moved along u, and along v, at most.
    pub(super) fn farthest(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let ways = [axis, axis + 2].map(|side| {
                let ways = self.moved[side].iter().enumerate().map(|(k, place)| (place - k as f64).abs());
                ways.fold(0.0, f64::max)
            });
            ways[0].max(ways[1])
        })
    }
}
