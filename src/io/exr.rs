//! OpenEXR files: linear colours and named layers.

use super::picture::{Channels, RgbPicture, Samples, check_size};
use super::write::write_whole;
use crate::error::Result;
use ::exr::block::lines::LineRefMut;
use ::exr::image::write::samples::{SamplesWriter, WritableSamples};
use ::exr::math::RoundingMode;
use ::exr::meta::attribute::{LevelMode, SampleType};
use ::exr::meta::header::Header;
use ::exr::prelude::*;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;

/// Writes all channels as one part, which every viewer reads: `R`, `G`, `B`, `Z`, `N.X`, ...
///
/// Lossless, one thread, no date: equal pictures give equal files. A part of a picture is the data window, the whole
/// the display window. Samples are taken from where they are, a tile at a time.
pub fn write_exr(path: &Path, picture: &Channels<'_>) -> Result<()> {
    let channels = picture.channels.iter().map(|(name, samples)| AnyChannel::new(name.as_str(), *samples)).collect();
    let size = Vec2(picture.width, picture.height);
    let encoding = Encoding { line_order: LineOrder::Increasing, ..Encoding::SMALL_FAST_LOSSLESS };
    let [x, y] = picture.place.map(|n| n as i32);
    let attributes = LayerAttributes { layer_position: Vec2(x, y), ..LayerAttributes::default() };
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let mut image = Image::from_layer(layer);
    let [width, height] = picture.whole;
    image.attributes.display_window = IntegerBounds::from_dimensions(Vec2(width, height));
    write_whole(path, |out| image.write().non_parallel().to_buffered(out).map_err(io_error))
}

impl<'s> WritableSamples<'s> for Samples<'_> {
    type Writer = Rows<'s>;

    fn sample_type(&self) -> SampleType {
        match self {
            Self::Color(..) => SampleType::F16,
            Self::F32(_) => SampleType::F32,
            Self::U32(_) => SampleType::U32,
        }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'s self, header: &Header) -> Rows<'s> {
        Rows { width: header.layer_size.width(), samples: *self }
    }
}

/// A channel being written.
pub struct Rows<'a> {
    width: usize,
    samples: Samples<'a>,
}

impl SamplesWriter for Rows<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let at = line.location.position;
        let range = at.y() * self.width + at.x()..at.y() * self.width + at.x() + line.location.sample_count;
        let written = match self.samples {
            Samples::Color(colors, channel) => {
                let colors = &colors[range];
                line.write_samples(|i| to_half(colors[i][channel]))
            }
            Samples::F32(values) => line.write_samples_from_slice(&values[range]),
            Samples::U32(ids) => line.write_samples_from_slice(&ids[range]),
        };
        written.expect("a line has room for its samples");
    }
}

/// The nearest half; finite values stay finite, since one infinite pixel spoils whatever filters the picture.
fn to_half(value: f32) -> f16 {
    let limit = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-limit, limit) } else { value })
}

fn io_error(error: ::exr::error::Error) -> io::Error {
    match error {
        ::exr::error::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// The first layer that has channels R, G and B.
pub(super) fn decode<R: Read + Seek>(mut file: BufReader<R>, n_bytes: u64) -> Result<RgbPicture, String> {
    let describe = |e: ::exr::error::Error| format!("the EXR file cannot be read: {e}");
    let meta = MetaData::read_from_buffered(&mut file, false).map_err(describe)?;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        check_size(width, height, header.channels.bytes_per_pixel, n_bytes)?;
    }
    file.rewind().map_err(|e| format!("the EXR file cannot be read: {e}"))?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(empty_picture, |picture: &mut RgbPicture, at, (r, g, b): (f32, f32, f32)| {
            picture.pixels[at.y() * picture.width + at.x()] = [r, g, b];
        })
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)
        .map_err(describe)?;
    Ok(image.layer_data.channel_data.pixels)
}

fn empty_picture(size: Vec2<usize>, _: &RgbChannels) -> RgbPicture {
    RgbPicture { width: size.width(), height: size.height(), pixels: vec![[0.0; 3]; size.area()] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::picture::read_rgb;

    const COLORS: [[f32; 3]; 6] =
        [[0.0; 3], [0.5, 1e6, -0.25], [1.0, 2e6, -0.5], [1.5, 3e6, -0.75], [2.0, 4e6, -1.0], [2.5, 5e6, -1.25]];
    const RAMP: [f32; 6] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
    const IDS: [u32; 6] = [0, 1, 2, 3, 16_777_217, u32::MAX];

    fn picture() -> Channels<'static> {
        let [r, g, b] = [0, 1, 2].map(|k| Samples::Color(&COLORS, k));
        let (ramp, ids) = (Samples::F32(&RAMP), Samples::U32(&IDS));
        let channels = [("R", r), ("G", g), ("B", b), ("Z", ramp), ("N.X", ramp), ("id", ids)];
        let channels = channels.map(|(name, samples)| (name.to_owned(), samples)).into();
        Channels { width: 3, height: 2, place: [1, 4], whole: [9, 7], channels }
    }

    #[test]
    fn layers_come_back_with_their_names_and_types() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_exr(&path, &picture()).unwrap();
        let back = read_all_flat_layers_from_file(&path).unwrap();
        assert_eq!(back.layer_data[0].attributes.layer_position, Vec2(1, 4));
        assert_eq!(back.attributes.display_window, IntegerBounds::from_dimensions(Vec2(9, 7)));
        let channels = &back.layer_data[0].channel_data.list;
        let kinds: Vec<_> =
            channels.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().count())).collect();
        let expected = ["B", "G", "N.X", "R", "Z", "id"].map(|name| (name.to_owned(), 6));
        assert_eq!(kinds, expected);
        assert_eq!(channels[5].sample_data, FlatSamples::U32(IDS.to_vec()));
        assert!(matches!(&channels[3].sample_data, FlatSamples::F16(r) if r[3].to_f32() == 1.5));
        assert!(matches!(&channels[4].sample_data, FlatSamples::F32(z) if z[..] == RAMP));
    }

    #[test]
    fn beauty_is_read_as_linear_rgb_and_bright_pixels_stay_finite() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_exr(&path, &picture()).unwrap();
        let back = read_rgb(&path).unwrap();
        assert_eq!((back.width, back.height), (3, 2));
        assert_eq!(back.pixels[1], [0.5, 65504.0, -0.25]);
    }

    #[test]
    fn equal_pictures_give_equal_files() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
        write_exr(&a, &picture()).unwrap();
        write_exr(&b, &picture()).unwrap();
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }

    #[test]
    fn file_without_rgb_is_a_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("z.exr");
        let mut depth = picture();
        depth.channels.drain(..3);
        write_exr(&path, &depth).unwrap();
        assert!(read_rgb(&path).unwrap_err().to_string().contains("z.exr: the EXR file cannot be read: "));
    }
}
