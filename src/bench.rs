//! Ray rates by a published recipe, so that they stand beside those of other tracers that follow it.
//!
//! ```text
//! camera      at = centre of the vertices' box, eye = at + 1.35 diag normalize(1, 0.6, 1.2), 35 degrees vertical; or given
//! primary     through pixel centres, 16 x 16 tiles row by row, one tile a task
//! AO          samples 0..N-1 at each hit, any hit, 1024 rays a task
//! diffuse     sample N at each hit, nearest hit, in tile order and once more shuffled
//! ```
//!
//! A secondary ray starts `1e-4 diag` above the hit along the geometric normal and is cosine-distributed about it; its
//! two random numbers are hashes of (pixel, 2 sample) and (pixel, 2 sample + 1). Rays and results are f32, built before
//! any clock starts. Where the recipe has rays one by one, the tracer gets what a renderer would tell it, within the time
//! that counts:
//! * the bounds of a task's primary rays, and primary rays of 4 x 2 pixels together, unless `one_by_one` is on;
//! * above which triangle each secondary ray starts, unless `tells_start` is off;
//! * secondary rays in batches of so many, for the tracer to put into an order of its own, if `batch` is above 0.
//!
//! Each pass runs K times; rates are million rays per wall second (`median`, `best`) and per CPU second of the threads
//! (`cpu`).

use crate::grid::PACKET;
use crate::io::process::thread_cpu;
use crate::math::{DBounds, Hit, Intersect, PrimitiveRef, Ray, RayBounds};
use crate::parallel::on_threads;
use crate::render::sampler::hash2;
use crate::render::tiles::{PACKET_SIZE, PixelRect};
use crate::scene::camera::Camera;
use glam::{DVec2, DVec3, Vec3};
use parking_lot::Mutex;
use serde::Serialize;
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Side of a tile of primary rays.
const TILE: u32 = 16;
/// Secondary rays in a task.
const CHUNK: usize = 1024;

/// A ray as the recipe stores it.
#[derive(Clone, Copy, Debug, Default)]
struct BenchRay {
    origin: Vec3,
    direction: Vec3,
}

/// The bundle of the camera rays of a tile, in the precision that they have.
fn bundle(camera: &Camera, tile: PixelRect, size: [u32; 2]) -> RayBounds {
    /// By how much rounding to f32 moves a number up to 1.
    const ROUNDING: f64 = 1.0 / (1u32 << 25) as f64;
    let exact = camera.bundle(tile.corners(), size);
    let eye = camera.eye().as_vec3().as_dvec3();
    RayBounds { origin: DBounds { min: eye, max: eye }, direction: exact.direction.expanded(ROUNDING) }
}

impl BenchRay {
    #[inline]
    fn ray(&self) -> Ray {
        Ray::new(self.origin.as_dvec3(), self.direction.as_dvec3())
    }
}

/// A ray that starts above a triangle.
#[derive(Clone, Copy, Debug)]
struct SecondaryRay {
    ray: BenchRay,
    from: Option<PrimitiveRef>,
    /// How far above it.
    above: f32,
}

impl SecondaryRay {
    #[inline]
    fn ray(&self) -> Ray {
        Ray { from: self.from, above: self.from.map(|_| self.above), ..self.ray.ray() }
    }
}

/// What a primary ray hit; `t` is infinite for a miss.
#[derive(Clone, Copy, Debug)]
pub struct BenchHit {
    /// Distance.
    pub t: f32,
    /// Control face.
    pub face: u32,
    /// Parameter of the face, encoded as [`face_parameters`] says.
    pub u: f32,
    /// See `u`.
    pub v: f32,
    /// Geometric normal, not normalised.
    pub normal: Vec3,
}

impl BenchHit {
    const MISS: Self = Self { t: f32::INFINITY, face: u32::MAX, u: 0.0, v: 0.0, normal: Vec3::ZERO };
}

/// Million rays a second.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Rate {
    /// By the median of the passes' wall times.
    pub median: f64,
    /// By the shortest pass.
    pub best: f64,
    /// By the median of CPU seconds per thread.
    pub cpu: f64,
}

