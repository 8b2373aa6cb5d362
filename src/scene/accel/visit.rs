//! A walk through the tree that is led by boxes instead of a ray.

use super::{EMPTY, LEAF, LeafRef, NodeBoxes, TopLevel};
use crate::ids::PatchId;
use crate::math::Bounds;
use glam::Vec3;

impl NodeBoxes {
    fn bounds(&self, lane: usize) -> Bounds {
        let corner = |first: usize| {
            Vec3::new(self.planes[first][lane], self.planes[first + 1][lane], self.planes[first + 2][lane])
        };
        Bounds { min: corner(0), max: corner(3) }
    }
}

impl TopLevel {
    /// Calls `leaf` for every patch with its box, but for those in boxes that `enter` turns down. `enter` is asked
    /// about boxes of several patches only.
    pub fn visit(&self, mut enter: impl FnMut(&Bounds) -> bool, mut leaf: impl FnMut(PatchId, &Bounds)) {
        self.visit_boxes(|found, bounds| match found {
            Some(found) => {
                leaf(found.patch, bounds);
                false
            }
            None => enter(bounds),
        });
    }

    /// Calls `enter` for every leaf with its box, and for boxes of several patches, for what is in them if it says so.
    pub fn visit_boxes(&self, mut enter: impl FnMut(Option<LeafRef>, &Bounds) -> bool) {
        let mut pending = vec![0u32];
        while let Some(node) = pending.pop() {
            let (boxes, refs) = (&self.nodes.boxes[node as usize], &self.nodes.refs[node as usize]);
            for (lane, &reference) in refs.iter().enumerate() {
                match reference {
                    EMPTY => {}
                    reference if reference & LEAF != 0 => {
                        let leaf = LeafRef { patch: PatchId(reference & !LEAF), slot: 8 * node + lane as u32 };
                        enter(Some(leaf), &boxes.bounds(lane));
                    }
                    reference if enter(None, &boxes.bounds(lane)) => pending.push(reference),
                    _ => {}
                }
            }
        }
    }
}
