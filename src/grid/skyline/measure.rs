//! Patches measured along the axes of a frame, eight cells at a time.

use super::octants::{Extent, NOTHING, steepest};
use super::sheet::Frame;
use crate::grid::frame::{half_part, part, parts_per_cell};
use crate::grid::vertex_row::VertexRow;
use crate::grid::{PieceView, VertexFormat};
use crate::math::Bounds;
use crate::math::simd::{Kernel, Task};
use glam::{IVec3, Vec3};
use std::ops::Range;

/// The least cosine of the angles between triangles of the sheet and the patch that is left.
const LEAST_COSINE: f32 = 0.05;

/// By what a scalar product of three components errs at most, and what is made of two such, as a share of the greatest
/// component and the sum of all lengths: 16 roundings of 2^-24.
const ERROR: f32 = 1.0 / 1_048_576.0;

/// Products of edges are exact up to there.
const EXACT: f32 = 16_777_216.0;

/// Some cells of a patch.
#[derive(Clone, Copy)]
pub(super) struct Block {
    /// Around its vertices in x, y and z.
    pub bounds: Bounds,
    /// Of those.
    pub extent: Extent,
    /// How steep its triangles are at most, octant by octant.
    pub steepness: [f32; 8],
    /// Whether n sees all of them.
    pub is_seen: bool,
}

impl Block {
    pub const EMPTY: Self =
        Self { bounds: Bounds::EMPTY, extent: Extent::NONE, steepness: [NOTHING; 8], is_seen: true };
}

/// How the cells of a patch are divided into blocks.
pub(super) struct Division {
    /// For each cell along u, and along v, which block it is in.
    blocks: [Vec<u8>; 2],
}

impl Division {
    /// Into the parts of the patch.
    pub fn in_parts(cells: [usize; 2]) -> Self {
        let parts_of = |n: usize| (0..n as u32).map(|cell| part(cell, parts_per_cell(n)) as u8).collect();
        Self { blocks: cells.map(parts_of) }
    }

    /// Into halves of parts, some of which have no cells.
    pub fn in_half_parts(cells: [usize; 2]) -> Self {
        let parts_of = |n: usize| (0..n as u32).map(|cell| half_part(cell, parts_per_cell(n)) as u8).collect();
        Self { blocks: cells.map(parts_of) }
    }

    /// Into single cells, or into as few as make so many blocks a side.
    pub fn fine(cells: [usize; 2], most: usize) -> Self {
        let block = |cell: usize, n: usize| (cell * most / n.max(most)) as u8;
        Self { blocks: cells.map(|n| (0..n).map(|cell| block(cell, n)).collect()) }
    }

    /// Blocks along u and v.
    pub fn n_blocks(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.blocks[axis].last().map_or(0, |&last| usize::from(last) + 1))
    }

    /// The block that a cell is in, along u or v.
    #[inline(always)]
    pub fn block_of(&self, axis: usize, cell: usize) -> usize {
        usize::from(self.blocks[axis][cell])
    }

    /// The cells of each block along u or v.
    pub fn ranges(&self, axis: usize) -> Vec<Range<usize>> {
        let cells = &self.blocks[axis];
        let first = |block: usize| cells.partition_point(|&of| usize::from(of) < block);
        (0..self.n_blocks()[axis]).map(|block| first(block)..first(block + 1)).collect()
    }
}

/// A patch as n sees it.
pub(super) struct Blocks {
    /// Row by row.
    pub blocks: Vec<Block>,
    /// Around all of them.
    pub whole: Bounds,
}

/// Finds the box around all pieces of a patch; `None` if corners are no exact floats.
pub(super) struct MeasureBox<'a> {
    pub frame: &'a Frame,
    pub pieces: &'a [PieceView<'a>],
}

impl Task for MeasureBox<'_> {
    type Output = Option<Bounds>;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Option<Bounds> {
        let Self { frame, pieces } = self;
        let axes = Axes::new(k, frame);
        let mut whole = Bounds::EMPTY;
        for piece in pieces {
            if piece.head.format == VertexFormat::Four as u8 {
                return None;
            }
            let corner = axes.along_of(k, frame, piece);
            let mut columns = Columns::new(k);
            let [n_u, n_v] = piece.cells().size();
            for j in 0..=n_v {
                columns.take_in(k, &axes, corner, &VertexRow::of(k, piece, j));
            }
            columns.give_box_to(k, n_u, &mut whole);
        }
        Some(whole)
    }
}

/// Measures all pieces of a patch; `None` if corners are no exact floats.
pub(super) struct Measure<'a> {
    pub frame: &'a Frame,
    pub pieces: &'a [PieceView<'a>],
    pub division: &'a Division,
}

