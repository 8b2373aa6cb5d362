//! PNG files: 8 bits a channel, sRGB.

use super::picture::{RgbPicture, check_size};
use super::write::write_whole;
use crate::error::Result;
use crate::image::display::linear_from_srgb;
use ::png::{
    BitDepth, ColorType, Compression, Decoder, Encoder, EncodingError, Limits, ScaledFloat, SrgbRenderingIntent,
    Transformations,
};
use std::io::{self, BufReader, Read, Seek, Write};
use std::path::Path;

/// Writes display-referred pixels: sRGB values in 0..1 (others are clamped, NaN is 0), row by row from the top.
///
/// The file says that it is sRGB, in its `sRGB` chunk and in `gAMA` for old readers.
///
/// # Panics
/// If the pixels do not make whole rows of `width`.
pub fn write_png<P>(path: &Path, width: usize, pixels: P) -> Result<()>
where
    P: IntoIterator<Item = [f32; 3], IntoIter: ExactSizeIterator>,
{
    let mut pixels = pixels.into_iter();
    let n = pixels.len();
    assert!(width > 0 && n.is_multiple_of(width), "{n} pixels in rows of {width}");
    write_whole(path, |out| {
        let mut encoder = Encoder::new(out, width as u32, (n / width) as u32);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
        // What the specification wants beside sRGB, in units of 1e-5.
        encoder.set_source_gamma(ScaledFloat::from_scaled(45455));
        encoder.set_compression(Compression::Fast);
        let mut writer = encoder.write_header().map_err(io_error)?;
        let mut rows = writer.stream_writer().map_err(io_error)?;
        let mut row = vec![[0; 3]; width];
        for _ in 0..n / width {
            row.iter_mut().zip(&mut pixels).for_each(|(bytes, pixel)| *bytes = pixel.map(quantise));
            rows.write_all(row.as_flattened())?;
        }
        rows.finish().map_err(io_error)?;
        writer.finish().map_err(io_error)
    })
}

fn quantise(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

fn io_error(error: EncodingError) -> io::Error {
    match error {
        EncodingError::IoError(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// Any PNG: palettes and greys become RGB, alpha is dropped, values are taken as sRGB.
pub(super) fn decode<R: Read + Seek>(file: BufReader<R>, n_bytes: u64) -> Result<RgbPicture, String> {
    let describe = |e| format!("the PNG file cannot be read: {e}");
    let mut decoder = Decoder::new_with_limits(file, Limits { bytes: 1 << 26 });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(describe)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let bits = reader.info().bits_per_pixel();
    check_size(width, height, bits.div_ceil(8), n_bytes.saturating_mul(if bits < 8 { 8 } else { 1 }))?;
    let mut bytes = vec![0; reader.output_buffer_size().ok_or("the PNG file is too big")?];
    let frame = reader.next_frame(&mut bytes).map_err(describe)?;
    let sample_bytes = if frame.bit_depth == BitDepth::Sixteen { 2 } else { 1 };
    let n_samples = frame.color_type.samples();
    let pixels = bytes[..frame.buffer_size()].chunks_exact(n_samples * sample_bytes);
    let pixels = pixels.map(|pixel| decode_pixel(pixel, n_samples, sample_bytes)).collect();
    Ok(RgbPicture { width, height, pixels })
}

fn decode_pixel(bytes: &[u8], n_samples: usize, sample_bytes: usize) -> [f32; 3] {
    // Grey has one sample, grey with alpha two.
    let of_channel = |channel: usize| if n_samples < 3 { 0 } else { channel };
    [0, 1, 2].map(|channel| {
        let sample = &bytes[of_channel(channel) * sample_bytes..][..sample_bytes];
        linear_from_srgb(match sample {
            [high, low] => f32::from(u16::from_be_bytes([*high, *low])) / 65535.0,
            _ => f32::from(sample[0]) / 255.0,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::picture::read_rgb;

    #[test]
    fn pixels_come_back_linear() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let pixels = [[0.0, 0.5, 1.0], [0.04, 7.0, -1.0], [f32::NAN, 0.2, 0.8], [1.0, 1.0, 1.0]];
        write_png(&path, 2, pixels).unwrap();
        let back = read_rgb(&path).unwrap();
        assert_eq!((back.width, back.height), (2, 2));
        for (written, read) in pixels.iter().flatten().zip(back.pixels.iter().flatten()) {
            let expected = linear_from_srgb((written.clamp(0.0, 1.0) * 255.0).round().max(0.0) / 255.0);
            assert_eq!(*read, if written.is_nan() { 0.0 } else { expected });
        }
        assert!((back.pixels[0][1] - 0.2158605).abs() < 1e-6, "128 / 255 decodes to {}", back.pixels[0][1]);
    }

    #[test]
    fn file_says_that_it_is_srgb() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_png(&path, 1, [[0.5; 3]]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for chunk in [b"sRGB", b"gAMA"] {
            assert!(bytes.windows(4).any(|w| w == chunk));
        }
    }

    #[test]
    fn greys_alpha_and_sixteen_bits_are_understood() {
        assert_eq!(decode_pixel(&[255, 7], 2, 1), [1.0; 3]);
        assert_eq!(decode_pixel(&[255, 255, 0, 0, 255, 255, 1, 1], 4, 2), [1.0, 0.0, 1.0]);
    }
}
