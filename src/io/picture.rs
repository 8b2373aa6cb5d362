//! Pictures on their way to and from files, as plain data.

use crate::error::{Error, Result};
use crate::io::{exr, png};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Most pixels that a picture file may have to be read: 16384 x 16384.
pub(super) const MAX_PIXELS: usize = 1 << 28;

/// Most bytes of samples that a byte of a valid file can stand for; deflate reaches 1032.
const MAX_RATIO: u64 = 1100;

/// What an EXR file gets: channels of a part of a picture, lent by whoever holds them.
#[derive(Clone, Debug)]
pub struct Channels<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Column and row of the first pixel in the whole picture.
    pub place: [usize; 2],
    /// Columns and rows of the whole picture.
    pub whole: [usize; 2],
    /// Names and samples. `R`, `G` and `B` are the picture; `N.X` is channel `X` of layer `N`.
    pub channels: Vec<(String, Samples<'a>)>,
}

/// The samples of one channel, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub enum Samples<'a> {
    /// Red (0), green (1) or blue (2) of linear colours, to be stored in 16 bits.
    Color(&'a [[f32; 3]], usize),
    /// Measures.
    F32(&'a [f32]),
    /// Ids and counts.
    U32(&'a [u32]),
}

/// A picture that was read: linear RGB with Rec. 709 primaries.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbPicture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue, row by row from the top. EXR files may hold values above 1, infinities and NaN.
    pub pixels: Vec<[f32; 3]>,
}

/// Reads an EXR or PNG file, told apart by content: the first layer with R, G and B, or the decoded sRGB values.
pub fn read_rgb(path: &Path) -> Result<RgbPicture> {
    let failed = |e| Error::io("read", path, e);
    let mut file = BufReader::new(File::open(path).map_err(failed)?);
    let mut magic = Vec::new();
    file.by_ref().take(8).read_to_end(&mut magic).map_err(failed)?;
    let n_bytes = file.seek(SeekFrom::End(0)).map_err(failed)?;
    file.rewind().map_err(failed)?;
    decode_rgb(file, &magic, n_bytes).map_err(|message| Error::input(message).at(path, None))
}

fn decode_rgb<R: Read + Seek>(file: BufReader<R>, magic: &[u8], n_bytes: u64) -> Result<RgbPicture, String> {
    if magic.starts_with(b"\x89PNG\r\n\x1a\n") {
        png::decode(file, n_bytes)
    } else if magic.starts_with(b"\x76\x2f\x31\x01") {
        exr::decode(file, n_bytes)
    } else {
        Err("this is neither an EXR nor a PNG file".to_owned())
    }
}

/// Refuses sizes that the file cannot hold, before anything is allocated for them.
pub(super) fn check_size(width: usize, height: usize, bytes_per_pixel: usize, n_bytes: u64) -> Result<(), String> {
    let n_pixels = width.checked_mul(height).filter(|&n| n <= MAX_PIXELS);
    let Some(n_pixels) = n_pixels else {
        return Err(format!("the picture claims {width} x {height} pixels; at most {MAX_PIXELS} are read"));
    };
    if n_pixels as u64 * bytes_per_pixel as u64 > n_bytes.saturating_mul(MAX_RATIO) {
        return Err(format!("the picture claims {width} x {height} pixels, which {n_bytes} bytes cannot hold"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn decode(bytes: &[u8]) -> Result<RgbPicture, String> {
        decode_rgb(BufReader::new(Cursor::new(bytes)), &bytes[..bytes.len().min(8)], bytes.len() as u64)
    }

    fn small_files() -> [Vec<u8>; 2] {
        let folder = tempfile::tempdir().unwrap();
        let (png, exr) = (folder.path().join("a.png"), folder.path().join("a.exr"));
        png::write_png(&png, 5, [[0.25, 0.5, 1.0]; 20]).unwrap();
        let colors = [[0.5; 3]; 20];
        let channel = |k: usize| (["R", "G", "B"][k].to_owned(), Samples::Color(&colors, k));
        let channels = [0, 1, 2].map(channel).into();
        exr::write_exr(&exr, &Channels { width: 5, height: 4, place: [0, 0], whole: [5, 4], channels }).unwrap();
        [png, exr].map(|path| std::fs::read(path).unwrap())
    }

    #[test]
    fn damaged_pictures_are_errors_not_panics() {
        for file in small_files() {
            assert!(decode(&file).is_ok());
            for at in 0..file.len() {
                for value in [0, 1, 0x7f, 0xff, !file[at]] {
                    let mut damaged = file.clone();
                    damaged[at] = value;
                    let _ = decode(&damaged);
                }
                assert!(decode(&file[..at]).is_err() || at > 40, "cut at {at}");
            }
        }
        assert!(decode(b"GIF89a").unwrap_err().contains("neither an EXR nor a PNG"));
    }

    #[test]
    fn sizes_that_the_file_cannot_hold_are_refused() {
        assert!(check_size(1 << 20, 1 << 20, 3, u64::MAX).unwrap_err().contains("at most"));
        assert!(check_size(usize::MAX, 2, 3, u64::MAX).unwrap_err().contains("at most"));
        assert!(check_size(1000, 1000, 3, 100).unwrap_err().contains("cannot hold"));
        assert!(check_size(100, 100, 3, 100).is_ok());
    }
}