impl Task for Measure<'_> {
    type Output = Option<Blocks>;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Option<Blocks> {
        let Self { frame, pieces, division } = self;
        let axes = Axes::new(k, frame);
        let [n_u, n_v] = division.n_blocks();
        let mut blocks = Blocks { blocks: vec![Block::EMPTY; n_u * n_v], whole: Bounds::EMPTY };
        for piece in pieces {
            if piece.head.format == VertexFormat::Four as u8 {
                return None;
            }
            measure_piece(k, &axes, frame, piece, division, &mut blocks.blocks);
        }
        let Blocks { blocks: all, whole } = &mut blocks;
        for block in all {
            block.extent = Extent::of(k, &block.bounds);
            *whole = whole.union(block.bounds);
        }
        Some(blocks)
    }
}

#[inline(always)]
fn measure_piece<K: Kernel>(
    k: K,
    axes: &Axes<K>,
    frame: &Frame,
    piece: &PieceView<'_>,
    division: &Division,
    blocks: &mut [Block],
) {
    let (cells, [n_u, n_v]) = (piece.cells(), piece.cells().size());
    let [i0, j0] = [cells.i0, cells.j0].map(usize::from);
    let corner = axes.along_of(k, frame, piece);
    let in_row = division.n_blocks()[0];
    let of_u = &division.blocks[0][i0..i0 + n_u];
    let mut low = VertexRow::of(k, piece, 0);
    let mut columns = Columns::new(k);
    for j in 0..n_v {
        let high = VertexRow::of(k, piece, j + 1);
        columns.take_in(k, axes, corner, &low);
        columns.take_in(k, axes, corner, &high);
        columns.take_in_triangles(k, axes, &low, &high);
        let row = division.block_of(1, j0 + j);
        if j + 1 == n_v || division.block_of(1, j0 + j + 1) != row {
            columns.give_to(k, of_u, &mut blocks[in_row * row..][..in_row]);
            columns = Columns::new(k);
        }
        low = high;
    }
}

/// The frame's axes in every lane.
struct Axes<K: Kernel> {
    axes: [[K::F; 3]; 3],
    /// |n|^2 times the square of the least cosine.
    least: K::F,
    /// What n's height of a triangle errs by at most, for each product of the lengths of its edges.
    error_of_up: K::F,
    /// The same for the products that its rises are made of.
    error_of_rise: K::F,
}

impl<K: Kernel> Axes<K> {
    #[inline(always)]
    fn new(k: K, frame: &Frame) -> Self {
        let mut axes = [[k.splat(0.0); 3]; 3];
        for (axis, of) in axes.iter_mut().zip(&frame.axes) {
            *axis = [k.splat(of.x), k.splat(of.y), k.splat(of.z)];
        }
        let [m_u, m_v, n] = frame.axes.map(|axis| axis.abs().max_element());
        let m = m_u.max(m_v);
        Self {
            axes,
            least: k.splat(LEAST_COSINE * LEAST_COSINE * frame.axes[2].length_squared()),
            error_of_up: k.splat(ERROR * m * m),
            error_of_rise: k.splat(ERROR * m * n),
        }
    }

    /// A vector in the frame.
    #[inline(always)]
    fn along(&self, k: K, p: [K::F; 3]) -> [K::F; 3] {
        [dot(k, self.axes[0], p), dot(k, self.axes[1], p), dot(k, self.axes[2], p)]
    }

    /// A piece's corner in the frame.
    #[inline(always)]
    fn along_of(&self, k: K, frame: &Frame, piece: &PieceView<'_>) -> [K::F; 3] {
        let [x, y, z] = (IVec3::from_array(piece.head.base) - frame.origin).as_vec3().to_array();
        self.along(k, [k.splat(x), k.splat(y), k.splat(z)])
    }
}

#[inline(always)]
fn dot<K: Kernel>(k: K, a: [K::F; 3], b: [K::F; 3]) -> K::F {
    k.add(k.add(k.mul(a[0], b[0]), k.mul(a[1], b[1])), k.mul(a[2], b[2]))
}

#[inline(always)]
fn minus<K: Kernel>(k: K, a: [K::F; 3], b: [K::F; 3]) -> [K::F; 3] {
    [k.sub(a[0], b[0]), k.sub(a[1], b[1]), k.sub(a[2], b[2])]
}

#[inline(always)]
fn cross<K: Kernel>(k: K, a: [K::F; 3], b: [K::F; 3]) -> [K::F; 3] {
    [
        k.sub(k.mul(a[1], b[2]), k.mul(a[2], b[1])),
        k.sub(k.mul(a[2], b[0]), k.mul(a[0], b[2])),
        k.sub(k.mul(a[0], b[1]), k.mul(a[1], b[0])),
    ]
}

