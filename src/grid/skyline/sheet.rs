//! The patches near the one that is left, measured along its axes.

use super::measure::{Block, Blocks, Measure, MeasureBox};
use super::octants::Extent;
use crate::grid::frame::{PARTS, PackedFrame, axes, part, parts_per_cell};
use crate::grid::{LatticeRay, PieceView, leaves_below};
use crate::math::Bounds;
use crate::math::simd;
use glam::{DVec2, IVec3, Vec3};

/// Rays may start so far above the patch, as a share of its length or width.
const LIFT: f32 = 1.0 / 32.0;

/// Coordinates of the frame.
pub(super) struct Frame {
    /// m_u, m_v, and n turned to the side that is left: whole numbers.
    pub axes: [Vec3; 3],
    /// The lattice point that x, y and z are counted from.
    pub origin: IVec3,
    /// How far above the patch rays may start, in lattice steps.
    pub lift: f32,
    pub packed: PackedFrame,
}

/// A patch that may be of the sheet: n sees all of its triangles.
pub(super) struct NearPatch {
    /// By 4 times the part along v and the part along u.
    pub blocks: [Block; PARTS * PARTS],
    /// Around all of them.
    pub whole: Bounds,
    pub sides: Sides,
}

/// Vertices of the sides v = 0, u = 1, v = 1, u = 0, one after the other around the patch, each once.
pub(super) type Sides = [Vec<[i32; 3]>; 4];

/// A patch and others near it.
pub struct SkylineSheet {
    pub(super) frame: Frame,
    /// The one that is left, and others that share corners with it.
    pub(super) patches: Vec<NearPatch>,
    /// Around all others.
    pub(super) others: Vec<Extent>,
    /// Normals of the first patch's triangles, in the frame, block by block.
    pub(super) normals: [Vec<Vec3>; PARTS * PARTS],
}

impl Frame {
    fn new(sides: &Sides, cells: [usize; 2], is_turned: bool) -> Option<Self> {
        let [a, b, c, d] = sides.each_ref().map(|side| IVec3::from_array(side[0]));
        let (of_u, of_v) = ((b - a).as_vec3() + (c - d).as_vec3(), (d - a).as_vec3() + (c - b).as_vec3());
        let along = axes(of_u, of_v)?;
        let [m_u, m_v] = along;
        let n = if is_turned { m_v.cross(m_u) } else { m_u.cross(m_v) };
        Some(Self {
            axes: [m_u, m_v, n],
            origin: a + (c - a) / 2,
            lift: 0.5 * LIFT * of_u.length().min(of_v.length()),
            packed: PackedFrame::new(along, cells.map(parts_per_cell), is_turned),
        })
    }

    /// Where above x and y a lattice point is.
    pub fn place(&self, p: [i32; 3]) -> DVec2 {
        let p = (IVec3::from_array(p) - self.origin).as_dvec3();
        let [m_u, m_v, _] = self.axes.map(Vec3::as_dvec3);
        DVec2::new(m_u.dot(p), m_v.dot(p))
    }

    /// The box of a box of the lattice.
    #[inline(always)]
    pub fn around(&self, b: &Bounds) -> Bounds {
        let (middle, half) = (b.center() - self.origin.as_vec3(), 0.5 * (b.max - b.min));
        let [x, y, z] = self.axes;
        let middle = Vec3::new(x.dot(middle), y.dot(middle), z.dot(middle));
        let half = Vec3::new(x.abs().dot(half), y.abs().dot(half), z.abs().dot(half));
        Bounds { min: middle - half, max: middle + half }
    }
}

