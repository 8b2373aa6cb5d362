//! The threads that render tiles.

use super::film::{Film, FirstHit, PixelRecord};
use super::groups::NO_GROUP;
use super::integrators::{Sample, Shader};
use super::rays::RayCounts;
use super::reason::{PixelCounts, Reason};
use super::sampler::{Sampler, subpixel};
use super::settings::{Appearance, Progress, RenderSettings, RunSettings};
use super::tiles::{PACKET_SIZE, PixelRect, TileOrder};
use super::tracer::{Built, Tracer};
use crate::math::Ray;
use crate::parallel::on_threads;
use crate::scene::camera::Camera;
use glam::{DVec2, DVec3, Vec3};
use parking_lot::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// A picture, whole or as far as it came.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The pixels.
    pub film: Film,
    /// Rays traced.
    pub rays: RayCounts,
    /// Pixels by why they were traced, or not.
    pub pixels: PixelCounts,
    /// What grouping took.
    pub seconds: GroupSeconds,
    /// Whether every pixel is done; false after a cancellation.
    pub complete: bool,
}

/// Time spent on groups, summed over threads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroupSeconds {
    /// Finding out what might be seen where; for `thesis` by the clock.
    pub prepare: f64,
    /// Tracing and shading rays.
    pub trace: f64,
    /// Interpolating the other pixels.
    pub interpolate: f64,
}

/// Renders a picture, every pixel. Each worker thread calls `make_tracer` once and drops its tracer when no tile is
/// left.
pub fn render<T: Tracer>(
    camera: &Camera,
    appearance: &Appearance,
    settings: &RenderSettings,
    run: &RunSettings<'_>,
    make_tracer: impl Fn() -> T + Sync,
) -> Rendered {
    let film = Mutex::new(Film::new(settings.window, &settings.aovs));
    let queue = TileQueue::new(settings.window, run.tile_side, run);
    let pixels = PixelTracer { camera, settings };
    let counts = on_threads(run.threads, || {
        let mut tracer = make_tracer();
        let mut shader = Shader::new(&mut tracer, appearance, settings);
        let n_pixels = (run.tile_side as usize).pow(2).min(settings.window.n_pixels());
        let (mut exposures, mut records) = (Vec::with_capacity(n_pixels), Vec::with_capacity(n_pixels));
        while let Some(tile) = queue.next_tile() {
            exposures.clear();
            exposures.resize(tile.n_pixels(), Exposure::default());
            shader.aim(camera, tile);
            if !pixels.trace_tile(&mut shader, tile, &mut exposures, run) {
                break;
            }
            records.clear();
            records.extend(exposures.iter().map(Exposure::record));
            film.lock().store(tile, &records);
            queue.report(tile.n_pixels());
        }
        shader.rays()
    });
    let mut rays = RayCounts::default();
    counts.into_iter().for_each(|counts| rays += counts);
    let film = film.into_inner();
    let mut pixels = PixelCounts::default();
    pixels.add(Reason::Every, film.n_done() as u64);
    Rendered { complete: film.n_done() == settings.window.n_pixels(), film, rays, pixels, seconds: Default::default() }
}

/// Hands out tiles until there are no more, or the render is cancelled.
pub(super) struct TileQueue<'a> {
    run: &'a RunSettings<'a>,
    order: TileOrder,
    total: usize,
    next: AtomicU64,
    n_done: AtomicUsize,
}

impl<'a> TileQueue<'a> {
    pub fn new(window: PixelRect, tile_side: u32, run: &'a RunSettings<'a>) -> Self {
        let order = TileOrder::new(window, tile_side);
        Self { run, order, total: window.n_pixels(), next: AtomicU64::new(0), n_done: AtomicUsize::new(0) }
    }

    pub fn next_tile(&self) -> Option<PixelRect> {
        while !self.run.cancel.load(Ordering::Relaxed) {
            // The counter hands out numbers and orders nothing else, so `Relaxed` suffices.
            let position = self.next.fetch_add(1, Ordering::Relaxed);
            if position >= self.order.len() {
                return None;
            }
            if let Some(tile) = self.order.tile(position) {
                return Some(tile);
            }
        }
        None
    }

    pub fn report(&self, n_pixels: usize) {
        let done = self.n_done.fetch_add(n_pixels, Ordering::Relaxed) + n_pixels;
        (self.run.progress)(Progress { done, total: self.total });
    }
}

/// The samples of a pixel so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Exposure {
    sum: DVec3,
    n: u32,
    first: Option<FirstHit>,
    misses: Built,
    /// The least and the most radiance of a sample, channel by channel.
    range: Option<[Vec3; 2]>,
}

impl Exposure {
    /// Of a sample that was traced before, with so many misses.
    pub fn new(sample: &Sample, misses: Built) -> Self {
        let mut exposure = Self { misses, ..Self::default() };
        exposure.add(sample);
        exposure
    }

