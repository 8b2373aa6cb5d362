//! A small half-edge mesh: the **ring** of one target face, cut out of a larger mesh, and its refinement.
//!
//! Face 0 is the target and half-edge 0 its first corner. Only the target's corners know all their faces (up to
//! infinitely sharp edges, which nothing crosses); that is enough to refine the target and the rings of its quarters.

use crate::topology::{Fan, HalfEdges, NONE, VertexTags, fan, fan_size};

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
#[derive(Debug, Default)]
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

    /// Number of faces in the [`fan`](Self::fan) of a corner, and whether it is closed.
    pub fn fan_size(&self, h: u32) -> (usize, bool) {
        let cut = self.tags_at(h).n_infinite >= 2;
        fan_size(self, h, |e| is_border(self, e, cut))
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

    /// Everything that decides the plan, as words to hash and compare, in place of what was in `key`.
    pub fn key(&self, key: &mut Vec<u32>) {
        key.clear();
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
    }
}

fn is_border<M: HalfEdges + ?Sized>(mesh: &M, h: u32, cut: bool) -> bool {
    mesh.twin(h) == NONE || (cut && mesh.edge_sharpness(h) == f32::INFINITY)
}

/// Cuts the ring of the face of `first` out of `mesh`; local half-edge 0 is `first`.
///
/// `outer_tags`: whether vertices that are not corners of the target keep their semi-sharp edges (chaikin needs them).
pub fn extract<M: HalfEdges + ?Sized>(mesh: &M, first: u32, outer_tags: bool) -> Extracted {
    let mut walker = RingWalker::default();
    walker.extract(mesh, first, outer_tags);
    walker.ring
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
    let mut walker = RingWalker::default();
    walker.clear();
    walker.add_face(mesh, first);
    let (start, n_corners) = mesh.face_corners(mesh.face(first));
    let corners: Vec<u32> = (0..n_corners).map(|k| start + (first - start + k) % n_corners).collect();
    let touching = corners.iter().flat_map(|&h| spokes(mesh.vertex(h))).map(|spoke| mesh.face(spoke));
    touching.for_each(|face| walker.add_face(mesh, mesh.face_corners(face).0));
    let corner_tags: Vec<VertexTags> = corners.iter().map(|&h| mesh.vertex_tags(h)).collect();
    walker.add_vertices(mesh, n_corners);
    walker.write(mesh, &corner_tags, outer_tags);
    walker.ring
}

/// Numbers for values, in the order in which they come first. It is cleared and filled again and again, so entries of its
/// table count only with the stamp of the present filling.
#[derive(Debug, Default)]
struct Numbering {
    values: Vec<u32>,
    /// Stamps and numbers, at the hash of the value or in the next free place; twice as many as there are values, or more.
    table: Vec<[u32; 2]>,
    stamp: u32,
}

/// Room for the vertices of an ordinary ring.
const LEAST_TABLE: usize = 64;

impl Numbering {
    fn clear(&mut self) {
        self.values.clear();
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 || self.table.is_empty() {
            self.make_table(LEAST_TABLE);
        }
    }

    fn make_table(&mut self, len: usize) {
        self.table.clear();
        self.table.resize(len, [0; 2]);
        self.stamp = 1;
        for number in 0..self.values.len() {
            let place = self.place(self.values[number]);
            self.table[place] = [self.stamp, number as u32];
        }
    }

    /// Where a value is, or would be.
    #[inline(always)]
    fn place(&self, value: u32) -> usize {
        let mask = self.table.len() - 1;
        let mut place = (value.wrapping_mul(0x9e37_79b9) >> 16) as usize & mask;
        loop {
            let [stamp, number] = self.table[place];
            if stamp != self.stamp || self.values[number as usize] == value {
                return place;
            }
            place = (place + 1) & mask;
        }
    }

    #[inline(always)]
    fn find(&self, value: u32) -> Option<u32> {
        let [stamp, number] = self.table[self.place(value)];
        (stamp == self.stamp).then_some(number)
    }

    /// The value's number, and whether it is new.
    #[inline(always)]
    fn number(&mut self, value: u32) -> (u32, bool) {
        let place = self.place(value);
        let [stamp, number] = self.table[place];
        if stamp == self.stamp {
            return (number, false);
        }
        let number = self.values.len() as u32;
        self.values.push(value);
        self.table[place] = [self.stamp, number];
        if 2 * self.values.len() > self.table.len() {
            self.make_table(2 * self.table.len());
        }
        (number, true)
    }
}