impl SkylineSheet {
    /// Of all pieces of a patch on which the ray starts, seen from the side to which it leaves; `None` if that is no
    /// side, or bent too much.
    pub fn new(pieces: &[PieceView<'_>], ray: &LatticeRay) -> Option<Self> {
        let cells = cells_of(pieces);
        let sides = sides_of(pieces, cells);
        let is_turned = pieces.iter().any(|piece| leaves_below(piece, ray));
        let frame = Frame::new(&sides, cells, is_turned)?;
        let Blocks { parts, whole, are_seen } = simd::run(Measure { frame: &frame, pieces, cells })?;
        let normals = normals(&frame, pieces, cells);
        let own = NearPatch { blocks: parts, whole, sides };
        are_seen.then(|| Self { frame, patches: vec![own], others: Vec::new(), normals })
    }

    /// Adds another patch, all pieces of it; returns false, and does nothing, if it cannot be measured.
    pub fn add(&mut self, pieces: &[PieceView<'_>]) -> bool {
        let (frame, cells) = (&self.frame, cells_of(pieces));
        let own = self.patches[0].sides.each_ref().map(|side| side[0]);
        let whole = if pieces.iter().any(|piece| corners_of(piece).iter().any(|corner| own.contains(corner))) {
            let Some(blocks) = simd::run(Measure { frame, pieces, cells }) else { return false };
            let Blocks { parts, whole, are_seen } = blocks;
            if are_seen {
                self.patches.push(NearPatch { blocks: parts, whole, sides: sides_of(pieces, cells) });
                return true;
            }
            whole
        } else {
            let Some(whole) = simd::run(MeasureBox { frame, pieces }) else { return false };
            whole
        };
        self.others.push(Extent::around(&whole));
        true
    }
}

/// The normals of a patch's triangles in the frame, on the side of n, block by block.
fn normals(frame: &Frame, pieces: &[PieceView<'_>], cells: [usize; 2]) -> [Vec<Vec3>; PARTS * PARTS] {
    let [parts_u, parts_v] = cells.map(parts_per_cell);
    let mut normals: [Vec<Vec3>; PARTS * PARTS] = Default::default();
    for piece in pieces {
        let (from, [n_u, n_v]) = (piece.cells(), piece.cells().size());
        for (i, j) in (0..n_v).flat_map(|j| (0..n_u).map(move |i| (i, j))) {
            let (u, v) = (part(u32::from(from.i0) + i as u32, parts_u), part(u32::from(from.j0) + j as u32, parts_v));
            let block = PARTS * v as usize + u as usize;
            let at = |di: usize, dj: usize| IVec3::from_array(piece.vertex(i + di, j + dj)).as_dvec3();
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            for normal in [(b - a).cross(c - a), (c - d).cross(b - d)] {
                let [x, y, z] = frame.axes.map(|axis| axis.as_dvec3().dot(normal));
                normals[block].push(Vec3::new(x as f32, y as f32, z as f32) * z.signum() as f32);
            }
        }
    }
    normals
}

fn corners_of(piece: &PieceView<'_>) -> [[i32; 3]; 4] {
    let [n_u, n_v] = piece.cells().size();
    [[0, 0], [n_u, 0], [0, n_v], [n_u, n_v]].map(|[i, j]| piece.vertex(i, j))
}

/// Cells of the patch that these are all pieces of.
fn cells_of(pieces: &[PieceView<'_>]) -> [usize; 2] {
    let ends = pieces.iter().map(|piece| [piece.cells().i1, piece.cells().j1].map(usize::from));
    ends.fold([0, 0], |all, end| [all[0].max(end[0]), all[1].max(end[1])])
}

/// The sides of the patch that these are all pieces of.
fn sides_of(pieces: &[PieceView<'_>], [n_u, n_v]: [usize; 2]) -> Sides {
    let mut sides = [n_u, n_v, n_u, n_v].map(|n| vec![[0; 3]; n + 1]);
    for piece in pieces {
        let (cells, [columns, rows]) = (piece.cells(), piece.cells().size());
        let [i0, i1, j0, j1] = [cells.i0, cells.i1, cells.j0, cells.j1].map(usize::from);
        for i in 0..=columns {
            if j0 == 0 {
                sides[0][i0 + i] = piece.vertex(i, 0);
            }
            if j1 == n_v {
                sides[2][n_u - i0 - i] = piece.vertex(i, rows);
            }
        }
        for j in 0..=rows {
            if i1 == n_u {
                sides[1][j0 + j] = piece.vertex(columns, j);
            }
            if i0 == 0 {
                sides[3][n_v - j0 - j] = piece.vertex(0, j);
            }
        }
    }
    sides.iter_mut().for_each(Vec::dedup);
    sides
}
