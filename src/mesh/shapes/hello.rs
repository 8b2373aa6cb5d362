//! One shape for each subdivision tag: the meshes of `scenes/hello.toml`.

use super::model::Model;
use super::tagged::boundary_sheet;
use super::{NamedShape, basic, corner_cube};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{BoundaryRule, ControlMesh, Crease, CreaseMethod, Edit, EditKind, EditValue, TriangleRule};
use glam::DVec3;

/// Every mesh of the scene by the stem of its file name.
pub(super) fn meshes() -> Vec<NamedShape> {
    vec![
        ("hello-smooth", jack(0.0)),
        ("hello-semisharp", jack(1.4)),
        ("hello-crease", drum()),
        ("hello-dart", dart()),
        ("hello-corner", corner_cube(f32::INFINITY)),
        ("hello-boundary-0", boundary_sheet(BoundaryRule::None)),
        ("hello-boundary-1", boundary_sheet(BoundaryRule::EdgeAndCorner)),
        ("hello-boundary-2", boundary_sheet(BoundaryRule::EdgeOnly)),
        ("hello-hole", shell()),
        ("hello-ngon", star(5)),
        ("hello-decay-normal", crown(CreaseMethod::Uniform)),
        ("hello-decay-chaikin", crown(CreaseMethod::Chaikin)),
        ("hello-triangles-catmark", triangulated_torus(TriangleRule::Catmark)),
        ("hello-triangles-smooth", triangulated_torus(TriangleRule::Smooth)),
        ("hello-edit", studded()),
        ("hello-stage", stage()),
    ]
}

/// A jack: a cube with six arms, all its sharp bends of the given sharpness.
fn jack(sharpness: f32) -> ControlMesh {
    let mut jack = Model::from_mesh(&super::cube());
    jack.positions.iter_mut().for_each(|p| *p *= 0.42);
    let directions = [DVec3::NEG_X, DVec3::X, DVec3::NEG_Y, DVec3::Y, DVec3::NEG_Z, DVec3::Z];
    for (face, direction) in directions.into_iter().enumerate() {
        jack.extrude_scaled(&[face], DVec3::ONE, direction * 0.5);
        jack.extrude_scaled(&[face], DVec3::splat(1.25), direction * 0.28);
    }
    if sharpness > 0.0 {
        jack.crease_by_angle(40.0, sharpness);
    }
    jack.into_mesh()
}

/// A cube whose top and bottom loops are infinitely sharp: its limit has flat ends with round rims.
fn drum() -> ControlMesh {
    let mut drum = Model::from_mesh(&super::cube());
    for [a, b] in [[0, 1], [1, 5], [5, 4], [4, 0], [2, 3], [3, 7], [7, 6], [6, 2]] {
        drum.crease(a, b, f32::INFINITY);
    }
    drum.into_mesh()
}

