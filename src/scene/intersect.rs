//! The lazy tracer: the one place where trees, plans, cache and grids meet.
//!
//! A ray walks a mesh's tree to a **leaf**, a patch. The leaf's slot leads to a block: a piece if the patch has at most
//! 8 x 8 cells, else a node whose children are nodes or pieces in their turn. A block that is missing is built on the
//! spot, so nothing is tessellated but what a ray reaches.
//!
//! `entrance.rs` takes a ray into a mesh's lattice, `aim.rs` and `accel` to its patches, `departure.rs` past the one
//! that it leaves, `patch_walk.rs` through a patch; `packet.rs` does all of that for eight camera rays at once.
//! `builder.rs` builds what is missing.

use super::accel::{LeafWalk, TraversalStack};
use super::aim::{Aim, TakeAim};
use super::batch::{BatchOrder, MOST_RAYS};
use super::builder::{Builder, PatchContext};
use super::departure::Leaving;
use super::packet::{ClosestOfPacket, PacketScratch};
use super::patch_walk::{ClosestInPatch, InPatch, OccludedInPatch};
use super::world::{GridCache, World, WorldMesh};
use crate::cache::{Pin, SlotId, TraceLog, Visit};
use crate::grid::{LatticeHit, LatticeRay, PACKET, TriangleId};
use crate::ids::MeshId;
use crate::math::simd::{self, Best, Kernel, Task};
use crate::math::{DBounds, Hit, Intersect, OnTriangle, PrimitiveRef, Ray, RayBounds};
use crate::subdiv::Dicer;
use glam::DVec3;

/// One thread's access to the scene's geometry.
///
/// Rays that are near each other need the same blocks. Where the caller has many rays in no such order, a batch finds
/// one:
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
    packet: Box<PacketScratch>,
    aim: Aim,
    order: BatchOrder,
    kernel: Best,
}

#[derive(Default)]
struct Stacks {
    scene: TraversalStack,
    mesh: TraversalStack,
}

/// The ray as the mesh's lattice sees it. `t` keeps its meaning.
#[inline(always)]
fn lattice_ray<K: Kernel>(k: K, [origin, direction]: [K::D; 2], id: MeshId, ray: &Ray, t_max: f32) -> LatticeRay {
    let skip = match ray.from {
        Some(from) if from.mesh == id => triangle_id(&from),
        _ => TriangleId::NONE,
    };
    LatticeRay::of_lanes(k, origin, direction, t_max, skip)
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
        let entering = mesh.entrance().ray(kernel, ray);
        let start = cache.departures().start(ray, id, mesh);
        if cache.departures().meets_nothing(kernel, start, entering[1], mesh) {
            builder.departures.rays_past_all += 1;
            return None;
        }
        if !mesh.entrance().is_in_reach(kernel, entering) {
            return None;
        }
        let in_lattice = &lattice_ray(kernel, entering, id, ray, t_max);
        let leaving = Leaving::of(kernel, start, (id, mesh), in_lattice, cache, (builder, pin));
        let ray = in_lattice;
        let walk = mesh.top().walk(kernel, ray, &mut stacks.mesh);
        Leaves { id, mesh, cache, visit: &pin.visit(), builder, leaving, ray }.closest(kernel, walk)
    }
}

/// As [`ClosestInMesh`], from one of the aim's fronts, by number, if the ray is of its bundle.
struct ClosestInFront<'a, 'w> {
    tracer: &'a mut Intersector<'w>,
    front: usize,
    ray: &'a Ray,
    t_max: f32,
}

impl Task for ClosestInFront<'_, '_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> Option<Hit> {
        let Self { tracer, front, ray, t_max } = self;
        let Intersector { world, cache, pin, builder, stacks, aim, .. } = &mut *tracer;
        let (id, front) = aim.front(front);
        let mesh = world.mesh(id);
        let entering = mesh.entrance().ray(kernel, ray);
        if !front.contains(kernel, entering) {
            return kernel.enter(ClosestInMesh { tracer, mesh: id, ray, t_max });
        }
        if front.is_empty() {
            return None;
        }
        let ray = &lattice_ray(kernel, entering, id, ray, t_max);
        let walk = mesh.top().walk_front(kernel, front, ray, &mut stacks.mesh);
        Leaves { id, mesh, cache, visit: &pin.visit(), builder, leaving: Leaving::NOTHING, ray }.closest(kernel, walk)
    }
}

/// A ray about to visit leaves.
struct Leaves<'a, 'v, 'p, 'w> {
    id: MeshId,
    mesh: &'w WorldMesh,
    cache: &'w GridCache,
    visit: &'v Visit<'p>,
    builder: &'a mut Builder<'w>,
    leaving: Leaving<'w>,
    ray: &'a LatticeRay,
}

