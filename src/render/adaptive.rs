//! `--groups adaptive`: few rays, a bounded error.
//!
//! The picture is refined from cells of 16 pixels down to single ones. Nine **probes** of a cell are traced; it is
//! interpolated only if they have seen one piece of smooth surface under the same lights, if no patch could have
//! slipped between them (`footprint`), and if the four corner probes predict the five others within the tolerance.
//! Otherwise it is split in four. A group in Ke's sense is a cell that holds; it may span several patches, wherever
//! these are one smooth surface.
//!
//! What is interpolated (`between_probes`) is not colour but what varies smoothly (depth, normal, light from
//! reflections), from the four nearest probes; direct light is then computed again for the pixel, so that highlights
//! and patterns stay sharp. The four nearest are twice as close as those that the prediction was checked with, which
//! for a smooth function makes the error a quarter of the one that was measured. Where the surface is may be in doubt
//! by as much as depths of probes were off, or their tangent planes disagree; a pixel with the edge of a pattern in
//! that reach is traced.
//!
//! What may be where is known from footprints; of shadows and mirror images they know nothing. These are followed
//! (`follow`) from traced pixels into the cells that hold, within a tile and, once all tiles are there, across their
//! seams (`canvas`).
//!
//! # Invariants
//! 1. Interpolation has no access to a tracer: an interpolated pixel touches no grid.
//! 2. A tile depends on nothing but the scene, the camera and the settings, and on what the tiles around it show at
//!    their sides before edges are followed across; tiles lie at multiples of 64 pixels, whatever the window. So
//!    neither threads nor a crop change a pixel. A picture that was cancelled may lack edges that lead from one tile to
//!    the next.
//! 3. A pixel that is not interpolated has, bit for bit, the colour that it has without groups; but where pixels have
//!    several samples, corners and probes of cells that hold have the first one alone, and some others are settled with
//!    two of them (`samples`).
//!
//! Ke, "Feature Adaptive Ray Tracing of Subdivision Surfaces", 2017, chapter 5.3 (groups); Akimoto et al.,
//! "Pixel-selected ray tracing", 1991 (refinement by prediction).

use super::between_probes::{Errors, Interpolation};
use super::canvas::{Canvas, Surprises, look};
use super::cells::{CELL_SIDES, Cell, CellPlace, TILE_SIDE, Tile, TracedProbe};
use super::film::{FirstHit, PixelRecord};
use super::follow::{Origin, beside_traced, display_difference, follow, is_surprised};
use super::footprint::{Claim, Footprints, Scenery};
use super::integrators::{LightMasks, Probe, Sample, Shader, Smooth};
use super::rays::RayCounts;
use super::reason::{PixelCounts, Reason};
use super::settings::{Appearance, RenderSettings, RunSettings};
use super::tiles::PixelRect;
use super::tracer::{Built, Tracer};
use super::workers::{Exposure, GroupSeconds, Rendered, TileQueue, render};
use crate::ids::{MeshId, PatchId};
use crate::parallel::on_threads;
use crate::scene::camera::Camera;
use crate::scene::world::World;
use glam::Vec3;
use parking_lot::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Probes whose normals are further from the others' mean than this, as a cosine, have a crease between them.
pub(super) const CREASE_COSINE: f32 = 0.8;

/// The same for what is reflected and refracted, as the length of a difference of normals times the share of their
/// light: faint images may be turned as they like. With 0.63, two more of 150 pictures of mirrors lose a glint at one
/// sample; with 0.2 as many are lost.
const MOST_TURNED: f32 = 0.4;

/// How far from a pixel that contradicts others are traced. What is about a pixel thin comes and goes: with 1 instead
/// of 2, 2 % fewer rays are traced on trex, and gaps of a pixel end a line.
const REACH: i32 = 2;