/// Rates with one thread and with all.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Rates {
    /// One thread.
    pub t1: Rate,
    /// All threads asked for.
    #[serde(rename = "tN")]
    pub tn: Rate,
}

/// What to run.
#[derive(Clone, Copy, Debug)]
pub struct BenchSettings {
    /// Picture size in pixels.
    pub size: [u32; 2],
    /// Threads of the second measurement of each pass.
    pub threads: usize,
    /// Occlusion rays per hit.
    pub ao: u32,
    /// Secondary rays handed over at a time; 0: one by one, as the recipe has it.
    pub batch: usize,
    /// Whether primary rays are handed over one by one, as the recipe has it, and not those of neighbours together.
    pub one_by_one: bool,
    /// Whether the tracer is told above which triangle each secondary ray starts.
    pub tells_start: bool,
    /// Passes of each measurement.
    pub repeat: usize,
    /// Which passes to run besides the first primary one: primary, AO, diffuse.
    pub passes: [bool; 3],
    /// Diagonal of the box of the vertices that faces use.
    pub diagonal: f64,
}

/// What was measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BenchResult {
    /// Primary rays that hit.
    pub hits: usize,
    /// Mean distance of hits.
    pub mean_t: f64,
    /// Wall seconds of the first, cold pass of primary rays on all threads.
    pub first_pass_s: f64,
    /// Primary rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primary: Option<Rates>,
    /// Number of AO rays.
    pub ao_rays: usize,
    /// Share of them that is occluded.
    pub ao_occluded: f64,
    /// Wall seconds of the first AO pass.
    pub ao_first_s: f64,
    /// AO rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ao: Option<Rates>,
    /// Diffuse rays in the order of the pixels' tiles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffuse_tile_order: Option<Rates>,
    /// The same rays shuffled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffuse_shuffled: Option<Rates>,
    /// Number of diffuse rays.
    pub diffuse_rays: usize,
    /// Share of them that hit.
    pub diffuse_hit: f64,
}

impl BenchSettings {
    /// Secondary rays of one task.
    fn task_size(&self) -> usize {
        if self.batch > 0 { self.batch } else { CHUNK }
    }

    /// Columns and rows of pixels whose primary rays come after one another.
    fn block_size(&self) -> [u32; 2] {
        if self.one_by_one { [TILE; 2] } else { PACKET_SIZE }
    }

    /// Passes of all measurements, the first ones of primary and occlusion rays included.
    fn n_passes(&self) -> usize {
        let [primary, ao, diffuse] = self.passes.map(usize::from);
        let of_measurement = self.repeat * if self.threads > 1 { 2 } else { 1 };
        1 + primary * of_measurement + ao * (1 + of_measurement) + 2 * diffuse * of_measurement
    }
}

/// Counts passes, for whoever waits.
struct Counter<'p> {
    n_done: Cell<usize>,
    n: usize,
    report: &'p dyn Fn(usize, usize),
}

impl Counter<'_> {
    fn done(&self) {
        self.n_done.set(self.n_done.get() + 1);
        (self.report)(self.n_done.get(), self.n);
    }
}

/// The rays of the recipe and their results.
pub struct Bench<'p> {
    settings: BenchSettings,
    counter: Counter<'p>,
    camera: Camera,
    tiles: Vec<PixelRect>,
    eye: DVec3,
    /// Directions of primary rays as they are traced: tile by tile, block by block.
    primary: Vec<DVec3>,
    /// What they hit.
    hits: Vec<BenchHit>,
    /// Their pixels.
    pixel: Vec<u32>,
    /// Where among these the rays are in the order of the recipe.
    order: Vec<usize>,
}

/// Face parameters as one number each for faces of any size: a quad's are its own; sub-quad i of a polygon has
/// `u = 2 (i & 3) + 0.5 + u'`, `v = 2 ((i >> 2) & 3) + 0.5 + v'`.
pub fn face_parameters(face_size: u32, hit: &Hit) -> [f32; 2] {
    if face_size == 4 {
        return [hit.u, hit.v];
    }
    let offset = |i: u32| 2.0 * (i & 3) as f32 + 0.5;
    [offset(hit.sub) + hit.u, offset(hit.sub >> 2) + hit.v]
}

