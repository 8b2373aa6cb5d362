//! The piece: up to 8x8 cells in one block of bytes.

use super::boxes::{CellRect, HEAD_BYTES, Head, IntegerBox, LaneBoxes};
use crate::math::simd::{self, Kernel, Task};
use crate::math::{Bounds, LatticeGrid, WINDOW};
use glam::IVec3;

/// Cells a piece can have along u and along v.
pub const MAX_CELLS: usize = 8;

/// Bytes after the last vertex, so that a SIMD load of the last vertices stays inside.
const TAIL_BYTES: usize = 8;

/// Blocks begin and end on cache lines.
const LINE_BYTES: usize = 64;

/// Bytes of the largest piece.
pub const MOST_PIECE_BYTES: usize = block_bytes([(MAX_CELLS / 2) as u8; 2], VertexFormat::Four as usize);

/// How a vertex coordinate is stored: an unsigned offset from the piece's lowest corner.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum VertexFormat {
    /// 16 bits: the piece is less than 2^16 steps wide.
    Two = 2,
    /// 24 bits: less than 2^24 steps wide.
    Three = 3,
    /// 32 bits: at least half as wide as the whole lattice. A mesh has a handful of such pieces at most.
    Four = 4,
}

impl VertexFormat {
    /// The smallest format for a piece of this width in steps.
    #[inline(always)]
    fn for_extent(extent: u32) -> Self {
        match extent {
            0..0x1_0000 => Self::Two,
            0x1_0000..0x100_0000 => Self::Three,
            _ => Self::Four,
        }
    }
}

/// Everything that is known about a piece before it is written, its exact size above all.
///
/// ```
/// use lazytess::grid::{CellRect, PieceLayout};
/// use lazytess::math::LatticeGrid;
///
/// let points: Vec<[i32; 3]> = (0..9 * 9).map(|v| [v % 9 * 10, v / 9 * 10, 7]).collect();
/// let vertices = LatticeGrid::from_points(&points, 9);
/// let layout = PieceLayout::new(&vertices, CellRect { i0: 0, j0: 0, i1: 8, j1: 8 }, [8, 8]);
/// assert_eq!(layout.bytes(), 640); // 5 bytes a triangle
/// let mut block = vec![0; layout.bytes()];
/// layout.encode(&vertices, &mut block);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PieceLayout {
    cells: CellRect,
    grid: [u16; 2],
    whole: IntegerBox,
    boxes: LaneBoxes,
    format: VertexFormat,
}

/// Bytes of a piece with `lanes` blocks of 2x2 cells along u and v.
#[inline(always)]
const fn block_bytes(lanes: [u8; 2], format: usize) -> usize {
    used_bytes(lanes, format).next_multiple_of(LINE_BYTES)
}

/// The same, up to the last byte that may be loaded.
#[inline(always)]
const fn used_bytes(lanes: [u8; 2], format: usize) -> usize {
    let (columns, rows) = (2 * lanes[0] as usize + 1, 2 * lanes[1] as usize + 1);
    HEAD_BYTES + 3 * columns * rows * format + TAIL_BYTES
}

impl PieceLayout {
    /// The layout of the piece over `cells` (1 to 8 along u and v) with these vertices, every |coordinate| at most
    /// 2^24, of a patch of `grid` cells along u and v.
    #[inline]
    pub fn new(vertices: &LatticeGrid, cells: CellRect, grid: [u16; 2]) -> Self {
        let [n_u, n_v] = cells.size();
        debug_assert!((1..=MAX_CELLS).contains(&n_u) && (1..=MAX_CELLS).contains(&n_v));
        // Numbers one by one: both at once would wait for their stores.
        let [columns, rows] = vertices.size();
        assert!(columns == n_u + 1 && rows == n_v + 1, "a piece of {n_u} x {n_v} cells");
        let mut layout = Self { cells, grid, whole: [[0; 3]; 2], boxes: LaneBoxes::UNSET, format: VertexFormat::Four };
        let whole = simd::run(BlockBoxes { vertices, lanes: lanes(cells), boxes: &mut layout.boxes });
        let extent = (0..3).map(|k| (whole[1][k] - whole[0][k]) as u32).max().unwrap_or(0);
        (layout.whole, layout.format) = (whole, VertexFormat::for_extent(extent));
        layout
    }

