//! The way of a packet of camera rays through a mesh: along the front of their bundle to patches, and through these.
//!
//! A block is looked up once for all rays of a packet, and one that is missing is built when the first of them reaches
//! it: in the order in which the packet enters boxes, which is that of a single ray to within the packet's own width.

use super::accel::{Front, TraversalStack};
use super::builder::{Builder, PatchContext};
use super::intersect::{hit_of, nearer};
use super::patch_walk::child_of;
use super::world::{GridCache, WorldMesh};
use crate::cache::{Block, Pin, SlotId, Visit};
use crate::grid::{NodeView, PACKET, PieceView, RayPacket, SeenBoxes, is_node};
use crate::ids::MeshId;
use crate::math::simd::{Kernel, Task};
use crate::math::{Hit, Ray};
use glam::DVec3;

/// The nearest hits of rays from one point in one mesh, from a front, as far as they are nearer than `hits`. Says
/// whether it found them: `false` if the rays are no packet, or not of the front's bundle.
pub(super) struct ClosestOfPacket<'a, 'w> {
    pub mesh: (MeshId, &'w WorldMesh),
    pub front: &'a Front,
    pub cache: &'w GridCache,
    pub pin: &'a mut Pin<'w>,
    pub builder: &'a mut Builder<'w>,
    pub scratch: &'a mut PacketScratch,
    pub origin: DVec3,
    pub directions: &'a [DVec3; PACKET],
    /// Of each ray: as many as there are rays, the rest of the directions are those of other ones.
    pub hits: &'a mut [Option<Hit>],
}

/// What a thread keeps for its next packet.
#[derive(Default)]
pub(super) struct PacketScratch {
    packet: RayPacket,
    stack: TraversalStack,
}

impl Task for ClosestOfPacket<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> bool {
        let Self { mesh: (id, mesh), front, cache, pin, builder, scratch, origin, directions, hits } = self;
        let entering = mesh.entrance().ray(kernel, &Ray::new(origin, directions[0]));
        let directions = mesh.entrance().directions(kernel, directions);
        if !(front.contains(kernel, entering) && front.contains_all(kernel, &directions)) {
            return false;
        }
        if front.is_empty() {
            return true;
        }
        let PacketScratch { packet, stack } = scratch;
        let mut t_max = [-1.0; PACKET];
        for (t_max, hit) in t_max.iter_mut().zip(&*hits) {
            *t_max = hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
        }
        if !packet.set(kernel, entering[0], &directions, &t_max) {
            return false;
        }
        let (table, visit) = (cache.table(id), &pin.visit());
        let mut walk = mesh.top().walk_packet(kernel, front, packet, stack);
        while let Some((leaf, rays)) = walk.next(packet) {
            let of = PatchContext { id, mesh, patch: mesh.patch_of_leaf(leaf.patch) };
            let block = match visit.get(visit.root(table, SlotId(leaf.slot))) {
                Some(block) => block,
                None => builder.build_root(visit, of, cache, leaf.slot),
            };
            builder.note_root(of, leaf.slot, block);
            PacketInPatch { builder, visit, block, depth: 0, of, rays, packet }.run(kernel);
        }
        for (i, best) in hits.iter_mut().enumerate() {
            if let Some(hit) = packet.hit(i) {
                let found = hit_of(mesh, id, packet.caller_t(i, hit.t), hit);
                *best = nearer(*best, Some(found));
            }
        }
        true
    }
}

/// Takes the nearest hits of a block and those below into the packet.
struct PacketInPatch<'a, 'v, 'p, 'w> {
    builder: &'a mut Builder<'w>,
    visit: &'v Visit<'p>,
    block: Block<'v>,
    /// Nodes above the block.
    depth: usize,
    of: PatchContext<'a>,
    /// Those that meet the block's box, as bits.
    rays: u32,
    packet: &'a mut RayPacket,
}

impl Task for PacketInPatch<'_, '_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        let Self { builder, visit, block, depth, of, rays, packet } = self;
        if !is_node(block.bytes()) {
            PieceView::new(block.bytes()).closest_of_packet(kernel, packet, rays, of.patch);
            return;
        }
        let node = NodeView::new(block.bytes());
        let mut seen = SeenBoxes::UNSET;
        let mut children = node.test_packet(kernel, packet, &mut seen);
        while let Some(lane) = children.pop_nearest(f32::INFINITY) {
            let rays = seen.meeting_plate(kernel, packet, lane, node) & rays;
            if rays == 0 {
                continue;
            }
            let child = match visit.get(block.child(lane)) {
                Some(child) => child,
                None => builder.build(visit, block.child(lane), of, Some(child_of(node, lane))),
            };
            builder.note_child(depth + 1, lane, child);
            if is_node(child.bytes()) {
                kernel.enter(PacketInPatch { builder, visit, block: child, depth: depth + 1, of, rays, packet });
            } else {
                PieceView::new(child.bytes()).closest_of_packet(kernel, packet, rays, of.patch);
            }
        }
    }
}
