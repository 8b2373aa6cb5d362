//! Rectangles of pixels and the order in which they are rendered.

use crate::grid::PACKET;
use glam::DVec2;

/// Columns and rows of pixels whose camera rays are traced together: as many as a packet holds. (A row of eight meets
/// more patches than they do.)
pub const PACKET_SIZE: [u32; 2] = [4, 2];

const _: () = assert!(PACKET_SIZE[0] as usize * PACKET_SIZE[1] as usize == PACKET);

/// A rectangle of pixels of the whole picture: columns `x0..x1`, rows `y0..y1`, row 0 at the top.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PixelRect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl PixelRect {
    /// All pixels of a picture.
    pub fn whole([width, height]: [u32; 2]) -> Self {
        Self { x0: 0, y0: 0, x1: width, y1: height }
    }

    /// Number of columns.
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Number of rows.
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Number of pixels.
    pub fn n_pixels(&self) -> usize {
        self.width() as usize * self.height() as usize
    }

    /// The upper left and the lower right corner, in pixels of the whole picture.
    pub fn corners(&self) -> [DVec2; 2] {
        [[self.x0, self.y0], [self.x1, self.y1]].map(|corner| DVec2::from(corner.map(f64::from)))
    }

    /// The pixels, row by row.
    pub fn pixels(self) -> impl Iterator<Item = [u32; 2]> + Clone {
        (self.y0..self.y1).flat_map(move |y| (self.x0..self.x1).map(move |x| [x, y]))
    }

    /// The rectangle cut into smaller ones of `width` x `height` pixels or less, row by row.
    pub fn blocks(self, [width, height]: [u32; 2]) -> impl Iterator<Item = Self> {
        let rows = (self.y0..self.y1).step_by(height as usize);
        rows.flat_map(move |y0| (self.x0..self.x1).step_by(width as usize).map(move |x0| (x0, y0))).map(
            move |(x0, y0)| Self {
                x0,
                y0,
                x1: self.x1.min(x0.saturating_add(width)),
                y1: self.y1.min(y0.saturating_add(height)),
            },
        )
    }

    /// The pixels that both have; it is empty if there are none.
    pub fn intersection(self, other: Self) -> Self {
        let [x0, y0] = [self.x0.max(other.x0), self.y0.max(other.y0)];
        Self { x0, y0, x1: self.x1.min(other.x1).max(x0), y1: self.y1.min(other.y1).max(y0) }
    }

    /// Index of pixel (x, y) of the whole picture among [`Self::pixels`]; `None` outside.
    pub fn idx(&self, [x, y]: [u32; 2]) -> Option<usize> {
        let inside = (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y);
        inside.then(|| (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize)
    }
}

/// Square tiles over a window, along Hilbert curves: tiles that follow one another share patches, so the cache keeps
/// what the next tile needs.
///
/// The curve fills a square whose side is a power of two; a long window is a row (or column) of such squares.
/// Positions on the curve that fall outside the window are no tile.
#[derive(Clone, Copy, Debug)]
pub struct TileOrder {
    window: PixelRect,
    tile_side: u32,
    columns: u32,
    rows: u32,
    curve_bits: u32,
}

impl TileOrder {
    /// Tiles of `tile_side` × `tile_side` pixels, `tile_side` at least 1, cut off at the border of `window`.
    pub fn new(window: PixelRect, tile_side: u32) -> Self {
        let (columns, rows) = (window.width().div_ceil(tile_side), window.height().div_ceil(tile_side));
        let curve_bits = columns.min(rows).max(1).next_power_of_two().trailing_zeros();
        Self { window, tile_side, columns, rows, curve_bits }
    }

    /// Number of positions on the curve.
    pub fn len(&self) -> u64 {
        u64::from(self.columns.max(self.rows).div_ceil(1 << self.curve_bits)) << (2 * self.curve_bits)
    }

    /// Whether there is nothing to render.
    pub fn is_empty(&self) -> bool {
        self.window.n_pixels() == 0
    }

