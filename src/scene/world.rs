//! Everything about the scene's geometry that stays the same during a render.

use super::accel::{BUILD_BYTES_PER_PATCH, LeafRef, NODE_BYTES, TopLevel};
use super::costs::BuildCosts;
use super::departure::{DepartureCounts, Departures};
use super::description::MeshDescription;
use super::entrance::Entrance;
use super::rate::DicingRate;
use crate::cache::{CacheConfig, SegmentCache, SlotTable, TraceLog};
use crate::error::Result;
use crate::grid::MAX_CELLS;
use crate::ids::{MeshId, PatchId};
use crate::math::{Bounds, DBounds, Plate};
use crate::mesh::ControlMesh;
use crate::parallel::{for_each, for_ranges};
use crate::subdiv::dice::LATTICE_SHIFT;
use crate::subdiv::{Dicer, PatchRates, Surface};
use glam::{DAffine3, DMat3, DVec3};
use parking_lot::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Quarters of an irregular patch that its box and plate look into: more make them tighter, and building slower. With
/// one less, rays look up 1.08 (bigguy) to 1.23 (bishop) times as much at rate 8; with one more, 0.90 on bishop, which
/// takes 1.2 times as long to prepare. (Both before poles went deeper than that.)
const BOX_DEPTH: u32 = 4;

/// Patches whose boxes a thread finds before it asks for more.
const BOXES_PER_TASK: usize = 512;

/// Lattice steps around a mesh's box within which a ray is worth a look: rays are rounded to f32 near the mesh, which
/// moves them by less than 48 steps.
const REACH_MARGIN: f64 = 256.0;

/// Shares of the time that preparing a large mesh takes: half-edges and plans, and the tree at the end.
const SHARE_OF_SURFACE: f64 = 0.35;
const SHARE_OF_TREE: f64 = 0.35;

/// Bytes of the tree over a mesh's patches, for each: a node of 268 bytes for every six to seven of them.
const TREE_BYTES_PER_PATCH: usize = 45;

/// What preparing a mesh takes, its polygons included in the peak only. Estimated from counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildBytes {
    /// What stays.
    pub resident: usize,
    /// Slots of a cache for it.
    pub tables: usize,
    /// The most at any time, the mesh that goes in included.
    pub peak: usize,
}

/// The meshes of a scene, ready to be traced.
#[derive(Debug)]
pub struct World {
    meshes: Vec<WorldMesh>,
    /// Over the meshes' boxes, in the space that `scene_from_world` leads to.
    top: TopLevel,
    scene_from_world: DAffine3,
}

/// One mesh: surface, tree, and where it stands.
#[derive(Debug)]
pub struct WorldMesh {
    surface: Surface,
    top: TopLevel,
    /// The patch of each leaf of `top`, if some patches are hidden.
    visible: Option<Vec<PatchId>>,
    world_from_object: DAffine3,
    lattice_from_world: DAffine3,
    /// Takes normals of object space to world space: what was outside stays outside, whatever the transform mirrors.
    world_from_object_normal: DMat3,
    rate: DicingRate,
    bounds_in_world: DBounds,
    /// Into the top level's box, widened by more than a ray's rounding.
    entrance: Entrance,
    keeps_angles: bool,
    lattice_per_world: f32,
}

/// Who watches while a mesh is prepared.
pub struct Watch<'a> {
    /// Is told which share of the work is done, now and then, from any thread.
    pub progress: &'a (dyn Fn(f64) + Sync),
    /// Is told which share of the plans is made, now and then, and ends the work by an error: how much memory plans
    /// take cannot be told before.
    pub planned: &'a dyn Fn(f64) -> Result<()>,
}

/// What the full tessellation would take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct FullTessellation {
    /// Patches with a surface.
    pub patches: u64,
    /// Triangles.
    pub triangles: u64,
    /// Pieces of at most 8 x 8 cells.
    pub pieces: u64,
    /// Bytes of pieces and nodes, estimated: at the middle vertex format, where most pieces take the small one.
    pub bytes: u64,
}

