//! From a film to a picture file.

use super::render::PictureFormat;
use crate::error::Result;
use crate::image::display::display_value;
use crate::io::exr::write_exr;
use crate::io::picture::{ChannelData, ImageLayers, Layer};
use crate::io::png::write_png;
use crate::render::film::{Film, PlaneData};
use std::path::Path;

/// Writes a film whole, or leaves the file that was there.
pub fn write_film(path: &Path, format: PictureFormat, film: &Film) -> Result<()> {
    match format {
        PictureFormat::Exr => write_exr(path, &layers(film)),
        PictureFormat::Png => {
            let pixels: Vec<[f32; 3]> = film.colors().iter().map(|c| c.map(display_value)).collect();
            write_png(path, film.window().width() as usize, &pixels)
        }
    }
}

fn layers(film: &Film) -> ImageLayers {
    let (width, height) = (film.window().width() as usize, film.window().height() as usize);
    let color = |k: usize| ChannelData::F32(film.colors().iter().map(|c| c[k]).collect());
    let beauty = ["R", "G", "B"].iter().enumerate().map(|(k, name)| ((*name).to_owned(), color(k)));
    let mut layers = vec![Layer { name: String::new(), channels: beauty.collect(), half: true }];
    for (aov, plane) in film.planes() {
        let (name, channels) = aov.channels();
        let data = match plane {
            PlaneData::Float(planes) => planes.iter().cloned().map(ChannelData::F32).collect(),
            PlaneData::Id(ids) => vec![ChannelData::U32(ids.clone())],
        };
        let named = channels.iter().map(|c| (*c).to_owned()).zip(data).collect();
        // Plain channels live in the beauty layer, under their own names and at full precision in a layer apart.
        layers.push(Layer { name: name.to_owned(), channels: named, half: false });
    }
    ImageLayers { width, height, layers }
}
