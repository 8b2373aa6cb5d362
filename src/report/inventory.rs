//! What a scene consists of and what it needs, before anything is rendered.

use super::quantity::{Bytes, Count, plural};
use crate::mesh::ControlMesh;
use crate::scene::world::{FullTessellation, World, WorldMesh};
use crate::topology::{HalfEdges, MeshCounts, NONE, Topology};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

/// Everything `lazytess info` tells.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Inventory {
    /// The path as the user gave it.
    pub input: String,
    /// Meshes.
    pub meshes: usize,
    /// Control faces by their number of sides.
    pub faces_by_sides: BTreeMap<u32, usize>,
    /// Faces of all control meshes.
    pub faces: usize,
    /// Vertices of all control meshes.
    pub vertices: usize,
    /// Vertices by the number of edges that meet there; on a non-manifold edge the side of each face counts.
    pub valences: BTreeMap<u32, usize>,
    /// Subdivision tags.
    pub tags: Tags,
    /// Borders and irregular places.
    pub topology: MeshCounts,
    /// Patches with a surface.
    pub patches: u64,
    /// Plans: how the surface over a 1-ring is found, shared by all faces with equal rings; regular faces need none.
    pub plans: usize,
    /// Bytes that stay for the whole render.
    pub resident: Resident,
    /// What tessellating everything at the given rate would give.
    pub full: FullTessellation,
    /// How large a cache to use.
    pub cache: CacheAdvice,
}

/// Subdivision tags as the files have them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Tags {
    /// Sharp edges.
    pub creases: usize,
    /// Sharp vertices.
    pub corners: usize,
    /// Faces without surface.
    pub holes: usize,
    /// Hierarchical edits.
    pub edits: usize,
}

/// Resident bytes by part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Resident {
    /// Half-edges, sharpness and the like.
    pub topology: usize,
    /// Positions of control vertices.
    pub control_points: usize,
    /// The plan library.
    pub plans: usize,
    /// Which plan and which patches a face has, and the trees over patches and meshes.
    pub patches_and_trees: usize,
    /// A slot of the cache for each lane of the trees over patches.
    pub slots: usize,
    /// All of it.
    pub total: usize,
    /// All of it by the number of control faces.
    pub per_face: f64,
}

/// A cache size and why.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CacheAdvice {
    /// Size in bytes.
    pub bytes: u64,
    /// Why not more and not less.
    pub reason: String,
}

impl Inventory {
    /// Adds what only the control mesh knows.
    pub fn add_control_mesh(&mut self, mesh: &ControlMesh) {
        self.faces += mesh.n_faces();
        self.vertices += mesh.positions.len();
        for &sides in &mesh.face_sizes {
            *self.faces_by_sides.entry(sides).or_default() += 1;
        }
        self.tags.creases += mesh.creases.len();
        self.tags.corners += mesh.corners.len();
        self.tags.holes += mesh.holes.len();
        self.tags.edits += mesh.edits.len();
    }

    /// Adds what the compiled world knows; `slot_bytes` is what its cache keeps beside the blocks.
    pub fn add_world(&mut self, world: &World, slot_bytes: usize, n_threads: usize) {
        self.meshes = world.meshes().len();
        world.meshes().iter().for_each(|mesh| self.add_mesh(mesh));
        self.full = world.full_tessellation(n_threads);
        self.patches = self.full.patches;
        let r = &mut self.resident;
        r.slots = slot_bytes;
        r.total = world.bytes() + slot_bytes;
        r.patches_and_trees = world.bytes() - r.topology - r.control_points - r.plans;
        r.per_face = r.total as f64 / self.faces.max(1) as f64;
    }

    fn add_mesh(&mut self, mesh: &WorldMesh) {
        let (surface, topology) = (mesh.surface(), mesh.surface().topology());
        self.plans += surface.plans().len();
        self.resident.topology += topology.bytes();
        self.resident.control_points += surface.control_bytes();
        self.resident.plans += surface.plans().bytes();
        self.topology = sum(&self.topology, &topology.counts());
        for valence in valences(topology) {
            *self.valences.entry(valence).or_default() += 1;
        }
    }
}

fn sum(a: &MeshCounts, b: &MeshCounts) -> MeshCounts {
    MeshCounts {
        boundary_edges: a.boundary_edges + b.boundary_edges,
        nonmanifold_edges: a.nonmanifold_edges + b.nonmanifold_edges,
        nonmanifold_vertices: a.nonmanifold_vertices + b.nonmanifold_vertices,
        hidden_faces: a.hidden_faces + b.hidden_faces,
        creased_edges: a.creased_edges + b.creased_edges,
        idle_creases: a.idle_creases + b.idle_creases,
    }
}