impl<'p> Bench<'p> {
    /// Makes the primary rays and room for their results. `progress` will be told how many passes are done, and of how
    /// many.
    pub fn new(camera: &Camera, settings: BenchSettings, progress: &'p dyn Fn(usize, usize)) -> Self {
        let n = PixelRect::whole(settings.size).n_pixels();
        let mut bench = Self {
            settings,
            counter: Counter { n_done: Cell::new(0), n: settings.n_passes(), report: progress },
            camera: *camera,
            tiles: PixelRect::whole(settings.size).blocks([TILE; 2]).collect(),
            eye: camera.eye().as_vec3().as_dvec3(),
            primary: Vec::with_capacity(n),
            hits: vec![BenchHit::MISS; n],
            pixel: Vec::with_capacity(n),
            order: Vec::with_capacity(n),
        };
        for tile in &bench.tiles {
            let first = bench.order.len();
            bench.order.resize(first + tile.n_pixels(), 0);
            for pixel in tile.blocks(settings.block_size()).flat_map(PixelRect::pixels) {
                let [x, y] = pixel;
                let ray = camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), settings.size);
                bench.order[first + tile.idx(pixel).expect("a block is in its tile")] = bench.primary.len();
                bench.primary.push(ray.direction.as_vec3().as_dvec3());
                bench.pixel.push(y * settings.size[0] + x);
            }
        }
        bench
    }

    /// Runs all passes. `make_tracer` is called once for each thread of each pass; `bench_hit` describes a hit.
    pub fn run<T: Intersect>(
        &mut self,
        make_tracer: impl Fn() -> T + Sync,
        bench_hit: impl Fn(&Hit) -> BenchHit + Sync,
    ) -> BenchResult {
        let mut result = BenchResult::default();
        let bench_hit = |hit: Option<&Hit>| hit.map_or(BenchHit::MISS, &bench_hit);
        self.run_primary(&make_tracer, &bench_hit, &mut result);
        if self.settings.passes[1] || self.settings.passes[2] {
            self.run_secondary(&make_tracer, &mut result);
        }
        debug_assert_eq!(self.counter.n_done.get(), self.counter.n, "passes are counted in advance");
        result
    }

    fn run_secondary<T: Intersect>(&self, make_tracer: &(impl Fn() -> T + Sync), result: &mut BenchResult) {
        let (ao, mut diffuse) = self.secondary_rays(&mut make_tracer());
        if self.settings.passes[1] {
            self.run_ao(make_tracer, &ao, result);
        }
        if self.settings.passes[2] {
            let mut hits = vec![false; diffuse.len()];
            result.diffuse_tile_order = Some(self.run_diffuse(make_tracer, &diffuse, &mut hits));
            for i in (2..=diffuse.len()).rev() {
                diffuse.swap(i - 1, (hash2(i as u32, 77) as usize) % i);
            }
            result.diffuse_shuffled = Some(self.run_diffuse(make_tracer, &diffuse, &mut hits));
            result.diffuse_rays = diffuse.len();
            result.diffuse_hit = share(&hits);
        }
    }

    fn run_primary<T: Intersect>(
        &mut self,
        make_tracer: &(impl Fn() -> T + Sync),
        bench_hit: &(impl Fn(Option<&Hit>) -> BenchHit + Sync),
        result: &mut BenchResult,
    ) {
        let (tiles, camera, eye, settings) = (&self.tiles, &self.camera, self.eye, &self.settings);
        let counter = &self.counter;
        let directions = split(&self.primary, tiles);
        let mut hits: Vec<_> = split_mut(&mut self.hits, tiles);
        let mut pass = |threads| {
            parallel(threads, make_tracer, &mut hits, |tracer, tile, hits| {
                tracer.aim(&bundle(camera, tiles[tile], settings.size));
                if settings.one_by_one {
                    for (&direction, hit) in directions[tile].iter().zip(hits.iter_mut()) {
                        *hit = bench_hit(tracer.closest(&Ray::new(eye, direction)).as_ref());
                    }
                } else {
                    trace_in_packets(tracer, eye, tiles[tile], directions[tile], hits, bench_hit);
                }
            })
        };
        result.first_pass_s = pass(settings.threads).0;
        counter.done();
        if settings.passes[0] {
            result.primary = Some(measure(settings, counter, self.primary.len(), &mut pass));
        }
        let hits = self.order.iter().map(|&place| &self.hits[place]).filter(|h| h.t < f32::INFINITY);
        let (n, sum) = hits.fold((0, 0.0), |(n, sum), h| (n + 1, sum + f64::from(h.t)));
        result.hits = n;
        result.mean_t = if n > 0 { sum / n as f64 } else { 0.0 };
    }

    fn run_ao<T: Intersect>(
        &self,
        make_tracer: &(impl Fn() -> T + Sync),
        rays: &[SecondaryRay],
        result: &mut BenchResult,
    ) {
        let mut occluded = vec![false; rays.len()];
        let (batch, size) = (self.in_batches(rays), self.settings.batch);
        let mut chunks: Vec<&mut [bool]> = occluded.chunks_mut(self.settings.task_size()).collect();
        let mut pass = |threads| match &batch {
            Some(batch) => parallel(threads, make_tracer, &mut chunks, |tracer, chunk, out| {
                tracer.occluded_batch(&batch[chunk * size..][..out.len()], out);
            }),
            None => parallel(threads, make_tracer, &mut chunks, |tracer, chunk, out| {
                for (ray, out) in rays[chunk * CHUNK..].iter().zip(out.iter_mut()) {
                    *out = tracer.occluded(&ray.ray());
                }
            }),
        };
        result.ao_first_s = pass(self.settings.threads).0;
        self.counter.done();
        result.ao = Some(measure(&self.settings, &self.counter, rays.len(), &mut pass));
        result.ao_rays = rays.len();
        result.ao_occluded = share(&occluded);
    }

    fn run_diffuse<T: Intersect>(
        &self,
        make_tracer: &(impl Fn() -> T + Sync),
        rays: &[SecondaryRay],
        is_hit: &mut [bool],
    ) -> Rates {
        if let Some(rays) = self.in_batches(rays) {
            return self.run_diffuse_in_batches(make_tracer, &rays, is_hit);
        }
        let mut chunks: Vec<&mut [bool]> = is_hit.chunks_mut(CHUNK).collect();
        measure(&self.settings, &self.counter, rays.len(), &mut |threads| {
            parallel(threads, make_tracer, &mut chunks, |tracer, chunk, out| {
                for (ray, out) in rays[chunk * CHUNK..].iter().zip(out.iter_mut()) {
                    *out = tracer.closest(&ray.ray()).is_some();
                }
            })
        })
    }

    fn run_diffuse_in_batches<T: Intersect>(
        &self,
        make_tracer: &(impl Fn() -> T + Sync),
        rays: &[Ray],
        is_hit: &mut [bool],
    ) -> Rates {
        let size = self.settings.batch;
        let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
        let mut chunks: Vec<&mut [Option<Hit>]> = hits.chunks_mut(size).collect();
        let rates = measure(&self.settings, &self.counter, rays.len(), &mut |threads| {
            parallel(threads, make_tracer, &mut chunks, |tracer, chunk, out| {
                tracer.closest_batch(&rays[chunk * size..][..out.len()], out);
            })
        });
        is_hit.iter_mut().zip(&hits).for_each(|(is_hit, hit)| *is_hit = hit.is_some());
        rates
    }

    /// The rays as the tracer takes them in batches, if it is to get them so.
    fn in_batches(&self, rays: &[SecondaryRay]) -> Option<Vec<Ray>> {
        (self.settings.batch > 0).then(|| rays.iter().map(SecondaryRay::ray).collect())
    }

    /// AO and diffuse rays from the primary hits, whose triangles are asked for once more: so no pass has to write them
    /// down.
    fn secondary_rays(&self, tracer: &mut impl Intersect) -> (Vec<SecondaryRay>, Vec<SecondaryRay>) {
        let n_ao = if self.settings.passes[1] { self.settings.ao } else { 0 };
        let offset = (1e-4 * self.settings.diagonal) as f32;
        let (mut ao, mut diffuse) = (Vec::new(), Vec::new());
        for &place in &self.order {
            let (hit, pixel) = (&self.hits[place], self.pixel[place]);
            if hit.t == f32::INFINITY {
                continue;
            }
            let ray = Ray::new(self.eye, self.primary[place]);
            let (start, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
            let length = hit.normal.length();
            let sign = if hit.normal.dot(direction) > 0.0 { -1.0 } else { 1.0 };
            let normal = hit.normal * (sign / length);
            let origin = start + hit.t * direction + offset * normal;
            let from = self.settings.tells_start.then(|| tracer.closest(&ray)).flatten().map(|hit| hit.primitive);
            let along = |sample: u32| {
                let direction = cosine_direction(normal, uniform(pixel, 2 * sample), uniform(pixel, 2 * sample + 1));
                // A little more, for the roundings of the origin.
                SecondaryRay { ray: BenchRay { origin, direction }, from, above: 1.01 * offset }
            };
            ao.extend((0..n_ao).map(along));
            diffuse.push(along(self.settings.ao));
        }
        (ao, diffuse)
    }

    /// The primary hits as bytes: row by row, seven little-endian f32 a pixel: t, face, u, v, normal; a miss is
    /// (infinity, -1, 0, 0, 0, 0, 0).
    pub fn hit_bytes(&self) -> Vec<u8> {
        let mut image = vec![0u8; self.hits.len() * 28];
        for (hit, &pixel) in self.hits.iter().zip(&self.pixel) {
            let face = if hit.t == f32::INFINITY { -1.0 } else { hit.face as f32 };
            let values = [hit.t, face, hit.u, hit.v, hit.normal.x, hit.normal.y, hit.normal.z];
            let out = image[pixel as usize * 28..][..28].chunks_exact_mut(4);
            out.zip(values).for_each(|(out, value)| out.copy_from_slice(&value.to_le_bytes()));
        }
        image
    }
}

