//! Where the work goes: how many blocks were built for each mesh, and for the patches with most of them.

use crate::ids::{MeshId, PatchId};
use rustc_hash::FxHashMap;

/// Patches that are counted at the same time: a quarter of a megabyte for each thread.
const MOST_PATCHES: usize = 1 << 13;

/// Blocks built, by mesh and by patch.
///
/// Where more patches are built than can be counted, those with the fewest blocks are forgotten, so that counts of
/// costly patches may be a little low and cheap patches are missing.
#[derive(Clone, Debug, Default)]
pub struct BuildCosts {
    by_patch: FxHashMap<(MeshId, PatchId), u64>,
    by_mesh: FxHashMap<MeshId, u64>,
    /// The last patch and its blocks that are not counted above yet: a node and its pieces are mostly built in a row.
    last: Option<PatchCost>,
}

/// A patch and the blocks that were built for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PatchCost {
    /// Its mesh.
    pub mesh: MeshId,
    /// The patch.
    pub patch: PatchId,
    /// Blocks, rebuilt ones counted again.
    pub blocks: u64,
}

impl BuildCosts {
    /// Counts blocks built for a patch.
    pub fn add(&mut self, mesh: MeshId, patch: PatchId, blocks: u64) {
        match &mut self.last {
            Some(last) if (last.mesh, last.patch) == (mesh, patch) => last.blocks += blocks,
            _ => {
                self.count_last();
                self.last = Some(PatchCost { mesh, patch, blocks });
            }
        }
    }

    /// Counts what was only noted.
    fn count_last(&mut self) {
        let Some(PatchCost { mesh, patch, blocks }) = self.last.take() else { return };
        *self.by_mesh.entry(mesh).or_default() += blocks;
        *self.by_patch.entry((mesh, patch)).or_default() += blocks;
        if self.by_patch.len() > MOST_PATCHES {
            self.forget_cheapest_half();
        }
    }

    fn all_counted(&self) -> Self {
        let mut all = self.clone();
        all.count_last();
        all
    }

    /// Adds what another thread has counted.
    pub fn merge(&mut self, mut other: Self) {
        self.count_last();
        other.count_last();
        for ((mesh, patch), blocks) in other.by_patch {
            *self.by_patch.entry((mesh, patch)).or_default() += blocks;
        }
        for (mesh, blocks) in other.by_mesh {
            *self.by_mesh.entry(mesh).or_default() += blocks;
        }
        if self.by_patch.len() > MOST_PATCHES {
            self.forget_cheapest_half();
        }
    }

    /// The `n` patches with most blocks, most first.
    pub fn costliest_patches(&self, n: usize) -> Vec<PatchCost> {
        let cost = |(&(mesh, patch), &blocks): (&(MeshId, PatchId), &u64)| PatchCost { mesh, patch, blocks };
        let mut all: Vec<PatchCost> = self.all_counted().by_patch.iter().map(cost).collect();
        all.sort_by_key(|c| (std::cmp::Reverse(c.blocks), c.mesh, c.patch));
        all.truncate(n);
        all
    }

    /// The `n` meshes with most blocks, most first.
    pub fn costliest_meshes(&self, n: usize) -> Vec<(MeshId, u64)> {
        let mut all: Vec<(MeshId, u64)> = self.all_counted().by_mesh.into_iter().collect();
        all.sort_by_key(|&(mesh, blocks)| (std::cmp::Reverse(blocks), mesh));
        all.truncate(n);
        all
    }

    fn forget_cheapest_half(&mut self) {
        let mut blocks: Vec<u64> = self.by_patch.values().copied().collect();
        let middle = blocks.len() / 2;
        let (_, &mut median, _) = blocks.select_nth_unstable(middle);
        self.by_patch.retain(|_, blocks| *blocks > median);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costly_patches_are_found_among_many_cheap_ones() {
        let mut costs = BuildCosts::default();
        for i in 0..100_000u32 {
            costs.add(MeshId(i % 3), PatchId(i), 1);
            costs.add(MeshId(1), PatchId(7), 1);
            if i % 2 == 0 {
                costs.add(MeshId(2), PatchId(9), 1);
            }
        }
        let mut all = BuildCosts::default();
        all.merge(costs.clone());
        all.merge(costs);
        let found = all.costliest_patches(2);
        assert_eq!(found[0], PatchCost { mesh: MeshId(1), patch: PatchId(7), blocks: 200_002 });
        assert_eq!((found[1].patch, found[1].blocks), (PatchId(9), 100_000));
        assert_eq!(all.costliest_meshes(1), [(MeshId(1), 266_666)]);
    }
}