/// What tells a corner of the target from others: equal for equal corners, and different for most others.
#[derive(Clone, Copy, Default, Debug)]
struct CornerSign {
    /// Of the faces around it.
    layout: u64,
    /// Of sharpness.
    tags: u64,
    /// Faces beside the target.
    n_faces: u32,
    has_polygon: bool,
}

fn add_word(hash: &mut u64, word: u32) {
    *hash = (hash.rotate_left(5) ^ u64::from(word)).wrapping_mul(0x517c_c1b7_2722_0a95);
}

impl CornerSign {
    /// A face in the order of the fan: its number of corners, whether it lies clockwise, and the sharpness of the edge to it.
    #[inline(always)]
    fn add_face(&mut self, size: u32, is_clockwise: bool, sharpness: f32) {
        self.n_faces += 1;
        self.has_polygon |= size != 4;
        add_word(&mut self.layout, 2 * size + u32::from(is_clockwise));
        if sharpness > 0.0 {
            add_word(&mut self.tags, self.n_faces);
            add_word(&mut self.tags, sharpness.to_bits());
        }
    }

    fn add_tags(&mut self, tags: &VertexTags) {
        add_word(&mut self.tags, tags.sharpness.to_bits());
        add_word(&mut self.tags, tags.n_infinite);
        tags.semi_sharp.iter().for_each(|s| add_word(&mut self.tags, s.to_bits()));
    }

    fn is_irregular(&self, is_closed: bool) -> bool {
        self.has_polygon || if is_closed { self.n_faces != 3 } else { self.n_faces > 1 }
    }
}

/// The turn of four corners that comes first in the order of their signs: of layouts first, so that rings that differ in
/// sharpness only are turned alike and have rows in common.
fn least_turn(signs: &[CornerSign]) -> u32 {
    let turned = |t: usize| {
        let corners = [0, 1, 2, 3].map(|k| signs[(t + k) % 4]);
        (corners.map(|c| c.layout), corners.map(|c| c.tags))
    };
    (1..4).fold(0, |best, t| if turned(t) < turned(best) { t } else { best }) as u32
}

/// Finds rings, one after the other, in memory that it keeps.
#[derive(Debug, Default)]
pub struct RingWalker {
    /// The source's faces and vertices.
    faces: Numbering,
    vertices: Numbering,
    /// Half-edges of the source, in the ring's order.
    half_edges: Vec<u32>,
    /// Tags of the target's corners, and what tells the corners apart.
    corner_tags: Vec<VertexTags>,
    corner_signs: Vec<CornerSign>,
    /// Whether something at a corner is known not to be regular.
    is_irregular: bool,
    ring: Extracted,
}

impl RingWalker {
    /// The sources that [`extract`] gives for the face of `first`, without the ring: what loading a patch needs, again and
    /// again.
    pub fn sources<M: HalfEdges + ?Sized>(&mut self, mesh: &M, first: u32) -> &[u32] {
        let n_corners = self.walk::<M, false>(mesh, first);
        self.add_vertices(mesh, n_corners);
        &self.vertices.values
    }

    /// As [`extract`].
    pub fn extract<M: HalfEdges + ?Sized>(&mut self, mesh: &M, first: u32, outer_tags: bool) -> &Extracted {
        let n_corners = self.walk::<M, false>(mesh, first);
        self.finish(mesh, n_corners, outer_tags)
    }

    /// As [`extract`], but from one of the face's corners that is the same however the face is turned: the one that is that
    /// many corners after `first`. Rings that may be regular, and those of polygons, are not turned.
    pub fn extract_turned<M: HalfEdges + ?Sized>(
        &mut self,
        mesh: &M,
        first: u32,
        outer_tags: bool,
    ) -> (u32, &Extracted) {
        let n_corners = self.walk::<M, true>(mesh, first);
        let turn = if self.is_irregular && n_corners == 4 { least_turn(&self.corner_signs) } else { 0 };
        if turn != 0 {
            let (start, _) = mesh.face_corners(mesh.face(first));
            self.walk::<M, false>(mesh, start + (first - start + turn) % 4);
        }
        (turn, self.finish(mesh, n_corners, outer_tags))
    }

