//! Finding twins, and the decisions made once on the control mesh.

use super::face_index::FaceIndex;
use super::half_edges::{HalfEdges, NONE, VertexTags, fan, fan_size};
use super::pairs::{HalfEdgesByVertex, ends};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{BoundaryRule, ControlMesh, CreaseMethod, Edit, EditKind, TriangleRule};
use crate::parallel::for_ranges;
use parking_lot::Mutex;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::atomic::{AtomicU32, Ordering};

/// Sharpness at and above which an edge or vertex is infinitely sharp (OpenSubdiv `Sdc::Crease::SHARPNESS_INFINITE`).
const INFINITE_SHARPNESS: f32 = 10.0;

/// Half-edges of a control mesh and the tags on them.
#[derive(Debug)]
pub struct Topology {
    faces: FaceIndex,
    vertex: Vec<VertexId>,
    twin: Vec<u32>,
    n_vertices: usize,
    /// A bit per vertex: whether any tag or non-manifold spot touches it.
    tagged: Vec<u64>,
    /// Sharpness of tagged edges with a twin, by the smaller half-edge.
    edge_sharpness: FxHashMap<u32, f32>,
    /// Sharpness of tagged vertices.
    vertex_sharpness: FxHashMap<u32, f32>,
    /// Vertices whose faces do not form one fan or ring: their tags cannot be found by walking around them.
    nonmanifold_tags: FxHashMap<u32, VertexTags>,
    /// Ends of the two non-manifold edges of inner vertices of fins, which are crease vertices.
    fin_ends: FxHashMap<u32, [u32; 2]>,
    /// For half-edges of non-manifold edges: the smallest half-edge between the same vertices.
    pub(super) nonmanifold_edge_owner: FxHashMap<u32, u32>,
    /// For non-manifold vertices: the smallest half-edge that starts there.
    nonmanifold_vertex_owner: FxHashMap<u32, u32>,
    /// A bit per face without surface, if there is any.
    hidden: Option<Vec<u64>>,
    /// A bit per face that [`touches_polygon`](Self::touches_polygon) with any of its edges; none if all are quads.
    beside_polygon: Vec<u64>,
    /// How sharpness decays.
    pub crease_method: CreaseMethod,
    /// Edge weights beside triangles.
    pub triangles: TriangleRule,
    /// Crease tags on vertex pairs that are no edge: they do nothing.
    idle_creases: usize,
}

/// Counts for reports.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct MeshCounts {
    /// Edges with one face.
    pub boundary_edges: usize,
    /// Vertex pairs joined by non-manifold edges.
    pub nonmanifold_edges: usize,
    /// Vertices that are non-manifold.
    pub nonmanifold_vertices: usize,
    /// Faces without surface.
    pub hidden_faces: usize,
    /// Edges with a crease tag and two faces.
    pub creased_edges: usize,
    /// Crease tags on vertex pairs that are no edge: they do nothing.
    pub idle_creases: usize,
}

fn get_bit(bits: &[u64], i: u32) -> bool {
    (bits[i as usize / 64] >> (i % 64)) & 1 == 1
}

fn set_bit(bits: &mut [u64], i: u32) {
    bits[i as usize / 64] |= 1 << (i % 64);
}

fn clamp_sharpness(s: f32) -> f32 {
    if s >= INFINITE_SHARPNESS { f32::INFINITY } else { s.max(0.0) }
}

impl Topology {
    /// Half-edges and tags of a valid mesh, found on `n_threads` threads.
    pub fn new(mesh: &ControlMesh, n_threads: usize) -> Self {
        let n_vertices = mesh.positions.len();
        let mut topology = Topology {
            faces: FaceIndex::new(&mesh.face_sizes),
            vertex: mesh.face_vertices.clone(),
            twin: Vec::new(),
            n_vertices,
            tagged: vec![0; n_vertices / 64 + 1],
            edge_sharpness: FxHashMap::default(),
            vertex_sharpness: FxHashMap::default(),
            nonmanifold_tags: FxHashMap::default(),
            fin_ends: FxHashMap::default(),
            nonmanifold_edge_owner: FxHashMap::default(),
            nonmanifold_vertex_owner: FxHashMap::default(),
            hidden: None,
            beside_polygon: Vec::new(),
            crease_method: mesh.crease_method,
            triangles: mesh.triangles,
            idle_creases: 0,
        };
        let by_vertex = HalfEdgesByVertex::new(&topology, n_threads);
        let (twin, tangles) = by_vertex.pair(&topology, n_threads);
        topology.twin = twin;
        let mut nonmanifold = Vec::new();
        tangles.iter().for_each(|tangle| topology.add_nonmanifold(tangle, &mut nonmanifold));
        let infinite = topology.tag_edges(mesh, &by_vertex);
        drop(by_vertex);
        if mesh.edits.iter().any(Edit::is_refined) {
            topology.separate_passages();
        }
        topology.beside_polygon = topology.faces_beside_polygons();
        topology.edit_edges(mesh);
        topology.tag_vertices(mesh, &nonmanifold, n_threads);
        topology.edit_vertices(mesh);
        topology.hide_faces(mesh, &infinite, &nonmanifold);
        if topology.hidden.is_some() && !topology.nonmanifold_vertex_owner.is_empty() {
            topology.let_visible_faces_own();
        }
        topology
    }

