//! One Catmull-Clark step of the whole mesh.

use super::{Corner, Edge, Face, INFINITE, Place, RefinedMesh, Vertex};
use crate::mesh::{CreaseMethod, TriangleRule};
use glam::DVec3;

/// The rule that moves a vertex.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Rule {
    /// No sharp edge.
    Smooth,
    /// One sharp edge ends here.
    Dart,
    /// Two sharp edges run through.
    Crease,
    /// The vertex stays where it is.
    Corner,
}

impl Rule {
    pub(super) fn of(vertex_sharpness: f32, n_sharp_edges: usize) -> Self {
        match n_sharp_edges {
            _ if vertex_sharpness > 0.0 => Rule::Corner,
            0 => Rule::Smooth,
            1 => Rule::Dart,
            2 => Rule::Crease,
            _ => Rule::Corner,
        }
    }
}

/// Sharpness after a step of uniform decay.
fn decayed(sharpness: f32) -> f32 {
    match sharpness {
        s if s >= INFINITE => INFINITE,
        s if s > 1.0 => s - 1.0,
        _ => 0.0,
    }
}

fn is_semi_sharp(sharpness: f32) -> bool {
    sharpness > 0.0 && sharpness < INFINITE
}

/// Semi-sharp edges at a vertex: their number and the sum of their sharpness.
#[derive(Clone, Copy, Default)]
struct SemiSharp {
    n: u32,
    sum: f32,
}

/// Sums over the edges and faces at a vertex.
#[derive(Clone, Default)]
struct Surroundings {
    n_edges: usize,
    edge_ends: DVec3,
    face_points: DVec3,
    /// Edges that are sharp before the step, and the sum of their other ends.
    sharp_before: (usize, DVec3),
    /// The same for edges whose half at the vertex is still sharp after it.
    sharp_after: (usize, DVec3),
    /// Sharpness values that decay in this step.
    decaying: (usize, f32),
}

/// Sum of the face points beside an edge, number of faces, number of triangles among them.
#[derive(Clone, Copy, Default)]
struct Beside {
    face_points: DVec3,
    n_faces: u32,
    n_triangles: u32,
}

