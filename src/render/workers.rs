//! The threads that render tiles.

use super::film::{Film, PixelRecord};
use super::integrators::Shader;
use super::rays::RayCounts;
use super::sampler::{Sampler, subpixel};
use super::settings::{Appearance, Progress, RenderSettings, RunSettings};
use super::tiles::{PixelRect, TileOrder};
use super::tracer::Tracer;
use crate::scene::camera::Camera;
use glam::{DVec2, DVec3};
use parking_lot::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// A picture, whole or as far as it came.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The pixels.
    pub film: Film,
    /// Rays traced.
    pub rays: RayCounts,
    /// Whether every pixel is done; false after a cancellation.
    pub complete: bool,
}

/// Renders a picture. Each worker thread calls `make_tracer` once and drops its tracer when no tile is left.
pub fn render<T: Tracer>(
    camera: &Camera,
    appearance: &Appearance,
    settings: &RenderSettings,
    run: &RunSettings<'_>,
    make_tracer: impl Fn() -> T + Sync,
) -> Rendered {
    let job = Job {
        camera,
        appearance,
        settings,
        run,
        order: TileOrder::new(settings.window, run.tile_side),
        next: AtomicU64::new(0),
        n_done: AtomicUsize::new(0),
        film: Mutex::new(Film::new(settings.window, &settings.aovs)),
    };
    let mut rays = RayCounts::default();
    std::thread::scope(|scope| {
        let work = || job.work(&mut make_tracer());
        let workers: Vec<_> = (0..run.threads).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            rays += worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        }
    });
    let complete = job.n_done.into_inner() == settings.window.n_pixels();
    Rendered { film: job.film.into_inner(), rays, complete }
}

/// What the workers share.
struct Job<'a> {
    camera: &'a Camera,
    appearance: &'a Appearance,
    settings: &'a RenderSettings,
    run: &'a RunSettings<'a>,
    order: TileOrder,
    next: AtomicU64,
    n_done: AtomicUsize,
    film: Mutex<Film>,
}

impl Job<'_> {
    fn work<T: Tracer>(&self, tracer: &mut T) -> RayCounts {
        let mut shader = Shader::new(tracer, self.appearance, self.settings);
        let tile_pixels = (self.run.tile_side as usize).pow(2).min(self.settings.window.n_pixels());
        let mut records = Vec::with_capacity(tile_pixels);
        while let Some(tile) = self.next_tile() {
            records.clear();
            records.extend(tile.pixels().map(|pixel| self.pixel(&mut shader, pixel)));
            self.film.lock().store(tile, &records);
            self.report(tile);
        }
        shader.rays()
    }

    fn next_tile(&self) -> Option<PixelRect> {
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

    fn report(&self, tile: PixelRect) {
        let done = self.n_done.fetch_add(tile.n_pixels(), Ordering::Relaxed) + tile.n_pixels();
        (self.run.progress)(Progress { done, total: self.settings.window.n_pixels() });
    }

    fn pixel<T: Tracer>(&self, shader: &mut Shader<'_, T>, pixel: [u32; 2]) -> PixelRecord {
        let _witness = PanicWitness(pixel);
        let misses_before = shader.misses();
        let [x, y] = pixel.map(f64::from);
        let mut sum = DVec3::ZERO;
        let mut first = None;
        for i in 0..self.settings.spp {
            let ray = self.camera.ray(DVec2::new(x, y) + subpixel(i), self.settings.size);
            let sample = shader.sample(self.camera, ray, Sampler::new(self.settings.seed, pixel, i));
            sum += sample.radiance.as_dvec3();
            first.get_or_insert(sample.first);
        }
        PixelRecord {
            color: (sum / f64::from(self.settings.spp)).as_vec3().to_array(),
            samples: self.settings.spp,
            first: first.expect("a pixel has at least one sample"),
            misses: (shader.misses() - misses_before) as u32,
        }
    }
}

/// Says how to come back to the pixel at which a thread panicked.
struct PanicWitness([u32; 2]);

impl Drop for PanicWitness {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let [x, y] = self.0;
            eprintln!("this happened at pixel ({x}, {y}): repeat it with --crop {x},{},{y},{}", x + 1, y + 1);
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
