//! Edited meshes whose refinement was compared with hbr: the diced surface against that refinement.

use crate::ids::PatchId;
use crate::math::PointGrid;
use crate::mesh::{ControlMesh, EditKind, EditValue, shapes};
use crate::subdiv::refine::tests::edits::{edit, edited_cube, edited_tetrahedron};
use crate::subdiv::refine::{RefinedMesh, Tangents};
use crate::subdiv::surface::PatchPoints;
use crate::subdiv::{Evaluator, Surface};
use glam::DVec3;

fn grid_points() -> Vec<[f64; 2]> {
    (0..=16).flat_map(|j| (0..=16).map(move |i| [f64::from(i) / 16.0, f64::from(j) / 16.0])).collect()
}

/// Panics unless surface and refinement have the same holes, positions and derivatives; returns how many points were
/// seen.
fn assert_same_surface(mesh: &ControlMesh) -> usize {
    let surface = Surface::new(mesh, 1).unwrap();
    let reference = RefinedMesh::from_control(mesh);
    let (mut points, mut evaluator, uvs) = (PatchPoints::default(), Evaluator::default(), grid_points());
    let (step, mut n_seen) = (surface.lattice().step, 0);
    for patch in (0..surface.n_patches() as u32).map(PatchId) {
        let (face, sub) = surface.face_of(patch);
        surface.load(patch, &mut points);
        for ([u, v], exact) in uvs.iter().zip(reference.limits_at(face, sub, &uvs)) {
            let hidden = !surface.is_visible(patch) || surface.edited().hide_point(patch, *u, *v);
            assert_eq!(exact.is_none(), hidden, "face {face}, sub {sub}, ({u}, {v})");
            let Some(exact) = exact else { continue };
            let sample = surface.sample(&mut points, &mut evaluator, *u, *v);
            let distance = surface.lattice().to_object(sample.position).distance(exact.position);
            assert!(distance < 2e-6, "face {face}, sub {sub}, ({u}, {v}): {distance} away");
            if let Tangents::Derivatives(du, dv) = exact.tangents {
                let error = (step * sample.du - du).length().max((step * sample.dv - dv).length());
                assert!(error < 1e-5 * (1.0 + du.length().max(dv.length())), "({u}, {v}): {error}");
            }
            n_seen += 1;
        }
    }
    n_seen
}

#[test]
fn edited_surface_is_the_limit_of_the_edited_refinement() {
    // The holes: a quarter of a quarter, and an eighth of a side of a triangle's quad.
    assert!(assert_same_surface(&edited_cube()) > 1500);
    assert!(assert_same_surface(&edited_tetrahedron()) > 3000);
}

#[test]
fn edits_of_the_control_mesh_are_part_of_it() {
    let mut mesh = shapes::plane(2, 2);
    let all_edges =
        (0..4).flat_map(|face| (0..4).map(move |e| edit(EditKind::Edge, &[face, e], EditValue::AddSharpness(1.5))));
    mesh.edits = all_edges.collect();
    mesh.edits.push(edit(EditKind::Vertex, &[1, 2], EditValue::SetSharpness(0.0)));
    mesh.edits.push(edit(EditKind::Vertex, &[1, 2], EditValue::AddPosition(DVec3::Z)));
    assert_same_surface(&mesh);
}

#[test]
fn every_sheet_at_a_non_manifold_edge_sees_an_edit_of_its_middle() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut positions = positions.map(DVec3::from).to_vec();
    positions.extend([DVec3::new(0.0, -1.0, 1.0), DVec3::new(1.0, -1.0, 1.0)]);
    positions.extend([DVec3::new(0.0, -1.0, -1.0), DVec3::new(1.0, -1.0, -1.0)]);
    let faces = [vec![0, 1, 2, 3], vec![1, 0, 4, 5], vec![1, 0, 6, 7]];
    let mut mesh = ControlMesh::from_polygons(positions, &faces).unwrap();
    mesh.edits = vec![edit(EditKind::Vertex, &[0, 0, 1], EditValue::AddPosition(DVec3::new(0.0, 0.3, 0.0)))];
    assert_same_surface(&mesh);
}

#[test]
fn a_point_does_not_depend_on_its_company() {
    for mesh in [edited_cube(), edited_tetrahedron(), shapes::cube()] {
        let surface = Surface::new(&mesh, 1).unwrap();
        let (mut points, mut evaluator) = (PatchPoints::default(), Evaluator::default());
        let parameters = || (0..=8).map(|i| f64::from(i) / 8.0);
        for patch in surface.visible_patches() {
            surface.load(patch, &mut points);
            let (mut together, mut alone) = (PointGrid::default(), PointGrid::default());
            surface.grid(&mut points, &mut evaluator, Some([8; 2]), parameters(), parameters(), &mut together);
            for k in 0..81 {
                let (u, v) = (k % 9, k / 9);
                surface.grid(&mut points, &mut evaluator, Some([8; 2]), [u as f64 / 8.0], [v as f64 / 8.0], &mut alone);
                assert_eq!(alone.point(0, 0), together.point(u, v), "patch {patch}, ({u}, {v}) / 8");
            }
        }
    }
}
