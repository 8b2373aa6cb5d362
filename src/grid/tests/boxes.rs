//! Boxes hold what is in them, and little more.

use super::support::{Piece, Random, sheet, whole};
use crate::grid::boxes::{CellRect, IntegerBox};
use crate::grid::{NodeView, encode_node, node_bytes};
use crate::math::{Bounds, Envelope, Plate};
use glam::{IVec3, Vec3};

/// Whether `outer` holds `inner` and is at most two steps of the piece's boxes larger.
fn fits(outer: IntegerBox, inner: IntegerBox, step: [i32; 3]) -> bool {
    (0..3).all(|k| {
        let (below, above) = (inner[0][k] - outer[0][k], outer[1][k] - inner[1][k]);
        (0..step[k]).contains(&below) && (0..step[k]).contains(&above)
    })
}

#[test]
fn a_block_box_holds_its_nine_vertices_and_less_than_a_step_more() {
    let mut random = Random(1);
    for round in 0..3000 {
        let width = f64::powf(2.0, 22.0 * random.unit());
        let vertices = sheet(&mut random, 8, 8, width);
        let piece = Piece::new(&vertices, whole(8, 8));
        let head = piece.view().head;
        for lane in 0..16 {
            let corner = 9 * 2 * (lane / 4) + 2 * (lane % 4);
            let nine = (0..9).map(|c| IVec3::from_array(vertices[corner + 9 * (c / 3) + c % 3]));
            let exact = nine.fold((IVec3::MAX, IVec3::MIN), |b, p| (b.0.min(p), b.1.max(p)));
            let step = head.exponent.map(|e| 1 << e);
            assert!(
                fits(head.decoded_box(lane), [exact.0.to_array(), exact.1.to_array()], step),
                "round {round}, lane {lane}"
            );
        }
    }
}

#[test]
fn a_box_reaches_from_end_to_end_of_the_lattice() {
    let ends = [[-(1 << 24); 3], [1 << 24; 3], [0; 3], [1 << 24, 0, -(1 << 24)]];
    let piece = Piece::new(&ends, whole(1, 1));
    let [low, high] = piece.view().head.decoded_box(0);
    assert_eq!(low, [-(1 << 24); 3]);
    assert!(high.iter().all(|h| (1 << 24..(1 << 24) + (1 << 18)).contains(h)), "{high:?}");
}

fn in_any_plate(bounds: Bounds) -> Envelope {
    Envelope { bounds, plate: Plate::default() }
}

#[test]
fn a_node_holds_the_boxes_of_its_children() {
    let mut random = Random(2);
    for children in [[1, 1], [4, 4], [3, 2], [1, 4]] {
        let n = usize::from(children[0]) * usize::from(children[1]);
        let bounds: Vec<Bounds> = (0..n).map(|_| (0..2).map(|_| random.point(3e6).as_vec3()).collect()).collect();
        let mut bytes = vec![0u32; node_bytes(children) / 4];
        let cells = CellRect { i0: 8, j0: 0, i1: 40, j1: 32 };
        let envelopes: Vec<_> = bounds.iter().map(|&bounds| in_any_plate(bounds)).collect();
        encode_node(cells, children, &envelopes, bytemuck::cast_slice_mut(&mut bytes));
        let node = NodeView::new(bytemuck::cast_slice(&bytes));
        assert_eq!((node.cells(), node.children(), node.lanes().count_ones() as usize), (cells, children, n));
        for (c, b) in bounds.iter().enumerate() {
            let lane = 4 * (c / usize::from(children[0])) + c % usize::from(children[0]);
            let [low, high] = node.head.decoded_box(lane).map(|p| IVec3::from_array(p).as_vec3());
            assert!(low.cmple(b.min).all() && high.cmpge(b.max).all(), "child {c} of {children:?}");
            assert!((low - b.min).abs().max((high - b.max).abs()).max_element() < 65537.0);
        }
    }
}

#[test]
fn a_node_cuts_boxes_to_the_lattice() {
    let b = Bounds { min: Vec3::splat(-3e7), max: Vec3::splat(f32::INFINITY) };
    let mut bytes = vec![0u32; node_bytes([1, 1]) / 4];
    encode_node(whole(8, 8), [1, 1], &[in_any_plate(b)], bytemuck::cast_slice_mut(&mut bytes));
    let [low, high] = NodeView::new(bytemuck::cast_slice(&bytes)).head.decoded_box(0);
    assert!(low == [-(1 << 24); 3] && high.iter().all(|h| *h >= 1 << 24));
}
