//! The film: colour and AOVs of a window of pixels.

use super::groups::NO_GROUP;
use super::reason::Reason;
use super::tiles::PixelRect;
use super::tracer::Built;
use crate::names::{by_name, name_of};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// What a film can store besides colour. Geometry is that of sample 0, at the pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Depth along the camera's forward direction, in world units; infinite where nothing is hit.
    Depth,
    /// Unit normal of the limit surface in world space; zero where nothing is hit.
    Normal,
    /// Mesh id; [`FirstHit::NO_ID`] where nothing is hit.
    Mesh,
    /// Patch id within its mesh; [`FirstHit::NO_ID`] where nothing is hit.
    Patch,
    /// Patch parameters, each in 0..=1; zero where nothing is hit.
    Uv,
    /// Number of samples taken; 0 where none was traced.
    Samples,
    /// Number of blocks built while the pixel was rendered. Unlike everything else it depends on timing.
    Misses,
    /// Bytes of those blocks: what it cost to build them, about. Depends on timing as well.
    Build,
    /// Number of the pixel's group; [`NO_GROUP`] where there is none.
    Group,
    /// Number of the pixel's [`Reason`].
    Reason,
    /// How far probes were from the interpolation that gave the pixel, in display units; zero where it was traced.
    Error,
}

impl Aov {
    /// Every AOV with its name on the command line.
    pub const ALL: [(&'static str, Self); 11] = [
        ("Z", Self::Depth),
        ("N", Self::Normal),
        ("mesh", Self::Mesh),
        ("patch", Self::Patch),
        ("uv", Self::Uv),
        ("samples", Self::Samples),
        ("miss", Self::Misses),
        ("build", Self::Build),
        ("group", Self::Group),
        ("reason", Self::Reason),
        ("error", Self::Error),
    ];

    /// Layer name and channel names in files; the layer of plain channels has an empty name.
    pub fn channels(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Depth => ("", &["Z"]),
            Self::Normal => ("N", &["X", "Y", "Z"]),
            Self::Mesh => ("", &["mesh"]),
            Self::Patch => ("", &["patch"]),
            Self::Uv => ("uv", &["u", "v"]),
            Self::Samples => ("", &["samples"]),
            Self::Misses => ("", &["miss"]),
            Self::Build => ("", &["build"]),
            Self::Group => ("", &["group"]),
            Self::Reason => ("", &["reason"]),
            Self::Error => ("", &["error"]),
        }
    }
}

impl fmt::Display for Aov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(name_of(&Self::ALL, self))
    }
}

impl FromStr for Aov {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        by_name("AOV", &Self::ALL, text)
    }
}

/// What the camera ray of sample 0 hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstHit {
    /// See [`Aov::Depth`].
    pub depth: f32,
    /// See [`Aov::Normal`].
    pub normal: [f32; 3],
    /// See [`Aov::Mesh`].
    pub mesh: u32,
    /// See [`Aov::Patch`].
    pub patch: u32,
    /// See [`Aov::Uv`].
    pub uv: [f32; 2],
}

impl FirstHit {
    /// The id of what is not there.
    pub const NO_ID: u32 = u32::MAX;

    /// Nothing was hit.
    pub const NONE: Self =
        Self { depth: f32::INFINITY, normal: [0.0; 3], mesh: Self::NO_ID, patch: Self::NO_ID, uv: [0.0; 2] };
}

/// All that a film may want to know of a finished pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelRecord {
    /// Mean radiance, linear RGB.
    pub color: [f32; 3],
    /// See [`Aov::Samples`].
    pub samples: u32,
    /// Geometry of sample 0.
    pub first: FirstHit,
    /// See [`Aov::Misses`] and [`Aov::Build`].
    pub misses: Built,
    /// See [`Aov::Group`].
    pub group: u32,
    /// Why it was traced, or that it was not.
    pub reason: Reason,
    /// See [`Aov::Error`].
    pub error: f32,
}

