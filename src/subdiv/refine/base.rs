//! The control mesh as step 0: edges found, boundaries and non-manifold places made sharp.

use super::edits::PlacedEdit;
use super::{Corner, Edge, Face, INFINITE, Place, RefinedMesh, Vertex};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{BoundaryRule, ControlMesh};
use std::collections::HashMap;

/// What is known about an edge of the control mesh beyond its ends.
#[derive(Default, Clone)]
struct EdgeFacts {
    faces: Vec<u32>,
    nonmanifold: bool,
}

impl EdgeFacts {
    fn is_boundary(&self) -> bool {
        self.faces.len() == 1
    }
}

/// The edges of a control mesh, found by going through its faces in order.
#[derive(Default)]
struct EdgeTable {
    edges: Vec<Edge>,
    facts: Vec<EdgeFacts>,
    by_ends: HashMap<[u32; 2], u32>,
}

impl EdgeTable {
    /// The edge on which `face` goes from `a` to `b`.
    ///
    /// A second passage of one face, and an edge from a vertex to itself, are edges of their own.
    fn pass(&mut self, face: u32, a: u32, b: u32) -> u32 {
        let key = [a.min(b), a.max(b)];
        let known = if a == b { None } else { self.by_ends.get(&key).copied() };
        let Some(e) = known else {
            let e = self.push(face, a, b);
            self.facts[e as usize].nonmanifold = a == b;
            self.by_ends.entry(key).or_insert(e);
            return e;
        };
        let facts = &mut self.facts[e as usize];
        if facts.faces.last() == Some(&face) {
            facts.nonmanifold = true;
            let own = self.push(face, a, b);
            self.facts[own as usize].nonmanifold = true;
            return own;
        }
        facts.nonmanifold |= facts.faces.len() > 1 || self.edges[e as usize].ends[0] == a;
        facts.faces.push(face);
        e
    }

    fn push(&mut self, face: u32, a: u32, b: u32) -> u32 {
        self.edges.push(Edge { ends: [a, b], sharpness: 0.0, pinned: false });
        self.facts.push(EdgeFacts { faces: vec![face], nonmanifold: false });
        self.edges.len() as u32 - 1
    }

    fn find(&self, [a, b]: [VertexId; 2]) -> Option<u32> {
        self.by_ends.get(&[a.0.min(b.0), a.0.max(b.0)]).copied()
    }
}

/// The edges and face corners at a vertex of the control mesh.
#[derive(Default, Clone)]
struct VertexFacts {
    /// Edges at the vertex; one from the vertex to itself counts twice.
    edges: Vec<u32>,
    /// Corners at the vertex, as (edge that leaves, edge that arrives); a face that repeats the vertex counts again.
    corners: Vec<[u32; 2]>,
}

impl VertexFacts {
    fn count(&self, mut holds: impl FnMut(usize) -> bool) -> usize {
        self.edges.iter().filter(|&&e| holds(e as usize)).count()
    }

    /// Whether the corners form exactly one fan or one closed ring.
    fn is_one_fan_or_ring(&self) -> bool {
        let n = self.corners.len();
        // A fan starts at the corner whose leaving edge no other corner arrives on.
        let is_start = |c: &&[u32; 2]| !self.corners.iter().any(|d| d[1] == c[0]);
        let Some(&start) = self.corners.iter().find(is_start).or(self.corners.first()) else { return true };
        let mut last = start;
        for _ in 1..n {
            match self.corners.iter().find(|c| c[0] == last[1]) {
                Some(&next) if next != start => last = next,
                _ => return false,
            }
        }
        true
    }

    /// An inner vertex of a fin: the surface runs through it as through a crease.
    fn is_fin_crease(&self, facts: &[EdgeFacts]) -> bool {
        self.count(|e| facts[e].nonmanifold) == 2
            && self.count(|e| facts[e].is_boundary()) == 0
            && self.corners.len() > self.edges.len()
    }
}

