//! The patches near the one that is left, measured along its axes.

use super::measure::{Block, Blocks, Division, Measure, MeasureBox};
use super::octants::Extent;
use super::outline::{Outline, Sides, VertexGrid, corners_of_part, lines_around, sides_of};
use crate::grid::frame::{PARTS, PackedFrame, axes, parts_per_cell};
use crate::grid::{LatticeRay, PieceView, leaves_below};
use crate::math::Bounds;
use crate::math::simd;
use glam::{DVec2, IVec3, Vec3};
use std::ops::Range;

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

/// What there is of a patch in the sheet: the blocks of which n sees all triangles.
pub(super) struct NearPatch {
    pub blocks: Vec<Block>,
    pub outline: Outline,
}

/// A part of the patch, or a quarter of one, all of whose triangles n sees.
pub(super) struct LeftPart {
    /// 4 times the part along v and the part along u, or 2 times the quarter along v and the quarter along u.
    pub number: usize,
    pub bounds: Bounds,
    /// Of its triangles, in the frame.
    pub normals: Vec<Vec3>,
}

/// How finely near patches are looked at.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SeenFrom {
    /// Part by part, for all parts of the patch that is left.
    Patch,
    /// Cell by cell or so, for the quarters of one of its parts, along whose axes all is measured. Rays may start so
    /// far above it, in lattice steps.
    Part {
        /// 4 times the one along v and the one along u.
        number: usize,
        /// Less than what the patch would allow for.
        lift: f32,
    },
}

/// A patch and others near it.
pub struct SkylineSheet {
    pub(super) frame: Frame,
    seen_from: SeenFrom,
    /// Of the patch that is left.
    corners: [[i32; 3]; 4],
    /// How large it is.
    pub(super) own: Bounds,
    pub(super) parts: Vec<LeftPart>,
    /// That one first, then others that share corners with it.
    pub(super) patches: Vec<NearPatch>,
    /// Around all others, and what is not seen of those.
    pub(super) others: Vec<Extent>,
}

/// Where the corners of some cells lead along u and along v, twice.
fn lead([a, b, c, d]: [IVec3; 4]) -> [Vec3; 2] {
    [(b - a).as_vec3() + (c - d).as_vec3(), (d - a).as_vec3() + (c - b).as_vec3()]
}