    /// Splits the half-edges between one pair of vertices into edges: the first holds each face's first passage; every
    /// further passage of a face, and every edge from a vertex to itself, is an edge of its own.
    fn add_nonmanifold(&mut self, group: &[(u32, u32)], nonmanifold: &mut Vec<NonmanifoldEdge>) {
        let owner = group[0].1;
        let ends = [self.vertex[owner as usize].0, self.vertex[HalfEdges::next(self, owner) as usize].0];
        let is_loop = ends[0] == ends[1];
        let mut shared = NonmanifoldEdge { ends, n_faces: 0, takes_tags: true };
        let mut last_face = NONE;
        for (i, &(_, h)) in group.iter().enumerate() {
            self.nonmanifold_edge_owner.insert(h, owner);
            let face = self.faces.face(h);
            if is_loop || face == last_face {
                nonmanifold.push(NonmanifoldEdge { ends, n_faces: 1, takes_tags: is_loop && i == 0 });
            } else {
                shared.n_faces += 1;
            }
            last_face = face;
        }
        if shared.n_faces > 0 {
            nonmanifold.push(shared);
        }
    }

    /// Applies crease tags; returns the vertex pairs that a tag made infinitely sharp.
    fn tag_edges(&mut self, mesh: &ControlMesh, by_vertex: &HalfEdgesByVertex) -> FxHashSet<[u32; 2]> {
        let mut infinite = FxHashSet::default();
        for crease in &mesh.creases {
            let [a, b] = [crease.edge[0].0.min(crease.edge[1].0), crease.edge[0].0.max(crease.edge[1].0)];
            let sharpness = clamp_sharpness(crease.sharpness);
            if sharpness == f32::INFINITY {
                infinite.insert([a, b]);
            } else {
                infinite.remove(&[a, b]);
            }
            let at_ends = by_vertex.lower(a).iter().filter(|&&h| ends(self, h).1 == b);
            self.idle_creases += usize::from(at_ends.count() == 0);
            for &h in by_vertex.lower(a) {
                if ends(self, h).1 == b && self.twin[h as usize] != NONE {
                    self.edge_sharpness.insert(h.min(self.twin[h as usize]), sharpness);
                    set_bit(&mut self.tagged, a);
                    set_bit(&mut self.tagged, b);
                }
            }
        }
        self.edge_sharpness.retain(|_, s| *s > 0.0);
        infinite
    }

    fn tag_vertices(&mut self, mesh: &ControlMesh, nonmanifold: &[NonmanifoldEdge], n_threads: usize) {
        for corner in &mesh.corners {
            self.set_vertex_sharpness(corner.vertex.0, clamp_sharpness(corner.sharpness));
        }
        let mut edges_at: FxHashMap<u32, Vec<NonmanifoldEdge>> = FxHashMap::default();
        for edge in nonmanifold {
            edges_at.entry(edge.ends[0]).or_default().push(*edge);
            if edge.ends[0] != edge.ends[1] {
                edges_at.entry(edge.ends[1]).or_default().push(*edge);
            }
        }
        let mut outgoing = self.spokes_of_nonmanifold_vertices(mesh, &edges_at, n_threads);
        for (v, spokes) in outgoing.drain() {
            self.tag_nonmanifold_vertex(v, &spokes, edges_at.get(&v).map_or(&[], Vec::as_slice));
        }
    }