/// The number of edges at each vertex.
fn valences(topology: &Topology) -> Vec<u32> {
    let mut valences = vec![0; topology.n_vertices()];
    for h in 0..topology.n_half_edges() as u32 {
        let twin = topology.twin(h);
        // An edge of three faces and more has no twins, and one owner.
        let is_counted_here = if twin == NONE { topology.edge_owner(h) == h } else { h < twin };
        if is_counted_here {
            valences[topology.vertex(h) as usize] += 1;
            valences[topology.vertex(topology.next(h)) as usize] += 1;
        }
    }
    valences
}

impl CacheAdvice {
    /// For a picture of `pixels` pixels on a machine with `available` bytes to spare.
    ///
    /// The smallest of three sizes: that of all blocks; that of one piece for each pixel, about what primary rays touch
    /// at most, and as much again for others; half the memory to spare.
    pub fn new(full: &FullTessellation, pixels: u64, available: Option<u64>) -> Self {
        // Blocks may need a third more than the middle vertex format.
        let all = full.bytes + full.bytes / 3;
        let per_piece = all / full.pieces.max(1);
        let reasons = [
            (all, "all grids fit, so none is ever built twice"),
            (2 * pixels * per_piece, "two grid pieces for each pixel: rays of one picture hardly touch more"),
            (available.map_or(u64::MAX, |b| b / 2), "half of the memory that is free now"),
        ];
        let (bytes, reason) = reasons.into_iter().min_by_key(|(bytes, _)| *bytes).expect("three reasons");
        Self { bytes: bytes.next_multiple_of(1 << 20).max(1 << 20), reason: reason.to_owned() }
    }
}

impl Display for Inventory {
    /// A line for each subject, for a terminal; with a line end.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write_mesh(f)?;
        self.write_topology(f)?;
        self.write_bytes(f)
    }
}

impl Inventory {
    fn write_mesh(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let meshes = if self.meshes == 1 { "1 mesh".to_owned() } else { format!("{} meshes", self.meshes) };
        writeln!(f, "input     {}: {meshes}", self.input)?;
        writeln!(f, "faces     {}; by sides {}", Count(self.faces as u64), histogram(&self.faces_by_sides))?;
        writeln!(f, "vertices  {}; by valence {}", Count(self.vertices as u64), histogram(&self.valences))?;
        let plans = plural(self.plans as u64, "plan");
        writeln!(f, "patches   {}, those that are not regular in {plans}", Count(self.patches))
    }

    fn write_topology(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (tags, t) = (&self.tags, &self.topology);
        let list = [(tags.creases, "crease"), (tags.corners, "corner"), (tags.holes, "hole"), (tags.edits, "edit")];
        let list: Vec<String> = list.iter().map(|(n, what)| plural(*n as u64, what)).collect();
        writeln!(f, "tags      {}", list.join(", "))?;
        let edges = plural(t.boundary_edges as u64, "boundary edge");
        let odd = (plural(t.nonmanifold_edges as u64, "edge"), Count(t.nonmanifold_vertices as u64));
        let hidden = plural(t.hidden_faces as u64, "face");
        writeln!(f, "topology  {edges}, {} and {} vertices not manifold, {hidden} without surface", odd.0, odd.1)
    }

    fn write_bytes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (r, full) = (&self.resident, &self.full);
        let parts = [
            (r.topology, "topology"),
            (r.control_points, "control points"),
            (r.plans, "plans"),
            (r.patches_and_trees, "patches and trees"),
            (r.slots, "cache slots"),
        ];
        let parts: Vec<_> = parts.iter().map(|(bytes, name)| format!("{name} {}", Bytes(*bytes as u64))).collect();
        writeln!(f, "resident  {} ({:.0} bytes a face): {}", Bytes(r.total as u64), r.per_face, parts.join(", "))?;
        let (triangles, pieces) = (Count(full.triangles), Count(full.pieces));
        writeln!(f, "in full   {triangles} triangles in {pieces} grid pieces, about {}", Bytes(full.bytes))?;
        writeln!(f, "cache     {} recommended: {}", Bytes(self.cache.bytes), self.cache.reason)
    }
}