impl FullTessellation {
    /// More bytes than all of it can take: pieces may need a third more than the middle vertex format, and segments are
    /// not filled to the last byte.
    pub fn most_bytes(&self) -> usize {
        2 * self.bytes as usize + (64 << 20)
    }
}

impl World {
    /// A world of these meshes.
    pub fn new(meshes: Vec<WorldMesh>) -> Self {
        let bounds = meshes.iter().map(|m| m.bounds_in_world).filter(|b| !b.is_empty());
        let all = bounds.fold(DBounds::EMPTY, DBounds::union);
        let scene_from_world = scene_space(all);
        let boxes: Vec<Bounds> = meshes.iter().map(|m| scene_box(scene_from_world, m.bounds_in_world)).collect();
        Self { top: TopLevel::build(&boxes, 1), meshes, scene_from_world }
    }

    /// The meshes, by [`MeshId`].
    pub fn meshes(&self) -> &[WorldMesh] {
        &self.meshes
    }

    /// One mesh.
    #[inline]
    pub fn mesh(&self, id: MeshId) -> &WorldMesh {
        &self.meshes[id.idx()]
    }

    pub(super) fn top(&self) -> &TopLevel {
        &self.top
    }

    pub(super) fn scene_from_world(&self) -> &DAffine3 {
        &self.scene_from_world
    }

    /// Bytes held by meshes, plans and trees.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + self.meshes.iter().map(WorldMesh::bytes).sum::<usize>()
    }

    /// Patches with a surface, of all meshes.
    pub fn n_patches(&self) -> usize {
        self.meshes.iter().map(WorldMesh::n_leaves).sum()
    }

    /// Points of the largest ring around a face.
    pub fn largest_ring(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.surface.plans().largest_ring()).max().unwrap_or(0)
    }

    /// Triangles and bytes if every patch were tessellated.
    pub fn full_tessellation(&self, n_threads: usize) -> FullTessellation {
        self.meshes.iter().map(|m| m.full_tessellation(n_threads)).fold(FullTessellation::default(), |a, b| {
            FullTessellation {
                patches: a.patches + b.patches,
                triangles: a.triangles + b.triangles,
                pieces: a.pieces + b.pieces,
                bytes: a.bytes + b.bytes,
            }
        })
    }
}

/// A space in which the world's box is a cube of 2^22 about the origin: what trees are built in.
fn scene_space(all: DBounds) -> DAffine3 {
    if all.is_empty() {
        return DAffine3::IDENTITY;
    }
    // Where all meshes are one point, the unit is what f64 can tell apart there.
    let least = (all.center().abs().max_element() * f64::EPSILON).max(1e-290);
    let half = (0.5 * (all.max - all.min)).max_element().max(least);
    let scale = 2f64.powi(22 - half.log2().ceil() as i32);
    DAffine3::from_scale(DVec3::splat(scale)) * DAffine3::from_translation(-all.center())
}

/// The box in scene space, rounded outwards to integers.
fn scene_box(scene_from_world: DAffine3, b: DBounds) -> Bounds {
    if b.is_empty() {
        return Bounds { min: glam::Vec3::ZERO, max: glam::Vec3::ZERO };
    }
    let (min, max) = (scene_from_world.transform_point3(b.min), scene_from_world.transform_point3(b.max));
    Bounds { min: (min - 1.0).floor().as_vec3(), max: (max + 1.0).ceil().as_vec3() }
}

/// Whether the map is one scale for all directions and a turn, mirrored or not, but for so little that what is normal
/// to a triangle in one space is so in the other within the margins of horizons and skylines.
fn keeps_angles(map: &DMat3) -> bool {
    let gram = map.transpose() * *map;
    let scale = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    (gram - DMat3::from_diagonal(DVec3::splat(scale))).abs_diff_eq(DMat3::ZERO, 1e-5 * scale)
}

