//! Everything lazytess measures about two pictures, in one value.

use super::difference::{DifferenceMap, TileDifference, psnr};
use super::display::LinearImage;
use super::missed::missed_objects;
use super::perceptual::{color_video_vdp, ssimulacra2};
use crate::error::{Error, Result};
use serde::Serialize;

/// How far a picture is from a reference. Differences are in display units, of each pixel's worst channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Largest difference.
    pub max: f32,
    /// 99 % of all pixels differ by no more.
    pub p99: f32,
    /// Mean difference.
    pub mean: f64,
    /// Peak signal-to-noise ratio in dB; `None` (null) for equal pictures.
    pub psnr: Option<f64>,
    /// SSIMULACRA2, 100 at best; `None` for pictures below 8 × 8.
    pub ssimulacra2: Option<f64>,
    /// ColorVideoVDP in JOD, 10 at best; `None` for pictures below 4 × 4.
    pub color_video_vdp: Option<f64>,
    /// Objects of the reference that are missing, see [`missed_objects`].
    pub missed_objects: usize,
    /// The 32 × 32 tile with the largest mean difference.
    pub worst_tile: TileDifference,
}

/// Measures `test` against `reference`; also returns the map of differences. An error if the sizes differ.
pub fn compare(reference: LinearImage<'_>, test: LinearImage<'_>) -> Result<(Comparison, DifferenceMap)> {
    let (width, height) = (reference.width(), reference.height());
    if (width, height) != (test.width(), test.height()) {
        let (w, h) = (test.width(), test.height());
        return Err(Error::input(format!(
            "the pictures have different sizes, {width} x {height} and {w} x {h}: render both at one size"
        )));
    }
    let (reference, test) = (reference.to_display(), test.to_display());
    let map = DifferenceMap::new(width, &reference, &test);
    let comparison = Comparison {
        width,
        height,
        max: map.max(),
        p99: map.percentile(0.99),
        mean: map.mean(),
        psnr: psnr(&reference, &test),
        ssimulacra2: ssimulacra2(width, &reference, &test)?,
        color_video_vdp: color_video_vdp(width, &reference, &test)?,
        missed_objects: missed_objects(width, &reference, &test),
        worst_tile: map.worst_tile(),
    };
    Ok((comparison, map))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_differ_by_nothing() {
        let pixels = vec![[0.25, 0.5, 2.0]; 64];
        let image = LinearImage::new(8, &pixels).unwrap();
        let (c, _) = compare(image, image).unwrap();
        assert_eq!((c.max, c.p99, c.mean, c.psnr, c.missed_objects), (0.0, 0.0, 0.0, None, 0));
        assert_eq!((c.ssimulacra2, c.color_video_vdp), (Some(100.0), Some(10.0)));
    }

    #[test]
    fn sizes_that_differ_are_explained() {
        let pixels = vec![[0.0; 3]; 12];
        let image = |width| LinearImage::new(width, &pixels).unwrap();
        let message = compare(image(4), image(6)).unwrap_err().to_string();
        assert!(message.contains("4 x 3 and 6 x 2"), "{message}");
    }
}