    /// Exact size of the block, a multiple of 64: 640 at 8x8 cells and 16 bits (5 bytes a triangle), 896 at 24 bits
    /// (7).
    #[inline]
    pub fn bytes(&self) -> usize {
        block_bytes(lanes(self.cells), self.format as usize)
    }

    /// How vertices are stored.
    pub fn format(&self) -> VertexFormat {
        self.format
    }

    /// Writes the block. `vertices` are those of [`Self::new`]; `out` is [`Self::bytes`] long and aligned to 4 bytes at
    /// least.
    #[inline]
    pub fn encode(&self, vertices: &LatticeGrid, out: &mut [u8]) {
        assert_eq!(out.len(), self.bytes(), "room for a piece");
        simd::run(Encode { layout: self, vertices, out });
    }
}

/// Blocks along u and v.
#[inline(always)]
fn lanes(cells: CellRect) -> [u8; 2] {
    cells.size().map(|n| n.div_ceil(2) as u8)
}

/// Finds the box around a piece's vertices, and those around its blocks'.
struct BlockBoxes<'a> {
    vertices: &'a LatticeGrid,
    lanes: [u8; 2],
    boxes: &'a mut LaneBoxes,
}

// Vertices beyond the last column or row are those of the last: cells there have no area, and are never hit. So rows of
// blocks are always taken in twos.
impl Task for BlockBoxes<'_> {
    type Output = IntegerBox;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> IntegerBox {
        let [n_a, n_b] = self.lanes.map(usize::from);
        let last_row = self.vertices.size()[1] - 1;
        let [mut lowest, mut highest] = [[0; 3]; 2];
        for (axis, (lowest, highest)) in lowest.iter_mut().zip(&mut highest).enumerate() {
            let row = |j: usize| self.vertices.window(axis, j.min(last_row));
            let mut below = min_max_of_threes(k, row(0));
            let mut of_all = [k.splat_i(i32::MAX), k.splat_i(i32::MIN)];
            for two in 0..n_b.div_ceil(2) {
                let j = 4 * two;
                let at_middle = min_max_of_threes(k, row(j + 2));
                let above = min_max_of_threes(k, row(j + 4));
                let first = of_three(k, below, min_max_of_threes(k, row(j + 1)), at_middle);
                let second = of_three(k, at_middle, min_max_of_threes(k, row(j + 3)), above);
                let [low, high] = [k.even_lanes(first[0], second[0]), k.even_lanes(first[1], second[1])];
                self.boxes.low[axis][8 * two..8 * two + 8].copy_from_slice(&k.store_i(low));
                self.boxes.high[axis][8 * two..8 * two + 8].copy_from_slice(&k.store_i(high));
                of_all = [k.min_i(of_all[0], low), k.max_i(of_all[1], high)];
                below = above;
            }
            // Lanes beyond the last block of a row hold what they may.
            let (low, high) = (k.store_i(of_all[0]), k.store_i(of_all[1]));
            (*lowest, *highest) = (low[0], high[0]);
            for lane in 0..n_a {
                *lowest = (*lowest).min(low[lane].min(low[4 + lane]));
                *highest = (*highest).max(high[lane].max(high[4 + lane]));
            }
        }
        [lowest, highest]
    }
}

/// The least and the greatest of three rows.
#[inline(always)]
fn of_three<K: Kernel>(k: K, a: [K::I; 2], b: [K::I; 2], c: [K::I; 2]) -> [K::I; 2] {
    [k.min_i(k.min_i(a[0], b[0]), c[0]), k.max_i(k.max_i(a[1], b[1]), c[1])]
}

/// The least and the greatest of each three numbers of a row that follow each other, from the first eight on.
#[inline(always)]
fn min_max_of_threes<K: Kernel>(k: K, row: &[i32; WINDOW]) -> [K::I; 2] {
    let [a, b, c] = [eight(k, row, 0), eight(k, row, 1), eight(k, row, 2)];
    [k.min_i(k.min_i(a, b), c), k.max_i(k.max_i(a, b), c)]
}

