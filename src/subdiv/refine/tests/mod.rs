//! Values known in closed form, and whole against local refinement; the large table is in `tests/limit_points.rs`.

pub(crate) mod edits;

use super::*;
use crate::ids::VertexId;
use crate::mesh::{BoundaryRule, Corner, Crease, EditKind, shapes};

const N: u32 = 7;

fn vertex(x: u32, y: u32) -> u32 {
    y * N + x
}

/// A grid of N by N vertices over x, y = 0..N with heights z(x, y).
fn grid(z: impl Fn(f64, f64) -> f64) -> ControlMesh {
    let position = |i: u32| {
        let (x, y) = ((i % N) as f64, (i / N) as f64);
        DVec3::new(x, y, z(x, y))
    };
    let quad = |i: u32| {
        let (x, y) = (i % (N - 1), i / (N - 1));
        vec![vertex(x, y), vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)]
    };
    let faces: Vec<_> = (0..(N - 1) * (N - 1)).map(quad).collect();
    ControlMesh::from_polygons((0..N * N).map(position).collect(), &faces).unwrap()
}

/// The patch whose corner 0 is grid vertex (x, y).
fn patch(x: u32, y: u32) -> FaceId {
    FaceId(y * (N - 1) + x)
}

/// A roof with its ridge along x = 3, the ridge sharp.
fn roof(sharpness: f32) -> ControlMesh {
    let mut mesh = grid(|x, _| (x - 3.0).abs());
    let ridge = (0..N - 1).map(|y| [VertexId(vertex(3, y)), VertexId(vertex(3, y + 1))]);
    mesh.creases = ridge.map(|edge| Crease { edge, sharpness }).collect();
    mesh
}

fn sample(mesh: &ControlMesh, face: FaceId, u: f64, v: f64) -> Sample {
    RefinedMesh::from_control(mesh).limit_at(face, 0, u, v).unwrap()
}

fn derivatives(sample: Sample) -> [DVec3; 2] {
    match sample.tangents {
        Tangents::Derivatives(du, dv) => [du, dv],
        other => panic!("no derivatives: {other:?}"),
    }
}

fn assert_near(a: DVec3, b: DVec3) {
    assert!(a.distance(b) < 1e-13, "{a} is not {b}");
}

#[test]
fn regular_interior_is_the_cubic_b_spline() {
    // The cubic B-spline with control values i² is x² + 1/3.
    let mesh = grid(|x, y| x * x - y);
    for (u, v) in [(0.0, 0.0), (0.5, 0.25), (0.875, 1.0), (0.3125, 0.6875)] {
        let at = sample(&mesh, patch(3, 2), u, v);
        let (x, y) = (3.0 + u, 2.0 + v);
        assert_near(at.position, DVec3::new(x, y, x * x + 1.0 / 3.0 - y));
        assert_near(derivatives(at)[0], DVec3::new(1.0, 0.0, 2.0 * x));
        assert_near(derivatives(at)[1], DVec3::new(0.0, 1.0, -1.0));
    }
}

#[test]
fn infinitely_sharp_ridge_keeps_its_shape_and_has_two_slopes() {
    let mesh = roof(f32::INFINITY);
    for v in [0.0, 0.5, 1.0] {
        let left = sample(&mesh, patch(2, 2), 1.0, v);
        let right = sample(&mesh, patch(3, 2), 0.0, v);
        assert_near(left.position, DVec3::new(3.0, 2.0 + v, 0.0));
        assert_near(right.position, left.position);
        assert_near(derivatives(left)[0], DVec3::new(1.0, 0.0, -1.0));
        assert_near(derivatives(right)[0], DVec3::new(1.0, 0.0, 1.0));
        assert_near(derivatives(right)[1], DVec3::Y);
    }
}

#[test]
fn semi_sharp_ridge_sinks_as_sharpness_grows() {
    // One sharp step keeps the roof and halves its spacing h; the B-spline's height at the ridge is 2h/6.
    // The step of a fraction s leaves the ridge at (1-s) h/4 before the last smoothing.
    for (sharpness, height) in
        [(0.0, 1.0 / 3.0), (0.5, 1.0 / 4.0), (1.0, 1.0 / 6.0), (2.0, 1.0 / 12.0), (9.0, 1.0 / 1536.0)]
    {
        let at = sample(&roof(sharpness), patch(3, 2), 0.0, 0.5);
        assert_near(at.position, DVec3::new(3.0, 2.5, height));
    }
}

