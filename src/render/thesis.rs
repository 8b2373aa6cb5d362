//! `--groups thesis`: Ke 2017, chapter 5.3, as published, the baseline for everything else.
//!
//! Groups of pixels with the same item are found by breadth-first search; of each, the topmost, bottommost, leftmost
//! and rightmost pixel are traced, and the colours of the others are interpolated bilinearly between them. Nothing is
//! checked, so what lies between the corners, say a shadow's edge, is lost. Pixels without an item show the background.
//!
//! The thesis does not say how four outermost pixels span a bilinear quad. Here they are the quad top, right, bottom,
//! left; a pixel outside of it gets the nearest parameters, and in a group without extent in some direction, whose quad
//! has no area, the colour of the nearest corner.

use super::film::{Film, PixelRecord};
use super::groups::{NO_GROUP, PixelGroups};
use super::integrators::Shader;
use super::interpolate::{bilinear, inverse_bilinear, mean_value_weights};
use super::item_buffer::ItemBuffer;
use super::rays::RayCounts;
use super::reason::{PixelCounts, Reason};
use super::settings::{Appearance, RenderSettings, RunSettings};
use super::tracer::Tracer;
use super::workers::{GroupSeconds, PixelTracer, Rendered, TileQueue};
use crate::parallel::on_threads;
use crate::scene::camera::Camera;
use glam::{DVec2, Vec3};
use parking_lot::Mutex;
use rustc_hash::FxHashMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

/// Corner pixels a thread traces before it asks for more.
const CORNERS_PER_TASK: usize = 64;

/// How colours spread from the four corners of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// As published.
    Bilinear,
    /// Over the convex hull of the corners, by mean value coordinates.
    MeanValue,
}

/// Bytes that groups and their corners take at most: every pixel may be a group of its own.
pub(super) fn max_bytes(settings: &RenderSettings) -> usize {
    // A list of corners that doubles as it grows holds up to three times what it needs, a table of them up to 3.5 times.
    let traced = 7 * size_of::<(u32, PixelRecord)>();
    let per_pixel = 8 + size_of::<u32>() + 2 * size_of::<[u32; 4]>() + traced;
    settings.size.iter().map(|&n| n as usize).product::<usize>() * per_pixel
}

/// Renders by groups of equal items.
pub fn render_thesis<T: Tracer>(
    camera: &Camera,
    appearance: &Appearance,
    settings: &RenderSettings,
    run: &RunSettings<'_>,
    items: &ItemBuffer,
    interpolation: Interpolation,
    make_tracer: impl Fn() -> T + Sync,
) -> Rendered {
    let watch = Instant::now();
    let groups = PixelGroups::new(items);
    let corners = corners_to_trace(&groups, settings);
    let prepare = watch.elapsed().as_secs_f64();
    let watch = Instant::now();
    let (traced, rays) = trace(&corners, camera, appearance, settings, run, make_tracer);
    let trace_seconds = watch.elapsed().as_secs_f64() * run.threads as f64;
    let watch = Instant::now();
    let picture =
        Picture { groups: &groups, traced: &traced, settings, interpolation, background: appearance.background };
    let film = Mutex::new(Film::new(settings.window, &settings.aovs));
    // What was traced before a cancellation is kept.
    let never = AtomicBool::new(false);
    let run = &RunSettings { cancel: &never, ..*run };
    let queue = TileQueue::new(settings.window, run.tile_side, run);
    let counts = on_threads(run.threads, || picture.expose(&queue, &film));
    let mut pixels = PixelCounts::default();
    counts.into_iter().for_each(|counts| pixels += counts);
    let film = film.into_inner();
    let interpolate = watch.elapsed().as_secs_f64() * run.threads as f64;
    let seconds = GroupSeconds { prepare, trace: trace_seconds, interpolate };
    Rendered { complete: film.n_done() == settings.window.n_pixels(), film, rays, pixels, seconds }
}

