//! Hierarchical edits against numbers of OpenSubdiv 3.5's hbr (positions in double, its weights in single precision).

use super::super::*;
use super::assert_local_is_whole;
use crate::ids::VertexId;
use crate::mesh::{Crease, Edit, EditKind, EditValue, shapes};

pub(crate) fn edit(kind: EditKind, path: &[u32], value: EditValue) -> Edit {
    Edit { kind, path: path.to_vec(), value }
}

/// A cube with a bump at level 2, a moved control vertex, sharp edges at level 1, a sharp vertex and a hole.
pub(crate) fn edited_cube() -> ControlMesh {
    let corner = |i: u32| 2.0 * DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) - 1.0;
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut mesh = ControlMesh::from_polygons((0..8).map(corner).collect(), &sides.map(|f| f.to_vec())).unwrap();
    mesh.edits = vec![
        edit(EditKind::Vertex, &[1, 2, 0, 1], EditValue::AddPosition(DVec3::Z)),
        edit(EditKind::Vertex, &[2, 1], EditValue::SetPosition(DVec3::new(0.5, -1.25, 0.0))),
        edit(EditKind::Edge, &[3, 1, 2], EditValue::SetSharpness(10.0)),
        edit(EditKind::Edge, &[3, 1, 1], EditValue::SetSharpness(2.0)),
        edit(EditKind::Vertex, &[1, 2, 0, 1], EditValue::SetSharpness(1.0)),
        edit(EditKind::Face, &[5, 2, 1], EditValue::Hole),
    ];
    mesh
}

/// A tetrahedron with an edge of sharpness 3 and edits whose first child is that of a triangle.
pub(crate) fn edited_tetrahedron() -> ControlMesh {
    let positions = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let mut mesh = ControlMesh::from_polygons(
        positions.map(DVec3::from).to_vec(),
        &[vec![0, 1, 2], vec![0, 2, 3], vec![0, 3, 1], vec![1, 3, 2]],
    )
    .unwrap();
    mesh.creases = vec![Crease { edge: [VertexId(0), VertexId(1)], sharpness: 3.0 }];
    mesh.edits = vec![
        edit(EditKind::Vertex, &[0, 2, 3, 2], EditValue::AddPosition(DVec3::new(0.0, -0.5, 0.0))),
        edit(EditKind::Edge, &[1, 0, 3], EditValue::SetSharpness(4.0)),
        edit(EditKind::Vertex, &[3, 1, 2], EditValue::AddSharpness(2.5)),
        edit(EditKind::Face, &[2, 1, 0, 3], EditValue::Hole),
    ];
    mesh
}

/// A corner of a face of level 3: path of the face, corner, position.
type Expected = ([u32; 4], usize, [f64; 3]);

fn assert_refines_to(mesh: &ControlMesh, n_holes: usize, expected: &[Expected]) {
    let level_3 = (0..3).fold(RefinedMesh::from_control(mesh), |mesh, _| mesh.refine());
    assert_eq!((0..level_3.n_faces()).filter(|&f| level_3.is_hole(f)).count(), n_holes);
    for &(path, corner, position) in expected {
        let place = edits::PlacedEdit::new(&edit(EditKind::Face, &path, EditValue::Hole), mesh).place;
        let face = (0..level_3.n_faces()).find(|&f| level_3.place(f) == place).unwrap();
        let vertex = level_3.face_vertices(face).nth(corner).unwrap();
        let distance = level_3.position(vertex).distance(DVec3::from(position));
        assert!(distance < 2e-7, "{path:?}, corner {corner}: {distance}");
    }
}

#[test]
fn edits_of_quads_refine_as_in_hbr() {
    let expected = [
        ([3, 2, 1, 1], 0, [-0.034722223, 0.815972223, 0.503472223]),
        ([3, 2, 1, 1], 2, [0.123033313, 0.650709367, 0.614393449]),
        ([3, 1, 2, 3], 0, [-0.166666668, 0.808485245, 0.344618057]),
        ([1, 2, 1, 1], 0, [0.456434464, -0.015977648, 1.1577691]),
        ([1, 2, 1, 1], 2, [0.571234812, 0.136149091, 0.741319448]),
        ([1, 2, 0, 0], 0, [-0.009426541, -0.00471327, 0.96177843]),
        ([1, 2, 0, 0], 2, [0.158908421, 0.164089628, 1.091037328]),
        ([2, 1, 0, 1], 2, [0.125056516, -0.761690498, -0.100066009]),
        ([5, 0, 2, 3], 2, [0.702745227, -0.238254124, 0.263780383]),
    ];
    assert_refines_to(&edited_cube(), 4, &expected);
}

#[test]
fn edits_of_triangles_refine_as_in_hbr() {
    let expected = [
        ([2, 0, 1, 1], 0, [0.067418984, 0.064814817, 0.474537044]),
        ([1, 0, 0, 3], 2, [0.06152344, 0.213541672, 0.373553248]),
        ([0, 2, 2, 3], 2, [0.258632336, 0.028163586, -0.309413588]),
        ([0, 2, 2, 1], 0, [0.100167987, 0.32076261, -0.230774182]),
        ([3, 0, 3, 0], 2, [-0.005063657, -0.155092596, -0.399305562]),
        ([0, 0, 2, 0], 2, [0.357703195, 0.28652264, -0.152263379]),
    ];
    assert_refines_to(&edited_tetrahedron(), 1, &expected);
}

#[test]
fn local_refinement_waits_for_edits() {
    for (name, mesh) in [("cube", edited_cube()), ("tetrahedron", edited_tetrahedron())] {
        (2..5).for_each(|n_steps| assert_local_is_whole(name, &mesh, n_steps));
    }
}

#[test]
fn bump_is_where_its_path_says_and_gone_a_few_cells_away() {
    let (edited, mut plain) = (edited_cube(), edited_cube());
    plain.edits.retain(|e| e.value != EditValue::AddPosition(DVec3::Z));
    let rise = |u: f64, v: f64| {
        let z = |mesh| RefinedMesh::from_control(mesh).limit_at(FaceId(1), 0, u, v).unwrap().position.z;
        z(&edited) - z(&plain)
    };
    // Vertex 1 of child 0 of child 2. It is sharp for one more step, so more than the B-spline's 4/9 stays of the bump.
    assert!(rise(0.75, 0.5) > 0.5);
    assert!(rise(0.625, 0.5) > 0.0);
    assert_eq!(rise(0.25, 0.5), 0.0);
}

#[test]
fn boundary_edges_stay_sharp_under_edits() {
    let mut mesh = shapes::plane(2, 2);
    let before = RefinedMesh::from_control(&mesh).limit_at(FaceId(0), 0, 0.25, 0.0);
    let all_edges =
        (0..4).flat_map(|face| (0..4).map(move |e| edit(EditKind::Edge, &[face, e], EditValue::SetSharpness(0.0))));
    mesh.edits = all_edges.collect();
    assert_eq!(RefinedMesh::from_control(&mesh).limit_at(FaceId(0), 0, 0.25, 0.0), before);
}
