//! The piece: up to 8x8 cells in one block of bytes.

use super::boxes::{CellRect, HEAD_BYTES, Head, IntegerBox, union};

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
///
/// let vertices: Vec<[i32; 3]> = (0..9 * 9).map(|v| [v % 9 * 10, v / 9 * 10, 7]).collect();
/// let layout = PieceLayout::new(&vertices, CellRect { i0: 0, j0: 0, i1: 8, j1: 8 });
/// assert_eq!(layout.bytes(), 640); // 5 bytes a triangle
/// let mut block = vec![0; layout.bytes()];
/// layout.encode(&vertices, &mut block);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PieceLayout {
    cells: CellRect,
    whole: IntegerBox,
    format: VertexFormat,
}

/// Bytes of a piece with `lanes` blocks of 2x2 cells along u and v.
#[inline(always)]
fn block_bytes(lanes: [u8; 2], format: usize) -> usize {
    let [columns, rows] = lanes.map(|n| 2 * usize::from(n) + 1);
    (HEAD_BYTES + 3 * columns * rows * format + TAIL_BYTES).next_multiple_of(LINE_BYTES)
}

impl PieceLayout {
    /// The layout of the piece over `cells` (1 to 8 along u and v) with these vertices: (n_u + 1) (n_v + 1) lattice points, i fastest,
    /// every |coordinate| at most 2^24.
    #[inline]
    pub fn new(vertices: &[[i32; 3]], cells: CellRect) -> Self {
        let [n_u, n_v] = cells.size();
        debug_assert!((1..=MAX_CELLS).contains(&n_u) && (1..=MAX_CELLS).contains(&n_v));
        assert_eq!(vertices.len(), (n_u + 1) * (n_v + 1), "a piece of {n_u} x {n_v} cells");
        let whole = vertices.iter().fold([[i32::MAX; 3], [i32::MIN; 3]], |b, v| union(b, [*v, *v]));
        let extent = (0..3).map(|k| (whole[1][k] - whole[0][k]) as u32).max().unwrap_or(0);
        Self { cells, whole, format: VertexFormat::for_extent(extent) }
    }

    /// Blocks along u and v.
    #[inline(always)]
    fn lanes(&self) -> [u8; 2] {
        self.cells.size().map(|n| n.div_ceil(2) as u8)
    }

    /// Exact size of the block, a multiple of 64: 640 at 8x8 cells and 16 bits (5 bytes a triangle), 896 at 24 bits (7).
    #[inline]
    pub fn bytes(&self) -> usize {
        block_bytes(self.lanes(), self.format as usize)
    }

    /// How vertices are stored.
    pub fn format(&self) -> VertexFormat {
        self.format
    }

    /// Writes the block. `vertices` are those of [`Self::new`]; `out` is [`Self::bytes`] long.
    #[inline]
    pub fn encode(&self, vertices: &[[i32; 3]], out: &mut [u8]) {
        assert_eq!(out.len(), self.bytes(), "room for a piece");
        let columns = 2 * usize::from(self.lanes()[0]) + 1;
        let head = Head::new(self.whole, &self.boxes(vertices), self.lanes(), self.cells, self.format as u8);
        out[..HEAD_BYTES].copy_from_slice(bytemuck::bytes_of(&head));
        let rows = &mut out[HEAD_BYTES..];
        match self.format {
            VertexFormat::Two => self.write_rows::<2>(vertices, columns, rows),
            VertexFormat::Three => self.write_rows::<3>(vertices, columns, rows),
            VertexFormat::Four => self.write_rows::<4>(vertices, columns, rows),
        }
    }

    /// Index of vertex (i, j); beyond the last column or row, that of the last. Cells there have no area, and are never hit.
    #[inline(always)]
    fn vertex(&self, i: usize, j: usize) -> usize {
        let [n_u, n_v] = self.cells.size();
        j.min(n_v) * (n_u + 1) + i.min(n_u)
    }

    /// The boxes of the blocks.
    #[inline(always)]
    fn boxes(&self, vertices: &[[i32; 3]]) -> [IntegerBox; 16] {
        let mut boxes = [self.whole; 16];
        for b in 0..usize::from(self.lanes()[1]) {
            for a in 0..usize::from(self.lanes()[0]) {
                let corners = (0..9).map(|c| vertices[self.vertex(2 * a + c % 3, 2 * b + c / 3)]);
                boxes[4 * b + a] = corners.fold([[i32::MAX; 3], [i32::MIN; 3]], |b, v| union(b, [v, v]));
            }
        }
        boxes
    }

    /// Writes row after row: its x, its y, its z.
    #[inline(always)]
    fn write_rows<const BYTES: usize>(&self, vertices: &[[i32; 3]], columns: usize, out: &mut [u8]) {
        let n_rows = 2 * usize::from(self.lanes()[1]) + 1;
        let mut places = out.chunks_exact_mut(BYTES);
        for j in 0..n_rows {
            for (axis, low) in self.whole[0].into_iter().enumerate() {
                for (i, place) in (0..columns).zip(&mut places) {
                    let offset = vertices[self.vertex(i, j)][axis] - low;
                    place.copy_from_slice(&offset.to_le_bytes()[..BYTES]);
                }
            }
        }
        places.for_each(|place| place.fill(0));
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
    fn read<const BYTES: usize>(&self, i: usize, j: usize) -> [i32; 3] {
        std::array::from_fn(|k| {
            let at = self.row_start(j, k) + BYTES * i;
            let mut word = [0; 4];
            word[..BYTES].copy_from_slice(&self.bytes[at..at + BYTES]);
            self.head.base[k] + i32::from_le_bytes(word)
        })
    }

    /// Where the coordinates `axis` of row `j` begin.
    #[inline(always)]
    pub(super) fn row_start(&self, j: usize, axis: usize) -> usize {
        let columns = 2 * usize::from(self.head.lanes[0]) + 1;
        HEAD_BYTES + usize::from(self.head.format) * columns * (3 * j + axis)
    }
}