impl<'a> RefinedMesh<'a> {
    /// The mesh after one step, edits of that level applied. Vertex v stays number v; edge points, then face points
    /// follow.
    pub fn refine(&self) -> RefinedMesh<'a> {
        let halves = self.half_sharpness();
        let face_points: Vec<DVec3> = (0..self.faces.len()).map(|f| self.face_point(f)).collect();
        let mut mesh = RefinedMesh {
            control: self.control,
            edits: self.edits.clone(),
            n_steps: self.n_steps + 1,
            vertices: self.refined_vertices(&halves, &face_points),
            edges: self.refined_edges(&halves),
            faces: Vec::with_capacity(self.corners.len()),
            corners: Vec::with_capacity(4 * self.corners.len()),
        };
        (0..self.faces.len()).for_each(|f| self.split(f, &mut mesh));
        mesh.apply_edits();
        mesh
    }

    fn face_point(&self, face: usize) -> DVec3 {
        let corners = self.corners(face);
        corners.iter().map(|c| self.position(c.vertex as usize)).sum::<DVec3>() / corners.len() as f64
    }

    /// Sharpness of both halves of each edge after the step, the half at `ends[0]` first.
    fn half_sharpness(&self) -> Vec<[f32; 2]> {
        match self.control.crease_method {
            CreaseMethod::Uniform => self.edges.iter().map(|e| [decayed(e.sharpness); 2]).collect(),
            CreaseMethod::Chaikin => self.chaikin_sharpness(),
        }
    }

    fn chaikin_sharpness(&self) -> Vec<[f32; 2]> {
        let mut at_vertex = vec![SemiSharp::default(); self.vertices.len()];
        for edge in self.edges.iter().filter(|e| is_semi_sharp(e.sharpness)) {
            for v in edge.ends {
                at_vertex[v as usize].n += 1;
                at_vertex[v as usize].sum += edge.sharpness;
            }
        }
        let half = |s: f32, SemiSharp { n, sum }: SemiSharp| match n {
            _ if !is_semi_sharp(s) => s,
            1 => (s - 1.0).max(0.0),
            _ => (0.75 * s + 0.25 * ((sum - s) / (n - 1) as f32) - 1.0).max(0.0),
        };
        self.edges.iter().map(|e| e.ends.map(|v| half(e.sharpness, at_vertex[v as usize]))).collect()
    }

    fn refined_vertices(&self, halves: &[[f32; 2]], face_points: &[DVec3]) -> Vec<Vertex> {
        let around = self.surroundings(halves, face_points);
        let smooth = |position| Vertex { position, sharpness: 0.0, pinned: false };
        let old = (0..self.vertices.len()).map(|v| Vertex {
            position: self.vertex_point(v, &around[v]),
            sharpness: decayed(self.vertices[v].sharpness),
            ..self.vertices[v]
        });
        let edge_points = self.edge_points(halves, face_points).into_iter().map(smooth);
        old.chain(edge_points).chain(face_points.iter().copied().map(smooth)).collect()
    }

    fn edge_points(&self, halves: &[[f32; 2]], face_points: &[DVec3]) -> Vec<DVec3> {
        let beside = self.beside_edges(face_points);
        (0..self.edges.len()).map(|e| self.edge_point(e, halves[e], beside[e])).collect()
    }

    fn beside_edges(&self, face_points: &[DVec3]) -> Vec<Beside> {
        let mut beside = vec![Beside::default(); self.edges.len()];
        for (f, &point) in face_points.iter().enumerate() {
            for corner in self.corners(f) {
                let b = &mut beside[corner.edge as usize];
                b.face_points += point;
                b.n_faces += 1;
                b.n_triangles += u32::from(self.faces[f].n_corners == 3);
            }
        }
        beside
    }

    fn edge_point(&self, e: usize, halves: [f32; 2], beside: Beside) -> DVec3 {
        let Edge { ends, sharpness, .. } = self.edges[e];
        let middle = (self.position(ends[0] as usize) + self.position(ends[1] as usize)) / 2.0;
        // Edges with one face occur unsharpened only at the rim of a restricted mesh, where nobody looks.
        if halves.iter().all(|&s| s > 0.0) || beside.n_faces != 2 {
            return middle;
        }
        let w = match self.control.triangles {
            TriangleRule::Catmark => 0.25,
            TriangleRule::Smooth => (0.470 * beside.n_triangles as f64 + 0.25 * (2 - beside.n_triangles) as f64) / 2.0,
        };
        let smooth = (1.0 - 2.0 * w) * middle + w * beside.face_points;
        let s = sharpness as f64;
        s * middle + (1.0 - s) * smooth
    }

    fn surroundings(&self, halves: &[[f32; 2]], face_points: &[DVec3]) -> Vec<Surroundings> {
        let mut around = vec![Surroundings::default(); self.vertices.len()];
        for (edge, halves) in self.edges.iter().zip(halves) {
            for (end, &half) in halves.iter().enumerate() {
                let other = self.position(edge.ends[1 - end] as usize);
                around[edge.ends[end] as usize].add_edge(edge.sharpness, half, other);
            }
        }
        for (f, &point) in face_points.iter().enumerate() {
            self.corners(f).iter().for_each(|c| around[c.vertex as usize].face_points += point);
        }
        around
    }

    fn vertex_point(&self, v: usize, around: &Surroundings) -> DVec3 {
        let Vertex { position, sharpness, .. } = self.vertices[v];
        let before = Rule::of(sharpness, around.sharp_before.0);
        let after = Rule::of(decayed(sharpness), around.sharp_after.0);
        let place_before = around.apply(before, position, around.sharp_before.1);
        if matches!(before, Rule::Smooth | Rule::Dart) || before == after {
            return place_before;
        }
        let w = around.decay_weight(sharpness);
        w * place_before + (1.0 - w) * around.apply(after, position, around.sharp_after.1)
    }

    fn refined_edges(&self, halves: &[[f32; 2]]) -> Vec<Edge> {
        let n_vertices = self.vertices.len() as u32;
        let mut edges = Vec::with_capacity(2 * self.edges.len() + self.corners.len());
        for (e, edge) in self.edges.iter().enumerate() {
            let point = n_vertices + e as u32;
            let half = |end: usize| Edge { ends: [edge.ends[end], point], sharpness: halves[e][end], ..*edge };
            edges.extend([half(0), half(1)]);
        }
        let first_face_point = n_vertices + self.edges.len() as u32;
        for f in 0..self.faces.len() {
            let spoke = |c: &Corner| [n_vertices + c.edge, first_face_point + f as u32];
            edges.extend(self.corners(f).iter().map(|c| Edge { ends: spoke(c), sharpness: 0.0, pinned: false }));
        }
        edges
    }

    /// Appends the children of face `f` to `mesh`.
    fn split(&self, f: usize, mesh: &mut RefinedMesh) {
        let face = self.faces[f];
        let n = face.n_corners as usize;
        for k in 0..n {
            let mut child = self.child_corners(f, k);
            let mut place = Place { sub: k as u32, ..face.place };
            if n == 4 {
                child.rotate_right(k);
                place = face.place.child(k as u32);
            }
            mesh.faces.push(Face { first_corner: mesh.corners.len() as u32, n_corners: 4, place, ..face });
            mesh.corners.extend(child);
        }
    }

    /// The child of face `f` at its corner `k`, starting at that corner.
    fn child_corners(&self, f: usize, k: usize) -> [Corner; 4] {
        let corners = self.corners(f);
        let n = corners.len();
        let (here, before) = (corners[k], corners[(k + n - 1) % n]);
        let (n_vertices, n_edges) = (self.vertices.len() as u32, self.edges.len() as u32);
        let spoke = |k: usize| 2 * n_edges + self.faces[f].first_corner + k as u32;
        [
            Corner { vertex: here.vertex, edge: 2 * here.edge + self.end_at_start(here) },
            Corner { vertex: n_vertices + here.edge, edge: spoke(k) },
            Corner { vertex: n_vertices + n_edges + f as u32, edge: spoke((k + n - 1) % n) },
            Corner { vertex: n_vertices + before.edge, edge: 2 * before.edge + 1 - self.end_at_start(before) },
        ]
    }

    /// Which end of its edge a corner is.
    fn end_at_start(&self, corner: Corner) -> u32 {
        u32::from(self.edges[corner.edge as usize].ends[0] != corner.vertex)
    }
}

