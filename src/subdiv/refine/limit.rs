//! Limit masks: from a star at rest to a point and tangents of the limit surface.

use super::RefinedMesh;
use super::star::{Sector, Star};
use super::step::Rule;
use glam::DVec3;
use std::f64::consts::TAU;

/// What is known of the directions of the surface at a sample.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Tangents {
    /// Derivatives with respect to u and v of the patch, one-sided at creases and boundaries.
    Derivatives(DVec3, DVec3),
    /// Unit tangents in the directions of u and v: at smooth vertices of a valence other than 4 the derivatives are
    /// zero or infinite.
    Directions(DVec3, DVec3),
    /// None from a mask: darts, valence 2, and creases and corners whose side has an unusual number of quads.
    Unknown,
}

/// A point of the limit surface.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sample {
    /// Position, in object space.
    pub position: DVec3,
    /// Directions at that point.
    pub tangents: Tangents,
}

/// Tangents along the edges that leave and arrive at a corner.
#[derive(Clone, Copy)]
enum AlongEdges {
    Derivatives(DVec3, DVec3),
    Directions(DVec3, DVec3),
    Unknown,
}

impl RefinedMesh<'_> {
    /// The limit of corner `k` of a face, with tangents of that face's side.
    ///
    /// None if the masks do not hold yet (semi-sharp edges, edits to come, faces that are no quads around the vertex):
    /// refine.
    pub fn limit(&self, face: usize, k: usize) -> Option<Sample> {
        let star = self.star(self.corners(face)[k].vertex as usize);
        if !star.is_at_rest() {
            return None;
        }
        let cells_per_patch = 2f64.powi(self.place(face).level as i32);
        let tangents = star.tangents(&self.sector(face, k)).in_parameters(k, cells_per_patch);
        let position = star.limit_position().unwrap_or_else(|| self.iterated_limit(face, k));
        Some(Sample { position, tangents })
    }

    /// The limit of the refined positions, where no mask is exact: refines the star until the vertex stands still.
    fn iterated_limit(&self, face: usize, k: usize) -> DVec3 {
        // What moves the vertex at least halves with each step, so at level 62, the last that a place can number, the
        // rest is below the last bit.
        let mesh = (self.place(face).level..62).fold(self.at_corner(face, k), |mesh, _| mesh.refine().at_corner(k, k));
        mesh.position(mesh.corners(0)[k].vertex as usize)
    }
}

impl Star<'_> {
    /// The limit position, where a mask gives it.
    fn limit_position(&self) -> Option<DVec3> {
        let v = self.position();
        let n = self.valence() as f64;
        match self.rule() {
            Rule::Corner => Some(v),
            Rule::Crease => Some((4.0 * v + self.sharp_edge_ends()) / 6.0),
            Rule::Smooth if self.valence() != 2 => {
                Some((n * n * v + 4.0 * self.edge_ends() + self.diagonals()) / (n * (n + 5.0)))
            }
            Rule::Smooth | Rule::Dart => None,
        }
    }

    fn tangents(&self, sector: &Sector) -> AlongEdges {
        match (self.rule(), self.valence()) {
            (Rule::Smooth, 4) => self.regular_tangents(sector),
            (Rule::Smooth, 3 | 5..) => self.extraordinary_tangents(sector),
            (Rule::Crease, _) => self.crease_tangents(sector),
            (Rule::Corner, _) => self.corner_tangents(sector),
            _ => AlongEdges::Unknown,
        }
    }

    fn regular_tangents(&self, sector: &Sector) -> AlongEdges {
        let ring: Vec<&Sector> = self.ring(sector).collect();
        let along = |k: usize| {
            let (e, d) = (|i: usize| ring[(k + i) % 4].next, |i: usize| ring[(k + i) % 4].diagonal);
            (4.0 * (e(0) - e(2)) + d(0) + d(3) - d(1) - d(2)) / 12.0
        };
        AlongEdges::Derivatives(along(0), along(1))
    }

    fn extraordinary_tangents(&self, sector: &Sector) -> AlongEdges {
        let t = TAU / self.valence() as f64;
        let r = (5.0 + t.cos() + (t / 2.0).cos() * (18.0 + 2.0 * t.cos()).sqrt()) / 16.0;
        let along = |k: f64| {
            let term = |(i, s): (usize, &Sector)| {
                let (here, beyond) = (((i as f64 - k) * t).cos(), ((i as f64 - k + 1.0) * t).cos());
                4.0 * here * s.next + (here + beyond) / (4.0 * r - 1.0) * s.diagonal
            };
            self.ring(sector).enumerate().map(term).sum::<DVec3>()
        };
        AlongEdges::Directions(along(0.0).normalize_or_zero(), along(1.0).normalize_or_zero())
    }

    fn crease_tangents(&self, sector: &Sector) -> AlongEdges {
        let side = match (self.is_sharp(sector.next_edge), self.is_sharp(sector.prev_edge)) {
            (true, false) => self.counter_clockwise(sector).and_then(|second| self.crease_side(sector, second)),
            (false, true) => self.clockwise(sector).and_then(|first| self.crease_side(first, sector)),
            _ => None,
        };
        match side {
            Some((along, across)) if self.is_sharp(sector.next_edge) => AlongEdges::Derivatives(along, across),
            Some((along, across)) => AlongEdges::Derivatives(across, -along),
            None => AlongEdges::Unknown,
        }
    }

    /// Derivatives along and across a crease for its side of two quads: along the edge that leaves `first`, and along
    /// the edge between the quads.
    fn crease_side(&self, first: &Sector, second: &Sector) -> Option<(DVec3, DVec3)> {
        let (v, a, c, b) = (self.position(), first.next, first.prev, second.prev);
        let across = (4.0 * (c - v) + (first.diagonal - a) + (second.diagonal - b)) / 6.0;
        // At a fin, one sharp edge may be both borders of a side, and then the other pulls at the crease from
        // elsewhere.
        let is_whole_side =
            self.is_sharp(first.next_edge) && self.is_sharp(second.prev_edge) && first.next_edge != second.prev_edge;
        is_whole_side.then_some(((a - b) / 2.0, across))
    }

    fn corner_tangents(&self, sector: &Sector) -> AlongEdges {
        if self.is_sharp(sector.next_edge) && self.is_sharp(sector.prev_edge) {
            AlongEdges::Derivatives(sector.next - self.position(), sector.prev - self.position())
        } else {
            AlongEdges::Unknown
        }
    }
}

impl AlongEdges {
    /// From the edges of corner `k` of a cell to u and v; `scale` cells make a patch.
    fn in_parameters(self, k: usize, scale: f64) -> Tangents {
        let turn = |next: DVec3, prev: DVec3| match k {
            0 => (next, prev),
            1 => (-prev, next),
            2 => (-next, -prev),
            _ => (prev, -next),
        };
        match self {
            AlongEdges::Derivatives(next, prev) => {
                let (u, v) = turn(next * scale, prev * scale);
                Tangents::Derivatives(u, v)
            }
            AlongEdges::Directions(next, prev) => {
                let (u, v) = turn(next, prev);
                Tangents::Directions(u, v)
            }
            AlongEdges::Unknown => Tangents::Unknown,
        }
    }
}