/// A ball with a sharp fold over its top that ends, as a dart, on both sides.
fn dart() -> ControlMesh {
    let mut ball = basic::cube_sphere(2);
    let at = |x, y, z| ball.positions.iter().position(|p| p.signum() * p.abs().ceil() == DVec3::new(x, y, z));
    let arc = [[-1.0, 0.0], [-1.0, 1.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
    let path = arc.map(|[x, y]| at(x, y, 0.0).unwrap_or_default());
    for edge in path.windows(2) {
        let edge = [VertexId::from(edge[0]), VertexId::from(edge[1])];
        ball.creases.push(Crease { edge, sharpness: f32::INFINITY });
    }
    ball.positions.iter_mut().for_each(|p| *p *= 1.25);
    ball.positions[path[2]].y = 1.8;
    // Lower shoulders on both sides make the fold stand out.
    ball.positions.iter_mut().filter(|p| p.y > 0.0 && p.z != 0.0).for_each(|p| p.y *= 0.5);
    ball
}

/// A ball of which the middle face of each side is a hole.
fn shell() -> ControlMesh {
    let ball = basic::cube_sphere(3);
    let middle = |face: &[VertexId]| {
        let center = face.iter().map(|v| ball.positions[v.idx()]).sum::<DVec3>() / face.len() as f64;
        center.abs().max_element() > 0.9
    };
    let holes = ball.faces().enumerate().filter(|(_, face)| middle(face)).map(|(i, _)| FaceId::from(i)).collect();
    ControlMesh { holes, positions: ball.positions.iter().map(|p| *p * 1.15).collect(), ..ball }
}

/// A star-shaped biscuit: two faces of `2 n` corners and rims of sharpness 2.5.
fn star(n: u32) -> ControlMesh {
    let mut star = Model::from_mesh(&basic::prism(2 * n));
    for (i, p) in star.positions.iter_mut().enumerate() {
        let scale = if i.is_multiple_of(2) { 1.45 } else { 0.7 };
        *p *= DVec3::new(scale, 0.35, scale);
    }
    for i in 0..2 * n {
        let j = (i + 1) % (2 * n);
        star.crease(i, j, 2.5);
        star.crease(2 * n + i, 2 * n + j, 2.5);
    }
    star.into_mesh()
}

/// A flat drum whose upper rim goes from smooth to sharp and back.
fn crown(crease_method: CreaseMethod) -> ControlMesh {
    let mut crown = basic::prism(8);
    crown.positions.iter_mut().for_each(|p| *p *= DVec3::new(1.2, 0.6, 1.2));
    let rim = [0.0, 4.0, 0.5, 3.0, 0.0, 4.0, 0.5, 3.0];
    let creases = rim
        .into_iter()
        .enumerate()
        .map(|(i, sharpness)| Crease { edge: [VertexId::from(i), VertexId::from((i + 1) % 8)], sharpness });
    ControlMesh { creases: creases.collect(), crease_method, ..crown }
}

/// A torus of triangles.
fn triangulated_torus(triangles: TriangleRule) -> ControlMesh {
    let torus = basic::torus(7, 5, 0.85, 0.5);
    let halves = torus.faces().flat_map(|f| [[f[0].0, f[1].0, f[2].0], [f[0].0, f[2].0, f[3].0]]);
    ControlMesh { triangles, ..super::polygons(torus.positions.clone(), halves) }
}

/// A cube with studs and a window that exist only after two refinements.
fn studded() -> ControlMesh {
    let stud = |face: u32, direction: DVec3| {
        let children = (0..4).map(move |child| vec![face, child, (child + 2) % 4, (child + 2) % 4]);
        let add = EditValue::AddPosition(direction);
        children.map(move |path| Edit { kind: EditKind::Vertex, path, value: add })
    };
    let window = (0..4).map(|child| Edit {
        kind: EditKind::Face,
        path: vec![5, child, (child + 2) % 4],
        value: EditValue::Hole,
    });
    // All four children meet in the face's middle: each adds a quarter.
    let studs = stud(3, DVec3::Y * 0.14).chain(stud(1, DVec3::X * 0.14));
    let cube = super::cube();
    ControlMesh {
        edits: studs.chain(window).collect(),
        positions: cube.positions.iter().map(|p| p * 1.3).collect(),
        ..cube
    }
}

/// The stage that the shapes stand on: a sheet that bends up behind them.
fn stage() -> ControlMesh {
    let profile = [[14.0, 0.0], [2.0, 0.0], [-9.0, 0.0], [-12.0, 0.4], [-13.5, 2.5], [-14.0, 6.0], [-14.0, 14.0]];
    let row = |[z, y]: [f64; 2]| [-24.0, -8.0, 8.0, 24.0].map(|x| DVec3::new(x, y, z));
    let quads = (0..3 * (profile.len() as u32 - 1)).map(|k| {
        let v = k / 3 * 4 + k % 3;
        [v, v + 1, v + 5, v + 4]
    });
    super::polygons(profile.into_iter().flat_map(row).collect(), quads)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tag_is_shown() {
        let meshes: Vec<_> = meshes().into_iter().map(|(_, mesh)| mesh).collect();
        meshes.iter().for_each(|mesh| mesh.validate().unwrap());
        let any = |shown: &dyn Fn(&ControlMesh) -> bool| assert!(meshes.iter().any(shown));
        any(&|m| m.creases.iter().any(|c| c.sharpness > 0.0 && c.sharpness < 10.0 && c.sharpness.fract() > 0.0));
        any(&|m| m.creases.iter().any(|c| c.sharpness >= 10.0));
        any(&|m| !m.corners.is_empty());
        any(&|m| !m.holes.is_empty());
        any(&|m| m.boundary == BoundaryRule::None);
        any(&|m| m.boundary == BoundaryRule::EdgeAndCorner);
        any(&|m| m.crease_method == CreaseMethod::Chaikin);
        any(&|m| m.triangles == TriangleRule::Smooth);
        any(&|m| m.face_sizes.iter().any(|&n| n > 4));
        any(&|m| m.edits.iter().any(|e| e.kind == EditKind::Vertex));
        any(&|m| m.edits.iter().any(|e| e.kind == EditKind::Face));
    }

    #[test]
    fn stage_faces_up_and_to_the_front() {
        let stage = stage();
        for face in stage.faces() {
            let p = |i: usize| stage.positions[face[i].idx()];
            let normal = (p(1) - p(0)).cross(p(2) - p(0));
            assert!(normal.y >= 0.0 && normal.z >= 0.0 && normal.x == 0.0, "{normal}");
        }
    }

    #[test]
    fn shapes_have_the_parts_they_are_named_for() {
        assert_eq!(shell().holes.len(), 6);
        let fold = dart();
        let ends: Vec<_> = fold.creases.iter().map(|c| fold.positions[c.edge[1].idx()]).collect();
        assert_eq!(fold.creases.len(), 4);
        assert_eq!(ends[1], DVec3::Y * 1.8);
        assert!(ends[3].x > 1.0 && ends[3].y == 0.0);
    }
}
