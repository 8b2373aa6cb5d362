//! Packets against the triangles of a piece.

use super::{RayPacket, SeenBoxes};
use crate::grid::PieceView;
use crate::grid::triangles::Vertices;
use crate::ids::PatchId;
use crate::math::simd::Kernel;

/// As many rays are tested each against all boxes of a piece, more together. Primary rays at rates 8 to 32, beside 3:
/// with 0 at 0.88 to 1.01 of the speed (trex, bigguy, bishop, gregory_test1), with 4 to 6 at 0.97 to 1.04, with 8 at
/// 0.89 (pole64) to 1.08 (trex).
const FEW_RAYS: u32 = 5;

impl PieceView<'_> {
    /// Takes the nearest hits of the piece by some rays of a packet, as bits, into the packet, as [`Self::closest`] does.
    #[inline(always)]
    pub fn closest_of_packet<K: Kernel>(&self, kernel: K, packet: &mut RayPacket, rays: u32, patch: PatchId) {
        self.prefetch(kernel);
        let mut nearer = if rays.count_ones() <= FEW_RAYS {
            self.closest_of_few(kernel, packet, rays, patch)
        } else {
            self.closest_of_many(kernel, packet, rays, patch)
        };
        while nearer != 0 {
            self.complete(kernel, packet.hit_mut(nearer.trailing_zeros() as usize));
            nearer &= nearer - 1;
        }
    }

    /// The same, boxes tested against all rays and then against each; returns the rays that have a hit.
    #[inline(always)]
    fn closest_of_many<K: Kernel>(&self, kernel: K, packet: &mut RayPacket, rays: u32, patch: PatchId) -> u32 {
        let mut seen = SeenBoxes::UNSET;
        let mut blocks = self.head.test_packet(kernel, packet, &mut seen).mask;
        let mut nearer = 0;
        while blocks != 0 {
            let lane = blocks.trailing_zeros() as usize;
            blocks &= blocks - 1;
            let meeting = seen.meeting(kernel, packet, lane) & rays;
            if meeting != 0 {
                nearer |= self.test_block_with(kernel, packet, meeting, patch, lane);
            }
        }
        nearer
    }

    /// The same, each ray tested against all boxes.
    #[inline(always)]
    fn closest_of_few<K: Kernel>(&self, kernel: K, packet: &mut RayPacket, rays: u32, patch: PatchId) -> u32 {
        let met = self.head.test_rays(kernel, packet, rays);
        let mut blocks = met.iter().fold(0, |all, of| all | of);
        let mut nearer = 0;
        while blocks != 0 {
            let lane = blocks.trailing_zeros() as usize;
            blocks &= blocks - 1;
            let mut meeting = 0;
            for (ray, of) in met.iter().enumerate() {
                meeting |= (of >> lane & 1) << ray;
            }
            nearer |= self.test_block_with(kernel, packet, meeting, patch, lane);
        }
        nearer
    }

    /// Takes the nearest hits of a block; returns the rays that have one.
    #[inline(always)]
    fn test_block_with<K: Kernel>(
        &self,
        kernel: K,
        packet: &mut RayPacket,
        mut rays: u32,
        patch: PatchId,
        lane: usize,
    ) -> u32 {
        let vertices = Vertices::of_block(self, kernel, packet.first(), lane);
        let mut nearer = 0;
        while rays != 0 {
            let ray = rays.trailing_zeros() as usize;
            rays &= rays - 1;
            let (shear, t_max) = packet.ray(ray);
            let Some(found) = vertices.seen_along(kernel, shear).test(kernel, t_max) else { continue };
            for triangle in found.lanes() {
                let (id, t) = (self.triangle_id(patch, lane, triangle), found.t[triangle]);
                if packet.take(ray, t, id, [found.second[triangle], found.third[triangle]]) {
                    nearer |= 1 << ray;
                }
            }
        }
        nearer
    }
}
