//! The tessellation itself, for other programs: all triangles of a mesh, vertices shared.

use super::world::WorldMesh;
use crate::ids::PatchId;
use crate::math::LatticeGrid;
use crate::subdiv::{Dicer, PatchRates};
use glam::{DVec3, IVec3};
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
        let mut number = |v: usize| {
            let vertex_of_grid = grid.vertices[v];
            let next = numbers.len() as u32;
            let number = *numbers.entry(vertex_of_grid).or_insert(next);
            if number == next {
                vertex(mesh.surface().object_from_lattice(IVec3::from_array(vertex_of_grid).as_dvec3()))?;
            }
            Ok(number)
        };
        let edited = mesh.surface().edited();
        let is_there = |(k, _): &(usize, _)| !edited.hide_cell(patch, &rates, *k as u32 / 2);
        for (_, [a, b, c]) in triangles(&rates).enumerate().filter(is_there) {
            let t = [number(a)?, number(b)?, number(c)?];
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
    grid: LatticeGrid,
    /// `(n_u + 1) (n_v + 1)` lattice points.
    pub vertices: Vec<[i32; 3]>,
}

impl PatchGrid {
    /// Dices a whole patch.
    pub fn dice(&mut self, mesh: &WorldMesh, patch: PatchId, rates: &PatchRates) {
        let (i, j) = ([0, rates.n_u], [0, rates.n_v]);
        self.dicer.dice(mesh.surface(), patch, rates, i, j, &mut self.grid);
        self.vertices.clear();
        self.vertices.extend(self.grid.points());
    }
}

/// The triangles of a whole grid as vertex indices: both halves of cell (0,0), then (1,0), and so on, those in holes
/// too.
pub fn triangles(rates: &PatchRates) -> impl Iterator<Item = [usize; 3]> {
    let (n_u, n_v) = (rates.n_u as usize, rates.n_v as usize);
    (0..n_v).flat_map(move |j| {
        (0..n_u).flat_map(move |i| {
            let at = |di: usize, dj: usize| (j + dj) * (n_u + 1) + i + di;
            [[at(0, 0), at(1, 0), at(0, 1)], [at(1, 1), at(0, 1), at(1, 0)]]
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::rate::DicingRate;
    use super::*;
    use crate::mesh::{ControlMesh, EditKind, EditValue};
    use crate::subdiv::Surface;
    use crate::subdiv::refine::tests::edits::{edit, edited_cube, edited_tetrahedron};
    use glam::DAffine3;
    use std::convert::Infallible;

    /// Edges of the tessellation that have one triangle.
    fn n_open_edges(mesh: ControlMesh, rate: u32) -> usize {
        let mesh = WorldMesh::new(mesh, DAffine3::IDENTITY, DicingRate::Fixed(rate), 1).unwrap();
        let mut balance: FxHashMap<[u32; 2], i32> = FxHashMap::default();
        let Ok(()) = tessellate::<Infallible>(
            &mesh,
            |_| Ok(()),
            |_, [a, b, c]| {
                for [from, to] in [[a, b], [b, c], [c, a]] {
                    *balance.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
                }
                Ok(())
            },
        );
        balance.values().filter(|b| **b != 0).count()
    }

    #[test]
    fn edited_patches_share_their_borders_to_the_bit() {
        for rate in [1, 2, 3, 5, 8, 19] {
            for mut mesh in [edited_cube(), edited_tetrahedron()] {
                mesh.edits.retain(|e| e.kind != EditKind::Face);
                assert_eq!(n_open_edges(mesh, rate), 0, "rate {rate}");
            }
        }
    }

    #[test]
    fn only_the_border_of_a_hole_is_open() {
        let mut mesh = edited_cube();
        // An eighth of the patch: 8 cells, where the hole lies at an edge the one segment that the neighbour has there.
        assert_eq!(n_open_edges(mesh.clone(), 4), 8 + 8 + 8 + 1);
        mesh.edits.push(edit(EditKind::Face, &[0, 0], EditValue::Hole));
        assert_eq!(Surface::new(&mesh, 1).unwrap().patch_rates(PatchId(0), &|_, _| 3).sides[..2], [4, 3]);
        mesh.edits.push(edit(EditKind::Face, &[2], EditValue::Hole));
        assert!(!Surface::new(&mesh, 1).unwrap().is_visible(PatchId(2)));
    }
}