impl<'a> RefinedMesh<'a> {
    /// The control mesh itself: no step made, but boundaries, corners and non-manifold places decided.
    pub fn from_control(control: &'a ControlMesh) -> Self {
        let vertex = |&position: &_| Vertex { position, sharpness: 0.0, pinned: false };
        let mut mesh = RefinedMesh {
            control,
            edits: control.edits.iter().map(|e| PlacedEdit::new(e, control)).collect(),
            n_steps: 0,
            vertices: control.positions.iter().map(vertex).collect(),
            edges: Vec::new(),
            faces: Vec::new(),
            corners: Vec::new(),
        };
        let mut table = EdgeTable::default();
        mesh.add_faces(&mut table);
        mesh.edges = std::mem::take(&mut table.edges);
        mesh.apply_tags(&table);
        mesh.decide(&table.facts);
        mesh.apply_edits();
        mesh
    }

    fn add_faces(&mut self, table: &mut EdgeTable) {
        for (f, face) in self.control.faces().enumerate() {
            let place = Place { face: FaceId::from(f), sub: 0, level: 0, i: 0, j: 0 };
            let first_corner = self.corners.len() as u32;
            self.faces.push(Face { first_corner, n_corners: face.len() as u32, place, hole: false });
            for (k, v) in face.iter().enumerate() {
                let next = face[(k + 1) % face.len()];
                self.corners.push(Corner { vertex: v.0, edge: table.pass(f as u32, v.0, next.0) });
            }
        }
    }

    fn apply_tags(&mut self, table: &EdgeTable) {
        for crease in &self.control.creases {
            if let Some(e) = table.find(crease.edge) {
                self.edges[e as usize].sharpness = crease.sharpness.clamp(0.0, INFINITE);
            }
        }
        for corner in &self.control.corners {
            self.vertices[corner.vertex.idx()].sharpness = corner.sharpness.clamp(0.0, INFINITE);
        }
        for hole in &self.control.holes {
            self.faces[hole.idx()].hole = true;
        }
    }

    /// Everything that is decided once: holes of rule `None`, sharp edges, sharp vertices.
    fn decide(&mut self, facts: &[EdgeFacts]) {
        if self.control.boundary == BoundaryRule::None {
            self.drop_boundary_faces(facts);
        }
        for (edge, facts) in self.edges.iter_mut().zip(facts) {
            if facts.is_boundary() || facts.nonmanifold {
                (edge.sharpness, edge.pinned) = (INFINITE, true);
            }
        }
        for (v, star) in self.vertex_facts().iter().enumerate() {
            self.decide_vertex(v, star, facts);
        }
    }

    fn decide_vertex(&mut self, v: usize, star: &VertexFacts, facts: &[EdgeFacts]) {
        let vertex = &mut self.vertices[v];
        let one_face = star.corners.len() == 1 && star.edges.len() == 2;
        if one_face && self.control.boundary == BoundaryRule::EdgeAndCorner {
            vertex.sharpness = INFINITE;
        }
        let nonmanifold = star.count(|e| facts[e].nonmanifold) > 0 || !star.is_one_fan_or_ring();
        if nonmanifold && !star.is_fin_crease(facts) {
            (vertex.sharpness, vertex.pinned) = (INFINITE, true);
        }
    }

    /// Rule `None`: faces at a vertex whose boundary edge no tag made infinitely sharp have no surface.
    fn drop_boundary_faces(&mut self, facts: &[EdgeFacts]) {
        let mut open = vec![false; self.vertices.len()];
        for (edge, facts) in self.edges.iter().zip(facts) {
            if facts.is_boundary() && edge.sharpness < INFINITE {
                edge.ends.iter().for_each(|&v| open[v as usize] = true);
            }
        }
        for f in 0..self.faces.len() {
            self.faces[f].hole |= self.corners(f).iter().any(|c| open[c.vertex as usize]);
        }
    }

    fn vertex_facts(&self) -> Vec<VertexFacts> {
        let mut stars = vec![VertexFacts::default(); self.vertices.len()];
        for (e, edge) in self.edges.iter().enumerate() {
            edge.ends.iter().for_each(|&v| stars[v as usize].edges.push(e as u32));
        }
        for f in 0..self.faces.len() {
            let corners = self.corners(f);
            let arriving = corners.iter().cycle().skip(corners.len() - 1);
            for (corner, before) in corners.iter().zip(arriving) {
                stars[corner.vertex as usize].corners.push([corner.edge, before.edge]);
            }
        }
        stars
    }
}