/// The sum of the components' magnitudes.
#[inline(always)]
fn length<K: Kernel>(k: K, [x, y, z]: [K::F; 3]) -> K::F {
    k.add(k.add(k.abs(x), k.abs(y)), k.abs(z))
}

/// What is known of eight columns of cells.
struct Columns<K: Kernel> {
    least: [K::F; 3],
    most: [K::F; 3],
    steepness: [K::F; 8],
    /// Those of which n sees all triangles, as bits.
    seen: u32,
}

impl<K: Kernel> Columns<K> {
    #[inline(always)]
    fn new(k: K) -> Self {
        let (least, most) = ([k.splat(f32::INFINITY); 3], [k.splat(f32::NEG_INFINITY); 3]);
        Self { least, most, steepness: [k.splat(NOTHING); 8], seen: u32::MAX }
    }

    /// Takes in the vertices of a row.
    #[inline(always)]
    fn take_in(&mut self, k: K, axes: &Axes<K>, corner: [K::F; 3], row: &VertexRow<K>) {
        let (low, high) = (axes.along(k, row.low), axes.along(k, row.high));
        for axis in 0..3 {
            let (a, b) = (k.add(corner[axis], low[axis]), k.add(corner[axis], high[axis]));
            self.least[axis] = k.min(self.least[axis], k.min(a, b));
            self.most[axis] = k.max(self.most[axis], k.max(a, b));
        }
    }

    /// Takes in the triangles between two rows.
    #[inline(always)]
    fn take_in_triangles(&mut self, k: K, axes: &Axes<K>, low: &VertexRow<K>, high: &VertexRow<K>) {
        // Two edges of each half, one along u and one along v.
        self.seen &= self.take_in_half(k, axes, minus(k, low.high, low.low), minus(k, high.low, low.low));
        self.seen &= self.take_in_half(k, axes, minus(k, high.high, high.low), minus(k, high.high, low.high));
    }

    /// One triangle of each cell; bit k is set if n sees that of column k.
    #[inline(always)]
    fn take_in_half(&mut self, k: K, axes: &Axes<K>, of_u: [K::F; 3], of_v: [K::F; 3]) -> u32 {
        let ([xu, yu, zu], [xv, yv, zv]) = (axes.along(k, of_u), axes.along(k, of_v));
        let normal = cross(k, of_u, of_v);
        let length_squared = dot(k, normal, normal);
        // The normal's height, and by what it may err.
        let up = k.sub(k.mul(xu, yv), k.mul(yu, xv));
        let lengths = k.mul(length(k, of_u), length(k, of_v));
        let error = k.mul(lengths, axes.error_of_up);
        let eight_errors = k.mul(error, k.splat(8.0));
        let is_seen = k.le(eight_errors, up) & k.le(k.mul(length_squared, axes.least), k.mul(up, up));
        let has_no_area = k.eq(length_squared, k.splat(0.0)) & k.le(lengths, k.splat(EXACT));
        // What the triangle rises along x and y; not a number, where it has no area.
        let x = k.div(k.sub(k.mul(zu, yv), k.mul(zv, yu)), up);
        let y = k.div(k.sub(k.mul(xu, zv), k.mul(xv, zu)), up);
        let rises = k.add(k.abs(x), k.abs(y));
        let errors = k.add(k.mul(error, rises), k.mul(lengths, k.add(axes.error_of_rise, axes.error_of_rise)));
        steepest(k, [x, y], k.div(k.add(errors, errors), up), &mut self.steepness);
        (is_seen & !k.le(up, k.splat(0.0))) | has_no_area
    }

    /// Gives the box around all columns.
    #[inline(always)]
    fn give_box_to(&self, k: K, n: usize, bounds: &mut Bounds) {
        for axis in 0..3 {
            let (least, most) = (k.store(self.least[axis]), k.store(self.most[axis]));
            for lane in 0..n {
                bounds.min[axis] = bounds.min[axis].min(least[lane]);
                bounds.max[axis] = bounds.max[axis].max(most[lane]);
            }
        }
    }

