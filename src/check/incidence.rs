//! Which faces meet at each edge and vertex, found from vertex numbers alone: a check must not believe what it checks.

use crate::ids::{FaceId, PatchId};
use crate::subdiv::{PatchRates, Surface};
use crate::topology::HalfEdges;

/// Half-edges of faces with a surface, in groups.
#[derive(Debug, Default)]
struct Groups {
    items: Vec<u32>,
    start: Vec<u32>,
}

impl Groups {
    fn by_key<K: Ord>(mut items: Vec<u32>, key: impl Fn(u32) -> K) -> Self {
        items.sort_by_key(|&h| key(h));
        let mut start: Vec<u32> = Vec::new();
        for (i, group) in items.windows(2).enumerate() {
            if key(group[0]) != key(group[1]) {
                start.push(i as u32 + 1);
            }
        }
        start.insert(0, 0);
        start.push(items.len() as u32);
        if items.is_empty() {
            start.clear();
        }
        Self { items, start }
    }

    fn len(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    fn get(&self, group: usize) -> &[u32] {
        &self.items[self.start[group] as usize..self.start[group + 1] as usize]
    }
}

/// Half-edges by edge and by vertex, and the polygons that are no quads; faces without surface left out.
#[derive(Debug)]
pub struct Incidence {
    edges: Groups,
    vertices: Groups,
    polygons: Vec<FaceId>,
    n_open: usize,
}

/// Border vertices `from..=to` of a side of a patch, out of the side's rate, counted along increasing u or v.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SideRun {
    pub patch: PatchId,
    pub side: usize,
    pub from: u32,
    pub to: u32,
}

/// A run as part of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EdgeRun {
    pub run: SideRun,
    /// The edge's point, counted from its smaller vertex, that is the run's first.
    pub first: u32,
    /// Whether the run goes towards the edge's smaller vertex.
    pub is_backward: bool,
}

impl Incidence {
    /// Sorts the half-edges of a surface.
    pub fn new(surface: &Surface) -> Self {
        let topology = surface.topology();
        let is_visible = |h: &u32| !topology.is_hidden(FaceId(topology.face(*h)));
        let half_edges: Vec<u32> = (0..topology.n_half_edges() as u32).filter(is_visible).collect();
        // Where a face passes an edge again, that is another edge, which an edit can move away from the first.
        let is_own = |h: u32| surface.edited().moves_points() && passes_again(surface, h);
        let is_edge = |h: &u32| ends(surface, *h)[0] != ends(surface, *h)[1] && !is_own(*h);
        let edges: Vec<u32> = half_edges.iter().copied().filter(is_edge).collect();
        let all = Groups::by_key(edges, |h| ends(surface, h));
        let shared = (0..all.len()).map(|e| all.get(e)).filter(|group| group.len() > 1);
        let n_open = (0..all.len()).filter(|&e| all.get(e).len() == 1).count();
        let faces = (0..topology.n_faces() as u32).map(FaceId);
        let is_polygon = |f: &FaceId| !topology.is_hidden(*f) && surface.face_size(*f) != 4;
        Self {
            edges: Groups::by_key(shared.flatten().copied().collect(), |h| ends(surface, h)),
            vertices: Groups::by_key(half_edges, |h| topology.vertex(h)),
            polygons: faces.filter(is_polygon).collect(),
            n_open,
        }
    }

    /// Number of edges with two faces or more.
    pub fn n_edges(&self) -> usize {
        self.edges.len()
    }

    /// Number of edges with one face.
    pub fn n_open(&self) -> usize {
        self.n_open
    }

    /// The half-edges along an edge, two or more.
    pub fn edge(&self, edge: usize) -> &[u32] {
        self.edges.get(edge)
    }

    /// Number of vertices that faces use.
    pub fn n_vertices(&self) -> usize {
        self.vertices.len()
    }

    /// The half-edges that start at a vertex, one or more.
    pub fn vertex(&self, vertex: usize) -> &[u32] {
        self.vertices.get(vertex)
    }

