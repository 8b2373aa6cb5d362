//! The lazy tracer: the one place where trees, plans, cache and grids meet.
//!
//! A ray walks a mesh's tree to a **leaf**, a patch. The leaf's slot leads to a block: a piece if the patch has at most
//! 8 x 8 cells, else a node whose children are nodes or pieces in their turn. A block that is missing is built on the
//! spot, so nothing is tessellated but what a ray reaches.

use super::accel::TraversalStack;
use super::batch::{BatchOrder, MOST_RAYS};
use super::costs::BuildCosts;
use super::world::{GridCache, World, WorldMesh};
use crate::cache::{Block, BlockLayout, Claim, Pin, Recorder, Slot, SlotId, TraceLog, Visit};
use crate::grid::{
    CellRect, LaneHits, LatticeHit, LatticeRay, MAX_CELLS, NODE_BYTES, NodeView, PieceLayout, PieceView, TriangleId,
    encode_node, is_node,
};
use crate::ids::{MeshId, PatchId};
use crate::math::LatticeGrid;
use crate::math::simd::{self, Best, Kernel, Task};
use crate::math::{Bounds, DBounds, Hit, Intersect, OnTriangle, PrimitiveRef, Ray};
use crate::subdiv::{Dicer, PatchRates};
use glam::DVec3;

/// Children of a node along u and v.
const NODE_SIDE: u32 = 4;

/// Quarters towards an irregular corner that a node's child boxes look into, below the child's own size.
const CHILD_BOX_DEPTH: u32 = 3;

/// Patches whose rates a builder remembers.
const N_RATES: usize = 16;

/// One thread's access to the scene's geometry.
///
/// Rays that are near each other need the same blocks. Where the caller has many rays in no such order, a batch finds one:
///
/// ```
/// use glam::{DAffine3, DVec3};
/// use lazytess::cache::CacheConfig;
/// use lazytess::math::{Intersect, Ray};
/// use lazytess::mesh::shapes;
/// use lazytess::scene::intersect::Intersector;
/// use lazytess::scene::rate::DicingRate;
/// use lazytess::scene::world::{GridCache, World, WorldMesh};
///
/// let (_, mesh) = shapes::all().into_iter().next().expect("a shape");
/// let world = World::new(vec![WorldMesh::new(mesh, DAffine3::IDENTITY, DicingRate::Fixed(8), 1)?]);
/// let cache = GridCache::new(&world, CacheConfig::with_bytes(1 << 20))?;
/// let center = world.meshes()[0].bounds_in_world().center();
/// let rays = [DVec3::X, DVec3::Y, DVec3::Z].map(|from| Ray::new(center + 100.0 * from, -from));
///
/// let mut tracer = Intersector::new(&world, &cache);
/// let mut hits = [None; 3];
/// tracer.closest_batch(&rays, &mut hits);
/// assert_eq!(hits.map(|hit| hit.map(|h| h.t)), rays.map(|ray| tracer.closest(&ray).map(|h| h.t)));
/// # Ok::<(), lazytess::Error>(())
/// ```
pub struct Intersector<'w> {
    world: &'w World,
    cache: &'w GridCache,
    pin: Pin<'w>,
    builder: Builder<'w>,
    /// Remembers other patches than the builder's: those that shading asks about.
    shading: Dicer,
    stacks: Stacks,
    order: BatchOrder,
    kernel: Best,
}

/// What building a block needs.
#[derive(Default)]
struct Builder<'w> {
    dicer: Dicer,
    vertices: LatticeGrid,
    boxes: Vec<Bounds>,
    n_built: u64,
    n_pieces: u64,
    n_triangles: u64,
    costs: BuildCosts,
    /// Rates of the last patches, one for each remainder of patch numbers.
    rates: [Option<(MeshId, PatchId, PatchRates)>; N_RATES],
    /// Notes every block that is asked for, if the cache wants to know.
    recorder: Option<Recorder<'w>>,
}

#[derive(Default)]
struct Stacks {
    scene: TraversalStack,
    mesh: TraversalStack,
}

/// A patch about to be traversed.
#[derive(Clone, Copy)]
struct PatchContext<'a> {
    id: MeshId,
    mesh: &'a WorldMesh,
    patch: PatchId,
}

