//! Display values: clamp and sRGB (IEC 61966-2-1).

use crate::error::{Error, Result};

/// A borrowed picture: linear RGB, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct LinearImage<'a> {
    width: usize,
    pixels: &'a [[f32; 3]],
}

impl<'a> LinearImage<'a> {
    /// A picture of `width` columns; the number of pixels must be a multiple of it, and neither may be zero.
    pub fn new(width: usize, pixels: &'a [[f32; 3]]) -> Result<Self> {
        if width == 0 || pixels.is_empty() || !pixels.len().is_multiple_of(width) {
            let n = pixels.len();
            return Err(Error::input(format!("{n} pixels do not make a picture of {width} columns")));
        }
        Ok(Self { width, pixels })
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// Display values of every pixel.
    pub fn to_display(&self) -> Vec<[f32; 3]> {
        display_pixels(self.pixels).collect()
    }
}

/// The display value of a linear channel: clamped to 0..=1, NaN black, then [`srgb_from_linear`].
pub fn display_value(linear: f32) -> f32 {
    if linear.is_nan() { 0.0 } else { srgb_from_linear(linear.clamp(0.0, 1.0)) }
}

/// The display values of pixels. Those that look like the one before, as a background does, are found once.
pub fn display_pixels(linear: &[[f32; 3]]) -> impl ExactSizeIterator<Item = [f32; 3]> {
    let mut last = ([0.0; 3], [0.0; 3]);
    linear.iter().map(move |&pixel| {
        if pixel != last.0 {
            last = (pixel, pixel.map(display_value));
        }
        last.1
    })
}

/// The sRGB transfer function (IEC 61966-2-1), from linear to encoded, for 0..=1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    // The power in f32, a third of the work in f64, is good to 1e-7. But in f32, 1.055 - 0.055 is less than 1: white
    // would not be white.
    let curve = || (1.055 * f64::from(linear.powf(1.0 / 2.4)) - 0.055) as f32;
    if linear <= 0.003_130_8 { 12.92 * linear } else { curve() }
}

/// The inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_has_its_known_values() {
        for (linear, encoded) in [(0.0, 0.0), (1.0, 1.0), (0.214_041, 0.5), (0.001, 0.012_92)] {
            assert!((srgb_from_linear(linear) - encoded).abs() < 1e-5, "{linear}");
            assert!((linear_from_srgb(encoded) - linear).abs() < 1e-5, "{encoded}");
        }
        for linear in (0..=10_000).map(|i| i as f32 / 1e4).filter(|&linear| linear > 0.003_130_8) {
            let exact = 1.055 * f64::from(linear).powf(1.0 / 2.4) - 0.055;
            assert!((f64::from(srgb_from_linear(linear)) - exact).abs() < 1e-7, "{linear}");
        }
    }

    #[test]
    fn what_a_screen_cannot_show_is_clamped() {
        let shown = [-1.0, f32::NAN, 7.0, f32::INFINITY, f32::NEG_INFINITY].map(display_value);
        assert_eq!(shown, [0.0, 0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn pixels_are_shown_one_by_one_whatever_comes_before_them() {
        let linear =
            [[0.0; 3], [0.2, 0.4, 2.0], [0.2, 0.4, 2.0], [f32::NAN; 3], [f32::NAN; 3], [0.2, 0.4, 2.0], [1.0; 3]];
        let shown: Vec<_> = display_pixels(&linear).collect();
        assert_eq!(shown, linear.map(|pixel| pixel.map(display_value)));
    }

    #[test]
    fn a_picture_has_whole_rows() {
        assert_eq!(LinearImage::new(2, &[[0.0; 3]; 6]).unwrap().height(), 3);
        assert!(LinearImage::new(4, &[[0.0; 3]; 6]).is_err());
        assert!(LinearImage::new(0, &[]).is_err());
    }
}
