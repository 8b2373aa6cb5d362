//! Pixel-wise differences of two pictures in display units.

use super::color_map::viridis;
use serde::Serialize;

/// A difference of two display values in single precision, each of which went to linear light and back, errs by less
/// than this: pictures of 8 or 16 bits have differences of whole steps.
const ROUNDING: f32 = 1.0 / (1 << 20) as f32;

/// Side of the tiles among which the worst is sought, in pixels.
pub const TILE_SIDE: usize = 32;

/// The difference of two pictures: for each pixel the largest over its channels, in display units (0 to 1).
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceMap {
    width: usize,
    values: Vec<f32>,
}

/// A tile of a picture and its mean difference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TileDifference {
    /// Column of its top left pixel.
    pub x: usize,
    /// Row of its top left pixel.
    pub y: usize,
    /// Mean difference in display units.
    pub mean: f64,
}

impl DifferenceMap {
    /// From the display values of two pictures of `width` columns and equal height.
    pub fn new(width: usize, a: &[[f32; 3]], b: &[[f32; 3]]) -> Self {
        debug_assert_eq!(a.len(), b.len());
        let values = a.iter().zip(b).map(|(a, b)| largest_difference(*a, *b)).collect();
        Self { width, values }
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The differences, row by row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Largest difference.
    pub fn max(&self) -> f32 {
        self.values.iter().fold(0.0, |max, &d| max.max(d))
    }

    /// Mean difference.
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|&d| f64::from(d)).sum::<f64>() / self.values.len() as f64
    }

    /// The smallest difference that at least `share` (0 to 1) of all pixels do not exceed.
    pub fn percentile(&self, share: f64) -> f32 {
        let rank = (share * self.values.len() as f64).ceil() as usize;
        let mut values = self.values.clone();
        *values.select_nth_unstable_by(rank.saturating_sub(1), f32::total_cmp).1
    }

    /// Share of pixels (0 to 1) whose difference is above `limit`, by more than the way to linear values and back
    /// rounds it.
    pub fn share_above(&self, limit: f32) -> f64 {
        self.values.iter().filter(|&&d| is_above(d, limit)).count() as f64 / self.values.len() as f64
    }

    /// The tile of a [`TILE_SIDE`] grid with the largest mean, the first of equals. Border tiles may be smaller.
    pub fn worst_tile(&self) -> TileDifference {
        let height = self.values.len() / self.width;
        let corners =
            (0..height).step_by(TILE_SIDE).flat_map(|y| (0..self.width).step_by(TILE_SIDE).map(move |x| (x, y)));
        let tiles = corners.map(|(x, y)| TileDifference { x, y, mean: self.tile_mean(x, y) });
        tiles.reduce(|worst, tile| if tile.mean > worst.mean { tile } else { worst }).expect("a picture has a tile")
    }

    fn tile_mean(&self, x: usize, y: usize) -> f64 {
        let columns = x..(x + TILE_SIDE).min(self.width);
        let rows = self.values.chunks_exact(self.width).skip(y).take(TILE_SIDE);
        let (n_rows, sum) = rows.fold((0, 0.0), |(n, sum), row| {
            (n + 1, sum + row[columns.clone()].iter().map(|&d| f64::from(d)).sum::<f64>())
        });
        sum / (n_rows * columns.len()) as f64
    }

    /// A picture of the differences, linear RGB: dark blue for none, yellow for `full_scale` and more.
    pub fn heat_map(&self, full_scale: f32) -> Vec<[f32; 3]> {
        let scale = if full_scale > 0.0 { 1.0 / full_scale } else { 0.0 };
        self.values.iter().map(|&d| viridis(d * scale).to_array()).collect()
    }
}

/// Peak signal-to-noise ratio in dB, of display values with peak 1; `None` for equal pictures.
pub fn psnr(a: &[[f32; 3]], b: &[[f32; 3]]) -> Option<f64> {
    let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(&a, &b)| f64::from(a - b).powi(2));
    let mean = squares.sum::<f64>() / (3 * a.len()) as f64;
    (mean > 0.0).then(|| -10.0 * mean.log10())
}

/// Largest difference of two colours over their channels.
pub(super) fn largest_difference(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).fold(0.0, |max, i| max.max((a[i] - b[i]).abs()))
}

/// Whether a difference is above a limit, roundings aside.
pub fn is_above(difference: f32, limit: f32) -> bool {
    difference > limit + ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 × 40 black pixels against the same with one pixel at (70, 35) off by (0.1, 0.5, 0.2).
    fn one_pixel_off() -> DifferenceMap {
        let a = vec![[0.0; 3]; 4000];
        let mut b = a.clone();
        b[35 * 100 + 70] = [0.1, 0.5, 0.2];
        DifferenceMap::new(100, &a, &b)
    }

    #[test]
    fn one_pixel_is_measured_by_its_worst_channel() {
        let map = one_pixel_off();
        assert_eq!((map.max(), map.mean()), (0.5, 0.5 / 4000.0));
        assert_eq!((map.percentile(0.99), map.percentile(1.0)), (0.0, 0.5));
        assert_eq!((map.share_above(0.4), map.share_above(0.5)), (1.0 / 4000.0, 0.0));
    }

    #[test]
    fn the_worst_tile_is_found_at_the_cut_off_border_too() {
        // Row 35 lies in the second row of tiles, which is 8 pixels high.
        assert_eq!(one_pixel_off().worst_tile(), TileDifference { x: 64, y: 32, mean: 0.5 / 256.0 });
    }

    #[test]
    fn a_tenth_everywhere_is_twenty_decibel() {
        let psnr_of = |d: f32| psnr(&[[0.5; 3]; 9], &[[0.5 + d; 3]; 9]);
        assert!((psnr_of(0.1).unwrap() - 20.0).abs() < 1e-4);
        assert_eq!(psnr_of(0.0), None);
    }

    #[test]
    fn percentiles_are_values_that_occur() {
        let b: Vec<_> = (0..100).map(|i| [i as f32, 0.0, 0.0]).collect();
        let map = DifferenceMap::new(10, &[[0.0; 3]; 100], &b);
        assert_eq!((map.percentile(0.99), map.percentile(0.5), map.percentile(0.0)), (98.0, 49.0, 0.0));
    }
}