/// The side of a node's children in cells: 8, or as many times 4 that as leave at most 4 children a side.
fn child_side(cells: CellRect) -> u32 {
    let longest = cells.size().into_iter().max().expect("two sides") as u32;
    let mut side = MAX_CELLS as u32;
    while longest > NODE_SIDE * side {
        side *= NODE_SIDE;
    }
    side
}

/// Cells of child (a, b) of a node.
fn child_cells(parent: CellRect, side: u32, a: u32, b: u32) -> CellRect {
    let (i0, j0) = (u32::from(parent.i0) + a * side, u32::from(parent.j0) + b * side);
    CellRect {
        i0: i0 as u16,
        j0: j0 as u16,
        i1: (i0 + side).min(u32::from(parent.i1)) as u16,
        j1: (j0 + side).min(u32::from(parent.j1)) as u16,
    }
}

impl Builder<'_> {
    /// Builds the block over these cells, or over the whole patch.
    #[cold]
    #[inline(never)]
    fn build<'v>(
        &mut self,
        visit: &'v Visit<'_>,
        slot: Slot<'v>,
        of: PatchContext<'_>,
        cells: Option<CellRect>,
    ) -> Block<'v> {
        let ticket = match visit.claim(slot) {
            Claim::Ready(block) => return block,
            Claim::Build(ticket) => ticket,
        };
        self.n_built += 1;
        self.costs.add(of.id, of.patch, 1);
        let rates = self.rates(of);
        let cells = cells.unwrap_or(CellRect { i0: 0, j0: 0, i1: rates.n_u as u16, j1: rates.n_v as u16 });
        let (i, j) = ([u32::from(cells.i0), u32::from(cells.i1)], [u32::from(cells.j0), u32::from(cells.j1)]);
        if cells.size().iter().all(|&n| n <= MAX_CELLS) {
            self.dicer.dice(of.mesh.surface(), of.patch, &rates, i, j, &mut self.vertices);
            self.n_pieces += 1;
            self.n_triangles += 2 * cells.size().iter().product::<usize>() as u64;
            let layout = PieceLayout::new(&self.vertices, cells, [rates.n_u as u16, rates.n_v as u16]);
            let vertices = &self.vertices;
            return ticket
                .publish(BlockLayout { bytes: layout.bytes(), children: 0 }, |out| layout.encode(vertices, out));
        }
        let children = self.child_boxes(of, &rates, cells);
        let n_slots = (NODE_SIDE * u32::from(children[1] - 1)) as usize + usize::from(children[0]);
        let boxes = &self.boxes;
        ticket.publish(BlockLayout { bytes: NODE_BYTES, children: n_slots }, |out| {
            encode_node(cells, children, boxes, out);
        })
    }

    /// How finely a patch is diced: the same for its node and all its pieces.
    fn rates(&mut self, of: PatchContext<'_>) -> PatchRates {
        let remembered = &mut self.rates[of.patch.idx() % N_RATES];
        match remembered {
            Some((mesh, patch, rates)) if (*mesh, *patch) == (of.id, of.patch) => *rates,
            _ => remembered.insert((of.id, of.patch, of.mesh.patch_rates(of.patch))).2,
        }
    }

    /// Puts the boxes of a node's children into `self.boxes`; returns their number along u and v.
    fn child_boxes(&mut self, of: PatchContext<'_>, rates: &PatchRates, cells: CellRect) -> [u8; 2] {
        let side = child_side(cells);
        let [n_u, n_v] = cells.size().map(|n| (n as u32).div_ceil(side));
        // A child's cells are a part of the patch: as many splits lead to a quarter of its size.
        let depth = (rates.n_u.max(rates.n_v) / side).max(1).ilog2() + CHILD_BOX_DEPTH;
        self.boxes.clear();
        for b in 0..n_v {
            for a in 0..n_u {
                let c = child_cells(cells, side, a, b);
                let (i, j) = ([u32::from(c.i0), u32::from(c.i1)], [u32::from(c.j0), u32::from(c.j1)]);
                let surface = of.mesh.surface();
                self.boxes.push(match surface.edited().hide_cells(of.patch, rates, i, j) {
                    true => Bounds::EMPTY,
                    false => self.dicer.bounds(surface, of.patch, rates, i, j, depth),
                });
            }
        }
        [n_u as u8, n_v as u8]
    }

    /// Builds the block over these cells, or over the whole patch, and those below it, as far as they are missing.
    fn complete<'v>(&mut self, visit: &'v Visit<'_>, slot: Slot<'v>, of: PatchContext<'_>, cells: Option<CellRect>) {
        let block = visit.get(slot).unwrap_or_else(|| self.build(visit, slot, of, cells));
        if !is_node(block.bytes()) {
            return;
        }
        let cells = NodeView::new(block.bytes()).cells();
        let side = child_side(cells);
        let [n_u, n_v] = cells.size().map(|n| (n as u32).div_ceil(side));
        for (b, a) in (0..n_v).flat_map(|b| (0..n_u).map(move |a| (b, a))) {
            let c = child_cells(cells, side, a, b);
            let (i, j) = ([u32::from(c.i0), u32::from(c.i1)], [u32::from(c.j0), u32::from(c.j1)]);
            let surface = of.mesh.surface();
            if !surface.edited().hide_cells(of.patch, &of.mesh.patch_rates(of.patch), i, j) {
                self.complete(visit, block.child((b * NODE_SIDE + a) as usize), of, Some(c));
            }
        }
    }

    /// Builds the first block of a patch.
    #[cold]
    #[inline(never)]
    fn build_root<'v>(
        &mut self,
        visit: &'v Visit<'_>,
        slot: Slot<'v>,
        of: PatchContext<'_>,
        cache: &GridCache,
        leaf_slot: u32,
    ) -> Block<'v> {
        cache.touch(of.id, leaf_slot);
        self.build(visit, slot, of, None)
    }

    #[inline(always)]
    fn note_root(&mut self, of: PatchContext<'_>, leaf_slot: u32, block: Block<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.root(name_of(of.id, leaf_slot), block);
        }
    }

    #[inline(always)]
    fn note_child(&mut self, level: usize, lane: usize, block: Block<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.child(level, lane, block);
        }
    }
}