    fn finish<M: HalfEdges + ?Sized>(&mut self, mesh: &M, n_corners: u32, outer_tags: bool) -> &Extracted {
        self.add_vertices(mesh, n_corners);
        let corner_tags = std::mem::take(&mut self.corner_tags);
        self.write(mesh, &corner_tags, outer_tags);
        self.corner_tags = corner_tags;
        &self.ring
    }

    /// Hands over the ring that was extracted last.
    pub fn take(&mut self) -> Extracted {
        std::mem::take(&mut self.ring)
    }

    /// Finds the faces and the tags of corners, and what tells corners apart if they are to be `SIGNED`. Returns the number
    /// of corners.
    fn walk<M: HalfEdges + ?Sized, const SIGNED: bool>(&mut self, mesh: &M, first: u32) -> u32 {
        self.clear();
        self.add_face(mesh, first);
        let (start, n_corners) = mesh.face_corners(mesh.face(first));
        for k in 0..n_corners {
            let turned = first + k;
            let h = if turned < start + n_corners { turned } else { turned - n_corners };
            self.add_corner::<M, SIGNED>(mesh, h);
        }
        n_corners
    }

    fn clear(&mut self) {
        self.faces.clear();
        self.vertices.clear();
        self.corner_tags.clear();
        self.corner_signs.clear();
        self.is_irregular = false;
        let ring = &mut self.ring;
        ring.starts.clear();
        self.half_edges.clear();
        ring.mesh.face_start.clear();
        ring.mesh.vertex.clear();
        ring.mesh.face.clear();
        ring.mesh.fins.clear();
    }

    #[inline(always)]
    fn add_face<M: HalfEdges + ?Sized>(&mut self, mesh: &M, h: u32) {
        if self.faces.number(mesh.face(h)).1 {
            self.ring.starts.push(h);
        }
    }

    /// Adds the faces around a corner of the target, counter-clockwise, then what lies clockwise of it: an order that only
    /// topology decides.
    fn add_corner<M: HalfEdges + ?Sized, const SIGNED: bool>(&mut self, mesh: &M, h: u32) {
        let mut sign = CornerSign::default();
        if mesh.is_plain(h) {
            let is_closed = self.add_fan::<M, SIGNED>(mesh, h, false, &mut sign);
            self.corner_tags.push(VertexTags { n_infinite: if is_closed { 0 } else { 2 }, ..Default::default() });
            self.is_irregular |= sign.is_irregular(is_closed);
        } else {
            let tags = mesh.vertex_tags(h);
            let is_closed = self.add_fan::<M, SIGNED>(mesh, h, tags.n_infinite >= 2, &mut sign);
            let is_plain = tags == VertexTags { n_infinite: if is_closed { 0 } else { 2 }, ..Default::default() };
            if SIGNED && !is_plain {
                sign.add_tags(&tags);
            }
            let is_semi_sharp = !tags.semi_sharp.is_empty() || (tags.sharpness > 0.0 && tags.sharpness.is_finite());
            self.is_irregular |= sign.is_irregular(is_closed) || is_semi_sharp;
            self.corner_tags.push(tags);
        }
        self.corner_signs.push(sign);
    }

    /// Returns whether the faces close around the corner.
    #[inline(always)]
    fn add_fan<M: HalfEdges + ?Sized, const SIGNED: bool>(
        &mut self,
        mesh: &M,
        h: u32,
        cut: bool,
        sign: &mut CornerSign,
    ) -> bool {
        let is_plain = mesh.is_plain(h);
        let sharpness = |e: u32| if is_plain { 0.0 } else { mesh.edge_sharpness(e) };
        let mut spoke = h;
        loop {
            let arriving = mesh.prev(spoke);
            if is_border(mesh, arriving, cut) {
                break;
            }
            spoke = mesh.twin(arriving);
            if spoke == h {
                return true;
            }
            self.add_face(mesh, spoke);
            if SIGNED {
                sign.add_face(mesh.face_corners(mesh.face(spoke)).1, false, sharpness(arriving));
            }
        }
        spoke = h;
        while !is_border(mesh, spoke, cut) {
            let crossed = spoke;
            spoke = mesh.next(mesh.twin(spoke));
            self.add_face(mesh, spoke);
            if SIGNED {
                sign.add_face(mesh.face_corners(mesh.face(spoke)).1, true, sharpness(crossed));
            }
        }
        false
    }