impl WorldMesh {
    /// Prepares a mesh for tracing on `n_threads` threads: plans, boxes and tree, but no grid.
    pub fn new(mesh: ControlMesh, world_from_object: DAffine3, rate: DicingRate, n_threads: usize) -> Result<Self> {
        Self::prepare(mesh, world_from_object, rate, n_threads, &Watch { progress: &|_| (), planned: &|_| Ok(()) })
    }

    /// As [`new`](Self::new), watched.
    pub fn prepare(
        mesh: ControlMesh,
        world_from_object: DAffine3,
        rate: DicingRate,
        n_threads: usize,
        watch: &Watch<'_>,
    ) -> Result<Self> {
        let Watch { progress, planned } = watch;
        let surface = Surface::prepare(&mesh, n_threads, planned)?;
        progress(SHARE_OF_SURFACE);
        // The tree over ten million patches takes a gigabyte to build: polygons and positions are gone before.
        drop(mesh);
        let patches: Vec<PatchId> = surface.visible_patches().collect();
        let (boxes, plates) = patch_boxes(&surface, &patches, n_threads, &|share| {
            progress(SHARE_OF_SURFACE + share * (1.0 - SHARE_OF_SURFACE - SHARE_OF_TREE));
        });
        let lattice = surface.lattice();
        let object_from_world = world_from_object.inverse();
        let lattice_from_object = DAffine3::from_translation(DVec3::splat(LATTICE_SHIFT))
            * DAffine3::from_scale(DVec3::splat(lattice.step.recip()))
            * DAffine3::from_translation(-lattice.center);
        let linear = world_from_object.matrix3;
        let bounds = boxes.iter().fold(Bounds::EMPTY, |a, b| a.union(*b));
        let bounds_in_world = world_box(&surface, world_from_object, bounds);
        let reach = DBounds { min: bounds.min.as_dvec3(), max: bounds.max.as_dvec3() }.expanded(REACH_MARGIN);
        let lattice_from_world = lattice_from_object * object_from_world;
        let top = TopLevel::build(&boxes, n_threads).with_plates(&plates, n_threads);
        progress(1.0);
        let visible = (patches.len() != surface.n_patches()).then_some(patches);
        Ok(Self {
            top,
            visible,
            world_from_object,
            lattice_from_world,
            world_from_object_normal: linear.inverse().transpose(),
            rate,
            bounds_in_world,
            entrance: Entrance::new(&lattice_from_world, reach),
            keeps_angles: keeps_angles(&lattice_from_world.matrix3),
            lattice_per_world: 1.02 * lattice_from_world.matrix3.x_axis.length() as f32,
            surface,
        })
    }

    /// As [`prepare`](Self::prepare), for a mesh of a scene file that has been read.
    pub fn from_description(
        description: &MeshDescription,
        mesh: ControlMesh,
        rate: DicingRate,
        n_threads: usize,
        watch: &Watch<'_>,
    ) -> Result<Self> {
        Self::prepare(mesh, description.world_from_object, rate, n_threads, watch)
            .map_err(|e| e.at(&description.file, None))
    }

    /// Whether the way from the world to the lattice turns right angles into right angles, but for a degree.
    #[inline(always)]
    pub(super) fn keeps_angles(&self) -> bool {
        self.keeps_angles
    }

    /// Lattice steps of a unit of the world's, at most; of meshes whose transforms [keep angles](Self::keeps_angles).
    #[inline(always)]
    pub(super) fn lattice_per_world(&self) -> f32 {
        self.lattice_per_world
    }