/// Eight numbers of a row.
#[inline(always)]
fn eight<K: Kernel>(k: K, row: &[i32; WINDOW], from: usize) -> K::I {
    k.load_i(row[from..].first_chunk().expect("a window is longer"))
}

/// Writes a block.
struct Encode<'a> {
    layout: &'a PieceLayout,
    vertices: &'a LatticeGrid,
    out: &'a mut [u8],
}

impl Task for Encode<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let Self { layout: PieceLayout { cells, grid, whole, boxes, format }, vertices, out } = self;
        let head: &mut Head = bytemuck::from_bytes_mut(&mut out[..HEAD_BYTES]);
        head.set(*whole, boxes, lanes(*cells), *cells, *grid, *format as u8);
        match format {
            VertexFormat::Two => write_rows::<2, K>(k, vertices, whole[0], lanes(*cells), out),
            VertexFormat::Three => write_rows::<3, K>(k, vertices, whole[0], lanes(*cells), out),
            VertexFormat::Four => write_rows::<4, K>(k, vertices, whole[0], lanes(*cells), out),
        }
    }
}

/// Writes row after row: its x, its y, its z.
#[inline(always)]
fn write_rows<const BYTES: usize, K: Kernel>(
    k: K,
    vertices: &LatticeGrid,
    low: [i32; 3],
    lanes: [u8; 2],
    out: &mut [u8],
) {
    let [columns, n_rows] = lanes.map(|n| 2 * usize::from(n) + 1);
    let rows = &mut out[HEAD_BYTES..];
    // What is written after a row is replaced by the next one, and comes to lie in the tail after the last.
    let has_room = BYTES * columns + TAIL_BYTES >= spread_bytes(BYTES);
    match columns {
        9 if BYTES < 4 => write_wide_rows::<BYTES, true, K>(k, vertices, low, [columns, n_rows], rows),
        _ if BYTES < 4 && has_room => write_wide_rows::<BYTES, false, K>(k, vertices, low, [columns, n_rows], rows),
        _ => write_plain_rows::<BYTES>(vertices, low, [columns, n_rows], rows),
    }
    rows[3 * BYTES * columns * n_rows..].fill(0);
}

/// Bytes that are written for eight numbers.
const fn spread_bytes(bytes: usize) -> usize {
    if bytes == 2 { 16 } else { 28 }
}

/// Eight numbers of a row at a time, and where it has `NINE` columns the ninth.
#[inline(always)]
fn write_wide_rows<const BYTES: usize, const NINE: bool, K: Kernel>(
    k: K,
    vertices: &LatticeGrid,
    low: [i32; 3],
    [columns, n_rows]: [usize; 2],
    out: &mut [u8],
) {
    let last_row = vertices.size()[1] - 1;
    let [low_x, low_y, low_z] = low;
    let mut at = 0;
    for j in 0..n_rows {
        for (axis, low) in [(0, low_x), (1, low_y), (2, low_z)] {
            let row = vertices.window(axis, j.min(last_row));
            let place = &mut out[at..at + spread_bytes(BYTES) + if NINE && BYTES == 2 { 2 } else { 0 }];
            let eight = k.sub_i(eight(k, row, 0), k.splat_i(low));
            if BYTES == 2 {
                place[..16].copy_from_slice(bytemuck::cast_slice(&k.lower_halves(eight).map(u16::to_le)));
            } else {
                let [first, second] = k.lower_threes(eight);
                place[..16].copy_from_slice(&first);
                place[12..28].copy_from_slice(&second);
            }
            if NINE {
                let ninth = row[8].wrapping_sub(low).to_le_bytes();
                place[8 * BYTES..9 * BYTES].copy_from_slice(&ninth[..BYTES]);
            }
            at += BYTES * columns;
        }
    }
}

/// One number after the other.
#[inline(never)]
fn write_plain_rows<const BYTES: usize>(
    vertices: &LatticeGrid,
    low: [i32; 3],
    [columns, n_rows]: [usize; 2],
    out: &mut [u8],
) {
    let last_row = vertices.size()[1] - 1;
    let mut places = out.chunks_exact_mut(BYTES);
    for j in 0..n_rows {
        for (axis, low) in low.iter().enumerate() {
            for (x, place) in vertices.window(axis, j.min(last_row))[..columns].iter().zip(&mut places) {
                place.copy_from_slice(&x.wrapping_sub(*low).to_le_bytes()[..BYTES]);
            }
        }
    }
}