/// One number for a slot of any mesh.
fn name_of(mesh: MeshId, slot: u32) -> u64 {
    u64::from(mesh.0) << 32 | u64::from(slot)
}

/// A node on the way down a patch, and which of its children are still to be seen.
struct Level<'v> {
    block: Block<'v>,
    cells: CellRect,
    side: u32,
    hits: LaneHits,
}

/// Levels of nodes above a piece: 8 * 4^5 cells are more than [`crate::subdiv::dice::MAX_RATE`].
const MAX_LEVELS: usize = 5;

impl<'v> Level<'v> {
    #[inline(always)]
    fn new<K: Kernel>(kernel: K, visit: &Visit<'_>, block: Block<'v>, ray: &LatticeRay, t_max: f32) -> Self {
        let node = NodeView::new(block.bytes());
        let cells = node.cells();
        let hits = node.test(kernel, ray, t_max);
        let mut lanes = hits.mask;
        while lanes != 0 {
            visit.prefetch(block.child(lanes.trailing_zeros() as usize));
            lanes &= lanes - 1;
        }
        Self { block, cells, side: child_side(cells), hits }
    }

    #[inline(always)]
    fn child(&self, lane: usize) -> (Slot<'v>, CellRect) {
        let (a, b) = (lane as u32 % NODE_SIDE, lane as u32 / NODE_SIDE);
        (self.block.child(lane), child_cells(self.cells, self.side, a, b))
    }
}

/// The ray as the mesh's lattice sees it. `t` keeps its meaning.
#[inline(always)]
fn lattice_ray([origin, direction]: [DVec3; 2], id: MeshId, ray: &Ray, t_max: f32) -> LatticeRay {
    let skip = match ray.from {
        Some(from) if from.mesh == id => triangle_id(&from),
        _ => TriangleId::NONE,
    };
    LatticeRay::new(origin, direction, t_max, skip)
}

struct ClosestInMesh<'a, 'w> {
    tracer: &'a mut Intersector<'w>,
    mesh: MeshId,
    ray: &'a Ray,
    t_max: f32,
}

