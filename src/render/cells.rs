//! The cells that a tile is refined into, and the probes at their corners and middles.
//!
//! A tile of 64 x 64 pixels has cells of 16, 8 and 4 pixels a side, aligned to the whole picture. A cell knows nine
//! probes: its corners, the middles of its sides and its centre, at pixels' centres. Corners and middles on the right
//! and at the bottom belong to the next cell's pixels, or the next tile's.

use super::follow::Shown;
use super::integrators::Probe;
use super::reason::Reason;
use super::tiles::PixelRect;
use super::tracer::Built;

/// Side of a tile in pixels. Smaller tiles share fewer probes, larger ones keep threads waiting at the end.
pub(super) const TILE_SIDE: u32 = 64;

/// Sides of the cells of each level. With 16, bigguy takes 12 % fewer rays than with 8; what ends between their probes
/// is found by following it.
pub(super) const CELL_SIDES: [u32; 3] = [16, 8, 4];

/// Probes along a side of a tile.
const PROBES: u32 = TILE_SIDE + 1;

/// The place of a probe that was not traced.
const UNTRACED: u16 = u16::MAX;

/// What has become of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    /// Part of a larger cell that holds.
    Undivided,
    /// No patch reaches it.
    Empty,
    /// Its interpolation holds: probes differ from it by at most `error` display units, and by `depth` in depth.
    Holds { error: f32, depth: f32 },
    /// It does not, for this reason.
    Split(Reason),
}

/// A traced pixel centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct TracedProbe {
    pub probe: Probe,
    /// The colour that it shows: it is compared with many.
    pub shown: Shown,
    /// The least and the most that samples of its pixel have shown so far, channel by channel.
    pub seen: [Shown; 2],
    /// Blocks built for it.
    pub misses: Built,
}

impl TracedProbe {
    /// Of the first sample of a pixel.
    pub fn new(probe: Probe, misses: Built) -> Self {
        let shown = Shown::new(probe.sample.radiance);
        Self { probe, shown, seen: [shown; 2], misses }
    }
}

/// A tile at work.
pub(super) struct Tile {
    origin: [u32; 2],
    /// Of the whole picture.
    size: [u32; 2],
    /// Where in `traced` the probe of each pixel is, or [`UNTRACED`].
    places: Vec<u16>,
    /// Probes in the order they were traced in.
    traced: Vec<TracedProbe>,
    cells: [Vec<Cell>; CELL_SIDES.len()],
}

/// A cell's place: level, and origin and side in pixels of the whole picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CellPlace {
    pub level: usize,
    pub x: u32,
    pub y: u32,
    pub side: u32,
}

impl CellPlace {
    pub fn pixels(&self) -> PixelRect {
        PixelRect { x0: self.x, y0: self.y, x1: self.x + self.side, y1: self.y + self.side }
    }

    /// Whether one of its probes is at a pixel of it.
    pub fn has_probe(&self, [x, y]: [u32; 2]) -> bool {
        [x - self.x, y - self.y].iter().all(|n| n.is_multiple_of(self.side / 2))
    }

    /// Pixels of its nine probes, row by row.
    pub fn probe_pixels(&self) -> [[u32; 2]; 9] {
        let half = self.side / 2;
        std::array::from_fn(|k| [self.x + half * (k as u32 % 3), self.y + half * (k as u32 / 3)])
    }
}

impl Tile {
    /// Bytes of a tile.
    pub const BYTES: usize = PROBES.pow(2) as usize * (size_of::<u16>() + size_of::<TracedProbe>());

    /// A tile of a picture of `size` pixels.
    pub fn new(size: [u32; 2]) -> Self {
        let cells = CELL_SIDES.map(|side| vec![Cell::Undivided; (TILE_SIDE / side).pow(2) as usize]);
        let n = PROBES.pow(2) as usize;
        Self { origin: [0; 2], size, places: vec![UNTRACED; n], traced: Vec::with_capacity(n), cells }
    }

    /// Begins another tile.
    pub fn reset(&mut self, origin: [u32; 2]) {
        self.origin = origin;
        self.places.fill(UNTRACED);
        self.traced.clear();
        self.cells.iter_mut().for_each(|cells| cells.fill(Cell::Undivided));
    }

    /// The probe at a pixel of the tile or right beside or below it.
    pub fn probe(&self, pixel: [u32; 2]) -> Option<&TracedProbe> {
        self.traced.get(usize::from(self.places[self.probe_idx(pixel)]))
    }

    /// The tile's pixels, whole even where the picture ends.
    pub fn area(&self) -> PixelRect {
        let [x0, y0] = self.origin;
        PixelRect { x0, y0, x1: x0 + TILE_SIDE, y1: y0 + TILE_SIDE }
    }

    pub fn set_probe(&mut self, pixel: [u32; 2], probe: TracedProbe) {
        let idx = self.probe_idx(pixel);
        debug_assert_eq!(self.places[idx], UNTRACED);
        self.places[idx] = self.traced.len() as u16;
        self.traced.push(probe);
    }

