//! The piece: up to 8x8 cells in one block of bytes.

use super::boxes::{CellRect, HEAD_BYTES, Head, IntegerBox, LaneBoxes};
use crate::math::simd::{self, Kernel, Task};
use crate::math::{LatticeGrid, WINDOW};

/// Cells a piece can have along u and along v.
pub const MAX_CELLS: usize = 8;

/// Bytes after the last vertex, so that a SIMD load of the last vertices stays inside.
const TAIL_BYTES: usize = 8;

/// Blocks begin and end on cache lines.
const LINE_BYTES: usize = 64;

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
fn block_bytes(lanes: [u8; 2], format: usize) -> usize {
    let [columns, rows] = lanes.map(|n| 2 * usize::from(n) + 1);
    (HEAD_BYTES + 3 * columns * rows * format + TAIL_BYTES).next_multiple_of(LINE_BYTES)
}

impl PieceLayout {
    /// The layout of the piece over `cells` (1 to 8 along u and v) with these vertices, every |coordinate| at most 2^24, of a
    /// patch of `grid` cells along u and v.
    #[inline]
    pub fn new(vertices: &LatticeGrid, cells: CellRect, grid: [u16; 2]) -> Self {
        let [n_u, n_v] = cells.size();
        debug_assert!((1..=MAX_CELLS).contains(&n_u) && (1..=MAX_CELLS).contains(&n_v));
        assert_eq!(vertices.size(), [n_u + 1, n_v + 1], "a piece of {n_u} x {n_v} cells");
        let (whole, boxes) = simd::run(BlockBoxes { vertices, lanes: lanes(cells) });
        let extent = (0..3).map(|k| (whole[1][k] - whole[0][k]) as u32).max().unwrap_or(0);
        Self { cells, grid, whole, boxes, format: VertexFormat::for_extent(extent) }
    }

    /// Exact size of the block, a multiple of 64: 640 at 8x8 cells and 16 bits (5 bytes a triangle), 896 at 24 bits (7).
    #[inline]
    pub fn bytes(&self) -> usize {
        block_bytes(lanes(self.cells), self.format as usize)
    }

    /// How vertices are stored.
    pub fn format(&self) -> VertexFormat {
        self.format
    }

    /// Writes the block. `vertices` are those of [`Self::new`]; `out` is [`Self::bytes`] long.
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

/// The box around a piece's vertices, and those around its blocks'.
struct BlockBoxes<'a> {
    vertices: &'a LatticeGrid,
    lanes: [u8; 2],
}

// Vertices beyond the last column or row are those of the last: cells there have no area, and are never hit.
impl Task for BlockBoxes<'_> {
    type Output = (IntegerBox, LaneBoxes);
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> (IntegerBox, LaneBoxes) {
        let [n_a, n_b] = self.lanes.map(usize::from);
        let last_row = self.vertices.size()[1] - 1;
        let mut boxes = LaneBoxes { low: [[0; 16]; 3], high: [[0; 16]; 3] };
        let [mut lowest, mut highest] = [[i32::MAX; 3], [i32::MIN; 3]];
        for axis in 0..3 {
            let row = |j: usize| self.vertices.window(axis, j.min(last_row));
            let (mut below_low, mut below_high) = min_max_of_threes(k, row(0));
            for b in 0..n_b {
                let (low_1, high_1) = min_max_of_threes(k, row(2 * b + 1));
                let (low_2, high_2) = min_max_of_threes(k, row(2 * b + 2));
                let low = k.even_lanes(k.min_i(k.min_i(below_low, low_1), low_2));
                let high = k.even_lanes(k.max_i(k.max_i(below_high, high_1), high_2));
                (below_low, below_high) = (low_2, high_2);
                boxes.low[axis][4 * b..4 * b + 4].copy_from_slice(&low);
                boxes.high[axis][4 * b..4 * b + 4].copy_from_slice(&high);
                for a in 0..n_a {
                    lowest[axis] = lowest[axis].min(low[a]);
                    highest[axis] = highest[axis].max(high[a]);
                }
            }
        }
        ([lowest, highest], boxes)
    }
}

/// The least and the greatest of each three numbers of a row that follow each other, from the first eight on.
#[inline(always)]
fn min_max_of_threes<K: Kernel>(k: K, row: &[i32; WINDOW]) -> (K::I, K::I) {
    let [a, b, c] = [eight(k, row, 0), eight(k, row, 1), eight(k, row, 2)];
    (k.min_i(k.min_i(a, b), c), k.max_i(k.max_i(a, b), c))
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
        let head = Head::new(*whole, boxes, lanes(*cells), *cells, *grid, *format as u8);
        out[..HEAD_BYTES].copy_from_slice(bytemuck::bytes_of(&head));
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
    let last_row = vertices.size()[1] - 1;
    let mut at = HEAD_BYTES;
    for j in 0..n_rows {
        for (axis, &low) in low.iter().enumerate() {
            let row = vertices.window(axis, j.min(last_row));
            if BYTES == 2 {
                write_narrow_row(k, row, low, columns, &mut out[at..]);
            } else {
                for (x, place) in row[..columns].iter().zip(out[at..].chunks_exact_mut(BYTES)) {
                    place.copy_from_slice(&x.wrapping_sub(low).to_le_bytes()[..BYTES]);
                }
            }
            at += BYTES * columns;
        }
    }
    out[at..].fill(0);
}

/// Writes the first `columns` numbers, up to nine, as offsets from `low` in two bytes, and where there is room what comes
/// after them: the next row will replace it.
#[inline(always)]
fn write_narrow_row<K: Kernel>(k: K, row: &[i32; WINDOW], low: i32, columns: usize, out: &mut [u8]) {
    let narrow = k.lower_halves(k.sub_i(eight(k, row, 0), k.splat_i(low))).map(u16::to_le);
    let bytes: &[u8; 16] = bytemuck::cast_ref(&narrow);
    match out.first_chunk_mut() {
        Some(whole) => *whole = *bytes,
        None => out[..2 * columns].copy_from_slice(&bytes[..2 * columns]),
    }
    if columns > 8 {
        out[16..18].copy_from_slice(&(row[8].wrapping_sub(low) as u16).to_le_bytes());
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
        assert!((2..=4).contains(&format) && block_bytes(head.lanes, format) <= bytes.len(), "a whole piece");
        Self { head, bytes }
    }

    /// The cells that the piece covers.
    #[inline]
    pub fn cells(&self) -> CellRect {
        self.head.cells
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
    pub(super) fn read<const BYTES: usize>(&self, i: usize, j: usize) -> [i32; 3] {
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
        let columns = 2 * usize::from(self.head.lanes[0]) + 1;
        HEAD_BYTES + usize::from(self.head.format) * columns * (3 * j + axis)
    }
}
