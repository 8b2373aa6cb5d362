//! `lazytess compare`: how far one picture is from another.

use super::outputs::{check_extension, check_outputs};
use super::stdout::print;
use super::values::display_units;
use crate::error::{Error, ErrorKind, Result};
use crate::image::difference::{DifferenceMap, is_above};
use crate::image::display::display_value;
use crate::image::{Comparison, LinearImage, compare};
use crate::io::picture::{RgbPicture, read_rgb};
use crate::io::png::write_png;
use clap::Args;
use std::io::Write;
use std::path::PathBuf;

/// Measure how far picture B is from the reference A
///
/// Prints one JSON object: the largest difference, the 99th percentile and the mean in display units (0 to 1 after
/// clamping and sRGB; of each pixel's worst channel), PSNR in dB, SSIMULACRA2 (100 is best), ColorVideoVDP (10 JOD is
/// best), the number of objects of A that B lacks, and the worst 32 x 32 tile. Reads EXR and PNG.
#[derive(Args, Debug)]
pub struct CompareArgs {
    /// The reference
    a: PathBuf,
    /// The picture to judge
    b: PathBuf,
    /// Write a heat map of the differences: dark blue for none, yellow for E (or, without --max, the largest)
    #[arg(long, value_name = "OUT.png")]
    diff: Option<PathBuf>,
    /// Exit with 1 if any pixel differs by more than E display units; reads like 0.02 or 5/255
    #[arg(long, value_name = "E", value_parser = display_units)]
    max: Option<f32>,
}

impl CompareArgs {
    /// Compares, prints, and judges if asked to.
    pub fn run(&self) -> Result<()> {
        self.diff.as_deref().map_or(Ok(()), |diff| check_extension(diff, "png", "a heat map"))?;
        check_outputs(self.diff.as_deref(), [self.a.as_path(), self.b.as_path()])?;
        let (a, b) = (read_rgb(&self.a)?, read_rgb(&self.b)?);
        let (comparison, map) = compare(borrow(&a)?, borrow(&b)?)?;
        let json = serde_json::to_string_pretty(&comparison).expect("plain numbers have a JSON form");
        print(|out| writeln!(out, "{json}"))?;
        self.write_heat_map(&map)?;
        self.judge(&comparison, &map)
    }

    fn write_heat_map(&self, map: &DifferenceMap) -> Result<()> {
        let Some(path) = &self.diff else { return Ok(()) };
        let full_scale = self.max.filter(|&e| e > 0.0).unwrap_or_else(|| map.max());
        let pixels = map.heat_map(full_scale).into_iter().map(|pixel| pixel.map(display_value));
        write_png(path, map.width(), pixels)
    }

    fn judge(&self, comparison: &Comparison, map: &DifferenceMap) -> Result<()> {
        let limit = self.max.unwrap_or(f32::INFINITY);
        if !is_above(comparison.max, limit) {
            return Ok(());
        }
        let (share, max) = (100.0 * map.share_above(limit), comparison.max);
        let message = format!("{share:.3} % of all pixels differ by more than {limit}, the worst by {max}");
        Err(Error::new(ErrorKind::Check, message))
    }
}

fn borrow(picture: &RgbPicture) -> Result<LinearImage<'_>> {
    LinearImage::new(picture.width, &picture.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_numbers_or_fractions() {
        assert_eq!(display_units("0.02"), Ok(0.02));
        assert_eq!(display_units("5/255"), Ok(5.0 / 255.0));
        for bad in ["", "-1", "1/0", "a", "nan", "1/2/3", "/"] {
            assert!(display_units(bad).unwrap_err().contains("5/255"), "{bad}");
        }
    }
}