#[test]
fn cube_corners_come_to_half_height() {
    // (9 v + 4 sum e + sum d) / 24 with v = (1, 1, 1), sum e = v, sum d = -v.
    let corner = |i: u32| 2.0 * DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) - 1.0;
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let cube = ControlMesh::from_polygons((0..8).map(corner).collect(), &sides.map(|f| f.to_vec())).unwrap();
    for (f, side) in sides.iter().enumerate() {
        let at = sample(&cube, FaceId::from(f), 0.0, 0.0);
        assert_near(at.position, 0.5 * corner(side[0]));
        let Tangents::Directions(du, dv) = at.tangents else { panic!("valence 3 has directions") };
        assert_near(du.cross(dv).normalize(), at.position.normalize());
    }
}

#[test]
fn boundary_rules_differ_at_the_corner_of_a_sheet() {
    let mut mesh = grid(|_, _| 0.0);
    let corner = |mesh: &ControlMesh| RefinedMesh::from_control(mesh).limit_at(FaceId(0), 0, 0.0, 0.0);
    mesh.boundary = BoundaryRule::EdgeAndCorner;
    assert_near(corner(&mesh).unwrap().position, DVec3::ZERO);
    mesh.boundary = BoundaryRule::EdgeOnly;
    assert_near(corner(&mesh).unwrap().position, DVec3::new(1.0, 1.0, 0.0) / 6.0);
    mesh.boundary = BoundaryRule::None;
    assert_eq!(corner(&mesh), None);
    assert!(RefinedMesh::from_control(&mesh).limit_at(patch(1, 1), 0, 0.0, 0.0).is_some());
}

#[test]
fn sharp_vertex_stays_and_semi_sharp_vertex_lets_go() {
    let mut mesh = grid(|x, y| if (x, y) == (3.0, 3.0) { 1.0 } else { 0.0 });
    let height = |mesh: &ControlMesh| sample(mesh, patch(3, 3), 0.0, 0.0).position.z;
    assert!((height(&mesh) - 16.0 / 36.0).abs() < 1e-15);
    mesh.corners = vec![Corner { vertex: VertexId(vertex(3, 3)), sharpness: 10.0 }];
    assert_eq!(height(&mesh), 1.0);
    mesh.corners[0].sharpness = 1.0;
    // After the sharp step: 1 at the vertex, 3/8 at edge points, 1/4 at face points.
    assert!((height(&mesh) - (16.0 + 4.0 * 4.0 * 0.375 + 4.0 * 0.25) / 36.0).abs() < 1e-15);
}

#[test]
fn bodies_that_touch_in_a_vertex_are_held_there() {
    let bow_tie = shapes::bow_tie();
    let mesh = RefinedMesh::from_control(&bow_tie);
    let held: Vec<usize> = (0..mesh.n_vertices()).filter(|&v| mesh.vertices[v].pinned).collect();
    assert_eq!(held, [0]);
    assert_eq!(mesh.vertices[0].sharpness, INFINITE);
}

/// Evaluates every corner of a mesh refined as a whole, and the same points by local refinement.
fn assert_local_is_whole(name: &str, control: &ControlMesh, n_steps: u32) {
    let base = RefinedMesh::from_control(control);
    let whole = (0..n_steps).fold(base.clone(), |mesh, _| mesh.refine());
    let tolerance = 1e-13 * control.bounds().diagonal();
    for face in 0..whole.n_faces() {
        let Place { face: base_face, sub, level, i, j } = whole.place(face);
        let corner = |k: usize| [i + [0, 1, 1, 0][k], j + [0, 0, 1, 1][k]].map(|i| i as f64 / (1u64 << level) as f64);
        let corners = [0, 1, 2, 3].map(corner);
        for (k, local) in base.limits_at(base_face, sub, &corners).into_iter().enumerate() {
            let Some(exact) = whole.limit(face, k).filter(|_| !whole.is_hole(face)) else { continue };
            // Where a hole begins inside a patch, the border may count as the hole's.
            let on_border = control.edits.iter().any(|e| e.kind == EditKind::Face) && k != 0;
            let missing = if on_border { 0.0 } else { f64::INFINITY };
            let distance = local.map_or(missing, |l| l.position.distance(exact.position));
            assert!(distance <= tolerance, "{name}: face {face}, corner {k}: {distance}");
        }
    }
}

#[test]
fn local_refinement_is_whole_refinement() {
    for (name, mesh) in shapes::all() {
        assert_local_is_whole(name, &mesh, if mesh.n_faces() > 10 { 1 } else { 3 });
    }
}
