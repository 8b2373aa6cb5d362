//! From a mesh that makes something fail to a smallest one that still does, printed as a test.

use super::{BoundaryRule, ControlMesh, CreaseMethod, Edit, EditValue, TriangleRule};
use crate::ids::{FaceId, VertexId};
use glam::DVec3;
use std::fmt::Write;

/// Drops faces, face corners, tags and unused vertices, and simplifies what is left, for as long as `fails` says yes.
///
/// `fails` sees valid meshes only. No single simplification of the result fails any more.
///
/// ```
/// use lazytess::mesh::{random::random_mesh, shapes, shrink::shrink};
/// let smallest = shrink(shapes::cube(), |mesh| mesh.face_sizes.contains(&4));
/// assert_eq!((smallest.n_faces(), smallest.positions.len()), (1, 4));
/// ```
pub fn shrink(mesh: ControlMesh, mut fails: impl FnMut(&ControlMesh) -> bool) -> ControlMesh {
    let mut smallest = mesh;
    loop {
        let simpler = candidates(&smallest).find(|c| *c != smallest && c.validate().is_ok() && fails(c));
        match simpler {
            Some(mesh) => smallest = mesh,
            None => return smallest,
        }
    }
}

/// Meshes with one thing less, those that lose most first.
fn candidates(mesh: &ControlMesh) -> impl Iterator<Item = ControlMesh> {
    let faces = (0..mesh.n_faces()).map(|f| without_face(mesh, f));
    let creases = (0..mesh.creases.len()).map(|i| changed(mesh, |m| drop_at(&mut m.creases, i)));
    let corners = (0..mesh.corners.len()).map(|i| changed(mesh, |m| drop_at(&mut m.corners, i)));
    let holes = (0..mesh.holes.len()).map(|i| changed(mesh, |m| drop_at(&mut m.holes, i)));
    let edits = (0..mesh.edits.len()).map(|i| changed(mesh, |m| drop_at(&mut m.edits, i)));
    let face_corners = (0..mesh.face_vertices.len()).map(|i| without_face_corner(mesh, i));
    let vertices = std::iter::once_with(|| without_unused_vertices(mesh));
    let tags = creases.chain(corners).chain(holes).chain(edits).chain(defaults(mesh));
    faces.chain(tags).chain(vertices).chain(face_corners).chain(rounder(mesh))
}

fn changed(mesh: &ControlMesh, change: impl FnOnce(&mut ControlMesh)) -> ControlMesh {
    let mut mesh = mesh.clone();
    change(&mut mesh);
    mesh
}

fn drop_at<T>(list: &mut Vec<T>, i: usize) {
    list.remove(i);
}

fn defaults(mesh: &ControlMesh) -> impl Iterator<Item = ControlMesh> {
    let rules: [fn(&mut ControlMesh); 3] = [
        |m| m.boundary = BoundaryRule::default(),
        |m| m.crease_method = CreaseMethod::default(),
        |m| m.triangles = TriangleRule::default(),
    ];
    rules.into_iter().map(|rule| changed(mesh, rule))
}

/// Infinite instead of finite sharpness, and coordinates that are multiples of 1/4.
fn rounder(mesh: &ControlMesh) -> impl Iterator<Item = ControlMesh> {
    let creases = (0..mesh.creases.len()).map(|i| changed(mesh, |m| m.creases[i].sharpness = 10.0));
    let corners = (0..mesh.corners.len()).map(|i| changed(mesh, |m| m.corners[i].sharpness = 10.0));
    let round = |p: &mut DVec3| *p = (*p * 4.0).round() / 4.0;
    let positions = (0..mesh.positions.len()).map(move |v| changed(mesh, |m| round(&mut m.positions[v])));
    creases.chain(corners).chain(positions)
}

fn without_face(mesh: &ControlMesh, face: usize) -> ControlMesh {
    changed(mesh, |m| {
        let first = m.face_sizes[..face].iter().sum::<u32>() as usize;
        m.face_vertices.drain(first..first + m.face_sizes[face] as usize);
        m.face_sizes.remove(face);
        let renumbered = |f: FaceId| if f.idx() > face { FaceId(f.0 - 1) } else { f };
        m.holes.retain(|f| f.idx() != face);
        m.holes.iter_mut().for_each(|f| *f = renumbered(*f));
        m.edits.retain(|e| e.face().idx() != face);
        m.edits.iter_mut().for_each(|e| e.path[0] = renumbered(e.face()).0);
    })
}

fn without_face_corner(mesh: &ControlMesh, corner: usize) -> ControlMesh {
    let mut face = 0;
    let mut before = corner;
    while before >= mesh.face_sizes[face] as usize {
        before -= mesh.face_sizes[face] as usize;
        face += 1;
    }
    changed(mesh, |m| {
        m.face_vertices.remove(corner);
        m.face_sizes[face] -= 1;
    })
}

