//! Patches of all meshes under one numbering, and work on them by all threads.

use crate::ids::{MeshId, PatchId};
use crate::parallel::on_threads;
use crate::scene::world::World;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Patches one thread takes at a time.
const PATCHES_PER_TASK: u32 = 64;

/// Numbers for the patches of all meshes, mesh after mesh.
pub(super) struct PatchNumbers {
    /// First number of each mesh, then the total.
    first: Vec<u32>,
}

impl PatchNumbers {
    /// `None` if there are more than 2^32 - 2.
    pub fn new(world: &World) -> Option<Self> {
        let mut first = vec![0u32];
        for mesh in world.meshes() {
            let n = u32::try_from(mesh.surface().n_patches()).ok()?;
            first.push(first.last()?.checked_add(n)?);
        }
        (first.last() < Some(&u32::MAX)).then_some(Self { first })
    }

    /// How many there are.
    pub fn len(&self) -> u32 {
        self.first[self.first.len() - 1]
    }

    /// The number of a patch.
    pub fn number(&self, mesh: MeshId, patch: PatchId) -> u32 {
        self.first[mesh.idx()] + patch.0
    }

    /// The patch with this number.
    pub fn patch(&self, number: u32) -> (MeshId, PatchId) {
        let mesh = self.first.partition_point(|&first| first <= number) - 1;
        (MeshId::from(mesh), PatchId(number - self.first[mesh]))
    }

    /// Calls `work` for every patch with a surface, on `threads` threads, each with a state of its own; returns the
    /// states.
    pub fn for_each<S: Send>(
        &self,
        world: &World,
        threads: usize,
        new: impl Fn() -> S + Sync,
        work: impl Fn(&mut S, MeshId, PatchId) + Sync,
    ) -> Vec<S> {
        let next = AtomicU32::new(0);
        let n_tasks = self.len().div_ceil(PATCHES_PER_TASK);
        let run = || {
            let mut state = new();
            loop {
                let task = next.fetch_add(1, Ordering::Relaxed);
                if task >= n_tasks {
                    return state;
                }
                for number in self.task(task) {
                    let (mesh, patch) = self.patch(number);
                    if world.mesh(mesh).surface().is_visible(patch) {
                        work(&mut state, mesh, patch);
                    }
                }
            }
        };
        on_threads(threads.min(n_tasks as usize), run)
    }

    fn task(&self, task: u32) -> Range<u32> {
        task * PATCHES_PER_TASK..(task * PATCHES_PER_TASK).saturating_add(PATCHES_PER_TASK).min(self.len())
    }
}