    /// The vertices whose faces do not form one fan or ring, each with the half-edges that start there. On the way,
    /// boundary rule 1 makes vertices of a single face sharp.
    fn spokes_of_nonmanifold_vertices(
        &mut self,
        mesh: &ControlMesh,
        edges_at: &FxHashMap<u32, Vec<NonmanifoldEdge>>,
        n_threads: usize,
    ) -> FxHashMap<u32, Vec<u32>> {
        let (corners, torn) = self.vertices_of_one_face_and_torn(edges_at, n_threads);
        if mesh.boundary == BoundaryRule::EdgeAndCorner {
            corners.into_iter().for_each(|v| self.set_vertex_sharpness(v, f32::INFINITY));
        }
        let mut spokes: FxHashMap<u32, Vec<u32>> = edges_at.keys().map(|&v| (v, Vec::new())).collect();
        spokes.extend(torn.into_iter().map(|v| (v, Vec::new())));
        if !spokes.is_empty() {
            for h in 0..self.vertex.len() as u32 {
                if let Some(list) = spokes.get_mut(&self.vertex[h as usize].0) {
                    list.push(h);
                }
            }
        }
        spokes
    }

    /// The vertices of a single face, and those whose faces do not form one fan or ring, `edges_at` aside.
    fn vertices_of_one_face_and_torn(
        &self,
        edges_at: &FxHashMap<u32, Vec<NonmanifoldEdge>>,
        n_threads: usize,
    ) -> (Vec<u32>, Vec<u32>) {
        let n_corners: Vec<AtomicU32> = (0..self.n_vertices).map(|_| AtomicU32::new(0)).collect();
        for_ranges(self.vertex.len(), n_threads, |range| {
            for v in &self.vertex[range] {
                n_corners[v.idx()].fetch_add(1, Ordering::Relaxed);
            }
        });
        let found = Mutex::new((Vec::new(), Vec::new()));
        for_ranges(self.vertex.len(), n_threads, |range| {
            for h in range {
                let v = self.vertex[h];
                // Whoever comes first looks at the vertex, from whichever half-edge: the answer is the same.
                let n = n_corners[v.idx()].swap(0, Ordering::Relaxed);
                if n == 0 || edges_at.contains_key(&v.0) {
                    continue;
                }
                match fan_size(self, h as u32, |e| self.twin[e as usize] == NONE) {
                    (1, false) if n == 1 => found.lock().0.push(v.0),
                    (size, _) if size != n as usize => found.lock().1.push(v.0),
                    _ => {}
                }
            }
        });
        found.into_inner()
    }

    fn set_vertex_sharpness(&mut self, v: u32, sharpness: f32) {
        set_bit(&mut self.tagged, v);
        self.vertex_sharpness.insert(v, sharpness);
    }

    pub(super) fn edit_vertex_sharpness(&mut self, v: u32, sharpness: f32) {
        self.set_vertex_sharpness(v, sharpness);
        if let Some(tags) = self.nonmanifold_tags.get_mut(&v) {
            tags.sharpness = sharpness;
        }
    }

    /// For edges with a twin.
    pub(super) fn set_edge_sharpness(&mut self, h: u32, sharpness: f32) {
        let twin = self.twin[h as usize];
        for end in [h, twin] {
            set_bit(&mut self.tagged, self.vertex[end as usize].0);
        }
        if sharpness > 0.0 {
            self.edge_sharpness.insert(h.min(twin), sharpness);
        } else {
            self.edge_sharpness.remove(&h.min(twin));
        }
    }

    /// Infinitely sharp, unless the vertex is an inner vertex of a fin: exactly two non-manifold edges, no boundary
    /// edge, more faces than edges.
    fn tag_nonmanifold_vertex(&mut self, v: u32, outgoing: &[u32], nonmanifold: &[NonmanifoldEdge]) {
        let mut tags = VertexTags { n_infinite: nonmanifold.len() as u32, ..Default::default() };
        let mut n_boundary = nonmanifold.iter().filter(|e| e.n_faces < 2).count();
        let mut n_edges = nonmanifold.len();
        for &spoke in outgoing {
            for h in [spoke, HalfEdges::prev(self, spoke)] {
                let twin = self.twin[h as usize];
                if twin == NONE && !self.nonmanifold_edge_owner.contains_key(&h) {
                    n_boundary += 1;
                    n_edges += 1;
                    tags.n_infinite += 1;
                } else if twin != NONE && h == spoke {
                    n_edges += 1;
                    match self.edge_sharpness.get(&h.min(twin)).copied().unwrap_or(0.0) {
                        f32::INFINITY => tags.n_infinite += 1,
                        s if s > 0.0 => tags.semi_sharp.push(s),
                        _ => {}
                    }
                }
            }
        }
        tags.semi_sharp.sort_by(f32::total_cmp);
        let is_fin = nonmanifold.len() == 2 && n_boundary == 0 && outgoing.len() > n_edges;
        if is_fin {
            self.fin_ends.insert(v, [0, 1].map(|k| nonmanifold[k].other_end(v)));
        } else {
            self.set_vertex_sharpness(v, f32::INFINITY);
        }
        set_bit(&mut self.tagged, v);
        tags.is_pinned = !is_fin;
        tags.sharpness = self.vertex_sharpness.get(&v).copied().unwrap_or(0.0);
        self.nonmanifold_tags.insert(v, tags);
        if let Some(&owner) = outgoing.iter().min() {
            self.nonmanifold_vertex_owner.insert(v, owner);
        }
    }

