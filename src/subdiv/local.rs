//! A small half-edge mesh: the **ring** of one target face, cut out of a larger mesh, and its refinement.
//!
//! Face 0 is the target and half-edge 0 its first corner. Only the target's corners know all their faces (up to
//! infinitely sharp edges, which nothing crosses); that is enough to refine the target and the rings of its quarters.

use crate::topology::{Fan, HalfEdges, NONE, Topology, VertexTags, fan};
use rustc_hash::FxHashMap;

/// The ring of a target face.
#[derive(Clone, Debug, Default)]
pub struct LocalMesh {
    /// First half-edge of each face, then the total.
    pub face_start: Vec<u32>,
    /// Start vertex of each half-edge.
    pub vertex: Vec<u32>,
    /// Face of each half-edge.
    pub face: Vec<u32>,
    /// Twin of each half-edge, or [`NONE`] at the ring's outer border and at cuts.
    pub twin: Vec<u32>,
    /// Sharpness of each half-edge's edge; 0 where no corner of the target is at either end.
    pub sharpness: Vec<f32>,
    /// Tags per vertex; only those of the target's corners are complete, others are read for their semi-sharp edges.
    pub tags: Vec<VertexTags>,
    /// Corners of the target that are inner vertices of fins, with the ends of their two sharp edges. Such an end may be
    /// a vertex without any half-edge here.
    pub fins: Vec<(u32, [u32; 2])>,
}

/// A ring and where its vertices come from.
#[derive(Debug)]
pub struct Extracted {
    /// The ring.
    pub mesh: LocalMesh,
    /// Vertex of the source mesh for each local vertex.
    pub sources: Vec<u32>,
    /// Half-edge of the source mesh where each local face starts.
    pub starts: Vec<u32>,
}

impl HalfEdges for LocalMesh {
    fn vertex(&self, h: u32) -> u32 {
        self.vertex[h as usize]
    }

    fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    fn face(&self, h: u32) -> u32 {
        self.face[h as usize]
    }

    fn face_corners(&self, face: u32) -> (u32, u32) {
        let start = self.face_start[face as usize];
        (start, self.face_start[face as usize + 1] - start)
    }

    fn edge_sharpness(&self, h: u32) -> f32 {
        if self.twin[h as usize] == NONE { f32::INFINITY } else { self.sharpness[h as usize] }
    }

    fn vertex_tags(&self, h: u32) -> VertexTags {
        self.tags[self.vertex[h as usize] as usize].clone()
    }

    fn crease_ends(&self, h: u32) -> Option<[u32; 2]> {
        let v = self.vertex[h as usize];
        self.fins.iter().find(|fin| fin.0 == v).map(|fin| fin.1)
    }
}

impl LocalMesh {
    /// Number of faces.
    pub fn n_faces(&self) -> usize {
        self.face_start.len() - 1
    }

    /// Number of half-edges.
    pub fn n_half_edges(&self) -> usize {
        self.vertex.len()
    }

    /// Number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.tags.len()
    }

    /// Number of the target's corners.
    pub fn n_corners(&self) -> u32 {
        self.face_start[1]
    }

    /// Whether all faces are quads.
    pub fn all_quads(&self) -> bool {
        self.face_start.windows(2).all(|w| w[1] - w[0] == 4)
    }

    /// The tags of the vertex where `h` starts.
    pub fn tags_at(&self, h: u32) -> &VertexTags {
        &self.tags[self.vertex[h as usize] as usize]
    }

    /// The faces around corner `h` of the target, up to infinitely sharp edges that bound its sector.
    pub fn fan(&self, h: u32) -> Fan {
        let cut = self.tags_at(h).n_infinite >= 2;
        fan(self, h, |e| is_border(self, e, cut))
    }

    /// The edges of a fan, counter-clockwise: a half-edge of each and the vertex at its other end. An open fan has one
    /// more edge than faces, the last of which arrives at the vertex.
    pub fn fan_edges(&self, fan: &Fan) -> Vec<(u32, u32)> {
        let mut edges: Vec<_> = fan.spokes.iter().map(|&h| (h, self.vertex(self.next(h)))).collect();
        if !fan.closed {
            let arriving = self.prev(*fan.spokes.last().expect("a fan has a spoke"));
            edges.push((arriving, self.vertex(arriving)));
        }
        edges
    }

    /// Everything that decides the plan, as words to hash and compare.
    pub fn key(&self) -> Vec<u32> {
        let mut key = Vec::with_capacity(3 * self.n_half_edges() + 16);
        key.push(self.n_faces() as u32);
        key.extend_from_slice(&self.face_start);
        key.extend_from_slice(&self.vertex);
        key.extend_from_slice(&self.twin);
        key.extend(
            self.sharpness.iter().enumerate().filter(|(_, s)| **s > 0.0).flat_map(|(h, s)| [h as u32, s.to_bits()]),
        );
        key.extend(self.fins.iter().flat_map(|&(v, [a, b])| [u32::MAX - 1, v, a, b]));
        for (v, tags) in self.tags.iter().enumerate() {
            if *tags != VertexTags::default() {
                key.extend([u32::MAX, v as u32, tags.sharpness.to_bits(), tags.n_infinite]);
                key.extend(tags.semi_sharp.iter().map(|s| s.to_bits()));
            }
        }
        key
    }
}