    /// The tile at `position` in `0..len()`, if there is one.
    pub fn tile(&self, position: u64) -> Option<PixelRect> {
        let square = (position >> (2 * self.curve_bits)) as u32;
        let (x, y) = hilbert(self.curve_bits, position & ((1 << (2 * self.curve_bits)) - 1));
        let along = square << self.curve_bits;
        let (column, row) = if self.columns >= self.rows { (along + x, y) } else { (x, along + y) };
        (column < self.columns && row < self.rows).then(|| self.rect(column, row))
    }

    fn rect(&self, column: u32, row: u32) -> PixelRect {
        let (x0, y0) = (self.window.x0 + column * self.tile_side, self.window.y0 + row * self.tile_side);
        let (x1, y1) = (x0.saturating_add(self.tile_side), y0.saturating_add(self.tile_side));
        PixelRect { x0, y0, x1: x1.min(self.window.x1), y1: y1.min(self.window.y1) }
    }
}

/// Cell number `position` of the Hilbert curve through a square of 2^`bits` cells a side. It starts at (0,0) and ends
/// at (2^bits − 1, 0), so curves in neighbouring squares join.
fn hilbert(bits: u32, position: u64) -> (u32, u32) {
    let (mut x, mut y) = (0u32, 0u32);
    for level in 0..bits {
        let quadrant = position >> (2 * level) & 3;
        let (rx, ry) = ((quadrant >> 1) as u32, ((quadrant ^ (quadrant >> 1)) & 1) as u32);
        if ry == 0 {
            if rx == 1 {
                let last = (1 << level) - 1;
                (x, y) = (last - x, last - y);
            }
            (x, y) = (y, x);
        }
        (x, y) = (x + (rx << level), y + (ry << level));
    }
    (x, y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hilbert_neighbours_are_neighbours() {
        let cells: Vec<_> = (0..256).map(|d| hilbert(4, d)).collect();
        assert!(cells.windows(2).all(|w| w[0].0.abs_diff(w[1].0) + w[0].1.abs_diff(w[1].1) == 1));
        assert_eq!((cells[0], cells[255]), ((0, 0), (15, 0)));
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        for (window, side) in [
            (PixelRect { x0: 5, y0: 3, x1: 105, y1: 40 }, 16),
            (PixelRect { x0: 0, y0: 0, x1: 7, y1: 300 }, 8),
            (PixelRect { x0: 2, y0: 2, x1: 3, y1: 3 }, 16),
            (PixelRect { x0: 9, y0: 9, x1: 9, y1: 20 }, 16),
        ] {
            let order = TileOrder::new(window, side);
            let mut seen = vec![0; window.n_pixels()];
            let tiles = (0..order.len()).filter_map(|i| order.tile(i));
            tiles.flat_map(|tile| tile.pixels()).for_each(|p| seen[window.idx(p).unwrap()] += 1);
            assert!(seen.iter().all(|&n| n == 1), "{window:?}");
        }
    }

    #[test]
    fn blocks_cover_every_pixel_once() {
        let rect = PixelRect { x0: 5, y0: 3, x1: 18, y1: 8 };
        let mut seen = vec![0; rect.n_pixels()];
        for block in rect.blocks([4, 2]) {
            assert!(block.width() <= 4 && block.height() <= 2 && block.n_pixels() > 0);
            block.pixels().for_each(|p| seen[rect.idx(p).unwrap()] += 1);
        }
        assert!(seen.iter().all(|&n| n == 1));
        assert_eq!(PixelRect { x1: 5, ..rect }.blocks([4, 2]).count(), 0);
    }

    #[test]
    fn a_pixel_outside_has_no_index() {
        let rect = PixelRect { x0: 1, y0: 1, x1: 3, y1: 4 };
        assert_eq!((rect.idx([2, 3]), rect.idx([3, 3]), rect.idx([0, 1])), (Some(5), None, None));
    }
}