    fn hide_faces(&mut self, mesh: &ControlMesh, infinite: &FxHashSet<[u32; 2]>, nonmanifold: &[NonmanifoldEdge]) {
        let edited = mesh.edits.iter().filter(|e| e.kind == EditKind::Face && e.children().is_empty());
        let mut holes = mesh.holes.iter().copied().chain(edited.map(Edit::face)).peekable();
        if holes.peek().is_none() && mesh.boundary != BoundaryRule::None {
            return;
        }
        let mut hidden = vec![0u64; mesh.n_faces() / 64 + 1];
        for face in holes {
            set_bit(&mut hidden, face.0);
        }
        if mesh.boundary == BoundaryRule::None {
            let open = self.vertices_of_untagged_boundaries(infinite, nonmanifold);
            for (h, v) in self.vertex.iter().enumerate() {
                if get_bit(&open, v.0) {
                    set_bit(&mut hidden, self.faces.face(h as u32));
                }
            }
        }
        self.hidden = hidden.iter().any(|&w| w != 0).then_some(hidden);
    }

    /// A bit per vertex at an edge of one face that no tag made infinitely sharp.
    fn vertices_of_untagged_boundaries(
        &self,
        infinite: &FxHashSet<[u32; 2]>,
        nonmanifold: &[NonmanifoldEdge],
    ) -> Vec<u64> {
        let boundary = (0..self.twin.len() as u32)
            .filter(|&h| self.is_boundary(h))
            .map(|h| ([self.vertex[h as usize].0, self.vertex[HalfEdges::next(self, h) as usize].0], true));
        let passed_twice = nonmanifold.iter().filter(|e| e.n_faces == 1).map(|e| (e.ends, e.takes_tags));
        let mut open = vec![0u64; self.n_vertices / 64 + 1];
        for ([a, b], takes_tags) in boundary.chain(passed_twice) {
            if !takes_tags || !infinite.contains(&[a.min(b), a.max(b)]) {
                set_bit(&mut open, a);
                set_bit(&mut open, b);
            }
        }
        open
    }

    /// Whether the edge of `h` has one face and is otherwise sound.
    pub fn is_boundary(&self, h: u32) -> bool {
        self.twin[h as usize] == NONE && !self.nonmanifold_edge_owner.contains_key(&h)
    }

    /// Number of faces, hidden ones included.
    pub fn n_faces(&self) -> usize {
        self.faces.n_faces()
    }

    /// Number of half-edges.
    pub fn n_half_edges(&self) -> usize {
        self.vertex.len()
    }

    /// Number of vertices, bare ones included.
    pub fn n_vertices(&self) -> usize {
        self.n_vertices
    }

    /// Whether all faces are quads.
    pub fn all_quads(&self) -> bool {
        matches!(self.faces, FaceIndex::Quads { .. })
    }

    /// Whether the face has no surface.
    pub fn is_hidden(&self, face: FaceId) -> bool {
        self.hidden.as_ref().is_some_and(|bits| get_bit(bits, face.0))
    }

    /// Whether anything but plain smooth rules may apply at `v`, boundaries aside.
    #[inline]
    pub fn is_tagged(&self, v: u32) -> bool {
        get_bit(&self.tagged, v)
    }

    /// The half-edge in whose name points of this edge are computed when neighbours must agree to the bit: the smallest
    /// one along the edge whose face has a surface.
    pub fn edge_owner(&self, h: u32) -> u32 {
        let visible = |h: u32| !self.is_hidden(FaceId(self.faces.face(h)));
        let twin = self.twin[h as usize];
        if twin != NONE {
            return if visible(twin) { h.min(twin) } else { h };
        }
        match self.nonmanifold_edge_owner.get(&h) {
            Some(&owner) if visible(owner) => owner,
            _ => h,
        }
    }