impl Task for ClosestInMesh<'_, '_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Option<Hit> {
        let Self { tracer, mesh: id, ray, t_max } = self;
        let Intersector { world, cache, pin, builder, stacks, .. } = tracer;
        let mesh = world.mesh(id);
        let entering = mesh.entrance().ray_in_reach(kernel, ray)?;
        let ray = &lattice_ray(entering, id, ray, t_max);
        let hit = &mut LatticeHit::none(ray.t_max());
        let table = cache.table(id);
        let visit = &pin.visit();
        let mut walk = mesh.top().walk(&mut stacks.mesh);
        while let Some(leaf) = walk.nearest(kernel, ray, hit.t, |slot| visit.prefetch(visit.root(table, SlotId(slot))))
        {
            let of = PatchContext { id, mesh, patch: mesh.patch_of_leaf(leaf.patch) };
            let slot = visit.root(table, SlotId(leaf.slot));
            if let Some(root) = visit.get(slot) {
                builder.note_root(of, leaf.slot, root);
                ClosestInPatch { builder, visit, root, of, ray, hit }.run(kernel);
            } else {
                // Apart, so that a block that is there stays in registers.
                let root = builder.build_root(visit, slot, of, cache, leaf.slot);
                builder.note_root(of, leaf.slot, root);
                kernel.enter(ClosestInPatch { builder, visit, root, of, ray, hit });
            }
        }
        hit.is_some().then(|| hit_of(mesh, id, ray.caller_t(hit.t), hit))
    }
}

struct ClosestInPatch<'a, 'v, 'p, 'w> {
    builder: &'a mut Builder<'w>,
    visit: &'v Visit<'p>,
    root: Block<'v>,
    of: PatchContext<'a>,
    ray: &'a LatticeRay,
    hit: &'a mut LatticeHit,
}

impl Task for ClosestInPatch<'_, '_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        let Self { builder, visit, root, of, ray, hit } = self;
        if !is_node(root.bytes()) {
            PieceView::new(root.bytes()).closest(kernel, ray, of.patch, hit);
            return;
        }
        let mut levels: [Option<Level<'_>>; MAX_LEVELS] = Default::default();
        levels[0] = Some(Level::new(kernel, visit, root, ray, hit.t));
        let mut depth = 0;
        while let Some(level) = &mut levels[depth] {
            let Some(lane) = level.hits.pop_nearest(hit.t) else {
                if depth == 0 {
                    break;
                }
                depth -= 1;
                continue;
            };
            let (slot, cells) = level.child(lane);
            if let Some(block) = visit.get(slot) {
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(Level::new(kernel, visit, block, ray, hit.t));
                } else {
                    PieceView::new(block.bytes()).closest(kernel, ray, of.patch, hit);
                }
            } else {
                let block = builder.build(visit, slot, of, Some(cells));
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(kernel.enter(OpenLevel { visit, block, ray, t_max: hit.t }));
                } else {
                    kernel.enter(ClosestInPiece { block, patch: of.patch, ray, hit });
                }
            }
        }
    }
}

struct OccludedInMesh<'a, 'w> {
    tracer: &'a mut Intersector<'w>,
    mesh: MeshId,
    ray: &'a Ray,
}

impl Task for OccludedInMesh<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        let Self { tracer, mesh: id, ray } = self;
        let Intersector { world, cache, pin, builder, stacks, .. } = tracer;
        let mesh = world.mesh(id);
        let Some(entering) = mesh.entrance().ray_in_reach(kernel, ray) else { return false };
        let ray = &lattice_ray(entering, id, ray, ray.t_max);
        let table = cache.table(id);
        let visit = &pin.visit();
        let mut walk = mesh.top().walk(&mut stacks.mesh);
        while let Some(leaf) = walk.any(kernel, ray, |slot| visit.prefetch(visit.root(table, SlotId(slot)))) {
            let of = PatchContext { id, mesh, patch: mesh.patch_of_leaf(leaf.patch) };
            let slot = visit.root(table, SlotId(leaf.slot));
            let is_hit = if let Some(root) = visit.get(slot) {
                builder.note_root(of, leaf.slot, root);
                OccludedInPatch { builder, visit, root, of, ray }.run(kernel)
            } else {
                let root = builder.build_root(visit, slot, of, cache, leaf.slot);
                builder.note_root(of, leaf.slot, root);
                kernel.enter(OccludedInPatch { builder, visit, root, of, ray })
            };
            if is_hit {
                return true;
            }
        }
        false
    }
}

struct OccludedInPatch<'a, 'v, 'p, 'w> {
    builder: &'a mut Builder<'w>,
    visit: &'v Visit<'p>,
    root: Block<'v>,
    of: PatchContext<'a>,
    ray: &'a LatticeRay,
}

