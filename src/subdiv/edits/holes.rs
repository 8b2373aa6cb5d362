//! Parts of patches that `t faceedit` takes away.
//!
//! A **hole** is a cell of the 2^level by 2^level cells of a patch. The surface over it is still evaluated, since its
//! border belongs to the faces around it; only its grid cells are left out. So that holes end between grid cells, and
//! between whole pieces, such a patch has a multiple of 8 2^level cells along u and v, and an edge that a hole touches
//! has a rate that 2^level divides.

use crate::error::{Error, Result};
use crate::ids::{FaceId, PatchId};
use crate::mesh::{ControlMesh, Edit, EditKind};
use crate::subdiv::rates::PatchRates;
use crate::topology::{HalfEdges, Topology};
use rustc_hash::FxHashMap;

/// Cells of a piece along a side: a hole's border never runs through a piece.
const PIECE: u32 = 8;

/// Deepest hole: 8 2^9 cells a side are the most that a patch can have.
const MAX_LEVEL: u32 = 9;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Hole {
    level: u32,
    i: u32,
    j: u32,
}

/// The holes of a mesh at level 1 and deeper, and those that are the whole patch of a polygon.
#[derive(Debug, Default)]
pub(super) struct Holes {
    /// No hole of a patch lies in another.
    of_patch: FxHashMap<PatchId, Vec<Hole>>,
    /// Halvings that the rate of an edge must allow, by [`Topology::edge_id`].
    edge_level: FxHashMap<u32, u32>,
    /// The same for the edges inside a polygon.
    inner_level: FxHashMap<FaceId, u32>,
}

impl Hole {
    /// Which quad of the face the path of a face edit leads into, and which cell of it; none for the whole face.
    fn new(edit: &Edit, is_quad: bool) -> Option<(u32, Hole)> {
        let (sub, path) = match edit.children() {
            [] => return None,
            path if is_quad => (0, path),
            [sub, path @ ..] => (*sub, path),
        };
        let hole = path.iter().fold(Hole { level: 0, i: 0, j: 0 }, |Hole { level, i, j }, &k| {
            let (right, up) = [(0, 0), (1, 0), (1, 1), (0, 1)][k as usize];
            Hole { level: level + 1, i: (2 * i) | right, j: (2 * j) | up }
        });
        Some((sub, hole))
    }

    fn contains(&self, other: &Hole) -> bool {
        other.level.checked_sub(self.level).is_some_and(|d| (other.i >> d, other.j >> d) == (self.i, self.j))
    }

    /// Sides of the patch (v = 0, u = 1, v = 1, u = 0) that a side of the hole lies on.
    fn touches(&self) -> [bool; 4] {
        let last = (1 << self.level) - 1;
        [self.j == 0, self.i == last, self.j == last, self.i == 0]
    }

    /// The range of cells, out of `n` along a side, that the hole's cell `i` along that side covers.
    fn cells(&self, i: u32, n: u32) -> [u32; 2] {
        let size = n >> self.level;
        [i * size, (i + 1) * size]
    }
}

impl Holes {
    pub fn new(mesh: &ControlMesh, topology: &Topology, patch_of: impl Fn(FaceId, u32) -> PatchId) -> Result<Self> {
        let mut holes = Self::default();
        for edit in mesh.edits.iter().filter(|e| e.kind == EditKind::Face) {
            let n = mesh.face_sizes[edit.face().idx()];
            let Some((sub, hole)) = Hole::new(edit, n == 4) else { continue };
            if hole.level > MAX_LEVEL {
                let (path, level) = (&edit.path, hole.level);
                return Err(Error::input(format!(
                    "`t faceedit` with path {path:?} makes a hole {level} halvings deep; at most {MAX_LEVEL} work: \
                     leave the hole out or make it larger"
                )));
            }
            holes.insert(patch_of(edit.face(), sub), hole);
            holes.demand_rates(topology, edit.face(), sub, hole);
        }
        Ok(holes)
    }

    fn insert(&mut self, patch: PatchId, hole: Hole) {
        let list = self.of_patch.entry(patch).or_default();
        if !list.iter().any(|h| h.contains(&hole)) {
            list.retain(|h| !hole.contains(h));
            list.push(hole);
        }
    }

    fn demand_rates(&mut self, topology: &Topology, face: FaceId, sub: u32, hole: Hole) {
        let (first, n) = topology.face_corners(face.0);
        let touches = hole.touches();
        let mut demand = |h: u32, level: u32| {
            let known = self.edge_level.entry(topology.edge_id(h)).or_default();
            *known = level.max(*known);
        };
        if n == 4 {
            (0..4).filter(|&k| touches[k as usize]).for_each(|k| demand(first + k, hole.level));
            return;
        }
        // A polygon's edge has two patches along it, each with half the rate.
        for (side, k) in [(0, sub), (3, (sub + n - 1) % n)] {
            if touches[side] {
                demand(first + k, hole.level + 1);
            }
        }
        if touches[1] || touches[2] {
            let known = self.inner_level.entry(face).or_default();
            *known = hole.level.max(*known);
        }
    }

