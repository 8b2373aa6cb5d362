//! What to render, and apart from it how.

use super::film::Aov;
use super::tiles::PixelRect;
use crate::names::{by_name, name_of};
use crate::scene::description::{DebugView, IntegratorKind, Light, Material};
use crate::scene::light::sky_radiance;
use glam::Vec3;
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the picture is. Equal settings and scenes give equal bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Width and height of the whole picture in pixels, each at least 1.
    pub size: [u32; 2],
    /// The pixels to render, within the whole picture; each gets the value it has there.
    pub window: PixelRect,
    /// Samples per pixel, at least 1, averaged with equal weight (a box filter). Sample 0 is at the pixel's centre.
    pub spp: u32,
    /// How light is gathered.
    pub integrator: IntegratorKind,
    /// Longest chain of reflections, refractions and bounces; light beyond is lost.
    pub max_depth: u32,
    /// Rays per sample of the `ao` integrator, at least 1.
    pub ao_samples: u32,
    /// Seed of all random numbers.
    pub seed: u32,
    /// What to store besides colour.
    pub aovs: Vec<Aov>,
    /// Which pixels are traced.
    pub groups: Groups,
    /// Error that `groups` aims at, in display units (0 to 1 after clamping and sRGB): at most 1 % of pixels are
    /// further off. 0 traces every pixel.
    pub tolerance: f32,
}

/// Which pixels are traced; the others are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Groups {
    /// All.
    #[default]
    Off,
    /// The four corners of every group of pixels that show the same patch: the published algorithm.
    Thesis,
    /// Those that differ from their surroundings, and enough others to know that.
    Adaptive,
}

impl Groups {
    /// Every choice with its name on the command line.
    pub const ALL: [(&'static str, Self); 3] =
        [("off", Self::Off), ("thesis", Self::Thesis), ("adaptive", Self::Adaptive)];
}

impl fmt::Display for Groups {
    /// Its name on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(name_of(&Self::ALL, self))
    }
}

impl FromStr for Groups {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        by_name("way of grouping pixels", &Self::ALL, text)
    }
}

impl RenderSettings {
    /// A whole picture of `size` pixels, one sample each, by the `whitted` integrator.
    pub fn of_size(size: [u32; 2]) -> Self {
        Self {
            size,
            window: PixelRect::whole(size),
            spp: 1,
            integrator: IntegratorKind::Whitted,
            max_depth: 8,
            ao_samples: 16,
            seed: 0,
            aovs: Vec::new(),
            groups: Groups::Off,
            tolerance: 2.0 / 255.0,
        }
    }

    /// Whether the picture tells what had to be built for each of its pixels.
    pub(super) fn shows_misses(&self) -> bool {
        self.integrator == IntegratorKind::Debug(DebugView::Miss)
            || self.aovs.iter().any(|aov| matches!(aov, Aov::Misses | Aov::Build))
    }
}

/// How the picture is made. None of it changes the picture.
#[derive(Clone, Copy)]
pub struct RunSettings<'a> {
    /// Worker threads, at least 1.
    pub threads: usize,
    /// Side of a tile in pixels, at least 1.
    pub tile_side: u32,
    /// Set it to stop after the tiles at work; the film then holds what is done.
    pub cancel: &'a AtomicBool,
    /// Called by the workers after each tile.
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

/// With more samples a pixel than this a tile that was begun is given up when the render is cancelled; with fewer it is
/// finished, which takes no time that anybody would notice.
const SAMPLES_AT_ONCE: u32 = 64;

impl<'a> RunSettings<'a> {
    /// Tiles of 16 × 16 pixels and no report of progress.
    pub fn quiet(threads: usize, cancel: &'a AtomicBool) -> Self {
        Self { threads, tile_side: 16, cancel, progress: &|_| () }
    }

    /// Whether tiles that were begun, of so many samples a pixel, are not finished any more: the render was cancelled,
    /// and to finish them would take long.
    pub(super) fn gives_up_tiles(&self, spp: u32) -> bool {
        spp > SAMPLES_AT_ONCE && self.cancel.load(Ordering::Relaxed)
    }
}

/// How far a render has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Pixels done.
    pub done: usize,
    /// Pixels to do.
    pub total: usize,
}

/// How things look: everything of a scene that is neither geometry nor camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    pub(super) materials: Vec<Material>,
    pub(super) lights: Vec<Light>,
    pub(super) background: Vec3,
    pub(super) sky: Vec3,
    pub(super) any_glass: bool,
    /// Radiance of the brightest thing that there may be.
    pub(super) brightest: f32,
}

impl Appearance {
    /// `materials[i]` belongs to `MeshId(i)`; `background` is seen by rays that leave the scene and lights nothing.
    pub fn new(materials: Vec<Material>, lights: Vec<Light>, background: Vec3) -> Self {
        let any_glass = materials.iter().any(|material| material.glass.is_some());
        let sky = sky_radiance(&lights);
        let irradiance: f32 = lights.iter().map(Light::most_irradiance).sum();
        let surfaces = materials.iter().map(|material| material.most_reflected() * irradiance);
        let brightest = surfaces.fold(0.0, f32::max) + sky.max_element().max(background.max_element());
        Self { sky, any_glass, brightest, materials, lights, background }
    }
}