impl Leaves<'_, '_, '_, '_> {
    /// The nearest hit on the way.
    #[inline(always)]
    fn closest<K: Kernel>(self, kernel: K, mut walk: impl LeafWalk) -> Option<Hit> {
        let Self { id, mesh, cache, visit, builder, leaving, ray } = self;
        let hit = &mut LatticeHit::none(ray.t_max());
        let table = cache.table(id);
        while let Some(leaf) = walk.nearest(hit.t, |slot| visit.prefetch(visit.root(table, SlotId(slot)))) {
            let of = PatchContext { id, mesh, patch: mesh.patch_of_leaf(leaf.patch) };
            let root = visit.root(table, SlotId(leaf.slot));
            if leaving.has_left(ray, of, builder, visit, root) {
                continue;
            }
            if let Some(block) = visit.get(root) {
                builder.note_root(of, leaf.slot, block);
                ClosestInPatch { builder, at: InPatch { visit, block, depth: 0, of, ray }, hit }.run(kernel);
            } else {
                // Apart, so that a block that is there stays in registers.
                let block = builder.build_root(visit, of, cache, leaf.slot);
                builder.note_root(of, leaf.slot, block);
                kernel.enter(ClosestInPatch { builder, at: InPatch { visit, block, depth: 0, of, ray }, hit });
            }
        }
        hit.is_some().then(|| hit_of(mesh, id, ray.caller_t(hit.t), hit))
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
        let entering = mesh.entrance().ray(kernel, ray);
        let start = cache.departures().start(ray, id, mesh);
        if cache.departures().meets_nothing(kernel, start, entering[1], mesh) {
            builder.departures.rays_past_all += 1;
            return false;
        }
        if !mesh.entrance().is_in_reach(kernel, entering) {
            return false;
        }
        let in_lattice = &lattice_ray(kernel, entering, id, ray, ray.t_max);
        let leaving = Leaving::of(kernel, start, (id, mesh), in_lattice, cache, (builder, pin));
        let ray = in_lattice;
        let table = cache.table(id);
        let visit = &pin.visit();
        let mut walk = mesh.top().walk_any(kernel, ray, &mut stacks.mesh);
        while let Some(leaf) = walk.next(|slot| visit.prefetch(visit.root(table, SlotId(slot)))) {
            let of = PatchContext { id, mesh, patch: mesh.patch_of_leaf(leaf.patch) };
            let root = visit.root(table, SlotId(leaf.slot));
            if leaving.has_left(ray, of, builder, visit, root) {
                continue;
            }
            let is_hit = if let Some(block) = visit.get(root) {
                builder.note_root(of, leaf.slot, block);
                OccludedInPatch { builder, at: InPatch { visit, block, depth: 0, of, ray } }.run(kernel)
            } else {
                let block = builder.build_root(visit, of, cache, leaf.slot);
                builder.note_root(of, leaf.slot, block);
                kernel.enter(OccludedInPatch { builder, at: InPatch { visit, block, depth: 0, of, ray } })
            };
            if is_hit {
                return true;
            }
        }
        false
    }
}

