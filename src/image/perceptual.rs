//! Differences as people see them, by published metrics.

use super::display::linear_from_srgb;
use crate::error::{Error, Result};
use colorvideovdp::{Color, Cvvdp, DisplayModel, Image, Options};
use ssimulacra2::{LinearRgb, compute_frame_ssimulacra2};

/// Most memory that ColorVideoVDP may use, in bytes: enough for pictures of 8192 × 8192.
const MEMORY_LIMIT: usize = 16 << 30;

/// SSIMULACRA2 (Sneyers 2022) of display values: 100 for equal pictures, 90 indistinguishable side by side, 50 clearly
/// worse, below 0 very bad. `None` for pictures with fewer than 8 rows or columns.
pub fn ssimulacra2(width: usize, reference: &[[f32; 3]], test: &[[f32; 3]]) -> Result<Option<f64>> {
    let height = reference.len() / width;
    if width.min(height) < 8 {
        return Ok(None);
    }
    let linear = |pixels: &[[f32; 3]]| {
        let pixels = pixels.iter().map(|pixel| pixel.map(linear_from_srgb)).collect();
        LinearRgb::new(pixels, width, height).map_err(|e| failed("SSIMULACRA2", &e))
    };
    let score = compute_frame_ssimulacra2(linear(reference)?, linear(test)?);
    score.map(Some).map_err(|e| failed("SSIMULACRA2", &e))
}

/// ColorVideoVDP (Mantiuk et al. 2024) of display values on its standard 4K display, in just-objectionable-difference
/// units: 10 for no visible difference, 1 less when three quarters of all people prefer the reference. `None` for
/// pictures with fewer than 4 rows or columns.
pub fn color_video_vdp(width: usize, reference: &[[f32; 3]], test: &[[f32; 3]]) -> Result<Option<f64>> {
    let height = reference.len() / width;
    if width.min(height) < 4 {
        return Ok(None);
    }
    let jod = || {
        let image = |pixels: &[[f32; 3]]| Image::new(width, height, 3, pixels.as_flattened().to_vec());
        let options = Options::default().with_memory_limit_bytes(MEMORY_LIMIT);
        let metric = Cvvdp::new(DisplayModel::from_name("standard_4k")?, options)?;
        Ok(metric.predict_image(&image(test)?, &image(reference)?, Color::Srgb)?.jod)
    };
    jod().map(|jod| Some(f64::from(jod))).map_err(|e: colorvideovdp::Error| failed("ColorVideoVDP", &e))
}

fn failed(metric: &str, error: &dyn std::error::Error) -> Error {
    Error::input(format!("{metric} cannot compare these pictures: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker(light: f32) -> Vec<[f32; 3]> {
        (0..32 * 32).map(|i| [if (i / 4 + i / 128) % 2 == 0 { light } else { 0.2 }; 3]).collect()
    }

    #[test]
    fn equal_pictures_get_the_best_scores() {
        let a = checker(0.8);
        assert_eq!(ssimulacra2(32, &a, &a).unwrap(), Some(100.0));
        assert_eq!(color_video_vdp(32, &a, &a).unwrap(), Some(10.0));
    }

    #[test]
    fn worse_pictures_get_worse_scores() {
        let (a, near, far) = (checker(0.8), checker(0.75), checker(0.4));
        let scores = |b: &[[f32; 3]]| (ssimulacra2(32, &a, b).unwrap(), color_video_vdp(32, &a, b).unwrap());
        let (near, far) = (scores(&near), scores(&far));
        assert!(near.0 < Some(100.0) && far.0 < near.0, "{near:?} {far:?}");
        assert!(near.1 < Some(10.0) && far.1 < near.1, "{near:?} {far:?}");
    }

    #[test]
    fn pictures_too_small_for_a_metric_get_no_score() {
        let a = [[0.5; 3]; 9];
        assert_eq!((ssimulacra2(3, &a, &a).unwrap(), color_video_vdp(3, &a, &a).unwrap()), (None, None));
    }
}