    /// Adds the vertices of all faces, then the ends of fins at corners.
    fn add_vertices<M: HalfEdges + ?Sized>(&mut self, mesh: &M, n_corners: u32) {
        let ring = &mut self.ring.mesh;
        ring.face_start.push(0);
        for (place, (&start, &face)) in self.ring.starts.iter().zip(&self.faces.values).enumerate() {
            let (first, n) = mesh.face_corners(face);
            for h in (start..first + n).chain(first..start) {
                ring.vertex.push(self.vertices.number(mesh.vertex(h)).0);
                ring.face.push(place as u32);
                self.half_edges.push(h);
            }
            ring.face_start.push(self.half_edges.len() as u32);
        }
        for (k, &corner) in self.half_edges[..n_corners as usize].iter().enumerate() {
            if let Some(ends) = mesh.crease_ends(corner) {
                ring.fins.push((ring.vertex[k], ends.map(|v| self.vertices.number(v).0)));
            }
        }
    }

    /// Writes down what else the ring has: twins, tags and sharpness.
    fn write<M: HalfEdges + ?Sized>(&mut self, mesh: &M, corner_tags: &[VertexTags], outer_tags: bool) {
        self.ring.sources.clear();
        self.ring.sources.extend_from_slice(&self.vertices.values);
        let mut twin = std::mem::take(&mut self.ring.mesh.twin);
        twin.clear();
        twin.extend(self.half_edges.iter().map(|&h| self.local(mesh, mesh.twin(h))));
        self.ring.mesh.twin = twin;
        self.set_tags(mesh, corner_tags, outer_tags);
        self.set_sharpness(mesh, corner_tags);
    }

    /// The local number of a half-edge of the source, or [`NONE`].
    #[inline(always)]
    fn local<M: HalfEdges + ?Sized>(&self, mesh: &M, h: u32) -> u32 {
        if h == NONE {
            return NONE;
        }
        let Some(place) = self.faces.find(mesh.face(h)) else { return NONE };
        let (start, next) = (self.ring.starts[place as usize], &self.ring.mesh.face_start[place as usize..]);
        if h >= start { next[0] + h - start } else { next[1] - (start - h) }
    }

    fn set_tags<M: HalfEdges + ?Sized>(&mut self, mesh: &M, corner_tags: &[VertexTags], outer: bool) {
        let ring = &mut self.ring.mesh;
        ring.tags.clear();
        ring.tags.resize(self.vertices.values.len(), VertexTags::default());
        if outer {
            for (&v, &h) in ring.vertex.iter().zip(&self.half_edges) {
                ring.tags[v as usize].semi_sharp = mesh.vertex_tags(h).semi_sharp;
            }
        }
        for (&v, tags) in ring.vertex.iter().zip(corner_tags) {
            ring.tags[v as usize].clone_from(tags);
        }
    }

    fn set_sharpness<M: HalfEdges + ?Sized>(&mut self, mesh: &M, corner_tags: &[VertexTags]) {
        let ring = &mut self.ring.mesh;
        ring.sharpness.clear();
        ring.sharpness.resize(self.half_edges.len(), 0.0);
        if corner_tags.iter().all(|tags| *tags == VertexTags::default()) {
            return;
        }
        // The target's vertices come first.
        let n_corners = ring.vertex[..corner_tags.len()].iter().fold(0, |n, &v| n.max(v + 1));
        for bounds in ring.face_start.windows(2) {
            let (start, end) = (bounds[0] as usize, bounds[1] as usize);
            for i in start..end {
                let next = if i + 1 == end { start } else { i + 1 };
                let is_known = ring.vertex[i].min(ring.vertex[next]) < n_corners;
                if is_known && ring.twin[i] != NONE {
                    ring.sharpness[i] = mesh.edge_sharpness(self.half_edges[i]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes;
    use crate::topology::Topology;

    #[test]
    fn walked_rings_are_the_extracted_ones() {
        let shapes = shapes::all().into_iter().map(|(_, mesh)| mesh);
        let mut walker = RingWalker::default();
        for mesh in shapes.chain((0..100).map(random_mesh)) {
            let topology = Topology::new(&mesh, 1);
            for face in 0..topology.n_faces() as u32 {
                let first = topology.face_corners(face).0;
                let (turn, turned) = walker.extract_turned(&topology, first, false);
                let turned = turned.sources.clone();
                assert_eq!(extract(&topology, first + turn, false).sources, turned);
                for outer_tags in [false, true] {
                    let extracted = extract(&topology, first, outer_tags).sources;
                    assert_eq!(walker.sources(&topology, first), extracted);
                }
            }
        }
    }
}
