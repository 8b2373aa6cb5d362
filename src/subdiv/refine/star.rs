//! A vertex with the edges and faces around it.

use super::step::Rule;
use super::{INFINITE, RefinedMesh};
use glam::DVec3;

/// One face at a vertex, seen from the vertex: the edges that leave and arrive, and the points on them.
#[derive(Clone, Copy)]
pub(super) struct Sector {
    face: usize,
    pub(super) next_edge: u32,
    pub(super) prev_edge: u32,
    pub(super) next: DVec3,
    pub(super) diagonal: DVec3,
    pub(super) prev: DVec3,
}

/// A vertex with everything that touches it.
pub(super) struct Star<'m> {
    mesh: &'m RefinedMesh<'m>,
    vertex: usize,
    edges: Vec<usize>,
    sectors: Vec<Sector>,
}

impl RefinedMesh<'_> {
    pub(super) fn star(&self, vertex: usize) -> Star<'_> {
        let touches = |e: &usize| self.edges[*e].ends.contains(&(vertex as u32));
        let mut sectors = Vec::new();
        for face in 0..self.faces.len() {
            let corners = self.corners(face);
            let at_vertex = (0..corners.len()).filter(|&k| corners[k].vertex as usize == vertex);
            sectors.extend(at_vertex.map(|k| self.sector(face, k)));
        }
        Star { mesh: self, vertex, edges: (0..self.edges.len()).filter(touches).collect(), sectors }
    }

    /// The face as seen from its corner `k`. For faces that are no quads, `diagonal` means nothing.
    pub(super) fn sector(&self, face: usize, k: usize) -> Sector {
        let corners = self.corners(face);
        let n = corners.len();
        let point = |d: usize| self.position(corners[(k + d) % n].vertex as usize);
        let (next_edge, prev_edge) = (corners[k].edge, corners[(k + n - 1) % n].edge);
        Sector { face, next_edge, prev_edge, next: point(1), diagonal: point(2), prev: point(n - 1) }
    }
}

impl Star<'_> {
    pub(super) fn position(&self) -> DVec3 {
        self.mesh.position(self.vertex)
    }

    /// Edges at the vertex.
    pub(super) fn valence(&self) -> usize {
        self.edges.len()
    }

    pub(super) fn is_sharp(&self, edge: u32) -> bool {
        self.mesh.edges[edge as usize].sharpness > 0.0
    }

    /// Whether the rules at the vertex stay the same from here on, so that limit masks hold.
    pub(super) fn is_at_rest(&self) -> bool {
        let stays = |sharpness: f32| sharpness <= 0.0 || sharpness >= INFINITE;
        let mesh = self.mesh;
        stays(mesh.vertices[self.vertex].sharpness)
            && self.edges.iter().all(|&e| stays(mesh.edges[e].sharpness))
            && self.sectors.iter().all(|s| mesh.faces[s.face].n_corners == 4 && !mesh.awaits_edit(s.face))
    }

    pub(super) fn rule(&self) -> Rule {
        let n_sharp = self.edges.iter().filter(|&&e| self.is_sharp(e as u32)).count();
        Rule::of(self.mesh.vertices[self.vertex].sharpness, n_sharp)
    }

    fn edge_end(&self, edge: usize) -> DVec3 {
        let [a, b] = self.mesh.edges[edge].ends.map(|v| v as usize);
        self.mesh.position(if a == self.vertex { b } else { a })
    }

    pub(super) fn edge_ends(&self) -> DVec3 {
        self.edges.iter().map(|&e| self.edge_end(e)).sum()
    }

    pub(super) fn sharp_edge_ends(&self) -> DVec3 {
        self.edges.iter().filter(|&&e| self.is_sharp(e as u32)).map(|&e| self.edge_end(e)).sum()
    }

    pub(super) fn diagonals(&self) -> DVec3 {
        self.sectors.iter().map(|s| s.diagonal).sum()
    }

    /// The sector counter-clockwise of `sector`, across the edge that arrives.
    pub(super) fn counter_clockwise(&self, sector: &Sector) -> Option<&Sector> {
        self.sectors.iter().find(|s| s.next_edge == sector.prev_edge)
    }

    /// The sector clockwise of `sector`, across the edge that leaves.
    pub(super) fn clockwise(&self, sector: &Sector) -> Option<&Sector> {
        self.sectors.iter().find(|s| s.prev_edge == sector.next_edge)
    }

    /// All sectors, counter-clockwise from `first`; the vertex must be smooth.
    pub(super) fn ring<'s>(&'s self, first: &'s Sector) -> impl Iterator<Item = &'s Sector> {
        let next = |s: &&'s Sector| self.counter_clockwise(s);
        std::iter::successors(Some(first), next).take(self.sectors.len())
    }
}