/// Corner pixels of all groups that reach into the window, each once.
fn corners_to_trace(groups: &PixelGroups, settings: &RenderSettings) -> Vec<u32> {
    let width = settings.size[0] as usize;
    let mut is_wanted = vec![false; groups.len()];
    for [x, y] in settings.window.pixels() {
        let group = groups.of_pixels()[y as usize * width + x as usize];
        if group != NO_GROUP {
            is_wanted[group as usize] = true;
        }
    }
    let wanted = groups.corners().iter().zip(is_wanted).filter(|(_, wanted)| *wanted);
    let mut corners: Vec<u32> = wanted.flat_map(|(corners, _)| *corners).collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

type Traced = FxHashMap<u32, PixelRecord>;

fn trace<T: Tracer>(
    corners: &[u32],
    camera: &Camera,
    appearance: &Appearance,
    settings: &RenderSettings,
    run: &RunSettings<'_>,
    make_tracer: impl Fn() -> T + Sync,
) -> (Traced, RayCounts) {
    let next = AtomicUsize::new(0);
    let pixels = PixelTracer { camera, settings };
    let results = on_threads(run.threads, || {
        let mut tracer = make_tracer();
        let mut shader = Shader::new(&mut tracer, appearance, settings);
        let mut records = Vec::new();
        while !run.cancel.load(Ordering::Relaxed) {
            let start = next.fetch_add(CORNERS_PER_TASK, Ordering::Relaxed);
            if start >= corners.len() {
                break;
            }
            for &corner in &corners[start..(start + CORNERS_PER_TASK).min(corners.len())] {
                let pixel = [corner % settings.size[0], corner / settings.size[0]];
                records.push((corner, pixels.trace(&mut shader, pixel)));
            }
        }
        (records, shader.rays())
    });
    let mut traced = Traced::default();
    let mut rays = RayCounts::default();
    for (records, counts) in results {
        traced.extend(records);
        rays += counts;
    }
    (traced, rays)
}

struct Picture<'a> {
    groups: &'a PixelGroups,
    traced: &'a Traced,
    settings: &'a RenderSettings,
    interpolation: Interpolation,
    background: Vec3,
}

impl Picture<'_> {
    fn expose(&self, queue: &TileQueue<'_>, film: &Mutex<Film>) -> PixelCounts {
        let mut counts = PixelCounts::default();
        while let Some(tile) = queue.next_tile() {
            // A cancelled render may lack corners.
            let records: Option<Vec<PixelRecord>> = tile.pixels().map(|pixel| self.record(pixel)).collect();
            let Some(records) = records else { continue };
            records.iter().for_each(|record| counts.add(record.reason, 1));
            film.lock().store(tile, &records);
            queue.report(tile.n_pixels());
        }
        counts
    }

    /// `None` if a corner was not traced.
    fn record(&self, [x, y]: [u32; 2]) -> Option<PixelRecord> {
        let pixel = y * self.settings.size[0] + x;
        let group = self.groups.of_pixels()[pixel as usize];
        if group == NO_GROUP {
            return Some(PixelRecord::background(self.background.to_array()));
        }
        if let Some(record) = self.traced.get(&pixel) {
            return Some(PixelRecord { group, reason: Reason::Corner, ..*record });
        }
        let [top, bottom, left, right] = self.groups.corners()[group as usize];
        let quad = [top, right, bottom, left];
        let mut known = [Vec3::ZERO; 4];
        for (color, corner) in known.iter_mut().zip(&quad) {
            *color = Vec3::from(self.traced.get(corner)?.color);
        }
        let color = self.interpolated(DVec2::new(f64::from(x), f64::from(y)), quad.map(|c| self.place(c)), known);
        let first = self.traced.get(&top)?.first;
        let background = PixelRecord::background(color.to_array());
        Some(PixelRecord { group, reason: Reason::Interpolated, first, ..background })
    }

    fn interpolated(&self, p: DVec2, places: [DVec2; 4], colors: [Vec3; 4]) -> Vec3 {
        let spread = match self.interpolation {
            Interpolation::Bilinear => inverse_bilinear(p, places).map(|uv| bilinear(colors, uv)),
            Interpolation::MeanValue => mean_value_weights(p, places)
                .filter(|weights| weights.iter().all(|&w| w >= 0.0))
                .map(|weights| colors.iter().zip(weights).map(|(c, w)| *c * w as f32).sum()),
        };
        spread.unwrap_or_else(|| {
            let distance = |k: &usize| (places[*k] - p).length_squared();
            let nearest = (0..4).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            colors[nearest.expect("there are four")]
        })
    }

    fn place(&self, corner: u32) -> DVec2 {
        let width = self.settings.size[0];
        DVec2::new(f64::from(corner % width), f64::from(corner / width))
    }
}
