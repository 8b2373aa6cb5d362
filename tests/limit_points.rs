//! Promise 2: the surface is the limit surface, for every tag and topology.
//!
//! `cargo test --test limit_points -- --nocapture` prints the tables of `notes/accuracy.md`, with Embree's errors
//! beside where `EMBREE_PROBE` names the program `embree_probe`.

mod common;

use common::embree;
use common::limit_table::{self, Errors, Point, Shape, max, percentile_99};
use lazytess::ids::FaceId;
use lazytess::subdiv::refine::{RefinedMesh, Sample, Tangents};
use lazytess::subdiv::surface::PatchPoints;
use lazytess::subdiv::{Evaluator, Surface};

/// The evaluation that dices grids.
#[test]
fn surface_is_within_a_millionth_of_the_diagonal() {
    let shapes = read_shapes();
    let results: Vec<(&Shape, Errors)> = shapes.iter().map(|shape| (shape, surface_errors(shape))).collect();
    print_table("The surface as it is diced (control points in single precision on the lattice)", &results);
    assert_within(&results, 1e-6, 1e-4);
}

/// The slow reference, which other tests compare with.
#[test]
fn slow_reference_is_exact_to_rounding() {
    let shapes = read_shapes();
    let results: Vec<(&Shape, Errors)> = shapes.iter().map(|shape| (shape, reference_errors(shape))).collect();
    print_table("The slow reference (double precision)", &results);
    assert_within(&results, 1e-13, 1e-9);
}

fn read_shapes() -> Vec<Shape> {
    common::shared("meshes/opensubdiv").map(|folder| limit_table::read(&folder)).unwrap_or_default()
}

fn surface_errors(shape: &Shape) -> Errors {
    let surface = Surface::new(&shape.mesh, 1).expect("the shape is small");
    let (mut points, mut evaluator) = (PatchPoints::default(), Evaluator::default());
    let step = surface.lattice().step;
    shape.errors(|face, sub, uvs| {
        let patch = surface.patch_of(face, sub);
        if !surface.is_visible(patch) {
            return vec![None; uvs.len()];
        }
        surface.load(patch, &mut points);
        let sample = |&[u, v]: &[f64; 2]| {
            let s = surface.sample(&mut points, &mut evaluator, u, v);
            Some(Point { p: surface.lattice().to_object(s.position), du: step * s.du, dv: step * s.dv })
        };
        uvs.iter().map(sample).collect()
    })
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

fn assert_within(results: &[(&Shape, Errors)], position: f64, derivative: f64) {
    for (shape, errors) in results {
        assert_eq!(errors.missing, 0, "{}: points without surface", shape.name);
        assert!(max(&errors.position) < position, "{}: position", shape.name);
        assert!(max(&errors.derivative) < derivative, "{}: derivative", shape.name);
        assert!(max(&errors.direction) < derivative, "{}: direction", shape.name);
    }
}

fn print_table(title: &str, results: &[(&Shape, Errors)]) {
    println!("\n{title}\n");
    println!(
        "| shape | position, max | 99 % | derivative, max | 99 % | direction, max | OpenSubdiv's position | at level 10 \
         | Embree's position, max | 99 % | normal, 99 % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (shape, e) in results {
        let embree = embree_errors(&shape.name);
        println!(
            "| {} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {} | {} | {} |",
            shape.name,
            max(&e.position),
            percentile_99(&e.position),
            max(&e.derivative),
            percentile_99(&e.derivative),
            max(&e.direction),
            shape.facts["diff_bfr_default"],
            shape.facts["diff_bfr"],
            embree.join(" | "),
        );
    }
}

/// Embree's largest and 99th percentile error of positions, in diagonals, and the 99th percentile of that of normals,
/// in radians.
fn embree_errors(name: &str) -> [String; 3] {
    let folder = common::shared("meshes/opensubdiv").expect("its shapes have been read");
    let [mesh, points] = ["obj", "limit.csv"].map(|kind| folder.join(format!("{name}.{kind}")));
    let report = embree::probe(&["accuracy", mesh.to_str().unwrap(), points.to_str().unwrap()]);
    ["max", "p99", "normal_p99_rad"].map(|key| embree::cell(&report, |report| report[key].as_f64()))
}
