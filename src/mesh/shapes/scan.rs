//! A knotted body with the irregular mesh of a re-meshed scan: quads and triangles of all sizes, valences 3 to 8.
//!
//! A tube of cells along a knot; each cell is left a quad, cut into triangles, or filled with a smaller quad and four
//! around it, at random. Vertices are shifted along the surface, and lifted by noise.

use super::noise::{Random, fractal_noise, hash};
use crate::ids::VertexId;
use crate::mesh::MeshSink;
use crate::mesh::sink::round;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;
use std::io;

/// A scan of about so many faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scan {
    n_along: u32,
    n_around: u32,
    seed: u64,
}

/// What becomes of a cell of the tube.
#[derive(Clone, Copy, PartialEq)]
enum Cell {
    Quad,
    /// Two triangles; the diagonal starts in corner 0.
    CutFromCorner0,
    /// Two triangles; the diagonal starts in corner 1.
    CutFromCorner1,
    /// A smaller quad and four around it.
    Inset,
}

impl Scan {
    /// Mean number of faces a cell becomes: see [`Scan::cell`].
    const FACES_PER_CELL: f64 = 0.5 + 2.0 * 0.3 + 5.0 * 0.2;

    /// A mesh of about `n_faces` faces.
    pub fn new(n_faces: u64, seed: u64) -> Self {
        // The tube is about ten times as long as it is around.
        let cells = n_faces as f64 / Self::FACES_PER_CELL;
        let n_around = ((cells / 10.0).sqrt() as u32).max(3);
        Self { n_along: ((cells / f64::from(n_around)) as u32).max(12), n_around, seed }
    }

    /// Writes the mesh: vertices of the tube, vertices inside cells, then faces, cell by cell.
    pub fn write(&self, sink: &mut dyn MeshSink) -> io::Result<()> {
        for k in 0..self.n_cells() {
            sink.vertex(self.tube_vertex(k))?;
        }
        for k in (0..self.n_cells()).filter(|&k| self.cell(k) == Cell::Inset) {
            self.inset(k).into_iter().try_for_each(|p| sink.vertex(p))?;
        }
        let mut next_inset = self.n_cells();
        (0..self.n_cells()).try_for_each(|k| self.faces(k, &mut next_inset, sink))
    }

    fn n_cells(&self) -> u32 {
        self.n_along * self.n_around
    }

    fn cell(&self, k: u32) -> Cell {
        match hash(self.seed, u64::from(k), 1) % 100 {
            0..50 => Cell::Quad,
            50..65 => Cell::CutFromCorner0,
            65..80 => Cell::CutFromCorner1,
            _ => Cell::Inset,
        }
    }

    /// The vertices of cell k, counter-clockwise from outside.
    fn corners(&self, k: u32) -> [u32; 4] {
        let (i, j) = (k / self.n_around, k % self.n_around);
        let vertex = |i: u32, j: u32| i % self.n_along * self.n_around + j % self.n_around;
        [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]
    }

    fn faces(&self, k: u32, next_inset: &mut u32, sink: &mut dyn MeshSink) -> io::Result<()> {
        let c = self.corners(k).map(VertexId);
        match self.cell(k) {
            Cell::Quad => sink.face(&c),
            Cell::CutFromCorner0 => sink.face(&[c[0], c[1], c[2]]).and_then(|()| sink.face(&[c[0], c[2], c[3]])),
            Cell::CutFromCorner1 => sink.face(&[c[1], c[2], c[3]]).and_then(|()| sink.face(&[c[1], c[3], c[0]])),
            Cell::Inset => {
                let inner = [0, 1, 2, 3].map(|i| VertexId(*next_inset + i));
                *next_inset += 4;
                sink.face(&inner)?;
                (0..4).try_for_each(|i| sink.face(&[c[i], c[(i + 1) % 4], inner[(i + 1) % 4], inner[i]]))
            }
        }
    }

    /// Vertex k of the tube, shifted by up to a quarter of a cell.
    fn tube_vertex(&self, k: u32) -> DVec3 {
        let mut random = Random::new(self.seed, u64::from(k));
        let shift = DVec2::new(random.within(-0.25, 0.25), random.within(-0.25, 0.25));
        self.surface(self.place(k) + shift)
    }

    /// The corners of the smaller quad in cell k.
    fn inset(&self, k: u32) -> [DVec3; 4] {
        let mut random = Random::new(self.seed ^ 0x1458, u64::from(k));
        let size = random.within(0.15, 0.3);
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        corners.map(|c| self.surface(self.place(k) + DVec2::splat(0.5) + size * DVec2::from_array(c)))
    }

    /// Vertex k before it is shifted, in cells along and around the tube.
    fn place(&self, k: u32) -> DVec2 {
        DVec2::new(f64::from(k / self.n_around), f64::from(k % self.n_around))
    }

    fn surface(&self, place: DVec2) -> DVec3 {
        let along = TAU * place.x / f64::from(self.n_along);
        let around = TAU * place.y / f64::from(self.n_around);
        let center = knot(along);
        let forward = (knot(along + 1e-4) - knot(along - 1e-4)).normalize();
        let side = forward.cross(center).normalize();
        let outwards = around.cos() * side + around.sin() * side.cross(forward);
        let smooth = center + 0.55 * outwards;
        let octaves = (f64::from(self.n_around) / 2.0).max(2.0).log2() as u32;
        round(smooth + 0.12 * fractal_noise(self.seed, 1.7 * smooth, octaves.min(12), 0.5) * outwards)
    }
}

/// The trefoil knot, through an angle of 0 to 2π.
fn knot(t: f64) -> DVec3 {
    let radius = 2.0 + (3.0 * t).cos();
    DVec3::new(radius * (2.0 * t).cos(), (3.0 * t).sin(), radius * (2.0 * t).sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ControlMesh;
    use crate::mesh::shapes::measure::{Edges, signed_volume};

    fn made(n_faces: u64) -> ControlMesh {
        let mut mesh = ControlMesh::default();
        Scan::new(n_faces, 5).write(&mut mesh).unwrap();
        mesh.validate().unwrap();
        mesh
    }

    #[test]
    fn scan_is_a_closed_torus_that_looks_outwards() {
        let mesh = made(2000);
        assert!(Edges::of(&mesh).closed());
        assert_eq!(Edges::of(&mesh).euler_characteristic(&mesh), 0);
        assert!(signed_volume(&mesh) > 1.0);
    }

    #[test]
    fn scan_has_about_as_many_faces_as_asked_and_all_kinds() {
        let mesh = made(20_000);
        assert!(mesh.n_faces().abs_diff(20_000) < 1000, "{}", mesh.n_faces());
        assert!(mesh.face_sizes.contains(&3) && mesh.face_sizes.contains(&4));
        let mut valences = vec![0u32; mesh.positions.len()];
        mesh.face_vertices.iter().for_each(|v| valences[v.idx()] += 1);
        for valence in 3..=8 {
            assert!(valences.contains(&valence), "no vertex of valence {valence}");
        }
    }
}