    /// Gives what is known of each column to its block of a row of blocks.
    #[inline(always)]
    fn give_to(&self, k: K, blocks: &[u8], row: &mut [Block]) {
        let (mut least, mut most, mut steepness) = ([[0.0; 8]; 3], [[0.0; 8]; 3], [[0.0; 8]; 8]);
        for axis in 0..3 {
            (least[axis], most[axis]) = (k.store(self.least[axis]), k.store(self.most[axis]));
        }
        for (lanes, of) in steepness.iter_mut().zip(&self.steepness) {
            *lanes = k.store(*of);
        }
        for (lane, &block) in blocks.iter().enumerate() {
            let block = &mut row[usize::from(block)];
            let min = Vec3::new(least[0][lane], least[1][lane], least[2][lane]);
            let max = Vec3::new(most[0][lane], most[1][lane], most[2][lane]);
            block.bounds = block.bounds.union(Bounds { min, max });
            block.is_seen &= self.seen >> lane & 1 == 1;
            for (most, lanes) in block.steepness.iter_mut().zip(&steepness) {
                *most = most.max(lanes[lane]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::octants::octant;
    use super::*;
    use crate::grid::frame::{PackedFrame, axes};
    use crate::grid::tests::support::Random;
    use crate::grid::{CellRect, PieceLayout};
    use crate::math::{LatticeGrid, simd};
    use glam::{DVec2, DVec3};

    /// The steepest of a triangle's directions in each octant, by exact edges.
    fn steepness(frame: &Frame, [a, b, c]: [IVec3; 3]) -> Option<[f64; 8]> {
        let along = |p: IVec3| {
            let [x, y, z] = frame.axes.map(|axis| axis.as_dvec3().dot(p.as_dvec3()));
            DVec3::new(x, y, z)
        };
        let (u, v) = (along(b - a), along(c - a));
        let up = u.x * v.y - u.y * v.x;
        let rises = DVec2::new(u.z * v.y - v.z * u.y, u.x * v.z - v.x * u.z) / up;
        let mut steepest = [f64::MIN; 8];
        for way in (0..64).map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 64.0)) {
            let in_octant = octant(way.abs().as_vec2().to_array(), way.to_array().map(|x| u32::from(x < 0.0)));
            let steepness = &mut steepest[in_octant as usize];
            *steepness = steepness.max(rises.dot(way) / way.abs().max_element());
        }
        (up > 0.0).then_some(steepest)
    }

    #[test]
    fn triangles_are_no_steeper_than_was_measured_however_thin() {
        let (mut random, mut n_thin, mut n_unseen) = (Random(0x7419), 0, 0);
        for k in 0..40_000 {
            let size = 2f64.powf(1.0 + 21.0 * random.point(0.5).x.abs());
            let Some([m_u, m_v]) = axes(random.point(1.0).as_vec3(), random.point(1.0).as_vec3()) else { continue };
            let frame =
                Frame { axes: [m_u, m_v, m_u.cross(m_v)], origin: IVec3::ZERO, lift: 0.0, packed: PackedFrame::NONE };
            let along = random.point(size);
            // Every other one is so thin that roundings decide on which side it is.
            let aside = random.point(if k % 2 == 0 { size } else { 3.0 });
            let corners = [DVec3::ZERO, along, along + aside, 2.0 * along + aside].map(|p| p.round().as_ivec3());
            // One cell of eight in a row, the others without area.
            let place = k % 8;
            let points: Vec<[i32; 3]> =
                (0..18).map(|v| corners[2 * (v / 9) + usize::from(v % 9 > place)].to_array()).collect();
            let vertices = LatticeGrid::from_points(&points, 9);
            let layout = PieceLayout::new(&vertices, CellRect { i0: 0, j0: 0, i1: 8, j1: 1 }, [8, 1]);
            let mut bytes = vec![0; layout.bytes()];
            layout.encode(&vertices, &mut bytes);
            let (pieces, division) = ([PieceView::new(&bytes)], &Division::fine([8, 1], 8));
            let measured = simd::run(Measure { frame: &frame, pieces: &pieces, division });
            let Some(Blocks { blocks, .. }) = measured else { continue };
            assert!((0..8).all(|block| block == place || blocks[block].is_seen), "nothing is there that turns away");
            n_unseen += usize::from(!blocks[place].is_seen);
            if !blocks[place].is_seen {
                continue;
            }
            let [a, b, c, d] = corners;
            for triangle in [[a, b, c], [d, c, b]] {
                if (triangle[1] - triangle[0]).as_dvec3().cross((triangle[2] - triangle[0]).as_dvec3()) == DVec3::ZERO {
                    continue;
                }
                let exact = steepness(&frame, triangle).expect("a triangle that n sees");
                for octant in 0..8 {
                    let most = blocks[place].steepness[octant];
                    assert!(exact[octant] <= f64::from(most), "{triangle:?} in octant {octant}: {exact:?}, {most}");
                }
                n_thin += k % 2;
            }
        }
        assert!(n_thin > 1000 && n_unseen > 1000, "only {n_thin} thin ones, {n_unseen} that turn away");
    }
}
