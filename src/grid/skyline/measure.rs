//! Patches measured along the axes of a frame, eight cells at a time.

use super::octants::{Extent, NOTHING, steepest};
use super::sheet::Frame;
use crate::grid::frame::{PARTS, part, parts_per_cell};
use crate::grid::vertex_row::VertexRow;
use crate::grid::{PieceView, VertexFormat};
use crate::math::Bounds;
use crate::math::simd::{Kernel, Task};
use glam::{IVec3, Vec3};

/// The least cosine of the angles between triangles of the sheet and the patch that is left.
const LEAST_COSINE: f32 = 0.05;

/// The least sine, roughly, of the angle between two edges of a triangle as n sees it: so that roundings of a triangle's rises are 2^-7 units of height over way at most,
/// which the margins of `view.rs` allow for. (Edges are exact, their heights err by 2^-22 of 2^13 for each step, and their ways are some 2^6 for each step.)
const LEAST_SINE: f32 = 1.0 / 256.0;

/// Some cells of a patch.
#[derive(Clone, Copy)]
pub(super) struct Block {
    /// Around its vertices in x, y and z.
    pub bounds: Bounds,
    /// Of those.
    pub extent: Extent,
    /// How steep its triangles are at most, octant by octant.
    pub steepness: [f32; 8],
}

impl Block {
    pub const EMPTY: Self = Self { bounds: Bounds::EMPTY, extent: Extent::NONE, steepness: [NOTHING; 8] };
}

/// A patch as n sees it.
pub(super) struct Blocks {
    /// By 4 times the part along v and the part along u.
    pub parts: [Block; PARTS * PARTS],
    /// Around all of them.
    pub whole: Bounds,
    /// Whether n sees all triangles.
    pub are_seen: bool,
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

/// Measures all pieces of a patch of so many cells; `None` if corners are no exact floats.
pub(super) struct Measure<'a> {
    pub frame: &'a Frame,
    pub pieces: &'a [PieceView<'a>],
    pub cells: [usize; 2],
}

impl Task for Measure<'_> {
    type Output = Option<Blocks>;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Option<Blocks> {
        let Self { frame, pieces, cells } = self;
        let axes = Axes::new(k, frame);
        let parts = cells.map(parts_per_cell);
        let mut blocks = Blocks { parts: [Block::EMPTY; PARTS * PARTS], whole: Bounds::EMPTY, are_seen: true };
        for piece in pieces {
            if piece.head.format == VertexFormat::Four as u8 {
                return None;
            }
            measure_piece(k, &axes, frame, piece, parts, &mut blocks);
        }
        let Blocks { parts, whole, .. } = &mut blocks;
        for block in parts {
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
    [parts_u, parts_v]: [u8; 2],
    blocks: &mut Blocks,
) {
    let (cells, [n_u, n_v]) = (piece.cells(), piece.cells().size());
    let corner = axes.along_of(k, frame, piece);
    let row_of = |j: usize| part(u32::from(cells.j0) + j as u32, parts_v) as usize;
    let mut low = VertexRow::of(k, piece, 0);
    let mut columns = Columns::new(k);
    for j in 0..n_v {
        let high = VertexRow::of(k, piece, j + 1);
        columns.take_in(k, axes, corner, &low);
        columns.take_in(k, axes, corner, &high);
        let seen = columns.take_in_triangles(k, axes, &low, &high);
        blocks.are_seen &= !seen & ((1 << n_u) - 1) == 0;
        if j + 1 == n_v || row_of(j + 1) != row_of(j) {
            let row = &mut blocks.parts[PARTS * row_of(j)..][..PARTS];
            columns.give_to(k, n_u, usize::from(cells.i0), parts_u, row);
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
}

impl<K: Kernel> Axes<K> {
    #[inline(always)]
    fn new(k: K, frame: &Frame) -> Self {
        let mut axes = [[k.splat(0.0); 3]; 3];
        for (axis, of) in axes.iter_mut().zip(&frame.axes) {
            *axis = [k.splat(of.x), k.splat(of.y), k.splat(of.z)];
        }
        Self { axes, least: k.splat(LEAST_COSINE * LEAST_COSINE * frame.axes[2].length_squared()) }
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

/// What is known of eight columns of cells.
struct Columns<K: Kernel> {
    least: [K::F; 3],
    most: [K::F; 3],
    steepness: [K::F; 8],
}

impl<K: Kernel> Columns<K> {
    #[inline(always)]
    fn new(k: K) -> Self {
        let (least, most) = ([k.splat(f32::INFINITY); 3], [k.splat(f32::NEG_INFINITY); 3]);
        Self { least, most, steepness: [k.splat(NOTHING); 8] }
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

    /// Takes in the triangles between two rows; bit k is set if n sees those of column k.
    #[inline(always)]
    fn take_in_triangles(&mut self, k: K, axes: &Axes<K>, low: &VertexRow<K>, high: &VertexRow<K>) -> u32 {
        // Two edges of each half, one along u and one along v.
        let lower = self.take_in_half(k, axes, minus(k, low.high, low.low), minus(k, high.low, low.low));
        lower & self.take_in_half(k, axes, minus(k, high.high, high.low), minus(k, high.high, low.high))
    }

    #[inline(always)]
    fn take_in_half(&mut self, k: K, axes: &Axes<K>, of_u: [K::F; 3], of_v: [K::F; 3]) -> u32 {
        let ([xu, yu, zu], [xv, yv, zv]) = (axes.along(k, of_u), axes.along(k, of_v));
        let normal = cross(k, of_u, of_v);
        let length_squared = dot(k, normal, normal);
        // The normal's height.
        let (forth, back) = (k.mul(xu, yv), k.mul(yu, xv));
        let up = k.sub(forth, back);
        let zero = k.splat(0.0);
        let is_wide = k.le(k.mul(k.add(k.abs(forth), k.abs(back)), k.splat(LEAST_SINE)), up);
        let is_seen = is_wide & k.le(k.mul(length_squared, axes.least), k.mul(up, up)) & !k.le(up, zero);
        let has_no_area = k.eq(length_squared, zero);
        // What the triangle rises along x and y; not a number, where it has no area.
        let x = k.div(k.sub(k.mul(zu, yv), k.mul(zv, yu)), up);
        let y = k.div(k.sub(k.mul(xu, zv), k.mul(xv, zu)), up);
        steepest(k, [x, y], &mut self.steepness);
        is_seen | has_no_area
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
    fn give_to(&self, k: K, n: usize, first: usize, parts_u: u8, row: &mut [Block]) {
        let (mut least, mut most, mut steepness) = ([[0.0; 8]; 3], [[0.0; 8]; 3], [[0.0; 8]; 8]);
        for axis in 0..3 {
            (least[axis], most[axis]) = (k.store(self.least[axis]), k.store(self.most[axis]));
        }
        for (lanes, of) in steepness.iter_mut().zip(&self.steepness) {
            *lanes = k.store(*of);
        }
        for lane in 0..n {
            let block = &mut row[part((first + lane) as u32, parts_u) as usize];
            let min = Vec3::new(least[0][lane], least[1][lane], least[2][lane]);
            let max = Vec3::new(most[0][lane], most[1][lane], most[2][lane]);
            block.bounds = block.bounds.union(Bounds { min, max });
            for (most, lanes) in block.steepness.iter_mut().zip(&steepness) {
                *most = most.max(lanes[lane]);
            }
        }
    }
}