fn is_border<M: HalfEdges + ?Sized>(mesh: &M, h: u32, cut: bool) -> bool {
    mesh.twin(h) == NONE || (cut && mesh.edge_sharpness(h) == f32::INFINITY)
}

/// Cuts the ring of the face of `first` out of `mesh`; local half-edge 0 is `first`.
///
/// `outer_tags`: whether vertices that are not corners of the target keep their semi-sharp edges (chaikin needs them).
pub fn extract<M: HalfEdges + ?Sized>(mesh: &M, first: u32, outer_tags: bool) -> Extracted {
    let mut x = Extractor { source: mesh, starts: Vec::new(), place_of_face: FxHashMap::default() };
    x.add_face(first);
    let n_corners = mesh.face_corners(mesh.face(first)).1;
    let mut h = first;
    let mut corner_tags = Vec::with_capacity(n_corners as usize);
    for _ in 0..n_corners {
        let tags = mesh.vertex_tags(h);
        let cut = tags.n_infinite >= 2;
        let fan = fan(mesh, h, |e| is_border(mesh, e, cut));
        // Counter-clockwise from the target, then what lies clockwise of it: an order that only topology decides.
        let at = fan.spokes.iter().position(|&s| s == h).expect("the fan holds its own spoke");
        fan.spokes[at..].iter().chain(fan.spokes[..at].iter().rev()).for_each(|&s| x.add_face(s));
        corner_tags.push(tags);
        h = mesh.next(h);
    }
    x.finish(&corner_tags, outer_tags)
}

/// Rings with more faces or corners than these are found by [`extract`], whose time does not grow with the square of
/// their size.
const MAX_SCANNED_FACES: usize = 64;
const MAX_SCANNED_CORNERS: u32 = 512;

/// Finds the vertices of rings without making the ring: what loading a patch needs, again and again.
#[derive(Debug, Default)]
pub struct RingWalker {
    /// Half-edge where each face of the ring starts.
    starts: Vec<u32>,
    faces: Vec<u32>,
    vertices: Vec<u32>,
}

impl RingWalker {
    /// The sources that [`extract`] gives for the face of `first`.
    pub fn sources(&mut self, topology: &Topology, first: u32, outer_tags: bool) -> &[u32] {
        self.starts.clear();
        self.faces.clear();
        self.vertices.clear();
        self.add_face(topology, first);
        let n_corners = topology.face_corners(topology.face(first)).1;
        let mut h = first;
        for _ in 0..n_corners {
            self.add_fan(topology, h);
            h = topology.next(h);
            if self.faces.len() > MAX_SCANNED_FACES {
                self.vertices = extract(topology, first, outer_tags).sources;
                return &self.vertices;
            }
        }
        if self.n_corners(topology) > MAX_SCANNED_CORNERS {
            self.vertices = extract(topology, first, outer_tags).sources;
            return &self.vertices;
        }
        self.add_vertices(topology);
        for _ in 0..n_corners {
            if let Some(ends) = topology.crease_ends(h) {
                ends.into_iter().for_each(|v| self.add_vertex(v));
            }
            h = topology.next(h);
        }
        &self.vertices
    }

    fn n_corners(&self, topology: &Topology) -> u32 {
        self.faces.iter().map(|&face| topology.face_corners(face).1).sum()
    }

    fn add_face(&mut self, topology: &Topology, h: u32) {
        let face = topology.face(h);
        if !self.faces.contains(&face) {
            self.faces.push(face);
            self.starts.push(h);
        }
    }

    /// The faces around a corner in [`extract`]'s order: counter-clockwise, then what lies clockwise.
    fn add_fan(&mut self, topology: &Topology, h: u32) {
        let cut = topology.is_tagged(topology.vertex(h)) && topology.vertex_tags(h).n_infinite >= 2;
        let mut spoke = h;
        loop {
            let arriving = topology.prev(spoke);
            if is_border(topology, arriving, cut) {
                break;
            }
            spoke = topology.twin(arriving);
            if spoke == h {
                return;
            }
            self.add_face(topology, spoke);
        }
        spoke = h;
        while !is_border(topology, spoke, cut) {
            spoke = topology.next(topology.twin(spoke));
            self.add_face(topology, spoke);
        }
    }

    fn add_vertices(&mut self, topology: &Topology) {
        for i in 0..self.starts.len() {
            let start = self.starts[i];
            let mut h = start;
            loop {
                self.add_vertex(topology.vertex(h));
                h = topology.next(h);
                if h == start {
                    break;
                }
            }
        }
    }

    fn add_vertex(&mut self, v: u32) {
        if !self.vertices.contains(&v) {
            self.vertices.push(v);
        }
    }
}

