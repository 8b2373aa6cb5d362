//! Promise 2: the surface is the limit surface, for every tag and topology.
//!
//! `cargo test --test limit_points -- --nocapture` prints the tables of `notes/accuracy.md`.

mod common;

use common::limit_table::{self, Errors, Point, Shape, max, percentile_99};
use lazytess::ids::FaceId;
use lazytess::subdiv::refine::{RefinedMesh, Sample, Tangents};

/// The slow reference against the exact points.
#[test]
fn slow_reference_is_exact_to_rounding() {
    let shapes = common::shared("meshes/opensubdiv").map(|folder| limit_table::read(&folder)).unwrap_or_default();
    let results: Vec<(&Shape, Errors)> = shapes.iter().map(|shape| (shape, reference_errors(shape))).collect();
    print_table(&results);
    for (shape, errors) in &results {
        assert_eq!(errors.missing, 0, "{}: points without surface", shape.name);
        assert!(max(&errors.position) < 1e-13, "{}: position", shape.name);
        assert!(max(&errors.derivative) < 1e-9, "{}: derivative", shape.name);
        assert!(max(&errors.direction) < 1e-9, "{}: direction", shape.name);
    }
}

fn reference_errors(shape: &Shape) -> Errors {
    let mesh = RefinedMesh::from_control(&shape.mesh);
    shape.errors(|face: FaceId, sub, uvs| mesh.limits_at(face, sub, uvs).into_iter().map(|s| s.map(point)).collect())
}

fn point(sample: Sample) -> Point {
    let (du, dv) = match sample.tangents {
        Tangents::Derivatives(du, dv) | Tangents::Directions(du, dv) => (du, dv),
        Tangents::Unknown => Default::default(),
    };
    Point { p: sample.position, du, dv }
}

fn print_table(results: &[(&Shape, Errors)]) {
    println!(
        "| shape | position max | 99 % | derivative max | 99 % | direction max | OpenSubdiv position: default levels | level 10 |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (shape, e) in results {
        println!(
            "| {} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {} | {} |",
            shape.name,
            max(&e.position),
            percentile_99(&e.position),
            max(&e.derivative),
            percentile_99(&e.derivative),
            max(&e.direction),
            shape.facts["diff_bfr_default"],
            shape.facts["diff_bfr"],
        );
    }
}