    /// Faces with a surface that are no quads.
    pub fn polygons(&self) -> &[FaceId] {
        &self.polygons
    }
}

/// The vertices of a half-edge, smaller first.
pub(super) fn ends(surface: &Surface, h: u32) -> [u32; 2] {
    let topology = surface.topology();
    let (a, b) = (topology.vertex(h), topology.vertex(topology.next(h)));
    [a.min(b), a.max(b)]
}

/// Whether the face of `h` has passed the edge of `h` before.
fn passes_again(surface: &Surface, h: u32) -> bool {
    let (first, _) = surface.face_corners(FaceId(surface.topology().face(h)));
    (first..h).any(|earlier| ends(surface, earlier) == ends(surface, h))
}

/// The rate of the whole edge of `h`.
pub(super) fn edge_rate(surface: &Surface, h: u32, rates: impl Fn(PatchId) -> PatchRates) -> u32 {
    let (face, k, n) = place(surface, h);
    if n == 4 {
        rates(surface.patch_of(face, 0)).sides[k as usize]
    } else {
        2 * rates(surface.patch_of(face, k)).sides[0]
    }
}

/// Points `a..=b` of an edge cut into `rate`, counted from its smaller vertex, as the patches of `h`'s face have them:
/// one run, or two in a polygon.
pub(super) fn edge_runs(surface: &Surface, h: u32, [a, b]: [u32; 2], rate: u32) -> Vec<EdgeRun> {
    let is_forward = surface.topology().vertex(h) == ends(surface, h)[0];
    let [a, b] = if is_forward { [a, b] } else { [rate - b, rate - a] };
    let (face, k, n) = place(surface, h);
    // A run over points a..=b of the half-edge, on a side that runs along it or against it.
    let run = |sub: u32, side: usize, is_along: bool, [a, b]: [u32; 2]| {
        let [from, to] = if is_along { [a, b] } else { [rate - b, rate - a] };
        let is_backward = is_along != is_forward;
        let first = if is_backward { rate - from } else { from };
        EdgeRun { run: SideRun { patch: surface.patch_of(face, sub), side, from, to }, first, is_backward }
    };
    if n == 4 {
        return vec![run(0, k as usize, k < 2, [a, b])];
    }
    let half = rate / 2;
    let before = (a <= half).then(|| run(k, 0, true, [a, b.min(half)]));
    let after = (b >= half).then(|| run((k + 1) % n, 3, false, [a.max(half), b]));
    before.into_iter().chain(after).collect()
}

/// The two sides of the line from the middle of a polygon's edge `k` to its centre.
pub(super) fn inner_sides(surface: &Surface, face: FaceId, k: u32) -> [(PatchId, usize); 2] {
    let n = surface.face_size(face);
    [(surface.patch_of(face, k), 1), (surface.patch_of(face, (k + 1) % n), 2)]
}

/// The face of a half-edge, its number in it, and the face's number of corners.
pub(super) fn place(surface: &Surface, h: u32) -> (FaceId, u32, u32) {
    let face = FaceId(surface.topology().face(h));
    let (first, n) = surface.face_corners(face);
    (face, h - first, n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn counts(mesh: &crate::mesh::ControlMesh) -> [usize; 4] {
        let incidence = Incidence::new(&Surface::new(mesh, 1).unwrap());
        [incidence.n_edges(), incidence.n_open(), incidence.n_vertices(), incidence.polygons().len()]
    }

    #[test]
    fn edges_and_vertices_are_those_of_the_mesh() {
        assert_eq!(counts(&shapes::cube()), [12, 0, 8, 0]);
        assert_eq!(counts(&shapes::prism(5)), [15, 0, 10, 2]);
        assert_eq!(counts(&shapes::fin()), [1, 9, 8, 0]);
        assert_eq!(counts(&shapes::n_gon(7)), [0, 7, 7, 1]);
    }
}
