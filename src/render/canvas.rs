//! The film of a grouped render at work, and the seams between its tiles.
//!
//! Tiles are rendered one by one, each knowing nothing of the others. Once all are there, edges that end at the side of
//! one are followed into the next, where a look across the seam surprises an interpolated pixel. They are followed
//! within that tile alone, so that a pixel depends on its own tile and the eight around it: a crop renders those too,
//! and shows what the whole picture shows.

use super::cells::TILE_SIDE;
use super::film::{Aov, Film, PixelRecord};
use super::follow::{Look, Origin, is_surprised};
use super::reason::Reason;
use super::tiles::PixelRect;
use glam::Vec3;

/// A film that knows how its pixels were made.
pub(super) struct Canvas {
    film: Film,
    /// Bits of pixels, row by row.
    interpolated: Vec<u64>,
    traced: Vec<u64>,
}

/// Interpolated pixels of one tile that were surprised across its seams.
pub(super) struct Surprises {
    pub tile: PixelRect,
    pub pixels: Vec<[u32; 2]>,
}

impl Canvas {
    pub fn new(window: PixelRect, aovs: &[Aov]) -> Self {
        let words = || vec![0; window.n_pixels().div_ceil(64)];
        Self { film: Film::new(window, aovs), interpolated: words(), traced: words() }
    }

    /// Bytes that [`Canvas::new`] allocates.
    pub fn n_bytes(window: PixelRect, aovs: &[Aov]) -> usize {
        Film::n_bytes(window, aovs) + 2 * window.n_pixels().div_ceil(64) * size_of::<u64>()
    }

    /// Exposes a tile of the window; `records` are its pixels row by row.
    pub fn store(&mut self, tile: PixelRect, records: &[PixelRecord]) {
        self.film.store(tile, records);
        for (pixel, record) in tile.pixels().zip(records) {
            let idx = self.idx(pixel);
            match look(record, 1).origin {
                Origin::Interpolated => self.interpolated[idx / 64] |= 1 << (idx % 64),
                Origin::Traced => self.traced[idx / 64] |= 1 << (idx % 64),
                Origin::Other => {}
            }
        }
    }

    /// Exposes every pixel of a part of the window as background.
    pub fn fill(&mut self, part: PixelRect, record: &PixelRecord) {
        self.film.fill(part, record);
    }

    /// The colour of a pixel that is interpolated.
    pub fn interpolated(&self, pixel: [u32; 2]) -> Option<Vec3> {
        let idx = self.idx(pixel);
        has(&self.interpolated, idx).then(|| Vec3::from(self.film.colors()[idx]))
    }

    /// Replaces an interpolated pixel by a traced one.
    pub fn correct(&mut self, pixel: [u32; 2], record: &PixelRecord) {
        let idx = self.idx(pixel);
        self.interpolated[idx / 64] &= !(1 << (idx % 64));
        self.film.set(pixel, record);
    }

    /// The pixels of these tiles that were surprised from beyond their seams.
    pub fn surprises(&self, tiles: PixelRect, tolerance: f32) -> Vec<Surprises> {
        let columns = (tiles.x0..tiles.x1).step_by(TILE_SIDE as usize);
        let places =
            (tiles.y0..tiles.y1).step_by(TILE_SIDE as usize).flat_map(|y| columns.clone().map(move |x| [x, y]));
        let within = |[x, y]: [u32; 2]| PixelRect { x0: x, y0: y, x1: x + TILE_SIDE, y1: y + TILE_SIDE };
        let found = places.map(|place| self.surprises_of(within(place).intersection(self.film.window()), tolerance));
        found.filter(|surprises| !surprises.pixels.is_empty()).collect()
    }

    fn surprises_of(&self, tile: PixelRect, tolerance: f32) -> Surprises {
        let is_beyond = |pixel| tile.idx(pixel).is_none();
        let pixels =
            at_seams(tile).filter(|&pixel| is_surprised(pixel, tolerance, is_beyond, |pixel| self.look(pixel)));
        Surprises { tile, pixels: pixels.collect() }
    }

    fn look(&self, pixel: [u32; 2]) -> Option<Look> {
        let idx = self.film.window().idx(pixel)?;
        let origin = match (has(&self.interpolated, idx), has(&self.traced, idx)) {
            (true, _) => Origin::Interpolated,
            (_, true) => Origin::Traced,
            _ => Origin::Other,
        };
        // Meshes are not remembered: a silhouette at a seam costs a ray.
        Some(Look { origin, color: Vec3::from(self.film.colors()[idx]), mesh: 0 })
    }

    /// The part of the film that was asked for.
    pub fn into_film(self, window: PixelRect) -> Film {
        if window == self.film.window() { self.film } else { self.film.part(window) }
    }

    fn idx(&self, pixel: [u32; 2]) -> usize {
        self.film.window().idx(pixel).expect("the pixel lies in the canvas")
    }
}

/// The outermost pixels of a tile; where it is one pixel high, twice.
fn at_seams(PixelRect { x0, y0, x1, y1 }: PixelRect) -> impl Iterator<Item = [u32; 2]> {
    let rows = [y0, y1 - 1].into_iter().flat_map(move |y| (x0..x1).map(move |x| [x, y]));
    let columns = (y0 + 1..y1 - 1).flat_map(move |y| [[x0, y], [x1 - 1, y]]);
    rows.chain(columns)
}

fn has(bits: &[u64], idx: usize) -> bool {
    bits[idx / 64] >> (idx % 64) & 1 != 0
}

/// What of a pixel may surprise or be surprised, where pixels have `spp` samples.
pub(super) fn look(record: &PixelRecord, spp: u32) -> Look {
    let origin = match record.reason {
        Reason::Interpolated => Origin::Interpolated,
        // One sample alone may have missed an edge.
        Reason::Corner | Reason::Probe if spp > 1 => Origin::Interpolated,
        // The edges of patterns are known.
        Reason::Background | Reason::Corner | Reason::Probe | Reason::Pattern => Origin::Other,
        _ => Origin::Traced,
    };
    Look { origin, color: Vec3::from(record.color), mesh: record.first.mesh }
}
