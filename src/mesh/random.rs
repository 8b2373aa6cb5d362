//! Random control meshes for fuzzing: small, seeded, and full of what real files have only in places.
//!
//! [`random_mesh`] starts from a shape of the corpus, a grid or a heap of faces, **damages** it (faces split, merged,
//! removed, doubled, turned over, vertices welded or repeated, fins added), then draws tags. The result is always
//! valid, often non-manifold. [`random_edits`] adds hierarchical edits.
//!
//! The same seed gives the same mesh on every machine.

use super::shapes::noise::Random;
use super::{BoundaryRule, ControlMesh, Corner, Crease, CreaseMethod, Edit, EditKind, EditValue, TriangleRule, shapes};
use crate::ids::{FaceId, VertexId};
use glam::DVec3;

/// Sharpness values that tests of decay need: fractions, whole numbers, the last semi-sharp one, infinite ones.
const SHARPNESS: [f32; 12] = [0.001, 0.1, 0.5, 0.7, 0.999, 1.0, 1.4, 2.0, 3.25, 9.999, 10.0, f32::INFINITY];

/// Faces a mesh is damaged up to; growth stops there.
const MAX_FACES: usize = 60;

/// A valid control mesh, without hierarchical edits.
///
/// ```
/// use lazytess::mesh::random::random_mesh;
/// assert!(random_mesh(7).validate().is_ok());
/// assert_eq!(random_mesh(7), random_mesh(7));
/// ```
pub fn random_mesh(seed: u64) -> ControlMesh {
    let mut random = Random::new(seed, 0);
    let mut draft = Draft::start(&mut random);
    for _ in 0..random.below(6) {
        draft.damage(&mut random);
    }
    let mut mesh = draft.finish();
    draw_tags(&mut mesh, &mut random);
    mesh
}

/// One to five hierarchical edits for a mesh, at most three levels deep.
pub fn random_edits(mesh: &ControlMesh, seed: u64) -> Vec<Edit> {
    let mut random = Random::new(seed, 1);
    (0..1 + random.below(5)).map(|_| random_edit(mesh, &mut random)).collect()
}

/// Polygons under construction.
struct Draft {
    positions: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
}

impl Draft {
    fn start(random: &mut Random) -> Self {
        let mut draft = match random.below(4) {
            0 => Self::of_shape(random),
            1 => Self::heap(random),
            _ => Self::grid(1 + random.below(4) as u32, 1 + random.below(4) as u32),
        };
        let size = if random.chance(0.5) { 0.3 } else { 0.0 };
        for p in &mut draft.positions {
            *p += size * (DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5);
        }
        draft
    }

    fn of_shape(random: &mut Random) -> Self {
        let small = |(_, mesh): &shapes::NamedShape| mesh.n_faces() <= MAX_FACES;
        let mut shapes: Vec<_> = shapes::all().into_iter().filter(small).collect();
        let (_, mesh) = shapes.swap_remove(random.below(shapes.len()));
        let faces = mesh.faces().map(|f| f.iter().map(|v| v.0).collect()).collect();
        Draft { positions: mesh.positions, faces }
    }

    fn grid(n_x: u32, n_y: u32) -> Self {
        let position = |i: u32| DVec3::new((i % (n_x + 1)) as f64, (i / (n_x + 1)) as f64, 0.0);
        let quad = |x: u32, y: u32| {
            let first = y * (n_x + 1) + x;
            vec![first, first + 1, first + n_x + 2, first + n_x + 1]
        };
        let faces = (0..n_y).flat_map(|y| (0..n_x).map(move |x| quad(x, y))).collect();
        Draft { positions: (0..(n_x + 1) * (n_y + 1)).map(position).collect(), faces }
    }

    /// Faces that name any of a few vertices: hardly an edge of it is manifold.
    fn heap(random: &mut Random) -> Self {
        let n_vertices = 4 + random.below(6);
        let position = |_| DVec3::new(random.unit(), random.unit(), random.unit());
        let positions: Vec<_> = (0..n_vertices).map(position).collect();
        let n_faces = 1 + random.below(8);
        let mut face = |_| {
            let n = 3 + random.below(4);
            (0..n).map(|_| random.below(n_vertices) as u32).collect()
        };
        Draft { positions, faces: (0..n_faces).map(&mut face).collect() }
    }

    /// One change of the kinds that break assumptions.
    fn damage(&mut self, random: &mut Random) {
        let f = random.below(self.faces.len());
        let k = random.below(self.faces[f].len());
        match random.below(9) {
            0 if self.faces.len() > 1 => drop(self.faces.swap_remove(f)),
            1 => self.faces.push(self.faces[f].clone()),
            2 => self.faces[f].reverse(),
            3 => self.repeat_vertex(f, k),
            4 => self.weld(random),
            5 => self.add_fin(f, k, random),
            6 => self.split(f, k),
            7 => self.merge_across(f, k),
            _ => self.cut_corner(f, k),
        }
        self.faces.truncate(MAX_FACES);
    }

    /// The face names a vertex twice in a row.
    fn repeat_vertex(&mut self, f: usize, k: usize) {
        let vertex = self.faces[f][k];
        self.faces[f].insert(k, vertex);
    }

    /// Two vertices become one.
    fn weld(&mut self, random: &mut Random) {
        let [kept, lost] = [0, 1].map(|_| random.below(self.positions.len()) as u32);
        self.faces.iter_mut().flatten().filter(|v| **v == lost).for_each(|v| *v = kept);
    }