/// A hit as the caller sees it, at the caller's `t`.
#[inline(always)]
pub(super) fn hit_of(mesh: &WorldMesh, id: MeshId, t: f32, found: &LatticeHit) -> Hit {
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
            builder: Builder::noting(cache.trace().map(TraceLog::recorder)),
            shading: Dicer::default(),
            stacks: Stacks::default(),
            packet: Box::default(),
            aim: Aim::default(),
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

    /// The limit surface's normal at a hit, in object space, along du x dv and not normalised; zero where there is
    /// none.
    pub fn limit_normal(&mut self, hit: &Hit) -> DVec3 {
        let surface = self.world.mesh(hit.primitive.mesh).surface();
        self.shading.normal(surface, hit.primitive.patch, f64::from(hit.u), f64::from(hit.v))
    }

    #[inline]
    fn closest_in_mesh(&mut self, mesh: MeshId, ray: &Ray, best: &mut Option<Hit>) {
        let t_max = best.map_or(ray.t_max, |hit| hit.t);
        let found = self.kernel.run(ClosestInMesh { tracer: self, mesh, ray, t_max });
        *best = nearer(*best, found);
    }

    /// The nearest hit where there are several meshes. (Apart, so that one mesh does not pay for its stack frame.)
    #[inline(never)]
    fn closest_of_meshes(&mut self, ray: &Ray) -> Option<Hit> {
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

    /// The nearest hit of a ray of the bundle that was aimed along, where there are several meshes.
    #[inline(never)]
    fn closest_of_fronts(&mut self, ray: &Ray) -> Option<Hit> {
        (0..self.aim.n_meshes()).fold(None, |best: Option<Hit>, front| {
            let t_max = best.map_or(ray.t_max, |hit| hit.t);
            nearer(best, self.kernel.run(ClosestInFront { tracer: self, front, ray, t_max }))
        })
    }

    /// The nearest hits of at most [`PACKET`] rays from one point together, if that is possible; says whether it is.
    fn closest_of_packet(&mut self, origin: DVec3, directions: &[DVec3], hits: &mut [Option<Hit>]) -> bool {
        let padded;
        let directions = match directions.first_chunk() {
            Some(directions) => directions,
            None => {
                padded = padded_with_first(directions);
                &padded
            }
        };
        let Self { world, cache, pin, builder, packet, aim, kernel, .. } = self;
        hits.fill(None);
        aim.starts_at(origin)
            && (0..aim.n_meshes()).all(|front| {
                let (id, front) = aim.front(front);
                let (mesh, scratch) = ((id, world.mesh(id)), &mut **packet);
                kernel.run(ClosestOfPacket { mesh, front, cache, pin, builder, scratch, origin, directions, hits })
            })
    }

    /// Whether anything is hit where there are several meshes.
    #[inline(never)]
    fn occluded_by_meshes(&mut self, ray: &Ray) -> bool {
        let scene_ray = self.scene_ray(ray);
        let world = self.world;
        let mut stack = std::mem::take(&mut self.stacks.scene);
        let hit = world.top().occluded(simd::Portable, &scene_ray, &mut stack, |leaf| {
            let mesh = MeshId(leaf.patch.0);
            self.kernel.run(OccludedInMesh { tracer: self, mesh, ray })
        });
        self.stacks.scene = stack;
        hit
    }

    /// The ray in the space of the tree over meshes; its `t` is only good for the order of visits, and ends a little
    /// later.
    fn scene_ray(&self, ray: &Ray) -> LatticeRay {
        let to = self.world.scene_from_world();
        let (origin, direction) = (to.transform_point3(ray.origin), to.transform_vector3(ray.direction));
        let mut in_scene = LatticeRay::new(origin, direction, f32::INFINITY, TriangleId::NONE);
        in_scene.t_max = in_scene.not_below(ray.t_max);
        in_scene
    }
}

/// Less than a packet of directions, the first one in the places that are left.
#[cold]
fn padded_with_first(directions: &[DVec3]) -> [DVec3; PACKET] {
    let mut padded = [directions[0]; PACKET];
    padded[..directions.len()].copy_from_slice(directions);
    padded
}

/// The nearer hit of two, of two at the same distance that of the smaller mesh.
#[inline(always)]
pub(super) fn nearer(best: Option<Hit>, found: Option<Hit>) -> Option<Hit> {
    let (Some(b), Some(hit)) = (best, found) else { return best.or(found) };
    if hit.t < b.t || (hit.t == b.t && hit.primitive.mesh < b.primitive.mesh) { found } else { best }
}

fn triangle_id(of: &PrimitiveRef) -> TriangleId {
    let [i, j] = of.cell.map(u32::from);
    TriangleId::new(of.patch, i, j, u32::from(of.half))
}

impl Drop for Intersector<'_> {
    fn drop(&mut self) {
        let Builder { n_pieces, n_triangles, costs, departures, .. } = &mut self.builder;
        self.cache.add_built(*n_pieces, *n_triangles, std::mem::take(costs));
        self.cache.add_departures(*departures);
    }
}

impl Intersect for Intersector<'_> {
    fn closest(&mut self, ray: &Ray) -> Option<Hit> {
        let (kernel, t_max) = (self.kernel, ray.t_max);
        if self.world.meshes().len() == 1 {
            return match self.aim.may_contain(ray) {
                true => kernel.run(ClosestInFront { tracer: self, front: 0, ray, t_max }),
                false => kernel.run(ClosestInMesh { tracer: self, mesh: MeshId(0), ray, t_max }),
            };
        }
        if self.aim.contains(ray) {
            return self.closest_of_fronts(ray);
        }
        self.closest_of_meshes(ray)
    }

    fn occluded(&mut self, ray: &Ray) -> bool {
        if self.world.meshes().len() == 1 {
            return self.kernel.run(OccludedInMesh { tracer: self, mesh: MeshId(0), ray });
        }
        self.occluded_by_meshes(ray)
    }

    fn aim(&mut self, bundle: &RayBounds) {
        let Self { world, aim, kernel, .. } = self;
        kernel.run(TakeAim { aim, world, bundle });
    }

    fn closest_from(&mut self, origin: DVec3, directions: &[DVec3], hits: &mut [Option<Hit>]) {
        assert_eq!(directions.len(), hits.len());
        for (directions, hits) in directions.chunks(PACKET).zip(hits.chunks_mut(PACKET)) {
            if directions.len() == 1 || !self.closest_of_packet(origin, directions, hits) {
                let rays = directions.iter().map(|&direction| Ray::new(origin, direction));
                rays.zip(hits).for_each(|(ray, hit)| *hit = self.closest(&ray));
            }
        }
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
