//! From a film to picture files: one with layers, or a PNG and beside it one for each way of seeing groups.

use super::render::PictureFormat;
use crate::error::Result;
use crate::image::color_map::viridis;
use crate::image::display::{display_pixels, display_value};
use crate::io::exr::write_exr;
use crate::io::picture::{Channels, Samples};
use crate::io::png::write_png;
use crate::render::film::{Aov, Film, PlaneData};
use crate::render::groups::NO_GROUP;
use crate::render::sampler::pcg;
use std::path::{Path, PathBuf};

/// Display colours of reasons, by number: greys where nothing was found out, hues of edges, dark where nothing was
/// traced.
const REASON_COLORS: [[f32; 3]; 13] = [
    [0.65, 0.65, 0.65],
    [1.0, 1.0, 1.0],
    [0.85, 0.85, 0.7],
    [0.9, 0.2, 0.2],
    [0.95, 0.55, 0.1],
    [0.3, 0.4, 1.0],
    [0.1, 0.8, 0.8],
    [0.8, 0.3, 0.9],
    [0.95, 0.9, 0.2],
    [0.6, 0.4, 0.2],
    [0.12, 0.3, 0.15],
    [0.0, 0.0, 0.0],
    [0.55, 0.8, 0.3],
];

/// Writes the film of a picture of that size whole, or leaves the file that was there.
pub fn write_film(path: &Path, format: PictureFormat, film: &Film, size: [u32; 2]) -> Result<()> {
    match format {
        PictureFormat::Exr => write_exr(path, &channels(film, size)),
        PictureFormat::Png => {
            write_png(path, film.window().width() as usize, display_pixels(film.colors()))?;
            film.planes().iter().try_for_each(|(aov, plane)| write_plane(path, film, *aov, plane))
        }
    }
}

/// The files that [`write_film`] writes.
pub fn files(path: &Path, format: PictureFormat, aovs: &[Aov]) -> Vec<PathBuf> {
    let drawn = aovs.iter().filter(|_| format == PictureFormat::Png);
    std::iter::once(path.to_owned()).chain(drawn.map(|aov| beside(path, aov.channels().1[0]))).collect()
}

/// Whether an AOV has a picture of its own.
pub fn is_drawn(aov: Aov) -> bool {
    matches!(aov, Aov::Group | Aov::Reason | Aov::Error)
}

/// `picture.png` gets `picture.group.png` beside it.
fn write_plane(path: &Path, film: &Film, aov: Aov, plane: &PlaneData) -> Result<()> {
    let (path, width) = (beside(path, aov.channels().1[0]), film.window().width() as usize);
    match plane {
        PlaneData::Id(ids) if aov == Aov::Group => write_png(&path, width, ids.iter().map(|&id| group_color(id))),
        PlaneData::Id(ids) => {
            write_png(&path, width, ids.iter().map(|&id| REASON_COLORS[id as usize % REASON_COLORS.len()]))
        }
        PlaneData::Float(channels) => write_png(&path, width, error_colors(&channels[0])),
    }
}

fn beside(path: &Path, name: &str) -> PathBuf {
    path.with_extension(format!("{name}.png"))
}

/// Neighbouring numbers get unlike colours.
fn group_color(group: u32) -> [f32; 3] {
    let bits = pcg(group);
    let channel = |k: u32| 0.25 + 0.75 * (bits >> (8 * k) & 255) as f32 / 255.0;
    if group == NO_GROUP { [0.0; 3] } else { [0, 1, 2].map(channel) }
}

/// From dark blue to yellow at the largest error; black where there is none.
fn error_colors(errors: &[f32]) -> impl ExactSizeIterator<Item = [f32; 3]> {
    let largest = errors.iter().fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
    let color = move |&e: &f32| if e > 0.0 { viridis(e / largest).to_array().map(display_value) } else { [0.0; 3] };
    errors.iter().map(color)
}

/// Everything on the film. Only the picture itself is stored in 16 bits.
fn channels(film: &Film, size: [u32; 2]) -> Channels<'_> {
    let color = |k: usize| (["R", "G", "B"][k].to_owned(), Samples::Color(film.colors(), k));
    let mut channels: Vec<_> = (0..3).map(color).collect();
    for (aov, plane) in film.planes() {
        let (layer, names) = aov.channels();
        let full_name = |name: &&str| if layer.is_empty() { (*name).to_owned() } else { format!("{layer}.{name}") };
        let samples: Vec<_> = match plane {
            PlaneData::Float(planes) => planes.iter().map(|plane| Samples::F32(plane)).collect(),
            PlaneData::Id(ids) => vec![Samples::U32(ids)],
        };
        channels.extend(names.iter().map(full_name).zip(samples));
    }
    let window = film.window();
    let (width, height) = (window.width() as usize, window.height() as usize);
    let place = [window.x0, window.y0].map(|n| n as usize);
    Channels { width, height, place, whole: size.map(|n| n as usize), channels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Reason;

    #[test]
    fn every_reason_has_its_own_color() {
        assert_eq!(REASON_COLORS.len(), Reason::ALL.len());
        let is_first = |k: usize| !REASON_COLORS[..k].contains(&REASON_COLORS[k]);
        assert!((0..REASON_COLORS.len()).all(is_first));
    }

    #[test]
    fn pictures_of_groups_lie_beside_the_picture() {
        assert_eq!(beside(Path::new("a/b.png"), "group"), Path::new("a/b.group.png"));
        assert_ne!(group_color(1), group_color(2));
        assert_eq!((group_color(NO_GROUP), error_colors(&[0.0, 1.0]).next()), ([0.0; 3], Some([0.0; 3])));
    }
}