    /// Non-manifold edges and vertices that a hidden face speaks for get another owner: alone, each sheet would round
    /// for itself.
    fn let_visible_faces_own(&mut self) {
        let mut smallest: FxHashMap<u32, u32> = FxHashMap::default();
        for (&h, &owner) in self.nonmanifold_edge_owner.iter().filter(|(h, _)| !self.is_hidden(FaceId(self.face(**h))))
        {
            let known = smallest.entry(owner).or_insert(h);
            *known = h.min(*known);
        }
        for owner in self.nonmanifold_edge_owner.values_mut() {
            *owner = smallest.get(owner).copied().unwrap_or(*owner);
        }
        for h in 0..self.n_half_edges() as u32 {
            let v = HalfEdges::vertex(self, h);
            let Some(&owner) = self.nonmanifold_vertex_owner.get(&v) else { continue };
            let is_hidden = |h: u32| self.is_hidden(FaceId(self.face(h)));
            if is_hidden(owner) && !is_hidden(h) {
                self.nonmanifold_vertex_owner.insert(v, h);
            }
        }
    }

    /// One number for all half-edges of an edge, seen or hidden, non-manifold or not.
    pub fn edge_id(&self, h: u32) -> u32 {
        match self.twin[h as usize] {
            NONE => self.nonmanifold_edge_owner.get(&h).copied().unwrap_or(h),
            twin => h.min(twin),
        }
    }

    /// The half-edge in whose name the limit of the vertex at the start of `h` is computed.
    pub fn vertex_owner(&self, h: u32) -> u32 {
        let visible = |h: &u32| !self.is_hidden(FaceId(self.faces.face(*h)));
        if let Some(&owner) = self.nonmanifold_vertex_owner.get(&self.vertex[h as usize].0) {
            return if visible(&owner) { owner } else { h };
        }
        let fan = fan(self, h, |h| self.twin[h as usize] == NONE);
        fan.spokes.into_iter().filter(visible).min().unwrap_or(h)
    }

    fn faces_beside_polygons(&self) -> Vec<u64> {
        if self.all_quads() {
            return Vec::new();
        }
        let mut bits = vec![0; self.n_faces() / 64 + 1];
        self.nonmanifold_edge_owner.keys().for_each(|&h| set_bit(&mut bits, self.faces.face(h)));
        for face in 0..self.n_faces() as u32 {
            let (first, n) = self.faces.corners(face);
            if n != 4 {
                set_bit(&mut bits, face);
                let twins = self.twin[first as usize..][..n as usize].iter().filter(|&&twin| twin != NONE);
                twins.for_each(|&twin| set_bit(&mut bits, self.faces.face(twin)));
            }
        }
        bits
    }

    /// Whether the face is a quad of which no edge [`touches_polygon`](Self::touches_polygon).
    #[inline]
    pub fn is_among_quads(&self, face: FaceId) -> bool {
        self.all_quads() || !get_bit(&self.beside_polygon, face.0)
    }

    /// Whether a face that is no quad lies along the edge of `h`, on either side, or may do so: where more than two
    /// faces meet.
    pub fn touches_polygon(&self, h: u32) -> bool {
        let is_polygon = |h: u32| self.faces.corners_at(h).1 != 4;
        let twin = self.twin[h as usize];
        if self.all_quads() {
            return false;
        }
        is_polygon(h) || (twin != NONE && is_polygon(twin)) || self.nonmanifold_edge_owner.contains_key(&h)
    }

    /// Crease tags on vertex pairs that are no edge.
    pub fn idle_creases(&self) -> usize {
        self.idle_creases
    }