/// Renders a picture, tracing only the pixels that need it.
pub fn render_adaptive<T: Tracer>(
    world: &World,
    camera: &Camera,
    appearance: &Appearance,
    settings: &RenderSettings,
    run: &RunSettings<'_>,
    make_tracer: impl Fn() -> T + Sync,
) -> Rendered {
    if settings.tolerance <= 0.0 {
        return render(camera, appearance, settings, run, make_tracer);
    }
    let scenery = Scenery::new(world, camera, settings);
    let job = Interpolation { run, camera, appearance, settings };
    let in_workers = |threads: usize, work: &(dyn Fn(&mut Worker<'_, '_, T>) + Sync)| {
        let outcomes = on_threads(threads, || {
            let mut tracer = make_tracer();
            let shader = Shader::new(&mut tracer, appearance, settings);
            let footprints = Footprints::new(&scenery);
            let tile = Tile::new(settings.size);
            let mut worker =
                Worker { job: &job, footprints, shader, tile, probed: Vec::new(), outcome: Outcome::default() };
            work(&mut worker);
            Outcome { rays: worker.shader.rays(), ..worker.outcome }
        });
        outcomes.into_iter().fold(Outcome::default(), Outcome::and)
    };
    let canvas = Mutex::new(Canvas::new(canvas_window(settings), &settings.aovs));
    let queue = TileQueue::new(aligned(canvas_window(settings)), TILE_SIDE, run);
    let tiles = in_workers(run.threads, &|worker| worker.work(&queue, &canvas));
    let surprises = canvas.lock().surprises(aligned(settings.window), job.edge());
    let next = AtomicUsize::new(0);
    let mut seams = in_workers(run.threads.min(surprises.len()), &|worker| {
        while let Some(surprises) = surprises.get(next.fetch_add(1, Ordering::Relaxed)) {
            if run.cancel.load(Ordering::Relaxed) {
                break;
            }
            worker.follow_across_seams(surprises, &canvas);
        }
    });
    let corrected = std::mem::take(&mut seams.pixels).of(Reason::Neighbour);
    let Outcome { rays, mut pixels, seconds } = tiles.and(seams);
    pixels.change(Reason::Interpolated, Reason::Neighbour, corrected);
    let film = canvas.into_inner().into_film(settings.window);
    let complete = film.n_done() == settings.window.n_pixels();
    Rendered { film, rays, pixels, seconds, complete }
}

/// The pixels that have to be rendered for those that were asked for: whole tiles and those around them, because edges
/// may come from there.
pub(super) fn canvas_window(settings: &RenderSettings) -> PixelRect {
    let picture = PixelRect::whole(settings.size);
    let PixelRect { x0, y0, x1, y1 } = aligned(settings.window);
    let [x0, y0] = [x0, y0].map(|n| n.saturating_sub(TILE_SIDE));
    PixelRect { x0, y0, x1: x1 + TILE_SIDE, y1: y1 + TILE_SIDE }.intersection(picture)
}

/// The window with its borders moved outwards to those of tiles.
fn aligned(window: PixelRect) -> PixelRect {
    let down = |n: u32| n - n % TILE_SIDE;
    let up = |n: u32| n.next_multiple_of(TILE_SIDE);
    PixelRect { x0: down(window.x0), y0: down(window.y0), x1: up(window.x1), y1: up(window.y1) }
}

/// What one worker has done.
#[derive(Default)]
struct Outcome {
    rays: RayCounts,
    pixels: PixelCounts,
    seconds: GroupSeconds,
}

impl Outcome {
    fn and(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.pixels += other.pixels;
        self.seconds.prepare += other.seconds.prepare;
        self.seconds.trace += other.seconds.trace;
        self.seconds.interpolate += other.seconds.interpolate;
        self
    }
}

/// Renders tiles. How many samples its pixels take is told in `samples`.
pub(super) struct Worker<'j, 's, T> {
    pub(super) job: &'j Interpolation<'j>,
    footprints: Footprints<'j>,
    pub(super) shader: Shader<'s, T>,
    pub(super) tile: Tile,
    /// Scratch: pixels whose probes are to be traced.
    probed: Vec<[u32; 2]>,
    outcome: Outcome,
}

impl<T: Tracer> Worker<'_, '_, T> {
    fn work(&mut self, queue: &TileQueue<'_>, canvas: &Mutex<Canvas>) {
        let shown = self.job.settings.window;
        let mut records = Vec::with_capacity(TILE_SIDE.pow(2) as usize);
        while let Some(tile) = queue.next_tile() {
            let area = tile.intersection(PixelRect::whole(self.job.settings.size));
            let watch = Instant::now();
            self.footprints.find([tile.x0, tile.y0]);
            self.outcome.seconds.prepare += watch.elapsed().as_secs_f64();
            if self.footprints.is_bare() {
                self.outcome.pixels.add(Reason::Background, area.intersection(shown).n_pixels() as u64);
                canvas.lock().fill(area, &self.job.background());
            } else {
                if !self.render(area, &mut records) {
                    break;
                }
                let counted = area.pixels().zip(&records).filter(|(pixel, _)| shown.idx(*pixel).is_some());
                counted.for_each(|(_, record)| self.outcome.pixels.add(record.reason, 1));
                canvas.lock().store(area, &records);
            }
            queue.report(tile.n_pixels());
        }
    }

