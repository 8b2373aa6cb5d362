//! A small half-edge mesh: the **ring** of one target face, cut out of a larger mesh, and its refinement.
//!
//! Face 0 is the target and half-edge 0 its first corner. Only the target's corners know all their faces (up to
//! infinitely sharp edges, which nothing crosses); that is enough to refine the target and the rings of its quarters.

use super::numbering::Numbering;
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
    /// Corners of the target that are inner vertices of fins, with the ends of their two sharp edges. Such an end may
    /// be a vertex without any half-edge here.
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
        self.tags_at(h).clone()
    }

    fn is_plain(&self, h: u32) -> bool {
        let tags = self.tags_at(h);
        tags.is_smooth() && (tags.n_infinite == 0 || tags.n_infinite == 2 && self.is_bounded_by_nothing(h))
    }

    fn n_infinite(&self, h: u32) -> u32 {
        self.tags_at(h).n_infinite
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

    /// What is semi-sharp, at corners and at edges that touch them.
    fn semi_sharp(&mut self) -> impl Iterator<Item = &mut f32> {
        let tags = self.tags.iter_mut().flat_map(|tags| tags.semi_sharp.iter_mut().chain([&mut tags.sharpness]));
        tags.chain(&mut self.sharpness).filter(|s| is_semi_sharp(**s))
    }

    /// The least of all that is semi-sharp; infinite if nothing is.
    pub fn least_semi_sharp(&self) -> f32 {
        let tags = self.tags.iter().flat_map(|tags| tags.semi_sharp.iter().chain([&tags.sharpness]));
        tags.chain(&self.sharpness).filter(|s| is_semi_sharp(**s)).fold(f32::INFINITY, |least, s| least.min(*s))
    }

    /// Makes all that is semi-sharp less so, by as many steps of the uniform method as leave the least of it above 1.
    /// Returns how many. Exact, as the steps themselves are.
    pub fn lower(&mut self) -> u32 {
        let least = self.least_semi_sharp();
        let steps = if least.is_finite() { (least.ceil() - 2.0).max(0.0) } else { 0.0 };
        if steps > 0.0 {
            self.semi_sharp().for_each(|s| *s -= steps);
        }
        steps as u32
    }

    /// Makes all that is semi-sharp more so, by as many steps.
    pub fn raise(&mut self, steps: u32) {
        self.semi_sharp().for_each(|s| *s += steps as f32);
    }

    /// Whether the sector of a corner with two infinitely sharp edges ends where there is no other side.
    fn is_bounded_by_nothing(&self, h: u32) -> bool {
        let faces = fan_size(self, h, |e| self.twin(e) == NONE);
        self.crease_ends(h).is_none() && faces == self.fan_size(h) && !faces.1
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
        if (0..self.n_corners()).all(|h| self.is_plain(h)) {
            return self.plain_key(key);
        }
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

/// Marks keys of rings whose corners are all plain.
const PLAIN: u32 = 1 << 31;

/// Marks those of quads among them.
const ALL_QUADS: u32 = 1 << 30;

impl LocalMesh {
    /// As [`key`](Self::key), where all corners of the target are plain: edges at them are sound, so that their twins
    /// follow from the vertices, no others count, and nothing is sharp.
    fn plain_key(&self, key: &mut Vec<u32>) {
        if self.all_quads() {
            key.push(self.n_faces() as u32 | PLAIN | ALL_QUADS);
        } else {
            key.push(self.n_faces() as u32 | PLAIN);
            key.extend_from_slice(&self.face_start);
        }
        key.extend_from_slice(&self.vertex);
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

/// As [`extract`], with all faces at the target's corners, whatever sharp or non-manifold edges lie between: edits can
/// reach across those. `spokes` lists the half-edges that start at a vertex. Faces but the target start as they do in
/// `mesh`, so that of a face's passages of an edge the first stays the first.
pub fn extract_whole<M: HalfEdges + ?Sized>(
    mesh: &M,
    first: u32,
    outer_tags: bool,
    spokes: impl Fn(u32) -> Vec<u32>,
) -> Extracted {
    let mut walker = RingWalker::default();
    walker.clear();
    walker.add_face(mesh, first);
    let (start, n_corners) = mesh.corners_at(first);
    let corners: Vec<u32> = (0..n_corners).map(|k| start + (first - start + k) % n_corners).collect();
    let touching = corners.iter().flat_map(|&h| spokes(mesh.vertex(h))).map(|spoke| mesh.corners_at(spoke).0);
    touching.for_each(|start| walker.add_face(mesh, start));
    walker.add_vertices::<M, true>(mesh, n_corners);
    walker.write(mesh, n_corners, outer_tags);
    walker.ring
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

fn is_semi_sharp(sharpness: f32) -> bool {
    sharpness > 0.0 && sharpness.is_finite()
}

/// What whole steps do not change of sharpness, as a word: rings on the way to smoothness are turned alike.
fn fraction_bits(sharpness: f32) -> u32 {
    if is_semi_sharp(sharpness) { (2.0 - sharpness.ceil() + sharpness).to_bits() } else { sharpness.to_bits() }
}

impl CornerSign {
    /// A face in the order of the fan: its number of corners, whether it lies clockwise, and the sharpness of the edge
    /// to it.
    #[inline(always)]
    fn add_face(&mut self, size: u32, is_clockwise: bool, sharpness: f32) {
        self.n_faces += 1;
        self.has_polygon |= size != 4;
        add_word(&mut self.layout, 2 * size + u32::from(is_clockwise));
        if sharpness > 0.0 {
            add_word(&mut self.tags, self.n_faces);
            add_word(&mut self.tags, fraction_bits(sharpness));
        }
    }

    fn add_tags(&mut self, tags: &VertexTags) {
        add_word(&mut self.tags, fraction_bits(tags.sharpness));
        add_word(&mut self.tags, tags.n_infinite);
        tags.semi_sharp.iter().for_each(|s| add_word(&mut self.tags, fraction_bits(*s)));
    }

    fn is_irregular(&self, is_closed: bool) -> bool {
        self.has_polygon || if is_closed { self.n_faces != 3 } else { self.n_faces > 1 }
    }
}

/// The turn of four corners that comes first in the order of their signs: of layouts first, so that rings that differ
/// in sharpness only are turned alike and have rows in common.
fn least_turn(signs: &[CornerSign]) -> u32 {
    let turned = |t: usize| {
        let corners = [0, 1, 2, 3].map(|k| signs[(t + k) % 4]);
        (corners.map(|c| c.layout), corners.map(|c| c.tags))
    };
    (1..4).fold(0, |best, t| if turned(t) < turned(best) { t } else { best }) as u32
}

/// The turn of a quad without tags at its corners, as its [`Look`] tells unless it is regular: from the sizes of the
/// faces around each corner but itself, counter-clockwise.
pub(super) fn turn_of_fans(fans: [impl Iterator<Item = u32>; 4]) -> u32 {
    least_turn(&fans.map(|sizes| {
        let mut sign = CornerSign::default();
        sizes.for_each(|size| sign.add_face(size, false, 0.0));
        sign
    }))
}

/// A face seen by what lies around its corners.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// From which corner on its ring is the same however the face is turned. Rings that may be regular, and those of
    /// polygons, are not turned.
    pub turn: u32,
    /// Whether all corners are plain, as [`HalfEdges::is_plain`] has it.
    pub is_plain: bool,
    /// Whether the ring is 3 x 3 quads without any tag.
    pub is_regular: bool,
}

/// Finds rings, one after the other, in memory that it keeps.
#[derive(Debug, Default)]
pub struct RingWalker {
    /// The source's faces, by their first half-edges, and vertices.
    faces: Numbering,
    vertices: Numbering,
    /// Half-edges of the source, in the ring's order.
    half_edges: Vec<u32>,
    corner_signs: Vec<CornerSign>,
    ring: Extracted,
}

impl RingWalker {
    /// The sources that [`extract`] gives for the face of `first`, without the ring: what loading a patch needs, again
    /// and again.
    pub fn sources<M: HalfEdges + ?Sized>(&mut self, mesh: &M, first: u32) -> &[u32] {
        let n_corners = self.walk(mesh, first);
        self.add_vertices::<M, false>(mesh, n_corners);
        &self.vertices.values
    }

    /// As [`extract`].
    pub fn extract<M: HalfEdges + ?Sized>(&mut self, mesh: &M, first: u32, outer_tags: bool) -> &Extracted {
        let n_corners = self.walk(mesh, first);
        self.add_vertices::<M, true>(mesh, n_corners);
        self.write(mesh, n_corners, outer_tags);
        &self.ring
    }

    /// The key of the ring from `first` on, whose corners are as `look` says, and its sources. If it `lowers`, the key
    /// is that of the ring that is [lower](LocalMesh::lower) by the steps that are returned.
    pub fn key<M: HalfEdges + ?Sized>(
        &mut self,
        mesh: &M,
        first: u32,
        look: Look,
        outer_tags: bool,
        lowers: bool,
        key: &mut Vec<u32>,
    ) -> (u32, &[u32]) {
        let mut steps = 0;
        let n_corners = self.walk(mesh, first);
        self.add_vertices::<M, true>(mesh, n_corners);
        if look.is_plain {
            key.clear();
            self.ring.mesh.plain_key(key);
        } else {
            self.write(mesh, n_corners, outer_tags);
            let ring = &mut self.ring.mesh;
            steps = if lowers { ring.lower() } else { 0 };
            ring.key(key);
        }
        (steps, &self.vertices.values)
    }

    /// Looks at the corners of the face of `first`, without finding its ring.
    pub fn look<M: HalfEdges + ?Sized>(&mut self, mesh: &M, first: u32) -> Look {
        let (start, n_corners) = mesh.corners_at(first);
        self.corner_signs.clear();
        let (mut is_plain, mut is_irregular, mut is_regular) = (true, false, n_corners == 4);
        for k in first - start..first - start + n_corners {
            let h = start + if k < n_corners { k } else { k - n_corners };
            let mut sign = CornerSign::default();
            if mesh.is_plain(h) {
                let is_closed = sign_fan(mesh, h, false, |_| 0.0, &mut sign);
                is_irregular |= sign.is_irregular(is_closed);
                is_regular &= is_closed && sign.n_faces == 3 && !sign.has_polygon;
            } else {
                (is_plain, is_regular) = (false, false);
                is_irregular |= sign_tagged(mesh, h, &mut sign);
            }
            self.corner_signs.push(sign);
        }
        let turn = if is_irregular && n_corners == 4 { least_turn(&self.corner_signs) } else { 0 };
        Look { turn, is_plain, is_regular }
    }

    /// Finds the faces. Returns the number of corners.
    fn walk<M: HalfEdges + ?Sized>(&mut self, mesh: &M, first: u32) -> u32 {
        self.clear();
        self.add_face(mesh, first);
        let (start, n_corners) = mesh.corners_at(first);
        for k in first - start..first - start + n_corners {
            let h = start + if k < n_corners { k } else { k - n_corners };
            if mesh.is_plain(h) {
                self.add_fan(mesh, h, |e| mesh.twin(e) == NONE);
            } else {
                let cut = mesh.n_infinite(h) >= 2;
                self.add_fan(mesh, h, |e| is_border(mesh, e, cut));
            }
        }
        n_corners
    }

    fn clear(&mut self) {
        self.faces.clear();
        self.vertices.clear();
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
        if self.faces.number(mesh.corners_at(h).0).1 {
            self.ring.starts.push(h);
        }
    }

    /// Adds the faces around a corner of the target, counter-clockwise, then what lies clockwise of it: an order that
    /// only topology decides.
    #[inline(always)]
    fn add_fan<M: HalfEdges + ?Sized>(&mut self, mesh: &M, h: u32, is_border: impl Fn(u32) -> bool) {
        let mut spoke = h;
        loop {
            let arriving = mesh.prev(spoke);
            if is_border(arriving) {
                break;
            }
            spoke = mesh.twin(arriving);
            if spoke == h {
                return;
            }
            self.add_face(mesh, spoke);
        }
        spoke = h;
        while !is_border(spoke) {
            spoke = mesh.next(mesh.twin(spoke));
            self.add_face(mesh, spoke);
        }
    }

    /// Adds the vertices of all faces, then the ends of fins at corners. Unless `LISTED`, that is all; else the vertex
    /// and the face of each half-edge are written down.
    fn add_vertices<M: HalfEdges + ?Sized, const LISTED: bool>(&mut self, mesh: &M, n_corners: u32) {
        let ring = &mut self.ring.mesh;
        if LISTED {
            ring.face_start.push(0);
        }
        for (place, (&start, &first)) in self.ring.starts.iter().zip(&self.faces.values).enumerate() {
            let (_, n) = mesh.corners_at(first);
            for h in (start..first + n).chain(first..start) {
                let (number, _) = self.vertices.number(mesh.vertex(h));
                if LISTED {
                    ring.vertex.push(number);
                    ring.face.push(place as u32);
                    self.half_edges.push(h);
                }
            }
            if LISTED {
                ring.face_start.push(self.half_edges.len() as u32);
            }
        }
        let (start, first) = (self.ring.starts[0], self.faces.values[0]);
        for h in (start..first + n_corners).chain(first..start).filter(|&h| !mesh.is_plain(h)) {
            if let Some(ends) = mesh.crease_ends(h) {
                let v = self.vertices.number(mesh.vertex(h)).0;
                ring.fins.push((v, ends.map(|v| self.vertices.number(v).0)));
            }
        }
    }

    /// Writes down what else the ring has: twins, tags and sharpness.
    fn write<M: HalfEdges + ?Sized>(&mut self, mesh: &M, n_corners: u32, outer_tags: bool) {
        self.ring.sources.clear();
        self.ring.sources.extend_from_slice(&self.vertices.values);
        let mut twin = std::mem::take(&mut self.ring.mesh.twin);
        twin.clear();
        twin.extend(self.half_edges.iter().map(|&h| self.local(mesh, mesh.twin(h))));
        self.ring.mesh.twin = twin;
        self.set_tags(mesh, n_corners, outer_tags);
        self.set_sharpness(mesh, n_corners);
    }

    /// The local number of a half-edge of the source, or [`NONE`].
    #[inline(always)]
    fn local<M: HalfEdges + ?Sized>(&self, mesh: &M, h: u32) -> u32 {
        if h == NONE {
            return NONE;
        }
        let Some(place) = self.faces.find(mesh.corners_at(h).0) else { return NONE };
        let (start, next) = (self.ring.starts[place as usize], &self.ring.mesh.face_start[place as usize..]);
        if h >= start { next[0] + h - start } else { next[1] - (start - h) }
    }

    fn set_tags<M: HalfEdges + ?Sized>(&mut self, mesh: &M, n_corners: u32, outer: bool) {
        let ring = &mut self.ring.mesh;
        ring.tags.clear();
        ring.tags.resize(self.vertices.values.len(), VertexTags::default());
        if outer {
            for (&v, &h) in ring.vertex.iter().zip(&self.half_edges) {
                ring.tags[v as usize].semi_sharp = mesh.vertex_tags(h).semi_sharp;
            }
        }
        for (&v, &h) in ring.vertex.iter().zip(&self.half_edges[..n_corners as usize]) {
            ring.tags[v as usize] = mesh.vertex_tags(h);
        }
    }

    fn set_sharpness<M: HalfEdges + ?Sized>(&mut self, mesh: &M, n_corners: u32) {
        let ring = &mut self.ring.mesh;
        ring.sharpness.clear();
        ring.sharpness.resize(self.half_edges.len(), 0.0);
        let corners = &ring.vertex[..n_corners as usize];
        if corners.iter().all(|&v| ring.tags[v as usize] == VertexTags::default()) {
            return;
        }
        // The target's vertices come first.
        let n_vertices = corners.iter().fold(0, |n, &v| n.max(v + 1));
        for bounds in ring.face_start.windows(2) {
            let (start, end) = (bounds[0] as usize, bounds[1] as usize);
            for i in start..end {
                let next = if i + 1 == end { start } else { i + 1 };
                let is_known = ring.vertex[i].min(ring.vertex[next]) < n_vertices;
                if is_known && ring.twin[i] != NONE {
                    ring.sharpness[i] = mesh.edge_sharpness(self.half_edges[i]);
                }
            }
        }
    }
}

/// What the faces around a corner add to its sign, up to borders, in the order in which [`RingWalker`] adds them;
/// returns whether they close around it. `sharpness` is that of an edge between two of them.
#[inline(always)]
fn sign_fan<M: HalfEdges + ?Sized>(
    mesh: &M,
    h: u32,
    cut: bool,
    sharpness: impl Fn(u32) -> f32,
    sign: &mut CornerSign,
) -> bool {
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
        sign.add_face(mesh.corners_at(spoke).1, false, sharpness(arriving));
    }
    spoke = h;
    while !is_border(mesh, spoke, cut) {
        let crossed = spoke;
        spoke = mesh.next(mesh.twin(spoke));
        sign.add_face(mesh.corners_at(spoke).1, true, sharpness(crossed));
    }
    false
}

/// The sign of a corner that is not known to be plain; returns whether it is known not to be regular.
fn sign_tagged<M: HalfEdges + ?Sized>(mesh: &M, h: u32, sign: &mut CornerSign) -> bool {
    let tags = mesh.vertex_tags(h);
    let is_closed = sign_fan(mesh, h, tags.n_infinite >= 2, |e| mesh.edge_sharpness(e), sign);
    if tags != (VertexTags { n_infinite: if is_closed { 0 } else { 2 }, ..Default::default() }) {
        sign.add_tags(&tags);
    }
    let is_semi_sharp = !tags.semi_sharp.is_empty() || (tags.sharpness > 0.0 && tags.sharpness.is_finite());
    sign.is_irregular(is_closed) || is_semi_sharp
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
                let look = walker.look(&topology, first);
                for outer_tags in [false, true] {
                    let ring = extract(&topology, first + look.turn, outer_tags);
                    assert_eq!(walker.sources(&topology, first + look.turn), ring.sources);
                    let (mut key, mut of_ring) = (Vec::new(), Vec::new());
                    walker.key(&topology, first + look.turn, look, outer_tags, false, &mut key);
                    ring.mesh.key(&mut of_ring);
                    assert_eq!(key, of_ring);
                }
            }
        }
    }
}
