//! Mountains on a square of quads, of any size: a control mesh as dense as a displaced ground.

use super::noise::fractal_noise;
use crate::ids::VertexId;
use crate::mesh::MeshSink;
use crate::mesh::sink::round;
use glam::DVec3;
use std::io;

/// A landscape of `n` x `n` quads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Quads along a side, at least 1.
    pub n: u32,
    /// Another number, another landscape.
    pub seed: u64,
}

impl Ground {
    /// Length of a side; the middle is the origin.
    pub const SIZE: f64 = 100.0;

    /// Number of faces.
    pub fn n_faces(&self) -> u64 {
        u64::from(self.n) * u64::from(self.n)
    }

    /// Writes the mesh row by row.
    pub fn write(&self, sink: &mut dyn MeshSink) -> io::Result<()> {
        let row = self.n + 1;
        for k in 0..row * row {
            sink.vertex(self.vertex(k % row, k / row))?;
        }
        for k in 0..self.n * self.n {
            let v = k % self.n + k / self.n * row;
            sink.face(&[v, v + row, v + row + 1, v + 1].map(VertexId))?;
        }
        Ok(())
    }

    fn vertex(&self, i: u32, j: u32) -> DVec3 {
        let along = |k: u32| Self::SIZE * (f64::from(k) / f64::from(self.n) - 0.5);
        let (x, z) = (along(i), along(j));
        round(DVec3::new(x, self.height(x, z), z))
    }

    /// Ridges where mountains stand, gentle hills elsewhere, and small bumps everywhere.
    fn height(&self, x: f64, z: f64) -> f64 {
        // The finest octave spans two quads; anything finer would only be noise from vertex to vertex.
        let octaves = (f64::from(self.n) / 4.0).max(2.0).log2() as u32;
        let at = |scale: f64, y: f64| DVec3::new(x / scale, y, z / scale);
        let hills = fractal_noise(self.seed, at(40.0, 0.5), octaves.min(14), 0.5);
        let ridges = 1.0 - fractal_noise(self.seed ^ 0xa1, at(25.0, 0.25), octaves.min(14), 0.48).abs();
        let mountains = (2.0 * fractal_noise(self.seed ^ 0xb2, at(60.0, 0.75), 2, 0.5) + 0.35).clamp(0.0, 1.0);
        2.0 * hills + 10.0 * mountains * ridges * ridges
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ControlMesh;
    use crate::mesh::shapes::measure::Edges;

    fn made(ground: Ground) -> ControlMesh {
        let mut mesh = ControlMesh::default();
        ground.write(&mut mesh).unwrap();
        mesh.validate().unwrap();
        mesh
    }

    #[test]
    fn ground_is_a_disc_of_quads_that_looks_up() {
        let ground = Ground { n: 20, seed: 1 };
        let mesh = made(ground);
        assert_eq!(mesh.n_faces() as u64, ground.n_faces());
        assert_eq!(Edges::of(&mesh).euler_characteristic(&mesh), 1);
        let face = mesh.faces().next().unwrap();
        let p = |i: usize| mesh.positions[face[i].idx()];
        assert!((p(1) - p(0)).cross(p(3) - p(0)).y > 0.0);
    }

    #[test]
    fn seed_decides_the_landscape() {
        let heights = |seed| made(Ground { n: 8, seed }).positions;
        assert_eq!(heights(1), heights(1));
        assert_ne!(heights(1), heights(2));
    }

    #[test]
    fn finer_ground_is_the_same_landscape() {
        let coarse = made(Ground { n: 64, seed: 3 });
        let fine = made(Ground { n: 128, seed: 3 });
        let apart = (coarse.positions[32 * 65 + 32] - fine.positions[64 * 129 + 64]).length();
        assert!(apart < 0.5, "{apart}");
        assert!(fine.bounds().max.y - fine.bounds().min.y > 5.0);
    }
}