    /// Counts for reports.
    pub fn counts(&self) -> MeshCounts {
        let hidden = self.hidden.as_ref().map_or(0, |bits| bits.iter().map(|w| w.count_ones() as usize).sum());
        let owners: FxHashSet<u32> = self.nonmanifold_edge_owner.values().copied().collect();
        MeshCounts {
            boundary_edges: (0..self.twin.len() as u32).filter(|&h| self.is_boundary(h)).count(),
            nonmanifold_edges: owners.len(),
            nonmanifold_vertices: self.nonmanifold_tags.len(),
            hidden_faces: hidden,
            creased_edges: self.edge_sharpness.len(),
            idle_creases: self.idle_creases,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let maps = 8 * (self.edge_sharpness.capacity() + self.vertex_sharpness.capacity())
            + 8 * (self.nonmanifold_edge_owner.capacity() + self.nonmanifold_vertex_owner.capacity())
            + 48 * self.nonmanifold_tags.capacity();
        let hidden = self.hidden.as_ref().map_or(0, Vec::len);
        let bits = 8 * (self.tagged.len() + self.beside_polygon.len() + hidden);
        self.faces.bytes() + 4 * (self.vertex.len() + self.twin.len()) + bits + maps
    }

    /// Tags of a vertex whose faces form one fan or ring, found by walking around it.
    fn walk_tags(&self, h: u32) -> VertexTags {
        let v = self.vertex[h as usize].0;
        if !self.is_tagged(v) {
            let (_, closed) = fan_size(self, h, |e| self.twin[e as usize] == NONE);
            return VertexTags { n_infinite: if closed { 0 } else { 2 }, ..Default::default() };
        }
        let fan = fan(self, h, |h| self.twin[h as usize] == NONE);
        let mut tags = VertexTags {
            sharpness: self.vertex_sharpness.get(&v).copied().unwrap_or(0.0),
            n_infinite: if fan.closed { 0 } else { 2 },
            ..Default::default()
        };
        for &spoke in fan.spokes.iter().filter(|&&h| self.twin[h as usize] != NONE) {
            match self.edge_sharpness(spoke) {
                f32::INFINITY => tags.n_infinite += 1,
                s if s > 0.0 => tags.semi_sharp.push(s),
                _ => {}
            }
        }
        tags.semi_sharp.sort_by(f32::total_cmp);
        tags
    }
}

impl HalfEdges for Topology {
    #[inline]
    fn vertex(&self, h: u32) -> u32 {
        self.vertex[h as usize].0
    }

    #[inline]
    fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    #[inline]
    fn face(&self, h: u32) -> u32 {
        self.faces.face(h)
    }

    #[inline]
    fn face_corners(&self, face: u32) -> (u32, u32) {
        self.faces.corners(face)
    }

    #[inline]
    fn corners_at(&self, h: u32) -> (u32, u32) {
        self.faces.corners_at(h)
    }

    #[inline]
    fn next(&self, h: u32) -> u32 {
        self.faces.next(h)
    }

    #[inline]
    fn prev(&self, h: u32) -> u32 {
        self.faces.prev(h)
    }

    #[inline]
    fn edge_sharpness(&self, h: u32) -> f32 {
        let twin = self.twin[h as usize];
        if twin == NONE {
            f32::INFINITY
        } else if !self.is_tagged(self.vertex[h as usize].0) {
            0.0
        } else {
            self.edge_sharpness.get(&h.min(twin)).copied().unwrap_or(0.0)
        }
    }

    fn vertex_tags(&self, h: u32) -> VertexTags {
        match self.nonmanifold_tags.get(&self.vertex[h as usize].0) {
            Some(tags) => tags.clone(),
            None => self.walk_tags(h),
        }
    }

    #[inline]
    fn is_plain(&self, h: u32) -> bool {
        !self.is_tagged(self.vertex[h as usize].0)
    }

    fn n_infinite(&self, h: u32) -> u32 {
        if let Some(tags) = self.nonmanifold_tags.get(&self.vertex[h as usize].0) {
            return tags.n_infinite;
        }
        let mut n = 0;
        let mut count = |e: u32| n += u32::from(HalfEdges::edge_sharpness(self, e) == f32::INFINITY);
        let mut spoke = h;
        loop {
            count(spoke);
            let arriving = self.faces.prev(spoke);
            spoke = self.twin[arriving as usize];
            if spoke == h {
                return n;
            }
            if spoke == NONE {
                count(arriving);
                break;
            }
        }
        spoke = h;
        while self.twin[spoke as usize] != NONE {
            spoke = self.faces.next(self.twin[spoke as usize]);
            count(spoke);
        }
        n
    }

    fn crease_ends(&self, h: u32) -> Option<[u32; 2]> {
        self.fin_ends.get(&self.vertex[h as usize].0).copied()
    }
}

#[derive(Clone, Copy, Debug)]
struct NonmanifoldEdge {
    ends: [u32; 2],
    n_faces: u32,
    /// Whether a tag on the two vertices means this edge: the first one between them.
    takes_tags: bool,
}

impl NonmanifoldEdge {
    fn other_end(&self, v: u32) -> u32 {
        if self.ends[0] == v { self.ends[1] } else { self.ends[0] }
    }
}