impl Frame {
    /// As the cells between these corners see it, of a patch of so many cells.
    fn new(corners: [[i32; 3]; 4], lift: f32, cells: [usize; 2], is_turned: bool) -> Option<Self> {
        let corners = corners.map(IVec3::from_array);
        let [a, _, c, _] = corners;
        let [of_u, of_v] = lead(corners);
        let along = axes(of_u, of_v)?;
        let [m_u, m_v] = along;
        let n = if is_turned { m_v.cross(m_u) } else { m_u.cross(m_v) };
        let packed = PackedFrame::new(along, cells.map(parts_per_cell), is_turned);
        Some(Self { axes: [m_u, m_v, n], origin: a + (c - a) / 2, lift, packed })
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

/// Blocks along the sides of patches around a part, of its own and of others, at most. With 8 for its own, occlusion
/// rays on a cube at 16 run at 0.8 of the speed; with 16 for the others, finding takes 1.6 times as long (spot at 16).
const FINE: [usize; 2] = [16, 8];

impl SeenFrom {
    fn division(self, cells: [usize; 2], most: usize) -> Division {
        match self {
            Self::Patch => Division::in_parts(cells),
            Self::Part { .. } => Division::fine(cells, most),
        }
    }
}

impl SkylineSheet {
    /// Of all pieces of a patch on which the ray starts, seen from the side to which it leaves; `None` if that is no
    /// side.
    pub fn new(pieces: &[PieceView<'_>], ray: &LatticeRay, seen_from: SeenFrom) -> Option<Self> {
        let cells = cells_of(pieces);
        let sides = sides_of(pieces, cells);
        let is_turned = pieces.iter().any(|piece| leaves_below(piece, ray));
        let corners = sides.each_ref().map(|side| side[0]);
        let [of_u, of_v] = lead(corners.map(IVec3::from_array));
        let most_lift = 0.5 * LIFT * of_u.length().min(of_v.length());
        let (of_frame, lift) = match seen_from {
            SeenFrom::Patch => (corners, most_lift),
            SeenFrom::Part { number, lift } => {
                (corners_of_part(number, &VertexGrid::of(pieces, cells), cells)?, lift.min(most_lift))
            }
        };
        let frame = Frame::new(of_frame, lift, cells, is_turned)?;
        let division = seen_from.division(cells, FINE[0]);
        let blocks = simd::run(Measure { frame: &frame, pieces, division: &division })?;
        let parts = parts_seen(seen_from, &frame, &blocks, &division, pieces, cells);
        let (own, patches, others) = (blocks.whole, Vec::new(), Vec::new());
        let mut sheet = Self { frame, seen_from, corners, own, parts, patches, others };
        sheet.add_seen(blocks, &division, pieces, cells, sides);
        Some(sheet)
    }

    /// Adds what n sees of a patch to the sheet, and boxes around the rest to the others.
    fn add_seen(
        &mut self,
        blocks: Blocks,
        division: &Division,
        pieces: &[PieceView<'_>],
        cells: [usize; 2],
        sides: Sides,
    ) {
        let blocks = blocks.blocks;
        let is_whole = blocks.iter().all(|block| block.is_seen);
        let lines = if is_whole { sides.into() } else { lines_around(&blocks, division, pieces, cells, sides) };
        let (seen, unseen): (Vec<Block>, Vec<Block>) = blocks.into_iter().partition(|block| block.is_seen);
        self.others.extend(unseen.iter().map(|block| block.extent));
        self.patches.push(NearPatch { blocks: seen, outline: Outline { lines, is_whole } });
    }

    /// Adds another patch, all pieces of it; returns false, and does nothing, if it cannot be measured.
    pub fn add(&mut self, pieces: &[PieceView<'_>]) -> bool {
        let (frame, cells) = (&self.frame, cells_of(pieces));
        let shares_corner = |piece: &PieceView<'_>| corners_of(piece).iter().any(|c| self.corners.contains(c));
        if pieces.iter().any(shares_corner) {
            let division = self.seen_from.division(cells, FINE[1]);
            let Some(blocks) = simd::run(Measure { frame, pieces, division: &division }) else { return false };
            match blocks.blocks.iter().any(|block| block.is_seen) {
                true => self.add_seen(blocks, &division, pieces, cells, sides_of(pieces, cells)),
                false => self.others.push(Extent::around(&blocks.whole)),
            }
        } else {
            let Some(whole) = simd::run(MeasureBox { frame, pieces }) else { return false };
            self.others.push(Extent::around(&whole));
        }
        true
    }
}

/// The parts that are left, as far as all of their blocks are seen.
fn parts_seen(
    seen_from: SeenFrom,
    frame: &Frame,
    blocks: &Blocks,
    division: &Division,
    pieces: &[PieceView<'_>],
    cells: [usize; 2],
) -> Vec<LeftPart> {
    let in_parts = match seen_from {
        SeenFrom::Patch => Division::in_parts(cells),
        SeenFrom::Part { .. } => Division::in_half_parts(cells),
    };
    let mut normals = normals(frame, pieces, &in_parts);
    let [of_u, of_v] = [0, 1].map(|axis| in_parts.ranges(axis));
    let mut parts = Vec::new();
    for (b, a) in (0..of_v.len()).flat_map(|b| (0..of_u.len()).map(move |a| (b, a))) {
        let number = match seen_from {
            SeenFrom::Patch => PARTS * b + a,
            SeenFrom::Part { number, .. } if [a / 2, b / 2] == [number % PARTS, number / PARTS] => 2 * (b % 2) + a % 2,
            SeenFrom::Part { .. } => continue,
        };
        if of_u[a].is_empty() || of_v[b].is_empty() {
            continue;
        }
        let blocks_of = |axis: usize, cells: &Range<usize>| {
            division.block_of(axis, cells.start)..=division.block_of(axis, cells.end - 1)
        };
        let in_row = division.n_blocks()[0];
        let places = blocks_of(1, &of_v[b])
            .flat_map(|row| blocks_of(0, &of_u[a]).map(move |column| &blocks.blocks[in_row * row + column]));
        let (bounds, is_seen) = places.fold((Bounds::EMPTY, true), |(bounds, is_seen), block| {
            (bounds.union(block.bounds), is_seen && block.is_seen)
        });
        if is_seen {
            let normals = std::mem::take(&mut normals[in_parts.n_blocks()[0] * b + a]);
            parts.push(LeftPart { number, bounds, normals });
        }
    }
    parts
}

/// The normals of a patch's triangles in the frame, on the side of n, part by part.
fn normals(frame: &Frame, pieces: &[PieceView<'_>], in_parts: &Division) -> Vec<Vec<Vec3>> {
    let [n_a, n_b] = in_parts.n_blocks();
    let mut normals = vec![Vec::new(); n_a * n_b];
    for piece in pieces {
        let (from, [n_u, n_v]) = (piece.cells(), piece.cells().size());
        for (i, j) in (0..n_v).flat_map(|j| (0..n_u).map(move |i| (i, j))) {
            let part_u = in_parts.block_of(0, usize::from(from.i0) + i);
            let part_v = in_parts.block_of(1, usize::from(from.j0) + j);
            let at = |di: usize, dj: usize| IVec3::from_array(piece.vertex(i + di, j + dj)).as_dvec3();
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            for normal in [(b - a).cross(c - a), (c - d).cross(b - d)] {
                let [x, y, z] = frame.axes.map(|axis| axis.as_dvec3().dot(normal));
                normals[n_a * part_v + part_u].push(Vec3::new(x as f32, y as f32, z as f32) * z.signum() as f32);
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