    /// Notes what all samples of a traced pixel have shown.
    pub fn note_seen(&mut self, pixel: [u32; 2], seen: [Shown; 2]) {
        let place = self.places[self.probe_idx(pixel)];
        self.traced[usize::from(place)].seen = seen;
    }

    fn probe_idx(&self, [x, y]: [u32; 2]) -> usize {
        ((y - self.origin[1]) * PROBES + x - self.origin[0]) as usize
    }

    /// The cell of a level that has the pixel.
    pub fn place(&self, level: usize, [x, y]: [u32; 2]) -> CellPlace {
        let side = CELL_SIDES[level];
        CellPlace { level, x: x - x % side, y: y - y % side, side }
    }

    /// Cells of a level within the picture whose larger cell was split.
    pub fn cells_to_judge(&self, level: usize) -> Vec<CellPlace> {
        let side = CELL_SIDES[level];
        let n = TILE_SIDE / side;
        let places =
            (0..n * n).map(|k| self.place(level, [self.origin[0] + k % n * side, self.origin[1] + k / n * side]));
        places
            .filter(|p| p.x < self.size[0] && p.y < self.size[1])
            .filter(|p| level == 0 || matches!(self.cell(&self.place(level - 1, [p.x, p.y])), Cell::Split(_)))
            .collect()
    }

    pub fn cell(&self, place: &CellPlace) -> Cell {
        self.cells[place.level][self.cell_idx(place)]
    }

    /// Whether any cell holds so far.
    pub fn any_holds(&self) -> bool {
        self.cells.iter().flatten().any(|cell| matches!(cell, Cell::Holds { .. }))
    }

    pub fn set_cell(&mut self, place: &CellPlace, cell: Cell) {
        let idx = self.cell_idx(place);
        self.cells[place.level][idx] = cell;
    }

    fn cell_idx(&self, place: &CellPlace) -> usize {
        let [x, y] = [place.x - self.origin[0], place.y - self.origin[1]].map(|n| n / place.side);
        (y * (TILE_SIDE / place.side) + x) as usize
    }

    /// Splits the cells of a level that hold beside one with an edge or a contradiction in it. The silhouettes that
    /// matter to the smallest cells are known from footprints.
    pub fn split_beside_edges(&mut self, level: usize) {
        let n = (TILE_SIDE / CELL_SIDES[level]) as usize;
        let spreads = if level + 1 == CELL_SIDES.len() { Reason::is_edge_of_light } else { Reason::is_edge };
        let has_edge: Vec<bool> =
            self.cells[level].iter().map(|cell| matches!(cell, Cell::Split(reason) if spreads(*reason))).collect();
        for (k, cell) in self.cells[level].iter_mut().enumerate() {
            let (x, y) = (k % n, k / n);
            let rows = y.saturating_sub(1)..(y + 2).min(n);
            let beside = |row: usize| has_edge[row * n + x.saturating_sub(1)..row * n + (x + 2).min(n)].contains(&true);
            if matches!(cell, Cell::Holds { .. }) && rows.clone().any(beside) {
                *cell = Cell::Split(Reason::Neighbour);
            }
        }
    }

    /// The smallest cell that has the pixel, and what became of it.
    pub fn find(&self, pixel: [u32; 2]) -> (CellPlace, Cell) {
        let mut found = (self.place(0, pixel), self.cell(&self.place(0, pixel)));
        for level in 1..CELL_SIDES.len() {
            let place = self.place(level, pixel);
            match self.cell(&place) {
                Cell::Undivided => return found,
                cell => found = (place, cell),
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_split_the_cells_beside_them() {
        let mut tile = Tile::new([200, 200]);
        tile.reset([64, 128]);
        let holds = Cell::Holds { error: 0.0, depth: 0.0 };
        for place in tile.cells_to_judge(0) {
            tile.set_cell(&place, holds);
        }
        let edge = tile.place(0, [64, 128]);
        tile.set_cell(&edge, Cell::Split(Reason::Shadow));
        tile.split_beside_edges(0);
        let side = CELL_SIDES[0];
        let cells: Vec<_> =
            [[64, 128], [64 + side, 128 + side], [64 + 2 * side, 128]].map(|p| tile.cell(&tile.place(0, p))).into();
        assert_eq!(cells, [Cell::Split(Reason::Shadow), Cell::Split(Reason::Neighbour), holds]);
    }

    #[test]
    fn the_smallest_cell_of_a_pixel_is_found() {
        let mut tile = Tile::new([64, 128]);
        tile.reset([0, 64]);
        for level in 0..CELL_SIDES.len() - 1 {
            let large = tile.place(level, [20, 70]);
            tile.set_cell(&large, Cell::Split(Reason::Crease));
            assert_eq!(tile.cells_to_judge(level + 1).len(), 4);
        }
        let level = CELL_SIDES.len() - 1;
        let small = tile.place(level, [20, 70]);
        tile.set_cell(&small, Cell::Empty);
        assert_eq!(tile.find([20, 70]), (CellPlace { level, x: 20, y: 68, side: 4 }, Cell::Empty));
        assert_eq!(tile.find([40, 70]), (tile.place(0, [40, 70]), Cell::Undivided));
    }
}