    /// Fills `records` with the pixels of a tile; returns whether they are complete, which those of a tile of many
    /// samples are not if the render was cancelled meanwhile.
    fn render(&mut self, tile: PixelRect, records: &mut Vec<PixelRecord>) -> bool {
        let watch = Instant::now();
        records.clear();
        records.resize(tile.n_pixels(), self.job.background());
        self.tile.reset([tile.x0, tile.y0]);
        if self.is_grouped() {
            self.shader.aim(self.job.camera, tile);
            (0..CELL_SIDES.len()).for_each(|level| self.refine(level));
        } else {
            self.split_all();
        }
        if self.is_sampled_by_need() {
            self.look_everywhere(tile);
        }
        self.trace_all(tile, records);
        self.follow_samples(tile, records);
        let traced = watch.elapsed();
        for (record, pixel) in records.iter_mut().zip(tile.pixels()) {
            if record.reason == Reason::Interpolated {
                *record = self.job.pixel(&self.tile, pixel);
            }
        }
        let interpolated = watch.elapsed() - traced;
        self.follow_within(tile, records);
        self.outcome.seconds.trace += (watch.elapsed() - interpolated).as_secs_f64();
        self.outcome.seconds.interpolate += interpolated.as_secs_f64();
        !self.job.is_given_up()
    }

    fn is_grouped(&self) -> bool {
        self.job.is_possible() && !self.footprints.is_crowded()
    }

    /// Traces the pixels that need it.
    fn trace_all(&mut self, tile: PixelRect, records: &mut [PixelRecord]) {
        self.along_curve(tile, |worker, pixels| {
            for pixel in pixels {
                if worker.job.is_given_up() {
                    return;
                }
                records[tile.idx(pixel).expect("the curve stays in the tile")] = worker.traced(pixel);
            }
        });
    }

    /// Goes to the largest cells that are not empty, and hands over the pixels of each along a Z curve: neighbours hit
    /// the same blocks.
    pub(super) fn along_curve(
        &mut self,
        tile: PixelRect,
        mut visit: impl FnMut(&mut Self, &mut dyn Iterator<Item = [u32; 2]>),
    ) {
        let place = |k: u32| [tile.x0 + even_bits(k), tile.y0 + even_bits(k >> 1)];
        let per_cell = CELL_SIDES[0].pow(2);
        for first in (0..TILE_SIDE.pow(2)).step_by(per_cell as usize) {
            let largest = self.tile.place(0, place(first));
            if self.job.is_given_up() || matches!(self.tile.cell(&largest), Cell::Empty | Cell::Undivided) {
                continue;
            }
            self.shader.aim(self.job.camera, largest.pixels());
            let pixels = (first..first + per_cell).map(place);
            visit(self, &mut pixels.filter(|&pixel| tile.idx(pixel).is_some()));
        }
    }

    /// Follows edges that traced pixels of the tile show into its groups.
    fn follow_within(&mut self, tile: PixelRect, records: &mut [PixelRecord]) {
        let (edge, spp) = (self.job.edge(), self.job.settings.spp);
        let look_at = |pixel| tile.idx(pixel).map(|idx| look(&records[idx], spp));
        let nearby = beside_traced(tile, records.iter().map(|record| look(record, spp).origin));
        let surprised = nearby.filter(|&pixel| is_surprised(pixel, edge, |_| true, look_at)).collect();
        follow(tile, REACH, surprised, |pixel| {
            let record = &mut records[tile.idx(pixel).expect("edges are followed within the tile")];
            let expected = Vec3::from(record.color);
            look(record, spp).origin == Origin::Interpolated && {
                let exposure = self.first_sample(pixel);
                *record = self.followed(pixel, exposure);
                display_difference(expected, Vec3::from(record.color)) > edge
            }
        });
    }

    /// Follows edges that the tiles around show into the groups of one.
    fn follow_across_seams(&mut self, surprises: &Surprises, canvas: &Mutex<Canvas>) {
        let watch = Instant::now();
        let Surprises { tile, pixels } = surprises;
        follow(*tile, REACH, pixels.clone(), |pixel| {
            let Some(expected) = canvas.lock().interpolated(pixel) else { return false };
            let record = self.followed(pixel, Exposure::default());
            canvas.lock().correct(pixel, &record);
            if self.job.settings.window.idx(pixel).is_some() {
                self.outcome.pixels.add(record.reason, 1);
            }
            display_difference(expected, Vec3::from(record.color)) > self.job.edge()
        });
        self.outcome.seconds.trace += watch.elapsed().as_secs_f64();
    }