impl Task for OccludedInPatch<'_, '_, '_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        let Self { builder, visit, root, of, ray } = self;
        if !is_node(root.bytes()) {
            return PieceView::new(root.bytes()).occluded(kernel, ray, of.patch);
        }
        let mut levels: [Option<Level<'_>>; MAX_LEVELS] = Default::default();
        levels[0] = Some(Level::new(kernel, visit, root, ray, ray.t_max()));
        let mut depth = 0;
        while let Some(level) = &mut levels[depth] {
            let Some(lane) = level.hits.pop() else {
                if depth == 0 {
                    break;
                }
                depth -= 1;
                continue;
            };
            let (slot, cells) = level.child(lane);
            let is_hit = if let Some(block) = visit.get(slot) {
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(Level::new(kernel, visit, block, ray, ray.t_max()));
                    continue;
                }
                PieceView::new(block.bytes()).occluded(kernel, ray, of.patch)
            } else {
                let block = builder.build(visit, slot, of, Some(cells));
                builder.note_child(depth + 1, lane, block);
                if is_node(block.bytes()) {
                    depth += 1;
                    levels[depth] = Some(kernel.enter(OpenLevel { visit, block, ray, t_max: ray.t_max() }));
                    continue;
                }
                kernel.enter(OccludedInPiece { block, patch: of.patch, ray })
            };
            if is_hit {
                return true;
            }
        }
        false
    }
}

// What is done with a block that was just built, apart from the code for blocks that are there.

struct OpenLevel<'a, 'v, 'p> {
    visit: &'v Visit<'p>,
    block: Block<'v>,
    ray: &'a LatticeRay,
    t_max: f32,
}

impl<'v> Task for OpenLevel<'_, 'v, '_> {
    type Output = Level<'v>;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Level<'v> {
        Level::new(kernel, self.visit, self.block, self.ray, self.t_max)
    }
}

struct ClosestInPiece<'a, 'v> {
    block: Block<'v>,
    patch: PatchId,
    ray: &'a LatticeRay,
    hit: &'a mut LatticeHit,
}

impl Task for ClosestInPiece<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        PieceView::new(self.block.bytes()).closest(kernel, self.ray, self.patch, self.hit);
    }
}

struct OccludedInPiece<'a, 'v> {
    block: Block<'v>,
    patch: PatchId,
    ray: &'a LatticeRay,
}

impl Task for OccludedInPiece<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        PieceView::new(self.block.bytes()).occluded(kernel, self.ray, self.patch)
    }
}

/// A hit as the caller sees it, at the caller's `t`.
#[inline(always)]
fn hit_of(mesh: &WorldMesh, id: MeshId, t: f32, found: &LatticeHit) -> Hit {
    let patch = found.triangle.patch();
    let [u, v] = found.in_cells();
    let [n_u, n_v] = found.grid.map(f32::from);
    let (face, sub) = mesh.surface().face_of(patch);
    Hit {
        t,
        primitive: PrimitiveRef {
            mesh: id,
            patch,
            cell: [found.triangle.i() as u16, found.triangle.j() as u16],
            half: found.triangle.half() as u8,
        },
        face,
        sub,
        u: u / n_u,
        v: v / n_v,
        normal_in_object: found.normal * mesh.surface().lattice().step.powi(2),
        on_triangle: OnTriangle { corners: found.corners, weights: found.barycentrics },
    }
}

impl<'w> Intersector<'w> {
    /// A tracer for one thread.
    pub fn new(world: &'w World, cache: &'w GridCache) -> Self {
        let pin = cache.segments().pin();
        let boxes = world.meshes().iter().map(WorldMesh::bounds_in_world);
        Self {
            world,
            cache,
            pin,
            builder: Builder { recorder: cache.trace().map(TraceLog::recorder), ..Default::default() },
            shading: Dicer::default(),
            stacks: Stacks::default(),
            order: BatchOrder::new(boxes.fold(DBounds::EMPTY, DBounds::union)),
            kernel: Best::detect(),
        }
    }

    /// The world that is traced.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// Blocks this tracer has built.
    pub fn n_built(&self) -> u64 {
        self.builder.n_built
    }

    /// Bytes of them.
    pub fn bytes_built(&self) -> u64 {
        self.pin.bytes_built()
    }