/// Vertices that neither faces nor tags name go, the others move up.
fn without_unused_vertices(mesh: &ControlMesh) -> ControlMesh {
    let mut used = vec![false; mesh.positions.len()];
    let tagged = mesh.creases.iter().flat_map(|c| c.edge).chain(mesh.corners.iter().map(|c| c.vertex));
    mesh.face_vertices.iter().copied().chain(tagged).for_each(|v| used[v.idx()] = true);
    let new_id = |v: VertexId| VertexId::from(used[..v.idx()].iter().filter(|&&u| u).count());
    changed(mesh, |m| {
        let mut kept = used.iter();
        m.positions.retain(|_| *kept.next().expect("one flag a vertex"));
        m.face_vertices.iter_mut().for_each(|v| *v = new_id(*v));
        m.creases.iter_mut().for_each(|c| c.edge = c.edge.map(new_id));
        m.corners.iter_mut().for_each(|c| c.vertex = new_id(c.vertex));
    })
}

/// The mesh as the source of a `#[test]` that calls `check(&mesh)`.
pub fn as_test(mesh: &ControlMesh, name: &str) -> String {
    let mut text = format!("#[test]\nfn {name}() {{\n    let mut mesh = ControlMesh::from_polygons(\n        vec![\n");
    for p in &mesh.positions {
        let _ = writeln!(text, "            {},", vector(*p));
    }
    let ids = |face: &[VertexId]| format!("vec!{:?}", face.iter().map(|v| v.0).collect::<Vec<_>>());
    let faces: Vec<String> = mesh.faces().map(ids).collect();
    let _ = writeln!(text, "        ],\n        &[{}],\n    )\n    .unwrap();", faces.join(", "));
    for line in rule_lines(mesh).into_iter().chain(tag_lines(mesh)) {
        let _ = writeln!(text, "    mesh.{line};");
    }
    text + "    check(&mesh);\n}\n"
}

/// Assignments of the rules that are not the default.
fn rule_lines(mesh: &ControlMesh) -> Vec<String> {
    let default = ControlMesh::default();
    let rules = [
        (mesh.boundary != default.boundary, format!("boundary = BoundaryRule::{:?}", mesh.boundary)),
        (
            mesh.crease_method != default.crease_method,
            format!("crease_method = CreaseMethod::{:?}", mesh.crease_method),
        ),
        (mesh.triangles != default.triangles, format!("triangles = TriangleRule::{:?}", mesh.triangles)),
    ];
    rules.into_iter().filter(|(differs, _)| *differs).map(|(_, line)| line).collect()
}

fn tag_lines(mesh: &ControlMesh) -> impl Iterator<Item = String> {
    let creases = mesh.creases.iter().map(|c| {
        let ([a, b], s) = (c.edge, single(c.sharpness));
        format!("creases.push(Crease {{ edge: [VertexId({a}), VertexId({b})], sharpness: {s} }})")
    });
    let corners = mesh.corners.iter().map(|c| {
        let (v, s) = (c.vertex, single(c.sharpness));
        format!("corners.push(Corner {{ vertex: VertexId({v}), sharpness: {s} }})")
    });
    let holes = mesh.holes.iter().map(|f| format!("holes.push(FaceId({f}))"));
    creases.chain(corners).chain(holes).chain(mesh.edits.iter().map(|e| format!("edits.push({})", edit(e))))
}

fn vector(p: DVec3) -> String {
    format!("DVec3::new({:?}, {:?}, {:?})", p.x, p.y, p.z)
}

fn single(s: f32) -> String {
    if s.is_infinite() { "f32::INFINITY".into() } else { format!("{s:?}") }
}

fn edit(e: &Edit) -> String {
    let value = match e.value {
        EditValue::AddPosition(p) => format!("AddPosition({})", vector(p)),
        EditValue::SetPosition(p) => format!("SetPosition({})", vector(p)),
        EditValue::AddSharpness(s) => format!("AddSharpness({})", single(s)),
        EditValue::SetSharpness(s) => format!("SetSharpness({})", single(s)),
        EditValue::Hole => "Hole".into(),
    };
    format!("Edit {{ kind: EditKind::{:?}, path: vec!{:?}, value: EditValue::{value} }}", e.kind, e.path)
}

#[cfg(test)]
mod tests {
    use super::super::random::{random_edits, random_mesh};
    use super::*;

    #[test]
    fn what_matters_stays_and_the_rest_goes() {
        let mut mesh = random_mesh(1);
        mesh.edits = random_edits(&mesh, 1);
        mesh.crease_method = CreaseMethod::Chaikin;
        mesh.holes = vec![FaceId::from(mesh.n_faces() - 1)];
        let smallest = shrink(mesh, |m| m.holes.len() == 1 && m.crease_method == CreaseMethod::Chaikin);
        assert_eq!((smallest.n_faces(), smallest.positions.len() <= 3), (1, true));
        assert!(smallest.creases.is_empty() && smallest.corners.is_empty() && smallest.edits.is_empty());
        let text = as_test(&smallest, "found");
        assert!(text.contains("mesh.crease_method = CreaseMethod::Chaikin;"), "{text}");
        assert!(text.contains("mesh.holes.push(FaceId(0));"), "{text}");
    }
}
