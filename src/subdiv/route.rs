//! The vertices of a ring whose plan is known: without finding out again which of them are the same.
//!
//! Rings of one plan have the same faces in the same places. A **route** tells for each face after the first across
//! which half-edge of an earlier one it is reached, and which of its vertices are new. So a ring's vertices are found
//! by as many hops as it has faces.

use super::local::LocalMesh;
use super::rows::Index;
use crate::topology::HalfEdges;

/// Bits that tell at which of its half-edges a face is reached.
const PLACE_BITS: u32 = 4;

/// Corners of a face on a route, so that its entries have 16 bits.
const MOST_CORNERS: u32 = 16 - PLACE_BITS;

/// The route of a ring: the new vertices of the target, as bits; then for each further face the half-edge to cross,
/// counted in the order of faces, and where that leads: the new vertices and, in the lowest bits, the place in the
/// face. Nothing if there is no route.
pub(super) fn route(ring: &LocalMesh) -> Vec<u32> {
    let mut out = Vec::with_capacity(2 * ring.n_faces());
    let mut n_vertices = 0;
    // The target's vertices come first.
    let n_of_target = (0..ring.n_corners()).fold(0, |n, k| n.max(ring.vertex(k) + 1));
    for face in 0..ring.n_faces() as u32 {
        let (first, n) = ring.face_corners(face);
        if n > MOST_CORNERS {
            return Vec::new();
        }
        let mut new = 0;
        for (place, h) in (first..first + n).enumerate() {
            if ring.vertex(h) == n_vertices {
                new |= 1 << place;
                n_vertices += 1;
            }
        }
        if face == 0 {
            out.push(new);
            continue;
        }
        // Other twins than those of edges at corners need not be the same in all rings of a plan.
        let is_at_corner = |h: u32| ring.vertex(h).min(ring.vertex(ring.next(h))) < n_of_target;
        let across = (first..first + n).find(|&h| is_at_corner(h) && ring.twin(h) < first);
        let Some(h) = across else { return Vec::new() };
        out.extend([ring.twin(h), new << PLACE_BITS | (h - first)]);
    }
    // The ends of fins are on no face.
    if n_vertices as usize == ring.n_vertices() { out } else { Vec::new() }
}

/// Follows routes, in memory that it keeps.
#[derive(Debug, Default)]
pub(super) struct RouteWalker {
    half_edges: Vec<u32>,
    vertices: Vec<u32>,
}

impl RouteWalker {
    /// The vertices of the ring of the face of `first`, which has this route, in the order that rings have.
    pub fn follow<I: Index>(&mut self, topology: &impl HalfEdges, first: u32, route: &[I]) -> &[u32] {
        self.half_edges.clear();
        self.vertices.clear();
        let (start, n) = topology.corners_at(first);
        self.add_face(topology, [start, first, n], route[0].idx());
        for [across, arrival] in route[1..].as_chunks().0 {
            let h = topology.twin(self.half_edges[across.idx()]);
            let (start, n) = topology.corners_at(h);
            let arrival = arrival.idx();
            let place = arrival as u32 & ((1 << PLACE_BITS) - 1);
            let first = if h >= start + place { h - place } else { h + n - place };
            self.add_face(topology, [start, first, n], arrival >> PLACE_BITS);
        }
        &self.vertices
    }

    /// Adds the half-edges of a face from `first` on, and its new vertices.
    #[inline(always)]
    fn add_face(&mut self, topology: &impl HalfEdges, [start, first, n]: [u32; 3], new: usize) {
        let from = self.half_edges.len();
        self.half_edges.extend(first..start + n);
        self.half_edges.extend(start..first);
        let mut new = new;
        while new != 0 {
            let h = self.half_edges[from + new.trailing_zeros() as usize];
            self.vertices.push(topology.vertex(h));
            new &= new - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::local::RingWalker;
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes;
    use crate::topology::Topology;

    #[test]
    fn routes_lead_to_the_vertices_that_a_walk_finds() {
        let (mut walker, mut follower) = (RingWalker::default(), RouteWalker::default());
        let (mut n_routes, mut n_faces) = (0, 0);
        for mesh in shapes::all().into_iter().map(|(_, mesh)| mesh).chain((0..100).map(random_mesh)) {
            let topology = Topology::new(&mesh, 1);
            for face in 0..topology.n_faces() as u32 {
                let (first, n) = topology.face_corners(face);
                for first in first..first + n {
                    let ring = walker.extract(&topology, first, false);
                    let route = route(&ring.mesh);
                    n_faces += 1;
                    if !route.is_empty() {
                        n_routes += 1;
                        assert_eq!(follower.follow(&topology, first, &route), ring.sources);
                    }
                }
            }
        }
        assert!(2 * n_routes > n_faces, "{n_routes} of {n_faces} rings have routes");
    }
}
