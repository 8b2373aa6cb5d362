//! Random control meshes, with and without hierarchical edits: the evaluation that dices grids against the slow reference.
//!
//! `LAZYTESS_FUZZ=START..END cargo test --test fuzz_surface` tries other seeds. A failure is shrunk and printed as a test.

use lazytess::ids::FaceId;
use lazytess::mesh::ControlMesh;
use lazytess::mesh::random::{random_edits, random_mesh};
use lazytess::mesh::shrink::{as_test, shrink};
use lazytess::subdiv::refine::RefinedMesh;
use lazytess::subdiv::surface::PatchPoints;
use lazytess::subdiv::{Evaluator, Surface};

/// Corners, edges, the middle, near a corner, and a place of no importance.
const POINTS: [[f64; 2]; 9] = [
    [0.0, 0.0],
    [1.0, 0.0],
    [1.0, 1.0],
    [0.0, 1.0],
    [0.5, 0.0],
    [0.0, 0.375],
    [0.5, 0.5],
    [0.015625, 0.03125],
    [0.8125, 0.6875],
];

/// Seeds beyond the usual ones that failed once.
const FAILED_ONCE: [u64; 1] = [
    // An edit on one half of an edge that leads back to its vertex.
    245,
];

fn seeds() -> impl Iterator<Item = u64> {
    let given = std::env::var("LAZYTESS_FUZZ").ok();
    let range = given.as_deref().and_then(|text| text.split_once(".."));
    let range = range.map_or(0..150, |(a, b)| a.parse().expect("START..END")..b.parse().expect("START..END"));
    FAILED_ONCE.into_iter().chain(range)
}

#[test]
fn diced_surface_is_the_reference_surface_on_random_meshes() {
    seeds().for_each(|seed| assert_same(seed, random_mesh(seed)));
}

#[test]
fn diced_surface_is_the_reference_surface_under_random_edits() {
    for seed in seeds() {
        let mesh = random_mesh(seed);
        assert_same(seed, ControlMesh { edits: random_edits(&mesh, seed), ..mesh });
    }
}

fn assert_same(seed: u64, mesh: ControlMesh) {
    if difference(&mesh).is_some() {
        let smallest = shrink(mesh, |m| difference(m).is_some());
        let why = difference(&smallest).expect("shrinking keeps the failure");
        panic!("seed {seed}: {why}\n{}", as_test(&smallest, &format!("seed_{seed}")));
    }
}

/// Where and how the two evaluations differ, if they do; a panic is a difference too.
fn difference(mesh: &ControlMesh) -> Option<String> {
    std::panic::catch_unwind(|| compare(mesh)).unwrap_or_else(|_| Some("a panic, see above".into()))
}

fn compare(mesh: &ControlMesh) -> Option<String> {
    let surface = Surface::new(mesh, 1).expect("the mesh is valid and small");
    let reference = RefinedMesh::from_control(mesh);
    let (mut points, mut evaluator) = (PatchPoints::default(), Evaluator::default());
    // Where all vertices are one point, f64 itself is the limit.
    let largest = mesh.bounds().max.abs().max(mesh.bounds().min.abs()).max_element();
    // Edits may lead far outside the control mesh's box.
    let half_extent = surface.lattice().step * f64::from(1 << 22);
    let tolerance = 1e-6 * mesh.bounds().diagonal().max(half_extent) + 1e-15 * largest;
    for (face, &size) in mesh.face_sizes.iter().enumerate() {
        let face = FaceId::from(face);
        for sub in 0..if size == 4 { 1 } else { size } {
            let patch = surface.patch_of(face, sub);
            for (uv, exact) in POINTS.iter().zip(reference.limits_at(face, sub, &POINTS)) {
                let hidden = surface.edited().hide_point(patch, uv[0], uv[1]);
                if exact.is_some() == (hidden || !surface.is_visible(patch)) {
                    return Some(format!("face {face}, sub {sub}, uv {uv:?}: only one of the two has a surface"));
                }
                let Some(exact) = exact else { continue };
                surface.load(patch, &mut points);
                let sample = surface.sample(&points, &mut evaluator, uv[0], uv[1]);
                let distance = surface.lattice().to_object(sample.position).distance(exact.position);
                if distance.is_nan() || distance > tolerance {
                    return Some(format!("face {face}, sub {sub}, uv {uv:?}: {distance} away"));
                }
            }
        }
    }
    None
}