/// As [`extract`], with all faces at the target's corners, whatever sharp or non-manifold edges lie between: edits can reach
/// across those. `spokes` lists the half-edges that start at a vertex. Faces but the target start as they do in `mesh`, so
/// that of a face's passages of an edge the first stays the first.
pub fn extract_whole<M: HalfEdges + ?Sized>(
    mesh: &M,
    first: u32,
    outer_tags: bool,
    spokes: impl Fn(u32) -> Vec<u32>,
) -> Extracted {
    let mut x = Extractor { source: mesh, starts: Vec::new(), place_of_face: FxHashMap::default() };
    x.add_face(first);
    let (start, n_corners) = mesh.face_corners(mesh.face(first));
    let corners: Vec<u32> = (0..n_corners).map(|k| start + (first - start + k) % n_corners).collect();
    let touching = corners.iter().flat_map(|&h| spokes(mesh.vertex(h))).map(|spoke| mesh.face(spoke));
    touching.for_each(|face| x.add_face(mesh.face_corners(face).0));
    let corner_tags: Vec<VertexTags> = corners.iter().map(|&h| mesh.vertex_tags(h)).collect();
    x.finish(&corner_tags, outer_tags)
}

struct Extractor<'a, M: ?Sized> {
    source: &'a M,
    /// Half-edge of the source where each local face starts.
    starts: Vec<u32>,
    place_of_face: FxHashMap<u32, u32>,
}

impl<M: HalfEdges + ?Sized> Extractor<'_, M> {
    fn add_face(&mut self, h: u32) {
        let place = self.starts.len() as u32;
        let face = self.source.face(h);
        if *self.place_of_face.entry(face).or_insert(place) == place {
            self.starts.push(h);
        }
    }

    fn finish(self, corner_tags: &[VertexTags], outer_tags: bool) -> Extracted {
        let mut mesh = LocalMesh { face_start: vec![0], ..Default::default() };
        let mut half_edges = Vec::new();
        let mut sources: Vec<u32> = Vec::new();
        let mut local_vertex = FxHashMap::default();
        for (place, &start) in self.starts.iter().enumerate() {
            let mut h = start;
            loop {
                let v = self.source.vertex(h);
                mesh.vertex.push(*local_vertex.entry(v).or_insert_with(|| {
                    sources.push(v);
                    sources.len() as u32 - 1
                }));
                mesh.face.push(place as u32);
                half_edges.push(h);
                h = self.source.next(h);
                if h == start {
                    break;
                }
            }
            mesh.face_start.push(half_edges.len() as u32);
        }
        for (k, &corner) in half_edges[..corner_tags.len()].iter().enumerate() {
            if let Some(ends) = self.source.crease_ends(corner) {
                let local = ends.map(|v| {
                    *local_vertex.entry(v).or_insert_with(|| {
                        sources.push(v);
                        sources.len() as u32 - 1
                    })
                });
                mesh.fins.push((mesh.vertex[k], local));
            }
        }
        mesh.twin = half_edges.iter().map(|&h| self.local(&mesh, self.source.twin(h))).collect();
        self.set_tags(&mut mesh, &half_edges, sources.len(), corner_tags, outer_tags);
        Extracted { mesh, sources, starts: self.starts }
    }

    /// The local number of a half-edge of the source, or [`NONE`].
    fn local(&self, mesh: &LocalMesh, h: u32) -> u32 {
        if h == NONE {
            return NONE;
        }
        let face = self.source.face(h);
        let Some(&place) = self.place_of_face.get(&face) else { return NONE };
        let (start, n) = self.source.face_corners(face);
        let turned = (h - start + n - (self.starts[place as usize] - start)) % n;
        mesh.face_start[place as usize] + turned
    }

    fn set_tags(&self, mesh: &mut LocalMesh, half_edges: &[u32], n: usize, corner_tags: &[VertexTags], outer: bool) {
        mesh.tags = vec![VertexTags::default(); n];
        if outer {
            for (&v, &h) in mesh.vertex.iter().zip(half_edges) {
                mesh.tags[v as usize].semi_sharp = self.source.vertex_tags(h).semi_sharp;
            }
        }
        let mut is_corner = vec![false; n];
        for (k, tags) in corner_tags.iter().enumerate() {
            let v = mesh.vertex[k] as usize;
            is_corner[v] = true;
            mesh.tags[v] = tags.clone();
        }
        mesh.sharpness = (0..half_edges.len())
            .map(|i| {
                let ends = [mesh.vertex[i], mesh.vertex[mesh.next(i as u32) as usize]];
                let known = ends.iter().any(|&v| is_corner[v as usize]);
                if known && mesh.twin[i] != NONE { self.source.edge_sharpness(half_edges[i]) } else { 0.0 }
            })
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes;

    #[test]
    fn walked_rings_are_the_extracted_ones() {
        let shapes = shapes::all().into_iter().map(|(_, mesh)| mesh);
        let mut walker = RingWalker::default();
        for mesh in shapes.chain((0..100).map(random_mesh)) {
            let topology = Topology::new(&mesh, 1);
            for face in 0..topology.n_faces() as u32 {
                let first = topology.face_corners(face).0;
                for outer_tags in [false, true] {
                    let extracted = extract(&topology, first, outer_tags).sources;
                    assert_eq!(walker.sources(&topology, first, outer_tags), extracted);
                }
            }
        }
    }
}