    /// The limit surface.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    pub(super) fn top(&self) -> &TopLevel {
        &self.top
    }

    /// Where the mesh stands.
    pub fn world_from_object(&self) -> &DAffine3 {
        &self.world_from_object
    }

    pub(crate) fn lattice_from_world(&self) -> &DAffine3 {
        &self.lattice_from_world
    }

    /// Takes normals of object space to world space, mirrored transforms included, which leave outside what is outside;
    /// lengths are not kept.
    pub fn world_from_object_normal(&self) -> &DMat3 {
        &self.world_from_object_normal
    }

    /// Bounds of the limit surface in world space; empty if there is none.
    pub fn bounds_in_world(&self) -> DBounds {
        self.bounds_in_world
    }

    /// Patches with a surface.
    pub fn n_leaves(&self) -> usize {
        self.visible.as_ref().map_or(self.surface.n_patches(), Vec::len)
    }

    /// The patch of a leaf of the tree.
    #[inline(always)]
    pub(super) fn patch_of_leaf(&self, leaf: PatchId) -> PatchId {
        self.visible.as_ref().map_or(leaf, |ids| ids[leaf.idx()])
    }

    /// Calls `found` for every patch with a surface and a box, in lattice units, that holds it at any rates, but for
    /// those in larger boxes that `enter` turns down.
    pub fn visit_patches(&self, enter: impl FnMut(&Bounds) -> bool, mut found: impl FnMut(PatchId, &Bounds)) {
        self.top.visit(enter, |leaf, bounds| found(self.patch_of_leaf(leaf), bounds));
    }

    /// Calls `enter` for every such patch, and for boxes of several of them, for what is in them if it says so.
    pub(super) fn visit_boxes(&self, mut enter: impl FnMut(Option<LeafRef>, &Bounds) -> bool) {
        self.top.visit_boxes(|leaf, bounds| {
            enter(leaf.map(|leaf| LeafRef { patch: self.patch_of_leaf(leaf.patch), ..leaf }), bounds)
        });
    }

    /// How finely a patch is diced.
    pub fn patch_rates(&self, patch: PatchId) -> PatchRates {
        if let DicingRate::Fixed(n) = self.rate {
            return self.surface.uniform_rates(patch, n);
        }
        let world = |p: DVec3| self.world_from_object.transform_point3(p);
        self.surface.patch_rates(patch, &|a, b| self.rate.edge_rate(world(a), world(b)))
    }

    /// What a ray at this mesh goes through first.
    #[inline(always)]
    pub(super) fn entrance(&self) -> &Entrance {
        &self.entrance
    }

    /// Patches of a mesh, hidden ones included.
    pub fn n_patches_of(mesh: &ControlMesh) -> usize {
        mesh.face_sizes.iter().map(|&n| if n == 4 { 1 } else { n as usize }).sum()
    }

    /// What [`new`](Self::new) will take for this mesh, but for its plans.
    pub fn build_bytes(mesh: &ControlMesh) -> BuildBytes {
        let (corners, vertices) = (mesh.face_vertices.len(), mesh.positions.len());
        let patches = Self::n_patches_of(mesh);
        let mixed = if patches == mesh.n_faces() { 0 } else { mesh.n_faces() + (corners + patches) / 4 };
        let surface = 8 * corners + 12 * vertices + vertices / 8 + 4 * mesh.n_faces() + mixed;
        let tree = TREE_BYTES_PER_PATCH * patches;
        let boxes = (size_of::<PatchId>() + size_of::<Bounds>() + size_of::<Plate>() + BUILD_BYTES_PER_PATCH) * patches;
        // First the pairing of half-edges, beside the polygons; then the tree's, without them.
        let pairing = mesh.bytes() + 4 * (corners + vertices);
        let n_slots = 8 * tree / NODE_BYTES;
        BuildBytes {
            tables: n_slots * 8 + n_slots / 8,
            resident: surface + tree,
            peak: (surface + pairing).max(surface + tree + boxes),
        }
    }

    /// Bytes held, for the whole render.
    pub fn bytes(&self) -> usize {
        let visible = self.visible.as_ref().map_or(0, |v| 4 * v.len());
        self.surface.bytes() + self.top.bytes() + visible
    }

    fn full_tessellation(&self, n_threads: usize) -> FullTessellation {
        let (triangles, pieces, bytes) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
        for_ranges(self.n_leaves(), n_threads, |range| {
            let mut sum = [0; 3];
            for leaf in range {
                let patch = self.patch_of_leaf(PatchId::from(leaf));
                let rates = self.patch_rates(patch);
                let n_pieces = u64::from(rates.n_u.div_ceil(8)) * u64::from(rates.n_v.div_ceil(8));
                sum[0] += rates.n_triangles()
                    - 2 * self.surface.edited().n_hidden_cells(patch, &rates, [0, rates.n_u], [0, rates.n_v]);
                sum[1] += n_pieces;
                sum[2] += full_bytes(&rates, n_pieces);
            }
            for (total, part) in [&triangles, &pieces, &bytes].into_iter().zip(sum) {
                total.fetch_add(part, Ordering::Relaxed);
            }
        });
        FullTessellation {
            patches: self.n_leaves() as u64,
            triangles: triangles.into_inner(),
            pieces: pieces.into_inner(),
            bytes: bytes.into_inner(),
        }
    }
}

