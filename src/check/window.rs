//! Parts of patches' grids: which cells lie around a place, and their vertices.

use super::incidence::SideRun;
use crate::ids::PatchId;
use crate::math::LatticeGrid;
use crate::scene::world::WorldMesh;
use crate::subdiv::snapped;
use crate::subdiv::{Dicer, PatchRates};

/// Lattice coordinates of a grid vertex.
pub(super) type Vertex = [i32; 3];

/// The cells i0..i1 by j0..j1 of a patch's grid; none where i0 = i1 or j0 = j1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub patch: PatchId,
    pub rates: PatchRates,
    pub i: [u32; 2],
    pub j: [u32; 2],
}

/// The border vertices, out of 0..=n, that lie at points `from..=to` of a side cut into `rate`.
fn border_range([from, to]: [u32; 2], n: u32, rate: u32) -> [u32; 2] {
    let first_at = |point: u32| {
        let (mut low, mut high) = (0, n + 1);
        while low < high {
            let middle = (low + high) / 2;
            if snapped(middle, n, rate) < point { low = middle + 1 } else { high = middle }
        }
        low
    };
    [first_at(from), first_at(to + 1) - 1]
}

fn widened([a, b]: [u32; 2], by: u32, n: u32) -> [u32; 2] {
    [a.saturating_sub(by), (b + by).min(n)]
}

/// The `depth` rows of `n` at the side where the coordinate is 0 or n.
fn rows_at(is_far: bool, depth: u32, n: u32) -> [u32; 2] {
    if is_far { [n.saturating_sub(depth), n] } else { [0, depth.min(n)] }
}

impl Window {
    /// The cells within `margin` of a run of border vertices.
    pub fn beside(mesh: &WorldMesh, run: SideRun, margin: u32) -> Self {
        let rates = mesh.patch_rates(run.patch);
        let along = |n: u32| widened(border_range([run.from, run.to], n, rates.sides[run.side]), margin, n);
        let across = |n: u32| rows_at(run.side == 1 || run.side == 2, margin, n);
        let (i, j) = match run.side {
            0 | 2 => (along(rates.n_u), across(rates.n_v)),
            _ => (across(rates.n_u), along(rates.n_v)),
        };
        Self { patch: run.patch, rates, i, j }
    }

    /// The border vertices of a run alone.
    pub fn border(mesh: &WorldMesh, run: SideRun) -> Self {
        let rates = mesh.patch_rates(run.patch);
        let along = |n: u32| border_range([run.from, run.to], n, rates.sides[run.side]);
        let end = |n: u32| if run.side == 1 || run.side == 2 { [n, n] } else { [0, 0] };
        let (i, j) = match run.side {
            0 | 2 => (along(rates.n_u), end(rates.n_v)),
            _ => (end(rates.n_u), along(rates.n_v)),
        };
        Self { patch: run.patch, rates, i, j }
    }

    /// The cells within `margin` of a corner of a patch.
    pub fn at_corner(mesh: &WorldMesh, patch: PatchId, corner: usize, margin: u32) -> Self {
        let rates = mesh.patch_rates(patch);
        let end = |far: bool, n: u32, side: usize| {
            let point = if far { rates.sides[side] } else { 0 };
            widened(border_range([point, point], n, rates.sides[side]), margin, n)
        };
        let (far_u, far_v) = ([1, 2].contains(&corner), corner >= 2);
        let i = end(far_u, rates.n_u, if far_v { 2 } else { 0 });
        let j = end(far_v, rates.n_v, if far_u { 1 } else { 3 });
        Self { patch, rates, i, j }
    }

    /// The cells within `margin` of the grid vertices `i` by `j`.
    pub fn around(mesh: &WorldMesh, patch: PatchId, i: [u32; 2], j: [u32; 2], margin: u32) -> Self {
        let rates = mesh.patch_rates(patch);
        Self { patch, rates, i: widened(i, margin, rates.n_u), j: widened(j, margin, rates.n_v) }
    }

    /// The lattice vertices, i fastest, into `out`.
    pub fn dice(&self, mesh: &WorldMesh, dicer: &mut Dicer, out: &mut Vec<Vertex>) {
        let mut grid = LatticeGrid::default();
        dicer.dice(mesh.surface(), self.patch, &self.rates, self.i, self.j, &mut grid);
        out.clear();
        out.extend(grid.points());
    }

    /// Whether some of the cells lie in a hole.
    pub fn has_hole(&self, mesh: &WorldMesh) -> bool {
        mesh.surface().edited().n_hidden_cells(self.patch, &self.rates, self.i, self.j) > 0
    }

    /// Calls `triangle` with the corners of every triangle; `vertices` are those of [`dice`](Self::dice).
    pub fn triangles(&self, vertices: &[Vertex], mut triangle: impl FnMut([Vertex; 3])) {
        let (columns, rows) = ((self.i[1] - self.i[0]) as usize, (self.j[1] - self.j[0]) as usize);
        for j in 0..rows {
            for i in 0..columns {
                let at = |di: usize, dj: usize| vertices[(j + dj) * (columns + 1) + i + di];
                triangle([at(0, 0), at(1, 0), at(0, 1)]);
                triangle([at(1, 1), at(0, 1), at(1, 0)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn border_vertices_of_a_coarse_side_fall_to_the_nearest_point() {
        assert_eq!(border_range([0, 0], 10, 1), [0, 4]);
        assert_eq!(border_range([1, 1], 10, 1), [5, 10]);
        assert_eq!(border_range([3, 5], 8, 8), [3, 5]);
        assert_eq!(border_range([0, 2], 9, 2), [0, 9]);
    }
}