    pub fn is_empty(&self) -> bool {
        self.of_patch.is_empty()
    }

    /// A power of two that divides the rate of the edge of `h`.
    pub fn edge_unit(&self, topology: &Topology, h: u32) -> u32 {
        if self.is_empty() { 1 } else { 1 << self.edge_level.get(&topology.edge_id(h)).copied().unwrap_or(0) }
    }

    /// A power of two that divides the rates of the edges inside a polygon.
    pub fn inner_unit(&self, face: FaceId) -> u32 {
        1 << self.inner_level.get(&face).copied().unwrap_or(0)
    }

    /// A power of two that divides the number of cells of a patch along u and v.
    pub fn cell_unit(&self, patch: PatchId) -> u32 {
        if self.is_empty() {
            return 1;
        }
        match self.of_patch.get(&patch).and_then(|holes| holes.iter().map(|h| h.level).max()) {
            None | Some(0) => 1,
            Some(level) => PIECE << level,
        }
    }

    /// Whether (u, v) lies in a hole; borders belong to the cell with the larger u and v.
    pub fn contain(&self, patch: PatchId, u: f64, v: f64) -> bool {
        let cell = |t: f64, level: u32| ((t * f64::from(1 << level)) as u32).min((1 << level) - 1);
        let holes = self.of_patch.get(&patch);
        holes.is_some_and(|holes| holes.iter().any(|h| (cell(u, h.level), cell(v, h.level)) == (h.i, h.j)))
    }

    /// Whether all the cells `i[0]..i[1]` by `j[0]..j[1]` of a patch's grid lie in holes.
    pub fn hide_cells(&self, patch: PatchId, rates: &PatchRates, i: [u32; 2], j: [u32; 2]) -> bool {
        let all = u64::from(i[1] - i[0]) * u64::from(j[1] - j[0]);
        !self.is_empty() && self.n_hidden_cells(patch, rates, i, j) == all
    }

    /// Whether holes take the whole patch.
    pub fn hide(&self, patch: PatchId) -> bool {
        let n = 1 << MAX_LEVEL;
        self.hide_cells(patch, &PatchRates { sides: [n; 4], n_u: n, n_v: n }, [0, n], [0, n])
    }

    /// Of the cells `i[0]..i[1]` by `j[0]..j[1]` of a patch's grid, those that lie in holes.
    pub fn n_hidden_cells(&self, patch: PatchId, rates: &PatchRates, i: [u32; 2], j: [u32; 2]) -> u64 {
        let common = |a: [u32; 2], b: [u32; 2]| u64::from(a[1].min(b[1]).saturating_sub(a[0].max(b[0])));
        let cells = |h: &Hole| common(h.cells(h.i, rates.n_u), i) * common(h.cells(h.j, rates.n_v), j);
        self.of_patch.get(&patch).map_or(0, |holes| holes.iter().map(cells).sum())
    }

    pub fn bytes(&self) -> usize {
        let holes: usize = self.of_patch.values().map(|h| size_of::<Hole>() * h.capacity() + 40).sum();
        holes + 10 * (self.edge_level.capacity() + self.inner_level.capacity())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{EditValue, shapes};

    fn holes(paths: &[&[u32]]) -> Result<Holes> {
        let mut mesh = shapes::cube();
        let hole = |path: &&[u32]| Edit { kind: EditKind::Face, path: path.to_vec(), value: EditValue::Hole };
        mesh.edits = paths.iter().map(hole).collect();
        Holes::new(&mesh, &Topology::new(&mesh, 1), |face, _| PatchId(face.0))
    }

    #[test]
    fn a_hole_covers_its_cell_alone() {
        let holes = holes(&[&[2, 1, 0], &[2, 1, 0, 3]]).unwrap();
        let patch = PatchId(2);
        assert_eq!(holes.cell_unit(patch), 32);
        let rates = PatchRates { sides: [5, 7, 5, 7], n_u: 32, n_v: 64 };
        assert!(holes.contain(patch, 0.5, 0.0) && !holes.contain(patch, 0.75, 0.0));
        assert!(!holes.contain(patch, 0.6, 0.25) && !holes.contain(PatchId(1), 0.5, 0.0));
        assert!(holes.hide_cells(patch, &rates, [16, 24], [0, 16]));
        assert!(!holes.hide_cells(patch, &rates, [16, 25], [0, 16]));
        assert_eq!(holes.n_hidden_cells(patch, &rates, [0, 32], [0, 64]), 8 * 16);
        assert!(!holes.hide(patch));
    }

    #[test]
    fn four_quarters_are_the_whole() {
        let holes = holes(&[&[3, 0], &[3, 1], &[3, 2], &[3, 3]]).unwrap();
        assert!(holes.hide(PatchId(3)));
    }

    #[test]
    fn a_hole_too_deep_is_a_sentence() {
        let message = holes(&[&[0; 11]]).unwrap_err().to_string();
        assert!(message.contains("a hole 10 halvings deep; at most 9 work"), "{message}");
    }
}
