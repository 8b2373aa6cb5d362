//! The tessellation itself, for other programs: all triangles of a mesh, vertices shared.

use super::world::WorldMesh;
use crate::ids::PatchId;
use crate::subdiv::{Dicer, PatchRates};
use glam::DVec3;
use rustc_hash::FxHashMap;

/// Calls `vertex` with every distinct vertex in object space, in the order of first use, and `triangle` with three
/// vertex numbers counted from 0 and the patch. Triangles that are points or lines (at stitched borders) are left out.
/// Both may stop it by an error.
pub fn tessellate<E>(
    mesh: &WorldMesh,
    mut vertex: impl FnMut(DVec3) -> Result<(), E>,
    mut triangle: impl FnMut(PatchId, [u32; 3]) -> Result<(), E>,
) -> Result<(), E> {
    let mut numbers: FxHashMap<[i32; 3], u32> = FxHashMap::default();
    let mut grid = PatchGrid::default();
    for patch in mesh.surface().visible_patches() {
        let rates = mesh.patch_rates(patch);
        grid.dice(mesh, patch, &rates);
        let mut row_numbers = Vec::with_capacity(grid.vertices.len());
        for v in &grid.vertices {
            let next = numbers.len() as u32;
            let number = *numbers.entry(*v).or_insert(next);
            if number == next {
                vertex(mesh.surface().object_from_lattice(glam::IVec3::from_array(*v).as_dvec3()))?;
            }
            row_numbers.push(number);
        }
        for [a, b, c] in triangles(&rates) {
            let t = [row_numbers[a], row_numbers[b], row_numbers[c]];
            if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                triangle(patch, t)?;
            }
        }
    }
    Ok(())
}

/// All vertices of a patch's grid, i fastest.
#[derive(Default)]
pub struct PatchGrid {
    dicer: Dicer,
    /// `(n_u + 1) (n_v + 1)` lattice points.
    pub vertices: Vec<[i32; 3]>,
}

impl PatchGrid {
    /// Dices a whole patch.
    pub fn dice(&mut self, mesh: &WorldMesh, patch: PatchId, rates: &PatchRates) {
        let (i, j) = ([0, rates.n_u], [0, rates.n_v]);
        self.dicer.dice(mesh.surface(), patch, rates, i, j, &mut self.vertices);
    }
}

/// The triangles of a whole grid as vertex indices: both halves of cell (0,0), then (1,0), and so on.
pub fn triangles(rates: &PatchRates) -> impl Iterator<Item = [usize; 3]> {
    let (n_u, n_v) = (rates.n_u as usize, rates.n_v as usize);
    (0..n_v).flat_map(move |j| {
        (0..n_u).flat_map(move |i| {
            let at = |di: usize, dj: usize| (j + dj) * (n_u + 1) + i + di;
            [[at(0, 0), at(1, 0), at(0, 1)], [at(1, 1), at(0, 1), at(1, 0)]]
        })
    })
}