    fn add(&mut self, sample: &Sample) {
        self.sum += sample.radiance.as_dvec3();
        self.n += 1;
        self.first.get_or_insert(sample.first);
        let [least, most] = self.range.unwrap_or([sample.radiance; 2]);
        self.range = Some([least.min(sample.radiance), most.max(sample.radiance)]);
    }

    /// The least and the most radiance of at least one sample, channel by channel.
    pub fn range(&self) -> [Vec3; 2] {
        self.range.expect("a pixel has at least one sample")
    }

    /// Mean radiance of at least one sample.
    pub fn mean(&self) -> Vec3 {
        (self.sum / f64::from(self.n)).as_vec3()
    }

    /// The pixel, of at least one sample.
    pub fn record(&self) -> PixelRecord {
        PixelRecord {
            color: self.mean().to_array(),
            samples: self.n,
            first: self.first.expect("a pixel has at least one sample"),
            misses: self.misses,
            group: NO_GROUP,
            reason: Reason::Every,
            error: 0.0,
        }
    }
}

/// Traces whole pixels.
#[derive(Clone, Copy)]
pub(super) struct PixelTracer<'a> {
    pub camera: &'a Camera,
    pub settings: &'a RenderSettings,
}

impl PixelTracer<'_> {
    /// All samples of a pixel.
    pub fn trace<T: Tracer>(&self, shader: &mut Shader<'_, T>, pixel: [u32; 2]) -> PixelRecord {
        let mut exposure = Exposure::default();
        self.expose(shader, pixel, &mut exposure, self.settings.spp);
        exposure.record()
    }

    /// All samples of the pixels of a tile; `exposures` are as many, row by row. Returns whether they are complete: a
    /// tile of many samples takes long, and the render may be cancelled meanwhile.
    fn trace_tile<T: Tracer>(
        &self,
        shader: &mut Shader<'_, T>,
        tile: PixelRect,
        exposures: &mut [Exposure],
        run: &RunSettings<'_>,
    ) -> bool {
        let spp = self.settings.spp;
        if self.settings.shows_misses() {
            // One by one, so that it is known which pixel a block was built for.
            for (pixel, exposure) in tile.pixels().zip(exposures) {
                if run.gives_up_tiles(spp) {
                    return false;
                }
                self.expose(shader, pixel, exposure, spp);
            }
            return true;
        }
        for block in tile.blocks(PACKET_SIZE) {
            if run.gives_up_tiles(spp) {
                return false;
            }
            let _witness = PanicWitness(block);
            let mut pixels = block.pixels().cycle();
            let samples = (0..spp).flat_map(|i| block.pixels().map(move |pixel| self.sample(pixel, i)));
            shader.samples(self.camera, samples, |sample| {
                let idx = pixels.next().and_then(|pixel| tile.idx(pixel)).expect("a block of the tile has pixels");
                exposures[idx].add(&sample);
            });
        }
        true
    }

    /// Goes on with a pixel's samples until there are `n`.
    pub fn expose<T: Tracer>(&self, shader: &mut Shader<'_, T>, pixel: [u32; 2], exposure: &mut Exposure, n: u32) {
        let [x, y] = pixel;
        let _witness = PanicWitness(PixelRect { x0: x, y0: y, x1: x + 1, y1: y + 1 });
        let misses_before = shader.misses();
        if exposure.n + 1 == n {
            let (ray, sampler) = self.sample(pixel, exposure.n);
            exposure.add(&shader.sample(self.camera, ray, sampler));
        } else if exposure.n < n {
            let samples = (exposure.n..n).map(|i| self.sample(pixel, i));
            shader.samples(self.camera, samples, |sample| exposure.add(&sample));
        }
        exposure.misses = exposure.misses + (shader.misses() - misses_before);
    }

    /// The camera ray and the random numbers of one sample of a pixel.
    pub fn sample(&self, pixel: [u32; 2], i: u32) -> (Ray, Sampler) {
        let [x, y] = pixel.map(f64::from);
        let ray = self.camera.ray(DVec2::new(x, y) + subpixel(i), self.settings.size);
        (ray, Sampler::new(self.settings.seed, pixel, i))
    }
}

/// Says how to come back to the pixels at which a thread panicked.
pub(super) struct PanicWitness(pub PixelRect);

impl PanicWitness {
    fn advice(&self) -> String {
        let PixelRect { x0, y0, x1, y1 } = self.0;
        format!("this happened at pixel ({x0}, {y0}) or beside it: repeat it with --crop {x0},{x1},{y0},{y1}")
    }
}

impl Drop for PanicWitness {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{}", self.advice());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::analytic::{AnalyticTracer, Shape};
    use crate::render::film::Aov;
    use crate::scene::description::{CameraDescription, IntegratorKind, Light, Material};
    use glam::Vec3;
    use std::sync::atomic::AtomicBool;

    const SIZE: [u32; 2] = [45, 37];