    /// A pixel that an edge may reach: all samples after those of `exposure`.
    fn followed(&mut self, pixel: [u32; 2], mut exposure: Exposure) -> PixelRecord {
        self.job.pixels().expose(&mut self.shader, pixel, &mut exposure, self.job.settings.spp);
        PixelRecord { reason: Reason::Neighbour, ..exposure.record() }
    }

    /// For integrators whose samples are random, and crowds of patches: what no patch reaches is known all the same.
    fn split_all(&mut self) {
        for level in 0..CELL_SIDES.len() {
            for place in self.tile.cells_to_judge(level) {
                let is_empty = self.footprints.is_empty(place.pixels());
                self.tile.set_cell(&place, if is_empty { Cell::Empty } else { Cell::Split(Reason::Every) });
            }
        }
    }

    fn refine(&mut self, level: usize) {
        // Where no larger cell holds, the smallest cost more than they save.
        let is_hopeless = level + 1 == CELL_SIDES.len() && !self.tile.any_holds();
        for place in self.tile.cells_to_judge(level) {
            let cell = if self.footprints.is_empty(place.pixels()) {
                Cell::Empty
            } else if is_hopeless {
                Cell::Split(Reason::Every)
            } else {
                self.trace_probes(place.probe_pixels(), |_, _| true);
                self.judge(&place)
            };
            self.tile.set_cell(&place, cell);
        }
        if !self.job.appearance.can_reshade() {
            // A contradiction may be all that is seen of a thin shadow, and behind glass small things shine alone, with
            // no edge that leads to them.
            self.tile.split_beside_edges(level);
        }
    }

    /// Traces the centres of those pixels, none of them given twice, that are wanted and were not traced.
    pub(super) fn trace_probes(
        &mut self,
        pixels: impl IntoIterator<Item = [u32; 2]>,
        is_wanted: impl Fn(&Tile, [u32; 2]) -> bool,
    ) {
        let Self { job, footprints, shader, tile, probed, .. } = self;
        probed.clear();
        for pixel in pixels {
            if tile.probe(pixel).is_some() || !is_wanted(tile, pixel) {
                continue;
            }
            if footprints.is_empty(single(pixel)) {
                let sample = Sample { radiance: job.appearance.background, first: FirstHit::NONE };
                tile.set_probe(pixel, TracedProbe::new(Probe { sample, smooth: None }, Built::default()));
            } else {
                probed.push(pixel);
            }
        }
        let (mut traced, mut before) = (probed.iter(), shader.misses());
        let samples = probed.iter().map(|&pixel| job.pixels().sample(pixel, 0));
        shader.probes(job.camera, samples, |shader, probe| {
            let pixel = *traced.next().expect("a probe for each pixel");
            let misses = shader.misses();
            tile.set_probe(pixel, TracedProbe::new(probe, misses - before));
            before = misses;
        });
    }

    /// The pixel, unless it is to be interpolated: then a mere note of that.
    fn traced(&mut self, pixel: [u32; 2]) -> PixelRecord {
        let interpolation = self.job;
        let background = interpolation.background();
        let (place, cell) = self.tile.find(pixel);
        let reason = match cell {
            Cell::Undivided | Cell::Empty => return background,
            // A probe of a smaller cell beside this one had no say here: it is judged like any pixel.
            Cell::Holds { .. } if self.tile.probe(pixel).is_some() && !place.has_probe(pixel) => Reason::Neighbour,
            Cell::Holds { depth, .. } => match interpolation.probed(&self.tile, &place, pixel) {
                Some(record) => return record,
                None if interpolation.may_show_edge_of_pattern(&self.tile, &place, pixel, depth) => {
                    return PixelRecord {
                        reason: Reason::Pattern,
                        ..interpolation.pixels().trace(&mut self.shader, pixel)
                    };
                }
                None => return background.interpolated(),
            },
            Cell::Split(_) if self.footprints.is_empty(single(pixel)) => return background,
            Cell::Split(reason) => reason,
        };
        PixelRecord { reason, ..self.expose(pixel).record() }
    }
}

/// Every second bit, from bit 0: half of a place on the Z curve, along which neighbours follow one another.
fn even_bits(k: u32) -> u32 {
    let k = k & 0x5555_5555;
    let k = (k | k >> 1) & 0x3333_3333;
    let k = (k | k >> 2) & 0x0f0f_0f0f;
    let k = (k | k >> 4) & 0x00ff_00ff;
    (k | k >> 8) & 0xffff
}

impl PixelRecord {
    fn interpolated(self) -> Self {
        Self { reason: Reason::Interpolated, ..self }
    }
}

fn single([x, y]: [u32; 2]) -> PixelRect {
    PixelRect { x0: x, y0: y, x1: x + 1, y1: y + 1 }
}

