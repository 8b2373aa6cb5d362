//! Where a mesh is under edits, and refining there until the edits have taken effect.

use super::EditTree;
use super::ring::{Context, EditedMesh};
use super::trie::EditTrie;
use crate::ids::{FaceId, PatchId};
use crate::mesh::Edit;
use crate::subdiv::eval::Point;
use crate::subdiv::local::extract;
use crate::subdiv::plan::PlanLibrary;
use crate::subdiv::surface::Lattice;
use crate::topology::{HalfEdges, Topology};
use rustc_hash::{FxHashMap, FxHashSet};

/// The base faces under edits: those that share a vertex with a face that an edit lies in.
#[derive(Default)]
pub(crate) struct EditSites {
    trie: EditTrie,
    faces: FxHashSet<FaceId>,
    /// Half-edges that start at each vertex of `faces`.
    spokes: FxHashMap<u32, Vec<u32>>,
}

impl EditSites {
    pub fn new(edits: &[Edit], topology: &Topology) -> Self {
        let trie = EditTrie::new(edits);
        let touched = vertices(topology, trie.faces());
        let mut sites = EditSites { trie, ..Default::default() };
        if touched.is_empty() {
            return sites;
        }
        let half_edges = 0..topology.n_half_edges() as u32;
        let at_edit = half_edges.clone().filter(|&h| touched.contains(&topology.vertex(h)));
        sites.faces = at_edit.map(|h| FaceId(topology.face(h))).filter(|&f| !topology.is_hidden(f)).collect();
        sites.spokes = vertices(topology, sites.faces.iter().copied()).into_iter().map(|v| (v, Vec::new())).collect();
        for h in half_edges {
            if let Some(spokes) = sites.spokes.get_mut(&topology.vertex(h)) {
                spokes.push(h);
            }
        }
        sites
    }

    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    pub fn contains(&self, face: FaceId) -> bool {
        self.faces.contains(&face)
    }

    /// The trees of all patches under edits, with points in the space of `lattice`, as `control_point` gives them.
    pub fn trees(
        &self,
        mesh_edits: &[Edit],
        topology: &Topology,
        lattice: Lattice,
        library: &mut PlanLibrary,
        control_point: &dyn Fn(u32) -> Point,
        patch_of: impl Fn(FaceId, u32) -> PatchId,
    ) -> FxHashMap<PatchId, EditTree> {
        let cx = Context {
            trie: &self.trie,
            edits: mesh_edits,
            rules: library.rules(),
            lattice,
            outer_tags: library.outer_tags(),
        };
        // In order, so that nodes are numbered alike in every run.
        let mut faces: Vec<FaceId> = self.faces.iter().copied().collect();
        faces.sort_unstable();
        let mut trees = FxHashMap::default();
        for face in faces {
            let ring = EditedMesh::of_base(&cx, topology, face, &self.spokes, control_point);
            if ring.mesh.n_corners() == 4 {
                trees.insert(patch_of(face, 0), tree(&cx, library, &ring));
            } else {
                let patches = ring.quarters(&cx).into_iter().zip(0..);
                trees.extend(patches.map(|(ring, sub)| (patch_of(face, sub), tree(&cx, library, &ring))));
            }
        }
        trees
    }
}

fn vertices(topology: &Topology, faces: impl Iterator<Item = FaceId>) -> FxHashSet<u32> {
    let corners = faces.map(|f| topology.face_corners(f.0));
    corners.flat_map(|(first, n)| first..first + n).map(|h| topology.vertex(h)).collect()
}

fn tree(cx: &Context<'_>, library: &mut PlanLibrary, ring: &EditedMesh) -> EditTree {
    if ring.is_pending(cx.trie) {
        let quarters = ring.quarters(cx);
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| tree(cx, library, &quarters[k]));
        return EditTree::Split(Box::new([a, b, c, d]));
    }
    let part = extract(&ring.mesh, 0, cx.outer_tags);
    let ring = part.sources.iter().map(|&v| ring.points[v as usize]).collect();
    EditTree::Rest { node: library.node(&part.mesh), ring }
}