/// Traces the primary rays of a tile, those of a few pixels side by side at a time.
fn trace_in_packets<T: Intersect>(
    tracer: &mut T,
    eye: DVec3,
    tile: PixelRect,
    mut directions: &[DVec3],
    mut hits: &mut [BenchHit],
    bench_hit: &impl Fn(Option<&Hit>) -> BenchHit,
) {
    let mut found = [None; PACKET];
    for block in tile.blocks(PACKET_SIZE) {
        let n = block.n_pixels();
        let of_block = directions.split_off(..n).expect("a ray for each pixel");
        let to = hits.split_off_mut(..n).expect("a hit for each pixel");
        tracer.closest_from(eye, of_block, &mut found[..n]);
        to.iter_mut().zip(&found).for_each(|(to, hit)| *to = bench_hit(hit.as_ref()));
    }
}

/// The items of each tile, where they lie tile after tile.
fn split<'a, T>(mut items: &'a [T], tiles: &[PixelRect]) -> Vec<&'a [T]> {
    let of_tile = |tile: &PixelRect| items.split_off(..tile.n_pixels()).expect("an item for each pixel");
    tiles.iter().map(of_tile).collect()
}

/// The same to be written.
fn split_mut<'a, T>(mut items: &'a mut [T], tiles: &[PixelRect]) -> Vec<&'a mut [T]> {
    let of_tile = |tile: &PixelRect| items.split_off_mut(..tile.n_pixels()).expect("an item for each pixel");
    tiles.iter().map(of_tile).collect()
}