impl Surroundings {
    fn add_edge(&mut self, sharpness: f32, half: f32, other_end: DVec3) {
        self.n_edges += 1;
        self.edge_ends += other_end;
        if sharpness > 0.0 {
            self.sharp_before = (self.sharp_before.0 + 1, self.sharp_before.1 + other_end);
        }
        if half > 0.0 {
            self.sharp_after = (self.sharp_after.0 + 1, self.sharp_after.1 + other_end);
        } else if sharpness > 0.0 {
            self.decaying = (self.decaying.0 + 1, self.decaying.1 + sharpness);
        }
    }

    fn apply(&self, rule: Rule, v: DVec3, sharp_ends: DVec3) -> DVec3 {
        let n = self.n_edges as f64;
        match rule {
            Rule::Corner => v,
            // A vertex without faces has no edges either.
            _ if self.n_edges == 0 => v,
            Rule::Crease => 0.75 * v + 0.125 * sharp_ends,
            Rule::Smooth | Rule::Dart => (n - 2.0) / n * v + (self.edge_ends + self.face_points) / (n * n),
        }
    }

    /// Weight of the rule before the step: the mean of the sharpness values that end in it, at most 1.
    fn decay_weight(&self, vertex_sharpness: f32) -> f64 {
        let (mut n, mut sum) = self.decaying;
        if vertex_sharpness > 0.0 && decayed(vertex_sharpness) == 0.0 {
            (n, sum) = (n + 1, sum + vertex_sharpness);
        }
        (sum / n as f32).min(1.0) as f64
    }
}

impl Place {
    /// The cell at corner `k` of this one.
    pub(super) fn child(self, k: u32) -> Place {
        let (du, dv) = [(0, 0), (1, 0), (1, 1), (0, 1)][k as usize];
        Place { level: self.level + 1, i: 2 * self.i + du, j: 2 * self.j + dv, ..self }
    }
}