impl PixelRecord {
    /// A pixel that shows the background and for which nothing was traced.
    pub fn background(color: [f32; 3]) -> Self {
        let first = FirstHit::NONE;
        Self {
            color,
            samples: 0,
            first,
            misses: Built::default(),
            group: NO_GROUP,
            reason: Reason::Background,
            error: 0.0,
        }
    }
}

/// The stored samples of one AOV, a vector per channel, each row by row over the film's window.
#[derive(Clone, Debug, PartialEq)]
pub enum PlaneData {
    /// Measures.
    Float(Vec<Vec<f32>>),
    /// Ids and counts; one channel.
    Id(Vec<u32>),
}

impl PlaneData {
    fn new(aov: Aov, n_pixels: usize) -> Self {
        match aov {
            Aov::Depth => Self::Float(vec![vec![f32::INFINITY; n_pixels]]),
            Aov::Normal | Aov::Uv => Self::Float(vec![vec![0.0; n_pixels]; aov.channels().1.len()]),
            Aov::Error => Self::Float(vec![vec![0.0; n_pixels]]),
            Aov::Mesh | Aov::Patch | Aov::Group => Self::Id(vec![FirstHit::NO_ID; n_pixels]),
            Aov::Samples | Aov::Misses | Aov::Build | Aov::Reason => Self::Id(vec![0; n_pixels]),
        }
    }

    fn part<R: Iterator<Item = Range<usize>>>(&self, rows: impl Fn() -> R) -> Self {
        match self {
            Self::Float(channels) => Self::Float(channels.iter().map(|channel| of_rows(channel, rows())).collect()),
            Self::Id(ids) => Self::Id(of_rows(ids, rows())),
        }
    }

    fn set(&mut self, aov: Aov, idx: usize, record: &PixelRecord) {
        let first = &record.first;
        match self {
            Self::Id(ids) => {
                ids[idx] = match aov {
                    Aov::Mesh => first.mesh,
                    Aov::Patch => first.patch,
                    Aov::Samples => record.samples,
                    Aov::Group => record.group,
                    Aov::Reason => record.reason as u32,
                    Aov::Build => saturated(record.misses.bytes),
                    _ => saturated(record.misses.blocks),
                }
            }
            Self::Float(channels) => {
                let values: &[f32] = match aov {
                    Aov::Depth => &[first.depth],
                    Aov::Normal => &first.normal,
                    Aov::Error => &[record.error],
                    _ => &first.uv,
                };
                channels.iter_mut().zip(values).for_each(|(channel, &value)| channel[idx] = value);
            }
        }
    }
}

fn of_rows<T: Copy>(all: &[T], rows: impl Iterator<Item = Range<usize>>) -> Vec<T> {
    rows.flat_map(|row| all[row].iter().copied()).collect()
}

fn saturated(n: u64) -> u32 {
    n.min(u64::from(u32::MAX)) as u32
}

/// Colours and AOVs of a window of the picture. Pixels that are not done are black and say so.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    window: PixelRect,
    colors: Vec<[f32; 3]>,
    done: Vec<bool>,
    planes: Vec<(Aov, PlaneData)>,
}

impl Film {
    /// An unexposed film over `window`.
    pub fn new(window: PixelRect, aovs: &[Aov]) -> Self {
        let n = window.n_pixels();
        let planes = aovs.iter().map(|&aov| (aov, PlaneData::new(aov, n))).collect();
        Self { window, colors: vec![[0.0; 3]; n], done: vec![false; n], planes }
    }

    /// Bytes that [`Film::new`] allocates.
    pub fn n_bytes(window: PixelRect, aovs: &[Aov]) -> usize {
        let plane_bytes: usize = aovs.iter().map(|aov| 4 * aov.channels().1.len()).sum();
        window.n_pixels() * (size_of::<[f32; 3]>() + size_of::<bool>() + plane_bytes)
    }

    /// The pixels it covers.
    pub fn window(&self) -> PixelRect {
        self.window
    }

    /// Linear RGB, row by row over the window.
    pub fn colors(&self) -> &[[f32; 3]] {
        &self.colors
    }