fn share(flags: &[bool]) -> f64 {
    if flags.is_empty() {
        return 0.0;
    }
    flags.iter().filter(|&&f| f).count() as f64 / flags.len() as f64
}

/// Runs all tasks on `threads` threads; returns wall seconds and the CPU seconds of all threads.
fn parallel<T, R: Send>(
    threads: usize,
    make_tracer: &(impl Fn() -> T + Sync),
    tasks: &mut [&mut [R]],
    work: impl Fn(&mut T, usize, &mut [R]) + Sync,
) -> (f64, f64) {
    let next = AtomicUsize::new(0);
    let tasks: Vec<_> = tasks.iter_mut().map(|task| Mutex::new(&mut **task)).collect();
    let worker = || {
        let mut tracer = make_tracer();
        let before = thread_cpu().as_secs_f64();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(task) = tasks.get(i) else { break };
            work(&mut tracer, i, &mut task.lock());
        }
        thread_cpu().as_secs_f64() - before
    };
    let start = Instant::now();
    let cpu = on_threads(threads, worker).iter().sum();
    (start.elapsed().as_secs_f64(), cpu)
}

fn measure(
    settings: &BenchSettings,
    counter: &Counter<'_>,
    rays: usize,
    pass: &mut impl FnMut(usize) -> (f64, f64),
) -> Rates {
    let mut with = |threads: usize| {
        let (mut wall, mut cpu) = (Vec::new(), Vec::new());
        for _ in 0..settings.repeat {
            let (w, c) = pass(threads);
            counter.done();
            wall.push(w);
            cpu.push(c / threads as f64);
        }
        let millions = 1e-6 * rays as f64;
        let best = wall.iter().copied().fold(f64::INFINITY, f64::min);
        if rays == 0 {
            return Rate::default();
        }
        Rate { median: millions / median(&mut wall), best: millions / best, cpu: millions / median(&mut cpu) }
    };
    let t1 = with(1);
    Rates { t1, tn: if settings.threads > 1 { with(settings.threads) } else { t1 } }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n % 2 == 1 { values[n / 2] } else { 0.5 * (values[n / 2 - 1] + values[n / 2]) }
}

