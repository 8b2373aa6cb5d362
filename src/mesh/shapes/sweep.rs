//! Bodies swept along a curve: rings of vertices joined by quads, closed by a polygon or a pole at each end.

use super::model::Model;
use super::on_circle;
use glam::DVec3;

/// An ellipse in the body: one ring of vertices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    /// Middle of the ring, in the plane z = 0.
    pub center: [f64; 2],
    /// How far the ring's axis leans from +y towards +x, in radians.
    pub tilt: f64,
    /// Half axes: in the plane z = 0, and along z. A ring with both 0 is a pole; only ends may be poles.
    pub radii: [f64; 2],
    /// Sharpness of the ring's edges.
    pub sharpness: f32,
}

impl Section {
    /// A level circle about the y axis.
    pub fn level(radius: f64, height: f64, sharpness: f32) -> Self {
        Self { center: [0.0, height], tilt: 0.0, radii: [radius, radius], sharpness }
    }

    fn is_pole(&self) -> bool {
        self.radii == [0.0, 0.0]
    }

    /// Vertex `i` of `n`, counter-clockwise about the axis; number 0 lies towards +x if the ring is level.
    fn vertex(&self, i: u32, n: u32) -> DVec3 {
        let unit = on_circle(i, n, 1.0, 0.0);
        let (sin, cos) = self.tilt.sin_cos();
        let along = unit.x * self.radii[0];
        DVec3::new(self.center[0] + along * cos, self.center[1] - along * sin, unit.z * self.radii[1])
    }
}

/// A body of revolution about y from (radius, height, sharpness) triples, from the bottom to the top.
pub(super) fn lathe(profile: &[(f64, f64, f32)], n: u32) -> Model {
    let sections: Vec<_> = profile.iter().map(|&(r, y, s)| Section::level(r, y, s)).collect();
    sweep(&sections, n)
}

/// The body through the sections. Ring k without poles before it has vertices `k * n + i`; the quads between rings k
/// and k + 1 are faces `k * n + i`, with ring vertices i and i + 1. Caps come after the quads, poles after the rings.
pub(super) fn sweep(sections: &[Section], n: u32) -> Model {
    let rings: Vec<_> = sections.iter().filter(|s| !s.is_pole()).collect();
    let mut model = Model::default();
    for ring in &rings {
        model.positions.extend((0..n).map(|i| ring.vertex(i, n)));
    }
    for k in 0..rings.len() as u32 - 1 {
        model.faces.extend((0..n).map(|i| {
            let (a, b) = (k * n + i, k * n + (i + 1) % n);
            vec![a, b, b + n, a + n]
        }));
    }
    let last = (rings.len() as u32 - 1) * n;
    close(&mut model, &sections[0], &(0..n).rev().collect::<Vec<_>>());
    close(&mut model, &sections[sections.len() - 1], &(last..last + n).collect::<Vec<_>>());
    for (k, ring) in rings.iter().enumerate().filter(|(_, ring)| ring.sharpness > 0.0) {
        let k = k as u32 * n;
        (0..n).for_each(|i| model.crease(k + i, k + (i + 1) % n, ring.sharpness));
    }
    model
}

/// Closes the body behind a rim that runs counter-clockwise seen from outside.
fn close(model: &mut Model, end: &Section, rim: &[u32]) {
    if !end.is_pole() {
        model.faces.push(rim.to_vec());
        return;
    }
    let pole = model.positions.len() as u32;
    model.positions.push(DVec3::new(end.center[0], end.center[1], 0.0));
    model.faces.extend((0..rim.len()).map(|i| vec![pole, rim[i], rim[(i + 1) % rim.len()]]));
}

#[cfg(test)]
mod tests {
    use super::super::measure::{Edges, signed_volume};
    use super::*;

    #[test]
    fn lathed_bodies_are_closed_with_polygons_and_with_poles() {
        for profile in [&[(1.0, 0.0, 2.0), (1.0, 1.0, 0.0)][..], &[(0.0, 0.0, 0.0), (1.0, 1.0, 3.0), (0.0, 2.0, 0.0)]] {
            let mesh = lathe(profile, 6).into_mesh();
            assert!(Edges::of(&mesh).closed());
            assert_eq!(Edges::of(&mesh).euler_characteristic(&mesh), 2);
            assert!(signed_volume(&mesh) > 1.0);
            assert_eq!(mesh.creases.len(), 6);
        }
    }

    #[test]
    fn tilted_section_leans_towards_x() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let ring = Section { center: [0.0, 0.0], tilt: quarter, radii: [2.0, 1.0], sharpness: 0.0 };
        assert!((ring.vertex(0, 4) - DVec3::NEG_Y * 2.0).length() < 1e-12);
        assert!((ring.vertex(1, 4) - DVec3::NEG_Z).length() < 1e-12);
    }
}
