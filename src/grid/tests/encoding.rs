//! Pieces give back what was put in, in the bytes that were promised.

use super::support::{Piece, Random, sheet, whole};
use crate::grid::{CellRect, PieceLayout, PieceView, VertexFormat, cells_of, is_node};
use crate::math::LatticeGrid;

#[test]
fn every_vertex_comes_back_in_every_format_and_size() {
    let mut random = Random(3);
    for (width, format) in [(3e4, VertexFormat::Two), (4e6, VertexFormat::Three)] {
        for (n_u, n_v) in (1..=8).flat_map(|u| (1..=8).map(move |v| (u, v))) {
            let vertices = sheet(&mut random, n_u.into(), n_v.into(), width);
            let piece = Piece::new(&vertices, CellRect { i0: 16, j0: 24, i1: 16 + n_u, j1: 24 + n_v });
            let grid = LatticeGrid::from_points(&vertices, usize::from(n_u) + 1);
            let layout = PieceLayout::new(&grid, piece.view().cells(), [64; 2]);
            assert_eq!(layout.format(), format, "{n_u} x {n_v}");
            let mut bytes = vec![0u32; layout.bytes() / 4];
            layout.encode(&grid, bytemuck::cast_slice_mut(&mut bytes));
            let block = bytemuck::cast_slice(&bytes);
            assert_eq!((cells_of(block), is_node(block)), (piece.view().cells(), false));
            for (at, v) in vertices.iter().enumerate() {
                let (i, j) = (at % usize::from(n_u + 1), at / usize::from(n_u + 1));
                assert_eq!(piece.view().vertex(i, j), *v, "({i}, {j}) of {n_u} x {n_v}, {format:?}");
            }
        }
    }
}

#[test]
fn a_piece_as_wide_as_the_lattice_takes_four_bytes() {
    let ends = [[-(1 << 24); 3], [1 << 24; 3], [0; 3], [1 << 24, 0, -(1 << 24)]];
    let piece = Piece::new(&ends, whole(1, 1));
    assert_eq!(PieceLayout::new(&LatticeGrid::from_points(&ends, 2), whole(1, 1), [1; 2]).format(), VertexFormat::Four);
    assert_eq!([0, 1, 2, 3].map(|v| piece.view().vertex(v % 2, v / 2)), ends);
}

#[test]
fn a_triangle_takes_at_most_eight_bytes_at_eight_by_eight_cells() {
    let bytes = |width: i32| {
        let mut vertices = [[0; 3]; 81];
        vertices[80] = [width; 3];
        PieceLayout::new(&LatticeGrid::from_points(&vertices, 9), whole(8, 8), [8; 2]).bytes()
    };
    let triangles = 128;
    assert_eq!((bytes(0), bytes(0xffff)), (5 * triangles, 5 * triangles));
    assert_eq!((bytes(0x1_0000), bytes(0xff_ffff)), (7 * triangles, 7 * triangles));
    // Half as wide as the whole lattice: a mesh has a handful of such pieces.
    assert_eq!(bytes(0x100_0000), 9 * triangles);
}

#[test]
#[should_panic(expected = "a whole piece")]
fn a_cut_piece_is_refused() {
    let block = [[0u64; 8]; 10];
    let vertices = LatticeGrid::from_points(&[[0; 3]; 81], 9);
    let mut bytes = block;
    PieceLayout::new(&vertices, whole(8, 8), [8; 2]).encode(&vertices, bytemuck::cast_slice_mut(&mut bytes));
    PieceView::new(&bytemuck::cast_slice(&bytes)[..576]);
}