    /// A quad or triangle on edge `k`, beside the faces that are there.
    fn add_fin(&mut self, f: usize, k: usize, random: &mut Random) {
        let (a, b) = (self.faces[f][k], self.faces[f][(k + 1) % self.faces[f].len()]);
        let new = self.positions.len() as u32;
        let up = DVec3::new(0.1, 0.2, 1.0);
        self.positions.extend([a, b].map(|v| self.positions[v as usize] + up));
        self.faces.push(if random.chance(0.5) { vec![b, a, new, new + 1] } else { vec![b, a, new] });
    }

    /// A face of more than three corners becomes a triangle and the rest.
    fn split(&mut self, f: usize, k: usize) {
        let n = self.faces[f].len();
        if n > 3 {
            let triangle = [0, 1, 2].map(|d| self.faces[f][(k + d) % n]).to_vec();
            self.faces[f].remove((k + 1) % n);
            self.faces.push(triangle);
        }
    }

    /// The faces on both sides of edge `k` become one.
    fn merge_across(&mut self, f: usize, k: usize) {
        let face = &self.faces[f];
        let (a, b) = (face[k], face[(k + 1) % face.len()]);
        let beyond = self.faces.iter().enumerate().find_map(|(g, other)| {
            let m = other.len();
            let at = (0..m).find(|&i| other[i] == b && other[(i + 1) % m] == a)?;
            (g != f).then_some((g, at))
        });
        if let Some((g, at)) = beyond {
            let other = &self.faces[g];
            // From a, the far side of the other face, to b.
            let detour: Vec<u32> = (2..other.len()).map(|d| other[(at + d) % other.len()]).collect();
            self.faces[f].splice(k + 1..k + 1, detour);
            self.faces.swap_remove(g);
        }
    }

    /// The face loses a corner, and its neighbours there their partner.
    fn cut_corner(&mut self, f: usize, k: usize) {
        if self.faces[f].len() > 3 {
            self.faces[f].remove(k);
        }
    }

    fn finish(self) -> ControlMesh {
        ControlMesh::from_polygons(self.positions, &self.faces).expect("damage keeps a mesh valid")
    }
}

fn draw_tags(mesh: &mut ControlMesh, random: &mut Random) {
    let share = [0.0, 0.1, 0.4, 1.0][random.below(4)];
    let edges: Vec<[VertexId; 2]> = mesh.faces().flat_map(edges_of).collect();
    for edge in edges {
        if random.chance(share) {
            mesh.creases.push(Crease { edge, sharpness: draw_sharpness(random) });
        }
    }
    for v in 0..mesh.positions.len() {
        if random.chance(share / 3.0) {
            mesh.corners.push(Corner { vertex: VertexId::from(v), sharpness: draw_sharpness(random) });
        }
    }
    mesh.holes = (0..mesh.n_faces()).filter(|_| random.chance(0.05)).map(FaceId::from).collect();
    mesh.boundary = [BoundaryRule::None, BoundaryRule::EdgeAndCorner, BoundaryRule::EdgeOnly][random.below(3)];
    mesh.crease_method = [CreaseMethod::Uniform, CreaseMethod::Chaikin][random.below(2)];
    mesh.triangles = [TriangleRule::Catmark, TriangleRule::Smooth][random.below(2)];
}

fn edges_of(face: &[VertexId]) -> impl Iterator<Item = [VertexId; 2]> {
    face.iter().zip(face.iter().cycle().skip(1)).map(|(&a, &b)| [a, b])
}

fn draw_sharpness(random: &mut Random) -> f32 {
    SHARPNESS[random.below(SHARPNESS.len())]
}

fn random_edit(mesh: &ControlMesh, random: &mut Random) -> Edit {
    let face = random.below(mesh.n_faces());
    let mut path = vec![face as u32];
    let mut n = mesh.face_sizes[face] as usize;
    for _ in 0..random.below(4) {
        path.push(random.below(n) as u32);
        n = 4;
    }
    let kind = [EditKind::Vertex, EditKind::Vertex, EditKind::Edge, EditKind::Face][random.below(4)];
    if kind != EditKind::Face {
        path.push(random.below(n) as u32);
    }
    Edit { kind, path, value: draw_value(kind, random) }
}

fn draw_value(kind: EditKind, random: &mut Random) -> EditValue {
    let p = DVec3::new(random.unit(), random.unit(), random.unit());
    let sharpness = draw_sharpness(random);
    match (kind, random.below(4)) {
        (EditKind::Face, _) => EditValue::Hole,
        (EditKind::Vertex, 0) => EditValue::AddPosition(p - 0.5),
        (EditKind::Vertex, 1) => EditValue::SetPosition(p),
        (_, 0 | 2) => EditValue::AddSharpness(sharpness - 2.0),
        _ => EditValue::SetSharpness(sharpness),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_and_edits_are_valid_and_varied() {
        let meshes: Vec<ControlMesh> = (0..300).map(random_mesh).collect();
        for (seed, mesh) in (0..).zip(&meshes) {
            let edits = random_edits(mesh, seed);
            assert!(ControlMesh { edits, ..mesh.clone() }.validate().is_ok(), "seed {seed}");
        }
        let sizes: std::collections::BTreeSet<u32> = meshes.iter().flat_map(|m| m.face_sizes.clone()).collect();
        assert!(sizes.len() > 5, "{sizes:?}");
        assert!(meshes.iter().any(|m| m.crease_method == CreaseMethod::Chaikin && !m.creases.is_empty()));
        assert!(meshes.iter().any(|m| !m.holes.is_empty()));
    }
}