    fn settings(name: &str) -> RenderSettings {
        let integrator: IntegratorKind = name.parse().unwrap();
        let aovs = vec![Aov::Depth, Aov::Normal, Aov::Mesh];
        RenderSettings { integrator, spp: 3, ao_samples: 4, aovs, ..RenderSettings::of_size(SIZE) }
    }

    fn render_ball(settings: &RenderSettings, run: &RunSettings<'_>) -> Rendered {
        let camera = CameraDescription { eye: DVec3::new(0.0, 2.0, 6.0), at: DVec3::ZERO, up: DVec3::Y, fov: 40.0 };
        let light = Light::Point { position: DVec3::new(3.0, 5.0, 2.0), intensity: Vec3::splat(90.0) };
        let sky = Light::Sky { radiance: Vec3::splat(0.5) };
        let mirror = Material { mirror: Vec3::splat(0.4), ..Material::default() };
        let appearance = Appearance::new(vec![mirror, Material::default()], vec![light, sky], Vec3::splat(0.1));
        let tracer = AnalyticTracer { shapes: vec![Shape::Sphere(DVec3::ZERO, 1.0), Shape::Floor(-1.0)] };
        render(&Camera::new(&camera), &appearance, settings, run, || tracer.clone())
    }

    fn quietly(settings: &RenderSettings, threads: usize, tile_side: u32) -> Rendered {
        let cancel = AtomicBool::new(false);
        render_ball(settings, &RunSettings { tile_side, ..RunSettings::quiet(threads, &cancel) })
    }

    #[test]
    fn threads_and_tiles_do_not_change_a_bit() {
        for name in ["whitted", "ao", "path", "debug:normal"] {
            let reference = quietly(&settings(name), 1, 16);
            assert!(reference.complete && reference.film.n_done() == 45 * 37);
            for (threads, tile_side) in [(2, 16), (8, 5), (3, 1), (2, 1000)] {
                let other = quietly(&settings(name), threads, tile_side);
                assert_eq!(other.film, reference.film, "{name} with {threads} threads, tiles of {tile_side}");
                assert_eq!(other.rays, reference.rays);
            }
        }
    }

    #[test]
    fn a_panic_tells_the_window_that_repeats_it() {
        let advice = PanicWitness(PixelRect { x0: 8, y0: 20, x1: 12, y1: 22 }).advice();
        assert!(advice.ends_with("--crop 8,12,20,22"), "{advice}");
    }

    #[test]
    fn a_crop_window_holds_the_pixels_of_the_whole_picture() {
        for name in ["ao", "path"] {
            let whole = quietly(&settings(name), 2, 16).film;
            let window = PixelRect { x0: 7, y0: 11, x1: 30, y1: 36 };
            let crop = quietly(&RenderSettings { window, ..settings(name) }, 2, 16).film;
            for (idx, pixel) in window.pixels().enumerate() {
                assert_eq!(crop.colors()[idx], whole.colors()[whole.window().idx(pixel).unwrap()]);
            }
        }
    }

    #[test]
    fn seeds_change_the_noise_and_nothing_else() {
        let [a, b] = [1, 2].map(|seed| quietly(&RenderSettings { seed, ..settings("path") }, 1, 16).film);
        assert_ne!(a.colors(), b.colors());
        assert_eq!(a.planes(), b.planes());
    }

    #[test]
    fn a_cancelled_picture_knows_which_pixels_are_done() {
        let cancel = AtomicBool::new(false);
        let stop_half_way = |p: Progress| cancel.store(p.done >= p.total / 2, Ordering::Relaxed);
        let run = RunSettings { tile_side: 8, progress: &stop_half_way, ..RunSettings::quiet(1, &cancel) };
        let whole = quietly(&settings("whitted"), 1, 16).film;
        let Rendered { film, complete, .. } = render_ball(&settings("whitted"), &run);
        assert!(!complete && film.n_done() >= 45 * 37 / 2 && film.n_done() < 45 * 37);
        for (idx, &done) in film.done().iter().enumerate() {
            assert_eq!(film.colors()[idx], if done { whole.colors()[idx] } else { [0.0; 3] });
        }
    }

    #[test]
    fn a_ball_on_a_floor_looks_like_one() {
        let settings = RenderSettings { aovs: vec![Aov::Mesh], ..RenderSettings::of_size([24, 12]) };
        let film = quietly(&settings, 1, 16).film;
        let Some(crate::render::film::PlaneData::Id(mesh)) = film.plane(Aov::Mesh) else { unreachable!() };
        let row = |row: &[u32]| row.iter().map(|&id| [b'o', b'.', b' '][id.min(2) as usize] as char).collect();
        let picture: Vec<String> = mesh.chunks(24).map(row).collect();
        assert_eq!(picture, BALL);
    }

    const BALL: [&str; 12] = [
        "                        ",
        "........................",
        "........................",
        "...........oo...........",
        "..........oooo..........",
        ".........oooooo.........",
        ".........oooooo.........",
        "..........oooo..........",
        "...........oo...........",
        "........................",
        "........................",
        "........................",
    ];
}