    /// Which pixels are done, row by row over the window.
    pub fn done(&self) -> &[bool] {
        &self.done
    }

    /// Number of pixels that are done.
    pub fn n_done(&self) -> usize {
        self.done.iter().filter(|&&done| done).count()
    }

    /// The stored AOVs, in the order they were asked for.
    pub fn planes(&self) -> &[(Aov, PlaneData)] {
        &self.planes
    }

    /// The plane of one AOV, if it was asked for.
    pub fn plane(&self, aov: Aov) -> Option<&PlaneData> {
        self.planes.iter().find(|(a, _)| *a == aov).map(|(_, plane)| plane)
    }

    /// The part of it that covers `window`, which lies within its own.
    pub fn part(&self, window: PixelRect) -> Self {
        let rows = || {
            (window.y0..window.y1).map(|y| self.idx([window.x0, y])).map(|first| first..first + window.width() as usize)
        };
        let planes = self.planes.iter().map(|(aov, plane)| (*aov, plane.part(rows)));
        Self {
            window,
            colors: of_rows(&self.colors, rows()),
            done: of_rows(&self.done, rows()),
            planes: planes.collect(),
        }
    }

    /// Exposes one pixel of the window.
    pub fn set(&mut self, pixel: [u32; 2], record: &PixelRecord) {
        let idx = self.idx(pixel);
        self.expose(idx, record);
    }

    /// Exposes a tile of the window; `records` are its pixels row by row.
    pub fn store(&mut self, tile: PixelRect, records: &[PixelRecord]) {
        for (y, records) in (tile.y0..tile.y1).zip(records.chunks_exact(tile.width() as usize)) {
            let first = self.idx([tile.x0, y]);
            records.iter().enumerate().for_each(|(k, record)| self.expose(first + k, record));
        }
    }

    /// Exposes every pixel of a part of the window alike.
    pub fn fill(&mut self, part: PixelRect, record: &PixelRecord) {
        for y in part.y0..part.y1 {
            let first = self.idx([part.x0, y]);
            let row = first..first + part.width() as usize;
            self.colors[row.clone()].fill(record.color);
            self.done[row.clone()].fill(true);
            for (aov, plane) in &mut self.planes {
                row.clone().for_each(|idx| plane.set(*aov, idx, record));
            }
        }
    }

    fn idx(&self, pixel: [u32; 2]) -> usize {
        self.window.idx(pixel).expect("the pixel lies in the film's window")
    }

    fn expose(&mut self, idx: usize, record: &PixelRecord) {
        self.colors[idx] = record.color;
        self.done[idx] = true;
        self.planes.iter_mut().for_each(|(aov, plane)| plane.set(*aov, idx, record));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_stores_what_was_asked_for_where_it_belongs() {
        let window = PixelRect { x0: 10, y0: 20, x1: 13, y1: 22 };
        let mut film = Film::new(window, &[Aov::Patch, Aov::Normal, Aov::Samples]);
        let first = FirstHit { patch: 7, normal: [0.0, 1.0, 0.0], ..FirstHit::NONE };
        let background = PixelRecord::background([1.0, 2.0, 3.0]);
        film.set([11, 21], &PixelRecord { samples: 4, first, ..background });
        assert_eq!((film.n_done(), film.done()[4], film.colors()[4]), (1, true, [1.0, 2.0, 3.0]));
        let id = FirstHit::NO_ID;
        assert_eq!(film.plane(Aov::Patch), Some(&PlaneData::Id(vec![id, id, id, id, 7, id])));
        let Some(PlaneData::Float(normal)) = film.plane(Aov::Normal) else { panic!("the normal was asked for") };
        assert_eq!((normal.len(), normal[1][4]), (3, 1.0));
        assert_eq!(film.plane(Aov::Depth), None);
    }

    #[test]
    fn every_aov_is_known_by_its_name() {
        for (name, aov) in Aov::ALL {
            assert_eq!(name.parse(), Ok(aov));
        }
        assert!("depth".parse::<Aov>().unwrap_err().contains("choose from Z, N"));
    }
}
