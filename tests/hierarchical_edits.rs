//! The shapes of OpenSubdiv's collection that have hierarchical edits, which OpenSubdiv itself ignores: with edits
//! against the slow reference. (Without edits, `limit_points.rs` compares them with exact points.)

mod common;

use lazytess::ids::FaceId;
use lazytess::io::obj::read_obj;
use lazytess::mesh::ControlMesh;
use lazytess::subdiv::refine::RefinedMesh;
use lazytess::subdiv::{Dicer, Surface};

fn largest_distance(mesh: &ControlMesh) -> f64 {
    let surface = Surface::new(mesh, 1).expect("the shape is small");
    let reference = RefinedMesh::from_control(mesh);
    let mut dicer = Dicer::default();
    let uvs: Vec<[f64; 2]> = (0..81).map(|k| [f64::from(k % 9) / 8.0, f64::from(k / 9) / 8.0]).collect();
    let mut largest: f64 = 0.0;
    for face in (0..mesh.n_faces()).map(FaceId::from) {
        let patch = surface.patch_of(face, 0);
        for (&[u, v], exact) in uvs.iter().zip(reference.limits_at(face, 0, &uvs)) {
            let visible = surface.is_visible(patch) && !surface.edited().hide_point(patch, u, v);
            assert_eq!(exact.is_some(), visible, "face {face} at ({u}, {v})");
            if let Some(exact) = exact {
                let position = dicer.sample(&surface, patch, u, v).position;
                largest = largest.max(surface.lattice().to_object(position).distance(exact.position));
            }
        }
    }
    largest
}

#[test]
fn edited_shapes_are_within_a_millionth_of_the_diagonal() {
    let Some(folder) = common::shared("meshes/opensubdiv") else { return };
    for name in ["square_hedit0", "square_hedit1", "square_hedit3"] {
        let edited = read_obj(&folder.join(format!("{name}.obj"))).expect("the shape is valid").mesh;
        let plain = ControlMesh { edits: Vec::new(), ..edited.clone() };
        let error = largest_distance(&edited) / edited.bounds().diagonal();
        println!("{name}: {} edits, error {error:.1e} of the diagonal", edited.edits.len());
        assert!(error < 1e-6, "{name}: {error}");
        assert_ne!(sum_of_middles(&edited), sum_of_middles(&plain), "{name}: edits change something");
    }
}

/// A number that tells surfaces apart: the sum of limit positions at the patches' middles.
fn sum_of_middles(mesh: &ControlMesh) -> [f64; 3] {
    let surface = Surface::new(mesh, 1).expect("the shape is small");
    let mut dicer = Dicer::default();
    let middle = |patch| surface.lattice().to_object(dicer.sample(&surface, patch, 0.5, 0.5).position);
    surface.visible_patches().map(middle).sum::<glam::DVec3>().to_array()
}