/// Bytes of a patch's pieces, three bytes a coordinate, and of the nodes above them.
fn full_bytes(rates: &PatchRates, n_pieces: u64) -> u64 {
    let (n_u, n_v) = (u64::from(rates.n_u), u64::from(rates.n_v));
    let columns = |n: u64| n + n.div_ceil(MAX_CELLS as u64);
    let vertices = 9 * columns(n_u) * columns(n_v);
    let nodes = if n_pieces > 1 { 256 * n_pieces.div_ceil(15) } else { 0 };
    vertices + 160 * n_pieces + nodes
}

/// The boxes of patches, and their plates.
fn patch_boxes(
    surface: &Surface,
    patches: &[PatchId],
    n_threads: usize,
    progress: &(dyn Fn(f64) + Sync),
) -> (Vec<Bounds>, Vec<Plate>) {
    let n_done = AtomicUsize::new(0);
    let (mut boxes, mut plates) = (vec![Bounds::EMPTY; patches.len()], vec![Plate::default(); patches.len()]);
    let chunks = boxes.chunks_mut(BOXES_PER_TASK).zip(plates.chunks_mut(BOXES_PER_TASK));
    let tasks: Vec<_> = chunks.zip(patches.chunks(BOXES_PER_TASK)).map(Mutex::new).collect();
    for_each(&tasks, n_threads, |_, task| {
        let mut dicer = Dicer::default();
        let ((boxes, plates), patches_of_task) = &mut *task.lock();
        for ((bounds, plate), patch) in boxes.iter_mut().zip(plates.iter_mut()).zip(patches_of_task.iter()) {
            let envelope = dicer.patch_envelope(surface, *patch, BOX_DEPTH);
            (*bounds, *plate) = (envelope.bounds, envelope.plate);
        }
        let n_done = n_done.fetch_add(boxes.len(), Ordering::Relaxed) + boxes.len();
        progress(n_done as f64 / patches.len() as f64);
    });
    drop(tasks);
    (boxes, plates)
}

/// The world-space box of a box in lattice units.
fn world_box(surface: &Surface, world_from_object: DAffine3, b: Bounds) -> DBounds {
    let corners = DBounds { min: b.min.as_dvec3(), max: b.max.as_dvec3() }.corners();
    corners.map(|p| world_from_object.transform_point3(surface.object_from_lattice(p))).collect()
}

/// The cache of a world's grids: one slot for each leaf of each mesh's tree.
pub struct GridCache {
    segments: SegmentCache,
    tables: Vec<SlotTable>,
    departures: Departures,
    /// A bit per leaf slot, set when its patch is first asked for.
    touched: Vec<Box<[AtomicU64]>>,
    triangles_built: AtomicU64,
    pieces_built: AtomicU64,
    costs: Mutex<BuildCosts>,
    departure_counts: Mutex<DepartureCounts>,
    trace: Option<TraceLog>,
}