/// `3: 8, 4: 1,200`; long ones are cut to the ends, since what is extreme is what one looks for.
fn histogram(counts: &BTreeMap<u32, usize>) -> String {
    let all: Vec<String> = counts.iter().map(|(k, n)| format!("{k}: {}", Count(*n as u64))).collect();
    if all.len() <= 12 {
        return all.join(", ");
    }
    format!("{}, ..., {}", all[..8].join(", "), all[all.len() - 3..].join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::VertexId;
    use crate::mesh::{Crease, shapes};
    use crate::scene::rate::DicingRate;
    use glam::DAffine3;

    fn inventory(mesh: ControlMesh) -> Inventory {
        let mut inventory = Inventory { input: "m.obj".into(), ..Default::default() };
        inventory.add_control_mesh(&mesh);
        let mesh = WorldMesh::new(mesh, DAffine3::IDENTITY, DicingRate::Fixed(16), 1).unwrap();
        inventory.add_world(&World::new(vec![mesh]), 1000, 1);
        inventory.cache = CacheAdvice::new(&inventory.full, 480_000, None);
        inventory
    }

    #[test]
    fn a_cube_is_told_as_it_is() {
        let cube = inventory(shapes::cube());
        assert_eq!(cube.valences, BTreeMap::from([(3, 8)]));
        assert_eq!(cube.faces_by_sides, BTreeMap::from([(4, 6)]));
        assert_eq!((cube.patches, cube.full.triangles, cube.full.pieces), (6, 6 * 512, 24));
        let r = cube.resident;
        assert_eq!(r.total, r.topology + r.control_points + r.plans + r.patches_and_trees + r.slots);
        let text = cube.to_string();
        assert!(text.contains("faces     6; by sides 4: 6\n") && text.contains("8; by valence 3: 8\n"), "{text}");
        assert!(text.contains("3,072 triangles in 24 grid pieces"), "{text}");
    }

    #[test]
    fn an_edge_of_three_faces_counts_once() {
        let positions = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [0, 0, 1], [1, -1, 0], [0, -1, 0]];
        let positions = positions.map(|p| glam::IVec3::from_array(p).as_dvec3()).to_vec();
        let pages = [vec![0, 1, 2, 3], vec![0, 1, 4, 5], vec![0, 1, 6, 7]];
        let book = inventory(crate::mesh::ControlMesh::from_polygons(positions, &pages).unwrap());
        assert_eq!(book.topology.nonmanifold_edges, 1);
        assert_eq!(book.valences, BTreeMap::from([(2, 6), (4, 2)]));
    }

    #[test]
    fn borders_and_tags_are_counted() {
        let sheet = inventory(shapes::plane(3, 2));
        assert_eq!(sheet.topology.boundary_edges, 10);
        assert_eq!(sheet.valences, BTreeMap::from([(2, 4), (3, 6), (4, 2)]));
        let cube = inventory(shapes::crease_cube(2.0));
        assert!(cube.tags.creases > 0 && cube.topology.creased_edges == cube.tags.creases);
        let mut mesh = shapes::crease_cube(2.0);
        mesh.creases.push(Crease { edge: [VertexId(3); 2], sharpness: 1.0 });
        let counts = inventory(mesh).topology;
        assert_eq!((counts.creased_edges, counts.idle_creases), (cube.topology.creased_edges, 1));
    }

    #[test]
    fn recommended_cache_is_the_smallest_that_makes_sense() {
        let full = |pieces| FullTessellation { patches: 1, triangles: 128 * pieces, pieces, bytes: 900 * pieces };
        let advice = |pieces, available| CacheAdvice::new(&full(pieces), 1000, available);
        assert_eq!(advice(10, None).bytes, 1 << 20);
        assert!(advice(10, None).reason.contains("none is ever built twice"));
        assert_eq!(advice(10_000_000, Some(1 << 40)).bytes, 3 << 20);
        assert!(advice(10_000_000, Some(1 << 40)).reason.contains("for each pixel"));
        assert_eq!(advice(10_000_000, Some(2 << 20)).bytes, 1 << 20);
    }

    #[test]
    fn long_histograms_keep_their_ends() {
        let counts = (3..100).map(|valence| (valence, 1)).collect();
        assert_eq!(histogram(&counts), "3: 1, 4: 1, 5: 1, 6: 1, 7: 1, 8: 1, 9: 1, 10: 1, ..., 97: 1, 98: 1, 99: 1");
    }
}