/// A number in [0,1) from two, with 24 bits.
fn uniform(a: u32, b: u32) -> f32 {
    (hash2(a, b) >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A cosine-distributed direction about the unit vector `n`, in the frame of Duff et al. 2017; f32 throughout, as the
/// recipe has it.
fn cosine_direction(n: Vec3, u1: f32, u2: f32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * u1).sin_cos();
    let r = u2.sqrt();
    let sign = 1f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let tangent = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let bitangent = Vec3::new(b, sign + n.y * n.y * a, -n.y);
    r * cos * tangent + r * sin * bitangent + (1.0 - u2).max(0.0).sqrt() * n
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn median_of_even_and_odd_counts() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
    }

    #[test]
    fn polygon_parameters_tell_the_sub_quad() {
        let hit = Hit {
            t: 1.0,
            primitive: crate::math::PrimitiveRef {
                mesh: crate::ids::MeshId(0),
                patch: crate::ids::PatchId(0),
                cell: [0; 2],
                half: 0,
            },
            face: crate::ids::FaceId(0),
            sub: 6,
            u: 0.25,
            v: 0.75,
            normal_in_object: DVec3::X,
            on_triangle: Default::default(),
        };
        assert_eq!(face_parameters(5, &hit), [4.75, 3.25]);
        assert_eq!(face_parameters(4, &hit), [0.25, 0.75]);
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        let settings = BenchSettings {
            size: [37, 21],
            threads: 1,
            ao: 1,
            batch: 0,
            one_by_one: false,
            tells_start: true,
            repeat: 1,
            passes: [true; 3],
            diagonal: 1.0,
        };
        let description =
            crate::scene::description::CameraDescription { eye: DVec3::ZERO, at: DVec3::X, up: DVec3::Y, fov: 35.0 };
        let mut pixels = Bench::new(&Camera::new(&description), settings, &|_, _| ()).pixel;
        pixels.sort_unstable();
        assert_eq!(pixels, (0..37 * 21).collect::<Vec<_>>());
    }
}
