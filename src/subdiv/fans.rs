//! The faces around the corners of a quad: what tells most irregular rings from others, without finding them.
//!
//! A **fan** is the sizes of the faces around a vertex, as seen from one of them. Where the fans of a quad are closed,
//! without tags, and touch each other only where they must, they decide its ring.

use super::numbering::Numbering;
use crate::topology::{HalfEdges, NONE, Topology};

/// The sizes of the faces around a corner but the corner's own, counter-clockwise: 3 less in two bits each, below a bit
/// that is set.
pub(super) type Fan = u64;

/// The fan of four quads.
pub(super) const REGULAR_FAN: Fan = 0b1_01_01_01;

/// The largest face that is told of in a fan, and the number of faces at most.
const MOST_CORNERS: u32 = 6;
const MOST_FACES: u32 = 31;

/// The fans of a mesh.
pub(super) struct Fans<'a> {
    topology: &'a Topology,
    /// The numbers of edges at vertices that have quads only around them and no tag, from 3 to [`MOST_FACES`]; 0 for
    /// others.
    valences: Vec<u8>,
}

impl<'a> Fans<'a> {
    /// Looks at all faces once: most fans are four quads.
    pub fn new(topology: &'a Topology) -> Self {
        let mut valences = vec![0u8; topology.n_vertices()];
        for face in 0..topology.n_faces() as u32 {
            let (first, n) = topology.face_corners(face);
            for h in first..first + n {
                let v = topology.vertex(h);
                let is_other = n != 4 || topology.twin(h) == NONE || topology.is_tagged(v);
                let valence = &mut valences[v as usize];
                *valence = if is_other { u8::MAX } else { valence.saturating_add(1) };
            }
        }
        let in_range = 3..=MOST_FACES as u8;
        valences.iter_mut().filter(|n| !in_range.contains(n)).for_each(|n| *n = 0);
        Self { topology, valences }
    }

    /// The fans of a quad, if all are closed, of three faces or more, and without tags.
    pub fn at(&self, first: u32) -> Option<[Fan; 4]> {
        let mut fans = [0; 4];
        for (h, fan) in (first..).zip(&mut fans) {
            *fan = match self.valences[self.topology.vertex(h) as usize] {
                0 => fan_at(self.topology, h)?,
                n => fan_of_quads(n),
            };
        }
        Some(fans)
    }
}

fn fan_of_quads(n: u8) -> Fan {
    const MOST: Fan = 0x5555_5555_5555_5555;
    let below = (1 << (2 * (n - 1))) - 1;
    1 << (2 * (n - 1)) | MOST & below
}

/// The fan of a corner, if it is closed, of three faces or more, and without tags.
fn fan_at(topology: &Topology, h: u32) -> Option<Fan> {
    if !topology.is_plain(h) {
        return None;
    }
    let (mut fan, mut n) = (1, 1);
    let mut spoke = turned(topology, h);
    while spoke != h {
        if spoke == NONE || n == MOST_FACES {
            return None;
        }
        let (_, size) = topology.corners_at(spoke);
        if size > MOST_CORNERS {
            return None;
        }
        fan = fan << 2 | Fan::from(size - 3);
        n += 1;
        spoke = turned(topology, spoke);
    }
    (n > 2).then_some(fan)
}

/// The sizes of a fan's faces.
pub(super) fn sizes(fan: Fan) -> impl Iterator<Item = u32> {
    let n = fan.ilog2() / 2;
    (0..n).rev().map(move |i| 3 + (fan >> (2 * i) & 3) as u32)
}

/// The half-edge that follows `spoke` counter-clockwise around the vertex where it starts.
#[inline(always)]
fn turned(topology: &Topology, spoke: u32) -> u32 {
    topology.twin(topology.prev(spoke))
}

/// Whether all vertices of the ring of a quad with [`Fans`] are different ones, but for those that faces side by side
/// share.
pub(super) fn is_spread_out(topology: &Topology, first: u32, vertices: &mut Numbering) -> bool {
    vertices.clear();
    let mut is_new = |h: u32| vertices.number(topology.vertex(h)).1;
    (first..first + 4).all(|h| {
        let beside = turned(topology, h);
        // The two faces beside the edges of the quad have vertices in common with the fans of the next corners: of
        // each, the end of the edge from the corner is counted where that follows counter-clockwise, and in a triangle
        // there only.
        let mut is_counted = topology.corners_at(beside).1 == 3;
        let mut spoke = turned(topology, beside);
        let mut are_new = is_new(h);
        while are_new && spoke != h {
            let end = topology.next(spoke);
            are_new = is_counted || is_new(end);
            is_counted = false;
            let next = turned(topology, spoke);
            let n_shared = if next == h { 4 } else { 3 };
            let mut inner = end;
            for _ in n_shared..topology.corners_at(spoke).1 {
                inner = topology.next(inner);
                are_new = are_new && is_new(inner);
            }
            spoke = next;
        }
        are_new
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes;

    #[test]
    fn counted_fans_are_those_that_a_walk_finds() {
        let mut n_found = 0;
        for mesh in shapes::all().into_iter().map(|(_, mesh)| mesh).chain((0..100).map(random_mesh)) {
            let topology = Topology::new(&mesh, 1);
            let fans = Fans::new(&topology);
            let firsts = (0..topology.n_faces() as u32).map(|face| topology.face_corners(face));
            for (first, _) in firsts.filter(|&(_, n)| n == 4) {
                let by_walking: Option<Vec<Fan>> = (first..first + 4).map(|h| fan_at(&topology, h)).collect();
                n_found += u32::from(by_walking.is_some());
                assert_eq!(fans.at(first).map(Vec::from), by_walking);
            }
        }
        assert!(n_found > 100, "{n_found} quads have fans");
    }
}