impl GridCache {
    /// An empty cache for `world`.
    pub fn new(world: &World, config: CacheConfig) -> Result<Self> {
        let segments = SegmentCache::new(config)?;
        let n_slots = || world.meshes.iter().map(|m| m.top.n_slots());
        let tables = n_slots().map(|n| segments.table(n)).collect();
        let bits = |n: usize| (0..n.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        Ok(Self {
            tables,
            departures: Departures::new(world.meshes.iter().map(|m| m.surface.n_patches())),
            touched: n_slots().map(bits).collect(),
            triangles_built: AtomicU64::new(0),
            pieces_built: AtomicU64::new(0),
            costs: Mutex::default(),
            departure_counts: Mutex::default(),
            trace: None,
            segments,
        })
    }

    /// Lets all tracers made from now on record the blocks that they ask for.
    pub fn record(&mut self, log: TraceLog) {
        self.trace = Some(log);
    }

    /// What was recorded by tracers that have ended.
    pub fn trace(&self) -> Option<&TraceLog> {
        self.trace.as_ref()
    }

    /// The memory and its counters.
    pub fn segments(&self) -> &SegmentCache {
        &self.segments
    }

    #[inline(always)]
    pub(super) fn table(&self, mesh: MeshId) -> &SlotTable {
        &self.tables[mesh.idx()]
    }

    #[inline(always)]
    pub(super) fn departures(&self) -> &Departures {
        &self.departures
    }

    /// Notes that a leaf's patch was asked for.
    pub(super) fn touch(&self, mesh: MeshId, slot: u32) {
        let word = &self.touched[mesh.idx()][slot as usize / 64];
        let bit = 1 << (slot % 64);
        if word.load(Ordering::Relaxed) & bit == 0 {
            word.fetch_or(bit, Ordering::Relaxed);
        }
    }

    pub(super) fn add_built(&self, pieces: u64, triangles: u64, costs: BuildCosts) {
        self.costs.lock().merge(costs);
        self.pieces_built.fetch_add(pieces, Ordering::Relaxed);
        self.triangles_built.fetch_add(triangles, Ordering::Relaxed);
    }

    pub(super) fn add_departures(&self, counts: DepartureCounts) {
        *self.departure_counts.lock() += counts;
    }

    /// What tracers that have ended know of the rays that left patches.
    pub fn departure_counts(&self) -> DepartureCounts {
        *self.departure_counts.lock()
    }

    /// Blocks built by tracers that have ended, by mesh and patch.
    pub fn costs(&self) -> BuildCosts {
        self.costs.lock().clone()
    }

    /// Triangles of all pieces that tracers built until they ended, rebuilt ones counted again.
    pub fn triangles_built(&self) -> u64 {
        self.triangles_built.load(Ordering::Relaxed)
    }

    /// Pieces that tracers built until they ended, rebuilt ones counted again.
    pub fn pieces_built(&self) -> u64 {
        self.pieces_built.load(Ordering::Relaxed)
    }

    /// Patches that some ray asked for.
    pub fn patches_touched(&self) -> u64 {
        let words = self.touched.iter().flatten();
        words.map(|w| u64::from(w.load(Ordering::Relaxed).count_ones())).sum()
    }

    /// What [`table_bytes`](Self::table_bytes) will be for this world.
    pub fn table_bytes_for(world: &World) -> usize {
        world.meshes.iter().map(|m| m.top.n_slots()).map(|n| 8 * n + 8 * n.div_ceil(64)).sum()
    }

    /// Bytes of what all threads remember of patches that rays leave, for so many patches in all, hidden ones included:
    /// some
    /// 6.5 MiB at most.
    pub fn departure_bytes_for(n_patches: usize) -> usize {
        Departures::bytes_for(n_patches)
    }

    /// Bytes of slots and marks, the arena not included.
    pub fn table_bytes(&self) -> usize {
        self.tables.iter().map(SlotTable::bytes).sum::<usize>()
            + self.touched.iter().map(|t| 8 * t.len()).sum::<usize>()
    }
}
