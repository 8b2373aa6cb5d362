//! Facts about small meshes, counted the slow and obvious way; for tests.

use crate::mesh::ControlMesh;
use std::collections::{BTreeMap, BTreeSet};

/// How often faces pass each edge upwards (from the smaller vertex id) and downwards.
pub(crate) struct Edges(BTreeMap<(u32, u32), (u32, u32)>);

impl Edges {
    /// Counts the edges of `mesh`.
    pub(crate) fn of(mesh: &ControlMesh) -> Self {
        let mut edges = BTreeMap::new();
        for face in mesh.faces() {
            for (i, a) in face.iter().enumerate() {
                let b = face[(i + 1) % face.len()];
                let passes: &mut (u32, u32) = edges.entry((a.0.min(b.0), a.0.max(b.0))).or_default();
                *(if a.0 < b.0 { &mut passes.0 } else { &mut passes.1 }) += 1;
            }
        }
        Self(edges)
    }

    /// Whether each edge has exactly two faces, which run along it in opposite directions.
    pub(crate) fn closed(&self) -> bool {
        self.0.values().all(|&passes| passes == (1, 1))
    }

    /// Vertices in use - edges + faces.
    pub(crate) fn euler_characteristic(&self, mesh: &ControlMesh) -> i64 {
        let used: BTreeSet<_> = mesh.face_vertices.iter().collect();
        used.len() as i64 - self.0.len() as i64 + mesh.n_faces() as i64
    }
}

/// The volume inside a closed mesh, negative if its faces look inwards.
pub(crate) fn signed_volume(mesh: &ControlMesh) -> f64 {
    let fan = |face: &[crate::ids::VertexId]| {
        let p = |i: usize| mesh.positions[face[i].idx()];
        (1..face.len() - 1).map(|i| p(0).dot(p(i).cross(p(i + 1))) / 6.0).sum::<f64>()
    };
    mesh.faces().map(fan).sum()
}