impl<T> Worker<'_, '_, T> {
    /// Whether a cell whose probes are traced can be interpolated.
    fn judge(&mut self, place: &CellPlace) -> Cell {
        let Self { job, tile, footprints, .. } = self;
        let probes = place.probe_pixels().map(|pixel| tile.probe(pixel).expect("a judged cell has all its probes"));
        let Some(smooths) = all_smooth(&probes) else { return Cell::Split(Reason::Silhouette) };
        if let Some(reason) = first_difference(&smooths) {
            return Cell::Split(reason);
        }
        let Errors { color, depth } = job.prediction_errors(place, &probes, &smooths);
        // Footprints last: they take longest.
        match color <= job.settings.tolerance {
            false => Cell::Split(Reason::Contradiction),
            true if is_connected(footprints, place, &probes, smooths[0].outside) => Cell::Holds { error: color, depth },
            true => Cell::Split(Reason::Hidden),
        }
    }
}

/// Whether nothing but one piece of surface, that of the probes, is seen in a cell.
fn is_connected(footprints: &mut Footprints<'_>, place: &CellPlace, probes: &[&TracedProbe], outside: bool) -> bool {
    let mut hits: Vec<_> = Vec::with_capacity(probes.len());
    for first in probes.iter().map(|p| p.probe.sample.first) {
        let hit = (MeshId(first.mesh), PatchId(first.patch));
        if !hits.contains(&hit) {
            hits.push(hit);
        }
    }
    let farthest = probes.iter().fold(0.0, |far: f32, p| far.max(p.probe.sample.first.depth));
    footprints.agree(place.pixels(), &Claim { hits: &hits, outside, farthest })
}

fn all_smooth<'p, const N: usize>(probes: &[&'p TracedProbe; N]) -> Option<[&'p Smooth; N]> {
    let mut smooths = [probes[0].probe.smooth.as_ref()?; N];
    for (smooth, probe) in smooths.iter_mut().zip(probes) {
        *smooth = probe.probe.smooth.as_ref()?;
    }
    Some(smooths)
}

/// What keeps probes from being of one smooth surface in the same light.
fn first_difference(smooths: &[&Smooth]) -> Option<Reason> {
    let first = smooths[0];
    if smooths.iter().any(|s| (s.mesh, s.outside) != (first.mesh, first.outside)) {
        return Some(Reason::Silhouette);
    }
    let mean = smooths.iter().map(|s| s.normal).sum::<Vec3>().normalize_or_zero();
    if smooths.iter().any(|s| s.normal.dot(mean) < CREASE_COSINE) {
        return Some(Reason::Crease);
    }
    if all_lights(smooths).is_mixed() {
        return Some(Reason::Shadow);
    }
    let same_way = smooths.iter().all(|s| s.signature == first.signature);
    if same_way && mirror_one_surface(smooths) { None } else { Some(Reason::Reflection) }
}

/// Whether what probes see by reflection and refraction is no more turned than one surface may be.
fn mirror_one_surface(smooths: &[&Smooth]) -> bool {
    let mean = smooths.iter().map(|s| s.mirrored_normal).sum::<Vec3>() / smooths.len() as f32;
    smooths.iter().all(|s| s.mirrored_normal.distance(mean) <= MOST_TURNED)
}

fn all_lights(smooths: &[&Smooth]) -> LightMasks {
    smooths.iter().fold(LightMasks::default(), |all, s| all | s.lights)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seen by a mirror that reflects `share` of the light: something whose normal is `mirrored`.
    fn seen(share: f32, mirrored: Vec3) -> Smooth {
        Smooth {
            mesh: MeshId(0),
            outside: true,
            normal: Vec3::Y,
            inverse_depth: 1.0,
            secondary: Vec3::ONE,
            lights: LightMasks::default(),
            signature: 0,
            mirrored_normal: share * mirrored,
        }
    }

    #[test]
    fn an_edge_that_a_mirror_shows_is_one_even_if_one_mesh_is_on_both_its_sides() {
        let slightly_turned = Vec3::new(0.3, 1.0, 0.0).normalize();
        for (share, mirrored, expected) in [
            (0.9, slightly_turned, None),
            (0.9, Vec3::X, Some(Reason::Reflection)),
            (0.9, Vec3::ZERO, Some(Reason::Reflection)),
            (0.2, Vec3::X, None),
        ] {
            let (most, one) = (seen(share, Vec3::Y), seen(share, mirrored));
            assert_eq!(first_difference(&[&most, &most, &one, &most]), expected, "{share} of {mirrored}");
        }
    }
}
