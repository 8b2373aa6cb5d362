//! The lines around those blocks of a patch that are in the sheet.

use super::measure::{Block, Division};
use crate::grid::PieceView;
use crate::grid::frame::PARTS;
use std::ops::Range;

/// Vertices of the sides v = 0, u = 1, v = 1, u = 0, one after the other around the patch, each once.
pub(super) type Sides = [Vec<[i32; 3]>; 4];

/// What is around blocks of a patch.
pub(super) struct Outline {
    /// Vertices one after the other, each once, as one goes around counter-clockwise.
    pub lines: Vec<Vec<[i32; 3]>>,
    /// Whether they are the patch's sides.
    pub is_whole: bool,
}

/// The sides of the patch that these are all pieces of.
pub(super) fn sides_of(pieces: &[PieceView<'_>], [n_u, n_v]: [usize; 2]) -> Sides {
    let mut sides = [n_u, n_v, n_u, n_v].map(|n| vec![[0; 3]; n + 1]);
    for piece in pieces {
        let (cells, [columns, rows]) = (piece.cells(), piece.cells().size());
        let [i0, i1, j0, j1] = [cells.i0, cells.i1, cells.j0, cells.j1].map(usize::from);
        for i in 0..=columns {
            if j0 == 0 {
                sides[0][i0 + i] = piece.vertex(i, 0);
            }
            if j1 == n_v {
                sides[2][n_u - i0 - i] = piece.vertex(i, rows);
            }
        }
        for j in 0..=rows {
            if i1 == n_u {
                sides[1][j0 + j] = piece.vertex(columns, j);
            }
            if i0 == 0 {
                sides[3][n_v - j0 - j] = piece.vertex(0, j);
            }
        }
    }
    sides.iter_mut().for_each(Vec::dedup);
    sides
}

/// What is around the blocks that are seen.
pub(super) fn lines_around(
    blocks: &[Block],
    division: &Division,
    pieces: &[PieceView<'_>],
    cells: [usize; 2],
    sides: Sides,
) -> Vec<Vec<[i32; 3]>> {
    let ([n_a, n_b], vertices) = (division.n_blocks(), VertexGrid::of(pieces, cells));
    let is_seen = |a: usize, b: usize| blocks[n_a * b + a].is_seen;
    let along =
        |side: usize| (0..[n_a, n_b][side % 2]).map(move |k| [[k, 0], [n_a - 1, k], [k, n_b - 1], [0, k]][side]);
    // A side of the patch in one line, where that can be: other patches have it so.
    let is_whole = [0, 1, 2, 3].map(|side| along(side).all(|[a, b]| is_seen(a, b)));
    let mut lines: Vec<Vec<[i32; 3]>> =
        sides.into_iter().zip(is_whole).filter_map(|(line, is_whole)| is_whole.then_some(line)).collect();
    let [of_u, of_v] = [0, 1].map(|axis| division.ranges(axis));
    for (b, a) in (0..n_b).flat_map(|b| (0..n_a).map(move |a| (b, a))).filter(|&(b, a)| is_seen(a, b)) {
        let (Range { start: i0, end: i1 }, Range { start: j0, end: j1 }) = (of_u[a].clone(), of_v[b].clone());
        let is_open = |is_last: bool, side: usize, [a, b]: [usize; 2]| match is_last {
            true => !is_whole[side],
            false => !is_seen(a, b),
        };
        if is_open(b == 0, 0, [a, b.wrapping_sub(1)]) {
            lines.push((i0..=i1).map(|i| vertices.at(i, j0)).collect());
        }
        if is_open(a + 1 == n_a, 1, [a + 1, b]) {
            lines.push((j0..=j1).map(|j| vertices.at(i1, j)).collect());
        }
        if is_open(b + 1 == n_b, 2, [a, b + 1]) {
            lines.push((i0..=i1).rev().map(|i| vertices.at(i, j1)).collect());
        }
        if is_open(a == 0, 3, [a.wrapping_sub(1), b]) {
            lines.push((j0..=j1).rev().map(|j| vertices.at(i0, j)).collect());
        }
    }
    lines.iter_mut().for_each(Vec::dedup);
    lines
}

/// The corners of a part, as the patch has them; `None` if there is no such part.
pub(super) fn corners_of_part(part: usize, vertices: &VertexGrid, cells: [usize; 2]) -> Option<[[i32; 3]; 4]> {
    let in_parts = Division::in_parts(cells);
    let Range { start: i0, end: i1 } = *in_parts.ranges(0).get(part % PARTS)?;
    let Range { start: j0, end: j1 } = *in_parts.ranges(1).get(part / PARTS)?;
    Some([[i0, j0], [i1, j0], [i1, j1], [i0, j1]].map(|[i, j]| vertices.at(i, j)))
}

/// The vertices of a patch, row by row.
pub(super) struct VertexGrid {
    columns: usize,
    vertices: Vec<[i32; 3]>,
}

impl VertexGrid {
    pub fn of(pieces: &[PieceView<'_>], [n_u, n_v]: [usize; 2]) -> Self {
        let columns = n_u + 1;
        let mut vertices = vec![[0; 3]; columns * (n_v + 1)];
        for piece in pieces {
            let (from, [m_u, m_v]) = (piece.cells(), piece.cells().size());
            for (i, j) in (0..=m_v).flat_map(|j| (0..=m_u).map(move |i| (i, j))) {
                vertices[(usize::from(from.j0) + j) * columns + usize::from(from.i0) + i] = piece.vertex(i, j);
            }
        }
        Self { columns, vertices }
    }

    fn at(&self, i: usize, j: usize) -> [i32; 3] {
        self.vertices[j * self.columns + i]
    }
}