    /// Builds every block of every patch, as if rays had asked for all of them: what a program that tessellates
    /// beforehand would do.
    pub fn tessellate_everything(&mut self) {
        let Self { world, cache, pin, builder, .. } = self;
        for (mesh, id) in world.meshes().iter().zip((0..).map(MeshId)) {
            for leaf in mesh.top().leaves() {
                let of = PatchContext { id, mesh, patch: mesh.patch_of_leaf(leaf.patch) };
                let visit = &pin.visit();
                cache.touch(id, leaf.slot);
                builder.complete(visit, visit.root(cache.table(id), SlotId(leaf.slot)), of, None);
            }
        }
    }

    /// The limit surface's normal at a hit, in object space, along du x dv and not normalised; zero where there is none.
    pub fn limit_normal(&mut self, hit: &Hit) -> DVec3 {
        let surface = self.world.mesh(hit.primitive.mesh).surface();
        self.shading.normal(surface, hit.primitive.patch, f64::from(hit.u), f64::from(hit.v))
    }

    #[inline]
    fn closest_in_mesh(&mut self, mesh: MeshId, ray: &Ray, best: &mut Option<Hit>) {
        let t_max = best.map_or(ray.t_max, |hit| hit.t);
        let found = self.kernel.run(ClosestInMesh { tracer: self, mesh, ray, t_max });
        let Some(hit) = found else { return };
        if best.is_none_or(|b| hit.t < b.t || (hit.t == b.t && mesh < b.primitive.mesh)) {
            *best = found;
        }
    }

    /// The ray in the space of the tree over meshes; its `t` is only good for the order of visits.
    fn scene_ray(&self, ray: &Ray) -> LatticeRay {
        let to = self.world.scene_from_world();
        let (origin, direction) = (to.transform_point3(ray.origin), to.transform_vector3(ray.direction));
        LatticeRay::new(origin, direction, f32::INFINITY, TriangleId::NONE)
    }
}

fn triangle_id(of: &PrimitiveRef) -> TriangleId {
    let [i, j] = of.cell.map(u32::from);
    TriangleId::new(of.patch, i, j, u32::from(of.half))
}

impl Drop for Intersector<'_> {
    fn drop(&mut self) {
        let costs = std::mem::take(&mut self.builder.costs);
        self.cache.add_built(self.builder.n_pieces, self.builder.n_triangles, costs);
    }
}

impl Intersect for Intersector<'_> {
    fn closest(&mut self, ray: &Ray) -> Option<Hit> {
        if self.world.meshes().len() == 1 {
            return self.kernel.run(ClosestInMesh { tracer: self, mesh: MeshId(0), ray, t_max: ray.t_max });
        }
        let mut best = None;
        let scene_ray = self.scene_ray(ray);
        let world = self.world;
        let mut stack = std::mem::take(&mut self.stacks.scene);
        world.top().closest(simd::Portable, &scene_ray, &mut stack, |leaf, t_max| {
            self.closest_in_mesh(MeshId(leaf.patch.0), ray, &mut best);
            if let Some(hit) = best {
                *t_max = scene_ray.not_below(hit.t);
            }
        });
        self.stacks.scene = stack;
        best
    }

    fn occluded(&mut self, ray: &Ray) -> bool {
        let occluded_by = |tracer: &mut Self, mesh: MeshId| tracer.kernel.run(OccludedInMesh { tracer, mesh, ray });
        if self.world.meshes().len() == 1 {
            return occluded_by(self, MeshId(0));
        }
        let scene_ray = self.scene_ray(ray);
        let world = self.world;
        let mut stack = std::mem::take(&mut self.stacks.scene);
        let hit = world
            .top()
            .occluded(simd::Portable, &scene_ray, &mut stack, |leaf| occluded_by(self, MeshId(leaf.patch.0)));
        self.stacks.scene = stack;
        hit
    }
    fn closest_batch(&mut self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len());
        for (rays, hits) in rays.chunks(MOST_RAYS).zip(hits.chunks_mut(MOST_RAYS)) {
            let order = self.order.of(rays);
            order.rays().for_each(|i| hits[i] = self.closest(&rays[i]));
            self.order.keep(order);
        }
    }

    fn occluded_batch(&mut self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len());
        for (rays, occluded) in rays.chunks(MOST_RAYS).zip(occluded.chunks_mut(MOST_RAYS)) {
            let order = self.order.of(rays);
            order.rays().for_each(|i| occluded[i] = self.occluded(&rays[i]));
            self.order.keep(order);
        }
    }
}