/// A piece to be read.
#[derive(Clone, Copy, Debug)]
pub struct PieceView<'b> {
    pub(super) head: &'b Head,
    /// The whole block, head included.
    pub(super) bytes: &'b [u8],
}

impl<'b> PieceView<'b> {
    /// The piece at the start of `bytes`, which must be aligned to 4 bytes at least (64 is best).
    ///
    /// # Panics
    /// If `bytes` is no piece, or shorter than the piece that its head describes.
    #[inline(always)]
    pub fn new(bytes: &'b [u8]) -> Self {
        let head: &Head = bytemuck::from_bytes(&bytes[..HEAD_BYTES]);
        let format = usize::from(head.format);
        let is_whole = (2..=4).contains(&format) && used_bytes(head.lanes, format) <= bytes.len();
        assert!(is_whole && head.tests_its_lanes_only(), "a whole piece");
        Self { head, bytes }
    }

    /// The cells that the piece covers.
    #[inline]
    pub fn cells(&self) -> CellRect {
        self.head.cells
    }

    /// Around all vertices.
    pub fn bounds(&self) -> Bounds {
        let [n_u, n_v] = self.cells().size();
        let places = (0..=n_v).flat_map(|j| (0..=n_u).map(move |i| (i, j)));
        places.map(|(i, j)| IVec3::from_array(self.vertex(i, j)).as_vec3()).collect()
    }

    /// Lattice point (i, j) of the piece, 0 <= i <= n_u, 0 <= j <= n_v.
    #[inline]
    pub fn vertex(&self, i: usize, j: usize) -> [i32; 3] {
        match self.head.format {
            2 => self.read::<2>(i, j),
            3 => self.read::<3>(i, j),
            _ => self.read::<4>(i, j),
        }
    }

    #[inline(always)]
    fn read<const BYTES: usize>(&self, i: usize, j: usize) -> [i32; 3] {
        [self.coordinate::<BYTES>(i, j, 0), self.coordinate::<BYTES>(i, j, 1), self.coordinate::<BYTES>(i, j, 2)]
    }

    #[inline(always)]
    fn coordinate<const BYTES: usize>(&self, i: usize, j: usize, axis: usize) -> i32 {
        let at = self.row_start(j, axis) + BYTES * i;
        let bytes = &self.bytes[at..at + BYTES];
        let offset = match BYTES {
            2 => i32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            3 => i32::from_le_bytes([bytes[0], bytes[1], bytes[2], 0]),
            _ => i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        };
        self.head.base[axis] + offset
    }

    /// Where the coordinates `axis` of row `j` begin.
    #[inline(always)]
    pub(super) fn row_start(&self, j: usize, axis: usize) -> usize {
        HEAD_BYTES + usize::from(self.head.format) * self.columns() * (3 * j + axis)
    }

    /// Rows of vertices.
    #[inline(always)]
    pub(super) fn rows(&self) -> usize {
        2 * usize::from(self.head.lanes[1]) + 1
    }

    /// Vertices of a row.
    #[inline(always)]
    pub(super) fn columns(&self) -> usize {
        2 * usize::from(self.head.lanes[0]) + 1
    }
}

/// Whether the ray starts on a triangle of this piece and leaves to where it is seen clockwise.
pub(super) fn leaves_below(piece: &PieceView<'_>, ray: &super::LatticeRay) -> bool {
    let (CellRect { i0, i1, j0, j1 }, [i, j]) = (piece.cells(), ray.start_cell());
    if !(u32::from(i0)..u32::from(i1)).contains(&i) || !(u32::from(j0)..u32::from(j1)).contains(&j) {
        return false;
    }
    let [a, b, c] = piece.corners(simd::Portable, ray.skip).map(|corner| corner.as_dvec3());
    (b - a).cross(c - a).dot(ray.direction()) < 0.0
}
