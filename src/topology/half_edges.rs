//! What subdivision asks of a mesh, whether it is the whole control mesh or a small refined neighbourhood.

/// "No such half-edge".
pub const NONE: u32 = u32::MAX;

/// Sharpness at a vertex.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct VertexTags {
    /// The vertex's own sharpness: 0 smooth, finite semi-sharp, infinite corner.
    pub sharpness: f32,
    /// Number of infinitely sharp edges at the vertex, all sectors counted.
    pub n_infinite: u32,
    /// Sharpness of the semi-sharp edges at the vertex, all sectors counted, ascending.
    pub semi_sharp: Vec<f32>,
    /// Infinitely sharp for being non-manifold: no edit changes that.
    pub is_pinned: bool,
}

impl VertexTags {
    /// Whether nothing is sharp here but infinitely sharp edges, if there are any.
    pub fn is_smooth(&self) -> bool {
        self.sharpness == 0.0 && self.semi_sharp.is_empty() && !self.is_pinned
    }

    /// Number of sharp edges, semi-sharp or infinite.
    pub fn n_sharp(&self) -> usize {
        self.n_infinite as usize + self.semi_sharp.len()
    }
}

/// A mesh of half-edges, by plain index.
pub trait HalfEdges {
    /// The vertex where `h` starts.
    fn vertex(&self, h: u32) -> u32;
    /// The other side of the edge, or [`NONE`].
    fn twin(&self, h: u32) -> u32;
    /// The face of `h`.
    fn face(&self, h: u32) -> u32;
    /// The first half-edge of a face and its number of corners.
    fn face_corners(&self, face: u32) -> (u32, u32);
    /// Sharpness of the edge of `h`.
    fn edge_sharpness(&self, h: u32) -> f32;
    /// Tags of the vertex where `h` starts.
    fn vertex_tags(&self, h: u32) -> VertexTags;

    /// Whether the vertex where `h` starts is known to be smooth, with smooth edges, borders aside, which have no other
    /// side then; `false` may mean anything.
    fn is_plain(&self, h: u32) -> bool;

    /// Number of infinitely sharp edges at the vertex where `h` starts, all sectors counted.
    #[inline]
    fn n_infinite(&self, h: u32) -> u32 {
        self.vertex_tags(h).n_infinite
    }

    /// The ends of the two infinitely sharp edges at the vertex where `h` starts, where faces around the vertex may not
    /// reach both: at inner vertices of fins.
    fn crease_ends(&self, h: u32) -> Option<[u32; 2]>;

    /// The first half-edge of the face of `h`, and its number of corners.
    #[inline]
    fn corners_at(&self, h: u32) -> (u32, u32) {
        self.face_corners(self.face(h))
    }

    /// The next half-edge of the face.
    #[inline]
    fn next(&self, h: u32) -> u32 {
        let (start, n) = self.corners_at(h);
        if h + 1 == start + n { start } else { h + 1 }
    }

    /// The previous half-edge of the face.
    #[inline]
    fn prev(&self, h: u32) -> u32 {
        let (start, n) = self.corners_at(h);
        if h == start { start + n - 1 } else { h - 1 }
    }
}

/// The faces around a vertex that are reached without crossing a border.
#[derive(Clone, Debug)]
pub struct Fan {
    /// Outgoing half-edges, counter-clockwise; one per face.
    pub spokes: Vec<u32>,
    /// Whether the fan closes into a ring. If not, one more edge follows: the one that arrives in the last face.
    pub closed: bool,
}

/// The sector of `h`'s face at the vertex where `h` starts, bounded by edges for which `is_border` holds.
pub fn fan<M: HalfEdges + ?Sized>(mesh: &M, h: u32, is_border: impl Fn(u32) -> bool) -> Fan {
    // Few vertices have more edges.
    let mut spokes = Vec::with_capacity(8);
    spokes.push(h);
    loop {
        let arriving = mesh.prev(*spokes.last().expect("a fan has a spoke"));
        if is_border(arriving) {
            break;
        }
        let spoke = mesh.twin(arriving);
        if spoke == h {
            return Fan { spokes, closed: true };
        }
        spokes.push(spoke);
    }
    let mut before = Vec::new();
    let mut spoke = h;
    while !is_border(spoke) {
        spoke = mesh.next(mesh.twin(spoke));
        before.push(spoke);
    }
    before.reverse();
    before.extend(spokes);
    Fan { spokes: before, closed: false }
}

/// Number of faces in the [`fan`] of `h`, and whether it is closed, without collecting them.
pub fn fan_size<M: HalfEdges + ?Sized>(mesh: &M, h: u32, is_border: impl Fn(u32) -> bool) -> (usize, bool) {
    let mut n = 1;
    let mut arriving = mesh.prev(h);
    while !is_border(arriving) {
        let spoke = mesh.twin(arriving);
        if spoke == h {
            return (n, true);
        }
        n += 1;
        arriving = mesh.prev(spoke);
    }
    let mut spoke = h;
    while !is_border(spoke) {
        n += 1;
        spoke = mesh.next(mesh.twin(spoke));
    }
    (n, false)
}
